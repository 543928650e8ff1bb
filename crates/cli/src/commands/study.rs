//! Studies: cases that are measured or read from a folder, and the report that their results make.

use std::sync::Mutex;
use std::sync::PoisonError;

use anyhow::Result;
use mmsmith_verify::Progress;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::arguments::{ConvergeOptions, KeepOptions};
use crate::keep::{Found, Keep, Order};
use crate::processes::with_threads;
use crate::progress::Bar;
use crate::report::{Asked, Form, Report};
use crate::terminal;

/// A study: its cases, each with a result, and the report on all results.
pub(super) trait Study: Sync {
    /// The result of a case, which a folder may keep.
    type Found: Serialize + DeserializeOwned + Send;

    /// Whether cases run one after the other, or at once.
    fn order(&self) -> Order {
        Order::OneByOne
    }

    /// Everything that the result of each case depends on.
    fn keys(&self) -> Vec<Value>;

    /// The work of each case, in a unit that is the same on every machine.
    fn work(&self) -> Vec<f64>;

    /// The seconds that each case will take, where that is worth telling.
    fn seconds(&self) -> Option<Vec<f64>> {
        None
    }

    /// Measures a case, and shows how far it is.
    fn measure(&self, case: usize, show: &Show<'_>) -> Result<Self::Found>;

    /// Takes note that another case was under way beside the one with this result.
    fn was_shared(_found: &mut Self::Found) {}

    /// The report on the results of all cases.
    fn report(&self, found: Vec<Self::Found>) -> Result<Report>;
}

/// A case's part of a bar.
pub(super) struct Show<'a> {
    bar: &'a Bar,
    shares: &'a Shares,
    case: usize,
}

impl Show<'_> {
    /// Shows the share of the case that is done, with the message that `what` gives.
    pub(super) fn share(&self, what: impl FnOnce() -> String, share: f64) {
        self.bar.show_share(what, self.shares.set(self.case, share));
    }

    /// Shows how far the case called `what` is.
    pub(super) fn progress(&self, what: &str, progress: Progress) {
        let share = self.shares.set(self.case, progress.share);
        self.bar.show(what, Progress { share, ..progress });
    }
}

/// The parts of a study that are done.
struct Shares {
    /// The part of the whole that each case is.
    parts: Vec<f64>,
    order: Order,
    done: Mutex<Vec<f64>>,
}

impl Shares {
    fn of(work: &[f64], order: Order) -> Self {
        let total: f64 = work.iter().sum();
        let parts = work.iter().map(|work| work / total).collect();
        Self { parts, order, done: Mutex::new(vec![0.0; work.len()]) }
    }

    /// Takes down the share of one case that is done, and gives that of all.
    fn set(&self, case: usize, share: f64) -> f64 {
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        if self.order == Order::OneByOne {
            done[..case].fill(1.0);
        }
        done[case] = share;
        done.iter().zip(&self.parts).map(|(done, part)| done * part).sum()
    }
}

/// A request for a study.
pub(super) struct Request<'a> {
    /// The solution, as the command line names it.
    pub(super) solution: &'a str,
    pub(super) kept: &'a KeepOptions,
    pub(super) threads: Option<usize>,
    pub(super) files: Asked<'a>,
    /// Options that a shard cannot follow, beside those for files, and whether they are given.
    pub(super) others: Vec<(&'static str, bool)>,
}

impl<'a> Request<'a> {
    /// For a series of grids or of time steps.
    pub(super) fn of_orders(options: &'a ConvergeOptions) -> Self {
        let ConvergeOptions { scheme, plot, csv, markdown, latex, .. } = options;
        Self {
            solution: &options.name,
            kept: &options.kept,
            threads: scheme.threads,
            files: Asked(vec![
                (Form::Json, &scheme.json),
                (Form::Plot, plot),
                (Form::Csv, csv),
                (Form::Markdown, markdown),
                (Form::Latex, latex),
            ]),
            others: vec![
                ("--expect", options.expect.is_some()),
                ("--tolerance", options.tolerance.is_some()),
            ],
        }
    }
}

/// Does a study and publishes its report; whether all that was promised holds. A shard does its part, and tells of it.
pub(super) fn conduct<S: Study>(study: &S, request: &Request<'_>) -> Result<bool> {
    let options = [&request.files.options()[..], &request.others].concat();
    let keep = Keep::open(request.kept, request.solution, &options)?;
    let files = request.files.prepare()?;
    with_threads(request.threads, || {
        let found = {
            let seconds = study.seconds();
            let bar = Bar::expecting("starting", seconds.as_ref().map(|all| all.iter().sum()));
            results(study, &keep, seconds, &bar)?
        };
        match found {
            Found::All(found) => study.report(found)?.publish(files),
            Found::Part(part) => terminal::say(&part.to_string()).map(|()| true),
        }
    })
}

/// The results of all cases of a study, or a shard's part of them.
pub(super) fn results<S: Study>(
    study: &S,
    keep: &Keep,
    seconds: Option<Vec<f64>>,
    bar: &Bar,
) -> Result<Found<S::Found>> {
    let work = study.work();
    let own = keep.own(&work);
    let parts = seconds.unwrap_or(work).into_iter().zip(&own);
    let parts: Vec<f64> = parts.map(|(part, own)| if *own { part } else { 0.0 }).collect();
    let shares = Shares::of(&parts, study.order());
    let measure = |case: usize| study.measure(case, &Show { bar, shares: &shares, case });
    keep.all(&study.keys(), &own, study.order(), S::was_shared, measure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_have_shares_of_their_work_and_those_before_are_done() {
        let shares = Shares::of(&[1.0, 1.0, 2.0], Order::AtOnce);
        assert_eq!((shares.set(2, 0.5), shares.set(0, 1.0)), (0.25, 0.5));
        let shares = Shares::of(&[1.0, 1.0, 2.0], Order::OneByOne);
        assert_eq!((shares.set(2, 0.5), shares.set(2, 1.0)), (0.75, 1.0));
    }
}
