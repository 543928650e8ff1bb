//! What a case comes to, judged before it is run: its steps, its size.

use mmsmith_solutions::{AnySolution, Solution};

use crate::case::{Arithmetic, Case, CaseError};
use crate::dimension::in_dimension;
use crate::norms::PerField;
use crate::scene::{Extent, Scene};
use crate::total::{CflSpeed, Frame};
use crate::updated;

/// Steps that no run should have; a typing error in a CFL number reaches it easily.
pub(crate) const MOST_STEPS: f64 = 1e12;

/// What a case comes to, known without running it.
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
            let (scene, _) = prepare(s, case)?;
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
) -> Result<Plan, CaseError> {
    let (scene, steps) = prepare(exact, case)?;
    let particles = match &case.frame {
        Frame::Updated => {
            updated::admit(&scene, case)?;
            scene.particles_expected(case.per_cell)
        }
        Frame::Total(total) => {
            let grid = total.grid(&scene, case.per_cell)?;
            grid.axes.iter().map(|axis| axis.cells as f64 * case.per_cell as f64).product()
        }
    };
    let kept = Scene::bytes_of_exact(exact, scalar);
    Ok(Plan {
        steps: steps.count,
        particles,
        bytes: match &case.frame {
            Frame::Updated => updated::bytes_expected(&scene, case, scalar, kept),
            Frame::Total(_) => scene.bytes_expected(case.per_cell, scalar, kept),
        },
        extent: scene.extent(),
        round_off: unit * scene.reach() * (steps.count as f64).sqrt(),
    })
}

/// The scene and the steps of a case.
pub(crate) fn prepare<const D: usize>(
    exact: &dyn Solution<f64, D>,
    case: &Case,
) -> Result<(Scene<D>, Steps), CaseError> {
    case.validate()?;
    let end = case.periods * exact.period();
    let scene = Scene::new(exact, case, end)?;
    let steps = Steps::new(case, end, scene.spacing, case.cfl_speed.of(exact)?)?;
    Ok((scene, steps))
}

/// The steps of a run: `count` of equal length `dt` that end exactly at the end time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) count: u64,
    pub(crate) dt: f64,
    pub(crate) cfl: f64,
}

impl Steps {
    fn new(case: &Case, end: f64, spacing: f64, speed: f64) -> Result<Self, CaseError> {
        let longest = case.cfl * spacing / speed;
        let exact = end / longest;
        // Slightly more than a whole number is rounding, not another step.
        let count = (exact - 1e-9).ceil().max(1.0);
        if count.is_nan() || count > MOST_STEPS {
            return Err(CaseError::TooManySteps { end, dt: longest, steps: count });
        }
        let dt = end / count;
        let is_whole = (exact - count).abs() <= 1e-9;
        let cfl = if is_whole { case.cfl } else { dt * speed / spacing };
        Ok(Self { count: count as u64, dt, cfl })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is kept of each particle counts: four numbers for the body force and as many for the state.
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
        let case = Case { cfl: 0.4, ..Case::default() };
        let steps = Steps::new(&case, 0.02, 1.0 / 16.0, 100.0).unwrap();
        assert_eq!((steps.count, steps.cfl), (80, 0.4));
        assert_eq!(steps.dt, 0.02 / 80.0);
        let case = Case { cfl: 0.3, ..Case::default() };
        let steps = Steps::new(&case, 0.02, 1.0 / 16.0, 100.0).unwrap();
        assert_eq!(steps.count, 107);
        assert!((steps.cfl - 32.0 / 107.0).abs() < 1e-15 && steps.cfl < 0.3);
    }

    #[test]
    fn a_step_longer_than_the_end_time_becomes_one_step() {
        let case = Case { cfl: 1e9, ..Case::default() };
        assert_eq!(Steps::new(&case, 0.02, 0.1, 100.0).unwrap().count, 1);
        let case = Case { cfl: 1e-300, ..Case::default() };
        assert!(matches!(Steps::new(&case, 0.02, 0.1, 100.0), Err(CaseError::TooManySteps { .. })));
    }
}
