use std::sync::{Mutex, PoisonError};

use mmsmith_verify::Entry;

use super::measured::MAIN_EFFECTS;
use super::*;

/// Seconds that a step of a particle counts, and a run beside its steps. No machine is as slow, so that a sweep of minutes
/// has the work of one of a second.
const PARTICLE_STEP_S: f64 = 2e-5;
const RUN_S: f64 = 0.01;

/// A clock that goes on by the work that is done, and by nothing else.
#[derive(Default)]
pub(super) struct Counted(Mutex<State>);

#[derive(Default)]
struct State {
    now: f64,
    walls: Vec<(Setting, f64)>,
}

impl Counted {
    fn with<R>(&self, work: impl FnOnce(&mut State) -> R) -> R {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub(super) fn now(&self) -> f64 {
        self.with(|state| state.now)
    }

    pub(super) fn ran(&self, setting: &Setting, row: &mut Row) {
        let wall_s = PARTICLE_STEP_S * row.particles as f64 * row.steps as f64;
        (row.wall_s, row.cpu_s) = (wall_s, wall_s);
        self.with(|state| {
            state.now += RUN_S + wall_s;
            state.walls.push((*setting, wall_s));
        });
    }

    pub(super) fn repeated(&self, setting: &Setting) -> Repeat {
        self.with(|state| {
            let known = state.walls.iter().find(|(known, _)| known == setting);
            let wall_s = known.expect("it was run").1;
            state.now += wall_s;
            Repeat { wall_s, cpu_s: wall_s }
        })
    }
}

fn sweep_of(options: &TradeoffOptions) -> Measured<'_> {
    let bar = Bar::new("planning");
    match sweep_in(options, Time::Counted(Counted::default()), &bar).expect("a sweep") {
        Swept::All(report) => report,
        Swept::Part(part) => panic!("{part}"),
    }
}

/// All that a sweep promises beside its files, with a clock that no other work on the machine can hold up.
#[test]
fn a_sweep_keeps_its_budget_and_its_promises() {
    let usual = TradeoffOptions::usual("axis-aligned", 60.0);
    let options = TradeoffOptions { tolerance: Some(1e-2), threads: Some(1), ..usual };
    let report = sweep_of(&options);
    assert!((0.9..=1.0).contains(&(report.used_s / 60.0)), "{} s", report.used_s);
    assert!(report.found.front.len() >= 4, "{:?}", report.found.front);
    assert!(report.holds());
    let chosen = report.found.for_tolerance.as_ref().expect("a setting");
    assert_eq!(chosen.proof.errors, report.found.entries[chosen.entry].row.errors);

    let text = report.report().expect("a report").text();
    assert!(text.contains("run once more") && text.contains("it holds"), "{text}");
    assert!(!text.contains("knob"), "{text}");
    let main = report.main_effects();
    assert!((3..=MAIN_EFFECTS).contains(&main.len()), "{main:?}");
    assert!(report.effects().len() > MAIN_EFFECTS);
    assert!(main.iter().all(|line| text.contains(line)));
    assert!(text.contains(" largest of "), "{text}");
    let document = report.report().map(|report| report.document()).expect("a document");
    assert_eq!(document["knobs"], json!(report.effects()));
    assert_eq!(document["effects"].as_array().map(Vec::len), Some(report.found.effects.len()));
    let advice = report.advice();
    assert!(advice.contains("## What accuracy costs"), "{advice}");
    assert!(advice.contains("For an error of 1e-2, the cheapest setting"), "{advice}");
    assert!(report.report().expect("a report").plot().contains("class=\"pareto\""));
    // The same again: nothing depends on what else the machine does.
    let again = sweep_of(&options).found;
    let settings = |found: &Tradeoff| found.entries.iter().map(|e| e.setting).collect::<Vec<_>>();
    assert_eq!(settings(&again), settings(&report.found));
    assert_eq!((again.front, again.effects), (report.found.front, report.found.effects));
    assert_eq!((again.tolerances, again.skipped), (report.found.tolerances, report.found.skipped));
}

#[test]
fn threads_are_told() {
    let usual = TradeoffOptions::usual("axis-aligned-1d", 4.0);
    let options = TradeoffOptions { threads: Some(2), ..usual };
    let report = sweep_of(&options);
    for Entry { setting, .. } in &report.found.entries {
        assert_eq!(setting.threads, 2);
        assert!(words::scheme(setting).contains("2 threads"));
    }
}
