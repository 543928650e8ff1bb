//! Text that users hand in: from a file, or from standard input where they say `-`.

use std::fmt;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use anyhow::{Context, Result, bail};

/// Where text comes from; shown as messages call it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source<'a> {
    /// A file, or whatever else has a path.
    File(&'a Path),
    /// Standard input.
    Standard,
}

impl<'a> Source<'a> {
    /// Standard input for `-`, else the file of that name; a file called `-` is `./-`.
    pub(crate) fn of(path: &'a Path) -> Self {
        if path == Path::new("-") { Self::Standard } else { Self::File(path) }
    }

    /// All of it as text, and a refusal where it is longer than `most` bytes; not more than those are read.
    pub(crate) fn short_text(self, most: u64) -> Result<String> {
        self.as_text(self.at_most(most)?)
    }

    fn as_text(self, bytes: Vec<u8>) -> Result<String> {
        String::from_utf8(bytes)
            .ok()
            .with_context(|| format!("cannot read {self}: it is no text in UTF-8"))
    }

    fn at_most(self, most: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let limit = most.saturating_add(1);
        match self {
            Self::File(path) => {
                File::open(path).and_then(|file| file.take(limit).read_to_end(&mut bytes))
            }
            Self::Standard => io::stdin().lock().take(limit).read_to_end(&mut bytes),
        }
        .with_context(|| format!("cannot read {self}"))?;
        if bytes.len() as u64 > most {
            bail!("cannot read {self}: it is longer than {most} bytes");
        }
        Ok(bytes)
    }
}

/// The kind of what has a path; none where nothing has. Where the system cannot tell, nothing is taken for granted: another file of the
/// name would be taken, or a file be replaced.
pub(crate) fn kind_of(path: &Path) -> Result<Option<Metadata>> {
    match fs::metadata(path) {
        Ok(found) => Ok(Some(found)),
        Err(error) => match error.kind() {
            ErrorKind::NotFound
            | ErrorKind::NotADirectory
            | ErrorKind::PermissionDenied
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename => Ok(None),
            _ => Err(error).with_context(|| format!("cannot look at {}", path.display())),
        },
    }
}

impl fmt::Display for Source<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Standard => f.write_str("standard input"),
        }
    }
}
