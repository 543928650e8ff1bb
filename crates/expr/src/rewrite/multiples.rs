//! Sines and cosines of multiples of one angle, by those of the angle.

use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::collections::BTreeMap;

/// Larger multiples are left as they are.
const LARGEST: i64 = 8;

impl Graph {
    /// `expr` with the sines and cosines of whole multiples of an angle as polynomials of its own sine and cosine, where there are several
    /// of one angle: `sin(2 a)` beside `sin(a)` becomes `2 sin(a) cos(a)`.
    pub(crate) fn in_common_angles(&mut self, expr: Expr) -> Expr {
        if Rule::CommonAngles.is_off() {
            return expr;
        }
        let mut families: BTreeMap<Expr, Vec<(Rational, Expr)>> = BTreeMap::new();
        for call in self.reachable(&[expr]) {
            if let Node::Call(Function::Sin | Function::Cos, arguments) = self.node(call) {
                let argument = arguments[0];
                let (multiple, angle) = self.multiple(argument);
                families.entry(angle).or_default().push((multiple, call));
            }
        }
        let mut known = BTreeMap::new();
        for (angle, members) in families {
            let Some(least) = members.iter().map(|(multiple, _)| multiple.abs()).min() else {
                continue;
            };
            if members.iter().all(|(multiple, _)| multiple.abs() == least) {
                continue;
            }
            let base = self.sum([(least.clone(), angle)]);
            let base = CosineAndSine {
                cosine: self.call(Function::Cos, &[base]),
                sine: self.call(Function::Sin, &[base]),
            };
            for (multiple, call) in members {
                let times = &multiple / &least;
                let times = times.is_integer().then(|| times.to_integer().to_i64()).flatten();
                let Some(times) = times.filter(|n| n.abs() <= LARGEST) else { continue };
                let CosineAndSine { cosine, sine } = base.times(self, times);
                let is_cosine = matches!(self.node(call), Node::Call(Function::Cos, _));
                let value = if is_cosine { cosine } else { sine };
                known.insert(call, value);
            }
        }
        self.replace(expr, &known)
    }

    /// An argument as a multiple of an angle, whose first term has the coefficient one.
    fn multiple(&mut self, argument: Expr) -> (Rational, Expr) {
        let Node::Sum { terms, .. } = self.node(argument) else {
            return (Rational::one(), argument);
        };
        let Some((_, first)) = terms.first().filter(|(_, first)| !first.is_zero()) else {
            return (Rational::one(), argument);
        };
        let multiple = first.clone();
        let angle = self.sum([(Rational::one() / &multiple, argument)]);
        (multiple, angle)
    }
}

/// The cosine and the sine of an angle.
#[derive(Clone, Copy, Debug)]
pub struct CosineAndSine {
    /// The cosine.
    pub cosine: Expr,
    /// The sine.
    pub sine: Expr,
}

impl CosineAndSine {
    /// Cosine and sine of this many times the angle, by halves: each product vanishes where the whole does, or the terms of a sum have one
    /// sign there.
    #[must_use]
    pub fn times(self, graph: &mut Graph, times: i64) -> Self {
        match times {
            ..0 => {
                let Self { cosine, sine } = self.times(graph, times.saturating_neg());
                Self { cosine, sine: graph.neg(sine) }
            }
            0 => Self { cosine: Graph::ONE, sine: Graph::ZERO },
            1 => self,
            _ if times % 2 == 0 => {
                let Self { cosine, sine } = self.times(graph, times / 2);
                let (sum, difference) = (graph.add(cosine, sine), graph.sub(cosine, sine));
                let product = graph.mul(cosine, sine);
                Self {
                    cosine: graph.mul(difference, sum),
                    sine: graph.sum([(Rational::from(2), product)]),
                }
            }
            _ => {
                let (less, more) = (self.times(graph, times / 2), self.times(graph, times / 2 + 1));
                less.plus(graph, more)
            }
        }
    }

    /// Cosine and sine of the sum of two angles.
    #[must_use]
    pub fn plus(self, graph: &mut Graph, other: Self) -> Self {
        let (cc, ss) = (graph.mul(self.cosine, other.cosine), graph.mul(self.sine, other.sine));
        let (sc, cs) = (graph.mul(self.sine, other.cosine), graph.mul(self.cosine, other.sine));
        Self { cosine: graph.sub(cc, ss), sine: graph.add(sc, cs) }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use crate::{Ast, Graph};

    #[test]
    fn multiples_of_one_angle_cancel() {
        let vanishes = |text: &str| {
            let mut graph = Graph::new();
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            graph.vanishes(expr)
        };
        assert!(vanishes("sin(2*a) - 2*sin(a)*cos(a)"));
        assert!(vanishes("cos(6*Pi*x) - 4*cos(2*Pi*x)^3 + 3*cos(2*Pi*x)"));
        assert!(vanishes("sin(-3*(x + y)) + 3*sin(x + y) - 4*sin(x + y)^3"));
        assert!(vanishes("sin(Pi*x)*cos(Pi*x)*sin(2*Pi*y) - sin(2*Pi*x)*sin(Pi*y)*cos(Pi*y)"));
        assert!(!vanishes("sin(2*a) - 2*sin(a)"));
        assert!(!vanishes("sin(2*a) + 2*sin(a)*cos(b)"));
        // Not a whole multiple of the least one: left as it is.
        assert!(!vanishes("sin(3*a)^2 - sin(2*a)"));
    }
}
