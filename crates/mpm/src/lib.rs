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
//! - `step`: each integrator as a sequence of `p2g`, `grid_update`, `g2p`; `g2p2g` fuses G2P with the next P2G; `xpic`: its filter.
//! - `clip`: bodies of any shape; `mesh`: domains of particles on shared corners, cells of CPDI2, polygons and
//!   polyhedra; `shared_corners`, `corner_values`, `corner_exchange`, `corner_step`: P2G and G2P by way of corners.
//! - `scheme`: the choices. `support`, `shape_function`, `domain`, `weights`: weights of particles at nodes. `kernel`: sums over
//!   them in vector instructions. `body`: particles with their domains.
//! - `material`: the laws, one file each. `body_force`, `forcing`: the body force.
//! - `grid`, `node`: memory layout, walls and ghost nodes. `parallel`: bins of particles and the two-colour schedule.
//! - `decomposition`, `redistribute`, `corner_halo`, `directory`: several processes. `saved_state`: what a run goes on from.
//! - `simulation`: set-up and life cycle. `state`, `geometry`, `health`: data and checks that the stages share.

mod body;
mod body_force;
mod clip;
mod corner_exchange;
mod corner_halo;
mod corner_step;
mod corner_values;
mod decomposition;
mod directory;
mod domain;
mod error;
mod extension;
#[doc(hidden)]
pub mod fault;
mod forcing;
mod g2p;
mod g2p2g;
mod geometry;
mod grid;
mod grid_update;
mod health;
mod kernel;
mod material;
mod mesh;
mod node;
mod p2g;
mod parallel;
mod particles;
mod prefetch;
mod redistribute;
mod saved_state;
mod scheme;
mod shape_function;
mod shared_corners;
mod simd;
mod simulation;
mod solver;
mod state;
mod step;
mod support;
mod tensor;
pub mod total_lagrangian;
mod weights;
mod xpic;

pub use body::{Annulus, Body};
pub use body_force::{AtTime, BodyForce, NoBodyForce};
pub use clip::{Clip, Facet, Side};
pub use decomposition::{Arrangement, Share};
pub use error::{SetupError, StepError};
pub use grid::Grid;
pub use kernel::copies::BLOCK;
pub use material::{ConstitutiveLaw, Law, LawCheck, Material, SIDE_BY_SIDE, Stressed, Volumetric};
pub use mesh::{Faces, Interpolation, Load, Mesh, Numbers};
pub use particles::Particles;
pub use saved_state::{SavedState, SavedStateError};
pub use scheme::{Integrator, Settings, Shape, Transfer, UnknownName};
pub use simd::Registers;
pub use simulation::{Simulated, Simulation};
pub use solver::{Scalar, Solver, TotalSetUp};
