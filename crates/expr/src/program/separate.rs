//! Values at the points of a lattice from values of its layers.
//!
//! In a lattice many points share a coordinate: a layer are the points with one value of one coordinate. What depends on one
//! coordinate and the time is computed once a layer, which leaves almost nothing for each point where a value is a short
//! sum of products of such factors. [`Program::with_separated_coordinates`] finds such sums: products and quotients are taken
//! factor by factor, sums term by term, where terms that differ in one coordinate only are added at once, and the logarithm
//! of a product is the sum of the logarithms of its factors, and a root the product of theirs.
//!
//! Logarithms and roots exist for positive factors only. Whoever evaluates the form has to take another one where it gives no
//! number: then two factors may have been negative.

use crate::program::keep::KEPT_NUMBER;
use crate::program::{Builder, Operation, OperationCount, Program, Slot, power};
use crate::rewrite::accuracy::Samples;
use crate::{Dependence, Function, Rational, Rule};
use num_traits::One;
use std::collections::BTreeMap;
use std::ops::Range;

/// Sums of more terms than this are not worth the search.
const MOST_TERMS: usize = 16;
/// Powers up to here are told apart from their bases.
const LARGEST_POWER: u32 = 1 << 16;
/// How many times less than before a point of a lattice must cost, so that the layers and what leads to them pay as well.
const WORTHWHILE: usize = 2;

impl Program {
    /// The program with further outputs: those of the given places once more, as sums of products of values of one of the first
    /// `dimension` inputs each, the coordinates. `None` where they are not such sums, or where points of a lattice would not
    /// cost much less.
    ///
    /// The form has the same value where it is a number. Where several factors of a product are negative whose logarithm or
    /// root is taken, it is none.
    #[must_use]
    pub fn with_separated_coordinates(
        &self,
        places: Range<usize>,
        dimension: usize,
    ) -> Option<Program> {
        if Rule::Separate.is_off() {
            return None;
        }
        let outputs = self.outputs().get(places)?;
        if dimension < 2 {
            return None;
        }
        let separated = Separating::new(self, dimension).program(outputs)?.compacted();
        let new = &separated.outputs()[self.outputs().len()..];
        let kept = self.kept_at_points(outputs, usize::MAX);
        let pays = WORTHWHILE * separated.cost_in_lattice(new, dimension)
            <= self.cost_at_points(outputs, &kept);
        let (before, after) = (self.part(outputs), separated.part(new));
        let is_accurate =
            || Samples::of(&before, self.input_count()).admit_where_defined(&before, &after);
        (pays && is_accurate()).then_some(separated)
    }

    /// For each coordinate the values that depend on it and on no other one, and that `outputs` are computed from at points
    /// of a lattice.
    #[must_use]
    pub fn layers(&self, outputs: &[Slot], dimension: usize) -> Vec<Vec<Slot>> {
        let coordinates = self.coordinates(dimension);
        let mut layers = vec![Vec::new(); dimension];
        let mut seen = vec![false; self.operations().len()];
        let mut stack = outputs.to_vec();
        while let Some(slot) = stack.pop() {
            if std::mem::replace(&mut seen[slot.index()], true) {
                continue;
            }
            match coordinates[slot.index()] {
                Coordinates::None => {}
                Coordinates::One(axis) => layers[axis].push(slot),
                Coordinates::Several => stack.extend(self.operations()[slot.index()].operands()),
            }
        }
        layers.iter_mut().for_each(|layer| layer.sort_unstable());
        layers
    }

    /// The operations that `outputs` need for all layers at each time, one along each axis, and for each point of a lattice.
    #[must_use]
    pub fn operations_in_lattice(&self, outputs: &[Slot], dimension: usize) -> [OperationCount; 2] {
        let coordinates = self.coordinates(dimension);
        let needed = self.needed(outputs);
        let [mut layers, mut points] = [OperationCount::default(); 2];
        for slot in self.slots().filter(|slot| needed[slot.index()]) {
            let operation = &self.operations()[slot.index()];
            match coordinates[slot.index()] {
                Coordinates::One(_) if self.dependence(slot).time => layers.count(operation),
                Coordinates::Several => points.count(operation),
                _ => {}
            }
        }
        [layers, points]
    }

    /// Cost of `outputs` for each point of a lattice at each time.
    fn cost_in_lattice(&self, outputs: &[Slot], dimension: usize) -> usize {
        let of_layers: usize = self.layers(outputs, dimension).iter().map(Vec::len).sum();
        let [_, points] = self.operations_in_lattice(outputs, dimension);
        // The numbers of its layers are kept for each point.
        KEPT_NUMBER + of_layers + points.cost()
    }

    /// Which of the first `dimension` inputs each value depends on.
    fn coordinates(&self, dimension: usize) -> Vec<Coordinates> {
        let mut coordinates = Vec::with_capacity(self.operations().len());
        for operation in self.operations() {
            coordinates.push(Coordinates::of(operation, &coordinates, dimension));
        }
        coordinates
    }
}

/// Which coordinates a value depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coordinates {
    None,
    /// The one of this axis.
    One(usize),
    Several,
}

impl Coordinates {
    /// Coordinates of an operation, from those of its operands.
    fn of(operation: &Operation, known: &[Coordinates], dimension: usize) -> Self {
        if let Operation::Input(axis) = *operation {
            return if axis < dimension { Coordinates::One(axis) } else { Coordinates::None };
        }
        let operands = operation.operands().map(|slot| known[slot.index()]);
        operands.fold(Coordinates::None, |all, own| match (all, own) {
            (Coordinates::None, one) | (one, Coordinates::None) => one,
            (a, b) if a == b => a,
            _ => Coordinates::Several,
        })
    }
}

/// A signed product of values to positive and negative powers, each of at most one coordinate.
#[derive(Clone, Debug, Default, PartialEq)]
struct Term {
    negative: bool,
    powers: BTreeMap<Slot, i32>,
}

impl Term {
    fn of(slot: Slot) -> Self {
        Term { negative: false, powers: BTreeMap::from([(slot, 1)]) }
    }

    fn times(&self, other: &Term, exponent: i32) -> Term {
        let mut product = Term {
            negative: self.negative != (other.negative && exponent % 2 != 0),
            powers: self.powers.clone(),
        };
        for (&slot, &power) in &other.powers {
            let total = product.powers.entry(slot).or_insert(0);
            *total += exponent * power;
            if *total == 0 {
                product.powers.remove(&slot);
            }
        }
        product
    }

    /// The powers that both have.
    fn common(&self, other: &Term) -> Term {
        let powers = self.powers.iter().filter_map(|(&slot, &own)| {
            let &power = other.powers.get(&slot)?;
            (own.signum() == power.signum())
                .then(|| (slot, own.signum() * own.abs().min(power.abs())))
        });
        Term { negative: false, powers: powers.collect() }
    }
}

struct Separating<'a> {
    program: &'a Program,
    dimension: usize,
    /// The operations of the program, and after them the new ones.
    builder: Builder,
    coordinates: Vec<Coordinates>,
}

impl<'a> Separating<'a> {
    fn new(program: &'a Program, dimension: usize) -> Self {
        Separating {
            program,
            dimension,
            builder: Builder::of(program),
            coordinates: program.coordinates(dimension),
        }
    }

    /// The program with further outputs.
    fn program(mut self, outputs: &[Slot]) -> Option<Program> {
        let needed = self.program.needed(outputs);
        let mut sums: Vec<Vec<Term>> = vec![Vec::new(); self.program.operations().len()];
        for slot in self.program.slots().filter(|slot| needed[slot.index()]) {
            sums[slot.index()] = self.terms(slot, &sums)?;
        }
        let mut all = self.program.outputs().to_vec();
        all.extend(outputs.iter().map(|slot| self.sum(&sums[slot.index()])));
        Some(self.builder.program(all))
    }

    /// A value as a sum of products, from those of its operands.
    fn terms(&mut self, slot: Slot, sums: &[Vec<Term>]) -> Option<Vec<Term>> {
        let of = |slot: Slot| sums[slot.index()].as_slice();
        let single = |slot: Slot| match of(slot) {
            [term] => Some(term),
            _ => None,
        };
        let whole = || vec![Term::of(slot)];
        let coordinates = self.coordinates[slot.index()];
        let several = coordinates == Coordinates::Several;
        match self.program.operations()[slot.index()] {
            Operation::Number(ref one) if one.is_one() => Some(vec![Term::default()]),
            Operation::Neg(a) => self.products(of(a), &minus_one()),
            // Products of what is the same at all points stay as they are.
            _ if coordinates == Coordinates::None => Some(whole()),
            Operation::Mul(a, b) => self.products(of(a), of(b)).or_else(|| (!several).then(whole)),
            Operation::Div(a, b) => {
                let divisor = single(b).map(|divisor| [Term::default().times(divisor, -1)]);
                let quotients = divisor.and_then(|divisor| self.products(of(a), &divisor));
                quotients.or_else(|| (!several).then(whole))
            }
            _ if !several => Some(whole()),
            Operation::Add(a, b) => self.merged(of(a).iter().chain(of(b)).cloned()),
            Operation::Sub(a, b) => {
                let subtracted = self.products(of(b), &minus_one())?;
                self.merged(of(a).iter().cloned().chain(subtracted))
            }
            Operation::LnOfBoth(_, y) | Operation::Call(Function::Ln, y) => {
                let logarithms = self.logarithms(single(y)?)?;
                self.merged(logarithms.into_iter())
            }
            Operation::Sqrt(a) => self.powers(single(a)?, Operation::Sqrt),
            Operation::Power(a, ref exponent) => {
                self.powers(single(a)?, |a| Operation::Power(a, exponent.clone()))
            }
            _ => None,
        }
    }

    /// `None` where too many terms are left, or powers are very large.
    fn products(&mut self, a: &[Term], b: &[Term]) -> Option<Vec<Term>> {
        let each = |a: &Term| b.iter().map(|b| a.times(b, 1)).collect::<Vec<_>>();
        let products: Vec<Term> = a.iter().flat_map(each).collect();
        let mut powers = products.iter().flat_map(|product| product.powers.values());
        let is_moderate = powers.all(|power| power.unsigned_abs() <= LARGEST_POWER);
        is_moderate.then(|| self.merged(products.into_iter()))?
    }

    /// The logarithm of a product, as a sum of those of what it has of each coordinate; `None` for a negative one.
    fn logarithms(&mut self, product: &Term) -> Option<Vec<Term>> {
        let logarithm = |separating: &mut Self, part: Term| {
            let y = separating.product(&part);
            let one = separating.push(Operation::Number(Rational::one()));
            let beside_one = match *separating.builder.operation(y) {
                Operation::Add(x, unit) | Operation::Add(unit, x) if unit == one => Some(x),
                Operation::Sub(unit, x) if unit == one => Some(separating.push(Operation::Neg(x))),
                _ => None,
            };
            Term::of(separating.push(match beside_one {
                Some(x) => Operation::LnOfBoth(x, y),
                None => Operation::Call(Function::Ln, y),
            }))
        };
        let parts = (!product.negative).then(|| self.parts(product))?;
        Some(parts.into_iter().map(|part| logarithm(self, part)).collect())
    }

    /// A root or another power of a product, as the product of those of what it has of each coordinate; `None` for a negative
    /// one.
    fn powers(&mut self, product: &Term, power: impl Fn(Slot) -> Operation) -> Option<Vec<Term>> {
        let parts = (!product.negative).then(|| self.parts(product))?;
        let mut total = Term::default();
        for part in parts {
            let base = self.product(&part);
            total = total.times(&Term::of(self.push(power(base))), 1);
        }
        Some(vec![total])
    }

    /// Terms in which those are added that differ in one coordinate at most; `None` where too many are left.
    fn merged(&mut self, terms: impl Iterator<Item = Term>) -> Option<Vec<Term>> {
        let mut merged: Vec<Term> = Vec::new();
        for term in terms {
            let mut added = Some(term);
            // A sum may meet another term in another coordinate.
            while let Some(term) = added.take() {
                let Some(place) = merged.iter().position(|other| self.is_alike(other, &term))
                else {
                    merged.push(term);
                    break;
                };
                let other = merged.remove(place);
                added = self.sum_of_alike(&other, &term);
            }
            if merged.len() > MOST_TERMS {
                return None;
            }
        }
        Some(merged)
    }

    /// The sum of two terms as one; `None` where they cancel.
    fn sum_of_alike(&mut self, a: &Term, b: &Term) -> Option<Term> {
        let common = a.common(b);
        let [a, b] = [a, b].map(|term| {
            let rest = term.times(&common, -1);
            (rest.negative, self.product(&rest))
        });
        if a.1 == b.1 && a.0 != b.0 {
            return None;
        }
        let (negative, sum) = self.add(a, b);
        Some(common.times(&Term { negative, ..Term::of(sum) }, 1))
    }

    /// Whether what two terms do not have in common is of one coordinate at most.
    fn is_alike(&self, a: &Term, b: &Term) -> bool {
        let common = a.common(b);
        let rests = [a, b].map(|term| term.times(&common, -1));
        let of = rests.iter().flat_map(|rest| rest.powers.keys());
        let mut axes = of.filter_map(|slot| match self.coordinates[slot.index()] {
            Coordinates::One(axis) => Some(axis),
            _ => None,
        });
        let first = axes.next();
        axes.all(|axis| Some(axis) == first)
    }

    /// Parts of a product, one for each coordinate; factors of none are in the first part.
    fn parts(&self, product: &Term) -> Vec<Term> {
        let mut parts = vec![Term::default(); self.dimension];
        let mut uniform = BTreeMap::new();
        for (&slot, &power) in &product.powers {
            match self.coordinates[slot.index()] {
                Coordinates::One(axis) => parts[axis].powers.insert(slot, power),
                _ => uniform.insert(slot, power),
            };
        }
        parts.retain(|part| !part.powers.is_empty());
        match parts.first_mut() {
            Some(first) => first.powers.extend(uniform),
            None => parts.push(Term { negative: false, powers: uniform }),
        }
        parts
    }

    /// A sum of products, those of each coordinate first.
    fn sum(&mut self, terms: &[Term]) -> Slot {
        let mut values = Vec::new();
        for term in terms {
            let parts = self.parts(term);
            let parts: Vec<Slot> = parts.iter().map(|part| self.product(part)).collect();
            let product = parts.into_iter().reduce(|a, b| self.push(Operation::Mul(a, b)));
            values.extend(product.map(|product| (term.negative, product)));
        }
        let sum = values.into_iter().reduce(|a, b| self.add(a, b));
        match sum {
            Some((false, slot)) => slot,
            Some((true, slot)) => self.push(Operation::Neg(slot)),
            None => self.push(Operation::Number(Rational::from(0))),
        }
    }

    /// A product, what changes least often first, with one quotient for each rate of change; its sign is left out.
    fn product(&mut self, product: &Term) -> Slot {
        let mut by_rate: BTreeMap<Dependence, [Vec<(Slot, u32)>; 2]> = BTreeMap::new();
        for (&slot, &power) in &product.powers {
            let own = by_rate.entry(self.builder.dependence(slot)).or_default();
            own[usize::from(power < 0)].push((slot, power.unsigned_abs()));
        }
        let one = self.push(Operation::Number(Rational::one()));
        let mut total = one;
        for [above, below] in by_rate.into_values() {
            let [above, below] = [above, below].map(|powers| {
                let mut times = |a, b| self.push(Operation::Mul(a, b));
                let powers = powers.into_iter().map(|(slot, n)| power(slot, n, &mut times));
                let powers: Vec<Slot> = powers.collect();
                powers.into_iter().reduce(|a, b| self.push(Operation::Mul(a, b)))
            });
            total = match above {
                Some(above) if total == one => above,
                Some(above) => self.push(Operation::Mul(total, above)),
                None => total,
            };
            total = below.map_or(total, |below| self.push(Operation::Div(total, below)));
        }
        total
    }

    /// The sum of signed values; negative only where both are.
    fn add(&mut self, a: (bool, Slot), b: (bool, Slot)) -> (bool, Slot) {
        let number = |slot: Slot| match self.builder.operation(slot) {
            Operation::Number(value) => Some(value.clone()),
            _ => None,
        };
        if a.0 == b.0
            && let (Some(x), Some(y)) = (number(a.1), number(b.1))
        {
            return (a.0, self.push(Operation::Number(x + y)));
        }
        match (a, b) {
            ((false, a), (true, b)) | ((true, b), (false, a)) => {
                (false, self.push(Operation::Sub(a, b)))
            }
            ((negative, a), (_, b)) => (negative, self.push(Operation::Add(a, b))),
        }
    }

    fn push(&mut self, operation: Operation) -> Slot {
        let coordinates = Coordinates::of(&operation, &self.coordinates, self.dimension);
        let slot = self.builder.push(operation);
        if slot.index() == self.coordinates.len() {
            self.coordinates.push(coordinates);
        }
        slot
    }
}

fn minus_one() -> [Term; 1] {
    [Term { negative: true, powers: BTreeMap::new() }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Graph};
    use proptest::prelude::*;

    /// Program in the coordinates `x`, `y` and `z`, the time `t` and a parameter `a`.
    fn program(texts: &[&str]) -> Program {
        let mut graph = Graph::new();
        let rate = |name: &str| Dependence { position: "xyz".contains(name), time: name == "t" };
        let names = ["x", "y", "z", "t", "a"];
        let inputs = names.map(|name| (graph.symbol(name), rate(name)));
        let mut build = |text: &&str| {
            let ast = Ast::parse(text).unwrap();
            graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap()
        };
        let outputs: Vec<_> = texts.iter().map(&mut build).collect();
        Program::lower(&mut graph, &inputs, &[], &outputs)
    }

    /// The outputs once more, in their separated form, wanted or not.
    fn separated(program: &Program) -> Option<Program> {
        let separated = Separating::new(program, 3).program(program.outputs())?.compacted();
        Some(separated.part(&separated.outputs()[program.outputs().len()..]))
    }

    fn close(found: f64, expected: f64, scale: f64) -> bool {
        (found - expected).abs() <= 1e-13 * scale
    }

    /// Work left for each point: its operations, and values of layers along each axis.
    #[test]
    fn what_is_left_for_points_of_a_lattice() {
        for (texts, operations, layers) in [
            (&["t*sin(x)*y"][..], 1, [1, 1, 0]),
            (&["sin(t*x) + cos(t*y)"], 1, [1, 1, 0]),
            (&["-(t*sin(x)*y)"], 2, [1, 1, 0]),
            (&["(1 + t*x)*(1 + t*y)*(2 + t*z)"], 2, [1, 1, 1]),
            // What is of one coordinate is one value.
            (&["(x + t)*sin(x)/(1 + x^2) - a*exp(t*x)"], 0, [1, 0, 0]),
            (&["t + a"], 0, [0, 0, 0]),
            // Terms that differ in one coordinate are one term, in whatever order they come.
            (&["x*y + t*sin(x)*y + x^2*y"], 1, [1, 1, 0]),
            (&["x*sin(y) + t*y*z + x*cos(y)"], 3, [1, 2, 1]),
            // Products are multiplied out, and factors cancel.
            (&["(x + y)*t*x/(x + 2)"], 2, [2, 1, 0]),
            (&["(t*x + t*y)/(x*y)"], 1, [1, 1, 0]),
            (&["x*(y + sin(y)) - x*(y + cos(y))"], 1, [1, 1, 0]),
            // Logarithms and roots of products.
            (&["x*ln((2 + t*x)*(3 + t*y)*z)"], 4, [2, 1, 1]),
            (&["sqrt((2 + t*x)*y)*a"], 1, [1, 1, 0]),
            (&["x*((2 + t*x)*y)^(1/3)"], 1, [1, 1, 0]),
            // Several outputs share values.
            (&["x*ln((2 + t*x)*(3 + t*y))", "y*ln((2 + t*x)*(3 + t*y))"], 4, [3, 3, 0]),
        ] {
            let program = program(texts);
            let form = separated(&program).unwrap_or_else(|| panic!("{texts:?}"));
            let coordinates = form.coordinates(3);
            let several = coordinates.iter().filter(|c| **c == Coordinates::Several).count();
            let counts: Vec<usize> = form.layers(form.outputs(), 3).iter().map(Vec::len).collect();
            assert_eq!((several, counts.as_slice()), (operations, &layers[..]), "{texts:?}");
            let at = [0.75, 1.5, 0.625, 0.5, 0.3];
            for (old, new) in program.evaluate(&at).iter().zip(form.evaluate(&at)) {
                assert!(close(new, *old, old.abs()), "{texts:?}: {new}, not {old}");
            }
        }
    }

    /// Next to one it is taken of the difference, where the factor is formed from it.
    #[test]
    fn logarithms_of_stretches() {
        let count = |text: &str| {
            let form = separated(&program(&[text])).unwrap();
            let of = |such: fn(&Operation) -> bool| {
                form.operations().iter().filter(|operation| such(operation)).count()
            };
            let [both, plain] = [
                of(|operation| matches!(operation, Operation::LnOfBoth(..))),
                of(|operation| matches!(operation, Operation::Call(Function::Ln, _))),
            ];
            (both, plain)
        };
        assert_eq!(count("x*ln((1 + t*x)*(1 - t*y))"), (2, 0));
        assert_eq!(count("x*ln((1 + t*x)*(2 + t*y))"), (1, 1));
        assert_eq!(count("x*ln((1 + t*x)^2*y)"), (0, 2));
    }

    #[test]
    fn what_cannot_be_separated() {
        for text in ["sin(t*x*y)", "1/(x + y)", "sqrt(x + y)", "ln(x + t*y)", "ln(-(x*y))*t"] {
            assert!(separated(&program(&[text])).is_none(), "{text}");
        }
        // Powers of any size are values of their coordinate.
        for power in ["x^65", "(x^1000)^65", "(x^1000)^66", "((x^1000)^1000)^1000"] {
            let form = separated(&program(&[&format!("t*{power}*y + {power}")])).unwrap();
            let counts: Vec<usize> = form.layers(form.outputs(), 3).iter().map(Vec::len).collect();
            assert_eq!(counts, [1, 1, 0], "{power}");
            assert_eq!(form.evaluate(&[1.0, 3.0, 0.0, 2.0]), [7.0], "{power}");
        }
        // More terms than are worth it.
        let sum = |count: usize| {
            let terms: Vec<String> =
                (1..=count).map(|n| format!("sin(t*{n}*x)*cos(t*{n}*y)")).collect();
            separated(&program(&[&terms.join(" + ")])).is_some()
        };
        assert!(sum(MOST_TERMS) && !sum(MOST_TERMS + 1));
    }

    /// The form is taken where it costs much less, and only where there are several coordinates.
    #[test]
    fn only_what_pays_is_taken() {
        let dear = program(&["x*sin(t*x)*ln((2 + t*x)*(3 + t*y))/(1 + t*y)"]);
        let form = dear.with_separated_coordinates(0..1, 2).unwrap();
        assert_eq!(form.outputs().len(), 2);
        assert_eq!(form.part(&form.outputs()[..1]).operations(), dear.operations());
        assert!(dear.with_separated_coordinates(0..1, 1).is_none());
        assert!(dear.with_separated_coordinates(0..2, 2).is_none());
        assert!(program(&["t*x + y"]).with_separated_coordinates(0..1, 2).is_none());
    }

    /// The difference of two coordinates is rounded once, and may not be multiplied out; their sum may.
    #[test]
    fn digits_are_kept() {
        for (sum, taken) in [("x + y", true), ("x - y", false)] {
            let text = format!("({sum})*sin(t*x)*ln(2 + t*x)*ln(2 + t*y)*sin(t*y)");
            let program = program(&[&text]);
            assert!(separated(&program).is_some());
            assert_eq!(program.with_separated_coordinates(0..1, 2).is_some(), taken, "{text}");
        }
    }

    proptest! {
        /// Sums of products, over a product, and the logarithm of one.
        #[test]
        fn values_stay(
            terms in prop::collection::vec((-9_i32..10, 0..3, 0..3, 0..3, 0..3), 1..6),
            factor in (-9_i32..10, 1..5, 1..5),
            at in prop::array::uniform5(0.2_f64..0.9),
        ) {
            let term = |(c, i, j, k, l): &(i32, i32, i32, i32, i32)| {
                format!("({c})*sin(t*x)^{i}*(y + t)^{j}*z^{k}*x^{l}")
            };
            let sum: Vec<String> = terms.iter().map(term).collect();
            let (c, i, j) = factor;
            let bottom = format!("(x + {i})^{j}*(y*t + {j})");
            let text = format!(
                "({})*(({c})*y - z*x)/({bottom}) + x*ln({bottom})",
                sum.join(" + ")
            );
            let program = program(&[&text]);
            if let Some(form) = separated(&program) {
                let (old, new) = (program.evaluate(&at)[0], form.evaluate(&at)[0]);
                let scale: f64 = terms.iter().map(|term| f64::from(term.0.abs())).sum();
                prop_assert!(close(new, old, 40.0 * (scale + 10.0)), "{text}: {new}, not {old}");
            }
        }
    }
}
