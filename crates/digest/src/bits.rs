//! The digest of a run's results.

use mmsmith_verify::{PerNorm, Row};
use mmsmith_vtk::{Frame, Values};
use sha2::{Digest, Sha256};

/// The first sixteen hexadecimal digits.
pub(crate) fn short(sum: Sha256) -> String {
    sum.finalize()[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The digest of a row of errors and of the particles at the end.
pub(crate) fn digest(row: &Row, frame: Option<&Frame>) -> String {
    let mut sum = Sha256::new();
    let mut numbers = |values: &[f64]| values.iter().for_each(|value| sum.update(bits(*value)));
    numbers(&[row.h, row.dt, row.cfl, row.steps as f64, row.particles as f64]);
    let of_norms = |norms: &PerNorm<f64>| [norms.linf, norms.l2, norms.l1];
    row.errors.iter().for_each(|(_, norms)| numbers(&of_norms(norms)));
    row.internal.iter().for_each(|(_, norms)| numbers(&of_norms(norms)));
    if let Some(frame) = frame {
        numbers(frame.points.as_flattened());
        for array in &frame.arrays {
            match &array.values {
                Values::Scalar(values) => numbers(values),
                Values::Vector(values) => numbers(values.as_flattened()),
                Values::Tensor(values) => numbers(values.as_flattened()),
                Values::Id(_) => {}
            }
        }
    }
    short(sum)
}

/// The bytes of a number, the same for all that are none.
fn bits(value: f64) -> [u8; 8] {
    if value.is_nan() { f64::NAN.to_bits().to_le_bytes() } else { value.to_bits().to_le_bytes() }
}
