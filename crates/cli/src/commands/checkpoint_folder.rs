//! The folder of a run with checkpoints: how the run was started, and its checkpoints.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mmsmith_verify::{CheckpointError, CheckpointFolder, Checkpoints};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::arguments::RunOptions;
use crate::checksum::sha256;
use crate::input;
use crate::json::{self, Output};
use crate::keep;
use crate::processes;
use crate::terminal;

/// File that a run writes into its folder before its first step.
pub(super) const FILE: &str = "run.json";
const SCHEMA: &str = "mmsmith.checkpoint/1";
/// The beginning of that file, and the text between its checksum and all that the checksum is of.
const BEFORE: &str = "{\"sha256\":\"";
const AFTER: &str = "\",";

/// How a run was started.
#[derive(Serialize, Deserialize)]
pub(super) struct Start {
    schema: String,
    /// The folder that the run was started in, to which the files of its arguments are relative.
    pub(super) folder: PathBuf,
    /// Arguments after the program's name.
    pub(super) arguments: Vec<String>,
}

/// The text of a JSON object with the SHA-256 of what follows it as its first member.
fn sealed(object: &str) -> Option<String> {
    let rest = object.strip_prefix('{')?;
    Some(format!("{BEFORE}{}{AFTER}{rest}", sha256(rest)))
}

/// Whether `text` is what [`sealed`] made, to the bit.
fn is_whole(text: &str) -> bool {
    let parts = text.strip_prefix(BEFORE).and_then(|text| text.split_once(AFTER));
    parts.is_some_and(|(found, rest)| found == sha256(rest))
}

/// How the run of `folder` was started.
pub(super) fn recall(folder: &Path) -> Result<Start> {
    let path = folder.join(FILE);
    let (shown, folder) = (path.display(), folder.display());
    let bytes = fs::read(&path).with_context(|| {
        format!("cannot read {shown}, which mms run --checkpoint {folder} writes")
    })?;
    let text = String::from_utf8(bytes).ok().filter(|text| is_whole(text));
    let Some(text) = text else {
        bail!(
            "{shown} is not what mms run --checkpoint wrote: its checksum does not match; delete {folder} to start the run \
             anew"
        );
    };
    let other = || format!("{shown} is not what mms run --checkpoint writes");
    let value: Value = serde_json::from_str(&text).with_context(other)?;
    match value["schema"].as_str() {
        Some(SCHEMA) => serde_json::from_value(value).with_context(other),
        Some(later) if later.starts_with("mmsmith.checkpoint/") => {
            bail!(
                "{shown} is of the form '{later}', of a later version of mms: resume with that one"
            )
        }
        _ => bail!("{}", other()),
    }
}

/// The folder, for this run alone: the first of its processes locks it.
pub(super) fn take(folder: &Path) -> Result<CheckpointFolder, CheckpointError> {
    if processes::is_first() {
        CheckpointFolder::lock(folder)
    } else {
        Ok(CheckpointFolder::of_first(folder))
    }
}

/// Where a run keeps its state, and whether it goes on from there.
pub(super) struct Place {
    pub(super) folder: CheckpointFolder,
    pub(super) resume: bool,
}

/// Takes the folder for this run, and writes down how it was started: by the words of this command line.
pub(super) fn remember(folder: &Path, line: &[OsString]) -> Result<Place> {
    if !processes::is_first() {
        return Ok(Place { folder: CheckpointFolder::of_first(folder), resume: false });
    }
    let path = folder.join(FILE);
    if input::kind_of(&path).context("--checkpoint")?.is_some() {
        let shown = folder.display();
        bail!(
            "--checkpoint: {shown} holds a run already; mms resume {shown} goes on with it, and without the folder's \
             files a run starts anew"
        );
    }
    fs::create_dir_all(folder)
        .with_context(|| format!("--checkpoint: cannot create {}", folder.display()))?;
    let locked = CheckpointFolder::lock(folder).context("--checkpoint")?;
    // Another run may have come and gone since.
    if input::kind_of(&path).context("--checkpoint")?.is_some() {
        bail!("--checkpoint: {} holds a run already", folder.display());
    }
    let arguments = line.iter().skip(1).map(|argument| {
        argument.to_str().map(str::to_owned).with_context(|| {
            let shown = argument.to_string_lossy();
            format!("--checkpoint: the argument {shown:?} is not valid Unicode and cannot be kept")
        })
    });
    let start = Start {
        schema: SCHEMA.into(),
        folder: std::env::current_dir().context("--checkpoint: cannot tell the current folder")?,
        arguments: arguments.collect::<Result<_>>()?,
    };
    let text = sealed(&json::text(&start)?).context("cannot form JSON")?;
    Output::prepare(&path)?.write_text(&text)?;
    let shown = folder.display();
    terminal::note(format_args!("if this run is stopped, mms resume {shown} goes on with it"));
    Ok(Place { folder: locked, resume: false })
}

/// The checkpoints of the run with these settings.
pub(super) fn checkpoints(
    place: Place,
    options: &RunOptions,
    settings: &Value,
) -> Result<Checkpoints> {
    let (settings, origin) = (keep::decisive(settings), keep::origin(&options.name)?);
    let identity = Sha256::digest(format!("{settings}{origin}")).into();
    let Place { folder, resume } = place;
    processes::keep_in(folder.path());
    Ok(Checkpoints { folder, every: options.every, identity, resume })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever bit of it is turned, the file is refused, and named.
    #[test]
    fn every_altered_bit_of_a_start_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let start = Start {
            schema: SCHEMA.into(),
            folder: "/home/user/study".into(),
            arguments: ["run", "ring", "--cells", "16", "--json", "a.json"].map(Into::into).into(),
        };
        let path = folder.path().join(FILE);
        let text = sealed(&json::text(&start).unwrap()).unwrap();
        let whole = text.clone().into_bytes();
        fs::write(&path, &whole).unwrap();
        assert_eq!(recall(folder.path()).unwrap().arguments, start.arguments);
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, bytes).unwrap();
            let Err(error) = recall(folder.path()) else { panic!("bit {bit} of {text}") };
            assert!(error.to_string().contains(FILE), "{error}");
        }
    }
}
