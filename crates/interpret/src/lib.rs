//! Manufactured solutions evaluated straight from their specifications, without generated code.
//!
//! [`interpret`] turns a specification into the same interface that [generated solutions](mmsmith_runtime) have, so that a file can
//! be checked before anything is generated from it. It evaluates the straight-line program that the generator
//! translates, in the same stages, to the same bits in both precisions; for work on many points the generated code is
//! faster.

mod arrays;
mod history;
mod lattice;
mod staged;
mod table_file;

pub use arrays::{Arrays, ArraysAtPoints, Quantity};
pub use mmsmith_history::followed as histories_followed;
pub use table_file::{FieldShape, Over, TableFile, TableFileError, TabulatedField};

use history::{Chart, Histories, HistoryProblem, Moment, Prepared, Quantities};
use lattice::LatticeStages;
use mmsmith_expr::{Program, Scalar, Slot};
use mmsmith_history::HistoryError;
use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use mmsmith_runtime::{
    AnySolution, Around, BLOCK, BodyForceAtPoints, Boundary, Domain, Fields, HistoryReport,
    InternalAtPoints, Lattice, Law, ParameterError, PlainPoints, Real, Solution, StateAtPoints,
    StateRun, Surface,
};
use mmsmith_spec::{self as spec, Coordinates, DeriveError, Spec};
use mmsmith_stage::{FieldName, Measures, Sides, Staged, TubeMeasures};
use staged::PointStages;
use std::ops::Range;
use thiserror::Error;

/// Why a specification could not be interpreted.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum InterpretError {
    /// A field is nowhere defined.
    #[error(transparent)]
    Derive(#[from] DeriveError),
    /// A parameter value is not admissible.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The history of the law's internal variables cannot be formed.
    #[error(transparent)]
    History(#[from] HistoryProblem),
}

/// The solution that `spec` describes, with the defaults of its parameters but for `overrides`.
///
/// # Errors
///
/// [`InterpretError`] where a field is nowhere defined or a parameter is unknown or not admissible.
pub fn interpret<'a>(
    spec: &Spec,
    overrides: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<AnySolution<f64>, InterpretError> {
    interpret_fields(spec, spec.derive()?, overrides)
}

/// As [`interpret`], with fields that are not those of the specification's own derivation: to see what a check says of
/// them. Their graph must have grown from the specification's own, which its constants refer to.
///
/// # Errors
///
/// [`InterpretError`] where a parameter is unknown or not admissible.
pub fn interpret_fields<'a>(
    spec: &Spec,
    fields: spec::Fields,
    overrides: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<AnySolution<f64>, InterpretError> {
    interpret_staged(spec, &Staged::of(spec, fields), overrides)
}

/// As [`interpret`], where the fields of `spec` are staged already: one `staged` serves any number of parameter values.
///
/// # Errors
///
/// [`InterpretError`] where a parameter is unknown or not admissible.
pub fn interpret_staged<'a>(
    spec: &Spec,
    staged: &Staged,
    overrides: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<AnySolution<f64>, InterpretError> {
    of_doubles(spec, staged, resolve(spec, overrides)?)
}

/// As [`interpret_staged`], for solvers in single precision: all is evaluated in it, as generated code does.
///
/// # Errors
///
/// [`InterpretError`] where a parameter is unknown or not admissible.
pub fn interpret_staged_single<'a>(
    spec: &Spec,
    staged: &Staged,
    overrides: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<AnySolution<f32>, InterpretError> {
    in_single(spec, staged, resolve(spec, overrides)?)
}

/// Not generic, so that [`Interpreted`] is compiled in this crate, and not in each that calls it.
fn of_doubles(
    spec: &Spec,
    staged: &Staged,
    values: Vec<f64>,
) -> Result<AnySolution<f64>, InterpretError> {
    build(spec, staged, values)
}

/// Not generic, as [`of_doubles`].
fn in_single(
    spec: &Spec,
    staged: &Staged,
    values: Vec<f64>,
) -> Result<AnySolution<f32>, InterpretError> {
    build(spec, staged, values)
}

/// The solution at admissible values of the parameters, in the precision that these are rounded to.
fn build<T: Interpretable>(
    spec: &Spec,
    staged: &Staged,
    values: Vec<f64>,
) -> Result<AnySolution<T>, InterpretError> {
    let values: Vec<T> = values.into_iter().map(T::nearest).collect();
    Ok(match spec.dimension {
        1 => AnySolution::One(Box::new(Interpreted::<T, 1>::new(spec, staged, values)?)),
        2 => AnySolution::Two(Box::new(Interpreted::<T, 2>::new(spec, staged, values)?)),
        _ => AnySolution::Three(Box::new(Interpreted::<T, 3>::new(spec, staged, values)?)),
    })
}

/// A precision in which solutions are interpreted: `f32` or `f64`.
pub(crate) trait Interpretable: Real + Scalar {}

impl<T: Real + Scalar> Interpretable for T {}

fn resolve<'a>(
    spec: &Spec,
    overrides: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<Vec<f64>, ParameterError> {
    let mut values: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
    for (name, value) in overrides {
        let Some(index) = spec.parameters.iter().position(|p| p.name == name) else {
            return Err(ParameterError::Unknown {
                solution: spec.name.clone(),
                name: name.to_owned(),
                known: spec.parameters.iter().map(|p| p.name.clone()).collect(),
            });
        };
        values[index] = value;
    }
    for (parameter, &value) in spec.parameters.iter().zip(&values) {
        if !value.is_finite() || !parameter.bounds.iter().all(|bound| bound.admits(value)) {
            let range = &parameter.range;
            return Err(ParameterError::OutOfRange {
                solution: spec.name.clone(),
                name: parameter.name.clone(),
                value,
                admissible: if range.is_empty() { "a finite number".into() } else { range.clone() },
            });
        }
    }
    Ok(values)
}

/// The programs of one solution, with the values of its parameters.
struct Interpreted<T: Interpretable, const D: usize> {
    parameters: Vec<T>,
    displacement: Program,
    velocity: Program,
    acceleration: Program,
    displacement_gradient: Program,
    deformation_gradient: Program,
    jacobian: Program,
    first_piola_kirchhoff: Program,
    body_force: Program,
    strain_energy: Option<Program>,
    stretch_across: Option<Program>,
    tractions: Vec<(Surface, Program)>,
    body_force_stages: PointStages<1>,
    /// The body force at the points of a lattice, where that has a form of its own.
    lattice_stages: Option<LatticeStages>,
    /// Stages of `u`, `F` and `P`, and of `v`.
    state_stages: PointStages<2>,
    domain: Domain<T, D>,
    boundaries: Vec<Boundary>,
    cell_length: T,
    law: Law<T>,
    density: T,
    density_here: Option<Program>,
    wave_speed: T,
    period: T,
    /// Where the law has internal variables: then the programs of stress and body force are empty.
    history: Option<Histories<D>>,
}

impl<T: Interpretable, const D: usize> Interpreted<T, D> {
    fn new(spec: &Spec, staged: &Staged, parameters: Vec<T>) -> Result<Self, InterpretError> {
        let program = staged.program();
        let part = |slots: &[Slot]| program.part(slots);
        let at_parameters = inputs(&[T::zero(); D], T::zero(), &parameters);
        let constants = |slots: &[Slot]| part(slots).evaluate_in(&at_parameters);
        let constant = |slot: Slot| constants(&[slot])[0];
        for (requirement, &Sides { left, right }) in
            spec.requirements.iter().zip(&staged.requirements)
        {
            if !requirement.relation.holds(constant(left).to_f64(), constant(right).to_f64()) {
                let pairs = spec.parameters.iter().zip(&parameters);
                let values: Vec<String> =
                    pairs.map(|(p, value)| format!("{} = {:?}", p.name, value.to_f64())).collect();
                return Err(InterpretError::Parameter(ParameterError::Requirement {
                    solution: spec.name.clone(),
                    requirement: requirement.text.clone(),
                    values: values.join(", "),
                }));
            }
        }
        let domain = match &staged.constants.domain {
            Measures::Box { lower, upper } => Domain::Box {
                lower: SVector::from_row_slice(&constants(lower)),
                upper: SVector::from_row_slice(&constants(upper)),
            },
            &Measures::Annulus { inner, outer } => {
                Domain::Annulus { inner: constant(inner), outer: constant(outer) }
            }
            Measures::Tube(measures) => {
                let TubeMeasures { inner, outer, lower, upper, around } =
                    measures.clone().map(constant);
                let around = match around {
                    spec::Around::Axisymmetric => Around::Axisymmetric,
                    spec::Around::Whole => Around::Whole,
                    spec::Around::Sector { from, to } => Around::Sector { from, to },
                };
                Domain::Tube { inner, outer, lower, upper, around }
            }
        };
        let field = |name: FieldName| part(staged.field(name));
        let law = staged.constants.law.clone().map(constant);
        let density = constant(staged.constants.density);
        let density_here = staged.density_here.map(|density| part(&[density]));
        let history = match &staged.history {
            None => None,
            Some(history) => Some(Histories::new(
                &law.clone().map(Real::to_f64),
                history,
                parameters.iter().map(|value| Real::to_f64(*value)).collect(),
                Chart::of(&domain).ok_or(HistoryProblem::Shape)?,
                spec.coordinates == Coordinates::Cartesian,
                (Real::to_f64(density), density_here.clone()),
            )?),
        };
        Ok(Interpreted {
            history,
            displacement: field(FieldName::Displacement),
            velocity: field(FieldName::Velocity),
            acceleration: field(FieldName::Acceleration),
            displacement_gradient: field(FieldName::DisplacementGradient),
            deformation_gradient: field(FieldName::DeformationGradient),
            jacobian: field(FieldName::Jacobian),
            first_piola_kirchhoff: field(FieldName::FirstPiolaKirchhoff),
            body_force: field(FieldName::BodyForce),
            strain_energy: staged.energy.map(|energy| part(&[energy])),
            stretch_across: staged.across.map(|stretch| part(&[stretch])),
            tractions: staged
                .tractions
                .iter()
                .map(|traction| (traction.surface, part(&traction.outputs)))
                .collect(),
            body_force_stages: PointStages::new::<D>(program, [&staged.body_force]),
            lattice_stages: staged
                .lattice
                .as_ref()
                .map(|lattice| LatticeStages::new(program, lattice)),
            state_stages: PointStages::new::<D>(program, [&staged.state, &staged.velocity]),
            domain,
            boundaries: spec.boundaries.clone(),
            cell_length: constant(staged.constants.cell_length),
            law,
            density,
            density_here,
            wave_speed: constant(staged.constants.wave_speed),
            period: constant(staged.constants.period),
            parameters,
        })
    }

    fn vector(&self, program: &Program, X: &SVector<T, D>, t: T) -> SVector<T, D> {
        SVector::from_row_slice(&program.evaluate_in(&inputs(X.as_slice(), t, &self.parameters)))
    }

    fn matrix(&self, program: &Program, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D> {
        SMatrix::from_row_slice(&program.evaluate_in(&inputs(X.as_slice(), t, &self.parameters)))
    }
}

/// Coordinates, time and parameters, in the order of the programs' inputs.
fn inputs<T: Interpretable>(X: &[T], t: T, parameters: &[T]) -> Vec<T> {
    X.iter().copied().chain([t]).chain(parameters.iter().copied()).collect()
}

impl<T: Interpretable, const D: usize> Solution<T, D> for Interpreted<T, D> {
    fn displacement(&self, X: &SVector<T, D>, t: T) -> SVector<T, D> {
        self.vector(&self.displacement, X, t)
    }

    fn velocity(&self, X: &SVector<T, D>, t: T) -> SVector<T, D> {
        self.vector(&self.velocity, X, t)
    }

    fn acceleration(&self, X: &SVector<T, D>, t: T) -> SVector<T, D> {
        self.vector(&self.acceleration, X, t)
    }

    fn displacement_gradient(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D> {
        self.matrix(&self.displacement_gradient, X, t)
    }

    fn deformation_gradient(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D> {
        self.matrix(&self.deformation_gradient, X, t)
    }

    fn jacobian(&self, X: &SVector<T, D>, t: T) -> T {
        self.jacobian.evaluate_in(&inputs(X.as_slice(), t, &self.parameters))[0]
    }

    fn first_piola_kirchhoff(&self, X: &SVector<T, D>, t: T) -> SMatrix<T, D, D> {
        if let Some(history) = &self.history {
            return stress_of(history.stressed(in_double(X), t.to_f64()).ok().map(|found| found.P));
        }
        self.matrix(&self.first_piola_kirchhoff, X, t)
    }

    fn body_force(&self, X: &SVector<T, D>, t: T) -> SVector<T, D> {
        if let Some(history) = &self.history {
            return force_of(&history.response(in_double(X), t.to_f64()));
        }
        self.vector(&self.body_force, X, t)
    }

    fn has_form_on_lattice(&self) -> bool {
        self.lattice_stages.is_some()
    }

    fn body_force_on(
        &self,
        X: &[SVector<T, D>],
        lattice: Option<Lattice<T, D>>,
    ) -> Box<dyn BodyForceAtPoints<T, D> + '_> {
        if let Some(history) = &self.history {
            return match self.prepared(history, Quantities::BodyForce, X) {
                Some(points) => Box::new(points),
                None => Box::new(PlainPoints { solution: self, X: X.to_vec() }),
            };
        }
        if let (Some(stages), Some(lattice)) = (&self.lattice_stages, lattice) {
            return Box::new(stages.at(lattice, &self.parameters, self));
        }
        Box::new(self.body_force_stages.at(X, &self.parameters))
    }

    fn state_at(&self, X: &[SVector<T, D>]) -> Box<dyn StateAtPoints<T, D> + '_> {
        let motion = self.state_stages.at(X, &self.parameters);
        if let Some(history) = &self.history {
            return match self.prepared(history, Quantities::Stress, X) {
                Some(points) => Box::new(StateWithHistory { motion, points }),
                None => Box::new(PlainPoints { solution: self, X: X.to_vec() }),
            };
        }
        Box::new(motion)
    }

    fn traction(&self, surface: Surface, X: &SVector<T, D>, t: T) -> Option<SVector<T, D>> {
        if self.history.is_some() {
            let normal = self.domain.normal(surface, X)?;
            return Some(self.first_piola_kirchhoff(X, t) * normal);
        }
        let (_, program) = self.tractions.iter().find(|(known, _)| *known == surface)?;
        Some(self.vector(program, X, t))
    }

    fn internal_variables(&self) -> Vec<String> {
        self.history.as_ref().map_or_else(Vec::new, |history| history.names.clone())
    }

    fn internal(&self, X: &SVector<T, D>, t: T) -> Vec<T> {
        let Some(history) = &self.history else { return Vec::new() };
        match history.stressed(in_double(X), t.to_f64()) {
            Ok(found) => found.internal.into_iter().map(T::nearest).collect(),
            Err(_) => vec![T::nearest(f64::NAN); history.names.len()],
        }
    }

    fn internal_at(&self, X: &[SVector<T, D>]) -> Box<dyn InternalAtPoints<T> + '_> {
        let prepared = self.history.as_ref().and_then(|history| {
            let quantities = Quantities::Internal;
            self.prepared(history, quantities, X)
        });
        match prepared {
            Some(points) => Box::new(points),
            None => Box::new(PlainPoints { solution: self, X: X.to_vec() }),
        }
    }

    fn history(&self, X: &[SVector<T, D>], end: T) -> Result<Option<HistoryReport>, String> {
        let Some(history) = &self.history else { return Ok(None) };
        let X: Vec<[f64; D]> = X.iter().map(in_double).collect();
        history.report(&X, end.to_f64()).map(Some).map_err(|error| error.to_string())
    }

    fn prepare_until(&self, end: T) -> Result<(), String> {
        let Some(history) = &self.history else { return Ok(()) };
        history.tables_until(end.to_f64()).map(|_| ()).map_err(|error| error.to_string())
    }

    fn fields(&self, X: &SVector<T, D>, t: T) -> Fields<T, D> {
        if let Some(history) = &self.history {
            let response = history.response(in_double(X), t.to_f64());
            return Fields {
                P: stress_of(response.as_ref().ok().map(|response| response.P)),
                b: force_of(&response),
                u: self.displacement(X, t),
                v: self.velocity(X, t),
                a: self.acceleration(X, t),
                H: self.displacement_gradient(X, t),
                F: self.deformation_gradient(X, t),
                J: self.jacobian(X, t),
            };
        }
        Fields {
            u: self.displacement(X, t),
            v: self.velocity(X, t),
            a: self.acceleration(X, t),
            H: self.displacement_gradient(X, t),
            F: self.deformation_gradient(X, t),
            J: self.jacobian(X, t),
            P: self.first_piola_kirchhoff(X, t),
            b: self.body_force(X, t),
        }
    }

    fn strain_energy(&self, X: &SVector<T, D>, t: T) -> Option<T> {
        let energy = self.strain_energy.as_ref()?;
        energy.evaluate_in(&inputs(X.as_slice(), t, &self.parameters)).first().copied()
    }

    fn stretch_across(&self, X: &SVector<T, D>, t: T) -> T {
        let stretch = self.stretch_across.as_ref().map(|stretch| {
            stretch.evaluate_in(&inputs(X.as_slice(), t, &self.parameters)).first().copied()
        });
        stretch.flatten().unwrap_or_else(T::one)
    }

    fn domain(&self) -> Domain<T, D> {
        self.domain.clone()
    }

    fn boundaries(&self) -> &[Boundary] {
        &self.boundaries
    }

    fn cell_length(&self) -> T {
        self.cell_length
    }

    fn law(&self) -> Law<T> {
        self.law.clone()
    }

    fn density_at(&self, X: &SVector<T, D>) -> T {
        let inputs = || inputs(X.as_slice(), T::zero(), &self.parameters);
        self.density_here.as_ref().map_or(self.density, |program| program.evaluate_in(&inputs())[0])
    }

    fn density(&self) -> T {
        self.density
    }

    fn wave_speed(&self) -> T {
        self.wave_speed
    }

    fn period(&self) -> T {
        self.period
    }
}

/// A place in double precision.
fn in_double<T: Real, const D: usize>(X: &SVector<T, D>) -> [f64; D] {
    std::array::from_fn(|i| X[i].to_f64())
}

/// The stress, not a number where a history could not be followed.
fn stress_of<T: Real, const D: usize>(P: Option<[[f64; D]; D]>) -> SMatrix<T, D, D> {
    SMatrix::from_fn(|i, j| T::nearest(P.map_or(f64::NAN, |P| P[i][j])))
}

/// The body force, not a number where a history could not be followed.
fn force_of<T: Real, const D: usize>(
    response: &Result<history::Response<D>, HistoryError>,
) -> SVector<T, D> {
    SVector::from_fn(|i, _| {
        T::nearest(response.as_ref().map_or(f64::NAN, |response| response.b[i]))
    })
}

impl<T: Interpretable, const D: usize> Interpreted<T, D> {
    /// Series of the fields at points, until the time that tables were prepared for, or for a period; none where histories cannot be
    /// followed.
    fn prepared<'a>(
        &'a self,
        history: &'a Histories<D>,
        quantities: Quantities,
        X: &[SVector<T, D>],
    ) -> Option<Prepared<'a, D>> {
        let tables = match history.tables() {
            Some(tables) => tables,
            None => history.tables_until(self.period.to_f64()).ok()?,
        };
        let X: Vec<[f64; D]> = X.iter().map(in_double).collect();
        Some(Prepared::new(history, tables, quantities, &X))
    }
}

impl<T: Interpretable, const D: usize> BodyForceAtPoints<T, D> for Prepared<'_, D> {
    fn evaluate(&self, t: T, first: usize, b: &mut [SVector<T, D>]) {
        let moment = self.moment(t.to_f64());
        for (n, b) in (first..).zip(b) {
            let own = self.body_force(n, &moment);
            *b = SVector::from_fn(|i, _| T::nearest(own[i]));
        }
    }

    fn of_time(&self, t: T, values: &mut Vec<T>) {
        self.moment(t.to_f64()).put(t, values);
    }

    fn evaluate_of(&self, time: &[T], points: &[u32], b: &mut [SVector<T, D>]) {
        self.body_forces(points, &Moment::of(time), b);
    }

    fn len(&self) -> usize {
        self.len()
    }

    fn bytes_per_point(&self) -> usize {
        self.bytes()
    }
}

impl<T: Interpretable, const D: usize> InternalAtPoints<T> for Prepared<'_, D> {
    fn evaluate(&self, t: T, points: Range<usize>) -> Vec<Vec<T>> {
        let moment = self.moment(t.to_f64());
        let of = |point| self.internal(point, &moment).into_iter().map(T::nearest).collect();
        points.map(of).collect()
    }
}

/// The exact state at points, the stress from their histories.
struct StateWithHistory<'a, T: Interpretable, const D: usize> {
    motion: staged::Points<'a, T, 2>,
    points: Prepared<'a, D>,
}

impl<T: Interpretable, const D: usize> StateAtPoints<T, D> for StateWithHistory<'_, T, D> {
    fn evaluate(&self, t: T, velocity_time: T, first: usize, runs: &mut [StateRun<T, D>]) {
        self.motion.evaluate(t, velocity_time, first, runs);
        let last = self.points.len().saturating_sub(1);
        let moment = self.points.moment(t.to_f64());
        for (block, run) in (first..).zip(runs) {
            for n in 0..BLOCK {
                let P = self.points.stress((block * BLOCK + n).min(last), &moment);
                for (i, row) in P.iter().enumerate() {
                    for (j, value) in row.iter().enumerate() {
                        run.P[i][j][n] = T::nearest(*value);
                    }
                }
            }
        }
    }

    fn bytes_per_point(&self) -> usize {
        StateAtPoints::<T, D>::bytes_per_point(&self.motion) + self.points.bytes()
    }
}
