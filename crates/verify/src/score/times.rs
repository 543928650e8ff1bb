//! The frames of a recording with their times.

use std::path::Path;

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::{FrameFile, Snapshot};

use super::error::ScoreError;
use super::findings::Remarks;
use super::options::{ScoreOptions, Times};
use crate::points::interior;

/// Share of the time span by which a frame may lie outside before it is told.
pub(super) const TIME_SLACK: f64 = 1e-6;

/// One frame with its time.
pub(super) struct Timed {
    pub(super) file: FrameFile,
    pub(super) time: f64,
}

pub(super) fn open(file: &FrameFile) -> Result<Snapshot, ScoreError> {
    let snapshot = Snapshot::open(file)?;
    if snapshot.particles() == 0 {
        return Err(ScoreError::NoParticles { path: snapshot.path().to_owned() });
    }
    Ok(snapshot)
}

/// The frames with their times; those without a finite one are left out, which is told.
pub(super) fn times<const D: usize>(
    exact: &dyn Solution<f64, D>,
    files: Vec<FrameFile>,
    path: &Path,
    options: &ScoreOptions,
    remarks: &mut Remarks,
) -> Result<Vec<Timed>, ScoreError> {
    let times = match &options.times {
        Times::Told => told(exact, &files, remarks)?,
        Times::Step(step) => (0..files.len()).map(|frame| frame as f64 * step).collect(),
        Times::At(times) if times.len() == files.len() => times.clone(),
        Times::At(times) => {
            let (path, times, frames) = (path.to_owned(), times.len(), files.len());
            return Err(ScoreError::OtherTimes { path, times, frames });
        }
    };
    let mut timed = vec![];
    let mut first_bad = None;
    let count = files.len();
    for (file, time) in files.into_iter().zip(times) {
        let time = time * options.placing.time_unit;
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
    // A time, or a load factor, of a solution that does not move has no bounds.
    let bounded = if is_static(exact) { &timed[..0] } else { &timed[..] };
    let outside = bounded.iter().filter(is_outside).count();
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

/// The times that the files tell; zero where the solution has none.
fn told<const D: usize>(
    exact: &dyn Solution<f64, D>,
    files: &[FrameFile],
    remarks: &mut Remarks,
) -> Result<Vec<f64>, ScoreError> {
    let mut times = vec![];
    for file in files {
        let told = match file.time {
            Some(time) => Some(time),
            None => {
                let snapshot = open(file)?;
                let names = ["TimeValue", "TIME", "Time", "time"];
                names.iter().find_map(|name| snapshot.field(name))
            }
        };
        let Some(time) = told else {
            if is_static(exact) {
                return Ok(vec![0.0; files.len()]);
            }
            let named =
                named(files).ok_or_else(|| ScoreError::NoTime { path: file.path.clone() })?;
            let what = format!(
                "the times {:?} to {:?} are the numbers in the names of the files; --times or --frame-step gives others",
                named[0],
                named[named.len() - 1]
            );
            remarks.note("times-of-names", false, what);
            return Ok(named);
        };
        times.push(time);
    }
    Ok(times)
}

/// Times in the names of files, as in `out_0.0050.csv`: the last number of each has a decimal point, and rises from file to file.
/// Whole numbers count frames or steps.
fn named(files: &[FrameFile]) -> Option<Vec<f64>> {
    let time = |file: &FrameFile| {
        let stem = file.path.file_stem()?.to_str()?;
        let is_of_number = |letter: char| letter.is_ascii_digit() || letter == '.';
        let words = stem.trim_end_matches(is_of_number);
        let number = stem[words.len()..].trim_start_matches('.');
        number.contains('.').then(|| number.parse::<f64>().ok()).flatten()
    };
    let times: Vec<f64> = files.iter().map(time).collect::<Option<_>>()?;
    (times.len() > 1 && times.windows(2).all(|pair| pair[0] < pair[1])).then_some(times)
}

/// Points at which a solution is looked at to see whether it moves.
const LOOKED_AT: usize = 8;

/// Whether nothing of a solution depends on time: its displacements are the same at several times and places, to the bit.
pub(crate) fn is_static<const D: usize>(exact: &dyn Solution<f64, D>) -> bool {
    let domain = exact.domain();
    let rests = |place| {
        interior(&domain, exact.period(), place)
            .is_some_and(|(X, t)| exact.displacement(&X, t) == exact.displacement(&X, 0.0))
    };
    (0..LOOKED_AT).all(rests)
}

/// Whether any frame tells a time of its own for velocities; of those, others cannot be taken to hold for their frame's.
pub(super) fn any_velocity_time(timed: &[Timed], first: &Snapshot) -> Result<bool, ScoreError> {
    if first.field("VelocityTime").is_some() {
        return Ok(true);
    }
    match timed.last() {
        Some(last) if timed.len() > 1 => Ok(open(&last.file)?.field("VelocityTime").is_some()),
        _ => Ok(false),
    }
}
