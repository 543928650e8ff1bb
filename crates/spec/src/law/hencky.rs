//! The energy of Hencky's law, `W = lambda/2 (ln J)^2 + mu |ln V|^2`, where it has a closed form.
//!
//! In the plane the principal stretches `a`, `b` enter by `ln a + ln b = ln J` and by the logarithm of their ratio,
//! `ln(a/b)^2 = arcosh(1 + z)^2` with `z = (a - b)^2/(2 a b) = [(F11 - F22)^2 + (F12 + F21)^2]/(2 J)`, which is smooth
//! at `z = 0`: `|ln V|^2 = [(ln J)^2 + ln(a/b)^2]/2`. In space the same holds where one direction is a principal one.

use crate::DeriveError;
use crate::tensor::Matrix;
use mmsmith_expr::Graph;

/// The energy as text in the components of `F`, and whether it holds for every deformation, not this one alone.
pub(super) fn energy(graph: &Graph, H: &Matrix) -> Result<(String, bool), DeriveError> {
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
            "Hencky's law needs the principal stretches, which have a usable closed form where the deformation gradient \
             is diagonal in the coordinates of the specification, or couples two directions only; here it couples all \
             three: choose coordinates in which it does not, or another law",
        ));
    }
    let mut text = "lambda/2*ln(J)^2".to_owned();
    let mut alone: Vec<usize> = (0..n).collect();
    if let Some(&(i, j)) = pairs.first() {
        alone.retain(|&k| k != i && k != j);
        let (i, j) = (i + 1, j + 1);
        let area = format!("(F{i}{i}*F{j}{j} - F{i}{j}*F{j}{i})");
        let ratio = format!("((F{i}{i} - F{j}{j})^2 + (F{i}{j} + F{j}{i})^2)/(2*{area})");
        text += &format!(" + mu/2*(ln({area})^2 + lnratio2({ratio}))");
    }
    for k in alone {
        let k = k + 1;
        text += &format!(" + mu*ln(F{k}{k})^2");
    }
    Ok((text, n == 2 && pairs.len() == 1))
}
