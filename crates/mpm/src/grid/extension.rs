//! Extended hat functions: nodes that next to nothing of a clipped body reaches take the values that nodes inside of it imply.
//!
//! A clipped body ends anywhere between two lines of the grid. Where it passes one by a little, the nodes beyond have next to no mass and
//! the acceleration of one or two corners, which is wrong by as much as itself. Such *light* nodes `I` get the linear continuation of the
//! values of inner nodes `J` in their place:
//!
//! ```text
//! m_J += sum_I E_IJ m_I,  momentum and force likewise;   grid update of J;   v_I = sum_J E_IJ v_J,  a_I likewise
//! ```
//!
//! The function of `J` is then `N_J + sum_I E_IJ N_I`. `sum_J E_IJ = 1` and `sum_J E_IJ x_J = x_I`: linear functions are continued as such, and
//! mass, momentum and angular momentum stay as they are.
//!
//! Sources: Höllig, Reif and Wipper, SIAM J. Numer. Anal. 39 (2001) 442-462, equations (9) and (10), for the functions; Yamaguchi, Moriguchi
//! and Terada, IJNME 122 (2021) 1576-1603, for the material point method.

use std::ops::Range;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use mmsmith_rare_states::{RareState, met_if};
use mmsmith_threads::parallel::*;

use crate::grid::bins::{AddToWindow, Bins};
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeUpdate};
use crate::grid::node::Node;
use crate::grid::nodes_around::NodesAround;
use crate::grid::{Layout, PAD_BELOW};
use mmsmith_threads::each_chunk;

/// Nodes with less than this share of the mass of a whole cell are light.
///
/// On `ring` the largest error of F has order 1 with a share from 0.006 to 0.02. From 0.05 on functions extend so far that it is larger than
/// without; splines extend so far from 0.01 on, and are left as they are.
const LIGHT: f64 = 0.01;

/// Nodes searched, and rows updated, by a thread at a time.
const NODES: usize = 4096;
const ROWS: usize = 8;

/// Offsets along an axis from a light node to the first node of a pair that it may continue.
const OFFSETS: Range<isize> = -2..2;

/// The light nodes of a grid, and the inner nodes that they continue.
pub(crate) struct Extension<T, const D: usize> {
    /// The mass below which a node is light; in a half plane times its radius.
    least_mass: T,
    is_of_half_plane: bool,
    light: Vec<Light>,
    inner: Vec<Inner<T>>,
    /// Nodes of other processes that light nodes here may continue, or have in common with light nodes there.
    around: NodesAround<T, D>,
}

/// A light node.
struct Light {
    node: usize,
    /// Its place in the list of inner nodes.
    inner: Range<usize>,
}

/// A share of an inner node in a light one.
#[derive(Clone, Copy)]
struct Inner<T> {
    node: usize,
    /// `E_IJ`.
    share: T,
}

impl<T: Lanes, const D: usize> Extension<T, D> {
    /// For cells of the mass `of_cell`; in the half plane of a body of revolution of that mass times their radius.
    pub(crate) fn new(of_cell: T, is_of_half_plane: bool) -> Self {
        let least_mass = of_cell * real(LIGHT);
        let (light, inner, around) = (Vec::new(), Vec::new(), NodesAround::default());
        Self { least_mass, is_of_half_plane, light, inner, around }
    }

    /// Calls `add` for every tile, as [`GridUpdate::p2g`], and updates the nodes, light ones last.
    pub(crate) fn p2g<S: NodeUpdate<T, D>>(
        &mut self,
        grid: &GridUpdate<'_, T, S, D>,
        bins: &mut Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        add: &AddToWindow<'_, Node<T, D>, D>,
    ) {
        grid.sums().p2g(bins, nodes, add);
        let mut around = std::mem::take(&mut self.around);
        around.with((grid.c, grid.layout), bins, nodes, |layout, nodes| {
            self.update(&GridUpdate::new(layout, grid.c, grid.update), nodes);
        });
        self.around = around;
    }

    /// Updates nodes that have all sums.
    fn update<S: NodeUpdate<T, D>>(
        &mut self,
        grid: &GridUpdate<'_, T, S, D>,
        nodes: &mut [Node<T, D>],
    ) {
        let first_row = grid.layout.first_row();
        if grid.update.brings_mass() {
            self.find(grid.c, grid.layout, nodes);
        }
        for Light { node, inner } in &self.light {
            let light = nodes[*node];
            for &Inner { node, share } in &self.inner[inner.clone()] {
                let values = light.values.map(|value| value * share);
                grid.update.add(&mut nodes[node], &Node { values });
            }
        }
        each_chunk(nodes, ROWS * grid.layout.row(), &|chunk, nodes| {
            grid.complete(nodes, first_row + chunk * ROWS);
        });
        for Light { node, inner } in &self.light {
            let mut light = Node::<T, D>::zero().values;
            for &Inner { node, share } in &self.inner[inner.clone()] {
                for (light, value) in light.iter_mut().zip(nodes[node].values) {
                    *light += value * share;
                }
            }
            let own = &mut nodes[*node];
            let light = Node::<T, D> { values: light };
            own.values[..D].copy_from_slice(&light.values[..D]);
            own.second_mut().copy_from_slice(light.second().as_slice());
        }
        grid.on_walls(nodes, first_row);
    }

    /// Finds the light nodes, each with the nearest inner ones that imply its values.
    fn find(&mut self, c: &Constants<T, D>, layout: &Layout<D>, nodes: &[Node<T, D>]) {
        let Self { least_mass, is_of_half_plane, light, inner, .. } = self;
        let least_mass = |node: usize| match is_of_half_plane {
            false => *least_mass,
            // The function of a node on the axis has the mass of a cell with a sixth of the spacing as its radius.
            true => {
                let Range { start, end } = layout.held.0[0];
                let line = (start + node % (end - start)) as f64 - PAD_BELOW as f64;
                let radius = c.lower[0] + c.spacing() * real(line);
                *least_mass * radius.abs().max(c.spacing() * real(1.0 / 6.0))
            }
        };
        let is_inner = |node: usize| nodes[node].mass() >= least_mass(node);
        let is_light = |number: usize, node: &Node<T, D>| {
            node.mass() < least_mass(number) && c.inverse_mass(node) > T::zero()
        };
        let chunks = nodes.par_chunks(NODES).enumerate();
        let found: Vec<usize> = chunks
            .flat_map_iter(|(chunk, nodes)| {
                let numbered = nodes.iter().enumerate();
                let numbered = numbered.map(move |(place, node)| (chunk * NODES + place, node));
                numbered.filter(|(number, node)| is_light(*number, node)).map(|(number, _)| number)
            })
            .collect();
        let dims = layout.held.0.each_ref().map(ExactSizeIterator::len);
        light.clear();
        inner.clear();
        for node in found {
            let at: [usize; D] = std::array::from_fn(|a| node / layout.strides[a] % dims[a]);
            let blocks = |far: usize| -> Vec<_> {
                let blocks = blocks_of::<D>().filter(|block| block.far() == far);
                let nodes = blocks.filter_map(|block| block.nodes((&at, &dims), &layout.strides));
                nodes.filter(|nodes| nodes.clone().all(|(node, _)| is_inner(node))).collect()
            };
            let Some(blocks) = (1..=D).map(blocks).find(|blocks| !blocks.is_empty()) else {
                continue;
            };
            let (start, part) = (inner.len(), real::<T>(1.0 / blocks.len() as f64));
            let nodes = blocks.into_iter().flatten().filter(|(_, share)| *share != 0);
            inner.extend(
                nodes.map(|(node, share)| Inner { node, share: real::<T>(share.into()) * part }),
            );
            light.push(Light { node, inner: start..inner.len() });
        }
        met_if(RareState::LightNode, || !light.is_empty());
    }
}

/// A block of two nodes along each axis, by the offset of its first node from a light one.
#[derive(Clone, Copy, Debug)]
struct Block<const D: usize>([isize; D]);

/// All blocks.
fn blocks_of<const D: usize>() -> impl Iterator<Item = Block<D>> {
    let kinds = OFFSETS.len();
    (0..kinds.pow(D as u32)).map(move |number| {
        Block(std::array::from_fn(|a| {
            OFFSETS.start + (number / kinds.pow(a as u32) % kinds) as isize
        }))
    })
}

impl<const D: usize> Block<D> {
    /// The number of axes along which the light node lies outside of the block.
    fn far(&self) -> usize {
        self.0.iter().filter(|offset| ![-1, 0].contains(*offset)).count()
    }

    /// The nodes of the block and their shares in the light node at `at`, where the grid has them.
    fn nodes(
        self,
        (at, dims): (&[usize; D], &[usize; D]),
        strides: &[usize; D],
    ) -> Option<impl Iterator<Item = (usize, i32)> + Clone> {
        let Self(offsets) = self;
        let mut first = [0; D];
        for a in 0..D {
            first[a] = at[a].checked_add_signed(offsets[a]).filter(|first| first + 1 < dims[a])?;
        }
        let strides = *strides;
        Some((0..1_usize << D).map(move |corner| {
            let (mut node, mut share) = (0, 1);
            for a in 0..D {
                let upper = corner >> a & 1;
                // The light node is this far from the first one of the block.
                let distance = -offsets[a] as i32;
                node += (first[a] + upper) * strides[a];
                share *= if upper == 1 { distance } else { 1 - distance };
            }
            (node, share)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares sum to one and to the light node's place, whatever the block.
    fn check<const D: usize>() {
        let (at, dims) = ([5; D], [9; D]);
        let strides: [usize; D] = std::array::from_fn(|a| 9_usize.pow(a as u32));
        for block in blocks_of::<D>() {
            let nodes: Vec<_> = block.nodes((&at, &dims), &strides).unwrap().collect();
            assert_eq!(nodes.iter().map(|(_, share)| share).sum::<i32>(), 1, "{block:?}");
            for a in 0..D {
                let place = |node: usize| (node / strides[a] % dims[a]) as i32;
                let mean: i32 = nodes.iter().map(|&(node, share)| share * place(node)).sum();
                assert_eq!(mean, 5, "{block:?} along axis {a}");
            }
            let is_of_block =
                nodes.iter().any(|(node, _)| *node == (0..D).map(|a| 5 * strides[a]).sum());
            assert_eq!(is_of_block, block.far() == 0, "{block:?}");
        }
    }

    #[test]
    fn light_nodes_continue_linear_fields() {
        check::<1>();
        check::<2>();
        check::<3>();
    }

    #[test]
    fn blocks_beyond_the_grid_are_none() {
        let block = Block([-2, 0]);
        assert!(block.nodes((&[1, 4], &[9, 9]), &[1, 9]).is_none());
        assert!(block.nodes((&[4, 8], &[9, 9]), &[1, 9]).is_none());
        assert!(block.nodes((&[2, 7], &[9, 9]), &[1, 9]).is_some());
    }
}
