//! Series in time of particles that stay at their places, from tables or from their own histories.

use super::packed::{MOST_TERMS, Packed, PackedTime};
use super::{Histories, Tables, is_identity, turn_tensor, turn_tensors, turn_vector};
use mmsmith_history::AtPoint;
use mmsmith_lanes::simd::widest;
use mmsmith_runtime::Real;
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_threads::parallel::*;
use pulp::{Simd, WithSimd};
use std::sync::Arc;

/// A field, or several, by their place among the quantities of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantities {
    BodyForce,
    Stress,
    Internal,
}

/// Series of fields of particles that stay at their places.
pub(crate) struct Prepared<'a, const D: usize> {
    histories: &'a Histories<D>,
    tables: Arc<Tables<D>>,
    series: SeriesOfAll,
    particles: Vec<Place<D>>,
    /// Whether the frames of all particles are Cartesian axes.
    is_cartesian: bool,
}

enum SeriesOfAll {
    /// From tables, all with the same pieces.
    OfTables(Packed),
    /// From the history of each particle; none where it could not be followed.
    Own(Vec<Option<AtPoint>>),
}

/// A particle.
struct Place<const D: usize> {
    X: [f64; D],
    /// `[i][a]`: Cartesian component `i` of the unit vector `a` of its frame.
    frame: [[f64; D]; D],
}

/// Particles whose series are formed at a time.
const CHUNK: usize = 1024;

/// A time, for [`Prepared`].
pub(crate) struct Moment {
    t: f64,
    packed: PackedTime,
    /// How many polynomials series have.
    terms: usize,
}

/// How many numbers of a type hold all digits of a double.
const fn parts<T>() -> usize {
    if size_of::<T>() < size_of::<f64>() { 3 } else { 1 }
}

impl Moment {
    /// Appends the time and its polynomials to `values`, so that no block of particles forms them anew.
    pub(crate) fn put<T: Real>(&self, t: T, values: &mut Vec<T>) {
        values.extend([t, T::nearest(self.packed.half as f64)]);
        for &polynomial in &self.packed.polynomials[..self.terms] {
            let mut rest = polynomial;
            for _ in 0..parts::<T>() {
                let part = T::nearest(rest);
                rest -= part.to_f64();
                values.push(part);
            }
        }
    }

    /// From values that [`put`](Self::put) appended.
    #[inline]
    pub(crate) fn of<T: Real>(values: &[T]) -> Self {
        let (&[t, half], all) = values.split_at(2) else {
            panic!("a time and its piece are needed, not {} values", values.len())
        };
        let terms = all.len() / parts::<T>();
        let mut polynomials = [0.0; MOST_TERMS];
        for (own, parts) in polynomials.iter_mut().zip(all.chunks_exact(parts::<T>())) {
            *own = parts.iter().rev().fold(0.0, |sum, part| sum + part.to_f64());
        }
        Self {
            t: t.to_f64(),
            packed: PackedTime { half: half.to_f64() as usize, polynomials },
            terms,
        }
    }
}

/// The body forces of particles from series of tables.
struct Forces<'a, 'b, T, const D: usize> {
    points: &'a Prepared<'a, D>,
    series: &'a Packed,
    moment: &'a Moment,
    particles: &'a [u32],
    b: &'b mut [SVector<T, D>],
}

impl<T: Real, const D: usize> WithSimd for Forces<'_, '_, T, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<I: Simd>(self, _: I) {
        let Self { points, series, moment, particles, b } = self;
        for (&n, b) in particles.iter().zip(b) {
            let n = n as usize;
            let own: [f64; D] = series.values(n, &moment.packed);
            let own = if points.is_cartesian {
                own.map(|own| own + 0.0)
            } else {
                turn_vector(&points.particles[n].frame, |a| own[a])
            };
            *b = SVector::from_fn(|i, _| T::nearest(own[i]));
        }
    }
}

impl<'a, const D: usize> Prepared<'a, D> {
    pub(crate) fn new(
        histories: &'a Histories<D>,
        tables: Arc<Tables<D>>,
        quantities: Quantities,
        X: &[[f64; D]],
    ) -> Self {
        let range = match quantities {
            Quantities::BodyForce => 0..D,
            Quantities::Stress => D..D + D * D,
            Quantities::Internal => D + D * D..D + D * D + histories.names.len(),
        };
        let place = |X: &[f64; D]| Place { X: *X, frame: histories.particle(*X).frame };
        let series = match tables.packing(&histories.kinds(), &range) {
            Some(packing) => {
                let mut packed = Packed::new(packing, X.len());
                for (chunk, places) in X.chunks(CHUNK).enumerate() {
                    let all = tables.at_all(histories, places, &range);
                    (chunk * CHUNK..).zip(&all).for_each(|(n, series)| packed.set(n, series));
                }
                SeriesOfAll::OfTables(packed)
            }
            None => {
                let own = |X: &[f64; D]| histories.own_series(*X, tables.end, &range);
                SeriesOfAll::Own(X.par_iter().map(own).collect())
            }
        };
        let particles: Vec<_> = X.par_iter().map(place).collect();
        let is_cartesian = particles.iter().all(|own| is_identity(&own.frame));
        Self { histories, series, particles, is_cartesian, tables }
    }

    pub(crate) fn len(&self) -> usize {
        self.particles.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        let of_series = match &self.series {
            SeriesOfAll::OfTables(packed) => packed.bytes_per_particle(),
            SeriesOfAll::Own(all) => {
                let first = all.iter().flatten().next();
                first.map_or(0, |series| size_of::<f64>() * D * series.coefficients(0).len())
            }
        };
        size_of::<Place<D>>() + of_series
    }

    /// The values of a time that all particles need.
    pub(crate) fn moment(&self, t: f64) -> Moment {
        let terms = match &self.series {
            SeriesOfAll::OfTables(packed) => packed.terms(),
            SeriesOfAll::Own(_) => 0,
        };
        Moment { t, packed: PackedTime::of(self.tables.at_time(t)), terms }
    }

    /// Field `k` of particle `n` in its frame.
    #[inline]
    fn value(&self, n: usize, k: usize, moment: &Moment) -> f64 {
        match &self.series {
            SeriesOfAll::Own(all) => {
                all[n].as_ref().map_or(f64::NAN, |series| series.value(k, moment.t))
            }
            SeriesOfAll::OfTables(packed) => packed.value(n, k, &moment.packed),
        }
    }

    /// The body forces of particles with the given numbers.
    pub(crate) fn body_forces<T: Real>(
        &self,
        particles: &[u32],
        moment: &Moment,
        b: &mut [SVector<T, D>],
    ) {
        if let SeriesOfAll::OfTables(series) = &self.series
            && self.has(moment.t)
        {
            let forces = Forces { points: self, series, moment, particles, b };
            return widest(forces);
        }
        for (n, b) in particles.iter().zip(b) {
            let own = self.body_force(*n as usize, moment);
            *b = SVector::from_fn(|i, _| T::nearest(own[i]));
        }
    }

    /// Whether the tables have this time; later ones take a trajectory each.
    fn has(&self, t: f64) -> bool {
        t <= self.tables.end * (1.0 + 1e-12)
    }

    #[inline]
    pub(crate) fn body_force(&self, n: usize, moment: &Moment) -> [f64; D] {
        let Place { X, frame } = &self.particles[n];
        if !self.has(moment.t) {
            let found = self.histories.response(*X, moment.t);
            return found.map_or([f64::NAN; D], |response| response.b);
        }
        let own: [f64; D] = match &self.series {
            SeriesOfAll::OfTables(packed) => packed.values(n, &moment.packed),
            SeriesOfAll::Own(_) => std::array::from_fn(|a| self.value(n, a, moment)),
        };
        turn_vector(frame, |a| own[a])
    }

    pub(crate) fn stress(&self, n: usize, moment: &Moment) -> [[f64; D]; D] {
        let Place { X, frame: Q } = &self.particles[n];
        if !self.has(moment.t) {
            let nan = [[f64::NAN; D]; D];
            return self.histories.stressed(*X, moment.t).map_or(nan, |found| found.P);
        }
        let own: [[f64; D]; D] =
            std::array::from_fn(|a| std::array::from_fn(|b| self.value(n, a * D + b, moment)));
        turn_tensor(Q, |k| own[k / D][k % D])
    }

    pub(crate) fn internal(&self, n: usize, moment: &Moment) -> Vec<f64> {
        let Place { X, frame } = &self.particles[n];
        let names = &self.histories.names;
        if !self.has(moment.t) {
            let nan = vec![f64::NAN; names.len()];
            return self.histories.stressed(*X, moment.t).map_or(nan, |found| found.internal);
        }
        let mut own: Vec<f64> = (0..names.len()).map(|k| self.value(n, k, moment)).collect();
        turn_tensors(&self.histories.tensors, frame, &mut own);
        own
    }
}
