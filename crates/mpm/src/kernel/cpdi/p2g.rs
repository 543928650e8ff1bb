//! P2G of CPDI: sums at nodes of the weights of eight particles at once.

use std::array;

use mmsmith_lanes::simd::{Lane8, Lanes, Loop, Vectors, is_wide};
use mmsmith_lanes::tensor::real;

use crate::grid::node::Node;
use crate::kernel::any::Contributions;
use crate::kernel::copies::BLOCK;
use crate::kernel::cpdi::parallelograms::{GROUP, Parallelograms, fold};
use crate::kernel::{beyond, nodes_from_mut};
use crate::shape::cells::{MOST_CORNERS, REACHED, is_upper};

/// Nodes that a domain within two cells reaches in all.
const MOST_REACHED: usize = 27;

/// The weights of a group of particles with small domains at the nodes that they reach, axis 0 fastest; `[node].0[n]` is of the
/// group's particle `n`.
pub(super) struct GroupWeights<T, const D: usize> {
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
    rows: [NodeRow; MOST_REACHED / REACHED],
    row_count: usize,
}

/// A row of nodes along axis 0.
#[derive(Clone, Copy)]
struct NodeRow {
    /// Where it begins, from the first node of a particle on.
    start: usize,
    /// Its place along each axis.
    place: [usize; 3],
}

impl<T: Lanes, const D: usize> GroupWeights<T, D> {
    #[inline(always)]
    pub(super) fn zero() -> Self {
        let zero = Lane8::zero();
        Self {
            S: [zero; MOST_REACHED],
            H: [[zero; MOST_REACHED]; D],
            reached: [REACHED; D],
            hats: [[[zero; REACHED]; D]; MOST_CORNERS],
            of_row: [zero; MOST_CORNERS],
            rows: [NodeRow { start: 0, place: [0; 3] }; MOST_REACHED / REACHED],
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
                self.rows[layer * rows + row] = NodeRow { start, place: [0, row, layer] };
            }
        }
        for row in 0..self.row_count {
            let NodeRow { place, .. } = self.rows[row];
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

pub(super) struct P2g<'a, T, const D: usize, const AFFINE: bool>(pub(super) P2gOfBlock<'a, T, D>);

pub(super) struct P2gOfBlock<'a, T, const D: usize> {
    pub(super) own: &'a Parallelograms<T, D>,
    pub(super) weights: &'a mut GroupWeights<T, D>,
    pub(super) strides: &'a [usize; D],
    pub(super) window: &'a mut [Node<T, D>],
    pub(super) contributions: &'a Contributions<T, D, BLOCK>,
    pub(super) count: usize,
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for P2g<'_, T, D, AFFINE> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let P2gOfBlock { own, weights, strides, window, contributions, count } = self.0;
        let count = count.min(BLOCK);
        for group in 0..count.div_ceil(GROUP) {
            weights.compute(vectors, own, strides, group);
            for n in 0..GROUP.min(count - group * GROUP) {
                let k = group * GROUP + n;
                if !own.is_small[k] {
                    p2g_from_corners::<T, D, AFFINE>(own, strides, window, (contributions, k));
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
                let start = own.first_node[k];
                for row in 0..weights.row_count {
                    let NodeRow { start: from_first, place } = weights.rows[row];
                    let nodes = nodes_from_mut::<_, REACHED>(
                        window,
                        start + from_first,
                        "a domain beyond its window",
                    );
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

/// The term of one corner of a particle and one of the nodes around that corner, in P2G or G2P.
#[derive(Clone, Copy)]
struct NodeTerm<T, const D: usize> {
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
    fn for_nodes(&self, strides: &[usize; D], k: usize, mut visit: impl FnMut(NodeTerm<T, D>)) {
        for corner in 0..1 << D {
            let at: [T; D] = array::from_fn(|a| self.at[corner][a][k / GROUP].0[k % GROUP]);
            for far in 0..1 << D {
                let mut place = NodeTerm { corner, node: 0, hat: T::one(), arm: [T::zero(); D] };
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
}

/// P2G of particle `k`, whose domain need not be small.
#[inline(never)]
fn p2g_from_corners<T: Lanes, const D: usize, const AFFINE: bool>(
    own: &Parallelograms<T, D>,
    strides: &[usize; D],
    window: &mut [Node<T, D>],
    (contributions, k): (&Contributions<T, D, BLOCK>, usize),
) {
    let start = own.first_node[k];
    let value = contributions.value[k].values;
    let fluxes: [_; D] = array::from_fn(|a| contributions.slope_lanes(k, a, false).0);
    let affine: [_; D] = array::from_fn(|a| contributions.affine_lanes(k, a).0);
    own.for_nodes(strides, k, |NodeTerm { corner, node, hat, arm }| {
        let Some(Node { values }) = window.get_mut(start + node) else {
            beyond("a corner beyond its window")
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
