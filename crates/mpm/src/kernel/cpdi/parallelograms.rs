//! The parallelograms of a block of particles: corners, mean gradients and half-edges.

use std::array;

use mmsmith_lanes::simd::{Eight, Lane8, Lanes, Loop, Vectors, is_wide};
use mmsmith_lanes::tensor::real;

use crate::grid::geometry::Constants;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::shape::cells::{
    HalfEdges, MOST_CORNERS, corner_of_parallelogram, deformed, slopes_of_parallelogram,
};
use crate::shape::one_axis::{index, node_below};

/// One number for every particle of a block, `[group].0[n]`; aligned with vector registers.
pub(super) type PerParticle<T> = [Lane8<T>; BLOCK / GROUP];

/// Particles whose weights are computed together.
pub(crate) const GROUP: usize = 8;

/// The parallelograms of a block of particles; `[corner][axis][k]` is of particle `k`.
///
/// All positions are in cells from the first node of the particle, the one below its lowest corner along each axis.
pub(crate) struct Parallelograms<T, const D: usize> {
    /// Whether there are affine velocities (APIC).
    pub(super) is_affine: bool,
    /// Index of the first node.
    pub(super) first_node: [usize; BLOCK],
    /// Whether all corners are within two cells along each axis.
    pub(super) is_small: [bool; BLOCK],
    /// Positions of the corners.
    pub(super) at: [[PerParticle<T>; D]; MOST_CORNERS],
    /// `g[i][a]`, per cell.
    pub(super) g: [[PerParticle<T>; D]; D],
    /// The centre; valid where `is_affine`.
    pub(super) centre: [PerParticle<T>; D],
    /// The half-edges; valid where `is_affine`.
    pub(super) E: [[PerParticle<T>; D]; D],
}

impl<T: Lanes, const D: usize> Parallelograms<T, D> {
    pub(super) fn new(is_affine: bool) -> Self {
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

    /// From the centre of a particle's domain to a node along an axis, in cells.
    #[inline(always)]
    pub(super) fn arm(&self, k: usize, axis: usize, place: usize) -> T {
        real::<T>(place as f64) - self.centre[axis][k / GROUP].0[k % GROUP]
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

pub(super) struct Compute<'a, T, const D: usize> {
    pub(super) own: &'a mut Parallelograms<T, D>,
    pub(super) c: &'a Constants<T, D>,
    pub(super) half_edges: &'a HalfEdges<T, D>,
    pub(super) ids: &'a [usize; BLOCK],
    pub(super) kinematics: Kinematics<'a, T, D>,
}

impl<T: Lanes, const D: usize> Loop for Compute<'_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

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

/// Makes of so many pairs of values at corners, along the first axis that is left, their sums; gives the sum of their differences.
#[inline(always)]
pub(super) fn fold<T: Lanes, V: Vectors>(
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
