//! How much rounding errors may make of the outputs of a program.

#[cfg(test)]
mod tests;

use super::{Operation, Program, Slot};
use std::array;

/// Places that are looked at side by side: as many as fill a few vector registers.
pub(crate) const SIDE: usize = 8;

/// Values, or bounds of their errors, at all places.
type Row = [f64; SIDE];

impl Program {
    /// Bounds, to first order, of the rounding errors of the outputs, in units of the rounding error of one operation: for
    /// each output its bounds at `SIDE` places, which are given by the values of each input there.
    ///
    /// Inputs count as exact. Running error analysis: every operation adds its own rounding to what its operands
    /// carry, and nothing cancels. All places go through one operation after another, side by side.
    pub(crate) fn error_bounds(&self, inputs: &[Row]) -> Vec<Row> {
        let mut values = self.values(inputs);
        let mut errors: Vec<Row> = Vec::with_capacity(self.operations.len());
        for (index, operation) in self.operations.iter().enumerate() {
            let value = values[index];
            let carried = |slot: Slot| &errors[slot.index()];
            let error = match *operation {
                Operation::Number(_) | Operation::Input(_) => [0.0; SIDE],
                Operation::Neg(a) => *carried(a),
                Operation::Add(a, b) | Operation::Sub(a, b) => {
                    let (ea, eb) = (carried(a), carried(b));
                    array::from_fn(|k| ea[k] + eb[k] + value[k].abs())
                }
                Operation::Mul(a, b) => {
                    let (ea, eb) = (carried(a), carried(b));
                    let (a, b) = (&values[a.index()], &values[b.index()]);
                    array::from_fn(|k| ea[k] * b[k].abs() + eb[k] * a[k].abs() + value[k].abs())
                }
                Operation::Div(a, b) => {
                    let (ea, eb, b) = (carried(a), carried(b), &values[b.index()]);
                    array::from_fn(|k| {
                        (ea[k] + eb[k] * value[k].abs()) / b[k].abs() + value[k].abs()
                    })
                }
                // What they correct stays in the bound, so they add nothing.
                Operation::SumError(..) | Operation::ProductError(..) => value.map(f64::abs),
                _ => {
                    let mut error = [0.0; SIDE];
                    for slot in operation.operands() {
                        // The derivative of a function by a difference: its accuracy does not matter.
                        let at = values[slot.index()];
                        let step = at.map(|at| 1e-6 * (1e-3 + at.abs()));
                        values[slot.index()] = array::from_fn(|k| at[k] + step[k]);
                        let moved = operation.row(inputs, &values);
                        values[slot.index()] = at;
                        for (k, error) in error.iter_mut().enumerate() {
                            let slope = ((moved[k] - value[k]) / step[k]).abs();
                            *error += errors[slot.index()][k] * slope;
                        }
                    }
                    array::from_fn(|k| error[k] + value[k].abs())
                }
            };
            errors.push(error);
        }
        self.outputs.iter().map(|slot| errors[slot.index()]).collect()
    }
}
