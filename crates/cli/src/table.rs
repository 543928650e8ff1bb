//! Tables for people.

use std::fmt::Write;

use crate::html;
use crate::svg::escape;

/// Rows of cells under a header; columns as wide as they need to be.
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    /// Columns from the left that are aligned to the left; numbers go to the right.
    words: usize,
}

impl Table {
    pub(crate) fn new<S: Into<String>>(words: usize, header: impl IntoIterator<Item = S>) -> Self {
        Self { rows: vec![header.into_iter().map(Into::into).collect()], words }
    }

    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The same with the unit of what the columns `named` hold, as `h [m]`.
    pub(crate) fn with_unit(mut self, named: &[&str], unit: &str) -> Self {
        for cell in self.rows.first_mut().into_iter().flatten() {
            if named.contains(&cell.as_str()) {
                *cell = format!("{cell} [{unit}]");
            }
        }
        self
    }

    /// The table as text, each line indented by two spaces.
    pub(crate) fn text(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column| {
            let cells = self.rows.iter().filter_map(|row: &Vec<String>| row.get(column));
            cells.map(|cell: &String| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let mut text = String::new();
        for row in &self.rows {
            let mut line = String::new();
            for (column, cell) in row.iter().enumerate() {
                let width = widths[column];
                // Writing to a string cannot fail.
                let _ = if column < self.words {
                    write!(line, "  {cell:<width$}")
                } else {
                    write!(line, "  {cell:>width$}")
                };
            }
            text.push_str(line.trim_end());
            text.push('\n');
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
                let cell = html::text(cell);
                match (index, column < self.words) {
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
        let text = table.html("a & b");
        assert!(text.contains("<td>&lt;b&gt;</td><td class=\"number\">1</td>"), "{text}");
        assert!(text.contains("<caption><span>a &amp; b</span></caption>"), "{text}");
    }
}
