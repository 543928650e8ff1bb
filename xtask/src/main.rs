//! Tasks of the repository itself, behind the alias `cargo xtask`.

use anyhow::{Context, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Parser, Subcommand};
use generate::Options;
use mmsmith_codegen::{HOSTS, Host};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

mod ablation;
mod docs;
mod formulas;
mod generate;
mod page;
mod publish;
mod release;

/// Tasks of the repository itself.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Generate the solutions in crates/solutions, in Rust and in C, from the specifications in mms-specs.
    Gen {
        /// Change nothing; fail where a generated file differs from its specification.
        #[arg(long)]
        check: bool,
        /// Tell how long each specification took.
        #[arg(long)]
        times: bool,
        /// Generate for this language or host only; those but rust and c need --out.
        #[arg(long, value_parser = hosts())]
        target: Option<&'static Host>,
        /// Write the files into this folder instead, or check those there, and no list of solutions.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Specification files, or names of files in mms-specs; all of mms-specs where none is given.
        #[arg(value_name = "SPEC")]
        specs: Vec<PathBuf>,
    },
    /// Switch each rule of the derivation off, and write what is lost into the book; fail where that is not as the rule's row says.
    Ablation {
        /// Leave the book as it is.
        #[arg(long)]
        check: bool,
    },
    /// Set the formulas of the book for mdBook, which calls this: see docs/book.toml.
    Formulas {
        /// The question of mdBook whether a kind of output is served; all are.
        #[arg(value_name = "supports OUTPUT")]
        question: Vec<String>,
    },
    /// Look whether all crates can be published: what their manifests say, and whether each compiles from what would be published.
    Publish {
        /// Publish nothing. There is no other way: whoever publishes runs `cargo publish --workspace`.
        #[arg(long, required = true)]
        check: bool,
        /// Package the crates without compiling each package by itself, which takes most of the time.
        #[arg(long)]
        no_build: bool,
    },
    /// Build the command for any Linux on x86-64, and pack it with manual pages and completions into one archive.
    Release {
        /// The folder of the archive and its checksum.
        #[arg(long, value_name = "DIR", default_value = "target/archive")]
        out: PathBuf,
        /// Pack sources that differ from the commit, too.
        #[arg(long)]
        allow_dirty: bool,
    },
    /// Run the examples of README and book, follow their links, and write the measurements of their pages.
    #[command(group = clap::ArgGroup::new("what").required(true))]
    Docs {
        /// Change nothing; run each code block, and fail where a block, a link, a section or a stray measurement is at fault.
        #[arg(long, group = "what")]
        check: bool,
        /// Run the commands that the pages name, and write what they measure into the pages.
        #[arg(long, group = "what")]
        write: bool,
        /// The command mms that is run.
        #[arg(long, value_name = "FILE", default_value = "target/release/mms")]
        mms: PathBuf,
        /// Pages to write, or whose examples are run, such as README.md or results/library.md; all where none is given.
        #[arg(value_name = "PAGE")]
        pages: Vec<PathBuf>,
    },
    /// Build the page where anyone tries mmsmith in a browser: a folder of static files.
    Page {
        /// The folder.
        #[arg(long, value_name = "DIR", default_value = "target/site")]
        out: PathBuf,
        /// Leave the solver out: the page has no checks and no orders then.
        #[arg(long)]
        no_solver: bool,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse().task) {
        Ok(code) => code,
        Err(error) => {
            complain(&format!("{error:#}"));
            ExitCode::from(2)
        }
    }
}

fn run(task: Task) -> anyhow::Result<ExitCode> {
    let (lines, failed) = match task {
        Task::Gen { check, times, target, out, specs } => {
            let hosts = target.map_or_else(generate::kept, |host| vec![host]);
            let options = Options { check, times };
            let outcome = generate::run(&repository(), &specs, &hosts, out.as_deref(), options)?;
            (outcome.lines, outcome.stale)
        }
        Task::Ablation { check } => ablation::run(&repository(), check)?,
        Task::Formulas { question } => {
            if question.is_empty() {
                formulas::preprocess(std::io::stdin().lock(), std::io::stdout().lock())?;
            }
            (Vec::new(), false)
        }
        Task::Page { out, no_solver } => (page::run(&repository(), &out, !no_solver)?, false),
        Task::Publish { no_build, .. } => publish::check(&repository(), no_build, say)?,
        Task::Release { out, allow_dirty } => {
            (release::run(&repository(), &out, allow_dirty)?, false)
        }
        Task::Docs { write: true, mms, pages, .. } => {
            docs::write(&repository(), &mms, &pages, say)?;
            (Vec::new(), false)
        }
        Task::Docs { mms, pages, .. } => {
            let report = docs::check(&repository(), &mms, &pages)?;
            (report.lines, report.failed)
        }
    };
    for line in &lines {
        say(line);
    }
    Ok(if failed { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Hosts, with a line about each.
fn hosts() -> impl TypedValueParser<Value = &'static Host> {
    let values = HOSTS.iter().map(|own| PossibleValue::new(own.name).help(own.about));
    PossibleValuesParser::new(values).try_map(|name| Host::named(&name).ok_or(name))
}

/// The folder of the workspace.
fn repository() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().unwrap_or(manifest).to_path_buf()
}

#[allow(clippy::print_stdout)]
fn say(line: &str) {
    println!("{line}");
}

#[allow(clippy::print_stderr)]
fn complain(message: &str) {
    eprintln!("{message}");
}

/// Reads a text file; the error names it.
fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Replaces a file as a whole: a reader sees the old text or the new one, never a part.
fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    let Some(folder) = path.parent() else { bail!("{} is not a file", path.display()) };
    let context = || format!("cannot write {}", path.display());
    std::fs::create_dir_all(folder).with_context(context)?;
    let temporary = path.with_extension("tmp");
    std::fs::write(&temporary, text)
        .and_then(|()| std::fs::rename(&temporary, path))
        .inspect_err(|_| drop(std::fs::remove_file(&temporary)))
        .with_context(context)
}
