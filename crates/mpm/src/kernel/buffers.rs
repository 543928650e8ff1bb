//! Buffers for blocks of particles, which outlive a pass: to set them up for each layer would cost up to a fifth of a step.

use std::sync::{Mutex, PoisonError};

use mmsmith_lanes::simd::Lanes;

use crate::domain::corner_values::CornerValues;
use crate::domain::of_particles::Domain;
use crate::domain::shared_corners::SharedCorners;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::shared::FromCorners;

/// Buffers of a pass over blocks. Entries beyond the particles of a block are left from another block, and not read.
pub(crate) struct Buffers<T, const D: usize> {
    is_affine: bool,
    /// Weights at nodes; those of particles that share corners are not computed.
    pub(crate) weights: Box<dyn BlockWeights<T, D>>,
    pub(crate) contributions: Contributions<T, D, BLOCK>,
    pub(crate) interpolated: [Interpolated<T, D>; BLOCK],
    /// Interpolated scalars, where a change of volume follows the grid.
    pub(crate) growth: [T; BLOCK],
}

/// Buffers that no thread uses at present; at most two for each thread come about.
pub(crate) struct BufferPool<T, const D: usize>(Mutex<Vec<Box<Buffers<T, D>>>>);

impl<T: Lanes, const D: usize> BufferPool<T, D> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// Buffers as their last user left them, or new ones; with affine velocities or without.
    pub(crate) fn take(&self, domain: &dyn Domain<T, D>, is_affine: bool) -> Box<Buffers<T, D>> {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = free.iter().rposition(|buffers| buffers.is_affine == is_affine);
        let found = place.map(|place| free.swap_remove(place));
        drop(free);
        found.unwrap_or_else(|| {
            Box::new(Buffers {
                is_affine,
                weights: domain.weights(is_affine),
                contributions: Contributions::zero(),
                interpolated: [Interpolated::zero(); BLOCK],
                growth: [T::zero(); BLOCK],
            })
        })
    }

    pub(crate) fn give_back(&self, buffers: Box<Buffers<T, D>>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffers);
    }
}

/// The values of the grid that particles interpolate.
#[derive(Clone, Copy)]
pub(crate) struct GridValues<'a, T, const D: usize> {
    pub(crate) nodes: &'a [Node<T, D>],
    /// The corners that particles share, and the values there.
    pub(crate) at_corners: Option<(&'a SharedCorners<T, D>, &'a CornerValues<T, D>)>,
}

impl<T: Lanes, const D: usize> GridValues<'_, T, D> {
    /// Computes the weights of the particles `ids`, where they reach nodes themselves.
    pub(crate) fn compute_weights(
        &self,
        c: &Constants<T, D>,
        buffers: &mut Buffers<T, D>,
        ids: &[u32],
        kinematics: Kinematics<'_, T, D>,
    ) {
        if self.at_corners.is_none() {
            buffers.weights.compute(c, ids, kinematics);
        }
    }

    /// Interpolates the scalars of nodes at the first `count` particles of a block, which reach nodes themselves.
    pub(crate) fn growth(
        &self,
        c: &Constants<T, D>,
        buffers: &mut Buffers<T, D>,
        count: usize,
    ) -> [T; BLOCK] {
        let Buffers { weights, growth, .. } = buffers;
        weights.g2p_scalars(&c.strides, self.nodes, &mut growth[..count]);
        *growth
    }

    /// Interpolates at the particles `ids` of a block; those on shared corners are successive.
    pub(crate) fn g2p<'b>(
        &self,
        c: &Constants<T, D>,
        buffers: &'b mut Buffers<T, D>,
        ids: &[u32],
    ) -> &'b mut [Interpolated<T, D>] {
        let Buffers { is_affine, weights, interpolated, .. } = buffers;
        let receiver = &mut interpolated[..ids.len()];
        match self.at_corners {
            None => weights.g2p(&c.strides, self.nodes, receiver),
            Some((corners, values)) => {
                let first = ids.first().map_or(0, |id| *id as usize);
                let shares = corners.measured.from(&corners.mesh, first);
                FromCorners { c, corners, shares, values, first, receiver }.interpolate(*is_affine);
            }
        }
        &mut interpolated[..ids.len()]
    }
}
