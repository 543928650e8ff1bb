//! The exact fields at one point, with limits on the axis, or the centre, of curvilinear coordinates.

use crate::axis::beside_axis;
use crate::dimension::in_dimension;
use crate::field_row::{FieldRow, evaluate_in};
use crate::tangent::{TangentError, WrongLength, exact_tangent};
use mmsmith_runtime::{AnySolution, Solution};
use nalgebra::SVector;

/// The cause where formulas have numbers and the law has no energy.
pub const BEYOND_LAW: &str = "the deformation lies beyond the limit of the law, as where I1bar - 3 reaches Jm of Gent's, and numbers that \
     formulas of P and b have there mean nothing; smaller amplitudes keep away from it";

/// [`evaluate`] with the tangent of the solver's law at the exact deformation.
///
/// # Errors
///
/// `TangentError` where the law has none, or the position does not fit.
pub fn evaluate_with_tangent(
    solution: &AnySolution<f64>,
    X: &[f64],
    t: f64,
) -> Result<FieldRow, TangentError> {
    let mut row = evaluate(solution, X, t)?;
    row.dPdF = in_dimension!(solution, |s| exact_tangent(s, X, t)?, else Vec::new());
    if row.dPdF.iter().flatten().flatten().flatten().any(|entry| !entry.is_finite()) {
        row.not_finite.push("dPdF".to_owned());
    }
    Ok(row)
}

/// Every field of `solution` at the reference position `X` and time `t`.
///
/// # Errors
///
/// `WrongLength` when `X` does not have one coordinate for each dimension.
pub fn evaluate(solution: &AnySolution<f64>, X: &[f64], t: f64) -> Result<FieldRow, WrongLength> {
    let unknown = || Err(WrongLength { given: X.len(), dimension: 0 });
    in_dimension!(solution, |s| evaluate_at(s, X, t), else unknown())
}

fn evaluate_at<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Result<FieldRow, WrongLength> {
    let position: [f64; D] =
        X.try_into().map_err(|_| WrongLength { given: X.len(), dimension: D })?;
    let X = SVector::from(position);
    let row = evaluate_in(solution, &X, t);
    let is_beyond_law =
        row.not_finite.is_empty() && solution.strain_energy(&X, t).is_some_and(|W| !W.is_finite());
    let mut row = beside_axis(solution, &X, t, row);
    if is_beyond_law {
        row.not_finite.push("W".to_owned());
        row.why = Some(BEYOND_LAW.to_owned());
    }
    Ok(row)
}
