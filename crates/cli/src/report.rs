//! Results of a command, once, and the forms in which a terminal or a file takes them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::{Map, Value};

use crate::json::Output;
use crate::table::{self, Table};
use crate::terminal;

/// Results of a command.
pub(crate) struct Report {
    /// The command, as the schema of its JSON names it.
    pub(crate) command: &'static str,
    /// Lines on choices that nobody has asked for, for the terminal alone.
    pub(crate) preface: String,
    /// The line that says what was simulated.
    pub(crate) caption: String,
    pub(crate) sections: Vec<Section>,
    /// Everything that the results depend on.
    pub(crate) settings: Value,
    /// The results for programs, by name.
    pub(crate) results: Map<String, Value>,
    /// Whether what was promised or asked for holds; none where nothing was judged.
    pub(crate) verdict: Option<bool>,
}

/// A section of a report.
pub(crate) enum Section {
    /// Lines for the terminal.
    Note(String),
    /// A table under its title.
    Table(String, Table),
    /// A line on the columns of the tables so far that the terminal had no room for, with the places that have them.
    LeftOut(&'static str),
    /// Numbers with all their digits.
    Sheet(Sheet),
    /// A picture as SVG.
    Plot(String),
}

/// A form in which a report is written to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Form {
    Json,
    Csv,
    Markdown,
    Latex,
    Plot,
}

impl Form {
    /// The option that asks for it.
    fn option(self) -> &'static str {
        match self {
            Self::Json => "--json",
            Self::Csv => "--csv",
            Self::Markdown => "--markdown",
            Self::Latex => "--latex",
            Self::Plot => "--plot",
        }
    }

    /// The end of names of such files.
    fn extension(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Markdown => "md",
            Self::Latex => "tex",
            Self::Plot => "svg",
        }
    }
}

/// Files that a report is asked for in.
pub(crate) struct Asked<'a>(pub(crate) Vec<(Form, &'a Option<PathBuf>)>);

impl Asked<'_> {
    /// Every option, and whether it is given.
    pub(crate) fn options(&self) -> Vec<(&'static str, bool)> {
        self.0.iter().map(|(form, path)| (form.option(), path.is_some())).collect()
    }

    /// Makes sure that all of them can be written.
    pub(crate) fn prepare(&self) -> Result<Files> {
        let mut files = Vec::new();
        for (form, path) in &self.0 {
            files.extend(Output::prepare_if(path.as_ref())?.map(|output| (*form, output)));
        }
        files.sort_by_key(|(form, _)| *form);
        Ok(Files(files))
    }
}

/// Files that can be written.
pub(crate) struct Files(Vec<(Form, Output)>);

impl Files {
    /// Files of a folder that are named by `stem` and their form.
    pub(crate) fn of_stem(folder: &Path, stem: &str, forms: &[Form]) -> Result<Self> {
        let prepare = |form: &Form| {
            let path = folder.join(format!("{stem}.{}", form.extension()));
            Ok((*form, Output::prepare(&path)?))
        };
        Ok(Self(forms.iter().map(prepare).collect::<Result<_>>()?))
    }
}

impl Report {
    /// An empty one of a command.
    pub(crate) fn new(command: &'static str) -> Self {
        Self {
            command,
            preface: String::new(),
            caption: String::new(),
            sections: Vec::new(),
            settings: Value::Null,
            results: Map::new(),
            verdict: None,
        }
    }

    /// With a result for programs, by its name.
    pub(crate) fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.results.insert(name.to_owned(), value.into());
        self
    }

    /// Says it, and writes it to the files; whether nothing that was promised is missed.
    pub(crate) fn publish(&self, files: Files) -> Result<bool> {
        terminal::say(&self.text())?;
        self.write(files)?;
        Ok(self.verdict != Some(false))
    }

    /// Writes it to the files.
    pub(crate) fn write(&self, files: Files) -> Result<()> {
        for (form, file) in files.0 {
            match form {
                Form::Json => file.write(&self.document())?,
                Form::Csv => file.write_text(&self.csv()?)?,
                Form::Markdown => file.write_text(&self.markdown())?,
                Form::Latex => file.write_text(&self.latex())?,
                Form::Plot => file.write_text(&self.plot())?,
            }
        }
        Ok(())
    }

    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let mut text = self.preface.clone() + &self.caption;
        for (place, section) in self.sections.iter().enumerate() {
            match section {
                Section::Note(lines) => text += lines,
                Section::Table(title, table) => text += &format!("\n{title}\n{}", table.text()),
                Section::LeftOut(has) => {
                    let tables = tables(&self.sections[..place]);
                    text += &table::on_left_out(tables.map(|(_, table)| table), has);
                }
                Section::Sheet(_) | Section::Plot(_) => {}
            }
        }
        text
    }

    /// The report for programs.
    pub(crate) fn document(&self) -> Value {
        let mut document = self.results.clone();
        document.insert("schema".into(), format!("mmsmith.{}/1", self.command).into());
        document.insert("settings".into(), self.settings.clone());
        document.into()
    }

    /// Its sheets, set apart by empty lines.
    pub(crate) fn csv(&self) -> Result<String> {
        let mut texts = Vec::new();
        for section in &self.sections {
            if let Section::Sheet(sheet) = section {
                texts.push(sheet.csv()?);
            }
        }
        Ok(texts.join("\n"))
    }

    /// Its tables in Markdown.
    fn markdown(&self) -> String {
        let tables = tables(&self.sections)
            .map(|(title, table)| format!("\n## {title}\n\n{}", table.markdown()));
        format!("# {}{}", self.caption, tables.collect::<String>())
    }

    /// Its tables in LaTeX.
    fn latex(&self) -> String {
        let tables =
            tables(&self.sections).map(|(title, table)| format!("\n% {title}\n{}", table.latex()));
        let head = "% Needs \\usepackage{booktabs}.\n";
        format!("% {}{head}{}", self.caption, tables.collect::<String>())
    }

    /// Its picture.
    pub(crate) fn plot(&self) -> String {
        let plots = self.sections.iter().filter_map(|section| match section {
            Section::Plot(svg) => Some(svg.as_str()),
            _ => None,
        });
        plots.collect()
    }
}

/// The tables among sections.
fn tables(sections: &[Section]) -> impl Iterator<Item = (&String, &Table)> {
    sections.iter().filter_map(|section| match section {
        Section::Table(title, table) => Some((title, table)),
        _ => None,
    })
}

/// Numbers in rows under a header, with all their digits.
pub(crate) struct Sheet {
    /// A line before the header, for people.
    pub(crate) remark: Option<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    pub(crate) fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Self { remark: None, rows: vec![header.into_iter().map(Into::into).collect()] }
    }

    pub(crate) fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The sheet as comma-separated values.
    pub(crate) fn csv(&self) -> Result<String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in &self.rows {
            writer.write_record(row).context("cannot form CSV")?;
        }
        let text = String::from_utf8(writer.into_inner().context("cannot form CSV")?)?;
        let remark = self.remark.as_ref().map(|remark| format!("# {remark}\n"));
        Ok(remark.unwrap_or_default() + &text)
    }
}

/// A number in shortest round-trip form, `nan` where there is none.
pub(crate) fn number(value: f64) -> String {
    if value.is_finite() { format!("{value:?}") } else { "nan".into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_with_commas_or_quotes_stay_one_cell() {
        let mut sheet = Sheet::new(["status", "error"]);
        sheet.row(["stopped, \"early\"".to_owned(), number(f64::NAN)]);
        sheet.row(["ok".to_owned(), number(0.1)]);
        let text = "status,error\n\"stopped, \"\"early\"\"\",nan\nok,0.1\n";
        assert_eq!(sheet.csv().unwrap(), text);
    }

    #[test]
    fn every_form_has_what_it_can_show() {
        let mut table = Table::new(1, ["field", "error"]);
        table.row(["u", "1.0"]);
        let mut sheet = Sheet::new(["u"]);
        sheet.row(["1.0"]);
        let report = Report {
            command: "run",
            preface: "chosen\n".into(),
            caption: "bar\n".into(),
            sections: vec![
                Section::Table("errors".into(), table),
                Section::Note("a note\n".into()),
                Section::Sheet(sheet),
                Section::Plot("<svg/>".into()),
            ],
            settings: Value::Null,
            results: Map::from_iter([("passed".to_owned(), Value::from(true))]),
            verdict: Some(true),
        };
        assert_eq!(
            report.text(),
            "chosen\nbar\n\nerrors\n  field  error\n  u        1.0\na note\n"
        );
        assert!(report.markdown().starts_with("# bar\n\n## errors\n\n| field | error |\n"));
        assert!(report.latex().starts_with("% bar\n% Needs \\usepackage{booktabs}.\n\n% errors\n"));
        assert_eq!(
            (report.csv().unwrap().as_str(), report.plot().as_str()),
            ("u\n1.0\n", "<svg/>")
        );
        assert_eq!(report.document()["schema"], "mmsmith.run/1");
    }
}
