//! The error of time stepping alone, by differences between runs on one grid.
//!
//! Against the exact solution the temporal error hides behind the spatial one, which is larger and may have the
//! opposite sign. Between two runs that differ in nothing but the time step the spatial error is common and drops
//! out. What is measured is the difference between a run and the same run with half the time step: for an error
//! `C dt^p` that difference is `(1 - 2^-p) C dt^p`, so its slope over `dt` is `p`, whatever time steps were asked
//! for. A run with a very small time step as the reference would bend that slope, by a tenth for `p = 1` and a
//! reference 16 times finer.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use mmsmith_measure::norms::{PerField, PerNorm, Tallies, is_squarable, magnitude, scale_of};
use mmsmith_runtime::Real;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use crate::drive::{Driven, Outcome, Stepped};
use crate::error::{CaseError, MOST_STEPS, StudyError};
use crate::on_grid::OnGrid;
use crate::order::{Order, orders_of};
use crate::precision::Precision;
use crate::run::{Progress, Status};

/// The runs are compared at this many times, evenly spread, the last one the end.
///
/// Not a divisor of the period: at quarters of it a standing wave has errors of amplitude only, at others of phase.
const INSTANTS: u64 = 5;

/// The differences over a series of time steps, and their orders.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Temporal {
    /// The times at which runs are compared.
    pub times: Vec<f64>,
    /// One row for each CFL number, in order.
    pub rows: Vec<TemporalRow>,
    /// The observed orders in `dt`; rows of which a run did not end well are left out.
    pub orders: PerField<PerNorm<Order>>,
}

impl Temporal {
    /// Rows with their orders.
    pub(crate) fn new(times: Vec<f64>, rows: Vec<TemporalRow>) -> Self {
        let values =
            rows.iter().map(|row| (row.dt, (row.status == Status::Ok).then_some(&row.differences)));
        let orders = orders_of(&values.collect::<Vec<_>>());
        Self { times, rows, orders }
    }
}

/// A run compared with the one of half its time step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TemporalRow {
    /// Number of cells along the cell length.
    pub cells: usize,
    /// Grid spacing, a length.
    pub h: f64,
    /// The larger of the two time steps.
    pub dt: f64,
    /// `dt c/h` for it.
    pub cfl: f64,
    /// Steps to the end time with it; the other run takes twice as many.
    pub steps: u64,
    /// How the two runs ended: the first one that failed is told.
    pub status: Status,
    /// Norms of the difference over particles, the largest over the times; NaN where a run failed.
    ///
    /// Velocities are compared at the common time; where they lag, the mean of those half a step before and after it
    /// is formed.
    pub differences: PerField<PerNorm<f64>>,
}

/// As [`Discretized::differences`](crate::Discretized::differences).
pub(crate) fn over<T: Precision<D>, const D: usize>(
    on_grid: &OnGrid<'_, T, D>,
    cfls: &[f64],
    progress: &mut dyn FnMut(Progress),
) -> Result<Temporal, StudyError>
where
    f64: Precision<D>,
{
    let &OnGrid { end, waves, .. } = on_grid;
    let mut counts = Vec::with_capacity(cfls.len());
    for (index, &cfl) in cfls.iter().enumerate() {
        let fail = |cause| StudyError { index, cause };
        let steps = on_grid.steps_at(cfl).map_err(fail)?;
        let count = steps.count.div_ceil(INSTANTS) * INSTANTS;
        if 2.0 * count as f64 > MOST_STEPS {
            let (dt, steps) = (end / (2 * count) as f64, 2.0 * count as f64);
            return Err(fail(CaseError::TooManySteps { end, dt, steps }));
        }
        counts.push(count);
    }
    // Halves of one row are often the whole of the next.
    let mut runs = BTreeMap::new();
    for (index, &count) in counts.iter().enumerate() {
        runs.entry(count).or_insert(index);
        runs.entry(2 * count).or_insert(index);
    }
    let total: u64 = runs.keys().sum();
    let mut before = 0;
    let mut states = BTreeMap::new();
    for (&count, &index) in &runs {
        let mut report = |step| {
            let share = (before + step) as f64 / total as f64;
            progress(Progress { case: index, step, steps: count, share });
        };
        let set_up = Driven::set_up(on_grid, end / count as f64, None);
        let run = set_up.and_then(|driven| observe(driven, on_grid, count, &mut report));
        states.insert(count, run.map_err(|cause| StudyError { index, cause })?);
        before += count;
    }
    let rows = counts.iter().map(|&count| {
        let dt = end / count as f64;
        let (status, differences) = match (&states[&count], &states[&(2 * count)]) {
            (Ok(coarse), Ok(fine)) => (Status::Ok, largest_difference(coarse, fine)),
            (Err(status), _) | (_, Err(status)) => (status.clone(), not_known()),
        };
        let cfl = waves.cfl(dt);
        TemporalRow {
            cells: on_grid.case.cells,
            h: on_grid.scene.spacing,
            dt,
            cfl,
            steps: count,
            status,
            differences,
        }
    });
    let times = (1..=INSTANTS).map(|part| end * part as f64 / INSTANTS as f64).collect();
    Ok(Temporal::new(times, rows.collect()))
}

/// All particles at one of the common times.
struct State<const D: usize> {
    x: Vec<SVector<f64, D>>,
    v: Vec<SVector<f64, D>>,
    F: Vec<SMatrix<f64, D, D>>,
    P: Vec<SMatrix<f64, D, D>>,
}

/// The states at the common times of a run with `count` steps, or how it failed.
fn observe<T: Precision<D>, const D: usize>(
    mut driven: Driven<'_, T, D>,
    on_grid: &OnGrid<'_, T, D>,
    count: u64,
    progress: &mut dyn FnMut(u64),
) -> Result<Result<Vec<State<D>>, Status>, CaseError> {
    let OnGrid { exact, scene, .. } = on_grid;
    let lags = driven.solver.velocity_lag() > T::zero();
    let mut states: Vec<State<D>> = Vec::new();
    // One step more than the run has: the last velocity at a full step needs it.
    let outcome = driven.advance(1..=count + u64::from(lags), &mut |stepped| {
        let Stepped { step, time, solver, .. } = stepped;
        let (particles, law) = solver.observe();
        let v = || particles.v.iter().map(|v| v.map(Real::to_f64));
        if lags
            && (step - 1) % (count / INSTANTS) == 0
            && let Some(state) = states.last_mut()
        {
            state
                .v
                .iter_mut()
                .zip(v())
                .for_each(|(before, after)| *before = (*before + after) / 2.0);
        }
        if step % (count / INSTANTS) == 0 && step <= count {
            let x: Vec<_> = particles.x.iter().map(|x| x.map(Real::to_f64)).collect();
            for (particle, x) in x.iter().enumerate() {
                let X = particles.X[particle].map(Real::to_f64);
                let error = (x - X - exact.displacement(&X, time)).norm();
                if error > scene.size || error.is_nan() {
                    let size = scene.size;
                    let end = Status::Unstable { step, time, particle, error, size };
                    return Ok(ControlFlow::Break(end));
                }
            }
            // A particle that is inside out has no stress; the solver stops at its next step.
            let none = SMatrix::repeat(f64::NAN);
            let stress = |F: &SMatrix<T, D, D>| {
                law.first_piola_kirchhoff(F).map_or(none, |P| P.map(Real::to_f64))
            };
            states.push(State {
                x,
                v: v().collect(),
                F: particles.F.iter().map(|F| F.map(Real::to_f64)).collect(),
                P: particles.F.iter().map(stress).collect(),
            });
        }
        progress(step.min(count));
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(match outcome {
        Outcome::Done => Ok(states),
        Outcome::Stopped(error) => Err(Status::Stopped(error)),
        Outcome::Left(status) => Err(status),
    })
}

/// The norms of the difference over the particles, the largest over the times.
fn largest_difference<const D: usize>(
    coarse: &[State<D>],
    fine: &[State<D>],
) -> PerField<PerNorm<f64>> {
    let mut largest = PerField::<PerNorm<f64>>::default();
    for (a, b) in coarse.iter().zip(fine) {
        let norms = PerField {
            u: difference(&a.x, &b.x),
            v: difference(&a.v, &b.v),
            F: difference(&a.F, &b.F),
            P: difference(&a.P, &b.P),
        };
        largest = PerField::combine(&largest, &norms, PerNorm::larger);
    }
    largest
}

fn difference<const R: usize, const C: usize>(
    a: &[SMatrix<f64, R, C>],
    b: &[SMatrix<f64, R, C>],
) -> PerNorm<f64> {
    let squarable = |a: &SMatrix<f64, R, C>, b: &SMatrix<f64, R, C>| {
        let (difference, norm) = (a - b, (a - b).norm());
        if is_squarable(norm) { norm } else { magnitude(difference.iter().copied()) }
    };
    let magnitudes: Vec<f64> = a.iter().zip(b).map(|(a, b)| squarable(a, b)).collect();
    let scale = scale_of(magnitudes.iter().copied().fold(0.0, f64::max));
    let mut tally = Tallies::<1>::default();
    magnitudes.iter().for_each(|magnitude| tally.add(&[magnitude / scale]));
    tally.joined().divided_by(scale).norms(a.len())
}

fn not_known() -> PerField<PerNorm<f64>> {
    let none = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
    PerField { u: none, v: none, F: none, P: none }
}
