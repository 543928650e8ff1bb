//! A part of the report that is made once, as HTML and as Markdown.

use std::fmt::Write;

use crate::html;
use crate::svg::escape;
use crate::table::Table;

/// Lists of more sentences are closed at first.
const LONG: usize = 30;

/// A part of the report.
pub(super) struct Section {
    /// Its place in the page.
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    html: String,
    markdown: String,
    /// Files told later.
    files: Vec<(&'static str, String)>,
}

impl Section {
    pub(super) fn new(id: &'static str, title: &'static str, said: &str) -> Self {
        let section =
            format!("<section id=\"{id}\">\n<h2>{title}</h2>\n<p>{}</p>\n", html::text(said));
        let markdown = format!("\n## {title}\n\n{said}\n");
        Self { id, title, html: section, markdown, files: Vec::new() }
    }

    pub(super) fn html(&self) -> String {
        self.html.clone() + "</section>\n"
    }

    pub(super) fn markdown(&self) -> &str {
        &self.markdown
    }

    pub(super) fn heading(&mut self, title: &str) {
        let _ = writeln!(self.html, "<h3>{}</h3>", escape(title));
        let _ = write!(self.markdown, "\n### {title}\n");
    }

    /// Pictures side by side, each with its file, relative to the page, and its caption.
    pub(super) fn figures(&mut self, figures: &[(String, String, String)]) {
        self.html += "<div class=\"figures\">\n";
        for (svg, path, caption) in figures {
            self.html += &captioned(svg, caption);
            let _ = write!(self.markdown, "\n![{caption}]({path})\n");
        }
        self.html += "</div>\n";
    }

    pub(super) fn table(&mut self, table: &Table, caption: &str) {
        self.html += &table.html(caption);
        let _ = write!(self.markdown, "\n{caption}:\n\n{}", table.markdown());
    }

    /// Sentences, in which what stands between backquotes is code.
    pub(super) fn list(&mut self, title: &str, sentences: &[String]) {
        if sentences.is_empty() {
            return;
        }
        // A long list is opened by whoever wants it.
        let _ = write!(
            self.html,
            "<details{}>\n<summary>{}</summary>\n<ul>\n",
            if sentences.len() > LONG { "" } else { " open" },
            escape(title)
        );
        let _ = write!(self.markdown, "\n{title}:\n\n");
        for sentence in sentences {
            let _ = writeln!(self.html, "<li>{}</li>", code(sentence));
            let _ = writeln!(self.markdown, "- {sentence}");
        }
        self.html += "</ul>\n</details>\n";
    }

    /// Lines as they are.
    pub(super) fn lines(&mut self, lines: &str) {
        if lines.is_empty() {
            return;
        }
        let _ = writeln!(self.html, "<pre tabindex=\"0\">{}</pre>", escape(lines));
        let _ = write!(self.markdown, "\n```text\n{lines}```\n");
    }

    /// Links to a problem's files of a stem.
    pub(super) fn files(&mut self, problem: &'static str, stem: &str, kinds: &[&str]) {
        self.remember(problem, stem, kinds);
        self.remembered();
    }

    /// Files to link to once there are more.
    pub(super) fn remember(&mut self, problem: &'static str, stem: &str, kinds: &[&str]) {
        let names = kinds.iter().map(|kind| (problem, format!("{stem}.{kind}")));
        self.files.extend(names);
    }

    /// Links to what was remembered.
    pub(super) fn remembered(&mut self) {
        let links: Vec<_> = self
            .files
            .drain(..)
            .map(|(problem, file)| format!("<a href=\"{problem}/{file}\">{problem}/{file}</a>"))
            .collect();
        let _ = writeln!(self.html, "<p>Files: {}</p>", links.join(", "));
    }
}

/// A picture with its caption.
pub(super) fn captioned(svg: &str, caption: &str) -> String {
    format!("<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>\n", html::text(caption))
}

/// Sentence as HTML, with the parts between backquotes as code.
fn code(sentence: &str) -> String {
    let mut text = String::new();
    for (index, part) in sentence.split('`').enumerate() {
        match index % 2 {
            0 => text += &html::text(part),
            _ => text += &format!("<code>{}</code>", escape(part)),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_says_the_same_in_both_forms_and_text_cannot_leave_its_place() {
        let mut section = Section::new("id", "Title", "a < b");
        section.list("Advice", &["take `mms run <x>`, not y".into()]);
        section.lines("1 < 2\n");
        section.files("ring", "stem", &["json", "csv"]);
        let html = section.html();
        assert!(html.contains("<p>a &lt; b</p>") && html.ends_with("</section>\n"), "{html}");
        assert!(html.contains("<li>take <code>mms run &lt;x&gt;</code>, not y</li>"), "{html}");
        assert!(
            html.contains("href=\"ring/stem.json\"") && html.contains("href=\"ring/stem.csv\"")
        );
        let markdown = section.markdown();
        assert!(markdown.contains("- take `mms run <x>`, not y\n"), "{markdown}");
        assert!(markdown.contains("```text\n1 < 2\n```"), "{markdown}");
    }
}
