//! The checks of a solution: fields against each other, blind spots, terms of the balance that are exercised.

use crate::refusal::Refusal;
use crate::session::Session;
use mmsmith_verify::{blind_spots, check, coverage};
use serde_json::{Value, json};

/// The points at which fields are compared.
const POINTS: usize = 300;
/// As many where the stress follows from histories, which take a thousand times what formulas do.
const POINTS_OF_HISTORIES: usize = 40;
/// The points at which terms of the balance are measured.
const POINTS_OF_TERMS: usize = 200;

pub(crate) fn of(session: &Session) -> Result<Value, Refusal> {
    let solution = session.solution()?;
    let has_history = session.spec.has_history();
    let points = if has_history { POINTS_OF_HISTORIES } else { POINTS };
    let report = check(&solution, points)?;
    let blind: Vec<String> = blind_spots(&solution).iter().map(ToString::to_string).collect();
    let shares = match has_history {
        true => Vec::new(),
        false => coverage(&solution, POINTS_OF_TERMS)?,
    };
    let shares: Vec<Value> = shares
        .iter()
        .map(|share| json!({ "part": share.part.to_string(), "share": share.share }))
        .collect();
    Ok(json!({
        "passed": report.passed(),
        "points": report.points,
        "findings": report.findings,
        "blind": blind,
        "shares": shares,
    }))
}
