//! The first Piola-Kirchhoff stress from the derivatives of an energy.

use crate::tape::{Argument, Tape, Value};
use crate::text::Names;

/// A tensor in space. Nothing stretches along axes that a law of fewer dimensions leaves out.
type Tensor = [[Value; 3]; 3];

/// The quantities in which laws are stated.
pub(crate) struct Kinematics {
    F: Tensor,
    /// `F^T F`.
    C: Tensor,
    /// The derivative of `J` with respect to `F`.
    cofactor: Tensor,
    I1: Value,
    dimension: usize,
    /// All of them by their names.
    pub(crate) names: Names,
}

impl Kinematics {
    pub(crate) fn new(tape: &mut Tape, dimension: usize) -> Self {
        let F: Tensor = tensor(|i, j| match (i.max(j) < dimension, i == j) {
            (true, _) => tape.entry(i, j),
            (false, true) => Value::ONE,
            (false, false) => Value::ZERO,
        });
        let C = tensor(|i, j| sum_over(|k| (1.0, [F[k][i], F[k][j]]), tape));
        let minor = |tape: &mut Tape, A: &Tensor, [i, k]: [usize; 2], [j, l]: [usize; 2]| {
            let (first, second) = (tape.product(A[i][j], A[k][l]), tape.product(A[i][l], A[k][j]));
            tape.sum(&[(1.0, first), (-1.0, second)])
        };
        // With cyclic indices the signs are those of the minors.
        let others = |i: usize| [(i + 1) % 3, (i + 2) % 3];
        let cofactor = tensor(|i, j| minor(tape, &F, others(i), others(j)));
        let J = sum_over(|j| (1.0, [F[0][j], cofactor[0][j]]), tape);
        let I1 = tape.sum(&[(1.0, C[0][0]), (1.0, C[1][1]), (1.0, C[2][2])]);
        let minors = [0, 1, 2].map(|i| (1.0, minor(tape, &C, others(i), others(i))));
        let I2 = tape.sum(&minors);
        let mut names = Names::default();
        let mut add = |name: String, value: Value| {
            let argument = Argument(names.arguments.len());
            let value = tape.argument(argument, value);
            names.arguments.insert(name, (argument, value));
        };
        add("J".into(), J);
        add("I1".into(), I1);
        add("I2".into(), I2);
        for (i, j) in (0..dimension * dimension).map(|m| (m / dimension, m % dimension)) {
            add(format!("F{}{}", i + 1, j + 1), F[i][j]);
            add(format!("C{}{}", i + 1, j + 1), C[i][j]);
        }
        Kinematics { F, C, cofactor, I1, dimension, names }
    }

    /// Names the rates of the deformation, whose rate is these inputs, row by row: `Fdot11`, ..., `Jdot = cof F : Fdot`, and `d11`, ..., the
    /// symmetric part of `Fdot F^-1`.
    pub(crate) fn add_rates(&mut self, tape: &mut Tape, first: usize) {
        let dimension = self.dimension;
        let rate: Tensor = tensor(|i, j| match i.max(j) < dimension {
            true => tape.input(first + i * dimension + j),
            false => Value::ZERO,
        });
        let cofactor = self.cofactor;
        let J = sum_over(|j| (1.0, [self.F[0][j], cofactor[0][j]]), tape);
        let of_J = tape.reciprocal(J);
        let rows =
            [0, 1, 2].map(|i| (1.0, sum_over(|j| (1.0, [cofactor[i][j], rate[i][j]]), tape)));
        let rate_of_J = tape.sum(&rows);
        self.names.constants.insert("Jdot".into(), rate_of_J);
        let velocity: Tensor = tensor(|i, j| {
            let sum = sum_over(|k| (1.0, [rate[i][k], cofactor[j][k]]), tape);
            tape.product(sum, of_J)
        });
        for (i, j) in (0..dimension * dimension).map(|m| (m / dimension, m % dimension)) {
            let d = tape.sum(&[(0.5, velocity[i][j]), (0.5, velocity[j][i])]);
            self.names.constants.insert(format!("Fdot{}{}", i + 1, j + 1), rate[i][j]);
            self.names.constants.insert(format!("d{}{}", i + 1, j + 1), d);
        }
    }

    /// `P = W_J cof F + 2 W_I1 F + 2 W_I2 (I1 F - F C) + F (W_C + W_C^T) + W_F`, with the normal stresses along axes that
    /// are left out.
    pub(crate) fn stress(&self, tape: &mut Tape, energy: Value) -> Tensor {
        let mut derivative = |name: &str| match self.names.arguments.get(name) {
            Some(&(argument, _)) => tape.derivative(energy, argument),
            None => Value::ZERO,
        };
        let [of_J, of_I1, of_I2] = ["J", "I1", "I2"].map(&mut derivative);
        let mut of_components =
            |letter| tensor(|i, j| derivative(&format!("{letter}{}{}", i + 1, j + 1)));
        let (of_F, of_C) = (of_components('F'), of_components('C'));
        let of_C = tensor(|i, j| tape.add(of_C[i][j], of_C[j][i]));
        tensor(|i, j| {
            if i != j && i.max(j) >= self.dimension {
                return Value::ZERO;
            }
            let volume = tape.product(of_J, self.cofactor[i][j]);
            let first = tape.product(of_I1, self.F[i][j]);
            let stretch = sum_over(|k| (-1.0, [self.F[i][k], self.C[k][j]]), tape);
            let trace = tape.product(self.I1, self.F[i][j]);
            let second = tape.add(trace, stretch);
            let second = tape.product(of_I2, second);
            let third = sum_over(|k| (1.0, [self.F[i][k], of_C[k][j]]), tape);
            tape.sum(&[(1.0, volume), (2.0, first), (2.0, second), (1.0, third), (1.0, of_F[i][j])])
        })
    }
}

fn tensor(mut entry: impl FnMut(usize, usize) -> Value) -> Tensor {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
}

/// The sum of multiples of products over three indices.
fn sum_over(term: impl Fn(usize) -> (f64, [Value; 2]), tape: &mut Tape) -> Value {
    let terms = [0, 1, 2].map(|k| {
        let (factor, [x, y]) = term(k);
        (factor, tape.product(x, y))
    });
    tape.sum(&terms)
}
