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
use nalgebra::{SMatrix, SVector};

use crate::domain::Support;
use crate::domain::corner_exchange::Exchange;
use crate::domain::corner_values::Seen;
use crate::grid::geometry::Constants;
use crate::kernel::any::Interpolated;
use crate::kernel::block::Block;
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::shared::have_volume_next;
use crate::parallel::bins::Bins;
use crate::parallel::chunks::{ChunkOfFour, each_chunk, each_chunk_of_four};
use crate::particles::Particles;
use crate::scheme::{Taken, Transfer};
use crate::step::health::{Outcome, SharedOutcome};
use crate::step::state::State;

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 1024;

impl<T: Lanes, const D: usize> State<T, D> {
    /// F follows the velocity at the start of the step for a time, before forces are computed; stored beside the old F.
    pub(crate) fn g2p_stretch(&mut self, time: T) -> Outcome {
        let Self { particles, constants, nodes, F_early, support, buffers, exchange, .. } = self;
        let c = *constants;
        if let Support::Mesh(corners) = support {
            exchange.interpolate(&c, corners, nodes);
        }
        let nodes = support.seen(nodes, &exchange.values);
        let Particles { x, F, .. } = &*particles;
        let (support, buffers) = (&*support, &*buffers);
        let found = SharedOutcome::default();
        each_chunk(F_early, CHUNK, &|chunk, F_early| {
            let mut outcome = Outcome::default();
            let mut grid = FromGrid::new(&c, support, nodes, buffers.take(support, false));
            let (x, F) = (&x[chunk * CHUNK..], &F[chunk * CHUNK..]);
            let blocks = F_early.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((F_early, x), F)) in blocks.enumerate() {
                let first = chunk * CHUNK + index * BLOCK;
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
            }
            buffers.give_back(grid.buffers);
            found.add(outcome);
        });
        found.all()
    }

    /// Velocity by the transfer, position, and F for the rest of the step.
    pub(crate) fn g2p(&mut self, late: T) -> Outcome {
        let Self { particles, constants, nodes, bins, F_early, support, affine, transfer, .. } =
            self;
        let buffers = &self.buffers;
        let (c, transfer) = (*constants, *transfer);
        let nodes = support.seen(nodes, &self.exchange.values);
        let arrays = (particles, affine);
        g2p(
            arrays,
            bins,
            c,
            (support, &self.exchange),
            buffers,
            transfer,
            |(block, support), interpolated, first, of_block| {
                block.g2p((&c, support), nodes, interpolated);
                let F_early = F_early.get(first..first + interpolated.len());
                advance(&c, transfer, (late, F_early), interpolated, of_block);
            },
        )
    }

    /// MUSL, first G2P: velocity alone.
    pub(crate) fn g2p_velocity(&mut self) {
        let Self { particles, constants, nodes, support, affine, transfer, buffers, .. } = self;
        let (c, support, transfer) = (*constants, &*support, *transfer);
        let nodes = support.seen(nodes, &self.exchange.values);
        let buffers = &*buffers;
        let Particles { x, v, F, .. } = particles;
        each_chunk_of_four((x, v, F, affine), CHUNK, &|chunk| {
            let own = buffers.take(support, transfer.is_affine());
            let mut grid = FromGrid::new(&c, support, nodes, own);
            for_blocks(chunk, |first, OfBlock { x, v, F, affine }| {
                take_velocity(&c, transfer, grid.g2p(first, x, F), v, affine);
            });
            buffers.give_back(grid.buffers);
        });
    }

    /// MUSL, second G2P: position by the grid velocity, and F, for a time `late`, by the reprojected one.
    pub(crate) fn g2p_reprojected(&mut self, late: T) -> Outcome {
        let Self { particles, constants, nodes, bins, reprojected, support, F_early, .. } = self;
        let (buffers, exchange, c) = (&self.buffers, &mut self.exchange, *constants);
        if let Support::Mesh(corners) = support {
            std::mem::swap(&mut exchange.values, &mut exchange.reprojected);
            exchange.interpolate(&c, corners, reprojected);
            std::mem::swap(&mut exchange.values, &mut exchange.reprojected);
        }
        let reprojected = support.seen(reprojected, &exchange.reprojected);
        let nodes = support.seen(nodes, &exchange.values);
        let reprojected = if c.planted.is(Fault::NoReprojection) { nodes } else { reprojected };
        let arrays = (particles, &mut Vec::new());
        g2p(
            arrays,
            bins,
            c,
            (support, &*exchange),
            buffers,
            Transfer::Flip,
            |(block, support), interpolated, first, of_block| {
                let OfBlock { x, F, .. } = of_block;
                block.g2p((&c, support), nodes, interpolated);
                for (x, interpolated) in x.iter_mut().zip(&*interpolated) {
                    *x += interpolated.velocity * c.time_step;
                }
                block.g2p((&c, support), reprojected, interpolated);
                stretch(&c, late, F_early.get(first..first + F.len()), interpolated, F);
            },
        )
    }

    /// APIC: the affine velocities of particles that have none yet are those of their velocities on the grid.
    pub(crate) fn start_affine(&mut self) {
        if !self.transfer.is_affine() {
            return;
        }
        self.affine = vec![SMatrix::zeros(); self.particles.x.len()];
        if let Some(part) = &mut self.part {
            part.is_affine = true;
        }
        self.p2g_momentum();
        for node in &mut self.nodes {
            node.values.copy_within(..D, D);
        }
        let Self { particles, constants, nodes, support, affine, buffers, exchange, .. } = self;
        if let Support::Mesh(corners) = support {
            exchange.interpolate(constants, corners, nodes);
        }
        let nodes = support.seen(nodes, &exchange.values);
        let Particles { x, F, .. } = &*particles;
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

    /// Of the particles from the id `first` on, no more than a block.
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

/// Velocities by the transfer, positions by the grid's velocity, and F for the rest of the step, a time `late`, from that after its early
/// part, where it has one.
pub(crate) fn advance<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    transfer: Transfer,
    (late, F_early): (T, Option<&[SMatrix<T, D, D>]>),
    interpolated: &[Interpolated<T, D>],
    OfBlock { x, v, F, affine }: &mut OfBlock<'_, T, D>,
) {
    take_velocity(c, transfer, interpolated, v, affine);
    for (x, interpolated) in x.iter_mut().zip(interpolated) {
        *x += interpolated.velocity * c.time_step;
    }
    stretch(c, late, F_early, interpolated, F);
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

/// F at the end of the step: that after its early part, where it has one, stretched for a time `late`.
fn stretch<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    late: T,
    F_early: Option<&[SMatrix<T, D, D>]>,
    interpolated: &[Interpolated<T, D>],
    F: &mut [SMatrix<T, D, D>],
) {
    if let Some(F_early) = F_early {
        F.copy_from_slice(F_early);
    }
    if late > T::zero() {
        for (F, interpolated) in F.iter_mut().zip(interpolated) {
            *F = c.stretch_for(late, &interpolated.velocity_gradient, F);
        }
    }
}

/// What belongs to the particles of a block.
pub(crate) struct OfBlock<'a, T, const D: usize> {
    pub(crate) x: &'a mut [SVector<T, D>],
    pub(crate) v: &'a mut [SVector<T, D>],
    pub(crate) F: &'a mut [SMatrix<T, D, D>],
    /// Empty without affine velocities.
    pub(crate) affine: &'a mut [SMatrix<T, D, D>],
}

type Chunk<'a, T, const D: usize> =
    ChunkOfFour<'a, SVector<T, D>, SVector<T, D>, SMatrix<T, D, D>, SMatrix<T, D, D>>;

/// Calls `work(first id, arrays)` for every block of a chunk.
fn for_blocks<T, const D: usize>(
    chunk: Chunk<'_, T, D>,
    mut work: impl FnMut(usize, OfBlock<'_, T, D>),
) {
    let ChunkOfFour { number, a, b, c, e } = chunk;
    let mut of_e = e.chunks_mut(BLOCK);
    let blocks = a.chunks_mut(BLOCK).zip(b.chunks_mut(BLOCK)).zip(c.chunks_mut(BLOCK));
    for (index, ((x, v), F)) in blocks.enumerate() {
        let affine = of_e.next().unwrap_or_default();
        work(number * CHUNK + index * BLOCK, OfBlock { x, v, F, affine });
    }
}

/// Calls `update(weights, buffer for interpolated values, first id, arrays)` for every block of particles, then checks that
/// each particle is valid and in its bin.
fn g2p<T: Lanes, const D: usize>(
    (particles, affine): (&mut Particles<T, D>, &mut Vec<SMatrix<T, D, D>>),
    bins: &Bins,
    c: Constants<T, D>,
    (support, exchange): (&mut Support<T, D>, &Exchange<T, D>),
    buffers: &BufferPool<T, D>,
    transfer: Transfer,
    update: impl Fn(
        (&mut Block<T, D>, &Support<T, D>),
        &mut [Interpolated<T, D>],
        usize,
        &mut OfBlock<'_, T, D>,
    ) + Sync,
) -> Outcome {
    let Particles { x, v, F, .. } = particles;
    let (bin_of, found) = (bins.bin_of(), SharedOutcome::default());
    let at_start = &*support;
    // Where domains share corners, these have to be at their new places before particles are told invalid.
    let is_in_doubt = AtomicBool::new(false);
    each_chunk_of_four((x, v, F, affine), CHUNK, &|chunk| {
        let mut outcome = Outcome::default();
        let mut copies = Copies::new();
        let mut own = buffers.take(at_start, transfer.is_affine());
        let Buffers { block, interpolated, .. } = &mut *own;
        for_blocks(chunk, |first, mut of_block| {
            let count = of_block.x.len();
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
            let OfBlock { x, F, .. } = of_block;
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
        });
        buffers.give_back(own);
        found.add(outcome);
    });
    let Support::Mesh(corners) = support else { return found.all() };
    corners.arrive(false);
    found.add(exchange.check(&c, corners, bin_of));
    if is_in_doubt.into_inner() {
        found.add(check_all((particles, affine), (&c, support), bin_of));
    }
    found.all()
}

/// Checks all particles.
pub(crate) fn check_all<T: Lanes, const D: usize>(
    (Particles { x, v, F, .. }, affine): (&mut Particles<T, D>, &mut [SMatrix<T, D, D>]),
    (c, support): (&Constants<T, D>, &Support<T, D>),
    bin_of: &[u32],
) -> Outcome {
    let found = SharedOutcome::default();
    each_chunk_of_four((x, v, F, affine), CHUNK, &|chunk| {
        let (mut outcome, mut copies) = (Outcome::default(), Copies::new());
        for_blocks(chunk, |first, OfBlock { x, F, .. }| {
            outcome = outcome.merge(check(c, support, &mut copies, first, bin_of, x, F));
        });
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
