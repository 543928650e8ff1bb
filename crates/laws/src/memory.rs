//! Laws with memory: the stress depends on internal variables, which follow the deformation in time.

use std::fmt;

use nalgebra::SMatrix;

use crate::{BLOCK, ConstitutiveLaw, jacobian};
use mmsmith_lanes::tensor::real;
use nalgebra::RealField;

/// An internal variable of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct InternalVariable {
    /// Its name, in files and tables.
    pub name: String,
    /// Its value in a body at rest.
    pub at_rest: f64,
}

/// The deformation gradients of particles at the ends of a span of time, side by side: `F[i][J][n]` is `F_iJ` of particle `n`.
#[derive(Debug)]
pub struct Increment<'a, T, const D: usize> {
    /// At the start.
    pub start: &'a [[[T; BLOCK]; D]; D],
    /// At the end.
    pub end: &'a [[[T; BLOCK]; D]; D],
    /// The time between them.
    pub time: T,
}

/// A law with internal variables, for particles in blocks.
///
/// The stress is a function of the deformation gradient and of the internal variables as they are: solvers ask for it as often as they
/// like. The variables change in [`evolve`](Self::evolve) alone, which is called once for each increment of the deformation gradient.
/// Variables are side by side as well: `q[k][n]` is variable `k` of particle `n`.
pub trait LawWithMemory<T, const D: usize>: fmt::Debug + Send + Sync {
    /// The internal variables of a particle, in their order; at least one.
    fn variables(&self) -> Vec<InternalVariable>;

    /// First Piola-Kirchhoff stresses.
    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    );

    /// Advances the internal variables by an increment.
    fn evolve(&self, increment: &Increment<'_, T, D>, q: &mut [[T; BLOCK]]);
}

/// A law with memory whose variables stay at rest: its response to sudden changes, by which waves run.
#[derive(Debug)]
pub(crate) struct AtRest<'a, T, const D: usize>(pub(crate) &'a dyn LawWithMemory<T, D>);

impl<T: RealField + Copy, const D: usize> ConstitutiveLaw<T, D> for AtRest<'_, T, D> {
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]) {
        let at_rest = self.0.variables();
        let q: Vec<[T; BLOCK]> = at_rest.iter().map(|q| [real(q.at_rest); BLOCK]).collect();
        self.0.first_piola_kirchhoff(F, &q, P);
    }
}

/// Deformation gradients of a block of particles and their internal variables, side by side.
pub struct BlockWithMemory<T, const D: usize> {
    F: [[[T; BLOCK]; D]; D],
    end: [[[T; BLOCK]; D]; D],
    P: [[[T; BLOCK]; D]; D],
    q: Vec<[T; BLOCK]>,
}

impl<T: RealField + Copy, const D: usize> BlockWithMemory<T, D> {
    /// Particles of a law with these variables, at rest.
    #[must_use]
    pub fn at_rest(variables: &[InternalVariable]) -> Self {
        let of = |value: T| [value; BLOCK];
        let identity = std::array::from_fn(|i| {
            std::array::from_fn(|j| of(if i == j { T::one() } else { T::zero() }))
        });
        let q = variables.iter().map(|variable| of(real(variable.at_rest))).collect();
        Self { F: identity, end: identity, P: [[of(T::zero()); D]; D], q }
    }

    /// Takes the internal variables of particles, those of a particle one after the other.
    fn take(&mut self, q: &[T]) {
        let count = self.q.len();
        for (n, own) in q.chunks_exact(count).enumerate() {
            for (column, &value) in self.q.iter_mut().zip(own) {
                column[n] = value;
            }
        }
    }

    /// The stresses of particles, and whether their F is a deformation; not a number where it is none.
    pub fn stresses(
        &mut self,
        law: &dyn LawWithMemory<T, D>,
        F: &[SMatrix<T, D, D>],
        q: &[T],
    ) -> impl Fn(usize) -> SMatrix<T, D, D> {
        self.take(q);
        let mut is_deformation = [true; BLOCK];
        for (n, F) in F.iter().enumerate() {
            is_deformation[n] = set(&mut self.F, n, F);
        }
        law.first_piola_kirchhoff(&self.F, &self.q, &mut self.P);
        let P = &self.P;
        move |n| match is_deformation[n] {
            true => SMatrix::from_fn(|i, j| P[i][j][n]),
            false => SMatrix::repeat(real(f64::NAN)),
        }
    }

    /// Advances the internal variables of particles. Those of a particle whose F is no deformation stay.
    pub fn evolve(
        &mut self,
        law: &dyn LawWithMemory<T, D>,
        start: &[SMatrix<T, D, D>],
        end: &[SMatrix<T, D, D>],
        time: T,
        q: &mut [T],
    ) {
        self.take(q);
        let mut is_deformation = [true; BLOCK];
        for (n, (start, end)) in start.iter().zip(end).enumerate() {
            let (is_start, is_end) = (set(&mut self.F, n, start), set(&mut self.end, n, end));
            is_deformation[n] = is_start && is_end;
        }
        law.evolve(&Increment { start: &self.F, end: &self.end, time }, &mut self.q);
        let count = self.q.len();
        for (n, own) in q.chunks_exact_mut(count).enumerate().filter(|(n, _)| is_deformation[*n]) {
            for (value, column) in own.iter_mut().zip(&self.q) {
                *value = column[n];
            }
        }
    }
}

/// Sets the deformation gradient of particle `n`; at rest where it is none, as laws are asked for deformations alone. Whether it is one.
#[inline(always)]
pub(crate) fn set<T: RealField + Copy, const D: usize>(
    all: &mut [[[T; BLOCK]; D]; D],
    n: usize,
    F: &SMatrix<T, D, D>,
) -> bool {
    let is_deformation = jacobian(F).is_some();
    for i in 0..D {
        for j in 0..D {
            let rest = if i == j { T::one() } else { T::zero() };
            all[i][j][n] = if is_deformation { F[(i, j)] } else { rest };
        }
    }
    is_deformation
}
