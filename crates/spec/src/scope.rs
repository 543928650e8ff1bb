//! Names and what they stand for: coordinates, time, parameters and `[let]` expressions.

use crate::Diagnostic;
use crate::diagnostic::nearest;
use crate::document::Text;
use crate::source::Source;
use mmsmith_expr::{Ast, AstKind, Expr, Function, Graph};
use std::collections::{BTreeMap, BTreeSet};

/// Names have at most this many characters.
const LONGEST_NAME: usize = 64;

impl Source<'_> {
    pub(crate) fn parse(&self, text: &Text) -> Result<Ast, Diagnostic> {
        Ast::parse(&text.value)
            .map_err(|e| self.error(e.message, text.locate(self.text, &e.span), None))
    }
}

/// The names of one specification.
pub(crate) struct Scope<'a> {
    pub(crate) source: Source<'a>,
    pub(crate) graph: Graph,
    names: BTreeMap<String, Expr>,
    /// The `[let]` expressions, each after those that it refers to.
    pub(crate) lets: Vec<(String, Expr)>,
    /// Names that exist but not here, with the reason.
    elsewhere: BTreeMap<String, String>,
    pub(crate) coordinates: Vec<Expr>,
    pub(crate) time: Expr,
    /// The unknowns of `[solve]`.
    unknowns: BTreeSet<Expr>,
    /// The names of `[given]`, which mean something in the law alone.
    given: BTreeMap<String, Expr>,
}

impl<'a> Scope<'a> {
    /// A scope with the coordinates `names` and the time `t`.
    pub(crate) fn new(source: Source<'a>, coordinates: &[&str]) -> Self {
        let mut graph = Graph::new();
        let time = graph.symbol("t");
        let mut names = BTreeMap::from([("t".to_owned(), time)]);
        let mut symbols = Vec::new();
        for &name in coordinates {
            let symbol = graph.symbol(name);
            names.insert(name.to_owned(), symbol);
            symbols.push(symbol);
        }
        let listed = coordinates.join(", ");
        let elsewhere = ["X", "Y", "Z", "R", "theta", "phi"]
            .into_iter()
            .filter(|name| !coordinates.contains(name))
            .map(|name| (name.to_owned(), format!("the coordinates of this file are {listed}")))
            .collect();
        Scope {
            source,
            graph,
            names,
            lets: Vec::new(),
            elsewhere,
            coordinates: symbols,
            time,
            unknowns: BTreeSet::new(),
            given: BTreeMap::new(),
        }
    }

    /// Every name with its meaning.
    pub(crate) fn names(&self) -> &BTreeMap<String, Expr> {
        &self.names
    }

    /// Adds a parameter.
    pub(crate) fn declare(
        &mut self,
        name: &str,
        span: std::ops::Range<usize>,
    ) -> Result<(), Diagnostic> {
        self.check_new_name(name, span)?;
        let symbol = self.graph.symbol(name);
        self.names.insert(name.to_owned(), symbol);
        Ok(())
    }

    /// Adds a field of `[given]`, which the fields after it, and the law, may use. The names of coordinates that are not those of the
    /// file are free: `theta` may be a temperature.
    pub(crate) fn declare_given(
        &mut self,
        name: &str,
        span: std::ops::Range<usize>,
        text: &Text,
    ) -> Result<(Expr, Expr), Diagnostic> {
        let elsewhere = std::mem::take(&mut self.elsewhere);
        let checked = self.check_new_name(name, span.clone());
        self.elsewhere = elsewhere;
        checked?;
        if self.given.contains_key(name) {
            let message = format!("the name '{name}' is declared twice");
            return Err(self.source.error(message, span, Some("choose another name".into())));
        }
        let value = self.with_given(|scope| scope.expression(text))?;
        if self.has_unknowns(value) {
            let message =
                format!("the given field '{name}' may not depend on the unknowns of [solve]");
            return Err(self.source.error(message, text.span.clone(), None));
        }
        let symbol = self.graph.symbol(name);
        self.given.insert(name.to_owned(), symbol);
        Ok((symbol, value))
    }

    /// `work` where the names of `[given]` are known.
    pub(crate) fn with_given<R>(&mut self, work: impl FnOnce(&mut Self) -> R) -> R {
        let declared = self.names.clone();
        self.names.extend(self.given.iter().map(|(name, symbol)| (name.clone(), *symbol)));
        let result = work(self);
        self.names = declared;
        result
    }

    /// As [`Scope::expression`], for a constant of a law, which may depend on position, time, and given fields.
    pub(crate) fn constant_of_law(&mut self, text: &Text, what: &str) -> Result<Expr, Diagnostic> {
        let expr = self.with_given(|scope| scope.expression(text))?;
        if self.has_unknowns(expr) {
            let message = format!("{what} may not depend on the unknowns of [solve]");
            let help = "unknowns are for [displacement], and for [let] expressions that feed it";
            return Err(self.source.error(message, text.span.clone(), Some(help.into())));
        }
        Ok(expr)
    }

    /// Whether an expression depends on position, time, or given fields.
    pub(crate) fn is_field(&self, expr: Expr) -> bool {
        let variables: BTreeSet<Expr> = self.variables();
        self.graph.depends_on(expr, &variables)
    }

    fn variables(&self) -> BTreeSet<Expr> {
        let given = self.given.values().copied();
        self.coordinates.iter().copied().chain([self.time]).chain(given).collect()
    }

    /// Adds a name for an expression in `work` alone.
    pub(crate) fn with_names<R>(
        &mut self,
        names: &[(String, Expr)],
        work: impl FnOnce(&mut Self) -> R,
    ) -> R {
        let declared = self.names.clone();
        self.names.extend(names.iter().cloned());
        let result = work(self);
        self.names = declared;
        result
    }

    /// Adds an unknown of `[solve]`, of which only the displacement may make use.
    pub(crate) fn declare_unknown(
        &mut self,
        name: &str,
        span: std::ops::Range<usize>,
    ) -> Result<(), Diagnostic> {
        self.declare(name, span)?;
        self.unknowns.insert(self.graph.symbol(name));
        Ok(())
    }

    /// Whether an expression contains unknowns of `[solve]`.
    pub(crate) fn has_unknowns(&self, expr: Expr) -> bool {
        self.graph.depends_on(expr, &self.unknowns)
    }

    pub(crate) fn check_new_name(
        &self,
        name: &str,
        span: std::ops::Range<usize>,
    ) -> Result<(), Diagnostic> {
        let mut characters = name.chars();
        let valid = characters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && characters.all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !valid {
            let message = format!("'{name}' cannot be a name");
            let help = "a name is a letter followed by letters, digits or '_'; Greek letters are \
                        spelt out where they are declared, as in lambda";
            return Err(self.source.error(message, span, Some(help.into())));
        }
        if name.len() > LONGEST_NAME {
            let message =
                format!("a name of {} characters; {LONGEST_NAME} are the limit", name.len());
            return Err(self.source.error(message, span, None));
        }
        if matches!(name, "self" | "Self" | "super" | "crate") {
            let message = format!("'{name}' cannot be a name in generated code");
            return Err(self.source.error(message, span, Some("choose another name".into())));
        }
        let builtin = name == "Pi" || name == "diff" || name == "sqrt";
        if builtin || Function::from_name(name).is_some() {
            let message = format!("'{name}' is built in and cannot be declared");
            return Err(self.source.error(message, span, Some("choose another name".into())));
        }
        if self.names.contains_key(name) || self.elsewhere.contains_key(name) {
            let what = if self.elsewhere.contains_key(name) || self.is_coordinate(name) {
                "is reserved for a coordinate or the time"
            } else {
                "is declared twice"
            };
            let message = format!("the name '{name}' {what}");
            return Err(self.source.error(message, span, Some("choose another name".into())));
        }
        Ok(())
    }

    fn is_coordinate(&self, name: &str) -> bool {
        self.names
            .get(name)
            .is_some_and(|symbol| *symbol == self.time || self.coordinates.contains(symbol))
    }

    /// Adds the `[let]` expressions, which may refer to each other in any order but not in a circle.
    pub(crate) fn define_all(
        &mut self,
        lets: &[(toml::Spanned<String>, Text)],
    ) -> Result<(), Diagnostic> {
        let mut syntax = Vec::new();
        let mut index_of = BTreeMap::new();
        for (index, (name, text)) in lets.iter().enumerate() {
            self.check_new_name(name.get_ref(), name.span())?;
            index_of.insert(name.get_ref().as_str(), index);
            let ast = self.source.parse(text)?;
            let mut used = BTreeSet::new();
            collect_names(&ast, &mut used);
            syntax.push((ast, used));
        }
        let uses: Vec<Vec<usize>> = syntax
            .iter()
            .map(|(_, used)| {
                used.iter().filter_map(|n| index_of.get(n.as_str()).copied()).collect()
            })
            .collect();
        let order = dependency_order(&uses).map_err(|circle| {
            let path: Vec<&str> = circle.iter().map(|&i| lets[i].0.get_ref().as_str()).collect();
            let (name, text) = &lets[circle[0]];
            let message =
                format!("'{}' is defined by itself: {}", name.get_ref(), path.join(" -> "));
            let help = "a [let] expression may use others, but not in a circle";
            self.source.error(message, text.span.clone(), Some(help.into()))
        })?;
        for index in order {
            let (name, text) = &lets[index];
            let value = self.build(&syntax[index].0, text)?;
            self.names.insert(name.get_ref().clone(), value);
            self.lets.push((name.get_ref().clone(), value));
        }
        Ok(())
    }

    /// The expression that `text` stands for.
    pub(crate) fn expression(&mut self, text: &Text) -> Result<Expr, Diagnostic> {
        let ast = self.source.parse(text)?;
        self.build(&ast, text)
    }

    /// As [`Scope::expression`], for a quantity that may depend on parameters only.
    pub(crate) fn constant(&mut self, text: &Text, what: &str) -> Result<Expr, Diagnostic> {
        let expr = self.expression(text)?;
        if self.has_unknowns(expr) {
            let message = format!("{what} may not depend on the unknowns of [solve]");
            let help = "unknowns are for [displacement], and for [let] expressions that feed it";
            return Err(self.source.error(message, text.span.clone(), Some(help.into())));
        }
        let variables: BTreeSet<Expr> =
            self.coordinates.iter().copied().chain([self.time]).collect();
        if self.graph.depends_on(expr, &variables) {
            let message = format!("{what} may depend on parameters only, not on position or time");
            return Err(self.source.error(message, text.span.clone(), None));
        }
        Ok(expr)
    }

    /// As [`Scope::expression`], for a material's response: in `names`, which mean something here only, in parameters, the position, the
    /// time, and given fields.
    pub(crate) fn response(
        &mut self,
        text: &Text,
        what: &str,
        names: &[String],
    ) -> Result<Expr, Diagnostic> {
        self.refuse_derivatives(text, what)?;
        let declared = self.names.clone();
        for name in names {
            if declared.contains_key(name) {
                let message = format!("'{name}' has a meaning of its own in {what}");
                let help = format!("give what this file calls '{name}' another name");
                return Err(self.source.error(message, text.span.clone(), Some(help)));
            }
            let symbol = self.graph.symbol(name);
            self.names.insert(name.clone(), symbol);
        }
        let expr = self.constant_of_law(text, what);
        self.names = declared;
        expr
    }

    /// Refuses `diff` in a material's response: `F11` and the like are names there, not functions of place and time, so that a rate
    /// or a gradient of them would be zero.
    fn refuse_derivatives(&self, text: &Text, what: &str) -> Result<(), Diagnostic> {
        let ast = self.source.parse(text)?;
        let Some(call) = call_of(&ast, "diff") else { return Ok(()) };
        let message = format!(
            "{what} may not use diff: it is a function of F, J, C, their rates and parameters at one place and time, without gradients of \
             them"
        );
        let help = "rates have names, Fdot11, d11 and Jdot; a rate of another field is a line of [given]; write a derivative by J, I1 or a \
                    component as the formula that it is, as 2*(J - 1) for diff((J - 1)^2, J)";
        Err(self.source.error(
            message,
            text.locate(self.source.text, &call.span),
            Some(help.into()),
        ))
    }

    /// As [`Scope::constant`], for the density, which may depend on the place: mass stays where it is.
    pub(crate) fn density(&mut self, text: &Text) -> Result<Expr, Diagnostic> {
        let expr = self.expression(text)?;
        if self.graph.depends_on(expr, &BTreeSet::from([self.time])) {
            let message = "density may depend on parameters and the place only, not on time: it is mass per reference volume";
            return Err(self.source.error(message, text.span.clone(), None));
        }
        match self.is_field(expr) {
            true => Ok(expr),
            false => self.constant(text, "density"),
        }
    }

    /// The conventional expression of a quantity that the specification leaves out.
    pub(crate) fn usual(
        &mut self,
        usual: &str,
        key: &str,
        table: std::ops::Range<usize>,
    ) -> Result<Expr, Diagnostic> {
        let span = table.clone();
        let missing = |message: String, scope: &Self| {
            let message = format!("{key} is not given, and '{usual}' does not serve: {message}");
            // A parameter of the law's own name is a value to give it.
            let value = if scope.names.contains_key(key) { key } else { "..." };
            scope.source.error(message, table.clone(), Some(format!("give {key} = '{value}' here")))
        };
        let ast = Ast::parse(usual).map_err(|e| missing(e.message, self))?;
        let text = Text { value: usual.to_owned(), span };
        self.build(&ast, &text).map_err(|e| missing(e.message, self))
    }

    fn build(&mut self, ast: &Ast, text: &Text) -> Result<Expr, Diagnostic> {
        let (names, elsewhere) = (&self.names, &self.elsewhere);
        let mut unknown = None;
        let result = self.graph.build(ast, &mut |_, name| {
            names.get(name).copied().ok_or_else(|| {
                unknown = Some(name.to_owned());
                format!("nothing here is called '{name}'")
            })
        });
        let expr = result.map_err(|e| {
            let help = unknown.map(|name| match elsewhere.get(&name) {
                Some(reason) => reason.clone(),
                None if name == "e" => "a power of e is exp(x)".to_owned(),
                None => match nearest(&name, names.keys().map(String::as_str).chain(["Pi"])) {
                    Some(known) => format!("did you mean '{known}'?"),
                    None => {
                        let known: Vec<&str> = names.keys().map(String::as_str).collect();
                        format!(
                            "declare it under [parameters] or [let]; known are {}",
                            known.join(", ")
                        )
                    }
                },
            });
            self.source.error(e.message, text.locate(self.source.text, &e.span), help)
        })?;
        if self.graph.divides_by_zero(expr) {
            let message = "this expression divides by zero, whatever the parameters are";
            return Err(self.source.error(message, text.span.clone(), None));
        }
        Ok(expr)
    }
}

fn collect_names(ast: &Ast, names: &mut BTreeSet<String>) {
    match &ast.kind {
        AstKind::Number(_) => {}
        AstKind::Name(name) => {
            names.insert(name.clone());
        }
        AstKind::Sum(parts) | AstKind::Product(parts) => {
            parts.iter().for_each(|(_, part)| collect_names(part, names));
        }
        AstKind::Power(base, exponent) => {
            collect_names(base, names);
            collect_names(exponent, names);
        }
        AstKind::Call(_, arguments) => {
            arguments.iter().for_each(|argument| collect_names(argument, names));
        }
    }
}

/// The first call of the function `name`.
fn call_of<'a>(ast: &'a Ast, name: &str) -> Option<&'a Ast> {
    match &ast.kind {
        AstKind::Number(_) | AstKind::Name(_) => None,
        AstKind::Sum(parts) | AstKind::Product(parts) => {
            parts.iter().find_map(|(_, part)| call_of(part, name))
        }
        AstKind::Power(base, exponent) => call_of(base, name).or_else(|| call_of(exponent, name)),
        AstKind::Call(called, _) if called == name => Some(ast),
        AstKind::Call(_, arguments) => arguments.iter().find_map(|part| call_of(part, name)),
    }
}

/// An order in which each item comes after those that it uses, or a circle.
fn dependency_order(uses: &[Vec<usize>]) -> Result<Vec<usize>, Vec<usize>> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; uses.len()];
    let mut order = Vec::new();
    for start in 0..uses.len() {
        if state[start] != State::New {
            continue;
        }
        // Depth first with a stack of its own: a chain of definitions may be long.
        let mut path = vec![(start, 0)];
        state[start] = State::Open;
        while let Some((item, next)) = path.last_mut() {
            let item = *item;
            if let Some(&used) = uses[item].get(*next) {
                *next += 1;
                match state[used] {
                    State::Done => {}
                    State::New => {
                        state[used] = State::Open;
                        path.push((used, 0));
                    }
                    State::Open => {
                        let from = path.iter().position(|(i, _)| *i == used).unwrap_or(0);
                        let mut circle: Vec<usize> = path[from..].iter().map(|(i, _)| *i).collect();
                        circle.push(used);
                        return Err(circle);
                    }
                }
            } else {
                state[item] = State::Done;
                order.push(item);
                path.pop();
            }
        }
    }
    Ok(order)
}
