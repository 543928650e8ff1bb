//! Bands of grid rows: how scattering to the grid runs in parallel and still adds in a fixed order.
//!
//! The rows of the grid (nodes that share an index along the last axis) are cut into bands of a height that depends on
//! nothing but the dimension, and every particle belongs to one band. A band writes to its own rows and to at most as
//! many above: only neighbours overlap. They run in parallel, every other one after its two neighbours
//! ([`pieces`](crate::pieces)); within a band particles come in a fixed order. No sum depends on the number of threads.
//! What is to be done with nodes that no band writes to any more is done while they lie in the cache.
//!
//! A piece is higher than a band and its stencils need, so that particles may drift for some steps before all are
//! sorted anew. The order is therefore state of the run: whoever continues a run to the same bits has to carry it over.

use bytemuck::cast_slice_mut;
use rayon::prelude::*;

use crate::grid::{BAND_ROWS, Layout, PAD_BELOW};
use crate::parallel::on_all_threads;
use crate::partition::{Partition, Share};
use crate::pieces::{Pieces, Turns, count};

/// Rows in a band, in two and three dimensions.
const HEIGHT: usize = 8;

/// Rows that a particle may be lower than the band it was sorted into before everything is sorted anew.
const SLACK: usize = 3;

/// In three dimensions, rows of nodes along axis 0 in a strip: with as many layers as a band's stencils reach, the nodes of
/// a strip stay in the cache. In fewer dimensions a band is one strip.
const STRIP: usize = 8;

/// How the rows of a grid are cut into bands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// Rows in a band; the last one has what is left over as well.
    height: usize,
    /// Number of bands.
    bands: usize,
}

impl Cut {
    pub(crate) fn new<const D: usize>(layout: &Layout<D>) -> Self {
        // A row is one node in 1D; bands below some hundred particles would cost more to hand out than to compute.
        let height = if D == 1 { BAND_ROWS } else { HEIGHT };
        Self { height, bands: count(layout.dims[D - 1], height) }
    }

    /// The band of a particle whose stencil begins in a row, when it is sorted.
    fn home(self, row: usize) -> usize {
        (row.saturating_sub(SLACK) / self.height).min(self.bands - 1)
    }

    /// Where the lower edge of a particle's box may be along the last axis, in cells from the lower corner of the grid,
    /// for the particle to stay in its band: from the first value on and below the second, if its stencil has `width`
    /// rows.
    #[inline(always)]
    pub(crate) fn range(self, home: u32, width: usize) -> (f64, f64) {
        let Self { height, bands } = self;
        let first = f64::from(home) * height as f64 - PAD_BELOW as f64;
        // Pieces that reach to the end of the grid take all that is in it.
        let end = if home as usize + 2 < bands {
            first + (2 * height + 1 - width) as f64
        } else {
            f64::INFINITY
        };
        (first, end)
    }
}

/// Particles sorted by band, within each band by strip, and within each strip by number.
///
/// Neighbours mostly have successive numbers, and where they have, what belongs to them lies side by side in memory and is
/// used where it lies. So they are not sorted further.
#[derive(Debug)]
pub(crate) struct Bands {
    cut: Cut,
    /// Band of every particle.
    home: Vec<u32>,
    /// Particle ids, band after band.
    order: Partition,
    /// Room for whose turn it is.
    turns: Turns,
    /// Strips in a band.
    strips: usize,
    /// Scratch of the sort: particles in each strip, then where the next of them goes.
    counts: Vec<u32>,
    /// Scratch of the sort: strip of every particle.
    keys: Vec<u32>,
}

/// What particles give to a piece of the grid: the piece, its first node, and the numbers of the particles.
pub(crate) type Scatter<'a, N> = dyn Fn(&mut [N], usize, &[u32]) + Sync + 'a;

/// What is done with the nodes of a grid, some rows at a time, before and after particles give to them.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a, N> {
    /// With all nodes, before.
    pub(crate) before: &'a (dyn Fn(&mut [N]) + Sync),
    /// With all nodes, after; with the index of the first.
    pub(crate) after: &'a (dyn Fn(&mut [N], usize) + Sync),
}

/// As [`Scatter`] with the band's number, where its particles' elements of three arrays may change.
pub(crate) type Sweep<'a, N, A, B, C> =
    dyn Fn(&mut [N], usize, u32, Share<'_, A, B, C>) + Sync + 'a;

impl Bands {
    /// Prepares for `particles` particles on the grid; `sort` has to follow.
    pub(crate) fn new<const D: usize>(layout: &Layout<D>, particles: usize) -> Self {
        let cut = Cut::new(layout);
        let bands = cut.bands;
        let strips = if D == 3 { layout.dims[1].div_ceil(STRIP) } else { 1 };
        Self {
            cut,
            home: vec![0; particles],
            order: Partition::new(particles, bands),
            turns: Turns::default(),
            strips,
            counts: vec![0; bands * strips + 1],
            keys: vec![0; particles],
        }
    }

    /// How the rows are cut.
    pub(crate) fn cut(&self) -> Cut {
        self.cut
    }

    /// Band of every particle.
    pub(crate) fn home(&self) -> &[u32] {
        &self.home
    }

    /// Whether every particle is in one band: false before the first sort, and where [`state`](Self::state) was
    /// overwritten by what no sort can give.
    pub(crate) fn is_sorted(&mut self) -> bool {
        self.order.is_whole()
    }

    /// What the next steps need of the last sort.
    pub(crate) fn state(&mut self) -> [&mut [u8]; 3] {
        let Self { home, order, .. } = self;
        let (order, starts) = order.arrange();
        [cast_slice_mut(home), cast_slice_mut(order), cast_slice_mut(starts)]
    }

    /// Sorts all particles by the strip of the first node of their stencils, which `first_node(particle)` computes.
    pub(crate) fn sort<const D: usize>(
        &mut self,
        layout: &Layout<D>,
        first_node: &(dyn Fn(usize) -> usize + Sync),
    ) {
        let Self { cut, strips, .. } = *self;
        let (row, line) = (layout.row(), layout.dims[0]);
        self.keys.par_iter_mut().zip(&mut self.home).enumerate().for_each(|(p, (key, home))| {
            let node = first_node(p);
            let band = cut.home(node / row);
            let strip = if D == 3 { node % row / line / STRIP } else { 0 };
            *home = band as u32;
            *key = (band * strips + strip) as u32;
        });
        self.counts.fill(0);
        for &key in &self.keys {
            self.counts[key as usize + 1] += 1;
        }
        for strip in 1..self.counts.len() {
            self.counts[strip] += self.counts[strip - 1];
        }
        let (order, starts) = self.order.arrange();
        for (start, first) in starts.iter_mut().zip(self.counts.iter().step_by(strips)) {
            *start = *first as usize;
        }
        for (p, &key) in self.keys.iter().enumerate() {
            let place = &mut self.counts[key as usize];
            order[*place as usize] = p as u32;
            *place += 1;
        }
    }

    /// Lets every band add to the nodes: `add(piece, first, particles)` with the piece of the node array that it may write
    /// to, the index of that piece's first node, and its particles in order.
    pub(crate) fn scatter<N: Send, const D: usize>(
        &mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        around: Around<'_, N>,
        add: &Scatter<'_, N>,
    ) {
        let Self { cut, order, turns, .. } = self;
        let pieces = Pieces::new(nodes, cut.height * layout.row(), turns);
        each(&pieces, around, &|piece, first, band| {
            if let Some(particles) = order.part(band) {
                add(piece, first, particles);
            }
        });
    }

    /// As [`scatter`](Self::scatter) for bands that may change their own elements of three arrays on the way:
    /// `add(piece, first, band, elements)`. Nothing is called where the bands are not [sorted](Self::is_sorted).
    pub(crate) fn sweep<N, A, B, C, const D: usize>(
        &mut self,
        layout: &Layout<D>,
        nodes: &mut [N],
        around: Around<'_, N>,
        arrays: (&mut [A], &mut [B], &mut [C]),
        add: &Sweep<'_, N, A, B, C>,
    ) where
        N: Send,
        A: Send,
        B: Send,
        C: Send,
    {
        let Self { cut, order, turns, .. } = self;
        let Some(shares) = order.shares(arrays) else {
            debug_assert!(false, "bands that are not sorted");
            return;
        };
        let pieces = Pieces::new(nodes, cut.height * layout.row(), turns);
        each(&pieces, around, &|piece, first, band| {
            if let Some(share) = shares.take(band) {
                add(piece, first, band as u32, share);
            }
        });
    }
}

/// Calls `add(piece, first, band)` for each band.
fn each<N: Send>(
    pieces: &Pieces<'_, N>,
    around: Around<'_, N>,
    add: &(dyn Fn(&mut [N], usize, usize) + Sync),
) {
    on_all_threads(&|thread| {
        while let Some(mut piece) = pieces.take(thread) {
            (around.before)(piece.fresh().0);
            let band = piece.band();
            let (elements, first) = piece.elements();
            add(elements, first, band);
            let (complete, first) = piece.complete();
            if !complete.is_empty() {
                (around.after)(complete, first);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use nalgebra::SVector;

    #[test]
    fn a_band_keeps_particles_whose_stencils_lie_in_its_piece_and_no_others() {
        for height in [8, BAND_ROWS] {
            let cut = Cut { height, bands: 10 };
            for width in [2, 3, 6] {
                for home in [0, 1, 2, 7] {
                    let (first, end) = cut.range(home, width);
                    // Rows of the stencil from the band's first row on; a piece has those of two bands.
                    let rows = |edge: f64| {
                        let row = edge.floor() + PAD_BELOW as f64 - (home as usize * height) as f64;
                        (row, row + width as f64)
                    };
                    let fits =
                        |edge: f64| rows(edge).0 >= 0.0 && rows(edge).1 <= 2.0 * height as f64;
                    for (edge, is_kept) in [
                        (first, true),
                        (first.next_down(), false),
                        (end, false),
                        (end.next_down(), true),
                        (f64::midpoint(first, end), true),
                    ] {
                        assert_eq!(fits(edge), is_kept, "{height} {width} {home}");
                    }
                }
                // The last two pieces reach to the end of the grid.
                for home in [8, 9] {
                    let first = (home as usize * height) as f64 - PAD_BELOW as f64;
                    assert_eq!(cut.range(home, width), (first, f64::INFINITY));
                }
            }
        }
    }

    /// Nodes at which stencils may begin, by a lattice of particles and with some layers left out.
    fn first_nodes<const D: usize>(layout: &Layout<D>) -> Vec<usize> {
        let row = layout.row();
        let last = layout.dims[D - 1] - 6;
        // Numbered from the far end on, so that numbers and places differ in order.
        (0..last * row).rev().filter(|node| node % 3 != 1).collect()
    }

    #[test]
    fn particles_are_sorted_into_bands_with_room_to_drift_both_ways() {
        fn check<const D: usize>(cells: [usize; D]) {
            let grid =
                Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
            let layout = Layout::new(&grid, 8).unwrap();
            let nodes = first_nodes(&layout);
            let mut bands = Bands::new(&layout, nodes.len());
            assert!(!bands.is_sorted());
            bands.sort(&layout, &|p| nodes[p]);
            assert!(bands.is_sorted());
            let mut met = vec![0; nodes.len()];
            let count = bands.cut.bands;
            for band in 0..count {
                let particles = bands.order.part(band).unwrap();
                let (first, end) = bands.cut.range(band as u32, 3);
                let strip = |p: u32| match D {
                    3 => nodes[p as usize] / layout.dims[0] % layout.dims[1] / STRIP,
                    _ => 0,
                };
                let place = |&p: &u32| (strip(p), p);
                assert!(particles.is_sorted_by_key(place), "by strip, then by number");
                for &p in particles {
                    met[p as usize] += 1;
                    assert_eq!(bands.home()[p as usize] as usize, band);
                    let edge = (nodes[p as usize] / layout.row()) as f64 - PAD_BELOW as f64;
                    // At the lower end of the grid there is nowhere to drift to.
                    assert!(band == 0 || edge - SLACK as f64 >= first, "{edge} {first}");
                    assert!(edge + SLACK as f64 + 1.0 <= end, "{edge} {end}");
                }
            }
            assert!(bands.order.part(count).is_none());
            assert!(met.iter().all(|&times| times == 1));
        }
        check([700]);
        check([5, 40]);
        check([4, 30, 25]);
    }

    /// Each band adds to every node of its piece, which is its own rows and as many above; the last one's, and the piece of the
    /// one before, end with the grid.
    #[test]
    fn pieces_are_the_rows_of_a_band_and_of_the_next() {
        fn check<const D: usize>(cells: [usize; D]) {
            let grid =
                Grid { lower: SVector::zeros(), spacing: 1.0, cells, walls: [[false; 2]; D] };
            let layout = Layout::new(&grid, 8).unwrap();
            let mut bands = Bands::new(&layout, 0);
            bands.sort(&layout, &|_| 0);
            let (Cut { height, bands: count }, row) = (bands.cut, layout.row());
            assert_eq!(count, (layout.dims[D - 1] / height).max(1));
            let mut nodes = vec![9; layout.nodes];
            let around = Around {
                before: &|nodes: &mut [i32]| nodes.fill(0),
                after: &|nodes: &mut [i32], first| {
                    assert_eq!(first % row, 0);
                    nodes.iter_mut().for_each(|node| *node += 100);
                },
            };
            bands.scatter(&layout, &mut nodes, around, &|piece, first, _| {
                assert_eq!(first % (height * row), 0);
                assert!(piece.len() == 2 * height * row || first + piece.len() == layout.nodes);
                piece.iter_mut().for_each(|node| *node += 1);
            });
            for (node, &sum) in nodes.iter().enumerate() {
                // The lowest band's rows belong to no other one.
                let lowest = count == 1 || node < height * row;
                assert_eq!(sum, if lowest { 101 } else { 102 }, "{node}");
            }
            let mut seen = vec![0; layout.nodes];
            let empty = (&mut [0_u8; 0][..], &mut [0_u8; 0][..], &mut [0_u8; 0][..]);
            let add = |piece: &mut [i32], first: usize, band: u32, _: Share<'_, u8, u8, u8>| {
                assert_eq!(first, band as usize * height * row);
                assert!((band as usize) < count);
                piece.iter_mut().for_each(|node| *node += 1);
            };
            bands.sweep(&layout, &mut seen, around, empty, &add);
            assert_eq!(seen, nodes);
        }
        check([1100]);
        check([5]);
        check([5, 40]);
        check([5, 1]);
        check([4, 3, 25]);
    }
}
