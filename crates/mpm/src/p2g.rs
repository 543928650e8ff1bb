//! Particles to grid: sums of mass, momentum and force at the nodes, followed by the grid update.
//!
//! ```text
//! m_i = sum m_p S_ip;  m_i v_i = sum m_p v_p S_ip;  f_i = -sum V0_p tau_p G_ip + sum m_p b_p S_ip
//! ```
//!
//! The sums of one particle are in [`kernel`](crate::kernel), bins and threads in [`parallel`](crate::parallel).

use nalgebra::{RealField, SMatrix, SVector};

use crate::body_force::BodyForce;
use crate::fault::Fault;
use crate::forcing::Forcing;
use crate::geometry::Constants;
use crate::grid_update::{
    Acceleration, GridUpdate, Reprojection, Velocity, VelocityAndAcceleration,
};
use crate::kernel::any::Contributions;
use crate::kernel::block::{BLOCK, Block, Copies};
use crate::material::Law;
use crate::node::Node;
use crate::particles::Particles;
use crate::shape_function::ShapeChoice;
use crate::state::State;

impl<T: RealField + Copy, const D: usize> State<T, D> {
    /// P2G of mass, momentum and force at time `t`, and from them velocities and accelerations; `scale` multiplies the latter.
    #[inline(never)]
    pub(crate) fn p2g<R, L, const W: usize>(
        &mut self,
        shape: R,
        law: L,
        body_force: &dyn BodyForce<T, D>,
        (t, scale): (T, T),
    ) where
        R: ShapeChoice<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bins, nodes, of_time, .. } = self;
        let Particles { X, x, v, F, mass, volume, .. } = &*particles;
        let c = *constants;
        let forcing = Forcing::new(body_force, X, t, &c, of_time);
        let update = GridUpdate::new(layout, &c, VelocityAndAcceleration { scale });
        update.p2g(bins, nodes, &|band, first, ids| {
            c.p2g(shape, x, F, band, first, ids, |copies, ids, contributions| {
                forcing.evaluate(ids, &copies.x, &mut contributions.b);
                contributions.take(ids, mass, volume);
                for (k, &p) in ids.iter().enumerate() {
                    contributions.set_value(&c, k, &v[p as usize]);
                }
                copies.kinematics().stress(&c, law, contributions);
            });
        });
    }

    /// USF: P2G of mass and momentum, and from them the velocities at the start of the step.
    #[inline(never)]
    pub(crate) fn p2g_momentum<R, const W: usize>(&mut self, shape: R)
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, layout, bins, nodes, .. } = self;
        let Particles { x, v, F, mass, .. } = &*particles;
        let c = *constants;
        let update = GridUpdate::new(layout, &c, Velocity);
        update.p2g(bins, nodes, &|band, first, ids| {
            c.p2g(shape, x, F, band, first, ids, |_, ids, contributions| {
                contributions.take_momenta(ids, mass, v);
            });
        });
    }

    /// USF: P2G of forces, by the stress of the updated F with the weights of the old one; from them accelerations and the
    /// velocities at the end of the step.
    #[inline(never)]
    pub(crate) fn p2g_force<R, L, const W: usize>(
        &mut self,
        shape: R,
        law: L,
        body_force: &dyn BodyForce<T, D>,
        (t, scale): (T, T),
    ) where
        R: ShapeChoice<T, D, W>,
        L: Law<T>,
    {
        let Self { particles, constants, layout, bins, nodes, F_next, of_time, .. } = self;
        let Particles { X, x, F, mass, volume, .. } = &*particles;
        let (c, F_next) = (*constants, &F_next[..]);
        let forcing = Forcing::new(body_force, X, t, &c, of_time);
        let update = GridUpdate::new(layout, &c, Acceleration { scale });
        update.p2g(bins, nodes, &|band, first, ids| {
            c.p2g(shape, x, F, band, first, ids, |copies, ids, contributions| {
                forcing.evaluate(ids, &copies.x, &mut contributions.b);
                contributions.take(ids, mass, volume);
                (0..ids.len()).for_each(|k| contributions.set_force(&c, k));
                if !c.planted.is(Fault::StressOfOldStretch) {
                    copies.pick_F(ids, F_next);
                }
                copies.kinematics().stress(&c, law, contributions);
            });
        });
    }

    /// MUSL: P2G of the updated momenta, and from them the reprojected velocities, by the masses that the nodes have.
    #[inline(never)]
    pub(crate) fn p2g_updated_momentum<R, const W: usize>(&mut self, shape: R)
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, layout, bins, nodes, reprojected, .. } = self;
        let Particles { x, v, F, mass, .. } = &*particles;
        let c = *constants;
        let update = GridUpdate::new(layout, &c, Reprojection { nodes: &nodes[..] });
        update.p2g(bins, reprojected, &|band, first, ids| {
            c.p2g(shape, x, F, band, first, ids, |_, ids, contributions| {
                contributions.take_momenta(ids, mass, v);
            });
        });
    }
}

impl<T: RealField + Copy, const D: usize> Constants<T, D> {
    /// P2G of the particles `ids` of one bin, block by block, to the band of nodes that starts at node `first`.
    /// `set(copies, ids, contributions)` sets the contributions of a block.
    #[expect(clippy::too_many_arguments, reason = "the arrays of a bin's particles")]
    fn p2g<R, const W: usize>(
        &self,
        shape: R,
        x: &[SVector<T, D>],
        F: &[SMatrix<T, D, D>],
        band: &mut [Node<T, D>],
        first: usize,
        ids: &[u32],
        set: impl Fn(&mut Copies<T, D>, &[u32], &mut Contributions<T, D, BLOCK>),
    ) where
        R: ShapeChoice<T, D, W>,
    {
        let mut copies = Copies::new();
        let mut block = Block::new();
        let mut contributions = Contributions::zero();
        for ids in ids.chunks(BLOCK) {
            copies.pick(ids, x, F);
            block.compute_weights(self, shape, copies.kinematics());
            if self.planted.is(Fault::LastNodeSkipped) {
                block.skip_last_node(self, &copies.x);
            }
            set(&mut copies, ids, &mut contributions);
            block.p2g(&self.strides, band, first, &contributions, ids.len());
        }
    }
}
