//! `mms stability`: the largest stable time step, and what becomes of it at the extremes.

mod exact;
mod random;
mod vary;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{
    Case, Criteria, Discretized, Failure, FailureKind, Observed, Search, SearchProgress,
    StabilityRow, USUAL_CFL, is_stable, stability as find,
};
use serde_json::{Map, Value, json};

use super::growth::Warnings;
use super::problem::{Model, Problem, extent};
use super::scheme::Settled;
use super::study::{Request, Show, Study, conduct};
use crate::arguments::{SchemeOptions, StabilityOptions};
use crate::keep::Order;
use crate::library::Selection;
use crate::processes::with_threads;
use crate::report::{Asked, Form, Report, Section, Sheet};
use crate::svg::{Limits, Map as Chart};
use crate::table::Table;

/// One point of a line or map: what is set, and the problem that follows from it.
struct Point {
    /// The values of the varied settings here, in their order.
    values: Vec<String>,
    /// With the number of cells that the point has.
    problem: Problem,
}

/// The CFL number is what is looked for; where none is said, numbers refer to the speed that they usually have.
fn with_cfl(options: &SchemeOptions) -> SchemeOptions {
    SchemeOptions { cfl: options.cfl.or(Some(USUAL_CFL)), ..options.clone() }
}

impl Point {
    fn new(
        values: Vec<String>,
        selection: Selection,
        options: &SchemeOptions,
        cells: usize,
    ) -> Result<Self> {
        let mut problem = Problem::new(selection, &with_cfl(options))?;
        problem.settled.case.cells = cells;
        Ok(Self { values, problem })
    }

    /// Its case on its grid. The finest step that a search may come to is not known; memory does not depend on it.
    fn admit(&self) -> Result<Discretized<'_>> {
        let case = Case { cfl: 0.5, ..self.problem.settled.case };
        self.problem.model.admit(&[case])?.pop().context("one case")
    }

    /// The setting as it is varied, such as `nu = 0.3`.
    fn place(&self, options: &StabilityOptions, between: &str) -> String {
        let all = options.over.iter().zip(&self.values);
        let all: Vec<_> = all.map(|((name, _), value)| format!("{name}{between}{value}")).collect();
        all.join(", ")
    }
}

pub(crate) fn stability(options: &StabilityOptions) -> Result<bool> {
    let criteria =
        Criteria { error_multiple: options.error_multiple, energy_rate: options.energy_rate };
    if options.exact {
        return exact::exact(options);
    }
    if let (Some(cfl), None) = (options.scheme.cfl, options.search) {
        bail!(
            "--cfl {cfl}: the CFL number is what is looked for; --at {cfl} judges one, --lower and --upper say where to look, and --cfl belongs \
             to --search"
        );
    }
    if let (Some(_), Some(shard)) = (options.at, options.kept.shard) {
        bail!("--at --shard {shard}: one run is one case; leave --shard out");
    }
    if let Some(cfl) = options.at {
        return judge(options, cfl, &criteria);
    }
    if options.search.is_some() {
        return random::search(options, &criteria);
    }
    survey(options, |found| conduct(found, &request(options)))
}

/// The request for a study with these options.
fn request(options: &StabilityOptions) -> Request<'_> {
    let StabilityOptions { scheme, plot, csv, .. } = options;
    Request {
        solution: &options.name,
        kept: &options.kept,
        threads: options.scheme.threads,
        files: Asked(vec![(Form::Json, &scheme.json), (Form::Plot, plot), (Form::Csv, csv)]),
        others: vec![],
    }
}

/// The limits over what is varied.
pub(super) struct Survey<'a> {
    options: &'a StabilityOptions,
    /// Without what is varied.
    common: Problem,
    search: Search,
    points: &'a [Point],
    cases: Vec<Discretized<'a>>,
}

/// Does something with the survey that is asked for.
pub(super) fn survey<R>(
    options: &StabilityOptions,
    work: impl FnOnce(&Survey<'_>) -> Result<R>,
) -> Result<R> {
    let criteria =
        Criteria { error_multiple: options.error_multiple, energy_rate: options.energy_rate };
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let points = vary::points(options, &options.scheme, &selection)?;
    let cases = points.iter().map(|point| match point.place(options, "=") {
        place if place.is_empty() => point.admit(),
        place => point.admit().with_context(|| format!("--over {place}")),
    });
    let cases = cases.collect::<Result<_>>()?;
    let (lower, upper) = (options.lower, options.upper);
    if let (Some(lower), Some(upper)) = (lower, upper)
        && lower >= upper
    {
        bail!("--lower {lower} --upper {upper}: the lower CFL number must be below the upper one");
    }
    let search = Search { lower, upper, width: options.width, criteria };
    points.iter().try_for_each(|point| search.validate(point.problem.model.arithmetic()))?;
    let first = &points[0].problem;
    // What is varied may have no meaning without its values.
    let settled = Settled::settle(&with_cfl(&options.scheme), &first.model.exact);
    let settled = settled.unwrap_or_else(|_| first.settled.clone());
    let model = Model::new(&first.selection, options.scheme.precision)?;
    let common = Problem { selection, model, settled };
    work(&Survey { options, common, search, points: &points, cases })
}

impl Study for Survey<'_> {
    type Found = StabilityRow;

    /// The cases are independent, and go side by side where there are several.
    fn order(&self) -> Order {
        if self.points.len() > 1 { Order::AtOnce } else { Order::OneByOne }
    }

    fn keys(&self) -> Vec<Value> {
        let key = |(point, case): (&Point, &Discretized<'_>)| {
            let (cells, extent) = (case.case().cells, case.plan().extent);
            let case = point.problem.settings(extent, cells, Value::Null);
            without_threads(json!({ "case": case, "search": self.search }))
        };
        self.points.iter().zip(&self.cases).map(key).collect()
    }

    /// Work of a run of each point at one CFL number; searches take about as many runs.
    fn work(&self) -> Vec<f64> {
        self.cases.iter().map(|case| case.plan().work()).collect()
    }

    fn measure(&self, index: usize, show: &Show<'_>) -> Result<StabilityRow> {
        let point = &self.points[index];
        let name = match point.values.as_slice() {
            [] => point.problem.selection.name().to_owned(),
            values => values.join(", "),
        };
        let mut progress = |SearchProgress { run, share }: SearchProgress| {
            show.share(|| format!("{name}, run {run}"), share);
        };
        let row = find(&self.cases[index], &self.search, &mut progress)?;
        show.share(|| name.clone(), 1.0);
        Ok(row)
    }

    fn report(&self, rows: Vec<StabilityRow>) -> Result<Report> {
        let Self { options, common, search, .. } = self;
        let extent = self.cases[0].plan().extent;
        let mut said = self.definition();
        if !self.names().contains(&"cells") {
            said = format!("{} cells\n{said}", options.grid_cells());
        }
        let title = format!("largest stable CFL number, to {} on P-waves", search.width);
        let mut results = Map::new();
        results.insert("over".into(), json!(self.names()));
        results.insert("search".into(), json!(search));
        let all = self.points.iter().zip(&rows);
        let all = all.map(|(point, row)| document(options, point, row));
        results.insert("rows".into(), all.collect::<Result<_>>()?);
        let (place, warnings) = self.warnings();
        warnings.insert(&mut results);
        let mut warned = warnings.text();
        if !warned.is_empty() && !place.is_empty() {
            warned += &format!("  That is so at {place}, and may be at others.\n");
        }
        Ok(Report {
            command: "stability",
            preface: common.settled.choice(),
            caption: common.caption(extent),
            sections: vec![
                Section::Note(said),
                Section::Table(title, self.table(&rows)),
                Section::Note(LEGEND.into()),
                Section::LeftOut("A wider terminal, --csv and --json have them."),
                Section::Note(self.notes(&rows) + &warned),
                Section::Sheet(self.sheet(&rows)),
                Section::Plot(picture(&common.selection, options, &rows)),
            ],
            settings: common.settings(extent, options.grid_cells(), Value::Null),
            results,
            verdict: None,
        })
    }
}

/// Judges one run.
fn judge(options: &StabilityOptions, cfl: f64, criteria: &Criteria) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let scheme = SchemeOptions { cfl: Some(cfl), ..options.scheme.clone() };
    let files = Asked(vec![(Form::Json, &scheme.json)]).prepare()?;
    let Point { problem, .. } = Point::new(Vec::new(), selection, &scheme, options.grid_cells())?;
    let cases = problem.model.admit(&[problem.settled.case])?;
    let extent = extent(&cases);
    with_threads(scheme.threads, || {
        let found = is_stable(&cases[0], criteria)?;
        let said = match &found.failure {
            None => format!("CFL {cfl}: stable over {} steps\n", found.steps),
            Some(failure) => format!("CFL {cfl}: UNSTABLE: {}\n", told(failure)),
        };
        let said = said + without_energy(&found);
        let warnings = Warnings::of(&problem);
        let results = [("criteria", json!(criteria)), ("result", json!(found))];
        let mut results: Map<String, Value> =
            results.map(|(name, value)| (name.to_owned(), value)).into_iter().collect();
        warnings.insert(&mut results);
        let report = Report {
            command: "stability",
            preface: problem.settled.choice(),
            caption: problem.caption(extent),
            sections: vec![Section::Note(definition(criteria) + &said + &warnings.text())],
            settings: problem.settings(extent, options.grid_cells(), cfl),
            results,
            verdict: Some(found.failure.is_none()),
        };
        report.publish(files)
    })
}

/// Results do not depend on the number of threads.
fn without_threads(mut key: Value) -> Value {
    if let Some(case) = key["case"].as_object_mut() {
        case.remove("threads");
    }
    key
}

/// Definition of 'unstable', in words.
fn definition(criteria: &Criteria) -> String {
    let Criteria { error_multiple, energy_rate } = criteria;
    format!(
        "A run is unstable if\n  a particle has J <= 0, leaves the grid, is too large for the weights, or is not finite;\n  the error \
         of u exceeds {error_multiple} times that of the reference run, at CFL 0.125 on P-waves, the part of it that its steps cause \
         grown with the order of the integrator; or\n  the energy exceeds the exact \
         one by more than the reference run's excess plus {energy_rate} times the largest exact energy per period.\n"
    )
}

/// A line where the energy cannot tell of an instability.
fn without_energy(run: &Observed) -> &'static str {
    match run.energy_drift {
        Some(_) => "",
        None => "The law has no strain energy: no run is called unstable by its energy.\n",
    }
}

/// Meanings of the table's columns.
const LEGEND: &str = "\
stable, unstable: CFL numbers on either side of the limit
on P-waves: the stable number, on the speed of P-waves
predicted: the number at which a P-wave crosses one cell in one step
error, energy, momentum: largest error of u and drifts at the stable number
";

/// A number with three decimals, or a dash.
fn three(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.3}"))
}

fn kind(kind: FailureKind) -> &'static str {
    match kind {
        FailureKind::Inverted => "J <= 0",
        FailureKind::NotFinite => "not finite",
        FailureKind::LeftGrid => "left the grid",
        FailureKind::TooLarge => "too large",
        FailureKind::Error => "error",
        FailureKind::Energy => "energy",
    }
}

/// A failure in one line.
fn told(failure: &Failure) -> String {
    let particle = failure.particle.map(|p| format!(", particle {p}")).unwrap_or_default();
    let value = failure.value.map(|value| format!(", {value:.3e}")).unwrap_or_default();
    let limit = failure.limit.map(|limit| format!(" (limit {limit:.3e})")).unwrap_or_default();
    let Failure { step, time, .. } = failure;
    format!("{} at step {step}, t = {time:.4e}{particle}{value}{limit}", kind(failure.kind))
}

impl Survey<'_> {
    /// The warnings of the point where errors of the motion grow most, and that point.
    fn warnings(&self) -> (String, Warnings) {
        let of = |point: &Point| (point.place(self.options, " = "), Warnings::of(&point.problem));
        let all = self.points.iter().map(of);
        let worse = |one: (String, Warnings), other: (String, Warnings)| {
            if other.1.severity() > one.1.severity() { other } else { one }
        };
        all.reduce(worse).unwrap_or_else(|| (String::new(), Warnings::of(&self.common)))
    }

    fn names(&self) -> Vec<&str> {
        self.options.over.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// Definition of 'unstable', in words.
    pub(super) fn definition(&self) -> String {
        definition(&self.search.criteria)
    }

    pub(super) fn table(&self, rows: &[StabilityRow]) -> Table {
        let names = self.names();
        let header = names.iter().copied().chain([
            "stable",
            "unstable",
            "on P-waves",
            "predicted",
            "error",
            "energy",
            "momentum",
            "runs",
            "failure",
        ]);
        let n = names.len();
        let table = Table::new(0, header).sparing(n + 7..n + 8).sparing(n + 6..n + 7);
        let mut table = table.sparing(n + 5..n + 6).sparing(n + 4..n + 5).flowing(13);
        for (point, row) in self.points.iter().zip(rows) {
            let scientific = |value: Option<f64>| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1e}"))
            };
            let limit = row.at_limit.as_ref();
            let mut cells = point.values.clone();
            cells.extend([
                three(row.cfl_max),
                three(row.bracket[1]),
                three(row.p_wave_cfl),
                format!("{:.3}", row.p_wave_limit),
                scientific(limit.and_then(|run| run.error)),
                scientific(limit.and_then(|run| run.energy_drift)),
                scientific(limit.and_then(|run| run.momentum_drift)),
                row.runs.to_string(),
                row.failure.as_ref().map_or("-", |failure| kind(failure.kind)).to_owned(),
            ]);
            table.row(cells);
        }
        table
    }

    /// Facts that the table cannot say.
    pub(super) fn notes(&self, rows: &[StabilityRow]) -> String {
        let mut text = String::new();
        for (point, row) in self.points.iter().zip(rows) {
            let place = point.place(self.options, " = ");
            let place = if place.is_empty() { place } else { format!("{place}: ") };
            match (row.bracket, &row.failure) {
                ([Some(stable), None], _) => {
                    text +=
                        &format!("{place}stable at every CFL number tried, up to {stable:.3}\n");
                }
                ([None, Some(unstable)], Some(failure)) => {
                    text += &format!(
                        "{place}unstable at every CFL number tried, down to {unstable:.4}: {}\n",
                        told(failure)
                    );
                }
                _ => {}
            }
            match without_energy(&row.reference) {
                line if text.contains(line) => {}
                line => text += line,
            }
            for Observed { cfl, failure, .. } in &row.unstable_below {
                let failure = failure.as_ref().map(told).unwrap_or_default();
                text += &format!("{place}a hole below the limit, at CFL {cfl:.4}: {failure}\n");
            }
        }
        text
    }

    /// The rows with all digits.
    fn sheet(&self, rows: &[StabilityRow]) -> Sheet {
        let found = "cfl_max,stable,unstable,p_wave_cfl,p_wave_limit,failure,step,time,particle,value,limit,\
                     reference_error,error,energy_drift,momentum_drift,runs,unstable_below";
        let mut sheet = Sheet::new(self.names().into_iter().chain(found.split(',')));
        let number =
            |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
        for (point, row) in self.points.iter().zip(rows) {
            let failure = row.failure.as_ref();
            let limit = row.at_limit.as_ref();
            let below: Vec<_> =
                row.unstable_below.iter().map(|run| format!("{:?}", run.cfl)).collect();
            let mut cells: Vec<String> = point.values.clone();
            cells.extend([
                number(row.cfl_max),
                number(row.bracket[0]),
                number(row.bracket[1]),
                number(row.p_wave_cfl),
                number(Some(row.p_wave_limit)),
                failure.map(|failure| kind(failure.kind).to_owned()).unwrap_or_default(),
                failure.map(|failure| failure.step.to_string()).unwrap_or_default(),
                number(failure.map(|failure| failure.time)),
                failure
                    .and_then(|failure| failure.particle)
                    .map(|p| p.to_string())
                    .unwrap_or_default(),
                number(failure.and_then(|failure| failure.value)),
                number(failure.and_then(|failure| failure.limit)),
                number(row.reference.error),
                number(limit.and_then(|run| run.error)),
                number(limit.and_then(|run| run.energy_drift)),
                number(limit.and_then(|run| run.momentum_drift)),
                row.runs.to_string(),
                below.join(" "),
            ]);
            sheet.row(cells);
        }
        sheet
    }
}

/// A row as it is written to JSON: what was varied, then what was found.
fn document(options: &StabilityOptions, point: &Point, row: &StabilityRow) -> Result<Value> {
    let mut document = serde_json::Map::new();
    for ((name, _), value) in options.over.iter().zip(&point.values) {
        let number = value.parse::<f64>().ok().map(Value::from);
        document.insert(name.clone(), number.unwrap_or_else(|| value.as_str().into()));
    }
    if let Value::Object(found) = serde_json::to_value(row)? {
        document.extend(found);
    }
    Ok(document.into())
}

/// A line over one setting, a map over two.
fn picture(selection: &Selection, options: &StabilityOptions, rows: &[StabilityRow]) -> String {
    let title = format!("{}: largest stable CFL number", selection.name());
    let measured: Vec<Option<f64>> = rows.iter().map(|row| row.cfl_max).collect();
    let analytic: Vec<f64> = rows.iter().map(|row| row.p_wave_limit).collect();
    match options.over.as_slice() {
        [(x, columns), (y, lines)] => {
            let (x, y) = ((x.as_str(), columns.as_slice()), (y.as_str(), lines.as_slice()));
            // Rows come with the second setting changing fastest.
            Chart { title: &title, x, y, values: &measured, analytic: &analytic }.svg()
        }
        [(x, values), ..] => {
            Limits { title: &title, x, values, measured: &measured, analytic: &analytic }.svg()
        }
        [] => String::new(),
    }
}
