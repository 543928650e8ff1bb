//! Published listings against the derived fields.

use crate::maple::{CrossCheckError, Listing, Problem, Report, Target, cross_check};
use crate::points::points;
use mmsmith_expr::{Ast, AstKind, Expr, Graph};
use mmsmith_spec::{CrossCheck, Diagnostic, Fields, LONGEST_FILE, ListingText, Spec, read_text};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

/// Points at which a listing is compared.
const POINTS: usize = 20;

/// A published listing that has been read: assignments to entries of fields.
///
/// Entries are `u[i]`, `v[i]`, `a[i]` and `b[i]`, Cartesian components counted from zero, and `F[n*i + j]`,
/// `H[n*i + j]` and `P[n*i + j]` in `n` dimensions, or `F[i][j]`. In the plane the third component of a vector may be
/// given, and is zero.
#[derive(Clone, Debug)]
pub struct Published<'a> {
    spec: &'a Spec,
    check: &'a CrossCheck,
    listing: Listing,
    /// The text that the listing was read from.
    text: String,
    /// The specification's name in messages.
    spec_file: String,
    /// The listing's file, where it has one of its own.
    own_file: Option<String>,
}

impl<'a> Published<'a> {
    /// Reads every listing of a specification. `file` is what messages call the specification; files of listings are
    /// looked for in `folder`, and there are none where it is `None`.
    ///
    /// # Errors
    ///
    /// A [`Diagnostic`] for the first listing that cannot be read, with the place in the listing.
    pub fn read(
        spec: &'a Spec,
        file: &str,
        folder: Option<&Path>,
    ) -> Result<Vec<Self>, Diagnostic> {
        spec.cross_checks.iter().map(|check| Self::read_one(spec, check, file, folder)).collect()
    }

    fn read_one(
        spec: &'a Spec,
        check: &'a CrossCheck,
        file: &str,
        folder: Option<&Path>,
    ) -> Result<Self, Diagnostic> {
        let (text, own_file) = match &check.listing {
            ListingText::Inline(inline) => (inline.text().to_owned(), None),
            ListingText::File { path, span } => {
                let fail = |message: String, help: &str| Diagnostic {
                    message,
                    file: file.to_owned(),
                    source: spec.source.clone(),
                    span: span.clone(),
                    help: Some(help.to_owned()),
                };
                let Some(folder) = folder else {
                    let message = format!("there is no folder to look for '{path}' in");
                    return Err(fail(message, "give the text here: listing = '''...'''"));
                };
                let place = folder.join(path);
                let text = read_text(&place, LONGEST_FILE).map_err(|error| {
                    let message = format!("cannot read the listing {}: {error}", place.display());
                    fail(message, "the path starts at the folder of the specification")
                })?;
                (text, Some(place.display().to_string()))
            }
        };
        let listing = Listing { assignments: Vec::new() };
        let spec_file = file.to_owned();
        let mut published = Published { spec, check, listing, text, spec_file, own_file };
        published.listing = Listing::parse(&published.text).map_err(|error| {
            let problem = shifted(error.problem, published.first_line());
            published.diagnostic(problem.to_string(), &error.span)
        })?;
        published.check_names()?;
        Ok(published)
    }

    /// Where the listing was published.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.check.source
    }

    /// Compares with `fields`, which were derived from the same specification.
    ///
    /// # Errors
    ///
    /// A [`Diagnostic`] where the listing has no meaning in the specification, or nothing can be compared.
    pub fn compare(&self, fields: &Fields) -> Result<Report, Diagnostic> {
        let targets = self.targets(fields)?;
        let derived: Vec<Expr> = targets.iter().map(|target| target.derived).collect();
        let points = points(self.spec, fields, &derived, None, POINTS)
            .map_err(|error| self.diagnostic(error.to_string(), &self.first_entry()))?;
        let check = crate::maple::CrossCheck {
            graph: &fields.graph,
            definitions: &fields.definitions,
            listing: &self.listing,
            names: &self.check.names,
            targets: &targets,
        };
        cross_check(&check, points).map_err(|error| {
            let span = match &error {
                CrossCheckError::Build(error) => error.span.clone(),
                _ => self.first_entry(),
            };
            self.diagnostic(error.to_string(), &span)
        })
    }

    /// Targets of the listing: every component of each field of which the listing assigns at least one component.
    fn targets(&self, fields: &Fields) -> Result<Vec<Target>, Diagnostic> {
        let n = self.spec.dimension;
        let assigned: BTreeSet<&str> =
            self.listing.assignments.iter().map(|a| a.target.as_str()).collect();
        let mut targets = Vec::new();
        let mut add = |candidates: Vec<Target>, optional: usize| {
            let given = |target: &Target| assigned.contains(target.entry.as_str());
            if candidates.iter().any(given) {
                let required = candidates.len() - optional;
                let wanted = candidates.into_iter().enumerate();
                targets.extend(wanted.filter(|(i, t)| *i < required || given(t)).map(|(_, t)| t));
            }
        };
        for (letter, vector) in
            [("u", &fields.u), ("v", &fields.v), ("a", &fields.a), ("b", &fields.b)]
        {
            let components = vector.iter().copied().chain((n..3).map(|_| Graph::ZERO));
            let entry = |(i, derived)| Target { entry: format!("{letter}[{i}]"), derived };
            add(components.enumerate().map(entry).collect(), 3 - n);
        }
        for (letter, matrix) in [("H", &fields.H), ("F", &fields.F), ("P", &fields.P)] {
            let entries = || (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            let target =
                |entry: String, (i, j): (usize, usize)| Target { entry, derived: matrix[i][j] };
            let flat = |(i, j)| target(format!("{letter}[{}]", n * i + j), (i, j));
            add(entries().map(flat).collect(), 0);
            let square = |(i, j)| target(format!("{letter}[{i}][{j}]"), (i, j));
            add(entries().map(square).collect(), 0);
        }
        if targets.is_empty() {
            let message = "the listing assigns no entry of a field".to_owned();
            let mut diagnostic = self.diagnostic(message, &self.first_entry());
            let help = "entries are u[i], v[i], a[i] and b[i], Cartesian components counted from 0, and H[i][j], \
                        F[i][j] and P[i][j]";
            diagnostic.help = Some(help.into());
            return Err(diagnostic);
        }
        Ok(targets)
    }

    /// Refuses names that the table gives and the listing does not use.
    fn check_names(&self) -> Result<(), Diagnostic> {
        let mut used = BTreeSet::new();
        for assignment in &self.listing.assignments {
            collect(&assignment.value, &mut used);
        }
        match self.check.renamed.iter().find(|(name, _)| !used.contains(name)) {
            None => Ok(()),
            Some((name, span)) => Err(Diagnostic {
                message: format!("the listing '{}' uses no name '{name}'", self.check.source),
                file: self.spec_file.clone(),
                source: self.spec.source.clone(),
                span: span.clone(),
                help: Some("names are those that the listing uses and does not assign".into()),
            }),
        }
    }

    /// The place of the first assignment to an entry, or of the first assignment.
    fn first_entry(&self) -> Range<usize> {
        let assignments = &self.listing.assignments;
        let entry = assignments.iter().find(|a| a.target.contains('['));
        entry.or(assignments.first()).map_or(0..0, |a| a.span.clone())
    }

    /// The line of the file on which the listing starts, counted from zero.
    fn first_line(&self) -> usize {
        match &self.check.listing {
            ListingText::Inline(_) => {
                self.diagnostic(String::new(), &(0..0)).line_and_column().0 - 1
            }
            ListingText::File { .. } => 0,
        }
    }

    /// A message about a part of the listing.
    fn diagnostic(&self, message: String, inner: &Range<usize>) -> Diagnostic {
        let message = format!("in the listing '{}': {message}", self.check.source);
        match (&self.check.listing, &self.own_file) {
            (ListingText::Inline(inline), _) => {
                inline.diagnostic(self.spec, &self.spec_file, message, inner)
            }
            (ListingText::File { path, .. }, own) => Diagnostic {
                message,
                file: own.as_ref().unwrap_or(path).clone(),
                source: self.text.clone(),
                span: inner.clone(),
                help: None,
            },
        }
    }
}

/// The problem with its line numbers counted from a line that is `lines` further up.
fn shifted(problem: Problem, lines: usize) -> Problem {
    match problem {
        Problem::Broken { what, first_line, second_line, first, second, joined } => {
            let (first_line, second_line) = (first_line + lines, second_line + lines);
            Problem::Broken { what, first_line, second_line, first, second, joined }
        }
        Problem::AssignedTwice { name, first_line } => {
            Problem::AssignedTwice { name, first_line: first_line + lines }
        }
        other => other,
    }
}

/// The names in a syntax tree.
fn collect(ast: &Ast, names: &mut BTreeSet<String>) {
    match &ast.kind {
        AstKind::Number(_) => {}
        AstKind::Name(name) => {
            names.insert(name.clone());
        }
        AstKind::Sum(parts) | AstKind::Product(parts) => {
            parts.iter().for_each(|(_, part)| collect(part, names));
        }
        AstKind::Power(base, exponent) => {
            collect(base, names);
            collect(exponent, names);
        }
        AstKind::Call(_, arguments) => {
            arguments.iter().for_each(|argument| collect(argument, names));
        }
    }
}
