//! Fields as set formulas: trees of MathML elements, which the page makes nodes of.
//!
//! A tree is an array of an element's name and its children, of which texts are strings. What occurs more than once, or is long, has a
//! name and a line of its own: the names of `[let]` where it is one of these expressions.

use crate::refusal::Refusal;
use crate::session::Session;
use mmsmith_expr::{Expr, Graph, Node, Rational};
use num_traits::{One, Signed, Zero};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// An expression that is shorter is written out where it occurs.
const SHORTEST_NAMED: usize = 7;
/// An expression that is longer, or nests deeper, has a line of its own.
const LONGEST: usize = 45;
const DEEPEST: usize = 9;
/// Nobody reads more lines.
const MOST_LINES: usize = 250;

/// The formulas of a field, and of what these refer to.
pub(crate) fn of(session: &Session, field: &str) -> Result<Value, Refusal> {
    let spec = &session.spec;
    if field == "u" {
        // As stated, in the specification's own coordinates.
        let names = spec.coordinates.coordinate_names(spec.dimension);
        let components = names.iter().map(|name| sub(name_of("u"), &[name]));
        let roots: Vec<(Value, Expr)> = components.zip(spec.displacement.iter().copied()).collect();
        let set = Set::new(&spec.graph, &spec.lets, &[], &roots);
        let mut answer = set.answer(&roots);
        answer["law"] = json!(spec.law_formulas());
        answer["rotation"] = json!(spec.rotation.map(|rotation| rotation.formula(&spec.graph)));
        return Ok(answer);
    }
    let fields = session.shown_fields()?;
    let all = [
        ("v", fields.v.iter().map(|&entry| vec![entry]).collect()),
        ("a", fields.a.iter().map(|&entry| vec![entry]).collect()),
        ("b", fields.b.iter().map(|&entry| vec![entry]).collect()),
        ("J", vec![vec![fields.J]]),
        ("H", fields.H.clone()),
        ("F", fields.F.clone()),
        ("P", fields.P.clone()),
    ];
    let Some((letter, rows)) = all.into_iter().find(|(letter, _)| *letter == field) else {
        return Err(format!("there is no field '{field}'").into());
    };
    if rows.is_empty() {
        return Err(format!(
            "{letter} follows from the history of each particle, for which there is no formula; files of hosts read it from a table"
        )
        .into());
    }
    // A body of revolution is shown in its half plane.
    let names = match spec.coordinates.name() {
        "axisymmetric" => spec.coordinates.coordinate_names(3),
        _ => &["X", "Y", "Z"],
    };
    let mut roots = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        for (j, &entry) in row.iter().enumerate() {
            let is_scalar = letter == "J";
            let of: Vec<&str> = match (is_scalar, row.len()) {
                (true, _) => Vec::new(),
                (false, 1) if rows.len() != 1 || "vab".contains(letter) => vec![names[i % 3]],
                _ => vec![names[i % 3], names[j % 3]],
            };
            roots.push((sub(name_of(letter), &of), entry));
        }
    }
    let set = Set::new(&fields.graph, &spec.lets, &fields.definitions, &roots);
    Ok(set.answer(&roots))
}

/// A letter with indices.
fn sub(letter: Value, indices: &[&str]) -> Value {
    if indices.is_empty() {
        return letter;
    }
    let indices: Vec<Value> = indices.iter().map(|index| name_of(index)).collect();
    json!(["msub", letter, row(indices)])
}

/// Which parts of expressions have names, and in which order they are told.
struct Set<'a> {
    graph: &'a Graph,
    /// Coordinates in terms of others, where they occur.
    coordinates: Vec<(Expr, Expr)>,
    named: BTreeMap<Expr, Value>,
    /// The expressions of `[let]` that are a power, by base and exponent: as factors they are lost in products.
    powers: BTreeMap<(Expr, Rational), Expr>,
    /// Names that are told, each after the names that it refers to.
    lines: Vec<Expr>,
}

impl<'a> Set<'a> {
    fn new(
        graph: &'a Graph,
        lets: &[(String, Expr)],
        definitions: &[(Expr, Expr)],
        roots: &[(Value, Expr)],
    ) -> Self {
        let (mut stated, mut powers) = (BTreeMap::new(), BTreeMap::new());
        for (name, expr) in lets {
            let expr = inner(graph, *expr);
            if is_leaf(graph, expr) {
                continue;
            }
            stated.entry(expr).or_insert_with(|| name_of(name));
            if let Node::Product(factors) = graph.node(expr)
                && let [(base, exponent)] = &**factors
            {
                powers.entry((*base, exponent.abs())).or_insert(expr);
            }
        }
        let own: Vec<Expr> = roots.iter().map(|(_, root)| inner(graph, *root)).collect();
        let mut uses: BTreeMap<Expr, usize> = BTreeMap::new();
        let mut seen = BTreeSet::new();
        let mut open = own.clone();
        own.iter().for_each(|root| *uses.entry(*root).or_default() += 1);
        while let Some(expr) = open.pop() {
            if seen.insert(expr) {
                for child in parts(graph, &powers, expr) {
                    *uses.entry(child).or_default() += 1;
                    open.push(child);
                }
            }
        }
        // In the half plane R is the first coordinate itself.
        let occurs =
            |(symbol, value): &&(Expr, Expr)| seen.contains(symbol) && !is_leaf(graph, *value);
        let coordinates: Vec<_> = definitions.iter().filter(occurs).copied().collect();
        let (named, lines) = (BTreeMap::new(), Vec::new());
        let mut set = Set { graph, coordinates, named, powers, lines };
        let mut sizes: BTreeMap<Expr, [usize; 2]> = BTreeMap::new();
        let mut count = 0;
        // What an expression is made of has smaller handles.
        for &expr in &seen {
            let [mut size, mut depth] = [1, 1];
            for part in parts(graph, &set.powers, expr) {
                let [own_size, own_depth] = sizes.get(&part).copied().unwrap_or([1, 1]);
                size += own_size;
                depth = depth.max(1 + own_depth);
            }
            let often = uses.get(&expr).copied().unwrap_or(0) > 1;
            let is_only_root = own.contains(&expr) && !often;
            let is_long = size > LONGEST || depth > DEEPEST;
            let name = match stated.get(&expr) {
                _ if is_only_root => None,
                Some(name) => Some(name.clone()),
                None if is_long || (often && size >= SHORTEST_NAMED) => {
                    count += 1;
                    Some(json!(["msub", ["mi", "s"], ["mn", count.to_string()]]))
                }
                None => None,
            };
            if let Some(name) = name {
                set.named.insert(expr, name);
                set.lines.push(expr);
                [size, depth] = [1, 1];
            }
            sizes.insert(expr, [size, depth]);
        }
        set
    }

    fn answer(&self, roots: &[(Value, Expr)]) -> Value {
        let lines = self.coordinates.len() + self.lines.len() + roots.len();
        if lines > MOST_LINES {
            return json!({
                "long": format!("{lines} lines of formulas, more than anyone reads: the files of hosts have them"),
            });
        }
        let coordinates = self.coordinates.iter().map(|(symbol, value)| {
            let name = name_of(self.graph.symbol_name(*symbol).unwrap_or_default());
            equation(&name, self.tree(*value).0)
        });
        let lines = self
            .lines
            .iter()
            .filter_map(|&line| Some(equation(self.named.get(&line)?, self.own_tree(line).0)));
        let where_ = coordinates.chain(lines).collect::<Vec<_>>();
        let fields = roots.iter().map(|(name, root)| equation(name, self.tree(*root).0));
        json!({ "fields": fields.collect::<Vec<_>>(), "where": where_ })
    }

    /// An expression, by its name where it has one.
    fn tree(&self, expr: Expr) -> (Value, Binding) {
        let expr = inner(self.graph, expr);
        match self.named.get(&expr) {
            Some(name) => (name.clone(), Binding::Atom),
            None => self.own_tree(expr),
        }
    }

    fn own_tree(&self, expr: Expr) -> (Value, Binding) {
        match self.graph.node(expr) {
            Node::Number(value) => number(value),
            Node::Pi => (json!(["mi", "\u{3c0}"]), Binding::Atom),
            Node::Symbol(_) => {
                (name_of(self.graph.symbol_name(expr).unwrap_or_default()), Binding::Atom)
            }
            Node::Call(function, arguments) => {
                let mut inside = Vec::new();
                for (n, &argument) in arguments.iter().enumerate() {
                    if n > 0 {
                        inside.push(json!(["mo", ","]));
                    }
                    inside.push(self.tree(argument).0);
                }
                let name = json!(["mi", function.name()]);
                (row(vec![name, applied(), fenced(row(inside))]), Binding::Atom)
            }
            Node::Whole(part) => self.tree(*part),
            Node::Product(factors) => self.product(factors, &Rational::one(), Some(expr)),
            Node::Sum { constant, terms } => self.sum(constant, terms),
        }
    }

    fn sum(&self, constant: &Rational, terms: &[(Expr, Rational)]) -> (Value, Binding) {
        if constant.is_zero()
            && let [(term, coefficient)] = terms
        {
            return self.scaled(*term, coefficient);
        }
        let mut all = Vec::new();
        if !constant.is_zero() {
            all.push(number(constant).0);
        }
        for (term, coefficient) in terms {
            let (term, coefficient) = self.with_sign(*term, coefficient);
            let (part, binding) = self.scaled(term, &coefficient.abs());
            let is_negative = coefficient.is_negative();
            // A sum that is added needs no parentheses, unless it begins with a sign.
            let is_signed = part.get(1).is_some_and(|first| *first == minus());
            let needs = binding == Binding::Sum && (is_negative || (is_signed && !all.is_empty()));
            let part = if needs { fenced(part) } else { part };
            if is_negative {
                all.push(minus());
            } else if !all.is_empty() {
                all.push(json!(["mo", "+"]));
            }
            all.push(part);
        }
        (row(all), Binding::Sum)
    }

    /// A term with what scales it, where it is itself a scaled expression without a name.
    fn with_sign(&self, term: Expr, coefficient: &Rational) -> (Expr, Rational) {
        let term = inner(self.graph, term);
        match self.graph.node(term) {
            Node::Sum { constant, terms }
                if constant.is_zero() && !self.named.contains_key(&term) =>
            {
                match &**terms {
                    [(own, factor)] => (*own, factor * coefficient),
                    _ => (term, coefficient.clone()),
                }
            }
            _ => (term, coefficient.clone()),
        }
    }

    fn scaled(&self, term: Expr, coefficient: &Rational) -> (Value, Binding) {
        let term = inner(self.graph, term);
        if coefficient.is_one() {
            return self.tree(term);
        }
        match self.graph.node(term) {
            Node::Product(factors) if !self.named.contains_key(&term) => {
                self.product(factors, coefficient, None)
            }
            _ => self.product(&[(term, Rational::one())], coefficient, None),
        }
    }

    fn product(
        &self,
        factors: &[(Expr, Rational)],
        coefficient: &Rational,
        own: Option<Expr>,
    ) -> (Value, Binding) {
        let whole = |n: Rational| number(&n).0;
        let (mut above, mut below) = (Vec::new(), Vec::new());
        let numerator = Rational::from_integer(coefficient.numer().abs());
        let denominator = Rational::from_integer(coefficient.denom().clone());
        if !numerator.is_one() {
            above.push(whole(numerator));
        }
        if !denominator.is_one() {
            below.push(whole(denominator));
        }
        // A factor alone in a fraction needs no parentheses.
        let count = |is_below: bool| {
            factors.iter().filter(|(_, exponent)| exponent.is_negative() == is_below).count()
        };
        let (count_above, count_below) = (above.len() + count(false), below.len() + count(true));
        let is_fraction = count_below > 0;
        for (base, exponent) in factors {
            let is_below = exponent.is_negative();
            let size = exponent.abs();
            // But where this is the power that is stated.
            let stated =
                self.powers.get(&(*base, size.clone())).filter(|power| Some(**power) != own);
            if let Some(name) = stated.and_then(|power| self.named.get(power)) {
                if is_below { &mut below } else { &mut above }.push(name.clone());
                continue;
            }
            let is_alone =
                if is_below { count_below == 1 } else { is_fraction && count_above == 1 };
            let place = if is_below { &mut below } else { &mut above };
            place.push(self.power(*base, &size, is_alone));
        }
        if above.is_empty() {
            above.push(json!(["mn", "1"]));
        }
        let above = between(above);
        let value = if below.is_empty() { above } else { json!(["mfrac", above, between(below)]) };
        if coefficient.is_negative() {
            (row(vec![minus(), value]), Binding::Sum)
        } else {
            (value, Binding::Product)
        }
    }

    /// `base ^ exponent` for a positive exponent.
    fn power(&self, base: Expr, exponent: &Rational, is_alone: bool) -> Value {
        let (value, binding) = self.tree(base);
        let is_root = exponent.numer().is_one() && !exponent.is_one();
        if is_root && *exponent == Rational::new(1.into(), 2.into()) {
            return json!(["msqrt", value]);
        }
        if is_root {
            return json!(["mroot", value, ["mn", exponent.denom().to_string()]]);
        }
        if exponent.is_one() {
            let needs = binding == Binding::Sum && !is_alone;
            return if needs { fenced(value) } else { value };
        }
        let exponent = number(exponent).0;
        // sin^2(x), as it is printed.
        let base = inner(self.graph, base);
        if let (Node::Call(function, arguments), false) =
            (self.graph.node(base), self.named.contains_key(&base))
            && let [argument] = **arguments
        {
            let name = json!(["msup", ["mi", function.name()], exponent]);
            return row(vec![name, applied(), fenced(self.tree(argument).0)]);
        }
        let base = if binding == Binding::Atom { value } else { fenced(value) };
        json!(["msup", base, exponent])
    }
}

/// How tightly a tree binds.
#[derive(Clone, Copy, PartialEq)]
enum Binding {
    Sum,
    Product,
    Atom,
}

/// The expression without the mark that algebra leaves it in one piece.
fn inner(graph: &Graph, mut expr: Expr) -> Expr {
    while let Node::Whole(part) = graph.node(expr) {
        expr = *part;
    }
    expr
}

fn is_leaf(graph: &Graph, expr: Expr) -> bool {
    matches!(graph.node(expr), Node::Number(_) | Node::Pi | Node::Symbol(_))
}

/// The parts of an expression, with powers that are stated in the place of their bases.
fn parts(graph: &Graph, powers: &BTreeMap<(Expr, Rational), Expr>, expr: Expr) -> Vec<Expr> {
    let Node::Product(factors) = graph.node(expr) else {
        return graph.children(expr).map(|child| inner(graph, child)).collect();
    };
    let stated = |(base, exponent): &(Expr, Rational)| {
        let power = powers.get(&(*base, exponent.abs())).filter(|power| **power != expr);
        inner(graph, power.copied().unwrap_or(*base))
    };
    factors.iter().map(stated).collect()
}

fn row(children: Vec<Value>) -> Value {
    match <[Value; 1]>::try_from(children) {
        Ok([only]) => only,
        Err(children) => {
            Value::Array(std::iter::once(Value::from("mrow")).chain(children).collect())
        }
    }
}

fn fenced(value: Value) -> Value {
    json!(["mrow", ["mo", "("], value, ["mo", ")"]])
}

fn minus() -> Value {
    json!(["mo", "\u{2212}"])
}

/// The operator of a function that is applied, which nobody sees.
fn applied() -> Value {
    json!(["mo", "\u{2061}"])
}

/// Factors with a thin space between them.
fn between(factors: Vec<Value>) -> Value {
    let mut all = Vec::new();
    for factor in factors {
        if !all.is_empty() {
            all.push(json!(["mspace"]));
        }
        all.push(factor);
    }
    row(all)
}

fn equation(name: &Value, value: Value) -> Value {
    json!(["mrow", name, ["mo", "="], value])
}

fn number(value: &Rational) -> (Value, Binding) {
    let digits = |n: String| json!(["mn", n]);
    let size = match value.is_integer() {
        true => digits(value.numer().abs().to_string()),
        false => json!([
            "mfrac",
            digits(value.numer().abs().to_string()),
            digits(value.denom().to_string())
        ]),
    };
    match (value.is_negative(), value.is_integer()) {
        (true, _) => (row(vec![minus(), size]), Binding::Sum),
        (false, true) => (size, Binding::Atom),
        (false, false) => (size, Binding::Product),
    }
}

/// Greek letters by their names.
const GREEK: &[(&str, &str)] = &[
    ("alpha", "\u{3b1}"),
    ("beta", "\u{3b2}"),
    ("gamma", "\u{3b3}"),
    ("delta", "\u{3b4}"),
    ("epsilon", "\u{3b5}"),
    ("zeta", "\u{3b6}"),
    ("eta", "\u{3b7}"),
    ("theta", "\u{3b8}"),
    ("kappa", "\u{3ba}"),
    ("lambda", "\u{3bb}"),
    ("mu", "\u{3bc}"),
    ("nu", "\u{3bd}"),
    ("xi", "\u{3be}"),
    ("rho", "\u{3c1}"),
    ("sigma", "\u{3c3}"),
    ("tau", "\u{3c4}"),
    ("phi", "\u{3c6}"),
    ("chi", "\u{3c7}"),
    ("psi", "\u{3c8}"),
    ("omega", "\u{3c9}"),
];

/// A name: Greek letters as such, digits at the end and what follows an underscore as an index.
fn name_of(name: &str) -> Value {
    let (stem, index) = match name.split_once('_') {
        Some((stem, index)) if !stem.is_empty() && !index.is_empty() => (stem, index),
        _ => {
            let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
            let stem = if stem.is_empty() { name } else { stem };
            (stem, &name[stem.len()..])
        }
    };
    let letter = |word: &str| {
        let greek = GREEK.iter().find(|(name, _)| *name == word);
        json!(["mi", greek.map_or(word, |(_, letter)| letter)])
    };
    if index.is_empty() { letter(stem) } else { json!(["msub", letter(stem), letter(index)]) }
}
