//! Tables for people.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::ops::Range;

use crate::svg::escape;
use crate::{html, terminal};

/// Rows of cells under a header; columns as wide as they need to be.
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    /// Columns from the left that are aligned to the left; numbers go to the right.
    words: usize,
    /// Columns that text leaves out where they do not fit, in this order.
    spare: Vec<Range<usize>>,
    /// As many of these are left out in any case, since a table beside this one has no room for them.
    unwanted: usize,
    /// The least width of a last column of words, which go on in the next line where they do not fit.
    flow: Option<usize>,
}

/// The characters of a number with a remark, as a slope with the runs that stopped, at most.
const LONGEST_NUMBER: usize = 24;
/// Columns of blanks between two columns of a table.
const GAP: usize = 2;

impl Table {
    pub(crate) fn new<S: Into<String>>(words: usize, header: impl IntoIterator<Item = S>) -> Self {
        let rows = vec![header.into_iter().map(Into::into).collect()];
        Self { rows, words, spare: Vec::new(), unwanted: 0, flow: None }
    }

    /// The table with columns that text leaves out where the line is too short for all of them; those of the first call first.
    pub(crate) fn sparing(mut self, columns: Range<usize>) -> Self {
        self.spare.push(columns);
        self
    }

    /// The table with a last column of words, which go on in the next line where the line is too short, and which keeps `least`
    /// characters.
    pub(crate) fn flowing(mut self, least: usize) -> Self {
        self.flow = Some(least);
        self
    }

    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// This table with the unit of the columns `named`, as `h [m]`, where it is known.
    pub(crate) fn with_unit<'a>(
        mut self,
        named: &[&str],
        unit: impl Into<Option<&'a str>>,
    ) -> Self {
        let Some(unit) = unit.into() else { return self };
        for cell in self.rows.first_mut().into_iter().flatten() {
            if named.contains(&cell.as_str()) {
                *cell = format!("{cell} [{unit}]");
            }
        }
        self
    }

    /// The table as text for the terminal, each line indented by two spaces; the usual width where there is no terminal.
    pub(crate) fn text(&self) -> String {
        self.text_within(terminal::columns())
    }

    /// The headers of the columns that [`text`](Self::text) leaves out.
    fn left_out(&self) -> Vec<&str> {
        let kept = self.kept(&self.widths(), terminal::columns());
        let header = self.rows.first().into_iter().flatten().map(String::as_str).enumerate();
        let (shown, others): (Vec<_>, Vec<_>) =
            header.partition(|(column, _)| kept.contains(column));
        let is_shown = |name: &str| shown.iter().any(|(_, other)| *other == name);
        others.into_iter().map(|(_, name)| name).filter(|name| !is_shown(name)).collect()
    }

    /// The table in lines of at most `most` characters: without the columns that can be spared, then in parts below each other that
    /// repeat the first columns.
    fn text_within(&self, most: usize) -> String {
        let mut widths = self.widths();
        let kept = self.kept(&widths, most);
        if let (Some(least), Some((&last, others))) = (self.flow, kept.split_last()) {
            let room = most.saturating_sub(line_length(&widths, others) + GAP);
            widths[last] = widths[last].min(room.max(least));
        }
        let parts = parts(&widths, &kept, self.words.max(1), most);
        let text = |part: &Vec<usize>| -> String {
            self.rows.iter().map(|row| self.line(row, part, &widths)).collect()
        };
        parts.iter().map(text).collect::<Vec<_>>().join("\n")
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column| {
            let cells = self.rows.iter().filter_map(|row: &Vec<String>| row.get(column));
            cells.map(|cell: &String| cell.chars().count()).max().unwrap_or(0)
        };
        (0..columns).map(width).collect()
    }

    /// The columns that remain where the line is too short.
    fn kept(&self, widths: &[usize], most: usize) -> Vec<usize> {
        let mut narrowest = widths.to_vec();
        if let (Some(least), Some(last)) = (self.flow, narrowest.last_mut()) {
            *last = (*last).min(least);
        }
        let mut kept: Vec<usize> = (0..widths.len()).collect();
        for (index, columns) in self.spare.iter().enumerate() {
            if index >= self.unwanted && line_length(&narrowest, &kept) <= most {
                break;
            }
            kept.retain(|column| !columns.contains(column));
        }
        kept
    }

    /// How many groups of spare columns have no room.
    fn without_room(&self, most: usize) -> usize {
        let kept = self.kept(&self.widths(), most);
        self.spare.iter().filter(|columns| !kept.iter().any(|kept| columns.contains(kept))).count()
    }

    /// A row as text: one line, or several where its last cell flows.
    fn line(&self, row: &[String], columns: &[usize], widths: &[usize]) -> String {
        let mut line = String::new();
        let mut more = Vec::new();
        for &column in columns {
            let Some(cell) = row.get(column) else { break };
            let width = widths[column];
            let is_flowing = self.flow.is_some() && column + 1 == widths.len();
            // Writing to a string cannot fail.
            let _ = if is_flowing {
                let mut pieces = terminal::wrapped(cell, width).into_iter();
                let first = pieces.next().unwrap_or_default();
                more = pieces.map(|piece| (line.chars().count() + GAP, piece)).collect();
                write!(line, "  {first}")
            } else if column < self.words {
                write!(line, "  {cell:<width$}")
            } else {
                write!(line, "  {cell:>width$}")
            };
        }
        let mut text = format!("{}\n", line.trim_end());
        for (indent, piece) in more {
            let _ = writeln!(text, "{:indent$}{piece}", "");
        }
        text
    }

    /// The table in Markdown.
    pub(crate) fn markdown(&self) -> String {
        let mut text = String::new();
        for (index, row) in self.rows.iter().enumerate() {
            let cells: Vec<_> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            let _ = writeln!(text, "| {} |", cells.join(" | "));
            if index == 0 {
                let rule = |column| if column < self.words { " --- |" } else { " ---: |" };
                let _ = writeln!(text, "|{}", (0..row.len()).map(rule).collect::<String>());
            }
        }
        text
    }

    /// The table in LaTeX, with the rules of the package booktabs.
    pub(crate) fn latex(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let place = |column| if column < self.words { 'l' } else { 'r' };
        let places: String = (0..columns).map(place).collect();
        let mut text = format!("\\begin{{tabular}}{{{places}}}\n\\toprule\n");
        for (index, row) in self.rows.iter().enumerate() {
            let cells: Vec<_> = row.iter().map(|cell| latex(cell)).collect();
            let _ = writeln!(text, "{} \\\\", cells.join(" & "));
            if index == 0 {
                text.push_str("\\midrule\n");
            }
        }
        text.push_str("\\bottomrule\n\\end{tabular}\n");
        text
    }

    /// The table in HTML, told by `caption`, in a box of its own that scrolls where the page is narrow.
    pub(crate) fn html(&self, caption: &str) -> String {
        let caption = escape(caption);
        let mut text = format!(
            "<div class=\"scroll\" role=\"region\" aria-label=\"{caption}\" tabindex=\"0\">\n<table>\n\
             <caption><span>{caption}</span></caption>\n"
        );
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        for (index, row) in self.rows.iter().enumerate() {
            // Short rows are filled up, so that their lines reach to the end.
            let missing = columns - row.len();
            let row = row.iter().map(String::as_str).chain(std::iter::repeat_n("", missing));
            let cells = row.enumerate().map(|(column, cell)| {
                // The reason in the place of a number takes lines, so that the table fits on paper.
                let is_sentence = index > 0 && cell.chars().count() > LONGEST_NUMBER;
                let cell = html::text(cell);
                match (index, column < self.words || is_sentence) {
                    (0, true) => format!("<th scope=\"col\">{cell}</th>"),
                    (0, false) => format!("<th scope=\"col\" class=\"number\">{cell}</th>"),
                    (_, true) => format!("<td>{cell}</td>"),
                    (_, false) => format!("<td class=\"number\">{cell}</td>"),
                }
            });
            let _ = writeln!(text, "<tr>{}</tr>", cells.collect::<String>());
        }
        text.push_str("</table>\n</div>\n");
        text
    }
}

/// The length of a line of these columns.
fn line_length(widths: &[usize], columns: &[usize]) -> usize {
    columns.iter().map(|&column| GAP + widths[column]).sum()
}

/// Columns in parts that fit a line each; every part begins with the first `heads` columns.
fn parts(widths: &[usize], kept: &[usize], heads: usize, most: usize) -> Vec<Vec<usize>> {
    let (heads, others) = kept.split_at(heads.min(kept.len()));
    let mut parts = vec![heads.to_vec()];
    for &column in others {
        let is_full = |part: &Vec<usize>| {
            part.len() > heads.len() && line_length(widths, part) + GAP + widths[column] > most
        };
        match parts.last_mut() {
            Some(part) if !is_full(part) => part.push(column),
            _ => parts.push([heads, &[column]].concat()),
        }
    }
    parts
}

/// Leaves out of each table what one of them has no room for, so that tables of one study have the same columns.
pub(crate) fn align<K>(tables: &mut [(K, Table)]) {
    let most = terminal::columns();
    let unwanted = tables.iter().map(|(_, table)| table.without_room(most)).max().unwrap_or(0);
    for (_, table) in tables {
        table.unwanted = unwanted;
    }
}

/// A line on the columns that the text of some tables leaves out, and what has them; nothing where there are none.
pub(crate) fn on_left_out<'a>(tables: impl IntoIterator<Item = &'a Table>, has: &str) -> String {
    let mut names: Vec<&str> = tables.into_iter().flat_map(Table::left_out).collect();
    let mut known = BTreeSet::new();
    names.retain(|name| known.insert(*name));
    match names.is_empty() {
        true => String::new(),
        false => format!("Left out for lack of room: {}. {has}\n", names.join(", ")),
    }
}

/// A cell in LaTeX: numbers with an exponent in mathematics, all else as it reads.
fn latex(cell: &str) -> String {
    let bare = cell.trim_start_matches('(').trim_end_matches(')');
    if let Some((mantissa, exponent)) = bare.split_once('e')
        && mantissa.parse::<f64>().is_ok()
        && exponent.parse::<i32>().is_ok()
    {
        let number = format!("${mantissa}\\cdot 10^{{{exponent}}}$");
        return if bare.len() == cell.len() { number } else { format!("({number})") };
    }
    if cell.parse::<f64>().is_ok_and(|number| number < 0.0) {
        return format!("${cell}$");
    }
    cell.chars()
        .map(|character| match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{character}"),
            '~' => "\\textasciitilde{}".into(),
            '^' => "\\textasciicircum{}".into(),
            '\\' => "\\textbackslash{}".into(),
            '<' | '>' => format!("${character}$"),
            other => other.to_string(),
        })
        .collect()
}

/// An error: four digits, and an exponent.
pub(crate) fn error(value: f64) -> String {
    if value.is_finite() { format!("{value:.3e}") } else { "-".into() }
}

/// An order of accuracy: two decimals, or a dash where there is none.
pub(crate) fn rate(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.2}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_line_up_to_the_right_and_words_to_the_left() {
        let mut table = Table::new(1, ["field", "linf", "rate"]);
        table.row(["u", "4.081e-3", "-"]);
        table.row(["velocity", "1.0e-12", "2.00"]);
        let expected =
            "  field         linf  rate\n  u         4.081e-3     -\n  velocity   1.0e-12  2.00\n";
        assert_eq!(table.text(), expected);
        let markdown = table.markdown();
        assert!(markdown.starts_with("| field | linf | rate |\n| --- | ---: | ---: |\n| u |"));
    }

    #[test]
    fn a_line_that_is_too_short_takes_no_spare_columns_then_parts() {
        let mut table = Table::new(0, ["cells", "h", "linf", "rate"]).sparing(1..2);
        table.row(["16", "6.25e-2", "4.077e-3", "-"]);
        assert_eq!(table.text_within(80).lines().count(), 2);
        assert_eq!(table.text_within(23), "  cells      linf  rate\n     16  4.077e-3     -\n");
        let parts = "  cells      linf\n     16  4.077e-3\n\n  cells  rate\n     16     -\n";
        assert_eq!(table.text_within(20), parts);
    }

    #[test]
    fn tables_of_one_study_have_the_same_columns() {
        let table = |error: &str| {
            let header = ["cells", "particles", "h [m]", "linf [m]", "l1"];
            let mut table = Table::new(0, header).sparing(4..5);
            table.row(["16", "256", "6.25e-2", error, "1"]);
            table
        };
        let wide = "1".repeat(60);
        let mut tables = [("a", table("1")), ("b", table(&wide))];
        align(&mut tables);
        assert!(tables.iter().all(|(_, table)| !table.text_within(80).contains("l1")));
        assert!(table("1").text_within(80).contains("l1"));
    }

    #[test]
    fn words_of_the_last_column_go_on_in_the_next_line() {
        let mut table = Table::new(1, ["field", "verdict"]).flowing(10);
        table.row(["u", "the finest run's errors say nothing"]);
        let lines = "  field  verdict\n  u      the finest run's\n         errors say nothing\n";
        assert_eq!(table.text_within(29), lines);
        assert!(table.text_within(80).contains("  u      the finest run's errors say nothing\n"));
    }

    #[test]
    fn units_stand_in_the_header_and_short_rows_are_filled_up() {
        let mut table = Table::new(1, ["field", "h", "rate", "h"]).with_unit(&["h"], "m");
        table.row(["h", "1"]);
        assert!(table.text().starts_with("  field  h [m]  rate  h [m]\n  h          1\n"));
        assert_eq!(table.html("t").matches("<td").count(), 4);
    }

    #[test]
    fn numbers_that_are_none_become_dashes() {
        assert_eq!((error(4.0812e-3), error(f64::NAN)), ("4.081e-3".into(), "-".into()));
        assert_eq!((rate(Some(1.996)), rate(None)), ("2.00".into(), "-".into()));
    }

    #[test]
    fn latex_text_is_escaped_and_numbers_are_set_as_such() {
        let mut table = Table::new(1, ["a_b", "50 %"]);
        table.row(["x & y", "(4.077e-3)"]);
        table.row(["~^\\", "-0.25"]);
        let expected = "\\begin{tabular}{lr}\n\\toprule\na\\_b & 50 \\% \\\\\n\\midrule\n\
                        x \\& y & ($4.077\\cdot 10^{-3}$) \\\\\n\
                        \\textasciitilde{}\\textasciicircum{}\\textbackslash{} & $-0.25$ \\\\\n\
                        \\bottomrule\n\\end{tabular}\n";
        assert_eq!(table.latex(), expected);
    }

    #[test]
    fn html_text_cannot_leave_its_cell() {
        let mut table = Table::new(1, ["what", "n"]);
        table.row(["<b>", "1"]);
        table.row(["c", "stopped: a particle left the grid"]);
        let text = table.html("a & b");
        assert!(text.contains("<td>&lt;b&gt;</td><td class=\"number\">1</td>"), "{text}");
        assert!(text.contains("<td>stopped: a particle left the grid</td>"), "{text}");
        assert!(text.contains("<caption><span>a &amp; b</span></caption>"), "{text}");
    }
}
