//! P2G and G2P of one particle, in any dimension and for any support: row by row along axis 0.

use mmsmith_lanes::simd::{Lane4, Lane8, Lanes, Vectors};
use mmsmith_laws::fault::Fault;
use nalgebra::{SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::grid::node::{LANES, Node};
use crate::kernel::{nodes_from, nodes_from_mut};
use crate::shape::weights::Weights;

/// Values of the grid at a particle, the result of G2P.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interpolated<T, const D: usize> {
    pub(crate) velocity: SVector<T, D>,
    /// The second vector of the nodes: the acceleration, or the velocity that particles take.
    pub(crate) second: SVector<T, D>,
    /// `dv_i/dx_j` per cell.
    pub(crate) velocity_gradient: SMatrix<T, D, D>,
    /// The affine velocity per cell of the second vector at nodes, where there are [weights](Weights) for it.
    pub(crate) affine: SMatrix<T, D, D>,
    /// The scalar, but in the plane, whose kernels leave it out.
    pub(crate) scalar: T,
}

impl<T: Lanes, const D: usize> Interpolated<T, D> {
    /// From interpolated values and their slopes along each axis, `value[q]` and `slope[axis][q]`, with `q` as in [`Node`].
    #[inline(always)]
    pub(crate) fn new<const Q: usize, const R: usize, const W: usize, L: Weights<T, D, W>>(
        weights: &L,
        value: &[T; Q],
        slope: &[[T; R]; D],
    ) -> Self {
        let mut own = Self::zero();
        own.scalar = value.get(Node::<T, D>::SCALAR).copied().unwrap_or(T::zero());
        let mut moments = SMatrix::zeros();
        for i in 0..D {
            (own.velocity[i], own.second[i]) = (value[i], value[Node::<T, D>::SECOND + i]);
            for j in 0..D {
                own.velocity_gradient[(i, j)] = slope[j][i];
                moments[(i, j)] = slope[j][(Node::<T, D>::SECOND + i).min(R - 1)];
            }
        }
        if L::AFFINE {
            own.affine = weights.affine(moments, &own.velocity_gradient);
        }
        own
    }

    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self {
            velocity: SVector::zeros(),
            second: SVector::zeros(),
            velocity_gradient: SMatrix::zeros(),
            affine: SMatrix::zeros(),
            scalar: T::zero(),
        }
    }
}

/// Receives the result of G2P, particle by particle.
pub(crate) trait Receive<T, const D: usize> {
    /// The values at particle `k` of a block.
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>);

    /// As [`receive`](Self::receive) in one or two dimensions, in four lanes: `[velocity, acceleration]`, and their slopes along each axis.
    #[inline(always)]
    fn receive_lanes<const W: usize>(
        &mut self,
        _: impl Vectors,
        k: usize,
        weights: &impl Weights<T, D, W>,
        value: Lane4<T>,
        slope: [Lane4<T>; D],
    ) where
        T: Lanes,
    {
        let mut slopes = [[T::zero(); 4]; D];
        for (own, slope) in slopes.iter_mut().zip(slope) {
            *own = slope.0;
        }
        self.receive(k, &Interpolated::new(weights, &value.0, &slopes));
    }
}

/// Stores the values.
impl<T: Lanes, const D: usize> Receive<T, D> for &mut [Interpolated<T, D>] {
    #[inline(always)]
    fn receive(&mut self, k: usize, interpolated: &Interpolated<T, D>) {
        if let Some(own) = self.get_mut(k) {
            *own = *interpolated;
        }
    }
}

/// Contributions of particles to their nodes: `value S + sum_a stress_flux[a] G_a + sum_a affine[a] Z_a`; the second term is a
/// force, the third a momentum.
///
/// Entry `k` of each array belongs to particle `k` of a block.
pub(crate) struct Contributions<T, const D: usize, const N: usize> {
    pub(crate) mass: [T; N],
    /// Reference volumes.
    pub(crate) volume: [T; N],
    /// Body forces, per mass.
    pub(crate) b: [SVector<T, D>; N],
    /// Momentum, body force and mass, in the order of a node's values. Where the change of volume follows the grid, the scalar is `V0` times the mean
    /// Kirchhoff stress, which `stress_flux` is without.
    pub(crate) value: [Node<T, D>; N],
    /// `-V0 tau / h`: column `a` multiplies the gradient along axis `a`, per cell.
    pub(crate) stress_flux: [SMatrix<T, D, D>; N],
    /// APIC: mass times the affine velocity per cell; column `a` multiplies the arm along axis `a`, in cells.
    pub(crate) affine: [SMatrix<T, D, D>; N],
}

impl<T: Lanes, const D: usize, const N: usize> Contributions<T, D, N> {
    pub(crate) fn zero() -> Self {
        Self {
            mass: [T::zero(); N],
            volume: [T::zero(); N],
            b: [SVector::zeros(); N],
            value: [Node::zero(); N],
            stress_flux: [SMatrix::zeros(); N],
            affine: [SMatrix::zeros(); N],
        }
    }

    /// Sets masses and volumes to those that all particles have.
    pub(crate) fn set_uniform(&mut self, mass: T, volume: T) {
        (self.mass, self.volume) = ([mass; N], [volume; N]);
    }

    /// Copies masses and volumes of the particles `ids`.
    pub(crate) fn take(&mut self, ids: &[u32], mass: &[T], volume: &[T]) {
        for (k, &p) in ids.iter().enumerate() {
            (self.mass[k], self.volume[k]) = (mass[p as usize], volume[p as usize]);
        }
    }

    /// No particle has a stress.
    pub(crate) fn without_stress(&mut self) {
        self.stress_flux = [SMatrix::zeros(); N];
    }

    /// Sets momenta and masses of the particles `ids`, with no force.
    pub(crate) fn take_momenta(&mut self, ids: &[u32], mass: &[T], v: &[SVector<T, D>]) {
        self.without_stress();
        for (value, &p) in self.value.iter_mut().zip(ids) {
            let m = mass[p as usize];
            *value = Node::new(&(v[p as usize] * m), &SVector::zeros(), m);
        }
    }

    /// Sets affine momenta of the particles `ids`, for affine velocities per cell; none where there are none.
    pub(crate) fn take_affine(&mut self, ids: &[u32], mass: &[T], affine: &[SMatrix<T, D, D>]) {
        for (own, &p) in self.affine.iter_mut().zip(ids) {
            let p = p as usize;
            *own = affine.get(p).map_or_else(SMatrix::zeros, |affine| affine * mass[p]);
        }
    }

    /// Sets momenta, affine ones too where there are affine velocities, body forces and masses of the first particles.
    pub(crate) fn set_values(
        &mut self,
        c: &Constants<T, D>,
        v: &[SVector<T, D>],
        affine: &[SMatrix<T, D, D>],
    ) {
        for (k, v) in v.iter().enumerate() {
            self.set_value(c, k, v);
        }
        for (k, affine) in affine.iter().enumerate() {
            self.affine[k] = affine * self.mass[k];
        }
    }

    /// Sets momentum, body force and mass of a particle.
    #[inline(always)]
    pub(crate) fn set_value(&mut self, c: &Constants<T, D>, k: usize, v: &SVector<T, D>) {
        let m = self.mass[k];
        self.value[k] = Node::new(&(v * m), &self.force(c, k), m);
    }

    /// As [`set_value`](Self::set_value) in two dimensions, from position and velocity in four lanes `[x, y, v_x, v_y]`.
    #[inline(always)]
    pub(crate) fn set_value_in_plane(&mut self, vectors: impl Vectors, k: usize, xv: Lane4<T>) {
        let (m, b) = (self.mass[k], self.b[k]);
        let b = Lane4([b[0], b[D - 1], T::zero(), T::zero()]);
        let value = vectors.mul(vectors.high_and_low(xv, b), vectors.splat(m));
        let values = &mut self.value[k].values;
        values[..4].copy_from_slice(&value.0);
        values[4] = m;
    }

    /// Sets the body force of a particle, with neither momentum nor mass.
    #[inline(always)]
    pub(crate) fn set_force(&mut self, c: &Constants<T, D>, k: usize) {
        self.value[k] = Node::new(&SVector::zeros(), &self.force(c, k), T::zero());
    }

    #[inline(always)]
    fn force(&self, c: &Constants<T, D>, k: usize) -> SVector<T, D> {
        let per_volume = c.planted.is(Fault::BodyForcePerVolume);
        self.b[k] * if per_volume { self.volume[k] } else { self.mass[k] }
    }

    /// The factors of the slopes along an axis, in the order of a node's values.
    #[inline(always)]
    pub(crate) fn slope_lanes(&self, k: usize, axis: usize, is_affine: bool) -> Lane8<T> {
        let mut lanes = [T::zero(); LANES];
        for i in 0..D {
            lanes[Node::<T, D>::SECOND + i] = self.stress_flux[k][(i, axis)];
            if is_affine {
                lanes[i] = self.affine[k][(i, axis)];
            }
        }
        Lane8(lanes)
    }

    /// The affine momenta along an axis, in the order of a node's values.
    #[inline(always)]
    pub(crate) fn affine_lanes(&self, k: usize, axis: usize) -> Lane8<T> {
        let mut lanes = Lane8::zero();
        for i in 0..D {
            lanes.0[i] = self.affine[k][(i, axis)];
        }
        lanes
    }

    /// Both along all axes, `slope_factors[axis][q]`.
    #[inline(always)]
    fn slope_factors(&self, k: usize, is_affine: bool) -> [[T; LANES]; D] {
        std::array::from_fn(|axis| self.slope_lanes(k, axis, is_affine).0)
    }
}

/// The weights of a node along an axis, or of a row of nodes.
struct Factors<T> {
    S: T,
    G: T,
    Z: T,
}

impl<T: Lanes> Factors<T> {
    #[inline(always)]
    fn of<const D: usize, const W: usize, L: Weights<T, D, W>>(
        weights: &L,
        axis: usize,
        place: usize,
    ) -> Self {
        let Z = if L::AFFINE { weights.Z(axis, place) } else { T::zero() };
        Self { S: weights.S(axis, place), G: weights.G(axis, place), Z }
    }

    /// The slope that goes with number `q` of a node of vectors with `C` components in P2G: forces have gradients, affine momenta arms.
    #[inline(always)]
    fn p2g_slope<const C: usize>(&self, is_affine: bool, q: usize) -> T {
        if is_affine && q < Node::<T, C>::SECOND { self.Z } else { self.G }
    }

    /// The slope that goes with number `q` of a node in G2P: the first vector has a gradient, the second a moment.
    #[inline(always)]
    fn g2p_slope<const C: usize>(&self, is_affine: bool, q: usize) -> T {
        if is_affine && q >= Node::<T, C>::SECOND { self.Z } else { self.G }
    }
}

/// A row of nodes along axis 0.
struct RowWeights<T, const D: usize> {
    start: usize,
    /// Product of the weights along axes 1 and up.
    S: T,
    /// Products with the slope along an axis in place of its weight; entry 0 is unused.
    slopes: [Factors<T>; D],
}

/// Number of rows in a particle's support.
#[inline(always)]
fn rows<const D: usize, const W: usize>() -> usize {
    let rows = W.pow(D as u32 - 1);
    // Wide supports are rare here: `black_box` prevents unrolling, which would cost minutes of compile time.
    if W > 3 { std::hint::black_box(rows) } else { rows }
}

#[inline(always)]
fn row<T: Lanes, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    first: usize,
    strides: &[usize; D],
    index: usize,
) -> RowWeights<T, D> {
    let none = || Factors { S: T::one(), G: T::zero(), Z: T::zero() };
    let mut row = RowWeights { start: first, S: T::one(), slopes: std::array::from_fn(|_| none()) };
    match D {
        1 => {}
        2 => {
            row.start += index * strides[1];
            row.slopes[1] = Factors::of(weights, 1, index);
            row.S = row.slopes[1].S;
        }
        _ => {
            let (j, k) = (index % W, index / W);
            row.start += j * strides[1] + k * strides[2];
            let (along, up) = (Factors::of(weights, 1, j), Factors::of(weights, 2, k));
            row.S = along.S * up.S;
            row.slopes[1] = Factors { S: row.S, G: along.G * up.S, Z: along.Z * up.S };
            row.slopes[2] = Factors { S: row.S, G: along.S * up.G, Z: along.S * up.Z };
        }
    }
    row
}

/// Contribution of a particle to a row of nodes, `value S + slope G` with the weights along axis 0.
#[inline(always)]
fn contributions_to_row<T: Lanes, const A: usize, const C: usize>(
    value: &[T; LANES],
    slope: &[[T; LANES]; A],
    row: &RowWeights<T, A>,
    is_affine: bool,
) -> [[T; LANES]; 2] {
    let (mut to_value, mut to_slope) = (*value, slope[0]);
    for q in 0..LANES {
        to_value[q] *= row.S;
        to_slope[q] *= row.S;
        for a in 1..A {
            let factor = row.slopes[a].p2g_slope::<C>(is_affine, q);
            to_value[q] = slope[a][q].mul_add(factor, to_value[q]);
        }
    }
    [to_value, to_slope]
}

/// P2G of particle `k`: adds its contribution to the nodes of a window.
#[inline(always)]
pub(crate) fn p2g<T, L, const D: usize, const W: usize, const N: usize>(
    weights: &L,
    strides: &[usize; D],
    window: &mut [Node<T, D>],
    (given, k): (&Contributions<T, D, N>, usize),
) where
    T: Lanes,
    L: Weights<T, D, W>,
{
    let slope = given.slope_factors(k, L::AFFINE);
    let nodes = (window, weights.first_node());
    add_values(weights, strides, nodes, &given.value[k].values, &slope);
}

/// P2G of values and slopes, `value[q]` and `slope[axis][q]`, with weights of `A` axes, to nodes of vectors with `C` components, from place `start` on.
#[inline(always)]
pub(crate) fn add_values<T, L, const A: usize, const C: usize, const W: usize>(
    weights: &L,
    strides: &[usize; A],
    (nodes, start): (&mut [Node<T, C>], usize),
    value: &[T; LANES],
    slope: &[[T; LANES]; A],
) where
    T: Lanes,
    L: Weights<T, A, W>,
{
    for index in 0..rows::<A, W>() {
        let row = row(weights, start, strides, index);
        let [to_value, to_slope] = contributions_to_row::<T, A, C>(value, slope, &row, L::AFFINE);
        let nodes = nodes_from_mut::<_, W>(nodes, row.start, "a stencil beyond its window");
        for (i, Node { values }) in nodes.iter_mut().enumerate() {
            let factors = Factors::of(weights, 0, i);
            for q in 0..LANES {
                let with_slope =
                    to_slope[q].mul_add(factors.p2g_slope::<C>(L::AFFINE, q), values[q]);
                values[q] = to_value[q].mul_add(factors.S, with_slope);
            }
        }
    }
}

/// G2P of the scalars of nodes.
#[inline(always)]
pub(crate) fn g2p_scalar<T, L, const D: usize, const W: usize>(
    weights: &L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> T
where
    T: Lanes,
    L: Weights<T, D, W>,
{
    let mut sum = T::zero();
    let start = weights.first_node();
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let nodes = nodes_from::<_, W>(nodes, row.start, "a stencil beyond the grid");
        let mut of_row = T::zero();
        for (i, node) in nodes.iter().enumerate() {
            of_row += node.scalar() * weights.S(0, i);
        }
        sum += of_row * row.S;
    }
    sum
}

/// Sums of G2P: all values of a node interpolated, `value[q]`, and their slopes, `slope[axis][q]`.
pub(crate) struct InterpolationSums<T, const A: usize> {
    pub(crate) value: [T; LANES],
    pub(crate) slope: [[T; LANES]; A],
}

impl<T: Lanes, const A: usize> InterpolationSums<T, A> {
    /// Sums over the nodes of a particle, whose vectors have `C` components.
    #[inline(always)]
    pub(crate) fn of<const C: usize, const W: usize>(
        weights: &impl Weights<T, A, W>,
        strides: &[usize; A],
        nodes: &[Node<T, C>],
    ) -> Self {
        let mut sums = Self { value: [T::zero(); LANES], slope: [[T::zero(); LANES]; A] };
        let start = weights.first_node();
        for index in 0..rows::<A, W>() {
            let row = row(weights, start, strides, index);
            let nodes = nodes_from::<_, W>(nodes, row.start, "a stencil beyond the grid");
            sums.add_row(weights, &row, nodes);
        }
        sums
    }

    /// Adds a row of nodes.
    ///
    /// Products that make up a value are rounded before they are added, not fused: those of a node and of its mirror image
    /// then cancel, and a particle on a wall stays there.
    #[inline(always)]
    fn add_row<const C: usize, const W: usize, L: Weights<T, A, W>>(
        &mut self,
        weights: &L,
        row: &RowWeights<T, A>,
        nodes: &[Node<T, C>; W],
    ) {
        let mut row_value = [T::zero(); LANES];
        let mut row_slope = [T::zero(); LANES];
        for i in 0..W {
            let factors = Factors::of(weights, 0, i);
            for q in 0..LANES {
                let nodal = nodes[i].values[q];
                let slope = factors.g2p_slope::<C>(L::AFFINE, q);
                row_value[q] =
                    if i == 0 { nodal * factors.S } else { row_value[q] + nodal * factors.S };
                row_slope[q] =
                    if i == 0 { nodal * slope } else { nodal.mul_add(slope, row_slope[q]) };
            }
        }
        let Self { value, slope } = self;
        for q in 0..LANES {
            value[q] += row_value[q] * row.S;
            slope[0][q] = row_slope[q].mul_add(row.S, slope[0][q]);
            for a in 1..A {
                let factor = row.slopes[a].g2p_slope::<C>(L::AFFINE, q);
                slope[a][q] = row_value[q].mul_add(factor, slope[a][q]);
            }
        }
    }
}

/// G2P of one particle.
#[inline(always)]
pub(crate) fn g2p<T, L, const D: usize, const W: usize>(
    weights: &L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
) -> Interpolated<T, D>
where
    T: Lanes,
    L: Weights<T, D, W>,
{
    let sums = InterpolationSums::of(weights, strides, nodes);
    Interpolated::new(weights, &sums.value, &sums.slope)
}
