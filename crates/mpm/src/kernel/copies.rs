//! Blocks of 64 particles: where they are in memory, and copies of them side by side.

use nalgebra::{SMatrix, SVector};

use mmsmith_lanes::simd::Lanes;

pub(crate) use mmsmith_laws::BLOCK;

/// Positions and deformation gradients of the particles of a block.
#[derive(Clone, Copy)]
pub(crate) struct Kinematics<'a, T, const D: usize> {
    /// Positions.
    pub(crate) x: &'a [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: &'a [SMatrix<T, D, D>; BLOCK],
}

/// The ids of a block of particles in order.
pub(crate) fn successive(first: usize) -> [u32; BLOCK] {
    std::array::from_fn(|k| (first + k) as u32)
}

/// Copies of up to `BLOCK` particles from scattered places in memory.
pub(crate) struct Copies<T, const D: usize> {
    /// Positions.
    pub(crate) x: [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: [SMatrix<T, D, D>; BLOCK],
    /// Internal variables, those of a particle one after the other.
    pub(crate) internal: Vec<T>,
}

impl<T: Lanes, const D: usize> Copies<T, D> {
    pub(crate) fn new() -> Self {
        // The identity has a stress in every law.
        let zero = [SVector::zeros(); BLOCK];
        Self { x: zero, F: [SMatrix::identity(); BLOCK], internal: Vec::new() }
    }

    pub(crate) fn kinematics(&self) -> Kinematics<'_, T, D> {
        Kinematics { x: &self.x, F: &self.F }
    }

    /// Takes positions and deformation gradients of the particles `ids`.
    pub(crate) fn pick(&mut self, ids: &[u32], x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        for (own, &p) in self.x.iter_mut().zip(ids) {
            *own = x[p as usize];
        }
        self.pick_F(ids, F);
    }

    /// Replaces the deformation gradients by those of the particles `ids`.
    pub(crate) fn pick_F(&mut self, ids: &[u32], F: &[SMatrix<T, D, D>]) {
        for (own, &p) in self.F.iter_mut().zip(ids) {
            *own = F[p as usize];
        }
    }

    /// Takes the internal variables of the particles `ids`, so many of each.
    pub(crate) fn pick_internal(&mut self, ids: &[u32], internal: &[T], variables: usize) {
        self.internal.clear();
        if variables > 0 {
            let of = |&p: &u32| &internal[p as usize * variables..][..variables];
            self.internal.extend(ids.iter().flat_map(of));
        }
    }

    /// Particles that lie side by side: in place where they fill a block, else copied.
    pub(crate) fn of_successive<'a>(
        &'a mut self,
        x: &'a [SVector<T, D>],
        F: &'a [SMatrix<T, D, D>],
    ) -> Kinematics<'a, T, D> {
        if let (Some(x), Some(F)) = (x.first_chunk(), F.first_chunk()) {
            return Kinematics { x, F };
        }
        self.copy(x, F);
        self.kinematics()
    }

    /// Takes whole arrays, no longer than a block.
    pub(crate) fn copy(&mut self, x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        self.x[..x.len()].copy_from_slice(x);
        self.F[..F.len()].copy_from_slice(F);
    }
}
