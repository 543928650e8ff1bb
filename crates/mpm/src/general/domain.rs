//! Domains of particles: their corners, and the means over them of functions that are interpolated between the corners.
//!
//! Where a hat function is replaced by its interpolation between the corners `x_c`, its mean over the domain is
//! `sum_c w_c phi_i(x_c)` and that of its gradient `sum_c g_c phi_i(x_c)`.

use nalgebra::{SMatrix, SVector};

use crate::tensor::{determinant, inverse_transpose};

/// A corner: its position, its share `w` of a mean, and its share `g` of a mean gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corner<const D: usize> {
    pub(crate) x: SVector<f64, D>,
    pub(crate) w: f64,
    pub(crate) g: SVector<f64, D>,
}

impl<const D: usize> Corner<D> {
    pub(crate) fn none() -> Self {
        Self { x: SVector::zeros(), w: 0.0, g: SVector::zeros() }
    }
}

/// Corner `index` of the parallelogram `x + E s`, `|s_a| <= 1`, which must have a volume.
pub(crate) fn of_parallelogram<const D: usize>(
    x: &SVector<f64, D>,
    E: &SMatrix<f64, D, D>,
    index: usize,
) -> Corner<D> {
    let side = |a: usize| if index >> a & 1 == 1 { 1.0 } else { -1.0 };
    let s = SVector::from_fn(|a, _| side(a));
    let w = 1.0 / f64::from(1 << D);
    // The mean of d/ds_a of prod (1 + s_a s)/2 is w s_a, and d/dx = E^-T d/ds.
    Corner { x: x + E * s, w, g: inverse_transpose(E, determinant(E)) * (s * w) }
}

/// The half-sizes of the smallest box around a parallelogram.
pub(crate) fn extent<const D: usize>(E: &SMatrix<f64, D, D>) -> SVector<f64, D> {
    SVector::from_fn(|a, _| E.row(a).iter().map(|e| e.abs()).sum())
}

/// The corners of a segment (the first two places) or of a quadrilateral, and its length or area, which must not be zero
/// for the corners to have a meaning.
///
/// The map from the square is bilinear, and its determinant linear: means are exact. With `T_c` the area of the triangle at
/// corner c between its neighbours and A the area of all, `w_c = 1/6 + T_c / (6 A)`.
pub(crate) fn of_polygon<const D: usize>(x: &[SVector<f64, D>; 4]) -> ([Corner<D>; 4], f64) {
    let mut corners = [Corner::none(); 4];
    if D == 1 {
        let length = x[1][0] - x[0][0];
        for (k, sign) in [-1.0, 1.0].into_iter().enumerate() {
            corners[k] = Corner { x: x[k], w: 0.5, g: SVector::repeat(sign / length) };
        }
        return (corners, length);
    }
    let cross = |a: SVector<f64, D>, b: SVector<f64, D>| a[0] * b[1] - a[1] * b[0];
    let area = 0.5 * cross(x[2] - x[0], x[3] - x[1]);
    for k in 0..4 {
        let (next, last) = (x[(k + 1) % 4], x[(k + 3) % 4]);
        let triangle = 0.5 * cross(next - x[k], last - x[k]);
        // The normals of the two sides at the corner, each with half of its length.
        let across = next - last;
        let normal = SVector::from_fn(|a, _| if a == 0 { across[1] } else { -across[0] });
        corners[k] = Corner { x: x[k], w: (1.0 + triangle / area) / 6.0, g: normal * (0.5 / area) };
    }
    (corners, area)
}
