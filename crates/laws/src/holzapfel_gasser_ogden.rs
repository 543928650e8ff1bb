//! The law of Holzapfel, Gasser and Ogden.

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SMatrix, SVector};

use super::isochoric::Isochoric;
use super::volumetric::VolumetricEnergy;
use super::{LibraryLaw, Volumetric, green_twice};

/// The law of Holzapfel, Gasser and Ogden with one family of fibres,
/// `W = mu/2 (I1bar - 3) + k1/(2 k2) (exp(k2 <I4 - 1>^2) - 1) + kappa U(J)`, where `I4 = a . C a` and `<x> = max(x, 0)`: fibres carry no
/// compression. G. A. Holzapfel, T. C. Gasser & R. W. Ogden, "A new constitutive framework for arterial wall mechanics and a
/// comparative study of material models", J. Elasticity 61 (2000) 1-48.
///
/// `I4` is that of C itself, not of its isochoric part: D. R. Nolan, A. L. Gower, M. Destrade, R. W. Ogden & J. P. McGarry, "A
/// robust anisotropic hyperelastic formulation for the modelling of soft tissue", J. Mech. Behav. Biomed. Mater. 39 (2014) 48-60.
/// The fibres' direction is `a = (cos angle, sin angle, 0)`. At small strain the matrix has the shear modulus mu and the bulk
/// modulus kappa, and fibres that are stretched by `e` add the stress `4 k1 e` along themselves, without `k2`: where that is zero,
/// their energy is `k1/2 <I4 - 1>^2`.
#[derive(Clone, Copy)]
pub(crate) struct HolzapfelGasserOgden<T> {
    pub(crate) mu: T,
    pub(crate) k1: T,
    pub(crate) k2: T,
    /// In radians, from the first axis to the second.
    pub(crate) angle: T,
    pub(crate) kappa: T,
    pub(crate) volumetric: Volumetric,
}

impl<T: RealField + Copy> HolzapfelGasserOgden<T> {
    /// `a`, less the axes that F leaves out.
    fn direction<const D: usize>(&self) -> SVector<T, D> {
        let (sine, cosine) = self.angle.sin_cos();
        SVector::from_fn(|i, _| match i {
            0 => cosine,
            1 => sine,
            _ => T::zero(),
        })
    }

    /// `<I4 - 1>`; not a number where the strain is none. As `a` is a unit vector, `I4 - 1 = a . (C - I) a`, to which axes without
    /// stretch add nothing.
    fn excess<const D: usize>(F: &SMatrix<T, D, D>, direction: &SVector<T, D>) -> T {
        let excess = (green_twice(F) * direction).dot(direction);
        if excess <= T::zero() { T::zero() } else { excess }
    }

    /// `2 dW/dI4`.
    fn tension<const D: usize>(&self, F: &SMatrix<T, D, D>, direction: &SVector<T, D>) -> T {
        let excess = Self::excess(F, direction);
        self.k1 * real(2.0) * excess * (self.k2 * excess * excess).exp()
    }

    /// `kappa J U'(J)`.
    fn pressure<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        self.kappa * self.volumetric.pressure(F)
    }

    /// `dW/dI1bar`.
    fn slope(&self) -> T {
        self.mu * real(0.5)
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for HolzapfelGasserOgden<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let direction = self.direction();
        let fibre = F * direction;
        Isochoric::of(F).kirchhoff(self.slope(), self.pressure(F))
            + fibre * fibre.transpose() * self.tension(F, &direction)
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let direction = self.direction();
        Isochoric::of(F).first_piola_kirchhoff(F, self.slope(), self.pressure(F))
            + F * direction * direction.transpose() * self.tension(F, &direction)
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let excess = Self::excess(F, &self.direction());
        let square = excess * excess;
        let fibres = if self.k2 == T::zero() {
            self.k1 * square
        } else {
            self.k1 * ((self.k2 * square).exp_m1() / self.k2)
        };
        self.slope() * Isochoric::of(F).excess()
            + fibres * real(0.5)
            + self.kappa * self.volumetric.energy(F)
    }
}
