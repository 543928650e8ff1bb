//! JSON files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;

/// A file that will be written at the end of some work, found to be writable before it.
pub(crate) struct Output {
    path: PathBuf,
    /// Holds the place until the content is complete; none for devices and pipes, which cannot be replaced.
    temporary: Option<PathBuf>,
}

impl Output {
    /// Makes sure that `path` can be written, without touching what is there.
    pub(crate) fn prepare(path: &Path) -> Result<Self> {
        // A link stays a link; what it points to is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let shown = path.display();
        if path.is_dir() {
            bail!("cannot write {shown}: it is a folder");
        }
        if path.exists() && !path.is_file() {
            return Ok(Self { path, temporary: None });
        }
        let Some(name) = path.file_name() else { bail!("cannot write {shown}: it names no file") };
        let name = format!(".{}.{}.tmp", name.to_string_lossy(), std::process::id());
        let temporary = path.with_file_name(name);
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)
            .with_context(|| format!("cannot write {shown}"))?;
        Ok(Self { path, temporary: Some(temporary) })
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
        let write = |path: &Path| -> std::io::Result<()> {
            let mut file = File::create(path)?;
            file.write_all(text.as_bytes())?;
            if self.temporary.is_some() { file.sync_all() } else { Ok(()) }
        };
        let shown = self.path.display();
        match &self.temporary {
            None => write(&self.path),
            Some(temporary) => write(temporary).and_then(|()| fs::rename(temporary, &self.path)),
        }
        .with_context(|| format!("cannot write {shown}"))
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // After a rename there is nothing left to remove.
        if let Some(temporary) = &self.temporary {
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
