//! Functions of every manufactured solution.

use crate::lattice::POINTS_A_LAYER;
use crate::staged::PlainPoints;
use crate::{
    BLOCK, BodyForceAtPoints, Boundary, Domain, HistoryReport, InternalAtPoints, Lattice, Law,
    Real, StateAtPoints, StateRun, Surface,
};
use nalgebra::{SMatrix, SVector};

/// Every field of a solution at one point, in Cartesian components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fields<T: Real, const D: usize> {
    /// Displacement, a length.
    pub u: SVector<T, D>,
    /// Velocity `du/dt` at fixed `X`.
    pub v: SVector<T, D>,
    /// Acceleration `d2u/dt2` at fixed `X`.
    pub a: SVector<T, D>,
    /// Displacement gradient `H[i][J] = du_i/dX_J`, with full relative accuracy however small it is.
    pub H: SMatrix<T, D, D>,
    /// Deformation gradient `F = I + H`.
    pub F: SMatrix<T, D, D>,
    /// `det F`.
    pub J: T,
    /// First Piola-Kirchhoff stress.
    pub P: SMatrix<T, D, D>,
    /// Body force per unit mass.
    pub b: SVector<T, D>,
}

/// A manufactured solution in `D` dimensions, its parameters fixed.
///
/// Positions `X` are reference positions. Each function computes only what it needs; [`Solution::fields`]
/// computes everything and shares the common parts.
pub trait Solution<T: Real, const D: usize>: Send + Sync {
    /// Displacement `u`, a length.
    fn displacement(&self, X: &SVector<T, D>, t: T) -> SVector<T, D>;
    /// Velocity `v = du/dt` at fixed `X`.
    fn velocity(&self, X: &SVector<T, D>, t: T) -> SVector<T, D>;
    /// Acceleration `a = d2u/dt2` at fixed `X`.
    fn acceleration(&self, X: &SVector<T, D>, t: T) -> SVector<T, D>;
    /// Displacement gradient `H[i][J] = du_i/dX_J`, dimensionless.
    fn displacement_gradient(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D>;
    /// Deformation gradient `F = I + H`, dimensionless.
    fn deformation_gradient(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D>;
    /// `J = det F`, the ratio of current to reference volume.
    fn jacobian(&self, X: &SVector<T, D>, t: T) -> T;
    /// First Piola-Kirchhoff stress `P[i][J]`, force in direction `i` per reference area with normal `J`.
    fn first_piola_kirchhoff(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D>;
    /// Body force `b` per unit mass, from `rho0 a = Div P + rho0 b`.
    fn body_force(&self, X: &SVector<T, D>, t: T) -> SVector<T, D>;
    /// The body force at many fixed points. Values that depend on the points alone are computed here, once, and kept. Where points
    /// [share their coordinates](crate::Lattice), values of one coordinate and the time are computed once for each coordinate.
    ///
    /// Solutions that have no stages keep the positions and compute the rest at each evaluation.
    fn body_force_at(&self, X: &[SVector<T, D>]) -> Box<dyn BodyForceAtPoints<T, D> + '_> {
        let lattice = self.has_form_on_lattice().then(|| Lattice::of(X)).flatten();
        self.body_force_on(X, lattice)
    }
    /// As [`body_force_at`](Self::body_force_at), with the lattice of the points given by the caller, or without a lattice. The two
    /// ways round differently.
    fn body_force_on(
        &self,
        X: &[SVector<T, D>],
        _lattice: Option<Lattice<T, D>>,
    ) -> Box<dyn BodyForceAtPoints<T, D> + '_> {
        Box::new(PlainPoints { solution: self, X: X.to_vec() })
    }
    /// Whether the body force has a form of its own on lattices.
    fn has_form_on_lattice(&self) -> bool {
        false
    }
    /// The exact state at many fixed points, to compare a simulation with, prepared as [`Solution::body_force_at`] prepares the body
    /// force: displacement, deformation gradient and stress at one time, and the velocity at another.
    fn state_at(&self, X: &[SVector<T, D>]) -> Box<dyn StateAtPoints<T, D> + '_> {
        Box::new(PlainPoints { solution: self, X: X.to_vec() })
    }
    /// Strain energy per reference volume; `None` unless the specification gives the material by its energy.
    fn strain_energy(&self, _X: &SVector<T, D>, _t: T) -> Option<T> {
        None
    }
    /// The stretch along the directions that the dimension leaves out: one, unless the specification assumes that there is no stress along
    /// them, plane stress or uniaxial stress.
    fn stretch_across(&self, _X: &SVector<T, D>, _t: T) -> T {
        T::one()
    }
    /// Traction `P N` at a point `X` of a surface, force per reference area, `N` the outward reference normal; `None`
    /// where the body has no such surface.
    ///
    /// Generated solutions put the coordinate that is fixed on the surface into the formula: a surface that is free
    /// of traction gives zero, not rounding errors.
    fn traction(&self, surface: Surface, X: &SVector<T, D>, t: T) -> Option<SVector<T, D>> {
        let normal = self.domain().normal(surface, X)?;
        Some(self.first_piola_kirchhoff(X, t) * normal)
    }
    /// All fields at once.
    fn fields(&self, X: &SVector<T, D>, t: T) -> Fields<T, D>;
    /// How the histories of internal variables go at some places until a time; none for elastic laws.
    ///
    /// # Errors
    ///
    /// The reason where a history cannot be followed.
    fn history(&self, _X: &[SVector<T, D>], _end: T) -> Result<Option<HistoryReport>, String> {
        Ok(None)
    }

    /// The body's shape in the reference configuration.
    fn domain(&self) -> Domain<T, D>;
    /// Whether this is the half plane of a body of revolution: positions are the radius and the height, integrals have the radius as a factor,
    /// and the body is stretched around its axis too.
    fn is_half_plane(&self) -> bool {
        false
    }
    /// Stretch around the axis and first Piola-Kirchhoff stress there, force per reference area, at each of some places of the half plane
    /// of a body of revolution; `None` of other bodies.
    fn around_axis(&self, _X: &[SVector<T, D>], _t: T) -> Option<Vec<[T; 2]>> {
        None
    }
    /// The conditions on the body's boundary.
    fn boundaries(&self) -> &[Boundary];
    /// The length that a cell count divides: the grid spacing is this length over the number of cells.
    fn cell_length(&self) -> T;
    /// The constitutive law and its constants.
    fn law(&self) -> Law<T>;
    /// Mass per reference volume; in the middle of the body where it depends on the place.
    fn density(&self) -> T;
    /// Mass per reference volume at a place.
    fn density_at(&self, _X: &SVector<T, D>) -> T {
        self.density()
    }
    /// The names of the law's internal variables, in the order of the solver's own law; none for elastic laws.
    fn internal_variables(&self) -> Vec<String> {
        Vec::new()
    }
    /// The internal variables at a place and time, in Cartesian components, in the order of
    /// [`internal_variables`](Self::internal_variables).
    fn internal(&self, _X: &SVector<T, D>, _t: T) -> Vec<T> {
        Vec::new()
    }
    /// The internal variables at many fixed points, prepared as [`Solution::body_force_at`] prepares the body force.
    fn internal_at(&self, X: &[SVector<T, D>]) -> Box<dyn InternalAtPoints<T> + '_> {
        Box::new(PlainPoints { solution: self, X: X.to_vec() })
    }
    /// Prepares fields that follow from the history of each particle for times up to `end`: tables that
    /// [`body_force_at`](Self::body_force_at) and [`state_at`](Self::state_at) then use. Solutions that are formulas need none.
    ///
    /// # Errors
    ///
    /// The reason where a history cannot be followed.
    fn prepare_until(&self, _end: T) -> Result<(), String> {
        Ok(())
    }
    /// The speed that CFL numbers refer to, `sqrt(E/rho0)` unless the specification says otherwise.
    fn wave_speed(&self) -> T;
    /// The time after which the motion repeats, or a study ends.
    fn period(&self) -> T;
}

/// A solution whose dimension is known at run time only.
#[non_exhaustive]
pub enum AnySolution<T: Real> {
    /// One dimension.
    One(Box<dyn Solution<T, 1>>),
    /// Two dimensions.
    Two(Box<dyn Solution<T, 2>>),
    /// Three dimensions.
    Three(Box<dyn Solution<T, 3>>),
}

impl AnySolution<f64> {
    /// Every field at position `X` and time `t`, each by its own function, with its letter and its entries row by row;
    /// last, as `b staged` and `b lattice`, the body force by way of [`Solution::body_force_at`] of one point and of many that
    /// share their coordinates, and as `u staged`, `v staged`, `F staged` and `P staged` the fields of [`Solution::state_at`].
    ///
    /// `None` where `X` has not as many coordinates as the solution has dimensions.
    #[must_use]
    pub fn each_field(&self, X: &[f64], t: f64) -> Option<Vec<(&'static str, Vec<f64>)>> {
        match self {
            AnySolution::One(solution) => each_field(&**solution, X, t),
            AnySolution::Two(solution) => each_field(&**solution, X, t),
            AnySolution::Three(solution) => each_field(&**solution, X, t),
        }
    }
}

/// The number of copies of a point that count as a lattice.
const ENOUGH_FOR_LATTICE: usize = 3 * POINTS_A_LAYER;

fn each_field<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Option<Vec<(&'static str, Vec<f64>)>> {
    let X = &SVector::from(<[f64; D]>::try_from(X).ok()?);
    let vector = |v: SVector<f64, D>| v.iter().copied().collect();
    let matrix = |A: SMatrix<f64, D, D>| A.transpose().iter().copied().collect();
    let [mut staged, mut on_lattice] = [[SVector::zeros()]; 2];
    solution.body_force_at(&[*X]).evaluate(t, 0, &mut staged);
    solution.body_force_at(&[*X; ENOUGH_FOR_LATTICE]).evaluate(t, 0, &mut on_lattice);
    let mut run = [StateRun::zero()];
    solution.state_at(&[*X]).evaluate(t, t, 0, &mut run);
    let [run] = run;
    let first = |rows: [[f64; BLOCK]; D]| rows.map(|row| row[0]).to_vec();
    let firsts = |rows: [[[f64; BLOCK]; D]; D]| rows.map(first).concat();
    Some(vec![
        ("u", vector(solution.displacement(X, t))),
        ("v", vector(solution.velocity(X, t))),
        ("a", vector(solution.acceleration(X, t))),
        ("H", matrix(solution.displacement_gradient(X, t))),
        ("F", matrix(solution.deformation_gradient(X, t))),
        ("J", vec![solution.jacobian(X, t)]),
        ("P", matrix(solution.first_piola_kirchhoff(X, t))),
        ("b", vector(solution.body_force(X, t))),
        ("b staged", vector(staged[0])),
        ("b lattice", vector(on_lattice[0])),
        ("u staged", first(run.u)),
        ("v staged", first(run.v)),
        ("F staged", firsts(run.F)),
        ("P staged", firsts(run.P)),
    ])
}
