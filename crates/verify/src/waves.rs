//! The speeds of waves in a body, at rest and along its motion, and the viscosity of its law.

use mmsmith_mpm::Law;
use mmsmith_runtime::Solution;
use nalgebra::{SMatrix, SVector};

use crate::case::{CflSpeed, law_of_body};
use crate::error::{CaseError, SceneError};
use crate::points;
use crate::precision::Precision;

impl CflSpeed {
    /// The speed on a grid with cells of the length `spacing`.
    ///
    /// The fastest oscillation of a grid, `omega = 2c/h`, is damped by viscosity with the ratio `zeta = eta omega/(2 rho0 c^2)`. An
    /// explicit step with the rates of the step before is stable up to `2 (sqrt(1 + zeta^2) - zeta)/omega`, which is `h` over
    /// `v + sqrt(c^2 + v^2)` with `v = eta/(rho0 h)`. Particles keep a share `s` of what an acceleration changes at the nodes, and the
    /// rate follows the nodes: then the largest factor `g` of damping in a step is `2/(2 - s)` in place of 2, from
    /// `lambda^2 - (1 - g) lambda - g (1 - s) = 0`, and one for the shortest waves. So `v` counts twice.
    pub(crate) fn on_grid<const D: usize>(
        self,
        exact: &dyn Solution<f64, D>,
        spacing: f64,
    ) -> Result<f64, CaseError>
    where
        f64: Precision<D>,
    {
        let wave = self.on_wide_cells(exact)?;
        if self != Self::Viscous {
            return Ok(wave);
        }
        let viscous = 2.0 * largest_viscous_modulus(exact)? / (exact.density() * spacing);
        Ok(viscous + wave.hypot(viscous))
    }

    /// The speed where cells are so wide that viscosity has no part in it.
    pub(crate) fn on_wide_cells<const D: usize>(
        self,
        exact: &dyn Solution<f64, D>,
    ) -> Result<f64, CaseError>
    where
        f64: Precision<D>,
    {
        match self {
            Self::Bar => Ok(exact.wave_speed()),
            Self::PWave | Self::Viscous => {
                let law = law_of_body::<f64, D>(exact)?;
                let modulus = p_wave_modulus(&law, exact);
                match modulus > 0.0 {
                    true => Ok((modulus / exact.density()).sqrt()),
                    false => Err(SceneError::NoStiffness { modulus }.into()),
                }
            }
        }
    }
}

/// The modulus of P-waves in the body at rest; of a law that differs from place to place the largest one at sampled places.
fn p_wave_modulus<const D: usize>(law: &Law<f64, D>, exact: &dyn Solution<f64, D>) -> f64
where
    f64: Precision<D>,
{
    const PLACES: usize = 64;
    let Law::WithMemory(own) = law else { return law.p_wave_modulus() };
    if own.elastic().is_some() {
        return law.p_wave_modulus();
    }
    let places = (0..PLACES).filter_map(|n| points::interior(&exact.domain(), 1.0, n));
    places.map(|(X, _)| law.with_variables(&own.initial(&X)).p_wave_modulus()).fold(0.0, f64::max)
}

/// The speed of the fastest waves along the axes in the deformed body, at sampled places and times of the exact motion and at rest.
pub(crate) fn fastest_p_wave<const D: usize>(
    exact: &dyn Solution<f64, D>,
    periods: f64,
) -> Result<f64, CaseError>
where
    f64: Precision<D>,
{
    let law = law_of_body::<f64, D>(exact)?;
    // A fluid at rest has no such waves.
    let at_rest = (p_wave_modulus(&law, exact).max(0.0) / exact.density()).sqrt();
    // Periodic motion repeats.
    let span = exact.period() * periods.min(1.0);
    let modulus = (0..SAMPLES)
        .filter_map(|n| points::interior(&exact.domain(), span, n))
        .map(|(X, t)| largest_modulus(&law, &exact.deformation_gradient(&X, t)))
        .fold(0.0, f64::max);
    Ok(at_rest.max((modulus / exact.density()).sqrt()))
}

/// How many places and times of a motion are looked at.
const SAMPLES: usize = 256;

/// The largest change of the first Piola-Kirchhoff stress with the rate of the deformation gradient over waves along the axes, at sampled
/// places and times of the exact motion: the modulus `eta` of viscosity, stress times time. Zero for laws without rates.
pub(crate) fn largest_viscous_modulus<const D: usize>(
    exact: &dyn Solution<f64, D>,
) -> Result<f64, CaseError>
where
    f64: Precision<D>,
{
    let law = law_of_body::<f64, D>(exact)?;
    let Law::WithMemory(own) = &law else { return Ok(0.0) };
    let modulus = |X: &SVector<f64, D>, t: f64| {
        let F = exact.deformation_gradient(X, t);
        largest_eigenvalue_along_axes(&F, |rate| {
            let mut variables = own.initial(X);
            own.start_at_rate(rate, &mut variables);
            law.with_variables(&variables).first_piola_kirchhoff(&F)
        })
    };
    let moduli = (0..SAMPLES)
        .filter_map(|n| points::interior(&exact.domain(), exact.period(), n))
        .map(|(X, t)| modulus(&X, t));
    Ok(moduli.fold(0.0, f64::max))
}

/// The largest eigenvalue of the acoustic tensors `A` of waves along the axes in a body deformed by `F`, per volume at rest: the speed of
/// a wave is the root of its quotient by the reference density. Zero where the law has no finite stress.
fn largest_modulus<const D: usize>(law: &Law<f64, D>, F: &SMatrix<f64, D, D>) -> f64
where
    f64: Precision<D>,
{
    largest_eigenvalue_along_axes(F, |change| law.first_piola_kirchhoff(&(F + change)))
}

/// The largest eigenvalue of the tensors that tell how the traction on a surface across each axis follows small changes which vary along
/// that axis; `stress` is the first Piola-Kirchhoff stress at such a change. Zero where it has no finite value.
fn largest_eigenvalue_along_axes<const D: usize>(
    F: &SMatrix<f64, D, D>,
    stress: impl Fn(&SMatrix<f64, D, D>) -> Option<SMatrix<f64, D, D>>,
) -> f64 {
    let along = |axis: usize| -> Option<f64> {
        let normal = F.row(axis).transpose();
        let step = 1e-6 / normal.norm().max(1.0);
        let mut tensor = SMatrix::<f64, D, D>::zeros();
        for j in 0..D {
            let mut change = SMatrix::<f64, D, D>::zeros();
            change.set_row(j, &(normal.transpose() * step));
            let [Some(above), Some(below)] = [stress(&change), stress(&-change)] else {
                return None;
            };
            tensor.set_column(j, &((above - below) * normal / (2.0 * step)));
        }
        Some(largest_eigenvalue(&tensor))
    };
    (0..D).filter_map(along).filter(|modulus| modulus.is_finite()).fold(0.0, f64::max)
}

/// The largest eigenvalue of a symmetric tensor of positive ones, by powers.
fn largest_eigenvalue<const D: usize>(tensor: &SMatrix<f64, D, D>) -> f64 {
    // No axis of symmetry lies across it.
    let mut direction = SVector::<f64, D>::from_fn(|i, _| 1.0 + 0.3 * i as f64).normalize();
    for _ in 0..24 {
        let next = tensor * direction;
        match next.try_normalize(f64::MIN_POSITIVE) {
            Some(next) => direction = next,
            None => return 0.0,
        }
    }
    direction.dot(&(tensor * direction))
}

#[cfg(test)]
mod tests {
    use mmsmith_runtime::AnySolution;

    use super::*;

    #[test]
    fn waves_of_a_solid_at_rest_have_the_p_wave_modulus() {
        let exact = mmsmith_solutions::build::<f64>("axis-aligned-3d", &[]).unwrap().unwrap();
        let AnySolution::Three(exact) = exact else { panic!("it is solid") };
        let law = law_of_body::<f64, 3>(exact.as_ref()).unwrap();
        let modulus = largest_modulus(&law, &SMatrix::identity());
        assert!((modulus / law.p_wave_modulus() - 1.0).abs() < 1e-6, "{modulus}");
    }
}
