//! Time that a run will take, predicted: calibrated on the spot by a few steps of the same scheme.
//!
//! Stored constants of a machine would be wrong on the next one, beside other work, and after every change of a kernel, and
//! each scheme, solution and number of threads would need its own. A few steps on some grids take a tenth of a second
//! and have all of that in them. Between grids the time of a step goes by a power of the number of particles.

use std::time::{Duration, Instant};

use crate::case::Case;
use crate::discretized::Discretized;
use crate::error::CaseError;
use crate::on_grid::Plan;

/// Times measured with one number of particles, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    particles: f64,
    setup_s: f64,
    /// One step.
    step_s: f64,
    /// All of a run but its steps, for each of them.
    beside_s: f64,
}

/// Time of a run, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// The steps alone, as a row states them.
    pub steps_s: f64,
    /// Everything, from setting up to the last error.
    pub total_s: f64,
}

/// The time of a scheme's steps as it depends on the number of particles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CostModel {
    /// By number of particles.
    samples: Vec<Sample>,
}

/// By how much the time of a step may grow with the particles beyond the grids that were tried, as a power: all its parts but
/// steady ones go by the particles. A greater power between small grids tells of caches that are left but once; carried on to
/// sixteen times the particles it would double what is predicted.
const POWERS: (f64, f64) = (0.9, 1.05);

impl CostModel {
    /// Learns what a run of `steps` steps took: its steps, and all of it.
    pub fn learn(&mut self, particles: f64, steps: u64, cost: Cost) {
        let is_known = steps > 0 && cost.steps_s > 0.0 && particles > 0.0;
        if !is_known {
            return;
        }
        let steps = steps as f64;
        let beside_s = ((cost.total_s - cost.steps_s) / steps).max(0.0);
        // Setting up is in what is beside the steps.
        self.put(Sample { particles, setup_s: 0.0, step_s: cost.steps_s / steps, beside_s });
    }

    fn put(&mut self, sample: Sample) {
        let place = self.samples.partition_point(|known| known.particles < sample.particles);
        match self.samples.get_mut(place) {
            // The latest of several on one grid: what else runs on the machine changes.
            Some(known) if known.particles == sample.particles => *known = sample,
            _ => self.samples.insert(place, sample),
        }
    }

    /// Times a few steps of a case's scheme on grids of its own kind up to its size, for at most about `effort`.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for settings that cannot be run.
    pub fn calibrate(own: &Discretized<'_>, effort: Duration) -> Result<Self, CaseError> {
        let started = Instant::now();
        let mut model = Self::default();
        for cells in PROBES {
            // Not every number of cells fits every box.
            let Ok(probe) = own.with(&Case { cells, ..*own.case() }) else { continue };
            let size = *probe.plan();
            let expected = model.of(&size, LEAST_STEPS).map_or(0.0, |cost| cost.total_s);
            let is_over = started.elapsed().as_secs_f64() + expected > effort.as_secs_f64();
            if is_over || (size.particles > own.plan().particles && !model.samples.is_empty()) {
                break;
            }
            // Enough for a median without the cold ones; many on small grids, where clocks count.
            let most = (20_000.0 / size.particles.max(1.0)).ceil().clamp(9.0, 50.0) as u64;
            let share = effort / 3;
            let timing = probe.time_steps(most, Some(Instant::now() + share))?;
            if timing.steps > 0 {
                model.put(Sample {
                    particles: timing.particles as f64,
                    setup_s: timing.setup_s,
                    step_s: timing.step_s,
                    beside_s: timing.measure_s,
                });
            }
        }
        Ok(model)
    }

    /// Predicted time of a run with this `plan`; `None` where the model has no samples.
    #[must_use]
    pub fn predict(&self, plan: &Plan) -> Option<Cost> {
        self.of(plan, plan.steps)
    }

    fn of(&self, plan: &Plan, steps: u64) -> Option<Cost> {
        let steps = steps as f64;
        let at = |value: fn(&Sample) -> f64| self.interpolate(plan.particles, value);
        let steps_s = steps * at(|sample| sample.step_s)?;
        let beside_s = steps * at(|sample| sample.beside_s)? + at(|sample| sample.setup_s)?;
        Some(Cost { steps_s, total_s: steps_s + beside_s })
    }

    fn interpolate(&self, particles: f64, value: impl Fn(&Sample) -> f64) -> Option<f64> {
        let last = self.samples.len().checked_sub(1)?;
        let upper =
            self.samples.partition_point(|known| known.particles < particles).clamp(1, last.max(1));
        let a = &self.samples[upper - 1];
        let (x, y) = (particles / a.particles, value(a));
        let Some(b) = self.samples.get(upper) else { return Some(y * x) };
        if !(y > 0.0 && value(b) > 0.0) {
            return Some(y.max(value(b)) * particles / b.particles);
        }
        let power = (value(b) / y).ln() / (b.particles / a.particles).ln();
        // Beyond the samples from the nearest one on.
        let (base, from) = if particles > b.particles { (value(b), b) } else { (y, a) };
        let outside = particles > b.particles || particles < a.particles;
        let power = if outside { power.clamp(POWERS.0, POWERS.1) } else { power };
        Some(base * (particles / from.particles).powf(power))
    }
}

/// Steps that tell something, the cold ones included.
const LEAST_STEPS: u64 = 5;

/// Grids that a scheme is tried on.
const PROBES: [usize; 7] = [4, 8, 16, 32, 64, 128, 256];

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(particles: f64, steps: u64) -> Plan {
        Plan { steps, particles, bytes: 0.0, extent: None, round_off: 0.0 }
    }

    #[test]
    fn a_power_law_is_found_again_between_its_samples_and_beyond() {
        let law = |n: f64| 1e-7 * n.powf(1.02);
        let mut model = CostModel::default();
        assert_eq!(model.predict(&plan(100.0, 1)), None);
        for n in [1e4, 1e2, 1e3] {
            let steps_s = 10.0 * law(n);
            model.learn(n, 10, Cost { steps_s, total_s: 3.0 * steps_s });
        }
        for n in [10.0, 300.0, 1e3, 5e3, 1e6] {
            let cost = model.predict(&plan(n, 7)).unwrap();
            assert!((cost.steps_s / (7.0 * law(n)) - 1.0).abs() < 1e-9, "{n}: {cost:?}");
            assert!((cost.total_s / cost.steps_s - 3.0).abs() < 1e-9, "{n}: {cost:?}");
        }
    }

    /// Small grids fit into caches that larger ones leave: the time of a step grows by more than the particles there, once.
    #[test]
    fn steps_that_leave_a_cache_do_not_grow_on_at_that_pace() {
        let particles = |cells: f64| 4.0 * cells * cells;
        let step_s = |cells: f64| particles(cells) * if cells < 50.0 { 2e-8 } else { 3.2e-8 };
        let mut model = CostModel::default();
        for cells in [8.0, 16.0, 32.0, 64.0] {
            let steps_s = 50.0 * step_s(cells);
            model.learn(particles(cells), 50, Cost { steps_s, total_s: 1.2 * steps_s });
        }
        for cells in [64.0, 96.0, 128.0, 256.0] {
            let steps = 5 * cells as u64;
            let taken = steps as f64 * step_s(cells);
            let predicted = model.predict(&plan(particles(cells), steps)).unwrap().steps_s;
            assert!((taken / predicted - 1.0).abs() < 0.3, "{cells}: {taken} {predicted}");
        }
    }

    #[test]
    fn one_sample_goes_by_the_number_of_particles_and_the_latest_counts() {
        let mut model = CostModel::default();
        model.learn(100.0, 1, Cost { steps_s: 9.0, total_s: 9.0 });
        model.learn(100.0, 1, Cost { steps_s: 1.0, total_s: 1.5 });
        assert_eq!(model.predict(&plan(200.0, 3)), Some(Cost { steps_s: 6.0, total_s: 9.0 }));
    }

    #[test]
    fn what_cannot_be_extrapolated_sensibly_is_bounded() {
        let mut model = CostModel::default();
        // A clock that stood still, then one that leapt.
        model.learn(100.0, 1, Cost { steps_s: 1.0, total_s: 1.0 });
        model.learn(200.0, 1, Cost { steps_s: 1000.0, total_s: 1000.0 });
        let cost = model.predict(&plan(2000.0, 1)).unwrap();
        assert!((cost.steps_s / (1000.0 * 10.0_f64.powf(POWERS.1)) - 1.0).abs() < 1e-12);
        model.learn(50.0, 0, Cost { steps_s: 1.0, total_s: 1.0 });
        assert_eq!(model.samples.len(), 2);
    }
}
