//! The frames of a recording: which files, or which rows of a table, belong to one time.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::table::{self, Rows, Table};
use super::{ReadError, dump, extension, read, xml};

/// Endings of text dumps of LAMMPS and Karamelo.
const DUMPS: [&str; 4] = ["lammps", "lammpstrj", "lammpsdump", "dump"];
/// Endings of files that list other files of the same time.
pub(super) const PARTED: [&str; 4] = ["pvtu", "pvtp", "vtm", "vtmb"];
/// Endings of VTK files with points.
const POINTED: [&str; 3] = ["vtu", "vtp", "vtk"];

/// One frame of a recording, not yet opened.
#[derive(Clone, Debug)]
pub struct FrameFile {
    /// The file, or the first of several.
    pub path: PathBuf,
    /// The time that a `.pvd` list, a column of a CSV file or a dump gives it.
    pub time: Option<f64>,
    pub(super) source: Source,
    pub(super) location: Location,
}

/// The items, points or cells, whose arrays are offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Location {
    Points,
    CellCentres,
}

/// Where a frame is read from.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// A file.
    File,
    /// Files with parts of the points, or with further arrays over the same points.
    Parts(Vec<PathBuf>),
    /// Files with an array each, over the same points.
    Attributes(Vec<PathBuf>),
    /// Rows of a table, by the number of the frame.
    Rows(Arc<Table>, usize),
}

impl FrameFile {
    fn single(path: PathBuf) -> Self {
        Self { path, time: None, source: Source::File, location: Location::Points }
    }

    /// The frame with its cells in place of particles: at their centres, with the arrays over cells. A table has no cells and stays
    /// unchanged.
    #[must_use]
    pub fn at_cell_centres(self) -> Self {
        Self { location: Location::CellCentres, ..self }
    }
}

fn is_dump(path: &Path) -> bool {
    DUMPS.contains(&extension(path).as_str())
}

fn is_vtk(path: &Path) -> bool {
    let extension = extension(path);
    POINTED.contains(&extension.as_str()) || PARTED.contains(&extension.as_str())
}

fn is_frame(path: &Path) -> bool {
    is_vtk(path) || table::is_csv(path) || is_dump(path)
}

/// The frames of the files, lists and folders of a recording, in order. Files with the same number, whose names differ in words only,
/// are the arrays of one frame.
///
/// # Errors
///
/// [`ReadError`] where there is no frame, or a list or a table cannot be read. Other files are not opened.
pub fn recording(paths: &[PathBuf]) -> Result<Vec<FrameFile>, ReadError> {
    let mut found = vec![];
    for path in paths {
        found.extend(frames(path)?);
    }
    Ok(by_number(found))
}

/// The frames of a recording, in order: of a `.pvd` list; of a folder with one such list, or else with frame files,
/// which are taken in the order of their names, numbers in them by value; or of a single file.
///
/// # Errors
///
/// [`ReadError`] where there is no frame, or a list or a table cannot be read. Other files are not opened.
pub fn frames(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let fail = |cause| ReadError::FileSystem { path: path.to_owned(), cause };
    if fs::metadata(path).map_err(fail)?.is_dir() {
        return folder(path);
    }
    match extension(path).as_str() {
        "pvd" => listed(path),
        _ if table::is_csv(path) || is_dump(path) => Ok(rows(path)?.1),
        _ if is_frame(path) => Ok(vec![FrameFile::single(path.to_owned())]),
        _ => Err(ReadError::UnknownKind { path: path.to_owned() }),
    }
}

fn folder(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let fail = |cause| ReadError::FileSystem { path: path.to_owned(), cause };
    let mut files = vec![];
    for entry in fs::read_dir(path).map_err(fail)? {
        let file = entry.map_err(fail)?.path();
        match fs::metadata(&file) {
            Ok(kind) if kind.is_file() => files.push(file),
            Ok(_) => {}
            // A link that leads nowhere, or a file that has gone since.
            Err(cause) if cause.kind() == ErrorKind::NotFound => {}
            // Without it the recording would be another one.
            Err(cause) => return Err(ReadError::FileSystem { path: file, cause }),
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
    let frames: Vec<_> = files.iter().filter(|file| is_frame(file)).collect();
    if frames.is_empty() {
        // XDMF keeps its numbers in an HDF5 file beside it.
        let is_convertible = |file: &PathBuf| !super::converted(file).is_empty();
        let foreign =
            files.into_iter().filter(is_convertible).min_by_key(|file| extension(file) == "h5");
        return Err(ReadError::NoFrames { path: path.to_owned(), foreign });
    }
    // Pieces stand beside the file that lists them.
    let whole: Vec<_> =
        frames.iter().filter(|file| PARTED.contains(&extension(file).as_str())).collect();
    if !whole.is_empty() {
        return Ok(whole.into_iter().map(|file| FrameFile::single((*file).clone())).collect());
    }
    let (mut found, mut clock) = (vec![], None);
    for file in frames {
        if is_vtk(file) {
            found.push(FrameFile::single(file.clone()));
            continue;
        }
        let (table, frames) = rows(file)?;
        match times(&table) {
            Some(times) => clock = Some(times),
            None => found.extend(frames),
        }
    }
    let found = by_number(found);
    Ok(clock.map_or_else(|| found.clone(), |clock| timed(found.clone(), &clock)))
}

/// The times of a table that holds nothing but times and numbers of steps, as MOOSE writes beside its tables.
fn times(table: &Table) -> Option<Vec<f64>> {
    let is_clock = |name: &String| {
        ["time", "timestep", "t", "step"].contains(&name.to_ascii_lowercase().as_str())
    };
    let times = table.column("time").or_else(|| table.column("t"))?;
    (table.names().len() > 1 && table.names().iter().all(is_clock)).then(|| times.to_vec())
}

/// The frames with the times of a file beside them, if there are as many times as frames.
fn timed(mut frames: Vec<FrameFile>, times: &[f64]) -> Vec<FrameFile> {
    if frames.len() == times.len() && frames.iter().all(|frame| frame.time.is_none()) {
        for (frame, time) in frames.iter_mut().zip(times) {
            frame.time = Some(*time);
        }
    }
    frames
}

/// The numbers of a column of a table: the column called `time` or `t`, or the only column.
///
/// # Errors
///
/// [`ReadError`] where the file cannot be read, or has no such column.
pub fn column(path: &Path) -> Result<Vec<f64>, ReadError> {
    let malformed = |cause: String| ReadError::Malformed { path: path.to_owned(), cause };
    let bytes = read(path)?;
    let words = || {
        bytes
            .split(|byte| byte.is_ascii_whitespace() || *byte == b',')
            .filter(|word| !word.is_empty())
    };
    let plain = |word| std::str::from_utf8(word).ok()?.parse::<f64>().ok();
    if let Some(numbers) = words().map(plain).collect::<Option<Vec<_>>>() {
        return Ok(numbers);
    }
    let table = Table::read(&bytes).map_err(malformed)?;
    let named = ["time", "t", "Time", "TIME"].iter().find_map(|name| table.column(name));
    let only = || {
        table
            .names()
            .first()
            .filter(|_| table.names().len() == 1)
            .and_then(|name| table.column(name))
    };
    named.or_else(only).map(<[f64]>::to_vec).ok_or_else(|| {
        malformed(format!(
            "it has no column time or t; its columns are {}",
            table.names().join(", ")
        ))
    })
}

/// The frames of a list.
fn listed(path: &Path) -> Result<Vec<FrameFile>, ReadError> {
    let malformed = |cause| ReadError::Malformed { path: path.to_owned(), cause };
    let listed = xml::collection(&read(path)?).map_err(malformed)?;
    if listed.is_empty() {
        return Err(ReadError::NoFrames { path: path.to_owned(), foreign: None });
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut frames: Vec<FrameFile> = vec![];
    for xml::Listed { time, file } in listed {
        let file = folder.join(file);
        if !is_frame(&file) {
            return Err(malformed(format!(
                "it lists {}; expected .vtu, .vtp, .vtk, .pvtu, .pvtp, .vtm or .csv files",
                file.display()
            )));
        }
        let is_same = |last: &&mut FrameFile| match (time, last.time) {
            (Some(time), Some(last)) => time.to_bits() == last.to_bits(),
            _ => false,
        };
        match frames.last_mut().filter(is_same) {
            Some(last) if is_vtk(&file) && is_vtk(&last.path) => match &mut last.source {
                Source::Parts(parts) => parts.push(file),
                source => *source = Source::Parts(vec![last.path.clone(), file]),
            },
            Some(_) => {
                return Err(ReadError::SeveralParts {
                    path: path.to_owned(),
                    time: time.unwrap_or(f64::NAN),
                });
            }
            None if is_vtk(&file) => frames.push(FrameFile { time, ..FrameFile::single(file) }),
            None => {
                let (_, mut rows) = rows(&file)?;
                if let [frame] = &mut rows[..] {
                    frame.time = time.or(frame.time);
                }
                frames.extend(rows);
            }
        }
    }
    Ok(frames)
}

/// The table in a CSV file or a dump, and its frames.
fn rows(path: &Path) -> Result<(Arc<Table>, Vec<FrameFile>), ReadError> {
    let malformed = |cause| ReadError::Malformed { path: path.to_owned(), cause };
    let bytes = read(path)?;
    let is_dump = bytes.trim_ascii_start().starts_with(dump::BEGINNING);
    let table = if is_dump { dump::read(&bytes) } else { Table::read(&bytes) };
    let table = Arc::new(table.map_err(malformed)?);
    let frame = |(index, rows): (usize, &Rows)| FrameFile {
        path: path.to_owned(),
        time: rows.time,
        source: Source::Rows(Arc::clone(&table), index),
        location: Location::Points,
    };
    let frames = table.frames.iter().enumerate().map(frame).collect();
    Ok((table, frames))
}

/// The words and the number of a file's name.
fn numbered(path: &Path) -> Option<(String, String)> {
    let stem = path.file_stem()?.to_str()?;
    let words = stem.trim_end_matches(|letter: char| letter.is_ascii_digit());
    (words.len() < stem.len()).then(|| (words.to_owned(), stem[words.len()..].to_owned()))
}

/// Files of one folder with the same number and different words, `displacements03.vtp` and `stresses03.vtp`, are one frame. Nothing is
/// joined unless every number has files with the same words.
fn by_number(frames: Vec<FrameFile>) -> Vec<FrameFile> {
    let mut groups: BTreeMap<String, Vec<&FrameFile>> = BTreeMap::new();
    let mut words: BTreeSet<String> = BTreeSet::new();
    for frame in &frames {
        let is_plain =
            matches!(frame.source, Source::File) && frame.path.parent() == frames[0].path.parent();
        let Some((word, number)) = numbered(&frame.path).filter(|_| is_plain) else {
            return frames;
        };
        words.insert(word);
        groups.entry(number).or_default().push(frame);
    }
    if words.len() < 2 || groups.values().any(|files| files.len() != words.len()) {
        return frames;
    }
    let mut joined: Vec<_> = groups
        .into_iter()
        .map(|(number, files)| {
            let paths: Vec<_> = files.iter().map(|frame| frame.path.clone()).collect();
            (natural(&number), FrameFile { source: Source::Attributes(paths), ..files[0].clone() })
        })
        .collect();
    joined.sort_by(|one, other| one.0.cmp(&other.0));
    joined.into_iter().map(|(_, frame)| frame).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_ordered_by_value() {
        let mut names = ["f-10.vtu", "f-9.vtu", "f-1.vtu", "e-11.vtu", "f.vtu"];
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, ["e-11.vtu", "f-1.vtu", "f-9.vtu", "f-10.vtu", "f.vtu"]);
    }

    #[test]
    fn files_of_one_number_are_one_frame_where_all_numbers_have_the_same() {
        let frames = |names: &[&str]| {
            let frames = names.iter().map(|name| FrameFile::single(name.into())).collect();
            by_number(frames).len()
        };
        assert_eq!(frames(&["u00.vtp", "u01.vtp", "v00.vtp", "v01.vtp"]), 2);
        assert_eq!(frames(&["u00.vtp", "u01.vtp", "v00.vtp"]), 3);
        assert_eq!(frames(&["u00.vtp", "u01.vtp"]), 2);
        assert_eq!(frames(&["a/u00.vtp", "b/v00.vtp"]), 2);
    }
}
