//! Failures inside the region believed stable, looked for by random settings.

use anyhow::{Result, bail};
use mmsmith_verify::{Case, CflSpeed, Criteria, Discretized, Named, Observed, Volume, is_stable};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

use super::{Point, definition, request, told, without_threads};
use crate::arguments::{SchemeOptions, StabilityOptions, word};
use crate::commands::problem::Problem;
use crate::commands::study::{Show, Study, conduct};
use crate::keep::Order;
use crate::library::Selection;
use crate::report::{Report, Section};

/// Draws for one setting; the specification may refuse some.
const MOST_DRAWS: usize = 100;

pub(super) fn search(options: &StabilityOptions, criteria: &Criteria) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let common = &Problem::new(selection, &options.scheme)?;
    if options.plot.is_some() || options.csv.is_some() {
        bail!("--search random draws no picture and no table; use --json");
    }
    let draw = |sample| draw(options, common, sample);
    let points = (0..options.samples).map(draw).collect::<Result<Vec<_>>>()?;
    let mut cases = Vec::new();
    for problem in &points {
        cases.push(problem.model.discretized(&problem.settled.case)?);
    }
    let study = RandomSettings { options, criteria, common, points: &points, cases };
    conduct(&study, &request(options))
}

/// Runs of random settings.
struct RandomSettings<'a> {
    options: &'a StabilityOptions,
    criteria: &'a Criteria,
    /// The settings without what is drawn.
    common: &'a Problem,
    points: &'a [Problem],
    cases: Vec<Discretized<'a>>,
}

impl Study for RandomSettings<'_> {
    type Found = Observed;

    fn order(&self) -> Order {
        Order::AtOnce
    }

    fn keys(&self) -> Vec<Value> {
        let key = |(problem, case): (&Problem, &Discretized<'_>)| {
            let Case { cells, cfl, .. } = *case.case();
            let case = problem.settings(case.plan().extent, cells, cfl);
            without_threads(json!({ "case": case, "criteria": self.criteria }))
        };
        self.points.iter().zip(&self.cases).map(key).collect()
    }

    fn work(&self) -> Vec<f64> {
        self.cases.iter().map(|case| case.plan().work()).collect()
    }

    fn measure(&self, index: usize, show: &Show<'_>) -> Result<Observed> {
        let found = is_stable(&self.cases[index], self.criteria)?;
        show.share(|| format!("setting {}/{}", index + 1, self.cases.len()), 1.0);
        Ok(found)
    }

    fn report(&self, found: Vec<Observed>) -> Result<Report> {
        let Self { options, criteria, common, points, cases } = self;
        let (cfl, extent) = (common.settled.case.cfl, cases.first().and_then(|c| c.plan().extent));
        let mut text = definition(criteria);
        text += &format!(
            "{} random settings (seed {}) with CFL numbers up to {cfl} on P-waves:\n",
            points.len(),
            options.seed,
        );
        let mut failures = Vec::new();
        for (problem, found) in points.iter().zip(&found) {
            let Some(failure) = &found.failure else { continue };
            let command = command(options, problem);
            text += &format!("UNSTABLE: {}\n  {command}\n", told(failure));
            let cfl = problem.settled.case.cfl;
            failures.push(json!({ "command": command, "cfl": cfl, "failure": failure }));
        }
        text += &format!("{} of {} unstable\n", failures.len(), points.len());
        let verdict = Some(failures.is_empty());
        let results = [
            ("criteria", json!(criteria)),
            ("samples", json!(points.len())),
            ("seed", json!(options.seed)),
            ("failures", json!(failures)),
        ];
        Ok(Report {
            command: "stability",
            preface: common.settled.choice(),
            caption: common.caption(extent),
            sections: vec![Section::Note(text)],
            settings: common.settings(extent, Value::Null, cfl),
            results: results.map(|(name, value)| (name.to_owned(), value)).into_iter().collect(),
            verdict,
        })
    }
}

/// Setting number `sample`.
fn draw(options: &StabilityOptions, common: &Problem, sample: usize) -> Result<Problem> {
    let Problem { selection, settled, .. } = common;
    let base = &settled.case;
    let mut random = Random::new(options.seed.wrapping_add((sample as u64) << 32));
    let mut last = None;
    for _ in 0..MOST_DRAWS {
        let parameters = selection.parameters().iter().map(|(name, value)| {
            let value = match name.as_str() {
                // From rounding to beyond the default.
                "A" => value * 10.0_f64.powf(random.between(-12.0, 0.4)),
                "nu" => random.between(-0.2, 0.49),
                "E" | "rho0" => value * 10.0_f64.powf(random.between(-12.0, 12.0)),
                _ => *value,
            };
            (name.clone(), value)
        });
        let parameters: Vec<_> = parameters.collect();
        let ppc = 2 + random.below(3);
        let cells = 2 + random.below(31);
        let offset = if random.below(2) == 0 { 0.0 } else { random.between(-0.5, 0.5) };
        // Up to the limit believed stable, on P-waves; the speeds' ratio is known once the solution is.
        let share = random.between(0.05, 1.0);
        let attempt = selection.with(&parameters).and_then(|selection| {
            let ppc = Some(ppc.max(base.per_cell));
            let scheme = SchemeOptions { ppc, offset, ..options.scheme.clone() };
            let point = Point::new(Vec::new(), selection, &scheme, cells)?;
            let unit = mmsmith_verify::p_wave_limit(&point.admit()?)?;
            let mut problem = point.problem;
            problem.settled.case.cfl = base.cfl * unit * share;
            Ok(problem)
        });
        match attempt {
            Ok(problem) => return Ok(problem),
            Err(error) => last = Some(error),
        }
    }
    match last {
        Some(error) => Err(error.context("--search: no random setting is admissible")),
        None => bail!("--search: no settings were drawn"),
    }
}

/// The command line that repeats a setting.
fn command(options: &StabilityOptions, problem: &Problem) -> String {
    let Case { scheme, cells, per_cell, cfl, cfl_speed, periods, extent, return_map, volume } =
        problem.settled.case;
    let mut text = format!(
        "mms stability {} --at {cfl:?} --cells {cells} --ppc {per_cell} --periods {periods:?} --precision {} --error-multiple {:?} \
         --energy-rate {:?}",
        options.name,
        word(problem.settled.precision),
        options.error_multiple,
        options.energy_rate,
    );
    for (name, value) in scheme.choices() {
        text += &format!(" --{name} {value}");
    }
    if cfl_speed != CflSpeed::Bar {
        text += &format!(" --cfl-speed {}", cfl_speed.name());
    }
    if let Some(extent) = extent {
        text += &format!(" --extent {}", extent.name());
    }
    if let Some(map) = return_map {
        text += &format!(" --return-map {}", map.name());
    }
    if volume != Volume::Pointwise {
        text += &format!(" --volume {}", volume.name());
    }
    for (name, value) in problem.selection.parameters() {
        text += &format!(" --set {name}={value:?}");
    }
    text
}

/// Random numbers, the same ones on every machine.
struct Random(SplitMix64);

impl Random {
    fn new(seed: u64) -> Self {
        Random(SplitMix64::seed_from_u64(seed))
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.0.next_u64() % count as u64) as usize
    }
}
