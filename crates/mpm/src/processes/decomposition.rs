//! Domain decomposition: each process holds a box of tiles, their particles, and the nodes of the grid that those reach.
//!
//! Tiles are what sums go by, whoever holds them, so results have the same bits for any number of processes. A sort gives each
//! particle to the process of its tile. Cuts across each axis go between the pieces along it, so that processes have much the same number of
//! particles.

use std::sync::Arc;

use mmsmith_particles::{Arrangement, SetupError, StepError};
use mmsmith_ranks::{Ranks, add_to_first, share};
use mmsmith_rare_states::{RareState, met};
use mmsmith_threads::held::{Cuts, Held};
use mmsmith_threads::region::Region;
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
pub(crate) struct LocalBody<const D: usize> {
    pub(crate) ranks: Arc<dyn Ranks>,
    /// The numbers of the particles here, ascending.
    pub(crate) ids: Arc<Vec<u64>>,
    /// The particles that this process owns, where others are present for corners that they share.
    pub(crate) own: Option<Owned>,
    pub(crate) version: u64,
    /// How many processes there may be along each axis, in any of these ways.
    shapes: Vec<[usize; D]>,
    /// The pieces of each process, after the first sort.
    cuts: Option<Cuts<D>>,
    /// The process that holds each tile of the grid.
    holders: Vec<u32>,
}

/// The particles that this process owns, among those that are present as halo.
pub(crate) struct Owned {
    /// Their places, ascending.
    pub(crate) places: Vec<u32>,
    /// Their numbers in the whole body.
    pub(crate) ids: Arc<Vec<u64>>,
}

/// Numbers that are sent while a step advances a particle, about: it takes some 40 to 130 ns, and a number 1 or 2 with its copies, at 10 GB/s.
const NUMBERS_PER_PARTICLE: f64 = 50.0;

/// Cuts are moved where a process has more particles than this many times those that it must have.
pub(crate) const UNEVEN: f64 = 1.05;

impl<const D: usize> LocalBody<D> {
    /// Shares a grid out among processes.
    pub(crate) fn new(
        Share { ranks, ids }: Share,
        layout: &Layout<D>,
        tiles: &Tiles<D>,
    ) -> Result<Self, SetupError> {
        let most = most_along(layout, tiles);
        let count = ranks.count();
        let shapes = match ranks.along_axes() {
            None => shapes(count, &most),
            Some(asked) => {
                let asked_for = |along_axes: &[usize; D]| along_axes[..] == *asked;
                let found = shapes(count, &most).into_iter().find(asked_for);
                vec![found.ok_or_else(|| {
                    let (asked, most) = (asked.to_vec(), most.to_vec());
                    SetupError::ProcessGrid { asked, ranks: count, most }
                })?]
            }
        };
        if shapes.is_empty() {
            let fewer = (1..count).rev().find(|&fewer| !self::shapes(fewer, &most).is_empty());
            return Err(SetupError::TooManyRanks { ranks: count, most: fewer.unwrap_or(1) });
        }
        let (ids, holders) = (Arc::new(ids), Vec::new());
        Ok(Self { ranks, ids, own: None, version: 0, shapes, cuts: None, holders })
    }

    pub(crate) fn arrangement(&self) -> Arrangement<'_> {
        let ids = self.own.as_ref().map_or(&self.ids, |own| &own.ids);
        Arrangement { ids, version: self.version }
    }

    /// Cuts the tiles anew where they are uneven, by the tiles of the particles that this process has; gives the tiles that it holds from now
    /// on. A call of all.
    pub(crate) fn cut(
        &mut self,
        tiles: &Tiles<D>,
        keys: impl Iterator<Item = u32> + Clone,
    ) -> Held<D> {
        let along_axes = match &self.cuts {
            Some(known) => std::array::from_fn(|a| known.count(a)),
            None => self.shape(tiles, keys.clone()),
        };
        let Self { ranks, cuts: known, .. } = self;
        let mut counts = Counts::of(tiles, along_axes.map(|count| count > 1), keys);
        add_to_first(&**ranks, &mut counts.particles);
        let is_cut = |a: &usize| along_axes[*a] > 1;
        let length = (0..D).filter(is_cut).map(|a| along_axes[a] + 1).sum();
        let mut new: Vec<u64> = vec![0; length];
        if ranks.rank() == 0 {
            let best = counts.cuts(tiles, &along_axes);
            let limit = UNEVEN * counts.unevenness(&best);
            let cuts = match &*known {
                Some(known) if counts.unevenness(known) <= limit => known.clone(),
                _ => best,
            };
            if known.as_ref().is_some_and(|known| *known != cuts) {
                met(RareState::CutMoved);
            }
            let across = (0..D).filter(is_cut).flat_map(|a| &cuts.0[a]);
            new = across.map(|&cut| cut as u64).collect();
        }
        share(&**ranks, 0, &mut new);
        let mut rest = new.into_iter().map(|cut| cut as usize);
        let pieces = tiles.pieces();
        let cuts = Cuts(std::array::from_fn(|a| match is_cut(&a) {
            true => rest.by_ref().take(along_axes[a] + 1).collect(),
            false => vec![0, pieces[a]],
        }));
        if known.as_ref() != Some(&cuts) {
            let holder = |tile| cuts.holder(&tiles.pieces_of(tile)) as u32;
            self.holders = (0..tiles.count() as u32).map(holder).collect();
        }
        let held = Held::of(cuts.clone(), ranks.rank());
        self.cuts = Some(cuts);
        held
    }

    /// How many processes there are along each axis from now on: as many as cost the fullest of them the least. A call of all.
    fn shape(&self, tiles: &Tiles<D>, keys: impl Iterator<Item = u32>) -> [usize; D] {
        let Self { ranks, shapes, .. } = self;
        if let [only] = shapes[..] {
            return only;
        }
        let mut counts = Counts::of(tiles, [true; D], keys);
        add_to_first(&**ranks, &mut counts.particles);
        let mut best = [0_u64];
        if ranks.rank() == 0 {
            let cost = |along_axes| counts.cost(tiles, &counts.cuts(tiles, along_axes));
            let costs = shapes.iter().map(cost).zip(0..);
            best[0] = costs.min_by(|(a, _), (b, _)| a.total_cmp(b)).map_or(0, |(_, shape)| shape);
        }
        share(&**ranks, 0, &mut best);
        shapes[best[0] as usize]
    }

    /// The process that holds a tile, after tiles are cut.
    pub(crate) fn holder(&self, tile: u32) -> usize {
        self.holders[tile as usize] as usize
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

/// The largest number of processes along each axis.
fn most_along<const D: usize>(layout: &Layout<D>, tiles: &Tiles<D>) -> [usize; D] {
    // Rows next to a wall across the last axis are updated together, by one process; those at the upper end may be of two layers.
    let [low, _] = layout.edges();
    let is_one = low.end > tiles.first_row(1);
    let pieces = tiles.pieces();
    std::array::from_fn(|a| match a + 1 < D {
        true => (pieces[a] / tiles.least_held(a)).max(1),
        false if is_one => 1,
        false => pieces[a].saturating_sub(1).max(1),
    })
}

/// The ways to have `count` processes, at most so many along each axis.
fn shapes<const D: usize>(count: usize, most: &[usize; D]) -> Vec<[usize; D]> {
    let choices: usize = most[..D - 1].iter().product();
    let shape = |choice: usize| {
        let (mut rest, mut left) = (choice, count);
        let mut along_axes = [1; D];
        for a in 0..D - 1 {
            along_axes[a] = rest % most[a] + 1;
            rest /= most[a];
            if !left.is_multiple_of(along_axes[a]) {
                return None;
            }
            left /= along_axes[a];
        }
        along_axes[D - 1] = left;
        (left <= most[D - 1]).then_some(along_axes)
    };
    (0..choices).filter_map(shape).collect()
}

/// Numbers of particles by the pieces along some axes.
struct Counts<const D: usize> {
    /// The pieces that are told apart along each axis: all or one.
    pieces: Region<D>,
    particles: Vec<u64>,
}

impl<const D: usize> Counts<D> {
    /// Numbers of particles in these tiles, which are told apart along these axes.
    fn of(tiles: &Tiles<D>, told_apart: [bool; D], keys: impl Iterator<Item = u32>) -> Self {
        let all = tiles.pieces();
        let pieces = Region(std::array::from_fn(|a| 0..if told_apart[a] { all[a] } else { 1 }));
        let mut of_tiles = vec![0; tiles.count()];
        keys.for_each(|key| of_tiles[key as usize] += 1);
        let mut particles = vec![0; pieces.len()];
        for (tile, count) in (0..).zip(of_tiles) {
            let of_tile = tiles.pieces_of(tile);
            let place = std::array::from_fn(|a| if told_apart[a] { of_tile[a] } else { 0 });
            particles[pieces.index(&place)] += count;
        }
        Self { pieces, particles }
    }

    /// Cuts across each axis that share out the particles along it evenly.
    fn cuts(&self, tiles: &Tiles<D>, along_axes: &[usize; D]) -> Cuts<D> {
        let all = tiles.pieces();
        Cuts(std::array::from_fn(|a| {
            if along_axes[a] == 1 {
                return vec![0, all[a]];
            }
            let mut along = vec![0; all[a]];
            for (place, count) in self.particles.iter().enumerate() {
                along[self.pieces.place(place)[a]] += count;
            }
            let (least, last) = (tiles.least_held(a), if a + 1 < D { 0 } else { 1 });
            cuts(&along, along_axes[a], (least, least + last))
        }))
    }

    /// The particles of each process.
    fn of_ranks(&self, cuts: &Cuts<D>) -> Vec<u64> {
        let mut of_ranks = vec![0; (0..D).map(|a| cuts.count(a)).product()];
        for (place, count) in self.particles.iter().enumerate() {
            of_ranks[cuts.holder(&self.pieces.place(place))] += count;
        }
        of_ranks
    }

    /// The most particles of a process over their mean.
    fn unevenness(&self, cuts: &Cuts<D>) -> f64 {
        let of_ranks = self.of_ranks(cuts);
        let most = of_ranks.iter().max().copied().unwrap_or(0);
        let total: u64 = of_ranks.iter().sum();
        most as f64 * of_ranks.len() as f64 / total.max(1) as f64
    }

    /// The cost of a step for the fullest process, as so many numbers that it sends, errors after it included.
    fn cost(&self, tiles: &Tiles<D>, cuts: &Cuts<D>) -> f64 {
        let most = self.of_ranks(cuts).into_iter().max().unwrap_or(0) as f64;
        // Particles are numbered along axis 0 first, and processes add up errors of successive ones, four numbers each.
        let in_a_line = if D > 1 { cuts.count(0) } else { 1 };
        let elsewhere = most * (1.0 - 1.0 / in_a_line as f64);
        let nodes = tiles.sent(&std::array::from_fn(|a| cuts.count(a)));
        most * NUMBERS_PER_PARTICLE + (2 * D + 1) as f64 * nodes + 4.0 * elsewhere
    }
}

/// The first piece of each of `ranks` processes along an axis, and the number of pieces: each has `least` of them, the last one `last` at least. Of all
/// such cuts these leave the fewest particles to the process that has most.
fn cuts(particles: &[u64], ranks: usize, (least, last): (usize, usize)) -> Vec<usize> {
    let mut most = particles.iter().sum();
    let mut found = cuts_within(particles, ranks, (least, last), most);
    let mut too_few = 0;
    while too_few < most {
        let middle = too_few + (most - too_few) / 2;
        match cuts_within(particles, ranks, (least, last), middle) {
            Some(cuts) => (most, found) = (middle, Some(cuts)),
            None => too_few = middle + 1,
        }
    }
    // With all particles as a limit there are cuts.
    found.unwrap_or_default()
}

/// Cuts as [`cuts`] where no process has more than `most` particles, if there are any.
fn cuts_within(
    particles: &[u64],
    ranks: usize,
    (least, last): (usize, usize),
    most: u64,
) -> Option<Vec<usize>> {
    let pieces = particles.len();
    let (mut cuts, mut piece) = (vec![0], 0);
    for rank in 1..=ranks {
        // The processes after this one need their pieces.
        let of_others = if rank == ranks { 0 } else { (ranks - rank - 1) * least + last };
        let end = pieces.checked_sub(of_others)?;
        let needed = piece + if rank == ranks { last } else { least };
        let mut own = 0;
        while piece < end && (piece < needed || own + particles[piece] <= most) {
            own += particles[piece];
            piece += 1;
        }
        if own > most || piece < needed || (rank == ranks && piece < pieces) {
            return None;
        }
        cuts.push(piece);
    }
    Some(cuts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The most particles of a process over their mean.
    fn unevenness(particles: &[u64], cuts: &[usize]) -> f64 {
        let of = |cut: &[usize]| particles[cut[0]..cut[1]].iter().sum::<u64>();
        let most = cuts.windows(2).map(of).max().unwrap_or(0);
        let total: u64 = particles.iter().sum();
        most as f64 * (cuts.len() - 1) as f64 / total.max(1) as f64
    }

    proptest! {
        #[test]
        fn every_process_has_bins_and_none_many_more_particles_than_it_must(
            particles in proptest::collection::vec(0..1000_u64, 2..40),
            ranks in 1..39_usize,
        ) {
            let ranks = ranks.min(particles.len() - 1);
            let cuts = cuts(&particles, ranks, (1, 2));
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
