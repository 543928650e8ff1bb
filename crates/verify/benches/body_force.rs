//! Cost of the exact body force in a simulation: a step without it, a step with it, and the force alone.
//!
//! Each sample advances the axis-aligned problem (a unit square of 256 x 256 cells, 2x2 particles a cell, four walls) by
//! two steps on one thread; "items" are particle-steps.

#![allow(clippy::unwrap_used)]

use divan::Bencher;
use divan::counter::ItemsCount;
use mmsmith_mpm::{
    AtTime, BodyForce, Grid, Integrator, NoBodyForce, Particles, Settings, Shape, Simulation,
    Transfer,
};
use mmsmith_solutions::{AxisAligned, AxisAlignedParameters, BodyForceAtPoints, Law, Solution};
use nalgebra::Vector2;
use rayon::ThreadPoolBuilder;

const CELLS: usize = 256;
const STEPS: usize = 2;
const ITEMS: usize = 4 * CELLS * CELLS * STEPS;

fn main() {
    divan::main();
}

struct Exact<'a>(Box<dyn BodyForceAtPoints<f64, 2> + 'a>);

impl BodyForce<f64, 2> for Exact<'_> {
    fn evaluate(&self, first: usize, _X: &[Vector2<f64>], t: f64, b: &mut [Vector2<f64>]) {
        self.0.evaluate(t, first, b);
    }

    fn of_time(&self, t: f64, values: &mut Vec<f64>) {
        self.0.of_time(t, values);
    }

    fn evaluate_of(
        &self,
        ids: &[u32],
        _X: &[Vector2<f64>],
        time: AtTime<'_, f64>,
        b: &mut [Vector2<f64>],
    ) {
        self.0.evaluate_of(time.values, ids, b);
    }
}

#[divan::bench(
    sample_count = 60,
    sample_size = 1,
    args = [(Shape::Ugimp, Integrator::Usl), (Shape::Gimp, Integrator::Cd)],
)]
fn without(bencher: Bencher, scheme: (Shape, Integrator)) {
    steps(bencher, scheme, &NoBodyForce);
}

#[divan::bench(
    sample_count = 60,
    sample_size = 1,
    args = [(Shape::Ugimp, Integrator::Usl), (Shape::Gimp, Integrator::Cd)],
)]
fn with(bencher: Bencher, scheme: (Shape, Integrator)) {
    let exact = AxisAligned::new(AxisAlignedParameters::default()).unwrap();
    let X = simulation(scheme).particles().X.clone();
    steps(bencher, scheme, &Exact(exact.body_force_at(&X)));
}

#[divan::bench(sample_count = 60, sample_size = 1)]
fn alone(bencher: Bencher) {
    let exact = AxisAligned::new(AxisAlignedParameters::default()).unwrap();
    let X = simulation((Shape::Ugimp, Integrator::Usl)).particles().X.clone();
    let force = exact.body_force_at(&X);
    let mut b = vec![Vector2::zeros(); X.len()];
    bencher.counter(ItemsCount::new(ITEMS)).bench_local(|| {
        (0..STEPS).for_each(|step| force.evaluate(1e-3 * step as f64, 0, &mut b));
    });
}

fn steps(bencher: Bencher, scheme: (Shape, Integrator), force: &dyn BodyForce<f64, 2>) {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut simulation = simulation(scheme);
    bencher.counter(ItemsCount::new(ITEMS)).bench_local(|| {
        pool.install(|| (0..STEPS).for_each(|_| simulation.step(force).unwrap()));
    });
}

fn simulation((shape, integrator): (Shape, Integrator)) -> Simulation<f64, 2> {
    let exact = AxisAligned::<f64>::new(AxisAlignedParameters::default()).unwrap();
    let spacing = 1.0 / CELLS as f64;
    let grid = Grid { lower: Vector2::zeros(), spacing, cells: [CELLS; 2], walls: [[true; 2]; 2] };
    let mut particles = Particles::lattice(&grid, 2, exact.density(), |_| true);
    for (v, X) in particles.v.iter_mut().zip(&particles.X) {
        *v = exact.velocity(X, 0.0);
    }
    let time_step = 0.2 * spacing / exact.wave_speed();
    let transfer = Transfer::Flip;
    let settings =
        Settings { shape, integrator, transfer, time_step, halve_first_acceleration: false };
    let Law::Library(material) = exact.law() else { unreachable!() };
    Simulation::new(grid, particles, material, settings).unwrap()
}
