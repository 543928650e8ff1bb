//! P2G and G2P in the half plane of a body of revolution that may turn about its axis, the last one of space.
//!
//! Particles live in space. Nodes have the place `(r, z)`, and vectors along `e_r`, `e_theta`, `e_z`, which are those of each particle's own
//! half plane. With the test functions `N_i(r, z)` times these directions, the gradient of a velocity and the force of a stress are
//!
//! ```text
//! | d_r v_r      -v_theta/r   d_z v_r     |
//! | d_r v_theta   v_r/r       d_z v_theta |      f_i = -sum V0_p (tau_p G_ip + (tau_tt e_r - tau_rt e_theta) S_ip/r_p)
//! | d_r v_z       0           d_z v_z     |
//! ```
//!
//! A vector that changes its direction as a particle goes around the axis needs no further term: particles have it in fixed directions. The
//! half planes at the angles zero and pi are one plane, where `v_r` and `v_theta` change their signs with `r`: particles next to the axis
//! reach nodes as their images do as well, so that these components vanish there.

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::real;
use mmsmith_laws::fault::{Fault, Planted};
use nalgebra::{Matrix2, Matrix3, RealField, Vector2, Vector3};

use crate::every_scheme::EVERY_SCHEME;
use crate::grid::PAD_BELOW;
use crate::grid::geometry::Constants;
use crate::grid::node::{Components, LANES, Node};
use crate::kernel::any::{Contributions, Interpolated, InterpolationSums, add_values};
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::product::{ParticleWeights, ProductWeights, dispatch_by_width};
use crate::shape::one_axis::{EXTENDED, ProductShape};
use crate::shape::weights::Weights;

/// The axes of space that a half plane has.
const RADIUS: usize = 0;
const HEIGHT: usize = 2;
/// The direction around the axis.
const AROUND: usize = 1;
/// Places in a node of space.
const SECOND: usize = Node::<f64, 3>::SECOND;
const MASS: usize = Node::<f64, 3>::MASS;
/// The components that vanish on the axis.
const ACROSS_AXIS: Components = Components::along(RADIUS).with(Components::along(AROUND));

/// Radius and height of a place in space.
#[inline(always)]
pub(crate) fn place<T: RealField + Copy>(x: &Vector3<T>) -> Vector2<T> {
    Vector2::new((x.x * x.x + x.y * x.y).sqrt(), x.z)
}

/// The deformation gradient within the half plane of a particle, which is across its second column: that points around the axis.
#[inline(always)]
pub(crate) fn in_half_plane<T: RealField + Copy>(F: &Matrix3<T>) -> Matrix2<T> {
    let (cos, sin) = (F[(AROUND, AROUND)], -F[(RADIUS, AROUND)]);
    let length = (cos * cos + sin * sin).sqrt();
    let along_radius = |J: usize| (cos * F[(RADIUS, J)] + sin * F[(AROUND, J)]) / length;
    Matrix2::new(
        along_radius(RADIUS),
        along_radius(HEIGHT),
        F[(HEIGHT, RADIUS)],
        F[(HEIGHT, HEIGHT)],
    )
}

/// The weights of up to `BLOCK` particles.
pub(crate) struct RevolvingWeights<T> {
    product: ProductWeights<T, 2>,
    frames: [Frame<T>; BLOCK],
    planted: Planted,
}

/// The directions of a particle's half plane.
#[derive(Clone, Copy)]
struct Frame<T> {
    /// Cosine and sine of the angle from the first axis of space.
    cos: T,
    sin: T,
    /// A cell over the radius.
    per_radius: T,
    /// Whether the particle's image reaches nodes that particles read.
    is_next_to_axis: bool,
}

impl<T: Lanes> Frame<T> {
    fn zero() -> Self {
        Self { cos: T::one(), sin: T::zero(), per_radius: T::zero(), is_next_to_axis: false }
    }

    /// Components along these directions, from those along the axes of space.
    #[inline(always)]
    fn vector_in(&self, [x, y, z]: [T; 3]) -> [T; 3] {
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x, z]
    }

    #[inline(always)]
    fn vector_out(&self, [r, around, z]: [T; 3]) -> [T; 3] {
        [self.cos * r - self.sin * around, self.sin * r + self.cos * around, z]
    }

    #[inline(always)]
    fn matrix_in(&self, of: &Matrix3<T>) -> Matrix3<T> {
        let rows = [0, 1, 2].map(|i| [0, 1, 2].map(|j| of[(i, j)]));
        let across = [0, 1, 2].map(|j| self.vector_in(rows.map(|row| row[j])));
        let own = [0, 1, 2].map(|i| self.vector_in(across.map(|column| column[i])));
        Matrix3::from_fn(|i, j| own[i][j])
    }

    #[inline(always)]
    fn matrix_out(&self, of: &Matrix3<T>) -> Matrix3<T> {
        let across = [0, 1, 2].map(|j| self.vector_out([0, 1, 2].map(|i| of[(i, j)])));
        let own = [0, 1, 2].map(|i| self.vector_out(across.map(|column| column[i])));
        Matrix3::from_fn(|i, j| own[i][j])
    }

    /// Contributions of particle `k` of a block to its nodes: values, and slopes along the radius and the height.
    #[inline(always)]
    fn given(
        &self,
        contributions: &Contributions<T, 3, BLOCK>,
        k: usize,
        (is_affine, planted): (bool, Planted),
    ) -> ([T; LANES], [[T; LANES]; 2]) {
        let from = &contributions.value[k].values;
        let [momentum, force] =
            [0, SECOND].map(|first| self.vector_in(std::array::from_fn(|i| from[first + i])));
        let flux = self.matrix_in(&contributions.stress_flux[k]);
        let (mut value, mut slope) = ([T::zero(); LANES], [[T::zero(); LANES]; 2]);
        for i in 0..3 {
            (value[i], value[SECOND + i]) = (momentum[i], force[i]);
            for (slope, axis) in slope.iter_mut().zip([RADIUS, HEIGHT]) {
                slope[SECOND + i] = flux[(i, axis)];
            }
        }
        if !planted.is(Fault::HoopStressDropped) {
            value[SECOND + RADIUS] += flux[(AROUND, AROUND)] * self.per_radius;
            value[SECOND + AROUND] -= flux[(RADIUS, AROUND)] * self.per_radius;
        }
        value[MASS] = from[MASS];
        if is_affine {
            let affine = self.matrix_in(&contributions.affine[k]);
            for i in 0..3 {
                (slope[0][i], slope[1][i]) = (affine[(i, RADIUS)], affine[(i, HEIGHT)]);
            }
        }
        (value, slope)
    }

    /// The values of the grid at a particle.
    #[inline(always)]
    fn interpolated<const W: usize, L: Weights<T, 2, W>>(
        &self,
        weights: &L,
        sums: &InterpolationSums<T, 2>,
    ) -> Interpolated<T, 3> {
        let InterpolationSums { value, slope } = sums;
        let [velocity, second] = [0, SECOND].map(|first| std::array::from_fn(|i| value[first + i]));
        let mut gradient = Matrix3::zeros();
        for i in 0..3 {
            (gradient[(i, RADIUS)], gradient[(i, HEIGHT)]) = (slope[0][i], slope[1][i]);
        }
        gradient[(RADIUS, AROUND)] = -velocity[AROUND] * self.per_radius;
        gradient[(AROUND, AROUND)] = velocity[RADIUS] * self.per_radius;
        let mut affine = Matrix3::zeros();
        if L::AFFINE {
            let mut own = Matrix3::zeros();
            for rows in [[RADIUS, HEIGHT], [AROUND, AROUND]] {
                let moments = Matrix2::from_fn(|i, a| slope[a][SECOND + rows[i]]);
                let gradient = Matrix2::from_fn(|i, a| slope[a][rows[i]]);
                let of_rows = weights.affine(moments, &gradient);
                for (i, row) in rows.into_iter().enumerate() {
                    (own[(row, RADIUS)], own[(row, HEIGHT)]) = (of_rows[(i, 0)], of_rows[(i, 1)]);
                }
            }
            affine = self.matrix_out(&own);
        }
        let [velocity, second] = [velocity, second].map(|of| self.vector_out(of));
        Interpolated {
            velocity: velocity.into(),
            second: second.into(),
            velocity_gradient: self.matrix_out(&gradient),
            affine,
            scalar: T::zero(),
        }
    }
}

impl<T: Lanes> RevolvingWeights<T> {
    pub(crate) fn new(shape: &ProductShape<T, 2>, is_affine: bool) -> Self {
        Self {
            product: ProductWeights::new(shape, is_affine),
            frames: [Frame::zero(); BLOCK],
            planted: Planted::here(),
        }
    }
}

/// Sets the frames of a block of particles, and what of their kinematics lies in their half planes.
struct Frames<'a, T> {
    c: &'a Constants<T, 3>,
    plane: &'a Constants<T, 2>,
    shape: &'a ProductShape<T, 2>,
    kinematics: Kinematics<'a, T, 3>,
    frames: &'a mut [Frame<T>; BLOCK],
    in_plane: (&'a mut [Vector2<T>; BLOCK], &'a mut [Matrix2<T>; BLOCK]),
}

impl<T: Lanes> Loop for Frames<'_, T> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { c, plane, shape, kinematics, frames, in_plane: (x, F) } = self;
        // Where the grid begins beside the axis the body has a hole there, and its nodes no images.
        let has_axis = c.lower[RADIUS] == T::zero();
        let reach = real((PAD_BELOW + 1) as f64);
        let spacing = c.spacing();
        for k in 0..BLOCK {
            (x[k], F[k]) = (place(&kinematics.x[k]), in_half_plane(&kinematics.F[k]));
            let radius = x[k][0];
            let edge = plane.in_cells(&x[k])[0] - shape.half_size(0, F[k][(0, 0)]);
            let is_next_to_axis = has_axis && edge < reach;
            let inverse = radius.recip();
            frames[k] = match radius > T::zero() {
                true => Frame {
                    cos: kinematics.x[k][0] * inverse,
                    sin: kinematics.x[k][1] * inverse,
                    per_radius: spacing * inverse,
                    is_next_to_axis,
                },
                false => Frame { is_next_to_axis, ..Frame::zero() },
            };
        }
    }
}

/// The distances in memory between neighbouring nodes of the half plane.
fn in_plane(strides: &[usize; 3]) -> [usize; 2] {
    [strides[RADIUS], strides[HEIGHT]]
}

impl<T: Lanes> BlockWeights<T, 3> for RevolvingWeights<T> {
    fn compute(&mut self, c: &Constants<T, 3>, ids: &[u32], kinematics: Kinematics<'_, T, 3>) {
        let plane = c.half_plane();
        let (mut x, mut F) = ([Vector2::zeros(); BLOCK], [Matrix2::zeros(); BLOCK]);
        let (frames, in_plane) = (&mut self.frames, (&mut x, &mut F));
        dispatch(Frames {
            c,
            plane: &plane,
            shape: &self.product.shape,
            kinematics,
            frames,
            in_plane,
        });
        self.product.compute(&plane, ids, Kinematics { x: &x, F: &F });
    }

    fn p2g(
        &mut self,
        strides: &[usize; 3],
        window: &mut [Node<T, 3>],
        contributions: &Contributions<T, 3, BLOCK>,
        count: usize,
    ) {
        let (weights, strides) = (&*self, in_plane(strides));
        let of_block = P2gOfBlock { weights, strides, window, contributions, count };
        dispatch_by_width!(self.product.width, self.product.is_affine, P2g<_>, of_block);
    }

    fn g2p(
        &mut self,
        strides: &[usize; 3],
        nodes: &[Node<T, 3>],
        receiver: &mut [Interpolated<T, 3>],
    ) {
        let of_block = G2pOfBlock { weights: self, strides: in_plane(strides), nodes, receiver };
        dispatch_by_width!(self.product.width, self.product.is_affine, G2p<_>, of_block);
    }
}

struct P2gOfBlock<'a, T> {
    weights: &'a RevolvingWeights<T>,
    strides: [usize; 2],
    window: &'a mut [Node<T, 3>],
    contributions: &'a Contributions<T, 3, BLOCK>,
    count: usize,
}

struct P2g<'a, T, const W: usize, const AFFINE: bool>(P2gOfBlock<'a, T>);

impl<T: Lanes, const W: usize, const AFFINE: bool> Loop for P2g<'_, T, W, AFFINE> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(P2gOfBlock { weights, strides, window, contributions, count }) = self;
        let RevolvingWeights { product, planted, .. } = weights;
        for k in 0..count.min(BLOCK) {
            let frame = &weights.frames[k];
            let given = frame.given(contributions, k, (AFFINE, *planted));
            let nodes = (&mut *window, product.nodes_before);
            match product.extended(k) {
                Some(extended) => {
                    let weights = extended.weights::<AFFINE>((&strides, product.nodes_before));
                    add::<_, _, EXTENDED>(frame, &weights, &strides, nodes, &given);
                }
                None => {
                    let weights = ParticleWeights::<T, 2, W, AFFINE> { weights: product, k };
                    add::<_, _, W>(frame, &weights, &strides, nodes, &given);
                }
            }
        }
    }
}

/// Adds a particle to the nodes of a window, and next to the axis its image.
#[inline(always)]
fn add<T: Lanes, L: Weights<T, 2, W>, const W: usize>(
    frame: &Frame<T>,
    weights: &L,
    strides: &[usize; 2],
    (window, nodes_before): (&mut [Node<T, 3>], usize),
    (value, slope): &([T; LANES], [[T; LANES]; 2]),
) {
    let start = weights.first_node();
    if !frame.is_next_to_axis {
        add_values(weights, strides, (window, start), value, slope);
        return;
    }
    let mut own = [Node::zero(); EXTENDED * EXTENDED];
    let own = &mut own[..W * W];
    add_values(weights, &[1, W], (own, 0), value, slope);
    // The number of the first node along the radius; the axis has the number `PAD_BELOW`.
    let along = (start + nodes_before) % strides[1];
    for (index, node) in own.iter().enumerate() {
        let place = start + index % W * strides[0] + index / W * strides[1];
        window[place].add(node);
        let number = along + index % W;
        if number <= 2 * PAD_BELOW {
            let image = place + 2 * PAD_BELOW * strides[0] - 2 * number * strides[0];
            window[image].add(&node.flipped(ACROSS_AXIS));
        }
    }
}

struct G2pOfBlock<'a, T> {
    weights: &'a RevolvingWeights<T>,
    strides: [usize; 2],
    nodes: &'a [Node<T, 3>],
    receiver: &'a mut [Interpolated<T, 3>],
}

struct G2p<'a, T, const W: usize, const AFFINE: bool>(G2pOfBlock<'a, T>);

impl<T: Lanes, const W: usize, const AFFINE: bool> Loop for G2p<'_, T, W, AFFINE> {
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self(G2pOfBlock { weights, strides, nodes, receiver }) = self;
        let RevolvingWeights { product, frames, .. } = weights;
        for (k, (receiver, frame)) in receiver.iter_mut().zip(frames).enumerate() {
            *receiver = match product.extended(k) {
                Some(extended) => {
                    let weights = extended.weights::<AFFINE>((&strides, product.nodes_before));
                    frame.interpolated::<EXTENDED, _>(
                        &weights,
                        &InterpolationSums::of::<_, EXTENDED>(&weights, &strides, nodes),
                    )
                }
                None => {
                    let weights = ParticleWeights::<T, 2, W, AFFINE> { weights: product, k };
                    frame.interpolated::<W, _>(
                        &weights,
                        &InterpolationSums::of(&weights, &strides, nodes),
                    )
                }
            };
        }
    }
}
