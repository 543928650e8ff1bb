//! Arruda and Boyce's law.

use mmsmith_lanes::tensor::real;
use nalgebra::RealField;

use super::Volumetric;
use super::isochoric::OfFirstInvariant;

/// Numerators and denominators of the factors of `I1bar^i - 3^i`, from `i = 1` on.
const FACTORS: [(f64, f64); 5] =
    [(1.0, 2.0), (1.0, 20.0), (11.0, 1050.0), (19.0, 7000.0), (519.0, 673_750.0)];

/// Arruda and Boyce's law of chains along the diagonals of a cube, with five terms of the inverse Langevin function's series:
/// `W = mu sum_(i=1..5) C_i/N^(i-1) (I1bar^i - 3^i) + kappa U(J)`, `C = 1/2, 1/20, 11/1050, 19/7000, 519/673750`. E. M. Arruda &
/// M. C. Boyce, "A three-dimensional constitutive model for the large stretch behavior of rubber elastic materials", J. Mech.
/// Phys. Solids 41 (1993) 389-412, equation 30.
///
/// At small strain the bulk modulus is kappa and the shear modulus
/// `mu (1 + 3/(5 N) + 99/(175 N^2) + 513/(875 N^3) + 42039/(67375 N^4))`.
#[derive(Clone, Copy)]
pub(crate) struct ArrudaBoyce<T> {
    pub(crate) mu: T,
    /// N, rigid links of a chain: the square of its largest stretch.
    pub(crate) links: T,
    pub(crate) kappa: T,
    pub(crate) volumetric: Volumetric,
}

impl<T: RealField + Copy> OfFirstInvariant for ArrudaBoyce<T> {
    type Scalar = T;

    #[inline(always)]
    fn slope(&self, excess: T) -> T {
        // sum i C_i (I1bar/N)^(i-1), from the last term on.
        let ratio = (excess + real(3.0)) / self.links;
        let mut sum = T::zero();
        for (i, (numerator, denominator)) in FACTORS.iter().enumerate().rev() {
            sum = sum * ratio + real((i + 1) as f64 * numerator / denominator);
        }
        self.mu * sum
    }

    fn isochoric_energy(&self, excess: T) -> T {
        // I^(i+1) - 3^(i+1) = I (I^i - 3^i) + 3^i (I - 3), where nothing cancels; all of it over N^(i-1).
        let three = real::<T>(3.0);
        let first = excess + three;
        let (mut difference, mut power, mut sum) = (excess, T::one(), T::zero());
        for (numerator, denominator) in FACTORS {
            sum += difference * real(numerator / denominator);
            power *= three / self.links;
            difference = difference * first / self.links + power * excess;
        }
        self.mu * sum
    }

    #[inline(always)]
    fn volume(&self) -> (T, Volumetric) {
        (self.kappa, self.volumetric)
    }
}
