//! The JSON document of a comparison.

use std::collections::BTreeMap;

use mmsmith_verify::{Remark, Score};
use serde_json::{Value, json};

use crate::arguments::ScoreOptions;
use crate::library::Selection;

/// Entries that every document of the command has.
pub(super) fn settings(selection: &Selection, options: &ScoreOptions) -> Value {
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
            "times": options.times,
            "times_from": options.times_from,
            "frame_step": options.frame_step,
            "origin": options.origin,
            "length_unit": options.length_unit,
            "time_unit": options.time_unit,
            "axes": options.axes.iter().map(|axis| ["x", "y", "z"][*axis]).collect::<Vec<_>>(),
            "inside": options.inside,
            "velocity_lag": lag(&options.velocity_lag),
            "periods": options.periods,
        },
    });
    if options.expect.is_some() || options.tolerance.is_some() {
        document["settings"]["expect"] = json!(options.expect);
        document["settings"]["tolerance"] = json!(options.tolerance);
    }
    if let Some((shape, integrator)) = options.against {
        document["settings"]["against"] =
            json!({ "shape": shape.name(), "integrator": integrator.name(), "cfl": options.cfl });
    }
    document
}

/// Findings on the rows.
pub(super) fn findings<'a>(rows: impl Iterator<Item = (&'a String, &'a [Remark])>) -> Value {
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

/// One number for all recordings, or a list.
fn lag(lags: &[f64]) -> Value {
    match lags {
        [one] => json!(one),
        _ => json!(lags),
    }
}

pub(super) fn document(selection: &Selection, options: &ScoreOptions, score: &Score) -> Value {
    let mut document = settings(selection, options);
    document["rows"] = json!(score.rows);
    document["findings"] = findings(score.rows.iter().map(|row| (&row.file, &row.findings[..])));
    if let Some(orders) = &score.orders {
        document["orders"] = json!(orders);
    }
    if let Some(orders) = &score.integrated_orders {
        document["integrated_orders"] = json!(orders);
    }
    document["verdict"] = json!(score.verdict);
    document["passed"] = json!(score.verdict.passed);
    document
}
