//! Error norms over particles and steps.
//!
//! The differences between computed and exact fields are formed first and squared afterwards; their magnitudes
//! are Euclidean norms of vectors and Frobenius norms of tensors. Partial sums belong to fixed groups of
//! particles and are added in a tree of fixed shape, so the result does not depend on the number of threads.

use serde::{Deserialize, Serialize};
use std::array;
use std::fmt;
use std::ops::Index;

use crate::tree::Sums;

/// A field whose error is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Field {
    /// Displacement.
    #[serde(rename = "u")]
    Displacement,
    /// Velocity.
    #[serde(rename = "v")]
    Velocity,
    /// Deformation gradient.
    #[serde(rename = "F")]
    DeformationGradient,
    /// First Piola-Kirchhoff stress.
    #[serde(rename = "P")]
    Stress,
}

impl Field {
    /// All fields, in the order of [`PerField`].
    pub const ALL: [Self; 4] =
        [Self::Displacement, Self::Velocity, Self::DeformationGradient, Self::Stress];
}

/// The letter of the field.
impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Displacement => "u",
            Self::Velocity => "v",
            Self::DeformationGradient => "F",
            Self::Stress => "P",
        })
    }
}

/// A norm over the particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Norm {
    /// The largest magnitude.
    Linf,
    /// The root of the mean square.
    L2,
    /// The mean.
    L1,
}

impl Norm {
    /// All norms, in the order of [`PerNorm`].
    pub const ALL: [Self; 3] = [Self::Linf, Self::L2, Self::L1];

    /// The name in captions.
    #[must_use]
    pub fn caption(self) -> &'static str {
        match self {
            Self::Linf => "L_inf",
            Self::L2 => "L2",
            Self::L1 => "L1",
        }
    }
}

/// The name in options, tables and JSON.
impl fmt::Display for Norm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Linf => "linf",
            Self::L2 => "l2",
            Self::L1 => "l1",
        })
    }
}

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

impl<N> Index<Field> for PerField<N> {
    type Output = N;

    fn index(&self, field: Field) -> &N {
        match field {
            Field::Displacement => &self.u,
            Field::Velocity => &self.v,
            Field::DeformationGradient => &self.F,
            Field::Stress => &self.P,
        }
    }
}

impl<V> Index<Norm> for PerNorm<V> {
    type Output = V;

    fn index(&self, norm: Norm) -> &V {
        match norm {
            Norm::Linf => &self.linf,
            Norm::L2 => &self.l2,
            Norm::L1 => &self.l1,
        }
    }
}

impl<N> PerField<N> {
    /// One value for each field.
    pub fn from_fn(f: impl Fn(Field) -> N) -> Self {
        let [u, v, F, P] = Field::ALL.map(f);
        Self { u, v, F, P }
    }

    /// The values with their fields, in the order of [`Field::ALL`].
    pub fn iter(&self) -> array::IntoIter<(Field, &N), 4> {
        Field::ALL.map(|field| (field, &self[field])).into_iter()
    }

    /// Applies `f` to the value of each field.
    pub fn map<M>(&self, f: impl Fn(&N) -> M) -> PerField<M> {
        PerField::from_fn(|field| f(&self[field]))
    }

    /// Combines two values of each field by `f`.
    pub fn combine<A, B>(a: &PerField<A>, b: &PerField<B>, f: impl Fn(&A, &B) -> N) -> Self {
        Self::from_fn(|field| f(&a[field], &b[field]))
    }
}

impl<V> PerNorm<V> {
    /// One value for each norm.
    pub fn from_fn(f: impl Fn(Norm) -> V) -> Self {
        let [linf, l2, l1] = Norm::ALL.map(f);
        Self { linf, l2, l1 }
    }

    /// The values with their norms, in the order of [`Norm::ALL`].
    pub fn iter(&self) -> array::IntoIter<(Norm, &V), 3> {
        Norm::ALL.map(|norm| (norm, &self[norm])).into_iter()
    }

    /// Applies `f` to the value of each norm.
    pub fn map<M>(&self, f: impl Fn(&V) -> M) -> PerNorm<M> {
        PerNorm::from_fn(|norm| f(&self[norm]))
    }
}

/// The larger of two magnitudes; unlike `f64::max`, NaN wins, so that it cannot hide.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Within this range, squares of magnitudes and their sums neither vanish nor overflow.
const SQUARABLE: std::ops::RangeInclusive<f64> = 1e-140..=1e140;

/// The power of two by which magnitudes are divided before they are squared, where `max` is the largest magnitude: one unless squares
/// would vanish or overflow.
pub fn scale_of(max: f64) -> f64 {
    if max == 0.0 || !max.is_finite() || SQUARABLE.contains(&max) {
        return 1.0;
    }
    // Within these limits the inverse is finite, too.
    2.0_f64.powi(max.log2().floor().clamp(-1000.0, 1000.0) as i32)
}

/// The root of the sum of the squares of components, whatever their size.
pub fn magnitude(components: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = components.clone().fold(0.0, |largest, c: f64| larger(largest, c.abs()));
    let scale = scale_of(largest);
    scale * components.fold(0.0, |sum, c| sum + (c / scale) * (c / scale)).sqrt()
}

/// Whether the square of a magnitude is accurate. A magnitude of zero may come from squares that vanished.
#[inline(always)]
pub fn is_squarable(magnitude: f64) -> bool {
    SQUARABLE.contains(&magnitude)
}

/// Sums over one group of particles at one step, of magnitudes divided by a power of two.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    max: f64,
    square: f64,
    sum: f64,
    scale: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { max: 0.0, square: 0.0, sum: 0.0, scale: 1.0 }
    }
}

impl Tally {
    /// Appends the sums of the next group.
    pub fn join(&self, next: &Self) -> Self {
        if self.scale != next.scale {
            // A sum of zeros takes the scale of the other.
            let scale = match (self.max == 0.0, next.max == 0.0) {
                (true, _) => next.scale,
                (_, true) => self.scale,
                _ => self.scale.max(next.scale),
            };
            return self.at(scale).join(&next.at(scale));
        }
        Self {
            max: larger(self.max, next.max),
            square: self.square + next.square,
            sum: self.sum + next.sum,
            scale: self.scale,
        }
    }

    /// These sums with magnitudes divided by another power of two.
    fn at(&self, scale: f64) -> Self {
        let ratio = self.scale / scale;
        Self {
            max: self.max * ratio,
            square: self.square * ratio * ratio,
            sum: self.sum * ratio,
            scale,
        }
    }

    /// Sums of magnitudes that had been divided by `scale`.
    pub fn divided_by(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    /// The power of two by which these magnitudes have to be divided before they are squared.
    pub fn scale_to_take(&self) -> f64 {
        scale_of(self.max)
    }

    /// The norms over `count` particles.
    pub fn norms(&self, count: usize) -> PerNorm<f64> {
        let count = count as f64;
        PerNorm {
            linf: self.scale * self.max,
            l2: self.scale * (self.square / count).sqrt(),
            l1: self.scale * (self.sum / count),
        }
    }
}

impl<const N: usize> Sums for [Tally; N] {
    const NUMBERS: usize = 4 * N;

    fn join(&self, next: &Self) -> Self {
        array::from_fn(|n| self[n].join(&next[n]))
    }

    fn write(&self, numbers: &mut Vec<f64>) {
        for Tally { max, square, sum, scale } in self {
            numbers.extend([max, square, sum, scale]);
        }
    }

    fn read(numbers: &[f64]) -> Self {
        array::from_fn(|n| {
            let [max, square, sum, scale] = array::from_fn(|k| numbers[4 * n + k]);
            Tally { max, square, sum, scale }
        })
    }
}

/// The tallies of `N` interleaved sequences of particles: particle `n` belongs to sequence `n mod N`.
#[derive(Clone, Copy, Debug)]
pub struct Tallies<const N: usize> {
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
    /// Adds one magnitude to each sequence.
    #[inline(always)]
    pub fn add(&mut self, magnitudes: &[f64; N]) {
        for n in 0..N {
            self.max[n] = larger(self.max[n], magnitudes[n]);
            self.square[n] += magnitudes[n] * magnitudes[n];
            self.sum[n] += magnitudes[n];
        }
    }

    /// The sums of all sequences, one after the other.
    pub fn joined(&self) -> Tally {
        let own =
            |n| Tally { max: self.max[n], square: self.square[n], sum: self.sum[n], scale: 1.0 };
        (0..N).map(own).fold(Tally::default(), |all, next| all.join(&next))
    }
}

impl PerNorm<f64> {
    /// The larger of two values, norm by norm.
    pub fn larger(&self, other: &Self) -> Self {
        Self::from_fn(|norm| larger(self[norm], other[norm]))
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
    fn magnitudes_whose_squares_are_no_numbers_have_norms_all_the_same() {
        for unit in [1e-310, 1e-200, 1e-141, 1.0, 1e141, 1e160, 1e300] {
            let scale = scale_of(4.0 * unit);
            let mut tally = Tallies::<1>::default();
            [3.0, 4.0, 0.0].iter().for_each(|value| tally.add(&[value * unit / scale]));
            let norms = tally.joined().divided_by(scale).join(&Tally::default()).norms(3);
            assert!((norms.linf / unit / 4.0 - 1.0).abs() < 1e-12, "{unit:e} {norms:?}");
            assert!((norms.l2 / unit / (25.0_f64 / 3.0).sqrt() - 1.0).abs() < 1e-12, "{unit:e}");
            assert!((norms.l1 / unit / (7.0 / 3.0) - 1.0).abs() < 1e-12, "{unit:e}");
            let length = magnitude([3.0 * unit, -4.0 * unit].into_iter());
            assert!((length / unit / 5.0 - 1.0).abs() < 1e-12, "{unit:e} {length:e}");
        }
        assert!(magnitude([f64::NAN, 1.0].into_iter()).is_nan());
        assert_eq!(magnitude([f64::INFINITY, 1.0].into_iter()), f64::INFINITY);
    }

    #[test]
    fn groups_of_very_different_size_are_joined_in_the_larger_ones_scale() {
        let one = |value: f64| {
            let scale = scale_of(value);
            let mut tally = Tallies::<1>::default();
            tally.add(&[value / scale]);
            tally.joined().divided_by(scale)
        };
        for (a, b) in [(1e-200, 2.0), (2.0, 1e-200), (1e200, 2.0), (1e-200, 1e200)] {
            let norms = one(a).join(&one(b)).norms(1);
            assert!((norms.l2 / a.max(b) - 1.0).abs() < 1e-14, "{a:e} {b:e}");
        }
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
