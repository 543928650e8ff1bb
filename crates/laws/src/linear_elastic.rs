//! Linear elasticity.

use mmsmith_lanes::tensor::{product, real};
use nalgebra::{RealField, SMatrix};

use super::{LibraryLaw, displacement_gradient, plus_diagonal, quadratic_energy};

/// Linear elasticity, `W = lambda/2 (tr e)^2 + mu e:e` with `e = (H + H^T)/2`.
#[derive(Clone, Copy)]
pub(crate) struct LinearElastic<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
}

impl<T: RealField + Copy> LibraryLaw<T> for LinearElastic<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(&self.first_piola_kirchhoff(F), &F.transpose())
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let H = displacement_gradient(F);
        plus_diagonal((H + H.transpose()) * self.mu, self.lambda * H.trace())
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let H = displacement_gradient(F);
        quadratic_energy(self.lambda, self.mu, &((H + H.transpose()) * real::<T>(0.5)))
    }
}
