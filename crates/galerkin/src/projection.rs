//! The projection of values at the particles onto splines of one degree less than those of the displacement, in the mean of squares over
//! the reference volume.

use std::array;

use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_particles::SetupError;

use super::axis::{Axis, End};
use super::basis::{Basis, ValueOrSlope};
use super::component::solve;
use super::fit::Line;
use super::mass::{Band, Mass};
use super::set_up::Grid;

/// Splines of a scalar field, and the matrices of their products.
#[derive(Clone, Debug)]
pub(super) struct Projection<const D: usize> {
    bases: [Basis; D],
    masses: [Mass; D],
    /// Arrays between the axes: particles up to an axis, coefficients after it; the last one holds values at the particles.
    layers: Vec<Vec<f64>>,
    coefficients: Vec<f64>,
    planted: Planted,
}

impl<const D: usize> Projection<D> {
    /// For splines of the displacement of a degree.
    pub(super) fn new(
        grid: &Grid<D>,
        degree: usize,
        lines: &[Line; D],
    ) -> Result<Self, SetupError> {
        let mut along = Vec::with_capacity(D);
        for (k, line) in lines.iter().enumerate() {
            // Nothing is prescribed for a change of volume: at walls it is continued by its mirror image, elsewhere it is free.
            let free = |end: End| if end.is_clamped() { End::FREE } else { end };
            let axis = Axis { ends: grid.axes[k].ends.map(free), ..grid.axes[k] };
            let too_few = SetupError::TooFewCells { axis: k, cells: axis.cells, least: 2 };
            let basis = Basis::new(&axis, degree - 1, false, &line.points).ok_or(too_few)?;
            let mass = Mass::consistent(&axis, 0, &Band::consistent(&basis, &line.weights));
            let singular = SetupError::SingularMass { axis: k, per_cell: grid.per_cell };
            along.push((basis, mass.ok_or(singular)?));
        }
        let bases: [Basis; D] = array::from_fn(|k| along[k].0.clone());
        let layer = |last: usize| {
            let count = |k: usize| if k <= last { bases[k].points } else { bases[k].functions };
            vec![0.0; (0..D).map(count).product()]
        };
        Ok(Self {
            layers: (0..D).map(layer).collect(),
            coefficients: vec![0.0; bases.iter().map(|basis| basis.functions).product()],
            masses: array::from_fn(|k| along[k].1.clone()),
            bases,
            planted: Planted::here(),
        })
    }

    /// The values at the particles, to be set before [`project`](Self::project) and replaced by it.
    pub(super) fn values(&mut self) -> &mut [f64] {
        self.layers.last_mut().map_or(&mut [], |values| values)
    }

    /// Replaces values at particles of these volumes by those of the projection.
    pub(super) fn project(&mut self, volumes: &[f64]) {
        let Self { bases, masses, layers, coefficients, planted } = self;
        if let Some(values) = layers.last_mut() {
            if planted.is(Fault::VolumesLeftOut) {
                let mean = volumes.iter().sum::<f64>() / volumes.len() as f64;
                values.iter_mut().for_each(|value| *value *= mean);
            } else {
                values.iter_mut().zip(volumes).for_each(|(value, volume)| *value *= volume);
            }
        }
        let mut inner = volumes.len();
        for k in (0..D).rev() {
            inner /= bases[k].points;
            let (before, after) = layers.split_at_mut(k);
            let target = before.last_mut().unwrap_or(coefficients);
            target.fill(0.0);
            bases[k].integrate(ValueOrSlope::Value, inner, &after[0], target);
        }
        let functions = array::from_fn(|k| bases[k].functions);
        solve::<D>(&functions, |k| &masses[k], coefficients);
        let mut inner = 1;
        for k in 0..D {
            let (before, after) = layers.split_at_mut(k);
            let source = before.last().unwrap_or(coefficients);
            bases[k].evaluate(ValueOrSlope::Value, inner, source, &mut after[0]);
            inner *= bases[k].points;
        }
    }
}
