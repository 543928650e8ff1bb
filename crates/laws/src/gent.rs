//! Gent's law.

use mmsmith_lanes::tensor::real;
use nalgebra::RealField;

use super::Volumetric;
use super::isochoric::OfFirstInvariant;

/// Gent's law, `W = -mu Jm/2 ln(1 - (I1bar - 3)/Jm) + kappa U(J)`: A. N. Gent, "A new constitutive relation for rubber", Rubber
/// Chem. Technol. 69 (1996) 59-61.
///
/// Chains are stretched out where `I1bar - 3` reaches Jm: stress and energy are not numbers there and beyond. At small strain the
/// shear modulus is mu and the bulk modulus kappa.
#[derive(Clone, Copy)]
pub(crate) struct Gent<T> {
    pub(crate) mu: T,
    /// Jm.
    pub(crate) limit: T,
    pub(crate) kappa: T,
    pub(crate) volumetric: Volumetric,
}

impl<T: RealField + Copy> OfFirstInvariant for Gent<T> {
    type Scalar = T;

    #[inline(always)]
    fn slope(&self, excess: T) -> T {
        let left = self.limit - excess;
        let slope = self.mu * real(0.5) * (self.limit / left);
        if left > T::zero() { slope } else { real(f64::NAN) }
    }

    fn isochoric_energy(&self, excess: T) -> T {
        if excess >= self.limit {
            return real(f64::NAN);
        }
        -self.mu * self.limit * real(0.5) * (-excess / self.limit).ln_1p()
    }

    #[inline(always)]
    fn volume(&self) -> (T, Volumetric) {
        (self.kappa, self.volumetric)
    }
}
