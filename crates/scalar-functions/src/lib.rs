//! Functions of scalars that the language of specifications has and the standard library lacks, or has with other bits on other
//! machines.
//!
//! Generated code calls them, and so does the evaluation of programs without it: both give the same bits.

mod cosh_sqrt;
mod elementary;
mod log_ratio;
pub mod logarithm;

use std::ops::{Add, Sub};

/// The functions, for both precisions.
pub trait ScalarFunctions: Copy + Add<Output = Self> + Sub<Output = Self> {
    /// `sin(pi x)`.
    ///
    /// The argument is reduced *before* it is multiplied by pi, which is exact, so that `sin_pi(1)` is zero and a phase of a
    /// million periods loses no digits to the rounding of pi.
    #[must_use]
    fn sin_pi(self) -> Self;

    /// `cos(pi x)`, as [`sin_pi`](Self::sin_pi).
    #[must_use]
    fn cos_pi(self) -> Self;

    /// `sin(x)` of an angle in radians, within one unit in the last place, and beyond a million within 1e-18 besides.
    ///
    /// Unlike `sin` it is no call into the system's library, and all systems give the same bits.
    #[must_use]
    fn sine(self) -> Self;

    /// `cos(x)`, as [`sine`](Self::sine).
    #[must_use]
    fn cosine(self) -> Self;

    /// [`sine`](Self::sine) to the last bit, without a branch, of angles up to a million; not a number beyond.
    #[must_use]
    fn sine_in_range(self) -> Self;

    /// [`cosine`](Self::cosine), as [`sine_in_range`](Self::sine_in_range).
    #[must_use]
    fn cosine_in_range(self) -> Self;

    /// [`sine_in_range`](Self::sine_in_range) if `NEAR`, else [`sine`](Self::sine).
    #[inline(always)]
    #[must_use]
    fn sine_if<const NEAR: bool>(self) -> Self {
        if NEAR { self.sine_in_range() } else { self.sine() }
    }

    /// [`cosine_in_range`](Self::cosine_in_range) if `NEAR`, else [`cosine`](Self::cosine).
    #[inline(always)]
    #[must_use]
    fn cosine_if<const NEAR: bool>(self) -> Self {
        if NEAR { self.cosine_in_range() } else { self.cosine() }
    }

    /// `exp(x)`, within one unit in the last place, and without a call, as [`sine`](Self::sine).
    #[must_use]
    fn exponential(self) -> Self;

    /// `ln(x)`, within one unit in the last place, and without a call, as [`log_1p`](Self::log_1p).
    #[must_use]
    fn logarithm(self) -> Self;

    /// `x^exponent`, by the crate `libm`, so that all systems give the same bits.
    #[must_use]
    fn power(self, exponent: Self) -> Self;

    /// The polar angle of the point `(x, self)`, which `atan2` is elsewhere, by the crate `libm`.
    #[must_use]
    fn polar_angle(self, x: Self) -> Self;

    /// `ln(1 + x)`, within one unit in the last place.
    ///
    /// Unlike `ln_1p` it is no call into the system's library: loops over many points use vector instructions, and
    /// all processors give the same bits.
    #[must_use]
    fn log_1p(self) -> Self;

    /// `ln(1 + x) - x`, small as `-x^2/2` where `x` is small. Within four units in the last place, and without a call, as
    /// [`log_1p`](Self::log_1p).
    #[must_use]
    fn log_1p_minus_x(self) -> Self;

    /// `ln(y)` of `y = 1 + x`, where `x` is `self`: by `y` where `x < -1/2`, else by `x`.
    ///
    /// A ratio of volumes next to one has its digits in `x`, one next to zero, as a product of stretches, in `y`. Within
    /// one and a half units in the last place, and without a call, as [`log_1p`](Self::log_1p).
    #[must_use]
    fn ln_of_both(self, y: Self) -> Self;

    /// [`ln_of_both`](Self::ln_of_both) to the last bit, in half as many operations, where `x` is at least -1/2 and below one;
    /// not a number elsewhere.
    #[must_use]
    fn ln_near_one(self) -> Self;

    /// [`ln_near_one`](Self::ln_near_one) if `NEAR`, else [`ln_of_both`](Self::ln_of_both).
    #[inline(always)]
    #[must_use]
    fn ln_of_both_if<const NEAR: bool>(self, y: Self) -> Self {
        if NEAR { self.ln_near_one() } else { self.ln_of_both(y) }
    }

    /// Rounding error of a sum: `self + other` less its rounded value, exactly (D. E. Knuth, The Art of Computer Programming, vol. 2,
    /// 4.2.2).
    #[inline]
    #[must_use]
    fn sum_error(self, other: Self) -> Self {
        let sum = self + other;
        let other_in_sum = sum - self;
        (self - (sum - other_in_sum)) + (other - other_in_sum)
    }

    /// Rounding error of a product: `self * other` less its rounded value, exactly while both and the product are below 1e300 and what is
    /// lost is not below the normal numbers (T. J. Dekker, Numer. Math. 18, 1971).
    #[must_use]
    fn product_error(self, other: Self) -> Self;

    /// `arcosh(1 + z)^2`: the squared logarithm of the ratio of two stretches `a`, `b` for `z = (a - b)^2/(2 a b)`.
    #[must_use]
    fn log_ratio_squared(self) -> Self;

    /// `theta/sinh(theta) - 1` for `theta = arcosh(1 + z)`, half the derivative of
    /// [`log_ratio_squared`](Self::log_ratio_squared) less one.
    #[must_use]
    fn log_ratio_slope(self) -> Self;

    /// The derivative of [`log_ratio_slope`](Self::log_ratio_slope).
    #[must_use]
    fn log_ratio_curvature(self) -> Self;

    /// `cosh(sqrt(y)) - 1` for `y` from 0 on, accurate for small `y` and smooth at zero. Within four units in the last place, up
    /// to where it is beyond the largest number.
    #[must_use]
    fn cosh_sqrt_m1(self) -> Self;

    /// `sinh(s)/s - 1` for `s = sqrt(y)`, twice the derivative of [`cosh_sqrt_m1`](Self::cosh_sqrt_m1) less one, and as accurate.
    #[must_use]
    fn cosh_sqrt_m1_slope(self) -> Self;

    /// The derivative of [`cosh_sqrt_m1_slope`](Self::cosh_sqrt_m1_slope), and as accurate.
    #[must_use]
    fn cosh_sqrt_m1_curvature(self) -> Self;

    /// `max(x, 0)`, and not a number where `x` is none.
    #[must_use]
    fn positive_part(self) -> Self;

    /// The derivative of [`positive_part`](Self::positive_part): one where `x > 0`, else zero, and not a number where `x` is none.
    #[must_use]
    fn positive_part_slope(self) -> Self;
}

impl ScalarFunctions for f64 {
    #[inline]
    fn sin_pi(self) -> Self {
        sin_pi_shifted(self, 0)
    }

    #[inline]
    fn cos_pi(self) -> Self {
        sin_pi_shifted(self, 1)
    }

    #[inline]
    fn sine(self) -> Self {
        elementary::sine(self)
    }

    #[inline]
    fn cosine(self) -> Self {
        elementary::cosine(self)
    }

    #[inline(always)]
    fn sine_in_range(self) -> Self {
        elementary::sine_in_range(self)
    }

    #[inline(always)]
    fn cosine_in_range(self) -> Self {
        elementary::cosine_in_range(self)
    }

    #[inline(always)]
    fn exponential(self) -> Self {
        elementary::exponential(self)
    }

    #[inline(always)]
    fn logarithm(self) -> Self {
        logarithm::ln(self)
    }

    #[inline]
    fn power(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }

    #[inline]
    fn polar_angle(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    #[inline(always)]
    fn log_1p(self) -> Self {
        logarithm::ln_1p(self)
    }

    #[inline(always)]
    fn log_1p_minus_x(self) -> Self {
        logarithm::ln_1p_minus_x(self)
    }

    #[inline(always)]
    fn ln_of_both(self, y: Self) -> Self {
        logarithm::ln_of_both(self, y)
    }

    #[inline(always)]
    fn ln_near_one(self) -> Self {
        let value = logarithm::ln_near_one(self);
        if logarithm::is_near_one(self) { value } else { f64::NAN }
    }

    #[inline]
    fn product_error(self, other: Self) -> Self {
        // Halves of 26 bits, whose products are exact.
        let split = |x: f64| {
            let scaled = x * 134_217_729.0;
            let high = scaled - (scaled - x);
            (high, x - high)
        };
        let ((a_high, a_low), (b_high, b_low)) = (split(self), split(other));
        let product = self * other;
        (((a_high * b_high - product) + a_high * b_low) + a_low * b_high) + a_low * b_low
    }

    fn log_ratio_squared(self) -> Self {
        log_ratio::squared(self)
    }

    fn log_ratio_slope(self) -> Self {
        log_ratio::slope(self)
    }

    fn log_ratio_curvature(self) -> Self {
        log_ratio::curvature(self)
    }

    fn cosh_sqrt_m1(self) -> Self {
        cosh_sqrt::minus_one(self)
    }

    fn cosh_sqrt_m1_slope(self) -> Self {
        cosh_sqrt::slope(self)
    }

    fn cosh_sqrt_m1_curvature(self) -> Self {
        cosh_sqrt::curvature(self)
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        // Comparisons with what is no number are false.
        if self <= 0.0 { 0.0 } else { self }
    }

    #[inline(always)]
    fn positive_part_slope(self) -> Self {
        let beyond = if self <= 0.0 { 0.0 } else { self };
        if self > 0.0 { 1.0 } else { beyond }
    }
}

impl ScalarFunctions for f32 {
    #[inline]
    fn sin_pi(self) -> Self {
        sin_pi_shifted(f64::from(self), 0) as f32
    }

    #[inline]
    fn cos_pi(self) -> Self {
        sin_pi_shifted(f64::from(self), 1) as f32
    }

    #[inline]
    fn sine(self) -> Self {
        f64::from(self).sine() as f32
    }

    #[inline]
    fn cosine(self) -> Self {
        f64::from(self).cosine() as f32
    }

    #[inline(always)]
    fn sine_in_range(self) -> Self {
        f64::from(self).sine_in_range() as f32
    }

    #[inline(always)]
    fn cosine_in_range(self) -> Self {
        f64::from(self).cosine_in_range() as f32
    }

    #[inline]
    fn exponential(self) -> Self {
        f64::from(self).exponential() as f32
    }

    #[inline(always)]
    fn logarithm(self) -> Self {
        f64::from(self).logarithm() as f32
    }

    #[inline]
    fn power(self, exponent: Self) -> Self {
        libm::powf(self, exponent)
    }

    #[inline]
    fn polar_angle(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    #[inline(always)]
    fn log_1p(self) -> Self {
        f64::from(self).log_1p() as f32
    }

    #[inline(always)]
    fn log_1p_minus_x(self) -> Self {
        f64::from(self).log_1p_minus_x() as f32
    }

    #[inline(always)]
    fn ln_of_both(self, y: Self) -> Self {
        f64::from(self).ln_of_both(f64::from(y)) as f32
    }

    #[inline(always)]
    fn ln_near_one(self) -> Self {
        f64::from(self).ln_near_one() as f32
    }

    #[inline]
    fn product_error(self, other: Self) -> Self {
        // The product of two of them is exact in double precision.
        (f64::from(self) * f64::from(other) - f64::from(self * other)) as f32
    }

    fn log_ratio_squared(self) -> Self {
        log_ratio::squared(f64::from(self)) as f32
    }

    fn log_ratio_slope(self) -> Self {
        log_ratio::slope(f64::from(self)) as f32
    }

    fn log_ratio_curvature(self) -> Self {
        log_ratio::curvature(f64::from(self)) as f32
    }

    fn cosh_sqrt_m1(self) -> Self {
        cosh_sqrt::minus_one(f64::from(self)) as f32
    }

    fn cosh_sqrt_m1_slope(self) -> Self {
        cosh_sqrt::slope(f64::from(self)) as f32
    }

    fn cosh_sqrt_m1_curvature(self) -> Self {
        cosh_sqrt::curvature(f64::from(self)) as f32
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        // Comparisons with what is no number are false.
        if self <= 0.0 { 0.0 } else { self }
    }

    #[inline(always)]
    fn positive_part_slope(self) -> Self {
        let beyond = if self <= 0.0 { 0.0 } else { self };
        if self > 0.0 { 1.0 } else { beyond }
    }
}

/// `sin(pi (x + quarters/2))`, within one unit in the last place.
///
/// Sums and products only, the same on every processor.
#[inline]
fn sin_pi_shifted(x: f64, quarters: u64) -> f64 {
    // x = n/2 + r with |r| <= 1/4; n and r are exact. Adding one and a half times 2^51, from where on doubles are
    // multiples of 1/2, rounds; the last two bits of the sum are those of n.
    const SHIFT: f64 = 1.5 * 2_251_799_813_685_248.0;
    let (nearest, quadrant) = if x.abs() < SHIFT / 3.0 {
        let shifted = x + SHIFT;
        (shifted - SHIFT, shifted.to_bits())
    } else {
        // Very large or not a number; both are rare.
        let n = (2.0 * x).round();
        (0.5 * n, n.rem_euclid(4.0) as u64)
    };
    let r = x - nearest;
    let quadrant = quadrant.wrapping_add(quarters);
    let value = if quadrant & 1 == 0 { sine(r) } else { cosine(r) };
    if quadrant & 2 == 0 { value } else { -value }
}

/// `sin(pi x)` for `|x| <= 1/4`: the minimax polynomial of Sun's fdlibm for the sine, with the powers of pi in its
/// coefficients.
#[inline]
fn sine(x: f64) -> f64 {
    let z = x * x;
    let square = z * z;
    let low = -5.167_712_780_049_968_5 + z * 2.550_164_039_874_027;
    let middle = -5.992_645_289_761_195e-1 + z * 8.214_587_016_569_905e-2;
    let high = -7.370_034_319_852_937e-3 + z * 4.615_949_610_094_388e-4;
    x * (std::f64::consts::PI + z * (low + square * (middle + square * high)))
}

/// `cos(pi x)` for `|x| <= 1/4`, as the sine.
#[inline]
fn cosine(x: f64) -> f64 {
    let z = x * x;
    let square = z * z;
    let low = 4.058_712_126_416_762 + z * -1.335_262_768_853_168_6;
    let middle = 2.353_306_302_439_816_5e-1 + z * -2.580_688_682_692_376_7e-2;
    let high = 1.929_478_760_777_114_4e-3 + z * -1.036_246_495_865_416_4e-4;
    (1.0 - 4.934_802_200_544_679 * z) + square * (low + square * (middle + square * high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_at_multiples_of_a_half() {
        for n in -8..=8_i32 {
            let x = f64::from(n) / 2.0;
            let sine = [0.0, 1.0, 0.0, -1.0][n.rem_euclid(4) as usize];
            let cosine = [1.0, 0.0, -1.0, 0.0][n.rem_euclid(4) as usize];
            assert_eq!((x.sin_pi(), x.cos_pi()), (sine, cosine), "x = {x}");
        }
    }

    #[test]
    fn agrees_with_the_plain_functions_and_keeps_the_phase_of_large_arguments() {
        for k in 0..1000 {
            let x = f64::from(k) * 0.00731 - 3.0;
            let phase = x * std::f64::consts::PI;
            assert!((x.sin_pi() - phase.sin()).abs() < 2e-15, "sin_pi({x})");
            assert!((x.cos_pi() - phase.cos()).abs() < 2e-15, "cos_pi({x})");
        }
        let far = 2.0 * 1e6 + 0.25;
        assert_eq!(far.sin_pi(), 0.25_f64.sin_pi());
        assert_eq!(far.cos_pi(), 0.25_f64.cos_pi());
    }

    #[test]
    fn the_logarithm_is_within_an_ulp_of_the_library_function() {
        let mut worst: f64 = 0.0;
        for n in 1..200_000 {
            let x = f64::from(n) * 1e-5;
            for x in [x - 1.0, 10.0 * x, x * 1e-9, -x * 1e-9, (50.0 * x - 50.0).exp()] {
                let expected = x.ln_1p();
                let ulp = (expected.abs() * f64::EPSILON).max(f64::MIN_POSITIVE);
                worst = worst.max((x.log_1p() - expected).abs() / ulp);
            }
        }
        assert!(worst <= 1.0, "{worst} units in the last place");
        for x in [0.0, 1e-20, -1e-300, f64::MIN_POSITIVE, f64::INFINITY] {
            assert_eq!(x.log_1p(), x);
        }
        assert_eq!((-1.0_f64).log_1p(), f64::NEG_INFINITY);
        assert_eq!(f64::MAX.log_1p(), f64::MAX.ln());
        assert!((-1.5_f64).log_1p().is_nan() && f64::NAN.log_1p().is_nan());
        assert!(f64::NEG_INFINITY.log_1p().is_nan());
        assert_eq!(0.5_f32.log_1p(), 0.5_f32.ln_1p());
    }

    #[test]
    fn the_logarithm_less_its_argument_keeps_its_digits() {
        // To 17 digits by another library of arbitrary precision.
        for (x, expected) in [
            (1e-100, -5e-201),
            (-1e-5, -5.000_033_333_583_335e-11),
            (0.1, -4.689_820_195_675_14e-3),
            (-0.1, -5.360_515_657_826_301e-3),
            (0.75, -1.903_842_120_645_773e-1),
            (-0.49, -1.833_445_532_637_655_6e-1),
            (-0.99, -3.615_170_185_988_091_4),
            (3.5, -1.995_922_603_223_726),
            (1e20, -1e20),
        ] {
            let error: f64 = (f64::log_1p_minus_x(x) - expected) / expected;
            assert!(error.abs() < 4.0 * f64::EPSILON, "{x}: {:e}", f64::log_1p_minus_x(x));
        }
        for n in -49..100 {
            let x = f64::from(n) * 0.01;
            let difference = x.log_1p_minus_x() - (x.log_1p() - x);
            assert!(difference.abs() < 2e-16, "{x}: {difference:e}");
        }
        assert_eq!(0.0_f64.log_1p_minus_x(), 0.0);
        assert_eq!((-1.0_f64).log_1p_minus_x(), f64::NEG_INFINITY);
        assert_eq!(f64::INFINITY.log_1p_minus_x(), f64::NEG_INFINITY);
        assert!(f64::NAN.log_1p_minus_x().is_nan() && (-1.5_f64).log_1p_minus_x().is_nan());
        assert_eq!(0.5_f32.log_1p_minus_x(), 0.5_f64.log_1p_minus_x() as f32);
    }

    #[test]
    fn the_logarithm_of_both_takes_the_one_that_has_the_digits() {
        let mut worst: f64 = 0.0;
        for n in 0..200_000 {
            let x = f64::from(n) * 1e-5;
            for x in [x - 0.5, 10.0 * x, x * 1e-9, -x * 1e-6] {
                assert_eq!(x.ln_of_both(f64::NAN), x.log_1p());
            }
            let y = (-350.0 * x - 0.7).exp();
            let expected = y.ln();
            if y > 0.0 {
                let error = ((y - 1.0).ln_of_both(y) - expected) / expected;
                worst = worst.max(error.abs() / f64::EPSILON);
            }
        }
        assert!(worst <= 1.5, "{worst} units in the last place");
        assert_eq!((-1.0_f64).ln_of_both(0.0), f64::NEG_INFINITY);
        assert!((-1.0_f64).ln_of_both(f64::NAN).is_nan() && (-1.0_f64).ln_of_both(-1e-9).is_nan());
        assert!(f64::NAN.ln_of_both(1.0).is_nan());
        assert_eq!((-0.75_f32).ln_of_both(0.25), 0.25_f32.ln());
    }

    #[test]
    fn near_one_the_short_logarithm_has_the_same_bits() {
        let mut near = 0;
        for n in 0..400_000 {
            let x = f64::from(n) * 5e-6 - 0.9;
            for x in [x, x * 1e-9] {
                if (-0.5..1.0).contains(&x) {
                    near += 1;
                    assert_eq!(x.ln_near_one().to_bits(), x.ln_of_both(f64::NAN).to_bits(), "{x}");
                } else {
                    assert!(x.ln_near_one().is_nan(), "{x}");
                }
            }
        }
        assert!((600_000..750_000).contains(&near), "{near}");
        assert_eq!(0.0_f64.ln_near_one().to_bits(), 0.0_f64.to_bits());
        assert!((-0.5_f64).ln_near_one() == -std::f64::consts::LN_2);
        assert!(1.0_f64.ln_near_one().is_nan() && (-0.5 - 1e-16_f64).ln_near_one().is_nan());
        assert!(f64::NAN.ln_near_one().is_nan() && f64::INFINITY.ln_near_one().is_nan());
        assert_eq!(0.25_f32.ln_near_one(), 0.25_f32.ln_of_both(1.25));
    }

    #[test]
    fn what_rounding_takes_is_exact_in_both_precisions() {
        // (1 + 2^-30)(1 - 2^-30) = 1 - 2^-60, and 1 + 2^-60 is one.
        let (a, b) = (1.0 + 2_f64.powi(-30), 1.0 - 2_f64.powi(-30));
        assert_eq!((a * b, a.product_error(b)), (1.0, -(2_f64.powi(-60))));
        assert_eq!(1.0_f64.sum_error(2_f64.powi(-60)), 2_f64.powi(-60));
        assert_eq!((-(2_f64.powi(-60))).sum_error(1.0), -(2_f64.powi(-60)));
        let (a, b) = (1.0 + 2_f32.powi(-15), 1.0 - 2_f32.powi(-15));
        assert_eq!((a * b, a.product_error(b)), (1.0, -(2_f32.powi(-30))));
        assert_eq!(1.0_f32.sum_error(2_f32.powi(-30)), 2_f32.powi(-30));
        // 3 x for x near 1e8: what is lost is a whole number of units of the last place of x.
        let x = 123_456_789.123_456_78_f64;
        assert_eq!(3.0.product_error(x), (x.sum_error(2.0 * x)));
    }

    #[test]
    fn positive_parts() {
        for (x, part, slope) in [
            (2.5, 2.5, 1.0),
            (-2.5, 0.0, 0.0),
            (0.0, 0.0, 0.0),
            (f64::INFINITY, f64::INFINITY, 1.0),
        ] {
            assert_eq!((x.positive_part(), x.positive_part_slope()), (part, slope), "{x}");
            let single = x as f32;
            assert_eq!(f64::from(single.positive_part()), part, "{x}");
            assert_eq!(f64::from(single.positive_part_slope()), slope, "{x}");
        }
        assert_eq!(f64::MIN_POSITIVE.positive_part_slope(), 1.0);
        assert_eq!((-0.0_f64).positive_part().to_bits(), 0.0_f64.to_bits());
        assert!(f64::NAN.positive_part().is_nan() && f64::NAN.positive_part_slope().is_nan());
        assert!(f32::NAN.positive_part().is_nan() && f32::NAN.positive_part_slope().is_nan());
    }

    #[test]
    fn hyperbolic_functions_of_roots_in_single_precision_are_rounded_once() {
        for y in [0.0_f32, 1e-9, 0.3, 8.0, 30.0, 1e3] {
            let wide = f64::from(y);
            assert_eq!(y.cosh_sqrt_m1(), wide.cosh_sqrt_m1() as f32);
            assert_eq!(y.cosh_sqrt_m1_slope(), wide.cosh_sqrt_m1_slope() as f32);
            assert_eq!(y.cosh_sqrt_m1_curvature(), wide.cosh_sqrt_m1_curvature() as f32);
        }
    }

    #[test]
    fn not_a_number_stays_so() {
        assert!(f64::NAN.sin_pi().is_nan());
        assert!(f64::INFINITY.cos_pi().is_nan());
    }
}
