//! Domains whose weights are products over the axes: points, boxes along the axes, and splines.

use mmsmith_lanes::simd::{Eight, Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::{determinant, real};
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::{Domain, OfBlock, Reached};
use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::cpdi::parallelograms::{GROUP, gather};
use crate::kernel::product::ProductWeights;
use crate::shape::cells;
use crate::shape::one_axis::{EXTENDED, HALF_SIZE_LIMIT, LEAST_HALF_SIZE, ProductShape, half_size};

impl<T: Lanes, const D: usize> Domain<T, D> for ProductShape<T, D> {
    fn weights(&self, is_affine: bool) -> Box<dyn BlockWeights<T, D>> {
        Box::new(ProductWeights::new(self, is_affine))
    }

    fn half_size(&self, _: &Constants<T, D>, _: usize, F: &SMatrix<T, D, D>) -> SVector<T, D> {
        SVector::from_fn(|a, _| self.half_size(a, F[(a, a)]))
    }

    fn beyond_box(&self) -> f64 {
        self.on_axis().beyond_box()
    }

    fn exchanges_scalars(&self) -> bool {
        true
    }

    fn most_nodes(&self) -> usize {
        let may_be_extended =
            self.on_axis().stretches() || self.l.iter().any(|&l| l > self.extended_above());
        if may_be_extended { EXTENDED } else { self.width() }
    }

    fn reached(
        &self,
        c: &Constants<T, D>,
        _: usize,
        x: &SVector<T, D>,
        _: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> [Reached<T>; D] {
        let width = self.width_of(l);
        let xi = c.in_cells(x);
        std::array::from_fn(|a| Reached { edge: xi[a] - l[a], width })
    }

    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool {
        let mut all_valid = true;
        let (shape, all) = (self, &mut all_valid);
        if self.on_axis().stretches() {
            dispatch(CheckBoxes::<_, D, true> { of_block, shape, all_valid: all });
        } else {
            dispatch(CheckBoxes::<_, D, false> { of_block, shape, all_valid: all });
        }
        all_valid
    }
}

struct CheckBoxes<'a, 'b, T, const D: usize, const STRETCHING: bool> {
    of_block: OfBlock<'a, T, D>,
    shape: &'a ProductShape<T, D>,
    all_valid: &'b mut bool,
}

/// The boxes of a block. Functions and no closures, which would be compiled without the registers of the loop.
struct Boxes<'a, T, const D: usize, const STRETCHING: bool> {
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
    /// Half-sizes in the reference configuration.
    l: &'a SVector<T, D>,
    /// By how much the support exceeds a box.
    beyond: T,
    /// Half-size beyond which the support is extended.
    extended_above: T,
    /// By how many nodes an extended support exceeds another.
    more_nodes: T,
}

/// Lower edges of boxes along each axis that are in a tile, half-open.
type Range<const D: usize> = [(f64, f64); D];

impl<T: Lanes, const D: usize, const STRETCHING: bool> Boxes<'_, T, D, STRETCHING> {
    /// Half-size of a box, in cells.
    #[inline(always)]
    fn half_size(&self, k: usize, a: usize) -> T {
        half_size::<_, STRETCHING>(self.l[a], self.kinematics.F[k][(a, a)]) + self.beyond
    }

    /// Whether a particle is inside the grid, and its box small and in the tile with these edges: by its lower edge, and by the same where that would
    /// be for the last node of a box with extended support.
    #[inline(always)]
    fn is_valid(&self, k: usize, range: &Range<D>) -> bool {
        let Self { c, kinematics: Kinematics { x, F }, .. } = self;
        let mut is_extended = false;
        for a in 0..D {
            is_extended |= self.half_size(k, a) > self.extended_above;
        }
        let mut is_valid = determinant(&F[k]) > T::zero();
        for a in 0..D {
            let (x, l) = (x[k][a], self.half_size(k, a));
            let edge = (x - c.lower[a]) * c.inverse_spacing - l;
            let last = if is_extended { edge + self.more_nodes } else { edge };
            is_valid &= (x >= c.lower[a]) & (x <= c.upper[a]) & (l <= real(HALF_SIZE_LIMIT));
            is_valid &= (edge >= real(range[a].0)) & (last < real(range[a].1));
        }
        is_valid
    }

    /// Whether all particles of the first groups are seen to be valid in registers, and none has extended support.
    #[inline(always)]
    fn are_plainly_valid<V: Vectors>(&self, vectors: V, groups: usize, range: &Range<D>) -> bool {
        let Self { c, kinematics: Kinematics { x, F }, .. } = self;
        let constant = |value: T| Eight { lanes: vectors.splat8(value), vectors };
        let (zero, one) = (constant(T::zero()), constant(T::one()));
        // The sign of a difference is exact: no slack may be negative, all room has to be positive. Minima leave out what is not a number; the sum
        // of zeros is not a number then.
        let (mut slack, mut room, mut zeros) = (one.lanes, one.lanes, zero.lanes);
        for group in 0..groups {
            let mut lanes_of_F = [[one; D]; D];
            for i in 0..D {
                for j in 0..D {
                    lanes_of_F[i][j] = gather(vectors, group, |k| F[k][(i, j)]);
                }
            }
            let J = cells::determinant(&lanes_of_F);
            room = vectors.min8(room, J.lanes);
            zeros = vectors.mul_add8(J.lanes, zero.lanes, zeros);
            for a in 0..D {
                let mut l = constant(self.l[a]);
                if STRETCHING {
                    l = l * lanes_of_F[a][a];
                    l.lanes = vectors.max8(l.lanes, (zero - l).lanes);
                    l.lanes = vectors.max8(l.lanes, constant(real(LEAST_HALF_SIZE)).lanes);
                }
                l = l + constant(self.beyond);
                let x = gather(vectors, group, |k| x[k][a]);
                let above = x - constant(c.lower[a]);
                let edge = above * constant(c.inverse_spacing) - l;
                zeros = vectors.mul_add8(edge.lanes, zero.lanes, zeros);
                for slack_of in [
                    above,
                    constant(c.upper[a]) - x,
                    constant(self.extended_above) - l,
                    edge - constant(real(range[a].0)),
                ] {
                    slack = vectors.min8(slack, slack_of.lanes);
                }
                room = vectors.min8(room, (constant(real(range[a].1)) - edge).lanes);
            }
        }
        let mut all = true;
        for n in 0..GROUP {
            all &= (slack.0[n] >= T::zero()) & (room.0[n] > T::zero()) & (zeros.0[n] == T::zero());
        }
        all
    }
}

impl<T: Lanes, const D: usize, const STRETCHING: bool> Loop
    for CheckBoxes<'_, '_, T, D, STRETCHING>
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { of_block, shape, all_valid } = self;
        let OfBlock { c, ids, tiles, kinematics } = of_block;
        let width = shape.width();
        let boxes = Boxes::<_, D, STRETCHING> {
            c,
            kinematics,
            l: &shape.l,
            beyond: real(shape.on_axis().beyond_box()),
            extended_above: shape.extended_above(),
            more_nodes: real((EXTENDED - width) as f64),
        };
        let tiles = &tiles[..ids.len().min(BLOCK)];
        let Some((&tile, others)) = tiles.split_first() else { return };
        let range = c.tiles.range(tile, width);
        let mut all = true;
        // Blocks with particles of several tiles are rare.
        if others.iter().any(|other| *other != tile) {
            for (k, &tile) in tiles.iter().enumerate() {
                all &= boxes.is_valid(k, &c.tiles.range(tile, width));
            }
        } else {
            // In space the compiler takes particle after particle, which lasts twice as long.
            let groups = tiles.len() / GROUP;
            let is_seen = D == 3 && boxes.are_plainly_valid(vectors, groups, &range);
            for k in if is_seen { groups * GROUP } else { 0 }..tiles.len() {
                all &= boxes.is_valid(k, &range);
            }
        }
        *all_valid = all;
    }
}
