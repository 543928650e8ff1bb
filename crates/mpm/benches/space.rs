//! Million particle-steps a second in space, on one thread and on two.
//!
//! A unit cube with 2x2x2 particles a cell between six walls is set in motion without a body force. Each row has the best of some rounds.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use mmsmith_mpm::{
    Grid, Integrator, Law, Material, NoBodyForce, Particles, Settings, Shape, Simulation, Transfer,
};
use nalgebra::Vector3;
use rayon::ThreadPoolBuilder;

const LAMBDA: f64 = 5769.0;
const MU: f64 = 3846.0;
const STEPS: usize = 5;
const ROUNDS: usize = 7;

fn main() {
    // `cargo test --all-targets` calls benchmarks without this, to see that they run.
    let is_measuring = std::env::args().any(|argument| argument == "--bench");
    let (cells, rounds) = if is_measuring { (32, ROUNDS) } else { (6, 1) };
    println!("threads  scheme                            million particle-steps/s");
    for (shape, transfer, integrator) in [
        (Shape::Gimp, Transfer::Flip, Integrator::Cd),
        (Shape::Ugimp, Transfer::Flip, Integrator::Usl),
        (Shape::Gimp, Transfer::Flip, Integrator::Musl),
        (Shape::Bspline2, Transfer::Apic, Integrator::Usl),
        (Shape::Cpdi, Transfer::Flip, Integrator::Cd),
    ] {
        for threads in [1, 2] {
            let rate = rate(cells, rounds, threads, (shape, transfer, integrator));
            let scheme = format!("{shape:?} + {transfer:?} + {integrator:?}");
            println!("{threads:7}  {scheme:32}  {rate:.2}");
        }
    }
}

fn rate(
    cells: usize,
    rounds: usize,
    threads: usize,
    (shape, transfer, integrator): (Shape, Transfer, Integrator),
) -> f64 {
    let speed = (LAMBDA + 2.0 * MU).sqrt();
    let spacing = 1.0 / cells as f64;
    let grid = Grid { lower: Vector3::zeros(), spacing, cells: [cells; 3], walls: [[true; 2]; 3] };
    let mut particles = Particles::lattice(&grid, 2, 1.0, |_| true);
    for (v, X) in particles.v.iter_mut().zip(&particles.X) {
        *v = (X * std::f64::consts::PI).map(f64::sin) * (0.02 * speed * std::f64::consts::PI);
    }
    let count = particles.x.len();
    let time_step = 0.2 * spacing / speed;
    let settings =
        Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false };
    let law = Law::from(Material::NeoHookean { lambda: LAMBDA, mu: MU });
    let mut simulation = Simulation::new(grid, particles, law, settings).unwrap();
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let started = Instant::now();
        pool.install(|| (0..STEPS).for_each(|_| simulation.step(&NoBodyForce).unwrap()));
        best = best.min(started.elapsed().as_secs_f64());
    }
    (count * STEPS) as f64 / best / 1e6
}
