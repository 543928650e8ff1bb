//! The natural logarithm without calls or branches, so that loops over many points or particles use vector instructions.
//!
//! Sums, products and quotients only, the same on every processor. Both the solver's law and generated code take it from here, as
//! they would take `ln` from the system's library; they share no formula of mechanics. Generated C headers have it as text
//! of their own, with the same bits.

/// `ln(1 + x)`, within one unit in the last place.
#[inline(always)]
#[must_use]
pub fn ln_1p(x: f64) -> f64 {
    logarithm::<true>(x, x, false)
}

/// `ln(y)`, within one unit in the last place.
#[inline(always)]
#[must_use]
pub fn ln(y: f64) -> f64 {
    logarithm::<true>(f64::NAN, y, true)
}

/// `ln(y)` of `y = 1 + x`, either of which may carry a rounding error: by `y` where `x < -1/2`, else by `x`. Within one and a
/// half units in the last place of the one that it takes.
#[inline(always)]
#[must_use]
pub fn ln_of_both(x: f64, y: f64) -> f64 {
    logarithm::<true>(x, y, x < -0.5)
}

/// [`ln_of_both`] for `y` from 1e-307 to 1e308, and whatever elsewhere.
#[inline(always)]
#[must_use]
pub fn ln_of_both_in_range(x: f64, y: f64) -> f64 {
    logarithm::<false>(x, y, x < -0.5)
}

/// Whether [`ln_near_one`] takes this `x`: from -1/2 to one, where no power of two is split off.
#[inline(always)]
#[must_use]
pub fn is_near_one(x: f64) -> bool {
    (-0.5..1.0).contains(&x)
}

/// [`ln_1p`] to the last bit for an `x` that [is near one](is_near_one), in half as many operations; whatever elsewhere.
#[inline(always)]
#[must_use]
pub fn ln_near_one(x: f64) -> f64 {
    let (half_square, tail) = parts_of_logarithm(x);
    x - (half_square - tail)
}

/// `ln(1 + x) - x`, within four units in the last place.
#[inline(always)]
#[must_use]
pub fn ln_1p_minus_x(x: f64) -> f64 {
    let (half_square, tail) = parts_of_logarithm(x);
    let far = if x == f64::INFINITY { f64::NEG_INFINITY } else { ln_1p(x) - x };
    if is_near_one(x) { tail - half_square } else { far }
}

/// `ln(y)` where `by_y`, else `ln(1 + x)`, and where `ALL`, of all numbers, else of those from 1e-307 to 1e308. Reduced as in
/// Sun's fdlibm, `s_log1p.c`, but for arguments near one, which are taken as they are.
#[inline(always)]
fn logarithm<const ALL: bool>(x: f64, y: f64, by_y: bool) -> f64 {
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// The bits of sqrt(1/2), to 32 bits.
    const ROOT_HALF: u64 = 0x3fe6_a09e_0000_0000;
    /// 2^52 as a double; with a whole number in its last bits it is 2^52 plus that number.
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    /// 2^52 + 1023.
    const WHOLE_ONE: f64 = 4_503_599_627_370_496.0 + 1023.0;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Smaller ones are multiplied by 2^54, so that their scale is a number.
    const TINY: f64 = 1e-290;
    const TWO_TO_54: f64 = 18_014_398_509_481_984.0;

    let sum = 1.0 + x;
    // What rounding took from the sum.
    let lost = x - (sum - 1.0);
    let (u, lost) = if by_y { (y, 0.0) } else { (sum, lost) };
    let (normal, bias) =
        if ALL && u < TINY { (u * TWO_TO_54, WHOLE_ONE + 54.0) } else { (u, WHOLE_ONE) };
    // u = 2^k m with m between sqrt(1/2) and sqrt(2).
    let exponent = normal.to_bits().wrapping_add(ONE - ROOT_HALF) >> 52;
    let k = f64::from_bits(exponent | WHOLE) - bias;
    // 2^(2 - k), which is a normal number for the largest k as well.
    let scale = f64::from_bits(2048_u64.wrapping_sub(exponent) << 52);
    // m - 1, with the digits that the sum has lost.
    let reduced = 0.25 * ((normal * scale - 4.0) + lost * scale);
    let near = is_near_one(x);
    let f = if near { x } else { reduced };
    let (half_square, tail) = parts_of_logarithm(f);
    let value = k * LN2_HIGH - (((half_square - tail) - k * LN2_LOW) - f);
    let value = if ALL {
        let pole = if u == 0.0 { f64::NEG_INFINITY } else { f64::NAN };
        let outside = if u > 0.0 { u } else { pole };
        if u > 0.0 && u < f64::INFINITY { value } else { outside }
    } else {
        value
    };
    if near { f - (half_square - tail) } else { value }
}

/// `h = f^2/2` and `t` with `ln(1 + f) = f - (h - t)`, for f from -1/2 to 1.
///
/// `t = s (h + R)` with `s = f/(2 + f)` as in fdlibm. R is the polynomial of degree ten in `z = s^2` next to `2 artanh(s)/s - 2`
/// for z up to 1/9 (E. Ya. Remez's exchange, in 60 digits): it changes the logarithm by 1.3e-18 of itself at most.
#[inline(always)]
fn parts_of_logarithm(f: f64) -> (f64, f64) {
    let s = f / (2.0 + f);
    let z = s * s;
    let square = z * z;
    let fourth = square * square;
    let a = 6.666_666_666_666_631e-1 + z * 4.000_000_000_015_726_5e-1;
    let b = 2.857_142_854_785_134e-1 + z * 2.222_222_396_988_407e-1;
    let c = 1.818_174_391_978_506e-1 + z * 1.538_656_002_655_927e-1;
    let d = 1.330_097_230_861_173_6e-1 + z * 1.210_609_573_668_486_5e-1;
    let e = 8.340_062_622_941_338e-2 + z * 1.701_864_305_551_780_7e-1;
    let R = z * ((a + square * b) + fourth * ((c + square * d) + fourth * e));
    let half_square = 0.5 * f * f;
    (half_square, s * (half_square + R))
}

#[cfg(test)]
mod tests {
    use super::{is_near_one, ln, ln_near_one, ln_of_both, ln_of_both_in_range};

    /// Distance in units in the last place of the value expected.
    fn ulps(found: f64, expected: f64) -> f64 {
        (found - expected).abs() / (expected.abs() * f64::EPSILON).max(f64::MIN_POSITIVE)
    }

    #[test]
    fn the_plain_logarithm_is_within_an_ulp_of_the_library_function() {
        let mut worst: f64 = 0.0;
        for n in 1..200_000 {
            let x = f64::from(n) * 1e-5;
            for y in [x, 1.0 + 1e-6 * x, 1.0 - 1e-6 * x, (700.0 * x - 700.0).exp(), 1e-310 * x] {
                worst = worst.max(ulps(ln(y), y.ln()));
            }
        }
        assert!(worst <= 1.0, "{worst} units in the last place");
        assert_eq!((ln(1.0), ln(0.0), ln(f64::INFINITY)), (0.0, f64::NEG_INFINITY, f64::INFINITY));
        assert!(ln(-1.0).is_nan() && ln(f64::NAN).is_nan());
    }

    #[test]
    fn within_an_ulp_of_the_library_function_over_the_whole_range() {
        let mut worst: f64 = 0.0;
        for n in 0..200_000 {
            let x = f64::from(n) * 1e-5;
            // The second argument must not matter where the first has the digits, nor the first where it has not.
            for growth in [x - 0.5, 10.0 * x, x * 1e-6, -x * 1e-6, (50.0 * x - 50.0).exp()] {
                worst = worst.max(ulps(ln_of_both_in_range(growth, f64::NAN), growth.ln_1p()));
            }
            let ratio = (-100.0 * x - 0.7).exp();
            worst = worst.max(ulps(ln_of_both_in_range(ratio - 1.0, ratio), ratio.ln()));
        }
        assert!(worst <= 1.5, "{worst} units in the last place");
    }

    #[test]
    fn near_one_the_short_form_has_the_same_bits() {
        let mut near = 0;
        for n in 0..400_000 {
            let growth = f64::from(n) * 5e-6 - 1.0;
            for growth in [growth, growth * 1e-9] {
                assert_eq!(is_near_one(growth), (-0.5..1.0).contains(&growth), "{growth}");
                if is_near_one(growth) {
                    near += 1;
                    let long = ln_of_both_in_range(growth, f64::NAN);
                    assert_eq!(ln_near_one(growth).to_bits(), long.to_bits(), "{growth}");
                }
            }
        }
        assert!(near > 600_000);
        assert!(!is_near_one(f64::NAN));
    }

    #[test]
    fn exact_where_nothing_is_to_be_computed() {
        assert_eq!(ln_of_both_in_range(0.0, 1.0), 0.0);
        for tiny in [1e-20, -1e-20, 1e-300, f64::MIN_POSITIVE] {
            assert_eq!(ln_of_both_in_range(tiny, 1.0), tiny);
        }
        assert_eq!(ln_of_both_in_range(1.0, 2.0), std::f64::consts::LN_2);
        assert!(ln_of_both_in_range(f64::NAN, f64::NAN).is_nan());
    }

    #[test]
    fn in_range_both_forms_have_the_same_bits() {
        for n in 0..400_000 {
            let y = (f64::from(n) * 3.5e-3 - 700.0).exp();
            let (x, in_range) = (y - 1.0, (1e-307..1e308).contains(&y));
            let same = ln_of_both(x, y).to_bits() == ln_of_both_in_range(x, y).to_bits();
            assert!(same || !in_range, "{y:e}");
        }
    }
}
