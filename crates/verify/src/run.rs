//! One run of a case, and the row of errors that comes out.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::{ControlFlow, Sub};
use std::sync::Arc;
use std::time::Instant;

use mmsmith_measure::norms::{Field, PerField, PerNorm, magnitude};
use mmsmith_mpm::{Profile, Solver, StepError};
use mmsmith_ranks::{Ranks, Sent, Traffic, counted};
use mmsmith_runtime::Solution;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::case::law_of_body;
use crate::checkpoint::{Checkpoints, Reached, TakenUp};
use crate::drive::{Driven, Outcome, Seen, Stepped};
use crate::error::CaseError;
use crate::frames::{FrameOutput, FrameWriter, Snapshot};
use crate::history::{Moment, Recorder};
use crate::measurement::Measurement;
use crate::on_grid::OnGrid;
use crate::points;
use crate::precision::Precision;

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

/// Reports and files of a run on its way.
pub struct Outputs<'a> {
    /// Called after every step.
    pub progress: &'a mut dyn FnMut(Progress),
    /// Particle files, if any are wanted.
    pub frames: Option<&'a FrameOutput>,
    /// A moment whose particles are kept, if one is wanted.
    pub snapshot: Option<&'a mut Snapshot>,
    /// Checkpoints that a killed run goes on from, if they are wanted.
    pub checkpoints: Option<&'a Checkpoints>,
    /// Where errors, energies and momentum go at up to [`MOST_MOMENTS`](crate::MOST_MOMENTS) evenly spread steps, first and
    /// last state included; what is there before the run is removed. A run that goes on from a checkpoint has those before it, if it was written with
    /// a history.
    pub history: Option<&'a mut Vec<Moment>>,
    /// The processes that simulate it together, where there are several. All of them call `run` alike; files other than
    /// particle files and checkpoints are those of rank 0.
    pub ranks: Option<Arc<dyn Ranks>>,
    /// Where it is said what this process sent to the others, if that is wanted.
    pub traffic: Option<&'a mut RunTraffic>,
    /// Where it is said how long the passes of steps took, and how many threads they keep busy, if that is wanted.
    pub profile: Option<&'a mut Profile>,
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
            ranks: None,
            traffic: None,
            profile: None,
            until: None,
        }
    }
}

/// Whether runs give their rows and nothing else: modules of WebAssembly in browsers have no files and no other process, and are compiled without what
/// serves these.
const ROWS_ALONE: bool = cfg!(all(target_family = "wasm", target_os = "unknown"));

/// Messages that one of several processes sent to the others, from the first step to the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunTraffic {
    /// In the steps: nodes that layers of two processes share, and particles that go to another process.
    pub stepping: Sent,
    /// After them: what is measured, written and agreed upon.
    pub measuring: Sent,
    /// Steps done.
    pub steps: u64,
}

impl Sub for RunTraffic {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self {
            stepping: self.stepping - before.stepping,
            measuring: self.measuring - before.measuring,
            steps: self.steps - before.steps,
        }
    }
}

/// Messages that this process has sent, by purpose.
struct Counters {
    stepping: Arc<Traffic>,
    measuring: Arc<Traffic>,
}

impl Counters {
    /// Until now, after so many steps.
    fn until(&self, steps: u64) -> RunTraffic {
        let Self { stepping, measuring } = self;
        RunTraffic { stepping: stepping.sent(), measuring: measuring.sent(), steps }
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
    /// At the end time, with an error of `u` that is larger than the motion itself: a body at rest would have been nearer.
    Exceeds {
        /// The largest error of `u`, a length.
        error: f64,
        /// The largest displacement of the exact motion that was seen.
        displacement: f64,
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
        matches!(self, Self::Unresolved { .. } | Self::NotFinite { .. } | Self::Exceeds { .. })
    }

    /// Whether the run did what it was asked for: false where it stopped, or where its errors are larger than the motion or no numbers;
    /// `None` where rounding hides the motion, so that nothing can be told.
    #[must_use]
    pub fn passed(&self) -> Option<bool> {
        match self {
            Self::Ok => Some(true),
            Self::Unresolved { .. } => None,
            _ => Some(false),
        }
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
            Self::Exceeds { error, displacement } => write!(
                f,
                "error exceeds the motion: the largest error of u is {error:.3e}, the largest displacement {displacement:.3e}"
            ),
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

/// Results of one simulation.
#[derive(Clone, Debug, PartialEq)]
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
    pub timed_alone: bool,
    /// How it ended.
    pub status: Status,
    /// The errors until then.
    pub errors: PerField<PerNorm<f64>>,
    /// The errors of internal variables until then, by name; written among the others, as `internal`.
    pub internal: Vec<(String, PerNorm<f64>)>,
}

/// The errors of a row as they are written.
#[derive(Serialize)]
struct Errors<'a> {
    #[serde(flatten)]
    fields: &'a PerField<PerNorm<f64>>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    internal: BTreeMap<&'a str, PerNorm<f64>>,
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { errors, internal, .. } = self;
        let internal = internal.iter().map(|(name, norms)| (name.as_str(), *norms)).collect();
        let mut row = serializer.serialize_struct("Row", 12)?;
        row.serialize_field("cells", &self.cells)?;
        row.serialize_field("h", &self.h)?;
        row.serialize_field("dt", &self.dt)?;
        row.serialize_field("cfl", &self.cfl)?;
        row.serialize_field("steps", &self.steps)?;
        row.serialize_field("particles", &self.particles)?;
        row.serialize_field("wall_s", &self.wall_s)?;
        row.serialize_field("cpu_s", &self.cpu_s)?;
        row.serialize_field("particle_steps_per_s", &self.particle_steps_per_s)?;
        match self.timed_alone {
            true => row.skip_field("timed_alone")?,
            false => row.serialize_field("timed_alone", &false)?,
        }
        row.serialize_field("status", &self.status)?;
        row.serialize_field("errors", &Errors { fields: errors, internal })?;
        row.end()
    }
}

/// Steps a case to its end, and measures, writes and records on the way.
pub(crate) fn follow<T: Precision<D>, const D: usize>(
    on_grid: &OnGrid<'_, T, D>,
    outputs: &mut Outputs<'_>,
) -> Result<Row, CaseError>
where
    f64: Precision<D>,
{
    let &OnGrid { exact, steps, .. } = on_grid;
    let mut counters = None;
    let mut of_steps = None;
    if let Some(ranks) = outputs.ranks.take().filter(|_| !ROWS_ALONE) {
        let (stepping, measuring) = (counted(ranks.clone()), counted(ranks));
        counters = Some(Counters { stepping: stepping.1, measuring: measuring.1 });
        (of_steps, outputs.ranks) = (Some(stepping.0), Some(measuring.0));
    }
    let mut driven = Driven::set_up(on_grid, steps.dt, of_steps.as_ref())?;
    let end = steps.count as f64 * driven.dt;
    let (traffic, profile) = (outputs.traffic.take(), outputs.profile.take());
    if profile.is_some() {
        driven.solver.take_times();
    }
    let (mut watch, begun) = Watch::begin(on_grid, &mut driven, outputs)?;
    let before = counters.as_ref().map(|counters| counters.until(begun));
    let outcome = driven.advance(begun + 1..=steps.count, &mut |stepped| watch.look(stepped))?;
    if let (Some(traffic), Some(counters), Some(before)) = (traffic, &counters, before) {
        *traffic = counters.until(watch.reached.step) - before;
    }
    let mut row = watch.row(driven.dt, outcome);
    if let Some(profile) = profile {
        *profile = driven.solver.profile();
    }
    if row.status == Status::Ok {
        let rounding = Rounding { of_position: on_grid.rounding(), steps: steps.count };
        row.status = judged(exact, &row.errors, end, rounding);
    }
    Ok(row)
}

/// Rounding error of positions, a length.
#[derive(Clone, Copy)]
struct Rounding {
    /// Half a unit in the last place.
    of_position: f64,
    /// Steps that add it up.
    steps: u64,
}

impl Rounding {
    /// After all steps, added up as a random walk.
    fn in_the_end(self) -> f64 {
        self.of_position * (self.steps as f64).sqrt()
    }
}

/// The status of a run that came to its end: whether its errors say anything.
fn judged<const D: usize>(
    exact: &dyn Solution<f64, D>,
    errors: &PerField<PerNorm<f64>>,
    end: f64,
    rounding: Rounding,
) -> Status {
    // Periodic motion repeats.
    let span = end.min(exact.period());
    let displacement = largest_displacement(exact, span, 1);
    // A body at rest is at rest in every precision.
    if displacement > 0.0 && displacement <= rounding.of_position {
        return Status::Unresolved { displacement, resolution: rounding.of_position };
    }
    let is_finite = |norms: &PerNorm<f64>| norms.iter().all(|(_, value)| value.is_finite());
    if let Some((field, _)) = errors.iter().find(|(_, norms)| !is_finite(norms)) {
        return Status::NotFinite { field };
    }
    let error = errors.u.linf;
    let exceeds = |displacement: f64| error > displacement.max(rounding.in_the_end());
    // Few samples may miss the largest displacement; many are taken where it matters.
    if exceeds(displacement) {
        let displacement = largest_displacement(exact, span, 64);
        if exceeds(displacement) {
            return Status::Exceeds { error, displacement };
        }
    }
    Status::Ok
}

/// The largest displacement at time zero and at sampled places and times until `span`, with so many times at each place.
fn largest_displacement<const D: usize>(
    exact: &dyn Solution<f64, D>,
    span: f64,
    times: usize,
) -> f64 {
    const PLACES: usize = 64;
    let domain = exact.domain();
    let seen = (0..PLACES).filter_map(|n| points::interior(&domain, span, n));
    seen.flat_map(|(X, t)| {
        let later = (1..=times).map(move |k| (t + span * k as f64 / times as f64) % span);
        [0.0, t].into_iter().chain(later).map(move |t| (X, t))
    })
    .map(|(X, t)| magnitude(exact.displacement(&X, t).iter().copied()))
    .fold(0.0, f64::max)
}

/// Everything that looks on at a run.
struct Watch<'w, 'a, T: Precision<D>, const D: usize> {
    on_grid: &'w OnGrid<'a, T, D>,
    /// Time by which velocities lag behind positions.
    lag: f64,
    measurement: Measurement<'a, D>,
    particles: usize,
    reached: Reached,
    progress: &'w mut dyn FnMut(Progress),
    frames: Option<FrameWriter>,
    snapshot: Option<&'w mut Snapshot>,
    recorder: Option<Recorder<'w, D>>,
    checkpoints: Option<&'w Checkpoints>,
    ranks: Option<Arc<dyn Ranks>>,
    until: Option<Instant>,
}

impl<'w, 'a: 'w, T: Precision<D>, const D: usize> Watch<'w, 'a, T, D>
where
    f64: Precision<D>,
{
    /// At the state before the first step, or at the checkpoint that the run goes on from; with the number of steps done.
    fn begin(
        on_grid: &'w OnGrid<'a, T, D>,
        driven: &mut Driven<'_, T, D>,
        outputs: &'w mut Outputs<'_>,
    ) -> Result<(Self, u64), CaseError> {
        let &OnGrid { exact, steps, .. } = on_grid;
        let Outputs { progress, frames, snapshot, checkpoints, history, ranks, until, .. } =
            outputs;
        // What is kept of particles is of those that are here then.
        let resumed = match checkpoints.filter(|checkpoints| !ROWS_ALONE && checkpoints.resume) {
            Some(checkpoints) => take_up(checkpoints, driven, ranks.as_deref())?,
            None => None,
        };
        let solver = driven.solver.as_mut();
        let lag = solver.velocity_lag().to_f64();
        let measurement = Measurement::new(exact, solver, ranks.as_ref());
        let is_first = ranks.as_deref().is_none_or(|ranks| ranks.rank() == 0);
        let frames = match frames {
            Some(output) if !ROWS_ALONE => {
                Some(FrameWriter::new(output, steps.count, lag, is_first)?)
            }
            _ => None,
        };
        let recorder = match history {
            Some(moments) if !ROWS_ALONE => {
                Some(Recorder::new(moments, exact, law_of_body(exact)?, steps.count))
            }
            _ => None,
        };
        let mut watch = Self {
            on_grid,
            lag,
            particles: measurement.count(solver),
            measurement,
            reached: Reached {
                step: 0,
                wall_s: 0.0,
                cpu_s: 0.0,
                errors: PerField::default(),
                internal: Vec::new(),
            },
            progress: *progress,
            frames,
            snapshot: snapshot.as_deref_mut(),
            recorder,
            checkpoints: *checkpoints,
            ranks: ranks.clone(),
            until: *until,
        };
        match resumed {
            Some((reached, history)) if !ROWS_ALONE => watch.resume(reached, history, driven.dt)?,
            _ => watch.start(driven.solver.as_mut())?,
        }
        let begun = watch.reached.step;
        Ok((watch, begun))
    }

    fn resume(&mut self, reached: Reached, history: Vec<Moment>, dt: f64) -> Result<(), CaseError> {
        if let Some(recorder) = &mut self.recorder {
            recorder.take_up(history);
        }
        if let Some(frames) = &mut self.frames {
            frames.take_up(reached.step, dt)?;
        }
        self.reached = reached;
        Ok(())
    }

    fn start(&mut self, solver: &mut (dyn Solver<T, D> + '_)) -> Result<(), CaseError> {
        self.write(solver, 0, 0.0)?;
        let at_start = self.measurement.errors(solver, 0.0, self.lag);
        let starts_early = self.on_grid.case.scheme.starts_early();
        let velocity_time = if starts_early { -self.lag } else { 0.0 };
        self.record(solver, (0, false), (0.0, velocity_time), at_start.u);
        // Before the first step no velocity is stored yet that belongs to a time of the scheme.
        self.reached.errors = PerField { v: PerNorm::default(), ..at_start };
        self.reached.internal = self.measurement.internal_errors(solver, 0.0);
        Ok(())
    }

    /// Writes the particles where their turn has come.
    fn write(
        &mut self,
        solver: &mut (dyn Solver<T, D> + '_),
        step: u64,
        time: f64,
    ) -> Result<(), CaseError> {
        if ROWS_ALONE {
            return Ok(());
        }
        let &OnGrid { exact, steps, .. } = self.on_grid;
        if let Some(frames) = &mut self.frames {
            frames.write(solver.observe(), self.measurement.held(), exact, (step, time))?;
        }
        if let Some(snapshot) = &mut self.snapshot {
            let held = self.measurement.held();
            snapshot.take(solver.observe(), held, exact, (step, steps.count), time);
        }
        Ok(())
    }

    fn record(
        &mut self,
        solver: &mut (dyn Solver<T, D> + '_),
        step: (u64, bool),
        times: (f64, f64),
        u: PerNorm<f64>,
    ) {
        if let Some(recorder) = self.recorder.as_mut().filter(|_| !ROWS_ALONE) {
            let particles = solver.observe().0;
            recorder.take((particles, self.measurement.homes()), step, times, u);
        }
    }

    /// Looks at the state after a step, and ends a run that says nothing more.
    fn look(&mut self, stepped: Stepped<'_, T, D>) -> Seen<Status> {
        let Stepped { step, time, solver, wall_s, cpu_s, is_interrupted } = stepped;
        let OnGrid { scene, steps, .. } = self.on_grid;
        self.reached.step = step;
        self.reached.wall_s += wall_s;
        self.reached.cpu_s += cpu_s;
        self.measurement.follow(solver);
        let is_interrupted = self.measurement.any(is_interrupted);
        let measured = self.measurement.errors(solver, time, self.lag);
        self.reached.errors = PerField::combine(&self.reached.errors, &measured, PerNorm::larger);
        let of_internal = self.measurement.internal_errors(solver, time);
        for ((_, known), (_, measured)) in self.reached.internal.iter_mut().zip(&of_internal) {
            *known = PerNorm::larger(known, measured);
        }
        let error = measured.u.linf;
        let mut end = (error > scene.size || error.is_nan()).then(|| {
            let particle = self.measurement.worst_particle(solver, time);
            Status::Unstable { step, time, particle, error, size: scene.size }
        });
        self.write(solver, step, time)?;
        let share = step as f64 / steps.count as f64;
        (self.progress)(Progress { case: 0, step, steps: steps.count, share });
        let late = step < steps.count && self.until.is_some_and(|until| Instant::now() >= until);
        if late && end.is_none() {
            end = Some(Status::Cut { step, time });
        }
        self.record(solver, (step, end.is_some()), (time, time - self.lag), measured.u);
        if let Some(end) = end {
            return Ok(ControlFlow::Break(end));
        }
        if let Some(checkpoints) = self.checkpoints.filter(|_| !ROWS_ALONE)
            && (step % checkpoints.every == 0 || is_interrupted)
        {
            let history = self.recorder.as_ref().map_or(&[][..], Recorder::moments);
            checkpoints.write(self.ranks.as_deref(), &self.reached, history, &solver.state())?;
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The row of the run, which has ended.
    fn row(&self, dt: f64, outcome: Outcome<Status>) -> Row {
        let Reached { step, wall_s, cpu_s, errors, ref internal } = self.reached;
        let status = match outcome {
            Outcome::Done => Status::Ok,
            Outcome::Stopped(error) => Status::Stopped(error),
            Outcome::Left(status) => status,
        };
        let particle_steps = self.particles as f64 * step as f64;
        let OnGrid { case, scene, steps, .. } = self.on_grid;
        Row {
            cells: case.cells,
            h: scene.spacing,
            dt,
            cfl: steps.cfl,
            steps: steps.count,
            particles: self.particles,
            wall_s,
            cpu_s,
            particle_steps_per_s: if wall_s > 0.0 { particle_steps / wall_s } else { 0.0 },
            timed_alone: true,
            status,
            errors,
            internal: internal.clone(),
        }
    }
}

/// Goes on from the last checkpoint, if there is one.
fn take_up<T: Precision<D>, const D: usize>(
    checkpoints: &Checkpoints,
    driven: &mut Driven<'_, T, D>,
    ranks: Option<&dyn Ranks>,
) -> Result<Option<(Reached, Vec<Moment>)>, CaseError> {
    let Some(TakenUp { reached, history, parts }) = checkpoints.read(ranks)? else {
        return Ok(None);
    };
    driven.take_up(parts).map_err(|cause| checkpoints.refusal(cause))?;
    Ok(Some((reached, history)))
}
