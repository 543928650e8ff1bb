//! Sums over a particle's nodes: to the grid, and from it.

use nalgebra::{RealField, SMatrix, SVector};

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

    pub(crate) fn clear_acceleration(&mut self) {
        self.set_acceleration(&SVector::zeros());
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

/// What the nodes around a particle say about its place: their values weighted, and the gradients of these per cell.
///
/// All values of the nodes are interpolated, the useful ones and the others, so that whole vectors are moved and stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gathered<T, const D: usize> {
    level: Node<T, D>,
    slope: [Node<T, D>; D],
}

impl<T: RealField + Copy, const D: usize> Gathered<T, D> {
    pub(crate) fn zero() -> Self {
        Self { level: Node::zero(), slope: [Node::zero(); D] }
    }

    #[inline(always)]
    pub(crate) fn velocity(&self) -> SVector<T, D> {
        SVector::from_fn(|i, _| self.level.values[i])
    }

    #[inline(always)]
    pub(crate) fn acceleration(&self) -> SVector<T, D> {
        SVector::from_fn(|i, _| self.level.values[D + i])
    }

    /// Gradient of the velocity, per cell.
    #[inline(always)]
    pub(crate) fn velocity_gradient(&self) -> SMatrix<T, D, D> {
        SMatrix::from_fn(|i, j| self.slope[j].values[i])
    }
}

/// What a particle gives to the nodes around it: `level S + sum_a slope[a] G_a`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deposit<T, const D: usize> {
    pub(crate) level: Node<T, D>,
    pub(crate) slope: [Node<T, D>; D],
}

impl<T: RealField + Copy, const D: usize> Deposit<T, D> {
    pub(crate) fn zero() -> Self {
        Self { level: Node::zero(), slope: [Node::zero(); D] }
    }
}

/// The weights of one particle, wherever they are kept.
pub(crate) trait Weights<T, const D: usize, const W: usize> {
    /// Index of the first node along an axis.
    fn base(&self, axis: usize) -> usize;
    /// Weight of a node, by its place along an axis.
    fn S(&self, axis: usize, place: usize) -> T;
    /// Gradient of the weight.
    fn G(&self, axis: usize, place: usize) -> T;
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

/// Index of a particle's first node.
#[inline(always)]
fn first_node<T, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
) -> usize {
    let mut first = 0;
    for a in 0..D {
        first += weights.base(a) * strides[a];
    }
    first
}

/// What a particle gives to a row of nodes along axis 0: `level S + slope G` with the weights along that axis.
#[inline(always)]
fn given_to_row<T: RealField + Copy, const D: usize>(
    given: &Deposit<T, D>,
    row: &Row<T, D>,
) -> [[T; LANES]; 2] {
    let mut level = given.level.values;
    let mut slope = given.slope[0].values;
    for q in 0..LANES {
        level[q] *= row.S;
        slope[q] *= row.S;
        for a in 1..D {
            level[q] = given.slope[a].values[q].mul_add(row.G[a], level[q]);
        }
    }
    [level, slope]
}

/// Adds what a particle gives to a node.
#[inline(always)]
fn add<T: RealField + Copy>(sum: &mut [T; LANES], [level, slope]: &[[T; LANES]; 2], S: T, G: T) {
    for q in 0..LANES {
        sum[q] = level[q].mul_add(S, slope[q].mul_add(G, sum[q]));
    }
}

/// Adds what a particle gives to the piece of the grid that starts at node `first`.
#[inline(always)]
pub(crate) fn scatter<T: RealField + Copy, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    given: &Deposit<T, D>,
) {
    let start = first_node(weights, strides) - first;
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let to_row = given_to_row(given, &row);
        let Some(nodes) = piece.get_mut(row.start..).and_then(|n| n.first_chunk_mut::<W>()) else {
            debug_assert!(false, "a stencil beyond its band");
            return;
        };
        for (i, node) in nodes.iter_mut().enumerate() {
            add(&mut node.values, &to_row, weights.S(0, i), weights.G(0, i));
        }
    }
}

/// As [`scatter`] for several particles in one or two dimensions, particle `k` with the weights `weights(k)`: the nodes stay
/// in registers for as long as particle after particle reaches the same ones. The sums are the same.
#[inline(always)]
pub(crate) fn scatter_runs<T, V, const D: usize, const W: usize>(
    weights: impl Fn(usize) -> V,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    given: &[Deposit<T, D>],
) where
    T: RealField + Copy,
    V: Weights<T, D, W>,
{
    const { assert!(W <= 3, "more nodes than registers") };
    let rows = if D == 1 { 1 } else { W };
    let mut k = 0;
    while k < given.len() {
        let start = first_node(&weights(k), strides);
        let mut sums = [[[T::zero(); LANES]; W]; W];
        for index in 0..rows {
            let place = row_start(start - first, strides, index);
            let Some(nodes) = piece.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            for i in 0..W {
                sums[index][i] = nodes[i].values;
            }
        }
        loop {
            let weights_k = weights(k);
            for index in 0..rows {
                let to_row = given_to_row(&given[k], &row(&weights_k, start, strides, index));
                for i in 0..W {
                    add(&mut sums[index][i], &to_row, weights_k.S(0, i), weights_k.G(0, i));
                }
            }
            k += 1;
            if k >= given.len() || first_node(&weights(k), strides) != start {
                break;
            }
        }
        for index in 0..rows {
            let place = row_start(start - first, strides, index);
            let Some(nodes) = piece.get_mut(place..).and_then(|n| n.first_chunk_mut::<W>()) else {
                return;
            };
            for i in 0..W {
                nodes[i].values = sums[index][i];
            }
        }
    }
}

/// Where a row of nodes starts, in one and two dimensions.
#[inline(always)]
fn row_start<const D: usize>(start: usize, strides: &[usize; D], index: usize) -> usize {
    if D == 1 { start } else { start + index * strides[1] }
}

/// The first `N` values of nodes interpolated, and their gradients.
struct Interpolated<T, const D: usize, const N: usize> {
    level: [T; N],
    slope: [[T; N]; D],
}

impl<T: RealField + Copy, const D: usize, const N: usize> Interpolated<T, D, N> {
    #[inline(always)]
    fn zero() -> Self {
        Self { level: [T::zero(); N], slope: [[T::zero(); N]; D] }
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
        value: impl Fn(usize, usize) -> T,
    ) {
        let mut row_level = [T::zero(); N];
        let mut row_slope = [T::zero(); N];
        for i in 0..W {
            let (S, G) = (weights.S(0, i), weights.G(0, i));
            for q in 0..N {
                let value = value(i, q);
                row_level[q] = if i == 0 { value * S } else { row_level[q] + value * S };
                row_slope[q] = if i == 0 { value * G } else { value.mul_add(G, row_slope[q]) };
            }
        }
        let Self { level, slope } = self;
        for q in 0..N {
            level[q] += row_level[q] * row.S;
            slope[0][q] = row_slope[q].mul_add(row.S, slope[0][q]);
            for a in 1..D {
                slope[a][q] = row_level[q].mul_add(row.G[a], slope[a][q]);
            }
        }
    }

    #[inline(always)]
    fn write_to(&self, gathered: &mut Gathered<T, D>) {
        gathered.level.values[..N].copy_from_slice(&self.level);
        for a in 0..D {
            gathered.slope[a].values[..N].copy_from_slice(&self.slope[a]);
        }
    }
}

/// Interpolates velocity and acceleration, and the velocity's gradient.
#[inline(always)]
pub(crate) fn gather<T: RealField + Copy, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    gathered: &mut Gathered<T, D>,
) {
    let mut sums = Interpolated::<T, D, LANES>::zero();
    let start = first_node(weights, strides);
    for index in 0..rows::<D, W>() {
        let row = row(weights, start, strides, index);
        let Some(nodes) = nodes.get(row.start..).and_then(|n| n.first_chunk::<W>()) else {
            debug_assert!(false, "a stencil beyond the grid");
            break;
        };
        sums.add_row(weights, &row, |i, q| nodes[i].values[q]);
    }
    sums.write_to(gathered);
}

/// As [`gather`] for several particles in one or two dimensions, particle `k` with the weights `weights(k)`: the nodes stay
/// in registers for as long as particle after particle reaches the same ones.
#[inline(always)]
pub(crate) fn gather_runs<T, V, const D: usize, const W: usize>(
    weights: impl Fn(usize) -> V,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    gathered: &mut [Gathered<T, D>],
) where
    T: RealField + Copy,
    V: Weights<T, D, W>,
{
    const { assert!(W <= 3, "more nodes than registers") };
    // Velocity and acceleration are half of a node's values.
    const USED: usize = LANES / 2;
    let rows = if D == 1 { 1 } else { W };
    let mut k = 0;
    while k < gathered.len() {
        let start = first_node(&weights(k), strides);
        let mut values = [[[T::zero(); USED]; W]; W];
        for index in 0..rows {
            let place = row_start(start, strides, index);
            let Some(nodes) = nodes.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond the grid");
                return;
            };
            for i in 0..W {
                values[index][i].copy_from_slice(&nodes[i].values[..USED]);
            }
        }
        loop {
            let weights_k = weights(k);
            let mut sums = Interpolated::<T, D, USED>::zero();
            for index in 0..rows {
                let row = row(&weights_k, start, strides, index);
                sums.add_row(&weights_k, &row, |i, q| values[index][i][q]);
            }
            sums.write_to(&mut gathered[k]);
            k += 1;
            if k >= gathered.len() || first_node(&weights(k), strides) != start {
                break;
            }
        }
    }
}
