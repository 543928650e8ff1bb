//! Tokens to assignments.

use crate::maple::error::{ListingError, OPERATIONS, Problem};
use crate::maple::token::{Placed, Token, tokens};
use mmsmith_expr::{Ast, AstKind, Function};
use std::collections::BTreeMap;
use std::ops::Range;

/// Parentheses, calls and signs may nest this deep.
const DEEPEST: usize = 100;
/// The longest listing accepted, in bytes.
const LONGEST: usize = 1 << 18;
/// Words that may stand in front of an assignment.
const TYPES: [&str; 6] = ["const", "static", "double", "float", "long", "real"];

/// A listing that has been read: assignments, each of which uses earlier ones and free names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listing {
    /// The assignments in their order.
    pub assignments: Vec<Assignment>,
}

/// `target = value;`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// A name, or an array entry such as `b[0]`, without spaces.
    pub target: String,
    /// Where the target stands, in bytes from the start of the text.
    pub span: Range<usize>,
    /// The right-hand side; names keep their C spelling, functions have those of [`mmsmith_expr`].
    pub value: Ast,
}

/// The function that C calls `name`: its name in [`mmsmith_expr`], and its number of arguments.
fn function(name: &str) -> Option<(&'static str, usize)> {
    let mut functions = Function::ALL.iter().filter(|function| function.math_h() == Some(name));
    let operation = OPERATIONS.iter().copied().find(|(operation, _)| *operation == name);
    operation.or_else(|| functions.next().map(|function| (function.name(), function.arity())))
}

impl Listing {
    /// Reads a listing: assignments that end with `;`, with or without a type in front, and comments of C.
    ///
    /// A name that is assigned anywhere in the listing may be used below its assignment only; other names are free.
    ///
    /// # Errors
    ///
    /// [`ListingError`] with the place in the text. Nesting deeper than 100 and text beyond 256 KiB are refused.
    pub fn parse(text: &str) -> Result<Self, ListingError> {
        if text.len() > LONGEST {
            let problem = Problem::TooLong { bytes: text.len(), limit: LONGEST };
            return Err(ListingError { problem, span: 0..0 });
        }
        let mut parser = Parser { text, tokens: tokens(text)?, position: 0, depth: 0 };
        let mut assignments = Vec::new();
        while parser.peek() != Token::End {
            if !parser.skip_sign(';') {
                assignments.extend(parser.statement()?);
            }
        }
        if assignments.is_empty() {
            return Err(ListingError { problem: Problem::Empty, span: 0..text.len() });
        }
        check_order(text, &assignments)?;
        Ok(Listing { assignments })
    }
}

/// Each target is assigned once, and used below its assignment only.
fn check_order(text: &str, assignments: &[Assignment]) -> Result<(), ListingError> {
    let mut places: BTreeMap<&str, (usize, Range<usize>)> = BTreeMap::new();
    for (index, assignment) in assignments.iter().enumerate() {
        let name = assignment.target.as_str();
        let place = (index, assignment.span.clone());
        if let Some((_, first)) = places.insert(name, place) {
            let first_line = line(text, first.start);
            let problem = Problem::AssignedTwice { name: name.to_owned(), first_line };
            return Err(ListingError { problem, span: assignment.span.clone() });
        }
    }
    for (index, assignment) in assignments.iter().enumerate() {
        let mut pending = vec![&assignment.value];
        while let Some(ast) = pending.pop() {
            match &ast.kind {
                AstKind::Number(_) => {}
                AstKind::Name(name) => {
                    let late = places.get(name.as_str()).is_some_and(|(at, _)| *at >= index);
                    if late || (name.contains('[') && !places.contains_key(name.as_str())) {
                        let problem = Problem::UsedBeforeAssigned { name: name.clone() };
                        return Err(ListingError { problem, span: ast.span.clone() });
                    }
                }
                AstKind::Sum(parts) | AstKind::Product(parts) => {
                    pending.extend(parts.iter().map(|(_, part)| part));
                }
                AstKind::Power(base, exponent) => pending.extend([&**base, &**exponent]),
                AstKind::Call(_, arguments) => pending.extend(arguments),
            }
        }
    }
    Ok(())
}

/// The line of a place in the text, from 1.
fn line(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at].iter().filter(|&&b| b == b'\n').count()
}

struct Parser<'a> {
    text: &'a str,
    tokens: Vec<Placed>,
    position: usize,
    depth: usize,
}

impl Parser<'_> {
    fn peek(&self) -> Token {
        self.tokens[self.position].0
    }

    fn span(&self) -> Range<usize> {
        self.tokens[self.position].1.clone()
    }

    fn written(&self) -> &str {
        &self.text[self.span()]
    }

    fn advance(&mut self) {
        if self.position + 1 < self.tokens.len() {
            self.position += 1;
        }
    }

    fn skip_sign(&mut self, sign: char) -> bool {
        let found = self.peek() == Token::Sign(sign);
        if found {
            self.advance();
        }
        found
    }

    /// The error at the current token where `wanted` should stand; two values in a row get a message of their own.
    fn expected(&self, wanted: &'static str) -> ListingError {
        let span = self.span();
        let is_value = |token: Token| matches!(token, Token::Number | Token::Name);
        let previous = self.position.checked_sub(1).map(|i| &self.tokens[i]);
        if let Some((token, before)) = previous.filter(|(token, _)| is_value(*token))
            && is_value(self.peek())
        {
            let (first, second) = (&self.text[before.clone()], self.written());
            let between = &self.text[before.end..span.start];
            let after = self.tokens.get(self.position + 1).map(|(token, _)| *token);
            let assigns = matches!(after, Some(Token::Sign('=' | '[')));
            if self.peek() == Token::Name && (assigns || TYPES.contains(&second)) {
                let problem = Problem::SemicolonMissing { before: second.to_owned() };
                return ListingError { problem, span };
            }
            // No name starts with a digit, but the rest of a broken name may.
            let joins = *token == Token::Name
                || (self.peek() == Token::Number && joins_to_a_number(first, second));
            if joins && between.contains('\n') && between.trim().is_empty() {
                return ListingError {
                    problem: Problem::Broken {
                        what: if *token == Token::Number { "a number" } else { "a name" },
                        first_line: line(self.text, before.start),
                        second_line: line(self.text, span.start),
                        first: first.to_owned(),
                        second: second.to_owned(),
                        joined: format!("{first}{second}"),
                    },
                    span: before.start..span.end,
                };
            }
            return ListingError {
                problem: Problem::OperatorMissing { before: second.to_owned() },
                span,
            };
        }
        let found = match self.peek() {
            Token::End => "the end".to_owned(),
            _ => format!("'{}'", self.written()),
        };
        ListingError { problem: Problem::Expected { wanted, found }, span }
    }

    fn expect(&mut self, sign: char, wanted: &'static str) -> Result<(), ListingError> {
        if self.skip_sign(sign) { Ok(()) } else { Err(self.expected(wanted)) }
    }

    /// `double b[3], t1 = x, t2;` or the same without the type; declarations without value say nothing.
    fn statement(&mut self) -> Result<Vec<Assignment>, ListingError> {
        let mut typed = false;
        while self.peek() == Token::Name && TYPES.contains(&self.written()) {
            typed = true;
            self.advance();
        }
        let mut assignments = Vec::new();
        loop {
            if self.peek() != Token::Name {
                return Err(self.expected("a name to assign to"));
            }
            let (target, span) = self.reference()?;
            if self.skip_sign('=') {
                let value = self.sum()?;
                assignments.push(Assignment { target, span, value });
            } else if !typed {
                return Err(self.expected("'='"));
            }
            if !(typed && self.skip_sign(',')) {
                self.expect(';', "an operator or ';'")?;
                return Ok(assignments);
            }
        }
    }

    /// A name with or without indices.
    fn reference(&mut self) -> Result<(String, Range<usize>), ListingError> {
        let mut name = self.written().to_owned();
        let mut span = self.span();
        self.advance();
        while self.skip_sign('[') {
            let digits = self.written().bytes().all(|b| b.is_ascii_digit());
            if self.peek() != Token::Number || !digits {
                return Err(self.expected("a whole number as index"));
            }
            name += &format!("[{}]", self.written());
            self.advance();
            span.end = self.span().end;
            self.expect(']', "']'")?;
        }
        Ok((name, span))
    }

    fn nested<T>(
        &mut self,
        parse: impl FnOnce(&mut Self) -> Result<T, ListingError>,
    ) -> Result<T, ListingError> {
        if self.depth == DEEPEST {
            let problem = Problem::TooDeep { limit: DEEPEST };
            return Err(ListingError { problem, span: self.span() });
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    fn sum(&mut self) -> Result<Ast, ListingError> {
        let start = self.span().start;
        let mut terms = vec![(false, self.product()?)];
        loop {
            let subtracted = self.peek() == Token::Sign('-');
            if !subtracted && self.peek() != Token::Sign('+') {
                return Ok(single(terms, start, AstKind::Sum));
            }
            self.advance();
            terms.push((subtracted, self.product()?));
        }
    }

    fn product(&mut self) -> Result<Ast, ListingError> {
        let start = self.span().start;
        let first = self.position;
        let mut factors = vec![(false, self.signed()?)];
        let mut integer = self.is_integer(first..self.position);
        loop {
            let divided = self.peek() == Token::Sign('/');
            if !divided && self.peek() != Token::Sign('*') {
                return Ok(single(factors, start, AstKind::Product));
            }
            let dividend = first..self.position;
            self.advance();
            let divisor = self.position;
            factors.push((divided, self.signed()?));
            let divisor = divisor..self.position;
            integer &= self.is_integer(divisor.clone());
            if divided && integer {
                let span = start..self.tokens[self.position - 1].1.end;
                let (first, second) = (self.text_of(dividend), self.text_of(divisor));
                let problem = Problem::IntegerQuotient { first, second };
                return Err(ListingError { problem, span });
            }
        }
    }

    /// Whether C gives the tokens, a factor, the type of an integer: no names and no points.
    fn is_integer(&self, factor: Range<usize>) -> bool {
        self.tokens[factor].iter().all(|(token, span)| match token {
            Token::Number => self.text[span.clone()].bytes().all(|b| b.is_ascii_digit()),
            Token::Sign(_) => true,
            Token::Name | Token::End => false,
        })
    }

    fn text_of(&self, tokens: Range<usize>) -> String {
        let spans = self.tokens[tokens].iter().map(|(_, span)| span);
        let start = spans.clone().map(|span| span.start).min().unwrap_or(0);
        let end = spans.map(|span| span.end).max().unwrap_or(start);
        self.text[start..end].to_owned()
    }

    /// Signs, and a primary.
    fn signed(&mut self) -> Result<Ast, ListingError> {
        let start = self.span().start;
        let mut negative = false;
        // Signs in a row are one sign: no recursion, however many there are.
        while let Token::Sign(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.advance();
        }
        let value = self.primary()?;
        if !negative {
            return Ok(value);
        }
        let span = start..value.span.end;
        Ok(Ast { kind: AstKind::Sum(vec![(true, value)]), span })
    }

    fn primary(&mut self) -> Result<Ast, ListingError> {
        let span = self.span();
        match self.peek() {
            Token::Number => {
                let number = Ast::parse(self.written()).map_err(|error| ListingError {
                    problem: Problem::Number { message: error.message },
                    span: span.clone(),
                })?;
                self.advance();
                Ok(Ast { kind: number.kind, span })
            }
            Token::Name if self.tokens[self.position + 1].0 == Token::Sign('(') => self.call(),
            Token::Name => {
                let (name, span) = self.reference()?;
                Ok(Ast { kind: AstKind::Name(name), span })
            }
            Token::Sign('(') => {
                self.advance();
                let inner = self.nested(Self::sum)?;
                let end = self.span().end;
                self.expect(')', "an operator or ')'")?;
                Ok(Ast { kind: inner.kind, span: span.start..end })
            }
            _ => Err(self.expected("a value")),
        }
    }

    fn call(&mut self) -> Result<Ast, ListingError> {
        let span = self.span();
        let name = self.written().to_owned();
        let Some((function, arity)) = function(&name) else {
            return Err(ListingError { problem: Problem::UnknownFunction { name }, span });
        };
        self.advance();
        self.advance();
        let mut arguments = vec![self.nested(Self::sum)?];
        while self.skip_sign(',') {
            arguments.push(self.nested(Self::sum)?);
        }
        let span = span.start..self.span().end;
        self.expect(')', "an operator or ')'")?;
        let given = arguments.len();
        if given != arity {
            let problem = Problem::Arguments { function: name, wanted: arity, given };
            return Err(ListingError { problem, span });
        }
        let kind = match (function, arguments.as_slice()) {
            ("pow", [base, exponent]) => {
                AstKind::Power(Box::new(base.clone()), Box::new(exponent.clone()))
            }
            _ => AstKind::Call(function.to_owned(), arguments),
        };
        Ok(Ast { kind, span })
    }
}

/// Whether the two together are one number: at most one point and no exponent before it.
fn joins_to_a_number(first: &str, second: &str) -> bool {
    let exponent = first.contains(['e', 'E']);
    let points = first.matches('.').count() + second.matches('.').count();
    points <= 1 && !(exponent && second.contains(['.', 'e', 'E']))
}

fn single(
    mut parts: Vec<(bool, Ast)>,
    start: usize,
    kind: impl FnOnce(Vec<(bool, Ast)>) -> AstKind,
) -> Ast {
    let end = parts.last().map_or(start, |(_, last)| last.span.end);
    if parts.len() == 1 && !parts[0].0 {
        return parts.remove(0).1;
    }
    Ast { kind: kind(parts), span: start..end }
}
