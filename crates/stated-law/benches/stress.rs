//! Time that the stress of a block of particles takes.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use mmsmith_stated_law::{LANES, Response, StatedLaw};

fn main() {
    divan::main();
}

const NEO_HOOKEAN: &str = "mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2";
const MOONEY_RIVLIN: &str = "c1*(I1 - 3 - 2*ln(J)) + c2*(I2 - 3 - 4*ln(J)) + lambda/2*ln(J)^2";
const FIBRE: &str = "mu/2*(I1 - 3 - 2*ln(J)) \
    + k1/(2*k2)*(exp(k2*(a1^2*C11 + 2*a1*a2*C12 + a2^2*C22 - 1)^2) - 1)";
const ISOCHORIC: &str = "mu/2*(J^(-2/3)*I1 - 3) + lambda/2*(J - 1)^2";

fn law<T: nalgebra::RealField + Copy>(dimension: usize, energy: &str) -> StatedLaw<T> {
    let constants = [
        ("lambda", 2.0),
        ("mu", 1.0),
        ("c1", 0.3),
        ("c2", 0.2),
        ("k1", 1.0),
        ("k2", 2.0),
        ("a1", 0.6),
        ("a2", 0.8),
    ];
    let constants = constants.map(|(name, value)| (name.to_owned(), value));
    StatedLaw::new(dimension, &Response::Energy(energy.to_owned()), &constants).expect("a law")
}

fn block<const D: usize>() -> [[[f64; LANES]; D]; D] {
    let entry = |i: usize, j: usize, n: usize| {
        let rest = if i == j { 1.0 } else { 0.0 };
        rest + 0.1 * ((1 + i + 3 * j) as f64 * n as f64).sin()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| std::array::from_fn(|n| entry(i, j, n))))
}

#[divan::bench(args = [NEO_HOOKEAN, MOONEY_RIVLIN, FIBRE, ISOCHORIC])]
fn in_2d(bencher: Bencher, energy: &str) {
    stresses::<2>(bencher, energy);
}

#[divan::bench(args = [NEO_HOOKEAN, MOONEY_RIVLIN, FIBRE, ISOCHORIC])]
fn in_3d(bencher: Bencher, energy: &str) {
    stresses::<3>(bencher, energy);
}

fn stresses<const D: usize>(bencher: Bencher, energy: &str) {
    let law = law::<f64>(D, energy);
    let F = block::<D>();
    let mut P = F;
    bencher.counter(ItemsCount::new(LANES)).bench_local(|| {
        law.first_piola_kirchhoff(black_box(&F), &mut P);
        black_box(&P);
    });
}
