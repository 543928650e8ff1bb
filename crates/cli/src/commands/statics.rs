//! Equilibrium from rest: `mms run --static` and `mms converge --static`.

mod told;

use anyhow::{Context, Result, bail};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Case, Formulation, FrameOutput, Integrator, Layout as Points, Named, ORDER_TOLERANCE, PerNorm,
    Scheme, Shape, Start, StaticCase, StaticErrors, StaticProblem, StaticRow, StaticStudy, Total,
    Transfer, Volume, expected_of_statics, is_at_rest, uneven_refinement, usual_moment,
};
use serde_json::{Value, json};

use super::study::{Request, Show, Study, conduct};
use crate::arguments::{
    ConvergeOptions, Layout, Precision, RunOptions, SchemeOptions, StaticOptions, Weights,
};
use crate::json::prepare_folder;
use crate::library::Selection;
use crate::processes::with_threads;
use crate::progress::Bar;
use crate::report::{Asked, Form, Report, Section};
use crate::{expect, memory, number, processes};

/// The number of cells where nothing else is said, by dimension.
const USUAL_CELLS: [usize; 3] = [32, 32, 8];

/// Whether a command is asked for the equilibrium: it is said, or nothing of the solution moves and no option says otherwise.
pub(super) fn is_asked(
    selection: &Selection,
    options: &StaticOptions,
    scheme: &SchemeOptions,
    others: &[(&'static str, bool)],
) -> Result<bool> {
    let StaticOptions { is_static, dynamic, load_steps, moment } = options;
    let dynamic_only = of_time(scheme, others);
    if *is_static {
        if let Some(option) = dynamic_only {
            bail!(
                "{option}: an equilibrium from rest has no steps in time, no particles that move, and no inertia; leave {option} out, or \
                 leave --static out for a run through time"
            );
        }
        return Ok(true);
    }
    let rests = selection.is_static() && !dynamic && dynamic_only.is_none();
    let own = [("--load-steps", load_steps.is_some()), ("--moment", moment.is_some())];
    if let Some((option, _)) = own.iter().find(|(_, given)| *given && !rests) {
        bail!("{option}: only an equilibrium from rest has it; add --static");
    }
    Ok(rests)
}

/// An option that is given and that only runs through time have.
fn of_time(scheme: &SchemeOptions, others: &[(&'static str, bool)]) -> Option<&'static str> {
    let SchemeOptions { formulation, layout, shape, .. } = scheme;
    let is_updated_shape = shape.is_some_and(|shape| degree_of(shape).is_none());
    let own = [
        ("--formulation updated-lagrangian", *formulation == Some(Formulation::Updated)),
        ("--shape", is_updated_shape),
        ("--mass", scheme.mass.is_some()),
        ("--composition", scheme.composition.is_some()),
        ("--return-map", scheme.return_map.is_some()),
        ("--volume projected", scheme.volume != Volume::Pointwise),
        ("--layout", matches!(layout, Some(Layout::BodyFitted | Layout::Clipped))),
        ("--cfl-speed", scheme.cfl_speed.is_some()),
        ("--integrator", scheme.integrator != Integrator::Cd),
        ("--transfer", scheme.transfer != Transfer::Flip),
        ("--start", scheme.start != Start::Halved),
        ("--cfl", scheme.cfl.is_some()),
        ("--periods", scheme.periods != 1.0),
        ("--offset", scheme.offset != 0.0),
        ("--grid-angle", scheme.grid_angle != 0.0),
        ("--grid-shift", scheme.grid_shift != 0.0),
        ("--precision f32", scheme.precision == Precision::F32),
    ];
    own.iter().chain(others).find(|(_, given)| *given).map(|(option, _)| *option)
}

/// The degree of splines that weights are in an equilibrium: linear ones are of degree one.
fn degree_of(weights: Weights) -> Option<usize> {
    match weights {
        Weights::Of(Shape::Linear) => Some(1),
        other => other.degree(),
    }
}

/// A solution, and how it is solved.
struct Problem {
    /// The solution, as the command line names it.
    line: String,
    selection: Selection,
    exact: AnySolution<f64>,
    /// On the number of cells that is usual.
    case: StaticCase,
    moves: bool,
}

impl Problem {
    fn new(
        line: &str,
        selection: Selection,
        scheme: &SchemeOptions,
        options: &StaticOptions,
    ) -> Result<Self> {
        if processes::ranks().is_some() {
            bail!("--static: one process solves the whole body; leave mpirun out");
        }
        let exact = selection.build()?;
        let degree = scheme.shape.and_then(degree_of).unwrap_or(3);
        let layout = match scheme.layout {
            Some(Layout::Lattice) => Points::Lattice,
            _ => Points::Gauss,
        };
        let coordinates = scheme.grid.unwrap_or_else(|| Total::coordinates_for(&exact));
        let total = Total { layout, coordinates, ..Total::of_degree(degree) };
        let usual = if layout == Points::Gauss { degree + 1 } else { 2 };
        let moves = !is_at_rest(&exact);
        if let (false, Some(moment)) = (moves, options.moment) {
            bail!("--moment {moment}: nothing of this solution moves; leave --moment out");
        }
        let case = Case {
            scheme: Scheme::Total(total),
            cells: USUAL_CELLS[selection.dimension().clamp(1, 3) - 1],
            per_cell: scheme.ppc.unwrap_or(usual),
            extent: scheme.extent,
            volume: scheme.volume,
            ..Case::default()
        };
        let moment = options.moment.unwrap_or_else(|| usual_moment(&exact));
        let load_steps = options.load_steps.unwrap_or(1);
        let case = StaticCase { case, total, load_steps, moment };
        Ok(Self { line: line.to_owned(), selection, exact, case, moves })
    }

    /// The case on so many cells; refused where it does not fit.
    fn on(&self, cells: usize) -> Result<StaticProblem<'_>> {
        let case = StaticCase { case: Case { cells, ..self.case.case }, ..self.case };
        let problem = StaticProblem::new(&self.exact, &case)?;
        memory::require(problem.plan().bytes, cells)?;
        Ok(problem)
    }

    /// Everything that a result depends on.
    fn settings(&self, cells: &Value) -> Value {
        let Self { selection, case, moves, .. } = self;
        json!({
            "formulation": "total-lagrangian",
            "static": true,
            "version": env!("CARGO_PKG_VERSION"),
            "solution": selection.name(),
            "parameters": selection.parameters(),
            "cells": cells,
            "shape": shape(case.total.degree),
            "layout": case.total.layout.name(),
            "grid": case.total.coordinates.name(),
            "ppc": case.case.per_cell,
            "load_steps": case.load_steps,
            "moment": moves.then_some(case.moment),
            "extent": case.case.extent.map(Named::name),
            "threads": rayon::current_num_threads(),
        })
    }

    /// The problem that was solved, in a line.
    fn caption(&self) -> String {
        let Self { selection, case, moves, .. } = self;
        let StaticCase { total, case: Case { per_cell, .. }, load_steps, moment } = case;
        let at = match moves {
            true => format!(", at {} periods with b - a", number::rounded(*moment, 6)),
            false => String::new(),
        };
        let threads = number::counted(rayon::current_num_threads(), "thread");
        let steps = number::counted(*load_steps, "load step");
        format!(
            "{} ({}): equilibrium from rest by Newton's method{at}, {}, {} layout, {} grid, {per_cell} points per cell and direction, \
             {steps}, {threads}\n",
            selection.name(),
            selection.told_parameters(),
            shape(total.degree),
            total.layout.name(),
            total.coordinates.name(),
        )
    }
}

/// The name of splines of a degree.
fn shape(degree: usize) -> String {
    if degree == 1 { "linear".into() } else { format!("bspline{degree}") }
}

/// `mms run --static`.
pub(super) fn run(selection: Selection, options: &RunOptions) -> Result<bool> {
    let problem = Problem::new(&options.name, selection, &options.scheme, &options.statics)?;
    let cells = options.cells.unwrap_or(problem.case.case.cells);
    let on_grid = problem.on(cells)?;
    let files = Asked(vec![(Form::Json, &options.scheme.json)]).prepare()?;
    let output = particle_file(&problem, options)?;
    with_threads(options.scheme.threads, || {
        let row = {
            let bar = Bar::expecting("starting", None);
            let what = format!("{cells} cells");
            let show = &mut |factor: f64, residuals: &[f64]| {
                bar.show_share(|| told::under_way(&what, factor, residuals), factor);
            };
            on_grid.solve_from(None, show, output.as_ref())?.0
        };
        let mut report = told::run(&problem, &row);
        report.sections.extend(output.filter(|_| row.errors.is_some()).map(on_particle_file));
        report.publish(files)
    })
}

/// The particle file of an equilibrium, if one is asked for.
fn particle_file(problem: &Problem, options: &RunOptions) -> Result<Option<FrameOutput>> {
    let Some(folder) = options.vtk.clone() else { return Ok(None) };
    prepare_folder(&folder).context("--vtk")?;
    let name = problem.selection.name().to_owned();
    let provenance = Some(problem.selection.provenance());
    Ok(Some(FrameOutput { folder, name, count: 1, provenance }))
}

fn on_particle_file(FrameOutput { folder, name, .. }: FrameOutput) -> Section {
    let list = folder.join(format!("{name}.pvd"));
    Section::Note(format!("particle file: {}\n", list.display()))
}

/// A load level: the value of what it is named by, and the problem there.
struct Level {
    value: f64,
    problem: Problem,
}

/// `mms run --static --along`: equilibria one after the other.
pub(super) fn along(
    selection: &Selection,
    options: &RunOptions,
    name: &str,
    values: &[String],
) -> Result<bool> {
    let level = |text: &String| -> Result<Level> {
        let what = || format!("--along {name}={text}");
        let number = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let value = number.with_context(|| format!("{}: '{text}' is not a number", what()))?;
        let (here, moment) = match name {
            "moment" => (selection.clone(), Some(value)),
            _ => (
                selection.with(&[(name.to_owned(), value)]).with_context(what)?,
                options.statics.moment,
            ),
        };
        let statics = StaticOptions { moment, ..options.statics };
        let problem = Problem::new(&options.name, here, &options.scheme, &statics);
        Ok(Level { value, problem: problem.with_context(what)? })
    };
    if name == "moment" && options.statics.moment.is_some() {
        bail!("--moment: the moments are those of --along; leave --moment out");
    }
    let levels = values.iter().map(level).collect::<Result<Vec<_>>>()?;
    let Some(last) = levels.last() else { bail!("--along {name}: no values") };
    let cells = options.cells.unwrap_or(last.problem.case.case.cells);
    let on_grid = levels.iter().map(|level| level.problem.on(cells)).collect::<Result<Vec<_>>>()?;
    let files = Asked(vec![(Form::Json, &options.scheme.json)]).prepare()?;
    let output = particle_file(&last.problem, options)?;
    with_threads(options.scheme.threads, || {
        let (mut rows, mut state) = (Vec::new(), None);
        {
            let bar = Bar::expecting("starting", None);
            for (level, case) in levels.iter().zip(&on_grid) {
                let what = format!("{name} = {}", level.value);
                let done = rows.len() as f64;
                let show = &mut |factor: f64, residuals: &[f64]| {
                    let share = (done + factor) / levels.len() as f64;
                    bar.show_share(|| told::under_way(&what, factor, residuals), share);
                };
                let output = output.as_ref().filter(|_| rows.len() + 1 == levels.len());
                let (row, reached) = case.solve_from(state.as_ref(), show, output).with_context(|| {
                    format!(
                        "--along {what}: levels of a path belong to one body; vary a parameter that leaves the body as it is, or run the \
                         levels one by one with --set"
                    )
                })?;
                rows.push(row);
                state = reached;
                if state.is_none() {
                    break;
                }
            }
        }
        let mut report = told::path(name, &levels, &rows);
        report.sections.extend(output.filter(|_| state.is_some()).map(on_particle_file));
        report.publish(files)
    })
}

/// `mms converge --static`.
pub(super) fn converge(selection: Selection, options: &ConvergeOptions) -> Result<bool> {
    let problem = Problem::new(&options.name, selection, &options.scheme, &options.statics)?;
    let cases = options.cells.iter().map(|cells| problem.on(*cells)).collect::<Result<Vec<_>>>()?;
    let expected = match options.expect.as_deref().map(expect::parse).transpose()? {
        Some(all) if all.v != PerNorm::default() => {
            bail!("--expect: a body at rest has no velocity v; its fields are u, F and P")
        }
        Some(all) => StaticErrors { u: all.u, F: all.F, P: all.P },
        None => expected_of_statics(&problem.exact, &problem.case.total),
    };
    let study = Orders {
        problem: &problem,
        cases,
        expected,
        tolerance: options.tolerance.unwrap_or(ORDER_TOLERANCE),
        is_strict: options.expect.is_some() || options.tolerance.is_some(),
    };
    conduct(&study, &Request::of_orders(options))
}

/// A series of grids.
struct Orders<'a> {
    problem: &'a Problem,
    cases: Vec<StaticProblem<'a>>,
    expected: StaticErrors<PerNorm<Option<f64>>>,
    tolerance: f64,
    /// Whether the orders are more than the promises of theory, which are no failure on two grids.
    is_strict: bool,
}

impl Study for Orders<'_> {
    type Found = StaticRow;

    fn keys(&self) -> Vec<Value> {
        let key = |case: &StaticProblem<'_>| self.problem.settings(&json!(case.case().case.cells));
        self.cases.iter().map(key).collect()
    }

    fn work(&self) -> Vec<f64> {
        self.cases.iter().map(|case| case.plan().bytes).collect()
    }

    fn measure(&self, index: usize, show: &Show<'_>) -> Result<StaticRow> {
        let case = &self.cases[index];
        let what = format!("{} cells", case.case().case.cells);
        Ok(case.solve(&mut |factor, residuals| {
            show.share(|| told::under_way(&what, factor, residuals), factor);
        })?)
    }

    fn report(&self, found: Vec<StaticRow>) -> Result<Report> {
        let floors: Vec<_> = self.cases.iter().map(|case| case.plan().floors).collect();
        let cells: Vec<usize> = found.iter().map(|row| row.cells).collect();
        let not_judged = uneven_refinement(&self.problem.exact, &cells);
        let nothing = StaticErrors::default();
        let expected = if not_judged.is_some() { &nothing } else { &self.expected };
        let mut study = StaticStudy::new(found, expected, self.tolerance, &floors);
        if !self.is_strict {
            study.spare_coarse_grids();
        }
        Ok(told::orders(self.problem, &study, not_judged))
    }
}
