//! The largest stable time step over amplitude and Poisson's ratio, as `mms stability` finds it.

use std::path::Path;

use anyhow::{Result, bail};
use mmsmith_verify::{Shape, StabilityRow};

use super::section::Section;
use super::{CD, PROBLEMS, Pace, study_parameters};
use crate::arguments::StabilityOptions;
use crate::commands::scheme::usual;
use crate::commands::stability::{Survey, survey};
use crate::commands::study::{Study, results};
use crate::keep::{Found, Keep};
use crate::progress::Bar;
use crate::report::{Files, Form};

/// A small grid: the limit depends little on it.
const CELLS: usize = 16;
const OVER: [&str; 2] = ["amplitude=1e-6,0.03,0.1,0.2", "nu=0,0.3,0.4,0.45"];

/// Time of the section: the runs of a search, of which those that are unstable end early.
pub(super) fn seconds(pace: &Pace) -> f64 {
    /// Points of the map, and the runs that find the limit of one.
    const POINTS: f64 = 16.0;
    const RUNS: f64 = 10.0;
    POINTS * RUNS * pace.seconds(&[usual(Shape::Gimp, CD, CELLS)])
}

/// Finds the limits of gimp+cd and writes them into the folder of the first problem.
pub(super) fn section(out: &Path, bar: &Bar) -> Result<Section> {
    let problem = PROBLEMS[0];
    let folder = out.join(problem);
    let files = Files::of_stem(&folder, "stability", &[Form::Json, Form::Csv, Form::Plot])?;
    let mut options = StabilityOptions::map(problem, CELLS, OVER);
    options.scheme.parameters.set = study_parameters(&[]);
    survey(&options, |found| {
        let Found::All(rows) = results(found, &Keep::nowhere(), None, bar)? else {
            bail!("the report needs the limits of all settings, not those of one shard");
        };
        let report = found.report(rows.clone())?;
        let svg = report.plot();
        report.write(files)?;
        Ok(told(found, &rows, svg))
    })
}

/// The section on a map of limits, which is drawn as `svg`.
fn told(found: &Survey<'_>, rows: &[StabilityRow], svg: String) -> Section {
    let problem = PROBLEMS[0];
    let said = format!(
        "The largest stable CFL number of gimp+cd on {problem} with {CELLS} cells, over the amplitude and Poisson's ratio. \
         Linear analysis allows the step in which P-waves cross one cell. As long as particles stay where they are, the limit \
         is about 0.8 of that; where they move through a share of a cell it is higher, and next to inversion stretched \
         cells lower it. Numbers are CFL numbers on bar waves."
    );
    let mut section = Section::new("stability", "Stability", &said);
    section.figures(&[(
        svg,
        format!("{problem}/stability.svg"),
        format!("Each limit and its share of the CFL number of P-waves. {}", found.definition()),
    )]);
    section.table(&found.table(rows), &format!("{problem}: largest stable CFL numbers"));
    section.lines(&found.notes(rows));
    section.files(problem, "stability", &["json", "csv", "svg"]);
    section
}
