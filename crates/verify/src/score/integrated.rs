//! Errors of u and of its gradient integrated over the elements of a mesh.
//!
//! At nodes the error of u may have a higher order than between them, and tells nothing of the gradient. Between them u is that
//! of the element's shape functions.

use mmsmith_runtime::Solution;
use mmsmith_vtk::foreign::Snapshot;
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use super::data::FrameData;
use super::elements::Element;
use crate::order::Order;

/// Exact values that are asked for in one recording; beyond, as many frames are left out.
const MOST_POINTS: usize = 20_000_000;

/// Errors integrated over the elements of a mesh, over the root of its volume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Integrated {
    /// The root of the mean square of the error of u; a length.
    pub l2: f64,
    /// The root of the mean square of the error of its gradient with respect to X, the H1 seminorm; dimensionless.
    pub h1: f64,
}

impl Integrated {
    /// The larger of each.
    pub(super) fn larger(self, other: Self) -> Self {
        Self { l2: self.l2.max(other.l2), h1: self.h1.max(other.h1) }
    }
}

/// The orders of integrated errors with respect to `h`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IntegratedOrders {
    /// Order of u.
    pub l2: Order,
    /// Order of the gradient of u.
    pub h1: Order,
}

impl IntegratedOrders {
    /// Orders over rows, each a step and its errors; `None` for a single row, or where no row is of a mesh.
    pub(super) fn of(rows: &[(f64, Option<Integrated>)]) -> Option<Self> {
        let steps: Vec<_> = rows.iter().map(|(step, _)| *step).collect();
        let order = |of: fn(Integrated) -> f64| {
            Order::of(&steps, &rows.iter().map(|(_, errors)| errors.map(of)).collect::<Vec<_>>())
        };
        let is_mesh = rows.len() > 1 && rows.iter().any(|(_, errors)| errors.is_some());
        is_mesh.then(|| Self { l2: order(|errors| errors.l2), h1: order(|errors| errors.h1) })
    }
}

/// The mesh of a recording, and the errors on it so far.
pub(super) struct Mesh<const D: usize> {
    elements: Elements<D>,
    nodes: usize,
    stride: usize,
    pub(super) largest: Option<Integrated>,
}

impl<const D: usize> Mesh<D> {
    /// The mesh of the first frame, if it is one whose nodes are compared.
    pub(super) fn new(first: &Snapshot, nodes: usize, frames: usize) -> Option<Self> {
        // Whoever wants no cells is not troubled by damaged ones.
        let mesh = first.mesh().ok().flatten()?;
        let elements = Elements::new(mesh.cells().map(|cell| (cell.kind, cell.nodes)), nodes)?;
        let stride = elements.stride(frames);
        Some(Self { elements, nodes, stride, largest: None })
    }

    /// Takes a frame whose particles are the mesh's nodes in their order.
    pub(super) fn add(
        &mut self,
        exact: &dyn Solution<f64, D>,
        index: usize,
        data: &FrameData<D>,
        time: f64,
    ) {
        if data.X.len() == self.nodes && index.is_multiple_of(self.stride) {
            let errors = self.elements.errors(exact, &data.X, &data.u, time);
            self.largest = Some(self.largest.map_or(errors, |largest| largest.larger(errors)));
        }
    }
}

/// The elements of a mesh that fill space, by the nodes of each.
pub(super) struct Elements<const D: usize> {
    kinds: Vec<Element<D>>,
    /// The place in `kinds`, and the first of the nodes in `nodes`.
    cells: Vec<(usize, usize)>,
    nodes: Vec<usize>,
    points: usize,
}

impl<const D: usize> Elements<D> {
    /// Elements from the `cells` that fill space, each a number of VTK's and its nodes; `None` where there are none, or where one is
    /// not known or has wrong nodes.
    pub(super) fn new<'a>(
        cells: impl Iterator<Item = (u8, &'a [usize])>,
        nodes: usize,
    ) -> Option<Self> {
        let mut found = Self { kinds: vec![], cells: vec![], nodes: vec![], points: 0 };
        for (number, of_cell) in cells {
            if fills_less(number, D) {
                continue;
            }
            let known = found.kinds.iter().position(|element| element.number == number);
            let kind = match known {
                Some(kind) => kind,
                None => {
                    found.kinds.push(Element::of(number)?);
                    found.kinds.len() - 1
                }
            };
            let element = &found.kinds[kind];
            if of_cell.len() != element.nodes || of_cell.iter().any(|node| *node >= nodes) {
                return None;
            }
            found.cells.push((kind, found.nodes.len()));
            found.points += element.quadrature.len();
            found.nodes.extend_from_slice(of_cell);
        }
        (!found.cells.is_empty()).then_some(found)
    }

    /// Stride of integration: one of so many frames is integrated.
    pub(super) fn stride(&self, frames: usize) -> usize {
        self.points.saturating_mul(frames).div_ceil(MOST_POINTS).max(1)
    }

    /// The errors of displacements `u` of nodes at `X`.
    pub(super) fn errors(
        &self,
        exact: &dyn Solution<f64, D>,
        X: &[SVector<f64, D>],
        u: &[SVector<f64, D>],
        time: f64,
    ) -> Integrated {
        let (mut of_u, mut of_H, mut volume) = (0.0, 0.0, 0.0);
        for (kind, first) in &self.cells {
            let element = &self.kinds[*kind];
            let nodes = &self.nodes[*first..first + element.nodes];
            let places: Vec<_> = nodes.iter().map(|node| X[*node]).collect();
            for shapes in &element.quadrature {
                let Some((X, slopes, ratio)) = shapes.mapped(&places) else { continue };
                let mut own = SVector::<f64, D>::zeros();
                let mut H = SMatrix::<f64, D, D>::zeros();
                for ((node, value), slope) in nodes.iter().zip(&shapes.values).zip(&slopes) {
                    own += u[*node] * *value;
                    H += u[*node] * slope.transpose();
                }
                let radius = if exact.is_half_plane() { X[0] } else { 1.0 };
                let weight = shapes.weight * ratio * radius;
                of_u += weight * (own - exact.displacement(&X, time)).norm_squared();
                of_H += weight * (H - exact.displacement_gradient(&X, time)).norm_squared();
                volume += weight;
            }
        }
        Integrated { l2: (of_u / volume).sqrt(), h1: (of_H / volume).sqrt() }
    }
}

/// Whether an element of VTK's has fewer dimensions than a body: the sides of a mesh, and points.
fn fills_less(number: u8, dimension: usize) -> bool {
    let own = match number {
        0..=2 => 0,
        3 | 4 | 21 | 35 => 1,
        5..=9 | 22 | 23 | 28 | 30 | 34 | 36 => 2,
        _ => 3,
    };
    own < dimension
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::elements::nodes_of;
    use mmsmith_runtime::AnySolution;
    use mmsmith_solutions::build;

    /// The corners of a cell's parts: an element's own coordinates begin at the first of them and lead to the others.
    type Part<const D: usize> = (SVector<f64, D>, SMatrix<f64, D, D>);

    /// Errors of the interpolant on so many cells along each axis, whose corners are moved within.
    fn of_interpolant<const D: usize>(
        exact: &dyn Solution<f64, D>,
        number: u8,
        cells: usize,
        parts: &[Part<D>],
    ) -> Integrated {
        let time = 0.3 * exact.period();
        let mut X = vec![];
        for cell in 0..cells.pow(D as u32) {
            let corner = SVector::<f64, D>::from_fn(|axis, _| {
                (cell / cells.pow(axis as u32) % cells) as f64
            });
            for (origin, edges) in parts {
                for node in nodes_of(number) {
                    let within = SVector::<f64, D>::from_fn(|axis, _| node[axis]);
                    X.push((corner + origin + edges * within) / cells as f64);
                }
            }
        }
        // Elements are not all alike: the mesh is drawn out smoothly.
        let drawn = |X: &SVector<f64, D>| X.map(|x| x + 0.2 * x * (1.0 - x));
        let X: Vec<_> = X.iter().map(drawn).collect();
        let u: Vec<_> = X.iter().map(|X| exact.displacement(X, time)).collect();
        let numbers: Vec<usize> = (0..X.len()).collect();
        let of_cells = numbers.chunks(nodes_of(number).len()).map(|nodes| (number, nodes));
        let mesh = Elements::new(of_cells, X.len()).unwrap();
        mesh.errors(exact, &X, &u, time)
    }

    fn check<const D: usize>(
        exact: &dyn Solution<f64, D>,
        cells: [usize; 2],
        elements: &[(u8, i32)],
        parts: &[Part<D>],
    ) {
        for (number, degree) in elements {
            let [coarse, fine] = cells.map(|cells| of_interpolant(exact, *number, cells, parts));
            let ratio = cells[1] as f64 / cells[0] as f64;
            let order = |coarse: f64, fine: f64| (coarse / fine).ln() / ratio.ln();
            let (l2, h1) = (order(coarse.l2, fine.l2), order(coarse.h1, fine.h1));
            let degree = f64::from(*degree);
            assert!((l2 - degree - 1.0).abs() < 0.15, "{number}: order {l2} of u");
            assert!((h1 - degree).abs() < 0.15, "{number}: order {h1} of its gradient");
        }
    }

    #[test]
    fn interpolants_have_the_orders_of_their_elements() {
        let Some(Ok(AnySolution::Two(plane))) = build::<f64>("skew-2d", &[0.1, 1e4, 0.3, 2.0])
        else {
            panic!("it is of two dimensions")
        };
        let Some(Ok(AnySolution::Three(space))) = build::<f64>("skew-3d", &[0.05, 1e4, 0.3, 2.0])
        else {
            panic!("it is of three dimensions")
        };
        let whole = (SVector::zeros(), SMatrix::identity());
        let halves = [whole, (SVector::repeat(1.0), -SMatrix::identity())];
        let squares = [(9, 1), (8, 1), (23, 2), (28, 2)];
        check::<2>(plane.as_ref(), [8, 16], &squares, &[whole]);
        check::<2>(plane.as_ref(), [8, 16], &[(5, 1), (22, 2)], &halves);
        let whole = (SVector::zeros(), SMatrix::identity());
        check::<3>(space.as_ref(), [3, 6], &[(12, 1), (11, 1), (25, 2), (29, 2)], &[whole]);
        // Six tetrahedra to a cube: from one corner along the axes in each order.
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let along = |order: [usize; 3]| {
            let mut edges = SMatrix::<f64, 3, 3>::zeros();
            for (n, axis) in order.into_iter().enumerate() {
                (n..3).for_each(|column| edges[(axis, column)] = 1.0);
            }
            (SVector::zeros(), edges)
        };
        check::<3>(space.as_ref(), [3, 6], &[(10, 1), (24, 2)], &orders.map(along));
    }

    #[test]
    fn faces_and_points_are_no_elements_and_unknown_ones_leave_the_mesh_out() {
        let nodes = [0, 1, 2, 3];
        let cells = |kinds: &[u8]| -> Vec<(u8, usize)> {
            kinds.iter().map(|kind| (*kind, if *kind == 9 { 4 } else { 2 })).collect()
        };
        for (kinds, is_mesh) in [(&[9, 3][..], true), (&[3], false), (&[9, 7], false)] {
            let cells = cells(kinds);
            let cells = cells.iter().map(|(kind, count)| (*kind, &nodes[..*count]));
            assert_eq!(Elements::<2>::new(cells, 4).is_some(), is_mesh, "{kinds:?}");
        }
        // A node that is not there, and too few of them.
        for broken in [&[0, 1, 2, 4][..], &[0, 1, 2]] {
            assert!(Elements::<2>::new([(9, broken)].into_iter(), 4).is_none());
        }
    }
}
