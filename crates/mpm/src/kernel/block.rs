//! Blocks of 64 particles: weights and stresses in vector instructions, one lane a particle, and the choice of the kernel for
//! P2G and G2P.

use std::array;

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::{Fault, Planted};
use crate::geometry::Constants;
use crate::kernel::any::{Contributions, Interpolated, Receive, g2p, p2g};
use crate::kernel::lanes_plane::{g2p_in_plane, p2g_in_plane};
use crate::kernel::lanes_space::{g2p_in_space, p2g_in_space};
use crate::material::Law;
use crate::node::Node;
use crate::shape_function::{ShapeChoice, ShapeFunction, ShapeWork, index, is_extended};
use crate::simd::{Loop, Vectors, dispatch};
use crate::tensor::real;
use crate::weights::{ExtendedWeights, Weights, is_middle};

/// Particles in a block: as many as keep all of it in the first-level cache.
pub(crate) const BLOCK: usize = 64;

/// One number for every particle of a block.
type PerParticle<T> = [T; BLOCK];

/// Positions and deformation gradients of the particles of a block.
#[derive(Clone, Copy)]
pub(crate) struct Kinematics<'a, T, const D: usize> {
    /// Positions.
    pub(crate) x: &'a [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: &'a [SMatrix<T, D, D>; BLOCK],
}

impl<T: RealField + Copy, const D: usize> Kinematics<'_, T, D> {
    /// Sets the stress fluxes of the particles, for the reference volumes in `contributions.volume`.
    pub(crate) fn stress<L: Law<T>>(
        self,
        c: &Constants<T, D>,
        law: L,
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        dispatch(Stress { kinematics: self, c, law, contributions });
    }
}

/// Copies of up to `BLOCK` particles from scattered places in memory.
pub(crate) struct Copies<T, const D: usize> {
    /// Positions.
    pub(crate) x: [SVector<T, D>; BLOCK],
    /// Velocities.
    pub(crate) v: [SVector<T, D>; BLOCK],
    /// Deformation gradients.
    pub(crate) F: [SMatrix<T, D, D>; BLOCK],
}

impl<T: RealField + Copy, const D: usize> Copies<T, D> {
    pub(crate) fn new() -> Self {
        // The identity has a stress in every law.
        let zero = [SVector::zeros(); BLOCK];
        Self { x: zero, v: zero, F: [SMatrix::identity(); BLOCK] }
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

    /// Takes whole arrays, no longer than a block.
    pub(crate) fn copy(&mut self, x: &[SVector<T, D>], F: &[SMatrix<T, D, D>]) {
        self.x[..x.len()].copy_from_slice(x);
        self.F[..F.len()].copy_from_slice(F);
    }
}

/// The weights of up to `BLOCK` particles.
///
/// A loop over the block completes before another loop reads its results: vector loads wait for the narrower stores that
/// they overlap.
///
/// Layout: `S[axis][place][k]` is the factor of particle `k` along an axis at its node `place`.
pub(crate) struct Block<T, const D: usize, const W: usize> {
    /// Index of the first node of every particle.
    first_node: [usize; BLOCK],
    /// Weights `S[axis][place][k]`, except for the [middle node](is_middle).
    S: [[PerParticle<T>; W]; D],
    /// Gradients per cell, in the same layout.
    G: [[PerParticle<T>; W]; D],
    /// Whether any particle's box has extended support.
    any_extended: bool,
    /// Positions in cells from the lower corner, `xi[axis][k]`; valid where `any_extended`.
    xi: [PerParticle<T>; D],
    /// Half-sizes in cells, `l[axis][k]`; valid where `any_extended`.
    l: [PerParticle<T>; D],
}

impl<T: RealField + Copy, const D: usize, const W: usize> Block<T, D, W> {
    pub(crate) fn new() -> Self {
        let zero = [T::zero(); BLOCK];
        Self {
            first_node: [0; BLOCK],
            S: [[zero; W]; D],
            G: [[zero; W]; D],
            any_extended: false,
            xi: [zero; D],
            l: [zero; D],
        }
    }

    /// Computes the weights of particles.
    pub(crate) fn compute_weights<R: ShapeChoice<T, D, W>>(
        &mut self,
        c: &Constants<T, D>,
        shape: R,
        kinematics: Kinematics<'_, T, D>,
    ) {
        shape.with(WeightsOfBlock { block: self, c, kinematics });
        if self.any_extended {
            for k in 0..BLOCK {
                let xi = c.in_cells(&kinematics.x[k]);
                for a in 0..D {
                    self.xi[a][k] = xi[a];
                    self.l[a][k] = shape.half_size(a, stretch(c.planted, &kinematics.F[k], a));
                }
            }
        }
    }

    /// A planted fault: particles in the last cell of an axis skip the last node they reach along it.
    pub(crate) fn skip_last_node(&mut self, c: &Constants<T, D>, x: &[SVector<T, D>; BLOCK]) {
        let upper = c.upper_in_cells();
        for (k, x) in x.iter().enumerate() {
            let xi = c.in_cells(x);
            for a in (0..D).filter(|&a| xi[a] >= upper[a] - T::one()) {
                (self.S[a][W - 1][k], self.G[a][W - 1][k]) = (T::zero(), T::zero());
            }
        }
    }

    /// Position and half-sizes of a particle whose box has extended support.
    #[inline(always)]
    fn extended(&self, k: usize) -> Option<([T; D], [T; D])> {
        let l = array::from_fn(|a| self.l[a][k]);
        (self.any_extended && l.iter().any(|&l| is_extended(l)))
            .then(|| (array::from_fn(|a| self.xi[a][k]), l))
    }

    /// P2G of the first `count` particles, to the band of nodes that starts at node `first`.
    pub(crate) fn p2g(
        &self,
        strides: &[usize; D],
        band: &mut [Node<T, D>],
        first: usize,
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    ) {
        dispatch(P2g { block: self, strides, band, first, contributions, count });
    }

    /// G2P of the first `count` particles.
    pub(crate) fn g2p(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        count: usize,
        receiver: impl Receive<T, D>,
    ) {
        dispatch(G2p { block: self, strides, nodes, count, receiver });
    }
}

/// The weights of particle `k` of a block.
struct ParticleWeights<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    k: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize> Weights<T, D, W>
    for ParticleWeights<'_, T, D, W>
{
    #[inline(always)]
    fn first_node(&self) -> usize {
        self.block.first_node[self.k]
    }

    #[inline(always)]
    fn S(&self, axis: usize, place: usize) -> T {
        let S = &self.block.S[axis];
        if is_middle::<W>(place) {
            return T::one() - S[place - 1][self.k] - S[place + 1][self.k];
        }
        S[place][self.k]
    }

    #[inline(always)]
    fn G(&self, axis: usize, place: usize) -> T {
        let G = &self.block.G[axis];
        if is_middle::<W>(place) {
            return -G[place - 1][self.k] - G[place + 1][self.k];
        }
        G[place][self.k]
    }
}

/// `F_aa` of a particle, which scales its box.
#[inline(always)]
fn stretch<T: RealField + Copy, const D: usize>(
    planted: Planted,
    F: &SMatrix<T, D, D>,
    a: usize,
) -> T {
    if planted.is(Fault::SizeFromJacobian) {
        let J = (0..D).fold(T::one(), |product, i| product * F[(i, i)]);
        return J.powf(real(1.0 / D as f64));
    }
    F[(a, a)]
}

struct WeightsOfBlock<'a, T, const D: usize, const W: usize> {
    block: &'a mut Block<T, D, W>,
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
}

impl<T: RealField + Copy, const D: usize, const W: usize> ShapeWork<T, D, W>
    for WeightsOfBlock<'_, T, D, W>
{
    type Output = ();

    #[inline(always)]
    fn run<R: ShapeFunction<T, D, W>>(self, shape: R) {
        dispatch(ComputeWeights { work: self, shape });
    }
}

struct ComputeWeights<'a, T, R, const D: usize, const W: usize> {
    work: WeightsOfBlock<'a, T, D, W>,
    shape: R,
}

impl<T, R, const D: usize, const W: usize> Loop for ComputeWeights<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: ShapeFunction<T, D, W>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { work: WeightsOfBlock { block, c, kinematics: Kinematics { x, F } }, shape } =
            self;
        let Block { first_node, S, G, .. } = block;
        block.any_extended = compute_weights(c, shape, x, F, first_node, S, G);
    }
}

/// Computes weights; returns whether any box has extended support. A function of its own tells the compiler that the arrays
/// do not overlap.
#[inline(always)]
fn compute_weights<T, R, const D: usize, const W: usize>(
    c: &Constants<T, D>,
    shape: R,
    x: &[SVector<T, D>; BLOCK],
    F: &[SMatrix<T, D, D>; BLOCK],
    first_node: &mut [usize; BLOCK],
    S: &mut [[PerParticle<T>; W]; D],
    G: &mut [[PerParticle<T>; W]; D],
) -> bool
where
    T: RealField + Copy,
    R: ShapeFunction<T, D, W>,
{
    let mut any_extended = false;
    for k in 0..BLOCK {
        let xi = c.in_cells(&x[k]);
        let mut first = 0.0;
        for a in 0..D {
            let l = shape.half_size(a, stretch(c.planted, &F[k], a));
            any_extended |= is_extended(l);
            let weights = R::axis_weights(xi[a], l);
            first += weights.base * c.strides[a] as f64;
            for i in 0..W {
                if !is_middle::<W>(i) {
                    S[a][i][k] = weights.S[i];
                    G[a][i][k] = weights.G[i];
                }
            }
        }
        first_node[k] = index(first);
    }
    any_extended
}

struct P2g<'a, T, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    band: &'a mut [Node<T, D>],
    first: usize,
    contributions: &'a Contributions<T, D, BLOCK>,
    count: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize> Loop for P2g<'_, T, D, W> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, band, first, contributions, count } = self;
        let count = count.min(BLOCK);
        if D <= 2 && W <= 3 && !block.any_extended {
            p2g_in_plane(
                vectors,
                |k| ParticleWeights { block, k },
                strides,
                band,
                first,
                contributions,
                count,
            );
            return;
        }
        for k in 0..count {
            if let Some((xi, l)) = block.extended(k) {
                p2g_extended(&xi, &l, strides, band, first, (contributions, k));
            } else if D == 3 {
                let given = (contributions, k);
                p2g_in_space(vectors, &ParticleWeights { block, k }, strides, band, first, given);
            } else {
                p2g(&ParticleWeights { block, k }, strides, band, first, (contributions, k));
            }
        }
    }
}

#[inline(never)]
fn p2g_extended<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    contribution: (&Contributions<T, D, BLOCK>, usize),
) {
    p2g(&ExtendedWeights::new(xi, l, strides), strides, band, first, contribution);
}

struct G2p<'a, T, A, const D: usize, const W: usize> {
    block: &'a Block<T, D, W>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    count: usize,
    receiver: A,
}

impl<T: RealField + Copy, A: Receive<T, D>, const D: usize, const W: usize> Loop
    for G2p<'_, T, A, D, W>
{
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, nodes, count, mut receiver } = self;
        let count = count.min(BLOCK);
        if D <= 2 && W <= 3 && !block.any_extended {
            g2p_in_plane(
                vectors,
                |k| ParticleWeights { block, k },
                strides,
                nodes,
                count,
                &mut receiver,
            );
            return;
        }
        for k in 0..count {
            let interpolated = match block.extended(k) {
                Some((xi, l)) => g2p_extended(&xi, &l, strides, nodes),
                None if D == 3 => {
                    g2p_in_space(vectors, &ParticleWeights { block, k }, strides, nodes)
                }
                None => g2p(&ParticleWeights { block, k }, strides, nodes),
            };
            receiver.receive(k, &interpolated);
        }
    }
}

#[inline(never)]
fn g2p_extended<T: RealField + Copy, const D: usize>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Interpolated<T, D> {
    g2p(&ExtendedWeights::new(xi, l, strides), strides, nodes)
}

struct Stress<'a, T, L, const D: usize> {
    kinematics: Kinematics<'a, T, D>,
    c: &'a Constants<T, D>,
    law: L,
    contributions: &'a mut Contributions<T, D, BLOCK>,
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { kinematics: Kinematics { F, .. }, c, law, contributions } = self;
        if !stress_fluxes::<true, _, _, D>(c, law, F, contributions) {
            stress_fluxes::<false, _, _, D>(c, law, F, contributions);
        }
    }
}

/// Sets `-V0 tau / h` for all particles of a block, by the short form of the law or the full one; returns whether the short
/// form holds for all of them.
#[inline(always)]
fn stress_fluxes<const SHORT: bool, T: RealField + Copy, L: Law<T>, const D: usize>(
    c: &Constants<T, D>,
    law: L,
    F: &[SMatrix<T, D, D>; BLOCK],
    contributions: &mut Contributions<T, D, BLOCK>,
) -> bool {
    let mut short = true;
    for k in 0..BLOCK {
        let F = &F[k];
        short &= law.is_short(F);
        let tau = if SHORT { law.kirchhoff_short(F) } else { law.kirchhoff(F) };
        let tau = c.planted.stress_in_forces(tau, F);
        contributions.stress_flux[k] = tau * -(contributions.volume[k] * c.inverse_spacing);
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::grid::Layout;
    use crate::material::NeoHookean;
    use crate::parallel::bins::Bins;
    use crate::shape_function::StretchingBox;

    fn constants<const D: usize>() -> (Constants<f64, D>, usize) {
        let grid =
            Grid { lower: SVector::zeros(), spacing: 0.5, cells: [8; D], walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let bins = Bins::new(&layout, 1);
        (Constants::new(&grid, &layout, &bins, 0.1, 1.0), layout.nodes)
    }

    fn noise(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin()
    }

    /// Boxes may grow and shrink again from one time that a block is used to the next.
    #[test]
    fn particles_of_a_block_exchange_what_their_boxes_cover_however_many_have_extended_support() {
        fn check<const D: usize>() {
            let (c, nodes) = constants::<D>();
            let reference = SVector::repeat(0.25);
            let shape = StretchingBox(reference);
            let x: [_; BLOCK] =
                array::from_fn(|k| SVector::from_fn(|a, _| 2.0 + 1.2 * noise(5 * k + a)));
            let grid: Vec<Node<f64, D>> = (0..nodes)
                .map(|n| Node { values: array::from_fn(|q| noise(8 * n + q + 1000)) })
                .collect();
            let mut contributions = Contributions::<f64, D, BLOCK>::zero();
            for k in 0..BLOCK {
                let of = |from: usize| SVector::from_fn(|a, _| noise(3 * k + a + from));
                contributions.value[k] = Node::new(&of(50), &of(700), 1.0 + 0.5 * noise(k));
                contributions.stress_flux[k] =
                    SMatrix::from_fn(|i, j| noise(9 * k + 3 * i + j + 2000));
            }
            let mut block = Block::<f64, D, 3>::new();
            for extended in [vec![], vec![0], vec![5, BLOCK - 1], (0..BLOCK).collect(), vec![]] {
                let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                    let mut F = SMatrix::identity();
                    if extended.contains(&k) {
                        F[(k % D, k % D)] = 3.0 + noise(k);
                    }
                    F
                });
                block.compute_weights(&c, shape, Kinematics { x: &x, F: &F });
                let exact = |k: usize| {
                    let l = array::from_fn(|a| reference[a] * F[k][(a, a)]);
                    ExtendedWeights::new(&c.in_cells(&x[k]), &l, &c.strides)
                };
                for count in [BLOCK, 41] {
                    let mut interpolated = [Interpolated::zero(); BLOCK];
                    block.g2p(&c.strides, &grid, count, &mut interpolated[..]);
                    for k in 0..count {
                        let alone = g2p(&exact(k), &c.strides, &grid);
                        let off = (interpolated[k].velocity - alone.velocity).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                        let off = (interpolated[k].acceleration - alone.acceleration).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                        let off =
                            (interpolated[k].velocity_gradient - alone.velocity_gradient).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                    }
                    assert!(interpolated[count..].iter().all(|own| own.velocity.amax() == 0.0));

                    let mut sums = vec![Node::zero(); nodes];
                    let mut one_by_one = sums.clone();
                    block.p2g(&c.strides, &mut sums, 0, &contributions, count);
                    for k in 0..count {
                        p2g(&exact(k), &c.strides, &mut one_by_one, 0, (&contributions, k));
                    }
                    for (a, b) in sums.iter().zip(&one_by_one) {
                        for (a, b) in a.values.iter().zip(&b.values) {
                            assert!((a - b).abs() < 1e-12, "{extended:?} {a} {b}");
                        }
                    }
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }

    /// The short form of the stress holds for some deformations alone.
    #[test]
    fn tractions_are_those_of_each_particle_whatever_else_is_in_its_block() {
        fn check<const D: usize>() {
            let (c, _) = constants::<D>();
            let law = NeoHookean { lambda: 5.77, mu: 3.85, planted: c.planted };
            for large in [vec![], vec![0], vec![31], vec![BLOCK - 1], (0..BLOCK).collect()] {
                let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                    let stretch = if large.contains(&k) { 2.5 } else { 1.1 };
                    SMatrix::from_fn(|i, j| match i == j {
                        true => stretch + 0.05 * noise(k + i),
                        false => 0.05 * noise(k + 2 * i + j),
                    })
                });
                let mut contributions = Contributions::<f64, D, BLOCK>::zero();
                contributions.volume = array::from_fn(|k| 1.0 + 0.5 * noise(k));
                let x = [SVector::zeros(); BLOCK];
                Kinematics { x: &x, F: &F }.stress(&c, law, &mut contributions);
                for k in 0..BLOCK {
                    let expected =
                        -law.kirchhoff(&F[k]) * (contributions.volume[k] * c.inverse_spacing);
                    assert_eq!(contributions.stress_flux[k], expected, "{large:?} {k}");
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }
}
