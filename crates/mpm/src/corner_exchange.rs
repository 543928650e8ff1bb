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
use crate::geometry::Constants;
use crate::health::{Invalid, Outcome, SharedOutcome};
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::node::{LANES, Node};
use crate::parallel::chunks::{each, each_chunk};
use crate::polygons::{Polygons, Share};
use crate::shape_function::{OnAxis, ProductShape};
use crate::shared_corners::{CHUNK, SharedCorners};
use crate::simd::Lanes;
use crate::support::Support;

/// What says the stress on the boundary, and the time.
pub(crate) type Loading<'a, T, const D: usize> = Option<(&'a dyn BodyForce<T, D>, T)>;

/// What passes between particles, corners and grid on its way.
pub(crate) struct Exchange<T, const D: usize> {
    /// What each particle gives.
    pub(crate) given: Vec<Given<T, D>>,
    /// APIC: its affine momentum per cell, and the mean of its polygons; else empty.
    pub(crate) affine: Vec<(SMatrix<T, D, D>, SVector<T, D>)>,
    /// Whether there are such.
    has_affine: bool,
    /// Whether that counts in the sums at hand.
    pub(crate) is_affine: bool,
    /// The sums at each corner that this process sorts.
    sums: Vec<Node<T, D>>,
    /// APIC: the affine momenta at each of them, along the axes of the grid; else empty.
    affine_sums: Vec<SMatrix<T, D, D>>,
    /// The values of the grid at each corner here.
    pub(crate) values: Vec<Node<T, D>>,
    /// Whether velocities are projected again.
    reprojects: bool,
    /// The same of such velocities, where there are any.
    pub(crate) reprojected: Vec<Node<T, D>>,
    /// The Cauchy stress at each loaded point.
    stresses: Vec<SMatrix<T, D, D>>,
    /// The weights of corners at nodes.
    at_nodes: Support<T, D>,
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
        let none = ProductShape { on_axis: OnAxis::Hat, l: SVector::zeros() };
        let mut own = Self {
            given: Vec::new(),
            affine: Vec::new(),
            has_affine: is_affine,
            is_affine,
            sums: Vec::new(),
            affine_sums: Vec::new(),
            values: Vec::new(),
            reprojects,
            reprojected: Vec::new(),
            stresses: Vec::new(),
            at_nodes: Support::Product(none),
            buffers: BufferPool::new(),
        };
        if let Support::Polygons(corners) = support {
            own.at_nodes = Support::Product(corners.at_corner);
            own.fit(corners);
        }
        own
    }

    /// Makes room for these corners and their particles.
    pub(crate) fn fit(&mut self, corners: &SharedCorners<T, D>) {
        let Polygons { of_particles, loads, .. } = &corners.polygons;
        let (count, particles, own) = (corners.count(), of_particles.len(), corners.own());
        let (zero, none) = (Node::zero(), SMatrix::zeros());
        self.given.resize(particles, Given { value: zero, stress_flux: none });
        self.sums.resize(own, zero);
        self.values.resize(count, zero);
        if self.has_affine {
            self.affine.resize(particles, (none, SVector::zeros()));
            self.affine_sums.resize(own, none);
        }
        if self.reprojects {
            self.reprojected.resize(count, zero);
        }
        self.stresses.clear();
        self.stresses.resize(loads.len(), none);
    }

    /// Sums what particles give at each corner, with the loads on it.
    pub(crate) fn sum(
        &mut self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        loading: Loading<'_, T, D>,
    ) {
        let Self { given, affine, is_affine, sums, affine_sums, stresses, .. } = self;
        let (given, affine) = (&given[..], if *is_affine { &affine[..] } else { &[] });
        let per_length = c.spacing();
        each_chunk(sums, CHUNK, &|chunk, sums| {
            for (k, sum) in sums.iter_mut().enumerate() {
                let corner = chunk * CHUNK + k;
                let mut values = [T::zero(); LANES];
                for place in corners.places_of(corner) {
                    let Share { w, g, .. } = &corners.shares[place.share as usize];
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
                        let arm = (corners.polygons.x[corner] - centre) * c.inverse_spacing;
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
                for place in corners.places_of(chunk * CHUNK + k) {
                    let (affine, _) = &affine[place.particle as usize];
                    own += affine * corners.shares[place.share as usize].w;
                }
                // Arms are along the axes of the grid.
                *sum = corners.polygons.turn.map_or(own, |turn| own * turn.transpose());
            }
        });
        let Some((loading, time)) = loading.filter(|_| !stresses.is_empty()) else { return };
        loading.boundary_stress(&corners.polygons.loads, time, stresses);
        for (load, stress) in corners.polygons.loads.iter().zip(&*stresses) {
            let force = stress * load.normal(&corners.polygons.x);
            for (&corner, &share) in load.corners.iter().zip(&load.shares) {
                // The process that sorts a corner has all loads at it.
                let Some(Node { values }) = sums.get_mut(corner as usize) else { continue };
                (0..D).for_each(|i| values[D + i] += force[i] * share);
            }
        }
    }

    /// Adds the sums at the corners `ids` to the band of nodes that starts at node `first`.
    pub(crate) fn to_grid(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        (band, first): (&mut [Node<T, D>], usize),
        ids: &[u32],
    ) {
        let is_affine = self.is_affine;
        let mut copies = Copies::new();
        let mut buffers = self.buffers.take(&self.at_nodes, is_affine);
        for ids in ids.chunks(BLOCK) {
            let Buffers { block, contributions, .. } = &mut *buffers;
            contributions.without_stress();
            for (k, &corner) in ids.iter().enumerate() {
                copies.x[k] = corners.at(corner as usize);
                contributions.value[k] = self.sums[corner as usize];
                if is_affine {
                    contributions.affine[k] = self.affine_sums[corner as usize];
                }
            }
            block.compute_weights(c, &self.at_nodes, ids, copies.kinematics());
            block.p2g(&c.strides, band, first, contributions, ids.len());
        }
        self.buffers.give_back(buffers);
    }

    /// Interpolates the values of nodes at all corners.
    pub(crate) fn interpolate(
        &mut self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        nodes: &[Node<T, D>],
    ) {
        let Self { values, buffers, at_nodes, .. } = self;
        let (buffers, at_nodes) = (&*buffers, &*at_nodes);
        each_chunk(&mut values[..corners.own()], CHUNK, &|chunk, values| {
            let mut copies = Copies::new();
            let mut own = buffers.take(at_nodes, false);
            let Buffers { block, interpolated, .. } = &mut *own;
            for (index, values) in values.chunks_mut(BLOCK).enumerate() {
                let ids = successive(chunk * CHUNK + index * BLOCK);
                let ids = &ids[..values.len()];
                for (x, &corner) in copies.x.iter_mut().zip(ids) {
                    *x = corners.at(corner as usize);
                }
                let interpolated = &mut interpolated[..values.len()];
                block.compute_weights(c, at_nodes, ids, copies.kinematics());
                block.g2p(&c.strides, nodes, interpolated);
                for (value, own) in values.iter_mut().zip(interpolated) {
                    *value = Node::new(&own.velocity, &own.second, T::zero());
                }
            }
            buffers.give_back(own);
        });
        if let Some(halo) = &corners.halo {
            halo.exchange(values);
        }
    }

    /// The first node that a corner reaches.
    pub(crate) fn first_node(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        corner: usize,
    ) -> usize {
        self.at_nodes.first_node(c, corner, &corners.at(corner), &SMatrix::identity())
    }

    /// The reason why a corner may not be where it is, with a particle at it.
    pub(crate) fn invalidity(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        corner: usize,
    ) -> Option<(Invalid, usize)> {
        let at = corners.at(corner);
        let invalid = self.at_nodes.invalidity(c, corner, &at, &SMatrix::identity())?;
        Some((invalid, corners.particle_at(corner)))
    }

    /// Checks that every corner that this process sorts is on the grid and in its bin.
    pub(crate) fn check(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        bin_of: &[u32],
    ) -> Outcome {
        let found = SharedOutcome::default();
        each((0..corners.own()).step_by(CHUNK).collect(), &|chunk: usize| {
            let (mut outcome, mut copies) = (Outcome::default(), Copies::new());
            for first in (chunk..corners.own().min(chunk + CHUNK)).step_by(BLOCK) {
                let count = BLOCK.min(corners.own() - first);
                let ids = &successive(first)[..count];
                let mut bins = [0; BLOCK];
                bins[..count].copy_from_slice(&bin_of[first..first + count]);
                for (x, &corner) in copies.x.iter_mut().zip(ids) {
                    *x = corners.at(corner as usize);
                }
                if self.at_nodes.are_valid(c, ids, &bins, copies.kinematics()) {
                    continue;
                }
                for (k, bin) in bins[..count].iter().enumerate() {
                    let corner = first + k;
                    let at = &copies.x[k];
                    let found = self.at_nodes.diagnose(c, corner, *bin, at, &SMatrix::identity());
                    let of_particle = found
                        .failure
                        .map(|(invalid, corner)| (invalid, corners.particle_at(corner)));
                    outcome = outcome.merge(Outcome { failure: of_particle, ..found });
                }
            }
            found.add(outcome);
        });
        found.all()
    }
}
