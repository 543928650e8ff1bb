//! Laws with memory: the stress depends on internal variables, which follow the deformation in time.

use std::fmt;
use std::sync::Arc;

use mmsmith_lanes::tensor::{determinant, inverse_transpose, product, real};
use mmsmith_vocabulary::Material;
use nalgebra::{Matrix3, RealField, SMatrix, SVector};

use crate::{BLOCK, ConstitutiveLaw, jacobian};

/// The entries of a symmetric tensor in the order of internal variables.
pub(crate) const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// A law of space, for the half plane of a body of revolution.
#[derive(Clone, Debug)]
pub enum LawInSpace<T> {
    /// A law of the library.
    Library(Material<T>),
    /// A law that the caller brings.
    Own(Arc<dyn ConstitutiveLaw<T, 3>>),
    /// A law with internal variables of its own.
    WithMemory(Arc<dyn LawWithMemory<T, 3>>),
}

/// An internal variable of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct InternalVariable {
    /// Its name, in files and tables; one in parentheses is what the law has to know of its particle, and is not written.
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

    /// The internal variables of a particle at time zero, from its reference position. Default: those at rest.
    fn initial(&self, _X: &SVector<T, D>) -> Vec<T>
    where
        T: RealField + Copy,
    {
        self.variables().iter().map(|variable| real(variable.at_rest)).collect()
    }

    /// Tells a law whose stress depends on the rate of the deformation gradient what that is for a particle at time zero. Default: laws
    /// without rates.
    fn start_at_rate(&self, _rate: &SMatrix<T, D, D>, _q: &mut [T]) {}

    /// As [`start_at_rate`](Self::start_at_rate) in a half plane, where the stretch around the axis has a rate as well. Default: other laws.
    fn start_at_rate_around(&self, _rate: &SMatrix<T, D, D>, _around: T, _q: &mut [T]) {}

    /// Kirchhoff stresses, `tau = P F^T`. Default: from first Piola-Kirchhoff stresses.
    fn kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], q: &[[T; BLOCK]], tau: &mut [[[T; BLOCK]; D]; D])
    where
        T: RealField + Copy,
    {
        self.first_piola_kirchhoff(F, q, tau);
        for n in 0..BLOCK {
            let stress = product(&of_particle(tau, n), &of_particle(F, n).transpose());
            set_stress(tau, n, &stress);
        }
    }

    /// Advances the internal variables by an increment and computes the Kirchhoff stresses at its end, to the bits of
    /// [`evolve`](Self::evolve) and [`kirchhoff`](Self::kirchhoff). Default: by these.
    fn evolve_to_kirchhoff(
        &self,
        increment: &Increment<'_, T, D>,
        q: &mut [[T; BLOCK]],
        tau: &mut [[[T; BLOCK]; D]; D],
    ) where
        T: RealField + Copy,
    {
        self.evolve(increment, q);
        self.kirchhoff(increment.end, q, tau);
    }

    /// Whether the change of volume is projected: solvers set the internal variables then, the projected change of volume and the projected
    /// mean stress. Default: it is not.
    fn is_projected(&self) -> bool {
        false
    }

    /// The caller's own elastic law whose change of volume is projected; a law of the library is [`elastic`](Self::elastic). Default: none.
    fn own_projected_law(&self) -> Option<Arc<dyn ConstitutiveLaw<T, D>>> {
        None
    }

    /// Where changes of volume are projected: writes the stress and the mean stress of each particle at its deformation gradient with the
    /// projected change of volume, as [`ProjectedVolume`](crate::ProjectedVolume) has them.
    fn evaluate_projected(
        &self,
        _F: &[SMatrix<T, D, D>],
        _theta: &[T],
        _scaled: &mut [SMatrix<T, D, D>],
        _mean: &mut [T],
    ) {
    }

    /// The normal Kirchhoff stress of a particle along the axes that F leaves out, where the stretch is one; `None` where it is not known.
    fn kirchhoff_across(&self, _F: &SMatrix<T, D, D>, _q: &[T]) -> Option<T> {
        None
    }

    /// The stretch of a particle along the axes that F leaves out; `None` where nothing stretches along them.
    fn stretch_across(&self, _q: &[T]) -> Option<T> {
        None
    }

    /// The law of space, where this is that of a [half plane](crate::HalfPlane): solvers set the internal variables then, and the stress
    /// around the axis acts on the grid. Default: it is not.
    fn of_half_plane(&self) -> Option<&LawInSpace<T>> {
        None
    }

    /// The elastic law that it responds to sudden changes with, where that is one of the library: waves run by it. Default: unknown.
    fn elastic(&self) -> Option<Material<T>> {
        None
    }
}

/// A tensor of particle `n`.
#[inline(always)]
pub(crate) fn of_particle<T: RealField + Copy, const D: usize>(
    all: &[[[T; BLOCK]; D]; D],
    n: usize,
) -> SMatrix<T, D, D> {
    SMatrix::from_fn(|i, j| all[i][j][n])
}

/// Sets a tensor of particle `n`.
#[inline(always)]
pub(crate) fn set_stress<T: RealField + Copy, const D: usize>(
    all: &mut [[[T; BLOCK]; D]; D],
    n: usize,
    stress: &SMatrix<T, D, D>,
) {
    for i in 0..D {
        for j in 0..D {
            all[i][j][n] = stress[(i, j)];
        }
    }
}

/// Kirchhoff stresses to first Piola-Kirchhoff stresses.
pub(crate) fn pull_back<T: RealField + Copy, const D: usize>(
    F: &[[[T; BLOCK]; D]; D],
    stress: &mut [[[T; BLOCK]; D]; D],
) {
    for n in 0..BLOCK {
        let F = of_particle(F, n);
        let P = product(&of_particle(stress, n), &inverse_transpose(&F, determinant(&F)));
        set_stress(stress, n, &P);
    }
}

/// The deformation gradient of particle `n` in three dimensions, with the identity out of the plane.
pub(crate) fn in_space<T: RealField + Copy, const D: usize>(
    F: &[[[T; BLOCK]; D]; D],
    n: usize,
) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| match i < D && j < D {
        true => nalgebra::convert_unchecked(F[i][j][n]),
        false if i == j => 1.0,
        false => 0.0,
    })
}

/// A law with memory whose variables stay as they are: its response to sudden changes.
#[derive(Clone, Debug)]
pub(crate) struct Frozen<T, const D: usize> {
    law: Arc<dyn LawWithMemory<T, D>>,
    q: Vec<[T; BLOCK]>,
}

impl<T: RealField + Copy, const D: usize> Frozen<T, D> {
    pub(crate) fn new(law: Arc<dyn LawWithMemory<T, D>>, q: &[T]) -> Self {
        Self { law, q: q.iter().map(|&value| [value; BLOCK]).collect() }
    }

    pub(crate) fn at_rest(law: Arc<dyn LawWithMemory<T, D>>) -> Self {
        let at_rest: Vec<T> = law.variables().iter().map(|q| real(q.at_rest)).collect();
        Self::new(law, &at_rest)
    }
}

impl<T: RealField + Copy, const D: usize> ConstitutiveLaw<T, D> for Frozen<T, D> {
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]) {
        self.law.first_piola_kirchhoff(F, &self.q, P);
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        let q: Vec<T> = self.q.iter().map(|column| column[0]).collect();
        self.law.kirchhoff_across(F, &q)
    }

    fn stretch_across(&self, _F: &SMatrix<T, D, D>) -> Option<T> {
        let q: Vec<T> = self.q.iter().map(|column| column[0]).collect();
        self.law.stretch_across(&q)
    }
}

/// Deformation gradients of a block of particles and their internal variables, side by side.
pub struct BlockWithMemory<T, const D: usize> {
    F: [[[T; BLOCK]; D]; D],
    end: [[[T; BLOCK]; D]; D],
    stress: [[[T; BLOCK]; D]; D],
    is_deformation: [bool; BLOCK],
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
        let stress = [[of(T::zero()); D]; D];
        Self { F: identity, end: identity, stress, is_deformation: [true; BLOCK], q }
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

    /// Computes the Kirchhoff stresses of particles.
    pub fn kirchhoff(&mut self, law: &dyn LawWithMemory<T, D>, F: &[SMatrix<T, D, D>], q: &[T]) {
        self.set(F, q);
        law.kirchhoff(&self.F, &self.q, &mut self.stress);
    }

    /// Computes the first Piola-Kirchhoff stresses of particles.
    pub fn first_piola_kirchhoff(
        &mut self,
        law: &dyn LawWithMemory<T, D>,
        F: &[SMatrix<T, D, D>],
        q: &[T],
    ) {
        self.set(F, q);
        law.first_piola_kirchhoff(&self.F, &self.q, &mut self.stress);
    }

    fn set(&mut self, F: &[SMatrix<T, D, D>], q: &[T]) {
        self.take(q);
        for (n, F) in F.iter().enumerate() {
            self.is_deformation[n] = set(&mut self.F, n, F);
        }
    }

    /// The stress of a particle that was computed last; not a number where F is no deformation.
    #[inline(always)]
    #[must_use]
    pub fn stress(&self, n: usize) -> SMatrix<T, D, D> {
        match self.is_deformation[n] {
            true => of_particle(&self.stress, n),
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
        self.set_increment(start, end, q);
        law.evolve(&Increment { start: &self.F, end: &self.end, time }, &mut self.q);
        self.give(q);
    }

    /// As [`evolve`](Self::evolve), with the Kirchhoff stresses at the end.
    pub fn evolve_to_kirchhoff(
        &mut self,
        law: &dyn LawWithMemory<T, D>,
        start: &[SMatrix<T, D, D>],
        end: &[SMatrix<T, D, D>],
        time: T,
        q: &mut [T],
    ) {
        self.set_increment(start, end, q);
        let increment = Increment { start: &self.F, end: &self.end, time };
        law.evolve_to_kirchhoff(&increment, &mut self.q, &mut self.stress);
        self.give(q);
    }

    fn set_increment(&mut self, start: &[SMatrix<T, D, D>], end: &[SMatrix<T, D, D>], q: &[T]) {
        self.take(q);
        for (n, (start, end)) in start.iter().zip(end).enumerate() {
            let (is_start, is_end) = (set(&mut self.F, n, start), set(&mut self.end, n, end));
            self.is_deformation[n] = is_start && is_end;
        }
    }

    /// Gives the internal variables of deformations back.
    fn give(&self, q: &mut [T]) {
        let count = self.q.len();
        let own = q.chunks_exact_mut(count).zip(self.is_deformation).enumerate();
        for (n, (own, _)) in own.filter(|(_, (_, is_deformation))| *is_deformation) {
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
