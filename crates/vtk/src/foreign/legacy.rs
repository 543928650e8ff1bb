//! The arrays of legacy `.vtk` files, in text or binary.

use super::contents::{ArrayData, Cells, Contents, Entry, Kinds, Nodes, Piece};
use super::numbers::{ByteOrder, Kind, Packing};

/// Finds the arrays of a legacy file.
pub(super) fn contents(bytes: &[u8]) -> Result<Contents, String> {
    let mut scan = Scan { bytes, at: 0, is_binary: false };
    let version = scan.line()?.to_owned();
    let version = version
        .strip_prefix("# vtk DataFile Version ")
        .ok_or("it does not begin with \"# vtk DataFile Version\"")?;
    let major = version.trim().split('.').next().and_then(|major| major.parse::<u32>().ok());
    let major = major.ok_or_else(|| format!("version {version:?} is unknown"))?;
    scan.line()?;
    scan.is_binary = match scan.line()?.trim() {
        "ASCII" => false,
        "BINARY" => true,
        other => return Err(format!("its third line is {other:?}, neither ASCII nor BINARY")),
    };

    let mut found = Found { major, ..Found::default() };
    while let Some(keyword) = scan.keyword()? {
        found.take(&keyword.to_ascii_uppercase(), &mut scan)?;
    }
    found.contents()
}

/// The arrays of a file, as far as it is read.
#[derive(Default)]
struct Found {
    /// The file's major version.
    major: u32,
    fields: Vec<Entry>,
    /// The number of points, and their positions.
    points: Option<(usize, Entry)>,
    arrays: Vec<Entry>,
    cells: Vec<Cells>,
    cell_arrays: Vec<Entry>,
    /// The number of tuples of the arrays that come next, and whether they belong to points.
    section: Option<(usize, bool)>,
}

impl Found {
    /// Reads the lines that belong to a keyword.
    fn take(&mut self, keyword: &str, scan: &mut Scan<'_>) -> Result<(), String> {
        match (keyword, self.section) {
            ("DATASET", _) => match scan.word()?.to_ascii_uppercase().as_str() {
                "UNSTRUCTURED_GRID" | "POLYDATA" | "STRUCTURED_GRID" => (),
                other => {
                    return Err(format!(
                        "its dataset is {other}, which lists no points; use UNSTRUCTURED_GRID or POLYDATA"
                    ));
                }
            },
            ("POINTS", _) => {
                let count = scan.count("POINTS")?;
                let kind = scan.kind("POINTS")?;
                self.points = Some((count, scan.array("", kind, 3, count)?));
            }
            ("DIMENSIONS", _) => {
                for _ in 0..3 {
                    scan.count("DIMENSIONS")?;
                }
            }
            ("CELLS" | "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS", _) => {
                self.cells.push(scan.cells(keyword, self.major)?);
            }
            ("CELL_TYPES", _) => {
                let count = scan.count("CELL_TYPES")?;
                let kinds = scan.array("CELL_TYPES", Kind::I32, 1, count)?;
                if let Some(cells) = self.cells.last_mut().filter(|cells| cells.count == count) {
                    cells.kinds = Kinds::Given(kinds);
                }
            }
            ("METADATA", _) => scan.skip_paragraph(),
            ("POINT_DATA", _) => self.section = Some((scan.count("POINT_DATA")?, true)),
            ("CELL_DATA", _) => self.section = Some((scan.count("CELL_DATA")?, false)),
            ("FIELD", _) => {
                scan.word()?;
                for _ in 0..scan.count("FIELD")? {
                    if let Some(entry) = scan.field()? {
                        self.field(entry)?;
                    }
                }
            }
            ("LOOKUP_TABLE", _) => {
                scan.word()?;
                let colours = scan.count("LOOKUP_TABLE")?;
                let kind = if scan.is_binary { Kind::U8 } else { Kind::F32 };
                scan.array("LOOKUP_TABLE", kind, 4, colours)?;
            }
            (_, Some((tuples, of_points))) => {
                let entry = scan.attribute(keyword, tuples)?;
                if of_points { &mut self.arrays } else { &mut self.cell_arrays }.push(entry);
            }
            (other, None) => return Err(format!("{other:?} at byte {} is unknown", scan.at)),
        }
        Ok(())
    }

    /// Puts an array of a field where it belongs.
    fn field(&mut self, entry: Entry) -> Result<(), String> {
        match self.section {
            None => self.fields.push(entry),
            // VTK writes fields of the whole file among the arrays of points where it has no other place.
            Some((tuples, true)) if entry.tuples == tuples => self.arrays.push(entry),
            Some((_, true)) if entry.tuples == 1 => self.fields.push(entry),
            Some((tuples, true)) => {
                let Entry { name, tuples: found, .. } = entry;
                return Err(format!("array `{name}` has {found} entries for {tuples} points"));
            }
            Some((tuples, false)) if entry.tuples == tuples => self.cell_arrays.push(entry),
            Some((_, false)) => (),
        }
        Ok(())
    }

    fn contents(self) -> Result<Contents, String> {
        let Self { fields, points, arrays, cells, cell_arrays, .. } = self;
        let (particles, points) = points.ok_or("it has no POINTS")?;
        if let Some(entry) = arrays.iter().find(|entry| entry.tuples != particles) {
            let Entry { name, tuples, .. } = entry;
            return Err(format!("array `{name}` has {tuples} entries for {particles} points"));
        }
        Ok(Contents {
            packing: Packing::plain(ByteOrder::Big),
            appended: None,
            fields,
            pieces: vec![Piece { particles, points, arrays, cells, cell_arrays }],
        })
    }
}

/// Reads the file from front to back.
struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
    is_binary: bool,
}

impl<'a> Scan<'a> {
    /// The rest of the line.
    fn line(&mut self) -> Result<&'a str, String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        let line = &rest[..length];
        if line.len() > 4096 {
            return Err(format!("a line of {} bytes at byte {}", line.len(), self.at));
        }
        self.at += (length + 1).min(rest.len());
        std::str::from_utf8(line)
            .map(|line| line.trim_end_matches('\r'))
            .map_err(|_| format!("no text where text should be, before byte {}", self.at))
    }

    /// The next word; `None` at the end.
    fn keyword(&mut self) -> Result<Option<&'a str>, String> {
        let rest = &self.bytes[self.at..];
        let blanks = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        let word = &rest[blanks..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        let word = &word[..length];
        self.at += blanks + length;
        if word.is_empty() {
            return Ok(None);
        }
        match std::str::from_utf8(word) {
            Ok(text) if word.len() <= 1024 => Ok(Some(text)),
            _ => Err(format!("no keyword where one should be, before byte {}", self.at)),
        }
    }

    fn word(&mut self) -> Result<&'a str, String> {
        self.keyword()?.ok_or_else(|| "the file ends too early: it was cut off".into())
    }

    fn count(&mut self, of: &str) -> Result<usize, String> {
        let word = self.word()?;
        word.parse().map_err(|_| format!("{of}: {word:?} is no count"))
    }

    fn kind(&mut self, of: &str) -> Result<Kind, String> {
        let word = self.word()?;
        Kind::of_legacy(word).ok_or_else(|| format!("{of}: {word:?} is no kind of numbers"))
    }

    /// Steps over an array's numbers, which begin on the next line.
    fn array(
        &mut self,
        name: &str,
        kind: Kind,
        components: usize,
        tuples: usize,
    ) -> Result<Entry, String> {
        let name = unescape(name);
        let cut = |found: String| {
            let shown = if name.is_empty() { "POINTS" } else { &name };
            format!(
                "array `{shown}`: {found} of its {tuples} x {components} numbers are there: the file was cut off"
            )
        };
        let count = tuples.checked_mul(components).ok_or_else(|| cut("not all".into()))?;
        let place = if self.is_binary {
            self.line()?;
            let there = self.bytes.len() - self.at;
            let size = count.checked_mul(kind.size()).filter(|size| *size <= there);
            let size = size.ok_or_else(|| cut((there / kind.size()).to_string()))?;
            let start = self.at;
            self.at += size;
            ArrayData::Plain(start..self.at)
        } else {
            let start = self.at;
            for found in 0..count {
                if self.keyword()?.is_none() {
                    return Err(cut(found.to_string()));
                }
            }
            ArrayData::Ascii(start..self.at)
        };
        Ok(Entry { name, kind, components, tuples, place })
    }

    /// The cells that a keyword lists.
    fn cells(&mut self, keyword: &str, major: u32) -> Result<Cells, String> {
        let (first, second) = (self.count(keyword)?, self.count(keyword)?);
        let kinds = match keyword {
            "VERTICES" => Kinds::Vertices,
            "LINES" => Kinds::Lines,
            "TRIANGLE_STRIPS" => Kinds::Strips,
            _ => Kinds::Polygons,
        };
        if major < 5 {
            let nodes = Nodes::Counted(self.array(keyword, Kind::I32, 1, second)?);
            return Ok(Cells { count: first, nodes, kinds });
        }
        let offsets = self.part("OFFSETS", first)?;
        let nodes = self.part("CONNECTIVITY", second)?;
        Ok(Cells {
            count: first.saturating_sub(1),
            nodes: Nodes::Offsets { offsets, nodes },
            kinds,
        })
    }

    /// Reads one of the two arrays that list cells in files of version 5.
    fn part(&mut self, part: &str, count: usize) -> Result<Entry, String> {
        let found = self.word()?;
        if !found.eq_ignore_ascii_case(part) {
            return Err(format!("{found:?} where {part} should be"));
        }
        let kind = self.kind(part)?;
        self.array(part, kind, 1, count)
    }

    /// An array of a FIELD; `None` for texts.
    fn field(&mut self) -> Result<Option<Entry>, String> {
        let mut name = self.word()?;
        // VTK puts this between the arrays of a field.
        while name == "METADATA" {
            self.skip_paragraph();
            name = self.word()?;
        }
        let (components, tuples) = (self.count(name)?, self.count(name)?);
        let kind = self.word()?;
        if kind.eq_ignore_ascii_case("string") && !self.is_binary {
            self.line()?;
            for _ in 0..tuples.saturating_mul(components) {
                if self.at == self.bytes.len() {
                    return Err(format!("array `{name}` ends too early: the file was cut off"));
                }
                self.line()?;
            }
            return Ok(None);
        }
        let kind = Kind::of_legacy(kind)
            .ok_or_else(|| format!("array `{name}`: {kind:?} is no kind of numbers"))?;
        self.array(name, kind, components, tuples).map(Some)
    }

    /// An array of POINT_DATA or CELL_DATA that begins with a keyword of its own.
    fn attribute(&mut self, keyword: &str, tuples: usize) -> Result<Entry, String> {
        let name = self.word()?;
        let (kind, components) = match keyword {
            "SCALARS" => {
                let kind = self.kind(name)?;
                // The number of components is optional, and so is the table of colours.
                let mut rest = self.line()?.split_whitespace();
                let components = match rest.next() {
                    None => 1,
                    Some(word) => {
                        word.parse().map_err(|_| format!("{name}: {word:?} is no count"))?
                    }
                };
                let before = self.at;
                if self.keyword()?.is_some_and(|word| word.eq_ignore_ascii_case("LOOKUP_TABLE")) {
                    self.word()?;
                } else {
                    // One byte back is the end of the line, which the array expects.
                    self.at = before - 1;
                }
                (kind, components)
            }
            "VECTORS" | "NORMALS" => (self.kind(name)?, 3),
            "TENSORS" => (self.kind(name)?, 9),
            "TENSORS6" => (self.kind(name)?, 6),
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => (self.kind(name)?, 1),
            "TEXTURE_COORDINATES" => {
                let components = self.count(name)?;
                (self.kind(name)?, components)
            }
            "COLOR_SCALARS" => {
                let components = self.count(name)?;
                (if self.is_binary { Kind::U8 } else { Kind::F32 }, components)
            }
            other => return Err(format!("{other:?} at byte {} is unknown", self.at)),
        };
        self.array(name, kind, components, tuples)
    }

    /// Steps over everything to the next empty line.
    fn skip_paragraph(&mut self) {
        let end = self.bytes[self.at..].windows(2).position(|pair| pair == b"\n\n");
        self.at = end.map_or(self.bytes.len(), |end| self.at + end + 1);
    }
}

/// Decodes a name: VTK writes blanks and other special characters as `%20`.
fn unescape(name: &str) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|pair| std::str::from_utf8(pair).ok());
        match digits.and_then(|pair| u8::from_str_radix(pair, 16).ok()) {
            Some(code) if byte == b'%' => {
                bytes.push(code);
                rest = &after[2..];
            }
            _ => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::super::mesh::{Cell, Mesh};
    use super::*;

    fn refused(text: &str) -> String {
        contents(text.as_bytes()).expect_err("it is accepted")
    }

    const HEAD: &str = "# vtk DataFile Version 4.2\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\n";

    #[test]
    fn every_attribute_of_the_points_is_found_and_those_of_cells_are_not() {
        let text = format!(
            "{HEAD}FIELD FieldData 2\nTimeValue 1 1 double\n0.5\nlabel 1 1 string\nsome text\n\
             POINTS 2 float\n0 0 0 1 0 0\nCELLS 2 4\n1 0\n1 1\nCELL_TYPES 2\n1 1\n\
             CELL_DATA 2\nSCALARS colour double\nLOOKUP_TABLE default\n5 6\n\
             POINT_DATA 2\nSCALARS mass double\n1 2\nVECTORS u%20x double\n1 2 3 4 5 6\n\
             TENSORS F double\n1 0 0 0 1 0 0 0 1\n1 0 0 0 1 0 0 0 1\n\
             FIELD FieldData 2\nid 1 2 long\n7 9\nMETADATA\nINFORMATION 0\n\nv 2 2 double\n1 2 3 4\n"
        );
        let contents = contents(text.as_bytes()).unwrap();
        let piece = &contents.pieces[0];
        let names: Vec<_> = piece.arrays.iter().map(|a| (a.name.as_str(), a.components)).collect();
        assert_eq!(names, [("mass", 1), ("u x", 3), ("F", 9), ("id", 1), ("v", 2)]);
        let numbers = |entry| contents.numbers::<f64>(text.as_bytes(), entry).unwrap();
        assert_eq!(numbers(&piece.arrays[0]), [1.0, 2.0]);
        assert_eq!(numbers(&piece.arrays[4]), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(
            (contents.fields[0].name.as_str(), numbers(&contents.fields[0])),
            ("TimeValue", vec![0.5])
        );
    }

    #[test]
    fn kinds_and_keywords_are_read_in_any_case() {
        let body = "POINTS 2 double\n0 0 0 1 0 0\nCELLS 1 3\n2 0 1\nCELL_TYPES 1\n3\nPOINT_DATA 2\n\
                    SCALARS sigma_xx float 1\nLOOKUP_TABLE default\n5 6\nVECTORS u double\n1 2 3 4 5 6\n";
        let lower = body.to_ascii_lowercase();
        let upper = body.to_ascii_uppercase();
        for text in [body, &lower, &upper].map(|body| format!("{HEAD}{body}")) {
            let contents = contents(text.as_bytes()).unwrap();
            let piece = &contents.pieces[0];
            let found: Vec<_> = piece.arrays.iter().map(|a| (a.components, a.kind)).collect();
            assert_eq!(found, [(1, Kind::F32), (3, Kind::F64)], "{text}");
            let numbers = |entry| contents.numbers::<f64>(text.as_bytes(), entry).unwrap();
            assert_eq!(numbers(&piece.arrays[0]), [5.0, 6.0]);
        }
    }

    #[test]
    fn cells_are_read_with_counts_among_their_nodes_and_with_offsets() {
        let points = "POINTS 4 double\n0 0 0 1 0 0 1 1 0 0 1 0\n";
        let old = format!("{HEAD}{points}CELLS 2 8\n4 0 1 2 3\n2 0 1\nCELL_TYPES 2\n9 3\n");
        let new = format!(
            "{}{points}CELLS 3 6\nOFFSETS vtktypeint64\n0 4 6\nCONNECTIVITY vtktypeint64\n0 1 2 3 0 1\nCELL_TYPES 2\n9 3\n",
            HEAD.replace("4.2", "5.1")
        );
        for text in [old, new] {
            let contents = contents(text.as_bytes()).unwrap();
            let mut mesh = Mesh::default();
            for first in [0, 7] {
                mesh.append(&contents, text.as_bytes(), &contents.pieces[0], first).unwrap();
            }
            let cells: Vec<_> = mesh.cells().collect();
            assert_eq!(cells[0], Cell { kind: 9, nodes: &[0, 1, 2, 3] }, "{text}");
            assert_eq!(cells[1], Cell { kind: 3, nodes: &[0, 1] });
            assert_eq!(cells[2], Cell { kind: 9, nodes: &[7, 8, 9, 10] });
        }
        let damaged = format!("{HEAD}{points}CELLS 1 3\n4 0 1\nCELL_TYPES 1\n9\n");
        let contents = contents(damaged.as_bytes()).unwrap();
        let piece = &contents.pieces[0];
        assert!(Mesh::default().append(&contents, damaged.as_bytes(), piece, 0).is_err());
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (text, expected) in [
            ("", "does not begin"),
            ("# vtk DataFile Version x\n\n\n", "version"),
            ("# vtk DataFile Version 4.2\n\nHEX\n", "neither ASCII nor BINARY"),
            ("# vtk DataFile Version 4.2\n\nASCII\nDATASET STRUCTURED_POINTS\n", "lists no points"),
            (&format!("{HEAD}POINTS 2 float\n0 0 0 1 0"), "5 of its 2 x 3"),
            (&format!("{HEAD}POINTS 99999999999999999 float\n0 0"), "2 of its"),
            (&format!("{HEAD}POINTS -1 float\n0 0"), "\"-1\" is no count"),
            (&format!("{HEAD}POINTS 1 words\n0 0"), "no kind of numbers"),
            (
                &format!("{HEAD}POINTS 1 float\n0 0 0\nPOINT_DATA 2\nSCALARS m float\n1 2\n"),
                "2 entries for 1",
            ),
            (&format!("{HEAD}NONSENSE\n"), "\"NONSENSE\""),
            (HEAD, "no POINTS"),
        ] {
            let message = refused(text);
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
