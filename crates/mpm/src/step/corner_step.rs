//! Steps of particles on shared corners in one pass over them: G2P of a step, then P2G of the next one to the corners.
//!
//! As in [`g2p2g`](crate::step::g2p2g) particles are read once a step. Corners move before particles, so that both ends of the pass know where
//! they are: G2P where they were, P2G where they go.

use std::sync::atomic::{AtomicBool, Ordering};

use mmsmith_lanes::simd::Lanes;

use crate::domain::corner_exchange::{self, ChunkSums};
use crate::domain::corner_values::CornerValues;
use crate::domain::corners::Corners;
use crate::domain::of_particles::Domain;
use crate::domain::shared_corners::{Measured, MeasuredPart, SharedCorners};
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeVectors, VelocityAndAcceleration};
use crate::grid::state::GridState;
use crate::kernel::block::BlockLaw;
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::shared::{FromCorners, ToCorners};
use crate::scheme::Transfer;
use crate::step::StepTimes;
use crate::step::forcing::Forcing;
use crate::step::g2p::{Follow, check_all};
use crate::step::health::Outcome;
use crate::step::state::State;
use mmsmith_particles::BodyForce;
use mmsmith_particles::columns::{Fixed, Moving};
use mmsmith_threads::each;

impl<T: Lanes, const D: usize> State<T, D> {
    /// Advances by a step.
    pub(crate) fn step_at_corners(
        &mut self,
        body_force: &dyn BodyForce<T, D>,
        times: StepTimes<T>,
    ) -> Outcome {
        if self.grid.is_ahead {
            self.update_from_corners(body_force, times);
        } else {
            self.p2g(body_force, times);
        }
        self.move_corners();
        let outcome = self.g2p_and_to_corners(body_force, times.end);
        let outcome = self.reduce_outcome(outcome);
        // A sort may bring other particles here, and after a failure the sums are of no use.
        self.grid.is_ahead = outcome.is_clean();
        self.resort_if(outcome)
    }

    /// The grid update from the sums that corners have already.
    fn update_from_corners(&mut self, body_force: &dyn BodyForce<T, D>, times: StepTimes<T>) {
        let Self { particles, grid, of_time, corners, .. } = self;
        let GridState { constants, layout, bins, nodes, .. } = grid;
        let Some(corners) = corners else { return };
        let Corners { shared: corners, exchange, .. } = &mut **corners;
        let c = *constants;
        let time = Forcing::new(body_force, &particles.X, times.start, &c, of_time).time();
        let vectors = NodeVectors::of(self.transfer);
        let update =
            GridUpdate::new(layout, &c, VelocityAndAcceleration { scale: times.scale, vectors });
        exchange.load(corners, Some((body_force, time)));
        exchange.update_grid(&update, corners, bins, nodes);
    }

    /// G2P of this step, and P2G of the next one, which starts at `t_next`, to the corners.
    fn g2p_and_to_corners(&mut self, body_force: &dyn BodyForce<T, D>, t_next: T) -> Outcome {
        let Self { particles, grid, of_time, domain, corners, .. } = self;
        let GridState { constants, bins, .. } = grid;
        let (law, transfer, buffers, c) = (&*self.law, self.transfer, &self.buffers, *constants);
        let uniform = self.uniform;
        let Some(corners) = corners else { return Outcome::default() };
        let Corners { shared, exchange, values, .. } = &mut **corners;
        let mut measured = std::mem::replace(&mut shared.measured, Measured::none());
        let (fixed, mut moving) = particles.split();
        let is_in_doubt = AtomicBool::new(false);
        let pass = Pass {
            c: &c,
            domain: &**domain,
            corners: shared,
            values,
            law,
            transfer,
            forcing: Forcing::new(body_force, fixed.X, t_next, &c, of_time),
            fixed,
            uniform,
            buffers,
            is_in_doubt: &is_in_doubt,
        };
        let chunks = &shared.chunks;
        let of_chunks = chunks.iter().map(|chunk| chunk.particles.clone());
        let parts = measured.split(&shared.mesh, of_chunks.clone());
        let sums = exchange.begin(chunks, transfer.is_affine());
        let pieces = of_chunks.zip(parts).zip(sums).map(|((particles, measured), sums)| Piece {
            first: particles.start,
            moving: moving.split_off(particles.len()),
            measured,
            sums,
        });
        each(pieces.collect(), &|piece| pass.advance(piece));
        shared.measured = measured;
        shared.commit_positions(true);
        let outcome = corner_exchange::check(&c, shared, bins.keys());
        if !is_in_doubt.into_inner() {
            return outcome;
        }
        outcome.merge(check_all(particles, (&c, shared)))
    }
}

/// The particles of a chunk, and what belongs to them.
struct Piece<'a, T, const D: usize> {
    first: usize,
    moving: Moving<'a, T, D>,
    measured: MeasuredPart<'a, T, D>,
    sums: ChunkSums<'a, T, D>,
}

/// The inputs common to all chunks.
struct Pass<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    domain: &'a dyn Domain<T, D>,
    corners: &'a SharedCorners<T, D>,
    /// The values of the grid at corners.
    values: &'a CornerValues<T, D>,
    law: &'a dyn BlockLaw<T, D>,
    transfer: Transfer,
    /// The body force at the start of the next step.
    forcing: Forcing<'a, T, D>,
    fixed: Fixed<'a, T, D>,
    uniform: Option<(T, T)>,
    buffers: &'a BufferPool<T, D>,
    /// Whether a particle may be invalid.
    is_in_doubt: &'a AtomicBool,
}

impl<T: Lanes, const D: usize> Pass<'_, T, D> {
    /// Advances the particles of a chunk, then sums their contributions to the next step at corners.
    fn advance(&self, piece: Piece<'_, T, D>) {
        let &Self { c, domain, corners, values, law, transfer, ref forcing, .. } = self;
        let &Self { fixed, uniform, buffers: pool, is_in_doubt, .. } = self;
        let Piece { first: of_chunk, moving, mut measured, mut sums } = piece;
        let SharedCorners { mesh, next, .. } = corners;
        let (is_affine, of_cells) = (transfer.is_affine(), mesh.is_of_cells());
        sums.clear();
        let mut copies = Copies::new();
        let mut buffers = pool.take(domain, is_affine);
        let Buffers { contributions, interpolated, .. } = &mut *buffers;
        if let Some((mass, volume)) = uniform {
            contributions.set_uniform(mass, volume);
        }
        for (start, mut block) in moving.pieces(BLOCK) {
            let (first, count) = (of_chunk + start, block.len());
            let interpolated = &mut interpolated[..count];
            let shares = measured.from(mesh, (of_chunk, first));
            FromCorners { c, corners, shares, values, first, receiver: interpolated }
                .interpolate(is_affine);
            let follow = Follow { c, law, late: c.time_step, early: None, growth: None };
            follow.advance(transfer, interpolated, &mut block);
            let Moving { x, v, F, affine, internal, .. } = block;

            let mut is_valid =
                of_cells || measured.at(mesh, next, (of_chunk, first..first + count));
            is_valid &= corners.are_inside(c, x, F);
            let ids = successive(first);
            let ids = &ids[..count];
            let kinematics = copies.of_successive(x, F);
            forcing.evaluate(ids, kinematics.x, &mut contributions.b);
            if uniform.is_none() {
                contributions.take(ids, fixed.mass, fixed.volume);
            }
            contributions.set_values(c, v, affine);
            law.stress(c, kinematics.F, internal, contributions);
            is_valid &= ToCorners {
                c,
                corners,
                at: next,
                shares: measured.from(mesh, (of_chunk, first)),
                particles: (first, count),
                contributions,
                sums: sums.sums,
                affine_sums: sums.affine_sums,
            }
            .add();
            if !is_valid {
                is_in_doubt.store(true, Ordering::Relaxed);
            }
        }
        pool.give_back(buffers);
    }
}
