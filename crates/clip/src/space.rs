//! Bodies in space: polyhedra.
//!
//! Each face of a box is clipped as a polygon; what a side cuts open is closed by a face between the cuts. A cut lies on an edge between
//! two corners that all boxes at the edge share, so that they share the cut. Faces on the boundary become triangles, on which loads act.

use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;

use mmsmith_lanes::tensor::real;
use mmsmith_particles::{Body, Grid};
use nalgebra::{RealField, SVector, Vector3};

use super::boxes::{Division, Lattice, Left, Survey};
use super::{Clip, Contact, Facet, Made, ON, Side, join};

/// The key by which corners are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A corner of boxes.
    Lattice([i64; 3]),
    /// A side cuts the edge between two corners, the one with the lower rank first.
    Cut { ends: [u32; 2], side: usize },
}

/// The plane or surface on which a face of a box lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plane {
    /// Between this box and the one below it along an axis, or above it.
    Lattice {
        axis: u8,
        is_upper: bool,
    },
    Side(u32),
}

/// A face, its corners counter-clockwise as seen from outside.
#[derive(Clone)]
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
    /// The ranks of corners, once they are known.
    ranks: Vec<Option<u64>>,
    /// The box that is being clipped, and how many corners it has brought.
    brought: (u64, u64),
}

/// Ranks have the box of a corner in the bits from this one on, and begin with its own corners.
const BOX: u32 = 16;

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
        self.ranks.push(None);
        self.known.insert(key, corner);
        corner
    }

    /// The corner of boxes of an index.
    fn of_lattice(&mut self, index: [i64; 3]) -> u32 {
        self.corner(Key::Lattice(index), None, |corners| corners.lattice.place(index))
    }

    /// The place of a corner in the order in which boxes would bring corners, if all were clipped in the order of their numbers: by it, and not by the number here,
    /// corners are told apart where their order shows in roundings, so that a part of a body has those of the whole.
    fn rank(&mut self, corner: u32, index: impl FnOnce() -> [i64; 3]) -> u64 {
        if let Some(rank) = self.ranks[corner as usize] {
            return rank;
        }
        let index = index();
        let of_box = |bits: usize| {
            let of_box = std::array::from_fn(|a| index[a] - (bits >> a & 1) as i64);
            let number = self.lattice.number(of_box)?;
            let is_met = !matches!(self.lattice.left(self.sides, of_box), Left::Nothing);
            is_met.then_some(number << BOX | bits as u64)
        };
        let rank = (0..8).filter_map(of_box).min().unwrap_or(0);
        self.ranks[corner as usize] = Some(rank);
        rank
    }

    fn distance(&self, corner: u32, side: usize) -> f64 {
        self.distances[corner as usize * self.sides.len() + side]
    }

    fn at(&self, corner: u32) -> Vector3<f64> {
        self.X[corner as usize]
    }

    /// Where a side cuts the edge between two corners on either side of it.
    fn cut(&mut self, from: u32, to: u32, side: usize) -> u32 {
        let is_lower = self.ranks[from as usize] < self.ranks[to as usize];
        let ends = if is_lower { [from, to] } else { [to, from] };
        let cut = self.corner(Key::Cut { ends, side }, Some(side), |corners| {
            let [a, b] = ends.map(|end| (corners.at(end), corners.distance(end, side)));
            corners.sides[side].crossing(a, b)
        });
        let (of_box, brought) = &mut self.brought;
        *brought += 1;
        self.ranks[cut as usize].get_or_insert(*of_box << BOX | *brought);
        cut
    }

    /// A whole box.
    fn whole(&mut self, of_box: [i64; 3]) -> Polyhedron {
        let index = |bits: usize| Lattice::corner(of_box, bits);
        let corners: [u32; 8] = std::array::from_fn(|bits| self.of_lattice(index(bits)));
        let mut faces = Vec::with_capacity(7);
        for axis in 0..3 {
            let (along, b, c) = (1 << axis, 1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            for (upper, around) in [(0, [0, c, b + c, b]), (along, [0, b, b + c, c])] {
                let plane = Plane::Lattice { axis: axis as u8, is_upper: upper > 0 };
                let corners = around.map(|bits| corners[upper + bits]).to_vec();
                faces.push(Face { plane, corners });
            }
        }
        faces
    }

    /// The polyhedron that is left of a box inside the sides.
    fn clipped(&mut self, number: u64, of_box: [i64; 3]) -> Option<Polyhedron> {
        let mut faces = self.whole(of_box);
        for bits in 0..8 {
            let index = Lattice::corner(of_box, bits);
            let corner = self.of_lattice(index);
            self.rank(corner, || index);
        }
        self.brought = (number, 8);
        for side in 0..self.sides.len() {
            let is_outside = |corner: &u32| self.distance(*corner, side) < 0.0;
            if faces.iter().any(|face| face.corners.iter().any(is_outside)) {
                faces = faces.into_iter().filter_map(|face| self.clip(face, side)).collect();
                close(&mut faces, side, &self.ranks);
            }
        }
        (faces.len() >= 4).then_some(faces)
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
fn close(faces: &mut Polyhedron, side: usize, ranks: &[Option<u64>]) {
    let mut edges = HashSet::new();
    for Face { corners, .. } in &*faces {
        for (k, &from) in corners.iter().enumerate() {
            edges.insert([from, corners[(k + 1) % corners.len()]]);
        }
    }
    // From each open end back along the edge.
    let is_open = |[from, to]: &&[u32; 2]| !edges.contains(&[*to, *from]);
    let by_rank = |corner: u32| (ranks[corner as usize], corner);
    let mut next: BTreeMap<_, u32> =
        edges.iter().filter(is_open).map(|&[from, to]| (by_rank(to), from)).collect();
    while let Some(((_, first), mut corner)) = next.pop_first() {
        let mut corners = vec![first];
        while corner != first {
            corners.push(corner);
            let Some(following) = next.remove(&by_rank(corner)) else { break };
            corner = following;
        }
        if corners.len() >= 3 {
            faces.push(Face { plane: Plane::Side(side as u32), corners });
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

/// The faces of boxes that sides cut, beside which there may be whole ones.
struct Between<'a> {
    lattice: Lattice<3>,
    sides: &'a [Side<3>],
    /// For each cut box its number, and a bit for each face on the lattice that it has.
    cut: Vec<(u64, u8)>,
}

/// The bit of a face of a box.
fn bit(axis: u8, is_upper: bool) -> u8 {
    1 << (2 * axis + u8::from(is_upper))
}

impl<'a> Between<'a> {
    fn new(lattice: Lattice<3>, sides: &'a [Side<3>], cut: &[(u64, Polyhedron)]) -> Self {
        let bits = |own: &Polyhedron| {
            own.iter().fold(0, |bits, face| match face.plane {
                Plane::Lattice { axis, is_upper } => bits | bit(axis, is_upper),
                Plane::Side(_) => bits,
            })
        };
        Self { lattice, sides, cut: cut.iter().map(|(number, own)| (*number, bits(own))).collect() }
    }

    /// The box on the other side of a face of a box, by number, if it has something of the body there.
    fn other(&self, of_box: [i64; 3], plane: Plane) -> Option<u64> {
        let Plane::Lattice { axis, is_upper } = plane else { return None };
        let mut other = of_box;
        other[usize::from(axis)] += if is_upper { 1 } else { -1 };
        let number = self.lattice.number(other)?;
        let has_face = match self.cut.binary_search_by_key(&number, |(number, _)| *number) {
            Ok(place) => self.cut[place].1 & bit(axis, !is_upper) > 0,
            Err(_) => self.lattice.is_whole(self.sides, other),
        };
        has_face.then_some(number)
    }

    /// A box with its faces on the boundary as triangles.
    fn triangulated(&self, corners: &Corners<'_>, number: u64, own: Polyhedron) -> Polyhedron {
        let of_box = self.lattice.at(number);
        let side_of = |face: &Face| match face.plane {
            Plane::Side(side) => Some(side),
            plane if self.other(of_box, plane).is_some() => None,
            // Faces without a side lie where the grid ends.
            Plane::Lattice { .. } => (0..self.sides.len())
                .find(|side| face.corners.iter().all(|at| corners.distance(*at, *side) == 0.0))
                .map(|side| side as u32),
        };
        let of_face = |face: Face| match side_of(&face) {
            None => vec![face],
            Some(side) => {
                let triangle = |pair: &[u32]| Face {
                    plane: Plane::Side(side),
                    corners: vec![face.corners[0], pair[0], pair[1]],
                };
                face.corners[1..].windows(2).map(triangle).collect()
            }
        };
        own.into_iter().flat_map(of_face).collect()
    }
}

/// The particles `own(count)` of a body, and their boundary.
pub(super) fn part<T: RealField + Copy, const D: usize>(
    grid: &Grid<f64, D>,
    per_cell: usize,
    density: f64,
    clip: &Clip<D>,
    own: &dyn Fn(usize) -> Range<usize>,
) -> (Body<T, D>, Vec<Facet<D>>) {
    let spacing = grid.spacing / per_cell as f64;
    let lower = Vector3::from_fn(|a, _| grid.lower[a.min(D - 1)]);
    let sides: Vec<Side<3>> = clip.sides.iter().map(|side| side.carried()).collect();
    let lattice = Lattice {
        origin: lower.add_scalar(clip.offset * spacing),
        spacing,
        turn: clip.turn,
        // Boxes are not ordered by cells. A shifted lattice begins in the cell beside the grid.
        in_cell: 1,
        first_cell: -(per_cell as i64),
        cells: [0, 1, 2].map(|a| (grid.cells[a.min(D - 1)] + 2) as i64 * per_cell as i64),
    };
    let mut corners = Corners {
        sides: &sides,
        lattice,
        known: HashMap::new(),
        X: Vec::new(),
        distances: Vec::new(),
        ranks: Vec::new(),
        brought: (0, 0),
    };
    let mut survey =
        Survey::new(&lattice, &sides, &mut |number, of_box| corners.clipped(number, of_box));
    let between = Between::new(lattice, &sides, &survey.cut);
    for (number, polyhedron) in &mut survey.cut {
        let own = std::mem::take(polyhedron);
        *polyhedron = between.triangulated(&corners, *number, own);
    }
    let volume = |(number, own): &(u64, Polyhedron)| (*number, corners.moments(own).0 / 6.0);
    let volumes: Vec<(u64, f64)> = survey.cut.iter().map(volume).collect();
    let groups = join(&volumes, spacing.powi(3), |number| {
        let of_face = |face: &Face| {
            let measure = corners.area(&face.corners);
            let with = between.other(lattice.at(number), face.plane);
            with.map(|with| Contact { with, measure })
        };
        survey.of(number).into_iter().flatten().filter_map(of_face).collect()
    });
    let division = Division { lattice, sides: &sides, survey: &survey, groups };
    let own = own(division.particles());
    let mut made = Made::new(clip.turn);
    // Among the corners of the polyhedron at hand.
    let mut places: Vec<u32> = Vec::new();
    division.each(&own, &mut |particle, boxes| {
        let is_own = own.contains(&particle);
        let mut of_particle = Vec::new();
        let (mut whole, mut moment, mut segments) = (0.0, Vector3::zeros(), 0.0);
        for &(number, of_box) in boxes {
            let polyhedron = survey.of(number).cloned().unwrap_or_else(|| {
                let own = corners.whole(of_box);
                between.triangulated(&corners, number, own)
            });
            of_particle.extend(polyhedron.iter().flat_map(|face| &face.corners).copied());
            if !is_own {
                continue;
            }
            let (six_fold, of_moment) = corners.moments(&polyhedron);
            whole += six_fold / 6.0;
            moment += of_moment / 24.0;
            places.clear();
            let faces = &mut made.mesh.faces;
            for face in &polyhedron {
                for corner in &face.corners {
                    let place = places.iter().position(|known| known == corner);
                    let place = place.unwrap_or_else(|| {
                        places.push(*corner);
                        places.len() - 1
                    });
                    faces.corners.push(place as u32);
                }
                faces.ends.push(faces.corners.len() as u32);
            }
            faces.of_polyhedra.push(faces.ends.len() as u32);
            for face in &polyhedron {
                if let (Plane::Side(side), &[a, b, c]) = (face.plane, &face.corners[..]) {
                    let on_side = sides[side as usize];
                    segments += segment(on_side, [a, b, c].map(|corner| corners.at(corner)));
                    let of_facet = std::array::from_fn(|k| [a, b, c][k.min(2)]);
                    made.add_facet(particle, side as usize, of_facet);
                }
            }
            made.mesh.corners.extend_from_slice(&places);
            made.mesh.ends.push(made.mesh.corners.len() as u32);
        }
        made.meet(particle, of_particle.into_iter());
        if is_own {
            made.add_particle(vector_of(moment / whole), whole, density * (whole + segments));
        }
    });
    made.at_rest(spacing, |corner| vector_of(corners.at(corner)))
}

fn vector_of<T: RealField + Copy, const D: usize>(X: Vector3<f64>) -> SVector<T, D> {
    SVector::from_fn(|a, _| real(X[a]))
}
