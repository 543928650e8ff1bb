//! Reproducible points.

use mmsmith_expr::{Expr, Rational};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// `count` points, each with an exact value for every input, uniform between the input's bounds. The same `seed`
/// gives the same points.
///
/// Bounds that are not finite give zero.
pub fn sample(
    inputs: &[(Expr, [f64; 2])],
    count: usize,
    seed: u64,
) -> impl Iterator<Item = Vec<(Expr, Rational)>> {
    let mut random = SplitMix64::seed_from_u64(seed);
    (0..count).map(move |_| {
        let mut draw = |&(input, [low, high]): &(Expr, [f64; 2])| {
            let fraction = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            let value = low + (high - low) * fraction;
            (input, mmsmith_oracle::exact(value).unwrap_or_default())
        };
        inputs.iter().map(&mut draw).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_expr::{Graph, nearest_f64};

    /// The first numbers of the generator's authors, <https://prng.di.unimi.it/splitmix64.c> with the state zero.
    #[test]
    fn points_are_those_of_the_seed() {
        let x = Graph::new().symbol("x");
        let points: Vec<f64> =
            sample(&[(x, [-1.0, 3.0])], 3, 0).map(|point| nearest_f64(&point[0].1)).collect();
        let expected = [0xe220_a839_7b1d_cdaf_u64, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f];
        let fraction = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64;
        assert_eq!(points, expected.map(|bits| -1.0 + 4.0 * fraction(bits)));
        assert_eq!(sample(&[(x, [0.0, f64::INFINITY])], 1, 7).next().unwrap()[0].1, 0.into());
    }
}
