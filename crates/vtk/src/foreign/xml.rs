//! The arrays of `.vtu` and `.vtp` files, and the files that a `.pvd`, `.pvtu`, `.pvtp`, `.vtm` or `.vtmb` file lists.

use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::contents::{Appended, ArrayData, Cells, Contents, Entry, Kinds, Nodes, Piece};
use super::numbers::{ByteOrder, Kind, Packing};

/// A limit that no element of a VTK file reaches.
const MOST_ATTRIBUTES: usize = 1000;

/// The attributes of an element.
struct Tag {
    attributes: HashMap<String, String>,
}

impl Tag {
    fn new(element: &BytesStart<'_>) -> Result<Self, String> {
        let mut attributes = HashMap::new();
        // The reader's own search for repeated attributes takes time in proportion to the square of their number.
        for attribute in element.attributes().with_checks(false) {
            if attributes.len() == MOST_ATTRIBUTES {
                return Err(format!("an element has more than {MOST_ATTRIBUTES} attributes"));
            }
            let attribute = attribute.map_err(|cause| format!("a bad attribute: {cause}"))?;
            let key = String::from_utf8_lossy(attribute.key.as_ref()).into_owned();
            let value = attribute.unescape_value().map_err(|cause| format!("{key}: {cause}"))?;
            if attributes.contains_key(&key) {
                return Err(format!("the attribute {key} is given twice"));
            }
            attributes.insert(key, value.into_owned());
        }
        Ok(Self { attributes })
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.attributes.get(key).map(String::as_str)
    }

    /// A count; `None` where it is not given.
    fn count(&self, key: &str) -> Result<Option<usize>, String> {
        let parse = |text: &str| {
            text.trim().parse().map_err(|_| format!("{key}={text:?} is not a whole number"))
        };
        self.get(key).map(parse).transpose()
    }
}

/// The section that encloses an array.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Field,
    Points,
    PointData,
    /// The nodes of cells; a list of cells is open.
    Cells,
    CellData,
    Other,
}

/// The sections of a piece that list cells, and the kind of cells where they do not give it.
fn lists_cells(element: &[u8]) -> Option<Kinds> {
    Some(match element {
        b"Cells" | b"Polys" => Kinds::Polygons,
        b"Verts" => Kinds::Vertices,
        b"Lines" => Kinds::Lines,
        b"Strips" => Kinds::Strips,
        _ => return None,
    })
}

/// The number of cells that a section of a piece lists.
fn count_of(element: &[u8], piece: &Tag) -> Result<usize, String> {
    let key = match element {
        b"Polys" => "NumberOfPolys",
        b"Verts" => "NumberOfVerts",
        b"Lines" => "NumberOfLines",
        b"Strips" => "NumberOfStrips",
        _ => "NumberOfCells",
    };
    Ok(piece.count(key)?.unwrap_or(0))
}

/// The arrays of a list of cells that were found so far.
struct List {
    count: usize,
    kinds: Kinds,
    nodes: Option<Entry>,
    ends: Option<Entry>,
}

impl List {
    fn take(&mut self, entry: Entry) {
        match entry.name.as_str() {
            "connectivity" => self.nodes = Some(entry),
            "offsets" => self.ends = Some(entry),
            "types" => self.kinds = Kinds::Given(entry),
            _ => (),
        }
    }

    /// The cells; `None` where an array is missing.
    fn cells(self) -> Option<Cells> {
        let (nodes, ends) = self.nodes.zip(self.ends)?;
        let nodes = Nodes::Ends { ends, nodes };
        (self.count > 0).then_some(Cells { count: self.count, nodes, kinds: self.kinds })
    }
}

/// A piece that is being read.
struct Open {
    tag: Tag,
    particles: usize,
    points: Option<Entry>,
    arrays: Vec<Entry>,
    lists: Vec<List>,
    cell_arrays: Vec<Entry>,
}

impl Open {
    fn new(element: &BytesStart<'_>) -> Result<Self, String> {
        let tag = Tag::new(element)?;
        // vtkio leaves the count out where it is zero.
        let particles = tag.count("NumberOfPoints")?.unwrap_or(0);
        Ok(Self {
            tag,
            particles,
            points: None,
            arrays: vec![],
            lists: vec![],
            cell_arrays: vec![],
        })
    }

    /// Takes an array of a section.
    fn take(
        &mut self,
        section: Section,
        tag: &Tag,
        text: std::ops::Range<usize>,
    ) -> Result<(), String> {
        let cells = || self.lists.iter().fold(0, |sum, list| list.count.saturating_add(sum));
        match section {
            Section::Points => self.points = Some(entry(tag, text, self.particles)?),
            Section::PointData => self.arrays.push(entry(tag, text, self.particles)?),
            // Texts and other arrays without numbers are no fields.
            Section::CellData => self.cell_arrays.extend(entry(tag, text, cells()).ok()),
            Section::Cells => {
                if let Some(list) = self.lists.last_mut() {
                    list.take(entry(tag, text, list.count)?);
                }
            }
            Section::Field | Section::Other => (),
        }
        Ok(())
    }
}

/// Finds the arrays of a `.vtu` or `.vtp` file.
pub(super) fn contents(bytes: &[u8]) -> Result<Contents, String> {
    let mut reader = Reader::from_reader(bytes);
    let mut contents: Option<Contents> = None;
    let mut piece: Option<Open> = None;
    let mut section = Section::Other;
    let mut is_complete = false;
    loop {
        let before = position(&reader);
        let event = reader
            .read_event()
            .map_err(|cause| format!("bad XML at byte {}: {cause}", reader.error_position()))?;
        let (element, is_empty) = match &event {
            Event::Start(element) => (element, false),
            Event::Empty(element) => (element, true),
            Event::End(element) => {
                match element.name().as_ref() {
                    b"Piece" => close(piece.take(), contents.as_mut())?,
                    b"FieldData" | b"Points" | b"PointData" | b"CellData" => {
                        section = Section::Other
                    }
                    name if lists_cells(name).is_some() => section = Section::Other,
                    b"VTKFile" => is_complete = true,
                    _ => (),
                }
                continue;
            }
            Event::Eof => break,
            _ => continue,
        };
        match element.name().as_ref() {
            b"VTKFile" => contents = Some(root(&Tag::new(element)?)?),
            b"FieldData" if !is_empty => section = Section::Field,
            b"Points" if !is_empty => section = Section::Points,
            b"PointData" if !is_empty => section = Section::PointData,
            b"CellData" if !is_empty => section = Section::CellData,
            b"Piece" => {
                piece = Some(Open::new(element)?);
                if is_empty {
                    close(piece.take(), contents.as_mut())?;
                }
            }
            b"DataArray" => {
                let tag = Tag::new(element)?;
                let text = if is_empty { before..before } else { text(&mut reader)? };
                let Some(contents) = &mut contents else {
                    return Err("an array stands outside of <VTKFile>".into());
                };
                match (section, &mut piece) {
                    (Section::Field, _) => {
                        // A text among the fields, or a field that cannot be read, is no time.
                        let tuples = tag.count("NumberOfTuples")?.unwrap_or(1);
                        contents.fields.extend(entry(&tag, text, tuples).ok());
                    }
                    (_, Some(piece)) => piece.take(section, &tag, text)?,
                    _ => (),
                }
            }
            b"AppendedData" if !is_empty => {
                let Some(contents) = &mut contents else {
                    return Err("<AppendedData> stands outside of <VTKFile>".into());
                };
                contents.appended = Some(appended(&Tag::new(element)?, bytes, position(&reader))?);
                // Bytes behind the end need not be XML.
                is_complete = true;
                break;
            }
            name => {
                if let (Some(kinds), Some(piece), false) = (lists_cells(name), &mut piece, is_empty)
                {
                    let count = count_of(name, &piece.tag)?;
                    piece.lists.push(List { count, kinds, nodes: None, ends: None });
                    section = Section::Cells;
                }
            }
        }
    }
    let contents = contents.ok_or("it holds no <VTKFile> element")?;
    if !is_complete {
        return Err("the file ends before </VTKFile>: it was cut off".into());
    }
    if contents.pieces.is_empty() {
        return Err("it holds no <Piece> with points".into());
    }
    Ok(contents)
}

/// The byte that the reader comes to next.
fn position(reader: &Reader<&[u8]>) -> usize {
    reader.buffer_position() as usize
}

fn root(tag: &Tag) -> Result<Contents, String> {
    match tag.get("type") {
        Some("UnstructuredGrid" | "PolyData") => (),
        Some(other) => {
            return Err(format!(
                "it holds a {other}; particles and nodes are read from UnstructuredGrid and PolyData"
            ));
        }
        None => return Err("<VTKFile> does not tell its type".into()),
    }
    let order = match tag.get("byte_order") {
        None | Some("LittleEndian") => ByteOrder::Little,
        Some("BigEndian") => ByteOrder::Big,
        Some(other) => return Err(format!("byte_order={other:?} is unknown")),
    };
    let header = match tag.get("header_type") {
        None | Some("UInt32") => 4,
        Some("UInt64") => 8,
        Some(other) => return Err(format!("header_type={other:?} is unknown")),
    };
    let zlib = match tag.get("compressor") {
        None | Some("") => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => {
            return Err(format!("it is compressed by {other}; write it with zlib or uncompressed"));
        }
    };
    let packing = Packing { header, order, zlib };
    Ok(Contents { packing, appended: None, fields: vec![], pieces: vec![] })
}

fn close(piece: Option<Open>, contents: Option<&mut Contents>) -> Result<(), String> {
    let (Some(piece), Some(contents)) = (piece, contents) else { return Ok(()) };
    // Parallel programs write pieces without particles, which may lack every array.
    if piece.particles == 0 && piece.points.is_none() {
        return Ok(());
    }
    let points = piece.points.ok_or("a piece has no points")?;
    let cells = piece.lists.into_iter().filter_map(List::cells).collect();
    contents.pieces.push(Piece {
        particles: piece.particles,
        points,
        arrays: piece.arrays,
        cells,
        cell_arrays: piece.cell_arrays,
    });
    Ok(())
}

/// The range of the text of the element that the reader has just entered; the reader leaves the element.
fn text(reader: &mut Reader<&[u8]>) -> Result<std::ops::Range<usize>, String> {
    let start = position(reader);
    let mut found = start..start;
    let mut depth = 0;
    loop {
        let before = position(reader);
        let event = reader
            .read_event()
            .map_err(|cause| format!("bad XML at byte {}: {cause}", reader.error_position()))?;
        match event {
            // VTK puts descriptions of the array next to its numbers, as elements with texts of their own.
            Event::Text(text)
                if depth == 0 && found.is_empty() && !text.iter().all(u8::is_ascii_whitespace) =>
            {
                found = before..before + text.len();
            }
            Event::Start(_) => depth += 1,
            Event::End(_) if depth == 0 => return Ok(found),
            Event::End(_) => depth -= 1,
            Event::Eof => return Err("the file ends inside an array: it was cut off".into()),
            _ => (),
        }
    }
}

fn entry(tag: &Tag, text: std::ops::Range<usize>, tuples: usize) -> Result<Entry, String> {
    let name = tag.get("Name").unwrap_or("").to_owned();
    let fail = |cause: String| format!("array `{name}`: {cause}");
    let kind = tag.get("type").unwrap_or("");
    let kind = Kind::of_xml(kind).ok_or_else(|| fail(format!("type={kind:?} is no number")))?;
    let components = tag.count("NumberOfComponents").map_err(fail)?.unwrap_or(1).max(1);
    let place = match tag.get("format") {
        None | Some("ascii") => ArrayData::Ascii(text),
        Some("binary") => ArrayData::Base64(text),
        Some("appended") => {
            let offset = tag.count("offset").map_err(fail)?;
            ArrayData::Appended(offset.ok_or_else(|| fail("its offset is missing".into()))?)
        }
        Some(other) => return Err(fail(format!("format={other:?} is unknown"))),
    };
    Ok(Entry { name, kind, components, tuples, place })
}

fn appended(tag: &Tag, bytes: &[u8], from: usize) -> Result<Appended, String> {
    let is_base64 = match tag.get("encoding") {
        Some("raw") => false,
        None | Some("base64") => true,
        Some(other) => return Err(format!("the appended data's encoding {other:?} is unknown")),
    };
    if !bytes.trim_ascii_end().ends_with(b"</VTKFile>") {
        return Err("the file does not end with </VTKFile>: it was cut off".into());
    }
    let rest = &bytes[from..];
    let blanks = rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    if rest.get(blanks) != Some(&b'_') {
        return Err("the appended data do not begin with an underscore".into());
    }
    let start = from + blanks + 1;
    // Raw data may hold any bytes, the end tag included: only the promised bytes of each array are read.
    let end = match is_base64 {
        false => bytes.len(),
        true => {
            let length = bytes[start..].iter().position(|byte| *byte == b'<');
            start + length.ok_or("the file ends inside the appended data: it was cut off")?
        }
    };
    Ok(Appended { is_base64, start, end })
}

/// One line of a `.pvd` file.
pub(super) struct Listed {
    pub(super) time: Option<f64>,
    pub(super) file: String,
}

/// The files that a `.pvtu`, `.pvtp`, `.vtm` or `.vtmb` file lists.
pub(super) fn members(bytes: &[u8]) -> Result<Vec<String>, String> {
    let mut reader = Reader::from_reader(bytes);
    let mut listed = vec![];
    loop {
        let event = reader
            .read_event()
            .map_err(|cause| format!("bad XML at byte {}: {cause}", reader.error_position()))?;
        match event {
            Event::Start(element) | Event::Empty(element) => {
                let key = match element.name().as_ref() {
                    b"Piece" if !is_block(&Tag::new(&element)?) => "Source",
                    b"DataSet" => "file",
                    _ => continue,
                };
                // A block without a file is empty.
                listed.extend(Tag::new(&element)?.get(key).map(str::to_owned));
            }
            Event::Eof => return Ok(listed),
            _ => (),
        }
    }
}

/// Whether a member of a multi-block file is itself a block, whose files stand inside it.
fn is_block(tag: &Tag) -> bool {
    tag.get("Source").is_none()
}

/// The files that a `.pvd` file lists.
pub(super) fn collection(bytes: &[u8]) -> Result<Vec<Listed>, String> {
    let mut reader = Reader::from_reader(bytes);
    let mut listed = vec![];
    let (mut is_collection, mut is_complete) = (false, false);
    loop {
        let event = reader
            .read_event()
            .map_err(|cause| format!("bad XML at byte {}: {cause}", reader.error_position()))?;
        match event {
            Event::Start(element) | Event::Empty(element) => match element.name().as_ref() {
                b"VTKFile" => {
                    is_collection = Tag::new(&element)?.get("type") == Some("Collection");
                }
                b"DataSet" => {
                    let tag = Tag::new(&element)?;
                    let file = tag.get("file").ok_or("a <DataSet> names no file")?.to_owned();
                    let parse = |text: &str| {
                        text.trim()
                            .parse()
                            .map_err(|_| format!("timestep={text:?} of {file} is no number"))
                    };
                    let time = tag.get("timestep").map(parse).transpose()?;
                    listed.push(Listed { time, file });
                }
                _ => (),
            },
            Event::End(element) => is_complete |= element.name().as_ref() == b"VTKFile",
            Event::Eof => break,
            _ => (),
        }
    }
    if !is_collection {
        return Err("it holds no <VTKFile type=\"Collection\">".into());
    }
    if !is_complete {
        return Err("the file ends before </VTKFile>: it was cut off".into());
    }
    Ok(listed)
}
