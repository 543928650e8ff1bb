//! `mms converge`: orders of accuracy.

use anyhow::{Context, Result, bail};
use mmsmith_solutions::{AnySolution, Domain};
use mmsmith_verify::{
    Behaviour, Case, Expected, Extent, Field, Norm, ORDER_TOLERANCE, Order as ObservedOrder,
    OrderVerdict, Outputs, PerField, PerNorm, Placement, Progress, Record, Row, Status, Study,
    StudyError, Sweep, Temporal, TemporalRecord, Values, expected_in_space, expected_in_time,
    orders_above, plan, run, temporal as measure_differences, verdicts_above,
};
use serde_json::{Value, json};

use super::remedy::{Advice, Given};
use super::scheme::Settled;
use super::{Model, caption, inversion, settings, with_threads};
use crate::arguments::{ConvergeOptions, SchemeOptions};
use crate::json::Output;
use crate::keep::{Found, Keep, Order};
use crate::library::Selection;
use crate::progress::Bar;
use crate::svg::{Curve, Plot};
use crate::table::{self, Table};
use crate::units::{self, Units, with_unit};
use crate::{csv, expect, terminal};

/// Orders of every field and norm, judged.
pub(super) type Verdicts = PerField<PerNorm<OrderVerdict>>;

pub(crate) fn converge(options: &ConvergeOptions) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let sweep = sweep(options)?;
    let asked = options.expect.as_deref().map(expect::parse).transpose()?;
    let tolerance = options.tolerance.unwrap_or(ORDER_TOLERANCE);
    let model = Model::new(&selection, options.scheme.precision)?;
    // The CFL numbers of a study in time are said, and the speed that they refer to is the one that such numbers have.
    let said = SchemeOptions {
        cfl: options.scheme.cfl.or(options.cfls.first().copied()),
        ..options.scheme.clone()
    };
    let settled = &Settled::settle(&said, &model.exact)?;
    let base = Case { cells: options.cells[0], ..settled.case };
    let extent = model.admit(&sweep.cases(&base))?;
    if let (Sweep::Cells(_), [only]) = (&sweep, options.cells.as_slice()) {
        terminal::warn(format_args!(
            "one grid has errors and no order: give at least two, such as --cells {only},{}; three show whether the order holds",
            2 * only
        ));
    }
    let keep = Keep::open(
        &options.kept,
        &options.name,
        &[
            ("--json", settled.json.is_some()),
            ("--plot", options.plot.is_some()),
            ("--csv", options.csv.is_some()),
            ("--markdown", options.markdown.is_some()),
            ("--latex", options.latex.is_some()),
            ("--expect", options.expect.is_some()),
            ("--tolerance", options.tolerance.is_some()),
        ],
    )?;
    let output = Output::prepare_if(settled.json.as_ref())?;
    let [plot, values, markdown, latex] =
        [&options.plot, &options.csv, &options.markdown, &options.latex]
            .map(|path| Output::prepare_if(path.as_ref()));
    let (plot, values, markdown, latex) = (plot?, values?, markdown?, latex?);
    with_threads(settled.threads, || {
        let expected = model.announce(&sweep.cases(&base));
        // The differences take each run once more, and one with half its step.
        let parts = if options.cfls.is_empty() { 1.0 } else { 4.0 };
        let predicted_s = expected.as_ref().map(|seconds| parts * seconds.iter().sum::<f64>());
        let whole = Bar::expecting("starting", predicted_s);
        let bar = whole.part(0.0, 1.0 / parts);
        let work = work(&model, &sweep.cases(&base))?;
        // Together the differences take each run once more, and one with half its step.
        let differences_work = 3.0 * work.iter().sum::<f64>();
        let own = match &sweep {
            Sweep::Cells(_) => keep.own(&work),
            Sweep::Cfls(_) => keep.own(&[work.as_slice(), &[differences_work]].concat()),
        };
        let (own, own_differences) = own.split_at(work.len());
        let expected = expected.unwrap_or(work);
        let records = rows(&model, &base, &sweep, (&keep, own), &expected, &bar, |case| {
            settings(&selection, settled, extent, case.cells, case.cfl)
        })?;
        let differences = match &sweep {
            Sweep::Cfls(cfls) => {
                let mut what = settings(&selection, settled, extent, base.cells, cfls);
                what["differences"] = true.into();
                let found = keep.all(
                    &[what],
                    own_differences,
                    Order::OneByOne,
                    |_| {},
                    |_| {
                        let bar = whole.part(1.0 / parts, 1.0);
                        differences(&model, &base, cfls, "difference", &bar)
                            .map(|found| TemporalRecord::from(&found))
                    },
                )?;
                Some(found)
            }
            Sweep::Cells(_) => None,
        };
        // It must not stand between the tables.
        drop((bar, whole));
        let (records, differences) = match (records, differences) {
            (Found::All(records), Some(Found::All(found))) => (records, found.into_iter().next()),
            (Found::All(records), _) => (records, None),
            (Found::Part(rows), Some(Found::Part(found))) => {
                terminal::say(&rows.and(&found).to_string())?;
                return Ok(true);
            }
            (Found::Part(rows), _) => {
                terminal::say(&rows.to_string())?;
                return Ok(true);
            }
        };
        let study = study(&model, &base, &sweep, records)?;
        // In time the expectation is about the differences; the total error is mostly a spatial one.
        let in_space = match (&sweep, asked) {
            (Sweep::Cells(_), Some(asked)) => asked,
            (Sweep::Cells(_), None) => expected_in_space(&model.exact, &base),
            (Sweep::Cfls(_), _) => Expected::default(),
        };
        let floors = floors(&model, &base, &sweep)?;
        // What theory promises is no failure where nothing can judge it; what was asked for is.
        let strict = options.expect.is_some() || options.tolerance.is_some();
        let coarsest = coarsest(&study, &sweep);
        let settle =
            |judged: Verdicts| if strict { judged } else { unless_unjudged(judged, coarsest) };
        let judged = settle(judge_above(&study, &sweep, &in_space, tolerance, &floors));
        let differences = differences.map(Temporal::from).map(|found| {
            let expected = asked.unwrap_or_else(|| expected_in_time(&base));
            let judged = settle(judge_differences(&found, &expected, tolerance));
            (found, judged)
        });

        let caption = caption(&selection, settled, extent);
        let units = Units::of(&selection);
        let (length, time) = (units.map(Units::length), units.map(Units::time));
        let mut sections: Vec<(String, Table)> = Vec::new();
        for (field, table) in tables(&study, &sweep, &judged) {
            let table = table.with_unit(&["h"], length);
            sections.push((format!("error of {}", units::named(field, units)), table));
        }
        let mut notes = stops(&study);
        if !notes.is_empty()
            && let Some(told) = inversion::measure(&selection)?
        {
            notes += &format!("{}\n", told.text());
        }
        if let Some((found, judged)) = &differences {
            for (field, table) in difference_tables(found, judged) {
                let title = format!("difference of {} on this grid", units::named(field, units));
                sections.push((title, table.with_unit(&["dt"], time)));
            }
            sections
                .push(("verdicts on the differences".into(), verdict_table(judged, "dt", true)));
            notes += "A difference is that of a run and the run with half its time step: what the time step alone does.\n";
        }
        notes += &way_out(&model.exact, &base, &study);
        let given = Given::of(&options.name, &options.scheme);
        let advice = advice(given, &model, &sweep.cases(&base), &study)?;
        notes += &advice.as_ref().map(Advice::text).unwrap_or_default();
        let what = if differences.is_some() { "verdicts on the errors" } else { "verdicts" };
        sections
            .push((what.into(), verdict_table(&judged, step_name(&sweep), differences.is_none())));
        if has_range(&judged) || differences.as_ref().is_some_and(|(_, judged)| has_range(judged)) {
            notes += "Rows in parentheses are outside the asymptotic range.\n";
        }
        let decisive = differences.as_ref().map_or(&judged, |(_, judged)| judged);
        notes += &on_range(decisive, study.rows.len());
        notes += &on_coarse(&judged, &study);
        if has_rounding(&judged) {
            notes += "A row at rounding has errors that rounding alone may cause; verdicts leave it out.\n";
        }
        let mut text = settled.choice() + &caption;
        for (title, table) in &sections {
            text += &format!("\n{title}\n{}", table.text());
        }
        let has = "A wider terminal, --csv and --json have them.";
        notes += &table::on_left_out(sections.iter().map(|(_, table)| table), has);
        terminal::say(&(text + &notes))?;

        let decisive = differences.as_ref().map_or(&judged, |(_, judged)| judged);
        let of_differences = differences.iter().flat_map(|(found, _)| &found.rows);
        let ends = study.rows.iter().map(|row| &row.status);
        let passed = passed(decisive, ends.chain(of_differences.map(|row| &row.status)));
        if let Some(output) = output {
            let mut document =
                document(&selection, settled, extent, &base, &sweep, &study, &judged);
            if let Some((found, judged)) = &differences {
                document["temporal"] = temporal_document(found, judged);
            }
            document["passed"] = json!(passed);
            if let Some(advice) = &advice {
                document["advice"] = advice.document();
            }
            output.write(&document)?;
        }
        if let Some(file) = values {
            let mut text = csv::text(&study);
            if let Some((found, _)) = &differences {
                // A second table, set apart by an empty line.
                text += &format!("\n{}", csv::temporal(found));
            }
            file.write_text(&text)?;
        }
        if let Some(file) = markdown {
            let sections = sections
                .iter()
                .map(|(title, table)| format!("\n## {title}\n\n{}", table.markdown()));
            file.write_text(&format!("# {caption}{}", sections.collect::<String>()))?;
        }
        if let Some(file) = latex {
            let sections =
                sections.iter().map(|(title, table)| format!("\n% {title}\n{}", table.latex()));
            let head = "% Needs \\usepackage{booktabs}.\n";
            file.write_text(&format!("% {caption}{head}{}", sections.collect::<String>()))?;
        }
        if let Some(file) = plot {
            let floor = round_off(&model, &base, &sweep)?;
            let title = format!("{}: error of u", selection.name());
            let note = super::setting(&selection, settled, extent);
            let found = differences.as_ref().map(|(found, _)| found);
            let told = Told { title: &title, note: &note, units };
            file.write_text(&picture(&told, &study, &sweep, found, floor))?;
        }
        Ok(passed != Some(false))
    })
}

/// Whether a study did what it promised: false where an order was missed or a run stopped, and `None` where nothing was judged.
fn passed<'a>(judged: &Verdicts, ends: impl IntoIterator<Item = &'a Status>) -> Option<bool> {
    if ends.into_iter().any(|end| end.passed() == Some(false)) {
        return Some(false);
    }
    let verdicts = || judged.iter().flat_map(|(_, norms)| norms.iter());
    let is = |passed: bool| verdicts().any(|(_, one)| one.passed == Some(passed));
    if is(false) { Some(false) } else { is(true).then_some(true) }
}

/// The work of each case, which is the same on every machine: particles times steps.
pub(super) fn work(model: &Model, cases: &[Case]) -> Result<Vec<f64>> {
    let work = |case| -> Result<f64> {
        let plan = plan(&model.exact, model.arithmetic(), case)?;
        Ok(plan.steps as f64 * plan.particles)
    };
    cases.iter().map(work).collect()
}

/// The rows of a study, those that are kept and the others. `keep` comes with which of them are this process's; `work` says how
/// far the bar goes with each.
fn rows(
    model: &Model,
    base: &Case,
    sweep: &Sweep,
    (keep, own): (&Keep, &[bool]),
    work: &[f64],
    bar: &Bar,
    settings: impl Fn(&Case) -> Value,
) -> Result<Found<Record>> {
    let cases = sweep.cases(base);
    let total: f64 = work.iter().sum();
    let keys: Vec<_> = cases.iter().map(settings).collect();
    let mark = |record: &mut Record| record.timed_alone = false;
    keep.all(&keys, own, Order::OneByOne, mark, |index| {
        let what = match &sweep {
            Sweep::Cells(cells) => format!("{} cells", cells[index]),
            Sweep::Cfls(cfls) => format!("CFL {}", cfls[index]),
        };
        let before: f64 = work[..index].iter().sum();
        let mut show = |progress: Progress| {
            let share = (before + progress.share * work[index]) / total;
            bar.show(&what, Progress { share, ..progress });
        };
        let mut outputs = Outputs::new(&mut show);
        let row = run(&model.exact, model.arithmetic(), &cases[index], &mut outputs);
        Ok(Record::from(&row.map_err(|cause| StudyError { index, cause })?))
    })
}

/// The study that rows make, with its orders.
fn study(model: &Model, base: &Case, sweep: &Sweep, records: Vec<Record>) -> Result<Study> {
    let mut study = Study::new(records.into_iter().map(Row::from).collect(), sweep);
    // Rows that rounding may have caused have no order.
    let steps: Vec<f64> = study.rows.iter().map(|row| step(row, sweep)).collect();
    let errors: Vec<_> =
        study.rows.iter().map(|row| (row.status == Status::Ok).then_some(&row.errors)).collect();
    study.orders = orders_above(&steps, &errors, &floors(model, base, sweep)?);
    Ok(study)
}

/// The differences over `cfls` on the grid of `base`; the bar says `what`.
pub(super) fn differences(
    model: &Model,
    base: &Case,
    cfls: &[f64],
    what: &str,
    bar: &Bar,
) -> Result<Temporal> {
    let mut show = |progress: mmsmith_verify::Progress| {
        bar.show(&format!("{what}, CFL {}", cfls[progress.case]), progress);
    };
    Ok(measure_differences(&model.exact, model.arithmetic(), base, cfls, &mut show)?)
}

/// The step that orders of a study are about.
fn step(row: &Row, sweep: &Sweep) -> f64 {
    if matches!(sweep, Sweep::Cells(_)) { row.h } else { row.dt }
}

/// Errors that rounding alone may cause, case by case.
fn floors(model: &Model, base: &Case, sweep: &Sweep) -> Result<Vec<PerField<f64>>> {
    let cases = sweep.cases(base).into_iter();
    let floors =
        cases.map(|case| mmsmith_verify::round_off(&model.exact, model.arithmetic(), &case));
    Ok(floors.collect::<Result<_, _>>()?)
}

/// Judges the errors of a study, large or small.
pub(super) fn judge(study: &Study, sweep: &Sweep, expected: &Expected, tolerance: f64) -> Verdicts {
    judge_above(study, sweep, expected, tolerance, &[])
}

/// Judges the errors of a study that are above what rounding alone may cause.
fn judge_above(
    study: &Study,
    sweep: &Sweep,
    expected: &Expected,
    tolerance: f64,
    floors: &[PerField<f64>],
) -> Verdicts {
    let nothing = {
        let none = PerNorm { linf: f64::NAN, l2: f64::NAN, l1: f64::NAN };
        PerField { u: none, v: none, F: none, P: none }
    };
    let steps: Vec<f64> = study.rows.iter().map(|row| step(row, sweep)).collect();
    let errors = study.rows.iter().map(|row| match &row.status {
        Status::Ok => Some(&row.errors),
        status if status.is_not_judged() => Some(&nothing),
        _ => None,
    });
    let errors: Vec<_> = errors.collect();
    verdicts_above(&Values { steps: &steps, errors: &errors, floors }, expected, tolerance)
}

/// The cells of the coarsest grid of a series of grids.
fn coarsest(study: &Study, sweep: &Sweep) -> Option<usize> {
    match sweep {
        Sweep::Cells(_) => study.rows.iter().map(|row| row.cells).min(),
        Sweep::Cfls(_) => None,
    }
}

/// Verdicts where an expectation that nothing can judge is none. Errors on coarse grids may fall faster than theory promises, or
/// somewhat slower: that is no failure, and no proof before the order has settled.
fn unless_unjudged(judged: Verdicts, coarsest: Option<usize>) -> Verdicts {
    let settle = |one: OrderVerdict| {
        let above = one.finest.zip(one.expected).map(|(order, expected)| order - expected);
        let is_unjudged = match one.behaviour {
            Behaviour::NoOrder | Behaviour::AtRounding => true,
            Behaviour::NotSettled => above.is_some_and(|above| above > one.tolerance),
            _ => false,
        };
        match coarsest {
            _ if is_unjudged => OrderVerdict { passed: None, ..one },
            Some(cells) => one.sparing_coarse_grids(cells),
            None => one,
        }
    };
    PerField::from_fn(|field| PerNorm::from_fn(|norm| settle(judged[field][norm].clone())))
}

/// Words of a table on how a case ended, and on its errors of one field.
fn status(status: &Status, is_rounding: bool) -> String {
    match status {
        Status::Ok if is_rounding => "at rounding",
        Status::Ok => "ok",
        Status::Exceeds { .. } => "error > u",
        other if other.is_not_judged() => "not judged",
        _ => "STOPPED",
    }
    .to_owned()
}

fn is_rounding(judged: &Verdicts, field: Field, row: usize) -> bool {
    judged[field].iter().any(|(_, one)| one.rounding_rows.contains(&row))
}

fn has_rounding(judged: &Verdicts) -> bool {
    judged.iter().any(|(_, norms)| norms.iter().any(|(_, one)| !one.rounding_rows.is_empty()))
}

/// Judges the differences on one grid.
pub(super) fn judge_differences(
    temporal: &Temporal,
    expected: &Expected,
    tolerance: f64,
) -> Verdicts {
    let steps: Vec<f64> = temporal.rows.iter().map(|row| row.dt).collect();
    let rows = temporal.rows.iter();
    let values = rows.map(|row| (row.status == Status::Ok).then_some(&row.differences));
    let errors: Vec<_> = values.collect();
    verdicts_above(&Values { steps: &steps, errors: &errors, floors: &[] }, expected, tolerance)
}

/// A study as it is written to JSON.
pub(super) fn document(
    selection: &Selection,
    settled: &Settled,
    extent: Option<Extent>,
    base: &Case,
    sweep: &Sweep,
    study: &Study,
    judged: &Verdicts,
) -> Value {
    let settings = match sweep {
        Sweep::Cells(cells) => settings(selection, settled, extent, cells, base.cfl),
        Sweep::Cfls(cfls) => settings(selection, settled, extent, base.cells, cfls),
    };
    json!({
        "schema": "mmsmith.converge/1",
        "settings": settings,
        "rows": study.rows,
        "orders": study.orders,
        "verdicts": judged,
    })
}

/// Differences as they are written to JSON.
pub(super) fn temporal_document(temporal: &Temporal, judged: &Verdicts) -> Value {
    json!({
        "times": temporal.times,
        "rows": temporal.rows,
        "orders": temporal.orders,
        "verdicts": judged,
    })
}

fn sweep(options: &ConvergeOptions) -> Result<Sweep> {
    if options.cfls.is_empty() {
        return Ok(Sweep::Cells(options.cells.clone()));
    }
    if options.cells.len() != 1 {
        bail!("--cfls: orders in time are measured on one grid, such as --cells 32");
    }
    Ok(Sweep::Cfls(options.cfls.clone()))
}

fn step_name(sweep: &Sweep) -> &'static str {
    if matches!(sweep, Sweep::Cells(_)) { "h" } else { "dt" }
}

const NORMS: [&str; 6] = ["linf", "rate", "l2", "rate", "l1", "rate"];

/// One table for each field: a row a case, and the rate right of each norm.
pub(super) fn tables(study: &Study, sweep: &Sweep, judged: &Verdicts) -> [(Field, Table); 4] {
    let errors: Vec<_> = study.rows.iter().map(|row| &row.errors).collect();
    let mut tables = Field::ALL.map(|field| {
        let header = ["cells", "particles", "h", "CFL"].into_iter().chain(NORMS).chain(["status"]);
        let table = Table::new(0, header).sparing(8..10).sparing(1..2).sparing(3..4);
        let mut table = table.sparing(6..8);
        for (index, row) in study.rows.iter().enumerate() {
            let mut cells = vec![
                row.cells.to_string(),
                row.particles.to_string(),
                table::error(row.h),
                format!("{:.4}", row.cfl),
            ];
            cells.extend(norms(index, field, errors[index], &study.orders, judged));
            cells.push(status(&row.status, is_rounding(judged, field, index)));
            table.row(cells);
        }
        let empty = String::new;
        table.row(fits(
            [format!("fit in {}", step_name(sweep)), empty(), empty(), empty()],
            field,
            &study.orders,
        ));
        (field, table)
    });
    table::align(&mut tables);
    tables
}

/// As [`tables`], for differences on one grid.
pub(super) fn difference_tables(temporal: &Temporal, judged: &Verdicts) -> [(Field, Table); 4] {
    let mut tables = Field::ALL.map(|field| {
        let header = ["dt", "CFL", "steps"].into_iter().chain(NORMS).chain(["status"]);
        let mut table = Table::new(0, header).sparing(7..9).sparing(2..3).sparing(5..7);
        for (index, row) in temporal.rows.iter().enumerate() {
            let mut cells =
                vec![table::error(row.dt), format!("{:.4}", row.cfl), row.steps.to_string()];
            cells.extend(norms(index, field, &row.differences, &temporal.orders, judged));
            cells.push(status(&row.status, is_rounding(judged, field, index)));
            table.row(cells);
        }
        let empty = String::new;
        table.row(fits(["fit in dt".into(), empty(), empty()], field, &temporal.orders));
        (field, table)
    });
    table::align(&mut tables);
    tables
}

/// Error and rate in each norm; in parentheses outside the asymptotic range, if there is one.
fn norms(
    row: usize,
    field: Field,
    errors: &PerField<PerNorm<f64>>,
    orders: &PerField<PerNorm<ObservedOrder>>,
    judged: &Verdicts,
) -> Vec<String> {
    Norm::ALL
        .into_iter()
        .flat_map(|norm| {
            let range = &judged[field][norm].asymptotic_rows;
            let error = table::error(errors[field][norm]);
            let outside = !range.is_empty() && !range.contains(&row) && error != "-";
            let local = row.checked_sub(1).and_then(|pair| orders[field][norm].local[pair]);
            [if outside { format!("({error})") } else { error }, table::rate(local)]
        })
        .collect()
}

fn fits<const N: usize>(
    first: [String; N],
    field: Field,
    orders: &PerField<PerNorm<ObservedOrder>>,
) -> Vec<String> {
    let mut cells = first.to_vec();
    for (_, order) in orders[field].iter() {
        cells.extend([String::new(), table::rate(order.fit)]);
    }
    cells
}

fn has_range(judged: &Verdicts) -> bool {
    judged.iter().any(|(_, norms)| norms.iter().any(|(_, one)| !one.asymptotic_rows.is_empty()))
}

/// Meaning of a missing asymptotic range, where a field has none.
fn on_range(judged: &Verdicts, rows: usize) -> String {
    let is_open = |one: &OrderVerdict| one.behaviour == Behaviour::NotSettled;
    if !judged.iter().any(|(_, norms)| norms.iter().any(|(_, one)| is_open(one))) {
        return String::new();
    }
    let remedy = match rows {
        0..=2 => "Two runs have one order, which nothing can confirm: add a third.",
        _ => "The orders of the last runs still differ: add a finer one.",
    };
    format!("No asymptotic range: it is open which order the errors tend to. {remedy}\n")
}

/// The remedy where grids are too coarse for a verdict.
fn on_coarse(judged: &Verdicts, study: &Study) -> String {
    let is_coarse = |one: &OrderVerdict| one.behaviour == Behaviour::TooCoarse;
    if !judged.iter().any(|(_, norms)| norms.iter().any(|(_, one)| is_coarse(one))) {
        return String::new();
    }
    let finer: Vec<String> = study.rows.iter().map(|row| (2 * row.cells).to_string()).collect();
    format!(
        "Too coarse: the order is almost the expected one, as before the asymptotic range. --cells {} would tell.\n",
        finer.join(",")
    )
}

/// Verdict on each field and norm, a row each. `is_decisive` where the result of the study hangs on it.
pub(super) fn verdict_table(judged: &Verdicts, step: &str, is_decisive: bool) -> Table {
    let header = ["field", "norm", "expected", "order", "leading term", "verdict"];
    let mut table = Table::new(2, header).sparing(4..5).flowing(37);
    for (field, norms) in judged.iter() {
        for (norm, one) in norms.iter() {
            let term = one
                .coefficient
                .zip(one.exponent)
                .map_or_else(|| "-".into(), |(c, p)| format!("{c:.3e} {step}^{p:.2}"));
            let behaviour = match one.behaviour {
                Behaviour::Asymptotic => "asymptotic",
                Behaviour::NotSettled => "no asymptotic range",
                Behaviour::DoesNotConverge if is_decisive => "DOES NOT CONVERGE",
                // The error of the grid, which a study of time steps leaves as it is.
                Behaviour::DoesNotConverge => "does not fall with dt",
                Behaviour::TooCoarse => "cannot tell: too coarse",
                Behaviour::Stopped => "the finest run STOPPED",
                Behaviour::NotJudged => "the finest run is not judged",
                Behaviour::AtRounding => "too few errors above rounding",
                Behaviour::NoOrder => "no order",
            };
            let verdict = match one.passed {
                None => behaviour.to_owned(),
                Some(true) => format!("passed, {behaviour}"),
                Some(false) => format!("FAILED, {behaviour}"),
            };
            let expected = one
                .expected
                .map_or_else(|| "-".into(), |order| format!("{order} +/- {}", one.tolerance));
            table.row([
                field.to_string(),
                norm.to_string(),
                expected,
                table::rate(one.finest),
                term,
                verdict,
            ]);
        }
    }
    table
}

/// A line for each case that did not reach its end time.
pub(super) fn stops(study: &Study) -> String {
    let stopped = study.rows.iter().filter(|row| row.status != Status::Ok);
    stopped
        .map(|row| {
            if row.status.is_not_judged() {
                return format!("{} cells, CFL {:.4}: {}\n", row.cells, row.cfl, row.status);
            }
            format!("STOPPED with {} cells, CFL {:.4}: {}\n", row.cells, row.cfl, row.status)
        })
        .collect()
}

/// Settings that run in place of the first case that stopped; nothing where none did.
fn advice(
    given: Given<'_>,
    model: &Model,
    cases: &[Case],
    study: &Study,
) -> Result<Option<Advice>> {
    let failed = |(_, row): &(&Case, &Row)| row.status.passed() == Some(false);
    match cases.iter().zip(&study.rows).find(failed) {
        Some((case, row)) => Advice::seek(given, model, case, row),
        None => Ok(None),
    }
}

/// Where a lattice that follows a curved boundary in steps has an order below one, what would cure it.
fn way_out(exact: &AnySolution<f64>, base: &Case, study: &Study) -> String {
    let is_ring =
        matches!(exact, AnySolution::Two(s) if matches!(s.domain(), Domain::Annulus { .. }));
    let placement = base.scheme.updated().map(|updated| updated.placement);
    let is_lattice = matches!(placement, Some(Placement::Lattice { .. }));
    let is_low = study.orders.u.linf.fit.is_some_and(|order| order < 1.0);
    if is_ring && is_lattice && is_low {
        return "The lattice follows the rims in steps, which costs the order: --layout clipped cuts it with them and has order 2.\n".into();
    }
    String::new()
}

/// The largest error of `u` that rounding alone may cause in any case of the sweep.
fn round_off(model: &Model, base: &Case, sweep: &Sweep) -> Result<f64> {
    let mut largest = 0.0_f64;
    for case in sweep.cases(base) {
        let plan = plan(&model.exact, model.arithmetic(), &case).context("--plot")?;
        largest = largest.max(plan.round_off);
    }
    Ok(largest)
}

/// Words of a picture on its study.
struct Told<'a> {
    title: &'a str,
    note: &'a str,
    units: Option<Units>,
}

/// The displacement error of one study in all norms, and in time the largest difference.
fn picture(
    told: &Told<'_>,
    study: &Study,
    sweep: &Sweep,
    differences: Option<&Temporal>,
    floor: f64,
) -> String {
    let Told { title, note, units } = *told;
    let orders = &study.orders.u;
    let x = match sweep {
        Sweep::Cells(_) => with_unit("grid spacing h", units.map(Units::length)),
        Sweep::Cfls(_) => with_unit("time step dt", units.map(Units::time)),
    };
    let y = with_unit("error of u", units.map(Units::length));
    let curve = |norm: Norm| {
        let cases = study.rows.iter().map(|row| {
            let step = if matches!(sweep, Sweep::Cells(_)) { row.h } else { row.dt };
            let error = row.errors.u[norm];
            (step, (row.status == Status::Ok).then_some(error))
        });
        Curve::new(norm.caption(), cases, orders[norm].fit)
    };
    let mut curves = Vec::from(Norm::ALL.map(curve));
    if let Some(found) = differences {
        curves.push(difference_curve("L_inf of the difference", found));
    }
    let floor = Some(floor);
    Plot { title, x: &x, y: &y, curves, note, orders: &[1, 2], floor }.svg()
}

/// The largest difference of `u` over the time step.
pub(super) fn difference_curve(name: impl Into<String>, found: &Temporal) -> Curve {
    let cases = found
        .rows
        .iter()
        .map(|row| (row.dt, (row.status == Status::Ok).then_some(row.differences.u.linf)));
    Curve::new(name, cases, found.orders.u.linf.fit)
}
