//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use mmsmith_solutions::AnySolution;
use mmsmith_verify as verify;
use serde::Serialize;

/// Manufactured solutions for solid mechanics: check fields, run a material point solver, measure its order.
#[derive(Parser)]
#[command(name = "mms", version, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// List the solutions and their parameters
    List(ListOptions),
    /// Compare every field of a solution with the field below it; all solutions when none is named
    Check(CheckOptions),
    /// Tell what a solution models, what it exercises, and what its body force costs
    Explain(ExplainOptions),
    /// Measure which terms of the momentum balance each solution exercises, and name the fewest that test them all
    Coverage(CoverageOptions),
    /// Evaluate the exact fields at points of your own
    Eval(EvalOptions),
    /// Run one simulation and measure its errors
    Run(RunOptions),
    /// Go on with a run that wrote checkpoints and was stopped or killed, to the same bits
    Resume(ResumeOptions),
    /// Measure orders of accuracy over grids (--cells 16,32,64) or time steps (--cells 32 --cfls 0.1,0.2,0.4)
    Converge(ConvergeOptions),
    /// Find the largest stable CFL number by bisection, over one or two settings or parameters
    Stability(StabilityOptions),
    /// Measure error against cost over all schemes that fit, name the cheapest setting for an error, and say what each knob buys
    Tradeoff(TradeoffOptions),
    /// Measure errors and orders of what another solver wrote (.vtu, .vtp, .vtk, .pvd, .csv)
    Score(ScoreOptions),
    /// Repeat the original study on both of its problems, with a report, tables, data and particle files
    Reproduce(ReproduceOptions),
}

/// Declares an argument's values with what they mean to the library.
macro_rules! choices {
    ($(#[$doc:meta])* $name:ident => $target:ty { $($(#[$value_doc:meta])* $value:ident,)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
        #[serde(rename_all = "kebab-case")]
        pub(crate) enum $name { $($(#[$value_doc])* $value,)+ }

        impl From<$name> for $target {
            fn from(value: $name) -> Self {
                match value { $($name::$value => Self::$value,)+ }
            }
        }
    };
}

#[derive(Args)]
pub(crate) struct ListOptions {
    /// Write the list to this JSON file too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Solutions to check, by name, or specification files (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Number of sample points in the body and on each surface [default: 300], or in each class of inputs with
    /// --thorough [default: 10000]
    #[arg(long, value_name = "N", value_parser = sample_count)]
    pub(crate) points: Option<usize>,
    /// Measure the rounding error of every field against arbitrary precision instead: ordinary inputs, tiny amplitudes, late
    /// times, the boundary, near inversion, near and far from the origin
    #[arg(long, conflicts_with = "set")]
    pub(crate) thorough: bool,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the findings to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct CoverageOptions {
    /// Solutions, by name, or specification files (SPEC.toml); all of the library where none is given
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solutions: Vec<String>,
    /// Write it to this JSON file too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct ExplainOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Write it to this JSON file too
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct EvalOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// The points: [ { "X": [0.1, 0.2], "t": 0.3, "par": { "A": 0.05 } }, ... ]; "par" may be left out, other keys
    /// are ignored
    #[arg(long, value_name = "IN.json")]
    pub(crate) points: PathBuf,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the fields to this JSON file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct RunOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Number of cells along the solution's cell length
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = positive_count)]
    pub(crate) cells: usize,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
    /// Write particle files (.vtu, and a .pvd that lists them) to this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) vtk: Option<PathBuf>,
    /// Number of particle files, spread evenly from the first state to the last
    #[arg(long, value_name = "N", default_value_t = 20, requires = "vtk", value_parser = clap::value_parser!(u64).range(2..))]
    pub(crate) frames: u64,
    /// Write all that the next step needs to this folder every so often; after a kill, `mms resume DIR` goes on from there
    #[arg(long, value_name = "DIR")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Steps between checkpoints
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "checkpoint", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) every: u64,
    /// Write errors of u, energies and momentum of the particles and of the exact motion over time to this file as
    /// comma-separated values, at up to 1000 evenly spread steps; --json then has them too
    #[arg(long, value_name = "FILE", conflicts_with = "checkpoint")]
    pub(crate) history: Option<PathBuf>,
    /// Draw the energy gained and lost against the exact motion over time to this SVG file
    #[arg(long, value_name = "FILE", conflicts_with = "checkpoint")]
    pub(crate) plot: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct ResumeOptions {
    /// The folder that the run was given with --checkpoint
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Number of threads; as the run was started with when left out
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
}

#[derive(Args)]
pub(crate) struct ConvergeOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Cell counts, separated by commas; one of them with --cfls
    #[arg(long, value_name = "N,...", required = true, value_delimiter = ',', value_parser = positive_count)]
    pub(crate) cells: Vec<usize>,
    /// CFL numbers, separated by commas, for orders in time on one grid
    #[arg(long, value_name = "X,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "cfl")]
    pub(crate) cfls: Vec<f64>,
    /// Orders to be met, or else exit status 1: a number for u, or by field and norm, such as u=2,F=1,P.l1=1. With --cfls
    /// they are orders in time, of the differences on one grid
    #[arg(long, value_name = "ORDERS")]
    pub(crate) expect: Option<String>,
    /// How far the order on the finest pair may be from the expected one; 0.1 when left out. With it a missed order gives
    /// exit status 1
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) tolerance: Option<f64>,
    #[command(flatten)]
    pub(crate) kept: KeepOptions,
    /// Draw the displacement error to this SVG file
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Write the tables to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write the tables to this Markdown file
    #[arg(long, value_name = "FILE")]
    pub(crate) markdown: Option<PathBuf>,
    /// Write the tables to this LaTeX file, for the package booktabs
    #[arg(long, value_name = "FILE")]
    pub(crate) latex: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
}

#[derive(Args)]
pub(crate) struct StabilityOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Number of cells along the solution's cell length
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = positive_count)]
    pub(crate) cells: usize,
    /// What to vary, one or two of them: NAME=VALUE,VALUE,... with the name amplitude, units (mass, length where L is one,
    /// and time change by powers of two), a parameter of the solution, or cells, ppc, offset, periods, precision, shape,
    /// integrator, start
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = variation, conflicts_with_all = ["at", "search"])]
    pub(crate) over: Vec<(String, Vec<String>)>,
    /// How close the stable and the unstable CFL number come, on P-waves, whose number is the larger one
    #[arg(long, value_name = "X", default_value_t = 0.01, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) width: f64,
    /// CFL number to start from; an eighth of P-waves' when left out. It is halved until it is stable
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) lower: Option<f64>,
    /// CFL number that is thought unstable; P-waves' own when left out. It is raised until it is unstable
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) upper: Option<f64>,
    /// A run is unstable with an error of u above this multiple of a reference run's, at an eighth of P-waves' time step
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().error_multiple, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) error_multiple: f64,
    /// A run is unstable if it gains, in a period, more than this multiple of the exact motion's largest energy
    #[arg(long, value_name = "X", default_value_t = verify::Criteria::default().energy_rate, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) energy_rate: f64,
    /// Judge the run at this CFL number alone; exit status 1 if it is unstable
    #[arg(long, value_name = "CFL", allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "search")]
    pub(crate) at: Option<f64>,
    /// Look for failures among random settings with CFL numbers up to --cfl on P-waves, which are believed stable; exit
    /// status 1 if there are any
    #[arg(long, value_enum)]
    pub(crate) search: Option<SearchKind>,
    /// Number of random settings
    #[arg(long, value_name = "N", default_value_t = 100, requires = "search", value_parser = sample_count)]
    pub(crate) samples: usize,
    /// Seed of the random settings
    #[arg(long, value_name = "N", default_value_t = 1, requires = "search")]
    pub(crate) seed: u64,
    /// Draw the limits to this SVG file: a line over one setting, a map over two
    #[arg(long, value_name = "FILE", requires = "over")]
    pub(crate) plot: Option<PathBuf>,
    /// Write the table to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) kept: KeepOptions,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
}

#[derive(Args)]
pub(crate) struct TradeoffOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Time for everything, such as 90s, 2m or 1h; it is used up, for timings repeated if for nothing better
    #[arg(long, value_name = "TIME", default_value = "2m", value_parser = seconds)]
    pub(crate) budget: f64,
    /// Name the cheapest setting with at most this error, and run it once more to prove it; exit status 1 if there is none
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) tolerance: Option<f64>,
    /// Name the most accurate setting whose steps take at most this time, and run it once more to prove it; exit status 1
    /// if there is none
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub(crate) time: Option<f64>,
    /// Field whose error counts. Errors of u are divided by the amplitude A where the solution has one
    #[arg(long, value_enum, default_value_t = Field::U, ignore_case = true)]
    pub(crate) field: Field,
    /// Norm of the error
    #[arg(long, value_enum, default_value_t = Norm::Linf)]
    pub(crate) norm: Norm,
    /// Cost that the error is held against
    #[arg(long, value_enum, default_value_t = Against::Wall)]
    pub(crate) against: Against,
    /// End time in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// Number of threads; 1 when left out, and all cores for comparison
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the result to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write all settings to this file as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Draw error against cost, with the front, to this SVG file
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Write a page of advice to this Markdown file, with the figure behind each sentence
    #[arg(long, value_name = "FILE")]
    pub(crate) advice: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) kept: KeepOptions,
}

/// Fields whose error is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
pub(crate) enum Field {
    /// Displacement
    #[serde(rename = "u")]
    U,
    /// Velocity
    #[serde(rename = "v")]
    V,
    /// Deformation gradient
    F,
    /// First Piola-Kirchhoff stress
    P,
}

/// Norms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Norm {
    /// Largest over particles
    Linf,
    /// Root of the mean square
    L2,
    /// Mean
    L1,
}

choices!(
    /// Costs.
    Against => verify::Against {
        /// Wall-clock time of the steps
        Wall,
        /// Processor time of the steps
        Cpu,
        /// Number of steps
        Steps,
        /// Memory, estimated
        Memory,
    }
);

/// Ways to look for failures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SearchKind {
    /// Settings drawn from a seed
    Random,
}

/// Where another solver's output is, and how it is to be read.
#[derive(Args)]
pub(crate) struct ScoreOptions {
    /// The solution, by name, or a specification file (SPEC.toml)
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Recordings, one for each resolution: a .pvd list, a folder (with one .pvd list, or of frames), or .vtu, .vtp, .vtk
    /// or .csv files; those of one folder are the frames of one recording, unless --cells or --h has a value for each
    #[arg(value_name = "FILES", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Each file is a recording of its own
    #[arg(long)]
    pub(crate) each: bool,
    /// What an array is that has no usual name; repeatable. Roles: displacement, velocity, deformation_gradient,
    /// first_piola_kirchhoff, reference_position, id
    #[arg(long, value_name = "ROLE=NAME", value_parser = role)]
    pub(crate) map: Vec<(verify::Role, String)>,
    /// What the points of the files are
    #[arg(long, value_enum, default_value_t = Points::Auto)]
    pub(crate) points: Points,
    /// The time of single frames that do not tell it
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) time: Option<f64>,
    /// By how much velocities lag behind their frame's time: half a time step for staggered schemes
    #[arg(long, value_name = "DT", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) velocity_lag: f64,
    /// The time in which frames are expected, in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// Cell counts along the solution's cell length, one for each recording
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = positive_count, conflicts_with = "h")]
    pub(crate) cells: Vec<usize>,
    /// Mesh sizes, one for each recording; estimated from the particles when neither is given
    #[arg(long, value_name = "H,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) h: Vec<f64>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Number of threads; all cores when left out
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    /// Write the result to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct ReproduceOptions {
    /// Write everything to this folder
    #[arg(long, value_name = "DIR", default_value = "target/reproduce")]
    pub(crate) out: PathBuf,
    /// Time for the comparison of schemes by error and cost, for each problem, such as 8s or 2m
    #[arg(long, value_name = "TIME", default_value = "8s", value_parser = seconds)]
    pub(crate) budget: f64,
    /// Number of threads; all cores when left out
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
}

/// Where finished cases are kept.
#[derive(Args)]
pub(crate) struct KeepOptions {
    /// Keep every finished case in this folder, and take from it what is there: a study that was killed goes on where it
    /// stopped, and several processes may share one
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// Values for parameters of a solution.
#[derive(Args, Clone)]
pub(crate) struct ParameterOptions {
    /// Give a parameter another value than its default; repeatable
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub(crate) set: Vec<(String, f64)>,
}

/// How to simulate; what every measuring command shares.
#[derive(Args, Clone)]
pub(crate) struct SchemeOptions {
    /// Weights between particles and grid
    #[arg(long, value_enum, default_value_t = Shape::Gimp)]
    pub(crate) shape: Shape,
    /// Configuration that the weights belong to: updated in each step, or the reference one throughout
    #[arg(long, value_enum, default_value_t = Frame::Updated)]
    pub(crate) frame: Frame,
    /// Mass matrix of the total frame; consistent where nothing is said
    #[arg(long, value_enum)]
    pub(crate) mass: Option<Mass>,
    /// Order of the symmetric composition of leapfrog in the total frame; where nothing is said 4, and 6 for splines of degree 4 and 5
    #[arg(long, value_enum)]
    pub(crate) composition: Option<Composition>,
    /// Where the particles lie; Gauss points in the total frame only, body-fitted ones in the updated frame only. Where nothing is
    /// said a lattice, and Gauss points in the total frame for a body that is not held between sliding walls
    #[arg(long, value_enum)]
    pub(crate) layout: Option<Layout>,
    /// Coordinates of the background grid; where nothing is said polar for rings and spherical for shells in the total frame
    #[arg(long, value_enum)]
    pub(crate) grid: Option<Grid>,
    /// Speed that the CFL number refers to
    #[arg(long, value_enum, default_value_t = CflSpeed::Bar)]
    pub(crate) cfl_speed: CflSpeed,
    /// Time integrator
    #[arg(long, value_enum, default_value_t = Integrator::Cd)]
    pub(crate) integrator: Integrator,
    /// Velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... with a filter of that order
    #[arg(long, value_name = "NAME", default_value = "flip", value_parser = transfer)]
    pub(crate) transfer: verify::Transfer,
    /// First velocity of the cd integrator; others ignore it
    #[arg(long, value_enum, default_value_t = Start::Halved)]
    pub(crate) start: Start,
    /// Particles in a cell along each direction; where nothing is said 2, and one more than the degree with Gauss points
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub(crate) ppc: Option<usize>,
    /// Time step times wave speed over grid spacing
    #[arg(long, value_name = "X", default_value_t = 0.4, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) cfl: f64,
    /// End time in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// How much of a ring or a shell is modelled; the part between planes of symmetry where there are such
    #[arg(long, value_enum)]
    pub(crate) extent: Option<Extent>,
    /// Shift of the particles' lattice along every axis, in units of their distance, from -0.5 to 0.5
    #[arg(long, value_name = "X", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) offset: f64,
    /// Precision of the solver; errors are always measured in f64
    #[arg(long, value_enum, default_value_t = Precision::F64)]
    pub(crate) precision: Precision,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Number of threads; all cores when left out
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    /// Write the result to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// Lets the parser fill in its own defaults, so that they stand in one place.
fn parsed<O: Args>(arguments: &[&str]) -> O {
    #[derive(Parser)]
    struct Usual<O: Args> {
        #[command(flatten)]
        options: O,
    }
    Usual::<O>::parse_from(["mms"].iter().chain(arguments)).options
}

impl TradeoffOptions {
    /// What holds where nothing is said.
    pub(crate) fn usual(name: &str, budget: f64) -> Self {
        Self { budget, ..parsed(&[name]) }
    }
}

impl StabilityOptions {
    /// A map over two settings, told as `NAME=VALUE,...`, with what holds where nothing is said.
    pub(crate) fn map(name: &str, cells: usize, over: [&str; 2]) -> Self {
        Self { cells, ..parsed(&[name, "--over", over[0], "--over", over[1]]) }
    }
}

impl SchemeOptions {
    /// What holds where nothing is said, with the given scheme.
    pub(crate) fn usual(shape: Shape, integrator: Integrator) -> Self {
        Self { shape, integrator, ..parsed(&[]) }
    }

    /// The same with what suits a solution where nothing is said.
    pub(crate) fn for_solution(&self, exact: &AnySolution<f64>) -> Self {
        let mut settled = self.clone();
        if self.frame == Frame::Total {
            settled.layout.get_or_insert(match verify::TotalScheme::layout_for(exact) {
                verify::Layout::Lattice => Layout::Lattice,
                verify::Layout::Gauss => Layout::Gauss,
            });
            settled.grid.get_or_insert(match verify::TotalScheme::coordinates_for(exact) {
                verify::Coordinates::Cartesian => Grid::Cartesian,
                verify::Coordinates::Polar => Grid::Polar,
                verify::Coordinates::Spherical => Grid::Spherical,
            });
        }
        settled
    }

    /// Where the particles lie.
    pub(crate) fn layout(&self) -> Layout {
        self.layout.unwrap_or(Layout::Lattice)
    }

    /// Coordinates of the background grid.
    pub(crate) fn grid(&self) -> Grid {
        self.grid.unwrap_or(Grid::Cartesian)
    }

    /// Particles in a cell along each direction.
    pub(crate) fn ppc(&self) -> usize {
        const USUAL: usize = 2;
        self.ppc.unwrap_or_else(|| match (self.layout(), self.shape) {
            (Layout::Gauss, Shape::Bspline3) => 4,
            (Layout::Gauss, Shape::Bspline4) => 5,
            (Layout::Gauss, Shape::Bspline5) => 6,
            (Layout::Gauss, Shape::Bspline2) => 3,
            _ => USUAL,
        })
    }
}

/// Weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Shape {
    /// Hat functions at the particle's point
    Linear,
    /// GIMP weights of fixed size
    Ugimp,
    /// GIMP weights that follow the particle's stretch
    Gimp,
    /// Quadratic splines
    Bspline2,
    /// Cubic splines
    Bspline3,
    /// Quartic splines (total frame)
    Bspline4,
    /// Quintic splines (total frame)
    Bspline5,
    /// Parallelograms that deform with the particle
    Cpdi,
    /// Quadrilaterals whose corners neighbours share (one and two dimensions)
    Cpdi2,
}

/// Configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Frame {
    /// The current one, weights anew in each step
    Updated,
    /// The reference configuration, weights once
    Total,
}

/// Layouts of particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Layout {
    /// Centres of equal parts of a cell
    Lattice,
    /// Polar cells of equal angle that end at the rims (rings, updated frame)
    BodyFitted,
    /// Gauss-Legendre points (total frame)
    Gauss,
}

/// Orders in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Composition {
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

choices!(
    /// Time integrators.
    Integrator => verify::Integrator {
        /// Update stress first
        Usf,
        /// Update stress last
        Usl,
        /// Update stress last, with the velocity projected again
        Musl,
        /// Stress updated by halves, before the forces and after
        Usavg,
        /// Centred differences
        Cd,
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

choices!(
    /// What the points of files are.
    Points => verify::Points {
        /// Reference positions if they stay while displacements change, else current ones
        Auto,
        /// Current positions
        Current,
        /// Reference positions
        Reference,
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

fn positive_count(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) | Err(_) => Err("it must be a whole number, at least 1".into()),
        Ok(count) => Ok(count),
    }
}

fn sample_count(text: &str) -> Result<usize, String> {
    positive_count(text)
        .ok()
        .filter(|count| *count <= 10_000_000)
        .ok_or_else(|| "it must be a whole number from 1 to 10000000".into())
}

fn thread_count(text: &str) -> Result<usize, String> {
    positive_count(text)
        .ok()
        .filter(|count| *count <= 1024)
        .ok_or_else(|| "it must be a whole number from 1 to 1024".into())
}

fn positive_number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("it must be a positive number, such as 0.4".into()),
    }
}

/// A time: seconds, or with a unit.
fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let (number, unit) = units
        .into_iter()
        .find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, factor)))
        .unwrap_or((text, 1.0));
    positive_number(number)
        .map(|number| number * unit)
        .map_err(|_| "it must be a positive time, such as 90s, 2m or 1h".into())
}

fn finite_number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("it must be a finite number, such as 0.01".into()),
    }
}

fn transfer(text: &str) -> Result<verify::Transfer, String> {
    /// Each order costs a pass over the particles, and beyond some tens nothing is left to filter.
    const MOST: u32 = 100;
    match text {
        "flip" => Ok(verify::Transfer::Flip),
        "pic" => Ok(verify::Transfer::Pic),
        "apic" => Ok(verify::Transfer::Apic),
        _ => text
            .strip_prefix("xpic")
            .filter(|order| order.bytes().all(|digit| digit.is_ascii_digit()))
            .and_then(|order| order.parse().ok())
            .filter(|order| (1..=MOST).contains(order))
            .map(verify::Transfer::Xpic)
            .ok_or_else(|| format!("it must be flip, pic, apic, or xpic1 to xpic{MOST}")),
    }
}

fn role(text: &str) -> Result<(verify::Role, String), String> {
    let roles = || verify::Role::ALL.map(verify::Role::name).join(", ");
    let form = || format!("expected ROLE=NAME, such as displacement=disp; roles: {}", roles());
    let (role, name) = text.split_once('=').ok_or_else(form)?;
    let known = verify::Role::ALL.into_iter().find(|known| known.name() == role.trim());
    match known {
        Some(known) if !name.is_empty() => Ok((known, name.to_owned())),
        _ => Err(form()),
    }
}

fn variation(text: &str) -> Result<(String, Vec<String>), String> {
    let form = || "expected NAME=VALUE,VALUE,..., such as nu=0,0.3,0.49".to_owned();
    let (name, values) = text.split_once('=').ok_or_else(form)?;
    let values: Vec<_> = values.split(',').map(|value| value.trim().to_owned()).collect();
    if name.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(form());
    }
    Ok((name.trim().to_owned(), values))
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let form = "expected NAME=VALUE, such as A=0.05";
    let (name, value) = text.split_once('=').ok_or(form)?;
    let name = name.trim();
    if name.is_empty() {
        return Err(form.into());
    }
    match value.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok((name.to_owned(), number)),
        _ => Err(format!("'{value}' is not a finite number; {form}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn values_that_make_no_sense_are_refused() {
        for text in ["0", "-1", "2.5", "", "x", "99999999999999999999999"] {
            assert!(positive_count(text).is_err(), "{text}");
        }
        for text in ["0", "-0.4", "nan", "inf", "1e999", "", "0,4"] {
            assert!(positive_number(text).is_err(), "{text}");
        }
        for text in ["A", "=1", "A=", "A=x", "A=nan", "A=inf"] {
            assert!(assignment(text).is_err(), "{text}");
        }
        for text in ["xpic", "xpic0", "xpic101", "xpic+2", "xpic2.5", "PIC", ""] {
            assert!(transfer(text).is_err(), "{text}");
        }
        assert_eq!(transfer("xpic3"), Ok(verify::Transfer::Xpic(3)));
        assert_eq!(assignment("A = 5e-2"), Ok(("A".into(), 0.05)));
    }
}
