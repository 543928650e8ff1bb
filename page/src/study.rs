//! Runs of the solver on some grids, with the scheme that `mms converge` takes where nothing is said.

use crate::refusal::Refusal;
use crate::session::Session;
use mmsmith_runtime::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, CflSpeed, Layout, Named, Scheme, Shape, Sweep, Total, Updated, converge,
    has_flow, is_axisymmetric, loaded_instead, needs_space, needs_total_frame, stiffest,
    usual_step,
};
use serde_json::{Value, json};

/// Larger grids are for `mms`.
const MOST_CELLS: usize = 64;
/// Degree of the splines of a total Lagrangian formulation.
const DEGREE: usize = 3;

/// Rows and orders on the given grids.
pub(crate) fn of(session: &Session, cells: &[usize]) -> Result<Value, Refusal> {
    if cells.iter().any(|&cells| !(2..=MOST_CELLS).contains(&cells)) || cells.len() > 6 {
        return Err(format!("grids have 2 to {MOST_CELLS} cells, and there are six at most").into());
    }
    if session.spec.is_static() {
        return Err("nothing moves here: mms converge measures equilibria from rest".into());
    }
    let exact = session.solution()?;
    let (case, words) = usual(&exact)?;
    let sweep = Sweep::Cells(cells.to_vec());
    let study = converge(&exact, Arithmetic::Double, &case, &sweep, &mut |_| {})?;
    Ok(json!({ "rows": study.rows, "orders": study.orders, "scheme": words }))
}

/// The case that suits a solution, and the scheme in words.
fn usual(exact: &AnySolution<f64>) -> Result<(Case, String), Refusal> {
    let needs_total = needs_total_frame(exact).is_some() || needs_space(exact).is_some();
    let return_map = has_flow(exact).then(Default::default);
    let usual = Case { return_map, ..Case::default() };
    if !needs_total {
        let updated = Updated { shape: Shape::Gimp, ..Updated::default() };
        let scheme = Scheme::Updated(updated);
        let mut case = Case { scheme, ..usual };
        if let Ok(step) = usual_step(exact, &scheme, case.periods, None) {
            (case.cfl, case.cfl_speed) = (step.cfl, step.speed);
        }
        let loads = match loaded_instead(exact, &case).len() {
            0 => "",
            _ => "; tractions of the exact motion act where the grid has no such condition",
        };
        let words =
            format!("updated Lagrangian, GIMP, central differences, CFL {}{loads}", case.cfl);
        return Ok((case, words));
    }
    let total = Total {
        layout: Total::layout_for(exact),
        coordinates: Total::coordinates_for(exact),
        ..Total::of_degree(DEGREE)
    };
    let per_cell = if total.layout == Layout::Gauss { DEGREE + 1 } else { usual.per_cell };
    let mut case = Case { scheme: Scheme::Total(total), per_cell, ..usual };
    let speed = stiffest(exact).unwrap_or(CflSpeed::PWave);
    if let Ok(cfl) = total.usual_cfl(exact, speed) {
        (case.cfl, case.cfl_speed) = (cfl, speed);
    }
    let space = if is_axisymmetric(exact) { " of the half plane" } else { "" };
    let words = format!(
        "total Lagrangian, cubic splines on a grid{space}, CFL {} of --cfl-speed {}",
        case.cfl,
        case.cfl_speed.name()
    );
    Ok((case, words))
}
