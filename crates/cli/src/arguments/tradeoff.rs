//! Options of `mms tradeoff`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mmsmith_verify as verify;
use serde::Serialize;

use super::shared::{KeepOptions, ParameterOptions, parsed};
use super::values::{one_of, positive_count, positive_number, seconds, thread_count};

#[derive(Args)]
pub(crate) struct TradeoffOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) name: String,
    /// Time of the whole command, such as 90s, 2m or 1h; what is left is used to repeat timings
    #[arg(long, value_name = "TIME", default_value = "2m", value_parser = seconds)]
    pub(crate) budget: f64,
    /// Run every scheme that fits on these numbers of cells, in place of a sweep within a budget; such cases can be
    /// distributed with --shard
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = positive_count, conflicts_with = "budget")]
    pub(crate) cells: Vec<usize>,
    /// CFL numbers for --cells
    #[arg(long, value_name = "X,...", value_delimiter = ',', default_value = "0.4", allow_negative_numbers = true, value_parser = positive_number, requires = "cells")]
    pub(crate) cfls: Vec<f64>,
    /// Name the cheapest setting with at most this error, and run it once more to confirm; exit status 1 if there is none
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) tolerance: Option<f64>,
    /// Name the most accurate setting whose steps take at most this time, and run it once more to confirm; exit status 1 if
    /// there is none
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub(crate) time: Option<f64>,
    /// Field whose error is compared. Errors of u are divided by the amplitude A, if the solution has this parameter
    #[arg(long, value_enum, default_value_t = Field::U, ignore_case = true)]
    pub(crate) field: Field,
    /// Norm of the error
    #[arg(long, value_parser = one_of::<verify::Norm>(), default_value = "linf")]
    pub(crate) norm: verify::Norm,
    /// Cost
    #[arg(long, value_parser = one_of::<verify::Against>(), default_value = "wall")]
    pub(crate) against: verify::Against,
    /// End time, in periods of the solution
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_negative_numbers = true, value_parser = positive_number)]
    pub(crate) periods: f64,
    /// Number of threads. Default: 1, and all cores for comparison
    #[arg(long, value_name = "N", value_parser = thread_count)]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) parameters: ParameterOptions,
    /// Write the result to this JSON file; - is standard output, which then has nothing else
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

impl From<Field> for verify::Field {
    fn from(field: Field) -> Self {
        match field {
            Field::U => Self::Displacement,
            Field::V => Self::Velocity,
            Field::F => Self::DeformationGradient,
            Field::P => Self::Stress,
        }
    }
}

impl TradeoffOptions {
    /// Cell count and CFL number of every case, where they are stated.
    pub(crate) fn cases(&self) -> Option<Vec<(usize, f64)>> {
        let pairs =
            self.cells.iter().flat_map(|&cells| self.cfls.iter().map(move |&cfl| (cells, cfl)));
        let mut cases: Vec<(usize, f64)> = Vec::new();
        for case in pairs {
            if !cases.contains(&case) {
                cases.push(case);
            }
        }
        (!cases.is_empty()).then_some(cases)
    }

    /// The defaults.
    pub(crate) fn usual(name: &str, budget: f64) -> Self {
        Self { budget, ..parsed(&[name]) }
    }
}
