//! Particles that advance as soon as the values of the grid at them are known, within the kernels of G2P.

use mmsmith_lanes::simd::{Lane4, Lanes, Vectors};
use mmsmith_laws::fault::Fault;
use nalgebra::{SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::kernel::any::{Contributions, Interpolated, Receive};
use crate::kernel::copies::BLOCK;
use crate::kernel::prefetch::prefetch;
use crate::shape::weights::Weights;

/// Receiver of G2P: advances velocity, position and F, and sets mass, momentum and body force of the next P2G.
pub(crate) struct AdvanceParticles<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) time_step: T,
    /// Time step over the edge of a cell.
    pub(crate) per_cell: T,
    /// Whether velocities are replaced by the second vector of the nodes, as by PIC and APIC. Else this is an acceleration, as by FLIP.
    pub(crate) replaces: bool,
    pub(crate) x: &'a mut [SVector<T, D>; BLOCK],
    pub(crate) v: &'a mut [SVector<T, D>; BLOCK],
    pub(crate) F: &'a mut [SMatrix<T, D, D>; BLOCK],
    /// Affine velocities per cell, by APIC.
    pub(crate) affine: Option<&'a mut [SMatrix<T, D, D>; BLOCK]>,
    /// `b` holds the body forces per mass on entry.
    pub(crate) contributions: &'a mut Contributions<T, D, BLOCK>,
    /// The scalars of nodes, but in the plane.
    pub(crate) growth: &'a mut [T; BLOCK],
}

impl<T: Lanes, const D: usize> Receive<T, D> for AdvanceParticles<'_, T, D> {
    #[inline(always)]
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>) {
        let Self { c, contributions, .. } = self;
        let (x, v, F) = (&mut self.x[k], &mut self.v[k], &mut self.F[k]);
        prefetch(x, BLOCK);
        prefetch(v, BLOCK);
        prefetch(F, BLOCK);
        let mut velocity = interpolated.velocity;
        if self.replaces {
            *v = interpolated.second;
        } else {
            *v += interpolated.second * c.time_step;
            if c.planted.is(Fault::PicForFlip) {
                *v = velocity;
            }
        }
        if c.planted.is(Fault::OwnVelocity) {
            velocity = *v;
        }
        *x += c.planted.change(velocity * c.time_step);
        *F = c.stretch(&interpolated.velocity_gradient, F);
        if D != 2 {
            self.growth[k] = interpolated.scalar;
        }
        contributions.set_value(c, k, v);
        if let Some(affine) = &mut self.affine {
            if !c.planted.is(Fault::AffinePartDropped) {
                affine[k] = interpolated.affine;
            }
            contributions.affine[k] = affine[k] * contributions.mass[k];
        }
    }

    #[inline(always)]
    fn receive_lanes<const W: usize>(
        &mut self,
        vectors: impl Vectors,
        k: usize,
        weights: &impl Weights<T, D, W>,
        value: Lane4<T>,
        gradient: [Lane4<T>; D],
    ) {
        let interpolated =
            || Interpolated::new(weights, &value.0, &gradient.map(|gradient| gradient.0));
        // Faults are planted in the form for all dimensions.
        if D != 2 || self.c.planted.is_any() {
            self.receive(k, &interpolated());
            return;
        }
        prefetch(&self.x[k], BLOCK);
        prefetch(&self.v[k], BLOCK);
        prefetch(&self.F[k], BLOCK);
        let Self { time_step, per_cell, contributions, replaces, .. } = self;
        let (Some(x), Some(v), Some(F)) = (
            self.x[k].as_mut_slice().first_chunk_mut::<2>(),
            self.v[k].as_mut_slice().first_chunk_mut::<2>(),
            self.F[k].as_mut_slice().first_chunk_mut::<4>(),
        ) else {
            return;
        };
        let mut xv = vectors
            .add(Lane4([x[0], x[1], v[0], v[1]]), vectors.mul(value, vectors.splat(*time_step)));
        if *replaces {
            xv = vectors.low_and_high(xv, value);
        }
        *x = [xv.0[0], xv.0[1]];
        *v = [xv.0[2], xv.0[3]];
        let factor = vectors.splat(*per_cell);
        let old = vectors.load(F);
        let along = vectors.mul(vectors.low_twice(gradient[0]), factor);
        let across = vectors.mul(vectors.low_twice(gradient[D - 1]), factor);
        let stretch = vectors
            .add(vectors.mul(along, vectors.even(old)), vectors.mul(across, vectors.odd(old)));
        *F = vectors.add(old, stretch).0;
        contributions.set_value_in_plane(vectors, k, xv);
        if let Some(affine) = &mut self.affine {
            affine[k] = interpolated().affine;
            contributions.affine[k] = affine[k] * contributions.mass[k];
        }
    }
}
