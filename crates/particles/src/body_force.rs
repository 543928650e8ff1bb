//! The body force that a scene applies to its particles.

use nalgebra::{RealField, SMatrix, SVector};

use crate::mesh::Load;

/// Force per unit mass on many particles at once.
pub trait BodyForce<T: Copy, const D: usize>: Sync {
    /// Writes into `b` the body force at the reference positions `X` and time `t`; both slices have the same length.
    /// They belong to the particles `first`, `first + 1` and so on. Values that depend on the reference position alone may be kept from
    /// an earlier step, as long as the [arrangement](crate::Arrangement) is the same.
    ///
    /// Called from several threads, each with its own run of particles. The contents of `b` on entry are unspecified.
    fn evaluate(&self, first: usize, X: &[SVector<T, D>], t: T, b: &mut [SVector<T, D>]);

    /// Precomputes the part that depends on time alone, for [`evaluate_of`](Self::evaluate_of): appended to `values`, which is
    /// empty. Default: nothing.
    fn of_time(&self, _t: T, _values: &mut Vec<T>) {}

    /// Writes into `b` the body force on the particles `ids` at a time; `X` holds the reference positions of all.
    ///
    /// Default: [`evaluate`](Self::evaluate) particle by particle. `b` is as long as `ids`.
    fn evaluate_of(
        &self,
        ids: &[u32],
        X: &[SVector<T, D>],
        time: AtTime<'_, T>,
        b: &mut [SVector<T, D>],
    ) {
        for (&p, b) in ids.iter().zip(b.chunks_mut(1)) {
            let p = p as usize;
            self.evaluate(p, &X[p..=p], time.t, b);
        }
    }

    /// Writes the Cauchy stress at the [loaded points](crate::Mesh::loads) of a body's boundary at time `t`; both slices have the same
    /// length. All are zero before the first call. Default: leaves them as they are.
    fn boundary_stress(&self, _loads: &[Load<T, D>], _t: T, _stress: &mut [SMatrix<T, D, D>]) {}

    /// Whether the force is zero everywhere and always, so that a step may leave it out.
    fn is_absent(&self) -> bool {
        false
    }
}

/// A time, with the values of [`BodyForce::of_time`] at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtTime<'a, T> {
    /// The time.
    pub t: T,
    /// The part of the body force that depends on time alone.
    pub values: &'a [T],
}

impl<T: Copy, const D: usize, B> BodyForce<T, D> for B
where
    B: Fn(&[SVector<T, D>], T, &mut [SVector<T, D>]) + Sync,
{
    fn evaluate(&self, _first: usize, X: &[SVector<T, D>], t: T, b: &mut [SVector<T, D>]) {
        self(X, t, b);
    }
}

/// No body force; the step skips its evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoBodyForce;

impl<T: RealField + Copy, const D: usize> BodyForce<T, D> for NoBodyForce {
    fn evaluate(&self, _first: usize, _X: &[SVector<T, D>], _t: T, b: &mut [SVector<T, D>]) {
        b.fill(SVector::zeros());
    }

    fn is_absent(&self) -> bool {
        true
    }
}
