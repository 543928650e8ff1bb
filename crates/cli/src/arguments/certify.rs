//! Options of `mms certify`.

use std::path::PathBuf;

use clap::Args;

use super::values::{positive_count, positive_number, range};

#[derive(Args)]
pub(crate) struct CertifyOptions {
    /// Name of a solution (mms list), or a specification file
    #[arg(value_name = "NAME|SPEC.toml")]
    pub(crate) solution: String,
    /// Range of an input in place of its usual one; repeatable
    #[arg(long = "range", value_name = "NAME=FROM:TO", value_parser = range)]
    pub(crate) ranges: Vec<(String, f64, f64)>,
    /// Factor K of the bound to prove, at most 13; a certificate is accepted up to 8
    #[arg(long, value_name = "K", default_value = "8", value_parser = positive_number)]
    pub(crate) factor: f64,
    /// Largest number of boxes for each field
    #[arg(long, value_name = "N", default_value = "20000", value_parser = positive_count)]
    pub(crate) boxes: usize,
    /// Write the certificate to this JSON file; - is standard output, which then has nothing else
    #[arg(long, value_name = "FILE", conflicts_with = "check")]
    pub(crate) out: Option<PathBuf>,
    /// Check the certificate in this file, and that its program is the present one of the solution
    #[arg(long, value_name = "FILE", conflicts_with_all = ["ranges", "factor", "boxes"])]
    pub(crate) check: Option<PathBuf>,
}
