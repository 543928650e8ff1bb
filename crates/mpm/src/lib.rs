//! A material point solver for solids under large deformation, in one, two and three dimensions.
//!
//! Particles carry mass, velocity and deformation gradient. Each step ([`Simulation::step`]) sums mass, momentum and force at
//! the nodes of a background grid of cubic cells (P2G), computes velocities and accelerations there (grid update), and
//! interpolates them at the particles (G2P). Shape functions ([`Shape`]), time integration ([`Integrator`]) and the velocity update
//! ([`Transfer`]) combine freely; high order is in the crate `mmsmith-galerkin`.
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
//! # A law of your own
//!
//! A bar of such a law between two walls, with the body force that makes `u = A sin(Pi X) sin(Pi t)` exact; its error falls by four
//! when the cells are halved:
//!
//! ```
//! use mmsmith_mpm::{
//!     BLOCK, ConstitutiveLaw, Increment, InternalVariable, Grid, Integrator, Law, Particles, Settings, Shape, Simulation, Transfer,
//! };
//! use nalgebra::{Matrix1, Vector1, vector};
//! use std::f64::consts::PI;
//!
//! /// A bar's `P = k (F - F^-3)`, of the energy `k/2 (F - 1/F)^2`.
//! #[derive(Debug)]
//! struct Rubber {
//!     k: f64,
//! }
//!
//! impl ConstitutiveLaw<f64, 1> for Rubber {
//!     fn first_piola_kirchhoff(
//!         &self,
//!         F: &[[[f64; BLOCK]; 1]; 1],
//!         P: &mut [[[f64; BLOCK]; 1]; 1],
//!     ) {
//!         for (P, F) in P[0][0].iter_mut().zip(F[0][0]) {
//!             let H = F - 1.0;
//!             // F^4 - 1 without the difference.
//!             *P = self.k * H * (F + 1.0) * (F * F + 1.0) / F.powi(3);
//!         }
//!     }
//!
//!     fn strain_energy(&self, F: &Matrix1<f64>) -> Option<f64> {
//!         let H = F[0] - 1.0;
//!         Some(0.5 * self.k * (H * (F[0] + 1.0) / F[0]).powi(2))
//!     }
//! }
//!
//! let law = Law::from_constitutive(Rubber { k: 1.0 });
//! // The slope at rest is 4 k.
//! assert!((law.p_wave_modulus() - 4.0).abs() < 1e-6);
//! // Energy, objectivity and symmetry, at strains of up to a fifth.
//! assert!(law.check(0.2).passed());
//!
//! const A: f64 = 0.05;
//!
//! fn body_force(X: &[Vector1<f64>], t: f64, b: &mut [Vector1<f64>]) {
//!     for (b, X) in b.iter_mut().zip(X) {
//!         let (sine, cosine) = (PI * X[0]).sin_cos();
//!         let amplitude = A * (PI * t).sin();
//!         let F = 1.0 + PI * amplitude * cosine;
//!         // The acceleration less dP/dX, for a density of one.
//!         *b = vector![3.0 * PI * PI * amplitude * sine / F.powi(4)];
//!     }
//! }
//!
//! let error = |cells: usize| -> Result<f64, Box<dyn std::error::Error>> {
//!     let spacing = 1.0 / cells as f64;
//!     let grid = Grid { lower: vector![0.0], spacing, cells: [cells], walls: [[true, true]] };
//!     let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
//!     for (v, X) in particles.v.iter_mut().zip(&particles.X) {
//!         *v = vector![A * PI * (PI * X[0]).sin()];
//!     }
//!     let settings = Settings {
//!         shape: Shape::Gimp,
//!         integrator: Integrator::Cd,
//!         transfer: Transfer::Flip,
//!         time_step: 0.1 * spacing,
//!         halve_first_acceleration: true,
//!     };
//!     let mut bar = Simulation::new(grid, particles, law.clone(), settings)?;
//!     for _ in 0..5 * cells {
//!         bar.step(&body_force)?;
//!     }
//!     // At t = 1/2.
//!     let particles = bar.particles();
//!     let positions = particles.X.iter().zip(&particles.x);
//!     let errors = positions.map(|(X, x)| (x[0] - X[0] - A * (PI * X[0]).sin()).abs());
//!     Ok(errors.fold(0.0, f64::max))
//! };
//! let ratio = error(8)? / error(16)?;
//! assert!((3.5..4.5).contains(&ratio), "{ratio}");
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
//! - `every_scheme`: builds of the usual scheme alone.
//! - `particles`: what a particle has; bodies, and meshes of domains that share corners.
//! - `grid`: memory layout, walls, ghost nodes, grid update. `shape`: shape functions and weights.
//! - `domain`: the domains that weights are means over, of each particle alone or on shared corners.
//! - `kernel`: sums over weights in vector instructions, for blocks of particles.
//! - `step`: each integrator as a sequence of `p2g`, `grid_update`, `g2p`; `g2p2g` fuses G2P with the next P2G; `xpic`: its filter.
//! - `processes`: several processes, and the state to resume from.

mod domain;
mod every_scheme;
mod grid;
mod kernel;
mod named;
mod processes;
mod scheme;
mod set_up;
mod shape;
mod simulation;
mod solver;
mod step;

pub use domain::Shape;
pub use every_scheme::EVERY_SCHEME;
pub use grid::division::division_of_lattice;
pub use mmsmith_lanes::simd::Registers;
#[doc(hidden)]
pub use mmsmith_laws::fault;
pub use mmsmith_laws::{
    BLOCK, ConstitutiveLaw, Increment, InternalVariable, Law, LawCheck, LawWithMemory, Material,
    SIDE_BY_SIDE, Stressed, Volumetric,
};
pub use mmsmith_particles::{
    Annulus, Arrangement, AtTime, Body, BodyForce, Division, Faces, Grid, Interpolation, Load,
    Mesh, NoBodyForce, Numbers, Particles, Pass, PassTime, Profile, SavedState, SavedStateError,
    SetupError, Solver, StepError, replace_whole,
};
pub use named::UnknownName;
pub use processes::decomposition::Share;
pub use scheme::{Integrator, Settings, Transfer};
pub use simulation::{Simulated, Simulation};
pub use solver::Scalar;
