//! The hash-consed graph: nodes, symbols, and questions about them.

mod build;
mod canonical;
mod derivative;
pub(crate) mod function;
mod parse;
mod print;
pub(crate) mod rational;
mod replacement;

pub use build::BuildError;
pub use derivative::Derivatives;
pub use function::{Function, RustCall};
pub use parse::{Ast, AstKind, ParseError};
pub use rational::{Rational, nearest_f64};
pub use replacement::Replacement;

use crate::RangeOfInputs;
use num_traits::{One, Zero};
use rustc_hash::{FxBuildHasher, FxHashMap};
use std::collections::BTreeSet;
use std::hash::BuildHasher;

/// The most nodes and references that text may make.
pub(crate) const LARGEST_SIZE: usize = 1 << 21;
/// The largest number that text may make; arithmetic beyond it would be slow.
pub(crate) const MOST_BITS: u64 = 1 << 14;

/// The most operands that text may make sums and products handle, about a second's work.
pub(crate) const MOST_WORK: usize = 1 << 20;

/// A value this much larger than its rounding error may be, relative to the magnitude of its parts, is not zero.
const CERTAIN: f64 = 1e-6;

/// An expression: the handle of a node in a [`Graph`]. Equal handles of one graph mean equal expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Expr(pub(crate) u32);

/// Node of the graph: a leaf, or an operation on earlier nodes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// An exact number.
    Number(Rational),
    /// The circle number.
    Pi,
    /// A variable, by its index among the graph's symbols.
    Symbol(u32),
    /// `constant + sum of coefficient * term`; no term is a number, terms are sorted and differ, no coefficient
    /// is zero. One term alone is a scaled expression.
    Sum {
        /// The number added.
        constant: Rational,
        /// The terms with their coefficients.
        terms: Box<[(Expr, Rational)]>,
    },
    /// The product of `base ^ exponent`; bases are sorted and differ, no exponent is zero.
    Product(Box<[(Expr, Rational)]>),
    /// A function of its arguments.
    Call(Function, Box<[Expr]>),
    /// A quantity that algebra leaves in one piece.
    Whole(Expr),
}

/// An arena of expressions in which equal expressions are one node.
#[derive(Clone, Debug)]
pub struct Graph {
    nodes: Vec<Node>,
    depth: Vec<u32>,
    /// By the hash of a node the last one made of this hash; equal hashes of different nodes are rare.
    index: NumberMap<u64, Expr>,
    /// For each node the one made before it of the same hash.
    earlier: Vec<Option<Expr>>,
    symbols: Vec<String>,
    /// Nodes and references between them.
    size: usize,
    /// The bits of the largest number.
    bits: u64,
    /// Whether any product has a power of zero.
    pub(crate) has_powers_of_zero: bool,
    /// Whether there are any exponential functions, hyperbolic ones included.
    pub(crate) has_exponentials: bool,
    /// Operands that sums and products have been made of, time and again.
    pub(crate) work: usize,
    /// The values of the first nodes at one place, each with the magnitude of what it was summed up from.
    samples: Vec<(f64, f64)>,
    /// The inputs for which functions of sums keep their digits.
    pub range_of_inputs: RangeOfInputs,
    /// Results of [`Graph::open`].
    pub(crate) open: NumberMap<Expr, Expr>,
    /// Results of [`Graph::residue`].
    pub(crate) residues: NumberMap<(usize, Expr), Option<u64>>,
}

/// A map whose keys are small numbers. Nothing may depend on the order of its entries.
pub(crate) type NumberMap<K, V> = FxHashMap<K, V>;

impl Default for Graph {
    fn default() -> Self {
        Self::new()
    }
}

impl Graph {
    /// The number zero.
    pub const ZERO: Expr = Expr(0);
    /// The number one.
    pub const ONE: Expr = Expr(1);

    /// A graph with nothing but zero and one.
    #[must_use]
    pub fn new() -> Self {
        let mut graph = Graph {
            nodes: Vec::new(),
            depth: Vec::new(),
            index: FxHashMap::default(),
            earlier: Vec::new(),
            symbols: Vec::new(),
            size: 0,
            bits: 0,
            has_powers_of_zero: false,
            has_exponentials: false,
            work: 0,
            samples: Vec::new(),
            range_of_inputs: RangeOfInputs::default(),
            open: FxHashMap::default(),
            residues: FxHashMap::default(),
        };
        graph.intern(Node::Number(Rational::zero()));
        graph.intern(Node::Number(Rational::one()));
        graph
    }

    /// The handle of `node`; canonical form is the caller's duty.
    pub(crate) fn intern(&mut self, node: Node) -> Expr {
        let hash = FxBuildHasher.hash_one(&node);
        let mut known = self.index.get(&hash).copied();
        while let Some(expr) = known {
            if *self.node(expr) == node {
                return expr;
            }
            known = self.earlier[expr.0 as usize];
        }
        let expr = Expr(u32::try_from(self.nodes.len()).unwrap_or(u32::MAX));
        let depth = 1 + children(&node).map(|c| self.depth(c)).max().unwrap_or(0);
        self.size += 1 + children(&node).count();
        self.bits = numbers(&node).map(bits).fold(self.bits, u64::max);
        // Factors are sorted by their bases, and zero is the first node.
        self.has_powers_of_zero |=
            matches!(&node, Node::Product(factors) if factors[0].0 == Graph::ZERO);
        self.has_exponentials |= matches!(
            &node,
            Node::Call(
                Function::Exp | Function::Expm1 | Function::Sinh | Function::Cosh | Function::Tanh,
                _
            )
        );
        self.earlier.push(self.index.insert(hash, expr));
        self.nodes.push(node);
        self.depth.push(depth);
        expr
    }

    /// The node at the expression's root.
    #[must_use]
    pub fn node(&self, expr: Expr) -> &Node {
        &self.nodes[expr.0 as usize]
    }

    /// The length of the longest path from the root to a leaf.
    #[must_use]
    pub fn depth(&self, expr: Expr) -> u32 {
        self.depth[expr.0 as usize]
    }

    /// The number of nodes made so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Nodes and the references between them.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// The work that has been done in this graph: nodes and references made, and operands that sums and products
    /// handled. A count, the same on every machine, however busy.
    #[must_use]
    pub fn work(&self) -> usize {
        self.size + self.work
    }

    /// Whether the graph is empty, which it never is: zero and one are always there.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Whether the graph holds more, or larger numbers, or took more work, than text may cause.
    #[must_use]
    pub fn is_overgrown(&self) -> bool {
        self.size > LARGEST_SIZE || self.bits > MOST_BITS || self.work > MOST_WORK
    }

    /// The variable `name`; the same name gives the same variable.
    pub fn symbol(&mut self, name: &str) -> Expr {
        let index = self.symbols.iter().position(|s| s == name).unwrap_or_else(|| {
            self.symbols.push(name.to_owned());
            self.symbols.len() - 1
        });
        self.intern(Node::Symbol(index as u32))
    }

    /// The name of a variable; `None` where the expression is not a variable.
    #[must_use]
    pub fn symbol_name(&self, expr: Expr) -> Option<&str> {
        match self.node(expr) {
            Node::Symbol(index) => Some(&self.symbols[*index as usize]),
            _ => None,
        }
    }

    /// The exact number `value`.
    pub fn number(&mut self, value: Rational) -> Expr {
        self.intern(Node::Number(value))
    }

    /// The integer `value`.
    pub fn integer(&mut self, value: i64) -> Expr {
        self.number(value.into())
    }

    /// The circle number.
    pub fn pi(&mut self) -> Expr {
        self.intern(Node::Pi)
    }

    /// The value, where the expression is a number.
    #[must_use]
    pub fn as_number(&self, expr: Expr) -> Option<&Rational> {
        match self.node(expr) {
            Node::Number(value) => Some(value),
            _ => None,
        }
    }

    /// `expr` as a quantity that algebra does not look into: sums that contain it are not merged with its terms.
    /// It has the same value. Anything but a sum is returned as it is.
    pub fn whole(&mut self, expr: Expr) -> Expr {
        match self.node(expr) {
            Node::Sum { .. } => self.intern(Node::Whole(expr)),
            _ => expr,
        }
    }

    /// The expressions that the root refers to directly.
    pub fn children(&self, expr: Expr) -> impl Iterator<Item = Expr> + '_ {
        children(self.node(expr))
    }

    /// Whether the value at one fixed place, in double precision, is beyond any doubt not zero.
    pub(crate) fn differs_from_zero(&mut self, expr: Expr) -> bool {
        let (value, magnitude) = self.sampled(expr);
        certainly_not_zero(value, magnitude)
    }

    /// The magnitude of what `expr` is summed up from, at one fixed place.
    pub(crate) fn magnitude(&mut self, expr: Expr) -> f64 {
        self.sampled(expr).1
    }

    fn sampled(&mut self, expr: Expr) -> (f64, f64) {
        // Children have smaller handles than their parents.
        while self.samples.len() <= expr.0 as usize {
            let sample = self.sample(&self.nodes[self.samples.len()]);
            self.samples.push(sample);
        }
        self.samples[expr.0 as usize]
    }

    /// The value of a node, and a magnitude such that the rounding error is a small multiple of `2^-53` times it.
    fn sample(&self, node: &Node) -> (f64, f64) {
        let at = |e: Expr| self.samples[e.0 as usize];
        let value_alone = |value: f64| (value, value.abs());
        match node {
            Node::Number(value) => value_alone(nearest_f64(value)),
            Node::Pi => value_alone(std::f64::consts::PI),
            Node::Symbol(index) => {
                value_alone(0.3 + (0.618_033_988_749_894_9 * f64::from(*index + 1)).fract())
            }
            Node::Sum { constant, terms } => {
                let constant = nearest_f64(constant);
                terms.iter().fold((constant, constant.abs()), |(sum, size), (term, coefficient)| {
                    let ((value, magnitude), c) = (at(*term), nearest_f64(coefficient));
                    (sum + c * value, size + c.abs() * magnitude)
                })
            }
            Node::Product(factors) => {
                factors.iter().fold((1.0, 1.0), |(product, size), (base, exponent)| {
                    let ((value, magnitude), exponent) = (at(*base), nearest_f64(exponent));
                    let power = value.powf(exponent);
                    // The relative error grows with the exponent.
                    let growth = (1.0 + exponent.abs()) * magnitude / value.abs();
                    (product * power, size * power.abs() * growth)
                })
            }
            Node::Call(function, arguments) => {
                let (value, magnitude) = at(arguments[0]);
                let result = function.double(value);
                (result, result.abs() + function.steepness(value) * magnitude)
            }
            Node::Whole(inner) => at(*inner),
        }
    }

    /// The variables in any of `roots`.
    #[must_use]
    pub fn symbols_in(&self, roots: &[Expr]) -> BTreeSet<Expr> {
        self.reachable(roots)
            .into_iter()
            .filter(|&e| matches!(self.node(e), Node::Symbol(_)))
            .collect()
    }

    /// Every expression that `roots` consist of, themselves included.
    #[must_use]
    pub fn reachable(&self, roots: &[Expr]) -> BTreeSet<Expr> {
        let mut seen = BTreeSet::new();
        let mut stack = roots.to_vec();
        while let Some(expr) = stack.pop() {
            if seen.insert(expr) {
                stack.extend(self.children(expr));
            }
        }
        seen
    }
}

fn certainly_not_zero(value: f64, magnitude: f64) -> bool {
    value.is_finite() && magnitude.is_finite() && value.abs() > CERTAIN * magnitude
}

/// The numbers in a node.
pub(crate) fn numbers(node: &Node) -> impl Iterator<Item = &Rational> {
    let (value, pairs): (Option<&Rational>, &[(Expr, Rational)]) = match node {
        Node::Number(value) => (Some(value), &[]),
        Node::Sum { constant, terms } => (Some(constant), terms),
        Node::Product(factors) => (None, factors),
        Node::Pi | Node::Symbol(_) | Node::Call(..) | Node::Whole(_) => (None, &[]),
    };
    value.into_iter().chain(pairs.iter().map(|(_, number)| number))
}

/// The bits of numerator and denominator together.
pub(crate) fn bits(number: &Rational) -> u64 {
    let (numerator, denominator) = number.bits();
    numerator + denominator
}

fn children(node: &Node) -> impl Iterator<Item = Expr> + '_ {
    let (pairs, arguments): (&[(Expr, Rational)], &[Expr]) = match node {
        Node::Number(_) | Node::Pi | Node::Symbol(_) => (&[], &[]),
        Node::Sum { terms, .. } => (terms, &[]),
        Node::Product(factors) => (factors, &[]),
        Node::Call(_, arguments) => (&[], arguments),
        Node::Whole(inner) => (&[], std::slice::from_ref(inner)),
    };
    pairs.iter().map(|&(e, _)| e).chain(arguments.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Expr};

    fn build(graph: &mut Graph, text: &str) -> Expr {
        graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
    }

    /// Values at the one place are those of the mathematics, and magnitudes are what they would be if nothing cancelled,
    /// by as much as an error of the operands is magnified.
    #[test]
    fn samples_and_magnitudes() {
        type Of = fn(f64, f64) -> f64;
        let cases: [(&str, Of, Of); 20] = [
            ("-7/2", |_, _| -3.5, |_, _| 3.5),
            ("Pi", |_, _| std::f64::consts::PI, |_, _| std::f64::consts::PI),
            ("y", |_, y| y, |_, y| y),
            ("x - y", |x, y| x - y, |x, y| x + y),
            ("3 - 2*x + y/4", |x, y| 3.0 - 2.0 * x + y / 4.0, |x, y| 3.0 + 2.0 * x + y / 4.0),
            ("x*y", |x, y| x * y, |x, y| 2.0 * x * 2.0 * y),
            ("x^3*y", |x, y| x.powi(3) * y, |x, y| 4.0 * x.powi(3) * 2.0 * y),
            ("x/y^2", |x, y| x / (y * y), |x, y| 2.0 * x * 3.0 / (y * y)),
            ("sqrt(x)", |x, _| x.sqrt(), |x, _| 1.5 * x.sqrt()),
            ("(x - y)^3", |x, y| (x - y).powi(3), |x, y| 4.0 * (x - y).powi(2).abs() * (x + y)),
            ("1/(y - x)", |x, y| 1.0 / (y - x), |x, y| 2.0 * (x + y) / (y - x).powi(2)),
            ("sin(x - y)", |x, y| (x - y).sin(), |x, y| (x - y).sin().abs() + x + y),
            ("cos(x - y)", |x, y| (x - y).cos(), |x, y| (x - y).cos().abs() + x + y),
            ("exp(x - y)", |x, y| (x - y).exp(), |x, y| (x - y).exp() * (1.0 + x + y)),
            ("exp(-x)", |x, _| (-x).exp(), |x, _| (-x).exp() * (1.0 + x)),
            ("ln(x)", |x, _| x.ln(), |x, _| x.ln().abs() + 1.0),
            (
                "ln(3*x - y)",
                |x, y| (3.0 * x - y).ln(),
                |x, y| (3.0 * x - y).ln().abs() + (3.0 * x + y) / (3.0 * x - y),
            ),
            (
                "log1p(x - y)",
                |x, y| (x - y).ln_1p(),
                |x, y| (x - y).ln_1p().abs() + (x + y) / (1.0 + x - y),
            ),
            ("lnboth(x, 1 + x)", |x, _| x.ln_1p(), |x, _| x.ln_1p() + x / (1.0 + x)),
            ("lnboth(-y, 1 - y)", |_, y| (-y).ln_1p(), |_, y| (-y).ln_1p().abs() + y / (1.0 - y)),
        ];
        for (text, value, magnitude) in cases {
            let mut graph = Graph::new();
            let symbols = ["x", "y"].map(|name| graph.symbol(name));
            let [x, y] = symbols.map(|symbol| graph.sampled(symbol).0);
            assert!(0.3 < y && y < x && x < 1.3, "{x} {y}");
            let expr = build(&mut graph, text);
            let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-14;
            let found = graph.sampled(expr);
            assert!(near(found.0, value(x, y)), "{text}: {found:?}, not {}", value(x, y));
            assert!(near(found.1, magnitude(x, y)), "{text}: {found:?}, not {}", magnitude(x, y));
            assert!(graph.differs_from_zero(expr), "{text}");
            // What has a value is the same in one piece.
            let whole = graph.whole(expr);
            assert_eq!(graph.sampled(whole), found, "{text}");
            assert_eq!(graph.whole(whole), whole);
        }
    }

    /// However many symbols there are, none has nearly the value of another, and none is near zero.
    #[test]
    fn samples_of_symbols_are_apart() {
        let mut graph = Graph::new();
        let symbols: Vec<Expr> = (0..40).map(|n| graph.symbol(&format!("x{n}"))).collect();
        let mut at: Vec<f64> = symbols.iter().map(|&symbol| graph.sampled(symbol).0).collect();
        at.sort_by(f64::total_cmp);
        assert!(at[0] > 0.3 && at[39] < 1.3, "{at:?}");
        assert!(at.windows(2).all(|pair| pair[1] - pair[0] > 0.01), "{at:?}");
    }

    #[test]
    fn zero_and_what_has_no_value_do_not_differ_from_zero() {
        let mut graph = Graph::new();
        assert!(!graph.differs_from_zero(Graph::ZERO) && graph.vanishes(Graph::ZERO));
        for text in ["arctan(x)", "ln(-x)", "sqrt(-x) + 1"] {
            let expr = build(&mut graph, text);
            assert!(!graph.differs_from_zero(expr) && !graph.vanishes(expr), "{text}");
        }
    }

    /// Each limit may be reached and not be passed, and a message says which one is.
    #[test]
    fn limits_on_what_text_makes() {
        let x = Ast::parse("x").unwrap();
        let is_at_limit = |graph: &mut Graph| {
            let built = graph.build(&x, &mut |g, name| Ok(g.symbol(name)));
            built.is_ok() && !graph.is_overgrown()
        };
        let message = |graph: &mut Graph| {
            assert!(graph.is_overgrown());
            graph.build(&x, &mut |g, name| Ok(g.symbol(name))).unwrap_err().message
        };
        // Two references and a node each.
        let mut graph = Graph::new();
        let symbols: Vec<Expr> = (0..1000).map(|n| graph.symbol(&format!("x{n}"))).collect();
        graph.symbol("x");
        for n in 0..(LARGEST_SIZE - 1003) / 3 {
            graph.call(Function::Atan2, &[symbols[n / 1000], symbols[n % 1000]]);
        }
        for n in 0..(LARGEST_SIZE - 1003) % 3 {
            graph.symbol(&format!("y{n}"));
        }
        assert!(graph.size == LARGEST_SIZE && is_at_limit(&mut graph));
        graph.symbol("z");
        assert!(message(&mut graph).contains("subexpressions"));

        let mut graph = Graph::new();
        graph.symbol("x");
        graph.work = MOST_WORK;
        assert!(is_at_limit(&mut graph));
        graph.work += 1;
        assert!(message(&mut graph).contains("too long"));

        // Numerator and denominator together.
        let mut graph = Graph::new();
        let power = |n: u64| num_bigint::BigInt::from(1) << n;
        graph.symbol("x");
        graph.number(Rational::new(power(MOST_BITS - 102), power(100) - 1));
        assert!(is_at_limit(&mut graph));
        graph.number(Rational::new(power(MOST_BITS - 100), power(100) - 1));
        assert!(message(&mut graph).contains("bits"));
    }

    /// Each operand counts whenever it is looked at: where terms are collected, where they are merged, and where common
    /// factors are looked for.
    #[test]
    fn work_is_that_of_the_operands() {
        for count in [2, 10, 100, 1000] {
            let mut graph = Graph::new();
            let symbols: Vec<Expr> = (0..count).map(|n| graph.symbol(&format!("x{n}"))).collect();
            assert_eq!(graph.work, 0);
            let sum = graph.sum_of(symbols.iter().copied());
            assert_eq!(graph.work, 3 * count);
            graph.product_of(symbols.iter().copied());
            assert_eq!(graph.work, 4 * count);
            // With a constant there are no common factors.
            graph.add(sum, Graph::ONE);
            assert_eq!(graph.work, 4 * count + (count + 2) + count);
        }
        // Large coefficients take longer.
        let mut graph = Graph::new();
        let x = graph.symbol("x");
        let large = Rational::from_integer(num_bigint::BigInt::from(1) << 64_000);
        graph.sum([(large, x)]);
        assert_eq!(graph.work, 1 + 1000);
    }

    #[test]
    fn zero_and_one_are_always_there() {
        let graph = Graph::new();
        assert!(graph.len() == 2 && !graph.is_empty());
        assert_eq!(graph.as_number(Graph::ZERO), Some(&0.into()));
        assert_eq!(graph.as_number(Graph::ONE), Some(&1.into()));
    }

    #[test]
    fn symbols_are_found_wherever_they_are() {
        let mut graph = Graph::new();
        let texts = ["3/2 + Pi", "x*sin(y)^2 + z - z", "1/atan2(w, 2 - x)"];
        let roots = texts.map(|text| build(&mut graph, text));
        let whole = graph.whole(roots[1]);
        let [w, x, y] = ["w", "x", "y"].map(|name| graph.symbol(name));
        assert_eq!(graph.symbols_in(&roots[..1]), BTreeSet::new());
        assert_eq!(graph.symbols_in(&[whole]), BTreeSet::from([x, y]));
        assert_eq!(graph.symbols_in(&roots), BTreeSet::from([w, x, y]));
    }

    #[test]
    fn depth_is_that_of_the_longest_path() {
        let mut graph = Graph::new();
        let x = graph.symbol("x");
        let long = (0..50).fold(x, |inner, _| graph.call(Function::Sin, &[inner]));
        assert_eq!((graph.depth(x), graph.depth(Graph::ONE), graph.depth(long)), (1, 1, 51));
        let sum = build(&mut graph, "y + sin(sin(x))*z");
        assert_eq!(graph.depth(sum), 5);
    }
}
