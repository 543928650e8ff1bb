//! Options that choose a scheme, shared by all commands that simulate.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use mmsmith_verify as verify;
use serde::Serialize;

use super::shared::{ParameterOptions, parsed};
use super::values::{finite_number, one_of, positive_count, positive_number, thread_count};

/// How to simulate; what every measuring command shares.
#[derive(Args, Clone)]
pub(crate) struct SchemeOptions {
    /// Shape functions: the weights between particles and grid. Default: gimp; bspline3 in the total Lagrangian formulation
    #[arg(long, value_parser = weights())]
    pub(crate) shape: Option<Weights>,
    /// Formulation: updated Lagrangian evaluates the shape functions in the current configuration in every step, total
    /// Lagrangian once in the reference configuration. Default: updated-lagrangian; total-lagrangian if only this formulation
    /// can model a boundary condition of the solution
    #[arg(long, alias = "frame", value_parser = one_of::<verify::Formulation>())]
    pub(crate) formulation: Option<verify::Formulation>,
    /// Mass matrix of the total Lagrangian formulation. Default: consistent
    #[arg(long, value_parser = one_of::<verify::MassMatrix>())]
    pub(crate) mass: Option<verify::MassMatrix>,
    /// Order of time stepping in the total Lagrangian formulation, by a symmetric composition of leapfrog steps. Default: 4;
    /// 6 for splines of degree 4 and 5
    #[arg(long, value_parser = one_of::<verify::Composition>())]
    pub(crate) composition: Option<verify::Composition>,
    /// Return map of a law with flow. Default: exponential
    #[arg(long, value_parser = one_of::<verify::ReturnMap>())]
    pub(crate) return_map: Option<verify::ReturnMap>,
    /// Change of volume: projected is against locking next to incompressibility
    #[arg(long, value_parser = one_of::<verify::Volume>(), default_value = "pointwise")]
    pub(crate) volume: verify::Volume,
    /// Positions of the particles. gauss: total Lagrangian formulation only; body-fitted, clipped: updated Lagrangian
    /// formulation only. Default: lattice; gauss in the total Lagrangian formulation, unless all sides are sliding walls
    #[arg(long, value_enum)]
    pub(crate) layout: Option<Layout>,
    /// Coordinates of the background grid. Default: cartesian; in the total Lagrangian formulation polar for rings and
    /// spherical for shells
    #[arg(long, value_parser = one_of::<verify::Coordinates>())]
    pub(crate) grid: Option<verify::Coordinates>,
    /// Wave speed in the CFL number. Default: bar; viscous if the stress follows the rate of the deformation; p-wave if mms
    /// chose both the total Lagrangian formulation and the CFL number itself, or a CFL number of less than 0.4
    #[arg(long, value_parser = one_of::<verify::CflSpeed>())]
    pub(crate) cfl_speed: Option<verify::CflSpeed>,
    /// Time integrator
    #[arg(long, value_parser = one_of::<verify::Integrator>(), default_value_t = verify::Integrator::Cd)]
    pub(crate) integrator: verify::Integrator,
    /// Transfer of velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... (a filter of that order)
    #[arg(long, value_name = "NAME", default_value_t = verify::Transfer::Flip, value_parser = str::parse::<verify::Transfer>)]
    pub(crate) transfer: verify::Transfer,
    /// First velocity of the integrator cd in the updated Lagrangian formulation; refused elsewhere
    #[arg(long, value_parser = one_of::<verify::Start>(), default_value = "halved")]
    pub(crate) start: verify::Start,
    /// Particles per cell and direction. Default: 2; with Gauss points the degree of the splines plus 1
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub(crate) ppc: Option<usize>,
    /// CFL number: time step times wave speed over grid spacing. Default: 0.4, or less if that exceeds 0.6 on the fastest
    /// P-waves of the motion; in the total Lagrangian formulation a number that suits the splines
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) cfl: Option<f64>,
    /// End time, in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// Part of a ring or a shell that is simulated. Default: the part between its planes of symmetry, if it has any
    #[arg(long, value_parser = one_of::<verify::Extent>())]
    pub(crate) extent: Option<verify::Extent>,
    /// Shift of the lattice of particles along every axis, in particle distances, from -0.5 to 0.5
    #[arg(long, value_name = "X", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) offset: f64,
    /// Angle from the body to the background grid in degrees, counter-clockwise. Particles are then clipped at the boundary of
    /// the body
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) grid_angle: f64,
    /// Shift of the background grid along each axis, in cells, from -1 to 1. Particles are then clipped at the boundary of the
    /// body
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) grid_shift: f64,
    /// Precision of the solver; errors are always measured in f64
    #[arg(long, value_enum, default_value_t = Precision::F64)]
    pub(crate) precision: Precision,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    /// Write the result to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

impl SchemeOptions {
    /// Nothing said.
    pub(crate) fn open() -> Self {
        parsed(&[])
    }
}

/// Weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weights {
    /// Those of the updated Lagrangian formulation; splines are in the total one as well.
    Of(verify::Shape),
    /// Splines of a degree that needs the reference configuration.
    Spline(HighDegree),
}

/// A degree of splines in the total Lagrangian formulation alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HighDegree {
    Four,
    Five,
}

impl Weights {
    fn all() -> impl Iterator<Item = Self> {
        let splines = [HighDegree::Four, HighDegree::Five].map(Self::Spline);
        verify::Shape::ALL.map(Self::Of).into_iter().chain(splines)
    }

    /// As the option spells it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Of(shape) => shape.name(),
            Self::Spline(HighDegree::Four) => "bspline4",
            Self::Spline(HighDegree::Five) => "bspline5",
        }
    }

    fn about(self) -> &'static str {
        match self {
            Self::Of(shape) => shape.about(),
            Self::Spline(HighDegree::Four) => "Quartic splines (total Lagrangian)",
            Self::Spline(HighDegree::Five) => "Quintic splines (total Lagrangian)",
        }
    }

    /// The degree of splines; nothing for other weights.
    pub(crate) fn degree(self) -> Option<usize> {
        match self {
            Self::Of(verify::Shape::Bspline2) => Some(2),
            Self::Of(verify::Shape::Bspline3) => Some(3),
            Self::Of(_) => None,
            Self::Spline(HighDegree::Four) => Some(4),
            Self::Spline(HighDegree::Five) => Some(5),
        }
    }
}

impl FromStr for Weights {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::all().map(Self::name).collect::<Vec<_>>().join(", ");
        Self::all()
            .find(|weights| weights.name() == name)
            .ok_or_else(|| format!("it must be one of {}", known()))
    }
}

fn weights() -> impl TypedValueParser<Value = Weights> {
    let values = Weights::all().map(|own| PossibleValue::new(own.name()).help(own.about()));
    PossibleValuesParser::new(values).try_map(|name| name.to_lowercase().parse::<Weights>())
}

/// Layouts of particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layout {
    /// Centres of equal parts of a cell
    Lattice,
    /// Polar cells of equal angle that end at the rims (rings, updated Lagrangian)
    BodyFitted,
    /// A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on a line)
    Clipped,
    /// Gauss-Legendre points (total Lagrangian)
    Gauss,
}

/// Floating-point precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Precision {
    /// Double
    F64,
    /// Single
    F32,
}
