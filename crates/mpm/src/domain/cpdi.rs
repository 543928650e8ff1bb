//! Domains of CPDI: parallelograms that F carries along.

use std::array;
use std::sync::Arc;

use mmsmith_lanes::simd::{Eight, Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::{product, real};
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::{Domain, OfBlock, Reached};
use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::cpdi::ParallelogramWeights;
use crate::kernel::cpdi::parallelograms::{GROUP, OfGroup, gather, padded, parallelograms};
use crate::shape::cells::{self, HalfEdges, MOST_CORNERS, REACHED, corner_of_parallelogram};
use crate::shape::one_axis::{HALF_SIZE_LIMIT, node_below};
use mmsmith_ranks::Move;

/// Hat functions interpolated between the corners of parallelograms, half of whose edges in the reference configuration are the columns
/// of a matrix, lengths.
#[derive(Debug)]
pub(crate) struct Parallelograms<T, const D: usize> {
    half_edges: Arc<HalfEdges<T, D>>,
}

impl<T: Lanes, const D: usize> Parallelograms<T, D> {
    /// Parallelograms with these half-edges; boxes of these half-sizes where there are none.
    pub(crate) fn new(half_edges: Vec<SMatrix<T, D, D>>, half_size: &SVector<T, D>) -> Self {
        let half_edges = match half_edges.is_empty() {
            true => HalfEdges::Same(SMatrix::from_diagonal(half_size)),
            false => HalfEdges::new(half_edges),
        };
        Self { half_edges: Arc::new(half_edges) }
    }
}

impl<T: Lanes, const D: usize> Domain<T, D> for Parallelograms<T, D> {
    fn weights(&self, is_affine: bool) -> Box<dyn BlockWeights<T, D>> {
        Box::new(ParallelogramWeights::new(self.half_edges.clone(), is_affine))
    }

    fn half_size(&self, c: &Constants<T, D>, p: usize, F: &SMatrix<T, D, D>) -> SVector<T, D> {
        let E = product(F, self.half_edges.of(p));
        SVector::from_fn(|a, _| (0..D).fold(T::zero(), |sum, k| sum + E[(a, k)].abs()))
            * c.inverse_spacing
    }

    fn reached(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        _: &SVector<T, D>,
    ) -> [Reached<T>; D] {
        // The components of the corners, in the operations of `deformed` and `corner_of_parallelogram`.
        let (own, xi) = (self.half_edges.of(p), c.in_cells(x));
        array::from_fn(|along| {
            let edges: [T; D] = array::from_fn(|j| {
                let term = |l: usize| F[(along, l)] * c.inverse_spacing * own[(l, j)];
                (1..D).fold(term(0), |sum, l| sum + term(l))
            });
            Reached::between((0..1_usize << D).map(|corner| {
                edges.iter().enumerate().fold(xi[along], |sum, (a, &edge)| {
                    if corner >> a & 1 == 1 { sum + edge } else { sum - edge }
                })
            }))
        })
    }

    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool {
        let mut all_valid = true;
        let ids = &padded(of_block.ids);
        let (half_edges, all) = (&*self.half_edges, &mut all_valid);
        dispatch(CheckParallelograms { of_block, half_edges, ids, all_valid: all });
        all_valid
    }

    fn follow(&mut self, moved: &Move, before: usize) {
        let each: Vec<_> = (0..before).map(|p| *self.half_edges.of(p)).collect();
        self.half_edges = Arc::new(HalfEdges::new(moved.all(&each)));
    }
}

struct CheckParallelograms<'a, 'b, T, const D: usize> {
    of_block: OfBlock<'a, T, D>,
    half_edges: &'a HalfEdges<T, D>,
    ids: &'a [usize; BLOCK],
    all_valid: &'b mut bool,
}

impl<T: Lanes, const D: usize> Loop for CheckParallelograms<'_, '_, T, D> {
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { of_block, half_edges, ids, all_valid } = self;
        let OfBlock { c, kinematics, ids: checked, .. } = of_block;
        let mut all = true;
        for group in 0..checked.len().div_ceil(GROUP).min(BLOCK / GROUP) {
            let OfGroup { xi, E } = parallelograms(vectors, c, half_edges, ids, kinematics, group);
            let mut corners = [xi; MOST_CORNERS];
            for (corner, at) in corners.iter_mut().enumerate().take(1 << D) {
                *at = corner_of_parallelogram(&xi, &E, corner);
            }
            all &= are_valid(vectors, of_block, group, &corners);
        }
        *all_valid = all;
    }
}

/// Whether all particles of a group are valid: inside the grid, with small domains between these corners, in cells, and in
/// their tiles.
#[inline(always)]
fn are_valid<T: Lanes, V: Vectors, const D: usize>(
    vectors: V,
    of_block: OfBlock<'_, T, D>,
    group: usize,
    corners: &[[Eight<T, V>; D]; MOST_CORNERS],
) -> bool {
    let OfBlock { c, ids, tiles, kinematics: Kinematics { x, F } } = of_block;
    let constant = |value: T| Eight { lanes: vectors.splat8(value), vectors };
    // The sign of a difference is exact: none of these may be negative.
    let mut slack = constant(T::one()).lanes;
    let (mut low, mut high) = (corners[0], corners[0]);
    for a in 0..D {
        for corner in &corners[1..1 << D] {
            low[a].lanes = vectors.min8(low[a].lanes, corner[a].lanes);
            high[a].lanes = vectors.max8(high[a].lanes, corner[a].lanes);
        }
        let x = gather(vectors, group, |k| x[k][a]);
        let above = x - constant(c.lower[a]);
        let xi = above * constant(c.inverse_spacing);
        let small = constant(real(SMALL));
        for slack_of in
            [above, constant(c.upper[a]) - x, small - (xi - low[a]), small - (high[a] - xi)]
        {
            slack = vectors.min8(slack, slack_of.lanes);
        }
    }
    let mut lanes_of_F = [[corners[0][0]; D]; D];
    for i in 0..D {
        for j in 0..D {
            lanes_of_F[i][j] = gather(vectors, group, |k| F[k][(i, j)]);
        }
    }
    let J = cells::determinant(&lanes_of_F).lanes;
    let mut all = true;
    let (mut tile, mut range) = (None, [(0.0, 0.0); D]);
    for n in 0..GROUP {
        let k = group * GROUP + n;
        if tile != Some(tiles[k]) {
            (tile, range) = (Some(tiles[k]), c.tiles.range(tiles[k], REACHED));
        }
        let mut is_valid = (J.0[n] > T::zero()) & (slack.0[n] >= T::zero());
        for a in 0..D {
            let (low, high) = (low[a].lanes.0[n], high[a].lanes.0[n]);
            let nodes = node_below(high).0 - node_below(low).0;
            is_valid &= (nodes <= (REACHED - 2) as f64)
                & (low >= real(range[a].0))
                & (low < real(range[a].1));
        }
        all &= is_valid | (k >= ids.len());
    }
    all
}

/// Half-size of a domain, in cells, that is below [`HALF_SIZE_LIMIT`] however it is rounded.
const SMALL: f64 = HALF_SIZE_LIMIT - 0.125;
