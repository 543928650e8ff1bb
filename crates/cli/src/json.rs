//! Files that are there whole or not at all, and documents on standard output.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mmsmith_verify::WholeFile;
use serde::Serialize;

use crate::input;
use crate::processes;
use crate::terminal;

/// A file that cannot have so many bytes is refused before the work for it.
const ROOM: usize = 1 << 20;

/// A document that will be written at the end of some work, to a place found to be writable before it.
pub(crate) struct Output {
    place: Place,
    /// The file as the user called it, where users are to be told that it is written.
    told: Option<String>,
}

enum Place {
    /// A file that replaces what has its name, once it is complete.
    File { path: PathBuf, file: WholeFile },
    /// A device or a pipe, which cannot be replaced.
    Device(PathBuf),
    /// Standard output, kept for this document.
    Standard,
}

impl Output {
    /// Makes sure that `path` can be written and that there is some room for it, without touching what is there. `-` is
    /// standard output, where nothing else is said from now on.
    pub(crate) fn prepare(path: &Path) -> Result<Self> {
        let mut output = Self::open(path)?;
        if let Place::File { path, file } = &mut output.place {
            file.probe_room(ROOM).with_context(|| format!("no room for {}", path.display()))?;
        }
        Ok(output)
    }

    /// Writes `text` at once, which needs no more room than it has.
    pub(crate) fn write_at_once(path: &Path, text: &str) -> Result<()> {
        Self::open(path)?.write_text(text)
    }

    /// A place that can be written, without touching what is there.
    fn open(path: &Path) -> Result<Self> {
        if path == Path::new("-") {
            terminal::reserve()?;
            return Ok(Self::at(Place::Standard));
        }
        // A link stays a link; what it points to is replaced.
        let path = match input::kind_of(path)? {
            None => path.to_owned(),
            Some(kind) => {
                let shown = path.display();
                if kind.is_dir() {
                    bail!("cannot write {shown}: it is a folder");
                }
                let real =
                    fs::canonicalize(path).with_context(|| format!("cannot write {shown}"))?;
                if !kind.is_file() {
                    return Ok(Self::at(Place::Device(real)));
                }
                real
            }
        };
        let shown = path.display();
        WholeFile::sweep(&path);
        let file = WholeFile::create(&path).with_context(|| format!("cannot write {shown}"))?;
        Ok(Self::at(Place::File { path, file }))
    }

    /// [`Output::prepare`] where a file was asked for; once it is written, standard output says so. Of several processes the first
    /// one writes what all have done.
    pub(crate) fn prepare_if(path: Option<&PathBuf>) -> Result<Option<Self>> {
        let Some(path) = path.filter(|_| processes::is_first()) else { return Ok(None) };
        Ok(Some(Self { told: Some(path.display().to_string()), ..Self::prepare(path)? }))
    }

    fn at(place: Place) -> Self {
        Self { place, told: None }
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
        let (written, path) = match self.place {
            Place::Standard => return terminal::print(bytes),
            Place::Device(path) => (fs::write(&path, bytes), path),
            Place::File { path, mut file } => {
                (file.write_all(bytes).and_then(|()| file.finish()), path)
            }
        };
        written.with_context(|| format!("cannot write {}", path.display()))?;
        self.told.map_or(Ok(()), |file| terminal::say_written(&file))
    }
}

/// Makes the folder where there is none.
pub(crate) fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))
}

/// Makes the folder where there is none, and makes sure that files can be written to it and that there is some room.
pub(crate) fn prepare_folder(folder: &Path) -> Result<()> {
    make_folder(folder)?;
    // It goes as it came.
    Output::prepare(&folder.join(".probe")).map(drop)
}

/// `value` as indented JSON; numbers in shortest round-trip form, those that are not finite as null.
pub(crate) fn text(value: &impl Serialize) -> Result<String> {
    let mut text = serde_json::to_string_pretty(value).context("cannot form JSON")?;
    text.push('\n');
    Ok(text)
}
