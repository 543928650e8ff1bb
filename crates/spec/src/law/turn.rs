//! Motions that turn the body as they deform it.
//!
//! Next to a turn the strain is small, and of all that `H` has, little remains in `F F^T - I` and in `J - 1`. Where the turn drops out of
//! these in symbols, they keep their digits: at once, or with `H = S + N`, where `S` is the gradient of the displacement with the angles of
//! the motion held, and `I + S` a rotation. Then `F F^T - I = N + N^T + S N^T + N S^T + N N^T`.

use super::Deformation;
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector, determinant, principal_minors, transpose};
use mmsmith_expr::{Expr, Function, Graph, Node};
use std::collections::{BTreeMap, BTreeSet};

/// A displacement gradient `S + N` in which `I + S` is a rotation.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    S: Matrix,
    N: Matrix,
}

impl Turn {
    /// The turn within the gradient of the displacement `u`, if there is one: `S` is the gradient with the angles held, `N` what their own
    /// gradients add.
    pub(crate) fn of(derivation: &mut Derivation, u: &Vector) -> Option<Self> {
        let n = u.len();
        let graph = &mut derivation.graph;
        let angles = angles(graph, u, &derivation.geometry.coordinates);
        if angles.is_empty() {
            return None;
        }
        let (mut held, mut free) = (BTreeMap::new(), BTreeMap::new());
        for (k, &angle) in angles.iter().enumerate() {
            // No specification can have names like these.
            let symbol = graph.symbol(&format!("angle {k}"));
            for function in [Function::Sin, Function::Cos] {
                let (of_angle, of_symbol) =
                    (graph.call(function, &[angle]), graph.call(function, &[symbol]));
                held.insert(of_angle, of_symbol);
                free.insert(of_symbol, of_angle);
            }
        }
        let u: Vector = u.iter().map(|&u| graph.replace(u, &held)).collect();
        let mut S = derivation.gradient(&u);
        for entry in S.iter_mut().flatten() {
            *entry = derivation.graph.replace(*entry, &free);
        }
        let mut N = S.clone();
        for (i, &u) in u.iter().enumerate() {
            for j in 0..n {
                let mut terms = Vec::new();
                for (k, &angle) in angles.iter().enumerate() {
                    let symbol = derivation.graph.symbol(&format!("angle {k}"));
                    let change = derivation.derivative(u, symbol);
                    let change = derivation.graph.replace(change, &free);
                    let along = derivation.along(angle, j);
                    terms.push(derivation.graph.mul(change, along));
                }
                N[i][j] = derivation.graph.sum_of(terms);
            }
        }
        let graph = &mut derivation.graph;
        let is_zero = |A: &Matrix| A.iter().flatten().all(|&entry| entry == Graph::ZERO);
        if is_zero(&S) || is_zero(&N) {
            return None;
        }
        for i in 0..n {
            for j in 0..n {
                let mut terms = vec![S[i][j], S[j][i]];
                terms.extend((0..n).map(|m| graph.mul(S[i][m], S[j][m])));
                let left = graph.sum_of(terms);
                if !graph.vanishes(left) {
                    return None;
                }
            }
        }
        // A reflection turns nothing.
        let minors = principal_minors(graph, &S);
        let change = graph.sum_of(minors);
        if !graph.vanishes(change) {
            return None;
        }
        for entry in S.iter_mut().chain(&mut N).flatten() {
            *entry = graph.whole(*entry);
        }
        Some(Turn { S, N })
    }

    /// `H`.
    pub(super) fn gradient(&self, graph: &mut Graph) -> Matrix {
        let rows = self.S.iter().zip(&self.N);
        rows.map(|(S, N)| S.iter().zip(N).map(|(&s, &n)| graph.add(s, n)).collect()).collect()
    }

    /// `J - 1`: what the principal minors of `S + N` have beside those of `S`. A determinant is the sum, over the rows that are taken from
    /// `N`, of the determinants with the other rows from `S`.
    pub(super) fn volume_change(&self, graph: &mut Graph) -> Expr {
        let n = self.S.len();
        let mut terms = Vec::new();
        for subset in 1..1_usize << n {
            let indices: Vec<usize> = (0..n).filter(|i| subset >> i & 1 == 1).collect();
            for rows in (1..=subset).filter(|rows| rows & subset == *rows) {
                let of = |&i: &usize| if rows >> i & 1 == 1 { &self.N[i] } else { &self.S[i] };
                let minor =
                    indices.iter().map(|i| indices.iter().map(|&j| of(i)[j]).collect()).collect();
                terms.push(determinant(graph, &minor));
            }
        }
        graph.sum_of(terms)
    }

    /// `F F^T - I`.
    fn strain(&self, graph: &mut Graph) -> Matrix {
        let Turn { S, N } = self;
        let n = S.len();
        let mut strain = S.clone();
        for i in 0..n {
            for j in 0..n {
                let mut terms = vec![N[i][j], N[j][i]];
                for m in 0..n {
                    terms.push(graph.mul(S[i][m], N[j][m]));
                    terms.push(graph.mul(N[i][m], S[j][m]));
                    terms.push(graph.mul(N[i][m], N[j][m]));
                }
                strain[i][j] = graph.sum_of(terms);
            }
        }
        strain
    }

    /// `F^T F - I`.
    fn right_strain(&self, graph: &mut Graph) -> Matrix {
        Turn { S: transpose(&self.S), N: transpose(&self.N) }.strain(graph)
    }
}

/// What `u` has sines and cosines of, where it depends on the place.
fn angles(graph: &Graph, u: &Vector, coordinates: &[Expr]) -> Vec<Expr> {
    let argument = |expr: Expr| match graph.node(expr) {
        Node::Call(Function::Sin | Function::Cos, arguments) => Some(arguments[0]),
        _ => None,
    };
    let found: BTreeSet<Expr> = graph.reachable(u).into_iter().filter_map(argument).collect();
    let depends = |angle: &Expr| {
        let symbols = graph.symbols_in(&[*angle]);
        coordinates.iter().any(|q| symbols.contains(q))
    };
    found.into_iter().filter(depends).collect()
}

/// `H + H^T + H H^T = F F^T - I` where a turn drops out of it in symbols.
pub(super) fn strain_without_turn(graph: &mut Graph, deformation: &Deformation) -> Option<Matrix> {
    if let Some(turn) = &deformation.turn {
        return Some(turn.strain(graph));
    }
    let H = &deformation.H;
    let n = H.len();
    let mut strain = vec![vec![Graph::ZERO; n]; n];
    let mut turns = false;
    for i in 0..n {
        for j in 0..n {
            let mut terms = vec![H[i][j], H[j][i]];
            terms.extend((0..n).map(|m| graph.mul(H[i][m], H[j][m])));
            let left = graph.without_vanishing_part(&terms);
            let sum = graph.sum_of(left.iter().copied());
            strain[i][j] = graph.shortened(sum);
            // A turn takes the parts of first order away with those of second order.
            let first = [H[i][j], H[j][i]];
            let lost = |h: &Expr| *h != Graph::ZERO && !left.contains(h);
            turns |= first.iter().any(lost) || strain[i][j] != sum;
        }
    }
    turns.then_some(strain)
}

/// `H + H^T + H^T H = F^T F - I`, without what a turn leaves behind.
pub(super) fn right_strain(graph: &mut Graph, deformation: &Deformation) -> Matrix {
    if let Some(turn) = &deformation.turn {
        return turn.right_strain(graph);
    }
    let H = &deformation.H;
    let n = H.len();
    let mut G = H.clone();
    for i in 0..n {
        for j in 0..n {
            let mut terms = vec![H[i][j], H[j][i]];
            terms.extend((0..n).map(|m| graph.mul(H[m][i], H[m][j])));
            let terms = graph.without_vanishing_part(&terms);
            let sum = graph.sum_of(terms);
            G[i][j] = graph.shortened(sum);
        }
    }
    G
}
