//! The functions of `runtime.txt`, for every language.

use crate::target::{Called, Target};
use crate::text::with;
use std::collections::{BTreeMap, BTreeSet};
use std::iter::Peekable;
use std::str::Chars;
use std::sync::LazyLock;

/// Operations of functions, beside sums, products and calls of `math.h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Primitive {
    /// The second operand where the first holds, else the third.
    Choose,
    /// Whether the first operand is less than the second.
    Less,
    /// Whether the first operand is at most the second.
    AtMost,
    /// Whether both operands are equal.
    Equal,
    /// The absolute value.
    Abs,
    /// The nearest whole number; halves go to the even number.
    Nearest,
    /// The exponent `e` of `m 2^e` with `m` from 1/2 to 1, as a number.
    Exponent,
    /// `x 2^e`.
    Scaled,
}

/// A language in which functions can be defined, or into whose expressions the functions are written.
pub(crate) trait WithRuntime: Target {
    /// The spelling of a primitive, with `#` for each operand.
    fn primitive(&self, primitive: Primitive) -> &'static str;
}

/// An expression of a function.
#[derive(Clone, Debug)]
enum Term {
    Number(f64),
    Name(String),
    Negative(Box<Term>),
    Sum(Box<[Term; 2]>),
    Difference(Box<[Term; 2]>),
    Product(Box<[Term; 2]>),
    Quotient(Box<[Term; 2]>),
    Primitive(Primitive, Vec<Term>),
    Library(&'static str, Vec<Term>),
    Support(&'static str, Vec<Term>),
}

/// A function of `runtime.txt`.
#[derive(Debug)]
struct Function {
    about: &'static str,
    arguments: Vec<&'static str>,
    steps: Vec<(String, Term)>,
    result: Term,
}

/// A function as a language spells it.
pub(crate) struct Routine {
    /// Its name.
    pub(crate) name: &'static str,
    /// Its value in words.
    pub(crate) about: &'static str,
    /// The names of its arguments.
    pub(crate) arguments: Vec<&'static str>,
    /// Its statements.
    pub(crate) steps: Vec<Step>,
    /// Its value.
    pub(crate) result: String,
    /// The statements for languages in which a function can return early: a value that the result does not need is not computed.
    pub(crate) body: Vec<Line>,
}

/// A line of a function that can return early.
pub(crate) enum Line {
    /// A statement that names a value.
    Step(Step),
    /// Lines that return a value where the condition holds.
    If(String, Vec<Line>),
    /// The return of a value.
    Return(String),
}

/// A statement that names a value.
pub(crate) struct Step {
    /// The name.
    pub(crate) name: String,
    /// The value.
    pub(crate) value: String,
    /// Whether the value is true or false instead of a number.
    pub(crate) is_condition: bool,
}

static FUNCTIONS: LazyLock<BTreeMap<&'static str, Function>> =
    LazyLock::new(|| read(include_str!("runtime.txt")));

/// Transitive callees of `roots`, and `roots`, in definition-before-use order. Functions for which the language has a call of its own
/// are left out.
pub(crate) fn routines<T: WithRuntime>(target: &T, roots: &[&'static str]) -> Vec<Routine> {
    let (mut done, mut routines) = (BTreeSet::new(), Vec::new());
    for root in roots {
        visit(target, root, &mut done, &mut routines);
    }
    routines
}

fn visit<T: WithRuntime>(
    target: &T,
    name: &'static str,
    done: &mut BTreeSet<&'static str>,
    routines: &mut Vec<Routine>,
) {
    // The language's own call has another name than the project's function.
    let own = !target.function(Called::Support(name)).contains(name);
    let Some(function) = FUNCTIONS.get(name).filter(|_| !own && done.insert(name)) else { return };
    let mut called = Vec::new();
    let log1p = target.function(Called::Library("log1p")).contains("log_1p").then_some("log_1p");
    function.steps.iter().for_each(|(_, term)| term.calls(log1p, &mut called));
    function.result.calls(log1p, &mut called);
    for name in called {
        visit(target, name, done, routines);
    }
    let mut body = Vec::new();
    function.lines(target, &function.result, &mut vec![false; function.steps.len()], &mut body);
    routines.push(Routine {
        name,
        about: function.about,
        arguments: function.arguments.clone(),
        steps: function.steps.iter().map(|step| spelled(target, step)).collect(),
        result: function.result.spell(target),
        body,
    });
}

fn spelled<T: WithRuntime>(target: &T, (name, term): &(String, Term)) -> Step {
    Step {
        name: name.clone(),
        value: term.spell(target),
        is_condition: matches!(term, Term::Primitive(p, _) if p.is_condition()),
    }
}

impl Function {
    /// The lines that return `term`; `done` marks the steps that have a line already.
    fn lines<T: WithRuntime>(
        &self,
        target: &T,
        term: &Term,
        done: &mut [bool],
        lines: &mut Vec<Line>,
    ) {
        let branched = term.choice().filter(|[_, first, second]| {
            // Where both values need the same steps and call nothing, a choice between values is enough.
            self.needs(first) != self.needs(second) || first.works() || second.works()
        });
        let now = if branched.is_some() { self.always_needs(term) } else { self.needs(term) };
        for ((step, done), _) in self.steps.iter().zip(&mut *done).zip(now).filter(|(_, now)| *now)
        {
            if !std::mem::replace(done, true) {
                lines.push(Line::Step(spelled(target, step)));
            }
        }
        let Some([condition, first, second]) = branched else {
            return lines.push(Line::Return(term.spell(target)));
        };
        let mut then = Vec::new();
        self.lines(target, first, &mut done.to_vec(), &mut then);
        lines.push(Line::If(condition.spell(target), then));
        self.lines(target, second, done, lines);
    }

    /// Marks the steps that a term needs.
    fn needs(&self, term: &Term) -> Vec<bool> {
        let mut needed = vec![false; self.steps.len()];
        self.need(term, &mut needed);
        needed
    }

    /// Marks the steps that a term needs whichever way its choices go.
    fn always_needs(&self, term: &Term) -> Vec<bool> {
        let Some([condition, first, second]) = term.choice() else { return self.needs(term) };
        let ways = self.always_needs(first).into_iter().zip(self.always_needs(second));
        let both = ways.map(|(first, second)| first && second);
        self.needs(condition).into_iter().zip(both).map(|(now, both)| now || both).collect()
    }

    fn need(&self, term: &Term, needed: &mut [bool]) {
        if let Term::Name(name) = term
            && let Some(index) = self.steps.iter().position(|(step, _)| step == name)
            && !std::mem::replace(&mut needed[index], true)
        {
            self.need(&self.steps[index].1, needed);
        }
        term.parts().iter().for_each(|part| self.need(part, needed));
    }
}

impl Primitive {
    const NAMED: [(&'static str, Primitive); 5] = [
        ("choose", Primitive::Choose),
        ("abs", Primitive::Abs),
        ("nearest", Primitive::Nearest),
        ("exponent", Primitive::Exponent),
        ("scaled", Primitive::Scaled),
    ];

    fn is_condition(self) -> bool {
        matches!(self, Primitive::Less | Primitive::AtMost | Primitive::Equal)
    }
}

impl Term {
    fn parts(&self) -> &[Term] {
        match self {
            Term::Number(_) | Term::Name(_) => &[],
            Term::Negative(part) => std::slice::from_ref(part),
            Term::Sum(parts)
            | Term::Difference(parts)
            | Term::Product(parts)
            | Term::Quotient(parts) => &parts[..],
            Term::Primitive(_, parts) | Term::Library(_, parts) | Term::Support(_, parts) => parts,
        }
    }

    /// The functions of the file that the term calls; `log1p` is the function by which the language calls that of `math.h`, if any.
    fn calls(&self, log1p: Option<&'static str>, names: &mut Vec<&'static str>) {
        match self {
            Term::Support(name, _) => names.push(name),
            Term::Library("log1p", _) => names.extend(log1p),
            _ => {}
        }
        self.parts().iter().for_each(|part| part.calls(log1p, names));
    }

    /// The condition and the two values, if the term is a choice.
    fn choice(&self) -> Option<&[Term; 3]> {
        match self {
            Term::Primitive(Primitive::Choose, parts) => parts[..].try_into().ok(),
            _ => None,
        }
    }

    /// Whether the term is more than a name or a number with a sign.
    fn works(&self) -> bool {
        match self {
            Term::Number(_) | Term::Name(_) => false,
            Term::Negative(part) => part.works(),
            Term::Primitive(Primitive::Choose, parts) => parts[1..].iter().any(Term::works),
            _ => true,
        }
    }

    /// The precedence of the term's operator.
    fn rank(&self) -> u8 {
        match self {
            Term::Sum(_) | Term::Difference(_) => 1,
            Term::Product(_) | Term::Quotient(_) => 2,
            Term::Negative(_) => 0,
            Term::Number(_) | Term::Name(_) | Term::Library(..) | Term::Support(..) => 3,
            Term::Primitive(..) => 3,
        }
    }

    fn spell<T: WithRuntime>(&self, target: &T) -> String {
        let within = |part: &Term, least: u8| {
            let text = part.spell(target);
            if part.rank() < least { format!("({text})") } else { text }
        };
        let infix = |sign: &str, [left, right]: &[Term; 2], rank: u8| {
            format!("{} {sign} {}", within(left, rank), within(right, rank + 1))
        };
        let call = |template: &str, parts: &[Term]| {
            with(template, parts.iter().map(|part| part.spell(target)))
        };
        match self {
            Term::Number(value) => target.literal(*value),
            Term::Name(name) => name.clone(),
            Term::Negative(part) => format!("-{}", within(part, 3)),
            Term::Sum(parts) => infix("+", parts, 1),
            Term::Difference(parts) => infix("-", parts, 1),
            Term::Product(parts) => infix("*", parts, 2),
            Term::Quotient(parts) => infix("/", parts, 2),
            Term::Primitive(primitive, parts) => call(target.primitive(*primitive), parts),
            Term::Library(name, parts) => call(&target.function(Called::Library(name)), parts),
            Term::Support(name, parts) => call(&target.function(Called::Support(name)), parts),
        }
    }
}

/// Reads `runtime.txt`. Faulty lines are left out, which the tests notice.
fn read(text: &'static str) -> BTreeMap<&'static str, Function> {
    let mut functions = BTreeMap::new();
    let mut own: Option<(&'static str, Function)> = None;
    for line in text.lines() {
        let statement = line.trim();
        if let Some(result) = statement.strip_prefix("return ") {
            if let Some((name, mut function)) = own.take() {
                function.result = term(result);
                functions.insert(name, function);
            }
        } else if line.starts_with(' ') {
            let Some((_, function)) = &mut own else { continue };
            match statement.strip_prefix("for k from ").and_then(|rest| rest.split_once(": ")) {
                Some((count, body)) => function.repeat(count.parse().unwrap_or(0), body),
                None => function.step(statement),
            }
        } else if let Some((head, about)) = line.split_once("): ")
            && let Some((name, arguments)) = head.split_once('(')
        {
            let arguments = arguments.split(", ").collect();
            let result = Term::Number(f64::NAN);
            own = Some((name, Function { about, arguments, steps: Vec::new(), result }));
        }
    }
    functions
}

impl Function {
    fn step(&mut self, statement: &str) {
        if let Some((name, value)) = statement.split_once(" = ") {
            self.steps.push((name.to_owned(), term(value)));
        }
    }

    /// Adds the statement for `k = count, ..., 1`; the names of all values but the last end with their number.
    fn repeat(&mut self, count: u32, statement: &str) {
        let Some((name, value)) = statement.split_once(" = ") else { return };
        if let Some((first, _)) = self.steps.last_mut().filter(|(last, _)| last == name) {
            *first = format!("{name}{}", count + 1);
        }
        let value = term(value);
        for k in (1..=count).rev() {
            let named = if k == 1 { name.to_owned() } else { format!("{name}{k}") };
            self.steps.push((named, value.at(k, name)));
        }
    }
}

impl Term {
    /// This term for a value of `k`; `before` is the name of the previous value, without its number.
    fn at(&self, k: u32, before: &str) -> Term {
        let both = |parts: &[Term; 2]| Box::new([parts[0].at(k, before), parts[1].at(k, before)]);
        let folded = |parts: &[Term; 2], of: fn(f64, f64) -> f64| match &*both(parts) {
            [Term::Number(a), Term::Number(b)] => Some(Term::Number(of(*a, *b))),
            _ => None,
        };
        match self {
            Term::Name(name) if name == "k" => Term::Number(f64::from(k)),
            Term::Name(name) if name == before => Term::Name(format!("{before}{}", k + 1)),
            Term::Sum(parts) => {
                folded(parts, |a, b| a + b).unwrap_or_else(|| Term::Sum(both(parts)))
            }
            Term::Difference(parts) => {
                folded(parts, |a, b| a - b).unwrap_or_else(|| Term::Difference(both(parts)))
            }
            Term::Product(parts) => {
                folded(parts, |a, b| a * b).unwrap_or_else(|| Term::Product(both(parts)))
            }
            Term::Quotient(parts) => {
                folded(parts, |a, b| a / b).unwrap_or_else(|| Term::Quotient(both(parts)))
            }
            other => other.clone(),
        }
    }
}

/// A term from its text.
fn term(text: &str) -> Term {
    let packed: String = text.chars().filter(|c| *c != ' ').collect();
    comparison(&mut packed.chars().peekable())
}

fn comparison(rest: &mut Peekable<Chars<'_>>) -> Term {
    let left = sum(rest);
    let primitive = match rest.peek() {
        Some('<') => {
            rest.next();
            if rest.next_if_eq(&'=').is_some() { Primitive::AtMost } else { Primitive::Less }
        }
        Some('=') => {
            rest.nth(1);
            Primitive::Equal
        }
        _ => return left,
    };
    Term::Primitive(primitive, vec![left, sum(rest)])
}

fn sum(rest: &mut Peekable<Chars<'_>>) -> Term {
    let mut left = product(rest);
    loop {
        left = match rest.next_if(|c| "+-".contains(*c)) {
            Some('+') => Term::Sum(Box::new([left, product(rest)])),
            Some(_) => Term::Difference(Box::new([left, product(rest)])),
            None => return left,
        };
    }
}

fn product(rest: &mut Peekable<Chars<'_>>) -> Term {
    let mut left = factor(rest);
    loop {
        left = match rest.next_if(|c| "*/".contains(*c)) {
            Some('*') => Term::Product(Box::new([left, factor(rest)])),
            Some(_) => Term::Quotient(Box::new([left, factor(rest)])),
            None => return left,
        };
    }
}

fn factor(rest: &mut Peekable<Chars<'_>>) -> Term {
    if rest.next_if_eq(&'-').is_some() {
        return match factor(rest) {
            Term::Number(value) => Term::Number(-value),
            other => Term::Negative(Box::new(other)),
        };
    }
    if rest.next_if_eq(&'(').is_some() {
        let inner = comparison(rest);
        rest.next();
        return inner;
    }
    let mut word = String::new();
    while let Some(c) = rest.next_if(|c| c.is_ascii_alphanumeric() || "._".contains(*c)) {
        word.push(c);
        // The sign of an exponent.
        if c == 'e' && word.starts_with(|c: char| c.is_ascii_digit()) {
            word.extend(rest.next_if_eq(&'-'));
        }
    }
    if let Ok(value) = word.parse() {
        return Term::Number(value);
    }
    if rest.next_if_eq(&'(').is_none() {
        return Term::Name(word);
    }
    let mut parts = vec![comparison(rest)];
    while rest.next_if_eq(&',').is_some() {
        parts.push(comparison(rest));
    }
    rest.next();
    if let Some((_, primitive)) = Primitive::NAMED.iter().find(|(name, _)| *name == word) {
        return Term::Primitive(*primitive, parts);
    }
    match ["sqrt", "sin", "cos", "exp", "log", "log1p"].into_iter().find(|name| *name == word) {
        Some(name) => Term::Library(name, parts),
        None => Term::Support(String::leak(word), parts),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use mmsmith_expr::Function as Named;

    fn value(name: &str, arguments: &[f64]) -> f64 {
        let function = &FUNCTIONS[name];
        let mut known: BTreeMap<String, f64> = function
            .arguments
            .iter()
            .map(|name| (*name).to_owned())
            .zip(arguments.iter().copied())
            .collect();
        for (name, term) in &function.steps {
            let value = evaluate(term, &known);
            known.insert(name.clone(), value);
        }
        evaluate(&function.result, &known)
    }

    /// Conditions are one or zero.
    fn evaluate(term: &Term, known: &BTreeMap<String, f64>) -> f64 {
        let parts: Vec<f64> = term.parts().iter().map(|part| evaluate(part, known)).collect();
        match (term, parts.as_slice()) {
            (Term::Number(value), _) => *value,
            (Term::Name(name), _) => known[name],
            (Term::Negative(_), [a]) => -a,
            (Term::Sum(_), [a, b]) => a + b,
            (Term::Difference(_), [a, b]) => a - b,
            (Term::Product(_), [a, b]) => a * b,
            (Term::Quotient(_), [a, b]) => a / b,
            (Term::Support(name, _), parts) => value(name, parts),
            (Term::Library("sqrt", _), [a]) => a.sqrt(),
            (Term::Library("sin", _), [a]) => a.sin(),
            (Term::Library("cos", _), [a]) => a.cos(),
            (Term::Library("exp", _), [a]) => a.exp(),
            (Term::Library("log", _), [a]) => a.ln(),
            (Term::Library("log1p", _), [a]) => a.ln_1p(),
            (Term::Primitive(Primitive::Choose, _), [c, a, b]) => {
                if *c == 1.0 {
                    *a
                } else {
                    *b
                }
            }
            (Term::Primitive(Primitive::Less, _), [a, b]) => f64::from(u8::from(a < b)),
            (Term::Primitive(Primitive::AtMost, _), [a, b]) => f64::from(u8::from(a <= b)),
            (Term::Primitive(Primitive::Equal, _), [a, b]) => f64::from(u8::from(a == b)),
            (Term::Primitive(Primitive::Abs, _), [a]) => a.abs(),
            (Term::Primitive(Primitive::Nearest, _), [a]) => a.round_ties_even(),
            (Term::Primitive(Primitive::Exponent, _), [a]) => a.abs().log2().floor() + 1.0,
            (Term::Primitive(Primitive::Scaled, _), [a, e]) => a * e.exp2(),
            other => panic!("{other:?}"),
        }
    }

    /// Each function gives the bits of the crate of scalar functions.
    #[test]
    fn the_file_says_the_functions_of_the_crate() {
        use mmsmith_scalar_functions::ScalarFunctions as S;
        let arguments: Vec<f64> = (0..400)
            .map(|k| 0.013 * f64::from(k))
            .chain([1e-9, 0.999, 37.5, 1e4, 0.25, 0.5, 1.0, 1e6, 1.3e6, 7.7e9, 2.9e13])
            .collect();
        type Case = (&'static str, fn(f64) -> f64, bool);
        let cases: [Case; 17] = [
            ("sine", S::sine, true),
            ("cosine", S::cosine, true),
            ("exponential", S::exponential, true),
            ("logarithm", S::logarithm, false),
            ("sin_pi", S::sin_pi, true),
            ("cos_pi", S::cos_pi, true),
            ("log_1p", S::log_1p, false),
            ("log_1p_minus_x", S::log_1p_minus_x, false),
            ("log_ratio_squared", S::log_ratio_squared, false),
            ("log_ratio_slope", S::log_ratio_slope, false),
            ("log_ratio_curvature", S::log_ratio_curvature, false),
            ("cosh_sqrt_m1", S::cosh_sqrt_m1, false),
            ("cosh_sqrt_m1_slope", S::cosh_sqrt_m1_slope, false),
            ("cosh_sqrt_m1_curvature", S::cosh_sqrt_m1_curvature, false),
            ("positive_part", S::positive_part, true),
            ("positive_part_slope", S::positive_part_slope, true),
            ("ln_of_both", |x| S::log_1p(x), false),
        ];
        for (name, expected, signed) in cases {
            for x in arguments.iter().flat_map(|x| [*x, -*x]).filter(|x| signed || *x >= 0.0) {
                let found = if name == "ln_of_both" {
                    value(name, &[x, f64::NAN])
                } else {
                    value(name, &[x])
                };
                let expected = expected(x);
                assert!(
                    found.to_bits() == expected.to_bits() || found == expected && x == 0.0,
                    "{name}({x}) = {found}, not {expected}"
                );
            }
        }
        for y in [1e-9, 0.03, 0.2, 0.49, 1e-300] {
            assert_eq!(value("ln_of_both", &[y - 1.0, y]), (y - 1.0).ln_of_both(y), "{y}");
        }
        for (a, b) in [(0.1, 0.7), (1e9, -1e-7), (-3.3, 1.0 / 3.0)] {
            assert_eq!(value("sum_error", &[a, b]), a.sum_error(b));
            assert_eq!(value("product_error", &[a, b]), a.product_error(b));
        }
        assert_eq!(value("log_1p", &[-1.0]), f64::NEG_INFINITY);
        assert!(value("log_1p", &[f64::NAN]).is_nan());
        for x in [-0.3, -0.5, -0.7, -1.0, f64::INFINITY] {
            assert_eq!(value("log_1p_minus_x", &[x]), x.log_1p_minus_x(), "{x}");
        }
    }

    /// The file has every function that generated code calls.
    #[test]
    fn no_function_is_missing() {
        for function in Named::ALL {
            if let Called::Support(name) = Called::of(*function) {
                assert!(FUNCTIONS.contains_key(name), "{name}");
            }
        }
        for function in FUNCTIONS.values() {
            let mut called = Vec::new();
            function.steps.iter().for_each(|(_, term)| term.calls(None, &mut called));
            function.result.calls(None, &mut called);
            assert!(called.iter().all(|name| FUNCTIONS.contains_key(name)), "{called:?}");
        }
    }
}
