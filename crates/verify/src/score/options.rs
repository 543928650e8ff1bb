//! How recordings are to be read, and what they are.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mmsmith_measure::norms::PerNorm;
use mmsmith_vtk::Provenance;

use super::arrays::Role;
use super::quantity::Quantity;
use crate::named::named;
use crate::verdict::ORDER_TOLERANCE;

/// Meaning of the points of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Points {
    /// Reference positions if they stay where they are while displacements change, else current positions.
    #[default]
    Auto,
    /// Current positions `x`, as particle methods write them.
    Current,
    /// Reference positions `X`, as many finite element codes write them.
    Reference,
}

named! {
    Points {
        Auto = "auto": "Reference positions if they stay while displacements change, else current ones";
        Current = "current": "Current positions";
        Reference = "reference": "Reference positions";
    }
}

/// The times of the frames of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Times {
    /// The files tell them: a `.pvd` list, a field, a column, or their names.
    #[default]
    Told,
    /// One for each frame, the same in all recordings.
    At(Vec<f64>),
    /// The frame with the number `k`, from zero on, is at `k` times this.
    Step(f64),
}

/// How to read the files.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoreOptions {
    /// The names of arrays that have no usual name.
    pub map: BTreeMap<Role, String>,
    /// The meaning of the points.
    pub points: Points,
    /// The times of the frames.
    pub times: Times,
    /// Where and in which units the files have the body.
    pub placing: Placing,
    /// The number of the solution's periods that frames may lie in, from time zero.
    pub periods: f64,
    /// The solution that the recordings are compared with; that a file tells another one is a remark.
    pub provenance: Option<Provenance>,
    /// Orders that are expected, field by field and norm by norm.
    pub expected: BTreeMap<Quantity, PerNorm<Option<f64>>>,
    /// Columns that are read one for the other.
    pub exchange: Option<Exchange>,
    /// How far from them the order on the finest pair may be.
    pub tolerance: f64,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        Self {
            map: BTreeMap::new(),
            points: Points::Auto,
            times: Times::Told,
            placing: Placing::default(),
            periods: 1.0,
            provenance: None,
            expected: BTreeMap::new(),
            exchange: None,
            tolerance: ORDER_TOLERANCE,
        }
    }
}

/// Columns that may have been written one for the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// Two components of the displacement.
    Displacement(usize, usize),
    /// Two components of the displacement, and of the velocity as well.
    Motion(usize, usize),
    /// One component of the reference position and of the displacement.
    Component(usize),
    /// The whole reference position and the displacement.
    Both,
}

/// Where and in which units the files have the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Placing {
    /// Vector that is subtracted from positions, in the solution's unit of length; empty for none.
    pub origin: Vec<f64>,
    /// The unit of positions and displacements, in the solution's.
    pub length_unit: f64,
    /// The unit of times, in the solution's.
    pub time_unit: f64,
    /// The unit of velocities, in the solution's; that of lengths over that of times where it is none.
    pub velocity_unit: Option<f64>,
    /// Which components of the files are along the solution's axes, numbered from 0; empty for the first ones.
    pub axes: Vec<usize>,
    /// Whether particles outside of the body are left out.
    pub inside: bool,
}

impl Default for Placing {
    fn default() -> Self {
        Self {
            origin: vec![],
            length_unit: 1.0,
            time_unit: 1.0,
            velocity_unit: None,
            axes: vec![],
            inside: false,
        }
    }
}

/// The resolution of a recording, with respect to which orders are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Cells along the solution's cell length.
    Cells(usize),
    /// The length itself.
    Length(f64),
    /// From the number of particles and the space that they take.
    Estimated,
}

/// One recording to be scored.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// A file, a `.pvd` list or a folder; or the files of the frames, one after the other.
    pub paths: Vec<PathBuf>,
    /// Its resolution.
    pub resolution: Resolution,
    /// By how much velocities lag behind their frame's time, where the files do not tell it; in the solution's unit.
    pub velocity_lag: f64,
}

impl Input {
    /// Path by which messages name the recording.
    pub(super) fn path(&self) -> &Path {
        self.paths.first().map_or(Path::new(""), PathBuf::as_path)
    }
}
