//! Bodies in space: polyhedra.
//!
//! Each face of a box is clipped as a polygon; what a side cuts open is closed by a face between the cuts. A cut lies on an edge between
//! two corners that all boxes at the edge share, so that they share the cut. Faces on the boundary become triangles, on which loads act.

use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::{BTreeMap, HashMap, HashSet};

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid, Interpolation, Mesh};
use nalgebra::{RealField, SVector, Vector3};

use super::{Clip, Contact, Facet, Lattice, ON, Side, at_rest, join, turn_of};

/// The key by which corners are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A corner of boxes.
    Lattice([i64; 3]),
    /// A side cuts the edge between two corners, the lower one first.
    Cut { ends: [u32; 2], side: usize },
}

/// The plane or surface on which a face lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Plane {
    /// The face between boxes from a corner of the lattice on, with its normal along an axis.
    Lattice {
        from: [i64; 3],
        axis: usize,
    },
    Side(usize),
}

/// A face, its corners counter-clockwise as seen from outside.
struct Face {
    plane: Plane,
    corners: Vec<u32>,
}

/// The polyhedron that is left of a box inside the sides.
type Polyhedron = Vec<Face>;

/// The corners of all polyhedra.
struct Corners<'a> {
    sides: &'a [Side<3>],
    lattice: Lattice<3>,
    known: HashMap<Key, u32>,
    X: Vec<Vector3<f64>>,
    /// Distances from all sides, corner after corner; zero on a side.
    distances: Vec<f64>,
}

impl Corners<'_> {
    /// The corner of this key, on a side if that is told, however it is rounded.
    fn corner(
        &mut self,
        key: Key,
        on: Option<usize>,
        place: impl FnOnce(&Self) -> Vector3<f64>,
    ) -> u32 {
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let corner = self.X.len() as u32;
        let X = place(self);
        for (k, side) in self.sides.iter().enumerate() {
            let distance = side.distance(&X);
            let is_on = on == Some(k) || distance.abs() < ON * self.lattice.spacing;
            self.distances.push(if is_on { 0.0 } else { distance });
        }
        self.X.push(X);
        self.known.insert(key, corner);
        corner
    }

    fn distance(&self, corner: u32, side: usize) -> f64 {
        self.distances[corner as usize * self.sides.len() + side]
    }

    fn at(&self, corner: u32) -> Vector3<f64> {
        self.X[corner as usize]
    }

    /// Where a side cuts the edge between two corners on either side of it.
    fn cut(&mut self, from: u32, to: u32, side: usize) -> u32 {
        let ends = [from.min(to), from.max(to)];
        self.corner(Key::Cut { ends, side }, Some(side), |corners| {
            let [a, b] = ends.map(|end| (corners.at(end), corners.distance(end, side)));
            corners.sides[side].crossing(a, b)
        })
    }

    /// The polyhedron that is left of a box inside the sides; nothing where the box lies outside.
    fn clipped(&mut self, of_box: [i64; 3]) -> Polyhedron {
        let index = |bits: usize| std::array::from_fn(|a| of_box[a] + (bits >> a & 1) as i64);
        // Most boxes are whole or none, which needs no corners.
        let places: [_; 8] = std::array::from_fn(|bits| self.lattice.place(index(bits)));
        for side in self.sides {
            if places.iter().all(|X| side.distance(X) < ON * self.lattice.spacing) {
                return Vec::new();
            }
        }
        let corners: [u32; 8] = std::array::from_fn(|bits| {
            let index = index(bits);
            self.corner(Key::Lattice(index), None, |corners| corners.lattice.place(index))
        });
        let mut faces = Vec::with_capacity(7);
        for axis in 0..3 {
            let (along, b, c) = (1 << axis, 1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            for (upper, around) in [(0, [0, c, b + c, b]), (along, [0, b, b + c, c])] {
                let plane = Plane::Lattice { from: index(upper), axis };
                let corners = around.map(|bits| corners[upper + bits]).to_vec();
                faces.push(Face { plane, corners });
            }
        }
        for side in 0..self.sides.len() {
            let is_outside = |corner: &u32| self.distance(*corner, side) < 0.0;
            if faces.iter().any(|face| face.corners.iter().any(is_outside)) {
                faces = faces.into_iter().filter_map(|face| self.clip(face, side)).collect();
                close(&mut faces, side);
            }
        }
        if faces.len() < 4 { Vec::new() } else { faces }
    }

    /// The part of a face inside a side.
    fn clip(&mut self, face: Face, side: usize) -> Option<Face> {
        let mut kept = Vec::with_capacity(face.corners.len() + 1);
        for (k, &from) in face.corners.iter().enumerate() {
            let to = face.corners[(k + 1) % face.corners.len()];
            let (here, there) = (self.distance(from, side), self.distance(to, side));
            if here >= 0.0 {
                kept.push(from);
            }
            if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                kept.push(self.cut(from, to, side));
            }
        }
        (kept.len() >= 3).then_some(Face { plane: face.plane, corners: kept })
    }

    /// Six times the volume of a polyhedron, and 24 times its first moment.
    fn moments(&self, polyhedron: &Polyhedron) -> (f64, Vector3<f64>) {
        let about = self.at(polyhedron[0].corners[0]);
        let (mut volume, mut moment) = (0.0, Vector3::zeros());
        for Face { corners, .. } in polyhedron {
            let mean = self.mean(corners) - about;
            for (k, &corner) in corners.iter().enumerate() {
                let next = corners[(k + 1) % corners.len()];
                let (a, b) = (self.at(corner) - about, self.at(next) - about);
                let tetrahedron = a.cross(&b).dot(&mean);
                volume += tetrahedron;
                moment += (a + b + mean) * tetrahedron;
            }
        }
        (volume, moment + about * (4.0 * volume))
    }

    fn mean(&self, corners: &[u32]) -> Vector3<f64> {
        let sum: Vector3<f64> = corners.iter().map(|&corner| self.at(corner)).sum();
        sum / corners.len() as f64
    }

    fn area(&self, corners: &[u32]) -> f64 {
        let about = self.at(corners[0]);
        let of_pair = |pair: &[u32]| {
            let [a, b] = [pair[0], pair[1]].map(|corner| self.at(corner) - about);
            a.cross(&b)
        };
        0.5 * corners.windows(2).map(of_pair).sum::<Vector3<f64>>().norm()
    }
}

/// Adds the faces on a side where it has cut a polyhedron open.
fn close(faces: &mut Polyhedron, side: usize) {
    let mut edges = HashSet::new();
    for Face { corners, .. } in &*faces {
        for (k, &from) in corners.iter().enumerate() {
            edges.insert([from, corners[(k + 1) % corners.len()]]);
        }
    }
    // From each open end back along the edge.
    let is_open = |[from, to]: &&[u32; 2]| !edges.contains(&[*to, *from]);
    let mut next: BTreeMap<u32, u32> =
        edges.iter().filter(is_open).map(|&[from, to]| (to, from)).collect();
    while let Some((first, mut corner)) = next.pop_first() {
        let mut corners = vec![first];
        while corner != first {
            corners.push(corner);
            let Some(following) = next.remove(&corner) else { break };
            corner = following;
        }
        if corners.len() >= 3 {
            faces.push(Face { plane: Plane::Side(side), corners });
        }
    }
}

/// The volume between a sphere and a triangle with its corners on it, counter-clockwise as seen from outside of the body: a volume,
/// positive where it belongs to the body.
///
/// The solid angle is that of A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126. Arcs between corners are
/// those of great circles: neighbours share them, so that all of them are the sphere's.
fn segment(side: Side<3>, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let radius = match side {
        Side::Straight { .. } => return 0.0,
        Side::Outer { radius } | Side::Inner { radius } => radius,
    };
    let [a, b, c] = [a, b, c].map(|X| X / radius);
    let product = a.dot(&b.cross(&c));
    let angle = 2.0 * product.polar_angle(1.0 + a.dot(&b) + b.dot(&c) + c.dot(&a));
    radius.powi(3) * (angle / 3.0 - product / 6.0)
}

/// The body, and its boundary.
pub(super) fn body<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
) -> (Body<T, D>, Vec<Facet<D>>) {
    let spacing = grid.spacing / per_cell as f64;
    let lower = Vector3::from_fn(|a, _| grid.lower[a.min(D - 1)]);
    let sides: Vec<Side<3>> = clip.sides.iter().map(|side| side.carried()).collect();
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
    let mut polyhedra = Vec::new();
    let boxes = |axis: usize| {
        let in_cell = per_cell as i64;
        // A shifted lattice begins in the cell beside the grid.
        -in_cell..(grid.cells[axis.min(D - 1)] as i64 + 1) * in_cell
    };
    for k in boxes(2) {
        for j in boxes(1) {
            for i in boxes(0) {
                let polyhedron = corners.clipped([i, j, k]);
                if !polyhedron.is_empty() {
                    polyhedra.push(polyhedron);
                }
            }
        }
    }
    let mut between: HashMap<Plane, Vec<usize>> = HashMap::new();
    for (index, polyhedron) in polyhedra.iter().enumerate() {
        for face in polyhedron {
            if let Plane::Lattice { .. } = face.plane {
                between.entry(face.plane).or_default().push(index);
            }
        }
    }
    // The side of each face on the boundary.
    let side_of = |corners: &Corners<'_>, face: &Face| match face.plane {
        Plane::Side(side) => Some(side),
        Plane::Lattice { .. } if between[&face.plane].len() > 1 => None,
        // What has no side lies where the grid ends.
        Plane::Lattice { .. } => (0..sides.len())
            .find(|side| face.corners.iter().all(|at| corners.distance(*at, *side) == 0.0)),
    };
    for polyhedron in &mut polyhedra {
        let of_face = |face: Face| match side_of(&corners, &face) {
            None => vec![face],
            Some(side) => {
                let triangle = |pair: &[u32]| Face {
                    plane: Plane::Side(side),
                    corners: vec![face.corners[0], pair[0], pair[1]],
                };
                face.corners[1..].windows(2).map(triangle).collect()
            }
        };
        *polyhedron = std::mem::take(polyhedron).into_iter().flat_map(of_face).collect();
    }
    let volumes: Vec<f64> = polyhedra.iter().map(|own| corners.moments(own).0 / 6.0).collect();
    let particles = join(&volumes, spacing.powi(3), |index| {
        let of_face = |face: &Face| {
            let measure = corners.area(&face.corners);
            let others = between.get(&face.plane).into_iter().flatten().copied();
            others.filter(move |with| *with != index).map(move |with| Contact { with, measure })
        };
        polyhedra[index].iter().flat_map(of_face).collect()
    });
    assemble(density, &corners, &polyhedra, &particles)
}

/// The body of particles with these members.
fn assemble<T: RealField + Copy, const D: usize>(
    density: f64,
    corners: &Corners<'_>,
    polyhedra: &[Polyhedron],
    particles: &[Vec<usize>],
) -> (Body<T, D>, Vec<Facet<D>>) {
    let Corners { sides, lattice: Lattice { spacing, turn, .. }, .. } = corners;
    let vector = |X: Vector3<f64>| SVector::<T, D>::from_fn(|a, _| real(X[a]));
    const NONE: u32 = u32::MAX;
    let mut renumbered = vec![NONE; corners.X.len()];
    let mut own = Mesh::empty(Interpolation::Triangles, turn_of(*turn));
    let mut boundary = Vec::new();
    let (mut X, mut volume, mut mass) = (Vec::new(), Vec::new(), Vec::new());
    // Among the corners of the polyhedron at hand.
    let mut places: Vec<u32> = Vec::new();
    for members in particles {
        let (mut whole, mut moment, mut segments) = (0.0, Vector3::zeros(), 0.0);
        for &member in members {
            let (six_fold, of_moment) = corners.moments(&polyhedra[member]);
            whole += six_fold / 6.0;
            moment += of_moment / 24.0;
            places.clear();
            for face in &polyhedra[member] {
                for &corner in &face.corners {
                    let new = &mut renumbered[corner as usize];
                    if *new == NONE {
                        *new = own.X.len() as u32;
                        own.X.push(vector(corners.at(corner)));
                    }
                    let place = places.iter().position(|known| known == new);
                    let place = place.unwrap_or_else(|| {
                        places.push(*new);
                        places.len() - 1
                    });
                    own.faces.corners.push(place as u32);
                }
                own.faces.ends.push(own.faces.corners.len() as u32);
                if let (Plane::Side(side), &[a, b, c]) = (face.plane, &face.corners[..]) {
                    segments += segment(sides[side], [a, b, c].map(|corner| corners.at(corner)));
                    let of_facet = [a, b, c].map(|corner| renumbered[corner as usize]);
                    let of_facet = std::array::from_fn(|k| of_facet[k.min(2)]);
                    boundary.push(Facet { side, corners: of_facet });
                }
            }
            own.faces.of_polyhedra.push(own.faces.ends.len() as u32);
            own.corners.extend_from_slice(&places);
            own.ends.push(own.corners.len() as u32);
        }
        own.of_particles.push(own.ends.len() as u32);
        X.push(vector(moment / whole));
        volume.push(real(whole));
        mass.push(real(density * (whole + segments)));
    }
    (at_rest(own, X, volume, mass, *spacing), boundary)
}
