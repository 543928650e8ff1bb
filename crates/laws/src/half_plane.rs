//! The law of a body of revolution in its half plane, radius and height: the stretch around the axis is an internal variable.
//!
//! ```text
//! F = | dr/dR  dr/dZ  0   |
//!     | dz/dR  dz/dZ  0   |     hoop stretch r/R, hoop stress tau_hoop = P_hoop r/R
//!     | 0      0      r/R |
//! ```
//!
//! Source: Nairn & Guilkey, "Axisymmetric form of the generalized interpolation material point method", IJNME 101 (2015) 127-147.

use mmsmith_lanes::tensor::{determinant, inverse_transpose, product};
use mmsmith_vocabulary::Material;
use nalgebra::{Matrix3, RealField, SMatrix, SVector};

use crate::memory::{
    Increment, InternalVariable, LawInSpace, LawWithMemory, of_particle, set, set_stress,
};
use crate::{BLOCK, Law, Stressed};

/// An isotropic law of space in a half plane. Its internal variables are the stretch around the axis, which solvers set to the
/// radius over the reference radius, and the reference radius; then those of the law of space, whose directions 1, 2, 3 are those of the
/// radius, around the axis, and of the height.
#[derive(Clone, Debug)]
pub struct HalfPlane<T> {
    law: Law<T, 3>,
    in_space: LawInSpace<T>,
}

/// The internal variables of a particle in a half plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hoop<T> {
    /// The radius over the reference radius.
    pub stretch: T,
    /// The reference radius.
    pub reference_radius: T,
}

impl<T: RealField + Copy> Hoop<T> {
    /// How many internal variables these are.
    pub const COUNT: usize = 2;

    /// The internal variables of a particle at rest.
    #[must_use]
    pub fn at_rest<const D: usize>(X: &SVector<T, D>) -> [T; 2] {
        [T::one(), X[0]]
    }

    /// Sets the stretch in the internal variables of a particle at a position.
    #[inline(always)]
    pub fn follow<const D: usize>(x: &SVector<T, D>, q: &mut [T]) {
        let R = Self::of(q).reference_radius;
        if let Some(stretch) = q.first_mut() {
            *stretch = x[0] / R;
        }
    }

    /// From the internal variables of a particle; at rest at radius one where there are too few.
    #[inline(always)]
    #[must_use]
    pub fn of(q: &[T]) -> Self {
        match *q {
            [stretch, reference_radius, ..] => Self { stretch, reference_radius },
            _ => Self { stretch: T::one(), reference_radius: T::one() },
        }
    }

    /// The internal variables at time zero of a particle with this reference position: these, and after them those of a law of space with memory.
    #[must_use]
    pub fn at_rest_with<const D: usize>(
        law: &dyn LawWithMemory<T, 3>,
        X: &SVector<T, D>,
    ) -> Vec<T> {
        let in_space = SVector::from([X[0], T::zero(), X[1 % D]]);
        Self::at_rest(X).into_iter().chain(law.initial(&in_space)).collect()
    }

    /// The radius.
    #[inline(always)]
    #[must_use]
    pub fn radius(&self) -> T {
        self.stretch * self.reference_radius
    }
}

/// The deformation gradient in space: that in the half plane, the stretch around the axis, and one along what is left.
#[inline(always)]
#[must_use]
pub fn with_hoop_stretch<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    stretch: T,
) -> Matrix3<T> {
    Matrix3::from_fn(|i, j| match i < D && j < D {
        true => F[(i, j)],
        false if i == j && i == D => stretch,
        false if i == j => T::one(),
        false => T::zero(),
    })
}

/// The deformation gradient in space in the order of the radius, around the axis, and the height, from that in the half plane.
#[inline(always)]
#[must_use]
pub fn of_half_plane<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
    stretch: T,
) -> Matrix3<T> {
    Matrix3::from_fn(|i, j| match (i, j) {
        (1, 1) => stretch,
        (1, _) | (_, 1) => T::zero(),
        _ => F[((i / 2) % D, (j / 2) % D)],
    })
}

impl<T: Stressed<3>> HalfPlane<T> {
    /// The law of space in the half plane; none of a law with directions.
    #[must_use]
    pub fn new(law: Law<T, 3>) -> Option<Self> {
        let in_space = match &law {
            Law::Library(material) if material.row().is_isotropic => LawInSpace::Library(*material),
            Law::Own(own) => LawInSpace::Own(own.clone()),
            Law::WithMemory(own) => LawInSpace::WithMemory(own.clone()),
            Law::Library(_) => return None,
        };
        Some(Self { law, in_space })
    }

    /// The first Piola-Kirchhoff stresses in space of a law with memory, whose directions are the radius, around the axis, and the height.
    fn stresses_with_memory<const D: usize>(
        law: &dyn LawWithMemory<T, 3>,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
    ) -> [[[T; BLOCK]; 3]; 3] {
        let mut in_space = [[[T::zero(); BLOCK]; 3]; 3];
        for n in 0..BLOCK {
            let stretch = q.first().map_or_else(T::one, |stretch| stretch[n]);
            set(&mut in_space, n, &of_half_plane(&of_particle(F, n), stretch));
        }
        let mut P = [[[T::zero(); BLOCK]; 3]; 3];
        let own = q.get(Hoop::<T>::COUNT..).unwrap_or_default();
        law.first_piola_kirchhoff(&in_space, own, &mut P);
        P
    }
}

impl<T: Stressed<3>, const D: usize> LawWithMemory<T, D> for HalfPlane<T> {
    fn variables(&self) -> Vec<InternalVariable> {
        let of = |name: &str| InternalVariable { name: name.into(), at_rest: 1.0 };
        let mut all = vec![of("hoop_stretch"), of("(reference radius)")];
        if let LawInSpace::WithMemory(own) = &self.in_space {
            all.extend(own.variables());
        }
        all
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
        if let LawInSpace::WithMemory(own) = &self.in_space {
            let in_space = Self::stresses_with_memory(own.as_ref(), F, q);
            for i in 0..D {
                for j in 0..D {
                    P[i][j] = in_space[(2 * i) % 3][(2 * j) % 3];
                }
            }
            return;
        }
        let Some(stretch) = q.first() else { return };
        for n in 0..BLOCK {
            let F = of_particle(F, n);
            let tau = self.law.kirchhoff(&with_hoop_stretch(&F, stretch[n]));
            let in_plane: SMatrix<T, D, D> = match tau {
                Some(tau) => SMatrix::from_fn(|i, j| tau[(i, j)]),
                None => SMatrix::repeat(mmsmith_lanes::tensor::real(f64::NAN)),
            };
            set_stress(P, n, &product(&in_plane, &inverse_transpose(&F, determinant(&F))));
        }
    }

    fn evolve(&self, _: &Increment<'_, T, D>, _: &mut [[T; BLOCK]]) {}

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        match &self.in_space {
            LawInSpace::WithMemory(own) => Hoop::at_rest_with(own.as_ref(), X),
            LawInSpace::Library(_) | LawInSpace::Own(_) => Hoop::at_rest(X).to_vec(),
        }
    }

    fn start_at_rate_around(&self, rate: &SMatrix<T, D, D>, around: T, q: &mut [T]) {
        if let (LawInSpace::WithMemory(own), Some(q)) =
            (&self.in_space, q.get_mut(Hoop::<T>::COUNT..))
        {
            own.start_at_rate(&of_half_plane(rate, around), q);
        }
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>, q: &[T]) -> Option<T> {
        if let LawInSpace::WithMemory(own) = &self.in_space {
            let F = std::array::from_fn(|i| std::array::from_fn(|j| [F[(i, j)]; BLOCK]));
            let own_q: Vec<[T; BLOCK]> = q.iter().map(|value| [*value; BLOCK]).collect();
            let P = Self::stresses_with_memory::<D>(own.as_ref(), &F, &own_q);
            return Some(P[1][1][0] * Hoop::of(q).stretch);
        }
        let tau = self.law.kirchhoff(&with_hoop_stretch(F, Hoop::of(q).stretch))?;
        Some(tau[(D.min(2), D.min(2))])
    }

    fn stretch_across(&self, q: &[T]) -> Option<T> {
        Some(Hoop::of(q).stretch)
    }

    fn of_half_plane(&self) -> Option<&LawInSpace<T>> {
        Some(&self.in_space)
    }

    fn elastic(&self) -> Option<Material<T>> {
        match &self.in_space {
            LawInSpace::Library(material) => Some(*material),
            LawInSpace::Own(_) => None,
            LawInSpace::WithMemory(own) => own.elastic(),
        }
    }
}
