//! Error against cost on both problems, with advice, as `mms tradeoff` measures them.

use std::path::Path;

use anyhow::{Result, bail};

use super::section::Section;
use super::{PROBLEMS, study_parameters};
use crate::arguments::TradeoffOptions;
use crate::commands::tradeoff::{Swept, sweep};
use crate::json::Output;
use crate::progress::Agenda;
use crate::report::{Files, Form};
use crate::terminal;

/// Measures both problems for `budget` seconds each and writes their data into the folders of `out`.
pub(super) fn section(out: &Path, budget: f64, agenda: &Agenda) -> Result<Section> {
    let said = format!(
        "All schemes that fit a problem, from cheap to dear, for {budget} s each, as mms tradeoff NAME --set rho0=1 --budget {budget}s \
         measures them. With more time the front goes further down, and more settings are confirmed on neighbouring cell \
         counts."
    );
    let mut section = Section::new("cost", "Speed against accuracy", &said);
    for problem in PROBLEMS {
        let folder = out.join(problem);
        let files = Files::of_stem(&folder, "tradeoff", &[Form::Json, Form::Csv, Form::Plot])?;
        let advice = Output::prepare(&folder.join("tradeoff.md"))?;
        let mut options = TradeoffOptions::usual(problem, budget);
        options.parameters.set = study_parameters(&[]);
        let Swept::All(found) = sweep(&options, &agenda.next(budget))? else {
            bail!("the report needs the whole sweep, not a shard's part of it");
        };
        let (report, front) = (found.report()?, found.front());
        let said = format!("\n{problem}: the front of error against cost\n{}", front.text());
        agenda.aside(|| terminal::say(&said))?;
        let svg = report.plot();
        report.write(files)?;
        advice.write_text(&found.advice())?;
        section.heading(problem);
        section.figures(&[(
            svg,
            format!("{problem}/tradeoff.svg"),
            format!(
                "{} settings of {problem}; red: the front, to which no other is both cheaper and more accurate. {}",
                found.runs(),
                found.definition()
            ),
        )]);
        section.table(&front, &format!("{problem}: the front, from cheap to dear"));
        section.table(
            &found.costs(),
            &format!("{problem}: seconds to each error, by the cheapest setting of each kind"),
        );
        section.list("Advice", &found.sentences());
        section.list("What each setting buys, the others being equal", &found.main_effects());
        section.files(problem, "tradeoff", &["json", "csv", "svg", "md"]);
    }
    Ok(section)
}
