//! Options of `mms diagnose`.

use std::path::PathBuf;

use clap::Args;
use mmsmith_codegen::Host;

use super::generate::hosts;
use super::shared::ParameterOptions;
use super::values::{positive_count, positive_number, seconds};

#[derive(Args)]
pub(crate) struct DiagnoseOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml", required_unless_present = "list")]
    pub(crate) name: Option<String>,
    /// Language of the fields that the solver takes, as of mms gen
    #[arg(long, value_parser = hosts(), required_unless_present_any = ["list", "tangent"])]
    pub(crate) target: Option<&'static Host>,
    /// Command that builds and runs the solver. {fields} is the folder of the fields' file, {cells} the number of cells,
    /// {out} a folder for the files that mms score reads
    #[arg(long, value_name = "CMD", required_unless_present_any = ["list", "tangent"])]
    pub(crate) run: Option<String>,
    /// Command that builds the solver, once for all grids; {fields} is the folder of the fields' file
    #[arg(long, value_name = "CMD")]
    pub(crate) build: Option<String>,
    /// Numbers of cells along the cell length, the coarsest first
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "8,16", value_parser = positive_count)]
    pub(crate) cells: Vec<usize>,
    /// Expected orders, by field: of the largest error, or of one norm, as u.l2=2
    #[arg(long, value_name = "ORDERS", default_value = "u=2")]
    pub(crate) expect: String,
    /// By how much an order may fall short of the expected one
    #[arg(long, value_name = "X", default_value_t = 0.25, value_parser = positive_number)]
    pub(crate) tolerance: f64,
    /// Time steps of the solver, one for each number of cells. Default: shifts in time are fitted
    #[arg(long, value_name = "DT,...", value_delimiter = ',', value_parser = positive_number)]
    pub(crate) dt: Vec<f64>,
    /// Solvers that run side by side; each needs its own files in {fields} and {out}
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = positive_count)]
    pub(crate) jobs: usize,
    /// Time after which no further run begins
    #[arg(long, value_name = "TIME", default_value = "10m", value_parser = seconds)]
    pub(crate) seconds: f64,
    /// Folder of all fields and results. Default: a temporary one
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Name the mistake in the solver's tangent, in place of its runs: CSV with the place and time of a point, dP11dF11, dP11dF12, ... there, and
    /// F11, F12, ... where the deformation is not the exact one; mms eval NAME --points POINTS --tangent --csv FILE writes such a file
    #[arg(long, value_name = "FILE", conflicts_with_all = ["target", "run", "build", "dt", "out", "list"])]
    pub(crate) tangent: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// List the mistakes that are looked for
    #[arg(long)]
    pub(crate) list: bool,
    /// Write the result to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
