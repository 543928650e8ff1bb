//! The logarithm of J, without calls or branches, so that loops over many particles use vector instructions.

/// The bits of sqrt(1/2), to 32 bits.
const ROOT_HALF: u64 = 0x3fe6_a09e_0000_0000;

/// `ln(ratio)` for `growth = ratio - 1`, either of which may carry a rounding error; finite `ratio > 0`, else whatever.
///
/// Within one unit in the last place of the logarithm of the one that states it better: `growth` down to -1/2, below that
/// `ratio`. Sums, products and quotients only, the same on every processor. The polynomial and the reduction are those of
/// Sun's fdlibm, `s_log1p.c`.
#[inline(always)]
pub(super) fn log_of_ratio(growth: f64, ratio: f64) -> f64 {
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    /// 2^52 as a double; with a whole number in its last bits it is 2^52 plus that number.
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

    let near_zero = growth < -0.5;
    let sum = 1.0 + growth;
    // What rounding took from the sum.
    let lost = growth - (sum - 1.0);
    let (u, lost) = if near_zero { (ratio, 0.0) } else { (sum, lost) };
    // u = 2^k m with m between sqrt(1/2) and sqrt(2).
    let exponent = u.to_bits().wrapping_add(ONE - ROOT_HALF) >> 52;
    let k = f64::from_bits(exponent | WHOLE) - (4_503_599_627_370_496.0 + 1023.0);
    // 2^(1 - k), a normal number for k up to 1022.
    let scale = f64::from_bits(2047_u64.wrapping_sub(exponent) << 52);
    // m - 1 with the digits that the sum has lost; growth itself if k = 0.
    let f = 0.5 * ((u * scale - 2.0) + lost * scale);
    let (half_square, tail) = parts_of_log(f);
    k * LN2_HIGH - ((half_square - (tail + k * LN2_LOW)) - f)
}

/// Whether [`log_near_one`] takes this growth: 1 + growth between sqrt(1/2) and sqrt(2), where no power of two has to be
/// split off.
#[inline(always)]
pub(super) fn is_near_one(growth: f64) -> bool {
    let sum = 1.0 + growth;
    (sum >= f64::from_bits(ROOT_HALF)) & (sum < f64::from_bits(ROOT_HALF + (1 << 52)))
}

/// `log_of_ratio(growth, 1 + growth)` to the last bit for a growth that [is near one](is_near_one), in half as many
/// operations.
#[inline(always)]
pub(super) fn log_near_one(growth: f64) -> f64 {
    let (half_square, tail) = parts_of_log(growth);
    0.0 - ((half_square - tail) - growth)
}

/// `h = f^2/2` and `t` with `ln(1 + f) = f - (h - t)`, for 1 + f between sqrt(1/2) and sqrt(2).
#[inline(always)]
fn parts_of_log(f: f64) -> (f64, f64) {
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w
        * (3.999_999_999_940_942e-1
            + w * (2.222_219_843_214_978_4e-1 + w * 1.531_383_769_920_937_3e-1));
    let odd = z
        * (6.666_666_666_666_735e-1
            + w * (2.857_142_874_366_239e-1
                + w * (1.818_357_216_161_805e-1 + w * 1.479_819_860_511_658_6e-1)));
    let half_square = 0.5 * f * f;
    (half_square, s * (half_square + (even + odd)))
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
                let k = (1.0 + growth) / f64::from_bits(super::ROOT_HALF);
                assert_eq!(is_near_one(growth), (1.0..2.0).contains(&k), "{growth}");
                if is_near_one(growth) {
                    near += 1;
                    let long = log_of_ratio(growth, f64::NAN);
                    assert_eq!(log_near_one(growth).to_bits(), long.to_bits(), "{growth}");
                }
            }
        }
        assert!(near > 400_000);
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
