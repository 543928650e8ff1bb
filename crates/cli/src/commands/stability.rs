//! `mms stability`: the largest stable time step, and what becomes of it at the extremes.

mod random;
mod vary;

use anyhow::{Result, bail};
use mmsmith_verify::{
    Case, Criteria, Extent, Failure, FailureKind, Observed, Search, SearchProgress, StabilityRow,
    is_stable, stability as find,
};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicU64, Ordering};

use mmsmith_verify::USUAL_CFL;

use super::scheme::Settled;
use super::{Model, caption, converge, settings, with_threads};
use crate::arguments::{SchemeOptions, StabilityOptions};
use crate::csv;
use crate::json::Output;
use crate::keep::{Found, Keep, Order, Part};
use crate::library::Selection;
use crate::progress::Bar;
use crate::svg::{Limits, Map};
use crate::table::{self, Table};
use crate::terminal;

/// One point of a line or map: what is set, and the case that follows from it.
struct Point {
    /// The values of the varied settings here, in their order.
    values: Vec<String>,
    selection: Selection,
    /// With the number of cells that the point has.
    settled: Settled,
    model: Model,
    extent: Option<Extent>,
}

/// The CFL number is what is looked for; where none is said, numbers refer to the speed that they usually have.
fn settle(options: &SchemeOptions, model: &Model) -> Result<Settled> {
    let said = SchemeOptions { cfl: options.cfl.or(Some(USUAL_CFL)), ..options.clone() };
    Settled::settle(&said, &model.exact)
}

impl Point {
    fn new(
        values: Vec<String>,
        selection: Selection,
        options: &SchemeOptions,
        cells: usize,
    ) -> Result<Self> {
        let model = Model::new(&selection, options.precision)?;
        let mut settled = settle(options, &model)?;
        settled.case.cells = cells;
        // The finest step that a search may come to is not known; memory does not depend on it.
        let extent = model.admit(&[Case { cfl: 0.5, ..settled.case }])?;
        Ok(Self { values, selection, settled, model, extent })
    }

    /// Everything but the CFL number.
    fn settings(&self) -> Value {
        let cells = self.settled.case.cells;
        settings(&self.selection, &self.settled, self.extent, cells, Value::Null)
    }
}

pub(crate) fn stability(options: &StabilityOptions) -> Result<bool> {
    let criteria =
        Criteria { error_multiple: options.error_multiple, energy_rate: options.energy_rate };
    if let (Some(_), Some(shard)) = (options.at, options.kept.shard) {
        bail!("--at --shard {shard}: one run is one case; leave --shard out");
    }
    if let Some(cfl) = options.at {
        return judge(options, cfl, &criteria);
    }
    if options.search.is_some() {
        return random::search(options, &criteria);
    }
    let output = Output::prepare_if(options.scheme.json.as_ref())?;
    let [plot, values] =
        [&options.plot, &options.csv].map(|path| Output::prepare_if(path.as_ref()));
    let (plot, values) = (plot?, values?);
    with_threads(options.scheme.threads, || {
        let found = match survey(options, &Bar::new("largest stable CFL number"))? {
            Surveyed::All(found) => found,
            Surveyed::Part(part) => {
                terminal::say(&part.to_string())?;
                return Ok(true);
            }
        };
        terminal::say(&found.text())?;
        if let Some(output) = output {
            output.write(&found.document()?)?;
        }
        if let Some(file) = values {
            file.write_text(&found.sheet())?;
        }
        if let Some(file) = plot {
            file.write_text(&found.picture())?;
        }
        Ok(true)
    })
}

/// The limits over what was varied, to be told.
pub(super) struct Survey<'a> {
    options: &'a StabilityOptions,
    selection: Selection,
    settled: Settled,
    search: Search,
    points: Vec<Point>,
    rows: Vec<StabilityRow>,
}

/// The limits that were asked for, or a shard's part of them.
pub(super) enum Surveyed<'a> {
    All(Box<Survey<'a>>),
    Part(Part),
}

/// Looks for the limits that were asked for.
pub(super) fn survey<'a>(options: &'a StabilityOptions, bar: &Bar) -> Result<Surveyed<'a>> {
    let criteria =
        Criteria { error_multiple: options.error_multiple, energy_rate: options.energy_rate };
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let points = vary::points(options, &selection)?;
    let (lower, upper) = (options.lower, options.upper);
    if let (Some(lower), Some(upper)) = (lower, upper)
        && lower >= upper
    {
        bail!("--lower {lower} --upper {upper}: the lower CFL number must be below the upper one");
    }
    let search = Search { lower, upper, width: options.width, criteria };
    points.iter().try_for_each(|point| search.validate(point.model.arithmetic()))?;
    let outputs = [
        ("--json", options.scheme.json.is_some()),
        ("--plot", options.plot.is_some()),
        ("--csv", options.csv.is_some()),
    ];
    let keep = Keep::open(&options.kept, &options.name, &outputs)?;
    let rows = match limits(&points, &search, &keep, bar)? {
        Found::All(rows) => rows,
        Found::Part(part) => return Ok(Surveyed::Part(part)),
    };
    // What is varied may have no meaning without its values.
    let settled = settle(&options.scheme, &points[0].model);
    let settled = settled.unwrap_or_else(|_| points[0].settled.clone());
    let found = Survey { options, selection, settled, search, points, rows };
    Ok(Surveyed::All(Box::new(found)))
}

impl Survey<'_> {
    fn names(&self) -> Vec<&str> {
        self.options.over.iter().map(|(name, _)| name.as_str()).collect()
    }

    fn text(&self) -> String {
        let Self { options, selection, settled, search, points, .. } = self;
        let mut text = settled.choice() + &caption(selection, settled, points[0].extent);
        if !self.names().contains(&"cells") {
            text += &format!("{} cells\n", options.cells);
        }
        text += &self.definition();
        text += &format!("\nlargest stable CFL number, to {} on P-waves\n", search.width);
        let table = self.table();
        text += &table.text();
        text += LEGEND;
        let has = "A wider terminal, --csv and --json have them.";
        text += &table::on_left_out([&table], has);
        text += &self.notes();
        text
    }

    /// Definition of 'unstable', in words.
    pub(super) fn definition(&self) -> String {
        definition(&self.search.criteria)
    }

    pub(super) fn table(&self) -> Table {
        table(&self.names(), &self.points, &self.rows)
    }

    /// Facts that the table cannot say.
    pub(super) fn notes(&self) -> String {
        notes(&self.names(), &self.points, &self.rows)
    }

    pub(super) fn document(&self) -> Result<Value> {
        let Self { options, selection, settled, search, points, rows } = self;
        let settings = settings(selection, settled, points[0].extent, options.cells, Value::Null);
        let rows = points.iter().zip(rows).map(|(point, row)| document(options, point, row));
        Ok(json!({
            "schema": "mmsmith.stability/1",
            "settings": settings,
            "over": self.names(),
            "search": search,
            "rows": rows.collect::<Result<Vec<_>>>()?,
        }))
    }

    pub(super) fn sheet(&self) -> String {
        sheet(&self.names(), &self.points, &self.rows)
    }

    pub(super) fn picture(&self) -> String {
        picture(&self.selection, self.options, &self.rows)
    }
}

/// Judges one run.
fn judge(options: &StabilityOptions, cfl: f64, criteria: &Criteria) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let scheme = SchemeOptions { cfl: Some(cfl), ..options.scheme.clone() };
    let output = Output::prepare_if(scheme.json.as_ref())?;
    let point = Point::new(Vec::new(), selection, &scheme, options.cells)?;
    let Point { selection, settled, model, extent, .. } = &point;
    with_threads(settled.threads, || {
        let found = is_stable(&model.exact, model.arithmetic(), &settled.case, criteria)?;
        let mut text = settled.choice() + &caption(selection, settled, *extent);
        text += &definition(criteria);
        text += &match &found.failure {
            None => format!("CFL {cfl}: stable over {} steps\n", found.steps),
            Some(failure) => format!("CFL {cfl}: UNSTABLE: {}\n", told(failure)),
        };
        terminal::say(&text)?;
        if let Some(output) = output {
            let settings = settings(selection, settled, *extent, options.cells, cfl);
            output.write(&json!({
                "schema": "mmsmith.stability/1",
                "settings": settings,
                "criteria": criteria,
                "result": found,
            }))?;
        }
        Ok(found.failure.is_none())
    })
}

/// The limits of all points; the cases are independent, and go side by side where there are several.
fn limits(
    points: &[Point],
    search: &Search,
    keep: &Keep,
    bar: &Bar,
) -> Result<Found<StabilityRow>> {
    let keys: Vec<_> = points
        .iter()
        .map(|point| json!({ "case": point.settings(), "search": search }))
        .map(without_threads)
        .collect();
    let order = if points.len() > 1 { Order::AtOnce } else { Order::OneByOne };
    let own = keep.own(&work(points)?);
    let shares = Shares::of(own.iter().filter(|own| **own).count());
    // Places among this process's own.
    let place = |index: usize| own[..index].iter().filter(|own| **own).count();
    keep.all(
        &keys,
        &own,
        order,
        |_| {},
        |index| {
            let point = &points[index];
            let name = match point.values.as_slice() {
                [] => point.selection.name().to_owned(),
                values => values.join(", "),
            };
            let mut show = |SearchProgress { run, share }: SearchProgress| {
                bar.show_share(|| format!("{name}, run {run}"), shares.set(place(index), share));
            };
            let Point { model, settled, .. } = point;
            let row = find(&model.exact, model.arithmetic(), &settled.case, search, &mut show)?;
            bar.show_share(|| name.clone(), shares.set(place(index), 1.0));
            Ok(row)
        },
    )
}

/// The work of a run of each point at one CFL number; searches take about as many runs.
fn work(points: &[Point]) -> Result<Vec<f64>> {
    let each = |Point { model, settled, .. }: &Point| converge::work(model, &[settled.case]);
    Ok(points.iter().map(each).collect::<Result<Vec<_>>>()?.concat())
}

/// How much of each case is done, where several are under way.
struct Shares(Vec<AtomicU64>);

impl Shares {
    fn of(cases: usize) -> Self {
        Self((0..cases).map(|_| AtomicU64::new(0.0_f64.to_bits())).collect())
    }

    /// Takes down the share of one case that is done, and gives that of all.
    fn set(&self, case: usize, share: f64) -> f64 {
        self.0[case].store(share.to_bits(), Ordering::Relaxed);
        let shares = self.0.iter().map(|share| f64::from_bits(share.load(Ordering::Relaxed)));
        shares.sum::<f64>() / self.0.len() as f64
    }
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
         of u exceeds {error_multiple} times that of the reference run, at CFL 0.125 on P-waves; or\n  the energy exceeds the exact \
         one by more than the reference run's excess plus {energy_rate} times the largest exact energy per period.\n"
    )
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

fn table(names: &[&str], points: &[Point], rows: &[StabilityRow]) -> Table {
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
    for (point, row) in points.iter().zip(rows) {
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
fn notes(names: &[&str], points: &[Point], rows: &[StabilityRow]) -> String {
    let mut text = String::new();
    for (point, row) in points.iter().zip(rows) {
        let place: Vec<_> = names
            .iter()
            .zip(&point.values)
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        let place =
            if place.is_empty() { String::new() } else { format!("{}: ", place.join(", ")) };
        match (row.bracket, &row.failure) {
            ([Some(stable), None], _) => {
                text += &format!("{place}stable at every CFL number tried, up to {stable:.3}\n");
            }
            ([None, Some(unstable)], Some(failure)) => {
                text += &format!(
                    "{place}unstable at every CFL number tried, down to {unstable:.4}: {}\n",
                    told(failure)
                );
            }
            _ => {}
        }
        for Observed { cfl, failure, .. } in &row.unstable_below {
            let failure = failure.as_ref().map(told).unwrap_or_default();
            text += &format!("{place}a hole below the limit, at CFL {cfl:.4}: {failure}\n");
        }
    }
    text
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

/// The rows as comma-separated values.
fn sheet(names: &[&str], points: &[Point], rows: &[StabilityRow]) -> String {
    let mut text = names.iter().map(|name| format!("{name},")).collect::<String>()
        + "cfl_max,stable,unstable,p_wave_cfl,p_wave_limit,failure,step,time,particle,value,limit,\
           reference_error,error,energy_drift,momentum_drift,runs,unstable_below\n";
    let number = |value: Option<f64>| value.map(|value| format!("{value:?}")).unwrap_or_default();
    for (point, row) in points.iter().zip(rows) {
        let failure = row.failure.as_ref();
        let limit = row.at_limit.as_ref();
        let below: Vec<_> = row.unstable_below.iter().map(|run| format!("{:?}", run.cfl)).collect();
        let mut cells: Vec<String> = point.values.iter().map(|value| csv::quoted(value)).collect();
        cells.extend([
            number(row.cfl_max),
            number(row.bracket[0]),
            number(row.bracket[1]),
            number(row.p_wave_cfl),
            number(Some(row.p_wave_limit)),
            failure.map(|failure| csv::quoted(kind(failure.kind))).unwrap_or_default(),
            failure.map(|failure| failure.step.to_string()).unwrap_or_default(),
            number(failure.map(|failure| failure.time)),
            failure.and_then(|failure| failure.particle).map(|p| p.to_string()).unwrap_or_default(),
            number(failure.and_then(|failure| failure.value)),
            number(failure.and_then(|failure| failure.limit)),
            number(row.reference.error),
            number(limit.and_then(|run| run.error)),
            number(limit.and_then(|run| run.energy_drift)),
            number(limit.and_then(|run| run.momentum_drift)),
            row.runs.to_string(),
            below.join(" "),
        ]);
        text += &format!("{}\n", cells.join(","));
    }
    text
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
            Map { title: &title, x, y, values: &measured, analytic: &analytic }.svg()
        }
        [(x, values), ..] => {
            Limits { title: &title, x, values, measured: &measured, analytic: &analytic }.svg()
        }
        [] => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_side_by_side_have_one_share() {
        let shares = Shares::of(4);
        assert_eq!((shares.set(2, 0.5), shares.set(0, 1.0)), (0.125, 0.375));
        assert_eq!([1, 2, 3].map(|case| shares.set(case, 1.0))[2], 1.0);
    }
}
