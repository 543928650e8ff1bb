//! Stresses of elastic laws whose change of volume is projected, for blocks of particles.
//!
//! With `tau_b` the Kirchhoff stress of the law at `Fb = (theta/J)^(1/D) F` and the projected mean stress `p`, the stress of
//! [`ProjectedVolume`](mmsmith_laws::ProjectedVolume) is `tau = tau_b - (tr(tau_b)/D - p J) I`, and its mean stress `tr(tau_b)/(D theta)`.

use std::sync::Arc;

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::{determinant, real};
use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{LawWithMemory, volume_root};
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
    /// Whether `theta` follows the grid.
    follows_grid: bool,
}

impl<T: Lanes, const D: usize> ProjectedBlocks<T, D> {
    pub(crate) fn new(law: Arc<dyn LawWithMemory<T, D>>, elastic: Box<dyn BlockLaw<T, D>>) -> Self {
        Self { law, elastic, follows_grid: false }
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
        dispatch(WithVolume { planted: c.planted, theta, F: &mut of_volume });
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
        if self.follows_grid && c.planted.is(Fault::JacobianForTheta) {
            theta = std::array::from_fn(|n| determinant(&F[n]));
        }
        self.set_fluxes_with_volume(c, F, &theta, contributions);
        let Contributions { stress_flux, volume, value, .. } = contributions;
        if self.follows_grid {
            let (share, spacing) = (real::<T>(1.0 / D as f64), c.spacing());
            for (flux, value) in stress_flux.iter_mut().zip(value) {
                let mean = flux.trace() * share;
                *value.scalar_mut() = -mean * spacing;
                for i in 0..D {
                    flux[(i, i)] -= mean;
                }
            }
            return;
        }
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

    fn follow_grid(&mut self) {
        self.follows_grid = true;
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

/// Gives the deformation gradients of a block their changes of volume `theta`.
struct WithVolume<'a, T, const D: usize> {
    planted: Planted,
    theta: &'a [T; BLOCK],
    F: &'a mut [SMatrix<T, D, D>; BLOCK],
}

impl<T: Lanes, const D: usize> Loop for WithVolume<'_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { planted, theta, F } = self;
        // Loop by loop, so that quotients and roots are those of vectors.
        let mut factors = [T::one(); BLOCK];
        for (factor, F) in factors.iter_mut().zip(&*F) {
            *factor = determinant(F);
        }
        for (factor, theta) in factors.iter_mut().zip(theta) {
            *factor = *theta / *factor;
        }
        for factor in &mut factors {
            *factor = volume_root::<T, D>(planted, *factor);
        }
        for (F, factor) in F.iter_mut().zip(factors) {
            *F *= factor;
        }
    }
}
