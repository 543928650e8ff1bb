//! The Mooney-Rivlin law.

use mmsmith_lanes::tensor::{inverse_transpose_minus_identity, product, real};
use nalgebra::{RealField, SMatrix};

use super::{
    LibraryLaw, displacement_gradient, finger_minus_identity, green_twice, log_jacobian,
    plus_diagonal,
};

/// The compressible Mooney-Rivlin law,
/// `W = c1 (I1 - 3 - 2 ln J) + c2 (I2 - 3 - 4 ln J) + lambda/2 (ln J)^2`.
///
/// With `B = b - I` the part of c2 in the stress, `I1 b - b^2 - 2 I`, is `B + tr(B) (I + B) - B^2`: the invariant of the
/// three-dimensional C is `3 + tr B` in any dimension, and nothing cancels.
#[derive(Clone, Copy)]
pub(crate) struct MooneyRivlin<T> {
    pub(crate) c1: T,
    pub(crate) c2: T,
    pub(crate) lambda: T,
}

impl<T: RealField + Copy> MooneyRivlin<T> {
    /// `2 c2 tr(B) + lambda ln J`.
    fn pressure<const D: usize>(&self, F: &SMatrix<T, D, D>, trace: T) -> T {
        self.c2 * trace * real(2.0) + self.lambda * log_jacobian(F)
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for MooneyRivlin<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let B = finger_minus_identity(F);
        let (trace, two) = (B.trace(), real::<T>(2.0));
        let tau = B * ((self.c1 + self.c2) * two) + (B * trace - product(&B, &B)) * (self.c2 * two);
        plus_diagonal(tau, self.pressure(F, trace))
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let two = real::<T>(2.0);
        let H = displacement_gradient(F);
        let K = inverse_transpose_minus_identity(F);
        let E2 = green_twice(F);
        // F - F^-T belongs to c1 once and, beside `tr(E2) F - F E2`, to c2 twice.
        let from_c2 = F * E2.trace() - product(F, &E2);
        let volume = self.lambda * log_jacobian(F);
        let P = (H - K) * ((self.c1 + self.c2 * two) * two) + from_c2 * (self.c2 * two);
        plus_diagonal(P + K * volume, volume)
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        // I1 = 3 + tr B and I2 = 3 + 2 tr B + (tr(B)^2 - tr(B^2))/2, where B = b - I.
        let (half, two) = (real::<T>(0.5), real::<T>(2.0));
        let log_J = log_jacobian(F);
        let B = finger_minus_identity(F);
        let trace = B.trace();
        let second = (trace * trace - B.norm_squared()) * half;
        let first = trace - two * log_J;
        self.c1 * first + self.c2 * (two * first + second) + self.lambda * log_J * log_J * half
    }
}
