//! Whether a series of recordings converges.

use std::collections::BTreeMap;

use mmsmith_measure::norms::{Norm, PerNorm};
use serde::Serialize;

use super::integrated::Integrated;
use super::options::ScoreOptions;
use super::quantity::Quantity;
use super::row::ScoreRow;
use crate::verdict::{Behaviour, Verdict};

/// A field whose L2 order on the finest pair is below it does not converge.
const LEAST_ORDER: f64 = 0.5;
/// By how much an order may fall from one pair of grids to the next before the order of the finest pair says nothing.
const FALLING: f64 = 0.3;
/// From this order on a falling one still shows convergence.
const FALLEN: f64 = 1.5;

/// Whether errors vanish with the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Convergence {
    /// The error of u falls with an order, and so do those of all other fields.
    Converges,
    /// The error of a field does not fall.
    DoesNotConverge,
    /// Too few grids, errors at rounding, or an order that falls from grid to grid.
    CannotTell,
}

/// The verdict on a series of recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// Whether it converges.
    pub kind: Convergence,
    /// Whether expectations, or where there are none convergence, are met by recordings without a problem; `None` where that
    /// cannot be told.
    #[serde(skip)]
    pub passed: Option<bool>,
    /// The order of u in L2 on the finest pair.
    pub order: Option<f64>,
    /// The verdict in words, with its reason.
    pub message: String,
    /// The fields that do not converge.
    pub not_converging: Vec<Quantity>,
    /// Verdict on each norm of each recorded field.
    pub fields: BTreeMap<Quantity, PerNorm<Verdict>>,
}

/// Convergence that the L2 errors of a field show.
enum Shown {
    Order(f64),
    None(f64),
    Unknown(String),
}

impl Judgement {
    /// Judges rows.
    pub(super) fn of(rows: &[ScoreRow], options: &ScoreOptions) -> Self {
        let series = Series { rows };
        let recorded = |field: &Quantity| rows.iter().any(|row| row.fields.contains(field));
        let fields: BTreeMap<_, _> = Quantity::ALL
            .into_iter()
            .filter(recorded)
            .map(|field| (field, series.verdicts(field, options)))
            .collect();
        let shown = |field: &Quantity| series.shown(*field, &fields[field].l2);
        let flat: Vec<(Quantity, f64)> = fields
            .keys()
            .filter_map(|field| match shown(field) {
                Shown::None(order) => Some((*field, order)),
                _ => None,
            })
            .collect();
        let of_u = shown(&Quantity::Displacement);
        let (kind, message) = told(rows, &of_u, &flat, series.between(options));
        let mut judged = Self {
            kind,
            passed: None,
            order: fields[&Quantity::Displacement].l2.finest,
            message,
            not_converging: flat.into_iter().map(|(field, _)| field).collect(),
            fields,
        };
        judged.settle(rows, options);
        judged
    }

    /// Cannot tell, for a reason that the errors do not show.
    pub(super) fn doubt(&mut self, why: &str) {
        self.kind = Convergence::CannotTell;
        self.message = format!("cannot tell: {why}");
        if self.passed != Some(false) {
            self.passed = None;
        }
    }

    /// Whether what is wanted holds.
    fn settle(&mut self, rows: &[ScoreRow], options: &ScoreOptions) {
        let missed = self.missed(options);
        self.passed = if !options.expected.is_empty() {
            Some(missed.is_empty())
        } else {
            match self.kind {
                Convergence::Converges => Some(true),
                Convergence::DoesNotConverge => Some(false),
                Convergence::CannotTell => None,
            }
        };
        if !missed.is_empty() {
            self.message += &format!("; {}", missed.join(", "));
        }
        if rows.iter().any(|row| !row.is_ok()) {
            self.passed = Some(false);
            self.message += "; a recording has a PROBLEM";
        }
    }

    /// The expectations that are not met, in words.
    fn missed(&self, options: &ScoreOptions) -> Vec<String> {
        let mut missed = vec![];
        for (field, norms) in &options.expected {
            let Some(verdicts) = self.fields.get(field) else {
                missed.push(format!("{field} is expected, and not recorded"));
                continue;
            };
            for (norm, expected) in norms.iter() {
                let (Some(expected), verdict) = (expected, &verdicts[norm]) else { continue };
                if verdict.passed != Some(true) {
                    let found =
                        verdict.finest.map_or("no order".into(), |order| format!("{order:.2}"));
                    missed.push(format!(
                        "{field}.{norm}: {found} for {expected} +/- {}",
                        verdict.tolerance
                    ));
                }
            }
        }
        missed
    }
}

/// The verdict, and the reason in words.
fn told(
    rows: &[ScoreRow],
    of_u: &Shown,
    flat: &[(Quantity, f64)],
    between: Option<String>,
) -> (Convergence, String) {
    let list = |fields: &[(Quantity, f64)]| {
        let each = fields.iter().map(|(field, order)| format!("{field} has order {order:.2}"));
        each.collect::<Vec<_>>().join(", ")
    };
    match of_u {
        Shown::None(_) => (
            Convergence::DoesNotConverge,
            format!("does not converge: {} on the finest pair (L2)", list(flat)),
        ),
        Shown::Order(order) if between.is_some() && flat.is_empty() => (
            Convergence::DoesNotConverge,
            format!(
                "u converges with order {order:.2} at the nodes (L2, finest pair), but not between them: {}",
                between.unwrap_or_default()
            ),
        ),
        Shown::Order(order) if flat.is_empty() => (
            Convergence::Converges,
            format!("converges with order {order:.2} (u, L2, finest pair)"),
        ),
        Shown::Order(order) if flat.iter().all(|(field, _)| is_stress(*field)) => (
            Convergence::DoesNotConverge,
            format!(
                "u converges with order {order:.2}, and the motion with it; what is wrong is the stress that is written: {} (L2, \
                 finest pair)",
                list(flat)
            ),
        ),
        Shown::Order(order) => (
            Convergence::DoesNotConverge,
            format!(
                "u converges with order {order:.2}, but not all fields do: {} (L2, finest pair)",
                list(flat)
            ),
        ),
        Shown::Unknown(why) if flat.is_empty() => {
            let why = if rows.len() < 2 {
                "one recording shows no order; recordings on two grids at least do".into()
            } else if !rows.iter().any(ScoreRow::is_whole) {
                "no recording is whole".into()
            } else {
                why.clone()
            };
            (Convergence::CannotTell, format!("cannot tell: {why}"))
        }
        Shown::Unknown(why) => (
            Convergence::DoesNotConverge,
            format!(
                "does not converge: {} (L2, finest pair); of u nothing can be told: {why}",
                list(flat)
            ),
        ),
    }
}

/// Whether a field is one that a solver may write wrongly while its motion is right.
fn is_stress(field: Quantity) -> bool {
    matches!(field, Quantity::FirstPiolaKirchhoff | Quantity::Cauchy | Quantity::Kirchhoff)
}

/// The rows, as series of errors.
struct Series<'a> {
    rows: &'a [ScoreRow],
}

impl Series<'_> {
    fn steps(&self) -> Vec<f64> {
        self.rows.iter().map(|row| row.h).collect()
    }

    fn errors(&self, field: Quantity, norm: Norm) -> Vec<Option<f64>> {
        let error = |row: &ScoreRow| {
            let error = row.errors.get(&field).map_or(f64::NAN, |norms| norms[norm]);
            row.is_whole().then_some(error)
        };
        self.rows.iter().map(error).collect()
    }

    fn verdicts(&self, field: Quantity, options: &ScoreOptions) -> PerNorm<Verdict> {
        let floor = |row: &ScoreRow| row.floors.get(&field).copied().unwrap_or(0.0);
        let floors: Vec<f64> = self.rows.iter().map(floor).collect();
        PerNorm::from_fn(|norm| {
            let expected = options.expected.get(&field).and_then(|norms| norms[norm]);
            let errors = self.errors(field, norm);
            Verdict::above(&self.steps(), &errors, &floors, expected, options.tolerance)
        })
    }

    /// Which of the errors integrated over the elements of meshes do not fall, in words.
    fn between(&self, options: &ScoreOptions) -> Option<String> {
        let flat = |field: Quantity, of: fn(&Integrated) -> f64| {
            let floor = |row: &ScoreRow| row.floors.get(&field).copied().unwrap_or(0.0);
            let floors: Vec<f64> = self.rows.iter().map(floor).collect();
            let error = |row: &ScoreRow| {
                row.is_whole().then_some(row.integrated.as_ref().map_or(f64::NAN, of))
            };
            let errors: Vec<_> = self.rows.iter().map(error).collect();
            let verdict = Verdict::above(&self.steps(), &errors, &floors, None, options.tolerance);
            verdict.finest.filter(|order| *order < LEAST_ORDER)
        };
        let of_u = flat(Quantity::Displacement, |errors| errors.l2)
            .map(|order| format!("integrated over the elements its error has order {order:.2}"));
        let of_H = || {
            let order = flat(Quantity::DeformationGradient, |errors| errors.h1)?;
            Some(format!("the error of its gradient over the elements (h1) has order {order:.2}"))
        };
        of_u.or_else(of_H)
    }

    /// Convergence that the L2 errors of a field show.
    fn shown(&self, field: Quantity, verdict: &Verdict) -> Shown {
        let unknown = |why: String| Shown::Unknown(why);
        match (verdict.behaviour, verdict.finest) {
            (Behaviour::AtRounding, _) => unknown(format!("the errors of {field} are at rounding")),
            (Behaviour::Stopped | Behaviour::NotJudged, _) => {
                unknown("the recording on the finest grid is not whole".into())
            }
            (_, Some(order)) if order < LEAST_ORDER => Shown::None(order),
            (_, Some(order)) => match self.order_before(field, verdict) {
                Some(before) if order < FALLEN && order < before - FALLING => unknown(format!(
                    "the order of {field} falls from {before:.2} to {order:.2}; a finer grid tells whether its error vanishes"
                )),
                _ => Shown::Order(order),
            },
            (_, None) => {
                unknown(format!("the recordings show no order of {field}: their h is the same"))
            }
        }
    }

    /// The L2 order of the pair of grids before the finest pair.
    fn order_before(&self, field: Quantity, verdict: &Verdict) -> Option<f64> {
        let errors = self.errors(field, Norm::L2);
        let mut rows: Vec<(f64, f64)> = (0..self.rows.len())
            .filter(|row| !verdict.rounding_rows.contains(row))
            .map(|row| Some((self.rows[row].h, errors[row].filter(|error| *error > 0.0)?)))
            .collect::<Option<_>>()?;
        rows.sort_by(|one, other| one.0.total_cmp(&other.0));
        rows.dedup_by(|one, other| one.0 == other.0);
        let [_, (h, fine), (larger, coarse), ..] = rows[..] else { return None };
        Some((coarse / fine).ln() / (larger / h).ln())
    }
}
