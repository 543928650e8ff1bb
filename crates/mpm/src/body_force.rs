//! The body force that a scene applies to its particles.

use nalgebra::{RealField, SVector};

/// Force per unit mass on many particles at once.
pub trait BodyForce<T: Copy, const D: usize>: Sync {
    /// Writes into `b` the body force at the reference positions `X` and time `t`; both slices have the same length.
    /// They belong to the particles from number `first` on, which never change places: whatever depends on the position
    /// alone may have been kept from an earlier step.
    ///
    /// Called from several threads, each with its own run of particles; what is in `b` before is unspecified.
    fn evaluate(&self, first: usize, X: &[SVector<T, D>], t: T, b: &mut [SVector<T, D>]);

    /// Adds to `values`, which is empty, what [`evaluate_of`](Self::evaluate_of) needs of the time alone: it is called with it
    /// for a few particles at a time. Nothing, unless there is such.
    fn of_time(&self, _t: T, _values: &mut Vec<T>) {}

    /// Writes into `b` the body force on the particles `ids` at a time; `X` holds the reference positions of all.
    ///
    /// As [`evaluate`](Self::evaluate) particle by particle, unless there is a faster way; `b` is as long as `ids`.
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

    /// Whether the force is zero everywhere and always, so that a step may leave it out.
    fn is_absent(&self) -> bool {
        false
    }
}

/// A time, with what [`BodyForce::of_time`] says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtTime<'a, T> {
    /// The time.
    pub t: T,
    /// What the body force needs of it.
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

/// No body force: the step does no work for it.
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
