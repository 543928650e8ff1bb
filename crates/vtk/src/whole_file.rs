//! Files that are there whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::Error;

/// Writes `bytes` to `path`. Where a write fails, an earlier file stays as it was.
///
/// The bytes go to a temporary file in the same folder, reach the disk, and only then take the name `path`.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let temporary = temporary(path);
    write_to_disk(&temporary, bytes).and_then(|()| fs::rename(&temporary, path)).map_err(|cause| {
        // The first error is the one to report; a temporary that stays is replaced by the next attempt.
        let _ = fs::remove_file(&temporary);
        Error::FileSystem { action: "write", path: path.to_owned(), cause }
    })
}

/// Tests that [`replace`] can write `path`, without touching an earlier file.
pub(crate) fn probe(path: &Path) -> Result<(), Error> {
    let temporary = temporary(path);
    write_to_disk(&temporary, b"probe").and_then(|()| fs::remove_file(&temporary)).map_err(
        |cause| {
            let _ = fs::remove_file(&temporary);
            Error::FileSystem { action: "write", path: path.to_owned(), cause }
        },
    )
}

fn temporary(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".tmp");
    PathBuf::from(name)
}

fn write_to_disk(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // A killed run may have left this file behind. Creating it anew, instead of opening it, follows no link.
    match fs::remove_file(path) {
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => return Err(cause),
        _ => {}
    }
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    // Some file systems report a full disk only here.
    file.sync_all()
}
