//! Energies of a change of volume.

use mmsmith_lanes::tensor::{det_minus_one, determinant, real};
use nalgebra::{RealField, SMatrix};

use super::{Volumetric, displacement_gradient, log_jacobian};

/// The volumetric energies as the solver computes them.
pub(crate) trait VolumetricEnergy: Copy {
    /// `J U'(J)`, which is of first order in `J - 1` and keeps its digits.
    fn pressure<T: RealField + Copy, const D: usize>(self, F: &SMatrix<T, D, D>) -> T;

    /// `U(J)`.
    fn energy<T: RealField + Copy, const D: usize>(self, F: &SMatrix<T, D, D>) -> T;
}

impl VolumetricEnergy for Volumetric {
    #[inline(always)]
    fn pressure<T: RealField + Copy, const D: usize>(self, F: &SMatrix<T, D, D>) -> T {
        let growth = det_minus_one(&displacement_gradient(F));
        match self {
            Self::Logarithmic => log_jacobian(F),
            Self::Quadratic => determinant(F) * growth,
            Self::Mixed => growth * (growth + real(2.0)) * real(0.5),
        }
    }

    fn energy<T: RealField + Copy, const D: usize>(self, F: &SMatrix<T, D, D>) -> T {
        let growth = det_minus_one(&displacement_gradient(F));
        match self {
            Self::Logarithmic => log_jacobian(F) * log_jacobian(F) * real(0.5),
            Self::Quadratic => growth * growth * real(0.5),
            // J^2 - 1 = g^2 + 2 g, where g = J - 1.
            Self::Mixed => {
                (growth * growth + excess_over_logarithm(growth, log_jacobian(F)) * real(2.0))
                    * real(0.25)
            }
        }
    }
}

/// `g - ln(1 + g)`, of second order in `g`, from both.
///
/// With `t = g/(2 + g)` the logarithm is `2 artanh(t)`, and `g - 2 t = t g`: next to one only `t g - 2 (t^3/3 + t^5/5 + ...)`
/// keeps the digits.
fn excess_over_logarithm<T: RealField + Copy>(growth: T, logarithm: T) -> T {
    /// As far as eleven terms leave out less than a rounding of the sum.
    const LARGEST_IN_SERIES: f64 = 0.25;
    if growth.abs() > real(LARGEST_IN_SERIES) {
        return growth - logarithm;
    }
    let t = growth / (growth + real(2.0));
    let square = t * t;
    let sum = (1..12)
        .rev()
        .fold(T::zero(), |sum, k| sum * square + T::one() / real(f64::from(2 * k + 1)));
    t * (growth - t * t * sum * real(2.0))
}
