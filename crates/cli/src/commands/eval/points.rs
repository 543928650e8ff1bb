//! The points of `mms eval`, as CSV or as JSON.

use anyhow::{Context, Result, anyhow, bail};
use csv::{ReaderBuilder, Trim};
use serde_json::{Map, Value};

use crate::input::Source;
use crate::library::Selection;

const FORM: &str = r#"{ "X": [numbers], "t": number, "par": { "NAME": number, ... } }"#;

/// The columns of coordinates.
pub(super) const AXES: [&str; 3] = ["X", "Y", "Z"];

/// More bytes of points than memory has room for, once each of them is a tree of values.
const LONGEST: u64 = 1 << 30;

/// A point at a time.
pub(crate) struct Point {
    /// The reference position.
    pub(crate) X: Vec<f64>,
    pub(crate) t: f64,
    /// Parameters of this point alone.
    pub(crate) parameters: Vec<(String, f64)>,
}

/// Where the point `index` is, for messages.
pub(crate) fn place(file: Source, index: usize) -> String {
    format!("{file}, entry {index} (counted from 0)")
}

/// The columns of coordinates of a body of revolution.
const OF_HALF_PLANE: [&str; 2] = ["R", "Z"];

/// The points of a file: JSON where it begins as a list or an object does, else CSV. Those of a body of revolution have the coordinates R and
/// Z, and lie at the angle zero.
pub(crate) fn read(
    file: Source,
    selection: &Selection,
    is_axisymmetric: bool,
) -> Result<Vec<Point>> {
    // Where nothing moves no time needs to be given.
    let usual_time = selection.is_static().then_some(0.0);
    if !is_axisymmetric {
        return read_with(file, &AXES[..selection.dimension()], usual_time);
    }
    of_half_plane(file, usual_time)
}

/// The points of a body of revolution.
fn of_half_plane(file: Source, usual_time: Option<f64>) -> Result<Vec<Point>> {
    let mut points = read_with(file, &OF_HALF_PLANE, usual_time)?;
    for (index, point) in points.iter_mut().enumerate() {
        match point.X[..] {
            [R, Z] => point.X = vec![R, 0.0, Z],
            ref X => bail!(
                "{}: X has {} numbers; a place of a body of revolution is R and Z, as [0.5, 0.1]",
                place(file, index),
                X.len()
            ),
        }
    }
    Ok(points)
}

/// Positions in `dimension` dimensions of a file of such points, or of the half plane of a body of revolution; times do not matter and may be
/// left out.
pub(crate) fn positions(
    file: Source,
    dimension: usize,
    in_half_plane: bool,
) -> Result<Vec<Vec<f64>>> {
    let points = match in_half_plane {
        true => of_half_plane(file, Some(0.0))?,
        false => read_with(file, &AXES[..dimension], Some(0.0))?,
    };
    Ok(points.into_iter().map(|point| point.X).collect())
}

fn read_with(file: Source, names: &[&str], usual_time: Option<f64>) -> Result<Vec<Point>> {
    let text = file.short_text(LONGEST)?;
    if !text.trim_start().starts_with(['[', '{']) {
        return of_csv(&text, names, usual_time).with_context(|| file.to_string());
    }
    let value: Value =
        serde_json::from_str(&text).with_context(|| format!("{file} is not valid JSON"))?;
    let Value::Array(entries) = value else {
        bail!("{file}: expected a list of points, [ {FORM}, ... ]")
    };
    let entries = entries.iter().enumerate();
    let point = |(index, entry)| point(entry, usual_time).with_context(|| place(file, index));
    entries.map(point).collect()
}

/// The rows of a table with columns for the coordinates and the time; letter case does not matter.
fn of_csv(text: &str, names: &[&str], usual_time: Option<f64>) -> Result<Vec<Point>> {
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().context("it has no line of column names")?.clone();
    let form = format!("{},t", names.join(","));
    let column = |name: &str| {
        header.iter().position(|own| own.eq_ignore_ascii_case(name)).with_context(|| {
            let names: Vec<&str> = header.iter().collect();
            format!(
                "points are CSV with the columns {form}, or JSON, [ {FORM}, ... ]; there is no column {name} among {}",
                names.join(",")
            )
        })
    };
    let axes = names.iter().map(|name| column(name)).collect::<Result<Vec<_>>>()?;
    let time = match (column("t"), usual_time) {
        (Err(_), Some(_)) => None,
        (found, _) => Some(found?),
    };
    let rows = reader.records().enumerate();
    rows.map(|(index, row)| {
        let row = row.with_context(|| format!("row {}", index + 1))?;
        let number = |column: usize| {
            let cell = row.get(column).unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.with_context(|| {
                let name = header.get(column).unwrap_or_default();
                format!("row {}: '{cell}' in column {name} is no finite number", index + 1)
            })
        };
        let X = axes.iter().map(|column| number(*column)).collect::<Result<_>>()?;
        let t = time.map(number).transpose()?.or(usual_time).unwrap_or_default();
        Ok(Point { X, t, parameters: Vec::new() })
    })
    .collect()
}

/// A point as JSON.
fn point(entry: &Value, usual_time: Option<f64>) -> Result<Point> {
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
    let t = match (entry.get("t"), usual_time) {
        (Some(t), _) => number(t, "t")?,
        (None, Some(t)) => t,
        (None, None) => bail!("t is missing; expected {FORM}"),
    };
    let none = Map::new();
    let parameters = match entry.get("par") {
        None => &none,
        Some(Value::Object(parameters)) => parameters,
        Some(other) => bail!("par is {other}; it must be an object, {{ \"NAME\": number, ... }}"),
    };
    let parameters = parameters
        .iter()
        .map(|(name, value)| Ok((name.clone(), number(value, &format!("parameter {name}"))?)));
    Ok(Point { X, t, parameters: parameters.collect::<Result<_>>()? })
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
