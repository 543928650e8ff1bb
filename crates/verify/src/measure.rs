//! The errors of all particles at one instant.

use mmsmith_mpm::{Material, Particles};
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
    (particles, material): (&Particles<T, D>, &Material<T>),
    exact: &dyn Solution<f64, D>,
    time: f64,
    lag: f64,
) -> Measured {
    let magnitudes = |p: usize| {
        let X = particles.X[p].map(Real::to_f64);
        let F = particles.F[p];
        // One call for all fields shares their common parts; the velocity belongs to another time.
        let at_time = exact.fields(&X, time);
        let velocity = if lag == 0.0 { at_time.v } else { exact.velocity(&X, time - lag) };
        let displacement = particles.x[p].map(Real::to_f64) - X;
        // A particle that is inside out has no stress; the solver stops at its next step.
        let stress = material.first_piola_kirchhoff(&F);
        [
            (displacement - at_time.u).norm(),
            (particles.v[p].map(Real::to_f64) - velocity).norm(),
            (F.map(Real::to_f64) - at_time.F).norm(),
            stress.map_or(f64::NAN, |P| (P.map(Real::to_f64) - at_time.P).norm()),
        ]
    };
    let ([u, v, F, P], worst_particle) = over_particles(particles.len(), magnitudes);
    Measured { norms: PerField { u, v, F, P }, worst_particle }
}

/// The norms of `N` magnitudes over `count` particles, and the particle whose first magnitude is the largest.
///
/// The result does not depend on the number of threads.
pub(crate) fn over_particles<const N: usize>(
    count: usize,
    magnitudes: impl Fn(usize) -> [f64; N] + Sync,
) -> ([PerNorm<f64>; N], usize) {
    let group = |g: usize| {
        let mut tallies = [Tally::default(); N];
        let mut worst = (0.0, g * GROUP);
        for p in g * GROUP..count.min((g + 1) * GROUP) {
            let magnitudes = magnitudes(p);
            for (tally, magnitude) in tallies.iter_mut().zip(magnitudes) {
                tally.add(magnitude);
            }
            if magnitudes[0] > worst.0 || magnitudes[0].is_nan() {
                worst = (magnitudes[0], p);
            }
        }
        (tallies, worst)
    };
    let groups: Vec<_> = (0..count.div_ceil(GROUP)).into_par_iter().map(group).collect();
    let mut total = [Tally::default(); N];
    let mut worst = (0.0, 0);
    for (tallies, candidate) in &groups {
        for (total, tally) in total.iter_mut().zip(tallies) {
            *total = total.join(tally);
        }
        if candidate.0 > worst.0 || candidate.0.is_nan() {
            worst = *candidate;
        }
    }
    (total.map(|tally| tally.norms(count)), worst.1)
}
