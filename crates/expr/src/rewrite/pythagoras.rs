//! Identical cancellation among sines and cosines: what a rotation within a motion leaves behind.
//!
//! The strain of a motion that turns, `H + H^T + H H^T`, holds terms such as `-4 s^2 + 4 s^4 + 4 s^2 c^2`, which
//! are zero since `s^2 + c^2 = 1`. Computed one by one they leave their rounding errors, which are large next to a
//! small strain. [`Graph::shortened`] multiplies out what contains sines and cosines, and keeps the result where terms
//! cancel and it is the shorter form.

use super::polynomial::{Monomial, add_to, product};
use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{One, Signed, ToPrimitive};
use std::collections::{BTreeMap, BTreeSet};

/// Expressions that would multiply out to more terms than this are left as they are.
const MOST_TERMS: usize = 64;
/// Powers beyond this are not multiplied out.
const LARGEST_POWER: u32 = 8;

/// A polynomial in sines and cosines, with coefficients that are not multiplied out.
type Polynomial = super::polynomial::Polynomial<Expr>;

impl Graph {
    /// `expr` multiplied out in sines and cosines, with `cos^2 = 1 - sin^2`, where terms cancel and the result is
    /// shorter; else `expr` itself.
    ///
    /// Expressions that contain neither the sine nor the cosine of an angle that occurs with both are never multiplied out.
    pub fn shortened(&mut self, expr: Expr) -> Expr {
        if Rule::Shortened.is_off() {
            return expr;
        }
        let (mut sines, mut cosines) = (BTreeSet::new(), BTreeSet::new());
        self.collect_angles(expr, &mut sines, &mut cosines, &mut BTreeSet::new());
        let angles: BTreeSet<Expr> = sines.intersection(&cosines).copied().collect();
        if angles.is_empty() {
            return expr;
        }
        let mut shortening = Shortening { graph: self, angles, turning: BTreeMap::new() };
        let Some(polynomial) = shortening.polynomial(expr) else { return expr };
        let before = polynomial.len();
        let Some(polynomial) = shortening.without_cosine_squares(polynomial) else { return expr };
        // Where little cancels, what is multiplied out only hides the quantities that its parts share.
        if 2 * polynomial.len() > before {
            return expr;
        }
        let candidate = shortening.rebuild(polynomial);
        let size = |graph: &Graph, e| graph.reachable(&[e]).len();
        let shorter = size(self, candidate) < size(self, expr);
        if shorter && self.magnitude(candidate) <= self.magnitude(expr) { candidate } else { expr }
    }

    /// The angles of the sines and cosines of which `expr` is a polynomial.
    fn collect_angles(
        &self,
        expr: Expr,
        sines: &mut BTreeSet<Expr>,
        cosines: &mut BTreeSet<Expr>,
        seen: &mut BTreeSet<Expr>,
    ) {
        if !seen.insert(expr) {
            return;
        }
        match self.node(expr) {
            Node::Call(Function::Sin, arguments) => {
                sines.insert(arguments[0]);
            }
            Node::Call(Function::Cos, arguments) => {
                cosines.insert(arguments[0]);
            }
            Node::Call(..) => {}
            _ => {
                for child in self.children(expr) {
                    self.collect_angles(child, sines, cosines, seen);
                }
            }
        }
    }
}

struct Shortening<'a> {
    graph: &'a mut Graph,
    /// The angles whose sines and cosines are multiplied out.
    angles: BTreeSet<Expr>,
    /// Whether an expression contains one of them, outside of function values.
    turning: BTreeMap<Expr, bool>,
}

impl Shortening<'_> {
    fn turns(&mut self, expr: Expr) -> bool {
        if let Some(&known) = self.turning.get(&expr) {
            return known;
        }
        let turns = match self.graph.node(expr) {
            Node::Call(Function::Sin | Function::Cos, arguments) => {
                self.angles.contains(&arguments[0])
            }
            Node::Call(..) => false,
            _ => {
                let children: Vec<Expr> = self.graph.children(expr).collect();
                children.into_iter().any(|child| self.turns(child))
            }
        };
        self.turning.insert(expr, turns);
        turns
    }

    /// `None` where a sine or cosine is under a quotient or a root, or where it grows too large.
    fn polynomial(&mut self, expr: Expr) -> Option<Polynomial> {
        if !self.turns(expr) {
            return Some(Polynomial::from([(Monomial::new(), expr)]));
        }
        match self.graph.node(expr).clone() {
            Node::Sum { constant, terms } => {
                let mut total = Polynomial::new();
                let constant = self.graph.number(constant);
                add_to(self.graph, &mut total, Monomial::new(), &constant);
                for (term, coefficient) in terms {
                    let coefficient = self.graph.number(coefficient);
                    for (monomial, factor) in self.polynomial(term)? {
                        let factor = self.graph.mul(coefficient, factor);
                        add_to(self.graph, &mut total, monomial, &factor);
                    }
                }
                (total.len() <= MOST_TERMS).then_some(total)
            }
            Node::Product(factors) => {
                let mut total = Polynomial::from([(Monomial::new(), Graph::ONE)]);
                for (base, exponent) in factors {
                    if !self.turns(base) {
                        let power = self.graph.product([(base, exponent)]);
                        total =
                            self.times(&total, &Polynomial::from([(Monomial::new(), power)]))?;
                        continue;
                    }
                    let whole = exponent.is_integer() && exponent.is_positive();
                    let power = exponent.to_integer().to_u32().filter(|&n| n <= LARGEST_POWER);
                    let power = power.filter(|_| whole)?;
                    let factor = self.polynomial(base)?;
                    for _ in 0..power {
                        total = self.times(&total, &factor)?;
                    }
                }
                Some(total)
            }
            Node::Whole(inner) => self.polynomial(inner),
            _ => Some(Polynomial::from([(Monomial::from([(expr, 1)]), Graph::ONE)])),
        }
    }

    fn times(&mut self, a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
        if a.len() * b.len() > 4 * MOST_TERMS {
            return None;
        }
        let product = product(self.graph, a, b);
        (product.len() <= MOST_TERMS).then_some(product)
    }

    fn without_cosine_squares(&mut self, polynomial: Polynomial) -> Option<Polynomial> {
        let mut result = Polynomial::new();
        let mut pending: Vec<(Monomial, Expr)> = polynomial.into_iter().collect();
        while let Some((mut monomial, coefficient)) = pending.pop() {
            if result.len() + pending.len() > 2 * MOST_TERMS {
                return None;
            }
            let Some((cosine, argument)) = self.graph.squared_cosine(&monomial) else {
                add_to(self.graph, &mut result, monomial, &coefficient);
                continue;
            };
            let power = monomial.remove(&cosine).unwrap_or(2) - 2;
            if power > 0 {
                monomial.insert(cosine, power);
            }
            let sine = self.graph.call(Function::Sin, &[argument]);
            let mut with_sine = monomial.clone();
            *with_sine.entry(sine).or_insert(0) += 2;
            let negative = self.graph.neg(coefficient);
            pending.push((monomial, coefficient));
            pending.push((with_sine, negative));
        }
        Some(result)
    }

    fn rebuild(&mut self, polynomial: Polynomial) -> Expr {
        let mut terms = Vec::new();
        for (monomial, coefficient) in polynomial {
            let powers = monomial.into_iter().map(|(e, n)| (e, Rational::from_integer(n.into())));
            let product = self.graph.product(powers.chain([(coefficient, Rational::one())]));
            terms.push(product);
        }
        self.graph.sum_of(terms)
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_TERMS, Monomial, Polynomial, Shortening};
    use crate::{Ast, Expr, Function, Graph, Program};
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    fn build(graph: &mut Graph, text: &str) -> Expr {
        let ast = Ast::parse(text).unwrap();
        graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap()
    }

    /// Limits on terms and powers may be reached and not be passed.
    #[test]
    fn limits_of_multiplying_out() {
        let mut graph = Graph::new();
        let (a, b) = (graph.symbol("a"), graph.symbol("b"));
        let sine = graph.call(Function::Sin, &[a]);
        let cosine = graph.call(Function::Cos, &[a]);
        let other = graph.call(Function::Sin, &[b]);
        let sum = |of: Expr, count: usize| -> Polynomial {
            (1..).map(|n| (Monomial::from([(of, n)]), Graph::ONE)).take(count).collect()
        };
        let angles = BTreeSet::from([a, b]);
        let mut shortening = Shortening { graph: &mut graph, angles, turning: BTreeMap::new() };
        let mut times = |first: Polynomial, second: Polynomial| {
            shortening.times(&first, &second).map(|product| product.len())
        };
        // Pairs of terms, of which many become one, and terms of the product.
        assert_eq!(times(sum(sine, 16), sum(sine, 16)), Some(31));
        assert_eq!(times(sum(sine, 16), sum(sine, 17)), None);
        assert_eq!(times(sum(sine, 8), sum(other, 8)), Some(64));
        assert_eq!(times(sum(sine, 8), sum(other, 9)), None);
        // A square makes one term more while it is looked at, a fourth power three.
        for (power, others, expected) in [
            (2, 2 * MOST_TERMS - 1, Some(2 * MOST_TERMS + 1)),
            (2, 2 * MOST_TERMS, None),
            (4, 2 * MOST_TERMS - 3, Some(2 * MOST_TERMS)),
            (4, 2 * MOST_TERMS - 2, None),
        ] {
            let mut polynomial = sum(other, others);
            polynomial.insert(Monomial::from([(cosine, power)]), Graph::ONE);
            let found = shortening.without_cosine_squares(polynomial);
            assert_eq!(found.map(|p| p.len()), expected, "{power} {others}");
        }
        let mut terms = |text: &str| {
            let expr = build(shortening.graph, text);
            shortening.polynomial(expr).map(|p| p.len())
        };
        assert_eq!(terms("sin(a)^8"), Some(1));
        assert_eq!(terms("sin(a)^9"), None);
        let powers =
            "(sin(a) + sin(a)^2 + sin(a)^3 + sin(a)^4 + sin(a)^5 + sin(a)^6 + sin(a)^7 + sin(a)^8)";
        let others = powers.replace("sin(a)", "cos(b)");
        assert_eq!(terms(&format!("{powers}*{others}")), Some(64));
        assert_eq!(terms(&format!("1 + {powers}*{others}")), None);
    }

    #[test]
    fn shorter_where_terms_cancel() {
        let cases = [
            ("(x*sin(a)+y*cos(a))*cos(a) + (x*cos(a)-y*sin(a))*(-sin(a))", "y"),
            ("((r-1)^2*cos(a) - x)*cos(a) + (r-1)^2*sin(a)^2 + cos(a)*x", "(-1 + r)^2"),
            ("sin(a)*(cos(a)^2 + sin(a)^2)*f", "f*sin(a)"),
            ("cos(a)^2*(sin(a)^2 + cos(a)^2)^3", "1 - sin(a)^2"),
            // A function of a sine is a factor like any other, also below a quotient.
            ("(sin(a)^2 + cos(a)^2)/exp(sin(a))", "1/exp(sin(a))"),
            ("(sin(a)^2 + cos(a)^2)*sqrt(exp(cos(a)))", "sqrt(exp(cos(a)))"),
        ];
        for (text, shorter) in cases {
            let mut graph = Graph::new();
            let (expr, expected) = (build(&mut graph, text), build(&mut graph, shorter));
            let found = graph.shortened(expr);
            assert_eq!(graph.print(found), graph.print(expected), "{text}");
        }
    }

    #[test]
    fn left_alone() {
        // Nothing cancels; another angle; a quotient; nothing to gain.
        let cases = [
            "(x*sin(a)+y*cos(a))^2",
            "cos(a)^2 + sin(b)^2",
            "(sin(a)^2 + cos(a)^2*x)/(1 + sin(a))",
            "1 - sin(a)^2*cos(a)",
            // A root and a quotient of a sine.
            "(sin(a)^2 + cos(a)^2)*sqrt(2 + sin(a))",
            "(sin(a)^2 + cos(a)^2)/(2 + sin(a))",
            // No shorter multiplied out, as 1 and the squares and products of sin(a) and sin(b).
            "(sin(a)^2 + cos(a)^2 - sin(b)/3 + sin(a))^2",
            // Too high a power.
            "(sin(a)^2 + cos(a)^2)*sin(a)^9",
            // Shorter as 1 - sin^2, which has lost its digits near a right angle, where this one is looked at.
            "cos(171*a/100)^2*(sin(171*a/100)^2 + cos(171*a/100)^2)^3",
            // Polynomials in the cosine alone: the sine is within another function.
            "(cos(a)^2 - 1)*exp(sin(a))",
            "(sin(a)^2 - 1)*exp(cos(a))",
        ];
        for text in cases {
            let mut graph = Graph::new();
            let expr = build(&mut graph, text);
            assert_eq!(graph.shortened(expr), expr, "{text}");
        }
    }

    /// Polynomials in sines and cosines of two angles and in other quantities, some of which are functions of a sine or roots.
    fn text() -> impl Strategy<Value = String> {
        let leaf = prop::sample::select(
            &[
                "sin(a)",
                "cos(a)",
                "sin(b)",
                "cos(b)",
                "x",
                "2",
                "exp(sin(a))",
                "(sin(a)^2 + cos(a)^2)",
            ][..],
        );
        leaf.prop_map(str::to_owned).prop_recursive(4, 16, 2, |inner| {
            let pair = (inner.clone(), inner.clone());
            prop_oneof![
                pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a}) - ({b})/3")),
                pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
                pair.prop_map(|(a, b)| format!("({a})*cos(a)*cos(b) + ({b})*sin(a)*sin(b)")),
                (inner.clone(), 2..4_i32).prop_map(|(a, n)| format!("({a})^{n}")),
                inner.clone().prop_map(|a| format!("({a})*cos(a)^2 + ({a})*sin(a)^2")),
                inner.prop_map(|a| format!("sqrt(1 + ({a})^2)")),
            ]
        })
    }

    proptest! {
        #[test]
        fn shorter_forms_have_the_same_value(
            text in text(), x in 0.1..2.0, a in 0.1..1.4, b in -1.4..1.4,
        ) {
            let mut graph = Graph::new();
            let inputs = ["x", "a", "b"].map(|name| (graph.symbol(name), Default::default()));
            let expr = build(&mut graph, &text);
            let short = graph.shortened(expr);
            let program = Program::lower(&mut graph, &inputs, &[], &[expr, short]);
            let found = program.evaluate(&[x, a, b]);
            let allowed = 1e-11 * (1.0 + found[0].abs().powi(2));
            prop_assert!((found[0] - found[1]).abs() <= allowed, "{} as {}", text, graph.print(short));
            let size = |expr| graph.reachable(&[expr]).len();
            prop_assert!(short == expr || size(short) < size(expr), "{} as {}", text, graph.print(short));
        }
    }
}
