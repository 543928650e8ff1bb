//! Parameters with other values that explain an error.

use mmsmith_verify::{
    Input, Quantity, Remark, Score, ScoreOptions as Reading, ScoreRow, score as measure,
};

use crate::library::Selection;
use crate::number;

/// A relative error that a solver that converges does not have on any grid worth scoring.
const SUSPICIOUS: f64 = 0.3;
/// The share of the error that is left where another value explains it, on coarse grids too.
const EXPLAINED: f64 = 0.25;
/// Below this order the grid is not what the error is from.
const NO_ORDER: f64 = 0.5;
/// More numbers than are read anew for every trial.
const MOST_TRIED: usize = 50_000;
/// Octaves up and down from the value of a parameter in which another one is looked for.
const OCTAVES: i32 = 7;

/// What is to be said of the row with the smallest recording where the error of u is as large as u, no smaller on finer grids,
/// and far smaller with another value of a parameter.
pub(super) fn suggestion(
    selection: &Selection,
    inputs: &[Input],
    how: &Reading,
    score: &Score,
) -> Option<(usize, Remark)> {
    let size = |row: &ScoreRow| row.particles * row.frames;
    let (index, row) = score.rows.iter().enumerate().min_by_key(|(_, row)| size(row))?;
    let u = |row: &ScoreRow| row.errors[&Quantity::Displacement].l2;
    let relative = u(row) / row.exact_displacement;
    let order =
        score.orders.as_ref().and_then(|orders| orders.get(&Quantity::Displacement)?.l2.fit);
    if !(row.is_ok() && relative > SUSPICIOUS && size(row) <= MOST_TRIED)
        || order.is_some_and(|order| order > NO_ORDER)
    {
        return None;
    }
    let misfit = |name: &str, value: f64| -> Option<f64> {
        let exact = selection.with(&[(name.to_owned(), value)]).ok()?.build().ok()?;
        Some(u(&measure(&exact, &inputs[index..=index], how).ok()?.rows[0]))
    };
    let (error, name, value) = selection
        .parameters()
        .iter()
        .filter(|(_, value)| **value != 0.0)
        .filter_map(|(name, value)| {
            let (factor, error) = least(|factor| misfit(name, factor * value))?;
            Some((error, name, factor * value))
        })
        .min_by(|one, other| one.0.total_cmp(&other.0))?;
    let told = number::rounded(value, 3);
    (error < EXPLAINED * u(row)).then(|| {
        let message = format!(
            "the error of u is {:.0} % of u, but {} % with {name} near {told} in place of {}: is another value meant? --set \
             {name}={told}",
            100.0 * relative,
            number::rounded(100.0 * error / row.exact_displacement, 2),
            number::exact(selection.parameters()[name]),
        );
        (index, Remark { kind: "other-parameter", is_problem: false, count: 1, frames: 0, message })
    })
}

/// The factor, and its value, where a function is least: among half octaves and minus one, then by bisection between the
/// neighbours of the best.
fn least(function: impl Fn(f64) -> Option<f64>) -> Option<(f64, f64)> {
    let at = |factor: f64| function(factor).map(|value| (factor, value));
    let steps = (-2 * OCTAVES..=2 * OCTAVES).map(|step| 2.0_f64.powf(f64::from(step) / 2.0));
    let less = |one: &(f64, f64), other: &(f64, f64)| one.1.total_cmp(&other.1);
    let mut best = steps.chain([-1.0]).filter_map(at).min_by(less)?;
    let mut width = 2.0_f64.powf(0.25);
    for _ in 0..10 {
        let beside = [best.0 / width, best.0 * width].into_iter().filter_map(at);
        best = beside.chain([best]).min_by(less)?;
        width = width.sqrt();
    }
    Some(best)
}
