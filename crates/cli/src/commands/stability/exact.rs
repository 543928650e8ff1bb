//! `mms stability --exact`: how much disturbances of the exact motion grow, whatever the scheme.

use anyhow::{Context, Result, bail};
use mmsmith_verify::{A_DIGIT, Criteria, Grown, Growth, GrowthSettings, growth};
use serde_json::{Map, Value, json};

use super::{Point, request, vary};
use crate::arguments::{SchemeOptions, StabilityOptions};
use crate::commands::growth::{instead, of_extremes, times};
use crate::library::Selection;
use crate::number;
use crate::processes::with_threads;
use crate::report::{Report, Section, Sheet};
use crate::table::Table;

/// Waves whose growth is measured.
const WAVES: usize = 3;
/// How often the disturbance that grows most is improved at most.
const ITERATIONS: usize = 6;

/// Measures, tells and writes.
pub(super) fn exact(options: &StabilityOptions) -> Result<bool> {
    let files = request(options).files.prepare()?;
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    const VARIED: [&str; 12] = [
        "ppc",
        "offset",
        "grid-angle",
        "grid-shift",
        "precision",
        "shape",
        "integrator",
        "start",
        "units",
        "layout",
        "transfer",
        "cfl",
    ];
    if let Some((name, _)) = options.over.iter().find(|(name, _)| VARIED.contains(&name.as_str())) {
        bail!(
            "--exact --over {name}=...: the exact motion has no {name}; parameters of the solution, cells and periods can be varied"
        );
    }
    refuse_scheme(options)?;
    let SchemeOptions { parameters, periods, .. } = options.scheme.clone();
    let scheme = SchemeOptions { parameters, periods, ..SchemeOptions::open() };
    let points = vary::points(options, &scheme, &selection)?;
    let varies_cells = options.over.iter().any(|(name, _)| name == "cells");
    with_threads(options.scheme.threads, || {
        let measure = |point: &Point| {
            let case = &point.problem.settled.case;
            let settings = GrowthSettings {
                periods: case.periods,
                cells: (options.cells.is_some() || varies_cells).then_some(case.cells),
                degree: degree(options)?,
                waves: WAVES,
                iterations: ITERATIONS,
                most_work: None,
            };
            let place = point.place(options, "=");
            growth(&point.problem.model.exact, &settings).with_context(|| match place.is_empty() {
                true => format!("mms stability {} --exact", options.name),
                false => format!("--over {place}"),
            })
        };
        let found = points.iter().map(measure).collect::<Result<Vec<_>>>()?;
        report(options, &points, &found)?.publish(files)
    })
}

/// Refuses options of a scheme: the exact motion has none of them.
fn refuse_scheme(options: &StabilityOptions) -> Result<()> {
    let (scheme, usual) = (&options.scheme, SchemeOptions::open());
    let criteria = Criteria::default();
    let given = [
        ("--formulation", scheme.formulation.is_some()),
        ("--mass", scheme.mass.is_some()),
        ("--composition", scheme.composition.is_some()),
        ("--return-map", scheme.return_map.is_some()),
        ("--volume", scheme.volume != usual.volume),
        ("--layout", scheme.layout.is_some()),
        ("--grid", scheme.grid.is_some()),
        ("--cfl-speed", scheme.cfl_speed.is_some()),
        ("--integrator", scheme.integrator != usual.integrator),
        ("--transfer", scheme.transfer != usual.transfer),
        ("--start", scheme.start != usual.start),
        ("--ppc", scheme.ppc.is_some()),
        ("--cfl", scheme.cfl.is_some()),
        ("--extent", scheme.extent.is_some()),
        ("--offset", scheme.offset != usual.offset),
        ("--grid-angle", scheme.grid_angle != usual.grid_angle),
        ("--grid-shift", scheme.grid_shift != usual.grid_shift),
        ("--precision", scheme.precision != usual.precision),
        ("--error-multiple", options.error_multiple != criteria.error_multiple),
        ("--energy-rate", options.energy_rate != criteria.energy_rate),
    ];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => bail!(
            "--exact {option}: the exact motion has no scheme; of the options of schemes --exact takes --periods, and --shape for the degree \
             of its splines; leave {option} out"
        ),
        None => Ok(()),
    }
}

/// The degree of the splines that are asked for by a shape.
fn degree(options: &StabilityOptions) -> Result<Option<usize>> {
    let Some(shape) = &options.scheme.shape else { return Ok(None) };
    match shape.degree() {
        Some(degree) => Ok(Some(degree)),
        None => bail!(
            "--exact --shape {}: it takes splines, bspline2 to bspline5; leave --shape out for the usual ones",
            shape.name()
        ),
    }
}

fn report(options: &StabilityOptions, points: &[Point], found: &[Growth]) -> Result<Report> {
    let problem = &points.first().context("no point")?.problem;
    let mut sections = vec![Section::Note(DEFINITION.into())];
    if let ([point], [found]) = (points, found) {
        sections.push(Section::Table(title(found), single(found)));
        sections.push(Section::Note(format!("{}\n", of_extremes(&found.extremes))));
        sections.push(Section::Note(judgement(point, found)));
    } else {
        let title = "factors by which disturbances grow until the end time".to_owned();
        sections.push(Section::Table(title, varied(options, points, found)));
    }
    sections.push(Section::Sheet(sheet(options, points, found)));
    let mut settings = problem.settings(None, options.cells, Value::Null);
    settings["ppc"] = Value::Null;
    let rows = points.iter().zip(found).map(|(point, found)| row(options, point, found));
    let over: Vec<_> = options.over.iter().map(|(name, _)| name).collect();
    let settings = json!({
        "version": settings["version"],
        "solution": settings["solution"],
        "parameters": settings["parameters"],
        "periods": settings["periods"],
        "threads": settings["threads"],
    });
    let parameters = problem.selection.told_parameters();
    let periods = number::of_periods(problem.settled.case.periods);
    let mut report = Report::new("growth");
    report.caption = format!("{} ({parameters}), {periods}\n", problem.selection.name());
    report.sections = sections;
    report.settings = settings;
    Ok(report.with("over", json!(over)).with("rows", rows.collect::<Result<Vec<_>>>()?))
}

/// Meaning of the numbers.
const DEFINITION: &str = "\
Small disturbances of the exact motion under its dead body force, by the balance of momentum linearised about it.
A factor is the largest displacement of a disturbance over the way that its largest first velocity makes in l/(4 c),
l the cell length and c the wave speed: about 1 or less in a stable motion. Every scheme loses its decimal logarithm in digits.
";

fn title(found: &Growth) -> String {
    let Growth { degree, cells, points, steps, .. } = found;
    format!(
        "growth, by splines of degree {degree} on {cells} cells: {points} points, {steps} steps"
    )
}

/// All disturbances of one motion.
fn single(found: &Growth) -> Table {
    let header = ["disturbance", "factor", "at the end", "tenfold at t", "estimate"];
    let mut table = Table::new(1, header);
    let mut add = |name: String, grown: &Grown, estimate: Option<f64>| {
        table.row([
            name,
            told(grown.factor),
            told(grown.at_end),
            grown.tenfold_at.map_or_else(|| "-".into(), |t| number::rounded(t, 3)),
            estimate.map_or_else(|| "-".into(), told),
        ]);
    };
    for wave in &found.waves {
        let name = match wave.waves {
            1 => "one wave along the body".to_owned(),
            count => format!("{count} waves"),
        };
        add(name, &wave.grown, Some(wave.estimate));
    }
    if let Some(largest) = &found.largest {
        let name = if found.is_settled { "the worst" } else { "the worst (not settled)" };
        add(name.to_owned(), largest, None);
    }
    table
}

/// A factor in a table.
fn told(factor: f64) -> String {
    match factor {
        factor if factor > mmsmith_verify::MOST_GROWTH => "> 1e16".to_owned(),
        factor if factor >= 1e4 => format!("{factor:.1e}"),
        factor => number::rounded(factor, 2),
    }
}

/// The judgement of one motion, and a better one.
fn judgement(point: &Point, found: &Growth) -> String {
    if found.factor < A_DIGIT {
        return "The motion is stable: no scheme loses a digit by it.\n".to_owned();
    }
    let Point { problem, .. } = point;
    format!(
        "UNSTABLE: errors grow {}, so that every scheme loses {:.1} digits.\nJudge schemes by {}.\n",
        times(found.factor),
        found.digits,
        instead(&problem.selection, problem.settled.case.periods)
    )
}

/// A row for each motion.
fn varied(options: &StabilityOptions, points: &[Point], found: &[Growth]) -> Table {
    let names = options.over.iter().map(|(name, _)| name.as_str());
    let header = names.chain([
        "one wave",
        "2 waves",
        "3 waves",
        "the worst",
        "digits",
        "p/mu",
        "tenfold at t",
    ]);
    let mut table = Table::new(0, header);
    for (point, found) in points.iter().zip(found) {
        let worst = found.largest.as_ref();
        let first = found.waves.first().map(|wave| &wave.grown);
        let tenfold = worst.into_iter().chain(first).filter_map(|grown| grown.tenfold_at);
        let tenfold = tenfold.reduce(f64::min);
        let mut cells = point.values.clone();
        cells.extend(found.waves.iter().map(|wave| told(wave.grown.factor)));
        cells.extend([
            worst.map_or_else(|| "-".into(), |worst| told(worst.factor)),
            format!("{:.1}", found.digits),
            number::rounded(found.extremes.pressure_over_mu, 2),
            tenfold.map_or_else(|| "-".into(), |t| number::rounded(t, 3)),
        ]);
        table.row(cells);
    }
    table
}

/// The rows with all digits.
fn sheet(options: &StabilityOptions, points: &[Point], found: &[Growth]) -> Sheet {
    let names = options.over.iter().map(|(name, _)| name.as_str());
    let mut sheet = Sheet::new(names.chain([
        "disturbance",
        "factor",
        "factor_l2",
        "at_end",
        "tenfold_at",
        "estimate",
        "pressure",
        "pressure_over_mu",
        "shear",
        "cells",
        "degree",
        "steps",
    ]));
    for (point, found) in points.iter().zip(found) {
        let number =
            |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
        let mut add = |name: String, grown: &Grown, estimate: Option<f64>| {
            let mut cells = point.values.clone();
            cells.push(name);
            let Grown { factor, factor_l2, at_end, tenfold_at, .. } = grown;
            let extremes = &found.extremes;
            cells.extend(
                [Some(*factor), Some(*factor_l2), Some(*at_end), *tenfold_at, estimate].map(number),
            );
            let told = [extremes.pressure, extremes.pressure_over_mu, extremes.shear];
            cells.extend(told.map(|value| format!("{value:?}")));
            cells.extend([found.cells, found.degree, found.steps].map(|count| count.to_string()));
            sheet.row(cells);
        };
        for wave in &found.waves {
            add(format!("{} waves", wave.waves), &wave.grown, Some(wave.estimate));
        }
        if let Some(largest) = &found.largest {
            add("worst".to_owned(), largest, None);
        }
    }
    sheet
}

/// A row as it is written to JSON: what was varied, then what was found.
fn row(options: &StabilityOptions, point: &Point, found: &Growth) -> Result<Value> {
    let mut row = Map::new();
    for ((name, _), value) in options.over.iter().zip(&point.values) {
        let number = value.parse::<f64>().ok().map(Value::from);
        row.insert(name.clone(), number.unwrap_or_else(|| value.as_str().into()));
    }
    if let Value::Object(found) = serde_json::to_value(found)? {
        row.extend(
            found
                .into_iter()
                .filter(|(name, _)| name != "cells" || !row.contains_key(name))
                .collect::<Vec<_>>(),
        );
    }
    Ok(row.into())
}
