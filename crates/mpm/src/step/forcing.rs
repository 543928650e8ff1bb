//! The body force on all particles at one time.

use mmsmith_laws::fault::Fault;
use mmsmith_particles::{AtTime, BodyForce};
use nalgebra::{RealField, SVector};

use crate::grid::geometry::Constants;
use crate::kernel::copies::BLOCK;

/// The body force on all particles at one time.
pub(crate) struct Forcing<'a, T, const D: usize> {
    /// `None` where the force is zero.
    body_force: Option<&'a dyn BodyForce<T, D>>,
    X: &'a [SVector<T, D>],
    time: AtTime<'a, T>,
    at_current: bool,
}

impl<'a, T: RealField + Copy, const D: usize> Forcing<'a, T, D> {
    /// At the reference positions `X`; `values` is a buffer for the part that depends on time alone.
    pub(crate) fn new(
        body_force: &'a dyn BodyForce<T, D>,
        X: &'a [SVector<T, D>],
        t: T,
        c: &Constants<T, D>,
        values: &'a mut Vec<T>,
    ) -> Self {
        let absent = body_force.is_absent() || c.planted.is(Fault::NoBodyForce);
        let t = if c.planted.is(Fault::LateBodyForce) { t + c.time_step } else { t };
        values.clear();
        if !absent {
            body_force.of_time(t, values);
        }
        Self {
            body_force: (!absent).then_some(body_force),
            X,
            time: AtTime { t, values },
            at_current: c.planted.is(Fault::BodyForceAtCurrentPosition),
        }
    }

    /// The time at which it acts.
    pub(crate) fn time(&self) -> T {
        self.time.t
    }

    /// Writes the force per unit mass on the particles `ids` into `b`; leaves `b` alone where the force is zero. `x` holds the
    /// current positions of the same particles.
    pub(crate) fn evaluate(
        &self,
        ids: &[u32],
        x: &[SVector<T, D>; BLOCK],
        b: &mut [SVector<T, D>; BLOCK],
    ) {
        let Some(body_force) = self.body_force else {
            return;
        };
        let b = &mut b[..ids.len()];
        if self.at_current {
            body_force.evaluate(0, &x[..ids.len()], self.time.t, b);
        } else {
            body_force.evaluate_of(ids, self.X, self.time, b);
        }
    }
}
