//! Series in time of particles that stay at their places, from tables or from their own histories.

use super::{Histories, Tables, is_identity, turn_tensor, turn_tensors, turn_vector};
use mmsmith_history::{AtPoint, AtTime};
use mmsmith_runtime::Real;
use mmsmith_runtime::nalgebra::SVector;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::array;
use std::ops::Range;
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
    OfTables {
        /// How many fields there are.
        count: usize,
        /// Coefficients of a series of one piece, with zeros up to a multiple of [`SIDE_BY_SIDE`].
        padded: usize,
        pieces: usize,
        /// For each piece, particle and field the coefficients: at a time those of all particles are next to each other.
        coefficients: Vec<f64>,
    },
    /// From the history of each particle; none where it could not be followed.
    Own(Vec<Option<AtPoint>>),
}

/// A particle.
struct Place<const D: usize> {
    X: [f64; D],
    /// `[i][a]`: Cartesian component `i` of the unit vector `a` of its frame.
    frame: [[f64; D]; D],
}

/// Terms of a series that are summed side by side.
const SIDE_BY_SIDE: usize = 4;
/// Particles whose series are formed at a time.
const CHUNK: usize = 1024;

/// Polynomials in time of a table, at most, with zeros up to a multiple of [`SIDE_BY_SIDE`].
const MOST_TERMS: usize = 32;

/// The polynomials at a time, for [`Prepared`].
pub(crate) struct Moment {
    t: f64,
    piece: usize,
    polynomials: [f64; MOST_TERMS],
}

/// How many numbers of a type hold all digits of a double.
const fn parts<T>() -> usize {
    if size_of::<T>() < size_of::<f64>() { 3 } else { 1 }
}

impl Moment {
    /// Appends the time and its polynomials to `values`, so that no block of particles forms them anew.
    pub(crate) fn put<T: Real>(&self, t: T, values: &mut Vec<T>) {
        values.extend([t, T::nearest(self.piece as f64)]);
        for &polynomial in &self.polynomials {
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
        let (&[t, piece], polynomials) = values.split_at(2) else {
            panic!("a time and its piece are needed, not {} values", values.len())
        };
        let mut own = [0.0; MOST_TERMS];
        for (own, parts) in own.iter_mut().zip(polynomials.chunks_exact(parts::<T>())) {
            *own = parts.iter().rev().fold(0.0, |sum, part| sum + part.to_f64());
        }
        Self { t: t.to_f64(), piece: piece.to_f64() as usize, polynomials: own }
    }
}

/// The body forces of particles from series of tables.
struct Forces<'a, 'b, T, const D: usize> {
    points: &'a Prepared<'a, D>,
    coefficients: &'a [f64],
    /// Coefficients of a series of one piece.
    padded: usize,
    moment: &'a Moment,
    particles: &'a [u32],
    b: &'b mut [SVector<T, D>],
}

impl<T: Real, const D: usize> WithSimd for Forces<'_, '_, T, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<I: Simd>(self, _: I) {
        let Self { points, coefficients, padded, moment, particles, b } = self;
        let polynomials = &moment.polynomials[..padded];
        for (&n, b) in particles.iter().zip(b) {
            let n = n as usize;
            let first = (moment.piece * points.len() + n) * D * padded;
            let own = &coefficients[first..][..D * padded];
            let own: [f64; D] = array::from_fn(|k| sum(&own[k * padded..][..padded], polynomials));
            let own = if points.is_cartesian {
                own.map(|own| own + 0.0)
            } else {
                turn_vector(&points.particles[n].frame, |a| own[a])
            };
            *b = SVector::from_fn(|i, _| T::nearest(own[i]));
        }
    }
}

/// A series of the polynomials at a time.
#[inline(always)]
fn sum(coefficients: &[f64], polynomials: &[f64]) -> f64 {
    let mut sums = [0.0; SIDE_BY_SIDE];
    let terms = coefficients.as_chunks::<SIDE_BY_SIDE>().0;
    for (c, p) in terms.iter().zip(polynomials.as_chunks::<SIDE_BY_SIDE>().0) {
        for m in 0..SIDE_BY_SIDE {
            sums[m] += c[m] * p[m];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
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
        let series = if tables.table.is_some() {
            SeriesOfAll::of_tables(histories, &tables, &range, X)
        } else {
            let own = |X: &[f64; D]| histories.own_series(*X, tables.end, &range);
            SeriesOfAll::Own(X.par_iter().map(own).collect())
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
            SeriesOfAll::OfTables { count, padded, pieces, .. } => pieces * count * padded,
            SeriesOfAll::Own(all) => {
                all.iter().flatten().next().map_or(0, |series| series.coefficients(0).len() * D)
            }
        };
        size_of::<Place<D>>() + 8 * of_series
    }

    /// The values of a time that all particles need.
    pub(crate) fn moment(&self, t: f64) -> Moment {
        let AtTime { piece, polynomials } = self.tables.at_time(t);
        let mut own = [0.0; MOST_TERMS];
        own[..polynomials.len()].copy_from_slice(&polynomials);
        Moment { t, piece, polynomials: own }
    }

    /// Field `k` of particle `n` in its frame.
    #[inline]
    fn value(&self, n: usize, k: usize, moment: &Moment) -> f64 {
        let (count, padded, coefficients) = match &self.series {
            SeriesOfAll::Own(all) => {
                return all[n].as_ref().map_or(f64::NAN, |series| series.value(k, moment.t));
            }
            SeriesOfAll::OfTables { count, padded, coefficients, .. } => {
                (*count, *padded, coefficients)
            }
        };
        let first = ((moment.piece * self.len() + n) * count + k) * padded;
        sum(&coefficients[first..][..padded], &moment.polynomials[..padded])
    }

    /// The body forces of particles with the given numbers.
    pub(crate) fn body_forces<T: Real>(
        &self,
        particles: &[u32],
        moment: &Moment,
        b: &mut [SVector<T, D>],
    ) {
        if let SeriesOfAll::OfTables { padded, coefficients, .. } = &self.series
            && self.has(moment.t)
        {
            let padded = *padded;
            let forces = Forces { points: self, coefficients, padded, moment, particles, b };
            return Arch::new().dispatch(forces);
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
        let own: [f64; D] = std::array::from_fn(|a| self.value(n, a, moment));
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

impl SeriesOfAll {
    fn of_tables<const D: usize>(
        histories: &Histories<D>,
        tables: &Tables<D>,
        range: &Range<usize>,
        X: &[[f64; D]],
    ) -> Self {
        let in_time = tables.at_time(0.0).polynomials.len().max(1);
        let padded = in_time.next_multiple_of(SIDE_BY_SIDE);
        let (mut pieces, mut coefficients) = (1, Vec::new());
        for (chunk, places) in X.chunks(CHUNK).enumerate() {
            for (n, series) in (chunk * CHUNK..).zip(tables.at_all(histories, places, range)) {
                pieces = series.coefficients(0).len() / in_time;
                coefficients.resize(pieces * X.len() * range.len() * padded, 0.0);
                for piece in 0..pieces {
                    let first = (piece * X.len() + n) * range.len() * padded;
                    for quantity in 0..range.len() {
                        let own = &series.coefficients(quantity)[piece * in_time..][..in_time];
                        coefficients[first + quantity * padded..][..in_time].copy_from_slice(own);
                    }
                }
            }
        }
        Self::OfTables { count: range.len(), padded, pieces, coefficients }
    }
}
