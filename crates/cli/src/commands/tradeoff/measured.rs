//! Everything that a sweep has measured, and its report.

use std::collections::BTreeMap;

use anyhow::Result;
use mmsmith_verify::{
    Against, Case, Cheapest, Chosen, Effect, Entry, Field, MARGIN, Named, Norm, Row, Setting, Skip,
    Status, Tradeoff, leading,
};
use serde_json::{Map, Value, json};

use super::words;
use crate::arguments::TradeoffOptions;
use crate::library::Selection;
use crate::report::{self, Report, Section, Sheet};
use crate::svg::{Front, Point};
use crate::table::{self, Table};
use crate::{machine, number};

/// Lines on what settings buy, of which there may be many more.
pub(super) const MAIN_EFFECTS: usize = 10;
/// Lines on single precision among these, at most.
const OF_SINGLE_PRECISION: usize = 2;

/// How errors are compared.
pub(super) struct Measure {
    field: Field,
    norm: Norm,
    /// The divisor of errors, and its name.
    scale: Option<(String, f64)>,
}

impl Measure {
    pub(super) fn new(options: &TradeoffOptions, selection: &Selection) -> Self {
        let (field, norm) = (options.field.into(), options.norm);
        let amplitude = selection.parameters().get("A").filter(|A| **A != 0.0);
        // Displacements go with the amplitude; other fields have other units.
        let scale =
            amplitude.filter(|_| field == Field::Displacement).map(|A| ("A".into(), A.abs()));
        Self { field, norm, scale }
    }

    pub(super) fn of(&self, row: &Row) -> f64 {
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

/// Result of a sweep, to be told.
pub(in crate::commands) struct Measured<'a> {
    pub(super) options: &'a TradeoffOptions,
    pub(super) selection: Selection,
    pub(super) found: Tradeoff,
    pub(super) compared: Measure,
    pub(super) threads: usize,
    pub(super) used_s: f64,
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

impl Measured<'_> {
    pub(super) fn error(&self, entry: &Entry) -> f64 {
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

    pub(in crate::commands) fn definition(&self) -> String {
        format!(
            "error: {}, the largest over all steps; cost: {}; both as mms run measures them",
            self.compared.words(),
            self.cost_words()
        )
    }

    /// Whether what was asked for was found and proved.
    pub(super) fn holds(&self) -> bool {
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
    pub(in crate::commands) fn front(&self) -> Table {
        self.table(&self.found.front)
    }

    /// The number of settings that were run.
    pub(in crate::commands) fn runs(&self) -> usize {
        self.found.entries.len()
    }

    /// The report.
    pub(in crate::commands) fn report(&self) -> Result<Report> {
        let front = "the front: no other setting is both cheaper and more accurate";
        let has = "A wider terminal, --csv and --json have them.";
        Ok(Report {
            sections: vec![
                Section::Note(self.head()),
                Section::Table(front.into(), self.front()),
                Section::LeftOut(has),
                Section::Note(self.conclusions()),
                Section::Sheet(self.sheet()),
                Section::Plot(self.picture()),
            ],
            settings: self.settings(),
            results: self.results()?,
            verdict: Some(self.holds()),
            ..Report::new("tradeoff")
        })
    }

    fn head(&self) -> String {
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
        text
    }

    /// Lines below the front.
    fn conclusions(&self) -> String {
        let (main, all) = (self.main_effects(), self.effects().len());
        let mut text = String::from("\neffect of each setting, with all others equal");
        if main.len() < all {
            text += &format!(": the {} largest of {all} (--json has all)", main.len());
        }
        text.push('\n');
        for line in main {
            text += &format!("  {line}\n");
        }
        for (whose, cheapest) in self.groups() {
            text += &format!(
                "\nthe cheapest setting{whose} whose neighbouring cell counts meet the tolerance as well\n"
            );
            for named in cheapest {
                text += &self.cheapest(named);
            }
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

    /// The cheapest settings in groups that users compare: by formulation, where both were run.
    pub(super) fn groups(&self) -> Vec<(String, &[Cheapest])> {
        if self.found.by_formulation.is_empty() {
            return vec![(String::new(), &self.found.tolerances)];
        }
        let groups = self.found.by_formulation.iter();
        let of = |formulation| format!(" of the {} formulation", words::formulation(formulation));
        groups.map(|(formulation, cheapest)| (of(*formulation), &cheapest[..])).collect()
    }

    fn cheapest(&self, named: &Cheapest) -> String {
        let Some(index) = named.entry else {
            return format!("  {:e}: none within the budget\n", named.tolerance);
        };
        let entry = &self.found.entries[index];
        let doubt = match named.neighbours_hold {
            true => "",
            false if self.options.cells.is_empty() => " (no time to try its neighbours)",
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
    pub(super) fn command(&self, setting: &Setting) -> String {
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
    pub(super) fn effects(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.found.effects.iter().map(|effect| self.effect(effect)).collect();
        lines.extend(self.single_precision());
        lines
    }

    /// The lines of those that matter most.
    pub(in crate::commands) fn main_effects(&self) -> Vec<String> {
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
    pub(super) fn is_of_usual_threads(&self, entry: &Entry) -> bool {
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

    /// The rows for programs.
    fn rows(&self) -> Result<Vec<Value>> {
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
        Ok(rows)
    }

    /// The cheapest setting for each tolerance, for programs.
    fn tolerances(&self, cheapest: &[Cheapest]) -> Vec<Value> {
        cheapest
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
            .collect()
    }

    /// As [`Self::tolerances`] of each formulation, where both were run.
    fn tolerances_by_formulation(&self) -> BTreeMap<&'static str, Vec<Value>> {
        let groups = self.found.by_formulation.iter();
        groups.map(|(own, cheapest)| (own.name(), self.tolerances(cheapest))).collect()
    }

    /// The settings that were asked for, for programs.
    fn chosen(&self) -> Vec<Value> {
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
        [
            chosen("tolerance", self.options.tolerance, &self.found.for_tolerance),
            chosen("time", self.options.time, &self.found.for_time),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    fn settings(&self) -> Value {
        json!({
                "version": env!("CARGO_PKG_VERSION"),
                "solution": self.selection.name(),
                "parameters": self.selection.parameters(),
                "periods": self.options.periods,
                "budget_s": self.options.cells.is_empty().then_some(self.options.budget),
                "cells": self.options.cells,
                "cfls": if self.options.cells.is_empty() { &[][..] } else { &self.options.cfls },
                "field": self.options.field,
                "norm": self.options.norm.name(),
                "against": self.options.against.name(),
                "threads": self.threads,
                "processor": machine::processor(),
        })
    }

    /// The results for programs.
    fn results(&self) -> Result<Map<String, Value>> {
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
        let all = [
            ("definition", json!(self.definition())),
            ("used_s", json!(self.used_s)),
            ("families", json!(self.found.families)),
            ("rows", json!(self.rows()?)),
            ("front", json!(self.found.front)),
            ("tolerances", json!(self.tolerances(&self.found.tolerances))),
            ("tolerances_by_formulation", json!(self.tolerances_by_formulation())),
            ("chosen", json!(self.chosen())),
            ("knobs", json!(self.effects())),
            ("effects", json!(effects)),
            ("skipped", json!(skipped)),
        ];
        Ok(all.map(|(name, value)| (name.to_owned(), value)).into_iter().collect())
    }

    fn sheet(&self) -> Sheet {
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

    fn picture(&self) -> String {
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
