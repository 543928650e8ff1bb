//! Growth of volume from the velocities of the grid, and the forces of mean stresses that go with it.
//!
//! Nodes have the growth of volume as a field of its own, `e = sum_j e_j N_j` with multilinear `N_j`, which equals the divergence of the
//! velocity in the mean over each `N_j`. A particle's projected change of volume `theta` follows it:
//!
//! ```text
//! e_j = dt sum_ic w_c C_ij v_i / W_j;   C_ij = mean over the cell c of N_j grad N_i, W_j = sum_c w_c / 2^D;   theta_p <- theta_p (1 + sum_j S_jp (K e)_j)
//! ```
//!
//! (beside it the terms of `det(I + dt L) - 1` of higher order, by the gradient `L` at the centre of a cell, as F has them.) The forces are adjoint to
//! that, so that they do the work of the mean stress: with the mean Kirchhoff stress `m` of a particle
//!
//! ```text
//! Q_j = sum_p V0_p m_p S_jp;   f_i = -sum_jc w_c C_ij (K Q)_j / W_j
//! ```
//!
//! There is a condition on the volume for each node, where each particle would have its own: next to incompressibility few velocities keep
//! those of particles. The weight `w_c` falls to zero with the least mass of the nodes of cell `c`, so that accelerations of nodes at free
//! sides, where next to no mass is, stay bounded. `K` adds a share of the differences to neighbouring nodes: means over `N_j` smooth a field by
//! `h^2/6` of its second derivatives, and `K` takes that back.
//!
//! Sources: Simo, Taylor & Pister, CMAME 51 (1985) 177-208, for a volume of its own and the forces that belong to it; Brezzi & Fortin, "Mixed and
//! hybrid finite element methods" (1991), for pressures and velocities at the same nodes. That particles keep the volume, the weights and `K` are
//! this crate's own.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::{determinant, real};
use mmsmith_threads::each_chunk;
use nalgebra::SMatrix;

use crate::grid::bins::{AddToWindow, Bins};
use crate::grid::geometry::Constants;
use crate::grid::grid_update::{GridUpdate, NodeUpdate};
use crate::grid::node::Node;
use crate::grid::nodes_around::NodesAround;
use crate::grid::{Layout, NODES_AT_ONCE};

/// The share of a whole cell's mass from which on a node does not lessen the weight of its cells.
const LEAST_SHARE: f64 = 0.25;

/// The share of the differences to neighbouring nodes that `K` adds.
const SHARPENING: f64 = 1.0 / 6.0;

/// Corners of a cell in space.
const MOST_CORNERS: usize = 8;

/// Weights of cells, and buffers. The number of a cell stands in the place of its lowest node.
pub(crate) struct VolumeRates<T, const D: usize> {
    mass_of_cell: T,
    /// `w_c`, at most one.
    weights: Vec<T>,
    /// `W_j` of each node, at most one.
    shares: Vec<T>,
    /// One over it; zero where no cell has a weight.
    inverse: Vec<T>,
    /// Numbers of nodes, before and after `K`.
    plain: Vec<T>,
    sharpened: Vec<T>,
    /// Numbers of cells.
    cells: Vec<T>,
    /// A vector of each node, component by component.
    vectors: [Vec<T>; D],
    /// Nodes of other processes that nodes here depend on: those of the cells at a node, of their neighbours, and of the nodes whose mirror image
    /// these are.
    around: NodesAround<T, D>,
}

/// The grid as passes over its nodes see it.
#[derive(Clone, Copy)]
struct Place<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    layout: &'a Layout<D>,
}

impl<T: Lanes, const D: usize> VolumeRates<T, D> {
    /// For cells of this mass.
    pub(crate) fn new(mass_of_cell: T) -> Self {
        let none = Vec::new;
        let (weights, shares, inverse) = (none(), none(), none());
        let (plain, sharpened, cells) = (none(), none(), none());
        let vectors = std::array::from_fn(|_| Vec::new());
        let around = NodesAround::default();
        Self { mass_of_cell, weights, shares, inverse, plain, sharpened, cells, vectors, around }
    }

    /// Calls `add` for every tile, as [`GridUpdate::p2g`], adds the forces of the mean stresses, which are in the nodes' scalars, and updates
    /// the nodes.
    pub(crate) fn p2g<S: NodeUpdate<T, D>>(
        &mut self,
        grid: &GridUpdate<'_, T, S, D>,
        bins: &mut Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        add: &AddToWindow<'_, Node<T, D>, D>,
    ) {
        grid.sums().p2g(bins, nodes, add);
        self.update(grid, bins, nodes);
    }

    /// The update after sums alone: see [`p2g`](Self::p2g).
    pub(crate) fn update<S: NodeUpdate<T, D>>(
        &mut self,
        grid: &GridUpdate<'_, T, S, D>,
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
    ) {
        self.with_nodes_around((grid.c, grid.layout), bins, nodes, |own, place, nodes| {
            own.weigh(place, nodes);
            own.add_forces(place, nodes);
            let layout = place.layout;
            let (grid, at_once) =
                (GridUpdate::new(layout, grid.c, grid.update), layout.rows_at_once());
            each_chunk(nodes, at_once * layout.row(), &|chunk, nodes| {
                grid.complete(nodes, layout.first_row() + chunk * at_once);
            });
            place.mirror(nodes);
        });
    }

    /// Sets the scalars of nodes to their growth `K e` in a time, by the velocities of these nodes, and the weights of the last masses.
    pub(crate) fn set(
        &mut self,
        grid: (&Constants<T, D>, &Layout<D>),
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        time: T,
    ) {
        self.with_nodes_around(grid, bins, nodes, |own, place, nodes| {
            own.set_growth(place, nodes, time);
            place.mirror(nodes);
        });
    }

    /// Weights of the masses that nodes have.
    pub(crate) fn weigh_all(
        &mut self,
        grid: (&Constants<T, D>, &Layout<D>),
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
    ) {
        self.with_nodes_around(grid, bins, nodes, Self::weigh);
    }

    /// Calls `work` with all nodes here, and where there are other processes with some of their nodes around them.
    fn with_nodes_around(
        &mut self,
        (c, layout): (&Constants<T, D>, &Layout<D>),
        bins: &Bins<Node<T, D>, D>,
        nodes: &mut [Node<T, D>],
        work: impl FnOnce(&mut Self, Place<'_, T, D>, &mut [Node<T, D>]),
    ) {
        let mut around = std::mem::take(&mut self.around);
        around.with((c, layout), bins, nodes, |layout, nodes| {
            work(self, Place { c, layout }, nodes);
        });
        self.around = around;
    }

    /// Sets the weights of cells.
    fn weigh(&mut self, place: Place<'_, T, D>, nodes: &mut [Node<T, D>]) {
        let Self { mass_of_cell, weights, shares, inverse, plain: masses, .. } = self;
        let (corners, count) = (place.corners(), nodes.len());
        for numbers in [&mut *weights, &mut *shares, &mut *inverse, &mut *masses] {
            numbers.resize(count, T::zero());
        }
        let nodes = &*nodes;
        each_chunk(masses, NODES_AT_ONCE, &|chunk, masses| {
            for (mass, node) in masses.iter_mut().zip(&nodes[chunk * NODES_AT_ONCE..]) {
                let is_empty = place.c.inverse_mass(node) == T::zero();
                *mass = if is_empty { T::zero() } else { node.mass() };
            }
        });
        let masses = &*masses;
        let enough = *mass_of_cell * real(LEAST_SHARE);
        let per_mass = enough.recip();
        each_chunk(weights, NODES_AT_ONCE, &|chunk, weights| {
            let first = chunk * NODES_AT_ONCE;
            weights.fill(enough);
            for corner in corners.iter().take(1 << D) {
                let masses = masses.get(first + corner..).unwrap_or_default();
                for (least, mass) in weights.iter_mut().zip(masses) {
                    *least = if *mass < *least { *mass } else { *least };
                }
                // The last nodes are the lowest of no cell.
                weights.iter_mut().skip(masses.len()).for_each(|least| *least = T::zero());
            }
            for weight in weights {
                *weight = if *weight < enough { *weight * per_mass } else { T::one() };
            }
        });
        for a in 0..D - 1 {
            let (stride, dim) = (place.layout.strides[a], place.layout.held.0[a].len());
            for slab in weights.chunks_exact_mut(stride * dim) {
                slab[stride * (dim - 1)..].fill(T::zero());
            }
        }
        let weights = &*weights;
        each_chunk(shares, NODES_AT_ONCE, &|chunk, shares| {
            place.mean_around((chunk * NODES_AT_ONCE, weights), shares);
        });
        for (inverse, share) in inverse.iter_mut().zip(&*shares) {
            *inverse = if *share > T::zero() { share.recip() } else { T::zero() };
        }
    }

    /// Adds the forces of the mean stresses, whose sums are the scalars of nodes, to the nodes.
    fn add_forces(&mut self, place: Place<'_, T, D>, nodes: &mut [Node<T, D>]) {
        for (own, node) in self.plain.iter_mut().zip(&*nodes) {
            *own = node.scalar();
        }
        self.sharpen(place);
        let Self { weights, inverse, sharpened: mean, vectors, .. } = self;
        for (mean, inverse) in mean.iter_mut().zip(&*inverse) {
            *mean *= *inverse;
        }
        let (weights, inverse, mean) = (&*weights, &*inverse, &*mean);
        let (corners, stencil, scale) = (place.corners(), place.stencil(), place.c.inverse_spacing);
        for (a, forces) in vectors.iter_mut().enumerate() {
            forces.resize(nodes.len(), T::zero());
            each_chunk(forces, NODES_AT_ONCE, &|chunk, forces| {
                forces.fill(T::zero());
                stencil.add_slopes(a, (chunk * NODES_AT_ONCE, mean), forces);
            });
        }
        let forces = &*vectors;
        each_chunk(nodes, NODES_AT_ONCE, &|chunk, nodes| {
            let first = chunk * NODES_AT_ONCE;
            for (n, node) in nodes.iter_mut().enumerate() {
                let own = first + n;
                if inverse[own] == T::zero() {
                    continue;
                }
                let mut force: [T; D] = std::array::from_fn(|a| forces[a][own]);
                if inverse[own] != T::one() {
                    force = [T::zero(); D];
                    for (i, cell) in place.cells_at(&corners, own) {
                        for (j, offset) in corners.iter().enumerate().take(1 << D) {
                            let Some(mean) = mean.get(cell + offset) else { continue };
                            for (a, force) in force.iter_mut().enumerate() {
                                *force -= weights[cell] * *mean * coefficient::<T, D>(i, j, a);
                            }
                        }
                    }
                }
                for (own, force) in node.second_mut().iter_mut().zip(force) {
                    *own += force * scale;
                }
            }
        });
    }

    /// Sets the growth of nodes in a time.
    fn set_growth(&mut self, place: Place<'_, T, D>, nodes: &mut [Node<T, D>], time: T) {
        let (corners, stencil) = (place.corners(), place.stencil());
        let scale = place.c.inverse_spacing * time;
        let Self { weights, inverse, cells, plain, vectors, .. } = self;
        cells.resize(nodes.len(), T::zero());
        for (a, own) in vectors.iter_mut().enumerate() {
            own.clear();
            own.extend(nodes.iter().map(|node| node.values[a]));
        }
        let (weights, inverse, v) = (&*weights, &*inverse, &*vectors);
        // Terms of higher order, times the weights.
        let at_centre = scale * real(1.0 / (1 << (D - 1)) as f64);
        let last: usize = place.layout.strides.iter().sum();
        if D > 1 {
            each_chunk(cells, NODES_AT_ONCE, &|chunk, cells| {
                let first = chunk * NODES_AT_ONCE;
                cells.fill(T::zero());
                let count = cells.len().min(nodes.len().saturating_sub(first + last));
                // The last nodes are the lowest of no cell.
                if count == 0 {
                    return;
                }
                let at: [[&[T]; MOST_CORNERS]; D] =
                    std::array::from_fn(|i| corners.map(|offset| &v[i][first + offset..][..count]));
                let weights = &weights[first..][..count];
                for (n, cell) in cells[..count].iter_mut().enumerate() {
                    let mut L = SMatrix::<T, D, D>::zeros();
                    for i in 0..D {
                        for a in 0..D {
                            let mut sum = T::zero();
                            for corner in 0..1 << D {
                                let own = at[i][corner][n];
                                sum = if corner >> a & 1 == 1 { sum + own } else { sum - own };
                            }
                            L[(i, a)] = sum * at_centre;
                        }
                    }
                    let trace = L.trace();
                    let growth = determinant(&(L + SMatrix::identity())) - T::one() - trace;
                    *cell = growth * weights[n];
                }
            });
        }
        let cells = &*cells;
        each_chunk(plain, NODES_AT_ONCE, &|chunk, growth| {
            let first = chunk * NODES_AT_ONCE;
            place.mean_around((first, cells), growth);
            let mut divergence = [T::zero(); NODES_AT_ONCE];
            let divergence = &mut divergence[..growth.len()];
            for (a, v) in v.iter().enumerate() {
                stencil.add_slopes(a, (first, v), divergence);
            }
            for (n, (growth, divergence)) in growth.iter_mut().zip(divergence).enumerate() {
                let own = first + n;
                if inverse[own] != T::one() {
                    *divergence = T::zero();
                    for (j, cell) in place.cells_at(&corners, own) {
                        if weights[cell] == T::zero() {
                            continue;
                        }
                        for (i, offset) in corners.iter().enumerate().take(1 << D) {
                            for (a, v) in v.iter().enumerate() {
                                *divergence +=
                                    weights[cell] * v[cell + offset] * coefficient::<T, D>(i, j, a);
                            }
                        }
                    }
                }
                *growth = (*divergence * scale + *growth) * inverse[own];
            }
        });
        self.sharpen(place);
        for (node, growth) in nodes.iter_mut().zip(&self.sharpened) {
            *node.scalar_mut() = *growth;
        }
    }

    /// `K` of the numbers of nodes.
    fn sharpen(&mut self, place: Place<'_, T, D>) {
        let Self { shares, plain, sharpened, .. } = self;
        sharpened.resize(plain.len(), T::zero());
        let (shares, plain) = (&*shares, &*plain);
        let share = real::<T>(SHARPENING);
        each_chunk(sharpened, NODES_AT_ONCE, &|chunk, sharpened| {
            let first = chunk * NODES_AT_ONCE;
            sharpened.copy_from_slice(&plain[first..first + sharpened.len()]);
            let end = first + sharpened.len();
            for stride in place.layout.strides {
                // Each with the node below it, and with the node above it.
                let from = first.max(stride);
                if from < end {
                    let others = (&shares[from - stride..], &plain[from - stride..]);
                    let own = (&shares[from..], &plain[from..]);
                    add_differences(share, &mut sharpened[from - first..], own, others);
                }
                let to = end.min(plain.len().saturating_sub(stride));
                if first < to {
                    let others = (&shares[first + stride..], &plain[first + stride..]);
                    let own = (&shares[first..], &plain[first..]);
                    add_differences(share, &mut sharpened[..to - first], own, others);
                }
            }
        });
    }
}

/// Adds shares of the differences to other nodes, weighted with the lesser share of the two.
fn add_differences<T: Lanes>(
    share: T,
    sums: &mut [T],
    (own_shares, own): (&[T], &[T]),
    (other_shares, others): (&[T], &[T]),
) {
    let shares = own_shares.iter().zip(other_shares);
    for (((sum, own), other), (a, b)) in sums.iter_mut().zip(own).zip(others).zip(shares) {
        let weight = if *a < *b { *a } else { *b };
        *sum += weight * (*own - *other) * share;
    }
}

/// The mean over a cell of `N_j dN_i/dx_a`, in cells, for two of its corners.
fn coefficient<T: Lanes, const D: usize>(i: usize, j: usize, a: usize) -> T {
    let is_same = |axis: usize| (i ^ j) >> axis & 1 == 0;
    let others = (0..D).filter(|axis| *axis != a);
    let across: f64 =
        others.map(|axis| if is_same(axis) { 1.0 / 3.0 } else { 1.0 / 6.0 }).product();
    real(if i >> a & 1 == 1 { 0.5 * across } else { -0.5 * across })
}

/// Slopes along an axis where all cells around a node have the weight one, with the means of `N_j` across it.
struct Stencil<T, const D: usize> {
    strides: [usize; D],
    /// Nodes across each axis, from the first of them on, and their shares.
    across: [[(usize, T); 9]; D],
    count: usize,
    /// From a node to the first of those.
    first: [usize; D],
}

impl<T: Lanes, const D: usize> Stencil<T, D> {
    /// Adds the slopes of values along an axis to the sums of the nodes from the node `first` on; nothing at the first and last nodes.
    fn add_slopes(&self, a: usize, (first, values): (usize, &[T]), sums: &mut [T]) {
        let stride = self.strides[a];
        let around = self.first[a] + stride;
        let (from, to) =
            (first.max(around), (first + sums.len()).min(values.len().saturating_sub(around)));
        if from >= to {
            return;
        }
        let sums = &mut sums[from - first..to - first];
        for &(offset, share) in &self.across[a][..self.count] {
            let centre = from - self.first[a] + offset;
            let (above, below) = (&values[centre + stride..], &values[centre - stride..]);
            for ((sum, above), below) in sums.iter_mut().zip(above).zip(below) {
                *sum += (*above - *below) * share;
            }
        }
    }
}

impl<T: Lanes, const D: usize> Place<'_, T, D> {
    /// From the lowest node of a cell to its corners: bit `a` of the number of a corner tells its end along axis `a`.
    fn corners(&self) -> [usize; MOST_CORNERS] {
        std::array::from_fn(|corner| {
            (0..D).filter(|a| corner >> a & 1 == 1).map(|a| self.layout.strides[a]).sum()
        })
    }

    /// The cells at a node, each with the number of the corner that the node is.
    fn cells_at<'b>(
        &self,
        corners: &'b [usize; MOST_CORNERS],
        node: usize,
    ) -> impl Iterator<Item = (usize, usize)> + 'b {
        let numbered = corners.iter().enumerate().take(1 << D);
        numbered.filter_map(move |(corner, offset)| Some((corner, node.checked_sub(*offset)?)))
    }

    /// Means of the numbers of the cells at each node, from the node `first` on.
    fn mean_around(&self, (first, of_cells): (usize, &[T]), means: &mut [T]) {
        means.fill(T::zero());
        for offset in self.corners().iter().take(1 << D) {
            // The first nodes have no cells below them.
            let without = offset.saturating_sub(first);
            let of_cells = &of_cells[(first + without) - offset..];
            means.iter_mut().skip(without).zip(of_cells).for_each(|(mean, cell)| *mean += *cell);
        }
        let share = real::<T>(1.0 / (1 << D) as f64);
        means.iter_mut().for_each(|mean| *mean *= share);
    }

    fn stencil(&self) -> Stencil<T, D> {
        let strides = self.layout.strides;
        let mut across = [[(0, T::zero()); 9]; D];
        let mut first = [0; D];
        for a in 0..D {
            let others: Vec<usize> = (0..D).filter(|axis| *axis != a).collect();
            first[a] = others.iter().map(|axis| strides[*axis]).sum();
            for (number, own) in across[a].iter_mut().enumerate() {
                let (mut offset, mut share, mut rest) = (0, 0.5, number);
                for axis in &others {
                    let place = rest % 3;
                    rest /= 3;
                    offset += place * strides[*axis];
                    share *= if place == 1 { 2.0 / 3.0 } else { 1.0 / 6.0 };
                }
                *own = (offset, real(share));
            }
        }
        Stencil { strides, across, count: 3_usize.pow(D as u32 - 1), first }
    }

    /// Sets ghost nodes to the mirror images.
    fn mirror(&self, nodes: &mut [Node<T, D>]) {
        let &Self { layout, .. } = self;
        let mirrored = |node: Node<T, D>, flip| node.flipped(flip);
        layout.unfold_rows(nodes, &mirrored);
        let rows = layout.rows();
        for edge in layout.edges() {
            if !edge.is_empty() && rows.start <= edge.start && edge.end <= rows.end {
                layout.unfold_edge(&edge, rows.start, nodes, &mirrored);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::PAD_BELOW;
    use crate::grid::tiles::Tiles;
    use mmsmith_particles::Grid;
    use nalgebra::SVector;

    /// A number between zero and one for each place.
    fn noise(n: usize) -> f64 {
        ((n * 8 + 3) as f64 * 0.7).sin().abs()
    }

    /// Rates after weights of these masses of nodes, by their numbers and their places.
    fn weighed<const D: usize>(
        cells: [usize; D],
        mass: impl Fn(usize, [usize; D]) -> f64,
        work: impl FnOnce(&mut VolumeRates<f64, D>, Place<'_, f64, D>, &mut Vec<Node<f64, D>>),
    ) {
        let grid = Grid { lower: SVector::zeros(), spacing: 0.5, cells, walls: [[false; 2]; D] };
        let layout = Layout::new(&grid, 8).unwrap();
        let tiles = Tiles::new(&layout, &cells, 3);
        let c = &Constants::new(&grid, &layout, &tiles, 0.1, 1.0);
        let mut nodes = vec![Node::<f64, D>::zero(); layout.nodes];
        for (n, node) in nodes.iter_mut().enumerate() {
            let at: [usize; D] = std::array::from_fn(|a| n / layout.strides[a] % layout.dims[a]);
            if (0..D).all(|a| at[a] >= PAD_BELOW && at[a] <= PAD_BELOW + cells[a]) {
                node.values[Node::<f64, D>::MASS] = mass(n, at.map(|at| at - PAD_BELOW));
            }
        }
        let mut rates = VolumeRates::new(4.0);
        let place = Place { c, layout: &layout };
        rates.weigh(place, &mut nodes);
        work(&mut rates, place, &mut nodes);
    }

    /// A grid of a few cells.
    fn small<const D: usize>() -> [usize; D] {
        std::array::from_fn(|a| [7, 6, 5][a])
    }

    /// Masses that differ from node to node, some of them next to nothing, and none at many.
    fn uneven<const D: usize>(n: usize, _: [usize; D]) -> f64 {
        match n {
            n if n % 11 == 4 => 0.0,
            n if n % 7 == 2 => 1e-9 * noise(n),
            n => 3.0 * noise(n),
        }
    }

    fn linear_velocities<const D: usize>(cells: [usize; D]) {
        weighed::<D>(cells, uneven, |rates, place, nodes| {
            let L = SMatrix::<f64, D, D>::from_fn(|i, j| 0.3 * (i as f64 - 1.4 * j as f64) + 0.2);
            for (n, node) in nodes.iter_mut().enumerate() {
                let x = SVector::from_fn(|a, _| {
                    0.5 * (n / place.layout.strides[a] % place.layout.dims[a]) as f64
                });
                let v = L * x;
                node.values[..D].copy_from_slice(v.as_slice());
            }
            let expected = determinant(&(SMatrix::identity() + L * 0.1)) - 1.0;
            rates.set_growth(place, nodes, 0.1);
            let mut met = 0;
            for (node, share) in nodes.iter().zip(&rates.shares) {
                let own = if *share > 0.0 { expected } else { 0.0 };
                met += usize::from(*share > 0.0);
                // A share of next to nothing is the difference of others'.
                assert!((node.scalar() - own).abs() < 1e-12, "{} for {own}", node.scalar());
            }
            assert!(met > 5);
        });
    }

    #[test]
    fn linear_velocities_give_each_node_the_growth_of_the_whole_body() {
        linear_velocities::<1>(small());
        linear_velocities::<2>(small());
        linear_velocities::<3>(small());
        // Many layers of nodes, the last of which are a piece of work with fewer nodes than a layer has, or with more.
        for layers in 1..8 {
            linear_velocities([23, 22, layers]);
        }
    }

    /// To first order in the velocities, the power of the forces is that of the mean stresses.
    fn power<const D: usize>() {
        weighed::<D>(small(), uneven, |rates, place, nodes| {
            let small = 1e-7;
            for (n, node) in nodes.iter_mut().enumerate() {
                for a in 0..D {
                    node.values[a] = small * (noise(n + 31 * a) - 0.5);
                }
            }
            let mut forced = nodes.clone();
            let sums = |n: usize| if rates.shares[n] > 0.0 { noise(n + 77) - 0.5 } else { 0.0 };
            let sums: Vec<f64> = (0..nodes.len()).map(sums).collect();
            for (node, sum) in forced.iter_mut().zip(&sums) {
                *node.scalar_mut() = *sum;
            }
            rates.add_forces(place, &mut forced);
            rates.set_growth(place, nodes, 1.0);
            let of_stress: f64 =
                nodes.iter().zip(&sums).map(|(node, sum)| node.scalar() * sum).sum();
            let of_forces = |node: &Node<f64, D>| -> f64 {
                (0..D).map(|a| node.values[a] * node.second()[a]).sum()
            };
            let of_forces: f64 = forced.iter().map(of_forces).sum();
            assert!(
                (of_stress + of_forces).abs() < 1e-5 * of_stress.abs(),
                "{of_stress} {of_forces}"
            );
        });
    }

    #[test]
    fn forces_do_the_work_of_mean_stresses() {
        power::<1>();
        power::<2>();
        power::<3>();
    }

    /// A body that passes the last lines of the grid by next to nothing.
    #[test]
    fn nodes_of_next_to_no_mass_are_not_driven_away() {
        let masses = [1e-9, 1.0, 4.0, 4.0, 4.0, 4.0, 1e-12, 0.0];
        let mass = |_: usize, at: [usize; 2]| 0.25 * masses[at[0]] * masses[at[1]];
        weighed::<2>(small(), mass, |rates, place, nodes| {
            for node in nodes.iter_mut() {
                // Sums of particles go with their masses.
                *node.scalar_mut() = node.mass();
            }
            rates.add_forces(place, nodes);
            for node in nodes.iter().filter(|node| node.mass() > 0.0) {
                let acceleration = node.second()[0].hypot(node.second()[1]) / node.mass();
                assert!(acceleration < 100.0, "{acceleration} of a mass of {}", node.mass());
            }
        });
    }
}
