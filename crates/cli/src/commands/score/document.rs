//! A comparison for programs.

use std::collections::BTreeMap;

use mmsmith_verify::{Named, Remark, Score};
use serde_json::{Map, Value, json};

use crate::arguments::ScoreOptions;
use crate::library::Selection;

/// Settings that every document of the command has.
pub(super) fn settings(selection: &Selection, options: &ScoreOptions) -> Value {
    let map: BTreeMap<_, _> = options.map.iter().map(|(role, name)| (role.name(), name)).collect();
    let mut settings = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "solution": selection.name(),
        "parameters": selection.parameters(),
        "files": options.files,
        "each": options.each,
        "map": map,
        "points": options.points.name(),
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
    });
    if options.expect.is_some() || options.tolerance.is_some() {
        settings["expect"] = json!(options.expect);
        settings["tolerance"] = json!(options.tolerance);
    }
    if let Some((shape, integrator)) = options.against {
        settings["against"] =
            json!({ "shape": shape.name(), "integrator": integrator.name(), "cfl": options.cfl });
    }
    settings
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

/// The results of a comparison.
pub(super) fn results(score: &Score) -> Map<String, Value> {
    let findings = findings(score.rows.iter().map(|row| (&row.file, &row.findings[..])));
    let all = [
        ("rows", json!(score.rows)),
        ("findings", findings),
        ("verdict", json!(score.verdict)),
        ("passed", json!(score.verdict.passed)),
    ];
    let orders = score.orders.as_ref().map(|orders| ("orders", json!(orders)));
    let integrated =
        score.integrated_orders.as_ref().map(|orders| ("integrated_orders", json!(orders)));
    let across = score.across_orders.as_ref().map(|orders| ("across_orders", json!(orders)));
    let all = all.into_iter().chain(orders).chain(across).chain(integrated);
    all.map(|(name, value)| (name.to_owned(), value)).collect()
}
