//! Laws of `J` and `I1` alone; in the plane `I2 = I1 + J^2 - 1` is no other invariant.
//!
//! The chain rule is applied to the two invariants and not to the components of `F`. With `I = I1 - 3`, `S = 2 dW/dI`,
//! `N = J dW/dJ + S`, `D = F - F^-T`, `g = grad ln J` and `d = D : grad F` it gives
//!
//! - `P = S D + N F^-T`,
//! - `Div P = S Div F + D grad S + F^-T (chi g + 2 dN/dI d)`, `chi = J dN/dJ + 2 dN/dI + S - N`,
//! - `grad S = (J dS/dJ + 2 dS/dI) g + 2 dS/dI d`,
//!
//! since the divergence of `J F^-T` is zero (Piola's identity). At rest `S = mu` and `chi = lambda + mu`.

use super::energy::own_symbol;
use super::kinematics::{ChainRule, Kinematics, volume_symbols, volume_values, work_along};
use super::{Deformation, Divergence, Stress, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::Vector;
use mmsmith_expr::{Derivatives, Expr, Graph};
use std::collections::{BTreeMap, BTreeSet};

/// `W` with nothing but `J` and `I1`, where a deformation in `dimension` directions leaves no other invariant.
pub(super) fn in_two_invariants(graph: &mut Graph, W: Expr, dimension: usize) -> Option<Expr> {
    let [J, I1, I2] = ["J", "I1", "I2"].map(|name| graph.symbol(name));
    let square = graph.powi(J, 2);
    let less_one = graph.sub(square, Graph::ONE);
    let second = graph.add(I1, less_one);
    match dimension {
        2 => Some(graph.replace(W, &BTreeMap::from([(I2, second)]))),
        3 => (!graph.symbols_in(&[W]).contains(&I2)).then_some(W),
        _ => None,
    }
}

/// The stress of the energy `W` in `J` and `I1`.
pub(super) fn stress(derivation: &mut Derivation, deformation: &Deformation, W: Expr) -> Stress {
    let kinematics = Kinematics::new(derivation, deformation);
    let graph = &mut derivation.graph;
    let (H, f, D) = (&deformation.H, &deformation.inverse_transpose, &kinematics.difference);
    let law = Law::new(graph, deformation, &kinematics, W);

    let n = H.len();
    let mut P = vec![vec![Graph::ZERO; n]; n];
    let mut anisotropic = P.clone();
    for i in 0..n {
        for j in 0..n {
            let terms = [graph.mul(law.S, D[i][j]), graph.mul(law.N, f[i][j])];
            let entry = graph.sum_of(terms);
            P[i][j] = zero_if_vanishing(graph, entry);
            let shear = graph.mul(law.S, D[i][j]);
            let turned = graph.mul(law.N, kinematics.M[i][j]);
            let entry = graph.sub(shear, turned);
            anisotropic[i][j] = zero_if_vanishing(graph, entry);
        }
    }

    let dilation = kinematics.dilation_gradient(derivation, deformation);
    let d: Vector = (0..n).map(|k| work_along(derivation, D, H, k)).collect();
    let graph = &mut derivation.graph;
    let mut combined = |of_g: Expr, of_d: Expr| -> Vector {
        let terms = dilation.g.iter().zip(&d).map(|(&g, &d)| {
            let terms = [graph.mul(of_g, g), graph.mul(of_d, d)];
            let sum = graph.sum_of(terms);
            let sum = zero_if_vanishing(graph, sum);
            graph.whole(sum)
        });
        terms.collect()
    };
    let of_S = combined(law.S_by_volume, law.S_by_strain);
    let change = combined(law.chi_change, law.N_by_strain);
    let all = combined(law.chi, law.N_by_strain);
    let rule = ChainRule {
        A: D,
        S: law.S,
        S_at_rest: law.S_at_rest,
        S_change: law.S_change,
        of_S,
        modulus: law.chi_at_rest,
        change,
        all,
    };
    let Divergence { linear, remainder, whole } =
        rule.divergence(derivation, deformation, &kinematics, &dilation);
    let (isotropic, energy) = (law.N, Some(law.energy));
    Stress { P, isotropic, anisotropic, linear, remainder, whole: Some(whole), energy }
}

/// The derivatives of an energy at a deformation.
struct Law {
    S: Expr,
    S_at_rest: Expr,
    S_change: Expr,
    /// `J dS/dJ + 2 dS/dI` and `2 dS/dI`.
    S_by_volume: Expr,
    S_by_strain: Expr,
    N: Expr,
    /// `2 dN/dI`.
    N_by_strain: Expr,
    chi: Expr,
    chi_at_rest: Expr,
    chi_change: Expr,
    energy: Expr,
}

impl Law {
    fn new(graph: &mut Graph, deformation: &Deformation, kinematics: &Kinematics, W: Expr) -> Self {
        let J = graph.symbol("J");
        let [v, sum] = volume_symbols(graph);
        let (I1, I) = (graph.symbol("I1"), own_symbol(graph, "I1 - 3"));
        let three = graph.integer(3);
        let first = graph.add(three, I);
        let W = graph.replace(W, &BTreeMap::from([(I1, first)]));
        // J d/dJ is the derivative by ln J, of which J is its own.
        let log_J = graph.symbol("ln J");
        let mut derivatives = Derivatives::limited();
        derivatives.define(J, log_J, J);
        let S = derivatives.of(graph, W, I);
        let S = graph.add(S, S);
        let N = derivatives.of(graph, W, log_J);
        let N = graph.add(N, S);
        let by_strain = |graph: &mut Graph, derivatives: &mut Derivatives, expr| {
            let slope = derivatives.of(graph, expr, I);
            graph.add(slope, slope)
        };
        let S_by_strain = by_strain(graph, &mut derivatives, S);
        let N_by_strain = by_strain(graph, &mut derivatives, N);
        let S_by_log = derivatives.of(graph, S, log_J);
        let S_by_volume = graph.add(S_by_log, S_by_strain);
        let N_by_log = derivatives.of(graph, N, log_J);
        let less_N = graph.neg(N);
        let chi = graph.sum_of([N_by_log, N_by_strain, S, less_N]);

        let small = BTreeSet::from([v, I]);
        let split = |graph: &mut Graph, expr| {
            let expr = graph.replace(expr, &BTreeMap::from([(J, sum)]));
            let (at_rest, change) = graph.split_at_zero(expr, &small);
            (zero_if_vanishing(graph, at_rest), change)
        };
        let mut actual = volume_values(graph, deformation);
        actual.insert(I, kinematics.trace);
        let at = |graph: &mut Graph, expr| {
            let value = graph.replace(expr, &actual);
            let value = zero_if_vanishing(graph, value);
            graph.whole(value)
        };
        let joined = |graph: &mut Graph, expr| {
            let (at_rest, change) = split(graph, expr);
            let sum = graph.add(at_rest, change);
            at(graph, sum)
        };
        let (S_at_rest, S_change) = split(graph, S);
        let (chi_at_rest, chi_change) = split(graph, chi);
        let (_, energy) = split(graph, W);
        Law {
            S: joined(graph, S),
            S_at_rest,
            S_change: at(graph, S_change),
            S_by_volume: joined(graph, S_by_volume),
            S_by_strain: joined(graph, S_by_strain),
            N: joined(graph, N),
            N_by_strain: joined(graph, N_by_strain),
            chi: joined(graph, chi),
            chi_at_rest,
            chi_change: at(graph, chi_change),
            energy: at(graph, energy),
        }
    }
}
