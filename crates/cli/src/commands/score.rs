//! `mms score`: errors and orders of another solver's output.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Agreement, Case, Differences, Input, Order, PerNorm, Quantity, Remark, Resolution, Scheme,
    Score, ScoreOptions as Reading, ScoreRow, Start, Stepping, Updated, against,
    compare_recordings, score as measure,
};
use serde_json::{Value, json};

use super::with_threads;
use crate::arguments::ScoreOptions;
use crate::json::Output;
use crate::library::Selection;
use crate::number;
use crate::table::{self, Table};
use crate::terminal;

pub(crate) fn score(options: &ScoreOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.parameters.set)?;
    let inputs = inputs(options)?;
    let mut map = BTreeMap::new();
    for (role, name) in &options.map {
        if map.insert(*role, name.clone()).is_some() {
            bail!("--map {role}=... is given twice");
        }
    }
    let output = Output::prepare_if(options.json.as_ref())?;
    let how = Reading {
        map,
        points: options.points.into(),
        time: options.time,
        velocity_lag: options.velocity_lag,
        periods: options.periods,
        provenance: Some(selection.provenance()),
    };
    with_threads(options.threads, || {
        let exact = selection.build()?;
        if !options.differences.is_empty() {
            let compared = compare_recordings(&exact, &inputs, &options.differences, &how)?;
            terminal::say(&text_of_differences(&selection, &compared))?;
            if let Some(output) = output {
                let mut document = settings(&selection, options);
                document["differences"] = json!(compared.rows);
                if let Some(orders) = &compared.orders {
                    document["orders"] = json!(orders);
                }
                let rows = compared.rows.iter().map(|row| (&row.file, &row.findings[..]));
                document["findings"] = findings(rows);
                output.write(&document)?;
            }
            return Ok(compared.rows.iter().all(|row| row.status == "ok"));
        }
        let mut score = measure(&exact, &inputs, &how)?;
        if let Some((row, remark)) = suggestion(&selection, &inputs, &how, &score) {
            score.rows[row].findings.push(remark);
        }
        // Before anything is said: what cannot be compared is refused.
        let agreements = agreements(options, &exact, &score, &how)?;
        terminal::say(&text(&selection, &score))?;
        for (row, agreement) in score.rows.iter().zip(&agreements) {
            terminal::say(&text_of_agreement(options, row, agreement))?;
        }
        if let Some(output) = output {
            let mut document = document(&selection, options, &score);
            if !agreements.is_empty() {
                document["against"] = json!(agreements);
            }
            output.write(&document)?;
        }
        Ok(score.rows.iter().all(ScoreRow::is_ok))
    })
}

/// The runs beside the recordings, where such are asked for.
fn agreements(
    options: &ScoreOptions,
    exact: &AnySolution<f64>,
    score: &Score,
    how: &Reading,
) -> Result<Vec<Agreement>> {
    let Some((shape, integrator)) = options.against else { return Ok(vec![]) };
    let stepping = Stepping::new(integrator, Start::Halved);
    let scheme = Scheme::Updated(Updated { shape, stepping, ..Updated::default() });
    let run = |row: &ScoreRow| {
        let cells = row.cells.unwrap_or_default();
        let case =
            Case { scheme, cells, cfl: options.cfl, periods: options.periods, ..Case::default() };
        let folder = tempfile::tempdir().context("a folder for the run beside the recording")?;
        Ok(against(exact, row, &case, folder.path(), how)?)
    };
    score.rows.iter().map(run).collect()
}

/// Errors of the recording and of the run beside it.
fn text_of_agreement(options: &ScoreOptions, row: &ScoreRow, agreement: &Agreement) -> String {
    let header = ["error", "linf", "mms", "digits", "l2", "mms", "digits", "l1", "mms", "digits"];
    let mut table = Table::new(1, header).sparing(7..10);
    for (field, digits) in &agreement.digits {
        let mut line = vec![field.to_string()];
        for (norm, digits) in digits.iter() {
            let (theirs, ours) = (row.errors[field][norm], agreement.errors[field][norm]);
            line.extend([table::error(theirs), table::error(ours), format!("{digits:.1}")]);
        }
        table.row(line);
    }
    let scheme = options.against.map(|(shape, integrator)| format!("{shape} + {integrator}"));
    format!(
        "\n{} beside mms, {}, {} steps of dt = {}\n{}",
        row.file,
        scheme.unwrap_or_default(),
        agreement.run.steps,
        number::exact(agreement.run.dt),
        table.text()
    )
}

/// A relative error that a solver that converges does not have on any grid worth scoring.
const SUSPICIOUS: f64 = 0.3;
/// The share of the error that is left where another value explains it, on coarse grids too.
const EXPLAINED: f64 = 0.25;
/// Below this order the grid is not what the error is from.
const NO_ORDER: f64 = 0.5;
/// More numbers than are read anew for every trial.
const MOST_TRIED: usize = 50_000;
/// Octaves up and down from the value of a parameter in which another one is looked for.
const OCTAVES: i32 = 7;

/// What is to be said of the row with the smallest recording where the error of u is as large as u, no smaller on finer grids,
/// and far smaller with another value of a parameter.
fn suggestion(
    selection: &Selection,
    inputs: &[Input],
    how: &Reading,
    score: &Score,
) -> Option<(usize, Remark)> {
    let size = |row: &ScoreRow| row.particles * row.frames;
    let (index, row) = score.rows.iter().enumerate().min_by_key(|(_, row)| size(row))?;
    let u = |row: &ScoreRow| row.errors[&Quantity::Displacement].l2;
    let relative = u(row) / row.exact_displacement;
    let order =
        score.orders.as_ref().and_then(|orders| orders.get(&Quantity::Displacement)?.l2.fit);
    if !(row.is_ok() && relative > SUSPICIOUS && size(row) <= MOST_TRIED)
        || order.is_some_and(|order| order > NO_ORDER)
    {
        return None;
    }
    let misfit = |name: &str, value: f64| -> Option<f64> {
        let exact = selection.with(&[(name.to_owned(), value)]).ok()?.build().ok()?;
        Some(u(&measure(&exact, &inputs[index..=index], how).ok()?.rows[0]))
    };
    let (error, name, value) = selection
        .parameters()
        .iter()
        .filter(|(_, value)| **value != 0.0)
        .filter_map(|(name, value)| {
            let (factor, error) = least(|factor| misfit(name, factor * value))?;
            Some((error, name, factor * value))
        })
        .min_by(|one, other| one.0.total_cmp(&other.0))?;
    let told = number::rounded(value, 3);
    (error < EXPLAINED * u(row)).then(|| {
        let message = format!(
            "the error of u is {:.0} % of u, but {} % with {name} near {told} in place of {}: is another value meant? --set \
             {name}={told}",
            100.0 * relative,
            number::rounded(100.0 * error / row.exact_displacement, 2),
            number::exact(selection.parameters()[name]),
        );
        (index, Remark { kind: "other-parameter", is_problem: false, count: 1, frames: 0, message })
    })
}

/// The factor, and its value, where a function is least: among half octaves and minus one, then by bisection between the
/// neighbours of the best.
fn least(function: impl Fn(f64) -> Option<f64>) -> Option<(f64, f64)> {
    let at = |factor: f64| function(factor).map(|value| (factor, value));
    let steps = (-2 * OCTAVES..=2 * OCTAVES).map(|step| 2.0_f64.powf(f64::from(step) / 2.0));
    let less = |one: &(f64, f64), other: &(f64, f64)| one.1.total_cmp(&other.1);
    let mut best = steps.chain([-1.0]).filter_map(at).min_by(less)?;
    let mut width = 2.0_f64.powf(0.25);
    for _ in 0..10 {
        let beside = [best.0 / width, best.0 * width].into_iter().filter_map(at);
        best = beside.chain([best]).min_by(less)?;
        width = width.sqrt();
    }
    Some(best)
}

/// The recordings with their resolutions.
fn inputs(options: &ScoreOptions) -> Result<Vec<Input>> {
    let values = options.cells.len() + options.h.len() + options.differences.len();
    let mut recordings: Vec<Vec<PathBuf>> = vec![];
    for file in &options.files {
        match recordings.last_mut() {
            Some(frames)
                if !options.each
                    && values != options.files.len()
                    && is_frame(file)
                    && frames
                        .iter()
                        .all(|frame| is_frame(frame) && frame.parent() == file.parent()) =>
            {
                frames.push(file.clone());
            }
            _ => recordings.push(vec![file.clone()]),
        }
    }
    for (option, given) in [("--cells", options.cells.len()), ("--h", options.h.len())] {
        if given > 0 && given != recordings.len() {
            bail!("{option} has {given} value(s) for {} recording(s)", recordings.len());
        }
    }
    let resolution = |index: usize| match (options.cells.get(index), options.h.get(index)) {
        (Some(cells), _) => Resolution::Cells(*cells),
        (None, Some(h)) => Resolution::Length(*h),
        (None, None) => Resolution::Estimated,
    };
    let input = |(index, paths)| Input { paths, resolution: resolution(index) };
    Ok(recordings.into_iter().enumerate().map(input).collect())
}

/// Whether a path names a single frame, not a list or a folder.
fn is_frame(path: &Path) -> bool {
    !path.is_dir() && path.extension().is_some_and(|extension| extension != "pvd")
}

/// What every document of the command says.
fn settings(selection: &Selection, options: &ScoreOptions) -> Value {
    let map: BTreeMap<_, _> = options.map.iter().map(|(role, name)| (role.name(), name)).collect();
    let mut document = json!({
        "schema": "mmsmith.score/1",
        "settings": {
            "version": env!("CARGO_PKG_VERSION"),
            "solution": selection.name(),
            "parameters": selection.parameters(),
            "files": options.files,
            "each": options.each,
            "map": map,
            "points": options.points,
            "time": options.time,
            "velocity_lag": options.velocity_lag,
            "periods": options.periods,
        },
    });
    if let Some((shape, integrator)) = options.against {
        document["settings"]["against"] =
            json!({ "shape": shape.name(), "integrator": integrator.name(), "cfl": options.cfl });
    }
    document
}

/// What has to be known of each row.
fn findings<'a>(rows: impl Iterator<Item = (&'a String, &'a [Remark])>) -> Value {
    let mut all = vec![];
    for (index, (file, findings)) in rows.enumerate() {
        for finding in findings {
            all.push(json!({
                "row": index,
                "file": file,
                "kind": finding.kind,
                "problem": finding.is_problem,
                "count": finding.count,
                "frames": finding.frames,
                "message": finding.message,
            }));
        }
    }
    all.into()
}

fn document(selection: &Selection, options: &ScoreOptions, score: &Score) -> Value {
    let mut document = settings(selection, options);
    document["rows"] = json!(score.rows);
    document["findings"] = findings(score.rows.iter().map(|row| (&row.file, &row.findings[..])));
    if let Some(orders) = &score.orders {
        document["orders"] = json!(orders);
    }
    document
}

/// Recordings compared with each other.
fn text_of_differences(selection: &Selection, compared: &Differences) -> String {
    let mut text = format!("{} ({})\n", selection.name(), selection.told_parameters());
    for row in &compared.rows {
        text += &format!(
            "{} and {}: {} particles, {} frame(s) at the same times\n",
            row.file, row.other, row.particles, row.frames
        );
        text += &told(&row.findings);
    }
    let mut fields: Vec<_> =
        compared.rows.iter().flat_map(|row| row.differences.keys().copied()).collect();
    fields.sort_unstable();
    fields.dedup();
    for field in fields {
        let mut table = Table::new(0, ["dt", "linf", "rate", "l2", "rate", "l1", "rate", "status"]);
        for (index, row) in compared.rows.iter().enumerate() {
            let mut line = vec![table::error(row.dt)];
            for norm in mmsmith_verify::Norm::ALL {
                let value = row.differences.get(&field).map_or(f64::NAN, |norms| norms[norm]);
                let order = compared.orders.as_ref().and_then(|orders| orders.get(&field));
                let local = order.zip(index.checked_sub(1));
                let local = local.and_then(|(order, pair)| order[norm].local[pair]);
                line.extend([table::error(value), table::rate(local)]);
            }
            line.push(if row.status == "ok" { "ok" } else { "PROBLEM" }.into());
            table.row(line);
        }
        text += &format!("\ndifference of {field}\n{}", table.text());
    }
    text
}

fn text(selection: &Selection, score: &Score) -> String {
    let mut text = format!("{} ({})\n", selection.name(), selection.told_parameters());
    for row in &score.rows {
        text += &heading(row);
    }
    match &score.orders {
        None => text += &score.rows.iter().map(errors).collect::<String>(),
        Some(_) => {
            for (field, table) in tables(score) {
                text += &format!("\nerror of {field}\n{}", table.text());
            }
        }
    }
    text
}

/// What was read, and what is to be said about it.
fn heading(row: &ScoreRow) -> String {
    let mut text = format!(
        "{}: {} particles, {} frame(s) from t = {:?} to {:?}, h = {:?}\n",
        row.file, row.particles, row.frames, row.first_time, row.last_time, row.h
    );
    text += &format!("  reference positions: {}\n", row.reference_positions.words());
    text += &format!("  displacements: {}\n", row.displacements.words());
    if row.is_ok() {
        text += "  status: ok\n";
    }
    text + &told(&row.findings)
}

fn told(findings: &[Remark]) -> String {
    let line = |finding: &Remark| {
        let label = if finding.is_problem { "PROBLEM" } else { "note" };
        format!("  {label}: {}\n", finding.message)
    };
    findings.iter().map(line).collect()
}

/// The errors of one recording.
fn errors(row: &ScoreRow) -> String {
    let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
    for (field, norms) in &row.errors {
        if row.fields.contains(field) {
            let mut cells = vec![field.to_string()];
            cells.extend(norms.iter().map(|(_, value)| table::error(*value)));
            table.row(cells);
        }
    }
    table.text()
}

/// One table for each field that any recording has: a row a recording, and the rate right of each norm.
fn tables(score: &Score) -> Vec<(Quantity, Table)> {
    let Some(orders) = &score.orders else { return vec![] };
    let known =
        orders.iter().filter(|(field, _)| score.rows.iter().any(|row| row.fields.contains(field)));
    let table = |(field, order): (&Quantity, &PerNorm<Order>)| {
        let header =
            ["cells", "particles", "h", "linf", "rate", "l2", "rate", "l1", "rate", "status"];
        let mut table = Table::new(0, header).sparing(7..9).sparing(1..2).sparing(5..7);
        for (index, row) in score.rows.iter().enumerate() {
            let cells = row.cells.map_or_else(|| "-".into(), |cells| cells.to_string());
            let mut line = vec![cells, row.particles.to_string(), table::error(row.h)];
            for (norm, order) in order.iter() {
                let value = row.errors.get(field).map_or(f64::NAN, |norms| norms[norm]);
                let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
                line.extend([table::error(value), table::rate(local)]);
            }
            line.push(if row.is_ok() { "ok" } else { "PROBLEM" }.into());
            table.row(line);
        }
        let mut fit = vec!["fit in h".to_owned(), String::new(), String::new()];
        for (_, order) in order.iter() {
            fit.extend([String::new(), table::rate(order.fit)]);
        }
        table.row(fit);
        (*field, table)
    };
    known.map(table).collect()
}
