//! Whether bodies of materials with memory flow everywhere, from when, and how smoothly.

use crate::dimension::in_dimension;
use crate::points;
use mmsmith_runtime::{AnySolution, HistoryReport, Solution};
use nalgebra::SVector;

/// How the histories of internal variables go at `count` places of a body over a period; none for elastic laws.
///
/// # Errors
///
/// The reason where a history cannot be followed.
pub fn history_of(
    solution: &AnySolution<f64>,
    count: usize,
) -> Result<Option<HistoryReport>, String> {
    in_dimension!(solution, |s| of(s, count), else Ok(None))
}

fn of<const D: usize>(
    solution: &dyn Solution<f64, D>,
    count: usize,
) -> Result<Option<HistoryReport>, String> {
    if solution.internal_variables().is_empty() {
        return Ok(None);
    }
    let (domain, period) = (solution.domain(), solution.period());
    let places: Vec<SVector<f64, D>> =
        (0..count).filter_map(|n| Some(points::interior(&domain, period, n)?.0)).collect();
    solution.history(&places, period)
}
