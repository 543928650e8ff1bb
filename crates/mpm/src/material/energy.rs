//! Strain energies.

use nalgebra::{RealField, SMatrix};

use super::{
    Hencky, Law, Material, displacement_gradient, finger_minus_identity, green_twice, jacobian,
    log_jacobian, plus_diagonal,
};
use crate::tensor::real;

impl<T: RealField + Copy> Material<T> {
    /// Strain energy per reference volume; zero where F is the identity, and `None` where it is no deformation.
    ///
    /// At small strain `H = F - I` it is of second order, and rounded to about `eps/|H|` of itself.
    pub fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        jacobian(F)?;
        let (half, two) = (real::<T>(0.5), real::<T>(2.0));
        let quadratic = |lambda: T, mu: T, strain: SMatrix<T, D, D>| {
            let trace = strain.trace();
            lambda * trace * trace * half + mu * strain.norm_squared()
        };
        Some(match *self {
            Self::NeoHookean { lambda, mu } => {
                let log_J = log_jacobian(F);
                let trace = finger_minus_identity(F).trace();
                lambda * log_J * log_J * half + mu * half * (trace - two * log_J)
            }
            Self::StVenantKirchhoff { lambda, mu } => quadratic(lambda, mu, green_twice(F) * half),
            Self::Hencky { lambda, mu } => {
                // The law gives tau = lambda ln(J) I + 2 mu ln(V), and so the logarithm of V.
                let tau = Hencky { lambda, mu }.kirchhoff(F);
                let log_V = plus_diagonal(tau, -lambda * log_jacobian(F)) / (two * mu);
                quadratic(lambda, mu, log_V)
            }
            Self::MooneyRivlin { c1, c2, lambda } => {
                // I1 = 3 + tr B and I2 = 3 + 2 tr B + (tr(B)^2 - tr(B^2))/2, where B = b - I.
                let log_J = log_jacobian(F);
                let B = finger_minus_identity(F);
                let trace = B.trace();
                let second = (trace * trace - B.norm_squared()) * half;
                let first = trace - two * log_J;
                c1 * first + c2 * (two * first + second) + lambda * log_J * log_J * half
            }
            Self::LinearElastic { lambda, mu } => {
                let H = displacement_gradient(F);
                quadratic(lambda, mu, (H + H.transpose()) * half)
            }
        })
    }
}
