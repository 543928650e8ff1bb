//! Functions of sums, without the rounding of the sum.
//!
//! `sin(3 X + Y)` far from the origin is as wrong as its argument: for `X` near 1e8 by 1e-8, whatever the sine does. Where
//! a field depends on `X` by several such functions, its answers to `X` by way of each may cancel, so that the field
//! as a whole answers to `X` little, and then the rounding of one argument is far more than that of the inputs may
//! cause. The same holds of phases in time, `cos(c Pi t + Pi/3)` beside `sin(c Pi t)`, at late times. So the sum `a` is
//! formed together with what rounding took from it, `e`, by error-free transformations, and the function is
//! `f(a) + e (f'(a) + e f''(a)/2)`, or that over `f(a)` times `f(a)`.
//!
//! The parts of a sum are numbers and products, such as `c t`, with constant coefficients, such as `3/Pi`. What rounding does
//! to `c t` itself is left: every argument with this part has the same rounding in it, which an error of `t` might have caused.
//!
//! Sums without the time are as small as the body, and their rounding is that of the function. They are left as they are, unless the
//! [range of inputs](RangeOfInputs) is wide.

use super::{Dependence, Lowering, Operation, Slot};
use crate::rewrite::constant::{CIRCLE_NUMBER, square_root};
use crate::{Expr, Function, Node, Rational, Rule, nearest_f64};
use num_bigint::BigInt;
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::collections::BTreeSet;

/// The inputs for which functions of sums keep their digits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RangeOfInputs {
    /// Places in the body, at any time: sums of coordinates alone are as large as the body.
    #[default]
    Body,
    /// Places far outside of it as well.
    Wide,
}

/// A term: whether it is taken away, and its value.
type Term = (bool, Slot);

/// A sum of more parts, sums within it counted anew wherever they occur, is left as it is.
const MOST_VISITED: usize = 100;
/// Numbers of more bits are rounded at once.
const MOST_BITS: u64 = 256;
/// Powers of the circle number beyond this are no part of a coefficient.
const LARGEST_POWER_OF_PI: i32 = 8;

/// A number and products with constant coefficients.
#[derive(Default)]
struct Collected {
    constant: Rational,
    products: Vec<Multiple>,
    /// The nodes that have been looked at.
    visited: usize,
}

/// A product of inputs and parameters, with what it depends on, and its coefficient.
struct Multiple {
    rate: Dependence,
    product: Expr,
    coefficient: Rational,
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
        if function == Function::Sinh {
            return self.sinh_of_sum(total, lost);
        }
        let value = self.push(call(function, total));
        let relative_slope = match function {
            Function::Exp => Some(self.push(Operation::Number(Rational::one()))),
            Function::Cosh => Some(self.push(Operation::Call(Function::Tanh, total))),
            _ => None,
        };
        let is_relative = relative_slope.is_some();
        let slope = relative_slope.unwrap_or_else(|| self.push(call(slope, total)));
        let lost = if in_turns {
            let pi = self.push(Operation::Pi);
            self.push(Operation::Mul(pi, lost))
        } else {
            lost
        };
        let half = self.push(Operation::Number(Rational::new(1.into(), 2.into())));
        let half = self.push(Operation::Mul(half, lost));
        if is_relative {
            // Where the function overflows, a product stays infinite and a sum of two infinities may be no number.
            let slope = self.push(Operation::Add(slope, half));
            let correction = self.push(Operation::Mul(lost, slope));
            let one = self.push(Operation::Number(Rational::one()));
            let factor = self.push(Operation::Add(correction, one));
            return self.push(Operation::Mul(value, factor));
        }
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

    /// `sinh(a + e) = cosh(a) (tanh(a) + e (1 + e tanh(a)/2))`, to second order: infinite where it overflows.
    fn sinh_of_sum(&mut self, total: Slot, lost: Slot) -> Slot {
        let cosine = self.push(Operation::Call(Function::Cosh, total));
        let tangent = self.push(Operation::Call(Function::Tanh, total));
        let half = self.push(Operation::Number(Rational::new(1.into(), 2.into())));
        let half = self.push(Operation::Mul(half, lost));
        let second = self.push(Operation::Mul(half, tangent));
        let one = self.push(Operation::Number(Rational::one()));
        let slope = self.push(Operation::Add(one, second));
        let correction = self.push(Operation::Mul(lost, slope));
        let relative = self.push(Operation::Add(tangent, correction));
        self.push(Operation::Mul(cosine, relative))
    }

    /// The sum of products with constant coefficients that `argument` is, rounded, and what rounding took from it.
    ///
    /// `None` where `argument` is no such sum, and where nothing is rounded.
    fn with_lost_part(&mut self, argument: Expr) -> Option<(Slot, Slot)> {
        let is_near =
            self.graph.range_of_inputs == RangeOfInputs::Body && !self.rate_of(argument).time;
        if is_near || Rule::SumsWithin.is_off() {
            return None;
        }
        let mut collected = Collected::default();
        self.collect(argument, &Rational::one(), &mut collected)?;
        let Collected { constant, mut products, .. } = collected;
        products.retain(|part| !part.coefficient.is_zero());
        let finite = |number: &Rational| nearest_f64(number).is_finite();
        let in_range = finite(&constant) && products.iter().all(|part| finite(&part.coefficient));
        if products.is_empty() || !in_range {
            return None;
        }
        if let [alone] = products.as_slice()
            && constant.is_zero()
            && is_power_of_two(&alone.coefficient)
        {
            return None;
        }
        // What changes rarely first.
        products.sort_by_key(|part| part.rate);
        let mut lost: Vec<(Dependence, Term)> = Vec::new();
        let mut parts: Vec<(Dependence, Term)> = Vec::new();
        if !constant.is_zero() {
            let (negative, size) = (constant.is_negative(), constant.abs());
            if let Some((below, rest)) = rest_of(&size) {
                let rest = self.push(Operation::Number(rest));
                lost.push((Dependence::default(), (negative != below, rest)));
            }
            let size = self.push(Operation::Number(rounded(&size)));
            parts.push((Dependence::default(), (negative, size)));
        }
        for Multiple { rate, product, coefficient } in products {
            let (negative, size) = (coefficient.is_negative(), coefficient.abs());
            let product = self.lower(product);
            if size.is_one() {
                parts.push((rate, (negative, product)));
                continue;
            }
            if let Some((below, rest)) = rest_of(&size) {
                let rest = self.push(Operation::Number(rest));
                let rest = self.push(Operation::Mul(rest, product));
                lost.push((rate, (negative != below, rest)));
            }
            let power_of_two = is_power_of_two(&size);
            let size = self.push(Operation::Number(rounded(&size)));
            if !power_of_two {
                let error = self.push(Operation::ProductError(size, product));
                lost.push((rate, (negative, error)));
            }
            parts.push((rate, (negative, self.push(Operation::Mul(size, product)))));
        }
        let total = self.total_of(parts, &mut lost)?;
        // As the parts: the innermost loop adds what was lost elsewhere to what was lost in the last sum.
        lost.sort_by_key(|(rate, _)| *rate);
        let lost: Vec<Term> = lost
            .chunk_by(|a, b| a.0 == b.0 || a.0.is_fixed())
            .map(|group| self.add(group.iter().map(|(_, term)| *term).collect()))
            .collect();
        let (negative, lost) = self.add(lost);
        Some((total, self.with_sign(negative, lost)))
    }

    /// The sum of `parts`, in order of their rates, of which those at each place and those at each time are summed up before the
    /// two meet; what each sum loses goes to `lost`.
    fn total_of(
        &mut self,
        parts: Vec<(Dependence, Term)>,
        lost: &mut Vec<(Dependence, Term)>,
    ) -> Option<Slot> {
        let mut totals: Vec<(Dependence, Term)> = Vec::new();
        for (rate, part) in parts {
            match totals.last_mut() {
                Some((known, total)) if *known == rate || known.is_fixed() => {
                    *total = (false, self.sum_of_two(rate, *total, part, lost));
                    *known = rate;
                }
                _ => totals.push((rate, part)),
            }
        }
        let (mut rate, mut total) = totals.first().copied()?;
        for &(other, part) in &totals[1..] {
            rate = rate.join(other);
            total = (false, self.sum_of_two(rate, total, part, lost));
        }
        let (negative, total) = total;
        Some(self.with_sign(negative, total))
    }

    /// The sum of two signed values; what it loses goes to `lost`.
    fn sum_of_two(
        &mut self,
        rate: Dependence,
        (first_negative, first): Term,
        (negative, part): Term,
        lost: &mut Vec<(Dependence, Term)>,
    ) -> Slot {
        let first = self.with_sign(first_negative, first);
        let signed = self.with_sign(negative, part);
        lost.push((rate, (false, self.push(Operation::SumError(first, signed)))));
        self.push(if negative { Operation::Sub(first, part) } else { Operation::Add(first, part) })
    }

    /// Adds `factor * expr`; `None` where it is no such sum. The canonical form takes out common factors, so that sums
    /// stand within sums, and within products.
    fn collect(&mut self, expr: Expr, factor: &Rational, sum: &mut Collected) -> Option<()> {
        sum.visited += 1;
        if sum.visited > MOST_VISITED {
            return None;
        }
        match self.graph.node(expr).clone() {
            Node::Symbol(_) => self.collect_product(expr, factor.clone(), sum)?,
            Node::Sum { constant, terms } => {
                sum.constant += factor * constant;
                for (term, coefficient) in terms {
                    self.collect(term, &(factor * coefficient), sum)?;
                }
            }
            Node::Whole(inner) => self.collect(inner, factor, sum)?,
            Node::Product(factors) => {
                let mut coefficient = factor.clone();
                let mut rest = Vec::new();
                for (base, exponent) in &factors {
                    match self.constant_power(*base, exponent) {
                        Some(number) => coefficient *= number,
                        None => rest.push((*base, exponent.clone())),
                    }
                }
                let inner = rest.iter().position(|(base, exponent)| {
                    exponent.is_one() && matches!(self.graph.node(*base), Node::Sum { .. })
                });
                let changing = rest.iter().filter(|(base, _)| !self.rate_of(*base).is_fixed());
                match inner {
                    _ if rest.is_empty() => sum.constant += coefficient,
                    // k (X - c t) is k X - k c t.
                    Some(place) if changing.count() < 2 => {
                        let Node::Sum { constant, terms } =
                            self.graph.node(rest.remove(place).0).clone()
                        else {
                            return None;
                        };
                        let others = self.graph.product(rest);
                        if !constant.is_zero() {
                            self.collect(others, &(&coefficient * constant), sum)?;
                        }
                        for (term, own) in terms {
                            let term = self.graph.mul(term, others);
                            self.collect(term, &(&coefficient * own), sum)?;
                        }
                    }
                    _ => {
                        let product = self.graph.product(rest);
                        self.collect_product(product, coefficient, sum)?;
                    }
                }
            }
            Node::Number(value) => sum.constant += factor * value,
            Node::Pi => sum.constant += factor * &*CIRCLE_NUMBER,
            // Functions have values of a moderate size.
            Node::Call(..) => return None,
        }
        Some(())
    }

    /// Adds a multiple of a product of inputs and of whatever depends on parameters only.
    fn collect_product(
        &mut self,
        product: Expr,
        coefficient: Rational,
        sum: &mut Collected,
    ) -> Option<()> {
        let factors = self.factors(product);
        let is_part = |base: Expr| {
            matches!(self.graph.node(base), Node::Symbol(_)) || self.rate_of(base).is_fixed()
        };
        if !factors.iter().all(|(base, _)| is_part(*base)) {
            return None;
        }
        match sum.products.iter_mut().find(|part| part.product == product) {
            Some(part) => part.coefficient += coefficient,
            None => {
                let rate = self.rate_of(product);
                sum.products.push(Multiple { rate, product, coefficient });
            }
        }
        Some(())
    }

    /// The value of a power of the circle number, or of the root of a number, to as many digits as a double and its rest can
    /// have and more.
    fn constant_power(&self, base: Expr, exponent: &Rational) -> Option<Rational> {
        let two = Rational::from(2);
        match self.graph.node(base) {
            Node::Pi if exponent.is_integer() => {
                let power =
                    exponent.to_integer().to_i32().filter(|n| n.abs() <= LARGEST_POWER_OF_PI)?;
                Some(num_traits::Pow::pow(&*CIRCLE_NUMBER, power))
            }
            Node::Number(value) if (exponent * &two).is_integer() => {
                let power = (exponent * &two)
                    .to_integer()
                    .to_i32()
                    .filter(|n| n.abs() <= LARGEST_POWER_OF_PI)?;
                let root = square_root(value)?;
                let is_defined = power >= 0 || !root.is_zero();
                is_defined.then(|| num_traits::Pow::pow(&root, power))
            }
            _ => None,
        }
    }

    /// The rate at which `expr` changes, without lowering it.
    fn rate_of(&self, expr: Expr) -> Dependence {
        let mut open = vec![expr];
        let mut seen = BTreeSet::new();
        let mut rate = Dependence::default();
        while let Some(expr) = open.pop() {
            if !seen.insert(expr) {
                continue;
            }
            if let Some((_, own)) = self.inputs.iter().find(|(symbol, _)| *symbol == expr) {
                rate = rate.join(*own);
            } else if let Some((_, meaning)) = self.definitions.iter().find(|d| d.0 == expr) {
                open.push(*meaning);
            } else {
                open.extend(self.graph.children(expr));
            }
        }
        rate
    }
}

/// The number itself where it has few digits, else its nearest double: both are rounded alike.
fn rounded(number: &Rational) -> Rational {
    let (numerator, denominator) = number.bits();
    let double = || Rational::from_float(nearest_f64(number));
    let long = numerator.max(denominator) > MOST_BITS;
    long.then(double).flatten().unwrap_or_else(|| number.clone())
}

/// Difference of a positive number from its nearest double: whether the number is less, and the size; `None` where the number is that
/// double.
fn rest_of(number: &Rational) -> Option<(bool, Rational)> {
    let rest = number - Rational::from_float(nearest_f64(number))?;
    (!rest.is_zero()).then(|| (rest.is_negative(), rounded(&rest.abs())))
}

fn is_power_of_two(number: &Rational) -> bool {
    let single = |n: BigInt| n.magnitude().count_ones() == 1;
    single(number.numer()) && single(number.denom())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Graph, Program};
    use mmsmith_scalar_functions::ScalarFunctions;
    use std::collections::BTreeMap;

    /// A graph in which places are far away as well.
    fn wide() -> Graph {
        let mut graph = Graph::new();
        graph.range_of_inputs = RangeOfInputs::Wide;
        graph
    }

    /// In the body the time alone grows without bound.
    #[test]
    fn sums_with_the_time_are_corrected_for_every_range() {
        for (text, is_corrected) in
            [("sin(X + 3*Y)", false), ("sin(X + 3*t)", true), ("sin(3*t)", true)]
        {
            let mut graph = Graph::new();
            let inputs = [("X", true), ("Y", true), ("t", false)].map(|(name, position)| {
                (graph.symbol(name), Dependence { position, time: !position })
            });
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            let program = Program::lower(&mut graph, &inputs, &[], &[expr]);
            let is_error =
                |o: &Operation| matches!(o, Operation::SumError(..) | Operation::ProductError(..));
            assert_eq!(program.operations().iter().any(is_error), is_corrected, "{text}");
        }
    }

    /// The operations for `text` of X, Y (place), t (time) and k (parameter), and its value at the place.
    fn lowered(text: &str, at: [f64; 4]) -> (Vec<Operation>, f64) {
        let mut graph = wide();
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
        for text in [
            "sin(X + Y)",
            "cos(3*X)",
            "exp(X/10)",
            "sin(Pi*(X + 1/3))",
            "sinh(k + X)",
            "sin(X - t)",
            "cos(k*Pi*t + Pi/3)",
            "cos(k*Pi*t + 1/3)",
            "sin(sqrt(k)*(X - k*t))",
            "sin(sqrt(2)*k*t)",
        ] {
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
            "sin(sqrt(k)*Pi*t/2)",
            "sin(X + cos(Y))",
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

    const EXACT: [(&str, f64); 14] = [
        ("sin(3*X + Y)", 0.9634117888435213),
        ("cos(3*X + Y)", 0.26802560533897946),
        ("cos(1/3 - X/10 - 7*Y)", 0.046448578261503545),
        ("sin(Pi*(X + k))", -0.9712267229793653),
        ("cos(Pi*(7*X/5 - Y))", -0.8901244495632501),
        ("sin(3*t)", 0.68228585552155),
        ("exp(3*X/10^6 + Y)", 5.4133128172021304e128),
        ("sin(3*X - t + 1/7)", -0.999_998_642_382_942_7),
        ("cos(Pi*t/3 + 1/5)", -0.317_980_601_499_243_73),
        ("sin(sqrt(2)*t + Y)", 0.707_212_283_832_330_6),
        ("cos(Pi*(3*X + t) + Pi/3)", -0.597_158_598_656_507_8),
        ("sin(2*Pi*X - 3*t/Pi)", -0.681_645_455_086_253_8),
        ("sinh(Y + X/10^6)", 4.424546671737787e42),
        ("cosh(X/10^6 - k)", 1.4423823122947754e41),
    ];

    /// A symbol below a fraction line may be replaced by zero.
    #[test]
    fn a_division_by_zero_is_left_to_the_program() {
        for text in ["sin(X/k + 7*X)", "cos(3*X/sqrt(k))", "exp((X - t)/k^2)"] {
            let mut graph = wide();
            let place = Dependence { position: true, time: false };
            let inputs = ["X", "t"].map(|name| (graph.symbol(name), place));
            let expr = graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name)));
            let k = graph.symbol("k");
            let divided = graph.replace(expr.unwrap(), &BTreeMap::from([(k, Graph::ZERO)]));
            let program = Program::lower(&mut graph, &inputs, &[], &[divided]);
            assert!(!program.evaluate(&[0.3, 0.2])[0].is_normal(), "{text}");
        }
    }

    /// Values beyond the largest number are infinite, whatever the sum has lost.
    #[test]
    fn what_overflows_is_infinite() {
        for X in [98_765_432.123_456_79, -98_765_431.987_654_3, 987_654_321.123_456] {
            let at = [X, 0.123_456_789, 7e5, 3.3];
            for text in ["cosh(3*X + Y)", "sinh(X/3 - t/7)", "exp(-X/3 + t/7)"] {
                let (_, value) = lowered(text, at);
                assert!(!value.is_nan(), "{text}");
            }
            assert_eq!(lowered("cosh(3*X + Y)", at).1, f64::INFINITY);
            assert_eq!(lowered("sinh(3*X + Y)", at).1, f64::INFINITY.copysign(X));
            let exponential = if X > 0.0 { f64::INFINITY } else { 0.0 };
            assert_eq!(lowered("exp(3*X + Y)", at).1, exponential);
        }
    }

    /// `k t` and `k X` are rounded, as an error of `t` or `X` might have it, and everything else is exact. Values from 60 digits
    /// (mpmath), at the rounded products.
    #[test]
    fn products_are_rounded_once() {
        let at = [98_765_432.123_456_79, 0.123_456_789, 7e5, 3.3];
        for (text, exact) in [
            ("cos(k*Pi*t/11 + Pi/3)", ROUNDED[0]),
            ("sin(k*(X - t/3) + Pi/7)", ROUNDED[1]),
            ("exp((k*(X - 140*t) + Y)/10^6)", ROUNDED[2]),
        ] {
            let (_, value) = lowered(text, at);
            let error = ((value - exact) / exact).abs() / (0.5 * f64::EPSILON);
            assert!(error <= 3.0, "{text} = {value:e}, off by {error} roundings");
        }
    }

    const ROUNDED: [f64; 3] = [0.5, -0.180402278276285, 12.50246882572068];

    /// A quantity that stays in one piece may hold an input that stands beside it as well.
    #[test]
    fn coefficients_of_one_input_are_added() {
        let place = Dependence { position: true, time: false };
        let mut graph = wide();
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
            let mut graph = wide();
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
            let mut graph = wide();
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
            assert_eq!(exact(a + b) + exact(a.sum_error(b)), exact(a) + exact(b));
            assert_eq!(exact(a * b) + exact(a.product_error(b)), exact(a) * exact(b));
        }
    }
}
