//! Errors and orders of what another solver wrote, particles or nodes, against the exact solution.
//!
//! The errors are those of [`run`](crate::run): `u` is compared as given, or as position minus reference position, with
//! `u(X, t)`; `v`, `F`, `P`, other stresses, `J` and density where the files hold them. L_inf, L2 and L1 are taken over the particles of a frame, then
//! their maxima over the frames. For frames that `run` wrote at every step they are its errors to the bit.

mod against;
mod arrays;
mod differences;
mod error;
mod findings;
mod frame;
mod quantity;
mod reference;
mod vectors;

pub use against::{AgainstError, Agreement, against};
pub use arrays::Role;
pub use differences::{DifferenceRow, Differences, compare_recordings};
pub use error::ScoreError;
pub use findings::Remark;
pub use quantity::Quantity;

use std::array;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use arrays::Chosen;
use findings::Remarks;
use frame::{FrameReader, Identities};
use mmsmith_measure::norms::PerNorm;
use mmsmith_runtime::{AnySolution, Solution};
use mmsmith_vtk::Provenance;
use mmsmith_vtk::foreign::{FrameFile, Snapshot, frames};
use nalgebra::SVector;
use reference::{Scheme, scheme};
use serde::Serialize;

use crate::order::Order;

/// Share of the time span by which a frame may lie outside before it is told.
const TIME_SLACK: f64 = 1e-6;

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
    /// The solution that the recordings are compared with; that a file tells another one is a remark.
    pub provenance: Option<Provenance>,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        Self {
            map: BTreeMap::new(),
            points: Points::Auto,
            time: None,
            velocity_lag: 0.0,
            periods: 1.0,
            provenance: None,
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

impl Input {
    /// What messages call it.
    fn path(&self) -> &Path {
        self.paths.first().map_or(Path::new(""), PathBuf::as_path)
    }
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
    /// The fields that the files hold.
    pub fields: Vec<Quantity>,
    /// `ok`, or what is wrong with the recording.
    pub status: String,
    /// The errors of u, v, F and P, and of other fields that are there; not a number for those that are not, and where a
    /// number of the files is none.
    pub errors: BTreeMap<Quantity, PerNorm<f64>>,
    /// The exact displacement, as the root of its mean square, the largest over the frames; a length.
    pub exact_displacement: f64,
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
    pub orders: Option<BTreeMap<Quantity, PerNorm<Order>>>,
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
    let errors = rows.iter().map(|row| (row.h, row.is_ok().then_some(&row.errors)));
    Ok(Score { orders: orders(&errors.collect::<Vec<_>>()), rows })
}

/// The errors of a recording, by quantity and norm.
type Errors = BTreeMap<Quantity, PerNorm<f64>>;

/// The orders of the fields that any row has, where there are several rows: each a step and the errors, unless they are of
/// no use.
fn orders(rows: &[(f64, Option<&Errors>)]) -> Option<BTreeMap<Quantity, PerNorm<Order>>> {
    let steps: Vec<f64> = rows.iter().map(|(step, _)| *step).collect();
    let fields: BTreeSet<_> =
        rows.iter().filter_map(|(_, errors)| *errors).flat_map(BTreeMap::keys).collect();
    let order = |field: &Quantity| {
        let of_norm = |norm| {
            let errors = rows.iter().map(|(_, errors)| Some(errors.as_ref()?.get(field)?[norm]));
            Order::of(&steps, &errors.collect::<Vec<_>>())
        };
        (*field, PerNorm::from_fn(of_norm))
    };
    (rows.len() > 1).then(|| fields.into_iter().map(order).collect())
}

/// One frame with its time.
struct Timed {
    file: FrameFile,
    time: f64,
}

/// A recording, and how its frames are read.
struct Opened<const D: usize> {
    /// At least one.
    timed: Vec<Timed>,
    first: Snapshot,
    chosen: Chosen,
    scheme: Scheme<D>,
    has_velocity_times: bool,
}

impl<const D: usize> Opened<D> {
    fn new(
        exact: &dyn Solution<f64, D>,
        input: &Input,
        options: &ScoreOptions,
        remarks: &mut Remarks,
    ) -> Result<Self, ScoreError> {
        let mut files = vec![];
        for path in &input.paths {
            files.extend(frames(path)?);
        }
        let timed = times(exact, files, input.path(), options, remarks)?;
        let first = open(&timed[0].file)?;
        let chosen = Chosen::find::<D>(&first, &options.map, remarks)?;
        let scheme = scheme(exact, &timed, &first, &chosen, options, remarks)?;
        let has_velocity_times =
            chosen.name(Role::Velocity).is_some() && any_velocity_time(&timed, &first)?;
        Ok(Self { timed, first, chosen, scheme, has_velocity_times })
    }

    fn reader<'a>(
        &'a self,
        exact: &'a dyn Solution<f64, D>,
        options: &'a ScoreOptions,
        remarks: &'a mut Remarks,
    ) -> FrameReader<'a, D> {
        FrameReader {
            exact,
            chosen: &self.chosen,
            scheme: &self.scheme,
            options,
            has_velocity_times: self.has_velocity_times,
            remarks,
            first: Identities::default(),
        }
    }
}

fn recording<const D: usize>(
    exact: &dyn Solution<f64, D>,
    input: &Input,
    options: &ScoreOptions,
) -> Result<ScoreRow, ScoreError> {
    let mut remarks = Remarks::default();
    let opened = Opened::new(exact, input, options, &mut remarks)?;
    let Opened { timed, first, chosen, scheme, .. } = &opened;
    let mut reader = opened.reader(exact, options, &mut remarks);
    let mut largest = [PerNorm::<f64>::default(); 8];
    let mut transposed = [PerNorm::<f64>::default(); 2];
    let mut density_from_rest = PerNorm::<f64>::default();
    let mut displacement = PerNorm::<f64>::default();
    let mut compared = [0_usize; 8];
    let mut h = f64::NAN;
    for (index, frame) in timed.iter().enumerate() {
        let snapshot = open(&frame.file)?;
        let data = reader.frame(&snapshot, frame.time, index)?;
        if index == 0 {
            h = match input.resolution {
                Resolution::Cells(cells) => exact.cell_length() / cells as f64,
                Resolution::Length(length) => length,
                Resolution::Estimated => spacing(&data.X),
            };
        }
        let of_frame = data.errors(exact, frame.time);
        for (count, is_there) in compared.iter_mut().zip(data.fields()) {
            *count += usize::from(is_there);
        }
        largest = array::from_fn(|n| largest[n].larger(&of_frame.errors[n]));
        transposed = array::from_fn(|n| transposed[n].larger(&of_frame.transposed[n]));
        density_from_rest = density_from_rest.larger(&of_frame.density_from_rest);
        displacement = displacement.larger(&of_frame.displacement);
    }

    let absent = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
    let mut errors = BTreeMap::new();
    let mut fields = vec![];
    for ((field, norms), count) in Quantity::ALL.into_iter().zip(largest).zip(compared) {
        if count > 0 {
            fields.push(field);
            errors.insert(field, norms);
        } else if Quantity::OF_RUNS.contains(&field) {
            errors.insert(field, absent);
        }
        let (frames, role) = (timed.len(), field.role());
        // Velocities without a time, as in the first state of a staggered scheme, are told of elsewhere.
        let is_told = [Role::Displacement, Role::Velocity].contains(&role);
        if count < frames && chosen.name(role).is_some() && !is_told {
            let what = format!("{} of {frames} frames have no array for {role}", frames - count);
            remarks.note("array-missing", true, what);
        }
    }
    let turning = [Quantity::DeformationGradient, Quantity::FirstPiolaKirchhoff];
    for (field, turned) in turning.into_iter().zip(transposed) {
        let given = errors[&field].l2;
        if turned.l2 < 0.5 * given {
            let what = format!(
                "the transpose of {field} has the L2 error {:.3e} instead of {given:.3e}: is {field} written column by \
                 column, or with its indices the other way round ([J][i])?",
                turned.l2
            );
            remarks.note("transposed", false, what);
        }
    }
    if let (Some(asked), Some(told)) = (&options.provenance, first.provenance())
        && let Some(what) = other_provenance(asked, &told)
    {
        remarks.note("other-provenance", false, what);
    }
    if let Some(of_density) = errors.get(&Quantity::Density)
        && density_from_rest.linf < 1e-6 * of_density.linf
    {
        let what = "the density is that of the undeformed body throughout: it is compared with mass per current volume";
        remarks.note("reference-density", false, what);
    }
    let slack = TIME_SLACK * options.periods * exact.period();
    let later = timed.iter().filter(|frame| frame.time > slack).count();
    if later == 1 {
        let what = format!(
            "one frame after t = 0 stands for the whole time: at t = {:?} errors may be much smaller than between. Ten frames, \
             evenly spread, tell more",
            timed[timed.len() - 1].time
        );
        remarks.note("one-frame", false, what);
    }
    for (field, norms) in &errors {
        let is_compared = fields.contains(field);
        // What is not finite in the files has been told.
        if is_compared
            && !remarks.has("not-finite")
            && norms.iter().any(|(_, value)| !value.is_finite())
        {
            let what = format!(
                "the errors of {field} are too large for a double, though its values are finite: is the array damaged?"
            );
            remarks.note("overflow", true, what);
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
        file: input.path().display().to_string(),
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
        exact_displacement: displacement.l2,
        findings,
    })
}

/// In words, how the solution of a file differs from the one that it is compared with; a parameter that the file does not tell
/// differs in nothing.
fn other_provenance(asked: &Provenance, told: &Provenance) -> Option<String> {
    if told.solution != asked.solution {
        let (told, asked) = (&told.solution, &asked.solution);
        return Some(format!("the file tells that it is of {told}, and is compared with {asked}"));
    }
    let other = |(name, value): (&String, &f64)| {
        let told = told.parameters.get(name).filter(|told| *told != value)?;
        Some(format!(" --set {name}={told:?}"))
    };
    let others: String = asked.parameters.iter().filter_map(other).collect();
    let what = "the file tells other parameters than those that it is compared with; its own are";
    (!others.is_empty()).then(|| format!("{what}{others}"))
}

fn open(file: &FrameFile) -> Result<Snapshot, ScoreError> {
    let snapshot = Snapshot::open(file)?;
    if snapshot.particles() == 0 {
        return Err(ScoreError::NoParticles { path: snapshot.path().to_owned() });
    }
    Ok(snapshot)
}

/// The frames with their times; those without a finite one are left out, which is told.
fn times<const D: usize>(
    exact: &dyn Solution<f64, D>,
    files: Vec<FrameFile>,
    path: &Path,
    options: &ScoreOptions,
    remarks: &mut Remarks,
) -> Result<Vec<Timed>, ScoreError> {
    if options.time.is_some() && files.len() != 1 {
        return Err(ScoreError::OneTime { path: path.to_owned(), frames: files.len() });
    }
    let mut timed = vec![];
    let mut first_bad = None;
    let count = files.len();
    for file in files {
        let time = match (options.time, file.time) {
            (Some(time), _) | (None, Some(time)) => time,
            (None, None) => {
                let snapshot = open(&file)?;
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
        return Err(ScoreError::TimesNotFinite { path: path(), frames: count, first });
    }
    let end = options.periods * exact.period();
    let slack = TIME_SLACK * end;
    let is_outside = |frame: &&Timed| !(-slack..=end + slack).contains(&frame.time);
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
        let what = format!(
            "{falls} of {} frames are not later than the frame before; they are taken in the order of their times",
            timed.len()
        );
        remarks.note("times-not-increasing", false, what);
        timed.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
    Ok(timed)
}

/// Whether any frame tells a time of its own for velocities; of those, others cannot be taken to hold for their frame's.
fn any_velocity_time(timed: &[Timed], first: &Snapshot) -> Result<bool, ScoreError> {
    if first.field("VelocityTime").is_some() {
        return Ok(true);
    }
    match timed.last() {
        Some(last) if timed.len() > 1 => Ok(open(&last.file)?.field("VelocityTime").is_some()),
        _ => Ok(false),
    }
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
