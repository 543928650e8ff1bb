//! Constitutive laws, written by hand: they share no source with any derivation of exact solutions.
//!
//! To add a law of the library: a file with an `impl LibraryLaw`, a line in `with_law`, and a row in the crate `mmsmith-vocabulary`.
//! A caller's own law is a [`ConstitutiveLaw`].
//!
//! All are hyperelastic but for [`Material::LinearElastic`], whose stress ignores how the body turns. Stresses are formed
//! from H = F - I, so that small strains keep their digits.

mod arruda_boyce;
#[doc(hidden)]
pub mod fault;
mod gent;
mod half_plane;
mod hencky;
mod holzapfel_gasser_ogden;
mod isochoric;
mod law;
mod linear_elastic;
mod memory;
mod mooney_rivlin;
mod neo_hookean;
mod ogden;
mod orthotropic;
mod plastic;
mod principal;
#[cfg(test)]
mod printed_energies;
mod projected;
mod slopes;
mod st_venant_kirchhoff;
mod tangent;
#[cfg(test)]
mod tests;
mod viscoelastic;
mod volumetric;
mod yeoh;

use mmsmith_scalar_functions::logarithm::{is_near_one, ln_near_one, ln_of_both_in_range};
use nalgebra::{Matrix3, RealField, SMatrix};

pub use half_plane::{HalfPlane, Hoop, of_half_plane, with_hoop_stretch};
#[doc(hidden)]
pub use law::BlockOfStresses;
pub use law::{ConstitutiveLaw, Law, LawCheck};
#[doc(hidden)]
pub use memory::BlockWithMemory;
pub use memory::{Increment, InternalVariable, LawInSpace, LawWithMemory};
pub use mmsmith_vocabulary::{Element, Flow, Material, Memory, Overstress, Volumetric, WithMemory};
#[doc(hidden)]
pub use neo_hookean::{NeoHookean, NeoHookeanNoLog};
pub use plastic::{Plastic, ReturnMap};
pub use projected::{ProjectedVolume, Volume, projected_stress, volume_root};
pub use tangent::{Differentiated, Tangent};

use crate::fault::Planted;
use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::{det_minus_one, determinant, product, real};

/// Evaluates `$body` with `$law` bound to the law of a material, whichever it is.
macro_rules! with_law {
    ($material:expr, |$law:ident| $body:expr) => {
        match *$material {
            Material::NeoHookean { lambda, mu } => {
                let $law = NeoHookean { lambda, mu, planted: Planted::here() };
                $body
            }
            Material::StVenantKirchhoff { lambda, mu } => {
                let $law = st_venant_kirchhoff::StVenantKirchhoff { lambda, mu };
                $body
            }
            Material::Hencky { lambda, mu } => {
                let $law = hencky::Hencky { lambda, mu };
                $body
            }
            Material::MooneyRivlin { c1, c2, lambda } => {
                let $law = mooney_rivlin::MooneyRivlin { c1, c2, lambda };
                $body
            }
            Material::LinearElastic { lambda, mu } => {
                let $law = linear_elastic::LinearElastic { lambda, mu };
                $body
            }
            Material::Yeoh { c1, c2, c3, kappa, volumetric } => {
                let $law = yeoh::Yeoh { c1, c2, c3, kappa, volumetric };
                $body
            }
            Material::Gent { mu, Jm, kappa, volumetric } => {
                let $law = gent::Gent { mu, limit: Jm, kappa, volumetric };
                $body
            }
            Material::ArrudaBoyce { mu, N, kappa, volumetric } => {
                let $law = arruda_boyce::ArrudaBoyce { mu, links: N, kappa, volumetric };
                $body
            }
            Material::Orthotropic { c11, c22, c33, c12, c13, c23, c44, c55, c66 } => {
                let $law = orthotropic::Orthotropic { c11, c22, c33, c12, c13, c23, c44, c55, c66 };
                $body
            }
            Material::Ogden { mu1, alpha1, mu2, alpha2, mu3, alpha3, kappa, volumetric } => {
                let $law =
                    ogden::Ogden { mu1, alpha1, mu2, alpha2, mu3, alpha3, kappa, volumetric };
                $body
            }
            Material::HolzapfelGasserOgden { mu, k1, k2, angle, kappa, volumetric } => {
                let $law = holzapfel_gasser_ogden::HolzapfelGasserOgden {
                    mu,
                    k1,
                    k2,
                    angle,
                    kappa,
                    volumetric,
                };
                $body
            }
        }
    };
}

/// The law of an elastic law of the library with memory, with the return map that flow takes; `None` where that elastic law has no memory
/// of this kind: flow is of Hencky's law, elements are of isochoric laws and of linear elasticity.
#[must_use]
pub fn with_memory<T: Stressed<D>, const D: usize>(
    law: WithMemory<T>,
    map: ReturnMap,
) -> Option<Law<T, D>> {
    T::with_memory(law, map)
}

fn memory_of_library<T: Stressed<D> + Stressed<3>, const D: usize>(
    law: WithMemory<T>,
    map: ReturnMap,
) -> Option<Law<T, D>> {
    match (law.memory, law.elastic) {
        (Memory::Flow(flow), Material::Hencky { lambda, mu }) => {
            let [lambda, mu] = [lambda, mu].map(nalgebra::convert_unchecked::<T, f64>);
            let flow = flow.map(nalgebra::convert_unchecked::<T, f64>);
            Some(Law::with_memory(Plastic::new(lambda, mu, flow, map)))
        }
        (Memory::Flow(_), _) => None,
        (Memory::Maxwell(elements), elastic) => {
            viscoelastic::Viscoelastic::new(elastic, elements).map(Law::with_memory)
        }
    }
}

/// Particles in a block: as many as keep all of it in the first-level cache.
pub const BLOCK: usize = 64;

/// Particles whose stresses are computed side by side.
pub const SIDE_BY_SIDE: usize = 16;

/// Numbers whose stresses are compiled with this crate: `f64` and `f32`; see [`Law`].
pub trait Stressed<const D: usize>: Lanes {
    /// [`Law::kirchhoff`].
    #[doc(hidden)]
    fn kirchhoff(material: &Material<Self>, F: &SMatrix<Self, D, D>)
    -> Option<SMatrix<Self, D, D>>;

    /// [`Law::first_piola_kirchhoff`].
    #[doc(hidden)]
    fn first_piola_kirchhoff(
        material: &Material<Self>,
        F: &SMatrix<Self, D, D>,
    ) -> Option<SMatrix<Self, D, D>>;

    /// [`Law::first_piola_kirchhoff_side_by_side`].
    #[doc(hidden)]
    fn first_piola_kirchhoff_side_by_side(
        material: &Material<Self>,
        F: &[[[Self; SIDE_BY_SIDE]; D]; D],
        P: &mut [[[Self; SIDE_BY_SIDE]; D]; D],
    );

    /// Kirchhoff stress in three dimensions, with unit stretch along the axes that F leaves out.
    #[doc(hidden)]
    fn kirchhoff_in_space(material: &Material<Self>, F: &SMatrix<Self, D, D>) -> Matrix3<Self>;

    /// [`Law::strain_energy`].
    #[doc(hidden)]
    fn strain_energy(material: &Material<Self>, F: &SMatrix<Self, D, D>) -> Option<Self>;

    /// [`with_memory`].
    #[doc(hidden)]
    fn with_memory(law: WithMemory<Self>, map: ReturnMap) -> Option<Law<Self, D>>;

    /// [`with_projected_volume`].
    #[doc(hidden)]
    fn with_projected_volume(law: Law<Self, D>) -> Option<Law<Self, D>>;
}

/// A law with its change of volume projected, see [`ProjectedVolume`]; none of a law that has internal variables of its own.
pub fn with_projected_volume<T: Stressed<D>, const D: usize>(law: Law<T, D>) -> Option<Law<T, D>> {
    T::with_projected_volume(law)
}

/// The law as stresses are formed of it: another with a planted fault alone.
#[inline(always)]
fn in_stresses<T: RealField + Copy>(material: &Material<T>) -> Material<T> {
    Planted::here().law_in_stresses(*material)
}

macro_rules! stressed {
    ($($T:ty: $($D:literal)*;)*) => {
        $($(impl Stressed<$D> for $T {
            fn kirchhoff(
                material: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Option<SMatrix<Self, $D, $D>> {
                jacobian(F)?;
                Some(with_law!(&in_stresses(material), |law| law.kirchhoff(F)))
            }

            fn first_piola_kirchhoff(
                material: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Option<SMatrix<Self, $D, $D>> {
                jacobian(F)?;
                Some(with_law!(&in_stresses(material), |law| law.first_piola_kirchhoff(F)))
            }

            fn first_piola_kirchhoff_side_by_side(
                material: &Material<Self>,
                F: &[[[Self; SIDE_BY_SIDE]; $D]; $D],
                P: &mut [[[Self; SIDE_BY_SIDE]; $D]; $D],
            ) {
                with_law!(&in_stresses(material), |law| dispatch(SideBySide { law, F, P }));
            }

            fn kirchhoff_in_space(
                material: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Matrix3<Self> {
                let mut in_space = Matrix3::identity();
                in_space.fixed_view_mut::<$D, $D>(0, 0).copy_from(F);
                with_law!(&in_stresses(material), |law| law.kirchhoff(&in_space))
            }

            fn strain_energy(
                material: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Option<Self> {
                jacobian(F)?;
                Some(with_law!(material, |law| law.strain_energy(F)))
            }

            fn with_memory(law: WithMemory<Self>, map: ReturnMap) -> Option<Law<Self, $D>> {
                memory_of_library(law, map)
            }

            fn with_projected_volume(law: Law<Self, $D>) -> Option<Law<Self, $D>> {
                ProjectedVolume::new(law).map(Law::with_memory)
            }
        })*)*
    };
}

stressed! {
    f64: 1 2 3;
    f32: 1 2 3;
}

struct SideBySide<'a, T, L, const D: usize> {
    law: L,
    F: &'a [[[T; SIDE_BY_SIDE]; D]; D],
    P: &'a mut [[[T; SIDE_BY_SIDE]; D]; D],
}

impl<T: RealField + Copy, L: LibraryLaw<T>, const D: usize> Loop for SideBySide<'_, T, L, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { law, F, P } = self;
        if !L::HAS_SHORT || !stresses::<true, _, _, D>(law, F, P) {
            stresses::<false, _, _, D>(law, F, P);
        }
    }
}

/// Computes the stresses by the short form of the law or the full one; returns whether the short form holds for all of them. A
/// function of its own tells the compiler that `F` and `P` do not overlap.
#[inline(always)]
fn stresses<const SHORT: bool, T: RealField + Copy, L: LibraryLaw<T>, const D: usize>(
    law: L,
    F: &[[[T; SIDE_BY_SIDE]; D]; D],
    P: &mut [[[T; SIDE_BY_SIDE]; D]; D],
) -> bool {
    let mut short = true;
    for n in 0..SIDE_BY_SIDE {
        let own = SMatrix::<T, D, D>::from_fn(|i, j| F[i][j][n]);
        let J = determinant(&own);
        // Without branches: zero times anything that is not finite is not a number.
        let zero = own.fold(J * T::zero(), |sum, entry| sum + entry * T::zero());
        let is_deformation = (J > T::zero()) & (zero == T::zero());
        // Laws are defined for deformations alone.
        let own = SMatrix::<T, D, D>::from_fn(|i, j| match is_deformation {
            true => own[(i, j)],
            false if i == j => T::one(),
            false => T::zero(),
        });
        short &= law.is_short(&own);
        let stress = match SHORT {
            true => law.first_piola_kirchhoff_short(&own),
            false => law.first_piola_kirchhoff(&own),
        };
        for i in 0..D {
            for j in 0..D {
                P[i][j][n] = if is_deformation { stress[(i, j)] } else { real(f64::NAN) };
            }
        }
    }
    short
}

/// J, if F is a deformation.
#[inline(always)]
fn jacobian<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> Option<T> {
    let J = determinant(F);
    (J > T::zero() && J.is_finite() && F.iter().all(|entry| entry.is_finite())).then_some(J)
}

/// A law of the library, for deformation gradients with J > 0; the caller checks this.
#[doc(hidden)]
pub trait LibraryLaw<T: RealField + Copy>: Copy + Send + Sync + 'static {
    /// Kirchhoff stress.
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;

    /// Whether there is a shorter form for some F; a law without one needs no loops of its own for it.
    const HAS_SHORT: bool = false;

    /// Whether [`kirchhoff_short`](Self::kirchhoff_short) and
    /// [`first_piola_kirchhoff_short`](Self::first_piola_kirchhoff_short) are right for this F.
    #[inline(always)]
    fn is_short<const D: usize>(&self, _F: &SMatrix<T, D, D>) -> bool {
        true
    }

    /// [`kirchhoff`](Self::kirchhoff) with the same bits in fewer operations, where it [is short](Self::is_short).
    #[inline(always)]
    fn kirchhoff_short<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        self.kirchhoff(F)
    }

    /// Kirchhoff stress in a half plane and around the axis, where the stretch is `hoop`, and whether the short form was right, which is
    /// asked for by `SHORT`. Default: by the law of space.
    #[inline(always)]
    fn kirchhoff_with_hoop<const SHORT: bool, const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
        hoop: T,
    ) -> (SMatrix<T, D, D>, T, bool) {
        let in_space = with_hoop_stretch(F, hoop);
        let is_short = self.is_short(&in_space);
        let tau = if SHORT { self.kirchhoff_short(&in_space) } else { self.kirchhoff(&in_space) };
        (SMatrix::from_fn(|i, j| tau[(i, j)]), tau[(2, 2)], is_short)
    }

    /// First Piola-Kirchhoff stress.
    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;

    /// [`first_piola_kirchhoff`](Self::first_piola_kirchhoff) with the same bits in fewer operations, where it [is short](Self::is_short).
    #[inline(always)]
    fn first_piola_kirchhoff_short<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        self.first_piola_kirchhoff(F)
    }

    /// Strain energy per reference volume, zero where F is the identity.
    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T;
}

/// Any law, looked up at every call: one instance of the kernels serves all laws without an instance of their own.
#[derive(Clone, Copy)]
#[doc(hidden)]
pub struct AnyLaw<T>(pub Material<T>);

impl<T: RealField + Copy> LibraryLaw<T> for AnyLaw<T> {
    #[inline(never)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        with_law!(&self.0, |law| law.kirchhoff(F))
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        with_law!(&self.0, |law| law.first_piola_kirchhoff(F))
    }

    fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        with_law!(&self.0, |law| law.strain_energy(F))
    }
}

/// `lambda/2 (tr strain)^2 + mu strain : strain`.
fn quadratic_energy<T: RealField + Copy, const D: usize>(
    lambda: T,
    mu: T,
    strain: &SMatrix<T, D, D>,
) -> T {
    let trace = strain.trace();
    lambda * trace * trace * real(0.5) + mu * strain.norm_squared()
}

/// `H = F - I`.
#[inline(always)]
fn displacement_gradient<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    F - SMatrix::identity()
}

/// `ln J`, to full relative accuracy at small strain and near inversion.
#[inline(always)]
fn log_jacobian<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> T {
    let growth = det_minus_one(&displacement_gradient(F));
    let logarithm = ln_of_both_in_range(
        nalgebra::convert_unchecked(growth),
        nalgebra::convert_unchecked(determinant(F)),
    );
    if const { slopes::carries_slopes::<T>() } {
        // The derivative of the logarithm is the quotient.
        let J = determinant(F);
        let value = slopes::without_slopes(J);
        return real::<T>(logarithm) + (J - value) / value;
    }
    real(logarithm)
}

/// Whether [`log_jacobian_short`] holds for this F.
#[inline(always)]
fn log_jacobian_is_short<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> bool {
    is_near_one(nalgebra::convert_unchecked(det_minus_one(&displacement_gradient(F))))
}

/// As [`log_jacobian`], to the last bit, for J near one.
#[inline(always)]
fn log_jacobian_short<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> T {
    let growth = det_minus_one(&displacement_gradient(F));
    real(ln_near_one(nalgebra::convert_unchecked(growth)))
}

/// `F F^T - I`, to full relative accuracy at small strain.
#[inline(always)]
fn finger_minus_identity<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    let H = displacement_gradient(F);
    let H_T = H.transpose();
    H + H_T + product(&H, &H_T)
}

/// `F^T F - I`, twice Green's strain, to full relative accuracy at small strain.
#[inline(always)]
fn green_twice<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
    let H = displacement_gradient(F);
    let H_T = H.transpose();
    H + H_T + product(&H_T, &H)
}

/// Adds a multiple of the identity.
#[inline(always)]
fn plus_diagonal<T: RealField + Copy, const D: usize>(
    mut A: SMatrix<T, D, D>,
    value: T,
) -> SMatrix<T, D, D> {
    for i in 0..D {
        A[(i, i)] += value;
    }
    A
}
