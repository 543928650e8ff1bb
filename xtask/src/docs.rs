//! The README and the book in `docs/`: their examples are run, their links followed, their measurements written by
//! commands.

use crate::{formulas, read};
use anyhow::{Context, bail};
use blocks::Workplace;
use links::{BOOK, Pages};
use markdown::Page;
pub(crate) use sections::stamp;
use std::path::{Path, PathBuf};
use std::time::Instant;

mod blocks;
mod links;
mod markdown;
mod sections;
mod timing;

/// The README is one screen.
const README_LINES: usize = 150;
const README_WORDS: usize = 1200;

/// Result of a check.
pub(crate) struct Report {
    /// A line for each block, section and fault.
    pub(crate) lines: Vec<String>,
    /// Whether a fault is among them.
    pub(crate) failed: bool,
}

/// Runs the examples of the given pages, or of all, and looks for broken links, stale sections and measurements that no command wrote.
pub(crate) fn check(repository: &Path, mms: &Path, wanted: &[PathBuf]) -> anyhow::Result<Report> {
    let start = Instant::now();
    require(mms)?;
    let texts = texts(repository)?;
    require_known(&texts, wanted)?;
    let pages: Pages = texts.iter().map(|(path, text)| (path.clone(), Page::parse(text))).collect();
    let doctests = read(&repository.join("tests/src/lib.rs"))?;
    let (mut lines, mut faults) = (Vec::new(), Vec::new());
    let mut blocks = 0;
    for (path, text) in texts.iter().filter(|(path, _)| is_wanted(path, wanted)) {
        let Some(page) = pages.get(path) else { continue };
        let shown = path.display().to_string();
        let place = Workplace::new(mms, repository, &shown)?;
        faults.extend(page.faults.iter().map(|(line, fault)| (path.clone(), *line, fault.clone())));
        let has_doctests = doctests.contains(&format!("/{}\")", shown.replace('\\', "/")));
        for outcome in blocks::check(page, has_doctests, &place) {
            blocks += 1;
            match outcome.result {
                Ok(done) => {
                    lines.push(format!("{shown}:{}: {} {done}", outcome.line, outcome.language))
                }
                Err(fault) => faults.push((path.clone(), outcome.line, fault)),
            }
        }
        let own: Vec<&str> = text.lines().collect();
        for section in &page.sections {
            match sections::fault(section, &own, &place) {
                Ok(()) => lines.push(format!(
                    "{shown}:{}: section of {} command(s)",
                    section.line,
                    section.commands.len()
                )),
                Err(fault) => faults.push((path.clone(), section.line, fault)),
            }
        }
        for (line, latex) in &page.formulas {
            if let Err(fault) = formulas::mathml(latex, false) {
                faults.push((path.clone(), *line, format!("the formula cannot be set: {fault}")));
            }
        }
        for (line, prose) in &page.prose {
            if let Some(timing) = timing::timing(prose) {
                faults.push((
                    path.clone(),
                    *line,
                    format!(
                        "the timing '{timing}' stands outside of a section that a command writes"
                    ),
                ));
            }
        }
        for block in page
            .blocks
            .iter()
            .filter(|block| !block.generated && matches!(block.language.as_str(), "text" | ""))
        {
            if let Some(timing) = block.text.lines().find_map(timing::timing) {
                faults.push((path.clone(), block.line, format!("the timing '{timing}' stands in a block that no command writes; put three dots there")));
            }
        }
    }
    let readme =
        texts.iter().find(|(path, _)| path == Path::new("README.md")).map_or("", |(_, text)| text);
    let (length, words) = (readme.lines().count(), readme.split_whitespace().count());
    if length > README_LINES || words > README_WORDS {
        let fault = format!(
            "{length} lines and {words} words, where {README_LINES} and {README_WORDS} are allowed"
        );
        faults.push(("README.md".into(), 1, fault));
    }
    faults.extend(links::faults(&pages, repository));
    faults.extend(links::strangers(&pages, &sources(&repository.join("crates"))?));
    let links: usize = pages.values().map(|page| page.links.len()).sum();
    let failed = !faults.is_empty();
    lines.extend(
        faults
            .iter()
            .map(|(path, line, fault)| format!("FAULT {}:{line}: {fault}", path.display())),
    );
    lines.push(format!(
        "{} pages, {blocks} blocks, {links} links, {} fault(s), {:.0} s",
        texts.len(),
        faults.len(),
        start.elapsed().as_secs_f64()
    ));
    Ok(Report { lines, failed })
}

/// Writes the generated sections of the given pages, or of all, and tells of each page as it is written.
pub(crate) fn write(
    repository: &Path,
    mms: &Path,
    wanted: &[PathBuf],
    say: impl Fn(&str),
) -> anyhow::Result<()> {
    require(mms)?;
    let texts = texts(repository)?;
    require_known(&texts, wanted)?;
    for (path, text) in texts.iter().filter(|(path, _)| is_wanted(path, wanted)) {
        let shown = path.display();
        let start = Instant::now();
        let place = Workplace::new(mms, repository, &shown.to_string())?;
        let (written, count) =
            sections::write(text, &place, repository).with_context(|| format!("{shown}"))?;
        if count > 0 {
            crate::write(&repository.join(path), &written)?;
            say(&format!("{shown}: {count} section(s), {:.0} s", start.elapsed().as_secs_f64()));
        }
    }
    Ok(())
}

/// Whether a page is among those that were asked for: all where none is.
fn is_wanted(path: &Path, wanted: &[PathBuf]) -> bool {
    wanted.is_empty() || wanted.iter().any(|wanted| path.ends_with(wanted))
}

fn require_known(texts: &[(PathBuf, String)], wanted: &[PathBuf]) -> anyhow::Result<()> {
    let is_known = |wanted: &Path| texts.iter().any(|(path, _)| path.ends_with(wanted));
    match wanted.iter().find(|wanted| !is_known(wanted)) {
        Some(missing) => {
            bail!("no page {}; pages are README.md and those in {BOOK}", missing.display())
        }
        None => Ok(()),
    }
}

fn require(mms: &Path) -> anyhow::Result<()> {
    if !mms.is_file() {
        bail!(
            "no program {}; build it with cargo build --release --package mmsmith-cli, or name another with --mms",
            mms.display()
        );
    }
    Ok(())
}

/// The README and the pages of the book, by their paths in the repository.
fn texts(repository: &Path) -> anyhow::Result<Vec<(PathBuf, String)>> {
    let mut paths = vec![PathBuf::from("README.md")];
    for path in files(&repository.join(BOOK), "md")? {
        paths.push(path.strip_prefix(repository).unwrap_or(&path).to_owned());
    }
    paths.into_iter().map(|path| Ok((path.clone(), read(&repository.join(&path))?))).collect()
}

/// All Rust source of a folder.
fn sources(folder: &Path) -> anyhow::Result<String> {
    files(folder, "rs")?.iter().map(|path| read(path)).collect()
}

/// The files of a folder and those within it that have an ending, in order.
pub(crate) fn files(folder: &Path, ending: &str) -> anyhow::Result<Vec<PathBuf>> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        let context = || format!("cannot read {}", folder.display());
        for entry in std::fs::read_dir(&folder).with_context(context)? {
            let path = entry.with_context(context)?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == ending) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
