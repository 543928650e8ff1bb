//! Any law that is stated as a strain energy, or as the stress itself, in the components of `F`.
//!
//! The energy `W` is written in the components `h` of the displacement gradient, and differentiated there:
//! `P = dW/dF`, `A = dP/dF`. Each is split into its value at `h = 0` and a rest that is small with `h`
//! ([`Graph::split_at_zero`]), so that no digits are lost at small strain. By the chain rule
//! `Div P = A(0) : grad H + (A - A(0)) : grad H`, linear part and remainder.

use super::{Deformation, Stress, modulus_at_rest, zero_if_vanishing};
use crate::derivation::Derivation;
use crate::tensor::{Matrix, Vector, cofactor, determinant, principal_minors};
use mmsmith_expr::{Ast, Derivatives, Expr, Function, Graph, Node, Rule};
use mmsmith_vocabulary::Constant;
use std::collections::{BTreeMap, BTreeSet};

/// The names that an energy may use, and the components of `F` and `C` with two indices after them.
pub(crate) const INVARIANTS: [&str; 3] = ["J", "I1", "I2"];

/// Names in the energies of the library's laws: `I1b - 3`, and `(a - b)^2/(2 a b)` of the principal stretches in a plane.
pub(super) const EXCESS: &str = "excess";
pub(super) const RATIO: &str = "ratio";

/// The symbol of such a name, which is none that a specification can have.
pub(super) fn own_symbol(graph: &mut Graph, name: &str) -> Expr {
    graph.symbol(&format!("{name} of the law"))
}

/// The names of the components of a tensor, as `F11`.
pub(crate) fn component_names(letter: &str, dimension: usize) -> Vec<Vec<String>> {
    let row = |i| (1..=dimension).map(|j| format!("{letter}{i}{j}")).collect();
    (1..=dimension).map(row).collect()
}

/// The names of the components of the rates of the deformation.
pub(crate) fn rate_names(dimension: usize) -> Vec<String> {
    let components =
        ["Fdot", "d"].map(|letter| component_names(letter, dimension).concat()).concat();
    [vec!["Jdot".to_owned()], components].concat()
}

/// A law in the components of the displacement gradient.
pub(super) struct ComponentLaw {
    /// The symbols that stand for the components.
    h: Matrix,
    P: Matrix,
    /// Whether `P` is an isotropic function, so that the chain rule holds for whole tensors in any coordinates.
    isotropic: bool,
    /// The energy, where there is one.
    energy: Option<Expr>,
    /// Quantities of `h` that the deformation has in a form of its own.
    known: BTreeMap<Expr, Expr>,
    /// The symbols that stand for the components of the rate of the displacement gradient, where the law uses them.
    rates: Option<Matrix>,
    /// Fields of position and time that the law uses.
    fields: Vec<Field>,
    /// Components that vanish, and `J`, where it is a product of stretches then: for derivatives, once they are formed.
    simpler: BTreeMap<Expr, Expr>,
}

/// A field of position and time that a law uses.
#[derive(Clone, Copy)]
pub(super) struct Field {
    /// Its symbol in the law.
    pub(super) symbol: Expr,
    /// The field, which may use the symbols of fields before it.
    pub(super) value: Expr,
}

impl ComponentLaw {
    /// With fields of position and time that the law uses.
    pub(super) fn with_fields(self, fields: Vec<Field>) -> Self {
        Self { fields, ..self }
    }

    /// From the strain energy; `isotropic` where it is an isotropic function of every deformation.
    pub(super) fn of_energy(
        graph: &mut Graph,
        deformation: &Deformation,
        W: Expr,
        isotropic: bool,
    ) -> Self {
        let h = symbols(graph, deformation.H.len());
        let Components { replacement, known, simpler } = in_components(graph, &h, deformation);
        let energy = graph.replace(W, &replacement);
        let mut derivatives = Derivatives::limited();
        let P = h
            .iter()
            .map(|row| row.iter().map(|&h| derivatives.of(graph, energy, h)).collect())
            .collect();
        let fields = Vec::new();
        ComponentLaw { h, P, isotropic, energy: Some(energy), known, rates: None, fields, simpler }
    }

    /// From the components of the stress.
    pub(super) fn of_stress(
        derivation: &mut Derivation,
        deformation: &Deformation,
        P: &Matrix,
        fields: Vec<Field>,
    ) -> Self {
        let graph = &mut derivation.graph;
        let h = symbols(graph, deformation.H.len());
        let Components { mut replacement, known, simpler } = in_components(graph, &h, deformation);
        if deformation.is_isochoric() {
            replacement.insert(graph.symbol("J"), Graph::ONE);
        }
        let names = rate_names(h.len());
        let used = graph.symbols_in(&P.concat());
        let uses_rates = names.iter().any(|name| used.contains(&graph.symbol(name)));
        let rates = uses_rates.then(|| rates_in_components(graph, &h, &mut replacement));
        let P = P
            .iter()
            .map(|row| row.iter().map(|&p| graph.replace(p, &replacement)).collect())
            .collect();
        ComponentLaw { h, P, isotropic: false, energy: None, known, rates, fields, simpler }
    }

    /// The derivatives of the stress: `[k][L]` is that of `P` with respect to `F_kL`.
    pub(super) fn tangent(&self, graph: &mut Graph, deformation: &Deformation) -> Vec<Vec<Matrix>> {
        let small: BTreeSet<Expr> = self.h.iter().flatten().copied().collect();
        let mut actual = self.known.clone();
        actual.extend(self.h.concat().into_iter().zip(deformation.H.concat()));
        let mut derivatives = Derivatives::limited();
        let mut slope = |P: Expr, h: Expr| {
            let slope = derivatives.of(graph, P, h);
            let slope = graph.replace(slope, &self.simpler);
            let (value, rest) = graph.split_at_zero(slope, &small);
            let value = modulus_at_rest(graph, value);
            let sum = graph.add(value, rest);
            let slope = graph.replace(sum, &actual);
            zero_if_vanishing(graph, slope)
        };
        let mut of = |h: Expr| -> Matrix {
            self.P.iter().map(|row| row.iter().map(|&P| slope(P, h)).collect()).collect()
        };
        self.h.iter().map(|row| row.iter().map(|&h| of(h)).collect()).collect()
    }

    pub(super) fn stress(&self, derivation: &mut Derivation, deformation: &Deformation) -> Stress {
        let n = self.h.len();
        let mut small: BTreeSet<Expr> = self.h.iter().flatten().copied().collect();
        let mut actual = self.known.clone();
        for (symbol, entry) in self.h.iter().flatten().zip(deformation.H.iter().flatten()) {
            actual.insert(*symbol, *entry);
        }
        let mut rate = Matrix::new();
        if let Some(symbols) = &self.rates {
            let time = derivation.time;
            rate = deformation.H.clone();
            for (entry, symbol) in rate.iter_mut().flatten().zip(symbols.iter().flatten()) {
                let derivative = derivation.derivative(*entry, time);
                *entry = derivation.graph.whole(derivative);
                small.insert(*symbol);
                actual.insert(*symbol, *entry);
            }
        }
        // Fields may use fields before them.
        let mut of_fields = BTreeMap::new();
        for Field { symbol, value } in &self.fields {
            let value = derivation.graph.replace(*value, &of_fields);
            let value = derivation.graph.whole(value);
            of_fields.insert(*symbol, value);
            actual.insert(*symbol, value);
        }
        let graph = &mut derivation.graph;
        let mut general = self.P.clone();
        let mut stress = self.P.clone();
        for entry in stress.iter_mut().flatten() {
            *entry = graph.replace(*entry, &self.simpler);
        }
        for entry in general.iter_mut().chain(&mut stress).flatten() {
            let (value, rest) = graph.split_at_zero(*entry, &small);
            let value = zero_if_vanishing(graph, value);
            *entry = graph.add(value, rest);
        }
        let mut P = stress.clone();
        for entry in P.iter_mut().flatten() {
            let value = graph.replace(*entry, &actual);
            *entry = zero_if_vanishing(graph, value);
        }

        let open = derivation.second_gradient(&deformation.open, self.isotropic);
        let whole = derivation.second_gradient(&deformation.H, self.isotropic);
        let of_rate = match &self.rates {
            Some(_) => derivation.second_gradient(&rate, self.isotropic),
            None => Vec::new(),
        };
        let mut derivatives = Derivatives::limited();
        let (mut linear, mut remainder) = (Vector::new(), Vector::new());
        for i in 0..n {
            let (mut first, mut second) = (Vec::new(), Vec::new());
            for (J, k, L) in indices(n) {
                if open[k][L][J] == Graph::ZERO {
                    continue;
                }
                let graph = &mut derivation.graph;
                let h = self.h[k][L];
                let modulus = if self.simpler.contains_key(&h) {
                    let modulus = derivatives.of(graph, general[i][J], h);
                    graph.replace(modulus, &self.simpler)
                } else {
                    derivatives.of(graph, stress[i][J], h)
                };
                let (value, rest) = graph.split_at_zero(modulus, &small);
                let value = if self.fields.is_empty() {
                    modulus_at_rest(graph, value)
                } else {
                    graph.replace(value, &actual)
                };
                first.push(graph.mul(value, open[k][L][J]));
                let rest = graph.replace(rest, &actual);
                second.push(graph.mul(rest, whole[k][L][J]));
            }
            for (J, k, L) in indices(if self.rates.is_some() { n } else { 0 }) {
                let Some(symbols) = &self.rates else { continue };
                let viscosity = derivatives.of(&mut derivation.graph, stress[i][J], symbols[k][L]);
                let viscosity = derivation.graph.replace(viscosity, &actual);
                second.push(derivation.graph.mul(viscosity, of_rate[k][L][J]));
            }
            // Of the law at one deformation from place to place.
            for (J, &Field { symbol, .. }) in
                (0..n).flat_map(|J| self.fields.iter().map(move |field| (J, field)))
            {
                let slope = derivatives.of(&mut derivation.graph, stress[i][J], symbol);
                let slope = derivation.graph.replace(slope, &actual);
                let along = derivation.along(of_fields[&symbol], J);
                second.push(derivation.graph.mul(slope, along));
            }
            if !self.isotropic {
                second.extend(derivation.divergence_of_frame(&P, i));
            }
            linear.push(derivation.graph.sum_of(first));
            remainder.push(derivation.graph.sum_of(second));
        }
        // The energy of a law that changes from place to place, or in time, is not the work that the stress has done.
        let energy = self.energy.filter(|_| self.fields.is_empty()).map(|energy| {
            let (value, rest) = derivation.graph.split_at_zero(energy, &small);
            let value = zero_if_vanishing(&mut derivation.graph, value);
            let energy = derivation.graph.add(value, rest);
            derivation.graph.replace(energy, &actual)
        });
        let has_one_place = derivation.geometry.is_cartesian() || n < 2;
        let (isotropic, anisotropic) = if has_one_place || !self.fields.is_empty() {
            (Graph::ZERO, P.clone())
        } else {
            let cross = derivatives.of(&mut derivation.graph, general[0][0], self.h[1][1]);
            let (lambda, _) = derivation.graph.split_at_zero(cross, &small);
            isotropic_and_rest(&mut derivation.graph, deformation, lambda, &P)
        };
        Stress { P, isotropic, anisotropic, linear, remainder, whole: None, energy }
    }
}

/// `lambda ln J` and `P - lambda ln J I`, for a `P` that is linear in `ln J`: with its slope `c` this is
/// `P(ln J = 0) + (c - lambda F^-T) ln J - lambda ln J H^T F^-T`. The modulus `lambda` of a change of volume, which next to
/// incompressibility is large, then leaves nothing of its size in differences of diagonal entries. Zero and `P` for others.
fn isotropic_and_rest(
    graph: &mut Graph,
    deformation: &Deformation,
    lambda: Expr,
    P: &Matrix,
) -> (Expr, Matrix) {
    let lambda = zero_if_vanishing(graph, lambda);
    let pressure = graph.mul(lambda, deformation.log_J);
    if pressure == Graph::ZERO || Rule::PressureApart.is_off() {
        return (Graph::ZERO, P.clone());
    }
    let log_J = graph.symbol("ln J");
    let with_symbol = BTreeMap::from([(deformation.log_J, log_J)]);
    let without = BTreeMap::from([(log_J, Graph::ZERO)]);
    let once = deformation.transposed_gradient_times_inverse(graph);
    let mut derivatives = Derivatives::limited();
    let mut rest = P.clone();
    for (i, row) in rest.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let of_symbol = graph.replace(*entry, &with_symbol);
            let slope = derivatives.of(graph, of_symbol, log_J);
            if derivatives.of(graph, slope, log_J) != Graph::ZERO {
                return (Graph::ZERO, P.clone());
            }
            let normal = graph.mul(lambda, deformation.inverse_transpose[i][j]);
            let slope = graph.sub(slope, normal);
            let slope = zero_if_vanishing(graph, slope);
            let value = graph.replace(of_symbol, &without);
            let normal = graph.mul(slope, deformation.log_J);
            let turned = graph.mul(pressure, once[i][j]);
            let turned = graph.neg(turned);
            *entry = graph.sum_of([value, normal, turned]);
            *entry = zero_if_vanishing(graph, *entry);
        }
    }
    (pressure, rest)
}

/// Puts the rates of the deformation in symbols for the components of the rate of the displacement gradient, which it gives:
/// `d = sym(dF/dt F^-1)` and `dJ/dt = cof F : dF/dt`.
fn rates_in_components(
    graph: &mut Graph,
    h: &Matrix,
    replacement: &mut BTreeMap<Expr, Expr>,
) -> Matrix {
    let n = h.len();
    let mut F = h.clone();
    for (k, row) in F.iter_mut().enumerate() {
        row[k] = graph.add(Graph::ONE, row[k]);
    }
    let rates: Matrix = component_names("rate of h ", n)
        .iter()
        .map(|row| row.iter().map(|name| graph.symbol(name)).collect())
        .collect();
    let J = determinant(graph, &F);
    let mut cofactors = F.clone();
    for i in 0..n {
        for k in 0..n {
            cofactors[i][k] = cofactor(graph, &F, i, k);
        }
    }
    let terms: Vec<Expr> =
        (0..n * n).map(|m| graph.mul(cofactors[m / n][m % n], rates[m / n][m % n])).collect();
    let rate_of_J = graph.sum_of(terms);
    replacement.insert(graph.symbol("Jdot"), rate_of_J);
    // l = dF/dt F^-1 with F^-1 = cof(F)^T / J.
    let mut l = F.clone();
    for i in 0..n {
        for j in 0..n {
            let terms: Vec<Expr> =
                (0..n).map(|k| graph.mul(rates[i][k], cofactors[j][k])).collect();
            let sum = graph.sum_of(terms);
            l[i][j] = graph.div(sum, J);
        }
    }
    let two = graph.integer(2);
    for i in 0..n {
        for j in 0..n {
            replacement.insert(graph.symbol(&format!("Fdot{}{}", i + 1, j + 1)), rates[i][j]);
            let sum = graph.add(l[i][j], l[j][i]);
            let half = graph.div(sum, two);
            replacement.insert(graph.symbol(&format!("d{}{}", i + 1, j + 1)), half);
        }
    }
    rates
}

fn indices(n: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..n * n * n).map(move |m| (m / (n * n), m / n % n, m % n))
}

fn symbols(graph: &mut Graph, dimension: usize) -> Matrix {
    component_names("h ", dimension)
        .iter()
        .map(|row| row.iter().map(|name| graph.symbol(name)).collect())
        .collect()
}

/// The energy that `text` states, its constants in one piece.
pub(crate) fn named(
    graph: &mut Graph,
    text: &str,
    constants: &[(&'static Constant, Expr)],
) -> Expr {
    let Ok(ast) = Ast::parse(text) else { return Graph::ZERO };
    let energy = graph.build(&ast, &mut |graph, name| {
        let constant = constants.iter().find(|(known, _)| known.name == name);
        Ok(match constant {
            Some(&(_, value)) => graph.whole(value),
            None if [EXCESS, RATIO].contains(&name) => own_symbol(graph, name),
            None => graph.symbol(name),
        })
    });
    energy.unwrap_or(Graph::ZERO)
}

/// A number in the measures of a deformation, such as an energy, at this one.
pub(super) fn at_deformation(graph: &mut Graph, deformation: &Deformation, number: Expr) -> Expr {
    let h = symbols(graph, deformation.H.len());
    let Components { replacement, known, simpler } = in_components(graph, &h, deformation);
    let number = graph.replace(number, &replacement);
    let number = graph.replace(number, &simpler);
    let mut actual = known;
    actual.extend(h.into_iter().flatten().zip(deformation.H.iter().flatten().copied()));
    graph.replace(number, &actual)
}

/// Whether an energy is one of the invariants, and so isotropic.
pub(super) fn uses_invariants_only(graph: &mut Graph, energy: Expr, dimension: usize) -> bool {
    let symbols = graph.symbols_in(&[energy]);
    ["F", "C"]
        .iter()
        .flat_map(|letter| component_names(letter, dimension).concat())
        .all(|name| !symbols.contains(&graph.symbol(&name)))
}

/// Quantities that a law may be written in.
struct Components {
    /// `F`, `C`, `J`, `I1` and `I2` in the components of the displacement gradient.
    replacement: BTreeMap<Expr, Expr>,
    /// As in [`ComponentLaw`].
    known: BTreeMap<Expr, Expr>,
    simpler: BTreeMap<Expr, Expr>,
}

/// The components of the displacement gradient. Invariants are those of the deformation in space: nothing stretches along the
/// directions left out.
fn in_components(graph: &mut Graph, h: &Matrix, deformation: &Deformation) -> Components {
    let n = h.len();
    let mut replacement = BTreeMap::new();
    // G = C - I = H + H^T + H^T H
    let mut G = h.clone();
    for k in 0..n {
        for l in 0..n {
            let mut terms = vec![h[k][l], h[l][k]];
            terms.extend((0..n).map(|m| graph.mul(h[m][k], h[m][l])));
            G[k][l] = graph.sum_of(terms);
        }
    }
    for (letter, small) in [("F", h), ("C", &G)] {
        for (k, row) in component_names(letter, n).iter().enumerate() {
            for (l, name) in row.iter().enumerate() {
                let diagonal = if k == l { Graph::ONE } else { Graph::ZERO };
                replacement.insert(graph.symbol(name), graph.add(diagonal, small[k][l]));
            }
        }
    }
    // Nothing stretches along the directions left out.
    for (k, row) in component_names("C", 3).iter().enumerate() {
        for (l, name) in row.iter().enumerate().filter(|(l, _)| k.max(*l) >= n) {
            let entry = if k == l { Graph::ONE } else { Graph::ZERO };
            replacement.insert(graph.symbol(name), entry);
        }
    }
    let minors = principal_minors(graph, h);
    let volume_change = graph.sum_of(minors);
    let J = graph.add(Graph::ONE, volume_change);
    let trace = graph.sum_of((0..n).map(|k| G[k][k]));
    // I2 - 3 = 2 tr G + ((tr G)^2 - G : G)/2, and half the bracket is the sum of the second-order minors of G.
    let mut terms = vec![trace, trace];
    for k in 0..n {
        for l in k + 1..n {
            let (normal, shear) = (graph.mul(G[k][k], G[l][l]), graph.mul(G[k][l], G[l][k]));
            terms.push(graph.sub(normal, shear));
        }
    }
    let second = graph.sum_of(terms);
    let three = graph.integer(3);
    let (I1, I2) = (graph.add(three, trace), graph.add(three, second));
    for (name, value) in INVARIANTS.iter().zip([J, I1, I2]) {
        replacement.insert(graph.symbol(name), value);
    }
    let log_J = graph.call(Function::Ln1p, &[volume_change]);
    // Quotients by a product of stretches cancel with the stretches above them; left to rounding they would not where
    // a stretch almost vanishes.
    let mut present = h.clone();
    let mut simpler = BTreeMap::new();
    for (h, H) in present.iter_mut().flatten().zip(deformation.H.iter().flatten()) {
        if *H == Graph::ZERO {
            simpler.insert(std::mem::replace(h, Graph::ZERO), Graph::ZERO);
        }
    }
    for (k, row) in present.iter_mut().enumerate() {
        row[k] = graph.add(Graph::ONE, row[k]);
    }
    if matches!(graph.node(deformation.J), Node::Product(_)) && !Rule::Quotients.is_off() {
        let product = determinant(graph, &present);
        let volume_change = graph.replace(volume_change, &simpler);
        simpler.insert(J, product);
        let mut derivatives = Derivatives::limited();
        for (k, row) in h.iter().enumerate() {
            let cofactor = cofactor(graph, &present, k, k);
            if matches!(graph.node(cofactor), Node::Product(_)) {
                simpler.insert(derivatives.of(graph, J, row[k]), cofactor);
            }
        }
        let log_of_product = graph.call(Function::LnOfBoth, &[volume_change, product]);
        simpler.extend([(log_J, log_of_product), (graph.call(Function::Ln, &[J]), log_of_product)]);
    }
    let known = [
        (J, deformation.J),
        (volume_change, deformation.volume_change),
        (log_J, deformation.log_J),
        // Where nothing is split at zero, as in shear stresses, the logarithm stands as it was written.
        (graph.call(Function::Ln, &[J]), deformation.log_J),
    ];
    let known = known.map(|(of_components, own)| (graph.replace(of_components, &simpler), own));
    Components { replacement, known: known.into(), simpler }
}
