//! Checks of particles after each step: invalid particles end the run, particles that left their tile cause a new sort.

use std::sync::{Mutex, PoisonError};

use mmsmith_lanes::tensor::determinant;
use nalgebra::{RealField, SMatrix, SVector};

/// Reasons why a particle is invalid, worst first: where one particle is inverted, others may follow in the same step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Invalid {
    Inverted,
    NotFinite,
    LeftGrid,
    TooLarge,
}

impl Invalid {
    /// The reason why a particle is invalid whatever its domain, if there is one.
    pub(crate) fn of_deformation<T: RealField + Copy, const D: usize>(
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Option<Self> {
        let J = determinant(F);
        if J <= T::zero() {
            return Some(Self::Inverted);
        }
        let is_finite = J.is_finite() && x.iter().all(|x| x.is_finite());
        (!is_finite).then_some(Self::NotFinite)
    }
}

/// Result of a pass over particles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Outcome {
    /// The worst reason, and the first particle it holds for.
    pub(crate) failure: Option<(Invalid, usize)>,
    /// Whether a particle left its tile.
    pub(crate) resort: bool,
}

impl Outcome {
    /// Whether all particles are valid and in their tiles.
    pub(crate) fn is_clean(self) -> bool {
        self.failure.is_none() && !self.resort
    }

    pub(crate) fn merge(self, other: Self) -> Self {
        let failure = match (self.failure, other.failure) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        Self { failure, resort: self.resort || other.resort }
    }
}

/// The merged outcome of several threads; their order does not matter.
#[derive(Debug, Default)]
pub(crate) struct SharedOutcome(Mutex<Outcome>);

impl SharedOutcome {
    pub(crate) fn add(&self, outcome: Outcome) {
        if !outcome.is_clean() {
            let mut merged = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *merged = merged.merge(outcome);
        }
    }

    pub(crate) fn all(self) -> Outcome {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::of_particles::{Domain, OfBlock};
    use crate::grid::Layout;
    use crate::grid::geometry::Constants;
    use crate::grid::tiles::Tiles;
    use crate::kernel::copies::{BLOCK, Copies};
    use crate::shape::one_axis::{OnAxis, ProductShape};
    use mmsmith_particles::Grid;
    use nalgebra::{Matrix2, Vector2, vector};

    fn shape(on_axis: OnAxis, half_size: f64) -> ProductShape<f64, 2> {
        ProductShape { on_axis, l: Vector2::repeat(half_size) }
    }

    fn constants() -> Constants<f64, 2> {
        let grid =
            Grid { lower: Vector2::zeros(), spacing: 0.5, cells: [6, 64], walls: [[false; 2]; 2] };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &grid.cells, 6);
        Constants::new(&grid, &layout, &tiles, 0.1, 1.0)
    }

    /// `check(x, F, valid)` has to give the expected answer, in the tile of rows from 14 cells above the lower corner on.
    fn for_all_limits(
        shape: &str,
        F: Matrix2<f64>,
        half_size: f64,
        end: f64,
        check: &dyn Fn(Vector2<f64>, Matrix2<f64>) -> bool,
    ) {
        let at = |edge: f64| 0.5 * (edge + half_size);
        for (y, valid) in [
            (at(14.0), true),
            (at(14.0).next_down(), false),
            (at(end), false),
            (at(end).next_down(), true),
        ] {
            assert_eq!(check(vector![1.2, y], F), valid, "{shape} {F} {y}");
        }
        for (x, valid) in [
            (0.0, true),
            (-5e-324, false),
            (3.0, true),
            (3.0_f64.next_up(), false),
            (f64::NAN, false),
        ] {
            assert_eq!(check(vector![x, 9.0], F), valid, "{shape} {F} {x}");
        }
        for bad in [Matrix2::zeros(), Matrix2::from_diagonal(&vector![1.0, -1.0])] {
            assert!(!check(vector![1.2, 9.0], bad), "{shape}");
        }
    }

    fn is_valid(
        c: &Constants<f64, 2>,
        domain: &ProductShape<f64, 2>,
        tile: u32,
        x: Vector2<f64>,
        F: Matrix2<f64>,
    ) -> bool {
        let mut copies = Copies::new();
        copies.copy(&[x], &[F]);
        let kinematics = copies.kinematics();
        domain.are_valid(OfBlock { c, ids: &[0], tiles: &[tile; BLOCK], kinematics })
    }

    #[test]
    fn particles_are_valid_up_to_the_limits_of_grid_tile_and_box() {
        let c = constants();
        let with = |a: f64, b: f64| Matrix2::from_diagonal(&vector![a, b]);
        let one = with(1.0, 1.0);
        let valid = |shape: ProductShape<f64, 2>| {
            move |x, F| {
                let is_valid = is_valid(&c, &shape, 2, x, F);
                let outcome = shape.diagnose(&c, 0, 2, &x, &F);
                assert_eq!(is_valid, outcome.is_clean(), "{x} {F}");
                is_valid
            }
        };
        for_all_limits("hat", one, 0.0, 29.0, &valid(shape(OnAxis::Hat, 0.0)));
        let fixed = shape(OnAxis::FixedBox, 0.25);
        for_all_limits("fixed", one, 0.25, 28.0, &valid(fixed));
        for_all_limits("quadratic", one, 0.5, 28.0, &valid(shape(OnAxis::Quadratic, 0.5)));
        for_all_limits("cubic", one, 1.0, 27.0, &valid(shape(OnAxis::Cubic, 1.0)));
        let of_box = valid(shape(OnAxis::StretchingBox, 0.25));
        for (F, half_size, end) in [
            (one, 0.25, 28.0),
            (with(1.0, 2.0), 0.5, 28.0),
            // A box with extended support along any axis has six rows.
            (with(1.0, 3.0), 0.75, 25.0),
            (with(3.0, 1.0), 0.25, 25.0),
            (with(1.0, 8.0), 2.0, 25.0),
            (with(8.0, 1.0), 0.25, 25.0),
        ] {
            for_all_limits("stretching", F, half_size, end, &of_box);
        }
        let of_spline = valid(shape(OnAxis::QuadraticMean, 0.25));
        for (F, half_size, end) in [
            (one, 0.75, 27.0),
            (with(1.0, 2.0), 1.0, 27.0),
            (with(1.0, 3.0), 1.25, 25.0),
            (with(3.0, 1.0), 0.75, 25.0),
            (with(1.0, 6.0), 2.0, 25.0),
        ] {
            for_all_limits("spline", F, half_size, end, &of_spline);
        }
        assert!(!of_spline(vector![1.2, 9.0], with(6.125, 1.0)));
        for F in [with(8.125, 1.0), with(1.0, 8.125)] {
            assert!(!of_box(vector![1.2, 9.0], F));
        }
        // The lowest and the highest tile reach over the ends of the grid.
        for (tile, y, valid) in
            [(0, 0.0, true), (0, -5e-324, false), (7, 32.0, true), (7, 32.0_f64.next_up(), false)]
        {
            let hat = shape(OnAxis::Hat, 0.0);
            assert_eq!(is_valid(&c, &hat, tile, vector![1.2, y], one), valid, "{tile} {y}");
        }
    }

    #[test]
    fn a_particle_that_left_its_tile_is_sorted_anew_and_an_invalid_one_stops_the_run() {
        let c = constants();
        let one = Matrix2::identity();
        let hat = shape(OnAxis::Hat, 0.0);
        let diagnose = |y: f64, F: &Matrix2<f64>| hat.diagnose(&c, 41, 2, &vector![1.2, y], F);
        assert!(diagnose(9.0, &one).is_clean());
        let moved = diagnose(15.0, &one);
        assert!(moved.resort && moved.failure.is_none() && !moved.is_clean());
        let gone = diagnose(33.0, &one);
        assert_eq!((gone.failure, gone.resort), (Some((Invalid::LeftGrid, 41)), false));
        let inverted = diagnose(9.0, &-Matrix2::from_diagonal(&vector![1.0, -1.0]));
        assert_eq!(inverted.failure, Some((Invalid::Inverted, 41)));
        assert!(!gone.is_clean());

        // In any order merging keeps the worst reason, its first particle, and the need of a sort.
        let other = Outcome { failure: Some((Invalid::LeftGrid, 7)), resort: false };
        for outcomes in [[moved, gone, inverted, other], [other, inverted, gone, moved]] {
            let merged = outcomes.into_iter().fold(Outcome::default(), Outcome::merge);
            assert_eq!((merged.failure, merged.resort), (inverted.failure, true));
            let found = SharedOutcome::default();
            outcomes.into_iter().for_each(|outcome| found.add(outcome));
            let all = found.all();
            assert_eq!((all.failure, all.resort), (inverted.failure, true));
        }
        assert_eq!(gone.merge(other).failure, other.failure);
        assert!(!gone.merge(other).resort && moved.merge(Outcome::default()).resort);
        assert!(SharedOutcome::default().all().is_clean());
    }
}
