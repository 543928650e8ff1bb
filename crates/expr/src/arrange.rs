//! Forms that leave little to compute where position and time meet.
//!
//! A solver evaluates a field at the same points at many times. What depends on the points alone it computes once, what
//! depends on the time alone once a step; only the innermost stage, which depends on both, is paid for at each
//! evaluation. [`arrange`] rewrites expressions for it:
//!
//! - Fractions of a sum that divide by quantities of the innermost stage, such as stretches `1 + h`, are brought over
//!   one common denominator, so that one division is left.
//! - The numerator becomes a polynomial in what depends on time alone, nested as by Horner, with coefficients that
//!   depend on the point alone. Identical cancellation, as in `1 - h/(1 + h) = 1/(1 + h)`, happens on the way.
//! - A factor that depends on the point alone, as `X/R` does, is set apart, so that components share the rest.
//!
//! Sums within a coefficient are not multiplied out, and terms without a fraction stay apart from those with one:
//! a small remainder is never mixed with the large part that it corrects. A form is taken only where it costs less
//! and where the bound of its rounding errors, by running error analysis at sample points, is not clearly larger.

use crate::graph::NumberMap;
use crate::program::SIDE;
use crate::{Dependence, Drafts, Expr, Graph, Node, Program, Rational};
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::array;
use std::collections::BTreeMap;

/// Numerators with more terms than this are not worth the search.
const MOST_TERMS: usize = 48;
/// Nor are more products of two terms than this, all in all.
const MOST_PRODUCTS: usize = 3000;
/// Powers beyond this are not multiplied out.
const LARGEST_POWER: u32 = 6;
/// How much larger than before the error bound may be: at most points, and at any.
const USUAL_GROWTH: f64 = 1.5;
const LARGEST_GROWTH: f64 = 8.0;

const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;
const PLASTIC_RATIO: f64 = 0.324_717_957_244_746;

/// `outputs` in forms of the same value that cost less where position and time meet.
///
/// `inputs` and `definitions` are those of [`Program::lower`], which the result is meant for; `drafts` may have served
/// with the same ones before.
#[must_use]
pub fn arrange(
    graph: &mut Graph,
    inputs: &[(Expr, Dependence)],
    definitions: &[(Expr, Expr)],
    drafts: &mut Drafts,
    outputs: &[Expr],
) -> Vec<Expr> {
    let mut arranging = Arranging {
        graph,
        inputs,
        definitions,
        dependence: NumberMap::default(),
        arranged: NumberMap::default(),
        products: 0,
        drafts,
        last: None,
        fractions: NumberMap::default(),
    };
    outputs.iter().map(|&output| arranging.arrange(output)).collect()
}

/// A product of quantities that depend on time, each to a positive power.
type Monomial = BTreeMap<Expr, u32>;
/// A sum of monomials, each with a coefficient that does not depend on time.
type Polynomial = BTreeMap<Monomial, Expr>;

/// A polynomial over a product of quantities that depend on both.
#[derive(Clone)]
struct Fraction {
    numerator: Polynomial,
    denominator: Monomial,
}

impl Fraction {
    fn polynomial(monomial: Monomial, coefficient: Expr) -> Self {
        let mut numerator = Polynomial::new();
        if coefficient != Graph::ZERO {
            numerator.insert(monomial, coefficient);
        }
        Fraction { numerator, denominator: Monomial::new() }
    }

    fn atom(expr: Expr) -> Self {
        Self::polynomial(Monomial::from([(expr, 1)]), Graph::ONE)
    }
}

struct Arranging<'a> {
    graph: &'a mut Graph,
    inputs: &'a [(Expr, Dependence)],
    definitions: &'a [(Expr, Expr)],
    drafts: &'a mut Drafts,
    dependence: NumberMap<Expr, Dependence>,
    arranged: NumberMap<Expr, Expr>,
    /// The products of two terms made so far.
    products: usize,
    /// The expression that was found to be the better one last.
    last: Option<(Expr, Program)>,
    /// Fractions found before, each with the products that it took. They count again where it is used again, so that
    /// the limit does not depend on what was asked for first.
    fractions: NumberMap<Expr, (Fraction, usize)>,
}

impl Arranging<'_> {
    fn dependence(&mut self, expr: Expr) -> Dependence {
        if let Some(&known) = self.dependence.get(&expr) {
            return known;
        }
        let dependence = if let Some(&(_, own)) = self.inputs.iter().find(|(e, _)| *e == expr) {
            own
        } else if let Some(&(_, meaning)) = self.definitions.iter().find(|(e, _)| *e == expr) {
            self.dependence(meaning)
        } else {
            let children: Vec<Expr> = self.graph.children(expr).collect();
            children
                .into_iter()
                .map(|child| self.dependence(child))
                .fold(Dependence::default(), Dependence::join)
        };
        self.dependence.insert(expr, dependence);
        dependence
    }

    fn is_innermost(&mut self, expr: Expr) -> bool {
        let dependence = self.dependence(expr);
        dependence.position && dependence.time
    }

    fn arrange(&mut self, expr: Expr) -> Expr {
        if !self.is_innermost(expr) {
            return expr;
        }
        if let Some(&known) = self.arranged.get(&expr) {
            return known;
        }
        let arranged = match self.graph.node(expr).clone() {
            Node::Whole(inner) => {
                let arranged = self.arrange(inner);
                if arranged == inner { expr } else { self.graph.opaque(arranged) }
            }
            Node::Product(factors) => self.arrange_product(expr, &factors, &Rational::one()),
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                let (term, coefficient) = terms[0].clone();
                let factors = match self.graph.node(term).clone() {
                    Node::Product(factors) => factors,
                    _ => Box::new([(term, Rational::one())]),
                };
                self.arrange_product(expr, &factors, &coefficient)
            }
            Node::Sum { constant, terms } => self.arrange_sum(expr, &constant, &terms),
            _ => expr,
        };
        self.arranged.insert(expr, arranged);
        arranged
    }

    /// Factors of the point apart, the rest in one piece, which other components can share.
    fn arrange_product(
        &mut self,
        expr: Expr,
        factors: &[(Expr, Rational)],
        coefficient: &Rational,
    ) -> Expr {
        let mut outside = vec![(self.graph.number(coefficient.clone()), Rational::one())];
        let mut inside = Vec::new();
        let mut divides = false;
        for (base, exponent) in factors {
            if self.dependence(*base).time {
                divides |= exponent.is_negative() && self.is_innermost(*base);
                inside.push((*base, exponent.clone()));
            } else {
                outside.push((*base, exponent.clone()));
            }
        }
        let together = self.graph.product(inside.iter().cloned());
        let inside = if divides {
            let candidate = self.fraction(together).map(|f| self.rebuild(&f));
            self.better(together, candidate)
        } else {
            let arranged: Vec<_> =
                inside.into_iter().map(|(base, e)| (self.arrange(base), e)).collect();
            self.graph.product(arranged)
        };
        let outside = self.graph.product(outside);
        if outside == Graph::ONE {
            return inside;
        }
        let (outside, inside) = (self.graph.opaque(outside), self.graph.opaque(inside));
        let candidate = self.graph.mul(outside, inside);
        self.better(expr, Some(candidate))
    }

    fn arrange_sum(&mut self, expr: Expr, constant: &Rational, terms: &[(Expr, Rational)]) -> Expr {
        let Some(fractions) = self.fractions(terms) else { return expr };
        if fractions.iter().all(|f| f.denominator.is_empty()) {
            return expr;
        }
        let mut best = expr;
        for common in [true, false] {
            let candidate = self.sum_of_fractions(constant, terms, &fractions, common);
            best = self.better(best, candidate);
        }
        best
    }

    fn fractions(&mut self, terms: &[(Expr, Rational)]) -> Option<Vec<Fraction>> {
        terms
            .iter()
            .map(|(term, coefficient)| {
                let fraction = self.fraction(*term)?;
                let coefficient = self.graph.number(coefficient.clone());
                self.times(&fraction, &Fraction::polynomial(Monomial::new(), coefficient))
            })
            .collect()
    }

    /// The sum with all fractions over one common denominator, or those together that have the same one.
    fn sum_of_fractions(
        &mut self,
        constant: &Rational,
        terms: &[(Expr, Rational)],
        fractions: &[Fraction],
        common: bool,
    ) -> Option<Expr> {
        let mut parts = vec![self.graph.number(constant.clone())];
        let mut groups: BTreeMap<Monomial, Fraction> = BTreeMap::new();
        for (fraction, (term, coefficient)) in fractions.iter().zip(terms) {
            if !fraction.denominator.is_empty() {
                let key = if common { Monomial::new() } else { fraction.denominator.clone() };
                let total = match groups.remove(&key) {
                    Some(total) => self.add(&total, fraction)?,
                    None => fraction.clone(),
                };
                groups.insert(key, total);
            } else if fraction.numerator.len() == 1 {
                parts.push(self.rebuild(fraction));
            } else {
                let scale = self.graph.number(coefficient.clone());
                parts.push(self.graph.mul(scale, *term));
            }
        }
        for fraction in groups.values() {
            parts.push(self.rebuild(fraction));
        }
        Some(self.graph.sum_of(parts))
    }

    /// `expr` as a polynomial over a product; `None` where that grows too large.
    fn fraction(&mut self, expr: Expr) -> Option<Fraction> {
        if let Some((known, products)) = self.fractions.get(&expr) {
            self.products += products;
            return (*products == 0 || self.products <= MOST_PRODUCTS).then(|| known.clone());
        }
        let before = self.products;
        let fraction = self.find_fraction(expr)?;
        self.fractions.insert(expr, (fraction.clone(), self.products - before));
        Some(fraction)
    }

    fn find_fraction(&mut self, expr: Expr) -> Option<Fraction> {
        let dependence = self.dependence(expr);
        if !dependence.time {
            return Some(Fraction::polynomial(Monomial::new(), expr));
        }
        match self.graph.node(expr).clone() {
            // A sum of the time stage is computed there.
            Node::Sum { constant, terms }
                if dependence.position || (constant.is_zero() && terms.len() == 1) =>
            {
                let constant = self.graph.number(constant);
                let mut total = Fraction::polynomial(Monomial::new(), constant);
                for fraction in self.fractions(&terms)? {
                    total = self.add(&total, &fraction)?;
                }
                Some(total)
            }
            Node::Product(factors) => {
                let mut total = Fraction::polynomial(Monomial::new(), Graph::ONE);
                for (base, exponent) in factors {
                    let factor = self.power(base, &exponent)?;
                    total = self.times(&total, &factor)?;
                }
                Some(total)
            }
            Node::Whole(inner) if dependence.position => self.fraction(inner),
            _ => Some(Fraction::atom(expr)),
        }
    }

    fn power(&mut self, base: Expr, exponent: &Rational) -> Option<Fraction> {
        let dependence = self.dependence(base);
        let power = exponent.abs().to_integer().to_u32()?;
        if !dependence.time {
            let power = self.graph.product([(base, exponent.clone())]);
            return Some(Fraction::polynomial(Monomial::new(), power));
        }
        if !exponent.is_integer() || (exponent.is_negative() && !dependence.position) {
            return Some(Fraction::atom(self.graph.product([(base, exponent.clone())])));
        }
        if exponent.is_negative() {
            let mut fraction = Fraction::polynomial(Monomial::new(), Graph::ONE);
            fraction.denominator.insert(base, power);
            return Some(fraction);
        }
        let factor = self.fraction(base)?;
        self.repeated(&factor, power)
    }

    fn repeated(&mut self, fraction: &Fraction, power: u32) -> Option<Fraction> {
        if power > LARGEST_POWER {
            return None;
        }
        let mut total = Fraction::polynomial(Monomial::new(), Graph::ONE);
        for _ in 0..power {
            total = self.times(&total, fraction)?;
        }
        Some(total)
    }

    fn add(&mut self, a: &Fraction, b: &Fraction) -> Option<Fraction> {
        let mut denominator = a.denominator.clone();
        for (&base, &n) in &b.denominator {
            let entry = denominator.entry(base).or_insert(0);
            *entry = n.max(*entry);
        }
        let mut numerator = self.over(a, &denominator)?;
        for (monomial, coefficient) in self.over(b, &denominator)? {
            self.add_to(&mut numerator, monomial, coefficient);
        }
        Some(Fraction { numerator, denominator })
    }

    /// The numerator of `fraction` over the larger `denominator`.
    fn over(&mut self, fraction: &Fraction, denominator: &Monomial) -> Option<Polynomial> {
        let mut total =
            Fraction { numerator: fraction.numerator.clone(), denominator: Monomial::new() };
        for (&base, &n) in denominator {
            let missing = n - fraction.denominator.get(&base).copied().unwrap_or(0);
            if missing > 0 {
                let factor = self.fraction(base).filter(|f| f.denominator.is_empty())?;
                let factor = self.repeated(&factor, missing)?;
                total = self.times(&total, &factor)?;
            }
        }
        Some(total.numerator)
    }

    fn times(&mut self, a: &Fraction, b: &Fraction) -> Option<Fraction> {
        let mut denominator = a.denominator.clone();
        for (&base, &n) in &b.denominator {
            *denominator.entry(base).or_insert(0) += n;
        }
        self.products += a.numerator.len() * b.numerator.len();
        if self.products > MOST_PRODUCTS {
            return None;
        }
        let mut numerator = Polynomial::new();
        for (m, c) in &a.numerator {
            for (n, d) in &b.numerator {
                let mut monomial = m.clone();
                for (&atom, &power) in n {
                    *monomial.entry(atom).or_insert(0) += power;
                }
                let coefficient = self.graph.mul(*c, *d);
                self.add_to(&mut numerator, monomial, coefficient);
            }
        }
        (numerator.len() <= MOST_TERMS).then_some(Fraction { numerator, denominator })
    }

    fn add_to(&mut self, polynomial: &mut Polynomial, monomial: Monomial, coefficient: Expr) {
        let present = polynomial.remove(&monomial).unwrap_or(Graph::ZERO);
        let total = self.graph.add(present, coefficient);
        if total != Graph::ZERO {
            polynomial.insert(monomial, total);
        }
    }

    fn rebuild(&mut self, fraction: &Fraction) -> Expr {
        let numerator = self.nested(&fraction.numerator);
        let mut factors = vec![(numerator, Rational::one())];
        factors.extend(
            fraction.denominator.iter().map(|(&base, &n)| (base, Rational::from(-i64::from(n)))),
        );
        self.graph.product(factors)
    }

    /// `atom * (...) + ...`, the atom that most terms have first: Horner's form in several variables.
    fn nested(&mut self, polynomial: &Polynomial) -> Expr {
        let mut occurrences: BTreeMap<Expr, usize> = BTreeMap::new();
        for atom in polynomial.keys().flat_map(BTreeMap::keys) {
            *occurrences.entry(*atom).or_insert(0) += 1;
        }
        // Of equally frequent ones the first, so that the choice is definite.
        let mut most: Option<(Expr, usize)> = None;
        for (atom, count) in occurrences {
            if most.is_none_or(|(_, largest)| count > largest) {
                most = Some((atom, count));
            }
        }
        let Some((atom, _)) = most else {
            let coefficient = polynomial.values().next().copied().unwrap_or(Graph::ZERO);
            return self.graph.opaque(coefficient);
        };
        let (mut with, mut without) = (Polynomial::new(), Polynomial::new());
        for (monomial, &coefficient) in polynomial {
            let mut monomial = monomial.clone();
            match monomial.remove(&atom) {
                Some(power) => {
                    if power > 1 {
                        monomial.insert(atom, power - 1);
                    }
                    with.insert(monomial, coefficient);
                }
                None => {
                    without.insert(monomial, coefficient);
                }
            }
        }
        let inner = self.nested(&with);
        let product = self.graph.mul(atom, inner);
        if without.is_empty() {
            return product;
        }
        let rest = self.nested(&without);
        self.graph.add(rest, product)
    }

    /// The candidate where it costs less and is as accurate.
    fn better(&mut self, present: Expr, candidate: Option<Expr>) -> Expr {
        let Some(candidate) = candidate.filter(|&candidate| candidate != present) else {
            return present;
        };
        let (before, after) = (self.lowered(present), self.lowered(candidate));
        let cost = |program: &Program| program.operations_by_stage(program.outputs()).both.cost();
        let is_better =
            cost(&after) <= cost(&before) && as_accurate(&before, &after, self.inputs.len());
        let (taken, program) = if is_better { (candidate, after) } else { (present, before) };
        self.last = Some((taken, program));
        taken
    }

    /// The program of an expression, which is often the one that came out best before.
    fn lowered(&mut self, expr: Expr) -> Program {
        match self.last.take() {
            Some((known, program)) if known == expr => program,
            _ => self.drafts.lower(self.graph, self.inputs, self.definitions, &[expr]),
        }
    }
}

/// An input at a point of a fixed sequence: multiples of the golden ratio, with a different start for each input.
fn sample(point: usize, input: usize) -> f64 {
    let turns = GOLDEN_RATIO * point as f64 + PLASTIC_RATIO * input as f64;
    let scale = if point == 2 * input + 1 { 1e-8 } else { 1.0 };
    scale * (0.05 + 0.9 * turns.fract())
}

/// Whether the error bound of `after` is hardly larger than that of `before`: at more than half of some sample points
/// by little, and nowhere by much. At every other point one input is tiny, as an amplitude may be.
pub(crate) fn as_accurate(before: &Program, after: &Program, inputs: usize) -> bool {
    let growth = growth_of_bounds(before, after, inputs);
    // What is not finite any more is infinitely worse.
    hardly_larger(growth.into_iter().map(|growth| growth.unwrap_or(f64::INFINITY)).collect())
}

/// The same for a form that need not be defined wherever the other is, only at most points.
pub(crate) fn as_accurate_where_defined(before: &Program, after: &Program, inputs: usize) -> bool {
    let growth = growth_of_bounds(before, after, inputs);
    let known: Vec<f64> = growth.iter().flatten().copied().collect();
    2 * known.len() >= growth.len() && hardly_larger(known)
}

fn hardly_larger(mut growth: Vec<f64>) -> bool {
    growth.sort_by(f64::total_cmp);
    let usual = growth.get(growth.len() / 2).copied().unwrap_or(1.0);
    let largest = growth.last().copied().unwrap_or(1.0);
    usual <= USUAL_GROWTH && largest <= LARGEST_GROWTH
}

/// How many times as large the bound of each output's error is in `after`, at each of the sample points where it is finite in
/// `before`; `None` where it is not finite in `after`.
fn growth_of_bounds(before: &Program, after: &Program, inputs: usize) -> Vec<Option<f64>> {
    let points = 64.max(2 * inputs);
    let mut growth = Vec::new();
    for first in (0..points).step_by(SIDE) {
        let places: Vec<[f64; SIDE]> =
            (0..inputs).map(|input| array::from_fn(|k| sample(first + k, input))).collect();
        for (old, new) in before.error_bounds(&places).iter().zip(after.error_bounds(&places)) {
            // Where the point is outside the domain of definition there is nothing to compare.
            let known = old.iter().zip(new).filter(|(old, _)| old.is_finite());
            growth.extend(known.map(|(&old, new)| {
                // Nothing is as large as nothing.
                new.is_finite().then(|| if new <= old { 1.0 } else { new / old })
            }));
        }
    }
    growth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ast;

    /// Limits on terms, products and powers may be reached and not be passed.
    #[test]
    fn limits_of_multiplying_out() {
        let mut graph = Graph::new();
        let (t, s) = (graph.symbol("t"), graph.symbol("s"));
        let mut arranging = Arranging {
            graph: &mut graph,
            inputs: &[],
            definitions: &[],
            drafts: &mut Drafts::default(),
            dependence: NumberMap::default(),
            arranged: NumberMap::default(),
            products: 0,
            last: None,
            fractions: NumberMap::default(),
        };
        let sum = |of: Expr, count: usize| -> Fraction {
            let terms = (1..).map(|n| (Monomial::from([(of, n)]), Graph::ONE));
            Fraction { numerator: terms.take(count).collect(), denominator: Monomial::new() }
        };
        let power = arranging.repeated(&Fraction::atom(t), LARGEST_POWER);
        assert_eq!(
            power.map(|f| f.numerator),
            Some([([(t, LARGEST_POWER)].into(), Graph::ONE)].into())
        );
        assert!(arranging.repeated(&Fraction::atom(t), LARGEST_POWER + 1).is_none());
        arranging.products = 0;
        let terms = |f: Option<Fraction>| f.map(|f| f.numerator.len());
        assert_eq!(terms(arranging.times(&sum(t, 6), &sum(s, 8))), Some(MOST_TERMS));
        assert_eq!(terms(arranging.times(&sum(t, 7), &sum(s, 7))), None);
        assert_eq!(arranging.products, 6 * 8 + 7 * 7);
        arranging.products = MOST_PRODUCTS - 4;
        assert_eq!(terms(arranging.times(&sum(t, 2), &sum(s, 2))), Some(4));
        assert_eq!(terms(arranging.times(&sum(t, 1), &sum(s, 1))), None);
        // What is found again counts again, though nothing is multiplied.
        let product = arranging.graph.mul(t, s);
        let time = Dependence { position: false, time: true };
        arranging.dependence.extend([(t, time), (s, time)]);
        arranging.products = 10;
        for times in 1..4 {
            assert_eq!(terms(arranging.fraction(product)), Some(1));
            assert_eq!(arranging.products, 10 + 4 * times);
        }
        arranging.products = MOST_PRODUCTS - 4;
        assert_eq!(terms(arranging.fraction(product)), Some(1));
        assert_eq!(terms(arranging.fraction(product)), None);
        // What takes no product is never too much.
        assert_eq!(terms(arranging.fraction(t)), Some(1));
        assert_eq!(terms(arranging.fraction(t)), Some(1));
    }

    /// The points of each input are all over its range, none of two inputs are the same, and each is tiny at one odd point.
    #[test]
    fn sample_points_fill_their_range() {
        for input in 0..20 {
            let is_tiny = |point: usize| sample(point, input) < 1e-7;
            let tiny: Vec<usize> = (0..64).filter(|&point| is_tiny(point)).collect();
            assert_eq!(tiny, [2 * input + 1]);
            let points = (0..64).filter(|&point| !is_tiny(point));
            let mut at: Vec<f64> = points.map(|point| sample(point, input)).collect();
            at.sort_by(f64::total_cmp);
            assert!(at[0] >= 0.05 && at[0] < 0.1 && at[62] > 0.9 && at[62] <= 0.95, "{at:?}");
            assert!(at.windows(2).all(|pair| pair[1] - pair[0] < 0.06), "{at:?}");
        }
        let mut first: Vec<f64> = (0..20).map(|input| sample(0, input)).collect();
        first.sort_by(f64::total_cmp);
        assert!(first.windows(2).all(|pair| pair[1] - pair[0] > 0.01), "{first:?}");
    }

    /// Only the bounds of the errors are compared, whatever the programs compute: `n x y` has two roundings of `n x y`.
    #[test]
    fn bounds_may_hardly_grow() {
        let mut graph = Graph::new();
        let inputs = ["x", "y"].map(|name| (graph.symbol(name), Dependence::default()));
        let mut program = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            Program::lower(&mut graph, &inputs, &[], &[expr])
        };
        let four = program("4*x*y");
        for (text, expected) in [
            ("4*x*y", true),
            ("x*y", true),
            ("x", true),
            // By little, and by more than little at most points.
            ("5*x*y", true),
            ("5.9*x*y", true),
            ("6.1*x*y", false),
            ("40*x*y", false),
            // By little where nothing is tiny, and by much where x or y is.
            ("4*x*y + 1/(10^12*x)", false),
            ("4*x*y + 1/(10^12*y)", false),
            // At some points not defined any more, at more than half of them not defined.
            ("4*x*y + 10^(-20)*sqrt(0.9 - x)", false),
            ("sqrt(x - 2)", false),
        ] {
            assert_eq!(as_accurate(&four, &program(text), 2), expected, "{text}");
        }
        // The same but for a factor: it is about one at most points, and up to five, or up to nine, where y is largest.
        let product = program("4*(x + 1)*(y + 1)");
        assert!(as_accurate(&product, &program("(x + 1)*(y + 1)^7/12"), 2));
        assert!(!as_accurate(&product, &program("(x + 1)*(y + 1)^9/27"), 2));
        // However many inputs there are, each is tiny once.
        let names: Vec<String> = (0..40).map(|n| format!("x{n}")).collect();
        let mut graph = Graph::new();
        let inputs: Vec<_> =
            names.iter().map(|name| (graph.symbol(name), Dependence::default())).collect();
        let mut program_of_many = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            Program::lower(&mut graph, &inputs, &[], &[expr])
        };
        let sum = program_of_many(&names.join(" + "));
        for name in &names {
            let candidate = format!("{} + 1/(10^3*{name})", names.join(" + "));
            assert!(!as_accurate(&sum, &program_of_many(&candidate), 40), "{name}");
        }
        // What is defined nowhere has nothing to lose, nor what is exact as long as it stays so.
        let (nowhere, exact) = (program("sqrt(x - 2)"), program("x"));
        assert!(as_accurate(&nowhere, &four, 2));
        assert!(as_accurate(&exact, &program("y"), 2));
        assert!(!as_accurate(&exact, &four, 2));
    }
}
