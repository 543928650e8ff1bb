//! Hencky's law.

use mmsmith_lanes::tensor::{determinant, inverse_transpose, product, real};
use nalgebra::{RealField, SMatrix};

use super::principal::coaxial_in_space;
use super::{LibraryLaw, finger_minus_identity, log_jacobian, plus_diagonal, quadratic_energy};

/// Hencky's law, `W = lambda/2 (ln J)^2 + mu |ln V|^2`.
#[derive(Clone, Copy)]
pub(crate) struct Hencky<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
}

impl<T: RealField + Copy> Hencky<T> {
    /// `lambda ln J`.
    fn pressure<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        self.lambda * log_jacobian(F)
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for Hencky<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let two_log_V = match D {
            1 => SMatrix::repeat(log_jacobian(F) * real(2.0)),
            2 => two_log_stretch_in_the_plane(F),
            _ => coaxial_in_space(F, |logarithms| logarithms),
        };
        plus_diagonal(two_log_V * self.mu, self.pressure(F))
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(&self.kirchhoff(F), &inverse_transpose(F, determinant(F)))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        // The law gives tau = lambda ln(J) I + 2 mu ln(V), and so the logarithm of V.
        let tau = self.kirchhoff(F);
        let log_V = plus_diagonal(tau, -self.pressure(F)) / (self.mu * real(2.0));
        quadratic_energy(self.lambda, self.mu, &log_V)
    }
}

/// `2 ln V` in two dimensions.
///
/// The eigenvalues of `b / J` are `exp(theta)` and its inverse, so `2 ln V = ln(J) I + theta/sinh(theta) dev(b)/J`,
/// and `cosh(theta) - 1 = (tr(b) - 2 J) / (2 J)` is a sum of squares over `2 J`.
fn two_log_stretch_in_the_plane<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    let J = determinant(F);
    let (stretch, shear) = (F[(0, 0)] - F[(1, 1)], F[(0, 1)] + F[(1, 0)]);
    let z = (stretch * stretch + shear * shear) / (J * real(2.0));
    let sinh = (z * (z + real(2.0))).sqrt();
    let factor = if sinh == T::zero() { T::one() } else { (z + sinh).ln_1p() / sinh };
    let B = finger_minus_identity(F);
    let deviator = plus_diagonal(B, -B.trace() * real(0.5));
    plus_diagonal(deviator * (factor / J), log_jacobian(F))
}
