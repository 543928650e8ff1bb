//! G2P of particles that are polygons on shared corners, from values at the corners.

use nalgebra::{SMatrix, SVector};

use crate::geometry::Constants;
use crate::kernel::any::Interpolated;
use crate::node::Node;
use crate::polygons::Share;
use crate::shared_corners::SharedCorners;
use crate::simd::Lanes;

/// The shares of the corners of a block of particles.
pub(crate) struct PolygonWeights<T, const D: usize> {
    is_affine: bool,
    shares: Vec<Share<T, D>>,
    /// For each particle where its shares end.
    ends: Vec<usize>,
    /// Edge of a cell.
    spacing: T,
}

impl<T: Lanes, const D: usize> PolygonWeights<T, D> {
    pub(crate) fn new(is_affine: bool) -> Self {
        Self { is_affine, shares: Vec::new(), ends: Vec::new(), spacing: T::one() }
    }

    /// Takes the shares of the particles `ids`.
    pub(crate) fn take(&mut self, c: &Constants<T, D>, corners: &SharedCorners<T, D>, ids: &[u32]) {
        self.spacing = c.spacing();
        self.shares.clear();
        self.ends.clear();
        for &p in ids {
            self.shares.extend_from_slice(corners.of_particle(p as usize));
            self.ends.push(self.shares.len());
        }
    }

    /// G2P of the first particles, as many as `receiver` has places, from the values at all corners.
    ///
    /// With affine velocities these are the gradients of the second vector: values at corners do not tell the inertia of the weights at
    /// nodes.
    pub(crate) fn g2p(&self, corners: &[Node<T, D>], receiver: &mut [Interpolated<T, D>]) {
        let mut start = 0;
        for (own, &end) in receiver.iter_mut().zip(&self.ends) {
            let (mut velocity, mut second) = (SVector::zeros(), SVector::zeros());
            let (mut gradient, mut affine) = (SMatrix::zeros(), SMatrix::zeros());
            for Share { corner, w, g } in &self.shares[start..end] {
                let Node { values } = &corners[*corner as usize];
                for i in 0..D {
                    velocity[i] += values[i] * *w;
                    second[i] += values[D + i] * *w;
                    for a in 0..D {
                        gradient[(i, a)] += values[i] * g[a];
                    }
                }
                if self.is_affine {
                    for i in 0..D {
                        for a in 0..D {
                            affine[(i, a)] += values[D + i] * g[a];
                        }
                    }
                }
            }
            *own = Interpolated {
                velocity,
                second,
                velocity_gradient: gradient * self.spacing,
                affine: affine * self.spacing,
            };
            start = end;
        }
    }
}
