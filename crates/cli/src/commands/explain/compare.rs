//! Times of runs beside the predicted ones.

use anyhow::Result;
use mmsmith_verify::{
    Case, CostModel, Discretized, Formulation, Integrator, MassMatrix, Outputs, Scheme, Shape,
    Status, median,
};
use serde::Serialize;

use crate::arguments::{HighDegree, SchemeOptions, Weights};
use crate::commands::predict;
use crate::commands::problem::Model;
use crate::commands::scheme::Settled;
use crate::memory;
use crate::number;
use crate::table::Table;

/// Cell counts that schemes are run with.
const LADDER: [usize; 3] = [64, 128, 256];
/// The part of a period that a run has is that which is predicted to step for this long, in seconds.
const ENOUGH_S: f64 = 0.7;
/// Steps that a run has at least, unless they are predicted to take longer than the most.
const LEAST_STEPS: f64 = 20.0;
const MOST_S: f64 = 5.0;

/// A run and its prediction.
#[derive(Serialize)]
pub(super) struct Row {
    scheme: String,
    cells: usize,
    particles: usize,
    steps: u64,
    predicted_s: f64,
    taken_s: f64,
    /// Taken over predicted.
    ratio: f64,
}

/// Five schemes on a ladder of grids.
#[derive(Serialize)]
pub(super) struct Comparison {
    rows: Vec<Row>,
    median_ratio: Option<f64>,
    /// By how much the times taken are off the predicted ones, as a share of them.
    median_deviation: Option<f64>,
}

impl Comparison {
    fn new(rows: Vec<Row>) -> Self {
        let of = |value: &dyn Fn(&Row) -> f64| {
            let values: Vec<f64> = rows.iter().map(value).collect();
            (!values.is_empty()).then(|| median(&values))
        };
        let median_ratio = of(&|row| row.ratio);
        let median_deviation = of(&|row| (row.ratio - 1.0).abs());
        Self { rows, median_ratio, median_deviation }
    }

    /// Runs the schemes that fit a solution on the grids that fit it and are done in seconds.
    pub(super) fn measure(model: &Model) -> Result<Self> {
        let mut rows = Vec::new();
        for (words, base) in schemes(model)? {
            let fitting: Vec<Discretized<'_>> = LADDER
                .into_iter()
                .filter_map(|cells| fitting(model, &Case { cells, ..base }))
                .collect();
            let Some(finest) = fitting.last() else { continue };
            let Ok(learnt) = predict::learn(finest) else { continue };
            for whole in &fitting {
                let Some((case, predicted_s)) = share(&learnt, whole) else { continue };
                if predicted_s > MOST_S {
                    continue;
                }
                let mut quiet = |_| {};
                let row = case.run(&mut Outputs::new(&mut quiet))?;
                // What stopped took less than all its steps do.
                if !matches!(row.status, Status::Ok | Status::Unresolved { .. }) {
                    continue;
                }
                rows.push(Row {
                    scheme: words.clone(),
                    cells: row.cells,
                    particles: row.particles,
                    steps: row.steps,
                    predicted_s,
                    taken_s: row.wall_s,
                    ratio: row.wall_s / predicted_s,
                });
            }
        }
        Ok(Self::new(rows))
    }

    pub(super) fn text(&self) -> String {
        let header = ["scheme", "cells", "particles", "steps", "predicted", "taken", "ratio"];
        let mut table = Table::new(1, header);
        for row in &self.rows {
            table.row([
                row.scheme.clone(),
                row.cells.to_string(),
                row.particles.to_string(),
                row.steps.to_string(),
                predict::duration(row.predicted_s),
                predict::duration(row.taken_s),
                format!("{:.2}", row.ratio),
            ]);
        }
        let mut text = format!(
            "\nstepping, predicted and taken, for a part of a period on {}\n{}",
            number::counted(rayon::current_num_threads(), "thread"),
            table.text()
        );
        match self.median_ratio.zip(self.median_deviation) {
            Some((ratio, deviation)) => {
                text += &format!(
                    "median of taken over predicted: {ratio:.2}; in the median they differ by {:.0} %\n",
                    100.0 * deviation
                );
            }
            None => text += "no scheme has a grid that it is done with in seconds\n",
        }
        text
    }
}

/// Five schemes that may fit a solution, of different cost: in the updated Lagrangian formulation in one pass a step and in several, and in the
/// total one.
fn schemes(model: &Model) -> Result<Vec<(String, Case)>> {
    let open = SchemeOptions::open();
    let with =
        |weights, integrator| SchemeOptions { shape: Some(weights), integrator, ..open.clone() };
    let said = |shape, integrator| with(Weights::Of(shape), integrator);
    let (cd, usl, musl) = (Integrator::Cd, Integrator::Usl, Integrator::Musl);
    let all = if mmsmith_verify::needs_total_frame(&model.exact).is_none() {
        let total = SchemeOptions {
            formulation: Some(Formulation::Total),
            cfl: Some(0.2),
            ..said(Shape::Bspline3, cd)
        };
        vec![
            said(Shape::Gimp, cd),
            said(Shape::Ugimp, usl),
            said(Shape::Ugimp, musl),
            said(Shape::Cpdi, cd),
            total,
        ]
    } else {
        let lumped = SchemeOptions { mass: Some(MassMatrix::Lumped), ..said(Shape::Bspline3, cd) };
        vec![
            said(Shape::Bspline2, cd),
            said(Shape::Bspline3, cd),
            with(Weights::Spline(HighDegree::Four), cd),
            with(Weights::Spline(HighDegree::Five), cd),
            lumped,
        ]
    };
    let told = |options: &SchemeOptions| {
        let case = Settled::settle(options, &model.exact)?.case;
        let shape = case.scheme.shape();
        let mut words = match case.scheme {
            Scheme::Updated(updated) => format!("{shape} + {}", updated.integrator),
            Scheme::Total(_) => format!("{shape}, total Lagrangian"),
        };
        if options.mass.is_some() {
            words += ", lumped mass";
        }
        Ok((words, case))
    };
    all.iter().map(told).collect()
}

/// A case on its grid, where it fits the solution and the memory.
fn fitting<'a>(model: &'a Model, case: &Case) -> Option<Discretized<'a>> {
    let found = model.discretized(case).ok()?;
    memory::require(found.plan().bytes, case.cells).ok()?;
    Some(found)
}

/// The part of a period of a case that tells enough, and the seconds that its steps are predicted to take.
fn share<'a>(learnt: &CostModel, whole: &Discretized<'a>) -> Option<(Discretized<'a>, f64)> {
    let (seconds, steps) = (learnt.predict(whole.plan())?.steps_s, whole.plan().steps as f64);
    let part = (ENOUGH_S / seconds).max(LEAST_STEPS / steps).min(1.0);
    let periods = whole.case().periods * part;
    let case = whole.with(&Case { periods, ..*whole.case() }).ok()?;
    let predicted_s = learnt.predict(case.plan())?.steps_s;
    Some((case, predicted_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_those_of_the_ratios() {
        let row = |ratio| Row {
            scheme: "gimp + cd".into(),
            cells: 64,
            particles: 1,
            steps: 1,
            predicted_s: 1.0,
            taken_s: ratio,
            ratio,
        };
        let found = Comparison::new([0.5, 1.1, 2.0].map(row).into());
        assert_eq!(found.median_ratio, Some(1.1));
        assert_eq!(found.median_deviation, Some(0.5));
        assert!(found.text().contains("1.10; in the median they differ by 50 %"));
        assert_eq!(Comparison::new(Vec::new()).median_ratio, None);
    }
}
