//! Options of `mms run`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::scheme::SchemeOptions;
use super::statics::StaticOptions;
use super::values::ProcessGrid;
use super::values::{cell_count, process_grid, time, variation};

#[derive(Args)]
pub(crate) struct RunOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Number of cells along the solution's cell length. Default: 32; 16 in 3D if mms chose the total Lagrangian formulation
    /// itself
    #[arg(long, value_name = "N", value_parser = cell_count)]
    pub(crate) cells: Option<usize>,
    #[command(flatten)]
    pub(crate) scheme: SchemeOptions,
    #[command(flatten)]
    pub(crate) statics: StaticOptions,
    /// Load levels of an equilibrium, one after the other: values of a parameter, or of moment, as NAME=VALUE,VALUE,...; each begins at
    /// the equilibrium of the one before, the first one at rest
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = variation)]
    pub(crate) along: Option<(String, Vec<String>)>,
    /// Write particle files (.vtu, and a .pvd that lists them) to this folder; from rest, one of the equilibrium
    #[arg(long, value_name = "DIR")]
    pub(crate) vtk: Option<PathBuf>,
    /// Number of particle files, spread evenly from the first state to the last. Default: 20
    #[arg(long, value_name = "N", requires = "vtk", value_parser = clap::value_parser!(u64).range(2..))]
    pub(crate) frames: Option<u64>,
    /// Write checkpoints to this folder; after a kill, `mms resume DIR` continues from the last one
    #[arg(long, value_name = "DIR")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Processes along each axis, such as 2x4, where mpirun starts several. Default: those whose fullest has the least to do
    #[arg(long, value_name = "NxN", value_parser = process_grid)]
    pub(crate) process_grid: Option<ProcessGrid>,
    /// Steps between checkpoints
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "checkpoint", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) every: u64,
    /// Write errors of u, energies and momentum over time to this CSV file, of the particles and of the exact motion, at up
    /// to 1000 evenly spread steps; --json then has them too
    #[arg(long, value_name = "FILE")]
    pub(crate) history: Option<PathBuf>,
    /// Say how long each pass of the steps took, and how many threads the tiles of particles keep busy
    #[arg(long)]
    pub(crate) profile: bool,
    /// Draw the difference of the energy from the exact one over time to this SVG file
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
}

/// A picture of the particles.
#[derive(Args)]
pub(crate) struct PictureOptions {
    /// Draw the particles, coloured by their Cauchy stress, to this SVG file; in 3D seen along the third axis, of a body of revolution its half plane
    #[arg(long = "picture", value_name = "FILE", conflicts_with = "checkpoint")]
    pub(crate) file: Option<PathBuf>,
    /// Time of the picture in periods of the solution, at most --periods. Default: the end of the run
    #[arg(long, value_name = "PERIODS", requires = "file", allow_negative_numbers = true, value_parser = time)]
    pub(crate) at: Option<f64>,
    /// Stress that the colours of the picture show
    #[arg(long, value_enum, default_value_t = Stress::VonMises, requires = "file")]
    pub(crate) stress: Stress,
}

/// Scalars of a Cauchy stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Stress {
    /// Von Mises' equivalent stress
    VonMises,
    /// Pressure, positive in compression
    Pressure,
    /// Normal stress along the first axis
    Xx,
    /// Normal stress along the second axis
    Yy,
    /// Normal stress along the third axis
    Zz,
    /// Shear stress
    Xy,
    /// Shear stress
    Xz,
    /// Shear stress
    Yz,
    /// Normal stress away from the third axis
    Radial,
    /// Normal stress around the third axis
    Hoop,
}
