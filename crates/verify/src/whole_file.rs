//! Files that are there whole or not at all.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// Parts of a temporary file's name: between the name of the file and the random characters, and after these.
const MARK: &str = ".mms-";
const END: &str = ".tmp";
/// Random characters in the name of a temporary file.
const RANDOM: usize = 10;

/// A file under way: its content goes to a temporary file in the same folder, which takes the file's name once it is on
/// the disk. Dropped before that, it leaves nothing behind, and what had the name before remains as it was.
///
/// The temporary file is made anew, under a random name, so that no link is followed. It is locked for as long as its
/// writer lives: [`WholeFile::sweep`] removes those whose writer was killed.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    temporary: NamedTempFile,
}

impl WholeFile {
    /// Begins the file `path`, whose folder must exist.
    ///
    /// # Errors
    ///
    /// Where its folder cannot be written to, and where `path` names no file.
    pub fn create(path: &Path) -> io::Result<Self> {
        let prefix = prefix(path)?;
        let mut builder = Builder::new();
        builder.prefix(&prefix).suffix(END).rand_bytes(RANDOM);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: what the user's mask leaves of it.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        loop {
            let temporary = builder.tempfile_in(folder(path))?;
            // Where a file system has no locks, nobody sweeps either.
            let _ = temporary.as_file().lock();
            // A sweep may have met it before it was locked.
            match fs::symlink_metadata(temporary.path()) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                _ => return Ok(Self { path: path.to_owned(), temporary }),
            }
        }
    }

    /// Makes sure that there is room for so many bytes, by writing them and taking them back; to be called before anything
    /// is written.
    ///
    /// # Errors
    ///
    /// Where the disk is full.
    pub fn probe_room(&mut self, bytes: usize) -> io::Result<()> {
        use std::io::Seek;
        let file = self.temporary.as_file_mut();
        let probed = file.write_all(&vec![b' '; bytes]).and_then(|()| file.flush());
        file.set_len(0)?;
        file.rewind()?;
        probed
    }

    /// Gives the content its name, once it is on the disk.
    ///
    /// # Errors
    ///
    /// Where it cannot be written or named; what had the name before is untouched then.
    pub fn finish(self) -> io::Result<()> {
        // Some file systems report a full disk only here.
        self.temporary.as_file().sync_all()?;
        // The file is locked until it has its name.
        let (_locked, temporary) = self.temporary.into_parts();
        fs::rename(&temporary, &self.path)?;
        // It is a temporary one no longer, which no file system can refuse.
        temporary.keep().map(drop).map_err(|failed| failed.error)
    }

    /// Removes what killed writers of the file `path` have left beside it. What cannot be looked at or removed stays.
    pub fn sweep(path: &Path) {
        let Some(name) = path.file_name().map(OsStr::as_encoded_bytes) else { return };
        Self::sweep_where(folder(path), &|written| written == name);
    }

    /// Removes what killed writers have left in a folder of files with these names, given as bytes.
    pub(crate) fn sweep_where(folder: &Path, is_meant: &dyn Fn(&[u8]) -> bool) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if !is_file || !name_of_written(&entry.file_name()).is_some_and(is_meant) {
                continue;
            }
            let Ok(file) = File::open(entry.path()) else { continue };
            // Its lock is free only where its writer is gone, and is held here until the file is removed.
            if file.try_lock().is_ok() {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.temporary.as_file_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.temporary.as_file_mut().flush()
    }
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn prefix(path: &Path) -> io::Result<OsString> {
    let Some(name) = path.file_name() else {
        return Err(io::Error::new(io::ErrorKind::InvalidFilename, "it names no file"));
    };
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(MARK);
    Ok(prefix)
}

/// The name of the file that a temporary one is written for, if [`WholeFile::create`] has made it.
fn name_of_written(temporary: &OsStr) -> Option<&[u8]> {
    let name = temporary.as_encoded_bytes().strip_prefix(b".")?.strip_suffix(END.as_bytes())?;
    let (name, random) = name.split_at_checked(name.len().checked_sub(RANDOM)?)?;
    let is_random = random.iter().all(u8::is_ascii_alphanumeric);
    name.strip_suffix(MARK.as_bytes()).filter(|name| is_random && !name.is_empty())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The names of what is in a folder.
    pub(crate) fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_there_whole_or_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "before").unwrap();
        let mut file = WholeFile::create(&path).unwrap();
        file.probe_room(1000).unwrap();
        file.write_all(b"after").unwrap();
        drop(file);
        assert_eq!(
            (names(folder.path()).len(), fs::read(&path).unwrap().as_slice()),
            (1, &b"before"[..])
        );
        let mut file = WholeFile::create(&path).unwrap();
        file.probe_room(1000).unwrap();
        file.write_all(b"after").unwrap();
        file.finish().unwrap();
        assert_eq!(
            (names(folder.path()).len(), fs::read(&path).unwrap().as_slice()),
            (1, &b"after"[..])
        );
        assert!(WholeFile::create(&folder.path().join("none/a.json")).is_err());
    }

    #[test]
    fn what_a_killed_writer_left_is_swept_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let left = folder.path().join(".a.json.mms-0123456789.tmp");
        fs::write(&left, "part").unwrap();
        let others = [".a.json.123.tmp", ".a.json.mms-012345678.tmp", ".b.json.mms-0123456789.tmp"];
        for other in others {
            fs::write(folder.path().join(other), "mine").unwrap();
        }
        let living = WholeFile::create(&path).unwrap();
        WholeFile::sweep(&path);
        assert!(!left.exists());
        assert!(others.iter().all(|other| folder.path().join(other).exists()));
        living.finish().unwrap();
        assert!(path.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_at_names_of_temporaries_are_not_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("target");
        fs::write(&target, "mine").unwrap();
        let path = folder.path().join("checkpoint");
        symlink(&target, folder.path().join("checkpoint.tmp")).unwrap();
        symlink(&target, folder.path().join(".checkpoint.mms-0123456789.tmp")).unwrap();
        WholeFile::sweep(&path);
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"state").unwrap();
        file.finish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"mine");
    }
}
