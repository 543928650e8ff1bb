//! `mms tradeoff`: error against cost, and the cheapest setting for a need.

mod advice;
mod measured;
mod time;
mod words;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{
    Arithmetic, Case, CaseError, Discretized, Goal, Machine, Outputs, Plan, Record, Repeat, Row,
    Setting, Status, Tradeoff, families, list, listed, tradeoff as tradeoff_of,
};
use serde_json::{Value, json};

use self::measured::{Measure, Measured};
use self::time::Time;
use super::growth::Warnings;
use super::problem::Model;
use crate::arguments::{Precision, TradeoffOptions};
use crate::json::Output;
use crate::keep::{Found, Keep, Order, Part};
use crate::library::Selection;
use crate::progress::Bar;
use crate::report::{Asked, Form, Section};
use crate::{machine, memory, terminal};

/// The CFL number that ladders begin with.
const CFL: f64 = 0.4;
/// More threads than this are not compared with one.
const MOST_THREADS: usize = 64;
/// Runner of settings for the sweep.
struct Runner<'a> {
    exact: &'a Model,
    single: Option<&'a Model>,
    pools: BTreeMap<usize, rayon::ThreadPool>,
    time: Time,
    keep: Keep,
    selection: &'a Selection,
}

/// A run that was cut: it is no result that could be kept.
#[derive(Debug)]
struct CutShort(Row);

impl fmt::Display for CutShort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.status.fmt(f)
    }
}

impl std::error::Error for CutShort {}

impl Runner<'_> {
    fn arithmetic(&self, setting: &Setting) -> Arithmetic<'_> {
        match self.single.filter(|_| setting.single) {
            Some(single) => single.arithmetic(),
            None => Arithmetic::Double,
        }
    }

    /// The case of a setting on its grid.
    fn discretized(&self, setting: &Setting) -> Result<Discretized<'_>, CaseError> {
        Discretized::new(&self.exact.exact, self.arithmetic(setting), &setting.case)
    }

    /// Its plan, where it fits.
    fn plan(&self, setting: &Setting) -> Option<Plan> {
        Some(*self.discretized(setting).ok()?.plan())
    }

    fn pool(&self, setting: &Setting) -> Result<&rayon::ThreadPool> {
        self.pools.get(&setting.threads).context("no threads were started for this setting")
    }

    /// Key of a setting's case.
    fn key(&self, setting: &Setting) -> Value {
        let mut key = words::document(setting);
        // Times are part of this result, and so are the threads.
        key["timed_with_threads"] = setting.threads.into();
        key["tradeoff"] = json!({
            "solution": self.selection.name(),
            "parameters": self.selection.parameters(),
            "cells": setting.case.cells,
            "cfl": setting.case.cfl,
            "periods": setting.case.periods,
        });
        key
    }

    fn run(&self, setting: &Setting, most_s: f64) -> Result<Option<Row>> {
        let until = self.time.until(most_s);
        let compute = |_: usize| -> Result<Record> {
            let mut row = self.pool(setting)?.install(|| {
                let silent = &mut |_| ();
                let mut outputs = Outputs { until, ..Outputs::new(silent) };
                self.discretized(setting)?.run(&mut outputs)
            })?;
            if matches!(row.status, Status::Cut { .. }) {
                return Err(CutShort(row).into());
            }
            self.time.ran(setting, &mut row);
            Ok(Record::from(&row))
        };
        let mark = |record: &mut Record| record.timed_alone = false;
        match self.keep.all(&[self.key(setting)], &[true], Order::OneByOne, mark, compute) {
            Ok(Found::All(records)) => Ok(records.into_iter().next().map(Row::from)),
            Ok(Found::Part(_)) => Ok(None),
            Err(error) => match error.downcast::<CutShort>() {
                Ok(CutShort(row)) => Ok(Some(row)),
                // Such as a mass matrix that too few particles make singular.
                Err(error) => match error.downcast::<CaseError>() {
                    Ok(CaseError::Setup(_)) => Ok(None),
                    Ok(other) => Err(other.into()),
                    Err(other) => Err(other),
                },
            },
        }
    }

    fn repeat(&self, setting: &Setting, most_s: f64) -> Result<Option<Repeat>> {
        if let Some(repeat) = self.time.repeated(setting) {
            return Ok(Some(repeat));
        }
        let until = self.time.until(most_s);
        let timing = self
            .pool(setting)?
            .install(|| self.discretized(setting)?.time_steps(u64::MAX, until))?;
        let repeat = Repeat { wall_s: timing.wall_s, cpu_s: timing.cpu_s };
        Ok(timing.complete.then_some(repeat))
    }
}

pub(crate) fn tradeoff(options: &TradeoffOptions) -> Result<bool> {
    let outputs = files(options).prepare()?;
    let advice = Output::prepare_if(options.advice.as_ref())?;
    let found = match sweep(options, &Bar::new("planning"))? {
        Swept::All(found) => found,
        Swept::Part(part) => return terminal::say(&part.to_string()).map(|()| true),
    };
    let mut report = found.report()?;
    let exact = found.selection.build()?;
    let warnings = Warnings::until(&found.selection, &exact, options.periods);
    warnings.insert(&mut report.results);
    report.sections.push(Section::Note(warnings.text()));
    let holds = report.publish(outputs)?;
    if let Some(file) = advice {
        file.write_text(&found.advice())?;
    }
    Ok(holds)
}

/// The files that a report is asked for in.
fn files(options: &TradeoffOptions) -> Asked<'_> {
    let TradeoffOptions { json, csv, plot, .. } = options;
    Asked(vec![(Form::Json, json), (Form::Csv, csv), (Form::Plot, plot)])
}

/// Everything that was measured, or a shard's part of it.
pub(super) enum Swept<T> {
    All(T),
    Part(Part),
}

/// Measures what was asked for.
pub(super) fn sweep<'a>(options: &'a TradeoffOptions, bar: &Bar) -> Result<Swept<Measured<'a>>> {
    sweep_in(options, Time::Real(Instant::now()), bar)
}

fn sweep_in<'a>(
    options: &'a TradeoffOptions,
    time: Time,
    bar: &Bar,
) -> Result<Swept<Measured<'a>>> {
    let listed = options.cases();
    if let (Some(shard), None) = (options.kept.shard, &listed) {
        bail!(
            "--shard {shard}: a sweep within a budget chooses its cases as it goes; state them, as in --cells 16,32,64 --shard {shard}"
        );
    }
    let selection = Selection::new(&options.name, &options.parameters.set)?;
    let exact = Model::new(&selection, Precision::F64)?;
    // What is interpreted has double precision only.
    let single = Model::new(&selection, Precision::F32).ok();
    let threads = options.threads.unwrap_or(1);
    let more = machine::cores().min(MOST_THREADS);
    let is_compared = options.threads.is_none() && listed.is_none();
    let more = (more > threads && is_compared).then_some(more);
    let mut outputs = files(options).options();
    outputs.extend([
        ("--advice", options.advice.is_some()),
        ("--tolerance", options.tolerance.is_some()),
        ("--time", options.time.is_some()),
    ]);
    let keep = Keep::open(&options.kept, &options.name, &outputs)?;
    let runner = Runner {
        exact: &exact,
        single: single.as_ref(),
        pools: pools(threads, more)?,
        time,
        keep,
        selection: &selection,
    };
    let case = Case { cfl: CFL, periods: options.periods, ..Case::default() };
    let base = Setting { case, single: false, threads };
    let tried = families(&base, more, single.is_some(), &|setting| runner.plan(setting));
    if tried.is_empty() {
        // The reason why even the usual scheme cannot be run.
        exact.discretized(&case)?;
        bail!("no scheme of the solver fits {}", selection.name());
    }
    let compared = Measure::new(options, &selection);
    let goal = Goal {
        budget_s: options.budget,
        error: &|row| compared.of(row),
        against: options.against,
        tolerance: options.tolerance,
        time_s: options.time,
        most_bytes: memory::available(),
    };
    let found = match &listed {
        None => runner.within_budget(&tried, &goal, bar)?,
        Some(cases) => {
            let is_shard = options.kept.shard.is_some();
            match runner.listed(&tried, cases, (&goal, is_shard), bar)? {
                Swept::All(found) => found,
                Swept::Part(part) => return Ok(Swept::Part(part)),
            }
        }
    };
    let used_s = runner.time.now();
    Ok(Swept::All(Measured { options, selection, found, compared, threads, used_s }))
}

/// Pools of threads; some schemes use one thread, whatever is asked for.
fn pools(threads: usize, more: Option<usize>) -> Result<BTreeMap<usize, rayon::ThreadPool>> {
    let pool = |threads: usize| -> Result<(usize, rayon::ThreadPool)> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        Ok((threads, pool.context("--threads: cannot start the threads")?))
    };
    [1, threads].into_iter().chain(more).map(pool).collect()
}

impl Runner<'_> {
    /// Does something with the machine that runs settings.
    fn with_machine<R>(&self, work: impl FnOnce(&Machine<'_, anyhow::Error>) -> R) -> R {
        work(&Machine {
            plan: &|setting| self.plan(setting),
            run: &|setting: &Setting, most_s| self.run(setting, most_s),
            repeat: &|setting: &Setting, most_s| self.repeat(setting, most_s),
            clock: &|| self.time.now(),
        })
    }

    /// The sweep that chooses its settings as it goes.
    fn within_budget(&self, tried: &[Setting], goal: &Goal<'_>, bar: &Bar) -> Result<Tradeoff> {
        let mut show = |setting: &Setting| {
            let share = self.time.now() / goal.budget_s;
            bar.show_share(|| words::line(setting), share.min(1.0));
        };
        self.with_machine(|machine| tradeoff_of(tried, goal, machine, &mut show))
    }

    /// All schemes in the cases of a list, or a shard's part of them.
    fn listed(
        &self,
        tried: &[Setting],
        cases: &[(usize, f64)],
        (goal, is_shard): (&Goal<'_>, bool),
        bar: &Bar,
    ) -> Result<Swept<Tradeoff>> {
        let all = list(tried, cases, &|setting| self.plan(setting));
        let settings: Vec<Setting> = all.into_iter().map(|(_, setting)| setting).collect();
        let work = |setting: &Setting| self.plan(setting).map_or(0.0, |plan| plan.work());
        let work: Vec<f64> = settings.iter().map(work).collect();
        let own = self.keep.own(&work);
        let total: f64 =
            work.iter().zip(&own).map(|(work, own)| if *own { *work } else { 0.0 }).sum();
        let done = Cell::new(0.0);
        // A setting is shown before it is run.
        let mut show = |setting: &Setting| {
            bar.show_share(|| words::line(setting), (done.get() / total).min(1.0));
            let place = settings.iter().position(|known| known == setting);
            done.set(done.get() + place.map_or(0.0, |place| work[place]));
        };
        if is_shard {
            for (setting, _) in settings.iter().zip(&own).filter(|(_, own)| **own) {
                show(setting);
                self.run(setting, f64::INFINITY)?;
            }
            let keys: Vec<Value> = settings.iter().map(|setting| self.key(setting)).collect();
            if let Some(part) = self.keep.part(&keys, &own) {
                return Ok(Swept::Part(part));
            }
        }
        let found = self.with_machine(|machine| listed(tried, cases, goal, machine, &mut show));
        Ok(Swept::All(found?))
    }
}

#[cfg(test)]
mod tests;
