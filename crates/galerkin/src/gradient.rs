//! Gradients of a field at the particles, Cartesian in all coordinates.

use nalgebra::{SMatrix, SVector};

use super::component::Component;
use super::coordinates::{Coordinates, RowGeometry};

/// A field at the particles, with the geometry that its gradients take.
#[derive(Clone, Copy)]
pub(super) struct Gradients<'a, const D: usize> {
    /// The field, evaluated at the particles.
    pub(super) components: &'a [Component<D>; D],
    pub(super) coordinates: Coordinates,
    /// Particles in a row along axis 0.
    pub(super) row: usize,
    pub(super) rows: &'a [RowGeometry<D>],
    pub(super) reciprocal_radius: &'a [f64],
}

impl<const D: usize> Gradients<'_, D> {
    /// The field's components at particle `p`, in the frame of its row.
    pub(super) fn value(&self, p: usize) -> SVector<f64, D> {
        SVector::from_fn(|i, _| self.components[i].values[p])
    }

    /// The gradient at particle `p`.
    pub(super) fn at(&self, p: usize) -> SMatrix<f64, D, D> {
        let H = SMatrix::from_fn(|i, k| self.components[i].slopes[k][p]);
        let Some(at) = self.rows.get(p / self.row) else { return H };
        let reciprocal_radius = self.reciprocal_radius[p % self.row];
        let H = self.coordinates.gradient(&self.value(p), &H, reciprocal_radius, at);
        at.frame * H * at.frame.transpose()
    }
}
