//! Laws and motions that tests share.

use mmsmith_history::{AnyLaw, Dual, ElasticPart, Flow, Kinematics, Maxwell, Number, Tensor};
use nalgebra::Matrix3;

pub(crate) const MU: f64 = 3846.0;
pub(crate) const BULK: f64 = 8333.0;
pub(crate) const YIELD: f64 = 50.0;

/// Flow without regard to its rate, and its constants.
pub(crate) fn flow(
    dimension: usize,
    modulus: f64,
    exponent: f64,
    is_on_yield: bool,
) -> (Flow, Vec<f64>) {
    let law = Flow { dimension, has_overstress: false, is_on_yield };
    (law, vec![BULK - 2.0 * MU / 3.0, MU, YIELD, modulus, exponent])
}

/// Norton's creep.
pub(crate) fn creep(dimension: usize, exponent: f64) -> (Flow, Vec<f64>) {
    let law = Flow { dimension, has_overstress: true, is_on_yield: false };
    (law, vec![BULK - 2.0 * MU / 3.0, MU, 0.0, 0.0, 1.0, 200.0, exponent, 1.3])
}

/// Two elements in the plane.
pub(crate) fn elements(elastic: ElasticPart) -> (AnyLaw, Vec<f64>) {
    let own = match elastic {
        ElasticPart::LinearElastic => vec![BULK - 2.0 * MU / 3.0, MU],
        ElasticPart::Yeoh(_) => vec![0.5 * MU, 0.1 * MU, 0.03 * MU, BULK],
        ElasticPart::Gent(_) => vec![MU, 2.3, BULK],
        ElasticPart::ArrudaBoyce(_) => vec![MU, 5.0, BULK],
    };
    let law = AnyLaw::Maxwell(Maxwell { dimension: 2, elastic, elements: 2 });
    (law, [own, vec![0.3, 0.2, 0.2, 0.7]].concat())
}

/// A number with slopes.
pub(crate) fn number<const K: usize>(value: f64, slopes: [f64; K]) -> Dual<f64, K> {
    Dual { value, slopes }
}

/// Times from 0 to 1.
pub(crate) fn times(count: usize) -> Vec<f64> {
    (1..=count).map(|k| k as f64 / count as f64).collect()
}

fn steady<const K: usize>(constants: &[f64]) -> Vec<Dual<f64, K>> {
    constants.iter().map(|&value| Dual::constant(value)).collect()
}

/// A motion without slopes from the deformation gradient and its rate, with constants of a law.
pub(crate) fn along(
    constants: &[f64],
    motion: impl Fn(f64) -> (Matrix3<f64>, Matrix3<f64>) + Sync,
) -> (impl Fn(f64) -> Kinematics<Dual<f64, 1>> + Sync, Vec<Dual<f64, 1>>) {
    let at = move |t| {
        let (F, rate) = motion(t);
        let of = |A: Matrix3<f64>| -> Tensor<Dual<f64, 1>> {
            std::array::from_fn(|i| std::array::from_fn(|j| number(A[(i, j)], [0.0])))
        };
        Kinematics { F: of(F), rate: of(rate) }
    };
    (at, steady(constants))
}

/// Displacements of a block with shear and stretch, with slopes along two coordinates, and constants of a law.
pub(crate) fn block(
    X: [f64; 2],
    constants: &[f64],
) -> (impl Fn(f64) -> Kinematics<Dual<f64, 2>> + Sync, Vec<Dual<f64, 2>>) {
    let at = move |t: f64| {
        let (x, y) = (number(X[0], [1.0, 0.0]), number(X[1], [0.0, 1.0]));
        let plain = |value: f64| number(value, [0.0; 2]);
        // Rows go by other functions of time, so that the rate does not commute with the deformation.
        let ramp = |r: f64, q: f64| {
            let (r, q, stretch) = (plain(r), plain(q), plain(0.1));
            let bend = plain(0.04);
            [
                [r * (stretch + bend * x * y), r * plain(0.05) * x * x],
                [q * bend * y * x, q * (plain(-0.08) + plain(0.02) * x)],
            ]
        };
        let of = |entries: [[Dual<f64, 2>; 2]; 2], diagonal: f64| -> Tensor<Dual<f64, 2>> {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let at = if i < 2 && j < 2 { entries[i][j] } else { plain(0.0) };
                    if i == j { at + plain(diagonal) } else { at }
                })
            })
        };
        let (r, rate) = (t + 0.3 * t * t, 1.0 + 0.6 * t);
        Kinematics {
            F: of(ramp(r, r + 0.2 * r * r), 1.0),
            rate: of(ramp(rate, rate * (1.0 + 0.4 * r)), 0.0),
        }
    };
    (at, steady(constants))
}
