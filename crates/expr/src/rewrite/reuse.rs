//! Products within products.
//!
//! The canonical form flattens products, so that `h^2/R` with `h = A cos(t) s/R` reads `A^2 cos(t)^2 s^2/R^3` and no longer
//! shows that `h` is computed anyway. [`reuse`] finds a product that occurs by itself within a larger one, to the
//! power that fits, and what the components of a vector share; it makes each of them one quantity. That lowers the
//! number of operations of a single evaluation. (It mixes rates of change, so it is not for evaluation in stages.)

use crate::rewrite::accuracy::Samples;
use crate::{Dependence, Expr, Graph, Node, Program, Rational};
use num_traits::{One, Signed, ToPrimitive};
use std::collections::{BTreeMap, BTreeSet};

/// More products than this are not compared with one another.
const MOST_PRODUCTS: usize = 400;

/// `outputs` in forms of the same value that cost less in all, where there are such.
///
/// `inputs` and `definitions` are those of [`Program::lower`], which the result is meant for.
#[must_use]
pub fn reuse(
    graph: &mut Graph,
    inputs: &[(Expr, Dependence)],
    definitions: &[(Expr, Expr)],
    outputs: &[Expr],
) -> Vec<Expr> {
    let mut variables: BTreeSet<Expr> =
        inputs.iter().filter(|(_, d)| !d.is_fixed()).map(|(symbol, _)| *symbol).collect();
    variables.extend(definitions.iter().map(|(symbol, _)| *symbol));
    let mut reusing = Reusing { graph, variables, products: Vec::new(), done: BTreeMap::new() };
    reusing.find_products(outputs);
    let mut candidate: Vec<Expr> = outputs.iter().map(|&output| reusing.rewrite(output)).collect();
    reusing.share_common_factors(&mut candidate);
    if candidate == outputs {
        return candidate;
    }
    let before = Program::lower(graph, inputs, definitions, outputs);
    let after = Program::lower(graph, inputs, definitions, &candidate);
    if after.cost() < before.cost() && Samples::of(&before, inputs.len()).admit(&before, &after) {
        candidate
    } else {
        outputs.to_vec()
    }
}

type Factors = Vec<(Expr, Rational)>;

struct Reusing<'a> {
    graph: &'a mut Graph,
    /// Symbols that are no parameters.
    variables: BTreeSet<Expr>,
    /// The products that are worth computing once, those of most factors first.
    products: Vec<(Expr, Factors)>,
    done: BTreeMap<Expr, Expr>,
}

impl Reusing<'_> {
    /// The products among `outputs` with at least two factors that are not fixed.
    fn find_products(&mut self, outputs: &[Expr]) {
        let reachable = self.graph.reachable(outputs);
        let mut varies: BTreeMap<Expr, bool> = BTreeMap::new();
        // Children have smaller handles than their parents, so they come first.
        for &expr in &reachable {
            let own = self.variables.contains(&expr);
            let varying = own || self.graph.children(expr).any(|child| varies[&child]);
            varies.insert(expr, varying);
        }
        for &expr in &reachable {
            let Node::Product(factors) = self.graph.node(expr) else { continue };
            let varying = factors.iter().filter(|(base, _)| varies[base]).count();
            if varying >= 2 && factors.iter().all(|(_, exponent)| exponent.is_integer()) {
                self.products.push((expr, factors.to_vec()));
            }
        }
        if self.products.len() > MOST_PRODUCTS {
            self.products.clear();
        }
        // Stable, so that the choice is definite.
        self.products.sort_by_key(|(_, factors)| std::cmp::Reverse(factors.len()));
    }

    fn rewrite(&mut self, expr: Expr) -> Expr {
        if let Some(&known) = self.done.get(&expr) {
            return known;
        }
        let rewritten = match self.graph.node(expr).clone() {
            Node::Product(factors) => self.rewrite_product(expr, &factors),
            _ => self.mapped(expr),
        };
        self.done.insert(expr, rewritten);
        rewritten
    }

    fn mapped(&mut self, expr: Expr) -> Expr {
        let children: Vec<Expr> = self.graph.children(expr).collect();
        let mapped: BTreeMap<Expr, Expr> =
            children.into_iter().map(|child| (child, self.rewrite(child))).collect();
        if mapped.iter().all(|(child, image)| child == image) {
            return expr;
        }
        self.graph.map_children(expr, &mut |_, child| mapped[&child])
    }

    fn rewrite_product(&mut self, expr: Expr, factors: &[(Expr, Rational)]) -> Expr {
        let found = self.products.iter().find_map(|(part, inner)| {
            let power = times_within(inner, factors).filter(|_| *part != expr)?;
            Some((*part, inner.clone(), power))
        });
        let Some((part, inner, power)) = found else { return self.mapped(expr) };
        let part = self.rewrite(part);
        let part = self.graph.opaque(part);
        let mut product = vec![(part, Rational::from_integer(power.into()))];
        for (base, exponent) in factors {
            let taken = inner.iter().find(|(b, _)| b == base).map(|(_, e)| e);
            let left = taken.map_or_else(
                || exponent.clone(),
                |e| exponent - e * Rational::from_integer(power.into()),
            );
            product.push((self.rewrite(*base), left));
        }
        self.graph.product(product)
    }

    /// Puts the factors that all outputs share into one piece.
    fn share_common_factors(&mut self, outputs: &mut [Expr]) {
        let factors: Option<Vec<Factors>> = outputs
            .iter()
            .map(|&output| match self.graph.node(output) {
                Node::Product(factors) => Some(factors.to_vec()),
                _ => None,
            })
            .collect();
        let Some(factors) = factors.filter(|factors| factors.len() > 1) else { return };
        let shared = |factor: &(Expr, Rational)| factors.iter().all(|f| f.contains(factor));
        let common: Factors = factors[0].iter().filter(|f| shared(f)).cloned().collect();
        if common.len() < 2 {
            return;
        }
        let whole = self.graph.product(common.iter().cloned());
        let whole = self.graph.opaque(whole);
        for (output, factors) in outputs.iter_mut().zip(factors) {
            let rest = factors.into_iter().filter(|factor| !common.contains(factor));
            *output = self.graph.product(rest.chain([(whole, Rational::one())]));
        }
    }
}

/// How often the product of `inner` is contained in that of `factors`; `None` where it is not.
fn times_within(inner: &[(Expr, Rational)], factors: &[(Expr, Rational)]) -> Option<u32> {
    let mut times: Option<u32> = None;
    for (base, exponent) in inner {
        // Factors are sorted by their bases.
        let found = factors.binary_search_by_key(base, |(base, _)| *base).ok()?;
        let ratio = (&factors[found].1 / exponent).to_integer();
        let ratio = if ratio.is_positive() { ratio.to_u32()? } else { return None };
        times = Some(times.map_or(ratio, |times| times.min(ratio)));
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Operation, Program};

    const NAMES: [&str; 6] = ["u", "v", "x", "y", "z", "w"];

    const AT: [f64; 6] = [0.5, -1.5, 2.0, 3.0, -0.25, 8.0];

    /// The program, the values without reuse, and the outputs in their new forms.
    fn reused(graph: &mut Graph, texts: &[&str]) -> (Program, Vec<f64>, Vec<Expr>) {
        let place = Dependence { position: true, time: false };
        let inputs = NAMES.map(|name| (graph.symbol(name), place));
        let outputs: Vec<Expr> = texts
            .iter()
            .map(|text| {
                let ast = Ast::parse(text).unwrap();
                graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap()
            })
            .collect();
        let plain = Program::lower(graph, &inputs, &[], &outputs).evaluate(&AT);
        let outputs = reuse(graph, &inputs, &[], &outputs);
        (Program::lower(graph, &inputs, &[], &outputs), plain, outputs)
    }

    /// Products multiply their factors in the order of the names, so that what two have in common is not at hand by itself where
    /// they begin with what they have not.
    #[test]
    fn common_factors_are_multiplied_once() {
        for (texts, products) in [
            (&["u*x", "v*x"][..], 2),
            (&["u*x*y", "v*x*y"], 3),
            (&["u*x*y*z", "v*x*y*z"], 4),
            (&["u*x*y*z*w", "v*x*y*z*w"], 5),
            // Not all have them.
            (&["u*x*y", "v*x*z"], 4),
            (&["u*x*y", "v*x*y", "u + v"], 4),
        ] {
            let (program, plain, _) = reused(&mut Graph::new(), texts);
            let found =
                program.operations().iter().filter(|o| matches!(o, Operation::Mul(..))).count();
            assert_eq!(found, products, "{texts:?}: {:?}", program.operations());
            let found = program.evaluate(&AT);
            assert!(found.iter().zip(plain).all(|(a, b)| (a / b - 1.0).abs() < 1e-15), "{texts:?}");
        }
    }

    /// The limit on products may be reached and not be passed.
    #[test]
    fn many_products_are_not_compared() {
        // None of them is within another, since all are of one degree.
        let of_degree = |n: usize| {
            let pairs = (1..n).flat_map(move |i| (1..n - i).map(move |j| (i, j)));
            pairs.map(move |(i, j)| format!("u^{i}*v^{j}*x^{}", n - i - j))
        };
        let mut texts = vec!["sin(z*w)*z^2*w^2 + y".to_owned()];
        texts.extend(of_degree(31).take(MOST_PRODUCTS - 2));
        let is_found = |texts: &[String]| {
            let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
            let mut graph = Graph::new();
            let (_, _, outputs) = reused(&mut graph, &texts);
            graph.reachable(&outputs).iter().any(|&e| matches!(graph.node(e), Node::Whole(_)))
        };
        assert!(texts.len() == MOST_PRODUCTS - 1 && is_found(&texts));
        texts.push("u*v".into());
        assert!(!is_found(&texts));
        texts.push("u*y".into());
        assert!(!is_found(&texts));
    }

    /// One product alone has its factors in common with nothing, so it is not made one piece.
    #[test]
    fn one_output_stays_a_product() {
        let mut graph = Graph::new();
        let (program, _, outputs) = reused(&mut graph, &["sin(u*v)*u^2*v^2*x"]);
        assert!(matches!(graph.node(outputs[0]), Node::Product(_)));
        let found = program.operations().iter().filter(|o| matches!(o, Operation::Mul(..))).count();
        assert_eq!(found, 4, "{:?}", program.operations());
    }
}
