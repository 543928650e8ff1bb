//! Factors gathered where position and time meet.
//!
//! Operations for each point at each time are the most frequent ones, and forms that the algebra of symbols finds still multiply there
//! values that could be multiplied before. [`Program::with_gathered_factors`] looks at the operations between the values that are kept of
//! points and the outputs, as products and as sums of two:
//!
//! - A factor that both terms of a sum have is taken out: `a x y + b x` becomes `(a y + b) x`.
//! - A factor of a sum that depends on time or parameters only goes to the factors of this kind that the terms have
//!   already, where each term has one: `t (a x + b y)` becomes `(t a) x + (t b) y`, and `t a` is formed once a time.
//! - Signs become differences, or go to such factors as well.
//!
//! Terms stay in their order and in their sums, so that what is small is still added to what is small. The new form is taken
//! only where it costs less, keeps no more values of a point, and where the bound of its rounding errors, by running
//! error analysis at sample points, is not clearly larger.

use crate::graph::NumberMap;
use crate::program::keep::KEPT_NUMBER;
use crate::program::{Builder, Operation, OperationCount, Program, Slot, power};
use crate::rewrite::accuracy::Samples;
use crate::{Rational, Rule};
use num_traits::One;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Cost, in additions, of a number that is the same at all points: vector registers are filled with it for every few points.
const UNIFORM_NUMBER: usize = 1;
/// Operations that are nested more deeply than this are left as they are.
const LARGEST_DEPTH: usize = 200;
/// Products of more factors than this are taken in pieces.
const MOST_FACTORS: usize = 16;
/// Like terms are looked for among this many.
const MOST_TERMS: usize = 48;

impl Program {
    /// The program with the outputs of the given places in forms of the same value that leave less to compute for each point at
    /// each time. All other outputs are computed as before.
    ///
    /// It is meant for outputs that are evaluated at the same points at many times, where
    /// [`kept_at_points`](Program::kept_at_points) tells what is kept of each point.
    #[must_use]
    pub fn with_gathered_factors(&self, places: Range<usize>) -> Program {
        if Rule::Gather.is_off() {
            return self.clone();
        }
        let Some(outputs) = self.outputs().get(places.clone()) else { return self.clone() };
        let kept = self.kept_at_points(outputs, usize::MAX);
        let Some(gathered) = Gathering::new(self).program(places.clone(), &kept) else {
            return self.clone();
        };
        let gathered_outputs = &gathered.outputs()[places];
        let gathered_kept = gathered.kept_at_points(gathered_outputs, usize::MAX);
        let costs_less = gathered_kept.len() <= kept.len()
            && gathered.cost_at_points(gathered_outputs, &gathered_kept)
                < self.cost_at_points(outputs, &kept);
        let (before, after) = (self.part(outputs), gathered.part(gathered_outputs));
        if costs_less && Samples::of(&before, self.input_count()).admit(&before, &after) {
            gathered.compacted()
        } else {
            self.clone()
        }
    }

    /// Cost of `outputs` for each point at each time, where the values of `kept` are kept of each point.
    pub(crate) fn cost_at_points(&self, outputs: &[Slot], kept: &[Slot]) -> usize {
        let mut seen = vec![false; self.operations().len()];
        let mut stack = outputs.to_vec();
        let mut cost = KEPT_NUMBER * kept.len();
        while let Some(slot) = stack.pop() {
            if std::mem::replace(&mut seen[slot.index()], true) || kept.contains(&slot) {
                continue;
            }
            if self.dependence(slot).position {
                let operation = &self.operations()[slot.index()];
                cost += OperationCount::of(operation).cost();
                stack.extend(operation.operands());
            } else {
                cost += UNIFORM_NUMBER;
            }
        }
        cost
    }
}

/// A signed product.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Product {
    negative: bool,
    /// Factors that depend on time or on parameters only, in order.
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

    /// Each two different factors, once.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let different: BTreeSet<usize> = self.factors.iter().copied().collect();
        let later = different.clone();
        different
            .into_iter()
            .flat_map(move |a| later.range(a + 1..).map(|&b| (a, b)).collect::<Vec<_>>())
    }

    /// Has the product of two of its factors instead of them, as often as they occur.
    fn join(&mut self, a: usize, b: usize, product: usize) {
        let place = |factors: &[usize], factor| factors.iter().position(|&f| f == factor);
        while let (Some(first), Some(second)) = (place(&self.factors, a), place(&self.factors, b)) {
            self.factors.remove(first.max(second));
            self.factors.remove(first.min(second));
            self.factors.push(product);
        }
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

/// The terms of a sum, those of equal factors together.
struct LikeTerms(Vec<Vec<Product>>);

impl LikeTerms {
    fn of(terms: Vec<Product>) -> Self {
        let mut groups: Vec<Vec<Product>> = Vec::new();
        for term in terms {
            match groups.iter_mut().find(|group| group[0].factors == term.factors) {
                Some(group) => group.push(term),
                None => groups.push(vec![term]),
            }
        }
        LikeTerms(groups)
    }

    /// Whether there are like terms.
    fn any(&self) -> bool {
        self.0.iter().any(|group| group.len() > 1)
    }

    /// The products and sums that remain where like terms are one.
    fn cost(&self) -> usize {
        let products = self.0.iter().map(|group| {
            let coefficient = group.len() > 1 || !group[0].coefficient.is_empty();
            (usize::from(coefficient) + group[0].factors.len()).saturating_sub(1)
        });
        products.sum::<usize>() + self.0.len()
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

impl Node {
    /// The products that it is computed from.
    fn products(&mut self) -> Vec<&mut Product> {
        match self {
            Node::Kept(_) => Vec::new(),
            Node::Product(a) => vec![a],
            Node::Sum(a, b) | Node::Quotient(a, b) => vec![a, b],
            Node::Operation(_, operands) => operands.iter_mut().map(|(_, a)| a).collect(),
        }
    }
}

struct Gathering<'a> {
    program: &'a Program,
    /// The operations of the program, and after them the new ones.
    builder: Builder,
    nodes: Vec<Node>,
    /// For each node whether more than one operation of the program uses it.
    shared: Vec<bool>,
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
        Gathering {
            program,
            builder: Builder::of(program),
            nodes: Vec::new(),
            shared: Vec::new(),
            numbers: NumberMap::default(),
            uses: Vec::new(),
            absorbs: Vec::new(),
            computed: Vec::new(),
        }
    }

    /// The program with other operations for the outputs of the given places.
    fn program(mut self, places: Range<usize>, kept: &[Slot]) -> Option<Program> {
        let mut all = self.program.outputs().to_vec();
        let outputs = all.get_mut(places)?;
        let mut products = self.products(outputs, kept)?;
        self.share_pairs(&mut products);
        self.count_uses(&products);
        for (product, slot) in products.iter_mut().zip(outputs) {
            if self.builder.dependence(*slot).position {
                self.turn(product);
                let (negative, value) = self.product(product, &[]);
                *slot = self.with_sign(negative, value);
            }
        }
        Some(self.builder.program(all))
    }

    /// `outputs` as products of nodes; `None` where they are nested too deeply.
    fn products(&mut self, outputs: &[Slot], kept: &[Slot]) -> Option<Vec<Product>> {
        let program = self.program;
        let mut uses = vec![0_usize; program.operations().len()];
        let mut stack: Vec<Slot> = outputs.to_vec();
        while let Some(slot) = stack.pop() {
            uses[slot.index()] += 1;
            if uses[slot.index()] == 1 && program.dependence(slot).position && !kept.contains(&slot)
            {
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
                let is_shared = uses[slot.index()] > 1;
                if is_shared { self.shared(value) } else { self.bounded(value) }
            };
            products[slot.index()] = Some(product);
        }
        let product = |slot: &Slot| products[slot.index()].clone().unwrap_or_default();
        Some(outputs.iter().map(product).collect())
    }

    /// A product of many factors in one piece.
    fn bounded(&mut self, value: Product) -> Product {
        if value.coefficient.len() + value.factors.len() <= MOST_FACTORS {
            return value;
        }
        self.node(Node::Product(value))
    }

    /// A value that several others are computed from, in one piece.
    fn shared(&mut self, value: Product) -> Product {
        let value = self.bounded(value);
        for &factor in &value.factors {
            self.shared[factor] = true;
        }
        if value.coefficient.is_empty() && value.factors.len() == 1 {
            return value;
        }
        let inside = Product { negative: false, ..value.clone() };
        Product { negative: value.negative, ..self.node(Node::Product(inside)) }
    }

    /// A value that does not depend on the position.
    fn coefficient(&self, slot: Slot) -> Product {
        let mut product = Product::default();
        let mut stack = vec![slot];
        while let Some(factor) = stack.pop() {
            match *self.builder.operation(factor) {
                Operation::Mul(a, b) if self.builder.dependence(factor).time => {
                    stack.extend([a, b]);
                }
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
        self.shared.push(false);
        self.numbers.insert(node, number);
        Product::of(number)
    }

    fn value(&mut self, operation: &Operation, mut operands: Vec<(Slot, Product)>) -> Product {
        match (operation, operands.as_mut_slice()) {
            (Operation::Neg(_), [(_, a)]) => Product { negative: !a.negative, ..std::mem::take(a) },
            (Operation::Mul(..), [(_, a), (_, b)]) => a.times(b),
            (Operation::Add(..), [(_, a), (_, b)]) => {
                self.sum(std::mem::take(a), std::mem::take(b))
            }
            (Operation::Sub(..), [(_, a), (_, b)]) => {
                b.negative = !b.negative;
                self.sum(std::mem::take(a), std::mem::take(b))
            }
            (Operation::Div(..), [(_, a), (_, b)])
                if !b.factors.is_empty() && !a.factors.is_empty() =>
            {
                // Outside, a coefficient of the numerator may join others.
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

    fn sum(&mut self, a: Product, b: Product) -> Product {
        let terms = |of_shared: bool, gathering: &Self| {
            let mut terms = Vec::new();
            for term in [&a, &b] {
                gathering.terms(term, of_shared, &mut terms);
            }
            terms
        };
        let own = LikeTerms::of(terms(false, self));
        let all = LikeTerms::of(terms(true, self));
        let alike = if all.cost() <= own.cost() { all } else { own };
        if !alike.any() {
            return self.sum_of_two(a, b);
        }
        let sums: Vec<Product> =
            alike.0.into_iter().map(|terms| self.sum_of_alike(terms)).collect();
        sums.into_iter().reduce(|a, b| self.sum_of_two(a, b)).unwrap_or_default()
    }

    /// The terms of a sum within a sum. Of a sum that other values are computed from too, only where its terms are values
    /// that are kept, or coefficients.
    fn terms(&self, term: &Product, of_shared: bool, terms: &mut Vec<Product>) {
        if let [factor] = term.factors[..]
            && let Node::Sum(a, b) = &self.nodes[factor]
            && terms.len() < MOST_TERMS
            && (!self.shared[factor] || of_shared && self.is_linear(a) && self.is_linear(b))
        {
            let outside = Product { factors: Vec::new(), ..term.clone() };
            if outside.coefficient.len() + a.coefficient.len().max(b.coefficient.len())
                <= MOST_FACTORS
            {
                self.terms(&outside.times(a), of_shared, terms);
                self.terms(&outside.times(b), of_shared, terms);
                return;
            }
        }
        terms.push(term.clone());
    }

    /// Whether the product is a kept value or a sum of such, but for coefficients.
    fn is_linear(&self, product: &Product) -> bool {
        match product.factors[..] {
            [] => true,
            [factor] => match &self.nodes[factor] {
                Node::Kept(_) => true,
                Node::Sum(a, b) => self.is_linear(a) && self.is_linear(b),
                _ => false,
            },
            _ => false,
        }
    }

    /// The sum of products with the same factors.
    fn sum_of_alike(&mut self, terms: Vec<Product>) -> Product {
        let total = terms.into_iter().reduce(|a, b| self.sum_of_two(a, b));
        total.unwrap_or_default()
    }

    fn sum_of_two(&mut self, mut a: Product, mut b: Product) -> Product {
        let common = a.take_common_factors(&mut b);
        let negative = a.negative && b.negative;
        (a.negative, b.negative) = (a.negative != negative, b.negative != negative);
        let common = Product { negative, factors: common, ..Product::default() };
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

    /// Two factors that several products have become one.
    fn share_pairs(&mut self, outputs: &mut [Product]) {
        self.count_uses(outputs);
        let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let (uses, nodes) = (&self.uses, &mut self.nodes);
        let reached = nodes.iter_mut().enumerate().filter(|(number, _)| uses[*number] > 0);
        let mut products: Vec<&mut Product> =
            reached.flat_map(|(_, node)| node.products()).chain(outputs).collect();
        for product in &products {
            for pair in product.pairs() {
                *counts.entry(pair).or_insert(0) += 1;
            }
        }
        let mut pairs: Vec<_> = counts.into_iter().filter(|(_, count)| *count > 1).collect();
        // The most frequent first; stable, so that the choice is definite.
        pairs.sort_by_key(|(_, count)| Reverse(*count));
        let mut made = Vec::new();
        for ((a, b), _) in pairs {
            let both =
                |product: &Product| product.factors.contains(&a) && product.factors.contains(&b);
            // Other pairs may have taken them.
            if products.iter().filter(|product| both(product)).count() > 1 {
                let number = uses.len() + made.len();
                made.push(Node::Product(Product { factors: vec![a, b], ..Product::default() }));
                products.iter_mut().for_each(|product| product.join(a, b, number));
            }
        }
        self.nodes.extend(made);
    }

    /// Makes a negative product a positive one, where that costs nothing.
    fn turn(&mut self, product: &mut Product) {
        if product.negative && self.absorbs(product) {
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
        !product.coefficient.is_empty()
            || product.factors.is_empty()
            || self.absorbing(product).is_some()
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
            values.push(power(value, equal.len() as u32, &mut |a, b| self.times(a, b)));
        }
        // What depends on the position only is multiplied first.
        values.sort_by_key(|&slot| self.builder.dependence(slot).time);
        if absorbing.is_none() && !coefficient.is_empty() {
            let coefficient = self.coefficient_value(&coefficient);
            let at_hand =
                values.iter().position(|&value| self.known_product(coefficient, value).is_some());
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
                let place = |slot| {
                    places.iter().find(|(old, _)| *old == slot).map_or(slot, |(_, new)| *new)
                };
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
        let minus_one = self.builder.find(&Operation::Neg(one));
        let (signs, factors): (Vec<Slot>, Vec<Slot>) =
            factors.iter().copied().partition(|&factor| Some(factor) == minus_one);
        let (fixed, of_time): (Vec<Slot>, Vec<Slot>) =
            factors.into_iter().partition(|&factor| self.builder.dependence(factor).is_fixed());
        let mut product = |factors: Vec<Slot>| factors.into_iter().reduce(|a, b| self.times(a, b));
        let (fixed, of_time) = (product(fixed), product(of_time));
        let value = match (fixed, of_time) {
            (Some(a), Some(b)) => self.times(a, b),
            (a, b) => a.or(b).unwrap_or(one),
        };
        self.with_sign(signs.len() % 2 == 1, value)
    }

    fn known_product(&self, a: Slot, b: Slot) -> Option<Slot> {
        let known = |operation| self.builder.find(&operation);
        known(Operation::Mul(a, b)).or_else(|| known(Operation::Mul(b, a)))
    }

    fn times(&mut self, a: Slot, b: Slot) -> Slot {
        self.known_product(a, b).unwrap_or_else(|| self.push(Operation::Mul(a, b)))
    }

    /// The sum of signed values; negative only where both are.
    fn add(&mut self, a: (bool, Slot), b: (bool, Slot)) -> (bool, Slot) {
        match (a, b) {
            ((false, a), (true, b)) | ((true, b), (false, a)) => {
                (false, self.push(Operation::Sub(a, b)))
            }
            ((negative, a), (_, b)) => {
                let known = self.builder.find(&Operation::Add(b, a));
                (negative, known.unwrap_or_else(|| self.push(Operation::Add(a, b))))
            }
        }
    }

    fn with_sign(&mut self, negative: bool, slot: Slot) -> Slot {
        if negative { self.push(Operation::Neg(slot)) } else { slot }
    }

    fn push(&mut self, operation: Operation) -> Slot {
        self.builder.push(operation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dependence;
    use crate::program::SIDE;
    use crate::{Ast, AstKind, Function};
    use proptest::prelude::*;
    use std::array;

    const NAMES: [&str; 5] = ["x", "y", "t", "a", "b"];

    /// A program of the operations as they are written, without any algebra. `x` and `y` are of the position, `t` is the
    /// time, all else parameters.
    #[derive(Default)]
    struct Written {
        operations: Vec<Operation>,
        dependence: Vec<Dependence>,
    }

    impl Written {
        fn push(&mut self, operation: Operation) -> Slot {
            if let Some(index) = self.operations.iter().position(|known| *known == operation) {
                return Slot::at(index);
            }
            self.dependence.push(match operation {
                Operation::Input(0 | 1) => Dependence { position: true, time: false },
                Operation::Input(2) => Dependence { position: false, time: true },
                _ => {
                    let operands = operation.operands().map(|slot| self.dependence[slot.index()]);
                    operands.fold(Dependence::default(), Dependence::join)
                }
            });
            self.operations.push(operation);
            Slot::at(self.operations.len() - 1)
        }

        fn text(&mut self, text: &str) -> Slot {
            self.ast(&Ast::parse(text).unwrap())
        }

        fn ast(&mut self, ast: &Ast) -> Slot {
            match &ast.kind {
                AstKind::Number(value) => self.push(Operation::Number(value.clone())),
                AstKind::Name(name) => {
                    let input = NAMES.iter().position(|known| known == name).unwrap();
                    self.push(Operation::Input(input))
                }
                AstKind::Sum(terms) => {
                    let mut total = None;
                    for (negative, term) in terms {
                        let term = self.ast(term);
                        total = Some(match (total, negative) {
                            (None, false) => term,
                            (None, true) => self.push(Operation::Neg(term)),
                            (Some(total), false) => self.push(Operation::Add(total, term)),
                            (Some(total), true) => self.push(Operation::Sub(total, term)),
                        });
                    }
                    total.unwrap()
                }
                AstKind::Product(factors) => {
                    let mut total = None;
                    for (divides, factor) in factors {
                        let factor = self.ast(factor);
                        total = Some(match (total, divides) {
                            (None, _) => factor,
                            (Some(total), false) => self.push(Operation::Mul(total, factor)),
                            (Some(total), true) => self.push(Operation::Div(total, factor)),
                        });
                    }
                    total.unwrap()
                }
                AstKind::Call(_, arguments) => {
                    let argument = self.ast(&arguments[0]);
                    self.push(Operation::Call(Function::Sin, argument))
                }
                AstKind::Power(..) => panic!("written as a product"),
            }
        }

        fn program(self, outputs: Vec<Slot>) -> Program {
            Program::from_parts(self.operations, self.dependence, outputs).compacted()
        }
    }

    fn program(texts: &[&str]) -> Program {
        let mut written = Written::default();
        let outputs = texts.iter().map(|text| written.text(text)).collect();
        written.program(outputs)
    }

    /// Additions, multiplications and divisions for each point at each time.
    fn each_time(program: &Program) -> [usize; 3] {
        let kept = program.kept_at_points(program.outputs(), usize::MAX);
        let count = program.operations_with_kept(program.outputs(), &kept).both;
        [count.additions, count.multiplications, count.divisions]
    }

    #[test]
    fn what_is_left_where_position_and_time_meet() {
        for (texts, before, after) in [
            // A factor of both terms.
            (&["t*x*y + a*x"][..], [1, 3, 0], [1, 2, 0]),
            (&["t*(t*x*y + b*x)"], [1, 4, 0], [1, 2, 0]),
            (&["x*t*sin(t*x) - a*x*sin(t*x)*y"], [1, 6, 0], [1, 3, 0]),
            // Coefficients go to those that are there, and stay where there are none.
            (&["t*(t*x + b*t*y)"], [1, 3, 0], [1, 2, 0]),
            (&["t*(t*x + 1)"], [1, 2, 0], [1, 1, 0]),
            (&["t*(t*(t*x + b)*x + b)"], [2, 4, 0], [2, 2, 0]),
            (&["t*(t*sin(t*x)/(y + t))"], [1, 3, 1], [1, 3, 1]),
            (&["t*(b*sin(t*y) + y)"], [1, 3, 0], [1, 3, 0]),
            // Like terms, also those of sums that are used more than once.
            (&["t*x - a*x"], [1, 2, 0], [0, 1, 0]),
            (&["t*x + t*b*y + b*x"], [2, 3, 0], [1, 2, 0]),
            (&["t*(t*x - a*y) + b*(a*x + t*y)"], [3, 6, 0], [1, 2, 0]),
            (
                &["t*(t*x - a*y) + b*(a*x + t*y)", "b*(t*x - a*y) - t*(a*x + t*y)"],
                [4, 8, 0],
                [2, 4, 0],
            ),
            // Signs.
            (&["-(t*x) - a*t*y"], [2, 2, 0], [1, 2, 0]),
            (&["-(t*(t*x + b*t*y))"], [2, 3, 0], [1, 2, 0]),
            // Products of two factors that several products have.
            (&["sin(t*x)*x*sin(t*y)", "sin(t*x)*y*sin(t*y)"], [0, 6, 0], [0, 5, 0]),
        ] {
            let program = program(texts);
            let gathered = program.with_gathered_factors(0..texts.len());
            assert_eq!(each_time(&program), before, "{texts:?}");
            assert_eq!(each_time(&gathered), after, "{texts:?}: {:?}", gathered.operations());
            let at = [0.75, -1.5, 0.625, 3.0, 0.3];
            for (old, new) in program.evaluate(&at).iter().zip(gathered.evaluate(&at)) {
                assert!((old - new).abs() <= 1e-14 * old.abs(), "{texts:?}: {new}, not {old}");
            }
        }
    }

    /// Where nothing is to be gained the program stays, as it does for outputs that are not asked for.
    #[test]
    fn other_outputs_stay() {
        let texts = ["t*(a*x*y + b*x)", "a*(t*x*y + b*x)"];
        let program = program(&texts);
        for places in [0..0, 2..2, 0..3, 4..5] {
            let same = program.with_gathered_factors(places);
            assert_eq!(
                (same.operations(), same.outputs()),
                (program.operations(), program.outputs())
            );
        }
        let second = program.with_gathered_factors(1..2);
        let alone =
            |program: &Program, place: usize| program.part(&program.outputs()[place..=place]);
        assert_eq!(alone(&second, 0).operations(), alone(&program, 0).operations());
        assert_eq!(each_time(&alone(&second, 1)), [1, 2, 0]);
        let gathered = second.with_gathered_factors(1..2);
        assert_eq!(gathered.operations(), second.operations());
    }

    /// Expressions that are nested too deeply, or are products of many factors, keep their values.
    #[test]
    fn large_expressions() {
        let at = [0.75, -1.5, 0.625, 3.0, 0.3];
        for depth in [10, LARGEST_DEPTH - 3, LARGEST_DEPTH, 3 * LARGEST_DEPTH] {
            let mut written = Written::default();
            let [x, t, a] = ["x", "t", "a"].map(|name| written.text(name));
            let mut value = written.text("sin(t*x)");
            for n in 0..depth {
                let product = written.push(Operation::Mul(if n % 2 == 0 { x } else { t }, value));
                value = if n % 3 == 0 { product } else { written.push(Operation::Add(product, a)) };
            }
            let program = written.program(vec![value]);
            let gathered = program.with_gathered_factors(0..1);
            let (old, new) = (program.evaluate(&at)[0], gathered.evaluate(&at)[0]);
            assert!((old - new).abs() <= 1e-12 * old.abs(), "{depth}: {new}, not {old}");
            assert_eq!(each_time(&gathered) != each_time(&program), depth < 100, "{depth}");
        }
        // The square of the square and so on, of which each has twice as many factors as the one before.
        let mut written = Written::default();
        let mut value = written.text("t*a*x*sin(t*y)");
        for _ in 0..40 {
            value = written.push(Operation::Mul(value, value));
        }
        let outputs = vec![value];
        let program = written.program(outputs);
        assert_eq!(program.with_gathered_factors(0..1).evaluate(&at), program.evaluate(&at));
    }

    /// Operations by number, each of two values that are there already.
    fn operations() -> impl Strategy<Value = Vec<(usize, usize, usize)>> {
        prop::collection::vec((0..9_usize, 0..1000_usize, 0..1000_usize), 1..30)
    }

    fn written(operations: &[(usize, usize, usize)]) -> Program {
        let mut written = Written::default();
        let mut values: Vec<Slot> = NAMES.iter().map(|name| written.text(name)).collect();
        let one = written.text("1");
        values.push(one);
        for &(kind, a, b) in operations {
            // The latest more often, so that much of it is needed.
            let pick = |n: usize| values[values.len() - 1 - (n * n / 1000) % values.len()];
            let (a, b) = (pick(a), pick(b));
            let operation = match kind {
                0..=3 => Operation::Mul(a, b),
                4 | 5 => Operation::Add(a, b),
                6 => Operation::Sub(a, b),
                7 => Operation::Neg(a),
                _ => {
                    let square = written.push(Operation::Mul(b, b));
                    let divisor = written.push(Operation::Add(square, one));
                    Operation::Div(a, divisor)
                }
            };
            values.push(written.push(operation));
        }
        let outputs = values.split_off(values.len() - 2.min(operations.len()));
        written.program(outputs)
    }

    proptest! {
        /// Whether or not the new form is taken: what it gives differs by rounding at most.
        #[test]
        fn values_stay(
            operations in operations(),
            at in prop::array::uniform5(prop_oneof![-1.4..-0.6, 0.6..1.4_f64]),
        ) {
            let program = written(&operations);
            let places = 0..program.outputs().len();
            let kept = program.kept_at_points(program.outputs(), usize::MAX);
            let gathered = Gathering::new(&program).program(places, &kept).unwrap().compacted();
            let inputs = at.map(|value| [value; SIDE]);
            let bounds = program.error_bounds(&inputs).into_iter().zip(gathered.error_bounds(&inputs));
            let values = program.evaluate(&at).into_iter().zip(gathered.evaluate(&at));
            for ((old, new), (before, after)) in values.zip(bounds) {
                prop_assume!(old.abs() < 1e9 && before[0] < 1e9);
                let allowed = 2.0 * f64::EPSILON * (before[0] + after[0]);
                prop_assert!((old - new).abs() <= allowed, "{old} and {new}: {:?}", program.operations());
            }
        }

        #[test]
        fn it_costs_no_more(operations in operations()) {
            let program = written(&operations);
            let gathered = program.with_gathered_factors(0..program.outputs().len());
            let cost = |program: &Program| {
                let kept = program.kept_at_points(program.outputs(), usize::MAX);
                (kept.len(), program.cost_at_points(program.outputs(), &kept))
            };
            let ((old_kept, old_cost), (new_kept, new_cost)) = (cost(&program), cost(&gathered));
            prop_assert!(new_kept <= old_kept && new_cost <= old_cost);
            let again = written(&operations).with_gathered_factors(0..program.outputs().len());
            prop_assert_eq!(again.operations(), gathered.operations());
            let inputs: [[f64; SIDE]; 5] = array::from_fn(|n| [0.6 + 0.2 * n as f64; SIDE]);
            prop_assert_eq!(gathered.error_bounds(&inputs).len(), program.outputs().len());
        }
    }
}
