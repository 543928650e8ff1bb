//! The solver behind the door that all solvers share.

use mmsmith_laws::Law;
use mmsmith_particles::{
    Arrangement, BodyForce, Particles, SavedState, SavedStateError, SetupError, Solver, StepError,
};
use nalgebra::SVector;

use crate::boundary::BoundaryData;
use crate::set_up::{Grid, Scheme};
use crate::simulation::TotalLagrangian;

/// A simulation in the total Lagrangian formulation, and its motion at time 0.
pub struct SetUp<'a, const D: usize> {
    /// The splines' cells, and the particles in them.
    pub grid: Grid<D>,
    /// Degree, mass matrix, composition in time.
    pub scheme: Scheme,
    /// The law.
    pub law: Law<f64, D>,
    /// The reference density.
    pub density: f64,
    /// Time step dt.
    pub time_step: f64,
    /// Displacement and velocity at a reference position.
    pub motion: &'a dyn Fn(&SVector<f64, D>) -> [SVector<f64, D>; 2],
}

/// A body in the total Lagrangian formulation, with given motion and traction on its sides.
struct DrivenBody<'a, const D: usize> {
    body: TotalLagrangian<D>,
    boundary: Box<dyn BoundaryData<D> + 'a>,
}

/// Not generic, so that the solver is compiled with this crate.
macro_rules! solvers {
    ($($D:literal)*) => {
        $(
            impl SetUp<'_, $D> {
                /// The solver at time 0.
                ///
                /// # Errors
                ///
                /// As [`TotalLagrangian::new`] and [`TotalLagrangian::start_with_boundary`].
                pub fn solver<'a>(
                    self,
                    boundary: Box<dyn BoundaryData<$D> + 'a>,
                ) -> Result<Box<dyn Solver<f64, $D> + 'a>, SetupError> {
                    let Self { grid, scheme, law, density, time_step, motion } = self;
                    let mut body =
                        TotalLagrangian::<$D>::new(grid, scheme, law, density, time_step)?;
                    let (u, v): (Vec<_>, Vec<_>) =
                        body.positions().iter().map(motion).map(|[u, v]| (u, v)).unzip();
                    body.start_with_boundary(&u, &v, boundary.as_ref())?;
                    Ok(Box::new(DrivenBody { body, boundary }))
                }
            }

            impl Solver<f64, $D> for DrivenBody<'_, $D> {
            fn step(&mut self, body_force: &dyn BodyForce<f64, $D>) -> Result<(), StepError> {
                self.body.step_with_boundary(body_force, self.boundary.as_ref())
            }

            fn observe(&mut self) -> (&Particles<f64, $D>, &Law<f64, $D>) {
                self.body.observe();
                (self.body.particles(), self.body.law())
            }

            fn arrangement(&self) -> Option<Arrangement<'_>> {
                None
            }

            fn forced(&self) -> &[SVector<f64, $D>] {
                &self.body.particles().X
            }

            fn velocity_lag(&self) -> f64 {
                0.0
            }

            fn state(&self) -> Vec<&[u8]> {
                self.body.state()
            }

            fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError> {
                self.body.take_up(&parts)
            }
        }
        )*
    };
}

solvers! { 1 2 3 }
