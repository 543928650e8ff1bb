//! Derivatives by extrapolated central differences, with an estimate of their own error.
//!
//! Central differences at steps from the reach down to a four-millionth of it, each half of the one before, are extrapolated
//! in the manner of Richardson, four neighbours at a time: at any scale on which the function is smooth these agree. The error
//! of a value is its largest disagreement with values of finer steps, beyond what rounding explains there, that two of them in
//! succession show: one alone may be an unlucky sum of rounding errors. Coarse steps may agree with each other by chance where the
//! function oscillates between them; all finer ones then contradict.
//!
//! A [`slope`] takes four steps alone, and tells no error.

use nalgebra::SMatrix;

/// Number of steps: from the reach down to `2^-22` of it.
const STEPS: usize = 23;
/// Steps that one extrapolated value is made of; its error falls with the eighth power of the step.
const JOINED: usize = 4;
/// Extrapolated values of the finest steps, whose scatter tells the rounding error of the function.
const FINEST: usize = 5;
/// Rounding errors of the function, in units of its last place, where its scatter shows no more.
const ROUNDING: f64 = 4.0;
/// How much extrapolation magnifies a rounding error.
const MAGNIFIED: f64 = 2.0;
/// A scatter beyond this share of the function is none of rounding: the function varies within the finest step.
const LARGEST_SCATTER: f64 = 1e-10;

/// As many times what rounding of the argument does to the function may show in its scatter.
const MOST_OF_ARGUMENT: f64 = 64.0;

/// The first of the steps of a [`slope`]: from a sixty-fourth of the reach on.
const FIRST_OF_SLOPE: i32 = 6;

/// The derivative of `f` at `x` by a sixth of the values of [`derivative`], for means over many places: to some 1e-12 of the largest value
/// over the reach, where the function has less than some ten waves in the reach.
pub(crate) fn slope<const R: usize, const C: usize>(
    f: impl Fn(f64) -> SMatrix<f64, R, C>,
    x: f64,
    reach: f64,
) -> SMatrix<f64, R, C> {
    let steps = (FIRST_OF_SLOPE..).take(JOINED).map(|level| reach * 0.5_f64.powi(level));
    let row = steps.map(|step| (f(x + step) - f(x - step)) / ((x + step) - (x - step)));
    let joined = extrapolated(row.collect());
    joined.first().copied().unwrap_or_else(|| SMatrix::repeat(f64::NAN))
}

/// Differences of steps each half of the one before, [`JOINED`] neighbours at a time.
fn extrapolated<const R: usize, const C: usize>(
    mut row: Vec<SMatrix<f64, R, C>>,
) -> Vec<SMatrix<f64, R, C>> {
    let mut factor = 1.0;
    for _ in 1..JOINED {
        factor *= 4.0;
        row = row.windows(2).map(|pair| (pair[1] * factor - pair[0]) / (factor - 1.0)).collect();
    }
    row
}

/// A derivative and how far off it may be.
pub(crate) struct Derivative<const R: usize, const C: usize> {
    pub(crate) value: SMatrix<f64, R, C>,
    /// Estimated error of the largest entry: that of the extrapolation and that of rounding. Infinite where differences
    /// tell nothing, since the function varies within the finest step.
    pub(crate) error: f64,
}

/// The derivative of `f` at `x` from values no further away than `reach`.
pub(crate) fn derivative<const R: usize, const C: usize>(
    f: impl Fn(f64) -> SMatrix<f64, R, C>,
    x: f64,
    reach: f64,
) -> Derivative<R, C> {
    derivative_of_sum(f, x, reach, 0.0)
}

/// The [`derivative`] of a sum of terms as large as `terms` that may nearly cancel: the sum's rounding is that of the terms.
pub(crate) fn derivative_of_sum<const R: usize, const C: usize>(
    f: impl Fn(f64) -> SMatrix<f64, R, C>,
    x: f64,
    reach: f64,
    terms: f64,
) -> Derivative<R, C> {
    let nothing = Derivative { value: SMatrix::repeat(f64::NAN), error: f64::INFINITY };
    let (mut largest, mut steepest) = (terms, 0.0_f64);
    let mut coarser: Option<[SMatrix<f64, R, C>; 2]> = None;
    let mut row: Vec<SMatrix<f64, R, C>> = Vec::with_capacity(STEPS);
    let steps: Vec<f64> = (0..STEPS as i32).map(|level| reach * 0.5_f64.powi(level)).collect();
    for step in &steps {
        let (above, below) = (x + step, x - step);
        let (f_above, f_below) = (f(above), f(below));
        largest = largest.max(f_above.amax()).max(f_below.amax());
        if let Some([c_above, c_below]) = coarser {
            steepest = steepest.max((c_above - f_above).amax() / step);
            steepest = steepest.max((c_below - f_below).amax() / step);
        }
        coarser = Some([f_above, f_below]);
        // x +- step is rounded: divide by the distance that was really taken.
        row.push((f_above - f_below) / (above - below));
    }
    let row = extrapolated(row);
    // The finest step in each value, which magnifies rounding most.
    let finest_step = |level: usize| steps[level + JOINED - 1];
    let last = row.len() - 1;
    // Not-a-number, which `max` passes over, shows in the differences below: they are not at most infinite.
    let apart = |i: usize, j: usize| {
        (row[i] - row[j])
            .iter()
            .fold(0.0_f64, |m, d| if d.is_nan() { f64::NAN } else { m.max(d.abs()) })
    };
    let scatter = (last - FINEST..last)
        .map(|level| apart(level, level + 1) * finest_step(level + 1))
        .fold(0.0, |m: f64, d| if d.is_nan() { f64::NAN } else { m.max(d) });
    // The argument is rounded, too, which matters where the function is steep, though it may be flat at `x` itself.
    let of_argument = f64::EPSILON * x.abs() * steepest;
    let is_rounding = scatter <= LARGEST_SCATTER * largest + MOST_OF_ARGUMENT * of_argument;
    if !is_rounding {
        return nothing;
    }
    let usual = ROUNDING * (f64::EPSILON * largest + of_argument);
    let noise = MAGNIFIED * usual.max(scatter);
    let mut best = nothing;
    for level in 0..last {
        let rounding = |level: usize| noise / finest_step(level);
        let beyond_rounding = |finer: usize| apart(level, finer) - 2.0 * rounding(finer);
        let contradicted = (level + 1..last)
            .map(|finer| [beyond_rounding(finer), beyond_rounding(finer + 1)])
            .map(|[one, two]| if two.is_nan() || two < one { two } else { one })
            .fold(apart(level, level + 1), |m, d| if d.is_nan() { f64::NAN } else { m.max(d) });
        let error = contradicted + rounding(level);
        if error < best.error {
            best = Derivative { value: row[level], error };
        }
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
            let slope = slope(|s| Vector2::new((3.0 * s).sin(), s.exp()), x, 0.1);
            assert!((slope - exact).amax() < 1e-11 * exact.amax().max(1.0), "x = {x}: {slope}");
        }
    }

    /// From one wave in twenty reaches to two thousand in one.
    #[test]
    fn waves_of_any_length_are_seen() {
        for waves in [0.05, 0.7, 3.0, 8.0, 50.0, 333.0, 2000.0] {
            let k = std::f64::consts::TAU * waves / 0.1;
            for n in 0..200 {
                let x = 0.1 + 0.004_37 * f64::from(n);
                let d = derivative(|s| Vector1::new((k * s).sin() / k), x, 0.1);
                let difference = (d.value[0] - (k * x).cos()).abs();
                assert!(
                    difference <= 8.0 * d.error,
                    "{waves} at {x}: {difference:e}, {:e}",
                    d.error
                );
                assert!(d.error < 1e-9 + 1e-11 * waves, "{waves} at {x}: {:e}", d.error);
            }
        }
    }

    #[test]
    fn polynomials_are_exact_to_rounding() {
        let d = derivative(|s| Vector1::new(s * s * s - 2.0 * s), 0.7, 0.1);
        assert!((d.value[0] - (3.0 * 0.49 - 2.0)).abs() < 1e-13);
    }

    #[test]
    fn a_kink_nearby_is_seen() {
        let d = derivative(|s: f64| Vector1::new((s - 0.0005).abs()), 0.0, 0.1);
        assert!((d.value[0] + 1.0).abs() <= d.error && d.error < 1e-10, "{:e}", d.error);
    }

    #[test]
    fn nothing_is_said_of_what_varies_within_the_finest_step() {
        for place in [1e-8, 1e-9] {
            let d = derivative(|s: f64| Vector1::new((s - place).abs()), 0.0, 0.1);
            assert!(d.error > 1e-6, "{place:e}: {:e}", d.error);
        }
        for k in [1e9, 3.3e11] {
            let d = derivative(|s: f64| Vector1::new((k * s).sin()), 0.3, 0.1);
            assert!(d.error.is_infinite(), "{k:e}: {:e}", d.error);
        }
    }

    #[test]
    fn a_sum_whose_terms_cancel_is_judged_by_its_terms() {
        // Terms of one that leave 1e-8.
        let energy = |s: f64| Vector1::new((1.0 + (1e-4 * s).powi(2)) - 1.0);
        let d = derivative_of_sum(energy, 1.0, 0.1, 1.0);
        let difference = (d.value[0] - 2e-8).abs();
        assert!(difference <= 4.0 * d.error && d.error < 1e-12, "{difference:e}, {:e}", d.error);
    }

    #[test]
    fn not_a_number_gives_no_estimate() {
        let d = derivative(|_| Vector1::new(f64::NAN), 0.0, 0.1);
        assert!(d.value[0].is_nan() && d.error.is_infinite());
        let d = derivative(|s| Vector2::new(s, f64::NAN), 0.0, 0.1);
        assert!(d.error.is_infinite());
    }
}
