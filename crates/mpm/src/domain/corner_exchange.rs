//! P2G and G2P by way of shared corners: particles exchange with the corners, and these, as points, with the grid.
//!
//! ```text
//! to the grid:  m_c = sum_p m_p w_pc,  f_c = -sum_p V0_p tau_p g_pc + sum_p m_p b_p w_pc + loads;  m_i = sum_c m_c N_i(x_c), ...
//! from it:      v_c = sum_i v_i N_i(x_c);  v_p by sum_c w_pc v_c, grad v = sum_c v_c g_pc
//! ```
//!
//! Sums over the particles at a corner are in the order of ids, sums over corners at a node in that of [`bins`](crate::parallel::bins)
//! of corners: no sum depends on the number of threads.

use mmsmith_lanes::simd::{Lane4, Lanes, dispatch};
use nalgebra::{SMatrix, SVector};

use crate::domain::Support;
use crate::domain::corner_values::{AlongAxes, CornerValues, Seen};
use crate::domain::shared_corners::{CHUNK, Chunk, SharedCorners};
use crate::grid::extension::Extension;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeUpdate};
use crate::grid::node::Node;
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::points::{FromGrid, ToGrid, affine_at};
use crate::parallel::bins::Bins;
use crate::parallel::chunks::each;
use crate::particles::mesh::Mesh;
use crate::shape::one_axis::{OnAxis, ProductShape};
use crate::step::body_force::BodyForce;
use crate::step::health::{Invalid, Outcome, SharedOutcome};

/// The source of the tractions on the boundary, and the time.
pub(crate) type Loading<'a, T, const D: usize> = Option<(&'a dyn BodyForce<T, D>, T)>;

/// Buffers of the exchange in two stages: sums of particles at corners, and values of the grid at corners.
pub(crate) struct Exchange<T, const D: usize> {
    /// Sums of the particles of each chunk at each corner, see [`SharedCorners::chunks`].
    sums: Vec<Node<T, D>>,
    /// Whether there are affine momenta.
    has_affine: bool,
    /// Whether they count in the sums at hand.
    is_affine: bool,
    /// APIC: the same of affine momenta; else empty.
    affine_sums: Vec<AlongAxes<T, D>>,
    /// The values of the grid at each corner here.
    pub(crate) values: CornerValues<T, D>,
    /// Whether velocities are projected again.
    reprojects: bool,
    /// The values of the projected velocities at each corner, where there are any.
    pub(crate) reprojected: CornerValues<T, D>,
    /// The light nodes that a clipped body reaches.
    extension: Option<Extension<T, D>>,
    /// The Cauchy stress at each loaded point.
    stresses: Vec<SMatrix<T, D, D>>,
    /// The weights of corners at nodes.
    at_nodes: Support<T, D>,
    /// Buffers for blocks of corners.
    buffers: BufferPool<T, D>,
}

/// The sums of a chunk of particles.
pub(crate) struct ChunkSums<'a, T, const D: usize> {
    pub(crate) sums: &'a mut [Node<T, D>],
    /// Sums of affine momenta, where there are any.
    pub(crate) affine_sums: &'a mut [AlongAxes<T, D>],
}

impl<T: Lanes, const D: usize> ChunkSums<'_, T, D> {
    pub(crate) fn clear(&mut self) {
        self.sums.fill(Node::zero());
        self.affine_sums.fill([Lane4::zero(); D]);
    }
}

impl<T: Lanes, const D: usize> Exchange<T, D> {
    /// For grid cells that have the mass `mass_of_cell` inside of the body. Reserves all memory that a support needs for it: none where
    /// particles share no corners that pass on what they give.
    pub(crate) fn new(
        support: &Support<T, D>,
        mass_of_cell: T,
        is_affine: bool,
        reprojects: bool,
    ) -> Self {
        let none = ProductShape { on_axis: OnAxis::Hat, l: SVector::zeros() };
        let mut own = Self {
            sums: Vec::new(),
            has_affine: is_affine,
            is_affine,
            affine_sums: Vec::new(),
            values: CornerValues::none(),
            reprojects,
            reprojected: CornerValues::none(),
            extension: None,
            stresses: Vec::new(),
            at_nodes: Support::Product(none),
            buffers: BufferPool::new(),
        };
        if let Support::Mesh(corners) = support {
            own.at_nodes = Support::Product(corners.at_corner);
            let is_extended =
                !corners.mesh.is_of_cells() && corners.at_corner.on_axis == OnAxis::Hat;
            own.extension = is_extended.then(|| Extension::new(mass_of_cell));
            own.fit(corners);
        }
        own
    }

    /// Makes room for these corners and their particles.
    pub(crate) fn fit(&mut self, corners: &SharedCorners<T, D>) {
        let Mesh { loads, .. } = &corners.mesh;
        let has_moments = self.has_affine && corners.mesh.is_of_cells();
        let (zero, none) = (Node::zero(), SMatrix::zeros());
        self.sums.resize(corners.sums(), zero);
        if self.has_affine {
            self.affine_sums.resize(corners.sums(), [Lane4::zero(); D]);
        }
        self.values.fit(corners.count(), has_moments);
        if self.reprojects {
            self.reprojected.fit(corners.count(), has_moments);
        }
        self.stresses.clear();
        self.stresses.resize(loads.len(), none);
    }

    /// Adds the loads to what particles give at corners.
    pub(crate) fn load(&mut self, corners: &SharedCorners<T, D>, loading: Loading<'_, T, D>) {
        let Self { sums, stresses, .. } = self;
        let Some((loading, time)) = loading.filter(|_| !stresses.is_empty()) else { return };
        loading.boundary_stress(&corners.mesh.loads, time, stresses);
        for (load, stress) in corners.mesh.loads.iter().zip(&*stresses) {
            let force = stress * load.normal(&corners.mesh.x);
            for (&corner, &share) in load.corners.iter().zip(&load.shares) {
                // The process that sorts a corner has all loads at it.
                let Some(&sum) = corners.sums_of(corner as usize).first() else { continue };
                let Node { values } = &mut sums[sum as usize];
                (0..D).for_each(|i| values[D + i] += force[i] * share);
            }
        }
    }

    /// The sums of each chunk, to begin anew with [`ChunkSums::clear`]; of affine momenta where they count.
    pub(crate) fn begin(&mut self, chunks: &[Chunk], is_affine: bool) -> Vec<ChunkSums<'_, T, D>> {
        self.is_affine = is_affine;
        let mut sums = &mut self.sums[..];
        let mut affine_sums = if is_affine { &mut self.affine_sums[..] } else { &mut [] };
        let of_chunk = |Chunk { sums: places, .. }: &Chunk| {
            let own = sums.split_off_mut(..places.len()).unwrap_or_default();
            let of_affine = affine_sums.len().min(places.len());
            let affine_sums = affine_sums.split_off_mut(..of_affine).unwrap_or_default();
            ChunkSums { sums: own, affine_sums }
        };
        chunks.iter().map(of_chunk).collect()
    }

    /// Adds the sums at corners to the grid, and updates it.
    pub(crate) fn update_grid<S: NodeUpdate<T, D>>(
        &mut self,
        update: &GridUpdate<'_, T, S, D>,
        corners: &SharedCorners<T, D>,
        bins: &mut Bins,
        nodes: &mut [Node<T, D>],
    ) {
        let mut extension = self.extension.take();
        let add = |band: &mut [_], first: usize, ids: &[u32]| {
            self.to_grid(update.c, corners, (band, first), ids);
        };
        match &mut extension {
            Some(extension) => extension.p2g(update, bins, nodes, &add),
            None => update.p2g(bins, nodes, &add),
        }
        self.extension = extension;
    }

    /// Adds the sums at the corners `ids` to the band of nodes that starts at node `first`.
    fn to_grid(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        (band, first): (&mut [Node<T, D>], usize),
        ids: &[u32],
    ) {
        let Self { sums, is_affine, at_nodes, .. } = self;
        let affine_sums = if *is_affine { &self.affine_sums[..] } else { &[] };
        if corners.at_corner.on_axis == OnAxis::Hat {
            return dispatch(ToGrid { c, corners, sums, affine_sums, band, first, ids });
        }
        let mut copies = Copies::new();
        let mut buffers = self.buffers.take(at_nodes, *is_affine);
        for ids in ids.chunks(BLOCK) {
            let Buffers { block, contributions, .. } = &mut *buffers;
            contributions.without_stress();
            for (k, &corner) in ids.iter().enumerate() {
                copies.x[k] = corners.at(corner as usize);
                let mut value = Node::zero();
                for &sum in corners.sums_of(corner as usize) {
                    value.add(&sums[sum as usize]);
                }
                contributions.value[k] = value;
                if *is_affine {
                    let along = affine_at(corners, affine_sums, corner as usize);
                    contributions.affine[k] = SMatrix::from_fn(|i, a| along[a].0[i]);
                }
            }
            block.compute_weights(c, at_nodes, ids, copies.kinematics());
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
        self.interpolate_and_follow(c, corners, nodes, &mut []);
    }

    /// As [`interpolate`](Self::interpolate), and the corners follow these values in a step, for their `next` positions; unless these are empty.
    pub(crate) fn interpolate_and_follow(
        &mut self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        nodes: &[Node<T, D>],
        next: &mut [SVector<T, D>],
    ) {
        let own = corners.own();
        let CornerValues { nodes: values, moments } = &mut self.values;
        let (own_next, other_next) = next.split_at_mut(own.min(next.len()));
        let (mut of_moments, mut of_next) = (moments.chunks_mut(CHUNK), own_next.chunks_mut(CHUNK));
        let chunks = values[..own].chunks_mut(CHUNK).enumerate();
        let chunks: Vec<_> = chunks
            .map(|(number, values)| Corners {
                first: number * CHUNK,
                values,
                moments: of_moments.next().unwrap_or_default(),
                next: of_next.next().unwrap_or_default(),
            })
            .collect();
        let (buffers, at_nodes) = (&self.buffers, &self.at_nodes);
        each(chunks, &|Corners { first, values, moments, next }| {
            if corners.at_corner.on_axis == OnAxis::Hat {
                dispatch(FromGrid { c, corners, nodes, first, values, moments });
            } else {
                from_grid((c, corners), (at_nodes, buffers), nodes, first, values);
            }
            corners.follow(c, first, values, next);
        });
        if let Some(halo) = &corners.halo {
            halo.exchange(&mut self.values);
        }
        corners.follow(c, own, &self.values.nodes[own..], other_next);
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

    /// Checks that every corner that this process sorts is where the grid has nodes for it, and in its bin.
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
                    let (corner, at) = (first + k, &copies.x[k]);
                    let failure = invalidity_of_corner(c, corners, corner);
                    let no_stretch = SMatrix::identity();
                    let is_inside = failure.is_some()
                        || self.at_nodes.is_in_bin(c, corner, *bin, at, &no_stretch);
                    outcome = outcome.merge(Outcome { failure, resort: !is_inside });
                }
            }
            found.add(outcome);
        });
        found.all()
    }
}

/// Some successive corners, with what belongs to them.
struct Corners<'a, T, const D: usize> {
    first: usize,
    values: &'a mut [Node<T, D>],
    /// Empty where they are not needed.
    moments: &'a mut [AlongAxes<T, D>],
    /// Empty where they do not move.
    next: &'a mut [SVector<T, D>],
}

/// Values of nodes at corners from `first` on.
fn from_grid<T: Lanes, const D: usize>(
    (c, corners): (&Constants<T, D>, &SharedCorners<T, D>),
    (at_nodes, buffers): (&Support<T, D>, &BufferPool<T, D>),
    nodes: &[Node<T, D>],
    first: usize,
    values: &mut [Node<T, D>],
) {
    let mut copies = Copies::new();
    let mut own = buffers.take(at_nodes, false);
    let Buffers { block, interpolated, .. } = &mut *own;
    for (index, values) in values.chunks_mut(BLOCK).enumerate() {
        let ids = successive(first + index * BLOCK);
        let ids = &ids[..values.len()];
        for (x, &corner) in copies.x.iter_mut().zip(ids) {
            *x = corners.at(corner as usize);
        }
        let interpolated = &mut interpolated[..values.len()];
        block.compute_weights(c, at_nodes, ids, copies.kinematics());
        block.g2p((c, at_nodes), Seen::Nodes(nodes), interpolated);
        for (value, own) in values.iter_mut().zip(&*interpolated) {
            *value = Node::new(&own.velocity, &own.second, T::zero());
        }
    }
    buffers.give_back(own);
}

/// The reason why a corner may not be where it is, with a particle at it.
pub(crate) fn invalidity_of_corner<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    corners: &SharedCorners<T, D>,
    corner: usize,
) -> Option<(Invalid, usize)> {
    let at = corners.at(corner);
    let invalid = if at.iter().any(|x| !x.is_finite()) {
        Invalid::NotFinite
    } else if c.axis_beyond(&at).is_some() {
        Invalid::LeftGrid
    } else {
        return None;
    };
    Some((invalid, corners.particle_at(corner)))
}
