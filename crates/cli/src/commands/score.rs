//! `mms score`: errors and orders of another solver's output.

mod advice;
mod document;
mod inputs;
mod newton;
mod text;

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Agreement, Case, Input, ORDER_TOLERANCE, Placing, Remark, Scheme, Score,
    ScoreOptions as Reading, ScoreRow, Times, Updated, against, compare_recordings,
    score as measure,
};
use mmsmith_vtk::foreign::column;
use serde_json::json;

use super::blind;
use super::growth::Warnings;
use crate::arguments::ScoreOptions;
use crate::expect;
use crate::library::Selection;
use crate::processes::with_threads;
use crate::report::{Asked, Files, Form, Report, Section};

pub(crate) fn score(options: &ScoreOptions) -> Result<bool> {
    if let Some(log) = &options.newton {
        return newton::judge(log, options.json.as_ref());
    }
    let Some(name) = &options.name else { bail!("the name of a solution is missing") };
    let selection = Selection::new(name, &options.parameters.set)?;
    let inputs = inputs::inputs(options)?;
    let how = reading(&selection, options)?;
    let output = Asked(vec![(Form::Json, &options.json)]).prepare()?;
    with_threads(options.threads, || {
        let exact = selection.build()?;
        if options.differences.is_empty() {
            scored(options, &selection, &exact, &inputs, &how, output)
        } else {
            compared(options, &selection, &exact, &inputs, &how, output)
        }
    })
}

/// How the recordings are read and judged.
fn reading(selection: &Selection, options: &ScoreOptions) -> Result<Reading> {
    let mut map = BTreeMap::new();
    for (role, name) in &options.map {
        if map.insert(*role, name.clone()).is_some() {
            bail!("--map {role}=... is given twice");
        }
    }
    Ok(Reading {
        map,
        points: options.points,
        times: times(options)?,
        placing: Placing {
            origin: options.origin.clone(),
            length_unit: options.length_unit,
            time_unit: options.time_unit,
            velocity_unit: None,
            axes: options.axes.clone(),
            inside: options.inside,
        },
        periods: options.periods,
        provenance: Some(selection.provenance()),
        expected: options.expect.as_deref().map_or(Ok(BTreeMap::new()), expect::of_recordings)?,
        exchange: None,
        tolerance: options.tolerance.unwrap_or(ORDER_TOLERANCE),
    })
}

/// The times of the frames, where options give them.
fn times(options: &ScoreOptions) -> Result<Times> {
    if let Some(file) = &options.times_from {
        return Ok(Times::At(column(file)?));
    }
    if let Some(step) = options.frame_step {
        return Ok(Times::Step(step));
    }
    let times: Vec<f64> = options.time.iter().chain(&options.times).copied().collect();
    Ok(if times.is_empty() { Times::Told } else { Times::At(times) })
}

/// The recordings against the exact solution; whether nothing failed.
fn scored(
    options: &ScoreOptions,
    selection: &Selection,
    exact: &AnySolution<f64>,
    inputs: &[Input],
    how: &Reading,
    output: Files,
) -> Result<bool> {
    let mut score = measure(exact, inputs, how)?;
    let set = &options.parameters.set;
    if let Some(name) = advice::density_one(selection, exact, set, inputs, how, &score) {
        return at_density_one(options, selection, &name, inputs, how, output);
    }
    if let Some((row, remark)) = advice::suggestion(selection, exact, set, inputs, how, &score) {
        score.rows[row].findings.push(remark);
    }
    tell(options, selection, exact, &score, how, output)
}

/// As [`scored`], with density one, which the recordings have and nobody has set.
fn at_density_one(
    options: &ScoreOptions,
    selection: &Selection,
    name: &str,
    inputs: &[Input],
    how: &Reading,
    output: Files,
) -> Result<bool> {
    let selection = selection.with(&[(name.to_owned(), 1.0)])?;
    let exact = selection.build()?;
    let how = Reading { provenance: Some(selection.provenance()), ..how.clone() };
    let mut score = measure(&exact, inputs, &how)?;
    let message = format!(
        "the recordings fit density 1 in every recorded field, and not the solution's own: they are compared with {name} = 1 \
         (--set {name}=1)"
    );
    let remark = Remark { kind: "density-one", is_problem: false, count: 1, frames: 0, message };
    score.rows[0].findings.push(remark);
    tell(options, &selection, &exact, &score, &how, output)
}

/// Prints and writes the comparison; whether nothing failed.
fn tell(
    options: &ScoreOptions,
    selection: &Selection,
    exact: &AnySolution<f64>,
    score: &Score,
    how: &Reading,
    output: Files,
) -> Result<bool> {
    let agreements = agreements(options, exact, score, how)?;
    let blind = blind::measure(selection)?;
    let mut sections = text::of_score(selection, score);
    let beside = score.rows.iter().zip(&agreements);
    sections.extend(beside.map(|(row, agreement)| text::of_agreement(options, row, agreement)));
    let warnings = Warnings::until(selection, exact, options.periods).without_locking();
    sections.push(Section::Note(text::verdict(score) + &warnings.text() + &blind::text(&blind)));
    let report = Report {
        caption: text::caption(selection),
        sections,
        settings: document::settings(selection, options),
        results: document::results(score),
        verdict: score.verdict.passed,
        ..Report::new("score")
    };
    let mut report = report.with("blind_spots", json!(blind));
    warnings.insert(&mut report.results);
    match agreements.is_empty() {
        true => report.publish(output),
        false => report.with("against", json!(agreements)).publish(output),
    }
}

/// The recordings against each other; whether all of them are whole.
fn compared(
    options: &ScoreOptions,
    selection: &Selection,
    exact: &AnySolution<f64>,
    inputs: &[Input],
    how: &Reading,
    output: Files,
) -> Result<bool> {
    let compared = compare_recordings(exact, inputs, &options.differences, how)?;
    let rows = compared.rows.iter().map(|row| (&row.file, &row.findings[..]));
    let report = Report {
        caption: text::caption(selection),
        sections: text::of_differences(selection, &compared),
        settings: document::settings(selection, options),
        verdict: Some(compared.rows.iter().all(|row| row.status == "ok")),
        ..Report::new("score")
    };
    let report =
        report.with("differences", json!(compared.rows)).with("findings", document::findings(rows));
    match &compared.orders {
        Some(orders) => report.with("orders", json!(orders)).publish(output),
        None => report.publish(output),
    }
}

/// The runs beside the recordings, where such are asked for.
fn agreements(
    options: &ScoreOptions,
    exact: &AnySolution<f64>,
    score: &Score,
    how: &Reading,
) -> Result<Vec<Agreement>> {
    let Some((shape, integrator)) = options.against else { return Ok(vec![]) };
    let scheme = Scheme::Updated(Updated { shape, integrator, ..Updated::default() });
    let run = |row: &ScoreRow| {
        let cells = row.cells.unwrap_or_default();
        let case =
            Case { scheme, cells, cfl: options.cfl, periods: options.periods, ..Case::default() };
        let folder = tempfile::tempdir().context("a folder for the run beside the recording")?;
        Ok(against(exact, row, &case, folder.path(), how)?)
    };
    score.rows.iter().map(run).collect()
}
