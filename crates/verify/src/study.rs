//! Convergence studies: the same case on several grids or with several time steps.

use mmsmith_measure::norms::{Norm, PerField, PerNorm};
use mmsmith_runtime::AnySolution;
use serde::Serialize;
use std::collections::BTreeMap;

use crate::case::{Arithmetic, Case};
use crate::discretized::Discretized;
use crate::error::StudyError;
use crate::order::{Order, orders_of};
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

    /// The observed orders of internal variables, by name.
    #[must_use]
    pub fn internal_orders(&self, sweep: &Sweep) -> BTreeMap<String, PerNorm<Order>> {
        let steps: Vec<f64> = self.rows.iter().map(|row| step(row, sweep)).collect();
        let names = self.rows.first().map_or(&[][..], |row| &row.internal);
        let of = |(place, (name, _)): (usize, &(String, PerNorm<f64>))| {
            let error = |row: &Row, norm: Norm| {
                let norms = row.internal.get(place).filter(|_| row.status == Status::Ok)?;
                Some(norms.1[norm])
            };
            let order = |norm: Norm| {
                let errors: Vec<_> = self.rows.iter().map(|row| error(row, norm)).collect();
                Order::of(&steps, &errors)
            };
            (name.clone(), PerNorm::from_fn(order))
        };
        names.iter().enumerate().map(of).collect()
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

/// The step that orders of a sweep are about.
fn step(row: &Row, sweep: &Sweep) -> f64 {
    match sweep {
        Sweep::Cells(_) => row.h,
        Sweep::Cfls(_) => row.dt,
    }
}

/// The orders over the rows of a sweep.
fn orders(rows: &[Row], sweep: &Sweep) -> PerField<PerNorm<Order>> {
    let rows = rows
        .iter()
        .map(|row| (step(row, sweep), (row.status == Status::Ok).then_some(&row.errors)));
    orders_of(&rows.collect::<Vec<_>>())
}
