//! Coordinate systems of a grid: positions and unit vectors, lengths and volumes, gradients of components.
//!
//! Unknowns are components along the coordinates' unit vectors, which change from place to place; so a gradient has terms
//! with the components themselves, and the forces have terms with the functions' values (Ogden, "Non-Linear Elastic
//! Deformations" (1984), section 1.5). With `u_k` and their derivatives by the coordinates:
//!
//! ```text
//! polar      H = | u_R,R   (u_R,th - u_th)/R |
//!                | u_th,R  (u_th,th + u_R)/R |
//!
//! cylindrical    | u_R,R   (u_R,th - u_th)/R   u_R,Z  |
//!            H = | u_th,R  (u_th,th + u_R)/R   u_th,Z |
//!                | u_Z,R   u_Z,th/R            u_Z,Z  |
//!
//! spherical      | u_R,R   (u_R,th - u_th)/R  (u_R,ph/sin th - u_ph)/R           |
//!            H = | u_th,R  (u_th,th + u_R)/R  (u_th,ph/sin th - u_ph cot th)/R   |
//!                | u_ph,R  u_ph,th/R          (u_ph,ph/sin th + u_R + u_th cot th)/R |
//! ```

use mmsmith_scalar_functions::ScalarFunctions;
use std::f64::consts::PI;

use mmsmith_particles::SetupError;
use nalgebra::{SMatrix, SVector};

/// The coordinate system of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// Reference positions.
    Cartesian,
    /// Radius and angle of the reference position, in two dimensions. Unknowns are the components along `e_R` and
    /// `e_theta` at the reference position, so that planes of symmetry through the origin are ends of the angle's axis.
    Polar,
    /// Polar coordinates in the plane of the first two axes, and the reference position along the third, in three dimensions. Unknowns are
    /// the components along `e_R`, `e_theta` and `e_Z`. The radius may begin at the axis, where no particle lies.
    Cylindrical,
    /// Radius, polar angle from the third axis, and azimuth from the first of the reference position, in three dimensions.
    /// Unknowns are the components along `e_R`, `e_theta` and `e_phi` there, so that planes of symmetry through the third
    /// axis are ends of the azimuth's axis, and that across it is the end of the polar angle's axis at a right angle: the
    /// only place where the polar angle may end at a [wall](super::End::Wall), since a cone mirrors nothing.
    ///
    /// The third axis itself, where cells have no width and components no limit, is no part of any grid: the polar angle
    /// runs from more than 0 to less than pi.
    Spherical,
}

/// Factors common to the particles in a row along axis 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowGeometry<const D: usize> {
    /// Columns are the unit vectors of the components.
    pub(crate) frame: SMatrix<f64, D, D>,
    /// `1/sin(theta)` and `cot(theta)` of the polar angle; one and zero in polar coordinates.
    cosecant: f64,
    pub(crate) cotangent: f64,
}

impl Coordinates {
    /// Whether components belong to unit vectors that change from place to place.
    pub(crate) fn are_curvilinear(self) -> bool {
        self != Self::Cartesian
    }

    /// The Cartesian position.
    pub(crate) fn place<const D: usize>(self, coordinates: &SVector<f64, D>) -> SVector<f64, D> {
        match self.frame(coordinates) {
            None => *coordinates,
            Some(frame) => {
                let mut place = frame.column(0) * coordinates[0];
                if self == Self::Cylindrical {
                    place[D - 1] = coordinates[D - 1];
                }
                place
            }
        }
    }

    /// The unit vectors that components belong to, as columns; `None` where they are Cartesian.
    pub(crate) fn frame<const D: usize>(
        self,
        coordinates: &SVector<f64, D>,
    ) -> Option<SMatrix<f64, D, D>> {
        match self {
            Self::Cartesian => None,
            Self::Polar | Self::Cylindrical => {
                let (sin, cos) = (coordinates[1].sine(), coordinates[1].cosine());
                Some(SMatrix::from_fn(|i, k| match (i, k) {
                    (0, 1) => -sin,
                    (1, 0) => sin,
                    (2, 2) => 1.0,
                    (2, _) | (_, 2) => 0.0,
                    _ => cos,
                }))
            }
            Self::Spherical => {
                let (sin, cos) = (coordinates[1].sine(), coordinates[1].cosine());
                let (sin_phi, cos_phi) = (coordinates[2].sine(), coordinates[2].cosine());
                Some(SMatrix::from_fn(|i, k| match (i, k) {
                    (0, 0) => sin * cos_phi,
                    (1, 0) => sin * sin_phi,
                    (2, 0) => cos,
                    (0, 1) => cos * cos_phi,
                    (1, 1) => cos * sin_phi,
                    (2, 1) => -sin,
                    (0, 2) => -sin_phi,
                    (1, 2) => cos_phi,
                    _ => 0.0,
                }))
            }
        }
    }

    /// Factors common to the particles whose coordinates differ from these by the first; `None` where components are Cartesian.
    pub(crate) fn row<const D: usize>(
        self,
        coordinates: &SVector<f64, D>,
    ) -> Option<RowGeometry<D>> {
        let frame = self.frame(coordinates)?;
        let [cosecant, cotangent] = match self {
            Self::Cartesian | Self::Polar | Self::Cylindrical => [1.0, 0.0],
            Self::Spherical => {
                let (sin, cos) = (coordinates[1].sine(), coordinates[1].cosine());
                [sin.recip(), cos / sin]
            }
        };
        Some(RowGeometry { frame, cosecant, cotangent })
    }

    /// Lengths per unit of each coordinate.
    pub(crate) fn scales<const D: usize>(self, coordinates: &SVector<f64, D>) -> SVector<f64, D> {
        let mut scales = SVector::repeat(1.0);
        match self {
            Self::Cartesian => {}
            Self::Polar | Self::Cylindrical => scales[1] = coordinates[0],
            Self::Spherical => {
                scales[1] = coordinates[0];
                scales[2] = coordinates[0] * coordinates[1].sine();
            }
        }
        scales
    }

    /// The factor of the volume that belongs to axis `k`; the product over the axes is that of the scales.
    pub(crate) fn density(self, k: usize, coordinate: f64) -> f64 {
        match (self, k) {
            (Self::Polar | Self::Cylindrical, 0) => coordinate,
            (Self::Spherical, 0) => coordinate * coordinate,
            (Self::Spherical, 1) => coordinate.sine(),
            _ => 1.0,
        }
    }

    /// The displacement gradient in the coordinates' basis, from the components and their derivatives by the coordinates.
    #[inline(always)]
    pub(crate) fn gradient<const D: usize>(
        self,
        u: &SVector<f64, D>,
        slopes: &SMatrix<f64, D, D>,
        reciprocal_radius: f64,
        row: &RowGeometry<D>,
    ) -> SMatrix<f64, D, D> {
        let mut H = *slopes;
        match self {
            Self::Cartesian => {}
            Self::Polar | Self::Cylindrical => {
                H[(0, 1)] = (slopes[(0, 1)] - u[1]) * reciprocal_radius;
                H[(1, 1)] = (slopes[(1, 1)] + u[0]) * reciprocal_radius;
                if D == 3 {
                    H[(2, 1)] = slopes[(2, 1)] * reciprocal_radius;
                }
            }
            Self::Spherical => {
                let RowGeometry { cosecant, cotangent, .. } = *row;
                H[(0, 1)] = (slopes[(0, 1)] - u[1]) * reciprocal_radius;
                H[(1, 1)] = (slopes[(1, 1)] + u[0]) * reciprocal_radius;
                H[(2, 1)] = slopes[(2, 1)] * reciprocal_radius;
                H[(0, 2)] = (slopes[(0, 2)] * cosecant - u[2]) * reciprocal_radius;
                H[(1, 2)] = (slopes[(1, 2)] * cosecant - u[2] * cotangent) * reciprocal_radius;
                H[(2, 2)] =
                    (slopes[(2, 2)] * cosecant + u[0] + u[1] * cotangent) * reciprocal_radius;
            }
        }
        H
    }

    /// A force per gradient as forces per component and per derivative by the coordinates: the transpose of [`gradient`](Self::gradient).
    #[inline(always)]
    pub(crate) fn transposed_gradient<const D: usize>(
        self,
        force: &SMatrix<f64, D, D>,
        reciprocal_radius: f64,
        row: &RowGeometry<D>,
    ) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let (mut values, mut slopes) = (SVector::zeros(), *force);
        match self {
            Self::Cartesian => {}
            Self::Polar | Self::Cylindrical => {
                for c in 0..D {
                    slopes[(c, 1)] *= reciprocal_radius;
                }
                values[0] = force[(1, 1)] * reciprocal_radius;
                values[1] = -force[(0, 1)] * reciprocal_radius;
            }
            Self::Spherical => {
                let RowGeometry { cosecant, cotangent, .. } = *row;
                for c in 0..D {
                    slopes[(c, 1)] *= reciprocal_radius;
                    slopes[(c, 2)] *= cosecant * reciprocal_radius;
                }
                values[0] = (force[(1, 1)] + force[(2, 2)]) * reciprocal_radius;
                values[1] = (force[(2, 2)] * cotangent - force[(0, 1)]) * reciprocal_radius;
                values[2] = -(force[(0, 2)] + force[(1, 2)] * cotangent) * reciprocal_radius;
            }
        }
        (values, slopes)
    }

    /// Refuses axes with places that have no such coordinates, given as their ends.
    pub(crate) fn check<const D: usize>(self, axes: &[[f64; 2]; D]) -> Result<(), SetupError> {
        let positive = |quantity: &str, value: f64| match value > 0.0 {
            true => Ok(()),
            false => Err(SetupError::NotPositive { quantity: quantity.into(), value }),
        };
        match self {
            Self::Cartesian => Ok(()),
            Self::Polar if D != 2 => Err(SetupError::PolarDimension { dimension: D }),
            Self::Spherical | Self::Cylindrical if D != 3 => {
                Err(SetupError::SphericalDimension { dimension: D })
            }
            Self::Polar => positive("the inner radius", axes[0][0]),
            Self::Cylindrical if axes[0][0] == 0.0 => Ok(()),
            Self::Cylindrical => positive("the inner radius", axes[0][0]),
            Self::Spherical => {
                positive("the inner radius", axes[0][0])?;
                positive("the least polar angle", axes[1][0])?;
                positive("pi minus the largest polar angle", PI - axes[1][1])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3, vector};

    /// A field without symmetry and its gradient, Cartesian.
    fn field(X: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let [x, y, z] = [X[0], X[1], X[2]];
        let u = vector![x * y + 0.3 * z, y * z * z - 0.2 * x, 0.7 * x * x - y + z];
        let H = Matrix3::new(y, x, 0.3, -0.2, z * z, 2.0 * y * z, 1.4 * x, -1.0, 1.0);
        (u, H)
    }

    /// Components of the field and their derivatives by the coordinates, these by differences of fourth order.
    fn in_components(of: Coordinates, q: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        let components = |q: &Vector3<f64>| of.frame(q).unwrap().tr_mul(&field(&of.place(q)).0);
        const STEP: f64 = 1e-3;
        let slopes = Matrix3::from_columns(&std::array::from_fn::<_, 3, _>(|k| {
            let at = |steps: f64| {
                let mut moved = *q;
                moved[k] += steps * STEP;
                components(&moved)
            };
            ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * STEP)
        }));
        (components(q), slopes)
    }

    const OF_SPACE: [Coordinates; 2] = [Coordinates::Spherical, Coordinates::Cylindrical];

    const PLACES: [[f64; 3]; 3] = [[0.5, 0.8, 0.3], [0.9, 2.4, -1.2], [1.3, 1.5, 4.0]];

    #[test]
    fn gradients_in_coordinates_of_space_are_the_cartesian_ones() {
        for (of, q) in OF_SPACE.into_iter().flat_map(|of| PLACES.map(|q| (of, Vector3::from(q)))) {
            let (u, slopes) = in_components(of, &q);
            let row = of.row(&q).unwrap();
            let H = of.gradient(&u, &slopes, q[0].recip(), &row);
            let expected = field(&of.place(&q)).1;
            let off = (row.frame * H * row.frame.transpose() - expected).norm();
            assert!(off < 1e-10, "{of:?} {q:?}: {off:e}");
        }
    }

    #[test]
    fn forces_do_the_work_that_gradients_do() {
        fn check<const D: usize>(coordinates: Coordinates, q: [f64; 3]) {
            let number = |k: usize| (1.7 * k as f64 + q[0]).sin();
            let u = SVector::<f64, D>::from_fn(|c, _| number(c));
            let slopes = SMatrix::<f64, D, D>::from_fn(|c, k| number(3 + 3 * c + k));
            let force = SMatrix::<f64, D, D>::from_fn(|c, k| number(12 + 3 * c + k));
            let row = coordinates.row(&SVector::from_fn(|k, _| q[k])).unwrap();
            let H = coordinates.gradient(&u, &slopes, q[0].recip(), &row);
            let (values, factors) = coordinates.transposed_gradient(&force, q[0].recip(), &row);
            let work = values.dot(&u) + factors.dot(&slopes);
            let off = (work - force.dot(&H)).abs();
            assert!(off < 1e-14 * force.norm() * H.norm(), "{coordinates:?} {q:?}: {off:e}");
        }
        for q in PLACES {
            check::<2>(Coordinates::Polar, q);
            OF_SPACE.into_iter().for_each(|of| check::<3>(of, q));
        }
    }

    #[test]
    fn frames_are_the_directions_of_the_coordinates_and_scales_their_lengths() {
        const STEP: f64 = 1e-5;
        for (of, q) in OF_SPACE.into_iter().flat_map(|of| PLACES.map(|q| (of, Vector3::from(q)))) {
            let (frame, scales) = (of.frame(&q).unwrap(), of.scales(&q));
            for k in 0..3 {
                let at = |step: f64| {
                    let mut moved = q;
                    moved[k] += step;
                    of.place(&moved)
                };
                let tangent = (at(STEP) - at(-STEP)) / (2.0 * STEP);
                assert!((tangent - frame.column(k) * scales[k]).norm() < 1e-9, "{q:?} {k}");
            }
            assert!((frame.determinant() - 1.0).abs() < 1e-15);
            let densities: f64 = (0..3).map(|k| of.density(k, q[k])).product();
            assert!((densities - scales.product()).abs() < 1e-15);
        }
    }
}
