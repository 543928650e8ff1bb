//! The St. Venant-Kirchhoff law.

use mmsmith_lanes::tensor::{product, real};
use nalgebra::{RealField, SMatrix};

use super::{LibraryLaw, green_twice, plus_diagonal, quadratic_energy};

/// The St. Venant-Kirchhoff law, `W = lambda/2 (tr E)^2 + mu E:E`.
#[derive(Clone, Copy)]
pub(crate) struct StVenantKirchhoff<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
}

impl<T: RealField + Copy> StVenantKirchhoff<T> {
    /// `lambda tr(E)`.
    fn pressure<const D: usize>(&self, E2: &SMatrix<T, D, D>) -> T {
        self.lambda * E2.trace() * real(0.5)
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for StVenantKirchhoff<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(&self.first_piola_kirchhoff(F), &F.transpose())
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let E2 = green_twice(F);
        product(F, &plus_diagonal(E2 * self.mu, self.pressure(&E2)))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        quadratic_energy(self.lambda, self.mu, &(green_twice(F) * real::<T>(0.5)))
    }
}
