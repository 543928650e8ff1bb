//! Another solver's errors beside those of the solver here, at the same settings.

use std::collections::BTreeMap;
use std::path::Path;

use mmsmith_measure::norms::PerNorm;
use mmsmith_runtime::{AnySolution, Condition, Surface};
use serde::Serialize;
use thiserror::Error;

use crate::case::{Arithmetic, Case};
use crate::discretized::Discretized;
use crate::error::{CaseError, SceneError};
use crate::frames::FrameOutput;
use crate::run::{Outputs, Row, Status};

use super::times::TIME_SLACK;
use super::{Input, Quantity, ScoreError, ScoreOptions, ScoreRow, score};

/// More digits than these say nothing of doubles.
const MOST_DIGITS: f64 = 16.0;

/// Errors of two solvers at the same settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// The run of the solver here.
    pub run: Row,
    /// Its errors at the times of the recording's frames.
    pub errors: BTreeMap<Quantity, PerNorm<f64>>,
    /// How many digits the errors of both have in common, at most 16, field by field that both have.
    pub digits: BTreeMap<Quantity, PerNorm<f64>>,
}

/// Why a recording cannot be held against a run.
#[derive(Debug, Error)]
pub enum AgainstError {
    /// The run cannot be made.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The updated Lagrangian formulation, in which the runs beside recordings are, does not model a condition.
    #[error(
        "--against runs the updated Lagrangian formulation, which does not model the condition {condition} on {surface}; leave --against \
         out, and measure a run of this solution with mms converge, which takes the total Lagrangian formulation for it"
    )]
    Unmodelled {
        /// Where.
        surface: Surface,
        /// The condition.
        condition: Condition,
    },
    /// Its frames cannot be read.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// The run did not come to its end.
    #[error("the run beside {file} did not end well: {status}")]
    Stopped {
        /// The recording.
        file: String,
        /// How it ended.
        status: Status,
    },
    /// The frames are not at ends of steps.
    #[error(
        "{file}: its {frames} frame(s) from t = {first:?} to {last:?} are not those of {steps} steps from t = 0 to {end:?}; \
         --cfl {cfl:?} should be the one that {file} was run with, its frames evenly spread from t = 0 on, whole steps apart"
    )]
    Frames {
        /// The recording.
        file: String,
        /// Its frames.
        frames: usize,
        /// Their first time.
        first: f64,
        /// Their last time.
        last: f64,
        /// Steps of the run.
        steps: u64,
        /// Its end time.
        end: f64,
        /// The CFL number asked for.
        cfl: f64,
    },
}

/// Runs `case` with its frames, which go to `folder`, at the times of those of a recording that was scored as `row`, and compares
/// the errors.
///
/// # Errors
///
/// [`AgainstError`] where the run cannot be made or read, or the recording has frames at other times than ends of its steps.
pub fn against(
    exact: &AnySolution<f64>,
    row: &ScoreRow,
    case: &Case,
    folder: &Path,
    options: &ScoreOptions,
) -> Result<Agreement, AgainstError> {
    let prepared =
        Discretized::new(exact, Arithmetic::Double, case).map_err(|error| match error {
            CaseError::Scene(SceneError::Unmodelled { surface, condition, .. }) => {
                AgainstError::Unmodelled { surface, condition }
            }
            error => error.into(),
        })?;
    let steps = prepared.plan().steps;
    let frames = FrameOutput {
        folder: folder.to_owned(),
        name: "beside".into(),
        count: row.frames as u64,
        provenance: None,
    };
    let progress = &mut |_| ();
    let mut outputs = Outputs { frames: Some(&frames), ..Outputs::new(progress) };
    let between = row.frames.saturating_sub(1) as u64;
    let run = prepared.run(&mut outputs)?;
    let end = run.dt * run.steps as f64;
    let is_close = |one: f64, other: f64| (one - other).abs() <= TIME_SLACK * end;
    let is_even = between > 0 && steps % between == 0;
    if !(is_even && is_close(row.first_time, 0.0) && is_close(row.last_time, end)) {
        return Err(AgainstError::Frames {
            file: row.file.clone(),
            frames: row.frames,
            first: row.first_time,
            last: row.last_time,
            steps,
            end,
            cfl: case.cfl,
        });
    }
    if run.status != Status::Ok {
        return Err(AgainstError::Stopped { file: row.file.clone(), status: run.status });
    }
    let input = Input {
        paths: vec![folder.to_owned()],
        resolution: super::Resolution::Cells(case.cells),
        velocity_lag: 0.0,
    };
    let own = ScoreOptions { periods: options.periods, ..ScoreOptions::default() };
    let mut scored = score(exact, &[input], &own)?;
    let errors = std::mem::take(&mut scored.rows[0].errors);
    let digits = row.fields.iter().filter_map(|field| {
        let (theirs, ours) = (row.errors.get(field)?, errors.get(field)?);
        Some((*field, PerNorm::from_fn(|norm| digits(theirs[norm], ours[norm]))))
    });
    let digits = digits.collect();
    Ok(Agreement { run, errors, digits })
}

/// How many digits two positive numbers have in common.
fn digits(one: f64, other: f64) -> f64 {
    let apart = (one - other).abs() / other.abs();
    if apart == 0.0 { MOST_DIGITS } else { (-apart.log10()).clamp(0.0, MOST_DIGITS) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_in_common_are_counted_by_the_relative_difference() {
        assert_eq!(digits(2.0, 2.0), MOST_DIGITS);
        assert!((digits(1.001, 1.0) - 3.0).abs() < 1e-9);
        assert_eq!(digits(5.0, 1.0), 0.0);
        assert!(digits(f64::NAN, 1.0).is_nan());
    }
}
