//! Derivatives by extrapolated central differences, with an estimate of their own error.
//!
//! Central differences with a decreasing sequence of steps are extrapolated to step zero in a Neville tableau;
//! the entry with the smallest error estimate wins. C. J. F. Ridders, "Accurate computation of F'(x) and
//! F'(x) F''(x)", Advances in Engineering Software 4 (1982) 75-76.

use nalgebra::SMatrix;

/// Ratio of successive steps.
const RATIO: f64 = 1.6;
/// Number of steps tried: from the reach down to a seventieth of it.
const STEPS: usize = 10;

/// A derivative and how far off it may be.
pub(crate) struct Derivative<const R: usize, const C: usize> {
    pub(crate) value: SMatrix<f64, R, C>,
    /// Estimated error of the largest entry: that of the extrapolation and that of rounding.
    pub(crate) error: f64,
}

/// The derivative of `f` at `x` from values no further away than `reach`.
pub(crate) fn derivative<const R: usize, const C: usize>(
    f: impl Fn(f64) -> SMatrix<f64, R, C>,
    x: f64,
    reach: f64,
) -> Derivative<R, C> {
    let mut best = Derivative { value: SMatrix::repeat(f64::NAN), error: f64::INFINITY };
    let mut previous: Vec<SMatrix<f64, R, C>> = Vec::with_capacity(STEPS);
    let mut step = reach;
    for _ in 0..STEPS {
        let (above, below) = (x + step, x - step);
        let (f_above, f_below) = (f(above), f(below));
        // x +- step is rounded: divide by the distance that was really taken.
        let width = above - below;
        let mut row = Vec::with_capacity(STEPS);
        row.push((f_above - f_below) / width);
        // Rounding of f itself, which extrapolation amplifies by a factor near 2 for this ratio.
        let rounding = 4.0 * f64::EPSILON * f_above.amax().max(f_below.amax()) / width;
        let mut factor = 1.0;
        for column in 1..=previous.len() {
            factor *= RATIO * RATIO;
            let (finer, coarser) = (row[column - 1], previous[column - 1]);
            let extrapolated = (finer * factor - coarser) / (factor - 1.0);
            row.push(extrapolated);
            let error =
                (extrapolated - finer).amax().max((extrapolated - coarser).amax()) + rounding;
            if error < best.error {
                best = Derivative { value: extrapolated, error };
            }
        }
        previous = row;
        step /= RATIO;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector1, Vector2};

    #[test]
    fn smooth_functions_reach_near_rounding_and_know_it() {
        for k in 0..50 {
            let x = f64::from(k) * 0.13 - 3.0;
            let d = derivative(|s| Vector2::new((3.0 * s).sin(), s.exp()), x, 0.1);
            let exact = Vector2::new(3.0 * (3.0 * x).cos(), x.exp());
            let difference = (d.value - exact).amax();
            assert!(difference <= 4.0 * d.error, "x = {x}: {difference:e} > {:e}", d.error);
            assert!(d.error < 1e-10 * exact.amax().max(1.0), "x = {x}: {:e}", d.error);
        }
    }

    #[test]
    fn polynomials_are_exact_to_rounding() {
        let d = derivative(|s| Vector1::new(s * s * s - 2.0 * s), 0.7, 0.1);
        assert!((d.value[0] - (3.0 * 0.49 - 2.0)).abs() < 1e-13);
    }

    #[test]
    fn a_kink_is_reported_as_a_large_error() {
        let d = derivative(|s: f64| Vector1::new((s - 0.0005).abs()), 0.0, 0.1);
        assert!(d.error > 1e-6, "{:e}", d.error);
    }

    #[test]
    fn not_a_number_gives_no_estimate() {
        let d = derivative(|_| Vector1::new(f64::NAN), 0.0, 0.1);
        assert!(d.value[0].is_nan() && d.error.is_infinite());
    }
}
