//! Why a case cannot be run.

use mmsmith_galerkin::StaticsError;
use mmsmith_mpm::SetupError;
use mmsmith_runtime::{Condition, Surface};
use mmsmith_stated_law::StatedLawError;
use thiserror::Error;

use crate::checkpoint::CheckpointError;

/// Steps that no run should have; a typing error in a CFL number reaches it easily.
pub(crate) const MOST_STEPS: f64 = 1e12;

/// Why a case could not be run.
#[derive(Debug, Error)]
pub enum CaseError {
    /// A setting that makes no sense.
    #[error("{setting} = {value}: it must be {admissible}")]
    Setting {
        /// Which.
        setting: &'static str,
        /// Its value.
        value: String,
        /// The admissible values.
        admissible: &'static str,
    },
    /// More steps than anybody can wait for.
    #[error(
        "the end time {end:e} with steps of {dt:e} takes {steps:e} steps; at most {MOST_STEPS:e} are allowed"
    )]
    TooManySteps {
        /// The end time.
        end: f64,
        /// The time step.
        dt: f64,
        /// The number of steps.
        steps: f64,
    },
    /// The history of internal variables of the law cannot be followed.
    #[error("the history of the law's internal variables: {reason}")]
    History {
        /// Why.
        reason: String,
    },
    /// The solution of the body force and the exact one differ in dimension, or have one that is not known here.
    #[error(
        "the solutions of both precisions must have one, two or three dimensions, and the same"
    )]
    Dimension,
    /// The solution has no place on a grid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The solver refused the set-up.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A body at rest could not be set up.
    #[error(transparent)]
    Statics(StaticsError),
    /// A particle file could not be written.
    #[error(transparent)]
    Frames(#[from] mmsmith_vtk::Error),
    /// A checkpoint could not be written or read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Somebody [asked](crate::interrupt) for the end.
    #[error("interrupted after step {step}, t = {time:.6e}")]
    Interrupted {
        /// The last step done.
        step: u64,
        /// Its time.
        time: f64,
    },
}

impl CaseError {
    /// A setting whose value makes no sense, and what would.
    #[must_use]
    pub fn setting(setting: &'static str, value: impl ToString, admissible: &'static str) -> Self {
        Self::Setting { setting, value: value.to_string(), admissible }
    }
}

/// Why a solution could not be put onto a grid.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SceneError {
    /// The box's sides are not whole multiples of the spacing.
    #[error(
        "{cells} cells make the spacing {spacing:?}, which does not divide the box's sides {sides:?}; \
         {}",
        suggestion(fitting, *cell_length)
    )]
    Misfit {
        /// The cell count asked for.
        cells: usize,
        /// The spacing that follows from it.
        spacing: f64,
        /// The box's sides.
        sides: Vec<f64>,
        /// The nearest cell counts that would fit.
        fitting: Vec<usize>,
        /// A length that so many cells divide, and the sides with it, where there is one.
        cell_length: Option<f64>,
    },
    /// The solver has no model for a boundary condition.
    #[error("the solver does not model the condition {} on {}{instead}", condition, surface)]
    Unmodelled {
        /// Where.
        surface: Surface,
        /// The condition.
        condition: Condition,
        /// The formulation that models the condition, from a separator on; empty where none does.
        instead: &'static str,
    },
    /// Surfaces of the body without a boundary condition.
    #[error(
        "the solution declares no condition on {}, so the solver cannot know what holds there; the motion of the solution \
         holds with these lines in its specification:\n{}",
        list(surfaces),
        lines(surfaces)
    )]
    Undeclared {
        /// Where, and what holds there: the motion of the solution, or symmetry.
        surfaces: Vec<(Surface, Condition)>,
    },
    /// A body with the centre or the axis of its curvilinear coordinates in it.
    #[error(
        "the body contains {what}, which no grid of the solver has cells for; {instead} (mms eval and mms gen serve it all the same)"
    )]
    Centre {
        /// The centre or the axis.
        what: &'static str,
        /// Lines of a specification that runs.
        instead: &'static str,
    },
    /// A body at rest whose waves have no speed.
    #[error(
        "the body has no stiffness at rest: the modulus of its waves is {modulus:.3e}, so that no step in time is stable; give it a smaller prestress, or \
         larger moduli"
    )]
    NoStiffness {
        /// The modulus of plane waves, a stress.
        modulus: f64,
    },
    /// A point of the solver on the axis of curvilinear coordinates.
    #[error(
        "a point of the solver lies on the axis of the coordinates, at X = {X:?}, where the formulas divide by zero; write another --cells or \
         --ppc, of which one is even, so that the axis lies between points"
    )]
    PointOnAxis {
        /// The place.
        X: Vec<f64>,
    },
    /// A body of revolution that the updated Lagrangian formulation has no half plane of.
    #[error(
        "{why}; it runs in the total Lagrangian formulation: --formulation total-lagrangian --shape bspline3 --layout gauss --grid \
         cylindrical --cfl 0.2 --cfl-speed p-wave"
    )]
    OfRevolution {
        /// The reason in words.
        why: &'static str,
    },
    /// A law that the half plane of a body of revolution has no form of.
    #[error(
        "the updated Lagrangian formulation runs bodies of revolution with isotropic laws alone; this one runs with --formulation \
         total-lagrangian --shape bspline3 --layout gauss --grid cylindrical"
    )]
    LawOfHalfPlane,
    /// The solver has no model for the body's shape or its material.
    #[error("the solver does not model this {what}: {value}")]
    Unknown {
        /// `shape` or `material`.
        what: &'static str,
        /// Its debug form.
        value: String,
    },
    /// A law with directions along curvilinear coordinates, which turn from place to place.
    #[error(
        "this law has directions along curvilinear coordinates, by its components, its fibres or a prestress, and the solver's directions are \
         Cartesian: state the law in J, I1 and I2 without a prestress, or the solution in Cartesian coordinates (mms check, eval and gen serve it \
         all the same)"
    )]
    CurvilinearComponents,
    /// An elastic law without memory of this kind.
    #[error(
        "the solver has no memory of this kind for the law '{elastic}': flow is of law = 'hencky', Maxwell elements are of \
         law = 'linear-elastic' and of laws with a volumetric part, 'yeoh', 'gent', 'arruda-boyce', 'ogden' and \
         'holzapfel-gasser-ogden' (mms check, eval and gen serve it all the same)"
    )]
    WithMemory {
        /// The name of the elastic law.
        elastic: &'static str,
    },
    /// A stated law that cannot be read.
    #[error("the law that the specification states: {0}")]
    StatedLaw(#[from] StatedLawError),
    /// An extent was asked for that the body does not have.
    #[error("{0}")]
    Extent(&'static str),
    /// No lattice point lies in the body.
    #[error("no particle lies inside the body with {cells} cells; use more cells or particles")]
    Empty {
        /// The cell count asked for.
        cells: usize,
    },
}

fn list(surfaces: &[(Surface, Condition)]) -> String {
    surfaces.iter().map(|(surface, _)| surface.to_string()).collect::<Vec<_>>().join(", ")
}

/// Lines of a specification for surfaces and their conditions.
fn lines(surfaces: &[(Surface, Condition)]) -> String {
    let one = |(surface, condition): &(Surface, Condition)| {
        format!("\n[[boundary]]\nsurface = '{surface}'\ncondition = '{condition}'\n")
    };
    surfaces.iter().map(one).collect::<String>().trim_end().to_owned()
}

fn suggestion(fitting: &[usize], cell_length: Option<f64>) -> String {
    if let (true, Some(length)) = (fitting.is_empty(), cell_length) {
        return format!(
            "no cell count near it does; they do with cell-length = {length:?} under [domain] of its specification, or with the \
             parameter that is this length, as cell-length = 'L'"
        );
    }
    if fitting.is_empty() {
        return "no cell count near it does".into();
    }
    let counts: Vec<_> = fitting.iter().map(usize::to_string).collect();
    format!("cell counts that do: {}", counts.join(", "))
}

/// A case of a study could not be run.
// The message has the cause, which is therefore no `source`: whoever prints both would print it twice.
#[derive(Debug, Error)]
#[error("case {}: {cause}", index + 1)]
pub struct StudyError {
    /// The case's number in the sweep, from 0.
    pub index: usize,
    /// Why.
    pub cause: CaseError,
}
