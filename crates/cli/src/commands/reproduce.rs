//! `mms reproduce`: the original study of Wallstedt and Guilkey, again, on both of its problems.

mod claims;
mod plot;

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use mmsmith_verify::{
    Case, FrameOutput, Outputs, Progress, Row, Start, Status, Study, Sweep, converge as measure,
    run as simulate,
};

use super::converge::{document, stops, tables};
use super::{Model, case, with_threads};
use crate::arguments::{Integrator, Precision, ReproduceOptions, SchemeOptions, Shape};
use crate::csv;
use crate::json::Output;
use crate::library::Selection;
use crate::progress::Bar;
use crate::table::{self, Table};
use crate::terminal;

/// The study's problems, by name.
const PROBLEMS: [&str; 2] = ["axis-aligned", "ring"];
/// The schemes compared in space.
const SPACE: [(Shape, Integrator); 5] = [
    (Shape::Gimp, Integrator::Cd),
    (Shape::Gimp, Integrator::Usl),
    (Shape::Gimp, Integrator::Usf),
    (Shape::Ugimp, Integrator::Cd),
    (Shape::Linear, Integrator::Cd),
];
/// The schemes compared in time.
const TIME: [(Shape, Integrator); 3] =
    [(Shape::Gimp, Integrator::Cd), (Shape::Gimp, Integrator::Usl), (Shape::Ugimp, Integrator::Cd)];
const CELLS: [usize; 5] = [8, 16, 32, 64, 128];
const CFLS: [f64; 8] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];
/// The grid of the studies in time and of the particle files.
const GRID: usize = 32;
const FRAMES: u64 = 20;

/// A study of one scheme.
struct Series {
    scheme: (Shape, Integrator),
    study: Study,
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
    /// gimp+cd on the standard grid, once more from the exact velocity at minus half a step.
    exact_start: Row,
}

pub(crate) fn reproduce(options: &ReproduceOptions) -> Result<bool> {
    let out = &options.out;
    let report = out.join("report.md");
    for problem in PROBLEMS {
        let folder = out.join(problem);
        fs::create_dir_all(&folder)
            .with_context(|| format!("--out: cannot make the folder {}", folder.display()))?;
    }
    let output = Output::prepare(&report).context("--out")?;
    with_threads(options.threads, || {
        let mut text = introduction();
        let mut results = Vec::new();
        for problem in PROBLEMS {
            let measured = measure_problem(problem, &out.join(problem))?;
            let (terminal_text, report_text) = summary(&measured);
            terminal::say(&terminal_text)?;
            text += &report_text;
            results.push(measured);
        }
        let (said, written) = claims::texts(&claims::judge(&results[0], &results[1]));
        terminal::say(&said)?;
        text += &written;
        output.write_text(&text)?;
        terminal::say(&format!("report, data, plots and particle files: {}\n", report.display()))?;
        Ok(true)
    })
}

/// Measures everything for one problem and writes its data into `folder`.
fn measure_problem(problem: &'static str, folder: &Path) -> Result<Results> {
    let selection = Selection::new(problem, &[])?;
    let model = Model::new(&selection, Precision::F64)?;
    let series = |kind: &str, scheme: (Shape, Integrator), sweep: &Sweep| -> Result<Series> {
        let options = SchemeOptions::usual(scheme.0, scheme.1);
        let base = case(&options, GRID)?;
        let extent = model.admit(&sweep.cases(&base))?;
        let stem = format!("{kind}-{}-{}", word(scheme.0), word(scheme.1));
        let json = Output::prepare(&folder.join(format!("{stem}.json")))?;
        let csv = Output::prepare(&folder.join(format!("{stem}.csv")))?;
        let bar = Bar::new();
        let what = format!("{problem}, {kind}, {}", name(scheme));
        let mut show = |progress: Progress| bar.show(&what, progress);
        let study = measure(&model.exact, model.arithmetic(), &base, sweep, &mut show)?;
        json.write(&document(&selection, &options, extent, &base, sweep, &study))?;
        csv.write_text(&csv::text(&study))?;
        Ok(Series { scheme, study })
    };
    let cells = Sweep::Cells(CELLS.to_vec());
    let space = SPACE.map(|scheme| series("space", scheme, &cells));
    let space = space.into_iter().collect::<Result<Vec<_>>>()?;
    let cfls = Sweep::Cfls(CFLS.to_vec());
    let time = TIME.map(|scheme| series("time", scheme, &cfls));
    let time = time.into_iter().collect::<Result<Vec<_>>>()?;
    for (kind, series, axis) in [("space", &space, "h"), ("time", &time, "dt")] {
        let title = format!("{problem}: error of u against {axis}");
        let svg = plot::svg(&title, axis, series);
        Output::prepare(&folder.join(format!("{kind}.svg")))?.write_text(&svg)?;
    }

    let base = case(&SchemeOptions::usual(Shape::Gimp, Integrator::Cd), GRID)?;
    let frames =
        FrameOutput { folder: folder.join("particles"), name: problem.to_owned(), count: FRAMES };
    let mut outputs = Outputs { progress: &mut |_| (), frames: Some(&frames) };
    simulate(&model.exact, model.arithmetic(), &base, &mut outputs)?;
    let base = Case { start: Start::Exact, ..base };
    let mut outputs = Outputs { progress: &mut |_| (), frames: None };
    let exact_start = simulate(&model.exact, model.arithmetic(), &base, &mut outputs)?;
    Ok(Results { problem, space, time, exact_start })
}

fn introduction() -> String {
    format!(
        "# The original study, again\n\n\
         P. Wallstedt and J. Guilkey, *Evaluation of Time Integration Schemes for the Generalized Interpolation \
         Material Point Method*, measured by mmsmith {} with {} thread(s).\n\n\
         Both problems with their standard parameters, one period, 2 particles per cell and direction, CFL 0.4 on \
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
    let stopped = |series: &[Series]| -> String {
        let lines = series.iter().filter(|s| !stops(&s.study).is_empty());
        lines.map(|s| format!("{}:\n{}", s.name(), stops(&s.study))).collect()
    };
    let (stops_space, stops_time) = (stopped(&results.space), stopped(&results.time));
    let said = format!(
        "\n{problem}: L_inf error of u, and its order in h\n{}{stops_space}\
         \n{problem}: L_inf error of u on {GRID} cells, and its order in dt\n{}{stops_time}",
        space.text(),
        time.text()
    );
    let block = |text: &str| {
        if text.is_empty() { String::new() } else { format!("\n```text\n{text}```\n") }
    };
    let mut written = format!(
        "\n## {problem}\n\n### In space\n\n![error of u against h]({problem}/space.svg)\n\n{}{}\n\
         ### In time, on {GRID} cells\n\n![error of u against dt]({problem}/time.svg)\n\n{}{}\n\
         ### All fields of gimp+cd, in space\n",
        space.markdown(),
        block(&stops_space),
        time.markdown(),
        block(&stops_time),
    );
    let cells = Sweep::Cells(CELLS.to_vec());
    for (field, table) in tables(&results.space[0].study, &cells) {
        written += &format!("\nError of {field}:\n\n{}", table.markdown());
    }
    (said, written)
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
    format!("{}+{}", word(shape), word(integrator))
}

/// An argument's value as it is typed.
fn word(value: impl clap::ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}
