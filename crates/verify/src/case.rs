//! One simulation: its settings, its run, and the row of errors that comes out.

use std::fmt;
use std::time::Instant;

use cpu_time::ProcessTime;
use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{
    AtTime, BodyForce, Integrator, Particles, Scalar, SetupError, Shape, Solver, StepError,
    Transfer,
};
use mmsmith_solutions::{AnySolution, BodyForceAtPoints, Material, Real, Solution};
use nalgebra::SVector;
use serde::{Serialize, Serializer};
use thiserror::Error;

use crate::checkpoint::{CheckpointError, Checkpoints, Reached, TakenUp};
use crate::dimension::in_arithmetic;
use crate::frames::{FrameOutput, FrameWriter, Snapshot};
use crate::history::{Moment, Recorder};
use crate::measure::Comparison;
use crate::norms::{Field, PerField, PerNorm, magnitude};
use crate::plan::{MOST_STEPS, Steps, prepare};
use crate::points;
use crate::scene::{Extent, Scene, SceneError};
use crate::total::{CflSpeed, Frame};
use crate::updated::{self, Placement};

/// How the centred-difference integrator gets its first velocity, half a step before the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The exact velocity at minus half a step.
    Exact,
    /// From the data at time zero: `v0 - dt/2 a0`.
    Data,
    /// The velocity at time zero, with the first step's acceleration halved.
    Halved,
}

/// The name that the field has for it.
impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Exact => "exact",
            Self::Data => "data",
            Self::Halved => "halved",
        })
    }
}

/// The settings of one simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The weights between particles and grid.
    pub shape: Shape,
    /// The time integrator.
    pub integrator: Integrator,
    /// The start of centred differences; the other integrators ignore it.
    pub start: Start,
    /// How particles get their velocity back from the grid; without meaning in the total frame.
    pub transfer: Transfer,
    /// Where the particles of the updated frame lie.
    pub placement: Placement,
    /// Number of cells along the solution's cell length.
    pub cells: usize,
    /// Particles in a cell along each direction.
    pub per_cell: usize,
    /// `dt c/h` asked for; the step is then shortened so that whole steps end at the end time.
    pub cfl: f64,
    /// The end time in periods of the solution.
    pub periods: f64,
    /// How much of an annulus is modelled; `None` chooses the quarter where symmetry allows it.
    pub extent: Option<Extent>,
    /// The configuration that weights belong to; in the total frame `shape` has no meaning.
    pub frame: Frame,
    /// The speed `c` that `cfl` refers to.
    pub cfl_speed: CflSpeed,
    /// By how much the lattice of particles is shifted along every axis, in units of the particles' distance, at most
    /// half of it either way: with 0 they are at the centres of equal parts of a cell, with 0.5 some are on cell edges,
    /// and on the upper walls.
    pub offset: f64,
}

impl Default for Case {
    /// The settings of the original study that gave the best accuracy, on 32 cells.
    fn default() -> Self {
        Self {
            shape: Shape::Gimp,
            integrator: Integrator::Cd,
            start: Start::Halved,
            transfer: Transfer::Flip,
            placement: Placement::Lattice,
            cells: 32,
            per_cell: 2,
            cfl: 0.4,
            periods: 1.0,
            extent: None,
            frame: Frame::Updated,
            cfl_speed: CflSpeed::Bar,
            offset: 0.0,
        }
    }
}

/// The precision in which the solver computes; errors are always measured in double precision.
#[derive(Clone, Copy)]
pub enum Arithmetic<'a> {
    /// `f64`.
    Double,
    /// `f32`, with the solution built in that precision for the body force.
    Single(&'a AnySolution<f32>),
}

/// How far a run or a study is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The number of the case under way, from 0.
    pub case: usize,
    /// Steps done in it.
    pub step: u64,
    /// Steps to its end.
    pub steps: u64,
    /// The share of all work that is done, where a particle's step is the unit of work.
    pub share: f64,
}

/// What a run tells and writes on its way.
pub struct Outputs<'a> {
    /// Called after every step.
    pub progress: &'a mut dyn FnMut(Progress),
    /// Particle files, if any are wanted.
    pub frames: Option<&'a FrameOutput>,
    /// A moment whose particles are kept, if one is wanted.
    pub snapshot: Option<&'a mut Snapshot>,
    /// What a run that is killed goes on from, if that is wanted.
    pub checkpoints: Option<&'a Checkpoints>,
    /// Where errors, energies and momentum go at up to [`MOST_MOMENTS`](crate::MOST_MOMENTS) evenly spread steps, first and
    /// last state included; what is there before the run is removed. A run that goes on from a checkpoint has those before it, if it was written with
    /// a history.
    pub history: Option<&'a mut Vec<Moment>>,
    /// When to give up: a run that is still under way then ends after its step with [`Status::Cut`].
    pub until: Option<Instant>,
}

impl<'a> Outputs<'a> {
    /// Nothing but what is called after every step.
    pub fn new(progress: &'a mut dyn FnMut(Progress)) -> Self {
        Self {
            progress,
            frames: None,
            snapshot: None,
            checkpoints: None,
            history: None,
            until: None,
        }
    }
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// At the end time.
    Ok,
    /// The solver gave up.
    Stopped(StepError),
    /// A particle was further from its exact position than the body is large.
    Unstable {
        /// The step, from 1.
        step: u64,
        /// Its time.
        time: f64,
        /// The particle of largest error.
        particle: usize,
        /// Its error, a length.
        error: f64,
        /// The body's largest extent.
        size: f64,
    },
    /// At the end time, but the motion is too small to be told from rest in the positions' precision, so that the errors say
    /// nothing.
    Unresolved {
        /// The largest displacement of the exact motion that was seen.
        displacement: f64,
        /// The rounding of a position.
        resolution: f64,
    },
    /// At the end time, with an error that is not a number.
    NotFinite {
        /// The field.
        field: Field,
    },
    /// The time that it was given was over.
    Cut {
        /// The last step done.
        step: u64,
        /// Its time.
        time: f64,
    },
}

impl Status {
    /// Whether the run came to its end time, and its errors say nothing all the same.
    #[must_use]
    pub fn is_not_judged(&self) -> bool {
        matches!(self, Self::Unresolved { .. } | Self::NotFinite { .. })
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("ok"),
            Self::Stopped(error) => error.fmt(f),
            Self::Unstable { step, time, particle, error, size } => write!(
                f,
                "unstable: position error {error:.3e} exceeds the body's size {size:.3e} at step {step}, \
                 t = {time:.6e}, particle {particle}"
            ),
            Self::Unresolved { displacement, resolution } => write!(
                f,
                "not judged: the largest displacement {displacement:.3e} is below the rounding {resolution:.3e} of \
                 positions; errors say nothing"
            ),
            Self::NotFinite { field } => {
                write!(f, "not judged: an error of {field} is not a finite number")
            }
            Self::Cut { step, time } => {
                write!(f, "cut after step {step}, t = {time:.6e}: its time was over")
            }
        }
    }
}

impl Serialize for Status {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What one simulation gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Number of cells along the cell length.
    pub cells: usize,
    /// Grid spacing, a length.
    pub h: f64,
    /// Time step.
    pub dt: f64,
    /// `dt c/h`.
    pub cfl: f64,
    /// Steps to the end time, whether or not the run got there.
    pub steps: u64,
    /// Number of particles.
    pub particles: usize,
    /// Wall-clock time of the steps alone, without set-up, measuring and writing, in seconds.
    pub wall_s: f64,
    /// Processor time of the steps on all threads, in seconds.
    pub cpu_s: f64,
    /// Particles times steps done over `wall_s`.
    pub particle_steps_per_s: f64,
    /// Whether no other case of the same study ran beside it: where one did, its times are those of a shared machine.
    /// Written where it is false.
    #[serde(skip_serializing_if = "is_true")]
    pub timed_alone: bool,
    /// How it ended.
    pub status: Status,
    /// The errors until then.
    pub errors: PerField<PerNorm<f64>>,
}

fn is_true(value: &bool) -> bool {
    *value
}

/// Why a case could not be run.
#[derive(Debug, Error)]
pub enum CaseError {
    /// A setting that makes no sense.
    #[error("{setting} = {value}: it must be {admissible}")]
    Setting {
        /// Which.
        setting: &'static str,
        /// Its value.
        value: String,
        /// What would be right.
        admissible: &'static str,
    },
    /// More steps than anybody can wait for.
    #[error(
        "the end time {end:e} with steps of {dt:e} takes {steps:e} steps; at most {MOST_STEPS:e} are allowed"
    )]
    TooManySteps {
        /// The end time.
        end: f64,
        /// The time step.
        dt: f64,
        /// The number of steps.
        steps: f64,
    },
    /// The solution of the body force and the exact one differ in dimension, or have one that is not known here.
    #[error(
        "the solutions of both precisions must have one, two or three dimensions, and the same"
    )]
    Dimension,
    /// The solution has no place on a grid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The solver refused the set-up.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A particle file could not be written.
    #[error(transparent)]
    Frames(#[from] mmsmith_vtk::Error),
    /// A checkpoint could not be written or read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl Case {
    /// Checks the settings that need no solution to be judged.
    ///
    /// # Errors
    ///
    /// [`CaseError::Setting`] for a count of zero, or a number that is not positive and finite.
    pub fn validate(&self) -> Result<(), CaseError> {
        for (setting, value) in [("cells", self.cells), ("ppc", self.per_cell)] {
            if value == 0 {
                let value = value.to_string();
                return Err(CaseError::Setting { setting, value, admissible: "at least 1" });
            }
        }
        for (setting, value) in [("cfl", self.cfl), ("periods", self.periods)] {
            if !(value > 0.0 && value.is_finite()) {
                let (value, admissible) = (format!("{value:?}"), "a positive number");
                return Err(CaseError::Setting { setting, value, admissible });
            }
        }
        if !(-0.5..=0.5).contains(&self.offset) {
            let (setting, value) = ("offset", format!("{:?}", self.offset));
            return Err(CaseError::Setting { setting, value, admissible: "from -0.5 to 0.5" });
        }
        match &self.frame {
            Frame::Updated => updated::validate(self),
            Frame::Total(total) => total.validate(self),
        }
    }

    /// Whether the steps are shared among threads. Errors always are.
    #[must_use]
    pub fn steps_on_threads(&self) -> bool {
        self.frame == Frame::Updated
    }
}

/// Runs one simulation of `exact` and measures its errors after every step.
///
/// The solver starts from the exact positions, velocities and deformation gradients at time zero and is driven
/// by the body force at the reference positions. `u` is compared as `(x - X) - u(X, t)`, `v` at the time where
/// the integrator stores it, `F` directly, and `P` as the solver's own law gives it for the particle's `F`.
/// A run that the solver gives up, or whose particles leave the exact ones by more than the body's size, ends
/// early with a [`Status`] that says so; it is not an error of this function.
///
/// The errors do not depend on the number of threads.
///
/// # Errors
///
/// [`CaseError`] for settings that cannot be run, and for particle files that cannot be written.
pub fn run(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    case: &Case,
    outputs: &mut Outputs<'_>,
) -> Result<Row, CaseError> {
    in_arithmetic!(
        exact,
        arithmetic,
        |exact, model| run_in(exact, model, case, outputs),
        else Err(CaseError::Dimension)
    )
}

fn run_in<T: Real + Scalar<D>, const D: usize>(
    exact: &dyn Solution<f64, D>,
    model: &dyn Solution<T, D>,
    case: &Case,
    outputs: &mut Outputs<'_>,
) -> Result<Row, CaseError> {
    let (scene, steps) = prepare(exact, case)?;
    let time_step: T = Real::nearest(steps.dt);
    // In single precision the solver's step is a rounded one, and its time is a multiple of that.
    let dt = time_step.to_f64();

    let (mut solver, body_force) = set_up(exact, model, case, &scene, time_step)?;
    let steps = Steps { dt, ..steps };
    let mut row = follow(solver.as_mut(), &body_force, exact, case, &scene, steps, outputs)?;
    if row.status == Status::Ok {
        let unit = T::default_epsilon().to_f64() / 2.0;
        let end = steps.count as f64 * dt;
        row.status = judged(exact, &row.errors, end, unit * scene.reach());
    }
    Ok(row)
}

/// The status of a run that came to its end: whether its errors say anything.
fn judged<const D: usize>(
    exact: &dyn Solution<f64, D>,
    errors: &PerField<PerNorm<f64>>,
    end: f64,
    resolution: f64,
) -> Status {
    const SAMPLES: usize = 64;
    let domain = exact.domain();
    // Periodic motion repeats.
    let span = end.min(exact.period());
    let seen = (0..SAMPLES).filter_map(|n| points::interior(&domain, span, n));
    let displacement = seen
        .flat_map(|(X, t)| [0.0, t].map(|t| exact.displacement(&X, t)))
        .map(|u| magnitude(u.iter().copied()))
        .fold(0.0, f64::max);
    // A body at rest is at rest in every precision.
    if displacement > 0.0 && displacement <= resolution {
        return Status::Unresolved { displacement, resolution };
    }
    errors
        .iter()
        .find(|(_, norms)| norms.iter().any(|(_, value)| !value.is_finite()))
        .map_or(Status::Ok, |(field, _)| Status::NotFinite { field })
}

/// Steps to the end and measures the errors on the way.
fn follow<T: Real, const D: usize>(
    solver: &mut dyn Solver<T, D>,
    body_force: &dyn BodyForce<T, D>,
    exact: &dyn Solution<f64, D>,
    case: &Case,
    scene: &Scene<D>,
    steps: Steps,
    outputs: &mut Outputs<'_>,
) -> Result<Row, CaseError> {
    let dt = steps.dt;
    let lag = solver.velocity_lag().to_f64();
    let comparison = Comparison::new(exact, &solver.observe().0.X);
    let mut frames = match outputs.frames {
        Some(output) => Some(FrameWriter::new(output, steps.count, lag)?),
        None => None,
    };
    let mut recorder = match &mut outputs.history {
        Some(moments) => Some(Recorder::new(moments, exact, law(exact.material())?, steps.count)),
        None => None,
    };
    let resumed = match outputs.checkpoints.filter(|checkpoints| checkpoints.resume) {
        Some(checkpoints) => checkpoints.read(&mut solver.state())?,
        None => None,
    };
    let Reached { step: mut done, mut wall_s, mut cpu_s, mut errors } =
        if let Some(TakenUp { reached, history }) = resumed {
            if let Some(recorder) = &mut recorder {
                recorder.take_up(history);
            }
            if let Some(frames) = &mut frames {
                frames.take_up(reached.step, dt);
            }
            reached
        } else {
            if let Some(frames) = &mut frames {
                frames.write(solver.observe(), exact, 0, 0.0)?;
            }
            if let Some(snapshot) = &mut outputs.snapshot {
                snapshot.take(solver.observe(), exact, (0, steps.count), 0.0);
            }
            let at_start = comparison.measure(solver.observe(), 0.0, lag);
            if let Some(recorder) = &mut recorder {
                let velocity_time = if starts_early(case) { -lag } else { 0.0 };
                let particles = solver.observe().0;
                recorder.take(particles, (0, false), (0.0, velocity_time), at_start.u);
            }
            // Before the first step no velocity is stored yet that belongs to a time of the scheme.
            Reached {
                step: 0,
                wall_s: 0.0,
                cpu_s: 0.0,
                errors: PerField { v: PerNorm::default(), ..at_start },
            }
        };
    let mut status = Status::Ok;
    for step in done + 1..=steps.count {
        let (computing, started) = (ProcessTime::now(), Instant::now());
        let outcome = solver.step(body_force);
        wall_s += started.elapsed().as_secs_f64();
        cpu_s += computing.elapsed().as_secs_f64();
        if let Err(error) = outcome {
            status = Status::Stopped(error);
            break;
        }
        done = step;
        let time = step as f64 * dt;
        let measured = comparison.measure(solver.observe(), time, lag);
        errors = PerField::combine(&errors, &measured, PerNorm::larger);
        let error = measured.u.linf;
        if error > scene.size || error.is_nan() {
            let particle = comparison.worst_particle(solver.observe(), time);
            status = Status::Unstable { step, time, particle, error, size: scene.size };
        }
        if let Some(frames) = &mut frames {
            frames.write(solver.observe(), exact, step, time)?;
        }
        if let Some(snapshot) = &mut outputs.snapshot {
            snapshot.take(solver.observe(), exact, (step, steps.count), time);
        }
        let share = step as f64 / steps.count as f64;
        (outputs.progress)(Progress { case: 0, step, steps: steps.count, share });
        let late = step < steps.count && outputs.until.is_some_and(|until| Instant::now() >= until);
        if late && status == Status::Ok {
            status = Status::Cut { step, time };
        }
        if let Some(recorder) = &mut recorder {
            let is_last = status != Status::Ok;
            let particles = solver.observe().0;
            recorder.take(particles, (step, is_last), (time, time - lag), measured.u);
        }
        if status != Status::Ok {
            break;
        }
        if let Some(checkpoints) = outputs.checkpoints
            && step % checkpoints.every == 0
        {
            let history = recorder.as_ref().map_or(&[][..], Recorder::moments);
            checkpoints.write(
                &Reached { step, wall_s, cpu_s, errors },
                history,
                &solver.state(),
            )?;
        }
    }
    let count = solver.observe().0.len();
    let particle_steps = count as f64 * done as f64;
    Ok(Row {
        cells: case.cells,
        h: scene.spacing,
        dt,
        cfl: steps.cfl,
        steps: steps.count,
        particles: count,
        wall_s,
        cpu_s,
        particle_steps_per_s: if wall_s > 0.0 { particle_steps / wall_s } else { 0.0 },
        timed_alone: true,
        status,
        errors,
    })
}

/// A solver at time zero, and the body force that drives it.
type Driven<'a, T, const D: usize> = (Box<dyn Solver<T, D> + 'a>, ExactBodyForce<'a, T, D>);

/// The solver of a case with steps of `time_step`, and the body force that drives it.
pub(crate) fn set_up<'a, T: Real + Scalar<D>, const D: usize>(
    exact: &'a dyn Solution<f64, D>,
    model: &'a dyn Solution<T, D>,
    case: &Case,
    scene: &Scene<D>,
    time_step: T,
) -> Result<Driven<'a, T, D>, CaseError> {
    let mut solver = updated::solver(exact, model, case, scene, time_step)?;
    let body_force = ExactBodyForce::new(model, &solver.observe().0.X);
    Ok((solver, body_force))
}

/// Whether the first step's acceleration is halved.
pub(crate) fn starts_halved(case: &Case) -> bool {
    case.integrator == Integrator::Cd && case.start == Start::Halved
}

/// Whether the first velocities are those of half a step before the start.
fn starts_early(case: &Case) -> bool {
    case.integrator == Integrator::Cd && case.start != Start::Halved
}

/// The exact body force at the particles; what depends on their reference positions alone is kept.
pub(crate) struct ExactBodyForce<'a, T: Real, const D: usize> {
    kept: Box<dyn BodyForceAtPoints<T, D> + 'a>,
    model: &'a dyn Solution<T, D>,
    planted: Planted,
}

impl<'a, T: Real, const D: usize> ExactBodyForce<'a, T, D> {
    pub(crate) fn new(model: &'a dyn Solution<T, D>, X: &[SVector<T, D>]) -> Self {
        Self { kept: model.body_force_at(X), model, planted: Planted::here() }
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

/// The solver's hand-written law with the constants of the solution's material.
pub(crate) fn law<T: Real>(material: Material<T>) -> Result<mmsmith_mpm::Material<T>, SceneError> {
    use mmsmith_mpm::Material as Law;
    let planted = Planted::here();
    Ok(match material {
        Material::NeoHookean { lambda, mu } if planted.is(Fault::LambdaForMu) => {
            Law::NeoHookean { lambda: mu, mu: lambda }
        }
        Material::NeoHookean { lambda, mu } if planted.is(Fault::StiffnessOff) => {
            let factor = T::nearest(1.0 + 1e-6);
            Law::NeoHookean { lambda: lambda * factor, mu: mu * factor }
        }
        Material::NeoHookean { lambda, mu } => Law::NeoHookean { lambda, mu },
        Material::StVenantKirchhoff { lambda, mu } => Law::StVenantKirchhoff { lambda, mu },
        Material::Hencky { lambda, mu } => Law::Hencky { lambda, mu },
        Material::LinearElastic { lambda, mu } => Law::LinearElastic { lambda, mu },
        Material::MooneyRivlin { c1, c2, lambda } => Law::MooneyRivlin { c1, c2, lambda },
        Material::Custom => return Err(SceneError::NoLaw),
        other => {
            return Err(SceneError::Unknown { what: "material", value: format!("{other:?}") });
        }
    })
}

/// Gives particles at rest the exact state at time zero, with the velocity that the integrator starts from.
pub(crate) fn set_in_motion<T: Real, const D: usize>(
    particles: &mut Particles<T, D>,
    exact: &dyn Solution<f64, D>,
    case: &Case,
    dt: f64,
) {
    for p in 0..particles.len() {
        let X = particles.X[p].map(Real::to_f64);
        let v = match (case.integrator, case.start) {
            (Integrator::Cd, Start::Exact) => exact.velocity(&X, -dt / 2.0),
            (Integrator::Cd, Start::Data) => {
                exact.velocity(&X, 0.0) - exact.acceleration(&X, 0.0) * (dt / 2.0)
            }
            _ => exact.velocity(&X, 0.0),
        };
        particles.x[p] = (X + exact.displacement(&X, 0.0)).map(Real::nearest);
        particles.v[p] = v.map(Real::nearest);
        particles.F[p] = exact.deformation_gradient(&X, 0.0).map(Real::nearest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn senseless_settings_are_named() {
        for (case, name) in [
            (Case { cells: 0, ..Case::default() }, "cells = 0"),
            (Case { per_cell: 0, ..Case::default() }, "ppc = 0"),
            (Case { cfl: -0.4, ..Case::default() }, "cfl = -0.4"),
            (Case { cfl: f64::NAN, ..Case::default() }, "cfl = NaN"),
            (Case { offset: 0.6, ..Case::default() }, "offset = 0.6"),
            (Case { offset: f64::NAN, ..Case::default() }, "offset = NaN"),
            (Case { periods: f64::INFINITY, ..Case::default() }, "periods = inf"),
        ] {
            let message = case.validate().unwrap_err().to_string();
            assert!(message.starts_with(name), "{message}");
        }
    }
}
