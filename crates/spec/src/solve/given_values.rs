//! Displacements whose values at some places are given by the conditions.
//!
//! The equations for the coefficients are almost singular for some parameters, and all coefficients are large then. Where a condition gives
//! the displacement, `u_R(Ro) = T`, it is what it is nevertheless. So the interpolation of the values that are given is set apart, in
//! which the denominator does not occur.

use super::factored::{Common, Form, Shifts};
use super::polynomial::{Fraction, Polynomial};
use mmsmith_expr::{Expr, Rational, Rule};
use num_traits::One;

/// Values that the conditions give, and `rest R^power` over the denominator, which is left of them.
struct Given {
    nodes: Vec<Coefficient>,
    rest: Polynomial,
    denominator: Polynomial,
    power: i64,
}

/// A coefficient of an interpolation in Newton's form.
struct Coefficient {
    /// The index of the place.
    place: usize,
    value: Fraction,
}

impl Form<'_> {
    /// `numerator R^least` over the denominator, where the conditions give its values `c_0`, `c_1`, ... at places `p`, `q`, ..., perhaps
    /// with a slope: free of the denominator, which may almost vanish. With their interpolation `I` it is
    /// `(R/p)^n [I + (R - p) (R - q) ... Q]`. Negative powers stay with `Q`, which would else be large next to a small inner radius.
    /// `None` where no value is given.
    pub(super) fn through_given_values(
        &mut self,
        numerator: &Polynomial,
        least: i64,
        common: &Common<'_>,
        shifts: &Shifts,
    ) -> Option<Expr> {
        if Rule::GivenValues.is_off() {
            return None;
        }
        let given = self.given_values(numerator, least, common)?;
        let base = self.places[given.nodes.first()?.place].clone();
        let base = self.in_differences(&base, shifts)?;
        let radius = self.space.atoms[self.coordinate];
        let ratio = self.graph.div(radius, base);
        let factor = self.graph.powi(ratio, given.power.max(0));
        let total = self.beside_the_first(&given, common, shifts)?;
        Some(self.graph.mul(factor, total))
    }

    fn given_values(
        &self,
        numerator: &Polynomial,
        least: i64,
        common: &Common<'_>,
    ) -> Option<Given> {
        let size = |polynomial: &Polynomial| polynomial.terms().count();
        let coordinate = self.space.power(self.coordinate, 1);
        let (mut rest, of_numerator) = numerator.clone().divided_out(&coordinate);
        let power = least + i64::from(of_numerator);
        let mut denominator = common.denominator.clone();
        let mut nodes: Vec<Coefficient> = Vec::new();
        while !rest.is_zero() && nodes.len() <= self.places.len() {
            let mut best: Option<Coefficient> = None;
            for (place, at) in self.places.iter().enumerate() {
                let (_, value) = rest.divided_by_distance(self.coordinate, at)?;
                let base = match nodes.first() {
                    Some(first) if power > 0 => &self.places[first.place],
                    _ => at,
                };
                let above = value.times(&self.to_the(base, power)?)?;
                let below = denominator.times(&self.to_the(base, -power)?)?;
                let value = Fraction::reduced(above, below)?.with_monic_denominator();
                let is_better = best
                    .as_ref()
                    .is_none_or(|known| size(&value.denominator) < size(&known.value.denominator));
                if size(&value.denominator) < size(common.denominator) && is_better {
                    best = Some(Coefficient { place, value });
                }
            }
            let Some(node) = best else { break };
            if power < 0 {
                let own = node.value.numerator.times(&self.to_the(&coordinate, -power)?)?;
                rest = rest.times(&node.value.denominator)?.minus(&own.times(&denominator)?);
                denominator = denominator.times(&node.value.denominator)?;
                let whole = Fraction { numerator: rest, denominator }.with_monic_denominator();
                (rest, denominator) = (whole.numerator, whole.denominator);
            }
            (rest, _) = rest.divided_by_distance(self.coordinate, &self.places[node.place])?;
            nodes.push(node);
        }
        Some(Given { nodes, rest, denominator, power })
    }

    /// A power; one for negative exponents.
    fn to_the(&self, base: &Polynomial, exponent: i64) -> Option<Polynomial> {
        let one = self.space.constant(Rational::one());
        (0..exponent).try_fold(one, |product, _| product.times(base))
    }

    /// `c_0 + (R - p) (c_1 + (R - q) (... + Q))`.
    fn beside_the_first(
        &mut self,
        given: &Given,
        common: &Common<'_>,
        shifts: &Shifts,
    ) -> Option<Expr> {
        let first = self.places[given.nodes.first()?.place].clone();
        let scaled = given.rest.times(&self.to_the(&first, given.power)?)?;
        let mut total = self.quotient(&scaled, &given.denominator, common, shifts)?;
        let power = self.graph.powi(self.space.atoms[self.coordinate], given.power.min(0));
        total = self.graph.mul(total, power);
        self.newton(&given.nodes, total, shifts)
    }

    /// `c_0 + (R - p) (c_1 + (R - q) (... + innermost))`.
    fn newton(&mut self, nodes: &[Coefficient], innermost: Expr, shifts: &Shifts) -> Option<Expr> {
        let roots = self.roots();
        let mut total = innermost;
        for Coefficient { place, value } in nodes.iter().rev() {
            let above = self.in_differences(&value.numerator, shifts)?;
            let below = self.in_differences(&value.denominator, shifts)?;
            let distance = self.in_differences(&roots[*place], shifts)?;
            let value = self.graph.div(above, below);
            let step = self.graph.mul(distance, total);
            total = self.graph.add(value, step);
        }
        Some(total)
    }

    fn quotient(
        &mut self,
        above: &Polynomial,
        below: &Polynomial,
        common: &Common<'_>,
        shifts: &Shifts,
    ) -> Option<Expr> {
        let above = self.expression(above.clone(), common.factors, shifts)?;
        let below = match below == common.denominator {
            true => common.below,
            false => self.expression(below.clone(), common.factors, shifts)?,
        };
        Some(self.graph.div(above, below))
    }
}
