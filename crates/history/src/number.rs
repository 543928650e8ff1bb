//! Numbers that rates are computed with: doubles, and dual numbers over them.

use std::ops::{Add, Div, Mul, Neg, Sub};

use mmsmith_expr::{Function, Scalar};
use mmsmith_scalar_functions::ScalarFunctions;

/// A number with the operations that rates and stresses of laws need.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A number that depends on nothing.
    fn constant(value: f64) -> Self;
    /// The value, without slopes.
    fn value(self) -> f64;
    /// The square root.
    fn sqrt(self) -> Self;
    /// The natural logarithm.
    fn ln(self) -> Self;
    /// The exponential function.
    fn exp(self) -> Self;
    /// A power with a constant exponent.
    fn powf(self, exponent: f64) -> Self;
    /// A multiple.
    fn times(self, factor: f64) -> Self;
    /// Whether a slope is not zero.
    fn has_slopes(self) -> bool;
    /// A function of one argument of the language of formulas; not a number for others.
    fn call(self, function: Function) -> Self;
}

impl Number for f64 {
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline]
    fn value(self) -> f64 {
        self
    }

    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn ln(self) -> Self {
        self.logarithm()
    }

    #[inline]
    fn exp(self) -> Self {
        self.exponential()
    }

    #[inline]
    fn powf(self, exponent: f64) -> Self {
        self.power(exponent)
    }

    #[inline]
    fn times(self, factor: f64) -> Self {
        self * factor
    }

    fn has_slopes(self) -> bool {
        false
    }

    fn call(self, function: Function) -> Self {
        Scalar::call(function, self)
    }
}

/// A number of type `N` with its slopes in `K` directions (forward mode; A. Griewank and A. Walther, "Evaluating Derivatives", 2nd ed.,
/// chapter 3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<N, const K: usize> {
    /// The number.
    pub value: N,
    /// Its slopes.
    pub slopes: [N; K],
}

impl<N: Number, const K: usize> Dual<N, K> {
    /// This number where a function has the value `value` and the slope `slope`.
    #[inline]
    fn of(self, value: N, slope: N) -> Self {
        Self { value, slopes: self.slopes.map(|own| own * slope) }
    }

    #[inline]
    fn with(self, other: Self, value: N, slope: impl Fn(N, N) -> N) -> Self {
        let slopes = std::array::from_fn(|k| slope(self.slopes[k], other.slopes[k]));
        Self { value, slopes }
    }
}

impl<N: Number, const K: usize> Add for Dual<N, K> {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        self.with(other, self.value + other.value, |a, b| a + b)
    }
}

impl<N: Number, const K: usize> Sub for Dual<N, K> {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self.with(other, self.value - other.value, |a, b| a - b)
    }
}

// Slopes of products are sums.
#[allow(clippy::suspicious_arithmetic_impl)]
impl<N: Number, const K: usize> Mul for Dual<N, K> {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        let (x, y) = (self.value, other.value);
        self.with(other, x * y, |a, b| a * y + x * b)
    }
}

#[allow(clippy::suspicious_arithmetic_impl)]
impl<N: Number, const K: usize> Div for Dual<N, K> {
    type Output = Self;

    #[inline]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        self.with(other, quotient, |a, b| (a - quotient * b) / other.value)
    }
}

impl<N: Number, const K: usize> Neg for Dual<N, K> {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, slopes: self.slopes.map(|slope| -slope) }
    }
}

impl<N: Number, const K: usize> Number for Dual<N, K> {
    #[inline]
    fn constant(value: f64) -> Self {
        Self { value: N::constant(value), slopes: [N::constant(0.0); K] }
    }

    #[inline]
    fn value(self) -> f64 {
        self.value.value()
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.of(root, N::constant(0.5) / root)
    }

    #[inline]
    fn ln(self) -> Self {
        self.of(self.value.ln(), N::constant(1.0) / self.value)
    }

    #[inline]
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.of(value, value)
    }

    #[inline]
    fn powf(self, exponent: f64) -> Self {
        // At zero the value tells nothing of the slope.
        let slope = self.value.powf(exponent - 1.0).times(exponent);
        self.of(self.value.powf(exponent), slope)
    }

    #[inline]
    fn times(self, factor: f64) -> Self {
        Self {
            value: self.value.times(factor),
            slopes: self.slopes.map(|slope| slope.times(factor)),
        }
    }

    fn has_slopes(self) -> bool {
        self.value.has_slopes()
            || self.slopes.iter().any(|slope| slope.value() != 0.0 || slope.has_slopes())
    }

    fn call(self, function: Function) -> Self {
        let value = self.value.call(function);
        self.of(value, derivative(function, self.value, value))
    }
}

/// A power of a number that is not negative; zero, and less, has none, and no slopes.
#[inline]
pub(crate) fn power<N: Number>(x: N, exponent: N) -> N {
    if exponent.has_slopes() {
        return if x.value() <= 0.0 { N::constant(0.0) } else { (x.ln() * exponent).exp() };
    }
    match exponent.value() {
        0.0 => N::constant(1.0),
        1.0 => x,
        2.0 => x * x,
        3.0 => x * x * x,
        _ if x.value() <= 0.0 => N::constant(0.0),
        exponent => x.powf(exponent),
    }
}

/// Whether the slopes of a function of one argument can be formed, and slopes of slopes where `twice`.
pub(crate) fn has_derivative(function: Function, twice: bool) -> bool {
    match function {
        Function::LogRatioCurvature | Function::CoshSqrtM1Curvature => false,
        Function::LogRatioSlope | Function::CoshSqrtM1Slope => !twice,
        // It is constant but for a jump.
        Function::PositivePartSlope => false,
        Function::PositivePart => true,
        function => function.arity() == 1,
    }
}

/// The derivative of a function of one argument at `x`, where it is `value`; not a number where it has none in terms of the functions that
/// there are.
pub(crate) fn derivative<N: Number>(function: Function, x: N, value: N) -> N {
    let number = N::constant;
    match function {
        Function::Sin => x.call(Function::Cos),
        Function::Cos => -x.call(Function::Sin),
        Function::Tan => number(1.0) + value * value,
        // The factors of 1 - x^2 are exact next to one.
        Function::Asin => number(1.0) / ((number(1.0) - x) * (number(1.0) + x)).sqrt(),
        Function::Acos => number(-1.0) / ((number(1.0) - x) * (number(1.0) + x)).sqrt(),
        Function::Atan => number(1.0) / (number(1.0) + x * x),
        Function::Sinh => x.call(Function::Cosh),
        Function::Cosh => x.call(Function::Sinh),
        Function::Tanh => {
            let cosine = x.call(Function::Cosh);
            number(1.0) / (cosine * cosine)
        }
        Function::Exp => value,
        Function::Expm1 => x.exp(),
        Function::Ln => number(1.0) / x,
        Function::Ln1p => number(1.0) / (number(1.0) + x),
        Function::Ln1pMinusX => -x / (number(1.0) + x),
        Function::Erf => (-(x * x)).exp().times(std::f64::consts::FRAC_2_SQRT_PI),
        Function::LogRatioSquared => (number(1.0) + x.call(Function::LogRatioSlope)).times(2.0),
        Function::LogRatioSlope => x.call(Function::LogRatioCurvature),
        Function::CoshSqrtM1 => (number(1.0) + x.call(Function::CoshSqrtM1Slope)).times(0.5),
        Function::CoshSqrtM1Slope => x.call(Function::CoshSqrtM1Curvature),
        Function::PositivePart => x.call(Function::PositivePartSlope),
        Function::PositivePartSlope => number(0.0),
        Function::LogRatioCurvature
        | Function::CoshSqrtM1Curvature
        | Function::Atan2
        | Function::LnOfBoth => number(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slopes, and slopes of slopes, against differences.
    #[test]
    fn slopes_are_those_of_the_functions() {
        fn f<N: Number>(x: N, y: N) -> N {
            (x * y + x.sqrt()).ln() - (y / x).exp() * x.powf(1.3) - -y.times(3.0)
        }
        let (x, y, h) = (1.3, 0.7, 1e-5);
        let dual = |value: f64, slopes: [f64; 2]| Dual { value, slopes };
        let found = f(dual(x, [1.0, 0.0]), dual(y, [0.0, 1.0]));
        let of_x = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let of_y = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert!((found.slopes[0] - of_x).abs() < 1e-9 && (found.slopes[1] - of_y).abs() < 1e-9);
        assert_eq!(found.value, f(x, y));
        // The slope along x of the slope along y.
        let nested = |value: f64, inner: f64, outer: f64| Dual {
            value: Dual { value, slopes: [inner] },
            slopes: [Dual { value: outer, slopes: [0.0] }],
        };
        let mixed = f(nested(x, 1.0, 0.0), nested(y, 0.0, 1.0)).slopes[0].slopes[0];
        let slope_y = |x: f64| f(dual(x, [0.0; 2]), dual(y, [0.0, 1.0])).slopes[1];
        assert!((mixed - (slope_y(x + h) - slope_y(x - h)) / (2.0 * h)).abs() < 1e-9);
    }
}
