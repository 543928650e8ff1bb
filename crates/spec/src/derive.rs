//! The derivation: displacement and material in, every field out.
//!
//! Everything is derived in the specification's own coordinates, on physical components, so that the structure of
//! the solution survives: a radial motion in polar coordinates has a diagonal deformation gradient. The turn to
//! Cartesian components comes last.
//!
//! For the body force, the divergence of the stress comes in two parts, that of the part linear in the displacement
//! gradient and that of the rest, each formed so that it keeps digits where the deformation is small. The linear
//! part is joined with the acceleration in symbols, where the two may cancel identically.

use crate::Spec;
use crate::coordinates::{Geometry, identity, turn_vector};
use crate::derivation::{Derivation, is_joined};
use crate::law::{self, Deformation, Stress, inside, zero_if_vanishing};
use crate::surface::{Components, SurfaceFields, surface_fields};
use crate::tensor::{Matrix, Vector};
use mmsmith_expr::{Dependence, Expr, Graph, Program, Rule};
use std::collections::BTreeMap;
use thiserror::Error;

/// Every field of a solution, in Cartesian components, as expressions of the graph.
///
/// Indices of matrices: row `i` is the spatial, column `J` the reference direction.
#[derive(Clone, Debug)]
pub struct Fields {
    /// The graph that the expressions belong to.
    pub graph: Graph,
    /// The Cartesian coordinates, the time, and the parameters, with what each of them is; program inputs.
    pub inputs: Vec<(Expr, Dependence)>,
    /// Definitions of further symbols, such as the polar radius.
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
    /// First Piola-Kirchhoff stress; empty where it depends on the [`history`](Self::history).
    pub P: Matrix,
    /// Body force per unit mass; empty where it depends on the [`history`](Self::history).
    pub b: Vector,
    /// Fields from which the history of internal variables follows, for a law that has some.
    pub history: Option<HistoryFields>,
    /// Strain energy per reference volume, where the material is given by one.
    pub W: Option<Expr>,
    /// The stretch along the directions left out, where there is no stress along them; elsewhere it is one.
    pub across: Option<Expr>,
    /// The derivatives of the stress, where they were asked for: `[k][L]` is that of `P` with respect to `F_kL`.
    pub tangent: Vec<Vec<Matrix>>,
    /// Tractions and the claims of boundary conditions, for every surface of the body.
    pub surfaces: Vec<SurfaceFields>,
}

/// The motion as histories of internal variables need it, in physical components of the specification's own coordinates: at a particle
/// these are Cartesian components in a frame that stays.
#[derive(Clone, Debug)]
pub struct HistoryFields {
    /// Acceleration.
    pub a: Vector,
    /// Deformation gradient.
    pub F: Matrix,
    /// `dF/dt`.
    pub rate: Matrix,
    /// `[J][i][K]`: the derivative of `F_iK` along direction `J`.
    pub slopes: Vec<Matrix>,
    /// `[J][i][K]`: the derivative of `dF_iK/dt` along direction `J`.
    pub slopes_of_rate: Vec<Matrix>,
    /// `[i][a]`: Cartesian component `i` of the unit vector `a`.
    pub frame: Matrix,
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
    /// The law has no closed form for this deformation.
    #[error("{0}")]
    NoClosedForm(&'static str),
    /// The fields are larger than any that could be of use.
    #[error(
        "the fields of this solution grow too large to derive: {nodes} nodes of the expression graph"
    )]
    TooLarge {
        /// The nodes made until then.
        nodes: usize,
    },
}

impl Fields {
    /// The fields of an axisymmetric body at the angle zero, where Cartesian components are those along `R`, the angle and `Z`: as
    /// [`Spec::derive_for_hosts`] has them, of fields that were changed in space.
    #[must_use]
    pub fn at_angle_zero(mut self) -> Self {
        let graph = &mut self.graph;
        let [X, Y] = ["X", "Y"].map(|name| graph.symbol(name));
        let [R, theta] = ["R", "theta"].map(|name| graph.symbol(name));
        let place = BTreeMap::from([(Y, Graph::ZERO), (R, X), (theta, Graph::ZERO)]);
        let mut at = |expr: &mut Expr| *expr = graph.replace(*expr, &place);
        let matrices = [&mut self.H, &mut self.F, &mut self.P].into_iter();
        let matrices = matrices.chain(self.tangent.iter_mut().flatten());
        matrices.flatten().flatten().for_each(&mut at);
        [&mut self.u, &mut self.v, &mut self.a, &mut self.b]
            .into_iter()
            .flatten()
            .for_each(&mut at);
        [&mut self.J].into_iter().chain(&mut self.W).chain(&mut self.across).for_each(&mut at);
        for surface in &mut self.surfaces {
            surface.traction.iter_mut().for_each(&mut at);
            surface.claims.iter_mut().flat_map(|claim| &mut claim.quantities).for_each(&mut at);
        }
        self.definitions.clear();
        self
    }

    /// The straight-line program that computes `outputs` from the inputs.
    #[must_use]
    pub fn program(&mut self, outputs: &[Expr]) -> Program {
        Program::lower(&mut self.graph, &self.inputs, &self.definitions, outputs)
    }

    pub(crate) fn derive(spec: &Spec) -> Result<Self, DeriveError> {
        Self::derive_in(spec, Derivation::new(spec))
    }

    /// In the coordinates of a derivation.
    pub(crate) fn derive_in(spec: &Spec, derivation: Derivation) -> Result<Self, DeriveError> {
        Self::derive_all(spec, derivation, false)
    }

    /// With the derivatives of the stress.
    pub(crate) fn derive_with_tangent(spec: &Spec) -> Result<Self, DeriveError> {
        Self::derive_all(spec, Derivation::new(spec), true)
    }

    fn derive_all(
        spec: &Spec,
        mut derivation: Derivation,
        has_tangent: bool,
    ) -> Result<Self, DeriveError> {
        let time = derivation.time;
        let n = spec.dimension;

        let u = spec.displacement.clone();
        let v: Vector = u.iter().map(|&u| derivation.derivative(u, time)).collect();
        let a: Vector = v.iter().map(|&v| derivation.derivative(v, time)).collect();
        let H = derivation.gradient(&u);
        let deformation = Deformation::new(&mut derivation, &u, H.clone());
        if spec.has_history() && !has_tangent {
            return Self::derive_motion(spec, derivation, [u, v, a], H, deformation.J);
        }
        let stress = law::stress(&mut derivation, &deformation, spec)?;
        let across = law::stretch_across(&mut derivation, &deformation, spec);
        let tangent = match has_tangent {
            true => law::tangent(&mut derivation, &deformation, spec)?,
            false => Vec::new(),
        };
        let b = body_force(&mut derivation, &a, &stress, spec.density);

        if derivation.graph.is_overgrown() {
            return Err(DeriveError::TooLarge { nodes: derivation.graph.len() });
        }
        let Derivation { mut graph, geometry, .. } = derivation;
        let vector = |graph: &mut Graph, x: &Vector| turn_vector(graph, &geometry, x);
        let u = vector(&mut graph, &u);
        let v = vector(&mut graph, &v);
        let a = vector(&mut graph, &a);
        let b = vector(&mut graph, &b);
        let H = turn_matrix(&mut graph, &geometry, &H);
        let mut P = stress.P.clone();
        if !geometry.is_cartesian() {
            P = turn_matrix(&mut graph, &geometry, &stress.anisotropic);
            let isotropic = geometry.without_angles(&mut graph, stress.isotropic);
            for (i, row) in P.iter_mut().enumerate() {
                row[i] = graph.add(isotropic, row[i]);
            }
        }
        let W = stress.energy.map(|W| geometry.without_angles(&mut graph, W));
        let across = across.map(|stretch| geometry.without_angles(&mut graph, stretch));
        let J = geometry.without_angles(&mut graph, deformation.J);
        let mut F = H.clone();
        for i in 0..n {
            F[i][i] = graph.add(Graph::ONE, H[i][i]);
        }

        let components = Components { own_u: &spec.displacement, own_P: &stress.P, u: &u, P: &P };
        let surfaces = surface_fields(&mut graph, &geometry, spec, &components);

        let inputs = inputs(spec, &mut graph, &geometry, time);
        let definitions = geometry.definitions;
        let history = None;
        let mut fields = Fields {
            graph,
            inputs,
            definitions,
            u,
            v,
            a,
            H,
            F,
            J,
            P,
            b,
            history,
            W,
            across,
            tangent,
            surfaces,
        };
        if let Some(rotation) = &spec.rotation {
            rotation.apply(&mut fields, &geometry.cartesian, time);
        }
        fields.check()?;
        Ok(fields)
    }

    /// The fields of a law with internal variables, without stresses: these follow from the history of each particle.
    fn derive_motion(
        spec: &Spec,
        mut derivation: Derivation,
        [u, v, a]: [Vector; 3],
        H: Matrix,
        J: Expr,
    ) -> Result<Self, DeriveError> {
        let time = derivation.time;
        let mut rate = H.clone();
        for entry in rate.iter_mut().flatten() {
            *entry = derivation.derivative(*entry, time);
        }
        let slopes = by_direction(&derivation.second_gradient(&H, true));
        let slopes_of_rate = by_direction(&derivation.second_gradient(&rate, true));
        if derivation.graph.is_overgrown() {
            return Err(DeriveError::TooLarge { nodes: derivation.graph.len() });
        }
        let Derivation { mut graph, geometry, .. } = derivation;
        let with_identity = |graph: &mut Graph, H: &Matrix| {
            let mut F = H.clone();
            for (i, row) in F.iter_mut().enumerate() {
                row[i] = graph.add(Graph::ONE, row[i]);
            }
            F
        };
        let own_F = with_identity(&mut graph, &H);
        let history = HistoryFields {
            a: a.clone(),
            F: own_F,
            rate,
            slopes,
            slopes_of_rate,
            frame: geometry.rotation.clone(),
        };
        let vector = |graph: &mut Graph, x: &Vector| turn_vector(graph, &geometry, x);
        let (u, v, a) = (vector(&mut graph, &u), vector(&mut graph, &v), vector(&mut graph, &a));
        let H = if geometry.is_cartesian() { H } else { turn_matrix(&mut graph, &geometry, &H) };
        let F = with_identity(&mut graph, &H);
        let J = geometry.without_angles(&mut graph, J);
        let inputs = inputs(spec, &mut graph, &geometry, time);
        let definitions = geometry.definitions;
        let (P, b, surfaces) = (Matrix::new(), Vector::new(), Vec::new());
        let history = Some(history);
        let (W, across) = (None, None);
        let fields = Fields {
            graph,
            inputs,
            definitions,
            u,
            v,
            a,
            H,
            F,
            J,
            P,
            b,
            history,
            W,
            across,
            tangent: Vec::new(),
            surfaces,
        };
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

/// The coordinates, the time and the parameters, with what each of them is.
fn inputs(
    spec: &Spec,
    graph: &mut Graph,
    geometry: &Geometry,
    time: Expr,
) -> Vec<(Expr, Dependence)> {
    let rate = |position, time| Dependence { position, time };
    let mut inputs: Vec<(Expr, Dependence)> =
        geometry.cartesian.iter().map(|&X| (X, rate(true, false))).collect();
    inputs.push((time, rate(false, true)));
    for parameter in &spec.parameters {
        inputs.push((graph.symbol(&parameter.name), rate(false, false)));
    }
    inputs
}

/// From `[k][L][J]` to `[J][k][L]`.
fn by_direction(gradient: &[Matrix]) -> Vec<Matrix> {
    let n = gradient.len();
    let of = |J: usize| {
        gradient.iter().map(|rows| rows.iter().map(|row| row[J]).collect()).collect::<Matrix>()
    };
    (0..n).map(of).collect()
}

/// `b = [a - Div P_linear / rho0] - Div P_remainder / rho0`, the bracket joined in symbols. Where nothing of it joins, the divergence
/// is not split, if it has a form of its own.
fn body_force(derivation: &mut Derivation, a: &Vector, stress: &Stress, density: Expr) -> Vector {
    let Derivation { graph, variables, .. } = derivation;
    let density = graph.whole(density);
    let open_density = inside(graph, density);
    let mut b = Vec::new();
    for i in 0..a.len() {
        let force = graph.div(stress.linear[i], open_density);
        let bracket = graph.sub(a[i], force);
        let bracket = graph.cancel(bracket, variables);
        let (bracket, rest) = match &stress.whole {
            Some(whole)
                if !Rule::WholeDivergence.is_off()
                    && !is_joined(graph, bracket, [a[i], force], variables) =>
            {
                (a[i], whole[i])
            }
            _ => (bracket, stress.remainder[i]),
        };
        let bracket = graph.whole(bracket);
        let rest = zero_if_vanishing(graph, rest);
        let rest = graph.div(rest, density);
        let component = graph.sub(bracket, rest);
        b.push(zero_if_vanishing(graph, component));
    }
    b
}

/// Physical components to Cartesian ones: `A_ij = sum_ab Q_ia A_ab Q_jb`.
fn turn_matrix(graph: &mut Graph, geometry: &Geometry, matrix: &Matrix) -> Matrix {
    let n = geometry.dimension();
    // With equal diagonal entries for both angles these need not be told apart, which nobody can on the axis.
    let isotropic =
        !Rule::Transverse.is_off() && geometry.transverse.is_some() && matrix[1][1] == matrix[2][2];
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
            turned[i][j] = geometry.without_angles(graph, component);
        }
    }
    turned
}
