//! Particles to grid: sums of mass, momentum and force at the nodes, followed by the grid update.
//!
//! ```text
//! m_i = sum m_p S_ip;  m_i v_i = sum m_p (v_p + C_p (x_i - x_p)) S_ip;  f_i = -sum V0_p tau_p G_ip + sum m_p b_p S_ip
//! ```
//!
//! The affine velocity `C_p` is that of APIC. The sums of one particle are in [`kernel`](crate::kernel), tiles in [`bins`](crate::grid::bins).

use mmsmith_lanes::simd::Lanes;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::{BodyForce, Particles};
use nalgebra::{SMatrix, SVector};

use crate::domain::corner_exchange::{ChunkSums, Exchange, Loading};
use crate::domain::corners::Corners;
use crate::domain::of_particles::Domain;
use crate::domain::shared_corners::{Chunk, SharedCorners};
use crate::every_scheme::Beyond;
use crate::grid::bins::{Bins, Window};
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{
    Acceleration, GridUpdate, NodeUpdate, NodeVectors, Reprojection, Velocity,
    VelocityAndAcceleration,
};
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::grid::volume_rates::VolumeRates;
use crate::kernel::buffers::{BufferPool, Buffers, GridValues};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::shared::ToCorners;
use crate::step::StepTimes;
use crate::step::forcing::Forcing;
use crate::step::state::{EarlyState, State};
use mmsmith_threads::each;

impl<T: Lanes, const D: usize> State<T, D> {
    /// P2G of mass, momentum and force, and from them velocities and accelerations.
    pub(crate) fn p2g(&mut self, body_force: &dyn BodyForce<T, D>, times: StepTimes<T>) {
        let Self { particles, grid, of_time, corners, .. } = self;
        let GridState { constants, layout, bins, nodes, rates, .. } = grid;
        let (domain, law, transfer) = (&*self.domain, &self.law, self.transfer);
        let (buffers, variables) = (&self.buffers, self.shares.internal);
        let Particles { X, x, v, F, mass, volume, affine, internal, .. } = &*particles;
        let c = *constants;
        let forcing = Forcing::new(body_force, X, times.start, &c, of_time);
        let vectors = NodeVectors::of(transfer);
        let update =
            GridUpdate::new(layout, &c, VelocityAndAcceleration { scale: times.scale, vectors });
        let p2g = P2g::new(&c, (domain, buffers), transfer.is_affine(), (x, F));
        let loading = Some((body_force, forcing.time()));
        let set =
            |Buffers { contributions, .. }: &mut _, copies: &mut Copies<T, D>, ids: &[u32]| {
                forcing.evaluate(ids, &copies.x, &mut contributions.b);
                contributions.take(ids, mass, volume);
                for (k, &p) in ids.iter().enumerate() {
                    contributions.set_value(&c, k, &v[p as usize]);
                }
                contributions.take_affine(ids, mass, affine);
                copies.pick_internal(ids, internal, variables);
                law.stress(&c, &copies.F, &copies.internal, contributions);
            };
        match rates {
            Some(rates) => p2g.with_mean_stress(&update, (bins, rates), nodes, &set),
            None => p2g.to_grid(&update, (bins, two_stages(corners), loading), nodes, &set),
        }
    }

    /// P2G of mass and momentum, and from them the velocities at the start of the step.
    pub(crate) fn p2g_momentum(&mut self) {
        let Self { particles, grid, corners, .. } = self;
        let GridState { constants, layout, bins, nodes, .. } = grid;
        let (domain, transfer) = (&*self.domain, self.transfer);
        let buffers = &self.buffers;
        let Particles { x, v, F, mass, affine, .. } = &*particles;
        let c = *constants;
        let update = GridUpdate::new(layout, &c, Velocity);
        let p2g = P2g::new(&c, (domain, buffers), transfer.is_affine(), (x, F));
        p2g.to_grid(&update, (bins, two_stages(corners), None), nodes, &momenta(mass, v, affine));
    }

    /// P2G of forces, by the stress of the F that has followed the grid with the weights of the one before; from them
    /// accelerations and the velocities at the end of the step.
    pub(crate) fn p2g_force(&mut self, body_force: &dyn BodyForce<T, D>, times: StepTimes<T>) {
        let Self { particles, grid, of_time, corners, .. } = self;
        let GridState { constants, layout, bins, nodes, rates, .. } = grid;
        let (domain, law, transfer) = (&*self.domain, &self.law, self.transfer);
        let buffers = &self.buffers;
        let Particles { X, x, F, mass, volume, internal, .. } = &*particles;
        let (c, EarlyState { F: F_early, internal: internal_early, .. }) =
            (*constants, &self.early);
        let variables = self.shares.internal;
        let forcing = Forcing::new(body_force, X, times.start, &c, of_time);
        let vectors = NodeVectors::of(transfer);
        let update = GridUpdate::new(layout, &c, Acceleration { scale: times.scale, vectors });
        let p2g = P2g::new(&c, (domain, buffers), false, (x, F));
        let loading = Some((body_force, forcing.time()));
        let set =
            |Buffers { contributions, .. }: &mut _, copies: &mut Copies<T, D>, ids: &[u32]| {
                forcing.evaluate(ids, &copies.x, &mut contributions.b);
                contributions.take(ids, mass, volume);
                (0..ids.len()).for_each(|k| contributions.set_force(&c, k));
                if c.planted.is(Fault::StressOfOldStretch) {
                    copies.pick_internal(ids, internal, variables);
                } else {
                    copies.pick_F(ids, F_early);
                    copies.pick_internal(ids, internal_early, variables);
                }
                law.stress(&c, &copies.F, &copies.internal, contributions);
            };
        match rates {
            Some(rates) => {
                // The growth that the early part took.
                nodes.iter_mut().for_each(|node| *node.scalar_mut() = T::zero());
                p2g.with_mean_stress(&update, (bins, rates), nodes, &set);
            }
            None => p2g.to_grid(&update, (bins, two_stages(corners), loading), nodes, &set),
        }
    }

    /// MUSL: P2G of mass and of the updated momenta, and from them the reprojected velocities.
    pub(crate) fn p2g_updated_momentum(&mut self) {
        let Self { particles, grid, corners, .. } = self;
        let GridState { constants, layout, bins, reprojected, .. } = grid;
        let (domain, transfer) = (&*self.domain, self.transfer);
        let buffers = &self.buffers;
        let Particles { x, v, F, mass, affine, .. } = &*particles;
        let c = *constants;
        let update = GridUpdate::new(layout, &c, Reprojection);
        let p2g = P2g::new(&c, (domain, buffers), transfer.is_affine(), (x, F));
        p2g.to_grid(
            &update,
            (bins, two_stages(corners), None),
            reprojected,
            &momenta(mass, v, affine),
        );
    }

    /// XPIC: the grid's velocities go to the particles and back. `next` gets those of `reprojected`, or of `nodes` at first.
    pub(crate) fn p2g_g2p_velocity(&mut self, is_first: bool) {
        let Self { particles, grid, corners, .. } = self;
        let GridState { constants, layout, bins, nodes, reprojected, next, .. } = grid;
        let (domain, buffers) = (&*self.domain, &self.buffers);
        let Particles { x, F, mass, .. } = &*particles;
        let c = *constants;
        let from = if is_first { &nodes[..] } else { &reprojected[..] };
        let (values, stages) = match corners {
            Some(corners) => {
                corners.interpolate(&c, from);
                let Corners { shared, exchange, values, .. } = &mut **corners;
                let at_corners = Some((&*shared, &*values));
                (GridValues { nodes: from, at_corners }, Some((&*shared, exchange)))
            }
            None => (GridValues { nodes: from, at_corners: None }, None),
        };
        let update = GridUpdate::new(layout, &c, Reprojection);
        let p2g = P2g { reads_grid: true, ..P2g::new(&c, (domain, buffers), false, (x, F)) };
        let set = |buffers: &mut Buffers<T, D>, _: &mut Copies<T, D>, ids: &[u32]| {
            values.g2p(&c, buffers, ids);
            let Buffers { contributions, interpolated, .. } = buffers;
            contributions.without_stress();
            for (value, (interpolated, &p)) in
                contributions.value.iter_mut().zip(interpolated.iter().zip(ids))
            {
                let m = mass[p as usize];
                *value = Node::new(&(interpolated.velocity * m), &SVector::zeros(), m);
            }
        };
        p2g.to_grid(&update, (bins, stages, None), next, &set);
    }
}

/// Sets momenta of a block, with the affine part where there is one.
fn momenta<'a, T: Lanes, const D: usize>(
    mass: &'a [T],
    v: &'a [SVector<T, D>],
    affine: &'a [SMatrix<T, D, D>],
) -> impl Fn(&mut Buffers<T, D>, &mut Copies<T, D>, &[u32]) + Sync + 'a {
    move |Buffers { contributions, .. }, _, ids| {
        contributions.take_momenta(ids, mass, v);
        contributions.take_affine(ids, mass, affine);
    }
}

/// Corners that particles share, and their exchange with particles and grid.
pub(crate) type TwoStages<'a, T, const D: usize> =
    (&'a SharedCorners<T, D>, &'a mut Exchange<T, D>);

pub(crate) fn two_stages<T, const D: usize>(
    corners: &mut Option<Beyond<Corners<T, D>>>,
) -> Option<TwoStages<'_, T, D>> {
    let Corners { shared, exchange, .. } = &mut **corners.as_mut()?;
    Some((shared, exchange))
}

/// P2G of all particles.
pub(crate) struct P2g<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) domain: &'a dyn Domain<T, D>,
    pub(crate) buffers: &'a BufferPool<T, D>,
    pub(crate) is_affine: bool,
    /// Whether contributions need the grid's values at the particles.
    pub(crate) reads_grid: bool,
    /// Whether mean stresses go to the scalars of nodes.
    pub(crate) has_mean_stress: bool,
    pub(crate) x: &'a [SVector<T, D>],
    pub(crate) F: &'a [SMatrix<T, D, D>],
}

impl<'a, T: Lanes, const D: usize> P2g<'a, T, D> {
    /// P2G of particles with these positions and deformation gradients, whose contributions do not need the grid's values.
    pub(crate) fn new(
        c: &'a Constants<T, D>,
        (domain, buffers): (&'a dyn Domain<T, D>, &'a BufferPool<T, D>),
        is_affine: bool,
        (x, F): (&'a [SVector<T, D>], &'a [SMatrix<T, D, D>]),
    ) -> Self {
        Self { c, domain, buffers, is_affine, reads_grid: false, has_mean_stress: false, x, F }
    }

    /// P2G of what `set(buffers, copies, ids)` says of each block, and the update of the grid after it: tile by tile, and by
    /// way of corners where particles share them, with the loads on these.
    pub(crate) fn to_grid<S: NodeUpdate<T, D>>(
        &self,
        update: &GridUpdate<'_, T, S, D>,
        (bins, stages, loading): (
            &mut Bins<Node<T, D>, D>,
            Option<TwoStages<'_, T, D>>,
            Loading<'_, T, D>,
        ),
        nodes: &mut [Node<T, D>],
        set: &(impl Fn(&mut Buffers<T, D>, &mut Copies<T, D>, &[u32]) + Sync),
    ) {
        let Some((corners, exchange)) = stages else {
            update.p2g(bins, nodes, &|window, ids| self.tile(window, ids, set));
            return;
        };
        self.to_corners(corners, exchange, set);
        exchange.load(corners, loading);
        exchange.update_grid(update, corners, bins, nodes);
    }

    /// P2G with mean stresses, whose forces the grid computes.
    fn with_mean_stress<S: NodeUpdate<T, D>>(
        self,
        update: &GridUpdate<'_, T, S, D>,
        (bins, rates): (&mut Bins<Node<T, D>, D>, &mut VolumeRates<T, D>),
        nodes: &mut [Node<T, D>],
        set: &(impl Fn(&mut Buffers<T, D>, &mut Copies<T, D>, &[u32]) + Sync),
    ) {
        let own = Self { has_mean_stress: true, ..self };
        rates.p2g(update, bins, nodes, &|window, ids| own.tile(window, ids, set));
    }

    /// Sums what `set` says of each particle at its corners, chunk by chunk.
    fn to_corners(
        &self,
        corners: &SharedCorners<T, D>,
        exchange: &mut Exchange<T, D>,
        set: &(impl Fn(&mut Buffers<T, D>, &mut Copies<T, D>, &[u32]) + Sync),
    ) {
        let &Self { c, domain, buffers: pool, is_affine, x, F, .. } = self;
        let chunks = &corners.chunks;
        let pieces = chunks.iter().zip(exchange.begin(chunks, is_affine)).collect();
        each(pieces, &|(Chunk { particles, .. }, mut of_chunk)| {
            of_chunk.clear();
            let ChunkSums { sums, affine_sums } = of_chunk;
            let mut copies = Copies::new();
            let mut buffers = pool.take(domain, is_affine);
            for first in particles.clone().step_by(BLOCK) {
                let ids = successive(first);
                let ids = &ids[..BLOCK.min(particles.end - first)];
                copies.pick(ids, x, F);
                set(&mut buffers, &mut copies, ids);
                ToCorners {
                    c,
                    corners,
                    at: &corners.mesh.x,
                    shares: corners.measured.from(&corners.mesh, first),
                    particles: (first, ids.len()),
                    contributions: &buffers.contributions,
                    sums,
                    affine_sums,
                }
                .add();
            }
            pool.give_back(buffers);
        });
    }

    /// Adds the particles `ids`, block by block, to the nodes of their tile.
    /// `set(buffers, copies, ids)` sets the contributions of a block.
    fn tile(
        &self,
        window: Window<'_, Node<T, D>, D>,
        ids: &[u32],
        set: &impl Fn(&mut Buffers<T, D>, &mut Copies<T, D>, &[u32]),
    ) {
        let &Self { c, domain, buffers: pool, is_affine, reads_grid, has_mean_stress, x, F } = self;
        let in_window = c.in_window(&window);
        let mut copies = Copies::new();
        let mut buffers = pool.take(domain, is_affine);
        for ids in ids.chunks(BLOCK) {
            copies.pick(ids, x, F);
            if reads_grid {
                // Nodes of a window have other numbers than those of the grid.
                buffers.weights.compute(c, ids, copies.kinematics());
                set(&mut buffers, &mut copies, ids);
            }
            buffers.weights.compute(&in_window, ids, copies.kinematics());
            if c.planted.is(Fault::LastNodeSkipped) {
                buffers.weights.skip_last_node(c, &copies.x);
            }
            if !reads_grid {
                set(&mut buffers, &mut copies, ids);
            }
            let Buffers { weights, contributions, .. } = &mut *buffers;
            weights.p2g(&window.strides, window.nodes, contributions, ids.len());
            if has_mean_stress {
                weights.p2g_scalars(&window.strides, window.nodes, contributions, ids.len());
            }
        }
        pool.give_back(buffers);
    }
}
