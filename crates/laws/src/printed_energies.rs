//! Laws against their energies as the sources print them, in 77 digits, which know nothing of how the stresses are formed: the
//! stress expected is the difference quotient of the energy.

use super::arruda_boyce::ArrudaBoyce;
use super::gent::Gent;
use super::holzapfel_gasser_ogden::HolzapfelGasserOgden;
use super::ogden::Ogden;
use super::orthotropic::Orthotropic;
use super::st_venant_kirchhoff::StVenantKirchhoff;
use super::yeoh::Yeoh;
use super::*;
use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use nalgebra::{Matrix1, Matrix2, Matrix3, Rotation3};
use proptest::prelude::*;
use std::array;

type Float = FBig<HalfEven, 2>;
/// A tensor in space.
type Space = [[Float; 3]; 3];

const BITS: usize = 256;
const VOLUMETRIC: [Volumetric; 3] =
    [Volumetric::Logarithmic, Volumetric::Quadratic, Volumetric::Mixed];

fn float(value: f64) -> Float {
    Float::try_from(value).unwrap().with_precision(BITS).value()
}

fn exact<T: RealField + Copy>(value: T) -> Float {
    float(nalgebra::convert_unchecked(value))
}

fn ratio(numerator: i32, denominator: i32) -> Float {
    float(numerator.into()) / float(denominator.into())
}

fn power(base: &Float, exponent: &Float) -> Float {
    (base.ln() * exponent).exp()
}

fn determinant_in_space(F: &Space) -> Float {
    let minor = |i: usize, j: usize| &F[1][i] * &F[2][j] - &F[1][j] * &F[2][i];
    &F[0][0] * minor(1, 2) + &F[0][1] * minor(2, 0) + &F[0][2] * minor(0, 1)
}

/// `C = F^T F`.
fn right_cauchy_green(F: &Space) -> Space {
    array::from_fn(|i| {
        array::from_fn(|j| (0..3).fold(Float::ZERO, |sum, k| sum + &F[k][i] * &F[k][j]))
    })
}

/// `I1bar - 3`.
fn excess(F: &Space) -> Float {
    let C = right_cauchy_green(F);
    let I1 = &C[0][0] + &C[1][1] + &C[2][2];
    I1 * power(&determinant_in_space(F), &ratio(-2, 3)) - float(3.0)
}

fn volume(volumetric: Volumetric, F: &Space) -> Float {
    let J = determinant_in_space(F);
    match volumetric {
        Volumetric::Logarithmic => J.ln().powi(2.into()) / float(2.0),
        Volumetric::Quadratic => (J - float(1.0)).powi(2.into()) / float(2.0),
        Volumetric::Mixed => (&J * &J - float(1.0) - J.ln() * float(2.0)) / float(4.0),
    }
}

/// A law with its energy as it is printed.
trait Printed<T: RealField + Copy>: LibraryLaw<T> {
    fn energy(&self, F: &Space) -> Float;

    /// The Lame constants at small strain, as the sources print the shear modulus.
    fn lame(&self) -> Option<(f64, f64)>;

    /// The most units of the precision that a stress may be off at moderate strain.
    fn roundings<const D: usize>(&self) -> f64 {
        4.0
    }

    /// Whether directions of the body are alike.
    fn isotropic(&self) -> bool {
        self.lame().is_some()
    }
}

/// Lame's constants of a shear and a bulk modulus.
fn of_bulk(mu: f64, kappa: f64) -> Option<(f64, f64)> {
    Some((kappa - mu * 2.0 / 3.0, mu))
}

fn double<T: RealField + Copy>(value: T) -> f64 {
    nalgebra::convert_unchecked(value)
}

impl<T: RealField + Copy> Printed<T> for Yeoh<T> {
    fn energy(&self, F: &Space) -> Float {
        let x = excess(F);
        let sum = exact(self.c1) * &x
            + exact(self.c2) * x.powi(2.into())
            + exact(self.c3) * x.powi(3.into());
        sum + exact(self.kappa) * volume(self.volumetric, F)
    }

    fn lame(&self) -> Option<(f64, f64)> {
        of_bulk(2.0 * double(self.c1), double(self.kappa))
    }
}

impl<T: RealField + Copy> Printed<T> for Gent<T> {
    fn energy(&self, F: &Space) -> Float {
        let Jm = exact(self.limit);
        let logarithm = (float(1.0) - excess(F) / &Jm).ln();
        exact(self.kappa) * volume(self.volumetric, F)
            - exact(self.mu) * Jm / float(2.0) * logarithm
    }

    fn lame(&self) -> Option<(f64, f64)> {
        of_bulk(double(self.mu), double(self.kappa))
    }
}

impl<T: RealField + Copy> Printed<T> for ArrudaBoyce<T> {
    fn energy(&self, F: &Space) -> Float {
        let I1 = excess(F) + float(3.0);
        let N = exact(self.links);
        let factors =
            [ratio(1, 2), ratio(1, 20), ratio(11, 1050), ratio(19, 7000), ratio(519, 673_750)];
        let mut sum = Float::ZERO;
        for (i, factor) in factors.into_iter().enumerate() {
            let power = I1.powi((i + 1).into()) - float(3.0).powi((i + 1).into());
            sum += factor * power / N.powi(i.into());
        }
        exact(self.mu) * sum + exact(self.kappa) * volume(self.volumetric, F)
    }

    fn lame(&self) -> Option<(f64, f64)> {
        let n = 1.0 / double(self.links);
        let series = 1.0
            + n * (3.0 / 5.0 + n * (99.0 / 175.0 + n * (513.0 / 875.0 + n * 42039.0 / 67375.0)));
        of_bulk(double(self.mu) * series, double(self.kappa))
    }
}

impl<T: RealField + Copy> Printed<T> for Orthotropic<T> {
    fn energy(&self, F: &Space) -> Float {
        let C = right_cauchy_green(F);
        let E = |i: usize, j: usize| (&C[i][j] - float(f64::from(u8::from(i == j)))) / float(2.0);
        // Voigt's vector, with the engineering shears.
        let e = [
            E(0, 0),
            E(1, 1),
            E(2, 2),
            E(1, 2) * float(2.0),
            E(0, 2) * float(2.0),
            E(0, 1) * float(2.0),
        ];
        let diagonal = [self.c11, self.c22, self.c33, self.c44, self.c55, self.c66].map(exact);
        let mut sum = Float::ZERO;
        for (modulus, e) in diagonal.iter().zip(&e) {
            sum += modulus * e * e / float(2.0);
        }
        let [c12, c13, c23] = [self.c12, self.c13, self.c23].map(exact);
        sum + c12 * &e[0] * &e[1] + c13 * &e[0] * &e[2] + c23 * &e[1] * &e[2]
    }

    fn lame(&self) -> Option<(f64, f64)> {
        None
    }
}

/// The eigenvalues of a symmetric tensor by Jacobi's rotations.
fn eigenvalues(mut A: Space) -> [Float; 3] {
    let one = float(1.0);
    let nothing = float(2_f64.powi(-250));
    // Convergence is quadratic.
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = &A[p][q];
            if off.clone().max(-off) < nothing {
                continue;
            }
            let cotangent = (&A[q][q] - &A[p][p]) / (off + off);
            let root = (&cotangent * &cotangent + &one).sqrt();
            let tangent = match cotangent < Float::ZERO {
                true => &one / (cotangent - root),
                false => &one / (cotangent + root),
            };
            let cosine = &one / (&tangent * &tangent + &one).sqrt();
            let sine = &tangent * &cosine;
            let Q: Space = array::from_fn(|i| {
                array::from_fn(|j| match (i, j) {
                    _ if (i, j) == (p, q) => sine.clone(),
                    _ if (i, j) == (q, p) => -&sine,
                    _ if i == j && (i == p || i == q) => cosine.clone(),
                    _ => float(f64::from(u8::from(i == j))),
                })
            });
            let half: Space = array::from_fn(|i| {
                array::from_fn(|j| (0..3).fold(Float::ZERO, |sum, k| sum + &A[i][k] * &Q[k][j]))
            });
            A = array::from_fn(|i| {
                array::from_fn(|j| (0..3).fold(Float::ZERO, |sum, k| sum + &Q[k][i] * &half[k][j]))
            });
        }
    }
    array::from_fn(|i| A[i][i].clone())
}

impl<T: RealField + Copy> Printed<T> for Ogden<T> {
    fn energy(&self, F: &Space) -> Float {
        let squares = eigenvalues(right_cauchy_green(F));
        let unit = power(&determinant_in_space(F), &ratio(-1, 3));
        let mut sum = exact(self.kappa) * volume(self.volumetric, F);
        for (mu, alpha) in
            [(self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3)]
        {
            if mu != T::zero() {
                let (mu, alpha) = (exact(mu), exact(alpha));
                let powers = squares.iter().map(|square| power(&(square.sqrt() * &unit), &alpha));
                sum += mu / &alpha * (powers.fold(Float::ZERO, |sum, p| sum + p) - float(3.0));
            }
        }
        sum
    }

    fn lame(&self) -> Option<(f64, f64)> {
        let terms = [(self.mu1, self.alpha1), (self.mu2, self.alpha2), (self.mu3, self.alpha3)];
        let twice = terms.into_iter().map(|(mu, alpha)| double(mu) * double(alpha)).sum::<f64>();
        of_bulk(0.5 * twice, double(self.kappa))
    }

    /// In space as many as the principal directions are.
    fn roundings<const D: usize>(&self) -> f64 {
        if D == 3 { 12.0 } else { 4.0 }
    }
}

impl<T: RealField + Copy> Printed<T> for HolzapfelGasserOgden<T> {
    fn energy(&self, F: &Space) -> Float {
        let C = right_cauchy_green(F);
        let angle = exact(self.angle);
        let (cosine, sine) = (angle.cos(), angle.sin());
        let I4 = &C[0][0] * &cosine * &cosine
            + (&C[0][1] + &C[1][0]) * &cosine * &sine
            + &C[1][1] * &sine * &sine;
        let matrix = exact(self.mu) / float(2.0) * excess(F)
            + exact(self.kappa) * volume(self.volumetric, F);
        let stretch = I4 - float(1.0);
        if stretch < Float::ZERO {
            return matrix;
        }
        let k2 = exact(self.k2);
        let growth = (&k2 * &stretch * &stretch).exp() - float(1.0);
        matrix + exact(self.k1) / (float(2.0) * k2) * growth
    }

    fn lame(&self) -> Option<(f64, f64)> {
        None
    }
}

/// `$body` for every law of this file, with every volumetric function, as `$law`.
macro_rules! for_every_law {
    ($T:ty, $volumetric:expr, |$law:ident| $body:expr) => {{
        let c = |value: f64| real::<$T>(value);
        for volumetric in $volumetric {
            let kappa = c(7.25);
            {
                let $law = Yeoh { c1: c(1.3), c2: c(-0.2), c3: c(0.07), kappa, volumetric };
                $body
            }
            {
                let $law = Gent { mu: c(3.85), limit: c(27.5), kappa, volumetric };
                $body
            }
            {
                let $law = Ogden {
                    mu1: c(6.3),
                    alpha1: c(1.3),
                    mu2: c(0.3),
                    alpha2: c(5.0),
                    mu3: c(-0.4),
                    alpha3: c(-2.0),
                    kappa,
                    volumetric,
                };
                $body
            }
            {
                let (mu, k1, k2, angle) = (c(3.85), c(2.3), c(0.8), c(0.7));
                let $law = HolzapfelGasserOgden { mu, k1, k2, angle, kappa, volumetric };
                $body
            }
            {
                let $law = ArrudaBoyce { mu: c(2.6), links: c(4.5), kappa, volumetric };
                $body
            }
        }
        let $law = Orthotropic {
            c11: c(12.0),
            c22: c(9.5),
            c33: c(8.25),
            c12: c(4.1),
            c13: c(3.7),
            c23: c(3.3),
            c44: c(2.9),
            c55: c(3.6),
            c66: c(4.4),
        };
        $body
    }};
}

/// The deformation in space, with unit stretch along the axes that are left out.
fn in_space<T: RealField + Copy, const D: usize>(F: &SMatrix<T, D, D>) -> Space {
    array::from_fn(|i| {
        array::from_fn(|j| match i < D && j < D {
            true => exact(F[(i, j)]),
            false => float(f64::from(u8::from(i == j))),
        })
    })
}

/// The difference quotient of the energy in space.
fn expected<T: RealField + Copy>(law: &impl Printed<T>, F: &Space) -> Space {
    let step = float(2_f64.powi(-64));
    array::from_fn(|i| {
        array::from_fn(|j| {
            let at = |change: Float| {
                let mut F = F.clone();
                F[i][j] += change;
                law.energy(&F)
            };
            (at(step.clone()) - at(-step.clone())) / (&step + &step)
        })
    })
}

/// The norm of the difference over that of what is expected, in units of the precision, for the axes that are there.
fn roundings<T: RealField + Copy, const D: usize>(
    found: &SMatrix<T, D, D>,
    expected: &Space,
) -> f64 {
    let (mut error, mut norm) = (0.0_f64, 0.0_f64);
    for i in 0..D {
        for j in 0..D {
            error += (exact(found[(i, j)]) - &expected[i][j]).to_f64().value().powi(2);
            norm += expected[i][j].to_f64().value().powi(2);
        }
    }
    (error / norm).sqrt() / double(T::default_epsilon())
}

/// Errors of what a law gives, in units of the precision.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    P: f64,
    tau: f64,
    energy: f64,
}

fn errors<T: RealField + Copy, const D: usize>(
    law: &impl Printed<T>,
    F: &SMatrix<T, D, D>,
) -> Errors {
    let space = in_space(F);
    let P = expected(law, &space);
    let tau: Space = array::from_fn(|i| {
        array::from_fn(|j| (0..3).fold(Float::ZERO, |sum, k| sum + &P[i][k] * &space[j][k]))
    });
    let eps = double(T::default_epsilon());
    let energy = law.energy(&space).to_f64().value();
    let found = law.kirchhoff(F);
    Errors {
        P: roundings(&law.first_piola_kirchhoff(F), &P),
        tau: roundings(&found, &tau),
        energy: (double(law.strain_energy(F)) / energy - 1.0).abs() / eps,
    }
}

/// `I + H` with entries of H up to `size`, the same at every run.
fn deformation<T: RealField + Copy, const D: usize>(size: f64, n: u32) -> SMatrix<T, D, D> {
    let H = |i: usize, j: usize| {
        (0.618_034 * f64::from(n) + 0.324_718 * (3 * i + j) as f64).fract() * 2.0 - 1.0
    };
    SMatrix::from_fn(|i, j| real(f64::from(u8::from(i == j)) + size * H(i, j)))
}

fn check<T: RealField + Copy, const D: usize>(
    law: &impl Printed<T>,
    F: &SMatrix<T, D, D>,
    size: f64,
) {
    // Where the energy's terms nearly cancel, its slopes do not.
    if jacobian(F).is_none_or(|J| double(J) < 0.2) {
        return;
    }
    let found = errors(law, F);
    let bound = law.roundings::<D>();
    assert!(found.P < bound && found.tau < bound, "{size:e} {F} {found:?}");
    assert!(found.energy < 16.0, "{size:e} {F} {found:?}");
}

fn check_in_every_dimension<T: RealField + Copy>(sizes: &[f64]) {
    for &size in sizes {
        for (n, volumetric) in (0..).zip(VOLUMETRIC) {
            for_every_law!(T, [volumetric], |law| {
                check::<T, 1>(&law, &deformation(size, n), size);
                check::<T, 2>(&law, &deformation(size, n), size);
                check::<T, 3>(&law, &deformation(size, n), size);
            });
        }
    }
}

#[test]
fn stresses_and_energies_keep_their_digits_at_every_strain() {
    check_in_every_dimension::<f64>(&[1e-14, 1e-9, 1e-4, 0.05, 0.5]);
    check_in_every_dimension::<f32>(&[1e-4, 0.05, 0.5]);
}

/// As many roundings as J has left when its products cancel.
fn check_flat<const D: usize>(law: &impl Printed<f64>, F: &SMatrix<f64, D, D>) {
    // Beyond the limit of Gent's chains.
    if law.strain_energy(F).is_nan() {
        return;
    }
    let (found, bound) = (errors(law, F), 4.0 / determinant(F));
    assert!(found.P < bound && found.tau < bound, "{F} {found:?}");
    assert!(found.energy < bound, "{F} {found:?}");
}

#[test]
fn flat_particles_lose_the_digits_of_their_volume_alone() {
    let turn = Rotation3::new([0.3, -0.8, 1.1].into()).into_inner();
    for flat in [0.05, 1e-2, 1e-4] {
        for_every_law!(f64, VOLUMETRIC, |law| {
            let F = turn * Matrix3::from_diagonal(&[flat, 1.2, 0.9].into()) * turn.transpose();
            check_flat(&law, &F);
            check_flat(&law, &Matrix2::new(1.1, 0.4, 0.4, 0.16 / 1.1 + flat));
            check_flat(&law, &Matrix1::new(flat));
        });
    }
}

#[test]
fn equal_stretches_keep_their_digits() {
    let turn = Rotation3::new([0.3, -0.8, 1.1].into()).into_inner();
    for stretches in [[1.3, 1.3, 0.8], [0.9, 0.9, 0.9], [1.0, 1.0, 1.5]] {
        for_every_law!(f64, VOLUMETRIC, |law| {
            let stretch = turn * Matrix3::from_diagonal(&stretches.into()) * turn.transpose();
            for F in [Matrix3::from_diagonal(&stretches.into()), stretch] {
                let found = errors(&law, &F);
                let bound = law.roundings::<3>();
                assert!(found.P < bound && found.tau < bound && found.energy < 16.0, "{found:?}");
            }
            // A quarter turn of equal stretches.
            let plane = Matrix2::new(0.0, -stretches[0], stretches[0], 0.0) * 1.25;
            let found = errors(&law, &plane);
            assert!(found.P < 4.0 && found.tau < 4.0, "{plane} {found:?}");
            assert_eq!(law.kirchhoff(&Matrix3::identity()), Matrix3::zeros());
            assert_eq!(law.first_piola_kirchhoff(&Matrix2::identity()), Matrix2::zeros());
            assert_eq!(law.strain_energy(&Matrix3::identity()), 0.0);
        });
    }
}

#[test]
fn fibres_resist_extension_alone() {
    let (mu, k1, angle) = (3.85, 2.3, 0.7_f64);
    let volumetric = Volumetric::Logarithmic;
    let law = HolzapfelGasserOgden { mu, k1, k2: 0.8, angle, kappa: 7.25, volumetric };
    let matrix = Yeoh { c1: 0.5 * mu, c2: 0.0, c3: 0.0, kappa: 7.25, volumetric };
    let a = nalgebra::vector![angle.cos(), angle.sin(), 0.0];
    let H = tiny::<3>();
    let stretch = a.dot(&(H * a));
    for (H, along) in [(H, stretch), (-H, -stretch)] {
        let F = Matrix3::identity() + H;
        let from_fibres = law.kirchhoff(&F) - matrix.kirchhoff(&F);
        let expected = a * a.transpose() * (4.0 * k1 * along.max(0.0));
        let error = (from_fibres - expected).norm();
        assert!(error < 1e-12 * H.norm(), "{from_fibres} {expected}");
    }
    assert!(stretch.abs() > 0.1 * H.norm());
    // Next to nothing in the exponential, and nothing.
    let F = deformation::<f64, 3>(0.3, 1);
    let [little, none] = [1e-13, 0.0].map(|k2| HolzapfelGasserOgden { k2, ..law });
    assert!(law.kirchhoff(&F) != matrix.kirchhoff(&F));
    assert!((little.kirchhoff(&F) - none.kirchhoff(&F)).norm() < 1e-11);
    assert!((little.strain_energy(&F) - none.strain_energy(&F)).abs() < 1e-11);
}

#[test]
fn ogdens_terms_without_modulus_or_power_are_none() {
    let volumetric = Volumetric::Quadratic;
    let one = Ogden {
        mu1: 3.85,
        alpha1: 2.0,
        mu2: 0.0,
        alpha2: 0.0,
        mu3: 2.0,
        alpha3: 0.0,
        kappa: 7.25,
        volumetric,
    };
    // With the power two it is the law of a neo-Hookean solid.
    let law = Yeoh { c1: 0.5 * 3.85, c2: 0.0, c3: 0.0, kappa: 7.25, volumetric };
    for n in 0..3 {
        let F = deformation::<f64, 3>(0.4, n);
        let F2 = deformation::<f64, 2>(0.4, n);
        assert!((one.kirchhoff(&F) - law.kirchhoff(&F)).norm() < 1e-13);
        assert!((one.kirchhoff(&F2) - law.kirchhoff(&F2)).norm() < 1e-13);
        assert!((one.strain_energy(&F) - law.strain_energy(&F)).abs() < 1e-13);
    }
}

/// Powers of two, so that `F = I + H` is exact.
fn tiny<const D: usize>() -> SMatrix<f64, D, D> {
    let bits = [[3.0, 1.0, -2.0], [-1.0, -2.0, 0.5], [1.5, 0.25, 1.0]];
    SMatrix::from_fn(|i, j| bits[i][j] * 2_f64.powi(-45))
}

fn check_small_strain<const D: usize>(law: &impl Printed<f64>) {
    let Some((lambda, mu)) = law.lame() else { return };
    let H = tiny::<D>();
    let F = SMatrix::identity() + H;
    let expected = plus_diagonal((H + H.transpose()) * mu, lambda * H.trace());
    for stress in [law.kirchhoff(&F), law.first_piola_kirchhoff(&F)] {
        let error = (stress - expected).norm() / expected.norm();
        assert!(error < 1e-12, "{error:e}");
    }
}

#[test]
fn at_small_strain_the_law_is_hookes_with_the_moduli_of_the_sources() {
    for_every_law!(f64, VOLUMETRIC, |law| {
        check_small_strain::<1>(&law);
        check_small_strain::<2>(&law);
        check_small_strain::<3>(&law);
    });
}

#[test]
fn orthotropic_moduli_are_those_of_voigts_notation_at_small_strain() {
    let law = Orthotropic {
        c11: 12.0,
        c22: 9.5,
        c33: 8.25,
        c12: 4.1,
        c13: 3.7,
        c23: 3.3,
        c44: 2.9,
        c55: 3.6,
        c66: 4.4,
    };
    let h = 2_f64.powi(-45);
    for (strained, column) in
        [[12.0, 4.1, 3.7], [4.1, 9.5, 3.3], [3.7, 3.3, 8.25]].iter().enumerate()
    {
        let mut F = Matrix3::identity();
        F[(strained, strained)] += h;
        let tau = law.kirchhoff(&F);
        assert!((tau.diagonal() / h - nalgebra::Vector3::from(*column)).norm() < 1e-11, "{tau}");
    }
    for ((i, j), modulus) in [((1, 2), 2.9), ((0, 2), 3.6), ((0, 1), 4.4)] {
        let mut F = Matrix3::identity();
        F[(i, j)] += h;
        let tau = law.kirchhoff(&F);
        assert!(
            (tau[(i, j)] / h - modulus).abs() < 1e-11 && tau.trace().abs() < 1e-11 * h,
            "{tau}"
        );
    }
}

#[test]
fn orthotropy_with_two_constants_is_the_isotropic_law() {
    let (lambda, mu) = (5.77, 3.85);
    let normal = lambda + 2.0 * mu;
    let law = Orthotropic {
        c11: normal,
        c22: normal,
        c33: normal,
        c12: lambda,
        c13: lambda,
        c23: lambda,
        c44: mu,
        c55: mu,
        c66: mu,
    };
    let F = deformation::<f64, 3>(0.4, 1);
    let difference = law.kirchhoff(&F) - StVenantKirchhoff { lambda, mu }.kirchhoff(&F);
    assert!(difference.norm() < 1e-13, "{difference}");
}

#[test]
fn gents_chains_have_a_limit() {
    let law = Gent { mu: 3.85, limit: 2.0, kappa: 7.25, volumetric: Volumetric::Mixed };
    // At constant volume: I1bar - 3 = a^2 + a^-2 - 2, which is 2 at a = 1.93185.
    let stretched = |a: f64| Matrix3::from_diagonal(&[a, 1.0 / a, 1.0].into());
    let (below, above) = (stretched(1.931), stretched(1.932));
    assert!(law.kirchhoff(&below).norm() > 1e3 && law.strain_energy(&below) > 10.0);
    for stress in [law.kirchhoff(&above), law.first_piola_kirchhoff(&above)] {
        assert!(stress.iter().any(|entry| entry.is_nan()), "{stress}");
    }
    assert!(law.strain_energy(&above).is_nan());
    // Without a limit next to the strain it is the law of a neo-Hookean solid at constant volume.
    let far = Gent { limit: 1e12, ..law };
    let (tau, F) = (far.kirchhoff(&below), below);
    let expected = plus_diagonal(F * F, -(F * F).trace() / 3.0) * 3.85;
    assert!((tau - expected).norm() < 1e-9 * expected.norm());
}

fn turned(law: &impl Printed<f64>, F: &Matrix3<f64>, Q: &Matrix3<f64>) {
    let tau = law.kirchhoff(F);
    let bound = 1e-12 * (1.0 + tau.norm());
    assert!((tau - tau.transpose()).norm() < bound, "{tau}");
    let after = law.kirchhoff(&(Q * F));
    assert!((after - Q * tau * Q.transpose()).norm() < bound, "{after}");
    assert!((law.strain_energy(&(Q * F)) - law.strain_energy(F)).abs() < bound);
    let before = law.kirchhoff(&(F * Q));
    assert!(!law.isotropic() || (before - tau).norm() < bound, "{before} {tau}");
}

fn check_in_space<const D: usize>(law: &impl Printed<f64>, F: &SMatrix<f64, D, D>) {
    let space = Matrix3::from_fn(|i, j| match i < D && j < D {
        true => F[(i, j)],
        false => f64::from(u8::from(i == j)),
    });
    let close = |found: &SMatrix<f64, D, D>, in_space: &Matrix3<f64>| {
        let error = (found - in_space.fixed_view::<D, D>(0, 0)).norm();
        assert!(error < 1e-13 * (1.0 + in_space.norm()), "{found} {in_space}");
    };
    let (tau, P) = (law.kirchhoff(&space), law.first_piola_kirchhoff(&space));
    close(&law.kirchhoff(F), &tau);
    close(&law.first_piola_kirchhoff(F), &P);
    assert!((law.strain_energy(F) - law.strain_energy(&space)).abs() < 1e-13);
}

proptest! {
    #[test]
    fn rotations_and_planes(
        H in proptest::array::uniform9(-0.25..0.25_f64),
        axis in proptest::array::uniform3(0.5..2.0_f64),
    ) {
        let F = Matrix3::identity() + Matrix3::from_row_slice(&H);
        prop_assume!(F.determinant() > 0.2);
        let F2 = F.fixed_view::<2, 2>(0, 0).into_owned();
        prop_assume!(F2.determinant() > 0.2);
        let Q = Rotation3::new(axis.into()).into_inner();
        for_every_law!(f64, VOLUMETRIC, |law| {
            turned(&law, &F, &Q);
            check_in_space(&law, &F2);
            check_in_space(&law, &Matrix1::new(F[(0, 0)]));
        });
    }
}
