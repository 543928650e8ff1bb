//! Energies in principal stretches, where these have a closed form.
//!
//! In the plane the principal stretches `a`, `b` enter by `a b`, the ratio of areas, and by `z = (a - b)^2/(2 a b)`, which is
//! `[(F11 - F22)^2 + (F12 + F21)^2]/(2 a b)`: with `ln(a/b) = arcosh(1 + z)` every even function of it is smooth at `z = 0`. In
//! space the same holds where one direction is a principal one.

use crate::DeriveError;
use crate::tensor::Matrix;
use mmsmith_expr::Graph;
use mmsmith_vocabulary::InStretches;

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
    let mut text = parts.volume.to_owned();
    let mut alone: Vec<usize> = (0..n).collect();
    if let Some(&(i, j)) = pairs.first() {
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
    Ok((text, n == 2 && pairs.len() == 1))
}
