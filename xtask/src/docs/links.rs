//! Links between pages, paths into the repository, and the table of contents.

use super::markdown::Page;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Pages by their path in the repository.
pub(crate) type Pages = BTreeMap<PathBuf, Page>;

/// Where the pages of the book lie.
pub(crate) const BOOK: &str = "docs/src";

/// The folders whose paths are checked wherever a code span names one.
const FOLDERS: [&str; 7] =
    ["crates/", "tests/", "xtask/", "mms-specs/", "docs/", ".ci/", ".cargo/"];

/// A fault, with its page and line.
pub(crate) type Fault = (PathBuf, usize, String);

/// Links that lead nowhere, paths that do not exist, and pages that the table of contents lacks.
pub(crate) fn faults(pages: &Pages, repository: &Path) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (path, page) in pages {
        for link in &page.links {
            if let Err(fault) = follow(path, &link.target, pages, repository) {
                faults.push((path.clone(), link.line, fault));
            }
        }
        for (line, span) in &page.spans {
            let named = span.split([':', ' ', '{', '*', '<']).next().unwrap_or("");
            let is_path = FOLDERS.iter().any(|folder| span.starts_with(folder));
            // NAME stands for any name, and the examples of a page have files of their own.
            let is_example = named.contains("NAME")
                || page.blocks.iter().any(|block| block.marks.contains(&format!("file: {named}")));
            if is_path && !is_example && !repository.join(named).exists() {
                faults.push((path.clone(), *line, format!("the repository has no {named}")));
            }
        }
    }
    let contents = Path::new(BOOK).join("SUMMARY.md");
    if let Some(summary) = pages.get(&contents) {
        let listed: Vec<PathBuf> =
            summary.links.iter().filter_map(|link| resolve(&contents, &link.target)).collect();
        for path in pages.keys().filter(|path| path.starts_with(BOOK) && **path != contents) {
            if !listed.contains(path) {
                faults.push((
                    contents.clone(),
                    1,
                    format!("the table of contents lacks {}", path.display()),
                ));
            }
        }
    }
    faults
}

/// Words of the glossary that the code does not use.
pub(crate) fn strangers(pages: &Pages, sources: &str) -> Vec<Fault> {
    let path = Path::new(BOOK).join("contributing/glossary.md");
    let Some(page) = pages.get(&path) else { return Vec::new() };
    let is_row =
        |line: usize| page.prose.iter().any(|(at, prose)| *at == line && prose.starts_with("| "));
    let last_of_line =
        |i: usize| page.spans.get(i + 1).is_none_or(|(line, _)| *line != page.spans[i].0);
    let mut faults = Vec::new();
    for (i, (line, span)) in page.spans.iter().enumerate() {
        if is_row(*line) && last_of_line(i) && !sources.contains(span.as_str()) {
            faults.push((path.clone(), *line, format!("the code has no {span}")));
        }
    }
    faults
}

/// Follows a link of a page.
fn follow(page: &Path, target: &str, pages: &Pages, repository: &Path) -> Result<(), String> {
    if target.contains("://") || target.starts_with("mailto:") {
        return Ok(());
    }
    let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
    let at = if file.is_empty() {
        page.to_owned()
    } else {
        resolve(page, file).ok_or_else(|| format!("{target} leads out of the repository"))?
    };
    if !repository.join(&at).exists() && !pages.contains_key(&at) {
        return Err(format!("the link {target} leads to {}, which is not there", at.display()));
    }
    if page.starts_with(BOOK) && !at.starts_with(BOOK) {
        return Err(format!(
            "the link {target} leads out of the book; name the path as code instead"
        ));
    }
    match pages.get(&at) {
        Some(found) if !anchor.is_empty() && !found.anchors.iter().any(|known| known == anchor) => {
            Err(format!("{} has no heading #{anchor}", at.display()))
        }
        _ => Ok(()),
    }
}

/// The path in the repository that a link of a page leads to.
fn resolve(page: &Path, target: &str) -> Option<PathBuf> {
    let file = target.split_once('#').map_or(target, |(file, _)| file);
    let mut at = page.parent()?.to_owned();
    for component in Path::new(file).components() {
        match component {
            Component::ParentDir => {
                if !at.pop() {
                    return None;
                }
            }
            Component::Normal(name) => at.push(name),
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(pages: &[(&str, &str)]) -> Vec<String> {
        let pages =
            pages.iter().map(|(path, text)| (PathBuf::from(path), Page::parse(text))).collect();
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        faults(&pages, &repository)
            .into_iter()
            .map(|(path, line, fault)| format!("{}:{line}: {fault}", path.display()))
            .collect()
    }

    #[test]
    fn links_to_pages_headings_and_files_are_followed() {
        let right = [
            (
                "README.md",
                "[a](docs/src/a.md#there) [b](LICENSE-MIT) [c](https://example.org/#x) [d](#e)\n# E\n",
            ),
            ("docs/src/SUMMARY.md", "[A](a.md) [B](b/b.md)\n"),
            ("docs/src/a.md", "# There\n[b](b/b.md) `crates/mpm/src/lib.rs:12`\n"),
            ("docs/src/b/b.md", "[a](../a.md#there)\n"),
        ];
        assert_eq!(found(&right), [""; 0]);
    }

    #[test]
    fn links_that_lead_nowhere_are_found() {
        let faults = found(&[
            (
                "README.md",
                "[a](no-such-file.md)\n[b](docs/src/a.md#nowhere)\n[c](#nowhere)\n[d](../up.md)\n",
            ),
            ("docs/src/a.md", "[out](../../README.md)\n`crates/mpm/src/no_such_file.rs`\n"),
        ]);
        assert_eq!(faults.len(), 6, "{faults:?}");
        assert!(
            faults[0].starts_with("README.md:1: ") && faults[0].contains("no-such-file.md"),
            "{faults:?}"
        );
        assert!(faults[1].contains("#nowhere"), "{faults:?}");
        assert!(faults[4].contains("out of the book"), "{faults:?}");
        assert!(faults[5].contains("no_such_file.rs"), "{faults:?}");
    }

    #[test]
    fn words_that_the_code_does_not_use_are_named() {
        let text = "| term | code |\n|---|---|\n| a, `x = y` | `fn a` |\n| b | `gone` |\n";
        let pages =
            [(PathBuf::from("docs/src/contributing/glossary.md"), Page::parse(text))].into();
        let faults = strangers(&pages, "fn a() {}");
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].2.contains("gone"), "{faults:?}");
    }

    #[test]
    fn pages_that_the_contents_lack_are_named() {
        let faults = found(&[
            ("docs/src/SUMMARY.md", "[A](a.md)\n"),
            ("docs/src/a.md", ""),
            ("docs/src/b.md", ""),
        ]);
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].contains("docs/src/b.md"), "{faults:?}");
    }
}
