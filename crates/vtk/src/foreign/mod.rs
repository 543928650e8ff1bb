//! Particles and nodes as any program wrote them: `.vtu`, `.vtp`, legacy `.vtk`, CSV, and `.pvd` lists of such files.
//!
//! [`frames`] finds the frames of a recording, [`Snapshot::open`] opens one of them, and its arrays are decoded one by
//! one, by name. XML files may be in text, base64 or appended, raw or compressed with zlib, with headers of 32 or 64
//! bits, in either byte order, in several pieces; legacy files in text or binary, of versions 1 to 5.
//!
//! Nothing is allocated on the word of a file: sizes that a file declares are held against each other and against what
//! is there before the numbers are decoded. Files beyond [`LARGEST_FILE`] are refused unread.

mod cells;
mod contents;
mod legacy;
mod numbers;
mod table;
mod xml;

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

pub use cells::Cells;

use crate::Provenance;
use contents::{Contents, Entry};
use numbers::{Kind, Number};
use table::Table;

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
    /// The file is larger than what is read.
    #[error("{} has {bytes} bytes; files of at most {LARGEST_FILE} are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// The name ends with nothing that is known.
    #[error("{}: expected a .vtu, .vtp, .vtk, .csv or .pvd file, or a folder of them", path.display())]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },
    /// A folder, or a list, without frames.
    #[error("{} holds no frame: expected a .pvd file, or .vtu, .vtp, .vtk or .csv files", path.display())]
    NoFrames {
        /// The folder or the list.
        path: PathBuf,
    },
    /// A folder with more than one list of frames.
    #[error("{} holds {count} .pvd files; name one of them", path.display())]
    SeveralSeries {
        /// The folder.
        path: PathBuf,
        /// How many.
        count: usize,
    },
    /// A list that names two files for one time.
    #[error("{} lists several files at time {time:?}; frames in several files are not read", path.display())]
    SeveralParts {
        /// The list.
        path: PathBuf,
        /// The time.
        time: f64,
    },
    /// The file is damaged, or in a layout that is not read.
    #[error("{}: {cause}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        cause: String,
    },
    /// An array cannot be decoded.
    #[error("{}, array `{array}`: {cause}", path.display())]
    Array {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What is wrong.
        cause: String,
    },
}

/// What begins every file that is not CSV.
const XML_BEGINNINGS: [&[u8]; 2] = [b"<?xml", b"<VTKFile"];

/// Reads a file whose beginning promises what its name does.
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
        "vtu" | "vtp" | "pvd" if !XML_BEGINNINGS.iter().any(|begin| text.starts_with(begin)) => {
            return Err(malformed("it does not begin as XML does"));
        }
        "vtk" if !text.starts_with(b"# vtk") => {
            return Err(malformed("it does not begin with \"# vtk DataFile Version\""));
        }
        "csv" if text.contains(&0) => return Err(malformed("it holds bytes that are no text")),
        _ => (),
    }
    // Exactly as much as there is; growing step by step would take twice that.
    let rest = usize::try_from(bytes).unwrap_or(usize::MAX).saturating_sub(content.len());
    if content.try_reserve_exact(rest + 1).is_err() {
        return Err(malformed(&format!("there is no memory for its {bytes} bytes")));
    }
    // A file that grows while it is read, or a pipe, has no size to go by.
    file.take(LARGEST_FILE).read_to_end(&mut content).map_err(fail)?;
    if content.len() as u64 > LARGEST_FILE {
        return Err(ReadError::TooLarge { path: path.to_owned(), bytes: content.len() as u64 });
    }
    Ok(content)
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn is_frame(path: &Path) -> bool {
    ["vtu", "vtp", "vtk", "csv"].contains(&extension(path).as_str())
}

/// One frame of a recording, not yet opened.
#[derive(Clone, Debug)]
pub struct FrameFile {
    /// The file.
    pub path: PathBuf,
    /// The time that a `.pvd` list or a column of a CSV file gives it.
    pub time: Option<f64>,
    /// The table and the number of the frame in it, where it is one of several in a CSV file.
    table: Option<(Arc<Table>, usize)>,
}

/// The frames of a recording, in order: of a `.pvd` list; of a folder with one such list, or else with frame files,
/// which are taken in the order of their names, numbers in them by value; or of a single file.
///
/// # Errors
///
/// [`ReadError`] where there is no frame, or a list or a CSV file cannot be read. Other files are not opened.
pub fn frames(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let fail = |cause| ReadError::FileSystem { path: path.to_owned(), cause };
    let single = |path: PathBuf| FrameFile { path, time: None, table: None };
    if fs::metadata(path).map_err(fail)?.is_dir() {
        let mut files = vec![];
        for entry in fs::read_dir(path).map_err(fail)? {
            let file = entry.map_err(fail)?.path();
            if file.is_file() {
                files.push(file);
            }
        }
        files.sort_by_cached_key(|file| natural(&file.to_string_lossy()));
        let lists: Vec<_> = files.iter().filter(|file| extension(file) == "pvd").collect();
        match lists[..] {
            [list] => return frames(list),
            [] => (),
            _ => {
                let count = lists.len();
                return Err(ReadError::SeveralSeries { path: path.to_owned(), count });
            }
        }
        files.retain(|file| is_frame(file));
        if files.is_empty() {
            return Err(ReadError::NoFrames { path: path.to_owned() });
        }
        let mut found = vec![];
        for file in files {
            if table::is_csv(&file) {
                found.extend(rows(&file)?);
            } else {
                found.push(single(file));
            }
        }
        return Ok(found);
    }
    match extension(path).as_str() {
        "pvd" => listed(path),
        "csv" => rows(path),
        _ if is_frame(path) => Ok(vec![single(path.to_owned())]),
        _ => Err(ReadError::UnknownKind { path: path.to_owned() }),
    }
}

/// The frames of a list.
fn listed(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let malformed = |cause| ReadError::Malformed { path: path.to_owned(), cause };
    let listed = xml::collection(&read(path)?).map_err(malformed)?;
    if listed.is_empty() {
        return Err(ReadError::NoFrames { path: path.to_owned() });
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut frames: Vec<FrameFile> = vec![];
    for xml::Listed { time, file } in listed {
        let file = folder.join(file);
        if !is_frame(&file) || table::is_csv(&file) {
            return Err(malformed(format!(
                "it lists {}; expected .vtu, .vtp or .vtk files",
                file.display()
            )));
        }
        if let (Some(time), Some(FrameFile { time: Some(last), .. })) = (time, frames.last())
            && time.to_bits() == last.to_bits()
        {
            return Err(ReadError::SeveralParts { path: path.to_owned(), time });
        }
        frames.push(FrameFile { path: file, time, table: None });
    }
    Ok(frames)
}

/// The frames in a CSV file.
fn rows(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let malformed = |cause| ReadError::Malformed { path: path.to_owned(), cause };
    let table = Arc::new(Table::read(&read(path)?).map_err(malformed)?);
    let frame = |(index, rows): (usize, &table::Rows)| FrameFile {
        path: path.to_owned(),
        time: rows.time,
        table: Some((Arc::clone(&table), index)),
    };
    Ok(table.frames.iter().enumerate().map(frame).collect())
}

/// A key by which `frame-2` comes before `frame-10`.
fn natural(name: &str) -> Vec<(u64, String)> {
    let mut parts = vec![];
    let mut rest = name;
    while !rest.is_empty() {
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        let words = rest[digits..].bytes().take_while(|byte| !byte.is_ascii_digit()).count();
        parts.push((rest[..digits].parse().unwrap_or(0), rest[digits..digits + words].to_owned()));
        rest = &rest[digits + words..];
    }
    parts
}

/// What is known of an array before it is decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArrayHead {
    /// Its name in the file.
    pub name: String,
    /// Numbers for each particle.
    pub components: usize,
    /// Whether the file holds them as 32-bit floats.
    pub is_single: bool,
    /// The significant digits of its longest number, where it is text of a table and has enough numbers to tell.
    pub digits: Option<usize>,
}

/// One instant as some program wrote it.
#[derive(Debug)]
pub struct Snapshot {
    path: PathBuf,
    particles: usize,
    arrays: Vec<ArrayHead>,
    data: Data,
}

#[derive(Debug)]
enum Data {
    File { bytes: Vec<u8>, contents: Contents },
    Table { table: Arc<Table>, frame: usize },
}

impl Snapshot {
    /// Opens a frame: finds its arrays, decodes none.
    ///
    /// # Errors
    ///
    /// [`ReadError`] for a file that is too large, cut off, damaged or in a layout that is not read.
    pub fn open(frame: &FrameFile) -> Result<Self, ReadError> {
        let path = frame.path.clone();
        if let Some((table, index)) = &frame.table {
            let arrays = table.arrays.iter().map(|columns| ArrayHead {
                name: columns.name.clone(),
                components: columns.components(),
                is_single: false,
                digits: columns.digits(table),
            });
            let (arrays, particles) = (arrays.collect(), table.frames[*index].range.len());
            let data = Data::Table { table: Arc::clone(table), frame: *index };
            return Ok(Self { path, particles, arrays, data });
        }
        let bytes = read(&path)?;
        let contents = match extension(&path).as_str() {
            "vtk" => legacy::contents(&bytes),
            _ => xml::contents(&bytes),
        };
        let contents =
            contents.map_err(|cause| ReadError::Malformed { path: path.clone(), cause })?;
        let too_many = || ReadError::Malformed {
            path: path.clone(),
            cause: "it declares more points than can be counted".into(),
        };
        let mut particles = 0_usize;
        for piece in &contents.pieces {
            particles = particles.checked_add(piece.particles).ok_or_else(too_many)?;
        }
        let mut arrays: Vec<ArrayHead> = vec![];
        if let Some((first, others)) = contents.pieces.split_first() {
            if others.iter().any(|piece| piece.points.components != first.points.components) {
                let cause = "its pieces have points of different dimension".into();
                return Err(ReadError::Malformed { path, cause });
            }
            for entry in &first.arrays {
                // What only some pieces have, or in different shape, is no array over all particles.
                let is_same = |other: &Entry| {
                    other.name == entry.name && other.components == entry.components
                };
                if others.iter().all(|piece| piece.arrays.iter().any(is_same)) {
                    arrays.push(ArrayHead {
                        name: entry.name.clone(),
                        components: entry.components,
                        is_single: entry.kind == Kind::F32,
                        digits: None,
                    });
                }
            }
        }
        Ok(Self { path, particles, arrays, data: Data::File { bytes, contents } })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The number of particles or nodes.
    #[must_use]
    pub fn particles(&self) -> usize {
        self.particles
    }

    /// The arrays over the particles.
    #[must_use]
    pub fn arrays(&self) -> &[ArrayHead] {
        &self.arrays
    }

    /// The array called `name`.
    #[must_use]
    pub fn array(&self, name: &str) -> Option<&ArrayHead> {
        self.arrays.iter().find(|array| array.name == name)
    }

    /// The points of the grid, whatever they mean: components and whether they are single precision. A CSV file need
    /// not have any.
    #[must_use]
    pub fn points(&self) -> Option<ArrayHead> {
        match &self.data {
            Data::File { contents, .. } => contents.pieces.first().map(|piece| ArrayHead {
                name: table::POINTS.into(),
                components: piece.points.components,
                is_single: piece.points.kind == Kind::F32,
                digits: None,
            }),
            Data::Table { .. } => self.array(table::POINTS).cloned(),
        }
    }

    /// The coordinates of the points, one point after the other; nothing where there are none.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded.
    pub fn positions(&self) -> Result<Vec<f64>, ReadError> {
        match &self.data {
            Data::File { bytes, contents } => {
                let mut all = vec![];
                for piece in &contents.pieces {
                    let part = contents.numbers::<f64>(bytes, &piece.points);
                    all.extend(part.map_err(|cause| self.bad(table::POINTS, cause))?);
                }
                Ok(all)
            }
            Data::Table { .. } => Ok(self.floats(table::POINTS)?.unwrap_or_default()),
        }
    }

    /// The cells of a mesh; `None` where the file has none, or damaged ones.
    #[must_use]
    pub fn cells(&self) -> Option<Cells> {
        let Data::File { bytes, contents } = &self.data else { return None };
        let (mut cells, mut first) = (Cells::default(), 0);
        for piece in &contents.pieces {
            cells.extend(contents, bytes, &piece.cells, first)?;
            first += piece.particles;
        }
        Some(cells)
    }

    /// The numbers of an array, one particle after the other; `None` where there is no such array.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded, or are not as many as there should be.
    pub fn floats(&self, name: &str) -> Result<Option<Vec<f64>>, ReadError> {
        match &self.data {
            Data::File { .. } => self.numbers(name),
            Data::Table { table, frame } => {
                Ok(table.floats(name, table.frames[*frame].range.clone()))
            }
        }
    }

    /// The whole numbers of an array, such as identities.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded, or are no whole numbers.
    pub fn integers(&self, name: &str) -> Result<Option<Vec<i64>>, ReadError> {
        match &self.data {
            Data::File { .. } => self.numbers(name),
            Data::Table { table, frame } => table
                .integers(name, table.frames[*frame].range.clone())
                .transpose()
                .map_err(|cause| self.bad(name, cause)),
        }
    }

    /// The first number of a field of the whole file, such as `TimeValue`; `None` where there is none that can be read.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<f64> {
        let Data::File { bytes, contents } = &self.data else { return None };
        let entry = contents.fields.iter().find(|entry| entry.name == name)?;
        contents.numbers::<f64>(bytes, entry).ok()?.first().copied()
    }

    /// The solution and the parameters that the file tells: its field `solution`, and those whose names begin with `parameter_`.
    /// `None` where it tells no solution; a parameter without a number is left out.
    #[must_use]
    pub fn provenance(&self) -> Option<Provenance> {
        let Data::File { bytes, contents } = &self.data else { return None };
        let of = |name: &str| contents.fields.iter().find(|entry| entry.name == name);
        let letters = contents.numbers::<i64>(bytes, of("solution")?).ok()?;
        let letters: Option<Vec<u8>> =
            letters.into_iter().map(|letter| letter.try_into().ok()).collect();
        let parameters = contents.fields.iter().filter_map(|entry| {
            let name = entry.name.strip_prefix("parameter_")?;
            Some((name.to_owned(), self.field(&entry.name)?))
        });
        let solution = String::from_utf8(letters?).ok()?;
        Some(Provenance { solution, parameters: parameters.collect() })
    }

    fn numbers<N: Number>(&self, name: &str) -> Result<Option<Vec<N>>, ReadError> {
        let Data::File { bytes, contents } = &self.data else { return Ok(None) };
        if self.array(name).is_none() {
            return Ok(None);
        }
        let mut all = vec![];
        for piece in &contents.pieces {
            if let Some(entry) = piece.arrays.iter().find(|entry| entry.name == name) {
                let part = contents.numbers::<N>(bytes, entry);
                all.extend(part.map_err(|cause| self.bad(name, cause))?);
            }
        }
        Ok(Some(all))
    }

    fn bad(&self, array: &str, cause: String) -> ReadError {
        ReadError::Array { path: self.path.clone(), array: array.into(), cause }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_ordered_by_value() {
        let mut names = ["f-10.vtu", "f-9.vtu", "f-1.vtu", "e-11.vtu", "f.vtu"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["e-11.vtu", "f-1.vtu", "f-9.vtu", "f-10.vtu", "f.vtu"]);
    }
}
