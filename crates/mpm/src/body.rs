//! Bodies of particles with the domains that they represent.

use std::ops::Range;

use nalgebra::{RealField, SMatrix, SVector};

use crate::error::SetupError;
use crate::grid::Grid;
use crate::particles::Particles;
use crate::polygons::Polygons;
use crate::tensor::real;

/// Particles, and the region of the body that each represents.
#[derive(Clone, Debug, PartialEq)]
pub struct Body<T, const D: usize> {
    /// The particles.
    pub particles: Particles<T, D>,
    /// For each particle half the edges of its parallelogram in the reference configuration, one a column: it is the set
    /// of `X + E s`, `|s_a| <= 1`. Empty where all are the boxes of half-size [`Particles::half_size`].
    pub half_edges: Vec<SMatrix<T, D, D>>,
    /// The corners of the particles' domains, where there are any.
    pub mesh: Option<Mesh<T, D>>,
    /// The domains as polygons on shared corners, where they are such.
    pub polygons: Option<Polygons<T, D>>,
}

/// Particles whose domains are boxes, all of the same half-size, without common corners.
impl<T, const D: usize> From<Particles<T, D>> for Body<T, D> {
    fn from(particles: Particles<T, D>) -> Self {
        Self { particles, half_edges: Vec::new(), mesh: None, polygons: None }
    }
}

/// Corners that the domains of neighbouring particles share.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<T, const D: usize> {
    /// Reference positions.
    pub X: Vec<SVector<T, D>>,
    /// Current positions.
    pub x: Vec<SVector<T, D>>,
    /// The corners of each particle's domain: in one dimension the first two entries, from left to right; in two the first
    /// four, counter-clockwise; in three all, counter-clockwise as seen from above those of the lower face, then those above
    /// them.
    pub corners: Vec<[u32; 8]>,
}

impl<T, const D: usize> Default for Mesh<T, D> {
    fn default() -> Self {
        Self { X: Vec::new(), x: Vec::new(), corners: Vec::new() }
    }
}

impl<T: RealField + Copy, const D: usize> Mesh<T, D> {
    /// The corners of some successive particles.
    fn part(&self, own: &Range<usize>) -> Self {
        let mut part = Self { corners: self.corners[own.clone()].to_vec(), ..Self::default() };
        let mut used: Vec<u32> =
            part.corners.iter().flat_map(|corners| &corners[..1 << D]).copied().collect();
        used.sort_unstable();
        used.dedup();
        part.X = used.iter().map(|&corner| self.X[corner as usize]).collect();
        part.x = used.iter().map(|&corner| self.x[corner as usize]).collect();
        for corners in &mut part.corners {
            let (own, others) = corners.split_at_mut(1 << D);
            for corner in own {
                *corner = used.partition_point(|known| known < corner) as u32;
            }
            others.fill(0);
        }
        part
    }
}

/// A ring in the plane about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annulus<T> {
    /// Inner radius.
    pub inner: T,
    /// Outer radius.
    pub outer: T,
    /// Only the part of positive coordinates.
    pub quarter: bool,
}

impl<T: RealField + Copy, const D: usize> Body<T, D> {
    /// A body at rest on a square lattice, see [`Particles::lattice`]; its squares share corners.
    pub fn lattice(
        grid: &Grid<T, D>,
        per_cell: usize,
        density: T,
        inside: impl Fn(&SVector<T, D>) -> bool,
    ) -> Self {
        let particles = Particles::lattice(grid, per_cell, density, inside);
        let half_edge = SMatrix::from_diagonal(&particles.half_size);
        Self {
            half_edges: vec![half_edge; particles.len()],
            mesh: Some(mesh_of_boxes(grid, &particles)),
            polygons: None,
            particles,
        }
    }
}

/// See [`Body::part`].
pub(crate) fn part<T: RealField + Copy, const D: usize>(
    body: &Body<T, D>,
    own: &Range<usize>,
) -> Body<T, D> {
    let Body { particles, half_edges, mesh, polygons } = body;
    let places: Vec<u32> = own.clone().map(|p| p as u32).collect();
    let particles = particles.some(&places);
    let half_edges = half_edges.get(own.clone()).unwrap_or_default().to_vec();
    let mesh = mesh.as_ref().map(|mesh| mesh.part(own));
    let own: Vec<usize> = own.clone().collect();
    let polygons = polygons.as_ref().map(|polygons| polygons.part(&own));
    Body { particles, half_edges, mesh, polygons }
}

/// See [`Body::annulus`].
pub(crate) fn annulus<T: RealField + Copy, const D: usize>(
    ring: &Annulus<T>,
    spacing: T,
    per_cell: usize,
    density: T,
) -> Result<Body<T, D>, SetupError> {
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
        if !(value > T::zero() && value.is_finite()) {
            let value = nalgebra::try_convert(value).unwrap_or(f64::NAN);
            return Err(SetupError::NotPositive { quantity: quantity.into(), value });
        }
    }
    let number = |count: usize| real::<T>(count as f64);
    let rounded =
        |value: T| nalgebra::try_convert::<T, f64>(value).unwrap_or(0.0).round().max(1.0) as usize;
    let half = real::<T>(0.5);
    let across = rounded(number(per_cell) * (outer - inner) / spacing);
    let width = (outer - inner) / number(across);
    let mean = half * (inner + outer);
    let around = rounded(T::frac_pi_2() * mean / width);
    let angle = T::frac_pi_2() / number(around);
    let quarters = if quarter { 1 } else { 4 };
    let cells = around * quarters;
    // All quarters of a full ring: the last corners are the first.
    let rays = if quarter { cells + 1 } else { cells };

    let vector = |cos: T, sin: T| SVector::from_fn(|a, _| if a == 0 { cos } else { sin });
    let radius = |i: usize| inner + width * number(i);
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
        let chord = (half * angle).sin() / (half * angle);
        for i in 0..across {
            let (low, high) = (radius(i), radius(i + 1));
            let middle = half * (low + high);
            // 2/3 (high^3 - low^3) / (high^2 - low^2)
            let centre = middle + width * width / (real::<T>(12.0) * middle);
            X.push(vector(cos, sin) * (centre * chord));
            volume.push(middle * width * angle);
            let edges = [vector(cos, sin) * width, vector(-sin, cos) * (middle * angle)];
            half_edges.push(SMatrix::from_fn(|a, k| half * edges[k][a]));
            let corner = |i: usize, j: usize| ((j % rays) * (across + 1) + i) as u32;
            let of_cell = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            mesh.corners.push(std::array::from_fn(|k| of_cell[k % 4]));
        }
    }
    let particles = Particles {
        x: X.clone(),
        X,
        v: vec![SVector::zeros(); count],
        F: vec![SMatrix::identity(); count],
        mass: volume.iter().map(|&area| area * density).collect(),
        volume,
        half_size: SVector::repeat(half * width),
    };
    Ok(Body { particles, half_edges, mesh: Some(mesh), polygons: None })
}

/// Cosine and sine of `index` parts of a quarter turn, each of which has `per_quarter`; exact on the axes.
fn direction<T: RealField + Copy>(index: usize, per_quarter: usize) -> (T, T) {
    let rest = index % per_quarter;
    let angle = T::frac_pi_2() * real(rest as f64) / real(per_quarter as f64);
    let (cos, sin) = if rest == 0 { (T::one(), T::zero()) } else { (angle.cos(), angle.sin()) };
    match index / per_quarter % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// The shared corners of a lattice's boxes.
fn mesh_of_boxes<T: RealField + Copy, const D: usize>(
    grid: &Grid<T, D>,
    particles: &Particles<T, D>,
) -> Mesh<T, D> {
    const AROUND: [[usize; 3]; 8] =
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
    let edge = particles.half_size * real::<T>(2.0);
    let in_boxes =
        |length: T, a: usize| nalgebra::try_convert::<T, f64>(length / edge[a]).unwrap_or(0.0);
    let count: [usize; D] = std::array::from_fn(|a| {
        in_boxes(grid.spacing * real(grid.cells[a] as f64), a).round() as usize + 1
    });
    const NONE: u32 = u32::MAX;
    let mut known = vec![NONE; count.iter().product()];
    let mut mesh = Mesh::default();
    for X in &particles.X {
        let mut corners = [0; 8];
        for (corner, offset) in corners.iter_mut().zip(&AROUND[..1 << D]) {
            let index: [usize; D] = std::array::from_fn(|a| {
                let below = in_boxes(X[a] - grid.lower[a], a) - 0.5;
                below.round().max(0.0) as usize + offset[a]
            });
            let place = (0..D).rev().fold(0, |place, a| place * count[a] + index[a]);
            if known[place] == NONE {
                known[place] = mesh.X.len() as u32;
                mesh.X.push(SVector::from_fn(|a, _| {
                    grid.lower[a] + real::<T>(index[a] as f64) * edge[a]
                }));
            }
            *corner = known[place];
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
            let body = Body::<f64, 2>::annulus(&ring, spacing, 3, 1.0).unwrap();
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
                let body = Body::<f64, 2>::annulus(&ring, spacing, per_cell, 3.0).unwrap();
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
                    let [a, b, c, d] = std::array::from_fn(|k| mesh.X[corners[k] as usize]);
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
            let corners: [Vector2<f64>; 4] =
                std::array::from_fn(|k| mesh.X[corners[k] as usize] - X);
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
        let found = Body::<f64, 3>::annulus(&ring, 0.1, 2, 1.0).unwrap_err();
        assert_eq!(found, SetupError::PolarDimension { dimension: 3 });
        let found =
            Body::<f64, 2>::annulus(&Annulus { outer: 0.3, ..ring }, 0.1, 2, 1.0).unwrap_err();
        assert!(matches!(found, SetupError::NotPositive { .. }), "{found}");
    }
}
