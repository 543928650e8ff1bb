//! Moves of elements, which have numbers in the whole, between processes.

use std::sync::Arc;

use bytemuck::{Pod, bytes_of, cast_slice, cast_slice_mut};

use crate::{Ranks, announce, exchange};

/// Lists of elements, one for each place.
pub struct Lists<E> {
    ends: Vec<usize>,
    elements: Vec<E>,
}

impl<E: Copy> Lists<E> {
    /// Lists in the order of their places.
    pub fn new<I: IntoIterator<Item = E>>(lists: impl Iterator<Item = I>) -> Self {
        let mut all = Self { ends: Vec::new(), elements: Vec::new() };
        for list in lists {
            all.elements.extend(list);
            all.ends.push(all.elements.len());
        }
        all
    }

    /// The list of a place.
    pub fn of(&self, p: usize) -> &[E] {
        let start = if p == 0 { 0 } else { self.ends[p - 1] };
        &self.elements[start..self.ends[p]]
    }
}

/// Which elements go where, and in which order those that come are kept.
pub struct Move {
    /// None where one process has all.
    ranks: Option<Arc<dyn Ranks>>,
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
        let stay = std::mem::take(&mut out[ranks.map_or(0, |ranks| ranks.rank())]);
        let lengths: Vec<usize> = out.iter().map(Vec::len).collect();
        let counts = ranks.map_or_else(|| vec![0], |ranks| announce(&**ranks, &lengths));
        let first = ids.len() as u32;
        let come = first..first + counts.iter().sum::<usize>() as u32;
        let order = stay.into_iter().chain(come).collect();
        let mut moved = Self { ranks: ranks.cloned(), out, counts, order };
        let ids = moved.all(ids);
        let mut by_id: Vec<u32> = (0..ids.len() as u32).collect();
        by_id.sort_unstable_by_key(|&place| ids[place as usize]);
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

    /// The lists of those that are here afterwards.
    pub fn lists<E: Pod>(&self, lists: &Lists<E>) -> Lists<E> {
        let bytes = self.byte_lists(&lists.ends, cast_slice(&lists.elements), size_of::<E>());
        let Lists { ends, elements } = bytes;
        let mut own = vec![E::zeroed(); elements.len() / size_of::<E>()];
        cast_slice_mut(&mut own).copy_from_slice(&elements);
        Lists { ends: ends.into_iter().map(|end| end / size_of::<E>()).collect(), elements: own }
    }

    fn byte_lists(&self, ends: &[usize], elements: &[u8], size: usize) -> Lists<u8> {
        let here = ends.len();
        let list = |p: usize| {
            let start = if p == 0 { 0 } else { ends[p - 1] };
            &elements[start * size..ends[p] * size]
        };
        let lengths: Vec<u64> = (0..here).map(|p| list(p).len() as u64).collect();
        let counts: Vec<usize> = self.counts.iter().map(|count| count * size_of::<u64>()).collect();
        let coming = self.coming(&|p| bytes_of(&lengths[p]), &counts);
        let coming = coming.as_chunks().0.iter().map(|bytes| u64::from_ne_bytes(*bytes) as usize);
        let mut rest = coming.clone();
        let counts: Vec<usize> =
            self.counts.iter().map(|count| rest.by_ref().take(*count).sum()).collect();
        let ends = coming.scan(0, |end, length| {
            *end += length;
            Some(*end)
        });
        let others = Lists { ends: ends.collect(), elements: self.coming(&list, &counts) };
        Lists::new(self.order.iter().map(|&place| {
            let place = place as usize;
            if place < here { list(place) } else { others.of(place - here) }.iter().copied()
        }))
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
