//! The logarithm of J, without calls or branches, so that loops over many particles use vector instructions.

/// `ln(ratio)` for `growth = ratio - 1`, either of which may carry a rounding error; `ratio` from 1e-307 to 1e308, else
/// whatever.
///
/// Within one unit in the last place of the logarithm of the one that states it better: `growth` down to -1/2, below that
/// `ratio`. Sums, products and quotients only, the same on every processor. Reduced as in Sun's fdlibm, `s_log1p.c`, but for
/// ratios near one, which are taken as they are.
#[inline(always)]
pub(super) fn log_of_ratio(growth: f64, ratio: f64) -> f64 {
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// The bits of sqrt(1/2), to 32 bits.
    const ROOT_HALF: u64 = 0x3fe6_a09e_0000_0000;
    /// 2^52 as a double; with a whole number in its last bits it is 2^52 plus that number.
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

    let near_zero = growth < -0.5;
    let sum = 1.0 + growth;
    // The rounding error of the sum.
    let lost = growth - (sum - 1.0);
    let (u, lost) = if near_zero { (ratio, 0.0) } else { (sum, lost) };
    // u = 2^k m with m between sqrt(1/2) and sqrt(2).
    let exponent = u.to_bits().wrapping_add(ONE - ROOT_HALF) >> 52;
    let k = f64::from_bits(exponent | WHOLE) - (4_503_599_627_370_496.0 + 1023.0);
    // 2^(1 - k), a normal number for k up to 1022.
    let scale = f64::from_bits(2047_u64.wrapping_sub(exponent) << 52);
    // m - 1, with the digits that the sum has lost.
    let reduced = 0.5 * ((u * scale - 2.0) + lost * scale);
    let near = is_near_one(growth);
    let f = if near { growth } else { reduced };
    let (half_square, tail) = parts_of_log(f);
    if near {
        f - (half_square - tail)
    } else {
        k * LN2_HIGH - (((half_square - tail) - k * LN2_LOW) - f)
    }
}

/// Whether [`log_near_one`] takes this growth: from -1/2 to one, where no power of two is split off.
#[inline(always)]
pub(super) fn is_near_one(growth: f64) -> bool {
    (-0.5..1.0).contains(&growth)
}

/// `log_of_ratio(growth, 1 + growth)` to the last bit for a growth that [is near one](is_near_one), in half as many
/// operations.
#[inline(always)]
pub(super) fn log_near_one(growth: f64) -> f64 {
    let (half_square, tail) = parts_of_log(growth);
    growth - (half_square - tail)
}

/// `h = f^2/2` and `t` with `ln(1 + f) = f - (h - t)`, for f from -1/2 to 1.
///
/// `t = s (h + R)` with `s = f/(2 + f)` as in fdlibm. R is the polynomial of degree ten in `z = s^2` next to `2 artanh(s)/s - 2`
/// for z up to 1/9 (E. Ya. Remez's exchange, in 60 digits): it changes the logarithm by 1.3e-18 of itself at most.
#[inline(always)]
fn parts_of_log(f: f64) -> (f64, f64) {
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
    use super::{is_near_one, log_near_one, log_of_ratio};

    /// Distance in units in the last place of the value expected.
    fn ulps(found: f64, expected: f64) -> f64 {
        (found - expected).abs() / (expected.abs() * f64::EPSILON).max(f64::MIN_POSITIVE)
    }

    #[test]
    fn within_an_ulp_of_the_library_function_over_the_whole_range() {
        let mut worst: f64 = 0.0;
        for n in 0..200_000 {
            let x = f64::from(n) * 1e-5;
            // The second argument must not matter where the first has the digits, nor the first where it has not.
            for growth in [x - 0.5, 10.0 * x, x * 1e-6, -x * 1e-6, (50.0 * x - 50.0).exp()] {
                worst = worst.max(ulps(log_of_ratio(growth, f64::NAN), growth.ln_1p()));
            }
            let ratio = (-100.0 * x - 0.7).exp();
            worst = worst.max(ulps(log_of_ratio(ratio - 1.0, ratio), ratio.ln()));
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
                    let long = log_of_ratio(growth, f64::NAN);
                    assert_eq!(log_near_one(growth).to_bits(), long.to_bits(), "{growth}");
                }
            }
        }
        assert!(near > 600_000);
        assert!(!is_near_one(f64::NAN));
    }

    #[test]
    fn exact_where_nothing_is_to_be_computed() {
        assert_eq!(log_of_ratio(0.0, 1.0), 0.0);
        for tiny in [1e-20, -1e-20, 1e-300, f64::MIN_POSITIVE] {
            assert_eq!(log_of_ratio(tiny, 1.0), tiny);
        }
        assert_eq!(log_of_ratio(1.0, 2.0), std::f64::consts::LN_2);
        assert!(log_of_ratio(f64::NAN, f64::NAN).is_nan());
    }
}
