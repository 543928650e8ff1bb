//! The parts of a Markdown page that can go wrong: code blocks, links, headings and generated sections.

use crate::formulas::{self, Piece};
use std::ops::Range;

/// A page, cut into the parts that are checked. Line numbers count from one.
#[derive(Debug, Default)]
pub(crate) struct Page {
    /// Code blocks, in order.
    pub(crate) blocks: Vec<Block>,
    /// Sections that a command writes, in order.
    pub(crate) sections: Vec<Section>,
    /// Destinations of links and pictures.
    pub(crate) links: Vec<Link>,
    /// Names of the places that a link can go to.
    pub(crate) anchors: Vec<String>,
    /// Lines of prose and tables, without code spans and comments, outside of generated sections.
    pub(crate) prose: Vec<(usize, String)>,
    /// Code spans outside of generated sections.
    pub(crate) spans: Vec<(usize, String)>,
    /// Formulas in LaTeX on lines of text.
    pub(crate) formulas: Vec<(usize, String)>,
    /// Faults of the page's own structure.
    pub(crate) faults: Vec<(usize, String)>,
}

/// A code block.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// The line of its fence, or its first line where it is indented.
    pub(crate) line: usize,
    /// The language after the fence; empty where there is none.
    pub(crate) language: String,
    /// The code itself.
    pub(crate) text: String,
    /// The comments right before it.
    pub(crate) marks: Vec<String>,
    /// Whether it lies in a generated section.
    pub(crate) generated: bool,
}

/// A section between `<!-- begin: ... -->` and `<!-- end -->`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Section {
    /// The line of its first comment.
    pub(crate) line: usize,
    /// How the output of its commands is shown; empty where the comment names no form.
    pub(crate) form: String,
    /// The commands that write it.
    pub(crate) commands: Vec<String>,
    /// Indices of the lines between its two comments.
    pub(crate) body: Range<usize>,
}

/// A link or a picture.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Link {
    /// The line that it stands on.
    pub(crate) line: usize,
    /// Where it goes.
    pub(crate) target: String,
}

impl Page {
    /// Cuts a page into its parts.
    pub(crate) fn parse(text: &str) -> Self {
        let mut page = Self::default();
        let lines: Vec<&str> = text.lines().collect();
        let mut marks = Vec::new();
        let mut open: Option<Section> = None;
        let mut in_list = false;
        let mut after_blank = true;
        let mut at = 0;
        while at < lines.len() {
            let line = lines[at];
            let number = at + 1;
            if let Some(fence) = Fence::of(line) {
                let end = (number..lines.len()).find(|&i| fence.closes(lines[i]));
                if end.is_none() {
                    page.faults.push((number, "the code block has no end".to_owned()));
                }
                let end = end.unwrap_or(lines.len());
                let text = lines[number.min(end)..end].iter().map(|line| fence.inside(line));
                page.blocks.push(Block {
                    line: number,
                    language: fence.language.clone(),
                    text: text.collect::<Vec<_>>().join("\n") + "\n",
                    marks: std::mem::take(&mut marks),
                    generated: open.is_some(),
                });
                at = end + 1;
                after_blank = false;
                continue;
            }
            if line.trim_start().starts_with("<!--") {
                let end = (at..lines.len()).find(|&i| lines[i].contains("-->"));
                let Some(end) = end else {
                    page.faults.push((number, "the comment has no end".to_owned()));
                    break;
                };
                page.comment(&lines, at..end + 1, &mut open, &mut marks);
                at = end + 1;
                after_blank = true;
                continue;
            }
            if line.trim().is_empty() {
                after_blank = true;
                at += 1;
                continue;
            }
            let indented = line.starts_with("    ");
            if indented && after_blank && !in_list {
                let is_code = |line: &&str| line.starts_with("    ") || line.trim().is_empty();
                let mut block: Vec<&str> =
                    lines[at..].iter().copied().take_while(|line| is_code(line)).collect();
                at += block.len();
                while block.last().is_some_and(|line| line.trim().is_empty()) {
                    block.pop();
                }
                let text = block.iter().map(|line| line.get(4..).unwrap_or(""));
                page.blocks.push(Block {
                    line: number,
                    language: String::new(),
                    text: text.collect::<Vec<_>>().join("\n") + "\n",
                    marks: std::mem::take(&mut marks),
                    generated: open.is_some(),
                });
                continue;
            }
            in_list = is_item(line) || (in_list && line.starts_with(' '));
            if !std::mem::take(&mut marks).is_empty() {
                page.faults
                    .push((number, "the mark before this line has no code block".to_owned()));
            }
            page.text(number, line, open.is_some());
            after_blank = false;
            at += 1;
        }
        if let Some(section) = open {
            page.faults.push((section.line, "the section has no <!-- end -->".to_owned()));
        }
        page
    }

    fn comment(
        &mut self,
        lines: &[&str],
        range: Range<usize>,
        open: &mut Option<Section>,
        marks: &mut Vec<String>,
    ) {
        let number = range.start + 1;
        let text = lines[range.clone()].join("\n");
        let text = text.trim().trim_start_matches("<!--");
        let Some((text, rest)) = text.split_once("-->") else { return };
        if !rest.trim().is_empty() {
            self.text(number, rest, open.is_some());
        }
        let text = text.trim();
        if let Some(begin) = text.strip_prefix("begin:") {
            if open.is_some() {
                self.faults.push((number, "a section within a section".to_owned()));
            }
            let mut parts: Vec<String> = begin
                .lines()
                .map(|line| line.trim().to_owned())
                .filter(|line| !line.is_empty())
                .collect();
            let is_command = |line: &String| line.split_whitespace().count() > 1;
            let form = match parts.first() {
                Some(first) if !is_command(first) => parts.remove(0),
                _ => String::new(),
            };
            *open =
                Some(Section { line: number, form, commands: parts, body: range.end..range.end });
        } else if text == "end" {
            match open.take() {
                Some(mut section) => {
                    section.body.end = range.start;
                    self.sections.push(section);
                }
                None => self.faults.push((number, "<!-- end --> without a begin".to_owned())),
            }
        } else {
            marks.push(text.to_owned());
        }
    }

    fn text(&mut self, number: usize, line: &str, generated: bool) {
        let mut own = String::new();
        for piece in formulas::pieces(line) {
            match piece {
                Piece::Text(text) => own.push_str(text),
                Piece::Formula(latex) => {
                    self.formulas.push((number, latex.to_owned()));
                    // Something must be left, as for code.
                    own.push('$');
                }
                Piece::Open => self.faults.push((
                    number,
                    "the formula has no end on its line; write \\$ for a dollar sign".to_owned(),
                )),
            }
        }
        let (prose, spans) = without_code(&own);
        if let Some(heading) = heading(line) {
            let slug = slug(&heading.replace('`', ""));
            let same = |known: &&String| {
                **known == slug
                    || known
                        .rsplit_once('-')
                        .is_some_and(|(stem, end)| stem == slug && end.parse::<u32>().is_ok())
            };
            let earlier = self.anchors.iter().filter(same).count();
            self.anchors.push(if earlier == 0 { slug } else { format!("{slug}-{earlier}") });
        }
        self.links.extend(targets(&prose).map(|target| Link { line: number, target }));
        for name in ["id=\"", "name=\""] {
            self.anchors.extend(attribute(&prose, name));
        }
        if !generated {
            self.spans.extend(spans.into_iter().map(|span| (number, span)));
            self.prose.push((number, prose));
        }
    }
}

struct Fence {
    mark: char,
    length: usize,
    indent: usize,
    language: String,
}

impl Fence {
    fn of(line: &str) -> Option<Self> {
        let inner = line.trim_start();
        let mark = inner.chars().next().filter(|c| matches!(c, '`' | '~'))?;
        let length = inner.chars().take_while(|c| *c == mark).count();
        let info = &inner[length..];
        if length < 3 || (mark == '`' && info.contains('`')) {
            return None;
        }
        let language = info.split([',', ' ', '{']).find(|word| !word.is_empty()).unwrap_or("");
        Some(Self {
            mark,
            length,
            indent: line.len() - inner.len(),
            language: language.trim().to_owned(),
        })
    }

    fn closes(&self, line: &str) -> bool {
        let line = line.trim();
        line.len() >= self.length && line.chars().all(|c| c == self.mark)
    }

    fn inside<'a>(&self, line: &'a str) -> &'a str {
        let blanks = line.len() - line.trim_start().len();
        &line[blanks.min(self.indent)..]
    }
}

fn is_item(line: &str) -> bool {
    let inner = line.trim_start();
    let digits = inner.chars().take_while(char::is_ascii_digit).count();
    let rest = if digits > 0 {
        inner[digits..].strip_prefix(['.', ')'])
    } else {
        inner.strip_prefix(['-', '*', '+'])
    };
    rest.is_some_and(|rest| rest.starts_with(' '))
}

fn heading(line: &str) -> Option<&str> {
    let level = line.chars().take_while(|c| *c == '#').count();
    let rest = line.get(level..)?.strip_prefix(' ')?;
    (1..=6).contains(&level).then(|| rest.trim())
}

/// The name that a heading has as a destination of links.
fn slug(heading: &str) -> String {
    let kept = heading.trim().chars().filter_map(|c| match c {
        c if c.is_alphanumeric() => Some(c.to_lowercase().next().unwrap_or(c)),
        '-' | '_' => Some(c),
        c if c.is_whitespace() => Some('-'),
        _ => None,
    });
    kept.collect()
}

/// A line without its code spans, and these.
fn without_code(line: &str) -> (String, Vec<String>) {
    let (mut prose, mut spans) = (String::new(), Vec::new());
    let mut rest = line;
    while let Some(start) = rest.find('`') {
        let ticks = rest[start..].chars().take_while(|c| *c == '`').count();
        let (before, after) = (&rest[..start], &rest[start + ticks..]);
        let Some(end) = after.find(&"`".repeat(ticks)) else { break };
        prose.push_str(before);
        // Something must be left, or else the words beside the span would join.
        prose.push('`');
        spans.push(after[..end].to_owned());
        rest = &after[end + ticks..];
    }
    prose.push_str(rest);
    (prose, spans)
}

fn targets(prose: &str) -> impl Iterator<Item = String> + use<> {
    let mut found = Vec::new();
    let mut rest = prose;
    while let Some(start) = rest.find("](") {
        rest = &rest[start + 2..];
        let Some(end) = rest.find(')') else { break };
        found.push(rest[..end].split_whitespace().next().unwrap_or("").to_owned());
        rest = &rest[end..];
    }
    if let Some((_, target)) = prose.strip_prefix('[').and_then(|rest| rest.split_once("]: ")) {
        found.push(target.trim().to_owned());
    }
    for name in ["src=\"", "href=\""] {
        found.extend(attribute(prose, name));
    }
    found.into_iter()
}

fn attribute(prose: &str, start: &str) -> Vec<String> {
    prose.split(start).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_owned())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_has_its_language_its_text_and_the_marks_before_it() {
        let page = Page::parse(
            "Text.\n\n<!-- file: a.toml -->\n<!-- run -->\n\n```toml,extra\na = 1\n\nb = 2\n```\n",
        );
        assert_eq!(page.faults, []);
        assert_eq!(
            page.blocks,
            [Block {
                line: 6,
                language: "toml".to_owned(),
                text: "a = 1\n\nb = 2\n".to_owned(),
                marks: vec!["file: a.toml".to_owned(), "run".to_owned()],
                generated: false,
            }]
        );
    }

    #[test]
    fn indented_text_is_a_block_and_a_list_is_none() {
        let page = Page::parse(
            "Text:\n\n    mms list\n\n    mms run ring\n\n- item\n\n    more of the item\n",
        );
        let texts: Vec<&str> = page.blocks.iter().map(|block| block.text.as_str()).collect();
        assert_eq!(texts, ["mms list\n\nmms run ring\n"]);
    }

    #[test]
    fn a_section_names_its_form_and_its_commands() {
        let page = Page::parse(
            "<!-- begin: orders\nmms converge a\nmms converge b\n-->\n| x |\n<!-- end -->\n",
        );
        assert_eq!(page.faults, []);
        let [section] = page.sections.as_slice() else { panic!("{page:?}") };
        assert_eq!(section.form, "orders");
        assert_eq!(section.commands, ["mms converge a", "mms converge b"]);
        assert_eq!(section.body, 4..5);
        let page = Page::parse("<!-- begin: mms list -->\n<!-- end -->\n");
        assert_eq!((page.sections[0].form.as_str(), page.sections[0].commands.len()), ("", 1));
    }

    #[test]
    fn what_has_no_end_is_a_fault() {
        for text in [
            "```sh\nmms\n",
            "<!-- begin: mms list -->\n",
            "<!-- end -->\n",
            "<!-- run -->\nprose\n",
            "<!-- x\n",
        ] {
            assert_eq!(Page::parse(text).faults.len(), 1, "{text}");
        }
    }

    #[test]
    fn links_lie_outside_of_code_and_headings_are_anchors() {
        let page = Page::parse(
            "# What `F` is, and why\n\n## Again\n## Again\n[a](b.md#c) `[no](x)` ![d](e.svg \"t\")\n<img src=\"f.png\" id=\"g\">\n[h]: i.md\n",
        );
        let targets: Vec<&str> = page.links.iter().map(|link| link.target.as_str()).collect();
        assert_eq!(targets, ["b.md#c", "e.svg", "f.png", "i.md"]);
        assert_eq!(page.anchors, ["what-f-is-and-why", "again", "again-1", "g"]);
    }
}
