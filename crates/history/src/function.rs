//! Derivatives of the functions that texts of laws may use.

use mmsmith_expr::Function;

use crate::number::Number;

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
