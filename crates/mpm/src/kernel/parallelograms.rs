//! P2G and G2P of CPDI, whose weights are means over parallelograms.
//!
//! With half-edges `E` the corners of a parallelogram are `x_c = x + E s_c`, `s_a` of -1 and 1, and a weight and its gradient
//!
//! ```text
//! S_i = H_0 / 2^D,  G_i = sum_a g_a H_a,  g = E^-T / 2^D;   H_0 = sum_c N_i(x_c),  H_a = sum_c s_a N_i(x_c)
//! ```
//!
//! The sums `H` are computed for eight particles at once. Most domains lie within two cells along each axis, and reach 3 nodes; the others
//! go from corner to corner, one particle at a time.

use std::array;

use nalgebra::SMatrix;

use crate::domain::{
    HalfEdges, MOST_CORNERS, REACHED, corner_of_parallelogram, deformed, inverse, is_upper,
    slopes_of_parallelogram,
};
use crate::geometry::Constants;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::node::Node;
use crate::shape_function::{index, node_below};
use crate::simd::{Eight, Lane8, Lanes, Loop, Number, Vectors, dispatch};
use crate::tensor::{product, real};

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
    /// The inverse of the inertia `sum S arm arm` about the centre; valid where `is_affine`.
    inverse_inertia: [[PerParticle<T>; D]; D],
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
            inverse_inertia: [[zero; D]; D],
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
            let inverse = inverse(&inertia(E, &at));
            for a in 0..D {
                for b in 0..D {
                    store(&mut self.inverse_inertia[a][b], group, inverse[a][b]);
                }
            }
        }
    }
}

/// The inertia `sum S arm arm` about the centres, in cells: of the corners its own, `E E^T`, and that of the hat functions around each.
#[inline(always)]
fn inertia<T: Lanes, V: Vectors, const D: usize>(
    E: &[[Eight<T, V>; D]; D],
    at: &[[Eight<T, V>; D]; MOST_CORNERS],
) -> [[Eight<T, V>; D]; D] {
    let (zero, one) = (E[0][0].constant(0.0), E[0][0].constant(1.0));
    let share = zero.constant(1.0 / f64::from(1 << D));
    let mut inertia = [[zero; D]; D];
    for a in 0..D {
        for corner in &at[..1 << D] {
            let mut place = corner[a];
            for n in 0..GROUP {
                place.lanes.0[n] -= place.lanes.0[n].floor();
            }
            inertia[a][a] = inertia[a][a] + share * (place * (one - place));
        }
    }
    for a in 0..D {
        for b in 0..D {
            for edge in 0..D {
                inertia[a][b] = inertia[a][b] + E[a][edge] * E[b][edge];
            }
        }
    }
    inertia
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

    /// Of the parallelograms that F makes of those with these half-edges.
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
        let Self { own, of_group: weights } = self;
        let of_block = G2pOfBlock { own, weights, strides, nodes, receiver };
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
    const WIDE: bool = D > 1;

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
        }
    }

    #[inline(always)]
    fn compute<V: Vectors>(&mut self, vectors: V, own: &Parallelograms<T, D>, group: usize) {
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
        for row in 0..self.rows() {
            let place = self.place(row);
            for corner in 0..1 << D {
                let hats = &self.hats[corner];
                self.of_row[corner] = match D {
                    1 => one,
                    2 => hats[1][place[1]],
                    _ => vectors.mul8(hats[1][place[1]], hats[D - 1][place[D - 1]]),
                };
            }
            for i in 0..REACHED {
                // In registers until all corners are done.
                let mut sums = [none; MOST_CORNERS];
                for corner in 0..1 << D {
                    sums[corner] = vectors.mul8(self.of_row[corner], self.hats[corner][0][i]);
                }
                let node = row * REACHED + i;
                // Sums and differences of pairs along one axis, then of their sums along the next.
                for a in 0..D {
                    let pairs = 1 << (D - 1 - a);
                    let mut H = none;
                    for pair in 0..pairs {
                        let (lower, upper) = (sums[2 * pair], sums[2 * pair + 1]);
                        let difference = vectors.sub8(upper, lower);
                        H = if pair == 0 { difference } else { vectors.add8(H, difference) };
                        sums[pair] = vectors.add8(lower, upper);
                    }
                    self.H[a][node] = H;
                }
                self.S[node] = vectors.mul8(sums[0], share);
            }
        }
    }

    /// How many rows of nodes along axis 0 the group reaches.
    #[inline(always)]
    fn rows(&self) -> usize {
        let mut rows = 1;
        for a in 1..D {
            rows *= self.reached[a];
        }
        rows
    }

    /// The place of a row along each axis from 1 on.
    #[inline(always)]
    fn place(&self, row: usize) -> [usize; D] {
        let mut place = [0; D];
        if D == 2 {
            place[1] = row;
        }
        if D == 3 {
            let is_wide = self.reached[1] == REACHED;
            place[1] = if is_wide { row % REACHED } else { row % (REACHED - 1) };
            place[D - 1] = if is_wide { row / REACHED } else { row / (REACHED - 1) };
        }
        place
    }

    /// Where the row at a place begins, after the first node.
    #[inline(always)]
    fn start(strides: &[usize; D], place: &[usize; D]) -> usize {
        let mut start = 0;
        for a in 1..D {
            start += place[a] * strides[a];
        }
        start
    }
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
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let P2gOfBlock { own, weights, strides, band, first, contributions, count } = self.0;
        let count = count.min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, own, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                if !own.is_small[k] {
                    p2g_from_corners::<T, D, AFFINE>(own, strides, band, first, (contributions, k));
                    continue;
                }
                let value = vectors.load8(&contributions.value[k].values);
                let mut fluxes = [Lane8::zero(); D];
                let mut affine = [Lane8::zero(); D];
                // What goes by `G_i` along the axes goes by `H_a` here.
                for axis in 0..D {
                    let flux = contributions.slope_lanes(k, axis, false);
                    for a in 0..D {
                        let g = vectors.splat8(own.g[axis][a][group].0[n]);
                        fluxes[a] = vectors.mul_add8(flux, g, fluxes[a]);
                    }
                    if AFFINE {
                        affine[axis] = contributions.affine_lanes(k, axis);
                    }
                }
                let start = own.first_node[k] - first;
                for row in 0..weights.rows() {
                    let place = weights.place(row);
                    let start = start + GroupWeights::<T, D>::start(strides, &place);
                    let nodes = band.get_mut(start..).and_then(|n| n.first_chunk_mut::<REACHED>());
                    let Some(nodes) = nodes else {
                        debug_assert!(false, "a domain beyond its band");
                        return;
                    };
                    let mut of_row = value;
                    if AFFINE {
                        for a in 1..D {
                            let arm = vectors.splat8(own.arm(k, a, place[a]));
                            of_row = vectors.mul_add8(affine[a], arm, of_row);
                        }
                    }
                    for (i, Node { values }) in nodes.iter_mut().enumerate() {
                        let node = row * REACHED + i;
                        let mut sum = vectors.load8(values);
                        for a in 0..D {
                            let H = vectors.splat8(weights.H[a][node].0[n]);
                            sum = vectors.mul_add8(fluxes[a], H, sum);
                        }
                        let mut of_node = of_row;
                        if AFFINE {
                            of_node = vectors.mul_add8(
                                affine[0],
                                vectors.splat8(own.arm(k, 0, i)),
                                of_row,
                            );
                        }
                        let S = vectors.splat8(weights.S[node].0[n]);
                        *values = vectors.mul_add8(of_node, S, sum).0;
                    }
                }
            }
        }
    }
}

struct G2p<'a, T, const D: usize, const AFFINE: bool>(G2pOfBlock<'a, T, D>);

struct G2pOfBlock<'a, T, const D: usize> {
    own: &'a Parallelograms<T, D>,
    weights: &'a mut GroupWeights<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    receiver: &'a mut [Interpolated<T, D>],
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for G2p<'_, T, D, AFFINE> {
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let G2pOfBlock { own, weights, strides, nodes, receiver } = self.0;
        let count = receiver.len().min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, own, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                if !own.is_small[k] {
                    let sums = g2p_from_corners::<T, D, AFFINE>(own, strides, nodes, k);
                    receiver[k] = sums.interpolated::<AFFINE>(own, k);
                    continue;
                }
                let Sums { mut value, mut slopes, mut moments } = Sums::zero();
                for row in 0..weights.rows() {
                    let place = weights.place(row);
                    let start = own.first_node[k] + GroupWeights::<T, D>::start(strides, &place);
                    let nodes = nodes.get(start..).and_then(|n| n.first_chunk::<REACHED>());
                    let Some(nodes) = nodes else {
                        debug_assert!(false, "a domain beyond the grid");
                        return;
                    };
                    let mut of_row = Lane8::zero();
                    for (i, Node { values }) in nodes.iter().enumerate() {
                        let node = row * REACHED + i;
                        let nodal = vectors.load8(values);
                        let weighted = vectors.mul8(nodal, vectors.splat8(weights.S[node].0[n]));
                        of_row = if i == 0 { weighted } else { vectors.add8(of_row, weighted) };
                        for a in 0..D {
                            let H = vectors.splat8(weights.H[a][node].0[n]);
                            slopes[a] = vectors.mul_add8(nodal, H, slopes[a]);
                        }
                        if AFFINE {
                            let arm = vectors.splat8(own.arm(k, 0, i));
                            moments[0] = vectors.mul_add8(weighted, arm, moments[0]);
                        }
                    }
                    value = if row == 0 { of_row } else { vectors.add8(value, of_row) };
                    if AFFINE {
                        for a in 1..D {
                            let arm = vectors.splat8(own.arm(k, a, place[a]));
                            moments[a] = vectors.mul_add8(of_row, arm, moments[a]);
                        }
                    }
                }
                receiver[k] = Sums { value, slopes, moments }.interpolated::<AFFINE>(own, k);
            }
        }
    }
}

/// What a particle gets or gives at one of its corners, on its way from or to one of the nodes around that.
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

/// The sums of G2P over nodes, with all numbers of a node.
struct Sums<T, const D: usize> {
    value: Lane8<T>,
    /// By `H_a`.
    slopes: [Lane8<T>; D],
    /// Of the values times the arms along each axis.
    moments: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Sums<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = Lane8::zero();
        Self { value: zero, slopes: [zero; D], moments: [zero; D] }
    }

    /// The result for particle `k`.
    #[inline(always)]
    fn interpolated<const AFFINE: bool>(
        &self,
        own: &Parallelograms<T, D>,
        k: usize,
    ) -> Interpolated<T, D> {
        let (group, n) = (k / GROUP, k % GROUP);
        let mut result = Interpolated::zero();
        for i in 0..D {
            (result.velocity[i], result.second[i]) = (self.value.0[i], self.value.0[D + i]);
            for j in 0..D {
                let mut slope = self.slopes[0].0[i] * own.g[j][0][group].0[n];
                for a in 1..D {
                    slope += self.slopes[a].0[i] * own.g[j][a][group].0[n];
                }
                result.velocity_gradient[(i, j)] = slope;
            }
        }
        if AFFINE {
            let (mut moments, mut inverse) = (SMatrix::zeros(), SMatrix::zeros());
            for i in 0..D {
                for j in 0..D {
                    moments[(i, j)] = self.moments[j].0[D + i];
                    inverse[(i, j)] = own.inverse_inertia[i][j][group].0[n];
                }
            }
            result.affine = product(&moments, &inverse);
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
            debug_assert!(false, "a corner beyond its band");
            return;
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

/// G2P of particle `k`, whose domain need not be small.
#[inline(never)]
fn g2p_from_corners<T: Lanes, const D: usize, const AFFINE: bool>(
    own: &Parallelograms<T, D>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    k: usize,
) -> Sums<T, D> {
    let start = own.first_node[k];
    let Sums { mut value, mut slopes, mut moments } = Sums::zero();
    own.for_nodes(strides, k, |Place { corner, node, hat, arm }| {
        let Some(Node { values }) = nodes.get(start + node) else {
            debug_assert!(false, "a corner beyond the grid");
            return;
        };
        let w = hat * real(1.0 / f64::from(1 << D));
        for (q, nodal) in values.iter().enumerate() {
            value.0[q] += *nodal * w;
            for a in 0..D {
                let signed = if is_upper(corner, a) { hat } else { -hat };
                slopes[a].0[q] += *nodal * signed;
                if AFFINE {
                    moments[a].0[q] += *nodal * w * arm[a];
                }
            }
        }
    });
    Sums { value, slopes, moments }
}
