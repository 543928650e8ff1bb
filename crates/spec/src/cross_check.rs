//! `[[cross-check]]`: published listings that the derived fields should equal.

use crate::document::{CrossCheckTable, Text};
use crate::scope::Scope;
use crate::{Diagnostic, Spec};
use mmsmith_expr::Expr;
use std::collections::BTreeMap;
use std::ops::Range;

/// A published listing of fields, and what its names mean. Whoever compares reads the listing itself.
#[derive(Clone, Debug)]
pub struct CrossCheck {
    /// Where the listing was published, for messages.
    pub source: String,
    /// The listing.
    pub listing: ListingText,
    /// Names that the listing may use, as expressions of [`Spec::graph`]: those of the table `names`, and where it
    /// is silent the parameters, `[let]` expressions, coordinates and time of the specification.
    pub names: BTreeMap<String, Expr>,
    /// The names in the table `names`, each with its place in the specification.
    pub renamed: Vec<(String, Range<usize>)>,
}

/// Where the text of a listing stands.
#[derive(Clone, Debug)]
pub enum ListingText {
    /// In the specification.
    Inline(InlineText),
    /// In a file of its own.
    File {
        /// The path, relative to the folder of the specification.
        path: String,
        /// The place of the path in the specification.
        span: Range<usize>,
    },
}

/// Text within a specification that knows its place there.
#[derive(Clone, Debug)]
pub struct InlineText(Text);

impl InlineText {
    /// The text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0.value
    }

    /// A message about a part of the text, `inner` in bytes; `file` is what the message calls the specification.
    #[must_use]
    pub fn diagnostic(
        &self,
        spec: &Spec,
        file: &str,
        message: String,
        inner: &Range<usize>,
    ) -> Diagnostic {
        Diagnostic {
            message,
            file: file.to_owned(),
            source: spec.source.clone(),
            span: self.0.locate(&spec.source, inner),
            help: None,
        }
    }
}

impl CrossCheck {
    pub(crate) fn read(
        scope: &mut Scope<'_>,
        table: &toml::Spanned<CrossCheckTable>,
    ) -> Result<Self, Diagnostic> {
        let (span, table) = (table.span(), table.get_ref());
        let listing = match (&table.listing, &table.file) {
            (Some(text), None) => ListingText::Inline(InlineText(text.clone())),
            (None, Some(path)) => {
                ListingText::File { path: path.get_ref().clone(), span: path.span() }
            }
            _ => {
                let message = "a cross-check takes its listing from one place";
                let help = "give listing = '''...''' with the text, or file = '...' with the name of a file \
                            beside this one";
                return Err(scope.source.error(message, span, Some(help.into())));
            }
        };
        let mut names = scope.names().clone();
        let mut renamed = Vec::new();
        for (name, text) in &table.names.0 {
            names.insert(name.get_ref().clone(), scope.expression(text)?);
            renamed.push((name.get_ref().clone(), name.span()));
        }
        Ok(CrossCheck { source: table.source.get_ref().clone(), listing, names, renamed })
    }
}
