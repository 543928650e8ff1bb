//! Particle-steps per second of one scheme: `speed CELLS STEPS REPETITIONS [linear|ugimp|gimp] [usf|usl|musl|cd] [THREADS]`.
//!
//! The body is a square with 2x2 particles a cell between four walls, set in motion, without body force.

use std::io::Write;
use std::time::Instant;

use mmsmith_mpm::{
    Grid, Integrator, Material, NoBodyForce, Particles, Settings, Shape, Simulation,
};
use nalgebra::{Vector2, vector};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: usize| args.get(k).map_or(Ok(default), |a| a.parse());
    let (cells, steps, repetitions) = (number(0, 128)?, number(1, 100)?, number(2, 5)?);
    let shape = match args.get(3).map(String::as_str) {
        Some("linear") => Shape::Linear,
        Some("ugimp") => Shape::Ugimp,
        _ => Shape::Gimp,
    };
    let integrator = match args.get(4).map(String::as_str) {
        Some("usf") => Integrator::Usf,
        Some("usl") => Integrator::Usl,
        Some("musl") => Integrator::Musl,
        _ => Integrator::Cd,
    };
    let threads = number(5, 1)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut rates = Vec::new();
    for _ in 0..repetitions {
        let mut simulation = scene(cells, shape, integrator)?;
        let start = Instant::now();
        pool.install(|| (0..steps).try_for_each(|_| simulation.step(&NoBodyForce)))?;
        let work = (steps * simulation.particles().len()) as f64;
        rates.push(work / start.elapsed().as_secs_f64() / 1e6);
    }
    rates.sort_by(f64::total_cmp);
    let (median, best) = (rates[rates.len() / 2], rates[rates.len() - 1]);
    writeln!(
        std::io::stdout(),
        "{shape:?} {integrator:?}, {cells} cells, {threads} threads: median {median:.2}, best {best:.2} \
         million particle-steps a second"
    )?;
    Ok(())
}

fn scene(
    cells: usize,
    shape: Shape,
    integrator: Integrator,
) -> Result<Simulation<f64, 2>, mmsmith_mpm::SetupError> {
    let (lambda, mu) = (5769.0, 3846.0);
    let speed = f64::sqrt(lambda + 2.0 * mu);
    let spacing = 1.0 / cells as f64;
    let grid = Grid { lower: Vector2::zeros(), spacing, cells: [cells; 2], walls: [[true; 2]; 2] };
    let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
    for (v, X) in particles.v.iter_mut().zip(&particles.X) {
        let angle = X * std::f64::consts::PI;
        *v = vector![angle[0].sin(), angle[1].sin()] * (0.02 * speed * std::f64::consts::PI);
    }
    let settings = Settings {
        shape,
        integrator,
        time_step: 0.2 * spacing / speed,
        halve_first_acceleration: false,
    };
    Simulation::new(grid, particles, Material::NeoHookean { lambda, mu }, settings)
}
