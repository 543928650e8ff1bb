//! Tables of fields that follow from histories, beside the trajectories of single particles.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use mmsmith_interpret::{interpret, interpret_staged_single};
use mmsmith_solutions::nalgebra::SVector;
use mmsmith_solutions::{AnySolution, BLOCK, Domain, Real, Solution, StateRun};
use mmsmith_spec::Spec;
use mmsmith_stage::Staged;
use rayon::prelude::*;

fn specification(name: &str) -> Spec {
    let file = mmsmith_tests::workspace().join(format!("mms-specs/with-memory/{name}.toml"));
    Spec::parse(&std::fs::read_to_string(file).unwrap(), name).unwrap()
}

fn fraction(n: usize, step: f64) -> f64 {
    (0.5 + step * (n + 1) as f64).fract()
}

/// Places that fill the body evenly (additive recurrence).
fn places<T: Real, const D: usize>(domain: &Domain<T, D>, count: usize) -> Vec<SVector<T, D>> {
    const STEPS: [f64; 3] =
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];
    let place = |n: usize| match domain {
        Domain::Box { lower, upper } => SVector::from_fn(|i, _| {
            lower[i] + T::nearest(fraction(n, STEPS[i])) * (upper[i] - lower[i])
        }),
        Domain::Annulus { inner, outer } => {
            let radius = *inner + T::nearest(fraction(n, STEPS[0])) * (*outer - *inner);
            let (sine, cosine) = (1.5 * fraction(n, STEPS[1])).sin_cos();
            SVector::from_fn(|i, _| radius * T::nearest([cosine, sine, 0.0][i]))
        }
        _ => panic!("there are no tables in such a body"),
    };
    (0..count).map(place).collect()
}

/// The largest difference between fields of particles' series and of trajectories, as a share of the largest entry of the field, and what
/// the table tells of it, if there is one.
fn largest_error<const D: usize>(solution: &dyn Solution<f64, D>, count: usize) -> (f64, f64) {
    let X = places(&solution.domain(), count);
    let period = solution.period();
    solution.prepare_until(period).unwrap();
    let told = solution.history(&X[..1], period).unwrap().unwrap().table_error;
    let names = solution.internal_variables();
    let stem = |k: usize| names[k].trim_end_matches(|c: char| c.is_ascii_digit());
    let (forces, states, internal) =
        (solution.body_force_at(&X), solution.state_at(&X), solution.internal_at(&X));
    let of_block = |block: usize| {
        let (first, t) = (block * BLOCK, period * fraction(block, 0.618_033_988_749_894_9));
        let points = &X[first..(first + BLOCK).min(count)];
        let mut b = vec![SVector::zeros(); points.len()];
        forces.evaluate(t, first, &mut b);
        let mut runs = [StateRun::zero()];
        states.evaluate(t, t, block, &mut runs);
        let internal = internal.evaluate(t, first..first + points.len());
        // For each field the largest entry and the largest difference.
        let mut found = vec![[0.0_f64; 2]; 2 + names.len()];
        for (n, X) in points.iter().enumerate() {
            let (exact, variables) = (solution.fields(X, t), solution.internal(X, t));
            let mut see = |field: usize, exact: f64, own: f64| {
                let [largest, off] = &mut found[field];
                *largest = largest.max(exact.abs());
                let difference = (own - exact).abs();
                *off = if difference.is_nan() { f64::INFINITY } else { off.max(difference) };
            };
            for i in 0..D {
                see(0, exact.b[i], b[n][i]);
                (0..D).for_each(|j| see(1, exact.P[(i, j)], runs[0].P[i][j][n]));
            }
            for (k, (exact, own)) in variables.iter().zip(&internal[n]).enumerate() {
                see(2 + k, *exact, *own);
            }
        }
        found
    };
    let blocks: Vec<_> = (0..count.div_ceil(BLOCK)).into_par_iter().map(of_block).collect();
    let of_all =
        |field: usize, which: usize| blocks.iter().map(|own| own[field][which]).fold(0.0, f64::max);
    let scale = |field: usize| match field.checked_sub(2) {
        None => of_all(field, 0),
        Some(k) => (0..names.len())
            .filter(|other| stem(*other) == stem(k))
            .map(|other| of_all(2 + other, 0))
            .fold(0.0, f64::max),
    };
    let worst = (0..2 + names.len()).map(|field| of_all(field, 1) / scale(field));
    (worst.fold(0.0, f64::max), told)
}

/// At [`MMSMITH_POINTS`] places and times, 96 if that is not set. Where no table follows the fields, series of particles are next to
/// trajectories.
fn tables_keep_what_they_tell(names: &[&str]) {
    let count = std::env::var("MMSMITH_POINTS").map_or(96, |count| count.parse().unwrap());
    for name in names {
        let (worst, told) = match interpret(&specification(name), []).unwrap() {
            AnySolution::One(solution) => largest_error(&*solution, count),
            AnySolution::Two(solution) => largest_error(&*solution, count),
            AnySolution::Three(solution) => largest_error(&*solution, count),
            _ => panic!("{name} has an unknown dimension"),
        };
        println!("{name}: {worst:.2e} at {count} points, told {told:.2e}");
        let bound = if told.is_nan() { 1e-11 } else { told };
        assert!(worst <= bound && bound <= 1e-11, "{name}: {worst:e}, told {told:e}");
    }
}

#[test]
fn tables_of_lines_and_rings_keep_what_they_tell() {
    tables_keep_what_they_tell(&["bar-j2", "bar-own-law", "ring-simo"]);
}

#[test]
#[ignore = "prepares for long; .ci/long calls it"]
fn tables_of_all_laws_with_memory_keep_what_they_tell() {
    tables_keep_what_they_tell(&["block-maxwell", "block-j2", "block-j2-3d", "ring-j2"]);
    tables_keep_what_they_tell(&["block-perzyna"]);
}

/// Polynomials of a time that are formed once a step, and registers of any width, change no bit.
fn same_bits<T: Real, const D: usize>(name: &str, solution: &dyn Solution<T, D>) {
    let X = places(&solution.domain(), 2 * BLOCK + 5);
    let forces = solution.body_force_at(&X);
    for share in [0.0, 0.21, 0.5, 0.87, 1.0] {
        let t = T::nearest(share) * solution.period();
        let mut whole = vec![SVector::zeros(); X.len()];
        forces.evaluate(t, 0, &mut whole);
        let mut values = Vec::new();
        forces.of_time(t, &mut values);
        let ids: Vec<u32> = (0..X.len() as u32).rev().collect();
        let mut b = vec![SVector::zeros(); X.len()];
        forces.evaluate_of(&values, &ids, &mut b);
        b.reverse();
        for (one, other) in b.iter().zip(&whole) {
            let bits = |b: &SVector<T, D>| b.map(|b| b.to_f64().to_bits());
            assert_eq!(bits(one), bits(other), "{name}, t = {t}: {one}, not {other}");
        }
    }
}

#[test]
fn forces_of_series_have_the_same_bits_in_any_order() {
    for name in ["bar-j2", "ring-simo"] {
        let spec = specification(name);
        let staged = Staged::of(&spec, spec.derive().unwrap());
        match interpret(&spec, []).unwrap() {
            AnySolution::One(solution) => same_bits(name, &*solution),
            AnySolution::Two(solution) => same_bits(name, &*solution),
            _ => panic!("{name} has another dimension"),
        }
        match interpret_staged_single(&spec, &staged, []).unwrap() {
            AnySolution::One(solution) => same_bits(name, &*solution),
            AnySolution::Two(solution) => same_bits(name, &*solution),
            _ => panic!("{name} has another dimension"),
        }
    }
}
