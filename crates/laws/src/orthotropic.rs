//! The St. Venant-Kirchhoff law with orthotropic moduli.

use mmsmith_lanes::tensor::{product, real};
use nalgebra::{RealField, SMatrix};

use super::{LibraryLaw, green_twice};

/// The orthotropic St. Venant-Kirchhoff law, `W = E:C:E/2`, `P = F S`, `S = C:E`, `E = (F^T F - I)/2`, with the planes of symmetry
/// along the axes. The moduli are those of Voigt's notation, 4, 5 and 6 the shears 23, 13 and 12: `S12 = 2 c66 E12`. T. C. T. Ting,
/// "Anisotropic Elasticity" (1996), section 2.4; Holzapfel, "Nonlinear Solid Mechanics" (2000), section 6.5.
#[derive(Clone, Copy)]
pub(crate) struct Orthotropic<T> {
    pub(crate) c11: T,
    pub(crate) c22: T,
    pub(crate) c33: T,
    pub(crate) c12: T,
    pub(crate) c13: T,
    pub(crate) c23: T,
    pub(crate) c44: T,
    pub(crate) c55: T,
    pub(crate) c66: T,
}

impl<T: RealField + Copy> Orthotropic<T> {
    /// The modulus that takes the normal strain along an axis to the normal stress along another.
    #[inline(always)]
    fn normal(&self, i: usize, j: usize) -> T {
        match (i.min(j), i.max(j)) {
            (0, 0) => self.c11,
            (1, 1) => self.c22,
            (0, 1) => self.c12,
            (0, _) => self.c13,
            (1, _) => self.c23,
            _ => self.c33,
        }
    }

    /// The modulus of shear between two axes.
    #[inline(always)]
    fn shear(&self, i: usize, j: usize) -> T {
        match i + j {
            1 => self.c66,
            2 => self.c55,
            _ => self.c44,
        }
    }

    /// The normal stress `S_ii` for `2 E`.
    #[inline(always)]
    fn normal_stress<const D: usize>(&self, E2: &SMatrix<T, D, D>, i: usize) -> T {
        let mut sum = self.normal(i, 0) * E2[(0, 0)];
        for j in 1..D {
            sum += self.normal(i, j) * E2[(j, j)];
        }
        sum * real(0.5)
    }

    /// Second Piola-Kirchhoff stress for `2 E`.
    #[inline(always)]
    fn second_piola_kirchhoff<const D: usize>(&self, E2: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        SMatrix::from_fn(|i, j| match i == j {
            true => self.normal_stress(E2, i),
            false => self.shear(i, j) * E2[(i, j)],
        })
    }
}

impl<T: RealField + Copy> LibraryLaw<T> for Orthotropic<T> {
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(&self.first_piola_kirchhoff(F), &F.transpose())
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        product(F, &self.second_piola_kirchhoff(&green_twice(F)))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        let E2 = green_twice(F);
        self.second_piola_kirchhoff(&E2).dot(&E2) * real(0.25)
    }
}
