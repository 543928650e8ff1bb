//! Constructors that keep sums, products, powers and function values in canonical form.
//!
//! Rules: nested sums and products are flattened; like terms and equal bases are collected; a numeric content
//! and factors common to all terms of a sum stand outside it; terms `k S1 + k S2` with sums `S1`, `S2` are
//! merged into `k (S1 + S2)`. Products of sums are never multiplied out. Exponential functions of one argument meet
//! in sums and products by rules of their own.

use crate::graph::function::Parity;
use crate::graph::rational::exact_root;
use crate::{Expr, Function, Graph, Node, Rational};
use num_integer::Integer;
use num_traits::{One, Signed, ToPrimitive, Zero};
use smallvec::{SmallVec, smallvec};
use std::collections::BTreeMap;

/// Exact numbers beyond this size stay unevaluated powers.
const LARGEST_NUMBER_BITS: u64 = 8192;

/// Terms with their coefficients, or bases with their exponents. Most sums and products have few, for which nothing is allocated.
type Numbered = SmallVec<[(Expr, Rational); 6]>;

impl Graph {
    /// `sum of coefficient * term`.
    pub fn sum(&mut self, terms: impl IntoIterator<Item = (Rational, Expr)>) -> Expr {
        let mut constant = Rational::zero();
        let mut collected = Collected::default();
        for (coefficient, term) in terms {
            self.add_term(&mut constant, &mut collected, &coefficient, term);
        }
        while self.merge_terms_of_equal_key(&mut constant, &mut collected) {}
        self.sum_of_collected(constant, collected)
    }

    /// `a + b`.
    pub fn add(&mut self, a: Expr, b: Expr) -> Expr {
        self.sum([(Rational::one(), a), (Rational::one(), b)])
    }

    /// `a - b`.
    pub fn sub(&mut self, a: Expr, b: Expr) -> Expr {
        self.sum([(Rational::one(), a), (-Rational::one(), b)])
    }

    /// `-a`.
    pub fn neg(&mut self, a: Expr) -> Expr {
        self.sum([(-Rational::one(), a)])
    }

    /// The sum of `terms`.
    pub fn sum_of(&mut self, terms: impl IntoIterator<Item = Expr>) -> Expr {
        self.sum(terms.into_iter().map(|term| (Rational::one(), term)))
    }

    /// `a b`.
    pub fn mul(&mut self, a: Expr, b: Expr) -> Expr {
        self.product([(a, Rational::one()), (b, Rational::one())])
    }

    /// The product of `factors`.
    pub fn product_of(&mut self, factors: impl IntoIterator<Item = Expr>) -> Expr {
        self.product(factors.into_iter().map(|factor| (factor, Rational::one())))
    }

    /// `a / b`.
    pub fn div(&mut self, a: Expr, b: Expr) -> Expr {
        self.product([(a, Rational::one()), (b, -Rational::one())])
    }

    /// `base ^ exponent` for an integer exponent.
    pub fn powi(&mut self, base: Expr, exponent: i64) -> Expr {
        self.product([(base, Rational::from(exponent))])
    }

    /// The square root.
    pub fn sqrt(&mut self, a: Expr) -> Expr {
        self.product([(a, Rational::new(1.into(), 2.into()))])
    }

    fn add_term(
        &mut self,
        constant: &mut Rational,
        collected: &mut Collected,
        coefficient: &Rational,
        term: Expr,
    ) {
        let mut pending: Numbered = smallvec![(term, coefficient.clone())];
        while let Some((term, coefficient)) = pending.pop() {
            self.work += 1 + (crate::graph::bits(&coefficient) / 64) as usize;
            match self.node(term) {
                Node::Number(value) => *constant += &coefficient * value,
                Node::Sum { constant: inner, terms } => {
                    *constant += &coefficient * inner;
                    pending.extend(terms.iter().rev().map(|(term, c)| (*term, &coefficient * c)));
                }
                _ => {
                    collected.add(term, &coefficient);
                }
            }
        }
    }

    /// Replaces one group of terms `k S1, k S2, ...` by `k (S1 + S2 + ...)`; false where there is none.
    fn merge_terms_of_equal_key(
        &mut self,
        constant: &mut Rational,
        collected: &mut Collected,
    ) -> bool {
        let terms: Vec<Expr> = collected.keys().collect();
        if terms.len() < 2 {
            return false;
        }
        self.work += terms.len();
        // Key, term and sum.
        let mut splits: Vec<(Expr, Expr, Expr)> = Vec::new();
        for &term in &terms {
            if let Some((key, inner)) = self.split_off_sum(term) {
                splits.push((key, term, inner));
            }
        }
        // Stable, so that the terms of a key keep their order.
        splits.sort_by_key(|(key, ..)| *key);
        for group in splits.chunk_by(|a, b| a.0 == b.0) {
            let key = group[0].0;
            let mut members: Vec<(Expr, Expr)> = group.iter().map(|m| (m.1, m.2)).collect();
            if collected.contains(key) {
                members.push((key, Graph::ONE));
            }
            if members.len() < 2 {
                continue;
            }
            let inner_terms: Vec<(Rational, Expr)> = members
                .iter()
                .filter_map(|&(term, inner)| Some((collected.remove(term)?, inner)))
                .collect();
            let inner = self.sum(inner_terms);
            let merged = self.mul(key, inner);
            self.add_term(constant, collected, &Rational::one(), merged);
            return true;
        }
        false
    }

    /// `term = key * sum` where exactly one factor of the term is a sum, to the first power.
    fn split_off_sum(&mut self, term: Expr) -> Option<(Expr, Expr)> {
        let Node::Product(factors) = self.node(term) else { return None };
        let mut sums =
            factors.iter().filter(|(base, _)| matches!(self.node(*base), Node::Sum { .. }));
        let (sum, exponent) = sums.next()?;
        if sums.next().is_some() || !exponent.is_one() {
            return None;
        }
        let sum = *sum;
        let rest: Vec<_> = factors.iter().filter(|(base, _)| *base != sum).cloned().collect();
        Some((self.product(rest), sum))
    }

    fn sum_of_collected(&mut self, constant: Rational, collected: Collected) -> Expr {
        let mut terms = collected.into_sorted();
        if self.has_exponentials
            && let Some(sum) = self.sum_of_exponentials(&constant, &terms)
        {
            return sum;
        }
        match (terms.len(), constant.is_zero()) {
            (0, _) => return self.number(constant),
            (1, true) => {
                let (term, coefficient) = terms.remove(0);
                return self.scaled(term, coefficient);
            }
            (_, true) => {
                self.work += terms.len();
                let common = self.common_factors(&terms);
                if !common.is_empty() {
                    let outside = self.product(common);
                    let inverse = (outside, -Rational::one());
                    let inner: Vec<(Rational, Expr)> = terms
                        .into_iter()
                        .map(|(term, c)| {
                            (c, self.product([(term, Rational::one()), inverse.clone()]))
                        })
                        .collect();
                    let inside = self.sum(inner);
                    return self.mul(outside, inside);
                }
            }
            _ => {}
        }
        let content = content_of(&constant, &terms);
        let sum = self.intern(Node::Sum {
            constant: constant / &content,
            terms: terms.into_iter().map(|(term, c)| (term, c / &content)).collect(),
        });
        self.scaled(sum, content)
    }

    fn scaled(&mut self, term: Expr, coefficient: Rational) -> Expr {
        if coefficient.is_one() {
            return term;
        }
        self.intern(Node::Sum {
            constant: Rational::zero(),
            terms: Box::new([(term, coefficient)]),
        })
    }

    /// The factors that every term has, to the smallest power that occurs. Powers of zero are none: nothing can be divided by
    /// them.
    fn common_factors(&self, terms: &[(Expr, Rational)]) -> Vec<(Expr, Rational)> {
        // The factors of a term that is no product are itself.
        let single = |term: Expr| [(term, Rational::one())];
        let mut common = match self.node(terms[0].0) {
            Node::Product(factors) => factors.to_vec(),
            _ => single(terms[0].0).to_vec(),
        };
        common.retain(|(base, _)| *base != Graph::ZERO);
        for &(term, _) in &terms[1..] {
            if common.is_empty() {
                break;
            }
            let single = single(term);
            let factors: &[(Expr, Rational)] = match self.node(term) {
                Node::Product(factors) => factors,
                _ => &single,
            };
            common.retain_mut(|(base, exponent)| {
                // Factors are sorted by their bases.
                let Ok(found) = factors.binary_search_by_key(base, |(base, _)| *base) else {
                    return false;
                };
                let other = &factors[found].1;
                if other.is_positive() != exponent.is_positive() {
                    return false;
                }
                if other.abs() < exponent.abs() {
                    *exponent = other.clone();
                }
                true
            });
        }
        common
    }

    /// The product of `base ^ exponent`.
    ///
    /// Zero to a negative power stays in the product, where [`Graph::divides_by_zero`] finds it.
    pub fn product(&mut self, factors: impl IntoIterator<Item = (Expr, Rational)>) -> Expr {
        let mut coefficient = Rational::one();
        let mut collected = Collected::default();
        let mut pending: Numbered = factors.into_iter().collect();
        while let Some((base, exponent)) = pending.pop() {
            self.work += 1;
            if exponent.is_zero() {
                continue;
            }
            if self.open_factor(base, &exponent, &mut coefficient, &mut pending) {
                continue;
            }
            let total = collected.add(base, &exponent);
            // Powers that were out of reach one by one may have become whole together, as in sqrt(a b)^2.
            if !total.is_zero() && total != exponent && total.is_integer() {
                collected.remove(base);
                pending.push((base, total));
            }
        }
        if collected.contains(Graph::ZERO) {
            coefficient = Rational::one();
        } else if coefficient.is_zero() {
            return Graph::ZERO;
        }
        let collected = collected.into_sorted();
        if self.has_exponentials
            && collected.len() > 1
            && let Some((number, factors)) = self.product_of_exponentials(&collected)
        {
            let product = self.product(factors);
            return self.sum([(coefficient * number, product)]);
        }
        let term = match &collected[..] {
            [] => return self.number(coefficient),
            // To the first power nothing is left closed that has a coefficient of its own.
            [(base, exponent)] if exponent.is_one() => *base,
            _ => self.intern(Node::Product(collected.into_boxed_slice())),
        };
        self.scaled(term, coefficient)
    }

    /// Takes `base ^ exponent` apart where that is exact: its factors go to `pending`, numbers into `coefficient`.
    fn open_factor(
        &self,
        base: Expr,
        exponent: &Rational,
        coefficient: &mut Rational,
        pending: &mut Numbered,
    ) -> bool {
        let (number, term) = match self.node(base) {
            Node::Number(value) => (value, None),
            Node::Product(factors) => {
                let simple = factors.len() == 1 && !factors[0].1.is_integer();
                let opens = exponent.is_integer() || simple;
                if opens {
                    pending.extend(factors.iter().map(|(b, e)| (*b, e * exponent)));
                }
                return opens;
            }
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                (&terms[0].1, Some(terms[0].0))
            }
            _ => return false,
        };
        let Some(power) = rational_power(number, exponent) else { return false };
        *coefficient *= power;
        pending.extend(term.map(|term| (term, exponent.clone())));
        true
    }

    /// Whether any part of `expr` is zero to a negative power.
    #[must_use]
    pub fn divides_by_zero(&self, expr: Expr) -> bool {
        // Hardly any graph has such a part at all.
        self.has_powers_of_zero
            && self.reachable(&[expr]).into_iter().any(|e| match self.node(e) {
                Node::Product(factors) => factors.iter().any(|(base, _)| *base == Graph::ZERO),
                _ => false,
            })
    }

    /// `function(arguments)`, simplified at arguments where the value is known.
    pub fn call(&mut self, function: Function, arguments: &[Expr]) -> Expr {
        let x = arguments[0];
        let parity = function.parity();
        if parity != Parity::Neither && self.has_negative_sign(x) {
            let positive = self.neg(x);
            let value = self.call(function, &[positive]);
            return if parity == Parity::Odd { self.neg(value) } else { value };
        }
        if x == Graph::ZERO
            && let Some(value) = function.at_zero()
        {
            return self.number(value.clone());
        }
        match function {
            Function::Sin | Function::Cos => {
                if let Some(value) = self.trigonometric_value(function, x) {
                    return value;
                }
            }
            Function::Ln if x == Graph::ONE => return Graph::ZERO,
            Function::Exp => {
                if let Node::Call(Function::Ln, inner) = self.node(x) {
                    return inner[0];
                }
            }
            Function::Ln if self.logistic(x).is_some() => {
                // `ln(1 + exp(y))` of a `y` far below zero has its digits in the exponential.
                let exponential = self.sub(x, Graph::ONE);
                return self.call(Function::Ln1p, &[exponential]);
            }
            Function::Ln => {
                if let Node::Call(Function::Exp, inner) = self.node(x) {
                    return inner[0];
                }
            }
            _ => {}
        }
        self.intern(Node::Call(function, arguments.into()))
    }

    fn has_negative_sign(&self, expr: Expr) -> bool {
        match self.node(expr) {
            Node::Number(value) => value.is_negative(),
            Node::Sum { constant, terms } => {
                constant.is_zero() && terms.len() == 1 && terms[0].1.is_negative()
            }
            _ => false,
        }
    }

    /// Sine or cosine of a multiple of pi/2.
    fn trigonometric_value(&mut self, function: Function, x: Expr) -> Option<Expr> {
        let pi = self.pi();
        let turns = self.div(x, pi);
        let halves = self.as_number(turns)? * Rational::from(2);
        if !halves.is_integer() {
            return None;
        }
        let quarter = halves.to_integer().mod_floor(&4.into()).to_u8()?;
        let quarter = if function == Function::Cos { (quarter + 1) % 4 } else { quarter };
        Some(self.integer([0, 1, 0, -1][usize::from(quarter)]))
    }

    /// The node of `expr` built anew from what `map` makes of its children.
    pub(crate) fn map_children(
        &mut self,
        expr: Expr,
        map: &mut impl FnMut(&mut Graph, Expr) -> Expr,
    ) -> Expr {
        match self.node(expr).clone() {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => expr,
            Node::Sum { constant, terms } => {
                let mut mapped = vec![(constant, Graph::ONE)];
                for (term, coefficient) in terms {
                    mapped.push((coefficient, map(self, term)));
                }
                self.sum(mapped)
            }
            Node::Product(factors) => {
                let mut mapped = Vec::new();
                for (base, exponent) in factors {
                    mapped.push((map(self, base), exponent));
                }
                self.product(mapped)
            }
            Node::Call(function, arguments) => {
                let mapped: Vec<Expr> = arguments.iter().map(|&a| map(self, a)).collect();
                self.call(function, &mapped)
            }
            Node::Whole(inner) => {
                let mapped = map(self, inner);
                self.whole(mapped)
            }
        }
    }
}

/// Terms of a sum or factors of a product while they are collected: numbers by expression, none of them zero.
#[derive(Default)]
struct Collected {
    /// In order of the expressions, as long as there are few: nearly always.
    few: Numbered,
    many: BTreeMap<Expr, Rational>,
}

/// As many can be moved to make room for one more at little cost.
const FEW: usize = 64;

impl Collected {
    /// Adds to the number of `expr`; what it is now.
    fn add(&mut self, expr: Expr, number: &Rational) -> Rational {
        if self.many.is_empty() {
            match self.few.binary_search_by_key(&expr, |(e, _)| *e) {
                Ok(place) => {
                    let total = &self.few[place].1 + number;
                    if total.is_zero() {
                        self.few.remove(place);
                    } else {
                        self.few[place].1 = total.clone();
                    }
                    return total;
                }
                Err(_) if number.is_zero() => return number.clone(),
                Err(place) if self.few.len() < FEW => {
                    self.few.insert(place, (expr, number.clone()));
                    return number.clone();
                }
                Err(_) => self.many.extend(self.few.drain(..)),
            }
        }
        let entry = self.many.entry(expr).or_insert_with(Rational::zero);
        *entry += number;
        let total = entry.clone();
        if total.is_zero() {
            self.many.remove(&expr);
        }
        total
    }

    fn remove(&mut self, expr: Expr) -> Option<Rational> {
        match self.few.binary_search_by_key(&expr, |(e, _)| *e) {
            Ok(place) => Some(self.few.remove(place).1),
            Err(_) => self.many.remove(&expr),
        }
    }

    fn contains(&self, expr: Expr) -> bool {
        self.few.binary_search_by_key(&expr, |(e, _)| *e).is_ok() || self.many.contains_key(&expr)
    }

    fn keys(&self) -> impl Iterator<Item = Expr> {
        self.few.iter().map(|(e, _)| *e).chain(self.many.keys().copied())
    }

    /// In order of the expressions.
    fn into_sorted(mut self) -> Numbered {
        if !self.many.is_empty() {
            // One of the two is empty.
            self.few.extend(self.many);
        }
        self.few
    }
}

/// `value ^ exponent` where it is rational and of reasonable size.
fn rational_power(value: &Rational, exponent: &Rational) -> Option<Rational> {
    if value.is_zero() && !exponent.is_positive() {
        return None;
    }
    if value.is_one() || exponent.is_one() {
        return Some(value.clone());
    }
    let root = exact_root_or_self(value, exponent)?;
    let power = exponent.numer().to_i32()?;
    let bits = {
        let (numerator, denominator) = root.bits();
        numerator.max(denominator)
    };
    if bits.saturating_sub(1) * u64::from(power.unsigned_abs()) > LARGEST_NUMBER_BITS {
        return None;
    }
    Some(num_traits::Pow::pow(&root, power))
}

fn exact_root_or_self(value: &Rational, exponent: &Rational) -> Option<Rational> {
    if exponent.is_integer() {
        return Some(value.clone());
    }
    exact_root(value, exponent.denom().to_u32()?)
}

/// The greatest number that divides all coefficients, with the sign of the first.
fn content_of(constant: &Rational, terms: &[(Expr, Rational)]) -> Rational {
    let leading_negative =
        if constant.is_zero() { terms[0].1.is_negative() } else { constant.is_negative() };
    let all =
        std::iter::once(constant).chain(terms.iter().map(|(_, c)| c)).filter(|c| !c.is_zero());
    let content = all
        .map(Signed::abs)
        .reduce(|a, b| match (a.small(), b.small()) {
            (Some((a, 1)), Some((b, 1))) => Rational::from(a.gcd(&b)),
            _ => Rational::new(a.numer().gcd(&b.numer()), a.denom().lcm(&b.denom())),
        })
        .unwrap_or_else(Rational::one);
    if leading_negative { -content } else { content }
}
