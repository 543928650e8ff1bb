//! The precisions in which programs are evaluated.

use crate::Function;
use mmsmith_scalar_functions::ScalarFunctions;
use num_traits::Float;

/// A precision in which programs are evaluated: `f32` or `f64`.
pub trait Scalar: Float + ScalarFunctions {
    /// The nearest value of this type.
    fn rounded(value: f64) -> Self;
    /// The value of a function of one argument; not a number for functions that have operations of their own.
    #[must_use]
    fn call(function: Function, x: Self) -> Self;
}

impl Scalar for f64 {
    fn rounded(value: f64) -> Self {
        value
    }

    fn call(function: Function, x: Self) -> Self {
        function.double(x)
    }
}

impl Scalar for f32 {
    fn rounded(value: f64) -> Self {
        value as f32
    }

    fn call(function: Function, x: Self) -> Self {
        function.single(x)
    }
}
