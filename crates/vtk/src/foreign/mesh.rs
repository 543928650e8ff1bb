//! Cells over the points of a file: their kinds and nodes.

use super::contents::{Cells, Contents, Kinds, Nodes, Piece};
use super::numbers::to_index;

/// Cells over points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mesh {
    kinds: Vec<u8>,
    /// The start of each cell's nodes, and the number of all nodes.
    offsets: Vec<usize>,
    nodes: Vec<usize>,
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell<'a> {
    /// Its kind, as VTK numbers it: 5 a triangle, 9 a quadrilateral, 10 a tetrahedron, 12 a hexahedron, ...
    pub kind: u8,
    /// The indices of its nodes among the points, in VTK's order.
    pub nodes: &'a [usize],
}

/// Kinds of cells that are points, one or several.
const VERTICES: [u8; 2] = [1, 2];
const LINE: u8 = 3;
const POLY_LINE: u8 = 4;
const TRIANGLE: u8 = 5;
const STRIP: u8 = 6;
const POLYGON: u8 = 7;
const QUADRILATERAL: u8 = 9;

impl Mesh {
    /// The cells, in the order of the file.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = Cell<'_>> {
        self.kinds
            .iter()
            .zip(self.offsets.windows(2))
            .map(|(kind, ends)| Cell { kind: *kind, nodes: &self.nodes[ends[0]..ends[1]] })
    }

    /// Whether the file has cells other than points, so that it holds a mesh and not particles alone.
    #[must_use]
    pub fn has_elements(&self) -> bool {
        self.kinds.iter().any(|kind| !VERTICES.contains(kind))
    }

    /// Reads the cells of a piece whose points come behind `first` other points.
    pub(super) fn append(
        &mut self,
        contents: &Contents,
        bytes: &[u8],
        piece: &Piece,
        first: usize,
    ) -> Result<(), String> {
        if self.offsets.is_empty() {
            self.offsets.push(0);
        }
        for cells in &piece.cells {
            let from = self.offsets.len() - 1;
            self.nodes_of(contents, bytes, cells, piece.particles, first)?;
            self.kinds_of(contents, bytes, cells, from)?;
        }
        Ok(())
    }

    fn nodes_of(
        &mut self,
        contents: &Contents,
        bytes: &[u8],
        cells: &Cells,
        points: usize,
        first: usize,
    ) -> Result<(), String> {
        let read = |entry| -> Result<Vec<usize>, String> {
            contents.numbers::<i64>(bytes, entry)?.into_iter().map(to_index).collect()
        };
        let bounds = |ends: Vec<usize>, nodes: usize| -> Result<Vec<usize>, String> {
            let rises = ends.windows(2).all(|pair| pair[0] <= pair[1]);
            match rises && ends.last().copied().unwrap_or(0) <= nodes {
                true => Ok(ends),
                false => {
                    Err("the offsets of its cells do not rise, or exceed the list of nodes".into())
                }
            }
        };
        let (ends, nodes): (Vec<usize>, Vec<usize>) = match &cells.nodes {
            Nodes::Counted(entry) => counted(&read(entry)?, cells.count)?,
            Nodes::Ends { ends, nodes } => {
                let ends = read(ends)?;
                let count = ends.last().copied().unwrap_or(0);
                let entry =
                    super::contents::Entry { tuples: count, components: 1, ..nodes.clone() };
                (bounds(ends, count)?, read(&entry)?)
            }
            Nodes::Offsets { offsets, nodes } => {
                let nodes = read(nodes)?;
                let mut offsets = bounds(read(offsets)?, nodes.len())?;
                if !offsets.is_empty() {
                    offsets.remove(0);
                }
                (offsets, nodes)
            }
        };
        if let Some(node) = nodes.iter().find(|node| **node >= points) {
            return Err(format!("a cell has the node {node}, and there are {points} points"));
        }
        let base = self.nodes.len();
        self.offsets.extend(ends.into_iter().map(|end| base + end));
        self.nodes.extend(nodes.into_iter().map(|node| first + node));
        Ok(())
    }

    fn kinds_of(
        &mut self,
        contents: &Contents,
        bytes: &[u8],
        cells: &Cells,
        from: usize,
    ) -> Result<(), String> {
        if let Kinds::Given(entry) = &cells.kinds {
            for kind in contents.numbers::<i64>(bytes, entry)? {
                self.kinds
                    .push(u8::try_from(kind).map_err(|_| format!("{kind} is no kind of cell"))?);
            }
            return Ok(());
        }
        let kind = |ends: &[usize]| match (&cells.kinds, ends[1] - ends[0]) {
            (Kinds::Vertices, 1) => VERTICES[0],
            (Kinds::Vertices, _) => VERTICES[1],
            (Kinds::Lines, 2) => LINE,
            (Kinds::Lines, _) => POLY_LINE,
            (Kinds::Strips, _) => STRIP,
            (_, 3) => TRIANGLE,
            (_, 4) => QUADRILATERAL,
            _ => POLYGON,
        };
        self.kinds.extend(self.offsets[from..].windows(2).map(kind));
        Ok(())
    }
}

/// Reads a list in which each cell's nodes follow their number: the ends and the nodes of the cells.
fn counted(list: &[usize], cells: usize) -> Result<(Vec<usize>, Vec<usize>), String> {
    let (mut ends, mut nodes, mut rest) = (vec![], vec![], list);
    while let Some((count, after)) = rest.split_first() {
        if *count > after.len() {
            return Err(format!("a cell has {count} nodes, and {} numbers are left", after.len()));
        }
        nodes.extend_from_slice(&after[..*count]);
        ends.push(nodes.len());
        rest = &after[*count..];
    }
    match ends.len() == cells {
        true => Ok((ends, nodes)),
        false => Err(format!("it lists {} cells where it declares {cells}", ends.len())),
    }
}
