//! Rounding error of each operation of a program, in units of `2^-53` of its result.

use crate::CertifyError;
use mmsmith_expr::{Function, Operation, Program, Rational, nearest_f64};
use serde::{Deserialize, Serialize};

/// The relative errors that are assumed of functions, in units of `2^-53`: half a unit in the last place is one at most.
///
/// Sums, products, quotients and square roots are rounded once, and sums and products that are exact count as such.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Roundings {
    /// Error of a sum, a difference, a product, a quotient, a square root, and of a number that is not a double.
    pub arithmetic: f64,
    /// Error of pi: `|fl(pi) - pi|/(2^-53 pi)` is 0.351.
    pub pi: f64,
    /// Error of `sin(pi x)` and `cos(pi x)` in generated code, which are within one unit in the last place (2).
    pub trigonometric_pi: f64,
    /// Error of `sin(x)`, `cos(x)`, within one unit in the last place.
    pub trigonometric: f64,
    /// Error of `ln(1 + x)` in generated code, which is within one and a half units in the last place.
    pub logarithm: f64,
}

impl Default for Roundings {
    fn default() -> Self {
        Self {
            arithmetic: 1.0,
            pi: 0.36,
            trigonometric_pi: 2.2,
            trigonometric: 2.0,
            logarithm: 3.0,
        }
    }
}

/// Half of the distance from one to the next double.
pub(crate) const UNIT: f64 = f64::EPSILON / 2.0;

fn is_double(number: &Rational) -> bool {
    Rational::from_float(nearest_f64(number)).is_some_and(|double| double == *number)
}

fn is_power_of_two(operation: &Operation) -> bool {
    let Operation::Number(number) = operation else { return false };
    let value = nearest_f64(number);
    is_double(number) && value.is_normal() && value.to_bits().trailing_zeros() >= 52
}

impl Roundings {
    /// The error of each operation beyond the errors of its operands.
    pub(crate) fn of(&self, program: &Program) -> Result<Vec<f64>, CertifyError> {
        let operations = program.operations();
        let power = |slot: mmsmith_expr::Slot| is_power_of_two(&operations[slot.index()]);
        operations
            .iter()
            .map(|operation| {
                Ok(match operation {
                    Operation::Input(_) | Operation::Neg(_) => 0.0,
                    Operation::Number(number) if is_double(number) => 0.0,
                    Operation::Mul(a, b) if power(*a) || power(*b) => 0.0,
                    Operation::Div(_, b) if power(*b) => 0.0,
                    Operation::Number(_)
                    | Operation::Add(..)
                    | Operation::Sub(..)
                    | Operation::Mul(..)
                    | Operation::Div(..)
                    | Operation::Sqrt(_) => self.arithmetic,
                    Operation::Pi => self.pi,
                    Operation::SinPi(_) | Operation::CosPi(_) => self.trigonometric_pi,
                    Operation::Call(Function::Sin | Function::Cos, _) => self.trigonometric,
                    Operation::Call(Function::Ln1p, _) | Operation::LnOfBoth(..) => self.logarithm,
                    other => return Err(CertifyError::unsupported(other)),
                })
            })
            .collect()
    }
}
