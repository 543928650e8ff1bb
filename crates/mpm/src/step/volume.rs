//! The projection of the change of volume and of its mean stress, by the transfers of the scheme: to the nodes as a mean weighted with
//! masses, and back to the particles.
//!
//! ```text
//! theta_p = sum_i S_ip (sum_q m_q J_q S_iq / m_i);   p_p = rho_p sum_i S_ip (sum_q V0_q P_q S_iq / m_i)
//! ```
//!
//! with the mean stress `P` of the law at `theta`, and `rho_p = m_p/V0_p`. Both projections are adjoint to each other, so that forces follow
//! from an energy. Sources: Zhao, Jiang & Choo, "Circumventing volumetric locking in explicit material point methods", IJNME 124 (2023)
//! 5334-5355, for the transfers; Simo, Taylor & Pister (see `ProjectedVolume`) for the energy.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::fault::Fault;
use mmsmith_particles::Particles;
use nalgebra::{SMatrix, SVector};

use crate::domain::corners::{Corners, grid_values};
use crate::grid::grid_update::{GridUpdate, ScalarMean};
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::kernel::buffers::Buffers;
use crate::kernel::copies::{BLOCK, Copies};
use crate::step::g2p::{CHUNK, FromGrid};
use crate::step::p2g::{P2g, two_stages};
use crate::step::state::State;
use mmsmith_threads::each;

/// Internal variables of a projected law.
const VARIABLES: usize = 2;

impl<T: Lanes, const D: usize> State<T, D> {
    /// Sets the projected changes of volume and mean stresses: of F as it is, or of F after the early part of a step.
    pub(crate) fn project_volume(&mut self, is_early: bool) {
        if let Some(corners) = &mut self.corners {
            corners.shared.recompute_shares();
        }
        let planted = self.grid.constants.planted;
        let F = if is_early { &self.early.F } else { &self.particles.F };
        let mut theta: Vec<T> = F.iter().map(determinant).collect();
        if !planted.is(Fault::JacobianForTheta) {
            self.project(&mut theta);
        }
        let F = if is_early { &self.early.F } else { &self.particles.F };
        let mut p = vec![T::zero(); F.len()];
        let law = &*self.law;
        let pieces = F.chunks(CHUNK).zip(theta.chunks(CHUNK)).zip(p.chunks_mut(CHUNK));
        each(pieces.collect(), &|((F, theta), p)| law.mean_stresses(F, theta, p));
        let Particles { mass, volume, .. } = &self.particles;
        let densities: Vec<T> = mass.iter().zip(volume).map(|(m, V)| *m / *V).collect();
        p.iter_mut().zip(&densities).for_each(|(p, density)| *p /= *density);
        self.project(&mut p);
        p.iter_mut().zip(&densities).for_each(|(p, density)| *p *= *density);
        let internal = match is_early {
            true => &mut self.early.internal,
            false => &mut self.particles.internal,
        };
        for (own, (theta, p)) in internal.chunks_exact_mut(VARIABLES).zip(theta.iter().zip(&p)) {
            own.copy_from_slice(&[*theta, *p]);
        }
    }

    /// `2 A - A^2` of values at the particles, `A` being the mean to the nodes and back: means alone smooth by `h^2`. Particles that share
    /// corners are smoothed by `A`: of the corners' own values `2 A - A^2` leaves too many for a body next to incompressibility to follow.
    fn project(&mut self, values: &mut [T]) {
        if self.corners.is_some() {
            return self.smooth(values);
        }
        let mut means = values.to_vec();
        self.smooth(&mut means);
        for (value, mean) in values.iter_mut().zip(&means) {
            *value -= *mean;
        }
        self.smooth(values);
        for (value, mean) in values.iter_mut().zip(&means) {
            *value += *mean;
        }
    }

    /// Means of the particles' values at the nodes, weighted with masses, and these interpolated at the particles.
    fn smooth(&mut self, values: &mut [T]) {
        let Self { particles, grid, corners, domain, buffers, .. } = self;
        let GridState { constants, layout, bins, means, .. } = grid;
        let (domain, buffers) = (&**domain, &*buffers);
        let Particles { x, F, mass, .. } = &*particles;
        let c = *constants;
        let sums = &*values;
        let update = GridUpdate::new(layout, &c, ScalarMean);
        let p2g = P2g::new(&c, (domain, buffers), false, (x, F));
        let set = |Buffers { contributions, .. }: &mut Buffers<T, D>,
                   _: &mut Copies<T, D>,
                   ids: &[u32]| {
            contributions.without_stress();
            for (value, &p) in contributions.value.iter_mut().zip(ids) {
                let p = p as usize;
                let mut sum = SVector::zeros();
                sum[0] = sums[p] * mass[p];
                *value = Node::new(&sum, &SVector::zeros(), mass[p]);
            }
        };
        p2g.to_grid(&update, (bins, two_stages(corners), None), means, &set);
        if let Some(corners) = corners {
            corners.interpolate(&c, means);
        }
        let at_nodes =
            grid_values(means, corners.as_deref().map(|corners: &Corners<T, D>| corners));
        each(values.chunks_mut(CHUNK).enumerate().collect(), &|(piece, values)| {
            let mut grid = FromGrid::new(&c, at_nodes, buffers.take(domain, false));
            let (x, F): (&[SVector<T, D>], &[SMatrix<T, D, D>]) =
                (&x[piece * CHUNK..], &F[piece * CHUNK..]);
            let blocks = values.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((values, x), F)) in blocks.enumerate() {
                let found = grid.g2p(piece * CHUNK + index * BLOCK, x, F);
                for (value, found) in values.iter_mut().zip(found) {
                    *value = found.velocity[0];
                }
            }
            buffers.give_back(grid.buffers);
        });
    }
}
