//! The state of a running simulation: particles, grid, and buffers of passes.

use mmsmith_lanes::simd::Lanes;
use mmsmith_particles::columns::Shares;
use mmsmith_particles::{Particles, Pass};
use nalgebra::{SMatrix, SVector};

use crate::domain::corners::Corners;
use crate::domain::of_particles::Domain;
use crate::every_scheme::Beyond;
use crate::grid::geometry::Constants;
use crate::grid::state::GridState;
use crate::kernel::block::BlockLaw;
use crate::kernel::buffers::BufferPool;
use crate::processes::decomposition::LocalBody;
use crate::scheme::Transfer;
use crate::step::health::{Invalid, Outcome};
use crate::step::passes::Passes;

/// Everything that a step reads and changes.
pub(crate) struct State<T, const D: usize> {
    pub(crate) particles: Particles<T, D>,
    /// The domains by which particles reach nodes, or else the corners that they share.
    pub(crate) domain: Box<dyn Domain<T, D>>,
    /// The corners that particles share, where they do.
    pub(crate) corners: Option<Beyond<Corners<T, D>>>,
    pub(crate) law: Box<dyn BlockLaw<T, D>>,
    pub(crate) transfer: Transfer,
    /// How many elements a particle has in the columns that steps change.
    pub(crate) shares: Shares,
    /// Mass and volume of every particle, where they are uniform.
    pub(crate) uniform: Option<(T, T)>,
    /// The grid, with the particles sorted by tile.
    pub(crate) grid: GridState<T, D>,
    /// Where other processes hold the rest of the body: this one's part.
    pub(crate) part: Option<Beyond<LocalBody<D>>>,
    /// Particles after the early part of a step.
    pub(crate) early: EarlyState<T, D>,
    /// Buffers for blocks of particles.
    pub(crate) buffers: BufferPool<T, D>,
    /// Buffer for the part of the body force that depends on time alone.
    pub(crate) of_time: Vec<T>,
    /// Times of passes, where they are wanted.
    pub(crate) passes: Passes,
}

/// F and internal variables after the early part of a step, while the weights still need F at its start.
pub(crate) struct EarlyState<T, const D: usize> {
    /// Deformation gradients; empty where steps have no early part.
    pub(crate) F: Vec<SMatrix<T, D, D>>,
    /// The internal variables that belong to them.
    pub(crate) internal: Vec<T>,
    /// Whether steps have an early part.
    pub(crate) is_kept: bool,
}

impl<T: Lanes, const D: usize> State<T, D> {
    /// Sorts the particles by tile, if one of them left its tile in the last pass.
    pub(crate) fn resort_if(&mut self, outcome: Outcome) -> Outcome {
        if outcome.resort && outcome.failure.is_none() {
            self.timed(Pass::Sort, Self::sort);
        }
        outcome
    }

    /// Does a pass, and takes its time where that is wanted.
    pub(crate) fn timed<R>(&mut self, pass: Pass, work: impl FnOnce(&mut Self) -> R) -> R {
        let begun = self.passes.before();
        let result = work(self);
        self.passes.after(pass, begun);
        result
    }

    /// The outcome of all processes.
    pub(crate) fn reduce_outcome(&self, outcome: Outcome) -> Outcome {
        self.part.as_ref().map_or(outcome, |part| part.reduce_outcome(outcome))
    }

    /// Sorts the particles by tile, those of other processes too.
    pub(crate) fn sort(&mut self) {
        let Self { grid, particles, domain, corners, .. } = self;
        let GridState { constants: c, bins, .. } = grid;
        let Particles { x, F, .. } = &*particles;
        let keys = match corners {
            Some(corners) => {
                let Corners { shared, .. } = &**corners;
                bins.keys_of(shared.count(), &|corner| shared.edges(c, corner))
            }
            None => bins.keys_of(x.len(), &|p| domain.edges(c, p, &x[p], &F[p])),
        };
        self.sort_as(keys);
    }

    /// The reason why a particle is invalid, if it is.
    pub(crate) fn invalidity(&self, p: usize) -> Option<Invalid> {
        let Self { grid, particles: Particles { x, F, .. }, domain, corners, .. } = self;
        let GridState { constants: c, .. } = grid;
        invalidity(c, &**domain, corners.as_deref(), p, &x[p], &F[p])
    }
}

/// The reason why a particle with this position and deformation gradient is invalid, if it is.
pub(crate) fn invalidity<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    domain: &dyn Domain<T, D>,
    corners: Option<&Corners<T, D>>,
    p: usize,
    x: &SVector<T, D>,
    F: &SMatrix<T, D, D>,
) -> Option<Invalid> {
    match corners {
        Some(Corners { shared, .. }) => shared.invalidity(c, p, x, F),
        None => domain.invalidity(c, p, x, F),
    }
}
