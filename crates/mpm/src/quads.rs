//! Sums over a particle's nodes in one or two dimensions, where half of a node's values are all that is used of it: to the
//! grid, and from it.

use nalgebra::RealField;

use crate::simd::{Quad, Vectors};
use crate::transfer::{Deposits, LANES, Node, Receive, Weights, is_middle};

/// The first half of a node's values: in one or two dimensions momentum and force, and for one dimension the mass.
#[inline(always)]
fn half<T: RealField + Copy>(values: &[T; LANES]) -> Quad<T> {
    const { assert!(LANES >= 4) };
    // Four numbers at once, even in a build that is hardly optimised.
    values.first_chunk().map_or(Quad([T::zero(); 4]), |half| Quad(*half))
}

/// What particles give to a node; the mass is used in two dimensions alone.
#[derive(Clone, Copy)]
struct Sum<T> {
    values: Quad<T>,
    mass: T,
}

impl<T: RealField + Copy> Sum<T> {
    #[inline(always)]
    fn zero() -> Self {
        Self { values: Quad([T::zero(); 4]), mass: T::zero() }
    }

    #[inline(always)]
    fn less(self, vectors: impl Vectors, other: Self) -> Self {
        Self { values: vectors.sub(self.values, other.values), mass: self.mass - other.mass }
    }
}

/// As [`scatter`](crate::transfer::scatter) for the first `count` particles, particle `k` with the weights `weights(k)`.
///
/// What a run of particles that reach the same nodes gives is summed up in registers. Of three nodes in a row the
/// [middle](is_middle) one takes what the outer two leave: until the run ends its sum is that of all three, which no
/// weight goes into.
#[inline(always)]
pub(crate) fn scatter_runs<T, L, V, const D: usize, const W: usize, const N: usize>(
    vectors: V,
    weights: impl Fn(usize) -> L,
    strides: &[usize; D],
    piece: &mut [Node<T, D>],
    first: usize,
    given: &Deposits<T, D, N>,
    count: usize,
) where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    const { assert!(W <= 3, "more nodes than registers") };
    let rows = if D == 1 { 1 } else { W };
    let mut k = 0;
    while k < count {
        let start = weights(k).first_node();
        let mut sums = [[Sum::zero(); W]; W];
        loop {
            let w = weights(k);
            let level = half(&given.level[k].values);
            let slope = slopes(vectors, given, k);
            let mass = given.level[k].mass();
            for j in 0..rows {
                let (mut to_level, mut to_slope, mut to_mass) = (level, slope[0], mass);
                if D > 1 && !is_middle::<W>(j) {
                    let S = vectors.splat(w.S(1, j));
                    let with_level = vectors.mul(level, S);
                    to_level = vectors.mul_add(slope[D - 1], vectors.splat(w.G(1, j)), with_level);
                    to_slope = vectors.mul(to_slope, S);
                    to_mass *= w.S(1, j);
                }
                for i in 0..W {
                    let sum = &mut sums[j][i];
                    if is_middle::<W>(i) {
                        sum.values = vectors.add(sum.values, to_level);
                        sum.mass += to_mass;
                        continue;
                    }
                    let (S, G) = (w.S(0, i), w.G(0, i));
                    let with_slope = vectors.mul_add(to_slope, vectors.splat(G), sum.values);
                    sum.values = vectors.mul_add(to_level, vectors.splat(S), with_slope);
                    sum.mass = to_mass.mul_add(S, sum.mass);
                }
            }
            k += 1;
            if k >= count || weights(k).first_node() != start {
                break;
            }
        }
        for i in 0..W {
            if D > 1 {
                let mut column = std::array::from_fn(|j| sums[j][i]);
                leave_middle::<_, _, W>(vectors, &mut column);
                (0..W).for_each(|j| sums[j][i] = column[j]);
            }
        }
        for j in 0..rows {
            leave_middle(vectors, &mut sums[j]);
            let place = row_start(start - first, strides, j);
            let Some(nodes) = piece.get_mut(place..).and_then(|n| n.first_chunk_mut::<W>()) else {
                debug_assert!(false, "a stencil beyond its band");
                return;
            };
            for i in 0..W {
                let Node { values } = &mut nodes[i];
                let sum = vectors.add(half(values), sums[j][i].values);
                values[..4].copy_from_slice(&sum.0);
                if D == 2 {
                    values[2 * D] += sums[j][i].mass;
                }
            }
        }
    }
}

/// What is left to the middle one of three nodes, if there are three.
#[inline(always)]
fn leave_middle<T: RealField + Copy, V: Vectors, const W: usize>(
    vectors: V,
    sums: &mut [Sum<T>; W],
) {
    if let [first, all, last] = &mut sums[..] {
        *all = all.less(vectors, *first).less(vectors, *last);
    }
}

/// Where a row of nodes starts, in one and two dimensions.
#[inline(always)]
fn row_start<const D: usize>(start: usize, strides: &[usize; D], index: usize) -> usize {
    if D == 1 { start } else { start + index * strides[1] }
}

/// What goes with the gradients along all axes, in the order of a node's values.
#[inline(always)]
fn slopes<T: RealField + Copy, V: Vectors, const D: usize, const N: usize>(
    vectors: V,
    given: &Deposits<T, D, N>,
    k: usize,
) -> [Quad<T>; D] {
    let zero = T::zero();
    let traction = given.traction[k].as_slice();
    let Some(&traction) = traction.first_chunk::<4>() else {
        return [Quad([zero, traction[0], zero, zero]); D];
    };
    let along = vectors.low_to_high(Quad(traction));
    let across = vectors.high_alone(Quad(traction));
    std::array::from_fn(|a| if a == 0 { along } else { across })
}

/// As [`gather`](crate::transfer::gather) for the first `count` particles, particle `k` with the weights `weights(k)`: velocity and
/// acceleration one after the other, and their gradients.
///
/// Differences of nodes serve all particles of a run that reach the same ones.
#[inline(always)]
pub(crate) fn gather_runs<T, L, V, const D: usize, const W: usize>(
    vectors: V,
    weights: impl Fn(usize) -> L,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    count: usize,
    receiver: &mut impl Receive<T, D>,
) where
    T: RealField + Copy,
    V: Vectors,
    L: Weights<T, D, W>,
{
    let zero = Quad([T::zero(); 4]);
    let rows = if D == 1 { 1 } else { W };
    let mut k = 0;
    while k < count {
        let start = weights(k).first_node();
        let mut changes = [[zero; W]; W];
        for j in 0..rows {
            let place = row_start(start, strides, j);
            let Some(row) = nodes.get(place..).and_then(|n| n.first_chunk::<W>()) else {
                debug_assert!(false, "a stencil beyond the grid");
                return;
            };
            for i in 0..W {
                changes[j][i] = half(&row[i].values);
            }
        }
        for i in 0..W {
            if D > 1 {
                let mut column = std::array::from_fn(|j| changes[j][i]);
                differ::<_, _, W>(vectors, &mut column);
                (0..W).for_each(|j| changes[j][i] = column[j]);
            }
        }
        for row in &mut changes[..rows] {
            differ(vectors, row);
        }
        loop {
            let w = weights(k);
            let (mut levels, mut slopes) = ([zero; W], [zero; W]);
            for j in 0..rows {
                (levels[j], slopes[j]) = interpolate(vectors, &changes[j], &w, 0);
            }
            if D == 1 {
                receiver.receive_quads(vectors, k, levels[0], [slopes[0]; D]);
            } else {
                let (level, across) = interpolate(vectors, &levels, &w, 1);
                let (along, _) = interpolate(vectors, &slopes, &w, 1);
                let mut slope = [across; D];
                slope[0] = along;
                receiver.receive_quads(vectors, k, level, slope);
            }
            k += 1;
            if k >= count || weights(k).first_node() != start {
                break;
            }
        }
    }
}

/// From values at successive nodes of an axis to the changes from one to the next; the value of one node stays, the
/// [middle](is_middle) one of three and the first of two.
#[inline(always)]
fn differ<T: RealField + Copy, V: Vectors, const W: usize>(vectors: V, values: &mut [Quad<T>; W]) {
    match &mut values[..] {
        [first, last] => *last = vectors.sub(*last, *first),
        [first, middle, last] => {
            *first = vectors.sub(*middle, *first);
            *last = vectors.sub(*last, *middle);
        }
        _ => {}
    }
}

/// What values at successive nodes of an axis come to, and their gradient, given the [changes](differ).
///
/// Products that make up a level are rounded before they are added, not fused: those of a node and of its mirror image
/// then cancel, and a particle on a wall stays there.
#[inline(always)]
fn interpolate<T: RealField + Copy, V: Vectors, const D: usize, const W: usize>(
    vectors: V,
    changes: &[Quad<T>; W],
    weights: &impl Weights<T, D, W>,
    axis: usize,
) -> (Quad<T>, Quad<T>) {
    let last = changes[W - 1];
    let to_last = vectors.mul(last, vectors.splat(weights.S(axis, W - 1)));
    let G = vectors.splat(weights.G(axis, W - 1));
    if W == 2 {
        return (vectors.add(changes[0], to_last), vectors.mul(last, G));
    }
    // The weights of all nodes add up to one, and their gradients to zero.
    let first = changes[0];
    let to_first = vectors.mul(first, vectors.splat(weights.S(axis, 0)));
    let slope = vectors.mul_sub(last, G, vectors.mul(first, vectors.splat(weights.G(axis, 0))));
    (vectors.add(changes[1], vectors.sub(to_last, to_first)), slope)
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;
    use pulp::Scalar;

    use super::*;
    use crate::octets::{gather_in_space, scatter_in_space};
    use crate::transfer::{Gathered, gather, scatter};
    use crate::weights::{AxisWeights, FixedBox, Hat, Rule, index};

    const COUNT: usize = 24;
    const SIDE: usize = 16;

    /// The weights of one particle, as a rule states them.
    struct Stated<const D: usize, const W: usize>([AxisWeights<f64, W>; D]);

    impl<const D: usize, const W: usize> Weights<f64, D, W> for &Stated<D, W> {
        fn first_node(&self) -> usize {
            (0..D).map(|a| index(self.0[a].base) * SIDE.pow(a as u32)).sum()
        }

        fn S(&self, axis: usize, place: usize) -> f64 {
            self.0[axis].S[place]
        }

        fn G(&self, axis: usize, place: usize) -> f64 {
            self.0[axis].G[place]
        }
    }

    /// Both ways to the grid and both ways back, for particles at places along a line of cells.
    fn compare<R, const D: usize, const W: usize>(
        rule: R,
        places: &[f64],
        numbers: &[f64],
    ) -> Result<(), TestCaseError>
    where
        R: Rule<f64, D, W>,
    {
        let mut numbers = numbers.iter().copied().cycle();
        let mut number = || numbers.next().unwrap_or(1.0);
        let weights: Vec<Stated<D, W>> = places
            .iter()
            .map(|&place| {
                let xi: [f64; D] = std::array::from_fn(|a| place / (a + 1) as f64);
                Stated(std::array::from_fn(|a| R::along_axis(xi[a], rule.half_size(a, 1.0))))
            })
            .collect();
        let strides: [usize; D] = std::array::from_fn(|a| SIDE.pow(a as u32));
        let mut given = Deposits::<f64, D, COUNT>::zero();
        for k in 0..COUNT {
            let v = SVector::from_fn(|_, _| number());
            given.level[k] =
                Node::new(&v, &SVector::from_fn(|_, _| number()), 1.0 + number().abs());
            given.traction[k] = SMatrix::from_fn(|_, _| number());
        }
        let mut nodes = vec![Node::zero(); SIDE.pow(D as u32)];
        let mut one_by_one = nodes.clone();
        let first = SIDE.pow(D as u32 - 1);
        let vectors = Scalar::new();
        let piece = &mut nodes[first..];
        if D < 3 {
            scatter_runs(vectors, |k| &weights[k], &strides, piece, first, &given, COUNT);
        } else {
            for k in 0..COUNT {
                scatter_in_space(vectors, &&weights[k], &strides, piece, first, (&given, k));
            }
        }
        for k in 0..COUNT {
            scatter(&&weights[k], &strides, &mut one_by_one[first..], first, (&given, k));
        }
        for (a, b) in nodes.iter().zip(&one_by_one) {
            for (a, b) in a.values.iter().zip(&b.values) {
                prop_assert!((a - b).abs() < 1e-13, "{a} {b}");
            }
        }
        prop_assert!(nodes.iter().any(|node| node.mass() > 0.5));

        let mut gathered = [Gathered::zero(); COUNT];
        if D < 3 {
            let receiver = &mut &mut gathered[..];
            gather_runs(vectors, |k| &weights[k], &strides, &nodes, COUNT, receiver);
        } else {
            for (gathered, weights) in gathered.iter_mut().zip(&weights) {
                *gathered = gather_in_space(vectors, &weights, &strides, &nodes);
            }
        }
        for (gathered, weights) in gathered.iter().zip(&weights) {
            let alone = gather(&weights, &strides, &nodes);
            prop_assert!((gathered.velocity - alone.velocity).amax() < 1e-13);
            prop_assert!((gathered.acceleration - alone.acceleration).amax() < 1e-13);
            prop_assert!((gathered.velocity_gradient - alone.velocity_gradient).amax() < 1e-13);
        }
        Ok(())
    }

    proptest! {
        /// In runs that share their nodes, and particles that share them with nobody; in three dimensions each alone.
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
            compare::<_, 1, 2>(Hat, &places, &numbers)?;
            compare::<_, 2, 2>(Hat, &places, &numbers)?;
            compare::<_, 1, 3>(FixedBox(SVector::repeat(l)), &places, &numbers)?;
            compare::<_, 2, 3>(FixedBox(SVector::repeat(l)), &places, &numbers)?;
            compare::<_, 3, 2>(Hat, &places, &numbers)?;
            compare::<_, 3, 3>(FixedBox(SVector::repeat(l)), &places, &numbers)?;
        }
    }
}
