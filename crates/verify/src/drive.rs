//! A solver, what drives it, and the one loop that steps it.

use std::collections::HashSet;
use std::ops::{ControlFlow, RangeInclusive};
use std::sync::Arc;

use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{AtTime, BodyForce, Load, SavedState, SavedStateError, Solver, StepError};
use mmsmith_ranks::{Ranks, gather_by, total};
use mmsmith_runtime::{BodyForceAtPoints, Lattice, Real, Solution};
use nalgebra::{SMatrix, SVector};

use crate::axis::refuse_on_axis;
use crate::clock::Begun;
use crate::error::CaseError;
use crate::interrupt::StepLoop;
use crate::kept_stress::KeptStress;
use crate::on_grid::OnGrid;
use crate::precision::Precision;
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
    /// Wall-clock time of the step alone, in seconds.
    pub(crate) wall_s: f64,
    /// Processor time of the step on all threads, in seconds.
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
    /// The solver of a case at time zero with steps of `time_step`, whatever its formulation. Where `ranks` simulate it together, all of
    /// them call this.
    pub(crate) fn set_up(
        on_grid: &OnGrid<'a, T, D>,
        time_step: f64,
        ranks: Option<&Arc<dyn Ranks>>,
    ) -> Result<Self, CaseError>
    where
        f64: Precision<D>,
    {
        let OnGrid { exact, model, case, scene, .. } = on_grid;
        let (exact, model) = (*exact, *model);
        let time_step: T = Real::nearest(time_step);
        let mut solver: Box<dyn Solver<T, D> + 'a> = match &case.scheme {
            Scheme::Updated(updated) => {
                updated::set_up(exact, model, updated, case, scene, (time_step, ranks))?
            }
            Scheme::Total(_) if ranks.is_some() => {
                let instead = "updated-lagrangian, or start one process";
                return Err(CaseError::setting("formulation", "total-lagrangian", instead));
            }
            Scheme::Total(total) => total::set_up(exact, total, case, scene, time_step)?,
        };
        // Processes whose points differ stop together, or not at all.
        if ranks.is_none() {
            refuse_on_axis(exact, solver.forced())?;
        }
        let body_force = ExactBodyForce::new(model, solver.as_mut(), ranks);
        Ok(Self { solver, body_force, dt: time_step.to_f64() })
    }
}

impl<T: Real, const D: usize> Driven<'_, T, D> {
    /// Goes on from a state that was saved, of which this process has read some parts; a call of all processes.
    pub(crate) fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError> {
        self.solver.take_up(parts)?;
        self.body_force.follow(self.solver.as_mut());
        Ok(())
    }

    /// Does the steps of these numbers, and lets the observer look on after each.
    ///
    /// # Errors
    ///
    /// Errors of the observer, and [`CaseError::Interrupted`]; a solver that gives up is an outcome.
    pub(crate) fn advance<R>(
        &mut self,
        steps: RangeInclusive<u64>,
        observer: &mut dyn FnMut(Stepped<'_, T, D>) -> Seen<R>,
    ) -> Result<Outcome<R>, CaseError> {
        let step_loop = StepLoop::begin();
        for step in steps {
            let begun = Begun::now();
            let outcome = self.solver.step(&self.body_force);
            let [wall_s, cpu_s] = begun.elapsed_s();
            if let Err(error) = outcome {
                return Ok(Outcome::Stopped(error));
            }
            self.body_force.follow(self.solver.as_mut());
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

/// Whether the particles of all processes make a [`Lattice`]; a call of all.
fn is_lattice<T: Real, const D: usize>(ranks: &dyn Ranks, X: &[SVector<T, D>]) -> bool {
    // More than any lattice has, without telling which.
    let most = Lattice::<T, D>::most_layers(usize::MAX) + 1;
    let some = |all: HashSet<u64>| all.into_iter().take(most).collect::<Vec<_>>();
    let mut layers = 0;
    for axis in 0..D {
        let own = some(X.iter().map(|X| X[axis].to_f64().to_bits()).collect());
        let join =
            |all: &mut Vec<u64>, next: Vec<u64>| *all = some(all.drain(..).chain(next).collect());
        layers += gather_by(ranks, own, &join).len();
    }
    // The layers that the first one has counted.
    let most = Lattice::<T, D>::most_layers(total(ranks, X.len() as u64) as usize);
    ranks.largest(u64::from(most > 0 && layers <= most && ranks.rank() == 0)) > 0
}

/// The exact body force at the particles; what depends on their reference positions alone is kept.
struct ExactBodyForce<'a, T: Real, const D: usize> {
    kept: Box<dyn BodyForceAtPoints<T, D> + 'a>,
    model: &'a dyn Solution<T, D>,
    /// The stress on loaded boundaries.
    stress: KeptStress<'a, T, D>,
    planted: Planted,
    /// Where several processes hold the particles, whether all of them make a lattice.
    is_lattice: Option<bool>,
    /// Version of the arrangement that the kept body force is for.
    version: Option<u64>,
}

impl<'a, T: Real, const D: usize> ExactBodyForce<'a, T, D> {
    fn new(
        model: &'a dyn Solution<T, D>,
        solver: &mut (dyn Solver<T, D> + 'a),
        ranks: Option<&Arc<dyn Ranks>>,
    ) -> Self {
        let planted = Planted::here();
        let is_lattice = ranks.map(|ranks| {
            model.has_form_on_lattice() && is_lattice(&**ranks, &solver.observe().0.X)
        });
        let kept = Self::keep(model, solver.forced(), is_lattice);
        let stress = KeptStress::new(model);
        Self { kept, model, stress, planted, is_lattice, version: None }
    }

    /// The body force kept for particles that started at `X`. The particles of one process may make a lattice where all do not, and
    /// the other way round; the bits have to be those of all.
    fn keep(
        model: &'a dyn Solution<T, D>,
        X: &[SVector<T, D>],
        is_lattice: Option<bool>,
    ) -> Box<dyn BodyForceAtPoints<T, D> + 'a> {
        match is_lattice {
            None => model.body_force_at(X),
            Some(is_lattice) => {
                model.body_force_on(X, is_lattice.then(|| Lattice::of_part(X)).flatten())
            }
        }
    }

    /// Takes note of particles that have come from other processes.
    fn follow(&mut self, solver: &mut (dyn Solver<T, D> + 'a)) {
        let version = solver.arrangement().map(|found| found.version);
        if version != self.version {
            self.version = version;
            self.kept = Self::keep(self.model, solver.forced(), self.is_lattice);
        }
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

    fn boundary_stress(&self, loads: &[Load<T, D>], t: T, stress: &mut [SMatrix<T, D, D>]) {
        let kept = self.stress.at(loads.iter().map(|load| load.X), t);
        for (n, (stress, Load { X, .. })) in stress.iter_mut().zip(loads).enumerate() {
            let P = match &kept {
                Some(kept) => kept[n],
                None => self.model.first_piola_kirchhoff(X, t),
            };
            let F = self.model.deformation_gradient(X, t);
            *stress = P * F.transpose() / self.model.jacobian(X, t);
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
