//! The plain step: MPM with all shape functions, transfers and integrators, one particle at a time, where
//! [`Simulation`](crate::Simulation) is fast.
//!
//! In each step every particle gets a list of its nodes with the weights `S_ip` and gradients `G_ip` of its [`Shape`]. P2G and
//! G2P are sums over these lists:
//!
//! ```text
//! m_i = sum m_p S_ip;  v_i = sum m_p v_p S_ip / m_i;  f_i = -sum V0_p tau_p G_ip + sum m_p b_p S_ip;  a_i = f_i / m_i
//! v_p by the transfer;  x_p += dt sum S_ip (v_i + dt a_i);  F_p <- (I + dt grad v) F_p
//! ```
//!
//! For `linear`, `ugimp`, `gimp` and `bspline2` with FLIP this is the scheme of the fast step, written independently of it; the two
//! agree to rounding. It runs on the calling thread alone, so that its results do not depend on the number of threads.
//!
//! # Example
//!
//! A quarter of a ring whose particles are quadrilaterals that share their corners:
//!
//! ```
//! use mmsmith_mpm::general::*;
//! use mmsmith_mpm::{Grid, Material, NoBodyForce};
//! use nalgebra::vector;
//!
//! let grid = Grid { lower: vector![0.0, 0.0], spacing: 0.05, cells: [15, 15], walls: [[true, false]; 2] };
//! let mut body = Body::annulus(&Annulus { inner: 0.4, outer: 0.6, quarter: true }, grid.spacing, 2, 1.0)?;
//! for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
//!     *v = *X;
//! }
//! let settings = Settings {
//!     shape: Shape::Cpdi2,
//!     integrator: Integrator::Cd,
//!     transfer: Transfer::Flip,
//!     time_step: 2e-4,
//!     halve_first_acceleration: true,
//! };
//! let material = Material::NeoHookean { lambda: 0.0, mu: 5000.0 };
//! let mut ring = General::new(grid, body, material, settings)?;
//! for _ in 0..20 {
//!     ring.step(&NoBodyForce)?;
//! }
//! assert!(ring.particles().x.iter().zip(&ring.particles().X).all(|(x, X)| x.norm() > X.norm()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod body;
mod domain;
mod nodes;
mod settings;
mod simulation;
mod spline;
mod stencil;
#[cfg(test)]
mod tests;

pub use body::{Annulus, Body, Mesh};
pub use settings::{Integrator, Settings, Shape, Transfer};
pub use simulation::General;
