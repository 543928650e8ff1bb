//! Splines in the reference configuration under what is given on the sides of a body: motions that they have to follow
//! without error, and the orders of those that they cannot.

#![allow(clippy::unwrap_used)]

use mmsmith_galerkin::{
    Axis, BoundaryData, ComponentCondition, Composition, Coordinates, End, Grid, Layout,
    MassMatrix, Quantity, Scheme, Side, TotalLagrangian,
};
use mmsmith_laws::Material;
use nalgebra::{SMatrix, SVector};

const DENSITY: f64 = 2.0;
const MATERIAL: Material<f64> = Material::StVenantKirchhoff { lambda: 60.0, mu: 40.0 };

fn scheme(degree: usize, mass: MassMatrix) -> Scheme {
    Scheme { degree, mass, composition: Composition::Order4 }
}

/// `x = X + H(t) X`, with `H` of second degree in time, which leapfrog follows without error.
struct Affine<const D: usize>;

impl<const D: usize> Affine<D> {
    /// `H` or a derivative of it.
    fn H(derivative: usize, t: f64) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|i, k| {
            let (i, k) = (i as f64, k as f64);
            let c =
                [0.03 * (i + 2.0 * k).cos(), 0.4 * (2.0 * i - k).sin(), 1.5 * (i - k + 0.4).cos()];
            match derivative {
                0 => c[0] + c[1] * t + c[2] * t * t,
                1 => c[1] + 2.0 * c[2] * t,
                _ => 2.0 * c[2],
            }
        })
    }
}

impl<const D: usize> BoundaryData<D> for Affine<D> {
    fn evaluate(
        &self,
        quantity: Quantity,
        side: Side,
        X: &[SVector<f64, D>],
        t: f64,
        values: &mut [SVector<f64, D>],
    ) {
        for (X, value) in X.iter().zip(values) {
            let sign = if side.upper { 1.0 } else { -1.0 };
            let end = if side.upper { 1.0 + side.axis as f64 } else { 0.2 };
            assert!((X[side.axis] - end).abs() < 1e-15, "{X} is not on {side:?}");
            *value = match quantity {
                Quantity::Displacement => Self::H(0, t) * X,
                Quantity::Velocity => Self::H(1, t) * X,
                Quantity::Acceleration => Self::H(2, t) * X,
                Quantity::Traction => {
                    let F = SMatrix::identity() + Self::H(0, t);
                    let E = (F.transpose() * F - SMatrix::identity()) * 0.5;
                    let P = F * (SMatrix::identity() * (60.0 * E.trace()) + E * 80.0);
                    P.column(side.axis) * sign
                }
            };
        }
    }
}

/// Boxes from 0.2 to 1, 2, 3 along the axes.
fn axes<const D: usize>(ends: [[End; 2]; D]) -> [Axis; D] {
    std::array::from_fn(|k| Axis { lower: 0.2, upper: 1.0 + k as f64, cells: 3 + k, ends: ends[k] })
}

fn affine_motion_is_exact<const D: usize>(ends: [[End; 2]; D], degree: usize, mass: MassMatrix) {
    let grid = Grid {
        axes: axes(ends),
        coordinates: Coordinates::Cartesian,
        per_cell: degree + 1,
        layout: Layout::Gauss,
    };
    let dt = 2e-3;
    let mut body = TotalLagrangian::new(grid, scheme(degree, mass), MATERIAL, DENSITY, dt).unwrap();
    let at = |derivative: usize| -> Vec<SVector<f64, D>> {
        body.positions().iter().map(|X| Affine::<D>::H(derivative, 0.0) * X).collect()
    };
    let (u, v) = (at(0), at(1));
    let force = |X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]| {
        b.iter_mut().zip(X).for_each(|(b, X)| *b = Affine::<D>::H(2, t) * X);
    };
    body.start_with_boundary(&u, &v, &Affine).unwrap();
    for _ in 0..20 {
        body.step_with_boundary(&force, &Affine).unwrap();
    }
    let t = body.time();
    let p = body.observe();
    for k in 0..p.len() {
        let u = (p.x[k] - p.X[k] - Affine::<D>::H(0, t) * p.X[k]).norm();
        let v = (p.v[k] - Affine::<D>::H(1, t) * p.X[k]).norm();
        let F = (p.F[k] - SMatrix::identity() - Affine::<D>::H(0, t)).norm();
        assert!(
            u < 1e-12 && v < 1e-10 && F < 1e-11,
            "{ends:?}, {degree}, {mass:?}: {u:e} {v:e} {F:e}"
        );
    }
}

#[test]
fn affine_motion_of_sides_and_affine_tractions_are_followed_without_error() {
    let moved = [End::MOVED; 2];
    let mixed = [End::LOADED, End::MOVED];
    for degree in 2..=5 {
        let mass = MassMatrix::Consistent;
        affine_motion_is_exact([moved], degree, mass);
        affine_motion_is_exact([mixed], degree, mass);
        affine_motion_is_exact([moved; 2], degree, mass);
        affine_motion_is_exact([mixed, moved], degree, mass);
        affine_motion_is_exact([moved, [End::LOADED; 2]], degree, mass);
        affine_motion_is_exact([[End::LOADED; 2]; 2], degree, mass);
    }
    for degree in [2, 3] {
        affine_motion_is_exact([moved, mixed, moved], degree, MassMatrix::Consistent);
        affine_motion_is_exact([[End::LOADED; 2], moved, mixed], degree, MassMatrix::Consistent);
    }
}

#[test]
fn components_are_given_by_themselves() {
    let [moved, loaded] =
        [ComponentCondition::PrescribedMotion, ComponentCondition::PrescribedTraction];
    // The component along the axis, and others.
    let roller = [End::Open([loaded, moved, loaded]), End::Open([moved, loaded, moved])];
    let each = [End::Open([moved, loaded, loaded]), End::Open([loaded, loaded, moved])];
    for degree in 2..=5 {
        for ends in [
            [roller; 2],
            [each; 2],
            [roller, each],
            [each, [End::MOVED; 2]],
            [[End::LOADED; 2], roller],
        ] {
            affine_motion_is_exact(ends, degree, MassMatrix::Consistent);
        }
    }
    for ends in [[roller; 3], [each, roller, [End::MOVED; 2]], [roller, [End::LOADED; 2], each]] {
        affine_motion_is_exact(ends, 2, MassMatrix::Consistent);
    }
}

/// Not a motion that the steps follow without error: what is left of it must not stay.
#[test]
fn moved_sides_are_where_they_are_given_after_each_step() {
    const RATE: f64 = 40.0;
    let given = |of: Quantity, X: f64, t: f64| {
        let phase = RATE * t + 3.0 * X;
        match of {
            Quantity::Displacement => 0.02 * phase.sin(),
            Quantity::Velocity => 0.02 * RATE * phase.cos(),
            _ => -0.02 * RATE * RATE * phase.sin(),
        }
    };
    let motion =
        |of: Quantity, _: Side, X: &[SVector<f64, 1>], t: f64, u: &mut [SVector<f64, 1>]| {
            u.iter_mut().zip(X).for_each(|(u, X)| u[0] = given(of, X[0], t));
        };
    for composition in [Composition::Order2, Composition::Order4] {
        let grid = Grid {
            axes: axes([[End::MOVED; 2]]),
            coordinates: Coordinates::Cartesian,
            per_cell: 4,
            layout: Layout::Gauss,
        };
        let scheme = Scheme { composition, ..scheme(3, MassMatrix::Consistent) };
        let mut body = TotalLagrangian::new(grid, scheme, MATERIAL, DENSITY, 2e-3).unwrap();
        let at = |of: Quantity| -> Vec<SVector<f64, 1>> {
            body.positions().iter().map(|X| X.map(|x| given(of, x, 0.0))).collect()
        };
        let (u, v) = (at(Quantity::Displacement), at(Quantity::Velocity));
        body.start_with_boundary(&u, &v, &motion).unwrap();
        for _ in 0..10 {
            body.step_with_boundary(&mmsmith_particles::NoBodyForce, &motion).unwrap();
            let t = body.time();
            let state = body.state();
            for (of, part) in [Quantity::Displacement, Quantity::Velocity].into_iter().zip(state) {
                // The first and the last coefficient are the values at the ends.
                let (ends, _) = part.as_chunks::<8>();
                for (X, found) in [(0.2, ends[0]), (1.0, ends[ends.len() - 1])] {
                    let off = (f64::from_ne_bytes(found) - given(of, X, t)).abs();
                    assert!(off < 1e-13, "{composition:?} {of:?} {X} {t}: {off:e}");
                }
            }
        }
    }
}
