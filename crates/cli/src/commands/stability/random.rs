//! Failures inside the region believed stable, looked for by random settings.

use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Result, bail};
use mmsmith_verify::{Case, CflSpeed, Criteria, GridPose, Observed, is_stable};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

use super::{Point, definition, told, without_threads, work};
use crate::arguments::{SchemeOptions, StabilityOptions, word};
use crate::commands::scheme::Settled;
use crate::commands::{caption, settings, with_threads};
use crate::json::Output;
use crate::keep::{Found, Keep, Order};
use crate::library::Selection;
use crate::progress::Bar;
use crate::terminal;

/// Draws for one setting; the specification may refuse some.
const MOST_DRAWS: usize = 100;

pub(super) fn search(options: &StabilityOptions, criteria: &Criteria) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let settled = &Settled::settle(&options.scheme, &selection.build()?)?;
    let cfl = settled.case.cfl;
    if options.plot.is_some() || options.csv.is_some() {
        bail!("--search random draws no picture and no table; use --json");
    }
    let output = Output::prepare_if(settled.json.as_ref())?;
    let points: Vec<Point> = (0..options.samples)
        .map(|sample| draw(options, &settled.case, &selection, sample))
        .collect::<Result<_>>()?;
    let keep =
        Keep::open(&options.kept, &options.name, &[("--json", options.scheme.json.is_some())])?;
    let own = keep.own(&work(&points)?);
    let keys: Vec<_> = points
        .iter()
        .map(|Point { selection, settled, extent, .. }| {
            let Case { cells, cfl, .. } = settled.case;
            let case = settings(selection, settled, *extent, cells, cfl);
            without_threads(json!({ "case": case, "criteria": criteria }))
        })
        .collect();
    with_threads(settled.threads, || {
        let found: Found<Observed> = {
            let bar = Bar::new("random settings");
            let done = AtomicUsize::new(0);
            let count = own.iter().filter(|own| **own).count();
            keep.all(
                &keys,
                &own,
                Order::AtOnce,
                |_| {},
                |index| {
                    let Point { model, settled, .. } = &points[index];
                    let case = &settled.case;
                    let found = is_stable(&model.exact, model.arithmetic(), case, criteria)?;
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    let share = done as f64 / count as f64;
                    bar.show_share(|| format!("setting {done}/{count}"), share);
                    Ok(found)
                },
            )?
        };
        let found = match found {
            Found::All(found) => found,
            Found::Part(part) => {
                terminal::say(&part.to_string())?;
                return Ok(true);
            }
        };
        let extent = points.first().and_then(|point| point.extent);
        let mut text = settled.choice() + &caption(&selection, settled, extent);
        text += &definition(criteria);
        text += &format!(
            "{} random settings (seed {}) with CFL numbers up to {} on P-waves:\n",
            points.len(),
            options.seed,
            cfl
        );
        let mut failures = Vec::new();
        for (point, found) in points.iter().zip(&found) {
            let Some(failure) = &found.failure else { continue };
            let command = command(options, point);
            text += &format!("UNSTABLE: {}\n  {command}\n", told(failure));
            let cfl = point.settled.case.cfl;
            failures.push(json!({ "command": command, "cfl": cfl, "failure": failure }));
        }
        text += &format!("{} of {} unstable\n", failures.len(), points.len());
        terminal::say(&text)?;
        let passed = failures.is_empty();
        if let Some(output) = output {
            output.write(&json!({
                "schema": "mmsmith.stability/1",
                "settings": settings(&selection, settled, extent, Value::Null, cfl),
                "criteria": criteria,
                "samples": points.len(),
                "seed": options.seed,
                "failures": failures,
            }))?;
        }
        Ok(passed)
    })
}

/// Setting number `sample`.
fn draw(
    options: &StabilityOptions,
    base: &Case,
    selection: &Selection,
    sample: usize,
) -> Result<Point> {
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
            let mut point = Point::new(Vec::new(), selection, &scheme, cells)?;
            let unit = mmsmith_verify::p_wave_limit(&point.model.exact, &point.settled.case)?;
            point.settled.case.cfl = base.cfl * unit * share;
            Ok(point)
        });
        match attempt {
            Ok(point) => return Ok(point),
            Err(error) => last = Some(error),
        }
    }
    match last {
        Some(error) => Err(error.context("--search: no random setting is admissible")),
        None => bail!("--search: no settings were drawn"),
    }
}

/// The command line that repeats a setting.
fn command(options: &StabilityOptions, point: &Point) -> String {
    let Case { scheme, cells, per_cell, cfl, cfl_speed, periods, extent } = point.settled.case;
    let parts = scheme.parts();
    let mut text = format!(
        "mms stability {} --at {cfl:?} --cells {cells} --ppc {per_cell} --offset {:?} --shape {} --integrator {} --start {} \
         --transfer {} --layout {} --periods {periods:?} --precision {} --error-multiple {:?} --energy-rate {:?}",
        options.name,
        parts.offset,
        parts.shape,
        parts.integrator,
        parts.start,
        parts.transfer,
        parts.layout,
        word(point.settled.precision),
        options.error_multiple,
        options.energy_rate,
    );
    if !parts.pose.is_usual() {
        let GridPose { angle, shift } = parts.pose;
        text += &format!(" --grid-angle {angle:?} --grid-shift {shift:?}");
    }
    if scheme.total().is_some() {
        text += &format!(
            " --formulation total-lagrangian --mass {} --composition {} --grid {}",
            parts.mass, parts.composition, parts.grid
        );
    }
    if cfl_speed != CflSpeed::Bar {
        text += &format!(" --cfl-speed {cfl_speed}");
    }
    if let Some(extent) = extent {
        text += &format!(" --extent {extent}");
    }
    for (name, value) in point.selection.parameters() {
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
