//! After a run that stopped: its step on P-waves, and settings that run instead, tried on the spot.

use anyhow::Result;
use mmsmith_verify::{
    Attempt, Case, CflSpeed, Choice, LARGEST_USUAL_CFL, Named, OnPWaves, Remedy, Row, Scheme,
    Shape, Status, StepError, Updated, needs_total_frame, on_p_waves, remedy,
};
use serde_json::{Value, json};

use super::problem::Model;
use crate::arguments::{Precision, SchemeOptions, word};
use crate::progress::Bar;
use crate::{number, processes, table};

/// Advice after a run that stopped, or whose errors exceed the motion.
pub(super) struct Advice {
    step: Option<OnPWaves>,
    tried: Option<Remedy>,
    /// Every setting that was tried, as options, in the order of the attempts.
    options: Vec<String>,
    /// The whole command of the attempt that ran.
    command: Option<String>,
    /// Whether the box of a particle was wider than its weights reach.
    is_too_large: bool,
}

impl Advice {
    /// Tries what runs in place of a case that stopped; nothing for a row that passed.
    pub(super) fn seek(
        solution: Given<'_>,
        model: &Model,
        case: &Case,
        row: &Row,
    ) -> Result<Option<Self>> {
        if row.status.passed() != Some(false) {
            return Ok(None);
        }
        let step = on_p_waves(&model.exact, case, row).ok();
        // Each process would try by itself.
        let tried = match processes::ranks() {
            Some(_) => None,
            None => {
                let _bar = Bar::expecting("looking for settings that run", None);
                Some(remedy(&model.exact, model.arithmetic(), case)?)
            }
        };
        let says_formulation = needs_total_frame(&model.exact).is_some();
        let attempts = tried.iter().flat_map(|tried| &tried.attempts);
        let options: Vec<_> =
            attempts.map(|attempt| options(&attempt.case, says_formulation)).collect();
        let found = tried.as_ref().and_then(Remedy::found).zip(options.last());
        let command = found.map(|(found, options)| solution.command(&found.case, options));
        let is_too_large = matches!(row.status, Status::Stopped(StepError::TooLarge { .. }));
        Ok(Some(Self { step, tried, options, command, is_too_large }))
    }

    /// Lines for people.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        if let Some(OnPWaves { at_rest, fastest }) = self.step {
            let is_long = fastest > 1.01 * LARGEST_USUAL_CFL;
            let [at_rest, fastest] = [at_rest, fastest].map(|cfl| number::rounded(cfl, 2));
            let judged = match is_long {
                true => format!(
                    "steps are safe up to {LARGEST_USUAL_CFL} there; --cfl and --cfl-speed p-wave set them"
                ),
                false => "the waves allow such a step".into(),
            };
            text += &format!(
                "The CFL number on P-waves is {at_rest} at rest and {fastest} on the fastest of this motion: {judged}.\n"
            );
        }
        let Some(Remedy { cells, attempts }) = &self.tried else { return text };
        let failed = |attempts: &[Attempt]| {
            let told = attempts.iter().zip(&self.options);
            told.map(|(attempt, options)| format!("  {options}: {}\n", short(&attempt.status)))
                .collect::<String>()
        };
        match (&self.command, attempts.split_last()) {
            (Some(command), Some((found, others))) => {
                text += &format!(
                    "This runs, tried on {cells} cells with an error of u of {}:\n  {command}\n",
                    table::error(found.error)
                );
                let shape = found.case.scheme.updated().map(|updated| updated.shape);
                if self.is_too_large && shape == Some(Shape::Cpdi2) {
                    text += "Quadrilaterals on shared corners (cpdi2) may be wider than two cells, boxes may not.\n";
                }
                if !others.is_empty() {
                    text += &format!("Tried before:\n{}", failed(others));
                }
            }
            (_, Some(_)) => {
                text +=
                    &format!("None of these runs, tried on {cells} cells:\n{}", failed(attempts));
            }
            (_, None) => text += "No other settings were small enough to be tried.\n",
        }
        text
    }

    /// The advice for programs.
    pub(super) fn document(&self) -> Value {
        let attempts = self.tried.iter().flat_map(|tried| &tried.attempts).zip(&self.options);
        json!({
            "p_wave_cfl": self.step.map(|step| step.at_rest),
            "fastest_p_wave_cfl": self.step.map(|step| step.fastest),
            "cells": self.tried.as_ref().map(|tried| tried.cells),
            "tried": attempts
                .map(|(attempt, options)| json!({
                    "options": options,
                    "status": attempt.status,
                    "u_linf": attempt.error,
                }))
                .collect::<Vec<_>>(),
            "runs": self.command,
        })
    }
}

/// How an attempt ended, in few words.
fn short(status: &Status) -> String {
    let at = |what: &str, time: f64| format!("{what} at t = {}", number::rounded(time, 3));
    match status {
        Status::Stopped(StepError::Inverted { time, .. }) => {
            at("a particle turned inside out", *time)
        }
        Status::Stopped(StepError::NotFinite { time, .. }) => at("a value not finite", *time),
        Status::Stopped(StepError::LeftGrid { time, .. }) => at("a particle off the grid", *time),
        Status::Stopped(StepError::TooLarge { time, .. }) => {
            at("a box of more than two cells", *time)
        }
        Status::Unstable { time, .. } => at("unstable", *time),
        Status::Exceeds { .. } => "an error larger than the motion".into(),
        other => other.to_string(),
    }
}

/// The options that say a case, but for solution and cells; the updated formulation is named where it is not the usual one.
fn options(case: &Case, says_formulation: bool) -> String {
    let usual = Scheme::Updated(Updated::default()).choices();
    // Mass and composition are those that suit the splines.
    let of_total = ["formulation", "shape", "layout", "grid"];
    let is_said = |one: &(&'static str, Choice)| match (&case.scheme, one.0) {
        (Scheme::Total(_), name) => of_total.contains(&name),
        (Scheme::Updated(_), "formulation") => says_formulation,
        (Scheme::Updated(_), "grid-angle" | "grid-shift") => one.1 != Choice::Number(0.0),
        (Scheme::Updated(_), _) => !usual.contains(one),
    };
    let said = case.scheme.choices().into_iter().filter(is_said);
    let mut words: Vec<String> = said.map(|(name, value)| format!("--{name} {value}")).collect();
    let mut say = |option: &str, value: &str| words.push(format!("--{option} {value}"));
    if case.per_cell != 2 {
        say("ppc", &case.per_cell.to_string());
    }
    say("cfl", &number::exact(case.cfl));
    if case.cfl_speed != CflSpeed::Bar {
        say("cfl-speed", case.cfl_speed.name());
    }
    words.join(" ")
}

/// A solution as a command line gives it.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    /// Its name, or its file.
    name: &'a str,
    /// The parameters that are given.
    set: &'a [(String, f64)],
    precision: Precision,
}

impl<'a> Given<'a> {
    /// With the parameters and the precision of a command line.
    pub(super) fn of(name: &'a str, options: &'a SchemeOptions) -> Self {
        Self { name, set: &options.parameters.set, precision: options.precision }
    }

    /// With its own parameters, in double precision.
    pub(super) fn plain(name: &'a str) -> Self {
        Self { name, set: &[], precision: Precision::F64 }
    }

    /// The command that runs a case with these options.
    fn command(self, case: &Case, options: &str) -> String {
        let mut text = format!("mms run {} --cells {}", self.name, case.cells);
        for (name, value) in self.set {
            text += &format!(" --set {name}={}", number::exact(*value));
        }
        if case.periods != 1.0 {
            text += &format!(" --periods {}", number::exact(case.periods));
        }
        if self.precision != Precision::F64 {
            text += &format!(" --precision {}", word(self.precision));
        }
        if let Some(extent) = case.extent {
            text += &format!(" --extent {}", extent.name());
        }
        format!("{text} {options}")
    }
}
