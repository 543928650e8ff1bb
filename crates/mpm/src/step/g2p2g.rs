//! G2P of one step fused with P2G of the next: one pass over the particles a step, for USL and centred differences.
//!
//! Memory traffic of particles limits the speed of a step; separate passes for G2P and P2G would read them twice. The fused
//! pass forms the same sums in the same order. A run can thus continue from its particles and their order: P2G forms the
//! grid again.
//!
//! Source: Wang et al., "A massively parallel and scalable multi-GPU material point method", ACM Trans. Graph. 39 (2020) 30.

use mmsmith_lanes::simd::Lanes;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::BodyForce;
use mmsmith_particles::columns::{
    DisjointMoving, Fixed, Moving, MovingColumns, PartMoving, Shares,
};

use crate::domain::of_particles::{Domain, OfBlock};
use crate::grid::bins::Window;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeVectors, VelocityAndAcceleration};
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::kernel::advance::AdvanceParticles;
use crate::kernel::block::BlockLaw;
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::scheme::{Transfer, VelocityUpdate};
use crate::step::forcing::Forcing;
use crate::step::g2p::grow;
use crate::step::health::{Outcome, SharedOutcome};
use crate::step::state::State;

impl<T: Lanes, const D: usize> State<T, D> {
    /// G2P of this step, then P2G and grid update of the next step, whose grid becomes `nodes`.
    pub(crate) fn g2p2g(&mut self, body_force: &dyn BodyForce<T, D>, t_next: T) -> Outcome {
        let Self { particles, grid, uniform, of_time, .. } = self;
        let GridState { constants: c, layout, bins, nodes, next, rates, .. } = grid;
        let follows_grid = rates.is_some();
        let (transfer, shares) = (self.transfer, self.shares);
        let buffers = &self.buffers;
        let (domain, law) = (&*self.domain, &*self.law);
        let (fixed, moving) = particles.split();
        let forcing = Forcing::new(body_force, fixed.X, t_next, c, of_time);
        let uniform = *uniform;
        let step = G2p2g {
            c,
            domain,
            law,
            transfer,
            nodes,
            fixed,
            uniform,
            forcing,
            buffers,
            shares,
            follows_grid,
        };
        let found = SharedOutcome::default();
        let vectors = NodeVectors::of(transfer);
        let update =
            GridUpdate::new(layout, c, VelocityAndAcceleration { scale: T::one(), vectors });
        let divide = |partition| {
            DisjointMoving::new(partition, moving).expect("each particle is in one tile")
        };
        let add = |window: Window<'_, _, D>, divided: &DisjointMoving<'_, T, D>, part| {
            if let Some(particles) = divided.take(part) {
                found.add(step.advance_tile(window, particles));
            }
        };
        match rates {
            Some(rates) => {
                update.sums().g2p2g(bins, next, divide, &add);
                rates.update(&update, bins, next);
            }
            None => update.g2p2g(bins, next, divide, &add),
        }
        std::mem::swap(nodes, next);
        found.all()
    }
}

/// The inputs common to all tiles.
struct G2p2g<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    domain: &'a dyn Domain<T, D>,
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
    /// Whether the change of volume follows the grid.
    follows_grid: bool,
}

impl<T: Lanes, const D: usize> G2p2g<'_, T, D> {
    /// Advances the particles of a tile, then adds their contributions to its nodes of the next step's grid.
    fn advance_tile(
        &self,
        mut window: Window<'_, Node<T, D>, D>,
        mut particles: PartMoving<'_, T, D>,
    ) -> Outcome {
        let mut outcome = Outcome::default();
        let c = &self.c.in_window(&window);
        let mut buffers = self.buffers.take(self.domain, self.transfer.is_affine());
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
                let found = self.advance_block(&mut buffers, (&mut window, c), ids, block);
                outcome = outcome.merge(found);
                continue;
            }
            if ids.len() < BLOCK {
                // Kernels look at whole blocks: beyond the last particle these are at rest, whatever was copied before.
                copies = None;
            }
            let copies = copies.get_or_insert_with(|| MovingColumns::at_rest(BLOCK, &self.shares));
            particles.gather(place, ids.len(), copies);
            let block = copies.first(BLOCK, &self.shares);
            let found = self.advance_block(&mut buffers, (&mut window, c), ids, block);
            outcome = outcome.merge(found);
            particles.scatter(copies);
        }
        self.buffers.give_back(buffers);
        outcome
    }

    /// As [`advance_tile`](Self::advance_tile) for a block of particles.
    fn advance_block(
        &self,
        Buffers { weights, contributions, interpolated, growth, .. }: &mut Buffers<T, D>,
        (window, in_window): (&mut Window<'_, Node<T, D>, D>, &Constants<T, D>),
        ids: &[u32],
        mut particles: Moving<'_, T, D>,
    ) -> Outcome {
        let Moving { x, v, F, affine, .. } = &mut particles;
        let (x, v, F) = (whole(x), whole(v), whole(F));
        let &Self { c, domain, law, transfer, nodes, ref forcing, .. } = self;
        let is_with_memory = self.shares.internal > 0;
        let mut has_stress = false;
        if c.planted.is(Fault::WeightsOfNewPosition) {
            let ahead = std::array::from_fn(|k| x[k] + v[k] * c.time_step);
            weights.compute(c, ids, Kinematics { x: &ahead, F });
        } else {
            weights.compute(c, ids, Kinematics { x, F });
        }
        forcing.evaluate(ids, x, &mut contributions.b);
        if self.follows_grid && D == 2 {
            weights.g2p_scalars(&c.strides, nodes, &mut growth[..ids.len()]);
        }
        let interpolated = &mut interpolated[..ids.len()];
        let start = is_with_memory.then(|| match law.follows_deformation() {
            true => F.to_vec(),
            false => Vec::new(),
        });
        let advance = AdvanceParticles {
            c,
            time_step: c.time_step,
            per_cell: c.time_step * c.inverse_spacing,
            replaces: transfer.velocity_update() == VelocityUpdate::Replace,
            x,
            v,
            F,
            affine: transfer.is_affine().then(|| whole(affine)),
            contributions,
            growth,
        };
        weights.g2p_and_advance(&c.strides, nodes, interpolated, advance);
        if self.follows_grid {
            grow(particles.internal, growth);
        } else if let Some(start) = start {
            let Moving { x, F, internal, .. } = &mut particles;
            law.evolve_to_stress(c, (&start, whole(F)), whole(x), internal, contributions);
            has_stress = true;
        }
        let Moving { x, F, internal, .. } = particles;
        let (x, F) = (whole(x), whole(F));
        weights.compute(in_window, ids, Kinematics { x, F });
        let (tiles, kinematics) = (&[window.tile; BLOCK], Kinematics { x, F });
        let of_block = OfBlock { c, ids, tiles, kinematics };
        if !domain.are_valid(of_block) {
            let mut outcome = Outcome::default();
            for (k, &p) in ids.iter().enumerate() {
                outcome = outcome.merge(domain.diagnose(c, p as usize, window.tile, &x[k], &F[k]));
            }
            // A particle outside its tile would write to nodes beyond the window.
            if !outcome.is_clean() {
                return outcome;
            }
        }
        if c.planted.is(Fault::LastNodeSkipped) {
            weights.skip_last_node(c, x);
        }
        if !has_stress {
            law.stress(c, F, internal, contributions);
        }
        weights.p2g(&window.strides, window.nodes, contributions, ids.len());
        if self.follows_grid {
            weights.p2g_scalars(&window.strides, window.nodes, contributions, ids.len());
        }
        Outcome::default()
    }
}

/// A column of a whole block.
fn whole<E>(column: &mut [E]) -> &mut [E; BLOCK] {
    column.first_chunk_mut().expect("blocks are whole")
}
