//! The scene: a unit square with 2x2 particles a cell between four walls, set in motion without a body force.

use mmsmith_mpm::{
    Grid, Integrator, Law, Material, Particles, Settings, Shape, Simulation, Transfer,
};
use nalgebra::{Vector2, vector};

pub(crate) const LAMBDA: f64 = 5769.0;
pub(crate) const MU: f64 = 3846.0;

/// The speed of P-waves.
fn speed() -> f64 {
    (LAMBDA + 2.0 * MU).sqrt()
}

fn velocity(X: &Vector2<f64>) -> Vector2<f64> {
    let angle = X * std::f64::consts::PI;
    vector![angle[0].sin(), angle[1].sin()] * (0.02 * speed() * std::f64::consts::PI)
}

pub(crate) fn time_step(cells: usize) -> f64 {
    0.2 / (cells as f64 * speed())
}

#[allow(dead_code)] // Of some benches.
pub(crate) fn simulation(cells: usize, shape: Shape, integrator: Integrator) -> Simulation<f64, 2> {
    simulation_of(Material::NeoHookean { lambda: LAMBDA, mu: MU }, cells, shape, integrator)
}

pub(crate) fn simulation_of(
    law: impl Into<Law<f64, 2>>,
    cells: usize,
    shape: Shape,
    integrator: Integrator,
) -> Simulation<f64, 2> {
    let spacing = 1.0 / cells as f64;
    let grid = Grid { lower: Vector2::zeros(), spacing, cells: [cells; 2], walls: [[true; 2]; 2] };
    let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
    for (v, X) in particles.v.iter_mut().zip(&particles.X) {
        *v = velocity(X);
    }
    let time_step = time_step(cells);
    let transfer = Transfer::Flip;
    let settings =
        Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false };
    Simulation::new(grid, particles, law.into(), settings).unwrap()
}
