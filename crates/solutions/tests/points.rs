//! Wrong calls for the body force at kept points are told, and give no numbers of other points.

#![allow(clippy::unwrap_used)]

use mmsmith_solutions::nalgebra::SVector;
use mmsmith_solutions::{AxisAligned, AxisAlignedParameters, Solution};

fn points() -> (AxisAligned<f64>, Vec<SVector<f64, 2>>) {
    let solution = AxisAligned::new(AxisAlignedParameters::default()).unwrap();
    let point = |n: usize| SVector::from([0.02 * (n % 40) as f64, 0.01 * (n / 40) as f64]);
    (solution, (0..40 * 40).map(point).collect())
}

#[test]
#[should_panic(expected = "index out of bounds")]
fn points_beyond_the_last() {
    let (solution, X) = points();
    solution.body_force_at(&X).evaluate(0.0, X.len() - 1, &mut [SVector::zeros(); 2]);
}

#[test]
#[should_panic(expected = "values of a time are those of each layer")]
fn values_of_another_solution() {
    let (solution, X) = points();
    let mut b = [SVector::zeros()];
    solution.body_force_at(&X).evaluate_of(&[0.0; 50], &[7], &mut b);
}
