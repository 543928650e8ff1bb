//! Sums of two parts that vanish somewhere, in forms that keep their digits next to there.
//!
//! A bump such as `1 - cos(2 Pi X)` has a zero at which its slope is zero too: nothing that its input answers for hides the rounding of the
//! two parts, of which no digit is left. As `2 sin(Pi X)^2` it is a product. So it is with `1 - 1/(1 + X)`, `sqrt(1 + X) - 1` and
//! `cos(a) - cos(b)`.

use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{One, Signed, Zero};
use std::collections::{BTreeMap, BTreeSet};

impl Graph {
    /// `constant + coefficient * term` as a product, where there is one.
    pub(crate) fn constant_and_term(
        &mut self,
        constant: &Rational,
        term: Expr,
        coefficient: &Rational,
    ) -> Option<Expr> {
        if constant.is_zero() || Rule::ConstantAndTerm.is_off() {
            return None;
        }
        let square = self.square_of_half(constant, term, coefficient);
        square.or_else(|| self.difference_to_constant(constant, term, coefficient))
    }

    /// A sum of a constant and several terms, one of which vanishes with the constant somewhere, with these two as a product: a start
    /// from rest, `Y sin(c t) + 1 - cos(c t)`, of which a common factor has been taken out.
    pub(crate) fn constant_among_terms(
        &mut self,
        constant: &Rational,
        terms: &[(Expr, Rational)],
    ) -> Option<Expr> {
        if Rule::ConstantAndTerm.is_off() {
            return None;
        }
        let (place, product) =
            terms.iter().enumerate().find_map(|(place, (term, coefficient))| {
                let is_wave = matches!(self.node(*term), Node::Call(Function::Cos, _));
                let square = || self.square_of_half(constant, *term, coefficient);
                Some((place, is_wave.then(square)??))
            })?;
        let others = terms.iter().enumerate().filter(|(other, _)| *other != place);
        let others = others.map(|(_, (term, coefficient))| (coefficient.clone(), *term));
        let all: Vec<_> = others.chain([(Rational::one(), product)]).collect();
        Some(self.sum(all))
    }

    /// `1 - cos(a) = 2 sin(a/2)^2`, `1 + cos(a) = 2 cos(a/2)^2`, `1 -+ sin(a)`, which are those of `pi/2 - a`, and `1 - cos(a)^2`,
    /// `1 - sin(a)^2`.
    fn square_of_half(
        &mut self,
        constant: &Rational,
        term: Expr,
        coefficient: &Rational,
    ) -> Option<Expr> {
        if coefficient.abs() != constant.abs() {
            return None;
        }
        let is_difference = coefficient.is_negative() != constant.is_negative();
        let (call, is_square) = match self.node(term) {
            Node::Product(factors) => match &**factors {
                [(base, power)] if *power == Rational::from(2) => (*base, true),
                _ => return None,
            },
            _ => (term, false),
        };
        let Node::Call(function @ (Function::Sin | Function::Cos), arguments) = self.node(call)
        else {
            return None;
        };
        let (function, argument) = (*function, arguments[0]);
        let (of_other, other, factor) = if is_square {
            let other = if function == Function::Sin { Function::Cos } else { Function::Sin };
            (argument, is_difference.then_some(other)?, Rational::one())
        } else {
            let half = Rational::new(1.into(), 2.into());
            let half_angle = if function == Function::Sin {
                let pi = self.pi();
                self.sum([(Rational::new(1.into(), 4.into()), pi), (-half, argument)])
            } else {
                self.sum([(half, argument)])
            };
            let of_half = if is_difference { Function::Sin } else { Function::Cos };
            (half_angle, of_half, Rational::from(2))
        };
        let value = self.call(other, &[of_other]);
        let square = self.powi(value, 2);
        Some(self.sum([(factor * constant, square)]))
    }

    /// `sqrt(k + r) - sqrt(k)`, `1/k - 1/(k + r)` and the like, which vanish with the terms of `r`.
    fn difference_to_constant(
        &mut self,
        constant: &Rational,
        term: Expr,
        coefficient: &Rational,
    ) -> Option<Expr> {
        let (value, rest) = self.split_at_constant(term)?;
        let value = self.sum([(constant.clone(), Graph::ONE), (coefficient.clone(), value)]);
        (value == Graph::ZERO).then(|| self.sum([(coefficient.clone(), rest)]))
    }

    /// A power or function of `k + r` with a number `k`, at `r = 0`, and what it is more elsewhere.
    fn split_at_constant(&mut self, term: Expr) -> Option<(Expr, Expr)> {
        let inner = match self.node(term) {
            Node::Product(factors) => match &**factors {
                [(base, _)] => *base,
                _ => return None,
            },
            Node::Call(_, arguments) => match &**arguments {
                [argument] => *argument,
                _ => return None,
            },
            _ => return None,
        };
        let small: BTreeSet<Expr> = match self.node(inner) {
            Node::Sum { constant, terms } if !constant.is_zero() => {
                terms.iter().map(|(term, _)| *term).collect()
            }
            _ => return None,
        };
        Some(self.split_in_parts(term, &small))
    }

    /// `expr` with each sum of two cosines, or of two sines, of `places` whose coefficients are equal but for the sign as a product: it
    /// vanishes where both are equal, or where one is the negative of the other.
    pub fn in_differences(&mut self, expr: Expr, places: &BTreeSet<Expr>) -> Expr {
        if Rule::WavesOfOneSize.is_off() {
            return expr;
        }
        let mut known = BTreeMap::new();
        for sum in self.reachable(&[expr]) {
            if let Some(differences) = self.differences(sum, places) {
                known.insert(sum, differences);
            }
        }
        self.replace(expr, &known)
    }

    fn differences(&mut self, sum: Expr, places: &BTreeSet<Expr>) -> Option<Expr> {
        let Node::Sum { constant, terms } = self.node(sum) else { return None };
        if !constant.is_zero() || terms.len() != 2 {
            return None;
        }
        let mut waves = Vec::new();
        for (term, coefficient) in terms.clone() {
            let factors = match self.node(term) {
                Node::Product(factors) => factors.to_vec(),
                _ => vec![(term, Rational::one())],
            };
            let (of_places, others): (Vec<_>, Vec<_>) =
                factors.into_iter().partition(|(base, _)| self.depends_on(*base, places));
            let [(call, power)] = &*of_places else { return None };
            let Node::Call(function @ (Function::Sin | Function::Cos), arguments) =
                self.node(*call)
            else {
                return None;
            };
            let (function, argument) = (*function, arguments[0]);
            if !power.is_one() {
                return None;
            }
            let others = self.product(others);
            waves.push((function, argument, self.sum([(coefficient, others)])));
        }
        let [(function, first, of_first), (other, second, of_second)] = &*waves else {
            return None;
        };
        let (function, angles, coefficient) = (*function, [*first, *second], *of_first);
        let (sum, difference) =
            (self.add(coefficient, *of_second), self.sub(coefficient, *of_second));
        let is_difference = self.vanishes(sum);
        if *other != function || !(is_difference || self.vanishes(difference)) {
            return None;
        }
        let product = self.product_of_waves(function, is_difference, angles);
        Some(self.mul(coefficient, product))
    }

    /// `cos(a) -+ cos(b)` or `sin(a) -+ sin(b)` as a product, with the angles formed in symbols.
    fn product_of_waves(
        &mut self,
        function: Function,
        is_difference: bool,
        [a, b]: [Expr; 2],
    ) -> Expr {
        let half = Rational::new(1.into(), 2.into());
        let mean = self.sum([(half.clone(), a), (half.clone(), b)]);
        let apart = self.sum([(half.clone(), a), (-half, b)]);
        let OfHalfAngles { of_mean, of_apart, factor } = OfHalfAngles::new(function, is_difference);
        let (of_mean, of_apart) = (self.call(of_mean, &[mean]), self.call(of_apart, &[apart]));
        let product = self.mul(of_mean, of_apart);
        self.sum([(Rational::from(factor), product)])
    }

    /// The sum of two terms as a product, where there is one: `cos(a) -+ cos(b)` and `sin(a) -+ sin(b)`, if `are_alike` says that both are
    /// computed equally often, and `ln(k + r) - ln(k)`.
    pub(crate) fn two_terms(
        &mut self,
        terms: [(Expr, &Rational); 2],
        are_alike: impl FnOnce(&mut Self, [Expr; 2]) -> bool,
    ) -> Option<Expr> {
        if Rule::TwoTerms.is_off() {
            return None;
        }
        let [(first, of_first), (second, of_second)] = terms;
        if of_first.abs() != of_second.abs() {
            return None;
        }
        let is_difference = of_first.is_negative() != of_second.is_negative();
        let (Node::Call(f, a), Node::Call(g, b)) = (self.node(first), self.node(second)) else {
            return None;
        };
        let (f, a, b) = ((f == g).then_some(*f)?, a[0], b[0]);
        if f == Function::Ln && is_difference {
            let of =
                |number: Expr, other: Expr| (self.as_number(number).is_some()).then_some(other);
            let (sum, known, coefficient) = match (of(b, first), of(a, second)) {
                (Some(sum), None) => (sum, second, of_first),
                (None, Some(sum)) => (sum, first, of_second),
                _ => return None,
            };
            let (value, rest) = self.split_at_constant(sum)?;
            return (value == known).then(|| self.sum([(coefficient.clone(), rest)]));
        }
        if !matches!(f, Function::Sin | Function::Cos) || !are_alike(self, [first, second]) {
            return None;
        }
        let product = self.product_of_waves(f, is_difference, [a, b]);
        Some(self.sum([(of_first.clone(), product)]))
    }
}

/// The functions of half the sum and half the difference of two angles whose product is the sum or difference of two waves, and its factor.
struct OfHalfAngles {
    of_mean: Function,
    of_apart: Function,
    factor: i64,
}

impl OfHalfAngles {
    fn new(function: Function, is_difference: bool) -> Self {
        let (of_mean, of_apart, factor) = match (function, is_difference) {
            (Function::Cos, true) => (Function::Sin, Function::Sin, -2),
            (Function::Cos, false) => (Function::Cos, Function::Cos, 2),
            (_, true) => (Function::Cos, Function::Sin, 2),
            (_, false) => (Function::Sin, Function::Cos, 2),
        };
        OfHalfAngles { of_mean, of_apart, factor }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::Ast;

    #[test]
    fn a_constant_goes_with_the_wave_that_it_cancels_against() {
        let mut graph = Graph::new();
        let mut joined = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let sum = graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap();
            let Node::Sum { constant, terms } = graph.node(sum).clone() else { return None };
            let joined = graph.constant_among_terms(&constant, &terms)?;
            Some(graph.print(joined))
        };
        let square = |text: &str| Some(text.to_owned());
        assert_eq!(joined("Y*sin(c*t) + 1 - cos(c*t)"), square("Y*sin(c*t) + 2*sin(c*t/2)^2"));
        assert_eq!(joined("3*Y + 2 + 2*cos(X)"), square("3*Y + 4*cos(X/2)^2"));
        // A sine, and another amplitude, leave nothing to cancel at rest.
        assert_eq!(joined("Y + 1 - sin(X)"), None);
        assert_eq!(joined("Y + 2 - cos(X)"), None);
    }

    #[test]
    fn two_waves_of_one_size_are_a_product() {
        let mut graph = Graph::new();
        let places = ["X", "Y"].map(|name| graph.symbol(name)).into();
        let mut compared = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let waves = graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap();
            let compared = graph.in_differences(waves, &places);
            graph.print(compared)
        };
        assert_eq!(compared("A*cos(X + Y) - A*cos(X - Y)"), "-2*A*sin(X)*sin(Y)");
        assert_eq!(compared("A*sin(X + Y) + A*sin(Y - X)"), "2*A*sin(Y)*cos(X)");
        assert_eq!(compared("2*cos(X) + cos(Y)"), "2*cos(X) + cos(Y)");
        assert_eq!(compared("sin(X) - cos(Y)"), "sin(X) - cos(Y)");
    }
}
