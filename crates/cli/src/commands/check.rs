//! `mms check`: is the field code right?

use anyhow::{Result, anyhow, bail};
use mmsmith_claims::{
    Equality, Outcome, Published, Report, SurfaceFinding, surfaces as judge_surfaces,
};
use mmsmith_expr::nearest_f64;
use mmsmith_spec::{ClaimKind, Spec};
use mmsmith_verify::{
    BEYOND_LAW, BLUNT, Change, CheckReport, OWN_ERROR_FACTOR, OnAxis, TOLERANCE, Verdict,
    check as check_fields, history_of,
};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

use super::growth::{MOST_GROWTH_WORK, Told};
use super::{blind, history, inversion};
use crate::arguments::CheckOptions;
use crate::json::Output;
use crate::library::{Subject, names};
use crate::number;
use crate::table::{self, Table};
use crate::terminal;

/// The points at which a solution with memory is checked.
const OF_HISTORIES: usize = 40;
/// The part of the points of a law with memory at which other parameters are checked.
const SHARE_OF_SETS: usize = 4;

/// The particles whose histories are followed to tell where the body flows.
const HISTORIES: usize = 200;

pub(crate) fn check(options: &CheckOptions) -> Result<bool> {
    if options.thorough {
        return super::thorough::thorough(options);
    }
    let most = options.points.unwrap_or(300);
    let output = Output::prepare_if(options.json.as_ref())?;
    let names = if options.solutions.is_empty() { names() } else { options.solutions.clone() };
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
    let mut tables = Vec::new();
    let mut passed = true;
    for (Subject { name, solutions, parameters, selection, spec, .. }, listings) in
        subjects.iter().zip(&listings)
    {
        // A history takes a thousand times what a formula does.
        let points = match options.points {
            None if spec.has_history() => OF_HISTORIES,
            _ => most,
        };
        // Other parameters are looked at for mistakes that hide at those asked for, which a few histories show.
        let of_set = |set: usize| match set {
            0 => points,
            _ if spec.has_history() => points.div_ceil(SHARE_OF_SETS),
            _ => points,
        };
        let sets = solutions.par_iter().enumerate();
        let reports = sets.map(|(set, solution)| check_fields(solution, of_set(set)));
        let reports: Vec<_> = reports.collect();
        let report = CheckReport::worst_of(reports.into_iter().collect::<Result<_, _>>()?);
        let claims = Claims::judge(spec, listings)?;
        // The first solution has the parameters asked for.
        let history = match solutions.first() {
            Some(solution) => {
                history_of(solution, HISTORIES).map_err(|reason| anyhow!("{reason}"))?
            }
            None => None,
        };
        let blind = blind::measure(selection)?;
        let inverted = inversion::measure(selection)?;
        let all_passed = report.passed() && claims.hold();
        let table = table(&report);
        let findings = text(name, all_passed, &report, parameters, &claims, &table);
        let motion =
            solutions.first().map(|solution| Told::measure(solution, 1.0, MOST_GROWTH_WORK));
        let told = inverted.as_ref().map(|told| format!("  {}\n", told.text()));
        let history_told = match (&history, solutions.first()) {
            (Some(report), Some(solution)) => history::text(report, solution),
            _ => String::new(),
        };
        terminal::say(&format!(
            "{findings}{}{history_told}{}{}{}\n",
            unused(spec),
            told.unwrap_or_default(),
            motion.as_ref().map(|motion| motion.text("  ")).unwrap_or_default(),
            blind::text(&blind)
        ))?;
        tables.push(table);
        passed &= all_passed;
        results.push(json!({
            "solution": name,
            "parameters": parameters.first(),
            "parameter_sets": parameters,
            "points": report.points,
            "findings": report.findings,
            "not_periodic": report.not_periodic,
            "on_axis": report.on_axis,
            "blind_spots": blind,
            "history": history.as_ref().map(history::document),
            "inverted": inverted,
            "motion": motion.as_ref().map(Told::document),
            "surfaces": claims.surfaces.iter().map(surface_document).collect::<Vec<_>>(),
            "cross_checks": claims.listings.iter().map(Comparison::document).collect::<Vec<_>>(),
            "passed": all_passed,
        }));
    }
    terminal::say(&format!(
        "All numbers but the scale are relative to it. Allowed: {OWN_ERROR_FACTOR} times the check's own estimated \
         error, plus {TOLERANCE:e}.\n"
    ))?;
    terminal::say(&table::on_left_out(&tables, "A wider terminal and --json have them."))?;
    if let Some(output) = output {
        output.write(&json!({
            "schema": "mmsmith.check/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solutions": names,
                "points": most,
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

/// Result for one published listing.
struct Comparison {
    source: String,
    report: Report,
}

impl Comparison {
    fn document(&self) -> Value {
        let components = self.report.components.iter().map(|component| match &component.verdict {
            Equality::Verified { digits } => json!({
                "entry": component.entry,
                "points": component.points,
                "verdict": "verified",
                "digits": digits,
            }),
            Equality::Refuted { digits, differing, place, listing, derived } => json!({
                "entry": component.entry,
                "points": component.points,
                "verdict": "refuted",
                "digits": digits,
                "differing": differing,
                "place": named(place),
                "listing": nearest_f64(listing),
                "derived": nearest_f64(derived),
            }),
        });
        json!({
            "source": self.source,
            "components": components.collect::<Vec<_>>(),
            "not_compared": self.report.unchecked,
            "verified": self.report.verified(),
        })
    }
}

/// Claims of a specification, and their results.
struct Claims {
    surfaces: Vec<SurfaceFinding>,
    listings: Vec<Comparison>,
}

impl Claims {
    fn judge(spec: &Spec, listings: &[Published<'_>]) -> Result<Self> {
        let fields = spec.derive()?;
        let compare = |listing: &Published<'_>| {
            let source = listing.source().to_owned();
            Ok(Comparison { source, report: listing.compare(&fields)? })
        };
        Ok(Claims {
            surfaces: judge_surfaces(spec, &fields)?,
            listings: listings.iter().map(compare).collect::<Result<_>>()?,
        })
    }

    fn hold(&self) -> bool {
        self.surfaces.iter().all(SurfaceFinding::holds)
            && self.listings.iter().all(|comparison| comparison.report.verified())
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let name =
            |finding: &SurfaceFinding| format!("{} on {}", claim(finding.claim), finding.surface);
        let symbolic = self.surfaces.iter().filter(|p| p.outcome == Outcome::Proved).map(name);
        let symbolic = symbolic.collect::<Vec<_>>().join(", ");
        if !symbolic.is_empty() {
            text += &format!("  proved, zero in symbols for all parameters: {symbolic}\n");
        }
        for finding in &self.surfaces {
            let outcome = match &finding.outcome {
                Outcome::Proved => continue,
                Outcome::Verified { digits, points } => {
                    format!(
                        "zero, verified to {digits:.0} digits at {points} points with random parameters"
                    )
                }
                Outcome::Refuted { value, scale, place } => {
                    let place: Vec<String> =
                        place.iter().map(|(name, x)| format!("{name} = {x:?}")).collect();
                    format!("NOT zero: {value:e} of {scale:e} at {}", place.join(", "))
                }
            };
            text += &format!("  {}: {outcome}\n", name(finding));
        }
        for Comparison { source, report } in &self.listings {
            text += &format!("  listing '{source}'\n");
            for line in report.to_string().lines() {
                text += &format!("    {line}\n");
            }
        }
        text
    }
}

/// A claim, as the table of findings names it.
fn claim(kind: ClaimKind) -> &'static str {
    match kind {
        ClaimKind::Traction => "P N",
        ClaimKind::Shear => "shear",
        ClaimKind::NormalTraction => "N.P N",
        ClaimKind::TractionComponent(axis) => {
            ["P N along X", "P N along Y", "P N along Z"][axis % 3]
        }
        ClaimKind::NormalDisplacement => "u.N",
    }
}

fn surface_document(finding: &SurfaceFinding) -> Value {
    let what = format!("{} on {}", claim(finding.claim), finding.surface);
    match &finding.outcome {
        Outcome::Proved => json!({ "what": what, "verdict": "proved", "by": "symbols" }),
        Outcome::Verified { digits, points } => json!({
            "what": what,
            "verdict": "verified",
            "by": "digits",
            "digits": digits,
            "points": points,
        }),
        Outcome::Refuted { value, scale, place } => json!({
            "what": what,
            "verdict": "refuted",
            "value": value,
            "scale": scale,
            "place": named(place),
        }),
    }
}

fn named(place: &[(String, f64)]) -> Map<String, Value> {
    place.iter().map(|(name, value)| (name.clone(), json!(value))).collect()
}

/// The findings of one solution as a table, and the place of each that did not pass.
fn text(
    name: &str,
    passed: bool,
    report: &CheckReport,
    parameters: &[BTreeMap<String, f64>],
    claims: &Claims,
    table: &Table,
) -> String {
    let verdict = if passed { "passed" } else { "FAILED" };
    let sets = number::counted(parameters.len(), "set");
    let mut text = format!("{name}: {verdict} at {} points, {sets} of parameters\n", report.points);
    text += &table.text();
    text += &places(report, parameters);
    if let Some(Change { period, u, v }) = report.not_periodic {
        text += &format!(
            "  remark: the motion is not the same after its period of {}: u differs by {:.2} % of its largest, v by {:.2} %\n",
            number::exact(period),
            100.0 * u,
            100.0 * v
        );
    }
    if let Some(OnAxis { X, t, has_limit, fields }) = &report.on_axis {
        let (place, fields) = (list(X), fields.join(", "));
        let time = number::rounded(*t, 3);
        text += &match has_limit {
            true => format!(
                "  remark: the formulas of {fields} divide by zero on the axis, as at X = {place}: mms eval takes the limits; a run, or generated \
                 code, needs points beside it\n"
            ),
            false => format!(
                "  remark: {fields} have no limit on the axis, as at X = {place}, t = {time}: the motion, or the stress, is not smooth there, and no solver \
                 converges; let u_R and u_theta begin with R, u_Z with 1 or R^2, or leave the axis out of the body\n"
            ),
        };
    }
    text + &claims.text()
}

/// A remark on parameters without an effect.
fn unused(spec: &Spec) -> String {
    let names = spec.unused_parameters();
    if names.is_empty() {
        return String::new();
    }
    format!(
        "  remark: no formula names {}, so that values there change nothing: write it into a formula, or leave it out of [parameters]\n",
        names.join(", ")
    )
}

/// A place as specifications and tables of points have it.
fn list(X: &[f64]) -> String {
    format!("[{}]", X.iter().map(|x| number::rounded(*x, 3)).collect::<Vec<_>>().join(", "))
}

/// The findings of one solution, a row each.
fn table(report: &CheckReport) -> Table {
    let header =
        ["field", "compared with", "verdict", "difference", "own error", "allowed", "scale"];
    let mut table = Table::new(3, header).sparing(4..5).sparing(6..7);
    for finding in &report.findings {
        let verdict = match finding.verdict {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::Inconclusive => "cannot judge",
        };
        // A field that is zero everywhere has no scale to be relative to.
        let unit = if finding.scale > 0.0 { finding.scale } else { 1.0 };
        table.row([
            finding.what.clone(),
            finding.against.to_owned(),
            verdict.to_owned(),
            table::error(finding.difference / unit),
            table::error(finding.own_error / unit),
            format!("{:.1e}", finding.allowed / unit),
            table::error(finding.scale),
        ]);
    }
    table
}

/// The place of each finding that did not pass.
fn places(report: &CheckReport, parameters: &[BTreeMap<String, f64>]) -> String {
    let mut places = String::new();
    for finding in report.findings.iter().filter(|finding| finding.verdict != Verdict::Passed) {
        places += &format!(
            "  {} is worst at X = {:?}, t = {:?}: difference {:e}, allowed {:e}\n",
            finding.what, finding.X, finding.t, finding.difference, finding.allowed
        );
        if let Some(set) = parameters.get(finding.parameter_set) {
            let values: Vec<String> =
                set.iter().map(|(name, value)| format!("{name} = {value:?}")).collect();
            places += &format!("    with {}\n", values.join(", "));
        }
        if finding.what == "F_zz" && finding.difference.is_nan() {
            places += "    there is no real F_zz here: no stretch across leaves no stress there, with these parameters and this motion; narrower \
                       ranges of the parameters keep away from it\n";
        }
        if finding.what == "W" && finding.difference.is_nan() {
            places += &format!("    the strain energy has no value here: {BEYOND_LAW}\n");
        }
    }
    places
}
