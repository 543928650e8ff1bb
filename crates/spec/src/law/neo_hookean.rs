//! The compressible neo-Hookean law, `tau = lambda ln(J) I + mu (F F^T - I)`, in forms that keep digits.
//!
//! - Stress is formed from the displacement gradient `H`, never from `F - I`. Since
//!   `(F F^T - I) F^-T = F - F^-T = H + H^T F^-T`, it is `P = mu (H + H^T F^-T) + lambda log1p(J - 1) F^-T`. The product
//!   `tau F^-T` instead would form squares of `H` that the division by `F` takes away again: at large gradients
//!   that loses digits.
//! - Where shear strains are small next to the turn, terms of `H + H^T` cancel in symbols, see [`DoubledStrain`].
//! - Where the motion turns as it goes, `H` is large next to the strain, and the turn drops out of the sum
//!   `F F^T - I = H + H^T + H H^T` alone, in symbols: there `P = tau F^-T` with
//!   `tau = lambda log1p(J - 1) I + mu (F F^T - I)`.
//! - With `g = grad ln J = F^-T : grad F` (Jacobi's formula) and `Div (J F^-T) = 0` (Piola's identity) the divergence is
//!   `Div P = mu Div H + (mu + lambda (1 - ln J)) F^-T g`. In two parts, of which the first may join with the inertia, it is
//!   `mu Div H + (lambda + mu) grad tr H` and, with `M = H^T F^-T` and `g = grad tr H - m`, a remainder of second order,
//!   `-(lambda + mu) (m + M g) - lambda ln J F^-T g`, where `m = M : grad H`.

use super::kinematics::{DoubledStrain, difference, doubled_strain};
use super::{Deformation, Divergence, OfGradient, Stress, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector, matrix_product};
use mmsmith_expr::{Expr, Graph, Rule};

pub(super) fn stress(
    derivation: &mut Derivation,
    deformation: &Deformation,
    lambda: Expr,
    mu: Expr,
) -> Stress {
    // It multiplies `ln J` and its gradient alone.
    let lambda = if deformation.is_isochoric() { Graph::ZERO } else { lambda };
    let open = (lambda, mu);
    let graph = &mut derivation.graph;
    let (lambda, mu) = (graph.whole(lambda), graph.whole(mu));
    let strain = deformation.turn.as_ref().map(|turn| turn.strain(graph));
    let doubled_strain = match strain {
        // By which P is formed then.
        Some(_) => Vec::new(),
        None => doubled_strain(derivation, deformation),
    };
    let graph = &mut derivation.graph;
    let law = NeoHookean { deformation, lambda, mu, doubled_strain };
    let P = match &strain {
        Some(strain) => law.by_strain(graph, strain),
        None => law.by_gradient(graph),
    };
    let (isotropic, anisotropic) = if derivation.geometry.is_cartesian() {
        (Graph::ZERO, P.clone())
    } else {
        law.isotropic_and_rest(graph, strain.as_ref(), &P)
    };
    let Divergence { linear, remainder, whole } = law.divergence(derivation, open);
    Stress { P, isotropic, anisotropic, linear, remainder, whole: Some(whole), energy: None }
}

struct NeoHookean<'a> {
    deformation: &'a Deformation,
    /// Lamé's constants, each in one piece.
    lambda: Expr,
    mu: Expr,
    /// `H + H^T` without its diagonal, where terms of its parts cancel in symbols.
    doubled_strain: DoubledStrain,
}

impl NeoHookean<'_> {
    /// `mu (H + H^T F^-T) + lambda ln J F^-T`.
    fn by_gradient(&self, graph: &mut Graph) -> Matrix {
        let pressure = graph.mul(self.lambda, self.deformation.log_J);
        let once = self.deformation.transposed_gradient_times_inverse(graph);
        let mut P = once.clone();
        for (i, row) in P.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let shear =
                    difference(graph, self.deformation, &self.doubled_strain, &once, [i, j]);
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
        if pressure == Graph::ZERO || Rule::PressureApart.is_off() {
            return (Graph::ZERO, P.clone());
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
                    let shear =
                        difference(graph, self.deformation, &self.doubled_strain, &once, [i, j]);
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

    /// With the constants as they are written for what may join with the inertia.
    fn divergence(
        &self,
        derivation: &mut Derivation,
        (open_lambda, open_mu): (Expr, Expr),
    ) -> Divergence {
        let &Self { deformation, lambda, mu, .. } = self;
        let H = &deformation.H;
        let n = H.len();
        let graph = &mut derivation.graph;
        let modulus = graph.add(lambda, mu);
        let modulus = graph.whole(modulus);
        let pressure = graph.mul(lambda, deformation.log_J);
        let factor = graph.sub(modulus, pressure);
        let factor = graph.whole(factor);
        let M = deformation.transposed_gradient_times_inverse(graph);
        let is_isochoric = deformation.is_isochoric();
        let (mut g, mut m) = (Vector::new(), Vector::new());
        for k in 0..n {
            let mut terms = Vec::new();
            for i in 0..n {
                for j in 0..n {
                    let derivative = derivation.along(H[i][j], k);
                    terms.push(derivation.graph.mul(M[i][j], derivative));
                }
            }
            let sum = derivation.graph.sum_of(terms);
            let sum = zero_if_vanishing(&mut derivation.graph, sum);
            m.push(sum);
            g.push(deformation.log_J_along(derivation, sum, k));
        }
        let OfGradient { open, of_H } = deformation.divergence_of_gradient(derivation);
        let (mut linear, mut remainder, mut whole) = (Vector::new(), Vector::new(), Vector::new());
        for i in 0..n {
            let dilation = deformation.trace_along(derivation, i);
            let graph = &mut derivation.graph;
            let shear = graph.mul(open_mu, open[i]);
            if is_isochoric {
                linear.push(shear);
                remainder.push(Graph::ZERO);
                whole.push(shear);
                continue;
            }
            let terms = [graph.mul(open_lambda, dilation), graph.mul(open_mu, dilation), shear];
            linear.push(graph.sum_of(terms));
            let times = |graph: &mut Graph, A: &Matrix| {
                let terms: Vec<Expr> = (0..n).map(|j| graph.mul(A[i][j], g[j])).collect();
                graph.sum_of(terms)
            };
            let Mg = times(graph, &M);
            let fg = times(graph, &deformation.inverse_transpose);
            let second = graph.add(m[i], Mg);
            let second = graph.mul(modulus, second);
            let of_pressure = graph.mul(pressure, fg);
            let sum = graph.add(second, of_pressure);
            remainder.push(graph.neg(sum));
            let shear = graph.mul(mu, of_H[i]);
            let rest = graph.mul(factor, fg);
            whole.push(graph.add(shear, rest));
        }
        Divergence { linear, remainder, whole }
    }
}
