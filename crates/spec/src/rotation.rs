//! `[with-rotation]`: a rigid rotation about the origin, superposed on a solution.
//!
//! With `x' = Q(t) x` the other fields follow: `u' = Q u + (Q - I) X`, `F' = Q F`, `P' = Q P` for every law that is
//! indifferent to rotations, and `b' = a' - Q (a - b)` with `a' = Q a + 2 Q' v + Q'' x`, formed as
//! `b' = Q b + 2 Q' v + Q'' x`: where `a` and `b` are nearly equal nothing is lost. `cos - 1` is `-2 sin^2` of half the angle.

use crate::coordinates::CARTESIAN;
use crate::derive::Fields;
use crate::document::{BoundaryTable, RotationTable};
use crate::law::energy::component_names;
use crate::scope::Scope;
use crate::tensor::Matrix;
use crate::{Boundary, ComponentCondition, Condition, Diagnostic, Law};
use mmsmith_expr::{Derivatives, Expr, Function, Graph};
use std::collections::BTreeSet;
use toml::Spanned;

/// A rigid rotation about the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rotation {
    /// The angle in radians, right-handed, an expression of time and parameters.
    pub angle: Expr,
    /// The Cartesian axis that stays where it is, 2 in the plane.
    pub axis: usize,
}

impl Rotation {
    pub(crate) fn read(
        scope: &mut Scope<'_>,
        table: &Spanned<RotationTable>,
        dimension: usize,
    ) -> Result<Self, Diagnostic> {
        if dimension == 1 {
            let message = "there is no rotation in one dimension";
            return Err(scope.source.error(message, table.span(), None));
        }
        let keys = table.get_ref();
        let axis = match &keys.axis {
            None => 2,
            Some(name) => {
                let known: &[&str] = if dimension == 2 { &CARTESIAN[2..] } else { &CARTESIAN };
                if !known.contains(&name.get_ref().as_str()) {
                    let message = format!("there is no axis '{}' to rotate about", name.get_ref());
                    let help = match dimension {
                        2 => "in the plane leave it out, or write axis = 'Z'",
                        _ => "axis = 'X', 'Y' or 'Z'",
                    };
                    return Err(scope.source.error(message, name.span(), Some(help.into())));
                }
                CARTESIAN.iter().position(|axis| axis == name.get_ref()).unwrap_or(2)
            }
        };
        let angle = scope.expression(&keys.angle)?;
        let places: BTreeSet<Expr> = scope.coordinates.iter().copied().collect();
        if scope.graph.depends_on(angle, &places) || scope.has_unknowns(angle) {
            let message = "the angle of a rigid rotation may depend on parameters and time only";
            return Err(scope.source.error(message, keys.angle.span.clone(), None));
        }
        Ok(Rotation { angle, axis })
    }

    /// Refuses what does not hold in a rotated body.
    pub(crate) fn check(
        scope: &Scope<'_>,
        table: &Spanned<RotationTable>,
        material: &Law,
        boundaries: &[Boundary],
        boundary_tables: &[BoundaryTable],
    ) -> Result<(), Diagnostic> {
        for (boundary, keys) in boundaries.iter().zip(boundary_tables) {
            let what = match boundary.condition {
                Condition::Sliding => "a sliding wall",
                Condition::Symmetry => "a plane of symmetry",
                Condition::Mixed(_)
                    if boundary.condition.gives(ComponentCondition::TractionFree) =>
                {
                    let message = "the free component of a traction turns with the body";
                    let help = "with [with-rotation] write 'prescribed-traction' in place of 'traction-free' by component";
                    let span = keys.condition_span();
                    return Err(scope.source.error(message, span, Some(help.into())));
                }
                Condition::TractionFree
                | Condition::PrescribedTraction
                | Condition::PrescribedMotion
                | Condition::Mixed(_) => continue,
            };
            let message =
                format!("{what} stands still, and a rotated body does not slide along it");
            let help = "with [with-rotation] a surface has condition = 'traction-free', 'prescribed-traction' or \
                        'prescribed-motion'";
            return Err(scope.source.error(message, keys.condition_span(), Some(help.into())));
        }
        let indifferent = match material {
            Law::Library(material) => material.row().is_objective,
            Law::Stress { .. } => false,
            Law::Energy { W } => {
                let symbols = scope.graph.symbols_in(&[*W]);
                let components = component_names("F", scope.coordinates.len()).concat();
                let mut names = symbols.iter().filter_map(|s| scope.graph.symbol_name(*s));
                !names.any(|name| components.iter().any(|component| component == name))
            }
        };
        if !indifferent {
            let message = "this law is not known to be indifferent to rotations, so that P' = Q P need not hold";
            let help = "use another law, or state the energy in C11, ..., J, I1 and I2";
            return Err(scope.source.error(message, table.span(), Some(help.into())));
        }
        Ok(())
    }

    /// The fields of the rotated body; all components are Cartesian.
    pub(crate) fn apply(&self, fields: &mut Fields, X: &[Expr], time: Expr) {
        let n = X.len();
        let Fields { graph, u, v, a, H, F, P, b, surfaces, .. } = fields;
        let turn = Turn::new(graph, *self, time, n);
        let x: Vec<Expr> = X.iter().zip(u.iter()).map(|(&X, &u)| graph.add(X, u)).collect();

        let turned_P = product(graph, &turn.Q, P);
        let turned_H = product(graph, &turn.Q, H);
        let of_position = apply(graph, &turn.less_identity, X);
        let turned_u = apply(graph, &turn.Q, u);
        let convected = apply(graph, &turn.rate, &x);
        let turned_v = apply(graph, &turn.Q, v);
        let coriolis = apply(graph, &turn.twice_rate, v);
        let centrifugal = apply(graph, &turn.second_rate, &x);
        let turned_a = apply(graph, &turn.Q, a);
        let turned_b = apply(graph, &turn.Q, b);
        for i in 0..n {
            u[i] = graph.add(turned_u[i], of_position[i]);
            v[i] = graph.add(turned_v[i], convected[i]);
            let apparent = graph.add(coriolis[i], centrifugal[i]);
            a[i] = graph.add(turned_a[i], apparent);
            b[i] = graph.add(turned_b[i], apparent);
            for j in 0..n {
                H[i][j] = graph.add(turned_H[i][j], turn.less_identity[i][j]);
                F[i][j] = H[i][j];
            }
            F[i][i] = graph.add(Graph::ONE, H[i][i]);
        }
        *P = turned_P;
        for surface in surfaces {
            surface.traction = apply(graph, &turn.Q, &surface.traction);
        }
    }

    /// Description of the rotation, for people.
    #[must_use]
    pub fn formula(&self, graph: &Graph) -> String {
        let angle = graph.print(self.angle);
        format!("then turned about {} by the angle {angle}", CARTESIAN[self.axis.min(2)])
    }
}

/// A rotation matrix with its rates.
struct Turn {
    Q: Matrix,
    /// `Q - I`.
    less_identity: Matrix,
    /// `dQ/dt`, and twice that.
    rate: Matrix,
    twice_rate: Matrix,
    /// `d2Q/dt2`.
    second_rate: Matrix,
}

impl Turn {
    fn new(graph: &mut Graph, rotation: Rotation, time: Expr, n: usize) -> Self {
        let angle = rotation.angle;
        let mut derivatives = Derivatives::limited();
        let speed = derivatives.of(graph, angle, time);
        let change = derivatives.of(graph, speed, time);
        let (sine, cosine) =
            (graph.call(Function::Sin, &[angle]), graph.call(Function::Cos, &[angle]));
        let two = graph.integer(2);
        let half = graph.div(angle, two);
        let sine_of_half = graph.call(Function::Sin, &[half]);
        let square = graph.powi(sine_of_half, 2);
        let twice = graph.mul(two, square);
        let cosine_less_one = graph.neg(twice);

        let axis = rotation.axis;
        // dQ = d angle (-sin, cos), d2Q = d2 angle (-sin, cos) - (d angle)^2 (cos, sin), as (along, across).
        let along = graph.mul(speed, sine);
        let along = graph.neg(along);
        let across = graph.mul(speed, cosine);
        let (twice_along, twice_across) = (graph.mul(two, along), graph.mul(two, across));
        let squared = graph.powi(speed, 2);
        let (by_cosine, by_sine) = (graph.mul(squared, cosine), graph.mul(squared, sine));
        let (change_sine, change_cosine) = (graph.mul(change, sine), graph.mul(change, cosine));
        let second_along = graph.add(change_sine, by_cosine);
        let second_along = graph.neg(second_along);
        let second_across = graph.sub(change_cosine, by_sine);
        Turn {
            Q: in_plane(graph, n, axis, Graph::ONE, (cosine, sine)),
            less_identity: in_plane(graph, n, axis, Graph::ZERO, (cosine_less_one, sine)),
            rate: in_plane(graph, n, axis, Graph::ZERO, (along, across)),
            twice_rate: in_plane(graph, n, axis, Graph::ZERO, (twice_along, twice_across)),
            second_rate: in_plane(graph, n, axis, Graph::ZERO, (second_along, second_across)),
        }
    }
}

/// The matrix `[along, -across; across, along]` in the plane normal to an axis, with `on_axis` for the axis itself.
fn in_plane(
    graph: &mut Graph,
    n: usize,
    axis: usize,
    on_axis: Expr,
    (along, across): (Expr, Expr),
) -> Matrix {
    // From the first to the second direction of the plane.
    let (p, q) = [(1, 2), (2, 0), (0, 1)][axis.min(2)];
    let mut matrix = vec![vec![Graph::ZERO; n]; n];
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] = on_axis;
    }
    (matrix[p][p], matrix[q][q]) = (along, along);
    (matrix[p][q], matrix[q][p]) = (graph.neg(across), across);
    matrix
}

fn apply(graph: &mut Graph, A: &Matrix, x: &[Expr]) -> Vec<Expr> {
    A.iter()
        .map(|row| {
            let terms: Vec<Expr> = row.iter().zip(x).map(|(&a, &x)| graph.mul(a, x)).collect();
            graph.sum_of(terms)
        })
        .collect()
}

fn product(graph: &mut Graph, A: &Matrix, B: &Matrix) -> Matrix {
    let n = A.len();
    let columns: Vec<Vec<Expr>> = (0..n)
        .map(|j| {
            let column: Vec<Expr> = B.iter().map(|row| row[j]).collect();
            apply(graph, A, &column)
        })
        .collect();
    (0..n).map(|i| columns.iter().map(|column| column[i]).collect()).collect()
}
