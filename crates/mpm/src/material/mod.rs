//! Constitutive laws, written by hand: they share no source with any derivation of exact solutions.
//!
//! To add a law: a file with an `impl Law`, a variant of [`Material`], a row in `with_law` and in
//! [`small_strain_moduli`](Material::small_strain_moduli), its energy in `energy.rs`.
//!
//! All are hyperelastic but for [`Material::LinearElastic`], whose stress ignores how the body turns. Stresses are formed
//! from H = F - I, so that small strains keep their digits.

mod energy;
mod hencky;
mod linear_elastic;
mod mooney_rivlin;
mod neo_hookean;
mod st_venant_kirchhoff;
#[cfg(test)]
mod tests;

use mmsmith_scalar_functions::logarithm::{is_near_one, ln_near_one, ln_of_both_in_range};
use nalgebra::{RealField, SMatrix};

pub(crate) use hencky::Hencky;
pub(crate) use linear_elastic::LinearElastic;
pub(crate) use mooney_rivlin::MooneyRivlin;
pub(crate) use neo_hookean::{NeoHookean, NeoHookeanNoLog};
pub(crate) use st_venant_kirchhoff::StVenantKirchhoff;

use crate::fault::Planted;
use crate::simd::{Lanes, Loop, Vectors, dispatch};
use crate::tensor::{det_minus_one, determinant, product, real};

/// An elastic material.
///
/// Every function takes the deformation gradient F and returns `None` where it is not a deformation: J <= 0, or an
/// entry that is not finite. In 2D the deformation is plane strain (`F_zz = 1`), in 1D uniaxial strain.
///
/// Formulas are those of Bonet & Wood, "Nonlinear Continuum Mechanics for Finite Element Analysis", 2nd ed. (2008),
/// chapter 6, and of Ciarlet, "Mathematical Elasticity" I (1988), chapter 4.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Material<T> {
    /// Compressible neo-Hookean solid, `tau = lambda ln(J) I + mu (F F^T - I)`.
    ///
    /// With `lambda == 0` the simulation uses a law that computes no logarithm.
    NeoHookean {
        /// First Lame constant, a stress.
        lambda: T,
        /// Shear modulus, a stress.
        mu: T,
    },
    /// St. Venant-Kirchhoff solid, `P = F S`, `S = lambda tr(E) I + 2 mu E`, `E = (F^T F - I)/2`.
    ///
    /// It softens without limit in compression; for small and moderate strain.
    StVenantKirchhoff {
        /// First Lame constant, a stress.
        lambda: T,
        /// Shear modulus, a stress.
        mu: T,
    },
    /// Hencky's solid, `tau = lambda ln(J) I + 2 mu ln(V)`, `V = sqrt(F F^T)`.
    Hencky {
        /// First Lame constant, a stress.
        lambda: T,
        /// Shear modulus, a stress.
        mu: T,
    },
    /// Compressible Mooney-Rivlin solid,
    /// `W = c1 (I1 - 3 - 2 ln J) + c2 (I2 - 3 - 4 ln J) + lambda/2 (ln J)^2`, with the invariants of the
    /// three-dimensional `C = F^T F`.
    MooneyRivlin {
        /// Factor of the first invariant, a stress.
        c1: T,
        /// Factor of the second invariant, a stress.
        c2: T,
        /// Resistance to changes of volume, a stress; the first Lame constant at small strain is `lambda + 4 c2`.
        lambda: T,
    },
    /// Linear elasticity, `P = lambda tr(H) I + mu (H + H^T)`, `H = F - I`: linear in displacements of any size, and not
    /// invariant under rotation. Its Kirchhoff stress `P F^T` is symmetric to first order only.
    LinearElastic {
        /// First Lame constant, a stress.
        lambda: T,
        /// Shear modulus, a stress.
        mu: T,
    },
}

/// Evaluates `$body` with `$law` bound to the law of a material, whichever it is.
macro_rules! with_law {
    ($material:expr, |$law:ident| $body:expr) => {
        match *$material {
            Material::NeoHookean { lambda, mu } => {
                let $law = NeoHookean { lambda, mu, planted: Planted::here() };
                $body
            }
            Material::StVenantKirchhoff { lambda, mu } => {
                let $law = StVenantKirchhoff { lambda, mu };
                $body
            }
            Material::Hencky { lambda, mu } => {
                let $law = Hencky { lambda, mu };
                $body
            }
            Material::MooneyRivlin { c1, c2, lambda } => {
                let $law = MooneyRivlin { c1, c2, lambda };
                $body
            }
            Material::LinearElastic { lambda, mu } => {
                let $law = LinearElastic { lambda, mu };
                $body
            }
        }
    };
}

/// Particles whose stresses are computed side by side.
pub const SIDE_BY_SIDE: usize = 16;

/// Numbers whose stresses are compiled with this crate: `f64` and `f32`; see [`Material`].
pub trait Stressed<const D: usize>: Lanes {
    /// [`Material::kirchhoff`].
    #[doc(hidden)]
    fn kirchhoff(law: &Material<Self>, F: &SMatrix<Self, D, D>) -> Option<SMatrix<Self, D, D>>;

    /// [`Material::first_piola_kirchhoff`].
    #[doc(hidden)]
    fn first_piola_kirchhoff(
        law: &Material<Self>,
        F: &SMatrix<Self, D, D>,
    ) -> Option<SMatrix<Self, D, D>>;

    /// [`Material::first_piola_kirchhoff_side_by_side`].
    #[doc(hidden)]
    fn first_piola_kirchhoff_side_by_side(
        law: &Material<Self>,
        F: &[[[Self; SIDE_BY_SIDE]; D]; D],
        P: &mut [[[Self; SIDE_BY_SIDE]; D]; D],
    );

    /// [`Material::von_mises`].
    #[doc(hidden)]
    fn von_mises(law: &Material<Self>, F: &SMatrix<Self, D, D>) -> Option<Self>;
}

macro_rules! stressed {
    ($($T:ty: $($D:literal)*;)*) => {
        $($(impl Stressed<$D> for $T {
            fn kirchhoff(
                law: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Option<SMatrix<Self, $D, $D>> {
                law.kirchhoff_here(F)
            }

            fn first_piola_kirchhoff(
                law: &Material<Self>,
                F: &SMatrix<Self, $D, $D>,
            ) -> Option<SMatrix<Self, $D, $D>> {
                law.first_piola_kirchhoff_here(F)
            }

            fn first_piola_kirchhoff_side_by_side(
                law: &Material<Self>,
                F: &[[[Self; SIDE_BY_SIDE]; $D]; $D],
                P: &mut [[[Self; SIDE_BY_SIDE]; $D]; $D],
            ) {
                law.first_piola_kirchhoff_side_by_side_here(F, P);
            }

            fn von_mises(law: &Material<Self>, F: &SMatrix<Self, $D, $D>) -> Option<Self> {
                law.von_mises_here(F)
            }
        })*)*
    };
}

stressed! {
    f64: 1 2 3;
    f32: 1 2 3;
}

impl<T: Copy> Material<T> {
    /// Kirchhoff stress `tau = J sigma = P F^T`.
    pub fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>>
    where
        T: Stressed<D>,
    {
        T::kirchhoff(self, F)
    }

    /// First Piola-Kirchhoff stress `P = tau F^-T`: force per reference area, traction `P N`.
    pub fn first_piola_kirchhoff<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> Option<SMatrix<T, D, D>>
    where
        T: Stressed<D>,
    {
        T::first_piola_kirchhoff(self, F)
    }

    /// First Piola-Kirchhoff stresses of particles side by side: `F[i][J][n]` is `F_iJ` of particle `n`, and so it is with
    /// the stresses `P`. They are those of [`Material::first_piola_kirchhoff`] to the last bit, and not a number where F is no
    /// deformation.
    pub fn first_piola_kirchhoff_side_by_side<const D: usize>(
        &self,
        F: &[[[T; SIDE_BY_SIDE]; D]; D],
        P: &mut [[[T; SIDE_BY_SIDE]; D]; D],
    ) where
        T: Stressed<D>,
    {
        T::first_piola_kirchhoff_side_by_side(self, F, P);
    }

    /// Cauchy (true) stress `sigma = tau / J`.
    pub fn cauchy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>>
    where
        T: Stressed<D>,
    {
        let J = jacobian(F)?;
        Some(self.kirchhoff(F)? / J)
    }

    /// Von Mises stress of the symmetric part of the Cauchy stress, with the normal stresses that act out of the plane
    /// in 2D and across the axis in 1D.
    pub fn von_mises<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T>
    where
        T: Stressed<D>,
    {
        T::von_mises(self, F)
    }
}

/// What the functions of the same names do, compiled where it is called.
impl<T: Lanes> Material<T> {
    pub(crate) fn kirchhoff_here<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> Option<SMatrix<T, D, D>> {
        jacobian(F)?;
        Some(with_law!(self, |law| law.kirchhoff(F)))
    }

    pub(crate) fn first_piola_kirchhoff_here<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> Option<SMatrix<T, D, D>> {
        jacobian(F)?;
        Some(with_law!(self, |law| law.first_piola_kirchhoff(F)))
    }

    pub(crate) fn first_piola_kirchhoff_side_by_side_here<const D: usize>(
        &self,
        F: &[[[T; SIDE_BY_SIDE]; D]; D],
        P: &mut [[[T; SIDE_BY_SIDE]; D]; D],
    ) {
        with_law!(self, |law| dispatch(SideBySide { law, F, P }));
    }

    pub(crate) fn von_mises_here<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        let J = jacobian(F)?;
        let across = with_law!(self, |law| law.kirchhoff_across(F)) / J;
        let sigma = self.kirchhoff_here(F)? / J;
        let normal = |i: usize| if i < D { sigma[(i, i)] } else { across };
        let mut sum = T::zero();
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let difference = normal(i) - normal(j);
            sum += difference * difference * real(0.5);
            if i < D && j < D {
                let shear = (sigma[(i, j)] + sigma[(j, i)]) * real(0.5);
                sum += shear * shear * real(3.0);
            }
        }
        Some(sum.sqrt())
    }
}

impl<T: RealField + Copy> Material<T> {
    /// The Lame constants `(lambda_0, mu_0)` of the law at small strain; the speed of P-waves in the
    /// undeformed solid is `sqrt((lambda_0 + 2 mu_0) / rho0)`.
    pub fn small_strain_moduli(&self) -> (T, T) {
        match *self {
            Self::NeoHookean { lambda, mu }
            | Self::StVenantKirchhoff { lambda, mu }
            | Self::Hencky { lambda, mu }
            | Self::LinearElastic { lambda, mu } => (lambda, mu),
            Self::MooneyRivlin { c1, c2, lambda } => {
                (lambda + c2 * real(4.0), (c1 + c2) * real(2.0))
            }
        }
    }
}

struct SideBySide<'a, T, L, const D: usize> {
    law: L,
    F: &'a [[[T; SIDE_BY_SIDE]; D]; D],
    P: &'a mut [[[T; SIDE_BY_SIDE]; D]; D],
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Loop for SideBySide<'_, T, L, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { law, F, P } = self;
        if !stresses::<true, _, _, D>(law, F, P) {
            stresses::<false, _, _, D>(law, F, P);
        }
    }
}

/// Computes the stresses by the short form of the law or the full one; returns whether the short form holds for all of them. A
/// function of its own tells the compiler that `F` and `P` do not overlap.
#[inline(always)]
fn stresses<const SHORT: bool, T: RealField + Copy, L: Law<T>, const D: usize>(
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
fn jacobian<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> Option<T> {
    let J = determinant(F);
    (J > T::zero() && J.is_finite() && F.iter().all(|entry| entry.is_finite())).then_some(J)
}

/// A law, for deformation gradients with J > 0; the caller checks this.
pub(crate) trait Law<T: RealField + Copy>: Copy + Send + Sync + 'static {
    /// Kirchhoff stress.
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;

    /// Whether [`kirchhoff_short`](Self::kirchhoff_short) and
    /// [`first_piola_kirchhoff_short`](Self::first_piola_kirchhoff_short) are right for this F.
    #[inline(always)]
    fn is_short<const D: usize>(&self, _F: &SMatrix<T, D, D>) -> bool {
        true
    }

    /// The same Kirchhoff stress, to the last bit, in fewer operations, where those [do](Self::is_short).
    #[inline(always)]
    fn kirchhoff_short<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        self.kirchhoff(F)
    }

    /// The normal Kirchhoff stress along the axes that F leaves out, where the stretch is one.
    fn kirchhoff_across<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T;

    /// First Piola-Kirchhoff stress.
    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;

    /// The same first Piola-Kirchhoff stress, to the last bit, in fewer operations, where those [do](Self::is_short).
    #[inline(always)]
    fn first_piola_kirchhoff_short<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        self.first_piola_kirchhoff(F)
    }
}

/// Any law, looked up at every call: one instance of the kernels serves all laws without an instance of their own.
#[derive(Clone, Copy)]
pub(crate) struct AnyLaw<T>(pub(crate) Material<T>);

impl<T: RealField + Copy> Law<T> for AnyLaw<T> {
    #[inline(never)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        with_law!(&self.0, |law| law.kirchhoff(F))
    }

    fn kirchhoff_across<const D: usize>(&self, F: &SMatrix<T, D, D>) -> T {
        with_law!(&self.0, |law| law.kirchhoff_across(F))
    }

    fn first_piola_kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        with_law!(&self.0, |law| law.first_piola_kirchhoff(F))
    }
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
