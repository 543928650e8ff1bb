//! Errors and orders of what another solver wrote, particles or nodes, against the exact solution.
//!
//! The errors are those of [`run`](crate::run): `u` is compared as given, or as position minus reference position, with
//! `u(X, t)`; `v`, `F`, `P`, other stresses, `J` and density where the files hold them. L_inf, L2 and L1 are taken over the particles of a frame, then
//! their maxima over the frames. For frames that `run` wrote at every step they are its errors to the bit.

mod across;
mod against;
mod arrays;
mod balance;
mod data;
mod differences;
mod elements;
mod error;
mod findings;
mod found;
mod frame;
mod integrated;
mod judgement;
mod lag;
mod largest;
mod law;
mod motion;
mod options;
mod place;
mod points;
mod quantity;
mod recording;
mod reference;
mod row;
mod scales;
mod shuffled;
mod staggered;
mod times;
mod vectors;

pub use against::{AgainstError, Agreement, against};
pub use arrays::Role;
pub use differences::{DifferenceRow, Differences, compare_recordings};
pub use error::ScoreError;
pub use findings::Remark;
pub use integrated::{Integrated, IntegratedOrders};
pub use judgement::{Convergence, Judgement};
pub use lag::Lag;
pub use law::{Deformation, LawRow, LawVerdict};
pub use motion::RecordedMotion;
pub use options::{Exchange, Input, Placing, Points, Resolution, ScoreOptions, Times};
pub use quantity::Quantity;
pub use row::{ScoreRow, Source};
pub(crate) use times::is_static;

use std::collections::{BTreeMap, BTreeSet};

use mmsmith_measure::norms::PerNorm;
use mmsmith_runtime::{AnySolution, Solution};
use points::decide;
use recording::recording;
use serde::Serialize;

use crate::dimension::in_dimension;
use crate::half_plane::{HalfPlane, turns_about_axis};
use crate::order::Order;
use crate::precision::Precision;

/// Results of all recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// One row for each recording, in order.
    pub rows: Vec<ScoreRow>,
    /// The orders with respect to `h`, where there are several rows.
    pub orders: Option<BTreeMap<Quantity, PerNorm<Order>>>,
    /// The orders in L2 of the errors across the solution's plane or line, where there are several rows with them.
    pub across_orders: Option<BTreeMap<Quantity, Order>>,
    /// The orders of errors integrated over the elements of meshes.
    pub integrated_orders: Option<IntegratedOrders>,
    /// Whether they converge.
    pub verdict: Judgement,
}

/// Scores recordings against the exact solution, with the orders over them and the verdict.
///
/// # Errors
///
/// [`ScoreError`] for the first recording that cannot be read or compared.
pub fn score(
    exact: &AnySolution<f64>,
    inputs: &[Input],
    options: &ScoreOptions,
) -> Result<Score, ScoreError> {
    if !(options.periods > 0.0 && options.periods.is_finite()) {
        let (what, value) = ("periods", options.periods);
        return Err(ScoreError::Setting { what, value, admissible: "a positive number" });
    }
    let of_half_plane = score_of_half_plane(exact, inputs, options);
    if let Some(Ok(score)) = &of_half_plane
        && is_of_plane(score)
    {
        return Ok(score.clone());
    }
    let in_space = in_dimension!(exact, |exact| score_in(exact, inputs, options), else Err(ScoreError::Dimension));
    // What a file in neither form has is told as of the half plane.
    match (in_space, of_half_plane) {
        (Err(_), Some(of_half_plane)) => of_half_plane,
        (in_space, _) => in_space,
    }
}

/// The score of recordings of the half plane of a body of revolution, radius and height, with the components of vectors and tensors in the
/// order that fits them: the direction around the axis last, or second, as this program writes fields. `None` for other bodies.
fn score_of_half_plane(
    exact: &AnySolution<f64>,
    inputs: &[Input],
    options: &ScoreOptions,
) -> Option<Result<Score, ScoreError>> {
    let AnySolution::Three(space) = exact else { return None };
    let plane = HalfPlane::new(space.as_ref())?;
    if turns_about_axis(exact) {
        return None;
    }
    let asked = &options.placing.axes;
    let orders = if asked.is_empty() { vec![vec![], vec![0, 2]] } else { vec![asked.clone()] };
    let mut best: Option<Result<Score, ScoreError>> = None;
    for axes in orders {
        let names = if axes == [0, 2] { "R, theta, Z" } else { "R, Z, theta" };
        let placing = Placing { axes, ..options.placing.clone() };
        let mut found = score_in(&plane, inputs, &ScoreOptions { placing, ..options.clone() });
        if let Ok(score) = &mut found {
            tell_order(score, names);
        }
        best = match (best, found) {
            (Some(Ok(one)), Ok(other)) => {
                let is_better = match [&one, &other].map(is_of_plane) {
                    [true, true] => is_closer(&other, &one),
                    [is_one, is_other] => is_other && !is_one,
                };
                Some(Ok(if is_better { other } else { one }))
            }
            (Some(Ok(one)), Err(_)) => Some(Ok(one)),
            (Some(Err(_)), Ok(other)) => Some(Ok(other)),
            (Some(Err(one)), Err(_)) => Some(Err(one)),
            (None, found) => Some(found),
        };
    }
    best
}

/// Whether recordings are of a half plane: nothing lies or moves out of it.
fn is_of_plane(score: &Score) -> bool {
    let mut findings = score.rows.iter().flat_map(|row| &row.findings);
    !findings.any(|finding| ["out-of-plane", "sheets"].contains(&finding.kind))
}

/// Says in which order components of tensors are taken, where there are three directions.
fn tell_order(score: &mut Score, names: &str) {
    for row in score.rows.iter_mut().filter(|row| !row.across.is_empty()) {
        let message = format!("components of tensors are taken in the order {names}");
        let remark =
            Remark { kind: "component-order", is_problem: false, count: 1, frames: 0, message };
        row.findings.push(remark);
    }
}

/// Whether the errors that two readings of the same recordings have in common are smaller in the first, as a product of all of them.
fn is_closer(one: &Score, other: &Score) -> bool {
    let mut ratio = 0.0;
    for (one, other) in one.rows.iter().zip(&other.rows) {
        let pairs = [(&one.errors, &other.errors), (&one.across, &other.across)];
        for (field, error) in pairs.iter().flat_map(|(one, other)| {
            one.iter().filter_map(|(field, norms)| Some((norms.l2, other.get(field)?.l2)))
        }) {
            if field > 0.0 && error > 0.0 {
                ratio += (field / error).ln();
            }
        }
    }
    ratio < -1e-9
}

fn score_in<const D: usize>(
    exact: &dyn Solution<f64, D>,
    inputs: &[Input],
    options: &ScoreOptions,
) -> Result<Score, ScoreError>
where
    f64: Precision<D>,
{
    let decision = decide(exact, inputs, options)?;
    let row = |(input, taken)| recording(exact, input, options, taken);
    let mut rows = inputs.iter().zip(&decision.taken).map(row).collect::<Result<Vec<_>, _>>()?;
    let errors = rows.iter().map(|row| (row.h, row.is_whole().then_some(&row.errors)));
    let orders = orders(&errors.collect::<Vec<_>>());
    let mut verdict = Judgement::of(&rows, options);
    if let Some(points) = decision.other {
        let other = score_in(exact, inputs, &ScoreOptions { points, ..options.clone() })?.verdict;
        let is_apart = |(one, other): (f64, f64)| (one - other).abs() > options.tolerance;
        if (other.kind, other.passed) != (verdict.kind, verdict.passed)
            || other.order.zip(verdict.order).is_some_and(is_apart)
        {
            verdict.doubt("it depends on whether points are reference or current positions; --points tells it");
        }
    }
    if let Some(why) = other_ends(&rows).or_else(|| other_spacings(&rows, inputs, D)) {
        verdict.doubt(&why);
    }
    largest::tell(exact, inputs, &decision.taken, options, &mut rows, &mut verdict)?;
    conclude(&mut rows, &verdict);
    let of_v = verdict.fields.get(&Quantity::Velocity).and_then(|norms| norms.l2.finest);
    if let Some(message) = staggered::told(&rows, of_v) {
        let remark =
            Remark { kind: "velocity-lag", is_problem: false, count: 1, frames: 0, message };
        rows[0].findings.push(remark);
    }
    let of_meshes = rows.iter().map(|row| (row.h, row.integrated.filter(|_| row.is_whole())));
    let integrated_orders = IntegratedOrders::of(&of_meshes.collect::<Vec<_>>());
    let across_orders = across_orders(&rows);
    Ok(Score { rows, orders, across_orders, integrated_orders, verdict })
}

/// How much earlier a recording may end than another, as a share of the time of that: steps and frames of other lengths.
const ENDS: f64 = 0.05;

/// Why the errors of recordings have no order: one of them ends much earlier than another, as a run that stopped, and errors grow with time.
fn other_ends(rows: &[ScoreRow]) -> Option<String> {
    let last = rows.iter().max_by(|a, b| a.last_time.total_cmp(&b.last_time))?;
    let span = last.last_time.abs().max(last.last_time - last.first_time);
    let early = rows.iter().find(|row| last.last_time - row.last_time > ENDS * span)?;
    Some(format!(
        "{} ends at t = {:.6e} and {} at t = {:.6e}, as where a run has stopped, and errors over other times have no order; record all until the \
         same time",
        early.file, early.last_time, last.file, last.last_time
    ))
}

/// How far the ratio of two spacings that are told may be from that of the points, as a logarithm.
const SPACINGS: f64 = 0.15;

/// Why the spacings that are told cannot be those of the recordings: these have too many points for it, or too few. `None` where they can, and
/// of recordings at the same number of places.
fn other_spacings(rows: &[ScoreRow], inputs: &[Input], dimension: usize) -> Option<String> {
    let all: Vec<_> = rows.iter().zip(inputs).collect();
    all.windows(2).find_map(|pair| {
        let [(coarse, of_coarse), (fine, of_fine)] = pair else { return None };
        let is_told = |input: &Input| !matches!(input.resolution, Resolution::Estimated);
        let is_same = coarse.particles == fine.particles;
        if is_same || !is_told(of_coarse) || !is_told(of_fine) || coarse.h == fine.h {
            return None;
        }
        let told = (coarse.h / fine.h).ln();
        // Of the body, or of a plane or a line in it; nodes are one more along each side than cells.
        let ratios = (1..=dimension).flat_map(|d| {
            let [coarse, fine] = [coarse, fine].map(|row| (row.particles as f64).powf(1.0 / d as f64));
            [fine / coarse, (fine - 1.0).max(1.0) / (coarse - 1.0).max(1.0)].map(f64::ln)
        });
        let (least, most) = ratios
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), own| (own.min(least), own.max(most)));
        let is_apart = told < least - SPACINGS || told > most + SPACINGS;
        is_apart.then(|| {
            format!(
                "{} and {} have {} and {} points, and what is told of their spacings (--cells, --h) is a ratio of {:.2}, which these do not have",
                coarse.file,
                fine.file,
                coarse.particles,
                fine.particles,
                told.exp()
            )
        })
    })
}

/// Says of each field that is another one whether the motion has it too.
fn conclude(rows: &mut [ScoreRow], verdict: &Judgement) {
    if verdict.kind == Convergence::CannotTell {
        return;
    }
    let of_motion = match verdict.not_converging.contains(&Quantity::Displacement) {
        true => "u does not converge: the solver's forces are of it",
        false => "u converges: it is written so, the motion is not of it",
    };
    for row in rows {
        let other = row.law.iter().filter(|law| law.verdict == LawVerdict::Another);
        let others: Vec<_> = other.filter_map(|law| law.hypothesis).collect();
        let is_told =
            |kind: &str| kind.strip_prefix("law-").is_some_and(|name| others.contains(&name));
        for finding in row.findings.iter_mut().filter(|finding| is_told(finding.kind)) {
            finding.message += &format!("; {of_motion}");
        }
    }
}

/// The orders in L2 of errors across the solution's plane or line, of the fields that any row has.
fn across_orders(rows: &[ScoreRow]) -> Option<BTreeMap<Quantity, Order>> {
    let fields: BTreeSet<_> = rows.iter().flat_map(|row| row.across.keys()).collect();
    let steps: Vec<f64> = rows.iter().map(|row| row.h).collect();
    let order = |field: &Quantity| {
        let error = |row: &ScoreRow| Some(row.across.get(field).filter(|_| row.is_whole())?.l2);
        (*field, Order::of(&steps, &rows.iter().map(error).collect::<Vec<_>>()))
    };
    let is_series = rows.len() > 1 && !fields.is_empty();
    is_series.then(|| fields.into_iter().map(order).collect())
}

/// The errors of a recording, by quantity and norm.
type Errors = BTreeMap<Quantity, PerNorm<f64>>;

/// The orders of the fields that any row has, where there are several rows: each a step and the errors, unless they are of
/// no use.
fn orders(rows: &[(f64, Option<&Errors>)]) -> Option<BTreeMap<Quantity, PerNorm<Order>>> {
    let steps: Vec<f64> = rows.iter().map(|(step, _)| *step).collect();
    let fields: BTreeSet<_> =
        rows.iter().filter_map(|(_, errors)| *errors).flat_map(BTreeMap::keys).collect();
    let order = |field: &Quantity| {
        let of_norm = |norm| {
            let errors = rows.iter().map(|(_, errors)| Some(errors.as_ref()?.get(field)?[norm]));
            Order::of(&steps, &errors.collect::<Vec<_>>())
        };
        (*field, PerNorm::from_fn(of_norm))
    };
    (rows.len() > 1).then(|| fields.into_iter().map(order).collect())
}
