//! Nanoseconds a point of the interpreted body force of the ring: as a solver takes it, and as arrays.
//! `python/benchmarks/points.py` measures the same from Python; `RAYON_NUM_THREADS=1` leaves arrays to one thread.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use mmsmith_interpret::{Arrays, Quantity, interpret_staged};
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_runtime::{AnySolution, BLOCK, Domain, Solution};
use mmsmith_spec::Spec;
use mmsmith_stage::{FieldName, Staged};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use std::time::Instant;

const POINTS: usize = 1_000_000;
const TIMES: usize = 9;

/// The median time of a call, for all points.
fn tell(what: &str, call: impl FnMut(f64)) {
    tell_shared(what, POINTS, call);
}

/// The median time of a call, for so many points.
fn tell_shared(what: &str, points: usize, mut call: impl FnMut(f64)) {
    let mut times: Vec<f64> = (0..TIMES)
        .map(|n| {
            let begun = Instant::now();
            call(1e-3 * n as f64);
            begun.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{what:<28} {:6.1} ns a point", times[TIMES / 2] / points as f64 * 1e9);
}

/// The body force of a law with memory, from series of particles in the blocks in which a solver takes them.
fn tell_of_memory(name: &str, text: &str) {
    let spec = Spec::parse(text, name).unwrap();
    let staged = Staged::of(&spec, spec.derive().unwrap());
    match interpret_staged(&spec, &staged, []).unwrap() {
        AnySolution::One(solution) => tell_of_blocks(name, solution.as_ref()),
        AnySolution::Two(solution) => tell_of_blocks(name, solution.as_ref()),
        AnySolution::Three(solution) => tell_of_blocks(name, solution.as_ref()),
        _ => {}
    }
}

/// Multiples of irrational numbers: spread over the body, and no lattice.
fn share(n: usize, axis: usize) -> f64 {
    const STEPS: [f64; 3] = [0.618_033_988_75, 0.754_877_666_25, 0.569_840_290_998];
    (n as f64 * STEPS[axis]).fract()
}

fn tell_of_blocks<const D: usize>(name: &str, solution: &dyn Solution<f64, D>) {
    const COUNT: usize = POINTS / 4;
    let X: Vec<SVector<f64, D>> = (0..COUNT)
        .map(|n| match solution.domain() {
            Domain::Annulus { inner, outer } => {
                let radius = inner + (outer - inner) * share(n, 0);
                let (sin, cos) = (share(n, 1) * FRAC_PI_2).sin_cos();
                SVector::from_fn(|i, _| radius * if i == 0 { cos } else { sin })
            }
            Domain::Box { lower, upper } => {
                SVector::from_fn(|i, _| lower[i] + (upper[i] - lower[i]) * share(n, i))
            }
            _ => SVector::zeros(),
        })
        .collect();
    let points = solution.body_force_at(&X);
    let ids: Vec<u32> = (0..COUNT as u32).collect();
    for count in [COUNT, 4000] {
        let mut b = [SVector::zeros(); BLOCK];
        tell_shared(&format!("{name}, {count} particles"), COUNT, |t| {
            for _ in 0..COUNT / count {
                let mut time = Vec::new();
                points.of_time(t, &mut time);
                for ids in ids[..count].chunks(BLOCK) {
                    points.evaluate_of(&time, ids, &mut b[..ids.len()]);
                    std::hint::black_box(&b);
                }
            }
        });
        tell_shared(&format!("{name}, one after the other"), COUNT, |t| {
            for _ in 0..COUNT / count {
                for ids in ids[..count].chunks(BLOCK) {
                    points.evaluate(t, ids[0] as usize, &mut b[..ids.len()]);
                    std::hint::black_box(&b);
                }
            }
        });
    }
}

fn main() {
    tell_of_memory("bar-j2", include_str!("../../../mms-specs/with-memory/bar-j2.toml"));
    tell_of_memory("block-j2", include_str!("../../../mms-specs/with-memory/block-j2.toml"));
    tell_of_memory("ring-simo", include_str!("../../../mms-specs/with-memory/ring-simo.toml"));
    tell_of_memory("block-j2-3d", include_str!("../../../mms-specs/with-memory/block-j2-3d.toml"));
    let text = include_str!("../../../mms-specs/ring.toml");
    let spec = Spec::parse(text, "ring.toml").unwrap();
    let staged = Staged::of(&spec, spec.derive().unwrap());
    let AnySolution::Two(ring) = interpret_staged(&spec, &staged, []).unwrap() else { return };
    let X: Vec<SVector<f64, 2>> = (0..POINTS)
        .map(|n| {
            let (sin, cos) = (share(n, 1) * FRAC_PI_2).sin_cos();
            SVector::from([cos, sin]) * (0.5 + 0.5 * share(n, 0))
        })
        .collect();
    let mut b = vec![SVector::zeros(); POINTS];
    let points = ring.body_force_at(&X);
    tell("a solver's loop, staged", |t| points.evaluate(t, 0, &mut b));

    let arrays = Arc::new(Arrays::new(&spec, &staged, []).unwrap());
    let flat: Vec<f64> = X.iter().flat_map(|X| X.iter().copied()).collect();
    let mut values = vec![0.0; 2 * POINTS];
    let at = arrays.at(&flat);
    tell("arrays, staged", |t| at.evaluate(FieldName::BodyForce, t, &mut values));
    let body_force = Quantity::Field(FieldName::BodyForce);
    tell("arrays, by position and time", |t| arrays.evaluate(body_force, &flat, t, &mut values));
}
