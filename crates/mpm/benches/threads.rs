//! How many times as fast some threads make the solver's step as one does, and what the machine's cores allow.
//!
//! One simulation is advanced by some steps on one thread and by as many on several, and then as many simulations as there
//! are threads side by side, each on its own, in turn for many rounds: a machine whose speed wanders does so for all. A unit
//! square with 2x2 particles a cell between four walls is set in motion without a body force (ugimp + usl). Stated are
//! quotients of the times of all rounds, and the quartiles of those of each.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod square;

use std::time::Instant;

use mmsmith_mpm::{Integrator, NoBodyForce, Shape, Simulation};
use rayon::{ThreadPool, ThreadPoolBuilder};

use square::simulation;

const STEPS: usize = 20;
/// For 256 cells; as many fewer as there are more.
const ROUNDS: usize = 40;

fn main() {
    // `cargo test --all-targets` calls benchmarks without this, to see that they run.
    let is_measuring = std::env::args().any(|argument| argument == "--bench");
    let cores = std::thread::available_parallelism().unwrap().get();
    println!("cells   threads  times as fast as one        as many runs side by side");
    for cells in if is_measuring { vec![256, 512] } else { vec![16] } {
        for threads in std::iter::successors(Some(2), |n| Some(2 * n)).take_while(|&n| n <= cores) {
            let rounds = if is_measuring { ROUNDS * 256 / cells } else { 1 };
            compare(cells, threads, rounds);
        }
    }
}

fn compare(cells: usize, threads: usize, rounds: usize) {
    let pool = |threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let several = pool(threads);
    let mut own: Vec<_> =
        (0..threads).map(|_| (pool(1), simulation(cells, Shape::Ugimp, Integrator::Usl))).collect();
    let round = |_| {
        let (one, first) = &mut own[0];
        let alone = seconds(one, first);
        let together = seconds(&several, first);
        let side_by_side = std::thread::scope(|scope| {
            let run = |(pool, simulation): &mut _| seconds(pool, simulation);
            let runs: Vec<_> = own.iter_mut().map(|own| scope.spawn(move || run(own))).collect();
            runs.into_iter().map(|run| run.join().unwrap()).sum::<f64>() / threads as f64
        });
        [alone, together, side_by_side / threads as f64]
    };
    let rounds: Vec<_> = (0..rounds).map(round).collect();
    let quotients = |of: usize| {
        let mut each: Vec<_> = rounds.iter().map(|round| round[0] / round[of]).collect();
        each.sort_by(f64::total_cmp);
        let [low, middle, high] = [1, 2, 3].map(|n| each[(each.len() - 1) * n / 4]);
        let sum = |of: usize| rounds.iter().map(|round| round[of]).sum::<f64>();
        format!("{:.2} ({low:.2}, {middle:.2}, {high:.2})", sum(0) / sum(of))
    };
    println!("{cells:3}^2  {threads:8}  {}     {}", quotients(1), quotients(2));
}

/// Time that some steps take.
fn seconds(pool: &ThreadPool, simulation: &mut Simulation<f64, 2>) -> f64 {
    let mut steps = |count| (0..count).for_each(|_| simulation.step(&NoBodyForce).unwrap());
    pool.install(|| {
        // Threads that slept may have to be moved to a core of their own first.
        steps(STEPS / 4);
        let started = Instant::now();
        steps(STEPS);
        started.elapsed().as_secs_f64()
    })
}
