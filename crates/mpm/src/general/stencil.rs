//! Lists of the nodes that a particle touches, with weights and gradients as products over the axes.

use std::array;

use nalgebra::SVector;

use super::settings::Shape;
use super::spline;
use crate::grid::{Grid, Layout, PAD_BELOW};
use crate::particles::count;
use crate::shape_function::{
    AxisWeights, FixedBox, Hat, ShapeFunction, StretchingBox, extended_axes, is_extended,
};

/// A node with the weight of a particle there, and the weight's gradient in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Entry<const D: usize> {
    pub(crate) node: usize,
    pub(crate) S: f64,
    pub(crate) G: SVector<f64, D>,
}

/// The lists of many particles, one after the other. A node may occur more than once in a list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stencils<const D: usize> {
    ends: Vec<usize>,
    entries: Vec<Entry<D>>,
}

impl<const D: usize> Stencils<D> {
    pub(crate) fn clear(&mut self) {
        self.ends.clear();
        self.entries.clear();
    }

    /// Adds to the list under way.
    pub(crate) fn push(&mut self, entry: Entry<D>) {
        self.entries.push(entry);
    }

    /// Ends the list under way.
    pub(crate) fn finish(&mut self) {
        self.ends.push(self.entries.len());
    }

    /// The list of a particle.
    pub(crate) fn of(&self, index: usize) -> &[Entry<D>] {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.entries[start..self.ends[index]]
    }
}

/// Positions of nodes in space, and their indices in memory.
#[derive(Clone, Debug)]
pub(crate) struct Raster<const D: usize> {
    pub(crate) lower: SVector<f64, D>,
    pub(crate) upper: SVector<f64, D>,
    pub(crate) spacing: f64,
    dims: [usize; D],
    strides: [usize; D],
}

impl<const D: usize> Raster<D> {
    pub(crate) fn new(grid: &Grid<f64, D>, layout: &Layout<D>) -> Self {
        Self {
            lower: grid.lower,
            upper: grid.upper(),
            spacing: grid.spacing,
            dims: layout.dims,
            strides: layout.strides,
        }
    }

    /// The first axis along which a point is not within the grid.
    pub(crate) fn axis_outside(&self, x: &SVector<f64, D>) -> Option<usize> {
        (0..D).find(|&a| !(x[a] >= self.lower[a] && x[a] <= self.upper[a]))
    }

    /// The position of a node, beyond walls too.
    pub(crate) fn node(&self, index: usize) -> SVector<f64, D> {
        SVector::from_fn(|a, _| {
            let layer = index / self.strides[a] % self.dims[a];
            self.lower[a] + (layer as f64 - PAD_BELOW as f64) * self.spacing
        })
    }

    /// The list of a particle whose weights are products over the axes, `half_size` being that of its box in the reference
    /// configuration and `stretch` the diagonal of F.
    pub(crate) fn list(
        &self,
        shape: Shape,
        x: &SVector<f64, D>,
        half_size: &SVector<f64, D>,
        stretch: &SVector<f64, D>,
        visit: impl FnMut(Entry<D>),
    ) {
        let xi = self.in_cells(x);
        let l0 = half_size / self.spacing;
        match shape {
            Shape::Ugimp => self.boxed(FixedBox(l0), &xi, stretch, visit),
            Shape::Gimp => self.boxed(StretchingBox(l0), &xi, stretch, visit),
            Shape::Bspline2 => self.product(&array::from_fn(|a| spline::quadratic(xi[a])), visit),
            Shape::Bspline3 => self.product(&array::from_fn(|a| spline::cubic(xi[a])), visit),
            // The last two have domains, and at a point of them these weights.
            Shape::Linear | Shape::Cpdi | Shape::Cpdi2 => self.hats(x, visit),
        }
    }

    /// The hat functions at a point.
    pub(crate) fn hats(&self, x: &SVector<f64, D>, visit: impl FnMut(Entry<D>)) {
        let xi = self.in_cells(x);
        let axis = |a: usize| <Hat as ShapeFunction<f64, D, 2>>::axis_weights(xi[a], 0.0);
        self.product(&array::from_fn(axis), visit);
    }

    fn boxed<R: ShapeFunction<f64, D, 3>>(
        &self,
        shape: R,
        xi: &[f64; D],
        stretch: &SVector<f64, D>,
        visit: impl FnMut(Entry<D>),
    ) {
        let l: [f64; D] = array::from_fn(|a| shape.half_size(a, stretch[a]));
        if l.iter().any(|&l| is_extended(l)) {
            self.product(&extended_axes(xi, &l), visit);
        } else {
            self.product(&array::from_fn(|a| R::axis_weights(xi[a], l[a])), visit);
        }
    }

    fn in_cells(&self, x: &SVector<f64, D>) -> [f64; D] {
        array::from_fn(|a| (x[a] - self.lower[a]) / self.spacing)
    }

    /// All nodes with the products of their weights.
    fn product<const W: usize>(
        &self,
        axes: &[AxisWeights<f64, W>; D],
        mut visit: impl FnMut(Entry<D>),
    ) {
        count([W; D], |place| {
            let mut node = 0;
            let mut S = 1.0;
            let mut G = SVector::repeat(1.0 / self.spacing);
            for (a, axis) in axes.iter().enumerate() {
                node += (axis.base as usize + place[a]) * self.strides[a];
                S *= axis.S[place[a]];
                for k in 0..D {
                    G[k] *= if k == a { axis.G[place[a]] } else { axis.S[place[a]] };
                }
            }
            visit(Entry { node, S, G });
        });
    }
}
