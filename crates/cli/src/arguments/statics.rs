//! Options of equilibrium from rest.

use clap::Args;

use super::values::{finite_number, positive_count};

/// Equilibrium from rest in place of a run through time.
#[derive(Args, Clone)]
pub(crate) struct StaticOptions {
    /// Solve for the equilibrium from rest by Newton's method, in the reference configuration: with the body force without inertia, b - a,
    /// at the moment of --moment. Default where nothing of the solution moves, unless an option of runs through time is given
    #[arg(long = "static", conflicts_with = "dynamic")]
    pub(crate) is_static: bool,
    /// Step through time from the exact state, though nothing of the solution moves
    #[arg(long)]
    pub(crate) dynamic: bool,
    /// Load steps of equal length; one that Newton's method does not take is halved. Default: 1
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub(crate) load_steps: Option<usize>,
    /// Moment of the motion that is held, in periods of the solution. Default: 0.25, or another one where
    /// the body passes through rest then
    #[arg(long, value_name = "PERIODS", allow_negative_numbers = true, value_parser = finite_number)]
    pub(crate) moment: Option<f64>,
}
