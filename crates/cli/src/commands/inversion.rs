//! Motions that turn the body inside out, as `check` and `run` tell them.

use anyhow::Result;
use mmsmith_verify::{Inversion, inversion};
use serde::Serialize;

use crate::library::Selection;
use crate::number;

/// Halvings of the interval in which the largest admissible amplitude lies.
const HALVINGS: usize = 12;
/// Digits of an amplitude.
const DIGITS: usize = 3;

/// Where the exact motion is inverted, and a parameter with which it is not.
#[derive(Serialize)]
pub(crate) struct Told {
    #[serde(flatten)]
    found: Inversion,
    /// A parameter, and its value that is nearest to the present one without an inversion.
    #[serde(skip_serializing_if = "Option::is_none")]
    largest: Option<(String, f64)>,
}

/// Whether the exact motion of a solution turns the body inside out.
pub(crate) fn measure(selection: &Selection) -> Result<Option<Told>> {
    let Some(found) = inversion(&selection.build()?) else { return Ok(None) };
    Ok(Some(Told { found, largest: largest(selection) }))
}

impl Told {
    /// A line of it.
    pub(crate) fn text(&self) -> String {
        let Inversion { t, X, least } = &self.found;
        let place: Vec<String> = X.iter().map(|x| number::rounded(*x, DIGITS)).collect();
        let begins = if *t > 0.0 { "from" } else { "already at" };
        let remedy = self.largest.as_ref().map(|(name, value)| {
            format!("; with {name} = {} J stays positive", number::rounded(*value, DIGITS))
        });
        format!(
            "the exact motion turns the body inside out: J <= 0 at X = ({}) {begins} t = {}, least J = {}{}",
            place.join(", "),
            number::rounded(*t, DIGITS),
            number::rounded(*least, DIGITS),
            remedy.unwrap_or_default()
        )
    }
}

/// The parameter whose value has to change least for a motion without inversion, by its factor between 0 and 1, and that value.
fn largest(selection: &Selection) -> Option<(String, f64)> {
    let candidates = selection.parameters().iter().filter_map(|(name, value)| {
        let is_sound = |factor: f64| {
            let changed = selection.with(&[(name.clone(), factor * value)]);
            changed.and_then(|changed| changed.build()).is_ok_and(|s| inversion(&s).is_none())
        };
        // Amplitudes leave a body at rest where they vanish.
        if !is_sound(1e-6) {
            return None;
        }
        let (mut sound, mut inverted) = (1e-6, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (sound + inverted);
            if is_sound(middle) { sound = middle } else { inverted = middle }
        }
        Some((name.clone(), sound, sound * value))
    });
    let best = candidates.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((best.0, best.2))
}
