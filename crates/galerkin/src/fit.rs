//! Coefficients along one axis from values at its particles, and at the ends whose motion is given.

use super::axis::{Axis, Layout};
use super::basis::{Basis, ValueOrSlope};
use super::mass::{Band, Mass};

/// Quadrature points along an axis, with the length that each represents.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub(crate) points: Vec<f64>,
    /// The part of the axis that each stands for.
    pub(crate) lengths: Vec<f64>,
    /// The lengths times this axis's factor of the volume.
    pub(crate) weights: Vec<f64>,
}

impl Line {
    /// The particles along an axis, `density` being its factor of the volume at a coordinate.
    pub(crate) fn new(
        axis: &Axis,
        per_cell: usize,
        layout: Layout,
        density: impl Fn(f64) -> f64,
    ) -> Self {
        let (points, lengths) = axis.points(per_cell, layout);
        let weights = lengths.iter().zip(&points).map(|(w, x)| w * density(*x)).collect();
        Self { points, lengths, weights }
    }
}

/// The operator `Q` of one axis: least squares at the particles, given the values at ends whose motion is given (see
/// [`boundary`](super::boundary)).
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    moved: [bool; 2],
    weights: Vec<f64>,
    /// The consistent mass matrix of one per length.
    pub(crate) matrix: Band,
    /// Solves for the coefficients that are not given.
    pub(crate) mass: Mass,
}

impl Fit {
    /// That of a component; `None` where the particles do not determine all coefficients.
    pub(crate) fn new(
        axis: &Axis,
        component: usize,
        basis: &Basis,
        weights: &[f64],
    ) -> Option<Self> {
        let matrix = Band::consistent(basis, weights);
        let mass = Mass::consistent(axis, component, &matrix)?;
        Some(Self { moved: axis.moved(component), weights: weights.to_vec(), matrix, mass })
    }

    /// Takes values along one axis of an array, at the particles and before and after them at the ends whose motion is given,
    /// to coefficients: `values[o][s][i]` to `[o][j][i]` with `i < inner`.
    pub(crate) fn apply(&self, basis: &Basis, inner: usize, values: &[f64]) -> Vec<f64> {
        let [before, after] = self.moved.map(usize::from);
        let particles = before * inner..(before + self.weights.len()) * inner;
        let blocks = values.chunks_exact((before + self.weights.len() + after) * inner);
        let mut weighted = Vec::with_capacity(values.len());
        for block in blocks.clone() {
            let lines = block[particles.clone()].chunks_exact(inner).zip(&self.weights);
            lines.for_each(|(line, w)| weighted.extend(line.iter().map(|value| w * value)));
        }
        let size = basis.functions * inner;
        let mut fitted = vec![0.0; blocks.len() * size];
        basis.integrate(ValueOrSlope::Value, inner, &weighted, &mut fitted);
        let ends = [(self.moved[0], 0), (self.moved[1], size - inner)];
        let set = |fitted: &mut [f64]| {
            for (block, fitted) in blocks.clone().zip(fitted.chunks_exact_mut(size)) {
                for ((moved, at), value) in ends.into_iter().zip([0, block.len() - inner]) {
                    if moved {
                        fitted[at..at + inner].copy_from_slice(&block[value..value + inner]);
                    }
                }
            }
        };
        if self.moved != [false; 2] {
            let mut given = vec![0.0; fitted.len()];
            set(&mut given);
            let mut product = vec![0.0; fitted.len()];
            self.matrix.multiply(inner, &given, &mut product);
            fitted.iter_mut().zip(product).for_each(|(sum, part)| *sum -= part);
        }
        self.mass.solve(inner, &mut fitted);
        set(&mut fitted);
        fitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::End;

    #[test]
    fn coefficients_come_back_from_their_own_values() {
        for ends in [
            [End::FREE, End::MOVED],
            [End::MOVED, End::MOVED],
            [End::MOVED, End::Wall],
            [End::Periodic, End::Periodic],
        ] {
            for p in 2..=5 {
                let axis = Axis { lower: -0.4, upper: 1.1, cells: 7, ends };
                let line = Line::new(&axis, p + 1, Layout::Gauss, |x| 1.0 + x * x);
                // The ends' values are those of the functions there: cells have the same number of points each.
                let basis = Basis::new(&axis, p, true, &line.points).unwrap();
                let periodic = ends[0] == End::Periodic;
                let own = if periodic { 7 } else { basis.functions };
                let coefficient = |j: usize| ((j % own) as f64 * 1.7).sin();
                let coefficients: Vec<f64> = (0..basis.functions).map(coefficient).collect();
                let mut at_particles = vec![0.0; line.points.len()];
                basis.evaluate(ValueOrSlope::Value, 1, &coefficients, &mut at_particles);
                let mut values = at_particles;
                if ends[0] == End::MOVED {
                    values.insert(0, coefficients[0]);
                }
                if ends[1] == End::MOVED {
                    values.push(coefficients[basis.functions - 1]);
                }
                let fit = Fit::new(&axis, 0, &basis, &line.weights).unwrap();
                // Two blocks with two lines each, one of them twice the other.
                let both = values.iter().flat_map(|value| [*value, 2.0 * value]);
                let both: Vec<f64> = both.clone().chain(both).collect();
                let fitted = fit.apply(&basis, 2, &both);
                assert_eq!(fitted.len(), 4 * coefficients.len());
                for (k, fitted) in fitted.iter().enumerate() {
                    let factor = (k % 2 + 1) as f64;
                    let expected = factor * coefficients[k / 2 % coefficients.len()];
                    assert!((fitted - expected).abs() < 1e-11, "{ends:?} {p} {k}");
                }
            }
        }
    }
}
