use super::*;
use crate::BLOCK;
use nalgebra::{Matrix1, Matrix2, Matrix3, Rotation3};
use proptest::prelude::*;
use std::array;

const LAWS: [Material<f64>; 6] = [
    Material::NeoHookean { lambda: 5.77, mu: 3.85 },
    Material::NeoHookean { lambda: 0.0, mu: 3.85 },
    Material::StVenantKirchhoff { lambda: 5.77, mu: 3.85 },
    Material::Hencky { lambda: 5.77, mu: 3.85 },
    Material::MooneyRivlin { c1: 1.3, c2: 0.625, lambda: 3.27 },
    Material::LinearElastic { lambda: 5.77, mu: 3.85 },
];

/// The deformation in space, with unit stretch along the axes that are left out.
fn in_space<const D: usize>(F: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| if i < D && j < D { F[(i, j)] } else { f64::from(u8::from(i == j)) })
}

/// A deformation in space, as textbooks write energies with it.
struct InSpace {
    F: Matrix3<f64>,
    C: Matrix3<f64>,
    log_J: f64,
    I1: f64,
    I2: f64,
}

impl InSpace {
    fn new(F: Matrix3<f64>) -> Self {
        let C = F.transpose() * F;
        let (I1, I2) = (C.trace(), 0.5 * (C.trace().powi(2) - (C * C).trace()));
        Self { F, C, log_J: F.determinant().ln(), I1, I2 }
    }
}

fn quadratic(lambda: f64, mu: f64, strain: Matrix3<f64>) -> f64 {
    0.5 * lambda * strain.trace().powi(2) + mu * strain.norm_squared()
}

/// Strain energies per reference volume of [`LAWS`] as textbooks print them, from which P follows by differentiation.
const ENERGIES: [fn(&InSpace) -> f64; LAWS.len()] = [
    |F| 0.5 * 5.77 * F.log_J * F.log_J + 0.5 * 3.85 * (F.I1 - 3.0 - 2.0 * F.log_J),
    |F| 0.5 * 3.85 * (F.I1 - 3.0 - 2.0 * F.log_J),
    |F| quadratic(5.77, 3.85, (F.C - Matrix3::identity()) * 0.5),
    |F| {
        let stretches = F.F.singular_values();
        quadratic(5.77, 3.85, Matrix3::from_diagonal(&stretches.map(f64::ln)))
    },
    |F| {
        1.3 * (F.I1 - 3.0 - 2.0 * F.log_J)
            + 0.625 * (F.I2 - 3.0 - 4.0 * F.log_J)
            + 0.5 * 3.27 * F.log_J * F.log_J
    },
    |F| {
        let H = F.F - Matrix3::identity();
        quadratic(5.77, 3.85, (H + H.transpose()) * 0.5)
    },
];

fn check_against_energy<const D: usize>(index: usize, F: &SMatrix<f64, D, D>)
where
    f64: Stressed<D>,
{
    let law = Law::<f64, D>::from(LAWS[index]);
    let energy = |F: &SMatrix<f64, D, D>| ENERGIES[index](&InSpace::new(in_space(F)));
    let P = law.first_piola_kirchhoff(F).unwrap();
    let (stored, printed) = (law.strain_energy(F).unwrap(), energy(F));
    assert!((stored - printed).abs() < 1e-12 * (1.0 + printed), "{law:?} {stored} {printed}");
    let step = 1e-5;
    for i in 0..D {
        for j in 0..D {
            let (mut plus, mut minus) = (*F, *F);
            plus[(i, j)] += step;
            minus[(i, j)] -= step;
            let slope = (energy(&plus) - energy(&minus)) / (2.0 * step);
            assert!((P[(i, j)] - slope).abs() < 1e-7 * (1.0 + P.norm()), "{law:?} {P} {slope}");
        }
    }
    let tau = law.kirchhoff(F).unwrap();
    assert!((P * F.transpose() - tau).norm() < 1e-12 * (1.0 + tau.norm()), "{law:?} {F}");
    let sigma = law.cauchy(F).unwrap();
    assert!((sigma * determinant(F) - tau).norm() < 1e-13 * (1.0 + tau.norm()));
}

fn deformation() -> impl Strategy<Value = Matrix3<f64>> {
    proptest::array::uniform9(-0.25..0.25_f64)
        .prop_map(|H| Matrix3::identity() + Matrix3::from_row_slice(&H))
}

fn check_side_by_side<T: Stressed<D>, const D: usize>(all: &[Matrix3<f64>]) {
    let some: Vec<SMatrix<T, D, D>> =
        all.iter().map(|F| SMatrix::from_fn(|i, j| real(F[(i, j)]))).collect();
    for law in LAWS {
        let law = Law::<T, D>::from(law.map(real));
        for group in some.chunks_exact(SIDE_BY_SIDE) {
            let rows = array::from_fn(|i| array::from_fn(|j| array::from_fn(|n| group[n][(i, j)])));
            let mut P = [[[T::zero(); SIDE_BY_SIDE]; D]; D];
            law.first_piola_kirchhoff_side_by_side(&rows, &mut P);
            for (n, F) in group.iter().enumerate() {
                let found = SMatrix::<T, D, D>::from_fn(|i, j| P[i][j][n]);
                match law.first_piola_kirchhoff(F) {
                    Some(P) => assert_eq!(found, P, "{law:?}, {F}"),
                    None => assert!(
                        found.iter().all(|p| p.partial_cmp(p).is_none()),
                        "{law:?}, {F}, {found}"
                    ),
                }
            }
        }
    }
}

#[test]
fn stresses_side_by_side_are_those_of_single_particles() {
    // Near inversion, next to the identity, flat, inside out, and no numbers at all among ordinary ones.
    // The last ones all next to the identity, where shorter ways are taken.
    let all: Vec<Matrix3<f64>> = (0..80)
        .map(|n| {
            let H = |i: usize, j: usize| {
                (0.618 * f64::from(n) + 0.325 * (3 * i + j) as f64).fract() - 0.5
            };
            let scale = if n < 60 { [0.4, 1e-9, 0.7, 1.5][n as usize % 4] } else { 0.1 };
            let mut F = Matrix3::from_fn(|i, j| f64::from(u8::from(i == j)) + scale * H(i, j));
            match n % 10 {
                _ if n >= 60 => {}
                5 => F.column_mut(0).fill(0.0),
                6 => F[(0, 0)] = f64::INFINITY,
                7 => F[(0, 0)] = f64::NAN,
                8 => F.column_mut(0).scale_mut(1e-7),
                9 => F.column_mut(0).neg_mut(),
                _ => {}
            }
            F
        })
        .collect();
    let inverted = all.iter().filter(|F| jacobian(F).is_none()).count();
    assert!((10..40).contains(&inverted), "{inverted}");
    check_side_by_side::<f64, 1>(&all);
    check_side_by_side::<f64, 2>(&all);
    check_side_by_side::<f64, 3>(&all);
    check_side_by_side::<f32, 2>(&all);
}

proptest! {
    #[test]
    fn stress_is_the_derivative_of_the_energy(F in deformation()) {
        prop_assume!(F.determinant() > 0.2);
        let F2 = F.fixed_view::<2, 2>(0, 0).into_owned();
        prop_assume!(F2.determinant() > 0.2);
        for law in 0..LAWS.len() {
            check_against_energy(law, &F);
            check_against_energy(law, &F2);
            check_against_energy(law, &Matrix1::new(F[(0, 0)]));
        }
    }

    #[test]
    fn a_rotation_rotates_tau(F in deformation(), axis in proptest::array::uniform3(-3.0..3.0_f64)) {
        prop_assume!(F.determinant() > 0.2);
        let Q = Rotation3::new(axis.into()).into_inner();
        let turned = |law: &Law<f64, 3>| {
            let expected = Q * law.kirchhoff(&F).unwrap() * Q.transpose();
            let tau = law.kirchhoff(&(Q * F)).unwrap();
            (tau - expected).norm() / (1.0 + expected.norm())
        };
        for law in LAWS[..5].iter().map(|law| Law::from(*law)) {
            prop_assert!(turned(&law) < 1e-12, "{law:?}");
            let von_mises = law.von_mises(&F).unwrap();
            prop_assert!((law.von_mises(&(Q * F)).unwrap() - von_mises).abs() < 1e-12);
        }
    }

    #[test]
    fn the_law_for_any_material_and_the_one_of_its_own_agree(F in deformation()) {
        prop_assume!(F.determinant() > 0.2);
        let general = NeoHookean { lambda: 0.0, mu: 3.85, planted: Planted::here() }.kirchhoff(&F);
        let special = NeoHookeanNoLog { mu: 3.85 };
        prop_assert_eq!(general, special.kirchhoff(&F));
        prop_assert_eq!(Some(special.first_piola_kirchhoff(&F)), Law::from(LAWS[1]).first_piola_kirchhoff(&F));
        for law in LAWS {
            prop_assert_eq!(Some(AnyLaw(law).kirchhoff(&F)), Law::from(law).kirchhoff(&F));
        }
    }

    #[test]
    fn plane_strain_is_the_3d_law_with_unit_stretch_across(F in deformation()) {
        let F2 = F.fixed_view::<2, 2>(0, 0).into_owned();
        let F1 = Matrix1::new(F[(0, 0)]);
        prop_assume!(F2.determinant() > 0.2);
        for law in &LAWS {
            check_in_space(law, &F2);
            check_in_space(law, &F1);
        }
    }
}

fn check_in_space<const D: usize>(material: &Material<f64>, F: &SMatrix<f64, D, D>)
where
    f64: Stressed<D> + Stressed<3>,
{
    let (law, law_3d) = (Law::<f64, D>::from(*material), Law::<f64, 3>::from(*material));
    let (tau, in_3d) = (law.kirchhoff(F).unwrap(), law_3d.kirchhoff(&in_space(F)).unwrap());
    assert!((tau - in_3d.fixed_view::<D, D>(0, 0)).norm() < 1e-13, "{law:?} {tau} {in_3d}");
    let (P, in_3d) = (
        law.first_piola_kirchhoff(F).unwrap(),
        law_3d.first_piola_kirchhoff(&in_space(F)).unwrap(),
    );
    assert!((P - in_3d.fixed_view::<D, D>(0, 0)).norm() < 1e-13, "{law:?} {P} {in_3d}");
    let (m, in_3d) = (law.von_mises(F).unwrap(), law_3d.von_mises(&in_space(F)).unwrap());
    assert!((m - in_3d).abs() < 1e-12, "{law:?} {m} {in_3d}");
}

#[test]
fn at_small_strain_every_law_is_linear_elasticity_to_all_digits() {
    // Powers of two, so that F = I + H is exact.
    let bits = [[3.0, 1.0, -2.0], [-1.0, -2.0, 0.5], [1.5, 0.25, 1.0]];
    let H3 = Matrix3::from_fn(|i, j| bits[i][j] * 2f64.powi(-45));
    let H2 = H3.fixed_view::<2, 2>(0, 0).into_owned();
    let H1 = Matrix1::new(H3[(0, 0)]);
    fn check<const D: usize>(material: &Material<f64>, H: &SMatrix<f64, D, D>)
    where
        f64: Stressed<D>,
    {
        let law = Law::<f64, D>::from(*material);
        let F = SMatrix::identity() + H;
        let expected = law.stress_at_small_strain(H);
        for stress in [law.kirchhoff(&F), law.first_piola_kirchhoff(&F), law.cauchy(&F)] {
            let error = (stress.unwrap() - expected).norm() / expected.norm();
            assert!(error < 1e-12, "{law:?} {error:e}");
        }
    }
    for law in &LAWS {
        check(law, &H1);
        check(law, &H2);
        check(law, &H3);
    }
    let moduli = |law: Material<f64>| Law::<f64, 2>::from(law).lame_constants();
    assert_eq!(moduli(LAWS[0]), Some((5.77, 3.85)));
    let (lambda, mu) = moduli(LAWS[4]).unwrap();
    assert!((lambda - 5.77).abs() < 1e-15 && (mu - 3.85).abs() < 1e-15);
}

#[test]
fn hencky_stress_is_linear_in_the_logarithm_of_very_flat_and_long_stretches() {
    let (lambda, mu) = (5.77, 3.85);
    let material = Material::Hencky { lambda, mu };
    let (law, law_2d) = (Law::<f64, 3>::from(material), Law::<f64, 2>::from(material));
    let turn = Rotation3::new([0.3, -0.8, 1.1].into()).into_inner();
    for stretches in [[1e-6, 1.0, 2.0], [1e-3, 1e-3, 1e3], [1.0, 1.0, 1.0], [0.25, 0.25, 4.0]] {
        let F = turn * Matrix3::from_diagonal(&stretches.into());
        let logarithms: nalgebra::Vector3<f64> = stretches.map(f64::ln).into();
        let principal = logarithms * (2.0 * mu);
        let volume = lambda * logarithms.sum();
        let expected =
            turn * Matrix3::from_diagonal(&principal.add_scalar(volume)) * turn.transpose();
        let tau = law.kirchhoff(&F).unwrap();
        let error = (tau - expected).norm();
        assert!(error < 1e-9 * (1.0 + expected.norm()), "{stretches:?}: {error:e}");
        let plane = Matrix2::new(0.0, -stretches[1], stretches[0], 0.0);
        let tau = law_2d.kirchhoff(&plane).unwrap();
        let volume = lambda * (logarithms[0] + logarithms[1]);
        assert!((tau[(0, 0)] - principal[1] - volume).abs() < 1e-12 * (1.0 + tau.norm()));
        assert!((tau[(1, 1)] - principal[0] - volume).abs() < 1e-12 * (1.0 + tau.norm()));
        assert!(tau[(0, 1)].abs() < 1e-12);
    }
}

#[test]
fn linear_elasticity_takes_a_turn_for_a_strain() {
    let law = Law::from(LAWS[5]);
    let quarter = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    // H = R - I has H + H^T = -2 I in a quarter turn.
    let P = law.first_piola_kirchhoff(&quarter).unwrap();
    assert_eq!(P, Matrix2::identity() * (-2.0 * (5.77 + 3.85)));
    // tau = P F^T need not be symmetric, and the von Mises stress is that of its symmetric part.
    let tau = law.kirchhoff(&Matrix2::new(1.0, 0.5, 0.0, 1.25)).unwrap();
    assert!((tau[(0, 1)] - tau[(1, 0)]).abs() > 0.1);
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
        for law in LAWS.map(Law::from) {
            assert_eq!(law.kirchhoff(&F), None);
            assert_eq!(law.first_piola_kirchhoff(&F), None);
            assert_eq!(law.cauchy(&F), None);
            assert_eq!(law.von_mises(&F), None);
        }
    }
}

#[test]
fn the_short_way_to_the_stress_is_taken_near_volumes_as_they_were_and_has_the_same_bits() {
    fn check<const D: usize>() {
        let law = NeoHookean { lambda: 5.77, mu: 3.85, planted: Planted::here() };
        let (mut short, mut long) = (0, 0);
        for n in 1..400 {
            // J grows evenly from next to nothing to four.
            let J = f64::from(n) * 0.01;
            let mut F = SMatrix::<f64, D, D>::from_fn(|i, j| match (i, j) {
                (0, 0) => J,
                _ => f64::from(u8::from(i == j)),
            });
            if D > 1 {
                F[(0, D - 1)] = 0.3;
            }
            let expected = (0.5..2.0).contains(&J);
            assert_eq!(law.is_short(&F), expected, "{J}");
            if expected {
                assert_eq!(law.kirchhoff_short(&F), law.kirchhoff(&F), "{J}");
                let (by_short, by_full) =
                    (law.first_piola_kirchhoff_short(&F), law.first_piola_kirchhoff(&F));
                assert_eq!(by_short, by_full, "{J}");
                short += 1;
            } else {
                long += 1;
            }
            // Laws with one way to their stress take it whatever F is.
            let (any, plain) = (AnyLaw(LAWS[0]), NeoHookeanNoLog { mu: 1.0 });
            assert!(any.is_short(&F) && plain.is_short(&F));
            assert_eq!(any.kirchhoff_short(&F), any.kirchhoff(&F));
            assert_eq!(plain.kirchhoff_short(&F), plain.kirchhoff(&F));
        }
        assert!(short > 140 && long > 200);
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

/// Laws of the library beyond [`LAWS`], of moduli of like size.
const FURTHER_LAWS: [Material<f64>; 6] = [
    Material::Yeoh { c1: 1.3, c2: -0.2, c3: 0.05, kappa: 5.0, volumetric: Volumetric::Logarithmic },
    Material::Gent { mu: 2.6, Jm: 30.0, kappa: 5.0, volumetric: Volumetric::Quadratic },
    Material::ArrudaBoyce { mu: 2.6, N: 8.0, kappa: 5.0, volumetric: Volumetric::Mixed },
    Material::Ogden {
        mu1: 2.1,
        alpha1: 1.3,
        mu2: 0.1,
        alpha2: 5.0,
        mu3: -0.1,
        alpha3: -2.0,
        kappa: 5.0,
        volumetric: Volumetric::Logarithmic,
    },
    Material::HolzapfelGasserOgden {
        mu: 2.6,
        k1: 1.7,
        k2: 0.8,
        angle: 0.4,
        kappa: 5.0,
        volumetric: Volumetric::Quadratic,
    },
    Material::Orthotropic {
        c11: 9.0,
        c22: 7.0,
        c33: 6.0,
        c12: 2.0,
        c13: 1.5,
        c23: 1.2,
        c44: 2.5,
        c55: 2.2,
        c66: 3.0,
    },
];

#[test]
fn laws_of_the_library_agree_with_themselves() {
    fn check<T: Stressed<D>, const D: usize>(material: Material<f64>) {
        let found = Law::<T, D>::from(material.map(real)).check(real(0.2));
        assert!(found.passed(), "{material:?} in {D} dimensions: {found:?}");
        assert!(found.energy.is_some());
    }
    for material in LAWS[..5].iter().chain(&FURTHER_LAWS) {
        check::<f64, 1>(*material);
        check::<f64, 2>(*material);
        check::<f64, 3>(*material);
    }
    for material in &LAWS[..5] {
        check::<f32, 2>(*material);
        check::<f32, 3>(*material);
    }
}

/// A law of the library with a mistake.
#[derive(Debug)]
struct Mistaken {
    /// Stress that it has at rest.
    at_rest: f64,
    /// Whether its P is the nominal stress.
    is_transposed: bool,
    /// The factor of its energy.
    energy: f64,
}

impl ConstitutiveLaw<f64, 2> for Mistaken {
    fn first_piola_kirchhoff(&self, F: &[[[f64; BLOCK]; 2]; 2], P: &mut [[[f64; BLOCK]; 2]; 2]) {
        let law = Law::<f64, 2>::from(LAWS[4]);
        for n in 0..BLOCK {
            let F = Matrix2::from_fn(|i, j| F[i][j][n]);
            let stress = law.first_piola_kirchhoff(&F).unwrap();
            let stress = if self.is_transposed { stress.transpose() } else { stress };
            let stress = plus_diagonal(stress, self.at_rest);
            for i in 0..2 {
                for j in 0..2 {
                    P[i][j][n] = stress[(i, j)];
                }
            }
        }
    }

    fn strain_energy(&self, F: &Matrix2<f64>) -> Option<f64> {
        Some(self.energy * Law::<f64, 2>::from(LAWS[4]).strain_energy(F)?)
    }
}

#[test]
fn a_law_from_outside_that_contradicts_itself_is_found() {
    let right = Mistaken { at_rest: 0.0, is_transposed: false, energy: 1.0 };
    let check = |law: Mistaken| Law::from_constitutive(law).check(0.2);
    let found = check(Mistaken { at_rest: 0.1, ..right });
    assert!(!found.passed() && found.stress_at_rest > 1e-3, "{found:?}");
    let found = check(Mistaken { is_transposed: true, ..right });
    assert!(!found.passed() && found.asymmetry > 1e-3 && found.turned > 1e-3, "{found:?}");
    let found = check(Mistaken { energy: 1.01, ..right });
    assert!(!found.passed() && found.energy.unwrap() > 1e-3, "{found:?}");
    assert!(found.asymmetry < 1e-14 && found.turned < 1e-14, "{found:?}");
    assert!(check(right).passed());
}
