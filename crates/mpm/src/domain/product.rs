//! Domains whose weights are products over the axes: points, boxes along the axes, and splines.

use mmsmith_lanes::simd::{Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::{determinant, real};
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::{Domain, OfBlock, Rows};
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
        self.on_axis.beyond_box()
    }

    fn rows(
        &self,
        c: &Constants<T, D>,
        _: usize,
        x: &SVector<T, D>,
        _: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> Rows<T> {
        let is_extended = l.iter().any(|&l| l > self.extended_above());
        let width = if is_extended { EXTENDED } else { self.width() };
        Rows { edge: c.in_cells(x)[D - 1] - l[D - 1], width }
    }

    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool {
        let mut all_valid = true;
        let (shape, all) = (self, &mut all_valid);
        if self.on_axis.stretches() {
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

impl<T: Lanes, const D: usize, const STRETCHING: bool> Loop
    for CheckBoxes<'_, '_, T, D, STRETCHING>
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { of_block, shape, all_valid } = self;
        let OfBlock { c, ids, bins, kinematics: Kinematics { x, F } } = of_block;
        let (width, above) = (shape.width(), shape.extended_above());
        let more_rows: T = real((EXTENDED - width) as f64);
        let beyond: T = real(shape.on_axis.beyond_box());
        let half_size =
            |k: usize, a: usize| half_size::<_, STRETCHING>(shape.l[a], F[k][(a, a)]) + beyond;
        // The lower edge, and the same where it would be for the last row of a box with extended support.
        let edges = |k: usize, is_extended: bool| {
            let a = D - 1;
            let edge = (x[k][a] - c.lower[a]) * c.inverse_spacing - half_size(k, a);
            (edge, if is_extended { edge + more_rows } else { edge })
        };
        let is_inside = |(first, end): (f64, f64), (low, high): (T, T)| {
            (low >= real(first)) & (high < real(end))
        };
        let bins = &bins[..ids.len().min(BLOCK)];
        let Some((&bin, others)) = bins.split_first() else { return };
        let range = c.bins.range(bin, width);
        let (mut all, mut all_inside) = (true, true);
        for k in 0..bins.len() {
            let mut valid = determinant(&F[k]) > T::zero();
            let mut is_extended = false;
            for a in 0..D {
                let (x, l) = (x[k][a], half_size(k, a));
                valid &= (x >= c.lower[a]) & (x <= c.upper[a]) & (l <= real(HALF_SIZE_LIMIT));
                is_extended |= l > above;
            }
            all &= valid;
            all_inside &= is_inside(range, edges(k, is_extended));
        }
        // Blocks with particles of several bins are rare.
        if others.iter().any(|other| *other != bin) {
            all_inside = bins.iter().enumerate().all(|(k, &bin)| {
                let is_extended = (0..D).any(|a| half_size(k, a) > above);
                is_inside(c.bins.range(bin, width), edges(k, is_extended))
            });
        }
        *all_valid = all && all_inside;
    }
}
