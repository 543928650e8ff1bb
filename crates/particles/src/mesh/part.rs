//! The domains of some of a body's particles, and what processes tell each other of them.

use std::collections::{BTreeMap, HashMap};

use bytemuck::Pod;
use nalgebra::{RealField, SMatrix, SVector};

use super::{Interpolation, Load, Mesh, Numbers, start};
use mmsmith_ranks::{Lists, Move};

/// The polygons of some particles, which can be told apart from the others.
pub struct Records<T, const D: usize> {
    /// For each particle the number of its polygons, and for each polygon: how many corners it has, their numbers in the whole body, how
    /// many faces, and of each face how many corners, and their places in the polyhedron.
    topology: Lists<u64>,
    /// Reference positions of a particle's corners, in the order of its polygons.
    X: Lists<SVector<T, D>>,
    /// Current positions.
    x: Lists<SVector<T, D>>,
}

/// Loads, each with its number in the whole body and those of its corners.
pub struct LoadRecords<T, const D: usize> {
    numbers: Vec<u64>,
    corners: Vec<SVector<u64, D>>,
    shares: Vec<SVector<T, D>>,
    X: Vec<SVector<T, D>>,
}

impl<T: RealField + Copy, const D: usize> Records<T, D> {
    /// The records of some particles.
    pub fn new(own: &Mesh<T, D>, particles: impl Iterator<Item = usize> + Clone) -> Self {
        let at = |positions: &'_ [SVector<T, D>], p: usize| -> Vec<SVector<T, D>> {
            let corners = &own.corners[own.places(p)];
            corners.iter().map(|&corner| positions[corner as usize]).collect()
        };
        Self {
            topology: Lists::new(particles.clone().map(|p| topology(own, p))),
            X: Lists::new(particles.clone().map(|p| at(&own.X, p))),
            x: Lists::new(particles.map(|p| at(&own.x, p))),
        }
    }

    /// The records of the particles that are here after a move.
    pub fn follow(&self, moved: &Move) -> Self
    where
        T: Pod,
    {
        let Self { topology, X, x } = self;
        Self { topology: moved.lists(topology), X: moved.lists(X), x: moved.lists(x) }
    }

    /// The polygons of these particles with such loads, whose corners come in the order of their numbers, those that `is_behind` says,
    /// by particle and place, behind all others; and for each corner a particle and a place in it where it is.
    pub fn assemble(
        &self,
        particles: usize,
        loads: &LoadRecords<T, D>,
        (interpolation, turn): (Interpolation, Option<SMatrix<T, D, D>>),
        is_behind: impl Fn(usize, usize) -> bool,
    ) -> (Mesh<T, D>, Vec<[usize; 2]>) {
        let mut own = Mesh::empty(interpolation, turn);
        // The number in the whole body of each place's corner, particle after particle.
        let mut numbers = Vec::new();
        let mut found: HashMap<u64, [usize; 2]> = HashMap::new();
        for p in 0..particles {
            let first = numbers.len();
            read_topology(self.topology.of(p), &mut own, &mut numbers);
            for (place, &number) in numbers[first..].iter().enumerate() {
                found.entry(number).or_insert([p, place]);
            }
        }
        let mut sorted: Vec<(bool, u64)> =
            found.iter().map(|(number, [p, place])| (is_behind(*p, *place), *number)).collect();
        sorted.sort_unstable();
        let places: Vec<[usize; 2]> = sorted.iter().map(|(_, number)| found[number]).collect();
        own.X = places.iter().map(|&[p, place]| self.X.of(p)[place]).collect();
        own.x = places.iter().map(|&[p, place]| self.x.of(p)[place]).collect();
        let known: HashMap<u64, u32> =
            sorted.iter().zip(0..).map(|((_, number), corner)| (*number, corner)).collect();
        own.corners = numbers.iter().map(|number| known[number]).collect();
        let LoadRecords { numbers, corners, shares, X } = loads;
        for ((corners, shares), X) in corners.iter().zip(shares).zip(X) {
            // A load is where the particle is on whose surface it acts.
            let corners = std::array::from_fn(|k| known.get(&corners[k]).copied().unwrap_or(0));
            own.loads.push(Load { corners, shares: std::array::from_fn(|k| shares[k]), X: *X });
        }
        let corners = sorted.into_iter().map(|(_, number)| number).collect();
        own.numbers = Some(Numbers { corners, loads: numbers.clone() });
        (own, places)
    }
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
    pub fn part(&self, particles: &[usize]) -> Self {
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
        let records = Records::new(self, particles.iter().copied());
        let kind = (self.interpolation, self.turn);
        records.assemble(particles.len(), &loads, kind, |_, _| false).0
    }

    /// The number of a corner in the whole body.
    pub fn number(&self, corner: usize) -> u64 {
        self.numbers.as_ref().map_or(corner as u64, |numbers| numbers.corners[corner])
    }
}

fn topology<T: RealField + Copy, const D: usize>(own: &Mesh<T, D>, p: usize) -> Vec<u64> {
    let polygons = own.polygons(p);
    let mut record = vec![polygons.len() as u64];
    for polygon in polygons {
        let corners = &own.corners[start(&own.ends, polygon)..own.ends[polygon] as usize];
        record.push(corners.len() as u64);
        record.extend(corners.iter().map(|&corner| own.number(corner as usize)));
        let has_faces = D == 3 && own.interpolation == Interpolation::Triangles;
        let faces = if has_faces { own.faces.of(polygon).collect() } else { Vec::new() };
        record.push(faces.len() as u64);
        for face in faces {
            record.push(face.len() as u64);
            record.extend(face.iter().map(|&place| u64::from(place)));
        }
    }
    record
}

/// Appends a particle's polygons to `own`, but for its corners, whose numbers in the whole body are appended to `numbers`.
fn read_topology<T, const D: usize>(record: &[u64], own: &mut Mesh<T, D>, numbers: &mut Vec<u64>) {
    let mut record = record.iter().copied();
    let mut next = || record.next().unwrap_or(0);
    for _ in 0..next() {
        for _ in 0..next() {
            numbers.push(next());
        }
        own.ends.push(numbers.len() as u32);
        for _ in 0..next() {
            for _ in 0..next() {
                own.faces.corners.push(next() as u32);
            }
            own.faces.ends.push(own.faces.corners.len() as u32);
        }
        if D == 3 && own.interpolation == Interpolation::Triangles {
            own.faces.of_polyhedra.push(own.faces.ends.len() as u32);
        }
    }
    own.of_particles.push(own.ends.len() as u32);
}
