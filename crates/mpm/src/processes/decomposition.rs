//! Domain decomposition: each process holds some successive layers of tiles, their particles, and the rows of the grid that those reach.
//!
//! Tiles are what sums go by, whoever holds them, so results have the same bits for any number of processes. A sort gives each
//! particle to the process of its layer. Cuts go between layers, so that processes have much the same number of particles.

use std::ops::Range;
use std::sync::Arc;

use mmsmith_particles::{Arrangement, SetupError, StepError};
use mmsmith_ranks::{Ranks, add_to_first, share};
use mmsmith_rare_states::{RareState, met};
use nalgebra::RealField;

use crate::grid::Layout;
use crate::grid::tiles::Tiles;
use crate::step::health::{Invalid, Outcome};

/// The part of a body that one process begins with: any part, as long as each particle is in one.
pub struct Share {
    /// The processes.
    pub ranks: Arc<dyn Ranks>,
    /// The numbers of this process's particles in the whole body, ascending.
    pub ids: Vec<u64>,
}

/// The part of the body that one process holds.
pub(crate) struct LocalBody {
    pub(crate) ranks: Arc<dyn Ranks>,
    /// The numbers of the particles here, ascending.
    pub(crate) ids: Arc<Vec<u64>>,
    /// The particles that this process owns, where others are present for corners that they share.
    pub(crate) own: Option<Owned>,
    pub(crate) version: u64,
    /// The first layer of each process, and the number of layers.
    pub(crate) cuts: Vec<usize>,
}

/// The particles that this process owns, among those that are present as halo.
pub(crate) struct Owned {
    /// Their places, ascending.
    pub(crate) places: Vec<u32>,
    /// Their numbers in the whole body.
    pub(crate) ids: Arc<Vec<u64>>,
}

/// Cuts are moved where a process has more particles than this many times those that it must have.
pub(crate) const UNEVEN: f64 = 1.05;

impl LocalBody {
    pub(crate) fn new(Share { ranks, ids }: Share) -> Self {
        let ids = Arc::new(ids);
        Self { ranks, ids, own: None, version: 0, cuts: Vec::new() }
    }

    pub(crate) fn arrangement(&self) -> Arrangement<'_> {
        let ids = self.own.as_ref().map_or(&self.ids, |own| &own.ids);
        Arrangement { ids, version: self.version }
    }

    /// Cuts the layers anew where they are uneven, by the number of particles that this process has in each of them; gives the layers that
    /// this process holds from now on. A call of all.
    pub(crate) fn cut(&mut self, mut counts: Vec<u64>) -> Range<usize> {
        let Self { ranks, cuts: known, .. } = self;
        add_to_first(&**ranks, &mut counts);
        let mut new: Vec<u64> = vec![0; ranks.count() + 1];
        if ranks.rank() == 0 {
            let best = cuts(&counts, ranks.count());
            let limit = UNEVEN * unevenness(&counts, &best);
            let is_known_kept = !known.is_empty() && unevenness(&counts, known) <= limit;
            let cuts = if is_known_kept { known.clone() } else { best };
            if !known.is_empty() && *known != cuts {
                met(RareState::CutMoved);
            }
            new = cuts.into_iter().map(|cut| cut as u64).collect();
        }
        share(&**ranks, 0, &mut new);
        *known = new.into_iter().map(|cut| cut as usize).collect();
        known[ranks.rank()]..known[ranks.rank() + 1]
    }

    /// The process that holds a layer.
    pub(crate) fn holder(&self, layer: usize) -> usize {
        self.cuts.partition_point(|&cut| cut <= layer) - 1
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
pub(crate) fn most_ranks<const D: usize>(layout: &Layout<D>, tiles: &Tiles<D>) -> usize {
    // Rows next to a wall across the last axis are updated together, by one process; those at the upper end may be of two layers.
    let [low, _] = layout.edges();
    if low.end > tiles.first_row(1) { 1 } else { tiles.layers().saturating_sub(1).max(1) }
}

/// The first layer of each of `ranks` processes, and the number of layers: each has one at least, the last one two. Of all such cuts these leave
/// the fewest particles to the process that has most.
pub(crate) fn cuts(particles: &[u64], ranks: usize) -> Vec<usize> {
    let mut most = particles.iter().sum();
    let mut found = cuts_within(particles, ranks, most);
    let mut too_few = 0;
    while too_few < most {
        let middle = too_few + (most - too_few) / 2;
        match cuts_within(particles, ranks, middle) {
            Some(cuts) => (most, found) = (middle, Some(cuts)),
            None => too_few = middle + 1,
        }
    }
    // With all particles as a limit there are cuts.
    found.unwrap_or_default()
}

/// Cuts as [`cuts`] where no process has more than `most` particles, if there are any.
fn cuts_within(particles: &[u64], ranks: usize, most: u64) -> Option<Vec<usize>> {
    let layers = particles.len();
    let (mut cuts, mut layer) = (vec![0], 0);
    for rank in 1..=ranks {
        // The processes after this one need a layer each, and the last one more.
        let end = if rank == ranks { layers } else { layers - (ranks - rank) - 1 };
        let least = layer + 1;
        let mut own = 0;
        while layer < end && (layer < least || own + particles[layer] <= most) {
            own += particles[layer];
            layer += 1;
        }
        if own > most || (rank == ranks && layer < layers) {
            return None;
        }
        cuts.push(layer);
    }
    Some(cuts)
}

/// The most particles of a process over their mean.
pub(crate) fn unevenness(particles: &[u64], cuts: &[usize]) -> f64 {
    let of = |cut: &[usize]| particles[cut[0]..cut[1]].iter().sum::<u64>();
    let most = cuts.windows(2).map(of).max().unwrap_or(0);
    let total: u64 = particles.iter().sum();
    most as f64 * (cuts.len() - 1) as f64 / total.max(1) as f64
}

/// Whether a grid of these rows can be shared out among so many processes.
pub(crate) fn admit<const D: usize>(
    ranks: usize,
    layout: &Layout<D>,
    tiles: &Tiles<D>,
) -> Result<(), SetupError> {
    let most = most_ranks(layout, tiles);
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
            // Of all cuts none is better: tried where they are few.
            if particles.len() <= 8 {
                let inner = particles.len() - 1;
                for chosen in 0..1_usize << inner {
                    let places = (0..inner).filter(|place| chosen >> place & 1 == 1);
                    let other: Vec<usize> =
                        [0].into_iter().chain(places.map(|place| place + 1)).chain([inner + 1]).collect();
                    if other.len() == ranks + 1 && other[ranks] - other[ranks - 1] >= 2 {
                        prop_assert!(unevenness(&particles, &cuts) <= unevenness(&particles, &other));
                    }
                }
            }
            if particles.len() >= 2 * ranks && particles.iter().all(|&count| count == particles[0]) {
                prop_assert!(unevenness(&particles, &cuts) <= 1.0 + ranks as f64 * 2.0 / particles.len() as f64);
            }
        }
    }
}
