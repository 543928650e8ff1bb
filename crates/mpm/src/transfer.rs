//! Sums over a particle's nodes: to the grid, and from it.

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::Fault;
use crate::simd::{Quad, Vectors};
use crate::step::Constants;
use crate::weights::WIDE;

/// Numbers kept for a node: enough for three dimensions, and a whole vector register whatever their type.
pub(crate) const LANES: usize = 8;

/// Quantities at a node, one after the other so that they go through vector instructions together: the velocity
/// (momentum while particles add to it), the acceleration (force while particles add to it), the mass, and zeros.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node<T, const D: usize> {
    pub(crate) values: [T; LANES],
}

impl<T: RealField + Copy, const D: usize> Node<T, D> {
    pub(crate) fn zero() -> Self {
        Self { values: [T::zero(); LANES] }
    }

    #[inline(always)]
    pub(crate) fn new(velocity: &SVector<T, D>, acceleration: &SVector<T, D>, mass: T) -> Self {
        const { assert!(2 * D < LANES) };
        let mut values = [T::zero(); LANES];
        for a in 0..D {
            values[a] = velocity[a];
            values[D + a] = acceleration[a];
        }
        values[2 * D] = mass;
        Self { values }
    }

    #[inline(always)]
    pub(crate) fn mass(&self) -> T {
        self.values[2 * D]
    }

    /// What a wall across `axis` does to velocity and acceleration.
    #[inline(always)]
    pub(crate) fn clear(&mut self, axis: usize) {
        self.values[axis] = T::zero();
        self.values[D + axis] = T::zero();
    }

    /// The node, with the signs of one component of velocity and acceleration changed.
    #[inline(always)]
    pub(crate) fn flipped(mut self, axis: Option<usize>) -> Self {
        if let Some(a) = axis {
            self.values[a] = -self.values[a];
            self.values[D + a] = -self.values[D + a];
        }
        self
    }

    #[inline(always)]
    pub(crate) fn set_acceleration(&mut self, acceleration: &SVector<T, D>) {
        for a in 0..D {
            self.values[D + a] = acceleration[a];
        }
    }

    pub(crate) fn add_acceleration(&mut self, other: &Self) {
        for a in 0..D {
            self.values[D + a] += other.values[D + a];
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        for q in 0..LANES {
            self.values[q] += other.values[q];
        }
    }
}

/// What the nodes around a particle say about its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gathered<T, const D: usize> {
    pub(crate) velocity: SVector<T, D>,
    pub(crate) acceleration: SVector<T, D>,
    /// Per cell.
    pub(crate) velocity_gradient: SMatrix<T, D, D>,
}

impl<T: RealField + Copy, const D: usize> Gathered<T, D> {
    /// From interpolated values of nodes and their gradients, in the order in which nodes have them.
    #[inline(always)]
    pub(crate) fn new<const Q: usize, const R: usize>(level: &[T; Q], slope: &[[T; R]; D]) -> Self {
        Self {
            velocity: SVector::from_fn(|i, _| level[i]),
            acceleration: SVector::from_fn(|i, _| level[D + i]),
            velocity_gradient: SMatrix::from_fn(|i, j| slope[j][i]),
        }
    }

    pub(crate) fn zero() -> Self {
        Self {
            velocity: SVector::zeros(),
            acceleration: SVector::zeros(),
            velocity_gradient: SMatrix::zeros(),
        }
    }
}

/// Whoever wants to know what the nodes around particles say.
pub(crate) trait Receive<T, const D: usize> {
    /// Of particle `k` of a block.
    fn receive(&mut self, k: usize, gathered: &Gathered<T, D>);

    /// The same in one or two dimensions: velocity and acceleration one after the other, and their gradients.
    #[inline(always)]
    fn receive_quads(&mut self, _: impl Vectors, k: usize, level: Quad<T>, slope: [Quad<T>; D])
    where
        T: RealField + Copy,
    {
        self.receive(k, &Gathered::new(&level.0, &slope.map(|slope| slope.0)));
    }
}

/// Writes it down.
impl<T: RealField + Copy, const D: usize> Receive<T, D> for &mut [Gathered<T, D>] {
    #[inline(always)]
    fn receive(&mut self, k: usize, gathered: &Gathered<T, D>) {
        if let Some(own) = self.get_mut(k) {
            *own = *gathered;
        }
    }
}

/// What particles give to the nodes around them: `level S + sum_a traction[a] G_a`, the second part to the force alone.
pub(crate) struct Deposits<T, const D: usize, const N: usize> {
    pub(crate) mass: [T; N],
    /// Reference volumes.
    pub(crate) volume: [T; N],
    /// Body forces, per mass.
    pub(crate) b: [SVector<T, D>; N],
    /// Momenta, body forces and masses.
    pub(crate) level: [Node<T, D>; N],
    /// Per cell: column `a` goes with the gradient along axis `a`.
    pub(crate) traction: [SMatrix<T, D, D>; N],
}

impl<T: RealField + Copy, const D: usize, const N: usize> Deposits<T, D, N> {
    pub(crate) fn zero() -> Self {
        Self {
            mass: [T::zero(); N],
            volume: [T::zero(); N],
            b: [SVector::zeros(); N],
            level: [Node::zero(); N],
            traction: [SMatrix::zeros(); N],
        }
    }

    /// Nothing yet, of particles that all have this mass and this volume.
    pub(crate) fn alike(mass: T, volume: T) -> Self {
        Self { mass: [mass; N], volume: [volume; N], ..Self::zero() }
    }

    /// Takes masses and volumes of the particles `ids`.
    pub(crate) fn take(&mut self, ids: &[u32], mass: &[T], volume: &[T]) {
        for (k, &p) in ids.iter().enumerate() {
            (self.mass[k], self.volume[k]) = (mass[p as usize], volume[p as usize]);
        }
    }

    /// States momenta and masses of the particles `ids`, and nothing else.
    pub(crate) fn take_momenta(&mut self, ids: &[u32], mass: &[T], v: &[SVector<T, D>]) {
        for (level, &p) in self.level.iter_mut().zip(ids) {
            let m = mass[p as usize];
            *level = Node::new(&(v[p as usize] * m), &SVector::zeros(), m);
        }
    }

    /// States momentum, body force and mass of a particle.
    #[inline(always)]
    pub(crate) fn set_level(&mut self, c: &Constants<T, D>, k: usize, v: &SVector<T, D>) {
        let m = self.mass[k];
        self.level[k] = Node::new(&(v * m), &self.force(c, k), m);
    }

    /// The same in two dimensions, for the numbers of position and velocity one after the other.
    #[inline(always)]
    pub(crate) fn set_level_in_plane(&mut self, vectors: impl Vectors, k: usize, xv: Quad<T>) {
        let (m, b) = (self.mass[k], self.b[k]);
        let b = Quad([b[0], b[D - 1], T::zero(), T::zero()]);
        let level = vectors.mul(vectors.high_and_low(xv, b), vectors.splat(m));
        let values = &mut self.level[k].values;
        values[..4].copy_from_slice(&level.0);
        values[4] = m;
    }

    /// States the body force of a particle, and nothing else.
    #[inline(always)]
    pub(crate) fn set_force(&mut self, c: &Constants<T, D>, k: usize) {
        self.level[k].set_acceleration(&self.force(c, k));
    }

    #[inline(always)]
    fn force(&self, c: &Constants<T, D>, k: usize) -> SVector<T, D> {
        let per_volume = c.planted.is(Fault::BodyForcePerVolume);
        self.b[k] * if per_volume { self.volume[k] } else { self.mass[k] }
    }

    /// What goes with the gradients along all axes, in the order of a node's values.
    #[inline(always)]
    fn slopes(&self, k: usize) -> [[T; LANES]; D] {
        let mut slopes = [[T::zero(); LANES]; D];
        for (a, slope) in slopes.iter_mut().enumerate() {
            for i in 0..D {
                slope[D + i] = self.traction[k][(i, a)];
            }
        }
        slopes
    }
}

/// The weights of one particle, wherever they are kept.
pub(crate) trait Weights<T, const D: usize, const W: usize> {
    /// Index of the first node.
    fn first_node(&self) -> usize;
    /// Weight of a node, by its place along an axis.
    fn S(&self, axis: usize, place: usize) -> T;
    /// Gradient of the weight.
    fn G(&self, axis: usize, place: usize) -> T;
}

/// Whether a node, by its place along an axis, is the middle one of three: it takes what the outer two leave, as all weights add
/// up to one and their gradients to zero.
#[inline(always)]
pub(crate) const fn is_middle<const W: usize>(place: usize) -> bool {
    W == 3 && place == 1
}

/// One row of nodes along axis 0: the weights of all other axes multiplied.
struct Row<T, const D: usize> {
    start: usize,
    /// Product of the weights along axes 1 and up.
    S: T,
    /// Its gradient; entry 0 is unused.
    G: [T; D],
}

/// Number of rows of nodes.
#[inline(always)]
fn rows<const D: usize, const W: usize>() -> usize {
    let rows = W.pow(D as u32 - 1);
    // The wide stencil is rare: unrolling its rows would cost minutes of compile time for nothing.
    if W == WIDE { std::hint::black_box(rows) } else { rows }
}

#[inline(always)]
fn row<T: RealField + Copy, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    first: usize,
    strides: &[usize; D],
    index: usize,
) -> Row<T, D> {
    let mut row = Row { start: first, S: T::one(), G: [T::zero(); D] };
    match D {
        1 => {}
        2 => {
            row.start += index * strides[1];
            row.S = weights.S(1, index);
            row.G[1] = weights.G(1, index);
        }
        _ => {
            let (j, k) = (index % W, index / W);
            row.start += j * strides[1] + k * strides[2];
            row.S = weights.S(1, j) * weights.S(2, k);
            row.G[1] = weights.G(1, j) * weights.S(2, k);
            row.G[2] = weights.S(1, j) * weights.G(2, k);
        }
    }
    row
}

/// What a particle gives to a row of nodes along axis 0: `level S + slope G` with the weights along that axis.
#[inline(always)]
fn given_to_row<T: RealField + Copy, const D: usize>(
    level: &[T; LANES],
    slope: &[[T; LANES]; D],
    row: &Row<T, D>,
) -> [[T; LANES]; 2] {
    let (mut to_level, mut to_slope) = (*level, slope[0]);
    for q in 0..LANES {
        to_level[q] *= row.S;
        to_slope[q] *= row.S;
        for a in 1..D {
            to_level[q] = slope[a][q].mul_add(row.G[a], to_level[q]);
        }
    }
    [to_level, to_slope]
}

/// Adds what a particle gives to a node.
#[inline(always)]
fn add<T: RealField + Copy>(sum: &mut [T; LANES], [level, slope]: &[[T; LANES]; 2], S: T, G: T) {
    for q in 0..LANES {
        sum[q] = level[q].mul_add(S, slope[q].mul_add(G, sum[q]));
    }
}

/// Adds what particle `k` gives to the piece of the grid that starts at node `first`.
#[inline(always)]
pub(crate) fn scatter<T: RealField + Copy, const D: usize, const W: usize, const N: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    (given, k): (&Deposits<T, D, N>, usize),
) {
    let start = weights.first_node() - first;
    let level = &given.level[k].values;
    let slope = given.slopes(k);
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let to_row = given_to_row(level, &slope, &row);
        let Some(nodes) = piece.get_mut(row.start..).and_then(|n| n.first_chunk_mut::<W>()) else {
            debug_assert!(false, "a stencil beyond its band");
            return;
        };
        for (i, node) in nodes.iter_mut().enumerate() {
            add(&mut node.values, &to_row, weights.S(0, i), weights.G(0, i));
        }
    }
}

/// The values of nodes interpolated, the useful ones and the others, and their gradients per cell.
struct Interpolated<T, const D: usize> {
    level: [T; LANES],
    slope: [[T; LANES]; D],
}

impl<T: RealField + Copy, const D: usize> Interpolated<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        Self { level: [T::zero(); LANES], slope: [[T::zero(); LANES]; D] }
    }

    /// Adds what a row of nodes contributes.
    ///
    /// Products that make up a level are rounded before they are added, not fused: those of a node and of its mirror image
    /// then cancel, and a particle on a wall stays there.
    #[inline(always)]
    fn add_row<const W: usize>(
        &mut self,
        weights: &impl Weights<T, D, W>,
        row: &Row<T, D>,
        nodes: &[Node<T, D>; W],
    ) {
        let mut row_level = [T::zero(); LANES];
        let mut row_slope = [T::zero(); LANES];
        for i in 0..W {
            let (S, G) = (weights.S(0, i), weights.G(0, i));
            for q in 0..LANES {
                let value = nodes[i].values[q];
                row_level[q] = if i == 0 { value * S } else { row_level[q] + value * S };
                row_slope[q] = if i == 0 { value * G } else { value.mul_add(G, row_slope[q]) };
            }
        }
        let Self { level, slope } = self;
        for q in 0..LANES {
            level[q] += row_level[q] * row.S;
            slope[0][q] = row_slope[q].mul_add(row.S, slope[0][q]);
            for a in 1..D {
                slope[a][q] = row_level[q].mul_add(row.G[a], slope[a][q]);
            }
        }
    }
}

/// Interpolates velocity and acceleration, and the velocity's gradient.
#[inline(always)]
pub(crate) fn gather<T: RealField + Copy, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Gathered<T, D> {
    let mut sums = Interpolated::zero();
    let start = weights.first_node();
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let Some(nodes) = nodes.get(row.start..).and_then(|n| n.first_chunk::<W>()) else {
            debug_assert!(false, "a stencil beyond the grid");
            break;
        };
        sums.add_row(weights, &row, nodes);
    }
    Gathered::new(&sums.level, &sums.slope)
}
