//! Polynomials in expressions.

use crate::{Expr, Graph, Rational};
use num_traits::Zero;
use std::collections::BTreeMap;

/// A product of expressions, each to a positive power.
pub(super) type Monomial = BTreeMap<Expr, u32>;

/// A sum of monomials, each with a coefficient that is not zero.
pub(super) type Polynomial<C> = BTreeMap<Monomial, C>;

/// Type and arithmetic of coefficients.
pub(super) trait Coefficients {
    type Value: Clone;

    fn sum(&mut self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    fn product(&mut self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    fn is_zero(&self, value: &Self::Value) -> bool;
}

/// Coefficients that are expressions of the graph, and are not multiplied out.
impl Coefficients for Graph {
    type Value = Expr;

    fn sum(&mut self, a: &Expr, b: &Expr) -> Expr {
        self.add(*a, *b)
    }

    fn product(&mut self, a: &Expr, b: &Expr) -> Expr {
        self.mul(*a, *b)
    }

    fn is_zero(&self, value: &Expr) -> bool {
        *value == Graph::ZERO
    }
}

/// Coefficients that are numbers.
pub(super) struct Numbers;

impl Coefficients for Numbers {
    type Value = Rational;

    fn sum(&mut self, a: &Rational, b: &Rational) -> Rational {
        a + b
    }

    fn product(&mut self, a: &Rational, b: &Rational) -> Rational {
        a * b
    }

    fn is_zero(&self, value: &Rational) -> bool {
        value.is_zero()
    }
}

/// Adds a term.
pub(super) fn add_to<R: Coefficients>(
    coefficients: &mut R,
    polynomial: &mut Polynomial<R::Value>,
    monomial: Monomial,
    coefficient: &R::Value,
) {
    let total = match polynomial.remove(&monomial) {
        Some(present) => coefficients.sum(&present, coefficient),
        None => coefficient.clone(),
    };
    if !coefficients.is_zero(&total) {
        polynomial.insert(monomial, total);
    }
}

pub(super) fn product_of_monomials(a: &Monomial, b: &Monomial) -> Monomial {
    let mut product = a.clone();
    for (&factor, &power) in b {
        *product.entry(factor).or_insert(0) += power;
    }
    product
}

/// The product, with like terms joined.
pub(super) fn product<R: Coefficients>(
    coefficients: &mut R,
    a: &Polynomial<R::Value>,
    b: &Polynomial<R::Value>,
) -> Polynomial<R::Value> {
    let mut product = Polynomial::new();
    for (m, c) in a {
        for (n, d) in b {
            let coefficient = coefficients.product(c, d);
            add_to(coefficients, &mut product, product_of_monomials(m, n), &coefficient);
        }
    }
    product
}
