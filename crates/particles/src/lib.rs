//! Particles and the bodies made of them, and the door to every solver that moves them.
//!
//! `columns` states once what a particle has. A [`Body`] adds the domain that each particle stands for: boxes, parallelograms, or a [`Mesh`]
//! of domains that share corners. A [`Solver`] moves a body under a [`BodyForce`]; its errors are those of set-up and of steps.
//! The solvers are in `mmsmith-mpm` (updated Lagrangian) and `mmsmith-galerkin` (total Lagrangian).

pub mod body;
mod body_force;
pub mod columns;
mod error;
mod grid;
pub mod lattice;
pub mod mesh;
mod saved_state;
mod solver;

pub use body::{Annulus, Body};
pub use body_force::{AtTime, BodyForce, NoBodyForce};
pub use columns::Particles;
pub use error::{SetupError, StepError};
pub use grid::Grid;
pub use mesh::{Faces, Interpolation, Load, Mesh, Numbers};
pub use saved_state::{SavedState, SavedStateError, replace_whole};
pub use solver::{Arrangement, Division, Pass, PassTime, Profile, Solver};
