//! Energy that the integrators gain and lose over some periods.

use std::path::Path;

use anyhow::{Result, bail};
use mmsmith_verify::{Case, Integrator, Moment, Outputs, Row, Shape, Status, energy_drift};
use serde_json::json;

use super::section::Section;
use super::{CD, PROBLEMS, Pace, name, studied};
use crate::commands::problem::Problem;
use crate::commands::run::{course, drift_plot, history_document};
use crate::commands::scheme::usual;
use crate::json::Output;
use crate::progress::Agenda;
use crate::report::{Files, Form, Report, Section as Part};
use crate::sheets;
use crate::table::Table;

const CELLS: usize = 16;
const PERIODS: f64 = 10.0;
const INTEGRATORS: [Integrator; 4] = [CD, Integrator::Usl, Integrator::Usf, Integrator::Musl];

fn case(integrator: Integrator) -> Case {
    Case { periods: PERIODS, ..usual(Shape::Gimp, integrator, CELLS) }
}

/// The runs of a problem.
pub(super) fn cases() -> [Case; INTEGRATORS.len()] {
    INTEGRATORS.map(case)
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
        let mut curves = Vec::new();
        let header = ["scheme", "least", "largest", "at the end", "momentum", "status"];
        let mut table = Table::new(1, header);
        for integrator in INTEGRATORS {
            let scheme = (Shape::Gimp, integrator);
            let base = case(integrator);
            let known = Problem::of(selection.clone(), base)?;
            let cases = known.model.admit(&[base])?;
            let [one] = cases.as_slice() else { bail!("a run has one case") };
            let stem = format!("drift-{}-{}", scheme.0, scheme.1);
            let files = Files::of_stem(&folder, &stem, &[Form::Json, Form::Csv])?;
            let bar = agenda.next(pace.seconds(&[base]));
            let what = format!("{problem}, energy, {}", name(scheme));
            let mut history = Vec::new();
            let show = &mut |progress| bar.show(&what, progress);
            let mut outputs = Outputs { history: Some(&mut history), ..Outputs::new(show) };
            let row = one.run(&mut outputs)?;
            let report = Report {
                settings: known.settings(one.plan().extent, CELLS, base.cfl),
                sections: vec![Part::Sheet(sheets::history(&history, false))],
                ..Report::new("run")
            };
            let report = report.with("result", json!(row));
            report.with("history", history_document(&history)).write(files)?;
            table.row(cells(name(scheme), &row, &history));
            curves.push(course(name(scheme), &known.model, &history));
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
