//! Bodies in the plane: polygons.

use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::HashMap;

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid, Interpolation, Mesh};
use nalgebra::{Matrix2, RealField, SVector, Vector2, vector};

use super::{Clip, Contact, Facet, Lattice, ON, Side, at_rest, join, turn_of};

/// The key by which corners are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A corner of boxes.
    Lattice([i64; 2]),
    /// A side crosses the line of the lattice that goes from a corner along an axis.
    Crossing { from: [i64; 2], axis: usize, side: usize },
    /// Two sides meet in a box.
    Meeting { of_box: [i64; 2], sides: [usize; 2] },
}

/// The line or circle on which an edge of a polygon lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    /// The line of the lattice from a corner of boxes along an axis.
    Lattice {
        from: [i64; 2],
        axis: usize,
    },
    Side(usize),
}

/// The corners of all polygons.
struct Corners<'a> {
    sides: &'a [Side<2>],
    lattice: Lattice<2>,
    known: HashMap<Key, u32>,
    X: Vec<Vector2<f64>>,
    /// Distances from all sides, corner after corner; zero on a side.
    distances: Vec<f64>,
}

impl Corners<'_> {
    /// The corner of this key; `on` are sides on which it lies however it is rounded.
    fn corner(&mut self, key: Key, on: &[usize], place: impl FnOnce(&Self) -> Vector2<f64>) -> u32 {
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let corner = self.X.len() as u32;
        let X = place(self);
        for (k, side) in self.sides.iter().enumerate() {
            let distance = side.distance(&X);
            let is_on = on.contains(&k) || distance.abs() < ON * self.lattice.spacing;
            self.distances.push(if is_on { 0.0 } else { distance });
        }
        self.X.push(X);
        self.known.insert(key, corner);
        corner
    }

    fn distance(&self, corner: u32, side: usize) -> f64 {
        self.distances[corner as usize * self.sides.len() + side]
    }

    fn at(&self, corner: u32) -> Vector2<f64> {
        self.X[corner as usize]
    }

    /// Where a side crosses an edge of a polygon of a box.
    fn crossing(&mut self, of_box: [i64; 2], line: Line, (a, b): (u32, u32), side: usize) -> u32 {
        let own = self.sides[side];
        match line {
            Line::Lattice { from, axis } => {
                let key = Key::Crossing { from, axis, side };
                self.corner(key, &[side], |corners| {
                    let mut to = from;
                    to[axis] += 1;
                    let [a, b] = [from, to].map(|index| corners.lattice.place(index));
                    own.crossing((a, own.distance(&a)), (b, own.distance(&b)))
                })
            }
            Line::Side(other) => {
                let sides = [side.min(other), side.max(other)];
                self.corner(Key::Meeting { of_box, sides }, &[side, other], |corners| {
                    let [a, b] = [a, b].map(|corner| corners.at(corner));
                    let mut X = own.crossing((a, own.distance(&a)), (b, own.distance(&b)));
                    let other = corners.sides[other];
                    // Newton's method; two straight sides need one step.
                    for _ in 0..8 {
                        let rows = [own.gradient(&X).transpose(), other.gradient(&X).transpose()];
                        let misses = vector![own.distance(&X), other.distance(&X)];
                        let Some(step) = Matrix2::from_rows(&rows).lu().solve(&misses) else {
                            break;
                        };
                        X -= step;
                    }
                    X
                })
            }
        }
    }

    /// The polygon that is left of a box inside the sides: corners and the lines of the edges that begin there, counter-clockwise.
    fn clipped(&mut self, of_box: [i64; 2]) -> Vec<(u32, Line)> {
        let [i, j] = of_box;
        let around = [
            ([i, j], Line::Lattice { from: [i, j], axis: 0 }),
            ([i + 1, j], Line::Lattice { from: [i + 1, j], axis: 1 }),
            ([i + 1, j + 1], Line::Lattice { from: [i, j + 1], axis: 0 }),
            ([i, j + 1], Line::Lattice { from: [i, j], axis: 1 }),
        ];
        // Most boxes are whole or none, which needs no corners.
        let places = around.map(|(index, _)| self.lattice.place(index));
        for side in self.sides {
            if places.iter().all(|X| side.distance(X) < ON * self.lattice.spacing) {
                return Vec::new();
            }
        }
        let polygon = around.map(|(index, line)| {
            (self.corner(Key::Lattice(index), &[], |corners| corners.lattice.place(index)), line)
        });
        let mut polygon = polygon.to_vec();
        for side in 0..self.sides.len() {
            let outside = |corners: &Self, corner: u32| corners.distance(corner, side) < 0.0;
            if !polygon.iter().any(|(corner, _)| outside(self, *corner)) {
                continue;
            }
            let mut kept = Vec::with_capacity(polygon.len() + 2);
            for (k, &(from, line)) in polygon.iter().enumerate() {
                let (to, _) = polygon[(k + 1) % polygon.len()];
                let (here, there) = (self.distance(from, side), self.distance(to, side));
                if here > 0.0 || (here == 0.0 && there >= 0.0) {
                    kept.push((from, line));
                } else if here == 0.0 {
                    kept.push((from, Line::Side(side)));
                }
                if here > 0.0 && there < 0.0 {
                    kept.push((self.crossing(of_box, line, (from, to), side), Line::Side(side)));
                } else if here < 0.0 && there > 0.0 {
                    kept.push((self.crossing(of_box, line, (from, to), side), line));
                }
            }
            polygon = kept;
        }
        // Sides that meet on a line of the lattice may leave a corner twice.
        let mut corners: Vec<_> = polygon.iter().map(|(corner, _)| *corner).collect();
        let repeated = (0..corners.len()).map(|k| corners[k] == corners[(k + 1) % corners.len()]);
        let repeated: Vec<_> = repeated.collect();
        let mut next = repeated.iter();
        polygon.retain(|_| !next.next().copied().unwrap_or(false));
        corners.sort_unstable();
        corners.dedup();
        if corners.len() < 3 { Vec::new() } else { polygon }
    }

    /// Twice the area of a polygon, and six times its first moment.
    fn moments(&self, polygon: &[(u32, Line)]) -> (f64, Vector2<f64>) {
        let about = self.at(polygon[0].0);
        let (mut area, mut moment) = (0.0, Vector2::zeros());
        for (k, (corner, _)) in polygon.iter().enumerate() {
            let next = polygon[(k + 1) % polygon.len()].0;
            let (a, b) = (self.at(*corner) - about, self.at(next) - about);
            let triangle = a.perp(&b);
            area += triangle;
            moment += (a + b) * triangle;
        }
        (area, moment + about * (3.0 * area))
    }
}

/// The segment between a circle and its chord from `a` to `b`, an area, positive where it belongs to the body.
fn segment(side: Side<2>, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let (radius, sign) = match side {
        Side::Straight { .. } => return 0.0,
        Side::Outer { radius } => (radius, 1.0),
        Side::Inner { radius } => (radius, -1.0),
    };
    let half = libm::asin((0.5 * (b - a).norm() / radius).min(1.0));
    // half - sin(half) cos(half), without cancellation where the angle is small.
    let area = if half < 0.1 {
        let s = half * half;
        half * s * (2.0 / 3.0 - s * (2.0 / 15.0 - s * (4.0 / 315.0 - s * 2.0 / 2835.0)))
    } else {
        half - half.sine() * half.cosine()
    };
    sign * radius * radius * area
}

/// Edges of the polygons, and the polygons on either side of each.
struct Neighbours<'a> {
    corners: &'a Corners<'a>,
    polygons: &'a [Vec<(u32, Line)>],
    on_edge: HashMap<[u32; 2], Vec<usize>>,
}

impl<'a> Neighbours<'a> {
    fn new(corners: &'a Corners<'a>, polygons: &'a [Vec<(u32, Line)>]) -> Self {
        let mut on_edge: HashMap<_, Vec<usize>> = HashMap::new();
        for (index, polygon) in polygons.iter().enumerate() {
            for edge in edges(polygon) {
                on_edge.entry(edge).or_default().push(index);
            }
        }
        Self { corners, polygons, on_edge }
    }

    fn contacts(&self, polygon: usize) -> Vec<Contact> {
        let of_edge = |edge: [u32; 2]| {
            let measure = (self.corners.at(edge[0]) - self.corners.at(edge[1])).norm();
            let others = self.on_edge[&edge].iter().filter(move |other| **other != polygon);
            others.map(move |&with| Contact { with, measure })
        };
        edges(&self.polygons[polygon]).flat_map(of_edge).collect()
    }
}

/// The edges of a polygon, the lower corner first.
fn edges(polygon: &[(u32, Line)]) -> impl Iterator<Item = [u32; 2]> {
    polygon.iter().enumerate().map(|(k, &(corner, _))| {
        let next = polygon[(k + 1) % polygon.len()].0;
        [corner.min(next), corner.max(next)]
    })
}

/// The body, and its boundary.
pub(super) fn body<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
) -> (Body<T, D>, Vec<Facet<D>>) {
    let spacing = grid.spacing / per_cell as f64;
    let lower = vector![grid.lower[0], grid.lower[D - 1]];
    let sides: Vec<Side<2>> = clip.sides.iter().map(|side| side.carried()).collect();
    let mut corners = Corners {
        sides: &sides,
        lattice: Lattice {
            origin: lower.add_scalar(clip.offset * spacing),
            spacing,
            turn: clip.turn,
        },
        known: HashMap::new(),
        X: Vec::new(),
        distances: Vec::new(),
    };
    let mut polygons = Vec::new();
    let in_cell = per_cell as i64;
    // A shifted lattice begins in the cell beside the grid.
    let range = |axis: usize| -1..=grid.cells[axis] as i64;
    for cell_j in range(D - 1) {
        for cell_i in range(0) {
            for j in cell_j * in_cell..(cell_j + 1) * in_cell {
                for i in cell_i * in_cell..(cell_i + 1) * in_cell {
                    let polygon = corners.clipped([i, j]);
                    if !polygon.is_empty() {
                        polygons.push(polygon);
                    }
                }
            }
        }
    }
    let areas: Vec<f64> = polygons.iter().map(|own| 0.5 * corners.moments(own).0).collect();
    let neighbours = Neighbours::new(&corners, &polygons);
    let particles = join(&areas, spacing * spacing, |polygon| neighbours.contacts(polygon));
    assemble(density, &neighbours, &particles)
}

/// The body of particles with these members.
fn assemble<T: RealField + Copy, const D: usize>(
    density: f64,
    neighbours: &Neighbours<'_>,
    particles: &[Vec<usize>],
) -> (Body<T, D>, Vec<Facet<D>>) {
    let Neighbours { corners, polygons, on_edge } = neighbours;
    let Corners { sides, lattice: Lattice { spacing, turn, .. }, .. } = corners;
    let vector = |X: Vector2<f64>| SVector::<T, D>::from_fn(|a, _| real(X[a]));
    const NONE: u32 = u32::MAX;
    let mut renumbered = vec![NONE; corners.X.len()];
    let mut own = Mesh::empty(Interpolation::Triangles, turn_of(*turn));
    let mut boundary = Vec::new();
    let (mut X, mut volume, mut mass) = (Vec::new(), Vec::new(), Vec::new());
    for members in particles {
        let (mut area, mut moment, mut segments) = (0.0, Vector2::zeros(), 0.0);
        for &member in members {
            let polygon = &polygons[member];
            let (twice, six_fold) = corners.moments(polygon);
            area += 0.5 * twice;
            moment += six_fold / 6.0;
            for (k, &(corner, line)) in polygon.iter().enumerate() {
                let new = &mut renumbered[corner as usize];
                if *new == NONE {
                    *new = own.X.len() as u32;
                    own.X.push(vector(corners.at(corner)));
                }
                own.corners.push(*new);
                let next = polygon[(k + 1) % polygon.len()].0;
                if on_edge[&[corner.min(next), corner.max(next)]].len() > 1 {
                    continue;
                }
                let on_both = |side: &usize| {
                    [corner, next].iter().all(|at| corners.distance(*at, *side) == 0.0)
                };
                let side = match line {
                    Line::Side(side) => Some(side),
                    Line::Lattice { .. } => (0..sides.len()).find(on_both),
                };
                // What has no side lies where the grid ends.
                let Some(side) = side else { continue };
                segments += segment(sides[side], &corners.at(corner), &corners.at(next));
                let ends = std::array::from_fn(|k| [corner, next][k.min(1)]);
                boundary.push(Facet { side, corners: ends });
            }
            own.ends.push(own.corners.len() as u32);
        }
        own.of_particles.push(own.ends.len() as u32);
        X.push(vector(moment / area));
        volume.push(real(area));
        mass.push(real(density * (area + segments)));
    }
    for edge in &mut boundary {
        edge.corners = edge.corners.map(|corner| renumbered[corner as usize]);
    }
    (at_rest(own, X, volume, mass, *spacing), boundary)
}
