//! `[solve]`: coefficients of the displacement, found in closed form from conditions on the fields.
//!
//! A condition such as `P_RR(Ri) = 0` is brought into factors. Those without unknowns do not matter, and of the others
//! the one is taken that is linear in the unknowns, can hold at all times, and, where there are several, holds in the
//! undeformed body: with `P_RR = mu H_RR (2 + H_RR)/(1 + H_RR)` it is `H_RR`. What depends on time or position splits
//! a condition into several, one for each function of them. The linear system is solved by elimination over fractions
//! of polynomials in the parameters, kept in lowest terms.

mod factored;
mod given_values;
mod polynomial;

use self::factored::{Along, Joined, Solution};
use self::polynomial::{Fraction, Polynomial};
use crate::coordinates::Coordinates;
use crate::derivation::Derivation;
use crate::diagnostic::nearest;
use crate::document::{SolveTable, Text};
use crate::law::{self, Deformation};
use crate::scope::Scope;
use crate::{Diagnostic, Spec};
use mmsmith_expr::{Ast, AstKind, Expr, Function, Graph, Node, Program, Rational, Rule, Term};
use num_traits::{Signed, Zero};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use toml::Spanned;

/// More unknowns are not solved for.
const MOST_UNKNOWNS: usize = 12;
/// Expressions in messages are cut at this length.
const LONGEST_SHOWN: usize = 80;

/// Coefficients that were found from conditions.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The unknowns with their values, expressions of the parameters in [`Spec::graph`].
    pub unknowns: Vec<(String, Expr)>,
    /// The result of each condition.
    pub conditions: Vec<SolvedCondition>,
}

/// Result of a condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SolvedCondition {
    /// The condition, as the specification states it.
    pub text: String,
    /// The factor that was made zero.
    pub factor: String,
    /// Other factors that contain unknowns; they are not zero.
    pub others: Vec<String>,
}

/// `sum of coefficient_k unknown_k + constant = 0`, the constant last; each is a sum of terms in the parameters.
struct Equation {
    condition: usize,
    parts: Vec<Vec<Term>>,
}

/// Why a factor gives no linear equations.
enum Obstacle {
    /// An unknown is inside of a function or a broken power.
    Inside(Expr),
    /// A power or a product of unknowns.
    Degree(u32),
    TooLarge,
}

struct Solver<'a> {
    scope: &'a Scope<'a>,
    graph: Graph,
    /// The coordinates in order.
    coordinates: Vec<Expr>,
    /// Position and time.
    variables: BTreeSet<Expr>,
    unknowns: Vec<(String, Expr)>,
    /// Fields in the specification's own components, by their names in conditions.
    fields: BTreeMap<String, Expr>,
    has_lambda: bool,
    is_axisymmetric: bool,
    /// Where conditions hold, by coordinate.
    places: BTreeMap<Expr, BTreeSet<Expr>>,
}

impl Spec {
    /// Finds the unknowns of `[solve]` and puts them into the displacement.
    pub(crate) fn solve(
        &mut self,
        scope: &Scope<'_>,
        table: &Spanned<SolveTable>,
    ) -> Result<(), Diagnostic> {
        let fail = |message: String, span: Range<usize>, help: Option<String>| {
            Err(scope.source.error(message, span, help))
        };
        let names = &table.get_ref().unknowns;
        if names.is_empty() || names.len() > MOST_UNKNOWNS {
            let message =
                format!("{} unknowns; 1 to {MOST_UNKNOWNS} can be solved for", names.len());
            return fail(message, table.span(), None);
        }
        let unknowns: Vec<(String, Expr)> = names
            .iter()
            .filter_map(|name| Some((name.get_ref().clone(), *scope.names().get(name.get_ref())?)))
            .collect();
        let used = self.graph.symbols_in(&self.displacement);
        for (name, (_, symbol)) in names.iter().zip(&unknowns) {
            if !used.contains(symbol) {
                let message =
                    format!("the displacement does not contain the unknown '{}'", name.get_ref());
                let help = "use it in [displacement], or in a [let] expression that feeds it";
                return fail(message, name.span(), Some(help.into()));
            }
        }
        let mut solver = Solver::new(self, scope, unknowns, table.span())?;
        let mut conditions = Vec::new();
        let mut equations = Vec::new();
        for (index, text) in table.get_ref().conditions.iter().enumerate() {
            let (condition, own) = solver.condition(index, text)?;
            conditions.push(condition);
            equations.extend(own);
        }
        let solution = solver.eliminate(equations, table)?;
        let mut replacement = BTreeMap::new();
        let mut found = Vec::new();
        for ((name, symbol), value) in solver.unknowns.iter().zip(&solution.values) {
            let value = expression(&mut solver.graph, value, &solution.atoms);
            let value = transfer(&solver.graph, &mut self.graph, value);
            replacement.insert(*symbol, value);
            found.push((name.clone(), value));
        }
        self.check_defaults(&found, scope, table)?;
        for component in &mut self.displacement {
            let Some(factored) = solver.factored(*component, &solution) else {
                *component = self.graph.replace(*component, &replacement);
                continue;
            };
            *component = transfer(&solver.graph, &mut self.graph, factored);
        }
        for meaning in self.cross_checks.iter_mut().flat_map(|check| check.names.values_mut()) {
            *meaning = self.graph.replace(*meaning, &replacement);
        }
        self.solved = Some(Solved { unknowns: found, conditions });
        Ok(())
    }

    fn check_defaults(
        &mut self,
        found: &[(String, Expr)],
        scope: &Scope<'_>,
        table: &Spanned<SolveTable>,
    ) -> Result<(), Diagnostic> {
        let inputs: Vec<_> = self
            .parameters
            .iter()
            .map(|p| (self.graph.symbol(&p.name), Default::default()))
            .collect();
        let defaults: Vec<f64> = self.parameters.iter().map(|p| p.default).collect();
        let values: Vec<Expr> = found.iter().map(|(_, value)| *value).collect();
        let values = Program::lower(&mut self.graph, &inputs, &[], &values).evaluate(&defaults);
        for ((name, value), number) in found.iter().zip(values) {
            if !number.is_finite() {
                let value = shown(&self.graph, *value);
                let message = format!("{name} = {value} has no value at the default parameters");
                let help =
                    "choose other defaults, and exclude such parameters with require = ['...']";
                return Err(scope.source.error(message, table.span(), Some(help.into())));
            }
        }
        Ok(())
    }
}

impl<'a> Solver<'a> {
    fn new(
        spec: &Spec,
        scope: &'a Scope<'a>,
        unknowns: Vec<(String, Expr)>,
        span: Range<usize>,
    ) -> Result<Self, Diagnostic> {
        let mut derivation = Derivation::new(spec);
        let time = derivation.time;
        let u = spec.displacement.clone();
        let H = derivation.gradient(&u);
        let deformation = Deformation::new(&mut derivation, &u, H.clone());
        let stress = law::stress(&mut derivation, &deformation, spec)
            .map_err(|error| scope.source.error(error.to_string(), span.clone(), None))?;
        if derivation.graph.is_overgrown() {
            let message = "the fields grow too large to solve for anything".to_owned();
            return Err(scope.source.error(message, span, None));
        }
        let names = spec.coordinates.coordinate_names(spec.dimension);
        let mut fields = BTreeMap::from([("J".to_owned(), deformation.J)]);
        for (i, name) in names.iter().enumerate() {
            let v = derivation.derivative(u[i], time);
            let a = derivation.derivative(v, time);
            for (letter, value) in [("u", u[i]), ("v", v), ("a", a)] {
                fields.insert(format!("{letter}_{name}"), value);
            }
            for (j, second) in names.iter().enumerate() {
                let one = if i == j { Graph::ONE } else { Graph::ZERO };
                let F = derivation.graph.add(one, H[i][j]);
                for (letter, value) in [("H", H[i][j]), ("F", F), ("P", stress.P[i][j])] {
                    fields.insert(format!("{letter}_{name}{second}"), value);
                }
            }
        }
        let has_lambda = spec
            .material
            .constants()
            .iter()
            .any(|(constant, value)| constant.name == "lambda" && *value != Graph::ZERO);
        let Derivation { graph, geometry, variables, .. } = derivation;
        let coordinates = geometry.coordinates;
        let places = BTreeMap::new();
        let is_axisymmetric = spec.coordinates == Coordinates::Axisymmetric;
        Ok(Solver {
            scope,
            graph,
            coordinates,
            variables,
            unknowns,
            fields,
            has_lambda,
            is_axisymmetric,
            places,
        })
    }

    /// The linear equations that a condition comes to.
    fn condition(
        &mut self,
        index: usize,
        text: &Text,
    ) -> Result<(SolvedCondition, Vec<Equation>), Diagnostic> {
        let zero = self.difference(text)?;
        let shown_text = text.value.trim().to_owned();
        let fail = |message: String, help: Option<String>| {
            Err(self.scope.source.error(message, text.span.clone(), help))
        };
        let symbols = self.unknown_symbols();
        let mut factors = Vec::new();
        let open = self.graph.open(zero);
        self.collect_factors(open, true, &mut factors);
        factors.retain(|factor| self.graph.depends_on(*factor, &symbols));
        if factors.is_empty() {
            let held = self.graph.vanishes(zero);
            let holds = if held { "holds without them" } else { "cannot hold" };
            let message = format!("'{shown_text}' does not depend on the unknowns: it {holds}");
            return fail(message, Some("remove it, or state another condition".into()));
        }
        let (mut linear, mut obstacles) = (Vec::new(), Vec::new());
        for &factor in &factors {
            match self.equations(index, factor) {
                Ok(equations) => linear.push((factor, equations)),
                Err(obstacle) => obstacles.push((factor, obstacle)),
            }
        }
        if linear.is_empty() {
            let (factor, obstacle) = obstacles.swap_remove(0);
            let (message, help) = self.explained(&shown_text, factor, &obstacle);
            return fail(message, Some(help));
        }
        let lasting = |(_, equations): &(Expr, Vec<Equation>)| {
            equations.iter().all(|equation| !equation.is_contradiction())
        };
        if !linear.iter().any(lasting) {
            let message = format!(
                "'{shown_text}' cannot hold at all times and places with coefficients that depend on neither"
            );
            let help = "both sides need the same factor in t; where a coordinate is left out, the condition is meant \
                        for all its values";
            return fail(message, Some(help.into()));
        }
        linear.retain(lasting);
        if linear.len() > 1 {
            let undeformed = |(_, equations): &(Expr, Vec<Equation>)| {
                equations.iter().all(|equation| equation.parts.last().is_none_or(Vec::is_empty))
            };
            let several = linear.len();
            linear.retain(undeformed);
            if linear.len() != 1 {
                let message = format!(
                    "'{shown_text}' is a product of {several} factors that may each be zero, and {} of them are zero \
                     in the undeformed body",
                    linear.len()
                );
                return fail(
                    message,
                    Some("state the factor that is meant as the condition".into()),
                );
            }
        }
        let Some((taken, equations)) = linear.pop() else {
            return fail(format!("'{shown_text}' gives no equation"), None);
        };
        let others = factors.iter().filter(|factor| **factor != taken);
        let others = others.map(|factor| self.shown(*factor)).collect();
        let condition = SolvedCondition { text: shown_text, factor: self.shown(taken), others };
        Ok((condition, equations))
    }

    /// Left side less right side.
    fn difference(&mut self, text: &Text) -> Result<Expr, Diagnostic> {
        let sides: Vec<&str> = text.value.split('=').collect();
        let [left, right] = sides.as_slice() else {
            let message = "a condition is an equation".to_owned();
            let help = "for example 'P_RR(Ri) = 0' or 'u_R(Ro) = T'";
            return Err(self.scope.source.error(message, text.span.clone(), Some(help.into())));
        };
        let left_value = self.side(text, left, 0)?;
        let right_value = self.side(text, right, left.len() + 1)?;
        let difference = self.graph.sub(left_value, right_value);
        if self.graph.divides_by_zero(difference) {
            let message = "this condition divides by zero, whatever the parameters are";
            return Err(self.scope.source.error(message, text.span.clone(), None));
        }
        Ok(difference)
    }

    /// One side of a condition, which starts at `offset` of the text.
    fn side(&mut self, text: &Text, side: &str, offset: usize) -> Result<Expr, Diagnostic> {
        let source = &self.scope.source;
        let place = |span: &Range<usize>| {
            text.locate(source.text, &(span.start + offset..span.end + offset))
        };
        let ast = Ast::parse(side).map_err(|e| source.error(e.message, place(&e.span), None))?;
        let mut values = BTreeMap::new();
        let ast = self.with_fields(&ast, &mut values).map_err(|(message, span, help)| {
            self.scope.source.error(message, place(&span), help)
        })?;
        let names = self.scope.names();
        let built = self.graph.build(&ast, &mut |_, name| {
            values.get(name).or_else(|| names.get(name)).copied().ok_or_else(|| {
                format!("nothing here is called '{name}'; a field needs its place, as in P_RR(Ri)")
            })
        });
        built.map_err(|e| self.scope.source.error(e.message, place(&e.span), None))
    }

    /// The syntax tree with every field at its place replaced by a name, which `values` knows.
    fn with_fields(
        &mut self,
        ast: &Ast,
        values: &mut BTreeMap<String, Expr>,
    ) -> Result<Ast, (String, Range<usize>, Option<String>)> {
        let mut parts = |parts: &[(bool, Ast)]| -> Result<Vec<(bool, Ast)>, _> {
            parts.iter().map(|(sign, part)| Ok((*sign, self.with_fields(part, values)?))).collect()
        };
        let kind = match &ast.kind {
            AstKind::Number(_) | AstKind::Name(_) => ast.kind.clone(),
            AstKind::Sum(terms) => AstKind::Sum(parts(terms)?),
            AstKind::Product(factors) => AstKind::Product(parts(factors)?),
            AstKind::Power(base, exponent) => AstKind::Power(
                Box::new(self.with_fields(base, values)?),
                Box::new(self.with_fields(exponent, values)?),
            ),
            AstKind::Call(name, arguments) if !self.fields.contains_key(name) => {
                if Function::from_name(name).is_none() && name != "sqrt" && name != "diff" {
                    let known = self.fields.keys().map(String::as_str);
                    let help = match nearest(name, known.clone()) {
                        Some(known) => format!("did you mean '{known}'?"),
                        None => format!("fields are {}", known.collect::<Vec<_>>().join(", ")),
                    };
                    return Err((
                        format!("no field is called '{name}'"),
                        ast.span.clone(),
                        Some(help),
                    ));
                }
                let arguments = arguments.iter().map(|a| self.with_fields(a, values));
                AstKind::Call(name.clone(), arguments.collect::<Result<_, _>>()?)
            }
            AstKind::Call(name, arguments) => {
                let value = self.field_at(name, arguments, ast)?;
                let placeholder = format!("{name}#{}", values.len());
                values.insert(placeholder.clone(), value);
                AstKind::Name(placeholder)
            }
        };
        Ok(Ast { kind, span: ast.span.clone() })
    }

    /// The field `name` with the coordinates that are given put in.
    fn field_at(
        &mut self,
        name: &str,
        arguments: &[Ast],
        ast: &Ast,
    ) -> Result<Expr, (String, Range<usize>, Option<String>)> {
        if arguments.len() > self.coordinates.len() {
            let message = format!(
                "{name} takes {} coordinate(s) at most, not {}",
                self.coordinates.len(),
                arguments.len()
            );
            return Err((message, ast.span.clone(), None));
        }
        let mut place = BTreeMap::new();
        let names = self.scope.names();
        // Nothing of an axisymmetric body depends on the angle, so that a place is a radius and a height.
        let is_left_out = |k: usize| self.is_axisymmetric && arguments.len() < 3 && k == 1;
        let coordinates = self.coordinates.iter().enumerate().filter(|(k, _)| !is_left_out(*k));
        for ((_, coordinate), argument) in coordinates.zip(arguments) {
            let value = self
                .graph
                .build(argument, &mut |_, name| {
                    let known = names.get(name).copied();
                    known.ok_or_else(|| format!("nothing here is called '{name}'"))
                })
                .map_err(|e| (e.message, e.span, None))?;
            let mut varying = self.variables.clone();
            varying.extend(self.unknown_symbols());
            varying.remove(coordinate);
            if value != *coordinate && self.graph.depends_on(value, &varying) {
                let message = "a place may depend on parameters only".to_owned();
                return Err((message, argument.span.clone(), None));
            }
            if value != *coordinate {
                self.places.entry(*coordinate).or_default().insert(value);
            }
            place.insert(*coordinate, value);
        }
        let value = self.fields.get(name).copied().unwrap_or(Graph::ZERO);
        Ok(self.graph.replace(value, &place))
    }

    fn unknown_symbols(&self) -> BTreeSet<Expr> {
        self.unknowns.iter().map(|(_, symbol)| *symbol).collect()
    }

    /// The factors of `expr` that are not divided by, or, with `above` false, those that are.
    fn collect_factors(&self, expr: Expr, above: bool, factors: &mut Vec<Expr>) {
        match self.graph.node(expr) {
            Node::Product(parts) => {
                for (base, power) in parts {
                    self.collect_factors(*base, above == power.is_positive(), factors);
                }
            }
            Node::Sum { constant, terms } if constant.is_zero() && terms.len() == 1 => {
                self.collect_factors(terms[0].0, above, factors);
            }
            _ if above && !factors.contains(&expr) => factors.push(expr),
            _ => {}
        }
    }

    /// The equations that make `factor` zero at all times and places: one for each function of them that occurs.
    fn equations(&mut self, condition: usize, factor: Expr) -> Result<Vec<Equation>, Obstacle> {
        let symbols = self.unknown_symbols();
        let terms = self.graph.numerator(factor).ok_or(Obstacle::TooLarge)?;
        let mut groups: BTreeMap<Vec<(Expr, u32)>, Vec<Vec<Term>>> = BTreeMap::new();
        let count = self.unknowns.len();
        let mut highest = 0;
        for (monomial, coefficient) in terms {
            let (mut unknown, mut degree) = (count, 0);
            let (mut varying, mut fixed) = (Vec::new(), Vec::new());
            for (atom, power) in monomial {
                if let Some(index) = self.unknowns.iter().position(|(_, symbol)| *symbol == atom) {
                    (unknown, degree) = (index, degree + power);
                } else if self.graph.depends_on(atom, &symbols) {
                    return Err(Obstacle::Inside(atom));
                } else if self.graph.depends_on(atom, &self.variables) {
                    varying.push((atom, power));
                } else {
                    fixed.push((atom, power));
                }
            }
            highest = highest.max(degree);
            let parts = groups.entry(varying).or_insert_with(|| vec![Vec::new(); count + 1]);
            parts[unknown].push((fixed, coefficient));
        }
        if highest > 1 {
            return Err(Obstacle::Degree(highest));
        }
        Ok(groups.into_values().map(|parts| Equation { condition, parts }).collect())
    }

    /// The obstacle to a condition, and its remedy.
    fn explained(&self, text: &str, factor: Expr, obstacle: &Obstacle) -> (String, String) {
        let names: Vec<&str> = self.unknowns.iter().map(|(name, _)| name.as_str()).collect();
        let names = names.join(", ");
        match obstacle {
            Obstacle::Inside(atom) => {
                let atom_text = self.shown(*atom);
                let message =
                    format!("'{text}' has no closed form: unknowns are inside of {atom_text}");
                let logarithm = matches!(
                    self.graph.node(*atom),
                    Node::Call(Function::Ln1p | Function::LnOfBoth | Function::Ln, _)
                );
                let help = if logarithm && self.has_lambda {
                    format!(
                        "with lambda = 0 the stress has no ln(J), and may be a product of parts linear in {names}"
                    )
                } else {
                    format!("a condition must be a product of parts linear in {names}")
                };
                (message, help)
            }
            Obstacle::Degree(degree) => {
                let factor = self.shown(factor);
                let message = format!(
                    "'{text}' has no closed form here: its factor {factor} is of degree {degree} in the unknowns"
                );
                (message, format!("a condition must be a product of parts linear in {names}"))
            }
            Obstacle::TooLarge => {
                let message = format!("'{text}' grows too large when it is multiplied out");
                (message, "state a simpler condition that comes to the same".into())
            }
        }
    }

    /// The values of the unknowns, by Gauss-Jordan elimination.
    fn eliminate(
        &mut self,
        equations: Vec<Equation>,
        table: &Spanned<SolveTable>,
    ) -> Result<Solution, Diagnostic> {
        let source = &self.scope.source;
        let fail = |message: String, span: Range<usize>, help: &str| {
            Err(source.error(message, span, Some(help.to_owned())))
        };
        let conditions = &table.get_ref().conditions;
        let too_large = || {
            let message = "the solution grows too large to be of use".to_owned();
            source.error(message, table.span(), Some("solve for fewer unknowns".into()))
        };
        let atoms: BTreeSet<Expr> = equations
            .iter()
            .flat_map(|equation| equation.parts.iter().flatten())
            .flat_map(|(monomial, _)| monomial.iter().map(|(atom, _)| *atom))
            .collect();
        let atoms: Vec<Expr> = atoms.into_iter().collect();
        let mut rows: Vec<(usize, Vec<Fraction>)> = equations
            .into_iter()
            .map(|equation| {
                let parts = equation.parts.iter().map(|terms| fraction(terms, &atoms));
                (equation.condition, parts.collect())
            })
            .collect();
        let count = self.unknowns.len();
        let mut undetermined = Vec::new();
        let mut done = 0;
        for column in 0..count {
            let graph = &mut self.graph;
            let pivot =
                (done..rows.len()).find(|&row| !is_zero(graph, &rows[row].1[column], &atoms));
            let Some(pivot) = pivot else {
                undetermined.push(self.unknowns[column].0.clone());
                continue;
            };
            rows.swap(done, pivot);
            let divisor = rows[done].1[column].clone();
            for entry in &mut rows[done].1 {
                *entry = entry.divided_by(&divisor).ok_or_else(too_large)?;
            }
            let pivot_row = rows[done].1.clone();
            for (other, (_, row)) in rows.iter_mut().enumerate() {
                if other == done || row[column].is_zero() {
                    continue;
                }
                let factor = row[column].clone();
                for (entry, pivot) in row.iter_mut().zip(&pivot_row) {
                    let step = factor.times(pivot).ok_or_else(too_large)?;
                    *entry = entry.minus(&step).ok_or_else(too_large)?;
                }
            }
            done += 1;
        }
        for (condition, row) in &rows[done..] {
            if !is_zero(&mut self.graph, &row[count], &atoms) {
                let text = &conditions[*condition];
                let message = format!("'{}' contradicts the other conditions", text.value.trim());
                return fail(
                    message,
                    text.span.clone(),
                    "with this displacement they cannot hold together",
                );
            }
        }
        if !undetermined.is_empty() {
            let message = format!("the conditions do not determine {}", undetermined.join(", "));
            let help =
                format!("{} more condition(s) are needed that depend on them", undetermined.len());
            return fail(message, table.span(), &help);
        }
        let constants = rows.into_iter().take(count).filter_map(|(_, mut row)| row.pop());
        let values = constants.map(|constant| constant.negated()).collect();
        Ok(Solution { atoms, values })
    }

    /// A component of the displacement with its unknowns put in, where the conditions hold at places along one coordinate and
    /// digits are to be kept between them.
    fn factored(&mut self, component: Expr, solution: &Solution) -> Option<Expr> {
        if Rule::Factored.is_off() {
            return None;
        }
        self.joined(component, solution)?.formed()
    }

    /// A component with its unknowns put in, over one denominator.
    fn joined(&mut self, expr: Expr, solution: &Solution) -> Option<Joined<'_>> {
        let unknowns: Vec<Expr> = self.unknowns.iter().map(|(_, symbol)| *symbol).collect();
        let along = along(&self.places, &self.variables)?;
        Joined::new(&mut self.graph, expr, &unknowns, solution, &along)
    }

    fn shown(&self, expr: Expr) -> String {
        shown(&self.graph, expr)
    }
}

impl Equation {
    /// Whether no unknown is in it, but something else.
    fn is_contradiction(&self) -> bool {
        self.parts.split_last().is_some_and(|(constant, coefficients)| {
            coefficients.iter().all(Vec::is_empty) && !constant.is_empty()
        })
    }
}

/// The coordinate along which conditions hold at `places`, if it is one.
fn along<'a>(
    places: &'a BTreeMap<Expr, BTreeSet<Expr>>,
    variables: &'a BTreeSet<Expr>,
) -> Option<Along<'a>> {
    let mut all = places.iter();
    let (Some((&coordinate, places)), None) = (all.next(), all.next()) else { return None };
    Some(Along { coordinate, places, variables })
}

/// The expression as text, cut where it is long.
fn shown(graph: &Graph, expr: Expr) -> String {
    let text = graph.print(expr);
    match text.char_indices().nth(LONGEST_SHOWN) {
        Some((end, _)) => format!("{} ...", &text[..end]),
        None => text,
    }
}

/// A sum of terms in `atoms`.
fn fraction(terms: &[Term], atoms: &[Expr]) -> Fraction {
    let terms = terms.iter().map(|(monomial, coefficient)| {
        let mut exponents = vec![0; atoms.len()];
        for (atom, power) in monomial {
            if let Ok(index) = atoms.binary_search(atom) {
                exponents[index] += power;
            }
        }
        (exponents, coefficient.clone())
    });
    Fraction::of(Polynomial::of(terms), atoms.len())
}

/// The fraction as an expression.
fn expression(graph: &mut Graph, fraction: &Fraction, atoms: &[Expr]) -> Expr {
    let numerator = sum_of_terms(graph, &fraction.numerator, atoms);
    let denominator = sum_of_terms(graph, &fraction.denominator, atoms);
    graph.div(numerator, denominator)
}

/// The polynomial as an expression, of what its variables mean.
fn sum_of_terms(graph: &mut Graph, polynomial: &Polynomial, meanings: &[Expr]) -> Expr {
    let terms: Vec<(Rational, Expr)> = polynomial
        .terms()
        .map(|(exponents, coefficient)| {
            let factors = meanings.iter().zip(exponents);
            let factors = factors.map(|(&atom, &n)| (atom, Rational::from_integer(n.into())));
            (coefficient.clone(), graph.product(factors.collect::<Vec<_>>()))
        })
        .collect();
    graph.sum(terms)
}

/// Whether the fraction is zero, also where its atoms are not independent, such as `sqrt(E)` and `E`.
fn is_zero(graph: &mut Graph, fraction: &Fraction, atoms: &[Expr]) -> bool {
    if fraction.is_zero() {
        return true;
    }
    let expr = expression(graph, fraction, atoms);
    graph.vanishes(expr)
}

/// The expression in another graph.
fn transfer(from: &Graph, to: &mut Graph, expr: Expr) -> Expr {
    match from.node(expr) {
        Node::Number(value) => to.number(value.clone()),
        Node::Pi => to.pi(),
        Node::Symbol(_) => to.symbol(from.symbol_name(expr).unwrap_or_default()),
        Node::Sum { constant, terms } => {
            let mut moved = vec![(constant.clone(), Graph::ONE)];
            for (term, coefficient) in terms {
                moved.push((coefficient.clone(), transfer(from, to, *term)));
            }
            to.sum(moved)
        }
        Node::Product(factors) => {
            let moved: Vec<_> = factors
                .iter()
                .map(|(base, power)| (transfer(from, to, *base), power.clone()))
                .collect();
            to.product(moved)
        }
        Node::Call(function, arguments) => {
            let moved: Vec<Expr> = arguments.iter().map(|a| transfer(from, to, *a)).collect();
            to.call(*function, &moved)
        }
        Node::Whole(inner) => {
            let moved = transfer(from, to, *inner);
            to.whole(moved)
        }
    }
}
