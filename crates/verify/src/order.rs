//! Orders of accuracy from errors and step sizes.

use mmsmith_measure::norms::{Field, Norm, PerField, PerNorm};
use serde::Serialize;

/// The observed order of one error norm over a series of cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Order {
    /// `ln(e_i/e_{i-1}) / ln(s_i/s_{i-1})` for each pair of successive cases; `None` where either error is
    /// missing or not positive, or where the step did not change.
    pub local: Vec<Option<f64>>,
    /// Slope of the least-squares line through all usable `(ln s, ln e)`; `None` with fewer than two different
    /// steps.
    pub fit: Option<f64>,
}

impl Order {
    /// The orders of `errors` (`None` where a case failed) with respect to `steps`, in the order of the cases.
    #[must_use]
    pub fn of(steps: &[f64], errors: &[Option<f64>]) -> Self {
        let logs: Vec<Option<(f64, f64)>> = steps
            .iter()
            .zip(errors)
            .map(|(&step, &error)| {
                let error = error.filter(|e| e.is_finite() && *e > 0.0)?;
                Some((step.ln(), error.ln()))
            })
            .collect();
        let local = logs
            .windows(2)
            .map(|pair| {
                let ((s0, e0), (s1, e1)) = (pair[0]?, pair[1]?);
                Some((e1 - e0) / (s1 - s0)).filter(|order| order.is_finite())
            })
            .collect();
        Self { local, fit: slope(&logs.into_iter().flatten().collect::<Vec<_>>()) }
    }
}

/// The least-squares slope of `y` over `x`.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let mean_x = points.iter().map(|p| p.0).sum::<f64>() / n;
    let mean_y = points.iter().map(|p| p.1).sum::<f64>() / n;
    let xx: f64 = points.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    // Equal steps whose mean rounds leave a tiny xx; a step ratio worth fitting is far above it.
    (xx > 1e-18).then(|| xy / xx)
}

/// The orders of errors over steps, those left out that rounding may have caused: at or below `floors`, row by row.
#[must_use]
pub fn orders_above(
    steps: &[f64],
    values: &[Option<&PerField<PerNorm<f64>>>],
    floors: &[PerField<f64>],
) -> PerField<PerNorm<Order>> {
    each_norm(values, |field, norm, errors| {
        let floor =
            |row: usize| floors.get(row).map_or(0.0, |floor| floor[field] * above_mean(norm));
        let above =
            |(row, error): (usize, &Option<f64>)| error.filter(|error| *error >= floor(row));
        let errors: Vec<_> = errors.iter().enumerate().map(above).collect();
        Order::of(steps, &errors)
    })
}

/// The largest error that rounding may cause, in units of its root mean square: the floors are of the latter, and the largest of
/// some thousand particles and steps lies beyond.
pub(crate) fn above_mean(norm: Norm) -> f64 {
    match norm {
        Norm::Linf => 8.0,
        Norm::L2 | Norm::L1 => 1.0,
    }
}

/// The orders of errors, `None` where a case failed, with respect to the steps beside them.
pub(crate) fn orders_of(
    rows: &[(f64, Option<&PerField<PerNorm<f64>>>)],
) -> PerField<PerNorm<Order>> {
    let steps: Vec<f64> = rows.iter().map(|(step, _)| *step).collect();
    let values: Vec<_> = rows.iter().map(|(_, errors)| *errors).collect();
    each_norm(&values, |_, _, errors| Order::of(&steps, errors))
}

/// Results of `judge` for the series of values of every field and norm.
pub(crate) fn each_norm<R>(
    values: &[Option<&PerField<PerNorm<f64>>>],
    judge: impl Fn(Field, Norm, &[Option<f64>]) -> R,
) -> PerField<PerNorm<R>> {
    PerField::from_fn(|field| {
        PerNorm::from_fn(|norm| {
            let pick = |value: &PerField<PerNorm<f64>>| value[field][norm];
            let series: Vec<_> = values.iter().map(|value| value.map(pick)).collect();
            judge(field, norm, &series)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_gives_its_exponent_for_any_step_ratio() {
        let steps = [1.0, 0.5, 0.3, 0.1];
        let errors: Vec<_> = steps.iter().map(|s: &f64| Some(7.0 * s.powf(1.5))).collect();
        let order = Order::of(&steps, &errors);
        assert_eq!(order.local.len(), 3);
        for local in order.local {
            assert!((local.unwrap() - 1.5).abs() < 1e-13);
        }
        assert!((order.fit.unwrap() - 1.5).abs() < 1e-13);
    }

    #[test]
    fn failed_cases_and_zero_errors_leave_gaps_but_the_fit_uses_the_rest() {
        let order =
            Order::of(&[1.0, 0.5, 0.25, 0.125], &[Some(1.0), None, Some(0.0625), Some(0.0)]);
        assert_eq!(order.local, [None, None, None]);
        assert!((order.fit.unwrap() - 2.0).abs() < 1e-13);
    }

    #[test]
    fn equal_steps_or_a_single_case_have_no_order() {
        assert_eq!(
            Order::of(&[0.3, 0.3], &[Some(1.0), Some(2.0)]),
            Order { local: vec![None], fit: None }
        );
        assert_eq!(Order::of(&[0.1], &[Some(1.0)]), Order { local: vec![], fit: None });
        assert_eq!(Order::of(&[], &[]), Order { local: vec![], fit: None });
    }
}
