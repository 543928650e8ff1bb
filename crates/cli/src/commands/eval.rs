//! `mms eval`: exact fields at the caller's points.

use anyhow::{Context, Result, anyhow, bail};
use mmsmith_verify::evaluate;
use serde_json::{Map, Value, json};

use crate::arguments::EvalOptions;
use crate::input::Source;
use crate::json::{self, Output};
use crate::library::Selection;
use crate::terminal;

const FORM: &str = r#"{ "X": [numbers], "t": number, "par": { "NAME": number, ... } }"#;

pub(crate) fn eval(options: &EvalOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.parameters.set)?;
    let file = Source::of(&options.points);
    let entries = read(file)?;
    let mut rows = Vec::with_capacity(entries.len());
    for (index, entry) in entries.iter().enumerate() {
        let row = evaluate_entry(&selection, entry)
            .with_context(|| format!("{file}, entry {index} (counted from 0)"))?;
        rows.push(row);
    }
    let result = json!({
        "schema": "mmsmith.eval/1",
        "settings": {
            "version": env!("CARGO_PKG_VERSION"),
            "solution": selection.name(),
            "parameters": selection.parameters(),
            "fields": selection.evaluation(),
        },
        "rows": rows,
    });
    match &options.json {
        // Nothing takes long here: all bad input is found before the file is opened.
        Some(path) => Output::prepare(path)?.write(&result)?,
        None => terminal::say(&json::text(&result)?)?,
    }
    Ok(true)
}

/// The list of points; their form is judged one by one.
fn read(file: Source) -> Result<Vec<Value>> {
    let value: Value =
        serde_json::from_str(&file.text()?).with_context(|| format!("{file} is not valid JSON"))?;
    match value {
        Value::Array(entries) => Ok(entries),
        _ => bail!("{file}: expected a list of points, [ {FORM}, ... ]"),
    }
}

fn evaluate_entry(selection: &Selection, entry: &Value) -> Result<Value> {
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
    let solution = selection.with(&given)?.build()?;
    Ok(serde_json::to_value(evaluate(&solution, &X, t)?)?)
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
