//! Particles and nodes as any program wrote them: `.vtu`, `.vtp`, legacy `.vtk`, CSV, text dumps, and the lists of such files that `.pvd`,
//! `.pvtu`, `.pvtp`, `.vtm` and `.vtmb` files hold.
//!
//! [`recording`] finds the frames of a recording, [`Snapshot::open`] opens one of them, and its arrays are decoded one by
//! one, by name. XML files may be in text, base64 or appended, raw or compressed with zlib, with headers of 32 or 64
//! bits, in either byte order, in several pieces; legacy files in text or binary, of versions 1 to 5.
//!
//! Sizes that a file declares are compared with each other and with the bytes that are there before memory is allocated and numbers are
//! decoded. Files beyond [`LARGEST_FILE`] are refused unread.

mod components;
mod contents;
mod dump;
mod frames;
mod legacy;
mod mesh;
mod numbers;
mod snapshot;
mod table;
mod xml;

pub use frames::{FrameFile, column, frames, recording};
pub use mesh::{Cell, Mesh};
pub use snapshot::{ArrayHead, Snapshot};

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// The most bytes that a file may have. It is held in memory while it is read.
pub const LARGEST_FILE: u64 = 1 << 30;

/// Files that cannot be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The file system refused.
    #[error("cannot read {}: {cause}", path.display())]
    FileSystem {
        /// The file or folder.
        path: PathBuf,
        /// The answer of the file system.
        cause: io::Error,
    },
    /// The file is larger than [`LARGEST_FILE`].
    #[error("{} has {bytes} bytes; files of at most {LARGEST_FILE} are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// The ending of the name is not known.
    #[error(
        "{}: expected a .vtu, .vtp, .vtk, .csv, .pvd, .pvtu, .pvtp, .vtm or LAMMPS dump file, or a folder of them{}",
        path.display(),
        converted(path)
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// A folder or a list without frames.
    #[error(
        "{} holds no frame: expected a .pvd file, or .vtu, .vtp, .vtk, .csv, .pvtu, .pvtp, .vtm or LAMMPS dump files{}",
        path.display(),
        foreign.as_deref().map_or(String::new(), converted)
    )]
    NoFrames {
        /// The folder or the list.
        path: PathBuf,
        /// A file in it that another program can convert.
        foreign: Option<PathBuf>,
    },
    /// A folder with more than one list of frames.
    #[error("{} holds {count} .pvd files; name one of them", path.display())]
    SeveralSeries {
        /// The folder.
        path: PathBuf,
        /// How many.
        count: usize,
    },
    /// A list that names several tables for one time.
    #[error("{} lists several .csv files at time {time:?}: write the rows of one time into one file", path.display())]
    SeveralParts {
        /// The list.
        path: PathBuf,
        /// The time.
        time: f64,
    },
    /// Files with the same number that hold different points.
    #[error(
        "{} and {} seem to be attributes of one frame, by their names, but have other points: name the files of one recording alone",
        path.display(),
        other.display()
    )]
    OtherPoints {
        /// The first file.
        path: PathBuf,
        /// The other file.
        other: PathBuf,
    },
    /// The file is damaged, or in a layout that is not read.
    #[error("{}: {cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The fault.
        cause: String,
    },
    /// An array cannot be decoded.
    #[error("{}, array `{array}`: {cause}", path.display())]
    Array {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// The fault.
        cause: String,
    },
}

/// A hint for a message: how a file of an unknown kind is converted to a known kind.
fn converted(path: &Path) -> String {
    let name = path.display();
    match extension(path).as_str() {
        "e" | "ex2" | "exo" | "exodus" | "xdmf" | "xmf" | "med" | "msh" | "inp" | "unv" | "h5" => {
            format!(
                "; pip install 'meshio[all]' && meshio convert {name} {} makes one",
                path.with_extension("vtu").display()
            )
        }
        _ => String::new(),
    }
}

/// Beginnings of XML files.
const XML_BEGINNINGS: [&[u8]; 2] = [b"<?xml", b"<VTKFile"];

/// Reads a file whose beginning agrees with the ending of its name.
fn read(path: &Path) -> Result<Vec<u8>, ReadError> {
    let fail = |cause| ReadError::FileSystem { path: path.to_owned(), cause };
    let mut file = File::open(path).map_err(fail)?;
    let bytes = file.metadata().map_err(fail)?.len();
    if bytes > LARGEST_FILE {
        return Err(ReadError::TooLarge { path: path.to_owned(), bytes });
    }
    let mut content = vec![];
    file.by_ref().take(4096).read_to_end(&mut content).map_err(fail)?;
    let malformed =
        |cause: &str| ReadError::Malformed { path: path.to_owned(), cause: cause.into() };
    if content.is_empty() {
        return Err(malformed("the file is empty"));
    }
    let text = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&content).trim_ascii_start();
    match extension(path).as_str() {
        "vtu" | "vtp" | "pvd" | "pvtu" | "pvtp" | "vtm" | "vtmb"
            if !XML_BEGINNINGS.iter().any(|begin| text.starts_with(begin)) =>
        {
            return Err(malformed("it does not begin as XML does"));
        }
        "vtk" if !text.starts_with(b"# vtk") => {
            return Err(malformed("it does not begin with \"# vtk DataFile Version\""));
        }
        "csv" if text.contains(&0) => return Err(malformed("it holds bytes that are no text")),
        _ => (),
    }
    // Exactly as much as there is: growing step by step would take twice the memory.
    let rest = usize::try_from(bytes).unwrap_or(usize::MAX).saturating_sub(content.len());
    if content.try_reserve_exact(rest + 1).is_err() {
        return Err(malformed(&format!("there is no memory for its {bytes} bytes")));
    }
    // A file that grows while it is read, or a pipe, has no known size.
    file.take(LARGEST_FILE).read_to_end(&mut content).map_err(fail)?;
    if content.len() as u64 > LARGEST_FILE {
        return Err(ReadError::TooLarge { path: path.to_owned(), bytes: content.len() as u64 });
    }
    Ok(content)
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}
