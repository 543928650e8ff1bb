//! Units: inputs that may be taken as one.
//!
//! Give each input `q` an exponent `e_q`, and multiply it by `z^(e_q)` for some `z > 0`. Where every sum of a program has
//! operands of equal exponents, and every function, number and the circle number the exponent zero, each value is multiplied
//! by a power of `z` of its own, and relative errors of operations do not change that. So `v_i dg/dv_i` and `q dg/dq` are
//! all multiplied as `g` is, and `K` does not change. An input of exponent one, if it is positive, may thus be taken as one;
//! the range of every other is then that of the input divided by the power of it.

use mmsmith_expr::{Operation, Program};
use serde::{Deserialize, Serialize};

/// A choice of exponents under which a program keeps its factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scaling {
    /// The input that is taken as one, by its index.
    pub input: usize,
    /// The exponent of each input.
    pub exponents: Vec<f64>,
}

/// Linear conditions on exponents, each a sum that is zero.
struct Conditions {
    rows: Vec<Vec<f64>>,
}

/// The conditions of a program. The exponent of a value is a linear combination of the exponents of inputs.
fn conditions(program: &Program, inputs: usize) -> Conditions {
    let mut values: Vec<Vec<f64>> = Vec::new();
    let mut rows = Vec::new();
    let combine = |a: &[f64], b: &[f64], by: f64| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| a + by * b).collect()
    };
    for operation in program.operations() {
        let of = |slot: mmsmith_expr::Slot| values[slot.index()].clone();
        let none = vec![0.0; inputs];
        let value = match operation {
            Operation::Number(_) | Operation::Pi => none,
            Operation::Input(index) => {
                let mut own = none;
                if let Some(own) = own.get_mut(*index) {
                    *own = 1.0;
                }
                own
            }
            Operation::Neg(a) => of(*a),
            Operation::Mul(a, b) => combine(&of(*a), &of(*b), 1.0),
            Operation::Div(a, b) => combine(&of(*a), &of(*b), -1.0),
            Operation::Sqrt(a) => combine(&none, &of(*a), 0.5),
            Operation::Add(a, b) | Operation::Sub(a, b) => {
                rows.push(combine(&of(*a), &of(*b), -1.0));
                of(*a)
            }
            other => {
                rows.extend(other.operands().map(of));
                none
            }
        };
        values.push(value);
    }
    rows.retain(|row| row.iter().any(|&c| c != 0.0));
    Conditions { rows }
}

impl Conditions {
    /// Exponents of inputs that fulfil the conditions, with fixed exponents for some inputs; `None` where there are none.
    fn solve(&self, fixed: &[(usize, f64)], inputs: usize) -> Option<Vec<f64>> {
        let mut rows: Vec<Vec<f64>> =
            self.rows.iter().map(|row| row.iter().copied().chain([0.0]).collect()).collect();
        for &(input, exponent) in fixed {
            let mut row = vec![0.0; inputs + 1];
            (row[input], row[inputs]) = (1.0, exponent);
            rows.push(row);
        }
        // Gauss-Jordan. The coefficients are halves and quarters of small numbers; free exponents stay zero.
        let mut pivots: Vec<(usize, usize)> = Vec::new();
        for column in 0..inputs {
            let from = pivots.len();
            let Some(row) = (from..rows.len()).find(|&row| rows[row][column].abs() > 1e-9) else {
                continue;
            };
            rows.swap(from, row);
            let pivot = rows[from].clone();
            for (index, row) in rows.iter_mut().enumerate() {
                let by = row[column] / pivot[column];
                if index != from && by != 0.0 {
                    row.iter_mut().zip(&pivot).for_each(|(own, pivot)| *own -= by * pivot);
                }
            }
            pivots.push((from, column));
        }
        if rows[pivots.len()..].iter().any(|row| row[inputs].abs() > 1e-9) {
            return None;
        }
        let mut exponents = vec![0.0; inputs];
        for (row, column) in pivots {
            exponents[column] = rows[row][inputs] / rows[row][column];
        }
        Some(exponents)
    }
}

/// The inputs among `positive` that may be taken as one together, with the exponents of each: its own exponent is one, and the
/// exponents of the other inputs that are taken as one are zero.
#[must_use]
pub fn scalings(program: &Program, inputs: usize, positive: &[usize]) -> Vec<Scaling> {
    let conditions = conditions(program, inputs);
    let mut chosen: Vec<usize> = Vec::new();
    let solve = |chosen: &[usize]| -> Option<Vec<Scaling>> {
        chosen
            .iter()
            .map(|&input| {
                let fixed: Vec<(usize, f64)> = chosen
                    .iter()
                    .map(|&other| (other, f64::from(u8::from(other == input))))
                    .collect();
                let exponents = conditions.solve(&fixed, inputs)?;
                Some(Scaling { input, exponents })
            })
            .collect()
    };
    let mut found = Vec::new();
    for &input in positive {
        chosen.push(input);
        match solve(&chosen) {
            Some(scalings) => found = scalings,
            None => {
                chosen.pop();
            }
        }
    }
    found
}
