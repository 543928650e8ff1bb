//! Error against cost: which setting is worth its time.
//!
//! A *family* is a scheme with everything but its grid and its time step; a *ladder* is a family at one CFL number, on
//! grids from coarse to fine. The next run is always the cheapest one, by the time that the family's earlier runs let
//! expect, so that settings from the whole field are compared before any of them becomes dear. A grid is passed over where
//! the error that the observed order lets expect is larger by [`MARGIN`] than that of a setting of the same weights already
//! known to cost no more; one that any other setting so betters may still be run, to tell what its weights cost, but only
//! while that is cheap. A ladder ends where that holds for all its grids that the budget can pay for, where its error no longer falls, or
//! where a run stops. From a ladder's third grid on, half and twice its CFL number are tried as well, as long as that gains.
//!
//! A stated list of settings is measured as it stands, with [`listed`].
//!
//! Nothing here knows a clock or a solver: both are given, so that tests can state them.

mod effects;
mod families;
mod policy;
mod sweep;

use std::collections::BTreeMap;

use crate::case::Case;
use crate::named::named;
use crate::on_grid::Plan;
use crate::run::Row;
use crate::scheme::Formulation;
use sweep::{Cases, Sweep};

pub use effects::{Effect, Range, SettingName, TimeEffect, differences, leading};
pub use families::families;
pub use policy::extrapolate;

/// Cell counts of a ladder.
pub const LADDER: [usize; 15] = [4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512];
/// An expected error this much larger than a measured one of no higher cost is not worth a run.
pub const MARGIN: f64 = 1.25;
/// Errors that the cheapest settings are named for.
pub const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];

/// A setting to run: a case, its precision, and its threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Scheme, grid and time step.
    pub case: Case,
    /// Whether the solver computes in single precision.
    pub single: bool,
    /// Number of threads.
    pub threads: usize,
}

/// One measured setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The setting that was run.
    pub setting: Setting,
    /// Its errors; the times are medians of the repeats.
    pub row: Row,
    /// Wall-clock time of the steps in each repeat, in seconds.
    pub walls: Vec<f64>,
    /// Processor time of the steps in each repeat, in seconds.
    pub cpus: Vec<f64>,
    /// Everything in its first run, from setting up to the last error, in seconds.
    pub total_s: f64,
    /// Memory in bytes, estimated.
    pub bytes: f64,
}

/// A cost of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// Wall-clock time of the steps.
    Wall,
    /// Processor time of the steps.
    Cpu,
    /// Number of steps.
    Steps,
    /// Memory.
    Memory,
}

named! {
    Against {
        Wall = "wall": "Wall-clock time of the steps";
        Cpu = "cpu": "Processor time of the steps";
        Steps = "steps": "Number of steps";
        Memory = "memory": "Memory, estimated";
    }
}

/// Why something was not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Skip {
    /// Its expected error is larger by [`MARGIN`] than one already measured with the same weights at no higher cost, or with
    /// any, and it would be dear.
    Dominated,
    /// The error of its ladder no longer falls.
    NoGain,
    /// Another CFL number on the same grid was no better, or was much worse.
    Cfl,
    /// A coarser grid of its ladder stopped.
    Stopped,
    /// It would take longer than there is time, or than one run may.
    Budget,
    /// It needs more memory than there is.
    Memory,
    /// The solver refuses it.
    Refused,
}

/// Goal of a search for settings.
#[derive(Clone, Copy)]
pub struct Goal<'a> {
    /// Seconds for everything.
    pub budget_s: f64,
    /// The error of a row that settings are compared by.
    pub error: &'a dyn Fn(&Row) -> f64,
    /// The cost that settings are compared by.
    pub against: Against,
    /// An error that must be met, beside [`TOLERANCES`].
    pub tolerance: Option<f64>,
    /// Seconds of stepping within which the most accurate setting is wanted.
    pub time_s: Option<f64>,
    /// Bytes that a run may need.
    pub most_bytes: f64,
}

/// Times of the steps of a run, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeat {
    /// Wall-clock time.
    pub wall_s: f64,
    /// Processor time.
    pub cpu_s: f64,
}

/// A repeat, none where it did not end in time, or why it could not be run.
pub type RepeatOutcome<E> = Result<Option<Repeat>, E>;

/// A row, none where the solver refuses the setting, or why the study cannot go on.
pub type RunOutcome<E> = Result<Option<Row>, E>;

/// The machine that runs the settings.
pub struct Machine<'a, E> {
    /// Plan of a setting; none where the setting does not fit the solution.
    pub plan: &'a dyn Fn(&Setting) -> Option<Plan>,
    /// Runs a setting and measures its errors, for at most so many seconds; none where the solver refuses it.
    pub run: &'a (dyn Fn(&Setting, f64) -> RunOutcome<E> + 'a),
    /// Runs the steps alone, for at most so many seconds; none if it did not end.
    pub repeat: &'a (dyn Fn(&Setting, f64) -> RepeatOutcome<E> + 'a),
    /// Seconds since the start.
    pub clock: &'a dyn Fn() -> f64,
}

/// The cheapest setting for an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cheapest {
    /// The error.
    pub tolerance: f64,
    /// The entry, if any meets it.
    pub entry: Option<usize>,
    /// Whether the neighbouring cell counts were run and meet it too; otherwise there was no time for that, or they are not in
    /// the list.
    pub neighbours_hold: bool,
}

/// The setting that was asked for, and the run that proves it.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The entry.
    pub entry: usize,
    /// Results of its setting when it was run once more.
    pub proof: Row,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tradeoff {
    /// All rows, in the order in which they were run.
    pub entries: Vec<Entry>,
    /// Indices of the Pareto-optimal ones, from cheap to dear.
    pub front: Vec<usize>,
    /// The cheapest setting for each tolerance.
    pub tolerances: Vec<Cheapest>,
    /// The cheapest setting of each formulation for each tolerance, where settings of both were run.
    pub by_formulation: Vec<(Formulation, Vec<Cheapest>)>,
    /// The cheapest setting for the tolerance asked for, if one meets it.
    pub for_tolerance: Option<Chosen>,
    /// The most accurate setting within the time asked for, if one is within it.
    pub for_time: Option<Chosen>,
    /// Effects of the change of each setting.
    pub effects: Vec<Effect>,
    /// Number of grids that were not run, by reason.
    pub skipped: BTreeMap<Skip, usize>,
    /// Families that were tried.
    pub families: usize,
}

/// The indices of pairs `(cost, error)` that no other one betters in one and equals in the other, from cheap to dear.
/// Pairs with a part that is not finite are never among them; of equal ones the first is.
#[must_use]
pub fn pareto(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&index| points[index].0.is_finite() && points[index].1.is_finite())
        .collect();
    // Stable, so that equal ones stay in their order.
    order.sort_by(|&a, &b| {
        points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1))
    });
    let mut best = f64::INFINITY;
    order.retain(|&index| {
        let is_better = points[index].1 < best;
        best = best.min(points[index].1);
        is_better
    });
    order
}

/// Measures the families within the budget, and says what is worth its cost. `progress` is told what is run next.
///
/// # Errors
///
/// That of the machine: where a setting that was planned cannot be run after all.
pub fn tradeoff<E>(
    families: &[Setting],
    goal: &Goal<'_>,
    machine: &Machine<'_, E>,
    progress: &mut dyn FnMut(&Setting),
) -> Result<Tradeoff, E> {
    let mut sweep = Sweep::new(families, goal, machine, Cases::Chosen);
    sweep.climb(progress)?;
    sweep.compare_settings(progress)?;
    sweep.name_cheapest(progress)?;
    sweep.fill(progress)?;
    sweep.conclude(progress)
}

/// Measures each of `families` at each of `cases`, the pairs of cell count and CFL number, and says what is worth its cost.
/// Budgets count for nothing, and what does not fit the solution is left out.
///
/// # Errors
///
/// As [`tradeoff`].
pub fn listed<E>(
    families: &[Setting],
    cases: &[(usize, f64)],
    goal: &Goal<'_>,
    machine: &Machine<'_, E>,
    progress: &mut dyn FnMut(&Setting),
) -> Result<Tradeoff, E> {
    let goal = Goal { budget_s: f64::INFINITY, ..*goal };
    let mut sweep = Sweep::new(families, &goal, machine, Cases::Listed);
    for (family, setting) in list(families, cases, machine.plan) {
        if sweep.run(family, &setting, progress)?.is_none() {
            sweep.skip(Skip::Refused, 1);
        }
    }
    sweep.name_cheapest(progress)?;
    sweep.conclude(progress)
}

/// The settings of [`listed`] that fit the solution, each with the index of its family.
pub fn list(
    families: &[Setting],
    cases: &[(usize, f64)],
    plan: &dyn Fn(&Setting) -> Option<Plan>,
) -> Vec<(usize, Setting)> {
    let at = |family: &Setting, &(cells, cfl): &(usize, f64)| Setting {
        case: Case { cells, cfl, ..family.case },
        ..*family
    };
    let all = families
        .iter()
        .enumerate()
        .flat_map(|(index, family)| cases.iter().map(move |case| (index, at(family, case))));
    all.filter(|(_, setting)| plan(setting).is_some()).collect()
}

/// The median; of an even number the mean of the middle two.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests;
