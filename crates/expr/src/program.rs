//! Straight-line programs: what is computed, in which order, in floating point.
//!
//! Lowering decides on rounding, so it follows rules that keep digits: the constant of a sum is added last, after
//! everything small; powers are products; `sin(Pi x)` is one operation on `x`; numbers are rounded once.
//! It also keeps apart what changes at different rates. Factors and terms that depend on parameters only are
//! combined before those that depend on time or on position, so that the slow parts are computed rarely.

mod argument;
mod builder;
mod error_bounds;
mod gather;
pub(crate) mod keep;
mod reciprocal;
mod scalar;
mod section;
mod separate;
#[cfg(test)]
mod tests;

pub use argument::RangeOfInputs;
pub(crate) use builder::{Builder, power};
pub(crate) use error_bounds::SIDE;
pub use keep::MOST_KEPT_OF_STATES;
pub use scalar::Scalar;
pub use section::Section;

use crate::graph::NumberMap;
use crate::{Expr, Function, Graph, Node, Rational, Rule, nearest_f64};
use num_traits::{One, Signed, ToPrimitive, Zero};

/// The place of a value in a program: the index of the operation that computes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Slot(u32);

impl Slot {
    pub(crate) fn at(index: usize) -> Self {
        Slot(index as u32)
    }

    /// The index of the operation.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// One step of a program; operands are slots of earlier steps.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// A constant.
    Number(Rational),
    /// The circle number.
    Pi,
    /// An input, by its index.
    Input(usize),
    /// Sum.
    Add(Slot, Slot),
    /// Difference.
    Sub(Slot, Slot),
    /// Product.
    Mul(Slot, Slot),
    /// Quotient.
    Div(Slot, Slot),
    /// Negation.
    Neg(Slot),
    /// Square root.
    Sqrt(Slot),
    /// A power with a positive exponent that is neither whole nor half.
    Power(Slot, Rational),
    /// `sin(Pi x)`.
    SinPi(Slot),
    /// `cos(Pi x)`.
    CosPi(Slot),
    /// A function of one argument.
    Call(Function, Slot),
    /// `atan2(y, x)`.
    Atan2(Slot, Slot),
    /// `ln(y)` of `y = 1 + x`, given as `(x, y)`: by `y` where `x < -1/2`, else by `x`.
    LnOfBoth(Slot, Slot),
    /// Rounding error of a sum: `a + b` less its rounded value, exactly.
    SumError(Slot, Slot),
    /// Rounding error of a product: `a b` less its rounded value, exactly.
    ProductError(Slot, Slot),
}

impl Operation {
    /// The slots that it reads.
    pub fn operands(&self) -> impl Iterator<Item = Slot> + use<> {
        let (count, slots) = match *self {
            Operation::Number(_) | Operation::Pi | Operation::Input(_) => (0, [Slot(0); 2]),
            Operation::Add(a, b)
            | Operation::Sub(a, b)
            | Operation::Mul(a, b)
            | Operation::Div(a, b)
            | Operation::Atan2(a, b)
            | Operation::LnOfBoth(a, b)
            | Operation::SumError(a, b)
            | Operation::ProductError(a, b) => (2, [a, b]),
            Operation::Neg(a)
            | Operation::Sqrt(a)
            | Operation::Power(a, _)
            | Operation::SinPi(a)
            | Operation::CosPi(a)
            | Operation::Call(_, a) => (1, [a; 2]),
        };
        slots.into_iter().take(count)
    }

    /// This operation with each slot replaced by `place` of that slot.
    pub(crate) fn with_operands(&self, place: impl Fn(Slot) -> Slot) -> Self {
        match *self {
            Operation::Number(_) | Operation::Pi | Operation::Input(_) => self.clone(),
            Operation::Add(a, b) => Operation::Add(place(a), place(b)),
            Operation::Sub(a, b) => Operation::Sub(place(a), place(b)),
            Operation::Mul(a, b) => Operation::Mul(place(a), place(b)),
            Operation::Div(a, b) => Operation::Div(place(a), place(b)),
            Operation::Neg(a) => Operation::Neg(place(a)),
            Operation::Sqrt(a) => Operation::Sqrt(place(a)),
            Operation::Power(a, ref exponent) => Operation::Power(place(a), exponent.clone()),
            Operation::SinPi(a) => Operation::SinPi(place(a)),
            Operation::CosPi(a) => Operation::CosPi(place(a)),
            Operation::Call(function, a) => Operation::Call(function, place(a)),
            Operation::Atan2(a, b) => Operation::Atan2(place(a), place(b)),
            Operation::LnOfBoth(a, b) => Operation::LnOfBoth(place(a), place(b)),
            Operation::SumError(a, b) => Operation::SumError(place(a), place(b)),
            Operation::ProductError(a, b) => Operation::ProductError(place(a), place(b)),
        }
    }
}

/// Dependence of a value, as a set of rates of change; on parameters only where both are false.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Dependence {
    /// On the position `X`.
    pub position: bool,
    /// On the time `t`.
    pub time: bool,
}

impl Dependence {
    pub(crate) fn join(self, other: Self) -> Self {
        Dependence { position: self.position || other.position, time: self.time || other.time }
    }

    /// Whether it depends on parameters only.
    #[must_use]
    pub fn is_fixed(self) -> bool {
        !self.position && !self.time
    }
}

/// How many operations of each kind there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OperationCount {
    /// Sums, differences and changes of sign.
    pub additions: usize,
    /// Products.
    pub multiplications: usize,
    /// Quotients.
    pub divisions: usize,
    /// Square roots.
    pub square_roots: usize,
    /// Calls of all other functions.
    pub calls: usize,
}

impl OperationCount {
    /// The number of all operations.
    #[must_use]
    pub fn total(&self) -> usize {
        self.additions + self.multiplications + self.divisions + self.square_roots + self.calls
    }

    /// A rough cost, in additions.
    #[must_use]
    pub fn cost(&self) -> usize {
        self.additions
            + self.multiplications
            + 8 * (self.divisions + self.square_roots)
            + 40 * self.calls
    }

    pub(crate) fn of(operation: &Operation) -> Self {
        let mut count = Self::default();
        count.count(operation);
        count
    }

    pub(crate) fn count(&mut self, operation: &Operation) {
        match operation {
            Operation::Number(_) | Operation::Pi | Operation::Input(_) => {}
            Operation::Add(..) | Operation::Sub(..) | Operation::Neg(_) => self.additions += 1,
            Operation::Mul(..) => self.multiplications += 1,
            Operation::Div(..) => self.divisions += 1,
            Operation::Sqrt(_) => self.square_roots += 1,
            // Beside the sum or the product itself, with one operand of the product a number that is split beforehand.
            Operation::SumError(..) => self.additions += 5,
            Operation::ProductError(..) => {
                self.additions += 7;
                self.multiplications += 5;
            }
            Operation::Power(..)
            | Operation::SinPi(_)
            | Operation::CosPi(_)
            | Operation::Call(..)
            | Operation::Atan2(..)
            | Operation::LnOfBoth(..) => self.calls += 1,
        }
    }
}

/// The operations of a program by how often they have to be done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OperationsByStage {
    /// Once for given parameters.
    pub fixed: OperationCount,
    /// Once for each time.
    pub time: OperationCount,
    /// Once for each point.
    pub point: OperationCount,
    /// For each point at each time.
    pub both: OperationCount,
}

/// A list of operations that computes several outputs from several inputs; equal operations occur once.
#[derive(Clone, Debug, Default)]
pub struct Program {
    operations: Vec<Operation>,
    dependence: Vec<Dependence>,
    outputs: Vec<Slot>,
    /// The numbers, rounded once; zero for all other operations.
    numbers: Vec<f64>,
}

impl Program {
    /// The program for `outputs` as functions of `inputs`.
    ///
    /// `definitions` say what further symbols mean, as that the polar radius is `sqrt(X^2 + Y^2)`. Symbols that
    /// are neither count as not-a-number; [`Graph::symbols_in`] tells beforehand.
    #[must_use]
    pub fn lower(
        graph: &mut Graph,
        inputs: &[(Expr, Dependence)],
        definitions: &[(Expr, Expr)],
        outputs: &[Expr],
    ) -> Self {
        let mut lowering = Lowering {
            graph,
            builder: Builder::default(),
            lowered: NumberMap::default(),
            inputs,
            definitions,
        };
        let outputs: Vec<Slot> = outputs.iter().map(|&output| lowering.lower(output)).collect();
        lowering.builder.program(outputs).with_shared_reciprocals()
    }

    /// A program of operations in order, with what each depends on.
    pub(crate) fn from_parts(
        operations: Vec<Operation>,
        dependence: Vec<Dependence>,
        outputs: Vec<Slot>,
    ) -> Self {
        Program { operations, dependence, outputs, numbers: Vec::new() }
    }

    /// The program without operations that no output needs.
    pub(crate) fn compacted(&self) -> Self {
        self.part(&self.outputs)
    }

    /// The operations that `outputs` need.
    #[must_use]
    pub fn part(&self, outputs: &[Slot]) -> Self {
        part(&self.operations, &self.dependence, outputs)
    }

    /// The operations, each after those that it reads.
    #[must_use]
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// Where the outputs are, in the order in which they were asked for.
    #[must_use]
    pub fn outputs(&self) -> &[Slot] {
        &self.outputs
    }

    /// One more than the index of the last input.
    pub(crate) fn input_count(&self) -> usize {
        let end = |operation: &Operation| match operation {
            Operation::Input(index) => index.checked_add(1),
            _ => None,
        };
        self.operations.iter().filter_map(end).max().unwrap_or(0)
    }

    /// Dependence of the value in `slot`.
    #[must_use]
    pub fn dependence(&self, slot: Slot) -> Dependence {
        self.dependence[slot.index()]
    }

    /// The slots of all operations, in order.
    pub fn slots(&self) -> impl Iterator<Item = Slot> + use<> {
        (0..self.operations.len()).map(Slot::at)
    }

    /// For each operation, whether `outputs` need it.
    #[must_use]
    pub fn needed(&self, outputs: &[Slot]) -> Vec<bool> {
        needed(&self.operations, outputs)
    }

    /// The operations that `outputs` need, by what they depend on.
    #[must_use]
    pub(crate) fn operations_by_stage(&self, outputs: &[Slot]) -> OperationsByStage {
        let mut stages = OperationsByStage::default();
        for (index, _) in self.needed(outputs).iter().enumerate().filter(|(_, needed)| **needed) {
            let dependence = self.dependence[index];
            let stage = match (dependence.position, dependence.time) {
                (false, false) => &mut stages.fixed,
                (false, true) => &mut stages.time,
                (true, false) => &mut stages.point,
                (true, true) => &mut stages.both,
            };
            stage.count(&self.operations[index]);
        }
        stages
    }

    /// The outputs at the given input values, in double precision: the bits of generated code.
    ///
    /// An input that is not given counts as not-a-number.
    #[must_use]
    pub fn evaluate(&self, inputs: &[f64]) -> Vec<f64> {
        self.evaluate_in(inputs)
    }

    /// As [`Program::evaluate`], in the precision of the inputs.
    #[must_use]
    pub fn evaluate_in<T: Scalar>(&self, inputs: &[T]) -> Vec<T> {
        let values = self.values(inputs.as_chunks::<1>().0);
        self.outputs.iter().map(|slot| values[slot.index()][0]).collect()
    }

    /// The value of every operation at `N` places, which are given by the values of each input there.
    pub(crate) fn values<T: Scalar, const N: usize>(&self, inputs: &[[T; N]]) -> Vec<[T; N]> {
        let mut values = Vec::with_capacity(self.operations.len());
        for (operation, &number) in self.operations.iter().zip(&self.numbers) {
            values.push(match operation {
                Operation::Number(_) => [T::rounded(number); N],
                _ => operation.row(inputs, &values),
            });
        }
        values
    }
}

/// For each operation, whether `outputs` need it.
fn needed(operations: &[Operation], outputs: &[Slot]) -> Vec<bool> {
    let mut needed = vec![false; operations.len()];
    let mut stack = outputs.to_vec();
    while let Some(slot) = stack.pop() {
        if !needed[slot.index()] {
            needed[slot.index()] = true;
            stack.extend(operations[slot.index()].operands());
        }
    }
    needed
}

/// The operations that `outputs` need, and their numbers, rounded.
fn part(operations: &[Operation], dependence: &[Dependence], outputs: &[Slot]) -> Program {
    let needed = needed(operations, outputs);
    let mut places: Vec<Slot> = Vec::with_capacity(operations.len());
    let mut program = Program::default();
    for (index, operation) in operations.iter().enumerate() {
        places.push(Slot::at(program.operations.len()));
        if needed[index] {
            program.operations.push(operation.with_operands(|slot| places[slot.index()]));
            program.dependence.push(dependence[index]);
        }
    }
    program.outputs = outputs.iter().map(|slot| places[slot.index()]).collect();
    let number = |operation: &Operation| match operation {
        Operation::Number(value) => nearest_f64(value),
        _ => 0.0,
    };
    program.numbers = program.operations.iter().map(number).collect();
    program
}

struct Lowering<'a> {
    graph: &'a mut Graph,
    builder: Builder,
    lowered: NumberMap<Expr, Slot>,
    inputs: &'a [(Expr, Dependence)],
    definitions: &'a [(Expr, Expr)],
}

/// Dependence of an expression, where some symbols have definitions.
fn dependence(
    graph: &Graph,
    inputs: &[(Expr, Dependence)],
    definitions: &[(Expr, Expr)],
    expr: Expr,
) -> Dependence {
    let symbols = graph.symbols_in(&[expr]);
    let own = inputs.iter().filter(|(input, _)| symbols.contains(input)).map(|(_, own)| *own);
    let defined = definitions.iter().filter(|(symbol, _)| symbols.contains(symbol));
    let defined = defined.map(|(_, meaning)| dependence(graph, inputs, definitions, *meaning));
    own.chain(defined).fold(Dependence::default(), Dependence::join)
}

/// A part of a sum.
enum Part {
    Term(Expr, Rational),
    /// A factor and what it multiplies.
    Product(Expr, Expr),
}

/// Terms of a sum with a common factor that depends on parameters only.
struct Group {
    /// Whether further terms of this factor belong to it.
    open: bool,
    factor: Expr,
    rate: Dependence,
    /// The sign of each term, and the term without the factor.
    rests: Vec<(Rational, Expr)>,
    /// The first of the terms.
    term: (Expr, Rational),
}

impl Lowering<'_> {
    fn push(&mut self, operation: Operation) -> Slot {
        let of_input = match operation {
            Operation::Input(index) => self.inputs.get(index).map(|(_, dependence)| *dependence),
            _ => None,
        };
        self.builder.push_input(operation, of_input.unwrap_or_default())
    }

    fn lower(&mut self, expr: Expr) -> Slot {
        if let Some(&slot) = self.lowered.get(&expr) {
            return slot;
        }
        let slot = match self.graph.node(expr).clone() {
            Node::Number(value) => self.number(value),
            Node::Pi => self.push(Operation::Pi),
            Node::Symbol(_) => self.symbol(expr),
            Node::Whole(inner) => self.lower(inner),
            Node::Product(factors) => self.product(&factors, &Rational::one()),
            Node::Call(Function::Atan2, arguments) => {
                let (y, x) = (self.lower(arguments[0]), self.lower(arguments[1]));
                self.push(Operation::Atan2(y, x))
            }
            Node::Call(Function::LnOfBoth, arguments) => {
                let (x, y) = (self.lower(arguments[0]), self.lower(arguments[1]));
                self.push(Operation::LnOfBoth(x, y))
            }
            Node::Call(function, arguments) => self.call(function, arguments[0]),
            Node::Sum { constant, terms } => self.sum(constant, &terms),
        };
        self.lowered.insert(expr, slot);
        slot
    }

    fn number(&mut self, value: Rational) -> Slot {
        if value.is_negative() {
            let positive = self.push(Operation::Number(-value));
            return self.push(Operation::Neg(positive));
        }
        self.push(Operation::Number(value))
    }

    fn symbol(&mut self, expr: Expr) -> Slot {
        if let Some(&(_, meaning)) = self.definitions.iter().find(|(symbol, _)| *symbol == expr) {
            return self.lower(meaning);
        }
        let index = self.inputs.iter().position(|(symbol, _)| *symbol == expr);
        self.push(Operation::Input(index.unwrap_or(usize::MAX)))
    }

    fn call(&mut self, function: Function, argument: Expr) -> Slot {
        if let (Function::Ln1p, Node::Call(Function::Exp, arguments)) =
            (function, self.graph.node(argument))
            && !Rule::LogOfExponential.is_off()
        {
            return self.log_of_one_and_exponential(arguments[0]);
        }
        if let (Function::Ln, Some(rest)) = (function, self.beside_one(argument)) {
            let logarithm = self.graph.call(Function::Ln1p, &[rest]);
            return self.lower(logarithm);
        }
        if matches!(function, Function::Sin | Function::Cos) {
            let pi = self.graph.pi();
            let turns = self.graph.div(argument, pi);
            if !self.contains_pi_as_factor(turns) {
                return self.applied(function, turns, true);
            }
        }
        self.applied(function, argument, false)
    }

    /// `ln(1 + exp(x)) = max(x, 0) + log1p(exp(-|x|))`, which no exponential leaves its range in.
    fn log_of_one_and_exponential(&mut self, exponent: Expr) -> Slot {
        let x = self.lower(exponent);
        let square = self.push(Operation::Mul(x, x));
        let size = self.push(Operation::Sqrt(square));
        let twice_positive = self.push(Operation::Add(x, size));
        let half = self.push(Operation::Number(Rational::new(1.into(), 2.into())));
        let positive = self.push(Operation::Mul(half, twice_positive));
        let opposite = self.push(Operation::Neg(size));
        let decaying = self.push(Operation::Call(Function::Exp, opposite));
        let rest = self.push(Operation::Call(Function::Ln1p, decaying));
        self.push(Operation::Add(positive, rest))
    }

    /// Whether a power of pi stands in the product `expr`: then dividing by pi did not take it away.
    fn contains_pi_as_factor(&self, expr: Expr) -> bool {
        match self.graph.node(expr) {
            Node::Pi => true,
            Node::Product(factors) => {
                factors.iter().any(|(base, _)| matches!(self.graph.node(*base), Node::Pi))
            }
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                self.contains_pi_as_factor(terms[0].0)
            }
            _ => false,
        }
    }

    /// The `x` of `1 + x`, which may be written as a multiple of a sum.
    fn beside_one(&mut self, expr: Expr) -> Option<Expr> {
        if Rule::LogBesideOne.is_off() {
            return None;
        }
        let (sum, scale) = match self.graph.node(expr) {
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                (terms[0].0, terms[0].1.clone())
            }
            _ => (expr, Rational::one()),
        };
        let Node::Sum { constant, .. } = self.graph.node(sum) else { return None };
        let constant = constant.clone();
        if !(&constant * &scale).is_one() {
            return None;
        }
        let constant = self.graph.number(constant);
        let rest = self.graph.sub(sum, constant);
        Some(self.graph.sum([(scale, rest)]))
    }

    fn sum(&mut self, constant: Rational, terms: &[(Expr, Rational)]) -> Slot {
        let product = match terms {
            [(term, coefficient)] => self.graph.constant_and_term(&constant, *term, coefficient),
            [(a, of_a), (b, of_b)] if constant.is_zero() => {
                let (inputs, definitions) = (self.inputs, self.definitions);
                self.graph.two_terms([(*a, of_a), (*b, of_b)], |graph, terms| {
                    let [a, b] = terms.map(|term| dependence(graph, inputs, definitions, term));
                    a == b
                })
            }
            [_, _, ..] if !constant.is_zero() => self.graph.constant_among_terms(&constant, terms),
            _ => None,
        };
        if let Some(product) = product {
            return self.lower(product);
        }
        if !constant.is_zero() {
            // The rest as an expression of its own: where it occurs elsewhere, as H does beside 1 + H, it is shared.
            let rest = self.graph.sum(terms.iter().map(|(term, c)| (c.clone(), *term)));
            let rest = self.signed(rest);
            let constant = (constant.is_negative(), self.push(Operation::Number(constant.abs())));
            let (negative, total) = self.add([rest, constant].to_vec());
            return self.with_sign(negative, total);
        }
        let (negative, total) = self.terms(terms);
        self.with_sign(negative, total)
    }

    /// The expression as a sign and a value, so that a leading minus costs no operation.
    fn signed(&mut self, expr: Expr) -> (bool, Slot) {
        match self.graph.node(expr).clone() {
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                self.terms(&terms)
            }
            _ => (false, self.lower(expr)),
        }
    }

    fn terms(&mut self, terms: &[(Expr, Rational)]) -> (bool, Slot) {
        let mut by_rate: Vec<(Dependence, (bool, Slot))> = Vec::new();
        for part in self.with_common_factors(terms) {
            let part = match part {
                Part::Term(term, coefficient) => {
                    let (turned, slot) = self.signed_term(term, &coefficient.abs());
                    (coefficient.is_negative() != turned, slot)
                }
                Part::Product(factor, inner) => {
                    let (negative, inner) = self.signed(inner);
                    let factor = self.lower(factor);
                    (negative, self.push(Operation::Mul(factor, inner)))
                }
            };
            by_rate.push((self.builder.dependence(part.1), part));
        }
        by_rate.sort_by_key(|(dependence, _)| *dependence);
        let mut groups = Vec::new();
        for group in by_rate.chunk_by(|a, b| a.0 == b.0) {
            groups.push(self.add(group.iter().map(|(_, part)| *part).collect()));
        }
        self.add(groups)
    }

    /// The parts of a sum: a factor that some of the terms share is multiplied with their sum.
    ///
    /// First what depends on parameters only, coefficients included, where the rests are of one rate. Then, among what
    /// is left, the factor that most terms have, again and again.
    fn with_common_factors(&mut self, terms: &[(Expr, Rational)]) -> Vec<Part> {
        if Rule::CommonFactors.is_off() {
            return terms.iter().map(|(term, c)| Part::Term(*term, c.clone())).collect();
        }
        let mut groups: Vec<Group> = Vec::new();
        for (term, coefficient) in terms {
            let (factor, rest, rate) = self.split_off_fixed(*term, &coefficient.abs());
            let open = factor != Graph::ONE && rest != Graph::ONE;
            let sign = Rational::from(if coefficient.is_negative() { -1 } else { 1 });
            let known = groups
                .iter_mut()
                .find(|group| open && group.open && group.factor == factor && group.rate == rate);
            match known {
                Some(group) => group.rests.push((sign, rest)),
                None => groups.push(Group {
                    open,
                    factor,
                    rate,
                    rests: vec![(sign, rest)],
                    term: (*term, coefficient.clone()),
                }),
            }
        }
        let mut parts = Vec::new();
        let mut single = Vec::new();
        for group in groups {
            if group.rests.len() > 1 {
                parts.push(Part::Product(group.factor, self.sum_of_whole(group.rests)));
            } else {
                single.push(group.term);
            }
        }
        while let Some(factor) = self.most_common_factor(&single) {
            let mut rests = Vec::new();
            let mut others = Vec::new();
            for (term, coefficient) in single {
                if self.has_factor(term, &factor) {
                    let inverse = (factor.0, -factor.1.clone());
                    let rest = self.graph.product([(term, Rational::one()), inverse]);
                    rests.push((coefficient, rest));
                } else {
                    others.push((term, coefficient));
                }
            }
            let inner = self.sum_of_whole(rests);
            parts.push(Part::Product(self.graph.product([factor]), inner));
            single = others;
        }
        parts.extend(single.into_iter().map(|(term, coefficient)| Part::Term(term, coefficient)));
        parts
    }

    /// The sum in which each term that is a sum stays one quantity, as it may be used elsewhere.
    fn sum_of_whole(&mut self, terms: Vec<(Rational, Expr)>) -> Expr {
        let terms: Vec<_> =
            terms.into_iter().map(|(c, term)| (c, self.graph.whole(term))).collect();
        self.graph.sum(terms)
    }

    /// The factor that most of the terms have, of several the first; `None` where each stands in one term only.
    fn most_common_factor(&mut self, terms: &[(Expr, Rational)]) -> Option<(Expr, Rational)> {
        if terms.len() < 2 {
            return None;
        }
        let mut counts: Vec<((Expr, Rational), usize)> = Vec::new();
        for (term, _) in terms {
            for factor in self.factors(*term) {
                let slot = self.lower(factor.0);
                if self.builder.dependence(slot).is_fixed() {
                    continue;
                }
                match counts.iter_mut().find(|(known, _)| *known == factor) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((factor, 1)),
                }
            }
        }
        let most = counts.iter().map(|(_, count)| *count).max().filter(|&count| count > 1)?;
        counts.into_iter().find(|(_, count)| *count == most).map(|(factor, _)| factor)
    }

    fn has_factor(&self, term: Expr, factor: &(Expr, Rational)) -> bool {
        match self.graph.node(term) {
            Node::Product(factors) => factors.contains(factor),
            _ => term == factor.0 && factor.1.is_one(),
        }
    }

    fn factors(&self, term: Expr) -> Vec<(Expr, Rational)> {
        match self.graph.node(term) {
            Node::Product(factors) => factors.to_vec(),
            _ => vec![(term, Rational::one())],
        }
    }

    /// `coefficient * term` as a sign and a value.
    fn signed_term(&mut self, term: Expr, coefficient: &Rational) -> (bool, Slot) {
        match *self.graph.node(term) {
            Node::Whole(inner) if coefficient.is_one() => self.signed(inner),
            _ => (false, self.scaled(term, coefficient)),
        }
    }

    /// `coefficient * term` as a factor that depends on parameters only and a rest, with what the rest depends on.
    fn split_off_fixed(&mut self, term: Expr, coefficient: &Rational) -> (Expr, Expr, Dependence) {
        let factors = self.factors(term);
        let dependence: Vec<Dependence> = factors
            .iter()
            .map(|(base, _)| {
                let slot = self.lower(*base);
                self.builder.dependence(slot)
            })
            .collect();
        let rate = dependence.iter().fold(Dependence::default(), |all, one| all.join(*one));
        let number = self.graph.number(coefficient.clone());
        if !dependence.iter().any(|d| d.is_fixed()) {
            return (number, term, rate);
        }
        let mut fixed = vec![(number, Rational::one())];
        let mut rest = Vec::new();
        for (factor, dependence) in factors.into_iter().zip(dependence) {
            if dependence.is_fixed() { &mut fixed } else { &mut rest }.push(factor);
        }
        (self.graph.product(fixed), self.graph.product(rest), rate)
    }

    /// The sum of signed values; negative only where all of them are.
    fn add(&mut self, mut parts: Vec<(bool, Slot)>) -> (bool, Slot) {
        let all_negative = parts.iter().all(|(negative, _)| *negative);
        let first = parts.iter().position(|(negative, _)| !negative).unwrap_or(0);
        let (_, mut total) = parts.remove(first);
        for (negative, slot) in parts {
            total = if negative && !all_negative {
                self.push(Operation::Sub(total, slot))
            } else {
                self.push(Operation::Add(total, slot))
            };
        }
        (all_negative, total)
    }

    fn with_sign(&mut self, negative: bool, slot: Slot) -> Slot {
        self.builder.with_sign(negative, slot)
    }

    fn scaled(&mut self, term: Expr, coefficient: &Rational) -> Slot {
        match self.graph.node(term).clone() {
            Node::Product(factors) => self.product(&factors, coefficient),
            _ => self.product(&[(term, Rational::one())], coefficient),
        }
    }

    fn product(&mut self, factors: &[(Expr, Rational)], coefficient: &Rational) -> Slot {
        // Value and whether it divides, in order of the rate of change.
        let mut parts: Vec<(Dependence, bool, Slot)> = Vec::new();
        if !coefficient.is_one() {
            let number = self.push(Operation::Number(coefficient.clone()));
            parts.push((Dependence::default(), false, number));
        }
        for (base, exponent) in factors {
            let power = self.power_of(*base, &exponent.abs());
            parts.push((self.builder.dependence(power), exponent.is_negative(), power));
        }
        parts.sort_by_key(|(dependence, divides, _)| (*dependence, *divides));
        let mut total: Option<Slot> = None;
        for group in parts.chunk_by(|a, b| a.0 == b.0) {
            let numerator = self.multiply(group.iter().filter(|p| !p.1).map(|p| p.2).collect());
            let denominator = self.multiply(group.iter().filter(|p| p.1).map(|p| p.2).collect());
            let quotient = match (numerator, denominator) {
                (Some(n), Some(d)) => Some(self.push(Operation::Div(n, d))),
                (n, None) => n,
                (None, Some(d)) => {
                    // Nothing to divide in this group: divide what is there already.
                    let n = total.take();
                    let n = n.unwrap_or_else(|| self.push(Operation::Number(Rational::one())));
                    total = Some(self.push(Operation::Div(n, d)));
                    None
                }
            };
            total = match (total, quotient) {
                (Some(a), Some(b)) => Some(self.push(Operation::Mul(a, b))),
                (a, b) => a.or(b),
            };
        }
        total.unwrap_or_else(|| self.push(Operation::Number(Rational::one())))
    }

    fn multiply(&mut self, values: Vec<Slot>) -> Option<Slot> {
        let mut values = values.into_iter();
        let first = values.next()?;
        Some(values.fold(first, |total, value| self.push(Operation::Mul(total, value))))
    }

    /// `base ^ exponent` for a positive exponent. Where a symbol stands for a square root, as the polar radius does, its
    /// even powers need no root.
    fn power_of(&mut self, base: Expr, exponent: &Rational) -> Slot {
        let meaning = self.definitions.iter().find(|(symbol, _)| *symbol == base).map(|d| d.1);
        if let Some(meaning) = meaning
            && let Node::Product(factors) = self.graph.node(meaning)
            && let [(square, half)] = &**factors
        {
            let (square, exponent) = (*square, half * exponent);
            let square = self.lower(square);
            return self.power(square, &exponent);
        }
        let base = self.lower(base);
        self.power(base, exponent)
    }

    /// `base ^ exponent` for a positive exponent.
    fn power(&mut self, base: Slot, exponent: &Rational) -> Slot {
        if let Some(whole) = exponent.to_i64().and_then(|n| u32::try_from(n).ok()) {
            return self.builder.power(base, whole);
        }
        let whole = exponent.to_integer().to_u32().unwrap_or(0);
        let rest = exponent - Rational::from(i64::from(whole));
        if rest != Rational::new(1.into(), 2.into()) {
            return self.push(Operation::Power(base, exponent.clone()));
        }
        let root = self.push(Operation::Sqrt(base));
        if whole == 0 {
            return root;
        }
        let power = self.builder.power(base, whole);
        self.push(Operation::Mul(power, root))
    }
}
