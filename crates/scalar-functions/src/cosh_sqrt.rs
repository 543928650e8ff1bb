//! The hyperbolic cosine of a square root, less one, and what its derivatives are made of.
//!
//! In terms of `y` all are sums of powers with positive coefficients: `cosh(sqrt(y)) - 1 = sum_(k>=1) y^k/(2k)!`, and with
//! `s = sqrt(y)` twice its derivative is `sinh(s)/s = 1 + sum_(k>=1) y^k/(2k + 1)!`. None is large where `y` is small. Functions of
//! `y` from 0 on.

/// The series serve up to here; beyond, little cancels in the closed forms.
const LARGEST_IN_SERIES: f64 = 9.0;
/// As many terms leave out less than half a unit in the last place of a double there.
const TERMS: u32 = 16;
/// Beyond, the hyperbolic functions are no numbers, nor are halves of the digits that products are split into.
const LARGEST_ROOT: f64 = 1e3;

/// `1 + y/d(1) (1 + y/d(2) (1 + ...))`.
fn series(y: f64, divisor: impl Fn(f64) -> f64) -> f64 {
    (1..=TERMS).rev().fold(1.0, |sum, k| 1.0 + y * sum / divisor(f64::from(k)))
}

/// A root with its exponential.
struct Root {
    root: f64,
    exponential: f64,
    /// One over the exponential.
    inverse: f64,
}

impl Root {
    /// Root of `y` beyond [`LARGEST_IN_SERIES`].
    fn of(y: f64) -> Self {
        let root = y.sqrt();
        // What rounding takes from a large root is many units in the last place of its exponential. The square of its halves of 26
        // bits is exact.
        let lost = if root < LARGEST_ROOT {
            let scaled = root * 134_217_729.0;
            let high = scaled - (scaled - root);
            let low = root - high;
            let square = root * root;
            let error = ((high * high - square) + 2.0 * (high * low)) + low * low;
            ((y - square) - error) / (2.0 * root)
        } else {
            0.0
        };
        let exponential = root.exp() * (1.0 + lost);
        Self { root, exponential, inverse: 1.0 / exponential }
    }
}

pub(crate) fn minus_one(y: f64) -> f64 {
    if y.abs() <= LARGEST_IN_SERIES {
        return 0.5 * y * series(y, |k| (2.0 * k + 1.0) * (2.0 * k + 2.0));
    }
    let Root { exponential, inverse, .. } = Root::of(y);
    0.5 * (exponential + inverse) - 1.0
}

/// `sinh(s)/s - 1`, twice the derivative of [`minus_one`] less one.
pub(crate) fn slope(y: f64) -> f64 {
    if y.abs() <= LARGEST_IN_SERIES {
        return y * series(y, |k| (2.0 * k + 2.0) * (2.0 * k + 3.0)) / 6.0;
    }
    let Root { root, exponential, inverse } = Root::of(y);
    0.5 * (exponential - inverse) / root - 1.0
}

/// The derivative of [`slope`], `(cosh(s) - sinh(s)/s)/(2 y) = sum_(k>=1) k y^(k-1)/(2k + 1)!`.
pub(crate) fn curvature(y: f64) -> f64 {
    if y.abs() <= LARGEST_IN_SERIES {
        return series(y, |k| 2.0 * k * (2.0 * k + 3.0)) / 6.0;
    }
    let Root { root, exponential, inverse } = Root::of(y);
    let share = 1.0 / root;
    // exp(s) (1 - 1/s) + exp(-s) (1 + 1/s) is twice the numerator.
    0.25 * ((exponential * (1.0 - share) + inverse * (1.0 + share)) / y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y`, the value, the slope and the curvature there, from 80 digits (mpmath).
    const EXACT: [[f64; 4]; 12] = [
        [1e-30, 5e-31, 1.6666666666666669e-31, 0.16666666666666666],
        [1e-9, 5.000000000416667e-10, 1.6666666667500001e-10, 0.16666666668333333],
        [0.001, 0.0005000416680555804, 0.00016667500019841545, 0.16668333392858245],
        [0.1, 0.05041805803847211, 0.01675019868852229, 0.1683392967497491],
        [1.0, 0.5430806348152438, 0.17520119364380146, 0.18393972058572117],
        [4.0, 2.7621956910836314, 0.8134302039235094, 0.24359568589501526],
        [8.9, 8.901629375340077, 2.3020637790238534, 0.37076211215259675],
        [9.1, 9.235563615991218, 2.376824090492755, 0.37685382008233315],
        [30.0, 118.59318692388277, 20.833865407214518, 1.629322025277804],
        [777.7, 646039123981.6604, 23166091644.543495, 400458423.77338105],
        [1e4, 1.3440585709080678e+43, 1.3440585709080677e+41, 6.653089925994935e+38],
        [250000.0, 7.017961089264188e+216, 1.4035922178528375e+214, 1.4007850334171318e+211],
    ];

    #[test]
    fn few_roundings_are_lost() {
        for [y, expected_value, expected_slope, expected_curvature] in EXACT {
            for (found, expected) in [
                (minus_one(y), expected_value),
                (slope(y), expected_slope),
                (curvature(y), expected_curvature),
            ] {
                let roundings = (found / expected - 1.0).abs() / f64::EPSILON;
                assert!(roundings <= 4.0, "{y}: {found:e}, {expected:e}, {roundings}");
            }
        }
    }

    #[test]
    fn the_cosine_of_a_half_angle_says_the_same_at_every_size() {
        // cosh(s) - 1 = 2 sinh(s/2)^2, where s is a double with few digits, so that its square is exact.
        for n in 1..4000 {
            let s = f64::from(n) / 40.0 * 2_f64.powi(-(n % 3) * 9);
            let s = f64::from(s as f32);
            let y = s * s;
            let half = (0.5 * s).sinh();
            let close = |found: f64, expected: f64, bound: f64| {
                let roundings = (found / expected - 1.0).abs() / f64::EPSILON;
                assert!(roundings <= bound, "{s}: {found:e}, {expected:e}, {roundings}");
            };
            close(minus_one(y), 2.0 * half * half, 7.0);
            let sinh = s.sinh() / s;
            close(1.0 + slope(y), sinh, 4.0);
            if s > 1.0 {
                close(curvature(y), (s.cosh() - sinh) / (2.0 * y), 9.0);
            }
        }
    }

    #[test]
    fn slope_and_curvature_are_derivatives() {
        for y in [0.0, 1e-9, 0.01, 0.7, 3.0, 8.99, 9.0, 9.01, 30.0_f64] {
            let d = 1e-4;
            // By the power series to the left of zero.
            let by_difference = (minus_one(y + d) - minus_one(y - d)) / d - 1.0;
            assert!((slope(y) - by_difference).abs() < 1e-7 * (1.0 + slope(y)), "{y}");
            let by_difference = (slope(y + d) - slope(y - d)) / (2.0 * d);
            assert!((curvature(y) - by_difference).abs() < 1e-7 * (1.0 + curvature(y)), "{y}");
        }
        assert_eq!((minus_one(0.0), slope(0.0), curvature(0.0)), (0.0, 0.0, 1.0 / 6.0));
    }

    #[test]
    fn both_forms_agree_where_they_meet() {
        for f in [minus_one, slope, curvature] {
            let (below, above) = (f(9.0), f(9.0_f64.next_up()));
            assert!((below / above - 1.0).abs() < 2e-15, "{below:e} {above:e}");
        }
    }

    #[test]
    fn what_is_too_large_is_infinite_and_what_is_no_number_stays_so() {
        for f in [minus_one, slope, curvature] {
            for y in [6e5, 1e10, f64::MAX] {
                assert_eq!(f(y), f64::INFINITY, "{y:e}");
            }
            assert!(f(f64::NAN).is_nan() && f(-10.0).is_nan());
        }
        assert_eq!(minus_one(f64::INFINITY), f64::INFINITY);
    }
}
