//! The neo-Hookean law.

use mmsmith_lanes::tensor::{
    det_minus_one, determinant, inverse_transpose_minus_identity,
    inverse_transpose_minus_identity_short, real,
};
use mmsmith_scalar_functions::logarithm::{is_near_one, ln_near_one, ln_of_both_in_range};
use nalgebra::{RealField, SMatrix};

use super::{
    LibraryLaw, displacement_gradient, finger_minus_identity, log_jacobian, log_jacobian_is_short,
    log_jacobian_short, plus_diagonal,
};
use crate::fault::{Fault, Planted};

/// The neo-Hookean law, `W = mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2`.
#[derive(Clone, Copy)]
pub struct NeoHookean<T> {
    /// The first Lame constant.
    pub lambda: T,
    /// The shear modulus.
    pub mu: T,
    /// The fault planted in it, for tests.
    pub planted: Planted,
}

impl<T: RealField + Copy> NeoHookean<T> {
    /// `lambda ln J`.
    #[inline(always)]
    fn pressure<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        if self.planted.is(Fault::LinearLogarithm) {
            return self.lambda * det_minus_one(&displacement_gradient(F));
        }
        self.lambda * log_jacobian(F)
    }

    /// First Piola-Kirchhoff stress, from `lambda ln J` and `K = F^-T - I`.
    #[inline(always)]
    fn first_piola_kirchhoff_at<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
        pressure: T,
        K: SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        let P = plus_diagonal((H - K) * self.mu + K * pressure, pressure);
        if self.planted.is(Fault::TransposedLaw) { P.transpose() } else { P }
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for NeoHookean<T> {
    const HAS_SHORT: bool = true;

    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        plus_diagonal(finger_minus_identity(F) * self.mu, self.pressure(F))
    }

    #[inline(always)]
    fn is_short<const D: usize>(&self, F: &SMatrix<T, D, D>) -> bool {
        !self.planted.is(Fault::LinearLogarithm) && log_jacobian_is_short(F)
    }

    #[inline(always)]
    fn kirchhoff_short<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        plus_diagonal(finger_minus_identity(F) * self.mu, self.lambda * log_jacobian_short(F))
    }

    /// Without the products with the zeros of the law of space.
    #[inline(always)]
    fn kirchhoff_with_hoop<const SHORT: bool, const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
        hoop: T,
    ) -> (SMatrix<T, D, D>, T, bool) {
        let (in_plane, h) = (det_minus_one(&displacement_gradient(F)), hoop - T::one());
        let growth = in_plane + h + in_plane * h;
        let of_growth: f64 = nalgebra::convert_unchecked(growth);
        let is_linear = self.planted.is(Fault::LinearLogarithm);
        let is_short = !is_linear && is_near_one(of_growth);
        let pressure = if is_linear {
            self.lambda * growth
        } else if SHORT {
            self.lambda * real(ln_near_one(of_growth))
        } else {
            let J = nalgebra::convert_unchecked(determinant(F) * hoop);
            self.lambda * real(ln_of_both_in_range(of_growth, J))
        };
        let around = (h + h + h * h) * self.mu + pressure;
        (plus_diagonal(finger_minus_identity(F) * self.mu, pressure), around, is_short)
    }

    #[inline(always)]
    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        self.first_piola_kirchhoff_at(F, self.pressure(F), inverse_transpose_minus_identity(F))
    }

    #[inline(always)]
    fn first_piola_kirchhoff_short<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        let K = inverse_transpose_minus_identity_short(F);
        self.first_piola_kirchhoff_at(F, self.lambda * log_jacobian_short(F), K)
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let log_J = log_jacobian(F);
        let trace = finger_minus_identity(F).trace();
        let (half, two) = (real::<T>(0.5), real::<T>(2.0));
        self.lambda * log_J * log_J * half + self.mu * half * (trace - two * log_J)
    }
}

/// The neo-Hookean law with lambda = 0.
#[derive(Clone, Copy)]
pub struct NeoHookeanNoLog<T> {
    /// The shear modulus.
    pub mu: T,
}

impl<T: RealField + Copy> LibraryLaw<T> for NeoHookeanNoLog<T> {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        finger_minus_identity(F) * self.mu
    }

    #[inline(always)]
    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        (H - inverse_transpose_minus_identity(F)) * self.mu
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let trace = finger_minus_identity(F).trace();
        self.mu * real(0.5) * (trace - real::<T>(2.0) * log_jacobian(F))
    }
}
