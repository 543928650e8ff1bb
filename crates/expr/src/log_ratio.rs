//! The logarithm of the ratio of two stretches, and what its square's derivatives are made of.
//!
//! With `theta = arcosh(1 + z)` and `y = z/(z + 2) = tanh(theta/2)^2`,
//! `theta/sinh(theta) = (1 - y) sum_k y^k/(2k + 1)`, so that
//! `theta/sinh(theta) - 1 = -sum_(k>=1) 2 y^k/(4k^2 - 1)`: all terms have one sign, and none is large where `z` is small.

/// The series serves up to here; beyond, little cancels in the closed form.
const LARGEST_IN_SERIES: f64 = 0.25;
/// As many terms leave out less than half a unit in the last place at [`LARGEST_IN_SERIES`].
const TERMS: u32 = 24;

/// `arcosh(1 + z)`.
fn logarithm(z: f64) -> f64 {
    (z + (z * (z + 2.0)).sqrt()).ln_1p()
}

pub(crate) fn squared(z: f64) -> f64 {
    let theta = logarithm(z);
    theta * theta
}

/// `theta/sinh(theta) - 1`.
pub(crate) fn slope(z: f64) -> f64 {
    let y = z / (z + 2.0);
    if y > LARGEST_IN_SERIES {
        return logarithm(z) / (z * (z + 2.0)).sqrt() - 1.0;
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
        return -(z + (1.0 + z) * slope(z)) / (z * (z + 2.0));
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

    #[test]
    fn both_forms_agree_where_they_meet() {
        let z = 2.0 / 3.0;
        for f in [slope, curvature] {
            let (below, above) = (f(z * (1.0 - 1e-15)), f(z * (1.0 + 1e-15)));
            assert!((below / above - 1.0).abs() < 4e-15, "{below:e} {above:e}");
        }
    }
}
