//! The library's own functions of one number in single precision, at every one of the 2^32 numbers.
//!
//! Run in release mode: `cargo test --release -p mmsmith-scalar-functions --test single_precision -- --ignored`.
#![allow(clippy::unwrap_used)]

use mmsmith_scalar_functions::ScalarFunctions;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;

/// Numbers that a thread takes at once.
const SHARE: u32 = 1 << 22;

/// Result that is wrong.
struct Wrong {
    function: &'static str,
    x: f32,
    result: f32,
    truth: f64,
    units: f64,
}

/// The distance from the truth, in units of the last place of single precision there.
fn units(result: f32, truth: f64) -> f64 {
    if f64::from(result) == truth || result.is_nan() && truth.is_nan() {
        return 0.0;
    }
    // The exponent of the truth, no smaller than that of the smallest normal number; the unit is 2^-23 of that power of two.
    let exponent = ((truth.to_bits() >> 52) & 0x7ff).clamp(1023 - 126, 1023 + 127);
    let unit = f64::from_bits((exponent - 23) << 52);
    (f64::from(result) - truth).abs() / unit
}

/// Runs `judge` on every number, and returns what it finds wrong, the worst only.
fn at_every_number(
    judge: impl Fn(f32, &mut dyn FnMut(&'static str, f32, f64, f64)) + Sync,
) -> Vec<Wrong> {
    let next = AtomicU32::new(0);
    let shares = (1_u64 << 32).div_ceil(SHARE.into()) as u32;
    let work = || {
        let mut wrong: Vec<Wrong> = Vec::new();
        loop {
            let share = next.fetch_add(1, Ordering::Relaxed);
            if share >= shares {
                return wrong;
            }
            for bits in share * SHARE..=share * SHARE + (SHARE - 1) {
                let x = f32::from_bits(bits);
                judge(x, &mut |function, result, truth, bound| {
                    let units = units(result, truth);
                    if units <= bound {
                        return;
                    }
                    match wrong.iter_mut().find(|known| known.function == function) {
                        Some(known) if known.units >= units => {}
                        Some(known) => *known = Wrong { function, x, result, truth, units },
                        None => wrong.push(Wrong { function, x, result, truth, units }),
                    }
                });
            }
        }
    };
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        let running: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        running.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

fn assert_none(wrong: &[Wrong]) {
    let lines: Vec<String> = wrong
        .iter()
        .map(|w| {
            let Wrong { function, x, result, truth, units } = w;
            format!(
                "{function}({x:e}) = {result:e}, not {truth:e}: {units} units in the last place"
            )
        })
        .collect();
    assert!(lines.is_empty(), "{}", lines.join("\n"));
}

/// The nearest number, but for results within this of the middle between two.
const ROUNDED: f64 = 0.5 + 1e-6;
/// As [`ROUNDED`], where the truth is a formula in doubles that loses a few digits itself.
const NEARLY_ROUNDED: f64 = 0.5 + 1e-3;

#[test]
#[ignore = "a minute and more in release mode: .ci/long runs it"]
fn logarithms_are_the_nearest_numbers() {
    assert_none(&at_every_number(|x, found| {
        let wide = f64::from(x);
        let truth = wide.ln_1p();
        let result = x.log_1p();
        found("log_1p", result, truth, ROUNDED);
        let near = if (-0.5..1.0).contains(&x) { f64::from(result) } else { f64::NAN };
        found("ln_near_one", x.ln_near_one(), near, 0.0);
        let both = x.ln_of_both(f32::NAN);
        found("ln_of_both by x", both, if x < -0.5 { f64::NAN } else { f64::from(result) }, 0.0);
        // By y, which is every number.
        found("ln_of_both by y", (-0.75_f32).ln_of_both(x), wide.ln(), ROUNDED);
        let truth = if wide.abs() < 1e-2 {
            // -x^2 (1/2 - x/3 + x^2/4 - ...)
            let series = (2..12).rev().fold(0.0, |sum, n| 1.0 / f64::from(n) - wide * sum);
            -wide * wide * series
        } else if x == f32::INFINITY {
            f64::NEG_INFINITY
        } else {
            wide.ln_1p() - wide
        };
        found("log_1p_minus_x", x.log_1p_minus_x(), truth, NEARLY_ROUNDED);
    }));
}

#[test]
#[ignore = "a minute and more in release mode: .ci/long runs it"]
fn sines_of_multiples_of_pi_are_the_nearest_numbers() {
    assert_none(&at_every_number(|x, found| {
        let wide = f64::from(x);
        // x = n/2 + r with |r| <= 1/4, all exact; large numbers are whole.
        let n = (2.0 * wide).round();
        let phase = (wide - 0.5 * n) * PI;
        let (sine, cosine) = phase.sin_cos();
        let quarter = if n.is_finite() { (n % 4.0 + 4.0) as u8 % 4 } else { 0 };
        let (sine, cosine) = match quarter {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        };
        found("sin_pi", x.sin_pi(), sine, ROUNDED);
        found("cos_pi", x.cos_pi(), cosine, ROUNDED);
    }));
}

#[test]
#[ignore = "a minute and more in release mode: .ci/long runs it"]
fn sines_and_exponentials_are_the_nearest_numbers() {
    assert_none(&at_every_number(|x, found| {
        let wide = f64::from(x);
        found("sine", x.sine(), wide.sin(), ROUNDED);
        found("cosine", x.cosine(), wide.cos(), ROUNDED);
        // Beyond half a unit above the largest number.
        let exponential = wide.exp();
        let is_too_large = exponential >= 3.402_823_567_797_336_6e38;
        let exponential = if is_too_large { f64::INFINITY } else { exponential };
        found("exponential", x.exponential(), exponential, ROUNDED);
        found("logarithm", x.logarithm(), wide.ln(), ROUNDED);
    }));
}

/// Numbers from zero on: others are no `z = (a - b)^2/(2 a b)`.
#[test]
#[ignore = "a minute and more in release mode: .ci/long runs it"]
fn logarithms_of_ratios_are_the_nearest_numbers() {
    assert_none(&at_every_number(|z, found| {
        if !(z >= 0.0 && z.is_finite()) {
            return;
        }
        let wide = f64::from(z);
        let sinh = (wide * (wide + 2.0)).sqrt();
        let theta = (wide + sinh).ln_1p();
        let squared = theta * theta;
        let (slope, curvature) = if wide < 1e-3 {
            // sum of (-2)^n n!^2/(2 n + 1)! z^n, and its derivative.
            let terms = [-1.0 / 3.0, 2.0 / 15.0, -2.0 / 35.0, 8.0 / 315.0, -8.0 / 693.0];
            let slope = terms.iter().rev().fold(0.0, |sum, term| (sum + term) * wide);
            let derivative =
                (1..=terms.len()).rev().fold(0.0, |sum, n| sum * wide + n as f64 * terms[n - 1]);
            (slope, derivative)
        } else {
            let slope = theta / sinh - 1.0;
            (slope, (1.0 - theta * (1.0 + wide) / sinh) / (wide * (wide + 2.0)))
        };
        found("log_ratio_squared", z.log_ratio_squared(), squared, NEARLY_ROUNDED);
        found("log_ratio_slope", z.log_ratio_slope(), slope, NEARLY_ROUNDED);
        found("log_ratio_curvature", z.log_ratio_curvature(), curvature, NEARLY_ROUNDED);
    }));
}

/// Numbers from zero to where the values leave single precision.
#[test]
#[ignore = "a minute and more in release mode: .ci/long runs it"]
fn hyperbolic_cosines_of_roots_are_the_nearest_numbers() {
    assert_none(&at_every_number(|y, found| {
        if !(0.0..7.5e3).contains(&y) {
            return;
        }
        let wide = f64::from(y);
        let root = wide.sqrt();
        let half = (0.5 * root).sinh();
        let (slope, curvature) = if wide < 0.1 {
            // sum of y^k/(2 k + 1)!, and its derivative.
            let terms = [1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362_880.0, 1.0 / 39_916_800.0];
            let slope = terms.iter().rev().fold(0.0, |sum, term| (sum + term) * wide);
            let derivative =
                (1..=terms.len()).rev().fold(0.0, |sum, n| sum * wide + n as f64 * terms[n - 1]);
            (slope, derivative)
        } else {
            let ratio = root.sinh() / root;
            (ratio - 1.0, (root.cosh() - ratio) / (2.0 * wide))
        };
        found("cosh_sqrt_m1", y.cosh_sqrt_m1(), 2.0 * half * half, NEARLY_ROUNDED);
        found("cosh_sqrt_m1_slope", y.cosh_sqrt_m1_slope(), slope, NEARLY_ROUNDED);
        found("cosh_sqrt_m1_curvature", y.cosh_sqrt_m1_curvature(), curvature, NEARLY_ROUNDED);
    }));
}
