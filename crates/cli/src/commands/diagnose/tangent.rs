//! `mms diagnose --tangent`: which mistake the tangent of another solver has, by its values at points.

use std::path::Path;

use anyhow::{Context, Result, bail};
use csv::{ReaderBuilder, Trim};
use mmsmith_verify::{JudgedTangent, TangentMistake, TangentSample, judge_tangent};
use serde_json::{Value, json};

use super::super::eval::points;
use crate::input::Source;
use crate::json::Output;
use crate::library::Selection;
use crate::number::{counted, rounded};
use crate::table::Table;
use crate::terminal;

/// More bytes of tangents than anyone reads.
const LONGEST: u64 = 1 << 28;
/// So many wrong entries are shown.
const MOST_SHOWN: usize = 6;
/// So many causes are shown.
const MOST_NAMED: usize = 4;

/// A mistake as JSON.
pub(super) fn of_mistake(mistake: &TangentMistake) -> Value {
    let TangentMistake { name, mistake, write, .. } = mistake;
    json!({ "name": name, "mistake": mistake, "write": write })
}

/// Whether the tangent in a file is that of the solver's law.
pub(super) fn judge(
    name: &str,
    path: &Path,
    set: &[(String, f64)],
    output: Option<Output>,
) -> Result<bool> {
    let file = Source::of(path);
    if file == Source::Standard {
        bail!("--tangent -: the columns are read one after another; name a file");
    }
    let selection = Selection::new(name, set)?;
    let solution = selection.build_for_hosts()?;
    let places = points::read(file, &selection, selection.is_axisymmetric(&solution))?;
    let text = file.short_text(LONGEST)?;
    let dimension = places.first().map_or(0, |point| point.X.len());
    if dimension == 0 {
        bail!("{file}: it has no row");
    }
    let matrices = matrices(&text, dimension, name).with_context(|| file.to_string())?;
    let both = places.into_iter().zip(matrices);
    let samples: Vec<_> =
        both.map(|(point, (F, dPdF))| TangentSample { X: point.X, t: point.t, F, dPdF }).collect();
    let judged = judge_tangent(&solution, &samples).with_context(|| file.to_string())?;
    terminal::say(&told(&judged, &samples))?;
    if let Some(output) = output {
        let causes = judged.named.iter().map(|own| {
            let mut cause = of_mistake(own.mistake);
            cause["error"] = json!(own.error);
            cause["fitted"] = json!(own.fitted);
            cause
        });
        output.write(&json!({
            "schema": "mmsmith.tangent/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solution": selection.name(),
                "parameters": selection.parameters(),
                "file": path.display().to_string(),
            },
            "points": samples.len(),
            "passed": judged.passed,
            "error": judged.error,
            "entries": judged.entries,
            "causes": causes.collect::<Vec<_>>(),
            "unseen": judged.unseen.iter().map(|mistake| mistake.name).collect::<Vec<_>>(),
        }))?;
    }
    Ok(judged.passed)
}

/// A deformation gradient, where the file has it, and a tangent.
type Matrices = (Option<Vec<f64>>, Vec<f64>);

/// The columns of each row of a table.
fn matrices(text: &str, dimension: usize, name: &str) -> Result<Vec<Matrices>> {
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().context("it has no line of column names")?.clone();
    let column = |name: &str| {
        header.iter().position(|own| own.eq_ignore_ascii_case(name)).ok_or(name.to_owned())
    };
    let pairs: Vec<String> = (0..dimension * dimension)
        .map(|n| format!("{}{}", n / dimension + 1, n % dimension + 1))
        .collect();
    let names = pairs.iter().flat_map(|P| pairs.iter().map(move |F| format!("dP{P}dF{F}")));
    let tangent: Result<Vec<usize>, String> = names.map(|name| column(&name)).collect();
    let tangent = tangent.map_err(|missing| {
        anyhow::anyhow!(
            "there is no column {missing}; `mms eval {name} --points POINTS --tangent --csv FILE` writes a file with all of them, and \
             the right values"
        )
    })?;
    let of_F: Vec<_> = pairs.iter().map(|pair| column(&format!("F{pair}"))).collect();
    let missing = of_F.iter().find_map(|column| column.as_ref().err());
    let of_F: Option<Vec<usize>> = match missing {
        Some(_) if of_F.iter().all(Result::is_err) => None,
        Some(missing) => bail!("there is no column {missing}, and other columns of F are there"),
        None => Some(of_F.into_iter().flatten().collect()),
    };
    let rows = reader.records().enumerate();
    rows.map(|(index, row)| {
        let row = row.with_context(|| format!("row {}", index + 1))?;
        let number = |column: &usize| {
            let cell = row.get(*column).unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.with_context(|| {
                let name = header.get(*column).unwrap_or_default();
                format!("row {}: '{cell}' in column {name} is no finite number", index + 1)
            })
        };
        let F = of_F.as_ref().map(|columns| columns.iter().map(number).collect()).transpose()?;
        Ok((F, tangent.iter().map(number).collect::<Result<_>>()?))
    })
    .collect()
}

/// The judgement in words.
fn told(judged: &JudgedTangent, samples: &[TangentSample]) -> String {
    let points = counted(samples.len(), "point");
    if judged.passed {
        return format!(
            "The tangent is right at {points}, to {:.1e} of its size. Where Newton's method is not quadratic all the same, the mistake is \
             beside the law: a part of F-bar or of forces that follow that is not symmetric and is left out, gradients or weights that \
             the residual does not have, sides that do not move with the first iteration, or a matrix kept from an earlier one.\n{}",
            judged.error,
            unseen(judged)
        );
    }
    let mut text = format!(
        "WRONG: the tangent differs from that of the solver's law by {:.2e} of its size at {points}\n",
        judged.error
    );
    let mut table = Table::new(1, ["entry", "given", "right", "at X", "t"]);
    for wrong in judged.entries.iter().take(MOST_SHOWN) {
        let sample = &samples[wrong.point];
        let X: Vec<String> = sample.X.iter().map(|x| rounded(*x, 4)).collect();
        table.row([
            wrong.entry.clone(),
            format!("{:.6e}", wrong.given),
            format!("{:.6e}", wrong.right),
            X.join(" "),
            rounded(sample.t, 4),
        ]);
    }
    text += &table.text();
    if judged.entries.len() > MOST_SHOWN {
        text += &format!("{} more\n", counted(judged.entries.len() - MOST_SHOWN, "component"));
    }
    for (index, own) in judged.named.iter().take(MOST_NAMED).enumerate() {
        let or = if index > 0 { "or " } else { "" };
        let TangentMistake { name, mistake, write, .. } = own.mistake;
        text += &format!("{or}{name}: {mistake}\n  write {write}\n");
        if let Some(fitted) = own.fitted {
            text += &format!("  with {} it leaves {:.1e}\n", rounded(fitted, 4), own.error);
        }
    }
    if judged.named.is_empty() {
        text += "no single mistake of the list explains it: perhaps there are two at once, or it is not in the list (mms diagnose --list)\n";
    }
    text + &unseen(judged)
}

/// Mistakes that these points cannot show.
fn unseen(judged: &JudgedTangent) -> String {
    let names: Vec<&str> = judged.unseen.iter().map(|mistake| mistake.name).collect();
    match names.is_empty() {
        true => String::new(),
        false => format!("note: these points do not show {}\n", names.join(", ")),
    }
}
