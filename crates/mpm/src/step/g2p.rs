//! Grid to particles: velocity, position and deformation gradient follow the grid.
//!
//! ```text
//! v_p by the transfer;   x_p += dt sum S_ip (v_i + dt a_i);   F_p <- (I + dt grad v) F_p
//! ```
//!
//! Steps in a [single pass](crate::step::is_fused) fuse this with the next P2G ([`g2p2g`](crate::step::g2p2g)).

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use mmsmith_lanes::simd::Lanes;
use mmsmith_laws::fault::Fault;
use nalgebra::{SMatrix, SVector};

use crate::domain::Support;
use crate::domain::corner_exchange::Exchange;
use crate::domain::corner_values::Seen;
use crate::grid::geometry::Constants;
use crate::kernel::any::Interpolated;
use crate::kernel::block::{Block, BlockLaw};
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::shared::have_volume_next;
use crate::parallel::bins::Bins;
use crate::parallel::chunks::each;
use crate::particles::Particles;
use crate::particles::columns::Moving;
use crate::scheme::{Taken, Transfer};
use crate::step::health::{Outcome, SharedOutcome};
use crate::step::state::State;

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 1024;

impl<T: Lanes, const D: usize> State<T, D> {
    /// F follows the velocity at the start of the step for a time, before forces are computed; stored beside the old F.
    pub(crate) fn g2p_stretch(&mut self, time: T) -> Outcome {
        let Self { particles, constants, nodes, support, buffers, exchange, .. } = self;
        let Self { F_early, internal_early, law, .. } = self;
        let c = *constants;
        if let Support::Mesh(corners) = support {
            exchange.interpolate(&c, corners, nodes);
        }
        let nodes = support.seen(nodes, &exchange.values);
        let Particles { x, F, internal, .. } = &*particles;
        let (support, buffers) = (&*support, &*buffers);
        let found = SharedOutcome::default();
        let variables = self.shares.internal;
        internal_early.copy_from_slice(internal);
        let mut of_internal = internal_early.chunks_mut((CHUNK * variables).max(1));
        let pieces = F_early.chunks_mut(CHUNK).map(|F| (F, of_internal.next().unwrap_or_default()));
        each(pieces.enumerate().collect(), &|(piece, (F_early, internal))| {
            let mut outcome = Outcome::default();
            let mut grid = FromGrid::new(&c, support, nodes, buffers.take(support, false));
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
                    if let Some(invalid) = support.invalidity(&c, first + k, x, F_early) {
                        let failure = Some((invalid, first + k));
                        outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                    }
                }
                let internal = of_internal.next().unwrap_or_default();
                if !internal.is_empty() {
                    law.evolve(time, F, F_early, internal);
                }
            }
            buffers.give_back(grid.buffers);
            found.add(outcome);
        });
        found.all()
    }

    /// Velocity by the transfer, position, and F for the rest of the step.
    pub(crate) fn g2p(&mut self, late: T) -> Outcome {
        let Self { particles, constants, nodes, bins, support, transfer, .. } = self;
        let (law, early) = (&*self.law, Early::of(&self.F_early, &self.internal_early));
        let buffers = &self.buffers;
        let (c, transfer) = (*constants, *transfer);
        let nodes = support.seen(nodes, &self.exchange.values);
        g2p(
            particles,
            bins,
            c,
            (support, &self.exchange),
            buffers,
            transfer,
            |(block, support), interpolated, first, of_block| {
                block.g2p((&c, support), nodes, interpolated);
                let early = early(first..first + interpolated.len());
                Follow { c: &c, law, late, early }.advance(transfer, interpolated, of_block);
            },
        )
    }

    /// MUSL, first G2P: velocity alone.
    pub(crate) fn g2p_velocity(&mut self) {
        let Self { particles, constants, nodes, support, transfer, buffers, .. } = self;
        let (c, support, transfer) = (*constants, &*support, *transfer);
        let nodes = support.seen(nodes, &self.exchange.values);
        let buffers = &*buffers;
        each_piece(particles, &|first, piece| {
            let own = buffers.take(support, transfer.is_affine());
            let mut grid = FromGrid::new(&c, support, nodes, own);
            for (start, Moving { x, v, F, affine, .. }) in piece.pieces(BLOCK) {
                take_velocity(&c, transfer, grid.g2p(first + start, x, F), v, affine);
            }
            buffers.give_back(grid.buffers);
        });
    }

    /// MUSL, second G2P: position by the grid velocity, and F, for a time `late`, by the reprojected one.
    pub(crate) fn g2p_reprojected(&mut self, late: T) -> Outcome {
        let Self { particles, constants, nodes, bins, reprojected, support, .. } = self;
        let (law, early) = (&*self.law, Early::of(&self.F_early, &self.internal_early));
        let (buffers, exchange, c) = (&self.buffers, &mut self.exchange, *constants);
        if let Support::Mesh(corners) = support {
            std::mem::swap(&mut exchange.values, &mut exchange.reprojected);
            exchange.interpolate(&c, corners, reprojected);
            std::mem::swap(&mut exchange.values, &mut exchange.reprojected);
        }
        let reprojected = support.seen(reprojected, &exchange.reprojected);
        let nodes = support.seen(nodes, &exchange.values);
        let reprojected = if c.planted.is(Fault::NoReprojection) { nodes } else { reprojected };
        g2p(
            particles,
            bins,
            c,
            (support, &*exchange),
            buffers,
            Transfer::Flip,
            |(block, support), interpolated, first, of_block| {
                block.g2p((&c, support), nodes, interpolated);
                for (x, interpolated) in of_block.x.iter_mut().zip(&*interpolated) {
                    *x += interpolated.velocity * c.time_step;
                }
                block.g2p((&c, support), reprojected, interpolated);
                let early = early(first..first + interpolated.len());
                Follow { c: &c, law, late, early }.stretch(interpolated, of_block);
            },
        )
    }

    /// APIC: the affine velocities of particles that have none yet are those of their velocities on the grid.
    pub(crate) fn start_affine(&mut self) {
        if !self.transfer.is_affine() {
            return;
        }
        self.p2g_momentum();
        for node in &mut self.nodes {
            node.values.copy_within(..D, D);
        }
        let Self { particles, constants, nodes, support, buffers, exchange, .. } = self;
        if let Support::Mesh(corners) = support {
            exchange.interpolate(constants, corners, nodes);
        }
        let nodes = support.seen(nodes, &exchange.values);
        let Particles { x, F, affine, .. } = particles;
        let mut grid = FromGrid::new(constants, support, nodes, buffers.take(support, true));
        let blocks = affine.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
        for (index, ((affine, x), F)) in blocks.enumerate() {
            let interpolated = grid.g2p(index * BLOCK, x, F);
            for (affine, interpolated) in affine.iter_mut().zip(interpolated) {
                *affine = interpolated.affine;
            }
        }
    }

    /// The corners of domains move with the grid; their new positions are stored beside the old.
    pub(crate) fn move_corners(&mut self) {
        let Self { constants, nodes, support, exchange, .. } = self;
        if let Support::Mesh(corners) = support {
            let mut next = std::mem::take(&mut corners.next);
            exchange.interpolate_and_follow(constants, corners, nodes, &mut next);
            corners.next = next;
        }
    }
}

/// G2P of successive particles, block by block.
struct FromGrid<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    support: &'a Support<T, D>,
    nodes: Seen<'a, T, D>,
    copies: Copies<T, D>,
    buffers: Box<Buffers<T, D>>,
}

impl<'a, T: Lanes, const D: usize> FromGrid<'a, T, D> {
    fn new(
        c: &'a Constants<T, D>,
        support: &'a Support<T, D>,
        nodes: Seen<'a, T, D>,
        buffers: Box<Buffers<T, D>>,
    ) -> Self {
        Self { c, support, nodes, copies: Copies::new(), buffers }
    }

    /// Interpolated values of the particles from the id `first` on, no more than a block.
    fn g2p(
        &mut self,
        first: usize,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
    ) -> &[Interpolated<T, D>] {
        let Self { c, support, nodes, copies, buffers } = self;
        let Buffers { block, interpolated, .. } = &mut **buffers;
        let interpolated = &mut interpolated[..x.len()];
        block.compute_weights(
            c,
            support,
            &successive(first)[..x.len()],
            copies.of_successive(x, F),
        );
        block.g2p((c, support), *nodes, interpolated);
        interpolated
    }
}

/// F and the internal variables of some particles after the early part of a step.
#[derive(Clone, Copy)]
pub(crate) struct Early<'a, T, const D: usize> {
    F: &'a [SMatrix<T, D, D>],
    internal: &'a [T],
}

impl<'a, T, const D: usize> Early<'a, T, D> {
    /// These of some of all particles, where steps have an early part.
    fn of(
        F: &'a [SMatrix<T, D, D>],
        internal: &'a [T],
    ) -> impl Fn(Range<usize>) -> Option<Self> + Sync
    where
        T: Sync,
    {
        let variables = internal.len().checked_div(F.len()).unwrap_or(0);
        move |particles| {
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
        let Self { c, law, late, early } = *self;
        let Moving { F, internal, .. } = particles;
        if let Some(early) = early {
            F.copy_from_slice(early.F);
            internal.copy_from_slice(early.internal);
        }
        if late > T::zero() {
            let start = if internal.is_empty() { Vec::new() } else { F.to_vec() };
            for (F, interpolated) in F.iter_mut().zip(interpolated) {
                *F = c.stretch_for(late, &interpolated.velocity_gradient, F);
            }
            if !internal.is_empty() {
                law.evolve(late, &start, F, internal);
            }
        }
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
    match transfer.taken() {
        Taken::Change => {
            for (v, interpolated) in v.iter_mut().zip(interpolated) {
                *v += interpolated.second * c.time_step;
            }
        }
        Taken::Whole | Taken::Filtered(_) => {
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

/// Calls `update(weights, buffer for interpolated values, first id, particles)` for every block of particles, then checks that
/// each particle is valid and in its bin.
fn g2p<T: Lanes, const D: usize>(
    particles: &mut Particles<T, D>,
    bins: &Bins,
    c: Constants<T, D>,
    (support, exchange): (&mut Support<T, D>, &Exchange<T, D>),
    buffers: &BufferPool<T, D>,
    transfer: Transfer,
    update: impl Fn(
        (&mut Block<T, D>, &Support<T, D>),
        &mut [Interpolated<T, D>],
        usize,
        &mut Moving<'_, T, D>,
    ) + Sync,
) -> Outcome {
    let (bin_of, found) = (bins.bin_of(), SharedOutcome::default());
    let at_start = &*support;
    // Where domains share corners, these have to be at their new places before particles are told invalid.
    let is_in_doubt = AtomicBool::new(false);
    each_piece(particles, &|of_piece, piece| {
        let mut outcome = Outcome::default();
        let mut copies = Copies::new();
        let mut own = buffers.take(at_start, transfer.is_affine());
        let Buffers { block, interpolated, .. } = &mut *own;
        for (start, mut of_block) in piece.pieces(BLOCK) {
            let (first, count) = (of_piece + start, of_block.len());
            if !matches!(at_start, Support::Mesh(_)) {
                copies.copy(of_block.x, of_block.F);
            }
            if c.planted.is(Fault::WeightsOfNewPosition) {
                for (x, v) in copies.x.iter_mut().zip(&*of_block.v) {
                    *x += v * c.time_step;
                }
            }
            block.compute_weights(&c, at_start, &successive(first)[..count], copies.kinematics());
            update((block, at_start), &mut interpolated[..count], first, &mut of_block);
            let Moving { x, F, .. } = of_block;
            match at_start {
                Support::Product(_) | Support::Cpdi { .. } => {
                    outcome = outcome.merge(check(&c, at_start, &mut copies, first, bin_of, x, F));
                }
                Support::Mesh(corners) => {
                    // Polygons are measured when all corners are at their new places.
                    let is_valid = corners.mesh.is_of_cells()
                        && corners.are_inside(&c, x, F)
                        && have_volume_next(corners, (first, x.len()));
                    if !is_valid {
                        is_in_doubt.store(true, Ordering::Relaxed);
                    }
                }
            }
        }
        buffers.give_back(own);
        found.add(outcome);
    });
    let Support::Mesh(corners) = support else { return found.all() };
    corners.arrive(false);
    found.add(exchange.check(&c, corners, bin_of));
    if is_in_doubt.into_inner() {
        found.add(check_all(particles, (&c, support), bin_of));
    }
    found.all()
}

/// Checks all particles.
pub(crate) fn check_all<T: Lanes, const D: usize>(
    particles: &mut Particles<T, D>,
    (c, support): (&Constants<T, D>, &Support<T, D>),
    bin_of: &[u32],
) -> Outcome {
    let found = SharedOutcome::default();
    each_piece(particles, &|of_piece, piece| {
        let (mut outcome, mut copies) = (Outcome::default(), Copies::new());
        for (start, Moving { x, F, .. }) in piece.pieces(BLOCK) {
            let found = check(c, support, &mut copies, of_piece + start, bin_of, x, F);
            outcome = outcome.merge(found);
        }
        found.add(outcome);
    });
    found.all()
}

/// Checks the particles of a block, from the id `first` on.
fn check<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    support: &Support<T, D>,
    copies: &mut Copies<T, D>,
    first: usize,
    bin_of: &[u32],
    x: &[SVector<T, D>],
    F: &[SMatrix<T, D, D>],
) -> Outcome {
    let mut bins = [0; BLOCK];
    // Where domains share corners the bins are those of the corners.
    if !matches!(support, Support::Mesh(_)) {
        bins[..x.len()].copy_from_slice(&bin_of[first..first + x.len()]);
    }
    let mut outcome = Outcome::default();
    if support.are_valid(c, &successive(first)[..x.len()], &bins, copies.of_successive(x, F)) {
        return outcome;
    }
    for (k, ((x, F), bin)) in x.iter().zip(F).zip(bins).enumerate() {
        outcome = outcome.merge(support.diagnose(c, first + k, bin, x, F));
    }
    outcome
}
