//! An elastic law whose change of volume and mean stress come from a projection onto fewer functions.
//!
//! Three fields (Simo, Taylor & Pister, "Variational and projection methods for the volume constraint in finite deformation
//! elasto-plasticity", CMAME 51 (1985) 177-208): with the strain energy `W`, the projected change of volume `theta` and its mean stress `p`,
//!
//! ```text
//! integral of W(Fb) + p (J - theta),   Fb = (theta/J)^(1/D) F
//! theta = projection of J;   p = projection of (Pb : Fb)/(D theta),   Pb = dW/dF at Fb
//! P = (theta/J)^(1/D) Pb - ((Pb : Fb)/D - p J) F^-T
//! ```
//!
//! In the plane the stretch across it stays one, so that the change of volume is that of the plane and the root is a square root: `det Fb`
//! is `theta` in every dimension.

use std::sync::Arc;

use mmsmith_lanes::tensor::{determinant, inverse_transpose, real};
use mmsmith_vocabulary::Material;
use nalgebra::{RealField, SMatrix};

use crate::fault::{Fault, Planted};
use crate::memory::{Increment, InternalVariable, LawWithMemory, of_particle, set_stress};
use crate::{BLOCK, ConstitutiveLaw, Law, SIDE_BY_SIDE, Stressed};

/// How the change of volume enters the stress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Volume {
    /// At each particle by its own deformation gradient.
    #[default]
    Pointwise,
    /// Projected, with its mean stress, onto functions that a body next to incompressibility can follow.
    Projected,
}

/// An elastic law with a projected change of volume. [`evaluate_projected`](LawWithMemory::evaluate_projected) writes
/// `(theta/J)^(1/D) Pb` and the mean stress `(Pb : Fb)/(D theta)`. Its two internal variables are `theta` and `p` above; the solver sets them, and they do
/// not evolve.
#[derive(Clone, Debug)]
pub struct ProjectedVolume<T, const D: usize> {
    law: Law<T, D>,
    planted: Planted,
}

/// A block of tensors side by side.
type Tensors<T, const D: usize> = [[[T; BLOCK]; D]; D];

impl<T: Stressed<D>, const D: usize> ProjectedVolume<T, D> {
    /// The law with its change of volume projected; none of a law that has internal variables of its own.
    #[must_use]
    pub fn new(law: Law<T, D>) -> Option<Self> {
        let is_elastic = matches!(law, Law::Library(_) | Law::Own(_));
        is_elastic.then(|| Self { law, planted: Planted::here() })
    }

    /// Stresses `Pb`, and `(theta/J)^(1/D)`.
    fn stresses(
        &self,
        F: &Tensors<T, D>,
        theta: &[T; BLOCK],
        stress: &mut Tensors<T, D>,
    ) -> [T; BLOCK] {
        let mut scaled = *F;
        let ratios = std::array::from_fn(|n| {
            let own = of_particle(F, n);
            let ratio = volume_root::<T, D>(self.planted, theta[n] / determinant(&own));
            set_stress(&mut scaled, n, &(own * ratio));
            ratio
        });
        self.of_law(&scaled, stress);
        ratios
    }

    fn of_law(&self, F: &Tensors<T, D>, stress: &mut Tensors<T, D>) {
        let Law::Library(_) = &self.law else {
            if let Law::Own(law) = &self.law {
                law.first_piola_kirchhoff(F, stress);
            }
            return;
        };
        for first in (0..BLOCK).step_by(SIDE_BY_SIDE) {
            let part = |i: usize, j: usize| -> [T; SIDE_BY_SIDE] {
                std::array::from_fn(|n| F[i][j][first + n])
            };
            let part = std::array::from_fn(|i| std::array::from_fn(|j| part(i, j)));
            let mut found = [[[T::zero(); SIDE_BY_SIDE]; D]; D];
            self.law.first_piola_kirchhoff_side_by_side(&part, &mut found);
            for i in 0..D {
                for j in 0..D {
                    stress[i][j][first..first + SIDE_BY_SIDE].copy_from_slice(&found[i][j]);
                }
            }
        }
    }
}

impl<T: Stressed<D>, const D: usize> LawWithMemory<T, D> for ProjectedVolume<T, D> {
    fn variables(&self) -> Vec<InternalVariable> {
        let of = |name: &str, at_rest: f64| InternalVariable { name: name.into(), at_rest };
        vec![of("theta_projected", 1.0), of("p_projected", 0.0)]
    }

    fn first_piola_kirchhoff(&self, F: &Tensors<T, D>, q: &[[T; BLOCK]], P: &mut Tensors<T, D>) {
        let [theta, p] = q else { return };
        let mut stress = [[[T::zero(); BLOCK]; D]; D];
        let ratios = self.stresses(F, theta, &mut stress);
        for (n, ratio) in ratios.iter().enumerate() {
            let scaled = of_particle(&stress, n) * *ratio;
            set_stress(P, n, &projected_stress(&of_particle(F, n), &scaled, p[n]));
        }
    }

    fn evolve(&self, _: &Increment<'_, T, D>, _: &mut [[T; BLOCK]]) {}

    fn is_projected(&self) -> bool {
        true
    }

    fn own_projected_law(&self) -> Option<Arc<dyn ConstitutiveLaw<T, D>>> {
        match &self.law {
            Law::Own(law) => Some(law.clone()),
            Law::Library(_) | Law::WithMemory(_) => None,
        }
    }

    fn evaluate_projected(
        &self,
        F: &[SMatrix<T, D, D>],
        theta: &[T],
        scaled: &mut [SMatrix<T, D, D>],
        mean: &mut [T],
    ) {
        let blocks = F.chunks(BLOCK).zip(theta.chunks(BLOCK));
        let found = scaled.chunks_mut(BLOCK).zip(mean.chunks_mut(BLOCK));
        for ((F, theta), (scaled, mean)) in blocks.zip(found) {
            let mut block = [[[T::zero(); BLOCK]; D]; D];
            let mut of_block = [T::one(); BLOCK];
            for n in 0..BLOCK {
                // The last particle fills the block.
                let own = n.min(F.len() - 1);
                of_block[n] = theta[own];
                set_stress(&mut block, n, &F[own]);
            }
            let mut stress = [[[T::zero(); BLOCK]; D]; D];
            let ratios = self.stresses(&block, &of_block, &mut stress);
            for (n, (scaled, mean)) in scaled.iter_mut().zip(mean).enumerate() {
                *scaled = of_particle(&stress, n) * ratios[n];
                *mean = scaled.dot(&F[n]) / (theta[n] * real(D as f64));
            }
        }
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>, q: &[T]) -> Option<T> {
        let ratio = volume_root::<T, D>(self.planted, q.first().copied()? / determinant(F));
        Some(self.law.kirchhoff_in_space(&(F * ratio))?[(2, 2)])
    }

    fn elastic(&self) -> Option<Material<T>> {
        match &self.law {
            Law::Library(material) => Some(*material),
            Law::Own(_) | Law::WithMemory(_) => None,
        }
    }
}

/// `(theta/J)^(1/D)`, from the quotient: the factor of F in `Fb`.
#[inline(always)]
#[must_use]
pub fn volume_root<T: RealField + Copy, const D: usize>(planted: Planted, share: T) -> T {
    match D {
        1 => share,
        2 if planted.is(Fault::VolumeRoot) => share.cbrt(),
        2 => share.sqrt(),
        _ => share.cbrt(),
    }
}

/// The stress of a particle from its deformation gradient, what [`LawWithMemory::evaluate_projected`] gave, and its projected mean stress.
#[inline(always)]
#[must_use]
pub fn projected_stress<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    scaled: &SMatrix<T, D, D>,
    p: T,
) -> SMatrix<T, D, D> {
    let J = determinant(F);
    let mean = scaled.dot(F) / real(D as f64);
    scaled - inverse_transpose(F, J) * (mean - p * J)
}
