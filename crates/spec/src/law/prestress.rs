//! A stress `S` of the undeformed body, which gives `P = F S` and the energy `S : E`.

use super::energy::{ComponentLaw, named};
use super::{Deformation, Stress};
use crate::derivation::Derivation;
use crate::tensor::Matrix;
use mmsmith_expr::{Expr, Graph};

/// The components of a stress at the start that are not zero, in the upper triangle, each with its name in energies.
pub(crate) fn constants(S: &Matrix) -> Vec<(String, Expr)> {
    let entries = S.iter().enumerate().flat_map(|(i, row)| (i..row.len()).map(move |j| (i, j)));
    entries
        .filter(|&(i, j)| S[i][j] != Graph::ZERO)
        .map(|(i, j)| (format!("prestress_{}{}", i + 1, j + 1), S[i][j]))
        .collect()
}

/// The energy of a stress at the start, to add to another.
pub(crate) fn energy(S: &Matrix) -> String {
    let terms = constants(S).into_iter().map(|(name, _)| {
        let component = name.trim_start_matches("prestress_");
        let (row, column) = component.split_at(1);
        match row == column {
            true => format!(" + {name}*(C{component} - 1)/2"),
            false => format!(" + {name}*C{component}"),
        }
    });
    terms.collect()
}

/// The stress, along the coordinates' own unit vectors.
pub(super) fn stress(derivation: &mut Derivation, deformation: &Deformation, S: &Matrix) -> Stress {
    let graph = &mut derivation.graph;
    let values = constants(S).into_iter();
    let values = values.map(|(name, value)| (graph.symbol(&name), graph.whole(value))).collect();
    let W = named(graph, &format!("0{}", energy(S)), &[]);
    let W = graph.replace(W, &values);
    ComponentLaw::of_energy(graph, deformation, W, false).stress(derivation, deformation)
}
