//! Grid to particles: velocity, position and deformation gradient follow the grid.
//!
//! ```text
//! v_p by the transfer;   x_p += dt sum S_ip (v_i + dt a_i);   F_p <- (I + dt grad v) F_p
//! ```
//!
//! Steps in a [single pass](crate::step::is_fused) fuse this with the next P2G ([`g2p2g`](crate::step::g2p2g)).

use std::sync::atomic::{AtomicBool, Ordering};

use mmsmith_lanes::simd::Lanes;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::Particles;
use mmsmith_particles::columns::Moving;
use nalgebra::{SMatrix, SVector};

use crate::domain::corner_exchange;
use crate::domain::corners::{Corners, grid_values, reprojected_values};
use crate::domain::of_particles::{Domain, OfBlock};
use crate::domain::shared_corners::SharedCorners;
use crate::every_scheme::EVERY_SCHEME;
use crate::grid::bins::Bins;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::kernel::any::Interpolated;
use crate::kernel::block::{BlockIncrement, BlockLaw};
use crate::kernel::buffers::{BufferPool, Buffers, GridValues};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::projected::VARIABLES;
use crate::kernel::shared::have_volume_next;
use crate::scheme::{Transfer, VelocityUpdate};
use crate::step::health::{Outcome, SharedOutcome};
use crate::step::state::{EarlyState, State, invalidity};
use mmsmith_threads::each;

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
pub(crate) const CHUNK: usize = 1024;

impl<T: Lanes, const D: usize> State<T, D> {
    /// F follows the velocity at the start of the step for a time, before forces are computed; stored beside the old F.
    pub(crate) fn g2p_stretch(&mut self, time: T) -> Outcome {
        let Self { particles, grid, domain, corners, buffers, .. } = self;
        let GridState { constants, nodes, rates, .. } = grid;
        let follows_grid = rates.is_some();
        let Self { early, law, .. } = self;
        let EarlyState { F: F_early, internal: internal_early, .. } = early;
        let c = *constants;
        if let Some(corners) = corners {
            corners.interpolate(&c, nodes);
        }
        let corners = corners.as_deref();
        let values = grid_values(nodes, corners);
        let Particles { x, F, internal, .. } = &*particles;
        let (domain, buffers) = (&**domain, &*buffers);
        let found = SharedOutcome::default();
        let variables = self.shares.internal;
        internal_early.copy_from_slice(internal);
        let mut of_internal = internal_early.chunks_mut((CHUNK * variables).max(1));
        let pieces = F_early.chunks_mut(CHUNK).map(|F| (F, of_internal.next().unwrap_or_default()));
        each(pieces.enumerate().collect(), &|(piece, (F_early, internal))| {
            let mut outcome = Outcome::default();
            let mut grid = FromGrid::new(&c, values, buffers.take(domain, false));
            let (x, F) = (&x[piece * CHUNK..], &F[piece * CHUNK..]);
            let mut of_internal = internal.chunks_mut((BLOCK * variables).max(1));
            let blocks = F_early.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((F_early, x), F)) in blocks.enumerate() {
                let first = piece * CHUNK + index * BLOCK;
                let interpolated = grid.g2p(first, x, F);
                for (k, (((F_early, interpolated), x), F)) in
                    F_early.iter_mut().zip(interpolated).zip(x).zip(F).enumerate()
                {
                    *F_early = c.stretch_for(time, &interpolated.velocity_gradient, F);
                    if let Some(invalid) = invalidity(&c, domain, corners, first + k, x, F_early) {
                        let failure = Some((invalid, first + k));
                        outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                    }
                }
                let internal = of_internal.next().unwrap_or_default();
                if follows_grid {
                    grow(internal, &grid.growth(x.len()));
                } else if !internal.is_empty() {
                    // Positions follow when forces are known; until then particles are as far as their velocity takes them.
                    let moved = x.iter().zip(interpolated).map(|(x, of)| x + of.velocity * time);
                    let ahead: Vec<SVector<T, D>> = match law.follows_position() {
                        true => moved.collect(),
                        false => Vec::new(),
                    };
                    let end = &*F_early;
                    law.evolve(BlockIncrement { time, start: F, end, x: &ahead }, internal);
                }
            }
            buffers.give_back(grid.buffers);
            found.add(outcome);
        });
        found.all()
    }

    /// Velocity by the transfer, position, and F for the rest of the step.
    pub(crate) fn g2p(&mut self, late: T) -> Outcome {
        let Self { particles, grid, domain, corners, transfer, .. } = self;
        let GridState { constants, nodes, bins, rates, .. } = grid;
        let (law, early) = (&*self.law, Early::of(&self.early.F, &self.early.internal));
        let (c, transfer, follows_grid) = (*constants, *transfer, rates.is_some());
        let values = grid_values(nodes, corners.as_deref());
        let pass = G2p { c: &c, bins, domain: &**domain, corners: corners.as_deref() };
        let found = pass.all(particles, (&self.buffers, transfer), |buffers, ids, of_block| {
            let growth = follows_grid.then(|| values.growth(&c, buffers, ids.len()));
            let interpolated = values.g2p(&c, buffers, ids);
            let (early, growth) = (early(ids), growth.as_ref());
            Follow { c: &c, law, late, early, growth }.advance(transfer, interpolated, of_block);
        });
        drop(early);
        self.arrive(found)
    }

    /// MUSL, first G2P: velocity alone.
    pub(crate) fn g2p_velocity(&mut self) {
        let Self { particles, grid, domain, corners, transfer, buffers, .. } = self;
        let GridState { constants, nodes, .. } = grid;
        let (c, domain, transfer) = (*constants, &**domain, *transfer);
        let values = grid_values(nodes, corners.as_deref());
        let buffers = &*buffers;
        each_piece(particles, &|first, piece| {
            let own = buffers.take(domain, transfer.is_affine());
            let mut grid = FromGrid::new(&c, values, own);
            for (start, Moving { x, v, F, affine, .. }) in piece.pieces(BLOCK) {
                take_velocity(&c, transfer, grid.g2p(first + start, x, F), v, affine);
            }
            buffers.give_back(grid.buffers);
        });
    }

    /// MUSL, second G2P: position by the grid velocity, and F, for a time `late`, by the reprojected one.
    pub(crate) fn g2p_reprojected(&mut self, late: T) -> Outcome {
        let Self { particles, grid, domain, corners, .. } = self;
        let GridState { constants, nodes, bins, reprojected, rates, .. } = grid;
        let follows_grid = rates.is_some();
        let (law, early) = (&*self.law, Early::of(&self.early.F, &self.early.internal));
        let c = *constants;
        if let Some(corners) = corners {
            corners.interpolate_reprojected(&c, reprojected);
        }
        let values = grid_values(nodes, corners.as_deref());
        let reprojected = match c.planted.is(Fault::NoReprojection) {
            true => values,
            false => reprojected_values(reprojected, corners.as_deref()),
        };
        let pass = G2p { c: &c, bins, domain: &**domain, corners: corners.as_deref() };
        let found =
            pass.all(particles, (&self.buffers, Transfer::Flip), |buffers, ids, of_block| {
                let interpolated = values.g2p(&c, buffers, ids);
                for (x, interpolated) in of_block.x.iter_mut().zip(&*interpolated) {
                    *x += interpolated.velocity * c.time_step;
                }
                let growth = follows_grid.then(|| reprojected.growth(&c, buffers, ids.len()));
                let interpolated = reprojected.g2p(&c, buffers, ids);
                let (early, growth) = (early(ids), growth.as_ref());
                let follow = Follow { c: &c, law, late, early, growth };
                follow.stretch(interpolated, of_block);
            });
        drop(early);
        self.arrive(found)
    }

    /// After a pass that has moved all particles: the corners that they share arrive at their places too, and are checked.
    fn arrive(&mut self, (found, is_in_doubt): (SharedOutcome, bool)) -> Outcome {
        let Self { particles, grid, corners, .. } = self;
        let GridState { constants, bins, .. } = grid;
        if let Some(corners) = corners {
            let Corners { shared, .. } = &mut **corners;
            shared.commit_positions(false);
            found.add(corner_exchange::check(constants, shared, bins.keys()));
            if is_in_doubt {
                found.add(check_all(particles, (constants, shared)));
            }
        }
        found.all()
    }

    /// APIC: the affine velocities of particles that have none yet are those of their velocities on the grid.
    pub(crate) fn start_affine(&mut self) {
        if !EVERY_SCHEME || !self.transfer.is_affine() {
            return;
        }
        self.p2g_momentum();
        for node in &mut self.grid.nodes {
            node.values.copy_within(..D, Node::<T, D>::SECOND);
        }
        let Self { particles, grid, domain, corners, buffers, .. } = self;
        let GridState { constants, nodes, .. } = grid;
        if let Some(corners) = corners {
            corners.interpolate(constants, nodes);
        }
        let values = grid_values(nodes, corners.as_deref());
        let Particles { x, F, affine, .. } = particles;
        let mut grid = FromGrid::new(constants, values, buffers.take(&**domain, true));
        let blocks = affine.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
        for (index, ((affine, x), F)) in blocks.enumerate() {
            let interpolated = grid.g2p(index * BLOCK, x, F);
            for (affine, interpolated) in affine.iter_mut().zip(interpolated) {
                *affine = interpolated.affine;
            }
        }
    }
}

/// G2P of successive particles, block by block.
pub(crate) struct FromGrid<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    values: GridValues<'a, T, D>,
    copies: Copies<T, D>,
    pub(crate) buffers: Box<Buffers<T, D>>,
}

impl<'a, T: Lanes, const D: usize> FromGrid<'a, T, D> {
    pub(crate) fn new(
        c: &'a Constants<T, D>,
        values: GridValues<'a, T, D>,
        buffers: Box<Buffers<T, D>>,
    ) -> Self {
        Self { c, values, copies: Copies::new(), buffers }
    }

    /// Interpolated values of the particles from the id `first` on, no more than a block.
    pub(crate) fn g2p(
        &mut self,
        first: usize,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
    ) -> &[Interpolated<T, D>] {
        let Self { c, values, copies, buffers } = self;
        let ids = &successive(first)[..x.len()];
        values.compute_weights(c, buffers, ids, copies.of_successive(x, F));
        values.g2p(c, buffers, ids)
    }

    /// The growth at the first particles of the block of the last [`g2p`](Self::g2p).
    fn growth(&mut self, count: usize) -> [T; BLOCK] {
        self.values.growth(self.c, &mut self.buffers, count)
    }
}

/// F and the internal variables of some particles after the early part of a step.
#[derive(Clone, Copy)]
pub(crate) struct Early<'a, T, const D: usize> {
    F: &'a [SMatrix<T, D, D>],
    internal: &'a [T],
}

impl<'a, T, const D: usize> Early<'a, T, D> {
    /// These of successive particles, where steps have an early part.
    fn of(F: &'a [SMatrix<T, D, D>], internal: &'a [T]) -> impl Fn(&[u32]) -> Option<Self> + Sync
    where
        T: Sync,
    {
        let variables = internal.len().checked_div(F.len()).unwrap_or(0);
        move |ids| {
            let first = ids.first().map_or(0, |id| *id as usize);
            let particles = first..first + ids.len();
            let internal = &internal[particles.start * variables..];
            let internal = internal.get(..particles.len() * variables)?;
            Some(Self { F: F.get(particles)?, internal })
        }
    }
}

/// How particles follow the grid in the late part of a step.
pub(crate) struct Follow<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) law: &'a dyn BlockLaw<T, D>,
    /// The time of the late part.
    pub(crate) late: T,
    /// After the early part, where there is one.
    pub(crate) early: Option<Early<'a, T, D>>,
    /// The growth of the change of volume, where that follows the grid.
    pub(crate) growth: Option<&'a [T; BLOCK]>,
}

impl<T: Lanes, const D: usize> Follow<'_, T, D> {
    /// Velocities by the transfer, positions by the grid's velocity, F and the internal variables for the rest of the step.
    pub(crate) fn advance(
        &self,
        transfer: Transfer,
        interpolated: &[Interpolated<T, D>],
        particles: &mut Moving<'_, T, D>,
    ) {
        let Moving { x, v, affine, .. } = particles;
        take_velocity(self.c, transfer, interpolated, v, affine);
        for (x, interpolated) in x.iter_mut().zip(interpolated) {
            *x += interpolated.velocity * self.c.time_step;
        }
        self.stretch(interpolated, particles);
    }

    /// F at the end of the step, and the internal variables.
    fn stretch(&self, interpolated: &[Interpolated<T, D>], particles: &mut Moving<'_, T, D>) {
        let Self { c, law, late, early, growth } = *self;
        let Moving { x, F, internal, .. } = particles;
        if let Some(early) = early {
            F.copy_from_slice(early.F);
            internal.copy_from_slice(early.internal);
        }
        if late > T::zero() {
            let start = match !internal.is_empty() && law.follows_deformation() {
                true => F.to_vec(),
                false => Vec::new(),
            };
            for (F, interpolated) in F.iter_mut().zip(interpolated) {
                *F = c.stretch_for(late, &interpolated.velocity_gradient, F);
            }
            if let Some(growth) = growth {
                grow(internal, growth);
            } else if !internal.is_empty() {
                law.evolve(BlockIncrement { time: late, start: &start, end: F, x }, internal);
            }
        }
    }
}

/// Lets the changes of volume of a block grow; they are the first internal variables.
pub(crate) fn grow<T: Lanes>(internal: &mut [T], growth: &[T; BLOCK]) {
    for (own, growth) in internal.chunks_exact_mut(VARIABLES).zip(growth) {
        own[0] *= T::one() + *growth;
    }
}

/// Velocities, and affine ones, by the transfer.
fn take_velocity<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    transfer: Transfer,
    interpolated: &[Interpolated<T, D>],
    v: &mut [SVector<T, D>],
    affine: &mut [SMatrix<T, D, D>],
) {
    match transfer.velocity_update() {
        VelocityUpdate::Increment => {
            for (v, interpolated) in v.iter_mut().zip(interpolated) {
                *v += interpolated.second * c.time_step;
            }
        }
        VelocityUpdate::Replace | VelocityUpdate::FilteredReplace(_) => {
            for (v, interpolated) in v.iter_mut().zip(interpolated) {
                *v = interpolated.second;
            }
        }
    }
    if !c.planted.is(Fault::AffinePartDropped) {
        for (affine, interpolated) in affine.iter_mut().zip(interpolated) {
            *affine = interpolated.affine;
        }
    }
}

/// Calls `work(first, piece)` for pieces of particles, `first` the id of the first one, on the threads of the pool.
fn each_piece<T: Lanes, const D: usize>(
    particles: &mut Particles<T, D>,
    work: &(dyn Fn(usize, Moving<'_, T, D>) + Sync),
) {
    let (_, moving) = particles.split();
    each(moving.pieces(CHUNK).collect(), &|(first, piece)| work(first, piece));
}

/// A pass of G2P over all particles.
struct G2p<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    bins: &'a Bins<Node<T, D>, D>,
    domain: &'a dyn Domain<T, D>,
    corners: Option<&'a Corners<T, D>>,
}

impl<T: Lanes, const D: usize> G2p<'_, T, D> {
    /// Calls `update(buffers with weights, ids, particles)` for every block of particles, then checks that each particle is valid and
    /// in its tile. Gives the outcome, and whether a particle is in doubt: where particles share corners, these have to be at their new
    /// places before particles are told invalid.
    fn all(
        &self,
        particles: &mut Particles<T, D>,
        (buffers, transfer): (&BufferPool<T, D>, Transfer),
        update: impl Fn(&mut Buffers<T, D>, &[u32], &mut Moving<'_, T, D>) + Sync,
    ) -> (SharedOutcome, bool) {
        let &Self { c, bins, domain, corners } = self;
        let (keys, found) = (bins.keys(), SharedOutcome::default());
        let is_in_doubt = AtomicBool::new(false);
        each_piece(particles, &|of_piece, piece| {
            let mut outcome = Outcome::default();
            let mut copies = Copies::new();
            let mut own = buffers.take(domain, transfer.is_affine());
            for (start, mut of_block) in piece.pieces(BLOCK) {
                let first = of_piece + start;
                let ids = &successive(first)[..of_block.len()];
                if corners.is_none() {
                    copies.copy(of_block.x, of_block.F);
                    if c.planted.is(Fault::WeightsOfNewPosition) {
                        for (x, v) in copies.x.iter_mut().zip(&*of_block.v) {
                            *x += v * c.time_step;
                        }
                    }
                    own.weights.compute(c, ids, copies.kinematics());
                }
                update(&mut own, ids, &mut of_block);
                let Moving { x, F, .. } = of_block;
                match corners {
                    None => outcome = outcome.merge(self.check(&mut copies, ids, keys, x, F)),
                    Some(Corners { shared, .. }) => {
                        // Polygons are measured when all corners are at their new places.
                        let is_valid = shared.mesh.is_of_cells()
                            && shared.are_inside(c, x, F)
                            && have_volume_next(shared, (first, x.len()));
                        if !is_valid {
                            is_in_doubt.store(true, Ordering::Relaxed);
                        }
                    }
                }
            }
            buffers.give_back(own);
            found.add(outcome);
        });
        (found, is_in_doubt.into_inner())
    }

    /// Checks the particles of a block.
    fn check(
        &self,
        copies: &mut Copies<T, D>,
        ids: &[u32],
        keys: &[u32],
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
    ) -> Outcome {
        let &Self { c, domain, .. } = self;
        let mut tiles = [0; BLOCK];
        for (tile, &p) in tiles.iter_mut().zip(ids) {
            *tile = keys[p as usize];
        }
        let kinematics = copies.of_successive(x, F);
        let mut outcome = Outcome::default();
        if domain.are_valid(OfBlock { c, ids, tiles: &tiles, kinematics }) {
            return outcome;
        }
        for (((x, F), tile), &p) in x.iter().zip(F).zip(tiles).zip(ids) {
            outcome = outcome.merge(domain.diagnose(c, p as usize, tile, x, F));
        }
        outcome
    }
}

/// Checks all particles that share corners.
pub(crate) fn check_all<T: Lanes, const D: usize>(
    particles: &mut Particles<T, D>,
    (c, corners): (&Constants<T, D>, &SharedCorners<T, D>),
) -> Outcome {
    let found = SharedOutcome::default();
    each_piece(particles, &|first, Moving { x, F, .. }| {
        let mut outcome = Outcome::default();
        for (k, (x, F)) in x.iter().zip(&*F).enumerate() {
            let invalid = corners.invalidity(c, first + k, x, F);
            let failure = invalid.map(|invalid| (invalid, first + k));
            outcome = outcome.merge(Outcome { failure, resort: false });
        }
        found.add(outcome);
    });
    found.all()
}
