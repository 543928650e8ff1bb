//! Steps and size of a case, judged before the run.

use mmsmith_measure::norms::PerField;
use mmsmith_runtime::{AnySolution, Solution};

use crate::case::{Arithmetic, Case, CflSpeed, Extent, law};
use crate::dimension::in_dimension;
use crate::error::{CaseError, MOST_STEPS};
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::Scheme;
use crate::updated;

/// Steps, particles and memory of a case, known without a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Number of steps.
    pub steps: u64,
    /// Particles; in the updated frame estimated.
    pub particles: f64,
    /// Memory in bytes, estimated.
    pub bytes: f64,
    /// How much of an annulus is modelled; `None` for other shapes.
    pub extent: Option<Extent>,
    /// The error of `u` that rounding alone may cause, a length: half a unit in the last place of the body's size,
    /// or of its largest coordinate, at each step, added up as a random walk.
    pub round_off: f64,
}

/// Judges a case without running it or allocating memory for it.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run.
pub fn plan(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    case: &Case,
) -> Result<Plan, CaseError> {
    let (scalar, unit) = match arithmetic {
        Arithmetic::Double => (size_of::<f64>(), f64::EPSILON / 2.0),
        Arithmetic::Single(_) => (size_of::<f32>(), f64::from(f32::EPSILON) / 2.0),
    };
    in_dimension!(exact, |s| plan_in(s, scalar, unit, case), else Err(CaseError::Dimension))
}

/// The errors that rounding alone may cause, field by field.
///
/// That of `u` is the plan's. Between neighbouring nodes it differs by as much, so that the deformation gradient has it over
/// the spacing, stresses that times the stiffness, and velocities that times the speed of P-waves, which carry it on.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run.
pub fn round_off(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    case: &Case,
) -> Result<PerField<f64>, CaseError> {
    let u = plan(exact, arithmetic, case)?.round_off;
    in_dimension!(
        exact,
        |s| {
            let scene = prepare(s, case)?.scene;
            let speed = CflSpeed::PWave.of(s)?;
            let strain = u / scene.spacing;
            Ok(PerField { u, v: speed * strain, F: strain, P: s.density() * speed * speed * strain })
        },
        else Err(CaseError::Dimension)
    )
}

fn plan_in<const D: usize>(
    exact: &dyn Solution<f64, D>,
    scalar: usize,
    unit: f64,
    case: &Case,
) -> Result<Plan, CaseError>
where
    f64: Precision<D>,
{
    let Prepared { scene, steps, .. } = prepare(exact, case)?;
    let per_cell = case.per_cell;
    let kept = Scene::bytes_of_exact(exact, scalar);
    let (particles, bytes) = match &case.scheme {
        Scheme::Updated(updated) => {
            let bytes = updated::bytes_expected(&scene, updated, per_cell, scalar, kept);
            (scene.particles_expected(per_cell), bytes)
        }
        Scheme::Total(total) => {
            let grid = total.grid(&scene, per_cell)?;
            let particles =
                grid.axes.iter().map(|axis| axis.cells as f64 * per_cell as f64).product();
            (particles, scene.bytes_expected(per_cell, scalar, kept))
        }
    };
    Ok(Plan {
        steps: steps.count,
        particles,
        bytes,
        extent: scene.extent(),
        round_off: unit * scene.reach() * (steps.count as f64).sqrt(),
    })
}

/// A case that can be run, on its grid.
pub(crate) struct Prepared<const D: usize> {
    pub(crate) scene: Scene<D>,
    /// The waves that the case's CFL number refers to.
    pub(crate) waves: Waves,
    /// The end time.
    pub(crate) end: f64,
    pub(crate) steps: Steps,
}

/// Judges a case, and puts it on its grid.
pub(crate) fn prepare<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &Case,
) -> Result<Prepared<D>, CaseError>
where
    f64: Precision<D>,
{
    case.validate()?;
    let end = case.periods * exact.period();
    // First, since no other scheme would mend it.
    law::<f64, D>(exact.law())?;
    let scene = Scene::new(exact, case, end)?;
    let waves = Waves { speed: case.cfl_speed.of(exact)?, spacing: scene.spacing };
    let steps = Steps::new(case.cfl, end, waves)?;
    if let Scheme::Updated(updated) = &case.scheme {
        updated::admit(&scene, updated)?;
    }
    Ok(Prepared { scene, waves, end, steps })
}

/// Waves that cross the cells of a grid: what time steps and CFL numbers have to do with each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Waves {
    pub(crate) speed: f64,
    pub(crate) spacing: f64,
}

impl Waves {
    /// The time step of a CFL number.
    pub(crate) fn time_step(self, cfl: f64) -> f64 {
        cfl * self.spacing / self.speed
    }

    /// The CFL number of a time step.
    pub(crate) fn cfl(self, time_step: f64) -> f64 {
        time_step * self.speed / self.spacing
    }
}

/// The steps of a run: `count` of equal length `dt` that end exactly at the end time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) count: u64,
    pub(crate) dt: f64,
    pub(crate) cfl: f64,
}

impl Steps {
    fn new(cfl: f64, end: f64, waves: Waves) -> Result<Self, CaseError> {
        let longest = waves.time_step(cfl);
        let count = steps_to(end, longest)?;
        let dt = end / count as f64;
        let is_whole = (end / longest - count as f64).abs() <= 1e-9;
        Ok(Self { count, dt, cfl: if is_whole { cfl } else { waves.cfl(dt) } })
    }
}

/// How many steps of at most `dt` lead to the end time.
pub(crate) fn steps_to(end: f64, dt: f64) -> Result<u64, CaseError> {
    // Slightly more than a whole number is rounding, not another step.
    let steps = (end / dt - 1e-9).ceil().max(1.0);
    if steps.is_nan() || steps > MOST_STEPS {
        return Err(CaseError::TooManySteps { end, dt, steps });
    }
    Ok(steps as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values kept of each particle count: four numbers for the body force and as many for the state.
    #[test]
    fn ten_million_particles_fit_into_four_gibibytes() {
        let exact = mmsmith_solutions::build::<f64>("axis-aligned", &[]).unwrap().unwrap();
        let case = Case { cells: 1581, ..Case::default() };
        let bytes = plan(&exact, Arithmetic::Double, &case).unwrap().bytes;
        assert!((2.0..4.0).contains(&(bytes / 2f64.powi(30))), "{bytes:e}");
        let AnySolution::Two(exact) = exact else { panic!("it is plane") };
        assert_eq!(Scene::bytes_of_exact(exact.as_ref(), size_of::<f64>()), 64);
        assert_eq!(Scene::bytes_of_exact(exact.as_ref(), size_of::<f32>()), 48);
    }

    #[test]
    fn whole_steps_keep_the_cfl_number_and_others_shorten_the_step() {
        let waves = Waves { speed: 100.0, spacing: 1.0 / 16.0 };
        let steps = Steps::new(0.4, 0.02, waves).unwrap();
        assert_eq!((steps.count, steps.cfl), (80, 0.4));
        assert_eq!(steps.dt, 0.02 / 80.0);
        let steps = Steps::new(0.3, 0.02, waves).unwrap();
        assert_eq!(steps.count, 107);
        assert!((steps.cfl - 32.0 / 107.0).abs() < 1e-15 && steps.cfl < 0.3);
    }

    #[test]
    fn a_step_longer_than_the_end_time_becomes_one_step() {
        let waves = Waves { speed: 100.0, spacing: 0.1 };
        assert_eq!(Steps::new(1e9, 0.02, waves).unwrap().count, 1);
        let found = Steps::new(1e-300, 0.02, waves);
        assert!(matches!(found, Err(CaseError::TooManySteps { .. })));
    }
}
