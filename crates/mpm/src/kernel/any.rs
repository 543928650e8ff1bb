//! P2G and G2P of one particle, in any dimension and for any support: row by row along axis 0.

use nalgebra::{RealField, SMatrix, SVector};

use crate::fault::Fault;
use crate::geometry::Constants;
use crate::node::{LANES, Node};
use crate::shape_function::EXTENDED;
use crate::simd::{Lane4, Vectors};
use crate::weights::Weights;

/// Values of the grid at a particle, the result of G2P.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interpolated<T, const D: usize> {
    pub(crate) velocity: SVector<T, D>,
    pub(crate) acceleration: SVector<T, D>,
    /// `dv_i/dx_j` per cell.
    pub(crate) velocity_gradient: SMatrix<T, D, D>,
}

impl<T: RealField + Copy, const D: usize> Interpolated<T, D> {
    /// From interpolated values and their gradients: `value[q]`, `gradient[axis][q]`, with `q` as in [`Node`].
    #[inline(always)]
    pub(crate) fn new<const Q: usize, const R: usize>(
        value: &[T; Q],
        gradient: &[[T; R]; D],
    ) -> Self {
        Self {
            velocity: SVector::from_fn(|i, _| value[i]),
            acceleration: SVector::from_fn(|i, _| value[D + i]),
            velocity_gradient: SMatrix::from_fn(|i, j| gradient[j][i]),
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

/// Receives the result of G2P, particle by particle.
pub(crate) trait Receive<T, const D: usize> {
    /// The values at particle `k` of a block.
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>);

    /// The same in one or two dimensions, in four lanes: `[velocity, acceleration]`, and their gradient along each axis.
    #[inline(always)]
    fn receive_lanes(&mut self, _: impl Vectors, k: usize, value: Lane4<T>, gradient: [Lane4<T>; D])
    where
        T: RealField + Copy,
    {
        self.receive(k, &Interpolated::new(&value.0, &gradient.map(|gradient| gradient.0)));
    }
}

/// Stores the values.
impl<T: RealField + Copy, const D: usize> Receive<T, D> for &mut [Interpolated<T, D>] {
    #[inline(always)]
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>) {
        if let Some(own) = self.get_mut(k) {
            *own = *interpolated;
        }
    }
}

/// Contributions of particles to their nodes: `value S + sum_a stress_flux[a] G_a`; the second term is a force.
///
/// Entry `k` of each array belongs to particle `k` of a block.
pub(crate) struct Contributions<T, const D: usize, const N: usize> {
    pub(crate) mass: [T; N],
    /// Reference volumes.
    pub(crate) volume: [T; N],
    /// Body forces, per mass.
    pub(crate) b: [SVector<T, D>; N],
    /// Momentum, body force and mass, in the order of a node's values.
    pub(crate) value: [Node<T, D>; N],
    /// `-V0 tau / h`: column `a` multiplies the gradient along axis `a`, per cell.
    pub(crate) stress_flux: [SMatrix<T, D, D>; N],
}

impl<T: RealField + Copy, const D: usize, const N: usize> Contributions<T, D, N> {
    pub(crate) fn zero() -> Self {
        Self {
            mass: [T::zero(); N],
            volume: [T::zero(); N],
            b: [SVector::zeros(); N],
            value: [Node::zero(); N],
            stress_flux: [SMatrix::zeros(); N],
        }
    }

    /// For particles of uniform mass and volume.
    pub(crate) fn uniform(mass: T, volume: T) -> Self {
        Self { mass: [mass; N], volume: [volume; N], ..Self::zero() }
    }

    /// Copies masses and volumes of the particles `ids`.
    pub(crate) fn take(&mut self, ids: &[u32], mass: &[T], volume: &[T]) {
        for (k, &p) in ids.iter().enumerate() {
            (self.mass[k], self.volume[k]) = (mass[p as usize], volume[p as usize]);
        }
    }

    /// Sets momenta and masses of the particles `ids`, with no force.
    pub(crate) fn take_momenta(&mut self, ids: &[u32], mass: &[T], v: &[SVector<T, D>]) {
        for (value, &p) in self.value.iter_mut().zip(ids) {
            let m = mass[p as usize];
            *value = Node::new(&(v[p as usize] * m), &SVector::zeros(), m);
        }
    }

    /// Sets momentum, body force and mass of a particle.
    #[inline(always)]
    pub(crate) fn set_value(&mut self, c: &Constants<T, D>, k: usize, v: &SVector<T, D>) {
        let m = self.mass[k];
        self.value[k] = Node::new(&(v * m), &self.force(c, k), m);
    }

    /// The same in two dimensions, from position and velocity in four lanes `[x, y, v_x, v_y]`.
    #[inline(always)]
    pub(crate) fn set_value_in_plane(&mut self, vectors: impl Vectors, k: usize, xv: Lane4<T>) {
        let (m, b) = (self.mass[k], self.b[k]);
        let b = Lane4([b[0], b[D - 1], T::zero(), T::zero()]);
        let value = vectors.mul(vectors.high_and_low(xv, b), vectors.splat(m));
        let values = &mut self.value[k].values;
        values[..4].copy_from_slice(&value.0);
        values[4] = m;
    }

    /// Sets the body force of a particle alone.
    #[inline(always)]
    pub(crate) fn set_force(&mut self, c: &Constants<T, D>, k: usize) {
        self.value[k].set_acceleration(&self.force(c, k));
    }

    #[inline(always)]
    fn force(&self, c: &Constants<T, D>, k: usize) -> SVector<T, D> {
        let per_volume = c.planted.is(Fault::BodyForcePerVolume);
        self.b[k] * if per_volume { self.volume[k] } else { self.mass[k] }
    }

    /// The factors of the gradients, `gradient_factors[axis][q]`, with `q` in the order of a node's values.
    #[inline(always)]
    fn gradient_factors(&self, k: usize) -> [[T; LANES]; D] {
        let mut gradient_factors = [[T::zero(); LANES]; D];
        for (a, gradient) in gradient_factors.iter_mut().enumerate() {
            for i in 0..D {
                gradient[D + i] = self.stress_flux[k][(i, a)];
            }
        }
        gradient_factors
    }
}

/// A row of nodes along axis 0, with the product of the weights along the other axes.
struct Row<T, const D: usize> {
    start: usize,
    /// Product of the weights along axes 1 and up.
    S: T,
    /// Its gradient; entry 0 is unused.
    G: [T; D],
}

/// Number of rows in a particle's support.
#[inline(always)]
fn rows<const D: usize, const W: usize>() -> usize {
    let rows = W.pow(D as u32 - 1);
    // The extended support is rare: `black_box` prevents unrolling, which would cost minutes of compile time.
    if W == EXTENDED { std::hint::black_box(rows) } else { rows }
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

/// Contribution of a particle to a row of nodes, `value S + gradient G` with the weights along axis 0.
#[inline(always)]
fn contributions_to_row<T: RealField + Copy, const D: usize>(
    value: &[T; LANES],
    gradient: &[[T; LANES]; D],
    row: &Row<T, D>,
) -> [[T; LANES]; 2] {
    let (mut to_value, mut to_gradient) = (*value, gradient[0]);
    for q in 0..LANES {
        to_value[q] *= row.S;
        to_gradient[q] *= row.S;
        for a in 1..D {
            to_value[q] = gradient[a][q].mul_add(row.G[a], to_value[q]);
        }
    }
    [to_value, to_gradient]
}

/// Adds the contribution of a particle to a node.
#[inline(always)]
fn add<T: RealField + Copy>(sum: &mut [T; LANES], [value, gradient]: &[[T; LANES]; 2], S: T, G: T) {
    for q in 0..LANES {
        sum[q] = value[q].mul_add(S, gradient[q].mul_add(G, sum[q]));
    }
}

/// P2G of particle `k`: adds its contribution to the band of nodes that starts at node `first`.
#[inline(always)]
pub(crate) fn p2g<T: RealField + Copy, const D: usize, const W: usize, const N: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    (given, k): (&Contributions<T, D, N>, usize),
) {
    let start = weights.first_node() - first;
    let value = &given.value[k].values;
    let gradient = given.gradient_factors(k);
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let to_row = contributions_to_row(value, &gradient, &row);
        let Some(nodes) = band.get_mut(row.start..).and_then(|n| n.first_chunk_mut::<W>()) else {
            debug_assert!(false, "a stencil beyond its band");
            return;
        };
        for (i, node) in nodes.iter_mut().enumerate() {
            add(&mut node.values, &to_row, weights.S(0, i), weights.G(0, i));
        }
    }
}

/// Sums of G2P: all values of a node interpolated, `value[q]`, and their gradients per cell, `gradient[axis][q]`.
struct InterpolationSums<T, const D: usize> {
    value: [T; LANES],
    gradient: [[T; LANES]; D],
}

impl<T: RealField + Copy, const D: usize> InterpolationSums<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        Self { value: [T::zero(); LANES], gradient: [[T::zero(); LANES]; D] }
    }

    /// Adds a row of nodes.
    ///
    /// Products that make up a value are rounded before they are added, not fused: those of a node and of its mirror image
    /// then cancel, and a particle on a wall stays there.
    #[inline(always)]
    fn add_row<const W: usize>(
        &mut self,
        weights: &impl Weights<T, D, W>,
        row: &Row<T, D>,
        nodes: &[Node<T, D>; W],
    ) {
        let mut row_value = [T::zero(); LANES];
        let mut row_gradient = [T::zero(); LANES];
        for i in 0..W {
            let (S, G) = (weights.S(0, i), weights.G(0, i));
            for q in 0..LANES {
                let nodal = nodes[i].values[q];
                row_value[q] = if i == 0 { nodal * S } else { row_value[q] + nodal * S };
                row_gradient[q] =
                    if i == 0 { nodal * G } else { nodal.mul_add(G, row_gradient[q]) };
            }
        }
        let Self { value, gradient } = self;
        for q in 0..LANES {
            value[q] += row_value[q] * row.S;
            gradient[0][q] = row_gradient[q].mul_add(row.S, gradient[0][q]);
            for a in 1..D {
                gradient[a][q] = row_value[q].mul_add(row.G[a], gradient[a][q]);
            }
        }
    }
}

/// G2P of one particle: velocity, acceleration and velocity gradient.
#[inline(always)]
pub(crate) fn g2p<T: RealField + Copy, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Interpolated<T, D> {
    let mut sums = InterpolationSums::zero();
    let start = weights.first_node();
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let Some(nodes) = nodes.get(row.start..).and_then(|n| n.first_chunk::<W>()) else {
            debug_assert!(false, "a stencil beyond the grid");
            break;
        };
        sums.add_row(weights, &row, nodes);
    }
    Interpolated::new(&sums.value, &sums.gradient)
}
