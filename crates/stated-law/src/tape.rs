//! Formulas as lists of operations on numbers that know their value at rest, and dual numbers over them.
//!
//! At rest `F = I`. A number `x` is kept as its value `r` at rest, a constant, and its deviation `d = x - r`, which is
//! computed without the difference; and as its value `v`, computed without `r + d`. Small strains have their digits in `d`,
//! bodies that are almost crushed in `v`. Where the value at rest is no number, `r` is zero and `d` is `v`: all formulas hold for
//! any constant `r`.

use crate::function::Function;
use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::{BTreeMap, HashMap};

/// Constants that are given may carry a few roundings from where they were computed.
const ROUNDING_OF_CONSTANTS: f64 = 4.0 * f64::EPSILON;

/// A value at rest, with a bound on the rounding errors in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rest {
    pub(crate) value: f64,
    error: f64,
}

impl Rest {
    const ZERO: Self = Self { value: 0.0, error: 0.0 };

    /// A number that is not larger than its rounding errors is zero.
    fn new(value: f64, error: f64) -> Self {
        if value.abs() <= error { Self::ZERO } else { Self { value, error } }
    }

    fn constant(value: f64) -> Self {
        Self { value, error: ROUNDING_OF_CONSTANTS * value.abs() }
    }

    fn times(self, other: Self) -> Self {
        let value = self.value * other.value;
        let error = self.value.abs() * other.error + other.value.abs() * self.error;
        Self::new(value, error + f64::EPSILON * value.abs())
    }

    fn sum(terms: &[Self]) -> Self {
        let value = terms.iter().map(|term| term.value).sum();
        let error = |term: &Self| term.error + f64::EPSILON * term.value.abs();
        Self::new(value, terms.iter().map(error).sum())
    }

    /// `function` of this value, with a bound on its rounding errors.
    fn of(self, function: impl Fn(f64) -> f64) -> Self {
        let value = function(self.value);
        let spread = [self.value - self.error, self.value + self.error]
            .map(|x| (function(x) - value).abs())
            .into_iter()
            .filter(|spread| spread.is_finite());
        Self::new(value, spread.fold(2.0 * f64::EPSILON * value.abs(), f64::max))
    }
}

/// A double as a part of keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Bits(u64);

impl Bits {
    fn new(value: f64) -> Self {
        // -0 is 0.
        Self((value + 0.0).to_bits())
    }

    pub(crate) fn get(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// The result of an operation on a [`Tape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Node(usize);

impl Node {
    pub(crate) fn at(index: usize) -> Self {
        Self(index)
    }

    pub(crate) fn index(self) -> usize {
        self.0
    }
}

/// A number: the same for all deformations, or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Constant(Rest),
    Varying(Node),
}

impl Value {
    pub(crate) const ZERO: Self = Self::Constant(Rest::ZERO);
    pub(crate) const ONE: Self = Self::Constant(Rest { value: 1.0, error: 0.0 });

    /// A constant, perhaps rounded.
    pub(crate) fn constant(value: f64) -> Self {
        Self::Constant(Rest::constant(value))
    }

    fn as_constant(self) -> Option<Rest> {
        match self {
            Self::Constant(rest) => Some(rest),
            Self::Varying(_) => None,
        }
    }

    fn is(self, value: f64) -> bool {
        self.as_constant().is_some_and(|rest| rest.value == value)
    }
}

/// A quantity that text may name, and derivatives be taken with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Argument(pub(crate) usize);

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operation {
    /// A component of `F`.
    Entry {
        row: usize,
        column: usize,
    },
    /// A number of a particle besides its deformation, which has no value at rest.
    Input {
        index: usize,
    },
    /// An argument of the law: the same number as another node, but derivatives stop here.
    Argument {
        argument: Argument,
        value: Node,
    },
    /// `factor x + constant`.
    Affine {
        x: Node,
        factor: Bits,
        constant: Bits,
    },
    /// `a x + b y + constant`.
    Sum {
        x: Node,
        a: Bits,
        y: Node,
        b: Bits,
        constant: Bits,
    },
    Product {
        x: Node,
        y: Node,
    },
    Reciprocal {
        x: Node,
    },
    Power {
        x: Node,
        exponent: Bits,
    },
    Call {
        function: Function,
        x: Node,
    },
    /// The polar angle of the point `(x, y)`.
    Angle {
        y: Node,
        x: Node,
    },
    /// `y = 1 + x`, with the deviation of `x` and the value of `y`.
    OnePlus {
        x: Node,
        y: Node,
    },
}

impl Operation {
    /// The nodes that it takes, the first one twice where it takes one.
    pub(crate) fn operands(self) -> Option<[Node; 2]> {
        match self {
            Self::Entry { .. } | Self::Input { .. } => None,
            Self::Argument { value: x, .. }
            | Self::Affine { x, .. }
            | Self::Reciprocal { x }
            | Self::Power { x, .. }
            | Self::Call { x, .. } => Some([x, x]),
            Self::Sum { x, y, .. }
            | Self::Product { x, y }
            | Self::Angle { x, y }
            | Self::OnePlus { x, y } => Some([x, y]),
        }
    }
}

/// An operation, and the value at rest of its result; none where that is not a finite number.
#[derive(Clone, Copy, Debug)]
struct Entry {
    operation: Operation,
    rest: Option<Rest>,
}

/// The variable of a derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Variable {
    /// An argument, the others being held.
    Argument(Argument),
    /// A component of F.
    Entry { row: usize, column: usize },
}

/// Operations in the order in which they are done; equal ones are one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tape {
    rows: Vec<Entry>,
    known: HashMap<Operation, Node>,
}

impl Tape {
    pub(crate) fn operation(&self, node: Node) -> Operation {
        self.rows[node.0].operation
    }

    /// The value at rest, if it is a finite number.
    pub(crate) fn rest(&self, node: Node) -> Option<f64> {
        self.rows[node.0].rest.map(|rest| rest.value)
    }

    /// The constant that deviations are from.
    fn reference(&self, node: Node) -> Rest {
        self.rows[node.0].rest.unwrap_or(Rest::ZERO)
    }

    fn push(&mut self, operation: Operation) -> Node {
        if let Some(&node) = self.known.get(&operation) {
            return node;
        }
        let rest = self.rest_of(operation);
        let node = Node(self.rows.len());
        let rest = rest.value.is_finite().then_some(rest);
        self.rows.push(Entry { operation, rest });
        self.known.insert(operation, node);
        node
    }

    fn rest_of(&self, operation: Operation) -> Rest {
        let of = |node: Node| self.reference(node);
        let multiple = |factor: Bits, node| Rest::constant(factor.get()).times(of(node));
        match operation {
            Operation::Entry { row, column } if row == column => Rest { value: 1.0, error: 0.0 },
            Operation::Entry { .. } => Rest::ZERO,
            Operation::Input { .. } => Rest { value: f64::NAN, error: 0.0 },
            // What is known of the value at rest is known of its other name.
            Operation::Argument { value, .. } => of(value),
            Operation::Affine { x, factor, constant } => {
                Rest::sum(&[multiple(factor, x), Rest::constant(constant.get())])
            }
            Operation::Sum { x, a, y, b, constant } => {
                Rest::sum(&[multiple(a, x), multiple(b, y), Rest::constant(constant.get())])
            }
            Operation::Product { x, y } => of(x).times(of(y)),
            Operation::Reciprocal { x } => of(x).of(f64::recip),
            Operation::Power { x, exponent } => of(x).of(|x| x.power(exponent.get())),
            Operation::Call { function, x } => of(x).of(|x| function.value(x)),
            Operation::Angle { y, x } if of(x).value == 0.0 && of(y).value == 0.0 => {
                Rest { value: f64::NAN, error: 0.0 }
            }
            Operation::Angle { y, x } => {
                let (by_y, by_x) = (
                    of(y).of(|y| y.polar_angle(of(x).value)),
                    of(x).of(|x| of(y).value.polar_angle(x)),
                );
                Rest::new(by_y.value, by_y.error + by_x.error)
            }
            Operation::OnePlus { x, .. } => Rest::sum(&[Rest::constant(1.0), of(x)]),
        }
    }

    pub(crate) fn entry(&mut self, row: usize, column: usize) -> Value {
        Value::Varying(self.push(Operation::Entry { row, column }))
    }

    pub(crate) fn input(&mut self, index: usize) -> Value {
        Value::Varying(self.push(Operation::Input { index }))
    }

    pub(crate) fn argument(&mut self, argument: Argument, value: Value) -> Value {
        match value {
            Value::Varying(value) => {
                Value::Varying(self.push(Operation::Argument { argument, value }))
            }
            constant => constant,
        }
    }

    /// A number as a multiple of another one.
    fn as_multiple(&self, node: Node) -> (f64, Node) {
        match self.operation(node) {
            Operation::Affine { x, factor, constant } if constant.get() == 0.0 => (factor.get(), x),
            _ => (1.0, node),
        }
    }

    /// The sum of multiples.
    pub(crate) fn sum(&mut self, terms: &[(f64, Value)]) -> Value {
        let mut constants = Vec::new();
        let mut factors: BTreeMap<Node, f64> = BTreeMap::new();
        for &(factor, term) in terms {
            match term {
                Value::Constant(rest) => {
                    constants.push(rest.times(Rest { value: factor, error: 0.0 }));
                }
                Value::Varying(node) => {
                    let (own, node) = self.as_multiple(node);
                    *factors.entry(node).or_default() += factor * own;
                }
            }
        }
        factors.retain(|_, factor| *factor != 0.0);
        let constant = Rest::sum(&constants);
        let zero = Bits::new(0.0);
        let mut factors = factors.into_iter().map(|(x, factor)| (x, Bits::new(factor)));
        let last = factors.next_back();
        // The sum of all terms but the last, as a multiple of a node.
        let mut sum: Option<(Node, Bits)> = None;
        for (y, b) in factors {
            sum = Some(match sum {
                None => (y, b),
                Some((x, a)) => {
                    (self.push(Operation::Sum { x, a, y, b, constant: zero }), Bits::new(1.0))
                }
            });
        }
        let Some((x, factor)) = last else { return Value::Constant(constant) };
        let constant = Bits::new(constant.value);
        Value::Varying(match sum {
            Some((y, b)) => self.push(Operation::Sum { x: y, a: b, y: x, b: factor, constant }),
            None if factor.get() == 1.0 && constant == zero => x,
            None => self.push(Operation::Affine { x, factor, constant }),
        })
    }

    pub(crate) fn add(&mut self, x: Value, y: Value) -> Value {
        self.sum(&[(1.0, x), (1.0, y)])
    }

    pub(crate) fn product(&mut self, x: Value, y: Value) -> Value {
        match (x, y) {
            (Value::Constant(x), Value::Constant(y)) => Value::Constant(x.times(y)),
            (Value::Constant(factor), value) | (value, Value::Constant(factor)) => {
                self.sum(&[(factor.value, value)])
            }
            (Value::Varying(x), Value::Varying(y)) => {
                let ((a, x), (b, y)) = (self.as_multiple(x), self.as_multiple(y));
                let product = self.push(Operation::Product { x: x.min(y), y: x.max(y) });
                self.sum(&[(a * b, Value::Varying(product))])
            }
        }
    }

    pub(crate) fn reciprocal(&mut self, x: Value) -> Value {
        match x {
            Value::Constant(x) => Value::Constant(x.of(f64::recip)),
            Value::Varying(x) => {
                let (factor, x) = self.as_multiple(x);
                let reciprocal = self.push(Operation::Reciprocal { x });
                self.sum(&[(factor.recip(), Value::Varying(reciprocal))])
            }
        }
    }

    pub(crate) fn call(&mut self, function: Function, x: Value) -> Value {
        match x {
            Value::Constant(x) => Value::Constant(x.of(|x| function.value(x))),
            Value::Varying(x) => Value::Varying(self.push(Operation::Call { function, x })),
        }
    }

    /// `x^exponent`.
    pub(crate) fn power(&mut self, x: Value, exponent: Value) -> Value {
        match (x, exponent) {
            (Value::Constant(x), Value::Constant(exponent)) => {
                Value::Constant(x.of(|x| x.power(exponent.value)))
            }
            (x, Value::Constant(exponent)) => self.constant_power(x, exponent.value),
            (x, exponent) => {
                let logarithm = self.call(Function::Ln, x);
                let product = self.product(exponent, logarithm);
                self.call(Function::Exp, product)
            }
        }
    }

    fn constant_power(&mut self, x: Value, exponent: f64) -> Value {
        /// Powers up to here are products.
        const LARGEST: f64 = 16.0;
        let doubled = 2.0 * exponent;
        if doubled.fract() != 0.0 || exponent.abs() > LARGEST {
            return match x {
                Value::Constant(x) => Value::Constant(x.of(|x| x.power(exponent))),
                Value::Varying(x) => {
                    let exponent = Bits::new(exponent);
                    Value::Varying(self.push(Operation::Power { x, exponent }))
                }
            };
        }
        let inverse = exponent < 0.0;
        let invert = |tape: &mut Self, x| if inverse { tape.reciprocal(x) } else { x };
        let mut result = Value::ONE;
        if exponent.fract() != 0.0 {
            let root = self.call(Function::Sqrt, x);
            result = invert(self, root);
        }
        let mut left = exponent.abs() as u32;
        let mut square = if left > 0 { invert(self, x) } else { x };
        while left > 0 {
            if left % 2 == 1 {
                result = self.product(result, square);
            }
            left /= 2;
            if left > 0 {
                square = self.product(square, square);
            }
        }
        result
    }

    /// The polar angle of the point `(x, y)`.
    pub(crate) fn angle(&mut self, y: Value, x: Value) -> Value {
        if let (Some(y), Some(x)) = (y.as_constant(), x.as_constant()) {
            return Value::Constant(y.of(|y| y.polar_angle(x.value)));
        }
        let (y, x) = (self.varying(y), self.varying(x));
        Value::Varying(self.push(Operation::Angle { y, x }))
    }

    /// `y = 1 + x`, near one by `x`, else by `y`.
    pub(crate) fn one_plus(&mut self, x: Value, y: Value) -> Value {
        if x.as_constant().is_some() || y.as_constant().is_some() {
            return y;
        }
        let (x, y) = (self.varying(x), self.varying(y));
        Value::Varying(self.push(Operation::OnePlus { x, y }))
    }

    /// A node for a number that may be a constant.
    fn varying(&mut self, value: Value) -> Node {
        match value {
            Value::Varying(node) => node,
            Value::Constant(rest) => {
                // Zero times any component of F, and the constant.
                let x = self.push(Operation::Entry { row: 0, column: 0 });
                let (factor, constant) = (Bits::new(0.0), Bits::new(rest.value));
                self.push(Operation::Affine { x, factor, constant })
            }
        }
    }

    /// The derivative with respect to an argument, the other arguments being held.
    ///
    /// Forward: each number on the way becomes a dual number, whose second part is a number of this tape as well, with a value at
    /// rest and a deviation.
    pub(crate) fn derivative(&mut self, of: Value, argument: Argument) -> Value {
        self.derivatives(&[of], Variable::Argument(argument))[0]
    }

    /// Derivatives with respect to a component of F, on which all arguments depend.
    pub(crate) fn slopes(&mut self, of: &[Value], row: usize, column: usize) -> Vec<Value> {
        self.derivatives(of, Variable::Entry { row, column })
    }

    fn derivatives(&mut self, of: &[Value], variable: Variable) -> Vec<Value> {
        let last = |value: &Value| match value {
            Value::Varying(node) => node.0 + 1,
            Value::Constant(_) => 0,
        };
        let count = of.iter().map(last).max().unwrap_or(0);
        let mut dual = Vec::with_capacity(count);
        for index in 0..count {
            let derivative = self.dual_part(Node(index), variable, &dual);
            dual.push(derivative);
        }
        let found = |value: &Value| match value {
            Value::Varying(node) => dual[node.0],
            Value::Constant(_) => Value::ZERO,
        };
        of.iter().map(found).collect()
    }

    /// The second part of the dual number of a node, from those of the nodes before it.
    fn dual_part(&mut self, node: Node, variable: Variable, dual: &[Value]) -> Value {
        let value = Value::Varying(node);
        let operation = self.operation(node);
        match (operation, variable) {
            (Operation::Argument { argument: own, .. }, Variable::Argument(argument)) => {
                return if own == argument { Value::ONE } else { Value::ZERO };
            }
            (Operation::Argument { value, .. }, Variable::Entry { .. }) => return dual[value.0],
            (Operation::Entry { row, column }, variable) => {
                let own = Variable::Entry { row, column };
                return if own == variable { Value::ONE } else { Value::ZERO };
            }
            _ => {}
        }
        let Some([dx, dy]) = operation.operands().map(|nodes| nodes.map(|node| dual[node.0]))
        else {
            return Value::ZERO;
        };
        if dx.is(0.0) && dy.is(0.0) {
            return Value::ZERO;
        }
        match operation {
            Operation::Entry { .. } | Operation::Input { .. } | Operation::Argument { .. } => {
                Value::ZERO
            }
            Operation::Affine { factor, .. } => self.sum(&[(factor.get(), dx)]),
            Operation::Sum { a, b, .. } => self.sum(&[(a.get(), dx), (b.get(), dy)]),
            Operation::Product { x, y } => {
                let (x, y) = (Value::Varying(x), Value::Varying(y));
                let (first, second) = (self.product(dx, y), self.product(x, dy));
                self.add(first, second)
            }
            Operation::Reciprocal { .. } => {
                let square = self.product(value, value);
                let product = self.product(square, dx);
                self.sum(&[(-1.0, product)])
            }
            Operation::Power { x, exponent } => {
                let power = self.constant_power(Value::Varying(x), exponent.get() - 1.0);
                let product = self.product(power, dx);
                self.sum(&[(exponent.get(), product)])
            }
            Operation::Call { function, x } => {
                let slope = function.slope(self, Value::Varying(x), value);
                self.product(slope, dx)
            }
            Operation::Angle { y, x } => {
                let (y, x) = (Value::Varying(y), Value::Varying(x));
                let (first, second) = (self.product(x, dy), self.product(y, dx));
                let numerator = self.sum(&[(1.0, first), (-1.0, second)]);
                let (x, y) = (self.product(x, x), self.product(y, y));
                let denominator = self.add(x, y);
                let reciprocal = self.reciprocal(denominator);
                self.product(numerator, reciprocal)
            }
            Operation::OnePlus { .. } => dx,
        }
    }
}
