//! Sine, cosine and exponential without the system's library, so that all systems give the same bits.
//!
//! Reduction and coefficients are those of Sun's fdlibm (`e_rem_pio2.c`, `k_sin.c`, `k_cos.c`, `e_exp.c`), whose approximations are
//! within one unit in the last place. Generated code in other languages has these functions as text of its own, with the same bits.

use crate::ScalarFunctions;

/// A whole number of right angles times the parts of pi/2 is exact for angles up to here.
const LARGEST_ANGLE: f64 = 1e6;
/// Angles beyond, whose last digit is a hundredth, are left to the crate `libm`.
const FARTHEST_ANGLE: f64 = 3e13;
/// Adding it and taking it away rounds to a whole number.
const SHIFT: f64 = 1.5 * 4_503_599_627_370_496.0;
/// The largest number whose exponential is finite.
const LARGEST_EXPONENT: f64 = 709.782_712_893_384;
/// The least number whose exponential is not zero.
const LEAST_EXPONENT: f64 = -745.133_219_101_941_2;

/// `sin(x)` of an angle in radians, within one unit in the last place, and beyond a million within 1e-18 besides.
#[inline]
pub(crate) fn sine(x: f64) -> f64 {
    match Angle::of(x) {
        Some(angle) => angle.sine_and_quarters(0),
        None => libm::sin(x),
    }
}

/// `cos(x)`, as [`sine`].
#[inline]
pub(crate) fn cosine(x: f64) -> f64 {
    match Angle::of(x) {
        Some(angle) => angle.sine_and_quarters(1),
        None => libm::cos(x),
    }
}

/// [`sine`] to the last bit, without a branch, of angles up to [`LARGEST_ANGLE`]; not a number beyond.
#[inline(always)]
pub(crate) fn sine_in_range(x: f64) -> f64 {
    let value = Angle::reduced(x).sine_and_quarters(0);
    if x.abs() <= LARGEST_ANGLE { value } else { f64::NAN }
}

/// [`cosine`], as [`sine_in_range`].
#[inline(always)]
pub(crate) fn cosine_in_range(x: f64) -> f64 {
    let value = Angle::reduced(x).sine_and_quarters(1);
    if x.abs() <= LARGEST_ANGLE { value } else { f64::NAN }
}

/// An angle as right angles and the rest.
struct Angle {
    /// The number of right angles, in the last two bits.
    quarters: u64,
    /// The rest, of at most pi/4.
    rest: f64,
    /// The digits that `rest` lacks.
    tail: f64,
}

impl Angle {
    /// Reduces angles; `None` of what is too far, or no number.
    #[inline]
    fn of(x: f64) -> Option<Self> {
        if x.abs() <= LARGEST_ANGLE {
            Some(Self::reduced(x))
        } else if x.abs() <= FARTHEST_ANGLE {
            Some(Self::reduced_from_far(x))
        } else {
            None
        }
    }

    /// Reduces angles up to [`FARTHEST_ANGLE`], with pi/2 in two doubles.
    #[inline(never)]
    fn reduced_from_far(x: f64) -> Self {
        const REST: f64 = 6.123_233_995_736_766e-17;
        let shifted = x * std::f64::consts::FRAC_2_PI + SHIFT;
        let n = shifted - SHIFT;
        let first = x - n * std::f64::consts::FRAC_PI_2;
        let lost = n.product_error(std::f64::consts::FRAC_PI_2) + n * REST;
        Self { quarters: shifted.to_bits(), rest: first - lost, tail: first.sum_error(-lost) }
    }

    /// Reduces angles up to [`LARGEST_ANGLE`].
    #[inline(always)]
    fn reduced(x: f64) -> Self {
        // pi/2 in parts of 33, 33 and 53 bits.
        const FIRST: f64 = 1.570_796_326_734_125_6;
        const SECOND: f64 = 6.077_100_506_303_966e-11;
        const THIRD: f64 = 2.022_266_248_795_950_6e-21;
        let shifted = x * std::f64::consts::FRAC_2_PI + SHIFT;
        let n = shifted - SHIFT;
        let first = x - n * FIRST;
        let second = n * SECOND;
        let difference = first - second;
        let part = difference - first;
        let lost = (first - (difference - part)) - (second + part);
        let low = lost - n * THIRD;
        let rest = difference + low;
        let tail = (difference - rest) + low;
        // Small angles as they are, also the zero with a sign.
        let (rest, tail) = if n == 0.0 { (x, 0.0) } else { (rest, tail) };
        Self { quarters: shifted.to_bits(), rest, tail }
    }

    /// The sine of the angle and `more` right angles.
    #[inline(always)]
    fn sine_and_quarters(&self, more: u64) -> f64 {
        let quarters = self.quarters.wrapping_add(more);
        let value = if quarters & 1 == 0 { self.sine_of_rest() } else { self.cosine_of_rest() };
        if quarters & 2 == 0 { value } else { -value }
    }

    #[inline(always)]
    fn sine_of_rest(&self) -> f64 {
        let Self { rest, tail, .. } = *self;
        let z = rest * rest;
        let low = 8.333_333_333_322_49e-3
            + z * (-1.984_126_982_985_795e-4 + z * 2.755_731_370_707_007e-6);
        let high = -2.505_076_025_340_686_3e-8 + z * 1.589_690_995_211_55e-10;
        let polynomial = low + z * (z * z) * high;
        let cube = z * rest;
        rest - ((z * (0.5 * tail - cube * polynomial) - tail) - cube * -1.666_666_666_666_663_2e-1)
    }

    #[inline(always)]
    fn cosine_of_rest(&self) -> f64 {
        let Self { rest, tail, .. } = *self;
        let z = rest * rest;
        let square = z * z;
        let low = z
            * (4.166_666_666_666_66e-2
                + z * (-1.388_888_888_887_411e-3 + z * 2.480_158_728_947_673e-5));
        let high = -2.755_731_435_139_066_3e-7
            + z * (2.087_572_321_298_175e-9 + z * -1.135_964_755_778_819_5e-11);
        let polynomial = low + square * square * high;
        let half = 0.5 * z;
        let most = 1.0 - half;
        most + (((1.0 - most) - half) + (z * polynomial - rest * tail))
    }
}

/// `exp(x)`, within one unit in the last place.
#[inline(always)]
pub(crate) fn exponential(x: f64) -> f64 {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let shifted = x * std::f64::consts::LOG2_E + SHIFT;
    let k = shifted - SHIFT;
    let high = x - k * LN2_HIGH;
    let low = k * LN2_LOW;
    let rest = high - low;
    let z = rest * rest;
    let polynomial = z
        * (1.666_666_666_666_660_2e-1
            + z * (-2.777_777_777_701_559_3e-3
                + z * (6.613_756_321_437_934e-5
                    + z * (-1.653_390_220_546_525_2e-6 + z * 4.138_136_797_057_238_5e-8))));
    let c = rest - polynomial;
    let value = 1.0 - ((low - rest * c / (2.0 - c)) - high);
    // In two steps, each of which is a power of two among the normal numbers.
    let half = (0.5 * k + SHIFT) - SHIFT;
    let scaled = value * power_of_two(half) * power_of_two(k - half);
    let low_end = if x < LEAST_EXPONENT { 0.0 } else { scaled };
    if x > LARGEST_EXPONENT { f64::INFINITY } else { low_end }
}

/// `2^k` for a whole number `k` from -1022 to 1023; whatever elsewhere.
#[inline(always)]
fn power_of_two(k: f64) -> f64 {
    // The last bits of the sum are those of the biased exponent.
    f64::from_bits((k + (SHIFT + 1023.0)).to_bits() << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// The largest distance from `expected`, in units in the last place, over `arguments`.
    fn worst(
        found: fn(f64) -> f64,
        expected: fn(f64) -> f64,
        arguments: impl Iterator<Item = f64>,
    ) -> f64 {
        arguments
            .map(|x| {
                (found(x) - expected(x)).abs() / (expected(x).abs() * f64::EPSILON).max(1e-323)
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn values_are_within_a_unit_of_the_library_functions() {
        let over =
            |scale: f64| (-100_000..=100_000).map(move |n| f64::from(n) * 1.000_001e-5 * scale);
        for scale in [1e-6, 0.1, 1.0, 10.0, 1e3, 9.9e5] {
            let sines = worst(sine, f64::sin, over(scale));
            let cosines = worst(cosine, f64::cos, over(scale));
            assert!(sines <= 1.0 && cosines <= 1.0, "{scale}: {sines}, {cosines}");
        }
        // Multiples of right angles, where the reduction cancels most.
        let angles = || (1..600_000).map(|n| f64::from(n) * (0.5 * PI));
        assert!(worst(sine, f64::sin, angles()) <= 1.0 && worst(cosine, f64::cos, angles()) <= 1.0);
        for scale in [1e-6, 1.0, 30.0, 708.0] {
            let exponentials = worst(exponential, f64::exp, over(scale));
            assert!(exponentials <= 1.0, "{scale}: {exponentials}");
        }
    }

    #[test]
    fn forms_in_range_have_the_same_bits_or_are_no_numbers() {
        for n in -3_000..3_000 {
            let x = f64::from(n) * 0.731 * f64::from(n).abs().max(1.0);
            let near = x.abs() <= LARGEST_ANGLE;
            let same = |found: f64, expected: f64| match near {
                true => found.to_bits() == expected.to_bits(),
                false => found.is_nan(),
            };
            assert!(same(sine_in_range(x), sine(x)) && same(cosine_in_range(x), cosine(x)), "{x}");
        }
        assert!(sine_in_range(f64::INFINITY).is_nan() && cosine_in_range(f64::NAN).is_nan());
    }

    #[test]
    fn the_ends_of_the_range_are_those_of_the_library_functions() {
        for x in [1e7, -3e9, 1e22, f64::MAX] {
            assert!(
                (sine(x) - x.sin()).abs() < 1e-15 && (cosine(x) - x.cos()).abs() < 1e-15,
                "{x}"
            );
        }
        // Angles that are reduced from far, and farther ones.
        for n in 0..20_000 {
            let x = 1e6 * (1.0 + 1e-3 * f64::from(n)).powi(5);
            for x in [x, -x, f64::MAX / x] {
                let (of_sine, of_cosine) = (sine(x) - x.sin(), cosine(x) - x.cos());
                assert!(of_sine.abs() < 1.2e-16 && of_cosine.abs() < 1.2e-16, "{x}");
            }
        }
        assert!(
            sine(f64::INFINITY).is_nan()
                && cosine(f64::NAN).is_nan()
                && exponential(f64::NAN).is_nan()
        );
        assert_eq!(sine(-0.0).to_bits(), (-0.0_f64).to_bits());
        assert_eq!((sine(1e-300), cosine(1e-300), exponential(1e-300)), (1e-300, 1.0, 1.0));
        for x in
            [LARGEST_EXPONENT, 709.79, f64::INFINITY, f64::NEG_INFINITY, -746.0, LEAST_EXPONENT]
        {
            assert_eq!(exponential(x), x.exp(), "{x}");
        }
        // Below the normal numbers a value has the digits that are left there.
        for n in 0..3_700 {
            let x = -708.0 - f64::from(n) * 0.01;
            assert!((exponential(x) - x.exp()).abs() <= 5e-324, "{x}");
        }
    }
}
