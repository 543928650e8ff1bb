//! Text to syntax tree: Maple's notation, with `^` and `**`, and no implied multiplication.

use crate::{Function, Rational};
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
    /// The kind of syntax.
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
    /// The mistake, and its correction.
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
            Token::Name(_) | Token::Number(_) | Token::Open => Err(parser.missing_operator(span)),
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

    /// Says what is missing before the token at hand.
    fn missing_operator(&self, span: Range<usize>) -> ParseError {
        let before = |count: usize| {
            self.position
                .checked_sub(count)
                .and_then(|place| self.tokens.get(place))
                .map(|(token, _)| token)
        };
        let function = |token: Option<&Token>| match token {
            Some(Token::Name(name)) if name == "sqrt" || Function::from_name(name).is_some() => {
                Some(name.clone())
            }
            _ => None,
        };
        if let Some(name) = function(before(1)) {
            let message =
                format!("the argument of {name} is written in parentheses, as in {name}(x)");
            return error(message, span);
        }
        if let (Some(name), Some(Token::Sign('^')), Some(Token::Number(_))) =
            (function(before(3)), before(2), before(1))
        {
            let message =
                format!("a power of {name} is written behind its argument, as in {name}(x)^2");
            return error(message, span);
        }
        error("an operator is missing here; multiplication is written with '*'", span)
    }

    fn close(&mut self, open: &Range<usize>) -> Result<usize, ParseError> {
        match self.peek() {
            (Token::Close, span) => {
                self.advance();
                Ok(span.end)
            }
            (Token::End, _) => Err(error("this '(' is never closed", open.clone())),
            (Token::Name(_) | Token::Number(_) | Token::Open, span) => {
                Err(self.missing_operator(span))
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

    /// The tree in words: terms and factors with their signs.
    fn shape(ast: &Ast) -> String {
        let list = |parts: &[(bool, Ast)], sign: char| {
            let shown = parts.iter().map(|(inverse, part)| {
                let sign = if *inverse { sign.to_string() } else { String::new() };
                sign + &shape(part)
            });
            shown.collect::<Vec<_>>().join(" ")
        };
        match &ast.kind {
            AstKind::Number(value) => value.to_string(),
            AstKind::Name(name) => name.clone(),
            AstKind::Sum(terms) => format!("sum({})", list(terms, '-')),
            AstKind::Product(factors) => format!("product({})", list(factors, '/')),
            AstKind::Power(base, exponent) => format!("power({} {})", shape(base), shape(exponent)),
            AstKind::Call(name, arguments) => {
                let shown: Vec<String> = arguments.iter().map(shape).collect();
                format!("{name}({})", shown.join(" "))
            }
        }
    }

    const TREES: [(&str, &str); 27] = [
        ("x", "x"),
        ("(x)", "x"),
        ("-x", "sum(-x)"),
        ("--x", "x"),
        ("- + -- x + y", "sum(-x y)"),
        ("a - b + c - 2", "sum(a -b c -2)"),
        ("a*b/c/d*e", "product(a b /c /d e)"),
        ("a + b*c - d/e", "sum(a product(b c) -product(d /e))"),
        ("-a*b", "sum(-product(a b))"),
        ("(a + b)*(c - d)", "product(sum(a b) sum(c -d))"),
        ("a - (b - c)", "sum(a -sum(b -c))"),
        ("a^2*b", "product(power(a 2) b)"),
        ("a*b^2", "product(a power(b 2))"),
        ("a^-2", "power(a sum(-2))"),
        ("a ** - b * c", "product(power(a sum(-b)) c)"),
        ("-a^2", "sum(-power(a 2))"),
        ("(a^b)^c", "power(power(a b) c)"),
        ("a^(b^c)", "power(a power(b c))"),
        ("f(x)", "f(x)"),
        ("f (x + 1, -y, g(z)^2)/2", "product(f(sum(x 1) sum(-y) power(g(z) 2)) /2)"),
        ("a\u{b7}b \u{2212} c", "sum(product(a b) -c)"),
        ("  \u{3bb}1 +\u{3a9}_\u{b5}\t", "sum(lambda1 Omega_mu)"),
        ("1.5", "3/2"),
        (".5 + 5. - 0.125e2", "sum(1/2 5 -25/2)"),
        ("12e-1 + 12E+1 - 3e2", "sum(6/5 120 -300)"),
        ("1.25e-2*007", "product(1/80 7)"),
        ("_a1 + b_2c", "sum(_a1 b_2c)"),
    ];

    #[test]
    fn trees() {
        for (text, expected) in TREES {
            assert_eq!(shape(&Ast::parse(text).unwrap()), expected, "{text}");
        }
    }

    /// The place of every part holds that part and no more.
    #[test]
    fn every_part_knows_its_place() {
        fn check(ast: &Ast, text: &str) {
            let part = &text[ast.span.clone()];
            assert_eq!(part, part.trim(), "{text}");
            assert_eq!(shape(&Ast::parse(part).unwrap()), shape(ast), "{part} in {text}");
            match &ast.kind {
                AstKind::Number(_) | AstKind::Name(_) => {}
                AstKind::Sum(parts) | AstKind::Product(parts) => {
                    parts.iter().for_each(|(_, part)| check(part, text));
                }
                AstKind::Power(base, exponent) => {
                    [base, exponent].into_iter().for_each(|part| check(part, text));
                }
                AstKind::Call(_, arguments) => arguments.iter().for_each(|ast| check(ast, text)),
            }
        }
        for (text, _) in TREES {
            let ast = Ast::parse(text).unwrap();
            // Signs that cancel are no part of anything.
            assert_eq!(&text[ast.span.clone()], text.trim().trim_start_matches("--"));
            check(&ast, text);
        }
    }

    /// Each limit may be reached and not be passed.
    #[test]
    fn limits_on_text() {
        let nested = |n: usize| "(".repeat(n) + "x" + &")".repeat(n);
        let called = |n: usize| "f(".repeat(n) + "x" + &")".repeat(n);
        for (text, next) in [
            (nested(DEEPEST), nested(DEEPEST + 1)),
            (called(DEEPEST), called(DEEPEST + 1)),
            ("1".repeat(MOST_DIGITS), "1".repeat(MOST_DIGITS + 1)),
            (format!("1e{MOST_DIGITS}"), format!("1e{}", MOST_DIGITS + 1)),
            (format!("1e-{MOST_DIGITS}"), format!("1e-{}", MOST_DIGITS + 1)),
            (" ".repeat(LONGEST - 1) + "x", " ".repeat(LONGEST) + "x"),
        ] {
            assert!(Ast::parse(&text).is_ok(), "{}", message(&text).0);
            assert!(Ast::parse(&next).is_err());
        }
        // Parts beside each other are not nested.
        let beside = [nested(DEEPEST), called(DEEPEST - 1), nested(DEEPEST)].join("*");
        assert!(Ast::parse(&beside).is_ok());
    }

    #[test]
    fn messages() {
        let missing = "an operator is missing";
        for (text, start, place) in [
            ("", "the expression ends", ""),
            ("x +", "the expression ends", ""),
            ("x + * y", "a value is expected, not '*'", "*"),
            ("x*)", "a value is expected, not ')'", ")"),
            ("x*-y", "a value is expected, not '-'", "-"),
            ("x + - y", "'-' after a sign", "-"),
            ("x - + y", "'+' after a sign", "+"),
            ("x y", missing, "y"),
            ("x 2", missing, "2"),
            ("2 (x)", missing, "("),
            ("f(x) (y)", missing, "(y"),
            ("f(x y)", missing, "y"),
            ("f(x 3)", missing, "3"),
            ("(x(y) (z))", missing, "(z"),
            ("x)", "this ')' closes nothing", ")"),
            ("x, y", "',' is out of place", ","),
            ("(x, y)", "')' is expected, not ','", ","),
            ("2*(x + f(y)", "this '(' is never closed", "(x"),
            ("2*f(y, z", "this '(' is never closed", "(y"),
            ("f(,)", "a value is expected, not ','", ","),
            ("x^y^z", "'a^b^c' is ambiguous", "^z"),
            ("x $ y", "the character '$' has no meaning", "$"),
            ("x + \u{fc}y", "'\u{fc}' is not allowed in a name", "\u{fc}"),
            ("x*3y", "'3' runs into", "3y"),
            ("x*3\u{3bb}", "'3' runs into", "3\u{3bb}"),
            ("1.5_", "'1.5' runs into", "1.5_"),
            ("1.5.", "'1.5' runs into", "1.5."),
            ("x*.", "a number needs at least one digit", "."),
            ("x - 1e401", "the decimal exponent of '1e401' is beyond", "1e401"),
            ("x - 1e99999999999", "the decimal exponent of", "1e9"),
            ("2e + x", "'2' runs into", "2e"),
            ("2e+x", "'2' runs into", "2e"),
        ] {
            let (found, span) = message(text);
            assert!(found.starts_with(start), "{text}: {found}");
            let from = if place.is_empty() { text.len() } else { text.rfind(place).unwrap() };
            assert_eq!(span.start, from, "{text}: {found} at {span:?}");
            if !found.starts_with("'a^b") && !found.contains("exponent") {
                let length = if found.contains("runs into") { place.len() } else { 1 };
                let length = text[from..].chars().next().map_or(0, char::len_utf8).max(length);
                assert_eq!(span.end, text.len().min(from + length), "{text}: {found}");
            }
        }
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
