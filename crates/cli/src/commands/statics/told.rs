//! Reports on equilibria.

use mmsmith_verify::{
    Behaviour, LINEAR, Norm, OrderVerdict, QUADRATIC, StaticRow, StaticStep, StaticStudy,
};
use serde_json::{Map, json};

use super::{Level, Problem};
use crate::number;
use crate::report::{Report, Section, Sheet, number as digits};
use crate::svg::{Curve, Plot};
use crate::table::{self, Table};
use crate::units::{Units, with_unit};

/// A line on the way.
pub(super) fn under_way(what: &str, factor: f64, residuals: &[f64]) -> String {
    let residual = residuals.last().copied().unwrap_or(f64::NAN);
    format!("{what}, load factor {}, residual {residual:.1e}", number::rounded(factor, 4))
}

/// The report on one case.
pub(super) fn run(problem: &Problem, row: &StaticRow) -> Report {
    let units = Units::of(&problem.selection);
    let verdict = Some(row.stopped.is_none());
    let mut said = format!(
        "{} cells, h = {}{}, {} points, {} unknowns, {} entries\n",
        row.cells,
        number::rounded(row.h, 4),
        units.map(|units| format!(" {}", units.length())).unwrap_or_default(),
        row.points,
        row.unknowns,
        row.entries,
    );
    let mut sections = Vec::new();
    said += &held(row);
    match &row.stopped {
        Some(why) => said += &stopped(problem, row, why),
        None => said += "status: ok\n",
    }
    if let Some(errors) = &row.errors {
        let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
        for (field, norms) in errors.iter() {
            let cells = norms.iter().map(|(_, value)| table::error(*value));
            table.row(std::iter::once(named(field, units)).chain(cells));
        }
        said += &table.text();
    }
    sections.push(Section::Note(said));
    if !row.load_steps.is_empty() {
        sections.push(Section::Table("residuals of Newton's method".into(), residuals(row)));
    }
    sections.push(Section::Note(format!("{}took {:.3} s\n", on_convergence(row), row.wall_s)));
    Report {
        command: "static",
        preface: String::new(),
        caption: problem.caption(),
        sections,
        settings: problem.settings(&json!(row.cells)),
        results: Map::from_iter([
            ("result".to_owned(), json!(row)),
            ("passed".to_owned(), json!(verdict)),
        ]),
        verdict,
    }
}

/// The report on load levels, of which those are solved that have rows.
pub(super) fn path(name: &str, levels: &[Level], rows: &[StaticRow]) -> Report {
    let first = &levels[0].problem;
    let units = Units::of(&first.selection);
    let is_whole = rows.len() == levels.len() && rows.iter().all(|row| row.stopped.is_none());
    let header = [name.to_owned()]
        .into_iter()
        .chain(["u", "F", "P"].map(|field| format!("l2 of {}", named(field, units))));
    let ends = ["steps", "Newton", "status"].map(str::to_owned);
    let mut table = Table::new(0, header.chain(ends));
    let mut notes = rows.first().map(held).unwrap_or_default();
    for (Level { value, problem }, row) in levels.iter().zip(rows) {
        let errors = row.errors.as_ref();
        let of = |field: &str| {
            let norms = errors.and_then(|errors| errors.get(field));
            norms.map_or_else(|| "-".to_owned(), |norms| table::error(norms.l2))
        };
        table.row([
            number::rounded(*value, 6),
            of("u"),
            of("F"),
            of("P"),
            row.load_steps.len().to_string(),
            exponent(row.exponent()),
            if row.stopped.is_none() { "ok".into() } else { "NOT REACHED".into() },
        ]);
        if let Some(why) = &row.stopped {
            notes += &format!("{name} = {value}: {}", stopped(problem, row, why));
        }
    }
    let values: Vec<f64> = levels.iter().map(|level| level.value).collect();
    let mut settings = first.settings(&json!(rows.first().map(|row| row.cells)));
    settings["along"] = json!({ "name": name, "values": values });
    Report {
        command: "static-path",
        preface: String::new(),
        caption: format!(
            "load levels {name} = {}\n{}",
            values.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
            first.caption(),
        ),
        sections: vec![
            Section::Table(format!("equilibria along {name}"), table),
            Section::Note(notes),
        ],
        settings,
        results: Map::from_iter([
            ("rows".to_owned(), json!(rows)),
            ("passed".to_owned(), json!(is_whole)),
        ]),
        verdict: Some(is_whole),
    }
}

/// Why a load was not reached, and the line to write instead.
fn stopped(problem: &Problem, row: &StaticRow, why: &str) -> String {
    // Load steps lead to a state that there is and that was not reached.
    if row.errors.is_some() || row.load_steps.is_empty() {
        return format!("NOT REACHED: {why}\n");
    }
    let more = (4 * problem.case.load_steps).max(8);
    format!(
        "NOT REACHED: {why}\nSmaller steps may get there, finer cells where the motion is steep within one:\n  mms run {} --static --cells {} \
         --load-steps {more}\n",
        problem.line, row.cells,
    )
}

/// A sentence on a body whose sides leave it free to move.
fn held(row: &StaticRow) -> String {
    let mut places: Vec<String> = Vec::new();
    for X in &row.held {
        let coordinates: Vec<String> = X.iter().map(|x| number::rounded(*x, 4)).collect();
        let place = format!("({})", coordinates.join(", "));
        if !places.contains(&place) {
            places.push(place);
        }
    }
    if places.is_empty() {
        return String::new();
    }
    format!(
        "The sides leave the body free to move as a whole: {} of the displacement, next to X = {}, {} the exact value, so that it cannot.\n",
        number::counted(row.held.len(), "coefficient"),
        places.join(", "),
        if row.held.len() == 1 { "has" } else { "have" },
    )
}

fn named(field: &str, units: Option<Units>) -> String {
    match (field, units) {
        ("u", Some(units)) => format!("u [{}]", units.length()),
        ("P", Some(units)) => format!("P [{}]", units.stress()),
        _ => field.to_owned(),
    }
}

/// Residuals of the load steps, a line each; the first ones and the last ones where there are many.
fn residuals(row: &StaticRow) -> Table {
    const MOST: usize = 12;
    let columns = row.load_steps.iter().map(|step| step.residuals.len()).max().unwrap_or(0);
    let names = (0..columns).map(|k| if k == 0 { "start".to_owned() } else { format!("{k}") });
    let header = ["load factor".to_owned()].into_iter().chain(names);
    let mut table = Table::new(0, header.chain(["exponent".to_owned()]));
    let count = row.load_steps.len();
    for (index, step) in row.load_steps.iter().enumerate() {
        if count > MOST && (MOST / 2..count - MOST / 2).contains(&index) {
            continue;
        }
        table.row(line(step, columns));
    }
    table
}

fn line(step: &StaticStep, columns: usize) -> Vec<String> {
    let mut cells = vec![number::rounded(step.factor, 6)];
    let residual = |k: usize| step.residuals.get(k).map(|value| format!("{value:.2e}"));
    cells.extend((0..columns).map(|k| residual(k).unwrap_or_default()));
    cells.push(exponent(step.exponent));
    cells
}

fn exponent(exponent: Option<f64>) -> String {
    exponent.map_or_else(|| "-".into(), |exponent| format!("{exponent:.2}"))
}

/// A sentence on how Newton's method converged.
fn on_convergence(row: &StaticRow) -> String {
    let cut_backs = match row.cut_backs {
        0 => String::new(),
        count => format!("{} of load steps\n", number::counted(count, "cut-back")),
    };
    let eliminated = row.load_steps.iter().any(|step| step.factors == "elimination");
    let way = match eliminated {
        true => {
            "The stiffness is not positive everywhere, or not symmetric: solved by elimination with pivots.\n"
        }
        false => "",
    };
    let told = match row.exponent() {
        _ if row.stopped.is_some() => String::new(),
        // From the undeformed body on, an exponent takes four residuals.
        None if row.load_steps.iter().any(|step| step.residuals.len() > 5) => {
            "NO EXPONENT: the last residuals above rounding do not fall one after the other, as those of Newton's method do.\n".into()
        }
        None => "Newton's method was at rounding before an exponent showed: the body is linear, or the load steps are small.\n".into(),
        Some(found) if found >= QUADRATIC => {
            format!("Newton's method converged quadratically: exponent {found:.2} of the last three residuals above rounding.\n")
        }
        Some(found) if found > LINEAR => format!(
            "Newton's method has the exponent {found:.2} by the last three residuals above rounding: too few to tell. More and shorter load \
             steps (--load-steps) begin nearer to the equilibrium.\n"
        ),
        Some(found) => format!(
            "NOT QUADRATIC: exponent {found:.2} of the last three residuals above rounding, where Newton's method has 2; a load step that is \
             cut shorter, or a kink of the law, shows so.\n"
        ),
    };
    format!("{cut_backs}{way}{told}")
}

/// The report on a series of grids.
pub(super) fn orders(problem: &Problem, study: &StaticStudy, not_judged: Option<String>) -> Report {
    let units = Units::of(&problem.selection);
    let length = units.map(Units::length);
    let mut sections = Vec::new();
    for (field, _) in study.orders.iter() {
        let title = format!("error of {}", named(field, units));
        sections.push(Section::Table(title, errors(study, field).with_unit(&["h"], length)));
    }
    sections.push(Section::Table("verdicts".into(), verdicts(study)));
    let mut notes = study.rows.last().map(held).unwrap_or_default();
    for row in &study.rows {
        if let Some(why) = &row.stopped {
            notes += &format!("{} cells: {}", row.cells, stopped(problem, row, why));
        }
    }
    notes += &not_judged.iter().map(|reason| format!("{reason}\n")).collect::<String>();
    notes += &on_verdicts(study);
    sections.push(Section::Note(notes));
    sections.push(Section::Sheet(sheet(study)));
    let curve = |norm: Norm| {
        let cases = study.rows.iter().map(|row| (row.h, row.errors.map(|errors| errors.u[norm])));
        Curve::new(norm.caption(), cases, study.orders.u[norm].fit)
    };
    let (x, y) = (with_unit("grid spacing h", length), with_unit("error of u", length));
    let title = format!("{}: error of u at equilibrium", problem.selection.name());
    let degree = problem.case.total.degree as i32;
    let (curves, caption) = (Vec::from(Norm::ALL.map(curve)), problem.caption());
    let note = caption.trim_end();
    let orders = [degree, degree + 1];
    let plot = Plot { title: &title, x: &x, y: &y, curves, note, orders: &orders, floor: None };
    sections.push(Section::Plot(plot.svg()));
    let cells: Vec<usize> = study.rows.iter().map(|row| row.cells).collect();
    let verdict = study.passed();
    Report {
        command: "static-orders",
        preface: String::new(),
        caption: problem.caption(),
        sections,
        settings: problem.settings(&json!(cells)),
        results: Map::from_iter([
            ("rows".to_owned(), json!(study.rows)),
            ("orders".to_owned(), json!(study.orders)),
            ("verdicts".to_owned(), json!(study.verdicts)),
            ("passed".to_owned(), json!(verdict)),
        ])
        .into_iter()
        .chain(not_judged.map(|reason| ("not_judged".to_owned(), json!(reason))))
        .collect(),
        verdict,
    }
}

/// Lines on verdicts that coarse grids or rounding leave open.
fn on_verdicts(study: &StaticStudy) -> String {
    let any = |behaviour: Behaviour| {
        let mut norms = study.verdicts.iter().flat_map(|(_, norms)| norms.iter());
        norms.any(|(_, one)| one.behaviour == behaviour)
    };
    let mut notes = String::new();
    if any(Behaviour::TooCoarse) {
        let finer: Vec<String> = study.rows.iter().map(|row| (2 * row.cells).to_string()).collect();
        notes += &format!(
            "Too coarse: the order is almost the expected one, as before the asymptotic range. --cells {} would tell.\n",
            finer.join(",")
        );
    }
    if any(Behaviour::AtRounding) {
        notes += "Errors that rounding alone may cause have no order; verdicts leave them out.\n";
    }
    notes
}

/// Errors of a field, with their rates and Newton's exponent.
fn errors(study: &StaticStudy, field: &str) -> Table {
    let header = ["cells", "h", "linf", "rate", "l2", "rate", "l1", "rate", "Newton"];
    let mut table = Table::new(0, header);
    let orders = study.orders.get(field);
    for (index, row) in study.rows.iter().enumerate() {
        let mut cells = vec![row.cells.to_string(), table::error(row.h)];
        let own = row.errors.as_ref().and_then(|errors| errors.get(field));
        for norm in Norm::ALL {
            let error = own.map_or(f64::NAN, |norms| norms[norm]);
            let local = index.checked_sub(1).and_then(|pair| orders?[norm].local[pair]);
            cells.extend([table::error(error), table::rate(local)]);
        }
        cells.push(if row.stopped.is_some() { "STOPPED".into() } else { exponent(row.exponent()) });
        table.row(cells);
    }
    table
}

fn verdicts(study: &StaticStudy) -> Table {
    let header = ["field", "norm", "expected", "order", "verdict"];
    let mut table = Table::new(2, header).flowing(30);
    for (field, norms) in study.verdicts.iter() {
        for (norm, one) in norms.iter() {
            let expected = one
                .expected
                .map_or_else(|| "-".into(), |order| format!("{order} +/- {}", one.tolerance));
            let cells = [field.to_owned(), norm.to_string(), expected, table::rate(one.finest)];
            table.row(cells.into_iter().chain([words(one)]));
        }
    }
    table
}

fn words(one: &OrderVerdict) -> String {
    let behaviour = match one.behaviour {
        Behaviour::Asymptotic => "asymptotic",
        Behaviour::NotSettled => "no asymptotic range",
        Behaviour::DoesNotConverge => "DOES NOT CONVERGE",
        Behaviour::TooCoarse => "cannot tell: too coarse",
        Behaviour::Stopped => "the finest load was NOT REACHED",
        Behaviour::NotJudged => "not judged",
        Behaviour::AtRounding => "too few errors above rounding",
        Behaviour::NoOrder => "no order",
    };
    match one.passed {
        None => behaviour.to_owned(),
        Some(true) => format!("passed, {behaviour}"),
        Some(false) => format!("FAILED, {behaviour}"),
    }
}

/// All numbers, a line for each grid.
fn sheet(study: &StaticStudy) -> Sheet {
    let first = ["cells", "h", "points", "unknowns", "wall_s", "cut_backs", "exponent", "status"];
    let fields = study.orders.iter().flat_map(|(field, norms)| {
        norms.iter().map(move |(norm, _)| format!("{field}_{norm}")).collect::<Vec<_>>()
    });
    let mut sheet = Sheet::new(first.map(str::to_owned).into_iter().chain(fields));
    for row in &study.rows {
        let first = [
            row.cells.to_string(),
            digits(row.h),
            row.points.to_string(),
            row.unknowns.to_string(),
            digits(row.wall_s),
            row.cut_backs.to_string(),
            row.exponent().map_or_else(|| "nan".into(), digits),
            row.stopped.clone().unwrap_or_else(|| "ok".into()),
        ];
        let errors = study.orders.iter().flat_map(|(field, _)| {
            let own = row.errors.as_ref().and_then(|errors| errors.get(field));
            Norm::ALL.map(|norm| digits(own.map_or(f64::NAN, |norms| norms[norm])))
        });
        sheet.row(first.into_iter().chain(errors.collect::<Vec<_>>()));
    }
    sheet
}
