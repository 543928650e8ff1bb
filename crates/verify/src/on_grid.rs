//! A case on its grid, in its dimension and the precision of its solver.

use mmsmith_measure::norms::PerField;
use mmsmith_mpm::{Division, division_of_lattice};
use mmsmith_runtime::Solution;

use crate::case::{Case, CflSpeed, Extent, law_of_body};
use crate::error::{CaseError, MOST_STEPS};
use crate::flow::prepare_until;
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

impl Plan {
    /// Particles times steps, which are the same on every machine.
    #[must_use]
    pub fn work(&self) -> f64 {
        self.steps as f64 * self.particles
    }
}

/// A case on its grid, in its dimension and the precision of its solver.
pub(crate) struct OnGrid<'a, T: Precision<D>, const D: usize> {
    pub(crate) exact: &'a dyn Solution<f64, D>,
    /// The solution that drives the solver.
    pub(crate) model: &'a dyn Solution<T, D>,
    pub(crate) case: Case,
    pub(crate) scene: Scene<D>,
    /// The waves that CFL numbers refer to.
    pub(crate) waves: Waves,
    /// The end time.
    pub(crate) end: f64,
    pub(crate) steps: Steps,
}

impl<'a, T: Precision<D>, const D: usize> OnGrid<'a, T, D>
where
    f64: Precision<D>,
{
    /// Judges a case, and puts it on its grid.
    pub(crate) fn prepare(
        exact: &'a dyn Solution<f64, D>,
        model: &'a dyn Solution<T, D>,
        case: &Case,
    ) -> Result<Self, CaseError> {
        case.validate()?;
        let end = case.periods * exact.period();
        // First, since no other scheme would mend it.
        law_of_body::<f64, D>(exact)?;
        let scene = Scene::new(exact, case, end)?;
        let spacing = match &case.scheme {
            Scheme::Total(total) => total.spacing_of_waves(&scene, case.per_cell),
            Scheme::Updated(_) => scene.spacing,
        };
        let waves = Waves { speed: case.cfl_speed.on_grid(exact, spacing)?, spacing };
        let steps = Steps::new(case.cfl, end, waves)?;
        prepare_until(exact, model, end)?;
        if let Scheme::Updated(updated) = &case.scheme {
            updated::admit(&scene, updated)?;
        }
        Ok(Self { exact, model, case: *case, scene, waves, end, steps })
    }

    pub(crate) fn plan(&self) -> Result<Plan, CaseError> {
        let Self { scene, steps, case, .. } = self;
        let per_cell = case.per_cell;
        let kept = Scene::bytes_of_exact(self.exact, size_of::<T>());
        let (particles, bytes) = match &case.scheme {
            Scheme::Updated(updated) => {
                let bytes = updated::bytes_expected(scene, updated, per_cell, size_of::<T>(), kept);
                (scene.particles_expected(per_cell), bytes)
            }
            Scheme::Total(total) => {
                let grid = total.grid(scene, per_cell)?;
                let particles = grid.axes.iter().map(|axis| axis.count(per_cell) as f64).product();
                (particles, scene.bytes_expected(per_cell, size_of::<T>(), kept))
            }
        };
        let round_off = self.rounding() * (steps.count as f64).sqrt();
        Ok(Plan { steps: steps.count, particles, bytes, extent: scene.extent(), round_off })
    }

    /// How many threads a step keeps busy, of a body that fills its grid; in the updated formulation.
    pub(crate) fn division(&self) -> Option<Division> {
        let Self { scene, case, .. } = self;
        case.scheme.updated().filter(|_| !scene.revolves)?;
        division_of_lattice(&scene.grid::<f64>(), case.per_cell)
    }

    /// The rounding error of a position, a length: half a unit in the last place.
    pub(crate) fn rounding(&self) -> f64 {
        T::default_epsilon().to_f64() / 2.0 * self.scene.reach()
    }

    pub(crate) fn floors(&self, u: f64) -> Result<PerField<f64>, CaseError> {
        let speed = CflSpeed::PWave.on_wide_cells(self.exact)?;
        let strain = u / self.scene.spacing;
        let stress = self.exact.density() * speed * speed * strain;
        Ok(PerField { u, v: speed * strain, F: strain, P: stress })
    }

    /// The steps of the case at another CFL number.
    pub(crate) fn steps_at(&self, cfl: f64) -> Result<Steps, CaseError> {
        Case { cfl, ..self.case }.validate()?;
        Steps::new(cfl, self.end, self.waves)
    }
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
