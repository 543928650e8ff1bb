//! Energy that the integrators gain and lose over some periods.

use std::path::Path;

use anyhow::Result;
use mmsmith_verify::{
    Case, Moment, Outputs, Progress, Row, Shape, Status, Stepping, energy_drift, run as simulate,
};
use serde_json::json;

use super::section::Section;
use super::{CD, PROBLEMS, Pace, name, studied};
use crate::arguments::Precision;
use crate::commands::run::{course, drift_plot, history_document};
use crate::commands::scheme::{Settled, usual};
use crate::commands::{Model, settings};
use crate::csv;
use crate::json::Output;
use crate::progress::Agenda;
use crate::table::Table;

const CELLS: usize = 16;
const PERIODS: f64 = 10.0;
const STEPPINGS: [Stepping; 4] = [CD, Stepping::Usl, Stepping::Usf, Stepping::Musl];

fn case(stepping: Stepping) -> Case {
    Case { periods: PERIODS, ..usual(Shape::Gimp, stepping, CELLS) }
}

/// The runs of a problem.
pub(super) fn cases() -> [Case; STEPPINGS.len()] {
    STEPPINGS.map(case)
}

/// Runs both problems with every integrator and writes the histories into the folders of `out`.
pub(super) fn section(out: &Path, paces: &[Pace], agenda: &Agenda) -> Result<Section> {
    let said = format!(
        "Kinetic and strain energy of the particles, less that of the exact motion at the same particles and times, in units \
         of the exact motion's largest energy: {CELLS} cells, gimp, CFL 0.4, {PERIODS} periods. The body force does work, and \
         a solver whose waves have another speed takes up energy and gives it back: what returns is no instability."
    );
    let mut section = Section::new("drift", "Energy over time", &said);
    let mut figures = Vec::new();
    let mut tables = Vec::new();
    for (problem, pace) in PROBLEMS.into_iter().zip(paces) {
        let folder = out.join(problem);
        let selection = studied(problem, &[])?;
        let model = Model::new(&selection, Precision::F64)?;
        let mut curves = Vec::new();
        let header = ["scheme", "least", "largest", "at the end", "momentum", "status"];
        let mut table = Table::new(1, header);
        for stepping in STEPPINGS {
            let scheme = (Shape::Gimp, stepping);
            let base = case(stepping);
            let extent = model.admit(&[base])?;
            let stem = format!("drift-{}-{}", scheme.0, scheme.1);
            let json = Output::prepare(&folder.join(format!("{stem}.json")))?;
            let sheet = Output::prepare(&folder.join(format!("{stem}.csv")))?;
            let bar = agenda.next(pace.seconds(&[base]));
            let what = format!("{problem}, energy, {}", name(scheme));
            let (row, history) = run(&model, &base, &mut |progress| bar.show(&what, progress))?;
            json.write(&json!({
                "schema": "mmsmith.run/1",
                "settings": settings(&selection, &Settled::of(base), extent, CELLS, base.cfl),
                "result": row,
                "history": history_document(&history),
            }))?;
            sheet.write_text(&csv::history(&history))?;
            table.row(cells(name(scheme), &row, &history));
            curves.push(course(name(scheme), &model, &history));
            section.remember(problem, &stem, &["json", "csv"]);
        }
        let svg = drift_plot(&format!("{problem}: drift of energy"), curves);
        Output::prepare(&folder.join("drift.svg"))?.write_text(&svg)?;
        section.remember(problem, "drift", &["svg"]);
        let caption = format!("{problem} on {CELLS} cells; above zero the solver has more energy.");
        figures.push((svg, format!("{problem}/drift.svg"), caption));
        tables.push((table, format!("{problem}: drift of energy, and largest drift of momentum")));
    }
    section.figures(&figures);
    for (table, caption) in &tables {
        section.table(table, caption);
    }
    section.remembered();
    Ok(section)
}

fn run(model: &Model, case: &Case, show: &mut dyn FnMut(Progress)) -> Result<(Row, Vec<Moment>)> {
    let mut history = Vec::new();
    let mut outputs = Outputs { history: Some(&mut history), ..Outputs::new(show) };
    let row = simulate(&model.exact, model.arithmetic(), case, &mut outputs)?;
    Ok((row, history))
}

fn cells(name: String, row: &Row, history: &[Moment]) -> [String; 6] {
    let drift = energy_drift(history);
    let values = || drift.iter().map(|(_, drift)| *drift).filter(|drift| drift.is_finite());
    let told = |value: f64| format!("{value:.1e}");
    let size = |p: &[f64]| p.iter().map(|p| p * p).sum::<f64>().sqrt();
    let largest = history.iter().map(|moment| size(&moment.exact.momentum)).fold(0.0, f64::max);
    let difference = |moment: &Moment| {
        let pairs = moment.computed.momentum.iter().zip(&moment.exact.momentum);
        size(&pairs.map(|(p, q)| p - q).collect::<Vec<_>>())
    };
    let momentum = history.iter().map(difference).fold(0.0, f64::max) / largest;
    [
        name,
        told(values().fold(0.0, f64::min)),
        told(values().fold(0.0, f64::max)),
        values().next_back().map_or_else(|| "-".into(), told),
        if momentum.is_finite() { told(momentum) } else { "-".into() },
        if row.status == Status::Ok { "ok".into() } else { row.status.to_string() },
    ]
}
