//! The functions of the language, a row each: all that algebra, programs and generated code have to know of one.
//!
//! A new function is a row of this table and its value in arbitrary precision, in the crate `mmsmith-oracle`. What a
//! few functions have beyond their rows stays with the algebra that makes use of it: the sine and the cosine of multiples
//! of pi, the logarithm and the exponential as inverses, the functions of two arguments as operations of their own.

use crate::{Ast, Expr, Graph, Node, Rational};
use mmsmith_scalar_functions::ScalarFunctions;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// Parity of a function: how its value changes with the sign of its argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parity {
    Even,
    Odd,
    Neither,
}

/// A function as Rust calls it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RustCall {
    /// A method of scalars, by its name.
    Method(&'static str),
    /// A function of the crate `libm`, by its name for doubles; the one for single precision has an `f` behind it.
    Library(&'static str),
}

/// Properties of a function.
struct Row {
    /// Names in text: the one that the function is printed with, then other spellings.
    names: &'static [&'static str],
    /// Names of the arguments in [`Row::differential`].
    arguments: &'static [&'static str],
    /// The change of the value in terms of the arguments and of their changes, each called `d` and the argument's name.
    differential: &'static str,
    /// `f(a + b) - f(a)` in terms of `a` and `b`, in a form that keeps the digits of a small `b`; empty where none is known.
    difference: &'static str,
    parity: Parity,
    /// The value where the first argument is zero; empty where text keeps the call.
    at_zero: &'static str,
    /// The value in double precision. Functions of two arguments have an operation of their own.
    double: fn(f64) -> f64,
    /// The value in single precision.
    single: fn(f32) -> f32,
    /// The size of the slope, to tell what the rounding of an argument does to the value; none where nothing is said.
    steepness: Option<fn(f64) -> f64>,
    rust: RustCall,
    /// The function of `math.h`, if there is one; listings in C may call it.
    math_h: Option<&'static str>,
    /// The project's own function, for languages that lack this one or have it with other bits than Rust.
    own: Option<&'static str>,
}

impl Row {
    /// Values that most functions share.
    const ANY: Row = Row {
        names: &[],
        arguments: &["x"],
        differential: "",
        difference: "",
        parity: Parity::Neither,
        at_zero: "",
        double: |_| f64::NAN,
        single: |_| f32::NAN,
        steepness: None,
        rust: RustCall::Method(""),
        math_h: None,
        own: None,
    };
}

macro_rules! functions {
    ($($(#[$about:meta])* $name:ident { $($key:ident: $value:expr,)* })*) => {
        /// A function of one argument, or of two for [`Function::Atan2`] and [`Function::LnOfBoth`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Function {
            $($(#[$about])* $name,)*
        }

        impl Function {
            /// Every function.
            pub const ALL: &'static [Function] = &[$(Function::$name),*];
        }

        /// In the order of [`Function::ALL`].
        const ROWS: &[Row] = &[$(Row { $($key: $value,)* ..Row::ANY }),*];
    };
}

functions! {
    /// Sine.
    Sin {
        names: &["sin"],
        differential: "cos(x)*dx",
        difference: "2*cos(a + b/2)*sin(b/2)",
        parity: Parity::Odd,
        at_zero: "0",
        double: ScalarFunctions::sine,
        single: ScalarFunctions::sine,
        steepness: Some(|_| 1.0),
        rust: RustCall::Method("sine"),
        math_h: Some("sin"),
        own: Some("sine"),
    }
    /// Cosine.
    Cos {
        names: &["cos"],
        differential: "-sin(x)*dx",
        difference: "-2*sin(a + b/2)*sin(b/2)",
        parity: Parity::Even,
        at_zero: "1",
        double: ScalarFunctions::cosine,
        single: ScalarFunctions::cosine,
        steepness: Some(|_| 1.0),
        rust: RustCall::Method("cosine"),
        math_h: Some("cos"),
        own: Some("cosine"),
    }
    /// Tangent.
    Tan {
        names: &["tan"],
        differential: "(1 + tan(x)^2)*dx",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::tan,
        single: libm::tanf,
        rust: RustCall::Library("tan"),
        math_h: Some("tan"),
    }
    /// Inverse sine.
    Asin {
        names: &["arcsin", "asin"],
        // The factors of 1 - x^2 are exact next to one.
        differential: "(1 - x)^(-1/2)*(1 + x)^(-1/2)*dx",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::asin,
        single: libm::asinf,
        rust: RustCall::Library("asin"),
        math_h: Some("asin"),
    }
    /// Inverse cosine.
    Acos {
        names: &["arccos", "acos"],
        differential: "-(1 - x)^(-1/2)*(1 + x)^(-1/2)*dx",
        double: libm::acos,
        single: libm::acosf,
        rust: RustCall::Library("acos"),
        math_h: Some("acos"),
    }
    /// Inverse tangent.
    Atan {
        names: &["arctan", "atan"],
        differential: "dx/(1 + x^2)",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::atan,
        single: libm::atanf,
        rust: RustCall::Library("atan"),
        math_h: Some("atan"),
    }
    /// Hyperbolic sine.
    Sinh {
        names: &["sinh"],
        differential: "cosh(x)*dx",
        difference: "2*cosh(a + b/2)*sinh(b/2)",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::sinh,
        single: libm::sinhf,
        rust: RustCall::Library("sinh"),
        math_h: Some("sinh"),
    }
    /// Hyperbolic cosine.
    Cosh {
        names: &["cosh"],
        differential: "sinh(x)*dx",
        difference: "2*sinh(a + b/2)*sinh(b/2)",
        parity: Parity::Even,
        at_zero: "1",
        double: libm::cosh,
        single: libm::coshf,
        rust: RustCall::Library("cosh"),
        math_h: Some("cosh"),
    }
    /// Hyperbolic tangent.
    Tanh {
        names: &["tanh"],
        // 1 - tanh^2 has no digits left where the tangent is next to one.
        differential: "cosh(x)^(-2)*dx",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::tanh,
        single: libm::tanhf,
        rust: RustCall::Library("tanh"),
        math_h: Some("tanh"),
    }
    /// Exponential.
    Exp {
        names: &["exp"],
        differential: "exp(x)*dx",
        difference: "exp(a)*expm1(b)",
        at_zero: "1",
        double: ScalarFunctions::exponential,
        single: ScalarFunctions::exponential,
        steepness: Some(f64::exp),
        rust: RustCall::Method("exponential"),
        math_h: Some("exp"),
        own: Some("exponential"),
    }
    /// Natural logarithm.
    Ln {
        names: &["ln", "log"],
        differential: "dx/x",
        difference: "log1p(b/a)",
        double: ScalarFunctions::logarithm,
        single: ScalarFunctions::logarithm,
        steepness: Some(|x| 1.0 / x.abs()),
        rust: RustCall::Method("logarithm"),
        math_h: Some("log"),
        own: Some("logarithm"),
    }
    /// `ln(1 + x)`, accurate for small `x`.
    Ln1p {
        names: &["log1p"],
        differential: "dx/(1 + x)",
        difference: "log1p(b/(1 + a))",
        at_zero: "0",
        double: ScalarFunctions::log_1p,
        single: ScalarFunctions::log_1p,
        steepness: Some(|x| 1.0 / (1.0 + x).abs()),
        rust: RustCall::Method("log_1p"),
        math_h: Some("log1p"),
        own: Some("log_1p"),
    }
    /// `ln(1 + x) - x`, accurate for small `x`.
    Ln1pMinusX {
        names: &["log1pmx"],
        differential: "-x/(1 + x)*dx",
        at_zero: "0",
        double: ScalarFunctions::log_1p_minus_x,
        single: ScalarFunctions::log_1p_minus_x,
        steepness: Some(|x| (x / (1.0 + x)).abs()),
        rust: RustCall::Method("log_1p_minus_x"),
        own: Some("log_1p_minus_x"),
    }
    /// `ln(y)` of `y = 1 + x`, given as `(x, y)`: accurate next to one, where `x` has the digits, and next to zero,
    /// where `y` has them.
    LnOfBoth {
        names: &["lnboth"],
        arguments: &["x", "y"],
        differential: "dx/y",
        at_zero: "0",
        // By the first argument, of which the second is one more.
        double: ScalarFunctions::log_1p,
        single: ScalarFunctions::log_1p,
        steepness: Some(|x| 1.0 / (1.0 + x).abs()),
        rust: RustCall::Method("ln_of_both"),
        own: Some("ln_of_both"),
    }
    /// `exp(x) - 1`, accurate for small `x`.
    Expm1 {
        names: &["expm1"],
        differential: "exp(x)*dx",
        difference: "exp(a)*expm1(b)",
        at_zero: "0",
        double: f64::exp_m1,
        single: f32::exp_m1,
        rust: RustCall::Method("exp_m1"),
        math_h: Some("expm1"),
    }
    /// Error function: `2/sqrt(Pi)` times the integral of `exp(-s^2)` from zero to `x`.
    Erf {
        names: &["erf"],
        differential: "2/sqrt(Pi)*exp(-x^2)*dx",
        parity: Parity::Odd,
        at_zero: "0",
        double: libm::erf,
        single: libm::erff,
        rust: RustCall::Library("erf"),
        math_h: Some("erf"),
    }
    /// `atan2(y, x)`, the polar angle of the point `(x, y)`.
    Atan2 {
        names: &["atan2"],
        arguments: &["y", "x"],
        differential: "(x*dy - y*dx)/(x^2 + y^2)",
        rust: RustCall::Library("atan2"),
        math_h: Some("atan2"),
    }
    /// `arcosh(1 + z)^2`: the squared logarithm of `a/b` for `z = (a - b)^2/(2 a b)`, smooth at zero.
    LogRatioSquared {
        names: &["lnratio2"],
        differential: "2*(1 + lnratio2_slope(x))*dx",
        at_zero: "0",
        double: ScalarFunctions::log_ratio_squared,
        single: ScalarFunctions::log_ratio_squared,
        rust: RustCall::Method("log_ratio_squared"),
        own: Some("log_ratio_squared"),
    }
    /// Half the slope of [`Function::LogRatioSquared`] less one, `arcosh(1 + z)/sqrt(z (z + 2)) - 1`.
    LogRatioSlope {
        names: &["lnratio2_slope"],
        differential: "lnratio2_curvature(x)*dx",
        at_zero: "0",
        double: ScalarFunctions::log_ratio_slope,
        single: ScalarFunctions::log_ratio_slope,
        rust: RustCall::Method("log_ratio_slope"),
        own: Some("log_ratio_slope"),
    }
    /// The derivative of [`Function::LogRatioSlope`].
    LogRatioCurvature {
        names: &["lnratio2_curvature"],
        // From z (z + 2) s' = 1 - (1 + z)(1 + s), differentiated once more.
        differential: "-(1 + lnratio2_slope(x) + 3*(1 + x)*lnratio2_curvature(x))/(x*(x + 2))*dx",
        at_zero: "-1/3",
        double: ScalarFunctions::log_ratio_curvature,
        single: ScalarFunctions::log_ratio_curvature,
        rust: RustCall::Method("log_ratio_curvature"),
        own: Some("log_ratio_curvature"),
    }
    /// `cosh(sqrt(y)) - 1` for `y` from zero on, smooth at zero: for `y = n^2 lnratio2(z)` it is `((a/b)^n + (b/a)^n)/2 - 1`.
    CoshSqrtM1 {
        names: &["cosh_sqrt_m1"],
        differential: "(1 + cosh_sqrt_m1_slope(x))/2*dx",
        at_zero: "0",
        double: ScalarFunctions::cosh_sqrt_m1,
        single: ScalarFunctions::cosh_sqrt_m1,
        rust: RustCall::Method("cosh_sqrt_m1"),
        own: Some("cosh_sqrt_m1"),
    }
    /// Twice the slope of [`Function::CoshSqrtM1`] less one, `sinh(sqrt(y))/sqrt(y) - 1`.
    CoshSqrtM1Slope {
        names: &["cosh_sqrt_m1_slope"],
        differential: "cosh_sqrt_m1_curvature(x)*dx",
        at_zero: "0",
        double: ScalarFunctions::cosh_sqrt_m1_slope,
        single: ScalarFunctions::cosh_sqrt_m1_slope,
        rust: RustCall::Method("cosh_sqrt_m1_slope"),
        own: Some("cosh_sqrt_m1_slope"),
    }
    /// The derivative of [`Function::CoshSqrtM1Slope`].
    CoshSqrtM1Curvature {
        names: &["cosh_sqrt_m1_curvature"],
        // From 2 y s' = cosh(sqrt(y)) - 1 - s, differentiated once more.
        differential: "(1 + cosh_sqrt_m1_slope(x) - 6*cosh_sqrt_m1_curvature(x))/(4*x)*dx",
        at_zero: "1/6",
        double: ScalarFunctions::cosh_sqrt_m1_curvature,
        single: ScalarFunctions::cosh_sqrt_m1_curvature,
        rust: RustCall::Method("cosh_sqrt_m1_curvature"),
        own: Some("cosh_sqrt_m1_curvature"),
    }
    /// `max(x, 0)`.
    PositivePart {
        names: &["positive_part"],
        differential: "positive_part_slope(x)*dx",
        at_zero: "0",
        double: ScalarFunctions::positive_part,
        single: ScalarFunctions::positive_part,
        steepness: Some(|_| 1.0),
        rust: RustCall::Method("positive_part"),
        own: Some("positive_part"),
    }
    /// The derivative of [`Function::PositivePart`]: one for `x > 0`, else zero.
    PositivePartSlope {
        names: &["positive_part_slope"],
        // But for zero itself, where it has none.
        differential: "0",
        at_zero: "0",
        double: ScalarFunctions::positive_part_slope,
        single: ScalarFunctions::positive_part_slope,
        rust: RustCall::Method("positive_part_slope"),
        own: Some("positive_part_slope"),
    }
}

impl Function {
    /// Every name that text has for a function, with the function: first those that are printed, then other spellings.
    pub fn names() -> impl Iterator<Item = (&'static str, Function)> {
        let pairs = || Function::ALL.iter().map(|&function| (function, function.row().names));
        let own = pairs().filter_map(|(function, names)| Some((*names.first()?, function)));
        let others = pairs()
            .flat_map(|(function, names)| names.iter().skip(1).map(move |&name| (name, function)));
        own.chain(others)
    }

    /// Names of functions that people write, without those in which laws and fields are formed to keep their digits.
    #[must_use]
    pub fn everyday() -> Vec<&'static str> {
        const OWN: [&str; 9] = [
            "log1pmx",
            "lnboth",
            "lnratio2",
            "lnratio2_slope",
            "lnratio2_curvature",
            "cosh_sqrt_m1",
            "cosh_sqrt_m1_slope",
            "cosh_sqrt_m1_curvature",
            "positive_part_slope",
        ];
        Self::names().map(|(name, _)| name).filter(|name| !OWN.contains(name)).collect()
    }

    /// The function that text calls `name`.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|function| function.row().names.contains(&name))
    }

    /// The name that text uses for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().names.first().copied().unwrap_or("?")
    }

    /// The number of arguments.
    #[must_use]
    pub fn arity(self) -> usize {
        self.row().arguments.len()
    }

    /// How generated Rust calls it.
    #[must_use]
    pub fn rust(self) -> RustCall {
        self.row().rust
    }

    /// The function of the project that generated code has for it where a language lacks it, or has it with other bits than
    /// Rust; `None` where that of `math.h` is called.
    #[must_use]
    pub fn own(self) -> Option<&'static str> {
        self.row().own
    }

    /// Whether Rust and C take it from different libraries, so that last bits may differ.
    #[must_use]
    pub fn is_of_another_library(self) -> bool {
        matches!(self.row().rust, RustCall::Library(_))
    }

    /// Its name in `math.h`, if it has one.
    #[must_use]
    pub fn math_h(self) -> Option<&'static str> {
        self.row().math_h
    }

    /// The value in double precision, of the first argument if there are two; not a number where one is not enough.
    pub(crate) fn double(self, x: f64) -> f64 {
        (self.row().double)(x)
    }

    /// The value in single precision, as [`Function::double`].
    pub(crate) fn single(self, x: f32) -> f32 {
        (self.row().single)(x)
    }

    /// The size of the slope at `x`, of the same argument; not a number where the table says nothing of it.
    pub(crate) fn steepness(self, x: f64) -> f64 {
        self.row().steepness.map_or(f64::NAN, |steepness| steepness(x))
    }

    pub(crate) fn parity(self) -> Parity {
        self.row().parity
    }

    /// The value where the first argument is zero, if text does not keep the call.
    pub(crate) fn at_zero(self) -> Option<&'static Rational> {
        AT_ZERO[self as usize].as_ref()
    }

    /// The change of the value, in terms of the arguments and of their changes, in this order.
    pub(crate) fn differential(self) -> &'static Rule {
        &DIFFERENTIALS[self as usize]
    }

    /// `f(a + b) - f(a)`, in terms of `a` and `b`, if a form is known that keeps the digits of a small `b`.
    pub(crate) fn difference(self) -> Option<&'static Rule> {
        DIFFERENCES[self as usize].as_ref()
    }

    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }
}

static AT_ZERO: LazyLock<Vec<Option<Rational>>> = LazyLock::new(|| {
    let read = |row: &Row| {
        let rule = (!row.at_zero.is_empty()).then(|| Rule::read(row.at_zero, &[]))?;
        rule.graph.as_number(rule.root).cloned()
    };
    ROWS.iter().map(read).collect()
});

static DIFFERENTIALS: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    let read = |row: &Row| {
        let changes = row.arguments.iter().map(|name| format!("d{name}"));
        let names: Vec<String> = row.arguments.iter().map(|&n| n.into()).chain(changes).collect();
        Rule::read(row.differential, &names)
    };
    ROWS.iter().map(read).collect()
});

static DIFFERENCES: LazyLock<Vec<Option<Rule>>> = LazyLock::new(|| {
    let names = ["a", "b"].map(str::to_owned);
    let read = |row: &Row| (!row.difference.is_empty()).then(|| Rule::read(row.difference, &names));
    ROWS.iter().map(read).collect()
});

/// An expression with places to fill in, of a graph of its own.
#[derive(Debug)]
pub(crate) struct Rule {
    graph: Graph,
    root: Expr,
    /// The symbol of each place.
    places: Vec<Expr>,
    mentioned: BTreeSet<Expr>,
}

impl Rule {
    /// A text of the table.
    fn read(text: &str, names: &[String]) -> Self {
        let mut graph = Graph::new();
        let places: Vec<Expr> = names.iter().map(|name| graph.symbol(name)).collect();
        let ast = Ast::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        let place = |name: &str| names.iter().position(|known| known == name);
        let root = graph.build(&ast, &mut |_, name| {
            place(name)
                .map(|index| places[index])
                .ok_or_else(|| format!("no place is called {name}"))
        });
        let root = root.unwrap_or_else(|error| panic!("{text}: {error}"));
        let mentioned = graph.symbols_in(&[root]);
        Rule { graph, root, places, mentioned }
    }

    /// Whether it depends on what fills the place of this number.
    pub(crate) fn mentions(&self, place: usize) -> bool {
        self.mentioned.contains(&self.places[place])
    }

    /// With `values` in the places.
    pub(crate) fn with(&self, graph: &mut Graph, values: &[Expr]) -> Expr {
        self.part(graph, self.root, values)
    }

    fn part(&self, graph: &mut Graph, expr: Expr, values: &[Expr]) -> Expr {
        let mut part = |inner: Expr| self.part(graph, inner, values);
        match self.graph.node(expr) {
            Node::Number(value) => graph.number(value.clone()),
            Node::Pi => graph.pi(),
            // Symbols are numbered in the order in which they were made.
            Node::Symbol(place) => values[*place as usize],
            Node::Sum { constant, terms } => {
                let parts: Vec<_> = terms.iter().map(|(e, c)| (c.clone(), part(*e))).collect();
                let constant = (constant.clone(), Graph::ONE);
                graph.sum(std::iter::once(constant).chain(parts))
            }
            Node::Product(factors) => {
                let parts: Vec<_> = factors.iter().map(|(e, n)| (part(*e), n.clone())).collect();
                graph.product(parts)
            }
            Node::Call(function, arguments) => {
                let parts: Vec<Expr> = arguments.iter().map(|&e| part(e)).collect();
                graph.call(*function, &parts)
            }
            Node::Whole(inner) => {
                let inner = part(*inner);
                graph.whole(inner)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dependence, Program};

    /// The value of an expression of symbols.
    fn value(graph: &mut Graph, expr: Expr, inputs: &[(Expr, f64)]) -> f64 {
        let symbols: Vec<_> = inputs.iter().map(|&(e, _)| (e, Dependence::default())).collect();
        let values: Vec<f64> = inputs.iter().map(|&(_, value)| value).collect();
        Program::lower(graph, &symbols, &[], &[expr]).evaluate(&values)[0]
    }

    fn near(found: f64, expected: f64, error: f64) -> bool {
        (found - expected).abs() <= error * (1.0 + expected.abs())
    }

    #[test]
    fn names_lead_to_their_functions_and_no_name_to_two() {
        let mut seen = BTreeSet::new();
        for (name, function) in Function::names() {
            assert!(seen.insert(name), "{name} twice");
            assert_eq!(Function::from_name(name), Some(function));
            assert!(function.own().or(function.math_h()).is_some(), "{name} in C");
        }
        for &function in Function::ALL {
            assert_eq!(Function::from_name(function.name()), Some(function));
        }
        assert_eq!(Function::from_name("log"), Some(Function::Ln));
        assert_eq!(Function::from_name(""), None);
    }

    /// Signs, zeros, slopes and differences in the rows agree with the values in double precision.
    #[test]
    fn rows_agree_with_their_values() {
        // Those of two arguments have operations of their own, which other tests compare.
        for &function in Function::ALL.iter().filter(|function| function.arity() == 1) {
            let (name, f) = (function.name(), |x: f64| function.double(x));
            for x in [0.1, 0.3, 0.6, 0.9] {
                assert!(f(x).is_finite(), "{name} at {x}");
                match function.parity() {
                    Parity::Odd => assert_eq!(f(-x), -f(x), "{name} at {x}"),
                    Parity::Even => assert_eq!(f(-x), f(x), "{name} at {x}"),
                    Parity::Neither => assert!(f(-x).abs() != f(x).abs(), "{name} at {x}"),
                }
                let slope = (f(x + 1e-5) - f(x - 1e-5)) / 2e-5;
                let mut graph = Graph::new();
                let places = ["x", "dx"].map(|place| graph.symbol(place));
                let change = function.differential().with(&mut graph, &places);
                let found = value(&mut graph, change, &[(places[0], x), (places[1], 2.0)]);
                assert!(near(found, 2.0 * slope, 1e-8), "{name} at {x}: {found}, {slope}");
                // That of a bounded slope may be its bound.
                let steepness = function.steepness(x);
                let told =
                    steepness >= slope.abs() * (1.0 - 1e-8) && steepness <= slope.abs() + 1.0;
                assert!(steepness.is_nan() || told, "{name} at {x}: {steepness}, {slope}");
                let Some(rule) = function.difference() else { continue };
                let mut graph = Graph::new();
                let places = ["a", "b"].map(|place| graph.symbol(place));
                let difference = rule.with(&mut graph, &places);
                for b in [0.05, -0.02] {
                    let found = value(&mut graph, difference, &[(places[0], x), (places[1], b)]);
                    assert!(near(found, f(x + b) - f(x), 1e-14), "{name} from {x} by {b}: {found}");
                }
                // Its digits are those of the small part.
                let found = value(&mut graph, difference, &[(places[0], x), (places[1], 1e-30)]);
                assert!((found / (1e-30 * slope) - 1.0).abs() < 1e-8, "{name} at {x}: {found:e}");
            }
            if let Some(at_zero) = function.at_zero() {
                assert_eq!(f(0.0), crate::nearest_f64(at_zero), "{name} at zero");
            }
        }
    }
}
