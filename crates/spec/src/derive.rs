//! The derivation: displacement and material in, every field out.
//!
//! Everything is derived in the specification's own coordinates, on physical components, so that the structure of
//! the solution survives: a radial motion in polar coordinates has a diagonal deformation gradient. The turn to
//! Cartesian components comes last.
//!
//! Three measures keep digits where the deformation is small:
//!
//! - Stress is formed from the displacement gradient `H`, never from `F - I`:
//!   `tau = lambda log1p(e) I + mu (H + H^T + H H^T)` with `e = J - 1 = tr H + (minors of H)`, and `P = tau F^-T`.
//! - For the body force, `P` is split into the part linear in `H` and a remainder of second order,
//!   `P = lambda tr(H) I + mu (H + H^T) + [lambda (ln J - tr H) I + lambda ln J (F^-T - I) - mu (H^T)^2 F^-T]`.
//!   The linear part is joined with the acceleration in symbols, where the two may cancel identically.
//! - `d ln J = F^-T : dH` (Jacobi's formula), so that the gradient of `ln J - tr H` is `-(H^T F^-T) : dH`, exactly of
//!   second order.

use crate::coordinates::{Geometry, identity};
use crate::{Material, Spec};
use mmsmith_expr::{Dependence, Derivatives, Expr, Function, Graph, Program};
use std::collections::BTreeSet;
use thiserror::Error;

/// A vector or a matrix of expressions.
type Vector = Vec<Expr>;
type Matrix = Vec<Vec<Expr>>;

/// Every field of a solution, in Cartesian components, as expressions of the graph.
///
/// Indices of matrices: row `i` is the spatial, column `J` the reference direction.
#[derive(Clone, Debug)]
pub struct Fields {
    /// The graph that the expressions belong to.
    pub graph: Graph,
    /// The Cartesian coordinates, the time, and the parameters, with what each of them is; program inputs.
    pub inputs: Vec<(Expr, Dependence)>,
    /// What further symbols mean, such as the polar radius.
    pub definitions: Vec<(Expr, Expr)>,
    /// Displacement.
    pub u: Vector,
    /// Velocity.
    pub v: Vector,
    /// Acceleration.
    pub a: Vector,
    /// Displacement gradient.
    pub H: Matrix,
    /// Deformation gradient.
    pub F: Matrix,
    /// `det F`.
    pub J: Expr,
    /// First Piola-Kirchhoff stress.
    pub P: Matrix,
    /// Body force per unit mass.
    pub b: Vector,
}

/// Why fields could not be derived.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum DeriveError {
    /// A field would divide by zero at every point.
    #[error("the field {field} divides by zero everywhere")]
    DivisionByZero {
        /// The letter of the field.
        field: &'static str,
    },
}

impl Fields {
    /// The straight-line program that computes `outputs` from the inputs.
    #[must_use]
    pub fn program(&mut self, outputs: &[Expr]) -> Program {
        Program::lower(&mut self.graph, &self.inputs, &self.definitions, outputs)
    }

    pub(crate) fn derive(spec: &Spec) -> Result<Self, DeriveError> {
        let mut graph = spec.graph.clone();
        let geometry = Geometry::new(&mut graph, spec.coordinates, spec.dimension);
        let time = graph.symbol("t");
        let variables: BTreeSet<Expr> =
            geometry.coordinates.iter().copied().chain([time]).collect();
        let mut derivation =
            Derivation { graph, geometry, derivatives: Derivatives::default(), variables };
        let n = spec.dimension;

        let u = spec.displacement.clone();
        let v: Vector = u.iter().map(|&u| derivation.derivative(u, time)).collect();
        let a: Vector = v.iter().map(|&v| derivation.derivative(v, time)).collect();
        let H = derivation.gradient(&u);
        let Material::NeoHookean { lambda, mu } = spec.material;
        let law = NeoHookean::new(&mut derivation, &H, lambda, mu);
        let b = law.body_force(&mut derivation, &H, &a, spec.density);

        let Derivation { mut graph, geometry, .. } = derivation;
        let vector = |graph: &mut Graph, x: &Vector| turn_vector(graph, &geometry, x);
        let u = vector(&mut graph, &u);
        let v = vector(&mut graph, &v);
        let a = vector(&mut graph, &a);
        let b = vector(&mut graph, &b);
        let H = turn_matrix(&mut graph, &geometry, &H);
        let P = turn_matrix(&mut graph, &geometry, &law.P);
        let J = graph.replace(law.J, &geometry.shorter);
        let mut F = H.clone();
        for i in 0..n {
            F[i][i] = graph.add(Graph::ONE, H[i][i]);
        }

        let rate = |position, time| Dependence { position, time };
        let mut inputs: Vec<(Expr, Dependence)> =
            geometry.cartesian.iter().map(|&X| (X, rate(true, false))).collect();
        inputs.push((time, rate(false, true)));
        for parameter in &spec.parameters {
            inputs.push((graph.symbol(&parameter.name), rate(false, false)));
        }
        let fields =
            Fields { graph, inputs, definitions: geometry.definitions, u, v, a, H, F, J, P, b };
        fields.check()?;
        Ok(fields)
    }

    fn check(&self) -> Result<(), DeriveError> {
        let J = [self.J];
        let vectors = [("u", &self.u), ("v", &self.v), ("a", &self.a), ("b", &self.b)];
        let matrices = [("H", &self.H), ("F", &self.F), ("P", &self.P)];
        let parts = vectors
            .iter()
            .map(|(field, x)| (*field, x.as_slice()))
            .chain(
                matrices.iter().flat_map(|(field, A)| A.iter().map(|row| (*field, row.as_slice()))),
            )
            .chain([("J", J.as_slice())]);
        for (field, expressions) in parts {
            if expressions.iter().any(|&e| self.graph.divides_by_zero(e)) {
                return Err(DeriveError::DivisionByZero { field });
            }
        }
        Ok(())
    }
}

struct Derivation {
    graph: Graph,
    geometry: Geometry,
    derivatives: Derivatives,
    variables: BTreeSet<Expr>,
}

impl Derivation {
    fn derivative(&mut self, expr: Expr, variable: Expr) -> Expr {
        self.derivatives.of(&mut self.graph, expr, variable)
    }

    /// `(1/h_k) d expr / d q_k`, the derivative along the unit vector `e_k`.
    fn along(&mut self, expr: Expr, k: usize) -> Expr {
        let derivative = self.derivative(expr, self.geometry.coordinates[k]);
        self.graph.div(derivative, self.geometry.scale[k])
    }

    /// Component `i` of `(1/h_k) d e_m / d q_k`.
    fn turning(&mut self, k: usize, m: usize, i: usize) -> Expr {
        self.graph.div(self.geometry.turning[k][m][i], self.geometry.scale[k])
    }

    /// The gradient of a vector field: `H_iJ = (1/h_J) [d u_i/d q_J + sum_m u_m (d e_m/d q_J)_i]`.
    fn gradient(&mut self, u: &Vector) -> Matrix {
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
    fn divergence(&mut self, A: &Matrix) -> Vector {
        let n = A.len();
        let mut divergence = Vec::new();
        for i in 0..n {
            let mut terms = Vec::new();
            for J in 0..n {
                terms.push(self.along(A[i][J], J));
                for m in 0..n {
                    let turning = self.turning(J, m, i);
                    terms.push(self.graph.mul(A[m][J], turning));
                    let turning = self.turning(J, m, J);
                    terms.push(self.graph.mul(A[i][m], turning));
                }
            }
            divergence.push(self.graph.sum_of(terms));
        }
        divergence
    }
}

/// The neo-Hookean law at the deformation of one solution.
struct NeoHookean {
    /// Lamé's constants, each in one piece.
    lambda: Expr,
    mu: Expr,
    /// The displacement gradient with entries in one piece.
    H: Matrix,
    /// `F^-T`.
    inverse_transpose: Matrix,
    J: Expr,
    log_J: Expr,
    /// First Piola-Kirchhoff stress.
    P: Matrix,
}

impl NeoHookean {
    fn new(derivation: &mut Derivation, H: &Matrix, lambda: Expr, mu: Expr) -> Self {
        let n = H.len();
        let graph = &mut derivation.graph;
        let (lambda, mu) = (graph.whole(lambda), graph.whole(mu));
        let H: Matrix = H.iter().map(|row| row.iter().map(|&h| graph.whole(h)).collect()).collect();
        let mut F = H.clone();
        for i in 0..n {
            F[i][i] = graph.add(Graph::ONE, H[i][i]);
        }
        let determinant = determinant(graph, &F);
        let J = graph.whole(determinant);
        let mut inverse_transpose = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for k in 0..n {
                let cofactor = cofactor(graph, &F, i, k);
                inverse_transpose[i][k] = graph.div(cofactor, J);
            }
        }
        // J - 1 as the sum of the principal minors of H, small where H is small.
        let minors = principal_minors(graph, &H);
        let volume_change = graph.sum_of(minors);
        let volume_change = zero_if_vanishing(graph, volume_change);
        let J = if volume_change == Graph::ZERO { Graph::ONE } else { J };
        let volume_change = graph.whole(volume_change);
        let log_J = graph.call(Function::Ln1p, &[volume_change]);
        // Jacobi's formula, d ln J = F^-T : dH.
        for k in 0..n {
            let q = derivation.geometry.coordinates[k];
            let mut terms = Vec::new();
            for i in 0..n {
                for j in 0..n {
                    let derivative = derivation.derivatives.of(&mut derivation.graph, H[i][j], q);
                    terms.push(derivation.graph.mul(inverse_transpose[i][j], derivative));
                }
            }
            let derivative = derivation.graph.sum_of(terms);
            derivation.derivatives.define(log_J, q, derivative);
        }

        let graph = &mut derivation.graph;
        let pressure = graph.mul(lambda, log_J);
        let mut tau = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for j in 0..n {
                // mu (H + H^T + H H^T) = mu (F F^T - I)
                let mut terms = vec![H[i][j], H[j][i]];
                terms.extend((0..n).map(|m| graph.mul(H[i][m], H[j][m])));
                let strain = graph.sum_of(terms);
                tau[i][j] = graph.mul(mu, strain);
                if i == j {
                    tau[i][j] = graph.add(tau[i][j], pressure);
                }
                tau[i][j] = zero_if_vanishing(graph, tau[i][j]);
                tau[i][j] = graph.whole(tau[i][j]);
            }
        }
        let mut P = matrix_product(graph, &tau, &inverse_transpose);
        for entry in P.iter_mut().flatten() {
            *entry = zero_if_vanishing(graph, *entry);
        }
        NeoHookean { lambda, mu, H, inverse_transpose, J, log_J, P }
    }

    /// `b = [a - Div P_linear / rho0] - Div P_remainder / rho0`, the bracket joined in symbols.
    ///
    /// `H` and `a` are open, for the bracket; the remainder uses the entries in one piece.
    fn body_force(
        &self,
        derivation: &mut Derivation,
        H: &Matrix,
        a: &Vector,
        density: Expr,
    ) -> Vector {
        let n = a.len();
        let open_lambda = inside(&derivation.graph, self.lambda);
        let open_mu = inside(&derivation.graph, self.mu);
        let trace = derivation.graph.sum_of((0..n).map(|i| H[i][i]));
        let mut symmetric = H.clone();
        for i in 0..n {
            for j in 0..n {
                symmetric[i][j] = derivation.graph.add(H[i][j], H[j][i]);
            }
        }
        let linear = derivation.divergence(&symmetric);
        let remainder = self.remainder_without_isotropic_part(derivation);
        let remainder = derivation.divergence(&remainder);
        let density = derivation.graph.whole(density);
        let mut b = Vec::new();
        for i in 0..n {
            let dilation = derivation.along(trace, i);
            let graph = &mut derivation.graph;
            let dilation = graph.mul(open_lambda, dilation);
            let shear = graph.mul(open_mu, linear[i]);
            let stress = graph.add(dilation, shear);
            let open_density = inside(graph, density);
            let force = graph.div(stress, open_density);
            let bracket = graph.sub(a[i], force);
            let bracket = graph.cancel(bracket, &derivation.variables);
            let bracket = graph.whole(bracket);

            let isotropic = self.isotropic_remainder(derivation, i);
            let graph = &mut derivation.graph;
            let rest = graph.add(isotropic, remainder[i]);
            let rest = zero_if_vanishing(graph, rest);
            let rest = graph.div(rest, density);
            let component = graph.sub(bracket, rest);
            b.push(zero_if_vanishing(graph, component));
        }
        b
    }

    /// `lambda` times the derivative of `ln J - tr H` along `e_k`: `-lambda (H^T F^-T) : dH`.
    fn isotropic_remainder(&self, derivation: &mut Derivation, k: usize) -> Expr {
        let n = self.H.len();
        let product = self.transposed_gradient_times_inverse(&mut derivation.graph);
        let mut terms = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let derivative = derivation.along(self.H[i][j], k);
                terms.push(derivation.graph.mul(product[i][j], derivative));
            }
        }
        let graph = &mut derivation.graph;
        let sum = graph.sum_of(terms);
        let scaled = graph.mul(self.lambda, sum);
        graph.neg(scaled)
    }

    /// `lambda ln J (F^-T - I) - mu (H^T)^2 F^-T`, with `F^-T - I = -H^T F^-T`.
    fn remainder_without_isotropic_part(&self, derivation: &mut Derivation) -> Matrix {
        let n = self.H.len();
        let graph = &mut derivation.graph;
        let once = self.transposed_gradient_times_inverse(graph);
        let twice = matrix_product(graph, &transpose(&self.H), &once);
        let pressure = graph.mul(self.lambda, self.log_J);
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

    /// `H^T F^-T`.
    fn transposed_gradient_times_inverse(&self, graph: &mut Graph) -> Matrix {
        matrix_product(graph, &transpose(&self.H), &self.inverse_transpose)
    }
}

/// The expression, or zero where it is zero at every point without looking so. Rounding would leave something there.
fn zero_if_vanishing(graph: &mut Graph, expr: Expr) -> Expr {
    if graph.vanishes(expr) { Graph::ZERO } else { expr }
}

/// What [`Graph::whole`] kept in one piece.
fn inside(graph: &Graph, expr: Expr) -> Expr {
    match graph.node(expr) {
        mmsmith_expr::Node::Whole(inner) => *inner,
        _ => expr,
    }
}

fn transpose(A: &Matrix) -> Matrix {
    (0..A.len()).map(|i| A.iter().map(|row| row[i]).collect()).collect()
}

fn matrix_product(graph: &mut Graph, A: &Matrix, B: &Matrix) -> Matrix {
    let n = A.len();
    let mut product = identity(n);
    for i in 0..n {
        for j in 0..n {
            let terms: Vec<Expr> = (0..n).map(|m| graph.mul(A[i][m], B[m][j])).collect();
            product[i][j] = graph.sum_of(terms);
        }
    }
    product
}

/// The determinant, by expansion along the first row.
fn determinant(graph: &mut Graph, A: &Matrix) -> Expr {
    if A.is_empty() {
        return Graph::ONE;
    }
    let mut terms = Vec::new();
    for j in 0..A.len() {
        let cofactor = cofactor(graph, A, 0, j);
        terms.push(graph.mul(A[0][j], cofactor));
    }
    graph.sum_of(terms)
}

/// The cofactor of entry `(i, j)`.
fn cofactor(graph: &mut Graph, A: &Matrix, i: usize, j: usize) -> Expr {
    let without = |skipped: usize| (0..A.len()).filter(move |&k| k != skipped);
    let minor: Matrix = without(i).map(|k| without(j).map(|l| A[k][l]).collect()).collect();
    let determinant = determinant(graph, &minor);
    if (i + j).is_multiple_of(2) { determinant } else { graph.neg(determinant) }
}

/// The determinants of all principal submatrices but the empty one; they add up to `det(I + A) - 1`.
fn principal_minors(graph: &mut Graph, A: &Matrix) -> Vec<Expr> {
    let n = A.len();
    (1..1_usize << n)
        .map(|subset| {
            let indices: Vec<usize> = (0..n).filter(|i| subset >> i & 1 == 1).collect();
            let minor =
                indices.iter().map(|&i| indices.iter().map(|&j| A[i][j]).collect()).collect();
            determinant(graph, &minor)
        })
        .collect()
}

/// Physical components to Cartesian ones: `x_i = sum_a Q_ia x_a`.
fn turn_vector(graph: &mut Graph, geometry: &Geometry, vector: &Vector) -> Vector {
    (0..geometry.dimension())
        .map(|i| {
            let terms: Vec<Expr> = (0..geometry.dimension())
                .map(|a| graph.mul(geometry.rotation[i][a], vector[a]))
                .collect();
            let component = graph.sum_of(terms);
            graph.replace(component, &geometry.shorter)
        })
        .collect()
}

/// Physical components to Cartesian ones: `A_ij = sum_ab Q_ia A_ab Q_jb`.
fn turn_matrix(graph: &mut Graph, geometry: &Geometry, matrix: &Matrix) -> Matrix {
    let n = geometry.dimension();
    // With equal diagonal entries for both angles these need not be told apart, which nobody can on the axis.
    let isotropic = geometry.transverse.is_some() && matrix[1][1] == matrix[2][2];
    let mut turned = identity(n);
    for i in 0..n {
        for j in 0..n {
            let mut terms = Vec::new();
            if let (Some(transverse), true) = (&geometry.transverse, isotropic) {
                let (Qi, Qj) = (geometry.rotation[i][0], geometry.rotation[j][0]);
                terms.push(graph.product_of([Qi, matrix[0][0], Qj]));
                terms.push(graph.mul(matrix[1][1], transverse[i][j]));
            }
            for a in 0..n {
                for b in 0..n {
                    if isotropic && a == b {
                        continue;
                    }
                    let (Qia, Qjb) = (geometry.rotation[i][a], geometry.rotation[j][b]);
                    terms.push(graph.product_of([Qia, matrix[a][b], Qjb]));
                }
            }
            let component = graph.sum_of(terms);
            turned[i][j] = graph.replace(component, &geometry.shorter);
        }
    }
    turned
}
