//! Identical cancellation among parameters, such as `lambda + 2 mu - E = 2 nu lambda`.
//!
//! The canonical form does not multiply out, so it does not see that the difference of two fractions vanishes
//! or collapses to one term. Left alone, such a difference is computed with a loss of digits. Here the
//! parameter-only coefficients of a sum are brought over their common denominator; where the numerator turns out
//! to be zero or one single product, that form replaces the sum.

use super::polynomial::{Monomial, Numbers, add_to, product, product_of_monomials};
use crate::graph::NumberMap;
use crate::{Expr, Function, Graph, Node, Rational, Rule};
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::collections::{BTreeMap, BTreeSet};

/// Numerators with more terms than this are not worth the search.
const MOST_TERMS: usize = 512;

/// Expressions of more parts than this are not multiplied out on the way of a derivative.
const MOST_PARTS: usize = 20;

/// A monomial, as atoms to positive powers, and its coefficient.
pub type Term = (Vec<(Expr, u32)>, Rational);

/// A polynomial with numbers for coefficients.
type Polynomial = super::polynomial::Polynomial<Rational>;

/// A polynomial over a product of atoms.
struct Fraction {
    numerator: Polynomial,
    denominator: Monomial,
}

/// Symbols that stand for square roots.
#[derive(Default)]
struct Roots {
    /// The square of each.
    squares: BTreeMap<Expr, Expr>,
    /// Expressions with such symbols.
    done: NumberMap<Expr, Expr>,
}

impl Graph {
    /// `expr` with every sum whose parameter-only parts cancel identically brought to the shorter form.
    ///
    /// Parameter-only is what contains none of `variables`.
    pub fn cancel(&mut self, expr: Expr, variables: &BTreeSet<Expr>) -> Expr {
        if Rule::Cancel.is_off() {
            return expr;
        }
        self.cancel_with(expr, variables, &mut BTreeMap::new())
    }

    fn cancel_with(
        &mut self,
        expr: Expr,
        variables: &BTreeSet<Expr>,
        done: &mut BTreeMap<Expr, Expr>,
    ) -> Expr {
        if let Some(&known) = done.get(&expr) {
            return known;
        }
        let mapped =
            self.map_children(expr, &mut |graph, child| graph.cancel_with(child, variables, done));
        let result = self.cancel_root(mapped, variables);
        done.insert(expr, result);
        result
    }

    fn cancel_root(&mut self, expr: Expr, variables: &BTreeSet<Expr>) -> Expr {
        let Node::Sum { constant, terms } = self.node(expr).clone() else { return expr };
        let mut groups: BTreeMap<Expr, Vec<(Rational, Expr)>> = BTreeMap::new();
        if !constant.is_zero() {
            groups.entry(Graph::ONE).or_default().push((constant, Graph::ONE));
        }
        for (term, coefficient) in terms {
            let (parameters, rest) = self.split_by_dependence(term, variables);
            groups.entry(rest).or_default().push((coefficient, parameters));
        }
        let mut changed = false;
        let mut parts = Vec::new();
        for (rest, members) in groups {
            let several = members.len() > 1;
            let mut coefficient = self.sum(members);
            if several && let Some(shorter) = self.collapse(coefficient) {
                changed = true;
                coefficient = shorter;
            }
            parts.push(self.mul(coefficient, rest));
        }
        if changed { self.sum_of(parts) } else { expr }
    }

    /// `term` as a parameter-only factor times a rest.
    fn split_by_dependence(&mut self, term: Expr, variables: &BTreeSet<Expr>) -> (Expr, Expr) {
        let factors = match self.node(term) {
            Node::Product(factors) => factors.to_vec(),
            _ => vec![(term, Rational::one())],
        };
        let (rest, parameters): (Vec<_>, Vec<_>) =
            factors.into_iter().partition(|(base, _)| self.depends_on(*base, variables));
        (self.product(parameters), self.product(rest))
    }

    /// Whether `expr` contains one of `variables`.
    #[must_use]
    pub fn depends_on(&self, expr: Expr, variables: &BTreeSet<Expr>) -> bool {
        self.reachable(&[expr]).iter().any(|e| variables.contains(e))
    }

    /// Whether `expr` is identically zero, as far as multiplying out, `cos^2 = 1 - sin^2`, the sines and cosines of multiples,
    /// `sqrt(x)^2 = x` and `exp(x + y) = exp(x) exp(y)` show.
    ///
    /// Quantities kept in one piece are looked into. False where that is not so, or where it grows too large to tell.
    pub fn vanishes(&mut self, expr: Expr) -> bool {
        // Most expressions differ from zero at any place, which is soon seen; to multiply them out takes long.
        if self.differs_from_zero(expr) {
            return false;
        }
        let open = self.open(expr);
        let open = self.in_powers_of_exponentials(open);
        let open = self.in_common_angles(open);
        // What is not zero modulo a prime is not zero; what is zero there is still to be proved so.
        if self.residue(open).is_some_and(|residue| residue != 0) {
            return false;
        }
        let mut roots = Roots::default();
        let open = self.with_roots_as_symbols(open, &mut roots);
        self.fraction(open).is_some_and(|fraction| {
            self.without_squares(fraction.numerator, &roots.squares).is_some_and(|n| n.is_empty())
        })
    }

    /// Exponential functions, hyperbolic ones included, as powers of symbols: one for the exponential of each term of the
    /// arguments.
    fn in_powers_of_exponentials(&mut self, expr: Expr) -> Expr {
        let is_exponential = |function: &Function| {
            matches!(
                function,
                Function::Exp | Function::Expm1 | Function::Sinh | Function::Cosh | Function::Tanh
            )
        };
        let reachable = self.reachable(&[expr]);
        let has_one = reachable.iter().any(
            |part| matches!(self.node(*part), Node::Call(function, _) if is_exponential(function)),
        );
        if !has_one {
            return expr;
        }
        // Children come before their parents.
        let mut done: NumberMap<Expr, Expr> = NumberMap::default();
        for part in reachable {
            let mapped = self.map_children(part, &mut |_, child| done[&child]);
            let result = match self.node(mapped).clone() {
                Node::Call(function, arguments) if is_exponential(&function) => {
                    self.hyperbolic(function, arguments[0])
                }
                _ => mapped,
            };
            done.insert(part, result);
        }
        done[&expr]
    }

    /// An exponential function by powers of symbols.
    fn hyperbolic(&mut self, function: Function, argument: Expr) -> Expr {
        let mut open = vec![(argument, Rational::one())];
        let mut factors = Vec::new();
        while let Some((term, coefficient)) = open.pop() {
            match self.node(term).clone() {
                Node::Number(value) => {
                    let base = self.symbol("exp #1");
                    factors.push((base, value * coefficient));
                }
                Node::Sum { constant, terms } => {
                    open.extend(terms.iter().map(|(term, own)| (*term, own * &coefficient)));
                    let constant = self.number(constant);
                    open.push((constant, coefficient));
                }
                _ => factors.push((self.symbol(&format!("exp #{}", term.0)), coefficient)),
            }
        }
        let above = self.product(factors.clone());
        let below = self.product(factors.into_iter().map(|(base, power)| (base, -power)));
        let half = Rational::new(1.into(), 2.into());
        match function {
            Function::Exp => above,
            Function::Expm1 => self.sub(above, Graph::ONE),
            Function::Cosh => self.sum([(half.clone(), above), (half, below)]),
            Function::Sinh => self.sum([(half.clone(), above), (-half, below)]),
            _ => {
                let (sum, difference) = (self.add(above, below), self.sub(above, below));
                self.div(difference, sum)
            }
        }
    }

    /// Square roots as symbols, which `roots` knows.
    fn with_roots_as_symbols(&mut self, expr: Expr, roots: &mut Roots) -> Expr {
        if let Some(&known) = roots.done.get(&expr) {
            return known;
        }
        let result = match self.node(expr).clone() {
            Node::Product(factors) => {
                let mut mapped = Vec::new();
                for (base, exponent) in factors {
                    let own = self.with_roots_as_symbols(base, roots);
                    let twice = &exponent * Rational::from(2);
                    if exponent.is_integer() || !twice.is_integer() {
                        mapped.push((own, exponent));
                        continue;
                    }
                    let root = self.symbol(&format!("sqrt #{}", own.0));
                    roots.squares.insert(root, own);
                    mapped.push((root, twice));
                }
                self.product(mapped)
            }
            _ => self
                .map_children(expr, &mut |graph, child| graph.with_roots_as_symbols(child, roots)),
        };
        roots.done.insert(expr, result);
        result
    }

    /// `expr` with nothing kept in one piece.
    pub fn open(&mut self, expr: Expr) -> Expr {
        let mut done = std::mem::take(&mut self.open);
        let open = self.opened(expr, &mut done);
        self.open = done;
        open
    }

    /// The numerator of `expr` over a common denominator, multiplied out: monomials, which are powers of atoms, with
    /// their coefficients. Atoms are symbols, pi, function values and broken powers. `None` where it grows too large.
    pub fn numerator(&mut self, expr: Expr) -> Option<Vec<Term>> {
        let open = self.open(expr);
        let numerator = self.fraction(open)?.numerator;
        Some(numerator.into_iter().map(|(m, c)| (m.into_iter().collect(), c)).collect())
    }

    fn opened(&mut self, expr: Expr, done: &mut NumberMap<Expr, Expr>) -> Expr {
        if let Some(&known) = done.get(&expr) {
            return known;
        }
        let result = match *self.node(expr) {
            Node::Whole(inner) => self.opened(inner, done),
            _ => self.map_children(expr, &mut |graph, child| graph.opened(child, done)),
        };
        done.insert(expr, result);
        result
    }

    /// The polynomial with `cos(x)^2` replaced by `1 - sin(x)^2` until no cosine is squared, and squares of the keys of `squares`
    /// by what these are.
    fn without_squares(
        &mut self,
        polynomial: Polynomial,
        squares: &BTreeMap<Expr, Expr>,
    ) -> Option<Polynomial> {
        let mut result = Polynomial::new();
        let mut pending: Vec<(Monomial, Rational)> = polynomial.into_iter().collect();
        while let Some((mut monomial, coefficient)) = pending.pop() {
            if result.len() + pending.len() > MOST_TERMS {
                return None;
            }
            let is_square = |(root, power): (&Expr, &u32)| {
                squares.get(root).filter(|_| *power > 1).map(|square| (*root, *square))
            };
            if let Some((root, square)) = monomial.iter().find_map(is_square) {
                let power = monomial.remove(&root).unwrap_or(2) - 2;
                if power > 0 {
                    monomial.insert(root, power);
                }
                let square =
                    self.fraction(square).filter(|square| square.denominator.is_empty())?;
                let rest = Polynomial::from([(monomial, coefficient)]);
                pending.extend(multiply(&rest, &square.numerator)?);
                continue;
            }
            let Some((cosine, argument)) = self.squared_cosine(&monomial) else {
                add_to(&mut Numbers, &mut result, monomial, &coefficient);
                continue;
            };
            let power = monomial.remove(&cosine).unwrap_or(2) - 2;
            if power > 0 {
                monomial.insert(cosine, power);
            }
            let sine = self.call(Function::Sin, &[argument]);
            let mut with_sine = monomial.clone();
            *with_sine.entry(sine).or_insert(0) += 2;
            pending.push((monomial, coefficient.clone()));
            pending.push((with_sine, -coefficient));
        }
        Some(result)
    }

    /// A cosine that is squared in a product of powers, and its argument.
    pub(crate) fn squared_cosine(&self, monomial: &BTreeMap<Expr, u32>) -> Option<(Expr, Expr)> {
        monomial.iter().find_map(|(&atom, &power)| match self.node(atom) {
            Node::Call(Function::Cos, arguments) if power >= 2 => Some((atom, arguments[0])),
            _ => None,
        })
    }

    /// The expression as one product or zero, where multiplying out makes it one and nothing is kept in one piece.
    pub fn single_term(&mut self, expr: Expr) -> Option<Expr> {
        let is_whole = |part: &Expr| matches!(self.node(*part), Node::Whole(_));
        let reachable = self.reachable(&[expr]);
        if reachable.len() > MOST_PARTS || reachable.iter().any(is_whole) {
            return None;
        }
        self.collapse(expr)
    }

    /// The sum as one product or zero, where it is one.
    fn collapse(&mut self, sum: Expr) -> Option<Expr> {
        let Fraction { numerator, denominator } = self.fraction(sum)?;
        if numerator.len() > 1 {
            return None;
        }
        let Some((monomial, coefficient)) = numerator.into_iter().next() else {
            return Some(Graph::ZERO);
        };
        let power = |(atom, n): (Expr, u32), sign: i64| (atom, Rational::from(sign * i64::from(n)));
        let mut factors: Vec<_> = monomial.into_iter().map(|f| power(f, 1)).collect();
        factors.extend(denominator.into_iter().map(|f| power(f, -1)));
        factors.push((self.number(coefficient), Rational::one()));
        Some(self.product(factors))
    }

    /// `expr` over a common denominator; `None` where that grows too large.
    fn fraction(&mut self, expr: Expr) -> Option<Fraction> {
        match self.node(expr).clone() {
            Node::Number(value) => Some(Fraction::of(Monomial::new(), value)),
            Node::Sum { constant, terms } => {
                let mut total = Fraction::of(Monomial::new(), constant);
                for (term, coefficient) in terms {
                    let part = self.fraction(term)?;
                    total = self.add_fractions(&total, &part, &coefficient)?;
                }
                Some(total)
            }
            Node::Product(factors) => {
                let mut total = Fraction::of(Monomial::new(), Rational::one());
                for (base, exponent) in factors {
                    if !exponent.is_integer() {
                        let atom = self.product([(base, exponent)]);
                        total = total.times(&Fraction::of([(atom, 1)].into(), Rational::one()))?;
                        continue;
                    }
                    let power = exponent.to_integer().abs().to_u32().filter(|&n| n <= 64)?;
                    if exponent.is_negative() {
                        total = self.divided(total, base, power)?;
                    } else {
                        let factor = self.fraction(base)?;
                        for _ in 0..power {
                            total = total.times(&factor)?;
                        }
                    }
                }
                Some(total)
            }
            Node::Pi | Node::Symbol(_) | Node::Call(..) | Node::Whole(_) => {
                Some(Fraction::of([(expr, 1)].into(), Rational::one()))
            }
        }
    }

    /// `fraction / base ^ power`; a base that is itself a fraction does not stay in the denominator.
    fn divided(&mut self, mut fraction: Fraction, base: Expr, power: u32) -> Option<Fraction> {
        let Fraction { numerator, denominator } = self.fraction(base)?;
        if numerator.is_empty() {
            return None;
        }
        if denominator.is_empty() {
            *fraction.denominator.entry(base).or_insert(0) += power;
            return Some(fraction);
        }
        for (atom, n) in denominator {
            let atom = self.fraction(atom)?;
            for _ in 0..n * power {
                fraction.numerator = multiply(&fraction.numerator, &atom.numerator)?;
            }
        }
        let terms: Vec<(Rational, Expr)> = numerator
            .into_iter()
            .map(|(monomial, coefficient)| {
                let factors =
                    monomial.into_iter().map(|(atom, n)| (atom, Rational::from(i64::from(n))));
                (coefficient, self.product(factors.collect::<Vec<_>>()))
            })
            .collect();
        let numerator = self.sum(terms);
        *fraction.denominator.entry(numerator).or_insert(0) += power;
        Some(fraction)
    }

    fn add_fractions(&mut self, a: &Fraction, b: &Fraction, scale: &Rational) -> Option<Fraction> {
        let mut denominator = a.denominator.clone();
        for (&atom, &n) in &b.denominator {
            let entry = denominator.entry(atom).or_insert(0);
            *entry = n.max(*entry);
        }
        let mut numerator = self.over(a, &denominator)?;
        for (monomial, coefficient) in self.over(b, &denominator)? {
            add_to(&mut Numbers, &mut numerator, monomial, &(coefficient * scale));
        }
        Some(Fraction { numerator, denominator })
    }

    /// The numerator of `fraction` over the larger `denominator`.
    fn over(&mut self, fraction: &Fraction, denominator: &Monomial) -> Option<Polynomial> {
        let mut numerator = fraction.numerator.clone();
        for (&atom, &n) in denominator {
            let missing = n - fraction.denominator.get(&atom).copied().unwrap_or(0);
            if missing > 0 {
                let factor = self.fraction(atom)?;
                if !factor.denominator.is_empty() {
                    return None;
                }
                for _ in 0..missing {
                    numerator = multiply(&numerator, &factor.numerator)?;
                }
            }
        }
        Some(numerator)
    }
}

impl Fraction {
    fn of(monomial: Monomial, coefficient: Rational) -> Self {
        let mut numerator = Polynomial::new();
        add_to(&mut Numbers, &mut numerator, monomial, &coefficient);
        Fraction { numerator, denominator: Monomial::new() }
    }

    fn times(&self, other: &Fraction) -> Option<Self> {
        let denominator = product_of_monomials(&self.denominator, &other.denominator);
        Some(Fraction { numerator: multiply(&self.numerator, &other.numerator)?, denominator })
    }
}

/// The product, unless it has too many terms.
fn multiply(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    let product = product(&mut Numbers, a, b);
    (product.len() <= MOST_TERMS).then_some(product)
}

#[cfg(test)]
mod tests {
    use super::{MOST_TERMS, Monomial, Polynomial, multiply};
    use crate::{Ast, AstKind, Expr, Function, Graph, Rational};
    use num_traits::{One, Pow, ToPrimitive, Zero};
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    fn cancelled(text: &str) -> String {
        let mut graph = Graph::new();
        let ast = Ast::parse(text).unwrap();
        let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
        let variables = BTreeSet::from([graph.symbol("X")]);
        let expr = graph.cancel(expr, &variables);
        graph.print(expr)
    }

    #[test]
    fn lame_constants() {
        let text = "E*nu/((1+nu)*(1-2*nu)) + 2*E/(2*(1+nu)) - E";
        assert_eq!(cancelled(text), "2*E*nu^2/((1 + nu)*(1 - 2*nu))");
        let text = "sin(X)*E*nu/((1+nu)*(1-2*nu)) + ln(X) + sin(X)*E/(1+nu) - E*sin(X)";
        assert_eq!(cancelled(text), "ln(X) + 2*sin(X)*E*nu^2/((1 + nu)*(1 - 2*nu))");
    }

    #[test]
    fn a_rotation_has_no_strain() {
        let mut graph = Graph::new();
        let mut vanishes = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            graph.vanishes(expr)
        };
        // H + H^T + H H^T for H = Rot - I, written with half the angle.
        assert!(vanishes("-4*sin(a)^2 + 4*sin(a)^4 + 4*sin(a)^2*cos(a)^2"));
        assert!(vanishes("cos(a)^4 - sin(a)^4 - cos(a)^2 + sin(a)^2"));
        assert!(!vanishes("-4*sin(a)^2 + 4*sin(a)^4 + 4*sin(a)^2*cos(b)^2"));
    }

    /// Determinants of motions that keep the volume, less one.
    #[test]
    fn stretches_that_keep_the_volume() {
        let mut graph = Graph::new();
        let mut vanishes = |text: &str| {
            let expr = build(&mut graph, text);
            graph.vanishes(expr)
        };
        assert!(vanishes("expm1(a*b) + expm1(-a*b) + expm1(a*b)*expm1(-a*b)"));
        assert!(vanishes("exp(a)*exp(b - a)*exp(1 - b) - exp(1)"));
        assert!(vanishes("cosh(a)^2 - sinh(a)^2 - 1"));
        assert!(vanishes("exp(a/2)*exp(-a) - 1/sqrt(exp(a))"));
        assert!(vanishes("tanh(a) - 1 + 2/(1 + exp(2*a))"));
        assert!(!vanishes("expm1(a*b) + expm1(-a) + expm1(a*b)*expm1(-a)"));
        // A ring that is widened, by its two stretches.
        assert!(vanishes("(r/sqrt(r^2 + a))*(1 + a/(r*(r + sqrt(r^2 + a)))) - 1"));
        assert!(!vanishes("(r/sqrt(r^2 + a))*(1 + a/(r*(r + sqrt(r^2 + b)))) - 1"));
    }

    /// Expressions that are zero modulo a prime, and have no value in floating point, are decided by polynomials.
    #[test]
    fn multiples_of_the_prime_do_not_vanish() {
        let mut graph = Graph::new();
        let mut vanishes = |text: &str| {
            let expr = build(&mut graph, text);
            assert_eq!(graph.residue(expr), Some(0), "{text}");
            graph.vanishes(expr)
        };
        assert!(!vanishes("2305843009213693951*arctan(a)"));
        assert!(!vanishes(
            "2305843009213693951*arctan(a)*cos(b)^3 + arctan(a)*(cos(b)^2 + sin(b)^2 - 1)"
        ));
        assert!(vanishes("arctan(a)*(cos(b)^3 - cos(b)*(1 - sin(b)^2))"));
    }

    /// Limits on terms may be reached and not be passed.
    #[test]
    fn limits_on_terms() {
        let mut graph = Graph::new();
        let symbols: Vec<Expr> = (0..40).map(|n| graph.symbol(&format!("x{n}"))).collect();
        let a = graph.symbol("a");
        let (cosine, sine) = (graph.call(Function::Cos, &[a]), graph.call(Function::Sin, &[a]));
        let sum = |symbols: &[Expr]| -> Polynomial {
            symbols.iter().map(|&symbol| (Monomial::from([(symbol, 1)]), Rational::one())).collect()
        };
        assert_eq!(
            multiply(&sum(&symbols[..16]), &sum(&symbols[16..])).map(|p| p.len()),
            Some(384)
        );
        let powers = |count: usize| -> Polynomial {
            (1..).map(|n| (Monomial::from([(a, n)]), Rational::one())).take(count).collect()
        };
        assert_eq!(multiply(&powers(MOST_TERMS), &powers(1)).map(|p| p.len()), Some(MOST_TERMS));
        assert_eq!(multiply(&powers(MOST_TERMS), &powers(2)).map(|p| p.len()), None);
        // A square makes one term more while it is looked at, a fourth power three.
        for (power, others, expected) in [
            (2, MOST_TERMS - 1, Some(MOST_TERMS + 1)),
            (2, MOST_TERMS, None),
            (4, MOST_TERMS - 3, Some(MOST_TERMS)),
            (4, MOST_TERMS - 2, None),
        ] {
            let mut polynomial = powers(others);
            polynomial.insert(Monomial::from([(cosine, power)]), Rational::one());
            let found = graph.without_squares(polynomial, &BTreeMap::new());
            if let Some(found) = &found {
                assert!(found.contains_key(&Monomial::from([(sine, power)])));
            }
            assert_eq!(found.map(|p| p.len()), expected, "{power} {others}");
        }
    }

    #[test]
    fn fractions_of_fractions() {
        let mut graph = Graph::new();
        let mut vanishes = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            graph.vanishes(expr)
        };
        assert!(vanishes("1/(1 + a/(b + c)) - (b + c)/(b + c + a)"));
        assert!(vanishes("(1/(1/a + 1/b) - a*b/(a + b))/(1 + 1/(c + 1/d))"));
        assert!(!vanishes("1/(1 + a/(b + c)) - (b + c)/(b + c - a)"));
        // Nothing is said about a quotient by zero.
        assert!(!vanishes("a/(b/(1 + c) + b*c/(1 + c) - b)"));
        assert!(!vanishes("a/((b + c)^2 - b^2 - 2*b*c - c^2)"));
    }

    /// A look at one place, in floating point, must not take rounding for a difference, however small or large the
    /// values are.
    #[test]
    fn rounding_is_no_difference() {
        for function in [Function::Exp, Function::Sin, Function::Cos, Function::Ln] {
            for shift in ["0", "-60/7", "-60", "10^8/7", "-400"] {
                for scale in ["1", "1/10^9", "10^9"] {
                    let mut graph = Graph::new();
                    let build = |graph: &mut Graph, text: &str| {
                        let ast = Ast::parse(text).unwrap();
                        graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap()
                    };
                    let part = build(&mut graph, &format!("{scale}*(a/3 + b/7 + c)"));
                    let part = graph.whole(part);
                    let rest = build(&mut graph, &format!("{scale}*(-b/7 - c) + d^2 + ({shift})"));
                    let first = graph.add(part, rest);
                    let second = build(&mut graph, &format!("{scale}*a/3 + d^2 + ({shift})"));
                    let [first, second] = [first, second].map(|x| graph.call(function, &[x]));
                    let difference = graph.sub(first, second);
                    assert!(graph.vanishes(difference), "{function:?} {shift} {scale}");
                    let twice = graph.add(first, difference);
                    assert!(!graph.vanishes(twice), "{function:?} {shift} {scale}");
                }
            }
        }
    }

    fn build(graph: &mut Graph, text: &str) -> Expr {
        graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
    }

    /// Polynomials in a, b and c, or quotients of such.
    fn text(with_quotients: bool) -> impl Strategy<Value = String> {
        let leaf = prop_oneof![
            prop::sample::select(&["a", "b", "c"][..]).prop_map(str::to_owned),
            (-5..6_i32).prop_map(|n| format!("({n})")),
        ];
        leaf.prop_recursive(4, 12, 2, move |inner| {
            let pair = (inner.clone(), inner.clone());
            let over = move |(a, b)| {
                if with_quotients { format!("({a})/({b})") } else { format!("({a})*({b})") }
            };
            prop_oneof![
                pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a}) - 3*({b})/2")),
                pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
                pair.prop_map(over),
                (inner, 1..4_i32).prop_map(|(a, n)| format!("({a})^{n}")),
            ]
        })
    }

    /// The value as the text is written; `None` where it divides by zero.
    fn exact(ast: &Ast, at: &[i64; 3]) -> Option<Rational> {
        match &ast.kind {
            AstKind::Number(value) => Some(value.clone()),
            AstKind::Name(name) => Some(at[usize::from(name.as_bytes()[0] - b'a')].into()),
            AstKind::Sum(terms) => terms.iter().try_fold(Rational::zero(), |sum, (minus, term)| {
                let value = exact(term, at)?;
                Some(if *minus { sum - value } else { sum + value })
            }),
            AstKind::Product(factors) => {
                factors.iter().try_fold(Rational::one(), |product, (divides, factor)| {
                    let value = exact(factor, at)?;
                    match divides {
                        true if value.is_zero() => None,
                        true => Some(product / value),
                        false => Some(product * value),
                    }
                })
            }
            AstKind::Power(base, exponent) => {
                let exponent = exact(exponent, at)?.to_integer().to_u32()?;
                Some(Pow::pow(exact(base, at)?, exponent))
            }
            AstKind::Call(..) => None,
        }
    }

    /// The numerator of `expr` at a place; `None` where it is too large.
    fn numerator_at(graph: &mut Graph, expr: Expr, at: &[i64; 3]) -> Option<Rational> {
        let symbols = ["a", "b", "c"].map(|name| graph.symbol(name));
        let of = |atom: Expr| symbols.iter().position(|symbol| *symbol == atom).map(|n| at[n]);
        let terms = graph.numerator(expr)?;
        Some(terms.iter().fold(Rational::zero(), |sum, (powers, coefficient)| {
            sum + powers.iter().fold(coefficient.clone(), |term, &(atom, power)| {
                term * Pow::pow(Rational::from(of(atom).unwrap()), power)
            })
        }))
    }

    proptest! {
        #[test]
        fn numerators_of_polynomials_have_their_values(text in text(false), at in prop::array::uniform3(-4..5_i64)) {
            let mut graph = Graph::new();
            let expr = build(&mut graph, &text);
            let numerator = numerator_at(&mut graph, expr, &at).unwrap();
            prop_assert_eq!(numerator, exact(&Ast::parse(&text).unwrap(), &at).unwrap(), "{}", text);
        }

        #[test]
        fn numerators_are_zero_where_the_expression_is(text in text(true), at in prop::array::uniform3(-4..5_i64)) {
            let value = exact(&Ast::parse(&text).unwrap(), &at);
            prop_assume!(value.is_some());
            let mut graph = Graph::new();
            let Ok(expr) = graph.build(&Ast::parse(&text).unwrap(), &mut |g, name| Ok(g.symbol(name))) else {
                return Err(TestCaseError::reject("divides by what is zero everywhere"));
            };
            for other in [0, 1] {
                let number = graph.number(value.clone().unwrap() + Rational::from(other));
                let less = graph.sub(expr, number);
                let numerator = numerator_at(&mut graph, less, &at);
                prop_assert_eq!(numerator.map(|n| n.is_zero()), Some(other == 0), "{}", text);
            }
        }

        /// Whatever the parts, to multiply out a product of sums changes nothing.
        #[test]
        fn what_differs_by_multiplying_out_is_the_same(
            a in text(false), b in text(true), c in text(true), at in prop::array::uniform3(-4..5_i64),
        ) {
            let [a, b, c] = [a, b, c].map(|text| format!("({text})"));
            let mut graph = Graph::new();
            let text = format!("({a} - {b})*({a} + {c}) - {a}^2 - {a}*{c} + {b}*{a} + {b}*{c}");
            let parsed = Ast::parse(&text).unwrap();
            let Ok(expr) = graph.build(&parsed, &mut |g, name| Ok(g.symbol(name))) else {
                return Err(TestCaseError::reject("divides by what is zero everywhere"));
            };
            prop_assume!(exact(&parsed, &at).is_some());
            let open = graph.open(expr);
            prop_assert!(graph.vanishes(expr), "{}", graph.print(open));
            let more = graph.add(expr, Graph::ONE);
            prop_assert!(!graph.vanishes(more), "{} + 1", text);
        }
    }

    #[test]
    fn zero_and_no_collapse() {
        assert_eq!(cancelled("1/(1+a) + a/(1+a) - 1"), "0");
        assert_eq!(cancelled("1/(1+a) + b"), "1/(1 + a) + b");
    }
}
