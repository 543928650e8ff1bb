//! Whether bodies of materials with memory flow everywhere, from when, and how smoothly.

use crate::dimension::in_dimension;
use crate::error::CaseError;
use crate::points;
use mmsmith_runtime::{AnySolution, HistoryReport, Law, Memory, Real, Solution};
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

/// Whether the law has flow, for which a solver needs a return map.
#[must_use]
pub fn has_flow(solution: &AnySolution<f64>) -> bool {
    let is_flow = |law: Law<f64>| match law {
        Law::WithMemory(law) => matches!(law.memory, Memory::Flow(_)),
        Law::Library(_) | Law::Stated(_) => false,
    };
    in_dimension!(solution, |s| is_flow(s.law()), else false)
}

/// Whether flow hardens by a root of the equivalent plastic strain, so that it begins smoothly where there was none before.
#[must_use]
pub fn flows_smoothly(solution: &AnySolution<f64>) -> bool {
    let is_root = |law: Law<f64>| match law {
        Law::WithMemory(law) => match law.memory {
            Memory::Flow(flow) => flow.modulus > 0.0 && flow.exponent < 1.0,
            Memory::Maxwell(_) => false,
        },
        Law::Library(_) | Law::Stated(_) => false,
    };
    in_dimension!(solution, |s| is_root(s.law()), else false)
}

/// Whether the stress depends on more than the deformation gradient.
#[must_use]
pub fn has_memory(solution: &AnySolution<f64>) -> bool {
    in_dimension!(solution, |s| is_of_memory(&s.law()), else false)
}

/// Whether the stress of a law depends on more than the deformation.
pub(crate) fn is_of_memory(law: &Law<f64>) -> bool {
    match law {
        Law::WithMemory(_) => true,
        Law::Stated(stated) => stated.has_memory(),
        Law::Library(_) => false,
    }
}

/// Prepares the fields of solutions that follow from histories of particles, up to a time.
pub(crate) fn prepare_until<T: Real, const D: usize>(
    exact: &dyn Solution<f64, D>,
    model: &dyn Solution<T, D>,
    end: f64,
) -> Result<(), CaseError> {
    let history = |reason| CaseError::History { reason };
    exact.prepare_until(end).map_err(history)?;
    model.prepare_until(T::nearest(end)).map_err(history)
}
