//! Domains between shared corners: all that a simulation keeps of them.

use mmsmith_lanes::simd::Lanes;
use mmsmith_particles::mesh::Mesh;

use crate::domain::corner_exchange::Exchange;
use crate::domain::corner_values::CornerValues;
use crate::domain::shared_corners::SharedCorners;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::kernel::buffers::GridValues;

/// The corners that particles share, the sums of particles at them, and the values of the grid there.
pub(crate) struct Corners<T, const D: usize> {
    pub(crate) shared: SharedCorners<T, D>,
    pub(crate) exchange: Exchange<T, D>,
    /// The values of the grid at each corner here.
    pub(crate) values: CornerValues<T, D>,
    /// The values of the projected velocities at each corner, where velocities are projected again.
    pub(crate) reprojected: CornerValues<T, D>,
    /// Whether there are affine velocities (APIC).
    is_affine: bool,
    reprojects: bool,
}

impl<T: Lanes, const D: usize> Corners<T, D> {
    /// For grid cells that have the mass `mass_of_cell` inside of the body, in the half plane of a body of revolution or not. Reserves all
    /// memory that a step needs for it.
    pub(crate) fn new(
        shared: SharedCorners<T, D>,
        (mass_of_cell, is_of_half_plane): (T, bool),
        is_affine: bool,
        reprojects: bool,
    ) -> Self {
        let exchange = Exchange::new(&shared, mass_of_cell, is_of_half_plane);
        let (values, reprojected) = (CornerValues::none(), CornerValues::none());
        let mut own = Self { shared, exchange, values, reprojected, is_affine, reprojects };
        own.fit();
        own
    }

    /// Gives the mesh, and frees all that belongs to its corners; [`replace`](Self::replace) has to follow.
    pub(crate) fn take_mesh(&mut self) -> Mesh<T, D> {
        let Self { shared, exchange, values, reprojected, .. } = self;
        let none = Mesh::empty(shared.mesh.interpolation, shared.mesh.turn);
        let none = SharedCorners::of_part(none, shared.at_corner, &[], (0, None));
        exchange.free();
        (*values, *reprojected) = (CornerValues::none(), CornerValues::none());
        std::mem::replace(shared, none).mesh
    }

    /// Other corners take the place of these.
    pub(crate) fn replace(&mut self, shared: SharedCorners<T, D>) {
        self.shared = shared;
        self.fit();
    }

    fn fit(&mut self) {
        let Self { shared, exchange, values, reprojected, .. } = self;
        let has_moments = self.is_affine && shared.mesh.is_of_cells();
        exchange.fit(shared, self.is_affine);
        values.fit(shared.count(), has_moments);
        if self.reprojects {
            reprojected.fit(shared.count(), has_moments);
        }
    }

    /// Interpolates the values of nodes at all corners.
    pub(crate) fn interpolate(&mut self, c: &Constants<T, D>, nodes: &[Node<T, D>]) {
        let Self { shared, exchange, values, .. } = self;
        exchange.interpolate(c, shared, nodes, values, &mut []);
    }

    /// As [`interpolate`](Self::interpolate) for projected velocities.
    pub(crate) fn interpolate_reprojected(&mut self, c: &Constants<T, D>, nodes: &[Node<T, D>]) {
        let Self { shared, exchange, reprojected, .. } = self;
        exchange.interpolate(c, shared, nodes, reprojected, &mut []);
    }

    /// As [`interpolate`](Self::interpolate), and the corners move with these values; their new positions are stored beside the old.
    pub(crate) fn follow(&mut self, c: &Constants<T, D>, nodes: &[Node<T, D>]) {
        let Self { shared, exchange, values, .. } = self;
        let mut next = std::mem::take(&mut shared.next);
        exchange.interpolate(c, shared, nodes, values, &mut next);
        shared.next = next;
    }
}

/// The values of the grid that particles interpolate: those at these nodes, or those at corners where particles share some.
pub(crate) fn grid_values<'a, T, const D: usize>(
    nodes: &'a [Node<T, D>],
    corners: Option<&'a Corners<T, D>>,
) -> GridValues<'a, T, D> {
    let at_corners = corners.map(|Corners { shared, values, .. }| (shared, values));
    GridValues { nodes, at_corners }
}

/// As [`grid_values`] of projected velocities.
pub(crate) fn reprojected_values<'a, T, const D: usize>(
    nodes: &'a [Node<T, D>],
    corners: Option<&'a Corners<T, D>>,
) -> GridValues<'a, T, D> {
    let at_corners = corners.map(|Corners { shared, reprojected, .. }| (shared, reprojected));
    GridValues { nodes, at_corners }
}
