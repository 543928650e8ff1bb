//! Bits do not depend on the vector registers and from any number of threads.

#![allow(clippy::unwrap_used)]

use mmsmith_mpm::{
    Body, Grid, Integrator, Material, NoBodyForce, Particles, Registers, Scalar, Settings, Shape,
    Simulation, Transfer,
};
use nalgebra::SVector;

#[derive(Clone, Copy, Debug)]
struct Scheme {
    shape: Shape,
    integrator: Integrator,
    transfer: Transfer,
}

/// The state of a square or a cube after some steps, as bits.
fn bits<T: Scalar<D>, const D: usize>(
    registers: Registers,
    threads: usize,
    Scheme { shape, integrator, transfer }: Scheme,
) -> Vec<u64> {
    registers.use_at_most();
    let number = nalgebra::convert::<f64, T>;
    // Of two layers in the plane, of two layers of three tiles in space.
    let cells = if D == 3 { 5 } else { 21 };
    let spacing = number(1.0 / cells as f64);
    let along = [3, 12, 16];
    let cells = std::array::from_fn(|a| if D == 3 { along[a] } else { cells });
    let walls = [[true; 2]; D];
    let grid = Grid { lower: SVector::zeros(), spacing, cells, walls };
    let mut body = Body::lattice(&grid, 2, number(1.0), |_| true);
    for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
        let angle: SVector<T, D> = X * T::pi();
        // Along each axis it changes with the next one too, for gradients off the diagonal.
        *v = SVector::from_fn(|a, _| number(20.0) * angle[a].sin() * angle[(a + 1) % D].cos());
    }
    let material = Material::NeoHookean { lambda: number(5769.0), mu: number(3846.0) };
    let time_step = number(2e-4);
    let settings =
        Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut simulation = Simulation::new(grid, body, material, settings).unwrap();
        let steps = if D == 3 { 2 } else { 5 };
        (0..steps).for_each(|_| simulation.step(&NoBodyForce).unwrap());
        let Particles { x, v, F, .. } = simulation.particles();
        let numbers = x.iter().chain(v).flatten().chain(F.iter().flatten());
        numbers.map(|&value| nalgebra::convert_unchecked::<T, f64>(value).to_bits()).collect()
    })
}

/// Every shape function with every transfer; integrators take turns, so that each meets each shape and each transfer.
fn schemes() -> impl Iterator<Item = Scheme> {
    let transfers = [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)];
    Shape::ALL.iter().enumerate().flat_map(move |(i, &shape)| {
        transfers.into_iter().enumerate().map(move |(j, transfer)| {
            let turn = (i + 2 * j) % Integrator::ALL.len();
            Scheme { shape, integrator: Integrator::ALL[turn], transfer }
        })
    })
}

const THREADS: [usize; 5] = [1, 2, 3, 5, 8];

/// The widest registers with so many of the numbers of threads for each scheme, in turn; the others with two threads for every fifth.
fn check<T: Scalar<D>, const D: usize>(numbers: usize) {
    for (n, scheme) in schemes().enumerate() {
        let plain = bits::<T, D>(Registers::Scalar, 1, scheme);
        for (turn, registers) in Registers::present().into_iter().rev().enumerate() {
            let of_threads = (0..numbers).map(|k| THREADS[(n + 2 * k) % THREADS.len()]);
            for threads in of_threads.filter(|&threads| turn == 0 || threads == turn + 1) {
                let same = bits::<T, D>(registers, threads, scheme) == plain;
                assert!(same, "{D} {scheme:?} {registers:?} {threads} threads");
            }
        }
    }
}

#[test]
fn all_registers_and_numbers_of_threads_give_the_same_bits() {
    check_all(1);
}

#[test]
#[ignore = "half a minute: .ci/long runs it"]
fn so_it_is_of_every_scheme_with_every_number_of_threads() {
    check_all(THREADS.len());
}

fn check_all(numbers: usize) {
    check::<f64, 1>(numbers);
    check::<f64, 2>(numbers);
    check::<f64, 3>(numbers);
    check::<f32, 1>(numbers);
    check::<f32, 2>(numbers);
    check::<f32, 3>(numbers);
    Registers::WIDEST.use_at_most();
}
