//! A page of advice, each sentence with the figure behind it.

use mmsmith_verify::{Entry, TOLERANCES};
use std::collections::BTreeSet;

use super::measured::Measured;
use super::words;
use crate::table::Table;
use crate::{machine, number};

impl Measured<'_> {
    /// The page, in Markdown.
    pub(in crate::commands) fn advice(&self) -> String {
        let mut text = format!(
            "# {}: which scheme for which need\n\nMade by `mms tradeoff {} --budget {}s --advice FILE.md` on {} ({} core(s)). \
             {}.\n\n## What accuracy costs\n\nSeconds of stepping on {} to each error, by the cheapest setting of \
             each kind; `-` where none within the budget gets there.\n\n{}\n",
            self.selection.name(),
            self.options.name,
            self.options.budget,
            machine::processor(),
            machine::cores(),
            self.definition(),
            number::counted(self.threads, "thread"),
            self.costs().markdown()
        );
        text += "## Advice\n\n";
        for line in self.sentences() {
            text += &format!("- {line}\n");
        }
        text += "\n## What each setting buys\n\n";
        for line in self.main_effects() {
            text += &format!("- {line}\n");
        }
        text
    }

    /// The time to each tolerance for each kind of scheme.
    pub(in crate::commands) fn costs(&self) -> Table {
        let header = TOLERANCES.iter().map(|tolerance| format!("{tolerance:e}"));
        let mut table = Table::new(1, std::iter::once("scheme".to_owned()).chain(header));
        for kind in self.kinds() {
            let least = |tolerance: f64| {
                let meets = |entry: &&Entry| {
                    words::kind(&entry.setting) == kind
                        && self.error(entry) <= tolerance
                        && self.is_of_usual_threads(entry)
                };
                let costs = self.found.entries.iter().filter(meets).map(|entry| entry.row.wall_s);
                let least = costs.fold(f64::INFINITY, f64::min);
                if least.is_finite() { format!("{least:.1e}") } else { "-".into() }
            };
            let costs: Vec<String> = TOLERANCES.into_iter().map(least).collect();
            if costs.iter().any(|cost| cost != "-") {
                table.row(std::iter::once(kind.clone()).chain(costs));
            }
        }
        table
    }

    fn kinds(&self) -> Vec<String> {
        let mut kinds: Vec<String> = Vec::new();
        for entry in &self.found.entries {
            let kind = words::kind(&entry.setting);
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        kinds.sort_unstable();
        kinds
    }

    /// The advice, a sentence each; commands stand between backquotes.
    pub(in crate::commands) fn sentences(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let entries = &self.found.entries;
        for (whose, cheapest) in self.groups() {
            for named in cheapest {
                let Some(index) = named.entry else { continue };
                let entry = &entries[index];
                let proof = match named.neighbours_hold {
                    true => "its neighbouring cell counts meet it too",
                    false if self.options.cells.is_empty() => {
                        "there was no time to try its neighbours"
                    }
                    false => "it is not between two of the cell counts",
                };
                lines.push(format!(
                    "For an error of {:e}, the cheapest setting{whose} is {}: {:.2e} in {:.1e} s, and {proof}. `{}`",
                    named.tolerance,
                    words::line(&entry.setting),
                    self.error(entry),
                    entry.row.wall_s,
                    self.command(&entry.setting)
                ));
            }
        }
        // How far each kind gets, and what of its formulation gets as far for less.
        for kind in self.kinds() {
            let own = entries.iter().filter(|entry| {
                words::kind(&entry.setting) == kind
                    && self.error(entry).is_finite()
                    && self.is_of_usual_threads(entry)
            });
            let best = own.min_by(|a, b| self.error(a).total_cmp(&self.error(b)));
            let Some(best) = best else {
                let own = entries.iter().filter(|entry| words::kind(&entry.setting) == kind);
                let cells: BTreeSet<usize> = own.map(|entry| entry.setting.case.cells).collect();
                let cells: Vec<String> = cells.iter().map(usize::to_string).collect();
                lines.push(format!(
                    "{kind} has no error to compare: every run of it stopped, or had an error above the motion itself, on {} cells, and finer grids were \
                     not tried.",
                    cells.join(", ")
                ));
                continue;
            };
            let cheaper = entries
                .iter()
                .filter(|entry| {
                    self.error(entry) <= self.error(best)
                        && self.is_of_usual_threads(entry)
                        && entry.setting.case.scheme.formulation()
                            == best.setting.case.scheme.formulation()
                })
                .min_by(|a, b| a.row.wall_s.total_cmp(&b.row.wall_s));
            let Some(cheaper) = cheaper.filter(|cheaper| words::kind(&cheaper.setting) != kind)
            else {
                continue;
            };
            lines.push(format!(
                "{kind} is slow for small errors: its smallest error within the budget is {:.2e}, in {:.1e} s ({}). {} has {:.2e} in {:.1e} s, \
                 {:.0} times faster.",
                self.error(best),
                best.row.wall_s,
                words::line(&best.setting),
                words::line(&cheaper.setting),
                self.error(cheaper),
                cheaper.row.wall_s,
                best.row.wall_s / cheaper.row.wall_s
            ));
        }
        lines
    }
}
