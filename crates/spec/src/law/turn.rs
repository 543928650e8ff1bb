//! Motions that turn the body as they deform it.
//!
//! Next to a turn the strain is small, and of all that `H` has, little remains in `F F^T - I` and in `J - 1`. Where the turn drops out of
//! these in symbols, they keep their digits: at once, or with `H = S + N`, where `S` is the gradient of the displacement with the angles of
//! the motion held, and `I + S` a rotation. Then `F F^T - I = N + N^T + S N^T + N S^T + N N^T`.

use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector, determinant, index_sets, principal_minors, transpose};
use mmsmith_expr::{Expr, Function, Graph, Node, Rational, Rule};
use std::collections::{BTreeMap, BTreeSet};

/// A turn has few angles. Sums of many waves have none that turns the body, and each angle is work.
const MOST_ANGLES: usize = 32;

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
        if Rule::Turn.is_off() {
            return None;
        }
        let n = u.len();
        let graph = &mut derivation.graph;
        let angles = angles(graph, u, &derivation.geometry.coordinates);
        if angles.is_empty() || angles.len() > MOST_ANGLES {
            return None;
        }
        let (mut held, mut free) = (BTreeMap::new(), BTreeMap::new());
        // No specification can have names like these.
        let symbols: Vec<Expr> =
            (0..angles.len()).map(|k| graph.symbol(&format!("angle {k}"))).collect();
        for (&angle, &symbol) in angles.iter().zip(&symbols) {
            for function in [Function::Sin, Function::Cos] {
                let (of_angle, of_symbol) =
                    (graph.call(function, &[angle]), graph.call(function, &[symbol]));
                held.insert(of_angle, of_symbol);
                free.insert(of_symbol, of_angle);
            }
        }
        let u: Vector = u.iter().map(|&u| graph.replace(u, &held)).collect();
        let gradient = derivation.gradient(&u);
        let (mut S, mut N) = (gradient.clone(), gradient.clone());
        for i in 0..n {
            for j in 0..n {
                let (turn, rest) = split(&mut derivation.graph, gradient[i][j], &symbols);
                let mut terms = vec![derivation.graph.replace(rest, &free)];
                for (&angle, &symbol) in angles.iter().zip(&symbols) {
                    let change = derivation.derivative(u[i], symbol);
                    let change = derivation.graph.replace(change, &free);
                    let along = derivation.along(angle, j);
                    terms.push(derivation.graph.mul(change, along));
                }
                S[i][j] = derivation.graph.replace(turn, &free);
                N[i][j] = derivation.graph.sum_of(terms);
            }
        }
        if S.iter().flatten().all(|&entry| entry == Graph::ZERO) {
            return None;
        }
        let graph = &mut derivation.graph;
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
        let mut terms = Vec::new();
        for indices in index_sets(self.S.len()) {
            for taken in index_sets(indices.len()) {
                let row = |k: usize| {
                    let A = if taken.contains(&k) { &self.N } else { &self.S };
                    indices.iter().map(|&j| A[indices[k]][j]).collect()
                };
                let minor = (0..indices.len()).map(row).collect();
                terms.push(determinant(graph, &minor));
            }
        }
        graph.sum_of(terms)
    }

    /// `F F^T - I`.
    pub(super) fn strain(&self, graph: &mut Graph) -> Matrix {
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
    pub(super) fn right_strain(&self, graph: &mut Graph) -> Matrix {
        Turn { S: transpose(&self.S), N: transpose(&self.N) }.strain(graph)
    }
}

/// Angles in sines and cosines of `u` that depend on the place.
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

/// The terms in which nothing occurs but the angles, and the others.
fn split(graph: &mut Graph, entry: Expr, angles: &[Expr]) -> (Expr, Expr) {
    let is_of_angles =
        |term: Expr| graph.symbols_in(&[term]).iter().all(|symbol| angles.contains(symbol));
    let own: Vec<(Rational, Expr)> = match graph.node(entry) {
        Node::Sum { constant, terms } => {
            let own = terms.iter().filter(|(term, _)| is_of_angles(*term));
            let own = own.map(|(term, coefficient)| (coefficient.clone(), *term));
            own.chain([(constant.clone(), Graph::ONE)]).collect()
        }
        _ if is_of_angles(entry) => return (entry, Graph::ZERO),
        _ => return (Graph::ZERO, entry),
    };
    let own = graph.sum(own);
    (own, graph.sub(entry, own))
}
