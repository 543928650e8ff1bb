//! One instant of a recording, whose arrays are decoded by name.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::Provenance;

use super::components::{Joined, POINTS, join};
use super::contents::{Contents, Entry, Piece};
use super::frames::{FrameFile, Location, PARTED, Source};
use super::mesh::Mesh;
use super::numbers::{Kind, Number};
use super::table::Table;
use super::{ReadError, extension, legacy, read, xml};

/// The depth to which files may list files that list files.
const DEEPEST: usize = 8;

/// Properties of an array that are known before it is decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArrayHead {
    /// Its name in the file, or the common part of the names of its components.
    pub name: String,
    /// The number of components of each particle.
    pub components: usize,
    /// Whether the file holds them as 32-bit floats.
    pub is_single: bool,
    /// The significant digits of its longest number; `None` unless it is text of a table with enough numbers to tell.
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
    Files(Files),
    Table { table: Arc<Table>, frame: usize },
}

/// VTK files of one instant.
#[derive(Debug)]
struct Files {
    files: Vec<OpenFile>,
    /// Whether the files hold arrays over the same points, instead of parts of the points.
    share_points: bool,
    location: Location,
    raw: Vec<Raw>,
    joined: Vec<Joined>,
}

#[derive(Debug)]
struct OpenFile {
    path: PathBuf,
    bytes: Vec<u8>,
    contents: Contents,
}

impl Location {
    fn arrays(self, piece: &Piece) -> &[Entry] {
        match self {
            Self::Points => &piece.arrays,
            Self::CellCentres => &piece.cell_arrays,
        }
    }
}

/// An array as it stands in the files.
#[derive(Clone, Debug)]
struct Raw {
    name: String,
    components: usize,
    is_single: bool,
}

impl OpenFile {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let bytes = read(path)?;
        let contents = match extension(path).as_str() {
            "vtk" => legacy::contents(&bytes),
            _ => xml::contents(&bytes),
        };
        let contents =
            contents.map_err(|cause| ReadError::Malformed { path: path.to_owned(), cause })?;
        Ok(Self { path: path.to_owned(), bytes, contents })
    }

    fn pieces(&self) -> impl Iterator<Item = (&Self, &Piece)> {
        self.contents.pieces.iter().map(move |piece| (self, piece))
    }

    fn particles(&self) -> Result<usize, ReadError> {
        let too_many = || ReadError::Malformed {
            path: self.path.clone(),
            cause: "it declares more points than can be counted".into(),
        };
        let add = |sum: usize, piece: &Piece| sum.checked_add(piece.particles);
        self.contents.pieces.iter().try_fold(0, add).ok_or_else(too_many)
    }

    fn positions(&self) -> Result<Vec<f64>, ReadError> {
        let mut all = vec![];
        for piece in &self.contents.pieces {
            let part = self.contents.numbers::<f64>(&self.bytes, &piece.points);
            all.extend(part.map_err(|cause| self.bad(POINTS, cause))?);
        }
        Ok(all)
    }

    fn bad(&self, array: &str, cause: String) -> ReadError {
        ReadError::Array { path: self.path.clone(), array: array.into(), cause }
    }
}

/// The files that a file stands for: itself, or the files that it lists.
fn members(path: &Path, depth: usize, all: &mut Vec<PathBuf>) -> Result<(), ReadError> {
    if !PARTED.contains(&extension(path).as_str()) {
        all.push(path.to_owned());
        return Ok(());
    }
    let malformed = |cause| ReadError::Malformed { path: path.to_owned(), cause };
    if depth == DEEPEST {
        return Err(malformed(
            "files that list files that list files are read to a depth of 8".into(),
        ));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let listed = xml::members(&read(path)?).map_err(malformed)?;
    if listed.is_empty() {
        return Err(ReadError::NoFrames { path: path.to_owned(), foreign: None });
    }
    listed.into_iter().try_for_each(|file| members(&folder.join(file), depth + 1, all))
}

impl Files {
    fn open(paths: &[PathBuf], must_share: bool, location: Location) -> Result<Self, ReadError> {
        let mut all = vec![];
        for path in paths {
            members(path, 0, &mut all)?;
        }
        let files = all.iter().map(|path| OpenFile::open(path)).collect::<Result<Vec<_>, _>>()?;
        let share_points = shares_points(&files, must_share)?;
        let (raw, joined) = arrays(&files, share_points, location)?;
        Ok(Self { files, share_points, location, raw, joined })
    }

    fn pieces(&self) -> impl Iterator<Item = (&OpenFile, &Piece)> {
        self.files.iter().flat_map(OpenFile::pieces)
    }

    /// The number of points, or of cells where cells are offered.
    fn count(&self) -> Result<usize, ReadError> {
        match self.location {
            Location::CellCentres => Ok(self.pieces().map(|(_, piece)| piece.cell_count()).sum()),
            Location::Points if self.share_points => self.files[0].particles(),
            Location::Points => self
                .files
                .iter()
                .try_fold(0, |sum: usize, file| Ok(sum.saturating_add(file.particles()?))),
        }
    }

    fn positions(&self) -> Result<Vec<f64>, ReadError> {
        if self.share_points {
            return self.files[0].positions();
        }
        let mut all = vec![];
        for file in &self.files {
            all.extend(file.positions()?);
        }
        Ok(all)
    }

    fn mesh(&self) -> Result<Mesh, ReadError> {
        let mut mesh = Mesh::default();
        let mut first = 0;
        for (file, piece) in self.pieces() {
            let appended = mesh.append(&file.contents, &file.bytes, piece, first);
            appended.map_err(|cause| file.bad("Cells", cause))?;
            first += piece.particles;
            if self.share_points {
                break;
            }
        }
        Ok(mesh)
    }

    /// The mean position of the nodes of each cell.
    fn centres(&self) -> Result<Vec<f64>, ReadError> {
        let positions = self.positions()?;
        let width = self.pieces().next().map_or(3, |(_, piece)| piece.points.components).max(1);
        let mesh = self.mesh()?;
        let mut centres = Vec::with_capacity(width * mesh.cells().len());
        for cell in mesh.cells() {
            for axis in 0..width {
                let sum: f64 = cell.nodes.iter().map(|node| positions[width * node + axis]).sum();
                centres.push(sum / cell.nodes.len() as f64);
            }
        }
        Ok(centres)
    }

    /// The numbers of an array of the files, over all particles.
    fn raw<N: Number>(&self, raw: &Raw) -> Result<Vec<N>, ReadError> {
        let mut all = vec![];
        for (file, piece) in self.pieces() {
            let entries = self.location.arrays(piece);
            if let Some(entry) = entries.iter().find(|entry| entry.name == raw.name) {
                let part = file.contents.numbers::<N>(&file.bytes, entry);
                all.extend(part.map_err(|cause| file.bad(&raw.name, cause))?);
                if self.share_points {
                    break;
                }
            }
        }
        Ok(all)
    }

    fn numbers<N: Number + Default>(&self, name: &str) -> Result<Option<Vec<N>>, ReadError> {
        let Some(array) = self.joined.iter().find(|array| array.name == name) else {
            return Ok(None);
        };
        if let Some(Some(source)) = array.components.first()
            && array.components.len() == self.raw[source.array].components
            && array.components.iter().flatten().all(|other| other.array == source.array)
        {
            return self.raw(&self.raw[source.array]).map(Some);
        }
        let mut columns = vec![];
        for source in &array.components {
            columns.push(source.map(|source| self.raw::<N>(&self.raw[source.array])).transpose()?);
        }
        let rows = columns.iter().flatten().map(Vec::len).min().unwrap_or(0);
        let value = |column: &Option<Vec<N>>, row: usize| {
            column.as_ref().map_or(N::default(), |column| column[row])
        };
        let row = |row| columns.iter().map(move |column| value(column, row));
        Ok(Some((0..rows).flat_map(row).collect()))
    }

    fn field(&self, name: &str) -> Option<(&OpenFile, &Entry)> {
        self.files.iter().find_map(|file| {
            Some((file, file.contents.fields.iter().find(|entry| entry.name == name)?))
        })
    }
}

/// The arrays that all parts of the particles have, and the vectors and tensors that they form.
fn arrays(
    files: &[OpenFile],
    share_points: bool,
    location: Location,
) -> Result<(Vec<Raw>, Vec<Joined>), ReadError> {
    let mut found: HashMap<&str, (usize, usize)> = HashMap::new();
    let mut order: Vec<&Entry> = vec![];
    let mut pieces = 0;
    let mut dimension = None;
    for (file, piece) in files.iter().flat_map(OpenFile::pieces) {
        if *dimension.get_or_insert(piece.points.components) != piece.points.components {
            let cause = "its pieces have points of different dimension".into();
            return Err(ReadError::Malformed { path: file.path.clone(), cause });
        }
        pieces += 1;
        for entry in location.arrays(piece) {
            let (components, count) = found.entry(&entry.name).or_insert_with(|| {
                order.push(entry);
                (entry.components, 0)
            });
            *count += usize::from(*components == entry.components);
        }
    }
    // An array that is missing in a piece, or has another shape there, is no array over all particles.
    let is_whole = |entry: &&Entry| share_points || found[entry.name.as_str()].1 == pieces;
    let raw = |entry: &Entry| Raw {
        name: entry.name.clone(),
        components: entry.components,
        is_single: entry.kind == Kind::F32,
    };
    let raw: Vec<_> = order.into_iter().filter(is_whole).map(raw).collect();
    let heads: Vec<_> = raw.iter().map(|raw| (raw.name.as_str(), raw.components)).collect();
    let mut joined = join(&heads).0;
    // The points of the file are its positions.
    joined.retain(|array| array.name != POINTS || heads.iter().any(|(name, _)| *name == POINTS));
    Ok((raw, joined))
}

/// The properties of arrays as they are offered.
fn heads(raw: &[Raw], joined: &[Joined]) -> Vec<ArrayHead> {
    let head = |array: &Joined| ArrayHead {
        name: array.name.clone(),
        components: array.components.len(),
        is_single: array.components.iter().flatten().any(|source| raw[source.array].is_single),
        digits: None,
    };
    joined.iter().map(head).collect()
}

/// Whether several files hold the same points. It is an error if they must and do not.
fn shares_points(files: &[OpenFile], must_share: bool) -> Result<bool, ReadError> {
    let [first, others @ ..] = files else { return Ok(false) };
    if others.is_empty() {
        return Ok(false);
    }
    let count = first.particles()?;
    let mut positions = None;
    for other in others {
        let is_same = other.particles()? == count && {
            let positions = match &positions {
                Some(positions) => positions,
                None => positions.insert(first.positions()?),
            };
            other.positions()? == *positions
        };
        if !is_same {
            let (path, other) = (first.path.clone(), other.path.clone());
            return if must_share {
                Err(ReadError::OtherPoints { path, other })
            } else {
                Ok(false)
            };
        }
    }
    Ok(true)
}

impl Snapshot {
    /// Opens a frame: finds its arrays, decodes none.
    ///
    /// # Errors
    ///
    /// [`ReadError`] for a file that is too large, cut off, damaged or in a layout that is not read.
    pub fn open(frame: &FrameFile) -> Result<Self, ReadError> {
        let path = frame.path.clone();
        let files = match &frame.source {
            Source::Rows(table, index) => {
                let arrays = table.arrays.iter().map(|array| ArrayHead {
                    name: array.name.clone(),
                    components: array.components.len(),
                    is_single: false,
                    digits: table.digits(array),
                });
                let (arrays, particles) = (arrays.collect(), table.frames[*index].range.len());
                let data = Data::Table { table: Arc::clone(table), frame: *index };
                return Ok(Self { path, particles, arrays, data });
            }
            Source::File => Files::open(std::slice::from_ref(&path), false, frame.location)?,
            Source::Parts(paths) => Files::open(paths, false, frame.location)?,
            Source::Attributes(paths) => Files::open(paths, true, frame.location)?,
        };
        let (particles, arrays) = (files.count()?, heads(&files.raw, &files.joined));
        Ok(Self { path, particles, arrays, data: Data::Files(files) })
    }

    /// The arrays over cells; empty where cells are offered already, for a table, and where the pieces do not fit together.
    #[must_use]
    pub fn cell_arrays(&self) -> Vec<ArrayHead> {
        let Data::Files(files) = &self.data else { return vec![] };
        let of_cells = arrays(&files.files, files.share_points, Location::CellCentres);
        match of_cells {
            Ok((raw, joined)) if files.location == Location::Points => heads(&raw, &joined),
            _ => vec![],
        }
    }

    /// The cells over the points; `None` where all cells are points, as in files of particles.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded.
    pub fn mesh(&self) -> Result<Option<Mesh>, ReadError> {
        match &self.data {
            Data::Files(files) if files.location == Location::Points => {
                Ok(Some(files.mesh()?).filter(Mesh::has_elements))
            }
            _ => Ok(None),
        }
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

    /// The properties of the points of the grid, whether reference or current positions: components, and whether they are single
    /// precision. A CSV file may lack points.
    #[must_use]
    pub fn points(&self) -> Option<ArrayHead> {
        match &self.data {
            Data::Files(files) => files.pieces().next().map(|(_, piece)| ArrayHead {
                name: POINTS.into(),
                components: piece.points.components,
                is_single: piece.points.kind == Kind::F32,
                digits: None,
            }),
            Data::Table { .. } => self.array(POINTS).cloned(),
        }
    }

    /// The coordinates of the points, one point after the other; nothing in a file without points.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded.
    pub fn positions(&self) -> Result<Vec<f64>, ReadError> {
        match &self.data {
            Data::Files(files) => match files.location {
                Location::Points => files.positions(),
                Location::CellCentres => files.centres(),
            },
            Data::Table { .. } => Ok(self.floats(POINTS)?.unwrap_or_default()),
        }
    }

    /// The numbers of an array, one particle after the other; `None` where there is no such array.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded, or their number is wrong.
    pub fn floats(&self, name: &str) -> Result<Option<Vec<f64>>, ReadError> {
        match &self.data {
            Data::Files(files) => files.numbers(name),
            Data::Table { table, frame } => {
                Ok(table.floats(name, table.frames[*frame].range.clone()))
            }
        }
    }

    /// The whole numbers of an array, such as identities.
    ///
    /// # Errors
    ///
    /// [`ReadError::Array`] where they cannot be decoded, or are not whole numbers.
    pub fn integers(&self, name: &str) -> Result<Option<Vec<i64>>, ReadError> {
        match &self.data {
            Data::Files(files) => files.numbers(name),
            Data::Table { table, frame } => table
                .integers(name, table.frames[*frame].range.clone())
                .transpose()
                .map_err(|cause| self.bad(name, cause)),
        }
    }

    /// The first number of a field of the whole file, such as `TimeValue`; `None` where no number can be read.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<f64> {
        let Data::Files(files) = &self.data else { return None };
        let (file, entry) = files.field(name)?;
        file.contents.numbers::<f64>(&file.bytes, entry).ok()?.first().copied()
    }

    /// The solution and the parameters that the file states: its field `solution`, and the fields whose names begin with `parameter_`.
    /// `None` where it states no solution; a parameter without a number is left out.
    #[must_use]
    pub fn provenance(&self) -> Option<Provenance> {
        let Data::Files(files) = &self.data else { return None };
        let (file, entry) = files.field("solution")?;
        let letters = file.contents.numbers::<i64>(&file.bytes, entry).ok()?;
        let letters: Option<Vec<u8>> =
            letters.into_iter().map(|letter| letter.try_into().ok()).collect();
        let parameters = file.contents.fields.iter().filter_map(|entry| {
            let name = entry.name.strip_prefix("parameter_")?;
            Some((name.to_owned(), self.field(&entry.name)?))
        });
        let solution = String::from_utf8(letters?).ok()?;
        Some(Provenance { solution, parameters: parameters.collect() })
    }

    fn bad(&self, array: &str, cause: String) -> ReadError {
        ReadError::Array { path: self.path.clone(), array: array.into(), cause }
    }
}
