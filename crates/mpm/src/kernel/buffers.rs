//! Buffers for blocks of particles, which outlive a pass: to set them up for each bin would cost up to a fifth of a step.

use std::sync::{Mutex, PoisonError};

use mmsmith_lanes::simd::Lanes;

use crate::domain::Support;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::block::Block;
use crate::kernel::copies::BLOCK;

/// Buffers of a pass over blocks. Entries beyond the particles of a block are left from another block, and not read.
pub(crate) struct Buffers<T, const D: usize> {
    is_affine: bool,
    pub(crate) block: Block<T, D>,
    pub(crate) contributions: Contributions<T, D, BLOCK>,
    pub(crate) interpolated: [Interpolated<T, D>; BLOCK],
}

/// Buffers that no thread uses at present; at most two for each thread come about.
pub(crate) struct BufferPool<T, const D: usize>(Mutex<Vec<Box<Buffers<T, D>>>>);

impl<T: Lanes, const D: usize> BufferPool<T, D> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// Buffers as their last user left them, or new ones; with affine velocities or without.
    pub(crate) fn take(&self, support: &Support<T, D>, is_affine: bool) -> Box<Buffers<T, D>> {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = free.iter().rposition(|buffers| buffers.is_affine == is_affine);
        let found = place.map(|place| free.swap_remove(place));
        drop(free);
        found.unwrap_or_else(|| {
            Box::new(Buffers {
                is_affine,
                block: Block::new(support, is_affine),
                contributions: Contributions::zero(),
                interpolated: [Interpolated::zero(); BLOCK],
            })
        })
    }

    pub(crate) fn give_back(&self, buffers: Box<Buffers<T, D>>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffers);
    }
}
