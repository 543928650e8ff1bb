//! Where the arrays of a VTK file are, found without decoding them.

use std::ops::Range;

use super::numbers::{Base64, ByteOrder, Kind, MOST_NUMBERS, Number, Packing, decode, parse};

/// Contents of a file, as places in its bytes.
#[derive(Debug)]
pub(super) struct Contents {
    pub(super) packing: Packing,
    pub(super) appended: Option<Appended>,
    /// Numbers that belong to the file as a whole, such as its time.
    pub(super) fields: Vec<Entry>,
    /// Parts of the cloud of points, in their order.
    pub(super) pieces: Vec<Piece>,
}

/// A part of the particles.
#[derive(Debug)]
pub(super) struct Piece {
    pub(super) particles: usize,
    pub(super) points: Entry,
    pub(super) arrays: Vec<Entry>,
    /// Its cells, kind by kind as files of polygons list them.
    pub(super) cells: Vec<Cells>,
    pub(super) cell_arrays: Vec<Entry>,
}

impl Piece {
    /// The number of its cells.
    pub(super) fn cell_count(&self) -> usize {
        self.cells.iter().map(|cells| cells.count).sum()
    }
}

/// Cells over the points of a piece.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    pub(super) count: usize,
    pub(super) nodes: Nodes,
    pub(super) kinds: Kinds,
}

/// The form in which a file lists the nodes of its cells.
#[derive(Clone, Debug)]
pub(super) enum Nodes {
    /// The number of its nodes stands before the nodes of each cell.
    Counted(Entry),
    /// The end of each cell's nodes.
    Ends { ends: Entry, nodes: Entry },
    /// The start of each cell's nodes, and the number of all nodes.
    Offsets { offsets: Entry, nodes: Entry },
}

/// The place of the kinds of cells, in VTK's numbering.
#[derive(Clone, Debug)]
pub(super) enum Kinds {
    /// In an array.
    Given(Entry),
    /// Points, lines, strips or polygons, by the section of the file.
    Vertices,
    Lines,
    Strips,
    Polygons,
}

/// The data behind all XML elements.
#[derive(Debug)]
pub(super) struct Appended {
    pub(super) is_base64: bool,
    /// The place from which offsets count.
    pub(super) start: usize,
    pub(super) end: usize,
}

/// One array.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) components: usize,
    /// The number of tuples of `components` numbers that the array must have.
    pub(super) tuples: usize,
    pub(super) place: ArrayData,
}

/// The place and form of the numbers of an array.
#[derive(Clone, Debug)]
pub(super) enum ArrayData {
    /// Numbers between blanks.
    Ascii(Range<usize>),
    /// Base64 of header and data.
    Base64(Range<usize>),
    /// The numbers alone, without a header.
    Plain(Range<usize>),
    /// This offset of the appended data.
    Appended(usize),
}

impl Contents {
    /// The numbers of an array.
    pub(super) fn numbers<N: Number>(&self, bytes: &[u8], entry: &Entry) -> Result<Vec<N>, String> {
        let too_many = || {
            format!(
                "its size is {} x {} numbers; at most {MOST_NUMBERS} are read",
                entry.tuples, entry.components
            )
        };
        let count = entry.tuples.checked_mul(entry.components).ok_or_else(too_many)?;
        if count > MOST_NUMBERS {
            return Err(too_many());
        }
        let size = count * entry.kind.size();
        let unpacked = match &entry.place {
            ArrayData::Ascii(range) => return parse(&bytes[range.clone()], count),
            ArrayData::Plain(range) => {
                return decode(&bytes[range.clone()], entry.kind, self.packing.order);
            }
            ArrayData::Base64(range) => self.packing.unpack(
                Base64::new(&bytes[range.clone()]),
                range.len() / 4 * 3,
                size,
            )?,
            ArrayData::Appended(offset) => {
                let appended = self.appended.as_ref().ok_or("the file has no appended data")?;
                let whole = &bytes[appended.start..appended.end];
                let data = whole.get(*offset..).ok_or_else(|| {
                    format!(
                        "it begins at byte {offset} of the appended data, of which there are {}",
                        whole.len()
                    )
                })?;
                if appended.is_base64 {
                    self.packing.unpack(Base64::new(data), data.len() / 4 * 3, size)?
                } else {
                    self.packing.unpack(data, data.len(), size)?
                }
            }
        };
        decode(&unpacked, entry.kind, self.packing.order)
    }
}

impl Packing {
    /// Numbers without any header.
    pub(super) fn plain(order: ByteOrder) -> Self {
        Self { header: 8, order, zlib: false }
    }
}
