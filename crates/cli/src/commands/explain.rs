//! `mms explain`: what a solution models, which parts of a solver it exercises, and what its body force costs.

use anyhow::Result;
use mmsmith_expr::{Dependence, Expr, Graph, OperationCount, Program, arrange};
use mmsmith_spec::{Domain, Fields, SolvedCondition, Spec};
use serde_json::{Value, json};

use crate::arguments::ExplainOptions;
use crate::json::Output;
use crate::library::specification;
use crate::table::Table;
use crate::terminal;

pub(crate) fn explain(options: &ExplainOptions) -> Result<bool> {
    let output = Output::prepare_if(options.json.as_ref())?;
    let spec = specification(&options.name)?;
    let mut fields = spec.derive()?;
    let exercises = exercises(&spec, &fields);
    let cost = BodyForceCost::of(&mut fields);
    terminal::say(&text(&spec, &exercises, &cost))?;
    if let Some(output) = output {
        output.write(&document(&spec, &exercises, &cost))?;
    }
    Ok(true)
}

/// Whether a solution can show a mistake in one part of a solver.
struct Exercise {
    part: &'static str,
    exercised: bool,
    /// A solution that does, where this one does not.
    instead: &'static str,
}

fn exercises(spec: &Spec, fields: &Fields) -> Vec<Exercise> {
    let without_lambda = spec.material.constants().contains(&("lambda", Graph::ZERO));
    let n = spec.dimension;
    let pairs = || (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let vanishes = |entries: &[Expr]| entries.iter().all(|&entry| entry == Graph::ZERO);
    let part = |part, exercised, instead| Exercise { part, exercised, instead };
    let shear = pairs().any(|(i, j)| !vanishes(&[fields.H[i][j], fields.H[j][i]]));
    let skew = |A: &[Vec<Expr>]| pairs().any(|(i, j)| A[i][j] != A[j][i]);
    vec![
        part("inertia", !vanishes(&fields.a), "axis-aligned"),
        part("stress", !vanishes(&fields.P.concat()), "axis-aligned"),
        part(
            "the first Lame constant and ln J",
            !without_lambda && fields.J != Graph::ONE,
            "axis-aligned",
        ),
        part("change of volume", fields.J != Graph::ONE, "axis-aligned"),
        part("shear strain", shear, "skew-2d"),
        part("rotation: F is not symmetric", skew(&fields.H), "vortex"),
        part("a transposed P", skew(&fields.P), "skew-2d"),
        part("the body force", !vanishes(&fields.b), "axis-aligned"),
        part("free or loaded surfaces", has_traction(spec), "ring"),
        part("three dimensions", n == 3, "axis-aligned-3d"),
    ]
}

fn has_traction(spec: &Spec) -> bool {
    use mmsmith_spec::Condition::{PrescribedTraction, TractionFree};
    spec.boundaries.iter().any(|b| matches!(b.condition, PrescribedTraction | TractionFree))
}

/// Operations of the generated body force, by how often they are done.
struct BodyForceCost {
    stages: [(&'static str, OperationCount); 4],
    /// Values kept for each particle.
    kept: usize,
}

impl BodyForceCost {
    fn of(fields: &mut Fields) -> Self {
        let b = arrange(&mut fields.graph, &fields.inputs, &fields.definitions, &fields.b);
        let program: Program = fields.program(&b);
        let count = program.operations_by_stage(program.outputs());
        // What depends on the position alone and is read by what depends on more, or is an output.
        let point = Dependence { position: true, time: false };
        let needed = program.needed(program.outputs());
        let later = program
            .slots()
            .filter(|slot| needed[slot.index()] && program.dependence(*slot) != point)
            .flat_map(|slot| program.operations()[slot.index()].operands());
        let mut kept: Vec<_> = later
            .chain(program.outputs().iter().copied())
            .filter(|&slot| program.dependence(slot) == point)
            .collect();
        kept.sort_unstable();
        kept.dedup();
        BodyForceCost {
            stages: [
                ("once a run", count.fixed),
                ("once a step", count.time),
                ("once a particle", count.point),
                ("each particle and step", count.both),
            ],
            kept: kept.len(),
        }
    }
}

fn text(spec: &Spec, exercises: &[Exercise], cost: &BodyForceCost) -> String {
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
    for line in spec.material.formulas(&spec.graph) {
        text += &format!("  {line}\n");
    }
    text += &format!("  density = {}\n", print(spec.density));
    text +=
        &format!("  wave speed = {}\n  period = {}\n", print(spec.wave_speed), print(spec.period));
    text += &format!("\nbody\n  {}\n", domain(spec));
    for boundary in &spec.boundaries {
        text += &format!("  {:?}: {:?}\n", boundary.surface, boundary.condition);
    }
    text += "\nwhat a solver can get wrong, and whether this solution would show it\n";
    for Exercise { part, exercised, instead } in exercises {
        text += &match exercised {
            true => format!("  yes  {part}\n"),
            false => format!("  no   {part} ({instead} would)\n"),
        };
    }
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
    }
}

fn document(spec: &Spec, exercises: &[Exercise], cost: &BodyForceCost) -> Value {
    let exercised: serde_json::Map<String, Value> =
        exercises.iter().map(|e| (e.part.to_owned(), Value::from(e.exercised))).collect();
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
        "exercises": exercised,
        "body_force": { "operations": stages, "kept_numbers_per_particle": cost.kept },
    })
}
