//! Faults planted in the fields, for authors who test their own tests: code with a fault must fail them.
//!
//! Each fault is a mistake that published codes carry. It changes derived fields, so that generated code has the same mistake in every
//! language.

use mmsmith_expr::{Derivatives, Expr, Graph, Rational};
use mmsmith_spec::{Coordinates, Domain, Fields, Law, Spec};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A mistake in the fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// `-b`.
    BodyForceSign,
    /// `rho0 b`, a force per volume in place of a force per mass.
    BodyForcePerVolume,
    /// `b/J`, per current volume.
    BodyForcePerCurrentVolume,
    /// `b` at a time that is a hundredth of the period later.
    BodyForceLate,
    /// `b` at `x = X + u` in place of `X`.
    BodyForceAtCurrentPosition,
    /// `b - a`.
    BodyForceWithoutInertia,
    /// `b = a`.
    BodyForceWithoutStress,
    /// The first two components of `b` exchanged.
    BodyForceExchanged,
    /// `b` from the divergence of `P^T`.
    BodyForceOfTransposedStress,
    /// `b` from the divergence of `J P`: the Kirchhoff stress taken for the Cauchy stress.
    BodyForceOfKirchhoffStress,
    /// `b` of a body whose density is one.
    BodyForceOfDensityOne,
    /// `lambda` and `mu` exchanged in `P`, `b` and tractions.
    LameExchanged,
    /// `lambda` of plane stress, which means another Poisson's ratio, in `P`, `b` and tractions.
    LameOfPlaneStress,
    /// `-P`.
    StressSign,
    /// `P^T`.
    StressTransposed,
    /// The Cauchy stress `P F^T/J` for `P`.
    StressCauchy,
    /// The Kirchhoff stress `P F^T` for `P`.
    StressKirchhoff,
    /// Tractions that are zero.
    TractionDropped,
    /// Tractions with the sign turned.
    TractionSign,
    /// `v` at a time that is a hundredth of the period later.
    VelocityLate,
    /// `-a`.
    AccelerationSign,
    /// `F^T`, and `H^T`.
    GradientTransposed,
    /// `1 + tr H` for `J`.
    JacobianLinear,
}

/// A fault that changes no field of a solution, so that no test can find it there.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("the fault {fault} changes no field of {solution}: no test can find it with this solution")]
pub struct NoEffect {
    /// The name of the fault.
    pub fault: String,
    /// The name of the solution.
    pub solution: String,
}

impl Fault {
    /// Every fault.
    pub const ALL: [Fault; 23] = [
        Fault::BodyForceSign,
        Fault::BodyForcePerVolume,
        Fault::BodyForcePerCurrentVolume,
        Fault::BodyForceLate,
        Fault::BodyForceAtCurrentPosition,
        Fault::BodyForceWithoutInertia,
        Fault::BodyForceWithoutStress,
        Fault::BodyForceExchanged,
        Fault::BodyForceOfTransposedStress,
        Fault::BodyForceOfKirchhoffStress,
        Fault::BodyForceOfDensityOne,
        Fault::LameExchanged,
        Fault::LameOfPlaneStress,
        Fault::StressSign,
        Fault::StressTransposed,
        Fault::StressCauchy,
        Fault::StressKirchhoff,
        Fault::TractionDropped,
        Fault::TractionSign,
        Fault::VelocityLate,
        Fault::AccelerationSign,
        Fault::GradientTransposed,
        Fault::JacobianLinear,
    ];

    /// The name on command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Fault::BodyForceSign => "body-force-sign",
            Fault::BodyForcePerVolume => "body-force-per-volume",
            Fault::BodyForcePerCurrentVolume => "body-force-per-current-volume",
            Fault::BodyForceLate => "body-force-late",
            Fault::BodyForceAtCurrentPosition => "body-force-at-current-position",
            Fault::BodyForceWithoutInertia => "body-force-without-inertia",
            Fault::BodyForceWithoutStress => "body-force-without-stress",
            Fault::BodyForceExchanged => "body-force-exchanged",
            Fault::BodyForceOfTransposedStress => "body-force-of-transposed-stress",
            Fault::BodyForceOfKirchhoffStress => "body-force-of-kirchhoff-stress",
            Fault::BodyForceOfDensityOne => "body-force-of-density-one",
            Fault::LameExchanged => "lame-exchanged",
            Fault::LameOfPlaneStress => "lame-of-plane-stress",
            Fault::StressSign => "stress-sign",
            Fault::StressTransposed => "stress-transposed",
            Fault::StressCauchy => "stress-cauchy",
            Fault::StressKirchhoff => "stress-kirchhoff",
            Fault::TractionDropped => "traction-dropped",
            Fault::TractionSign => "traction-sign",
            Fault::VelocityLate => "velocity-late",
            Fault::AccelerationSign => "acceleration-sign",
            Fault::GradientTransposed => "gradient-transposed",
            Fault::JacobianLinear => "jacobian-linear",
        }
    }

    /// The mistake in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Fault::BodyForceSign => "-b",
            Fault::BodyForcePerVolume => "rho0 b, a force per volume",
            Fault::BodyForcePerCurrentVolume => "b/J",
            Fault::BodyForceLate => "b a hundredth of the period late",
            Fault::BodyForceAtCurrentPosition => "b at x = X + u in the place of X",
            Fault::BodyForceWithoutInertia => "b - a",
            Fault::BodyForceWithoutStress => "b = a",
            Fault::BodyForceExchanged => "the first two components of b exchanged",
            Fault::BodyForceOfTransposedStress => "b from the divergence of P^T",
            Fault::BodyForceOfKirchhoffStress => "b from the divergence of J P",
            Fault::BodyForceOfDensityOne => "b of a body whose density is one",
            Fault::LameExchanged => "lambda and mu exchanged in P, b and tractions",
            Fault::LameOfPlaneStress => "lambda of plane stress in P, b and tractions",
            Fault::StressSign => "-P",
            Fault::StressTransposed => "P transposed",
            Fault::StressCauchy => "the Cauchy stress P F^T/J for P",
            Fault::StressKirchhoff => "the Kirchhoff stress P F^T for P",
            Fault::TractionDropped => "tractions of zero",
            Fault::TractionSign => "tractions with the sign turned",
            Fault::VelocityLate => "v a hundredth of the period late",
            Fault::AccelerationSign => "-a",
            Fault::GradientTransposed => "F and H transposed",
            Fault::JacobianLinear => "J = 1 + tr H",
        }
    }

    /// Plants the fault in the fields of `spec`.
    ///
    /// # Errors
    ///
    /// [`NoEffect`] where all fields stay as they are.
    pub fn plant(self, spec: &Spec, fields: &mut Fields) -> Result<(), NoEffect> {
        let changed = has_effect(spec, fields, all, |fields| self.change(spec, fields));
        let none = NoEffect { fault: self.name().to_owned(), solution: spec.name.clone() };
        changed.then_some(()).ok_or(none)
    }

    fn change(self, spec: &Spec, f: &mut Fields) {
        let n = spec.dimension;
        let graph = &mut f.graph;
        let stress = f.P.clone();
        let kirchhoff = |graph: &mut Graph, i: usize, j: usize| {
            let terms: Vec<Expr> = (0..n).map(|m| graph.mul(stress[i][m], f.F[j][m])).collect();
            graph.sum_of(terms)
        };
        match self {
            Fault::BodyForceSign => negate(graph, &mut f.b),
            Fault::BodyForcePerVolume => {
                f.b.iter_mut().for_each(|b| *b = graph.mul(*b, spec.density));
            }
            Fault::BodyForcePerCurrentVolume => {
                f.b.iter_mut().for_each(|b| *b = graph.div(*b, f.J));
            }
            Fault::BodyForceLate => delay(graph, spec, &mut f.b),
            Fault::BodyForceAtCurrentPosition => {
                let coordinates: Vec<Expr> = f.inputs[..n].iter().map(|(X, _)| *X).collect();
                let current: BTreeMap<Expr, Expr> =
                    coordinates.iter().zip(&f.u).map(|(&X, &u)| (X, graph.add(X, u))).collect();
                // First the meanings of other symbols, such as the radius, so that they move with the coordinates.
                let definitions: BTreeMap<Expr, Expr> = f.definitions.iter().copied().collect();
                for b in &mut f.b {
                    let explicit = graph.replace(*b, &definitions);
                    *b = graph.replace(explicit, &current);
                }
            }
            Fault::BodyForceWithoutInertia => {
                f.b.iter_mut().zip(&f.a).for_each(|(b, a)| *b = graph.sub(*b, *a));
            }
            Fault::BodyForceWithoutStress => f.b = f.a.clone(),
            Fault::BodyForceExchanged => swap_first_two(spec, &mut f.b),
            Fault::BodyForceOfTransposedStress => balance(f, &transposed(&stress), spec.density),
            Fault::BodyForceOfKirchhoffStress => {
                let row = |row: &Vec<Expr>| row.iter().map(|&P| graph.mul(f.J, P)).collect();
                let stress: Vec<Vec<Expr>> = stress.iter().map(row).collect();
                balance(f, &stress, spec.density);
            }
            Fault::BodyForceOfDensityOne => balance(f, &stress, Graph::ONE),
            Fault::LameExchanged => with_constants(spec, f, |_, lambda, mu| (mu, lambda)),
            Fault::LameOfPlaneStress => with_constants(spec, f, |graph, lambda, mu| {
                let [twice, sum] = [graph.sum_of([mu, mu]), graph.sum_of([lambda, mu, mu])];
                let product = graph.mul(lambda, twice);
                (graph.div(product, sum), mu)
            }),
            Fault::StressSign => f.P.iter_mut().for_each(|row| negate(graph, row)),
            Fault::StressTransposed => f.P = transposed(&f.P),
            Fault::StressKirchhoff => {
                f.P = (0..n).map(|i| (0..n).map(|j| kirchhoff(graph, i, j)).collect()).collect();
            }
            Fault::StressCauchy => {
                let cauchy = |graph: &mut Graph, i: usize, j: usize| {
                    let kirchhoff = kirchhoff(graph, i, j);
                    graph.div(kirchhoff, f.J)
                };
                f.P = (0..n).map(|i| (0..n).map(|j| cauchy(graph, i, j)).collect()).collect();
            }
            Fault::TractionDropped => {
                f.surfaces.iter_mut().for_each(|surface| surface.traction.fill(Graph::ZERO));
            }
            Fault::TractionSign => {
                f.surfaces.iter_mut().for_each(|surface| negate(graph, &mut surface.traction));
            }
            Fault::VelocityLate => delay(graph, spec, &mut f.v),
            Fault::AccelerationSign => negate(graph, &mut f.a),
            Fault::GradientTransposed => {
                (f.F, f.H) = (transposed(&f.F), transposed(&f.H));
            }
            Fault::JacobianLinear => {
                let terms = std::iter::once(Graph::ONE).chain((0..n).map(|i| f.H[i][i]));
                f.J = graph.sum_of(terms);
            }
        }
    }
}

/// A word that is not the name of a fault.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no fault '{0}'")]
pub struct UnknownFault(String);

impl FromStr for Fault {
    type Err = UnknownFault;

    /// The fault of a name, in which `b-` may stand for `body-force-`.
    fn from_str(name: &str) -> Result<Self, UnknownFault> {
        let is_named = |fault: &Fault| {
            let of_b = fault.name().strip_prefix("body-force-");
            fault.name() == name || of_b.is_some_and(|rest| name.strip_prefix("b-") == Some(rest))
        };
        let known = Fault::ALL.into_iter().find(is_named);
        known.ok_or_else(|| UnknownFault(name.to_owned()))
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Whether a change of the fields of `spec` shows in the given expressions, before and after the change.
pub(crate) fn has_effect(
    spec: &Spec,
    fields: &mut Fields,
    looked_at: impl FnOnce(&Fields, &Fields) -> [Vec<Expr>; 2],
    change: impl FnOnce(&mut Fields),
) -> bool {
    let before = fields.clone();
    change(fields);
    let [before, after] = looked_at(&before, fields);
    before != after && is_noticed(spec, fields, &before, &after)
}

fn all(before: &Fields, after: &Fields) -> [Vec<Expr>; 2] {
    [before, after].map(outputs)
}

/// Exchanges the first two components of a vector; of a body of revolution the radial and the axial one, which solvers of the half plane have.
pub(crate) fn swap_first_two(spec: &Spec, vector: &mut [Expr]) {
    let other = second_of(spec);
    if vector.len() > other {
        vector.swap(0, other);
    }
}

/// The place of the second component that a solver has.
pub(crate) fn second_of(spec: &Spec) -> usize {
    if spec.coordinates == Coordinates::Axisymmetric { 2 } else { 1 }
}

/// All outputs of generated code that depend on position and time.
fn outputs(fields: &Fields) -> Vec<Expr> {
    let Fields { u, v, a, H, F, J, P, b, W, surfaces, .. } = fields;
    let matrices = [H, F, P].into_iter().flatten().flatten();
    let vectors = [u, v, a, b].into_iter().flatten();
    let tractions = surfaces.iter().flat_map(|surface| &surface.traction);
    matrices.chain(vectors).chain(tractions).chain([J]).chain(W).copied().collect()
}

/// Smaller differences, in units of the largest value, are rounding: the same value in another form.
const NOTICED: f64 = 1e-9;

/// Whether values differ at places within the body, with parameters next to their defaults.
fn is_noticed(spec: &Spec, fields: &mut Fields, before: &[Expr], after: &[Expr]) -> bool {
    let n = spec.dimension;
    // Parameters next to their defaults, since some defaults are one.
    let defaults = spec.parameters.iter().enumerate();
    let defaults = defaults.map(|(i, p)| p.default * (0.97 - 0.02 * (i % 5) as f64));
    let measures = match &spec.domain {
        Domain::Box { lower, upper } => [lower.clone(), upper.clone()],
        // Along the diagonal from the inner to the outer surface; the axis is as good as any other place.
        Domain::Annulus { inner, outer } => {
            let root = fields.graph.number(Rational::new(7.into(), 10.into()));
            [inner, outer].map(|&radius| vec![fields.graph.mul(root, radius); n])
        }
        Domain::Tube { inner, outer, lower, upper, .. } => {
            let root = fields.graph.number(Rational::new(7.into(), 10.into()));
            [(inner, lower), (outer, upper)].map(|(&radius, &height)| {
                let X = fields.graph.mul(root, radius);
                vec![X, X, height]
            })
        }
    };
    let corners = measures.concat();
    let constants: Vec<Expr> = corners.into_iter().chain([spec.period]).collect();
    let nowhere = vec![0.0; n + 1];
    let at_defaults: Vec<f64> = nowhere.into_iter().chain(defaults.clone()).collect();
    let constants = fields.program(&constants).evaluate(&at_defaults);
    let (lower, rest) = constants.split_at(n);
    let (upper, period) = rest.split_at(n);
    let program = fields.program(&[before, after].concat());
    [0.21, 0.46, 0.83].into_iter().any(|share| {
        let place = (0..n).map(|i| {
            // Not on a diagonal, where components may agree.
            let share = (share + 0.17 * i as f64).fract();
            lower[i] + share * (upper[i] - lower[i])
        });
        let time = period.iter().map(|period| 0.37 * share * period);
        let inputs: Vec<f64> = place.chain(time).chain(defaults.clone()).collect();
        let values = program.evaluate(&inputs);
        let (before, after) = values.split_at(before.len());
        before
            .iter()
            .zip(after)
            .any(|(before, after)| (before - after).abs() > NOTICED * before.abs().max(after.abs()))
    })
}

/// Sets `b` to the body force that balances a stress: `a - Div P/rho0`.
pub(crate) fn balance(fields: &mut Fields, stress: &[Vec<Expr>], density: Expr) {
    let Fields { graph, definitions, inputs, a, b, .. } = fields;
    // In the coordinates alone, so that derivatives see every dependence.
    let definitions: BTreeMap<Expr, Expr> = definitions.iter().copied().collect();
    let mut derivatives = Derivatives::default();
    for (i, row) in stress.iter().enumerate() {
        let terms: Vec<Expr> = row
            .iter()
            .zip(inputs.iter())
            .map(|(&P, &(X, _))| {
                let explicit = graph.replace(P, &definitions);
                derivatives.of(graph, explicit, X)
            })
            .collect();
        let divergence = graph.sum_of(terms);
        let by_mass = graph.div(divergence, density);
        b[i] = graph.sub(a[i], by_mass);
    }
}

/// Derives the fields with other Lame constants. The fields stay where the law has no such constants, or no fields with them.
fn with_constants(
    spec: &Spec,
    fields: &mut Fields,
    change: impl Fn(&mut Graph, Expr, Expr) -> (Expr, Expr),
) {
    let Law::Library(material) = spec.material else { return };
    let constants = spec.material.constants();
    let named =
        |name: &str| constants.iter().find(|(own, _)| own.name == name).map(|(_, value)| *value);
    let (Some(lambda), Some(mu)) = (named("lambda"), named("mu")) else { return };
    // In the same graph, so that fields can be compared.
    let mut changed = Spec { graph: fields.graph.clone(), ..spec.clone() };
    let (other_lambda, other_mu) = change(&mut changed.graph, lambda, mu);
    changed.material = Law::Library(material.map_named(|name, value| match name {
        "lambda" => other_lambda,
        "mu" => other_mu,
        _ => value,
    }));
    if let Ok(derived) = changed.derive() {
        *fields = derived;
    }
}

fn negate(graph: &mut Graph, vector: &mut [Expr]) {
    vector.iter_mut().for_each(|entry| *entry = graph.neg(*entry));
}

fn transposed(matrix: &[Vec<Expr>]) -> Vec<Vec<Expr>> {
    (0..matrix.len()).map(|i| matrix.iter().map(|row| row[i]).collect()).collect()
}

/// The entries at a time that is a hundredth of the period later.
fn delay(graph: &mut Graph, spec: &Spec, vector: &mut [Expr]) {
    let t = graph.symbol("t");
    let hundredth = graph.number(Rational::new(1.into(), 100.into()));
    let delay = graph.mul(hundredth, spec.period);
    let late = graph.add(t, delay);
    let later = BTreeMap::from([(t, late)]);
    vector.iter_mut().for_each(|entry| *entry = graph.replace(*entry, &later));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    #[test]
    fn faults_of_b_have_two_names() {
        assert_eq!("b-sign".parse::<Fault>().unwrap().name(), "body-force-sign");
        for name in ["sign", "b-", "b-b-sign", "body-force"] {
            assert!(name.parse::<Fault>().is_err(), "{name}");
        }
    }

    /// The body force balances the right stress, in every kind of coordinates.
    #[test]
    fn the_balance_of_the_right_stress_is_the_body_force() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
        for name in ["skew-2d", "vortex", "ring-nu", "torsion", "sphere-shell"] {
            let text = fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
            let spec = Spec::parse(&text, name).unwrap();
            let mut fields = spec.derive().unwrap();
            let (before, stress) = (outputs(&fields), fields.P.clone());
            balance(&mut fields, &stress, spec.density);
            let after = outputs(&fields);
            assert_ne!(before, after, "{name}: another form");
            assert!(!is_noticed(&spec, &mut fields, &before, &after), "{name}");
        }
    }
}
