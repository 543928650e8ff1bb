//! Schemes: how particles and grid exchange, and how a run goes on in time.

use std::fmt;

use mmsmith_galerkin::{Composition, Coordinates, Layout, MassMatrix};
use mmsmith_mpm::{Integrator, Shape, Transfer};
use serde::{Serialize, Serializer};

use crate::named::{Named, named};

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
    pub integrator: Integrator,
    /// The first velocity of centred differences; other integrators have no other one than [`Start::Halved`] says.
    pub start: Start,
    /// How particles get their velocity back from the grid.
    pub transfer: Transfer,
    /// Where the particles lie.
    pub placement: Placement,
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

/// Formulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formulation {
    /// Updated Lagrangian.
    Updated,
    /// Total Lagrangian.
    Total,
}

named! {
    Formulation {
        Updated = "updated-lagrangian", "updated", "ul":
            "Updated Lagrangian: weights anew in each step, from the current configuration";
        Total = "total-lagrangian", "total", "tl":
            "Total Lagrangian: weights once, from the reference configuration";
    }
    Composition {
        Order2 = "2": "Leapfrog";
        Order4 = "4": "Five stages";
        Order6 = "6": "Nine stages";
    }
    Start {
        Exact = "exact": "The exact velocity half a step before time zero";
        Data = "data": "Velocity and acceleration at time zero";
        Halved = "halved": "Velocity at time zero, first acceleration halved";
    }
    MassMatrix {
        Lumped = "lumped": "Row sums on the diagonal";
        Consistent = "consistent": "Integrated over the particles";
    }
    Coordinates {
        Cartesian = "cartesian": "Cartesian";
        Polar = "polar": "Radius and angle";
        Cylindrical = "cylindrical": "Radius, angle and height";
        Spherical = "spherical":
            "Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis";
    }
    Layout {
        Lattice = "lattice": "Centres of equal parts of a cell";
        Gauss = "gauss": "Gauss-Legendre points";
    }
}

/// The value of a choice.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Choice {
    /// One of few, or a name with a number in it.
    Name(String),
    /// An order.
    Order(usize),
    /// A number.
    Number(f64),
}

/// As options take it.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => f.write_str(name),
            Self::Order(order) => write!(f, "{order}"),
            Self::Number(value) => write!(f, "{value}"),
        }
    }
}

impl Default for Updated {
    /// The settings of the original study that gave the best accuracy.
    fn default() -> Self {
        Self {
            shape: Shape::Gimp,
            integrator: Integrator::Cd,
            start: Start::Halved,
            transfer: Transfer::Flip,
            placement: Placement::Lattice { offset: 0.0 },
        }
    }
}

impl Placement {
    /// The name of the layout.
    #[must_use]
    pub fn name(self) -> &'static str {
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
    #[must_use]
    pub fn pose(self) -> GridPose {
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

    /// The order with which errors of time stepping grow; those of the updated formulation at most.
    pub(crate) fn order_in_time(&self) -> i32 {
        match self {
            Self::Updated(_) => 2,
            Self::Total(total) => total.composition.order() as i32,
        }
    }

    /// Whether the first velocities are those of half a step before the start.
    pub(crate) fn starts_early(&self) -> bool {
        self.updated().is_some_and(|updated| updated.start != Start::Halved)
    }

    /// The formulation.
    #[must_use]
    pub fn formulation(&self) -> Formulation {
        match self {
            Self::Updated(_) => Formulation::Updated,
            Self::Total(_) => Formulation::Total,
        }
    }

    /// The name of the weights.
    #[must_use]
    pub fn shape(&self) -> String {
        match self {
            Self::Updated(updated) => updated.shape.to_string(),
            Self::Total(total) => format!("bspline{}", total.degree),
        }
    }

    /// The name of the layout of particles.
    #[must_use]
    pub fn layout(&self) -> &'static str {
        match self {
            Self::Updated(updated) => updated.placement.name(),
            Self::Total(total) => total.layout.name(),
        }
    }

    /// Every choice of the formulation, and none of the other one, under the name that its option has.
    #[must_use]
    pub fn choices(&self) -> Vec<(&'static str, Choice)> {
        let name = |name: &str| Choice::Name(name.to_owned());
        let mut all = vec![("formulation", name(self.formulation().name()))];
        match self {
            Self::Updated(Updated { integrator, start, transfer, placement, .. }) => {
                all.extend([
                    ("layout", name(placement.name())),
                    ("shape", Choice::Name(self.shape())),
                    ("transfer", Choice::Name(transfer.to_string())),
                    ("integrator", name(integrator.name())),
                ]);
                if *integrator == Integrator::Cd {
                    all.push(("start", name(start.name())));
                }
                if *placement != Placement::BodyFitted {
                    all.push(("offset", Choice::Number(placement.offset())));
                }
                if placement.is_clipped() {
                    let GridPose { angle, shift } = placement.pose();
                    all.push(("grid-angle", Choice::Number(angle)));
                    all.push(("grid-shift", Choice::Number(shift)));
                }
            }
            Self::Total(Total { mass, composition, layout, coordinates, .. }) => all.extend([
                ("shape", Choice::Name(self.shape())),
                ("layout", name(layout.name())),
                ("grid", name(coordinates.name())),
                ("mass", name(mass.name())),
                ("composition", Choice::Order(composition.order())),
            ]),
        }
        all
    }
}

/// The [choices](Scheme::choices), and `frame`, which is the formulation under the name that it had.
impl Serialize for Scheme {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let frame = self.formulation().aliases()[0];
        let all = self.choices().into_iter().map(|(name, value)| (name.replace('-', "_"), value));
        serializer.collect_map(all.chain([("frame".to_owned(), Choice::Name(frame.to_owned()))]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(scheme: Scheme) -> Vec<String> {
        let written = serde_json::to_value(scheme).unwrap();
        written.as_object().unwrap().keys().cloned().collect()
    }

    /// Choices of the other formulation are not written.
    #[test]
    fn a_scheme_is_written_with_its_own_choices() {
        let usual = Updated::default();
        let common = ["formulation", "frame", "integrator", "layout"];
        let of_cd = ["offset", "shape", "start", "transfer"];
        assert_eq!(keys(Scheme::Updated(usual)), [&common[..], &of_cd].concat());
        let usl = Updated { integrator: Integrator::Usl, ..usual };
        assert!(!keys(Scheme::Updated(usl)).contains(&"start".to_owned()));
        let total = keys(Scheme::Total(Total::of_degree(4)));
        assert_eq!(
            total,
            ["composition", "formulation", "frame", "grid", "layout", "mass", "shape"]
        );
        let written = serde_json::to_value(Scheme::Total(Total::of_degree(4))).unwrap();
        assert_eq!((&written["frame"], &written["composition"]), (&"total".into(), &6.into()));
    }
}
