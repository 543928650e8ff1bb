//! Programs evaluated in some 100 bits, fast: what a search for rounding errors holds doubles against before it asks the
//! oracle.

use mmsmith_expr::{Function, Operation, Program, Rational, nearest_f64};
use num_traits::ToPrimitive;
use std::f64::consts::{FRAC_2_PI, LN_2};
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::LazyLock;

/// The sum of two doubles, of which the second is below the last place of the first.
///
/// Not for numbers beyond 1e290, whose products overflow on the way, nor for those below 1e-280, whose second part is lost: a
/// result that matters is computed anew by the [`Oracle`](crate::Oracle).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DoubleDouble {
    pub(crate) high: f64,
    pub(crate) low: f64,
}

/// Words of pi and of ln 2, each below the last place of the word before it.
const PI: [f64; 4] = [
    std::f64::consts::PI,
    1.224_646_799_147_353_2e-16,
    -2.994_769_809_718_339_7e-33,
    1.112_454_220_863_365_3e-49,
];
const LN2: [f64; 2] = [LN_2, 2.319_046_813_846_299_6e-17];
/// Beyond so many quarter turns the words of pi do not suffice.
const MOST_QUARTERS: f64 = 1e15;
/// Terms of the series of sine and cosine for arguments up to pi/4.
const TRIGONOMETRIC_TERMS: usize = 30;
/// Terms of the exponential series for arguments up to ln(2)/1024.
const EXPONENTIAL_TERMS: usize = 10;
/// Halvings of the argument of an exponential.
const HALVINGS: i32 = 9;
/// As [`log ratios`](mmsmith_expr::Function::LogRatioSlope) in doubles: the series in `y = z/(z + 2)` up to 1/4.
const RATIO_TERMS: u32 = 56;
const LARGEST_RATIO_IN_SERIES: f64 = 0.25;
/// Terms of the series of `ln(1 + x) - x` in `x/(2 + x)` up to a fifth.
const LOGARITHM_TERMS: u32 = 24;
const LARGEST_LOGARITHM_IN_SERIES: f64 = 0.2;
/// As [`hyperbolic cosines of roots`](mmsmith_expr::Function::CoshSqrtM1) in doubles: the series in `y` up to 9.
const ROOT_TERMS: u32 = 28;
const LARGEST_ROOT_IN_SERIES: f64 = 9.0;

/// `1/n!`.
static INVERSE_FACTORIALS: LazyLock<Vec<DoubleDouble>> = LazyLock::new(|| {
    let mut value = DoubleDouble::from(1.0);
    let mut values = vec![value];
    for n in 1..=TRIGONOMETRIC_TERMS {
        value = value / DoubleDouble::from(n as f64);
        values.push(value);
    }
    values
});

fn sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let b_in_sum = high - a;
    DoubleDouble { high, low: (a - (high - b_in_sum)) + (b - b_in_sum) }
}

/// As [`sum`], where `|a| >= |b|`.
fn ordered_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

fn product(a: f64, b: f64) -> DoubleDouble {
    let split = |x: f64| {
        let scaled = x * 134_217_729.0;
        let high = scaled - (scaled - x);
        (high, x - high)
    };
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let high = a * b;
    let low = (((a_high * b_high - high) + a_high * b_low) + a_low * b_high) + a_low * b_low;
    DoubleDouble { high, low }
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        DoubleDouble { high, low: 0.0 }
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        DoubleDouble { high: -self.high, low: -self.low }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, low) = (sum(self.high, other.high), sum(self.low, other.low));
        let first = ordered_sum(high.high, high.low + low.high);
        ordered_sum(first.high, first.low + low.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let high = product(self.high, other.high);
        ordered_sum(high.high, high.low + (self.high * other.low + self.low * other.high))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other.times(first);
        let second = rest.high / other.high;
        let rest = rest - other.times(second);
        let third = rest.high / other.high;
        ordered_sum(first, second) + DoubleDouble::from(third)
    }
}

impl DoubleDouble {
    const ONE: Self = DoubleDouble { high: 1.0, low: 0.0 };
    const PI: Self = DoubleDouble { high: PI[0], low: PI[1] };

    fn nearest(value: &Rational) -> Self {
        let high = nearest_f64(value);
        let low = crate::exact(high).map_or(0.0, |exact| nearest_f64(&(value - exact)));
        DoubleDouble { high, low }
    }

    fn times(self, factor: f64) -> Self {
        let high = product(self.high, factor);
        ordered_sum(high.high, high.low + self.low * factor)
    }

    /// Times a power of two, which is exact.
    fn scaled(self, factor: f64) -> Self {
        DoubleDouble { high: self.high * factor, low: self.low * factor }
    }

    fn sqrt(self) -> Self {
        if self.high <= 0.0 {
            return Self::from(self.high.sqrt());
        }
        let root = self.high.sqrt();
        let rest = self - product(root, root);
        ordered_sum(root, rest.high / (2.0 * root))
    }

    fn abs(self) -> Self {
        if self.high < 0.0 { -self } else { self }
    }

    /// `y` and `k` with `exp(x) = (1 + y) 2^k`, where `k` is 0 for small `x`.
    fn reduced_exponential(self) -> (Self, i32) {
        let whole = if self.high.abs() < 0.3 { 0.0 } else { (self.high / LN_2).round() };
        let rest = self - (Self { high: LN2[0], low: LN2[1] }).times(whole);
        let x = rest.scaled(2_f64.powi(-HALVINGS));
        let series = INVERSE_FACTORIALS[1..=EXPONENTIAL_TERMS]
            .iter()
            .rev()
            .fold(Self::from(0.0), |sum, &term| sum * x + term);
        let mut value = series * x;
        for _ in 0..HALVINGS {
            value = value.scaled(2.0) + value * value;
        }
        // Callers keep to arguments below 700.
        (value, whole as i32)
    }

    /// `exp(x) - 1`.
    fn expm1(self) -> Self {
        if self.high.is_nan() || self.high.abs() >= 700.0 {
            return Self::from(self.high.exp_m1());
        }
        match self.reduced_exponential() {
            (value, 0) => value,
            (value, whole) => (Self::ONE + value).scaled(2_f64.powi(whole)) - Self::ONE,
        }
    }

    fn exp(self) -> Self {
        if self.high.is_nan() || self.high.abs() >= 700.0 {
            return Self::from(self.high.exp());
        }
        let (value, whole) = self.reduced_exponential();
        (Self::ONE + value).scaled(2_f64.powi(whole))
    }

    /// `ln(1 + x)`: one step of Newton's method from the double.
    fn ln_1p(self) -> Self {
        let first = self.high.ln_1p();
        if !first.is_finite() || self.high == 0.0 {
            return Self::from(first);
        }
        let inverse = (-Self::from(first)).expm1();
        let step = inverse + self + self * inverse;
        Self::from(first) + step - (step * step).scaled(0.5)
    }

    fn ln(self) -> Self {
        if (0.5..2.0).contains(&self.high) {
            return (self - Self::ONE).ln_1p();
        }
        let first = self.high.ln();
        if !first.is_finite() || !(1e-280..1e280).contains(&self.high) {
            return Self::from(first);
        }
        let step = self * (-Self::from(first)).exp() - Self::ONE;
        Self::from(first) + step - (step * step).scaled(0.5)
    }

    /// Sine and cosine of an argument up to pi/4.
    fn sine_and_cosine(self) -> (Self, Self) {
        let square = self * self;
        let series = |first: usize| {
            (0..TRIGONOMETRIC_TERMS / 2)
                .rev()
                .fold(Self::from(0.0), |sum, k| INVERSE_FACTORIALS[first + 2 * k] - sum * square)
        };
        (series(1) * self, series(0))
    }

    /// The sine after a number of quarter turns.
    fn turned((sine, cosine): (Self, Self), quarters: f64) -> Self {
        match quarters.rem_euclid(4.0) as u8 {
            0 => sine,
            1 => cosine,
            2 => -sine,
            _ => -cosine,
        }
    }

    /// `sin(x + quarters pi/2)`.
    fn sin_shifted(self, quarters: f64) -> Self {
        let n = (self.high * FRAC_2_PI).round();
        if n.is_nan() || n.abs() >= MOST_QUARTERS {
            return Self::from(f64::NAN);
        }
        let mut rest = self;
        for word in PI {
            rest = rest - product(n, 0.5 * word);
        }
        Self::turned(rest.sine_and_cosine(), n + quarters)
    }

    /// `sin(pi (x + quarters/2))`.
    fn sin_pi_shifted(self, quarters: f64) -> Self {
        let (n_high, n_low) = ((2.0 * self.high).round(), (2.0 * self.low).round());
        let mut rest = self - Self::from(0.5 * n_high) - Self::from(0.5 * n_low);
        let n = (2.0 * rest.high).round();
        rest = rest - Self::from(0.5 * n);
        let turns = n_high.rem_euclid(4.0) + n_low.rem_euclid(4.0) + n + quarters;
        Self::turned((rest * Self::PI).sine_and_cosine(), turns)
    }

    /// The polar angle of `(x, y)`: one step from the double.
    fn atan2(y: Self, x: Self) -> Self {
        let first = y.high.atan2(x.high);
        if first == 0.0 || !first.is_finite() {
            return Self::from(first);
        }
        let angle = Self::from(first);
        let (sine, cosine) = (angle.sin_shifted(0.0), angle.sin_shifted(1.0));
        let step = (y * cosine - x * sine) / (x * cosine + y * sine);
        angle + step
    }

    fn power(self, exponent: &Rational) -> Self {
        let cube_root = exponent.denom().to_u32() == Some(3);
        if self.high == 0.0 {
            return self;
        }
        if cube_root && let Some(n) = exponent.numer().to_i32() {
            // A root by Newton's method, whose relative error does not grow with the logarithm.
            let root = Self::from(self.high.cbrt());
            let rest = self - root * root * root;
            let root = root + rest / (root * root).times(3.0);
            return root.whole_power(n);
        }
        (self.ln() * Self::nearest(exponent)).exp()
    }

    fn whole_power(self, n: i32) -> Self {
        let mut value = Self::ONE;
        for _ in 0..n.unsigned_abs() {
            value = value * self;
        }
        if n < 0 { Self::ONE / value } else { value }
    }

    /// `ln(1 + x) - x`: with `s = x/(2 + x)` it is `-x s + 2 (s^3/3 + s^5/5 + ...)`.
    fn ln_1p_minus_x(self) -> Self {
        let s = self / (self + Self::from(2.0));
        if s.high.abs() > LARGEST_LOGARITHM_IN_SERIES {
            return self.ln_1p() - self;
        }
        let square = s * s;
        let series = (1..=LOGARITHM_TERMS).rev().fold(Self::from(0.0), |sum, k| {
            sum * square + Self::ONE / Self::from(2.0 * f64::from(k) + 1.0)
        });
        (series * square * s).scaled(2.0) - self * s
    }

    fn log_ratio(self) -> Self {
        (self + (self * (self + Self::from(2.0))).sqrt()).ln_1p()
    }

    /// `-sum y^k/(4 k^2 - 1)` times what `weight` says of `k`, from `k = 1` on.
    fn ratio_series(y: Self, weight: impl Fn(f64) -> f64) -> Self {
        -(1..=RATIO_TERMS).rev().fold(Self::from(0.0), |sum, k| {
            let k = f64::from(k);
            sum * y + Self::from(weight(k)) / Self::from(4.0 * k * k - 1.0)
        })
    }

    fn log_ratio_slope(self) -> Self {
        let y = self / (self + Self::from(2.0));
        if y.high > LARGEST_RATIO_IN_SERIES {
            let root = (self * (self + Self::from(2.0))).sqrt();
            return self.log_ratio() / root - Self::ONE;
        }
        Self::ratio_series(y, |_| 2.0) * y
    }

    fn log_ratio_curvature(self) -> Self {
        let y = self / (self + Self::from(2.0));
        if y.high > LARGEST_RATIO_IN_SERIES {
            let numerator = self + (Self::ONE + self) * self.log_ratio_slope();
            return -(numerator / (self * (self + Self::from(2.0))));
        }
        let rest = Self::ONE - y;
        Self::ratio_series(y, |k| k) * (rest * rest)
    }

    /// `1 + y/d(1) (1 + y/d(2) (1 + ...))`.
    fn root_series(self, divisor: impl Fn(f64) -> f64) -> Self {
        (1..=ROOT_TERMS)
            .rev()
            .fold(Self::ONE, |sum, k| Self::ONE + self * sum / Self::from(divisor(f64::from(k))))
    }

    /// `cosh(s)` and `sinh(s)/s` for `s = sqrt(y)`.
    fn hyperbolic_of_root(self) -> (Self, Self) {
        let root = self.sqrt();
        let e = root.exp();
        let inverse = Self::ONE / e;
        ((e + inverse).scaled(0.5), (e - inverse).scaled(0.5) / root)
    }

    fn cosh_sqrt_m1(self) -> Self {
        if self.high.abs() <= LARGEST_ROOT_IN_SERIES {
            let series = self.root_series(|k| (2.0 * k + 1.0) * (2.0 * k + 2.0));
            return (self * series).scaled(0.5);
        }
        self.hyperbolic_of_root().0 - Self::ONE
    }

    fn cosh_sqrt_m1_slope(self) -> Self {
        if self.high.abs() <= LARGEST_ROOT_IN_SERIES {
            let series = self.root_series(|k| (2.0 * k + 2.0) * (2.0 * k + 3.0));
            return self * series / Self::from(6.0);
        }
        self.hyperbolic_of_root().1 - Self::ONE
    }

    fn cosh_sqrt_m1_curvature(self) -> Self {
        if self.high.abs() <= LARGEST_ROOT_IN_SERIES {
            return self.root_series(|k| 2.0 * k * (2.0 * k + 3.0)) / Self::from(6.0);
        }
        let (cosh, ratio) = self.hyperbolic_of_root();
        (cosh - ratio) / self.scaled(2.0)
    }

    fn call(self, function: Function) -> Self {
        match function {
            Function::Sin => self.sin_shifted(0.0),
            Function::Cos => self.sin_shifted(1.0),
            Function::Tan => self.sin_shifted(0.0) / self.sin_shifted(1.0),
            Function::Asin => Self::atan2(self, self.leg()),
            Function::Acos => Self::atan2(self.leg(), self),
            Function::Atan => Self::atan2(self, Self::ONE),
            Function::Sinh => {
                let m = self.abs().expm1();
                let value = (m + m / (m + Self::ONE)).scaled(0.5);
                if self.high < 0.0 { -value } else { value }
            }
            Function::Cosh => {
                let e = self.abs().exp();
                (e + Self::ONE / e).scaled(0.5)
            }
            // Beyond, the difference from one is below the second double.
            Function::Tanh if self.high.abs() > 40.0 => Self::from(self.high.signum()),
            Function::Tanh => {
                let m = self.scaled(2.0).expm1();
                m / (m + Self::from(2.0))
            }
            Function::Exp => self.exp(),
            Function::Ln => self.ln(),
            Function::Ln1p => self.ln_1p(),
            Function::Ln1pMinusX => self.ln_1p_minus_x(),
            Function::Expm1 => self.expm1(),
            Function::LogRatioSquared => {
                let theta = self.log_ratio();
                theta * theta
            }
            Function::LogRatioSlope => self.log_ratio_slope(),
            Function::LogRatioCurvature => self.log_ratio_curvature(),
            Function::CoshSqrtM1 => self.cosh_sqrt_m1(),
            Function::CoshSqrtM1Slope => self.cosh_sqrt_m1_slope(),
            Function::CoshSqrtM1Curvature => self.cosh_sqrt_m1_curvature(),
            Function::PositivePart if self.high <= 0.0 => Self::from(0.0),
            Function::PositivePart => self,
            Function::PositivePartSlope if self.high > 0.0 => Self::ONE,
            Function::PositivePartSlope if self.high <= 0.0 => Self::from(0.0),
            // The others have operations of their own, or no value here: the oracle is asked where this is not a number.
            _ => Self::from(f64::NAN),
        }
    }

    /// `sqrt(1 - x^2)`.
    fn leg(self) -> Self {
        ((Self::ONE - self) * (Self::ONE + self)).sqrt()
    }
}

/// A program with its numbers in twice the precision.
#[derive(Clone, Debug)]
pub(crate) struct QuickTruth {
    program: Program,
    numbers: Vec<DoubleDouble>,
}

impl QuickTruth {
    pub(crate) fn new(program: Program) -> Self {
        let number = |operation: &Operation| match operation {
            Operation::Number(value) => DoubleDouble::nearest(value),
            _ => DoubleDouble::from(f64::NAN),
        };
        let numbers = program.operations().iter().map(number).collect();
        QuickTruth { program, numbers }
    }

    /// The outputs at inputs that are taken for exact.
    pub(crate) fn evaluate(&self, inputs: &[f64]) -> Vec<DoubleDouble> {
        let mut values: Vec<DoubleDouble> = Vec::with_capacity(self.numbers.len());
        for (operation, &number) in self.program.operations().iter().zip(&self.numbers) {
            let at = |slot: mmsmith_expr::Slot| values[slot.index()];
            let value = match operation {
                Operation::Number(_) => number,
                Operation::Pi => DoubleDouble::PI,
                Operation::Input(index) => {
                    DoubleDouble::from(inputs.get(*index).copied().unwrap_or(f64::NAN))
                }
                Operation::Add(a, b) => at(*a) + at(*b),
                Operation::Sub(a, b) => at(*a) - at(*b),
                Operation::Mul(a, b) => at(*a) * at(*b),
                Operation::Div(a, b) => at(*a) / at(*b),
                Operation::Neg(a) => -at(*a),
                Operation::Sqrt(a) => at(*a).sqrt(),
                Operation::Power(a, exponent) => at(*a).power(exponent),
                Operation::SinPi(a) => at(*a).sin_pi_shifted(0.0),
                Operation::CosPi(a) => at(*a).sin_pi_shifted(1.0),
                Operation::Call(function, a) => at(*a).call(*function),
                Operation::Atan2(y, x) => DoubleDouble::atan2(at(*y), at(*x)),
                Operation::LnOfBoth(x, y) if at(*x).high < -0.5 => at(*y).ln(),
                Operation::LnOfBoth(x, _) => at(*x).ln_1p(),
                // Nothing is rounded that would be missed.
                Operation::SumError(..) | Operation::ProductError(..) => DoubleDouble::from(0.0),
            };
            values.push(value);
        }
        self.program.outputs().iter().map(|slot| values[slot.index()]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Oracle, Point, exact};
    use mmsmith_expr::{Ast, Dependence, Graph};
    use num_traits::Signed;

    /// Each function at places where its parts cancel, at large arguments and at small ones, against the oracle.
    #[test]
    fn every_function_has_thirty_digits_or_nearly() {
        let small = [1e-9, -3.7e-5, 0.013];
        let moderate = [0.31, -0.29, 0.77, 0.49999];
        let large = [1.7, std::f64::consts::PI, 12.3, -7.1, 31.4];
        let all: Vec<f64> = [&small[..], &moderate, &large].concat();
        let positive: Vec<f64> = all.iter().map(|x| x.abs()).collect();
        let turns = [all.clone(), vec![1e6 + 0.1, 123_456.789, -12_345_678.9]].concat();
        let inner = [&small[..], &moderate, &[0.999_999, -0.999_9]].concat();
        let cases: [(&str, &[f64]); 31] = [
            ("sin(x)", &turns),
            ("cos(x)", &turns),
            ("tan(x)", &turns),
            ("sin(Pi*x)", &turns),
            ("cos(Pi*x)", &turns),
            ("arcsin(x)", &inner),
            ("arccos(x)", &inner),
            ("arctan(x)", &all),
            ("sinh(x)", &all),
            ("cosh(x)", &all),
            ("tanh(x)", &all),
            ("exp(x)", &all),
            ("exp(-5*x)", &all),
            ("expm1(x)", &all),
            ("ln(x)", &positive),
            ("ln(1+x^2/1000)", &large),
            ("log1p(x)", &positive),
            ("log1p(-x/40)", &all),
            ("log1pmx(x)", &positive),
            ("log1pmx(-x/40)", &all),
            ("x^(1/3)", &positive),
            ("x^(7/5)", &positive),
            ("sqrt(x)", &positive),
            ("lnratio2(x)", &positive),
            ("lnratio2_slope(x)", &positive),
            ("lnratio2_curvature(x)", &positive),
            ("cosh_sqrt_m1(x)", &positive),
            ("cosh_sqrt_m1_slope(x)", &positive),
            ("cosh_sqrt_m1_curvature(x)", &positive),
            ("positive_part(x)", &positive),
            ("positive_part_slope(x) + positive_part(-x)", &positive),
        ];
        let mut oracle = Oracle::new(Oracle::USUAL_BITS).unwrap();
        for (text, places) in cases {
            let mut graph = Graph::new();
            let x = graph.symbol("x");
            let y = graph.build(&Ast::parse(text).unwrap(), &mut |_, _| Ok(x)).unwrap();
            let program = Program::lower(&mut graph, &[(x, Dependence::default())], &[], &[y]);
            let quick = QuickTruth::new(program);
            for &place in places {
                let values = [(x, exact(place).unwrap())];
                let point = Point { graph: &graph, definitions: &[], values: &values };
                let truth = oracle.settle(&point, &[y], 40).unwrap().remove(0);
                let found = quick.evaluate(&[place])[0];
                let found = exact(found.high).unwrap() + exact(found.low).unwrap();
                let error = nearest_f64(&((found - &truth).abs() / truth.abs()));
                // The argument of some is rounded by a product, which the slope magnifies.
                assert!(error < 1e-28 * (1.0 + place.abs()), "{text} at {place}: {error:e}");
            }
        }
    }
}
