//! Changes of volume that are projected by the transfers of the scheme, for domains that do not [exchange
//! scalars](crate::domain::of_particles::Domain::exchanges_scalars): to the nodes as a mean weighted with masses, and back to the particles.
//!
//! ```text
//! theta_p = sum_i S_ip (sum_q m_q J_q S_iq / m_i);   p_p = rho_p sum_i S_ip (sum_q V0_q P_q S_iq / m_i)
//! ```
//!
//! with the mean stress `P` of the law at `theta`, and `rho_p = m_p/V0_p`. Both projections are adjoint to each other, so that forces follow
//! from an energy. Sources: Zhao, Jiang & Choo, "Circumventing volumetric locking in explicit material point methods", IJNME 124 (2023)
//! 5334-5355, for the transfers; Simo, Taylor & Pister (see `ProjectedVolume`) for the energy.
//!
//! Where changes of volume follow the grid instead, [`VolumeRates`](crate::grid::volume_rates::VolumeRates) has the sums; when they are taken,
//! and the mean stress that is told, are here.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::Particles;
use nalgebra::{SMatrix, SVector};

use crate::domain::corners::{Corners, grid_values};
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, ScalarMean};
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::kernel::any::Interpolated;
use crate::kernel::buffers::{Buffers, GridValues};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::projected::VARIABLES;
use crate::step::g2p::{CHUNK, FromGrid};
use crate::step::p2g::P2g;
use crate::step::state::State;
use mmsmith_threads::each;

/// A scalar of each particle as a function of the particle, for P2G.
enum Scalar {
    /// The change of volume.
    Volume,
    /// The mean stress at the projected change of volume, which the nodes have, times the reference volume.
    MeanStress,
    /// The scalar that the nodes have.
    OfNodes,
}

impl<T: Lanes, const D: usize> State<T, D> {
    /// Where changes of volume follow the grid: sets the growth of nodes in a time, by their velocities; by their masses before forces are
    /// known, `is_early`, weights are computed first.
    pub(crate) fn set_growth(&mut self, is_early: bool, time: T) {
        let GridState { constants, layout, bins, nodes, rates, .. } = &mut self.grid;
        if let Some(rates) = rates {
            if is_early {
                rates.weigh_all((constants, layout), bins, nodes);
            }
            rates.set((constants, layout), bins, nodes, time);
        }
    }

    /// As [`set_growth`](Self::set_growth) by the reprojected velocities.
    pub(crate) fn set_reprojected_growth(&mut self, time: T) {
        let GridState { constants, layout, bins, reprojected, rates, .. } = &mut self.grid;
        if let Some(rates) = rates {
            rates.set((constants, layout), bins, reprojected, time);
        }
    }

    /// Where changes of volume follow the grid: sets the mean stresses that are told, each of a particle alone.
    pub(crate) fn tell_mean_stress(&mut self) {
        let Self { particles, grid, law, domain, buffers, .. } = self;
        let c = grid.constants;
        let Particles { F, mass, volume, internal, .. } = particles;
        let (F, mass, volume, law, domain) = (&*F, &*mass, &*volume, &**law, &**domain);
        let buffers = &*buffers;
        each(internal.chunks_mut(CHUNK * VARIABLES).enumerate().collect(), &|(piece, internal)| {
            let mut own = buffers.take(domain, false);
            let mut copies = Copies::new();
            for (index, internal) in internal.chunks_mut(BLOCK * VARIABLES).enumerate() {
                let first = piece * CHUNK + index * BLOCK;
                let ids = &successive(first)[..internal.len() / VARIABLES];
                let mut theta = [T::one(); BLOCK];
                for (theta, own) in theta.iter_mut().zip(internal.chunks_exact(VARIABLES)) {
                    *theta = own[0];
                }
                own.contributions.take(ids, mass, volume);
                copies.pick_F(ids, F);
                law.mean_stresses(&c, &copies.F, &theta, &mut own.contributions);
                for (k, internal) in internal.chunks_exact_mut(VARIABLES).enumerate() {
                    let p = first + k;
                    let mean = own.contributions.value[k].values[0] / volume[p];
                    internal[1] = mean * theta[k] / determinant(&F[p]);
                }
            }
            buffers.give_back(own);
        });
    }

    /// Sets the projected changes of volume and mean stresses: of F as it is, or of F after the early part of a step.
    ///
    /// With `A` the mean to the nodes and back, a projection is `2 A - A^2`, since means alone smooth by `h^2`: at the nodes, twice the means less the
    /// means of what these are at the particles. Particles that share corners are smoothed by `A`: of the corners' own values `2 A - A^2`
    /// leaves too many for a body next to incompressibility to follow.
    pub(crate) fn project_volume(&mut self, is_early: bool) {
        if let Some(corners) = &mut self.corners {
            corners.shared.recompute_shares();
        }
        let is_repeated = self.corners.is_none();
        self.means_of(&Scalar::Volume, is_early);
        if is_repeated {
            self.means_of(&Scalar::OfNodes, is_early);
            let GridState { means, means_again, .. } = &mut self.grid;
            for (node, again) in means.iter_mut().zip(means_again) {
                node.values[0] = node.values[0] + node.values[0] - again.values[0];
            }
        }
        self.means_of(&Scalar::MeanStress, is_early);
        if is_repeated {
            let GridState { means, means_again, .. } = &mut self.grid;
            let theta: Vec<T> = means.iter().map(|node| node.values[0]).collect();
            std::mem::swap(means, means_again);
            self.means_of(&Scalar::OfNodes, is_early);
            let GridState { means, means_again, .. } = &mut self.grid;
            for ((node, again), theta) in means.iter_mut().zip(means_again).zip(theta) {
                node.second_mut()[0] = node.values[0] + node.values[0] - again.values[0];
                node.values[0] = theta;
            }
        } else {
            let GridState { means, means_again, .. } = &mut self.grid;
            for (node, again) in means.iter_mut().zip(means_again) {
                node.second_mut()[0] = again.values[0];
            }
        }
        self.take_projected(is_early);
    }

    /// Means at the nodes of a scalar of the particles, weighted with masses: in `means` of what needs nothing of the nodes, else in
    /// `means_again` of what follows from `means`.
    fn means_of(&mut self, scalar: &Scalar, is_early: bool) {
        let Self { particles, early, grid, corners, domain, buffers, law, .. } = self;
        let GridState { constants, layout, bins, means, means_again, .. } = grid;
        let (domain, buffers, law) = (&**domain, &*buffers, &**law);
        let Particles { x, F, mass, volume, .. } = &*particles;
        let F_now = if is_early { &early.F } else { F };
        let c = *constants;
        let reads_grid = !matches!(scalar, Scalar::Volume);
        let (from, to) = match reads_grid {
            true => (&means[..], means_again),
            false => (&[][..], means),
        };
        let (at_corners, stages) = match corners {
            Some(corners) => {
                if reads_grid {
                    corners.interpolate(&c, from);
                }
                let Corners { shared, exchange, values, .. } = &mut **corners;
                (Some((&*shared, &*values)), Some((&*shared, exchange)))
            }
            None => (None, None),
        };
        let values = GridValues { nodes: from, at_corners };
        let update = GridUpdate::new(layout, &c, ScalarMean);
        let p2g = P2g { reads_grid, ..P2g::new(&c, (domain, buffers), false, (x, F)) };
        let set = |buffers: &mut Buffers<T, D>, copies: &mut Copies<T, D>, ids: &[u32]| {
            if reads_grid {
                values.g2p(&c, buffers, ids);
            }
            let Buffers { contributions, interpolated, .. } = buffers;
            match scalar {
                Scalar::MeanStress => {
                    let theta = projected(&c, interpolated, F_now, ids);
                    contributions.take(ids, mass, volume);
                    copies.pick_F(ids, F_now);
                    law.mean_stresses(&c, &copies.F, &theta, contributions);
                    contributions.without_stress();
                }
                Scalar::Volume | Scalar::OfNodes => {
                    contributions.without_stress();
                    let own = contributions.value.iter_mut().zip(&*interpolated);
                    for ((value, of_nodes), &p) in own.zip(ids) {
                        let p = p as usize;
                        let mut sum = SVector::zeros();
                        sum[0] = match reads_grid {
                            true => of_nodes.velocity[0],
                            false => determinant(&F_now[p]),
                        } * mass[p];
                        *value = Node::new(&sum, &SVector::zeros(), mass[p]);
                    }
                }
            }
        };
        p2g.to_grid(&update, (bins, stages, None), to, &set);
    }

    /// G2P of the projected changes of volume, which are the first of the nodes' values, and of the projected mean stresses over densities, the
    /// first of their second vectors.
    fn take_projected(&mut self, is_early: bool) {
        let Self { particles, early, grid, corners, domain, buffers, .. } = self;
        let GridState { constants, means, .. } = grid;
        let (domain, buffers, c) = (&**domain, &*buffers, *constants);
        if let Some(corners) = corners {
            corners.interpolate(&c, means);
        }
        let at_nodes = grid_values(means, corners.as_deref());
        let Particles { x, F, mass, volume, internal, .. } = &mut *particles;
        let (x, F, mass, volume) = (&*x, &*F, &*mass, &*volume);
        let F_now = if is_early { &early.F } else { F };
        let internal = if is_early { &mut early.internal } else { internal };
        each(internal.chunks_mut(CHUNK * VARIABLES).enumerate().collect(), &|(piece, internal)| {
            let mut grid = FromGrid::new(&c, at_nodes, buffers.take(domain, false));
            let of_piece = piece * CHUNK;
            let (x, F) = (&x[of_piece..], &F[of_piece..]);
            let blocks =
                internal.chunks_mut(BLOCK * VARIABLES).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((internal, x), F)) in blocks.enumerate() {
                let first = of_piece + index * BLOCK;
                // The last block of a piece may end before that of all particles does.
                let count = internal.len() / VARIABLES;
                let found = grid.g2p(first, &x[..count], &F[..count]);
                for (k, (own, found)) in internal.chunks_exact_mut(VARIABLES).zip(found).enumerate()
                {
                    let p = first + k;
                    own[0] = match c.planted.is(Fault::JacobianForTheta) {
                        true => determinant(&F_now[p]),
                        false => found.velocity[0],
                    };
                    own[1] = found.second[0] * (mass[p] / volume[p]);
                }
            }
            buffers.give_back(grid.buffers);
        });
    }
}

/// The projected change of volume of each particle of a block; one beyond its last.
fn projected<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    interpolated: &[Interpolated<T, D>; BLOCK],
    F: &[SMatrix<T, D, D>],
    ids: &[u32],
) -> [T; BLOCK] {
    let mut theta = [T::one(); BLOCK];
    for ((theta, interpolated), &p) in theta.iter_mut().zip(interpolated).zip(ids) {
        *theta = match c.planted.is(Fault::JacobianForTheta) {
            true => determinant(&F[p as usize]),
            false => interpolated.velocity[0],
        };
    }
    theta
}
