//! Options that choose a scheme, shared by all commands that simulate.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use mmsmith_verify as verify;
use serde::Serialize;

use super::shared::{ParameterOptions, parsed};
use super::values::{finite_number, positive_count, positive_number, thread_count};

/// How to simulate; what every measuring command shares.
#[derive(Args, Clone)]
pub(crate) struct SchemeOptions {
    /// Weights between particles and grid; where nothing is said gimp, and bspline3 in the total Lagrangian formulation
    #[arg(long, value_parser = weights())]
    pub(crate) shape: Option<Weights>,
    /// Formulation: updated Lagrangian, with the weights of the current configuration anew in each step, or total
    /// Lagrangian, with those of the reference configuration throughout. Where nothing is said the updated one, and the
    /// total one for a solution with a condition that only that one models
    #[arg(long = "formulation", alias = "frame", value_enum, value_name = "FORMULATION")]
    pub(crate) frame: Option<Frame>,
    /// Mass matrix of the total Lagrangian formulation; consistent where nothing is said
    #[arg(long, value_enum)]
    pub(crate) mass: Option<Mass>,
    /// Order of the symmetric composition of leapfrog in the total Lagrangian formulation; where nothing is
    /// said 4, and 6 for splines of degree 4 and 5
    #[arg(long, value_enum)]
    pub(crate) composition: Option<Composition>,
    /// Where the particles lie; Gauss points in the total Lagrangian formulation only, body-fitted and clipped ones in the updated one
    /// only. Where nothing is said a lattice, and Gauss points in the total Lagrangian formulation for a body that is not held between sliding walls
    #[arg(long, value_enum)]
    pub(crate) layout: Option<Layout>,
    /// Coordinates of the background grid; where nothing is said polar for rings and spherical for shells in the total Lagrangian
    /// formulation
    #[arg(long, value_enum)]
    pub(crate) grid: Option<Grid>,
    /// Speed that the CFL number refers to; where nothing is said bar, and p-wave with a number that is not given either in a
    /// total Lagrangian formulation that is not
    #[arg(long, value_enum)]
    pub(crate) cfl_speed: Option<CflSpeed>,
    /// Time integrator
    #[arg(long, value_parser = integrators(), default_value_t = verify::Integrator::Cd)]
    pub(crate) integrator: verify::Integrator,
    /// Velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... with a filter of that order
    #[arg(long, value_name = "NAME", default_value_t = verify::Transfer::Flip, value_parser = str::parse::<verify::Transfer>)]
    pub(crate) transfer: verify::Transfer,
    /// First velocity of the cd integrator; others ignore it
    #[arg(long, value_enum, default_value_t = Start::Halved)]
    pub(crate) start: Start,
    /// Particles in a cell along each direction; where nothing is said 2, and one more than the degree with Gauss points
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub(crate) ppc: Option<usize>,
    /// Time step times wave speed over grid spacing; where nothing is said 0.4, and one that suits the splines in a total
    /// frame that is not given either
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) cfl: Option<f64>,
    /// End time in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// How much of a ring or a shell is modelled; the part between planes of symmetry where there are such
    #[arg(long, value_enum)]
    pub(crate) extent: Option<Extent>,
    /// Shift of the particles' lattice along every axis, in units of their distance, from -0.5 to 0.5
    #[arg(long, value_name = "X", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) offset: f64,
    /// Angle of the background grid against the body in degrees, counter-clockwise; particles are then clipped with its boundary
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) grid_angle: f64,
    /// Shift of the background grid against the body along each axis, in cells from -1 to 1; particles are then clipped with its boundary
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) grid_shift: f64,
    /// Precision of the solver; errors are always measured in f64
    #[arg(long, value_enum, default_value_t = Precision::F64)]
    pub(crate) precision: Precision,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Number of threads; all cores when left out
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
    PossibleValuesParser::new(values).try_map(|name| name.parse::<Weights>())
}

fn integrators() -> impl TypedValueParser<Value = verify::Integrator> {
    let all = verify::Integrator::ALL;
    let values = all.map(|own| PossibleValue::new(own.name()).help(own.about()));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<verify::Integrator>())
}

/// Formulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Frame {
    /// Updated Lagrangian: weights anew in each step, from the current configuration
    #[value(name = "updated-lagrangian", aliases = ["updated", "ul"])]
    Updated,
    /// Total Lagrangian: weights once, from the reference configuration
    #[value(name = "total-lagrangian", aliases = ["total", "tl"])]
    Total,
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

choices!(
    /// Orders in time.
    Composition => verify::Composition {
        /// Leapfrog
        #[value(name = "2")]
        Order2,
        /// Five stages
        #[value(name = "4")]
        Order4,
        /// Nine stages
        #[value(name = "6")]
        Order6,
    }
);

choices!(
    /// Starts of centred differences.
    Start => verify::Start {
        /// The exact velocity half a step before time zero
        Exact,
        /// Velocity and acceleration at time zero
        Data,
        /// Velocity at time zero, first acceleration halved
        Halved,
    }
);

choices!(
    /// Mass matrices.
    Mass => verify::MassMatrix {
        /// Row sums on the diagonal
        Lumped,
        /// Integrated over the particles
        Consistent,
    }
);

choices!(
    /// Coordinates of background grids.
    Grid => verify::Coordinates {
        /// Cartesian
        Cartesian,
        /// Radius and angle
        Polar,
        /// Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis
        Spherical,
    }
);

choices!(
    /// Speeds of CFL numbers.
    CflSpeed => verify::CflSpeed {
        /// That of waves in a bar, sqrt(E/rho0), unless the solution has its own
        Bar,
        /// That of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0)
        PWave,
    }
);

choices!(
    /// How much of a ring or a shell.
    Extent => verify::Extent {
        /// The part between the planes of symmetry
        Quarter,
        /// All of it
        Full,
    }
);

/// Floating-point precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Precision {
    /// Double
    F64,
    /// Single
    F32,
}
