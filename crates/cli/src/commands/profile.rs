//! Where the time of a run's steps went, and how many threads keep busy with them.

use mmsmith_verify::{Division, PassTime, Profile};
use serde_json::{Value, json};

use crate::number;
use crate::table::Table;

/// Digits of seconds and of cores.
const DIGITS: usize = 3;

/// The passes of the steps of a run, with the particles that each goes over.
pub(super) fn text(profile: &Profile, particles: usize) -> String {
    let Profile { passes, division } = profile;
    if passes.is_empty() {
        return "--profile: the total Lagrangian formulation has no passes of particles and grid\n"
            .to_owned();
    }
    let all: f64 = passes.iter().map(|pass| pass.seconds).sum();
    let mut table = Table::new(1, ["pass", "times", "seconds", "%", "ns a particle"]);
    for PassTime { pass, seconds, calls } in passes {
        table.row([
            pass.name().to_owned(),
            calls.to_string(),
            number::rounded(*seconds, DIGITS),
            format!("{:.1}", 100.0 * seconds / all),
            format!("{:.1}", 1e9 * seconds / (*calls as f64 * particles as f64)),
        ]);
    }
    let mut text = format!("the passes of a step\n{}", table.text());
    if let Some(Division { tiles, unevenness, cores }) = division {
        text += &format!(
            "{}; the fullest has {} times the mean number of particles; threads of use: {}\n",
            number::counted(*tiles, "tile"),
            number::rounded(*unevenness, DIGITS),
            number::rounded(*cores, DIGITS),
        );
    }
    text
}

pub(super) fn document(profile: &Profile) -> Value {
    let Profile { passes, division } = profile;
    let pass = |PassTime { pass, seconds, calls }: &PassTime| json!({ "name": pass.name(), "calls": calls, "seconds": seconds });
    json!({
        "passes": passes.iter().map(pass).collect::<Vec<_>>(),
        "division": division.map(|division| division_document(&division)),
    })
}

/// Tiles, their unevenness, and the threads that they keep busy.
pub(super) fn division_document(division: &Division) -> Value {
    let Division { tiles, unevenness, cores } = division;
    json!({ "tiles": tiles, "unevenness": unevenness, "cores_of_use": cores })
}
