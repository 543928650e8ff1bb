//! Laws of materials with memory: rates of internal variables, and stresses.

use crate::number::Number;
use crate::tensor::Tensor;

/// The deformation gradient at a particle and its rate.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<N> {
    /// The deformation gradient; out of the plane the identity.
    pub F: Tensor<N>,
    /// Its rate, one over a time.
    pub rate: Tensor<N>,
}

/// An internal variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its value in a body that has not been deformed.
    pub initial: f64,
}

/// The set of rate equations that a particle follows for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// The stress is below the yield stress, or becomes smaller: internal variables stay.
    Elastic,
    /// Internal variables have rates.
    Flowing,
}

/// A law of a material with memory. Its functions are generic over the numbers, so that slopes along positions come by dual numbers.
pub trait LawWithHistory: Sync {
    /// The internal variables, in their order.
    fn variables(&self) -> Vec<Variable>;

    /// Writes the rates of the internal variables `z` on a branch.
    fn rate<N: Number>(&self, at: &Kinematics<N>, z: &[N], branch: Branch, rates: &mut [N]);

    /// The first Piola-Kirchhoff stress.
    fn first_piola_kirchhoff<N: Number>(&self, at: &Kinematics<N>, z: &[N]) -> Tensor<N>;

    /// The branch on which a particle begins. Default: it flows, and always does.
    fn first_branch(&self, _at: &Kinematics<f64>, _z: &[f64]) -> Branch {
        Branch::Flowing
    }

    /// A number that is positive as long as a branch lasts: on the elastic one the share of the yield stress that is left, on the flowing
    /// one the rate at which the stress would grow, as a share of the rate of deformation. Default: it lasts.
    fn margin<N: Number>(&self, _at: &Kinematics<N>, _z: &[N], _branch: Branch) -> N {
        N::constant(1.0)
    }
}
