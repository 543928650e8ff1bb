//! Plastic flow by von Mises, by return maps: logarithmic elastic strains, isotropic hardening.
//!
//! The internal variables are `G = (F^p^T F^p)^-1` and the equivalent plastic strain `alpha`. A step from `F_n` to `F` tries an elastic
//! one, `b = F G_n F^T`, and returns to the yield surface along the deviator of the stress:
//!
//! ```text
//! e = ln(b)/2,  s = 2 mu dev e,  n = s/|s|;   e <- e - D n,   |s| - 2 mu D = sqrt(2/3) k(alpha_n + sqrt(2/3) D)
//! ```
//!
//! This is backward Euler for the multiplier and the exponential map for the flow, of first order in the step. The midpoint rule takes the
//! direction of the flow from half a step, and is of second order.
//!
//! Source: J. C. Simo, "Algorithms for static and dynamic multiplicative plasticity that preserve the classical return mapping schemes of
//! the infinitesimal theory", CMAME 99 (1992) 61-112; M. Ortiz and E. P. Popov, IJNME 21 (1985) 1561-1576, for the midpoint rule.

use nalgebra::{Matrix3, RealField, SymmetricEigen, Vector3};

use crate::BLOCK;
use crate::memory::{Increment, InternalVariable, LawWithMemory};

/// How a step finds the direction of the flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReturnMap {
    /// At its end: first order.
    #[default]
    Exponential,
    /// At its middle: second order.
    Midpoint,
}

/// Plastic flow by von Mises, with the yield stress `yield_stress + modulus alpha^exponent`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    /// Lamé's first parameter, a pressure.
    pub lambda: f64,
    /// The shear modulus, a pressure.
    pub mu: f64,
    /// The yield stress of the virgin material.
    pub yield_stress: f64,
    /// The modulus of the hardening, a stress.
    pub modulus: f64,
    /// The exponent of the hardening; 1 is linear.
    pub exponent: f64,
    /// How a step finds the direction of the flow.
    pub map: ReturnMap,
}

/// The entries of `G` in the order of the variables.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// A symmetric tensor by its principal values and directions.
struct Principal {
    values: Vector3<f64>,
    directions: Matrix3<f64>,
}

impl Principal {
    fn of(b: Matrix3<f64>) -> Self {
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(b);
        Self { values: eigenvalues, directions: eigenvectors }
    }

    fn tensor(&self, values: Vector3<f64>) -> Matrix3<f64> {
        self.directions * Matrix3::from_diagonal(&values) * self.directions.transpose()
    }
}

fn deviator(e: Vector3<f64>) -> Vector3<f64> {
    e.add_scalar(-e.mean())
}

/// `sqrt(2/3)`.
const ROOT: f64 = 0.816_496_580_927_726;

impl Plastic {
    fn allowed(&self, alpha: f64) -> f64 {
        ROOT * (self.yield_stress + self.modulus * alpha.max(0.0).powf(self.exponent))
    }

    /// The multiplier by which the size of the deviator `size - 2 mu D` is the allowed one; zero where it is below.
    ///
    /// The residual falls with `D`, and so does its root lie between zero and the multiplier without hardening.
    fn multiplier(&self, size: f64, alpha: f64) -> f64 {
        let residual = |D: f64| size - 2.0 * self.mu * D - self.allowed(alpha + ROOT * D);
        if residual(0.0) <= 0.0 {
            return 0.0;
        }
        root(residual, (size - self.allowed(alpha)) / (2.0 * self.mu))
    }

    /// `G` and `alpha` after a step that ends at `F`.
    fn exponential(&self, F: &Matrix3<f64>, G: &Matrix3<f64>, alpha: f64) -> (Matrix3<f64>, f64) {
        let trial = Principal::of(F * G * F.transpose());
        let e = trial.values.map(|value| 0.5 * value.ln());
        let s = deviator(e) * (2.0 * self.mu);
        let size = s.norm();
        let D = self.multiplier(size, alpha);
        if D == 0.0 {
            return (*G, alpha);
        }
        let e = e - s * (D / size);
        let b = trial.tensor(e.map(|e| (2.0 * e).exp()));
        (pull_back(F, &b), alpha + ROOT * D)
    }

    /// As [`exponential`](Self::exponential), with the direction of the flow at the middle of the step from `start`:
    /// `G = exp(-2 D F_m^-1 n_m F_m) G_n`.
    fn midpoint(
        &self,
        start: &Matrix3<f64>,
        F: &Matrix3<f64>,
        G: &Matrix3<f64>,
        alpha: f64,
    ) -> (Matrix3<f64>, f64) {
        let size_of = |G: &Matrix3<f64>| {
            let e = Principal::of(F * G * F.transpose()).values.map(|value| 0.5 * value.ln());
            2.0 * self.mu * deviator(e).norm()
        };
        if size_of(G) <= self.allowed(alpha) {
            return (*G, alpha);
        }
        let middle = (start + F) * 0.5;
        let (at_middle, _) = self.exponential(&middle, G, alpha);
        let principal = Principal::of(middle * at_middle * middle.transpose());
        let s = deviator(principal.values.map(f64::ln));
        let n = s / s.norm();
        let Some(inverse) = middle.try_inverse() else { return (*G, alpha) };
        let after = |D: f64| {
            let flow = principal.tensor(n.map(|n| (-2.0 * D * n).exp()));
            let after = inverse * flow * middle * G;
            (after + after.transpose()) * 0.5
        };
        let residual = |D: f64| size_of(&after(D)) - self.allowed(alpha + ROOT * D);
        let D = root(residual, (size_of(G) - self.allowed(alpha)) / (2.0 * self.mu));
        (after(D), alpha + ROOT * D)
    }
}

/// `F^-1 b F^-T`, symmetric.
fn pull_back(F: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix3<f64> {
    // F has a positive determinant.
    let inverse = F.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
    let G = inverse * b * inverse.transpose();
    (G + G.transpose()) * 0.5
}

/// The root of a falling function that is positive at zero and about zero at `high`, by regula falsi with halved ends (Illinois).
fn root(function: impl Fn(f64) -> f64, high: f64) -> f64 {
    let (mut low, mut at_low) = (0.0, function(0.0));
    let (mut high, mut at_high) = (high, function(high));
    // The direction of the flow may have turned within the step.
    for _ in 0..8 {
        if at_high <= 0.0 {
            break;
        }
        (low, at_low) = (high, at_high);
        high *= 2.0;
        at_high = function(high);
    }
    let mut side = 0;
    for _ in 0..100 {
        if high - low <= 4.0 * f64::EPSILON * high.abs() || at_high == 0.0 {
            break;
        }
        let next = (low * at_high - high * at_low) / (at_high - at_low);
        if !(next > low && next < high) {
            break;
        }
        let value = function(next);
        if value > 0.0 {
            (low, at_low) = (next, value);
            if side == 1 {
                at_high *= 0.5;
            }
            side = 1;
        } else {
            (high, at_high) = (next, value);
            if side == -1 {
                at_low *= 0.5;
            }
            side = -1;
        }
    }
    if at_low.abs() < at_high.abs() { low } else { high }
}

/// The deformation gradient of particle `n` in three dimensions, with the identity out of the plane.
fn in_space<T: RealField + Copy, const D: usize>(
    F: &[[[T; BLOCK]; D]; D],
    n: usize,
) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| match i < D && j < D {
        true => nalgebra::convert_unchecked(F[i][j][n]),
        false if i == j => 1.0,
        false => 0.0,
    })
}

fn variables<T: RealField + Copy>(q: &[[T; BLOCK]], n: usize) -> (Matrix3<f64>, f64) {
    let mut G = Matrix3::zeros();
    for (&(i, j), column) in ENTRIES.iter().zip(q) {
        let value = nalgebra::convert_unchecked(column[n]);
        (G[(i, j)], G[(j, i)]) = (value, value);
    }
    (G, nalgebra::convert_unchecked(q[6][n]))
}

impl<T: RealField + Copy, const D: usize> LawWithMemory<T, D> for Plastic {
    fn variables(&self) -> Vec<InternalVariable> {
        let of_G = ENTRIES.iter().map(|&(i, j)| InternalVariable {
            name: format!("G{}{}", i + 1, j + 1),
            at_rest: if i == j { 1.0 } else { 0.0 },
        });
        of_G.chain([InternalVariable { name: "alpha".into(), at_rest: 0.0 }]).collect()
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
        for n in 0..BLOCK {
            let own = in_space(F, n);
            let (G, _) = variables(q, n);
            let elastic = Principal::of(own * G * own.transpose());
            let e = elastic.values.map(|value| 0.5 * value.ln());
            let tau = e.map(|e| 2.0 * self.mu * e).add_scalar(self.lambda * e.sum());
            let inverse = own.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
            let stress = elastic.tensor(tau) * inverse.transpose();
            for i in 0..D {
                for j in 0..D {
                    P[i][j][n] = nalgebra::convert(stress[(i, j)]);
                }
            }
        }
    }

    fn evolve(&self, increment: &Increment<'_, T, D>, q: &mut [[T; BLOCK]]) {
        let Increment { start, end, .. } = *increment;
        for n in 0..BLOCK {
            let (G, alpha) = variables(q, n);
            let (start, end) = (in_space(start, n), in_space(end, n));
            let (G, alpha) = match self.map {
                ReturnMap::Exponential => self.exponential(&end, &G, alpha),
                ReturnMap::Midpoint => self.midpoint(&start, &end, &G, alpha),
            };
            for (&(i, j), column) in ENTRIES.iter().zip(&mut *q) {
                column[n] = nalgebra::convert(G[(i, j)]);
            }
            q[6][n] = nalgebra::convert(alpha);
        }
    }
}
