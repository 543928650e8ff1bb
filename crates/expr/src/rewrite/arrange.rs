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

use super::accuracy::Samples;
use super::polynomial::{Monomial, add_to, product, product_of_monomials};
use crate::graph::NumberMap;
use crate::{Dependence, Drafts, Expr, Graph, Node, Program, Rational};
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::collections::BTreeMap;

/// Numerators with more terms than this are not worth the search.
const MOST_TERMS: usize = 48;
/// Nor are more products of two terms than this, all in all.
const MOST_PRODUCTS: usize = 3000;
/// Powers beyond this are not multiplied out.
const LARGEST_POWER: u32 = 6;
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
    let program = drafts.lower(graph, inputs, definitions, outputs);
    let mut arranging = Arranging {
        graph,
        inputs,
        definitions,
        samples: Samples::of(&program, inputs.len()),
        dependence: NumberMap::default(),
        arranged: NumberMap::default(),
        products: 0,
        drafts,
        last: None,
        fractions: NumberMap::default(),
    };
    let arrange = |&output: &Expr| {
        if arranging.graph.divides_by_exponentials(output) {
            return output;
        }
        arranging.arrange(output)
    };
    outputs.iter().map(arrange).collect()
}

/// A polynomial in quantities that depend on time, with coefficients that do not.
type Polynomial = super::polynomial::Polynomial<Expr>;

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
    /// Where forms are compared.
    samples: Samples,
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
            add_to(self.graph, &mut numerator, monomial, &coefficient);
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
        let denominator = product_of_monomials(&a.denominator, &b.denominator);
        self.products += a.numerator.len() * b.numerator.len();
        if self.products > MOST_PRODUCTS {
            return None;
        }
        let numerator = product(self.graph, &a.numerator, &b.numerator);
        (numerator.len() <= MOST_TERMS).then_some(Fraction { numerator, denominator })
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
        let is_better = cost(&after) <= cost(&before) && self.samples.admit(&before, &after);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits on terms, products and powers may be reached and not be passed.
    #[test]
    fn limits_of_multiplying_out() {
        let mut graph = Graph::new();
        let (t, s) = (graph.symbol("t"), graph.symbol("s"));
        let mut arranging = Arranging {
            graph: &mut graph,
            inputs: &[],
            definitions: &[],
            samples: Samples::usual(0),
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
}
