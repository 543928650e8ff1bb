//! The domains of particles: shape functions, and the constructor of each.
//!
//! [`of_particles`] says what passes ask of a domain. [`product`] has the shapes that are products over the axes, [`cpdi`] parallelograms.
//! Domains between corners that neighbours share exchange with the grid in two stages, by way of these [`corners`], which reach nodes by
//! the domains of points.
//!
//! To add a domain: implement [`Domain`] in a file of this folder, and add its name and its constructor here.

pub(crate) mod corner_exchange;
pub(crate) mod corner_values;
pub(crate) mod corners;
pub(crate) mod cpdi;
pub(crate) mod of_particles;
pub(crate) mod product;
pub(crate) mod revolving;
pub(crate) mod shared_corners;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use mmsmith_particles::mesh::{Interpolation, Mesh};
use nalgebra::{SMatrix, SVector};

use crate::domain::cpdi::Parallelograms;
use crate::domain::of_particles::Domain;
use crate::domain::revolving::Revolving;
use crate::kernel::block::in_same_dimension;
use crate::named::named;
use crate::shape::one_axis::{OnAxis, ProductShape};

named! {
    /// Shape functions, whose values at particles are the weights of P2G and G2P.
    pub enum Shape {
        /// Hat functions at the particle's point
        Linear = "linear",
        /// GIMP weights of fixed size
        Ugimp = "ugimp",
        /// GIMP weights that follow the particle's stretch
        ///
        /// The boxes stretch with the diagonal of F.
        Gimp = "gimp",
        /// Quadratic splines
        ///
        /// B-splines about the nodes, at the particle's centre. Splines beyond a wall are folded on their mirror images, the
        /// component across the wall with the opposite sign. The weights so add up to one in every cell, and fields that are
        /// linear and vanish across the wall on it are reproduced: of linear fields these are all that a frictionless wall
        /// admits. Beyond an open face the nodes go on, and all linear fields are reproduced there. (Steffen, Kirby & Berzins,
        /// IJNME 76 (2008) 922-948, change the splines at the boundary instead. With lumped mass that costs an order there:
        /// the changed spline's centre of mass is not where its coefficient is.)
        Bspline2 = "bspline2",
        /// Cubic splines
        ///
        /// Walls as for `Bspline2`.
        Bspline3 = "bspline3",
        /// Quadratic splines averaged over the particle's box
        ///
        /// The mean of `Bspline2` over a box that follows the particle's stretch, as `Gimp` is the mean of `Linear`: boxes tile the body,
        /// and the sums over them are integrals. Walls as for `Bspline2`.
        GimpBspline2 = "gimp-bspline2",
        /// Parallelograms that deform with the particle
        ///
        /// Hat functions interpolated between the corners of a parallelogram that F carries along (CPDI: Sadeghirad, Brannon
        /// & Burghardt, IJNME 86 (2011) 1435-1456); segments, parallelograms, parallelepipeds.
        Cpdi = "cpdi",
        /// Quadrilaterals (in space hexahedra) whose corners neighbours share
        ///
        /// `Cpdi` on segments, quadrilaterals and hexahedra whose corners are points of the body, which move with
        /// the grid (CPDI2: Sadeghirad, Brannon & Guilkey, IJNME 95 (2013) 928-952).
        Cpdi2 = "cpdi2",
    }

}

/// The domains of particles with these half-edges, lengths, or else with boxes of these half-sizes, on a grid of this spacing.
pub(crate) fn new<T: Lanes, const D: usize>(
    shape: Shape,
    half_edges: Vec<SMatrix<T, D, D>>,
    half_size: &SVector<T, D>,
    spacing: T,
) -> Box<dyn Domain<T, D>> {
    match (of_product(shape, half_size / spacing), shape) {
        (Some(product), _) => Box::new(product),
        (None, _) => Box::new(Parallelograms::new(half_edges, half_size)),
    }
}

/// The domains of particles of a body that [revolves](crate::Body::revolves), with boxes of these half-sizes, on a grid of this spacing; none
/// elsewhere than in space, and for shapes that are no products over the axes.
pub(crate) fn revolving<T: Lanes, const D: usize>(
    shape: Shape,
    half_size: &SVector<T, D>,
    spacing: T,
) -> Option<Box<dyn Domain<T, D>>> {
    let boxes = SVector::from([half_size[0] / spacing, half_size[D - 1] / spacing]);
    let in_space: Box<dyn Domain<T, 3>> = Box::new(Revolving(of_product(shape, boxes)?));
    in_same_dimension::<_, Box<dyn Domain<T, D>>>(in_space)
}

/// A shape function that is a product over the axes, of boxes with these half-sizes in cells; none for parallelograms.
fn of_product<T: Lanes, const D: usize>(
    shape: Shape,
    boxes: SVector<T, D>,
) -> Option<ProductShape<T, D>> {
    let (on_axis, l) = match shape {
        // The points of Cpdi2 are corners.
        Shape::Linear | Shape::Cpdi2 => (OnAxis::Hat, SVector::zeros()),
        Shape::Ugimp => (OnAxis::FixedBox, boxes),
        // Contiguous particles.
        Shape::Gimp => (OnAxis::StretchingBox, boxes),
        Shape::Bspline2 => (OnAxis::Quadratic, SVector::repeat(real(0.5))),
        Shape::Bspline3 => (OnAxis::Cubic, SVector::repeat(real(1.0))),
        Shape::GimpBspline2 => (OnAxis::QuadraticMean, boxes),
        Shape::Cpdi => return None,
    };
    Some(ProductShape { on_axis, l })
}

/// The shape function by which the corners of a mesh reach nodes; none where a shape leaves the mesh alone.
pub(crate) fn at_corners<T: Lanes, const D: usize>(
    shape: Shape,
    mesh: &Mesh<T, D>,
) -> Option<ProductShape<T, D>> {
    let (on_axis, half_size) = match (mesh.interpolation, shape) {
        (_, Shape::Cpdi2) => (OnAxis::Hat, 0.0),
        (Interpolation::Triangles, Shape::Bspline2) => (OnAxis::Quadratic, 0.5),
        (Interpolation::Triangles, Shape::Bspline3) => (OnAxis::Cubic, 1.0),
        _ => return None,
    };
    Some(ProductShape { on_axis, l: SVector::repeat(real(half_size)) })
}
