//! The law of St. Venant and Kirchhoff, `P = F S` with `S = lambda tr(E) I + 2 mu E` and `E = (F^T F - I)/2`.
//!
//! With `G = 2 E = H + H^T + H^T H` it is `P = S + H S`: the part linear in `H` and the remainder
//! `lambda/2 (H : H) I + mu H^T H + H S`, all of them sums in which nothing large cancels.

use super::kinematics::{doubled_strain, with_transpose};
use super::{Deformation, Stress, linear_divergence, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::{Matrix, matrix_product, transpose};
use mmsmith_expr::{Expr, Graph};

pub(super) fn stress(
    derivation: &mut Derivation,
    deformation: &Deformation,
    lambda: Expr,
    mu: Expr,
) -> Stress {
    let linear = linear_divergence(derivation, deformation, lambda, mu);
    let graph = &mut derivation.graph;
    let (lambda, mu) = (graph.whole(lambda), graph.whole(mu));
    let H = &deformation.H;
    let n = H.len();
    let products = matrix_product(graph, &transpose(H), H);
    let G = match &deformation.turn {
        Some(turn) => turn.right_strain(graph),
        None => {
            let doubled_strain = doubled_strain(derivation, deformation);
            let graph = &mut derivation.graph;
            let mut G = products.clone();
            for i in 0..n {
                for j in 0..n {
                    let linear = with_transpose(graph, deformation, &doubled_strain, [i, j]);
                    G[i][j] = graph.add(linear, products[i][j]);
                }
            }
            G
        }
    };
    let graph = &mut derivation.graph;
    let diagonal = |A: &Matrix| -> Vec<Expr> { (0..n).map(|k| A[k][k]).collect() };
    // tr G = 2 tr H + H : H.
    let mut of_trace = diagonal(if deformation.turn.is_some() { &G } else { &products });
    if deformation.turn.is_none() {
        of_trace.extend(deformation.dilation.iter().flat_map(|&term| [term; 2]));
    }
    let pressure = half_sum_times(graph, of_trace, lambda);
    let mut second = isotropic(graph, &G, pressure, mu);
    for entry in second.iter_mut().flatten() {
        *entry = graph.whole(*entry);
    }
    let turned = matrix_product(graph, H, &second);
    let (mut P, mut anisotropic) = (second.clone(), second);
    let of_products = half_sum_times(graph, diagonal(&products), lambda);
    let mut remainder = isotropic(graph, &products, of_products, mu);
    for i in 0..n {
        for j in 0..n {
            P[i][j] = graph.add(P[i][j], turned[i][j]);
            P[i][j] = zero_if_vanishing(graph, P[i][j]);
            anisotropic[i][j] = match i == j && pressure != Graph::ZERO {
                true => {
                    let shear = graph.mul(mu, G[i][j]);
                    let entry = graph.add(shear, turned[i][j]);
                    zero_if_vanishing(graph, entry)
                }
                false => P[i][j],
            };
            remainder[i][j] = graph.add(remainder[i][j], turned[i][j]);
        }
    }
    let remainder = derivation.divergence(&remainder);
    Stress { P, isotropic: pressure, anisotropic, linear, remainder, whole: None, energy: None }
}

/// The sum of `terms`, times `lambda/2`.
fn half_sum_times(graph: &mut Graph, terms: Vec<Expr>, lambda: Expr) -> Expr {
    let trace = graph.sum_of(terms);
    let two = graph.integer(2);
    let half = graph.div(trace, two);
    graph.mul(lambda, half)
}

/// `pressure I + mu G`.
fn isotropic(graph: &mut Graph, G: &Matrix, pressure: Expr, mu: Expr) -> Matrix {
    let mut stress = G.clone();
    for (i, row) in stress.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = graph.mul(mu, *entry);
            if i == j {
                *entry = graph.add(*entry, pressure);
            }
        }
    }
    stress
}
