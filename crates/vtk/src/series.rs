//! A folder of numbered frames with the list that readers open.

use std::fs;
use std::path::{Path, PathBuf};

use crate::{Array, Error, Frame, Values, to_bytes, whole_file};

/// A folder with numbered `.vtu` files and one `.pvd` file that lists them with their times.
///
/// Every file is written whole: to a temporary name first (with `.tmp` at its end), and renamed once it is on the disk.
/// The list is rewritten after each frame, so that the folder of a killed run can be opened.
///
/// A series may start in a folder that holds an older one of the same name. Its frames then replace the older ones one
/// by one. From its first frame on the list names its own frames only; older frames with higher numbers stay on the
/// disk, unlisted, until somebody deletes them. Until its first frame the older series stays as it is.
#[derive(Debug)]
pub struct Series {
    folder: PathBuf,
    name: String,
    pvd: PathBuf,
    /// The time and file name of each frame so far.
    listed: Vec<(f64, String)>,
}

impl Series {
    /// Starts a series: makes the folder, with its parents, and tries at once whether files can be written there.
    ///
    /// `name` begins the name of every file: `name.pvd`, `name-000000.vtu`, `name-000001.vtu`, ...
    ///
    /// # Errors
    ///
    /// Where the name is empty, begins with a dot, or holds a slash, a backslash or a control character; where the
    /// folder cannot be made, or nothing can be written there.
    pub fn create(folder: &Path, name: &str) -> Result<Self, Error> {
        let series = Self::of_pieces(folder, name)?;
        fs::create_dir_all(folder).map_err(|cause| Error::FileSystem {
            action: "create the folder",
            path: folder.to_owned(),
            cause,
        })?;
        whole_file::probe(&series.pvd)?;
        Ok(series)
    }

    /// The series for a process that writes [pieces](Self::write_piece) of its frames; another process starts the series.
    ///
    /// # Errors
    ///
    /// Where the name is not valid, as for [`create`](Self::create).
    pub fn of_pieces(folder: &Path, name: &str) -> Result<Self, Error> {
        let misplaced = |c: char| c == '/' || c == '\\' || c.is_control();
        if name.is_empty() || name.starts_with('.') || name.contains(misplaced) {
            return Err(Error::SeriesName { name: name.to_owned() });
        }
        let pvd = folder.join(format!("{name}.pvd"));
        Ok(Self { folder: folder.to_owned(), name: name.to_owned(), pvd, listed: vec![] })
    }

    /// Adds the frames that an earlier run wrote to this folder to the list, a frame for each time; the next frame comes after them.
    /// Such frames were written whole before the state from which the run goes on, by one process or by several.
    ///
    /// # Errors
    ///
    /// Where the file system does not tell which of them wrote a frame.
    pub fn take_up(&mut self, times: &[f64]) -> Result<(), Error> {
        let written = |n: usize| {
            let joined = self.joined(n);
            let path = self.folder.join(&joined);
            match path.try_exists() {
                Ok(true) => Ok(joined),
                Ok(false) => Ok(self.file(n)),
                Err(cause) => Err(Error::FileSystem { action: "look at", path, cause }),
            }
        };
        let listed = times.iter().enumerate().map(|(n, &time)| Ok((time, written(n)?)));
        self.listed = listed.collect::<Result<_, _>>()?;
        Ok(())
    }

    fn file(&self, number: usize) -> String {
        format!("{}-{number:06}.vtu", self.name)
    }

    /// The file that joins the pieces of a frame.
    fn joined(&self, number: usize) -> String {
        format!("{}-{number:06}.pvtu", self.name)
    }

    /// Removes the file that an earlier run wrote for the next frame in another form. A file that stays is not listed.
    fn remove(&self, file: &str) {
        let _ = fs::remove_file(self.folder.join(file));
    }

    /// Writes the next frame and adds it to the list; returns the path of the frame's file.
    ///
    /// Times should increase from frame to frame, since readers tell frames apart by them; this is not checked.
    ///
    /// # Errors
    ///
    /// Where [`Frame::check`] finds fault with the frame, or the file system refuses. The frames so far and their list
    /// then remain whole, and the next call writes to the same number.
    pub fn write(&mut self, frame: &Frame) -> Result<PathBuf, Error> {
        let file = self.file(self.listed.len());
        let path = self.folder.join(&file);
        whole_file::replace(&path, &to_bytes(frame)?)?;
        self.remove(&self.joined(self.listed.len()));

        self.listed.push((frame.time, file));
        if let Err(error) = whole_file::replace(&self.pvd, self.list().as_bytes()) {
            self.listed.pop();
            return Err(error);
        }
        Ok(path)
    }

    /// Writes a process's piece of the next frame. One of the processes then calls [`join`](Self::join).
    ///
    /// # Errors
    ///
    /// As [`write`](Self::write).
    pub fn write_piece(&self, number: usize, piece: &Frame, process: usize) -> Result<(), Error> {
        let path = self.folder.join(self.piece(number, process));
        whole_file::replace(&path, &to_bytes(piece)?)
    }

    /// Adds the frame that consists of the `pieces` of some processes to the list; returns the path of the file that joins them. `like`
    /// has the arrays of each piece.
    ///
    /// # Errors
    ///
    /// Where the file system refuses, as [`write`](Self::write).
    pub fn join(&mut self, like: &Frame, pieces: &[usize]) -> Result<PathBuf, Error> {
        let number = self.listed.len();
        let file = self.joined(number);
        let path = self.folder.join(&file);
        let sources = pieces.iter().map(|&process| escape(&self.piece(number, process)));
        let text = text_of_joined(like, sources);
        whole_file::replace(&path, text.as_bytes())?;
        self.remove(&self.file(number));
        self.listed.push((like.time, file));
        if let Err(error) = whole_file::replace(&self.pvd, self.list().as_bytes()) {
            self.listed.pop();
            return Err(error);
        }
        Ok(path)
    }

    fn piece(&self, number: usize, process: usize) -> String {
        format!("{}-{number:06}-{process}.vtu", self.name)
    }

    /// The file that lists the frames: the one to open in ParaView. It is there once a frame is written.
    pub fn pvd(&self) -> &Path {
        &self.pvd
    }

    fn list(&self) -> String {
        let mut list = String::from(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n  <Collection>\n",
        );
        for (time, file) in &self.listed {
            // Debug prints as many digits as it takes to read the same number back, and an exponent where needed.
            let file = escape(file);
            list += &format!("    <DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>\n");
        }
        list + "  </Collection>\n</VTKFile>\n"
    }
}

/// The text of the file that joins the pieces of a frame.
fn text_of_joined(like: &Frame, sources: impl Iterator<Item = String>) -> String {
    let array = |name: &str, number: &str, components: usize| {
        format!(
            "<PDataArray type=\"{number}\" Name=\"{name}\" NumberOfComponents=\"{components}\"/>\n"
        )
    };
    let arrays = like.arrays.iter().map(|Array { name, values }| match values {
        Values::Scalar(_) => array(name, "Float64", 1),
        Values::Vector(_) => array(name, "Float64", 3),
        Values::Tensor(_) => array(name, "Float64", 9),
        Values::Id(_) => array(name, "UInt64", 1),
    });
    let arrays: String = arrays.map(|line| format!("      {line}")).collect();
    let pieces: String =
        sources.map(|source| format!("    <Piece Source=\"{source}\"/>\n")).collect();
    format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PUnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  \
         <PUnstructuredGrid GhostLevel=\"0\">\n    <PPoints>\n      {}    </PPoints>\n    <PPointData>\n{arrays}    </PPointData>\n{pieces}  \
         </PUnstructuredGrid>\n</VTKFile>\n",
        array("Points", "Float64", 3)
    )
}

/// The text as it stands between the quotes of an XML attribute.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&apos;",
            c => escaped.push(c),
        }
    }
    escaped
}
