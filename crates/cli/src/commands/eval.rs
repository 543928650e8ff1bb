//! `mms eval`: exact fields at the caller's points.

pub(super) mod points;

use std::iter;
use std::path::Path;

use anyhow::{Context, Result};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{FieldRow, evaluate, evaluate_with_tangent};
use rayon::prelude::*;
use serde_json::json;

use crate::arguments::EvalOptions;
use crate::input::Source;
use crate::json::{self, Output};
use crate::library::Selection;
use crate::npy;
use crate::progress::Bar;
use crate::terminal;
use points::Point;

/// Coordinates and components of a body of revolution.
const OF_REVOLUTION: [&str; 3] = ["R", "theta", "Z"];
/// So many points are evaluated between two looks at the bar.
const PORTION: usize = 4096;
/// So many points that are not right are named; of the others the number is told.
const MOST_NAMED: usize = 5;

pub(crate) fn eval(options: &EvalOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.parameters.set)?;
    let file = Source::of(&options.points);
    let solution = selection.build_for_hosts()?;
    let is_axisymmetric = selection.is_axisymmetric(&solution);
    let points = points::read(file, &selection, is_axisymmetric)?;
    let json_file = Output::prepare_if(options.json.as_ref())?;
    let csv_file = Output::prepare_if(options.csv.as_ref())?;
    if let Some(folder) = &options.npy {
        json::prepare_folder(folder)?;
    }

    let bar = Bar::new("points");
    let mut rows = Vec::with_capacity(points.len());
    for portion in points.chunks(PORTION) {
        let first = rows.len();
        let evaluated: Vec<Result<FieldRow>> = portion
            .par_iter()
            .map(|point| fields_at(&selection, &solution, point, options.tangent))
            .collect();
        for (index, row) in evaluated.into_iter().enumerate() {
            rows.push(row.with_context(|| points::place(file, first + index))?);
        }
        bar.show_share(
            || format!("{} of {} points", rows.len(), points.len()),
            rows.len() as f64 / points.len() as f64,
        );
    }
    drop(bar);

    if let Some(file) = csv_file {
        let axes = if is_axisymmetric { OF_REVOLUTION } else { points::AXES };
        file.write_text(&csv(&axes, &points, &rows))?;
    }
    if let Some(folder) = &options.npy {
        write_arrays(folder, &rows)?;
        terminal::say_written(&folder.display().to_string())?;
    }
    let only_elsewhere = options.csv.is_some() || options.npy.is_some();
    if json_file.is_some() || !only_elsewhere {
        let mut settings = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "solution": selection.name(),
            "parameters": selection.parameters(),
            "fields": selection.evaluation(),
        });
        if is_axisymmetric {
            settings["components"] = json!(OF_REVOLUTION);
        }
        let result = json!({
            "schema": "mmsmith.eval/1",
            "settings": settings,
            "fields": selection.evaluation(),
            "rows": rows,
        });
        match json_file {
            Some(file) => file.write(&result)?,
            None => terminal::say(&json::text(&result)?)?,
        }
    }
    Ok(judge(file, &rows))
}

/// Tells of points outside the body, which are evaluated all the same, and of values that are no numbers; whether there are
/// none of the latter.
fn judge(file: Source, rows: &[FieldRow]) -> bool {
    let count = |is: fn(&FieldRow) -> bool| rows.iter().filter(|row| is(row)).count();
    let outside = count(|row| row.outside);
    if outside > 0 {
        let first = rows.iter().position(|row| row.outside).unwrap_or(0);
        terminal::warn(format_args!(
            "{outside} of {} points lie outside the body (the first is entry {first}); the fields there are those of the same \
             formulas",
            rows.len()
        ));
    }
    let bad = rows.iter().enumerate().filter(|(_, row)| !row.not_finite.is_empty());
    for (index, row) in bad.clone().take(MOST_NAMED) {
        let fields = row.not_finite.join(", ");
        let why = row.why.as_ref().map_or(String::new(), |why| format!(": {why}"));
        terminal::error(format_args!("{file}, entry {index}: {fields} is not finite there{why}"));
    }
    let bad = bad.count();
    if bad > MOST_NAMED {
        terminal::error(format_args!("{bad} of {} points have such values", rows.len()));
    }
    bad == 0
}

/// A header and a line for each point: its place and time, then the fields, entries of matrices row by row; numbers in shortest
/// round-trip form.
fn csv(axes: &[&str; 3], points: &[Point], rows: &[FieldRow]) -> String {
    let mut text = String::new();
    for (index, (Point { X, t, .. }, row)) in points.iter().zip(rows).enumerate() {
        let fields = row.named();
        if index == 0 {
            for name in &axes[..X.len().min(axes.len())] {
                text += &format!("{name},");
            }
            text += "t,";
            let names = fields.iter().flat_map(|(name, shape, values)| {
                (0..values.len()).map(move |entry| match shape[..] {
                    [] => (*name).to_owned(),
                    [_] => format!("{name}{}", entry + 1),
                    [d, _, _, _] => {
                        let index = |place: u32| entry / d.pow(place) % d + 1;
                        format!("dP{}{}dF{}{}", index(3), index(2), index(1), index(0))
                    }
                    _ => format!("{name}{}{}", entry / shape[0] + 1, entry % shape[0] + 1),
                })
            });
            text.push_str(&names.collect::<Vec<_>>().join(","));
            text.push('\n');
        }
        let place = X.iter().chain([t]);
        let values = place.chain(fields.iter().flat_map(|(.., values)| values));
        text.push_str(&values.map(|value| format!("{value:?}")).collect::<Vec<_>>().join(","));
        text.push('\n');
    }
    text
}

/// A file for each field.
fn write_arrays(folder: &Path, rows: &[FieldRow]) -> Result<()> {
    let fields: Vec<_> = rows.iter().map(FieldRow::named).collect();
    let Some(first) = fields.first() else { return Ok(()) };
    for (index, (name, shape, _)) in first.iter().enumerate() {
        let whole: Vec<usize> = iter::once(rows.len()).chain(shape.iter().copied()).collect();
        let values = fields.iter().flat_map(|row| row[index].2.iter().copied());
        let path = folder.join(format!("{name}.npy"));
        Output::prepare(&path)?.write_bytes(&npy::bytes(&whole, values))?;
    }
    Ok(())
}

/// The fields at a point, with its own parameters where it has some.
fn fields_at(
    selection: &Selection,
    solution: &AnySolution<f64>,
    point: &Point,
    with_tangent: bool,
) -> Result<FieldRow> {
    let Point { X, t, parameters } = point;
    let at = |solution: &AnySolution<f64>| -> Result<FieldRow> {
        match with_tangent {
            true => Ok(evaluate_with_tangent(solution, X, *t)?),
            false => Ok(evaluate(solution, X, *t)?),
        }
    };
    if parameters.is_empty() {
        return at(solution);
    }
    at(&selection.with(parameters)?.build_for_hosts()?)
}
