//! `cargo xtask ablation`: each rule of the derivation off, over the specifications of the repository.

use crate::{docs, read, write};
use anyhow::{Context, bail};
use mmsmith_codegen::{Code, Host, Origin};
use mmsmith_expr::Rule;
use mmsmith_expr::rules::{Row, Serves};
use mmsmith_oracle::{Effect, LARGEST_FACTOR, Mark, ablated};
use mmsmith_spec::{Fields, Spec};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Specifications whose digits the book promises.
const FOLDERS: [&str; 5] = [
    "mms-specs",
    "tests/data/specs",
    "tests/data/specs/attack",
    "tests/data/specs/digits",
    "tests/data/specs/materials",
];
/// Points that are drawn in each class.
const POINTS: u64 = 100;
/// A rule that serves work saves this much of it at least.
const MORE_WORK: f64 = 1.25;
/// Forms without a rule nest deeply.
const STACK: usize = 1 << 28;
const PAGE: &str = "docs/src/results/ablation.md";
/// Headings that the table stands between.
const BEGIN: &str = "## The rules\n";
const END: &str = "## Rules that are gone\n";

/// One specification with all rules and without each.
struct Ablated {
    name: String,
    marks: Vec<Mark>,
    effects: Vec<Option<Effect>>,
}

/// Measures every rule, holds its row against what is lost, and writes the table into the book unless it is to be `check`ed alone.
///
/// Lines for people, and whether a row is at fault.
pub(crate) fn run(repository: &Path, check: bool) -> anyhow::Result<(Vec<String>, bool)> {
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK).build()?;
    let all = pool.install(|| {
        let paths = specifications(repository)?;
        paths.par_iter().map(|path| ablate(path)).collect::<anyhow::Result<Vec<Ablated>>>()
    })?;
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for (place, row) in Rule::ALL.iter().enumerate() {
        let effects = all.iter().filter_map(|one| Some((one, one.effects[place].as_ref()?)));
        let effects: Vec<(&Ablated, &Effect)> = effects.collect();
        let mut victims: Vec<(&str, &Effect)> = effects
            .iter()
            .filter(|(_, effect)| is_lost(row, effect))
            .map(|(one, effect)| (one.name.as_str(), *effect))
            .collect();
        victims.sort_by_key(|(name, _)| *name);
        let names: Vec<&str> = victims.iter().map(|(name, _)| *name).collect();
        if names.is_empty() {
            faults.push(format!("{}: nothing is lost without it: delete the rule", row.name));
        } else if names != row.needed_by {
            faults.push(format!("{}: needed_by has to be {names:?}", row.name));
        }
        let lines: i64 = effects.iter().map(|(_, effect)| effect.lines).sum();
        rows.push(format!(
            "| {} | `{}` | `{}` | {} | {} | {} | {lines:+} | {} |",
            row.name,
            // A bar would end the cell.
            row.before.replace('|', "\\|"),
            row.after.replace('|', "\\|"),
            row.why,
            loss(row, &victims),
            effects.len(),
            victims.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(", ")
        ));
    }
    let table = format!(
        "{BEGIN}\n{}\n\n{} specifications, {POINTS} points in each class.\n\n| rule | before | after | why | without it | changed | lines of C | needed by |\n\
         |---|---|---|---|---|---:|---:|---|\n{}\n\n{}\n{END}",
        docs::stamp(repository)?,
        all.len(),
        rows.join("\n"),
        beyond(&all)
    );
    if !check {
        let page = read(&repository.join(PAGE))?;
        let (Some(begin), Some(end)) = (page.find(BEGIN), page.find(END)) else {
            bail!("{PAGE} has no lines '{BEGIN}' and '{END}' to write the table between");
        };
        let text = format!("{}{table}{}", &page[..begin], &page[end + END.len()..]);
        write(&repository.join(PAGE), &text)?;
    }
    let failed = !faults.is_empty();
    faults.push(format!("{} rules, {} specifications", Rule::ALL.len(), all.len()));
    Ok((faults, failed))
}

/// The files of all specifications.
fn specifications(repository: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for folder in FOLDERS {
        let context = || format!("cannot list {folder}");
        for entry in std::fs::read_dir(repository.join(folder)).with_context(context)? {
            let path = entry.with_context(context)?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                paths.push(path);
            }
        }
    }
    paths.sort();
    Ok(paths)
}

fn ablate(path: &Path) -> anyhow::Result<Ablated> {
    let lines = |spec: &Spec, fields: Fields| {
        let code = Code::of(spec, fields, Origin::library(spec));
        let text = Host::named("c").and_then(|host| host.source(&code).ok());
        text.map_or(0, |text| text.lines().count())
    };
    let (marks, effects) = ablated(&read(path)?, Rule::ALL, POINTS, &lines)
        .map_err(|error| anyhow::anyhow!("{}: {error}", path.display()))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Ablated { name, marks, effects })
}

fn is_lost(row: &Row, effect: &Effect) -> bool {
    match row.serves {
        Serves::Digits => effect.loss.is_some(),
        Serves::Work => effect.work >= MORE_WORK,
    }
}

/// The worst of what is lost without a rule.
fn loss(row: &Row, victims: &[(&str, &Effect)]) -> String {
    match row.serves {
        Serves::Digits => {
            let losses = victims.iter().filter_map(|(name, effect)| Some((name, effect.loss?)));
            let worst = losses.max_by(|a, b| a.1.without.factor.total_cmp(&b.1.without.factor));
            worst.map_or("nothing".to_owned(), |(name, loss)| {
                let Mark { class, field, factor } = loss.without;
                let factor =
                    if factor.is_finite() { format!("{factor:.1e}") } else { "no bound".into() };
                format!(
                    "`K` {factor} of `{field}`, {:.1} with it: `{name}`, {}",
                    loss.with,
                    class.name()
                )
            })
        }
        Serves::Work => {
            let worst = victims.iter().max_by(|a, b| a.1.work.total_cmp(&b.1.work));
            worst.map_or("nothing".to_owned(), |(name, effect)| {
                format!("{:.1} times the work: `{name}`", effect.work)
            })
        }
    }
}

/// The specifications that do not keep the factor of 8 with all rules.
fn beyond(all: &[Ablated]) -> String {
    let mut text = String::new();
    for Ablated { name, marks, .. } in all {
        let worst = marks.iter().max_by(|a, b| a.factor.total_cmp(&b.factor));
        if let Some(worst) = worst.filter(|worst| worst.factor > LARGEST_FACTOR) {
            let Mark { class, field, factor } = worst;
            text += &format!("- `{name}`: `K` {factor:.1e} of `{field}`, {}\n", class.name());
        }
    }
    match text.is_empty() {
        true => "With all rules each of them keeps the factor of 8.\n".to_owned(),
        false => {
            format!("With all rules these do not keep the factor of 8 at some point:\n\n{text}")
        }
    }
}
