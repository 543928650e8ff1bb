//! `mms check --thorough`: how large are the rounding errors of the field code?

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, anyhow, bail};
use mmsmith_oracle::{Accuracy, Class, ClassAccuracy, Judged, LARGEST_FACTOR};
use mmsmith_solutions::build;
use mmsmith_spec::Spec;
use serde_json::{Value, json};

use crate::arguments::CheckOptions;
use crate::json::Output;
use crate::library::{locate, names};
use crate::progress::Bar;
use crate::table::Table;
use crate::terminal;

/// Points in each class where the caller does not say.
const POINTS: usize = 10_000;
/// Points between two moves of the bar.
const STRIDE: usize = 16;

pub(crate) fn thorough(options: &CheckOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let points = options.points.unwrap_or(POINTS);
    let names = if options.solutions.is_empty() { names() } else { options.solutions.clone() };
    if names.is_empty() {
        bail!("there is no solution to check");
    }
    // All names are judged before the first check.
    let specs = names
        .iter()
        .map(|name| {
            let origin = locate(name)?;
            Ok((name.as_str(), origin.specification()?, origin.is_generated()))
        })
        .collect::<Result<Vec<(&str, Spec, bool)>>>()?;
    let mut results = Vec::new();
    let mut passed = true;
    for (name, spec, is_generated) in &specs {
        let fields = spec.derive().with_context(|| (*name).to_owned())?;
        let accuracy = Accuracy::new(spec, fields);
        let classes = measure(name, *is_generated, spec, &accuracy, points)?;
        let good = classes.iter().flat_map(|c| &c.worst).all(|w| w.factor <= LARGEST_FACTOR);
        terminal::say(&text(&spec.name, good, &accuracy, &classes))?;
        passed &= good;
        results.push(json!({
            "solution": spec.name,
            "code": if *is_generated { "generated" } else { "interpreted" },
            "points": classes.iter().map(|c| (c.class.name(), c.points)).collect::<BTreeMap<_, _>>(),
            "remarks": classes
                .iter()
                .filter_map(|c| Some((c.class.name(), c.remark?)))
                .collect::<BTreeMap<_, _>>(),
            "accuracy": rows(&spec.name, &accuracy, &classes),
            "passed": good,
        }));
    }
    terminal::say(&format!(
        "K is the least factor in |result - exact| <= K 2^-53 (sens + |exact|), sens the sum of |q dy/dq| over all inputs q. \
         Allowed: {LARGEST_FACTOR}.\n"
    ))?;
    if let Some(output) = output {
        output.write(&json!({
            "schema": "mmsmith.check/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solutions": names,
                "thorough": true,
                "points": points,
                "largest_factor": LARGEST_FACTOR,
            },
            "results": results,
            "passed": passed,
        }))?;
    }
    Ok(passed)
}

/// Every class in turn: the generated functions of a solution of the library, the interpreted programs of a file.
fn measure(
    name: &str,
    is_generated: bool,
    spec: &Spec,
    accuracy: &Accuracy<'_>,
    points: usize,
) -> Result<Vec<ClassAccuracy>> {
    let n = accuracy.dimension();
    let programs = if is_generated { Vec::new() } else { accuracy.programs() };
    let judged = |inputs: &[f64]| -> Result<Judged, String> {
        if !programs.is_empty() {
            return Ok(programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs))).collect());
        }
        let solution = build::<f64>(name, &inputs[n + 1..])
            .ok_or_else(|| format!("there is no solution '{name}'"))?
            .map_err(|error| error.to_string())?;
        solution
            .each_field(&inputs[..n], inputs[n])
            .ok_or_else(|| format!("the solution '{name}' does not have {n} dimensions"))
    };
    let bar = Bar::new(&spec.name);
    Class::ALL
        .into_iter()
        .map(|class| {
            let done = AtomicUsize::new(0);
            let step = || {
                let step = 1 + done.fetch_add(1, Ordering::Relaxed);
                if step.is_multiple_of(STRIDE) {
                    let what = || format!("{}, {}", spec.name, class.name());
                    bar.show_share(what, step as f64 / points as f64);
                }
            };
            accuracy
                .measure(class, points, &judged, &step)
                .map_err(|error| anyhow!("{}: {}: {error}", spec.name, class.name()))
        })
        .collect()
}

fn text(name: &str, passed: bool, accuracy: &Accuracy<'_>, classes: &[ClassAccuracy]) -> String {
    let verdict = if passed { "passed" } else { "FAILED" };
    let mut text = format!("{name}: {verdict}\n");
    let letters: Vec<&str> = classes
        .iter()
        .max_by_key(|c| c.worst.len())
        .map(|c| c.worst.iter().map(|w| w.field).collect())
        .unwrap_or_default();
    let mut table = Table::new(1, ["class", "points"].into_iter().chain(letters));
    for class in classes {
        let factors = class.worst.iter().map(|worst| factor(worst.factor));
        let row = [class.class.name().to_owned(), class.points.to_string()];
        table.row(row.into_iter().chain(factors));
    }
    text += &table.text();
    for class in classes {
        if let Some(remark) = class.remark {
            text += &format!("  {}: {remark}\n", class.class.name());
        }
    }
    let all = classes.iter().flat_map(|class| class.worst.iter().map(move |worst| (class, worst)));
    let worst = all.clone().max_by(|a, b| a.1.factor.total_cmp(&b.1.factor));
    let beyond = all.filter(|(_, worst)| worst.factor > LARGEST_FACTOR);
    for (class, worst) in worst.into_iter().filter(|w| w.1.factor <= LARGEST_FACTOR).chain(beyond) {
        text += &format!(
            "  worst, {}: {}[{}] = {:?} has K = {:.3}, exact {}, at {}\n",
            class.class.name(),
            worst.field,
            worst.entry,
            worst.result,
            worst.factor,
            worst.exact,
            accuracy.place(&worst.inputs)
        );
    }
    text.push('\n');
    text
}

fn factor(K: f64) -> String {
    if K < 1e4 { format!("{K:.2}") } else { format!("{K:.1e}") }
}

fn rows(solution: &str, accuracy: &Accuracy<'_>, classes: &[ClassAccuracy]) -> Vec<Value> {
    let n = accuracy.dimension();
    let names = accuracy.input_names();
    let mut rows = Vec::new();
    for class in classes {
        for worst in &class.worst {
            let parameters: BTreeMap<&str, f64> =
                names[n + 1..].iter().copied().zip(worst.inputs[n + 1..].iter().copied()).collect();
            rows.push(json!({
                "solution": solution,
                "class": class.class.name(),
                "field": worst.field,
                "entry": worst.entry,
                "K": worst.factor,
                "worst": {
                    "X": worst.inputs[..n],
                    "t": worst.inputs[n],
                    "par": parameters,
                    "result": worst.result,
                    "exact": worst.exact,
                    "sens": worst.sensitivity,
                },
            }));
        }
    }
    rows
}
