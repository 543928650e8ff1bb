//! Fate of each code block: it is run, read, compared, or exempt with a reason.

use super::markdown::{Block, Page};
use crate::formulas;
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Action on a block.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// A command wrote it.
    Generated,
    /// Nothing, for this reason.
    Exempt(String),
    /// It is a file of this name, which later blocks use.
    File(String),
    /// It must be JSON.
    Json,
    /// It is a formula in LaTeX that can be set.
    Formula,
    /// It is run as a script that must end with this status.
    Run(i32),
    /// It is what the script before it prints.
    Output,
    /// It is compiled and run with the documentation tests.
    Doctest,
}

impl Action {
    /// The action that the marks and the language of a block ask for.
    pub(crate) fn of(block: &Block, has_doctests: bool) -> Result<Self, String> {
        if block.generated {
            return Ok(Self::Generated);
        }
        let language = block.language.as_str();
        if let Some(mark) = block.marks.first() {
            let (name, value) = mark.split_once(':').unwrap_or((mark.as_str(), ""));
            let (name, value) = (name.trim(), value.trim());
            return match name {
                "exempt" if value.is_empty() => Err("<!-- exempt: --> states no reason".to_owned()),
                "exempt" => Ok(Self::Exempt(value.to_owned())),
                "file"
                    if value.is_empty()
                        || Path::new(value).is_absolute()
                        || value.contains("..") =>
                {
                    Err("<!-- file: --> needs a name within the folder of the page".to_owned())
                }
                "file" => Ok(Self::File(value.to_owned())),
                "run" if language != "sh" => Err(format!("only sh is run, this is '{language}'")),
                "run" if value.is_empty() => Ok(Self::Run(0)),
                "run" => {
                    let status =
                        value.strip_prefix("status ").and_then(|status| status.parse().ok());
                    status
                        .map(Self::Run)
                        .ok_or_else(|| format!("'{mark}' should be 'run: status N'"))
                }
                "output" => Ok(Self::Output),
                _ => Err(format!(
                    "the mark '{mark}' is not known; known are run, run: status N, output, file: NAME and exempt: REASON"
                )),
            };
        }
        match language {
            "json" => Ok(Self::Json),
            "math" => Ok(Self::Formula),
            "rust" if has_doctests => Ok(Self::Doctest),
            "rust" => Err("the page is no documentation test: name it in tests/src/lib.rs, or write <!-- exempt: REASON --> before the block".to_owned()),
            _ => Err("neither run nor exempt: write <!-- run -->, <!-- output -->, <!-- file: NAME --> or <!-- exempt: REASON --> before it".to_owned()),
        }
    }
}

/// Outcome of a block.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) line: usize,
    pub(crate) language: String,
    /// The action done, or why it failed.
    pub(crate) result: Result<String, String>,
}

/// The folder in which the blocks of one page are run.
pub(crate) struct Workplace {
    mms: PathBuf,
    folder: PathBuf,
    repository: PathBuf,
}

/// Makes `mms` and `cargo mms` the given program, and the sources those of the repository.
const PRELUDE: &str = r#"set -e
mms() { "$MMS" "$@"; }
cargo() {
    [ "$1" = mms ] || { echo "cargo $1 is not run here; mark the block as exempt" >&2; return 70; }
    shift
    "$MMS" "$@"
}
for folder in crates tests; do
    [ -e $folder ] || [ -L $folder ] || ln -s "$REPOSITORY/$folder" $folder
done
"#;

/// Output of a script, and how it ended.
pub(crate) struct Printed {
    pub(crate) status: Option<i32>,
    pub(crate) out: String,
    pub(crate) errors: String,
    pub(crate) took: Duration,
}

impl Workplace {
    /// An empty folder outside of the repository, so that nothing there is found by accident.
    pub(crate) fn new(mms: &Path, repository: &Path, name: &str) -> anyhow::Result<Self> {
        let name = name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let folder =
            std::env::temp_dir().join(format!("mmsmith-docs-{}", std::process::id())).join(name);
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        let absolute = |path: &Path| {
            std::path::absolute(path).with_context(|| format!("cannot find {}", path.display()))
        };
        Ok(Self { mms: absolute(mms)?, folder, repository: absolute(repository)? })
    }

    /// Runs a script in the folder.
    pub(crate) fn run(&self, script: &str) -> anyhow::Result<Printed> {
        let start = Instant::now();
        // Scripts that a block calls find the program as well.
        let own = self.mms.parent().map(Path::to_path_buf);
        let path = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(own.into_iter().chain(std::env::split_paths(&path)))?;
        let output = Command::new("sh")
            .args(["-c", &format!("{PRELUDE}{script}")])
            .current_dir(&self.folder)
            .env("PATH", path)
            .env("MMS", &self.mms)
            .env("REPOSITORY", &self.repository)
            .env("NO_COLOR", "1")
            .stdin(Stdio::null())
            .output()
            .context("cannot start sh")?;
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ok(Printed {
            status: output.status.code(),
            out: text(output.stdout),
            errors: text(output.stderr),
            took: start.elapsed(),
        })
    }

    /// A file of the folder.
    pub(crate) fn read(&self, name: &str) -> anyhow::Result<String> {
        crate::read(&self.folder.join(name))
    }

    fn write(&self, name: &str, text: &str) -> anyhow::Result<()> {
        crate::write(&self.folder.join(name), text)
    }
}

impl Drop for Workplace {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.folder));
        // Goes with the last page.
        if let Some(parent) = self.folder.parent() {
            drop(std::fs::remove_dir(parent));
        }
    }
}

/// Runs the blocks of a page, one after the other, in one folder.
pub(crate) fn check(page: &Page, has_doctests: bool, place: &Workplace) -> Vec<Outcome> {
    let mut printed = None;
    let outcome = |(i, block): (usize, &Block)| {
        let later = &page.blocks[i + 1..];
        let result = Action::of(block, has_doctests).and_then(|action| {
            act(&action, block, later, place, &mut printed)
                .unwrap_or_else(|error| Err(format!("{error:#}")))
        });
        Outcome { line: block.line, language: block.language.clone(), result }
    };
    page.blocks.iter().enumerate().map(outcome).collect()
}

fn act(
    action: &Action,
    block: &Block,
    later: &[Block],
    place: &Workplace,
    printed: &mut Option<Printed>,
) -> anyhow::Result<Result<String, String>> {
    Ok(match action {
        Action::Generated => Ok("written by a command".to_owned()),
        Action::Exempt(reason) => Ok(format!("exempt: {reason}")),
        Action::Doctest => Ok("run by the documentation tests of mmsmith-tests".to_owned()),
        Action::Json => parse_json(&block.text),
        Action::Formula => match formulas::mathml(&block.text, true) {
            Ok(_) => Ok("a formula that can be set".to_owned()),
            Err(fault) => Err(format!("the formula cannot be set: {fault}")),
        },
        Action::Output => match printed.as_ref() {
            Some(printed) => compare(&block.text, &format!("{}{}", printed.out, printed.errors)),
            None => Err("no script was run before it".to_owned()),
        },
        Action::Run(expected) => {
            let found = place.run(&block.text)?;
            let result = if found.status == Some(*expected) {
                Ok(format!("run, {:.1} s", found.took.as_secs_f64()))
            } else {
                let status =
                    found.status.map_or("a signal".to_owned(), |status| format!("status {status}"));
                Err(format!(
                    "ended with {status} instead of {expected}:\n{}{}",
                    found.out, found.errors
                ))
            };
            *printed = Some(found);
            result
        }
        Action::File(name) => {
            place.write(name, &block.text)?;
            let uses = |block: &&Block| {
                matches!(Action::of(block, false), Ok(Action::Run(_))) && names(&block.text, name)
            };
            let user = later.iter().find(uses);
            if block.language == "json" {
                return Ok(parse_json(&block.text));
            }
            if block.language == "toml" && block.text.contains("[displacement]") {
                let found = place.run(&format!("mms check '{name}'"))?;
                if found.status != Some(0) {
                    return Ok(Err(format!(
                        "mms check refuses it:\n{}{}",
                        found.out, found.errors
                    )));
                }
                return Ok(Ok(format!("checked by mms check, {:.1} s", found.took.as_secs_f64())));
            }
            user.map(|user| format!("used by the block in line {}", user.line))
                .ok_or_else(|| format!("no block that is run later names {name}"))
        }
    })
}

/// Whether a script names a file, with its ending or without.
fn names(script: &str, file: &str) -> bool {
    let stem = Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or(file);
    script.contains(file) || script.contains(stem)
}

fn parse_json(text: &str) -> Result<String, String> {
    match serde_json::from_str::<serde_json::Value>(text) {
        Ok(_) => Ok("read as JSON".to_owned()),
        Err(error) => Err(format!("no JSON: {error}")),
    }
}

/// Compares what a page states with what a script printed. A line of three dots stands for any lines, three dots within
/// a line for any text; runs of blanks are alike.
fn compare(stated: &str, printed: &str) -> Result<String, String> {
    let squeeze = |text: &str| -> Vec<String> {
        let lines = text.trim_end().lines();
        lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    };
    let (stated, printed) = (squeeze(stated), squeeze(printed));
    let mut at = 0;
    let mut skips = false;
    for line in &stated {
        if line == "..." {
            skips = true;
            continue;
        }
        let found = printed[at..].iter().position(|printed| is_like(line, printed));
        match found {
            Some(0) => at += 1,
            Some(further) if skips => at += further + 1,
            _ => {
                let instead = printed.get(at).map_or("nothing more", String::as_str);
                return Err(format!(
                    "the command does not print '{line}'; at that place it prints '{instead}'"
                ));
            }
        }
        skips = false;
    }
    match printed.get(at) {
        Some(more) if !skips => Err(format!("the command also prints '{more}'")),
        _ => Ok("printed by the script before it".to_owned()),
    }
}

fn is_like(pattern: &str, line: &str) -> bool {
    let mut parts = pattern.split("...");
    let Some(rest) = parts.next().and_then(|first| line.strip_prefix(first.trim_end())) else {
        return false;
    };
    let parts: Vec<&str> = parts.map(str::trim).collect();
    let Some((last, middle)) = parts.split_last() else { return rest.is_empty() };
    let mut rest = rest;
    for part in middle {
        let Some((_, after)) = rest.split_once(part) else { return false };
        rest = after;
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(language: &str, marks: &[&str]) -> Block {
        Block {
            line: 1,
            language: language.to_owned(),
            text: "mms list\n".to_owned(),
            marks: marks.iter().map(|&mark| mark.to_owned()).collect(),
            generated: false,
        }
    }

    #[test]
    fn a_block_without_a_mark_fails() {
        for language in ["sh", "toml", "c", "text", ""] {
            let fault = Action::of(&block(language, &[]), false).unwrap_err();
            assert!(fault.contains("neither run nor exempt"), "{fault}");
        }
        assert!(Action::of(&block("rust", &[]), false).unwrap_err().contains("tests/src/lib.rs"));
        assert!(Action::of(&block("sh", &["exempt:"]), false).is_err());
        assert!(Action::of(&block("sh", &["file: ../x"]), false).is_err());
        assert!(Action::of(&block("c", &["run"]), false).is_err());
        assert!(
            Action::of(&block("sh", &["rnu"]), false).unwrap_err().contains("'rnu' is not known")
        );
    }

    #[test]
    fn marks_say_what_is_done() {
        assert_eq!(Action::of(&block("sh", &["run"]), false), Ok(Action::Run(0)));
        assert_eq!(Action::of(&block("sh", &["run: status 1"]), false), Ok(Action::Run(1)));
        assert_eq!(
            Action::of(&block("c", &["file: a.c"]), false),
            Ok(Action::File("a.c".to_owned()))
        );
        assert_eq!(
            Action::of(&block("sh", &["exempt: slow"]), false),
            Ok(Action::Exempt("slow".to_owned()))
        );
        assert_eq!(Action::of(&block("rust", &[]), true), Ok(Action::Doctest));
        assert_eq!(Action::of(&block("json", &[]), false), Ok(Action::Json));
        assert_eq!(Action::of(&block("math", &[]), false), Ok(Action::Formula));
    }

    #[test]
    fn stated_output_is_compared_but_for_what_dots_stand_for() {
        let printed = "a  1\nb 2 in 3 s\nc\nd\n";
        for stated in ["a 1\nb 2 in ... s\nc\nd\n", "a 1\n...\n", "...\nd\n", "a ...\n...\nc\n..."]
        {
            assert!(compare(stated, printed).is_ok(), "{stated}");
        }
        for stated in
            ["a 1\nb 2\nc\nd\n", "a 1\n", "b 2 in 3 s\nc\nd\n", "...\nc\n", "a 1\n...\ne\n"]
        {
            assert!(compare(stated, printed).is_err(), "{stated}");
        }
    }

    #[test]
    fn scripts_run_in_a_folder_of_their_own_and_their_failure_is_told() {
        let place = Workplace::new(Path::new("/bin/echo"), Path::new("."), "scripts").unwrap();
        let page = Page::parse(
            "<!-- file: in/a.txt -->\n```text\nhello\n```\n<!-- run -->\n```sh\ncat in/a.txt\ncargo mms list\n```\n\
             <!-- output -->\n```text\nhello\nlist\n```\n<!-- run -->\n```sh\nfalse\n```\n<!-- run: status 70 -->\n```sh\ncargo test\n```\n\
             <!-- file: b.txt -->\n```text\nunused\n```\n```json\n{\n```\n",
        );
        let results: Vec<bool> =
            check(&page, false, &place).iter().map(|outcome| outcome.result.is_ok()).collect();
        assert_eq!(results, [true, true, true, false, true, false, false]);
    }
}
