//! The errors of all particles at one instant.

use mmsmith_mpm::Simulation;
use mmsmith_solutions::{Real, Solution};
use rayon::prelude::*;

use crate::norms::{PerField, PerNorm, Tally};

/// Particles in a group that one thread works on; fixed, so that sums do not depend on the number of threads.
const GROUP: usize = 512;
/// The errors at one instant.
pub(crate) struct Measured {
    pub(crate) norms: PerField<PerNorm<f64>>,
    /// The particle of largest position error.
    pub(crate) worst_particle: usize,
}

/// Compares every particle with the exact solution at `time`; the velocity `lag` earlier.
pub(crate) fn measure<T: Real, const D: usize>(
    simulation: &Simulation<T, D>,
    exact: &dyn Solution<f64, D>,
    time: f64,
    lag: f64,
) -> Measured {
    let particles = simulation.particles();
    let count = particles.len();
    let group = |g: usize| {
        let mut tally = PerField::<Tally>::default();
        let mut worst = (0.0, g * GROUP);
        for p in g * GROUP..count.min((g + 1) * GROUP) {
            let X = particles.X[p].map(Real::to_f64);
            let F = particles.F[p];
            // One call for all fields shares their common parts; the velocity belongs to another time.
            let at_time = exact.fields(&X, time);
            let velocity = if lag == 0.0 { at_time.v } else { exact.velocity(&X, time - lag) };
            let displacement = particles.x[p].map(Real::to_f64) - X;
            let u = (displacement - at_time.u).norm();
            tally.u.add(u);
            tally.v.add((particles.v[p].map(Real::to_f64) - velocity).norm());
            tally.F.add((F.map(Real::to_f64) - at_time.F).norm());
            // A particle that is inside out has no stress; the solver stops at its next step.
            let stress = simulation.material().first_piola_kirchhoff(&F);
            tally.P.add(stress.map_or(f64::NAN, |P| (P.map(Real::to_f64) - at_time.P).norm()));
            if u > worst.0 || u.is_nan() {
                worst = (u, p);
            }
        }
        (tally, worst)
    };
    let groups: Vec<_> = (0..count.div_ceil(GROUP)).into_par_iter().map(group).collect();
    let mut total = PerField::<Tally>::default();
    let mut worst = (0.0, 0);
    for (tally, candidate) in &groups {
        total = PerField::combine(&total, tally, Tally::join);
        if candidate.0 > worst.0 || candidate.0.is_nan() {
            worst = *candidate;
        }
    }
    let norms = PerField::combine(&total, &total, |tally, _| tally.norms(count));
    Measured { norms, worst_particle: worst.1 }
}
