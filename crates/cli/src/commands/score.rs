//! `mms score`: errors and orders of another solver's output.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use mmsmith_verify::{Field, Input, Order, PerNorm, Resolution, Score, ScoreRow, score as measure};
use serde_json::{Value, json};

use super::with_threads;
use crate::arguments::ScoreOptions;
use crate::json::Output;
use crate::library::Selection;
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
    let how = mmsmith_verify::ScoreOptions {
        map,
        points: options.points.into(),
        time: options.time,
        velocity_lag: options.velocity_lag,
        periods: options.periods,
    };
    with_threads(options.threads, || {
        let score = measure(&selection.build()?, &inputs, &how)?;
        terminal::say(&text(&selection, &score))?;
        if let Some(output) = output {
            output.write(&document(&selection, options, &score))?;
        }
        Ok(score.rows.iter().all(ScoreRow::is_ok))
    })
}

/// The recordings with their resolutions.
fn inputs(options: &ScoreOptions) -> Result<Vec<Input>> {
    let values = options.cells.len() + options.h.len();
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

fn document(selection: &Selection, options: &ScoreOptions, score: &Score) -> Value {
    let map: BTreeMap<_, _> = options.map.iter().map(|(role, name)| (role.name(), name)).collect();
    let mut findings = vec![];
    for (index, row) in score.rows.iter().enumerate() {
        for finding in &row.findings {
            findings.push(json!({
                "row": index,
                "file": row.file,
                "kind": finding.kind,
                "problem": finding.is_problem,
                "count": finding.count,
                "frames": finding.frames,
                "message": finding.message,
            }));
        }
    }
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
        "rows": score.rows,
        "findings": findings,
    });
    if let Some(orders) = &score.orders {
        document["orders"] = json!(orders);
    }
    document
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
    for finding in &row.findings {
        let label = if finding.is_problem { "PROBLEM" } else { "note" };
        text += &format!("  {label}: {}\n", finding.message);
    }
    text
}

/// The errors of one recording.
fn errors(row: &ScoreRow) -> String {
    let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
    for (field, norms) in row.errors.iter() {
        if row.fields.contains(&field) {
            let mut cells = vec![field.to_string()];
            cells.extend(norms.iter().map(|(_, value)| table::error(*value)));
            table.row(cells);
        }
    }
    table.text()
}

/// One table for each field that any recording has: a row a recording, and the rate right of each norm.
fn tables(score: &Score) -> Vec<(Field, Table)> {
    let Some(orders) = &score.orders else { return vec![] };
    let known =
        orders.iter().filter(|(field, _)| score.rows.iter().any(|row| row.fields.contains(field)));
    let table = |(field, order): (Field, &PerNorm<Order>)| {
        let header =
            ["cells", "particles", "h", "linf", "rate", "l2", "rate", "l1", "rate", "status"];
        let mut table = Table::new(0, header);
        for (index, row) in score.rows.iter().enumerate() {
            let cells = row.cells.map_or_else(|| "-".into(), |cells| cells.to_string());
            let mut line = vec![cells, row.particles.to_string(), table::error(row.h)];
            for ((_, value), (_, order)) in row.errors[field].iter().zip(order.iter()) {
                let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
                line.extend([table::error(*value), table::rate(local)]);
            }
            line.push(if row.is_ok() { "ok" } else { "PROBLEM" }.into());
            table.row(line);
        }
        let mut fit = vec!["fit in h".to_owned(), String::new(), String::new()];
        for (_, order) in order.iter() {
            fit.extend([String::new(), table::rate(order.fit)]);
        }
        table.row(fit);
        (field, table)
    };
    known.map(table).collect()
}
