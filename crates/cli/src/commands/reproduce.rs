//! `mms reproduce`: the original study of Wallstedt and Guilkey, again, on both of its problems.

mod claims;
mod cost;
mod drift;
mod hero;
mod limits;
mod pictures;
mod report;
mod section;

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{
    Case, CostModel, Expected, Field, FrameOutput, Integrator, ORDER_TOLERANCE, Outputs, Progress,
    Row, Scheme, Shape, Start, Status, StepError, Study, Sweep, Temporal, Updated,
    expected_in_space, expected_in_time,
};

use super::converge::{
    Verdicts, difference_curve, difference_tables, judge, judge_differences, results as of_study,
    tables, temporal_results, verdict_table,
};
use super::problem::{Model, Problem, extent};
use super::scheme::usual;
use crate::arguments::{Precision, ReproduceOptions};
use crate::json::{Output, prepare_folder};
use crate::library::Selection;
use crate::processes::with_threads;
use crate::progress::{Agenda, Bar};
use crate::report::{Files, Form, Report, Section as Part};
use crate::svg::{Curve, Plot};
use crate::table::{self, Table};
use crate::{number, sheets, terminal};

/// The study's problems, by name.
const PROBLEMS: [&str; 2] = ["axis-aligned", "ring"];
/// The study's density, which the library's solutions do not have.
const DENSITY: (&str, f64) = ("rho0", 1.0);
const CD: Integrator = Integrator::Cd;
/// The schemes compared in space.
const SPACE: [(Shape, Integrator); 5] = [
    (Shape::Gimp, CD),
    (Shape::Gimp, Integrator::Usl),
    (Shape::Gimp, Integrator::Usf),
    (Shape::Ugimp, CD),
    (Shape::Linear, CD),
];
/// The schemes compared in time.
const TIME: [(Shape, Integrator); 3] =
    [(Shape::Gimp, CD), (Shape::Gimp, Integrator::Usl), (Shape::Ugimp, CD)];
const CELLS: [usize; 5] = [8, 16, 32, 64, 128];
const CFLS: [f64; 8] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];
/// The grid of the studies in time and of the particle files.
const GRID: usize = 32;
/// One frame each sixteenth of the period.
const FRAMES: u64 = 17;
/// The grids and the CFL number of the study in space without a visible temporal error.
const SMALL_STEP_CELLS: [usize; 4] = [8, 16, 32, 64];
const SMALL_STEP: f64 = 0.05;
/// The schemes whose differences on one grid are measured, and the CFL numbers.
const DIFFERENCES: [(Shape, Integrator); 2] = [(Shape::Gimp, CD), (Shape::Gimp, Integrator::Usl)];
const DIFFERENCE_CFLS: [f64; 4] = [0.4, 0.2, 0.1, 0.05];
/// The gentle study: these differences with a small amplitude on a fine grid, where the order of centred differences shows.
const GENTLE: f64 = 1e-3;
const GENTLE_GRID: usize = 64;
const GENTLE_CFLS: [f64; 4] = [0.6, 0.4, 0.2, 0.1];
/// CFL number of the gentle study down to which centred differences are claimed to be of second order.
const GENTLE_RANGE: f64 = 0.15;

/// A study of one scheme.
struct Series {
    scheme: (Shape, Integrator),
    study: Study,
    verdicts: Verdicts,
}

/// The differences of one scheme on one grid.
struct Differences {
    scheme: (Shape, Integrator),
    found: Temporal,
    verdicts: Verdicts,
}

impl Series {
    /// The scheme as `gimp+cd`.
    fn name(&self) -> String {
        name(self.scheme)
    }

    /// The largest displacement error of case `index`, if its run reached the end.
    fn error(&self, index: usize) -> Option<f64> {
        let row = self.study.rows.get(index)?;
        (row.status == Status::Ok).then_some(row.errors.u.linf)
    }
}

/// All that was measured for one problem.
struct Results {
    problem: &'static str,
    space: Vec<Series>,
    time: Vec<Series>,
    /// gimp+usl at a small time step.
    small_step: Series,
    /// On the standard grid, at the standard amplitude.
    differences: Vec<Differences>,
    /// gimp+cd on the standard grid, once more from the exact velocity at minus half a step.
    exact_start: Row,
}

pub(crate) fn reproduce(options: &ReproduceOptions) -> Result<bool> {
    if let Some(file) = &options.hero {
        let picture = Output::prepare(file).context("--hero")?;
        return with_threads(options.threads, || {
            picture.write_text(&hero::svg()?)?;
            Ok(true)
        });
    }
    let out = &options.out;
    let report = out.join("report.html");
    for problem in PROBLEMS {
        prepare_folder(&out.join(problem)).context("--out")?;
    }
    let page = Output::prepare(&report).context("--out")?;
    let output = Output::prepare(&out.join("report.md")).context("--out")?;
    with_threads(options.threads, || {
        let mut text = introduction();
        let paces = PROBLEMS.map(Pace::of).into_iter().collect::<Result<Vec<_>>>()?;
        let agenda = Agenda::new(total_seconds(&paces, options.budget));
        let mut results = Vec::new();
        for (problem, pace) in PROBLEMS.into_iter().zip(&paces) {
            let measured = measure_problem(problem, &out.join(problem), pace, &agenda)?;
            let (terminal_text, report_text) = summary(&measured);
            agenda.aside(|| terminal::say(&terminal_text))?;
            text += &report_text;
            results.push(measured);
        }
        let gentle = gentle_differences(&out.join(PROBLEMS[0]), &paces[0], &agenda)?;
        let claims = claims::judge(&results[0], &results[1], &gentle);
        let (said, written) = claims::texts(&claims);
        agenda.aside(|| terminal::say(&said))?;
        text += &written;
        let energy = drift::section(out, &paces, &agenda)?;
        let stable = limits::section(out, &agenda.next(limits::seconds(&paces[0])))?;
        let sections = [energy, stable, cost::section(out, options.budget, &agenda)?];
        drop(agenda);
        for section in &sections {
            text += section.markdown();
        }
        output.write_text(&text)?;
        page.write_text(&report::html(out, &results, &gentle, &claims, &sections)?)?;
        terminal::say(&format!("report, data, plots and particle files: {}\n", report.display()))?;
        Ok(true)
    })
}

/// The study's density and the `values` of other parameters.
fn study_parameters(values: &[(&str, f64)]) -> Vec<(String, f64)> {
    let all = values.iter().chain([&DENSITY]);
    all.map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

/// A problem with [`study_parameters`].
fn studied(problem: &str, values: &[(&str, f64)]) -> Result<Selection> {
    Selection::new(problem, &study_parameters(values))
}

/// Cost of runs of a problem, from a few steps made just now.
struct Pace {
    model: Model,
    learnt: Option<CostModel>,
}

impl Pace {
    fn of(problem: &str) -> Result<Self> {
        /// Spent on the steps.
        const EFFORT: Duration = Duration::from_millis(100);
        let model = Model::new(&studied(problem, &[])?, Precision::F64)?;
        let usual = model.discretized(&usual(Shape::Gimp, CD, GRID));
        // Only the bar depends on it.
        let learnt = usual.and_then(|usual| CostModel::calibrate(&usual, EFFORT)).ok();
        Ok(Self { model, learnt })
    }

    /// The seconds that cases will take; what nobody can tell counts as nothing.
    fn seconds(&self, cases: &[Case]) -> f64 {
        let one = |case| {
            let case = self.model.discretized(case).ok()?;
            Some(self.learnt.as_ref()?.predict(case.plan())?.total_s)
        };
        cases.iter().filter_map(one).sum()
    }
}

/// The seconds of a scheme's differences: every run once, and once more with half the finest step.
fn difference_seconds(
    pace: &Pace,
    (shape, integrator): (Shape, Integrator),
    cells: usize,
    cfls: &[f64],
) -> f64 {
    let base = usual(shape, integrator, cells);
    let finest = cfls.iter().copied().reduce(f64::min).map(|cfl| cfl / 2.0);
    let all = cfls.iter().copied().chain(finest);
    pace.seconds(&all.map(|cfl| Case { cfl, ..base }).collect::<Vec<_>>())
}

/// The seconds that the whole report will take.
fn total_seconds(paces: &[Pace], budget: f64) -> f64 {
    let mut total = limits::seconds(&paces[0]);
    for pace in paces {
        let study = |(shape, integrator), sweep: &Sweep, cfl: f64| {
            pace.seconds(&sweep.cases(&Case { cfl, ..usual(shape, integrator, GRID) }))
        };
        let usual_cfl = Case::default().cfl;
        for scheme in SPACE {
            total += study(scheme, &Sweep::Cells(CELLS.to_vec()), usual_cfl);
        }
        for scheme in TIME {
            total += study(scheme, &Sweep::Cfls(CFLS.to_vec()), usual_cfl);
        }
        let few = Sweep::Cells(SMALL_STEP_CELLS.to_vec());
        total += study((Shape::Gimp, Integrator::Usl), &few, SMALL_STEP);
        for scheme in DIFFERENCES {
            total += difference_seconds(pace, scheme, GRID, &DIFFERENCE_CFLS);
        }
        total += pace.seconds(&drift::cases()) + budget;
    }
    for scheme in DIFFERENCES {
        total += difference_seconds(&paces[0], scheme, GENTLE_GRID, &GENTLE_CFLS);
    }
    total
}

/// The differences of the first problem at a small amplitude on a fine grid.
fn gentle_differences(folder: &Path, pace: &Pace, agenda: &Agenda) -> Result<Vec<Differences>> {
    let selection = studied(PROBLEMS[0], &[("A", GENTLE)])?;
    let all = DIFFERENCES.map(|scheme| {
        let bar = agenda.next(difference_seconds(pace, scheme, GENTLE_GRID, &GENTLE_CFLS));
        let ladder = TimeLadder { kind: "gentle", cells: GENTLE_GRID, cfls: &GENTLE_CFLS };
        measure_differences(&selection, scheme, &ladder, folder, &bar)
    });
    all.into_iter().collect()
}

/// Time steps on one grid.
struct TimeLadder<'a> {
    /// The word for them in names of files.
    kind: &'a str,
    cells: usize,
    cfls: &'a [f64],
}

/// Measures the differences of a scheme on one grid and writes them into `folder`.
fn measure_differences(
    selection: &Selection,
    scheme: (Shape, Integrator),
    ladder: &TimeLadder<'_>,
    folder: &Path,
    bar: &Bar,
) -> Result<Differences> {
    let &TimeLadder { kind, cells, cfls } = ladder;
    let base = usual(scheme.0, scheme.1, cells);
    let problem = Problem::of(selection.clone(), base)?;
    let cases = problem.model.admit(&[base])?;
    let [case] = cases.as_slice() else { bail!("differences have one case") };
    let files = files(folder, kind, scheme)?;
    let what = format!("{}, {kind}, {}", selection.name(), name(scheme));
    let mut show = |progress: Progress| {
        bar.show(&format!("{what}, CFL {}", cfls[progress.case]), progress);
    };
    let found = case.differences(cfls, &mut show)?;
    let verdicts =
        judge_differences(&found, &expected_in_time(&problem.model.exact, &base), ORDER_TOLERANCE);
    let report = Report {
        settings: problem.settings(case.plan().extent, cells, cfls),
        results: [("temporal".to_owned(), temporal_results(&found, &verdicts))]
            .into_iter()
            .collect(),
        sections: vec![Part::Sheet(sheets::temporal(&found))],
        ..Report::new("temporal")
    };
    report.write(files)?;
    Ok(Differences { scheme, found, verdicts })
}

/// The files of a study of one scheme.
fn files(folder: &Path, kind: &str, scheme: (Shape, Integrator)) -> Result<Files> {
    let stem = format!("{kind}-{}-{}", scheme.0, scheme.1);
    Files::of_stem(folder, &stem, &[Form::Json, Form::Csv])
}

/// Measures a series of one scheme and writes it into `folder`.
fn measure_series(
    selection: &Selection,
    kind: &str,
    (scheme, sweep): ((Shape, Integrator), &Sweep),
    cfl: f64,
    folder: &Path,
    (pace, agenda): (&Pace, &Agenda),
) -> Result<Series> {
    let base = Case { cfl, ..usual(scheme.0, scheme.1, GRID) };
    let problem = Problem::of(selection.clone(), base)?;
    let cases = problem.model.admit(&sweep.cases(&base))?;
    let files = files(folder, kind, scheme)?;
    let bar = agenda.next(pace.seconds(&sweep.cases(&base)));
    let what = format!("{}, {kind}, {}", selection.name(), name(scheme));
    let study = Study::measure(&cases, sweep, &mut |progress| bar.show(&what, progress))?;
    let expected = match sweep {
        Sweep::Cells(_) => expected_in_space(&problem.model.exact, &base),
        Sweep::Cfls(_) => Expected::default(),
    };
    let verdicts = judge(&study, sweep, &expected, ORDER_TOLERANCE);
    let extent = extent(&cases);
    let report = Report {
        settings: match sweep {
            Sweep::Cells(cells) => problem.settings(extent, cells, base.cfl),
            Sweep::Cfls(cfls) => problem.settings(extent, base.cells, cfls),
        },
        results: of_study(&study, &verdicts),
        sections: vec![Part::Sheet(sheets::study(&study))],
        ..Report::new("converge")
    };
    report.write(files)?;
    Ok(Series { scheme, study, verdicts })
}

/// Measures everything for one problem and writes its data into `folder`.
fn measure_problem(
    problem: &'static str,
    folder: &Path,
    pace: &Pace,
    agenda: &Agenda,
) -> Result<Results> {
    let selection = studied(problem, &[])?;
    let series = |kind: &str, scheme: (Shape, Integrator), sweep: &Sweep, cfl: f64| {
        measure_series(&selection, kind, (scheme, sweep), cfl, folder, (pace, agenda))
    };
    let usual_cfl = Case::default().cfl;
    let cells = Sweep::Cells(CELLS.to_vec());
    let space = SPACE.map(|scheme| series("space", scheme, &cells, usual_cfl));
    let space = space.into_iter().collect::<Result<Vec<_>>>()?;
    let cfls = Sweep::Cfls(CFLS.to_vec());
    let time = TIME.map(|scheme| series("time", scheme, &cfls, usual_cfl));
    let time = time.into_iter().collect::<Result<Vec<_>>>()?;
    let few = Sweep::Cells(SMALL_STEP_CELLS.to_vec());
    let usl = (Shape::Gimp, Integrator::Usl);
    let small_step = series("small-step", usl, &few, SMALL_STEP)?;
    let differences = DIFFERENCES.map(|scheme| {
        let cfls = &DIFFERENCE_CFLS;
        let bar = agenda.next(difference_seconds(pace, scheme, GRID, cfls));
        let ladder = TimeLadder { kind: "differences", cells: GRID, cfls };
        measure_differences(&selection, scheme, &ladder, folder, &bar)
    });
    let differences = differences.into_iter().collect::<Result<Vec<_>>>()?;

    let frames = FrameOutput {
        folder: folder.join("particles"),
        name: problem.to_owned(),
        count: FRAMES,
        provenance: Some(selection.provenance()),
    };
    let silent = &mut |_| ();
    let mut outputs = Outputs { frames: Some(&frames), ..Outputs::new(silent) };
    let model = &pace.model;
    model.discretized(&usual(Shape::Gimp, CD, GRID))?.run(&mut outputs)?;
    let exact_start = Updated { start: Start::Exact, ..Updated::default() };
    let exact_start = Case { scheme: Scheme::Updated(exact_start), ..usual(Shape::Gimp, CD, GRID) };
    let exact_start = model.discretized(&exact_start)?.run(&mut Outputs::new(&mut |_| ()))?;
    pictures::write_contrast(&selection, model, problem, folder)?;
    let results = Results { problem, space, time, small_step, differences, exact_start };
    for (kind, svg) in [("space", space_plot(&results)), ("time", time_plot(&results))] {
        Output::prepare(&folder.join(format!("{kind}.svg")))?.write_text(&svg)?;
    }
    Ok(results)
}

/// The largest displacement error of each scheme over the grid spacing.
fn space_plot(results: &Results) -> String {
    let curve = |one: &Series| {
        let rows = one.study.rows.iter().enumerate();
        let cases = rows.map(|(index, row)| (row.h, one.error(index)));
        Curve::new(one.name(), cases, one.study.orders.u.linf.fit)
    };
    let title = format!("{}: error in space", results.problem);
    plot(&title, "grid spacing h [m]", results.space.iter().map(curve).collect())
}

/// The largest displacement error of each scheme over the time step.
fn time_plot(results: &Results) -> String {
    let curve = |one: &Series| {
        let rows = one.study.rows.iter().enumerate();
        let cases = rows.map(|(index, row)| (row.dt, one.error(index)));
        Curve::new(one.name(), cases, one.study.orders.u.linf.fit)
    };
    let title = format!("{}: error in time, {GRID} cells", results.problem);
    plot(&title, "time step dt [s]", results.time.iter().map(curve).collect())
}

/// The largest difference of the displacement over the time step.
fn difference_plot(title: &str, differences: &[Differences]) -> String {
    let curves = differences.iter().map(|one| difference_curve(name(one.scheme), &one.found));
    Plot {
        title,
        x: "time step dt [s]",
        y: "L_inf difference of u [m]",
        curves: curves.collect(),
        note: "",
        orders: &[1, 2],
        floor: None,
    }
    .svg()
}

fn plot(title: &str, x: &str, curves: Vec<Curve>) -> String {
    Plot { title, x, y: "L_inf error of u [m]", curves, note: "", orders: &[1, 2], floor: None }
        .svg()
}

fn introduction() -> String {
    format!(
        "# The original study, again\n\n\
         P. Wallstedt and J. Guilkey, *Evaluation of Time Integration Schemes for the Generalized Interpolation \
         Material Point Method*, measured by mmsmith {} with {} thread(s).\n\n\
         Both problems with the density 1 and their other standard parameters, one period, 2 particles per cell and direction, CFL 0.4 on \
         the bar wave speed where it is not varied, cd from the velocity at time zero with a halved first \
         acceleration. Errors are in units of length: L_inf is the largest over all particles and steps. Rates are \
         ln(e_i/e_(i-1)) / ln(h_i/h_(i-1)), in time with dt for h. All fields and norms are in the JSON and CSV \
         files of each folder; the particle files (open the .pvd) hold the run of gimp+cd on {GRID} cells.\n",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads()
    )
}

/// The tables of one problem, for the terminal and for the report.
fn summary(results: &Results) -> (String, String) {
    let problem = results.problem;
    let space = compare(&results.space, "cells", |row| row.cells.to_string());
    let time = compare(&results.time, "CFL", |row| format!("{:.4}", row.cfl));
    let early = |series| {
        let table = stopped(&[series]);
        let text = table.as_ref().map(|table| format!("stopped early\n{}", table.text()));
        let block = table.map(|table| format!("\nRuns that stopped:\n\n{}", table.markdown()));
        (text.unwrap_or_default(), block.unwrap_or_default())
    };
    let (stops_space, block_space) = early(&results.space);
    let (stops_time, block_time) = early(&results.time);
    let said = format!(
        "\n{problem}: L_inf error of u [m], and its order in h\n{}{stops_space}\
         \n{problem}: L_inf error of u [m] on {GRID} cells, and its order in dt\n{}{stops_time}",
        space.text(),
        time.text()
    );
    let mut written = format!(
        "\n## {problem}\n\n### In space\n\n![error of u against h]({problem}/space.svg)\n\n{}{}\n\
         ### In time, on {GRID} cells\n\n![error of u against dt]({problem}/time.svg)\n\n{}{}\n\
         ### All fields of gimp+cd, in space\n",
        space.markdown(),
        block_space,
        time.markdown(),
        block_time,
    );
    let cells = Sweep::Cells(CELLS.to_vec());
    for (field, table) in tables(&results.space[0].study, &cells, &results.space[0].verdicts) {
        written +=
            &format!("\nError of {field}:\n\n{}", errors_with_units(table, field).markdown());
    }
    (said, written)
}

/// A table of errors of a field, or of differences, with the units of the two problems: those of the SI.
fn errors_with_units(table: Table, field: Field) -> Table {
    let table = table.with_unit(&["h"], "m").with_unit(&["dt"], "s");
    let unit = match field {
        Field::Displacement => "m",
        Field::Velocity => "m/s",
        Field::Stress => "Pa",
        // A pure number.
        Field::DeformationGradient => return table,
    };
    table.with_unit(&["linf", "l2", "l1"], unit)
}

/// The runs that did not come to their end; no table where all did.
fn stopped(studies: &[&[Series]]) -> Option<Table> {
    let mut table = Table::new(5, ["scheme", "cells", "CFL", "step", "what happened"]);
    let mut any = false;
    for (series, row) in
        studies.iter().copied().flatten().flat_map(|s| s.study.rows.iter().map(move |row| (s, row)))
    {
        let Some((step, what)) = end(&row.status) else { continue };
        any = true;
        let cfl = number::rounded(row.cfl, 4);
        table.row([series.name(), row.cells.to_string(), cfl, step.to_string(), what]);
    }
    any.then_some(table)
}

/// The step that ended a run too early, and why; nothing for a run that came to its end.
fn end(status: &Status) -> Option<(u64, String)> {
    let short = |value: f64| number::rounded(value, 3);
    let told = match status {
        Status::Ok
        | Status::Unresolved { .. }
        | Status::NotFinite { .. }
        | Status::Exceeds { .. } => return None,
        Status::Stopped(StepError::Inverted { step, time, particle, J }) => {
            let (time, J) = (short(*time), short(*J));
            (
                *step as u64,
                format!("at t = {time} s particle {particle} is turned inside out: J = {J}"),
            )
        }
        Status::Stopped(StepError::NotFinite { step, time, particle, .. }) => {
            let time = short(*time);
            (*step as u64, format!("at t = {time} s a value of particle {particle} is not finite"))
        }
        Status::Stopped(StepError::LeftGrid { step, time, particle, .. }) => {
            (*step as u64, format!("at t = {} s particle {particle} left the grid", short(*time)))
        }
        Status::Stopped(StepError::TooLarge { step, time, particle, .. }) => {
            let time = short(*time);
            (
                *step as u64,
                format!(
                    "at t = {time} s the box of particle {particle} is wider than the weights support"
                ),
            )
        }
        Status::Unstable { step, time, particle, error, size } => {
            let [time, error, size] = [*time, *error, *size].map(short);
            (
                *step,
                format!(
                    "at t = {time} s particle {particle} is {error} m from its exact place, further than the body is \
                     large ({size} m)"
                ),
            )
        }
        Status::Cut { step, time } => {
            (*step, format!("its time was over at t = {} s", short(*time)))
        }
    };
    Some(told)
}

/// One column of errors and one of rates for each scheme.
fn compare(series: &[Series], first: &str, label: impl Fn(&Row) -> String) -> Table {
    let mut header = vec![first.to_owned()];
    for one in series {
        header.extend([one.name(), "rate".to_owned()]);
    }
    let mut table = Table::new(0, header);
    for index in 0..series[0].study.rows.len() {
        let mut cells = vec![label(&series[0].study.rows[index])];
        for one in series {
            let local = index.checked_sub(1).and_then(|pair| one.study.orders.u.linf.local[pair]);
            let error = one.error(index).map_or_else(|| "stopped".to_owned(), table::error);
            cells.extend([error, table::rate(local)]);
        }
        table.row(cells);
    }
    let mut fit = vec!["fit".to_owned()];
    for one in series {
        fit.extend([String::new(), table::rate(one.study.orders.u.linf.fit)]);
    }
    table.row(fit);
    table
}

fn name((shape, integrator): (Shape, Integrator)) -> String {
    format!("{shape}+{integrator}")
}
