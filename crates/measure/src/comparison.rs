//! The errors of all particles at one instant.

use std::ops::Range;

use mmsmith_lanes::simd::widest;
use mmsmith_laws::{BlockWithMemory, Law, Stressed};
use mmsmith_particles::Particles;
use mmsmith_runtime::{BLOCK, Real, Solution, StateAtPoints, StateRun};
use mmsmith_threads::parallel::*;
use nalgebra::SVector;
use pulp::{Simd, WithSimd};

use crate::homes::{GROUP, Holder, Homes};
use crate::norms::{PerField, PerNorm, Tallies, Tally, is_squarable, magnitude};
use crate::tree::{joined, joined_over};

/// Number of runs of particles that share the values which depend on the time alone.
pub const RUNS: usize = 8;
/// Number of runs of particles that a law with memory takes at a time.
const RUNS_OF_LAW: usize = mmsmith_laws::BLOCK / BLOCK;
/// Particles in [`RUNS`] runs. Their fields fit into the first-level cache.
const CHUNK: usize = RUNS * BLOCK;

/// Compares particles with the exact solution. Values that depend on the reference positions alone are kept.
pub struct Comparison<'a, const D: usize> {
    exact: Box<dyn StateAtPoints<f64, D> + 'a>,
}

impl<'a, const D: usize> Comparison<'a, D> {
    /// For particles with the reference positions `X`.
    pub fn new<T: Real>(exact: &'a dyn Solution<f64, D>, X: &[SVector<T, D>]) -> Self {
        let X: Vec<_> = X.iter().map(|X| X.map(Real::to_f64)).collect();
        Self { exact: exact.state_at(&X) }
    }

    /// The errors of all particles at `time`; velocities are compared at a time that is earlier by `lag`.
    pub fn measure<T: Compared<D>>(
        &self,
        observed: (&Particles<T, D>, &Law<T, D>),
        time: f64,
        lag: f64,
    ) -> PerField<PerNorm<f64>> {
        T::errors(self, observed, (time, time - lag))
    }

    fn errors<T: Compared<D>>(
        &self,
        observed: (&Particles<T, D>, &Law<T, D>),
        times: (f64, f64),
    ) -> PerField<PerNorm<f64>> {
        let [u, v, F, P] =
            over_particles(observed.0.len(), Room::zero, |room, first, magnitudes| {
                self.magnitudes(observed, times, room, first, magnitudes)
            });
        PerField { u, v, F, P }
    }

    /// As [`measure`](Self::measure), for the particles of all processes. Collective.
    pub fn measure_all<T: Compared<D>>(
        &self,
        homes: &Homes,
        observed: (&Particles<T, D>, &Law<T, D>),
        time: f64,
        lag: f64,
    ) -> PerField<PerNorm<f64>> {
        T::errors_of_all(self, homes, observed, (time, time - lag))
    }

    /// The particle with the largest position error at `time`, or the first particle whose error is not a number.
    pub fn worst_particle<T: Compared<D>>(
        &self,
        observed: (&Particles<T, D>, &Law<T, D>),
        time: f64,
    ) -> usize {
        T::worst_particle(self, observed, time).1
    }

    /// The errors of the particles of all processes. The process that holds a particle compares it; its home adds up the errors, group
    /// by group.
    fn errors_of_all<T: Compared<D>>(
        &self,
        homes: &Homes,
        observed: (&Particles<T, D>, &Law<T, D>),
        times: (f64, f64),
    ) -> PerField<PerNorm<f64>> {
        let others = homes.hear(|places| self.each(observed, times, &places));
        let count = homes.here();
        let room = || (Room::zero(), [[[0.0; BLOCK]; 4]; RUNS + 1]);
        let groups = tallies(count, room, |(room, here), first, rows: &mut [[Row<f64>; 4]]| {
            let places = first..count.min(first + rows.len() * BLOCK);
            // Both lists are in the order of the numbers, so that the places of particles held here are successive.
            let own = places.clone().filter_map(|place| match homes.holder(place) {
                Holder::Here(p) => Some(p),
                Holder::Other(_) => None,
            });
            let (mut start, mut end) = (0, 0);
            for p in own {
                start = if end == 0 { p / BLOCK * BLOCK } else { start };
                end = p + 1;
            }
            let here = &mut here[..(end - start).div_ceil(BLOCK)];
            for (n, runs) in here.chunks_mut(RUNS).enumerate() {
                self.magnitudes(observed, times, room, start + n * CHUNK, runs);
            }
            for (k, place) in places.enumerate() {
                for (n, row) in rows[k / BLOCK].iter_mut().enumerate() {
                    row[k % BLOCK] = match homes.holder(place) {
                        Holder::Here(p) => here[(p - start) / BLOCK][n][(p - start) % BLOCK],
                        Holder::Other(place) => others[place][n],
                    };
                }
            }
        });
        let [u, v, F, P] = over_homes(homes, groups);
        PerField { u, v, F, P }
    }

    /// The magnitudes of the errors of u, v, F and P of the particles at some places.
    fn each<T: Compared<D>>(
        &self,
        observed: (&Particles<T, D>, &Law<T, D>),
        times: (f64, f64),
        places: &Range<usize>,
    ) -> Vec<[f64; 4]> {
        if places.is_empty() {
            return Vec::new();
        }
        let chunks = places.start / CHUNK..places.end.div_ceil(CHUNK);
        let chunks = each_group(chunks.len(), &|n| {
            let first = (chunks.start + n) * CHUNK;
            let wanted = places.start.max(first)..places.end.min(first + CHUNK);
            let mut rows = [[[0.0; BLOCK]; 4]; RUNS];
            let rows = &mut rows[..(wanted.end - first).div_ceil(BLOCK)];
            self.magnitudes(observed, times, &mut Room::zero(), first, rows);
            let of = |p: usize| (p - first) / BLOCK;
            let of = |p: usize| std::array::from_fn(|n| rows[of(p)][n][(p - first) % BLOCK]);
            wanted.map(of).collect::<Vec<[f64; 4]>>()
        });
        chunks.concat()
    }

    /// As [`worst_particle`](Self::worst_particle), for the particles of all processes, of which this process holds `ids`. Collective.
    pub fn worst_of_all<T: Compared<D>>(
        &self,
        homes: &Homes,
        ids: &[u64],
        observed: (&Particles<T, D>, &Law<T, D>),
        time: f64,
    ) -> usize {
        let (error, place) = T::worst_particle(self, observed, time);
        // Errors that are not numbers come first, then the largest error, then the smallest particle number.
        let rank = |error: f64| if error.is_nan() { u64::MAX } else { error.to_bits() };
        let largest = homes.ranks().largest(rank(error));
        // A process without particles does not hold the worst particle.
        let id = ids.get(place).copied().unwrap_or(u64::MAX);
        let own = if rank(error) == largest { id } else { u64::MAX };
        !homes.ranks().largest(!own) as usize
    }

    /// The largest position error and its particle.
    fn worst<T: Compared<D>>(
        &self,
        observed: (&Particles<T, D>, &Law<T, D>),
        time: f64,
    ) -> (f64, usize) {
        let count = observed.0.len();
        let mut room = Room::zero();
        let mut magnitudes = [[[0.0; BLOCK]; 4]];
        let mut worst = (0.0_f64, 0);
        for first in (0..count).step_by(BLOCK) {
            self.magnitudes(observed, (time, time), &mut room, first, &mut magnitudes);
            for (p, &error) in (first..count).zip(&magnitudes[0][0]) {
                if error > worst.0 || (error.is_nan() && !worst.0.is_nan()) {
                    worst = (error, p);
                }
            }
        }
        worst
    }

    /// The magnitudes of the errors of u, v, F and P of the particles from number `first` on; `times` are the times of positions and of
    /// velocities.
    fn magnitudes<T: Compared<D>>(
        &self,
        (particles, law): (&Particles<T, D>, &Law<T, D>),
        times: (f64, f64),
        room: &mut Room<T, D>,
        first: usize,
        magnitudes: &mut [[Row<f64>; 4]],
    ) {
        let Room { exact, run, memory } = room;
        let exact = &mut exact[..magnitudes.len()];
        self.exact.evaluate(times.0, times.1, first / BLOCK, exact);
        for (n, (exact, magnitudes)) in exact.iter().zip(magnitudes).enumerate() {
            let first = first + n * BLOCK;
            let places = first..particles.len().min(first + BLOCK);
            run.pick(particles, places.clone());
            // A particle that is inside out has no stress; the solver stops at its next step.
            match law {
                Law::WithMemory(law) => {
                    let memory = memory.get_or_insert_with(|| {
                        let variables = law.variables();
                        (variables.len(), Box::new(BlockWithMemory::at_rest(&variables)))
                    });
                    let (count, block) = (memory.0, &mut memory.1);
                    // Blocks of the law have several runs.
                    let of_block = n % RUNS_OF_LAW * BLOCK;
                    if of_block == 0 {
                        let end = particles.len().min(first + RUNS_OF_LAW * BLOCK);
                        let q = &particles.internal[first * count..end * count];
                        block.first_piola_kirchhoff(law.as_ref(), &particles.F[first..end], q);
                    }
                    for n in 0..BLOCK {
                        let stress = block.stress(of_block + n.min(places.len() - 1));
                        for i in 0..D {
                            (0..D).for_each(|j| run.P[i][j][n] = stress[(i, j)]);
                        }
                    }
                }
                Law::Library(_) | Law::Own(_) => {
                    law.first_piola_kirchhoff_side_by_side(&run.F, &mut run.P);
                }
            }
            widest(Errors { run, exact, magnitudes });
        }
    }
}

/// The scalar type of the particles, `f64` or `f32`, in `D` dimensions. The comparison is compiled in this crate, once for each type
/// and dimension.
pub trait Compared<const D: usize>: Real + Stressed<D> {
    /// The errors of all particles; `times` are the times of positions and of velocities.
    fn errors(
        comparison: &Comparison<'_, D>,
        observed: (&Particles<Self, D>, &Law<Self, D>),
        times: (f64, f64),
    ) -> PerField<PerNorm<f64>>;

    /// The errors of the particles of all processes, as [`errors`](Self::errors).
    fn errors_of_all(
        comparison: &Comparison<'_, D>,
        homes: &Homes,
        observed: (&Particles<Self, D>, &Law<Self, D>),
        times: (f64, f64),
    ) -> PerField<PerNorm<f64>>;

    /// The largest position error at `time`, and its particle.
    fn worst_particle(
        comparison: &Comparison<'_, D>,
        observed: (&Particles<Self, D>, &Law<Self, D>),
        time: f64,
    ) -> (f64, usize);
}

macro_rules! compared {
    ($($T:ty: $($D:literal)*;)*) => {
        $($(impl Compared<$D> for $T {
            fn errors(
                comparison: &Comparison<'_, $D>,
                observed: (&Particles<Self, $D>, &Law<Self, $D>),
                times: (f64, f64),
            ) -> PerField<PerNorm<f64>> {
                comparison.errors(observed, times)
            }

            fn errors_of_all(
                comparison: &Comparison<'_, $D>,
                homes: &Homes,
                observed: (&Particles<Self, $D>, &Law<Self, $D>),
                times: (f64, f64),
            ) -> PerField<PerNorm<f64>> {
                comparison.errors_of_all(homes, observed, times)
            }

            fn worst_particle(
                comparison: &Comparison<'_, $D>,
                observed: (&Particles<Self, $D>, &Law<Self, $D>),
                time: f64,
            ) -> (f64, usize) {
                comparison.worst(observed, time)
            }
        })*)*
    };
}

compared! {
    f64: 1 2 3;
    f32: 1 2 3;
}

/// Buffers of a comparison.
struct Room<T, const D: usize> {
    exact: [StateRun<f64, D>; RUNS],
    run: Run<T, D>,
    /// With memory, the number of its variables, and where its stresses are computed.
    memory: Option<(usize, Box<BlockWithMemory<T, D>>)>,
}

impl<T: Real, const D: usize> Room<T, D> {
    fn zero() -> Self {
        Self { exact: [StateRun::zero(); RUNS], run: Run::zero(), memory: None }
    }
}

/// One number for each particle of a run.
pub type Row<T> = [T; BLOCK];

/// Fields of `BLOCK` particles to compare, side by side.
struct Run<T, const D: usize> {
    X: [Row<T>; D],
    x: [Row<T>; D],
    v: [Row<T>; D],
    F: [[Row<T>; D]; D],
    /// The stress of their law at `F`.
    P: [[Row<T>; D]; D],
}

impl<T: Real, const D: usize> Run<T, D> {
    fn zero() -> Self {
        let (vector, matrix) = ([[T::zero(); BLOCK]; D], [[[T::zero(); BLOCK]; D]; D]);
        Self { X: vector, x: vector, v: vector, F: matrix, P: matrix }
    }

    /// Takes the particles with the numbers `places`. The last particle fills the rest of the run.
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

/// Calls `take` with each item of a run and its place. The last item fills the rest of the run.
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

/// The errors of a run as a loop over its rows. Processors differ in the width of their registers only; the bits are the same.
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

/// The magnitudes of the errors of u, v, F and P. A function of its own tells the compiler that input and output do not overlap.
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
    // Squares vanished or overflowed: the magnitudes are formed again, with a scale.
    for (field, magnitudes) in magnitudes.iter_mut().enumerate() {
        if magnitudes.iter().all(|magnitude| is_squarable(*magnitude)) {
            continue;
        }
        rescale(run, exact, field, magnitudes);
    }
}

/// The magnitudes of the errors of one field, whatever their size.
#[cold]
fn rescale<T: Real, const D: usize>(
    run: &Run<T, D>,
    exact: &StateRun<f64, D>,
    field: usize,
    magnitudes: &mut Row<f64>,
) {
    for (n, value) in magnitudes.iter_mut().enumerate().filter(|(_, value)| !is_squarable(**value))
    {
        let vector = |error: &dyn Fn(usize) -> f64| magnitude((0..D).map(error));
        let matrix = |error: &dyn Fn(usize, usize) -> f64| {
            magnitude((0..D * D).map(|k| error(k % D, k / D)))
        };
        *value = match field {
            0 => vector(&|i| run.x[i][n].to_f64() - run.X[i][n].to_f64() - exact.u[i][n]),
            1 => vector(&|i| run.v[i][n].to_f64() - exact.v[i][n]),
            2 => matrix(&|i, j| run.F[i][j][n].to_f64() - exact.F[i][j][n]),
            _ => matrix(&|i, j| run.P[i][j][n].to_f64() - exact.P[i][j][n]),
        };
    }
}

/// Maps numbers below `count` to places, and places back to numbers: the numbers are cut into `runs` runs, a run for each thread, and
/// each run is reversed.
///
/// A step goes through the particles upwards. A loop that then goes downwards first meets the particles that are still in the cache,
/// and leaves the particles there with which the next step begins.
fn backwards(count: usize, runs: usize) -> impl Fn(usize) -> usize {
    let start = move |run| count * run / runs;
    move |number| {
        // The last run that starts at the number or before it.
        let run = ((number + 1) * runs - 1) / count;
        start(run) + start(run + 1) - 1 - number
    }
}

/// Calls `group` for each number below `count`, on the threads of the pool. `group` is a reference, so that the code of the threads is
/// compiled once for each type of result.
pub fn each_group<R: Send>(count: usize, group: &(dyn Fn(usize) -> R + Sync)) -> Vec<R> {
    (0..count).into_par_iter().map(group).collect()
}

/// The norms of `N` magnitudes over `count` particles.
///
/// `magnitudes` is called with a buffer, the number of the first particle, and the rows for the magnitudes, at most `RUNS` times
/// `BLOCK` of them. The unused end of the last row is ignored. The result does not depend on the number of threads.
pub fn over_particles<R, const N: usize>(
    count: usize,
    room: impl Fn() -> R + Sync,
    magnitudes: impl Fn(&mut R, usize, &mut [[Row<f64>; N]]) + Sync,
) -> [PerNorm<f64>; N] {
    norms(joined(tallies(count, room, magnitudes)), count)
}

/// The norms of one magnitude of each particle; where there are several processes, `own` has those of the particles held here, and all
/// call this.
#[must_use]
pub fn norms_of(homes: Option<&Homes>, own: &[f64]) -> PerNorm<f64> {
    let tallies_of = |values: &[f64]| {
        tallies(
            values.len(),
            || (),
            |_, first, rows: &mut [[Row<f64>; 1]]| {
                for (k, value) in values[first..].iter().take(rows.len() * BLOCK).enumerate() {
                    rows[k / BLOCK][0][k % BLOCK] = *value;
                }
            },
        )
    };
    let [of_all] = match homes {
        None => norms(joined(tallies_of(own)), own.len()),
        Some(homes) => over_homes(homes, tallies_of(&homes.bring(own))),
    };
    of_all
}

/// The norms of magnitudes over the particles of all processes; `groups` has the tallies of the groups whose home is here. Collective.
fn over_homes<const N: usize>(homes: &Homes, groups: Vec<[Tally; N]>) -> [PerNorm<f64>; N] {
    norms(joined_over(homes, GROUP, groups), homes.count())
}

/// The norms of the tallies of `count` particles.
fn norms<const N: usize>(tallies: Option<[Tally; N]>, count: usize) -> [PerNorm<f64>; N] {
    tallies.unwrap_or([Tally::default(); N]).map(|tally| tally.norms(count))
}

/// The tallies of each group of particles; `magnitudes` as for [`over_particles`].
fn tallies<R, const N: usize>(
    count: usize,
    room: impl Fn() -> R + Sync,
    magnitudes: impl Fn(&mut R, usize, &mut [[Row<f64>; N]]) + Sync,
) -> Vec<[Tally; N]> {
    let pass = |g: usize, scales: [f64; N]| {
        let mut room = room();
        let mut chunk = [[[0.0; BLOCK]; N]; RUNS];
        let mut tallies = [Tallies::default(); N];
        for first in (g * GROUP..count.min((g + 1) * GROUP)).step_by(CHUNK) {
            let count = CHUNK.min(count - first);
            let chunk = &mut chunk[..count.div_ceil(BLOCK)];
            magnitudes(&mut room, first, chunk);
            let filled = count % BLOCK;
            if filled > 0
                && let Some(rows) = chunk.last_mut()
            {
                rows.iter_mut().for_each(|row| row[filled..].fill(0.0));
            }
            for (n, scale) in scales.into_iter().enumerate().filter(|(_, scale)| *scale != 1.0) {
                chunk.iter_mut().for_each(|rows| rows[n].iter_mut().for_each(|m| *m /= scale));
            }
            widest(Add { rows: chunk, tallies: &mut tallies });
        }
        let mut scaled = tallies.map(|tallies| tallies.joined());
        scaled.iter_mut().zip(scales).for_each(|(tally, scale)| *tally = tally.divided_by(scale));
        scaled
    };
    let group = |g: usize| {
        let tallies = pass(g, [1.0; N]);
        let scales = tallies.map(|tally| tally.scale_to_take());
        if scales == [1.0; N] { tallies } else { pass(g, scales) }
    };
    let groups = count.div_ceil(GROUP);
    let place = backwards(groups, current_num_threads());
    let at_places = each_group(groups, &|at| group(place(at)));
    (0..groups).map(|g| at_places[place(g)]).collect()
}

/// Adds magnitudes to their tallies.
struct Add<'a, const N: usize> {
    rows: &'a [[Row<f64>; N]],
    tallies: &'a mut [Tallies<BLOCK>; N],
}

impl<const N: usize> WithSimd for Add<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (n, tallies) in self.tallies.iter_mut().enumerate() {
            self.rows.iter().for_each(|rows| tallies.add(&rows[n]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_solutions::{AxisAligned, AxisAlignedParameters};
    use nalgebra::SMatrix;

    /// Sums go over whole groups and what is left of one, run and row; the last of each is compared too.
    #[test]
    fn every_particle_is_compared_once() {
        let exact = AxisAligned::<f64>::new(AxisAlignedParameters::default()).unwrap();
        let law = Law::from(mmsmith_laws::Material::NeoHookean { lambda: 3.0, mu: 2.0 });
        for count in [1, BLOCK, CHUNK + 5, GROUP, 2 * GROUP + CHUNK + BLOCK + 3] {
            let X: Vec<_> = (0..count).map(|n| [0.3, n as f64 / count as f64].into()).collect();
            let mut particles = Particles {
                x: X.clone(),
                v: vec![SVector::zeros(); count],
                F: vec![SMatrix::identity(); count],
                mass: vec![1.0; count],
                volume: vec![1.0; count],
                half_size: [0.1; 2].into(),
                X,
                ..Particles::default()
            };
            let u: Vec<_> = particles.X.iter().map(|X| exact.displacement(X, 0.0)).collect();
            particles.x.iter_mut().zip(&u).for_each(|(x, u)| *x += u);
            let comparison = Comparison::new(&exact, &particles.X);
            let measure = |particles: &_| comparison.measure((particles, &law), 0.0, 0.0);
            assert!(measure(&particles).u.linf < 1e-15);
            for p in [0, count / 2, count - 1] {
                let x = particles.x[p];
                particles.x[p].x += 3.0;
                let norms = measure(&particles).u;
                let (mean, root) = (3.0 / count as f64, 3.0 / (count as f64).sqrt());
                assert!((norms.linf - 3.0).abs() < 1e-14, "{count} {p}");
                assert!((norms.l1 / mean - 1.0).abs() < 1e-13, "{count} {p}");
                assert!((norms.l2 / root - 1.0).abs() < 1e-13, "{count} {p}");
                assert_eq!(comparison.worst_particle((&particles, &law), 0.0), p);
                let first = particles.x[0];
                particles.x[0].y += 5.0;
                particles.x[p].y = f64::NAN;
                assert!(measure(&particles).u.linf.is_nan());
                assert_eq!(comparison.worst_particle((&particles, &law), 0.0), p);
                particles.x[0] = first;
                particles.x[p] = x;
            }
        }
    }

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
