//! The text of a specification, for messages that show a place in it.

use crate::Diagnostic;

/// The text of a specification and its name, for messages.
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) text: &'a str,
}

impl Source<'_> {
    pub(crate) fn error(
        &self,
        message: impl Into<String>,
        span: std::ops::Range<usize>,
        help: Option<String>,
    ) -> Diagnostic {
        // A place that the TOML reader gives may lie within a character.
        let span =
            self.text.floor_char_boundary(span.start)..self.text.ceil_char_boundary(span.end);
        Diagnostic {
            message: message.into(),
            file: self.file.to_owned(),
            source: self.text.to_owned(),
            span,
            help,
        }
    }
}
