//! Series of grids whose cells are not refined as their spacings tell.

use mmsmith_runtime::{AnySolution, Domain, Solution};

use crate::dimension::in_dimension;
use crate::scene::whole_cells;

/// The part of an order that uneven counts may hide or add, beyond which a series of grids tells none.
const UNEVEN: f64 = 0.025;
/// Doublings of a series that is advised.
const DOUBLINGS: u32 = 2;
/// How far such a series is looked for.
const MOST_CELLS: usize = 1000;

/// A length of a curved body along which whole cells of at most the spacing are laid.
struct Length {
    /// Its coordinate.
    name: &'static str,
    /// In cell lengths of the solution.
    cells: f64,
}

impl Length {
    /// The number of cells on a grid of so many cells to a cell length.
    fn count(&self, cells: usize) -> usize {
        whole_cells(self.cells, 1.0 / cells as f64)
    }

    /// Whether twice the cells to a cell length are twice the cells along this length, again and again.
    fn doubles(&self, cells: usize) -> bool {
        let first = self.count(cells);
        (1..=DOUBLINGS).all(|k| self.count(cells << k) == first << k)
    }
}

/// Lengths of a body whose cells are counted apart in the total Lagrangian formulation; none of a box, which spacings divide.
fn lengths<const D: usize>(solution: &dyn Solution<f64, D>) -> Vec<Length> {
    let length = |name, length: f64| Length { name, cells: length / solution.cell_length() };
    match solution.domain() {
        Domain::Annulus { inner, outer } => vec![length("R", outer - inner)],
        Domain::Tube { inner, outer, lower, upper, .. } => {
            vec![length("R", outer - inner), length("Z", upper - lower)]
        }
        _ => Vec::new(),
    }
}

/// Why no order follows from runs of the total Lagrangian formulation on grids with these cell counts, with counts that tell one; `None` where
/// cells are refined as spacings are.
///
/// Whole cells fill a curved body, none longer than the spacing. Where that rounds counts up, the cells along one coordinate are refined by
/// another ratio than those along the others.
#[must_use]
pub fn uneven_refinement(exact: &AnySolution<f64>, cells: &[usize]) -> Option<String> {
    let lengths = in_dimension!(exact, |s| lengths(s), else Vec::new());
    let mut cells = cells.to_vec();
    cells.sort_unstable();
    cells.dedup();
    let is_uneven = |length: &&Length| {
        cells.windows(2).any(|pair| {
            let spacings = (pair[1] as f64 / pair[0] as f64).ln();
            let own = (length.count(pair[1]) as f64 / length.count(pair[0]) as f64).ln();
            (own - spacings).abs() > UNEVEN * spacings
        })
    };
    let length = lengths.iter().find(is_uneven)?;
    let list = |all: &mut dyn Iterator<Item = usize>| {
        all.map(|count| count.to_string()).collect::<Vec<_>>()
    };
    let counts = list(&mut cells.iter().map(|cells| length.count(*cells))).join(", ");
    let nominal: Vec<String> =
        cells.iter().map(|count| format!("{:.3}", length.cells * *count as f64)).collect();
    let advice = (cells[0]..MOST_CELLS)
        .find(|first| lengths.iter().all(|length| length.doubles(*first)))
        .map(|first| {
            let series = list(&mut (0..=DOUBLINGS).map(|k| first << k)).join(",");
            format!(" With --cells {series} they are.")
        });
    Some(format!(
        "Orders are not judged: the body has {counts} cells along {} on these grids, where their spacings tell {}, since whole cells fill it; so the \
         coordinates are not refined alike.{}",
        length.name,
        nominal.join(", "),
        advice.unwrap_or_default()
    ))
}
