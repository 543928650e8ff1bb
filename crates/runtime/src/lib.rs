//! Run time of manufactured solutions: the trait that they implement, the body that they belong to, their parameters, and the
//! evaluation at many points.
//!
//! A manufactured solution is a displacement field `u(X, t)`, chosen freely, together with the body force `b`
//! that makes it an exact solution of the equations of motion for a given material. Generated code, interpreted
//! specifications and solutions written by hand implement [`Solution`]; whatever uses them knows nothing of specifications and symbols.
//!
//! # Conventions
//!
//! `X` is the reference position and `x = X + u` the current one. `F[i][J] = dx_i/dX_J` is the deformation
//! gradient, `H = F - I` the displacement gradient, `J = det F`. `P` is the *first* Piola-Kirchhoff stress:
//! `P = tau F^-T`, the traction on a surface with reference normal `N` is `P N`, and momentum balance reads
//! `rho0 a_i = sum_J dP[i][J]/dX_J + rho0 b_i`. The body force `b` is a force per unit *mass*. In two dimensions
//! the deformation is plane strain. All components are Cartesian.

mod domain;
mod history;
mod history_table;
mod lattice;
mod parameters;
mod real;
mod solution;
mod staged;

pub use domain::{Around, Domain};
pub use history::HistoryReport;
pub use history_table::{HistoryTable, PointSeries, TableError, TabulatedPoints};
pub use lattice::{BodyForceOnLattice, Lattice, LatticePoints};
/// Functions that the standard library lacks, which [`Real::apply`] takes.
pub use libm;
/// The functions that [`Real`] has beyond those of a field.
pub use mmsmith_scalar_functions::ScalarFunctions;
pub use mmsmith_vocabulary::{
    Across, Boundary, ComponentCondition, Components, Condition, Element, Flow, Form, Internal,
    Law, Material, Memory, Mixed, Overstress, Response, Smoothness, Stated, Surface, Volumetric,
    WithMemory,
};
/// The vectors and matrices of this crate's interface.
pub use nalgebra;
pub use parameters::{Description, Parameter, ParameterError};
pub use real::Real;
pub use solution::{AnySolution, Fields, Solution};
pub use staged::{
    BLOCK, BodyForceAtPoints, BodyForceStages, InternalAtPoints, PlainPoints, StagedPoints,
    StagedStates, State, StateAtPoints, StateRun, StateStages,
};
