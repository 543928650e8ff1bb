//! Errors that grow under refinement.

use mmsmith_solutions::{AnySolution, Domain};
use mmsmith_verify::{Case, Field, Norm, Placement, Shape, Sweep, Updated, turns_about_axis};
use serde_json::{Map, Value, json};

use super::Converge;
use super::judged::Judged;
use crate::table;

/// An error that is larger on the finest grid than on the one before.
pub(super) struct Growing {
    field: Field,
    norm: Norm,
    /// The order on the finest pair of grids.
    order: f64,
    /// For a scheme that sums over the points of particles: its shape, and options of a scheme that integrates.
    summed: Option<(Shape, &'static str)>,
}

impl Growing {
    /// The first error of `u` and `P` that grows, where nothing else is known to be its cause.
    pub(super) fn find(asked: &Converge<'_>, judged: &Judged) -> Option<Self> {
        let is_known = judged.not_judged.is_some() || asked.warnings().factor() > 1.0;
        if is_known || !matches!(asked.sweep, Sweep::Cells(_)) {
            return None;
        }
        let summed = summed(&asked.problem.model.exact, &asked.base);
        for field in [Field::Displacement, Field::Stress] {
            for norm in [Norm::L2, Norm::Linf] {
                if let Some(order) = judged.verdicts[field][norm].finest
                    && order < 0.0
                {
                    return Some(Self { field, norm, order, summed });
                }
            }
        }
        None
    }

    /// Lines of it.
    pub(super) fn text(&self) -> String {
        let Self { field, norm, order, summed } = self;
        let order = table::rate(Some(*order));
        match summed {
            Some((shape, instead)) => format!(
                "warning: particle quadrature: the {norm} error of {field} grows on the finest grids (order {order}). {shape} takes its functions at \
                 the particles' points, and sums over points that move through the grid are no integrals.\n  Use {instead}.\n"
            ),
            None => format!(
                "warning: the {norm} error of {field} grows on the finest grids (order {order}): with this scheme finer grids are no better.\n  \
                 mms tradeoff compares others.\n"
            ),
        }
    }

    /// Puts it among results.
    pub(super) fn insert(&self, results: &mut Map<String, Value>) {
        let Self { field, norm, order, summed } = self;
        let mut document = json!({ "field": field, "norm": norm.to_string(), "order": order });
        let name = match summed {
            Some((_, instead)) => {
                document["instead"] = json!(instead);
                "quadrature"
            }
            None => "refinement",
        };
        results.insert(name.into(), document);
    }
}

/// The shape of a scheme that sums over the points of particles, and options of one that does not.
fn summed(exact: &AnySolution<f64>, base: &Case) -> Option<(Shape, &'static str)> {
    let Updated { shape, placement, .. } = *base.scheme.updated()?;
    if !matches!(shape, Shape::Linear | Shape::Bspline2 | Shape::Bspline3) {
        return None;
    }
    let is_box = match exact {
        AnySolution::One(s) => matches!(s.domain(), Domain::Box { .. }),
        AnySolution::Two(s) => matches!(s.domain(), Domain::Box { .. }),
        AnySolution::Three(s) => matches!(s.domain(), Domain::Box { .. }),
        _ => false,
    };
    let instead = match placement {
        // Polygons integrate.
        Placement::Clipped { .. } => return None,
        Placement::Lattice { .. } if is_box || turns_about_axis(exact) => "--shape gimp-bspline2",
        Placement::Lattice { .. } => "--layout clipped --shape cpdi2",
        Placement::BodyFitted => "--shape cpdi2",
    };
    Some((shape, instead))
}
