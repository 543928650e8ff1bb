//! Domain decomposition: each process holds some successive bins, their particles, and the rows of the grid that those reach.
//!
//! Bins are what sums go by, whoever holds them, so results have the same bits for any number of processes. A sort gives each
//! particle to the process of its bin. Bins are cut where their particles are many, by whole bins.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, bytes_of, cast_slice, cast_slice_mut};
use mmsmith_ranks::{Ranks, announce, exchange, gather, share};
use nalgebra::RealField;

use crate::error::{SetupError, StepError};
use crate::grid::Layout;
use crate::parallel::bins::BinRows;
use crate::particles::columns::EachColumn;
use crate::step::health::{Invalid, Outcome};

/// The part of a body that one process begins with: any part, as long as each particle is in one.
pub struct Share {
    /// The processes.
    pub ranks: Arc<dyn Ranks>,
    /// The numbers of this process's particles in the whole body, ascending.
    pub ids: Vec<u64>,
}

/// Which particles a process holds, each of which no other one does.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement<'a> {
    /// Their numbers in the whole body, ascending.
    pub ids: &'a Arc<Vec<u64>>,
    /// Incremented whenever the set of particles of this process changes.
    pub version: u64,
}

/// The part of the body that one process holds.
pub(crate) struct Part {
    pub(crate) ranks: Arc<dyn Ranks>,
    /// The numbers of the particles here, ascending.
    pub(crate) ids: Arc<Vec<u64>>,
    /// The particles that this process owns, where others are present for corners that they share.
    pub(crate) own: Option<Owned>,
    pub(crate) version: u64,
    /// The first bin of each process, and the number of bins.
    pub(crate) cuts: Vec<usize>,
}

/// The particles that this process owns, among those that are present as halo.
pub(crate) struct Owned {
    /// Their places, ascending.
    pub(crate) places: Vec<u32>,
    /// Their numbers in the whole body.
    pub(crate) ids: Arc<Vec<u64>>,
}

/// A cut is moved where a process has more particles than this share of the mean.
pub(crate) const UNEVEN: f64 = 1.1;

impl Part {
    pub(crate) fn new(Share { ranks, ids }: Share) -> Self {
        let ids = Arc::new(ids);
        Self { ranks, ids, own: None, version: 0, cuts: Vec::new() }
    }

    pub(crate) fn arrangement(&self) -> Arrangement<'_> {
        let ids = self.own.as_ref().map_or(&self.ids, |own| &own.ids);
        Arrangement { ids, version: self.version }
    }

    /// Cuts the bins anew where they are uneven, by the number of particles that this process has in each of them; gives the bins that
    /// this process holds from now on. A call of all.
    pub(crate) fn cut(&mut self, mut counts: Vec<u64>) -> Range<usize> {
        let Self { ranks, cuts: known, .. } = self;
        let bins = counts.len();
        let all = gather(&**ranks, &counts);
        let mut new: Vec<u64> = vec![0; ranks.count() + 1];
        if ranks.rank() == 0 {
            for (bin, count) in counts.iter_mut().enumerate() {
                *count = all.iter().skip(bin).step_by(bins).sum();
            }
            let cuts = match known.as_slice() {
                [_, ..] if unevenness(&counts, known) <= UNEVEN => known.clone(),
                _ => cuts(&counts, ranks.count()),
            };
            new = cuts.into_iter().map(|cut| cut as u64).collect();
        }
        share(&**ranks, 0, &mut new);
        *known = new.into_iter().map(|cut| cut as usize).collect();
        known[ranks.rank()]..known[ranks.rank() + 1]
    }

    /// The process that holds a bin.
    pub(crate) fn holder(&self, bin: usize) -> usize {
        self.cuts.partition_point(|&cut| cut <= bin) - 1
    }

    /// The outcome of all processes; a failed particle has its number in the whole body.
    pub(crate) fn reduce_outcome(&self, outcome: Outcome) -> Outcome {
        // The worst and first failure is the largest number; a new sort is less than any failure.
        const KIND: u32 = 60;
        const IDS: u64 = (1 << KIND) - 1;
        let code = match outcome.failure {
            Some((invalid, p)) => (4 - invalid as u64) << KIND | (IDS - self.ids[p]),
            None => u64::from(outcome.resort),
        };
        let code = self.ranks.largest(code);
        let invalid = match code >> KIND {
            4 => Invalid::Inverted,
            3 => Invalid::NotFinite,
            2 => Invalid::LeftGrid,
            1 => Invalid::TooLarge,
            _ => return Outcome { failure: None, resort: code == 1 },
        };
        Outcome { failure: Some((invalid, (IDS - (code & IDS)) as usize)), resort: false }
    }

    /// The error that the process of particle `id` tells, `describe(number here)`, at all of them.
    pub(crate) fn error_on_all_ranks(
        &self,
        id: usize,
        describe: impl FnOnce(usize) -> StepError,
    ) -> StepError {
        let own = self.ids.binary_search(&(id as u64)).ok();
        let holder = self.ranks.largest(own.map_or(0, |_| self.ranks.rank() as u64));
        let mut numbers = [0.0; StepError::NUMBERS];
        if let Some(p) = own {
            numbers = describe(p).about(id).to_numbers();
        }
        share(&*self.ranks, holder as usize, &mut numbers);
        StepError::from_numbers(&numbers)
    }

    /// The least of a positive number over all processes.
    pub(crate) fn least<T: RealField + Copy>(&self, value: Option<T>) -> T {
        let value =
            value.map_or(f64::MAX, |value| nalgebra::try_convert(value).unwrap_or(f64::MAX));
        // Positive numbers are ordered as their bits are.
        nalgebra::convert(f64::from_bits(!self.ranks.largest(!value.to_bits())))
    }
}

/// The largest number of processes that the rows of a grid keep busy.
pub(crate) fn most_ranks<const D: usize>(layout: &Layout<D>, rows: BinRows) -> usize {
    // Rows next to a wall across the last axis are updated together, by one process; those at the upper end may be of two bins.
    let [low, _] = layout.edges();
    if low.end > rows.first_row(1) { 1 } else { rows.count().saturating_sub(1).max(1) }
}

/// The first bin of each of `ranks` processes, and the number of bins: each has one at least, the last one two, and otherwise as
/// many particles as the others.
pub(crate) fn cuts(particles: &[u64], ranks: usize) -> Vec<usize> {
    let bins = particles.len();
    let total: u64 = particles.iter().sum();
    let mut cuts = vec![0];
    let (mut bin, mut before) = (0, 0);
    for rank in 1..ranks {
        let least = cuts[rank - 1] + 1;
        // The processes from this one on need a bin each, and the last one more.
        let most = bins - (ranks - rank) - 1;
        let wanted = total as f64 * rank as f64 / ranks as f64;
        while bin < most && (bin < least || before as f64 + 0.5 * particles[bin] as f64 <= wanted) {
            before += particles[bin];
            bin += 1;
        }
        cuts.push(bin);
    }
    cuts.push(bins);
    cuts
}

/// The most particles of a process over their mean.
pub(crate) fn unevenness(particles: &[u64], cuts: &[usize]) -> f64 {
    let of = |cut: &[usize]| particles[cut[0]..cut[1]].iter().sum::<u64>();
    let most = cuts.windows(2).map(of).max().unwrap_or(0);
    let total: u64 = particles.iter().sum();
    most as f64 * (cuts.len() - 1) as f64 / total.max(1) as f64
}

/// Lists of elements, one of each particle.
pub(crate) struct Lists<E> {
    ends: Vec<usize>,
    elements: Vec<E>,
}

impl<E: Copy> Lists<E> {
    pub(crate) fn new<I: IntoIterator<Item = E>>(lists: impl Iterator<Item = I>) -> Self {
        let mut all = Self { ends: Vec::new(), elements: Vec::new() };
        for list in lists {
            all.elements.extend(list);
            all.ends.push(all.elements.len());
        }
        all
    }

    pub(crate) fn of(&self, p: usize) -> &[E] {
        let start = if p == 0 { 0 } else { self.ends[p - 1] };
        &self.elements[start..self.ends[p]]
    }
}

/// Which elements go where, and in which order those that come are kept.
pub(crate) struct Move {
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
    /// The move of particles `ids` to the processes `to(place)`, to each of several or to none, and the numbers of those that are here
    /// afterwards, ascending. A call of all.
    pub(crate) fn new<'a>(
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

    pub(crate) fn all<E: Pod>(&self, elements: &[E]) -> Vec<E> {
        self.all_shares(1, elements)
    }

    /// As [`all`](Self::all) of lists of `share` elements each.
    pub(crate) fn all_shares<E: Pod>(&self, share: usize, elements: &[E]) -> Vec<E> {
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
    pub(crate) fn lists<E: Pod>(&self, lists: &Lists<E>) -> Lists<E> {
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

    /// Number of particles here afterwards.
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    pub(crate) fn replace<E: Pod>(&self, elements: &mut Vec<E>) {
        *elements = self.all(elements);
    }
}

impl EachColumn for &Move {
    fn column<E: Pod>(&mut self, share: usize, column: &mut Vec<E>) {
        *column = self.all_shares(share, column);
    }
}

/// Whether a grid of these rows can be shared out among so many processes.
pub(crate) fn admit<const D: usize>(
    ranks: usize,
    layout: &Layout<D>,
    rows: BinRows,
) -> Result<(), SetupError> {
    let most = most_ranks(layout, rows);
    if ranks > most { Err(SetupError::TooManyRanks { ranks, most }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_process_has_bins_and_none_many_more_particles_than_it_must(
            particles in proptest::collection::vec(0..1000_u64, 2..40),
            ranks in 1..39_usize,
        ) {
            let ranks = ranks.min(particles.len() - 1);
            let cuts = cuts(&particles, ranks);
            prop_assert_eq!((cuts.len(), cuts[0], cuts[ranks]), (ranks + 1, 0, particles.len()));
            prop_assert!(cuts.windows(2).all(|cut| cut[0] < cut[1]));
            prop_assert!(cuts[ranks] - cuts[ranks - 1] >= 2);
            if particles.len() >= 2 * ranks && particles.iter().all(|&count| count == particles[0]) {
                prop_assert!(unevenness(&particles, &cuts) <= 1.0 + ranks as f64 * 2.0 / particles.len() as f64);
            }
        }
    }
}
