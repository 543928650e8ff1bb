//! One recording, frame after frame.

use std::array;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mmsmith_measure::norms::PerNorm;
use mmsmith_runtime::{Around, Domain, Solution};
use mmsmith_vtk::Provenance;
use mmsmith_vtk::foreign::ArrayHead;
use nalgebra::SVector;

use super::across::{self, Directions};
use super::arrays::{Chosen, DIGITS_OF_A_DOUBLE, Role};
use super::balance::Balance;
use super::data::FrameErrors;
use super::error::ScoreError;
use super::findings::{Remark, Remarks};
use super::found::Found;
use super::frame::{FrameReader, Identities};
use super::integrated::{Integrated, Mesh};
use super::lag::LagSums;
use super::law::{self, Witnesses};
use super::options::{Input, Resolution, ScoreOptions};
use super::place::Place;
use super::points::Taken;
use super::quantity::Quantity;
use super::reference::{Scheme, scheme};
use super::row::{EXCEEDS_MOTION, ScoreRow, Source};
use super::scales::{Grain, Scales};
use super::shuffled::{self, is_shuffled};
use super::times::{TIME_SLACK, any_velocity_time, is_static, open};
use crate::precision::Precision;

/// A recording, and how its frames are read.
pub(super) struct Opened<const D: usize> {
    pub(super) found: Found,
    scheme: Scheme<D>,
    place: Place<D>,
    has_velocity_times: bool,
    velocity_lag: f64,
}

impl<const D: usize> Opened<D> {
    pub(super) fn new(
        exact: &dyn Solution<f64, D>,
        input: &Input,
        options: &ScoreOptions,
        taken: &Taken,
        remarks: &mut Remarks,
    ) -> Result<Self, ScoreError> {
        let found = Found::new(exact, input, options, remarks)?;
        let place = Place::new(&options.placing, exact.is_half_plane())?;
        let inside = options.placing.inside;
        let scheme = scheme(exact, &found, taken.at_rest, &place, inside, remarks)?;
        if let Some(Remark { kind, is_problem, message, .. }) = &taken.told {
            remarks.note(kind, *is_problem, message);
        }
        let has_velocity_times = found.chosen.name(Role::Velocity).is_some()
            && any_velocity_time(&found.timed, &found.first)?;
        let velocity_lag = input.velocity_lag;
        Ok(Self { found, scheme, place, has_velocity_times, velocity_lag })
    }

    pub(super) fn reader<'a>(
        &'a self,
        exact: &'a dyn Solution<f64, D>,
        options: &'a ScoreOptions,
        remarks: &'a mut Remarks,
    ) -> FrameReader<'a, D> {
        FrameReader {
            exact,
            chosen: &self.found.chosen,
            scheme: &self.scheme,
            place: self.place,
            options,
            has_velocity_times: self.has_velocity_times,
            velocity_lag: self.velocity_lag,
            remarks,
            first: Identities::default(),
        }
    }

    /// Where reference positions and displacements are from.
    pub(super) fn sources(&self) -> (Source, Source) {
        match &self.scheme {
            Scheme::Given { displacement: true } => (Source::Array, Source::Array),
            Scheme::Given { displacement: false } => {
                (Source::Array, Source::PositionsMinusReference)
            }
            Scheme::PointsAtRest => (Source::Points, Source::Array),
            Scheme::Recovered => (Source::PositionsMinusDisplacements, Source::Array),
            Scheme::Traced(_) => (Source::FirstFrame, Source::PositionsMinusReference),
        }
    }

    /// Whether particles are found again by their order.
    fn is_by_order(&self) -> bool {
        matches!(&self.scheme, Scheme::Traced(traced) if traced.places.is_none())
    }

    /// How finely the numbers of the files are written.
    fn grain(&self) -> Grain {
        let Found { first, chosen, .. } = &self.found;
        Grain {
            points: first.points().filter(|points| points.is_single).map_or(0.0, |_| SINGLE),
            fields: Quantity::ALL.map(|field| chosen.head(field.role()).map_or(0.0, grain_of)),
            u_is_difference: matches!(
                self.scheme,
                Scheme::Given { displacement: false } | Scheme::Traced(_)
            ),
        }
    }

    /// Tells of a file that names another solution or other parameters.
    fn tell_provenance(&self, options: &ScoreOptions, remarks: &mut Remarks) {
        if let (Some(asked), Some(told)) = (&options.provenance, self.found.first.provenance())
            && let Some(what) = other_provenance(asked, &told)
        {
            remarks.note("other-provenance", false, what);
        }
    }

    /// Tells where a single frame stands for the whole time `end`.
    fn tell_single_frame(&self, end: f64, remarks: &mut Remarks) {
        let timed = &self.found.timed;
        let later = timed.iter().filter(|frame| frame.time > TIME_SLACK * end).count();
        if later == 1 {
            let what = format!(
                "one frame after t = 0 stands for the whole time: at t = {:?} errors may be much smaller than between. Ten frames, \
                 evenly spread, tell more",
                timed[timed.len() - 1].time
            );
            remarks.note("one-frame", false, what);
        }
    }
}

/// The share of a number that 32 bits cut off.
const SINGLE: f64 = f32::EPSILON as f64 / 2.0;

/// The share of an array's values that the file cuts off.
fn grain_of(head: &ArrayHead) -> f64 {
    if head.is_single {
        return SINGLE;
    }
    match head.digits {
        Some(digits) if digits < DIGITS_OF_A_DOUBLE => 10.0_f64.powi(-(digits as i32)),
        _ => 0.0,
    }
}

/// An error of this share of the motion is as large as the motion.
const AS_LARGE: f64 = 0.99;

/// The largest norms over the frames.
#[derive(Default)]
struct Totals {
    /// In the order of [`Quantity::ALL`].
    errors: [PerNorm<f64>; 8],
    /// Errors of F and P if they were transposed.
    transposed: [PerNorm<f64>; 2],
    /// Errors and sizes across the solution's plane or line.
    across: across::Found,
    /// The frame with the largest error of each field.
    worst: [(usize, f64); 8],
    density_from_rest: PerNorm<f64>,
    displacement: PerNorm<f64>,
    scales: Scales,
    integrated: Option<Integrated>,
    /// The frames that have each field.
    compared: [usize; 8],
    h: f64,
    shift: Option<Vec<f64>>,
    lag: LagSums,
    balance: Balance,
    /// Whether particles without an identity have another order in some frame.
    is_shuffled: bool,
}

impl Totals {
    /// Reads and compares frame after frame.
    fn of<const D: usize>(
        opened: &Opened<D>,
        (exact, directions): (&dyn Solution<f64, D>, &Directions<D>),
        resolution: Resolution,
        reader: &mut FrameReader<'_, D>,
        witnesses: &mut Witnesses<D>,
    ) -> Result<Self, ScoreError>
    where
        f64: Precision<D>,
    {
        let mut totals = Self { h: f64::NAN, ..Self::default() };
        let mut mesh = None;
        for (index, frame) in opened.found.timed.iter().enumerate() {
            let snapshot = open(&frame.file)?;
            let data = reader.frame(&snapshot, frame.time, index)?;
            if index == 0 {
                totals.balance.add_masses(&snapshot, &data, opened.found.is_of_cells)?;
                mesh = Mesh::new(&snapshot, data.X.len(), opened.found.timed.len());
                totals.shift = shift(exact, &data.X);
                totals.h = match resolution {
                    Resolution::Cells(cells) => exact.cell_length() / cells as f64,
                    Resolution::Length(length) => length,
                    Resolution::Estimated => spacing(&data.X),
                };
            }
            for (count, is_there) in totals.compared.iter_mut().zip(data.fields()) {
                *count += usize::from(is_there);
            }
            totals.scales.add(exact, &data.X, frame.time);
            let errors = data.errors(exact, directions, frame.time);
            totals.add(&errors, index);
            if D < 3 {
                let sizes = directions.sizes(exact, &data.X, frame.time);
                let is_less_one = opened.found.chosen.is_less_one;
                totals.across.add::<D>(&data.whole, &errors.across, sizes, is_less_one);
            }
            witnesses.add(&data, frame.time);
            totals.lag.add(exact, &data);
            totals.balance.add(exact, &data);
            if opened.is_by_order() && !totals.is_shuffled {
                totals.is_shuffled = is_shuffled(exact, &data, frame.time);
            }
            if let Some(mesh) = &mut mesh {
                mesh.add(exact, index, &data, frame.time);
            }
        }
        totals.integrated = mesh.and_then(|mesh| mesh.largest);
        Ok(totals)
    }

    fn add(&mut self, frame: &FrameErrors, index: usize) {
        for (worst, errors) in self.worst.iter_mut().zip(&frame.errors) {
            if errors.linf > worst.1 {
                *worst = (index, errors.linf);
            }
        }
        self.errors = array::from_fn(|n| self.errors[n].larger(&frame.errors[n]));
        self.transposed = array::from_fn(|n| self.transposed[n].larger(&frame.transposed[n]));
        self.density_from_rest = self.density_from_rest.larger(&frame.density_from_rest);
        self.displacement = self.displacement.larger(&frame.displacement);
    }

    /// The fields that any frame has.
    fn fields(&self) -> Vec<Quantity> {
        let there = Quantity::ALL.into_iter().zip(self.compared);
        there.filter(|(_, count)| *count > 0).map(|(field, _)| field).collect()
    }

    /// The errors of those, and no numbers for other fields of runs.
    fn errors(&self) -> BTreeMap<Quantity, PerNorm<f64>> {
        let absent = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
        let mut errors = BTreeMap::from(Quantity::OF_RUNS.map(|field| (field, absent)));
        let all = Quantity::ALL.into_iter().zip(self.errors).zip(self.compared);
        errors.extend(all.filter(|(_, count)| *count > 0).map(|(error, _)| error));
        errors
    }

    /// Tells of arrays that some frames lack.
    fn tell_missing(&self, chosen: &Chosen, frames: usize, remarks: &mut Remarks) {
        for (field, count) in Quantity::ALL.into_iter().zip(self.compared) {
            let role = field.role();
            // Velocities without a time, as in the first state of a staggered scheme, are told of elsewhere.
            let is_told = [Role::Displacement, Role::Velocity].contains(&role);
            if count < frames && chosen.name(role).is_some() && !is_told {
                let what =
                    format!("{} of {frames} frames have no array for {role}", frames - count);
                remarks.note("array-missing", true, what);
            }
        }
    }

    /// Tells of F and P whose transpose fits better.
    fn tell_transposed(&self, remarks: &mut Remarks) {
        let turning = [
            (Quantity::DeformationGradient, self.errors[2].l2),
            (Quantity::FirstPiolaKirchhoff, self.errors[3].l2),
        ];
        for ((field, given), turned) in turning.into_iter().zip(self.transposed) {
            if turned.l2 < 0.5 * given {
                let what = format!(
                    "the transpose of {field} has the L2 error {:.3e} instead of {given:.3e}: is {field} written column by \
                     column, or with its indices the other way round ([J][i])?",
                    turned.l2
                );
                remarks.note("transposed", false, what);
            }
        }
    }

    /// Tells of a density that does not change with the volume.
    fn tell_density(&self, remarks: &mut Remarks) {
        let [.., of_density] = self.errors;
        if self.density_from_rest.linf < 1e-6 * of_density.linf {
            let what = "the density is that of the undeformed body throughout: it is compared with mass per current volume";
            remarks.note("reference-density", false, what);
        }
    }

    /// Tells of errors that no double holds.
    fn tell_overflow(&self, remarks: &mut Remarks) {
        // What is not finite in the files has been told.
        if remarks.has("not-finite") {
            return;
        }
        let errors = self.errors();
        for field in self.fields() {
            if errors[&field].iter().any(|(_, value)| !value.is_finite()) {
                let what = format!(
                    "the errors of {field} are too large for a double, though its values are finite: is the array damaged?"
                );
                remarks.note("overflow", true, what);
            }
        }
    }

    /// Tells where the body moves less than the error of its displacement.
    fn tell_excess(&self, remarks: &mut Remarks) {
        let (error, motion) = (self.errors[0].l2, self.displacement.l2);
        if error >= AS_LARGE * motion && self.scales.is_motion(motion) {
            let exceeds = if error > motion { "exceeds" } else { "is as large as" };
            let what = format!(
                "the error of u {exceeds} the motion itself: {error:.2e} for displacements of {motion:.2e} (L2)"
            );
            remarks.note(EXCEEDS_MOTION, true, what);
        }
    }
}

/// How far the middle of the bounding box of places lies from that of the body.
fn shift<const D: usize>(exact: &dyn Solution<f64, D>, X: &[SVector<f64, D>]) -> Option<Vec<f64>> {
    let middle = match exact.domain() {
        Domain::Box { lower, upper } => 0.5 * (lower + upper),
        Domain::Annulus { .. } => SVector::zeros(),
        Domain::Tube { lower, upper, around, .. } if !matches!(around, Around::Sector { .. }) => {
            SVector::from_fn(|i, _| if i == 2 { 0.5 * (lower + upper) } else { 0.0 })
        }
        _ => return None,
    };
    let first = X.first()?;
    let lower = X.iter().fold(*first, |lower, X| lower.inf(X));
    let upper = X.iter().fold(*first, |upper, X| upper.sup(X));
    Some((0.5 * (lower + upper) - middle).iter().copied().collect())
}

/// The errors of one recording.
pub(super) fn recording<const D: usize>(
    exact: &dyn Solution<f64, D>,
    input: &Input,
    options: &ScoreOptions,
    taken: &Taken,
) -> Result<ScoreRow, ScoreError>
where
    f64: Precision<D>,
{
    let mut remarks = Remarks::default();
    let opened = Opened::new(exact, input, options, taken, &mut remarks)?;
    let mut reader = opened.reader(exact, options, &mut remarks);
    let mut witnesses = Witnesses::new(opened.found.timed.len());
    let directions = Directions::new(exact);
    let compared = (exact, &directions);
    let totals = Totals::of(&opened, compared, input.resolution, &mut reader, &mut witnesses)?;
    let across = totals.across.told(&directions, &opened.found.chosen, &mut remarks);
    totals.tell_missing(&opened.found.chosen, opened.found.timed.len(), &mut remarks);
    totals.tell_transposed(&mut remarks);
    opened.tell_provenance(options, &mut remarks);
    totals.tell_density(&mut remarks);
    totals.balance.tell(exact, &mut remarks);
    // A body at rest is the same at all times.
    if !is_static(exact) {
        opened.tell_single_frame(options.periods * exact.period(), &mut remarks);
    }
    totals.tell_overflow(&mut remarks);
    totals.tell_excess(&mut remarks);
    if totals.is_shuffled {
        remarks.note("shuffled", true, shuffled::told(&opened.found)?);
    }
    tell_several(&input.paths, &mut remarks);
    let chosen = &opened.found.chosen;
    let rounding =
        |field: Quantity| chosen.head(field.role()).map_or(0.0, grain_of).max(f64::EPSILON);
    let law = law::compare(exact, &witnesses, &rounding, &mut remarks);
    if input.resolution == Resolution::Estimated {
        let what = "h is estimated, as the spacing of as many points spread evenly over their bounding box; --cells or \
                    --h tells it";
        remarks.note("estimated-h", false, what);
    }
    let findings = remarks.list();
    let (reference_positions, displacements) = opened.sources();
    let span = opened.found.timed.iter().map(|frame| frame.time);
    Ok(ScoreRow {
        file: input.path().display().to_string(),
        cells: match input.resolution {
            Resolution::Cells(cells) => Some(cells),
            _ => None,
        },
        h: totals.h,
        particles: opened.found.first.particles(),
        frames: opened.found.timed.len(),
        first_time: span.clone().fold(f64::INFINITY, f64::min),
        last_time: span.fold(f64::NEG_INFINITY, f64::max),
        reference_positions,
        displacements,
        fields: totals.fields(),
        status: status(&findings),
        errors: totals.errors(),
        across,
        direction: directions.words(),
        worst_frames: Quantity::ALL.into_iter().zip(totals.worst.map(|worst| worst.0)).collect(),
        exact_displacement: totals.displacement.l2,
        integrated: totals.integrated,
        law,
        shift: totals.shift,
        lag: totals.lag.best(),
        floors: totals.scales.floors(exact, &opened.grain()),
        findings,
    })
}

/// Tells of frames that may be recordings of their own.
fn tell_several(paths: &[PathBuf], remarks: &mut Remarks) {
    if paths.len() < 2 || !remarks.has("unequal-particles") {
        return;
    }
    let numbers: Option<Vec<&str>> = paths.iter().map(|path| last_number(path)).collect();
    let is_series = |numbers: &Vec<&str>| numbers.windows(2).all(|pair| pair[0] != pair[1]);
    let cells = numbers.filter(is_series).map_or("N,...".into(), |numbers| numbers.join(","));
    let what = format!(
        "the {} files are taken as frames of one recording; if each is a recording of its own: --each --cells {cells}",
        paths.len()
    );
    remarks.note("several-recordings", false, what);
}

/// The last whole number in a file's name.
fn last_number(path: &Path) -> Option<&str> {
    let stem = path.file_stem()?.to_str()?;
    stem.rsplit(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty())
}

/// `ok`, or the problems.
pub(super) fn status(findings: &[Remark]) -> String {
    let problems = findings.iter().filter(|finding| finding.is_problem);
    let problems: Vec<_> = problems.map(|finding| finding.message.as_str()).collect();
    if problems.is_empty() { "ok".into() } else { problems.join("; ") }
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
