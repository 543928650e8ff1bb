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
}

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
    };
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
            let least = -least_eigenvalue(&second_gradient(exact, law, &X, t, step));
            *rate = rate.max(least * J / exact.density());
        }
    }
    found.pressure_over_mu = found.pressure / mu;
    let rates = Rates { span: end / TIMES as f64, rates, shear_speed: mu / exact.density() };
    Some((found, rates))
}

/// The largest pressure over the shear modulus at a few places and times of a motion until so many periods.
pub(crate) fn largest_pressure<const D: usize>(
    exact: &dyn Solution<f64, D>,
    law: &Law<f64, D>,
    periods: f64,
) -> f64
where
    f64: Precision<D>,
{
    const SAMPLES: usize = 128;
    let span = exact.period() * periods.min(1.0);
    let places = (0..SAMPLES).filter_map(|n| points::interior(&exact.domain(), span, n));
    let pressures = places.filter_map(|(X, t)| pressure(law, &exact.deformation_gradient(&X, t)));
    let (_, mu) = moduli(law);
    pressures.fold(0.0_f64, |largest, p| largest.max(p.abs())) / mu
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
