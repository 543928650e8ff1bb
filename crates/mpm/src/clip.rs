//! Bodies of any shape in the plane: the boxes of a lattice, clipped with the body's boundary.
//!
//! 1. Each box is clipped with one side of the body after another. A curved side becomes the chord between the places where it crosses
//!    the lines of the lattice. A crossing is computed once, from the line and the side alone, so that the boxes on either side of the
//!    line share it.
//! 2. What is left of a box, if it is a sliver, joins the neighbour with which it has the longest edge in common, so that no particle is
//!    much lighter than the others and the largest stable step stays that of whole boxes.
//! 3. A particle lies at the centroid of its polygons. Its mass is that of its part of the body, with the segments between chords and
//!    arcs: the mass of the body is exact.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Matrix2, RealField, SMatrix, SVector, Vector2, vector};

use crate::body::Body;
use crate::error::SetupError;
use crate::grid::Grid;
use crate::particles::Particles;
use crate::polygons::{Load, Polygons, cross};
use crate::tensor::real;

/// What is left of a box with less than this share of its area is a sliver.
const SLIVER: f64 = 0.2;

/// Places closer to a side than this, in units of the particles' distance, lie on it.
const ON: f64 = 1e-9;

/// A side of a body in the plane, in the axes of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// A straight side: the points with `X . normal <= distance` are inside.
    Straight {
        /// The outward unit normal.
        normal: [f64; 2],
        /// Its distance from the origin, along the normal.
        distance: f64,
    },
    /// A circle about the origin around the body.
    Outer {
        /// Its radius.
        radius: f64,
    },
    /// A circle about the origin, inside of which there is nothing.
    Inner {
        /// Its radius.
        radius: f64,
    },
}

impl Side {
    /// The distance from the side, positive inside.
    fn distance(&self, X: &Vector2<f64>) -> f64 {
        match *self {
            Self::Straight { normal: [n0, n1], distance } => distance - (n0 * X[0] + n1 * X[1]),
            Self::Outer { radius } => radius - X.norm(),
            Self::Inner { radius } => X.norm() - radius,
        }
    }

    /// The gradient of the distance.
    fn gradient(&self, X: &Vector2<f64>) -> Vector2<f64> {
        match *self {
            Self::Straight { normal: [n0, n1], .. } => vector![-n0, -n1],
            Self::Outer { .. } => -X.normalize(),
            Self::Inner { .. } => X.normalize(),
        }
    }

    /// Where the side crosses the segment from `a`, at distance `da` from it, to `b`, at `db` on its other side.
    fn crossing(&self, (a, da): (Vector2<f64>, f64), (b, db): (Vector2<f64>, f64)) -> Vector2<f64> {
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
                [far / square, rest / far]
                    .into_iter()
                    .filter(|s| s.is_finite())
                    .min_by(|s, t| (s - straight).abs().total_cmp(&(t - straight).abs()))
                    .unwrap_or(straight)
            }
        };
        a + along * share.clamp(0.0, 1.0)
    }

    /// The area between the side and its chord from `a` to `b`, positive where it belongs to the body.
    fn segment(&self, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
        let (radius, sign) = match *self {
            Self::Straight { .. } => return 0.0,
            Self::Outer { radius } => (radius, 1.0),
            Self::Inner { radius } => (radius, -1.0),
        };
        let half = (0.5 * (b - a).norm() / radius).min(1.0).asin();
        // half - sin(half) cos(half), without cancellation where the angle is small.
        let area = if half < 0.1 {
            let s = half * half;
            half * s * (2.0 / 3.0 - s * (2.0 / 15.0 - s * (4.0 / 315.0 - s * 2.0 / 2835.0)))
        } else {
            half - half.sin() * half.cos()
        };
        sign * radius * radius * area
    }
}

/// A part of the boundary between two corners, from the first to the second with the body on the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The index of the side that it belongs to.
    pub side: usize,
    /// The corners at its ends.
    pub corners: [u32; 2],
}

/// A lattice of boxes and the body that it is clipped with.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// The sides of the body.
    pub sides: Vec<Side>,
    /// Cosine and sine of the angle by which the axes of the grid are turned against those of the body, counter-clockwise.
    pub turn: [f64; 2],
    /// By how much the lattice is shifted along every axis of the grid, in units of the particles' distance.
    pub offset: f64,
}

/// What tells corners apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A corner of boxes.
    Lattice([i64; 2]),
    /// A side crosses the line of the lattice that goes from a corner along an axis.
    Crossing { from: [i64; 2], axis: usize, side: usize },
    /// Two sides meet in a box.
    Meeting { of_box: [i64; 2], sides: [usize; 2] },
}

/// What an edge of a polygon lies on.
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
    clip: &'a Clip,
    /// Where the lattice begins, in the axes of the grid.
    origin: Vector2<f64>,
    /// The distance of particles.
    spacing: f64,
    known: HashMap<Key, u32>,
    X: Vec<Vector2<f64>>,
    /// Distances from all sides, corner after corner; zero on a side.
    distances: Vec<f64>,
}

impl Corners<'_> {
    fn place(&self, [i, j]: [i64; 2]) -> Vector2<f64> {
        let at = self.origin + vector![i as f64, j as f64] * self.spacing;
        let [cos, sin] = self.clip.turn;
        vector![cos * at[0] - sin * at[1], sin * at[0] + cos * at[1]]
    }

    /// The corner of this key; `on` are sides on which it lies however it is rounded.
    fn corner(&mut self, key: Key, on: &[usize], place: impl FnOnce(&Self) -> Vector2<f64>) -> u32 {
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let corner = self.X.len() as u32;
        let X = place(self);
        for (k, side) in self.clip.sides.iter().enumerate() {
            let distance = side.distance(&X);
            let is_on = on.contains(&k) || distance.abs() < ON * self.spacing;
            self.distances.push(if is_on { 0.0 } else { distance });
        }
        self.X.push(X);
        self.known.insert(key, corner);
        corner
    }

    fn distance(&self, corner: u32, side: usize) -> f64 {
        self.distances[corner as usize * self.clip.sides.len() + side]
    }

    fn at(&self, corner: u32) -> Vector2<f64> {
        self.X[corner as usize]
    }

    /// Where a side crosses an edge of a polygon of a box.
    fn crossing(&mut self, of_box: [i64; 2], line: Line, (a, b): (u32, u32), side: usize) -> u32 {
        let own = self.clip.sides[side];
        match line {
            Line::Lattice { from, axis } => {
                let key = Key::Crossing { from, axis, side };
                self.corner(key, &[side], |corners| {
                    let mut to = from;
                    to[axis] += 1;
                    let [a, b] = [from, to].map(|index| corners.place(index));
                    own.crossing((a, own.distance(&a)), (b, own.distance(&b)))
                })
            }
            Line::Side(other) => {
                let sides = [side.min(other), side.max(other)];
                self.corner(Key::Meeting { of_box, sides }, &[side, other], |corners| {
                    let [a, b] = [a, b].map(|corner| corners.at(corner));
                    let mut X = own.crossing((a, own.distance(&a)), (b, own.distance(&b)));
                    let other = corners.clip.sides[other];
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

    /// What the sides leave of a box: corners and the lines of the edges that begin there, counter-clockwise.
    fn clipped(&mut self, of_box: [i64; 2]) -> Vec<(u32, Line)> {
        let [i, j] = of_box;
        let around = [
            ([i, j], Line::Lattice { from: [i, j], axis: 0 }),
            ([i + 1, j], Line::Lattice { from: [i + 1, j], axis: 1 }),
            ([i + 1, j + 1], Line::Lattice { from: [i, j + 1], axis: 0 }),
            ([i, j + 1], Line::Lattice { from: [i, j], axis: 1 }),
        ];
        // Most boxes are whole or none, which needs no corners.
        let places = around.map(|(index, _)| self.place(index));
        for side in &self.clip.sides {
            if places.iter().all(|X| side.distance(X) < ON * self.spacing) {
                return Vec::new();
            }
        }
        let polygon = around.map(|(index, line)| {
            (self.corner(Key::Lattice(index), &[], |corners| corners.place(index)), line)
        });
        let mut polygon = polygon.to_vec();
        for side in 0..self.clip.sides.len() {
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
            let triangle = cross(&a, &b);
            area += triangle;
            moment += (a + b) * triangle;
        }
        (area, moment + about * (3.0 * area))
    }
}

/// Polygons that make one particle.
struct Group {
    members: Vec<usize>,
    area: f64,
}

/// Joins slivers to the neighbours with which they have the longest edges in common; the members of each particle.
fn join(corners: &Corners<'_>, polygons: &[Vec<(u32, Line)>], areas: &[f64]) -> Vec<Vec<usize>> {
    let whole = corners.spacing * corners.spacing;
    let mut on_edge: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
    let sorted = |a: u32, b: u32| [a.min(b), a.max(b)];
    let edges = |polygon: &[(u32, Line)]| -> Vec<[u32; 2]> {
        let next = |k: usize| polygon[(k + 1) % polygon.len()].0;
        polygon.iter().enumerate().map(|(k, (corner, _))| sorted(*corner, next(k))).collect()
    };
    const NONE: usize = usize::MAX;
    for (index, polygon) in polygons.iter().enumerate() {
        for edge in edges(polygon) {
            let both = on_edge.entry(edge).or_insert([NONE; 2]);
            both[usize::from(both[0] != NONE)] = index;
        }
    }
    let mut group_of: Vec<usize> = (0..polygons.len()).collect();
    let mut groups: Vec<Group> = areas
        .iter()
        .enumerate()
        .map(|(index, &area)| Group { members: vec![index], area })
        .collect();
    let mut slivers: Vec<_> =
        (0..polygons.len()).filter(|index| areas[*index] < SLIVER * whole).collect();
    slivers.sort_by(|a, b| areas[*a].total_cmp(&areas[*b]).then(a.cmp(b)));
    for sliver in slivers {
        let own = group_of[sliver];
        if groups[own].area >= SLIVER * whole {
            continue;
        }
        let mut common: BTreeMap<usize, f64> = BTreeMap::new();
        for &member in &groups[own].members {
            for edge in edges(&polygons[member]) {
                for other in on_edge[&edge].into_iter().filter(|other| *other != NONE) {
                    let group = group_of[other];
                    if group != own {
                        let length = (corners.at(edge[0]) - corners.at(edge[1])).norm();
                        *common.entry(group).or_insert(0.0) += length;
                    }
                }
            }
        }
        let longest = common.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)));
        let Some((&to, _)) = longest else { continue };
        let Group { members, area } =
            std::mem::replace(&mut groups[own], Group { members: Vec::new(), area: 0.0 });
        members.iter().for_each(|member| group_of[*member] = to);
        groups[to].members.extend(members);
        groups[to].area += area;
    }
    groups.into_iter().map(|group| group.members).filter(|members| !members.is_empty()).collect()
}

impl<T: RealField + Copy, const D: usize> Body<T, D> {
    /// A body in the plane at rest, of the boxes of a lattice with `per_cell` of them in a cell of the grid and direction, clipped with
    /// its sides; and its boundary, edge by edge, but for what lies on the grid's walls. `grid` is in its own axes.
    ///
    /// # Errors
    ///
    /// [`SetupError::PolygonDimension`] in other dimensions than two.
    pub fn clipped(
        grid: &Grid<f64, D>,
        per_cell: usize,
        density: f64,
        clip: &Clip,
    ) -> Result<(Self, Vec<Edge>), SetupError> {
        if D != 2 {
            return Err(SetupError::PolygonDimension { dimension: D });
        }
        let spacing = grid.spacing / per_cell.max(1) as f64;
        let lower = vector![grid.lower[0], grid.lower[D - 1]];
        let mut corners = Corners {
            clip,
            origin: lower.add_scalar(clip.offset * spacing),
            spacing,
            known: HashMap::new(),
            X: Vec::new(),
            distances: Vec::new(),
        };
        let mut polygons = Vec::new();
        let in_cell = per_cell.max(1) as i64;
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
        let particles = join(&corners, &polygons, &areas);
        Ok(assemble(density, &corners, &polygons, &particles))
    }
}

/// The body of particles with these members.
fn assemble<T: RealField + Copy, const D: usize>(
    density: f64,
    corners: &Corners<'_>,
    polygons: &[Vec<(u32, Line)>],
    particles: &[Vec<usize>],
) -> (Body<T, D>, Vec<Edge>) {
    let Corners { clip, spacing, .. } = corners;
    let vector = |X: Vector2<f64>| SVector::<T, D>::from_fn(|a, _| real(X[a]));
    let mut uses: HashMap<[u32; 2], usize> = HashMap::new();
    for polygon in polygons {
        for (k, (corner, _)) in polygon.iter().enumerate() {
            let next = polygon[(k + 1) % polygon.len()].0;
            *uses.entry([*corner.min(&next), *corner.max(&next)]).or_insert(0) += 1;
        }
    }
    const NONE: u32 = u32::MAX;
    let mut renumbered = vec![NONE; corners.X.len()];
    let mut own = Polygons {
        X: Vec::new(),
        x: Vec::new(),
        corners: Vec::new(),
        ends: Vec::new(),
        of_particles: Vec::new(),
        loads: Vec::<Load<T>>::new(),
        turn: (clip.turn != [1.0, 0.0]).then(|| {
            let [cos, sin] = clip.turn;
            SMatrix::from_fn(|i, j| {
                real(if i == j {
                    cos
                } else if i < j {
                    sin
                } else {
                    -sin
                })
            })
        }),
    };
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
                if uses[&[corner.min(next), corner.max(next)]] > 1 {
                    continue;
                }
                let on_both = |side: &usize| {
                    [corner, next].iter().all(|at| corners.distance(*at, *side) == 0.0)
                };
                let side = match line {
                    Line::Side(side) => Some(side),
                    Line::Lattice { .. } => (0..clip.sides.len()).find(on_both),
                };
                // What has no side lies where the grid ends.
                let Some(side) = side else { continue };
                segments += clip.sides[side].segment(&corners.at(corner), &corners.at(next));
                boundary.push(Edge { side, corners: [corner, next] });
            }
            own.ends.push(own.corners.len() as u32);
        }
        own.of_particles.push(own.ends.len() as u32);
        X.push(vector(moment / area));
        volume.push(real(area));
        mass.push(real(density * (area + segments)));
    }
    own.x.clone_from(&own.X);
    for edge in &mut boundary {
        edge.corners = edge.corners.map(|corner| renumbered[corner as usize]);
    }
    let count = X.len();
    let particles = Particles {
        x: X.clone(),
        X,
        v: vec![SVector::zeros(); count],
        F: vec![SMatrix::identity(); count],
        mass,
        volume,
        half_size: SVector::repeat(real(0.5 * spacing)),
    };
    (Body { particles, half_edges: Vec::new(), mesh: None, polygons: Some(own) }, boundary)
}
