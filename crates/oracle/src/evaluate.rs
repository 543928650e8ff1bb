//! Evaluation of graph expressions in a stated number of bits.

use crate::convert::{LARGEST_EXPONENT, to_float, to_rational};
use crate::scientific;
use astro_float_num::{BigFloat, Consts, RoundingMode};
use mmsmith_expr::{Expr, Function, Graph, Node, Rational};
use num_integer::Integer;
use num_traits::{One, Pow, Signed, ToPrimitive, Zero};
use std::collections::{HashMap, HashSet};
use thiserror::Error;

/// Bits carried beyond those asked for, which absorb the roundings of long computations.
const GUARD_BITS: usize = 64;
/// The largest numerator of an exponent.
const LARGEST_POWER: i64 = 1_000_000;
/// Intermediate results are rounded to the working precision, whose guard bits make the direction immaterial.
const ROUNDING: RoundingMode = RoundingMode::ToEven;

/// Expressions of one graph with a value for each input.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// The graph that all expressions belong to.
    pub graph: &'a Graph,
    /// Definitions of further symbols, such as the polar radius.
    pub definitions: &'a [(Expr, Expr)],
    /// The inputs with their exact values.
    pub values: &'a [(Expr, Rational)],
}

/// An evaluator in arbitrary precision.
///
/// `sin(Pi x)`, `cos(Pi x)` and `tan(Pi x)` are reduced before `x` meets pi, so that they are exact at multiples of
/// one half, however large.
#[derive(Debug)]
pub struct Oracle {
    bits: usize,
    constants: Consts,
}

/// Why an expression has no value that could be stated.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum OracleError {
    /// A precision that is not offered.
    #[error("a precision of {bits} bits; {least} to {most} are offered")]
    Precision {
        /// The precision asked for.
        bits: usize,
        /// The least.
        least: usize,
        /// The most.
        most: usize,
    },
    /// The constants pi, e, ln 2 and ln 10 could not be stored.
    #[error("no memory for the constants of high-precision arithmetic")]
    Memory,
    /// A symbol has neither a value nor a definition.
    #[error("nothing says what '{name}' is")]
    Unknown {
        /// The symbol.
        name: String,
    },
    /// A symbol is defined by itself.
    #[error("'{name}' is defined by itself")]
    Circular {
        /// The symbol, or an expression on the circle.
        name: String,
    },
    /// Zero to a negative power, or the tangent of an odd multiple of pi/2.
    #[error("division by zero in {expression}")]
    DivisionByZero {
        /// Where.
        expression: String,
    },
    /// An argument outside of what a function is defined for.
    #[error("{function} is not defined at {argument}, in {expression}")]
    Domain {
        /// The function, or `power`.
        function: &'static str,
        /// Its argument, to 17 digits.
        argument: String,
        /// Where.
        expression: String,
    },
    /// A number beyond what the arithmetic holds.
    #[error("{expression} has a magnitude beyond 2^{limit} or below 2^-{limit}")]
    Range {
        /// Which.
        expression: String,
        /// The binary exponent that is the limit.
        limit: i32,
    },
    /// An exponent beyond what is evaluated.
    #[error("an exponent of {exponent}; {limit} is the limit")]
    Exponent {
        /// The exponent.
        exponent: String,
        /// The largest numerator.
        limit: i64,
    },
    /// Precision was raised to the limit, and the digits still moved.
    #[error(
        "{expression} has not {digits} digits in {bits} bits: {coarse} and {fine} in half and in full precision"
    )]
    Unsettled {
        /// Which.
        expression: String,
        /// The digits wanted.
        digits: usize,
        /// The precision reached.
        bits: usize,
        /// The value in half that precision.
        coarse: String,
        /// The value in that precision.
        fine: String,
    },
}

impl Oracle {
    /// The precision that serves where nothing cancels: some 96 digits.
    pub const USUAL_BITS: usize = 320;
    /// The least precision.
    pub const LEAST_BITS: usize = 64;
    /// The precision at which [`Oracle::settle`] gives up.
    pub const MOST_BITS: usize = 1 << 11;

    /// An evaluator with results of about `bits` bits.
    ///
    /// # Errors
    ///
    /// [`OracleError::Precision`] for a number of bits outside of the limits.
    pub fn new(bits: usize) -> Result<Self, OracleError> {
        if !(Self::LEAST_BITS..=Self::MOST_BITS).contains(&bits) {
            let (least, most) = (Self::LEAST_BITS, Self::MOST_BITS);
            return Err(OracleError::Precision { bits, least, most });
        }
        Ok(Oracle { bits, constants: Consts::new().map_err(|_| OracleError::Memory)? })
    }

    /// The values of `expressions` at `point`. Each common subexpression is evaluated once.
    ///
    /// Every operation is correct to about [`Oracle::new`]'s number of bits; where the expression subtracts nearly
    /// equal numbers, the result has fewer. [`Oracle::settle`] tells.
    ///
    /// # Errors
    ///
    /// [`OracleError`] where an expression has no value at `point`.
    pub fn evaluate(
        &mut self,
        point: &Point<'_>,
        expressions: &[Expr],
    ) -> Result<Vec<Rational>, OracleError> {
        Ok(self.evaluate_in(point, expressions, self.bits)?.values)
    }

    /// As [`Oracle::evaluate`], with the precision doubled until `digits` significant digits of every value stay the
    /// same.
    ///
    /// A value that has not settled at [`Oracle::MOST_BITS`] and is smaller than the largest intermediate result
    /// by a factor of `2^-1024` is rounding error, and is taken for the zero that it approaches. Nor is a zero settled
    /// before where a sum of other numbers gave it, as `1 - tanh(x)` far from zero does in few bits, and no value is
    /// where a sum had no place for a term, as in `sqrt(1 + x) - 1` next to zero.
    ///
    /// # Errors
    ///
    /// As [`Oracle::evaluate`], and [`OracleError::Unsettled`] at [`Oracle::MOST_BITS`].
    pub fn settle(
        &mut self,
        point: &Point<'_>,
        expressions: &[Expr],
        digits: usize,
    ) -> Result<Vec<Rational>, OracleError> {
        let tolerance = Rational::one() / Pow::pow(Rational::from_integer(10.into()), digits);
        let mut bits = self.bits;
        let mut values = self.evaluate_in(point, expressions, bits)?.values;
        let mut moving: Vec<usize> = (0..expressions.len()).collect();
        while !moving.is_empty() && bits < Self::MOST_BITS {
            bits = (2 * bits).min(Self::MOST_BITS);
            let open: Vec<Expr> = moving.iter().map(|&i| expressions[i]).collect();
            let Evaluated { values: fine, largest, cancelled, lost } =
                self.evaluate_in(point, &open, bits)?;
            let mut still = Vec::new();
            for (i, fine) in moving.into_iter().zip(fine) {
                let coarse = std::mem::replace(&mut values[i], fine);
                let fine = &values[i];
                let may_be_lost = lost || cancelled && fine.is_zero();
                let may_be_lost = may_be_lost && bits < Self::MOST_BITS;
                if !may_be_lost && (fine - &coarse).abs() <= fine.abs() * &tolerance {
                    continue;
                }
                if bits < Self::MOST_BITS {
                    still.push(i);
                } else if fine.abs() * power_of_two(bits / 2) <= largest {
                    values[i] = Rational::zero();
                } else {
                    return Err(OracleError::Unsettled {
                        expression: describe(point.graph, expressions[i]),
                        digits,
                        bits,
                        coarse: scientific(&coarse, 5),
                        fine: scientific(fine, 5),
                    });
                }
            }
            moving = still;
        }
        Ok(values)
    }

    fn evaluate_in(
        &mut self,
        point: &Point<'_>,
        expressions: &[Expr],
        bits: usize,
    ) -> Result<Evaluated, OracleError> {
        let bits = bits + GUARD_BITS;
        let mut evaluation = Evaluation {
            graph: point.graph,
            definitions: point.definitions.iter().copied().collect(),
            values: point.values.iter().map(|(e, value)| (*e, to_float(value, bits))).collect(),
            bits,
            constants: &mut self.constants,
            cancelled: false,
            lost: false,
        };
        let mut values = Vec::new();
        for &expression in expressions {
            evaluation.complete(expression)?;
            let value = to_rational(evaluation.value(expression)?);
            values.push(value.ok_or_else(|| evaluation.range(expression))?);
        }
        let exponents = evaluation.values.values().filter_map(BigFloat::exponent);
        let largest = exponents.max().and_then(|e| usize::try_from(e).ok()).unwrap_or(0);
        let (cancelled, lost) = (evaluation.cancelled, evaluation.lost);
        Ok(Evaluated { values, largest: power_of_two(largest), cancelled, lost })
    }
}

/// Values in one precision.
struct Evaluated {
    values: Vec<Rational>,
    /// A power of two at least as large as every intermediate result.
    largest: Rational,
    /// Whether any sum of numbers that are not zero came out as zero.
    cancelled: bool,
    /// Whether any sum had no place for one of its terms, as `1 + x` for a small `x`.
    lost: bool,
}

/// The values found so far at one point.
struct Evaluation<'a> {
    graph: &'a Graph,
    definitions: HashMap<Expr, Expr>,
    values: HashMap<Expr, BigFloat>,
    bits: usize,
    constants: &'a mut Consts,
    /// Whether any sum of numbers that are not zero came out as zero.
    cancelled: bool,
    /// Whether any sum had no place for one of its terms, as `1 + x` for a small `x`.
    lost: bool,
}

impl Evaluation<'_> {
    /// Finds the value of `root` and of everything that it consists of, without recursion: graphs may be deep.
    fn complete(&mut self, root: Expr) -> Result<(), OracleError> {
        let mut stack = vec![root];
        let mut open = HashSet::new();
        while let Some(&expression) = stack.last() {
            if self.values.contains_key(&expression) {
                stack.pop();
                continue;
            }
            let before = stack.len();
            let missing = |e: &Expr| !self.values.contains_key(e);
            stack.extend(self.graph.children(expression).filter(missing));
            stack.extend(self.definitions.get(&expression).copied().filter(missing));
            if stack.len() == before {
                let value = self.compute(expression)?;
                if value.is_nan()
                    || value.is_inf()
                    || value.exponent().is_some_and(|e| e.abs() > LARGEST_EXPONENT)
                {
                    return Err(self.range(expression));
                }
                self.values.insert(expression, value);
                stack.pop();
            } else if !open.insert(expression) {
                return Err(OracleError::Circular { name: self.describe(expression) });
            }
        }
        Ok(())
    }

    fn value(&self, expression: Expr) -> Result<&BigFloat, OracleError> {
        self.values
            .get(&expression)
            .ok_or_else(|| OracleError::Unknown { name: self.describe(expression) })
    }

    /// The value of an expression from those of its children.
    fn compute(&mut self, expression: Expr) -> Result<BigFloat, OracleError> {
        let (graph, bits) = (self.graph, self.bits);
        match graph.node(expression) {
            Node::Number(value) => Ok(to_float(value, bits)),
            Node::Pi => Ok(self.constants.pi(bits, ROUNDING)),
            Node::Symbol(_) if is_pi(graph, expression) => Ok(self.constants.pi(bits, ROUNDING)),
            Node::Symbol(_) => match self.definitions.get(&expression) {
                Some(&meaning) => self.value(meaning).cloned(),
                None => Err(OracleError::Unknown {
                    name: graph.symbol_name(expression).unwrap_or_default().to_owned(),
                }),
            },
            Node::Whole(inner) => self.value(*inner).cloned(),
            Node::Sum { constant, terms } => {
                let mut sum = to_float(constant, bits);
                let mut all_zero = sum.is_zero();
                let mut is_lost = false;
                for (term, coefficient) in terms {
                    let scaled = scaled(self.value(*term)?, coefficient, bits);
                    all_zero &= scaled.is_zero();
                    let before = sum;
                    sum = before.add(&scaled, bits, ROUNDING);
                    // As in 1 + x, whose logarithm is no zero for that.
                    is_lost |= !scaled.is_zero() && sum.cmp(&before) == Some(0);
                }
                self.lost |= is_lost;
                self.cancelled |= sum.is_zero() && !all_zero;
                Ok(sum)
            }
            Node::Product(factors) => {
                let mut product = BigFloat::from_word(1, bits);
                for (base, exponent) in factors {
                    let power = self.power(expression, *base, exponent)?;
                    product = product.mul(&power, bits, ROUNDING);
                }
                Ok(product)
            }
            Node::Call(function, arguments) => self.call(expression, *function, arguments),
        }
    }

    fn power(
        &mut self,
        expression: Expr,
        base: Expr,
        exponent: &Rational,
    ) -> Result<BigFloat, OracleError> {
        let bits = self.bits;
        let value = self.value(base)?.clone();
        let beyond =
            || OracleError::Exponent { exponent: scientific(exponent, 5), limit: LARGEST_POWER };
        let numerator = exponent.numer().abs().to_i64().filter(|&n| n <= LARGEST_POWER);
        let numerator = numerator.and_then(|n| usize::try_from(n).ok()).ok_or_else(beyond)?;
        if value.is_zero() {
            return if exponent.is_negative() {
                Err(OracleError::DivisionByZero { expression: self.describe(expression) })
            } else {
                Ok(value)
            };
        }
        if value.is_negative() && !exponent.is_integer() {
            return Err(self.domain("power", &value, expression));
        }
        // A power of n multiplies the relative error by n.
        let bits_inside = bits + GUARD_BITS;
        let root = match exponent.denom().to_u32() {
            Some(1) => value,
            Some(2) => value.sqrt(bits_inside, ROUNDING),
            _ => {
                let exponent = to_float(exponent, bits_inside);
                return Ok(value.pow(&exponent, bits, ROUNDING, self.constants));
            }
        };
        let power = if numerator == 1 { root } else { root.powi(numerator, bits_inside, ROUNDING) };
        Ok(if exponent.is_negative() { power.reciprocal(bits, ROUNDING) } else { power })
    }

    fn call(
        &mut self,
        expression: Expr,
        function: Function,
        arguments: &[Expr],
    ) -> Result<BigFloat, OracleError> {
        let bits = self.bits;
        if matches!(function, Function::Sin | Function::Cos | Function::Tan)
            && let Some(half_turns) = self.half_turns(arguments[0])?
        {
            return self.trigonometric(expression, function, &half_turns);
        }
        // Precision enough makes up for the digits that only the second argument has in doubles.
        let function = if function == Function::LnOfBoth { Function::Ln1p } else { function };
        let x = self.value(arguments[0])?.clone();
        let one = BigFloat::from_word(1, bits);
        let minus_one = one.neg();
        let defined = match function {
            Function::Ln => x.is_positive() && !x.is_zero(),
            Function::Ln1p | Function::Ln1pMinusX => x.cmp(&minus_one).is_some_and(|c| c > 0),
            Function::LogRatioSquared
            | Function::LogRatioSlope
            | Function::LogRatioCurvature
            | Function::CoshSqrtM1
            | Function::CoshSqrtM1Slope
            | Function::CoshSqrtM1Curvature
                if x.is_negative() =>
            {
                x.is_zero()
            }
            Function::Asin | Function::Acos => x.abs_cmp(&one).is_some_and(|c| c <= 0),
            // Beyond this the result would be out of range, and finding that out would take long.
            Function::Exp | Function::Expm1 | Function::Sinh | Function::Cosh
                if x.exponent().is_some_and(|e| e > 17) =>
            {
                return Err(self.range(expression));
            }
            Function::CoshSqrtM1 | Function::CoshSqrtM1Slope | Function::CoshSqrtM1Curvature
                if x.exponent().is_some_and(|e| e > 34) =>
            {
                return Err(self.range(expression));
            }
            _ => true,
        };
        if !defined {
            return Err(self.domain(function.name(), &x, expression));
        }
        let constants = &mut *self.constants;
        Ok(match function {
            Function::Sin => x.sin(bits, ROUNDING, constants),
            Function::Cos => x.cos(bits, ROUNDING, constants),
            Function::Tan => x.tan(bits, ROUNDING, constants),
            Function::Asin => x.asin(bits, ROUNDING, constants),
            Function::Acos => x.acos(bits, ROUNDING, constants),
            Function::Atan => x.atan(bits, ROUNDING, constants),
            Function::Sinh => x.sinh(bits, ROUNDING, constants),
            Function::Cosh => x.cosh(bits, ROUNDING, constants),
            Function::Tanh => x.tanh(bits, ROUNDING, constants),
            Function::Exp => x.exp(bits, ROUNDING, constants),
            Function::Ln => x.ln(bits, ROUNDING, constants),
            Function::Erf => error_function(&x, bits, constants),
            Function::Ln1p | Function::Expm1 if x.is_zero() => x,
            Function::Ln1p | Function::LnOfBoth | Function::Expm1 => {
                let smallness = smallness(&x);
                if smallness > bits {
                    // x -+ x^2/2: what is left out is below 2^-2bits.
                    let half_square = scaled(
                        &x.mul(&x, bits, ROUNDING),
                        &Rational::new(1.into(), 2.into()),
                        bits,
                    );
                    return Ok(if function == Function::Ln1p {
                        x.sub(&half_square, bits, ROUNDING)
                    } else {
                        x.add(&half_square, bits, ROUNDING)
                    });
                }
                // As many bits more as the sum with one takes away.
                let wide = bits + smallness + GUARD_BITS;
                if function == Function::Ln1p {
                    one.add(&x, wide, ROUNDING).ln(bits, ROUNDING, constants)
                } else {
                    x.exp(wide, ROUNDING, constants).sub(&one, bits, ROUNDING)
                }
            }
            Function::Ln1pMinusX => log_1p_minus_x(&x, bits, constants),
            Function::LogRatioSquared => {
                let theta = log_ratio(&x, 2 * bits + smallness(&x), constants);
                theta.mul(&theta, bits, ROUNDING)
            }
            Function::LogRatioSlope => log_ratio_slope(&x, bits, constants),
            Function::LogRatioCurvature => {
                // z (z + 2) s' = -(z + (1 + z) s), in which no large terms cancel.
                if x.is_zero() {
                    return Ok(BigFloat::from_i32(-1, bits).div(
                        &BigFloat::from_i32(3, bits),
                        bits,
                        ROUNDING,
                    ));
                }
                let wide = bits + GUARD_BITS;
                let slope = log_ratio_slope(&x, wide, constants);
                let product = one.add(&x, wide, ROUNDING).mul(&slope, wide, ROUNDING);
                let numerator = x.add(&product, wide, ROUNDING);
                numerator.div(&squared_sinh(&x, wide), bits, ROUNDING).neg()
            }
            Function::CoshSqrtM1 => {
                // 2 sinh(s/2)^2, in which nothing cancels.
                let quarter = scaled(&x, &Rational::new(1.into(), 4.into()), bits + GUARD_BITS);
                let half = quarter.sqrt(bits + GUARD_BITS, ROUNDING);
                let sinh = half.sinh(bits + GUARD_BITS, ROUNDING, constants);
                let square = sinh.mul(&sinh, bits + GUARD_BITS, ROUNDING);
                square.add(&square, bits, ROUNDING)
            }
            Function::CoshSqrtM1Slope => cosh_sqrt_slope(&x, bits, constants),
            Function::CoshSqrtM1Curvature => cosh_sqrt_curvature(&x, bits, constants),
            Function::PositivePart if x.is_positive() => x,
            Function::PositivePart => BigFloat::from_word(0, bits),
            Function::PositivePartSlope if x.is_positive() && !x.is_zero() => one,
            Function::PositivePartSlope => BigFloat::from_word(0, bits),
            Function::Atan2 => {
                let abscissa = self.value(arguments[1])?.clone();
                return self.polar_angle(expression, &x, &abscissa);
            }
        })
    }

    /// `atan2(y, x)`.
    fn polar_angle(
        &mut self,
        expression: Expr,
        y: &BigFloat,
        x: &BigFloat,
    ) -> Result<BigFloat, OracleError> {
        let bits = self.bits;
        let pi = self.constants.pi(bits, ROUNDING);
        let half = Rational::new(1.into(), 2.into());
        let signed = |angle: BigFloat| if y.is_negative() { angle.neg() } else { angle };
        if x.is_zero() {
            return if y.is_zero() {
                Err(self.domain("atan2", y, expression))
            } else {
                Ok(signed(scaled(&pi, &half, bits)))
            };
        }
        if y.is_zero() {
            return Ok(if x.is_negative() { pi } else { y.clone() });
        }
        let angle = y.div(x, bits, ROUNDING).atan(bits, ROUNDING, self.constants);
        Ok(if x.is_negative() { angle.add(&signed(pi), bits, ROUNDING) } else { angle })
    }

    /// `x` where `expression` is `Pi x`.
    fn half_turns(&mut self, expression: Expr) -> Result<Option<BigFloat>, OracleError> {
        let (graph, bits) = (self.graph, self.bits);
        // As sums of one term and whole quantities may wrap each other, this is a loop.
        let mut inner = expression;
        let mut scale = Rational::one();
        loop {
            match graph.node(inner) {
                Node::Whole(whole) => inner = *whole,
                Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                    scale *= &terms[0].1;
                    inner = terms[0].0;
                }
                _ if is_pi(graph, inner) => return Ok(Some(to_float(&scale, bits))),
                Node::Product(factors)
                    if factors.iter().any(|(base, e)| is_pi(graph, *base) && e.is_one()) =>
                {
                    let mut product = BigFloat::from_word(1, bits);
                    for (base, exponent) in factors.iter().filter(|(b, _)| !is_pi(graph, *b)) {
                        let power = self.power(expression, *base, exponent)?;
                        product = product.mul(&power, bits, ROUNDING);
                    }
                    return Ok(Some(scaled(&product, &scale, bits)));
                }
                _ => return Ok(None),
            }
        }
    }

    /// A trigonometric function of `Pi x`.
    fn trigonometric(
        &mut self,
        expression: Expr,
        function: Function,
        x: &BigFloat,
    ) -> Result<BigFloat, OracleError> {
        let bits = self.bits;
        let Some(exact) = to_rational(x) else { return Err(self.range(expression)) };
        let quarters = (&exact * Rational::from_integer(2.into())).round().to_integer();
        let rest = exact - Rational::new(quarters.clone(), 2.into());
        let quarter = quarters.mod_floor(&4.into()).to_u8().unwrap_or(0);
        let pi = self.constants.pi(bits + GUARD_BITS, ROUNDING);
        let angle = scaled(&pi, &rest, bits + GUARD_BITS);
        let sine = angle.sin(bits, ROUNDING, self.constants);
        let cosine = angle.cos(bits, ROUNDING, self.constants);
        let (sine, cosine) = match quarter {
            0 => (sine, cosine),
            1 => (cosine, sine.neg()),
            2 => (sine.neg(), cosine.neg()),
            _ => (cosine.neg(), sine),
        };
        match function {
            Function::Sin => Ok(sine),
            Function::Cos => Ok(cosine),
            _ if cosine.is_zero() => {
                Err(OracleError::DivisionByZero { expression: self.describe(expression) })
            }
            _ => Ok(sine.div(&cosine, bits, ROUNDING)),
        }
    }

    fn domain(&self, function: &'static str, at: &BigFloat, expression: Expr) -> OracleError {
        let argument = to_rational(at).map_or("?".into(), |value| scientific(&value, 17));
        OracleError::Domain { function, argument, expression: self.describe(expression) }
    }

    fn range(&self, expression: Expr) -> OracleError {
        OracleError::Range { expression: self.describe(expression), limit: LARGEST_EXPONENT }
    }

    fn describe(&self, expression: Expr) -> String {
        describe(self.graph, expression)
    }
}

/// The leading zeros of the binary fraction.
fn smallness(x: &BigFloat) -> usize {
    x.exponent().map_or(0, |e| usize::try_from(-e).unwrap_or(0))
}

/// `z (z + 2) = sinh(arcosh(1 + z))^2`.
fn squared_sinh(z: &BigFloat, bits: usize) -> BigFloat {
    z.add(&BigFloat::from_word(2, bits), bits, ROUNDING).mul(z, bits, ROUNDING)
}

/// `arcosh(1 + z) = ln(1 + z + sqrt(z (z + 2)))`.
fn log_ratio(z: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    let root = squared_sinh(z, bits).sqrt(bits, ROUNDING);
    let one = BigFloat::from_word(1, bits);
    one.add(z, bits, ROUNDING).add(&root, bits, ROUNDING).ln(bits, ROUNDING, constants)
}

/// `theta/sinh(theta) - 1` for `theta = arcosh(1 + z)`.
fn log_ratio_slope(z: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    if z.is_zero() {
        return z.clone();
    }
    let third = Rational::new((-1).into(), 3.into());
    if smallness(z) > bits {
        // -z/3 + 2 z^2/15: what is left out is below 2^-2bits.
        let square = scaled(&z.mul(z, bits, ROUNDING), &Rational::new(2.into(), 15.into()), bits);
        return scaled(z, &third, bits).add(&square, bits, ROUNDING);
    }
    // As many bits more as the logarithm and the difference with one take away.
    let wide = bits + 2 * smallness(z) + GUARD_BITS;
    let root = squared_sinh(z, wide).sqrt(wide, ROUNDING);
    let ratio = log_ratio(z, wide, constants).div(&root, wide, ROUNDING);
    ratio.sub(&BigFloat::from_word(1, wide), bits, ROUNDING)
}

/// `ln(1 + x) - x`.
fn log_1p_minus_x(x: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    if x.is_zero() {
        return x.clone();
    }
    let smallness = smallness(x);
    if smallness > bits {
        // -x^2/2 + x^3/3: what is left out is below 2^-2bits of the sum.
        let square = x.mul(x, bits, ROUNDING);
        let cube = square.mul(x, bits, ROUNDING);
        let first = scaled(&square, &Rational::new((-1).into(), 2.into()), bits);
        let second = scaled(&cube, &Rational::new(1.into(), 3.into()), bits);
        return first.add(&second, bits, ROUNDING);
    }
    // As many bits more as the sum with one and the difference take away.
    let wide = bits + 2 * smallness + GUARD_BITS;
    let sum = BigFloat::from_word(1, wide).add(x, wide, ROUNDING);
    sum.ln(wide, ROUNDING, constants).sub(x, bits, ROUNDING)
}

/// `sinh(s)/s - 1` for `s = sqrt(y)`.
fn cosh_sqrt_slope(y: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    if y.is_zero() {
        return y.clone();
    }
    if smallness(y) > bits {
        // y/6 + y^2/120: what is left out is below 2^-2bits of the sum.
        let square = y.mul(y, bits, ROUNDING);
        let first = scaled(y, &Rational::new(1.into(), 6.into()), bits);
        let second = scaled(&square, &Rational::new(1.into(), 120.into()), bits);
        return first.add(&second, bits, ROUNDING);
    }
    // As many bits more as the difference with one takes away.
    let wide = bits + smallness(y) + GUARD_BITS;
    let root = y.sqrt(wide, ROUNDING);
    let ratio = root.sinh(wide, ROUNDING, constants).div(&root, wide, ROUNDING);
    ratio.sub(&BigFloat::from_word(1, wide), bits, ROUNDING)
}

/// `(cosh(s) - sinh(s)/s)/(2 y)` for `s = sqrt(y)`.
fn cosh_sqrt_curvature(y: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    if y.is_zero() || smallness(y) > bits {
        // 1/6 + y/60: what is left out is below 2^-2bits.
        let first = to_float(&Rational::new(1.into(), 6.into()), bits);
        return first.add(&scaled(y, &Rational::new(1.into(), 60.into()), bits), bits, ROUNDING);
    }
    let wide = bits + smallness(y) + GUARD_BITS;
    let root = y.sqrt(wide, ROUNDING);
    let ratio = root.sinh(wide, ROUNDING, constants).div(&root, wide, ROUNDING);
    let difference = root.cosh(wide, ROUNDING, constants).sub(&ratio, wide, ROUNDING);
    difference.div(&y.add(y, wide, ROUNDING), bits, ROUNDING)
}

/// `erf(x) = 2/sqrt(pi) exp(-x^2) sum_n 2^n x^(2n+1)/(2n+1)!!` (NIST Digital Library of Mathematical Functions, 7.6.2): all
/// terms have one sign, so that nothing cancels.
fn error_function(x: &BigFloat, bits: usize, constants: &mut Consts) -> BigFloat {
    if x.is_zero() {
        return x.clone();
    }
    let wide = bits + GUARD_BITS;
    let number = |n: usize| BigFloat::from_word(n as u64, wide);
    let square = x.mul(x, wide, ROUNDING);
    if square.cmp(&number(wide)).is_some_and(|c| c > 0) {
        // One less this magnitude is above exp(-x^2), which is below the last bit.
        let one = number(1);
        return if x.is_negative() { one.neg() } else { one };
    }
    let double = square.add(&square, wide, ROUNDING);
    let mut term = x.clone();
    let mut sum = term.clone();
    // Terms grow at first where x is large; by the first one below the last bit each is less than half of the one before.
    for odd in (3..).step_by(2) {
        term = term.mul(&double, wide, ROUNDING).div(&number(odd), wide, ROUNDING);
        sum = sum.add(&term, wide, ROUNDING);
        let ends = |(term, sum): (i32, i32)| i64::from(sum) - i64::from(term) > wide as i64;
        if term.exponent().zip(sum.exponent()).is_none_or(ends) {
            break;
        }
    }
    let scale = number(2).div(&constants.pi(wide, ROUNDING).sqrt(wide, ROUNDING), wide, ROUNDING);
    let bell = square.neg().exp(wide, ROUNDING, constants);
    scale.mul(&bell, wide, ROUNDING).mul(&sum, bits, ROUNDING)
}

/// `value` times an exact number.
fn scaled(value: &BigFloat, factor: &Rational, bits: usize) -> BigFloat {
    if factor.is_one() {
        return value.clone();
    }
    value.mul(&to_float(factor, bits), bits, ROUNDING)
}

fn power_of_two(n: usize) -> Rational {
    Rational::from_integer(num_bigint::BigInt::from(1) << n)
}

/// Whether `expression` is the circle number, or the symbol that stands for it.
fn is_pi(graph: &Graph, expression: Expr) -> bool {
    matches!(graph.node(expression), Node::Pi) || graph.symbol_name(expression) == Some("Pi")
}

/// The expression for a message; a graph may be exponentially smaller than its text, so deep ones are not printed.
fn describe(graph: &Graph, expression: Expr) -> String {
    let depth = graph.depth(expression);
    if depth > 8 {
        return format!("an expression of depth {depth}");
    }
    let text = graph.print(expression);
    if text.chars().count() <= 120 {
        return text;
    }
    format!("{}...", text.chars().take(117).collect::<String>())
}
