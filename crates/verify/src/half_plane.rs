//! A body of revolution in its half plane: what a solver with the coordinates `R` and `Z` sees of it.

use mmsmith_runtime::{
    AnySolution, Around, BLOCK, BodyForceAtPoints, Boundary, Condition, Domain, Fields,
    HistoryReport, InternalAtPoints, Lattice, Law, PlainPoints, Real, Solution, StateAtPoints,
    StateRun, Surface,
};
use nalgebra::{SMatrix, SVector};
use std::ops::Range;

use crate::error::{CaseError, SceneError};

/// The axes of space that the half plane has: at the angle zero, `R` lies along the first and `Z` along the third.
const AXES: [usize; 2] = [0, 2];

/// An axisymmetric solution of space in the half plane. Vectors have components along `R` and `Z`; the stretch around the axis is an internal
/// variable.
pub(crate) struct HalfPlane<'a, T: Real> {
    space: &'a dyn Solution<T, 3>,
    domain: Domain<T, 2>,
    boundaries: Vec<Boundary>,
}

impl<'a, T: Real> HalfPlane<'a, T> {
    /// `None` of a solution that is not axisymmetric. Whether it turns about the axis, for which this half plane has no component, is for
    /// [`turns_about_axis`] to tell.
    pub(crate) fn new(space: &'a dyn Solution<T, 3>) -> Option<Self> {
        let Domain::Tube { inner, outer, lower, upper, around: Around::Axisymmetric } =
            space.domain()
        else {
            return None;
        };
        let axis = Boundary { surface: Surface::Lower(0), condition: Condition::Symmetry };
        let mut boundaries: Vec<Boundary> = space
            .boundaries()
            .iter()
            .filter_map(|of| Some(Boundary { surface: in_plane(of.surface)?, ..*of }))
            .collect();
        if inner == T::zero() {
            boundaries.push(axis);
        }
        let domain = Domain::Box {
            lower: SVector::from([inner, lower]),
            upper: SVector::from([outer, upper]),
        };
        Some(Self { space, domain, boundaries })
    }
}

/// Whether a solution is axisymmetric and its motion turns about the axis, as far as a few places show.
#[must_use]
pub fn turns_about_axis(exact: &AnySolution<f64>) -> bool {
    let AnySolution::Three(space) = exact else { return false };
    let domain = space.domain();
    is_axisymmetric(exact)
        && (0..16).filter_map(|n| crate::points::interior(&domain, space.period(), n)).any(
            |(X, t)| {
                let X = SVector::from([X[0].hypot(X[1]), 0.0, X[2]]);
                let u = space.displacement(&X, t);
                u[1].abs() > 1e-12 * u.norm()
            },
        )
}

/// Why a body of revolution has no half plane that the updated Lagrangian formulation could run it in, in words; `None` where it has one, and
/// for other bodies.
#[must_use]
pub fn needs_space(exact: &AnySolution<f64>) -> Option<&'static str> {
    let AnySolution::Three(space) = exact else { return None };
    let is_tube = matches!(space.domain(), Domain::Tube { .. });
    (is_tube && !is_axisymmetric(exact)).then_some(NOT_AXISYMMETRIC)
}

/// Why the updated Lagrangian formulation does not run other bodies of revolution.
pub(crate) const NOT_AXISYMMETRIC: &str = "the updated formulation runs a body of revolution in its half plane, and this one is not axisymmetric";

/// Whether nothing of a solution depends on the angle about the axis Z.
#[must_use]
pub fn is_axisymmetric(exact: &AnySolution<f64>) -> bool {
    let AnySolution::Three(exact) = exact else { return false };
    matches!(exact.domain(), Domain::Tube { around: Around::Axisymmetric, .. })
}

/// The side of the box in the half plane that a surface of space is.
fn in_plane(surface: Surface) -> Option<Surface> {
    match surface {
        Surface::Inner => Some(Surface::Lower(0)),
        Surface::Outer => Some(Surface::Upper(0)),
        Surface::Lower(2) => Some(Surface::Lower(1)),
        Surface::Upper(2) => Some(Surface::Upper(1)),
        _ => None,
    }
}

/// Errors that name sides of the half plane with the names that they have in space.
pub(crate) fn named_in_space(error: CaseError) -> CaseError {
    let named = |surface: Surface| in_space(surface).unwrap_or(surface);
    let CaseError::Scene(scene) = error else { return error };
    CaseError::Scene(match scene {
        SceneError::Unmodelled { surface, condition, instead } => {
            SceneError::Unmodelled { surface: named(surface), condition, instead }
        }
        SceneError::Undeclared { surfaces } => SceneError::Undeclared {
            surfaces: surfaces
                .into_iter()
                .map(|(surface, condition)| (named(surface), condition))
                .collect(),
        },
        other => other,
    })
}

/// The surface of space that a side of the box in the half plane is.
fn in_space(surface: Surface) -> Option<Surface> {
    match surface {
        Surface::Lower(0) => Some(Surface::Inner),
        Surface::Upper(0) => Some(Surface::Outer),
        Surface::Lower(1) => Some(Surface::Lower(2)),
        Surface::Upper(1) => Some(Surface::Upper(2)),
        _ => None,
    }
}

fn place<T: Real>(X: &SVector<T, 2>) -> SVector<T, 3> {
    SVector::from([X[0], T::zero(), X[1]])
}

fn places<T: Real>(X: &[SVector<T, 2>]) -> Vec<SVector<T, 3>> {
    X.iter().map(place).collect()
}

fn vector<T: Real>(of: &SVector<T, 3>) -> SVector<T, 2> {
    SVector::from(AXES.map(|axis| of[axis]))
}

fn matrix<T: Real>(of: &SMatrix<T, 3, 3>) -> SMatrix<T, 2, 2> {
    SMatrix::from_fn(|i, j| of[(AXES[i], AXES[j])])
}

impl<T: Real> Solution<T, 2> for HalfPlane<'_, T> {
    fn displacement(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        vector(&self.space.displacement(&place(X), t))
    }

    fn velocity(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        vector(&self.space.velocity(&place(X), t))
    }

    fn acceleration(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        vector(&self.space.acceleration(&place(X), t))
    }

    fn displacement_gradient(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        matrix(&self.space.displacement_gradient(&place(X), t))
    }

    fn deformation_gradient(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        matrix(&self.space.deformation_gradient(&place(X), t))
    }

    fn jacobian(&self, X: &SVector<T, 2>, t: T) -> T {
        self.space.jacobian(&place(X), t)
    }

    fn first_piola_kirchhoff(&self, X: &SVector<T, 2>, t: T) -> SMatrix<T, 2, 2> {
        matrix(&self.space.first_piola_kirchhoff(&place(X), t))
    }

    fn body_force(&self, X: &SVector<T, 2>, t: T) -> SVector<T, 2> {
        vector(&self.space.body_force(&place(X), t))
    }

    fn body_force_on(
        &self,
        X: &[SVector<T, 2>],
        _: Option<Lattice<T, 2>>,
    ) -> Box<dyn BodyForceAtPoints<T, 2> + '_> {
        Box::new(ForceInPlane(self.space.body_force_on(&places(X), None)))
    }

    fn state_at(&self, X: &[SVector<T, 2>]) -> Box<dyn StateAtPoints<T, 2> + '_> {
        Box::new(StateInPlane(self.space.state_at(&places(X))))
    }

    fn traction(&self, surface: Surface, X: &SVector<T, 2>, t: T) -> Option<SVector<T, 2>> {
        Some(vector(&self.space.traction(in_space(surface)?, &place(X), t)?))
    }

    fn fields(&self, X: &SVector<T, 2>, t: T) -> Fields<T, 2> {
        let of = self.space.fields(&place(X), t);
        Fields {
            u: vector(&of.u),
            v: vector(&of.v),
            a: vector(&of.a),
            H: matrix(&of.H),
            F: matrix(&of.F),
            J: of.J,
            P: matrix(&of.P),
            b: vector(&of.b),
        }
    }

    fn domain(&self) -> Domain<T, 2> {
        self.domain.clone()
    }

    fn is_half_plane(&self) -> bool {
        true
    }

    fn around_axis(&self, X: &[SVector<T, 2>], t: T) -> Option<Vec<[T; 2]>> {
        let mut runs = vec![StateRun::<T, 3>::zero(); X.len().div_ceil(BLOCK)];
        self.space.state_at(&places(X)).evaluate(t, t, 0, &mut runs);
        let of = |n: usize| {
            let (run, n) = (&runs[n / BLOCK], n % BLOCK);
            [run.F[1][1][n], run.P[1][1][n]]
        };
        Some((0..X.len()).map(of).collect())
    }

    fn boundaries(&self) -> &[Boundary] {
        &self.boundaries
    }

    fn cell_length(&self) -> T {
        self.space.cell_length()
    }

    fn law(&self) -> Law<T> {
        self.space.law()
    }

    fn density(&self) -> T {
        self.space.density()
    }

    fn density_at(&self, X: &SVector<T, 2>) -> T {
        self.space.density_at(&place(X))
    }

    fn internal_variables(&self) -> Vec<String> {
        [vec!["hoop_stretch".into()], self.space.internal_variables()].concat()
    }

    fn internal(&self, X: &SVector<T, 2>, t: T) -> Vec<T> {
        let stretch = T::one() + self.displacement(X, t)[0] / X[0];
        std::iter::once(stretch).chain(self.space.internal(&place(X), t)).collect()
    }

    fn internal_at(&self, X: &[SVector<T, 2>]) -> Box<dyn InternalAtPoints<T> + '_> {
        if self.space.internal_variables().is_empty() {
            return Box::new(PlainPoints { solution: self, X: X.to_vec() });
        }
        let of_space = self.space.internal_at(&places(X));
        Box::new(InternalInPlane { half_plane: self, X: X.to_vec(), of_space })
    }

    fn history(&self, X: &[SVector<T, 2>], end: T) -> Result<Option<HistoryReport>, String> {
        self.space.history(&places(X), end)
    }

    fn prepare_until(&self, end: T) -> Result<(), String> {
        self.space.prepare_until(end)
    }

    fn wave_speed(&self) -> T {
        self.space.wave_speed()
    }

    fn period(&self) -> T {
        self.space.period()
    }
}

/// The body force of space in the half plane.
struct ForceInPlane<'a, T: Real>(Box<dyn BodyForceAtPoints<T, 3> + 'a>);

impl<T: Real> BodyForceAtPoints<T, 2> for ForceInPlane<'_, T> {
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, 2>]) {
        for (index, b) in b.chunks_mut(BLOCK).enumerate() {
            let mut in_space = [SVector::zeros(); BLOCK];
            let own = &mut in_space[..b.len()];
            self.0.evaluate(t, first + index * BLOCK, own);
            b.iter_mut().zip(own).for_each(|(b, own)| *b = vector(own));
        }
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        self.0.of_time(t, values);
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, 2>]) {
        for (points, b) in points.chunks(BLOCK).zip(b.chunks_mut(BLOCK)) {
            let mut in_space = [SVector::zeros(); BLOCK];
            let own = &mut in_space[..b.len()];
            self.0.evaluate_of(time, points, own);
            b.iter_mut().zip(own).for_each(|(b, own)| *b = vector(own));
        }
    }

    fn len(&self) -> usize {
        self.0.len()
    }

    fn bytes_per_point(&self) -> usize {
        self.0.bytes_per_point()
    }
}

/// The stretch around the axis and the internal variables of a law with memory.
struct InternalInPlane<'a, T: Real> {
    half_plane: &'a HalfPlane<'a, T>,
    X: Vec<SVector<T, 2>>,
    of_space: Box<dyn InternalAtPoints<T> + 'a>,
}

impl<T: Real> InternalAtPoints<T> for InternalInPlane<'_, T> {
    fn evaluate(&self, t: T, points: Range<usize>) -> Vec<Vec<T>> {
        let mut all = self.of_space.evaluate(t, points.clone());
        for (own, X) in all.iter_mut().zip(&self.X[points]) {
            own.insert(0, T::one() + self.half_plane.displacement(X, t)[0] / X[0]);
        }
        all
    }
}

/// The exact state of space in the half plane.
struct StateInPlane<'a, T: Real>(Box<dyn StateAtPoints<T, 3> + 'a>);

impl<T: Real> StateAtPoints<T, 2> for StateInPlane<'_, T> {
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, 2>]) {
        let mut in_space = StateRun::<T, 3>::zero();
        for (index, run) in runs.iter_mut().enumerate() {
            self.0.evaluate(t, velocity_time, first + index, std::slice::from_mut(&mut in_space));
            for (i, row) in AXES.into_iter().enumerate() {
                (run.u[i], run.v[i]) = (in_space.u[row], in_space.v[row]);
                for (j, column) in AXES.into_iter().enumerate() {
                    run.F[i][j] = in_space.F[row][column];
                    run.P[i][j] = in_space.P[row][column];
                }
            }
        }
    }

    fn bytes_per_point(&self) -> usize {
        self.0.bytes_per_point()
    }
}
