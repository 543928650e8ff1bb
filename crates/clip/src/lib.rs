//! Bodies of any shape: the boxes of a lattice, clipped with the body's boundary, in the plane by `plane`, in space by `space`.
//!
//! 1. Each box is clipped with one side of the body after another. A curved side becomes the chords, or the flat parts, between the places
//!    where it crosses the lines of the lattice. A crossing is computed once, from the line and the side alone, so that the boxes at the
//!    line share it.
//! 2. What is left of a box, if it is a sliver, joins the neighbour with which it has most of its boundary in common, so that no particle
//!    is much lighter than the others and the largest stable step stays that of whole boxes.
//! 3. A particle lies at the centroid of its parts. Its mass is that of its part of the body, with what lies between chords and arcs: the
//!    mass of the body is exact.

mod boxes;
mod plane;
mod space;

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid, Interpolation, Mesh, Numbers, Particles, SetupError};
use mmsmith_rare_states::{RareState, met};
use nalgebra::{RealField, SMatrix, SVector};

use crate::boxes::Groups;

/// A clipped box with less than this share of its whole volume is a sliver.
const SLIVER: f64 = 0.2;

/// Places closer to a side than this, in units of the particles' distance, lie on it.
const ON: f64 = 1e-9;

/// A side of a body, in the axes of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side<const D: usize> {
    /// A straight side: the points with `X . normal <= distance` are inside.
    Straight {
        /// The outward unit normal.
        normal: [f64; D],
        /// Its distance from the origin, along the normal.
        distance: f64,
    },
    /// A circle or a sphere about the origin around the body.
    Outer {
        /// Its radius.
        radius: f64,
    },
    /// A circle or a sphere about the origin, inside of which there is nothing.
    Inner {
        /// Its radius.
        radius: f64,
    },
}

impl<const D: usize> Side<D> {
    /// The distance from the side, positive inside.
    fn distance(&self, X: &SVector<f64, D>) -> f64 {
        match *self {
            Self::Straight { normal, distance } => distance - SVector::from(normal).dot(X),
            Self::Outer { radius } => radius - X.norm(),
            Self::Inner { radius } => X.norm() - radius,
        }
    }

    /// The gradient of the distance.
    fn gradient(&self, X: &SVector<f64, D>) -> SVector<f64, D> {
        match *self {
            Self::Straight { normal, .. } => -SVector::from(normal),
            Self::Outer { .. } => -X.normalize(),
            Self::Inner { .. } => X.normalize(),
        }
    }

    /// Where the side crosses the segment from `a`, at distance `da` from it, to `b`, at `db` on its other side.
    fn crossing(
        &self,
        (a, da): (SVector<f64, D>, f64),
        (b, db): (SVector<f64, D>, f64),
    ) -> SVector<f64, D> {
        let along = b - a;
        let straight = da / (da - db);
        let share = match *self {
            Self::Straight { .. } => straight,
            Self::Outer { radius } | Self::Inner { radius } => {
                // |a + s along|^2 = radius^2
                let (half, square) = (a.dot(&along), along.norm_squared());
                let rest = (a.norm() - radius) * (a.norm() + radius);
                let root = (half * half - square * rest).max(0.0).sqrt();
                let far = if half > 0.0 { -half - root } else { root - half };
                // One of the two lies between the ends, wherever the straight line through the distances is zero.
                let beside = |s: f64| (s - s.clamp(0.0, 1.0)).abs();
                [far / square, rest / far]
                    .into_iter()
                    .filter(|s| s.is_finite())
                    .min_by(|s, t| beside(*s).total_cmp(&beside(*t)))
                    .unwrap_or(straight)
            }
        };
        a + along * share.clamp(0.0, 1.0)
    }

    /// This side in the dimension of a body.
    fn carried<const E: usize>(self) -> Side<E> {
        match self {
            Self::Straight { normal, distance } => {
                let normal = std::array::from_fn(|a| normal.get(a).copied().unwrap_or(0.0));
                Side::Straight { normal, distance }
            }
            Self::Outer { radius } => Side::Outer { radius },
            Self::Inner { radius } => Side::Inner { radius },
        }
    }
}

/// A part of the boundary between as many corners as there are dimensions: an edge with the body on the left of the way from the first
/// to the second, or a triangle, counter-clockwise as seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet<const D: usize> {
    /// The index of the side that it belongs to.
    pub side: usize,
    /// Its corners.
    pub corners: [u32; D],
    /// Its number among those of the whole body: they ascend, with gaps.
    pub number: u64,
}

/// A lattice of boxes and the body that it is clipped with.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip<const D: usize> {
    /// The sides of the body.
    pub sides: Vec<Side<D>>,
    /// Cosine and sine of the angle by which the first two axes of the grid are turned against those of the body, counter-clockwise.
    pub turn: [f64; 2],
    /// By how much the lattice is shifted along every axis of the grid, in units of the particles' distance.
    pub offset: f64,
}

/// The boundary that a clipped box shares with another box.
struct Contact {
    /// The number of the other box.
    with: u64,
    /// A length or an area.
    measure: f64,
}

/// Joins slivers to the neighbours with which they have most in common. `volumes` are those of the clipped boxes, by number, and `whole` that of other
/// boxes.
fn join(volumes: &[(u64, f64)], whole: f64, contacts: impl Fn(u64) -> Vec<Contact>) -> Groups {
    let mut group_of: BTreeMap<u64, u64> = BTreeMap::new();
    let mut members: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    let mut volume_of: BTreeMap<u64, f64> = volumes.iter().copied().collect();
    let is_sliver = |volume: f64| volume < SLIVER * whole;
    let mut slivers: Vec<_> =
        volumes.iter().copied().filter(|(_, volume)| is_sliver(*volume)).collect();
    slivers.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    for (sliver, _) in slivers {
        let own = group_of.get(&sliver).copied().unwrap_or(sliver);
        let volume = volume_of.get(&own).copied().unwrap_or(whole);
        if !is_sliver(volume) {
            continue;
        }
        let of_group = members.get(&own).cloned().unwrap_or_else(|| vec![own]);
        let mut common: BTreeMap<u64, f64> = BTreeMap::new();
        for Contact { with, measure } in of_group.iter().flat_map(|number| contacts(*number)) {
            let with = group_of.get(&with).copied().unwrap_or(with);
            if with != own {
                *common.entry(with).or_insert(0.0) += measure;
            }
        }
        let most = common.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)));
        let Some((&to, _)) = most else { continue };
        met(RareState::SliverJoined);
        group_of.extend(of_group.iter().map(|member| (*member, to)));
        members.remove(&own);
        members.entry(to).or_insert_with(|| vec![to]).extend(of_group);
        *volume_of.entry(to).or_insert(whole) += volume;
    }
    Groups { joined: group_of.into_keys().collect(), members }
}

/// Some particles of a body, whose corners have the numbers of a clip.
struct Made<T, const D: usize> {
    /// Without places of corners, whose numbers are those of the clip.
    mesh: Mesh<T, D>,
    X: Vec<SVector<T, D>>,
    volume: Vec<T>,
    mass: Vec<T>,
    boundary: Vec<Facet<D>>,
    /// For each corner of the clip that was met its number in the whole body: its first particle and its place there.
    numbers: HashMap<u32, u64>,
}

/// Numbers of corners and facets have the particle in the bits from this one on.
const PARTICLE: u32 = 16;

impl<T: RealField + Copy, const D: usize> Made<T, D> {
    fn new(turn: [f64; 2]) -> Self {
        Self {
            mesh: Mesh::empty(Interpolation::Triangles, turn_of(turn)),
            X: Vec::new(),
            volume: Vec::new(),
            mass: Vec::new(),
            boundary: Vec::new(),
            numbers: HashMap::new(),
        }
    }

    /// Meets the corners of a particle, in order.
    fn meet(&mut self, particle: usize, corners: impl Iterator<Item = u32>) {
        for (place, corner) in corners.enumerate() {
            let number = (particle as u64) << PARTICLE | place as u64;
            self.numbers.entry(corner).or_insert(number);
        }
    }

    /// Ends a particle, whose polygons or polyhedra are in the mesh, with its centroid.
    fn add_particle(&mut self, X: SVector<T, D>, volume: f64, mass: f64) {
        self.mesh.of_particles.push(self.mesh.ends.len() as u32);
        self.X.push(X);
        self.volume.push(real(volume));
        self.mass.push(real(mass));
    }

    /// A facet of a particle, with the number that follows on that of its last one.
    fn add_facet(&mut self, particle: usize, side: usize, corners: [u32; D]) {
        let first = (particle as u64) << PARTICLE;
        let number = self.boundary.last().map_or(first, |last| first.max(last.number + 1));
        self.boundary.push(Facet { side, corners, number });
    }

    /// The body at rest, with corners in the order of their numbers, which lie at `at(corner)`; and its boundary.
    fn at_rest(
        self,
        spacing: f64,
        at: impl Fn(u32) -> SVector<T, D>,
    ) -> (Body<T, D>, Vec<Facet<D>>) {
        let Self { mut mesh, X, volume, mass, mut boundary, numbers } = self;
        let mut met: Vec<(u64, u32)> =
            mesh.corners.iter().map(|corner| (numbers[corner], *corner)).collect();
        met.sort_unstable();
        met.dedup();
        let known: HashMap<u32, u32> = met.iter().map(|(_, corner)| *corner).zip(0..).collect();
        mesh.corners.iter_mut().for_each(|corner| *corner = known[corner]);
        for facet in &mut boundary {
            facet.corners = facet.corners.map(|corner| known[&corner]);
        }
        mesh.X = met.iter().map(|(_, corner)| at(*corner)).collect();
        mesh.x.clone_from(&mesh.X);
        let corners = met.into_iter().map(|(number, _)| number).collect();
        mesh.numbers = Some(Numbers { corners, loads: Vec::new() });
        let count = X.len();
        let particles = Particles {
            x: X.clone(),
            X,
            v: vec![SVector::zeros(); count],
            F: vec![SMatrix::identity(); count],
            mass,
            volume,
            half_size: SVector::repeat(real(0.5 * spacing)),
            ..Particles::default()
        };
        let body = Body { half_edges: Vec::new(), mesh: Some(mesh), ..particles.into() };
        (body, boundary)
    }
}

/// From the axes of the body to those of the grid; none where they are the same.
fn turn_of<T: RealField + Copy, const D: usize>([cos, sin]: [f64; 2]) -> Option<SMatrix<T, D, D>> {
    let turned = SMatrix::from_fn(|i, j| {
        real(match (i, j) {
            (0, 0) | (1, 1) => cos,
            (0, 1) => sin,
            (1, 0) => -sin,
            _ if i == j => 1.0,
            _ => 0.0,
        })
    });
    ([cos, sin] != [1.0, 0.0]).then_some(turned)
}

/// A body in the plane or in space at rest, of the boxes of a lattice with `per_cell` of them in a cell of the grid and direction,
/// clipped with its sides; and its boundary, facet by facet, but for facets on the walls of the grid. `grid` is in its own axes.
///
/// # Errors
///
/// [`SetupError::PolygonDimension`] in one dimension.
pub fn body<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
) -> Result<(Body<T, D>, Vec<Facet<D>>), SetupError> {
    let (mut body, boundary) = part(grid, per_cell, density, clip, &|count| 0..count)?;
    if let Some(mesh) = &mut body.mesh {
        mesh.numbers = None;
    }
    Ok((body, boundary))
}

/// As [`body`] some successive particles alone, `own(count)` of that many in all, with their corners and the facets of their surfaces.
///
/// Memory is taken for these particles, and for the boxes along the sides of the whole body.
///
/// # Errors
///
/// As [`body`].
pub fn part<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
    own: &dyn Fn(usize) -> Range<usize>,
) -> Result<(Body<T, D>, Vec<Facet<D>>), SetupError> {
    match D {
        2 => Ok(plane::part(grid, per_cell.max(1), density, clip, own)),
        3 => Ok(space::part(grid, per_cell.max(1), density, clip, own)),
        _ => Err(SetupError::PolygonDimension { dimension: D }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;
    use std::f64::consts::PI;

    /// Parts of a body, made each for itself, against those of the whole.
    fn check_parts<const D: usize>(cells: usize, sides: &[Side<D>], turn: f64, offset: f64) {
        let grid = Grid {
            lower: SVector::repeat(-1.0),
            spacing: 2.0 / cells as f64,
            cells: [cells; D],
            walls: [[false; 2]; D],
        };
        let clip = Clip { sides: sides.to_vec(), turn: [turn.cos(), turn.sin()], offset };
        let (whole, boundary) = body::<f64, D>(&grid, 2, 3.0, &clip).unwrap();
        let mesh = whole.mesh.as_ref().unwrap();
        let count = whole.particles.len();
        assert!(count > 20, "{count}");
        let at = |mesh: &Mesh<f64, D>, facet: &Facet<D>| {
            (facet.side, facet.corners.map(|corner| mesh.X[corner as usize]))
        };
        for parts in [2, 3, 7] {
            let (mut numbers, mut facets, mut last) = (BTreeMap::new(), Vec::new(), None);
            for own in (0..parts).map(|k| count * k / parts..count * (k + 1) / parts) {
                let found = part::<f64, D>(&grid, 2, 3.0, &clip, &|all| {
                    assert_eq!(all, count);
                    own.clone()
                });
                let (mut found, boundary) = found.unwrap();
                let of_part = found.mesh.as_mut().unwrap();
                for facet in &boundary {
                    assert!(last < Some(facet.number), "numbers of facets ascend");
                    last = Some(facet.number);
                    facets.push(at(of_part, facet));
                }
                // Numbers have gaps, and the order of those of the whole.
                let mut expected = whole.part(&own);
                let of_whole = expected.mesh.as_mut().unwrap().numbers.take().unwrap().corners;
                let own_numbers = of_part.numbers.take().unwrap().corners;
                assert_eq!(found, expected, "{parts} {own:?}");
                for (of_whole, number) in of_whole.into_iter().zip(own_numbers) {
                    assert_eq!(*numbers.entry(of_whole).or_insert(number), number);
                }
            }
            assert_eq!(numbers.len(), mesh.X.len());
            assert!(numbers.values().is_sorted_by(|a, b| a < b));
            let expected: Vec<_> = boundary.iter().map(|facet| at(mesh, facet)).collect();
            assert_eq!(facets, expected);
        }
    }

    #[test]
    fn parts_of_a_body_are_those_of_the_whole() {
        let around = [Side::Inner { radius: 0.35 }, Side::Outer { radius: 0.8 }];
        let straight =
            |angle: f64, distance| Side::Straight { normal: [angle.cos(), angle.sin()], distance };
        let wedge = [straight(0.3, 0.6), straight(1.9, 0.55), straight(4.0, 0.7)];
        // Slivers all along two sides, which join the boxes beside them.
        let block = [
            straight(0.0, 0.51),
            straight(0.5 * PI, 0.26),
            straight(PI, 0.74),
            straight(1.5 * PI, 0.88),
        ];
        for (k, offset) in [0.0, 0.2, -0.37, 0.5].into_iter().enumerate() {
            let turn = 0.3 * k as f64;
            check_parts::<2>(16, &around, turn, offset);
            check_parts::<2>(16, &wedge, turn, offset);
            check_parts::<2>(16, &block, 0.0, offset);
        }
        let flat = |axis: usize, sign: f64, distance| {
            let mut normal = [0.0; 3];
            normal[axis] = sign;
            Side::Straight { normal, distance }
        };
        let around = [Side::Inner { radius: 0.35 }, Side::Outer { radius: 0.8 }];
        let plate = [
            flat(0, 1.0, 0.62),
            flat(0, -1.0, 0.51),
            flat(2, 1.0, 0.27),
            flat(2, -1.0, 0.3),
            Side::Outer { radius: 0.85 },
        ];
        for (turn, offset) in [(0.0, 0.0), (0.4, 0.2), (0.0, -0.37)] {
            check_parts::<3>(8, &around, turn, offset);
            check_parts::<3>(8, &plate, turn, offset);
        }
    }

    /// Also where the segment first goes on in the direction from which it comes back.
    #[test]
    fn a_crossing_lies_on_its_circle() {
        for side in [Side::<2>::Outer { radius: 1.0 }, Side::Inner { radius: 1.0 }] {
            for k in 0..400 {
                let angle = 0.9 + 1e-2 * f64::from(k);
                let away = [1e-9, 1e-4, 0.3][k as usize % 3];
                let a = vector![0.6, 0.8] * (1.0 - away);
                let b = a + vector![angle.cos(), angle.sin()] * 1.7;
                let (da, db) = (side.distance(&a), side.distance(&b));
                if da * db < 0.0 {
                    let X = side.crossing((a, da), (b, db));
                    assert!(side.distance(&X).abs() < 1e-14, "{side:?} {angle} {away}: {X}");
                }
            }
        }
    }
}
