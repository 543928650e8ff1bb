//! The compressible neo-Hookean law, `tau = lambda ln(J) I + mu (F F^T - I)`, in forms that keep digits.
//!
//! - Stress is formed from the displacement gradient `H`, never from `F - I`. Since
//!   `(F F^T - I) F^-T = F - F^-T = H + H^T F^-T`, it is `P = mu (H + H^T F^-T) + lambda log1p(J - 1) F^-T`. The product
//!   `tau F^-T` instead would form squares of `H` that the division by `F` takes away again: at large gradients
//!   that loses digits.
//! - Where the motion turns as it goes, `H` is large next to the strain, and the turn drops out of the sum
//!   `F F^T - I = H + H^T + H H^T` alone, in symbols: there `P = tau F^-T` with
//!   `tau = lambda log1p(J - 1) I + mu (F F^T - I)`.
//! - `P` is the part linear in `H` and a remainder of second order,
//!   `P = lambda tr(H) I + mu (H + H^T) + [lambda (ln J - tr H) I + lambda ln J (F^-T - I) - mu (H^T)^2 F^-T]`.
//! - `d ln J = F^-T : dH` (Jacobi's formula), so that the gradient of `ln J - tr H` is `-(H^T F^-T) : dH`, exactly of
//!   second order.

use super::{Deformation, Stress, linear_divergence, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector, matrix_product, transpose};
use mmsmith_expr::{Expr, Graph};

pub(super) fn stress(
    derivation: &mut Derivation,
    deformation: &Deformation,
    lambda: Expr,
    mu: Expr,
) -> Stress {
    // It multiplies `ln J` and its gradient alone.
    let lambda = if deformation.is_isochoric() { Graph::ZERO } else { lambda };
    let linear = linear_divergence(derivation, &deformation.open, lambda, mu);
    let graph = &mut derivation.graph;
    let (lambda, mu) = (graph.whole(lambda), graph.whole(mu));
    let law = NeoHookean { deformation, lambda, mu };
    let strain = strain_without_turn(graph, &deformation.H);
    let P = match &strain {
        Some(strain) => law.by_strain(graph, strain),
        None => law.by_gradient(graph),
    };
    let (isotropic, anisotropic) = if derivation.geometry.is_cartesian() {
        (Graph::ZERO, P.clone())
    } else {
        law.isotropic_and_rest(graph, strain.as_ref(), &P)
    };
    let remainder = law.remainder_divergence(derivation);
    Stress { P, isotropic, anisotropic, linear, remainder, whole: None, energy: None }
}

struct NeoHookean<'a> {
    deformation: &'a Deformation,
    /// Lamé's constants, each in one piece.
    lambda: Expr,
    mu: Expr,
}

impl NeoHookean<'_> {
    /// `mu (H + H^T F^-T) + lambda ln J F^-T`.
    fn by_gradient(&self, graph: &mut Graph) -> Matrix {
        let pressure = graph.mul(self.lambda, self.deformation.log_J);
        let once = self.deformation.transposed_gradient_times_inverse(graph);
        let mut P = once.clone();
        for (i, row) in P.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let shear = graph.add(self.deformation.H[i][j], once[i][j]);
                let shear = graph.mul(self.mu, shear);
                let normal = graph.mul(pressure, self.deformation.inverse_transpose[i][j]);
                *entry = graph.add(shear, normal);
                *entry = zero_if_vanishing(graph, *entry);
            }
        }
        P
    }

    /// `tau F^-T` with `tau = lambda ln J I + mu (F F^T - I)`.
    fn by_strain(&self, graph: &mut Graph, strain: &Matrix) -> Matrix {
        let n = strain.len();
        let pressure = graph.mul(self.lambda, self.deformation.log_J);
        let mut tau = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for j in 0..n {
                tau[i][j] = graph.mul(self.mu, strain[i][j]);
                if i == j {
                    tau[i][j] = graph.add(tau[i][j], pressure);
                }
                tau[i][j] = zero_if_vanishing(graph, tau[i][j]);
                tau[i][j] = graph.whole(tau[i][j]);
            }
        }
        let mut P = matrix_product(graph, &tau, &self.deformation.inverse_transpose);
        for entry in P.iter_mut().flatten() {
            *entry = zero_if_vanishing(graph, *entry);
            *entry = graph.shortened(*entry);
        }
        P
    }

    /// `p = lambda ln J`, and `P - p I = [mu (F F^T - I) - p H^T] F^-T = mu H + (mu - p) H^T F^-T`.
    fn isotropic_and_rest(
        &self,
        graph: &mut Graph,
        strain: Option<&Matrix>,
        P: &Matrix,
    ) -> (Expr, Matrix) {
        let H = &self.deformation.H;
        let n = H.len();
        let pressure = graph.mul(self.lambda, self.deformation.log_J);
        if pressure == Graph::ZERO {
            return (pressure, P.clone());
        }
        let mut rest = vec![vec![Graph::ZERO; n]; n];
        if let Some(strain) = strain {
            for i in 0..n {
                for j in 0..n {
                    let shear = graph.mul(self.mu, strain[i][j]);
                    let turned = graph.mul(pressure, H[j][i]);
                    let entry = graph.sub(shear, turned);
                    rest[i][j] = graph.whole(entry);
                }
            }
            rest = matrix_product(graph, &rest, &self.deformation.inverse_transpose);
        } else {
            let once = self.deformation.transposed_gradient_times_inverse(graph);
            for i in 0..n {
                for j in 0..n {
                    let shear = graph.add(H[i][j], once[i][j]);
                    let shear = graph.mul(self.mu, shear);
                    let turned = graph.mul(pressure, once[i][j]);
                    rest[i][j] = graph.sub(shear, turned);
                }
            }
        }
        for entry in rest.iter_mut().flatten() {
            *entry = zero_if_vanishing(graph, *entry);
        }
        (pressure, rest)
    }

    fn remainder_divergence(&self, derivation: &mut Derivation) -> Vector {
        let remainder = self.remainder_without_isotropic_part(&mut derivation.graph);
        let divergence = derivation.divergence(&remainder);
        (0..divergence.len())
            .map(|i| {
                let isotropic = self.isotropic_remainder(derivation, i);
                derivation.graph.add(isotropic, divergence[i])
            })
            .collect()
    }

    /// `lambda` times the derivative of `ln J - tr H` along `e_k`: `-lambda (H^T F^-T) : dH`.
    fn isotropic_remainder(&self, derivation: &mut Derivation, k: usize) -> Expr {
        let n = self.deformation.H.len();
        let product = self.deformation.transposed_gradient_times_inverse(&mut derivation.graph);
        let mut terms = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let derivative = derivation.along(self.deformation.H[i][j], k);
                terms.push(derivation.graph.mul(product[i][j], derivative));
            }
        }
        let graph = &mut derivation.graph;
        let sum = graph.sum_of(terms);
        let scaled = graph.mul(self.lambda, sum);
        graph.neg(scaled)
    }

    /// `lambda ln J (F^-T - I) - mu (H^T)^2 F^-T`, with `F^-T - I = -H^T F^-T`.
    fn remainder_without_isotropic_part(&self, graph: &mut Graph) -> Matrix {
        let n = self.deformation.H.len();
        let once = self.deformation.transposed_gradient_times_inverse(graph);
        let twice = matrix_product(graph, &transpose(&self.deformation.H), &once);
        let pressure = graph.mul(self.lambda, self.deformation.log_J);
        let mut remainder = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for j in 0..n {
                let dilation = graph.mul(pressure, once[i][j]);
                let shear = graph.mul(self.mu, twice[i][j]);
                let sum = graph.add(dilation, shear);
                remainder[i][j] = graph.neg(sum);
            }
        }
        remainder
    }
}

/// `H + H^T + H H^T = F F^T - I` where a turn drops out of it in symbols.
pub(super) fn strain_without_turn(graph: &mut Graph, H: &Matrix) -> Option<Matrix> {
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
