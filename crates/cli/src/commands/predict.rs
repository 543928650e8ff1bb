//! Costs of runs, before they are run.

use std::time::Duration;

use mmsmith_verify::{Case, CaseError, Cost, CostModel, Discretized, Division, Plan};

use super::problem::Model;
use crate::{processes, terminal};

/// Cell counts that `mms explain` tells of.
pub(super) const GRIDS: [usize; 4] = [32, 64, 128, 256];
/// Particles times steps below which no run takes a minute, whatever its scheme.
const LITTLE_WORK: f64 = 1e7;
/// Calibration in seconds for each particle and step of the work, a small part of it; and its limits.
const EFFORT: f64 = 5e-9;
const EFFORTS: (f64, f64) = (0.05, 0.5);
/// Calibration for `mms explain`: enough for some steps on its finest grid, where two dimensions are all.
const BRIEF: Duration = Duration::from_millis(1500);

/// The seconds that each of `cases`, of one scheme, will take; none for work so little that it is not worth calibrating for,
/// and where nothing could be measured.
pub(super) fn seconds(cases: &[Discretized<'_>]) -> Option<Vec<f64>> {
    let all: f64 = cases.iter().map(|case| case.plan().work()).sum();
    if all < LITTLE_WORK {
        return None;
    }
    let largest = cases.iter().max_by(|a, b| a.plan().particles.total_cmp(&b.plan().particles))?;
    let effort = Duration::from_secs_f64((EFFORT * all).clamp(EFFORTS.0, EFFORTS.1));
    let learnt = CostModel::calibrate(largest, effort).ok()?;
    cases.iter().map(|case| Some(learnt.predict(case.plan())?.total_s)).collect()
}

/// Says on standard error what cases of more than a minute will take, and gives the seconds of each.
pub(super) fn announce(cases: &[Discretized<'_>]) -> Option<Vec<f64>> {
    // Each process would calibrate with the whole body.
    if processes::ranks().is_some() {
        return None;
    }
    const LONG_S: f64 = 60.0;
    let seconds = seconds(cases)?;
    let total: f64 = seconds.iter().sum();
    if total < LONG_S {
        return None;
    }
    let bytes = cases.iter().map(|case| case.plan().bytes).fold(0.0, f64::max);
    let (time, memory) = (duration(total), amount(bytes));
    terminal::note(format_args!("predicted: about {time}, with {memory} of memory"));
    Some(seconds)
}

/// Cost model from a few steps of a case's scheme, on grids up to its own.
pub(super) fn learn(case: &Discretized<'_>) -> Result<CostModel, CaseError> {
    CostModel::calibrate(case, BRIEF)
}

/// Costs of a run, and the threads that it keeps busy where they can be counted.
pub(super) struct Prediction {
    pub(super) cells: usize,
    pub(super) plan: Plan,
    pub(super) cost: Cost,
    pub(super) division: Option<Division>,
}

/// Costs of the scheme of `base` on some grids, those with `more` cells among them; grids that do not fit the solution are left out.
pub(super) fn on_grids(
    model: &Model,
    base: &Case,
    more: &[usize],
) -> Result<Vec<Prediction>, CaseError> {
    let mut fitting: Vec<Discretized<'_>> = Vec::new();
    let mut refused = None;
    for cells in GRIDS {
        match model.discretized(&Case { cells, ..*base }) {
            Ok(case) => fitting.push(case),
            Err(error) => refused = Some(error),
        }
    }
    if let (true, Some(error)) = (fitting.is_empty(), refused) {
        return Err(error);
    }
    let Some(finest) = fitting.last() else { return Ok(Vec::new()) };
    let learnt = learn(finest)?;
    for &cells in more {
        fitting.push(model.discretized(&Case { cells, ..*base })?);
    }
    let row = |case: &Discretized<'_>| {
        let (cells, plan, division) = (case.case().cells, *case.plan(), case.division());
        Some(Prediction { cells, plan, cost: learnt.predict(&plan)?, division })
    };
    Ok(fitting.iter().filter_map(row).collect())
}

/// A time for people.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 0.0995 => format!("{:.1} ms", 1e3 * s),
        s if s < 99.5 => format!("{s:.1} s"),
        s if s < 5970.0 => format!("{:.0} min", s / 60.0),
        s if s < 3.6e5 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.3e} days", s / 86400.0),
    }
}

/// An amount of memory for people.
pub(super) fn amount(bytes: f64) -> String {
    const MIB: f64 = 1024.0 * 1024.0;
    match bytes / MIB {
        mib if mib < 1000.0 => format!("{mib:.1} MiB"),
        mib => format!("{:.1} GiB", mib / 1024.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_amounts_are_told_in_fitting_units() {
        let told = [0.0123, 3.25, 120.0, 7200.0, 8.64e7].map(duration);
        assert_eq!(told, ["12.3 ms", "3.2 s", "2 min", "2.0 h", "1.000e3 days"]);
        assert_eq!([2.5e6, 3e9].map(amount), ["2.4 MiB", "2.8 GiB"]);
    }
}
