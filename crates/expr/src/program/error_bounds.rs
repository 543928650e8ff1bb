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
        let mut values: Vec<Row> = Vec::with_capacity(self.operations.len());
        let mut errors: Vec<Row> = Vec::with_capacity(self.operations.len());
        for (operation, &number) in self.operations.iter().zip(&self.numbers) {
            let known = |slot: Slot| (&values[slot.index()], &errors[slot.index()]);
            let (value, error) = match *operation {
                Operation::Number(_) => ([number; SIDE], [0.0; SIDE]),
                Operation::Input(index) => {
                    (inputs.get(index).copied().unwrap_or([f64::NAN; SIDE]), [0.0; SIDE])
                }
                Operation::Neg(a) => (known(a).0.map(|a| -a), *known(a).1),
                Operation::Add(a, b) => {
                    rounded(known(a), known(b), |a, b| a + b, |_, _, _, ea, eb| ea + eb)
                }
                Operation::Sub(a, b) => {
                    rounded(known(a), known(b), |a, b| a - b, |_, _, _, ea, eb| ea + eb)
                }
                Operation::Mul(a, b) => rounded(
                    known(a),
                    known(b),
                    |a, b| a * b,
                    |_, a, b, ea, eb| ea * b.abs() + eb * a.abs(),
                ),
                Operation::Div(a, b) => rounded(
                    known(a),
                    known(b),
                    |a, b| a / b,
                    |y, _, b, ea, eb| (ea + eb * y.abs()) / b.abs(),
                ),
                _ => {
                    let value =
                        array::from_fn(|k| operation.value(&[], |slot| values[slot.index()][k]));
                    let error = array::from_fn(|k| {
                        let at = |slot: Slot| values[slot.index()][k];
                        // The derivative of a function by a difference: its accuracy does not matter.
                        let slope = |a: Slot| {
                            let step = 1e-6 * (1e-3 + at(a).abs());
                            let moved = operation.value(&[], |slot| {
                                if slot == a { at(slot) + step } else { at(slot) }
                            });
                            ((moved - value[k]) / step).abs()
                        };
                        let carried: f64 = match operation {
                            // What they correct stays in the bound, so they add nothing.
                            Operation::SumError(..) | Operation::ProductError(..) => 0.0,
                            _ => {
                                operation.operands().map(|a| errors[a.index()][k] * slope(a)).sum()
                            }
                        };
                        carried + value[k].abs()
                    });
                    (value, error)
                }
            };
            values.push(value);
            errors.push(error);
        }
        self.outputs.iter().map(|slot| errors[slot.index()]).collect()
    }
}

/// The results of an operation, and their bounds: its own rounding, and what `carried` of the result, the operands and
/// their bounds says.
#[inline(always)]
fn rounded(
    (a, ea): (&Row, &Row),
    (b, eb): (&Row, &Row),
    operation: impl Fn(f64, f64) -> f64,
    carried: impl Fn(f64, f64, f64, f64, f64) -> f64,
) -> (Row, Row) {
    let value: Row = array::from_fn(|k| operation(a[k], b[k]));
    let error = array::from_fn(|k| carried(value[k], a[k], b[k], ea[k], eb[k]) + value[k].abs());
    (value, error)
}
