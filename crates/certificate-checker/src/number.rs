//! Ranges of real numbers between doubles.

use std::f64::consts::PI;

/// The real numbers from `low` to `high`; empty where `low` or `high` is NaN.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// The relative error of values computed with functions of the system's library, with a wide margin.
const SPARE: f64 = 2e-15;

impl Range {
    pub(crate) const ONE: Self = Self::new(1.0, 1.0);

    pub(crate) const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    pub(crate) fn pi() -> Self {
        Self::new(PI, PI.next_up())
    }

    pub(crate) fn is_known(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    pub(crate) fn is_zero(self) -> bool {
        self.low == 0.0 && self.high == 0.0
    }

    pub(crate) fn touches_zero(self) -> bool {
        !(self.low > 0.0 || self.high < 0.0)
    }

    pub(crate) fn largest(self) -> f64 {
        f64::max(-self.low, self.high)
    }

    pub(crate) fn smallest(self) -> f64 {
        if self.touches_zero() { 0.0 } else { f64::min(self.low.abs(), self.high.abs()) }
    }

    /// The range from the least to the greatest of some results with one rounding each.
    fn spanning(results: &[f64]) -> Self {
        let mut span = Self::new(f64::INFINITY, f64::NEG_INFINITY);
        for &result in results {
            if result.is_nan() {
                return Self::new(f64::NAN, f64::NAN);
            }
            span = Self::new(span.low.min(result), span.high.max(result));
        }
        Self::new(span.low.next_down(), span.high.next_up())
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        if self.is_zero() {
            other
        } else if other.is_zero() {
            self
        } else {
            Self::spanning(&[self.low + other.low, self.high + other.high])
        }
    }

    pub(crate) fn minus(self) -> Self {
        Self::new(-self.high, -self.low)
    }

    pub(crate) fn times(self, other: Self) -> Self {
        let exact = |r: Self| (r.low, r.high) == (1.0, 1.0);
        if exact(self) || (other.is_zero() && self.is_known()) {
            other
        } else if exact(other) || (self.is_zero() && other.is_known()) {
            self
        } else {
            let (a, b) = (self, other);
            Self::spanning(&[a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high])
        }
    }

    pub(crate) fn inverse(self) -> Self {
        if self.touches_zero() {
            return Self::new(f64::NAN, f64::NAN);
        }
        Self::spanning(&[1.0 / self.low, 1.0 / self.high])
    }

    /// The range with every number multiplied by `1 + d` for all `|d| <= relative`.
    pub(crate) fn blurred(self, relative: f64) -> Self {
        if relative == 0.0 {
            self
        } else {
            self.times(Self::spanning(&[1.0 - relative, 1.0 + relative]))
        }
    }

    pub(crate) fn root(self) -> Self {
        let low = if self.low >= 0.0 { self.low.sqrt() } else { f64::NAN };
        let root = Self::spanning(&[low, self.high.sqrt()]);
        Self::new(root.low.max(0.0), root.high)
    }

    /// `ln(1 + x)/x`, which falls, or `ln(1 + x)`, which grows.
    pub(crate) fn logarithm(self, ratio: bool) -> Self {
        let at = |x: f64| match (x > -1.0, ratio && x != 0.0) {
            (false, _) => f64::NAN,
            (true, true) => x.ln_1p() / x,
            (true, false) if ratio => 1.0,
            (true, false) => x.ln_1p(),
        };
        Self::spanning(&[at(self.low), at(self.high)]).blurred(SPARE)
    }

    /// `sin(x)/x` where the sine has no other zero than at zero: it falls as `|x|` grows.
    pub(crate) fn sine_ratio(self) -> Self {
        let at = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
        Self::spanning(&[at(self.largest()), at(self.smallest())]).blurred(SPARE)
    }

    /// The sine, or the cosine, of `pi x` or of `x`.
    pub(crate) fn wave(self, cosine: bool, times_pi: bool) -> Self {
        let at = |x: f64| {
            if !times_pi {
                return if cosine { x.cos() } else { x.sin() };
            }
            // Whole quarters of the period are taken off first, which is exact.
            let quarters = (2.0 * x).round();
            let angle = (x - 0.5 * quarters) * PI;
            let turned = quarters + if cosine { 1.0 } else { 0.0 };
            let value = if turned.rem_euclid(2.0) == 0.0 { angle.sin() } else { angle.cos() };
            if turned.rem_euclid(4.0) < 2.0 { value } else { -value }
        };
        let ends = Self::spanning(&[at(self.low), at(self.high)]).blurred(SPARE);
        // In quarters of the period from a crest on: crests are at multiples of 4, troughs two further.
        let unit = if times_pi { 2.0 } else { 2.0 / PI };
        let from_crest = if cosine { 0.0 } else { 1.0 };
        let (from, to) =
            (self.low * unit - from_crest - 1e-8, self.high * unit - from_crest + 1e-8);
        if !(from.is_finite() && to.is_finite()) {
            return Self::new(f64::NAN, f64::NAN);
        }
        let passes = |offset: f64| ((to - offset) / 4.0).floor() >= ((from - offset) / 4.0).ceil();
        let low = if passes(2.0) { -1.0 } else { ends.low.max(-1.0) };
        let high = if passes(0.0) { 1.0 } else { ends.high.min(1.0) };
        Self::new(low, high)
    }
}
