//! Values modulo a prime, which tell at once that most expressions do not vanish.
//!
//! To [vanish](Graph::vanishes) is to be zero whatever the values of symbols, function values and broken powers, but
//! that `sin^2 + cos^2 = 1` and `sqrt(x)^2 = x`. With values in the integers modulo a prime, chosen without a pattern, an expression that
//! vanishes is zero; one that is not zero there is refuted without rounding. Where it is zero, polynomials decide.

use crate::{Expr, Function, Graph, Node, Rational};
use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive};
use std::hash::{Hash, Hasher};

/// The Mersenne prime `2^61 - 1`.
const PRIME: u64 = (1 << 61) - 1;

/// Choices of values that are tried. One number in two has a root modulo the prime, so that an expression with a few roots has a value for
/// one of some choices.
const CHOICES: usize = 32;

impl Graph {
    /// The value of `expr` modulo the prime, for the first choice of values for which it has one; `None` where something is divided by
    /// zero, or has no root.
    ///
    /// Quantities in one piece are looked into, but not for function values: [`Graph::open`] comes first.
    pub(crate) fn residue(&mut self, expr: Expr) -> Option<u64> {
        (0..CHOICES).find_map(|choice| self.residue_for(choice, expr))
    }

    fn residue_for(&mut self, choice: usize, expr: Expr) -> Option<u64> {
        if let Some(&known) = self.residues.get(&(choice, expr)) {
            return known;
        }
        let residue = self.find_residue(choice, expr);
        self.residues.insert((choice, expr), residue);
        residue
    }

    fn find_residue(&mut self, choice: usize, expr: Expr) -> Option<u64> {
        match self.node(expr).clone() {
            Node::Number(value) => of_number(&value),
            Node::Sum { constant, terms } => {
                let mut sum = of_number(&constant)?;
                for (term, coefficient) in &terms {
                    sum =
                        add(sum, times(of_number(coefficient)?, self.residue_for(choice, *term)?));
                }
                Some(sum)
            }
            Node::Product(factors) => {
                let mut product = 1;
                for (base, exponent) in &factors {
                    let twice = exponent * Rational::from(2);
                    let factor = if exponent.is_integer() {
                        of_power(self.residue_for(choice, *base)?, exponent)?
                    } else if twice.is_integer() {
                        of_power(square_root(self.residue_for(choice, *base)?)?, &twice)?
                    } else {
                        at_random(choice, (base, exponent))
                    };
                    product = times(product, factor);
                }
                Some(product)
            }
            Node::Call(function @ (Function::Sin | Function::Cos), arguments) => {
                // A point of the unit circle.
                let t = at_random(choice, arguments[0]);
                let square = times(t, t);
                let above = match function {
                    Function::Sin => add(t, t),
                    _ => add(1, PRIME - square),
                };
                Some(times(above, inverse(add(1, square))?))
            }
            Node::Pi | Node::Symbol(_) | Node::Call(..) => {
                // A square, so that it has a root.
                let root = at_random(choice, expr);
                Some(times(root, root))
            }
            Node::Whole(inner) => self.residue_for(choice, inner),
        }
    }
}

fn add(a: u64, b: u64) -> u64 {
    let sum = a + b;
    if sum >= PRIME { sum - PRIME } else { sum }
}

fn times(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    // 2^61 = 1 modulo the prime; both parts are below 2^61.
    add(reduced(product as u64 & PRIME), reduced((product >> 61) as u64))
}

/// A number of up to 61 bits modulo the prime.
fn reduced(a: u64) -> u64 {
    if a >= PRIME { a - PRIME } else { a }
}

fn raised(base: u64, mut exponent: u64) -> u64 {
    let (mut power, mut square) = (1, base);
    while exponent > 0 {
        if exponent & 1 == 1 {
            power = times(power, square);
        }
        square = times(square, square);
        exponent >>= 1;
    }
    power
}

/// A root of the number, where it is a square: the prime is three more than a multiple of four.
fn square_root(a: u64) -> Option<u64> {
    let root = raised(a, PRIME.div_ceil(4));
    (times(root, root) == a).then_some(root)
}

/// By Fermat's little theorem.
fn inverse(a: u64) -> Option<u64> {
    (a != 0).then(|| raised(a, PRIME - 2))
}

fn of_power(base: u64, exponent: &Rational) -> Option<u64> {
    let power = raised(base, exponent.abs().to_integer().to_u64()?);
    if exponent.is_negative() { inverse(power) } else { Some(power) }
}

fn of_number(value: &Rational) -> Option<u64> {
    let of_integer = |n: BigInt| n.mod_floor(&PRIME.into()).to_u64();
    match value.small() {
        Some((n, 1)) => Some(n.rem_euclid(PRIME as i64) as u64),
        _ => Some(times(of_integer(value.numer())?, inverse(of_integer(value.denom())?)?)),
    }
}

/// A definite value for `what` in a choice of values, without a pattern.
fn at_random(choice: usize, what: impl Hash) -> u64 {
    let mut hasher = std::hash::DefaultHasher::new();
    (choice, what).hash(&mut hasher);
    reduced(hasher.finish() & PRIME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ast;

    fn residue(text: &str) -> Option<u64> {
        let mut graph = Graph::new();
        let ast = Ast::parse(text).unwrap();
        let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
        graph.residue(expr)
    }

    #[test]
    fn arithmetic_modulo_the_prime() {
        assert_eq!(times(PRIME - 1, PRIME - 1), 1);
        assert_eq!(raised(3, PRIME - 1), 1);
        // Among them products that end in the prime itself, as 2^62 - 1 does.
        let numbers =
            [0, 1, 2, 3, 77_777, (1 << 31) - 1, (1 << 31) + 1, 1 << 60, PRIME - 2, PRIME - 1];
        for a in numbers {
            for b in numbers {
                let wide = |n: u128| u64::try_from(n % u128::from(PRIME)).unwrap();
                assert_eq!(times(a, b), wide(u128::from(a) * u128::from(b)), "{a} {b}");
                assert_eq!(add(a, b), wide(u128::from(a) + u128::from(b)), "{a} {b}");
            }
        }
        assert_eq!(times(12_345, inverse(12_345).unwrap()), 1);
        assert_eq!(inverse(0), None);
        assert_eq!(residue("2305843009213693951"), Some(0));
        assert_eq!(residue("-1"), Some(PRIME - 1));
        assert_eq!(residue("1/2 + 2305843009213693952/4611686018427387904"), residue("1"));
    }

    #[test]
    fn what_vanishes_is_zero() {
        for text in [
            "1/(1 + a/(b + c)) - (b + c)/(b + c + a)",
            "cos(a)^4 - sin(a)^4 - cos(a)^2 + sin(a)^2",
            "(ln(a) + ln(b))^2 - ln(a)^2 - 2*ln(a)*ln(b) - ln(b)^2",
            "(sqrt(a) + sqrt(b))*(sqrt(a) - sqrt(b)) - a + b",
            "1/(sqrt(a) + 1) + 1/sqrt(a)^3 - (sqrt(a)^3 + sqrt(a) + 1)/(a^2 + sqrt(a)^3)",
            "(sqrt(a^2 + b^2) + c)*(sqrt(a^2 + b^2) - c) - a^2 - b^2 + c^2",
        ] {
            assert_eq!(residue(text), Some(0), "{text}");
        }
        assert_eq!(residue("a/((b + c)^2 - b^2 - 2*b*c - c^2)"), None);
        // Roots of sums, for which not every choice of values has a root.
        for (a, b) in [("a", "b"), ("b", "c"), ("c", "d"), ("d", "e"), ("e", "f"), ("f", "g")] {
            let text = format!("sqrt({a}^2 + {b}^2)*(sqrt({a} + 1) + {b})*sqrt({a} + {b} + 2)");
            assert!(residue(&text).is_some_and(|residue| residue != 0), "{text}");
        }
        for text in ["cos(a)^2 + sin(b)^2 - 1", "(a + b)^2 - a^2 - b^2", "sin(a) - sin(b)"] {
            assert_ne!(residue(text), Some(0), "{text}");
        }
    }
}
