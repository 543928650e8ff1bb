//! One time step: each integrator is a sequence of P2G, grid update and G2P. To add an integrator, add its sequence here and
//! choose it in [`Simulation::new`](crate::Simulation::new).
//!
//! Kernels have one instance for every combination of dimension, shape function and law.

use nalgebra::RealField;

use crate::body_force::BodyForce;
use crate::health::Outcome;
use crate::material::Law;
use crate::shape_function::ShapeChoice;
use crate::state::State;

/// Times of a step, and the factor on its accelerations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepTimes<T> {
    pub(crate) start: T,
    pub(crate) end: T,
    /// Factor on all accelerations of the step: 1, or 1/2 for the first step of centred differences.
    pub(crate) scale: T,
}

/// A step of one integrator, with its shape function and law.
pub(crate) type Kernel<T, const D: usize> =
    Box<dyn Fn(&mut State<T, D>, &dyn BodyForce<T, D>, StepTimes<T>) -> Outcome + Send + Sync>;

/// USL, and with it centred differences: stress from `F^n`, F updated with the grid velocity at the end of the step.
///
/// One pass a step: G2P of this step is fused with P2G of the next one.
pub(crate) fn step_usl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (shape, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    times: StepTimes<T>,
) -> Outcome
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
    L: Law<T>,
{
    if !s.is_ahead {
        if !s.bins.is_sorted() {
            s.sort(shape);
        }
        s.p2g(shape, law, body_force, (times.start, times.scale));
    }
    let outcome = s.g2p2g(shape, law, body_force, times.end);
    // After a sort or a failure the partial sums on the grid are of no use.
    s.is_ahead = outcome.is_clean();
    s.resort_if(outcome, shape)
}

/// MUSL: as USL, but F is updated with velocities projected anew from the updated particles.
pub(crate) fn step_musl<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (shape, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    times: StepTimes<T>,
) -> Outcome
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
    L: Law<T>,
{
    s.p2g(shape, law, body_force, (times.start, times.scale));
    s.g2p_velocity(shape);
    s.p2g_updated_momentum(shape);
    let outcome = s.g2p_reprojected(shape);
    s.resort_if(outcome, shape)
}

/// USF: F is updated first, with the grid velocity at the start of the step; stress from the updated F.
pub(crate) fn step_usf<T, R, L, const D: usize, const W: usize>(
    s: &mut State<T, D>,
    (shape, law): (R, L),
    body_force: &dyn BodyForce<T, D>,
    times: StepTimes<T>,
) -> Outcome
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
    L: Law<T>,
{
    s.p2g_momentum(shape);
    let outcome = s.g2p_stretch(shape);
    if outcome.failure.is_some() {
        std::mem::swap(&mut s.particles.F, &mut s.F_next);
        return outcome;
    }
    s.p2g_force(shape, law, body_force, (times.start, times.scale));
    let outcome = s.g2p_stretched(shape);
    s.resort_if(outcome, shape)
}
