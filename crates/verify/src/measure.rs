//! The errors of all particles at one instant.

use std::ops::Range;

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
const CHUNK: usize = RUNS * BLOCK;

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
        let magnitudes = |first: usize, count: usize, magnitudes: &mut [[Row<f64>; 4]]| {
            let mut exact = [StateRun::zero(); RUNS];
            let exact = &mut exact[..magnitudes.len()];
            self.exact.evaluate(time, time - lag, first / BLOCK, exact);
            let mut run = Run::zero();
            for (n, (exact, magnitudes)) in exact.iter().zip(magnitudes).enumerate() {
                let places = first + n * BLOCK..first + count.min((n + 1) * BLOCK);
                run.pick(particles, places);
                // A particle that is inside out has no stress; the solver stops at its next step.
                material.first_piola_kirchhoff_side_by_side(&run.F, &mut run.P);
                Arch::new().dispatch(Errors { run: &run, exact, magnitudes });
            }
        };
        let ([u, v, F, P], worst_particle) = over_particles(particles.len(), magnitudes);
        Measured { norms: PerField { u, v, F, P }, worst_particle }
    }
}

/// One number for each particle of a run.
pub(crate) type Row<T> = [T; BLOCK];

/// What is compared of `BLOCK` particles, side by side.
struct Run<T, const D: usize> {
    X: [Row<T>; D],
    x: [Row<T>; D],
    v: [Row<T>; D],
    F: [[Row<T>; D]; D],
    /// The stress that their law gives for `F`.
    P: [[Row<T>; D]; D],
}

impl<T: Real, const D: usize> Run<T, D> {
    fn zero() -> Self {
        let (vector, matrix) = ([[T::zero(); BLOCK]; D], [[[T::zero(); BLOCK]; D]; D]);
        Self { X: vector, x: vector, v: vector, F: matrix, P: matrix }
    }

    /// Takes the particles of the numbers `places`; what is left to spare repeats the last one.
    fn pick(&mut self, particles: &Particles<T, D>, places: Range<usize>) {
        let Particles { X, x, v, F, .. } = particles;
        rows(&X[places.clone()], |n, X| (0..D).for_each(|i| self.X[i][n] = X[i]));
        rows(&x[places.clone()], |n, x| (0..D).for_each(|i| self.x[i][n] = x[i]));
        rows(&v[places.clone()], |n, v| (0..D).for_each(|i| self.v[i][n] = v[i]));
        rows(&F[places], |n, F| {
            for i in 0..D {
                (0..D).for_each(|j| self.F[i][j][n] = F[(i, j)]);
            }
        });
    }
}

/// Shows `take` the items of a run with their places in it, the last one again and again to its end.
#[inline(always)]
fn rows<V>(items: &[V], mut take: impl FnMut(usize, &V)) {
    if let Some(items) = items.first_chunk::<BLOCK>() {
        for n in 0..BLOCK {
            take(n, &items[n]);
        }
    } else {
        for n in 0..BLOCK {
            take(n, &items[n.min(items.len() - 1)]);
        }
    }
}

/// The errors of a run as a loop over its rows. Only the width of the registers differs between processors: the bits are
/// the same.
struct Errors<'a, T, const D: usize> {
    run: &'a Run<T, D>,
    exact: &'a StateRun<f64, D>,
    magnitudes: &'a mut [Row<f64>; 4],
}

impl<T: Real, const D: usize> WithSimd for Errors<'_, T, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        errors(self.run, self.exact, self.magnitudes);
    }
}

/// The magnitudes of the errors of u, v, F and P. As a function of its own, which tells the compiler that what is read and
/// what is written are in different places.
#[inline(always)]
fn errors<T: Real, const D: usize>(
    run: &Run<T, D>,
    exact: &StateRun<f64, D>,
    magnitudes: &mut [Row<f64>; 4],
) {
    /// The sum of the squares of a vector's components.
    #[inline(always)]
    fn square<const D: usize>(component: impl Fn(usize) -> f64) -> f64 {
        (0..D).fold(0.0, |sum, i| sum + component(i) * component(i))
    }
    let distance = |rows: &[[Row<T>; D]; D], exact: &[[Row<f64>; D]; D], n: usize| {
        // Column by column, as norms of matrices are summed elsewhere.
        let column = |j: usize| square::<D>(|i| rows[i][j][n].to_f64() - exact[i][j][n]);
        (0..D).fold(0.0, |sum, j| sum + column(j)).sqrt()
    };
    for n in 0..BLOCK {
        let u = |i: usize| run.x[i][n].to_f64() - run.X[i][n].to_f64();
        magnitudes[0][n] = square::<D>(|i| u(i) - exact.u[i][n]).sqrt();
        magnitudes[1][n] = square::<D>(|i| run.v[i][n].to_f64() - exact.v[i][n]).sqrt();
        magnitudes[2][n] = distance(&run.F, &exact.F, n);
        magnitudes[3][n] = distance(&run.P, &exact.P, n);
    }
}

/// The place of each number below `count`, and the number of each place, where the numbers stand in as many runs as there are
/// threads, each backwards.
///
/// A step goes through the particles upwards. Who then goes downwards meets first what still lies in the cache, and leaves
/// there what the next step begins with.
fn backwards(count: usize, runs: usize) -> impl Fn(usize) -> usize {
    let start = move |run| count * run / runs;
    move |number| {
        // The last run that starts at the number or before it.
        let run = ((number + 1) * runs - 1) / count;
        start(run) + start(run + 1) - 1 - number
    }
}

/// What `group` makes of each number below `count`, on the threads of the pool; through a reference, so that their
/// machinery is compiled once for each kind of result.
pub(crate) fn each_group<R: Send>(count: usize, group: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    (0..count).into_par_iter().map(group).collect()
}

/// The norms of `N` magnitudes over `count` particles, and the particle whose first magnitude is the largest.
///
/// `magnitudes` is given the number of a first particle, a count, and the rows to write their magnitudes to, at most `RUNS`
/// times `BLOCK` of them. The result does not depend on the number of threads.
pub(crate) fn over_particles<const N: usize>(
    count: usize,
    magnitudes: impl Fn(usize, usize, &mut [[Row<f64>; N]]) + Sync,
) -> ([PerNorm<f64>; N], usize) {
    let group = |g: usize| {
        let mut tallies = [Tally::default(); N];
        let mut worst = (0.0, g * GROUP);
        for first in (g * GROUP..count.min((g + 1) * GROUP)).step_by(CHUNK) {
            let count = CHUNK.min(count - first);
            let mut chunk = [[[0.0; BLOCK]; N]; RUNS];
            let chunk = &mut chunk[..count.div_ceil(BLOCK)];
            magnitudes(first, count, chunk);
            for p in 0..count {
                let rows = &chunk[p / BLOCK];
                for (tally, row) in tallies.iter_mut().zip(rows) {
                    tally.add(row[p % BLOCK]);
                }
                let first_of_it = rows[0][p % BLOCK];
                if first_of_it > worst.0 || first_of_it.is_nan() {
                    worst = (first_of_it, first + p);
                }
            }
        }
        (tallies, worst)
    };
    let groups = count.div_ceil(GROUP);
    let place = backwards(groups, rayon::current_num_threads());
    let at_places = each_group(groups, &|at| group(place(at)));
    let mut total = [Tally::default(); N];
    let mut worst = (0.0, 0);
    for g in 0..groups {
        let (tallies, candidate) = &at_places[place(g)];
        for (total, tally) in total.iter_mut().zip(tallies) {
            *total = total.join(tally);
        }
        if candidate.0 > worst.0 || candidate.0.is_nan() {
            worst = *candidate;
        }
    }
    (total.map(|tally| tally.norms(count)), worst.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thread_s_run_goes_backwards_and_has_its_own_numbers() {
        let places = |count, runs| (0..count).map(backwards(count, runs)).collect::<Vec<_>>();
        assert_eq!(places(5, 1), [4, 3, 2, 1, 0]);
        assert_eq!(places(7, 2), [2, 1, 0, 6, 5, 4, 3]);
        assert_eq!(places(2, 3), [0, 1]);
        for (count, runs) in [(1, 1), (1, 5), (6, 3), (64, 7), (1000, 16)] {
            let place = backwards(count, runs);
            assert!((0..count).all(|number| place(place(number)) == number), "{count} {runs}");
            let turns = (1..count).filter(|&n| place(n) != place(n - 1).wrapping_sub(1)).count();
            assert_eq!(turns + 1, runs.min(count), "{count} {runs}");
        }
    }
}
