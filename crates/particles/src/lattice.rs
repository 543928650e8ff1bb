//! Particles on the lattice of a grid.

use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SMatrix, SVector};

use crate::columns::Particles;
use crate::grid::Grid;

impl<T: RealField + Copy, const D: usize> Particles<T, D> {
    /// A body of density `density` at rest and undeformed, on a square lattice with `per_cell` particles per cell and
    /// direction: those of the grid whose centre satisfies `inside`.
    ///
    /// Ids run through cell after cell, along axis 0 first, which is also a good order in memory.
    pub fn lattice(
        grid: &Grid<T, D>,
        per_cell: usize,
        density: T,
        inside: impl Fn(&SVector<T, D>) -> bool,
    ) -> Self {
        Self::of_lattice(grid, per_cell, density, &inside)
    }

    fn of_lattice(
        grid: &Grid<T, D>,
        per_cell: usize,
        density: T,
        inside: &dyn Fn(&SVector<T, D>) -> bool,
    ) -> Self {
        let fraction = real::<T>(per_cell.max(1) as f64).recip();
        let mut X = Vec::new();
        let mut place = |cell: &[usize; D]| {
            count([per_cell; D], |sub: &[usize; D]| {
                let centre = SVector::from_fn(|a, _| {
                    let within = (real::<T>(sub[a] as f64) + real(0.5)) * fraction;
                    grid.lower[a] + (real::<T>(cell[a] as f64) + within) * grid.spacing
                });
                if inside(&centre) {
                    X.push(centre);
                }
            });
        };
        count(grid.cells, &mut place);
        let n = X.len();
        let edge = grid.spacing * fraction;
        let volume = (0..D).fold(T::one(), |product, _| product * edge);
        Self {
            x: X.clone(),
            X,
            v: vec![SVector::zeros(); n],
            F: vec![SMatrix::identity(); n],
            mass: vec![density * volume; n],
            volume: vec![volume; n],
            half_size: SVector::repeat(edge * real(0.5)),
            ..Self::default()
        }
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.X.len()
    }

    /// Mass and volume of every particle, where they are uniform.
    pub fn uniform(&self) -> Option<(T, T)> {
        let (&m, &V) = self.mass.first().zip(self.volume.first())?;
        let is_uniform = self.mass.iter().all(|mass| *mass == m)
            && self.volume.iter().all(|volume| *volume == V);
        is_uniform.then_some((m, V))
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.X.is_empty()
    }
}

/// Counts through all multi-indices below `limits`, axis 0 fastest.
pub fn count<const D: usize>(limits: [usize; D], mut visit: impl FnMut(&[usize; D])) {
    if limits.contains(&0) {
        return;
    }
    let mut index = [0; D];
    loop {
        visit(&index);
        let mut axis = 0;
        loop {
            if axis == D {
                return;
            }
            index[axis] += 1;
            if index[axis] < limits[axis] {
                break;
            }
            index[axis] = 0;
            axis += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn a_lattice_fills_the_grid_cell_by_cell() {
        let grid = Grid {
            lower: Vector2::new(1.0, 2.0),
            spacing: 0.5,
            cells: [2, 1],
            walls: [[false; 2]; 2],
        };
        let all = Particles::lattice(&grid, 2, 3.0, |_| true);
        assert_eq!(all.len(), 8);
        assert_eq!(all.X[0], Vector2::new(1.125, 2.125));
        assert_eq!(all.X[1], Vector2::new(1.375, 2.125));
        assert_eq!(all.X[2], Vector2::new(1.125, 2.375));
        assert_eq!(all.X[4], Vector2::new(1.625, 2.125));
        assert_eq!(all.volume.iter().sum::<f64>(), 0.5);
        assert_eq!(all.mass.iter().sum::<f64>(), 1.5);
        assert_eq!(all.half_size, Vector2::repeat(0.125));
        let left = Particles::lattice(&grid, 2, 3.0, |X| X[0] < 1.2);
        assert_eq!(left.X, [Vector2::new(1.125, 2.125), Vector2::new(1.125, 2.375)]);
        assert!(Particles::lattice(&grid, 0, 3.0, |_| true).is_empty());
    }
}
