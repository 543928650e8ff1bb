//! Blind spots of a solution, as `explain`, `check` and `score` tell them.

use anyhow::Result;
use mmsmith_verify::{BlindSpot, blind_spots};
use serde::Serialize;

use crate::library::Selection;
use crate::number;

/// A blind spot and, where another value of one parameter ends it, that value.
#[derive(Serialize)]
pub(crate) struct Told {
    kind: BlindSpot,
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    set: Option<String>,
}

/// The blind spots of a solution with the parameters that it was selected with.
pub(crate) fn measure(selection: &Selection) -> Result<Vec<Told>> {
    let found = blind_spots(&selection.build()?);
    let told = |kind: &BlindSpot| {
        let set = remedy(selection, *kind, &found);
        Told { kind: *kind, message: kind.to_string(), set }
    };
    Ok(found.iter().map(told).collect())
}

/// A line for each.
pub(crate) fn text(told: &[Told]) -> String {
    let line = |spot: &Told| {
        let set = spot.set.as_ref().map(|set| format!("; --set {set} would show it"));
        format!("  blind spot: {}{}\n", spot.message, set.unwrap_or_default())
    };
    told.iter().map(line).collect()
}

/// The first value of a parameter with which the blind spot is gone and no other one is new, as tried. A spot that lies in the
/// motion has none.
fn remedy(selection: &Selection, spot: BlindSpot, found: &[BlindSpot]) -> Option<String> {
    let values: fn(f64) -> Vec<f64> = match spot {
        BlindSpot::UnitDensity => |value| vec![4.0 * value],
        BlindSpot::NoLambda | BlindSpot::EqualModuli => |value| vec![0.3, 4.0 * value],
        _ => return None,
    };
    let tries = selection.parameters().iter().flat_map(|(name, value)| {
        values(*value).into_iter().map(move |value| (name.clone(), value))
    });
    tries.into_iter().find_map(|(name, value)| {
        let changed = selection.with(&[(name.clone(), value)]).ok()?.build().ok()?;
        let left = blind_spots(&changed);
        let is_gone = left.iter().all(|other| *other != spot && found.contains(other));
        is_gone.then(|| format!("{name}={}", number::exact(value)))
    })
}
