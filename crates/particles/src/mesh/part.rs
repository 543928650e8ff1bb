//! The domains of some of a body's particles, and what processes tell each other of them.

use std::collections::BTreeMap;

use bytemuck::Pod;
use nalgebra::{RealField, SVector};

use super::{Interpolation, Load, Mesh, Numbers, start};
use mmsmith_ranks::{Lists, Move, Source};

/// The polygons of particles that come from other processes.
struct Coming {
    /// For each particle the number of its polygons, and for each polygon: how many corners it has, how many faces, and of each face how
    /// many corners, and their places in the polyhedron.
    topology: Lists<u32>,
    /// The numbers in the whole body of a particle's corners, in the order of its polygons.
    numbers: Lists<u64>,
}

/// Loads, each with its number in the whole body and those of its corners.
pub struct LoadRecords<T, const D: usize> {
    numbers: Vec<u64>,
    corners: Vec<SVector<u64, D>>,
    shares: Vec<SVector<T, D>>,
    X: Vec<SVector<T, D>>,
}

impl<T: RealField + Copy, const D: usize> LoadRecords<T, D> {
    /// The records of some loads.
    pub fn new(own: &Mesh<T, D>, loads: &[usize]) -> Self {
        let number = |load: &usize| match &own.numbers {
            Some(numbers) => numbers.loads[*load],
            None => *load as u64,
        };
        let corners = |load: &usize| {
            SVector::from_fn(|k, _| own.number(own.loads[*load].corners[k] as usize))
        };
        Self {
            numbers: loads.iter().map(number).collect(),
            corners: loads.iter().map(corners).collect(),
            shares: loads.iter().map(|&load| SVector::from(own.loads[load].shares)).collect(),
            X: loads.iter().map(|&load| own.loads[load].X).collect(),
        }
    }

    /// The numbers in the whole body.
    pub fn numbers(&self) -> &[u64] {
        &self.numbers
    }

    /// The records that are here after a move, with these numbers.
    pub fn follow(&self, moved: &Move, numbers: Vec<u64>) -> Self
    where
        T: Pod,
    {
        let Self { corners, shares, X, .. } = self;
        let corners = moved.all(corners);
        Self { numbers, corners, shares: moved.all(shares), X: moved.all(X) }
    }
}

impl<T: RealField + Copy, const D: usize> Mesh<T, D> {
    /// The mesh of some of the particles, with the loads that act on them, each a part of one particle's surface.
    #[must_use]
    pub fn part(&self, particles: &[usize]) -> Self
    where
        T: Pod,
    {
        // The particles at the corners of loads.
        let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for &corner in self.loads.iter().flat_map(|load| &load.corners) {
            at.entry(corner).or_default();
        }
        for p in 0..self.of_particles.len() {
            for corner in &self.corners[self.places(p)] {
                at.entry(*corner).and_modify(|at| at.push(p));
            }
        }
        let is_own: Vec<bool> = {
            let mut is_own = vec![false; self.of_particles.len()];
            particles.iter().for_each(|&p| is_own[p] = true);
            is_own
        };
        let acts_here = |load: &usize| {
            let [first, others @ ..] = &self.loads[*load].corners[..] else { return false };
            let is_at_all = |p: &&usize| others.iter().all(|corner| at[corner].contains(p));
            at[first].iter().find(is_at_all).is_some_and(|&p| is_own[p])
        };
        let loads: Vec<usize> = (0..self.loads.len()).filter(acts_here).collect();
        let loads = LoadRecords::new(self, &loads);
        let places: Vec<u64> = (0..is_own.len() as u64).collect();
        let (moved, _) = Move::new(None, &places, &|p| if is_own[p] { &[0] } else { &[] });
        self.follow(&moved, &vec![0; self.X.len()], &loads, |_| false).0
    }

    /// The mesh after a move of the particles, with the loads that are here then, and the tile of each corner. The corners come in the order of their
    /// numbers, those in tiles that `is_behind` says behind all others. `tiles` has the tiles of the corners before. Collective.
    pub fn follow(
        &self,
        moved: &Move,
        tiles: &[u32],
        loads: &LoadRecords<T, D>,
        is_behind: impl Fn(u32) -> bool,
    ) -> (Self, Vec<u32>)
    where
        T: Pod,
    {
        let numbers: Vec<u64> = (0..self.X.len()).map(|corner| self.number(corner)).collect();
        let coming = Coming {
            topology: moved.coming_lists(|p| topology(self, p)),
            numbers: moved.coming_lists(|p| {
                self.of_particle(p).iter().map(|&corner| numbers[corner as usize])
            }),
        };
        let (corners, known) = moved.of_parts(&numbers, &|p| self.of_particle(p));
        drop(numbers);
        let tiles = corners.all(tiles);
        // For each place of a corner the corner by number.
        let mut order: Vec<usize> = (0..known.len()).collect();
        order.sort_by_key(|&corner| is_behind(tiles[corner]));
        let ordered = |X: &[SVector<T, D>]| {
            let X = corners.all(X);
            order.iter().map(|&corner| X[corner]).collect()
        };
        let mut own = Self::empty(self.interpolation, self.turn);
        (own.X, own.x) = (ordered(&self.X), ordered(&self.x));

        let mut place_of = vec![0; known.len()];
        order.iter().zip(0..).for_each(|(&corner, place)| place_of[corner] = place);
        let mut now = vec![0; self.X.len()];
        for (source, &place) in corners.sources().zip(&place_of) {
            if let Source::Here(before) = source {
                now[before] = place;
            }
        }
        // A corner that comes is among those found, and so is one of a load, which is where the particle is on whose surface it acts.
        let find = |number: &u64| known.binary_search(number).map_or(0, |at| place_of[at]);
        for source in moved.sources() {
            match source {
                Source::Here(p) => {
                    own.read_topology(&topology(self, p));
                    own.corners.extend(self.of_particle(p).iter().map(|&c| now[c as usize]));
                }
                Source::Elsewhere(p) => {
                    own.read_topology(coming.topology.of(p));
                    own.corners.extend(coming.numbers.of(p).iter().map(find));
                }
            }
        }
        let LoadRecords { numbers, corners: at_loads, shares, X } = loads;
        for ((corners, shares), X) in at_loads.iter().zip(shares).zip(X) {
            let corners = std::array::from_fn(|k| find(&corners[k]));
            own.loads.push(Load { corners, shares: std::array::from_fn(|k| shares[k]), X: *X });
        }
        let tiles = order.iter().map(|&corner| tiles[corner]).collect();
        let corners = order.iter().map(|&corner| known[corner]).collect();
        own.numbers = Some(Numbers { corners, loads: numbers.clone() });
        (own, tiles)
    }

    /// The number of a corner in the whole body.
    pub fn number(&self, corner: usize) -> u64 {
        self.numbers.as_ref().map_or(corner as u64, |numbers| numbers.corners[corner])
    }

    /// Whether polyhedra have faces.
    fn has_faces(&self) -> bool {
        D == 3 && self.interpolation == Interpolation::Triangles
    }

    /// Appends the polygons of a particle by its [`topology`], but for the corners in `corners`.
    fn read_topology(&mut self, record: &[u32]) {
        let mut record = record.iter().copied();
        let mut next = || record.next().unwrap_or(0);
        let mut corners = self.ends.last().copied().unwrap_or(0);
        for _ in 0..next() {
            corners += next();
            self.ends.push(corners);
            for _ in 0..next() {
                for _ in 0..next() {
                    self.faces.corners.push(next());
                }
                self.faces.ends.push(self.faces.corners.len() as u32);
            }
            if self.has_faces() {
                self.faces.of_polyhedra.push(self.faces.ends.len() as u32);
            }
        }
        self.of_particles.push(self.ends.len() as u32);
    }
}

/// The polygons of a particle, as `Coming` has them.
fn topology<T: RealField + Copy, const D: usize>(own: &Mesh<T, D>, p: usize) -> Vec<u32> {
    let polygons = own.polygons(p);
    let mut record = vec![polygons.len() as u32];
    for polygon in polygons {
        record.push(own.ends[polygon] - start(&own.ends, polygon) as u32);
        let faces = if own.has_faces() { own.faces.of(polygon).collect() } else { Vec::new() };
        record.push(faces.len() as u32);
        for face in faces {
            record.push(face.len() as u32);
            record.extend(face);
        }
    }
    record
}
