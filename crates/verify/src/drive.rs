//! A solver, what drives it, and the one loop that steps it.

use std::ops::{ControlFlow, RangeInclusive};
use std::time::Instant;

use cpu_time::ProcessTime;
use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{AtTime, BodyForce, Solver, StepError};
use mmsmith_runtime::{BodyForceAtPoints, Real, Solution};
use nalgebra::{SMatrix, SVector};

use crate::case::Case;
use crate::error::CaseError;
use crate::interrupt::StepLoop;
use crate::precision::Precision;
use crate::scene::Scene;
use crate::scheme::Scheme;
use crate::{total, updated};

/// A solver with the body force that drives it.
pub(crate) struct Driven<'a, T: Real, const D: usize> {
    pub(crate) solver: Box<dyn Solver<T, D> + 'a>,
    body_force: ExactBodyForce<'a, T, D>,
    /// In single precision the solver's step is a rounded one, and its time is a multiple of that.
    pub(crate) dt: f64,
}

/// A solver after one of its steps.
pub(crate) struct Stepped<'a, T, const D: usize> {
    /// The step, from 1.
    pub(crate) step: u64,
    /// The time of positions and deformation gradients.
    pub(crate) time: f64,
    pub(crate) solver: &'a mut (dyn Solver<T, D> + 'a),
    /// What the step alone took, in seconds.
    pub(crate) wall_s: f64,
    /// The same on all threads' processors.
    pub(crate) cpu_s: f64,
    /// Whether stepping ends here because it was asked to.
    pub(crate) is_interrupted: bool,
}

/// How stepping ended.
pub(crate) enum Outcome<R> {
    /// All steps are done.
    Done,
    /// The solver gave up.
    Stopped(StepError),
    /// The observer had seen enough.
    Left(R),
}

/// Whether stepping goes on, or what an observer leaves it with.
pub(crate) type Seen<R> = Result<ControlFlow<R>, CaseError>;

impl<'a, T: Precision<D>, const D: usize> Driven<'a, T, D> {
    /// The solver of a case at time zero with steps of `time_step`, whatever its formulation.
    pub(crate) fn set_up(
        exact: &'a dyn Solution<f64, D>,
        model: &'a dyn Solution<T, D>,
        case: &Case,
        scene: &Scene<D>,
        time_step: f64,
    ) -> Result<Self, CaseError>
    where
        f64: Precision<D>,
    {
        let time_step: T = Real::nearest(time_step);
        let (mut solver, loaded) = match &case.scheme {
            Scheme::Updated(updated) => {
                let set_up = updated::set_up(exact, model, updated, case, scene, time_step)?;
                let solver: Box<dyn Solver<T, D>> = set_up.solver;
                (solver, set_up.loaded)
            }
            Scheme::Total(total) => {
                (total::set_up(exact, total, case, scene, time_step)?, Vec::new())
            }
        };
        let body_force = ExactBodyForce::new(model, &solver.observe().0.X, loaded);
        Ok(Self { solver, body_force, dt: time_step.to_f64() })
    }
}

impl<T: Real, const D: usize> Driven<'_, T, D> {
    /// Does the steps of these numbers, and lets the observer look on after each.
    ///
    /// # Errors
    ///
    /// Those of the observer, and [`CaseError::Interrupted`]; a solver that gives up is an outcome.
    pub(crate) fn advance<R>(
        &mut self,
        steps: RangeInclusive<u64>,
        observer: &mut dyn FnMut(Stepped<'_, T, D>) -> Seen<R>,
    ) -> Result<Outcome<R>, CaseError> {
        let step_loop = StepLoop::begin();
        for step in steps {
            let (computing, started) = (ProcessTime::now(), Instant::now());
            let outcome = self.solver.step(&self.body_force);
            let (wall_s, cpu_s) =
                (started.elapsed().as_secs_f64(), computing.elapsed().as_secs_f64());
            if let Err(error) = outcome {
                return Ok(Outcome::Stopped(error));
            }
            let (time, solver) = (step as f64 * self.dt, self.solver.as_mut());
            let is_interrupted = step_loop.is_interrupted();
            if let ControlFlow::Break(found) =
                observer(Stepped { step, time, solver, wall_s, cpu_s, is_interrupted })?
            {
                return Ok(Outcome::Left(found));
            }
            if is_interrupted {
                return Err(CaseError::Interrupted { step, time });
            }
        }
        Ok(Outcome::Done)
    }
}

/// The exact body force at the particles; what depends on their reference positions alone is kept.
struct ExactBodyForce<'a, T: Real, const D: usize> {
    kept: Box<dyn BodyForceAtPoints<T, D> + 'a>,
    model: &'a dyn Solution<T, D>,
    /// Reference positions of points of the boundary with the exact stress, in the updated frame.
    loaded: Vec<SVector<T, D>>,
    planted: Planted,
}

impl<'a, T: Real, const D: usize> ExactBodyForce<'a, T, D> {
    fn new(model: &'a dyn Solution<T, D>, X: &[SVector<T, D>], loaded: Vec<SVector<T, D>>) -> Self {
        Self { kept: model.body_force_at(X), model, loaded, planted: Planted::here() }
    }
}

impl<T: Real, const D: usize> BodyForce<T, D> for ExactBodyForce<'_, T, D> {
    fn evaluate(&self, first: usize, X: &[SVector<T, D>], t: T, b: &mut [SVector<T, D>]) {
        if self.planted.is(Fault::BodyForceAtCurrentPosition) {
            b.iter_mut().zip(X).for_each(|(b, x)| *b = self.model.body_force(x, t));
            return;
        }
        self.kept.evaluate(t, first, b);
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        self.kept.of_time(t, values);
    }

    fn boundary_stress(&self, t: T, stress: &mut [SMatrix<T, D, D>]) {
        for (stress, X) in stress.iter_mut().zip(&self.loaded) {
            let F = self.model.deformation_gradient(X, t);
            *stress =
                self.model.first_piola_kirchhoff(X, t) * F.transpose() / self.model.jacobian(X, t);
        }
    }

    fn evaluate_of(
        &self,
        ids: &[u32],
        _X: &[SVector<T, D>],
        time: AtTime<'_, T>,
        b: &mut [SVector<T, D>],
    ) {
        self.kept.evaluate_of(time.values, ids, b);
    }
}
