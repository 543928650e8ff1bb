//! Derivatives of the functions of one number, as operations of a tape.

use crate::function::Function;
use crate::tape::{Tape, Value};

impl Function {
    /// The derivative at `x`, where the function is `value`.
    pub(crate) fn slope(self, tape: &mut Tape, x: Value, value: Value) -> Value {
        let one_and = |tape: &mut Tape, factor, x| tape.sum(&[(1.0, Value::ONE), (factor, x)]);
        match self {
            Self::Sin => tape.call(Self::Cos, x),
            Self::Cos => {
                let sine = tape.call(Self::Sin, x);
                tape.sum(&[(-1.0, sine)])
            }
            Self::Tan => {
                let square = tape.product(value, value);
                one_and(tape, 1.0, square)
            }
            Self::Asin | Self::Acos => {
                // The factors of 1 - x^2 are exact next to one.
                let (below, above) = (one_and(tape, -1.0, x), one_and(tape, 1.0, x));
                let product = tape.product(below, above);
                let root = tape.call(Self::Sqrt, product);
                let slope = tape.reciprocal(root);
                tape.sum(&[(if self == Self::Asin { 1.0 } else { -1.0 }, slope)])
            }
            Self::Atan => {
                let square = tape.product(x, x);
                let sum = one_and(tape, 1.0, square);
                tape.reciprocal(sum)
            }
            Self::Sinh => tape.call(Self::Cosh, x),
            Self::Cosh => tape.call(Self::Sinh, x),
            Self::Tanh => {
                // 1 - tanh^2 has no digits left where the tangent is next to one.
                let cosine = tape.call(Self::Cosh, x);
                let reciprocal = tape.reciprocal(cosine);
                tape.product(reciprocal, reciprocal)
            }
            Self::Exp => value,
            Self::Ln => tape.reciprocal(x),
            Self::Sqrt => {
                let reciprocal = tape.reciprocal(value);
                tape.sum(&[(0.5, reciprocal)])
            }
            Self::Erf => {
                let square = tape.product(x, x);
                let exponent = tape.sum(&[(-1.0, square)]);
                let bell = tape.call(Self::Exp, exponent);
                tape.sum(&[(std::f64::consts::FRAC_2_SQRT_PI, bell)])
            }
            Self::LogRatioSquared => {
                let slope = tape.call(Self::LogRatioSlope, x);
                tape.sum(&[(2.0, Value::ONE), (2.0, slope)])
            }
            Self::LogRatioSlope => tape.call(Self::LogRatioCurvature, x),
            Self::PositivePart => tape.call(Self::PositivePartSlope, x),
            // Where it is none, at x = 0, the law has a kink.
            Self::PositivePartSlope => Value::constant(0.0),
            Self::LogRatioCurvature => {
                // From z (z + 2) s' = 1 - (1 + z)(1 + s) for the slope s, differentiated once more.
                let slope = tape.call(Self::LogRatioSlope, x);
                let ratio = one_and(tape, 1.0, x);
                let product = tape.product(ratio, value);
                let numerator = tape.sum(&[(-1.0, Value::ONE), (-1.0, slope), (-3.0, product)]);
                let sum = tape.sum(&[(2.0, Value::ONE), (1.0, x)]);
                let denominator = tape.product(x, sum);
                let reciprocal = tape.reciprocal(denominator);
                tape.product(numerator, reciprocal)
            }
        }
    }
}
