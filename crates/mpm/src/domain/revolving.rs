//! Domains of particles of a body of revolution that may turn about its axis: boxes or points in the half plane through each particle.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use nalgebra::{SMatrix, SVector};

use crate::domain::of_particles::{Domain, OfBlock, Reached};
use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::revolving::{RevolvingWeights, in_half_plane, place};
use crate::shape::one_axis::ProductShape;

/// Domains whose weights are products over radius and height.
#[derive(Debug)]
pub(crate) struct Revolving<T>(pub(crate) ProductShape<T, 2>);

impl<T: Lanes, const D: usize> Domain<T, D> for Revolving<T> {
    fn weights(&self, is_affine: bool) -> Box<dyn BlockWeights<T, D>> {
        Box::new(RevolvingWeights::new(&self.0, is_affine))
    }

    fn half_size(&self, _: &Constants<T, D>, _: usize, F: &SMatrix<T, D, D>) -> SVector<T, D> {
        let F = in_half_plane(F);
        SVector::from_fn(|a, _| match a {
            1 => T::zero(),
            _ => self.0.half_size(a / 2, F[(a / 2, a / 2)]),
        })
    }

    fn beyond_box(&self) -> f64 {
        self.0.on_axis.beyond_box()
    }

    fn most_nodes(&self) -> usize {
        Domain::<T, 2>::most_nodes(&self.0)
    }

    fn reached(
        &self,
        c: &Constants<T, D>,
        _: usize,
        x: &SVector<T, D>,
        _: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> [Reached<T>; D] {
        let width = self.0.width_of(l);
        let xi = c.in_cells(&self.on_grid(c, x));
        std::array::from_fn(|a| Reached { edge: xi[a] - l[a], width })
    }

    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool {
        let OfBlock { c, ids, tiles, kinematics } = of_block;
        let (x, F) = (kinematics.x, kinematics.F);
        ids.iter()
            .enumerate()
            .all(|(k, &p)| self.diagnose(c, p as usize, tiles[k], &x[k], &F[k]).is_clean())
    }

    /// Radius and height, in the middle of the one cell around the axis.
    fn on_grid(&self, c: &Constants<T, D>, x: &SVector<T, D>) -> SVector<T, D> {
        let [radius, height] = place(x).into();
        let middle = c.lower[1 % D] + c.spacing() * real(0.5);
        SVector::from_fn(|a, _| match a {
            0 => radius,
            1 => middle,
            _ => height,
        })
    }
}
