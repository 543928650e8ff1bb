//! How many times as long a step takes with plastic flow, and with Maxwell elements, as with the elastic law alone.
//!
//! Simulations of the same square (gimp + cd, one thread) are advanced in turn for many rounds: a machine whose speed wanders does so for
//! all. Stated are medians of the quotients of times within a round, and the share of the particles that flow in it.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod square;

use std::time::Instant;

use mmsmith_laws::{Element, Flow, HalfPlane, Memory, ReturnMap, WithMemory, with_memory};
use mmsmith_mpm::{Integrator, Law, Material, NoBodyForce, Shape, Simulation, Volumetric};
use rayon::ThreadPoolBuilder;

use square::{LAMBDA, MU, simulation_of};

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
    let maxwell = with_memory(maxwell, ReturnMap::default()).unwrap();
    compare(cells, rounds, "gent", "gent, 2 elements", Law::from(gent), maxwell);
}

fn compare(
    cells: usize,
    rounds: usize,
    of: &str,
    name: &str,
    elastic: Law<f64, 2>,
    law: Law<f64, 2>,
) {
    // A word of the command line chooses some of them.
    let mut chosen = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    if chosen.next().is_some_and(|word| !name.contains(&word)) {
        return;
    }
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let law_variables = law.variables().len();
    let simulation = |law| simulation_of(law, cells, Shape::Gimp, Integrator::Cd);
    let [mut elastic, mut own] = [elastic, law].map(simulation);
    let time = |simulation: &mut Simulation<f64, 2>| {
        let started = Instant::now();
        pool.install(|| (0..STEPS).for_each(|_| simulation.step(&NoBodyForce).unwrap()));
        started.elapsed().as_secs_f64()
    };
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
        let [first, second] = [time(&mut elastic), time(&mut own)];
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
