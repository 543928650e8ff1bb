//! Laws with an isochoric part, which a change of volume alone does not strain, and a volumetric one.

use mmsmith_lanes::tensor::{determinant, inverse_transpose_minus_identity, real};
use nalgebra::{RealField, SMatrix};

use super::volumetric::VolumetricEnergy;
use super::{LibraryLaw, Volumetric, displacement_gradient, finger_minus_identity, plus_diagonal};

/// The isochoric part of a deformation: `I1bar = J^(-2/3) I1`, with the first invariant of the three-dimensional C, and what its
/// derivative is made of.
#[derive(Clone, Copy)]
pub(crate) struct Isochoric<T, const D: usize> {
    /// `B = b - I`.
    B: SMatrix<T, D, D>,
    /// `tr(B)/3`, with the mean of three stretches whatever D is.
    mean: T,
    /// `J^(-2/3)`.
    scale: T,
}

impl<T: RealField + Copy, const D: usize> Isochoric<T, D> {
    #[inline(always)]
    pub(crate) fn of(F: &SMatrix<T, D, D>) -> Self {
        let B = finger_minus_identity(F);
        let root = determinant(F).cbrt();
        Self { B, mean: B.trace() / real(3.0), scale: T::one() / (root * root) }
    }

    /// `I1bar - 3`, never negative: to a few roundings of itself wherever the shape changes about as much as the volume does.
    ///
    /// With `m = I1/3` and `d = dev(b)/m`, `(J^(2/3)/m)^3 = det(I + d) = 1 - q`, where `q = d:d/2 - det d` is of second order
    /// and little cancels in it. With the cube root `c` of that, `I1bar - 3 = 3 (1 - c)/c = 3 q/(c (1 + c + c^2))`.
    #[inline(always)]
    pub(crate) fn excess(&self) -> T {
        let m = T::one() + self.mean;
        let d = plus_diagonal(self.B, -self.mean) / m;
        // Along the axes that F leaves out.
        let across = -self.mean / m;
        let (mut square, mut det) = (d.norm_squared(), determinant(&d));
        for _ in D..3 {
            square += across * across;
            det *= across;
        }
        let q = square * real(0.5) - det;
        let c = T::one() / (self.scale * m);
        q * real(3.0) / (c * (T::one() + c + c * c))
    }

    /// `tau` for `W1 = dW/dI1bar` and `p = J dW/dJ`: `2 W1 J^(-2/3) dev(b) + p I`.
    #[inline(always)]
    pub(crate) fn kirchhoff(&self, slope: T, pressure: T) -> SMatrix<T, D, D> {
        let factor = self.factor(slope);
        plus_diagonal(self.B * factor, pressure - factor * self.mean)
    }

    /// The normal stress of [`kirchhoff`](Self::kirchhoff) along the axes that F leaves out.
    #[inline(always)]
    pub(crate) fn kirchhoff_across(&self, slope: T, pressure: T) -> T {
        pressure - self.factor(slope) * self.mean
    }

    /// `P = tau F^-T`. As `dev(b) F^-T = F - (1 + tr(B)/3) F^-T`, with `K = F^-T - I` it is
    /// `2 W1 J^(-2/3) (H - K) + (p - 2 W1 J^(-2/3) tr(B)/3) (I + K)`.
    #[inline(always)]
    pub(crate) fn first_piola_kirchhoff(
        &self,
        F: &SMatrix<T, D, D>,
        slope: T,
        pressure: T,
    ) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        let K = inverse_transpose_minus_identity(F);
        let across = self.kirchhoff_across(slope, pressure);
        plus_diagonal((H - K) * self.factor(slope) + K * across, across)
    }

    /// `2 W1 J^(-2/3)`.
    #[inline(always)]
    fn factor(&self, slope: T) -> T {
        slope * self.scale * real(2.0)
    }
}

/// A law `W = w(I1bar) + kappa U(J)`.
pub trait OfFirstInvariant: Copy + Send + Sync + 'static {
    /// The number type. No parameter of the trait, so that one implementation of [`LibraryLaw`] serves all laws of this kind.
    type Scalar: RealField + Copy;

    /// `dw/dI1bar`, where `I1bar - 3` is `excess`; not a number where the energy is not defined.
    fn slope(&self, excess: Self::Scalar) -> Self::Scalar;

    /// `w`, zero where `excess = I1bar - 3` is; not a number where it is not defined.
    fn isochoric_energy(&self, excess: Self::Scalar) -> Self::Scalar;

    /// `kappa` and `U`.
    fn volume(&self) -> (Self::Scalar, Volumetric);

    /// `kappa J U'(J)`.
    #[inline(always)]
    fn pressure<const D: usize>(&self, F: &SMatrix<Self::Scalar, D, D>) -> Self::Scalar {
        let (kappa, volumetric) = self.volume();
        kappa * volumetric.pressure(F)
    }
}

impl<L: OfFirstInvariant> LibraryLaw<L::Scalar> for L {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<L::Scalar, D, D>) -> SMatrix<L::Scalar, D, D> {
        let isochoric = Isochoric::of(F);
        isochoric.kirchhoff(self.slope(isochoric.excess()), self.pressure(F))
    }

    #[inline(always)]
    fn first_piola_kirchhoff<const D: usize>(
        &self,
        F: &SMatrix<L::Scalar, D, D>,
    ) -> SMatrix<L::Scalar, D, D> {
        let isochoric = Isochoric::of(F);
        isochoric.first_piola_kirchhoff(F, self.slope(isochoric.excess()), self.pressure(F))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<L::Scalar, D, D>) -> L::Scalar {
        let (kappa, volumetric) = self.volume();
        self.isochoric_energy(Isochoric::of(F).excess()) + kappa * volumetric.energy(F)
    }
}
