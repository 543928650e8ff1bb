//! Error norms over particles and steps.
//!
//! The differences between computed and exact fields are formed first and squared afterwards; their magnitudes
//! are Euclidean norms of vectors and Frobenius norms of tensors. Partial sums belong to fixed groups of
//! particles and are added in order, so the result does not depend on the number of threads.

use serde::{Deserialize, Serialize};

/// One value for each field whose error is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerField<N> {
    /// Displacement, a length.
    pub u: N,
    /// Velocity, at the time where the scheme stores it.
    pub v: N,
    /// Deformation gradient, dimensionless.
    pub F: N,
    /// First Piola-Kirchhoff stress.
    pub P: N,
}

/// One value for each norm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerNorm<V> {
    /// Largest magnitude over all particles and steps.
    pub linf: V,
    /// Root of the mean square over the particles, the largest over the steps.
    pub l2: V,
    /// Mean magnitude over the particles, the largest over the steps.
    pub l1: V,
}

impl<N> PerField<N> {
    /// The fields' names with their values, in the order of the struct.
    pub fn named(&self) -> [(&'static str, &N); 4] {
        [("u", &self.u), ("v", &self.v), ("F", &self.F), ("P", &self.P)]
    }

    /// Field by field, what `f` makes of the value.
    pub(crate) fn map<M>(&self, f: impl Fn(&N) -> M) -> PerField<M> {
        PerField { u: f(&self.u), v: f(&self.v), F: f(&self.F), P: f(&self.P) }
    }

    /// Field by field, what `f` makes of two values.
    pub(crate) fn combine<A, B>(a: &PerField<A>, b: &PerField<B>, f: impl Fn(&A, &B) -> N) -> Self {
        Self { u: f(&a.u, &b.u), v: f(&a.v, &b.v), F: f(&a.F, &b.F), P: f(&a.P, &b.P) }
    }
}

impl<V> PerNorm<V> {
    /// The norms' names with their values, in the order of the struct.
    pub fn named(&self) -> [(&'static str, &V); 3] {
        [("linf", &self.linf), ("l2", &self.l2), ("l1", &self.l1)]
    }

    /// Norm by norm, what `f` makes of the value.
    pub(crate) fn map<M>(&self, f: impl Fn(&V) -> M) -> PerNorm<M> {
        PerNorm { linf: f(&self.linf), l2: f(&self.l2), l1: f(&self.l1) }
    }
}

/// The larger of two magnitudes; unlike `f64::max`, NaN wins, so that it cannot hide.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Sums over one group of particles at one step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    max: f64,
    square: f64,
    sum: f64,
}

impl Tally {
    /// Appends the sums of the next group.
    pub(crate) fn join(&self, next: &Self) -> Self {
        Self {
            max: larger(self.max, next.max),
            square: self.square + next.square,
            sum: self.sum + next.sum,
        }
    }

    /// The norms over `count` particles.
    pub(crate) fn norms(&self, count: usize) -> PerNorm<f64> {
        let count = count as f64;
        PerNorm { linf: self.max, l2: (self.square / count).sqrt(), l1: self.sum / count }
    }
}

/// The tallies of `N` sequences of particles side by side: every `N`-th particle belongs to the same one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tallies<const N: usize> {
    max: [f64; N],
    square: [f64; N],
    sum: [f64; N],
}

impl<const N: usize> Default for Tallies<N> {
    fn default() -> Self {
        let zero = [0.0; N];
        Self { max: zero, square: zero, sum: zero }
    }
}

impl<const N: usize> Tallies<N> {
    /// Adds one magnitude to each.
    #[inline(always)]
    pub(crate) fn add(&mut self, magnitudes: &[f64; N]) {
        for n in 0..N {
            self.max[n] = larger(self.max[n], magnitudes[n]);
            self.square[n] += magnitudes[n] * magnitudes[n];
            self.sum[n] += magnitudes[n];
        }
    }

    /// The sums of all sequences, one after the other.
    pub(crate) fn joined(&self) -> Tally {
        let own = |n| Tally { max: self.max[n], square: self.square[n], sum: self.sum[n] };
        (0..N).map(own).fold(Tally::default(), |all, next| all.join(&next))
    }
}

impl PerNorm<f64> {
    /// Norm by norm, the larger of the two.
    pub(crate) fn larger(&self, other: &Self) -> Self {
        Self {
            linf: larger(self.linf, other.linf),
            l2: larger(self.l2, other.l2),
            l1: larger(self.l1, other.l1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norms_of_a_known_set() {
        let mut first = Tallies::<1>::default();
        first.add(&[3.0]);
        let mut second = Tallies::<1>::default();
        second.add(&[4.0]);
        second.add(&[0.0]);
        let norms = first.joined().join(&second.joined()).norms(3);
        assert_eq!(norms.linf, 4.0);
        assert!((norms.l2 - (25.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((norms.l1 - 7.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn sequences_side_by_side_are_as_one() {
        let mut tallies = Tallies::<4>::default();
        tallies.add(&[3.0, 0.0, 4.0, 1.0]);
        tallies.add(&[2.0, 5.0, 0.0, 0.0]);
        let norms = tallies.joined().norms(6);
        assert_eq!((norms.linf, norms.l1), (5.0, 2.5));
        assert!((norms.l2 - (55.0_f64 / 6.0).sqrt()).abs() < 1e-15);
        tallies.add(&[0.0, f64::NAN, 0.0, 0.0]);
        assert!(tallies.joined().norms(7).linf.is_nan());
    }

    #[test]
    fn not_a_number_is_never_hidden_by_a_number() {
        for magnitudes in [[1.0, f64::NAN], [f64::NAN, 1.0]] {
            let mut tallies = Tallies::<1>::default();
            magnitudes.iter().for_each(|m| tallies.add(&[*m]));
            assert!(tallies.joined().norms(2).linf.is_nan());
        }
        assert!(larger(f64::NAN, 2.0).is_nan() && larger(2.0, f64::NAN).is_nan());
    }

    #[test]
    fn the_largest_over_steps_is_taken_norm_by_norm() {
        let a = PerNorm { linf: 2.0, l2: 1.0, l1: 0.5 };
        let b = PerNorm { linf: 1.0, l2: 1.5, l1: 0.25 };
        assert_eq!(a.larger(&b), PerNorm { linf: 2.0, l2: 1.5, l1: 0.5 });
    }
}
