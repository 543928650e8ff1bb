//! Functions of sums, without the rounding of the sum.
//!
//! `sin(3 X + Y)` far from the origin is as wrong as its argument: for `X` near 1e8 by 1e-8, whatever the sine does. Where
//! a field depends on `X` by several such functions, its answers to `X` by way of each may cancel, so that the field
//! as a whole answers to `X` little, and then the rounding of one argument is far more than that of the inputs may
//! cause. So the sum `a` is formed together with what rounding took from it, `e`, by error-free transformations, and the
//! function is `f(a) + e (f'(a) + e f''(a)/2)`.

use super::{Dependence, Lowering, Operation, Slot};
use crate::{Expr, Function, Node, Rational, nearest_f64};
use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};

/// A term: whether it is taken away, and its value.
type Term = (bool, Slot);

/// A sum of more parts, sums within it counted anew wherever they occur, is left as it is.
const MOST_VISITED: usize = 100;

/// A constant and inputs, with what they depend on, their index and their coefficient.
#[derive(Default)]
struct Collected {
    constant: Rational,
    inputs: Vec<(Dependence, usize, Rational)>,
    /// The nodes that have been looked at.
    visited: usize,
}

impl Lowering<'_> {
    /// `function` of `argument`, of `Pi argument` where that is `in_turns`.
    pub(super) fn applied(&mut self, function: Function, argument: Expr, in_turns: bool) -> Slot {
        let call = |function: Function, slot: Slot| match function {
            Function::Sin if in_turns => Operation::SinPi(slot),
            Function::Cos if in_turns => Operation::CosPi(slot),
            _ => Operation::Call(function, slot),
        };
        // The function that the derivative is up to its sign, whether that sign is minus, and whether the second
        // derivative is minus the function.
        let derivative = match function {
            Function::Sin => Some((Function::Cos, false, true)),
            Function::Cos => Some((Function::Sin, true, true)),
            Function::Sinh => Some((Function::Cosh, false, false)),
            Function::Cosh => Some((Function::Sinh, false, false)),
            Function::Exp => Some((Function::Exp, false, false)),
            _ => None,
        };
        let corrected = derivative.and_then(|d| Some((d, self.with_lost_part(argument)?)));
        let Some(((slope, falls, turns_back), (total, lost))) = corrected else {
            let argument = self.lower(argument);
            return self.push(call(function, argument));
        };
        let value = self.push(call(function, total));
        let slope = self.push(call(slope, total));
        let lost = if in_turns {
            let pi = self.push(Operation::Pi);
            self.push(Operation::Mul(pi, lost))
        } else {
            lost
        };
        let half = self.push(Operation::Number(Rational::new(1.into(), 2.into())));
        let half = self.push(Operation::Mul(half, lost));
        let second = self.push(Operation::Mul(half, value));
        // With f' = -g the correction is -e (g - e f''/2).
        let slope = self.push(if falls != turns_back {
            Operation::Sub(slope, second)
        } else {
            Operation::Add(slope, second)
        });
        let correction = self.push(Operation::Mul(lost, slope));
        self.push(if falls {
            Operation::Sub(value, correction)
        } else {
            Operation::Add(value, correction)
        })
    }

    /// The sum of inputs with rational coefficients that `argument` is, rounded, and what rounding took from it.
    ///
    /// `None` where `argument` is no such sum, where nothing is rounded, and where it depends on both place and time: there
    /// the correction would be done in the innermost loop.
    fn with_lost_part(&mut self, argument: Expr) -> Option<(Slot, Slot)> {
        let mut collected = Collected::default();
        self.collect(argument, &Rational::one(), &mut collected)?;
        let Collected { constant, mut inputs, .. } = collected;
        inputs.retain(|(.., coefficient)| !coefficient.is_zero());
        let rate = inputs.iter().fold(Dependence::default(), |rate, (d, ..)| rate.join(*d));
        let finite = |number: &Rational| nearest_f64(number).is_finite();
        let in_range = finite(&constant) && inputs.iter().all(|(.., number)| finite(number));
        if inputs.is_empty() || !in_range || (rate.position && rate.time) {
            return None;
        }
        // What changes rarely first.
        inputs.sort_by_key(|(dependence, ..)| *dependence);
        let mut lost: Vec<Term> = Vec::new();
        let mut parts: Vec<Term> = Vec::new();
        if !constant.is_zero() {
            let (negative, size) = (constant.is_negative(), constant.abs());
            if let Some((below, rest)) = rest_of(&size) {
                let rest = self.push(Operation::Number(rest));
                lost.push((negative != below, rest));
            }
            parts.push((negative, self.push(Operation::Number(size))));
        }
        for (_, index, coefficient) in inputs {
            let (negative, size) = (coefficient.is_negative(), coefficient.abs());
            let input = self.push(Operation::Input(index));
            if size.is_one() {
                parts.push((negative, input));
                continue;
            }
            if let Some((below, rest)) = rest_of(&size) {
                let rest = self.push(Operation::Number(rest));
                lost.push((negative != below, self.push(Operation::Mul(rest, input))));
            }
            let power_of_two = is_power_of_two(&size);
            let size = self.push(Operation::Number(size));
            if !power_of_two {
                lost.push((negative, self.push(Operation::ProductError(size, input))));
            }
            parts.push((negative, self.push(Operation::Mul(size, input))));
        }
        let mut parts = parts.into_iter();
        let (negative, first) = parts.next()?;
        let mut total = self.with_sign(negative, first);
        for (negative, part) in parts {
            let signed = self.with_sign(negative, part);
            lost.push((false, self.push(Operation::SumError(total, signed))));
            total = self.push(if negative {
                Operation::Sub(total, part)
            } else {
                Operation::Add(total, part)
            });
        }
        if lost.is_empty() {
            return None;
        }
        let (negative, lost) = self.add(lost);
        Some((total, self.with_sign(negative, lost)))
    }

    /// Adds `factor * expr`; `None` where it is no such sum. The canonical form takes out common factors, so that sums
    /// stand within sums.
    fn collect(&self, expr: Expr, factor: &Rational, sum: &mut Collected) -> Option<()> {
        sum.visited += 1;
        if sum.visited > MOST_VISITED {
            return None;
        }
        match self.graph.node(expr) {
            Node::Symbol(_) => {
                let defined = self.definitions.iter().any(|(symbol, _)| *symbol == expr);
                let known = self.inputs.iter().position(|(symbol, _)| *symbol == expr);
                let index = known.filter(|_| !defined)?;
                match sum.inputs.iter_mut().find(|(_, place, _)| *place == index) {
                    Some((.., coefficient)) => *coefficient += factor,
                    None => sum.inputs.push((self.inputs[index].1, index, factor.clone())),
                }
            }
            Node::Sum { constant, terms } => {
                sum.constant += factor * constant;
                for (term, coefficient) in terms {
                    self.collect(*term, &(factor * coefficient), sum)?;
                }
            }
            Node::Whole(inner) => self.collect(*inner, factor, sum)?,
            // Of a sum no term is a number, and a number alone is no sum of inputs.
            Node::Number(_) | Node::Pi | Node::Product(_) | Node::Call(..) => return None,
        }
        Some(())
    }
}

/// What a positive number is more than its nearest double, as whether it is less and the size; `None` where it is that
/// double.
fn rest_of(number: &Rational) -> Option<(bool, Rational)> {
    let rest = number - Rational::from_float(nearest_f64(number))?;
    (!rest.is_zero()).then(|| (rest.is_negative(), rest.abs()))
}

fn is_power_of_two(number: &Rational) -> bool {
    let single = |n: BigInt| n.magnitude().count_ones() == 1;
    single(number.numer()) && single(number.denom())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Graph, Program};

    /// The operations for `text` of X, Y (place), t (time) and k (parameter), and its value at the place.
    fn lowered(text: &str, at: [f64; 4]) -> (Vec<Operation>, f64) {
        let mut graph = Graph::new();
        let place = Dependence { position: true, time: false };
        let time = Dependence { position: false, time: true };
        let inputs: Vec<(Expr, Dependence)> = [("X", place), ("Y", place), ("t", time)]
            .into_iter()
            .chain([("k", Dependence::default())])
            .map(|(name, dependence)| (graph.symbol(name), dependence))
            .collect();
        let ast = Ast::parse(text).unwrap();
        let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
        let program = Program::lower(&mut graph, &inputs, &[], &[expr]);
        (program.operations().to_vec(), program.evaluate(&at)[0])
    }

    fn is_corrected(text: &str) -> bool {
        let (operations, _) = lowered(text, [0.3; 4]);
        operations
            .iter()
            .any(|o| matches!(o, Operation::SumError(..) | Operation::ProductError(..)))
    }

    #[test]
    fn only_what_is_rounded_is_corrected() {
        for text in ["sin(X + Y)", "cos(3*X)", "exp(X/10)", "sin(Pi*(X + 1/3))", "sinh(k + X)"] {
            assert!(is_corrected(text), "{text}");
        }
        for text in [
            "sin(X)",
            "cos(3)",
            "sin(1/3)",
            "cos(X/2)",
            "exp(-4*X)",
            "sin(2*Pi*X)",
            "sin(k*X)",
            "sin(X - t)",
            "sin(10^400*X + Y/3)",
            "sin(X/3 + 10^400)",
        ] {
            assert!(!is_corrected(text), "{text}");
        }
    }

    /// Against values from 60 digits (mpmath), at exactly these doubles.
    #[test]
    fn arguments_lose_nothing() {
        let at = [98_765_432.123_456_79, 0.123_456_789, 7e5, 3.3];
        for (text, exact) in EXACT {
            let (_, value) = lowered(text, at);
            let error = ((value - exact) / exact).abs() / (0.5 * f64::EPSILON);
            assert!(error <= 3.0, "{text} = {value:e}, off by {error} roundings");
        }
    }

    const EXACT: [(&str, f64); 9] = [
        ("sin(3*X + Y)", 0.9634117888435213),
        ("cos(3*X + Y)", 0.26802560533897946),
        ("cos(1/3 - X/10 - 7*Y)", 0.046448578261503545),
        ("sin(Pi*(X + k))", -0.9712267229793653),
        ("cos(Pi*(7*X/5 - Y))", -0.8901244495632501),
        ("sin(3*t)", 0.68228585552155),
        ("exp(3*X/10^6 + Y)", 5.4133128172021304e128),
        ("sinh(Y + X/10^6)", 4.424546671737787e42),
        ("cosh(X/10^6 - k)", 1.4423823122947754e41),
    ];

    /// A quantity that stays in one piece may hold an input that stands beside it as well.
    #[test]
    fn coefficients_of_one_input_are_added() {
        let place = Dependence { position: true, time: false };
        let mut graph = Graph::new();
        let inputs = ["X", "Y"].map(|name| (graph.symbol(name), place));
        let build = |graph: &mut Graph, text: &str| {
            graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
        };
        let part = build(&mut graph, "X/10 + Y/3 - 1/7");
        let part = graph.whole(part);
        let beside = build(&mut graph, "X/10 - 2*Y/3");
        let argument = graph.add(beside, part);
        let sine = graph.call(Function::Sin, &[argument]);
        let plain = build(&mut graph, "sin(X/5 - Y/3 - 1/7)");
        let [found, expected] = [sine, plain].map(|expr| {
            let program = Program::lower(&mut graph, &inputs, &[], &[expr]);
            program.evaluate(&[98_765_432.123_456_79, 0.123_456_789])[0]
        });
        assert_eq!(found, expected);
    }

    /// The limit on parts may be reached and not be passed: a sum is looked at, and each of its terms.
    #[test]
    fn sums_of_many_inputs() {
        for (count, expected) in [(MOST_VISITED - 1, true), (MOST_VISITED, false)] {
            let mut graph = Graph::new();
            let place = Dependence { position: true, time: false };
            let inputs: Vec<(Expr, Dependence)> =
                (0..count).map(|n| (graph.symbol(&format!("X{n}")), place)).collect();
            let argument = graph.sum_of(inputs.iter().map(|(symbol, _)| *symbol));
            let sine = graph.call(Function::Sin, &[argument]);
            let program = Program::lower(&mut graph, &inputs, &[], &[sine]);
            let is_error = |o: &Operation| matches!(o, Operation::SumError(..));
            assert_eq!(program.operations().iter().any(is_error), expected, "{count}");
        }
    }

    /// Where all inputs cancel, what is left is a number, which is no sum of inputs.
    #[test]
    fn without_inputs_nothing_is_corrected() {
        for beside in ["X/10 - 3/7", "X/10 - 10^400", "X/10"] {
            let mut graph = Graph::new();
            let place = Dependence { position: true, time: false };
            let inputs = ["X", "Y"].map(|name| (graph.symbol(name), place));
            let mut build = |text: &str| {
                graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
            };
            let (part, beside) = (build("X/10 + 1/3"), build(beside));
            let part = graph.whole(part);
            let argument = graph.sub(beside, part);
            let sine = graph.call(Function::Sinh, &[argument]);
            let program = Program::lower(&mut graph, &inputs, &[], &[sine]);
            let is_error =
                |o: &&Operation| matches!(o, Operation::SumError(..) | Operation::ProductError(..));
            assert_eq!(program.operations().iter().find(is_error), None);
            let calls =
                program.operations().iter().filter(|o| matches!(o, Operation::Call(..))).count();
            assert_eq!(calls, 1, "{:?}", program.operations());
        }
    }

    #[test]
    fn errors_of_sums_and_products_are_exact() {
        let exact = |x: f64| Rational::from_float(x).unwrap();
        let mut x = 0.7_f64;
        for n in 0..2000 {
            // Any numbers of many sizes and both signs.
            x = 3.9 * x * (1.0 - x);
            let a = (x - 0.5) * 10_f64.powi(n % 37 - 18);
            let b = (0.3 - x * x) * 10_f64.powi(n % 29 - 14);
            assert_eq!(exact(a + b) + exact(sum_error(a, b)), exact(a) + exact(b));
            assert_eq!(exact(a * b) + exact(product_error(a, b)), exact(a) * exact(b));
        }
    }
}
