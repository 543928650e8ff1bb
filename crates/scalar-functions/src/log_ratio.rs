//! The logarithm of the ratio of two stretches, and what its square's derivatives are made of.
//!
//! With `theta = arcosh(1 + z)` and `y = z/(z + 2) = tanh(theta/2)^2`,
//! `theta/sinh(theta) = (1 - y) sum_k y^k/(2k + 1)`, so that
//! `theta/sinh(theta) - 1 = -sum_(k>=1) 2 y^k/(4k^2 - 1)`: all terms have one sign, and none is large where `z` is small.

/// The series in `y = z/(z + 2)` serves up to here; beyond, little cancels in the closed form.
const LARGEST_IN_SERIES: f64 = 0.25;
/// As many terms leave out less than half a unit in the last place of a double there.
const TERMS: u32 = 24;

/// `arcosh(1 + z)`, for every finite `z` from 0 on.
fn logarithm(z: f64) -> f64 {
    if z + 2.0 == z {
        // ln(2 z), whose argument may be beyond the largest number.
        return z.ln() + std::f64::consts::LN_2;
    }
    (z + hyperbolic_sine(z)).ln_1p()
}

/// `sinh(arcosh(1 + z)) = sqrt(z (z + 2))`, for every finite `z` from 0 on.
fn hyperbolic_sine(z: f64) -> f64 {
    let sum = z + 2.0;
    // The square of so large a number may be beyond the largest one.
    if sum == z { z } else { (z * sum).sqrt() }
}

pub(crate) fn squared(z: f64) -> f64 {
    let theta = logarithm(z);
    theta * theta
}

/// `theta/sinh(theta) - 1`.
pub(crate) fn slope(z: f64) -> f64 {
    let y = z / (z + 2.0);
    if y > LARGEST_IN_SERIES {
        return logarithm(z) / hyperbolic_sine(z) - 1.0;
    }
    let sum = (1..=TERMS).rev().fold(0.0, |sum, k| {
        let k = f64::from(k);
        sum * y + 2.0 / (4.0 * k * k - 1.0)
    });
    -sum * y
}

/// The derivative of [`slope`], with `dy/dz = (1 - y)^2/2`.
pub(crate) fn curvature(z: f64) -> f64 {
    let y = z / (z + 2.0);
    if y > LARGEST_IN_SERIES {
        // theta coth(theta) - 1, in which nothing cancels, over sinh(theta)^2, whose parts stay within the range.
        let numerator = logarithm(z) * ((1.0 + z) / hyperbolic_sine(z)) - 1.0;
        return -(numerator / z) / (z + 2.0);
    }
    let sum = (1..=TERMS).rev().fold(0.0, |sum, k| {
        let k = f64::from(k);
        sum * y + k / (4.0 * k * k - 1.0)
    });
    -sum * ((1.0 - y) * (1.0 - y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_of_the_ratio_of_two_stretches() {
        for (a, b) in [(1.0, 1.0), (1.1, 1.0), (0.2, 3.0), (1.0, 1e-6)] {
            let (a, b): (f64, f64) = (a, b);
            let z = (a - b) * (a - b) / (2.0 * a * b);
            let expected = (a / b).ln().powi(2);
            assert!((squared(z) - expected).abs() <= 1e-14 * expected, "{a} {b}");
        }
    }

    #[test]
    fn slope_and_curvature_are_derivatives() {
        for z in [0.0, 1e-9, 0.01, 0.6, 0.66, 0.67, 1.0, 30.0_f64] {
            let d = 1e-4 * (1.0 + z);
            let from = |z: f64| {
                // By the power series to the left of zero.
                if z < 0.0 { 2.0 * z - z * z / 3.0 + 4.0 * z * z * z / 45.0 } else { squared(z) }
            };
            let slope_by_difference = (from(z + d) - from(z - d)) / (2.0 * d);
            assert!((2.0 * (1.0 + slope(z)) - slope_by_difference).abs() < 1e-7, "{z}");
            let curvature_by_difference = (slope(z + d) - slope(z)) / d;
            assert!((curvature(z + 0.5 * d) - curvature_by_difference).abs() < 1e-7, "{z}");
        }
        assert_eq!(curvature(0.0), -1.0 / 3.0);
    }

    /// `z`, the squared logarithm, the slope and the curvature there, from 60 digits (mpmath).
    const EXACT: [[f64; 4]; 11] = [
        [1e-30, 2e-30, -3.3333333333333338e-31, -0.3333333333333333],
        [1e-09, 1.9999999996666666e-09, -3.333333332e-10, -0.3333333330666667],
        [0.001, 0.0019996667555269945, -0.00033320005711747185, -0.3330668379937085],
        [0.1, 0.19675279629825826, -0.03205471352418188, -0.3082848339209521],
        [0.5, 0.9262592823087775, -0.13918211807199193, -0.2329814583136097],
        [0.66, 1.1959534937243819, -0.17463820918365391, -0.21081144495052093],
        [0.67, 1.2124396909145523, -0.1767399510294059, -0.20953898025652196],
        [1.0, 1.7343781022726361, -0.23965400369905365, -0.17356399753396423],
        [3.0, 4.257772537292302, -0.46722283974802986, -0.07540724273385871],
        [30.0, 17.03109014916921, -0.8668057099370075, -0.003259398949950801],
        [1e6, 210.50117839093343, -0.9999854913557701, -1.3508631721267281e-11],
    ];

    #[test]
    fn few_roundings_are_lost() {
        for [z, expected_square, expected_slope, expected_curvature] in EXACT {
            let roundings =
                |found: f64, expected: f64| (found / expected - 1.0).abs() / f64::EPSILON;
            assert!(roundings(squared(z), expected_square) <= 2.0, "{z}");
            assert!(
                roundings(slope(z), expected_slope) <= 4.0,
                "{z}: {}",
                roundings(slope(z), expected_slope)
            );
            // Of the curvature the absolute error counts where it is small, but it keeps most digits.
            let lost = roundings(curvature(z), expected_curvature);
            assert!(lost <= if z < 100.0 { 10.0 } else { 1e6 }, "{z}: {lost}");
        }
    }

    #[test]
    fn both_forms_agree_where_they_meet() {
        let z = 2.0 / 3.0;
        for f in [slope, curvature] {
            let (below, above) = (f(z * (1.0 - 1e-15)), f(z * (1.0 + 1e-15)));
            assert!((below / above - 1.0).abs() < 4e-15, "{below:e} {above:e}");
        }
    }
}
