//! Results of one recording.

use std::collections::BTreeMap;

use mmsmith_measure::norms::PerNorm;
use serde::Serialize;

use super::findings::Remark;
use super::integrated::Integrated;
use super::lag::Lag;
use super::law::LawRow;
use super::quantity::Quantity;

/// Where reference positions and displacements are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// An array of the files.
    Array,
    /// The points of the files.
    Points,
    /// Positions minus displacements.
    PositionsMinusDisplacements,
    /// Positions minus reference positions.
    PositionsMinusReference,
    /// The first frame's positions, traced back with the exact motion; particles found again by identity or order.
    FirstFrame,
}

impl Source {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Array => "given as an array",
            Self::Points => "the points of the files",
            Self::PositionsMinusDisplacements => "positions minus displacements",
            Self::PositionsMinusReference => "positions minus reference positions",
            Self::FirstFrame => "the first frame's positions, traced back with the exact motion",
        }
    }
}

/// Results of one recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreRow {
    /// Path of the recording.
    pub file: String,
    /// Cells along the cell length, where they were told.
    pub cells: Option<usize>,
    /// The length that orders refer to.
    pub h: f64,
    /// Particles in the first frame.
    pub particles: usize,
    /// Frames that were compared.
    pub frames: usize,
    /// The earliest time.
    pub first_time: f64,
    /// The latest time.
    pub last_time: f64,
    /// Where reference positions are from.
    pub reference_positions: Source,
    /// Where displacements are from.
    pub displacements: Source,
    /// The fields that the files hold.
    pub fields: Vec<Quantity>,
    /// `ok`, or what is wrong with the recording.
    pub status: String,
    /// The errors of u, v, F and P, and of other fields that are there; not a number for those that are not, and where a
    /// number of the files is none.
    pub errors: BTreeMap<Quantity, PerNorm<f64>>,
    /// The errors of tensors of six or nine components in [`direction`](Self::direction), which those of `errors` leave out; in the units
    /// of the fields.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub across: BTreeMap<Quantity, PerNorm<f64>>,
    /// The direction of `across` in words, "around the axis" say.
    #[serde(skip)]
    pub direction: &'static str,
    /// The frame with the largest error of each field, numbered from 0.
    #[serde(skip)]
    pub worst_frames: BTreeMap<Quantity, usize>,
    /// The exact displacement, as the root of its mean square, the largest over the frames; a length.
    pub exact_displacement: f64,
    /// Errors of u and its gradient integrated over the elements of a mesh, the largest over the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integrated: Option<Integrated>,
    /// Recorded stresses, J and density against the law at the recorded deformation.
    pub law: Vec<LawRow>,
    /// For each field the error that rounding alone may cause, of the files' numbers too.
    #[serde(skip)]
    pub floors: BTreeMap<Quantity, f64>,
    /// How far the middle of the first frame's reference positions lies from that of the body, along each axis; a length. `None` for a
    /// body whose middle is not known.
    #[serde(skip)]
    pub shift: Option<Vec<f64>>,
    /// The time by which velocities seem to be behind their frames.
    #[serde(skip)]
    pub lag: Option<Lag>,
    /// Everything else that has to be known; problems first.
    #[serde(skip)]
    pub findings: Vec<Remark>,
}

/// The kind of the problem that the error of u is larger than u.
pub(super) const EXCEEDS_MOTION: &str = "exceeds-motion";

impl ScoreRow {
    /// Whether nothing is wrong with the recording.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.status == "ok"
    }

    /// Whether the recording is whole, so that its errors, however large, have a part in orders.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let is_of_size = |finding: &Remark| !finding.is_problem || finding.kind == EXCEEDS_MOTION;
        self.findings.iter().all(is_of_size)
    }
}
