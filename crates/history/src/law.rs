//! Laws of materials with memory: rates of internal variables, and stresses.

use mmsmith_vocabulary::Smoothness;

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

/// The set of rate equations that a particle follows for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// The stress is below the yield stress, or becomes smaller: internal variables stay.
    Elastic,
    /// Internal variables have rates.
    Flowing,
}

/// For each variable its kind: components of one tensor, as `q11` and `q12`, are of one, and each other variable has a size and a unit of its own.
#[must_use]
pub fn kinds_of(variables: &[String]) -> Vec<usize> {
    let mut stems: Vec<&str> = Vec::new();
    let mut kinds = Vec::with_capacity(variables.len());
    for name in variables {
        let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let stem = if name.len() == letters.len() + 2 { letters } else { name };
        let known = stems.iter().position(|known| *known == stem);
        kinds.push(known.unwrap_or(stems.len()));
        if known.is_none() {
            stems.push(stem);
        }
    }
    kinds
}

/// By how much the variables of a particle miss conditions that exact ones keep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// `|f|` over the yield stress of the virgin material, while the particle flows without regard to the rate.
    pub yield_condition: f64,
    /// `|det G - 1|`: flow keeps the volume.
    pub volume: f64,
}

impl Residuals {
    /// The larger of both, each.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            yield_condition: self.yield_condition.max(other.yield_condition),
            volume: self.volume.max(other.volume),
        }
    }
}

/// A law of a material with memory. It holds no numbers: each call has the values of its [constants](Self::constants), which may depend on
/// the position. Functions are generic over the numbers, so that slopes along positions come by dual numbers.
pub trait LawWithHistory: Sync {
    /// The names of the constants, in their order.
    fn constants(&self) -> Vec<String>;

    /// Whether constants change with time. Default: they do not, and are asked for once.
    fn constants_change(&self) -> bool {
        false
    }

    /// The names of the variables that are integrated, in their order.
    fn variables(&self) -> Vec<String>;

    /// For each variable the group of those whose values are of one size and unit, as entries of a tensor are: errors of the integrator are
    /// relative to the largest value of the group. Default: all are of one.
    fn groups(&self) -> Vec<usize> {
        vec![0; self.variables().len()]
    }

    /// The values of the variables at the time zero, where the body has not moved. `frame[i][a]` is the Cartesian component i of the unit
    /// vector a of the frame whose components kinematics and variables have.
    fn initial<N: Number>(&self, constants: &[N], frame: &Tensor<f64>) -> Vec<N>;

    /// Writes the rates of the variables `z` on a branch.
    fn rate<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
        branch: Branch,
        rates: &mut [N],
    );

    /// The first Piola-Kirchhoff stress.
    fn first_piola_kirchhoff<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N>;

    /// Whether the law has branches. Default: particles flow, and always do.
    fn has_branches(&self) -> bool {
        false
    }

    /// The branch on which a particle begins. Default: it flows.
    fn first_branch(&self, _at: &Kinematics<f64>, _constants: &[f64], _z: &[f64]) -> Branch {
        Branch::Flowing
    }

    /// The share of the variables' size that stresses depend on, such as the elastic part of a strain: errors of the integrator are held
    /// against it. Default: all.
    fn resolution(&self, _constants: &[f64]) -> f64 {
        1.0
    }

    /// The share of the yield stress by which a start is beyond it. Default: there is none.
    fn excess(&self, _at: &Kinematics<f64>, _constants: &[f64], _z: &[f64]) -> f64 {
        0.0
    }

    /// A number that is positive as long as a branch lasts: on the elastic one the share of the yield stress that is left, on the flowing
    /// one the rate at which the stress would grow, as a share of the rate of deformation, or where flow depends on its rate the stress
    /// beyond the yield stress. Default: it lasts.
    fn margin<N: Number>(
        &self,
        _at: &Kinematics<N>,
        _constants: &[N],
        _z: &[N],
        _branch: Branch,
    ) -> N {
        N::constant(1.0)
    }

    /// The time in which the stress on which flow depends falls to a half at its rate, or grows to twice its size. Next to a zero rates are
    /// not smooth, which estimates of errors do not see, so that steps of the integrator are no longer. Default: it never does.
    fn halving_time(
        &self,
        _at: &Kinematics<f64>,
        _constants: &[f64],
        _z: &[f64],
        _rates: &[f64],
    ) -> f64 {
        f64::INFINITY
    }

    /// How smooth the body force is where a branch begins. Default: smooth.
    fn smoothness(&self, _constants: &[f64], _z: &[f64], _begins: Branch) -> Smoothness {
        Smoothness::Smooth
    }

    /// By how much variables miss conditions that exact ones keep. Default: there are none.
    fn residuals(
        &self,
        _at: &Kinematics<f64>,
        _constants: &[f64],
        _z: &[f64],
        _branch: Branch,
    ) -> Residuals {
        Residuals::default()
    }

    /// The names of the variables as the solver's law has them. Default: as they are integrated.
    fn observable_names(&self) -> Vec<String> {
        self.variables()
    }

    /// The values of the variables as the solver's law has them. Default: as they are integrated.
    fn observables<N: Number>(&self, _constants: &[N], z: &[N]) -> Vec<N> {
        z.to_vec()
    }
}
