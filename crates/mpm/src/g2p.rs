//! Grid to particles: velocity, position and deformation gradient follow the grid.
//!
//! ```text
//! v_p += dt sum S_ip a_i;   x_p += dt sum S_ip (v_i + dt a_i);   F_p <- (I + dt grad v) F_p
//! ```
//!
//! USL and centred differences fuse this pass with the next P2G ([`g2p2g`](crate::g2p2g)).

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::Fault;
use crate::geometry::Constants;
use crate::health::{CheckBlock, Outcome, SharedOutcome, invalidity};
use crate::kernel::any::Interpolated;
use crate::kernel::block::{BLOCK, Block, Copies};
use crate::parallel::bins::Bins;
use crate::parallel::chunks::{each_chunk, each_chunk_of_three};
use crate::particles::Particles;
use crate::shape_function::ShapeChoice;
use crate::state::State;

/// Particles handed to a thread at a time; fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 1024;

impl<T: RealField + Copy, const D: usize> State<T, D> {
    /// USF, first G2P: F at the end of the step, by the grid velocity at its start; stored beside the old F.
    #[inline(never)]
    pub(crate) fn g2p_stretch<R, const W: usize>(&mut self, shape: R) -> Outcome
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, nodes, F_next, .. } = self;
        let (nodes, c) = (&nodes[..], *constants);
        let Particles { x, F, .. } = &*particles;
        let found = SharedOutcome::default();
        each_chunk(F_next, CHUNK, &|chunk, F_next| {
            let mut outcome = Outcome::default();
            let (mut copies, mut block) = (Copies::new(), Block::new());
            let (x, F) = (&x[chunk * CHUNK..], &F[chunk * CHUNK..]);
            let blocks = F_next.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK));
            for (index, ((F_next, x), F)) in blocks.enumerate() {
                copies.copy(x, F);
                block.compute_weights(&c, shape, copies.kinematics());
                let interpolated = &mut [Interpolated::zero(); BLOCK][..x.len()];
                block.g2p(&c.strides, nodes, x.len(), &mut *interpolated);
                let first = chunk * CHUNK + index * BLOCK;
                for (k, (((F_next, interpolated), x), F)) in
                    F_next.iter_mut().zip(interpolated).zip(x).zip(F).enumerate()
                {
                    *F_next = c.stretch(&interpolated.velocity_gradient, F);
                    if let Some(invalid) = invalidity(&shape, &c, x, F_next) {
                        let failure = Some((invalid, first + k));
                        outcome = outcome.merge(Outcome { failure, ..Outcome::default() });
                    }
                }
            }
            found.add(outcome);
        });
        found.all()
    }

    /// USF, second G2P: velocity and position; F becomes the one of the [first](Self::g2p_stretch).
    #[inline(never)]
    pub(crate) fn g2p_stretched<R, const W: usize>(&mut self, shape: R) -> Outcome
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, nodes, bins, F_next, .. } = self;
        let (nodes, c) = (&nodes[..], *constants);
        g2p(particles, bins, c, shape, |block, interpolated, first, x, v, F| {
            block.g2p(&c.strides, nodes, x.len(), &mut *interpolated);
            for ((x, v), interpolated) in x.iter_mut().zip(v).zip(interpolated) {
                *v += interpolated.acceleration * c.time_step;
                *x += interpolated.velocity * c.time_step;
            }
            F.copy_from_slice(&F_next[first..first + F.len()]);
        })
    }

    /// MUSL, first G2P: velocity alone.
    #[inline(never)]
    pub(crate) fn g2p_velocity<R, const W: usize>(&mut self, shape: R)
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, nodes, .. } = self;
        let (nodes, c) = (&nodes[..], *constants);
        let Particles { x, v, F, .. } = particles;
        each_chunk(v, CHUNK, &|chunk, v| {
            let (mut copies, mut block) = (Copies::new(), Block::new());
            let (x, F) = (&x[chunk * CHUNK..], &F[chunk * CHUNK..]);
            for ((v, x), F) in v.chunks_mut(BLOCK).zip(x.chunks(BLOCK)).zip(F.chunks(BLOCK)) {
                copies.copy(x, F);
                block.compute_weights(&c, shape, copies.kinematics());
                let interpolated = &mut [Interpolated::zero(); BLOCK][..x.len()];
                block.g2p(&c.strides, nodes, x.len(), &mut *interpolated);
                for (v, interpolated) in v.iter_mut().zip(interpolated) {
                    *v += interpolated.acceleration * c.time_step;
                }
            }
        });
    }

    /// MUSL, second G2P: position by the grid velocity, F by the reprojected one.
    #[inline(never)]
    pub(crate) fn g2p_reprojected<R, const W: usize>(&mut self, shape: R) -> Outcome
    where
        R: ShapeChoice<T, D, W>,
    {
        let Self { particles, constants, nodes, bins, reprojected, .. } = self;
        let (nodes, c) = (&nodes[..], *constants);
        let reprojected =
            if c.planted.is(Fault::NoReprojection) { nodes } else { &reprojected[..] };
        g2p(particles, bins, c, shape, |block, interpolated, _, x, _, F| {
            block.g2p(&c.strides, nodes, x.len(), &mut *interpolated);
            for (x, interpolated) in x.iter_mut().zip(&*interpolated) {
                *x += interpolated.velocity * c.time_step;
            }
            block.g2p(&c.strides, reprojected, x.len(), &mut *interpolated);
            for (F, interpolated) in F.iter_mut().zip(interpolated) {
                *F = c.stretch(&interpolated.velocity_gradient, F);
            }
        })
    }
}

/// Calls `update(weights, buffer for interpolated values, first id, x, v, F)` for every block of particles, then checks that
/// each particle is valid and in its bin.
fn g2p<T, R, const D: usize, const W: usize>(
    particles: &mut Particles<T, D>,
    bins: &Bins,
    c: Constants<T, D>,
    shape: R,
    update: impl Fn(
        &Block<T, D, W>,
        &mut [Interpolated<T, D>],
        usize,
        &mut [SVector<T, D>],
        &mut [SVector<T, D>],
        &mut [SMatrix<T, D, D>],
    ) + Sync,
) -> Outcome
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
{
    let Particles { x, v, F, .. } = particles;
    let (bin_of, found) = (bins.bin_of(), SharedOutcome::default());
    each_chunk_of_three((x, v, F), CHUNK, &|chunk, x, v, F| {
        let mut outcome = Outcome::default();
        let (mut copies, mut block) = (Copies::new(), Block::new());
        let mut interpolated = [Interpolated::zero(); BLOCK];
        let blocks = x
            .chunks_mut(BLOCK)
            .zip(v.chunks_mut(BLOCK))
            .zip(F.chunks_mut(BLOCK))
            .zip(bin_of[chunk * CHUNK..].chunks(BLOCK));
        for (index, (((x, v), F), bins)) in blocks.enumerate() {
            let first = chunk * CHUNK + index * BLOCK;
            copies.copy(x, F);
            if c.planted.is(Fault::WeightsOfNewPosition) {
                for (x, v) in copies.x.iter_mut().zip(&*v) {
                    *x += v * c.time_step;
                }
            }
            block.compute_weights(&c, shape, copies.kinematics());
            update(&block, &mut interpolated[..x.len()], first, x, v, F);
            if shape.with(CheckBlock { c: &c, bins: bins.iter().copied(), x, F }) {
                continue;
            }
            for (k, ((x, F), &bin)) in x.iter().zip(F).zip(bins).enumerate() {
                outcome = outcome.merge(c.diagnose(shape, bin, x, F, first + k));
            }
        }
        found.add(outcome);
    });
    found.all()
}
