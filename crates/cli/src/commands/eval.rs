//! `mms eval`: exact fields at the caller's points.

use std::iter;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{FieldRow, evaluate};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::arguments::EvalOptions;
use crate::input::Source;
use crate::json::{self, Output};
use crate::library::Selection;
use crate::npy;
use crate::progress::Bar;
use crate::terminal;

const FORM: &str = r#"{ "X": [numbers], "t": number, "par": { "NAME": number, ... } }"#;

/// More bytes of points than memory has room for, once each of them is a tree of values.
const LONGEST: u64 = 1 << 30;
/// So many points are evaluated between two looks at the bar.
const PORTION: usize = 4096;
/// So many points that are not right are named; of the others the number is told.
const MOST_NAMED: usize = 5;

pub(crate) fn eval(options: &EvalOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.parameters.set)?;
    let file = Source::of(&options.points);
    let entries = read(file)?;
    let json_file = Output::prepare_if(options.json.as_ref())?;
    let csv_file = Output::prepare_if(options.csv.as_ref())?;
    if let Some(folder) = &options.npy {
        json::prepare_folder(folder)?;
    }

    let solution = selection.build()?;
    let bar = Bar::new("points");
    let mut rows = Vec::with_capacity(entries.len());
    for portion in entries.chunks(PORTION) {
        let first = rows.len();
        let evaluated: Vec<Result<FieldRow>> =
            portion.par_iter().map(|entry| evaluate_entry(&selection, &solution, entry)).collect();
        for (index, row) in evaluated.into_iter().enumerate() {
            let place = || format!("{file}, entry {} (counted from 0)", first + index);
            rows.push(row.with_context(place)?);
        }
        bar.show_share(
            || format!("{} of {} points", rows.len(), entries.len()),
            rows.len() as f64 / entries.len() as f64,
        );
    }
    drop(bar);

    if let Some(file) = csv_file {
        file.write_text(&csv(&rows))?;
    }
    if let Some(folder) = &options.npy {
        write_arrays(folder, &rows)?;
    }
    let only_elsewhere = options.csv.is_some() || options.npy.is_some();
    if json_file.is_some() || !only_elsewhere {
        let result = json!({
            "schema": "mmsmith.eval/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solution": selection.name(),
                "parameters": selection.parameters(),
                "fields": selection.evaluation(),
            },
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
        terminal::error(format_args!("{file}, entry {index}: {fields} is not finite there"));
    }
    let bad = bad.count();
    if bad > MOST_NAMED {
        terminal::error(format_args!("{bad} of {} points have such values", rows.len()));
    }
    bad == 0
}

/// A header and a line for each point, entries of matrices row by row; numbers in shortest round-trip form.
fn csv(rows: &[FieldRow]) -> String {
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        let fields = row.named();
        if index == 0 {
            let names = fields.iter().flat_map(|(name, shape, values)| {
                (0..values.len()).map(move |entry| match shape[..] {
                    [] => (*name).to_owned(),
                    [_] => format!("{name}{}", entry + 1),
                    _ => format!("{name}{}{}", entry / shape[0] + 1, entry % shape[0] + 1),
                })
            });
            text.push_str(&names.collect::<Vec<_>>().join(","));
            text.push('\n');
        }
        let values =
            fields.iter().flat_map(|(.., values)| values).map(|value| format!("{value:?}"));
        text.push_str(&values.collect::<Vec<_>>().join(","));
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

/// The list of points; their form is judged one by one.
fn read(file: Source) -> Result<Vec<Value>> {
    let value: Value = serde_json::from_str(&file.short_text(LONGEST)?)
        .with_context(|| format!("{file} is not valid JSON"))?;
    match value {
        Value::Array(entries) => Ok(entries),
        _ => bail!("{file}: expected a list of points, [ {FORM}, ... ]"),
    }
}

/// The fields at an entry's point, with its own parameters where it has some.
fn evaluate_entry(
    selection: &Selection,
    solution: &AnySolution<f64>,
    entry: &Value,
) -> Result<FieldRow> {
    let Value::Object(entry) = entry else { bail!("expected {FORM}") };
    if let Some(key) = entry.keys().find(|key| is_misspelt(key)) {
        bail!("unknown key '{key}'; the keys are X, t and par");
    }
    let X = match entry.get("X") {
        Some(Value::Array(list)) => {
            list.iter().map(|x| number(x, "a coordinate in X")).collect::<Result<Vec<_>>>()?
        }
        Some(other) => bail!("X is {other}; it must be a list of numbers"),
        None => bail!("X is missing; expected {FORM}"),
    };
    let t = number(entry.get("t").ok_or_else(|| anyhow!("t is missing; expected {FORM}"))?, "t")?;
    let none = Map::new();
    let parameters = match entry.get("par") {
        None => &none,
        Some(Value::Object(parameters)) => parameters,
        Some(other) => bail!("par is {other}; it must be an object, {{ \"NAME\": number, ... }}"),
    };
    let given = parameters
        .iter()
        .map(|(name, value)| Ok((name.clone(), number(value, &format!("parameter {name}"))?)))
        .collect::<Result<Vec<_>>>()?;
    if given.is_empty() {
        return Ok(evaluate(solution, &X, t)?);
    }
    Ok(evaluate(&selection.with(&given)?.build()?, &X, t)?)
}

/// Whether a key must have been meant for one of X, t and par. Other keys are the caller's notes.
fn is_misspelt(key: &str) -> bool {
    let lower = key.to_lowercase();
    !["X", "t", "par"].contains(&key)
        && (["x", "t", "time", "point", "position"].contains(&lower.as_str())
            || lower.starts_with("par"))
}

/// A number of JSON, which is always finite.
fn number(value: &Value, what: &str) -> Result<f64> {
    value.as_f64().ok_or_else(|| anyhow!("{what} is {value}; it must be a number"))
}
