//! The commands, each in its own module.

mod batch;
mod blind;
mod certify;
mod check;
mod checkpoint_folder;
mod converge;
mod coverage;
mod diagnose;
mod eval;
mod explain;
mod generate;
mod inversion;
mod list;
mod picture;
mod predict;
mod python;
mod remedy;
mod reproduce;
mod resume;
mod run;
mod scheme;
mod score;
mod stability;
mod texts;
mod thorough;
mod tradeoff;

pub(crate) use batch::batch;
pub(crate) use certify::certify;
pub(crate) use check::check;
pub(crate) use converge::converge;
pub(crate) use coverage::coverage;
pub(crate) use diagnose::diagnose;
pub(crate) use eval::eval;
pub(crate) use explain::explain;
pub(crate) use generate::generate;
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
use mmsmith_verify::{Arithmetic, Case, Coordinates, Extent, POLAR_ANGLES, Parts, plan};
use serde::Serialize;
use serde_json::{Value, json};

use crate::arguments::{Precision, word};
use crate::library::Selection;
use crate::{memory, number, processes, progress, terminal};
use scheme::Settled;

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
        // Each process would calibrate with the whole body.
        if processes::ranks().is_some() {
            return None;
        }
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
            let parts = processes::ranks().map_or(1, |ranks| ranks.count());
            memory::require(plan.bytes / parts as f64, case.cells)?;
            extent = plan.extent;
        }
        Ok(extent)
    }
}

/// Settings as they are written to JSON: everything that a result depends on. `cells` and `cfl` are a number or a
/// list.
fn settings(
    selection: &Selection,
    settled: &Settled,
    extent: Option<Extent>,
    cells: impl Serialize,
    cfl: impl Serialize,
) -> Value {
    let Case { scheme, per_cell, cfl_speed, periods, .. } = settled.case;
    let parts = scheme.parts();
    let mut settings = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "solution": selection.name(),
        "parameters": selection.parameters(),
        "frame": parts.frame,
        "shape": parts.shape,
        "mass": parts.mass,
        "composition": parts.composition,
        "layout": parts.layout,
        "grid": parts.grid,
        "cfl_speed": cfl_speed.to_string(),
        "transfer": parts.transfer,
        "integrator": parts.integrator,
        "start": parts.start,
        "cells": cells,
        "ppc": per_cell,
        "cfl": cfl,
        "periods": periods,
        "offset": parts.offset,
        "extent": extent.map(|extent| extent.to_string()),
        "precision": settled.precision,
        "threads": rayon::current_num_threads(),
    });
    if scheme.total().is_some_and(|total| total.coordinates == Coordinates::Spherical) {
        settings["polar_angles"] = json!(POLAR_ANGLES);
    }
    if let Some(ranks) = processes::ranks() {
        settings["ranks"] = ranks.count().into();
    }
    if scheme.updated().is_some_and(|updated| updated.placement.is_clipped()) {
        settings["grid_angle"] = json!(parts.pose.angle);
        settings["grid_shift"] = json!(parts.pose.shift);
    }
    terminal::detail_once(&settings);
    settings
}

/// One line that says what was simulated.
fn caption(selection: &Selection, settled: &Settled, extent: Option<Extent>) -> String {
    let threads = number::counted(rayon::current_num_threads(), "thread");
    format!("{} {}, {threads}\n", selection.name(), setting(selection, settled, extent))
}

/// Parameters and scheme in words, for pictures too.
fn setting(selection: &Selection, settled: &Settled, extent: Option<Extent>) -> String {
    let Case { scheme, per_cell, periods, .. } = settled.case;
    let Parts { shape, integrator, .. } = scheme.parts();
    let part = |extent| match (extent, selection.dimension()) {
        // Three planes of symmetry.
        (Extent::Quarter, 3) => ", eighth".to_owned(),
        _ => format!(", {extent}"),
    };
    let extent = extent.map(part).unwrap_or_default();
    format!(
        "({}){extent}: {shape} + {integrator}{}, {per_cell} particles per cell and direction, {}, {}",
        selection.told_parameters(),
        scheme::words(&scheme),
        number::of_periods(periods),
        word(settled.precision),
    )
}

/// Does `work` with the number of threads asked for.
fn with_threads<R: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<R> + Send,
) -> Result<R> {
    // Zero lets rayon take all cores.
    rayon::ThreadPoolBuilder::new()
        .num_threads(processes::threads(threads))
        .build()
        .context("--threads: cannot start the threads")?
        .install(progress::watched_as_here(work))
}
