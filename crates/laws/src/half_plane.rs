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
    ElasticInSpace, Increment, InternalVariable, LawWithMemory, of_particle, set_stress,
};
use crate::{BLOCK, Law, Stressed};

/// An isotropic elastic law of space in a half plane. Its internal variables are the stretch around the axis, which solvers set to the
/// radius over the reference radius, and the reference radius.
#[derive(Clone, Debug)]
pub struct HalfPlane<T> {
    law: Law<T, 3>,
    in_space: ElasticInSpace<T>,
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

impl<T: Stressed<3>> HalfPlane<T> {
    /// The law of space in the half plane; none of a law with directions or with internal variables.
    #[must_use]
    pub fn new(law: Law<T, 3>) -> Option<Self> {
        let in_space = match &law {
            Law::Library(material) if material.row().is_isotropic => {
                ElasticInSpace::Library(*material)
            }
            Law::Own(own) => ElasticInSpace::Own(own.clone()),
            Law::Library(_) | Law::WithMemory(_) => return None,
        };
        Some(Self { law, in_space })
    }
}

impl<T: Stressed<3>, const D: usize> LawWithMemory<T, D> for HalfPlane<T> {
    fn variables(&self) -> Vec<InternalVariable> {
        let of = |name: &str| InternalVariable { name: name.into(), at_rest: 1.0 };
        vec![of("hoop_stretch"), of("(reference radius)")]
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
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
        Hoop::at_rest(X).to_vec()
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>, q: &[T]) -> Option<T> {
        let tau = self.law.kirchhoff(&with_hoop_stretch(F, Hoop::of(q).stretch))?;
        Some(tau[(D.min(2), D.min(2))])
    }

    fn of_half_plane(&self) -> Option<&ElasticInSpace<T>> {
        Some(&self.in_space)
    }

    fn elastic(&self) -> Option<Material<T>> {
        match &self.in_space {
            ElasticInSpace::Library(material) => Some(*material),
            ElasticInSpace::Own(_) => None,
        }
    }
}
