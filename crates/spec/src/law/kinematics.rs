//! Measures of strain that are small where the displacement gradient is, and what laws in invariants need of their gradients.

use super::{Deformation, Divergence, OfGradient, modulus_at_rest, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::derivation::is_joined;
use crate::tensor::{Matrix, Vector, determinant, matrix_product, minors_beyond_trace};
use mmsmith_expr::{Expr, Function, Graph, Rational, Rule};
use std::collections::BTreeMap;

/// Measures of the strain of one deformation.
pub(super) struct Kinematics {
    /// `tr(C - I)`.
    pub(super) trace: Expr,
    /// `F F^T - I`, where a turn drops out of it.
    pub(super) strain: Option<Matrix>,
    /// `H + H^T` without its diagonal, where it has a form of its own.
    pub(super) doubled_strain: DoubledStrain,
    /// `F - F^-T`.
    pub(super) difference: Matrix,
    /// `H^T F^-T = I - F^-T`.
    pub(super) M: Matrix,
}

/// The gradient of `ln J`.
pub(super) struct DilationGradient {
    /// `M : dH` along each unit vector.
    pub(super) of_M: Vector,
    /// `grad ln J = grad tr H - M : grad H`.
    pub(super) g: Vector,
}

impl Kinematics {
    pub(super) fn new(derivation: &mut Derivation, deformation: &Deformation) -> Self {
        let graph = &mut derivation.graph;
        let H = &deformation.H;
        let n = H.len();
        let strain = deformation.turn.as_ref().map(|turn| turn.strain(graph));
        let trace = match &strain {
            Some(B) => graph.sum_of((0..n).map(|i| B[i][i])),
            None => {
                let squares: Vec<Expr> = H.iter().flatten().map(|&h| graph.powi(h, 2)).collect();
                let twice = deformation.dilation.iter().flat_map(|&term| [term; 2]);
                graph.sum_of(twice.chain(squares))
            }
        };
        let trace = graph.whole(trace);
        let f = &deformation.inverse_transpose;
        let M = deformation.transposed_gradient_times_inverse(graph);
        let mut doubled_strain = vec![vec![None; n]; n];
        let difference = if let Some(B) = &strain {
            // F - F^-T = (F F^T - I) F^-T
            matrix_product(graph, B, f)
        } else {
            doubled_strain = self::doubled_strain(derivation, deformation);
            let graph = &mut derivation.graph;
            let mut whole = M.clone();
            for i in 0..n {
                for j in 0..n {
                    whole[i][j] = difference(graph, deformation, &doubled_strain, &M, [i, j]);
                }
            }
            whole
        };
        Kinematics { trace, strain, doubled_strain, difference, M }
    }

    /// `J - 1 - tr(C - I)/2`, of second order.
    pub(super) fn volume_beyond_trace(&self, graph: &mut Graph, deformation: &Deformation) -> Expr {
        let H = &deformation.H;
        let n = H.len();
        let half = |numerator: i64| Rational::new(numerator.into(), 2.into());
        let sum = if let Some(B) = &self.strain {
            // J^2 = det(I + B)
            let minors = minors_beyond_trace(graph, B);
            let square = graph.powi(deformation.volume_change, 2);
            let minors = minors.into_iter().map(|minor| (half(1), minor));
            graph.sum(minors.chain([(half(-1), square)]))
        } else {
            // For n = 2 two squares, which do not cancel.
            let mut terms = Vec::new();
            for i in 0..n {
                for j in i + 1..n {
                    let shear = graph.add(H[i][j], H[j][i]);
                    terms.push((half(-1), graph.powi(shear, 2)));
                    if i > 0 {
                        terms.push((2.into(), graph.mul(H[i][i], H[j][j])));
                    }
                }
            }
            let apart = (0..n).map(|i| (if i == 0 { 1 } else { -1 }.into(), H[i][i]));
            let apart = graph.sum(apart);
            terms.push((half(-1), graph.powi(apart, 2)));
            if n == 3 {
                terms.push((1.into(), determinant(graph, H)));
            }
            graph.sum(terms)
        };
        graph.whole(sum)
    }

    /// `ln J - tr(C - I)/2`, of second order. Next to inversion a product of stretches has digits that `J - 1` lacks: there it is a sum
    /// over the stretches.
    pub(super) fn log_beyond_trace(&self, graph: &mut Graph, deformation: &Deformation) -> Expr {
        let sum = match of_stretches(graph, deformation) {
            Some(beyond) => {
                let half = Rational::new((-1).into(), 2.into());
                let squares = deformation.H.iter().flatten().map(|&h| (half.clone(), h));
                let squares: Vec<_> = squares.map(|(half, h)| (half, graph.powi(h, 2))).collect();
                graph.sum([(1.into(), beyond)].into_iter().chain(squares))
            }
            None => {
                let beyond = graph.call(Function::Ln1pMinusX, &[deformation.volume_change]);
                let volume = self.volume_beyond_trace(graph, deformation);
                graph.add(beyond, volume)
            }
        };
        graph.whole(sum)
    }

    /// The gradient of `ln J`; zero where the volume is constant.
    pub(super) fn dilation_gradient(
        &self,
        derivation: &mut Derivation,
        deformation: &Deformation,
    ) -> DilationGradient {
        let n = deformation.H.len();
        let of_M: Vector =
            (0..n).map(|k| work_along(derivation, &self.M, &deformation.H, k)).collect();
        let g = match deformation.is_isochoric() {
            true => vec![Graph::ZERO; n],
            false => (0..n).map(|k| deformation.log_J_along(derivation, of_M[k], k)).collect(),
        };
        DilationGradient { of_M, g }
    }
}

/// The sum of `ln(1 + x) - x` over the entries `x` of a diagonal displacement gradient.
fn of_stretches(graph: &mut Graph, deformation: &Deformation) -> Option<Expr> {
    deformation.is_diagonal().then(|| {
        let H = &deformation.H;
        let terms: Vec<Expr> =
            (0..H.len()).map(|i| graph.call(Function::Ln1pMinusX, &[H[i][i]])).collect();
        graph.sum_of(terms)
    })
}

/// The symbol of `v = J - 1` in energies, and `1 + v`.
pub(super) fn volume_symbols(graph: &mut Graph) -> [Expr; 2] {
    let v = graph.symbol("J - 1");
    [v, graph.add(Graph::ONE, v)]
}

/// Replacements of `v`, `1 + v` and logarithms of it at a deformation.
pub(super) fn volume_values(graph: &mut Graph, deformation: &Deformation) -> BTreeMap<Expr, Expr> {
    let [v, sum] = volume_symbols(graph);
    BTreeMap::from([
        (sum, deformation.J),
        (v, deformation.volume_change),
        (graph.call(Function::Ln1p, &[v]), deformation.log_J),
        (graph.call(Function::Ln, &[sum]), deformation.log_J),
    ])
}

/// Parts of the divergence of a stress `S A + N F^-T` with `A = F` less a multiple of `F^-T`: `Div P = S Div F + A grad S + F^-T (...)`.
pub(super) struct ChainRule<'a> {
    pub(super) A: &'a Matrix,
    /// `S`, at rest and what it is more, and its gradient.
    pub(super) S: Expr,
    pub(super) S_at_rest: Expr,
    pub(super) S_change: Expr,
    pub(super) of_S: Vector,
    /// The factor of `F^-T g` at rest, and all that `F^-T` is applied to, without that and with it.
    pub(super) modulus: Expr,
    pub(super) change: Vector,
    pub(super) all: Vector,
}

impl ChainRule<'_> {
    pub(super) fn divergence(
        self,
        derivation: &mut Derivation,
        deformation: &Deformation,
        kinematics: &Kinematics,
        DilationGradient { of_M, g }: &DilationGradient,
    ) -> Divergence {
        let f = &deformation.inverse_transpose;
        let OfGradient { open, of_H } = deformation.divergence_of_gradient(derivation);
        let graph = &mut derivation.graph;
        // With J = 1 everywhere, what belongs to the change of volume adds up to zero.
        let modulus = if deformation.is_isochoric() { Graph::ZERO } else { self.modulus };
        let open_mu = modulus_at_rest(graph, self.S_at_rest);
        let open_modulus = modulus_at_rest(graph, modulus);
        let (mut linear, mut remainder, mut whole) = (Vector::new(), Vector::new(), Vector::new());
        for i in 0..f.len() {
            let dilation = deformation.trace_along(derivation, i);
            let graph = &mut derivation.graph;
            let first = [graph.mul(open_modulus, dilation), graph.mul(open_mu, open[i])];
            linear.push(graph.sum_of(first));
            let Mg = row_times(graph, &kinematics.M, i, g);
            let of_volume = graph.add(of_M[i], Mg);
            let of_volume = graph.mul(modulus, of_volume);
            let of_S = row_times(graph, self.A, i, &self.of_S);
            let rest = [
                row_times(graph, f, i, &self.change),
                graph.neg(of_volume),
                of_S,
                graph.mul(self.S_change, of_H[i]),
            ];
            remainder.push(graph.sum_of(rest));
            let all = [row_times(graph, f, i, &self.all), of_S, graph.mul(self.S, of_H[i])];
            whole.push(graph.sum_of(all));
        }
        Divergence { linear, remainder, whole }
    }
}

/// `A : dH` along the unit vector `e_k`.
pub(super) fn work_along(derivation: &mut Derivation, A: &Matrix, H: &Matrix, k: usize) -> Expr {
    let mut terms = Vec::new();
    for (a, h) in A.iter().flatten().zip(H.iter().flatten()) {
        let derivative = derivation.along(*h, k);
        terms.push(derivation.graph.mul(*a, derivative));
    }
    let sum = derivation.graph.sum_of(terms);
    let sum = zero_if_vanishing(&mut derivation.graph, sum);
    derivation.graph.whole(sum)
}

/// Entry `i` of `A x`.
pub(super) fn row_times(graph: &mut Graph, A: &Matrix, i: usize, x: &Vector) -> Expr {
    let terms: Vec<Expr> = A[i].iter().zip(x).map(|(&a, &x)| graph.mul(a, x)).collect();
    graph.sum_of(terms)
}

/// Entries of `H + H^T` but for the diagonal, where terms of the sum cancel in symbols, or where it is a difference of waves, which vanishes
/// with its slope. Shear strains are small next to the turn there, and the entry of `F - F^-T` is `H + H^T - H^T (H^T F^-T)`, whose second
/// part is of second order.
pub(super) type DoubledStrain = Vec<Vec<Option<Expr>>>;

pub(super) fn doubled_strain(
    derivation: &mut Derivation,
    deformation: &Deformation,
) -> DoubledStrain {
    let places = &derivation.geometry.places();
    let Derivation { graph, variables, .. } = derivation;
    let open = &deformation.open;
    let n = open.len();
    let mut strain = vec![vec![None; n]; n];
    if Rule::DoubledStrain.is_off() {
        return strain;
    }
    for i in 0..n {
        for j in 0..i {
            let negative = graph.neg(open[j][i]);
            let whole = graph.sub(open[i][j], negative);
            let differences = graph.in_differences(whole, places);
            if differences == whole && !is_joined(graph, whole, [open[i][j], negative], variables) {
                continue;
            }
            let sum = graph.whole(differences);
            (strain[i][j], strain[j][i]) = (Some(sum), Some(sum));
        }
    }
    strain
}

/// An entry of `H + H^T`.
pub(super) fn with_transpose(
    graph: &mut Graph,
    deformation: &Deformation,
    doubled_strain: &DoubledStrain,
    [i, j]: [usize; 2],
) -> Expr {
    let H = &deformation.H;
    doubled_strain[i][j].unwrap_or_else(|| graph.add(H[i][j], H[j][i]))
}

/// An entry of `F - F^-T`, from `M = H^T F^-T`: `H + M`, or `H + H^T - H^T M`.
pub(super) fn difference(
    graph: &mut Graph,
    deformation: &Deformation,
    doubled_strain: &DoubledStrain,
    M: &Matrix,
    [i, j]: [usize; 2],
) -> Expr {
    let H = &deformation.H;
    let Some(strain) = doubled_strain[i][j] else {
        return graph.add(H[i][j], M[i][j]);
    };
    let second = if H.len() == 2 {
        // The cofactor is -H_ji there.
        let change = graph.div(deformation.volume_change, deformation.J);
        graph.mul(H[j][i], change)
    } else {
        let terms: Vec<Expr> = (0..H.len()).map(|k| graph.mul(H[k][i], M[k][j])).collect();
        graph.sum_of(terms)
    };
    graph.sub(strain, second)
}
