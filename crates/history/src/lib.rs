//! Materials with memory along exact motions.
//!
//! Where the motion is known, so is the deformation gradient `F(X, t)` of each particle. Its internal variables `z` follow the rate
//! equations of the law, an ordinary differential equation in time at fixed `X`, and their slopes in `X` follow the equation's derivative:
//!
//! ```text
//! z' = g(F, F', z),    (z_,J)' = dg/dF : F_,J + dg/dF' : F'_,J + dg/dz . z_,J
//! ```
//!
//! The body force that makes the motion exact is `b = a - Div P(F, z) / rho0`, by the chain rule. One generic function of a
//! [`LawWithHistory`] gives rates and, by [`Dual`] numbers, their slopes. A host needs nothing but `b`: no source in its return map.
//!
//! [`AnyLaw`] is a law of the vocabulary: flow by von Mises with and without regard to the rate, Maxwell elements, or texts of a
//! specification. [`Trajectory`] follows one particle through beginnings and ends of its flow. A [`Table`] has the fields of a body, from
//! trajectories at Chebyshev nodes; where fields are too rough for it, as behind the front of a flow, [`AtPoint::fine`] has the series of one
//! particle. The solver's own laws are written by hand in `mmsmith-laws` and share no formula with these.

#![allow(non_snake_case)]

mod any_law;
mod dormand_prince;
mod flow;
mod law;
mod maxwell;
mod motion;
mod number;
mod sampled;
mod stated;
mod table;
mod tensor;
mod trajectory;

pub use any_law::{AnyLaw, UnsupportedLaw};
pub use flow::Flow;
pub use law::{Branch, Kinematics, LawWithHistory, Residuals, kinds_of};
pub use maxwell::{ElasticPart, Maxwell};
pub use motion::Motion;
pub use number::{Dual, Number};
pub use stated::{StatedHistory, StatedHistoryError};
pub use table::{AtPoint, AtTime, Grid, Series, Table, place, polynomials_into};
pub use tensor::{ENTRIES, Tensor, determinant, identity};
pub use trajectory::{Change, HistoryError, Trajectory, divergence, followed};
