//! Domain decomposition: each process holds some successive bins, their particles, and the rows of the grid that those reach.
//!
//! Bins are what sums go by, whoever holds them, so results have the same bits for any number of processes. A sort gives each
//! particle to the process of its bin. Bins are cut where their particles are many, by whole bins.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, cast_slice};
use mmsmith_ranks::{Ranks, announce, exchange, gather, share};
use nalgebra::{RealField, SMatrix, SVector};

use crate::body::Mesh;
use crate::domain::HalfEdges;
use crate::error::{SetupError, StepError};
use crate::grid::Layout;
use crate::health::{Invalid, Outcome};
use crate::node::Node;
use crate::parallel::bins::BinRows;
use crate::parallel::coloring::Held;
use crate::particles::Particles;
use crate::simd::Lanes;
use crate::state::State;
use crate::support::Support;

/// The part of a body that one process begins with: any part, as long as each particle is in one.
pub struct Share {
    /// The processes.
    pub ranks: Arc<dyn Ranks>,
    /// The numbers of this process's particles in the whole body, ascending.
    pub ids: Vec<u64>,
}

/// Which particles a process holds.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement<'a> {
    /// Their numbers in the whole body, ascending.
    pub ids: &'a [u64],
    /// Another number each time that they are others.
    pub version: u64,
}

/// What a process knows of its part.
pub(crate) struct Part {
    pub(crate) ranks: Arc<dyn Ranks>,
    pub(crate) ids: Vec<u64>,
    pub(crate) version: u64,
    /// The first bin of each process, and the number of bins.
    cuts: Vec<usize>,
    /// Whether particles have affine velocities yet.
    pub(crate) is_affine: bool,
}

/// A cut is moved where a process has more particles than this share of the mean.
const UNEVEN: f64 = 1.1;

impl Part {
    pub(crate) fn new(Share { ranks, ids }: Share) -> Self {
        Self { ranks, ids, version: 0, cuts: Vec::new(), is_affine: false }
    }

    pub(crate) fn arrangement(&self) -> Arrangement<'_> {
        Arrangement { ids: &self.ids, version: self.version }
    }

    /// The outcome of all processes; a failed particle has its number in the whole body.
    pub(crate) fn agree(&self, outcome: Outcome) -> Outcome {
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
    pub(crate) fn tell(&self, id: usize, describe: impl FnOnce(usize) -> StepError) -> StepError {
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
fn cuts(particles: &[u64], ranks: usize) -> Vec<usize> {
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
fn unevenness(particles: &[u64], cuts: &[usize]) -> f64 {
    let of = |cut: &[usize]| particles[cut[0]..cut[1]].iter().sum::<u64>();
    let most = cuts.windows(2).map(of).max().unwrap_or(0);
    let total: u64 = particles.iter().sum();
    most as f64 * (cuts.len() - 1) as f64 / total.max(1) as f64
}

/// Which elements go where, and in which order those that come are kept.
struct Move<'a> {
    ranks: &'a dyn Ranks,
    /// The places of the elements that go to each process.
    out: Vec<Vec<u32>>,
    /// How many come from each.
    counts: Vec<usize>,
    /// Among those that come, one after the other, the place of each that is kept.
    order: Vec<u32>,
}

impl Move<'_> {
    fn all<E: Pod>(&self, elements: &[E]) -> Vec<E> {
        let pick = |places: &Vec<u32>| places.iter().map(|&p| elements[p as usize]).collect();
        let out: Vec<Vec<E>> = self.out.iter().map(pick).collect();
        let come = exchange(self.ranks, &out, &self.counts);
        self.order.iter().map(|&place| come[place as usize]).collect()
    }

    fn replace<E: Pod>(&self, elements: &mut Vec<E>) {
        *elements = self.all(elements);
    }
}

impl<T: Lanes, const D: usize> State<T, D> {
    /// Gives every particle to the process of its bin, `bin_of(particle)`.
    pub(crate) fn redistribute(&mut self) {
        let Self { particles, constants, layout, bins, support, part, .. } = self;
        let Some(part) = part else { return };
        let ranks = part.ranks.clone();
        let rows = bins.rows();
        let bin_of: Vec<usize> = {
            let Particles { x, F, .. } = &*particles;
            let first_node = |p| support.first_node(constants, p, &x[p], &F[p]);
            (0..x.len()).map(|p| rows.bin_of(first_node(p) / layout.row())).collect()
        };
        let mut counts = vec![0_u64; rows.count()];
        bin_of.iter().for_each(|&bin| counts[bin] += 1);
        let all = gather(&*ranks, &counts);
        let mut new: Vec<u64> = vec![0; ranks.count() + 1];
        if ranks.rank() == 0 {
            for (bin, count) in counts.iter_mut().enumerate() {
                *count = all.iter().skip(bin).step_by(rows.count()).sum();
            }
            let cuts = match part.cuts.as_slice() {
                [_, ..] if unevenness(&counts, &part.cuts) <= UNEVEN => part.cuts.clone(),
                _ => cuts(&counts, ranks.count()),
            };
            new = cuts.into_iter().map(|cut| cut as u64).collect();
        }
        share(&*ranks, 0, &mut new);
        part.cuts = new.into_iter().map(|cut| cut as usize).collect();
        part.version += 1;

        let mut out = vec![Vec::new(); ranks.count()];
        for (p, &bin) in bin_of.iter().enumerate() {
            out[part.cuts.partition_point(|&cut| cut <= bin) - 1].push(p as u32);
        }
        let lengths: Vec<usize> = out.iter().map(Vec::len).collect();
        let counts = announce(&*ranks, &lengths);
        let order = (0..counts.iter().sum::<usize>() as u32).collect();
        let mut moved = Move { ranks: &*ranks, out, counts, order };
        let ids = moved.all(&part.ids);
        moved.order.sort_unstable_by_key(|&place| ids[place as usize]);
        moved.replace(&mut part.ids);
        let Particles { X, x, v, F, mass, volume, half_size: _ } = particles;
        [X, x, v].into_iter().for_each(|vectors| moved.replace(vectors));
        moved.replace(F);
        [&mut *mass, &mut *volume].into_iter().for_each(|numbers| moved.replace(numbers));
        let count = x.len();
        match support {
            Support::Product(_) | Support::Polygons(_) => {}
            Support::Cpdi { half_edges } => {
                let each: Vec<_> = (0..bin_of.len()).map(|p| *half_edges.of(p)).collect();
                *half_edges = HalfEdges::new(moved.all(&each));
            }
            Support::Cpdi2 { mesh, next } => {
                *mesh = move_corners(mesh, &moved);
                next.clone_from(&mesh.x);
            }
        }
        if part.is_affine {
            moved.replace(&mut self.affine);
        }
        if self.keeps_F_early {
            self.F_early.resize(count, SMatrix::identity());
        }
        let (first_mass, first_volume) = (mass.first().copied(), volume.first().copied());
        self.uniform = first_mass.zip(first_volume).filter(|(m, V)| {
            mass.iter().all(|mass| mass == m) && volume.iter().all(|volume| volume == V)
        });

        let own = part.cuts[ranks.rank()]..part.cuts[ranks.rank() + 1];
        let held = Held { bands: own, all: rows.count() };
        let rows: Range<usize> = rows.rows_of(&held, layout.dims[D - 1]);
        self.bins.hold(held, count);
        if rows != layout.rows() {
            layout.hold(rows);
            constants.nodes_before = (layout.first_row * layout.row()) as f64;
            let resize = |nodes: &mut Vec<Node<T, D>>| {
                if !nodes.is_empty() {
                    *nodes = vec![Node::zero(); layout.nodes];
                }
            };
            [&mut self.nodes, &mut self.reprojected, &mut self.next].into_iter().for_each(resize);
            if !self.filtered.is_empty() {
                self.filtered = vec![SVector::zeros(); layout.nodes];
            }
        }
    }
}

/// The corners of the particles that come; neighbours share them as before.
fn move_corners<T: Lanes, const D: usize>(mesh: &Mesh<T, D>, moved: &Move<'_>) -> Mesh<T, D> {
    let mut new = Mesh::default();
    let count = moved.order.len();
    new.corners = vec![[0; 8]; count];
    // Corners are one where their reference positions are, which all processes have computed alike.
    let mut known: HashMap<Vec<u8>, u32> = HashMap::new();
    for corner in 0..1 << D {
        let of_particle = |positions: &[SVector<T, D>]| -> Vec<SVector<T, D>> {
            mesh.corners.iter().map(|corners| positions[corners[corner] as usize]).collect()
        };
        let (X, x) = (moved.all(&of_particle(&mesh.X)), moved.all(&of_particle(&mesh.x)));
        for (p, (X, x)) in X.into_iter().zip(x).enumerate() {
            let key = cast_slice::<T, u8>(X.as_slice()).to_vec();
            let place = *known.entry(key).or_insert_with(|| {
                new.X.push(X);
                new.x.push(x);
                new.X.len() as u32 - 1
            });
            new.corners[p][corner] = place;
        }
    }
    new
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
