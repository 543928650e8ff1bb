//! The cells of a mesh.

use super::contents::{Contents, Entry};

/// The cells of a mesh: VTK's number of each, and its nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cells {
    types: Vec<u8>,
    /// Where the nodes of each end.
    ends: Vec<usize>,
    nodes: Vec<usize>,
}

impl Cells {
    /// VTK's number of each cell, such as 9 for a quadrilateral, and the numbers of its nodes.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &[usize])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let of = |(kind, (start, end)): (&u8, (usize, &usize))| (*kind, &self.nodes[start..*end]);
        self.types.iter().zip(starts.zip(&self.ends)).map(of)
    }

    /// Adds the cells of a piece whose nodes are counted from `first` on; nothing where they are damaged.
    pub(super) fn extend(
        &mut self,
        contents: &Contents,
        bytes: &[u8],
        entries: &CellEntries,
        first: usize,
    ) -> Option<()> {
        let whole = |entry: &Entry| -> Option<Vec<usize>> {
            let numbers = contents.numbers::<i64>(bytes, entry).ok()?;
            numbers.into_iter().map(|number| usize::try_from(number).ok()).collect()
        };
        let types = contents.numbers::<i64>(bytes, entries.types.as_ref()?).ok()?;
        let (mut ends, nodes) = match (&entries.ends, entries.nodes.as_ref()?) {
            (Some(ends), nodes) => {
                let mut ends = whole(ends)?;
                // Version 5 of the old form begins with zero.
                if ends.len() == types.len() + 1 && ends.first() == Some(&0) {
                    ends.remove(0);
                }
                let count = ends.last().copied().unwrap_or(0);
                (ends, whole(&Entry { tuples: count, ..nodes.clone() })?)
            }
            (None, counted) => uncounted(&whole(counted)?)?,
        };
        let is_whole = ends.len() == types.len()
            && ends.is_sorted()
            && ends.last().copied().unwrap_or(0) == nodes.len();
        if !is_whole {
            return None;
        }
        let before = self.nodes.len();
        ends.iter_mut().for_each(|end| *end += before);
        self.ends.extend(ends);
        self.types.extend(types.into_iter().map(|kind| u8::try_from(kind).unwrap_or(u8::MAX)));
        self.nodes.extend(nodes.into_iter().map(|node| node.saturating_add(first)));
        Some(())
    }
}

/// The ends and the nodes of cells that each begin with the count of their nodes.
fn uncounted(counted: &[usize]) -> Option<(Vec<usize>, Vec<usize>)> {
    let (mut ends, mut nodes) = (vec![], vec![]);
    let mut rest = counted;
    while let Some((count, after)) = rest.split_first() {
        nodes.extend_from_slice(after.get(..*count)?);
        ends.push(nodes.len());
        rest = &after[*count..];
    }
    Some((ends, nodes))
}

/// Where the arrays of cells are.
#[derive(Clone, Debug, Default)]
pub(super) struct CellEntries {
    pub(super) types: Option<Entry>,
    /// Where the nodes of each cell end; nothing where counts stand among the nodes.
    pub(super) ends: Option<Entry>,
    pub(super) nodes: Option<Entry>,
}
