//! Factors gathered where position and time meet.
//!
//! What is computed for each point at each time is paid for most often, and forms that the algebra of symbols finds still
//! multiply there what could be multiplied before. [`Program::with_gathered_factors`] looks at the operations between the
//! values that are kept of points and the outputs, as products and as sums of two:
//!
//! - A factor that both terms of a sum have is taken out: `a x y + b x` becomes `(a y + b) x`.
//! - A factor of a sum that depends on time or parameters only goes to the factors of this kind that the terms have
//!   already, where each term has one: `t (a x + b y)` becomes `(t a) x + (t b) y`, and `t a` is formed once a time.
//! - Signs become differences, or go to such factors as well.
//!
//! Terms stay in their order and in their sums, so that what is small is still added to what is small. The new form is taken
//! only where it costs less, keeps no more values of a point, and where the bound of its rounding errors, by running
//! error analysis at sample points, is not clearly larger.

use crate::arrange::as_accurate;
use crate::graph::NumberMap;
use crate::keep::KEPT_NUMBER;
use crate::program::{Operation, Program, Slot};
use crate::{Dependence, Rational};
use num_traits::One;
use std::ops::Range;

/// Operations that are nested more deeply than this are left as they are.
const LARGEST_DEPTH: usize = 500;
/// Products of more factors than this are taken in pieces.
const MOST_FACTORS: usize = 16;

impl Program {
    /// The program with the outputs of the given places in forms of the same value that leave less to compute for each point at
    /// each time. All other outputs are computed as before.
    ///
    /// It is meant for outputs that are evaluated at the same points at many times, where
    /// [`kept_at_points`](Program::kept_at_points) tells what is kept of each point.
    #[must_use]
    pub fn with_gathered_factors(&self, places: Range<usize>) -> Program {
        let Some(outputs) = self.outputs().get(places.clone()) else { return self.clone() };
        let Some(gathered) = Gathering::new(self).program(places.clone()) else {
            return self.clone();
        };
        let (before, after) = (self.part(outputs), gathered.part(&gathered.outputs()[places]));
        let ((old_kept, old_cost), (new_kept, new_cost)) = (before.cost_at_points(), after.cost_at_points());
        let input = |operation: &Operation| match operation {
            Operation::Input(index) => index.checked_add(1),
            _ => None,
        };
        let inputs = self.operations().iter().filter_map(input).max().unwrap_or(0);
        if new_kept <= old_kept && new_cost < old_cost && as_accurate(&before, &after, inputs) {
            gathered.compacted()
        } else {
            self.clone()
        }
    }

    /// How many values are kept of a point, and what each time costs with them.
    fn cost_at_points(&self) -> (usize, usize) {
        let kept = self.kept_at_points(self.outputs(), usize::MAX);
        let count = self.operations_with_kept(self.outputs(), &kept).both;
        (kept.len(), count.cost() + KEPT_NUMBER * kept.len())
    }
}

/// A signed product.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Product {
    negative: bool,
    /// What depends on time or on parameters only, in order.
    coefficient: Vec<Slot>,
    /// Nodes by number, in order.
    factors: Vec<usize>,
}

impl Product {
    fn of(node: usize) -> Self {
        Product { factors: vec![node], ..Product::default() }
    }

    fn times(&self, other: &Product) -> Product {
        let mut product = Product {
            negative: self.negative != other.negative,
            coefficient: [self.coefficient.as_slice(), &other.coefficient].concat(),
            factors: [self.factors.as_slice(), &other.factors].concat(),
        };
        product.coefficient.sort_unstable();
        product.factors.sort_unstable();
        product
    }

    /// The factors that both products have, which are taken away from each.
    fn take_common_factors(&mut self, other: &mut Product) -> Vec<usize> {
        let (mut common, mut own) = (Vec::new(), Vec::new());
        for &factor in &self.factors {
            match other.factors.iter().position(|&f| f == factor) {
                Some(place) => common.push(other.factors.remove(place)),
                None => own.push(factor),
            }
        }
        self.factors = own;
        common
    }
}

/// A value that depends on the position.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Node {
    /// A value that is kept.
    Kept(Slot),
    /// A product that several values are computed from.
    Product(Product),
    Sum(Product, Product),
    Quotient(Product, Product),
    /// Any other operation, with what its operands are.
    Operation(Operation, Vec<(Slot, Product)>),
}

struct Gathering<'a> {
    program: &'a Program,
    /// The operations of the program, and after them the new ones.
    operations: Vec<Operation>,
    dependence: Vec<Dependence>,
    interned: NumberMap<Operation, Slot>,
    nodes: Vec<Node>,
    numbers: NumberMap<Node, usize>,
    /// How many products each node is a factor of, as often as it is one.
    uses: Vec<usize>,
    /// For each node whether it takes a coefficient at no cost, where that is known.
    absorbs: Vec<Option<bool>>,
    /// For each node where its value is, and whether it is the negative, where it has been computed.
    computed: Vec<Option<(bool, Slot)>>,
}

impl<'a> Gathering<'a> {
    fn new(program: &'a Program) -> Self {
        let mut interned = NumberMap::default();
        for slot in program.slots() {
            interned.entry(program.operations()[slot.index()].clone()).or_insert(slot);
        }
        Gathering {
            program,
            operations: program.operations().to_vec(),
            dependence: program.slots().map(|slot| program.dependence(slot)).collect(),
            interned,
            nodes: Vec::new(),
            numbers: NumberMap::default(),
            uses: Vec::new(),
            absorbs: Vec::new(),
            computed: Vec::new(),
        }
    }

    /// The program with other operations for the outputs of the given places.
    fn program(mut self, places: Range<usize>) -> Option<Program> {
        let mut all = self.program.outputs().to_vec();
        let outputs = all.get_mut(places)?;
        let mut products = self.products(outputs)?;
        for (product, slot) in products.iter_mut().zip(&*outputs) {
            if self.dependence[slot.index()].position {
                self.turn(product);
            }
        }
        self.count_uses(&products);
        for (product, slot) in products.iter().zip(outputs) {
            if self.dependence[slot.index()].position {
                let (negative, value) = self.product(product, &[]);
                *slot = self.with_sign(negative, value);
            }
        }
        Some(Program::from_parts(self.operations, self.dependence, all))
    }

    /// What `outputs` are as products of nodes; `None` where they are nested too deeply.
    fn products(&mut self, outputs: &[Slot]) -> Option<Vec<Product>> {
        let program = self.program;
        let kept = program.kept_at_points(outputs, usize::MAX);
        let mut uses = vec![0_usize; program.operations().len()];
        let mut stack: Vec<Slot> = outputs.to_vec();
        while let Some(slot) = stack.pop() {
            uses[slot.index()] += 1;
            if uses[slot.index()] == 1 && program.dependence(slot).position && !kept.contains(&slot) {
                stack.extend(program.operations()[slot.index()].operands());
            }
        }
        let mut depths = vec![0_usize; program.operations().len()];
        let mut products: Vec<Option<Product>> = vec![None; program.operations().len()];
        let here = |slot: &Slot| uses[slot.index()] > 0 && program.dependence(*slot).position;
        for slot in program.slots().filter(here) {
            let operation = &program.operations()[slot.index()];
            let product = if kept.contains(&slot) {
                self.node(Node::Kept(slot))
            } else {
                let depth = operation.operands().map(|operand| depths[operand.index()]).max();
                let depth = depth.unwrap_or(0) + 1;
                if depth > LARGEST_DEPTH {
                    return None;
                }
                depths[slot.index()] = depth;
                let operands: Vec<(Slot, Product)> = operation
                    .operands()
                    .map(|operand| {
                        let known = products[operand.index()].clone();
                        (operand, known.unwrap_or_else(|| self.coefficient(operand)))
                    })
                    .collect();
                let value = self.value(operation, operands);
                let size = value.coefficient.len() + value.factors.len();
                let is_shared = uses[slot.index()] > 1 && value.factors.len() > 1;
                if size > MOST_FACTORS {
                    self.node(Node::Product(value))
                } else if is_shared {
                    let Product { negative, coefficient, factors } = value;
                    let shared = Product { factors, ..Product::default() };
                    let shared = self.node(Node::Product(shared));
                    Product { negative, coefficient, ..shared }
                } else {
                    value
                }
            };
            products[slot.index()] = Some(product);
        }
        let product = |slot: &Slot| products[slot.index()].clone().unwrap_or_default();
        Some(outputs.iter().map(product).collect())
    }

    /// A value that does not depend on the position.
    fn coefficient(&self, slot: Slot) -> Product {
        let mut product = Product::default();
        let mut stack = vec![slot];
        while let Some(factor) = stack.pop() {
            match self.operations[factor.index()] {
                Operation::Mul(a, b) if self.dependence[factor.index()].time => stack.extend([a, b]),
                Operation::Neg(a) => {
                    product.negative = !product.negative;
                    stack.push(a);
                }
                Operation::Number(ref one) if one.is_one() => {}
                _ => product.coefficient.push(factor),
            }
            if product.coefficient.len() + stack.len() > MOST_FACTORS {
                return Product { coefficient: vec![slot], ..Product::default() };
            }
        }
        product.coefficient.sort_unstable();
        product
    }

    fn node(&mut self, node: Node) -> Product {
        if let Some(&number) = self.numbers.get(&node) {
            return Product::of(number);
        }
        let number = self.nodes.len();
        self.nodes.push(node.clone());
        self.numbers.insert(node, number);
        Product::of(number)
    }

    fn value(&mut self, operation: &Operation, mut operands: Vec<(Slot, Product)>) -> Product {
        match (operation, operands.as_mut_slice()) {
            (Operation::Neg(_), [(_, a)]) => Product { negative: !a.negative, ..std::mem::take(a) },
            (Operation::Mul(..), [(_, a), (_, b)]) => a.times(b),
            (Operation::Add(..), [(_, a), (_, b)]) => self.sum(std::mem::take(a), std::mem::take(b)),
            (Operation::Sub(..), [(_, a), (_, b)]) => {
                b.negative = !b.negative;
                self.sum(std::mem::take(a), std::mem::take(b))
            }
            (Operation::Div(..), [(_, a), (_, b)]) if !b.factors.is_empty() && !a.factors.is_empty() => {
                let outside = Product {
                    negative: a.negative != b.negative,
                    coefficient: std::mem::take(&mut a.coefficient),
                    factors: Vec::new(),
                };
                (a.negative, b.negative) = (false, false);
                let quotient = Node::Quotient(std::mem::take(a), std::mem::take(b));
                outside.times(&self.node(quotient))
            }
            _ => self.node(Node::Operation(operation.clone(), operands)),
        }
    }

    fn sum(&mut self, mut a: Product, mut b: Product) -> Product {
        let common = a.take_common_factors(&mut b);
        let common = Product { factors: common, ..Product::default() };
        let sum = if a.factors.is_empty() && b.factors.is_empty() {
            // Both terms have the same factors.
            let (a, b) = (self.product(&a, &[]), self.product(&b, &[]));
            let (negative, sum) = self.add(a, b);
            let sum = self.coefficient(sum);
            Product { negative: negative != sum.negative, ..sum }
        } else {
            self.node(Node::Sum(a, b))
        };
        common.times(&sum)
    }

    /// Makes a negative product a positive one, where that costs nothing.
    fn turn(&mut self, product: &mut Product) {
        if product.negative && !product.coefficient.is_empty() {
            let one = self.push(Operation::Number(Rational::one()));
            product.negative = false;
            product.coefficient.push(self.push(Operation::Neg(one)));
        }
    }

    fn count_uses(&mut self, outputs: &[Product]) {
        self.uses = vec![0; self.nodes.len()];
        self.absorbs = vec![None; self.nodes.len()];
        self.computed = vec![None; self.nodes.len()];
        let mut stack: Vec<usize> = outputs.iter().flat_map(|p| p.factors.clone()).collect();
        while let Some(number) = stack.pop() {
            self.uses[number] += 1;
            if self.uses[number] > 1 {
                continue;
            }
            match &self.nodes[number] {
                Node::Kept(_) => {}
                Node::Product(a) => stack.extend(&a.factors),
                Node::Sum(a, b) | Node::Quotient(a, b) => {
                    stack.extend(a.factors.iter().chain(&b.factors));
                }
                Node::Operation(_, operands) => {
                    stack.extend(operands.iter().flat_map(|(_, a)| &a.factors));
                }
            }
        }
    }

    /// Whether a coefficient of the product costs nothing where position and time meet.
    fn absorbs(&mut self, product: &Product) -> bool {
        !product.coefficient.is_empty() || product.factors.is_empty() || self.absorbing(product).is_some()
    }

    /// The first factor of the product that takes a coefficient at no cost.
    fn absorbing(&mut self, product: &Product) -> Option<usize> {
        product.factors.iter().copied().find(|&factor| self.node_absorbs(factor))
    }

    fn node_absorbs(&mut self, number: usize) -> bool {
        if self.uses[number] != 1 {
            return false;
        }
        if let Some(known) = self.absorbs[number] {
            return known;
        }
        let absorbs = match self.nodes[number].clone() {
            Node::Sum(a, b) => self.absorbs(&a) && self.absorbs(&b),
            Node::Product(a) | Node::Quotient(a, _) => self.absorbs(&a),
            Node::Kept(_) | Node::Operation(..) => false,
        };
        self.absorbs[number] = Some(absorbs);
        absorbs
    }

    /// The operations of a product and of a coefficient beside its own: where the value is, and whether it is the negative.
    fn product(&mut self, product: &Product, coefficient: &[Slot]) -> (bool, Slot) {
        let coefficient = Product { coefficient: coefficient.to_vec(), ..Product::default() };
        let Product { mut negative, coefficient, factors } = product.times(&coefficient);
        let absorbing = if coefficient.is_empty() { None } else { self.absorbing(product) };
        let mut values = Vec::new();
        for equal in factors.chunk_by(|a, b| a == b) {
            let inside = if Some(equal[0]) == absorbing { coefficient.as_slice() } else { &[] };
            let (turned, value) = self.node_value(equal[0], inside);
            negative ^= turned && equal.len() % 2 == 1;
            values.push(self.power(value, equal.len()));
        }
        // What depends on the position only is multiplied first.
        values.sort_by_key(|slot| self.dependence[slot.index()].time);
        if absorbing.is_none() && !coefficient.is_empty() {
            let coefficient = self.coefficient_value(&coefficient);
            let at_hand = values.iter().position(|&value| self.known_product(coefficient, value).is_some());
            if !values.is_empty() {
                let first = values.remove(at_hand.unwrap_or(0));
                values.insert(0, first);
            }
            values.insert(0, coefficient);
        }
        let mut values = values.into_iter();
        let first = values.next().unwrap_or_else(|| self.push(Operation::Number(Rational::one())));
        (negative, values.fold(first, |total, value| self.times(total, value)))
    }

    fn node_value(&mut self, number: usize, coefficient: &[Slot]) -> (bool, Slot) {
        if let Some(known) = self.computed.get(number).copied().flatten() {
            return known;
        }
        let value = match self.nodes[number].clone() {
            Node::Kept(slot) => (false, slot),
            Node::Product(a) => self.product(&a, coefficient),
            Node::Sum(a, b) => {
                let (a, b) = (self.product(&a, coefficient), self.product(&b, coefficient));
                self.add(a, b)
            }
            Node::Quotient(a, b) => {
                let (a, b) = (self.product(&a, coefficient), self.product(&b, &[]));
                (a.0 != b.0, self.push(Operation::Div(a.1, b.1)))
            }
            Node::Operation(operation, operands) => {
                let places: Vec<(Slot, Slot)> = operands
                    .iter()
                    .map(|(slot, operand)| {
                        let (negative, value) = self.product(operand, &[]);
                        (*slot, self.with_sign(negative, value))
                    })
                    .collect();
                let place = |slot| places.iter().find(|(old, _)| *old == slot).map_or(slot, |(_, new)| *new);
                (false, self.push(operation.with_operands(place)))
            }
        };
        if let Some(computed) = self.computed.get_mut(number) {
            *computed = Some(value);
        }
        value
    }

    /// First the factors that depend on parameters only.
    fn coefficient_value(&mut self, factors: &[Slot]) -> Slot {
        let one = self.push(Operation::Number(Rational::one()));
        let minus_one = self.interned.get(&Operation::Neg(one)).copied();
        let (signs, factors): (Vec<Slot>, Vec<Slot>) =
            factors.iter().copied().partition(|&factor| Some(factor) == minus_one);
        let (fixed, of_time): (Vec<Slot>, Vec<Slot>) =
            factors.into_iter().partition(|factor| self.dependence[factor.index()].is_fixed());
        let mut product = |factors: Vec<Slot>| factors.into_iter().reduce(|a, b| self.times(a, b));
        let (fixed, of_time) = (product(fixed), product(of_time));
        let value = match (fixed, of_time) {
            (Some(a), Some(b)) => self.times(a, b),
            (a, b) => a.or(b).unwrap_or(one),
        };
        self.with_sign(signs.len() % 2 == 1, value)
    }

    fn power(&mut self, base: Slot, exponent: usize) -> Slot {
        if exponent <= 1 {
            return base;
        }
        let half = self.power(base, exponent / 2);
        let square = self.times(half, half);
        if exponent.is_multiple_of(2) { square } else { self.times(square, base) }
    }

    fn known_product(&self, a: Slot, b: Slot) -> Option<Slot> {
        let known = |operation| self.interned.get(&operation).copied();
        known(Operation::Mul(a, b)).or_else(|| known(Operation::Mul(b, a)))
    }

    fn times(&mut self, a: Slot, b: Slot) -> Slot {
        self.known_product(a, b).unwrap_or_else(|| self.push(Operation::Mul(a, b)))
    }

    /// The sum of signed values; negative only where both are.
    fn add(&mut self, a: (bool, Slot), b: (bool, Slot)) -> (bool, Slot) {
        match (a, b) {
            ((false, a), (true, b)) | ((true, b), (false, a)) => (false, self.push(Operation::Sub(a, b))),
            ((negative, a), (_, b)) => {
                let known = self.interned.get(&Operation::Add(b, a)).copied();
                (negative, known.unwrap_or_else(|| self.push(Operation::Add(a, b))))
            }
        }
    }

    fn with_sign(&mut self, negative: bool, slot: Slot) -> Slot {
        if negative { self.push(Operation::Neg(slot)) } else { slot }
    }

    fn push(&mut self, operation: Operation) -> Slot {
        if let Some(&slot) = self.interned.get(&operation) {
            return slot;
        }
        let dependence = operation
            .operands()
            .map(|slot| self.dependence[slot.index()])
            .fold(Dependence::default(), Dependence::join);
        let slot = Slot::at(self.operations.len());
        self.operations.push(operation.clone());
        self.dependence.push(dependence);
        self.interned.insert(operation, slot);
        slot
    }
}
