//! `mms tradeoff`: error against cost, and the cheapest setting for a need.

mod advice;
mod time;
mod words;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{
    Arithmetic, Case, CaseError, Chosen, Discretized, Effect, Entry, Field, Goal, MARGIN, Machine,
    Norm, Outputs, Record, Repeat, Row, Setting, Skip, Status, Tradeoff, families, leading, list,
    listed as listed_ones, tradeoff as measure,
};
use serde_json::{Value, json};

use self::time::Time;
use super::problem::Model;
use crate::arguments::{Against, Precision, TradeoffOptions};
use crate::json::Output;
use crate::keep::{Found, Keep, Order, Part};
use crate::library::Selection;
use crate::progress::Bar;
use crate::report::{self, Sheet};
use crate::svg::{Front, Point};
use crate::table::{self, Table};
use crate::{machine, memory, number, terminal};

/// The CFL number that ladders begin with.
const CFL: f64 = 0.4;
/// More threads than this are not compared with one.
const MOST_THREADS: usize = 64;
/// Lines on what settings buy, of which there may be many more.
const MAIN_EFFECTS: usize = 10;
/// Lines on single precision among these, at most.
const OF_SINGLE_PRECISION: usize = 2;

/// How errors are compared.
struct Measure {
    field: Field,
    norm: Norm,
    /// The divisor of errors, and its name.
    scale: Option<(String, f64)>,
}

impl Measure {
    fn new(options: &TradeoffOptions, selection: &Selection) -> Self {
        let (field, norm) = (options.field.into(), options.norm.into());
        let amplitude = selection.parameters().get("A").filter(|A| **A != 0.0);
        // Displacements go with the amplitude; other fields have other units.
        let scale =
            amplitude.filter(|_| field == Field::Displacement).map(|A| ("A".into(), A.abs()));
        Self { field, norm, scale }
    }

    fn of(&self, row: &Row) -> f64 {
        let error = row.errors[self.field][self.norm];
        error / self.scale.as_ref().map_or(1.0, |(_, scale)| *scale)
    }

    /// The compared errors, in words.
    fn words(&self) -> String {
        let (field, norm) = (self.field, self.norm.caption());
        match &self.scale {
            Some((name, value)) => {
                format!("{norm} of {field} over {name} = {}", number::exact(*value))
            }
            None => format!("{norm} of {field}, not divided by anything"),
        }
    }
}

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
    let outputs = [&options.json, &options.csv, &options.plot, &options.advice]
        .map(|path| Output::prepare_if(path.as_ref()));
    let [json, csv, plot, advice] = outputs;
    let (json, csv, plot, advice) = (json?, csv?, plot?, advice?);
    let report = match sweep(options, &Bar::new("planning"))? {
        Swept::All(report) => report,
        Swept::Part(part) => {
            terminal::say(&part.to_string())?;
            return Ok(true);
        }
    };
    terminal::say(&report.text())?;
    if let Some(file) = json {
        file.write(&report.document()?)?;
    }
    if let Some(file) = csv {
        file.write_text(&report.sheet().csv()?)?;
    }
    if let Some(file) = plot {
        file.write_text(&report.picture())?;
    }
    if let Some(file) = advice {
        file.write_text(&report.advice())?;
    }
    Ok(report.holds())
}

/// A report, or a shard's part of what it needs.
pub(super) enum Swept<'a> {
    All(Box<Report<'a>>),
    Part(Part),
}

/// Measures what was asked for.
pub(super) fn sweep<'a>(options: &'a TradeoffOptions, bar: &Bar) -> Result<Swept<'a>> {
    sweep_in(options, Time::Real(Instant::now()), bar)
}

fn sweep_in<'a>(options: &'a TradeoffOptions, time: Time, bar: &Bar) -> Result<Swept<'a>> {
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
    let pool = |threads: usize| -> Result<(usize, rayon::ThreadPool)> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        Ok((threads, pool.context("--threads: cannot start the threads")?))
    };
    // Some schemes use one thread, whatever is asked for.
    let pools = [1, threads].into_iter().chain(more).map(pool).collect::<Result<_>>()?;
    let outputs = [
        ("--json", options.json.is_some()),
        ("--csv", options.csv.is_some()),
        ("--plot", options.plot.is_some()),
        ("--advice", options.advice.is_some()),
        ("--tolerance", options.tolerance.is_some()),
        ("--time", options.time.is_some()),
    ];
    let keep = Keep::open(&options.kept, &options.name, &outputs)?;
    let runner =
        Runner { exact: &exact, single: single.as_ref(), pools, time, keep, selection: &selection };
    let what = |setting: &Setting| Some(*runner.discretized(setting).ok()?.plan());
    let case = Case { cfl: CFL, periods: options.periods, ..Case::default() };
    let base = Setting { case, single: false, threads };
    let tried = families(&base, more, single.is_some(), &what);
    if tried.is_empty() {
        // The reason why even the usual scheme cannot be run.
        exact.discretized(&case)?;
        bail!("no scheme of the solver fits {}", selection.name());
    }
    let compared = Measure::new(options, &selection);
    let goal = Goal {
        budget_s: options.budget,
        error: &|row| compared.of(row),
        against: options.against.into(),
        tolerance: options.tolerance,
        time_s: options.time,
        most_bytes: memory::available(),
    };
    let calls = Machine {
        plan: &what,
        run: &|setting: &Setting, most_s| runner.run(setting, most_s),
        repeat: &|setting: &Setting, most_s| runner.repeat(setting, most_s),
        clock: &|| runner.time.now(),
    };
    let found = match &listed {
        None => {
            let mut show = |setting: &Setting| {
                let share = runner.time.now() / options.budget;
                bar.show_share(|| words::line(setting), share.min(1.0));
            };
            measure(&tried, &goal, &calls, &mut show)?
        }
        Some(cases) => {
            let settings: Vec<Setting> =
                list(&tried, cases, &what).into_iter().map(|(_, setting)| setting).collect();
            let work = |setting: &Setting| what(setting).map_or(0.0, |plan| plan.work());
            let work: Vec<f64> = settings.iter().map(work).collect();
            let own = runner.keep.own(&work);
            let total: f64 =
                work.iter().zip(&own).map(|(work, own)| if *own { *work } else { 0.0 }).sum();
            let done = Cell::new(0.0);
            // A setting is shown before it is run.
            let mut show = |setting: &Setting| {
                bar.show_share(|| words::line(setting), (done.get() / total).min(1.0));
                let place = settings.iter().position(|known| known == setting);
                done.set(done.get() + place.map_or(0.0, |place| work[place]));
            };
            if options.kept.shard.is_some() {
                for (setting, _) in settings.iter().zip(&own).filter(|(_, own)| **own) {
                    show(setting);
                    runner.run(setting, f64::INFINITY)?;
                }
                let keys: Vec<Value> = settings.iter().map(|setting| runner.key(setting)).collect();
                if let Some(part) = runner.keep.part(&keys, &own) {
                    return Ok(Swept::Part(part));
                }
            }
            listed_ones(&tried, cases, &goal, &calls, &mut show)?
        }
    };
    let used_s = runner.time.now();
    Ok(Swept::All(Box::new(Report { options, selection, found, compared, threads, used_s })))
}

/// Result of a sweep, to be told.
pub(super) struct Report<'a> {
    options: &'a TradeoffOptions,
    selection: Selection,
    found: Tradeoff,
    compared: Measure,
    threads: usize,
    used_s: f64,
}

/// Why grids were left out, for people and for machines.
fn reason(skip: Skip) -> String {
    match skip {
        Skip::Dominated => format!(
            "expected to be {MARGIN} times less accurate than a measured setting of the same cost"
        ),
        Skip::NoGain => "error no longer falls on finer grids".into(),
        Skip::Cfl => "another CFL number gains nothing".into(),
        Skip::Stopped => "the run stopped; finer grids were not tried".into(),
        Skip::Budget => "would take longer than the budget allows for one run".into(),
        Skip::Refused => "refused by the solver, such as for too few particles".into(),
        Skip::Memory => "would need more memory than available".into(),
    }
}

impl Report<'_> {
    fn error(&self, entry: &Entry) -> f64 {
        if entry.row.status == Status::Ok { self.compared.of(&entry.row) } else { f64::NAN }
    }

    fn cost(&self, entry: &Entry) -> f64 {
        match self.options.against {
            Against::Wall => entry.row.wall_s,
            Against::Cpu => entry.row.cpu_s,
            Against::Steps => entry.row.steps as f64,
            Against::Memory => entry.bytes,
        }
    }

    fn cost_words(&self) -> &'static str {
        match self.options.against {
            Against::Wall => "wall-clock time of the steps, s",
            Against::Cpu => "processor time of the steps, s",
            Against::Steps => "number of steps",
            Against::Memory => "memory (estimated), bytes",
        }
    }

    pub(super) fn definition(&self) -> String {
        format!(
            "error: {}, the largest over all steps; cost: {}; both as mms run measures them",
            self.compared.words(),
            self.cost_words()
        )
    }

    /// Whether what was asked for was found and proved.
    fn holds(&self) -> bool {
        let asked = [
            (self.options.tolerance, &self.found.for_tolerance),
            (self.options.time, &self.found.for_time),
        ];
        asked.iter().all(|(limit, chosen)| {
            limit.is_none_or(|limit| {
                chosen.as_ref().is_some_and(|chosen| {
                    self.proved(chosen, limit, self.options.tolerance == Some(limit))
                })
            })
        })
    }

    fn proved(&self, chosen: &Chosen, limit: f64, is_tolerance: bool) -> bool {
        let row = &chosen.proof;
        let value = if is_tolerance { self.compared.of(row) } else { row.wall_s };
        row.status == Status::Ok && value <= limit
    }

    fn table(&self, indices: &[usize]) -> Table {
        let header = [
            "error",
            "wall s",
            "spread",
            "cpu s",
            "timings",
            "cells",
            "CFL",
            "particles",
            "steps",
            "scheme",
        ];
        let table = Table::new(0, header).sparing(3..5).sparing(7..9);
        let mut table = table.sparing(2..3).flowing(30);
        for &index in indices {
            let entry = &self.found.entries[index];
            table.row([
                table::error(self.error(entry)),
                format!("{:.2e}", entry.row.wall_s),
                format!("{:.0} %", 100.0 * spread(&entry.walls)),
                format!("{:.2e}", entry.row.cpu_s),
                entry.walls.len().to_string(),
                entry.row.cells.to_string(),
                format!("{:.3}", entry.row.cfl),
                entry.row.particles.to_string(),
                entry.row.steps.to_string(),
                words::scheme(&entry.setting),
            ]);
        }
        table
    }

    /// The settings to which no other is both cheaper and more accurate.
    pub(super) fn front(&self) -> Table {
        self.table(&self.found.front)
    }

    /// The number of settings that were run.
    pub(super) fn settings(&self) -> usize {
        self.found.entries.len()
    }

    fn text(&self) -> String {
        let runs = self.found.entries.len();
        let mut text = format!(
            "{} ({}), {}, {} unless a scheme says otherwise\n{}\n{runs} settings of {} schemes{}\n",
            self.selection.name(),
            self.selection.told_parameters(),
            number::of_periods(self.options.periods),
            number::counted(self.threads, "thread"),
            self.definition(),
            self.found.families,
            match self.options.cells.is_empty() {
                true => format!(" in {:.1} s of {} s", self.used_s, self.options.budget),
                false => String::new(),
            },
        );
        let beside = self.found.entries.iter().filter(|entry| !entry.row.timed_alone).count();
        if beside > 0 {
            text += &format!(
                "  {beside} of them shared their cores with other work: their times are too long\n"
            );
        }
        for (skip, count) in &self.found.skipped {
            text += &format!("  {count} left out: {}\n", reason(*skip));
        }
        text += &format!(
            "\nthe front: no other setting is both cheaper and more accurate\n{}",
            self.front().text()
        );
        let (main, all) = (self.main_effects(), self.effects().len());
        let has = "A wider terminal, --csv and --json have them.";
        text += &table::on_left_out([&self.front()], has);
        text += "\neffect of each setting, with all others equal";
        if main.len() < all {
            text += &format!(": the {} largest of {all} (--json has all)", main.len());
        }
        text.push('\n');
        for line in main {
            text += &format!("  {line}\n");
        }
        text +=
            "\nthe cheapest setting whose neighbouring cell counts meet the tolerance as well\n";
        for named in &self.found.tolerances {
            text += &match named.entry {
                None => format!("  {:e}: none within the budget\n", named.tolerance),
                Some(index) => {
                    let entry = &self.found.entries[index];
                    let doubt = match named.neighbours_hold {
                        true => "",
                        false if self.options.cells.is_empty() => {
                            " (no time to try its neighbours)"
                        }
                        false => " (not between two of the cell counts)",
                    };
                    format!(
                        "  {:e}: {:.2e} s, error {:.2e}: {}{doubt}\n",
                        named.tolerance,
                        entry.row.wall_s,
                        self.error(entry),
                        words::line(&entry.setting)
                    )
                }
            };
        }
        if let Some(limit) = self.options.tolerance {
            text +=
                &self.choice(&format!("--tolerance {limit:e}"), limit, &self.found.for_tolerance);
        }
        if let Some(limit) = self.options.time {
            text += &self.choice(&format!("--time {limit} s"), limit, &self.found.for_time);
        }
        text
    }

    fn choice(&self, asked: &str, limit: f64, chosen: &Option<Chosen>) -> String {
        let Some(chosen) = chosen else {
            return format!("\n{asked}: NO setting within the budget does\n");
        };
        let row = &chosen.proof;
        let is_tolerance = self.options.tolerance == Some(limit);
        let verdict =
            if self.proved(chosen, limit, is_tolerance) { "holds" } else { "DOES NOT HOLD" };
        format!(
            "\n{asked}: {}\n  run once more: error {:.3e}, {:.3e} s: it {verdict}\n",
            self.command(&self.found.entries[chosen.entry].setting),
            self.compared.of(row),
            row.wall_s
        )
    }

    /// The command that runs a setting.
    fn command(&self, setting: &Setting) -> String {
        let set: String = self
            .options
            .parameters
            .set
            .iter()
            .map(|(name, value)| format!(" --set {name}={}", number::exact(*value)))
            .collect();
        let periods = match self.options.periods {
            1.0 => String::new(),
            periods => format!(" --periods {}", number::exact(periods)),
        };
        format!("mms run {} {}{periods}{set}", self.options.name, words::options(setting))
    }

    /// Effects of the change of each setting, a line each.
    fn effects(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.found.effects.iter().map(|effect| self.effect(effect)).collect();
        lines.extend(self.single_precision());
        lines
    }

    /// The lines of those that matter most.
    pub(super) fn main_effects(&self) -> Vec<String> {
        let mut single = self.single_precision();
        single.truncate(OF_SINGLE_PRECISION);
        let main = leading(&self.found.effects, MAIN_EFFECTS - single.len());
        main.into_iter().map(|effect| self.effect(effect)).chain(single).collect()
    }

    fn effect(&self, effect: &Effect) -> String {
        let entries = &self.found.entries;
        words::effect(effect, &entries[effect.from], &entries[effect.to])
    }

    /// Whether an entry was run with the threads that all were run with, as far as its scheme uses them.
    fn is_of_usual_threads(&self, entry: &Entry) -> bool {
        entry.setting.threads == self.threads
    }

    /// From where on single precision stops improving: for each scheme that was run in both, its errors grid by grid.
    fn single_precision(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let ok = |entry: &&Entry| self.error(entry).is_finite();
        let entries = || self.found.entries.iter().filter(ok);
        let mut schemes: Vec<String> = Vec::new();
        for scheme in entries().filter(|entry| entry.setting.single) {
            let name = words::scheme(&Setting { single: false, ..scheme.setting });
            let name = format!("{name}, CFL {}", scheme.setting.case.cfl);
            if schemes.contains(&name) {
                continue;
            }
            schemes.push(name.clone());
            let same = |a: &Setting, b: &Setting| {
                let cells = b.case.cells;
                Setting { case: Case { cells, ..a.case }, single: b.single, ..*a } == *b
            };
            let mut pairs: Vec<(usize, f64, f64)> = entries()
                .filter(|single| single.setting.single && same(&scheme.setting, &single.setting))
                .filter_map(|single| {
                    let twin = Setting { single: false, ..single.setting };
                    let double = entries().find(|entry| entry.setting == twin)?;
                    Some((single.row.cells, self.error(single), self.error(double)))
                })
                .collect();
            pairs.sort_by_key(|pair| pair.0);
            let Some(&(finest, ..)) = pairs.last() else { continue };
            let worse = pairs.iter().find(|(_, single, double)| *single > 1.1 * double);
            lines.push(match worse {
                Some((cells, single, double)) => format!(
                    "f32 ({name}): from {cells} cells on its error is more than 10 % above that of f64 ({single:.2e} against \
                     {double:.2e})"
                ),
                None => format!(
                    "f32 ({name}): within 10 % of the error of f64 on all grids that both were run on, up to {finest} cells"
                ),
            });
        }
        lines
    }

    pub(super) fn document(&self) -> Result<Value> {
        let mut rows = Vec::new();
        for entry in &self.found.entries {
            let mut row = words::document(&entry.setting);
            if let (Value::Object(row), Value::Object(measured)) =
                (&mut row, serde_json::to_value(&entry.row)?)
            {
                row.extend(measured);
                row.insert("error".into(), json!(self.error(entry)));
                row.insert("bytes".into(), json!(entry.bytes));
                row.insert("wall_repeats_s".into(), json!(entry.walls));
                row.insert("cpu_repeats_s".into(), json!(entry.cpus));
                row.insert("wall_spread".into(), json!(spread(&entry.walls)));
                row.insert("total_s".into(), json!(entry.total_s));
            }
            rows.push(row);
        }
        let tolerances: Vec<Value> = self
            .found
            .tolerances
            .iter()
            .map(|named| {
                json!({
                    "tolerance": named.tolerance,
                    "index": named.entry,
                    "wall_s": named.entry.map(|entry| self.found.entries[entry].row.wall_s),
                    "neighbours_hold": named.entry.map(|_| named.neighbours_hold),
                    "command": named.entry.map(|entry| self.command(&self.found.entries[entry].setting)),
                })
            })
            .collect();
        let chosen = |name: &str, limit: Option<f64>, chosen: &Option<Chosen>| {
            limit.map(|limit| {
                json!({
                    "for": name,
                    "limit": limit,
                    "index": chosen.as_ref().map(|chosen| chosen.entry),
                    "holds": chosen.as_ref().is_some_and(|chosen| self.proved(chosen, limit, name == "tolerance")),
                    "row": chosen.as_ref().map(|chosen| &chosen.proof),
                    "command": chosen.as_ref().map(|chosen| self.command(&self.found.entries[chosen.entry].setting)),
                })
            })
        };
        let chosen: Vec<Value> = [
            chosen("tolerance", self.options.tolerance, &self.found.for_tolerance),
            chosen("time", self.options.time, &self.found.for_time),
        ]
        .into_iter()
        .flatten()
        .collect();
        let skipped: Vec<Value> = self
            .found
            .skipped
            .iter()
            .map(|(skip, count)| json!({ "reason": reason(*skip), "count": count }))
            .collect();
        let effects: Vec<Value> = self
            .found
            .effects
            .iter()
            .map(|effect| {
                let time = effect.time.factor();
                json!({
                    "setting": effect.setting,
                    "from": effect.from,
                    "to": effect.to,
                    "pairs": effect.pairs,
                    "time": time.map(|range| [range.least, range.most]),
                    "error": [effect.error.least, effect.error.most],
                })
            })
            .collect();
        Ok(json!({
            "schema": "mmsmith.tradeoff/1",
            "settings": {
                "version": env!("CARGO_PKG_VERSION"),
                "solution": self.selection.name(),
                "parameters": self.selection.parameters(),
                "periods": self.options.periods,
                "budget_s": self.options.cells.is_empty().then_some(self.options.budget),
                "cells": self.options.cells,
                "cfls": if self.options.cells.is_empty() { &[][..] } else { &self.options.cfls },
                "field": self.options.field,
                "norm": self.options.norm,
                "against": self.options.against,
                "threads": self.threads,
                "processor": machine::processor(),
            },
            "definition": self.definition(),
            "used_s": self.used_s,
            "families": self.found.families,
            "rows": rows,
            "front": self.found.front,
            "tolerances": tolerances,
            "chosen": chosen,
            "knobs": self.effects(),
            "effects": effects,
            "skipped": skipped,
        }))
    }

    pub(super) fn sheet(&self) -> Sheet {
        let header = "front,scheme,cells,cfl,ppc,threads,precision,steps,particles,wall_s,cpu_s,wall_spread,timings,bytes,error,status";
        let mut sheet = Sheet::new(header.split(','));
        for (index, entry) in self.found.entries.iter().enumerate() {
            let Entry { setting, row, walls, bytes, .. } = entry;
            let error = self.error(entry);
            let error = if error.is_finite() { format!("{error:?}") } else { String::new() };
            sheet.row([
                u8::from(self.found.front.contains(&index)).to_string(),
                words::scheme(setting),
                row.cells.to_string(),
                report::number(row.cfl),
                setting.case.per_cell.to_string(),
                setting.threads.to_string(),
                if setting.single { "f32" } else { "f64" }.to_owned(),
                row.steps.to_string(),
                row.particles.to_string(),
                report::number(row.wall_s),
                report::number(row.cpu_s),
                report::number(spread(walls)),
                walls.len().to_string(),
                report::number(*bytes),
                error,
                row.status.to_string(),
            ]);
        }
        sheet
    }

    pub(super) fn picture(&self) -> String {
        let title = format!("{}: error against cost", self.selection.name());
        let point = |(index, entry): (usize, &Entry)| Point {
            kind: words::kind(&entry.setting),
            cost: self.cost(entry),
            error: self.error(entry),
            on_front: self.found.front.contains(&index),
        };
        let points = self.found.entries.iter().enumerate().map(point).collect();
        Front { title: &title, x: self.cost_words(), y: &self.compared.words(), points }.svg()
    }
}

/// How far repeats lie apart: the largest less the smallest, over the median.
fn spread(values: &[f64]) -> f64 {
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for value in values {
        least = least.min(*value);
        most = most.max(*value);
    }
    let median = mmsmith_verify::median(values);
    if median > 0.0 { (most - least) / median } else { 0.0 }
}

#[cfg(test)]
mod tests;
