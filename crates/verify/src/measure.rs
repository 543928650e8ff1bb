//! The errors of all particles at one instant.

use mmsmith_mpm::{Material, Particles};
use mmsmith_solutions::{BLOCK, Real, Solution, StateAtPoints, StateRun};
use nalgebra::SVector;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::norms::{PerField, PerNorm, Tally};

/// Particles in a group that one thread works on; fixed, so that sums do not depend on the number of threads.
const GROUP: usize = 512;
/// Runs of particles for which what depends on the time alone is computed once.
pub(crate) const RUNS: usize = 8;
/// Particles in as many runs; what is compared of them fits into the first-level cache.
pub(crate) const CHUNK: usize = RUNS * BLOCK;

/// The errors at one instant.
pub(crate) struct Measured {
    pub(crate) norms: PerField<PerNorm<f64>>,
    /// The particle of largest position error.
    pub(crate) worst_particle: usize,
}

/// Compares particles with the exact solution; what that needs of their reference positions alone is kept.
pub(crate) struct Comparison<'a, const D: usize> {
    exact: Box<dyn StateAtPoints<f64, D> + 'a>,
}

impl<'a, const D: usize> Comparison<'a, D> {
    /// For particles that started at `X`.
    pub(crate) fn new<T: Real>(exact: &'a dyn Solution<f64, D>, X: &[SVector<T, D>]) -> Self {
        let X: Vec<_> = X.iter().map(|X| X.map(Real::to_f64)).collect();
        Self { exact: exact.state_at(&X) }
    }

    /// The errors of all particles at `time`, those of the velocity `lag` earlier.
    pub(crate) fn measure<T: Real>(
        &self,
        (particles, material): (&Particles<T, D>, &Material<T>),
        time: f64,
        lag: f64,
    ) -> Measured {
        let magnitudes = |first: usize, magnitudes: &mut [[f64; 4]]| {
            let mut exact = [StateRun::zero(); RUNS];
            let exact = &mut exact[..magnitudes.len().div_ceil(BLOCK)];
            self.exact.evaluate(time, time - lag, first / BLOCK, exact);
            for (n, run) in magnitudes.chunks_mut(BLOCK).enumerate() {
                let own = Run::pick(particles, first + n * BLOCK, run.len());
                // A particle that is inside out has no stress; the solver stops at its next step.
                let P = material.first_piola_kirchhoff_side_by_side(&own.F);
                let errors = own.errors(&P, &exact[n]);
                for (n, magnitudes) in run.iter_mut().enumerate() {
                    *magnitudes = errors.map(|row| row[n]);
                }
            }
        };
        let ([u, v, F, P], worst_particle) = over_particles(particles.len(), magnitudes);
        Measured { norms: PerField { u, v, F, P }, worst_particle }
    }
}

/// One number for each particle of a run.
type Row<T> = [T; BLOCK];

/// What is compared of `BLOCK` particles, side by side.
struct Run<T, const D: usize> {
    X: [Row<T>; D],
    x: [Row<T>; D],
    v: [Row<T>; D],
    F: [[Row<T>; D]; D],
}

impl<T: Real, const D: usize> Run<T, D> {
    /// Takes `count` particles from number `first` on; what is left to spare repeats the last one.
    fn pick(particles: &Particles<T, D>, first: usize, count: usize) -> Self {
        let zero = [T::zero(); BLOCK];
        let mut run = Self { X: [zero; D], x: [zero; D], v: [zero; D], F: [[zero; D]; D] };
        let range = first..first + count;
        let (X, x) = (&particles.X[range.clone()], &particles.x[range.clone()]);
        let (v, F) = (&particles.v[range.clone()], &particles.F[range]);
        for n in 0..BLOCK {
            let p = n.min(count - 1);
            for i in 0..D {
                run.X[i][n] = X[p][i];
                run.x[i][n] = x[p][i];
                run.v[i][n] = v[p][i];
                for j in 0..D {
                    run.F[i][j][n] = F[p][(i, j)];
                }
            }
        }
        run
    }

    /// The magnitudes of the errors of u, v, F and P, where `P` is the stress of the particles.
    fn errors(&self, P: &[[Row<T>; D]; D], exact: &StateRun<f64, D>) -> [Row<f64>; 4] {
        let mut errors = [[0.0; BLOCK]; 4];
        Arch::new().dispatch(Errors { run: self, P, exact, errors: &mut errors });
        errors
    }
}

/// The errors of a run as loops over rows. Only the width of the registers differs between processors: the bits are the
/// same.
struct Errors<'a, T, const D: usize> {
    run: &'a Run<T, D>,
    P: &'a [[Row<T>; D]; D],
    exact: &'a StateRun<f64, D>,
    errors: &'a mut [Row<f64>; 4],
}

impl<T: Real, const D: usize> WithSimd for Errors<'_, T, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { run, P, exact, errors } = self;
        let mut all = [[0.0; BLOCK]; 4];
        for n in 0..BLOCK {
            let vector = |a: &dyn Fn(usize) -> f64| {
                (0..D).fold(0.0, |sum, i| {
                    let difference = a(i);
                    sum + difference * difference
                })
            };
            let matrix = |rows: &[[Row<T>; D]; D], exact: &[[Row<f64>; D]; D]| {
                // Column by column, as norms of matrices are summed elsewhere.
                (0..D)
                    .fold(0.0, |sum, j| sum + vector(&|i| rows[i][j][n].to_f64() - exact[i][j][n]))
            };
            all[0][n] = vector(&|i| (run.x[i][n].to_f64() - run.X[i][n].to_f64()) - exact.u[i][n]);
            all[1][n] = vector(&|i| run.v[i][n].to_f64() - exact.v[i][n]);
            all[2][n] = matrix(&run.F, &exact.F);
            all[3][n] = matrix(P, &exact.P);
        }
        *errors = all.map(|row| row.map(f64::sqrt));
    }
}

/// The norms of `N` magnitudes over `count` particles, and the particle whose first magnitude is the largest.
///
/// `magnitudes` writes those of at most [`CHUNK`] particles from a number on that is a multiple of it. The result does not
/// depend on the number of threads.
pub(crate) fn over_particles<const N: usize>(
    count: usize,
    magnitudes: impl Fn(usize, &mut [[f64; N]]) + Sync,
) -> ([PerNorm<f64>; N], usize) {
    let group = |g: usize| {
        let mut tallies = [Tally::default(); N];
        let mut worst = (0.0, g * GROUP);
        for first in (g * GROUP..count.min((g + 1) * GROUP)).step_by(CHUNK) {
            let mut chunk = [[0.0; N]; CHUNK];
            let chunk = &mut chunk[..CHUNK.min(count - first)];
            magnitudes(first, chunk);
            for (p, magnitudes) in (first..).zip(chunk) {
                for (tally, magnitude) in tallies.iter_mut().zip(&*magnitudes) {
                    tally.add(*magnitude);
                }
                if magnitudes[0] > worst.0 || magnitudes[0].is_nan() {
                    worst = (magnitudes[0], p);
                }
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
