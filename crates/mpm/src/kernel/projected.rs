//! Stresses of elastic laws whose change of volume is projected, for blocks of particles.
//!
//! With `tau_b` the Kirchhoff stress of the law at `Fb = (theta/J)^(1/D) F` and the projected mean stress `p`, the stress of
//! [`ProjectedVolume`](mmsmith_laws::ProjectedVolume) is `tau = tau_b - (tr(tau_b)/D - p J) I`, and its mean stress `tr(tau_b)/(D theta)`.

use std::sync::Arc;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::{determinant, real};
use mmsmith_laws::{LawWithMemory, with_volume};
use nalgebra::{SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::any::Contributions;
use crate::kernel::block::BlockLaw;
use crate::kernel::copies::BLOCK;

/// Internal variables of a particle: `theta` and `p`.
pub(crate) const VARIABLES: usize = 2;

/// An elastic law with a projected change of volume.
pub(crate) struct ProjectedBlocks<T, const D: usize> {
    law: Arc<dyn LawWithMemory<T, D>>,
    /// The law that is evaluated at `Fb`.
    elastic: Box<dyn BlockLaw<T, D>>,
}

impl<T: Lanes, const D: usize> ProjectedBlocks<T, D> {
    pub(crate) fn new(law: Arc<dyn LawWithMemory<T, D>>, elastic: Box<dyn BlockLaw<T, D>>) -> Self {
        Self { law, elastic }
    }

    /// Sets the stress fluxes `-V0 tau_b / h`.
    fn set_fluxes_with_volume(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        theta: &[T; BLOCK],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let mut of_volume = *F;
        for (F, theta) in of_volume.iter_mut().zip(theta) {
            *F = with_volume(c.planted, F, *theta);
        }
        self.elastic.stress(c, &of_volume, &[], contributions);
    }
}

impl<T: Lanes, const D: usize> BlockLaw<T, D> for ProjectedBlocks<T, D> {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        internal: &[T],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        let (mut theta, mut p) = ([T::one(); BLOCK], [T::zero(); BLOCK]);
        for (n, own) in internal.chunks_exact(VARIABLES).take(BLOCK).enumerate() {
            (theta[n], p[n]) = (own[0], own[1]);
        }
        self.set_fluxes_with_volume(c, F, &theta, contributions);
        let Contributions { stress_flux, volume, .. } = contributions;
        for n in 0..BLOCK {
            let flux = &mut stress_flux[n];
            let of_mean = volume[n] * c.inverse_spacing * p[n] * determinant(&F[n]);
            let change = flux.trace() / real(D as f64) + of_mean;
            for i in 0..D {
                flux[(i, i)] -= change;
            }
        }
    }

    fn variables(&self) -> usize {
        VARIABLES
    }

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        self.law.initial(X)
    }

    fn follows_deformation(&self) -> bool {
        false
    }

    fn is_projected(&self) -> bool {
        true
    }

    fn mean_stresses(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        theta: &[T; BLOCK],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        self.set_fluxes_with_volume(c, F, theta, contributions);
        let Contributions { stress_flux, value, mass, .. } = contributions;
        for n in 0..BLOCK {
            let mut of_volume = SVector::zeros();
            of_volume[0] =
                -stress_flux[n].trace() / (c.inverse_spacing * theta[n] * real(D as f64));
            value[n] = Node::new(&of_volume, &SVector::zeros(), mass[n]);
        }
    }
}
