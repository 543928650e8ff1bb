//! Judgement of a series of errors.

use mmsmith_solutions::{AnySolution, Smoothness};
use mmsmith_verify::{
    Discretized, Expected, OrderVerdict, PerField, PerNorm, Row, Status, Study, Sweep, Temporal,
    Values, expected_in_space, expected_in_time, flows_smoothly, history_of, orders_above,
    uneven_refinement, verdicts_above,
};

use super::Converge;

/// Orders of every field and norm, judged.
pub(in crate::commands) type Verdicts = PerField<PerNorm<OrderVerdict>>;

/// Rows with their orders and verdicts.
pub(super) struct Judged {
    pub(super) study: Study,
    pub(super) verdicts: Verdicts,
    /// Differences between time steps and their verdicts, in a study in time.
    pub(super) differences: Option<(Temporal, Verdicts)>,
    /// Why no order is expected of this solution, whatever the caller expects.
    pub(super) not_judged: Option<String>,
}

/// The particles whose histories tell of fronts.
const HISTORIES: usize = 100;

/// Why no order can be expected: where particles begin to flow, the body force may jump.
fn not_judged(exact: &AnySolution<f64>) -> Option<String> {
    let report = history_of(exact, HISTORIES).ok()??;
    (report.smoothness == Smoothness::Jump && report.onsets + report.unloadings > 0).then(|| {
        let advice = match flows_smoothly(exact) {
            true => {
                "The hardening is smooth where a particle flows for the first time, and not where it flows again after a stop: with a motion \
                 that goes on in one direction they have one."
            }
            false => {
                "With yield = 'sy + K*alpha^(1/3)', or a motion that flows everywhere from the start, they have one."
            }
        };
        format!(
            "Orders are not judged: the body force jumps where particles begin to flow, and errors at such a front have no order. {advice}"
        )
    })
}

/// The largest quotient of the CFL numbers of a series whose errors are those of one number.
const ALIKE: f64 = 1.1;

/// Why orders that are missed prove nothing where steps do not follow the cells: a run has whole steps, and a short one few.
fn steps_apart(asked: &Converge<'_>, rows: &[Row]) -> Option<String> {
    if !matches!(asked.sweep, Sweep::Cells(_)) {
        return None;
    }
    let least = rows.iter().map(|row| row.cfl).fold(f64::INFINITY, f64::min);
    let most = rows.iter().map(|row| row.cfl).fold(0.0, f64::max);
    (most > ALIKE * least).then(|| {
        format!(
            "Orders are not judged: the time steps do not follow the cells, with CFL numbers from {least:.3} to {most:.3}, since a run has whole \
             steps and these have few. A larger --periods, or a smaller --cfl, has more of them."
        )
    })
}

impl Judged {
    pub(super) fn new(asked: &Converge<'_>, rows: Vec<Row>, differences: Option<Temporal>) -> Self {
        let exact = &asked.problem.model.exact;
        let reason = not_judged(exact).or_else(|| match &asked.sweep {
            Sweep::Cells(cells) if asked.base.scheme.updated().is_none() => {
                uneven_refinement(exact, cells)
            }
            Sweep::Cells(_) | Sweep::Cfls(_) => None,
        });
        let judged = Self::unless(asked, rows, differences, reason);
        // A missed order proves nothing where errors grow by themselves; one that is met does.
        if !any(judged.decisive(), |one| one.passed == Some(false)) {
            return judged;
        }
        match asked.warnings().not_judged().or_else(|| steps_apart(asked, &judged.study.rows)) {
            None => judged,
            reason => {
                let Self { study, differences, .. } = judged;
                let differences = differences.map(|(found, _)| found);
                Self::unless(asked, study.rows, differences, reason)
            }
        }
    }

    /// With no orders expected where there is a reason.
    fn unless(
        asked: &Converge<'_>,
        rows: Vec<Row>,
        differences: Option<Temporal>,
        not_judged: Option<String>,
    ) -> Self {
        let Converge { problem, sweep, base, cases, orders, .. } = asked;
        // Rounding is among what grows.
        let grown = asked.warnings().factor();
        let floor =
            |case: &Discretized<'_>| PerField::from_fn(|field| grown * case.floors()[field]);
        let floors: Vec<PerField<f64>> = cases.iter().map(floor).collect();
        let study = above(Study::new(rows, sweep), sweep, &floors);
        // In time the expectation is about the differences; the total error is mostly a spatial one.
        let in_space = match (sweep, orders.expected) {
            _ if not_judged.is_some() => Expected::default(),
            (Sweep::Cells(_), Some(expected)) => expected,
            (Sweep::Cells(_), None) => expected_in_space(&problem.model.exact, base),
            (Sweep::Cfls(_), _) => Expected::default(),
        };
        let coarsest = coarsest(&study, sweep);
        let settle = |judged: Verdicts| match orders.strict {
            true => judged,
            false => judged.map(|norms| norms.map(|one| one.clone().of_theory_alone(coarsest))),
        };
        let verdicts = settle(judge_above(&study, sweep, &in_space, orders.tolerance, &floors));
        let differences = differences.map(|found| {
            let expected = match &not_judged {
                Some(_) => Expected::default(),
                None => {
                    orders.expected.unwrap_or_else(|| expected_in_time(&problem.model.exact, base))
                }
            };
            let verdicts = settle(judge_differences(&found, &expected, orders.tolerance));
            (found, verdicts)
        });
        Self { study, verdicts, differences, not_judged }
    }

    /// The verdicts on which the result of the study hangs.
    pub(super) fn decisive(&self) -> &Verdicts {
        self.differences.as_ref().map_or(&self.verdicts, |(_, verdicts)| verdicts)
    }

    /// Whether the study did what it promised: false where an order was missed or a run stopped, and `None` where nothing was
    /// judged.
    pub(super) fn passed(&self) -> Option<bool> {
        let of_differences = self.differences.iter().flat_map(|(found, _)| &found.rows);
        let ends = self.study.rows.iter().map(|row| &row.status);
        let mut ends = ends.chain(of_differences.map(|row| &row.status));
        let is = |passed| any(self.decisive(), |one| one.passed == Some(passed));
        if ends.any(|end| end.passed() == Some(false)) || is(false) {
            return Some(false);
        }
        is(true).then_some(true)
    }
}

/// Whether a verdict of any field and norm is so.
pub(super) fn any(judged: &Verdicts, is_so: impl Fn(&OrderVerdict) -> bool) -> bool {
    judged.iter().any(|(_, norms)| norms.iter().any(|(_, one)| is_so(one)))
}

/// The study without orders of rows that rounding may have caused.
fn above(mut study: Study, sweep: &Sweep, floors: &[PerField<f64>]) -> Study {
    let steps: Vec<f64> = study.rows.iter().map(|row| step(row, sweep)).collect();
    let errors: Vec<_> =
        study.rows.iter().map(|row| (row.status == Status::Ok).then_some(&row.errors)).collect();
    study.orders = orders_above(&steps, &errors, floors);
    study
}

/// The step that orders of a study are about.
pub(super) fn step(row: &Row, sweep: &Sweep) -> f64 {
    if matches!(sweep, Sweep::Cells(_)) { row.h } else { row.dt }
}

/// Judges the errors of a study, large or small.
pub(in crate::commands) fn judge(
    study: &Study,
    sweep: &Sweep,
    expected: &Expected,
    tolerance: f64,
) -> Verdicts {
    judge_above(study, sweep, expected, tolerance, &[])
}

/// Judges the errors of a study that are above what rounding alone may cause.
fn judge_above(
    study: &Study,
    sweep: &Sweep,
    expected: &Expected,
    tolerance: f64,
    floors: &[PerField<f64>],
) -> Verdicts {
    let nothing = {
        let none = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
        PerField { u: none, v: none, F: none, P: none }
    };
    let steps: Vec<f64> = study.rows.iter().map(|row| step(row, sweep)).collect();
    let errors = study.rows.iter().map(|row| match &row.status {
        Status::Ok => Some(&row.errors),
        status if status.is_not_judged() => Some(&nothing),
        _ => None,
    });
    let errors: Vec<_> = errors.collect();
    verdicts_above(&Values { steps: &steps, errors: &errors, floors }, expected, tolerance)
}

/// The cells of the coarsest grid of a series of grids.
fn coarsest(study: &Study, sweep: &Sweep) -> Option<usize> {
    match sweep {
        Sweep::Cells(_) => study.rows.iter().map(|row| row.cells).min(),
        Sweep::Cfls(_) => None,
    }
}

/// Judges the differences on one grid.
pub(in crate::commands) fn judge_differences(
    temporal: &Temporal,
    expected: &Expected,
    tolerance: f64,
) -> Verdicts {
    let steps: Vec<f64> = temporal.rows.iter().map(|row| row.dt).collect();
    let rows = temporal.rows.iter();
    let values = rows.map(|row| (row.status == Status::Ok).then_some(&row.differences));
    let errors: Vec<_> = values.collect();
    verdicts_above(&Values { steps: &steps, errors: &errors, floors: &[] }, expected, tolerance)
}
