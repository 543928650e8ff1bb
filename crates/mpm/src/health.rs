//! Checks of particles after each step: invalid particles end the run, particles that left their bin cause a new sort.

use std::array;
use std::sync::{Mutex, PoisonError};

use nalgebra::{RealField, SMatrix, SVector};

use crate::geometry::Constants;
use crate::shape_function::{
    EXTENDED, HALF_SIZE_LIMIT, ShapeChoice, ShapeFunction, ShapeWork, is_extended,
};
use crate::simd::{Loop, Vectors, dispatch};
use crate::tensor::{determinant, real};

impl<T: RealField + Copy, const D: usize> Constants<T, D> {
    /// Whether a particle is valid and still fits its bin. Nearly all do, and one branch tells.
    #[inline(always)]
    pub(crate) fn is_valid<R, const W: usize>(
        &self,
        shape: R,
        bin: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> bool
    where
        R: ShapeChoice<T, D, W>,
    {
        let l: [T; D] = array::from_fn(|a| shape.half_size(a, F[(a, a)]));
        let mut valid = determinant(F) > T::zero();
        let mut extended = false;
        for a in 0..D {
            valid &=
                (x[a] >= self.lower[a]) & (x[a] <= self.upper[a]) & (l[a] <= real(HALF_SIZE_LIMIT));
            extended |= is_extended(l[a]);
        }
        let edge = (x[D - 1] - self.lower[D - 1]) * self.inverse_spacing - l[D - 1];
        let width = if extended { EXTENDED } else { W };
        let (first, end) = self.bins.range(bin, width);
        valid & (edge >= real(first)) & (edge < real(end))
    }

    /// Diagnoses a particle that may not be [valid](Self::is_valid).
    pub(crate) fn diagnose<R, const W: usize>(
        &self,
        shape: R,
        bin: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        particle: usize,
    ) -> Outcome
    where
        R: ShapeChoice<T, D, W>,
    {
        if self.is_valid(shape, bin, x, F) {
            return Outcome::default();
        }
        let failure = invalidity(&shape, self, x, F).map(|invalid| (invalid, particle));
        Outcome { failure, resort: failure.is_none() }
    }
}

/// Reasons why a particle is invalid, worst first: where one particle is inverted, others may follow in the same step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Invalid {
    Inverted,
    NotFinite,
    LeftGrid,
    TooLarge,
}

/// The reason why a particle is invalid, if it is.
#[inline(always)]
pub(crate) fn invalidity<T, R, const D: usize, const W: usize>(
    shape: &R,
    c: &Constants<T, D>,
    x: &SVector<T, D>,
    F: &SMatrix<T, D, D>,
) -> Option<Invalid>
where
    T: RealField + Copy,
    R: ShapeChoice<T, D, W>,
{
    let J = determinant(F);
    let l = SVector::<T, D>::from_fn(|a, _| shape.half_size(a, F[(a, a)]));
    let is_deformation = J > T::zero() && J.is_finite();
    if is_deformation && c.axis_outside(x).is_none() && axis_too_large(&l).is_none() {
        return None;
    }
    Some(if J <= T::zero() {
        Invalid::Inverted
    } else if !J.is_finite() || x.iter().any(|x| !x.is_finite()) {
        Invalid::NotFinite
    } else if c.axis_outside(x).is_some() {
        Invalid::LeftGrid
    } else {
        Invalid::TooLarge
    })
}

/// The first axis along which a half-size, in cells, exceeds the limit of the shape functions.
#[inline(always)]
pub(crate) fn axis_too_large<T: RealField + Copy, const D: usize>(
    l: &SVector<T, D>,
) -> Option<usize> {
    (0..D).find(|&a| l[a] > real(HALF_SIZE_LIMIT))
}

/// Result of a pass over particles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Outcome {
    /// The worst reason, and the first particle it holds for.
    pub(crate) failure: Option<(Invalid, usize)>,
    /// Whether a particle left its bin.
    pub(crate) resort: bool,
}

impl Outcome {
    /// Whether all particles are valid and in their bins.
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

/// Whether all particles of a block are [valid](Constants::is_valid), each in its own of `bins`.
pub(crate) struct CheckBlock<'a, T, H, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    pub(crate) bins: H,
    pub(crate) x: &'a [SVector<T, D>],
    pub(crate) F: &'a [SMatrix<T, D, D>],
}

impl<T, H, const D: usize, const W: usize> ShapeWork<T, D, W> for CheckBlock<'_, T, H, D>
where
    T: RealField + Copy,
    H: Iterator<Item = u32>,
{
    type Output = bool;

    #[inline(always)]
    fn run<R: ShapeFunction<T, D, W>>(self, shape: R) -> bool {
        let mut all_valid = true;
        dispatch(Check { work: self, shape, all_valid: &mut all_valid });
        all_valid
    }
}

struct Check<'a, 'b, T, R, H, const D: usize, const W: usize> {
    work: CheckBlock<'a, T, H, D>,
    shape: R,
    all_valid: &'b mut bool,
}

impl<T, R, H, const D: usize, const W: usize> Loop for Check<'_, '_, T, R, H, D, W>
where
    T: RealField + Copy,
    R: ShapeFunction<T, D, W>,
    H: Iterator<Item = u32>,
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { work: CheckBlock { c, bins, x, F }, shape, all_valid } = self;
        let mut valid = true;
        for ((x, F), bin) in x.iter().zip(F).zip(bins) {
            valid &= c.is_valid(shape, bin, x, F);
        }
        *all_valid = valid;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Grid, Layout};
    use crate::parallel::bins::Bins;
    use crate::shape_function::{FixedBox, Hat, StretchingBox};
    use nalgebra::{Matrix2, Vector2, vector};

    fn constants() -> Constants<f64, 2> {
        let grid =
            Grid { lower: Vector2::zeros(), spacing: 0.5, cells: [6, 60], walls: [[false; 2]; 2] };
        let layout = Layout::new(&grid, 8).unwrap();
        let bins = Bins::new(&layout, 1);
        Constants::new(&grid, &layout, &bins, 0.1, 1.0)
    }

    /// `check(x, F, valid)` has to give the expected answer, in the bin of rows from 13 cells above the lower corner on.
    fn for_all_limits(
        shape: &str,
        F: Matrix2<f64>,
        half_size: f64,
        end: f64,
        check: &dyn Fn(Vector2<f64>, Matrix2<f64>) -> bool,
    ) {
        let at = |edge: f64| 0.5 * (edge + half_size);
        for (y, valid) in [
            (at(13.0), true),
            (at(13.0).next_down(), false),
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

    #[test]
    fn particles_are_valid_up_to_the_limits_of_grid_bin_and_box() {
        let c = constants();
        let with = |a: f64, b: f64| Matrix2::from_diagonal(&vector![a, b]);
        let one = with(1.0, 1.0);
        for_all_limits("hat", one, 0.0, 28.0, &|x, F| c.is_valid(Hat, 2, &x, &F));
        let fixed = FixedBox(Vector2::repeat(0.25));
        for_all_limits("fixed", one, 0.25, 27.0, &|x, F| c.is_valid(fixed, 2, &x, &F));
        let stretching = StretchingBox(Vector2::repeat(0.25));
        let of_box = |x: Vector2<f64>, F: Matrix2<f64>| c.is_valid(stretching, 2, &x, &F);
        for (F, half_size, end) in [
            (one, 0.25, 27.0),
            (with(1.0, 2.0), 0.5, 27.0),
            // A box with extended support along any axis has six rows.
            (with(1.0, 3.0), 0.75, 24.0),
            (with(3.0, 1.0), 0.25, 24.0),
            (with(1.0, 8.0), 2.0, 24.0),
            (with(8.0, 1.0), 0.25, 24.0),
        ] {
            for_all_limits("stretching", F, half_size, end, &of_box);
        }
        for F in [with(8.125, 1.0), with(1.0, 8.125)] {
            assert!(!of_box(vector![1.2, 9.0], F));
        }
        // The lowest and the highest bin reach over the ends of the grid.
        for (bin, y, valid) in
            [(0, 0.0, true), (0, -5e-324, false), (7, 30.0, true), (7, 30.0_f64.next_up(), false)]
        {
            assert_eq!(c.is_valid(Hat, bin, &vector![1.2, y], &one), valid, "{bin} {y}");
        }
    }

    #[test]
    fn a_particle_that_left_its_bin_is_sorted_anew_and_an_invalid_one_stops_the_run() {
        let c = constants();
        let one = Matrix2::identity();
        let diagnose = |y: f64, F: &Matrix2<f64>| c.diagnose(Hat, 2, &vector![1.2, y], F, 41);
        assert!(diagnose(9.0, &one).is_clean());
        let moved = diagnose(15.0, &one);
        assert!(moved.resort && moved.failure.is_none() && !moved.is_clean());
        let gone = diagnose(31.0, &one);
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
