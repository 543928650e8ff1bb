//! Recordings whose velocities belong to other times than their frames, on all grids.

use super::lag::Lag;
use super::quantity::Quantity;
use super::row::ScoreRow;

/// The largest share of the error of v that may be left where a lag explains it.
const LEFT: f64 = 0.3;
/// The order of v from which on nothing has to be explained.
const ENOUGH: f64 = 1.5;
/// Message where a lag that becomes smaller with the grid explains the errors of v in all recordings; `order` is that of v.
pub(super) fn told(rows: &[ScoreRow], order: Option<f64>) -> Option<String> {
    order.filter(|order| *order < ENOUGH)?;
    let lags: Vec<Lag> = rows.iter().map(|row| row.lag).collect::<Option<_>>()?;
    let mut by_grid: Vec<_> = rows.iter().zip(&lags).map(|(row, lag)| (row.h, lag.time)).collect();
    by_grid.sort_by(|one, other| one.0.total_cmp(&other.0));
    let has_sign = lags.iter().all(|lag| lag.time > 0.0) || lags.iter().all(|lag| lag.time < 0.0);
    let falls = by_grid.windows(2).all(|pair| pair[0].1.abs() < pair[1].1.abs());
    if !has_sign || !falls || lags.iter().any(|lag| lag.left > LEFT) {
        return None;
    }
    let most = lags.iter().map(|lag| lag.left).fold(0.0, f64::max);
    let times: Vec<_> = lags.iter().map(|lag| format!("{:.5e}", lag.time)).collect();
    let behind = if lags[0].time > 0.0 { "behind" } else { "ahead of" };
    let v = Quantity::Velocity;
    Some(format!(
        "all but {:.0} % of the error of {v} is that velocities are {behind} their frames, as of staggered schemes, by half a time \
         step: --velocity-lag {} compares them at their own times",
        (100.0 * most).max(1.0),
        times.join(",")
    ))
}
