//! `mms check`: is the field code right?

use anyhow::{Result, bail};
use mmsmith_solutions::CATALOGUE;
use mmsmith_verify::{
    BLUNT, CheckReport, OWN_ERROR_FACTOR, TOLERANCE, Verdict, check as check_fields,
};
use serde_json::json;

use crate::arguments::CheckOptions;
use crate::json::Output;
use crate::library::Subject;
use crate::table::{self, Table};
use crate::terminal;

pub(crate) fn check(options: &CheckOptions) -> Result<bool> {
    if options.thorough {
        return super::thorough::thorough(options);
    }
    let points = options.points.unwrap_or(300);
    let output = Output::prepare_if(options.json.as_ref())?;
    let names: Vec<String> = if options.solutions.is_empty() {
        CATALOGUE.iter().map(|known| known.name.to_owned()).collect()
    } else {
        options.solutions.clone()
    };
    if names.is_empty() {
        bail!("there is no solution to check");
    }
    // All names and parameters are judged before the first check.
    let subjects = names
        .iter()
        .map(|name| Subject::new(name, &options.parameters.set))
        .collect::<Result<Vec<_>>>()?;
    let mut results = Vec::new();
    let mut passed = true;
    for Subject { name, solution, parameters } in &subjects {
        let report = check_fields(solution, points)?;
        terminal::say(&text(name, &report))?;
        passed &= report.passed();
        results.push(json!({
            "solution": name,
            "parameters": parameters,
            "points": report.points,
            "findings": report.findings,
            "passed": report.passed(),
        }));
    }
    terminal::say(&format!(
        "All numbers but the scale are relative to it. Allowed: {OWN_ERROR_FACTOR} times the check's own estimated \
         error, plus {TOLERANCE:e}.\n"
    ))?;
    if let Some(output) = output {
        output.write(&json!({
            "schema": "mmsmith.check/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solutions": names,
                "points": points,
                "own_error_factor": OWN_ERROR_FACTOR,
                "tolerance": TOLERANCE,
                "blunt": BLUNT,
            },
            "results": results,
            "passed": passed,
        }))?;
    }
    Ok(passed)
}

/// The findings of one solution as a table, and the place of each that did not pass.
fn text(name: &str, report: &CheckReport) -> String {
    let verdict = if report.passed() { "passed" } else { "FAILED" };
    let mut text = format!("{name}: {verdict} at {} points\n", report.points);
    let header =
        ["field", "compared with", "verdict", "difference", "own error", "allowed", "scale"];
    let mut table = Table::new(3, header);
    let mut places = String::new();
    for finding in &report.findings {
        let verdict = match finding.verdict {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::Inconclusive => "inconclusive",
        };
        // A field that is zero everywhere has no scale to be relative to.
        let unit = if finding.scale > 0.0 { finding.scale } else { 1.0 };
        table.row([
            finding.what.clone(),
            finding.against.to_owned(),
            verdict.to_owned(),
            table::error(finding.difference / unit),
            table::error(finding.own_error / unit),
            table::error(finding.allowed / unit),
            table::error(finding.scale),
        ]);
        if finding.verdict != Verdict::Passed {
            places += &format!(
                "  {} is worst at X = {:?}, t = {:?}: difference {:e}, allowed {:e}\n",
                finding.what, finding.X, finding.t, finding.difference, finding.allowed
            );
        }
    }
    text += &table.text();
    text += &places;
    text.push('\n');
    text
}
