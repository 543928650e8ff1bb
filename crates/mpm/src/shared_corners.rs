//! P2G and G2P of polygons by way of their corners: particles exchange with the corners, and these, as points, with the grid.
//!
//! ```text
//! to the grid:  m_c = sum_p m_p w_pc,  f_c = -sum_p V0_p tau_p g_pc + sum_p m_p b_p w_pc + loads;  m_i = sum_c m_c N_i(x_c), ...
//! from it:      v_c = sum_i v_i N_i(x_c);  v_p by sum_c w_pc v_c, grad v = sum_c v_c g_pc
//! ```
//!
//! Sums over the particles at a corner are in the order of ids, sums over corners at a node in that of [`bins`](crate::parallel::bins)
//! of corners: no sum depends on the number of threads.

use nalgebra::{SMatrix, SVector};

use crate::body_force::BodyForce;
use crate::fault::Fault;
use crate::geometry::Constants;
use crate::health::{Invalid, Outcome, SharedOutcome};
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies};
use crate::node::{LANES, Node};
use crate::parallel::chunks::{each, each_chunk};
use crate::polygons::{Polygons, Share};
use crate::shape_function::ProductShape;
use crate::simd::Lanes;
use crate::support::Support;

/// Corners or particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
pub(crate) const CHUNK: usize = 1024;

/// Polygons, with the shares of their corners at the current positions.
#[derive(Debug)]
pub(crate) struct SharedCorners<T, const D: usize> {
    pub(crate) polygons: Polygons<T, D>,
    /// Positions at the end of a step.
    next: Vec<SVector<T, D>>,
    /// Whether shares and areas are those of the positions.
    is_measured: bool,
    /// For each place in the list of corners.
    shares: Vec<Share<T, D>>,
    /// The area of each particle.
    volumes: Vec<T>,
    /// The places of each corner, corner after corner.
    places: Vec<Place>,
    /// Where those of each corner end.
    ends: Vec<u32>,
    /// The weights of corners at nodes.
    at_nodes: Support<T, D>,
}

/// A place in the list of corners, and the particle that it belongs to.
#[derive(Clone, Copy, Debug)]
struct Place {
    share: u32,
    particle: u32,
}

/// What passes between particles, corners and grid on its way.
pub(crate) struct Exchange<T, const D: usize> {
    /// What each particle gives.
    pub(crate) given: Vec<Given<T, D>>,
    /// APIC: its affine momentum per cell, and the mean of its polygons; else empty.
    pub(crate) affine: Vec<(SMatrix<T, D, D>, SVector<T, D>)>,
    /// Whether that counts in the sums at hand.
    pub(crate) is_affine: bool,
    /// The sums at each corner.
    sums: Vec<Node<T, D>>,
    /// APIC: the affine momenta at each corner, along the axes of the grid; else empty.
    affine_sums: Vec<SMatrix<T, D, D>>,
    /// The values of the grid at each corner.
    pub(crate) values: Vec<Node<T, D>>,
    /// The same of velocities that are projected again, where there are such.
    pub(crate) reprojected: Vec<Node<T, D>>,
    /// The Cauchy stress at each loaded point.
    stresses: Vec<SMatrix<T, D, D>>,
    /// Buffers for blocks of corners.
    buffers: BufferPool<T, D>,
}

/// Momentum, body force and mass of a particle, in the order of a node's values, and `-V0 tau / h`.
#[derive(Clone, Copy)]
pub(crate) struct Given<T, const D: usize> {
    pub(crate) value: Node<T, D>,
    pub(crate) stress_flux: SMatrix<T, D, D>,
}

impl<T: Lanes, const D: usize> Exchange<T, D> {
    /// Reserves all memory that a support needs for it: none where particles share no corners that pass on what they give.
    pub(crate) fn new(support: &Support<T, D>, is_affine: bool, reprojects: bool) -> Self {
        let (corners, particles, loads) = match support {
            Support::Polygons(own) => (own.count(), own.volumes.len(), own.polygons.loads.len()),
            _ => (0, 0, 0),
        };
        let (zero, none) = (Node::zero(), SMatrix::zeros());
        let if_affine = |count| if is_affine { count } else { 0 };
        Self {
            given: vec![Given { value: zero, stress_flux: none }; particles],
            affine: vec![(none, SVector::zeros()); if_affine(particles)],
            is_affine,
            sums: vec![zero; corners],
            affine_sums: vec![none; if_affine(corners)],
            values: vec![zero; corners],
            reprojected: vec![zero; if reprojects { corners } else { 0 }],
            stresses: vec![none; loads],
            buffers: BufferPool::new(),
        }
    }
}

/// What says the stress on the boundary, and the time.
pub(crate) type Loading<'a, T, const D: usize> = Option<(&'a dyn BodyForce<T, D>, T)>;

impl<T: Lanes, const D: usize> SharedCorners<T, D> {
    pub(crate) fn new(polygons: Polygons<T, D>, at_corner: ProductShape<T, D>) -> Self {
        let mut places = vec![Place { share: 0, particle: 0 }; polygons.corners.len()];
        let mut ends = vec![0; polygons.X.len() + 1];
        for &corner in &polygons.corners {
            ends[corner as usize + 1] += 1;
        }
        for corner in 1..ends.len() {
            ends[corner] += ends[corner - 1];
        }
        let particles = polygons.of_particles.len();
        for p in 0..particles {
            for share in polygons.places(p) {
                let next = &mut ends[polygons.corners[share] as usize];
                places[*next as usize] = Place { share: share as u32, particle: p as u32 };
                *next += 1;
            }
        }
        ends.pop();
        let share = Share { corner: 0, w: T::zero(), g: [T::zero(); D] };
        let mut shares = vec![share; polygons.corners.len()];
        (0..particles).for_each(|p| polygons.means(p, &mut shares[polygons.places(p)]));
        let mut own = Self {
            next: polygons.x.clone(),
            is_measured: false,
            shares,
            volumes: vec![T::zero(); particles],
            places,
            ends,
            at_nodes: Support::Product(at_corner),
            polygons,
        };
        own.measure();
        own
    }

    /// The positions, which the caller may overwrite.
    pub(crate) fn positions(&mut self) -> &mut [SVector<T, D>] {
        self.is_measured = false;
        &mut self.polygons.x
    }

    /// Computes shares and areas at the current positions, if they are of others.
    pub(crate) fn measure(&mut self) {
        let Self { polygons, shares, volumes, is_measured, .. } = self;
        if std::mem::replace(is_measured, true) {
            return;
        }
        let mut rest = &mut shares[..];
        let mut pieces = Vec::new();
        let mut done = 0;
        for (number, volumes) in volumes.chunks_mut(CHUNK).enumerate() {
            let first = number * CHUNK;
            let end = polygons.places(first + volumes.len() - 1).end;
            let (own, others) = std::mem::take(&mut rest).split_at_mut(end - done);
            (rest, done) = (others, end);
            pieces.push((first, volumes, own));
        }
        let polygons = &*polygons;
        each(pieces, &|(first, volumes, shares)| {
            let before = polygons.places(first).start;
            for (k, volume) in volumes.iter_mut().enumerate() {
                let places = polygons.places(first + k);
                let own = &mut shares[places.start - before..places.end - before];
                *volume = polygons.slopes(first + k, own);
            }
        });
    }

    /// The area of a particle.
    pub(crate) fn volume(&self, p: usize) -> T {
        self.volumes[p]
    }

    /// The shares of a particle's corners.
    pub(crate) fn of_particle(&self, p: usize) -> &[Share<T, D>] {
        &self.shares[self.polygons.places(p)]
    }

    /// The mean of a particle's polygons.
    pub(crate) fn centre(&self, p: usize) -> SVector<T, D> {
        let mut centre = SVector::zeros();
        for Share { corner, w, .. } in self.of_particle(p) {
            centre += self.polygons.x[*corner as usize] * *w;
        }
        centre
    }

    /// Number of corners.
    pub(crate) fn count(&self) -> usize {
        self.polygons.x.len()
    }

    /// A corner's position along the axes of the grid.
    fn at(&self, corner: usize) -> SVector<T, D> {
        let x = self.polygons.x[corner];
        match &self.polygons.turn {
            Some(turn) => turn * x,
            None => x,
        }
    }

    /// The first node that a corner reaches.
    pub(crate) fn first_node(&self, c: &Constants<T, D>, corner: usize) -> usize {
        self.at_nodes.first_node(c, corner, &self.at(corner), &SMatrix::identity())
    }

    /// The first reason why a corner may not be where it is.
    pub(crate) fn invalidity(
        &self,
        c: &Constants<T, D>,
        corner: usize,
    ) -> Option<(Invalid, usize)> {
        let invalid =
            self.at_nodes.invalidity(c, corner, &self.at(corner), &SMatrix::identity())?;
        Some((invalid, self.particle_at(corner)))
    }

    fn at_corner(&self, corner: usize) -> &[Place] {
        let start = if corner == 0 { 0 } else { self.ends[corner - 1] };
        &self.places[start as usize..self.ends[corner] as usize]
    }

    fn particle_at(&self, corner: usize) -> usize {
        self.at_corner(corner).first().map_or(0, |place| place.particle as usize)
    }

    /// Sums what particles give at each corner, with the loads on it.
    pub(crate) fn sum(
        &self,
        c: &Constants<T, D>,
        exchange: &mut Exchange<T, D>,
        loading: Loading<'_, T, D>,
    ) {
        let Exchange { given, affine, is_affine, sums, affine_sums, stresses, .. } = exchange;
        let (given, affine) = (&given[..], if *is_affine { &affine[..] } else { &[] });
        let per_length = c.spacing();
        each_chunk(sums, CHUNK, &|chunk, sums| {
            for (k, sum) in sums.iter_mut().enumerate() {
                let corner = chunk * CHUNK + k;
                let mut values = [T::zero(); LANES];
                for place in self.at_corner(corner) {
                    let Share { w, g, .. } = &self.shares[place.share as usize];
                    let Given { value, stress_flux } = &given[place.particle as usize];
                    for (sum, value) in values.iter_mut().zip(&value.values) {
                        *sum += *value * *w;
                    }
                    for (a, g) in g.iter().enumerate() {
                        let per_cell = *g * per_length;
                        for i in 0..D {
                            values[D + i] += stress_flux[(i, a)] * per_cell;
                        }
                    }
                    if let Some((affine, centre)) = affine.get(place.particle as usize) {
                        let arm = (self.polygons.x[corner] - centre) * c.inverse_spacing;
                        let momentum = affine * arm * *w;
                        (0..D).for_each(|i| values[i] += momentum[i]);
                    }
                }
                sum.values = values;
            }
        });
        let affine_sums = if *is_affine { &mut affine_sums[..] } else { &mut [] };
        each_chunk(affine_sums, CHUNK, &|chunk, sums| {
            for (k, sum) in sums.iter_mut().enumerate() {
                let mut own = SMatrix::zeros();
                for place in self.at_corner(chunk * CHUNK + k) {
                    let (affine, _) = &affine[place.particle as usize];
                    own += affine * self.shares[place.share as usize].w;
                }
                // Arms are along the axes of the grid.
                *sum = self.polygons.turn.map_or(own, |turn| own * turn.transpose());
            }
        });
        let Some((loading, time)) = loading.filter(|_| !stresses.is_empty()) else { return };
        loading.boundary_stress(time, stresses);
        for (load, stress) in self.polygons.loads.iter().zip(&*stresses) {
            let [from, to] = load.corners.map(|corner| self.polygons.x[corner as usize]);
            let edge = to - from;
            let mut normal = SVector::zeros();
            (normal[0], normal[D - 1]) = (edge[D - 1], -edge[0]);
            let force = stress * normal;
            for (&corner, &share) in load.corners.iter().zip(&load.shares) {
                let Node { values } = &mut sums[corner as usize];
                (0..D).for_each(|i| values[D + i] += force[i] * share);
            }
        }
    }

    /// Adds the sums at the corners `ids` to the band of nodes that starts at node `first`.
    pub(crate) fn to_grid(
        &self,
        c: &Constants<T, D>,
        exchange: &Exchange<T, D>,
        (band, first): (&mut [Node<T, D>], usize),
        ids: &[u32],
    ) {
        let is_affine = exchange.is_affine;
        let mut copies = Copies::new();
        let mut buffers = exchange.buffers.take(&self.at_nodes, is_affine);
        for ids in ids.chunks(BLOCK) {
            let Buffers { block, contributions, .. } = &mut *buffers;
            contributions.without_stress();
            for (k, &corner) in ids.iter().enumerate() {
                copies.x[k] = self.at(corner as usize);
                contributions.value[k] = exchange.sums[corner as usize];
                if is_affine {
                    contributions.affine[k] = exchange.affine_sums[corner as usize];
                }
            }
            block.compute_weights(c, &self.at_nodes, ids, copies.kinematics());
            block.p2g(&c.strides, band, first, contributions, ids.len());
        }
        exchange.buffers.give_back(buffers);
    }

    /// Interpolates the values of nodes at all corners.
    pub(crate) fn interpolate(
        &self,
        c: &Constants<T, D>,
        nodes: &[Node<T, D>],
        Exchange { values, buffers, .. }: &mut Exchange<T, D>,
    ) {
        let buffers = &*buffers;
        each_chunk(values, CHUNK, &|chunk, values| {
            let mut copies = Copies::new();
            let mut own = buffers.take(&self.at_nodes, false);
            let Buffers { block, interpolated, .. } = &mut *own;
            for (index, values) in values.chunks_mut(BLOCK).enumerate() {
                let ids = ids(chunk * CHUNK + index * BLOCK);
                let ids = &ids[..values.len()];
                for (x, &corner) in copies.x.iter_mut().zip(ids) {
                    *x = self.at(corner as usize);
                }
                let interpolated = &mut interpolated[..values.len()];
                block.compute_weights(c, &self.at_nodes, ids, copies.kinematics());
                block.g2p(&c.strides, nodes, interpolated);
                for (value, own) in values.iter_mut().zip(interpolated) {
                    *value = Node::new(&own.velocity, &own.second, T::zero());
                }
            }
            buffers.give_back(own);
        });
    }

    /// Stores the positions after a step with the velocities `values` of the corners.
    pub(crate) fn follow(&mut self, c: &Constants<T, D>, values: &[Node<T, D>]) {
        let Self { polygons, next, .. } = self;
        let x = &polygons.x[..];
        each_chunk(next, CHUNK, &|chunk, next| {
            let first = chunk * CHUNK;
            for ((next, x), value) in next.iter_mut().zip(&x[first..]).zip(&values[first..]) {
                *next = *x;
                if !c.planted.is(Fault::CornersStay) {
                    (0..D).for_each(|a| next[a] += value.values[a] * c.time_step);
                }
            }
        });
    }

    /// Puts the corners at their new places, and checks that each is on the grid and in its bin.
    pub(crate) fn arrive(&mut self, c: &Constants<T, D>, bin_of: &[u32]) -> Outcome {
        std::mem::swap(&mut self.polygons.x, &mut self.next);
        self.is_measured = false;
        self.measure();
        let found = SharedOutcome::default();
        let own = &*self;
        each((0..own.count()).step_by(CHUNK).collect(), &|chunk: usize| {
            let (mut outcome, mut copies) = (Outcome::default(), Copies::new());
            for first in (chunk..own.count().min(chunk + CHUNK)).step_by(BLOCK) {
                let count = BLOCK.min(own.count() - first);
                let ids = &ids(first)[..count];
                let mut bins = [0; BLOCK];
                bins[..count].copy_from_slice(&bin_of[first..first + count]);
                for (x, &corner) in copies.x.iter_mut().zip(ids) {
                    *x = own.at(corner as usize);
                }
                if own.at_nodes.are_valid(c, ids, &bins, copies.kinematics()) {
                    continue;
                }
                for (k, bin) in bins[..count].iter().enumerate() {
                    let corner = first + k;
                    let at = &copies.x[k];
                    let found = own.at_nodes.diagnose(c, corner, *bin, at, &SMatrix::identity());
                    let of_particle =
                        found.failure.map(|(invalid, corner)| (invalid, own.particle_at(corner)));
                    outcome = outcome.merge(Outcome { failure: of_particle, ..found });
                }
            }
            found.add(outcome);
        });
        found.all()
    }
}

/// The ids of a block in order.
pub(crate) fn ids(first: usize) -> [u32; BLOCK] {
    std::array::from_fn(|k| (first + k) as u32)
}
