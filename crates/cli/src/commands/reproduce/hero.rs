//! The ring's stress beside the orders of three schemes on it: the picture that the README begins with.

use anyhow::{Context, Result};
use mmsmith_verify::{
    Case, Coordinates, Extent, Layout, Outputs, Placement, Scheme, Shape, Snapshot, Status, Study,
    Sweep, Total, Updated,
};

use super::{GRID, studied};
use crate::arguments::{Precision, Stress};
use crate::commands::picture::{View, draw, range};
use crate::commands::problem::Model;
use crate::svg::{Curve, Plot, beside};
use crate::units::Units;

const PROBLEM: &str = "ring";
/// The grid of the particles that are shown: fine enough for a smooth picture, coarse enough for a small file.
const SHOWN: usize = 24;
const CELLS: [usize; 4] = [8, 16, GRID, 64];

/// A scheme, its name in the picture, and the order that it is known to have.
struct Curved {
    name: &'static str,
    case: Case,
    order: Option<i32>,
}

/// The usual scheme, whose particles do not fit the rims; particles that do; and one of high order.
fn schemes() -> [Curved; 3] {
    let usual = Case { cells: GRID, ..Case::default() };
    let fitted =
        Updated { shape: Shape::Cpdi2, placement: Placement::BodyFitted, ..Updated::default() };
    let (layout, coordinates) = (Layout::Gauss, Coordinates::Polar);
    let splines = Total { layout, coordinates, ..Total::of_degree(3) };
    [
        Curved { name: "gimp, square lattice", case: usual, order: None },
        Curved {
            name: "cpdi2, body-fitted particles",
            case: Case { scheme: Scheme::Updated(fitted), ..usual },
            order: Some(2),
        },
        Curved {
            name: "bspline3, total Lagrangian",
            case: Case { scheme: Scheme::Total(splines), per_cell: 4, cfl: 0.2, ..usual },
            order: Some(4),
        },
    ]
}

/// The picture.
pub(super) fn svg() -> Result<String> {
    let selection = studied(PROBLEM, &[])?;
    let model = Model::new(&selection, Precision::F64)?;
    let units = Units::of(&selection);

    let [_, fitted, _] = schemes();
    let case = Case { extent: Some(Extent::Full), cells: SHOWN, ..fitted.case };
    let mut snapshot = Snapshot { share: 1.0, frame: None };
    let silent = &mut |_| ();
    let mut outputs = Outputs { snapshot: Some(&mut snapshot), ..Outputs::new(silent) };
    model.discretized(&case)?.run(&mut outputs)?;
    let frame = snapshot.frame.context("the ring's run stopped before its end")?;
    let hoop = Stress::Hoop.values(&frame)?;
    let note = format!("{} particles that fit the rims, {SHOWN} cells, cpdi2", frame.points.len());
    let ring = draw(
        "Hoop stress of the expanding ring",
        (&frame, View::Plane),
        &hoop,
        range(&hoop),
        units,
        &note,
    );

    let mut curves = Vec::new();
    for one in schemes() {
        let sweep = Sweep::Cells(CELLS.to_vec());
        let cases = model.admit(&sweep.cases(&one.case))?;
        let study = Study::measure(&cases, &sweep, &mut |_| ())?;
        let cases = study
            .rows
            .iter()
            .map(|row| (row.h, (row.status == Status::Ok).then_some(row.errors.u.linf)));
        let curve = Curve::new(one.name, cases, study.orders.u.linf.fit);
        curves.push(match one.order {
            Some(order) => curve.with_triangle(order),
            None => curve,
        });
    }
    let plot = Plot {
        title: "Error against the exact motion",
        x: "grid spacing h [m]",
        y: "L_inf error of u [m]",
        curves,
        note: "",
        orders: &[],
        floor: None,
    };
    let (height, plot) = (plot.height(), plot.svg());
    Ok(beside(
        "A ring that expands and contracts, and the orders of three schemes on it",
        "Left: the particles of a ring after one period, coloured by hoop stress. Right: the largest error of the \
         displacement over the grid spacing, for particles on a square lattice, particles that fit the rims, and splines \
         in the total Lagrangian formulation.",
        height,
        &[ring, plot],
    ))
}
