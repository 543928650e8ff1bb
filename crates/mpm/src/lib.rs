//! A material point solver for solids under large deformation, in one, two and three dimensions.
//!
//! Particles carry mass, velocity and deformation gradient. Each step ([`Simulation::step`]) sums mass, momentum and force at
//! the nodes of a background grid of cubic cells (P2G), computes velocities and accelerations there (grid update), and
//! interpolates them at the particles (G2P). Shape functions ([`Shape`]), time integration ([`Integrator`]) and the velocity update
//! ([`Transfer`]) combine freely; high order is in [`total_lagrangian`].
//!
//! The scheme, for particle p and node i with weight `S_ip` and gradient `G_ip` taken at `x^n`:
//!
//! ```text
//! m_i = sum m_p S_ip;  v_i = sum m_p v_p S_ip / m_i;  f_i = -sum V0_p tau_p G_ip + sum m_p b_p S_ip;  a_i = f_i / m_i
//! v_p += dt sum S_ip a_i (FLIP);   x_p += dt sum S_ip (v_i + dt a_i);   F_p <- (I + dt grad v) F_p
//! ```
//!
//! Sources: Bardenhagen & Kober, "The generalized interpolation material point method", CMES 5 (2004) 477-495;
//! Wallstedt & Guilkey, "An evaluation of explicit time integration schemes for use with the generalized
//! interpolation material point method", J. Comput. Phys. 227 (2008) 9628-9642.
//!
//! # Example
//!
//! A bar between two walls, set in motion:
//!
//! ```
//! use mmsmith_mpm::{
//!     Grid, Integrator, Material, NoBodyForce, Particles, Settings, Shape, Simulation, Transfer,
//! };
//! use nalgebra::vector;
//!
//! let grid = Grid { lower: vector![0.0], spacing: 0.1, cells: [10], walls: [[true, true]] };
//! let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
//! for (v, X) in particles.v.iter_mut().zip(&particles.X) {
//!     *v = vector![(std::f64::consts::PI * X[0]).sin()];
//! }
//! let settings = Settings {
//!     shape: Shape::Gimp,
//!     integrator: Integrator::Cd,
//!     transfer: Transfer::Flip,
//!     time_step: 4e-4,
//!     halve_first_acceleration: true,
//! };
//! let material = Material::NeoHookean { lambda: 5769.0, mu: 3846.0 };
//! let mut simulation = Simulation::new(grid, particles, material, settings)?;
//! for _ in 0..100 {
//!     simulation.step(&NoBodyForce)?;
//! }
//! assert!((simulation.time() - 0.04_f64).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Conventions
//!
//! `X` is the reference and `x` the current position, `F[i][J] = dx_i/dX_J`, `J = det F`. Two-dimensional scenes are in
//! plane strain, one-dimensional ones in uniaxial strain. Units are the caller's, as long as they are consistent.
//! Runs are reproducible bit for bit, for any number of threads in the `rayon` pool around the calls.
//!
//! # Modules
//!
//! - `scheme`: the choices. `simulation`: set-up and life cycle. `solver`: solvers of any scheme behind one door.
//! - `particles`: what a particle has; bodies, clipped bodies, and meshes of domains that share corners.
//! - `grid`: memory layout, walls, ghost nodes, grid update. `shape`: shape functions and weights.
//! - `domain`: the domains that weights are means over, of each particle alone or on shared corners.
//! - `kernel`: sums over weights in vector instructions, for blocks of particles.
//! - `step`: each integrator as a sequence of `p2g`, `grid_update`, `g2p`; `g2p2g` fuses G2P with the next P2G; `xpic`: its filter.
//! - `parallel`: bins of particles and the two-colour schedule. `processes`: several processes, and the state to resume from.
//! - `material`: the laws, one file each.

mod domain;
mod error;
#[doc(hidden)]
pub mod fault;
mod grid;
mod kernel;
mod material;
mod parallel;
mod particles;
mod processes;
mod scheme;
mod shape;
mod simd;
mod simulation;
mod solver;
mod step;
mod tensor;
pub mod total_lagrangian;

pub use error::{SetupError, StepError};
pub use grid::Grid;
pub use kernel::copies::BLOCK;
pub use material::{ConstitutiveLaw, Law, LawCheck, Material, SIDE_BY_SIDE, Stressed, Volumetric};
pub use particles::Particles;
pub use particles::body::{Annulus, Body};
pub use particles::clip::{Clip, Facet, Side};
pub use particles::mesh::{Faces, Interpolation, Load, Mesh, Numbers};
pub use processes::decomposition::{Arrangement, Share};
pub use processes::saved_state::{SavedState, SavedStateError};
pub use scheme::{Integrator, Settings, Shape, Transfer, UnknownName};
pub use simd::Registers;
pub use simulation::{Simulated, Simulation};
pub use solver::{Scalar, Solver, TotalSetUp};
pub use step::body_force::{AtTime, BodyForce, NoBodyForce};
