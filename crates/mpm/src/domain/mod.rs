//! The support of particles: the shape function of a simulation, with the domains that its weights are means over.

pub(crate) mod corner_exchange;
pub(crate) mod corner_values;
pub(crate) mod shared_corners;

use std::array;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::{product, real};
use nalgebra::{RealField, SMatrix, SVector};

use crate::domain::corner_values::{CornerValues, Seen};
use crate::domain::shared_corners::SharedCorners;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::particles::body::Body;
use crate::particles::mesh::Interpolation;
use crate::scheme::Shape;
use crate::shape::cells::{HalfEdges, REACHED};
use crate::shape::one_axis::{EXTENDED, HALF_SIZE_LIMIT, ProductShape, first_layer, node_below};

/// The shape function of a simulation.
#[derive(Debug)]
pub(crate) enum Support<T, const D: usize> {
    /// Weights are products over the axes.
    Product(ProductShape<T, D>),
    /// CPDI: hat functions interpolated between the corners of parallelograms, half of whose edges in the reference
    /// configuration are the columns of a matrix, lengths.
    Cpdi { half_edges: HalfEdges<T, D> },
    /// Domains between shared corners, those of CPDI2 among them.
    Mesh(Box<SharedCorners<T, D>>),
}

impl<T: Lanes, const D: usize> Support<T, D> {
    /// The support of a body's particles on a grid of this spacing, and the particles.
    pub(crate) fn new(
        shape: Shape,
        body: Body<T, D>,
        spacing: T,
    ) -> (Self, crate::Particles<T, D>) {
        let Body { particles, half_edges, mesh } = body;
        let cells = particles.half_size / spacing;
        let is_used =
            |interpolation| interpolation == Interpolation::Triangles || shape == Shape::Cpdi2;
        if let Some(mesh) = mesh.filter(|own| is_used(own.interpolation))
            && let Some(at_corner) = ProductShape::new(at_corners(shape), cells)
        {
            let corners = Box::new(SharedCorners::new(mesh, at_corner));
            return (Self::Mesh(corners), particles);
        }
        if let Some(product) = ProductShape::new(shape, cells) {
            return (Self::Product(product), particles);
        }
        (Self::Cpdi { half_edges: HalfEdges::new(half_edges) }, particles)
    }

    /// Half-sizes of the box around the support of a particle's domain, in cells, about the particle's position.
    pub(crate) fn half_size(
        &self,
        c: &Constants<T, D>,
        p: usize,
        F: &SMatrix<T, D, D>,
    ) -> SVector<T, D> {
        match self {
            Self::Product(shape) => SVector::from_fn(|a, _| shape.half_size(a, F[(a, a)])),
            Self::Cpdi { half_edges } => extent(&product(F, half_edges.of(p))) * c.inverse_spacing,
            // Corners reach nodes, each its own.
            Self::Mesh(_) => SVector::zeros(),
        }
    }

    /// The rows of nodes that a particle with these half-sizes reaches.
    pub(crate) fn rows(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> Rows<T> {
        match self {
            Self::Product(shape) => {
                let is_extended = l.iter().any(|&l| l > shape.extended_above());
                let width = if is_extended { EXTENDED } else { shape.width() };
                Rows { edge: c.in_cells(x)[D - 1] - l[D - 1], width }
            }
            Self::Cpdi { half_edges } => {
                // The last component of the corners, in the operations of `deformed` and `corner_of_parallelogram`.
                let (own, last, height) = (half_edges.of(p), D - 1, c.in_cells(x)[D - 1]);
                let edges: [T; D] = array::from_fn(|j| {
                    let term = |l: usize| F[(last, l)] * c.inverse_spacing * own[(l, j)];
                    (1..D).fold(term(0), |sum, l| sum + term(l))
                });
                Rows::between((0..1_usize << D).map(|corner| {
                    edges.iter().enumerate().fold(height, |sum, (a, &edge)| {
                        if corner >> a & 1 == 1 { sum + edge } else { sum - edge }
                    })
                }))
            }
            Self::Mesh(_) => Rows { edge: c.in_cells(x)[D - 1], width: REACHED },
        }
    }

    /// The first node that a particle reaches along the last axis, and about the first one along the others.
    pub(crate) fn first_node(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> usize {
        let (xi, l) = (c.in_cells(x), self.half_size(c, p, F));
        let row = first_layer(self.rows(c, p, x, F, &l).edge, T::zero());
        (0..D - 1).map(|a| first_layer(xi[a], l[a]) * c.strides[a]).sum::<usize>()
            + row * c.strides[D - 1]
    }

    /// For domains between shared corners the volume of a particle's domain.
    pub(crate) fn volume(&self, p: usize) -> Option<T> {
        if let Self::Mesh(corners) = self { Some(corners.volume(p)) } else { None }
    }

    /// The values that particles interpolate: at nodes, or at corners.
    pub(crate) fn seen<'a>(
        &self,
        nodes: &'a [Node<T, D>],
        corners: &'a CornerValues<T, D>,
    ) -> Seen<'a, T, D> {
        if let Self::Mesh(_) = self { Seen::Corners(corners) } else { Seen::Nodes(nodes) }
    }

    /// The first axis along which a half-size, in cells, exceeds the limit.
    pub(crate) fn axis_too_large(&self, l: &SVector<T, D>) -> Option<usize> {
        (0..D).find(|&a| l[a] > real(HALF_SIZE_LIMIT))
    }
}

/// The shape function by which shared corners reach nodes.
pub(crate) fn at_corners(shape: Shape) -> Shape {
    if shape == Shape::Cpdi2 { Shape::Linear } else { shape }
}

/// The rows of nodes that a particle reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<T> {
    /// The lower edge of what it covers, in cells from the lower corner of the grid: the first row is the one below.
    pub(crate) edge: T,
    /// How many rows at most.
    pub(crate) width: usize,
}

impl<T: RealField + Copy> Rows<T> {
    /// Around corners at these heights, in cells; computed as kernels compute them, so that both have the same first row.
    #[inline(always)]
    pub(crate) fn between(heights: impl Iterator<Item = T>) -> Self {
        let (mut low, mut high) = (T::max_value().unwrap_or(T::one()), -T::one());
        for height in heights {
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
        }
        let rows = node_below(high).0 - node_below(low).0 + 2.0;
        // Small domains have a patch of so many nodes, reached or not.
        Self { edge: low, width: (rows as usize).clamp(REACHED, EXTENDED) }
    }
}

/// The half-sizes of the smallest box around a parallelogram with these half-edges.
#[inline(always)]
pub(crate) fn extent<T: RealField + Copy, const D: usize>(E: &SMatrix<T, D, D>) -> SVector<T, D> {
    SVector::from_fn(|a, _| (0..D).fold(T::zero(), |sum, k| sum + E[(a, k)].abs()))
}
