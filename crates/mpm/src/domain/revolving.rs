//! Domains of particles of a body of revolution that may turn about its axis: boxes or points in the half plane through each particle.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use nalgebra::{Matrix3, Vector3};

use crate::domain::of_particles::{Domain, OfBlock, Reached};
use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::revolving::{RevolvingWeights, in_half_plane, place};
use crate::shape::one_axis::ProductShape;

/// Domains whose weights are products over radius and height.
#[derive(Debug)]
pub(crate) struct Revolving<T>(pub(crate) ProductShape<T, 2>);

impl<T: Lanes> Domain<T, 3> for Revolving<T> {
    fn weights(&self, is_affine: bool) -> Box<dyn BlockWeights<T, 3>> {
        Box::new(RevolvingWeights::new(&self.0, is_affine))
    }

    fn half_size(&self, _: &Constants<T, 3>, _: usize, F: &Matrix3<T>) -> Vector3<T> {
        let F = in_half_plane(F);
        let [radius, height] = [0, 1].map(|a| self.0.half_size(a, F[(a, a)]));
        Vector3::new(radius, T::zero(), height)
    }

    fn beyond_box(&self) -> f64 {
        self.0.on_axis().beyond_box()
    }

    fn most_nodes(&self) -> usize {
        Domain::<T, 2>::most_nodes(&self.0)
    }

    fn reached(
        &self,
        c: &Constants<T, 3>,
        _: usize,
        x: &Vector3<T>,
        _: &Matrix3<T>,
        l: &Vector3<T>,
    ) -> [Reached<T>; 3] {
        let width = self.0.width_of(l);
        let xi = c.in_cells(&self.on_grid(c, x));
        std::array::from_fn(|a| Reached { edge: xi[a] - l[a], width })
    }

    fn are_valid(&self, of_block: OfBlock<'_, T, 3>) -> bool {
        let OfBlock { c, ids, tiles, kinematics } = of_block;
        let (x, F) = (kinematics.x, kinematics.F);
        ids.iter()
            .enumerate()
            .all(|(k, &p)| self.diagnose(c, p as usize, tiles[k], &x[k], &F[k]).is_clean())
    }

    /// Radius and height, in the middle of the one cell around the axis.
    fn on_grid(&self, c: &Constants<T, 3>, x: &Vector3<T>) -> Vector3<T> {
        let [radius, height] = place(x).into();
        let middle = c.lower[1] + c.spacing() * real(0.5);
        Vector3::new(radius, middle, height)
    }
}
