//! Reasons why text is not a listing, and their places.

use mmsmith_expr::Function;
use std::ops::Range;
use thiserror::Error;

/// The reason why text is not a listing.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{problem}")]
pub struct ListingError {
    /// The mistake, and its correction.
    pub problem: Problem,
    /// The place, in bytes from the start of the text.
    pub span: Range<usize>,
}

/// Mistakes that a listing may have.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Problem {
    /// Two numbers, or a name and what may be the rest of it, with nothing but a line break between them.
    #[error(
        "{what} seems to be broken across lines {first_line} and {second_line}: join {first} and {second} to {joined}"
    )]
    Broken {
        /// `a number` or `a name`.
        what: &'static str,
        /// The line of the first part, from 1.
        first_line: usize,
        /// The line of the second part, from 1.
        second_line: usize,
        /// The first part.
        first: String,
        /// The second part.
        second: String,
        /// Both parts together.
        joined: String,
    },
    /// Two values on one line with nothing between them.
    #[error("an operator is missing before '{before}'; C writes multiplication with '*'")]
    OperatorMissing {
        /// The second value.
        before: String,
    },
    /// An assignment follows where the one before has not ended.
    #[error("';' is missing before '{before}'")]
    SemicolonMissing {
        /// The start of the next assignment.
        before: String,
    },
    /// The grammar asks for another part.
    #[error("{wanted} is expected here, not {found}")]
    Expected {
        /// The part that the grammar asks for.
        wanted: &'static str,
        /// The text found there.
        found: String,
    },
    /// A temporary or an entry is used that is assigned further down, or in this very statement.
    #[error("{name} is used before it is assigned")]
    UsedBeforeAssigned {
        /// The name of the temporary or entry.
        name: String,
    },
    /// Two assignments to one target.
    #[error("{name} is assigned twice, first on line {first_line}")]
    AssignedTwice {
        /// The target.
        name: String,
        /// The line of the first assignment, from 1.
        first_line: usize,
    },
    /// An unknown function.
    #[error("no function is called '{name}'; there are {}", function_names())]
    UnknownFunction {
        /// Its name.
        name: String,
    },
    /// A wrong number of arguments.
    #[error("{function} takes {wanted} argument(s), not {given}")]
    Arguments {
        /// The function.
        function: String,
        /// The right number.
        wanted: usize,
        /// The number given.
        given: usize,
    },
    /// A quotient of integers, which C would truncate.
    #[error("a quotient of integers, which C rounds towards zero; write {first}.0/{second}.0")]
    IntegerQuotient {
        /// The dividend.
        first: String,
        /// The divisor.
        second: String,
    },
    /// A number directly followed by a letter or a second point.
    #[error("'{number}' runs into what follows; C writes multiplication with '*'")]
    NumberRunsOn {
        /// The number.
        number: String,
    },
    /// A malformed number, or a number beyond the limits on digits and exponents.
    #[error("{message}")]
    Number {
        /// The reason.
        message: String,
    },
    /// `^`, which is no power in C.
    #[error("'^' is no power in C; write pow(a, b)")]
    Caret,
    /// A character that has no meaning in a listing.
    #[error("the character '{}' has no meaning in a listing", character.escape_debug())]
    Character {
        /// The character.
        character: char,
    },
    /// A comment without an end.
    #[error("this comment is never closed")]
    CommentOpen,
    /// Too much nesting.
    #[error("nested deeper than {limit} levels")]
    TooDeep {
        /// The number of levels accepted.
        limit: usize,
    },
    /// Too much text.
    #[error("a listing of {bytes} bytes; {limit} are the limit")]
    TooLong {
        /// Its size.
        bytes: usize,
        /// The largest size accepted.
        limit: usize,
    },
    /// No assignment at all.
    #[error("the listing assigns nothing; it needs lines such as 'b[0] = t1*t2;'")]
    Empty,
}

/// The operations of [`mmsmith_expr`] that are functions in C, with their number of arguments; `pow` is a power.
pub(crate) const OPERATIONS: [(&str, usize); 2] = [("pow", 2), ("sqrt", 1)];

fn function_names() -> String {
    let functions = Function::ALL.iter().filter_map(|function| function.math_h());
    let names = OPERATIONS.iter().map(|(name, _)| *name).chain(functions);
    names.collect::<Vec<_>>().join(", ")
}
