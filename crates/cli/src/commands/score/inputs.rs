//! Which files are which recording.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use mmsmith_verify::{Input, Resolution};

use crate::arguments::ScoreOptions;

/// The recordings with their resolutions.
pub(super) fn inputs(options: &ScoreOptions) -> Result<Vec<Input>> {
    let values = options.cells.len() + options.h.len() + options.differences.len();
    let mut recordings: Vec<Vec<PathBuf>> = vec![];
    for file in &options.files {
        match recordings.last_mut() {
            Some(frames)
                if !options.each
                    && values != options.files.len()
                    && is_frame(file)
                    // Those before the last one have been found to be like it.
                    && frames
                        .last()
                        .is_some_and(|frame| is_frame(frame) && frame.parent() == file.parent()) =>
            {
                frames.push(file.clone());
            }
            _ => recordings.push(vec![file.clone()]),
        }
    }
    for (option, given) in [("--cells", options.cells.len()), ("--h", options.h.len())] {
        if given > 0 && given != recordings.len() {
            bail!("{option} has {given} value(s) for {}", listed(&recordings));
        }
    }
    let resolution = |index: usize| match (options.cells.get(index), options.h.get(index)) {
        (Some(cells), _) => Resolution::Cells(*cells),
        (None, Some(h)) => Resolution::Length(*h),
        (None, None) => Resolution::Estimated,
    };
    let lags = options.velocity_lag.len();
    if lags > 1 && lags != recordings.len() {
        bail!("--velocity-lag has {lags} value(s) for {}", listed(&recordings));
    }
    let input = |(index, paths)| Input {
        paths,
        resolution: resolution(index),
        velocity_lag: *options.velocity_lag.get(index).unwrap_or(&options.velocity_lag[0]),
    };
    Ok(recordings.into_iter().enumerate().map(input).collect())
}

/// Whether a path names a single frame, not a list or a folder.
fn is_frame(path: &Path) -> bool {
    !path.is_dir() && path.extension().is_some_and(|extension| extension != "pvd")
}

/// The recordings in words, with what makes others of them.
fn listed(recordings: &[Vec<PathBuf>]) -> String {
    let name = |path: &PathBuf| path.display().to_string();
    let joined = |frames: &Vec<PathBuf>| frames.iter().map(name).collect::<Vec<_>>().join(" + ");
    let all: Vec<_> = recordings.iter().map(joined).collect();
    let hint = if recordings.iter().any(|frames| frames.len() > 1) {
        "; files joined by + are frames of one recording, unless --each is given"
    } else {
        ""
    };
    format!("{} recording(s): {}{hint}", recordings.len(), all.join(", "))
}
