//! P2G and G2P of CPDI, whose weights are means over parallelograms.
//!
//! With half-edges `E` the corners of a parallelogram are `x_c = x + E s_c`, `s_a` of -1 and 1, and a weight and its gradient
//!
//! ```text
//! S_i = H_0 / 2^D,  G_i = sum_a g_a H_a,  g = E^-T / 2^D;   H_0 = sum_c N_i(x_c),  H_a = sum_c s_a N_i(x_c)
//! ```
//!
//! P2G computes the sums `H` for eight particles at once. Most domains lie within two cells along each axis, and reach 3 nodes; the others
//! go from corner to corner, one particle at a time. G2P has the same sums over corners, `sum_i v_i H_a = sum_c s_a v(x_c)`, of the
//! values `v(x_c) = sum_i v_i N_i(x_c)` there.

use std::array;

use mmsmith_lanes::simd::{Eight, Lane8, Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::real;

use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::beyond;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::points::start_of_row;
use crate::shape::cells::{
    HalfEdges, MOST_CORNERS, REACHED, corner_of_parallelogram, deformed, inverse, is_upper,
    slopes_of_parallelogram,
};
use crate::shape::one_axis::{index, node_below};

/// One number for every particle of a block, `[group].0[n]`; aligned with vector registers.
type PerParticle<T> = [Lane8<T>; BLOCK / GROUP];

/// Particles whose weights are computed together.
pub(crate) const GROUP: usize = 8;

/// Nodes that a domain within two cells reaches in all.
const MOST_REACHED: usize = 27;

/// The parallelograms of a block of particles; `[corner][axis][k]` is of particle `k`.
///
/// All positions are in cells from the first node of the particle, the one below its lowest corner along each axis.
pub(crate) struct Parallelograms<T, const D: usize> {
    /// Whether there are affine velocities (APIC).
    is_affine: bool,
    /// Index of the first node.
    first_node: [usize; BLOCK],
    /// Whether all corners are within two cells along each axis.
    is_small: [bool; BLOCK],
    /// Positions of the corners.
    at: [[PerParticle<T>; D]; MOST_CORNERS],
    /// `g[i][a]`, per cell.
    g: [[PerParticle<T>; D]; D],
    /// The centre; valid where `is_affine`.
    centre: [PerParticle<T>; D],
    /// The half-edges; valid where `is_affine`.
    E: [[PerParticle<T>; D]; D],
}

impl<T: Lanes, const D: usize> Parallelograms<T, D> {
    fn new(is_affine: bool) -> Self {
        let zero = [Lane8::zero(); BLOCK / GROUP];
        Self {
            is_affine,
            first_node: [0; BLOCK],
            is_small: [true; BLOCK],
            at: [[zero; D]; MOST_CORNERS],
            g: [[zero; D]; D],
            centre: [zero; D],
            E: [[zero; D]; D],
        }
    }

    /// Takes those of a group.
    #[inline(always)]
    fn take<V: Vectors>(
        &mut self,
        vectors: V,
        c: &Constants<T, D>,
        group: usize,
        OfGroup { xi, E }: &OfGroup<T, V, D>,
    ) {
        let mut at = [*xi; MOST_CORNERS];
        for corner in 0..1 << D {
            at[corner] = corner_of_parallelogram(xi, E, corner);
        }
        let mut first = [-c.nodes_before; GROUP];
        let mut reach = Lane8::zero();
        for a in 0..D {
            let (mut low, mut high) = (at[0][a].lanes, at[0][a].lanes);
            for corner in &at[1..1 << D] {
                low = vectors.min8(low, corner[a].lanes);
                high = vectors.max8(high, corner[a].lanes);
            }
            let mut node = Eight { lanes: Lane8::zero(), vectors };
            for n in 0..GROUP {
                let (base, at) = node_below(low.0[n]);
                first[n] += base * c.strides[a] as f64;
                node.lanes.0[n] = at;
            }
            reach = vectors.max8(reach, vectors.sub8(high, node.lanes));
            for corner in 0..1 << D {
                at[corner][a] = at[corner][a] - node;
                store(&mut self.at[corner][a], group, at[corner][a]);
            }
            store(&mut self.centre[a], group, xi[a] - node);
        }
        let (_, g) = slopes_of_parallelogram(E);
        for i in 0..D {
            for a in 0..D {
                store(&mut self.g[i][a], group, g[i][a]);
            }
        }
        for n in 0..GROUP {
            self.first_node[group * GROUP + n] = index(first[n]);
            self.is_small[group * GROUP + n] = reach.0[n] <= real(2.0);
        }
        if self.is_affine {
            for a in 0..D {
                for edge in 0..D {
                    store(&mut self.E[a][edge], group, E[a][edge]);
                }
            }
        }
    }
}

/// The weights of a block of particles, and a buffer for those of a group.
pub(crate) struct ParallelogramWeights<T, const D: usize> {
    own: Parallelograms<T, D>,
    of_group: GroupWeights<T, D>,
}

impl<T: Lanes, const D: usize> ParallelogramWeights<T, D> {
    pub(crate) fn new(is_affine: bool) -> Self {
        Self { own: Parallelograms::new(is_affine), of_group: GroupWeights::zero() }
    }

    /// Weights of the parallelograms that F makes of the reference ones with these half-edges.
    pub(crate) fn compute(
        &mut self,
        c: &Constants<T, D>,
        half_edges: &HalfEdges<T, D>,
        ids: &[u32],
        kinematics: Kinematics<'_, T, D>,
    ) {
        dispatch(Compute { own: &mut self.own, c, half_edges, ids: &padded(ids), kinematics });
    }

    /// P2G of the first `count` particles, to the band of nodes that starts at node `first`.
    pub(crate) fn p2g(
        &mut self,
        strides: &[usize; D],
        band: &mut [Node<T, D>],
        first: usize,
        contributions: &Contributions<T, D, BLOCK>,
        count: usize,
    ) {
        let Self { own, of_group: weights } = self;
        let of_block = P2gOfBlock { own, weights, strides, band, first, contributions, count };
        if of_block.own.is_affine {
            dispatch(P2g::<_, D, true>(of_block));
        } else {
            dispatch(P2g::<_, D, false>(of_block));
        }
    }

    /// G2P of the first particles, as many as `receiver` has places.
    pub(crate) fn g2p(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    ) {
        let of_block = G2pOfBlock { own: &self.own, strides, nodes, receiver };
        if of_block.own.is_affine {
            dispatch(G2p::<_, D, true>(of_block));
        } else {
            dispatch(G2p::<_, D, false>(of_block));
        }
    }
}

/// The ids of a block, the last one again where there are fewer.
pub(crate) fn padded(ids: &[u32]) -> [usize; BLOCK] {
    let last = ids.last().copied().unwrap_or(0);
    array::from_fn(|k| ids.get(k).copied().unwrap_or(last) as usize)
}

#[inline(always)]
fn store<T: Lanes, V: Vectors>(array: &mut PerParticle<T>, group: usize, numbers: Eight<T, V>) {
    array[group] = numbers.lanes;
}

/// One number of each particle of a group.
#[inline(always)]
pub(crate) fn gather<T: Lanes, V: Vectors>(
    vectors: V,
    group: usize,
    number: impl Fn(usize) -> T,
) -> Eight<T, V> {
    let mut lanes = Lane8::zero();
    for n in 0..GROUP {
        lanes.0[n] = number(group * GROUP + n);
    }
    Eight { lanes, vectors }
}

struct Compute<'a, T, const D: usize> {
    own: &'a mut Parallelograms<T, D>,
    c: &'a Constants<T, D>,
    half_edges: &'a HalfEdges<T, D>,
    ids: &'a [usize; BLOCK],
    kinematics: Kinematics<'a, T, D>,
}

impl<T: Lanes, const D: usize> Loop for Compute<'_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { own, c, half_edges, ids, kinematics } = self;
        for group in 0..BLOCK / GROUP {
            let of_group = parallelograms(vectors, c, half_edges, ids, kinematics, group);
            own.take(vectors, c, group, &of_group);
        }
    }
}

/// Centres and half-edges `E[axis][edge]` of the parallelograms of a group of particles, in cells.
pub(crate) struct OfGroup<T, V, const D: usize> {
    pub(crate) xi: [Eight<T, V>; D],
    pub(crate) E: [[Eight<T, V>; D]; D],
}

/// The parallelograms that F makes of those with these half-edges.
#[inline(always)]
pub(crate) fn parallelograms<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    c: &Constants<T, D>,
    half_edges: &HalfEdges<T, D>,
    ids: &[usize; BLOCK],
    Kinematics { x, F }: Kinematics<'_, T, D>,
    group: usize,
) -> OfGroup<T, V, D> {
    let per_cell = Eight { lanes: vectors.splat8(c.inverse_spacing), vectors };
    let mut xi = [per_cell; D];
    let (mut of_F, mut own) = ([[per_cell; D]; D], [[per_cell; D]; D]);
    for i in 0..D {
        xi[i] = gather(vectors, group, |k| x[k][i] - c.lower[i]) * per_cell;
        for j in 0..D {
            of_F[i][j] = gather(vectors, group, |k| F[k][(i, j)]);
            own[i][j] = match half_edges {
                HalfEdges::Same(E) => Eight { lanes: vectors.splat8(E[(i, j)]), vectors },
                HalfEdges::Each(E) => gather(vectors, group, |k| E[ids[k]][(i, j)]),
            };
        }
    }
    OfGroup { xi, E: deformed(&of_F, &own, per_cell) }
}

/// The weights of a group of particles with small domains at the nodes that they reach, axis 0 fastest; `[node].0[n]` is of the
/// group's particle `n`.
struct GroupWeights<T, const D: usize> {
    S: [Lane8<T>; MOST_REACHED],
    /// `H_a` for each axis.
    H: [[Lane8<T>; MOST_REACHED]; D],
    /// How many nodes the group reaches along each axis: two where all its domains lie within one cell.
    reached: [usize; D],
    /// Hat functions of the nodes along each axis at each corner.
    hats: [[[Lane8<T>; REACHED]; D]; MOST_CORNERS],
    /// Their products over the axes from 1 on, for a row of nodes.
    of_row: [Lane8<T>; MOST_CORNERS],
    /// The rows of nodes along axis 0 that the group reaches, and how many.
    rows: [Row; MOST_REACHED / REACHED],
    row_count: usize,
}

/// A row of nodes along axis 0.
#[derive(Clone, Copy)]
struct Row {
    /// Where it begins, from the first node of a particle on.
    start: usize,
    /// Its place along each axis.
    place: [usize; 3],
}

impl<T: Lanes, const D: usize> GroupWeights<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = Lane8::zero();
        Self {
            S: [zero; MOST_REACHED],
            H: [[zero; MOST_REACHED]; D],
            reached: [REACHED; D],
            hats: [[[zero; REACHED]; D]; MOST_CORNERS],
            of_row: [zero; MOST_CORNERS],
            rows: [Row { start: 0, place: [0; 3] }; MOST_REACHED / REACHED],
            row_count: 0,
        }
    }

    #[inline(always)]
    fn compute<V: Vectors>(
        &mut self,
        vectors: V,
        own: &Parallelograms<T, D>,
        strides: &[usize; D],
        group: usize,
    ) {
        let (none, one) = (vectors.splat8(T::zero()), vectors.splat8(T::one()));
        let share = vectors.splat8(real(1.0 / f64::from(1 << D)));
        let mut reach = [none; D];
        for corner in 0..1 << D {
            for a in 0..D {
                let at = own.at[corner][a][group];
                reach[a] = vectors.max8(at, reach[a]);
                let first = vectors.max8(vectors.sub8(one, at), none);
                let last = vectors.max8(vectors.sub8(at, one), none);
                self.hats[corner][a] = [first, vectors.sub8(vectors.sub8(one, first), last), last];
            }
        }
        for a in 0..D {
            let mut is_within_one = true;
            for n in 0..GROUP {
                is_within_one &= reach[a].0[n] <= T::one();
            }
            self.reached[a] = if is_within_one { REACHED - 1 } else { REACHED };
        }
        // Along axis 1 and along axis 2; one where there is no such axis.
        let [rows, layers] = [1, 2].map(|a| if a < D { self.reached[a] } else { 1 });
        self.row_count = rows * layers;
        for layer in 0..layers {
            for row in 0..rows {
                let mut start = 0;
                for (a, place) in [(1, row), (2, layer)] {
                    start += if a < D { place * strides[a] } else { 0 };
                }
                self.rows[layer * rows + row] = Row { start, place: [0, row, layer] };
            }
        }
        for row in 0..self.row_count {
            let Row { place, .. } = self.rows[row];
            for corner in 0..1 << D {
                let hats = &self.hats[corner];
                self.of_row[corner] = match D {
                    1 => one,
                    2 => hats[1][place[1]],
                    _ => vectors.mul8(hats[1][place[1]], hats[D - 1][place[2]]),
                };
            }
            for i in 0..REACHED {
                // In registers until all corners are done.
                let mut sums = [none; MOST_CORNERS];
                for corner in 0..1 << D {
                    sums[corner] = vectors.mul8(self.of_row[corner], self.hats[corner][0][i]);
                }
                let node = row * REACHED + i;
                for a in 0..D {
                    self.H[a][node] = fold(vectors, &mut sums, 1 << (D - 1 - a));
                }
                self.S[node] = vectors.mul8(sums[0], share);
            }
        }
    }
}

/// Makes of so many pairs of values at corners, along the first axis that is left, their sums; gives the sum of their differences.
#[inline(always)]
fn fold<T: Lanes, V: Vectors>(
    vectors: V,
    values: &mut [Lane8<T>; MOST_CORNERS],
    pairs: usize,
) -> Lane8<T> {
    let mut total = Lane8::zero();
    for pair in 0..pairs {
        let (lower, upper) = (values[2 * pair], values[2 * pair + 1]);
        let difference = vectors.sub8(upper, lower);
        total = if pair == 0 { difference } else { vectors.add8(total, difference) };
        values[pair] = vectors.add8(lower, upper);
    }
    total
}

struct P2g<'a, T, const D: usize, const AFFINE: bool>(P2gOfBlock<'a, T, D>);

struct P2gOfBlock<'a, T, const D: usize> {
    own: &'a Parallelograms<T, D>,
    weights: &'a mut GroupWeights<T, D>,
    strides: &'a [usize; D],
    band: &'a mut [Node<T, D>],
    first: usize,
    contributions: &'a Contributions<T, D, BLOCK>,
    count: usize,
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for P2g<'_, T, D, AFFINE> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let P2gOfBlock { own, weights, strides, band, first, contributions, count } = self.0;
        let count = count.min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, own, strides, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                if !own.is_small[k] {
                    p2g_from_corners::<T, D, AFFINE>(own, strides, band, first, (contributions, k));
                    continue;
                }
                let value = vectors.load8(&contributions.value[k].values);
                let mut fluxes = [Lane8::zero(); D];
                // What affine velocities add at each place along each axis.
                let mut along = [[Lane8::zero(); REACHED]; D];
                // What goes by `G_i` along the axes goes by `H_a` here.
                for axis in 0..D {
                    let flux = contributions.slope_lanes(k, axis, false);
                    for a in 0..D {
                        let g = vectors.splat8(own.g[axis][a][group].0[n]);
                        fluxes[a] = vectors.mul_add8(flux, g, fluxes[a]);
                    }
                    if AFFINE {
                        let affine = contributions.affine_lanes(k, axis);
                        for (place, added) in along[axis].iter_mut().enumerate() {
                            let arm = vectors.splat8(own.arm(k, axis, place));
                            *added = vectors.mul8(affine, arm);
                        }
                    }
                }
                let start = own.first_node[k] - first;
                for row in 0..weights.row_count {
                    let Row { start: from_first, place } = weights.rows[row];
                    let nodes = band.get_mut(start + from_first..);
                    let Some(nodes) = nodes.and_then(|n| n.first_chunk_mut::<REACHED>()) else {
                        beyond("a domain beyond its band")
                    };
                    let mut of_row = value;
                    if AFFINE {
                        for a in 1..D {
                            of_row = vectors.add8(of_row, along[a][place[a]]);
                        }
                    }
                    for (i, Node { values }) in nodes.iter_mut().enumerate() {
                        let node = row * REACHED + i;
                        let of_node =
                            if AFFINE { vectors.add8(of_row, along[0][i]) } else { of_row };
                        // The sum is needed last: that of the particle before is on its way through memory.
                        let S = vectors.splat8(weights.S[node].0[n]);
                        let mut given = vectors.mul8(of_node, S);
                        for a in 0..D {
                            let H = vectors.splat8(weights.H[a][node].0[n]);
                            given = vectors.mul_add8(fluxes[a], H, given);
                        }
                        *values = vectors.add8(vectors.load8(values), given).0;
                    }
                }
            }
        }
    }
}

struct G2p<'a, T, const D: usize, const AFFINE: bool>(G2pOfBlock<'a, T, D>);

struct G2pOfBlock<'a, T, const D: usize> {
    own: &'a Parallelograms<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    receiver: &'a mut [Interpolated<T, D>],
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for G2p<'_, T, D, AFFINE> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let G2pOfBlock { own, strides, nodes, receiver } = self.0;
        let count = receiver.len().min(BLOCK);
        let mut cells = CellsOfCorners::zero();
        for group in 0..count.div_ceil(GROUP) {
            cells.take(vectors, own, strides, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                let mut at_corners = [Lane8::zero(); MOST_CORNERS];
                let mut moments = [Lane8::zero(); D];
                for corner in 0..1 << D {
                    let start = own.first_node[k] + cells.start[corner][n];
                    let Some(values) = corners_of_cell(vectors, strides, nodes, start) else {
                        beyond("a domain beyond the grid")
                    };
                    let mut r = [Lane8::zero(); D];
                    for a in 0..D {
                        r[a] = vectors.splat8(cells.r[corner][a].0[n]);
                    }
                    let Linear { value, slopes } = Linear::new::<V, AFFINE>(vectors, values, &r);
                    at_corners[corner] = value;
                    if AFFINE {
                        for a in 0..D {
                            let variance = vectors.splat8(cells.variance[corner][a].0[n]);
                            moments[a] = vectors.mul_add8(slopes[a], variance, moments[a]);
                        }
                    }
                }
                let mut slopes = [Lane8::zero(); D];
                for a in 0..D {
                    slopes[a] = fold(vectors, &mut at_corners, 1 << (D - 1 - a));
                }
                if AFFINE {
                    // The arms of corners are sums of half-edges.
                    for a in 0..D {
                        for edge in 0..D {
                            let E = vectors.splat8(own.E[a][edge][group].0[n]);
                            moments[a] = vectors.mul_add8(slopes[edge], E, moments[a]);
                        }
                    }
                }
                let sums = Sums { value: at_corners[0], slopes, moments };
                receiver[k] = sums.interpolated::<V, AFFINE>(vectors, own, &cells, k);
            }
        }
    }
}

/// The cells of the grid in which the corners of a group of parallelograms are; `.0[n]` is of the group's particle `n`.
struct CellsOfCorners<T, const D: usize> {
    /// The lowest node of the cell, from the particle's first node on.
    start: [[usize; GROUP]; MOST_CORNERS],
    /// Where in the cell the corner is.
    r: [[Lane8<T>; D]; MOST_CORNERS],
    /// `sum N_i arm^2` of the hat functions along each axis.
    variance: [[Lane8<T>; D]; MOST_CORNERS],
    /// The inverse of the inertia `sum S arm arm` about the centre; valid where there are affine velocities.
    inverse_inertia: [[Lane8<T>; D]; D],
}

impl<T: Lanes, const D: usize> CellsOfCorners<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = [[Lane8::zero(); D]; MOST_CORNERS];
        let inverse_inertia = [[Lane8::zero(); D]; D];
        Self { start: [[0; GROUP]; MOST_CORNERS], r: zero, variance: zero, inverse_inertia }
    }

    #[inline(always)]
    fn take<V: Vectors>(
        &mut self,
        vectors: V,
        own: &Parallelograms<T, D>,
        strides: &[usize; D],
        group: usize,
    ) {
        let [none, half, one] = [0.0, 0.5, 1.0].map(|number| vectors.splat8(real(number)));
        // What is added to it is rounded to a whole number.
        let whole = vectors.splat8(real::<T>(1.5) / T::default_epsilon());
        for corner in 0..1 << D {
            let mut start = [0.0; GROUP];
            for a in 0..D {
                // The least corner may be below its node by rounding.
                let at = vectors.max8(own.at[corner][a][group], none);
                let below = vectors.sub8(vectors.add8(vectors.sub8(at, half), whole), whole);
                let r = vectors.sub8(at, below);
                self.r[corner][a] = r;
                self.variance[corner][a] = vectors.mul8(r, vectors.sub8(one, r));
                for n in 0..GROUP {
                    let below = nalgebra::convert_unchecked::<T, f64>(below.0[n]);
                    start[n] += below * strides[a] as f64;
                }
            }
            for n in 0..GROUP {
                self.start[corner][n] = index(start[n]);
            }
        }
        if own.is_affine {
            let inverse = inverse(&self.inertia(vectors, own, group));
            for a in 0..D {
                for b in 0..D {
                    self.inverse_inertia[a][b] = inverse[a][b].lanes;
                }
            }
        }
    }

    /// The inertia `sum S arm arm` about the centres, in cells: of the corners its own, `E E^T`, and that of the hat functions around
    /// each.
    #[inline(always)]
    fn inertia<V: Vectors>(
        &self,
        vectors: V,
        own: &Parallelograms<T, D>,
        group: usize,
    ) -> [[Eight<T, V>; D]; D] {
        let share = vectors.splat8(real(1.0 / f64::from(1 << D)));
        let mut inertia = [[Eight { lanes: Lane8::zero(), vectors }; D]; D];
        for a in 0..D {
            for corner in 0..1 << D {
                let of_hats = &mut inertia[a][a].lanes;
                *of_hats = vectors.mul_add8(share, self.variance[corner][a], *of_hats);
            }
            for b in 0..D {
                for edge in 0..D {
                    let (E_a, E_b) = (own.E[a][edge][group], own.E[b][edge][group]);
                    inertia[a][b].lanes = vectors.mul_add8(E_a, E_b, inertia[a][b].lanes);
                }
            }
        }
        inertia
    }
}

/// The values at the nodes of a cell, axis 0 fastest; `None` beyond the grid.
#[inline(always)]
fn corners_of_cell<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    start: usize,
) -> Option<[Lane8<T>; MOST_CORNERS]> {
    let mut values = [Lane8::zero(); MOST_CORNERS];
    for row in 0..1 << (D - 1) {
        let start = start_of_row(strides, start, row);
        let [lower, upper] = nodes.get(start..)?.first_chunk::<2>()?;
        values[2 * row] = vectors.load8(&lower.values);
        values[2 * row + 1] = vectors.load8(&upper.values);
    }
    Some(values)
}

/// A value that is linear along each axis of a cell, and its slopes; those only where they are asked for.
struct Linear<T, const D: usize> {
    value: Lane8<T>,
    slopes: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Linear<T, D> {
    /// At the place `r` in a cell with these values at its nodes.
    #[inline(always)]
    fn new<V: Vectors, const SLOPES: bool>(
        vectors: V,
        mut values: [Lane8<T>; MOST_CORNERS],
        r: &[Lane8<T>; D],
    ) -> Self {
        let mut slopes = [[Lane8::zero(); MOST_CORNERS / 2]; D];
        for a in 0..D {
            for pair in 0..1 << (D - 1 - a) {
                let (lower, upper) = (values[2 * pair], values[2 * pair + 1]);
                let along = vectors.sub8(upper, lower);
                values[pair] = vectors.mul_add8(along, r[a], lower);
                if SLOPES {
                    slopes[a][pair] = along;
                    for b in 0..a {
                        let (lower, upper) = (slopes[b][2 * pair], slopes[b][2 * pair + 1]);
                        let along = vectors.sub8(upper, lower);
                        slopes[b][pair] = vectors.mul_add8(along, r[a], lower);
                    }
                }
            }
        }
        Self { value: values[0], slopes: slopes.map(|of_axis| of_axis[0]) }
    }
}

/// The term of one corner of a particle and one of the nodes around that corner, in P2G or G2P.
#[derive(Clone, Copy)]
struct Place<T, const D: usize> {
    corner: usize,
    /// Index of the node, from the particle's first on.
    node: usize,
    /// The hat function of the node at the corner.
    hat: T,
    /// From the centre of the domain to the node, in cells; valid where there are affine velocities.
    arm: [T; D],
}

impl<T: Lanes, const D: usize> Parallelograms<T, D> {
    /// Calls `visit` for each node around each corner of a particle.
    fn for_nodes(&self, strides: &[usize; D], k: usize, mut visit: impl FnMut(Place<T, D>)) {
        for corner in 0..1 << D {
            let at: [T; D] = array::from_fn(|a| self.at[corner][a][k / GROUP].0[k % GROUP]);
            for far in 0..1 << D {
                let mut place = Place { corner, node: 0, hat: T::one(), arm: [T::zero(); D] };
                for a in 0..D {
                    let below = at[a].floor();
                    let (r, is_far) = (at[a] - below, far >> a & 1);
                    place.hat *= if is_far == 1 { r } else { T::one() - r };
                    let node = below + real(is_far as f64);
                    place.arm[a] = node - self.centre[a][k / GROUP].0[k % GROUP];
                    let layer = nalgebra::try_convert::<T, f64>(node).unwrap_or(0.0);
                    place.node += layer as usize * strides[a];
                }
                visit(place);
            }
        }
    }

    /// The share of a mean gradient along an axis that a corner has, per cell.
    fn gradient_share(&self, corner: usize, axis: usize, k: usize) -> T {
        (0..D).fold(T::zero(), |sum, a| {
            let g = self.g[axis][a][k / GROUP].0[k % GROUP];
            if is_upper(corner, a) { sum + g } else { sum - g }
        })
    }

    /// From the centre of a particle's domain to a node along an axis, in cells.
    #[inline(always)]
    fn arm(&self, k: usize, axis: usize, place: usize) -> T {
        real::<T>(place as f64) - self.centre[axis][k / GROUP].0[k % GROUP]
    }
}

/// The sums of G2P over corners, with all numbers of a node.
struct Sums<T, const D: usize> {
    value: Lane8<T>,
    /// By `H_a`.
    slopes: [Lane8<T>; D],
    /// Sums of values times the arms along each axis.
    moments: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Sums<T, D> {
    /// The result for particle `k`.
    #[inline(always)]
    fn interpolated<V: Vectors, const AFFINE: bool>(
        &self,
        vectors: V,
        own: &Parallelograms<T, D>,
        cells: &CellsOfCorners<T, D>,
        k: usize,
    ) -> Interpolated<T, D> {
        let (group, n) = (k / GROUP, k % GROUP);
        let share = real(1.0 / f64::from(1 << D));
        let value = vectors.mul8(self.value, vectors.splat8(share));
        let mut result = Interpolated::zero();
        for i in 0..D {
            (result.velocity[i], result.second[i]) = (value.0[i], value.0[D + i]);
        }
        for j in 0..D {
            let (mut slope, mut affine) = (Lane8::zero(), Lane8::zero());
            for a in 0..D {
                let g = vectors.splat8(own.g[j][a][group].0[n]);
                slope = vectors.mul_add8(self.slopes[a], g, slope);
                if AFFINE {
                    let inverse = vectors.splat8(cells.inverse_inertia[a][j].0[n] * share);
                    affine = vectors.mul_add8(self.moments[a], inverse, affine);
                }
            }
            for i in 0..D {
                result.velocity_gradient[(i, j)] = slope.0[i];
                if AFFINE {
                    result.affine[(i, j)] = affine.0[D + i];
                }
            }
        }
        result
    }
}

/// P2G of particle `k`, whose domain need not be small.
#[inline(never)]
fn p2g_from_corners<T: Lanes, const D: usize, const AFFINE: bool>(
    own: &Parallelograms<T, D>,
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    (contributions, k): (&Contributions<T, D, BLOCK>, usize),
) {
    let start = own.first_node[k] - first;
    let value = contributions.value[k].values;
    let fluxes: [_; D] = array::from_fn(|a| contributions.slope_lanes(k, a, false).0);
    let affine: [_; D] = array::from_fn(|a| contributions.affine_lanes(k, a).0);
    own.for_nodes(strides, k, |Place { corner, node, hat, arm }| {
        let Some(Node { values }) = band.get_mut(start + node) else {
            beyond("a corner beyond its band")
        };
        let w = hat * real(1.0 / f64::from(1 << D));
        for (q, sum) in values.iter_mut().enumerate() {
            let mut given = value[q];
            for a in 0..D {
                *sum += fluxes[a][q] * (own.gradient_share(corner, a, k) * hat);
                if AFFINE {
                    given += affine[a][q] * arm[a];
                }
            }
            *sum += given * w;
        }
    });
}
