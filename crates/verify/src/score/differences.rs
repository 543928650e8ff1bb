//! Recordings of one problem compared with each other.
//!
//! Against the exact solution the error of time stepping hides behind that of the grid. Between two recordings on one grid the
//! latter drops out: for an error `C dt^p` runs with `dt` and `dt/r` differ by `(1 - r^-p) C dt^p`, so that the slope over
//! `dt` is `p` as long as `r` stays the same.

use std::collections::{BTreeMap, HashMap};

use mmsmith_measure::norms::PerNorm;
use mmsmith_measure::{RUNS, Row, over_particles};
use mmsmith_runtime::{AnySolution, BLOCK, Solution};
use serde::Serialize;

use crate::dimension::in_dimension;
use crate::order::Order;

use super::data::FrameData;
use super::findings::Remarks;
use super::points::{Taken, decide};
use super::recording::{Opened, status};
use super::times::{TIME_SLACK, open};
use super::{Input, Quantity, Remark, ScoreError, ScoreOptions, orders};

/// Share of the first ratio of time steps by which others may differ.
const SAME_RATIO: f64 = 1e-3;

/// A recording compared with the next one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DifferenceRow {
    /// Path of the recording.
    pub file: String,
    /// Path of the next recording, which it was compared with.
    pub other: String,
    /// The time step of the first of them, in the solution's unit of time.
    pub dt: f64,
    /// Particles that both have in their first frames.
    pub particles: usize,
    /// Frames at times that both have.
    pub frames: usize,
    /// `ok`, or what is wrong with a recording.
    pub status: String,
    /// Norms of the difference over the particles, the largest over the frames, of the fields that both hold; in the unit of
    /// the field.
    pub differences: BTreeMap<Quantity, PerNorm<f64>>,
    /// Further remarks; problems first.
    #[serde(skip)]
    pub findings: Vec<Remark>,
}

/// Recordings compared each with the next one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Differences {
    /// One row for each recording but the last.
    pub rows: Vec<DifferenceRow>,
    /// The orders with respect to the time step, where there are several rows.
    pub orders: Option<BTreeMap<Quantity, PerNorm<Order>>>,
}

/// Compares each recording with the next one, whose time step is smaller; `steps` are their time steps.
///
/// The exact solution has a part in it only where reference positions are traced, and as the time in which frames are expected.
///
/// # Errors
///
/// [`ScoreError`] for the first recording that cannot be read or compared, and for time steps whose ratio changes.
pub fn compare_recordings(
    exact: &AnySolution<f64>,
    inputs: &[Input],
    steps: &[f64],
    options: &ScoreOptions,
) -> Result<Differences, ScoreError> {
    if steps.len() != inputs.len() || steps.len() < 2 {
        return Err(ScoreError::Steps { steps: steps.len(), recordings: inputs.len() });
    }
    let ratio = steps[0] / steps[1];
    for pair in steps.windows(2) {
        let found = pair[0] / pair[1];
        if !((found / ratio - 1.0).abs() < SAME_RATIO && found > 1.0) {
            return Err(ScoreError::Ratio { coarse: pair[0], fine: pair[1], ratio });
        }
    }
    let mut rows = in_dimension!(
        exact,
        |exact| compare_all(exact, inputs, steps, options),
        else Err(ScoreError::Dimension)
    )?;
    let values = rows.iter().map(|row| (row.dt, (row.status == "ok").then_some(&row.differences)));
    let orders = orders(&values.collect::<Vec<_>>());
    judge_growth(&mut rows);
    Ok(Differences { orders, rows })
}

/// Says of the last row that differences grow where those of an order in time fall.
fn judge_growth(rows: &mut [DifferenceRow]) {
    /// Differences that rounding alone leaves do not grow by so much.
    const CLEAR: f64 = 1.5;
    let of =
        |row: &DifferenceRow| row.differences.get(&Quantity::Displacement).map(|norms| norms.l2);
    let [first, .., last] = rows else { return };
    if let (Some(before), Some(after)) = (of(first), of(last))
        && after > CLEAR * before
    {
        let message = format!(
            "the difference of u grows from {before:.3e} to {after:.3e} (l2) as the step falls from {} to {}: the recordings stand in another order \
             than the steps of --differences, whose largest comes first, or the solver does not converge in time",
            first.dt, last.dt
        );
        last.findings.push(Remark {
            kind: "grows",
            is_problem: true,
            count: 1,
            frames: 0,
            message,
        });
        last.findings.sort_by_key(|finding| !finding.is_problem);
        last.status = status(&last.findings);
    }
}

fn compare_all<const D: usize>(
    exact: &dyn Solution<f64, D>,
    inputs: &[Input],
    steps: &[f64],
    options: &ScoreOptions,
) -> Result<Vec<DifferenceRow>, ScoreError> {
    let taken = decide(exact, inputs, options)?.taken;
    let both: Vec<_> = inputs.iter().zip(&taken).collect();
    let pairs = both.windows(2).zip(steps);
    pairs.map(|(pair, dt)| compare(exact, pair[0], pair[1], *dt, options)).collect()
}

fn compare<const D: usize>(
    exact: &dyn Solution<f64, D>,
    (one, one_taken): (&Input, &Taken),
    (other, other_taken): (&Input, &Taken),
    dt: f64,
    options: &ScoreOptions,
) -> Result<DifferenceRow, ScoreError> {
    let mut remarks = Remarks::default();
    let mut of_other = Remarks::default();
    let coarse = Opened::new(exact, one, options, one_taken, &mut remarks)?;
    let fine = Opened::new(exact, other, options, other_taken, &mut of_other)?;
    let slack = TIME_SLACK * options.periods * exact.period();
    let mut frames = 0;
    let mut particles = 0;
    let mut differences = BTreeMap::new();
    let mut velocities_apart = false;
    let mut of_coarse = coarse.reader(exact, options, &mut remarks);
    let mut of_fine = fine.reader(exact, options, &mut of_other);
    for frame in &coarse.found.timed {
        let same = fine.found.timed.iter().position(|fine| (fine.time - frame.time).abs() <= slack);
        let Some(place) = same else { continue };
        let twin = &fine.found.timed[place];
        let a = of_coarse.frame(&open(&frame.file)?, frame.time, frames)?;
        let b = of_fine.frame(&open(&twin.file)?, twin.time, frames)?;
        let pairs = pairs(&a, &b).ok_or_else(|| ScoreError::Apart {
            path: one.path().to_owned(),
            other: other.path().to_owned(),
            time: frame.time,
        })?;
        if frames == 0 {
            particles = pairs.len();
        }
        frames += 1;
        let has_velocities =
            matches!((&a.v, &b.v), (Some((_, t)), Some((_, s))) if (t - s).abs() <= slack);
        velocities_apart |= a.v.is_some() && b.v.is_some() && !has_velocities;
        let there = (a.fields().into_iter().zip(b.fields())).zip(Quantity::ALL);
        let norms = norms(&a, &b, &pairs);
        for (((in_a, in_b), field), norms) in there.zip(norms) {
            if in_a && in_b && (field != Quantity::Velocity || has_velocities) {
                let largest: &mut PerNorm<f64> = differences.entry(field).or_default();
                *largest = largest.larger(&norms);
            }
        }
    }
    if frames == 0 {
        return Err(ScoreError::NoCommonTime {
            path: one.path().to_owned(),
            other: other.path().to_owned(),
        });
    }
    let is_same = |norms: &PerNorm<f64>| norms.linf == 0.0;
    if differences.values().all(is_same) {
        let what = format!(
            "every field is equal to the last bit in {}, at {frames} time(s): both are of one run, the step has no effect, or the start alone is \
             compared; no order in time shows",
            other.path().display()
        );
        remarks.note("equal", true, what);
    }
    let left_out = coarse.found.timed.len() - frames;
    if left_out > 0 {
        let what = format!(
            "{left_out} of {} frames have no frame of {} at their time",
            coarse.found.timed.len(),
            other.path().display()
        );
        remarks.note("not-common", false, what);
    }
    if velocities_apart {
        let what = "velocities of the two belong to other times, as of staggered schemes, and are not compared there";
        remarks.note("velocity-times", false, what);
    }
    let mut findings = remarks.list();
    findings.extend(of_other.list());
    findings.sort_by_key(|finding| !finding.is_problem);
    findings.dedup();
    Ok(DifferenceRow {
        file: one.path().display().to_string(),
        other: other.path().display().to_string(),
        dt,
        particles,
        frames,
        status: status(&findings),
        differences,
        findings,
    })
}

/// The numbers of the same particle in both frames, by identity or order; none where they are not the same particles.
fn pairs<const D: usize>(a: &FrameData<D>, b: &FrameData<D>) -> Option<Vec<(usize, usize)>> {
    /// Share of the body by which reference positions of one particle may differ.
    const SAME_PLACE: f64 = 1e-6;
    let pairs: Vec<_> = match (&a.ids, &b.ids) {
        (Some(a), Some(b)) => {
            let places: HashMap<_, _> = b.iter().enumerate().map(|(n, id)| (id, n)).collect();
            let pair = |(n, id)| Some((n, *places.get(id)?));
            a.iter().enumerate().map(pair).collect::<Option<_>>()?
        }
        _ if a.X.len() == b.X.len() => (0..a.X.len()).map(|n| (n, n)).collect(),
        _ => return None,
    };
    let size = a.X.iter().map(|X| X.amax()).fold(0.0, f64::max);
    let is_same = |&(n, m): &(usize, usize)| (a.X[n] - b.X[m]).amax() <= SAME_PLACE * size;
    pairs.iter().all(is_same).then_some(pairs)
}

/// The norms of the difference, in the order of [`Quantity::ALL`]; zero for what either lacks.
fn norms<const D: usize>(
    a: &FrameData<D>,
    b: &FrameData<D>,
    pairs: &[(usize, usize)],
) -> [PerNorm<f64>; 8] {
    let of_pair = |(n, m): (usize, usize)| {
        let v = match (&a.v, &b.v) {
            (Some((a, _)), Some((b, _))) => (a[n] - b[m]).norm(),
            _ => 0.0,
        };
        let tensor = |k: usize| match (&a.tensors[k], &b.tensors[k]) {
            (Some(a), Some(b)) => (a[n] - b[m]).norm(),
            _ => 0.0,
        };
        let scalar = |k: usize| match (&a.scalars[k], &b.scalars[k]) {
            (Some(a), Some(b)) => (a[n] - b[m]).abs(),
            _ => 0.0,
        };
        let [F, P, cauchy, kirchhoff] = [0, 1, 2, 3].map(tensor);
        [(a.u[n] - b.u[m]).norm(), v, F, P, cauchy, kirchhoff, scalar(0), scalar(1)]
    };
    let magnitudes = |(): &mut (), first: usize, magnitudes: &mut [[Row<f64>; 8]]| {
        let count = (magnitudes.len().min(RUNS) * BLOCK).min(pairs.len() - first);
        for n in 0..count {
            let own = of_pair(pairs[first + n]);
            for (row, magnitude) in magnitudes[n / BLOCK].iter_mut().zip(own) {
                row[n % BLOCK] = magnitude;
            }
        }
    };
    over_particles(pairs.len(), || (), magnitudes)
}
