//! The frames of a recording with their times.

use std::path::Path;

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::{FrameFile, Snapshot};

use super::error::ScoreError;
use super::findings::Remarks;
use super::options::ScoreOptions;

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
pub(super) fn any_velocity_time(timed: &[Timed], first: &Snapshot) -> Result<bool, ScoreError> {
    if first.field("VelocityTime").is_some() {
        return Ok(true);
    }
    match timed.last() {
        Some(last) if timed.len() > 1 => Ok(open(&last.file)?.field("VelocityTime").is_some()),
        _ => Ok(false),
    }
}
