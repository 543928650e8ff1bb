//! `mms list`: what there is.

use anyhow::Result;
use mmsmith_spec::{Condition, Diagnostic};
use serde_json::{Value, json};

use crate::arguments::ListOptions;
use crate::json::Output;
use crate::library::{Origin, all_names, locate};
use crate::table::{self, Table};
use crate::{number, terminal};

pub(crate) fn list(options: &ListOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let mut entries = Vec::new();
    let mut unreadable = Vec::new();
    for name in all_names() {
        match entry(&name) {
            Ok(entry) => entries.push(entry),
            // One mistake in a file does not hide the others.
            Err(error) => {
                let problem = match error.downcast_ref::<Diagnostic>() {
                    Some(Diagnostic { message, file, .. }) => format!("{file}: {message}"),
                    None => format!("{error:#}"),
                };
                terminal::warn(format_args!(
                    "{name} cannot be used: {problem}; mms check {name} shows the place"
                ));
                unreadable.push(json!({ "name": name, "problem": problem }));
            }
        }
    }
    terminal::say(&match options.long {
        true => entries.iter().map(Entry::text).collect(),
        false => short(&entries),
    })?;
    let rows: Vec<Value> = entries.iter().map(Entry::document).collect();
    if let Some(output) = output {
        let settings = json!({ "version": env!("CARGO_PKG_VERSION") });
        let mut document =
            json!({ "schema": "mmsmith.list/1", "settings": settings, "rows": rows });
        if !unreadable.is_empty() {
            document["unreadable"] = unreadable.into();
        }
        output.write(&document)?;
    }
    Ok(true)
}

/// A solution of the list.
struct Entry {
    name: String,
    origin: Origin,
    title: String,
    reference: String,
    coordinates: String,
    dimension: usize,
    law: &'static str,
    boundaries: Vec<&'static str>,
    parameters: Vec<Parameter>,
}

struct Parameter {
    name: String,
    default: f64,
    unit: String,
    admissible: String,
    description: String,
}

fn entry(name: &str) -> Result<Entry> {
    let origin = locate(name)?;
    let spec = origin.specification()?;
    let mut boundaries: Vec<_> = spec.boundaries.iter().filter_map(|b| word(b.condition)).collect();
    boundaries.sort_unstable();
    boundaries.dedup();
    let law = spec.law_name();
    let parameters = spec.parameters.into_iter().map(|parameter| Parameter {
        name: parameter.name,
        default: parameter.default,
        unit: parameter.unit,
        admissible: parameter.range,
        description: parameter.description,
    });
    Ok(Entry {
        name: name.to_owned(),
        origin,
        title: spec.title,
        reference: spec.reference,
        coordinates: spec.coordinates.name().to_owned(),
        dimension: spec.dimension,
        law,
        boundaries,
        parameters: parameters.collect(),
    })
}

/// A boundary condition in one word; planes of symmetry cut the body and are no boundary of it.
fn word(condition: Condition) -> Option<&'static str> {
    match condition {
        Condition::Sliding => Some("sliding"),
        Condition::Symmetry => None,
        Condition::TractionFree => Some("free"),
        Condition::PrescribedTraction => Some("loaded"),
        Condition::PrescribedMotion => Some("moved"),
        Condition::Mixed(_) => Some("mixed"),
    }
}

/// A line for each solution, and the files of those that have one.
fn short(entries: &[Entry]) -> String {
    let mut table = Table::new(5, ["name", "", "law", "sides", ""]).sparing(3..4).flowing(20);
    let mut files = String::new();
    for Entry { name, origin, title, dimension, law, boundaries, .. } in entries {
        let sides = boundaries.join(", ");
        table.row([name.clone(), format!("{dimension}D"), (*law).to_owned(), sides, title.clone()]);
        if matches!(origin, Origin::File { .. }) {
            files += &format!("{name}: {}\n", origin.words());
        }
    }
    let left_out = table::on_left_out(std::slice::from_ref(&table), "A wider terminal has them.");
    format!("{}{left_out}{files}{LEGEND}", table.text())
}

const LEGEND: &str = "\
sides: moved = given displacement, loaded = given traction, free, sliding, mixed = by component
mms list --long: parameters and references; mms explain NAME: formulas
";

impl Entry {
    fn text(&self) -> String {
        let Self { name, origin, title, reference, coordinates, dimension, parameters, .. } = self;
        let mut text = format!("{name} ({dimension}D, {coordinates}): {title}\n");
        if !reference.is_empty() {
            text += &format!("  {reference}\n");
        }
        text += &format!("  {}\n", origin.words());
        let mut table =
            Table::new(5, ["parameter", "default", "unit", "admissible", ""]).flowing(20);
        for parameter in parameters {
            table.row([
                parameter.name.clone(),
                number::exact(parameter.default),
                parameter.unit.clone(),
                parameter.admissible.clone(),
                parameter.description.clone(),
            ]);
        }
        text + &table.text() + "\n"
    }

    fn document(&self) -> Value {
        let parameters: Vec<_> = self
            .parameters
            .iter()
            .map(|parameter| {
                json!({
                    "name": parameter.name,
                    "default": parameter.default,
                    "unit": parameter.unit,
                    "admissible": parameter.admissible,
                    "description": parameter.description,
                })
            })
            .collect();
        let (source, file) = match &self.origin {
            Origin::BuiltIn(_) | Origin::Text { .. } => ("built-in", None),
            Origin::File { path, instead_of: None, .. } => ("file", Some(path.display())),
            Origin::File { path, instead_of: Some(_), .. } => {
                ("file-differs-from-built-in", Some(path.display()))
            }
        };
        json!({
            "name": self.name,
            "title": self.title,
            "reference": self.reference,
            "coordinates": self.coordinates,
            "dimension": self.dimension,
            "source": source,
            "file": file.map(|path| path.to_string()),
            "fields": self.origin.evaluation(),
            "parameters": parameters,
        })
    }
}
