//! Velocities of another time than their frame's, as of staggered schemes.

use mmsmith_runtime::Solution;
use serde::Serialize;

use super::data::FrameData;

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
