//! Displacements with the coefficients that were solved for, in a form that keeps digits.
//!
//! `c1 R + c2 R^2 + c3 R^3` with coefficients from conditions at `Ri` and `Ro` is an interpolation. Where the two are next to
//! each other the coefficients are huge and nearly cancel, and so do the terms of each. The digits are in the differences
//! `R - Ri` and `Ro - Ri`, which are almost exact, so the whole displacement is brought over one denominator and written
//! in them:
//!
//! - factors `R - Ri` and the like, at which it vanishes, are set apart, as are factors such as `Ro - Ri`;
//! - the rest is in Newton's form, `C_0 + (R - Ri) (C_1 + (R - Ro) (C_2 + ...))`, so that next to the places, where conditions make
//!   fields vanish or be given, hardly any terms are left;
//! - the coefficients `C_n` and the denominator are polynomials in one of the places and the differences between the others and
//!   this one.

use super::polynomial::{Fraction, Polynomial};
use mmsmith_expr::{Derivatives, Expr, Graph, Node, Rational};
use num_traits::{One, Signed, ToPrimitive, Zero};
use std::collections::{BTreeMap, BTreeSet};

/// Sums to higher powers are not multiplied out.
const LARGEST_POWER: i64 = 8;
/// Displacements of more terms are left as they are.
const MOST_PARTS: usize = 64;

/// Values of the unknowns, as fractions of polynomials in `atoms`.
pub(super) struct Solution {
    pub(super) atoms: Vec<Expr>,
    pub(super) values: Vec<Fraction>,
}

/// A coordinate, the places where conditions hold, and what changes from point to point, this coordinate included.
pub(super) struct Along<'a> {
    pub(super) coordinate: Expr,
    pub(super) places: &'a BTreeSet<Expr>,
    pub(super) variables: &'a BTreeSet<Expr>,
}

/// `number coordinate^power fixed changing`.
struct Part {
    number: Rational,
    power: i64,
    /// Atoms that depend on parameters only, with their powers.
    fixed: Vec<(Expr, i64)>,
    /// The factor that depends on time and on other coordinates.
    changing: Expr,
}

/// A displacement over one denominator.
pub(super) struct Joined<'a> {
    form: Form<'a>,
    /// The power of the coordinate that is set apart.
    least: i64,
    /// By what changes from point to point beside the coordinate.
    numerators: BTreeMap<Expr, Polynomial>,
    denominator: Polynomial,
}

impl<'a> Joined<'a> {
    /// `displacement` with the values of its unknowns; `None` where it is no polynomial in the coordinate and its inverse with unknowns
    /// as coefficients.
    pub(super) fn new(
        graph: &'a mut Graph,
        displacement: Expr,
        unknowns: &[Expr],
        solution: &Solution,
        along: &Along<'_>,
    ) -> Option<Self> {
        let symbols: BTreeSet<Expr> = unknowns.iter().copied().collect();
        if !graph.depends_on(displacement, &symbols) {
            return None;
        }
        let nothing = unknowns.iter().map(|unknown| (*unknown, Graph::ZERO)).collect();
        let mut parts = Vec::new();
        let given = graph.replace(displacement, &nothing);
        parts.extend(spread(graph, given, along)?.into_iter().map(|part| (part, None)));
        for (index, unknown) in unknowns.iter().enumerate() {
            let slope = Derivatives::limited().of(graph, displacement, *unknown);
            if graph.depends_on(slope, &symbols) {
                return None;
            }
            let own = spread(graph, slope, along)?;
            parts.extend(own.into_iter().map(|part| (part, Some(&solution.values[index]))));
        }
        if parts.len() > MOST_PARTS {
            return None;
        }
        let mut atoms: BTreeSet<Expr> = solution.atoms.iter().copied().collect();
        atoms.extend(parts.iter().flat_map(|(part, _)| part.fixed.iter().map(|(atom, _)| *atom)));
        atoms.extend(graph.symbols_in(&along.places.iter().copied().collect::<Vec<_>>()));
        atoms.insert(along.coordinate);
        let space = Space { atoms: atoms.into_iter().collect() };
        let coordinate = space.place(along.coordinate)?;

        let least = parts.iter().map(|(part, _)| part.power).min()?.min(0);
        let mut fractions: Vec<(Expr, Polynomial, Polynomial)> = Vec::new();
        for (part, value) in parts {
            let (above, below) =
                space.fraction(&part, least, coordinate, value.map(|v| (v, solution)))?;
            fractions.push((part.changing, above, below));
        }
        let mut denominator = space.constant(Rational::one());
        for (_, _, below) in &fractions {
            let common = denominator.gcd(below)?;
            denominator = denominator.times(&below.divided_by(&common)?)?;
        }
        let mut numerators: BTreeMap<Expr, Polynomial> = BTreeMap::new();
        for (changing, above, below) in fractions {
            let scaled = above.times(&denominator.divided_by(&below)?)?;
            let sum = numerators.entry(changing).or_default();
            *sum = sum.plus(&scaled);
        }

        let places: Vec<Polynomial> =
            along.places.iter().filter_map(|place| space.polynomial(graph, *place)).collect();
        let form = Form { graph, space, coordinate, places };
        Some(Self { form, least, numerators, denominator })
    }

    /// The factored form; `None` where nothing is gained by it.
    pub(super) fn formed(self) -> Option<Expr> {
        let Self { mut form, least, numerators, denominator } = self;
        let differences = form.differences();
        let shifts = form.shifts()?;
        let below = form.expression(denominator.clone(), &differences, &shifts)?;
        let (mut terms, mut given) = (Vec::new(), Vec::new());
        for (changing, numerator) in numerators {
            let roots = form.roots();
            let all: Vec<Polynomial> =
                roots.into_iter().chain(differences.iter().cloned()).collect();
            let common = Common { denominator: &denominator, below, factors: &all };
            if let Some(value) = form.through_given_values(&numerator, least, &common, &shifts) {
                given.push(form.graph.mul(changing, value));
                continue;
            }
            let above = form.expression(numerator, &all, &shifts)?;
            terms.push(form.graph.mul(changing, above));
        }
        let (graph, coordinate) = (form.graph, form.space.atoms[form.coordinate]);
        let sum = graph.sum_of(terms);
        let power = graph.powi(coordinate, least);
        let scaled = graph.mul(sum, power);
        given.push(graph.div(scaled, below));
        Some(graph.sum_of(given))
    }
}

/// Denominator and factors that the terms of a displacement share.
pub(super) struct Common<'a> {
    pub(super) denominator: &'a Polynomial,
    /// The denominator as an expression.
    pub(super) below: Expr,
    /// Polynomials that numerators are divided by as often as it goes.
    pub(super) factors: &'a [Polynomial],
}

/// The terms of `expr`, multiplied out as far as the coordinate is in sums.
fn spread(graph: &mut Graph, expr: Expr, along: &Along<'_>) -> Option<Vec<Part>> {
    let own = BTreeSet::from([along.coordinate]);
    let mut open: Vec<(Rational, Vec<(Expr, Rational)>)> =
        vec![(Rational::one(), vec![(expr, Rational::one())])];
    let mut parts = Vec::new();
    'terms: while let Some((mut number, mut factors)) = open.pop() {
        if open.len() + parts.len() > MOST_PARTS {
            return None;
        }
        let mut part =
            Part { number: Rational::one(), power: 0, fixed: Vec::new(), changing: Graph::ONE };
        let mut closed = Vec::new();
        while let Some((base, exponent)) = factors.pop() {
            let whole = exponent.is_integer().then(|| exponent.to_integer().to_i64()).flatten();
            match (graph.node(base).clone(), whole) {
                (Node::Number(value), Some(_)) if value.is_zero() => continue 'terms,
                (Node::Number(value), Some(n)) => {
                    number *= num_traits::Pow::pow(&value, i32::try_from(n).ok()?);
                }
                (Node::Whole(inner), _) => factors.push((inner, exponent)),
                (Node::Product(inner), Some(_)) => {
                    factors.extend(inner.iter().map(|(b, e)| (*b, e * &exponent)));
                }
                (Node::Sum { constant, terms }, Some(n))
                    if constant.is_zero() && terms.len() == 1 =>
                {
                    number *= num_traits::Pow::pow(&terms[0].1, i32::try_from(n).ok()?);
                    factors.push((terms[0].0, exponent));
                }
                (Node::Sum { constant, terms }, Some(n))
                    if (1..=LARGEST_POWER).contains(&n) && graph.depends_on(base, &own) =>
                {
                    let mut others = factors;
                    others.append(&mut closed);
                    if n > 1 {
                        others.push((base, exponent - Rational::one()));
                    }
                    if !constant.is_zero() {
                        open.push((&number * &constant, others.clone()));
                    }
                    for (term, coefficient) in terms {
                        let mut factors = others.clone();
                        factors.push((term, Rational::one()));
                        open.push((&number * coefficient, factors));
                    }
                    continue 'terms;
                }
                _ => closed.push((base, exponent)),
            }
        }
        let mut changing = Vec::new();
        for (base, exponent) in closed {
            let whole = exponent.is_integer().then(|| exponent.to_integer().to_i64()).flatten();
            if base == along.coordinate {
                part.power += whole?;
            } else if graph.depends_on(base, &own) {
                return None;
            } else if graph.depends_on(base, along.variables) {
                changing.push((base, exponent));
            } else if let Some(power) = whole {
                part.fixed.push((base, power));
            } else {
                part.fixed.push((graph.product([(base, exponent)]), 1));
            }
        }
        part.number = number;
        part.changing = graph.product(changing);
        parts.push(part);
    }
    Some(parts)
}

/// The variables of polynomials.
pub(super) struct Space {
    pub(super) atoms: Vec<Expr>,
}

impl Space {
    fn place(&self, atom: Expr) -> Option<usize> {
        self.atoms.binary_search(&atom).ok()
    }

    pub(super) fn constant(&self, value: Rational) -> Polynomial {
        Polynomial::constant(value, self.atoms.len())
    }

    pub(super) fn power(&self, variable: usize, power: u32) -> Polynomial {
        self.constant(Rational::one()).shifted(variable, power)
    }

    /// A polynomial in `atoms` as one in those of this space.
    fn moved(&self, polynomial: &Polynomial, atoms: &[Expr]) -> Option<Polynomial> {
        let places: Vec<usize> = atoms.iter().map(|a| self.place(*a)).collect::<Option<_>>()?;
        Some(Polynomial::of(polynomial.terms().map(|(exponents, coefficient)| {
            let mut moved = vec![0; self.atoms.len()];
            for (place, exponent) in places.iter().zip(exponents) {
                moved[*place] += exponent;
            }
            (moved, coefficient.clone())
        })))
    }

    /// Numerator and denominator of a part times the value of its unknown, but for the power `least` of the coordinate.
    fn fraction(
        &self,
        part: &Part,
        least: i64,
        coordinate: usize,
        value: Option<(&Fraction, &Solution)>,
    ) -> Option<(Polynomial, Polynomial)> {
        let mut above = self.constant(part.number.clone());
        let mut below = self.constant(Rational::one());
        if let Some((value, solution)) = value {
            above = above.times(&self.moved(&value.numerator, &solution.atoms)?)?;
            below = below.times(&self.moved(&value.denominator, &solution.atoms)?)?;
        }
        above = above.shifted(coordinate, u32::try_from(part.power - least).ok()?);
        for (atom, power) in &part.fixed {
            let factor = self.power(self.place(*atom)?, u32::try_from(power.abs()).ok()?);
            let side = if power.is_negative() { &mut below } else { &mut above };
            *side = side.times(&factor)?;
        }
        Some((above, below))
    }

    /// A place as a polynomial in symbols.
    fn polynomial(&self, graph: &Graph, place: Expr) -> Option<Polynomial> {
        match graph.node(place) {
            Node::Symbol(_) => Some(self.power(self.place(place)?, 1)),
            Node::Number(value) => Some(self.constant(value.clone())),
            Node::Sum { constant, terms } => {
                let mut sum = self.constant(constant.clone());
                for (term, coefficient) in terms {
                    let term = self.polynomial(graph, *term)?;
                    sum = sum.plus(&term.times(&self.constant(coefficient.clone()))?);
                }
                Some(sum)
            }
            Node::Product(factors) => {
                let mut product = self.constant(Rational::one());
                for (base, exponent) in factors {
                    let whole = exponent.is_integer().then(|| exponent.to_integer().to_i64());
                    let power = whole.flatten().filter(|n| (1..=LARGEST_POWER).contains(n))?;
                    let base = self.polynomial(graph, *base)?;
                    for _ in 0..power {
                        product = product.times(&base)?;
                    }
                }
                Some(product)
            }
            Node::Whole(inner) => self.polynomial(graph, *inner),
            Node::Pi | Node::Call(..) => None,
        }
    }
}

/// Polynomials become expressions.
pub(super) struct Form<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) space: Space,
    pub(super) coordinate: usize,
    /// The places where conditions hold, as far as they are polynomials in symbols.
    pub(super) places: Vec<Polynomial>,
}

/// By which place symbols are diminished that are places too: these are given by their indices among the atoms.
pub(super) struct Shifts {
    base: Polynomial,
    others: Vec<usize>,
}

impl Form<'_> {
    /// The coordinate less each place, and itself.
    pub(super) fn roots(&self) -> Vec<Polynomial> {
        let coordinate = self.space.power(self.coordinate, 1);
        let roots = self.places.iter().map(|place| coordinate.minus(place));
        roots.chain([coordinate.clone()]).collect()
    }

    /// The differences of the places, each once, whatever its size and sign.
    fn differences(&self) -> Vec<Polynomial> {
        let mut differences = Vec::new();
        for (n, first) in self.places.iter().enumerate() {
            for second in &self.places[n + 1..] {
                let difference = second.minus(first).monic();
                if difference.terms().count() > 1 && !differences.contains(&difference) {
                    differences.push(difference);
                }
            }
        }
        differences
    }

    /// One of the places, a number where there is one, and the symbols that are places too; `None` where all conditions hold at
    /// one place.
    fn shifts(&self) -> Option<Shifts> {
        if self.places.len() < 2 {
            return None;
        }
        let is_number = |place: &&Polynomial| place.is_constant();
        let symbol = |place: &Polynomial| {
            (0..self.space.atoms.len()).find(|&atom| *place == self.space.power(atom, 1))
        };
        let mut others: Vec<usize> = self.places.iter().filter_map(symbol).collect();
        let base = match self.places.iter().find(is_number) {
            Some(number) => number.clone(),
            None if others.is_empty() => return None,
            None => self.space.power(others.remove(0), 1),
        };
        Some(Shifts { base, others })
    }

    /// The polynomial: `factors` as often as they divide it, and the rest in Newton's form.
    pub(super) fn expression(
        &mut self,
        mut polynomial: Polynomial,
        factors: &[Polynomial],
        shifts: &Shifts,
    ) -> Option<Expr> {
        let mut product = Vec::new();
        if polynomial.is_zero() {
            return Some(Graph::ZERO);
        }
        for factor in factors {
            let power;
            (polynomial, power) = polynomial.divided_out(factor);
            if power > 0 {
                product
                    .push((self.in_differences(factor, shifts)?, Rational::from(i64::from(power))));
            }
        }
        let mut nested = Vec::new();
        for node in (0..self.places.len()).cycle() {
            let (quotient, rest) =
                polynomial.divided_by_distance(self.coordinate, &self.places[node])?;
            nested.push((node, self.in_differences(&rest, shifts)?));
            if quotient.is_zero() {
                break;
            }
            polynomial = quotient;
        }
        let roots = self.roots();
        let mut total = Graph::ZERO;
        for (node, coefficient) in nested.into_iter().rev() {
            let distance = self.in_differences(&roots[node], shifts)?;
            let step = self.graph.mul(distance, total);
            total = self.graph.add(coefficient, step);
        }
        product.push((total, Rational::one()));
        Some(self.graph.product(product))
    }

    /// The polynomial in the differences to the base, in one piece. Distances between the coordinate and the places have the
    /// coordinate's own rounding in common then, which is an error of the coordinate and no more.
    pub(super) fn in_differences(
        &mut self,
        polynomial: &Polynomial,
        shifts: &Shifts,
    ) -> Option<Expr> {
        let mut meanings = self.space.atoms.clone();
        let coordinate = self.space.power(self.coordinate, 1);
        let sum = if *polynomial == coordinate {
            meanings[self.coordinate]
        } else {
            let base = self.sum(&shifts.base, &meanings);
            let mut shifted = polynomial.clone();
            for atom in shifts.others.iter().copied().chain([self.coordinate]) {
                shifted = shifted.with_sum(atom, &shifts.base)?;
                let difference = self.graph.sub(meanings[atom], base);
                meanings[atom] = self.graph.whole(difference);
            }
            self.sum(&shifted, &meanings)
        };
        Some(self.graph.whole(sum))
    }

    /// The polynomial of what its variables mean.
    fn sum(&mut self, polynomial: &Polynomial, meanings: &[Expr]) -> Expr {
        super::sum_of_terms(self.graph, polynomial, meanings)
    }
}
