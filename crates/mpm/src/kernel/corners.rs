//! P2G and G2P of CPDI, whose weights are means over parallelograms.
//!
//! Weights are computed for eight particles at once, as sums over the corners. Most domains lie within two cells along each axis,
//! and reach 3 nodes; the others go from corner to corner, one particle at a time.

use std::array;

use nalgebra::SMatrix;

use crate::domain::{
    HalfEdges, MOST_CORNERS, REACHED, Shares, corner_of_parallelogram, deformed, inverse,
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

/// The corners of the domains of a block of particles; `[corner][k]` or `[corner][axis][k]` is of particle `k`.
///
/// All positions are in cells from the first node of the particle, the one below its lowest corner along each axis.
pub(crate) struct Corners<T, const D: usize> {
    /// Whether there are affine velocities (APIC).
    is_affine: bool,
    /// Index of the first node.
    first_node: [usize; BLOCK],
    /// Whether all corners are within two cells along each axis.
    is_small: [bool; BLOCK],
    /// Positions.
    at: [[PerParticle<T>; D]; MOST_CORNERS],
    /// Share of a mean over the domain.
    w: [PerParticle<T>; MOST_CORNERS],
    /// Share of a mean gradient, per cell.
    g: [[PerParticle<T>; D]; MOST_CORNERS],
    /// The domain's centre; valid where `is_affine`.
    centre: [PerParticle<T>; D],
}

impl<T: Lanes, const D: usize> Corners<T, D> {
    pub(crate) fn new(is_affine: bool) -> Self {
        let zero = [Lane8::zero(); BLOCK / GROUP];
        Self {
            is_affine,
            first_node: [0; BLOCK],
            is_small: [true; BLOCK],
            at: [[zero; D]; MOST_CORNERS],
            w: [zero; MOST_CORNERS],
            g: [[zero; D]; MOST_CORNERS],
            centre: [zero; D],
        }
    }

    /// Of the parallelograms that F makes of those with these half-edges.
    pub(crate) fn of_parallelograms(
        &mut self,
        c: &Constants<T, D>,
        half_edges: &HalfEdges<T, D>,
        ids: &[u32],
        kinematics: Kinematics<'_, T, D>,
    ) {
        dispatch(Parallelograms { corners: self, c, half_edges, ids: &padded(ids), kinematics });
    }

    /// Takes the corners of a group, in cells from the lower corner of the grid, and their shares of means.
    #[inline(always)]
    fn take<V: Vectors>(
        &mut self,
        vectors: V,
        c: &Constants<T, D>,
        group: usize,
        at: &[[Eight<T, V>; D]; MOST_CORNERS],
        shares: &Shares<Eight<T, V>, D>,
    ) {
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
                store(&mut self.at[corner][a], group, at[corner][a] - node);
            }
        }
        for corner in 0..1 << D {
            store(&mut self.w[corner], group, shares.w[corner]);
            for a in 0..D {
                store(&mut self.g[corner][a], group, shares.g[corner][a]);
            }
        }
        for n in 0..GROUP {
            self.first_node[group * GROUP + n] = index(first[n]);
            self.is_small[group * GROUP + n] = reach.0[n] <= real(2.0);
        }
        if self.is_affine {
            for a in 0..D {
                let mut centre = load(vectors, &self.at[0][a], group) * shares.w[0];
                for corner in 1..1 << D {
                    centre = centre + load(vectors, &self.at[corner][a], group) * shares.w[corner];
                }
                store(&mut self.centre[a], group, centre);
            }
        }
    }

    /// The inverse of the inertia `sum S arm arm` about the centres, in cells: of each corner its own, and that of the hat functions
    /// around it.
    #[inline(always)]
    fn inverse_inertia<V: Vectors>(&self, vectors: V, group: usize) -> [[Eight<T, V>; D]; D] {
        let zero = Eight { lanes: Lane8::zero(), vectors };
        let mut inertia = [[zero; D]; D];
        for corner in 0..1 << D {
            let w = load(vectors, &self.w[corner], group);
            let mut arms = [zero; D];
            for a in 0..D {
                let at = load(vectors, &self.at[corner][a], group);
                arms[a] = at - load(vectors, &self.centre[a], group);
                let mut place = at;
                for n in 0..GROUP {
                    place.lanes.0[n] -= place.lanes.0[n].floor();
                }
                inertia[a][a] = inertia[a][a] + w * place * (zero.constant(1.0) - place);
            }
            for a in 0..D {
                for b in 0..=a {
                    inertia[a][b] = inertia[a][b] + w * (arms[a] * arms[b]);
                }
            }
        }
        for a in 0..D {
            for b in a + 1..D {
                inertia[a][b] = inertia[b][a];
            }
        }
        inverse(&inertia)
    }
}

/// The weights of a block of particles, and a buffer for those of a group.
pub(crate) struct CornerWeights<T, const D: usize> {
    pub(crate) corners: Corners<T, D>,
    of_group: GroupWeights<T, D>,
}

impl<T: Lanes, const D: usize> CornerWeights<T, D> {
    pub(crate) fn new(is_affine: bool) -> Self {
        Self { corners: Corners::new(is_affine), of_group: GroupWeights::zero() }
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
        let Self { corners, of_group: weights } = self;
        let corners = &*corners;
        if corners.is_affine {
            dispatch(P2g::<_, D, true> {
                corners,
                weights,
                strides,
                band,
                first,
                contributions,
                count,
            });
        } else {
            dispatch(P2g::<_, D, false> {
                corners,
                weights,
                strides,
                band,
                first,
                contributions,
                count,
            });
        }
    }

    /// G2P of the first particles, as many as `receiver` has places.
    pub(crate) fn g2p(
        &mut self,
        strides: &[usize; D],
        nodes: &[Node<T, D>],
        receiver: &mut [Interpolated<T, D>],
    ) {
        let Self { corners, of_group: weights } = self;
        let corners = &*corners;
        if corners.is_affine {
            dispatch(G2p::<_, D, true> { corners, weights, strides, nodes, receiver });
        } else {
            dispatch(G2p::<_, D, false> { corners, weights, strides, nodes, receiver });
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

#[inline(always)]
fn load<T: Lanes, V: Vectors>(vectors: V, array: &PerParticle<T>, group: usize) -> Eight<T, V> {
    Eight { lanes: array[group], vectors }
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

struct Parallelograms<'a, T, const D: usize> {
    corners: &'a mut Corners<T, D>,
    c: &'a Constants<T, D>,
    half_edges: &'a HalfEdges<T, D>,
    ids: &'a [usize; BLOCK],
    kinematics: Kinematics<'a, T, D>,
}

impl<T: Lanes, const D: usize> Loop for Parallelograms<'_, T, D> {
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { corners, c, half_edges, ids, kinematics } = self;
        for group in 0..BLOCK / GROUP {
            let OfGroup { xi, E } = parallelograms(vectors, c, half_edges, ids, kinematics, group);
            let (w, slopes) = slopes_of_parallelogram(&E);
            let mut at = [xi; MOST_CORNERS];
            let mut shares = Shares { w: [w; MOST_CORNERS], g: at };
            for corner in 0..1 << D {
                at[corner] = corner_of_parallelogram(&xi, &E, corner);
                let none = [w.constant(0.0); D];
                shares.g[corner] = corner_of_parallelogram(&none, &slopes, corner);
            }
            corners.take(vectors, c, group, &at, &shares);
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
    /// Gradients per cell along each axis.
    G: [[Lane8<T>; MOST_REACHED]; D],
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
            G: [[zero; MOST_REACHED]; D],
            reached: [REACHED; D],
            hats: [[[zero; REACHED]; D]; MOST_CORNERS],
            of_row: [zero; MOST_CORNERS],
        }
    }

    #[inline(always)]
    fn compute<V: Vectors>(&mut self, vectors: V, corners: &Corners<T, D>, group: usize) {
        let (none, one) = (vectors.splat8(T::zero()), vectors.splat8(T::one()));
        let mut reach = [none; D];
        for corner in 0..1 << D {
            for a in 0..D {
                let at = load(vectors, &corners.at[corner][a], group).lanes;
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
                let (mut S, mut G) = (none, [none; D]);
                for corner in 0..1 << D {
                    let hat = vectors.mul8(self.of_row[corner], self.hats[corner][0][i]);
                    let w = load(vectors, &corners.w[corner], group).lanes;
                    S = vectors.mul_add8(w, hat, S);
                    for a in 0..D {
                        let g = load(vectors, &corners.g[corner][a], group).lanes;
                        G[a] = vectors.mul_add8(g, hat, G[a]);
                    }
                }
                let node = row * REACHED + i;
                self.S[node] = S;
                for a in 0..D {
                    self.G[a][node] = G[a];
                }
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

struct P2g<'a, T, const D: usize, const AFFINE: bool> {
    corners: &'a Corners<T, D>,
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
        let Self { corners, weights, strides, band, first, contributions, count } = self;
        let count = count.min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, corners, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                if !corners.is_small[k] {
                    p2g_from_corners::<T, D, AFFINE>(
                        corners,
                        strides,
                        band,
                        first,
                        (contributions, k),
                    );
                    continue;
                }
                let value = vectors.load8(&contributions.value[k].values);
                let mut fluxes = [Lane8::zero(); D];
                let mut affine = [Lane8::zero(); D];
                for axis in 0..D {
                    fluxes[axis] = contributions.slope_lanes(k, axis, false);
                    if AFFINE {
                        affine[axis] = contributions.affine_lanes(k, axis);
                    }
                }
                let start = corners.first_node[k] - first;
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
                            let arm = vectors.splat8(corners.arm(k, a, place[a]));
                            of_row = vectors.mul_add8(affine[a], arm, of_row);
                        }
                    }
                    for (i, Node { values }) in nodes.iter_mut().enumerate() {
                        let node = row * REACHED + i;
                        let mut sum = vectors.load8(values);
                        for a in 0..D {
                            let G = vectors.splat8(weights.G[a][node].0[n]);
                            sum = vectors.mul_add8(fluxes[a], G, sum);
                        }
                        let mut of_node = of_row;
                        if AFFINE {
                            of_node = vectors.mul_add8(
                                affine[0],
                                vectors.splat8(corners.arm(k, 0, i)),
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

struct G2p<'a, T, const D: usize, const AFFINE: bool> {
    corners: &'a Corners<T, D>,
    weights: &'a mut GroupWeights<T, D>,
    strides: &'a [usize; D],
    nodes: &'a [Node<T, D>],
    receiver: &'a mut [Interpolated<T, D>],
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for G2p<'_, T, D, AFFINE> {
    const WIDE: bool = D > 1;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { corners, weights, strides, nodes, receiver } = self;
        let count = receiver.len().min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, corners, group);
            let mut inverse_inertia = [[Lane8::zero(); D]; D];
            if AFFINE {
                let inverse = corners.inverse_inertia(vectors, group);
                for a in 0..D {
                    for b in 0..D {
                        inverse_inertia[a][b] = inverse[a][b].lanes;
                    }
                }
            }
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                let mut inverse = SMatrix::zeros();
                if AFFINE {
                    for a in 0..D {
                        for b in 0..D {
                            inverse[(a, b)] = inverse_inertia[a][b].0[n];
                        }
                    }
                }
                if !corners.is_small[k] {
                    let sums = g2p_from_corners::<T, D, AFFINE>(corners, strides, nodes, k);
                    receiver[k] = sums.interpolated(AFFINE, &inverse);
                    continue;
                }
                let Sums { mut value, mut gradients, mut moments } = Sums::zero();
                for row in 0..weights.rows() {
                    let place = weights.place(row);
                    let start =
                        corners.first_node[k] + GroupWeights::<T, D>::start(strides, &place);
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
                            let G = vectors.splat8(weights.G[a][node].0[n]);
                            gradients[a] = vectors.mul_add8(nodal, G, gradients[a]);
                        }
                        if AFFINE {
                            let arm = vectors.splat8(corners.arm(k, 0, i));
                            moments[0] = vectors.mul_add8(weighted, arm, moments[0]);
                        }
                    }
                    value = if row == 0 { of_row } else { vectors.add8(value, of_row) };
                    if AFFINE {
                        for a in 1..D {
                            let arm = vectors.splat8(corners.arm(k, a, place[a]));
                            moments[a] = vectors.mul_add8(of_row, arm, moments[a]);
                        }
                    }
                }
                receiver[k] = Sums { value, gradients, moments }.interpolated(AFFINE, &inverse);
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

impl<T: Lanes, const D: usize> Corners<T, D> {
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

    /// From the centre of a particle's domain to a node along an axis, in cells.
    #[inline(always)]
    fn arm(&self, k: usize, axis: usize, place: usize) -> T {
        real::<T>(place as f64) - self.centre[axis][k / GROUP].0[k % GROUP]
    }
}

/// The sums of G2P over nodes, with all numbers of a node.
struct Sums<T, const D: usize> {
    value: Lane8<T>,
    gradients: [Lane8<T>; D],
    /// Of the values times the arms along each axis.
    moments: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> Sums<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        let zero = Lane8::zero();
        Self { value: zero, gradients: [zero; D], moments: [zero; D] }
    }

    /// The result, with the inverse of the inertia where there are affine velocities.
    #[inline(always)]
    fn interpolated(
        &self,
        is_affine: bool,
        inverse_inertia: &SMatrix<T, D, D>,
    ) -> Interpolated<T, D> {
        let mut own = Interpolated::zero();
        let mut moments = SMatrix::zeros();
        for i in 0..D {
            (own.velocity[i], own.second[i]) = (self.value.0[i], self.value.0[D + i]);
            for j in 0..D {
                own.velocity_gradient[(i, j)] = self.gradients[j].0[i];
                moments[(i, j)] = self.moments[j].0[D + i];
            }
        }
        if is_affine {
            own.affine = product(&moments, inverse_inertia);
        }
        own
    }
}

/// P2G of particle `k`, whose domain need not be small.
#[inline(never)]
fn p2g_from_corners<T: Lanes, const D: usize, const AFFINE: bool>(
    corners: &Corners<T, D>,
    strides: &[usize; D],
    band: &mut [Node<T, D>],
    first: usize,
    (contributions, k): (&Contributions<T, D, BLOCK>, usize),
) {
    let start = corners.first_node[k] - first;
    let value = contributions.value[k].values;
    let fluxes: [_; D] = array::from_fn(|a| contributions.slope_lanes(k, a, false).0);
    let affine: [_; D] = array::from_fn(|a| contributions.affine_lanes(k, a).0);
    corners.for_nodes(strides, k, |Place { corner, node, hat, arm }| {
        let Some(Node { values }) = band.get_mut(start + node) else {
            debug_assert!(false, "a corner beyond its band");
            return;
        };
        let w = corners.w[corner][k / GROUP].0[k % GROUP] * hat;
        for (q, sum) in values.iter_mut().enumerate() {
            let mut given = value[q];
            for a in 0..D {
                *sum += fluxes[a][q] * (corners.g[corner][a][k / GROUP].0[k % GROUP] * hat);
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
    corners: &Corners<T, D>,
    strides: &[usize; D],
    nodes: &[Node<T, D>],
    k: usize,
) -> Sums<T, D> {
    let start = corners.first_node[k];
    let Sums { mut value, mut gradients, mut moments } = Sums::zero();
    corners.for_nodes(strides, k, |Place { corner, node, hat, arm }| {
        let Some(Node { values }) = nodes.get(start + node) else {
            debug_assert!(false, "a corner beyond the grid");
            return;
        };
        let w = corners.w[corner][k / GROUP].0[k % GROUP] * hat;
        for (q, nodal) in values.iter().enumerate() {
            value.0[q] += *nodal * w;
            for a in 0..D {
                gradients[a].0[q] += *nodal * (corners.g[corner][a][k / GROUP].0[k % GROUP] * hat);
                if AFFINE {
                    moments[a].0[q] += *nodal * w * arm[a];
                }
            }
        }
    });
    Sums { value, gradients, moments }
}
