//! Expressions of small quantities, such as a stress of a small strain, as their value at zero and the rest.
//!
//! Text says `mu*F - mu/F`; with `F = 1 + H` both terms are large where `H` is small, and their difference has lost
//! its digits. Here each part of an expression is split into its value where the small quantities are zero and a
//! remainder that is formed from the small quantities themselves, so that `mu/F - mu` becomes `-mu H/(1 + H)`. The
//! values at zero then cancel in symbols, and what is computed has no large terms.

use crate::graph::NumberMap;
use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{Signed, ToPrimitive};
use std::collections::BTreeSet;

impl Graph {
    /// `expr` as its value where all of `small` are zero, and a rest that is small with them.
    ///
    /// The two add up to `expr`. Where `expr` has no value at zero, as `ln(x)` at `x = 0`, all of it is the rest.
    pub fn split_at_zero(&mut self, expr: Expr, small: &BTreeSet<Expr>) -> (Expr, Expr) {
        if Rule::SplitAtZero.is_off() {
            let value = self.replace(expr, &small.iter().map(|&s| (s, Graph::ZERO)).collect());
            let has_value = !self.divides_by_zero(value);
            return if has_value { (value, self.sub(expr, value)) } else { (Graph::ZERO, expr) };
        }
        self.split_in_parts(expr, small)
    }

    pub(crate) fn split_in_parts(&mut self, expr: Expr, small: &BTreeSet<Expr>) -> (Expr, Expr) {
        Splitting { graph: self, small, known: NumberMap::default() }.split(expr)
    }
}

struct Splitting<'a> {
    graph: &'a mut Graph,
    small: &'a BTreeSet<Expr>,
    known: NumberMap<Expr, (Expr, Expr)>,
}

impl Splitting<'_> {
    fn split(&mut self, expr: Expr) -> (Expr, Expr) {
        if self.small.contains(&expr) {
            return (Graph::ZERO, expr);
        }
        if let Some(&known) = self.known.get(&expr) {
            return known;
        }
        let (value, rest) = match self.graph.node(expr).clone() {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => (expr, Graph::ZERO),
            Node::Sum { constant, terms } => {
                let mut values = vec![(constant, Graph::ONE)];
                let mut rests = Vec::new();
                for (term, coefficient) in terms {
                    let (value, rest) = self.split(term);
                    values.push((coefficient.clone(), value));
                    rests.push((coefficient, rest));
                }
                (self.graph.sum(values), self.graph.sum(rests))
            }
            Node::Product(factors) => self.product(expr, &factors),
            Node::Call(function, arguments) if function.arity() > 1 => {
                let values: Vec<Expr> = arguments.iter().map(|&a| self.split(a).0).collect();
                self.plain(expr, function, &values)
            }
            Node::Call(function, arguments) => {
                let inner = self.split(arguments[0]);
                self.call(expr, function, inner)
            }
            Node::Whole(inner) => {
                let (value, rest) = self.split(inner);
                (self.graph.whole(value), self.graph.whole(rest))
            }
        };
        // A value at infinity is none.
        let split =
            if self.graph.divides_by_zero(value) { (Graph::ZERO, expr) } else { (value, rest) };
        self.known.insert(expr, split);
        split
    }

    /// `f1 f2 ... - k1 k2 ... = r1 f2 f3 ... + k1 r2 f3 ... + ...` for factors `f = k + r`.
    fn product(&mut self, expr: Expr, factors: &[(Expr, Rational)]) -> (Expr, Expr) {
        let mut parts = Vec::new();
        for (base, exponent) in factors {
            let Some((value, rest)) = self.power(*base, exponent) else {
                return (Graph::ZERO, expr);
            };
            // As it is written, a factor that is zero at zero may be a difference of large terms.
            let factor = match value == Graph::ZERO {
                true => rest,
                false => self.graph.product([(*base, exponent.clone())]),
            };
            parts.push((factor, value, rest));
        }
        // With a factor that is zero at zero in front, only the first of the sum's terms is left.
        parts.sort_by_key(|&(_, value, _)| value != Graph::ZERO);
        let mut terms = Vec::new();
        for i in 0..parts.len() {
            let before = parts[..i].iter().map(|part| part.1);
            let after = parts[i + 1..].iter().map(|part| part.0);
            let factors: Vec<Expr> = before.chain([parts[i].2]).chain(after).collect();
            terms.push(self.graph.product_of(factors));
        }
        let value = self.graph.product_of(parts.iter().map(|part| part.1));
        (value, self.graph.sum_of(terms))
    }

    fn power(&mut self, base: Expr, exponent: &Rational) -> Option<(Expr, Expr)> {
        let (value, rest) = self.split(base);
        if rest == Graph::ZERO {
            // Not `base`: what is small in it may have cancelled.
            return Some((self.graph.product([(value, exponent.clone())]), Graph::ZERO));
        }
        let power = self.graph.product([(base, exponent.clone())]);
        if value == Graph::ZERO {
            // Small to a positive power is small; to a negative one it is infinite.
            let rest = self.graph.product([(rest, exponent.clone())]);
            return exponent.is_positive().then_some((Graph::ZERO, rest));
        }
        let at_zero = self.graph.product([(value, exponent.clone())]);
        // With roots of both, the difference of half powers is one of whole powers.
        let twice = exponent * Rational::from(2);
        let half = Rational::new(1.into(), 2.into());
        let (base, value, rest, whole) = if !exponent.is_integer() && twice.is_integer() {
            let root = self.graph.product([(base, half.clone())]);
            let root_of_value = self.graph.product([(value, half)]);
            let sum = self.graph.add(root, root_of_value);
            (root, root_of_value, self.graph.div(rest, sum), twice)
        } else {
            (base, value, rest, exponent.clone())
        };
        let small_integer = whole.abs().to_integer().to_u32().filter(|&n| n <= 16);
        if let (true, Some(n)) = (whole.is_integer(), small_integer) {
            // f^n - k^n = r (f^(n-1) + f^(n-2) k + ... + k^(n-1))
            let terms: Vec<Expr> = (0..n)
                .map(|m| {
                    let of_base = self.graph.powi(base, i64::from(n - 1 - m));
                    let of_value = self.graph.powi(value, i64::from(m));
                    self.graph.product_of([rest, of_base, of_value])
                })
                .collect();
            let difference = self.graph.sum_of(terms);
            if exponent.is_positive() {
                return Some((at_zero, difference));
            }
            // 1/f^n - 1/k^n = -(f^n - k^n)/(f^n k^n)
            let scaled = self.graph.product_of([difference, power, at_zero]);
            return Some((at_zero, self.graph.neg(scaled)));
        }
        // k^q (exp(q ln(1 + r/k)) - 1)
        let ratio = self.graph.div(rest, value);
        let logarithm = self.graph.call(Function::Ln1p, &[ratio]);
        let scaled = self.graph.sum([(exponent.clone(), logarithm)]);
        let relative = self.graph.call(Function::Expm1, &[scaled]);
        Some((at_zero, self.graph.mul(at_zero, relative)))
    }

    fn call(
        &mut self,
        expr: Expr,
        function: Function,
        (value, rest): (Expr, Expr),
    ) -> (Expr, Expr) {
        let at_zero = self.graph.call(function, &[value]);
        if rest == Graph::ZERO {
            return (at_zero, Graph::ZERO);
        }
        if value == Graph::ZERO && at_zero == Graph::ZERO {
            return (Graph::ZERO, self.graph.call(function, &[rest]));
        }
        match function.difference() {
            Some(rule) => (at_zero, rule.with(self.graph, &[value, rest])),
            None => self.plain(expr, function, &[value]),
        }
    }

    /// The rest as a plain difference, where no better form is known.
    fn plain(&mut self, expr: Expr, function: Function, values: &[Expr]) -> (Expr, Expr) {
        let value = self.graph.call(function, values);
        (value, self.graph.sub(expr, value))
    }
}

#[cfg(test)]
mod tests {
    use crate::{Ast, Graph, Program};
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn split(text: &str) -> (String, String, f64) {
        let mut graph = Graph::new();
        let ast = Ast::parse(text).unwrap();
        let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
        let (h, mu) = (graph.symbol("h"), graph.symbol("mu"));
        let (value, rest) = graph.split_at_zero(expr, &BTreeSet::from([h]));
        // Where h is not small, the two parts add up to what the text says.
        let inputs = [(h, Default::default()), (mu, Default::default())];
        let program = Program::lower(&mut graph, &inputs, &[], &[expr, value, rest]);
        let at = program.evaluate(&[0.3, 1.7]);
        assert!((at[1] + at[2] - at[0]).abs() < 1e-14 * at[0].abs().max(1.0), "{text}: {at:?}");
        (graph.print(value), graph.print(rest), program.evaluate(&[1e-30, 1.7])[2])
    }

    #[test]
    fn values_at_zero_cancel() {
        let cases = [
            ("mu*(1+h) - mu/(1+h)", "0", 3.4e-30),
            ("mu*(1+h)^2 - mu", "0", 3.4e-30),
            ("1/(1+h)^3 - mu", "1 - mu", -3e-30),
            ("(mu+h)^(2/3)/mu^(2/3) - 1", "0", 2.0 / 3.0 / 1.7 * 1e-30),
            ("ln(mu+h) - ln(mu) + h^2", "0", 1e-30 / 1.7),
            ("exp(mu+h)", "exp(mu)", 1.7_f64.exp() * 1e-30),
            ("exp(h^2)-1", "0", 1e-60),
            ("sqrt(4+h)", "2", 0.25e-30),
            ("cos(h) - 1", "0", -0.5e-60),
            ("sin(mu+h) - sin(mu)", "0", 1.7_f64.cos() * 1e-30),
            ("cosh(h) - 1", "0", 0.5e-60),
            ("h/(mu+h)", "0", 1e-30 / 1.7),
            ("tan(mu*(1+h) - mu/(1+h))", "0", 3.4e-30),
            ("arctan(mu*(1+h) - mu/(1+h))", "0", 3.4e-30),
            ("arcsin((mu+h)/mu - 1)", "0", 1e-30 / 1.7),
            ("sinh(mu*(1+h) - mu)", "0", 1.7e-30),
            ("sin(mu*(1+h) - mu)", "0", 1.7e-30),
            ("tanh(h)*exp(mu)/exp(mu+h)", "0", 1e-30),
            ("sinh(mu+h) - sinh(mu)", "0", 1.7_f64.cosh() * 1e-30),
            ("cosh(mu+h) - cosh(mu)", "0", 1.7_f64.sinh() * 1e-30),
            ("cos(mu+h) - cos(mu)", "0", -(1.7_f64.sin()) * 1e-30),
            ("expm1(mu+h) - expm1(mu)", "0", 1.7_f64.exp() * 1e-30),
            ("log1p(mu+h) - log1p(mu)", "0", 1e-30 / 2.7),
            ("1/sqrt(mu+h) - 1/sqrt(mu)", "0", -0.5e-30 / 1.7_f64.powf(1.5)),
            ("(mu+h)^16/mu^16 - 1", "0", 16.0 / 1.7 * 1e-30),
            ("(mu+h)^17/mu^17 - 1", "0", 17.0 / 1.7 * 1e-30),
        ];
        for (text, value, small) in cases {
            let (found, rest, at_small) = split(text);
            assert_eq!(found, value, "{text}");
            assert!((at_small / small - 1.0).abs() < 1e-14, "{text}: {rest} gives {at_small:e}");
        }
    }

    /// With a factor that vanishes with the small quantity the whole product does, and nothing is to be split.
    #[test]
    fn products_that_are_small_stay_as_they_are() {
        for text in ["h*exp(mu+h)", "h/(mu+h)", "sin(h)/(1+h)^2", "mu*h^2*ln(2+h)*cos(h+mu)"] {
            let mut graph = Graph::new();
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            let small = BTreeSet::from([graph.symbol("h")]);
            assert_eq!(graph.split_at_zero(expr, &small), (Graph::ZERO, expr), "{text}");
        }
    }

    fn text() -> impl Strategy<Value = String> {
        let leaf = prop::sample::select(&["h", "mu", "(1 + h)", "(mu + h)", "2"][..])
            .prop_map(str::to_owned);
        leaf.prop_recursive(3, 10, 2, |inner| {
            let pair = (inner.clone(), inner.clone());
            let function = prop::sample::select(
                &["sin", "cos", "sinh", "cosh", "tan", "tanh", "exp", "expm1", "arctan", "arccos"]
                    [..],
            );
            let exponent = prop::sample::select(&["2", "-1", "-3", "1/2", "-5/2", "17"][..]);
            prop_oneof![
                pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a}) - ({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
                pair.prop_map(|(a, b)| format!("atan2({a}, 2 + ({b})^2)")),
                (inner.clone(), function).prop_map(|(a, f)| format!("{f}(({a})/(1 + ({a})^2))")),
                (inner.clone(), exponent).prop_map(|(a, n)| format!("(1/2 + ({a})^2)^({n})")),
                inner.clone().prop_map(|a| format!("ln(1 + ({a})^2)")),
                inner.prop_map(|a| format!("log1p(({a})^2)")),
            ]
        })
    }

    proptest! {
        /// The value does not depend on what is small, the rest is as small, and the two add up to the whole.
        #[test]
        fn values_and_rests(text in text(), at in 0.1..0.5) {
            let mut graph = Graph::new();
            let expr = graph.build(&Ast::parse(&text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap();
            let (h, mu) = (graph.symbol("h"), graph.symbol("mu"));
            let (value, rest) = graph.split_at_zero(expr, &BTreeSet::from([h]));
            prop_assert!(!graph.symbols_in(&[value]).contains(&h), "{}: {}", text, graph.print(value));
            let inputs = [(h, Default::default()), (mu, Default::default())];
            let program = Program::lower(&mut graph, &inputs, &[], &[expr, value, rest]);
            let found = program.evaluate(&[at, 1.7]);
            prop_assume!(found[0].abs() < 1e4);
            // The logarithm of a large number less a larger one has the rounding of these.
            let largest = program.values(&[[at], [1.7]]).iter().fold(0.0, |most: f64, [value]| most.max(value.abs()));
            let allowed = 1e-11 * (1.0 + found[0].abs()) + 8.0 * f64::EPSILON * largest;
            prop_assert!((found[1] + found[2] - found[0]).abs() <= allowed, "{}: {:?}", text, found);
            // So small that no power of another number makes up for it.
            let small = program.evaluate(&[1e-100, 1.7]);
            prop_assert!(small[2].abs() < 1e-3 * (1.0 + small[1].abs()), "{}: {:?}", text, small);
        }
    }

    /// Each of the two parts is as small as `h`, and so their difference is zero.
    #[test]
    fn what_cancels_is_not_in_the_value() {
        for text in ["(log1p(h^2) - ln(1 + h^2))^2", "cos(log1p(h^2) - ln(1 + h^2))"] {
            let (value, rest, _) = split(text);
            assert!(!value.contains("h^2") && rest == "0", "{text}: {value}, {rest}");
        }
    }

    #[test]
    fn no_value_at_zero() {
        assert_eq!(split("1/h + mu").0, "mu");
        assert_eq!(split("sqrt(h)").0, "0");
        assert_eq!(
            split("arccos(h)*mu").1,
            "mu*(arccos(h) - 1/2*Pi)".replace("1/2*Pi", "arccos(0)")
        );
    }
}
