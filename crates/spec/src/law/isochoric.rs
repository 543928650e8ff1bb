//! Laws of an isochoric part `W(x)` in `x = J^(-2/3) I1 - 3` and of a volumetric part `U(J)`.
//!
//! The chain rule is applied to the two invariants and not to the components of `F`. With
//! `K = F - I1/3 F^-T`, `g = grad ln J`, `k = K : grad F` and `s = J^(-2/3)` it gives
//!
//! - `P = 2 s W' K + J U' F^-T`,
//! - `Div P = 2 s W' [Div F + I1/9 F^-T g - 2/3 (K g + F^-T k)] + 4 s^2 W'' K k + J^2 U'' F^-T g`.
//!
//! The divergence of `J F^-T` is zero (Piola's identity), and no term of it is left to rounding. In components these terms are some
//! hundred, and a small sum of them kept a hundredth of its digits' worth of roundings.
//!
//! - At rest `K`, `g` and `k` are zero. What is left is formed from `H`: `K = H + H^T F^-T - tr(C - I)/3 F^-T`.
//! - All that multiplies `F^-T` in `P` is `J U' - 2/3 s W' tr(C - I)`, of which the two parts cancel to first order where `lambda` is
//!   zero. With a measure `m` of the change of volume, `J - 1` or `ln J`, and `mu = 2 W'(0)` it is
//!   `lambda m + (J U' - kappa m) + 2/3 mu (m - tr(C - I)/2) - 2/3 (s W' - W'(0)) tr(C - I)`, in which all but the first are of
//!   second order.
//! - Cube roots replace the power: with `c = J^(1/3)` it is `s - 1 = -(J - 1) (c + 1)/(c^2 (c^2 + c + 1))`, which keeps its digits for
//!   every `J`. An exponential of `-2/3 ln J` loses them where a stretch almost vanishes.

use super::energy::{EXCESS, own_symbol};
use super::kinematics::{
    DilationGradient, Kinematics, row_times, volume_symbols, volume_values, work_along,
};
use super::{Deformation, Divergence, OfGradient, Stress, modulus_at_rest, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector};
use mmsmith_expr::{Derivatives, Expr, Graph, Rational};
use std::collections::{BTreeMap, BTreeSet};

/// A volumetric part, `kappa U(J)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Volume {
    pub(super) kappa: Expr,
    /// `U`, in `J`.
    pub(super) energy: Expr,
    /// A measure `m` of the change of volume, `J - 1` to first order, and `J U' - m`, in `J`.
    pub(super) measure: Expr,
    pub(super) beside: Expr,
}

/// The stress of `isochoric`, an energy in `excess`, and of `volume`.
pub(super) fn stress(
    derivation: &mut Derivation,
    deformation: &Deformation,
    isochoric: Expr,
    volume: Volume,
) -> Stress {
    let kinematics = Kinematics::new(derivation, deformation);
    let law = Invariants::new(&mut derivation.graph, deformation, kinematics, isochoric, volume);
    let Divergence { linear, remainder, whole } = law.divergence(derivation, deformation);
    let graph = &mut derivation.graph;
    let scale = graph.product_of([law.doubled, law.power, law.slope]);
    let scale = graph.whole(scale);
    let pressure = zero_if_vanishing(graph, law.pressure);
    let normal = law.normal(graph);
    let n = deformation.H.len();
    let mut P = vec![vec![Graph::ZERO; n]; n];
    let mut anisotropic = P.clone();
    for i in 0..n {
        for j in 0..n {
            let f = deformation.inverse_transpose[i][j];
            let shear = law.kinematics.difference[i][j];
            let terms = [graph.mul(scale, shear), graph.mul(normal, f)];
            let entry = graph.sum_of(terms);
            P[i][j] = zero_if_vanishing(graph, entry);
            let shear = graph.mul(scale, law.K[i][j]);
            let turned = graph.mul(pressure, law.kinematics.M[i][j]);
            let entry = graph.sub(shear, turned);
            anisotropic[i][j] = zero_if_vanishing(graph, entry);
        }
    }
    let energy = Some(law.energy);
    let whole = Some(whole);
    Stress { P, isotropic: pressure, anisotropic, linear, remainder, whole, energy }
}

/// The invariants of a deformation, and the derivatives of both energies there.
struct Invariants {
    /// The number 2.
    doubled: Expr,
    /// `J^(-2/3)`, and what it is more than one.
    power: Expr,
    power_change: Expr,
    kinematics: Kinematics,
    /// `F - I1/3 F^-T`.
    K: Matrix,
    /// `W'` with its value at rest and the rest, and `W''`.
    slope: Expr,
    slope_at_rest: Expr,
    slope_change: Expr,
    curvature: Expr,
    /// `J U'`.
    pressure: Expr,
    /// The measure `m` of the change of volume, `J U' - kappa m`, and `m - tr(C - I)/2`, both of second order.
    measure: Expr,
    pressure_beside: Expr,
    measure_beyond_trace: Expr,
    /// `J^2 U''` as its value at rest and the rest.
    stiffness_at_rest: Expr,
    stiffness_change: Expr,
    energy: Expr,
}

impl Invariants {
    fn new(
        graph: &mut Graph,
        deformation: &Deformation,
        kinematics: Kinematics,
        isochoric: Expr,
        volume: Volume,
    ) -> Self {
        let (one, two, three) = (Graph::ONE, graph.integer(2), graph.integer(3));
        let root = graph.product([(deformation.J, Rational::new(1.into(), 3.into()))]);
        let root = graph.whole(root);
        let square = graph.powi(root, 2);
        let power = graph.powi(root, -2);
        let above = graph.add(one, root);
        let below = graph.sum_of([one, root, square]);
        let below = graph.mul(below, square);
        let change = graph.mul(deformation.volume_change, above);
        let change = graph.div(change, below);
        let power_change = graph.neg(change);
        let power_change = graph.whole(power_change);

        let third = graph.div(kinematics.trace, three);
        let mut K = kinematics.difference.clone();
        for (entries, f) in K.iter_mut().zip(&deformation.inverse_transpose) {
            for (entry, f) in entries.iter_mut().zip(f) {
                let mean = graph.mul(third, *f);
                *entry = graph.sub(*entry, mean);
                *entry = zero_if_vanishing(graph, *entry);
                *entry = graph.whole(*entry);
            }
        }

        let excess = own_symbol(graph, EXCESS);
        let part = graph.mul(power, kinematics.trace);
        let value = graph.mul(three, power_change);
        let value = graph.add(part, value);
        let value = zero_if_vanishing(graph, value);
        let actual = BTreeMap::from([(excess, graph.whole(value))]);
        let small = BTreeSet::from([excess]);
        let mut derivatives = Derivatives::limited();
        let of_excess = derivatives.of(graph, isochoric, excess);
        let of_slope = derivatives.of(graph, of_excess, excess);
        let (slope_at_rest, slope_change) = graph.split_at_zero(of_excess, &small);
        let slope = graph.add(slope_at_rest, slope_change);
        let (_, isochoric) = graph.split_at_zero(isochoric, &small);

        // In v = J - 1, of which the pressure is small.
        let J = graph.symbol("J");
        let [v, sum] = volume_symbols(graph);
        let energy = graph.mul(volume.kappa, volume.energy);
        let in_v = BTreeMap::from([(J, sum)]);
        let [volumetric, measure, beside] =
            [energy, volume.measure, volume.beside].map(|of_J| graph.replace(of_J, &in_v));
        let small = BTreeSet::from([v]);
        let of_volume = derivatives.of(graph, volumetric, v);
        let of_slope_of_volume = derivatives.of(graph, of_volume, v);
        let pressure = graph.mul(sum, of_volume);
        let beside = graph.mul(volume.kappa, beside);
        let (_, pressure) = graph.split_at_zero(pressure, &small);
        let stiffness = graph.product_of([sum, sum, of_slope_of_volume]);
        let (stiffness_at_rest, stiffness_change) = graph.split_at_zero(stiffness, &small);
        let (_, volumetric) = graph.split_at_zero(volumetric, &small);
        let of_volume = volume_values(graph, deformation);
        let at = |graph: &mut Graph, expr, values: &BTreeMap<Expr, Expr>| {
            let value = graph.replace(expr, values);
            graph.whole(value)
        };
        let measure_beyond_trace = match measure == v {
            true => kinematics.volume_beyond_trace(graph, deformation),
            false => kinematics.log_beyond_trace(graph, deformation),
        };
        let energies = [at(graph, isochoric, &actual), at(graph, volumetric, &of_volume)];
        Invariants {
            doubled: two,
            power,
            power_change,
            kinematics,
            K,
            slope: at(graph, slope, &actual),
            slope_at_rest,
            slope_change: at(graph, slope_change, &actual),
            curvature: at(graph, of_slope, &actual),
            pressure: at(graph, pressure, &of_volume),
            measure: at(graph, measure, &of_volume),
            pressure_beside: at(graph, beside, &of_volume),
            measure_beyond_trace,
            stiffness_at_rest,
            stiffness_change: at(graph, stiffness_change, &of_volume),
            energy: graph.sum_of(energies),
        }
    }

    /// `s W' - W'(0)`.
    fn scaled_slope_change(&self, graph: &mut Graph) -> Expr {
        let of_power = graph.mul(self.power_change, self.slope);
        let change = graph.add(of_power, self.slope_change);
        graph.whole(change)
    }

    /// All that multiplies `F^-T` in `P`.
    fn normal(&self, graph: &mut Graph) -> Expr {
        let mu = graph.mul(self.doubled, self.slope_at_rest);
        let third = |n: i64| Rational::new(n.into(), 3.into());
        let lambda = graph.sum([(1.into(), self.stiffness_at_rest), (third(-2), mu)]);
        let lambda = modulus_at_rest(graph, lambda);
        let lambda = graph.whole(lambda);
        let slope_change = self.scaled_slope_change(graph);
        let normal = [
            (1.into(), graph.mul(lambda, self.measure)),
            (1.into(), self.pressure_beside),
            (third(2), graph.mul(mu, self.measure_beyond_trace)),
            (third(-2), graph.mul(slope_change, self.kinematics.trace)),
        ];
        let normal = graph.sum(normal);
        let normal = zero_if_vanishing(graph, normal);
        graph.whole(normal)
    }

    fn divergence(&self, derivation: &mut Derivation, deformation: &Deformation) -> Divergence {
        let H = &deformation.H;
        let n = H.len();
        let graph = &mut derivation.graph;
        let mu = graph.mul(self.doubled, self.slope_at_rest);
        let three = graph.integer(3);
        let shear = graph.div(mu, three);
        // With J = 1 everywhere, what belongs to the change of volume adds up to zero.
        let modulus = match deformation.is_isochoric() {
            true => Graph::ZERO,
            false => graph.add(shear, self.stiffness_at_rest),
        };
        let (open_mu, open_modulus) = (modulus_at_rest(graph, mu), modulus_at_rest(graph, modulus));

        // Of the factor of F^-T g what it is more than at rest.
        let slope_change = self.scaled_slope_change(graph);
        let scaled = graph.mul(self.power, self.slope);
        let scaled = graph.whole(scaled);
        let of_trace = graph.mul(scaled, self.kinematics.trace);
        let of_slope = graph.mul(three, slope_change);
        let sum = graph.add(of_trace, of_slope);
        let ninths = graph.sum([(Rational::new(2.into(), 9.into()), sum)]);
        let modulus_change = graph.add(ninths, self.stiffness_change);
        let modulus_change = graph.whole(modulus_change);
        let ninths = graph.sum([
            (Rational::new(2.into(), 9.into()), of_trace),
            (Rational::new(2.into(), 3.into()), scaled),
        ]);
        let whole_modulus = graph.sum_of([ninths, self.stiffness_at_rest, self.stiffness_change]);
        let whole_modulus = graph.whole(whole_modulus);
        let second = graph.product_of([self.curvature, self.power, self.power]);
        let second = graph.whole(second);

        let of_K: Vector = (0..n).map(|k| work_along(derivation, &self.K, H, k)).collect();
        let DilationGradient { of_M, g } =
            self.kinematics.dilation_gradient(derivation, deformation);
        let OfGradient { open, of_H } = deformation.divergence_of_gradient(derivation);
        let (mut linear, mut remainder, mut whole) = (Vector::new(), Vector::new(), Vector::new());
        for i in 0..n {
            let dilation = deformation.trace_along(derivation, i);
            let graph = &mut derivation.graph;
            let first = [graph.mul(open_modulus, dilation), graph.mul(open_mu, open[i])];
            linear.push(graph.sum_of(first));
            let Kg = row_times(graph, &self.K, i, &g);
            let Kk = row_times(graph, &self.K, i, &of_K);
            let Mg = row_times(graph, &self.kinematics.M, i, &g);
            let fk = row_times(graph, &deformation.inverse_transpose, i, &of_K);
            let fg = row_times(graph, &deformation.inverse_transpose, i, &g);
            let of_volume = graph.add(of_M[i], Mg);
            let second = [
                (Rational::new((-4).into(), 3.into()), graph.mul(scaled, Kg)),
                (Rational::new((-4).into(), 3.into()), graph.mul(scaled, fk)),
                (4.into(), graph.mul(second, Kk)),
            ];
            let rest = [
                (2.into(), graph.mul(slope_change, of_H[i])),
                (1.into(), graph.mul(modulus_change, fg)),
                ((-1).into(), graph.mul(modulus, of_volume)),
            ];
            let first =
                [(2.into(), graph.mul(scaled, of_H[i])), (1.into(), graph.mul(whole_modulus, fg))];
            remainder.push(graph.sum(rest.into_iter().chain(second.clone())));
            whole.push(graph.sum(first.into_iter().chain(second)));
        }
        Divergence { linear, remainder, whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_expr::Ast;
    use mmsmith_vocabulary::Volumetric;

    /// `J U'` of each volumetric part.
    #[test]
    fn pressures_are_those_of_the_energies() {
        let mut graph = Graph::new();
        let J = graph.symbol("J");
        for (name, volume) in Volumetric::NAMES {
            let mut built = |text: &str| {
                let ast = Ast::parse(text).unwrap();
                graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap()
            };
            let (U, parts) = (built(volume.formula()), volume.pressure_parts().map(&mut built));
            let slope = Derivatives::limited().of(&mut graph, U, J);
            let pressure = graph.mul(J, slope);
            let expected = graph.sum_of(parts);
            let difference = graph.sub(pressure, expected);
            assert!(graph.vanishes(difference), "{name}");
        }
    }
}
