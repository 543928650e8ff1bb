//! Operations on blocks of deformations, in the order of the tape; only those that the results need.

use crate::function::{self, Function, Parts};
use crate::tape::{Node, Operation, Tape, Value};
use mmsmith_lanes::simd::widest;
use mmsmith_scalar_functions::ScalarFunctions;
use nalgebra::RealField;
use pulp::{Simd, WithSimd};
use std::any::Any;
use std::cell::RefCell;

/// Where the parts of a number are: in rows of the block's memory.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Location {
    /// The value at rest.
    rest: f64,
    deviation: usize,
    /// The row of the deviation where the value at rest is zero.
    value: usize,
}

/// The parts that an operation has to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Both,
    /// The value at rest is zero.
    Deviation,
    /// There is no value at rest, or zero is exact whatever is computed.
    Value,
}

#[derive(Clone, Copy, Debug)]
enum Work {
    Entry {
        row: usize,
        column: usize,
    },
    Input {
        index: usize,
    },
    /// The deviation alone, `factor x`.
    Multiple {
        x: Location,
        factor: f64,
    },
    /// The value alone, `x + constant`.
    Shift {
        x: Location,
        constant: f64,
    },
    Affine {
        x: Location,
        factor: f64,
        constant: f64,
    },
    Sum {
        x: Location,
        a: f64,
        y: Location,
        b: f64,
        constant: f64,
    },
    Product {
        x: Location,
        y: Location,
    },
    Reciprocal {
        x: Location,
    },
    Power {
        x: Location,
        exponent: f64,
        rest: f64,
    },
    Call {
        function: Function,
        x: Location,
    },
    Angle {
        y: Location,
        x: Location,
    },
}

#[derive(Clone, Copy, Debug)]
struct Step {
    work: Work,
    wanted: Wanted,
    /// The first row that it writes; a second one follows where both parts are wanted.
    row: usize,
}

/// A result of a program.
#[derive(Clone, Copy, Debug)]
enum Output {
    Constant(f64),
    Varying(Location),
}

/// Steps that compute some numbers of a tape.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    steps: Vec<Step>,
    outputs: Vec<Output>,
    rows: usize,
}

/// Deformations side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Given<'a, T, const D: usize, const N: usize> {
    /// Deformation gradients.
    Deformation(&'a [[[T; N]; D]; D]),
    /// Displacement gradients `H = F - I`, all of them of deformations.
    Displacement(&'a [[[T; N]; D]; D]),
}

/// Parts of a number that are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Portion {
    Whole,
    Deviation,
}

impl Program {
    pub(crate) fn new(tape: &Tape, results: &[Value]) -> Self {
        let nodes = results.iter().filter_map(|&result| match result {
            Value::Varying(node) => Some(node),
            Value::Constant(_) => None,
        });
        let mut needed: Vec<bool> = Vec::new();
        for node in nodes {
            needed.resize(needed.len().max(node.index() + 1), false);
            needed[node.index()] = true;
        }
        let operations: Vec<Operation> =
            (0..needed.len()).map(|index| tape.operation(Node::at(index))).collect();
        for index in (0..needed.len()).rev() {
            if needed[index] {
                for operand in operations[index].operands().into_iter().flatten() {
                    needed[operand.index()] = true;
                }
            }
        }
        let mut program = Program { steps: Vec::new(), outputs: Vec::new(), rows: 0 };
        let mut places: Vec<Option<Location>> = vec![None; needed.len()];
        for index in (0..needed.len()).filter(|&index| needed[index]) {
            let [x, y] = operations[index]
                .operands()
                .map_or([None; 2], |operands| operands.map(|operand| places[operand.index()]));
            places[index] = program.place(tape.rest(Node::at(index)), operations[index], x, y);
        }
        program.outputs = results
            .iter()
            .map(|&result| match result {
                Value::Constant(rest) => Output::Constant(rest.value),
                Value::Varying(node) => {
                    places[node.index()].map_or(Output::Constant(f64::NAN), Output::Varying)
                }
            })
            .collect();
        program
    }

    /// Adds the step of an operation on `x` and `y`, if it is one, and says where the result is.
    fn place(
        &mut self,
        rest: Option<f64>,
        operation: Operation,
        x: Option<Location>,
        y: Option<Location>,
    ) -> Option<Location> {
        let reference = rest.unwrap_or(0.0);
        let wanted = match rest {
            None => Wanted::Value,
            Some(0.0) => Wanted::Deviation,
            Some(_) => Wanted::Both,
        };
        let work = match operation {
            Operation::Entry { row, column } => Work::Entry { row, column },
            Operation::Input { index } => Work::Input { index },
            Operation::Argument { .. } => return x,
            Operation::OnePlus { .. } => {
                let (x, y) = (x?, y?);
                // Without a value at rest deviations are values.
                let deviation = if reference == 0.0 { y.value } else { x.deviation };
                return Some(Location { rest: reference, deviation, value: y.value });
            }
            Operation::Affine { factor, constant, .. } => {
                let (x, factor, constant) = (x?, factor.get(), constant.get());
                if factor == 1.0 && constant != 0.0 {
                    // x - c with c the value at rest is the deviation; it never has fewer digits than the difference.
                    let value = if reference == 0.0 {
                        x.deviation
                    } else {
                        self.add(Work::Shift { x, constant }, Wanted::Value).value
                    };
                    return Some(Location { rest: reference, deviation: x.deviation, value });
                }
                match wanted {
                    Wanted::Both => Work::Affine { x, factor, constant },
                    _ => Work::Multiple { x, factor },
                }
            }
            Operation::Sum { a, b, constant, .. } => {
                let (a, b, constant) = (a.get(), b.get(), constant.get());
                Work::Sum { x: x?, a, y: y?, b, constant }
            }
            Operation::Product { .. } => Work::Product { x: x?, y: y? },
            Operation::Reciprocal { .. } => Work::Reciprocal { x: x? },
            Operation::Power { exponent, .. } => {
                Work::Power { x: x?, exponent: exponent.get(), rest: reference }
            }
            Operation::Call { function, .. } => Work::Call { function, x: x? },
            // In the order of the operands.
            Operation::Angle { .. } => Work::Angle { y: y?, x: x? },
        };
        Some(Location { rest: reference, ..self.add(work, wanted) })
    }

    fn add(&mut self, work: Work, wanted: Wanted) -> Location {
        let row = self.rows;
        self.steps.push(Step { work, wanted, row });
        let value = if wanted == Wanted::Both { row + 1 } else { row };
        self.rows = value + 1;
        Location { rest: 0.0, deviation: row, value }
    }

    /// Whether it takes any of these inputs.
    pub(crate) fn takes(&self, inputs: &std::ops::Range<usize>) -> bool {
        let takes =
            |step: &Step| matches!(step.work, Work::Input { index } if inputs.contains(&index));
        self.steps.iter().any(takes)
    }

    /// The results for deformations side by side, in registers as wide as this processor has them; not a number where F is no
    /// deformation.
    pub(crate) fn run<'a, T: RealField + Copy, const D: usize, const N: usize>(
        &self,
        given: Given<'_, T, D, N>,
        part: Portion,
        results: impl Iterator<Item = &'a mut [T; N]>,
    ) {
        self.run_with(given, &[], part, results);
    }

    /// As [`run`](Self::run), of a law whose particles have other numbers besides their deformation.
    pub(crate) fn run_with<'a, T: RealField + Copy, const D: usize, const N: usize>(
        &self,
        given: Given<'_, T, D, N>,
        inputs: &[[T; N]],
        part: Portion,
        results: impl Iterator<Item = &'a mut [T; N]>,
    ) {
        with_room(self.rows, |rows| {
            let mut valid = [true; N];
            widest(Run { program: self, given, inputs, rows, valid: &mut valid });
            for (output, result) in self.outputs.iter().zip(results) {
                self.take(*output, part, rows, &valid, result);
            }
        });
    }

    fn take<T: RealField + Copy, const N: usize>(
        &self,
        output: Output,
        part: Portion,
        rows: &[[T; N]],
        valid: &[bool; N],
        result: &mut [T; N],
    ) {
        let not_a_number: T = real(f64::NAN);
        match (output, part) {
            (Output::Constant(value), Portion::Whole) => *result = [real(value); N],
            (Output::Constant(_), Portion::Deviation) => *result = [T::zero(); N],
            (Output::Varying(place), part) => {
                let (deviation, value) = (&rows[place.deviation], &rows[place.value]);
                if part == Portion::Deviation || place.rest == 0.0 {
                    *result = *deviation;
                } else {
                    let rest: T = real(place.rest);
                    for n in 0..N {
                        let sum = rest + deviation[n];
                        // Much of the value at rest is taken away: the value has the digits.
                        let cancels = sum.abs() < rest.abs() * real(0.5);
                        result[n] = if cancels { value[n] } else { sum };
                    }
                }
            }
        }
        for n in 0..N {
            result[n] = if valid[n] { result[n] } else { not_a_number };
        }
    }
}

/// Memory for rows of numbers, kept from call to call.
fn with_room<T: RealField + Copy, const N: usize>(rows: usize, work: impl FnOnce(&mut [[T; N]])) {
    thread_local! {
        /// A vector for each precision and length of rows.
        static ROOMS: RefCell<Vec<Box<dyn Any>>> = const { RefCell::new(Vec::new()) };
    }
    ROOMS.with_borrow_mut(|rooms| {
        let known = rooms.iter().position(|room| room.is::<Vec<[T; N]>>());
        let place = known.unwrap_or_else(|| {
            rooms.push(Box::new(Vec::<[T; N]>::new()));
            rooms.len() - 1
        });
        if let Some(room) = rooms[place].downcast_mut::<Vec<[T; N]>>() {
            if room.len() < rows {
                room.resize(rows, [T::zero(); N]);
            }
            work(&mut room[..rows]);
        }
    });
}

#[inline(always)]
fn real<T: RealField>(value: f64) -> T {
    nalgebra::convert(value)
}

#[inline(always)]
fn double<T: RealField + Copy>(value: T) -> f64 {
    nalgebra::convert_unchecked(value)
}

/// All steps of a program on a block. Only the width of the registers differs between processors: the bits are the same.
struct Run<'a, T, const D: usize, const N: usize> {
    program: &'a Program,
    given: Given<'a, T, D, N>,
    inputs: &'a [[T; N]],
    rows: &'a mut [[T; N]],
    /// Whether `F` is a deformation.
    valid: &'a mut [bool; N],
}

impl<T: RealField + Copy, const D: usize, const N: usize> WithSimd for Run<'_, T, D, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        if let Given::Deformation(F) = self.given {
            deformations(F, self.valid);
        }
        for step in &self.program.steps {
            let (done, open) = self.rows.split_at_mut(step.row);
            let Some((first, others)) = open.split_first_mut() else { continue };
            if let Work::Entry { row, column } = step.work {
                entry(&self.given, row, column, self.valid, first, others.first_mut());
                continue;
            }
            if let Work::Input { index } = step.work {
                *first = self.inputs.get(index).copied().unwrap_or([real(f64::NAN); N]);
                continue;
            }
            match (step.wanted, others.first_mut()) {
                (Wanted::Both, Some(second)) => both(step.work, done, first, second),
                (Wanted::Both, None) => {}
                (Wanted::Deviation, _) => deviation(step.work, done, first),
                (Wanted::Value, _) => value(step.work, done, first),
            }
        }
    }
}

/// Which `F` are deformations.
#[inline(always)]
pub(crate) fn deformations<T: RealField + Copy, const D: usize, const N: usize>(
    F: &[[[T; N]; D]; D],
    valid: &mut [bool; N],
) {
    for n in 0..N {
        let minor = |i: [usize; 2], j: [usize; 2]| {
            F[i[0]][j[0]][n] * F[i[1]][j[1]][n] - F[i[0]][j[1]][n] * F[i[1]][j[0]][n]
        };
        let J = match D {
            1 => F[0][0][n],
            2 => minor([0, 1], [0, 1]),
            _ => {
                F[0][0][n] * minor([1, 2], [1, 2])
                    + F[0][1][n] * minor([1, 2], [2, 0])
                    + F[0][2][n] * minor([1, 2], [0, 1])
            }
        };
        // Without branches: zero times anything that is not finite is not a number.
        let mut zero = J * T::zero();
        for i in 0..D {
            for j in 0..D {
                zero += F[i][j][n] * T::zero();
            }
        }
        valid[n] = (J > T::zero()) & (zero == T::zero());
    }
}

/// A component of `F`, of the identity where `F` is no deformation.
#[inline(always)]
fn entry<T: RealField + Copy, const D: usize, const N: usize>(
    given: &Given<'_, T, D, N>,
    row: usize,
    column: usize,
    valid: &[bool; N],
    deviation: &mut [T; N],
    value: Option<&mut [T; N]>,
) {
    let rest = if row == column { T::one() } else { T::zero() };
    match given {
        Given::Deformation(F) => {
            let F = &F[row][column];
            for n in 0..N {
                deviation[n] = if valid[n] { F[n] - rest } else { T::zero() };
            }
            if let Some(value) = value.filter(|_| row == column) {
                for n in 0..N {
                    value[n] = if valid[n] { F[n] } else { T::one() };
                }
            }
        }
        Given::Displacement(H) => {
            *deviation = H[row][column];
            if let Some(value) = value.filter(|_| row == column) {
                for n in 0..N {
                    value[n] = deviation[n] + T::one();
                }
            }
        }
    }
}

/// Writes the deviation and the value, of a number that is not zero at rest.
#[inline(always)]
fn both<T: RealField + Copy, const N: usize>(
    work: Work,
    rows: &[[T; N]],
    deviation: &mut [T; N],
    value: &mut [T; N],
) {
    match work {
        // Of these only one part is written.
        Work::Entry { .. } | Work::Input { .. } | Work::Multiple { .. } | Work::Shift { .. } => {}
        Work::Affine { x, factor, constant } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let (factor, constant): (T, T) = (real(factor), real(constant));
            for n in 0..N {
                deviation[n] = factor * d[n];
                value[n] = factor * v[n] + constant;
            }
        }
        Work::Sum { x, a, y, b, constant } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let (e, w) = (&rows[y.deviation], &rows[y.value]);
            let (a, b, constant): (T, T, T) = (real(a), real(b), real(constant));
            for n in 0..N {
                deviation[n] = a * d[n] + b * e[n];
                value[n] = (a * v[n] + b * w[n]) + constant;
            }
        }
        Work::Product { x, y } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let (e, w) = (&rows[y.deviation], &rows[y.value]);
            let rest: T = real(x.rest);
            for n in 0..N {
                deviation[n] = rest * e[n] + d[n] * w[n];
                value[n] = v[n] * w[n];
            }
        }
        Work::Reciprocal { x } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let factor: T = real(-1.0 / x.rest);
            for n in 0..N {
                let reciprocal = T::one() / v[n];
                deviation[n] = d[n] * reciprocal * factor;
                value[n] = reciprocal;
            }
        }
        Work::Power { x, exponent, rest } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            for n in 0..N {
                let (d, v) = function::power(parts(x, d[n], v[n]), exponent, rest);
                (deviation[n], value[n]) = (real(d), real(v));
            }
        }
        Work::Call { function: Function::Sqrt, x } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let rest: T = real(x.rest.sqrt());
            for n in 0..N {
                let root = v[n].sqrt();
                deviation[n] = d[n] / (root + rest);
                value[n] = root;
            }
        }
        Work::Call { function, x } => {
            self::deviation(work, rows, deviation);
            let v = &rows[x.value];
            for n in 0..N {
                value[n] = real(function.value(double(v[n])));
            }
        }
        Work::Angle { y, x } => {
            self::deviation(work, rows, deviation);
            let (v, w) = (&rows[y.value], &rows[x.value]);
            for n in 0..N {
                value[n] = real(double(v[n]).polar_angle(double(w[n])));
            }
        }
    }
}

/// Writes the deviation, of a number that is zero at rest.
#[inline(always)]
fn deviation<T: RealField + Copy, const N: usize>(
    work: Work,
    rows: &[[T; N]],
    result: &mut [T; N],
) {
    match work {
        Work::Multiple { x, factor } => {
            let (d, factor): (_, T) = (&rows[x.deviation], real(factor));
            for n in 0..N {
                result[n] = factor * d[n];
            }
        }
        Work::Sum { x, a, y, b, constant } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            let (e, w) = (&rows[y.deviation], &rows[y.value]);
            let (a, b, c): (T, T, T) = (real(a), real(b), real(constant));
            if x.rest == 0.0 && y.rest == 0.0 {
                for n in 0..N {
                    result[n] = a * d[n] + b * e[n];
                }
                return;
            }
            for n in 0..N {
                let (d, e, v, w) = (a * d[n], b * e[n], a * v[n], b * w[n]);
                // The same sum twice: of the smaller numbers rounding takes less.
                let by_value = v.abs() + w.abs() + c.abs() < d.abs() + e.abs();
                result[n] = if by_value { (v + w) + c } else { d + e };
            }
        }
        Work::Call { function: Function::Ln, x } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            if x.rest == 1.0 {
                for n in 0..N {
                    result[n] = real(double(d[n]).ln_of_both(double(v[n])));
                }
            } else {
                for n in 0..N {
                    let (d, v) = (double(d[n]) / x.rest, double(v[n]) / x.rest);
                    result[n] = real(d.ln_of_both(v));
                }
            }
        }
        Work::Call { function, x } => {
            let (d, v) = (&rows[x.deviation], &rows[x.value]);
            for n in 0..N {
                result[n] = real(function.deviation(parts(x, d[n], v[n])));
            }
        }
        Work::Angle { y, x } => {
            let (d, v) = (&rows[y.deviation], &rows[y.value]);
            let (e, w) = (&rows[x.deviation], &rows[x.value]);
            for n in 0..N {
                let (y, x) = (parts(y, d[n], v[n]), parts(x, e[n], w[n]));
                result[n] = real(function::angle_deviation(y, x));
            }
        }
        work => value(work, rows, result),
    }
}

/// Writes the value, where deviations are from zero.
#[inline(always)]
fn value<T: RealField + Copy, const N: usize>(work: Work, rows: &[[T; N]], result: &mut [T; N]) {
    match work {
        Work::Entry { .. } | Work::Input { .. } => {}
        Work::Multiple { x, factor: a } => affine(&rows[x.value], a, 0.0, result),
        Work::Affine { x, factor, constant } => affine(&rows[x.value], factor, constant, result),
        Work::Shift { x, constant } => affine(&rows[x.value], 1.0, constant, result),
        Work::Sum { x, a, y, b, constant } => {
            let (v, w) = (&rows[x.value], &rows[y.value]);
            let (a, b, c): (T, T, T) = (real(a), real(b), real(constant));
            for n in 0..N {
                result[n] = (a * v[n] + b * w[n]) + c;
            }
        }
        Work::Product { x, y } => {
            let (v, w) = (&rows[x.value], &rows[y.value]);
            for n in 0..N {
                result[n] = v[n] * w[n];
            }
        }
        Work::Reciprocal { x } => {
            let v = &rows[x.value];
            for n in 0..N {
                result[n] = T::one() / v[n];
            }
        }
        Work::Power { x, exponent, .. } => {
            let v = &rows[x.value];
            for n in 0..N {
                result[n] = real(double(v[n]).power(exponent));
            }
        }
        Work::Call { function: Function::Sqrt, x } => {
            let v = &rows[x.value];
            for n in 0..N {
                result[n] = v[n].sqrt();
            }
        }
        Work::Call { function: Function::Ln, x } => {
            let v = &rows[x.value];
            for n in 0..N {
                let v = double(v[n]);
                result[n] = real((v - 1.0).ln_of_both(v));
            }
        }
        Work::Call { function, x } => {
            let v = &rows[x.value];
            for n in 0..N {
                result[n] = real(function.value(double(v[n])));
            }
        }
        Work::Angle { y, x } => {
            let (v, w) = (&rows[y.value], &rows[x.value]);
            for n in 0..N {
                result[n] = real(double(v[n]).polar_angle(double(w[n])));
            }
        }
    }
}

#[inline(always)]
fn affine<T: RealField + Copy, const N: usize>(
    x: &[T; N],
    factor: f64,
    constant: f64,
    result: &mut [T; N],
) {
    let (factor, constant): (T, T) = (real(factor), real(constant));
    for n in 0..N {
        result[n] = factor * x[n] + constant;
    }
}

#[inline(always)]
fn parts<T: RealField + Copy>(place: Location, deviation: T, value: T) -> Parts {
    Parts { rest: place.rest, deviation: double(deviation), value: double(value) }
}
