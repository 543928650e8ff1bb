//! P2G and G2P in the plane and on a line: velocity and acceleration of a node fit one register of four lanes.

use std::ops::Range;

use mmsmith_lanes::simd::{Lane4, Lanes, Vectors};

use crate::grid::node::{LANES, Node};
use crate::kernel::any::{Contributions, Receive};
use crate::kernel::{nodes_from, nodes_from_mut};
use crate::shape::weights::{Weights, is_middle};

/// The first four of a node's values: momentum and force in two dimensions; momentum, force and mass in one.
#[inline(always)]
fn half<T: Lanes>(values: &[T; LANES]) -> Lane4<T> {
    const { assert!(LANES >= 4) };
    // One load of four numbers even in builds with little optimisation.
    values.first_chunk().map_or(Lane4::zero(), |half| Lane4(*half))
}

/// Sums of contributions to a row of nodes. Masses have a vector of their own in two dimensions alone, node by node: one number
/// of each node would not leave enough registers for the others.
#[derive(Clone, Copy)]
struct RowSums<T, const W: usize> {
    values: [Lane4<T>; W],
    masses: Lane4<T>,
}

impl<T: Lanes, const W: usize> RowSums<T, W> {
    #[inline(always)]
    fn zero() -> Self {
        Self { values: [Lane4::zero(); W], masses: Lane4::zero() }
    }

    #[inline(always)]
    fn less(mut self, vectors: impl Vectors, other: &Self) -> Self {
        for i in 0..W {
            self.values[i] = vectors.sub(self.values[i], other.values[i]);
        }
        self.masses = vectors.sub(self.masses, other.masses);
        self
    }
}

/// The factor of a particle's slope along an axis: gradients, and where velocities are affine arms, for the first vector of a node
/// (P2G: affine momenta) or for the second (G2P: moments).
#[inline(always)]
fn slope_factor<T, V, L, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    (axis, place): (usize, usize),
    arms_first: bool,
) -> Lane4<T>
where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let G = vectors.splat(weights.G(axis, place));
    if !L::AFFINE {
        return G;
    }
    let Z = vectors.splat(weights.Z(axis, place));
    let (first, second) = if arms_first { (Z, G) } else { (G, Z) };
    of_both(vectors, D, first, second)
}

/// One number for the first vector of a node, and another for the second.
#[inline(always)]
fn of_both<T: Lanes>(
    vectors: impl Vectors,
    dimension: usize,
    first: Lane4<T>,
    second: Lane4<T>,
) -> Lane4<T> {
    if dimension == 1 {
        let (Lane4([a, ..]), Lane4([_, b, c, d])) = (first, second);
        return Lane4([a, b, c, d]);
    }
    vectors.low_and_high(first, second)
}

/// Rows of nodes along axis 0 that a particle reaches. Loops over more than three are not to be unrolled: they would be long.
#[inline(always)]
fn rows<const D: usize, const W: usize>() -> usize {
    if D == 1 {
        1
    } else if W > 3 {
        std::hint::black_box(W).min(W)
    } else {
        W
    }
}

/// P2G of the first `count` particles, particle `k` with the weights `weights(k)`; as [`p2g`](crate::kernel::any::p2g).
///
/// Successive particles with the same nodes form a run, whose contributions are summed in registers. Of three nodes in a
/// row the [middle](crate::shape::weights::is_middle) one needs no weight: it sums whole contributions, and the sums of the outer two are
/// subtracted at the end of the run.
#[inline(always)]
pub(crate) fn p2g_in_plane<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: impl Fn(usize) -> L,
    strides: &[usize; D],
    window: &mut [Node<T, D>],
    contributions: &Contributions<T, D, N>,
    count: usize,
) where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let rows = rows::<D, W>();
    let mut k = 0;
    while k < count {
        let start = weights(k).first_node();
        let mut sums = [RowSums::<T, W>::zero(); W];
        loop {
            let w = weights(k);
            let gradient = slopes(vectors, contributions, k, L::AFFINE);
            let (along, across) = (gradient[0], gradient[D - 1]);
            let given = Given {
                values: half(&contributions.value[k].values),
                slope: along,
                mass: vectors.splat(contributions.value[k].mass()),
            };
            if D > 1 {
                let mut j = 0;
                while j < rows {
                    let scale = vectors.splat(w.S(1, j));
                    let of_row = Given {
                        values: vectors.mul_add(
                            across,
                            slope_factor(vectors, &w, (1, j), true),
                            vectors.mul(given.values, scale),
                        ),
                        slope: vectors.mul(along, scale),
                        mass: vectors.mul(given.mass, scale),
                    };
                    add_to_row(vectors, &w, of_row, &mut sums[j]);
                    j += to_next_outer::<W>();
                }
            }
            if D == 1 || W == 3 {
                let row = if D == 1 { 0 } else { W / 2 };
                add_to_row(vectors, &w, given, &mut sums[row]);
            }
            k += 1;
            if k >= count || weights(k).first_node() != start {
                break;
            }
        }
        if D > 1 && W == 3 {
            sums[W / 2] = sums[W / 2].less(vectors, &sums[0]).less(vectors, &sums[W - 1]);
        }
        for j in 0..rows {
            let RowSums { values: sums, masses } = &mut sums[j];
            if W == 3 {
                let outer = (sums[0], sums[W - 1]);
                sums[W / 2] = vectors.sub(vectors.sub(sums[W / 2], outer.0), outer.1);
                masses.0[W / 2] = masses.0[W / 2] - masses.0[0] - masses.0[W - 1];
            }
            let place = row_start(start, strides, j);
            let nodes = nodes_from_mut::<_, W>(window, place, "a stencil beyond its window");
            for i in 0..W {
                let Node { values } = &mut nodes[i];
                let sum = vectors.add(half(values), sums[i]);
                values[..4].copy_from_slice(&sum.0);
                if D == 2 {
                    values[Node::<T, D>::MASS] += masses.0[i];
                }
            }
        }
    }
}

/// A particle's contribution to a row of nodes.
#[derive(Clone, Copy)]
struct Given<T> {
    values: Lane4<T>,
    /// Along the row.
    slope: Lane4<T>,
    /// In every lane.
    mass: Lane4<T>,
}

/// The weights along axis 0, one for [middle](crate::shape::weights::is_middle) nodes.
#[inline(always)]
fn weights_along_row<T: Lanes, const D: usize, const W: usize>(
    weights: &impl Weights<T, D, W>,
) -> Lane4<T> {
    let mut lanes = Lane4::zero();
    for i in 0..W {
        lanes.0[i] = if is_middle::<W>(i) { T::one() } else { weights.S(0, i) };
    }
    lanes
}

/// Nodes from one outer node to the next. A branch for the [middle](crate::shape::weights::is_middle) one in the loop would keep the compiler from unrolling it.
const fn to_next_outer<const W: usize>() -> usize {
    if W == 3 { 2 } else { 1 }
}

/// Adds a contribution to the sums of a row, to that of a middle one as a whole.
#[inline(always)]
fn add_to_row<T, V, L, const D: usize, const W: usize>(
    vectors: V,
    weights: &L,
    given: Given<T>,
    sums: &mut RowSums<T, W>,
) where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let mut i = 0;
    while i < W {
        let (S, slope) = (weights.S(0, i), slope_factor(vectors, weights, (0, i), true));
        let with_slope = vectors.mul_add(given.slope, slope, sums.values[i]);
        sums.values[i] = vectors.mul_add(given.values, vectors.splat(S), with_slope);
        i += to_next_outer::<W>();
    }
    if W == 3 {
        sums.values[W / 2] = vectors.add(sums.values[W / 2], given.values);
    }
    if D == 2 {
        sums.masses = vectors.mul_add(given.mass, weights_along_row(weights), sums.masses);
    }
}

/// Index of the first node of a row, in one and two dimensions.
#[inline(always)]
fn row_start<const D: usize>(start: usize, strides: &[usize; D], index: usize) -> usize {
    if D == 1 { start } else { start + index * strides[1] }
}

/// The factors of the slopes along all axes, in the order of a node's values.
#[inline(always)]
fn slopes<T: Lanes, V: Vectors, const D: usize, const N: usize>(
    vectors: V,
    contributions: &Contributions<T, D, N>,
    k: usize,
    is_affine: bool,
) -> [Lane4<T>; D] {
    let zero = T::zero();
    let stress_flux = contributions.stress_flux[k].as_slice();
    let affine = contributions.affine[k].as_slice();
    let (Some(&flux), Some(&affine)) = (stress_flux.first_chunk::<4>(), affine.first_chunk::<4>())
    else {
        let momentum = if is_affine { affine[0] } else { zero };
        return [Lane4([momentum, stress_flux[0], zero, zero]); D];
    };
    let (flux, affine) = (Lane4(flux), Lane4(affine));
    let mut along = vectors.low_to_high(flux);
    let mut across = vectors.high_alone(flux);
    if is_affine {
        along = vectors.low_and_high(affine, along);
        across = vectors.high_and_low(affine, vectors.high_and_low(flux, flux));
    }
    let mut slopes = [across; D];
    slopes[0] = along;
    slopes
}

/// G2P of some successive `particles`, particle `k` with the weights `weights(k)`; as [`g2p`](crate::kernel::any::g2p).
///
/// Successive particles with the same nodes form a run, which shares the differences between nodes.
#[inline(always)]
pub(crate) fn g2p_in_plane<T, L, V, const D: usize, const W: usize>(
    vectors: V,
    weights: impl Fn(usize) -> L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    particles: Range<usize>,
    receiver: &mut impl Receive<T, D>,
) where
    T: Lanes,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let zero = Lane4::zero();
    let rows = rows::<D, W>();
    let Range { start: mut k, end: count } = particles;
    while k < count {
        let start = weights(k).first_node();
        let mut changes = [[zero; W]; W];
        for j in 0..rows {
            let place = row_start(start, strides, j);
            let row = nodes_from::<_, W>(nodes, place, "a stencil beyond the grid");
            for i in 0..W {
                changes[j][i] = half(&row[i].values);
            }
        }
        for i in 0..W {
            if D > 1 {
                let mut column = [changes[0][i]; W];
                (1..W).for_each(|j| column[j] = changes[j][i]);
                differ::<_, _, W>(vectors, &mut column);
                (0..W).for_each(|j| changes[j][i] = column[j]);
            }
        }
        for row in &mut changes[..rows] {
            differ(vectors, row);
        }
        loop {
            let w = weights(k);
            let (mut row_values, mut gradients) = ([zero; W], [zero; W]);
            for j in 0..rows {
                (row_values[j], gradients[j]) = interpolate(vectors, &changes[j], &w, 0);
            }
            if D == 1 {
                receiver.receive_lanes(vectors, k, &w, row_values[0], [gradients[0]; D]);
            } else {
                let (value, across) = interpolate(vectors, &row_values, &w, 1);
                let (along, _) = interpolate(vectors, &gradients, &w, 1);
                let mut gradient = [across; D];
                gradient[0] = along;
                receiver.receive_lanes(vectors, k, &w, value, gradient);
            }
            k += 1;
            if k >= count || weights(k).first_node() != start {
                break;
            }
        }
    }
}

/// Replaces values at successive nodes of an axis by their differences; one value stays, that of the
/// [middle](crate::shape::weights::is_middle) one of three nodes or of the first of two.
#[inline(always)]
fn differ<T: Lanes, V: Vectors, const W: usize>(vectors: V, values: &mut [Lane4<T>; W]) {
    match &mut values[..] {
        [first, last] => *last = vectors.sub(*last, *first),
        [first, middle, last] => {
            *first = vectors.sub(*middle, *first);
            *last = vectors.sub(*last, *middle);
        }
        _ => {}
    }
}

/// Interpolated value and slope along an axis, from the [differences](differ) between nodes; of four nodes from their values.
///
/// Products that make up a value are rounded before they are added, not fused: those of a node and of its mirror image
/// then cancel, and a particle on a wall stays there.
#[inline(always)]
fn interpolate<T: Lanes, V: Vectors, const D: usize, const W: usize>(
    vectors: V,
    changes: &[Lane4<T>; W],
    weights: &impl Weights<T, D, W>,
    axis: usize,
) -> (Lane4<T>, Lane4<T>) {
    if W > 3 {
        let mut value = vectors.mul(changes[0], vectors.splat(weights.S(axis, 0)));
        let mut slope = vectors.mul(changes[0], slope_factor(vectors, weights, (axis, 0), false));
        for (place, nodal) in changes.iter().enumerate().skip(1) {
            value = vectors.add(value, vectors.mul(*nodal, vectors.splat(weights.S(axis, place))));
            slope = vectors.mul_add(
                *nodal,
                slope_factor(vectors, weights, (axis, place), false),
                slope,
            );
        }
        return (value, slope);
    }
    let last = changes[W - 1];
    let to_last = vectors.mul(last, vectors.splat(weights.S(axis, W - 1)));
    let slope = slope_factor(vectors, weights, (axis, W - 1), false);
    if W == 2 {
        return (vectors.add(changes[0], to_last), vectors.mul(last, slope));
    }
    // The weights of all nodes add up to one, and their gradients to zero.
    let first = changes[0];
    let to_first = vectors.mul(first, vectors.splat(weights.S(axis, 0)));
    let gradient = vectors.mul_sub(
        last,
        slope,
        vectors.mul(first, slope_factor(vectors, weights, (axis, 0), false)),
    );
    (vectors.add(changes[1], vectors.sub(to_last, to_first)), gradient)
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;
    use pulp::Scalar;

    use super::*;
    use crate::kernel::any::{Interpolated, g2p, p2g};
    use crate::kernel::lanes_space::{g2p_in_space, p2g_in_space};
    use crate::shape::one_axis::{
        AxisWeights, CubicSpline, Gimp, Hat, QuadraticSpline, ShapeFunction, index, moment,
    };

    const COUNT: usize = 24;
    const SIDE: usize = 16;

    /// The weights of one particle at places along the axes, in cells.
    struct Stated<const D: usize, const W: usize, const AFFINE: bool> {
        axes: [AxisWeights<f64, W>; D],
        place: [f64; D],
    }

    impl<const D: usize, const W: usize, const AFFINE: bool> Weights<f64, D, W>
        for &Stated<D, W, AFFINE>
    {
        const AFFINE: bool = AFFINE;

        fn first_node(&self) -> usize {
            (0..D).map(|a| index(self.axes[a].base) * SIDE.pow(a as u32)).sum()
        }

        fn S(&self, axis: usize, place: usize) -> f64 {
            self.axes[axis].S[place]
        }

        fn G(&self, axis: usize, place: usize) -> f64 {
            self.axes[axis].G[place]
        }

        fn Z(&self, axis: usize, place: usize) -> f64 {
            self.axes[axis].S[place] * (place as f64 - self.place[axis])
        }

        fn affine(
            &self,
            moments: SMatrix<f64, D, D>,
            _: &SMatrix<f64, D, D>,
        ) -> SMatrix<f64, D, D> {
            let inertia = |a: usize| 0.1 + moment(&self.axes[a].S, self.place[a]);
            SMatrix::from_fn(|i, j| moments[(i, j)] / inertia(j))
        }
    }

    /// P2G and G2P by this module and by `any`, for particles at places along a line of cells.
    fn compare<R, const D: usize, const W: usize, const AFFINE: bool>(
        _: R,
        l: f64,
        places: &[f64],
        numbers: &[f64],
    ) -> Result<(), TestCaseError>
    where
        R: ShapeFunction<W>,
    {
        let mut numbers = numbers.iter().copied().cycle();
        let mut number = || numbers.next().unwrap_or(1.0);
        let weights: Vec<Stated<D, W, AFFINE>> = places
            .iter()
            .map(|&place| {
                let xi: [f64; D] = std::array::from_fn(|a| place / (a + 1) as f64);
                let axes: [_; D] = std::array::from_fn(|a| R::axis_weights(xi[a], l));
                Stated { place: std::array::from_fn(|a| axes[a].after_first(xi[a])), axes }
            })
            .collect();
        let strides: [usize; D] = std::array::from_fn(|a| SIDE.pow(a as u32));
        let mut contributions = Contributions::<f64, D, COUNT>::zero();
        for k in 0..COUNT {
            let v = SVector::from_fn(|_, _| number());
            contributions.value[k] =
                Node::new(&v, &SVector::from_fn(|_, _| number()), 1.0 + number().abs());
            contributions.stress_flux[k] = SMatrix::from_fn(|_, _| number());
            contributions.affine[k] = SMatrix::from_fn(|_, _| number());
        }
        let mut nodes = vec![Node::zero(); SIDE.pow(D as u32)];
        let mut one_by_one = nodes.clone();
        let first = SIDE.pow(D as u32 - 1);
        let vectors = Scalar::new();
        let window = &mut nodes[first..];
        if D < 3 {
            p2g_in_plane(vectors, |k| &weights[k], &strides, window, &contributions, COUNT);
        } else {
            for k in 0..COUNT {
                p2g_in_space(vectors, &&weights[k], &strides, window, (&contributions, k));
            }
        }
        for k in 0..COUNT {
            p2g(&&weights[k], &strides, &mut one_by_one[first..], (&contributions, k));
        }
        for (a, b) in nodes.iter().zip(&one_by_one) {
            for (a, b) in a.values.iter().zip(&b.values) {
                prop_assert!((a - b).abs() < 1e-13, "{a} {b}");
            }
        }
        prop_assert!(nodes.iter().any(|node| node.mass() > 0.5));

        let mut interpolated = [Interpolated::zero(); COUNT];
        if D < 3 {
            let receiver = &mut &mut interpolated[..];
            g2p_in_plane(vectors, |k| &weights[k], &strides, &nodes, 0..COUNT, receiver);
        } else {
            for (interpolated, weights) in interpolated.iter_mut().zip(&weights) {
                *interpolated = g2p_in_space(vectors, &weights, &strides, &nodes);
            }
        }
        for (interpolated, weights) in interpolated.iter().zip(&weights) {
            let alone = g2p(&weights, &strides, &nodes);
            prop_assert!((interpolated.velocity - alone.velocity).amax() < 1e-13);
            prop_assert!((interpolated.second - alone.second).amax() < 1e-13);
            prop_assert!((interpolated.velocity_gradient - alone.velocity_gradient).amax() < 1e-13);
            prop_assert!((interpolated.affine - alone.affine).amax() < 1e-12);
        }
        Ok(())
    }

    proptest! {
        /// In runs with the same nodes and in runs of one particle; in three dimensions each alone.
        #[test]
        fn runs_of_particles_exchange_what_each_would_alone(
            places in prop::collection::vec(2.5..9.5, COUNT),
            numbers in prop::collection::vec(-1.0..1.0, 31),
            sort in any::<bool>(),
            l in 0.05..0.5,
        ) {
            let mut places = places;
            if sort {
                places.sort_by(f64::total_cmp);
            }
            fn all<const AFFINE: bool>(
                l: f64,
                places: &[f64],
                numbers: &[f64],
            ) -> Result<(), TestCaseError> {
                compare::<_, 1, 2, AFFINE>(Hat, 0.0, places, numbers)?;
                compare::<_, 2, 2, AFFINE>(Hat, 0.0, places, numbers)?;
                compare::<_, 3, 2, AFFINE>(Hat, 0.0, places, numbers)?;
                compare::<_, 1, 3, AFFINE>(Gimp, l, places, numbers)?;
                compare::<_, 2, 3, AFFINE>(Gimp, l, places, numbers)?;
                compare::<_, 3, 3, AFFINE>(Gimp, l, places, numbers)?;
                compare::<_, 2, 3, AFFINE>(QuadraticSpline, 0.5, places, numbers)?;
                compare::<_, 1, 4, AFFINE>(CubicSpline, 1.0, places, numbers)?;
                compare::<_, 2, 4, AFFINE>(CubicSpline, 1.0, places, numbers)?;
                compare::<_, 3, 4, AFFINE>(CubicSpline, 1.0, places, numbers)
            }
            all::<false>(l, &places, &numbers)?;
            all::<true>(l, &places, &numbers)?;
        }
    }
}
