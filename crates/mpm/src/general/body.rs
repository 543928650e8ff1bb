//! Layouts: bodies of particles with the shapes of their domains.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use nalgebra::{SMatrix, SVector};

use crate::error::SetupError;
use crate::grid::Grid;
use crate::particles::Particles;

/// Particles, and the region of the body that each represents.
#[derive(Clone, Debug, PartialEq)]
pub struct Body<const D: usize> {
    /// The particles. Their common half-size has no meaning here.
    pub particles: Particles<f64, D>,
    /// For each particle half the edges of its parallelogram in the reference configuration, one a column: it is the set
    /// of `X + E s`, `|s_a| <= 1`.
    pub half_edges: Vec<SMatrix<f64, D, D>>,
    /// The corners of the particles' domains, where there are any.
    pub mesh: Option<Mesh<D>>,
}

/// Corners that the domains of neighbouring particles share.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<const D: usize> {
    /// Reference positions.
    pub X: Vec<SVector<f64, D>>,
    /// Current positions.
    pub x: Vec<SVector<f64, D>>,
    /// The corners of each particle's domain: in two dimensions four, counter-clockwise; in one dimension the first two
    /// entries, from left to right.
    pub corners: Vec<[usize; 4]>,
}

/// A ring in the plane about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annulus {
    /// Inner radius.
    pub inner: f64,
    /// Outer radius.
    pub outer: f64,
    /// Only the part of positive coordinates.
    pub quarter: bool,
}

impl<const D: usize> Body<D> {
    /// A body at rest on a square lattice, see [`Particles::lattice`]; its squares share corners.
    pub fn lattice(
        grid: &Grid<f64, D>,
        per_cell: usize,
        density: f64,
        inside: impl Fn(&SVector<f64, D>) -> bool,
    ) -> Self {
        let particles = Particles::lattice(grid, per_cell, density, inside);
        let half_edge = SMatrix::from_diagonal(&particles.half_size);
        Self {
            half_edges: vec![half_edge; particles.len()],
            mesh: (D <= 2).then(|| mesh_of_boxes(grid, &particles)),
            particles,
        }
    }

    /// A ring at rest, fitted by polar cells of equal width and angle. Particles lie at the exact centroids of the cells
    /// and have their exact areas; their quadrilaterals share corners, which lie on the rims and on the planes of
    /// symmetry.
    ///
    /// With `per_cell` particles in a length `spacing` there are `round(per_cell (outer - inner) / spacing)` cells across
    /// (1 at least), and around as many in each quarter as make them square at the mean radius.
    ///
    /// # Errors
    ///
    /// [`SetupError::PolarDimension`] in other dimensions than two, and [`SetupError::NotPositive`] for radii or a density
    /// that are none.
    pub fn annulus(
        ring: &Annulus,
        spacing: f64,
        per_cell: usize,
        density: f64,
    ) -> Result<Self, SetupError> {
        if D != 2 {
            return Err(SetupError::PolarDimension { dimension: D });
        }
        let Annulus { inner, outer, quarter } = *ring;
        for (quantity, value) in [
            ("the inner radius", inner),
            ("the width of the ring", outer - inner),
            ("the spacing", spacing),
            ("the density", density),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SetupError::NotPositive { quantity: quantity.into(), value });
            }
        }
        let across = (per_cell as f64 * (outer - inner) / spacing).round().max(1.0) as usize;
        let width = (outer - inner) / across as f64;
        let mean = 0.5 * (inner + outer);
        let around = (FRAC_PI_2 * mean / width).round().max(1.0) as usize;
        let angle = FRAC_PI_2 / around as f64;
        let quarters = if quarter { 1 } else { 4 };
        let cells = around * quarters;
        // All quarters of a full ring: the last corners are the first.
        let rays = if quarter { cells + 1 } else { cells };

        let vector = |cos: f64, sin: f64| SVector::from_fn(|a, _| if a == 0 { cos } else { sin });
        let radius = |i: usize| inner + width * i as f64;
        let mut mesh = Mesh { X: Vec::new(), x: Vec::new(), corners: Vec::new() };
        for j in 0..rays {
            let (cos, sin) = direction(j, around);
            mesh.X.extend((0..=across).map(|i| vector(cos, sin) * radius(i)));
        }
        mesh.x.clone_from(&mesh.X);
        let count = across * cells;
        let (mut X, mut volume) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut half_edges = Vec::with_capacity(count);
        for j in 0..cells {
            let (cos, sin) = direction(2 * j + 1, 2 * around);
            // A chord's centroid lies inside its arc.
            let chord = (0.5 * angle).sin() / (0.5 * angle);
            for i in 0..across {
                let (low, high) = (radius(i), radius(i + 1));
                let middle = 0.5 * (low + high);
                // 2/3 (high^3 - low^3) / (high^2 - low^2)
                let centre = middle + width * width / (12.0 * middle);
                X.push(vector(cos, sin) * (centre * chord));
                volume.push(middle * width * angle);
                let edges = [vector(cos, sin) * width, vector(-sin, cos) * (middle * angle)];
                half_edges.push(SMatrix::from_fn(|a, k| 0.5 * edges[k][a]));
                let corner = |i: usize, j: usize| (j % rays) * (across + 1) + i;
                mesh.corners.push([
                    corner(i, j),
                    corner(i + 1, j),
                    corner(i + 1, j + 1),
                    corner(i, j + 1),
                ]);
            }
        }
        let particles = Particles {
            x: X.clone(),
            X,
            v: vec![SVector::zeros(); count],
            F: vec![SMatrix::identity(); count],
            mass: volume.iter().map(|area| area * density).collect(),
            volume,
            half_size: SVector::repeat(0.5 * width),
        };
        Ok(Self { particles, half_edges, mesh: Some(mesh) })
    }
}

/// Cosine and sine of `index` parts of a quarter turn, each of which has `per_quarter`; exact on the axes.
fn direction(index: usize, per_quarter: usize) -> (f64, f64) {
    let rest = index % per_quarter;
    let angle = FRAC_PI_2 * rest as f64 / per_quarter as f64;
    let (cos, sin) = if rest == 0 { (1.0, 0.0) } else { (angle.cos(), angle.sin()) };
    match index / per_quarter % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// The shared corners of a lattice's boxes, in one or two dimensions.
fn mesh_of_boxes<const D: usize>(grid: &Grid<f64, D>, particles: &Particles<f64, D>) -> Mesh<D> {
    const AROUND: [[i64; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];
    let edge = particles.half_size * 2.0;
    let mut mesh = Mesh { X: Vec::new(), x: Vec::new(), corners: Vec::new() };
    let mut known = BTreeMap::new();
    for X in &particles.X {
        let mut corners = [0; 4];
        for (corner, offset) in corners.iter_mut().zip(&AROUND[..1 << D]) {
            let index: [i64; D] = std::array::from_fn(|a| {
                ((X[a] - grid.lower[a]) / edge[a] - 0.5).round() as i64 + offset[a]
            });
            *corner = *known.entry(index).or_insert_with(|| {
                mesh.X.push(SVector::from_fn(|a, _| grid.lower[a] + index[a] as f64 * edge[a]));
                mesh.X.len() - 1
            });
        }
        mesh.corners.push(corners);
    }
    mesh.x.clone_from(&mesh.X);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use std::f64::consts::PI;

    #[test]
    fn polar_cells_are_square_at_the_mean_radius() {
        for (inner, outer, spacing, across, around) in
            [(0.3, 1.0, 0.25, 8, 12), (0.5, 0.51, 1.0, 1, 79), (2.0, 5.0, 0.5, 18, 33)]
        {
            let ring = Annulus { inner, outer, quarter: true };
            let body = Body::<2>::annulus(&ring, spacing, 3, 1.0).unwrap();
            assert_eq!(body.particles.len(), across * around, "{ring:?}");
            let half_size = 0.5 * (outer - inner) / across as f64;
            assert!((body.particles.half_size / half_size).iter().all(|r| (r - 1.0).abs() < 1e-13));
        }
    }

    #[test]
    fn polar_cells_add_up_to_the_ring_with_its_moments() {
        for quarter in [true, false] {
            let ring = Annulus { inner: 0.4, outer: 0.6, quarter };
            for (spacing, per_cell) in [(0.1, 1), (0.1, 2), (0.03, 3), (1.0, 1)] {
                let body = Body::<2>::annulus(&ring, spacing, per_cell, 3.0).unwrap();
                let p = &body.particles;
                let part = if quarter { 0.25 } else { 1.0 };
                let area = part * PI * (0.36 - 0.16);
                assert!((p.volume.iter().sum::<f64>() / area - 1.0).abs() < 1e-13);
                assert!((p.mass.iter().sum::<f64>() / (3.0 * area) - 1.0).abs() < 1e-13);
                let moment: Vector2<f64> = p.X.iter().zip(&p.volume).map(|(X, V)| X * *V).sum();
                // The integral of x over a quarter is (outer^3 - inner^3) / 3.
                let exact = if quarter { (0.216 - 0.064) / 3.0 } else { 0.0 };
                assert!((moment - Vector2::repeat(exact)).norm() < 1e-14, "{moment}");
                let mesh = body.mesh.unwrap();
                for (corners, E) in mesh.corners.iter().zip(&body.half_edges) {
                    let [a, b, c, d] = corners.map(|k| mesh.X[k]);
                    let area = 0.5 * (c - a).perp(&(d - b));
                    assert!(area > 0.0 && E.determinant() > 0.0);
                }
                let on_axis = mesh.X.iter().filter(|X| X[0] == 0.0 && X[1] > 0.0).count();
                let across = (per_cell as f64 * 0.2 / spacing).round().max(1.0) as usize;
                assert_eq!(on_axis, across + 1);
                assert_eq!(p.len() % across, 0);
                let corners = if quarter { p.len() / across + 1 } else { p.len() / across };
                assert_eq!(mesh.X.len(), corners * (across + 1));
            }
        }
    }

    #[test]
    fn boxes_of_a_lattice_share_their_corners() {
        let grid = Grid {
            lower: Vector2::new(1.0, 2.0),
            spacing: 0.5,
            cells: [3, 2],
            walls: [[false; 2]; 2],
        };
        let body = Body::lattice(&grid, 2, 1.0, |_| true);
        let mesh = body.mesh.unwrap();
        assert_eq!(mesh.X.len(), 7 * 5);
        for (corners, X) in mesh.corners.iter().zip(&body.particles.X) {
            let corners = corners.map(|k| mesh.X[k] - X);
            let h = 0.125;
            let expected = [[-h, -h], [h, -h], [h, h], [-h, h]].map(Vector2::from);
            for (corner, expected) in corners.iter().zip(expected) {
                assert!((corner - expected).norm() < 1e-15);
            }
        }
    }

    #[test]
    fn only_rings_of_the_plane_have_polar_cells() {
        let ring = Annulus { inner: 0.4, outer: 0.6, quarter: true };
        let found = Body::<3>::annulus(&ring, 0.1, 2, 1.0).unwrap_err();
        assert_eq!(found, SetupError::PolarDimension { dimension: 3 });
        let found = Body::<2>::annulus(&Annulus { outer: 0.3, ..ring }, 0.1, 2, 1.0).unwrap_err();
        assert!(matches!(found, SetupError::NotPositive { .. }), "{found}");
    }
}
