//! Return maps in space, by principal values and directions.

use mmsmith_scalar_functions::ScalarFunctions;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::multiplier::Yield;

/// A symmetric tensor by its principal values and directions.
struct Principal {
    values: Vector3<f64>,
    directions: Matrix3<f64>,
}

impl Principal {
    fn of(b: Matrix3<f64>) -> Self {
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(b);
        Self { values: eigenvalues, directions: eigenvectors }
    }

    fn elastic(F: &Matrix3<f64>, G: &Matrix3<f64>) -> Self {
        Self::of(F * G * F.transpose())
    }

    fn tensor(&self, values: Vector3<f64>) -> Matrix3<f64> {
        self.directions * Matrix3::from_diagonal(&values) * self.directions.transpose()
    }

    /// The deviator of the logarithm, along the principal directions.
    fn deviator(&self) -> Vector3<f64> {
        let logarithms = self.values.map(f64::ln);
        logarithms.add_scalar(-logarithms.mean())
    }
}

/// The inverse; not a number where there is none, which no deformation gradient leads to.
fn inverse(F: &Matrix3<f64>) -> Matrix3<f64> {
    F.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN))
}

fn symmetric(A: Matrix3<f64>) -> Matrix3<f64> {
    (A + A.transpose()) * 0.5
}

/// `tau = lambda/2 tr(ln b) I + mu ln b`.
pub(super) fn kirchhoff(F: &Matrix3<f64>, G: &Matrix3<f64>, lambda: f64, mu: f64) -> Matrix3<f64> {
    let elastic = Principal::elastic(F, G);
    let logarithms = elastic.values.map(f64::ln);
    elastic.tensor((logarithms * mu).add_scalar(0.5 * lambda * logarithms.sum()))
}

/// A step by the exponential map: `G` and the multiplier.
pub(super) fn exponential(
    law: &Yield,
    F: &Matrix3<f64>,
    (G, alpha): (&Matrix3<f64>, f64),
    time: f64,
) -> (Matrix3<f64>, f64) {
    let trial = Principal::elastic(F, G);
    let deviator = trial.deviator();
    let size = law.mu * deviator.norm();
    let D = law.multiplier(size, alpha, time);
    if D == 0.0 {
        return (*G, 0.0);
    }
    let share = 2.0 * law.mu * D / size;
    let b = trial.tensor(trial.values.zip_map(&deviator, |b, s| b * (-share * s).exponential()));
    let to_reference = inverse(F);
    (symmetric(to_reference * b * to_reference.transpose()), D)
}

/// A step by the midpoint rule: `G` and the multiplier.
pub(super) fn midpoint(
    law: &Yield,
    start: &Matrix3<f64>,
    end: &Matrix3<f64>,
    (G, alpha): (&Matrix3<f64>, f64),
    time: f64,
) -> (Matrix3<f64>, f64) {
    let size = |G: &Matrix3<f64>| law.mu * Principal::elastic(end, G).deviator().norm();
    let middle = (start + end) * 0.5;
    let at_middle = Principal::elastic(&middle, G);
    let deviator = at_middle.deviator();
    let n = deviator / deviator.norm();
    let to_reference = inverse(&middle);
    let after = |D: f64| {
        let flow = at_middle.tensor(n.map(|n| (-2.0 * D * n).exponential()));
        symmetric(to_reference * flow * middle * G)
    };
    let D = if law.flow.overstress.is_some() {
        2.0 * law.multiplier(law.mu * deviator.norm(), alpha, 0.5 * time)
    } else {
        law.multiplier_of(|D| size(&after(D)), alpha)
    };
    if D > 0.0 { (after(D), D) } else { (*G, 0.0) }
}

/// The size of the deviator of the stress.
pub(super) fn size(law: &Yield, F: &Matrix3<f64>, G: &Matrix3<f64>) -> f64 {
    law.mu * Principal::elastic(F, G).deviator().norm()
}
