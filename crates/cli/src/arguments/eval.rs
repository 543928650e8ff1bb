//! Options of `mms eval`.

use std::path::PathBuf;

use clap::Args;

use super::shared::ParameterOptions;

#[derive(Args)]
pub(crate) struct EvalOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Points, as CSV with the columns X, Y, Z (as many as the solution has) and t, or as JSON: [ { "X": [0.1, 0.2], "t": 0.3,
    /// "par": { "A": 0.05 } }, ... ], where "par" may be left out. Other columns and keys are ignored. - is standard input
    #[arg(long, value_name = "POINTS")]
    pub(crate) points: PathBuf,
    /// With the tangent dP/dF of the solver's law: in JSON dPdF[i][J][k][L] = dP_iJ/dF_kL, in CSV columns such as dP11dF12. For tests of
    /// the tangent of another solver
    #[arg(long)]
    pub(crate) tangent: bool,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the fields to this JSON file; - is standard output, as when neither this nor --csv nor --npy is given
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write points and fields to this CSV file, a line a point; - is standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Write the fields to this folder as NumPy arrays: u.npy of shape (points, dimension), F.npy of shape (points, dimension,
    /// dimension), J.npy of shape (points,), and so on
    #[arg(long, value_name = "DIR")]
    pub(crate) npy: Option<PathBuf>,
}
