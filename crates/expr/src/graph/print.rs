//! Graph to text, in the notation that [`Ast::parse`](crate::Ast::parse) reads.

use crate::{Expr, Graph, Node, Rational};
use num_traits::{One, Signed, Zero};

/// How tightly the printed text binds.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Binding {
    Sum,
    Product,
    Atom,
}

impl Graph {
    /// The expression as text that reads back as the same expression.
    #[must_use]
    pub fn print(&self, expr: Expr) -> String {
        self.text(expr).0
    }

    fn text(&self, expr: Expr) -> (String, Binding) {
        match self.node(expr) {
            Node::Number(value) => number_text(value),
            Node::Pi => ("Pi".into(), Binding::Atom),
            Node::Symbol(_) => {
                (self.symbol_name(expr).unwrap_or_default().to_owned(), Binding::Atom)
            }
            Node::Call(function, arguments) => {
                let arguments: Vec<String> = arguments.iter().map(|&a| self.print(a)).collect();
                (format!("{}({})", function.name(), arguments.join(", ")), Binding::Atom)
            }
            Node::Whole(inner) => self.text(*inner),
            Node::Product(factors) => self.product_text(factors, &Rational::one()),
            Node::Sum { constant, terms } => self.sum_text(constant, terms),
        }
    }

    fn sum_text(&self, constant: &Rational, terms: &[(Expr, Rational)]) -> (String, Binding) {
        if constant.is_zero()
            && let [(term, coefficient)] = terms
        {
            return self.scaled_text(*term, coefficient);
        }
        let mut text = String::new();
        if !constant.is_zero() {
            text = number_text(constant).0;
        }
        for (term, coefficient) in terms {
            let (part, binding) = self.scaled_text(*term, &coefficient.abs());
            let part = if binding == Binding::Sum { format!("({part})") } else { part };
            match (text.is_empty(), coefficient.is_negative()) {
                (true, false) => text = part,
                (true, true) => text = format!("-{part}"),
                (false, false) => text += &format!(" + {part}"),
                (false, true) => text += &format!(" - {part}"),
            }
        }
        (text, Binding::Sum)
    }

    fn scaled_text(&self, term: Expr, coefficient: &Rational) -> (String, Binding) {
        match self.node(term) {
            _ if coefficient.is_one() => self.text(term),
            Node::Product(factors) => self.product_text(factors, coefficient),
            _ => self.product_text(&[(term, Rational::one())], coefficient),
        }
    }

    fn product_text(
        &self,
        factors: &[(Expr, Rational)],
        coefficient: &Rational,
    ) -> (String, Binding) {
        let integer = |n: num_bigint::BigInt| Rational::from_integer(n);
        let mut above = Vec::new();
        let mut below = Vec::new();
        if !coefficient.numer().abs().is_one() {
            above.push(number_text(&integer(coefficient.numer().abs())).0);
        }
        if !coefficient.denom().is_one() {
            below.push(number_text(&integer(coefficient.denom())).0);
        }
        for (base, exponent) in factors {
            let place = if exponent.is_negative() { &mut below } else { &mut above };
            place.push(self.power_text(*base, &exponent.abs()));
        }
        let above = if above.is_empty() { "1".to_owned() } else { above.join("*") };
        let text = match below.as_slice() {
            [] => above,
            [one] => format!("{above}/{one}"),
            many => format!("{above}/({})", many.join("*")),
        };
        if coefficient.is_negative() {
            (format!("-{text}"), Binding::Sum)
        } else {
            (text, Binding::Product)
        }
    }

    /// `base ^ exponent` for a positive exponent.
    fn power_text(&self, base: Expr, exponent: &Rational) -> String {
        if *exponent == Rational::new(1.into(), 2.into()) {
            return format!("sqrt({})", self.print(base));
        }
        let (text, binding) = self.text(base);
        let base = if binding == Binding::Atom { text } else { format!("({text})") };
        match (exponent.is_one(), exponent.is_integer()) {
            (true, _) => base,
            (false, true) => format!("{base}^{exponent}"),
            (false, false) => format!("{base}^({exponent})"),
        }
    }
}

fn number_text(value: &Rational) -> (String, Binding) {
    let binding = match (value.is_negative(), value.is_integer()) {
        (true, _) => Binding::Sum,
        (false, true) => Binding::Atom,
        (false, false) => Binding::Product,
    };
    (value.to_string(), binding)
}

#[cfg(test)]
mod tests {
    use crate::{Ast, Graph, Rational};

    /// No parentheses and no factors of one but where they are needed.
    #[test]
    fn printed_as_one_would_write_it() {
        for text in [
            "x",
            "-x",
            "x + y",
            "-(x + y)",
            "2*x/3",
            "-2*x/(3*y)",
            "1/x",
            "1/(x*y^2)",
            "x^2*sqrt(y)/z^(1/3)",
            "(x + y)^2",
            "2*(x + y)",
            "x - y*(2/3)^(1/3)",
            "1 + x*Pi",
            "-(5 + 2*x*y)/2",
            "(7 + 42*x - 4*y)/14",
            "sin(x)^2 - atan2(y, (1 + 2*x)/2)",
        ] {
            let mut graph = Graph::new();
            for name in ["x", "y", "z"] {
                graph.symbol(name);
            }
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            assert_eq!(graph.print(expr), text);
        }
    }

    /// A sum in one piece is printed in parentheses, as a sum within a sum; no other part in one piece shows that it is one.
    #[test]
    fn what_is_in_one_piece() {
        let mut graph = Graph::new();
        let [x, y, z] = ["x", "y", "z"].map(|name| graph.symbol(name));
        let (product, sum) = (graph.mul(x, y), graph.add(x, y));
        let double = graph.sum([(Rational::from(2), x)]);
        for (part, text) in [(product, "x*y"), (sum, "(x + y)"), (double, "2*x")] {
            let part = graph.whole(part);
            let sum = graph.add(z, part);
            assert_eq!(graph.print(sum), format!("z + {text}"));
            let difference = graph.sub(z, part);
            assert_eq!(graph.print(difference), format!("z - {text}"));
        }
    }
}
