//! The scalars that generated code is generic over.

use mmsmith_scalar_functions::ScalarFunctions;
use nalgebra::RealField;

/// A floating-point scalar: `f32` or `f64`, with the functions that generated code needs and nalgebra lacks.
pub trait Real: RealField + Copy + ScalarFunctions {
    /// The nearest value of this type.
    fn nearest(value: f64) -> Self;
    /// The value in double precision; exact for both types.
    fn to_f64(self) -> f64;
    /// Whether this is a number, though it may be infinite.
    #[must_use]
    fn is_number(self) -> bool;
    /// The value of a function with a form for each precision, such as the functions of [`libm`](crate::libm).
    #[must_use]
    fn apply(self, double: fn(f64) -> f64, single: fn(f32) -> f32) -> Self;
}

impl Real for f64 {
    #[inline]
    fn nearest(value: f64) -> Self {
        value
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn is_number(self) -> bool {
        !self.is_nan()
    }

    #[inline]
    fn apply(self, double: fn(f64) -> f64, _: fn(f32) -> f32) -> Self {
        double(self)
    }
}

impl Real for f32 {
    #[inline]
    fn nearest(value: f64) -> Self {
        value as f32
    }

    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn is_number(self) -> bool {
        !self.is_nan()
    }

    #[inline]
    fn apply(self, _: fn(f64) -> f64, single: fn(f32) -> f32) -> Self {
        single(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_precision_has_its_own_form_of_a_function() {
        assert_eq!(27_f64.apply(libm::cbrt, |_| f32::NAN), 3.0);
        assert_eq!(27_f32.apply(|_| f64::NAN, libm::cbrtf), 3.0);
    }
}
