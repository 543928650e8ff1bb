//! Options of `mms score`.

use std::path::PathBuf;

use clap::Args;
use mmsmith_verify as verify;

use super::shared::ParameterOptions;
use super::values::{
    axis, finite_number, one_of, peer, positive_count, positive_number, role, thread_count,
};

/// Where another solver's output is, and how it is to be read.
#[derive(Args)]
pub(crate) struct ScoreOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml", required_unless_present = "newton")]
    pub(crate) name: Option<String>,
    /// Recordings, one for each resolution: a .pvd list, a folder (with one .pvd list, or of frames), or .vtu, .vtp, .vtk
    /// or .csv files; those of one folder are the frames of one recording, unless --cells or --h has a value for each
    #[arg(value_name = "FILES", required_unless_present = "newton")]
    pub(crate) files: Vec<PathBuf>,
    /// Judge how the residuals of Newton's method fall, which tests the tangent: a CSV log with the columns step, iteration and residual,
    /// of which the first two may be left out; the first residual of a step is that before any iteration. Needs no solution
    #[arg(long, value_name = "LOG", conflicts_with = "files")]
    pub(crate) newton: Option<PathBuf>,
    /// Each file is a recording of its own
    #[arg(long)]
    pub(crate) each: bool,
    /// Role of an array that has no usual name; repeatable. Roles: displacement, velocity, deformation_gradient, displacement_gradient,
    /// first_piola_kirchhoff, cauchy, kirchhoff, J, density, reference_position, id
    #[arg(long, value_name = "ROLE=NAME", value_parser = role)]
    pub(crate) map: Vec<(verify::Role, String)>,
    /// Meaning of the points in the files
    #[arg(long, value_parser = one_of::<verify::Points>(), default_value = "auto")]
    pub(crate) points: verify::Points,
    /// Time of a single frame that does not state it
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) time: Option<f64>,
    /// Times of the frames that do not tell them, one for each frame, the same for all recordings
    #[arg(long, value_name = "T,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = finite_number, conflicts_with_all = ["time", "times_from", "frame_step"])]
    pub(crate) times: Vec<f64>,
    /// Times of the frames from a file: its column time or t, or plain numbers
    #[arg(long, value_name = "FILE", conflicts_with_all = ["time", "frame_step"])]
    pub(crate) times_from: Option<PathBuf>,
    /// Time from each frame to the next; the first frame is at t = 0
    #[arg(long, value_name = "DT", allow_negative_numbers = true, value_parser = positive_number, conflicts_with = "time")]
    pub(crate) frame_step: Option<f64>,
    /// Place of the solution's origin in the files, in the solution's unit of length
    #[arg(long, value_name = "X,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) origin: Vec<f64>,
    /// Unit of lengths in the files, in that of the solution: 0.001 for millimetres beside metres
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) length_unit: f64,
    /// Unit of times in the files, in that of the solution: 0.001 for milliseconds beside seconds
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) time_unit: f64,
    /// Axes of the files that are the solution's, such as x,z. Default: x,y,z, as many as there are dimensions
    #[arg(long, value_name = "AXES", value_delimiter = ',', value_parser = axis)]
    pub(crate) axes: Vec<usize>,
    /// Leave out points outside the body, such as particles of walls
    #[arg(long)]
    pub(crate) inside: bool,
    /// Times by which velocities lag behind their frame, one for all recordings or one for each: half a time step in staggered
    /// schemes
    #[arg(long, value_name = "DT,...", default_value = "0", value_delimiter = ',', allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) velocity_lag: Vec<f64>,
    /// Time in which frames are expected, in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// Cell counts along the solution's cell length, one for each recording
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = positive_count, conflicts_with = "h")]
    pub(crate) cells: Vec<usize>,
    /// Mesh sizes, one for each recording. Default: estimated from the particles
    #[arg(long, value_name = "H,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) h: Vec<f64>,
    /// Orders to be met: a number for u, or by field and norm, such as u=2,v=1,cauchy.l2=1. A missed order gives exit
    /// status 1. Default: the error of every recorded field must fall, with an L2 order of at least 0.5
    #[arg(long, value_name = "ORDERS")]
    pub(crate) expect: Option<String>,
    /// How far the order on the finest pair may be from the expected one. Default: 0.1
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) tolerance: Option<f64>,
    /// Orders in time: compare each recording with the next one in place of the exact solution. The recordings differ in their
    /// time steps only; the values are these steps, in a constant ratio
    #[arg(long, value_name = "DT,...", value_delimiter = ',', allow_negative_numbers = true, value_parser = positive_number, conflicts_with_all = ["cells", "h", "against", "expect", "tolerance"])]
    pub(crate) differences: Vec<f64>,
    /// Run mms with this shape function and integrator on the same grids, and compare the errors digit by digit
    #[arg(long, value_name = "mms:SHAPE,INTEGRATOR", value_parser = peer, requires = "cells")]
    pub(crate) against: Option<(verify::Shape, verify::Integrator)>,
    /// CFL number of the runs for --against
    #[arg(long, value_name = "X", default_value_t = 0.4, allow_negative_numbers = true, value_parser = positive_number, requires = "against")]
    pub(crate) cfl: f64,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    /// Write the result to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}
