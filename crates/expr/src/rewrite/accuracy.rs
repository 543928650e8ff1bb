//! Whether one form of some values is as accurate as another.
//!
//! Forms of the same value differ in what rounding does to them. [`Samples`] are points at which the bounds of their errors
//! are compared, by running error analysis: points all over the range of the inputs, at some of which one input is tiny, as
//! an amplitude may be, and points where a quantity almost vanishes that is divided by, as a stretch does in a body
//! that is almost inverted. Sums of quotients lose their digits there first.

use crate::program::SIDE;
use crate::{Function, Operation, Program, Slot};
use std::array;
use std::collections::BTreeSet;

/// How much larger than before the error bound may be: at most points, and at any.
const USUAL_GROWTH: f64 = 1.5;
const LARGEST_GROWTH: f64 = 8.0;
/// At how many points a quantity is looked at that may vanish, how many are tried for each, how many there are in all, and
/// how small it is there.
const CROSSINGS: usize = 4;
const MOST_TRIED: usize = 8;
const MOST_NEAR: usize = 2 * SIDE;
const ALMOST_NOTHING: f64 = 1e-8;

const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;
const PLASTIC_RATIO: f64 = 0.324_717_957_244_746;

/// Points at which programs are compared: the values of each input, `SIDE` points side by side.
pub(crate) struct Samples(Vec<Vec<[f64; SIDE]>>);

impl Samples {
    /// For programs of so many inputs. At every other point one input is tiny.
    pub(crate) fn usual(inputs: usize) -> Self {
        let points = 64.max(2 * inputs);
        let side_by_side =
            |first| (0..inputs).map(|input| array::from_fn(|k| sample(first + k, input))).collect();
        Samples((0..points).step_by(SIDE).map(side_by_side).collect())
    }

    /// Further ones where quantities almost vanish by which `program` divides, or whose logarithm or root it takes, or factors
    /// of these.
    pub(crate) fn of(program: &Program, inputs: usize) -> Self {
        let mut samples = Self::usual(inputs);
        let near = samples.near_vanishing(program);
        let side_by_side = |points: &[Vec<f64>]| {
            let row = |input: usize| array::from_fn(|k| points[k.min(points.len() - 1)][input]);
            (0..inputs).map(row).collect()
        };
        samples.0.extend(near.chunks(SIDE).map(side_by_side));
        samples
    }

    /// Points between the usual ones at which one of the quantities is almost zero, and positive.
    fn near_vanishing(&self, program: &Program) -> Vec<Vec<f64>> {
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); program.operations().len()];
        for places in &self.0 {
            let rows = program.values(places);
            values.iter_mut().zip(rows).for_each(|(values, row)| values.extend(row));
        }
        let point =
            |n: usize| -> Vec<f64> { self.0[n / SIDE].iter().map(|row| row[n % SIDE]).collect() };
        let mut quantities: Vec<_> = divisors(program)
            .into_iter()
            .map(|slot| {
                let values = &values[slot.index()];
                (program.part(&[slot]), values, crossings(values))
            })
            .collect();
        // One point of each, then one more of each, until there are enough.
        let mut found = Vec::new();
        for _ in 0..CROSSINGS {
            for (quantity, values, crossings) in &mut quantities {
                let near = crossings.map(|n| {
                    let (above, below) = if values[n] > 0.0 { (n, n + 1) } else { (n + 1, n) };
                    almost_zero(quantity, point(below), point(above))
                });
                // Where another stretch is negative nothing may be defined.
                let is_defined =
                    |at: &Vec<f64>| program.evaluate(at).iter().all(|value| value.is_finite());
                found.extend(near.take(MOST_TRIED).find(is_defined));
                if found.len() == MOST_NEAR {
                    return found;
                }
            }
        }
        found
    }

    /// Whether the error bound of `after` is hardly larger than that of `before`: at more than half of the points by little,
    /// and nowhere by much.
    pub(crate) fn admit(&self, before: &Program, after: &Program) -> bool {
        let growth = self.growth_of_bounds(before, after);
        // What is not finite any more is infinitely worse.
        hardly_larger(growth.into_iter().map(|growth| growth.unwrap_or(f64::INFINITY)).collect())
    }

    /// As [`admit`](Self::admit), for a form that need be defined only at half of the points where the other one is.
    pub(crate) fn admit_where_defined(&self, before: &Program, after: &Program) -> bool {
        let growth = self.growth_of_bounds(before, after);
        let known: Vec<f64> = growth.iter().flatten().copied().collect();
        2 * known.len() >= growth.len() && hardly_larger(known)
    }

    /// How many times as large the bound of each output's error is in `after`, at each of the points where it is finite in
    /// `before`; `None` where it is not finite in `after`.
    fn growth_of_bounds(&self, before: &Program, after: &Program) -> Vec<Option<f64>> {
        let mut growth = Vec::new();
        for places in &self.0 {
            let bounds = before.error_bounds(places).into_iter().zip(after.error_bounds(places));
            for (old, new) in bounds.flat_map(|(old, new)| old.into_iter().zip(new)) {
                // Where the point is outside the domain of definition there is nothing to compare.
                if old.is_finite() {
                    // Nothing is as large as nothing.
                    let times = || if new <= old { 1.0 } else { new / old };
                    growth.push(new.is_finite().then(times));
                }
            }
        }
        growth
    }
}

/// An input at a point of a fixed sequence: multiples of the golden ratio, with a different start for each input.
fn sample(point: usize, input: usize) -> f64 {
    let turns = GOLDEN_RATIO * point as f64 + PLASTIC_RATIO * input as f64;
    let scale = if point == 2 * input + 1 { 1e-8 } else { 1.0 };
    scale * (0.05 + 0.9 * turns.fract())
}

/// Divisors in a program, arguments of logarithms and roots, and the factors of all these.
fn divisors(program: &Program) -> BTreeSet<Slot> {
    let operations = program.operations();
    let divisor = |operation: &Operation| match *operation {
        Operation::Div(_, y)
        | Operation::LnOfBoth(_, y)
        | Operation::Call(Function::Ln, y)
        | Operation::Sqrt(y)
        | Operation::Power(y, _) => Some(y),
        _ => None,
    };
    let mut open: Vec<Slot> = operations.iter().filter_map(divisor).collect();
    let mut divisors = BTreeSet::new();
    while let Some(slot) = open.pop() {
        if divisors.insert(slot)
            && let Operation::Mul(a, b) = operations[slot.index()]
        {
            open.extend([a, b]);
        }
    }
    divisors
}

/// The places after which values in a row change their sign.
fn crossings(values: &[f64]) -> impl Iterator<Item = usize> {
    let pairs = values.windows(2).enumerate();
    pairs.filter(|(_, pair)| (pair[0] > 0.0) != (pair[1] > 0.0)).map(|(n, _)| n)
}

/// A point between two, of which one is not above zero and the other is, at which the only output of a program is
/// positive and almost zero.
fn almost_zero(quantity: &Program, mut below: Vec<f64>, mut above: Vec<f64>) -> Vec<f64> {
    loop {
        let middle: Vec<f64> = above.iter().zip(&below).map(|(a, b)| 0.5 * (a + b)).collect();
        if middle == above || middle == below {
            return above;
        }
        let value = quantity.evaluate(&middle)[0];
        if value > 0.0 && value < ALMOST_NOTHING {
            return middle;
        }
        let end = if value > 0.0 { &mut above } else { &mut below };
        *end = middle;
    }
}

/// Whether what error bounds have grown by is little at most places, and at none much.
fn hardly_larger(mut growth: Vec<f64>) -> bool {
    growth.sort_by(f64::total_cmp);
    let usual = growth.get(growth.len() / 2).copied().unwrap_or(1.0);
    let largest = growth.last().copied().unwrap_or(1.0);
    usual <= USUAL_GROWTH && largest <= LARGEST_GROWTH
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Dependence, Graph};

    /// The points of each input are all over its range, none of two inputs are the same, and each is tiny at one odd point.
    #[test]
    fn sample_points_fill_their_range() {
        for input in 0..20 {
            let is_tiny = |point: usize| sample(point, input) < 1e-7;
            let tiny: Vec<usize> = (0..64).filter(|&point| is_tiny(point)).collect();
            assert_eq!(tiny, [2 * input + 1]);
            let points = (0..64).filter(|&point| !is_tiny(point));
            let mut at: Vec<f64> = points.map(|point| sample(point, input)).collect();
            at.sort_by(f64::total_cmp);
            assert!(at[0] >= 0.05 && at[0] < 0.1 && at[62] > 0.9 && at[62] <= 0.95, "{at:?}");
            assert!(at.windows(2).all(|pair| pair[1] - pair[0] < 0.06), "{at:?}");
        }
        let mut first: Vec<f64> = (0..20).map(|input| sample(0, input)).collect();
        first.sort_by(f64::total_cmp);
        assert!(first.windows(2).all(|pair| pair[1] - pair[0] > 0.01), "{first:?}");
    }

    /// Only the bounds of the errors are compared, whatever the programs compute: `n x y` has two roundings of `n x y`.
    #[test]
    fn bounds_may_hardly_grow() {
        let mut graph = Graph::new();
        let inputs = ["x", "y"].map(|name| (graph.symbol(name), Dependence::default()));
        let mut program = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            Program::lower(&mut graph, &inputs, &[], &[expr])
        };
        let four = program("4*x*y");
        let samples = Samples::usual(2);
        for (text, expected) in [
            ("4*x*y", true),
            ("x*y", true),
            ("x", true),
            // By little, and by more than little at most points.
            ("5*x*y", true),
            ("5.9*x*y", true),
            ("6.1*x*y", false),
            ("40*x*y", false),
            // By little where nothing is tiny, and by much where x or y is.
            ("4*x*y + 1/(10^12*x)", false),
            ("4*x*y + 1/(10^12*y)", false),
            // At some points not defined any more, at more than half of them not defined.
            ("4*x*y + 10^(-20)*sqrt(0.9 - x)", false),
            ("sqrt(x - 2)", false),
        ] {
            assert_eq!(samples.admit(&four, &program(text)), expected, "{text}");
        }
        // The same but for a factor: it is about one at most points, and up to five, or up to nine, where y is largest.
        let product = program("4*(x + 1)*(y + 1)");
        assert!(samples.admit(&product, &program("(x + 1)*(y + 1)^7/12")));
        assert!(!samples.admit(&product, &program("(x + 1)*(y + 1)^9/27")));
        // However many inputs there are, each is tiny once.
        let names: Vec<String> = (0..40).map(|n| format!("x{n}")).collect();
        let mut graph = Graph::new();
        let inputs: Vec<_> =
            names.iter().map(|name| (graph.symbol(name), Dependence::default())).collect();
        let mut program_of_many = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            Program::lower(&mut graph, &inputs, &[], &[expr])
        };
        let sum = program_of_many(&names.join(" + "));
        for name in &names {
            let candidate = format!("{} + 1/(10^3*{name})", names.join(" + "));
            assert!(!Samples::usual(40).admit(&sum, &program_of_many(&candidate)), "{name}");
        }
        // What is defined nowhere has nothing to lose, nor what is exact as long as it stays so.
        let (nowhere, exact) = (program("sqrt(x - 2)"), program("x"));
        assert!(samples.admit(&nowhere, &four));
        assert!(samples.admit(&exact, &program("y")));
        assert!(!samples.admit(&exact, &four));
    }

    /// Where a stretch almost vanishes a sum loses what it keeps elsewhere.
    #[test]
    fn bounds_grow_where_divisors_almost_vanish() {
        let mut graph = Graph::new();
        let inputs = ["x", "y"].map(|name| (graph.symbol(name), Dependence::default()));
        let mut program = |text: &str| {
            let ast = Ast::parse(text).unwrap();
            let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
            Program::lower(&mut graph, &inputs, &[], &[expr])
        };
        let before = program("y/(1 - 2*x)");
        let samples = Samples::of(&before, 2);
        let found = Samples::usual(2).near_vanishing(&before);
        assert!(found.len() == CROSSINGS, "{found:?}");
        for at in &found {
            let stretch = 1.0 - 2.0 * at[0];
            assert!(stretch > 0.0 && stretch <= ALMOST_NOTHING, "{at:?}");
        }
        let after = program("y*(1 + 1/(1 - 2*x) - 1)");
        assert!(samples.admit(&before, &after) && Samples::usual(2).admit(&before, &after));
        let after = program("y*(1 - 4*x + 4*x^2)/(1 - 2*x)^3");
        assert!(!samples.admit(&before, &after));
        // What is nowhere defined is not as accurate, even where gaps are allowed.
        assert!(!samples.admit_where_defined(&before, &program("sqrt(-x)*y")));
        let before = program("x*y*(1 + x)*(1 + y)*(2 + x)*(2 + y)");
        let with_gaps = program("x*y*(1 + x)*(1 + y)*(2 + x)*(2 + y) + 10^(-20)*sqrt(0.9 - x)");
        assert!(samples.admit_where_defined(&before, &with_gaps));
        assert!(!samples.admit(&before, &with_gaps));
    }
}
