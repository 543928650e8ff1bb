//! How many times as long a step takes with plastic flow, with Maxwell elements, and for bodies of revolution, as with the elastic law alone
//! in the plane.
//!
//! Simulations of the same square (gimp + cd, one thread) are advanced in turn for many rounds: a machine whose speed wanders does so for
//! all. Stated are medians of the quotients of times within a round, and the share of the particles that flow in it.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod square;

use std::time::Instant;

use mmsmith_laws::{Element, Flow, HalfPlane, Memory, ReturnMap, WithMemory, with_memory};
use mmsmith_mpm::{
    Body, Grid, Integrator, Law, Material, NoBodyForce, Particles, Settings, Shape, Simulation,
    StepError, Transfer, Volumetric,
};
use nalgebra::{Vector3, vector};
use rayon::ThreadPoolBuilder;

use square::{LAMBDA, MU, simulation_of, time_step};

const STEPS: usize = 10;

fn main() {
    // `cargo test --all-targets` calls benchmarks without this, to see that they run.
    let is_measuring = std::env::args().any(|argument| argument == "--bench");
    let (cells, rounds) = if is_measuring { (128, 30) } else { (16, 1) };
    let hencky = Material::Hencky { lambda: LAMBDA, mu: MU };
    let flow = |yield_stress| Flow {
        yield_stress,
        modulus: 500.0,
        exponent: 1.0,
        overstress: None,
        is_on_yield: false,
    };
    let plastic = |yield_stress, map| {
        let memory = Memory::Flow(flow(yield_stress));
        with_memory(WithMemory { elastic: hencky, memory }, map).unwrap()
    };
    let gent =
        Material::Gent { mu: MU, Jm: 20.0, kappa: LAMBDA, volumetric: Volumetric::Logarithmic };
    let elements = vec![Element { share: 0.3, time: 1e-3 }, Element { share: 0.2, time: 1e-2 }];
    let maxwell = WithMemory { elastic: gent, memory: Memory::Maxwell(elements) };
    compare(
        cells,
        rounds,
        "hencky",
        "j2, elastic",
        Law::from(hencky),
        plastic(1e9, ReturnMap::Exponential),
    );
    compare(
        cells,
        rounds,
        "hencky",
        "j2, flowing",
        Law::from(hencky),
        plastic(5.0, ReturnMap::Exponential),
    );
    compare(
        cells,
        rounds,
        "hencky",
        "j2, midpoint",
        Law::from(hencky),
        plastic(5.0, ReturnMap::Midpoint),
    );
    let neo_hookean = Material::NeoHookean { lambda: LAMBDA, mu: MU };
    let half_plane = HalfPlane::new(Law::from(neo_hookean)).unwrap();
    compare(
        cells,
        rounds,
        "neo-hookean",
        "half plane of revolution",
        Law::from(neo_hookean),
        Law::with_memory(half_plane),
    );
    compare_turning(cells, rounds, Law::from(neo_hookean));
    let maxwell = with_memory(maxwell, ReturnMap::default()).unwrap();
    compare(cells, rounds, "gent", "gent, 2 elements", Law::from(gent), maxwell);
}

/// Whether a word of the command line chooses a row, or none is there.
fn is_chosen(name: &str) -> bool {
    let mut chosen = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    chosen.next().is_none_or(|word| name.contains(&word))
}

/// As [`compare`], of a solid cylinder that turns about its axis.
fn compare_turning(cells: usize, rounds: usize, elastic: Law<f64, 2>) {
    let name = "revolution with a turn";
    if !is_chosen(name) {
        return;
    }
    let walls = [[false; 2], [false; 2], [true; 2]];
    let spacing = 1.0 / cells as f64;
    let grid = Grid { lower: Vector3::zeros(), spacing, cells: [cells + 8, 1, cells], walls };
    let mut particles = Particles::lattice(&grid, 2, 1.0, |X| X[0] < 1.0 && X[1] < 0.5 * spacing);
    let Particles { X, x, v, mass, volume, .. } = &mut particles;
    for (((X, x), v), (mass, volume)) in X.iter_mut().zip(x).zip(v).zip(mass.iter_mut().zip(volume))
    {
        (X[1], x[1]) = (0.0, 0.0);
        let around = std::f64::consts::TAU * X[0] / (0.5 * spacing);
        (*mass, *volume) = (*mass * around, *volume * around);
        let swing = X[0] * (1.0 - X[0]) * (std::f64::consts::PI * X[2]).cos();
        *v = vector![0.5 * swing, 2.0 * swing + X[0], 0.0];
    }
    let body = Body { revolves: true, ..particles.into() };
    let settings = Settings {
        shape: Shape::Gimp,
        integrator: Integrator::Cd,
        transfer: Transfer::Flip,
        time_step: time_step(cells),
        halve_first_acceleration: false,
    };
    let material = Material::NeoHookean { lambda: LAMBDA, mu: MU };
    let mut own = Simulation::new(grid, body, material, settings).unwrap();
    let mut plane = simulation_of(elastic, cells, Shape::Gimp, Integrator::Cd);
    let mut quotients: Vec<f64> = (0..rounds)
        .map(|_| {
            let first = time(|| plane.step(&NoBodyForce));
            time(|| own.step(&NoBodyForce)) / first
        })
        .collect();
    quotients.sort_by(f64::total_cmp);
    println!("neo-hookean; {name}: {:.2} times as long", quotients[quotients.len() / 2]);
}

/// Seconds that some steps take on one thread.
fn time(mut step: impl FnMut() -> Result<(), StepError> + Send) -> f64 {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let started = Instant::now();
    pool.install(|| (0..STEPS).for_each(|_| step().unwrap()));
    started.elapsed().as_secs_f64()
}

fn compare(
    cells: usize,
    rounds: usize,
    of: &str,
    name: &str,
    elastic: Law<f64, 2>,
    law: Law<f64, 2>,
) {
    if !is_chosen(name) {
        return;
    }
    let law_variables = law.variables().len();
    let simulation = |law| simulation_of(law, cells, Shape::Gimp, Integrator::Cd);
    let [mut elastic, mut own] = [elastic, law].map(simulation);
    let variables = law_variables.max(1);
    let alphas = |simulation: &Simulation<f64, 2>| -> Vec<f64> {
        // The last variable of a law with flow.
        let all = simulation.particles().internal.iter();
        all.skip(variables - 1).step_by(variables).copied().collect()
    };
    let (mut quotients, mut flowing) = (Vec::new(), 0.0);
    let mut alone = f64::INFINITY;
    for _ in 0..rounds {
        let before = alphas(&own);
        let [first, second] =
            [time(|| elastic.step(&NoBodyForce)), time(|| own.step(&NoBodyForce))];
        alone = alone.min(first);
        quotients.push(second / first);
        let flown = before.iter().zip(alphas(&own)).filter(|(before, after)| *before < after);
        flowing += flown.count() as f64 / before.len().max(1) as f64 / rounds as f64;
    }
    quotients.sort_by(f64::total_cmp);
    let quotient = quotients[quotients.len() / 2];
    let per_step = alone / (STEPS * 4 * cells * cells) as f64 * 1e9;
    println!(
        "{of}: {per_step:.1} ns; {name}: {quotient:.2} times as long, {:.0} % flow",
        100.0 * flowing
    );
}
