//! Energies in principal stretches, where these have a closed form.
//!
//! In the plane the principal stretches `a`, `b` enter by `a b`, the ratio of areas, and by `z = (a - b)^2/(2 a b)`, which is
//! `[(F11 - F22)^2 + (F12 + F21)^2]/(2 a b)`: with `ln(a/b) = arcosh(1 + z)` every even function of it is smooth at `z = 0`. In
//! space the same holds where one direction is a principal one.
//!
//! In the plane the stress and its divergence follow from `W(J, z)` by the chain rule over these two and not over the components of
//! `F`. With `phi = J dW/dJ - z dW/dz`, `psi = (dW/dz)/J`, `M = F - J F^-T` and `g = grad ln J` it is
//!
//! - `P = phi F^-T + psi M`,
//! - `Div P = F^-T (grad phi - phi g) + M grad psi + psi Div F`,
//!
//! since the divergence of `J F^-T` is zero (Piola's identity); `z = |M|^2/(4 J)`, and `grad z = (M : grad F)/J - z g`. Along the
//! diagonal `P` is formed as `(phi - psi (J - 1)) F^-T + psi (F - F^-T)`, whose factor of `F^-T` is `lambda (J - 1)` to first order.

use super::energy::{RATIO, own_symbol};
use super::kinematics::{
    ChainRule, Kinematics, volume_symbols, volume_values, with_transpose, work_along,
};
use super::{Deformation, Divergence, Stress, zero_if_vanishing};
use crate::DeriveError;
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector};
use mmsmith_expr::{Derivatives, Expr, Graph, Rational};
use mmsmith_vocabulary::InStretches;
use std::collections::{BTreeMap, BTreeSet};

/// The energy as text in the components of `F`, and whether it holds for every deformation, not this one alone.
pub(super) fn energy(
    graph: &Graph,
    H: &Matrix,
    parts: &InStretches,
) -> Result<(String, bool), DeriveError> {
    let n = H.len();
    let coupled = |i: usize, j: usize| {
        graph.node(H[i][j]) != graph.node(Graph::ZERO)
            || graph.node(H[j][i]) != graph.node(Graph::ZERO)
    };
    let pairs: Vec<(usize, usize)> = (0..n)
        .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
        .filter(|&(i, j)| coupled(i, j))
        .collect();
    if pairs.len() > 1 {
        return Err(DeriveError::NoClosedForm(
            "this law needs the principal stretches, which have a usable closed form where the deformation gradient \
             is diagonal in the coordinates of the specification, or couples two directions only; here it couples all \
             three: choose coordinates in which it does not, or another law",
        ));
    }
    Ok((in_components(n, pairs.first().copied(), parts), n == 2 && pairs.len() == 1))
}

/// The energy of every deformation in one or two dimensions as text in the components of `F`; none in space, where all directions are
/// coupled.
pub(super) fn energy_of_all(dimension: usize, parts: &InStretches) -> Option<String> {
    let pair = (dimension == 2).then_some((0, 1));
    (dimension < 3).then(|| in_components(dimension, pair, parts))
}

/// The energy in space as text in the components of `F`, where there is no shear across the first `dimension` directions.
pub(super) fn energy_across(dimension: usize, parts: &InStretches) -> String {
    in_components(3, (dimension == 2).then_some((0, 1)), parts)
}

/// The energy as text in the components of `F`, of which at most two directions are coupled.
fn in_components(n: usize, pair: Option<(usize, usize)>, parts: &InStretches) -> String {
    let mut text = parts.volume.to_owned();
    let mut alone: Vec<usize> = (0..n).collect();
    if let Some((i, j)) = pair {
        alone.retain(|&k| k != i && k != j);
        let (i, j) = (i + 1, j + 1);
        let area = format!("(F{i}{i}*F{j}{j} - F{i}{j}*F{j}{i})");
        let ratio = format!("(((F{i}{i} - F{j}{j})^2 + (F{i}{j} + F{j}{i})^2)/(2*{area}))");
        let pair = parts.pair.replace("(ratio)", &ratio).replace("area", &area);
        text += &format!(" + ({pair})");
    }
    let along = |stretch: &str| format!(" + ({})", parts.alone.replace("stretch", stretch));
    for k in alone {
        let k = k + 1;
        text += &along(&format!("F{k}{k}"));
    }
    // Nothing stretches along the directions left out.
    text.extend((n..3).map(|_| along("1")));
    text
}

/// Whether the deformation is one in the plane whose principal directions are not those of the coordinates.
pub(super) fn is_coupled_in_plane(deformation: &Deformation) -> bool {
    deformation.H.len() == 2 && !deformation.is_diagonal()
}

/// The energy of a deformation in the plane as text in `J` and [`RATIO`].
pub(super) fn energy_in_plane(parts: &InStretches) -> String {
    let pair = parts.pair.replace("area", "J");
    format!("{} + ({pair}) + ({})", parts.volume, parts.alone.replace("stretch", "1"))
}

/// The stress of the energy `W` in `J` and [`RATIO`] in the plane.
pub(super) fn stress_in_plane(
    derivation: &mut Derivation,
    deformation: &Deformation,
    W: Expr,
) -> Stress {
    let kinematics = Kinematics::new(derivation, deformation);
    let graph = &mut derivation.graph;
    let (H, f) = (&deformation.H, &deformation.inverse_transpose);
    let M = deviator(graph, deformation, &kinematics);
    let law = InPlane::new(graph, deformation, &kinematics, W);

    let n = H.len();
    let mut P = vec![vec![Graph::ZERO; n]; n];
    let mut anisotropic = P.clone();
    for i in 0..n {
        for j in 0..n {
            let terms = match i == j {
                true => [
                    graph.mul(law.normal, f[i][j]),
                    graph.mul(law.psi, kinematics.difference[i][j]),
                ],
                false => [graph.mul(law.phi, f[i][j]), graph.mul(law.psi, M[i][j])],
            };
            let entry = graph.sum_of(terms);
            P[i][j] = zero_if_vanishing(graph, entry);
            let turned = graph.mul(law.phi, kinematics.M[i][j]);
            let shear = graph.mul(law.psi, M[i][j]);
            let entry = graph.sub(shear, turned);
            anisotropic[i][j] = zero_if_vanishing(graph, entry);
        }
    }

    let dilation = kinematics.dilation_gradient(derivation, deformation);
    let (mut of_psi, mut change, mut all) = (Vector::new(), Vector::new(), Vector::new());
    for (k, &g) in dilation.g.iter().enumerate() {
        let of_M = work_along(derivation, &M, H, k);
        let graph = &mut derivation.graph;
        let first = graph.div(of_M, deformation.J);
        let second = graph.mul(law.z, g);
        let along = graph.sub(first, second);
        let along = zero_if_vanishing(graph, along);
        let along = graph.whole(along);
        let of_volume = graph.product_of([law.psi_by_v, deformation.J, g]);
        let of_ratio = graph.mul(law.psi_by_z, along);
        let sum = graph.add(of_volume, of_ratio);
        of_psi.push(graph.whole(sum));
        // Of grad phi - phi g: but for its value at rest, and all.
        let of_ratio = graph.mul(law.phi_by_z, along);
        let of_volume = graph.mul(law.chi_change, g);
        let rest = graph.add(of_volume, of_ratio);
        let at_rest = graph.mul(law.chi_at_rest, g);
        let sum = graph.add(at_rest, rest);
        change.push(graph.whole(rest));
        all.push(graph.whole(sum));
    }
    let rule = ChainRule {
        A: &M,
        S: law.psi,
        S_at_rest: law.psi_at_rest,
        S_change: law.psi_change,
        of_S: of_psi,
        modulus: law.chi_at_rest,
        change,
        all,
    };
    let Divergence { linear, remainder, whole } =
        rule.divergence(derivation, deformation, &kinematics, &dilation);
    let (isotropic, energy) = (law.phi, Some(law.energy));
    Stress { P, isotropic, anisotropic, linear, remainder, whole: Some(whole), energy }
}

/// `M = F - J F^-T`.
fn deviator(graph: &mut Graph, deformation: &Deformation, kinematics: &Kinematics) -> Matrix {
    let H = &deformation.H;
    let mut M = kinematics.difference.clone();
    if kinematics.strain.is_some() {
        for (entries, f) in M.iter_mut().zip(&deformation.inverse_transpose) {
            for (entry, f) in entries.iter_mut().zip(f) {
                let of_volume = graph.mul(deformation.volume_change, *f);
                *entry = graph.sub(*entry, of_volume);
            }
        }
    } else {
        let normal = graph.sub(H[0][0], H[1][1]);
        let shear = with_transpose(graph, deformation, &kinematics.doubled_strain, [0, 1]);
        M = vec![vec![normal, shear], vec![shear, graph.neg(normal)]];
    }
    for entry in M.iter_mut().flatten() {
        *entry = zero_if_vanishing(graph, *entry);
        *entry = graph.whole(*entry);
    }
    M
}

/// The derivatives of an energy in `J` and `z`, at a deformation.
struct InPlane {
    z: Expr,
    /// `phi = J dW/dJ - z dW/dz`, and its derivative.
    phi: Expr,
    phi_by_z: Expr,
    /// `chi = J dphi/dJ - phi`, at rest and what it is more.
    chi_at_rest: Expr,
    chi_change: Expr,
    /// `psi = (dW/dz)/J`, its parts and its derivatives.
    psi: Expr,
    psi_at_rest: Expr,
    psi_change: Expr,
    psi_by_v: Expr,
    psi_by_z: Expr,
    /// `phi - psi (J - 1)`.
    normal: Expr,
    energy: Expr,
}

impl InPlane {
    fn new(graph: &mut Graph, deformation: &Deformation, kinematics: &Kinematics, W: Expr) -> Self {
        let J = graph.symbol("J");
        let [v, sum] = volume_symbols(graph);
        let z = own_symbol(graph, RATIO);
        let W = graph.replace(W, &BTreeMap::from([(J, sum)]));
        let small = BTreeSet::from([v, z]);
        let mut derivatives = Derivatives::limited();
        let (by_v, by_z) = (derivatives.of(graph, W, v), derivatives.of(graph, W, z));
        let (of_volume, of_ratio) = (graph.mul(sum, by_v), graph.mul(z, by_z));
        let phi = graph.sub(of_volume, of_ratio);
        let (_, phi) = graph.split_at_zero(phi, &small);
        let (phi_by_v, phi_by_z) = (derivatives.of(graph, phi, v), derivatives.of(graph, phi, z));
        let of_volume = graph.mul(sum, phi_by_v);
        let chi = graph.sub(of_volume, phi);
        let (chi_at_rest, chi_change) = graph.split_at_zero(chi, &small);
        let psi = graph.div(by_z, sum);
        let (psi_at_rest, psi_change) = graph.split_at_zero(psi, &small);
        let psi = graph.add(psi_at_rest, psi_change);
        let (psi_by_v, psi_by_z) = (derivatives.of(graph, psi, v), derivatives.of(graph, psi, z));
        let (_, energy) = graph.split_at_zero(W, &small);

        let of_shear = graph.mul(psi, v);
        let normal = graph.sub(phi, of_shear);
        let ratio = ratio(graph, deformation, kinematics);
        let mut actual = volume_values(graph, deformation);
        actual.insert(z, ratio);
        let mut at = |expr| {
            let value = graph.replace(expr, &actual);
            let value = zero_if_vanishing(graph, value);
            graph.whole(value)
        };
        InPlane {
            z: ratio,
            phi: at(phi),
            phi_by_z: at(phi_by_z),
            chi_at_rest,
            chi_change: at(chi_change),
            psi: at(psi),
            psi_at_rest,
            psi_change: at(psi_change),
            psi_by_v: at(psi_by_v),
            psi_by_z: at(psi_by_z),
            normal: at(normal),
            energy: at(energy),
        }
    }
}

/// `z = (a - b)^2/(2 a b)` of the principal stretches `a` and `b`, as sums of squares over what is positive.
fn ratio(graph: &mut Graph, deformation: &Deformation, kinematics: &Kinematics) -> Expr {
    let two = graph.integer(2);
    let ratio = if let Some(B) = &kinematics.strain {
        // (a^2 - b^2)^2 = (B11 - B22)^2 + 4 B12^2, and (a + b)^2 = 4 + tr B + 2 (J - 1).
        let normal = graph.sub(B[0][0], B[1][1]);
        let squares = [graph.powi(normal, 2), graph.powi(B[0][1], 2)];
        let squares = graph.sum([(1.into(), squares[0]), (4.into(), squares[1])]);
        let four = graph.integer(4);
        let below = graph.sum([
            (1.into(), four),
            (1.into(), kinematics.trace),
            (2.into(), deformation.volume_change),
        ]);
        let below = graph.product_of([two, below, deformation.J]);
        graph.div(squares, below)
    } else {
        let beyond = kinematics.volume_beyond_trace(graph, deformation);
        let ratio = graph.div(beyond, deformation.J);
        graph.sum([(Rational::from(-1), ratio)])
    };
    graph.whole(ratio)
}
