//! Particles go to the process of their tile.

mod mesh;

use std::slice;
use std::sync::Arc;

use mmsmith_lanes::simd::Lanes;
use mmsmith_particles::Particles;
use nalgebra::SMatrix;

use crate::kernel::buffers::BufferPool;
use crate::step::state::State;
use mmsmith_ranks::Move;

impl<T: Lanes, const D: usize> State<T, D> {
    /// Gives every particle to the process of its tile, and sorts those that are here then: `keys` has the tile of each particle here,
    /// or of each corner that they share.
    pub(crate) fn sort_as(&mut self, mut keys: Vec<u32>) {
        if self.part.is_some() {
            keys = match self.corners {
                Some(_) => self.give_mesh(&keys),
                None => self.give_to_holders(keys),
            };
        }
        match (&self.part, &self.corners) {
            (Some(part), None) => self.grid.bins.sort_as(keys, Some(&|p| part.ids[p])),
            // Kernels copy corners one by one.
            (_, Some(_)) => self.grid.bins.sort_as(keys, None),
            (None, None) => self.grid.bins.sort_as(keys, Some(&|p| p as u64)),
        }
    }

    /// Gives every particle to the process of its tile. Gives the tiles of those that are here then.
    fn give_to_holders(&mut self, mut keys: Vec<u32>) -> Vec<u32> {
        let tiles = *self.grid.bins.tiles();
        let Some(part) = &mut self.part else { return keys };
        let held = part.cut(&tiles, keys.iter().copied());
        let holders: Vec<usize> = keys.iter().map(|&key| part.holder(key)).collect();
        if let Some(moved) = self.give(&|p| slice::from_ref(&holders[p])) {
            moved.replace(&mut keys);
        }
        self.grid.hold(held, keys.len());
        keys
    }

    /// Gives every particle to the processes `to(particle)`, and tells how they move; a mesh stays.
    pub(crate) fn give<'a>(&mut self, to: &dyn Fn(usize) -> &'a [usize]) -> Option<Move> {
        let Self { particles, domain, part, .. } = self;
        let part = part.as_mut()?;
        let (moved, ids) = Move::new(Some(&part.ranks), &part.ids, to);
        part.version += 1;
        let before = std::mem::replace(&mut part.ids, Arc::new(ids)).len();
        particles.each(&self.shares, &mut &moved);
        domain.follow(&moved, before);
        // Weights in buffers may hold domains of particles that were here.
        self.buffers = BufferPool::new();
        let Particles { x, internal, .. } = &self.particles;
        if self.early.is_kept {
            self.early.F.resize(x.len(), SMatrix::identity());
            self.early.internal.resize(internal.len(), T::zero());
        }
        self.uniform = self.particles.uniform();
        Some(moved)
    }
}
