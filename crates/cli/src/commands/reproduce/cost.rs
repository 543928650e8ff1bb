//! Error against cost on both problems, with advice, as `mms tradeoff` measures them.

use std::path::Path;

use anyhow::{Result, bail};

use super::section::Section;
use super::{PROBLEMS, study_parameters};
use crate::arguments::TradeoffOptions;
use crate::commands::tradeoff::{Swept, sweep};
use crate::json::Output;
use crate::progress::Agenda;
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
        let file = |name: &str| Output::prepare(&folder.join(name));
        let [json, csv, plot, advice] =
            ["tradeoff.json", "tradeoff.csv", "tradeoff.svg", "tradeoff.md"].map(file);
        let (json, csv, plot, advice) = (json?, csv?, plot?, advice?);
        let mut options = TradeoffOptions::usual(problem, budget);
        options.parameters.set = study_parameters(&[]);
        let Swept::All(report) = sweep(&options, &agenda.next(budget))? else {
            bail!("the report needs the whole sweep, not a shard's part of it");
        };
        let (svg, front) = (report.picture(), report.front());
        let said = format!("\n{problem}: the front of error against cost\n{}", front.text());
        agenda.aside(|| terminal::say(&said))?;
        json.write(&report.document()?)?;
        csv.write_text(&report.sheet().csv()?)?;
        plot.write_text(&svg)?;
        advice.write_text(&report.advice())?;
        section.heading(problem);
        section.figures(&[(
            svg,
            format!("{problem}/tradeoff.svg"),
            format!(
                "{} settings of {problem}; red: the front, to which no other is both cheaper and more accurate. {}",
                report.settings(),
                report.definition()
            ),
        )]);
        section.table(&front, &format!("{problem}: the front, from cheap to dear"));
        section.table(
            &report.costs(),
            &format!("{problem}: seconds to each error, by the cheapest setting of each kind"),
        );
        section.list("Advice", &report.sentences());
        section.list("What each setting buys, the others being equal", &report.main_effects());
        section.files(problem, "tradeoff", &["json", "csv", "svg", "md"]);
    }
    Ok(section)
}
