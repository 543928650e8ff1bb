//! The neo-Hookean law.

use nalgebra::{RealField, SMatrix};

use super::{Law, displacement_gradient, finger_minus_identity, log_jacobian, plus_diagonal};
use crate::tensor::inverse_transpose_minus_identity;

/// The neo-Hookean law, `W = mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2`.
#[derive(Clone, Copy)]
pub(crate) struct NeoHookean<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
}

impl<T: RealField + Copy> Law<T> for NeoHookean<T> {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        plus_diagonal(finger_minus_identity(F) * self.mu, self.lambda * log_jacobian(F))
    }

    fn kirchhoff_across<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        self.lambda * log_jacobian(F)
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        let K = inverse_transpose_minus_identity(F);
        let pressure = self.lambda * log_jacobian(F);
        plus_diagonal((H - K) * self.mu + K * pressure, pressure)
    }
}

/// The neo-Hookean law with lambda = 0.
#[derive(Clone, Copy)]
pub(crate) struct NeoHookeanNoLog<T> {
    pub(crate) mu: T,
}

impl<T: RealField + Copy> Law<T> for NeoHookeanNoLog<T> {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        finger_minus_identity(F) * self.mu
    }

    fn kirchhoff_across<const D: usize>(&self, _F: &SMatrix<T, D, D>) -> T {
        T::zero()
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        (H - inverse_transpose_minus_identity(F)) * self.mu
    }
}
