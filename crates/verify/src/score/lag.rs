//! Velocities of another time than their frame's, as of staggered schemes.

use mmsmith_runtime::Solution;
use serde::Serialize;

use super::frame::FrameData;
use super::quantity::Quantity;
use super::row::ScoreRow;

/// The largest share of the error of v that may be left where a lag explains it.
const LEFT: f64 = 0.3;
/// The order of v from which on nothing has to be explained.
const ENOUGH: f64 = 1.5;
/// Particles of a frame that are looked at.
const LOOKED_AT: usize = 4096;

/// The lag that fits the velocities of a recording best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lag {
    /// By how much they are behind their frame, in the solution's unit of time.
    pub time: f64,
    /// The part of the error of v that is left with it.
    pub left: f64,
}

/// Sums over particles of all frames.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LagSums {
    of_error: f64,
    of_both: f64,
    of_acceleration: f64,
}

impl LagSums {
    pub(super) fn add<const D: usize>(
        &mut self,
        exact: &dyn Solution<f64, D>,
        data: &FrameData<D>,
    ) {
        let Some((v, time)) = &data.v else { return };
        let step = v.len().div_ceil(LOOKED_AT).max(1);
        for (X, v) in data.X.iter().zip(v).step_by(step) {
            let error = v - exact.velocity(X, *time);
            let acceleration = exact.acceleration(X, *time);
            let parts =
                [error.norm_squared(), error.dot(&acceleration), acceleration.norm_squared()];
            if parts.iter().all(|part| part.is_finite()) {
                self.of_error += parts[0];
                self.of_both += parts[1];
                self.of_acceleration += parts[2];
            }
        }
    }

    /// The best lag: for small ones v(t - lag) = v(t) - lag a(t).
    pub(super) fn best(&self) -> Option<Lag> {
        let time = -self.of_both / self.of_acceleration;
        let left = (self.of_error - self.of_both.powi(2) / self.of_acceleration).max(0.0);
        let left = (left / self.of_error).sqrt();
        (time.is_finite() && left.is_finite()).then_some(Lag { time, left })
    }
}

/// What is to be said where a lag that becomes smaller with the grid explains the errors of v in all recordings; `order` is that of v.
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
