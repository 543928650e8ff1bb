//! The report of a study of orders.

use anyhow::Result;
use mmsmith_solutions::{AnySolution, Domain};
use mmsmith_verify::{
    Behaviour, Case, Discretized, Field, Norm, Order as ObservedOrder, PerField, PerNorm,
    Placement, Row, Status, Study, Sweep, Temporal,
};
use serde_json::{Map, Value, json};

use super::Converge;
use super::growing::Growing;
use super::judged::{Judged, Verdicts, any, step};
use crate::commands::inversion;
use crate::commands::problem::extent;
use crate::commands::remedy::Advice;
use crate::report::{Report, Section};
use crate::sheets;
use crate::svg::{Curve, Plot};
use crate::table::{self, Table};
use crate::units::{self, Units, with_unit};

/// The report on a study.
pub(super) fn report(asked: &Converge<'_>, judged: &Judged) -> Result<Report> {
    let Converge { problem, sweep, base, cases, .. } = asked;
    let extent = extent(cases);
    let units = Units::of(&problem.selection);
    let advice = advice(asked, &judged.study)?;
    let growing = Growing::find(asked, judged);
    let mut sections = sections(judged, sweep, units);
    sections.push(Section::Note(notes(asked, judged, advice.as_ref(), growing.as_ref())?));
    sections.push(Section::LeftOut("A wider terminal, --csv and --json have them."));
    sections.push(Section::Sheet(sheets::study(&judged.study)));
    sections.extend(
        judged.differences.iter().map(|(found, _)| Section::Sheet(sheets::temporal(found))),
    );
    let note = problem.setting(extent);
    sections.push(Section::Plot(picture(asked, judged, &note, units)));
    let settings = match sweep {
        Sweep::Cells(cells) => problem.settings(extent, cells, base.cfl),
        Sweep::Cfls(cfls) => problem.settings(extent, base.cells, cfls),
    };
    let verdict = judged.passed();
    let mut results = results(&judged.study, &judged.verdicts);
    let internal = judged.study.internal_orders(sweep);
    if !internal.is_empty() {
        results["orders"]["internal"] = json!(internal);
    }
    results.insert("passed".into(), json!(verdict));
    if let Some(reason) = &judged.not_judged {
        results.insert("not_judged".into(), json!(reason));
    }
    asked.warnings().insert(&mut results);
    if let Some(growing) = &growing {
        growing.insert(&mut results);
    }
    if let Some((found, verdicts)) = &judged.differences {
        results.insert("temporal".into(), temporal_results(found, verdicts));
    }
    if let Some(advice) = &advice {
        results.insert("advice".into(), advice.document());
    }
    Ok(Report {
        command: "converge",
        preface: problem.settled.choice(),
        caption: problem.caption(extent),
        sections,
        settings,
        results,
        verdict,
    })
}

/// The tables.
fn sections(judged: &Judged, sweep: &Sweep, units: Option<Units>) -> Vec<Section> {
    let Judged { study, verdicts, differences, .. } = judged;
    let (length, time) = (units.map(Units::length), units.map(Units::time));
    let mut sections = Vec::new();
    for (field, table) in tables(study, sweep, verdicts) {
        let title = format!("error of {}", units::named(field, units));
        sections.push(Section::Table(title, table.with_unit(&["h"], length)));
    }
    for (name, orders) in study.internal_orders(sweep) {
        let table = internal_table(&name, study, sweep, &orders);
        sections.push(Section::Table(format!("error of {name}"), table));
    }
    if let Some((found, verdicts)) = differences {
        for (field, table) in difference_tables(found, verdicts) {
            let title = format!("difference of {} on this grid", units::named(field, units));
            sections.push(Section::Table(title, table.with_unit(&["dt"], time)));
        }
        let table = verdict_table(verdicts, "dt", true);
        sections.push(Section::Table("verdicts on the differences".into(), table));
    }
    let what = if differences.is_some() { "verdicts on the errors" } else { "verdicts" };
    let table = verdict_table(verdicts, step_name(sweep), differences.is_none());
    sections.push(Section::Table(what.into(), table));
    sections
}

/// Lines below the tables.
fn notes(
    asked: &Converge<'_>,
    judged: &Judged,
    advice: Option<&Advice>,
    growing: Option<&Growing>,
) -> Result<String> {
    let Converge { problem, base, .. } = asked;
    let Judged { study, verdicts, differences, .. } = judged;
    let mut notes = stops(study);
    if !notes.is_empty()
        && let Some(told) = inversion::measure(&problem.selection)?
    {
        notes += &format!("{}\n", told.text());
    }
    if differences.is_some() {
        notes += "A difference is that of a run and the run with half its time step: what the time step alone does.\n";
    }
    notes += &judged.not_judged.iter().map(|reason| format!("{reason}\n")).collect::<String>();
    notes += &asked.warnings().text();
    notes += &growing.map(Growing::text).unwrap_or_default();
    notes += &way_out(&problem.model.exact, base, study);
    notes += &advice.map(Advice::text).unwrap_or_default();
    let has_range = |judged: &Verdicts| any(judged, |one| !one.asymptotic_rows.is_empty());
    if has_range(verdicts) || has_range(judged.decisive()) {
        notes += "Rows in parentheses are outside the asymptotic range.\n";
    }
    notes += &on_range(judged.decisive(), study.rows.len());
    notes += &on_coarse(verdicts, study);
    if any(verdicts, |one| !one.rounding_rows.is_empty()) {
        notes +=
            "A row at rounding has errors that rounding alone may cause; verdicts leave it out.\n";
    }
    Ok(notes)
}

/// A study as it is written to JSON.
pub(in crate::commands) fn results(study: &Study, judged: &Verdicts) -> Map<String, Value> {
    let all =
        [("rows", json!(study.rows)), ("orders", json!(study.orders)), ("verdicts", json!(judged))];
    all.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}

/// Differences as they are written to JSON.
pub(in crate::commands) fn temporal_results(temporal: &Temporal, judged: &Verdicts) -> Value {
    json!({
        "times": temporal.times,
        "rows": temporal.rows,
        "orders": temporal.orders,
        "verdicts": judged,
    })
}

fn step_name(sweep: &Sweep) -> &'static str {
    if matches!(sweep, Sweep::Cells(_)) { "h" } else { "dt" }
}

const NORMS: [&str; 6] = ["linf", "rate", "l2", "rate", "l1", "rate"];

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

/// One table for each field: a row a case, and the rate right of each norm.
pub(in crate::commands) fn tables(
    study: &Study,
    sweep: &Sweep,
    judged: &Verdicts,
) -> [(Field, Table); 4] {
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

/// The errors of an internal variable and their orders.
fn internal_table(
    name: &str,
    study: &Study,
    sweep: &Sweep,
    orders: &PerNorm<ObservedOrder>,
) -> Table {
    let header = ["cells", step_name(sweep)].into_iter().chain(NORMS).chain(["status"]);
    let mut table = Table::new(0, header).sparing(6..8);
    for (index, row) in study.rows.iter().enumerate() {
        let own = row.internal.iter().find(|(known, _)| known == name);
        let mut cells = vec![row.cells.to_string(), table::error(step(row, sweep))];
        for norm in Norm::ALL {
            let local = index.checked_sub(1).and_then(|pair| orders[norm].local[pair]);
            let error = own.map_or_else(|| "-".to_owned(), |(_, norms)| table::error(norms[norm]));
            cells.extend([error, table::rate(local)]);
        }
        cells.push(status(&row.status, false));
        table.row(cells);
    }
    table
}

/// As [`tables`], for differences on one grid.
pub(in crate::commands) fn difference_tables(
    temporal: &Temporal,
    judged: &Verdicts,
) -> [(Field, Table); 4] {
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

/// Meaning of a missing asymptotic range, where a field has none.
fn on_range(judged: &Verdicts, rows: usize) -> String {
    if !any(judged, |one| one.behaviour == Behaviour::NotSettled) {
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
    if !any(judged, |one| one.behaviour == Behaviour::TooCoarse) {
        return String::new();
    }
    let finer: Vec<String> = study.rows.iter().map(|row| (2 * row.cells).to_string()).collect();
    format!(
        "Too coarse: the order is almost the expected one, as before the asymptotic range. --cells {} would tell.\n",
        finer.join(",")
    )
}

/// Verdict on each field and norm, a row each. `is_decisive` where the result of the study hangs on it.
pub(in crate::commands) fn verdict_table(
    judged: &Verdicts,
    step: &str,
    is_decisive: bool,
) -> Table {
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
fn stops(study: &Study) -> String {
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
fn advice(asked: &Converge<'_>, study: &Study) -> Result<Option<Advice>> {
    let failed = |(_, row): &(&Discretized<'_>, &Row)| row.status.passed() == Some(false);
    match asked.cases.iter().zip(&study.rows).find(failed) {
        Some((case, row)) => Advice::seek(asked.given, &asked.problem.model, case.case(), row),
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

/// The displacement error of one study in all norms, and in time the largest difference.
fn picture(asked: &Converge<'_>, judged: &Judged, note: &str, units: Option<Units>) -> String {
    let Converge { problem, sweep, cases, .. } = asked;
    let study = &judged.study;
    let x = match sweep {
        Sweep::Cells(_) => with_unit("grid spacing h", units.map(Units::length)),
        Sweep::Cfls(_) => with_unit("time step dt", units.map(Units::time)),
    };
    let y = with_unit("error of u", units.map(Units::length));
    let curve = |norm: Norm| {
        let cases = study.rows.iter().map(|row| {
            (step(row, sweep), (row.status == Status::Ok).then_some(row.errors.u[norm]))
        });
        Curve::new(norm.caption(), cases, study.orders.u[norm].fit)
    };
    let mut curves = Vec::from(Norm::ALL.map(curve));
    if let Some((found, _)) = &judged.differences {
        curves.push(difference_curve("L_inf of the difference", found));
    }
    // The largest error that rounding alone may cause in any case.
    let floor = Some(cases.iter().map(|case| case.plan().round_off).fold(0.0, f64::max));
    let title = format!("{}: error of u", problem.selection.name());
    Plot { title: &title, x: &x, y: &y, curves, note, orders: &[1, 2], floor }.svg()
}

/// The largest difference of `u` over the time step.
pub(in crate::commands) fn difference_curve(name: impl Into<String>, found: &Temporal) -> Curve {
    let cases = found
        .rows
        .iter()
        .map(|row| (row.dt, (row.status == Status::Ok).then_some(row.differences.u.linf)));
    Curve::new(name, cases, found.orders.u.linf.fit)
}
