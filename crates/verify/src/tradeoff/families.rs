//! Families of schemes that may fit a solution.

use mmsmith_galerkin::{Composition, Coordinates, Layout, MassMatrix};
use mmsmith_mpm::{Integrator, Shape, Transfer};

use super::{LADDER, Setting};
use crate::case::Case;
use crate::on_grid::Plan;
use crate::scheme::{GridPose, Placement, Scheme, Total, Updated};

/// The families that may fit a solution, in the order in which they are tried; those that do not fit it are left out.
/// `base` says the periods, the extent and the speed of CFL numbers, and the CFL number to begin with.
#[must_use]
pub fn families(
    base: &Setting,
    more_threads: Option<usize>,
    has_single: bool,
    plan: &dyn Fn(&Setting) -> Option<Plan>,
) -> Vec<Setting> {
    let mut all = Vec::new();
    let with = |scheme: Scheme, per_cell: usize| Setting {
        case: Case { scheme, per_cell, ..base.case },
        ..*base
    };
    let square = Updated::default();
    let fitted =
        Updated { shape: Shape::Cpdi2, placement: Placement::BodyFitted, ..Updated::default() };
    for usual in [square, fitted] {
        all.extend(around(usual).map(|(scheme, per_cell)| with(Scheme::Updated(scheme), per_cell)));
    }
    if let Some(threads) = more_threads {
        all.push(Setting { threads, ..with(Scheme::Updated(square), 2) });
    }
    if has_single {
        for shape in [Shape::Gimp, Shape::Ugimp] {
            let scheme = Scheme::Updated(Updated { shape, ..square });
            all.push(Setting { single: true, ..with(scheme, 2) });
        }
    }
    for coordinates in [
        Coordinates::Cartesian,
        Coordinates::Polar,
        Coordinates::Cylindrical,
        Coordinates::Spherical,
    ] {
        for degree in 2..=5 {
            let lattice = Total { coordinates, ..Total::of_degree(degree) };
            let gauss = Total { layout: Layout::Gauss, ..lattice };
            let mut add = |scheme: Total, per_cell| all.push(with(Scheme::Total(scheme), per_cell));
            for per_cell in [2, 3, 4] {
                add(lattice, per_cell);
            }
            for per_cell in [degree - 1, degree, degree + 1] {
                add(gauss, per_cell);
            }
            for composition in [Composition::Order2, Composition::Order4, Composition::Order6] {
                if composition != gauss.composition {
                    add(Total { composition, ..gauss }, degree);
                }
            }
            let (mass, composition) = (MassMatrix::Lumped, Composition::Order2);
            add(Total { mass, composition, ..lattice }, 2);
        }
    }
    let fits = |setting: &Setting| {
        let at = |cells| Setting { case: Case { cells, ..setting.case }, ..*setting };
        LADDER.iter().any(|&cells| plan(&at(cells)).is_some())
    };
    all.retain(fits);
    if all.iter().all(|setting| setting.case.scheme.updated().is_none()) {
        let placement = Placement::Clipped { offset: 0.0, pose: GridPose::default() };
        let clipped = Updated { shape: Shape::Cpdi2, placement, ..Updated::default() };
        let mut clipped: Vec<Setting> = around(clipped)
            .map(|(scheme, per_cell)| with(Scheme::Updated(scheme), per_cell))
            .collect();
        clipped.retain(fits);
        all.splice(..0, clipped);
    }
    all
}

/// An updated Lagrangian scheme with the numbers of particles along an axis of a cell, and those that differ from it in a choice.
fn around(usual: Updated) -> impl Iterator<Item = (Updated, usize)> {
    let shapes = [
        Shape::Linear,
        Shape::Ugimp,
        Shape::Gimp,
        Shape::Cpdi,
        Shape::Cpdi2,
        Shape::Bspline2,
        Shape::Bspline3,
        Shape::GimpBspline2,
    ];
    let integrators = [Integrator::Usl, Integrator::Usf, Integrator::Musl, Integrator::Usavg];
    let of_shapes = shapes.into_iter().filter(move |shape| *shape != usual.shape);
    let of_transfers = [Transfer::Pic, Transfer::Apic, Transfer::Xpic(2)].into_iter();
    [(usual, 2)]
        .into_iter()
        .chain(of_shapes.map(move |shape| (Updated { shape, ..usual }, 2)))
        .chain(integrators.into_iter().map(move |integrator| (Updated { integrator, ..usual }, 2)))
        .chain([1, 3, 4].into_iter().map(move |per_cell| (usual, per_cell)))
        .chain([(Updated { shape: Shape::Bspline3, ..usual }, 4)])
        .chain(of_transfers.map(move |transfer| (Updated { transfer, ..usual }, 2)))
}
