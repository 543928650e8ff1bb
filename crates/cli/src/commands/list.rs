//! `mms list`: what there is.

use anyhow::Result;
use mmsmith_solutions::CATALOGUE;
use serde_json::json;

use crate::arguments::ListOptions;
use crate::json::Output;
use crate::table::Table;
use crate::{number, terminal};

pub(crate) fn list(options: &ListOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let mut text = String::new();
    let mut rows = Vec::new();
    for description in CATALOGUE {
        text += &format!(
            "{} ({}D, {}): {}\n",
            description.name, description.dimension, description.coordinates, description.title
        );
        if !description.reference.is_empty() {
            text += &format!("  {}\n", description.reference);
        }
        let mut table = Table::new(5, ["parameter", "default", "unit", "admissible", ""]);
        for parameter in description.parameters {
            table.row([
                parameter.name.to_owned(),
                number::exact(parameter.default),
                parameter.unit.to_owned(),
                parameter.admissible.to_owned(),
                parameter.description.to_owned(),
            ]);
        }
        text += &table.text();
        text.push('\n');
        let parameters: Vec<_> = description
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
        rows.push(json!({
            "name": description.name,
            "title": description.title,
            "reference": description.reference,
            "coordinates": description.coordinates,
            "dimension": description.dimension,
            "parameters": parameters,
        }));
    }
    terminal::say(&text)?;
    if let Some(output) = output {
        let settings = json!({ "version": env!("CARGO_PKG_VERSION") });
        output.write(&json!({ "schema": "mmsmith.list/1", "settings": settings, "rows": rows }))?;
    }
    Ok(true)
}
