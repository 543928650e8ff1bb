//! A comparison in words and tables.

use mmsmith_verify::{
    Agreement, Convergence, Differences, Order, PerNorm, Quantity, Remark, Score, ScoreRow,
};

use crate::arguments::ScoreOptions;
use crate::library::Selection;
use crate::number;
use crate::report::Section;
use crate::table::{self, Table};
use crate::units::{Units, with_unit};

/// Recordings compared with each other.
pub(super) fn of_differences(selection: &Selection, compared: &Differences) -> Vec<Section> {
    let mut text = String::new();
    for row in &compared.rows {
        text += &format!(
            "{} and {}: {} particles, {} frame(s) at the same times\n",
            row.file, row.other, row.particles, row.frames
        );
        text += &told(&row.findings);
    }
    let mut fields: Vec<_> =
        compared.rows.iter().flat_map(|row| row.differences.keys().copied()).collect();
    fields.sort_unstable();
    fields.dedup();
    let units = Units::of(selection);
    let mut sections = vec![Section::Note(text)];
    for field in fields {
        let mut table = Table::new(0, ["dt", "linf", "rate", "l2", "rate", "l1", "rate", "status"]);
        for (index, row) in compared.rows.iter().enumerate() {
            let mut line = vec![table::error(row.dt)];
            for norm in mmsmith_verify::Norm::ALL {
                let value = row.differences.get(&field).map_or(f64::NAN, |norms| norms[norm]);
                let order = compared.orders.as_ref().and_then(|orders| orders.get(&field));
                let local = order.zip(index.checked_sub(1));
                let local = local.and_then(|(order, pair)| order[norm].local[pair]);
                line.extend([table::error(value), table::rate(local)]);
            }
            line.push(if row.status == "ok" { "ok" } else { "PROBLEM" }.into());
            table.row(line);
        }
        let table = table.with_unit(&["dt"], units.map(Units::time));
        sections.push(Section::Table(format!("difference of {}", named(field, units)), table));
    }
    sections
}

/// The line on a solution.
pub(super) fn caption(selection: &Selection) -> String {
    format!("{} ({})\n", selection.name(), selection.told_parameters())
}

/// Recordings against the exact solution.
pub(super) fn of_score(selection: &Selection, score: &Score) -> Vec<Section> {
    let units = Units::of(selection);
    let mut text: String = score.rows.iter().map(heading).collect();
    if score.orders.is_none() {
        text.extend(score.rows.iter().map(|row| errors(row, units)));
        return vec![Section::Note(text)];
    }
    let mut tables: Vec<(Quantity, Table)> = tables(score)
        .into_iter()
        .map(|(field, table)| (field, table.with_unit(&["h"], units.map(Units::length))))
        .collect();
    table::align(&mut tables);
    let titled =
        |(field, table)| Section::Table(format!("error of {}", named(field, units)), table);
    let mut sections = vec![Section::Note(text)];
    sections.extend(tables.into_iter().map(titled));
    sections.extend(across(score, units));
    sections.extend(integrated(score));
    sections.push(Section::LeftOut("A wider terminal and --json have them."));
    sections
}

/// The errors of tensors across the solution's plane or line, where they are more than rounding: a table for each.
fn across(score: &Score, units: Option<Units>) -> Vec<Section> {
    let mut sections = vec![];
    for (field, order) in score.across_orders.iter().flatten() {
        let error = |row: &ScoreRow| row.across.get(field).map_or(f64::NAN, |norms| norms.l2);
        let floor = |row: &ScoreRow| row.floors.get(field).copied().unwrap_or(0.0);
        if !score.rows.iter().any(|row| error(row) > floor(row)) {
            continue;
        }
        let mut table = Table::new(0, ["cells", "h", "l2", "rate"]);
        for (index, row) in score.rows.iter().enumerate() {
            let cells = row.cells.map_or_else(|| "-".into(), |cells| cells.to_string());
            let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
            table.row(vec![
                cells,
                table::error(row.h),
                table::error(error(row)),
                table::rate(local),
            ]);
        }
        let fit = ["fit in h".to_owned(), String::new(), String::new(), table::rate(order.fit)];
        table.row(fit.to_vec());
        let words = score.rows.first().map_or("", |row| row.direction);
        let table = table.with_unit(&["h"], units.map(Units::length));
        sections.push(Section::Table(format!("error of {}, {words}", named(*field, units)), table));
    }
    sections
}

/// The errors integrated over the elements of meshes; nothing where there are none.
fn integrated(score: &Score) -> Option<Section> {
    let orders = score.integrated_orders.as_ref()?;
    let mut table = Table::new(0, ["cells", "h", "l2", "rate", "h1", "rate"]);
    for (index, row) in score.rows.iter().enumerate() {
        let cells = row.cells.map_or_else(|| "-".into(), |cells| cells.to_string());
        let mut line = vec![cells, table::error(row.h)];
        for (order, of) in [(&orders.l2, 0), (&orders.h1, 1)] {
            let value = row.integrated.map_or(f64::NAN, |errors| [errors.l2, errors.h1][of]);
            let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
            line.extend([table::error(value), table::rate(local)]);
        }
        table.row(line);
    }
    let fit = |order: &Order| [String::new(), table::rate(order.fit)];
    let label = ["fit in h".to_owned(), String::new()];
    table.row(label.into_iter().chain(fit(&orders.l2)).chain(fit(&orders.h1)));
    Some(Section::Table("error of u over the elements, and of its gradient (h1)".into(), table))
}

/// A field with the unit of its errors, where it is known.
fn named(field: Quantity, units: Option<Units>) -> String {
    with_unit(&field.to_string(), units.and_then(|units| units.of_quantity(field)))
}

/// Summary of a recording, and the findings on it.
fn heading(row: &ScoreRow) -> String {
    let mut text = format!(
        "{}: {} particles, {} frame(s) from t = {:?} to {:?}, h = {}\n",
        row.file,
        row.particles,
        row.frames,
        row.first_time,
        row.last_time,
        number::rounded(row.h, 4)
    );
    text += &format!("  reference positions: {}\n", row.reference_positions.words());
    text += &format!("  displacements: {}\n", row.displacements.words());
    if row.is_ok() {
        text += "  status: ok\n";
    }
    text + &told(&row.findings)
}

fn told(findings: &[Remark]) -> String {
    let line = |finding: &Remark| {
        let label = if finding.is_problem { "PROBLEM" } else { "note" };
        format!("  {label}: {}\n", finding.message)
    };
    findings.iter().map(line).collect()
}

/// The errors of one recording.
fn errors(row: &ScoreRow, units: Option<Units>) -> String {
    let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
    for (field, norms) in &row.errors {
        if row.fields.contains(field) {
            let mut cells = vec![named(*field, units)];
            cells.extend(norms.iter().map(|(_, value)| table::error(*value)));
            table.row(cells);
        }
    }
    for (field, norms) in &row.across {
        let mut cells = vec![format!("{} {}", named(*field, units), row.direction)];
        cells.extend(norms.iter().map(|(_, value)| table::error(*value)));
        table.row(cells);
    }
    table.text()
}

/// One table for each field that any recording has: a row a recording, and the rate right of each norm.
fn tables(score: &Score) -> Vec<(Quantity, Table)> {
    let Some(orders) = &score.orders else { return vec![] };
    let known =
        orders.iter().filter(|(field, _)| score.rows.iter().any(|row| row.fields.contains(field)));
    let table = |(field, order): (&Quantity, &PerNorm<Order>)| {
        let header =
            ["cells", "particles", "h", "linf", "rate", "l2", "rate", "l1", "rate", "status"];
        let mut table = Table::new(0, header).sparing(7..9).sparing(1..2).sparing(5..7);
        for (index, row) in score.rows.iter().enumerate() {
            let cells = row.cells.map_or_else(|| "-".into(), |cells| cells.to_string());
            let mut line = vec![cells, row.particles.to_string(), table::error(row.h)];
            for (norm, order) in order.iter() {
                let value = row.errors.get(field).map_or(f64::NAN, |norms| norms[norm]);
                let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
                line.extend([table::error(value), table::rate(local)]);
            }
            line.push(if row.is_ok() { "ok" } else { "PROBLEM" }.into());
            table.row(line);
        }
        let mut fit = vec!["fit in h".to_owned(), String::new(), String::new()];
        for (_, order) in order.iter() {
            fit.extend([String::new(), table::rate(order.fit)]);
        }
        table.row(fit);
        (*field, table)
    };
    known.map(table).collect()
}

/// Whether the recordings converge, and whether they passed.
pub(super) fn verdict(score: &Score) -> String {
    let passed = match score.verdict.passed {
        Some(true) => "passed: ",
        Some(false) => "FAILED: ",
        None => "",
    };
    let advice = match score.verdict.kind {
        Convergence::DoesNotConverge => "mms diagnose names the mistake in a solver\n",
        Convergence::Converges | Convergence::CannotTell => "",
    };
    format!("\nverdict: {passed}{}\n{advice}", score.verdict.message)
}

/// Errors of the recording and of the run beside it.
pub(super) fn of_agreement(
    options: &ScoreOptions,
    row: &ScoreRow,
    agreement: &Agreement,
) -> Section {
    let header = ["error", "linf", "mms", "digits", "l2", "mms", "digits", "l1", "mms", "digits"];
    let mut table = Table::new(1, header).sparing(7..10);
    for (field, digits) in &agreement.digits {
        let mut line = vec![field.to_string()];
        for (norm, digits) in digits.iter() {
            let (theirs, ours) = (row.errors[field][norm], agreement.errors[field][norm]);
            line.extend([table::error(theirs), table::error(ours), format!("{digits:.1}")]);
        }
        table.row(line);
    }
    let scheme = options.against.map(|(shape, integrator)| format!("{shape} + {integrator}"));
    let title = format!(
        "{} beside mms, {}, {} steps of dt = {}",
        row.file,
        scheme.unwrap_or_default(),
        agreement.run.steps,
        number::rounded(agreement.run.dt, 4)
    );
    Section::Table(title, table)
}
