//! How far a step flows: one equation for one number.

use mmsmith_scalar_functions::ScalarFunctions;
use mmsmith_vocabulary::{Flow, Overstress};

use crate::fault::{Fault, Planted};

/// `sqrt(2/3)`.
pub(super) const ROOT: f64 = 0.816_496_580_927_726;

/// The yield stress, the overstress, and the stiffness that a step returns with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Yield {
    pub(super) mu: f64,
    pub(super) flow: Flow<f64>,
    pub(super) planted: Planted,
}

impl Yield {
    /// The size of the deviator on the yield surface.
    #[inline(always)]
    pub(super) fn allowed(&self, alpha: f64) -> f64 {
        let Flow { yield_stress, modulus, exponent, .. } = self.flow;
        let root = if self.planted.is(Fault::YieldRootDropped) { 1.0 } else { ROOT };
        let sign = if self.planted.is(Fault::HardeningSign) { -1.0 } else { 1.0 };
        let power = match exponent {
            1.0 => alpha,
            exponent => alpha.max(0.0).power(exponent),
        };
        root * (yield_stress + sign * modulus * power)
    }

    /// The plastic strain after a multiplier.
    #[inline(always)]
    pub(super) fn advanced(&self, alpha: f64, D: f64) -> f64 {
        let root = if self.planted.is(Fault::PlasticStrainRoot) { 1.0 } else { ROOT };
        if self.planted.is(Fault::PlasticStrainStays) { alpha } else { alpha + root * D }
    }

    /// Whether a deviator of this size flows.
    #[inline(always)]
    pub(super) fn flows(&self, size: f64, alpha: f64) -> bool {
        size > self.allowed(alpha)
    }

    /// The multiplier `D` of a step of a time from a trial deviator of this size: at its end the deviator has the size `size - 2 mu D`,
    /// which is the allowed one, and an overstress where flow depends on its rate. Zero where the trial does not flow.
    #[inline]
    pub(super) fn multiplier(&self, size: f64, alpha: f64, time: f64) -> f64 {
        let over = size - self.allowed(alpha);
        if over <= 0.0 || over.is_nan() {
            return 0.0;
        }
        let stiffness = 2.0 * self.mu;
        if self.planted.is(Fault::MultiplierWithoutHardening) {
            return over / stiffness;
        }
        let Some(Overstress { drag, exponent, time: of_flow }) = self.flow.overstress else {
            let is_linear = self.flow.exponent == 1.0 && !self.planted.is_any();
            if is_linear || self.flow.modulus == 0.0 {
                return over / (stiffness + ROOT * ROOT * self.flow.modulus);
            }
            let residual = |D: f64| size - stiffness * D - self.allowed(alpha + ROOT * D);
            return root(residual, over / stiffness, size);
        };
        // In the overstress over the drag, in which the equation has no steep slopes: `D = time y^exponent / time of the flow`.
        let multiplier = |y: f64| time / of_flow * y.power(exponent);
        let residual = |y: f64| {
            let D = multiplier(y);
            size - stiffness * D - self.allowed(alpha + ROOT * D) - drag * y
        };
        multiplier(root(residual, over / drag, size))
    }

    /// As [`multiplier`](Self::multiplier) for a step whose size of the deviator at its end is a function of the multiplier, for flow that
    /// does not depend on its rate.
    pub(super) fn multiplier_of(&self, size: impl Fn(f64) -> f64, alpha: f64) -> f64 {
        let residual = |D: f64| size(D) - self.allowed(alpha + ROOT * D);
        let stiffness = 2.0 * self.mu;
        if self.planted.is(Fault::MultiplierWithoutHardening) {
            return residual(0.0) / stiffness;
        }
        // Logarithms of stretches about one carry the rounding of one.
        root(residual, (size(0.0) - self.allowed(alpha)) / stiffness, stiffness)
    }
}

/// The root of a falling function that is positive at zero and about zero or negative at `high`, by regula falsi with halved ends
/// (Illinois). Values below the rounding of `size` are zero.
fn root(function: impl Fn(f64) -> f64, high: f64, size: f64) -> f64 {
    let rounding = f64::EPSILON * size;
    let (mut low, mut at_low) = (0.0, function(0.0));
    let (mut high, mut at_high) = (high, function(high));
    // The direction of the flow may have turned within the step. A little further on, but never far: the size of a deviator beyond zero
    // grows again.
    for _ in 0..8 {
        if !(at_high > rounding && at_high < 0.5 * at_low) {
            break;
        }
        let further = high + 1.5 * at_high * (high - low) / (at_low - at_high);
        (low, at_low) = (high, at_high);
        high = further;
        at_high = function(high);
    }
    if at_high > 0.0 {
        return high;
    }
    let mut side = 0;
    for _ in 0..100 {
        if high - low <= 4.0 * f64::EPSILON * high.abs() || at_high.abs() <= rounding {
            break;
        }
        let next = (low * at_high - high * at_low) / (at_high - at_low);
        if !(next > low && next < high) {
            break;
        }
        let value = function(next);
        if value.abs() <= rounding {
            return next;
        }
        if value > 0.0 {
            (low, at_low) = (next, value);
            if side == 1 {
                at_high *= 0.5;
            }
            side = 1;
        } else {
            (high, at_high) = (next, value);
            if side == -1 {
                at_low *= 0.5;
            }
            side = -1;
        }
    }
    if at_low.abs() < at_high.abs() { low } else { high }
}
