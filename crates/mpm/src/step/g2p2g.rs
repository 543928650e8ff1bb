//! G2P of one step fused with P2G of the next: one pass over the particles a step, for USL and centred differences.
//!
//! Memory traffic of particles limits the speed of a step; separate passes for G2P and P2G would read them twice. The fused
//! pass forms the same sums in the same order. A run can thus continue from its particles and their order: P2G forms the
//! grid again.
//!
//! Source: Wang et al., "A massively parallel and scalable multi-GPU material point method", ACM Trans. Graph. 39 (2020) 30.

use mmsmith_lanes::simd::{Lane4, Lanes, Vectors};
use mmsmith_laws::fault::Fault;
use nalgebra::{SMatrix, SVector};

use crate::domain::Support;
use crate::domain::corner_values::Seen;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeVectors, VelocityAndAcceleration};
use crate::grid::node::Node;
use crate::kernel::any::{Contributions, Interpolated, Receive};
use crate::kernel::block::{Block, BlockLaw};
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::prefetch::prefetch;
use crate::particles::columns::{DisjointMoving, Fixed, Moving, MovingColumns, PartMoving, Shares};
use crate::scheme::Transfer;
use crate::shape::weights::Weights;
use crate::step::body_force::BodyForce;
use crate::step::forcing::Forcing;
use crate::step::g2p::Follow;
use crate::step::health::{Outcome, SharedOutcome};
use crate::step::state::State;

impl<T: Lanes, const D: usize> State<T, D> {
    /// G2P of this step, then P2G and grid update of the next step, whose grid becomes `nodes`.
    pub(crate) fn g2p2g(&mut self, body_force: &dyn BodyForce<T, D>, t_next: T) -> Outcome {
        let Self { particles, constants: c, layout, bins, nodes, next, uniform, of_time, .. } =
            self;
        let (transfer, shares) = (self.transfer, self.shares);
        let buffers = &self.buffers;
        let (support, law) = (&self.support, &*self.law);
        let (fixed, moving) = particles.split();
        let forcing = Forcing::new(body_force, fixed.X, t_next, c, of_time);
        let uniform = *uniform;
        let step =
            G2p2g { c, support, law, transfer, nodes, fixed, uniform, forcing, buffers, shares };
        let found = SharedOutcome::default();
        let vectors = NodeVectors::of(transfer);
        let update =
            GridUpdate::new(layout, c, VelocityAndAcceleration { scale: T::one(), vectors });
        let divide = |partition| {
            DisjointMoving::new(partition, moving).expect("each particle is in one bin")
        };
        update.g2p2g(bins, next, divide, &|band, first, bin, divided, part| {
            if let Some(particles) = divided.take(part) {
                found.add(step.advance_bin(band, first, bin, particles));
            }
        });
        std::mem::swap(nodes, next);
        found.all()
    }
}

/// The inputs common to all bins.
struct G2p2g<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    support: &'a Support<T, D>,
    law: &'a dyn BlockLaw<T, D>,
    transfer: Transfer,
    /// The grid of this step, updated.
    nodes: &'a [Node<T, D>],
    fixed: Fixed<'a, T, D>,
    uniform: Option<(T, T)>,
    /// The body force at the start of the next step.
    forcing: Forcing<'a, T, D>,
    buffers: &'a BufferPool<T, D>,
    shares: Shares,
}

impl<T: Lanes, const D: usize> G2p2g<'_, T, D> {
    /// Advances the particles of a bin, then adds their contributions to its band of the next step's grid, which starts at
    /// node `first`.
    fn advance_bin(
        &self,
        band: &mut [Node<T, D>],
        first: usize,
        bin: u32,
        mut particles: PartMoving<'_, T, D>,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        let mut buffers = self.buffers.take(self.support, self.transfer.is_affine());
        if let Some((mass, volume)) = self.uniform {
            buffers.contributions.set_uniform(mass, volume);
        }
        let mut copies = None;
        for (index, ids) in particles.indices().chunks(BLOCK).enumerate() {
            let place = index * BLOCK;
            if self.uniform.is_none() {
                buffers.contributions.take(ids, self.fixed.mass, self.fixed.volume);
            }
            if let Some(block) = particles.contiguous(place, BLOCK) {
                let found = self.advance_block(&mut buffers, band, (first, bin), ids, block);
                outcome = outcome.merge(found);
                continue;
            }
            let copies = copies.get_or_insert_with(|| MovingColumns::at_rest(BLOCK, &self.shares));
            particles.gather(place, ids.len(), copies);
            let block = copies.first(BLOCK, &self.shares);
            let found = self.advance_block(&mut buffers, band, (first, bin), ids, block);
            outcome = outcome.merge(found);
            particles.scatter(place, ids.len(), copies);
        }
        self.buffers.give_back(buffers);
        outcome
    }

    /// As [`advance_bin`](Self::advance_bin) for a block of particles.
    fn advance_block(
        &self,
        Buffers { block, contributions, interpolated, .. }: &mut Buffers<T, D>,
        band: &mut [Node<T, D>],
        (first, bin): (usize, u32),
        ids: &[u32],
        mut particles: Moving<'_, T, D>,
    ) -> Outcome {
        let Moving { x, v, F, .. } = &mut particles;
        let (x, v, F) = (whole(x), whole(v), whole(F));
        let &Self { c, support, law, transfer, nodes, ref forcing, .. } = self;
        let is_with_memory = self.shares.internal > 0;
        if c.planted.is(Fault::WeightsOfNewPosition) {
            let ahead = std::array::from_fn(|k| x[k] + v[k] * c.time_step);
            block.compute_weights(c, support, ids, Kinematics { x: &ahead, F });
        } else {
            block.compute_weights(c, support, ids, Kinematics { x, F });
        }
        forcing.evaluate(ids, x, &mut contributions.b);
        let interpolated = &mut interpolated[..ids.len()];
        if transfer != Transfer::Flip {
            block.g2p((c, support), Seen::Nodes(nodes), interpolated);
            let mut own = particles.first(ids.len());
            let follow = Follow { c, law, late: c.time_step, early: None };
            follow.advance(transfer, interpolated, &mut own);
            contributions.set_values(c, own.v, own.affine);
        } else {
            let start = is_with_memory.then(|| F.to_vec());
            let mut receiver = AdvanceParticles {
                c,
                time_step: c.time_step,
                per_cell: c.time_step * c.inverse_spacing,
                x,
                v,
                F,
                contributions,
            };
            if let Block::Product(weights) = block {
                weights.g2p_with(&c.strides, nodes, ids.len(), receiver);
            } else {
                block.g2p((c, support), Seen::Nodes(nodes), interpolated);
                for (k, interpolated) in interpolated.iter().enumerate() {
                    receiver.receive(k, interpolated);
                }
            }
            if let Some(start) = start {
                law.evolve(c.time_step, &start, &particles.F[..BLOCK], particles.internal);
            }
        }
        let Moving { x, F, internal, .. } = particles;
        let (x, F) = (whole(x), whole(F));
        block.compute_weights(c, support, ids, Kinematics { x, F });
        if !support.are_valid(c, ids, &[bin; BLOCK], Kinematics { x, F }) {
            let mut outcome = Outcome::default();
            for (k, &p) in ids.iter().enumerate() {
                outcome = outcome.merge(support.diagnose(c, p as usize, bin, &x[k], &F[k]));
            }
            // A particle outside its bin would write to nodes beyond the band.
            if !outcome.is_clean() {
                return outcome;
            }
        }
        if c.planted.is(Fault::LastNodeSkipped) {
            block.skip_last_node(c, x);
        }
        law.stress(c, F, internal, contributions);
        block.p2g(&c.strides, band, first, contributions, ids.len());
        Outcome::default()
    }
}

/// A column of a whole block.
fn whole<E>(column: &mut [E]) -> &mut [E; BLOCK] {
    column.first_chunk_mut().expect("blocks are whole")
}

/// Receiver of G2P by FLIP: advances velocity, position and F, and sets mass, momentum and body force of the next P2G.
struct AdvanceParticles<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    time_step: T,
    /// Time step over the edge of a cell.
    per_cell: T,
    x: &'a mut [SVector<T, D>; BLOCK],
    v: &'a mut [SVector<T, D>; BLOCK],
    F: &'a mut [SMatrix<T, D, D>; BLOCK],
    /// `b` holds the body forces per mass on entry.
    contributions: &'a mut Contributions<T, D, BLOCK>,
}

impl<T: Lanes, const D: usize> Receive<T, D> for AdvanceParticles<'_, T, D> {
    #[inline(always)]
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>) {
        let Self { c, contributions, .. } = self;
        let (x, v, F) = (&mut self.x[k], &mut self.v[k], &mut self.F[k]);
        *v += interpolated.second * c.time_step;
        let mut velocity = interpolated.velocity;
        if c.planted.is(Fault::PicForFlip) {
            *v = velocity;
        }
        if c.planted.is(Fault::OwnVelocity) {
            velocity = *v;
        }
        *x += c.planted.change(velocity * c.time_step);
        *F = c.stretch(&interpolated.velocity_gradient, F);
        contributions.set_value(c, k, v);
    }

    #[inline(always)]
    fn receive_lanes<const W: usize>(
        &mut self,
        vectors: impl Vectors,
        k: usize,
        weights: &impl Weights<T, D, W>,
        value: Lane4<T>,
        gradient: [Lane4<T>; D],
    ) {
        // Faults are planted in the form for all dimensions.
        if D != 2 || self.c.planted.is_any() {
            self.receive(
                k,
                &Interpolated::new(weights, &value.0, &gradient.map(|gradient| gradient.0)),
            );
            return;
        }
        prefetch(&self.x[k], BLOCK);
        prefetch(&self.v[k], BLOCK);
        prefetch(&self.F[k], BLOCK);
        let Self { time_step, per_cell, contributions, .. } = self;
        let (Some(x), Some(v), Some(F)) = (
            self.x[k].as_mut_slice().first_chunk_mut::<2>(),
            self.v[k].as_mut_slice().first_chunk_mut::<2>(),
            self.F[k].as_mut_slice().first_chunk_mut::<4>(),
        ) else {
            return;
        };
        let xv = vectors
            .add(Lane4([x[0], x[1], v[0], v[1]]), vectors.mul(value, vectors.splat(*time_step)));
        *x = [xv.0[0], xv.0[1]];
        *v = [xv.0[2], xv.0[3]];
        let factor = vectors.splat(*per_cell);
        let old = vectors.load(F);
        let along = vectors.mul(vectors.low_twice(gradient[0]), factor);
        let across = vectors.mul(vectors.low_twice(gradient[D - 1]), factor);
        let stretch = vectors
            .add(vectors.mul(along, vectors.even(old)), vectors.mul(across, vectors.odd(old)));
        *F = vectors.add(old, stretch).0;
        contributions.set_value_in_plane(vectors, k, xv);
    }
}
