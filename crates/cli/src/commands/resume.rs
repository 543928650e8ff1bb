//! `mms resume`: a run that wrote checkpoints, from the last of them on.

use std::fs;

use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use mmsmith_verify::CheckpointFolder;

use super::checkpoint_folder::{FILE, Place, recall, take};
use super::run::{self, Origin};
use crate::arguments::{Arguments, Command, ResumeOptions};
use crate::terminal;

/// Goes on with the run of a folder.
pub(crate) fn resume(options: &ResumeOptions) -> Result<bool> {
    let start = recall(&options.folder)?;
    let path = options.folder.join(FILE);
    let shown = path.display();
    let given = options.folder.display();
    let real = fs::canonicalize(&options.folder);
    let folder = take(&real.with_context(|| format!("cannot enter {given}"))?)?;
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
    run.scheme.threads = options.threads.or(run.scheme.threads);
    // Other processes go on than those that began.
    run.process_grid.clone_from(&options.process_grid);
    match CheckpointFolder::reached(folder.path())? {
        Some(step) => terminal::note(format_args!("{given}: the run goes on after step {step}")),
        None => terminal::note(format_args!("{given}: no checkpoint yet, the run begins anew")),
    }
    run::follow(&run, Origin::Checkpoint(Place { folder, resume: true }))
}
