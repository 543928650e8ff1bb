//! The commands, each in its own module.

mod check;
mod converge;
mod coverage;
mod eval;
mod explain;
mod list;
mod picture;
mod predict;
mod reproduce;
mod resume;
mod run;
mod scheme;
mod score;
mod stability;
mod texts;
mod thorough;
mod tradeoff;

pub(crate) use check::check;
pub(crate) use converge::converge;
pub(crate) use coverage::coverage;
pub(crate) use eval::eval;
pub(crate) use explain::explain;
pub(crate) use list::list;
pub(crate) use reproduce::reproduce;
pub(crate) use resume::resume;
pub(crate) use run::run;
pub(crate) use score::score;
pub(crate) use stability::stability;
pub(crate) use texts::{completions, man, reference};
pub(crate) use tradeoff::tradeoff;

use anyhow::{Context, Result};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{Arithmetic, Case, POLAR_ANGLES, plan};
use serde::Serialize;
use serde_json::{Value, json};

use crate::arguments::{Extent, Frame, Grid, Precision, word};
use crate::library::Selection;
use crate::{memory, number, terminal};
use scheme::Scheme;

/// A solution in the precisions that a simulation of it needs.
struct Model {
    exact: AnySolution<f64>,
    single: Option<AnySolution<f32>>,
}

impl Model {
    fn new(selection: &Selection, precision: Precision) -> Result<Self> {
        let single = match precision {
            Precision::F64 => None,
            Precision::F32 => Some(selection.build_single()?),
        };
        Ok(Self { exact: selection.build()?, single })
    }

    fn arithmetic(&self) -> Arithmetic<'_> {
        self.single.as_ref().map_or(Arithmetic::Double, Arithmetic::Single)
    }

    /// Says on standard error what cases of more than a minute will take, and gives the seconds of each.
    fn announce(&self, cases: &[Case]) -> Option<Vec<f64>> {
        const LONG_S: f64 = 60.0;
        let seconds = predict::seconds(self, cases)?;
        let total: f64 = seconds.iter().sum();
        if total < LONG_S {
            return None;
        }
        let plans = cases.iter().filter_map(|case| plan(&self.exact, self.arithmetic(), case).ok());
        let bytes = plans.map(|plan| plan.bytes).fold(0.0, f64::max);
        let (time, memory) = (predict::duration(total), predict::amount(bytes));
        terminal::note(format_args!("predicted: about {time}, with {memory} of memory"));
        Some(seconds)
    }

    /// Refuses cases that cannot be run or do not fit; gives the extent that they will have.
    fn admit(&self, cases: &[Case]) -> Result<Option<Extent>> {
        let mut extent = None;
        for case in cases {
            let plan = plan(&self.exact, self.arithmetic(), case)?;
            memory::require(plan.bytes, case.cells)?;
            extent = plan.extent.map(|extent| match extent {
                mmsmith_verify::Extent::Quarter => Extent::Quarter,
                mmsmith_verify::Extent::Full => Extent::Full,
            });
        }
        Ok(extent)
    }
}

/// The case that the options describe.
fn case(options: &Scheme, cells: usize) -> Result<Case> {
    let (shape, frame) = scheme::of(options)?;
    Ok(Case {
        shape,
        integrator: options.integrator.into(),
        start: options.start.into(),
        transfer: options.transfer,
        placement: scheme::placement(options)?,
        cells,
        per_cell: options.ppc,
        cfl: options.cfl,
        periods: options.periods,
        extent: options.extent.map(Into::into),
        frame,
        cfl_speed: options.cfl_speed.into(),
        offset: options.offset,
    })
}

/// Settings as they are written to JSON: everything that a result depends on. `cells` and `cfl` are a number or a
/// list.
fn settings(
    selection: &Selection,
    options: &Scheme,
    extent: Option<Extent>,
    cells: impl Serialize,
    cfl: impl Serialize,
) -> Value {
    let (mass, composition) = scheme::echo(options);
    let mut settings = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "solution": selection.name(),
        "parameters": selection.parameters(),
        "frame": options.frame,
        "shape": options.shape,
        "mass": mass,
        "composition": composition,
        "layout": options.layout,
        "grid": options.grid,
        "cfl_speed": options.cfl_speed,
        "transfer": options.transfer.to_string(),
        "integrator": options.integrator,
        "start": options.start,
        "cells": cells,
        "ppc": options.ppc,
        "cfl": cfl,
        "periods": options.periods,
        "offset": options.offset,
        "extent": extent,
        "precision": options.precision,
        "threads": threads(options),
    });
    if options.grid == Grid::Spherical {
        settings["polar_angles"] = json!(POLAR_ANGLES);
    }
    terminal::detail_once(&settings);
    settings
}

/// One line that says what was simulated.
fn caption(selection: &Selection, options: &Scheme, extent: Option<Extent>) -> String {
    let start = match (options.frame, options.integrator) {
        (Frame::Total, _) => scheme::words(options),
        (_, crate::arguments::Integrator::Cd) => format!(" ({} start)", word(options.start)),
        _ => String::new(),
    };
    let start = start + &scheme::additions(options);
    let extent = extent.map(|extent| format!(", {}", word(extent))).unwrap_or_default();
    format!(
        "{} ({}){extent}: {} + {}{start}, {} particles per cell and direction, {} period(s), {}, {} thread(s)\n",
        selection.name(),
        selection.told_parameters(),
        word(options.shape),
        word(options.integrator),
        options.ppc,
        number::exact(options.periods),
        word(options.precision),
        threads(options),
    )
}

/// On how many threads the steps of a scheme are done.
fn threads(options: &Scheme) -> usize {
    let shared = case(options, scheme::USUAL_CELLS).is_ok_and(|case| case.steps_on_threads());
    if shared { rayon::current_num_threads() } else { 1 }
}

/// What is said before a caption: a scheme that was chosen, and threads that were asked for in vain.
fn preface(options: &Scheme) -> String {
    let mut text = options.choice();
    if let Some(asked) = options.threads.filter(|asked| *asked > threads(options)) {
        text += &format!(
            "--threads {asked}: the total frame steps on one thread; errors are measured on {asked}\n"
        );
    }
    text
}

/// Does `work` with the number of threads asked for.
fn with_threads<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R> + Send,
) -> Result<R> {
    // Zero lets rayon take all cores.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .context("--threads: cannot start the threads")?
        .install(work)
}
