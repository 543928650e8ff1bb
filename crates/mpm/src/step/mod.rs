//! One time step: a sequence of P2G, grid update and G2P.
//!
//! Integrators differ in the time at which F follows the grid: before forces are computed, after it, or both. To add one, say so
//! in [`Integrator`](crate::Integrator).

pub(crate) mod corner_step;
pub(crate) mod forcing;
pub(crate) mod g2p;
pub(crate) mod g2p2g;
pub(crate) mod health;
pub(crate) mod p2g;
pub(crate) mod passes;
pub(crate) mod state;
pub(crate) mod volume;
pub(crate) mod xpic;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use mmsmith_particles::{BodyForce, Pass};

use crate::every_scheme::EVERY_SCHEME;
use crate::scheme::{Integrator, Transfer, VelocityUpdate};
use crate::step::health::Outcome;
use crate::step::state::State;

/// Times of a step, and the factor on its accelerations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepTimes<T> {
    pub(crate) start: T,
    pub(crate) end: T,
    /// Factor on all accelerations of the step: 1, or 1/2 for the first step of centred differences.
    pub(crate) scale: T,
}

/// Whether steps are single passes, G2P of one fused with P2G of the next.
///
/// They are where F follows the grid last, and all that P2G needs is known of a particle right after G2P.
pub(crate) fn is_fused(integrator: Integrator, transfer: Transfer) -> bool {
    integrator.early() == 0.0
        && !integrator.reprojects()
        && !matches!(transfer.velocity_update(), VelocityUpdate::FilteredReplace(_))
}

impl<T: Lanes, const D: usize> State<T, D> {
    /// Advances by a step.
    pub(crate) fn step(
        &mut self,
        integrator: Integrator,
        body_force: &dyn BodyForce<T, D>,
        times: StepTimes<T>,
    ) -> Outcome {
        if let Some(corners) = &mut self.corners {
            corners.shared.recompute_shares();
        }
        let follows_grid = self.grid.rates.is_some();
        let projects = self.law.is_projected() && !follows_grid;
        if !EVERY_SCHEME || (is_fused(integrator, self.transfer) && !projects) {
            return match self.corners {
                Some(_) => {
                    self.timed(Pass::AtCorners, |state| state.step_at_corners(body_force, times))
                }
                None => self.fused_step(body_force, times),
            };
        }
        let early = integrator.early();
        let dt = self.grid.constants.time_step;
        let late = dt * real(1.0 - early);
        if early > 0.0 {
            self.timed(Pass::P2gOfMomentum, Self::p2g_momentum);
            if follows_grid {
                self.timed(Pass::Projection, |state| state.set_growth(true, dt * real(early)));
            }
            let outcome =
                self.timed(Pass::G2pOfStretch, |state| state.g2p_stretch(dt * real(early)));
            let outcome = self.reduce_outcome(outcome);
            if outcome.failure.is_some() {
                std::mem::swap(&mut self.particles.F, &mut self.early.F);
                return outcome;
            }
            if projects {
                self.timed(Pass::Projection, |state| state.project_volume(true));
            }
            self.timed(Pass::P2gOfForce, |state| state.p2g_force(body_force, times));
        } else {
            self.timed(Pass::P2g, |state| state.p2g(body_force, times));
        }
        if let VelocityUpdate::FilteredReplace(filter) = self.transfer.velocity_update() {
            self.timed(Pass::Filter, |state| state.filter(filter));
        }
        if self.corners.is_some() {
            self.timed(Pass::Corners, Self::move_corners);
        }
        if follows_grid && !integrator.reprojects() {
            self.timed(Pass::Projection, |state| state.set_growth(false, late));
        }
        let outcome = if integrator.reprojects() {
            self.timed(Pass::G2pOfVelocity, Self::g2p_velocity);
            self.timed(Pass::P2gOfUpdatedMomentum, Self::p2g_updated_momentum);
            if follows_grid {
                self.timed(Pass::Projection, |state| state.set_reprojected_growth(late));
            }
            self.timed(Pass::G2p, |state| state.g2p_reprojected(late))
        } else {
            self.timed(Pass::G2p, |state| state.g2p(late))
        };
        let outcome = self.reduce_outcome(outcome);
        let outcome = self.resort_if(outcome);
        // Where F has not followed since forces were computed, its change of volume has been projected.
        if projects && early < 1.0 && outcome.failure.is_none() {
            self.timed(Pass::Projection, |state| state.project_volume(false));
        }
        outcome
    }

    /// The corners that particles share move with the grid; their new positions are stored beside the old.
    fn move_corners(&mut self) {
        if let Some(corners) = &mut self.corners {
            corners.follow(&self.grid.constants, &self.grid.nodes);
        }
    }

    /// A step in a single pass.
    fn fused_step(&mut self, body_force: &dyn BodyForce<T, D>, times: StepTimes<T>) -> Outcome {
        if !self.grid.is_ahead {
            self.timed(Pass::P2g, |state| state.p2g(body_force, times));
        }
        if self.grid.rates.is_some() {
            let dt = self.grid.constants.time_step;
            self.timed(Pass::Projection, |state| state.set_growth(false, dt));
        }
        let outcome = self.timed(Pass::G2pAndP2g, |state| state.g2p2g(body_force, times.end));
        let outcome = self.reduce_outcome(outcome);
        // After a sort or a failure the partial sums on the grid are of no use.
        self.grid.is_ahead = outcome.is_clean();
        self.resort_if(outcome)
    }
}
