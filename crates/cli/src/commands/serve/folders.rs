//! The folders that a client may read and write.

use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};

/// Folders, links followed.
pub(super) struct Folders(Vec<PathBuf>);

impl Folders {
    pub(super) fn new(given: &[PathBuf]) -> Result<Self> {
        let real = |folder: &PathBuf| {
            let real = fs::canonicalize(folder)
                .with_context(|| format!("--folder {}", folder.display()))?;
            if !real.is_dir() {
                bail!("--folder {}: it is no folder", folder.display());
            }
            Ok(real)
        };
        given.iter().map(real).collect::<Result<_>>().map(Self)
    }

    fn has(&self, real: &Path) -> bool {
        self.0.iter().any(|folder| real.starts_with(folder))
    }

    /// A file that is there: its path, links followed. A path that is not absolute begins in one of the folders.
    pub(super) fn file(&self, path: &str) -> Result<PathBuf> {
        let places = self.0.iter().map(|folder| folder.join(path));
        let mut found = places.filter_map(|place| fs::canonicalize(place).ok());
        // Of what lies elsewhere not even that it is there is told.
        match found.find(|real| self.has(real) && real.is_file()) {
            Some(real) => Ok(real),
            None => bail!("{path}: no file of the folders that this server was given"),
        }
    }

    /// A folder to write to, which may not be there yet.
    pub(super) fn folder(&self, path: &str) -> Result<PathBuf> {
        let Some(first) = self.0.first() else {
            bail!(
                "{path}: this server was given no folder to write to; files go back as text where 'out' is left out"
            )
        };
        let place = first.join(path);
        let mut rest: Vec<OsString> = Vec::new();
        let mut there = place.as_path();
        loop {
            if let Ok(real) = fs::canonicalize(there) {
                if !self.has(&real) {
                    break;
                }
                return Ok(rest.iter().rev().fold(real, |folder, part| folder.join(part)));
            }
            let Some(Component::Normal(part)) = there.components().next_back() else { break };
            rest.push(part.to_owned());
            let Some(above) = there.parent() else { break };
            there = above;
        }
        bail!("{path}: not in the folders that this server was given")
    }
}
