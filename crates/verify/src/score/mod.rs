//! Errors and orders of what another solver wrote, particles or nodes, against the exact solution.
//!
//! The errors are those of [`run`](crate::run): `u` is compared as given, or as position minus reference position, with
//! `u(X, t)`; `v`, `F` and `P` where the files hold them. L_inf, L2 and L1 are taken over the particles of a frame, then
//! their maxima over the frames. For frames that `run` wrote at every step they are its errors to the bit.

mod arrays;
mod findings;

pub use arrays::Role;
pub use findings::Remark;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use mmsmith_solutions::{AnySolution, Domain, Solution};
use mmsmith_vtk::foreign::{ArrayHead, FrameFile, ReadError, Snapshot, frames};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use thiserror::Error;

use crate::measure::over_particles;
use crate::norms::{PerField, PerNorm};
use crate::order::Order;
use crate::study::orders_of;
use arrays::{Chosen, matrices, not_finite, vectors};
use findings::Remarks;

/// Share of the body's size by which a reference position may lie outside before it is told.
const OUTSIDE: f64 = 1e-6;
/// Share of the time span by which a frame may lie outside before it is told.
const TIME_SLACK: f64 = 1e-6;
/// Steps of Newton's method from a position back to its reference position.
const MOST_ITERATIONS: usize = 50;

/// What the points of the files are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Points {
    /// Reference positions if they stay where they are while displacements change, else current positions.
    #[default]
    Auto,
    /// Current positions `x`, as particle methods write them.
    Current,
    /// Reference positions `X`, as many finite element codes write them.
    Reference,
}

/// How to read the files.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoreOptions {
    /// The names of arrays that have no usual name.
    pub map: BTreeMap<Role, String>,
    /// What the points are.
    pub points: Points,
    /// The time of recordings with a single frame, where the files do not tell it.
    pub time: Option<f64>,
    /// By how much velocities lag behind their frame's time, where the files do not tell it.
    pub velocity_lag: f64,
    /// The number of the solution's periods that frames may lie in, from time zero.
    pub periods: f64,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        Self {
            map: BTreeMap::new(),
            points: Points::Auto,
            time: None,
            velocity_lag: 0.0,
            periods: 1.0,
        }
    }
}

/// The resolution of a recording, with respect to which orders are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Cells along the solution's cell length.
    Cells(usize),
    /// The length itself.
    Length(f64),
    /// From the number of particles and the space that they take.
    Estimated,
}

/// One recording to be scored.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// A file, a `.pvd` list or a folder; or the files of the frames, one after the other.
    pub paths: Vec<PathBuf>,
    /// Its resolution.
    pub resolution: Resolution,
}

/// Where reference positions and displacements are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// An array of the files.
    Array,
    /// The points of the files.
    Points,
    /// Positions minus displacements.
    PositionsMinusDisplacements,
    /// Positions minus reference positions.
    PositionsMinusReference,
    /// The first frame's positions, traced back with the exact motion; particles found again by identity or order.
    FirstFrame,
}

impl Source {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Array => "given as an array",
            Self::Points => "the points of the files",
            Self::PositionsMinusDisplacements => "positions minus displacements",
            Self::PositionsMinusReference => "positions minus reference positions",
            Self::FirstFrame => "the first frame's positions, traced back with the exact motion",
        }
    }
}

/// What one recording gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreRow {
    /// What was read.
    pub file: String,
    /// Cells along the cell length, where they were told.
    pub cells: Option<usize>,
    /// The length that orders refer to.
    pub h: f64,
    /// Particles in the first frame.
    pub particles: usize,
    /// Frames that were compared.
    pub frames: usize,
    /// The earliest time.
    pub first_time: f64,
    /// The latest time.
    pub last_time: f64,
    /// Where reference positions are from.
    pub reference_positions: Source,
    /// Where displacements are from.
    pub displacements: Source,
    /// The fields, of u, v, F and P, that the files hold.
    pub fields: Vec<&'static str>,
    /// `ok`, or what is wrong with the recording.
    pub status: String,
    /// The errors; not a number for fields that are not there, and where a number of the files is none.
    pub errors: PerField<PerNorm<f64>>,
    /// Everything else that has to be known; problems first.
    #[serde(skip)]
    pub findings: Vec<Remark>,
}

impl ScoreRow {
    /// Whether the recording is whole and sensible, so that its errors have a part in orders.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.status == "ok"
    }
}

/// What all recordings gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// One row for each recording, in order.
    pub rows: Vec<ScoreRow>,
    /// The orders with respect to `h`, where there are several rows.
    pub orders: Option<PerField<PerNorm<Order>>>,
}

/// Why a recording cannot be scored.
#[derive(Debug, Error)]
pub enum ScoreError {
    /// A file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The solution has a dimension that is not known here.
    #[error("the solution must have one, two or three dimensions")]
    Dimension,
    /// There is no such array.
    #[error("{}: there is no array `{name}` for {role} (there are: {there})", path.display())]
    NoArray {
        /// The file.
        path: PathBuf,
        /// What it should be.
        role: Role,
        /// The name.
        name: String,
        /// The names that there are.
        there: String,
    },
    /// An array has the wrong number of components for what it should be.
    #[error("{}: array `{name}` has {components} component(s); {role} has {admissible}", path.display())]
    Components {
        /// The file.
        path: PathBuf,
        /// What it should be.
        role: Role,
        /// The array.
        name: String,
        /// Its components.
        components: usize,
        /// How many there should be.
        admissible: String,
    },
    /// A frame without particles.
    #[error("{}: the frame holds no particle", path.display())]
    NoParticles {
        /// The file.
        path: PathBuf,
    },
    /// A frame without points, which only CSV files can have.
    #[error("{}: there are no positions (columns x, y, z)", path.display())]
    NoPositions {
        /// The file.
        path: PathBuf,
    },
    /// The points have fewer coordinates than the solution.
    #[error("{}: points have {found} coordinate(s); the solution has {expected}", path.display())]
    Coordinates {
        /// The file.
        path: PathBuf,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// Nothing tells displacements.
    #[error(
        "{}: nothing tells displacements: give an array of displacements or of reference positions \
         (--map displacement=NAME or --map reference_position=NAME), or more than one frame", path.display()
    )]
    NoDisplacement {
        /// The file.
        path: PathBuf,
    },
    /// A frame lacks an array that the first one has, and that all need.
    #[error("{}: there is no array `{name}`, which the first frame has", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The array.
        name: String,
    },
    /// Particles of two frames cannot be told apart.
    #[error(
        "{}: it holds {found} particles, the first frame {expected}, and there is no array of identities \
         (--map id=NAME) to find them by", path.display()
    )]
    Unmatched {
        /// The file.
        path: PathBuf,
        /// Its particles.
        found: usize,
        /// Those of the first frame.
        expected: usize,
    },
    /// A frame does not tell its time.
    #[error(
        "{}: nothing tells its time: list the frames with times in a .pvd file, write a field TimeValue, or a \
         column t, or give --time for a single frame", path.display()
    )]
    NoTime {
        /// The file.
        path: PathBuf,
    },
    /// One time is given for several frames.
    #[error("--time is for a single frame; {} holds {frames}", path.display())]
    OneTime {
        /// The recording.
        path: PathBuf,
        /// Its frames.
        frames: usize,
    },
    /// No frame has a time that is a number.
    #[error("{}: none of its {frames} frame(s) has a finite time; the first one's is {first:?}", path.display())]
    TimesNotFinite {
        /// The recording.
        path: PathBuf,
        /// Its frames.
        frames: usize,
        /// The first time.
        first: f64,
    },
    /// No frame lies in the time in which the solution is looked at.
    #[error(
        "{}: its times, {first:?} to {last:?}, do not overlap the solution's, 0 to {end:?} ({periods} period(s)); \
         is another unit meant? Longer simulations need --periods", path.display()
    )]
    NoOverlap {
        /// The recording.
        path: PathBuf,
        /// The earliest time.
        first: f64,
        /// The latest time.
        last: f64,
        /// The end of the solution's time.
        end: f64,
        /// That end in periods.
        periods: f64,
    },
    /// A number that makes no sense.
    #[error("{what} = {value:?}: it must be {admissible}")]
    Setting {
        /// What.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        admissible: &'static str,
    },
}

/// Scores recordings against the exact solution, with the orders over them.
///
/// # Errors
///
/// [`ScoreError`] for the first recording that cannot be read or compared.
pub fn score(
    exact: &AnySolution<f64>,
    inputs: &[Input],
    options: &ScoreOptions,
) -> Result<Score, ScoreError> {
    if !(options.periods > 0.0 && options.periods.is_finite()) {
        let (what, value) = ("periods", options.periods);
        return Err(ScoreError::Setting { what, value, admissible: "a positive number" });
    }
    let row = |input| match exact {
        AnySolution::One(exact) => recording(exact.as_ref(), input, options),
        AnySolution::Two(exact) => recording(exact.as_ref(), input, options),
        AnySolution::Three(exact) => recording(exact.as_ref(), input, options),
        _ => Err(ScoreError::Dimension),
    };
    let rows = inputs.iter().map(row).collect::<Result<Vec<_>, _>>()?;
    let orders = (rows.len() > 1).then(|| {
        let errors = rows.iter().map(|row| (row.h, row.is_ok().then_some(&row.errors)));
        orders_of(&errors.collect::<Vec<_>>())
    });
    Ok(Score { rows, orders })
}

/// How reference positions and displacements come about.
enum Scheme<const D: usize> {
    /// `X` is an array; displacements are another, or positions minus it.
    Given { displacement: bool },
    /// Points are `X`.
    PointsAtRest,
    /// `X` is position minus displacement.
    Recovered,
    /// `X` was found for each particle of the first frame.
    Traced(Traced<D>),
}

/// The reference positions of the first frame's particles.
struct Traced<const D: usize> {
    X: Vec<SVector<f64, D>>,
    /// The place in `X` of each identity; none where particles keep their order.
    places: Option<HashMap<i64, usize>>,
}

/// One frame with its time.
struct Timed<'a> {
    file: &'a FrameFile,
    time: f64,
}

fn recording<const D: usize>(
    exact: &dyn Solution<f64, D>,
    input: &Input,
    options: &ScoreOptions,
) -> Result<ScoreRow, ScoreError> {
    let mut remarks = Remarks::default();
    let mut files = vec![];
    for path in &input.paths {
        files.extend(frames(path)?);
    }
    let path = input.paths.first().map_or(Path::new(""), PathBuf::as_path);
    let timed = times(exact, &files, path, options, &mut remarks)?;

    let first = open(timed[0].file)?;
    let chosen = Chosen::find::<D>(&first, &options.map, &mut remarks)?;
    let scheme = scheme(exact, &timed, &first, &chosen, options, &mut remarks)?;
    let has_velocity_times =
        chosen.name(Role::Velocity).is_some() && any_velocity_time(&timed, &first)?;

    let mut reader = FrameReader {
        exact,
        chosen: &chosen,
        scheme: &scheme,
        options,
        has_velocity_times,
        remarks: &mut remarks,
        first: Identities::default(),
    };
    let mut errors: Option<PerField<PerNorm<f64>>> = None;
    let mut transposed = [PerNorm::<f64>::default(); 2];
    let mut compared = [0_usize; 4];
    let mut h = f64::NAN;
    for (index, frame) in timed.iter().enumerate() {
        let snapshot = open(frame.file)?;
        let data = reader.frame(&snapshot, frame.time, index)?;
        if index == 0 {
            h = match input.resolution {
                Resolution::Cells(cells) => exact.cell_length() / cells as f64,
                Resolution::Length(length) => length,
                Resolution::Estimated => spacing(&data.X),
            };
        }
        let (norms, of_transposed) = data.errors(exact, frame.time);
        for (count, is_there) in
            compared.iter_mut().zip([true, data.v.is_some(), data.F.is_some(), data.P.is_some()])
        {
            *count += usize::from(is_there);
        }
        errors = Some(match errors {
            None => norms,
            Some(errors) => PerField::combine(&errors, &norms, PerNorm::larger),
        });
        transposed = [0, 1].map(|k| transposed[k].larger(&of_transposed[k]));
    }

    let mut errors = errors.unwrap_or_default();
    let absent = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
    let roles =
        [Role::Displacement, Role::Velocity, Role::DeformationGradient, Role::FirstPiolaKirchhoff];
    let mut fields = vec![];
    for ((field, role), count) in ["u", "v", "F", "P"].into_iter().zip(roles).zip(compared) {
        if count > 0 {
            fields.push(field);
        }
        let frames = timed.len();
        // Velocities without a time, as in the first state of a staggered scheme, are told of elsewhere.
        if count < frames && chosen.name(role).is_some() && role != Role::Velocity {
            let what = format!("{} of {frames} frames have no array for {role}", frames - count);
            remarks.note("array-missing", true, what);
        }
        if count == 0 {
            match role {
                Role::Velocity => errors.v = absent,
                Role::DeformationGradient => errors.F = absent,
                Role::FirstPiolaKirchhoff => errors.P = absent,
                _ => (),
            }
        }
    }
    for ((field, given), turned) in
        [("F", errors.F.l2), ("P", errors.P.l2)].into_iter().zip(transposed)
    {
        if turned.l2 < 0.5 * given {
            let what = format!(
                "the transpose of {field} has the L2 error {:.3e} instead of {given:.3e}: is {field} written column by \
                 column, or with its indices the other way round ([J][i])?",
                turned.l2
            );
            remarks.note("transposed", false, what);
        }
    }
    if input.resolution == Resolution::Estimated {
        let what = "h is estimated, as the spacing of as many points spread evenly over their bounding box; --cells or \
                    --h tells it";
        remarks.note("estimated-h", false, what);
    }
    let (reference_positions, displacements) = match scheme {
        Scheme::Given { displacement: true } => (Source::Array, Source::Array),
        Scheme::Given { displacement: false } => (Source::Array, Source::PositionsMinusReference),
        Scheme::PointsAtRest => (Source::Points, Source::Array),
        Scheme::Recovered => (Source::PositionsMinusDisplacements, Source::Array),
        Scheme::Traced(_) => (Source::FirstFrame, Source::PositionsMinusReference),
    };
    let findings = remarks.list();
    let problems = findings.iter().filter(|finding| finding.is_problem);
    let problems: Vec<_> = problems.map(|finding| finding.message.as_str()).collect();
    let span = timed.iter().map(|frame| frame.time);
    Ok(ScoreRow {
        file: path.display().to_string(),
        cells: match input.resolution {
            Resolution::Cells(cells) => Some(cells),
            _ => None,
        },
        h,
        particles: first.particles(),
        frames: timed.len(),
        first_time: span.clone().fold(f64::INFINITY, f64::min),
        last_time: span.fold(f64::NEG_INFINITY, f64::max),
        reference_positions,
        displacements,
        fields,
        status: if problems.is_empty() { "ok".into() } else { problems.join("; ") },
        errors,
        findings,
    })
}

fn open(file: &FrameFile) -> Result<Snapshot, ScoreError> {
    let snapshot = Snapshot::open(file)?;
    if snapshot.particles() == 0 {
        return Err(ScoreError::NoParticles { path: snapshot.path().to_owned() });
    }
    Ok(snapshot)
}

/// The frames with their times; those without a finite one are left out, which is told.
fn times<'a, const D: usize>(
    exact: &dyn Solution<f64, D>,
    files: &'a [FrameFile],
    path: &Path,
    options: &ScoreOptions,
    remarks: &mut Remarks,
) -> Result<Vec<Timed<'a>>, ScoreError> {
    if options.time.is_some() && files.len() != 1 {
        return Err(ScoreError::OneTime { path: path.to_owned(), frames: files.len() });
    }
    let mut timed = vec![];
    let mut first_bad = None;
    for file in files {
        let time = match (options.time, file.time) {
            (Some(time), _) | (None, Some(time)) => time,
            (None, None) => {
                let snapshot = open(file)?;
                let names = ["TimeValue", "TIME", "Time", "time"];
                let told = names.iter().find_map(|name| snapshot.field(name));
                told.ok_or_else(|| ScoreError::NoTime { path: file.path.clone() })?
            }
        };
        if time.is_finite() {
            timed.push(Timed { file, time });
        } else {
            first_bad.get_or_insert(time);
            remarks.met(
                "time-not-finite",
                true,
                1,
                "frame(s) whose time is not finite are left out",
                || format!("{} at {time:?}", file.path.display()),
            );
        }
    }
    let path = || path.to_owned();
    if timed.is_empty() {
        let first = first_bad.unwrap_or(f64::NAN);
        return Err(ScoreError::TimesNotFinite { path: path(), frames: files.len(), first });
    }
    let end = options.periods * exact.period();
    let slack = TIME_SLACK * end;
    let is_outside = |frame: &&Timed<'_>| !(-slack..=end + slack).contains(&frame.time);
    let outside = timed.iter().filter(is_outside).count();
    if outside == timed.len() {
        let times = timed.iter().map(|frame| frame.time);
        return Err(ScoreError::NoOverlap {
            path: path(),
            first: times.clone().fold(f64::INFINITY, f64::min),
            last: times.fold(f64::NEG_INFINITY, f64::max),
            end,
            periods: options.periods,
        });
    }
    if outside > 0 {
        let what = format!(
            "{outside} of {} frames lie outside the times 0 to {end:?} ({} period(s)); they are compared all the same",
            timed.len(),
            options.periods
        );
        remarks.note("outside-time-span", false, what);
    }
    let falls = timed.windows(2).filter(|pair| pair[1].time <= pair[0].time).count();
    if falls > 0 {
        let what = format!("{falls} of {} frames are not later than the frame before", timed.len());
        remarks.note("times-not-increasing", false, what);
    }
    Ok(timed)
}

/// Whether any frame tells a time of its own for velocities; of those, others cannot be taken to hold for their frame's.
fn any_velocity_time(timed: &[Timed<'_>], first: &Snapshot) -> Result<bool, ScoreError> {
    if first.field("VelocityTime").is_some() {
        return Ok(true);
    }
    match timed.last() {
        Some(last) if timed.len() > 1 => Ok(open(last.file)?.field("VelocityTime").is_some()),
        _ => Ok(false),
    }
}

fn scheme<const D: usize>(
    exact: &dyn Solution<f64, D>,
    timed: &[Timed<'_>],
    first: &Snapshot,
    chosen: &Chosen,
    options: &ScoreOptions,
    remarks: &mut Remarks,
) -> Result<Scheme<D>, ScoreError> {
    let displacement = chosen.name(Role::Displacement);
    if chosen.name(Role::ReferencePosition).is_some() {
        return Ok(Scheme::Given { displacement: displacement.is_some() });
    }
    if displacement.is_some() {
        let is_at_rest = match options.points {
            Points::Reference => true,
            Points::Current => false,
            Points::Auto => points_are_at_rest(timed, first, chosen)?,
        };
        if is_at_rest && options.points == Points::Auto {
            remarks.note(
                "points-at-rest",
                false,
                "the points do not move while displacements change: they are taken as reference positions",
            );
        }
        return Ok(if is_at_rest { Scheme::PointsAtRest } else { Scheme::Recovered });
    }
    if timed.len() < 2 {
        return Err(ScoreError::NoDisplacement { path: first.path().to_owned() });
    }
    trace(exact, &timed[0], first, chosen, remarks)
}

/// Whether points stay where they are, to the bit, while displacements change.
fn points_are_at_rest(
    timed: &[Timed<'_>],
    first: &Snapshot,
    chosen: &Chosen,
) -> Result<bool, ScoreError> {
    let Some(name) = chosen.name(Role::Displacement) else { return Ok(false) };
    let positions = first.positions()?;
    let displacement = first.floats(name)?;
    for frame in &timed[1..] {
        let snapshot = open(frame.file)?;
        if snapshot.floats(name)? != displacement {
            return Ok(snapshot.positions()? == positions);
        }
    }
    Ok(false)
}

/// Finds the reference positions behind the positions of the first frame.
fn trace<const D: usize>(
    exact: &dyn Solution<f64, D>,
    frame: &Timed<'_>,
    first: &Snapshot,
    chosen: &Chosen,
    remarks: &mut Remarks,
) -> Result<Scheme<D>, ScoreError> {
    let x = positions(first, remarks)?;
    let mut lost = (0, 0);
    let X = x
        .iter()
        .enumerate()
        .map(|(p, x)| {
            reference_position(exact, x, frame.time).unwrap_or_else(|| {
                lost = if lost.0 == 0 { (1, p) } else { (lost.0 + 1, lost.1) };
                SVector::repeat(f64::NAN)
            })
        })
        .collect();
    remarks.met(
        "not-traced",
        true,
        lost.0,
        "particle(s) of the first frame lie where the exact motion brings no material point",
        || format!("particle {} of {}", lost.1, first.path().display()),
    );
    let ids = match chosen.name(Role::Id) {
        Some(name) => first.integers(name)?,
        None => None,
    };
    let found_by = if ids.is_some() { "identity" } else { "order" };
    remarks.note(
        "first-frame",
        false,
        format!(
            "the first frame's positions are taken to be exact at t = {:?}; particles are found again by {found_by}",
            frame.time
        ),
    );
    let places =
        ids.map(|ids| ids.into_iter().enumerate().map(|(place, id)| (id, place)).collect());
    Ok(Scheme::Traced(Traced { X, places }))
}

/// The reference position that the exact motion brings to `x`, by Newton's method.
fn reference_position<const D: usize>(
    exact: &dyn Solution<f64, D>,
    x: &SVector<f64, D>,
    time: f64,
) -> Option<SVector<f64, D>> {
    let mut X = x - exact.displacement(x, time);
    for _ in 0..MOST_ITERATIONS {
        let miss = X + exact.displacement(&X, time) - x;
        let step = exact.deformation_gradient(&X, time).try_inverse()? * miss;
        X -= step;
        if step.norm() <= 4.0 * f64::EPSILON * X.norm().max(x.norm()) {
            return Some(X);
        }
    }
    None
}

/// The points of a frame in `D` dimensions.
fn positions<const D: usize>(
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) -> Result<Vec<SVector<f64, D>>, ScoreError> {
    let path = || snapshot.path().to_owned();
    let head = snapshot.points().ok_or_else(|| ScoreError::NoPositions { path: path() })?;
    if head.components < D || head.components > 3 {
        let found = head.components;
        return Err(ScoreError::Coordinates { path: path(), found, expected: D });
    }
    if head.is_single {
        let what =
            "points are 32-bit floats: errors below about 1e-7 of their coordinates are rounding";
        remarks.note("single-precision", false, what);
    }
    let flat = snapshot.positions()?;
    Ok(judged(&flat, head.components, "position", snapshot, remarks))
}

/// Vectors from numbers, and what is to be said about them.
fn judged<const D: usize>(
    flat: &[f64],
    components: usize,
    what: &str,
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) -> Vec<SVector<f64, D>> {
    count_not_finite(flat, components, what, snapshot, remarks);
    let (vectors, beyond) = vectors(flat, components);
    if let Some((count, first)) = beyond {
        let kind = "out-of-plane";
        let what =
            format!("particle(s) whose {what} has a part beyond the solution's {D} dimension(s)");
        remarks.met(kind, true, count, what, || place(first, snapshot));
    }
    vectors
}

fn count_not_finite(
    flat: &[f64],
    components: usize,
    what: &str,
    snapshot: &Snapshot,
    remarks: &mut Remarks,
) {
    let (count, first) = not_finite(flat, components);
    let what = format!("particle(s) whose {what} is not finite");
    remarks.met("not-finite", true, count, what, || place(first, snapshot));
}

fn place(particle: usize, snapshot: &Snapshot) -> String {
    format!("particle {particle} of {}", snapshot.path().display())
}

/// The particles of the first frame, by which later frames are judged.
#[derive(Default)]
struct Identities {
    particles: usize,
    ids: Option<HashSet<i64>>,
}

/// What a frame gives for the comparison.
struct FrameData<const D: usize> {
    X: Vec<SVector<f64, D>>,
    u: Vec<SVector<f64, D>>,
    /// With the time to which they belong.
    v: Option<(Vec<SVector<f64, D>>, f64)>,
    F: Option<Vec<SMatrix<f64, D, D>>>,
    P: Option<Vec<SMatrix<f64, D, D>>>,
}

impl<const D: usize> FrameData<D> {
    /// The error norms of the frame, zero for fields that it lacks; and those of F and P if they were transposed.
    fn errors(
        &self,
        exact: &dyn Solution<f64, D>,
        time: f64,
    ) -> (PerField<PerNorm<f64>>, [PerNorm<f64>; 2]) {
        let magnitudes = |p: usize| {
            let at_time = exact.fields(&self.X[p], time);
            let v = self.v.as_ref().map_or(0.0, |(v, v_time)| {
                let exact_v =
                    if *v_time == time { at_time.v } else { exact.velocity(&self.X[p], *v_time) };
                (v[p] - exact_v).norm()
            });
            let tensor = |given: &Option<Vec<SMatrix<f64, D, D>>>, exact: SMatrix<f64, D, D>| {
                given.as_ref().map_or((0.0, 0.0), |given| {
                    ((given[p] - exact).norm(), (given[p].transpose() - exact).norm())
                })
            };
            let (F, F_turned) = tensor(&self.F, at_time.F);
            let (P, P_turned) = tensor(&self.P, at_time.P);
            [(self.u[p] - at_time.u).norm(), v, F, P, F_turned, P_turned]
        };
        let ([u, v, F, P, F_turned, P_turned], _) = over_particles(self.X.len(), magnitudes);
        (PerField { u, v, F, P }, [F_turned, P_turned])
    }
}

/// Reads frame after frame.
struct FrameReader<'a, const D: usize> {
    exact: &'a dyn Solution<f64, D>,
    chosen: &'a Chosen,
    scheme: &'a Scheme<D>,
    options: &'a ScoreOptions,
    has_velocity_times: bool,
    remarks: &'a mut Remarks,
    first: Identities,
}

impl<const D: usize> FrameReader<'_, D> {
    fn frame(
        &mut self,
        snapshot: &Snapshot,
        time: f64,
        index: usize,
    ) -> Result<FrameData<D>, ScoreError> {
        let ids = match self.head(Role::Id, snapshot)? {
            Some(head) => snapshot.integers(&head.name)?,
            None => None,
        };
        self.identify(snapshot, index, ids.as_deref());
        let need = |name: Option<Vec<SVector<f64, D>>>, role| {
            name.ok_or_else(|| ScoreError::Missing {
                path: snapshot.path().to_owned(),
                name: self.chosen.name(role).unwrap_or_default().to_owned(),
            })
        };
        let (X, u) = match self.scheme {
            Scheme::Given { displacement } => {
                let X =
                    need(self.vector(Role::ReferencePosition, snapshot)?, Role::ReferencePosition)?;
                let u = if *displacement {
                    need(self.vector(Role::Displacement, snapshot)?, Role::Displacement)?
                } else {
                    let x = positions(snapshot, self.remarks)?;
                    x.iter().zip(&X).map(|(x, X)| x - X).collect()
                };
                (X, u)
            }
            Scheme::PointsAtRest => {
                let u = need(self.vector(Role::Displacement, snapshot)?, Role::Displacement)?;
                (positions(snapshot, self.remarks)?, u)
            }
            Scheme::Recovered => {
                let u = need(self.vector(Role::Displacement, snapshot)?, Role::Displacement)?;
                let x = positions(snapshot, self.remarks)?;
                (x.iter().zip(&u).map(|(x, u)| x - u).collect(), u)
            }
            Scheme::Traced(traced) => {
                let x = positions(snapshot, self.remarks)?;
                let X = self.traced(traced, snapshot, ids.as_deref())?;
                let u = x.iter().zip(&X).map(|(x, X)| x - X).collect();
                (X, u)
            }
        };
        self.judge_places(&X, snapshot);
        let v = match (snapshot.field("VelocityTime"), self.has_velocity_times) {
            (Some(own), _) => {
                let what = "frame(s) tell a time for their velocities that is not finite";
                let first = || snapshot.path().display().to_string();
                self.remarks.met(
                    "time-not-finite",
                    true,
                    usize::from(!own.is_finite()),
                    what,
                    first,
                );
                self.vector(Role::Velocity, snapshot)?.map(|v| (v, own))
            }
            (None, true) => {
                self.remarks.met(
                    "velocity-without-time",
                    false,
                    1,
                    "frame(s) do not tell the time of their velocities, as others do; those are not compared",
                    || snapshot.path().display().to_string(),
                );
                None
            }
            (None, false) => {
                let own = time - self.options.velocity_lag;
                self.vector(Role::Velocity, snapshot)?.map(|v| (v, own))
            }
        };
        let F = self.tensor(Role::DeformationGradient, snapshot)?;
        let P = self.tensor(Role::FirstPiolaKirchhoff, snapshot)?;
        Ok(FrameData { X, u, v, F, P })
    }

    /// Holds the particles against those of the first frame.
    fn identify(&mut self, snapshot: &Snapshot, index: usize, ids: Option<&[i64]>) {
        let particles = snapshot.particles();
        let path = || snapshot.path().display().to_string();
        let known: Option<HashSet<i64>> = ids.map(|ids| ids.iter().copied().collect());
        if let Some(known) = &known {
            let what = "particle(s) have an identity that another one of their frame has";
            let repeated = ids.map_or(0, <[i64]>::len) - known.len();
            self.remarks.met("repeated-id", true, repeated, what, path);
        }
        if index == 0 {
            self.first = Identities { particles, ids: known };
            return;
        }
        if particles != self.first.particles {
            let what = format!(
                "frame(s) hold another number of particles than the first one's {}",
                self.first.particles
            );
            let first = || format!("{} holds {particles}", snapshot.path().display());
            self.remarks.met("unequal-particles", true, 1, what, first);
        }
        if let (Some(known), Some(first)) = (&known, &self.first.ids) {
            for (kind, what, one, other) in [
                ("missing-particles", "particle(s) of the first frame are missing", first, known),
                ("new-particles", "particle(s) are not in the first frame", known, first),
            ] {
                let odd = || one.difference(other);
                let place = || {
                    let id = odd().min().copied().unwrap_or(0);
                    format!("id {id} of {}", snapshot.path().display())
                };
                self.remarks.met(kind, true, odd().count(), what, place);
            }
        }
    }

    /// The reference positions of the frame's particles.
    fn traced(
        &mut self,
        traced: &Traced<D>,
        snapshot: &Snapshot,
        ids: Option<&[i64]>,
    ) -> Result<Vec<SVector<f64, D>>, ScoreError> {
        match (&traced.places, ids) {
            // Particles that the first frame lacks have no reference position; `identify` has told of them.
            (Some(places), Some(ids)) => Ok(ids
                .iter()
                .map(|id| places.get(id).map_or(SVector::repeat(f64::NAN), |p| traced.X[*p]))
                .collect()),
            _ if snapshot.particles() == traced.X.len() => Ok(traced.X.clone()),
            _ => Err(ScoreError::Unmatched {
                path: snapshot.path().to_owned(),
                found: snapshot.particles(),
                expected: traced.X.len(),
            }),
        }
    }

    /// Tells of reference positions that no part of the body has.
    fn judge_places(&mut self, X: &[SVector<f64, D>], snapshot: &Snapshot) {
        let domain = self.exact.domain();
        let (count, furthest) = outside(&domain, X);
        let hint = match self.scheme {
            Scheme::Recovered => {
                "; if the points are reference positions already, --points reference tells so"
            }
            _ => "",
        };
        let what = format!("reference position(s) lie outside the body{hint}");
        let first = || format!("the furthest by {furthest:.3e} in {}", snapshot.path().display());
        self.remarks.met("outside-body", false, count, what, first);
    }

    fn vector(
        &mut self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<Vec<SVector<f64, D>>>, ScoreError> {
        let Some((flat, components)) = self.array(role, snapshot)? else { return Ok(None) };
        Ok(Some(judged(&flat, components, role.name(), snapshot, self.remarks)))
    }

    fn tensor(
        &mut self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<Vec<SMatrix<f64, D, D>>>, ScoreError> {
        let Some((flat, components)) = self.array(role, snapshot)? else { return Ok(None) };
        count_not_finite(&flat, components, role.name(), snapshot, self.remarks);
        Ok(Some(matrices(&flat, components)))
    }

    /// The numbers of an array and how many a particle has.
    fn array(
        &self,
        role: Role,
        snapshot: &Snapshot,
    ) -> Result<Option<(Vec<f64>, usize)>, ScoreError> {
        let Some(head) = self.head(role, snapshot)? else { return Ok(None) };
        Ok(snapshot.floats(&head.name)?.map(|flat| (flat, head.components)))
    }

    /// The array for a role, whose shape may have changed since the first frame.
    fn head<'s>(
        &self,
        role: Role,
        snapshot: &'s Snapshot,
    ) -> Result<Option<&'s ArrayHead>, ScoreError> {
        let Some(name) = self.chosen.name(role) else { return Ok(None) };
        let Some(head) = snapshot.array(name) else { return Ok(None) };
        if role.admits::<D>(head.components) {
            return Ok(Some(head));
        }
        Err(ScoreError::Components {
            path: snapshot.path().to_owned(),
            role,
            name: name.to_owned(),
            components: head.components,
            admissible: role.admissible::<D>(),
        })
    }
}

/// How many places lie outside of the body, and the furthest of them.
fn outside<const D: usize>(domain: &Domain<f64, D>, X: &[SVector<f64, D>]) -> (usize, f64) {
    let (size, distance): (f64, Box<dyn Fn(&SVector<f64, D>) -> f64>) = match domain {
        Domain::Box { lower, upper } => (
            (upper - lower).amax(),
            Box::new(move |X| {
                let beyond = |i: usize| (lower[i] - X[i]).max(X[i] - upper[i]);
                (0..D).map(beyond).fold(f64::NEG_INFINITY, f64::max)
            }),
        ),
        Domain::Annulus { inner, outer } => {
            (*outer, Box::new(move |X| (inner - X.norm()).max(X.norm() - outer)))
        }
        _ => return (0, 0.0),
    };
    let distances = X.iter().map(distance).filter(|distance| *distance > OUTSIDE * size);
    distances.fold((0, 0.0), |(count, furthest), distance| (count + 1, furthest.max(distance)))
}

/// The spacing of as many points spread evenly over their bounding box.
fn spacing<const D: usize>(X: &[SVector<f64, D>]) -> f64 {
    let mut lower = SVector::<f64, D>::repeat(f64::INFINITY);
    let mut upper = SVector::<f64, D>::repeat(f64::NEG_INFINITY);
    for X in X {
        lower = lower.inf(X);
        upper = upper.sup(X);
    }
    let sides: Vec<f64> = (upper - lower).iter().copied().filter(|side| *side > 0.0).collect();
    if sides.is_empty() {
        return f64::NAN;
    }
    (sides.iter().product::<f64>() / X.len() as f64).powf(1.0 / sides.len() as f64)
}
