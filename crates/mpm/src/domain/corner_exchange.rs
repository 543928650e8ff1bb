//! P2G and G2P by way of shared corners: particles exchange with the corners, and these, as points, with the grid.
//!
//! ```text
//! to the grid:  m_c = sum_p m_p w_pc,  f_c = -sum_p V0_p tau_p g_pc + sum_p m_p b_p w_pc + loads;  m_i = sum_c m_c N_i(x_c), ...
//! from it:      v_c = sum_i v_i N_i(x_c);  v_p by sum_c w_pc v_c, grad v = sum_c v_c g_pc
//! ```
//!
//! Sums over the particles at a corner are in the order of ids, sums over corners at a node in that of [`bins`](crate::grid::bins)
//! of corners: no sum depends on the number of threads.

use mmsmith_lanes::simd::{Lane4, Lanes, dispatch};
use mmsmith_lanes::tensor::real;
use mmsmith_particles::BodyForce;
use nalgebra::{SMatrix, SVector};

use crate::domain::corner_values::{AlongAxes, CornerValues};
use crate::domain::of_particles::{Domain, OfBlock};
use crate::domain::shared_corners::{CHUNK, Chunk, SharedCorners};
use crate::grid::bins::{Bins, Window};
use crate::grid::extension::Extension;
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeUpdate};
use crate::grid::node::Node;
use crate::kernel::buffers::{BufferPool, Buffers};
use crate::kernel::copies::{BLOCK, Copies, successive};
use crate::kernel::points::{FromGrid, ToGrid, affine_at};
use crate::shape::one_axis::OnAxis;
use crate::step::health::{Invalid, Outcome, SharedOutcome};
use mmsmith_threads::each;

/// The source of the tractions on the boundary, and the time.
pub(crate) type Loading<'a, T, const D: usize> = Option<(&'a dyn BodyForce<T, D>, T)>;

/// Buffers of the exchange in two stages: the sums of particles at corners, and blocks of corners.
pub(crate) struct Exchange<T, const D: usize> {
    /// Sums of the particles of each chunk at each corner, see [`SharedCorners::chunks`].
    sums: Vec<Node<T, D>>,
    /// Whether affine momenta count in the sums at hand.
    is_affine: bool,
    /// APIC: the same of affine momenta; else empty.
    affine_sums: Vec<AlongAxes<T, D>>,
    /// The light nodes that a clipped body reaches.
    extension: Option<Extension<T, D>>,
    /// Whether areas are those of a radian about the axis.
    is_of_half_plane: bool,
    /// The Cauchy stress at each loaded point.
    stresses: Vec<SMatrix<T, D, D>>,
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
    /// For grid cells that have the mass `mass_of_cell` inside of the body, in the half plane of a body of revolution or not.
    pub(crate) fn new(
        corners: &SharedCorners<T, D>,
        mass_of_cell: T,
        is_of_half_plane: bool,
    ) -> Self {
        let is_extended = !corners.mesh.is_of_cells() && corners.at_corner.on_axis == OnAxis::Hat;
        Self {
            sums: Vec::new(),
            is_affine: false,
            affine_sums: Vec::new(),
            extension: is_extended.then(|| Extension::new(mass_of_cell, is_of_half_plane)),
            is_of_half_plane,
            stresses: Vec::new(),
            buffers: BufferPool::new(),
        }
    }

    /// Makes room for the sums at these corners, of affine momenta too where there are any, and for the loads.
    pub(crate) fn fit(&mut self, corners: &SharedCorners<T, D>, has_affine: bool) {
        self.sums.resize(corners.sums(), Node::zero());
        if has_affine {
            self.affine_sums.resize(corners.sums(), [Lane4::zero(); D]);
        }
        self.stresses.clear();
        self.stresses.resize(corners.mesh.loads.len(), SMatrix::zeros());
    }

    /// Frees the sums; [`fit`](Self::fit) has to follow.
    pub(crate) fn free(&mut self) {
        (self.sums, self.affine_sums) = (Vec::new(), Vec::new());
    }

    /// Adds the loads to what particles give at corners.
    pub(crate) fn load(&mut self, corners: &SharedCorners<T, D>, loading: Loading<'_, T, D>) {
        let Self { sums, stresses, is_of_half_plane, .. } = self;
        let Some((loading, time)) = loading.filter(|_| !stresses.is_empty()) else { return };
        loading.boundary_stress(&corners.mesh.loads, time, stresses);
        for (load, stress) in corners.mesh.loads.iter().zip(&*stresses) {
            let mut force = stress * load.normal(&corners.mesh.x);
            if *is_of_half_plane {
                // The radius of the middle of the edge: particles have that of their centres, with which forces of a homogeneous stress are in
                // balance on edges across the axis and along it.
                let ends = load.corners.map(|corner| corners.mesh.x[corner as usize][0]);
                let sum = ends.into_iter().fold(T::zero(), |sum, radius| sum + radius);
                force *= sum / real(ends.len() as f64);
            }
            for (&corner, &share) in load.corners.iter().zip(&load.shares) {
                // The process that sorts a corner has all loads at it.
                let Some(&sum) = corners.sums_of(corner as usize).first() else { continue };
                let sums = sums[sum as usize].second_mut();
                (0..D).for_each(|i| sums[i] += force[i] * share);
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
        bins: &mut Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
    ) {
        let mut extension = self.extension.take();
        let add = |window: Window<'_, _, D>, ids: &[u32]| {
            self.to_grid(&update.c.in_window(&window), corners, window.nodes, ids);
        };
        match &mut extension {
            Some(extension) => extension.p2g(update, bins, nodes, &add),
            None => update.p2g(bins, nodes, &add),
        }
        self.extension = extension;
    }

    /// Adds the sums at the corners `ids` to the nodes of a window.
    fn to_grid(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        window: &mut [Node<T, D>],
        ids: &[u32],
    ) {
        let Self { sums, is_affine, .. } = self;
        let affine_sums = if *is_affine { &self.affine_sums[..] } else { &[] };
        if corners.at_corner.on_axis == OnAxis::Hat {
            return dispatch(ToGrid { c, corners, sums, affine_sums, window, ids });
        }
        let mut copies = Copies::new();
        let mut buffers = self.buffers.take(&corners.at_corner, *is_affine);
        for ids in ids.chunks(BLOCK) {
            let Buffers { weights, contributions, .. } = &mut *buffers;
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
            weights.compute(c, ids, copies.kinematics());
            weights.p2g(&c.strides, window, contributions, ids.len());
        }
        self.buffers.give_back(buffers);
    }

    /// Interpolates the values of nodes at all corners, and writes where the corners are after a step with these; `next` may be empty.
    pub(crate) fn interpolate(
        &self,
        c: &Constants<T, D>,
        corners: &SharedCorners<T, D>,
        nodes: &[Node<T, D>],
        at_corners: &mut CornerValues<T, D>,
        next: &mut [SVector<T, D>],
    ) {
        let own = corners.own();
        let CornerValues { nodes: values, moments } = &mut *at_corners;
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
        each(chunks, &|Corners { first, values, moments, next }| {
            if corners.at_corner.on_axis == OnAxis::Hat {
                dispatch(FromGrid { c, corners, nodes, first, values, moments });
            } else {
                from_grid((c, corners), &self.buffers, nodes, first, values);
            }
            corners.advect(c, first, values, next);
        });
        if let Some(halo) = &corners.halo {
            halo.exchange(at_corners);
        }
        corners.advect(c, own, &at_corners.nodes[own..], other_next);
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
    buffers: &BufferPool<T, D>,
    nodes: &[Node<T, D>],
    first: usize,
    values: &mut [Node<T, D>],
) {
    let mut copies = Copies::new();
    let mut own = buffers.take(&corners.at_corner, false);
    let Buffers { weights, interpolated, .. } = &mut *own;
    for (index, values) in values.chunks_mut(BLOCK).enumerate() {
        let ids = successive(first + index * BLOCK);
        let ids = &ids[..values.len()];
        for (x, &corner) in copies.x.iter_mut().zip(ids) {
            *x = corners.at(corner as usize);
        }
        let interpolated = &mut interpolated[..values.len()];
        weights.compute(c, ids, copies.kinematics());
        weights.g2p(&c.strides, nodes, interpolated);
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

/// Checks that every corner that this process sorts is where the grid has nodes for it, and in its tile.
pub(crate) fn check<T: Lanes, const D: usize>(
    c: &Constants<T, D>,
    corners: &SharedCorners<T, D>,
    keys: &[u32],
) -> Outcome {
    let found = SharedOutcome::default();
    each((0..corners.own()).step_by(CHUNK).collect(), &|chunk: usize| {
        let (mut outcome, mut copies) = (Outcome::default(), Copies::new());
        for first in (chunk..corners.own().min(chunk + CHUNK)).step_by(BLOCK) {
            let count = BLOCK.min(corners.own() - first);
            let ids = &successive(first)[..count];
            let mut tiles = [0; BLOCK];
            tiles[..count].copy_from_slice(&keys[first..first + count]);
            for (x, &corner) in copies.x.iter_mut().zip(ids) {
                *x = corners.at(corner as usize);
            }
            let kinematics = copies.kinematics();
            if corners.at_corner.are_valid(OfBlock { c, ids, tiles: &tiles, kinematics }) {
                continue;
            }
            for (k, tile) in tiles[..count].iter().enumerate() {
                let (corner, at) = (first + k, &copies.x[k]);
                let failure = invalidity_of_corner(c, corners, corner);
                let no_stretch = SMatrix::identity();
                let is_inside = failure.is_some()
                    || corners.at_corner.is_in_tile(c, corner, *tile, at, &no_stretch);
                outcome = outcome.merge(Outcome { failure, resort: !is_inside });
            }
        }
        found.add(outcome);
    });
    found.all()
}
