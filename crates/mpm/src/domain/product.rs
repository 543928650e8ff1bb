//! Domains whose weights are products over the axes: points, boxes along the axes, and splines.

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch, is_wide};
use mmsmith_lanes::tensor::{determinant, real};
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::{Domain, OfBlock, Reached};
use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::product::ProductWeights;
use crate::shape::one_axis::{EXTENDED, HALF_SIZE_LIMIT, ProductShape, half_size};

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
    /// By how many nodes an extended support exceeds another.
    more_nodes: T,
}

impl<T: Lanes, const D: usize, const STRETCHING: bool> Boxes<'_, T, D, STRETCHING> {
    #[inline(always)]
    fn half_size(&self, k: usize, a: usize) -> T {
        half_size::<_, STRETCHING>(self.l[a], self.kinematics.F[k][(a, a)]) + self.beyond
    }

    /// Whether a box is in a tile with these edges: by its lower edge, and by the same where that would be for the last node of a box with extended
    /// support.
    #[inline(always)]
    fn is_inside(&self, k: usize, range: &[(f64, f64); D], is_extended: bool) -> bool {
        let Self { c, kinematics: Kinematics { x, .. }, .. } = self;
        let mut is_inside = true;
        for a in 0..D {
            let edge = (x[k][a] - c.lower[a]) * c.inverse_spacing - self.half_size(k, a);
            let last = if is_extended { edge + self.more_nodes } else { edge };
            is_inside &= (edge >= real(range[a].0)) & (last < real(range[a].1));
        }
        is_inside
    }
}

impl<T: Lanes, const D: usize, const STRETCHING: bool> Loop
    for CheckBoxes<'_, '_, T, D, STRETCHING>
{
    const IS_WIDE: bool = is_wide::<T, D>();

    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { of_block, shape, all_valid } = self;
        let OfBlock { c, ids, tiles, kinematics } = of_block;
        let Kinematics { x, F } = kinematics;
        let (width, above) = (shape.width(), shape.extended_above());
        let boxes = Boxes::<_, D, STRETCHING> {
            c,
            kinematics,
            l: &shape.l,
            beyond: real(shape.on_axis().beyond_box()),
            more_nodes: real((EXTENDED - width) as f64),
        };
        let tiles = &tiles[..ids.len().min(BLOCK)];
        let Some((&tile, others)) = tiles.split_first() else { return };
        let range = c.tiles.range(tile, width);
        let (mut all, mut all_inside) = (true, true);
        for k in 0..tiles.len() {
            let mut valid = determinant(&F[k]) > T::zero();
            let mut is_extended = false;
            for a in 0..D {
                let (x, l) = (x[k][a], boxes.half_size(k, a));
                valid &= (x >= c.lower[a]) & (x <= c.upper[a]) & (l <= real(HALF_SIZE_LIMIT));
                is_extended |= l > above;
            }
            all &= valid;
            all_inside &= boxes.is_inside(k, &range, is_extended);
        }
        // Blocks with particles of several tiles are rare.
        if others.iter().any(|other| *other != tile) {
            all_inside = tiles.iter().enumerate().all(|(k, &tile)| {
                let is_extended = (0..D).any(|a| boxes.half_size(k, a) > above);
                boxes.is_inside(k, &c.tiles.range(tile, width), is_extended)
            });
        }
        *all_valid = all && all_inside;
    }
}
