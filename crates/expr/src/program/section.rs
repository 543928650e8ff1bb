//! Parts of a program over many points side by side.
//!
//! Reading an operation takes longer than doing it for one point; so each is done for a row of points before the next one
//! is read.

use super::{Operation, Program, Scalar, Slot};
use crate::nearest_f64;
use std::array;

/// The operations that some outputs need, given values that are the same at all points and values of each point.
///
/// Results are those of [`Program::evaluate`], to the last bit.
#[derive(Clone, Debug)]
pub struct Section {
    /// How many values are the same at all points, and how many are given of each.
    uniform: usize,
    given: usize,
    /// The operations, each on the places of earlier ones, after the values of both kinds.
    operations: Vec<Operation>,
    outputs: Vec<usize>,
}

impl Program {
    /// Operations that `outputs` need, given the values `given` of a point and the values that do not depend on the position; and the
    /// program of the latter, whose outputs [`Section::run`] takes as uniform.
    #[must_use]
    pub fn section(&self, outputs: &[Slot], given: &[Slot]) -> (Section, Program) {
        let mut reached = vec![false; self.operations.len()];
        let mut stack = outputs.to_vec();
        while let Some(slot) = stack.pop() {
            if std::mem::replace(&mut reached[slot.index()], true) {
                continue;
            }
            if self.dependence(slot).position && !given.contains(&slot) {
                stack.extend(self.operations[slot.index()].operands());
            }
        }
        let reached = self.slots().filter(|slot| reached[slot.index()]);
        let (of_points, uniform): (Vec<Slot>, Vec<Slot>) =
            reached.partition(|&slot| self.dependence(slot).position);
        let mut places = vec![0; self.operations.len()];
        for (place, slot) in uniform.iter().chain(given).enumerate() {
            places[slot.index()] = place;
        }
        let mut operations = Vec::new();
        for slot in of_points.into_iter().filter(|slot| !given.contains(slot)) {
            let operation = &self.operations[slot.index()];
            operations.push(operation.with_operands(|operand| Slot::at(places[operand.index()])));
            places[slot.index()] = uniform.len() + given.len() + operations.len() - 1;
        }
        let outputs = outputs.iter().map(|slot| places[slot.index()]).collect();
        let section = Section { uniform: uniform.len(), given: given.len(), operations, outputs };
        (section, self.part(&uniform))
    }
}

impl Section {
    /// The number of outputs.
    #[must_use]
    pub fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// The outputs of `N` points, from the uniform values and those given of each point. `rows` is room to work in.
    ///
    /// # Panics
    ///
    /// Panics where there are not as many values as the section takes.
    pub fn run<'a, T: Scalar, const N: usize>(
        &self,
        uniform: &[T],
        given: &[[T; N]],
        rows: &'a mut Vec<[T; N]>,
    ) -> impl Iterator<Item = &'a [T; N]> + use<'a, T, N> {
        assert_eq!((uniform.len(), given.len()), (self.uniform, self.given), "values of a section");
        rows.clear();
        rows.extend(uniform.iter().map(|&value| [value; N]));
        rows.extend(given);
        for operation in &self.operations {
            rows.push(operation.row(&[], rows));
        }
        let rows: &'a [[T; N]] = rows;
        self.outputs.clone().into_iter().map(move |place| &rows[place])
    }
}

impl Operation {
    /// The values at `N` places, where `inputs` has those of the inputs and `rows` those of the operands.
    pub(super) fn row<T: Scalar, const N: usize>(
        &self,
        inputs: &[[T; N]],
        rows: &[[T; N]],
    ) -> [T; N] {
        let of = |slot: Slot| rows[slot.index()];
        let each = |a: Slot, b: Slot, value: fn(T, T) -> T| -> [T; N] {
            let (a, b) = (of(a), of(b));
            array::from_fn(|n| value(a[n], b[n]))
        };
        match *self {
            Operation::Number(ref value) => [T::rounded(nearest_f64(value)); N],
            Operation::Pi => [T::rounded(std::f64::consts::PI); N],
            Operation::Input(index) => inputs.get(index).copied().unwrap_or([T::nan(); N]),
            Operation::Add(a, b) => each(a, b, |a, b| a + b),
            Operation::Sub(a, b) => each(a, b, |a, b| a - b),
            Operation::Mul(a, b) => each(a, b, |a, b| a * b),
            Operation::Div(a, b) => each(a, b, |a, b| a / b),
            Operation::Neg(a) => of(a).map(|a| -a),
            Operation::Sqrt(a) => of(a).map(T::sqrt),
            Operation::Power(a, ref exponent) => {
                let exponent = T::rounded(nearest_f64(exponent));
                of(a).map(|a| a.powf(exponent))
            }
            Operation::SinPi(a) => of(a).map(T::sin_pi),
            Operation::CosPi(a) => of(a).map(T::cos_pi),
            Operation::Call(function, a) => of(a).map(|a| T::call(function, a)),
            Operation::Atan2(y, x) => each(y, x, T::polar_angle),
            Operation::LnOfBoth(x, y) => each(x, y, T::ln_of_both),
            Operation::SumError(a, b) => each(a, b, T::sum_error),
            Operation::ProductError(a, b) => each(a, b, T::product_error),
        }
    }
}
