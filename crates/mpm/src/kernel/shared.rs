//! P2G and G2P between particles and the corners that their domains share.
//!
//! Shares of cells are computed for eight particles at once, here and again where they are needed next: that takes less time than to
//! read them from memory. Those of polygons, of which there are few, are stored.

use mmsmith_lanes::simd::{Eight, Lane4, Lane8, Lanes, Loop, Number, Vectors, dispatch, is_wide};
use mmsmith_particles::mesh::{CornerShare, Mesh};
use nalgebra::{SMatrix, SVector};

use crate::domain::corner_values::{AlongAxes, CornerValues};
use crate::domain::shared_corners::SharedCorners;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::any::{Contributions, Interpolated};
use crate::kernel::copies::BLOCK;
use crate::kernel::cpdi::parallelograms::GROUP;
use crate::shape::cells::{MOST_CORNERS, PAIRS, Shares, inverse, shares_of_cell, volume_of_cell};

/// The corners of cells in vector registers: `x[corner][axis]` has those of eight successive cells.
type GroupCorners<T, V, const D: usize> = [[Eight<T, V>; D]; MOST_CORNERS];

/// Takes the corners of eight successive cells, or of fewer and the last of them again, from their places `x`.
///
/// Kernels take those of the next group before they work on one: numbers that are stored one by one can be loaded eight at a time only when all
/// of them have passed through memory.
#[inline(always)]
fn take_corners<T: Lanes, V: Vectors, const D: usize>(
    corners: &SharedCorners<T, D>,
    x: &[SVector<T, D>],
    (first, count): (usize, usize),
    of_group: &mut GroupCorners<T, V, D>,
) {
    if count == 0 {
        return;
    }
    let places = &corners.mesh.corners[first << D..(first + count) << D];
    for n in 0..GROUP {
        let own = &places[n.min(count - 1) << D..][..1 << D];
        for corner in 0..1 << D {
            let at = &x[own[corner] as usize];
            for a in 0..D {
                of_group[corner][a].lanes.0[n] = at[a];
            }
        }
    }
}

/// In space: asks for the memory of the velocities and moments at the corners of the group of cells from `first` on, at those with which a
/// cell ends, since it mostly begins with those of the cell before it. In the plane, and without moments, they come in time.
#[inline(always)]
fn prefetch_moments<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    mesh: &Mesh<T, D>,
    first: usize,
    values: &CornerValues<T, D>,
) {
    if D < 3 {
        return;
    }
    let cells = mesh.corners[(first << D).min(mesh.corners.len())..].chunks_exact(1 << D);
    for own in cells.take(GROUP) {
        for [_, corner] in &PAIRS[..1 << (D - 1)] {
            let corner = own[*corner] as usize;
            vectors.prefetch(&values.nodes[corner]);
            vectors.prefetch(&values.moments[corner]);
        }
    }
}

/// A buffer for the corners of a group.
#[inline(always)]
fn no_corners<T: Lanes, V: Vectors, const D: usize>(vectors: V) -> GroupCorners<T, V, D> {
    [[Eight { lanes: Lane8::zero(), vectors }; D]; MOST_CORNERS]
}

/// Whether so many successive cells have a volume at the end of a step.
pub(crate) fn have_volume_next<T: Lanes, const D: usize>(
    corners: &SharedCorners<T, D>,
    particles: (usize, usize),
) -> bool {
    let mut have_volume = true;
    dispatch(MeasureNext { corners, particles, have_volume: &mut have_volume });
    have_volume
}

struct MeasureNext<'a, 'b, T, const D: usize> {
    corners: &'a SharedCorners<T, D>,
    particles: (usize, usize),
    have_volume: &'b mut bool,
}

impl<T: Lanes, const D: usize> Loop for MeasureNext<'_, '_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { corners, particles: (first, count), have_volume } = self;
        let mut x = no_corners(vectors);
        for group in (0..count).step_by(GROUP) {
            let of_group = (first + group, GROUP.min(count - group));
            take_corners(corners, &corners.next, of_group, &mut x);
            for volume in volume_of_cell(&x).lanes.0 {
                *have_volume &= volume > T::zero();
            }
        }
    }
}

/// A buffer for the shares of a group.
#[inline(always)]
fn none<T: Lanes, V: Vectors, const D: usize>(vectors: V) -> Shares<Eight<T, V>, D> {
    let zero = Eight { lanes: Lane8::zero(), vectors };
    Shares { w: [zero; MOST_CORNERS], g: [[zero; D]; MOST_CORNERS] }
}

/// From the centres of cells to their corners, in cells of the grid.
#[inline(always)]
fn arms<N: Number, const D: usize>(
    x: &[[N; D]; MOST_CORNERS],
    shares: &Shares<N, D>,
    inverse_spacing: N,
) -> [[N; D]; MOST_CORNERS] {
    let mut arms = *x;
    for a in 0..D {
        let mut centre = x[0][a] * shares.w[0];
        for corner in 1..1 << D {
            centre = centre + x[corner][a] * shares.w[corner];
        }
        for corner in 0..1 << D {
            arms[corner][a] = (x[corner][a] - centre) * inverse_spacing;
        }
    }
    arms
}

/// P2G of a block of successive particles, to the sums of their chunk.
pub(crate) struct ToCorners<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) corners: &'a SharedCorners<T, D>,
    /// Where the corners are.
    pub(crate) at: &'a [SVector<T, D>],
    /// The shares of the particles there; empty for cells.
    pub(crate) shares: &'a [CornerShare<T, D>],
    /// The first of the particles, and how many.
    pub(crate) particles: (usize, usize),
    pub(crate) contributions: &'a Contributions<T, D, BLOCK>,
    pub(crate) sums: &'a mut [Node<T, D>],
    /// With affine momenta; else empty.
    pub(crate) affine_sums: &'a mut [AlongAxes<T, D>],
}

impl<T: Lanes, const D: usize> ToCorners<'_, T, D> {
    /// Gives whether all cells have a volume.
    pub(crate) fn add(self) -> bool {
        let mut have_volume = true;
        if self.affine_sums.is_empty() {
            dispatch(Adding::<T, D, false> { given: self, have_volume: &mut have_volume });
        } else {
            dispatch(Adding::<T, D, true> { given: self, have_volume: &mut have_volume });
        }
        have_volume
    }
}

struct Adding<'a, 'b, T, const D: usize, const AFFINE: bool> {
    given: ToCorners<'a, T, D>,
    have_volume: &'b mut bool,
}

/// The flux of a particle to each of its corners.
struct ParticleFlux<T, const D: usize> {
    value: Lane8<T>,
    /// `-V0 tau` along each axis.
    fluxes: [Lane8<T>; D],
    /// The affine momentum per cell along each axis.
    affine: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> ParticleFlux<T, D> {
    #[inline(always)]
    fn new<V: Vectors, const AFFINE: bool>(
        vectors: V,
        contributions: &Contributions<T, D, BLOCK>,
        k: usize,
        spacing: Lane8<T>,
    ) -> Self {
        let zero = [Lane8::zero(); D];
        let value = vectors.load8(&contributions.value[k].values);
        let mut own = Self { value, fluxes: zero, affine: zero };
        for a in 0..D {
            own.fluxes[a] = vectors.mul8(contributions.slope_lanes(k, a, false), spacing);
            if AFFINE {
                own.affine[a] = contributions.affine_lanes(k, a);
            }
        }
        own
    }

    /// Adds it at a corner with these shares, at these arms, to what the corner has.
    #[inline(always)]
    fn add<V: Vectors, const AFFINE: bool>(
        &self,
        vectors: V,
        (w, g, arm): (T, [T; D], [T; D]),
        sum: Lane8<T>,
        affine_sum: Option<&mut AlongAxes<T, D>>,
    ) -> Lane8<T> {
        let w = vectors.splat8(w);
        let mut value = self.value;
        if AFFINE {
            for a in 0..D {
                value = vectors.mul_add8(self.affine[a], vectors.splat8(arm[a]), value);
            }
        }
        let mut own = vectors.mul8(value, w);
        for a in 0..D {
            own = vectors.mul_add8(self.fluxes[a], vectors.splat8(g[a]), own);
        }
        if let (true, Some(affine_sum)) = (AFFINE, affine_sum) {
            let w = vectors.splat(w.0[0]);
            for a in 0..D {
                let mut affine = Lane4::zero();
                for i in 0..D {
                    affine.0[i] = self.affine[a].0[i];
                }
                affine_sum[a] = vectors.mul_add(affine, w, affine_sum[a]);
            }
        }
        vectors.add8(sum, own)
    }
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for Adding<'_, '_, T, D, AFFINE> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let ToCorners { c, corners, at, shares, particles, contributions, sums, affine_sums } =
            self.given;
        let (first, count) = particles;
        let spacing = vectors.splat8(c.spacing());
        let inverse_spacing = Eight { lanes: vectors.splat8(c.inverse_spacing), vectors };
        let mesh = &corners.mesh;
        if !mesh.is_of_cells() {
            let start = mesh.places(first).start;
            for k in 0..count {
                let given = ParticleFlux::new::<V, AFFINE>(vectors, contributions, k, spacing);
                let mut centre = SVector::<T, D>::zeros();
                if AFFINE {
                    for place in mesh.places(first + k) {
                        let x = &at[mesh.corners[place] as usize];
                        centre += x * shares[place - start].w;
                    }
                }
                for place in mesh.places(first + k) {
                    let CornerShare { w, g } = shares[place - start];
                    let x = &at[mesh.corners[place] as usize];
                    let mut arm = [T::zero(); D];
                    for a in 0..D {
                        arm[a] = (x[a] - centre[a]) * c.inverse_spacing;
                    }
                    let sum = corners.sum_at[place] as usize;
                    let known = vectors.load8(&sums[sum].values);
                    let affine_sum = affine_sums.get_mut(sum);
                    sums[sum].values =
                        given.add::<V, AFFINE>(vectors, (w, g, arm), known, affine_sum).0;
                }
            }
            return;
        }
        let mut shares = none(vectors);
        // The sums of corners that the next cell has as well stay in registers: it would wait for them to pass through memory.
        let mut kept = [Lane8::zero(); MOST_CORNERS / 2];
        let of_group = |group: usize| (first + group, GROUP.min(count - group));
        let mut ahead = no_corners(vectors);
        take_corners(corners, at, of_group(0), &mut ahead);
        for group in (0..count).step_by(GROUP) {
            let x = ahead;
            if group + GROUP < count {
                take_corners(corners, at, of_group(group + GROUP), &mut ahead);
            }
            let (_, of_group) = of_group(group);
            let volume = shares_of_cell(&x, &mut shares);
            for volume in volume.lanes.0 {
                *self.have_volume &= volume > T::zero();
            }
            let arms = if AFFINE { Some(arms(&x, &shares, inverse_spacing)) } else { None };
            let sum_at = &corners.sum_at[(first + group) << D..][..of_group << D];
            for n in 0..of_group {
                let given =
                    ParticleFlux::new::<V, AFFINE>(vectors, contributions, group + n, spacing);
                let own_sums = &sum_at[n << D..][..1 << D];
                let k = group + n;
                let shares_face_with_previous =
                    k > 0 && corners.shares_face_with_previous[first + k];
                let next_shares_face =
                    k + 1 < count && corners.shares_face_with_previous[first + k + 1];
                for pair in 0..1 << (D - 1) {
                    for (place, corner) in PAIRS[pair].into_iter().enumerate() {
                        let sum = own_sums[corner] as usize;
                        let (mut g, mut arm) = ([T::zero(); D], [T::zero(); D]);
                        for a in 0..D {
                            g[a] = shares.g[corner][a].lanes.0[n];
                            if let Some(arms) = &arms {
                                arm[a] = arms[corner][a].lanes.0[n];
                            }
                        }
                        let share = (shares.w[corner].lanes.0[n], g, arm);
                        let known = match place == 0 && shares_face_with_previous {
                            true => kept[pair],
                            false => vectors.load8(&sums[sum].values),
                        };
                        let affine_sum = affine_sums.get_mut(sum);
                        let new = given.add::<V, AFFINE>(vectors, share, known, affine_sum);
                        if place == 1 && next_shares_face {
                            kept[pair] = new;
                        } else {
                            sums[sum].values = new.0;
                        }
                    }
                }
            }
        }
    }
}

/// G2P of successive particles, from the values at all corners.
pub(crate) struct FromCorners<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) corners: &'a SharedCorners<T, D>,
    /// The shares of the particles; empty for cells.
    pub(crate) shares: &'a [CornerShare<T, D>],
    pub(crate) values: &'a CornerValues<T, D>,
    /// The first of the particles.
    pub(crate) first: usize,
    pub(crate) receiver: &'a mut [Interpolated<T, D>],
}

impl<T: Lanes, const D: usize> FromCorners<'_, T, D> {
    /// With affine velocities or without. Those of polygons are the gradients of the second vector: values at corners do not tell the
    /// inertia of the weights at nodes.
    pub(crate) fn interpolate(self, is_affine: bool) {
        if is_affine {
            dispatch(Interpolating::<T, D, true>(self));
        } else {
            dispatch(Interpolating::<T, D, false>(self));
        }
    }
}

struct Interpolating<'a, T, const D: usize, const AFFINE: bool>(FromCorners<'a, T, D>);

/// Values of corners over a particle, and their slopes along each axis.
struct InterpolatedValue<T, const D: usize> {
    value: Lane8<T>,
    slopes: [Lane8<T>; D],
}

impl<T: Lanes, const D: usize> InterpolatedValue<T, D> {
    #[inline(always)]
    fn zero() -> Self {
        Self { value: Lane8::zero(), slopes: [Lane8::zero(); D] }
    }

    /// Adds a corner with these shares. Products that make up a value are rounded before they are added, as in all kernels.
    #[inline(always)]
    fn add<V: Vectors>(&mut self, vectors: V, node: Lane8<T>, w: T, g: [T; D]) {
        self.value = vectors.add8(self.value, vectors.mul8(node, vectors.splat8(w)));
        for a in 0..D {
            self.slopes[a] = vectors.mul_add8(node, vectors.splat8(g[a]), self.slopes[a]);
        }
    }

    #[inline(always)]
    fn store(&self, spacing: T, own: &mut Interpolated<T, D>) {
        for i in 0..D {
            (own.velocity[i], own.second[i]) =
                (self.value.0[i], self.value.0[Node::<T, D>::SECOND + i]);
            for a in 0..D {
                own.velocity_gradient[(i, a)] = self.slopes[a].0[i] * spacing;
            }
        }
    }
}

impl<T: Lanes, const D: usize, const AFFINE: bool> Loop for Interpolating<'_, T, D, AFFINE> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let FromCorners { c, corners, shares, values, first, receiver } = self.0;
        let spacing = c.spacing();
        let mesh = &corners.mesh;
        if !mesh.is_of_cells() {
            let start = mesh.places(first).start;
            for (k, own) in receiver.iter_mut().enumerate() {
                let mut over = InterpolatedValue::zero();
                for place in mesh.places(first + k) {
                    let CornerShare { w, g } = shares[place - start];
                    let node = &values.nodes[mesh.corners[place] as usize];
                    over.add(vectors, vectors.load8(&node.values), w, g);
                }
                over.store(spacing, own);
                if AFFINE {
                    for a in 0..D {
                        for i in 0..D {
                            own.affine[(i, a)] =
                                over.slopes[a].0[Node::<T, D>::SECOND + i] * spacing;
                        }
                    }
                }
            }
            return;
        }
        let count = receiver.len();
        let of_group = |group: usize| (first + group, GROUP.min(count - group));
        let (mut ahead, mut shares) = (no_corners(vectors), none(vectors));
        take_corners(corners, &mesh.x, of_group(0), &mut ahead);
        for (group, receiver) in receiver.chunks_mut(GROUP).enumerate() {
            let (x, next) = (ahead, (group + 1) * GROUP);
            if AFFINE {
                prefetch_moments(vectors, mesh, first + next, values);
            }
            if next < count {
                take_corners(corners, &mesh.x, of_group(next), &mut ahead);
            }
            let particles = of_group(group * GROUP);
            shares_of_cell(&x, &mut shares);
            let of_affine = if AFFINE { Some(OfAffine::new(c, &x, &shares)) } else { None };
            let corners = &mesh.corners[particles.0 << D..][..particles.1 << D];
            for (n, own) in receiver.iter_mut().enumerate() {
                let own_corners = &corners[n << D..][..1 << D];
                let mut over = InterpolatedValue::zero();
                for corner in 0..1 << D {
                    let node = &values.nodes[own_corners[corner] as usize];
                    let mut g = [T::zero(); D];
                    for a in 0..D {
                        g[a] = shares.g[corner][a].lanes.0[n];
                    }
                    let w = shares.w[corner].lanes.0[n];
                    over.add(vectors, vectors.load8(&node.values), w, g);
                }
                over.store(spacing, own);
                if let Some(of_affine) = &of_affine {
                    own.affine = of_affine.velocity(vectors, n, &shares, own_corners, values);
                }
            }
        }
    }
}

/// Affine velocities `B D^-1` of a group of cells. Of the weights `sum_c w_c N_i(x_c)` at nodes the moments
/// `B = sum v S arm` and the inertia `D = sum S arm arm` about the centre are those of the corners, with those of the hat functions
/// around each.
struct OfAffine<T, V, const D: usize> {
    /// From the centres to the corners, in cells.
    arms: [[Eight<T, V>; D]; MOST_CORNERS],
    inverse_inertia: [[Eight<T, V>; D]; D],
}

impl<T: Lanes, V: Vectors, const D: usize> OfAffine<T, V, D> {
    #[inline(always)]
    fn new(
        c: &Constants<T, D>,
        x: &[[Eight<T, V>; D]; MOST_CORNERS],
        shares: &Shares<Eight<T, V>, D>,
    ) -> Self {
        let vectors = x[0][0].vectors;
        let constant = |value: T| Eight { lanes: vectors.splat8(value), vectors };
        let (inverse_spacing, one) = (constant(c.inverse_spacing), constant(T::one()));
        let arms = arms(x, shares, inverse_spacing);
        let mut inertia = [[constant(T::zero()); D]; D];
        for corner in 0..1 << D {
            let w = shares.w[corner];
            for a in 0..D {
                let mut place = (x[corner][a] - constant(c.lower[a])) * inverse_spacing;
                for n in 0..GROUP {
                    place.lanes.0[n] -= place.lanes.0[n].floor();
                }
                inertia[a][a] = inertia[a][a] + w * place * (one - place);
                for b in 0..=a {
                    inertia[a][b] = inertia[a][b] + w * (arms[corner][a] * arms[corner][b]);
                }
            }
        }
        for a in 0..D {
            for b in a + 1..D {
                inertia[a][b] = inertia[b][a];
            }
        }
        Self { arms, inverse_inertia: inverse(&inertia) }
    }

    /// The affine velocity per cell of cell `n` of the group.
    #[inline(always)]
    fn velocity(
        &self,
        vectors: V,
        n: usize,
        shares: &Shares<Eight<T, V>, D>,
        corners: &[u32],
        values: &CornerValues<T, D>,
    ) -> SMatrix<T, D, D> {
        let mut moments = [Lane4::zero(); D];
        for corner in 0..1 << D {
            let w = vectors.splat(shares.w[corner].lanes.0[n]);
            let place = corners[corner] as usize;
            let mut v = Lane4::zero();
            for i in 0..D {
                v.0[i] = values.nodes[place].values[i];
            }
            for a in 0..D {
                let arm = vectors.splat(self.arms[corner][a].lanes.0[n]);
                let about = vectors.mul_add(v, arm, values.moments[place][a]);
                moments[a] = vectors.mul_add(about, w, moments[a]);
            }
        }
        let mut affine = SMatrix::zeros();
        for a in 0..D {
            let mut column = Lane4::zero();
            for b in 0..D {
                let inverse = vectors.splat(self.inverse_inertia[b][a].lanes.0[n]);
                column = vectors.mul_add(moments[b], inverse, column);
            }
            for i in 0..D {
                affine[(i, a)] = column.0[i];
            }
        }
        affine
    }
}
