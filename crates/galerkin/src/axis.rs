//! One axis of a background grid: its cells, its ends, and the particles along it.

use mmsmith_scalar_functions::ScalarFunctions;
use std::f64::consts::PI;

use mmsmith_vocabulary::ComponentCondition;

/// The boundary condition at an end of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// A surface with a condition on each component of the grid's coordinates, of which there may be fewer than three: a clamped knot
    /// vector, where nothing is prescribed, or the component's motion or traction is [given](super::BoundaryData).
    Open([ComponentCondition; 3]),
    /// A frictionless sliding wall or a plane of symmetry: splines are continued by their mirror image, the component
    /// along this axis with the opposite sign. It so vanishes on the wall exactly, and the other components have no
    /// slope there, as the absence of shear traction asks of an isotropic solid.
    Wall,
    /// No end: the other end of the axis follows, where this is `Periodic` too.
    Periodic,
    /// No end, and the same all along the axis, where the other end is `Uniform` too: one cell, one particle at its lower end, and one
    /// function, which is one. So a body of revolution whose motion does not depend on the angle has an angle without unknowns.
    Uniform,
}

impl End {
    /// A free surface.
    pub const FREE: Self = Self::Open([ComponentCondition::TractionFree; 3]);
    /// A surface whose traction is given, all components of it.
    pub const LOADED: Self = Self::Open([ComponentCondition::PrescribedTraction; 3]);
    /// A surface whose motion is given, all components of it.
    pub const MOVED: Self = Self::Open([ComponentCondition::PrescribedMotion; 3]);

    /// Whether knots are repeated here, so that the last function alone has a value at the end.
    pub(crate) fn is_clamped(self) -> bool {
        matches!(self, Self::Open(_))
    }

    /// Whether a component has this condition here.
    pub(crate) fn has(self, component: usize, condition: ComponentCondition) -> bool {
        matches!(self, Self::Open(of) if of[component] == condition)
    }
}

/// Where the particles lie in each cell, and the weights with which they integrate over it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// At the centres of equal parts of the cell (the midpoint rule). Between walls that is as accurate as the splines
    /// themselves, since the mirror images make all integrands periodic, as it is along a periodic axis; next to any other
    /// end it is of order two.
    Lattice,
    /// At the Gauss-Legendre points of the cell.
    Gauss,
}

/// Equal cells along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The smallest coordinate: a length, or an angle in radians.
    pub lower: f64,
    /// The largest coordinate.
    pub upper: f64,
    /// Number of cells.
    pub cells: usize,
    /// Boundary conditions at the lower and the upper end.
    pub ends: [End; 2],
}

impl Axis {
    /// The cell's size.
    pub fn spacing(&self) -> f64 {
        (self.upper - self.lower) / self.cells as f64
    }

    /// Whether all is the same along the axis.
    pub(crate) fn is_uniform(&self) -> bool {
        self.ends == [End::Uniform; 2]
    }

    /// How many particles lie along it, with so many in a cell.
    pub fn count(&self, per_cell: usize) -> usize {
        if self.is_uniform() { 1 } else { self.cells * per_cell }
    }

    /// At which ends the motion of a component is given.
    pub(crate) fn moved(&self, component: usize) -> [bool; 2] {
        self.ends.map(|end| end.has(component, ComponentCondition::PrescribedMotion))
    }

    /// Coordinates and weights of the particles along this axis, `per_cell` in each cell, cell after cell.
    pub(crate) fn points(&self, per_cell: usize, layout: Layout) -> (Vec<f64>, Vec<f64>) {
        if self.is_uniform() {
            return (vec![self.lower], vec![self.upper - self.lower]);
        }
        let rule: Vec<(f64, f64)> = match layout {
            Layout::Lattice => {
                let part = 1.0 / per_cell as f64;
                (0..per_cell).map(|i| ((i as f64 + 0.5) * part, part)).collect()
            }
            Layout::Gauss => gauss_legendre(per_cell),
        };
        let h = self.spacing();
        let cell =
            |c: usize| rule.iter().map(move |(x, w)| (self.lower + (c as f64 + x) * h, w * h));
        (0..self.cells).flat_map(cell).unzip()
    }
}

/// Points and weights of the Gauss-Legendre rule on the interval from 0 to 1, in ascending order.
fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    let rule = |i: usize| {
        // Tricomi's estimate, from which Newton's iteration takes a few steps.
        let mut x = -(PI * (i as f64 + 0.75) / (n + 0.5)).cosine();
        let mut slope = 1.0;
        for _ in 0..100 {
            let (value, derivative) = legendre(count, x);
            slope = derivative;
            let change = value / derivative;
            x -= change;
            if change.abs() <= f64::EPSILON {
                break;
            }
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(rule).collect()
}

/// Legendre's polynomial of degree `count` and its derivative.
fn legendre(count: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (0.0, 1.0);
    for k in 0..count {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k + 1.0) * x * value - k * before) / (k + 1.0));
    }
    (value, count as f64 * (x * value - before) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_points_integrate_polynomials_of_twice_their_number() {
        for count in 1..=12 {
            let rule = gauss_legendre(count);
            assert!(rule.windows(2).all(|pair| pair[0].0 < pair[1].0), "{count}");
            for power in 0..2 * count {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(power as i32)).sum();
                let exact = 1.0 / (power as f64 + 1.0);
                assert!((sum - exact).abs() < 4e-15, "{count} points, power {power}: {sum}");
            }
            let beyond: f64 = rule.iter().map(|(x, w)| w * x.powi(2 * count as i32)).sum();
            assert!(
                (beyond - 1.0 / (2.0 * count as f64 + 1.0)).abs() > 1e-16 * f64::from(count < 12)
            );
        }
    }

    #[test]
    fn particles_fill_the_cells_in_order() {
        let axis = Axis { lower: 1.0, upper: 2.0, cells: 2, ends: [End::Wall; 2] };
        let (points, weights) = axis.points(2, Layout::Lattice);
        assert_eq!(points, [1.125, 1.375, 1.625, 1.875]);
        assert_eq!(weights, [0.25; 4]);
        let (points, weights) = axis.points(2, Layout::Gauss);
        let offset = 0.25 / 3.0_f64.sqrt();
        for (found, expected) in
            points.iter().zip([1.25 - offset, 1.25 + offset, 1.75 - offset, 1.75 + offset])
        {
            assert!((found - expected).abs() < 1e-15);
        }
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
