//! `mms resume`: a run that wrote checkpoints, from the last of them on.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use mmsmith_verify::Checkpoints;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::run;
use crate::arguments::{Arguments, Command, ResumeOptions, RunOptions};
use crate::json::Output;
use crate::keep;
use crate::terminal;

/// What a run leaves in its folder before its first step.
const FILE: &str = "run.json";
const SCHEMA: &str = "mmsmith.checkpoint/1";

/// How a run was started.
#[derive(Serialize, Deserialize)]
struct Start {
    schema: String,
    /// The folder that the run was started in, to which the files of its arguments are relative.
    folder: PathBuf,
    /// What followed the program's name.
    arguments: Vec<String>,
}

/// Goes on with the run of a folder.
pub(crate) fn resume(options: &ResumeOptions) -> Result<bool> {
    let path = options.folder.join(FILE);
    let shown = path.display();
    let text = fs::read_to_string(&path).with_context(|| {
        format!(
            "cannot read {shown}, which mms run --checkpoint {} writes",
            options.folder.display()
        )
    })?;
    let start: Start = serde_json::from_str(&text)
        .with_context(|| format!("{shown} is not what mms run --checkpoint writes"))?;
    if start.schema != SCHEMA {
        bail!("{shown} is of the form '{}', not '{SCHEMA}'", start.schema);
    }
    let folder = fs::canonicalize(&options.folder)?;
    let line = ["mms".to_owned()].into_iter().chain(start.arguments);
    let arguments = Arguments::try_parse_from(line).map_err(|refusal| {
        let refusal = refusal.to_string();
        let reason = refusal.strip_prefix("error: ").unwrap_or(&refusal);
        anyhow!("{shown}: the arguments are not those of this version: {reason}")
    })?;
    let Command::Run(mut run) = arguments.command else {
        bail!("{shown}: only mms run writes checkpoints");
    };
    std::env::set_current_dir(&start.folder).with_context(|| {
        format!("cannot enter {}, where the run was started", start.folder.display())
    })?;
    run.checkpoint = Some(folder);
    run.scheme.threads = options.threads.or(run.scheme.threads);
    run::follow(&run, true)
}

/// Writes down how this run was started.
pub(super) fn remember(folder: &Path) -> Result<()> {
    let path = folder.join(FILE);
    if path.exists() {
        let shown = folder.display();
        bail!(
            "--checkpoint: {shown} holds a run already; mms resume {shown} goes on with it, and without the folder's \
             files a run starts anew"
        );
    }
    fs::create_dir_all(folder)
        .with_context(|| format!("--checkpoint: cannot create {}", folder.display()))?;
    let arguments = std::env::args_os().skip(1).map(|argument| {
        let shown = argument.to_string_lossy().into_owned();
        argument.into_string().ok().with_context(|| {
            format!("--checkpoint: the argument {shown:?} is not valid Unicode and cannot be kept")
        })
    });
    let start = Start {
        schema: SCHEMA.into(),
        folder: std::env::current_dir().context("--checkpoint: cannot tell the current folder")?,
        arguments: arguments.collect::<Result<_>>()?,
    };
    Output::prepare(&path)?.write(&start)?;
    let shown = folder.display();
    terminal::note(format_args!("if this run is stopped, mms resume {shown} goes on with it"));
    Ok(())
}

/// Where the run with these settings keeps its state.
pub(super) fn checkpoints(
    folder: &Path,
    options: &RunOptions,
    settings: &Value,
    resume: bool,
) -> Result<Checkpoints> {
    let (settings, origin) = (keep::decisive(settings), keep::origin(&options.name)?);
    let identity = Sha256::digest(format!("{settings}{origin}")).into();
    Ok(Checkpoints { folder: folder.to_owned(), every: options.every, identity, resume })
}
