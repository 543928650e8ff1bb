//! Weights that are products over the axes, of blocks of 64 particles: one lane a particle. P2G and G2P with them.

use std::marker::PhantomData;

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::real;
use mmsmith_laws::fault::{Fault, Planted};
use nalgebra::{SMatrix, SVector};

use crate::every_scheme::EVERY_SCHEME;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::advance::AdvanceParticles;
use crate::kernel::any::{Contributions, Interpolated, Receive, g2p, g2p_scalar, p2g};
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::lanes_plane::{g2p_in_plane, p2g_in_plane};
use crate::kernel::lanes_space::{g2p_in_space, p2g_in_space};
use crate::kernel::{beyond, nodes_from, nodes_from_mut};
use crate::shape::one_axis::{
    CubicSpline, EXTENDED, Gimp, Hat, OF_TWO_CELLS, OnAxis, ProductShape, QuadraticMean,
    QuadraticSpline, ShapeFunction, half_size, index, moment,
};
use crate::shape::weights::{ExtendedWeights, Weights, is_middle};

/// One number for every particle of a block.
type PerParticle<T> = [T; BLOCK];

/// Numbers of every particle at each of its nodes along each axis.
type AtNodes<T, const D: usize> = [[PerParticle<T>; MOST_NODES]; D];

/// Nodes along an axis of the widest shape function.
const MOST_NODES: usize = 4;

/// The weights of up to `BLOCK` particles.
///
/// Layout: `S[axis][place][k]` is the factor of particle `k` along an axis at its node `place`.
pub(crate) struct ProductWeights<T, const D: usize> {
    pub(super) shape: ProductShape<T, D>,
    /// Nodes along each axis: 2, 3 or 4.
    pub(super) width: usize,
    /// Whether there are affine velocities (APIC).
    pub(super) is_affine: bool,
    /// Index of the first node of every particle.
    first_node: [usize; BLOCK],
    /// As in [`Constants`].
    pub(super) nodes_before: usize,
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
    /// Positions in cells from the lower corner, `xi[axis][k]`; valid where `any_extended`, and in single precision.
    xi: [PerParticle<T>; D],
    /// Half-sizes in cells, `l[axis][k]`; valid where positions are.
    l: [PerParticle<T>; D],
}

/// Dispatches a pass over a block with constants for the width of its weights and for whether they are affine.
macro_rules! dispatch_by_width {
    ($width:expr, true, $pass:ident<$($of:tt),*>, $block:expr) => {
        match $width {
            2 if EVERY_SCHEME => dispatch($pass::<$($of,)* 2, true>($block)),
            4 if EVERY_SCHEME => dispatch($pass::<$($of,)* 4, true>($block)),
            _ => dispatch($pass::<$($of,)* 3, true>($block)),
        }
    };
    ($width:expr, false, $pass:ident<$($of:tt),*>, $block:expr) => {
        match $width {
            2 if EVERY_SCHEME => dispatch($pass::<$($of,)* 2, false>($block)),
            4 if EVERY_SCHEME => dispatch($pass::<$($of,)* 4, false>($block)),
            _ => dispatch($pass::<$($of,)* 3, false>($block)),
        }
    };
    ($width:expr, $is_affine:expr, $pass:ident<$($of:tt),*>, $block:expr) => {
        match EVERY_SCHEME && $is_affine {
            true => dispatch_by_width!($width, true, $pass<$($of),*>, $block),
            false => dispatch_by_width!($width, false, $pass<$($of),*>, $block),
        }
    };
}

pub(super) use dispatch_by_width;

impl<T: Lanes, const D: usize> ProductWeights<T, D> {
    pub(crate) fn new(shape: &ProductShape<T, D>, is_affine: bool) -> Self {
        let zero = [T::zero(); BLOCK];
        Self {
            shape: *shape,
            width: shape.width(),
            is_affine,
            first_node: [0; BLOCK],
            nodes_before: 0,
            S: [[zero; MOST_NODES]; D],
            G: [[zero; MOST_NODES]; D],
            Z: [[zero; MOST_NODES]; D],
            inverse_inertia: [zero; D],
            any_extended: false,
            xi: [zero; D],
            l: [zero; D],
        }
    }

    fn compute_on_axes<R: ShapeFunction<W>, const W: usize, const STRETCHING: bool>(
        &mut self,
        c: &Constants<T, D>,
        l: &SVector<T, D>,
        kinematics: Kinematics<'_, T, D>,
    ) {
        let (is_affine, on_axis) = (self.is_affine, PhantomData::<R>);
        let weights = &mut *self;
        dispatch(Compute::<_, _, D, W, STRETCHING, false> { weights, c, kinematics, l, on_axis });
        if EVERY_SCHEME && is_affine {
            let weights = self;
            dispatch(Compute::<_, _, D, W, STRETCHING, true> {
                weights,
                c,
                kinematics,
                l,
                on_axis,
            });
        }
    }

    /// G2P of the first `count` particles to a receiver that is compiled into the kernel.
    fn g2p_with(
        &self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        count: usize,
        receiver: impl Receive<T, D>,
    ) {
        let of_block = G2pOfBlock { weights: self, strides, nodes, count, receiver };
        dispatch_by_width!(self.width, self.is_affine, G2p<_, _, D>, of_block);
    }

    /// Shape, position and half-sizes of a particle whose box has extended support.
    #[inline(always)]
    pub(super) fn extended(&self, k: usize) -> Option<Extended<T, D>> {
        if !self.any_extended {
            return None;
        }
        let (mut xi, mut l, mut is_extended) = ([T::zero(); D], [T::zero(); D], false);
        for a in 0..D {
            (xi[a], l[a]) = (self.xi[a][k], self.l[a][k]);
            is_extended |= l[a] > self.shape.extended_above();
        }
        is_extended.then_some(Extended { on_axis: self.shape.on_axis(), xi, l })
    }
}

impl<T: Lanes, const D: usize> BlockWeights<T, D> for ProductWeights<T, D> {
    fn compute(&mut self, c: &Constants<T, D>, _: &[u32], kinematics: Kinematics<'_, T, D>) {
        self.nodes_before = c.nodes_before as usize;
        let l = self.shape.l;
        match self.shape.on_axis() {
            OnAxis::Hat => self.compute_on_axes::<Hat, 2, false>(c, &l, kinematics),
            OnAxis::FixedBox => self.compute_on_axes::<Gimp, 3, false>(c, &l, kinematics),
            OnAxis::StretchingBox => self.compute_on_axes::<Gimp, 3, true>(c, &l, kinematics),
            OnAxis::Quadratic => {
                self.compute_on_axes::<QuadraticSpline, 3, false>(c, &l, kinematics);
            }
            OnAxis::Cubic => self.compute_on_axes::<CubicSpline, 4, false>(c, &l, kinematics),
            OnAxis::QuadraticMean => {
                self.compute_on_axes::<QuadraticMean, 4, true>(c, &l, kinematics);
            }
        }
    }

    fn p2g(
        &mut self,
        strides: &[usize; D],
        window: &mut [Node<T, D>],
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    ) {
        let of_block = P2gOfBlock { weights: self, strides, window, contributions, count };
        dispatch_by_width!(self.width, self.is_affine, P2g<_, D>, of_block);
    }

    fn g2p(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    ) {
        if !EVERY_SCHEME {
            beyond("values that the usual scheme stores nowhere");
        }
        self.g2p_with(strides, nodes, receiver.len(), receiver);
    }

    fn g2p_and_advance(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        interpolated: &mut [Interpolated<T, D>],
        particles: AdvanceParticles<'_, T, D>,
    ) {
        self.g2p_with(strides, nodes, interpolated.len(), particles);
    }

    fn p2g_scalars(
        &mut self,
        strides: &[usize; D],
        window: &mut [Node<T, D>],
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    ) {
        // Kernels but those of the plane have registers for all of a node.
        if D != 2 || self.any_extended {
            return;
        }
        let of_block = ScalarsToNodes { weights: self, strides, window, contributions, count };
        dispatch_by_width!(self.width, false, ToNodes<_, D>, of_block);
    }

    fn g2p_scalars(&mut self, strides: &[usize; D], nodes: &[Node<T, D>], values: &mut [T]) {
        let of_block = ScalarsFromNodes { weights: self, strides, nodes, values };
        dispatch_by_width!(self.width, false, FromNodes<_, D>, of_block);
    }

    fn skip_last_node(&mut self, c: &Constants<T, D>, x: &[SVector<T, D>; BLOCK]) {
        let upper = c.upper_in_cells();
        let last = self.width - 1;
        for (k, x) in x.iter().enumerate() {
            let xi = c.in_cells(x);
            for a in (0..D).filter(|&a| xi[a] >= upper[a] - T::one()) {
                (self.S[a][last][k], self.G[a][last][k]) = (T::zero(), T::zero());
            }
        }
    }
}

/// A particle whose box has extended support.
pub(super) struct Extended<T, const D: usize> {
    on_axis: OnAxis,
    /// Position and half-sizes in cells, as in [`ProductWeights`].
    xi: [T; D],
    l: [T; D],
}

impl<T: Lanes, const D: usize> Extended<T, D> {
    /// Whether the box has at most two cells along each axis.
    fn is_of_two_cells(&self) -> bool {
        self.l.iter().all(|&l| l <= T::one())
    }

    pub(super) fn weights<const AFFINE: bool>(
        &self,
        strides: (&[usize; D], usize),
    ) -> ExtendedWeights<T, D, AFFINE> {
        ExtendedWeights::new(self.on_axis, &self.xi, &self.l, strides)
    }
}

/// The weights of particle `k` of a block.
pub(super) struct ParticleWeights<'a, T, const D: usize, const W: usize, const AFFINE: bool> {
    pub(super) weights: &'a ProductWeights<T, D>,
    pub(super) k: usize,
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Weights<T, D, W>
    for ParticleWeights<'_, T, D, W, AFFINE>
{
    const AFFINE: bool = AFFINE;

    #[inline(always)]
    fn first_node(&self) -> usize {
        self.weights.first_node[self.k]
    }

    #[inline(always)]
    fn S(&self, axis: usize, place: usize) -> T {
        let S = &self.weights.S[axis];
        if is_middle::<W>(place) {
            return T::one() - S[place - 1][self.k] - S[place + 1][self.k];
        }
        S[place][self.k]
    }

    #[inline(always)]
    fn G(&self, axis: usize, place: usize) -> T {
        let G = &self.weights.G[axis];
        if is_middle::<W>(place) {
            return -G[place - 1][self.k] - G[place + 1][self.k];
        }
        G[place][self.k]
    }

    #[inline(always)]
    fn Z(&self, axis: usize, place: usize) -> T {
        let Z = &self.weights.Z[axis];
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
                moments[(i, a)] *= self.weights.inverse_inertia[a][self.k];
            }
        }
        moments
    }
}

/// `F_aa` of a particle, which scales its box.
#[inline(always)]
fn stretch<T: Lanes, const D: usize>(planted: Planted, F: &SMatrix<T, D, D>, a: usize) -> T {
    if planted.is(Fault::SizeFromJacobian) {
        let J = (0..D).fold(T::one(), |product, i| product * F[(i, i)]);
        return J.powf(real(1.0 / D as f64));
    }
    F[(a, a)]
}

/// Computes weights and gradients, or else `MOMENTS`: weights times arms, and one over the inertia.
struct Compute<
    'a,
    T,
    R,
    const D: usize,
    const W: usize,
    const STRETCHING: bool,
    const MOMENTS: bool,
> {
    weights: &'a mut ProductWeights<T, D>,
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
    /// Half-sizes in the reference configuration, which F scales where boxes are `STRETCHING`.
    l: &'a SVector<T, D>,
    on_axis: PhantomData<R>,
}

impl<T, R, const D: usize, const W: usize, const STRETCHING: bool, const MOMENTS: bool> Loop
    for Compute<'_, T, R, D, W, STRETCHING, MOMENTS>
where
    T: Lanes,
    R: ShapeFunction<W>,
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { weights, c, kinematics, l: reference, .. } = self;
        let above = weights.shape.extended_above();
        let ProductWeights { first_node, S, G, Z, inverse_inertia, .. } = weights;
        let ProductWeights { any_extended, xi, l, .. } = weights;
        let of_particle = |k: usize, a: usize| {
            let Kinematics { x, F } = kinematics;
            let F_aa = stretch(c.planted, &F[k], a);
            let of_box = half_size::<_, STRETCHING>(reference[a], F_aa);
            let l = if R::BEYOND_BOX > 0.0 { of_box + real(R::BEYOND_BOX) } else { of_box };
            (c.in_cells(&x[k])[a], l)
        };
        // In single precision the loop is vectorised only where the numbers of an axis lie side by side; in double precision it is
        // vectorised either way, and laying them so would cost 1 to 3 % of a step.
        if const { size_of::<T>() > size_of::<f32>() } {
            if MOMENTS {
                compute_moments::<T, R, D, W>(of_particle, Z, inverse_inertia);
            } else {
                *any_extended =
                    compute_weights::<T, R, D, W>(of_particle, above, c, first_node, S, G);
                if *any_extended {
                    lay_side_by_side(of_particle, xi, l);
                }
            }
            return;
        }
        if !MOMENTS {
            lay_side_by_side(of_particle, xi, l);
        }
        let of_particle = |k: usize, a: usize| (xi[a][k], l[a][k]);
        if MOMENTS {
            compute_moments::<T, R, D, W>(of_particle, Z, inverse_inertia);
        } else {
            *any_extended = compute_weights::<T, R, D, W>(of_particle, above, c, first_node, S, G);
        }
    }
}

/// Writes position and half-size of every particle, `of_particle(k, axis)`, axis by axis.
#[inline(always)]
fn lay_side_by_side<T: Lanes, const D: usize>(
    of_particle: impl Fn(usize, usize) -> (T, T),
    xi: &mut [PerParticle<T>; D],
    l: &mut [PerParticle<T>; D],
) {
    for k in 0..BLOCK {
        for a in 0..D {
            (xi[a][k], l[a][k]) = of_particle(k, a);
        }
    }
}

/// Computes weights from position and half-size of every particle, `of_particle(k, axis)`; returns whether any box has extended
/// support, a half-size above `extended_above`. A function of its own tells the compiler that the arrays do not overlap.
#[inline(always)]
fn compute_weights<T, R, const D: usize, const W: usize>(
    of_particle: impl Fn(usize, usize) -> (T, T),
    extended_above: T,
    c: &Constants<T, D>,
    first_node: &mut [usize; BLOCK],
    S: &mut AtNodes<T, D>,
    G: &mut AtNodes<T, D>,
) -> bool
where
    T: Lanes,
    R: ShapeFunction<W>,
{
    let mut any_extended = false;
    for k in 0..BLOCK {
        let mut first = -c.nodes_before;
        for a in 0..D {
            let (xi, l) = of_particle(k, a);
            any_extended |= l > extended_above;
            let weights = R::axis_weights(xi, l);
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
    of_particle: impl Fn(usize, usize) -> (T, T),
    Z: &mut AtNodes<T, D>,
    inverse_inertia: &mut [PerParticle<T>; D],
) where
    T: Lanes,
    R: ShapeFunction<W>,
{
    for k in 0..BLOCK {
        for a in 0..D {
            let (xi, l) = of_particle(k, a);
            let weights = R::axis_weights(xi, l);
            let place = weights.after_first(xi);
            for i in 0..W {
                if !is_middle::<W>(i) {
                    Z[a][i][k] = weights.S[i] * (real::<T>(i as f64) - place);
                }
            }
            inverse_inertia[a][k] = moment(&weights.S, place).recip();
        }
    }
}

struct P2g<'a, T, const D: usize, const W: usize, const AFFINE: bool>(P2gOfBlock<'a, T, D>);

struct P2gOfBlock<'a, T, const D: usize> {
    weights: &'a ProductWeights<T, D>,
    strides: &'a [usize; D],
    window: &'a mut [Node<T, D>],
    contributions: &'a Contributions<T, D, BLOCK>,
    count: usize,
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Loop
    for P2g<'_, T, D, W, AFFINE>
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self(P2gOfBlock { weights, strides, window, contributions, count }) = self;
        let count = count.min(BLOCK);
        let of_particle = |k| ParticleWeights::<T, D, W, AFFINE> { weights, k };
        if D <= 2 && !weights.any_extended {
            p2g_in_plane(vectors, of_particle, strides, window, contributions, count);
            return;
        }
        for k in 0..count {
            let given = (contributions, k);
            if let Some(extended) = weights.extended(k) {
                let strides = (strides, weights.nodes_before);
                p2g_extended::<T, D, AFFINE>(&extended, strides, window, given);
            } else if D == 3 {
                p2g_in_space(vectors, &of_particle(k), strides, window, given);
            } else {
                p2g(&of_particle(k), strides, window, given);
            }
        }
    }
}

/// P2G of particle `k`, whose box has extended support. It has a loop of its own: the loops of the other particles stay short, and it is compiled with their
/// registers all the same.
#[inline(never)]
fn p2g_extended<T: Lanes, const D: usize, const AFFINE: bool>(
    extended: &Extended<T, D>,
    strides: (&[usize; D], usize),
    window: &mut [Node<T, D>],
    contribution: (&Contributions<T, D, BLOCK>, usize),
) {
    let own = ExtendedP2g { extended, strides, window, contribution };
    dispatch_extended::<T, _, D, AFFINE>(extended, own);
}

/// Dispatches a pass of a particle with extended support with a constant for the nodes along each axis that its box reaches.
fn dispatch_extended<T: Lanes, P, const D: usize, const AFFINE: bool>(
    extended: &Extended<T, D>,
    pass: P,
) where
    OfExtended<P, OF_TWO_CELLS, AFFINE>: Loop,
    OfExtended<P, EXTENDED, AFFINE>: Loop,
{
    if extended.is_of_two_cells() {
        dispatch(OfExtended::<_, OF_TWO_CELLS, AFFINE>(pass));
    } else {
        dispatch(OfExtended::<_, EXTENDED, AFFINE>(pass));
    }
}

/// A pass of a particle with extended support, to or from the first `W` nodes along each axis.
struct OfExtended<P, const W: usize, const AFFINE: bool>(P);

struct ExtendedP2g<'a, T, const D: usize> {
    extended: &'a Extended<T, D>,
    /// With the nodes before those of a window.
    strides: (&'a [usize; D], usize),
    window: &'a mut [Node<T, D>],
    contribution: (&'a Contributions<T, D, BLOCK>, usize),
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Loop
    for OfExtended<ExtendedP2g<'_, T, D>, W, AFFINE>
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(ExtendedP2g { extended, strides, window, contribution }) = self;
        let weights = extended.weights::<AFFINE>(strides);
        p2g::<_, _, D, W, BLOCK>(&weights, strides.0, window, contribution);
    }
}

struct ExtendedG2p<'a, T, const D: usize> {
    extended: &'a Extended<T, D>,
    strides: (&'a [usize; D], usize),
    nodes: &'a [Node<T, D>],
    interpolated: &'a mut Interpolated<T, D>,
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Loop
    for OfExtended<ExtendedG2p<'_, T, D>, W, AFFINE>
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(ExtendedG2p { extended, strides, nodes, interpolated }) = self;
        let weights = extended.weights::<AFFINE>(strides);
        *interpolated = g2p::<_, _, D, W>(&weights, strides.0, nodes);
    }
}

struct G2p<'a, T, A, const D: usize, const W: usize, const AFFINE: bool>(G2pOfBlock<'a, T, A, D>);

struct G2pOfBlock<'a, T, A, const D: usize> {
    weights: &'a ProductWeights<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    count: usize,
    receiver: A,
}

impl<T, A, const D: usize, const W: usize, const AFFINE: bool> Loop for G2p<'_, T, A, D, W, AFFINE>
where
    T: Lanes,
    A: Receive<T, D>,
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self(G2pOfBlock { weights, strides, nodes, count, mut receiver }) = self;
        let count = count.min(BLOCK);
        let of_particle = |k| ParticleWeights::<T, D, W, AFFINE> { weights, k };
        // A particle's bits do not depend on the others of its block, which are others where the body is shared out.
        let mut k = 0;
        while k < count {
            if let Some(extended) = weights.extended(k) {
                let strides = (strides, weights.nodes_before);
                receiver.receive(k, &g2p_extended::<T, D, AFFINE>(&extended, strides, nodes));
                k += 1;
            } else if D == 3 {
                receiver.receive(k, &g2p_in_space(vectors, &of_particle(k), strides, nodes));
                k += 1;
            } else {
                let is_extended = |k: &usize| weights.extended(*k).is_some();
                let end = match weights.any_extended {
                    true => (k + 1..count).find(is_extended).unwrap_or(count),
                    false => count,
                };
                g2p_in_plane(vectors, of_particle, strides, nodes, k..end, &mut receiver);
                k = end;
            }
        }
    }
}

/// G2P of a particle whose box has extended support, as [`p2g_extended`].
#[inline(never)]
fn g2p_extended<T: Lanes, const D: usize, const AFFINE: bool>(
    extended: &Extended<T, D>,
    strides: (&[usize; D], usize),
    nodes: &[Node<T, D>],
) -> Interpolated<T, D> {
    let mut result = Interpolated::zero();
    let own = ExtendedG2p { extended, strides, nodes, interpolated: &mut result };
    dispatch_extended::<T, _, D, AFFINE>(extended, own);
    result
}

struct ToNodes<'a, T, const D: usize, const W: usize, const AFFINE: bool>(ScalarsToNodes<'a, T, D>);

struct ScalarsToNodes<'a, T, const D: usize> {
    weights: &'a ProductWeights<T, D>,
    strides: &'a [usize; D],
    window: &'a mut [Node<T, D>],
    contributions: &'a Contributions<T, D, BLOCK>,
    count: usize,
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Loop
    for ToNodes<'_, T, D, W, AFFINE>
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(ScalarsToNodes { weights, strides, window, contributions, count }) = self;
        let mut k = 0;
        while k < count {
            // Successive particles with the same nodes.
            let start = weights.first_node[k];
            let mut sums = [[T::zero(); W]; W];
            while k < count && weights.first_node[k] == start {
                let own = ParticleWeights::<T, D, W, AFFINE> { weights, k };
                let value = contributions.value[k].scalar();
                for (j, sums) in sums.iter_mut().enumerate() {
                    let of_row = value * own.S(D - 1, j);
                    for (i, sum) in sums.iter_mut().enumerate() {
                        *sum += of_row * own.S(0, i);
                    }
                }
                k += 1;
            }
            for (j, sums) in sums.into_iter().enumerate() {
                let place = start + j * strides[D - 1];
                let nodes = nodes_from_mut::<_, W>(window, place, "a stencil beyond its window");
                for (node, sum) in nodes.iter_mut().zip(sums) {
                    *node.scalar_mut() += sum;
                }
            }
        }
    }
}

struct FromNodes<'a, T, const D: usize, const W: usize, const AFFINE: bool>(
    ScalarsFromNodes<'a, T, D>,
);

struct ScalarsFromNodes<'a, T, const D: usize> {
    weights: &'a ProductWeights<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    values: &'a mut [T],
}

impl<T: Lanes, const D: usize, const W: usize, const AFFINE: bool> Loop
    for FromNodes<'_, T, D, W, AFFINE>
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(ScalarsFromNodes { weights, strides, nodes, values }) = self;
        let (mut k, count) = (0, values.len());
        while k < count {
            if let Some(extended) = weights.extended(k) {
                let of_particle = extended.weights::<AFFINE>((strides, weights.nodes_before));
                values[k] = g2p_scalar::<_, _, D, EXTENDED>(&of_particle, strides, nodes);
                k += 1;
                continue;
            }
            if D != 2 {
                let own = ParticleWeights::<T, D, W, AFFINE> { weights, k };
                values[k] = g2p_scalar(&own, strides, nodes);
                k += 1;
                continue;
            }
            // Successive particles with the same nodes; a particle's bits do not depend on the others.
            let start = weights.first_node[k];
            let mut scalars = [[T::zero(); W]; W];
            for (j, scalars) in scalars.iter_mut().enumerate() {
                let place = start + j * strides[D - 1];
                let nodes = nodes_from::<_, W>(nodes, place, "a stencil beyond the grid");
                for (scalar, node) in scalars.iter_mut().zip(nodes) {
                    *scalar = node.scalar();
                }
            }
            while k < count && weights.first_node[k] == start && weights.extended(k).is_none() {
                let own = ParticleWeights::<T, D, W, AFFINE> { weights, k };
                let mut sum = T::zero();
                for (j, scalars) in scalars.iter().enumerate() {
                    let mut of_row = T::zero();
                    for (i, scalar) in scalars.iter().enumerate() {
                        of_row += *scalar * own.S(0, i);
                    }
                    sum += of_row * own.S(D - 1, j);
                }
                values[k] = sum;
                k += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests;
