//! Constitutive laws, written by hand: they share no source with any derivation of exact solutions.

use nalgebra::{RealField, SMatrix};

use crate::tensor::{det_minus_one, determinant, inverse_transpose, product, real};

/// A hyperelastic material.
///
/// Every function takes the deformation gradient F and returns `None` where it is not a deformation: J <= 0, or an
/// entry that is not finite. In 2D the deformation is plane strain (`F_zz = 1`), in 1D uniaxial strain.
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
}

impl<T: RealField + Copy> Material<T> {
    /// Kirchhoff stress `tau = J sigma`.
    pub fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>> {
        jacobian(F)?;
        let Self::NeoHookean { lambda, mu } = *self;
        Some(NeoHookean { lambda, mu }.kirchhoff(F))
    }

    /// First Piola-Kirchhoff stress `P = tau F^-T`: force per reference area, traction `P N`.
    pub fn first_piola_kirchhoff<const D: usize>(
        &self,
        F: &SMatrix<T, D, D>,
    ) -> Option<SMatrix<T, D, D>> {
        let J = jacobian(F)?;
        let Self::NeoHookean { lambda, mu } = *self;
        let F_inv_T = inverse_transpose(F, J);
        Some(F_inv_T * (lambda * log_jacobian(F)) + (F - F_inv_T) * mu)
    }

    /// Cauchy (true) stress `sigma = tau / J`.
    pub fn cauchy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<SMatrix<T, D, D>> {
        let J = jacobian(F)?;
        Some(self.kirchhoff(F)? / J)
    }

    /// Von Mises stress of the Cauchy stress, with the normal stresses `lambda ln(J) / J` that act out of the plane in
    /// 2D and across the axis in 1D.
    pub fn von_mises<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        let J = jacobian(F)?;
        let Self::NeoHookean { lambda, .. } = *self;
        let across = lambda * log_jacobian(F) / J;
        let sigma = self.cauchy(F)?;
        let normal = |i: usize| if i < D { sigma[(i, i)] } else { across };
        let mut sum = T::zero();
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let difference = normal(i) - normal(j);
            sum += difference * difference * real(0.5);
            if i < D && j < D {
                sum += sigma[(i, j)] * sigma[(i, j)] * real(3.0);
            }
        }
        Some(sum.sqrt())
    }
}

/// J, if F is a deformation.
fn jacobian<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> Option<T> {
    let J = determinant(F);
    (J > T::zero() && J.is_finite() && F.iter().all(|entry| entry.is_finite())).then_some(J)
}

/// `ln J`, to full relative accuracy at small strain.
#[inline(always)]
fn log_jacobian<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> T {
    det_minus_one(&(F - SMatrix::identity())).ln_1p()
}

/// `F F^T - I`, to full relative accuracy at small strain.
#[inline(always)]
fn finger_minus_identity<T: RealField + Copy, const D: usize>(
    F: &SMatrix<T, D, D>,
) -> SMatrix<T, D, D> {
    let H = F - SMatrix::identity();
    let H_T = H.transpose();
    H + H_T + product(&H, &H_T)
}

/// A law as the kernels call it: for deformation gradients whose J > 0 has been seen to already.
pub(crate) trait Law<T: RealField + Copy>: Copy + Send + Sync + 'static {
    /// Kirchhoff stress.
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D>;
}

/// The neo-Hookean law.
#[derive(Clone, Copy)]
pub(crate) struct NeoHookean<T> {
    pub(crate) lambda: T,
    pub(crate) mu: T,
}

impl<T: RealField + Copy> Law<T> for NeoHookean<T> {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        let pressure = self.lambda * log_jacobian(F);
        let mut tau = finger_minus_identity(F) * self.mu;
        for i in 0..D {
            tau[(i, i)] += pressure;
        }
        tau
    }
}

/// The neo-Hookean law with lambda = 0.
#[derive(Clone, Copy)]
pub(crate) struct NeoHookeanNoLog<T> {
    pub(crate) mu: T,
}

impl<T: RealField + Copy> Law<T> for NeoHookeanNoLog<T> {
    #[inline(always)]
    fn kirchhoff<const D: usize>(&self, F: &SMatrix<T, D, D>) -> SMatrix<T, D, D> {
        finger_minus_identity(F) * self.mu
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2, Matrix3, Rotation3};
    use proptest::prelude::*;

    const MATERIAL: Material<f64> = Material::NeoHookean { lambda: 5.77, mu: 3.85 };

    /// Strain energy per reference volume, from which P follows by differentiation.
    fn energy<const D: usize>(F: &SMatrix<f64, D, D>) -> f64 {
        let Material::NeoHookean { lambda, mu } = MATERIAL;
        let log_J = determinant(F).ln();
        0.5 * lambda * log_J * log_J + 0.5 * mu * (F.norm_squared() - D as f64 - 2.0 * log_J)
    }

    fn check_against_energy<const D: usize>(F: &SMatrix<f64, D, D>) {
        let P = MATERIAL.first_piola_kirchhoff(F).unwrap();
        let step = 1e-5;
        for i in 0..D {
            for j in 0..D {
                let (mut plus, mut minus) = (*F, *F);
                plus[(i, j)] += step;
                minus[(i, j)] -= step;
                let slope = (energy(&plus) - energy(&minus)) / (2.0 * step);
                assert!((P[(i, j)] - slope).abs() < 1e-8 * (1.0 + P.norm()), "{P} {slope}");
            }
        }
        let tau = MATERIAL.kirchhoff(F).unwrap();
        assert!((P * F.transpose() - tau).norm() < 1e-13 * (1.0 + tau.norm()));
        let sigma = MATERIAL.cauchy(F).unwrap();
        assert!((sigma * determinant(F) - tau).norm() < 1e-13 * (1.0 + tau.norm()));
    }

    fn deformation() -> impl Strategy<Value = Matrix3<f64>> {
        proptest::array::uniform9(-0.25..0.25_f64)
            .prop_map(|H| Matrix3::identity() + Matrix3::from_row_slice(&H))
    }

    proptest! {
        #[test]
        fn stress_is_the_derivative_of_the_energy(F in deformation()) {
            prop_assume!(F.determinant() > 0.2);
            check_against_energy(&F);
            let F2 = F.fixed_view::<2, 2>(0, 0).into_owned();
            prop_assume!(F2.determinant() > 0.2);
            check_against_energy(&F2);
            check_against_energy(&Matrix1::new(F[(0, 0)]));
        }

        #[test]
        fn a_rotation_rotates_tau(F in deformation(), axis in proptest::array::uniform3(-3.0..3.0_f64)) {
            prop_assume!(F.determinant() > 0.2);
            let Q = Rotation3::new(axis.into()).into_inner();
            let expected = Q * MATERIAL.kirchhoff(&F).unwrap() * Q.transpose();
            let tau = MATERIAL.kirchhoff(&(Q * F)).unwrap();
            prop_assert!((tau - expected).norm() < 1e-12 * (1.0 + expected.norm()));
            let von_mises = MATERIAL.von_mises(&F).unwrap();
            prop_assert!((MATERIAL.von_mises(&(Q * F)).unwrap() - von_mises).abs() < 1e-12);
        }

        #[test]
        fn without_lambda_both_laws_agree(F in deformation()) {
            prop_assume!(F.determinant() > 0.2);
            let general = NeoHookean { lambda: 0.0, mu: 3.85 }.kirchhoff(&F);
            prop_assert_eq!(general, NeoHookeanNoLog { mu: 3.85 }.kirchhoff(&F));
        }

        #[test]
        fn plane_strain_is_the_3d_law_with_unit_stretch_across(F in deformation()) {
            let F2 = F.fixed_view::<2, 2>(0, 0).into_owned();
            prop_assume!(F2.determinant() > 0.2);
            let mut F3 = Matrix3::identity();
            F3.fixed_view_mut::<2, 2>(0, 0).copy_from(&F2);
            let (tau2, tau3) = (MATERIAL.kirchhoff(&F2).unwrap(), MATERIAL.kirchhoff(&F3).unwrap());
            prop_assert!((tau2 - tau3.fixed_view::<2, 2>(0, 0)).norm() < 1e-13);
            let (m2, m3) = (MATERIAL.von_mises(&F2).unwrap(), MATERIAL.von_mises(&F3).unwrap());
            prop_assert!((m2 - m3).abs() < 1e-12);
            let (F1, F3) = (Matrix1::new(F[(0, 0)]), Matrix3::from_diagonal(&[F[(0, 0)], 1.0, 1.0].into()));
            let (m1, m3) = (MATERIAL.von_mises(&F1).unwrap(), MATERIAL.von_mises(&F3).unwrap());
            prop_assert!((m1 - m3).abs() < 1e-12);
        }
    }

    #[test]
    fn small_strains_keep_their_digits() {
        let strain = 2f64.powi(-45);
        let tau = MATERIAL.kirchhoff(&Matrix2::new(1.0 + strain, 0.0, 0.0, 1.0)).unwrap();
        let Material::NeoHookean { lambda, mu } = MATERIAL;
        assert!((tau[(0, 0)] / ((lambda + 2.0 * mu) * strain) - 1.0).abs() < 1e-12);
        assert!((tau[(1, 1)] / (lambda * strain) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_deformation_has_no_stress() {
        for F in [
            Matrix2::new(1.0, 2.0, 1.0, 1.0),
            Matrix2::zeros(),
            Matrix2::new(f64::NAN, 0.0, 0.0, 1.0),
            Matrix2::new(f64::INFINITY, 0.0, 0.0, 1.0),
            Matrix2::new(1.0, f64::NAN, 0.0, 1.0),
        ] {
            assert_eq!(MATERIAL.kirchhoff(&F), None);
            assert_eq!(MATERIAL.first_piola_kirchhoff(&F), None);
            assert_eq!(MATERIAL.cauchy(&F), None);
            assert_eq!(MATERIAL.von_mises(&F), None);
        }
    }
}
