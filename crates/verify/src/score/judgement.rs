//! Whether a series of recordings converges.

use std::collections::BTreeMap;

use mmsmith_measure::norms::{Norm, PerNorm};
use serde::Serialize;

use super::integrated::Integrated;
use super::law::{LawRow, LawVerdict};
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
/// An order below it is none.
const NO_ORDER: f64 = 0.25;
/// By how many times the largest error exceeds one that fell with the L2 error before it is told that it does not fall.
const ABOVE: f64 = 1.9;
/// As many particles with the largest error, and no error elsewhere, are few: a boundary has more.
const FEW: f64 = 4.0;

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
    /// The fields whose L2 error falls, and whose largest error does not.
    #[serde(skip)]
    pub(super) stuck: Vec<Stuck>,
    /// Whether the message is of them.
    #[serde(skip)]
    pub(super) is_of_largest: bool,
}

/// A field whose L2 error falls, and whose largest error does not.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stuck {
    pub(super) field: Quantity,
    /// The order of the largest error on the finest pair of grids.
    pub(super) order: f64,
    /// Whether it is of a few particles alone.
    pub(super) is_of_few: bool,
    /// The recording on the finest grid.
    pub(super) row: usize,
}

/// A field, or a part of one, whose L2 error does not fall.
struct Flat {
    field: Quantity,
    /// The part across the solution's plane or line, in words.
    part: Option<&'static str>,
    order: f64,
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
        let mut flat: Vec<Flat> = fields
            .keys()
            .filter_map(|field| match shown(field) {
                Shown::None(order) => Some(Flat { field: *field, part: None, order }),
                _ => None,
            })
            .collect();
        let is_of_fields_alone = flat.len();
        flat.extend(series.across(options));
        let of_u = shown(&Quantity::Displacement);
        let between = series.between(options);
        let is_explained = flat.len() == is_of_fields_alone && between.is_none();
        let (kind, message) = told(rows, &of_u, &flat, between);
        let mut not_converging: Vec<_> = flat.iter().map(|flat| flat.field).collect();
        not_converging.dedup();
        let stuck = fields.iter().filter_map(|(field, verdicts)| series.stuck(*field, verdicts));
        let stuck: Vec<Stuck> = stuck.collect();
        let mut judged = Self {
            kind,
            passed: None,
            order: fields[&Quantity::Displacement].l2.finest,
            message,
            not_converging,
            fields,
            stuck,
            is_of_largest: false,
        };
        judged.tell_stuck();
        judged.settle(rows, options, is_explained);
        judged
    }

    /// Takes into account that largest errors do not fall: of u that is no convergence, of few particles of another field nothing can be
    /// told, and more particles are those of a boundary.
    fn tell_stuck(&mut self) {
        if self.kind != Convergence::Converges {
            return;
        }
        self.is_of_largest = !self.stuck.is_empty();
        let order = |field: &Quantity| self.fields[field].l2.finest.unwrap_or(f64::NAN);
        let of_u = self.stuck.iter().find(|stuck| stuck.field == Quantity::Displacement);
        if let Some(Stuck { order: largest, .. }) = of_u {
            self.kind = Convergence::DoesNotConverge;
            self.message = format!(
                "u converges in the mean with order {:.2} (L2, finest pair), but its largest error does not fall: it has order {largest:.2}",
                order(&Quantity::Displacement)
            );
            return;
        }
        let told = |stuck: &Stuck| {
            format!(
                "the largest error of {} does not fall, with order {:.2}",
                stuck.field, stuck.order
            )
        };
        if let Some(few) = self.stuck.iter().find(|stuck| stuck.is_of_few) {
            self.kind = Convergence::CannotTell;
            self.message = format!(
                "cannot tell: u converges with order {:.2} (L2, finest pair), but {}, at few particles",
                order(&Quantity::Displacement),
                told(few)
            );
        } else if let Some(more) = self.stuck.first() {
            self.message += &format!("; {}, as at a boundary", told(more));
        }
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
    fn settle(&mut self, rows: &[ScoreRow], options: &ScoreOptions, is_explained: bool) {
        let missed = self.missed(options);
        self.passed = if !options.expected.is_empty() {
            // What is asked for comes on top of what every recording has to do.
            match self.kind {
                _ if !missed.is_empty() => Some(false),
                Convergence::DoesNotConverge => Some(is_explained && self.is_expected(options)),
                Convergence::CannotTell if self.stuck.iter().any(|stuck| stuck.is_of_few) => None,
                Convergence::Converges | Convergence::CannotTell => Some(true),
            }
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

    /// Whether orders are stated for all that does not converge: somebody knows of it.
    fn is_expected(&self, options: &ScoreOptions) -> bool {
        let is_stated = |field: &Quantity, norm: Norm| {
            options.expected.get(field).is_some_and(|norms| norms[norm].is_some())
        };
        let of_largest = match self.not_converging.is_empty() {
            true => self.stuck.iter().all(|stuck| is_stated(&stuck.field, Norm::Linf)),
            false => true,
        };
        self.not_converging.iter().all(|field| is_stated(field, Norm::L2)) && of_largest
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
    flat: &[Flat],
    between: Option<String>,
) -> (Convergence, String) {
    let list = |fields: &[Flat]| {
        let each = fields.iter().map(|Flat { field, part, order }| match part {
            Some(part) => format!("{field} {part} has order {order:.2}"),
            None => format!("{field} has order {order:.2}"),
        });
        each.collect::<Vec<_>>().join(", ")
    };
    let follow_law = flat.iter().all(|flat| follows_law(rows, flat));
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
        Shown::Order(order) if flat.iter().all(|flat| is_stress(flat.field)) && !follow_law => (
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
                "u converges with order {order:.2}, but not all fields do: {} (L2, finest pair){}",
                list(flat),
                if follow_law {
                    "; it agrees with the law at the recorded F, whose error it has"
                } else {
                    ""
                }
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

/// Whether all of a field is that of the law at the recorded deformation, so that its error comes from there.
fn follows_law(rows: &[ScoreRow], flat: &Flat) -> bool {
    let agrees = |law: &LawRow| law.quantity == flat.field && law.verdict == LawVerdict::Agrees;
    is_stress(flat.field) && rows.iter().all(|row| row.law.iter().any(agrees))
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

    /// The parts of tensors across the solution's plane or line whose errors do not fall.
    fn across(&self, options: &ScoreOptions) -> Vec<Flat> {
        let mut flat = vec![];
        for field in super::across::TENSORS {
            let Some(row) = self.rows.iter().find(|row| row.across.contains_key(&field)) else {
                continue;
            };
            let floor = |row: &ScoreRow| row.floors.get(&field).copied().unwrap_or(0.0);
            let floors: Vec<f64> = self.rows.iter().map(floor).collect();
            let error = |row: &ScoreRow| {
                row.is_whole().then_some(row.across.get(&field).map_or(f64::NAN, |norms| norms.l2))
            };
            let errors: Vec<_> = self.rows.iter().map(error).collect();
            let verdict = Verdict::above(&self.steps(), &errors, &floors, None, options.tolerance);
            let order = verdict.finest.filter(|order| *order < LEAST_ORDER);
            flat.extend(order.map(|order| Flat { field, part: Some(row.direction), order }));
        }
        flat
    }

    /// The field, if its L2 error falls and its largest error does not, and is far above one that did.
    fn stuck(&self, field: Quantity, verdicts: &PerNorm<Verdict>) -> Option<Stuck> {
        let Shown::Order(of_mean) = self.shown(field, &verdicts.l2) else { return None };
        let order = verdicts.linf.finest.filter(|order| *order < NO_ORDER)?;
        let errors = self.errors(field, Norm::Linf);
        let is_above = |row: &usize| !verdicts.linf.rounding_rows.contains(row);
        let mut rows: Vec<usize> = (0..self.rows.len()).filter(is_above).collect();
        rows.sort_by(|one, other| self.rows[*one].h.total_cmp(&self.rows[*other].h));
        let (finest, coarsest) = (*rows.first()?, *rows.last()?);
        let ratio = self.rows[finest].h / self.rows[coarsest].h;
        let fallen = errors[coarsest]? * ratio.powf(of_mean);
        // Two pairs where there are three grids.
        let before = rows.get(1).zip(rows.get(2)).and_then(|(fine, coarse)| {
            let steps = (self.rows[*coarse].h / self.rows[*fine].h).ln();
            Some((errors[*coarse]? / errors[*fine]?).ln() / steps)
        });
        if errors[finest]? < ABOVE * fallen || before.is_some_and(|before| before >= NO_ORDER) {
            return None;
        }
        let row = &self.rows[finest];
        let norms = row.errors.get(&field)?;
        let particles = row.particles as f64 * (norms.l2 / norms.linf).powi(2);
        Some(Stuck { field, order, is_of_few: particles <= FEW, row: finest })
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
            (_, None) => unknown(format!(
                "the recordings show no order of {field}: {}",
                self.why_no_order(field)
            )),
        }
    }

    /// The reason why two recordings have no order, in words.
    fn why_no_order(&self, field: Quantity) -> String {
        let errors = self.errors(field, Norm::L2);
        let known: Vec<f64> = errors.into_iter().flatten().filter(|e| e.is_finite()).collect();
        if !known.is_empty() && known.iter().all(|error| *error == 0.0) {
            let at_start = self.rows.iter().all(|row| row.last_time == 0.0);
            let where_to = if at_start { ", and all frames are at t = 0" } else { "" };
            return format!("its errors are zero{where_to}");
        }
        let steps = self.steps();
        match steps.iter().all(|h| *h == steps[0]) {
            true => "their h is the same".into(),
            false => "fewer than two of different h have an error above zero".into(),
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
