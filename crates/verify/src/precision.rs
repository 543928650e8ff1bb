//! The numbers of runs.

use mmsmith_galerkin::{AtRest, BoundaryData, Disturbed, Grid, SetUp, StaticsError};
use mmsmith_measure::Compared;
use mmsmith_mpm::{Law, Scalar, SetupError, Solver, Stressed};
use mmsmith_runtime::Real;
use mmsmith_stated_law::Compiled;

/// The numbers of runs in `D` dimensions: `f64` or `f32`. Files have stresses in space.
pub(crate) trait Precision<const D: usize>:
    Real + Scalar<D> + Stressed<3> + Compared<D> + Compiled<D> + Compiled<3>
{
    /// The solver in the total Lagrangian formulation, which is in double precision alone.
    fn total_lagrangian<'a>(
        set_up: SetUp<'_, D>,
        boundary: Box<dyn BoundaryData<D> + 'a>,
    ) -> Result<Box<dyn Solver<Self, D> + 'a>, SetupError>;

    /// No disturbance of a motion, on a grid with splines of a degree, of a body with a law and a density; in double precision alone.
    fn undisturbed(
        grid: &Grid<D>,
        degree: usize,
        law: Law<Self, D>,
        density: f64,
    ) -> Result<Box<dyn Disturbed<D>>, SetupError>;

    /// An undeformed body on a grid with splines of a degree, with a law and a density; in double precision alone.
    fn at_rest(
        grid: &Grid<D>,
        degree: usize,
        law: Law<Self, D>,
        density: f64,
    ) -> Result<Box<dyn AtRest<D>>, StaticsError>;
}

macro_rules! precisions {
    ($($D:literal)*) => {
        $(
            impl Precision<$D> for f64 {
                fn total_lagrangian<'a>(
                    set_up: SetUp<'_, $D>,
                    boundary: Box<dyn BoundaryData<$D> + 'a>,
                ) -> Result<Box<dyn Solver<Self, $D> + 'a>, SetupError> {
                    set_up.solver(boundary)
                }

                fn undisturbed(
                    grid: &Grid<$D>,
                    degree: usize,
                    law: Law<Self, $D>,
                    density: f64,
                ) -> Result<Box<dyn Disturbed<$D>>, SetupError> {
                    grid.undisturbed(degree, law, density)
                }

                fn at_rest(
                    grid: &Grid<$D>,
                    degree: usize,
                    law: Law<Self, $D>,
                    density: f64,
                ) -> Result<Box<dyn AtRest<$D>>, StaticsError> {
                    grid.at_rest(degree, law, density)
                }
            }

            impl Precision<$D> for f32 {
                fn total_lagrangian<'a>(
                    _: SetUp<'_, $D>,
                    _: Box<dyn BoundaryData<$D> + 'a>,
                ) -> Result<Box<dyn Solver<Self, $D> + 'a>, SetupError> {
                    Err(SetupError::DoublePrecisionOnly)
                }

                fn undisturbed(
                    _: &Grid<$D>,
                    _: usize,
                    _: Law<Self, $D>,
                    _: f64,
                ) -> Result<Box<dyn Disturbed<$D>>, SetupError> {
                    Err(SetupError::DoublePrecisionOnly)
                }

                fn at_rest(
                    _: &Grid<$D>,
                    _: usize,
                    _: Law<Self, $D>,
                    _: f64,
                ) -> Result<Box<dyn AtRest<$D>>, StaticsError> {
                    Err(SetupError::DoublePrecisionOnly.into())
                }
            }
        )*
    };
}

precisions! { 1 2 3 }
