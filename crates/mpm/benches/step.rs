//! Particle-steps a second: a plain loop as one writes it without a library, and the solver's schemes.
//!
//! Each sample advances a unit square with 2x2 particles a cell between four walls, which is set in motion without a body
//! force; "items" are particle-steps. The plain loop is UGIMP and USL for one law, in two dimensions and on one thread,
//! with the weights worked out twice a step and particles stored cell by cell.

#![allow(clippy::unwrap_used)]

mod square;

use divan::Bencher;
use divan::counter::ItemsCount;
use mmsmith_mpm::{Integrator, NoBodyForce, Shape};
use rayon::{ThreadPool, ThreadPoolBuilder};

use square::{LAMBDA, MU, simulation, time_step};

const CELLS: usize = 256;
const STEPS: usize = 10;
const ITEMS: usize = 4 * CELLS * CELLS * STEPS;

fn main() {
    divan::main();
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn plain_loop(bencher: Bencher) {
    bencher.counter(ItemsCount::new(ITEMS)).with_inputs(Plain::new).bench_local_refs(|plain| {
        (0..STEPS).for_each(|_| plain.step());
    });
}

#[divan::bench(
    sample_count = 15,
    sample_size = 1,
    args = [
        (Shape::Ugimp, Integrator::Usl, 1),
        (Shape::Ugimp, Integrator::Usl, 2),
        (Shape::Gimp, Integrator::Cd, 1),
        (Shape::Gimp, Integrator::Cd, 2),
        (Shape::Linear, Integrator::Cd, 1),
        (Shape::Gimp, Integrator::Usf, 1),
        (Shape::Gimp, Integrator::Musl, 1),
    ],
)]
fn solver(bencher: Bencher, (shape, integrator, threads): (Shape, Integrator, usize)) {
    let pool: ThreadPool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    bencher
        .counter(ItemsCount::new(ITEMS))
        .with_inputs(|| simulation(CELLS, shape, integrator))
        .bench_local_refs(|simulation| {
            pool.install(|| (0..STEPS).for_each(|_| simulation.step(&NoBodyForce).unwrap()));
        });
}

/// A node of the plain loop.
#[derive(Clone, Copy, Default)]
struct Node {
    m: f64,
    p: [f64; 2],
    f: [f64; 2],
}

/// Nodes beyond the body on each side.
const PAD: usize = 2;
const ROW: usize = CELLS + 2 * PAD + 1;
const H: f64 = 1.0 / CELLS as f64;

/// The plain loop's particles and nodes.
struct Plain {
    x: Vec<[f64; 2]>,
    v: Vec<[f64; 2]>,
    F: Vec<[f64; 4]>,
    nodes: Vec<Node>,
}

impl Plain {
    fn new() -> Self {
        let particles = simulation(CELLS, Shape::Ugimp, Integrator::Usl).particles().clone();
        Self {
            x: particles.x.iter().map(|x| [x[0], x[1]]).collect(),
            v: particles.v.iter().map(|v| [v[0], v[1]]).collect(),
            F: vec![[1.0, 0.0, 0.0, 1.0]; particles.len()],
            nodes: vec![Node::default(); ROW * ROW],
        }
    }

    fn step(&mut self) {
        let (volume, dt) = (H * H / 4.0, time_step(CELLS));
        self.nodes.fill(Node::default());
        for ((x, v), F) in self.x.iter().zip(&self.v).zip(&self.F) {
            let ((bi, sx, gx), (bj, sy, gy)) = (weights(x[0]), weights(x[1]));
            let [a, b, d, e] = *F;
            let l = LAMBDA * (a * e - b * d).ln();
            let t00 = -volume * (MU * (a * a + b * b - 1.0) + l);
            let t01 = -volume * MU * (a * d + b * e);
            let t11 = -volume * (MU * (d * d + e * e - 1.0) + l);
            for j in 0..3 {
                let row = &mut self.nodes[(bj + j) * ROW + bi..][..3];
                for i in 0..3 {
                    let (S, Gx, Gy) = (sx[i] * sy[j], gx[i] * sy[j], sx[i] * gy[j]);
                    row[i].m += S * volume;
                    row[i].p[0] += S * volume * v[0];
                    row[i].p[1] += S * volume * v[1];
                    row[i].f[0] += t00 * Gx + t01 * Gy;
                    row[i].f[1] += t01 * Gx + t11 * Gy;
                }
            }
        }
        for (index, node) in self.nodes.iter_mut().enumerate() {
            let inverse = if node.m > 1e-14 { 1.0 / node.m } else { 0.0 };
            for (axis, place) in [index % ROW, index / ROW].into_iter().enumerate() {
                let a = node.f[axis] * inverse;
                let wall = place <= PAD || place >= PAD + CELLS;
                node.f[axis] = if wall { 0.0 } else { a };
                node.p[axis] = if wall { 0.0 } else { node.p[axis] * inverse + dt * a };
            }
        }
        for ((x, v), F) in self.x.iter_mut().zip(&mut self.v).zip(&mut self.F) {
            let ((bi, sx, gx), (bj, sy, gy)) = (weights(x[0]), weights(x[1]));
            let (mut velocity, mut acceleration, mut L) = ([0.0; 2], [0.0; 2], [0.0; 4]);
            for j in 0..3 {
                let row = &self.nodes[(bj + j) * ROW + bi..][..3];
                for i in 0..3 {
                    let (S, Gx, Gy) = (sx[i] * sy[j], gx[i] * sy[j], sx[i] * gy[j]);
                    for axis in 0..2 {
                        velocity[axis] += S * row[i].p[axis];
                        acceleration[axis] += S * row[i].f[axis];
                        L[2 * axis] += row[i].p[axis] * Gx;
                        L[2 * axis + 1] += row[i].p[axis] * Gy;
                    }
                }
            }
            for axis in 0..2 {
                x[axis] += dt * velocity[axis];
                v[axis] += dt * acceleration[axis];
            }
            let [a, b, d, e] = *F;
            *F = [
                a + dt * (L[0] * a + L[1] * d),
                b + dt * (L[0] * b + L[1] * e),
                d + dt * (L[2] * a + L[3] * d),
                e + dt * (L[2] * b + L[3] * e),
            ];
        }
    }
}

/// First node, weights and gradients along an axis, for half-size h/4.
#[inline(always)]
fn weights(x: f64) -> (usize, [f64; 3], [f64; 3]) {
    let l = H / 4.0;
    let base = ((x - l) / H + PAD as f64) as usize;
    let r0 = x - (base as f64 - PAD as f64) * H;
    let (mut S, mut G) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let r = r0 - k as f64 * H;
        let (a, sign) = (r.abs(), if r > 0.0 { -1.0 } else { 1.0 });
        let q = (H + l - a).max(0.0);
        (S[k], G[k]) = if a < l {
            (1.0 - (r * r + l * l) / (2.0 * H * l), -r / (H * l))
        } else if a < H - l {
            (1.0 - a / H, sign / H)
        } else {
            (q * q / (4.0 * H * l), sign * q / (2.0 * H * l))
        };
    }
    (base, S, G)
}
