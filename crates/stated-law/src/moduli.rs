//! The moduli of small strains.

use crate::matrix;
use crate::program::{Given, Portion, Program};
use nalgebra::Matrix3;

/// The moduli of a law at rest, stresses all of them.
#[derive(Clone, Debug, PartialEq)]
pub struct ModuliAtRest {
    /// `A_iJkL = dP_iJ/dF_kL` at `F = I`, by `[i][J][k][L]`; zero along axes that the law leaves out.
    pub tangent: [[[[f64; 3]; 3]; 3]; 3],
    /// The first Lame constant: the mean of `A_iikk` over axes `i != k`.
    ///
    /// In one dimension it is the slope of the normal stress across the axis, which is zero where the law does not say.
    pub lambda: f64,
    /// The shear modulus: the mean of `A_ikik` over axes `i != k`; in one dimension half of `A_1111 - lambda`.
    pub mu: f64,
    /// The largest modulus of plane waves, the largest eigenvalue of `A_iJkL N_J N_L` over directions `N` (R. W. Ogden,
    /// "Non-Linear Elastic Deformations" (1984), 6.4): `lambda + 2 mu` of an isotropic law, the speed of whose P-waves is
    /// the root of it over the density.
    pub p_wave: f64,
}

impl ModuliAtRest {
    /// Moduli of the law with this stress, and this normal stress along the axes left out.
    pub(crate) fn of<const D: usize>(stress: &Program, across: Option<&Program>) -> Option<Self> {
        /// Deviations of the stress keep their digits, so that the step can be this small.
        const STEP: f64 = 1.0 / 16_777_216.0;
        /// Two for each component.
        const MOST: usize = 18;
        let mut H: [[[f64; MOST]; D]; D] = [[[0.0; MOST]; D]; D];
        for k in 0..D {
            for l in 0..D {
                H[k][l][2 * (D * k + l)] = STEP;
                H[k][l][2 * (D * k + l) + 1] = -STEP;
            }
        }
        let slope = |values: &[f64; MOST], k, l| {
            let n = 2 * (D * k + l);
            (values[n] - values[n + 1]) / (2.0 * STEP)
        };
        let mut P = H;
        stress.run(Given::Displacement(&H), Portion::Deviation, P.iter_mut().flatten());
        let mut tangent = [[[[0.0; 3]; 3]; 3]; 3];
        for (i, j, k, l) in indices::<D>() {
            tangent[i][j][k][l] = slope(&P[i][j], k, l);
        }
        let mean = |modulus: &dyn Fn(usize, usize) -> f64| {
            let pairs = (0..D * D).map(|m| (m / D, m % D)).filter(|(i, k)| i != k);
            pairs.map(|(i, k)| modulus(i, k)).sum::<f64>() / (D * (D - 1)) as f64
        };
        let (lambda, mu) = if D > 1 {
            (mean(&|i, k| tangent[i][i][k][k]), mean(&|i, k| tangent[i][k][i][k]))
        } else {
            let mut normal = [0.0; MOST];
            if let Some(across) = across {
                across.run(
                    Given::Displacement(&H),
                    Portion::Deviation,
                    std::iter::once(&mut normal),
                );
            }
            let lambda = slope(&normal, 0, 0);
            (lambda, 0.5 * (tangent[0][0][0][0] - lambda))
        };
        let is_finite = indices::<D>().all(|(i, j, k, l)| tangent[i][j][k][l].is_finite());
        let moduli =
            ModuliAtRest { tangent, lambda, mu, p_wave: largest::<D>(&tangent, is_finite) };
        (is_finite && lambda.is_finite()).then_some(moduli)
    }
}

fn indices<const D: usize>() -> impl Iterator<Item = (usize, usize, usize, usize)> {
    (0..D * D * D * D).map(|m| (m / (D * D * D), m / (D * D) % D, m / D % D, m % D))
}

/// The largest eigenvalue of the acoustic tensor over many directions, the axes among them.
fn largest<const D: usize>(tangent: &[[[[f64; 3]; 3]; 3]; 3], is_finite: bool) -> f64 {
    /// Steps of a quarter of a circle: next to the best direction the modulus is less by a thousandth at most.
    const STEPS: usize = 32;
    if !is_finite {
        return f64::NAN;
    }
    let angle = |step: usize| (std::f64::consts::FRAC_PI_2 * step as f64 / STEPS as f64).sin_cos();
    let azimuths = if D > 1 { 2 * STEPS } else { 1 };
    let heights = if D > 2 { 2 * STEPS } else { 1 };
    let mut largest = f64::NEG_INFINITY;
    for (azimuth, height) in (0..azimuths * heights).map(|m| (m / heights, m % heights)) {
        let ((sin, cos), (up, flat)) = (angle(azimuth), angle(height));
        let N = [cos * flat, sin * flat, up];
        let acoustic: [[f64; 3]; 3] = matrix(|i, k| {
            let of = |m: usize| tangent[i][m / 3][k][m % 3] * N[m / 3] * N[m % 3];
            (0..9).map(of).sum()
        });
        let acoustic = Matrix3::from_fn(|i, k| 0.5 * (acoustic[i][k] + acoustic[k][i]));
        largest = largest.max(acoustic.symmetric_eigenvalues().max());
    }
    largest
}
