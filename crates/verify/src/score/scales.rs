//! How large fields are, and which errors rounding alone may cause.

use std::collections::BTreeMap;

use mmsmith_runtime::Solution;
use nalgebra::{SMatrix, SVector};

use super::quantity::Quantity;

/// Points of a frame at which fields are looked at.
const SAMPLES: usize = 64;
/// Roundings of a double that a solver may gather, as a share of a field's largest value.
const GATHERED: f64 = 4096.0 * f64::EPSILON;
/// Roundings of what a field is formed from, such as of 1 + H.
const FORMED: f64 = 16.0 * f64::EPSILON;
/// Roundings of the numbers of a file.
const WRITTEN: f64 = 2.0;

/// How finely the numbers of a recording are written, as shares of their size; zero for doubles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Grain {
    pub(super) points: f64,
    /// In the order of [`Quantity::ALL`].
    pub(super) fields: [f64; 8],
    /// Whether displacements are differences of positions.
    pub(super) u_is_difference: bool,
}

/// The largest values of fields at some of the points, over the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Scales {
    X: f64,
    u: f64,
    v: f64,
    H: f64,
    P: f64,
}

impl Scales {
    /// Looks at a frame.
    pub(super) fn add<const D: usize>(
        &mut self,
        exact: &dyn Solution<f64, D>,
        X: &[SVector<f64, D>],
        time: f64,
    ) {
        let larger = |one: &mut f64, other: f64| *one = one.max(other);
        let is_finite = |X: &&SVector<f64, D>| X.iter().all(|value| value.is_finite());
        for X in X.iter().step_by(X.len().div_ceil(SAMPLES).max(1)).filter(is_finite) {
            larger(&mut self.X, X.norm());
            larger(&mut self.u, exact.displacement(X, time).norm());
            larger(&mut self.v, exact.velocity(X, time).norm());
            let F = exact.deformation_gradient(X, time);
            larger(&mut self.H, (F - SMatrix::identity()).norm());
            larger(&mut self.P, exact.first_piola_kirchhoff(X, time).norm());
        }
    }

    /// Whether displacements of this size are more than rounding of positions.
    pub(super) fn is_motion(&self, displacement: f64) -> bool {
        displacement > GATHERED * self.X
    }

    /// For each field the error that rounding alone may cause.
    pub(super) fn floors<const D: usize>(
        &self,
        exact: &dyn Solution<f64, D>,
        grain: &Grain,
    ) -> BTreeMap<Quantity, f64> {
        let (density, speed) = (exact.density(), exact.wave_speed());
        let stiffness = density * speed * speed;
        // A body at rest has rounding in its velocities too.
        let v = self.v.max(self.u * speed / exact.cell_length());
        let positions = if grain.u_is_difference { self.X } else { 0.0 };
        let floor = |(field, own): (Quantity, f64)| {
            // What changes, what it is formed from, and what the file's numbers are roundings of.
            let (change, whole, written) = match field {
                Quantity::Displacement => {
                    (self.u, positions, grain.points * positions + own.max(grain.points) * self.u)
                }
                Quantity::Velocity => (v, 0.0, own * v),
                Quantity::DeformationGradient | Quantity::VolumeRatio => {
                    (self.H, 1.0, own * (1.0 + self.H))
                }
                Quantity::FirstPiolaKirchhoff | Quantity::Cauchy | Quantity::Kirchhoff => {
                    (self.P, stiffness, own * self.P)
                }
                Quantity::Density => (density * self.H, density, own * density * (1.0 + self.H)),
            };
            (field, GATHERED * change + FORMED * whole + WRITTEN * written)
        };
        Quantity::ALL.into_iter().zip(grain.fields).map(floor).collect()
    }
}
