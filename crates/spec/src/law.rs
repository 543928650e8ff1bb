//! Stress of a material in the momentum balance: the first Piola-Kirchhoff stress and its divergence.

pub(crate) mod energy;
mod invariants;
mod isochoric;
mod kinematics;
mod neo_hookean;
pub(crate) mod prestress;
mod principal_stretches;
mod st_venant_kirchhoff;
mod turn;

use crate::Law;
use crate::derivation::Derivation;
use crate::tensor::{
    Matrix, Vector, cofactor, determinant, matrix_product, minors_beyond_trace, transpose,
};
use crate::{DeriveError, Spec};
use energy::{ComponentLaw, Field};
use kinematics::{doubled_strain, with_transpose};
use mmsmith_expr::{Expr, Function, Graph, Node, Rule};
use mmsmith_vocabulary::{Derivation as Formulas, Material, Volumetric};
use std::collections::{BTreeMap, BTreeSet};
use turn::Turn;

/// The deformation of one solution, in physical components.
pub(crate) struct Deformation {
    /// The displacement gradient as it was derived, for sums in which terms may cancel.
    open: Matrix,
    /// The displacement gradient with entries in one piece.
    H: Matrix,
    /// `F^-T`.
    inverse_transpose: Matrix,
    /// `det F`.
    pub(crate) J: Expr,
    /// `J - 1`, small where `H` is small.
    volume_change: Expr,
    log_J: Expr,
    /// The turn within `H`, where there is one.
    turn: Option<Turn>,
    /// The terms of `tr H`; none where it is zero in symbols, and the volume changes to second order alone.
    dilation: Vec<Expr>,
}

/// A stress, and its divergence in two parts.
pub(crate) struct Stress {
    /// First Piola-Kirchhoff stress.
    pub(crate) P: Matrix,
    /// A multiple of the identity within `P`, and the rest. Of the two, which are the same in all directions and not,
    /// only the second meets the turn to Cartesian unit vectors, where differences of diagonal entries are formed.
    pub(crate) isotropic: Expr,
    pub(crate) anisotropic: Matrix,
    /// The divergence of the part of `P` that is linear in `H`, open: it may cancel against the inertia.
    pub(crate) linear: Vector,
    /// The divergence of the rest, small where `H` is small.
    pub(crate) remainder: Vector,
    /// The whole divergence in a form of its own, where there is one. At large gradients the two parts may cancel.
    pub(crate) whole: Option<Vector>,
    /// The strain energy, where the material is given by one.
    pub(crate) energy: Option<Expr>,
}

/// `Div H`.
struct OfGradient {
    /// As it was derived, for sums in which terms may cancel.
    open: Vector,
    /// From entries of `H` in one piece.
    of_H: Vector,
}

/// The divergence of `P` in two parts, see [`Stress`], and whole.
struct Divergence {
    /// `mu Div H + (lambda + mu) grad tr H`.
    linear: Vector,
    remainder: Vector,
    whole: Vector,
}

impl Stress {
    /// The sum of the stresses of two energies.
    fn plus(self, graph: &mut Graph, other: Self) -> Self {
        fn vectors(graph: &mut Graph, x: Vector, y: Vector) -> Vector {
            x.into_iter().zip(y).map(|(x, y)| graph.add(x, y)).collect()
        }
        fn matrices(graph: &mut Graph, A: Matrix, B: Matrix) -> Matrix {
            A.into_iter().zip(B).map(|(x, y)| vectors(graph, x, y)).collect()
        }
        let whole = self.whole.map(|whole| {
            let sum = vectors(graph, whole, other.linear.clone());
            vectors(graph, sum, other.remainder.clone())
        });
        Stress {
            whole,
            P: matrices(graph, self.P, other.P),
            isotropic: graph.add(self.isotropic, other.isotropic),
            anisotropic: matrices(graph, self.anisotropic, other.anisotropic),
            linear: vectors(graph, self.linear, other.linear),
            remainder: vectors(graph, self.remainder, other.remainder),
            energy: self.energy.zip(other.energy).map(|(W, other)| graph.add(W, other)),
        }
    }
}

impl Deformation {
    /// From the displacement and its gradient.
    pub(crate) fn new(derivation: &mut Derivation, u: &Vector, open: Matrix) -> Self {
        let n = open.len();
        let turn = Turn::of(derivation, u);
        let graph = &mut derivation.graph;
        let apart = turn.as_ref().map(|turn| turn.gradient(graph));
        let entries = apart.as_ref().unwrap_or(&open);
        let H: Matrix =
            entries.iter().map(|row| row.iter().map(|&h| graph.whole(h)).collect()).collect();
        let mut F = H.clone();
        for i in 0..n {
            F[i][i] = graph.add(Graph::ONE, H[i][i]);
        }
        let determinant = determinant(graph, &F);
        let J = graph.whole(determinant);
        // J - 1 as the sum of the principal minors of H, small where H is small.
        let dilation =
            dilation(graph, &open, &H, &derivation.variables, &derivation.geometry.places());
        let volume_change = match &turn {
            Some(turn) => turn.volume_change(graph),
            None => {
                let minors = minors_beyond_trace(graph, &H);
                graph.sum_of(dilation.iter().copied().chain(minors))
            }
        };
        let volume_change = zero_if_vanishing(graph, volume_change);
        // Where J = 1, tr H is what is left of J - 1, of second order; by its terms of first order it would have no digits.
        let is_of_second_order = volume_change == Graph::ZERO && !Rule::SecondOrder.is_off();
        let dilation = if is_of_second_order && turn.is_none() && !dilation.is_empty() {
            let minors = minors_beyond_trace(graph, &H);
            let minors = graph.sum_of(minors);
            let trace = graph.neg(minors);
            vec![graph.whole(trace)]
        } else {
            dilation
        };
        let J = if volume_change == Graph::ZERO { Graph::ONE } else { J };
        let volume_change = graph.whole(volume_change);
        let mut inverse_transpose = vec![vec![Graph::ZERO; n]; n];
        for i in 0..n {
            for k in 0..n {
                let cofactor = cofactor(graph, &F, i, k);
                inverse_transpose[i][k] = graph.div(cofactor, J);
            }
        }
        // A product of stretches has digits next to zero that the sum J - 1 lacks.
        let log_J = match graph.node(J) {
            Node::Product(_) if !Rule::LogOfBoth.is_off() => {
                graph.call(Function::LnOfBoth, &[volume_change, J])
            }
            _ => graph.call(Function::Ln1p, &[volume_change]),
        };
        // Jacobi's formula, d ln J = F^-T : dH.
        for k in 0..n {
            let q = derivation.geometry.coordinates[k];
            let mut terms = Vec::new();
            for i in 0..n {
                for j in 0..n {
                    let derivative = derivation.derivative(H[i][j], q);
                    terms.push(derivation.graph.mul(inverse_transpose[i][j], derivative));
                }
            }
            let derivative = derivation.graph.sum_of(terms);
            derivation.derivatives.define(log_J, q, derivative);
        }
        Deformation { open, H, inverse_transpose, J, volume_change, log_J, turn, dilation }
    }

    /// Whether the principal directions are those of the coordinates.
    fn is_diagonal(&self) -> bool {
        let n = self.H.len();
        (0..n).all(|i| (0..n).all(|j| i == j || self.H[i][j] == Graph::ZERO))
    }

    /// Whether `tr H` is zero in symbols.
    fn is_free_of_divergence(&self) -> bool {
        self.dilation.is_empty()
    }

    /// `tr H`, open.
    fn trace(&self, graph: &mut Graph) -> Expr {
        if self.is_free_of_divergence() {
            return Graph::ZERO;
        }
        if self.is_isochoric() && self.turn.is_none() {
            return graph.sum_of(self.dilation.iter().copied());
        }
        graph.sum_of((0..self.open.len()).map(|i| self.open[i][i]))
    }

    /// `Div H`.
    fn divergence_of_gradient(&self, derivation: &mut Derivation) -> OfGradient {
        match self.divergence_of_second_order(derivation) {
            Some(of_H) => OfGradient { open: of_H.clone(), of_H },
            None => OfGradient {
                open: derivation.divergence(&self.open),
                of_H: derivation.divergence(&self.H),
            },
        }
    }

    /// `Div H` where `H` is symmetric and `J = 1`: there it is the gradient of `tr H`, which is of second order, and so is `Div H^T`.
    fn divergence_of_second_order(&self, derivation: &mut Derivation) -> Option<Vector> {
        if Rule::SecondOrder.is_off() {
            return None;
        }
        let n = self.H.len();
        let is_symmetric = (0..n).all(|i| {
            (0..i).all(|j| {
                let turn = derivation.graph.sub(self.open[i][j], self.open[j][i]);
                derivation.graph.vanishes(turn)
            })
        });
        (self.is_isochoric() && self.turn.is_none() && is_symmetric).then(|| {
            let trace = self.trace(&mut derivation.graph);
            (0..n).map(|k| derivation.along(trace, k)).collect()
        })
    }

    /// The slope of `tr H` along a unit vector.
    fn trace_along(&self, derivation: &mut Derivation, k: usize) -> Expr {
        let trace = self.trace(&mut derivation.graph);
        derivation.along(trace, k)
    }

    /// The slope of `ln J` along a unit vector, where `of_M` is `M : dH` with `M = H^T F^-T`: less that where `tr H` is zero.
    fn log_J_along(&self, derivation: &mut Derivation, of_M: Expr, k: usize) -> Expr {
        let along = if self.is_free_of_divergence() {
            derivation.graph.neg(of_M)
        } else {
            derivation.along(self.log_J, k)
        };
        derivation.graph.whole(along)
    }

    /// `H^T F^-T = I - F^-T`: beside the diagonal the second, since the terms of the first may cancel there.
    fn transposed_gradient_times_inverse(&self, graph: &mut Graph) -> Matrix {
        let f = &self.inverse_transpose;
        let mut M = matrix_product(graph, &transpose(&self.H), f);
        for i in 0..f.len() {
            for j in (0..f.len()).filter(|j| *j != i) {
                M[i][j] = graph.neg(f[i][j]);
            }
        }
        M
    }

    /// Whether the volume is shown in symbols to be constant. A pressure that follows from `J` is then the same everywhere; between
    /// the linear part of its divergence and the remainder it would cancel in digits only, and next to incompressibility `lambda/mu`
    /// has no bound.
    fn is_isochoric(&self) -> bool {
        self.volume_change == Graph::ZERO
    }
}

/// The terms of `tr H`, none where it is zero in symbols. The sum of two waves of one size is a product: it vanishes where they are equal, and
/// `lambda` multiplies it, which next to incompressibility is large.
fn dilation(
    graph: &mut Graph,
    open: &Matrix,
    H: &Matrix,
    variables: &BTreeSet<Expr>,
    places: &BTreeSet<Expr>,
) -> Vec<Expr> {
    let n = H.len();
    let trace = graph.sum_of((0..n).map(|i| open[i][i]));
    let cancelled = graph.cancel(trace, variables);
    if graph.vanishes(cancelled) {
        return Vec::new();
    }
    let product = graph.in_differences(trace, places);
    if product == trace {
        return (0..n).map(|i| H[i][i]).collect();
    }
    vec![graph.whole(product)]
}

/// The stress of a law at a deformation, with that of the undeformed body.
pub(crate) fn stress(
    derivation: &mut Derivation,
    deformation: &Deformation,
    spec: &Spec,
) -> Result<Stress, DeriveError> {
    let stress = stress_of_law(derivation, deformation, spec)?;
    let Some(S) = &spec.prestress else { return Ok(stress) };
    let at_start = prestress::stress(derivation, deformation, S);
    Ok(stress.plus(&mut derivation.graph, at_start))
}

/// The derivatives of the stress of a law that is a function of the deformation alone, in Cartesian components: `[k][L]` is that of `P` with
/// respect to `F_kL`.
pub(crate) fn tangent(
    derivation: &mut Derivation,
    deformation: &Deformation,
    spec: &Spec,
) -> Result<Vec<Vec<Matrix>>, DeriveError> {
    let n = deformation.H.len();
    let has_other_frame = !derivation.geometry.is_cartesian() || spec.rotation.is_some();
    if has_other_frame || spec.has_memory_or_fields() {
        return Err(DeriveError::NoClosedForm(
            "the tangent is written for Cartesian coordinates without [with-rotation], and for laws whose stress is a function of F and \
             parameters alone; mms eval --tangent has it at points of other solutions",
        ));
    }
    let of_law = match (&spec.variation, &spec.material) {
        (_, Law::Stress { P }) => ComponentLaw::of_stress(derivation, deformation, P, Vec::new()),
        (None, Law::Energy { W }) => {
            ComponentLaw::of_energy(&mut derivation.graph, deformation, *W, false)
        }
        (variation, material) => {
            let (text, constants) = match (variation, material) {
                (Some(variation), _) => (variation.energy.clone(), variation.constants.clone()),
                (None, Law::Library(own)) if n < 3 || !has_principal_stretches(own) => {
                    (energy_text(own, n), material.constants())
                }
                _ => {
                    return Err(DeriveError::NoClosedForm(
                        "the tangent of a law in principal stretches has no closed form in space",
                    ));
                }
            };
            let W = energy::named(&mut derivation.graph, &text, &constants);
            ComponentLaw::of_energy(&mut derivation.graph, deformation, W, false)
        }
    };
    let mut A = of_law.tangent(&mut derivation.graph, deformation);
    if let Some(S) = &spec.prestress {
        let graph = &mut derivation.graph;
        for (k, L) in (0..n * n).map(|m| (m / n, m % n)) {
            for (J, &S) in S[L].iter().enumerate() {
                A[k][L][k][J] = graph.add(A[k][L][k][J], S);
            }
        }
    }
    Ok(A)
}

fn has_principal_stretches(material: &Material<Expr>) -> bool {
    matches!(material.derivation(), Formulas::PrincipalStretches(_))
}

/// The stretch along the directions left out, where there is no stress along them.
pub(crate) fn stretch_across(
    derivation: &mut Derivation,
    deformation: &Deformation,
    spec: &Spec,
) -> Option<Expr> {
    let variation = spec.variation.as_ref()?;
    let stretch = &variation.across.as_ref()?.stretch;
    let graph = &mut derivation.graph;
    let stretch = energy::named(graph, stretch, &variation.constants);
    Some(energy::at_deformation(graph, deformation, stretch))
}

/// The stress of a law at a deformation.
fn stress_of_law(
    derivation: &mut Derivation,
    deformation: &Deformation,
    spec: &Spec,
) -> Result<Stress, DeriveError> {
    let law = &spec.material;
    let mut fields: Vec<Field> =
        spec.given.iter().map(|given| Field { symbol: given.symbol, value: given.value }).collect();
    let places = places_in(derivation, law);
    fields.extend(places.iter().map(|(&value, &symbol)| Field { symbol, value }));
    let (W, isotropic) = match law {
        Law::Stress { P } => {
            let P = P
                .iter()
                .map(|row| row.iter().map(|&p| derivation.graph.replace(p, &places)).collect())
                .collect();
            return Ok(ComponentLaw::of_stress(derivation, deformation, &P, fields)
                .stress(derivation, deformation));
        }
        Law::Library(material) if spec.has_graded_constants() => {
            let text = match material.derivation() {
                Formulas::PrincipalStretches(parts) => {
                    let (text, _) =
                        principal_stretches::energy(&derivation.graph, &deformation.H, &parts)?;
                    let volume = material.volumetric().map(Volumetric::formula);
                    text + &volume.map(|U| format!(" + kappa*({U})")).unwrap_or_default()
                }
                _ => energy_text(material, deformation.H.len()),
            };
            let constants = law.constants();
            let mut symbols = Vec::with_capacity(constants.len());
            for (constant, value) in constants {
                let symbol = energy::own_symbol(&mut derivation.graph, constant.name);
                fields.push(Field { symbol, value });
                symbols.push((constant, symbol));
            }
            let W = energy::named(&mut derivation.graph, &text, &symbols);
            let isotropic = material.row().is_isotropic
                && !matches!(
                    material.derivation(),
                    Formulas::PrincipalStretches(_)
                        | Formulas::StVenantKirchhoff { .. }
                        | Formulas::LinearElastic { .. }
                );
            return Ok(ComponentLaw::of_energy(&mut derivation.graph, deformation, W, isotropic)
                .with_fields(fields)
                .stress(derivation, deformation));
        }
        Law::Energy { W } => {
            let n = deformation.H.len();
            let W = &derivation.graph.replace(*W, &places);
            (*W, energy::uses_invariants_only(&mut derivation.graph, *W, n))
        }
        Law::Library(material) => {
            let with_volume = |graph: &mut Graph, text: String| {
                let volume = material.volumetric().map(Volumetric::formula);
                let volume = volume.map(|U| format!(" + kappa*({U})")).unwrap_or_default();
                energy::named(graph, &(text + &volume), &law.constants())
            };
            let (text, isotropic) = match material.derivation() {
                Formulas::NeoHookean { lambda, mu } => {
                    return Ok(neo_hookean::stress(derivation, deformation, lambda, mu));
                }
                Formulas::StVenantKirchhoff { lambda, mu } => {
                    return Ok(st_venant_kirchhoff::stress(derivation, deformation, lambda, mu));
                }
                Formulas::LinearElastic { lambda, mu } => {
                    return Ok(linear_elastic(derivation, deformation, lambda, mu));
                }
                Formulas::Energy { W } => (W.to_owned(), material.row().is_isotropic),
                Formulas::Isochoric { W, others } if Rule::Isochoric.is_off() => {
                    (in_invariants(W, others), material.row().is_isotropic)
                }
                Formulas::Isochoric { W, others } => {
                    let constants = law.constants();
                    let graph = &mut derivation.graph;
                    let isochoric = energy::named(graph, W, &constants);
                    let mut part = |text: fn(Volumetric) -> &'static str| {
                        let text = material.volumetric().map_or("0", text);
                        energy::named(graph, text, &constants)
                    };
                    let volume = isochoric::Volume {
                        kappa: part(|_| "kappa"),
                        energy: part(Volumetric::formula),
                        measure: part(|volume| volume.pressure_parts()[0]),
                        beside: part(|volume| volume.pressure_parts()[1]),
                    };
                    let others = energy::named(graph, others, &constants);
                    let stress = isochoric::stress(derivation, deformation, isochoric, volume);
                    if others == Graph::ZERO {
                        return Ok(stress);
                    }
                    let isotropic = material.row().is_isotropic;
                    let others = ComponentLaw::of_energy(
                        &mut derivation.graph,
                        deformation,
                        others,
                        isotropic,
                    )
                    .stress(derivation, deformation);
                    return Ok(stress.plus(&mut derivation.graph, others));
                }
                Formulas::PrincipalStretches(parts)
                    if !Rule::PrincipalStretches.is_off()
                        && principal_stretches::is_coupled_in_plane(deformation) =>
                {
                    let text = principal_stretches::energy_in_plane(&parts);
                    let W = with_volume(&mut derivation.graph, text);
                    return Ok(principal_stretches::stress_in_plane(derivation, deformation, W));
                }
                Formulas::PrincipalStretches(parts) => {
                    principal_stretches::energy(&derivation.graph, &deformation.H, &parts)?
                }
            };
            let W = with_volume(&mut derivation.graph, text);
            (W, isotropic)
        }
    };
    let graph = &mut derivation.graph;
    let n = deformation.H.len();
    // Where principal directions are those of the coordinates the components are the shorter form.
    if fields.is_empty()
        && !Rule::Invariants.is_off()
        && !deformation.is_diagonal()
        && energy::uses_invariants_only(graph, W, n)
        && let Some(W) = invariants::in_two_invariants(graph, W, n)
    {
        return Ok(invariants::stress(derivation, deformation, W));
    }
    Ok(ComponentLaw::of_energy(&mut derivation.graph, deformation, W, isotropic)
        .with_fields(fields)
        .stress(derivation, deformation))
}

/// The coordinates that a stated law uses, each with a symbol for it in the law: there it is a field, apart from the place of the
/// deformation.
fn places_in(derivation: &mut Derivation, law: &Law) -> BTreeMap<Expr, Expr> {
    let of_law = match law {
        Law::Energy { W } => vec![*W],
        Law::Stress { P } => P.concat(),
        Law::Library(_) => Vec::new(),
    };
    let used = derivation.graph.symbols_in(&of_law);
    let coordinates = derivation.geometry.coordinates.clone();
    let used = coordinates.into_iter().filter(|coordinate| used.contains(coordinate));
    used.map(|coordinate| {
        let name = derivation.graph.symbol_name(coordinate).unwrap_or_default().to_owned();
        (coordinate, energy::own_symbol(&mut derivation.graph, &name))
    })
    .collect()
}

/// The energy of an isochoric law without its volumetric part, in `J` and `I1`.
fn in_invariants(W: &str, others: &str) -> String {
    format!("{} + {others}", W.replace(energy::EXCESS, "(J^(-2/3)*I1 - 3)"))
}

/// The energy in space of a law that keeps its form without stress across, in components of a deformation that has no shear across
/// the `dimension` directions.
pub(crate) fn energy_in_space_without_shear_across(
    material: &Material<Expr>,
    dimension: usize,
) -> String {
    match material.derivation() {
        Formulas::PrincipalStretches(parts) => {
            principal_stretches::energy_across(dimension, &parts)
        }
        _ => energy_text(material, 3),
    }
}

/// The energy of a law with directions in `J`, `I1`, components and its constants, as a specification would state it.
pub(crate) fn energy_text(material: &Material<Expr>, dimension: usize) -> String {
    let text = match material.derivation() {
        Formulas::Energy { W } => W.to_owned(),
        Formulas::Isochoric { W, others } => in_invariants(W, others),
        Formulas::NeoHookean { .. } => "mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2".to_owned(),
        Formulas::StVenantKirchhoff { .. } => {
            let C = |i: usize, j: usize| match i == j {
                true => format!("(C{i}{i} - 1)"),
                false => format!("C{i}{j}"),
            };
            quadratic_energy("lambda/8", "mu/4", dimension, C)
        }
        Formulas::LinearElastic { .. } => {
            let twice_strain = |i: usize, j: usize| match i == j {
                true => format!("(2*F{i}{i} - 2)"),
                false => format!("(F{i}{j} + F{j}{i})"),
            };
            quadratic_energy("lambda/8", "mu/4", dimension, twice_strain)
        }
        Formulas::PrincipalStretches(parts) => {
            principal_stretches::energy_of_all(dimension, &parts).unwrap_or_default()
        }
    };
    let volume = material.volumetric().map(Volumetric::formula);
    text + &volume.map(|U| format!(" + kappa*({U})")).unwrap_or_default()
}

/// `lambda (tr A)^2 + mu A : A` as text.
fn quadratic_energy(
    lambda: &str,
    mu: &str,
    dimension: usize,
    A: impl Fn(usize, usize) -> String,
) -> String {
    let trace: Vec<String> = (1..=dimension).map(|i| A(i, i)).collect();
    let squares = (1..=dimension).flat_map(|i| (1..=dimension).map(move |j| (i, j)));
    let squares: Vec<String> = squares.map(|(i, j)| format!("{}^2", A(i, j))).collect();
    format!("{lambda}*({})^2 + {mu}*({})", trace.join(" + "), squares.join(" + "))
}

/// `P = lambda tr(H) I + mu (H + H^T)`.
fn linear_elastic(
    derivation: &mut Derivation,
    deformation: &Deformation,
    lambda: Expr,
    mu: Expr,
) -> Stress {
    let linear = linear_divergence(derivation, deformation, lambda, mu);
    let remainder = vec![Graph::ZERO; linear.len()];
    let graph = &mut derivation.graph;
    let (lambda, mu) = (graph.whole(lambda), graph.whole(mu));
    let H = &deformation.H;
    let n = H.len();
    let trace = graph.sum_of(deformation.dilation.iter().copied());
    let pressure = graph.mul(lambda, trace);
    let doubled_strain = doubled_strain(derivation, deformation);
    let graph = &mut derivation.graph;
    let mut P = vec![vec![Graph::ZERO; n]; n];
    let mut anisotropic = P.clone();
    for i in 0..n {
        for j in 0..n {
            let strain = with_transpose(graph, deformation, &doubled_strain, [i, j]);
            let shear = graph.mul(mu, strain);
            anisotropic[i][j] = zero_if_vanishing(graph, shear);
            let normal = if i == j { pressure } else { Graph::ZERO };
            let entry = graph.add(normal, shear);
            P[i][j] = zero_if_vanishing(graph, entry);
        }
    }
    Stress { P, isotropic: pressure, anisotropic, linear, remainder, whole: None, energy: None }
}

/// The divergence of `lambda tr(H) I + mu (H + H^T)`, with the constants as they are written.
fn linear_divergence(
    derivation: &mut Derivation,
    deformation: &Deformation,
    lambda: Expr,
    mu: Expr,
) -> Vector {
    let H = &deformation.open;
    let n = H.len();
    let strain = match deformation.divergence_of_second_order(derivation) {
        Some(of_H) => of_H.iter().map(|&of_H| derivation.graph.add(of_H, of_H)).collect(),
        None => {
            let mut symmetric = H.clone();
            for i in 0..n {
                for j in 0..n {
                    symmetric[i][j] = derivation.graph.add(H[i][j], H[j][i]);
                }
            }
            derivation.divergence(&symmetric)
        }
    };
    (0..n)
        .map(|i| {
            let dilation = deformation.trace_along(derivation, i);
            let graph = &mut derivation.graph;
            let dilation = graph.mul(lambda, dilation);
            let shear = graph.mul(mu, strain[i]);
            graph.add(dilation, shear)
        })
        .collect()
}

/// The expression, or zero where it is zero at every point without looking so. Rounding would leave something there.
pub(crate) fn zero_if_vanishing(graph: &mut Graph, expr: Expr) -> Expr {
    if !Rule::Vanishing.is_off() && graph.vanishes(expr) { Graph::ZERO } else { expr }
}

/// A modulus at rest with its constants as they are written, so that identities among them cancel in symbols, here and against the
/// inertia: `kappa - 2 mu/3` is `lambda` where bulk and shear modulus are stated in Young's modulus and Poisson's ratio, and rounding
/// would keep something where that vanishes.
fn modulus_at_rest(graph: &mut Graph, modulus: Expr) -> Expr {
    let modulus = zero_if_vanishing(graph, modulus);
    let open = graph.open(modulus);
    graph.single_term(open).unwrap_or(open)
}

/// The expression that [`Graph::whole`] kept in one piece.
pub(crate) fn inside(graph: &Graph, expr: Expr) -> Expr {
    match graph.node(expr) {
        Node::Whole(inner) => *inner,
        _ => expr,
    }
}
