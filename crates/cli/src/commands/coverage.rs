//! `mms coverage`: which terms of the momentum balance each solution exercises, and which solutions test everything.

use anyhow::Result;
use mmsmith_verify::{Part, Share, coverage as measure, smallest_set};
use serde_json::{Map, Value, json};

use crate::arguments::CoverageOptions;
use crate::json::Output;
use crate::library::{Selection, names};
use crate::table::Table;
use crate::terminal;

/// Sample points and times of each solution.
pub(crate) const POINTS: usize = 200;
/// The share from which on a part counts as exercised.
pub(crate) const THRESHOLD: f64 = 0.01;

pub(crate) fn coverage(options: &CoverageOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let names = if options.solutions.is_empty() { names() } else { options.solutions.clone() };
    let mut shares = Vec::new();
    for name in &names {
        shares.push(measure(&Selection::new(name, &[])?.build()?, POINTS)?);
    }
    let set: Vec<&String> = smallest_set(&shares, THRESHOLD).iter().map(|&i| &names[i]).collect();
    let missing: Vec<Part> = Part::all()
        .into_iter()
        .enumerate()
        .filter(|(row, _)| shares.iter().all(|shares| shares[*row].share < THRESHOLD))
        .map(|(_, part)| part)
        .collect();
    terminal::say(&text(&names, &shares, &set, &missing))?;
    if let Some(output) = output {
        let rows: Vec<Value> = names
            .iter()
            .zip(&shares)
            .map(|(name, shares)| json!({ "solution": name, "shares": document(shares) }))
            .collect();
        output.write(&json!({
            "schema": "mmsmith.coverage/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "points": POINTS,
                "threshold": THRESHOLD,
            },
            "rows": rows,
            "smallest_set": set,
            "not_exercised": missing.iter().map(Part::to_string).collect::<Vec<_>>(),
        }))?;
    }
    Ok(true)
}

/// Shares by the names of the parts.
pub(crate) fn document(shares: &[Share]) -> Map<String, Value> {
    shares.iter().map(|s| (s.part.to_string(), json!(s.share))).collect()
}

/// A column for each solution, a row for each part, shares in per cent.
fn text(names: &[String], shares: &[Vec<Share>], set: &[&String], missing: &[Part]) -> String {
    let mut text = String::from("Shares in per cent; '.' where a part vanishes.\n");
    for (index, name) in names.iter().enumerate() {
        text += &format!("  {:>2}  {name}\n", index + 1);
    }
    let numbers: Vec<String> = (1..=names.len()).map(|n| n.to_string()).collect();
    let header: Vec<&str> =
        std::iter::once("part").chain(numbers.iter().map(String::as_str)).collect();
    let mut table = Table::new(1, header);
    for (row, part) in Part::all().into_iter().enumerate() {
        let cells = shares.iter().map(|shares| match shares[row].share {
            0.0 => ".".to_owned(),
            share if share < 0.001 => "<0.1".to_owned(),
            share => format!("{:.1}", 100.0 * share),
        });
        table.row(std::iter::once(part.to_string()).chain(cells));
    }
    text += &table.text();
    let exceeds = |share: &Share| share.part == Part::LoadedSurface && share.share > 1.0;
    if shares.iter().flatten().any(exceeds) {
        text += "Loaded surface: the traction there over the stress within the body, root mean squares. Above 100, \
                 stresses are largest on the surface.\n";
    }
    let names: Vec<&str> = set.iter().map(|name| name.as_str()).collect();
    let least = 100.0 * THRESHOLD;
    if shares.len() > 1 {
        let all = if missing.is_empty() { "all of it" } else { "all that any of these does" };
        text += &format!(
            "The fewest that exercise {all}, each part to {least} % at least: {}\n",
            names.join(", ")
        );
    }
    let subject = if shares.len() > 1 { "None of these exercises" } else { "It does not exercise" };
    for part in missing {
        text += &format!("{subject}, to {least} %: {part}\n");
    }
    text
}
