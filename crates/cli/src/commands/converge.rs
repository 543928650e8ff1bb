//! `mms converge`: orders of accuracy.

mod growing;
mod judged;
mod told;

use std::sync::OnceLock;

use anyhow::{Result, bail};
use mmsmith_verify::{
    Case, Discretized, Expected, ORDER_TOLERANCE, Outputs, Progress, Record, StudyError, Sweep,
    Temporal, TemporalRecord,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::growth::Warnings;
use super::predict::announce;
use super::problem::{Problem, extent};
use super::remedy::Given;
use super::statics;
use super::study::{Request, Show, Study, conduct};
use crate::arguments::{ConvergeOptions, SchemeOptions};
use crate::expect;
use crate::library::Selection;
use crate::report::Report;
use crate::terminal;
use judged::Judged;
pub(super) use judged::{Verdicts, judge, judge_differences};
pub(super) use told::{
    difference_curve, difference_tables, results, tables, temporal_results, verdict_table,
};

pub(crate) fn converge(options: &ConvergeOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let of_time = [("--cfls", !options.cfls.is_empty())];
    if statics::is_asked(&selection, &options.statics, &options.scheme, &of_time)? {
        return statics::converge(selection, options);
    }
    let sweep = sweep(options)?;
    let orders = Orders::asked(options)?;
    // The CFL numbers of a study in time are said, and the speed that they refer to is the one that such numbers have.
    let said = SchemeOptions {
        cfl: options.scheme.cfl.or(options.cfls.first().copied()),
        ..options.scheme.clone()
    };
    let problem = &Problem::new(selection, &said)?;
    let base = Case { cells: options.cells[0], ..problem.settled.case };
    let cases = problem.model.admit(&sweep.cases(&base))?;
    if let (Sweep::Cells(_), [only]) = (&sweep, options.cells.as_slice()) {
        terminal::warn(format_args!(
            "one grid has errors and no order: give at least two, such as --cells {only},{}; three show whether the order holds",
            2 * only
        ));
    }
    let given = Given::of(&options.name, &options.scheme);
    let warnings = OnceLock::new();
    let study = Converge { problem, given, sweep, base, cases, orders, warnings };
    conduct(&study, &Request::of_orders(options))
}

fn sweep(options: &ConvergeOptions) -> Result<Sweep> {
    if options.cfls.is_empty() {
        return Ok(Sweep::Cells(options.cells.clone()));
    }
    if options.cells.len() != 1 {
        bail!("--cfls: orders in time are measured on one grid, such as --cells 32");
    }
    Ok(Sweep::Cfls(options.cfls.clone()))
}

/// Orders that are asked for.
struct Orders {
    expected: Option<Expected>,
    tolerance: f64,
    /// Whether they are more than the promises of theory, which are no failure where nothing can judge them.
    strict: bool,
}

impl Orders {
    fn asked(options: &ConvergeOptions) -> Result<Self> {
        Ok(Self {
            expected: options.expect.as_deref().map(expect::parse).transpose()?,
            tolerance: options.tolerance.unwrap_or(ORDER_TOLERANCE),
            strict: options.expect.is_some() || options.tolerance.is_some(),
        })
    }
}

/// A series of grids or of time steps.
struct Converge<'a> {
    problem: &'a Problem,
    given: Given<'a>,
    sweep: Sweep,
    /// All that the cases have in common; in time the first of them.
    base: Case,
    cases: Vec<Discretized<'a>>,
    orders: Orders,
    /// Causes of errors that lie in the motion, measured once.
    warnings: OnceLock<Warnings>,
}

/// Errors of a run, or the differences between time steps.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Found {
    Errors(Box<Record>),
    Differences(TemporalRecord),
}

impl Study for Converge<'_> {
    type Found = Found;

    fn keys(&self) -> Vec<Value> {
        let (problem, extent) = (self.problem, extent(&self.cases));
        let cases = self.cases.iter().map(Discretized::case);
        let mut keys: Vec<Value> =
            cases.map(|case| problem.settings(extent, case.cells, case.cfl)).collect();
        if let Sweep::Cfls(cfls) = &self.sweep {
            let mut key = problem.settings(extent, self.base.cells, cfls);
            key["differences"] = true.into();
            keys.push(key);
        }
        keys
    }

    fn work(&self) -> Vec<f64> {
        self.with_differences(self.cases.iter().map(|case| case.plan().work()).collect())
    }

    fn seconds(&self) -> Option<Vec<f64>> {
        announce(&self.cases).map(|seconds| self.with_differences(seconds))
    }

    fn measure(&self, index: usize, show: &Show<'_>) -> Result<Found> {
        let Some(case) = self.cases.get(index) else {
            let Sweep::Cfls(cfls) = &self.sweep else { bail!("there is no case {index}") };
            let mut progress = |progress: Progress| {
                show.progress(&format!("difference, CFL {}", cfls[progress.case]), progress);
            };
            let found = self.cases[0].differences(cfls, &mut progress)?;
            return Ok(Found::Differences(TemporalRecord::from(&found)));
        };
        let what = match &self.sweep {
            Sweep::Cells(cells) => format!("{} cells", cells[index]),
            Sweep::Cfls(cfls) => format!("CFL {}", cfls[index]),
        };
        let mut progress = |progress| show.progress(&what, progress);
        let row = case.run(&mut Outputs::new(&mut progress));
        let row = row.map_err(|cause| StudyError { index, cause })?;
        Ok(Found::Errors(Box::new(Record::from(&row))))
    }

    fn was_shared(found: &mut Found) {
        if let Found::Errors(record) = found {
            record.timed_alone = false;
        }
    }

    fn report(&self, found: Vec<Found>) -> Result<Report> {
        let (mut rows, mut differences) = (Vec::new(), None);
        for one in found {
            match one {
                Found::Errors(record) => rows.push((*record).into()),
                Found::Differences(found) => differences = Some(Temporal::from(found)),
            }
        }
        told::report(self, &Judged::new(self, rows, differences))
    }
}

impl Converge<'_> {
    /// Measured once, where a report is made.
    fn warnings(&self) -> &Warnings {
        self.warnings.get_or_init(|| Warnings::of(self.problem))
    }

    /// A figure for each case, and in time one for the differences: they take each run once more, and one with half its step.
    fn with_differences(&self, mut figures: Vec<f64>) -> Vec<f64> {
        if matches!(self.sweep, Sweep::Cfls(_)) {
            figures.push(3.0 * figures.iter().sum::<f64>());
        }
        figures
    }
}
