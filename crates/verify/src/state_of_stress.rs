//! The largest pressure and shear of an exact motion, and the rates at which disturbances grow by them.

use mmsmith_mpm::Law;
use mmsmith_runtime::Solution;
use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use serde::Serialize;

use crate::points;
use crate::precision::Precision;

/// Largest pressure and shear of a motion, and moduli at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Extremes {
    /// The largest magnitude of the pressure `-tr(sigma)/3`.
    pub pressure: f64,
    /// Its quotient by the shear modulus at rest.
    pub pressure_over_mu: f64,
    /// The largest shear strain: half the difference of the largest and the least principal stretch.
    pub shear: f64,
    /// The largest `|J - 1|`.
    pub change_of_volume: f64,
    /// Lame's constants' quotient at rest.
    pub lambda_over_mu: f64,
    /// The least stiffness of a plane wave over the P-wave modulus at rest. Where it is not above zero the equations are not elliptic, and the
    /// shortest waves grow most, however small the pressure is.
    pub wave_stiffness: f64,
}

impl Extremes {
    /// Whether no disturbance is driven on: the pressure is small, and all plane waves are stiff.
    #[must_use]
    pub fn are_harmless(&self) -> bool {
        self.pressure_over_mu <= HARMLESS_PRESSURE && self.wave_stiffness > 0.0
    }
}

/// The pressure over the shear modulus up to which growth is not looked for where nobody asks for it.
///
/// A pressure p that varies as a half wave over a body of length l has a second gradient of `p (pi/l)^2`, and the longest wave without divergence
/// that the sides hold has the stiffness `2 mu (pi/l)^2` by shear: it does not grow below `p = 2 mu`. Pressures of shorter waves have larger
/// second gradients; in swirl, whose pressure has waves of a quarter of the body, `p = 5 mu` makes errors three times as large in a quarter period.
const HARMLESS_PRESSURE: f64 = 2.0;

/// Rates of growth at times of a motion.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rates {
    /// The times' distance.
    span: f64,
    /// For each time the largest `-e/rho`, e the least eigenvalue of the pressure's second gradient.
    rates: Vec<f64>,
    /// The square of the speed of shear waves.
    shear_speed: f64,
}

impl Rates {
    /// e to the integral of the rates of waves of a wave number.
    pub(crate) fn growth(&self, wave_number: f64) -> f64 {
        let held = self.shear_speed * wave_number * wave_number;
        let sum: f64 = self.rates.iter().map(|rate| (rate - held).max(0.0).sqrt()).sum();
        (sum * self.span).exp()
    }
}

/// The extremes of a motion until so many periods, and its rates; none for a shape that is not known.
pub(crate) fn extremes<const D: usize>(
    exact: &dyn Solution<f64, D>,
    law: &Law<f64, D>,
    periods: f64,
) -> Option<(Extremes, Rates)>
where
    f64: Precision<D>,
{
    const PLACES: usize = 96;
    const TIMES: usize = 32;
    let end = periods * exact.period();
    // Periodic motion repeats.
    let span = end.min(exact.period());
    let domain = exact.domain();
    let (lambda, mu) = moduli(law);
    let step = 5e-3 * points::size(&domain)? / (D as f64).sqrt();
    let mut found = Extremes {
        pressure: 0.0,
        pressure_over_mu: 0.0,
        shear: 0.0,
        change_of_volume: 0.0,
        lambda_over_mu: lambda / mu,
        wave_stiffness: f64::INFINITY,
    };
    let at_rest = law.p_wave_modulus().abs();
    let mut rates = vec![0.0_f64; TIMES];
    for n in 0..PLACES {
        let (X, _) = points::interior(&domain, span, n)?;
        for (k, rate) in rates.iter_mut().enumerate() {
            let t = span * (k as f64 + 0.5) / TIMES as f64;
            let F = exact.deformation_gradient(&X, t);
            let Some(p) = pressure(law, &F) else { continue };
            found.pressure = found.pressure.max(p.abs());
            found.shear = found.shear.max(shear(&F));
            let J = exact.jacobian(&X, t);
            found.change_of_volume = found.change_of_volume.max((J - 1.0).abs());
            found.wave_stiffness = found.wave_stiffness.min(wave_stiffness(law, &F) / at_rest);
            let least = -least_eigenvalue(&second_gradient(exact, law, &X, t, step));
            *rate = rate.max(least * J / exact.density());
        }
    }
    found.pressure_over_mu = found.pressure / mu.abs();
    let rates = Rates { span: end / TIMES as f64, rates, shear_speed: mu / exact.density() };
    Some((found, rates))
}

/// Whether a few places and times of a motion until so many periods show [no disturbance that is driven on](Extremes::are_harmless).
pub(crate) fn is_harmless<const D: usize>(
    exact: &dyn Solution<f64, D>,
    law: &Law<f64, D>,
    periods: f64,
) -> bool
where
    f64: Precision<D>,
{
    const SAMPLES: usize = 128;
    let span = exact.period() * periods.min(1.0);
    let (_, mu) = moduli(law);
    let places = (0..SAMPLES).filter_map(|n| points::interior(&exact.domain(), span, n));
    places.map(|(X, t)| exact.deformation_gradient(&X, t)).all(|F| {
        let pressure = pressure(law, &F).map_or(0.0, f64::abs);
        pressure <= HARMLESS_PRESSURE * mu.abs() && wave_stiffness(law, &F) > 0.0
    })
}

/// The least stiffness of plane waves along axes and diagonals in a state of deformation: the least eigenvalue of their acoustic tensors
/// `Q_ik = dP_iJ/dF_kL N_J N_L`, by differences. Infinite where the law has no stress.
fn wave_stiffness<const D: usize>(law: &Law<f64, D>, F: &SMatrix<f64, D, D>) -> f64
where
    f64: Precision<D>,
{
    const STEP: f64 = 1e-5;
    let along = |N: &SVector<f64, D>| -> Option<f64> {
        let mut Q = SMatrix::<f64, D, D>::zeros();
        for k in 0..D {
            let by = SMatrix::from_fn(|i, J| if i == k { STEP * N[J] } else { 0.0 });
            let [more, less] = [F + by, F - by].map(|F| law.first_piola_kirchhoff(&F));
            Q.set_column(k, &((more? - less?) * N / (2.0 * STEP)));
        }
        // Of axes that F leaves out: no less than the largest eigenvalue.
        let large = Q.norm();
        let padded = SMatrix::<f64, 3, 3>::from_fn(|i, j| match (i < D && j < D, i == j) {
            (true, _) => 0.5 * (Q[(i, j)] + Q[(j, i)]),
            (false, same) => {
                if same {
                    large
                } else {
                    0.0
                }
            }
        });
        large.is_finite().then(|| least_eigenvalue(&padded))
    };
    // Directions of axes and of diagonals of two axes, each once.
    let directions = (0..D).flat_map(|a| (0..=a).map(move |b| (a, b)));
    let both_ways = directions.flat_map(|(a, b)| {
        let of = move |sign: f64| {
            let mut N = SVector::<f64, D>::zeros();
            N[a] = 1.0;
            N[b] += if a == b { 0.0 } else { sign };
            N / N.norm()
        };
        [of(1.0), of(-1.0)].into_iter().take(if a == b { 1 } else { 2 })
    });
    both_ways.filter_map(|N| along(&N)).fold(f64::INFINITY, f64::min)
}

/// Lame's constants at rest; of a law that does not tell them those of a stretch and a shear along the axes.
pub(crate) fn moduli<const D: usize>(law: &Law<f64, D>) -> (f64, f64)
where
    f64: Precision<D>,
{
    if let Some(both) = law.lame_constants() {
        return both;
    }
    let of = |i: usize, j: usize| {
        let mut H = SMatrix::<f64, D, D>::zeros();
        H[(i, j)] = 1.0;
        law.stress_at_small_strain(&H)[(i, j)]
    };
    let modulus = law.p_wave_modulus();
    let mu = if D > 1 { of(0, 1) } else { 0.5 * modulus };
    (modulus - 2.0 * mu, mu)
}

/// The pressure of a deformation.
fn pressure<const D: usize>(law: &Law<f64, D>, F: &SMatrix<f64, D, D>) -> Option<f64>
where
    f64: Precision<D>,
{
    Some(-law.cauchy_in_space(F)?.trace() / 3.0)
}

/// Half the difference of the largest and the least principal stretch, with unit stretch across the axes that F leaves out.
fn shear<const D: usize>(F: &SMatrix<f64, D, D>) -> f64 {
    let (mut most, mut least) = if D < 3 { (1.0_f64, 1.0_f64) } else { (0.0, f64::MAX) };
    let C = F.transpose() * F;
    let C =
        SMatrix::<f64, 3, 3>::from_fn(
            |i, j| {
                if i < D && j < D { C[(i, j)] } else { f64::from(i == j) }
            },
        );
    for stretch in C.symmetric_eigenvalues().iter().map(|square| square.max(0.0).sqrt()) {
        (most, least) = (most.max(stretch), least.min(stretch));
    }
    0.5 * (most - least)
}

/// The second gradient of the pressure in the current configuration, by differences.
fn second_gradient<const D: usize>(
    exact: &dyn Solution<f64, D>,
    law: &Law<f64, D>,
    X: &SVector<f64, D>,
    t: f64,
    step: f64,
) -> SMatrix<f64, 3, 3>
where
    f64: Precision<D>,
{
    let p =
        |X: &SVector<f64, D>| pressure(law, &exact.deformation_gradient(X, t)).unwrap_or(f64::NAN);
    let along = |k: usize, by: f64| {
        let mut moved = SVector::<f64, D>::zeros();
        moved[k] = by;
        moved
    };
    // In the current configuration: grad_x p = F^-T grad_X p.
    let gradient = |X: &SVector<f64, D>| -> SVector<f64, D> {
        let of_reference = SVector::<f64, D>::from_fn(|k, _| {
            (p(&(X + along(k, step))) - p(&(X - along(k, step)))) / (2.0 * step)
        });
        turned(&exact.deformation_gradient(X, t), &of_reference)
    };
    let rows: [SVector<f64, D>; D] = std::array::from_fn(|k| {
        (gradient(&(X + along(k, step))) - gradient(&(X - along(k, step)))) / (2.0 * step)
    });
    let F = exact.deformation_gradient(X, t);
    let columns: [SVector<f64, D>; D] =
        std::array::from_fn(|i| turned(&F, &SVector::from_fn(|k, _| rows[k][i])));
    SMatrix::<f64, 3, 3>::from_fn(|i, j| {
        if i < D && j < D { 0.5 * (columns[i][j] + columns[j][i]) } else { 0.0 }
    })
}

/// `F^-T g`; not a number where F has no inverse.
fn turned<const D: usize>(F: &SMatrix<f64, D, D>, g: &SVector<f64, D>) -> SVector<f64, D> {
    let in_space =
        SMatrix::<f64, 3, 3>::from_fn(
            |i, j| {
                if i < D && j < D { F[(j, i)] } else { f64::from(i == j) }
            },
        );
    let g = SVector::<f64, 3>::from_fn(|i, _| if i < D { g[i] } else { 0.0 });
    let solved = in_space.try_inverse().map(|inverse| inverse * g);
    SVector::from_fn(|i, _| solved.map_or(f64::NAN, |solved| solved[i]))
}

/// The least eigenvalue.
fn least_eigenvalue(tensor: &SMatrix<f64, 3, 3>) -> f64 {
    if tensor.iter().any(|value| !value.is_finite()) {
        return 0.0;
    }
    tensor.symmetric_eigenvalues().min()
}
