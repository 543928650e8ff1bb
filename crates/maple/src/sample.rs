//! Reproducible points.

use mmsmith_expr::{Expr, Rational};

/// `count` points, each with an exact value for every input, uniform between the input's bounds. The same `seed`
/// gives the same points.
///
/// Bounds that are not finite give zero.
pub fn sample(
    inputs: &[(Expr, [f64; 2])],
    count: usize,
    seed: u64,
) -> impl Iterator<Item = Vec<(Expr, Rational)>> {
    let mut state = seed;
    (0..count).map(move |_| {
        let mut draw = |&(input, [low, high]): &(Expr, [f64; 2])| {
            let fraction = (bits(&mut state) >> 11) as f64 / (1_u64 << 53) as f64;
            let value = low + (high - low) * fraction;
            (input, mmsmith_oracle::exact(value).unwrap_or_default())
        };
        inputs.iter().map(&mut draw).collect()
    })
}

/// Splitmix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014).
fn bits(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
