//! Nanoseconds a point of the interpreted body force of the ring: as a solver takes it, and as arrays.
//! `python/benchmarks/points.py` measures the same from Python; `RAYON_NUM_THREADS=1` leaves arrays to one thread.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use mmsmith_interpret::{Arrays, Quantity, interpret_staged};
use mmsmith_runtime::AnySolution;
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_spec::Spec;
use mmsmith_stage::{FieldName, Staged};
use std::sync::Arc;
use std::time::Instant;

const POINTS: usize = 1_000_000;
const TIMES: usize = 9;

/// The median time of a call.
fn tell(what: &str, mut call: impl FnMut(f64)) {
    let mut times: Vec<f64> = (0..TIMES)
        .map(|n| {
            let begun = Instant::now();
            call(1e-3 * n as f64);
            begun.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{what:<28} {:6.1} ns a point", times[TIMES / 2] / POINTS as f64 * 1e9);
}

fn main() {
    let text = include_str!("../../../mms-specs/ring.toml");
    let spec = Spec::parse(text, "ring.toml").unwrap();
    let staged = Staged::of(&spec, spec.derive().unwrap());
    let AnySolution::Two(ring) = interpret_staged(&spec, &staged, []).unwrap() else { return };
    // Multiples of irrational numbers: spread over the ring, and no lattice.
    let X: Vec<SVector<f64, 2>> = (0..POINTS)
        .map(|n| {
            let [R, angle] =
                [0.618_033_988_75, 0.754_877_666_25].map(|step| (n as f64 * step).fract());
            let (sin, cos) = (angle * std::f64::consts::FRAC_PI_2).sin_cos();
            [(0.5 + 0.5 * R) * cos, (0.5 + 0.5 * R) * sin].into()
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
