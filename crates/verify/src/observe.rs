//! One run that is looked at for instability.

use std::ops::ControlFlow;

use mmsmith_mpm::{Law, Particles, StepError};
use mmsmith_runtime::{Real, Solution};
use serde::{Deserialize, Serialize};

use crate::case::{CflSpeed, law_of_body};
use crate::drive::{Driven, Outcome, Stepped};
use crate::error::CaseError;
use crate::flow::prepare_until;
use crate::history::Totals;
use crate::on_grid::{OnGrid, steps_to};
use crate::precision::Precision;
use crate::scene::Scene;

/// The kind of an instability.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// `J <= 0`; the value is J.
    Inverted,
    /// A position or deformation gradient is not finite.
    NotFinite,
    /// A particle left the grid; the value is its coordinate.
    LeftGrid,
    /// A particle's box is larger than its weights support; the value is its half-size.
    TooLarge,
    /// The error of `u` is above the limit.
    Error,
    /// The energy gained, in units of the exact motion's largest, is above the limit.
    Energy,
}

/// When and where a run became unstable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The kind.
    pub kind: FailureKind,
    /// The step, from 1.
    pub step: u64,
    /// Its time.
    pub time: f64,
    /// The particle; none for the energy of all.
    pub particle: Option<usize>,
    /// The value that gave it away; none where it is not a finite number.
    pub value: Option<f64>,
    /// The limit of that value.
    pub limit: Option<f64>,
}

/// Observations of one run until its end, or until it became unstable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observed {
    /// The CFL number.
    pub cfl: f64,
    /// Steps done.
    pub steps: u64,
    /// The largest error of `u`, a length.
    pub error: Option<f64>,
    /// The largest difference between the energy and that of the exact motion, gain or loss, in units of the exact
    /// motion's largest; none where the law has no strain energy.
    pub energy_drift: Option<f64>,
    /// The largest difference between the momentum and that of the exact motion, in units of the largest sum of all
    /// particles' exact momenta's magnitudes.
    pub momentum_drift: Option<f64>,
    /// How it became unstable, if it did.
    pub failure: Option<Failure>,
}

/// The least length of a run, in times that waves take to cross a cell.
const LEAST_CELLS: f64 = 64.0;
/// Rounding errors of `u` are a random walk; what is far above its length is not rounding.
const FLOOR: f64 = 100.0;
/// The scales of runs of a case, whatever their CFL number.
#[derive(Clone, Copy)]
pub(crate) struct Scales {
    /// The CFL number at which that of P-waves is one.
    pub(crate) p_wave_limit: f64,
    /// The length of a run that instabilities have time to grow in.
    pub(crate) end: f64,
    pub(crate) period: f64,
    /// The error of `u` that rounding may cause.
    pub(crate) floor: f64,
}

/// The scales of a case on its grid.
pub(crate) fn scales<T: Precision<D>, const D: usize>(
    on_grid: &OnGrid<'_, T, D>,
) -> Result<Scales, CaseError>
where
    f64: Precision<D>,
{
    let &OnGrid { exact, waves, .. } = on_grid;
    let steps = on_grid.steps_at(0.5)?.count as f64;
    Ok(Scales {
        p_wave_limit: waves.speed / CflSpeed::PWave.on_wide_cells(exact)?,
        end: on_grid.end.max(waves.time_step(LEAST_CELLS)),
        period: exact.period(),
        floor: FLOOR * (on_grid.rounding() * steps.sqrt()),
    })
}

/// Limits that a run is held against.
pub(crate) struct Limits {
    pub(crate) error: f64,
    pub(crate) energy_rate: f64,
    /// The reference run's largest difference of energy; infinite where no energies are known.
    pub(crate) energy_drift: f64,
    /// The case's period.
    pub(crate) period: f64,
    /// Energies are not looked at where rounding could change them by this share of their largest.
    pub(crate) strain_floor: f64,
}

/// Times within a period at which the exact motion's energy is looked at for its largest.
const MOMENTS: usize = 16;

/// One run of a case at another CFL number until `end`, held against limits where there are some.
pub(crate) fn observe<T: Precision<D>, const D: usize>(
    on_grid: &OnGrid<'_, T, D>,
    cfl: f64,
    end: f64,
    limits: Option<&Limits>,
) -> Result<Observed, CaseError>
where
    f64: Precision<D>,
{
    // Not that of any other step: such a CFL number is refused.
    on_grid.steps_at(cfl)?;
    let time_step = on_grid.waves.time_step(cfl);
    // In the solver's precision, which is what it steps with.
    let count = steps_to(end, <T as Real>::nearest(time_step).to_f64())?;
    prepare_until(on_grid.exact, on_grid.model, end)?;
    let mut driven = Driven::set_up(on_grid, time_step, None)?;
    let &OnGrid { exact, ref scene, .. } = on_grid;
    Run { exact, scene, cfl, count, limits }.follow(&mut driven)
}

/// One run.
struct Run<'a, const D: usize> {
    exact: &'a dyn Solution<f64, D>,
    scene: &'a Scene<D>,
    cfl: f64,
    count: u64,
    limits: Option<&'a Limits>,
}

impl<const D: usize> Run<'_, D> {
    fn follow<T: Precision<D>>(&self, driven: &mut Driven<'_, T, D>) -> Result<Observed, CaseError>
    where
        f64: Precision<D>,
    {
        let lag = driven.solver.velocity_lag().to_f64();
        let law = law_of_body::<f64, D>(self.exact)?;
        let scales = self.largest(driven.solver.observe().0, &law);
        let (mut error, mut energy, mut momentum) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut steps = 0;
        let outcome = driven.advance(1..=self.count, &mut |stepped| {
            let Stepped { step, time, solver, .. } = stepped;
            steps = step;
            let particles = solver.observe().0;
            let totals = Totals::of(particles, &law, self.exact, time, time - lag);
            error = error.max(totals.error);
            let gain = match totals.computed.energy() - totals.exact.energy() {
                0.0 => 0.0,
                gain => gain / scales.0,
            };
            // The last step of a run may have no energy, where a particle is inside out.
            energy = if scales.0.is_nan() { f64::NAN } else { energy.max(gain.abs()) };
            let momenta = totals.computed.momentum.iter().zip(&totals.exact.momentum);
            let length = momenta.map(|(p, q)| (p - q) * (p - q)).sum::<f64>().sqrt();
            momentum = momentum.max(length / scales.1);
            let failure = self.judge(step, time, &totals, gain, scales.0);
            Ok(failure.map_or(ControlFlow::Continue(()), ControlFlow::Break))
        })?;
        let failure = match outcome {
            Outcome::Done => None,
            Outcome::Stopped(error) => Some(Failure::from(&error)),
            Outcome::Left(failure) => Some(failure),
        };
        Ok(Observed {
            cfl: self.cfl,
            steps,
            error: finite(error),
            energy_drift: finite(energy),
            momentum_drift: finite(momentum),
            failure,
        })
    }

    fn judge(
        &self,
        step: u64,
        time: f64,
        totals: &Totals<D>,
        gain: f64,
        largest_energy: f64,
    ) -> Option<Failure>
    where
        f64: Precision<D>,
    {
        let failure = |kind, particle, value: f64, limit: f64| {
            let (value, limit) = (finite(value), finite(limit));
            Some(Failure { kind, step, time, particle, value, limit })
        };
        // The reference run, too, ends where it says nothing more.
        let error = self.limits.map_or(f64::INFINITY, |limits| limits.error).min(self.scene.size);
        if totals.error > error || totals.error.is_nan() {
            return failure(FailureKind::Error, Some(totals.worst), totals.error, error);
        }
        let limits = self.limits?;
        let strain = limits.strain_floor / self.scene.spacing;
        let modulus = law_of_body::<f64, D>(self.exact).ok()?.p_wave_modulus();
        let volume = self.scene.size.powi(D as i32);
        let counts = largest_energy > modulus * volume * strain * strain;
        let most = limits.energy_drift + limits.energy_rate * (time / limits.period).max(1.0);
        if counts && gain > most {
            return failure(FailureKind::Energy, None, gain, most);
        }
        None
    }

    /// The largest energy of the exact motion, not a number where its law has none, and the largest sum of its momenta's magnitudes.
    fn largest<T: Real>(&self, particles: &Particles<T, D>, law: &Law<f64, D>) -> (f64, f64)
    where
        f64: Precision<D>,
    {
        let period = self.exact.period();
        let mut largest = (0.0_f64, 0.0_f64);
        for moment in 0..MOMENTS {
            let time = period * moment as f64 / MOMENTS as f64;
            let totals = Totals::of(particles, law, self.exact, time, time);
            let energy = totals.exact.energy();
            largest.0 = if energy <= largest.0 || largest.0.is_nan() { largest.0 } else { energy };
            largest.1 = largest.1.max(totals.exact_momenta);
        }
        largest
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl From<&StepError> for Failure {
    fn from(error: &StepError) -> Self {
        let (kind, step, time, particle, value, limit) = match *error {
            StepError::Inverted { step, time, particle, J } => {
                (FailureKind::Inverted, step, time, particle, J, 0.0)
            }
            StepError::NotFinite { step, time, particle, J, .. } => {
                (FailureKind::NotFinite, step, time, particle, J, f64::NAN)
            }
            StepError::LeftGrid { step, time, particle, ref position, axis, lower, upper } => {
                let at = position.get(axis).copied().unwrap_or(f64::NAN);
                let limit = if at < lower { lower } else { upper };
                (FailureKind::LeftGrid, step, time, particle, at, limit)
            }
            StepError::TooLarge { step, time, particle, half_size, limit, .. } => {
                (FailureKind::TooLarge, step, time, particle, half_size, limit)
            }
        };
        Self {
            kind,
            step: step as u64,
            time,
            particle: Some(particle),
            value: finite(value),
            limit: finite(limit),
        }
    }
}
