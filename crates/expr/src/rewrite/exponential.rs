//! Exponential and hyperbolic functions in sums and products, in forms that keep digits and do not overflow.
//!
//! Text has fronts such as `1/(1 + exp(-x))` and `1 - tanh(x)`, and derivatives have `exp(x)/(1 + exp(x))^2`: at one side
//! of a front these are differences of nearly equal numbers, or quotients of numbers that overflow, where their value is
//! harmless. With the logistic function in both directions, `1/(1 + exp(x))` and `1/(1 + exp(-x))`, and with `tanh`, `cosh`,
//! `sinh` and `expm1`, neither happens. Exponentials of different arguments stay apart, as what depends on place does from
//! what depends on time.

use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{One, Signed, ToPrimitive, Zero};

/// A factor of a product by what it is of exponentials: all have a direction, which the argument is a multiple of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// `exp(y)`.
    Exp,
    /// `1 + exp(y)`.
    Logistic,
    Sinh,
    Cosh,
    Tanh,
}

/// A factor `kind(scale direction)^power`.
struct Factor {
    place: usize,
    kind: Kind,
    scale: Rational,
    direction: Expr,
    power: Rational,
}

/// Exchange of parts of two factors for another factor, with the number that multiplies it.
struct Exchange {
    /// How much of the power of each of the two goes.
    taken: [Rational; 2],
    number: Rational,
    /// The kind of what comes instead, with the scale of its argument and its power.
    instead: Option<(Kind, Rational, Rational)>,
}

impl Graph {
    /// `constant + sum of coefficient * term` in a form of exponential functions that keeps digits; `None` where there is none.
    pub(crate) fn sum_of_exponentials(
        &mut self,
        constant: &Rational,
        terms: &[(Expr, Rational)],
    ) -> Option<Expr> {
        if Rule::Exponentials.is_off() {
            return None;
        }
        match terms {
            [(term, coefficient)] if !constant.is_zero() => {
                let ratio = coefficient / constant;
                let (expr, number) = self.constant_and_exponential(*term, &ratio)?;
                Some(self.sum([(number * constant, expr)]))
            }
            [(first, of_first), (second, of_second)] if constant.is_zero() => {
                if of_first.abs() != of_second.abs() {
                    return None;
                }
                let opposed = of_first != of_second;
                let (expr, number) = self.two_exponentials(*first, *second, opposed)?;
                Some(self.sum([(number * of_first, expr)]))
            }
            _ => None,
        }
    }

    /// `1 + ratio * term` as a multiple of an expression.
    fn constant_and_exponential(
        &mut self,
        term: Expr,
        ratio: &Rational,
    ) -> Option<(Expr, Rational)> {
        let (one, two) = (Rational::one(), Rational::from(2));
        if !ratio.abs().is_one() && *ratio != -two.clone() {
            return None;
        }
        let falls = ratio.is_negative();
        if let Some(argument) = self.exponent(term) {
            // `1 - exp(x)`.
            return (*ratio == -one.clone())
                .then(|| (self.call(Function::Expm1, &[argument]), -one));
        }
        let (base, power) = match self.node(term) {
            Node::Product(factors) => match &**factors {
                [(base, power)] => {
                    (*base, power.to_integer().to_i64().filter(|_| power.is_integer())?)
                }
                _ => return None,
            },
            Node::Call(..) => (term, 1),
            _ => return None,
        };
        if let Some(argument) = self.logistic(base) {
            // `1 - 1/(1 + exp(x))` and `1 - 2/(1 + exp(x))`.
            return match (power, *ratio == -one.clone(), *ratio == -two) {
                (-1, true, _) => {
                    let argument = self.neg(argument);
                    Some((self.logistic_power(argument, -one.clone()), one))
                }
                (-1, _, true) => {
                    let half = self.sum([(Rational::new(1.into(), 2.into()), argument)]);
                    Some((self.call(Function::Tanh, &[half]), one))
                }
                _ => None,
            };
        }
        let Node::Call(function, arguments) = self.node(base) else { return None };
        let (function, argument) = (*function, arguments[0]);
        if !ratio.abs().is_one() {
            return None;
        }
        let square = |graph: &mut Graph, function, argument, power| {
            let value = graph.call(function, &[argument]);
            graph.powi(value, power)
        };
        Some(match (function, power, falls) {
            (Function::Tanh, 1, _) => {
                let sign = if falls { two.clone() } else { -two.clone() };
                let argument = self.sum([(sign, argument)]);
                (self.logistic_power(argument, -one), two)
            }
            (Function::Expm1, 1, false) => (self.call(Function::Exp, &[argument]), one),
            (Function::Cosh, 1, true) => {
                let half = self.sum([(Rational::new(1.into(), 2.into()), argument)]);
                (square(self, Function::Sinh, half, 2), -two)
            }
            (Function::Tanh, 2, true) => (square(self, Function::Cosh, argument, -2), one),
            (Function::Cosh, 2, true) => (square(self, Function::Sinh, argument, 2), -one),
            (Function::Cosh, -2, true) => (square(self, Function::Tanh, argument, 2), one),
            (Function::Sinh, 2, false) => (square(self, Function::Cosh, argument, 2), one),
            _ => return None,
        })
    }

    /// The sum of two terms, or with `opposed` their difference, as a multiple of an expression.
    fn two_exponentials(
        &mut self,
        first: Expr,
        second: Expr,
        opposed: bool,
    ) -> Option<(Expr, Rational)> {
        let are_opposite = |graph: &mut Graph, a, b| graph.add(a, b) == Graph::ZERO;
        if let (Some(a), Some(b)) = (self.exponent(first), self.exponent(second)) {
            let function = if opposed { Function::Sinh } else { Function::Cosh };
            return are_opposite(self, a, b)
                .then(|| (self.call(function, &[a]), Rational::from(2)));
        }
        let inverse_of_logistic = |graph: &mut Graph, term: Expr| match graph.node(term) {
            Node::Product(factors) => match &**factors {
                [(base, power)] if *power == -Rational::one() => {
                    let base = *base;
                    graph.logistic(base)
                }
                _ => None,
            },
            _ => None,
        };
        let (a, b) = (inverse_of_logistic(self, first)?, inverse_of_logistic(self, second)?);
        if !are_opposite(self, a, b) {
            return None;
        }
        if !opposed {
            return Some((Graph::ONE, Rational::one()));
        }
        let half = self.sum([(Rational::new(1.into(), 2.into()), a)]);
        Some((self.call(Function::Tanh, &[half]), -Rational::one()))
    }

    /// A product of exponential functions in a form that neither overflows nor cancels: a number and factors.
    ///
    /// `None` where there is nothing to change. The factors may have to be looked at again.
    pub(crate) fn product_of_exponentials(
        &mut self,
        factors: &[(Expr, Rational)],
    ) -> Option<(Rational, Vec<(Expr, Rational)>)> {
        if Rule::Exponentials.is_off() {
            return None;
        }
        let known: Vec<Factor> = factors
            .iter()
            .enumerate()
            .filter_map(|(place, (base, power))| self.factor(place, *base, power))
            .collect();
        for (n, first) in known.iter().enumerate() {
            for second in &known[n + 1..] {
                if first.direction != second.direction {
                    continue;
                }
                let exchanged = exchange(first, second)
                    .map(|found| (found, [first, second]))
                    .or_else(|| exchange(second, first).map(|found| (found, [second, first])));
                let Some((Exchange { taken, number, instead }, pair)) = exchanged else { continue };
                let mut left = factors.to_vec();
                for (factor, taken) in pair.iter().zip(taken) {
                    let power = &mut left[factor.place].1;
                    *power -= taken;
                    if factor.kind == Kind::Exp && !power.is_integer() {
                        let scale = std::mem::take(power) * &factor.scale;
                        let argument = self.sum([(scale, factor.direction)]);
                        left.push((self.call(Function::Exp, &[argument]), Rational::one()));
                    }
                }
                if let Some((kind, scale, power)) = instead {
                    let argument = self.sum([(scale, first.direction)]);
                    left.push((self.of_kind(kind, argument), power));
                }
                return Some((number, left));
            }
        }
        None
    }

    fn of_kind(&mut self, kind: Kind, argument: Expr) -> Expr {
        let function = match kind {
            Kind::Exp => Function::Exp,
            Kind::Logistic => return self.logistic_power(argument, Rational::one()),
            Kind::Sinh => Function::Sinh,
            Kind::Cosh => Function::Cosh,
            Kind::Tanh => Function::Tanh,
        };
        self.call(function, &[argument])
    }

    fn factor(&mut self, place: usize, base: Expr, power: &Rational) -> Option<Factor> {
        let (kind, argument) = match self.node(base) {
            Node::Call(function, arguments) => {
                let kind = match function {
                    Function::Exp => Kind::Exp,
                    Function::Sinh => Kind::Sinh,
                    Function::Cosh => Kind::Cosh,
                    _ => return None,
                };
                (kind, arguments[0])
            }
            Node::Sum { .. } => (Kind::Logistic, self.logistic(base)?),
            _ => return None,
        };
        let (scale, direction) = match self.node(argument) {
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                (terms[0].1.clone(), terms[0].0)
            }
            _ => (Rational::one(), argument),
        };
        Some(Factor { place, kind, scale, direction, power: power.clone() })
    }

    /// The argument, where the expression is an exponential or a power of one.
    fn exponent(&mut self, expr: Expr) -> Option<Expr> {
        match self.node(expr) {
            Node::Call(Function::Exp, arguments) => Some(arguments[0]),
            Node::Product(factors) => match &**factors {
                [(base, power)] => match self.node(*base) {
                    Node::Call(Function::Exp, arguments) => {
                        let (argument, power) = (arguments[0], power.clone());
                        Some(self.sum([(power, argument)]))
                    }
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        }
    }

    /// `x` where the expression is `1 + exp(x)`.
    pub(crate) fn logistic(&mut self, expr: Expr) -> Option<Expr> {
        let Node::Sum { constant, terms } = self.node(expr) else { return None };
        let [(term, coefficient)] = &**terms else { return None };
        if !constant.is_one() || !coefficient.is_one() {
            return None;
        }
        let term = *term;
        self.exponent(term)
    }

    /// `(1 + exp(argument))^power`.
    fn logistic_power(&mut self, argument: Expr, power: Rational) -> Expr {
        let exponential = self.call(Function::Exp, &[argument]);
        let sum = self.add(Graph::ONE, exponential);
        self.product([(sum, power)])
    }
}

/// The exchange of two factors of one direction, in this order.
fn exchange(first: &Factor, second: &Factor) -> Option<Exchange> {
    let (p, q) = (&first.power, &second.power);
    // The argument of the first as a multiple of that of the second.
    let ratio = &first.scale / &second.scale;
    let least = if p.abs() < q.abs() { p.abs() } else { q.abs() };
    let with_sign =
        |size: &Rational, of: &Rational| if of.is_negative() { -size } else { size.clone() };
    // A whole power of the first, beside one of the second of the same argument that multiplies or divides.
    let is_whole = |multiplies: bool| {
        ratio.is_one()
            && p.is_positive()
            && q.is_positive() == multiplies
            && p.is_integer()
            && q.is_integer()
    };
    // One function for both, of which the second loses the power `of_second`.
    let into = |kind: Kind, scale: Rational, of_second: Rational| {
        Some(Exchange {
            taken: [least.clone(), of_second],
            number: Rational::one(),
            instead: Some((kind, scale, least.clone())),
        })
    };
    let power_of_two = |exponent: &Rational| {
        let whole = exponent.is_integer().then(|| exponent.to_integer().to_i32()).flatten()?;
        (whole.abs() <= 64).then(|| num_traits::Pow::pow(&Rational::from(2), whole))
    };
    match (first.kind, second.kind) {
        (Kind::Exp, Kind::Exp) => Some(Exchange {
            taken: [p.clone(), q.clone()],
            number: Rational::one(),
            instead: Some((Kind::Exp, &first.scale * p + &second.scale * q, Rational::one())),
        }),
        // exp(m x) (1 + exp(x))^-m = (1 + exp(-x))^-m, and the inverse.
        (Kind::Exp, Kind::Logistic) => {
            let power = p * &ratio;
            if power.is_negative() == q.is_negative() {
                return None;
            }
            let size = if power.abs() < q.abs() { power.abs() } else { q.abs() };
            let taken = with_sign(&size, q);
            Some(Exchange {
                taken: [-&taken / &ratio, taken.clone()],
                number: Rational::one(),
                instead: Some((Kind::Logistic, -&second.scale, taken)),
            })
        }
        // (1 + exp(x)) (1 + exp(-x)) = 4 cosh(x/2)^2.
        (Kind::Logistic, Kind::Logistic)
            if ratio == -Rational::one() && p.is_negative() == q.is_negative() =>
        {
            let taken = with_sign(&least, p);
            let twice = &taken * Rational::from(2);
            Some(Exchange {
                number: power_of_two(&twice)?,
                taken: [taken.clone(), taken],
                instead: Some((Kind::Cosh, &second.scale / Rational::from(2), twice)),
            })
        }
        // exp(m x) cosh(x)^-m = 2^m (1 + exp(-2 x))^-m, and exp(m x) cosh(x)^m = 2^-m (1 + exp(2 x))^m.
        (Kind::Exp, Kind::Cosh) => {
            let power = p * &ratio;
            let size = if power.abs() < q.abs() { power.abs() } else { q.abs() };
            let (of_exp, of_cosh) = (with_sign(&size, &power), with_sign(&size, q));
            let sign = if power.is_negative() == q.is_negative() { 1 } else { -1 };
            Some(Exchange {
                number: power_of_two(&-&of_cosh)?,
                taken: [of_exp / &ratio, of_cosh.clone()],
                instead: Some((Kind::Logistic, &second.scale * Rational::from(2 * sign), of_cosh)),
            })
        }
        (Kind::Sinh, Kind::Cosh) if is_whole(false) => {
            into(Kind::Tanh, second.scale.clone(), -&least)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Program};

    fn build(graph: &mut Graph, text: &str) -> Expr {
        graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
    }

    fn value(text: &str, x: f64) -> f64 {
        let mut graph = Graph::new();
        let (symbol, expr) = (graph.symbol("x"), build(&mut graph, text));
        let inputs = [(symbol, Default::default())];
        Program::lower(&mut graph, &inputs, &[], &[expr]).evaluate(&[x])[0]
    }

    /// Each text is the same expression as the other, and has its value far away on both sides.
    #[test]
    fn fronts_have_one_form() {
        for (text, same) in [
            ("1 - tanh(x)", "2/(1 + exp(2*x))"),
            ("3 + 3*tanh(x)", "6/(1 + exp(-2*x))"),
            ("1 - 1/(1 + exp(-x))", "1/(1 + exp(x))"),
            ("1 - 2/(1 + exp(x))", "tanh(x/2)"),
            ("exp(x)/(1 + exp(x))^2", "1/(4*cosh(x/2)^2)"),
            ("exp(x)/(1 + exp(2*x))", "1/(2*cosh(x))"),
            ("exp(x)/(1 + exp(x)^2)", "1/(2*cosh(x))"),
            ("exp(5*x)/(1 + exp(x))^3", "exp(2*x)/(1 + exp(-x))^3"),
            ("exp(-x)*(1 + exp(x))", "1 + exp(-x)"),
            ("(exp(x) - exp(-x))/(exp(x) + exp(-x))", "tanh(x)"),
            ("sinh(x)^2/cosh(x)^3", "tanh(x)^2/cosh(x)"),
            ("exp(x)/cosh(x)", "2/(1 + exp(-2*x))"),
            ("exp(-x)/cosh(x)^2", "2/((1 + exp(2*x))*cosh(x))"),
            ("exp(-x)*cosh(x)", "(1 + exp(-2*x))/2"),
            ("exp(2*x)*cosh(x)", "exp(x)*(1 + exp(2*x))/2"),
            ("exp(3*x)*exp(-2*x)", "exp(x)"),
            ("exp(3*x)*exp(-3*x)", "1"),
            ("1 - tanh(x)^2", "cosh(x)^(-2)"),
            ("cosh(x)^2 - 1", "sinh(x)^2"),
            ("2*sinh(x)^2 + 2", "2*cosh(x)^2"),
            ("1 - 1/cosh(x)^2", "tanh(x)^2"),
            ("cosh(x) - 1", "2*sinh(x/2)^2"),
            ("1/(1 + exp(x)) + 1/(1 + exp(-x))", "1"),
            ("1/(1 + exp(x)) - 1/(1 + exp(-x))", "-tanh(x/2)"),
            ("expm1(x) + 1", "exp(x)"),
        ] {
            let mut graph = Graph::new();
            let [found, expected] = [text, same].map(|text| build(&mut graph, text));
            assert_eq!(graph.print(found), graph.print(expected), "{text}");
            // Written out, so that no form is changed on the way.
            let difference = graph.sub(found, expected);
            assert!(graph.vanishes(difference), "{text}");
        }
    }

    /// Values from 40 digits (mpmath).
    #[test]
    fn values_keep_their_digits() {
        for (text, x, exact) in VALUES {
            let error = ((value(text, x) - exact) / exact).abs();
            assert!(error <= 4.0 * f64::EPSILON, "{text} at {x}: off by {error}");
        }
    }

    #[test]
    fn other_sums_and_products_stay() {
        for text in [
            "1 + 2*tanh(x)",
            "2 - cosh(x)",
            "1 + cosh(x)",
            "exp(x)*exp(y)",
            "exp(x)/(1 + exp(y))",
            "exp(x) + exp(2*x)",
            "exp(x)/(2 + exp(x))",
            "1 - tanh(x)^3",
            "sinh(x)/cosh(y)",
            "exp(x)*(1 + exp(x))",
        ] {
            let mut graph = Graph::new();
            let expr = build(&mut graph, text);
            let terms: Vec<Expr> = match graph.node(expr).clone() {
                Node::Sum { terms, .. } => terms.iter().map(|(term, _)| *term).collect(),
                Node::Product(factors) => factors.iter().map(|(base, _)| *base).collect(),
                _ => Vec::new(),
            };
            assert!(!terms.is_empty(), "{text}: {}", graph.print(expr));
        }
    }

    const VALUES: [(&str, f64, f64); 14] = [
        ("1 - tanh(x)", 20.3, 4.663092499107186e-18),
        ("1 + tanh(x)", -15.7, 4.615122827652358e-14),
        ("exp(x)/(1+exp(x))", 800.0, 1.0),
        ("exp(2*x)/(1 + exp(x))^2/exp(x)", 500.0, 7.124576406741286e-218),
        ("exp(x)/(1 + exp(2*x))", 400.0, 1.9151695967140057e-174),
        ("ln(1 + exp(x))", 900.0, 900.0),
        ("ln(1 + exp(x))", -50.25, 1.5021118919431522e-22),
        ("log1p(exp(x))", 0.75, 1.1368710061148999),
        ("exp(x) - 1", 1e-12, 1.0000000000005e-12),
        ("cosh(x) - 1", 1e-09, 5e-19),
        ("sinh(x)/cosh(x)", 1000.0, 1.0),
        ("exp(-x)*cosh(x)", 750.0, 0.5),
        ("(exp(x) - 1)/(1 + exp(x))", 1e-08, 5e-09),
        ("1 - 1/cosh(x)^2", 1e-07, 9.999999999999932e-15),
    ];
}
