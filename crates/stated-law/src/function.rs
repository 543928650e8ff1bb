//! The functions of one number that laws may use: their values, and their deviations from the value at rest without the
//! difference.

use mmsmith_scalar_functions::ScalarFunctions;

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Ln,
    Sqrt,
    Erf,
    /// `arcosh(1 + z)^2`.
    LogRatioSquared,
    /// Half its slope less one.
    LogRatioSlope,
    /// The slope of the latter.
    LogRatioCurvature,
    /// `max(x, 0)`.
    PositivePart,
    /// Its slope: one where `x > 0`, else zero.
    PositivePartSlope,
}

/// A number by its value at rest, its deviation from there, and its value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    pub(crate) rest: f64,
    pub(crate) deviation: f64,
    pub(crate) value: f64,
}

impl Function {
    pub(crate) fn value(self, x: f64) -> f64 {
        match self {
            Self::Sin => x.sine(),
            Self::Cos => x.cosine(),
            Self::Tan => libm::tan(x),
            Self::Asin => libm::asin(x),
            Self::Acos => libm::acos(x),
            Self::Atan => libm::atan(x),
            Self::Sinh => libm::sinh(x),
            Self::Cosh => libm::cosh(x),
            Self::Tanh => libm::tanh(x),
            Self::Exp => x.exponential(),
            Self::Ln => (x - 1.0).ln_of_both(x),
            Self::Sqrt => x.sqrt(),
            Self::Erf => libm::erf(x),
            Self::LogRatioSquared => x.log_ratio_squared(),
            Self::LogRatioSlope => x.log_ratio_slope(),
            Self::LogRatioCurvature => x.log_ratio_curvature(),
            Self::PositivePart => x.positive_part(),
            Self::PositivePartSlope => x.positive_part_slope(),
        }
    }

    /// `f(r + d) - f(r)`, where `f(r)` is a finite number.
    pub(crate) fn deviation(self, x: Parts) -> f64 {
        let Parts { rest: r, deviation: d, value: v } = x;
        if r == 0.0 && !matches!(self, Self::Cos | Self::Acos | Self::Cosh | Self::Exp) {
            // f(0) = 0, or the third of a curvature, which no law adds up.
            let at_rest = if self == Self::LogRatioCurvature { self.value(0.0) } else { 0.0 };
            return self.value(d) - at_rest;
        }
        match self {
            Self::Sin => 2.0 * (r + 0.5 * d).cosine() * (0.5 * d).sine(),
            Self::Cos => -2.0 * (r + 0.5 * d).sine() * (0.5 * d).sine(),
            Self::Tan => d.sine() / (r.cosine() * v.cosine()),
            Self::Asin => arcsine(x),
            Self::Acos => -arcsine(x),
            Self::Atan if 1.0 + v * r > 0.0 => libm::atan(d / (1.0 + v * r)),
            Self::Atan => libm::atan(v) - libm::atan(r),
            Self::Sinh => 2.0 * libm::cosh(r + 0.5 * d) * libm::sinh(0.5 * d),
            Self::Cosh => 2.0 * libm::sinh(r + 0.5 * d) * libm::sinh(0.5 * d),
            // Far from rest the quotient may be one of infinite numbers.
            Self::Tanh if d.abs() < 1.0 => libm::sinh(d) / (libm::cosh(r) * libm::cosh(v)),
            Self::Tanh => libm::tanh(v) - libm::tanh(r),
            Self::Exp => r.exponential() * libm::expm1(d),
            Self::Ln => (d / r).ln_of_both(v / r),
            Self::Sqrt => d / (v.sqrt() + r.sqrt()),
            Self::Erf => {
                let slope = |s: f64| std::f64::consts::FRAC_2_SQRT_PI * (-s * s).exponential();
                self.by_slope(x, 0.5 / (1.0 + r.abs()), slope)
            }
            Self::PositivePart if r > 0.0 && v > 0.0 => d,
            Self::PositivePart | Self::PositivePartSlope => self.value(v) - self.value(r),
            Self::LogRatioSquared => self.by_slope(x, 0.25, |s| 2.0 * (1.0 + s.log_ratio_slope())),
            Self::LogRatioSlope => self.by_slope(x, 0.25, f64::log_ratio_curvature),
            Self::LogRatioCurvature => self.by_slope(x, 0.25 * r.abs().min(1.0), |s| {
                let (slope, curvature) = (s.log_ratio_slope(), s.log_ratio_curvature());
                -(1.0 + slope + 3.0 * (1.0 + s) * curvature) / (s * (s + 2.0))
            }),
        }
    }

    /// The deviation as the integral of the slope, by Gauss's rule of eight points, up to a width; beyond, as a difference.
    fn by_slope(self, x: Parts, widest: f64, slope: impl Fn(f64) -> f64) -> f64 {
        if x.deviation.abs() > widest || !x.deviation.is_finite() {
            return self.value(x.value) - self.value(x.rest);
        }
        let sum: f64 =
            GAUSS.iter().map(|&[at, weight]| weight * slope(x.rest + at * x.deviation)).sum();
        x.deviation * sum
    }
}

/// Deviation of the inverse sine: `sin(a - b)` with `a = arcsin(v)`, `b = arcsin(r)`, times the sum of its two products over itself.
fn arcsine(x: Parts) -> f64 {
    let Parts { rest: r, deviation: d, value: v } = x;
    if d.abs() > 0.5 * r.abs() {
        return libm::asin(v) - libm::asin(r);
    }
    // 1 - v^2 from the deviation, which has the digits next to one.
    let root = (((1.0 - r) - d) * ((1.0 + r) + d)).sqrt();
    let root_at_rest = ((1.0 - r) * (1.0 + r)).sqrt();
    let sum = v * root_at_rest + r * root;
    // Both at the end of the range.
    if sum == 0.0 { 0.0 } else { libm::asin(d * (v + r) / sum) }
}

/// `x^exponent` less its value at rest `power`, which is a finite number, and `x^exponent`.
pub(crate) fn power(x: Parts, exponent: f64, power: f64) -> (f64, f64) {
    let relative = x.deviation / x.rest;
    if power != 0.0 && relative > -0.5 && relative < 1.0 {
        let deviation = power * libm::expm1(exponent * relative.log_1p());
        if deviation / power > -0.5 {
            return (deviation, power + deviation);
        }
    }
    let value = x.value.power(exponent);
    (value - power, value)
}

/// `atan2(y, x)` less its value at rest.
pub(crate) fn angle_deviation(y: Parts, x: Parts) -> f64 {
    let difference = y.value.polar_angle(x.value) - y.rest.polar_angle(x.rest);
    let cross = x.rest * y.deviation - y.rest * x.deviation;
    let turn = cross.polar_angle(x.rest * x.value + y.rest * y.value);
    // Where both differ it is by a full turn.
    if (turn - difference).abs() < 1.0 { turn } else { difference }
}

/// Gauss's rule for the integral from zero to one: points and weights.
pub(crate) const GAUSS: [[f64; 2]; 8] = [
    [0.019_855_071_751_231_884, 0.050_614_268_145_188_13],
    [0.101_666_761_293_186_63, 0.111_190_517_226_687_23],
    [0.237_233_795_041_835_5, 0.156_853_322_938_943_64],
    [0.408_282_678_752_175_1, 0.181_341_891_689_181],
    [0.591_717_321_247_825, 0.181_341_891_689_181],
    [0.762_766_204_958_164_5, 0.156_853_322_938_943_64],
    [0.898_333_238_706_813_4, 0.111_190_517_226_687_23],
    [0.980_144_928_248_768_1, 0.050_614_268_145_188_13],
];
