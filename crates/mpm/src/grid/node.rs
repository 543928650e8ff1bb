//! A node of the background grid.

use nalgebra::{RealField, SVector};

/// Numbers in a node: enough for three dimensions, and whole vector registers in both precisions.
pub(crate) const LANES: usize = 8;

/// Numbers in half of a node.
const HALF: usize = LANES / 2;

/// Components of vectors: those that vanish on a wall, and change their signs in its mirror image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Components(u8);

impl Components {
    /// None of them.
    pub(crate) const NONE: Self = Self(0);
    /// All of them.
    pub(crate) const ALL: Self = Self(u8::MAX);

    /// The one along an axis.
    pub(crate) const fn along(axis: usize) -> Self {
        Self(1 << axis)
    }

    /// These and others.
    pub(crate) const fn with(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// These and others, without those that are in both.
    pub(crate) fn toggled(self, others: Self) -> Self {
        Self(self.0 ^ others.0)
    }

    /// The axes of these components, of `D` dimensions.
    #[inline(always)]
    pub(crate) fn each<const D: usize>(self) -> impl Iterator<Item = usize> {
        (0..D).filter(move |a| self.0 >> a & 1 == 1)
    }
}

/// Values at a node, 2 D + 2 numbers and padding, so that they go through vector instructions together: in space in the order `[velocity,
/// mass, acceleration, scalar]`, of which registers of 256 bits hold a half each, so that work for one half alone costs half; else in the
/// order `[velocity, acceleration, mass, scalar, zeros]`, of which such a register holds both vectors. P2G sums momentum in place of velocity and force in place of acceleration; the grid update
/// divides by the mass. Where a change of volume follows the grid, the scalar is that of [`VolumeRates`](crate::grid::volume_rates::VolumeRates), else
/// zero.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node<T, const D: usize> {
    pub(crate) values: [T; LANES],
}

impl<T, const D: usize> Node<T, D> {
    /// Place of the first component of the second vector, the acceleration.
    pub(crate) const SECOND: usize = if D == 3 { HALF } else { D };
    /// Place of the mass.
    pub(crate) const MASS: usize = if D == 3 { D } else { 2 * D };
    /// Place of the scalar, the last number.
    pub(crate) const SCALAR: usize = 2 * D + 1;
}

impl<T: RealField + Copy, const D: usize> Node<T, D> {
    pub(crate) fn zero() -> Self {
        Self { values: [T::zero(); LANES] }
    }

    #[inline(always)]
    pub(crate) fn new(velocity: &SVector<T, D>, acceleration: &SVector<T, D>, mass: T) -> Self {
        const { assert!(2 * D + 1 < LANES) };
        let mut values = [T::zero(); LANES];
        for a in 0..D {
            values[a] = velocity[a];
            values[Self::SECOND + a] = acceleration[a];
        }
        values[Self::MASS] = mass;
        Self { values }
    }

    #[inline(always)]
    pub(crate) fn is_zero(&self) -> bool {
        self.values == Self::zero().values
    }

    #[inline(always)]
    pub(crate) fn mass(&self) -> T {
        self.values[Self::MASS]
    }

    #[inline(always)]
    pub(crate) fn scalar(&self) -> T {
        self.values[Self::SCALAR]
    }

    #[inline(always)]
    pub(crate) fn scalar_mut(&mut self) -> &mut T {
        &mut self.values[Self::SCALAR]
    }

    /// Clears components of velocity and acceleration.
    #[inline(always)]
    pub(crate) fn clear(&mut self, components: Components) {
        for a in components.each::<D>() {
            self.values[a] = T::zero();
            self.values[Self::SECOND + a] = T::zero();
        }
    }

    /// The node, with the signs of components of velocity and acceleration changed.
    #[inline(always)]
    pub(crate) fn flipped(mut self, components: Components) -> Self {
        for a in components.each::<D>() {
            self.values[a] = -self.values[a];
            self.values[Self::SECOND + a] = -self.values[Self::SECOND + a];
        }
        self
    }

    /// The acceleration.
    #[inline(always)]
    pub(crate) fn second(&self) -> SVector<T, D> {
        SVector::from_fn(|a, _| self.values[Self::SECOND + a])
    }

    /// Its components, to be changed.
    #[inline(always)]
    pub(crate) fn second_mut(&mut self) -> &mut [T] {
        &mut self.values[Self::SECOND..][..D]
    }

    /// Adds the acceleration and the scalar alone.
    pub(crate) fn add_acceleration(&mut self, other: &Self) {
        for a in 0..D {
            self.values[Self::SECOND + a] += other.values[Self::SECOND + a];
        }
        *self.scalar_mut() += other.scalar();
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        for q in 0..LANES {
            self.values[q] += other.values[q];
        }
    }
}
