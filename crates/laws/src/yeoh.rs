//! Yeoh's law.

use mmsmith_lanes::tensor::real;
use nalgebra::RealField;

use super::Volumetric;
use super::isochoric::OfFirstInvariant;

/// Yeoh's law, `W = c1 (I1bar - 3) + c2 (I1bar - 3)^2 + c3 (I1bar - 3)^3 + kappa U(J)`: O. H. Yeoh, "Some forms of the strain
/// energy function for rubber", Rubber Chem. Technol. 66 (1993) 754-771.
///
/// At small strain its shear modulus is `2 c1` and its bulk modulus kappa.
#[derive(Clone, Copy)]
pub(crate) struct Yeoh<T> {
    pub(crate) c1: T,
    pub(crate) c2: T,
    pub(crate) c3: T,
    pub(crate) kappa: T,
    pub(crate) volumetric: Volumetric,
}

impl<T: RealField + Copy> OfFirstInvariant for Yeoh<T> {
    type Scalar = T;

    #[inline(always)]
    fn slope(&self, excess: T) -> T {
        self.c1 + excess * (self.c2 * real(2.0) + excess * (self.c3 * real(3.0)))
    }

    fn isochoric_energy(&self, excess: T) -> T {
        excess * (self.c1 + excess * (self.c2 + excess * self.c3))
    }

    #[inline(always)]
    fn volume(&self) -> (T, Volumetric) {
        (self.kappa, self.volumetric)
    }
}
