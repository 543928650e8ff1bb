//! Ogden's law.

use mmsmith_lanes::tensor::{determinant, inverse_transpose, product, real};
use nalgebra::{RealField, SMatrix};

use super::principal::{coaxial_in_space, principal_logarithms};
use super::slopes::carries_slopes;
use super::volumetric::VolumetricEnergy;
use super::{LibraryLaw, Volumetric, finger_minus_identity, log_jacobian, plus_diagonal};

/// Ogden's law with three terms, `W = sum_p mu_p/alpha_p (lb1^alpha_p + lb2^alpha_p + lb3^alpha_p - 3) + kappa U(J)`, where
/// `lb_i = J^(-1/3) lambda_i`: R. W. Ogden, "Large deformation isotropic elasticity: on the correlation of theory and experiment
/// for compressible rubberlike solids", Proc. R. Soc. Lond. A 328 (1972) 567-583; Holzapfel, "Nonlinear Solid Mechanics" (2000),
/// section 6.5.
///
/// A term whose mu is zero is none. At small strain the shear modulus is `sum_p mu_p alpha_p/2` and the bulk modulus kappa.
#[derive(Clone, Copy)]
pub(crate) struct Ogden<T> {
    pub(crate) mu1: T,
    pub(crate) alpha1: T,
    pub(crate) mu2: T,
    pub(crate) alpha2: T,
    pub(crate) mu3: T,
    pub(crate) alpha3: T,
    pub(crate) kappa: T,
    pub(crate) volumetric: Volumetric,
}

/// A term of the energy.
#[derive(Clone, Copy)]
struct Term<T> {
    mu: T,
    alpha: T,
}

/// The isochoric stress in the plane, `factor dev(b) + within I` with the deviator of the plane, and across it `-2 within`.
#[derive(Clone, Copy)]
struct InThePlane<T> {
    factor: T,
    within: T,
}

impl<T: RealField + Copy> Ogden<T> {
    /// The terms that are any. The stretches' product is one, so that a power of zero has no energy either.
    fn terms(&self) -> impl Iterator<Item = Term<T>> {
        [(self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3)]
            .into_iter()
            .map(|(mu, alpha)| Term { mu, alpha })
            .filter(|term| term.mu != T::zero() && term.alpha != T::zero())
    }

    /// The isochoric Kirchhoff stress along the axes of the `logarithms` of the `lb_i`, whose sum is zero:
    /// `sum_p mu_p (lb_i^alpha_p - (lb1^alpha_p + lb2^alpha_p + lb3^alpha_p)/3)`.
    fn principal(&self, logarithms: [T; 3]) -> [T; 3] {
        let mut stresses = [T::zero(); 3];
        for Term { mu, alpha } in self.terms() {
            let growths = logarithms.map(|logarithm| (alpha * logarithm).exp_m1());
            let mean = (growths[0] + growths[1] + growths[2]) / real(3.0);
            for (stress, growth) in stresses.iter_mut().zip(growths) {
                *stress += mu * (growth - mean);
            }
        }
        stresses
    }

    /// In two dimensions, where `b/J` has the eigenvalues `exp(theta)` and its inverse: `lb_1,2 = J^(1/6) exp(+-theta/2)` and, across,
    /// `J^(-1/3)`. `dev(b)/J` is `sinh(theta)` along its axes, and the quotient of two hyperbolic sines is smooth where stretches meet.
    fn in_the_plane<const D: usize>(&self, F: &SMatrix<T, D, D>) -> InThePlane<T> {
        let J = determinant(F);
        let log_J = log_jacobian(F);
        let Ratio { theta, sinh } = Ratio::of(F);
        let mut sum = InThePlane { factor: T::zero(), within: T::zero() };
        for Term { mu, alpha } in self.terms() {
            let half = alpha * theta * real(0.5);
            let quotient = if sinh == T::zero() { alpha * real(0.5) } else { half.sinh() / sinh };
            let growth = (alpha * log_J / real(6.0)).exp_m1();
            // cosh(half) - 1.
            let sine = (half * real(0.5)).sinh();
            let rise = sine * sine * real(2.0);
            let across = (-alpha * log_J / real(3.0)).exp_m1();
            sum.factor += mu * (growth + T::one()) * quotient / J;
            sum.within += mu * (growth * (rise + T::one()) + rise - across) / real(3.0);
        }
        sum
    }

    /// `kappa J U'(J)`.
    fn pressure<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        self.kappa * self.volumetric.pressure(F)
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for Ogden<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let isochoric = match D {
            1 => SMatrix::repeat(self.principal(of_one_stretch(log_jacobian(F)))[0]),
            2 => {
                let InThePlane { factor, within } = self.in_the_plane(F);
                let B = finger_minus_identity(F);
                plus_diagonal(B * factor, within - B.trace() * factor * real(0.5))
            }
            _ => coaxial_in_space(F, |logarithms| self.principal(isochoric(logarithms))),
        };
        plus_diagonal(isochoric, self.pressure(F))
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(&self.kirchhoff(F), &inverse_transpose(F, determinant(F)))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let log_J = log_jacobian(F);
        let logarithms = match D {
            1 => of_one_stretch(log_J),
            2 => {
                let (half, sixth) = (Ratio::of(F).theta * real(0.5), log_J / real(6.0));
                [sixth + half, sixth - half, -log_J / real(3.0)]
            }
            _ => isochoric(principal_logarithms(F).1.into()),
        };
        let mut sum = self.kappa * self.volumetric.energy(F);
        for Term { mu, alpha } in self.terms() {
            for logarithm in logarithms {
                // The logarithms themselves sum to zero.
                sum += mu / alpha * exponential_beyond_linear(alpha * logarithm);
            }
        }
        sum
    }
}

/// The ratio of the stretches in the plane, `exp(theta)`.
#[derive(Clone, Copy)]
struct Ratio<T> {
    theta: T,
    /// `sinh(theta)`.
    sinh: T,
}

impl<T: RealField + Copy> Ratio<T> {
    /// By `cosh(theta) - 1 = (tr(b) - 2 J)/(2 J)`, a sum of squares over `2 J`.
    fn of<const D: usize>(F: &SMatrix<T, D, D>) -> Self {
        let (stretch, shear) = (F[(0, 0)] - F[(1, 1)], F[(0, 1)] + F[(1, 0)]);
        let z = (stretch * stretch + shear * shear) / (determinant(F) * real(2.0));
        if const { carries_slopes::<T>() } && z == T::zero() {
            // All that follows from the ratio is even in it: where it is none it has no slope, though the root has one without bounds.
            return Self { theta: T::zero(), sinh: T::zero() };
        }
        let sinh = (z * (z + real(2.0))).sqrt();
        Self { theta: (z + sinh).ln_1p(), sinh }
    }
}

/// Logarithms of the `lb_i` where one stretch is J and two are one.
fn of_one_stretch<T: RealField + Copy>(log_J: T) -> [T; 3] {
    let across = -log_J / real(3.0);
    [across * real(-2.0), across, across]
}

/// Logarithms of the `lb_i` from those of the squared stretches.
fn isochoric<T: RealField + Copy>(logarithms: [T; 3]) -> [T; 3] {
    let mean = (logarithms[0] + logarithms[1] + logarithms[2]) / real(3.0);
    logarithms.map(|logarithm| (logarithm - mean) * real(0.5))
}

/// `exp(x) - 1 - x`, of second order.
fn exponential_beyond_linear<T: RealField + Copy>(x: T) -> T {
    if x.abs() > T::one() {
        return x.exp_m1() - x;
    }
    // As many terms leave out less than a rounding of the sum.
    let sum = (2..20).rev().fold(T::zero(), |sum, n| (sum * x + T::one()) / real(f64::from(n)));
    x * x * sum
}
