//! `mms diagnose`: which mistake a solver makes, found by fields that have the opposite mistake.

mod runs;
mod search;
mod tangent;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use mmsmith_codegen::{CAUSES, Cause, Origin, Unused};
use mmsmith_solutions::AnySolution;
use mmsmith_spec::Condition;
use mmsmith_verify::{Norm, Quantity, TANGENT_MISTAKES, TangentMistake};
use serde_json::{Value, json};

use super::growth::Warnings;
use crate::arguments::DiagnoseOptions;
use crate::expect;
use crate::input;
use crate::json::Output;
use crate::library::{Selection, locate};
use crate::number;
use crate::processes::with_threads;
use crate::table::{self, Table};
use crate::terminal;
use runs::{Errors, Run, Solver, written_step};
use search::{Expected, NO_RESULT, NO_TIME, Search, Tried};

/// Densities that cannot be told from a factor of another origin, and one that can.
const LIKE_FACTORS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
const TELLING: f64 = 3.0;

pub(crate) fn diagnose(options: &DiagnoseOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    if options.list {
        return list(output);
    }
    if let (Some(name), Some(file)) = (&options.name, &options.tangent) {
        return tangent::judge(name, file, &options.parameters.set, output);
    }
    let (Some(name), Some(target), Some(run)) = (&options.name, options.target, &options.run)
    else {
        bail!("a solution, --target and --run are needed, or --list");
    };
    refuse(options)?;
    let expected = expected(options)?;
    let temporary = tempfile::tempdir().context("a folder for the runs")?;
    let folder = options.out.clone().unwrap_or_else(|| temporary.path().to_owned());
    let until = Instant::now() + Duration::from_secs_f64(options.seconds);
    let found = locate(name)?;
    let solver = |more: &[(String, f64)], part: &str| -> Result<Solver<'_>> {
        let is_replaced = |name: &str| more.iter().any(|(own, _)| own == name);
        let asked = options.parameters.set.iter().filter(|(name, _)| !is_replaced(name));
        let set: Vec<_> = asked.chain(more).cloned().collect();
        let selection = Selection::new(name, &set)?;
        let mut spec = found.specification()?;
        for parameter in &mut spec.parameters {
            if let Some(value) = selection.parameters().get(&parameter.name) {
                parameter.default = *value;
            }
        }
        Ok(Solver {
            spec,
            exact: selection.build()?,
            target,
            origin: Origin { command: "mms diagnose".into(), file: found.shown_file() },
            build: options.build.as_deref(),
            run,
            folder: fresh(&folder.join(part))?,
            until,
            norms: expected.norms.clone(),
            dt: options.cells.iter().copied().zip(options.dt.iter().copied()).collect(),
        })
    };
    let work = || {
        let mut told = examine(solver(&[], "given")?, &solver, options, &expected)?;
        let selection = Selection::new(name, &options.parameters.set)?;
        let warnings = Warnings::until(&selection, &selection.build()?, 1.0).without_locking();
        told.notes.extend(warnings.text().lines().map(|line| line.trim().to_owned()));
        terminal::say(&told.text(options))?;
        if let Some(output) = output {
            output.write(&told.document(name, options))?;
        }
        Ok(told.passed)
    };
    with_threads(Some(options.jobs), work)
}

/// Refuses options that do not fit each other.
fn refuse(options: &DiagnoseOptions) -> Result<()> {
    if options.cells.len() < 2 || options.cells.windows(2).any(|pair| pair[0] >= pair[1]) {
        bail!(
            "--cells: an order takes two grids or more, the coarsest first, such as --cells 8,16"
        );
    }
    if !options.dt.is_empty() && options.dt.len() != options.cells.len() {
        bail!("--dt has {} value(s) for {} grids", options.dt.len(), options.cells.len());
    }
    Ok(())
}

fn expected(options: &DiagnoseOptions) -> Result<Expected> {
    let mut expected =
        Expected { orders: BTreeMap::new(), norms: BTreeMap::new(), tolerance: options.tolerance };
    for (field, orders) in expect::of_recordings(&options.expect)? {
        let given = orders.iter().filter_map(|(norm, order)| Some((norm, (*order)?)));
        let given: Vec<(Norm, f64)> = given.collect();
        let Some(&(norm, order)) = given.first() else { continue };
        if given.iter().any(|(_, other)| *other != order) {
            bail!(
                "--expect: the search looks at one norm of {field}; give one order, as {field}={order} or {field}.l2={order}"
            );
        }
        expected.orders.insert(field, order);
        expected.norms.insert(field, norm);
    }
    Ok(expected)
}

/// An empty folder. Fields of an earlier search would be taken for those of this one.
fn fresh(folder: &PathBuf) -> Result<PathBuf> {
    if input::kind_of(folder).context("--out")?.is_some() {
        bail!("--out: {} is there already; name another folder", folder.display());
    }
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    // Commands may change to another folder.
    fs::canonicalize(folder).with_context(|| folder.display().to_string())
}

/// The mistakes as a table or as JSON.
fn list(output: Option<Output>) -> Result<bool> {
    let mut text = String::new();
    for cause in CAUSES {
        text += &format!("{}: {}.\n  Look at {}.\n", cause.name, cause.mistake, cause.look);
    }
    text += "in tangents, by --tangent:\n";
    for TangentMistake { name, mistake, write, .. } in TANGENT_MISTAKES {
        text += &format!("{name}: {mistake}.\n  Write {write}.\n");
    }
    terminal::say(&text)?;
    if let Some(output) = output {
        let row = |cause: &Cause| json!({"name": cause.name, "mistake": cause.mistake, "look": cause.look});
        output.write(&json!({
            "schema": "mmsmith.causes/1",
            "causes": CAUSES.iter().map(row).collect::<Vec<_>>(),
            "tangents": TANGENT_MISTAKES.iter().map(tangent::of_mistake).collect::<Vec<_>>(),
        }))?;
    }
    Ok(true)
}

/// A mistake that explains the errors.
struct Named {
    cause: &'static Cause,
    /// With its opposite in the fields; none where it was found without.
    errors: Option<BTreeMap<usize, Errors>>,
    /// A time that was fitted, on the coarsest grid.
    shift: Option<f64>,
}

/// Result of the diagnosis.
struct Told {
    passed: bool,
    right: BTreeMap<usize, Errors>,
    causes: Vec<Named>,
    tried: Vec<(&'static str, f64)>,
    not_tried: BTreeMap<&'static str, String>,
    notes: Vec<String>,
    field: Quantity,
    /// The norm by which its errors are told.
    norm: Norm,
}

/// Runs the solver with the right fields on all grids, and learns its time steps where it tells them.
fn with_right_fields(solver: &mut Solver<'_>, cells: &[usize]) -> Result<Vec<Run>> {
    let runs: Vec<Run> =
        cells.iter().map(|&cells| solver.errors(None, cells)).collect::<Result<_>>()?;
    for (&cells, run) in cells.iter().zip(&runs) {
        if let Some(dt) = written_step(run) {
            solver.dt.entry(cells).or_insert(dt);
        }
    }
    Ok(runs)
}

fn by_cells(cells: &[usize], runs: &[Run]) -> BTreeMap<usize, Errors> {
    cells.iter().copied().zip(runs.iter().map(|run| run.errors.clone())).collect()
}

/// The solver with another density, where the one it has hides a mistake.
fn seeing<'a>(
    solver: &Solver<'a>,
    other: &impl Fn(&[(String, f64)], &str) -> Result<Solver<'a>>,
) -> Result<Option<Solver<'a>>> {
    let density = match &solver.exact {
        AnySolution::One(solution) => solution.density(),
        AnySolution::Two(solution) => solution.density(),
        AnySolution::Three(solution) => solution.density(),
        _ => f64::NAN,
    };
    let has = |parameter: &mmsmith_spec::Parameter| {
        parameter.name == "rho0" && parameter.default == density
    };
    if !LIKE_FACTORS.contains(&density) || !solver.spec.parameters.iter().any(has) {
        return Ok(None);
    }
    other(&[("rho0".to_owned(), TELLING)], "density").map(Some)
}

fn examine<'a>(
    mut given: Solver<'a>,
    other: &impl Fn(&[(String, f64)], &str) -> Result<Solver<'a>>,
    options: &DiagnoseOptions,
    expected: &Expected,
) -> Result<Told> {
    let cells = &options.cells[..];
    let runs = with_right_fields(&mut given, cells)?;
    if let Some(failure) = runs.iter().find_map(|run| run.failure.as_ref())
        && runs.iter().all(|run| run.failure.is_some())
    {
        bail!("--run: with the right fields no run left a result: {failure}");
    }
    let mut right = by_cells(cells, &runs);
    let recorded = |field: &Quantity| right.values().any(|errors| errors.contains_key(field));
    if let Some(field) = expected.orders.keys().find(|field| !recorded(field)) {
        let names: BTreeSet<String> =
            right.values().flat_map(|errors| errors.keys()).map(Quantity::to_string).collect();
        let names: Vec<String> = names.into_iter().collect();
        bail!("--expect: the recordings have no {field}; they have {}", names.join(", "));
    }
    let mut passed = expected.is_met(&right, 0.0);
    let mut notes = vec![];
    let mut runs = runs;
    let field = expected.orders.keys().next().copied().unwrap_or(Quantity::Displacement);
    if let Some(mut seeing) = seeing(&given, other)? {
        // Time steps that are told belong to the density that is given.
        let is_told = !options.dt.is_empty();
        if is_told {
            seeing.dt.clear();
        }
        let of_seeing = with_right_fields(&mut seeing, cells)?;
        let errors = by_cells(cells, &of_seeing);
        if !expected.is_met(&errors, 0.0) && (passed || !is_told) {
            notes.push(match passed {
                true => "the errors fall with the parameters given, but not with rho0 = 3: a density of 1 hides a force per volume".into(),
                false => "mistakes were looked for with rho0 = 3, which no factor of weights looks like".to_owned(),
            });
            if passed {
                right = errors;
            }
            passed = false;
            (given, runs) = (seeing, of_seeing);
        } else if passed {
            notes.push("also with rho0 = 3".into());
        }
    }
    let mut told = Told {
        passed,
        right,
        causes: vec![],
        tried: vec![],
        not_tried: BTreeMap::new(),
        notes,
        field,
        norm: expected.norms.get(&field).copied().unwrap_or(Norm::Linf),
    };
    if !passed {
        told.search(&given, &runs, options, expected)?;
    }
    Ok(told)
}

impl Told {
    fn search(
        &mut self,
        solver: &Solver<'_>,
        runs: &[Run],
        options: &DiagnoseOptions,
        expected: &Expected,
    ) -> Result<()> {
        let right = &runs[0];
        let search = Search {
            solver,
            expected,
            cells: &options.cells,
            order: self.order(),
            right: Mutex::new(by_cells(&options.cells, runs)),
            not_tried: Mutex::default(),
        };
        // No solver is right that does without the body force, or without the motion of all its surfaces: other mistakes need not be tried.
        let is_moved =
            solver.spec.boundaries.iter().all(|one| one.condition == Condition::PrescribedMotion);
        let is_needed = |unused| match unused {
            Unused::Force | Unused::ForceComponent | Unused::ForceLater => true,
            Unused::Boundary => is_moved,
            _ => false,
        };
        let ignored = search.unused(right, is_needed)?;
        if search.takes_no_field(right, &ignored)? {
            self.notes.push(
                "no field has an effect, neither the body force nor the start: the program takes another copy of the file, such as one that is found \
                 before the one in {fields}; build and run it with the folder {fields} alone"
                    .into(),
            );
            return Ok(());
        }
        let tried = if ignored.is_empty() { search.single(right)? } else { vec![] };
        let with_right = search.right.lock().map(|right| right.clone()).unwrap_or_default();
        if with_right.len() > options.cells.len() && expected.is_met(&with_right, 0.0) {
            let cells: Vec<String> = with_right.keys().map(usize::to_string).collect();
            self.notes.push(format!(
                "the errors fall as expected on a finer grid, so that nothing is wrong; --cells {} shows it",
                cells.join(",")
            ));
            (self.passed, self.right) = (true, with_right);
            return Ok(());
        }
        for one in tried {
            let is_named = search.explains(&one);
            let Tried { trial, errors } = one;
            let order = Expected::order(&errors, self.field);
            self.tried.push((trial.cause.name, order));
            if is_named {
                let shift = trial.fitted.map(|dt_over_h| dt_over_h * solver.h(options.cells[0]));
                self.causes.push(Named { cause: trial.cause, errors: Some(errors), shift });
            }
        }
        if self.causes.is_empty() {
            let unused = match ignored.is_empty() {
                true => search.unused(right, |unused| !is_needed(unused))?,
                false => ignored,
            };
            self.causes.extend(unused.into_iter().map(|cause| Named {
                cause,
                errors: None,
                shift: None,
            }));
        }
        self.not_tried = search.not_tried.into_inner().unwrap_or_default();
        let is_finite =
            |errors: &Errors| errors.get(&self.field).is_some_and(|error| error.is_finite());
        if self.causes.is_empty() && !self.right.values().any(is_finite) {
            self.notes.push(format!(
                "the errors of {} are no finite numbers on any grid: mms score tells where the results are none",
                self.field
            ));
        }
        let late = self.not_tried.values().filter(|why| *why == NO_TIME).count();
        if self.causes.is_empty() {
            // The reason that kept most mistakes from being tried.
            let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
            for why in self.not_tried.values() {
                *reasons.entry(why).or_default() += 1;
            }
            let most = reasons.iter().max_by_key(|(_, count)| **count);
            self.notes.push(match (late, most) {
                (0, Some((why, count))) if *count > self.tried.len() => format!(
                    "none of the {} mistakes that were tried explains it; {} were not tried, {count} of them since {why}",
                    self.tried.len(),
                    self.not_tried.len()
                ),
                (0, _) => "no single mistake of the list explains it: perhaps there are two at once, or it is not in the list (mms diagnose --list)".into(),
                (late, _) => format!(
                    "the time was up before {late} mistakes were tried, and none of the {} others explains it: give more with --seconds",
                    self.tried.len()
                ),
            });
        }
        Ok(())
    }

    fn order(&self) -> f64 {
        Expected::order(&self.right, self.field)
    }

    fn text(&self, options: &DiagnoseOptions) -> String {
        let mut table = Table::new(0, ["cells", "error", "rate"]);
        let mut coarser: BTreeMap<usize, Errors> = BTreeMap::new();
        for (cells, errors) in &self.right {
            coarser.insert(*cells, errors.clone());
            let error = errors.get(&self.field).copied().unwrap_or(f64::INFINITY);
            let order =
                Some(Expected::order(&coarser, self.field)).filter(|order| order.is_finite());
            table.row([cells.to_string(), table::error(error), table::rate(order)]);
        }
        let norm = match self.norm {
            Norm::Linf => "largest error".to_owned(),
            norm => format!("error ({norm})"),
        };
        let mut text =
            format!("{norm} of {} with the right fields\n{}\n", self.field, table.text());
        if self.passed {
            text += "nothing is wrong: the errors fall as expected\n";
        }
        for (index, Named { cause, errors, shift }) in self.causes.iter().take(4).enumerate() {
            text += &format!(
                "{}{}: {}\n",
                if index > 0 { "or " } else { "" },
                cause.name,
                cause.mistake
            );
            text += &format!("  look at {}\n", cause.look);
            if let Some(errors) = errors {
                let order = Expected::order(errors, self.field);
                text += &format!(
                    "  order {:.2} with the right fields, {order:.2} with the opposite mistake in the fields\n",
                    self.order()
                );
            }
            if let Some(shift) = shift {
                text += &format!(
                    "  by {} on {} cells: is that the time step, or half of it?\n",
                    number::rounded(*shift, 3),
                    options.cells[0]
                );
            }
        }
        for note in &self.notes {
            text += &format!("note: {note}\n");
        }
        for (name, why) in self.not_tried.iter().filter(|(_, why)| why.starts_with(NO_RESULT)) {
            text += &format!("{name}: {why}\n");
        }
        if !self.tried.is_empty() {
            text += &format!(
                "{} mistakes were tried, {} were not\n",
                self.tried.len(),
                self.not_tried.len()
            );
        }
        text
    }

    fn document(&self, name: &str, options: &DiagnoseOptions) -> Value {
        let finite = |order: f64| order.is_finite().then_some(order);
        let named = |errors: &Errors| -> BTreeMap<String, f64> {
            errors.iter().map(|(field, error)| (field.to_string(), *error)).collect()
        };
        let grids = |errors: &BTreeMap<usize, Errors>| -> Value {
            errors
                .iter()
                .map(|(cells, errors)| json!({"cells": cells, "errors": named(errors)}))
                .collect()
        };
        let cause = |Named { cause, errors, shift }: &Named| {
            json!({
                "name": cause.name,
                "mistake": cause.mistake,
                "look": cause.look,
                "order": errors.as_ref().and_then(|errors| finite(Expected::order(errors, self.field))),
                "rows": errors.as_ref().map(grids),
                "shift": shift,
            })
        };
        let tried: BTreeMap<_, _> =
            self.tried.iter().map(|(name, order)| (name, finite(*order))).collect();
        json!({
            "schema": "mmsmith.diagnose/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solution": name,
                "target": options.target.map(|host| host.name),
                "run": options.run,
                "cells": options.cells,
                "expect": options.expect,
                "tolerance": options.tolerance,
                "dt": options.dt,
            },
            "passed": self.passed,
            "order": finite(self.order()),
            "rows": grids(&self.right),
            "causes": self.causes.iter().map(cause).collect::<Vec<_>>(),
            "tried": tried,
            "not_tried": self.not_tried,
            "notes": self.notes,
        })
    }
}
