//! Intervals of doubles, rounded outward.

use std::f64::consts::PI;
use std::ops::{Add, Mul, Neg, Sub};

/// All real numbers from `low` to `high`. The result of an operation contains every value of the operation on its operands; where there
/// is no value, both ends are NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least number.
    pub low: f64,
    /// The greatest number.
    pub high: f64,
}

/// How far a function of the system's library is from the true value at most, relative to it: four units in the last
/// place, where one is assumed of a function and its argument is formed by a product with pi.
const LIBRARY: f64 = 8.0 * f64::EPSILON;

impl Interval {
    /// The number zero.
    pub const ZERO: Self = Self { low: 0.0, high: 0.0 };
    /// The number one.
    pub const ONE: Self = Self { low: 1.0, high: 1.0 };
    /// The number pi, which is above its nearest double.
    pub const PI: Self = Self { low: PI, high: PI.next_up() };
    /// No number.
    pub const NONE: Self = Self { low: f64::NAN, high: f64::NAN };

    /// The numbers from `low` to `high`.
    #[must_use]
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// One number.
    #[must_use]
    pub const fn point(value: f64) -> Self {
        Self { low: value, high: value }
    }

    /// Results of operations that round once, each a unit in the last place outward.
    fn outward(low: f64, high: f64) -> Self {
        Self { low: low.next_down(), high: high.next_up() }
    }

    /// Whether every number of it is a double.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    /// Whether the interval contains zero; true for [`Self::NONE`].
    #[must_use]
    pub fn has_zero(self) -> bool {
        !(self.low > 0.0 || self.high < 0.0)
    }

    /// The greatest absolute value.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// The least absolute value.
    #[must_use]
    pub fn mignitude(self) -> f64 {
        if self.has_zero() { 0.0 } else { self.low.abs().min(self.high.abs()) }
    }

    /// The smallest interval that contains both.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        if self.low.is_nan() || other.low.is_nan() {
            return Self::NONE;
        }
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// All numbers of the interval, times `1 + d` for all `|d| <= relative`.
    #[must_use]
    pub fn widened(self, relative: f64) -> Self {
        if relative == 0.0 {
            return self;
        }
        self * Self::outward(1.0 - relative, 1.0 + relative)
    }

    /// The quotient; [`Self::NONE`] where the divisor may be zero.
    #[must_use]
    pub fn over(self, divisor: Self) -> Self {
        if divisor.has_zero() || !divisor.is_finite() {
            return Self::NONE;
        }
        if self == Self::ZERO {
            return self;
        }
        let ends = [
            self.low / divisor.low,
            self.low / divisor.high,
            self.high / divisor.low,
            self.high / divisor.high,
        ];
        Self::around(ends)
    }

    fn around(ends: [f64; 4]) -> Self {
        if ends.iter().any(|end| end.is_nan()) {
            return Self::NONE;
        }
        let low = ends.iter().copied().fold(f64::INFINITY, f64::min);
        let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self::outward(low, high)
    }

    /// The square root; [`Self::NONE`] where the interval contains a negative number.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.low.is_nan() || self.low < 0.0 {
            return Self::NONE;
        }
        Self { low: self.low.sqrt().next_down().max(0.0), high: self.high.sqrt().next_up() }
    }

    /// The range of a function that grows or falls throughout; `at` gives its values to within the bound of [`LIBRARY`].
    fn monotonic(self, at: impl Fn(f64) -> f64) -> Self {
        let (low, high) = (at(self.low), at(self.high));
        if low.is_nan() || high.is_nan() {
            return Self::NONE;
        }
        Self::point(low).hull(Self::point(high)).widened(LIBRARY)
    }

    /// The range of a wave, from its values at both ends and at its extrema: the greatest value, 1, at all `first + 2 n` for whole `n`,
    /// and the least value, -1, at all `first + 1 + 2 n`, in units in which `from` and `to` are the ends.
    fn wave(ends: Self, from: f64, to: f64, first: f64) -> Self {
        // The units are formed by a division: a margin is added so that no extremum is missed.
        let slack = 1e-9;
        if from.is_nan() || to.is_nan() {
            return Self::NONE;
        }
        if to - from >= 2.0 {
            return Self::new(-1.0, 1.0);
        }
        let has = |place: f64| {
            ((to - place + slack) / 2.0).floor() >= ((from - place - slack) / 2.0).ceil()
        };
        let high = if has(first) { 1.0 } else { ends.high.min(1.0) };
        let low = if has(first + 1.0) { -1.0 } else { ends.low.max(-1.0) };
        Self { low, high }
    }

    /// `sin(pi x)`.
    #[must_use]
    pub fn sin_pi(self) -> Self {
        Self::wave(self.monotonic(|x| wave_pi(x, 0)), self.low, self.high, 0.5)
    }

    /// `cos(pi x)`.
    #[must_use]
    pub fn cos_pi(self) -> Self {
        Self::wave(self.monotonic(|x| wave_pi(x, 1)), self.low, self.high, 0.0)
    }

    /// `sin(x)`.
    #[must_use]
    pub fn sin(self) -> Self {
        Self::wave(self.monotonic(f64::sin), self.low / PI, self.high / PI, 0.5)
    }

    /// `cos(x)`.
    #[must_use]
    pub fn cos(self) -> Self {
        Self::wave(self.monotonic(f64::cos), self.low / PI, self.high / PI, 0.0)
    }

    /// `exp(x)`.
    #[must_use]
    pub fn exp(self) -> Self {
        self.monotonic(f64::exp)
    }

    /// `ln(x)`.
    #[must_use]
    pub fn ln(self) -> Self {
        if self.low > 0.0 { self.monotonic(f64::ln) } else { Self::NONE }
    }

    /// `ln(1 + x)`.
    #[must_use]
    pub fn ln_1p(self) -> Self {
        if self.low > -1.0 { self.monotonic(f64::ln_1p) } else { Self::NONE }
    }

    /// `ln(1 + x)/x`, which falls from pole to pole, and is one at zero.
    #[must_use]
    pub fn ln_1p_ratio(self) -> Self {
        if self.low > -1.0 {
            self.monotonic(|x| if x == 0.0 { 1.0 } else { x.ln_1p() / x })
        } else {
            Self::NONE
        }
    }

    /// `sin(x)/x`, whose greatest value is one at zero, for `|x| <= 2`, where it falls to both sides.
    #[must_use]
    pub fn sine_ratio(self) -> Self {
        if self.magnitude().is_nan() || self.magnitude() > 2.0 {
            return Self::NONE;
        }
        let far = self.magnitude();
        let near = self.mignitude();
        let at = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
        Self::new(at(far), at(near)).widened(LIBRARY)
    }

    /// The point half way.
    #[must_use]
    pub fn middle(self) -> f64 {
        self.low + 0.5 * (self.high - self.low)
    }
}

/// `sin(pi (x + quarters/2))` to within a few units in the last place: the argument is reduced exactly.
fn wave_pi(x: f64, quarters: i64) -> f64 {
    let n = (2.0 * x).round();
    let r = (x - n / 2.0) * PI;
    match (n.rem_euclid(4.0) as i64 + quarters).rem_euclid(4) {
        0 => r.sin(),
        1 => r.cos(),
        2 => -r.sin(),
        _ => -r.cos(),
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self == Self::ZERO {
            return other;
        }
        if other == Self::ZERO {
            return self;
        }
        Self::outward(self.low + other.low, self.high + other.high)
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self == Self::ONE {
            return other;
        }
        if other == Self::ONE {
            return self;
        }
        if self == Self::ZERO || other == Self::ZERO {
            // Zero times an interval that is not finite has no value here; such intervals are refused before.
            return if self.is_finite() && other.is_finite() { Self::ZERO } else { Self::NONE };
        }
        Self::around([
            self.low * other.low,
            self.low * other.high,
            self.high * other.low,
            self.high * other.high,
        ])
    }
}
