//! Derivatives of fields in the specification's own coordinates, on physical components.

use crate::Spec;
use crate::coordinates::Geometry;
use crate::tensor::{Matrix, Vector};
use mmsmith_expr::{Derivatives, Expr, Graph, Node};
use num_traits::Zero;
use std::collections::BTreeSet;

/// The graph of one derivation, with the coordinates and what they make of derivatives.
pub(crate) struct Derivation {
    pub(crate) graph: Graph,
    pub(crate) geometry: Geometry,
    pub(crate) derivatives: Derivatives,
    /// Position and time.
    pub(crate) variables: BTreeSet<Expr>,
    pub(crate) time: Expr,
}

impl Derivation {
    pub(crate) fn new(spec: &Spec) -> Self {
        Self::in_geometry(spec, |graph| Geometry::new(graph, spec.coordinates, spec.dimension))
    }

    /// With the geometry that `of` makes.
    pub(crate) fn in_geometry(spec: &Spec, of: impl FnOnce(&mut Graph) -> Geometry) -> Self {
        let mut graph = spec.graph.clone();
        let geometry = of(&mut graph);
        let time = graph.symbol("t");
        let variables = geometry.coordinates.iter().copied().chain([time]).collect();
        let derivatives = Derivatives::limited();
        Derivation { graph, geometry, derivatives, variables, time }
    }

    pub(crate) fn derivative(&mut self, expr: Expr, variable: Expr) -> Expr {
        self.derivatives.of(&mut self.graph, expr, variable)
    }

    /// `(1/h_k) d expr / d q_k`, the derivative along the unit vector `e_k`.
    pub(crate) fn along(&mut self, expr: Expr, k: usize) -> Expr {
        let derivative = self.derivative(expr, self.geometry.coordinates[k]);
        self.graph.div(derivative, self.geometry.scale[k])
    }

    /// Component `i` of `(1/h_k) d e_m / d q_k`.
    pub(crate) fn turning(&mut self, k: usize, m: usize, i: usize) -> Expr {
        self.graph.div(self.geometry.turning[k][m][i], self.geometry.scale[k])
    }

    /// The gradient of a vector field: `H_iJ = (1/h_J) [d u_i/d q_J + sum_m u_m (d e_m/d q_J)_i]`.
    pub(crate) fn gradient(&mut self, u: &Vector) -> Matrix {
        let n = u.len();
        let mut gradient = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for J in 0..n {
                let mut terms = vec![self.along(u[i], J)];
                for m in 0..n {
                    let turning = self.turning(J, m, i);
                    terms.push(self.graph.mul(u[m], turning));
                }
                gradient[i][J] = self.graph.sum_of(terms);
            }
        }
        gradient
    }

    /// The divergence of a tensor field over its second index:
    /// `sum_J (1/h_J) [d A_iJ/d q_J + sum_m A_mJ (d e_m/d q_J)_i + sum_m A_im (d e_m/d q_J)_J]`.
    pub(crate) fn divergence(&mut self, A: &Matrix) -> Vector {
        let n = A.len();
        (0..n)
            .map(|i| {
                // One sum over all terms, so that those of equal factors are joined.
                let mut terms = self.divergence_of_frame(A, i);
                terms.extend((0..n).map(|J| self.along(A[i][J], J)));
                self.graph.sum_of(terms)
            })
            .collect()
    }

    /// The gradient of the gradient, `[k][L][J] = (1/h_J) d H_kL/d q_J`, with what the turning of the unit vectors adds
    /// where `turning` is asked for.
    pub(crate) fn second_gradient(&mut self, H: &Matrix, turning: bool) -> Vec<Matrix> {
        let n = H.len();
        let mut gradient = vec![vec![vec![Graph::ZERO; n]; n]; n];
        for k in 0..n {
            for L in 0..n {
                for J in 0..n {
                    let mut terms = vec![self.along(H[k][L], J)];
                    for m in 0..if turning { n } else { 0 } {
                        let of_first = self.turning(J, m, k);
                        terms.push(self.graph.mul(H[m][L], of_first));
                        let of_second = self.turning(J, m, L);
                        terms.push(self.graph.mul(H[k][m], of_second));
                    }
                    gradient[k][L][J] = self.graph.sum_of(terms);
                }
            }
        }
        gradient
    }

    /// Terms of the sum that the turning of the unit vectors adds to component `i` of the divergence of `A`.
    pub(crate) fn divergence_of_frame(&mut self, A: &Matrix, i: usize) -> Vec<Expr> {
        let n = A.len();
        let mut terms = Vec::new();
        for J in 0..n {
            for m in 0..n {
                let turning = self.turning(J, m, i);
                terms.push(self.graph.mul(A[m][J], turning));
                let turning = self.turning(J, m, J);
                terms.push(self.graph.mul(A[i][m], turning));
            }
        }
        terms
    }
}

/// Whether terms of `a` and `-b` were joined in `sum`, which is `a - b` after cancellation.
pub(crate) fn is_joined(
    graph: &mut Graph,
    sum: Expr,
    [a, b]: [Expr; 2],
    variables: &BTreeSet<Expr>,
) -> bool {
    let (a, b) = (graph.cancel(a, variables), graph.cancel(b, variables));
    let others = graph.sub(sum, a);
    let own = match graph.node(a) {
        Node::Sum { terms, .. } => terms.len(),
        _ => usize::from(a != Graph::ZERO),
    };
    // Terms of equal factors are grouped; where they are joined, the whole is shorter.
    terms(graph, sum) != terms(graph, others) + own
        && graph.reachable(&[sum]).len() < graph.reachable(&[a, b]).len()
}

/// How many terms an expression has, common factors apart.
fn terms(graph: &Graph, expr: Expr) -> usize {
    match graph.node(expr) {
        // A product with a number in front of it.
        Node::Sum { constant, terms: one } if one.len() == 1 && constant.is_zero() => {
            terms(graph, one[0].0)
        }
        Node::Sum { terms, .. } => terms.len(),
        Node::Product(factors) => {
            let sums = factors.iter().filter_map(|(base, _)| match graph.node(*base) {
                Node::Sum { terms, .. } => Some(terms.len()),
                _ => None,
            });
            sums.max().unwrap_or(1)
        }
        _ => usize::from(expr != Graph::ZERO),
    }
}
