//! Moves of elements, which have numbers in the whole, between processes.

use std::sync::Arc;

use bytemuck::{Pod, cast_slice, cast_slice_mut};

use crate::{Ranks, announce, exchange};

/// Lists of elements, one for each place.
pub struct Lists<E> {
    ends: Vec<usize>,
    elements: Vec<E>,
}

impl<E> Lists<E> {
    /// Lists in the order of their places.
    pub fn new<I: IntoIterator<Item = E>>(lists: impl Iterator<Item = I>) -> Self {
        let mut all = Self { ends: Vec::new(), elements: Vec::new() };
        for list in lists {
            all.elements.extend(list);
            all.ends.push(all.elements.len());
        }
        all
    }

    /// How many lists there are.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// The list of a place.
    pub fn of(&self, p: usize) -> &[E] {
        let start = if p == 0 { 0 } else { self.ends[p - 1] };
        &self.elements[start..self.ends[p]]
    }
}

/// Where an element that is here after a move has been before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Here, at this place.
    Here(usize),
    /// Elsewhere: its place among those that come.
    Elsewhere(usize),
}

/// Which elements go where, and in which order those that come are kept.
pub struct Move {
    /// None where one process has all.
    ranks: Option<Arc<dyn Ranks>>,
    /// How many elements are here before.
    before: usize,
    /// The places of the elements that go to each other process.
    out: Vec<Vec<u32>>,
    /// How many come from each.
    counts: Vec<usize>,
    /// The places of those that are here afterwards, in their order: among the elements here, and behind them among those that come.
    order: Vec<u32>,
}

impl Move {
    /// The move of elements with the numbers `ids` to the processes `to(place)`, to each of several or to none, and the numbers of those that are here
    /// afterwards, ascending. Collective.
    pub fn new<'a>(
        ranks: Option<&Arc<dyn Ranks>>,
        ids: &[u64],
        to: &dyn Fn(usize) -> &'a [usize],
    ) -> (Self, Vec<u64>) {
        let mut out = vec![Vec::new(); ranks.map_or(1, |ranks| ranks.count())];
        for p in 0..ids.len() {
            to(p).iter().for_each(|&rank| out[rank].push(p as u32));
        }
        Self::arrange(ranks, ids, out)
    }

    /// The move of parts that elements may share, `of(place)` those of each element: to the processes of its elements, once to each. `ids` are the numbers
    /// of the parts; those of the parts that are here afterwards ascend. Collective.
    ///
    /// A part that several processes have comes from this one if it stays, or from the first of the others.
    pub fn of_parts<'a>(&self, ids: &[u64], of: &dyn Fn(usize) -> &'a [u32]) -> (Self, Vec<u64>) {
        let mut out: Vec<Vec<u32>> = Vec::with_capacity(self.out.len());
        let own = self.ranks.as_ref().map_or(0, |ranks| ranks.rank());
        let here = self.order.iter().copied().filter(|&p| (p as usize) < self.before);
        let stay: Vec<u32> = here.collect();
        // For each part behind the last process that has it.
        let mut given = vec![0; ids.len()];
        for (rank, elements) in self.out.iter().enumerate() {
            let elements = if rank == own { &stay } else { elements };
            let parts = elements.iter().flat_map(|&p| of(p as usize)).copied();
            let is_new =
                |part: &u32| std::mem::replace(&mut given[*part as usize], rank + 1) <= rank;
            out.push(parts.filter(is_new).collect());
        }
        let (mut moved, mut ids) = Self::arrange(self.ranks.as_ref(), ids, out);
        let mut last = None;
        let mut is_first = ids.iter().map(|&id| last.replace(id) != Some(id));
        moved.order.retain(|_| is_first.next().unwrap_or(false));
        ids.dedup();
        (moved, ids)
    }

    /// The move of the elements at the places `out` to each process.
    fn arrange(
        ranks: Option<&Arc<dyn Ranks>>,
        ids: &[u64],
        mut out: Vec<Vec<u32>>,
    ) -> (Self, Vec<u64>) {
        let stay = std::mem::take(&mut out[ranks.map_or(0, |ranks| ranks.rank())]);
        let lengths: Vec<usize> = out.iter().map(Vec::len).collect();
        let counts = ranks.map_or_else(|| vec![0], |ranks| announce(&**ranks, &lengths));
        let first = ids.len() as u32;
        let come = first..first + counts.iter().sum::<usize>() as u32;
        let order = stay.into_iter().chain(come).collect();
        let before = ids.len();
        let mut moved = Self { ranks: ranks.cloned(), before, out, counts, order };
        let ids = moved.all(ids);
        let mut by_id: Vec<u32> = (0..ids.len() as u32).collect();
        by_id.sort_unstable_by_key(|&place| (ids[place as usize], place));
        moved.order = by_id.iter().map(|&place| moved.order[place as usize]).collect();
        let ids = by_id.iter().map(|&place| ids[place as usize]).collect();
        (moved, ids)
    }

    /// The elements that are here afterwards, in their order. Collective.
    pub fn all<E: Pod>(&self, elements: &[E]) -> Vec<E> {
        self.all_shares(1, elements)
    }

    /// As [`all`](Self::all) of lists of `share` elements each.
    pub fn all_shares<E: Pod>(&self, share: usize, elements: &[E]) -> Vec<E> {
        let mut all = vec![E::zeroed(); share * self.len()];
        if share > 0 {
            self.fill(cast_slice_mut(&mut all), cast_slice(elements), share * size_of::<E>());
        }
        all
    }

    /// Elements as bytes, which are the same code for every element: there are many kinds of them, and each moves rarely.
    fn fill(&self, all: &mut [u8], elements: &[u8], size: usize) {
        let here = elements.len() / size;
        let list = |place: usize| &elements[place * size..(place + 1) * size];
        let counts: Vec<usize> = self.counts.iter().map(|count| count * size).collect();
        let others = self.coming(&list, &counts);
        for (own, &place) in all.chunks_exact_mut(size).zip(&self.order) {
            own.copy_from_slice(match (place as usize).checked_sub(here) {
                None => list(place as usize),
                Some(other) => &others[other * size..(other + 1) * size],
            });
        }
    }

    /// The bytes that come, so many from each process, in the order in which they do; `of` has those of the elements here.
    fn coming<'a>(&self, of: &dyn Fn(usize) -> &'a [u8], counts: &[usize]) -> Vec<u8> {
        let pick =
            |places: &Vec<u32>| places.iter().flat_map(|&p| of(p as usize)).copied().collect();
        let out: Vec<Vec<u8>> = self.out.iter().map(pick).collect();
        self.ranks.as_ref().map_or_else(Vec::new, |ranks| exchange(&**ranks, &out, counts))
    }

    /// Where each of the elements that are here afterwards comes from.
    pub fn sources(&self) -> impl Iterator<Item = Source> + Clone {
        self.order.iter().map(|&place| match (place as usize).checked_sub(self.before) {
            None => Source::Here(place as usize),
            Some(other) => Source::Elsewhere(other),
        })
    }

    /// The lists of the elements that come from other processes; `of` has those of the elements here. Collective.
    pub fn coming_lists<E: Pod, I: IntoIterator<Item = E>>(
        &self,
        of: impl Fn(usize) -> I,
    ) -> Lists<E> {
        let Some(ranks) = &self.ranks else { return Lists::new(std::iter::empty::<I>()) };
        let of_rank = |places: &Vec<u32>| Lists::new(places.iter().map(|&p| of(p as usize)));
        let out: Vec<Lists<E>> = self.out.iter().map(of_rank).collect();
        let lengths = |lists: &Lists<E>| -> Vec<u64> {
            (0..lists.count()).map(|p| lists.of(p).len() as u64).collect()
        };
        let lengths: Vec<Vec<u64>> = out.iter().map(lengths).collect();
        let lengths = exchange(&**ranks, &lengths, &self.counts);
        let mut rest = lengths.iter().map(|&length| length as usize);
        let counts: Vec<usize> =
            self.counts.iter().map(|&count| rest.by_ref().take(count).sum()).collect();
        let out: Vec<Vec<E>> = out.into_iter().map(|lists| lists.elements).collect();
        let ends = lengths.iter().scan(0, |end, &length| {
            *end += length as usize;
            Some(*end)
        });
        Lists { ends: ends.collect(), elements: exchange(&**ranks, &out, &counts) }
    }

    /// Number of elements here afterwards.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether no element is here afterwards.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Replaces elements by those that are here afterwards. Collective.
    pub fn replace<E: Pod>(&self, elements: &mut Vec<E>) {
        *elements = self.all(elements);
    }
}
