//! Text to syntax tree: Maple's notation, with `^` and `**`, and no implied multiplication.

use crate::Rational;
use num_bigint::BigInt;
use std::ops::Range;
use thiserror::Error;

/// Parentheses, calls, signs and powers may nest this deep.
const DEEPEST: usize = 100;
/// The longest text accepted, in bytes.
const LONGEST: usize = 1 << 20;
/// Numbers are written with at most this many digits, and decimal exponents up to this size.
const MOST_DIGITS: usize = 400;

/// A syntax tree whose nodes know their place in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ast {
    /// What it is.
    pub kind: AstKind,
    /// Where it stands, in bytes from the start of the text.
    pub span: Range<usize>,
}

/// The kinds of syntax.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AstKind {
    /// A number, exactly as written.
    Number(Rational),
    /// A name; Greek letters are spelt out.
    Name(String),
    /// Terms, each with whether it is subtracted.
    Sum(Vec<(bool, Ast)>),
    /// Factors, each with whether it is divided by.
    Product(Vec<(bool, Ast)>),
    /// A power.
    Power(Box<Ast>, Box<Ast>),
    /// A function and its arguments.
    Call(String, Vec<Ast>),
}

/// Why text is not an expression.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct ParseError {
    /// What is wrong, and what would be right.
    pub message: String,
    /// Where, in bytes from the start of the text.
    pub span: Range<usize>,
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(Rational),
    Name(String),
    Sign(char),
    Open,
    Close,
    Comma,
    End,
}

impl Token {
    fn describe(&self) -> String {
        match self {
            Token::Number(_) => "a number".into(),
            Token::Name(name) => format!("'{name}'"),
            Token::Sign(c) => format!("'{c}'"),
            Token::Open => "'('".into(),
            Token::Close => "')'".into(),
            Token::Comma => "','".into(),
            Token::End => "the end".into(),
        }
    }
}

impl Ast {
    /// Reads an expression.
    ///
    /// # Errors
    ///
    /// [`ParseError`] with the place in the text. Nesting deeper than 100, numbers of more than 400 digits and
    /// text beyond a mebibyte are refused.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        if text.len() > LONGEST {
            let message = format!("an expression of {} bytes; {LONGEST} are the limit", text.len());
            return Err(ParseError { message, span: 0..0 });
        }
        let tokens = tokens(text)?;
        let mut parser = Parser { tokens, position: 0, depth: 0 };
        let ast = parser.sum()?;
        let (token, span) = parser.peek();
        match token {
            Token::End => Ok(ast),
            Token::Close => Err(error("this ')' closes nothing", span)),
            Token::Name(_) | Token::Number(_) | Token::Open => {
                Err(error("an operator is missing here; multiplication is written with '*'", span))
            }
            other => Err(error(format!("{} is out of place", other.describe()), span)),
        }
    }
}

fn error(message: impl Into<String>, span: Range<usize>) -> ParseError {
    ParseError { message: message.into(), span }
}

struct Parser {
    tokens: Vec<(Token, Range<usize>)>,
    position: usize,
    depth: usize,
}

impl Parser {
    fn peek(&self) -> (Token, Range<usize>) {
        self.tokens[self.position].clone()
    }

    fn sign(&self) -> Option<char> {
        match self.tokens[self.position].0 {
            Token::Sign(c) => Some(c),
            _ => None,
        }
    }

    /// Goes on to the next token, which there is: nothing goes on from the end.
    fn advance(&mut self) -> Range<usize> {
        let span = self.tokens[self.position].1.clone();
        self.position += 1;
        span
    }

    fn nested<T>(
        &mut self,
        parse: impl FnOnce(&mut Self) -> Result<T, ParseError>,
    ) -> Result<T, ParseError> {
        if self.depth == DEEPEST {
            let message = format!(
                "nested deeper than {DEEPEST} levels; name the inner parts in [let] instead"
            );
            return Err(error(message, self.peek().1));
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    fn sum(&mut self) -> Result<Ast, ParseError> {
        let start = self.peek().1.start;
        let mut terms = Vec::new();
        let mut negative = false;
        // Signs in a row are one sign: no recursion, however many there are.
        while let Some(c @ ('+' | '-')) = self.sign() {
            negative ^= c == '-';
            self.advance();
        }
        loop {
            terms.push((negative, self.product()?));
            negative = match self.sign() {
                Some('+') => false,
                Some('-') => true,
                _ => break,
            };
            self.advance();
            if let Some(c @ ('+' | '-')) = self.sign() {
                let message = format!("'{c}' after a sign; put the signed term in parentheses");
                return Err(error(message, self.peek().1));
            }
        }
        Ok(single(terms, start, AstKind::Sum))
    }

    fn product(&mut self) -> Result<Ast, ParseError> {
        let start = self.peek().1.start;
        let mut factors = vec![(false, self.power()?)];
        while let Some(c @ ('*' | '/')) = self.sign() {
            self.advance();
            factors.push((c == '/', self.power()?));
        }
        Ok(single(factors, start, AstKind::Product))
    }

    fn power(&mut self) -> Result<Ast, ParseError> {
        let base = self.primary()?;
        if self.sign() != Some('^') {
            return Ok(base);
        }
        self.advance();
        let sign_start = self.peek().1.start;
        let negative = self.sign() == Some('-');
        if negative {
            self.advance();
        }
        let mut exponent = self.primary()?;
        if negative {
            let span = sign_start..exponent.span.end;
            exponent = Ast { kind: AstKind::Sum(vec![(true, exponent)]), span };
        }
        if self.sign() == Some('^') {
            let message = "'a^b^c' is ambiguous; write (a^b)^c or a^(b^c)";
            return Err(error(message, self.peek().1));
        }
        let span = base.span.start..exponent.span.end;
        Ok(Ast { kind: AstKind::Power(Box::new(base), Box::new(exponent)), span })
    }

    fn primary(&mut self) -> Result<Ast, ParseError> {
        let (token, span) = self.peek();
        match token {
            Token::Number(value) => {
                self.advance();
                Ok(Ast { kind: AstKind::Number(value), span })
            }
            Token::Name(name) => {
                self.advance();
                if self.tokens[self.position].0 == Token::Open {
                    self.call(name, &span)
                } else {
                    Ok(Ast { kind: AstKind::Name(name), span })
                }
            }
            Token::Open => {
                self.advance();
                let inner = self.nested(Self::sum)?;
                let end = self.close(&span)?;
                Ok(Ast { kind: inner.kind, span: span.start..end })
            }
            Token::End => Err(error("the expression ends where a value is expected", span)),
            other => Err(error(format!("a value is expected, not {}", other.describe()), span)),
        }
    }

    fn call(&mut self, name: String, span: &Range<usize>) -> Result<Ast, ParseError> {
        let open = self.advance();
        let mut arguments = vec![self.nested(Self::sum)?];
        while self.tokens[self.position].0 == Token::Comma {
            self.advance();
            arguments.push(self.nested(Self::sum)?);
        }
        let end = self.close(&open)?;
        Ok(Ast { kind: AstKind::Call(name, arguments), span: span.start..end })
    }

    fn close(&mut self, open: &Range<usize>) -> Result<usize, ParseError> {
        match self.peek() {
            (Token::Close, span) => {
                self.advance();
                Ok(span.end)
            }
            (Token::End, _) => Err(error("this '(' is never closed", open.clone())),
            (Token::Name(_) | Token::Number(_) | Token::Open, span) => {
                Err(error("an operator is missing here; multiplication is written with '*'", span))
            }
            (other, span) => Err(error(format!("')' is expected, not {}", other.describe()), span)),
        }
    }
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

fn tokens(text: &str) -> Result<Vec<(Token, Range<usize>)>, ParseError> {
    let mut tokens = Vec::new();
    let mut rest = text.char_indices().peekable();
    while let Some(&(start, c)) = rest.peek() {
        if c.is_whitespace() {
            rest.next();
        } else if c.is_ascii_digit() || c == '.' {
            let end = number_end(text, start);
            tokens.push((Token::Number(number(text, start..end)?), start..end));
            while rest.peek().is_some_and(|&(at, _)| at < end) {
                rest.next();
            }
        } else if c.is_alphabetic() || c == '_' {
            let mut end = start;
            let mut name = String::new();
            while let Some(&(at, c)) = rest.peek() {
                if !(c.is_alphanumeric() || c == '_') {
                    break;
                }
                match greek(c) {
                    Some(word) => name.push_str(word),
                    None if c.is_ascii() => name.push(c),
                    None => {
                        let message = format!(
                            "'{c}' is not allowed in a name; names have Latin and Greek letters, digits and '_'"
                        );
                        return Err(error(message, at..at + c.len_utf8()));
                    }
                }
                end = at + c.len_utf8();
                rest.next();
            }
            tokens.push((Token::Name(name), start..end));
        } else {
            rest.next();
            let mut end = start + c.len_utf8();
            let token = match c {
                '*' if rest.peek().is_some_and(|&(_, next)| next == '*') => {
                    rest.next();
                    end += 1;
                    Token::Sign('^')
                }
                '+' | '-' | '*' | '/' | '^' => Token::Sign(c),
                '\u{2212}' => Token::Sign('-'),
                '\u{b7}' => Token::Sign('*'),
                '(' => Token::Open,
                ')' => Token::Close,
                ',' => Token::Comma,
                _ => {
                    let message =
                        format!("the character '{}' has no meaning here", c.escape_debug());
                    return Err(error(message, start..end));
                }
            };
            tokens.push((token, start..end));
        }
    }
    tokens.push((Token::End, text.len()..text.len()));
    Ok(tokens)
}

/// The end of the number that starts at `start`: digits, a point, digits, and an exponent if digits follow it.
fn number_end(text: &str, start: usize) -> usize {
    let bytes = text.as_bytes();
    let digits = |mut at: usize| {
        while bytes.get(at).is_some_and(u8::is_ascii_digit) {
            at += 1;
        }
        at
    };
    let mut end = digits(start);
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let mut exponent = end + 1;
        if matches!(bytes.get(exponent), Some(b'+' | b'-')) {
            exponent += 1;
        }
        if digits(exponent) > exponent {
            end = digits(exponent);
        }
    }
    end
}

fn number(text: &str, span: Range<usize>) -> Result<Rational, ParseError> {
    let written = &text[span.clone()];
    let next = text[span.end..].chars().next();
    if let Some(c) = next.filter(|&c| c.is_alphabetic() || c == '_' || c == '.') {
        let message =
            format!("'{written}' runs into what follows; multiplication is written with '*'");
        return Err(error(message, span.start..span.end + c.len_utf8()));
    }
    if written.len() > MOST_DIGITS {
        let message =
            format!("a number of {} characters; {MOST_DIGITS} are the limit", written.len());
        return Err(error(message, span));
    }
    let (mantissa, exponent) = match written.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()),
        None => (written, Some(0)),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits: BigInt = match format!("{whole}{fraction}").parse() {
        Ok(digits) => digits,
        Err(_) => return Err(error("a number needs at least one digit", span)),
    };
    let Some(exponent) = exponent.filter(|e| e.unsigned_abs() as usize <= MOST_DIGITS) else {
        let message = format!("the decimal exponent of '{written}' is beyond {MOST_DIGITS}");
        return Err(error(message, span));
    };
    let scale = exponent - fraction.len() as i32;
    let ten = Rational::from_integer(10.into());
    Ok(Rational::from_integer(digits) * num_traits::Pow::pow(&ten, scale))
}

/// The Latin name of a Greek letter.
fn greek(c: char) -> Option<&'static str> {
    const NAMES: [&str; 25] = [
        "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
        "lambda", "mu", "nu", "xi", "omicron", "Pi", "rho", "sigma", "sigma", "tau", "upsilon",
        "phi", "chi", "psi", "omega",
    ];
    const CAPITALS: [(char, &str); 10] = [
        ('\u{393}', "Gamma"),
        ('\u{394}', "Delta"),
        ('\u{398}', "Theta"),
        ('\u{39b}', "Lambda"),
        ('\u{39e}', "Xi"),
        ('\u{3a3}', "Sigma"),
        ('\u{3a6}', "Phi"),
        ('\u{3a8}', "Psi"),
        ('\u{3a9}', "Omega"),
        ('\u{b5}', "mu"),
    ];
    if ('\u{3b1}'..='\u{3c9}').contains(&c) {
        return NAMES.get((c as u32 - 0x3b1) as usize).copied();
    }
    CAPITALS.iter().find(|(capital, _)| *capital == c).map(|(_, name)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> (String, Range<usize>) {
        let error = Ast::parse(text).unwrap_err();
        (error.message, error.span)
    }

    #[test]
    fn places_of_errors() {
        assert_eq!(message("2*(a + b").1, 2..3);
        assert_eq!(message("a)").1, 1..2);
        assert_eq!(
            message("2x"),
            ("'2' runs into what follows; multiplication is written with '*'".into(), 0..2)
        );
        assert_eq!(message("2_x").1, 0..2);
        assert_eq!(message("1.2.3").1, 0..4);
        assert_eq!(message("1.5e3.").1, 0..6);
        assert_eq!(message("a b").1, 2..3);
        assert_eq!(message("a ^ b ^ c").1, 6..7);
        assert_eq!(message("a ** b ** c").1, 7..9);
        assert_eq!(message("a +").1, 3..3);
        assert_eq!(message("a $ b").1, 2..3);
        assert_eq!(message("1e999").1, 0..5);
        assert_eq!(message("").1, 0..0);
        assert_eq!(message("f(a,)").1, 4..5);
    }

    #[test]
    fn depth_is_limited_without_recursion_to_it() {
        let deep = "(".repeat(1_000_000) + "a" + &")".repeat(1_000_000);
        assert!(message(&deep).0.contains("bytes"));
        let deep = "(".repeat(10_000) + "a" + &")".repeat(10_000);
        assert!(message(&deep).0.contains("nested deeper"));
        assert!(Ast::parse(&("-".repeat(100_000) + "a")).is_ok());
        assert!(Ast::parse(&("a+".repeat(100_000) + "a")).is_ok());
    }

    #[test]
    fn greek_letters_are_their_latin_names() {
        assert_eq!(Ast::parse("\u{3bb}+\u{3c1}0").unwrap().kind, {
            let lambda = Ast { kind: AstKind::Name("lambda".into()), span: 0..2 };
            let rho0 = Ast { kind: AstKind::Name("rho0".into()), span: 3..6 };
            AstKind::Sum(vec![(false, lambda), (false, rho0)])
        });
    }
}
