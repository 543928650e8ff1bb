//! `mms list`: what there is.

use anyhow::Result;
use mmsmith_solutions::Description;
use mmsmith_spec::{Diagnostic, Spec};
use serde_json::{Value, json};

use crate::arguments::ListOptions;
use crate::json::Output;
use crate::library::{Origin, locate, names};
use crate::table::Table;
use crate::{number, terminal};

pub(crate) fn list(options: &ListOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let mut text = String::new();
    let mut rows = Vec::new();
    let mut unreadable = Vec::new();
    for name in names() {
        match entry(&name) {
            Ok(entry) => {
                text += &entry.text();
                rows.push(entry.document());
            }
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
    terminal::say(&text)?;
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
    Ok(match origin {
        Origin::BuiltIn(description) => of_description(description, origin),
        Origin::File { .. } => of_specification(name, origin.specification()?, origin),
    })
}

fn of_description(description: &Description, origin: Origin) -> Entry {
    let parameters = description.parameters.iter().map(|parameter| Parameter {
        name: parameter.name.to_owned(),
        default: parameter.default,
        unit: parameter.unit.to_owned(),
        admissible: parameter.admissible.to_owned(),
        description: parameter.description.to_owned(),
    });
    Entry {
        name: description.name.to_owned(),
        origin,
        title: description.title.to_owned(),
        reference: description.reference.to_owned(),
        coordinates: description.coordinates.to_owned(),
        dimension: description.dimension,
        parameters: parameters.collect(),
    }
}

fn of_specification(name: &str, spec: Spec, origin: Origin) -> Entry {
    let parameters = spec.parameters.into_iter().map(|parameter| Parameter {
        name: parameter.name,
        default: parameter.default,
        unit: parameter.unit,
        admissible: parameter.range,
        description: parameter.description,
    });
    Entry {
        name: name.to_owned(),
        origin,
        title: spec.title,
        reference: spec.reference,
        coordinates: spec.coordinates.name().to_owned(),
        dimension: spec.dimension,
        parameters: parameters.collect(),
    }
}

impl Entry {
    fn text(&self) -> String {
        let Self { name, origin, title, reference, coordinates, dimension, parameters } = self;
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
            Origin::BuiltIn(_) => ("built-in", None),
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
