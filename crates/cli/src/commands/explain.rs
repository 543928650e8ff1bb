//! `mms explain`: what a solution models, which parts of a solver it exercises, and what its body force costs.

mod compare;
mod deformation;

use anyhow::Result;
use mmsmith_expr::{Expr, OperationCount};
use mmsmith_solutions::CATALOGUE;
use mmsmith_spec::{Around, Domain, Fields, SolvedCondition, Spec};
use mmsmith_stage::{BodyForceOperations, Staged};
use mmsmith_verify::{Part, Share, coverage};
use serde_json::{Value, json};

use super::coverage::{POINTS, THRESHOLD};
use super::growth::{MOST_GROWTH_WORK, Told};
use super::predict::Prediction;
use super::problem::Problem;
use super::{blind, predict, profile};
use crate::arguments::{ExplainOptions, SchemeOptions};
use crate::json::Output;
use crate::library::{Selection, specification};
use crate::table::Table;
use crate::{number, terminal};
use compare::Comparison;
use deformation::Deformation;

pub(crate) fn explain(options: &ExplainOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let spec = specification(&options.name)?;
    let fields = spec.derive()?;
    let exercises = exercises(&options.name)?;
    let degree = fields.polynomial_degree(MOST_COMMON_DEGREE);
    let cost = BodyForceCost::of(&spec, fields);
    let problem = Problem::new(Selection::new(&options.name, &[])?, &SchemeOptions::open())?;
    let Problem { selection, model, settled } = &problem;
    let predicted =
        predict::on_grids(model, &settled.case, &options.cells).map_err(|error| error.to_string());
    let words = settled.choice();
    let blind = blind::measure(selection)?;
    let deformation = Deformation::of(&options.name, model, settled)?;
    let told = deformation.as_ref().map(Deformation::text).unwrap_or_default();
    let motion = Told::measure(&model.exact, 1.0, MOST_GROWTH_WORK);
    terminal::say(
        &(text(&spec, &exercises, &blind, &cost)
            + &told
            + "\nthe exact motion and small disturbances of it\n"
            + &motion.text("  ")
            + &exact_elements(degree)
            + &runs(&predicted, &words)),
    )?;
    let compared = match options.compare {
        true => Some(Comparison::measure(model)?),
        false => None,
    };
    if let Some(compared) = &compared {
        terminal::say(&compared.text())?;
    }
    if let Some(output) = output {
        let mut document = document(&spec, degree, &exercises, &cost, &predicted);
        document["blind_spots"] = json!(blind);
        document["motion"] = motion.document();
        if let Some(deformation) = &deformation {
            document["deformation"] = deformation.document();
        }
        if let Some(compared) = &compared {
            document["compared"] = json!(compared);
        }
        output.write(&document)?;
    }
    Ok(true)
}

/// How much of one part of the momentum balance there is in a solution.
struct Exercise {
    part: Part,
    share: f64,
    /// The solution of the library that has the most of it, where this one has next to nothing.
    instead: Option<&'static str>,
}

impl Exercise {
    fn is_exercised(&self) -> bool {
        self.share >= THRESHOLD
    }
}

fn exercises(name: &str) -> Result<Vec<Exercise>> {
    let shares_of = |name: &str| -> Result<Vec<Share>> {
        Ok(coverage(&Selection::new(name, &[])?.build()?, POINTS)?)
    };
    let library = CATALOGUE
        .iter()
        .map(|known| Ok((known.name, shares_of(known.name)?)))
        .collect::<Result<Vec<_>>>()?;
    let own = shares_of(name)?;
    Ok(own
        .into_iter()
        .enumerate()
        .map(|(row, Share { part, share })| {
            let most = library.iter().max_by(|a, b| a.1[row].share.total_cmp(&b.1[row].share));
            let instead = most.filter(|_| share < THRESHOLD).map(|(name, _)| *name);
            Exercise { part, share, instead }
        })
        .collect())
}

/// Operations of the generated body force, by how often they are done.
struct BodyForceCost {
    stages: Vec<(&'static str, OperationCount)>,
    /// Values kept for each particle.
    kept: usize,
}

impl BodyForceCost {
    fn of(spec: &Spec, fields: Fields) -> Self {
        let BodyForceOperations { stages: count, lattice, kept } =
            Staged::of(spec, fields).body_force_operations();
        let mut stages = vec![
            ("once a run", count.fixed),
            ("once a step", count.time),
            ("once a particle", count.point),
            ("each particle and step", count.both),
        ];
        if let Some([layer, point]) = lattice {
            stages.push(("a layer an axis and step, in a lattice", layer));
            stages.push(("each particle and step, in a lattice", point));
        }
        BodyForceCost { stages, kept }
    }
}

fn text(
    spec: &Spec,
    exercises: &[Exercise],
    blind: &[blind::Told],
    cost: &BodyForceCost,
) -> String {
    let print = |expr| spec.graph.print(expr);
    let mut text = format!(
        "{} ({}D, {}): {}\n",
        spec.name,
        spec.dimension,
        spec.coordinates.name(),
        spec.title
    );
    if !spec.reference.is_empty() {
        text += &format!("  {}\n", spec.reference);
    }
    text += "\nmotion and material\n";
    let names = spec.coordinates.coordinate_names(spec.dimension);
    for (name, component) in names.iter().zip(&spec.displacement) {
        text += &format!("  u_{name} = {}\n", print(*component));
    }
    if let Some(rotation) = &spec.rotation {
        text += &format!("  {}\n", rotation.formula(&spec.graph));
    }
    if let Some(solved) = &spec.solved {
        for (name, value) in &solved.unknowns {
            text += &format!("  {name} = {}\n", print(*value));
        }
        for SolvedCondition { text: condition, factor, others } in &solved.conditions {
            text += &format!("    from {condition}: {factor} = 0\n");
            for other in others {
                text += &format!("      and not {other} = 0, which no body at rest satisfies\n");
            }
        }
    }
    for line in spec.law_formulas() {
        text += &format!("  {line}\n");
    }
    text += &format!("  density = {}\n", print(spec.density));
    text +=
        &format!("  wave speed = {}\n  period = {}\n", print(spec.wave_speed), print(spec.period));
    text += &format!("\nbody\n  {}\n", domain(spec));
    for boundary in &spec.boundaries {
        text += &format!("  {}: {}\n", boundary.surface, boundary.condition);
    }
    text += "\nwhat a solver can get wrong, and whether this solution would show it\n";
    for exercise in exercises {
        let Exercise { part, share, instead } = exercise;
        text += &match instead {
            None => format!("  yes  {part} ({:.1} %)\n", 100.0 * share),
            Some(instead) => format!("  no   {part} ({instead} would)\n"),
        };
    }
    text += &blind::text(blind);
    text += "\noperations of the body force, generated\n";
    let header = ["stage", "+ -", "*", "/", "sqrt", "functions"];
    let mut table = Table::new(1, header);
    for (stage, count) in &cost.stages {
        let number = |n: usize| n.to_string();
        table.row([
            (*stage).to_owned(),
            number(count.additions),
            number(count.multiplications),
            number(count.divisions),
            number(count.square_roots),
            number(count.calls),
        ]);
    }
    text += &table.text();
    text += &format!(
        "  kept for each particle: {} numbers, {} bytes in double precision\n",
        cost.kept,
        8 * cost.kept
    );
    text
}

/// Elements of higher degrees are rare.
const MOST_COMMON_DEGREE: usize = 3;

/// A warning where elements represent the displacement exactly.
fn exact_elements(degree: Option<usize>) -> String {
    degree.map_or_else(String::new, |degree| {
        format!(
            "\nwarning: u is a polynomial of degree {degree} in the coordinates. Finite elements of degree {} and more represent \
             it exactly:\n  no order in space shows with them, and what is left is the error in time and of the quadrature\n",
            degree.max(1)
        )
    })
}

/// Predicted costs of runs of the usual scheme, or why there are none.
type Predicted = Result<Vec<Prediction>, String>;

fn runs(predicted: &Predicted, choice: &str) -> String {
    let rows = match predicted {
        Ok(rows) => rows,
        Err(reason) => return format!("\nnot simulated with the default scheme: {reason}\n"),
    };
    let header = ["cells", "particles", "steps", "stepping", "in all", "memory", "threads of use"];
    let mut table = Table::new(0, header);
    for Prediction { cells, plan, cost, division } in rows {
        table.row([
            cells.to_string(),
            format!("{:.0}", plan.particles),
            plan.steps.to_string(),
            predict::duration(cost.steps_s),
            predict::duration(cost.total_s),
            predict::amount(plan.bytes),
            division.map_or_else(String::new, |of| number::rounded(of.cores, 2)),
        ]);
    }
    format!(
        "\na run with the default scheme on {}, predicted from a few steps made just now\n{choice}{}",
        number::counted(rayon::current_num_threads(), "thread"),
        table.text()
    )
}

fn domain(spec: &Spec) -> String {
    let list = |corner: &[Expr]| {
        let parts: Vec<String> = corner.iter().map(|&x| spec.graph.print(x)).collect();
        parts.join(", ")
    };
    match &spec.domain {
        Domain::Box { lower, upper } => format!("box from ({}) to ({})", list(lower), list(upper)),
        Domain::Annulus { inner, outer } => {
            format!("{} <= R <= {}", spec.graph.print(*inner), spec.graph.print(*outer))
        }
        Domain::Tube { inner, outer, lower, upper, around } => {
            let between = |low: Expr, name: &str, high: Expr| {
                format!("{} <= {name} <= {}", spec.graph.print(low), spec.graph.print(high))
            };
            let angles = match around {
                Around::Axisymmetric => ", turned about the axis Z".to_owned(),
                Around::Whole => String::new(),
                Around::Sector { from, to } => format!(", {}", between(*from, "theta", *to)),
            };
            format!("{}, {}{angles}", between(*inner, "R", *outer), between(*lower, "Z", *upper))
        }
    }
}

fn document(
    spec: &Spec,
    degree: Option<usize>,
    exercises: &[Exercise],
    cost: &BodyForceCost,
    predicted: &Predicted,
) -> Value {
    let runs = predicted.as_ref().map(|rows| {
        let row = |Prediction { cells, plan, cost, division }: &Prediction| {
            json!({
                "cells": cells,
                "particles": plan.particles,
                "steps": plan.steps,
                "steps_s": cost.steps_s,
                "total_s": cost.total_s,
                "bytes": plan.bytes,
                "division": division.as_ref().map(profile::division_document),
            })
        };
        rows.iter().map(row).collect::<Vec<_>>()
    });
    let exercised: serde_json::Map<String, Value> =
        exercises.iter().map(|e| (e.part.to_string(), e.is_exercised().into())).collect();
    let shares: serde_json::Map<String, Value> =
        exercises.iter().map(|e| (e.part.to_string(), e.share.into())).collect();
    let stages: serde_json::Map<String, Value> = cost
        .stages
        .iter()
        .map(|(stage, count)| {
            let count = json!({
                "additions": count.additions,
                "multiplications": count.multiplications,
                "divisions": count.divisions,
                "square_roots": count.square_roots,
                "functions": count.calls,
            });
            ((*stage).to_owned(), count)
        })
        .collect();
    let names = spec.coordinates.coordinate_names(spec.dimension);
    let displacement: serde_json::Map<String, Value> = names
        .iter()
        .zip(&spec.displacement)
        .map(|(name, u)| ((*name).to_owned(), Value::from(spec.graph.print(*u))))
        .collect();
    let solved: serde_json::Map<String, Value> = spec
        .solved
        .iter()
        .flat_map(|solved| &solved.unknowns)
        .map(|(name, value)| (name.clone(), Value::from(spec.graph.print(*value))))
        .collect();
    json!({
        "schema": "mmsmith.explain/1",
        "settings": { "version": env!("CARGO_PKG_VERSION"), "solution": spec.name },
        "title": spec.title,
        "coordinates": spec.coordinates.name(),
        "dimension": spec.dimension,
        "displacement": displacement,
        "rotation": spec.rotation.map(|rotation| rotation.formula(&spec.graph)),
        "solved": solved,
        "domain": domain(spec),
        "polynomial_degree": degree,
        "exercises": exercised,
        "shares": shares,
        "runs": runs.as_ref().ok(),
        "not_simulated": runs.as_ref().err(),
        "body_force": { "operations": stages, "kept_numbers_per_particle": cost.kept },
    })
}
