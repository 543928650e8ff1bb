//! Velocities that disturb a motion.

use std::f64::consts::{PI, TAU};

use mmsmith_galerkin::{Coordinates, End, Grid};
use mmsmith_runtime::Solution;
use mmsmith_runtime::nalgebra::SVector;

/// Coordinates of a place on a grid.
fn coordinates<const D: usize>(grid: &Grid<D>, X: &SVector<f64, D>) -> SVector<f64, D> {
    match grid.coordinates {
        Coordinates::Cartesian => *X,
        Coordinates::Polar => {
            let full = grid.axes[1].upper > PI;
            let angle = X[1].atan2(X[0]);
            let angle = if full { angle.rem_euclid(TAU) } else { angle };
            SVector::from_fn(|k, _| if k == 0 { X.norm() } else { angle })
        }
        Coordinates::Cylindrical => {
            let angle = X[1].atan2(X[0]);
            let turned = angle.rem_euclid(TAU);
            let [from, to] = [grid.axes[1].lower, grid.axes[1].upper];
            let angle = if (from..=to).contains(&angle) { angle } else { turned };
            SVector::from_fn(|k, _| [X[0].hypot(X[1]), angle, X[2]][k])
        }
        Coordinates::Spherical => {
            let (R, across) = (X.norm(), X[0].hypot(X[1]));
            SVector::from_fn(|k, _| [R, across.atan2(X[2]), X[1].atan2(X[0])][k])
        }
    }
}

/// `sin^2(pi s) sin(2 pi n s)` and its slope: a wave that vanishes with its slope at the ends.
fn wave(s: f64, count: usize) -> [f64; 2] {
    let k = TAU * count as f64;
    let (sin, cos) = (PI * s).sin_cos();
    let (sin_k, cos_k) = (k * s).sin_cos();
    [sin * sin * sin_k, TAU * sin * cos * sin_k + k * sin * sin * cos_k]
}

/// A velocity without divergence in the configuration at time zero, in waves, that vanishes on the boundary: `F Curl A / J` with
/// the vector potential `A = psi (1, 1, 1)`, or `psi e_z` in the plane, psi the product of [`wave`]s along the grid's axes. In one dimension it is
/// psi itself.
pub(super) fn disturbance<const D: usize>(
    exact: &dyn Solution<f64, D>,
    grid: &Grid<D>,
    positions: &[SVector<f64, D>],
    count: usize,
) -> Vec<SVector<f64, D>> {
    let along = |place: &SVector<f64, D>| -> [[f64; 2]; D] {
        let q = coordinates(grid, place);
        std::array::from_fn(|k| {
            let axis = &grid.axes[k];
            if axis.ends == [End::Uniform; 2] {
                return [1.0, 0.0];
            }
            let length = axis.upper - axis.lower;
            let [value, slope] = wave((q[k] - axis.lower) / length, count);
            [value, slope / length]
        })
    };
    let potential = |X: &SVector<f64, D>| along(X).iter().map(|[value, _]| value).product::<f64>();
    // Differences do where the gradient has to be turned anyway.
    let gradient = |X: &SVector<f64, D>| -> SVector<f64, D> {
        let waves = along(X);
        if grid.coordinates == Coordinates::Cartesian {
            return SVector::from_fn(|k, _| {
                (0..D).map(|j| waves[j][usize::from(j == k)]).product()
            });
        }
        let step = 1e-6 * X.norm();
        SVector::from_fn(|k, _| {
            let mut moved = SVector::zeros();
            moved[k] = step;
            (potential(&(X + moved)) - potential(&(X - moved))) / (2.0 * step)
        })
    };
    let velocity = |X: &SVector<f64, D>| -> SVector<f64, D> {
        if D == 1 {
            return SVector::repeat(potential(X));
        }
        let g = gradient(X);
        let curl = SVector::<f64, D>::from_fn(|k, _| match (D, k) {
            (2, 0) => g[1],
            (2, _) => -g[0],
            _ => g[(k + 1) % D] - g[(k + 2) % D],
        });
        exact.deformation_gradient(X, 0.0) * curl / exact.jacobian(X, 0.0)
    };
    positions.iter().map(velocity).collect()
}

/// A velocity that has a part of every wave.
pub(super) fn mixed<const D: usize>(positions: &[SVector<f64, D>]) -> Vec<SVector<f64, D>> {
    let mut state = 1_u64;
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    positions.iter().map(|_| SVector::from_fn(|_, _| next())).collect()
}
