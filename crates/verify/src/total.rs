//! Runs in the reference configuration: from a solution to splines, a layout of particles, and their motion.

use mmsmith_galerkin::SetUp;
use mmsmith_galerkin::{
    Axis, BoundaryData, Composition, Coordinates, End, Grid, Layout, MassMatrix, Quantity, Scheme,
    Side,
};
use mmsmith_mpm::{SetupError, Solver};
use mmsmith_runtime::{AnySolution, Around, Condition, Domain, Law, Solution, Surface};
use nalgebra::SVector;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::case::{Case, CflSpeed, Extent, law_of, two_digits};
use crate::dimension::in_dimension;
use crate::error::CaseError;
use crate::kept_stress::KeptStress;
use crate::named::Named;
use crate::points;
use crate::precision::Precision;
use crate::scene::{Scene, is_mirrored, whole_cells};
use crate::scheme::Total;

/// Polar angles of the part of a spherical shell that is modelled, from the third axis: beyond a cone about it, which moves as the
/// solution says.
///
/// Towards the axis the cells of a spherical grid lose their width, and the longest stable step would go with the square of the
/// spacing. At 45 degrees they keep 71 % of the width at the equator, and the shell 71 % of its volume. What is left out of the
/// eighth about the third axis is what is modelled about the first and the second.
pub const POLAR_ANGLES: [f64; 2] = [FRAC_PI_4, FRAC_PI_2];

impl Total {
    /// Splines of a degree with what goes best with them: consistent mass, and a composition of no lower order.
    #[must_use]
    pub fn of_degree(degree: usize) -> Self {
        let composition = if degree > 3 { Composition::Order6 } else { Composition::Order4 };
        Self {
            degree,
            mass: MassMatrix::Consistent,
            composition,
            layout: Layout::Lattice,
            coordinates: Coordinates::Cartesian,
        }
    }

    /// The layout that keeps the order of the splines for a solution: a lattice between walls, where the mirror images make
    /// all integrands periodic, and Gauss points elsewhere.
    #[must_use]
    pub fn layout_for(exact: &AnySolution<f64>) -> Layout {
        let between_walls = in_dimension!(exact, |s| is_between_walls(s), else false);
        if between_walls { Layout::Lattice } else { Layout::Gauss }
    }

    /// The coordinates that fit a solution's body: polar for rings, spherical for shells.
    #[must_use]
    pub fn coordinates_for(exact: &AnySolution<f64>) -> Coordinates {
        match exact {
            AnySolution::Two(s) if matches!(s.domain(), Domain::Annulus { .. }) => {
                Coordinates::Polar
            }
            AnySolution::Three(s) if matches!(s.domain(), Domain::Annulus { .. }) => {
                Coordinates::Spherical
            }
            AnySolution::Three(s) if matches!(s.domain(), Domain::Tube { .. }) => {
                Coordinates::Cylindrical
            }
            _ => Coordinates::Cartesian,
        }
    }

    /// A CFL number of steps that this scheme is stable with, with room for the stiffness of a body under load: about half the
    /// largest.
    ///
    /// The largest number on P-waves falls with the degree (0.65, 0.49, 0.34 and 0.26 for degrees 2 to 5 with consistent mass
    /// on a Cartesian grid), and with the width of the narrowest cells beside that of the others.
    ///
    /// # Errors
    ///
    /// [`CaseError`] for a material that the solver has no law for.
    pub fn usual_cfl(&self, exact: &AnySolution<f64>, speed: CflSpeed) -> Result<f64, CaseError> {
        const TIMES_DEGREE: f64 = 0.6;
        let degree = self.degree.max(1) as f64;
        let on_p_waves = TIMES_DEGREE / degree;
        in_dimension!(
            exact,
            |s| {
                let ratio = speed.on_wide_cells(s)? / CflSpeed::PWave.on_wide_cells(s)?;
                // Viscosity acts with the square of the largest frequency of the grid.
                let again = match speed {
                    CflSpeed::Viscous => (3.0 / degree).min(1.0) * narrowest(s),
                    _ => 1.0,
                };
                Ok(two_digits(on_p_waves * narrowest(s) * ratio * again))
            },
            else Err(CaseError::Dimension)
        )
    }

    /// The length that CFL numbers refer to: the spacing of a scene, unless the cells across a curved body or along its axis are much
    /// narrower, as where few of them fit in.
    pub(crate) fn spacing_of_waves<const D: usize>(
        &self,
        scene: &Scene<D>,
        per_cell: usize,
    ) -> f64 {
        /// The part of the spacing down to which usual CFL numbers leave room.
        const ROOM: f64 = 0.75;
        let lengths: &[usize] = match self.coordinates {
            Coordinates::Cartesian => &[],
            Coordinates::Polar | Coordinates::Spherical => &[0],
            Coordinates::Cylindrical => &[0, 2],
        };
        // Scenes without a grid are refused where it is set up.
        let Ok(grid) = self.grid(scene, per_cell) else { return scene.spacing };
        let axes = grid.axes.iter().enumerate().filter(|(k, _)| lengths.contains(k));
        axes.map(|(_, axis)| axis.spacing() / ROOM).fold(scene.spacing, f64::min)
    }

    /// The grid that covers the body of a scene.
    pub(crate) fn grid<const D: usize>(
        &self,
        scene: &Scene<D>,
        per_cell: usize,
    ) -> Result<Grid<D>, CaseError> {
        // Across, and along the mean circle or sphere.
        let count = |length: f64| whole_cells(length, scene.spacing);
        let name = self.coordinates.name();
        let axes = match (&scene.domain, self.coordinates) {
            (Domain::Box { lower, upper }, Coordinates::Cartesian) => {
                std::array::from_fn(|k| Axis {
                    lower: lower[k],
                    upper: upper[k],
                    cells: scene.cells[k],
                    ends: ends(scene, k),
                })
            }
            (Domain::Annulus { inner, outer }, Coordinates::Polar) if D == 2 => {
                let (angle, end) = match scene.extent() {
                    Some(Extent::Full) => (TAU, End::Periodic),
                    _ => (FRAC_PI_2, End::Wall),
                };
                // Along a periodic axis no spline may meet itself.
                let least = if end == End::Periodic { self.degree + 1 } else { 2 };
                let around = Axis {
                    lower: 0.0,
                    upper: angle,
                    cells: count(angle * 0.5 * (inner + outer)).max(least),
                    ends: [end; 2],
                };
                let across = radial(scene, *inner, *outer, count(outer - inner));
                std::array::from_fn(|k| if k == 0 { across } else { around })
            }
            (Domain::Annulus { .. }, Coordinates::Spherical)
                if D == 3 && scene.extent() == Some(Extent::Full) =>
            {
                return Err(CaseError::setting(
                    "extent",
                    "full",
                    "quarter on a spherical grid, which is the eighth of the shell between three planes of symmetry: leave --extent out where \
                     the file declares them, or declare them, also of an axisymmetric shell: [[boundary]] with condition = 'symmetry' and \
                     surface = 'X-lower', with surface = 'Y-lower', and with surface = 'Z-lower'",
                ));
            }
            (Domain::Annulus { inner, outer }, Coordinates::Spherical) if D == 3 => {
                let radius = 0.5 * (inner + outer);
                let [lower, upper] = POLAR_ANGLES;
                let down = Axis {
                    lower,
                    upper,
                    // The mirror images at the equator have to be splines that the cone does not cut.
                    cells: count((upper - lower) * radius).max(self.degree),
                    ends: [End::MOVED, End::Wall],
                };
                let around = Axis {
                    lower: 0.0,
                    upper: FRAC_PI_2,
                    cells: count(FRAC_PI_2 * radius),
                    ends: [End::Wall; 2],
                };
                let across = radial(scene, *inner, *outer, count(outer - inner));
                std::array::from_fn(|k| [across, down, around][k])
            }
            (Domain::Annulus { .. }, _) if D == 2 => {
                return Err(CaseError::setting(
                    "grid",
                    name,
                    "polar for a ring in the total Lagrangian formulation",
                ));
            }
            (Domain::Annulus { .. }, _) => {
                return Err(CaseError::setting(
                    "grid",
                    name,
                    "spherical for a shell in the total Lagrangian formulation",
                ));
            }
            (Domain::Tube { inner, outer, lower, upper, around }, Coordinates::Cylindrical)
                if D == 3 =>
            {
                let across = Axis {
                    lower: *inner,
                    upper: *outer,
                    cells: scene.cells[0],
                    // The axis of a solid cylinder is no surface.
                    ends: [
                        if *inner == 0.0 { End::FREE } else { open(0, scene.sides[0][0]) },
                        open(0, scene.sides[0][1]),
                    ],
                };
                let mean = 0.5 * (inner + outer);
                let around = match around {
                    Around::Sector { from, to } => Axis {
                        lower: *from,
                        upper: *to,
                        cells: count((to - from) * mean).max(self.degree),
                        ends: ends(scene, 1 % D),
                    },
                    Around::Whole => Axis {
                        lower: 0.0,
                        upper: TAU,
                        cells: count(TAU * mean).max(self.degree + 1),
                        ends: [End::Periodic; 2],
                    },
                    _ => Axis { lower: 0.0, upper: TAU, cells: 1, ends: [End::Uniform; 2] },
                };
                let (lower, upper) = (*lower, *upper);
                let along =
                    Axis { lower, upper, cells: scene.cells[2 % D], ends: ends(scene, 2 % D) };
                std::array::from_fn(|k| [across, around, along][k])
            }
            (Domain::Tube { .. }, _) => {
                return Err(CaseError::setting("grid", name, "cylindrical for a tube"));
            }
            _ => return Err(CaseError::setting("grid", name, "cartesian for a box")),
        };
        Ok(Grid { axes, coordinates: self.coordinates, per_cell, layout: self.layout })
    }
}

/// The width of the narrowest cells of the grid that fits a body, as a share of that of the others.
fn narrowest<const D: usize>(exact: &dyn Solution<f64, D>) -> f64 {
    match exact.domain() {
        // Refused where it is put on a grid.
        Domain::Annulus { inner: 0.0, .. }
        | Domain::Tube { inner: 0.0, around: Around::Whole | Around::Sector { .. }, .. } => 1.0,
        Domain::Annulus { inner, outer } => {
            let around = inner / (0.5 * (inner + outer));
            if D == 3 { around * POLAR_ANGLES[0].sin() } else { around }
        }
        Domain::Tube { around: Around::Axisymmetric, inner, outer, .. } => {
            // Next to the axis the stress around it works on short circles: cubic splines of a solid cylinder are stable up to CFL numbers
            // of 0.2 on P-waves, not 0.49, on 4 and on 8 cells.
            0.55 + 0.45 * (4.0 * inner / (outer - inner)).min(1.0)
        }
        Domain::Tube { inner, outer, .. } => inner / (0.5 * (inner + outer)),
        _ => 1.0,
    }
}

/// The axis from the inner to the outer surface.
fn radial<const D: usize>(scene: &Scene<D>, inner: f64, outer: f64, cells: usize) -> Axis {
    Axis { lower: inner, upper: outer, cells, ends: scene.sides[0].map(|side| open(0, side)) }
}

fn is_between_walls<const D: usize>(exact: &dyn Solution<f64, D>) -> bool {
    // The mirror image of a law that differs from place to place is another law.
    let is_graded = match exact.law() {
        Law::Stated(stated) => !stated.given.is_empty() || !stated.internal.is_empty(),
        Law::Library(_) | Law::WithMemory(_) => false,
    };
    if is_graded {
        return false;
    }
    matches!(exact.domain(), Domain::Box { .. })
        && exact
            .boundaries()
            .iter()
            .all(|boundary| boundary.condition.is_wall() && is_mirrored(exact, boundary.surface))
}

/// The ends of an axis: splines are continued by their mirror images beyond walls that mirror the motion. A side on which the body slides alone
/// gives each component its condition, since mirror images would have no second slope there along the axis.
fn ends<const D: usize>(scene: &Scene<D>, axis: usize) -> [End; 2] {
    [0, 1].map(|end| match scene.mirrors[axis][end] {
        true => End::Wall,
        false => open(axis, scene.sides[axis][end]),
    })
}

/// The end at which each component of the grid's coordinates has its own condition: of walls that mirror nothing too.
fn open(axis: usize, condition: Condition) -> End {
    End::Open(std::array::from_fn(|component| condition.of(axis, component)))
}

/// The exact solution on the sides of the body.
pub(crate) struct ExactBoundary<'a, const D: usize> {
    exact: &'a dyn Solution<f64, D>,
    stress: KeptStress<'a, f64, D>,
}

impl<'a, const D: usize> ExactBoundary<'a, D> {
    pub(crate) fn new(exact: &'a dyn Solution<f64, D>) -> Self {
        Self { exact, stress: KeptStress::new(exact) }
    }
}

impl<const D: usize> BoundaryData<D> for ExactBoundary<'_, D> {
    fn evaluate(
        &self,
        quantity: Quantity,
        side: Side,
        X: &[SVector<f64, D>],
        t: f64,
        values: &mut [SVector<f64, D>],
    ) {
        let exact = self.exact;
        let surface = match (exact.domain(), side) {
            (Domain::Annulus { .. } | Domain::Tube { .. }, Side { axis: 0, upper: false }) => {
                Surface::Inner
            }
            (Domain::Annulus { .. } | Domain::Tube { .. }, Side { axis: 0, upper: true }) => {
                Surface::Outer
            }
            (Domain::Tube { .. }, Side { axis: 1, upper: false }) => Surface::FirstAngle,
            (Domain::Tube { .. }, Side { axis: 1, upper: true }) => Surface::LastAngle,
            (_, Side { axis, upper: false }) => Surface::Lower(axis),
            (_, Side { axis, upper: true }) => Surface::Upper(axis),
        };
        let kept = match quantity {
            Quantity::Traction => self.stress.at(X.iter().copied(), t),
            Quantity::Displacement | Quantity::Velocity | Quantity::Acceleration => None,
        };
        let nothing = SVector::repeat(f64::NAN);
        for (n, (X, value)) in X.iter().zip(values).enumerate() {
            *value = match quantity {
                Quantity::Displacement => exact.displacement(X, t),
                Quantity::Velocity => exact.velocity(X, t),
                Quantity::Acceleration => exact.acceleration(X, t),
                // A surface that the body does not have stops the run.
                Quantity::Traction => match &kept {
                    Some(P) => {
                        exact.domain().normal(surface, X).map_or(nothing, |normal| P[n] * normal)
                    }
                    None => exact.traction(surface, X, t).unwrap_or(nothing),
                },
            };
        }
    }
}

/// Whether the density of a body differs from place to place.
#[must_use]
pub fn has_uneven_density(exact: &AnySolution<f64>) -> bool {
    in_dimension!(exact, |s| is_uneven(s), else false)
}

fn is_uneven<const D: usize>(exact: &dyn Solution<f64, D>) -> bool {
    let domain = exact.domain();
    let mut places = (0..64).filter_map(|n| points::interior(&domain, 1.0, n));
    places.any(|(X, _)| exact.density_at(&X) != exact.density())
}

/// The solver at time zero with steps of `time_step`.
pub(crate) fn set_up<'a, T: Precision<D>, const D: usize>(
    exact: &'a dyn Solution<f64, D>,
    total: &Total,
    case: &Case,
    scene: &Scene<D>,
    time_step: T,
) -> Result<Box<dyn Solver<T, D> + 'a>, CaseError>
where
    f64: Precision<D>,
{
    let Total { degree, mass, composition, .. } = *total;
    // The mass matrix is a product over the axes.
    if is_uneven(exact) {
        let instead = match exact.domain() {
            Domain::Box { .. } if D == 1 => {
                "left out, with --static, or updated-lagrangian where both ends slide: the density differs from place to place, and no formulation \
                 runs other ends of a bar so"
            }
            Domain::Tube { around: Around::Whole | Around::Sector { .. }, .. } => {
                "left out, with --static: the density differs from place to place, and no formulation runs this body so"
            }
            _ => {
                "updated-lagrangian for a density that differs from place to place, with --layout clipped where sides are no walls"
            }
        };
        return Err(CaseError::setting("formulation", "total-lagrangian", instead));
    }
    let set_up = SetUp {
        grid: total.grid(scene, case.per_cell)?,
        scheme: Scheme { degree, mass, composition },
        law: law_of(exact, case)?,
        density: exact.density(),
        time_step: time_step.to_f64(),
        motion: &|X| [exact.displacement(X, 0.0), exact.velocity(X, 0.0)],
    };
    let boundary = ExactBoundary::new(exact);
    T::total_lagrangian(set_up, Box::new(boundary)).map_err(|error| match error {
        SetupError::DoublePrecisionOnly => {
            CaseError::setting("precision", "f32", "f64 in the total Lagrangian formulation")
        }
        error => error.into(),
    })
}
