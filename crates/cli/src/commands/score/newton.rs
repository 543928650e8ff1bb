//! `mms score --newton`: how fast the residuals of another solver's Newton iterations fall.

use std::path::Path;

use anyhow::{Context, Result, bail};
use csv::{ReaderBuilder, Trim};
use mmsmith_verify::{LINEAR, QUADRATIC, newton_exponent};
use serde::Serialize;
use serde_json::json;

use crate::input::Source;
use crate::json::Output;
use crate::number::{counted, rounded};
use crate::table::Table;
use crate::terminal;

/// More bytes of residuals than anyone reads.
const LONGEST: u64 = 1 << 28;

/// Names of the column of residuals.
const RESIDUALS: [&str; 7] =
    ["residual", "residual_norm", "residuals", "res", "norm", "force_residual", "r"];
/// Names of the columns that number load steps, or time steps, and the iterations within one.
const STEPS: [&str; 5] = ["step", "load_step", "increment", "time_step", "inc"];
const ITERATIONS: [&str; 4] = ["iteration", "iter", "it", "newton_iteration"];

/// So much of the largest residual of a history is taken for rounding, unless it stops falling above.
const ROUNDING: f64 = 1e-14;
/// Below this share of the largest residual one that does not halve the residual before it has come to rounding.
const DEEP: f64 = 1e-8;
/// So many histories are shown; of others the number is told.
const MOST_SHOWN: usize = 20;

/// A verdict on the tangent by one history.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Verdict {
    /// The tangent is the derivative of the residual.
    Quadratic,
    /// The tangent is near the derivative, or becomes it, as in methods of secants.
    Superlinear,
    /// The tangent is not the derivative.
    Linear,
    /// The residuals do not fall, or are no numbers.
    Diverging,
    /// There are too few residuals above rounding.
    Unknown,
}

/// The residuals of one step.
#[derive(Clone, Debug, Serialize)]
struct History {
    /// The number of the step, as the file has it or counted from 1.
    step: f64,
    residuals: Vec<f64>,
    /// The exponent of the last residuals above rounding.
    exponent: Option<f64>,
    /// The factor by which the last residual above rounding is smaller than the one before it.
    ratio: Option<f64>,
    verdict: Verdict,
}

impl History {
    fn new(step: f64, residuals: Vec<f64>) -> Self {
        let rounding = rounding(&residuals);
        let exponent = newton_exponent(&residuals, rounding);
        let above: Vec<f64> = residuals.iter().copied().take_while(|r| *r > rounding).collect();
        let ratio = match above[..] {
            [.., before, last] => Some(last / before),
            _ => None,
        };
        let is_finite = residuals.iter().all(|r| r.is_finite());
        let verdict = match exponent {
            _ if !is_finite => Verdict::Diverging,
            Some(exponent) if exponent >= QUADRATIC => Verdict::Quadratic,
            Some(exponent) if exponent > LINEAR => Verdict::Superlinear,
            Some(_) => Verdict::Linear,
            None if above.len() > 3 && ratio.is_some_and(|ratio| ratio >= 1.0) => {
                Verdict::Diverging
            }
            None => Verdict::Unknown,
        };
        Self { step, residuals, exponent, ratio, verdict }
    }
}

/// The size up to which residuals are rounding: where they stop falling far below the largest.
fn rounding(residuals: &[f64]) -> f64 {
    let largest = residuals.iter().fold(0.0_f64, |largest, r| largest.max(*r));
    let stopped =
        residuals.windows(2).find(|pair| pair[0] < DEEP * largest && pair[1] > 0.5 * pair[0]);
    // Ten times rounding is what counts as above it.
    let stopped = stopped.map_or(0.0, |pair| pair[0].max(pair[1]));
    (ROUNDING * largest).max(stopped)
}

/// Whether the tangent of the solver is shown to be the derivative of its residual.
pub(super) fn judge(log: &Path, json_file: Option<&std::path::PathBuf>) -> Result<bool> {
    let output = Output::prepare_if(json_file)?;
    let file = Source::of(log);
    let text = file.short_text(LONGEST)?;
    let histories = histories(&text).with_context(|| file.to_string())?;
    let count = |verdict: Verdict| histories.iter().filter(|own| own.verdict == verdict).count();
    let quadratic = count(Verdict::Quadratic);
    let passed = quadratic > 0 && quadratic + count(Verdict::Unknown) == histories.len();
    terminal::say(&(table(&histories) + &told(&histories, passed)))?;
    if let Some(output) = output {
        output.write(&json!({
            "schema": "mmsmith.newton/1",
            "settings": { "version": env!("CARGO_PKG_VERSION"), "file": log.display().to_string() },
            "histories": histories,
            "passed": passed,
        }))?;
    }
    Ok(passed)
}

/// The histories of a table, or of numbers alone, which are one.
fn histories(text: &str) -> Result<Vec<History>> {
    let plain: Option<Vec<f64>> = text
        .split([',', ';'])
        .flat_map(str::split_whitespace)
        .map(|word| word.parse().ok())
        .collect();
    let found = match plain {
        Some(residuals) if !residuals.is_empty() => vec![(1.0, residuals)],
        _ => of_table(text)?,
    };
    if let Some(bad) = found.iter().flat_map(|(_, residuals)| residuals).find(|r| **r < 0.0) {
        bail!("a residual is {bad}; residuals are norms, numbers from zero on");
    }
    Ok(found.into_iter().map(|(step, residuals)| History::new(step, residuals)).collect())
}

/// The residuals of each step of a table with a header.
fn of_table(text: &str) -> Result<Vec<(f64, Vec<f64>)>> {
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().context("it has no line of column names")?.clone();
    let column = |names: &[&str]| {
        let is_named = |own: &str| names.iter().any(|name| own.eq_ignore_ascii_case(name));
        header.iter().position(is_named)
    };
    let residual = column(&RESIDUALS).with_context(|| {
        let names: Vec<&str> = header.iter().collect();
        format!(
            "a log is CSV with the columns step, iteration and residual, of which the first two may be left out; there is no column \
             residual among {}",
            names.join(",")
        )
    })?;
    let (step, iteration) = (column(&STEPS), column(&ITERATIONS));
    let mut all: Vec<(f64, Vec<f64>)> = Vec::new();
    let mut last = f64::INFINITY;
    for (index, row) in reader.records().enumerate() {
        let row = row.with_context(|| format!("row {}", index + 1))?;
        let number = |column: usize| {
            let cell = row.get(column).unwrap_or_default();
            cell.parse::<f64>().ok().with_context(|| {
                let name = header.get(column).unwrap_or_default();
                format!("row {}: '{cell}' in column {name} is no number", index + 1)
            })
        };
        let r = number(residual)?;
        let own = step.map(number).transpose()?;
        let at = iteration.map(number).transpose()?;
        // A step ends where its number changes, and where iterations are counted from the start again.
        let begins = match (all.last(), own, at) {
            (None, ..) => true,
            (Some((before, _)), Some(own), _) if *before != own => true,
            (_, _, Some(at)) => at <= last,
            _ => false,
        };
        last = at.unwrap_or(f64::INFINITY);
        if begins {
            all.push((own.unwrap_or(all.len() as f64 + 1.0), Vec::new()));
        }
        if let Some((_, residuals)) = all.last_mut() {
            residuals.push(r);
        }
    }
    if all.is_empty() {
        bail!("it has no row");
    }
    Ok(all)
}

fn table(histories: &[History]) -> String {
    let header = ["step", "residuals", "first", "last", "last ratio", "exponent", "verdict"];
    let mut table = Table::new(0, header.map(str::to_owned));
    for History { step, residuals, exponent, ratio, verdict } in histories.iter().take(MOST_SHOWN) {
        let size = |r: Option<&f64>| r.map_or_else(|| "-".into(), |r| format!("{r:.2e}"));
        let figure = |x: Option<f64>, digits| x.map_or_else(|| "-".into(), |x| rounded(x, digits));
        table.row([
            format!("{step}"),
            residuals.len().to_string(),
            size(residuals.first()),
            size(residuals.last()),
            figure(*ratio, 2),
            figure(*exponent, 3),
            word(*verdict).to_owned(),
        ]);
    }
    let more = match histories.len() > MOST_SHOWN {
        true => format!("{} more\n", counted(histories.len() - MOST_SHOWN, "step")),
        false => String::new(),
    };
    format!("{}{more}", table.text())
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Quadratic => "quadratic",
        Verdict::Superlinear => "superlinear",
        Verdict::Linear => "LINEAR",
        Verdict::Diverging => "DIVERGING",
        Verdict::Unknown => "not told",
    }
}

/// The verdict in a sentence.
fn told(histories: &[History], passed: bool) -> String {
    let worst = |verdict: Verdict| histories.iter().find(|history| history.verdict == verdict);
    if let Some(history) = worst(Verdict::Diverging) {
        return format!("NOT CONVERGED: the residuals of step {} do not fall.\n", history.step);
    }
    for verdict in [Verdict::Linear, Verdict::Superlinear] {
        let Some(History { step, exponent, ratio, .. }) = worst(verdict) else { continue };
        return format!(
            "NOT QUADRATIC: exponent {:.2} in step {step}, where Newton's method has 2; the residual falls to {} of itself in an iteration. \
             The tangent is not the derivative of the residual: a part is left out, such as the geometric stiffness, or it is that of \
             another law, or kept from an earlier iteration. `mms diagnose NAME --tangent FILE` names the mistake by values of dP/dF.\n",
            exponent.unwrap_or(f64::NAN),
            ratio.map_or_else(|| "-".into(), |ratio| rounded(ratio, 2)),
        );
    }
    match passed {
        true => "Quadratic: the tangent is the derivative of the residual.\n".into(),
        false => "NOT TOLD: an exponent takes three residuals above rounding after the first iteration. Take larger load steps, a smaller \
                  tolerance, and a law that is not linear.\n"
            .into(),
    }
}
