//! Schemes: how particles and grid exchange, and how a run goes on in time.

use std::fmt;

use mmsmith_galerkin::{Composition, Coordinates, Layout, MassMatrix};
use mmsmith_mpm::{Integrator, Shape, Transfer};

/// How particles and grid exchange, and how a run goes on in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// Weights anew in each step, at the current positions.
    Updated(Updated),
    /// Weights once, at the reference positions.
    Total(Total),
}

/// A scheme of the updated Lagrangian formulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Updated {
    /// The weights between particles and grid.
    pub shape: Shape,
    /// The time integration.
    pub stepping: Stepping,
    /// How particles get their velocity back from the grid.
    pub transfer: Transfer,
    /// Where the particles lie.
    pub placement: Placement,
}

/// Time integration; [`Integrator`] says what each does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stepping {
    /// Update stress first.
    Usf,
    /// Update stress last.
    Usl,
    /// Modified update stress last.
    Musl,
    /// Update stress averaged.
    Usavg,
    /// Centred differences, from a first velocity.
    Cd(Start),
}

/// How centred differences get their first velocity, half a step before the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The exact velocity at minus half a step.
    Exact,
    /// From the data at time zero: `v0 - dt/2 a0`.
    Data,
    /// The velocity at time zero, with the first step's acceleration halved.
    Halved,
}

/// Where the particles of the updated formulation lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// At the centres of equal parts of the background cells.
    Lattice {
        /// By how much the lattice is shifted along every axis, in units of the particles' distance, at most half of it
        /// either way: with 0.5 some particles are on cell edges, and on the upper walls.
        offset: f64,
    },
    /// For rings: at the centroids of polar cells, whose corners lie on the rims.
    BodyFitted,
    /// In the plane and in space: at the centroids of the boxes of a lattice, clipped with the boundary of the body.
    Clipped {
        /// As of a lattice.
        offset: f64,
        /// How the background grid, and the lattice with it, lies against the body.
        pose: GridPose,
    },
}

/// How the background grid lies against the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridPose {
    /// The angle of its axes against those of the body, in degrees, counter-clockwise.
    pub angle: f64,
    /// The shift of its lines along each of its axes, in cells.
    pub shift: f64,
}

impl GridPose {
    /// Whether its lines are where they are usually.
    #[must_use]
    pub fn is_usual(self) -> bool {
        self == Self::default()
    }
}

/// A scheme of the total Lagrangian formulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Total {
    /// The splines' degree, 2 to 5.
    pub degree: usize,
    /// The mass matrix.
    pub mass: MassMatrix,
    /// The composition of leapfrog.
    pub composition: Composition,
    /// Where the particles lie in a cell.
    pub layout: Layout,
    /// Meaning of the grid's coordinates.
    pub coordinates: Coordinates,
}

/// A scheme's parts, each as options, JSON and captions spell it. What a formulation has no choice of is there as well.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// The formulation: `updated` or `total`.
    pub frame: &'static str,
    /// The weights.
    pub shape: String,
    /// The time integrator.
    pub integrator: String,
    /// The start of centred differences.
    pub start: String,
    /// Velocities from the grid.
    pub transfer: String,
    /// Where the particles lie.
    pub layout: &'static str,
    /// The shift of the particles' lattice, in units of their distance.
    pub offset: f64,
    /// How the grid lies against the body.
    pub pose: GridPose,
    /// The mass matrix.
    pub mass: &'static str,
    /// The order in time of the composition of leapfrog.
    pub composition: usize,
    /// The coordinates of the background grid.
    pub grid: &'static str,
}

impl Default for Updated {
    /// The settings of the original study that gave the best accuracy.
    fn default() -> Self {
        Self {
            shape: Shape::Gimp,
            stepping: Stepping::Cd(Start::Halved),
            transfer: Transfer::Flip,
            placement: Placement::Lattice { offset: 0.0 },
        }
    }
}

impl Stepping {
    /// By an integrator, which has that start if it is centred differences.
    #[must_use]
    pub fn new(integrator: Integrator, start: Start) -> Self {
        match integrator {
            Integrator::Usf => Self::Usf,
            Integrator::Usl => Self::Usl,
            Integrator::Musl => Self::Musl,
            Integrator::Usavg => Self::Usavg,
            Integrator::Cd => Self::Cd(start),
        }
    }
}

impl From<Stepping> for Integrator {
    fn from(stepping: Stepping) -> Self {
        match stepping {
            Stepping::Usf => Self::Usf,
            Stepping::Usl => Self::Usl,
            Stepping::Musl => Self::Musl,
            Stepping::Usavg => Self::Usavg,
            Stepping::Cd(_) => Self::Cd,
        }
    }
}

/// The name that the field has for the integrator.
impl fmt::Display for Stepping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Integrator::from(*self).fmt(f)
    }
}

/// The name that the field has for it.
impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Exact => "exact",
            Self::Data => "data",
            Self::Halved => "halved",
        })
    }
}

/// The name of coordinates.
pub(crate) fn grid_name(coordinates: Coordinates) -> &'static str {
    match coordinates {
        Coordinates::Cartesian => "cartesian",
        Coordinates::Polar => "polar",
        Coordinates::Spherical => "spherical",
    }
}

impl Placement {
    /// The name of the layout.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Lattice { .. } => "lattice",
            Self::BodyFitted => "body-fitted",
            Self::Clipped { .. } => "clipped",
        }
    }

    /// The shift of the lattice; that of what is no lattice is zero.
    pub(crate) fn offset(self) -> f64 {
        match self {
            Self::Lattice { offset } | Self::Clipped { offset, .. } => offset,
            Self::BodyFitted => 0.0,
        }
    }

    /// How the grid lies against the body.
    pub(crate) fn pose(self) -> GridPose {
        match self {
            Self::Clipped { pose, .. } => pose,
            Self::Lattice { .. } | Self::BodyFitted => GridPose::default(),
        }
    }

    /// Whether the particles are clipped with the boundary of the body.
    #[must_use]
    pub fn is_clipped(self) -> bool {
        matches!(self, Self::Clipped { .. })
    }
}

impl Scheme {
    /// The scheme of the updated formulation, if it is one.
    #[must_use]
    pub fn updated(&self) -> Option<&Updated> {
        match self {
            Self::Updated(updated) => Some(updated),
            Self::Total(_) => None,
        }
    }

    /// The scheme of the total formulation, if it is one.
    #[must_use]
    pub fn total(&self) -> Option<&Total> {
        match self {
            Self::Updated(_) => None,
            Self::Total(total) => Some(total),
        }
    }

    /// Whether the first velocities are those of half a step before the start.
    pub(crate) fn starts_early(&self) -> bool {
        let stepping = self.updated().map(|updated| updated.stepping);
        matches!(stepping, Some(Stepping::Cd(Start::Exact | Start::Data)))
    }

    /// The parts as they are spelled.
    #[must_use]
    pub fn parts(&self) -> Parts {
        match self {
            Self::Updated(Updated { shape, stepping, transfer, placement }) => Parts {
                frame: "updated",
                shape: shape.to_string(),
                integrator: stepping.to_string(),
                start: match stepping {
                    Stepping::Cd(start) => start.to_string(),
                    _ => Start::Halved.to_string(),
                },
                transfer: transfer.to_string(),
                layout: placement.name(),
                offset: placement.offset(),
                pose: placement.pose(),
                mass: "lumped",
                composition: Composition::Order2.order(),
                grid: grid_name(Coordinates::Cartesian),
            },
            Self::Total(Total { degree, mass, composition, layout, coordinates }) => Parts {
                frame: "total",
                shape: format!("bspline{degree}"),
                integrator: Integrator::Cd.to_string(),
                start: Start::Halved.to_string(),
                transfer: Transfer::Flip.to_string(),
                layout: match layout {
                    Layout::Lattice => "lattice",
                    Layout::Gauss => "gauss",
                },
                offset: 0.0,
                pose: GridPose::default(),
                mass: match mass {
                    MassMatrix::Lumped => "lumped",
                    MassMatrix::Consistent => "consistent",
                },
                composition: composition.order(),
                grid: grid_name(*coordinates),
            },
        }
    }
}
