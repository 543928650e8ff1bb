//! Bodies of particles with the domains that they represent.

use std::ops::Range;

use bytemuck::Pod;
use mmsmith_lanes::tensor::real;
use mmsmith_scalar_functions::ScalarFunctions;
use nalgebra::{RealField, SMatrix, SVector};

use crate::columns::Particles;
use crate::error::SetupError;
use crate::grid::Grid;
use crate::mesh::{Mesh, Numbers};

/// Particles, and the region of the body that each represents.
#[derive(Clone, Debug, PartialEq)]
pub struct Body<T, const D: usize> {
    /// The particles.
    pub particles: Particles<T, D>,
    /// For each particle half the edges of its parallelogram in the reference configuration, one a column: it is the set
    /// of `X + E s`, `|s_a| <= 1`. Empty where all are the boxes of half-size [`Particles::half_size`].
    pub half_edges: Vec<SMatrix<T, D, D>>,
    /// The domains between shared corners, where there are such. Cells are used with CPDI2 alone.
    pub mesh: Option<Mesh<T, D>>,
    /// Whether the particles are those of the half plane of a body of revolution about the last axis of space, `y = 0` in the reference
    /// configuration, with the volumes and masses of all around the axis. The grid is then that of radius and height, with one cell along its second
    /// axis, and the motion may turn about the axis.
    pub revolves: bool,
    /// On which [walls](Grid::walls) of the grid the body is held in all directions; on the others it slides.
    pub sticks: [[bool; 2]; D],
}

/// Particles whose domains are boxes, all of the same half-size, without common corners.
impl<T, const D: usize> From<Particles<T, D>> for Body<T, D> {
    fn from(particles: Particles<T, D>) -> Self {
        Self {
            particles,
            half_edges: Vec::new(),
            mesh: None,
            revolves: false,
            sticks: [[false; 2]; D],
        }
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
        let half_edges = vec![half_edge; particles.len()];
        let mesh = Some(cells_of_boxes(grid, &particles));
        Self { half_edges, mesh, ..particles.into() }
    }

    /// Some successive particles alone, with their corners.
    #[must_use]
    pub fn part(&self, own: &Range<usize>) -> Self
    where
        T: Pod,
    {
        let Self { particles, half_edges, mesh, revolves, sticks } = self;
        let places: Vec<u32> = own.clone().map(|p| p as u32).collect();
        let particles = particles.some(&places);
        let half_edges = half_edges.get(own.clone()).unwrap_or_default().to_vec();
        let own: Vec<usize> = own.clone().collect();
        let mesh = mesh.as_ref().map(|mesh| mesh.part(&own));
        Self { particles, half_edges, mesh, revolves: *revolves, sticks: *sticks }
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
        ring: &Annulus<T>,
        spacing: T,
        per_cell: usize,
        density: T,
    ) -> Result<Self, SetupError> {
        let mut whole = Self::annulus_part(ring, spacing, per_cell, density, &|count| 0..count)?;
        if let Some(mesh) = &mut whole.mesh {
            mesh.numbers = None;
        }
        Ok(whole)
    }

    /// As [`annulus`](Self::annulus) some successive particles alone, `own(count)` of that many in all, with their corners.
    ///
    /// # Errors
    ///
    /// As [`annulus`](Self::annulus).
    pub fn annulus_part(
        ring: &Annulus<T>,
        spacing: T,
        per_cell: usize,
        density: T,
        own: &dyn Fn(usize) -> Range<usize>,
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
            if !(value > T::zero() && value.is_finite()) {
                let value = nalgebra::try_convert(value).unwrap_or(f64::NAN);
                return Err(SetupError::NotPositive { quantity: quantity.into(), value });
            }
        }
        let number = |count: usize| real::<T>(count as f64);
        let rounded = |value: T| {
            nalgebra::try_convert::<T, f64>(value).unwrap_or(0.0).round().max(1.0) as usize
        };
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
        let own = own(across * cells);
        let count = own.len();
        let (mut X, mut volume) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut half_edges = Vec::with_capacity(count);
        let mut corners = Vec::with_capacity(4 * count);
        for (i, j) in own.map(|p| (p % across, p / across)) {
            let (cos, sin) = direction(2 * j + 1, 2 * around);
            // A chord's centroid lies inside its arc.
            let chord = sine(half * angle) / (half * angle);
            let (low, high) = (radius(i), radius(i + 1));
            let middle = half * (low + high);
            // 2/3 (high^3 - low^3) / (high^2 - low^2)
            let centre = middle + width * width / (real::<T>(12.0) * middle);
            X.push(vector(cos, sin) * (centre * chord));
            volume.push(middle * width * angle);
            let edges = [vector(cos, sin) * width, vector(-sin, cos) * (middle * angle)];
            half_edges.push(SMatrix::from_fn(|a, k| half * edges[k][a]));
            let corner = |i: usize, j: usize| ((j % rays) * (across + 1) + i) as u64;
            let of_cell = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            corners.extend(of_cell);
        }
        let mesh = cells_between(corners, |number| {
            let (i, j) = (number as usize % (across + 1), number as usize / (across + 1));
            let (cos, sin) = direction(j, around);
            vector(cos, sin) * radius(i)
        });
        let particles = Particles {
            x: X.clone(),
            X,
            v: vec![SVector::zeros(); count],
            F: vec![SMatrix::identity(); count],
            mass: volume.iter().map(|&area| area * density).collect(),
            volume,
            half_size: SVector::repeat(half * width),
            ..Particles::default()
        };
        Ok(Self { half_edges, mesh: Some(mesh), ..particles.into() })
    }
}

/// The sine, the same on all systems.
fn sine<T: RealField + Copy>(angle: T) -> T {
    real(nalgebra::convert_unchecked::<T, f64>(angle).sine())
}

/// The cosine, as [`sine`].
fn cosine<T: RealField + Copy>(angle: T) -> T {
    real(nalgebra::convert_unchecked::<T, f64>(angle).cosine())
}

/// Cosine and sine of `index` parts of a quarter turn, each of which has `per_quarter`; exact on the axes.
fn direction<T: RealField + Copy>(index: usize, per_quarter: usize) -> (T, T) {
    let rest = index % per_quarter;
    let angle = T::frac_pi_2() * real(rest as f64) / real(per_quarter as f64);
    let (cos, sin) = if rest == 0 { (T::one(), T::zero()) } else { (cosine(angle), sine(angle)) };
    match index / per_quarter % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// The boxes of a lattice, which share corners; in the order of their numbers on the lattice, whatever part of it is here.
fn cells_of_boxes<T: RealField + Copy, const D: usize>(
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
    let mut of_cells = Vec::with_capacity(particles.X.len() << D);
    for X in &particles.X {
        for offset in &AROUND[..1 << D] {
            of_cells.push((0..D).rev().fold(0_u64, |place, a| {
                let below = in_boxes(X[a] - grid.lower[a], a) - 0.5;
                place * count[a] as u64 + (below.round().max(0.0) as usize + offset[a]) as u64
            }));
        }
    }
    cells_between(of_cells, |number| {
        let mut rest = number;
        SVector::from_fn(|a, _| {
            let index = rest % count[a] as u64;
            rest /= count[a] as u64;
            grid.lower[a] + real::<T>(index as f64) * edge[a]
        })
    })
}

/// Cells between corners with these numbers in the whole body, which lie at `at(number)`.
fn cells_between<T: RealField + Copy, const D: usize>(
    of_cells: Vec<u64>,
    at: impl Fn(u64) -> SVector<T, D>,
) -> Mesh<T, D> {
    let mut numbers = of_cells.clone();
    numbers.sort_unstable();
    numbers.dedup();
    let X = numbers.iter().map(|number| at(*number)).collect();
    let place = |number: u64| numbers.partition_point(|known| *known < number) as u32;
    let corners = of_cells.into_iter().map(place).collect();
    let numbers = Numbers { corners: numbers, loads: Vec::new() };
    Mesh { numbers: Some(numbers), ..Mesh::cells(X, corners) }
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
    fn a_part_of_a_ring_has_the_particles_and_corners_of_the_whole() {
        for quarter in [true, false] {
            let ring = Annulus { inner: 0.4, outer: 0.6, quarter };
            let whole = Body::<f64, 2>::annulus(&ring, 0.1, 2, 3.0).unwrap();
            let count = whole.particles.len();
            for own in [0..count, 0..7, 5..count - 3, count - 9..count, 4..4] {
                let part = Body::annulus_part(&ring, 0.1, 2, 3.0, &|_| own.clone()).unwrap();
                assert_eq!(part, whole.part(&own), "{own:?}");
            }
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
                let cells = body.mesh.unwrap();
                for (corners, E) in cells.corners.chunks(4).zip(&body.half_edges) {
                    let [a, b, c, d] = std::array::from_fn(|k| cells.X[corners[k] as usize]);
                    let area = 0.5 * (c - a).perp(&(d - b));
                    assert!(area > 0.0 && E.determinant() > 0.0);
                }
                let on_axis = cells.X.iter().filter(|X| X[0] == 0.0 && X[1] > 0.0).count();
                let across = (per_cell as f64 * 0.2 / spacing).round().max(1.0) as usize;
                assert_eq!(on_axis, across + 1);
                assert_eq!(p.len() % across, 0);
                let corners = if quarter { p.len() / across + 1 } else { p.len() / across };
                assert_eq!(cells.X.len(), corners * (across + 1));
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
        let cells = body.mesh.unwrap();
        assert_eq!(cells.X.len(), 7 * 5);
        for (corners, X) in cells.corners.chunks(4).zip(&body.particles.X) {
            let corners: [Vector2<f64>; 4] =
                std::array::from_fn(|k| cells.X[corners[k] as usize] - X);
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
