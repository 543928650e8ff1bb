//! Convergence studies: the same case on several grids or with several time steps.

use mmsmith_measure::norms::{Field, Norm, PerField, PerNorm};
use mmsmith_runtime::AnySolution;
use serde::Serialize;
use thiserror::Error;

use crate::case::{Arithmetic, Case};
use crate::discretized::Discretized;
use crate::error::CaseError;
use crate::order::Order;
use crate::run::{Outputs, Progress, Row, Status};

/// The setting that changes from row to row.
#[derive(Clone, Debug, PartialEq)]
pub enum Sweep {
    /// The cell count, at a fixed CFL number; orders are with respect to `h`.
    Cells(Vec<usize>),
    /// The CFL number, at a fixed cell count; orders are with respect to `dt`.
    Cfls(Vec<f64>),
}

impl Sweep {
    /// The cases, in order.
    #[must_use]
    pub fn cases(&self, base: &Case) -> Vec<Case> {
        match self {
            Self::Cells(cells) => cells.iter().map(|&cells| Case { cells, ..*base }).collect(),
            Self::Cfls(cfls) => cfls.iter().map(|&cfl| Case { cfl, ..*base }).collect(),
        }
    }
}

/// Rows and their orders of accuracy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// One row for each case, in order.
    pub rows: Vec<Row>,
    /// The observed orders; rows whose run did not end well are left out.
    pub orders: PerField<PerNorm<Order>>,
}

impl Study {
    /// The rows of `sweep`'s cases, in its order, with their orders.
    #[must_use]
    pub fn new(rows: Vec<Row>, sweep: &Sweep) -> Self {
        let orders = orders(&rows, sweep);
        Self { rows, orders }
    }
}

impl Study {
    /// Runs the cases of `sweep`, in its order, and derives the orders of accuracy in every field and norm.
    ///
    /// `progress` is called after every step.
    ///
    /// # Errors
    ///
    /// [`StudyError`] for the first case that cannot be run.
    pub fn measure(
        cases: &[Discretized<'_>],
        sweep: &Sweep,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Self, StudyError> {
        let total: f64 = cases.iter().map(|case| case.plan().work()).sum();
        let mut before = 0.0;
        let mut rows = Vec::with_capacity(cases.len());
        for (index, case) in cases.iter().enumerate() {
            let work = case.plan().work();
            let mut report = |done: Progress| {
                let share = (before + done.share * work) / total;
                progress(Progress { case: index, share, ..done });
            };
            let row = case.run(&mut Outputs::new(&mut report));
            rows.push(row.map_err(|cause| StudyError { index, cause })?);
            before += work;
        }
        Ok(Self::new(rows, sweep))
    }
}

/// A case of a study could not be run.
// The message has the cause, which is therefore no `source`: whoever prints both would print it twice.
#[derive(Debug, Error)]
#[error("case {}: {cause}", index + 1)]
pub struct StudyError {
    /// The case's number in the sweep, from 0.
    pub index: usize,
    /// Why.
    pub cause: CaseError,
}

/// Puts every case of `sweep` on its grid, before the first run, and [measures](Study::measure) them.
///
/// # Errors
///
/// [`StudyError`] for the first case that cannot be run.
pub fn converge(
    exact: &AnySolution<f64>,
    arithmetic: Arithmetic<'_>,
    base: &Case,
    sweep: &Sweep,
    progress: &mut dyn FnMut(Progress),
) -> Result<Study, StudyError> {
    let prepare = |(index, case)| {
        Discretized::new(exact, arithmetic, case).map_err(|cause| StudyError { index, cause })
    };
    let cases = sweep.cases(base);
    let cases = cases.iter().enumerate().map(prepare).collect::<Result<Vec<_>, _>>()?;
    Study::measure(&cases, sweep, progress)
}

/// The orders over the rows of a sweep.
fn orders(rows: &[Row], sweep: &Sweep) -> PerField<PerNorm<Order>> {
    let step = |row: &Row| match sweep {
        Sweep::Cells(_) => row.h,
        Sweep::Cfls(_) => row.dt,
    };
    let rows =
        rows.iter().map(|row| (step(row), (row.status == Status::Ok).then_some(&row.errors)));
    orders_of(&rows.collect::<Vec<_>>())
}

/// The orders of errors over steps, those left out that rounding may have caused: at or below `floors`, row by row.
#[must_use]
pub fn orders_above(
    steps: &[f64],
    values: &[Option<&PerField<PerNorm<f64>>>],
    floors: &[PerField<f64>],
) -> PerField<PerNorm<Order>> {
    each_norm(values, |field, norm, errors| {
        let floor =
            |row: usize| floors.get(row).map_or(0.0, |floor| floor[field] * above_mean(norm));
        let above =
            |(row, error): (usize, &Option<f64>)| error.filter(|error| *error >= floor(row));
        let errors: Vec<_> = errors.iter().enumerate().map(above).collect();
        Order::of(steps, &errors)
    })
}

/// The largest error that rounding may cause, in units of its root mean square: the floors are of the latter, and the largest of
/// some thousand particles and steps lies beyond.
pub(crate) fn above_mean(norm: Norm) -> f64 {
    match norm {
        Norm::Linf => 8.0,
        Norm::L2 | Norm::L1 => 1.0,
    }
}

/// The orders of errors, `None` where a case failed, with respect to the steps beside them.
pub(crate) fn orders_of(
    rows: &[(f64, Option<&PerField<PerNorm<f64>>>)],
) -> PerField<PerNorm<Order>> {
    let steps: Vec<f64> = rows.iter().map(|(step, _)| *step).collect();
    let values: Vec<_> = rows.iter().map(|(_, errors)| *errors).collect();
    each_norm(&values, |_, _, errors| Order::of(&steps, errors))
}

/// Results of `judge` for the series of values of every field and norm.
pub(crate) fn each_norm<R>(
    values: &[Option<&PerField<PerNorm<f64>>>],
    judge: impl Fn(Field, Norm, &[Option<f64>]) -> R,
) -> PerField<PerNorm<R>> {
    PerField::from_fn(|field| {
        PerNorm::from_fn(|norm| {
            let pick = |value: &PerField<PerNorm<f64>>| value[field][norm];
            let series: Vec<_> = values.iter().map(|value| value.map(pick)).collect();
            judge(field, norm, &series)
        })
    })
}
