//! Files that are there whole or not at all, and documents on standard output.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;

use crate::terminal;

/// A document that will be written at the end of some work, to a place found to be writable before it.
pub(crate) struct Output(Place);

enum Place {
    /// A file that replaces what has its name; until it is complete it has the temporary one.
    File { path: PathBuf, temporary: PathBuf },
    /// A device or a pipe, which cannot be replaced.
    Device(PathBuf),
    /// Standard output, kept for this document.
    Standard,
}

impl Output {
    /// Makes sure that `path` can be written, without touching what is there. `-` is standard output, where nothing else
    /// is said from now on.
    pub(crate) fn prepare(path: &Path) -> Result<Self> {
        if path == Path::new("-") {
            terminal::reserve()?;
            return Ok(Self(Place::Standard));
        }
        // A link stays a link; what it points to is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let shown = path.display();
        if path.is_dir() {
            bail!("cannot write {shown}: it is a folder");
        }
        if path.exists() && !path.is_file() {
            return Ok(Self(Place::Device(path)));
        }
        let Some(name) = path.file_name() else { bail!("cannot write {shown}: it names no file") };
        let name = format!(".{}.{}.tmp", name.to_string_lossy(), std::process::id());
        let temporary = path.with_file_name(name);
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)
            .with_context(|| format!("cannot write {shown}"))?;
        Ok(Self(Place::File { path, temporary }))
    }

    /// [`Output::prepare`] where a file was asked for.
    pub(crate) fn prepare_if(path: Option<&PathBuf>) -> Result<Option<Self>> {
        path.map(|path| Self::prepare(path)).transpose()
    }

    /// Writes `value` and gives the file its name.
    pub(crate) fn write(self, value: &impl Serialize) -> Result<()> {
        let text = text(value)?;
        self.write_text(&text)
    }

    /// Writes `text` and gives the file its name.
    pub(crate) fn write_text(self, text: &str) -> Result<()> {
        self.write_bytes(text.as_bytes())
    }

    /// Writes `bytes` and gives the file its name.
    pub(crate) fn write_bytes(self, bytes: &[u8]) -> Result<()> {
        let (written, path) = match &self.0 {
            Place::Standard => return terminal::print(bytes),
            Place::Device(path) => {
                (File::create(path).and_then(|mut file| file.write_all(bytes)), path)
            }
            Place::File { path, temporary } => {
                let write = || {
                    let mut file = File::create(temporary)?;
                    file.write_all(bytes)?;
                    file.sync_all()?;
                    fs::rename(temporary, path)
                };
                (write(), path)
            }
        };
        written.with_context(|| format!("cannot write {}", path.display()))
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // After a rename there is nothing left to remove.
        if let Place::File { temporary, .. } = &self.0 {
            let _ = fs::remove_file(temporary);
        }
    }
}

/// `value` as indented JSON; numbers in shortest round-trip form, those that are not finite as null.
pub(crate) fn text(value: &impl Serialize) -> Result<String> {
    let mut text = serde_json::to_string_pretty(value).context("cannot form JSON")?;
    text.push('\n');
    Ok(text)
}
