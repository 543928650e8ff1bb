//! Blocks of 64 particles: weights and stresses in vector instructions, one lane a particle, and the choice of the kernel for
//! P2G and G2P.

use std::marker::PhantomData;

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::{Fault, Planted};
use crate::geometry::Constants;
use crate::kernel::any::{Contributions, Interpolated, Receive, g2p, p2g};
use crate::kernel::corners::Corners;
use crate::kernel::lanes_plane::{g2p_in_plane, p2g_in_plane};
use crate::kernel::lanes_space::{g2p_in_space, p2g_in_space};
use crate::material::Law;
use crate::node::Node;
use crate::shape_function::{
    CubicSpline, Gimp, HalfSizes, Hat, OnAxis, ProductShape, QuadraticSpline, ShapeFunction, index,
    moment,
};
use crate::simd::{Loop, Vectors, dispatch};
use crate::support::Support;
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

/// A law for blocks of particles.
pub(crate) trait BlockLaw<T, const D: usize>: Send + Sync {
    /// Sets the stress fluxes of particles with deformation gradients `F`, for the reference volumes in
    /// `contributions.volume`.
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        contributions: &mut Contributions<T, D, BLOCK>,
    );
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> BlockLaw<T, D> for L {
    fn stress(
        &self,
        c: &Constants<T, D>,
        F: &[SMatrix<T, D, D>; BLOCK],
        contributions: &mut Contributions<T, D, BLOCK>,
    ) {
        dispatch(Stress { F, c, law: *self, contributions });
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
pub(crate) struct Block<T, const D: usize> {
    support: Kind,
    /// Whether there are affine velocities (APIC).
    is_affine: bool,
    /// Index of the first node of every particle.
    first_node: [usize; BLOCK],
    /// Weights `S[axis][place][k]`, except for the [middle node](is_middle).
    S: AtNodes<T, D>,
    /// Gradients per cell, in the same layout.
    G: AtNodes<T, D>,
    /// Weights times arms in cells, in the same layout; valid where `is_affine`.
    Z: AtNodes<T, D>,
    /// One over the inertia along each axis; valid where `is_affine`.
    inverse_inertia: [PerParticle<T>; D],
    /// Whether any particle's box has extended support.
    any_extended: bool,
    /// Half-size beyond which it is.
    extended_above: T,
    /// Positions in cells from the lower corner, `xi[axis][k]`; valid where `any_extended`.
    xi: [PerParticle<T>; D],
    /// Half-sizes in cells, `l[axis][k]`; valid where `any_extended`.
    l: [PerParticle<T>; D],
    /// The corners of domains, for CPDI and CPDI2.
    corners: Option<Box<Corners<T, D>>>,
}

/// Numbers of every particle at each of its nodes along each axis.
type AtNodes<T, const D: usize> = [[PerParticle<T>; MOST_NODES]; D];

/// Nodes along an axis of the widest shape function.
const MOST_NODES: usize = 4;

/// Which kernels serve a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Weights are products over the axes, with so many nodes along each.
    Two,
    Three,
    Four,
    /// Domains with corners.
    Corners,
}

impl<T: RealField + Copy, const D: usize> Block<T, D> {
    pub(crate) fn new(support: &Support<T, D>, is_affine: bool) -> Self {
        let zero = [T::zero(); BLOCK];
        let kind = match support {
            Support::Product(shape) => match shape.width() {
                2 => Kind::Two,
                3 => Kind::Three,
                _ => Kind::Four,
            },
            Support::Cpdi { .. } | Support::Cpdi2 { .. } => Kind::Corners,
        };
        Self {
            support: kind,
            is_affine,
            first_node: [0; BLOCK],
            S: [[zero; MOST_NODES]; D],
            G: [[zero; MOST_NODES]; D],
            Z: [[zero; MOST_NODES]; D],
            inverse_inertia: [zero; D],
            any_extended: false,
            extended_above: T::zero(),
            xi: [zero; D],
            l: [zero; D],
            corners: (kind == Kind::Corners).then(|| Box::new(Corners::new(is_affine))),
        }
    }

    /// Computes the weights of the particles `ids`.
    pub(crate) fn compute_weights(
        &mut self,
        c: &Constants<T, D>,
        support: &Support<T, D>,
        ids: &[u32],
        kinematics: Kinematics<'_, T, D>,
    ) {
        match support {
            Support::Product(shape) => self.compute_products(c, shape, kinematics),
            Support::Cpdi { half_edges } => {
                if let Some(corners) = &mut self.corners {
                    corners.of_parallelograms(c, half_edges, ids, kinematics);
                }
            }
            Support::Cpdi2 { mesh, .. } => {
                if let Some(corners) = &mut self.corners {
                    corners.of_mesh(c, mesh, ids);
                }
            }
        }
    }

    fn compute_products(
        &mut self,
        c: &Constants<T, D>,
        shape: &ProductShape<T, D>,
        kinematics: Kinematics<'_, T, D>,
    ) {
        let half_sizes = &shape.half_sizes;
        self.extended_above = shape.extended_above();
        match shape.on_axis {
            OnAxis::Hat => self.compute_on_axes::<Hat, 2>(c, half_sizes, kinematics),
            OnAxis::Gimp => self.compute_on_axes::<Gimp, 3>(c, half_sizes, kinematics),
            OnAxis::Quadratic => {
                self.compute_on_axes::<QuadraticSpline, 3>(c, half_sizes, kinematics);
            }
            OnAxis::Cubic => self.compute_on_axes::<CubicSpline, 4>(c, half_sizes, kinematics),
        }
        if self.any_extended {
            for k in 0..BLOCK {
                let xi = c.in_cells(&kinematics.x[k]);
                for a in 0..D {
                    self.xi[a][k] = xi[a];
                    self.l[a][k] = half_sizes.along(a, stretch(c.planted, &kinematics.F[k], a));
                }
            }
        }
    }

    fn compute_on_axes<R: ShapeFunction<W>, const W: usize>(
        &mut self,
        c: &Constants<T, D>,
        half_sizes: &HalfSizes<T, D>,
        kinematics: Kinematics<'_, T, D>,
    ) {
        let on_axis = PhantomData::<R>;
        dispatch(ComputeWeights { block: self, c, kinematics, half_sizes, on_axis });
        if self.is_affine {
            dispatch(ComputeMoments { block: self, c, kinematics, half_sizes, on_axis });
        }
    }

    /// A planted fault: particles in the last cell of an axis skip the last node they reach along it.
    pub(crate) fn skip_last_node(&mut self, c: &Constants<T, D>, x: &[SVector<T, D>; BLOCK]) {
        let upper = c.upper_in_cells();
        let last = match self.support {
            Kind::Two => 1,
            Kind::Three => 2,
            Kind::Four => 3,
            Kind::Corners => return,
        };
        for (k, x) in x.iter().enumerate() {
            let xi = c.in_cells(x);
            for a in (0..D).filter(|&a| xi[a] >= upper[a] - T::one()) {
                (self.S[a][last][k], self.G[a][last][k]) = (T::zero(), T::zero());
            }
        }
    }

    /// Position and half-sizes of a particle whose box has extended support.
    #[inline(always)]
    fn extended(&self, k: usize) -> Option<([T; D], [T; D])> {
        if !self.any_extended {
            return None;
        }
        let (mut xi, mut l, mut is_extended) = ([T::zero(); D], [T::zero(); D], false);
        for a in 0..D {
            (xi[a], l[a]) = (self.xi[a][k], self.l[a][k]);
            is_extended |= l[a] > self.extended_above;
        }
        is_extended.then_some((xi, l))
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
        if let Some(corners) = &self.corners {
            corners.p2g(strides, band, first, contributions, count);
            return;
        }
        match (self.support, self.is_affine) {
            (Kind::Two, false) => {
                dispatch(P2g::<_, D, 2, false> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
            (Kind::Four, false) => {
                dispatch(P2g::<_, D, 4, false> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
            (_, false) => {
                dispatch(P2g::<_, D, 3, false> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
            (Kind::Two, true) => {
                dispatch(P2g::<_, D, 2, true> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
            (Kind::Four, true) => {
                dispatch(P2g::<_, D, 4, true> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
            (_, true) => {
                dispatch(P2g::<_, D, 3, true> {
                    block: self,
                    strides,
                    band,
                    first,
                    contributions,
                    count,
                });
            }
        }
    }

    /// G2P of the first `count` particles, to a receiver that is compiled into the kernel: for weights that are products over
    /// the axes, without affine velocities.
    pub(crate) fn g2p_with(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        count: usize,
        receiver: impl Receive<T, D>,
    ) {
        debug_assert!(!self.is_affine && self.corners.is_none(), "for single passes");
        match self.support {
            Kind::Two => {
                dispatch(G2p::<_, _, D, 2, false> { block: self, strides, nodes, count, receiver });
            }
            Kind::Four => {
                dispatch(G2p::<_, _, D, 4, false> { block: self, strides, nodes, count, receiver });
            }
            Kind::Three | Kind::Corners => {
                dispatch(G2p::<_, _, D, 3, false> { block: self, strides, nodes, count, receiver });
            }
        }
    }

    /// G2P of the first particles, as many as `receiver` has places.
    pub(crate) fn g2p(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    ) {
        let count = receiver.len();
        if let Some(corners) = &self.corners {
            corners.g2p(strides, nodes, receiver);
            return;
        }
        match (self.support, self.is_affine) {
            (Kind::Two, false) => {
                dispatch(G2p::<_, _, D, 2, false> { block: self, strides, nodes, count, receiver });
            }
            (Kind::Four, false) => {
                dispatch(G2p::<_, _, D, 4, false> { block: self, strides, nodes, count, receiver });
            }
            (_, false) => {
                dispatch(G2p::<_, _, D, 3, false> { block: self, strides, nodes, count, receiver });
            }
            (Kind::Two, true) => {
                dispatch(G2p::<_, _, D, 2, true> { block: self, strides, nodes, count, receiver });
            }
            (Kind::Four, true) => {
                dispatch(G2p::<_, _, D, 4, true> { block: self, strides, nodes, count, receiver });
            }
            (_, true) => {
                dispatch(G2p::<_, _, D, 3, true> { block: self, strides, nodes, count, receiver });
            }
        }
    }
}

/// The weights of particle `k` of a block.
struct ParticleWeights<'a, T, const D: usize, const W: usize, const AFFINE: bool> {
    block: &'a Block<T, D>,
    k: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize, const AFFINE: bool> Weights<T, D, W>
    for ParticleWeights<'_, T, D, W, AFFINE>
{
    const AFFINE: bool = AFFINE;

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

    #[inline(always)]
    fn Z(&self, axis: usize, place: usize) -> T {
        let Z = &self.block.Z[axis];
        if is_middle::<W>(place) {
            return -Z[place - 1][self.k] - Z[place + 1][self.k];
        }
        Z[place][self.k]
    }

    #[inline(always)]
    fn affine(
        &self,
        mut moments: SMatrix<T, D, D>,
        gradient: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        // For hat functions at a point the inertia may vanish, and the quotient is the gradient.
        if W == 2 {
            return *gradient;
        }
        for a in 0..D {
            for i in 0..D {
                moments[(i, a)] *= self.block.inverse_inertia[a][self.k];
            }
        }
        moments
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

struct ComputeWeights<'a, T, R, const D: usize, const W: usize> {
    block: &'a mut Block<T, D>,
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
    half_sizes: &'a HalfSizes<T, D>,
    on_axis: PhantomData<R>,
}

impl<T, R, const D: usize, const W: usize> Loop for ComputeWeights<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: ShapeFunction<W>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { block, c, kinematics, half_sizes, .. } = self;
        let Block { first_node, S, G, extended_above, .. } = block;
        let half_sizes = (half_sizes, *extended_above);
        block.any_extended =
            compute_weights::<T, R, D, W>(c, half_sizes, kinematics, first_node, S, G);
    }
}

/// Computes weights times arms, and one over the inertia.
struct ComputeMoments<'a, T, R, const D: usize, const W: usize> {
    block: &'a mut Block<T, D>,
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
    half_sizes: &'a HalfSizes<T, D>,
    on_axis: PhantomData<R>,
}

impl<T, R, const D: usize, const W: usize> Loop for ComputeMoments<'_, T, R, D, W>
where
    T: RealField + Copy,
    R: ShapeFunction<W>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { block: Block { Z, inverse_inertia, .. }, c, kinematics, half_sizes, .. } = self;
        compute_moments::<T, R, D, W>(c, half_sizes, kinematics, Z, inverse_inertia);
    }
}

/// Computes weights; returns whether any box has extended support. A function of its own tells the compiler that the arrays
/// do not overlap.
#[inline(always)]
fn compute_weights<T, R, const D: usize, const W: usize>(
    c: &Constants<T, D>,
    (half_sizes, extended_above): (&HalfSizes<T, D>, T),
    Kinematics { x, F }: Kinematics<'_, T, D>,
    first_node: &mut [usize; BLOCK],
    S: &mut AtNodes<T, D>,
    G: &mut AtNodes<T, D>,
) -> bool
where
    T: RealField + Copy,
    R: ShapeFunction<W>,
{
    let mut any_extended = false;
    for k in 0..BLOCK {
        let xi = c.in_cells(&x[k]);
        let mut first = 0.0;
        for a in 0..D {
            let l = half_sizes.along(a, stretch(c.planted, &F[k], a));
            any_extended |= l > extended_above;
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

#[inline(always)]
fn compute_moments<T, R, const D: usize, const W: usize>(
    c: &Constants<T, D>,
    half_sizes: &HalfSizes<T, D>,
    Kinematics { x, F }: Kinematics<'_, T, D>,
    Z: &mut AtNodes<T, D>,
    inverse_inertia: &mut [PerParticle<T>; D],
) where
    T: RealField + Copy,
    R: ShapeFunction<W>,
{
    for k in 0..BLOCK {
        let xi = c.in_cells(&x[k]);
        for a in 0..D {
            let weights = R::axis_weights(xi[a], half_sizes.along(a, stretch(c.planted, &F[k], a)));
            let place = weights.after_first(xi[a]);
            for i in 0..W {
                if !is_middle::<W>(i) {
                    Z[a][i][k] = weights.S[i] * (real::<T>(i as f64) - place);
                }
            }
            inverse_inertia[a][k] = moment(&weights.S, place).recip();
        }
    }
}

struct P2g<'a, T, const D: usize, const W: usize, const AFFINE: bool> {
    block: &'a Block<T, D>,
    strides: &'a [usize; D],
    band: &'a mut [Node<T, D>],
    first: usize,
    contributions: &'a Contributions<T, D, BLOCK>,
    count: usize,
}

impl<T: RealField + Copy, const D: usize, const W: usize, const AFFINE: bool> Loop
    for P2g<'_, T, D, W, AFFINE>
{
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, band, first, contributions, count } = self;
        let count = count.min(BLOCK);
        let weights = |k| ParticleWeights::<T, D, W, AFFINE> { block, k };
        if D <= 2 && !block.any_extended {
            p2g_in_plane(vectors, weights, strides, band, first, contributions, count);
            return;
        }
        for k in 0..count {
            let given = (contributions, k);
            if let Some((xi, l)) = block.extended(k) {
                p2g_extended::<T, D, AFFINE>(&xi, &l, strides, band, first, given);
            } else if D == 3 {
                p2g_in_space(vectors, &weights(k), strides, band, first, given);
            } else {
                p2g(&weights(k), strides, band, first, given);
            }
        }
    }
}

#[inline(never)]
fn p2g_extended<T: RealField + Copy, const D: usize, const AFFINE: bool>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    contribution: (&Contributions<T, D, BLOCK>, usize),
) {
    let weights = ExtendedWeights::<T, D, AFFINE>::new(xi, l, strides);
    p2g(&weights, strides, band, first, contribution);
}

struct G2p<'a, T, A, const D: usize, const W: usize, const AFFINE: bool> {
    block: &'a Block<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    count: usize,
    receiver: A,
}

impl<T, A, const D: usize, const W: usize, const AFFINE: bool> Loop for G2p<'_, T, A, D, W, AFFINE>
where
    T: RealField + Copy,
    A: Receive<T, D>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { block, strides, nodes, count, mut receiver } = self;
        let count = count.min(BLOCK);
        let weights = |k| ParticleWeights::<T, D, W, AFFINE> { block, k };
        if D <= 2 && !block.any_extended {
            g2p_in_plane(vectors, weights, strides, nodes, count, &mut receiver);
            return;
        }
        for k in 0..count {
            let interpolated = match block.extended(k) {
                Some((xi, l)) => g2p_extended::<T, D, AFFINE>(&xi, &l, strides, nodes),
                None if D == 3 => g2p_in_space(vectors, &weights(k), strides, nodes),
                None => g2p(&weights(k), strides, nodes),
            };
            receiver.receive(k, &interpolated);
        }
    }
}

#[inline(never)]
fn g2p_extended<T: RealField + Copy, const D: usize, const AFFINE: bool>(
    xi: &[T; D],
    l: &[T; D],
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Interpolated<T, D> {
    g2p(&ExtendedWeights::<T, D, AFFINE>::new(xi, l, strides), strides, nodes)
}

struct Stress<'a, T, L, const D: usize> {
    F: &'a [SMatrix<T, D, D>; BLOCK],
    c: &'a Constants<T, D>,
    law: L,
    contributions: &'a mut Contributions<T, D, BLOCK>,
}

impl<T: RealField + Copy, L: Law<T>, const D: usize> Loop for Stress<'_, T, L, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { F, c, law, contributions } = self;
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
        fn check<const D: usize, const AFFINE: bool>() {
            let (c, nodes) = constants::<D>();
            let reference = SVector::repeat(0.25);
            let support = Support::Product(ProductShape::gimp(reference));
            let ids = array::from_fn::<_, BLOCK, _>(|k| k as u32);
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
                contributions.affine[k] = SMatrix::from_fn(|i, j| noise(7 * k + 3 * i + j + 3000));
            }
            let mut block = Block::new(&support, AFFINE);
            for extended in [vec![], vec![0], vec![5, BLOCK - 1], (0..BLOCK).collect(), vec![]] {
                let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                    let mut F = SMatrix::identity();
                    if extended.contains(&k) {
                        F[(k % D, k % D)] = 3.0 + noise(k);
                    }
                    F
                });
                block.compute_weights(&c, &support, &ids, Kinematics { x: &x, F: &F });
                let exact = |k: usize| {
                    let l = array::from_fn(|a| reference[a] * F[k][(a, a)]);
                    ExtendedWeights::<_, D, AFFINE>::new(&c.in_cells(&x[k]), &l, &c.strides)
                };
                for count in [BLOCK, 41] {
                    let mut interpolated = [Interpolated::zero(); BLOCK];
                    block.g2p(&c.strides, &grid, &mut interpolated[..count]);
                    for k in 0..count {
                        let alone = g2p(&exact(k), &c.strides, &grid);
                        let off = (interpolated[k].velocity - alone.velocity).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                        let off = (interpolated[k].second - alone.second).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                        let off =
                            (interpolated[k].velocity_gradient - alone.velocity_gradient).amax();
                        assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                        // Divided by an inertia of some hundredths of a cell.
                        let off = (interpolated[k].affine - alone.affine).amax();
                        assert!(off < 1e-11, "{extended:?} {k} {off:e}");
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
        check::<1, false>();
        check::<2, false>();
        check::<3, false>();
        check::<1, true>();
        check::<2, true>();
        check::<3, true>();
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
                law.stress(&c, &F, &mut contributions);
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
