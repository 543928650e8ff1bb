//! `mms check`: is the field code right?

use anyhow::{Result, bail};
use mmsmith_expr::nearest_f64;
use mmsmith_prove::{Equality, Published, Report};
use mmsmith_solutions::CATALOGUE;
use mmsmith_spec::Spec;
use mmsmith_verify::{
    BLUNT, CheckReport, OWN_ERROR_FACTOR, TOLERANCE, Verdict, check as check_fields,
};
use serde_json::{Map, Value, json};

use crate::arguments::CheckOptions;
use crate::json::Output;
use crate::library::Subject;
use crate::table::{self, Table};
use crate::terminal;

pub(crate) fn check(options: &CheckOptions) -> Result<bool> {
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
    let listings = subjects
        .iter()
        .map(|subject| Published::read(&subject.spec, &subject.file, subject.folder.as_deref()))
        .collect::<Result<Vec<_>, _>>()?;
    let mut results = Vec::new();
    let mut passed = true;
    for (Subject { name, solution, parameters, spec, .. }, listings) in
        subjects.iter().zip(&listings)
    {
        let report = check_fields(solution, options.points)?;
        let comparisons = compare(spec, listings)?;
        let all_passed =
            report.passed() && comparisons.iter().all(|comparison| comparison.report.proved());
        terminal::say(&text(name, all_passed, &report, &comparisons))?;
        passed &= all_passed;
        results.push(json!({
            "solution": name,
            "parameters": parameters,
            "points": report.points,
            "findings": report.findings,
            "cross_checks": comparisons.iter().map(Comparison::document).collect::<Vec<_>>(),
            "passed": all_passed,
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
                "points": options.points,
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

/// What came out for one published listing.
struct Comparison {
    source: String,
    report: Report,
}

impl Comparison {
    fn document(&self) -> Value {
        let components = self.report.components.iter().map(|component| match &component.verdict {
            Equality::Proved { digits } => json!({
                "entry": component.entry,
                "points": component.points,
                "verdict": "proved",
                "digits": digits,
            }),
            Equality::Refuted { digits, differing, place, listing, derived } => json!({
                "entry": component.entry,
                "points": component.points,
                "verdict": "refuted",
                "digits": digits,
                "differing": differing,
                "place": place.iter().map(|(name, value)| (name.clone(), json!(value))).collect::<Map<_, _>>(),
                "listing": nearest_f64(listing),
                "derived": nearest_f64(derived),
            }),
        });
        json!({
            "source": self.source,
            "components": components.collect::<Vec<_>>(),
            "not_compared": self.report.unchecked,
            "proved": self.report.proved(),
        })
    }
}

/// Holds published listings against the fields derived from `spec`.
fn compare(spec: &Spec, listings: &[Published<'_>]) -> Result<Vec<Comparison>> {
    if listings.is_empty() {
        return Ok(Vec::new());
    }
    let fields = spec.derive()?;
    let compare = |listing: &Published<'_>| {
        let source = listing.source().to_owned();
        Ok(Comparison { source, report: listing.compare(&fields)? })
    };
    listings.iter().map(compare).collect()
}

/// The findings of one solution as a table, and the place of each that did not pass.
fn text(name: &str, passed: bool, report: &CheckReport, comparisons: &[Comparison]) -> String {
    let verdict = if passed { "passed" } else { "FAILED" };
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
    for Comparison { source, report } in comparisons {
        text += &format!("  listing '{source}'\n");
        for line in report.to_string().lines() {
            text += &format!("    {line}\n");
        }
    }
    text.push('\n');
    text
}
