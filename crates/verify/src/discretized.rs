//! A case on its grid: judged once, before the run, and carried to all that plans, runs, times or compares it.

use std::time::Instant;

use mmsmith_measure::norms::PerField;
use mmsmith_mpm::Division;
use mmsmith_runtime::{AnySolution, Solution};

use crate::case::{Arithmetic, Case};
use crate::dimension::in_arithmetic;
use crate::error::{CaseError, StudyError};
use crate::half_plane::{self, HalfPlane};
use crate::observe::{self, Limits, Observed, Scales};
use crate::on_grid::{OnGrid, Plan};
use crate::precision::Precision;
use crate::run::{self, Outputs, Progress, Row};
use crate::temporal::{self, Temporal};
use crate::timing::{self, Timing};

/// A case that can be run, on its grid.
pub struct Discretized<'a> {
    exact: &'a AnySolution<f64>,
    arithmetic: Arithmetic<'a>,
    case: Case,
    plan: Plan,
    floors: PerField<f64>,
    on_grid: Box<dyn Simulate + 'a>,
}

impl<'a> Discretized<'a> {
    /// Judges a case and puts it on its grid, without running it or allocating memory for its particles.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for settings that cannot be run.
    pub fn new(
        exact: &'a AnySolution<f64>,
        arithmetic: Arithmetic<'a>,
        case: &Case,
    ) -> Result<Self, CaseError> {
        if let (AnySolution::Three(exact_in_space), true) = (exact, case.scheme.updated().is_some())
            && let Some(own) = HalfPlane::new(exact_in_space.as_ref())
            && !half_plane::turns_about_axis(exact)
        {
            let (plan, floors, on_grid): (_, _, Box<dyn Simulate + 'a>) = match arithmetic {
                Arithmetic::Double => InHalfPlane::judged(own, exact_in_space.as_ref(), case)?,
                #[cfg(feature = "single-precision")]
                Arithmetic::Single(AnySolution::Three(model)) => {
                    InHalfPlane::judged(own, model.as_ref(), case)?
                }
                Arithmetic::Single(_) => return Err(CaseError::Dimension),
            };
            return Ok(Self { exact, arithmetic, case: *case, plan, floors, on_grid });
        }
        let (plan, floors, on_grid): (_, _, Box<dyn Simulate + 'a>) = in_arithmetic!(
            exact,
            arithmetic,
            |exact, model| {
                let on_grid = OnGrid::prepare(exact, model, case)?;
                let plan = on_grid.plan()?;
                (plan, on_grid.floors(plan.round_off)?, Box::new(on_grid))
            },
            else return Err(CaseError::Dimension)
        );
        Ok(Self { exact, arithmetic, case: *case, plan, floors, on_grid })
    }

    /// Another case of its solution.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with(&self, case: &Case) -> Result<Self, CaseError> {
        Self::new(self.exact, self.arithmetic, case)
    }

    /// The settings.
    #[must_use]
    pub fn case(&self) -> &Case {
        &self.case
    }

    /// The precision of the solver.
    pub(crate) fn arithmetic(&self) -> Arithmetic<'a> {
        self.arithmetic
    }

    /// Steps, particles and memory.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// How many threads a step keeps busy, counted for a body that fills its grid. `None` in the total formulation, and for grids whose
    /// tiles are not soon counted.
    #[must_use]
    pub fn division(&self) -> Option<Division> {
        self.on_grid.division()
    }

    /// The errors that rounding alone may cause, field by field.
    ///
    /// That of `u` is the plan's. Between neighbouring nodes it differs by as much, so that the deformation gradient has it over
    /// the spacing, stresses that times the stiffness, and velocities that times the speed of P-waves, which carry it on.
    #[must_use]
    pub fn floors(&self) -> &PerField<f64> {
        &self.floors
    }

    /// Runs the simulation and measures its errors after every step.
    ///
    /// The solver starts from the exact positions, velocities and deformation gradients at time zero and is driven
    /// by the body force at the reference positions. `u` is compared as `(x - X) - u(X, t)`, `v` at the time where
    /// the integrator stores it, `F` directly, and `P` as the solver's own law gives it for the particle's `F`.
    /// A run that the solver gives up, or whose particles leave the exact ones by more than the body's size, ends
    /// early with a [`Status`](crate::Status) that says so; it is not an error of this function.
    ///
    /// The errors do not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for a scene without particles, and for files that cannot be written.
    pub fn run(&self, outputs: &mut Outputs<'_>) -> Result<Row, CaseError> {
        self.on_grid.run(outputs)
    }

    /// Does at most `most` steps, without measuring errors on the way, and at most until the given moment.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run). A run that the solver gives up is not complete, and no error.
    pub fn time_steps(&self, most: u64, until: Option<Instant>) -> Result<Timing, CaseError> {
        self.on_grid.time_steps(most, until)
    }

    /// Compares, for every CFL number, the run with the one of half the time step; its own CFL number does not matter.
    ///
    /// A CFL number is lowered until its steps divide the run into five equal parts, at whose ends the runs are
    /// compared. `progress` is called after every step.
    ///
    /// # Errors
    ///
    /// [`StudyError`] for the first CFL number that cannot be run; a run that fails on the way is a row with its status.
    pub fn differences(
        &self,
        cfls: &[f64],
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Temporal, StudyError> {
        self.on_grid.differences(cfls, progress)
    }

    /// The scales of runs at other CFL numbers.
    pub(crate) fn scales(&self) -> Result<Scales, CaseError> {
        self.on_grid.scales()
    }

    /// One run at another CFL number until `end`, held against limits where there are some.
    pub(crate) fn observe(
        &self,
        cfl: f64,
        end: f64,
        limits: Option<&Limits>,
    ) -> Result<Observed, CaseError> {
        self.on_grid.observe(cfl, end, limits)
    }
}

/// Puts a case on its grid and [runs](Discretized::run) it.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run, and for files that cannot be written.
pub fn run(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    case: &Case,
    outputs: &mut Outputs<'_>,
) -> Result<Row, CaseError> {
    Discretized::new(exact, arithmetic, case)?.run(outputs)
}

/// Runs on a grid, whatever its dimension and the precision of the solver.
trait Simulate: Send + Sync {
    /// As [`Discretized::run`].
    fn run(&self, outputs: &mut Outputs<'_>) -> Result<Row, CaseError>;
    /// As [`Discretized::time_steps`].
    fn time_steps(&self, most: u64, until: Option<Instant>) -> Result<Timing, CaseError>;
    /// As [`Discretized::differences`].
    fn differences(
        &self,
        cfls: &[f64],
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Temporal, StudyError>;
    /// One run at another CFL number until `end`, held against limits where there are some.
    fn observe(&self, cfl: f64, end: f64, limits: Option<&Limits>) -> Result<Observed, CaseError>;
    /// The scales of runs at other CFL numbers.
    fn scales(&self) -> Result<Scales, CaseError>;
    /// As [`Discretized::division`].
    fn division(&self) -> Option<Division>;
}

/// A case of a body of revolution in its half plane.
struct InHalfPlane<'a, T: Precision<2>> {
    exact: HalfPlane<'a, f64>,
    model: HalfPlane<'a, T>,
    case: Case,
}

/// A case that was judged, its rounding floors, and the runs of it.
type Judged<'a> = (Plan, PerField<f64>, Box<dyn Simulate + 'a>);

impl<'a, T: Precision<2>> InHalfPlane<'a, T> {
    fn judged(
        exact: HalfPlane<'a, f64>,
        model: &'a dyn Solution<T, 3>,
        case: &Case,
    ) -> Result<Judged<'a>, CaseError> {
        let model = HalfPlane::new(model).ok_or(CaseError::Dimension)?;
        let own = Self { exact, model, case: *case };
        let on_grid = own.on_grid()?;
        let plan = on_grid.plan()?;
        let floors = on_grid.floors(plan.round_off)?;
        Ok((plan, floors, Box::new(own)))
    }

    fn on_grid(&self) -> Result<OnGrid<'_, T, 2>, CaseError> {
        let on_grid = OnGrid::prepare(&self.exact, &self.model, &self.case);
        on_grid.map_err(half_plane::named_in_space)
    }
}

impl<T: Precision<2>> Simulate for InHalfPlane<'_, T> {
    fn run(&self, outputs: &mut Outputs<'_>) -> Result<Row, CaseError> {
        self.on_grid()?.run(outputs)
    }

    fn time_steps(&self, most: u64, until: Option<Instant>) -> Result<Timing, CaseError> {
        self.on_grid()?.time_steps(most, until)
    }

    fn differences(
        &self,
        cfls: &[f64],
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Temporal, StudyError> {
        let on_grid = self.on_grid().map_err(|cause| StudyError { index: 0, cause })?;
        on_grid.differences(cfls, progress)
    }

    fn observe(&self, cfl: f64, end: f64, limits: Option<&Limits>) -> Result<Observed, CaseError> {
        self.on_grid()?.observe(cfl, end, limits)
    }

    fn scales(&self) -> Result<Scales, CaseError> {
        self.on_grid()?.scales()
    }

    fn division(&self) -> Option<Division> {
        self.on_grid().ok()?.division()
    }
}

impl<T: Precision<D>, const D: usize> Simulate for OnGrid<'_, T, D>
where
    f64: Precision<D>,
{
    fn division(&self) -> Option<Division> {
        OnGrid::division(self)
    }

    fn run(&self, outputs: &mut Outputs<'_>) -> Result<Row, CaseError> {
        run::follow(self, outputs)
    }

    fn time_steps(&self, most: u64, until: Option<Instant>) -> Result<Timing, CaseError> {
        timing::time_steps(self, most, until)
    }

    fn differences(
        &self,
        cfls: &[f64],
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Temporal, StudyError> {
        temporal::over(self, cfls, progress)
    }

    fn observe(&self, cfl: f64, end: f64, limits: Option<&Limits>) -> Result<Observed, CaseError> {
        observe::observe(self, cfl, end, limits)
    }

    fn scales(&self) -> Result<Scales, CaseError> {
        observe::scales(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// Values kept of each particle count: four numbers for the body force and as many for the state.
    #[test]
    fn ten_million_particles_fit_into_four_gibibytes() {
        let exact = mmsmith_solutions::build::<f64>("axis-aligned", &[]).unwrap().unwrap();
        let case = Case { cells: 1581, ..Case::default() };
        let bytes = Discretized::new(&exact, Arithmetic::Double, &case).unwrap().plan().bytes;
        assert!((2.0..4.0).contains(&(bytes / 2f64.powi(30))), "{bytes:e}");
        let AnySolution::Two(exact) = exact else { panic!("it is plane") };
        assert_eq!(Scene::bytes_of_exact(exact.as_ref(), size_of::<f64>()), 64);
        assert_eq!(Scene::bytes_of_exact(exact.as_ref(), size_of::<f32>()), 48);
    }
}
