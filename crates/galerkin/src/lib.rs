//! Material points on splines in the reference configuration, to high order in space and time.
//!
//! All weights are taken once, at the reference positions: nothing crosses cells, and the scheme is a Galerkin method
//! whose quadrature points are the particles. With splines `N_i` of degree p on a tensor-product grid,
//!
//! ```text
//! u = sum u_i N_i;  F = I + sum u_i (x) dN_i/dX;  M_ij = sum m_p N_i N_j
//! f_i = -sum V0_p P_p dN_i/dX + sum m_p b(X_p, t) N_i;  M du_i/dt = M v_i;  M dv/dt = f
//! ```
//!
//! integrated by symmetric compositions of leapfrog. For bodies without contact, cracks or separation: a body that
//! would need another reference configuration stays with the updated-Lagrangian `mmsmith-mpm`.
//!
//! # Example
//!
//! A bar between two walls, set in motion:
//!
//! ```
//! use mmsmith_galerkin::*;
//! use mmsmith_laws::Material;
//! use mmsmith_particles::NoBodyForce;
//! use nalgebra::vector;
//!
//! let grid = Grid {
//!     axes: [Axis { lower: 0.0, upper: 1.0, cells: 10, ends: [End::Wall; 2] }],
//!     coordinates: Coordinates::Cartesian,
//!     per_cell: 2,
//!     layout: Layout::Lattice,
//! };
//! let scheme = Scheme { degree: 3, mass: MassMatrix::Consistent, composition: Composition::Order4 };
//! let material = Material::NeoHookean { lambda: 5769.0, mu: 3846.0 };
//! let mut bar = TotalLagrangian::new(grid, scheme, material, 1.0, 4e-4)?;
//! let v: Vec<_> = bar.positions().iter().map(|X| X.map(|x| (std::f64::consts::PI * x).sin())).collect();
//! bar.start(&vec![vector![0.0]; v.len()], &v)?;
//! for _ in 0..100 {
//!     bar.step(&NoBodyForce)?;
//! }
//! assert!(bar.observe().F.iter().all(|F| F.determinant() > 0.9));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Sources: de Vaucorbeil, Nguyen & Hutchinson, "A Total-Lagrangian Material Point Method", CMAME 360 (2020) 112783;
//! Hughes, Cottrell & Bazilevs, "Isogeometric analysis", CMAME 194 (2005) 4135-4195.

mod axis;
mod basis;
mod boundary;
mod component;
mod composition;
mod coordinates;
mod fit;
mod gradient;
mod linearised;
mod mass;
mod projection;
mod quadrature;
mod set_up;
mod simulation;
mod solver;
mod statics;
mod stress;

pub use axis::{Axis, End, Layout};
pub use boundary::{BoundaryData, HeldBoundary, Quantity, Side};
pub use composition::Composition;
pub use coordinates::Coordinates;
pub use linearised::{Disturbed, Magnitude};
pub use mmsmith_sparse::Factors;
pub use mmsmith_vocabulary::ComponentCondition;
pub use set_up::{Grid, MassMatrix, Scheme};
pub use simulation::TotalLagrangian;
pub use solver::SetUp;
pub use statics::{
    AtRest, Equilibrium, LINEAR, LoadStep, Loads, Obstacle, QUADRATIC, Reached, StaticsError,
    newton_exponent,
};

/// How many of so many numbers a thread takes at a time: four pieces for each thread, so that none waits long for the last, but not so few
/// that handing them out takes longer than the work. No sum is cut, so that the bits do not depend on it.
fn piece(numbers: usize) -> usize {
    const LEAST: usize = 1024;
    const MOST: usize = 8192;
    match mmsmith_threads::parallel::current_num_threads() {
        1 => MOST,
        threads => numbers.div_ceil(4 * threads).clamp(LEAST, MOST),
    }
}
