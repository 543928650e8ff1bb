//! Equilibrium, from the undeformed body to the whole load, by Newton's method.
//!
//! The splines, the points and the law are those of [`TotalLagrangian`](super::TotalLagrangian), and so are the conditions on the sides. At
//! a load factor `s` the coefficients of the displacement obey
//!
//! ```text
//! f_int(u) = s f_ext,  f_int = sum V P(F) dN/dX,  f_ext = sum m b N + sum T N dA
//! ```
//!
//! with `s` times the given displacement on sides whose motion is given. From one equilibrium to another, as on a path of loads, both go
//! from those of the first to those of the second. The matrix of Newton's steps has the tangents `A = dP/dF` of the
//! law at the points ([`Differentiated`](mmsmith_laws::Differentiated)), exact but for rounding, so that residuals fall by their squares; it
//! is summed cell after cell, in an order that does not depend on the number of threads.
//!
//! A load step begins with one step of Newton's that moves the sides as well, from the equilibrium before it, so that the motion of a side
//! is not taken up by the cells beside it alone. A step that turns a point inside out, or that brings forces and motion no nearer to
//! equilibrium, is halved; where that does not help, the load step is.
//!
//! Sources: J. Bonet and R. D. Wood, "Nonlinear Continuum Mechanics for Finite Element Analysis", 2nd ed. (2008), chapters 8 and 9
//! (linearisation, line search, load increments); J. Nocedal and S. J. Wright, "Numerical Optimization", 2nd ed. (2006), section 11.1 (the
//! quadratic convergence of Newton's method).

mod newton;
mod numbering;
mod rigid;
mod stiffness;

use std::{array, mem};

use mmsmith_laws::fault::{Fault, Planted};
use mmsmith_laws::{Differentiated, Law, Stressed, Tangent};
use mmsmith_particles::{Particles, SetupError};
use mmsmith_sparse::{Factors as SparseFactors, Pattern};
use nalgebra::{SMatrix, SVector};
use thiserror::Error;

use super::basis::{Basis, MOST_DEGREE};
use super::boundary::{BoundaryData, Face, Quantity};
use super::component::{Component, Factors, Field, along, each_component};
use super::fit::{Fit, Line};
use super::quadrature::Quadrature;
use super::set_up::{Grid, bases, check_grid, faces, fits, line, particles};
use super::stress::is_deformation;
use numbering::Numbering;
use rigid::{Pin, pins};
use stiffness::{Cells, Stiffness};

/// The load of a body at rest.
pub struct Loads<'a, const D: usize> {
    /// The body force per mass at a reference position, Cartesian.
    pub body_force: &'a dyn Fn(&SVector<f64, D>) -> SVector<f64, D>,
    /// Displacements and tractions on sides.
    pub boundary: &'a dyn BoundaryData<D>,
    /// The time of what is given on the sides.
    pub time: f64,
}

/// How a solution was reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Equilibrium {
    /// The load steps, the last of which ends at the whole load.
    pub steps: Vec<LoadStep>,
    /// How often a load step was given up and begun again with half its length.
    pub cut_backs: usize,
}

/// Newton's method converges quadratically where the exponent of the last residuals is at least this.
pub const QUADRATIC: f64 = 1.8;

/// Iterations converge no better than linearly where the exponent of the last residuals is at most this. Between this and [`QUADRATIC`] it
/// cannot be told: residuals have not come to their last exponent, or the tangent is near the derivative.
pub const LINEAR: f64 = 1.2;

/// A load step.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadStep {
    /// The load factor at its end.
    pub factor: f64,
    /// The norms of the residual, a force: that of the first linear system, and that after each step of Newton's.
    pub residuals: Vec<f64>,
    /// The norm that rounding alone may leave.
    pub rounding: f64,
    /// How often a step of Newton's was halved.
    pub halvings: usize,
    /// How the last system was solved.
    pub factors: SparseFactors,
}

impl LoadStep {
    /// The exponent of the last three residuals that are more than rounding, `ln(r3/r2)/ln(r2/r1)`: 2 of Newton's method. None of fewer.
    ///
    /// The first one of all is that of the undeformed body or of a moved side, before any step, and says nothing of the method. A
    /// residual that has reached rounding would have fallen further: it counts where the exponent is that of Newton's method even so.
    #[must_use]
    pub fn exponent(&self) -> Option<f64> {
        newton_exponent(&self.residuals, self.rounding)
    }
}

/// The exponent of [`LoadStep::exponent`] of a history of residuals of which rounding alone may leave this much.
#[must_use]
pub fn newton_exponent(residuals: &[f64], rounding: f64) -> Option<f64> {
    /// Residuals below this multiple of rounding say nothing of the method.
    const CLEAR: f64 = 10.0;
    /// The least exponent that a residual at rounding may tell.
    const TOLD: f64 = QUADRATIC;
    let after = residuals.get(1..)?;
    let clear = after.iter().take_while(|r| **r > CLEAR * rounding).count();
    let ending_at = |last: usize| {
        let [r1, r2, r3] = *after.get(last.checked_sub(2)?..=last)?.as_array()?;
        let exponent = (r3 / r2).ln() / (r2 / r1).ln();
        (r2 < r1 && r3 < r2).then_some(exponent)
    };
    let above = clear.checked_sub(1).and_then(ending_at);
    let reached = ending_at(clear).filter(|exponent| *exponent >= TOLD);
    match (above, reached) {
        (Some(above), Some(reached)) => Some(above.max(reached)),
        (above, reached) => above.or(reached),
    }
}

/// An equilibrium, from which a body goes on to another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// Coefficients of the displacement, forces, and displacements of sides, by component.
    u: Vec<Vec<f64>>,
    forces: Vec<Vec<f64>>,
    given: Vec<Vec<f64>>,
}

/// Why a body has no equilibrium here.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StaticsError {
    /// A scene that makes no sense.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A degree of splines that there is not.
    #[error(
        "splines of degree {degree} are not supported; the degree has to be 1 to {MOST_DEGREE}"
    )]
    Degree {
        /// The degree asked for.
        degree: usize,
    },
    /// An equilibrium of a body with other coefficients.
    #[error("the equilibrium to go on from is that of another grid")]
    OtherGrid,
    /// A matrix that does not fit.
    #[error("the matrix of {unknowns} unknowns does not fit into memory")]
    Memory {
        /// The number of unknowns.
        unknowns: usize,
    },
    /// Newton's method does not get on.
    #[error(
        "load factor {factor:.6}, {reached:.6} reached, after {cut_backs} cut-back(s): {cause}"
    )]
    NotReached {
        /// The load factor of the step that failed.
        factor: f64,
        /// That of the equilibrium before it.
        reached: f64,
        /// Load steps that were halved before.
        cut_backs: usize,
        /// The norms of the residual in this step.
        residuals: Vec<f64>,
        /// The obstacle.
        cause: Obstacle,
    },
}

/// An obstacle to Newton's method.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Obstacle {
    /// A point is turned inside out, or has numbers that are not finite.
    #[error("point {point} at X = {X:.6?} has J = {J:.3e}")]
    Inverted {
        /// Its number.
        point: usize,
        /// Its reference position.
        X: Vec<f64>,
        /// Its determinant of F.
        J: f64,
    },
    /// The residual does not fall.
    #[error("the residual stays at {residual:.3e}, where rounding leaves {rounding:.1e}")]
    Stalled {
        /// Its norm.
        residual: f64,
        /// The norm that rounding alone may leave.
        rounding: f64,
    },
    /// The factors of the stiffness matrix do not fit.
    #[error("the factors of the stiffness matrix do not fit into memory")]
    Memory,
    /// The stiffness matrix has no inverse.
    #[error("the stiffness matrix is singular: the body can move without a force, or buckles")]
    Singular,
}

/// A body that is solved for its equilibrium.
pub trait AtRest<const D: usize> {
    /// Reference positions of the quadrature points, Cartesian.
    fn positions(&self) -> &[SVector<f64, D>];

    /// Unknowns, and entries of their matrix.
    fn size(&self) -> [usize; 2];

    /// Places next to coefficients that have the values of the given displacement, so that the body cannot move as a whole: as many as its
    /// sides leave rigid motions free.
    fn held(&self) -> Vec<SVector<f64, D>>;

    /// Goes from the undeformed body, or the equilibrium `from`, to the whole load, in so many steps or more; `seen` is called after each
    /// step of Newton's, with the load factor and the norms of the residual.
    ///
    /// # Errors
    ///
    /// Where Newton's method does not get there, or `from` belongs to another grid.
    fn solve(
        &mut self,
        loads: &Loads<'_, D>,
        from: Option<&Reached>,
        steps: usize,
        seen: &mut dyn FnMut(f64, &[f64]),
    ) -> Result<Equilibrium, StaticsError>;

    /// The equilibrium that was reached last.
    fn reached(&self) -> Reached;

    /// The points as particles, at rest, and the law.
    fn observe(&mut self) -> (&Particles<f64, D>, &Law<f64, D>);
}

/// Not generic, so that it is compiled with this crate.
macro_rules! at_rest {
    ($($D:literal)*) => {
        $(
            impl Grid<$D> {
                /// An undeformed body on this grid with the law and the reference density, by splines of a degree from 1 on.
                ///
                /// Internal variables of a law stay what they are at time zero.
                ///
                /// # Errors
                ///
                /// Where the scene makes no sense, or does not fit into memory.
                pub fn at_rest(
                    &self,
                    degree: usize,
                    law: Law<f64, $D>,
                    density: f64,
                ) -> Result<Box<dyn AtRest<$D>>, StaticsError> {
                    Ok(Box::new(Statics::<$D>::new(self, degree, law, density)?))
                }
            }

            impl AtRest<$D> for Statics<$D> {
                fn positions(&self) -> &[SVector<f64, $D>] {
                    &self.at.X
                }

                fn size(&self) -> [usize; 2] {
                    [self.pattern.unknowns(), self.pattern.entries()]
                }

                fn held(&self) -> Vec<SVector<f64, $D>> {
                    self.pins.iter().map(|pin| pin.X).collect()
                }

                fn solve(
                    &mut self,
                    loads: &Loads<'_, $D>,
                    from: Option<&Reached>,
                    steps: usize,
                    seen: &mut dyn FnMut(f64, &[f64]),
                ) -> Result<Equilibrium, StaticsError> {
                    self.begin(from)?;
                    self.load(loads);
                    self.follow(steps, seen)
                }

                fn reached(&self) -> Reached {
                    let u = self.components.each_ref().map(|component| component.u.clone());
                    let [forces, given] = [&self.whole.forces, &self.whole.given];
                    Reached { u: u.to_vec(), forces: forces.to_vec(), given: given.to_vec() }
                }

                fn observe(&mut self) -> (&Particles<f64, $D>, &Law<f64, $D>) {
                    self.take_positions();
                    (&self.particles, &self.at.law)
                }
            }
        )*
    };
}

at_rest! { 1 2 3 }

/// Forces of a load and displacements of sides under it, by component.
#[derive(Clone)]
struct OfLoad<const D: usize> {
    forces: [Vec<f64>; D],
    given: [Vec<f64>; D],
}

/// The body, its load, and where it is.
struct Statics<const D: usize> {
    bases: [[Basis; 2]; D],
    /// Fits of what is given on sides; none where nothing is.
    fits: Option<[[Fit; D]; D]>,
    faces: Vec<Face<D>>,
    pins: Vec<Pin<D>>,
    components: [Component<D>; D],
    at: Quadrature<D>,
    particles: Particles<f64, D>,
    cells: [usize; D],
    /// Points of a cell along each axis.
    per_cell: [usize; D],
    density: f64,
    numbering: Numbering<D>,
    pattern: Pattern,
    /// Coefficients of the displacement before the load.
    start_u: [Vec<f64>; D],
    /// The load at its beginning, and the whole one.
    start: OfLoad<D>,
    whole: OfLoad<D>,
    F: Vec<SMatrix<f64, D, D>>,
    P: Vec<SMatrix<f64, D, D>>,
    tangents: Vec<Tangent<D>>,
    planted: Planted,
}

impl<const D: usize> Statics<D> {
    fn new(
        grid: &Grid<D>,
        degree: usize,
        law: Law<f64, D>,
        density: f64,
    ) -> Result<Self, StaticsError> {
        const { assert!(1 <= D && D <= 3, "one, two or three dimensions") };
        if !(1..=MOST_DEGREE).contains(&degree) {
            return Err(StaticsError::Degree { degree });
        }
        check_grid(grid, degree, density)?;
        let lines: [Line; D] = array::from_fn(|k| line(grid, k));
        let bases = bases(grid, degree, &lines)?;
        let faces = faces(grid, &lines);
        let singular = |axis: usize| SetupError::SingularMass { axis, per_cell: grid.per_cell };
        let pins = pins(grid, &bases, &lines);
        let fits = match faces.iter().any(|face| face.moved) || !pins.is_empty() {
            true => Some(fits(grid, &bases, &lines).map_err(singular)?),
            false => None,
        };
        let pinned: Vec<_> = pins.iter().map(|pin| pin.coefficient).collect();
        let numbering = Numbering::new(&grid.axes, &bases, &faces, &pinned);
        let unknowns = numbering.count;
        let pattern = numbering.pattern().map_err(|_| StaticsError::Memory { unknowns })?;
        let components = array::from_fn(|index| Component::new(index, &bases));
        let at = Quadrature::new(grid, &lines, law);
        let mut particles = particles(grid, &lines, density);
        particles.internal = at.given(0, at.X.len()).to_vec();
        let count = at.X.len();
        let coefficients = |component: &Component<D>| vec![0.0; component.u.len()];
        let none = OfLoad {
            forces: components.each_ref().map(coefficients),
            given: components.each_ref().map(coefficients),
        };
        Ok(Self {
            start_u: components.each_ref().map(coefficients),
            start: none.clone(),
            whole: none,
            F: vec![SMatrix::identity(); count],
            P: vec![SMatrix::zeros(); count],
            tangents: vec![[[SMatrix::zeros(); D]; D]; count],
            cells: grid.axes.each_ref().map(|axis| axis.cells),
            per_cell: grid.axes.each_ref().map(|axis| axis.count(grid.per_cell) / axis.cells),
            planted: Planted::here(),
            bases,
            fits,
            faces,
            pins,
            components,
            at,
            particles,
            density,
            numbering,
            pattern,
        })
    }

    /// Takes the place of an equilibrium, or of the undeformed body.
    fn begin(&mut self, from: Option<&Reached>) -> Result<(), StaticsError> {
        let Self { components, start, start_u: u, .. } = self;
        let OfLoad { forces, given } = start;
        let Some(from) = from else {
            components.iter_mut().for_each(|component| component.u.fill(0.0));
            forces.iter_mut().chain(given).chain(u).for_each(|values| values.fill(0.0));
            return Ok(());
        };
        let own: Vec<&mut Vec<f64>> = u.iter_mut().chain(forces).chain(given).collect();
        let other: Vec<&Vec<f64>> = from.u.iter().chain(&from.forces).chain(&from.given).collect();
        let lengths = other.iter().map(|values| values.len());
        if !own.iter().map(|values| values.len()).eq(lengths) {
            return Err(StaticsError::OtherGrid);
        }
        own.into_iter().zip(other).for_each(|(own, other)| own.clone_from(other));
        components.iter_mut().zip(&self.start_u).for_each(|(own, u)| own.u.clone_from(u));
        Ok(())
    }

    /// Forms the forces of the whole load, and the displacements of sides under it.
    fn load(&mut self, loads: &Loads<'_, D>) {
        let Self { bases, fits, faces, pins, numbering, components, at, whole, .. } = self;
        let OfLoad { forces, given } = whole;
        let density = self.density;
        for (p, X) in at.X.iter().enumerate() {
            let b = at.in_frame(p, &(loads.body_force)(X)) * (density * at.volume[p]);
            components.iter_mut().for_each(|own| own.values[p] = b[own.index]);
        }
        for (component, forces) in components.iter_mut().zip(forces.iter_mut()) {
            component.integrate(bases, Factors::Values, forces);
        }
        for face in faces {
            let quantity = if face.moved { Quantity::Displacement } else { Quantity::Traction };
            face.ask(loads.boundary, quantity, loads.time);
            for (c, component) in components.iter().enumerate() {
                let functions = component.functions(bases);
                match fits {
                    Some(fits) if face.moves(c) => {
                        let axis = |k: usize| (&fits[k][c], along(bases, k, c));
                        face.set(&functions, &face.fit(c, axis), &mut given[c]);
                    }
                    _ if face.loads(c) => {
                        let of_side = face.load(c, |k| along(bases, k, c));
                        face.add(&functions, &of_side, &mut forces[c]);
                    }
                    _ => {}
                }
            }
        }
        let Some(fits) = fits else { return };
        for Pin { coefficient, face, .. } in pins {
            face.ask(loads.boundary, Quantity::Displacement, loads.time);
            let c = coefficient.component;
            let of_side = face.fit(c, |k| (&fits[k][c], along(bases, k, c)));
            let mut of_body = vec![0.0; given[c].len()];
            face.set(&components[c].functions(bases), &of_side, &mut of_body);
            for place in numbering.copies(coefficient) {
                given[c][place] = of_body[place];
            }
        }
    }

    /// Where points are, with their deformation gradients.
    fn take_positions(&mut self) {
        self.deform(Field::Displacement);
        let Self { at, components, particles, F, .. } = self;
        let field = at.of(components);
        for p in 0..at.X.len() {
            let local = field.value(p);
            let u = at.rows.get(p / at.row).map_or(local, |row| row.frame * local);
            particles.x[p] = at.X[p] + u;
        }
        particles.F.copy_from_slice(F);
    }

    /// The deformation gradients of the displacements; the first point where it is none.
    fn deform(&mut self, field: Field) -> Option<usize> {
        let Self { bases, components, at, F, .. } = self;
        each_component(components, &|component| component.evaluate(bases, field, true));
        let field = at.of(components);
        mmsmith_threads::each_chunk(F, 256, &|piece, F| {
            for (n, F) in F.iter_mut().enumerate() {
                *F = SMatrix::identity() + field.at(piece * 256 + n);
            }
        });
        F.iter().position(|F| !is_deformation(F))
    }
}

impl<const D: usize> Statics<D>
where
    f64: Stressed<D> + Differentiated<D>,
{
    /// The residual at a load factor, by component; or the first point that has no stress.
    fn residual(&mut self, factor: f64) -> Result<[Vec<f64>; D], usize> {
        if let Some(point) = self.deform(Field::Displacement) {
            return Err(point);
        }
        let Self { at, F, P, .. } = self;
        at.all_stresses(F, P);
        let stresses = mem::take(&mut self.P);
        let is_finite = |P: &SMatrix<f64, D, D>| P.iter().all(|entry| entry.is_finite());
        let bad = stresses.iter().position(|P| !is_finite(P));
        let mut residual = self.integrated(&stresses);
        self.P = stresses;
        for (sums, (start, whole)) in
            residual.iter_mut().zip(self.start.forces.iter().zip(&self.whole.forces))
        {
            for (sum, (start, whole)) in sums.iter_mut().zip(start.iter().zip(whole)) {
                *sum += (1.0 - factor) * start + factor * whole;
            }
        }
        match bad {
            Some(point) => Err(point),
            None => Ok(residual),
        }
    }

    /// The forces of Cartesian stresses, by component.
    fn integrated(&mut self, stresses: &[SMatrix<f64, D, D>]) -> [Vec<f64>; D] {
        let Self { bases, components, at, .. } = self;
        at.set_forces(components, stresses);
        let is_curvilinear = at.coordinates.are_curvilinear();
        let factors = if is_curvilinear { Factors::Both } else { Factors::Slopes };
        let mut sums = components.each_ref().map(|own| vec![0.0; own.u.len()]);
        for (component, sums) in components.iter_mut().zip(&mut sums) {
            component.integrate(bases, factors, sums);
        }
        sums
    }

    /// Forms the tangents and the matrix at the state whose residual was formed last.
    fn stiffness(&mut self) -> Stiffness {
        let Self { at, F, P, tangents, planted, .. } = self;
        at.all_tangents(F, tangents);
        if planted.is(Fault::GeometricStiffnessDropped) {
            for ((A, F), P) in tangents.iter_mut().zip(&*F).zip(&*P) {
                let S = F.try_inverse().unwrap_or_else(SMatrix::identity) * P;
                for (i, k) in (0..D).flat_map(|i| (0..D).map(move |k| (i, k))) {
                    (0..D).for_each(|j| A[i][k][(i, j)] -= S[(j, k)]);
                }
            }
        }
        let Self { bases, cells, per_cell, at, numbering, tangents, components, pattern, .. } =
            self;
        let (cells, per_cell) = (*cells, *per_cell);
        let cells = Cells { bases, cells, per_cell, at, numbering, tangents, components };
        cells.stiffness(pattern)
    }

    /// The forces that the stiffness makes of a change of the coefficients, by component, at the tangents that were formed last; what
    /// stands at the points is lost.
    fn product(&mut self, change: &[Vec<f64>; D]) -> [Vec<f64>; D] {
        let own = self.components.each_mut().map(|component| mem::take(&mut component.u));
        self.components.iter_mut().zip(change).for_each(|(to, from)| to.u.clone_from(from));
        let Self { bases, components, at, tangents, .. } = self;
        each_component(components, &|component| {
            component.evaluate(bases, Field::Displacement, true);
        });
        let field = at.of(components);
        let changes: Vec<SMatrix<f64, D, D>> = tangents
            .iter()
            .enumerate()
            .map(|(p, A)| {
                let H = field.at(p);
                let mut P = SMatrix::zeros();
                for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
                    P += A[k][l] * H[(k, l)];
                }
                P
            })
            .collect();
        let forces = self.integrated(&changes);
        self.components.iter_mut().zip(own).for_each(|(to, from)| to.u = from);
        forces
    }
}
