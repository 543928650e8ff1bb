//! The door to every solver that moves particles: a step, a look at the particles, a state to resume from, and where the time went.

use std::sync::Arc;

use mmsmith_laws::Law;
use nalgebra::SVector;

use crate::body_force::BodyForce;
use crate::columns::Particles;
use crate::error::StepError;
use crate::saved_state::{SavedState, SavedStateError};

/// A solver that can be stepped and looked at.
pub trait Solver<T, const D: usize> {
    /// Advances by one time step.
    ///
    /// # Errors
    ///
    /// Where a particle is turned inside out, leaves the grid, grows too large or is no longer finite; no step can follow.
    fn step(&mut self, body_force: &dyn BodyForce<T, D>) -> Result<(), StepError>;

    /// The particles that this process holds as they are now, and their law.
    fn observe(&mut self) -> (&Particles<T, D>, &Law<T, D>);

    /// Which particles this process holds, where there are several.
    fn arrangement(&self) -> Option<Arrangement<'_>>;

    /// The reference positions at which a step evaluates the body force, in the order of the numbers by which it does.
    fn forced(&self) -> &[SVector<T, D>];

    /// How far velocities lag behind positions, a time.
    fn velocity_lag(&self) -> T;

    /// Takes the times of passes from now on, where the solver has such. Default: it has none.
    fn take_times(&mut self) {}

    /// Where the time of steps went since then. Default: nothing is known.
    fn profile(&self) -> Profile {
        Profile::default()
    }

    /// The state between two steps of the particles here: arrays as bytes in this machine's order.
    fn state(&self) -> Vec<&[u8]>;

    /// Goes on from the states that all processes of such a run had, each of which reads some; a call of all.
    ///
    /// # Errors
    ///
    /// Where it is not one of this set-up.
    fn take_up(&mut self, parts: Vec<SavedState>) -> Result<(), SavedStateError>;
}

/// Which particles a process holds, each of which no other one does.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement<'a> {
    /// Their numbers in the whole body, ascending.
    pub ids: &'a Arc<Vec<u64>>,
    /// Incremented whenever the set of particles of this process changes.
    pub version: u64,
}

/// A pass over particles or nodes, or the sort between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// P2G of mass, momentum and force, and the grid update.
    P2g,
    /// P2G of mass and momentum, before F follows the grid.
    P2gOfMomentum,
    /// G2P of F alone, before forces.
    G2pOfStretch,
    /// P2G of forces, and the grid update.
    P2gOfForce,
    /// Projection of the change of volume and of the mean stress.
    Projection,
    /// The filter of XPIC.
    Filter,
    /// G2P of velocities alone.
    G2pOfVelocity,
    /// P2G of the updated momentum.
    P2gOfUpdatedMomentum,
    /// G2P of all that is left.
    G2p,
    /// G2P of a step and P2G of the next one, with its grid update.
    G2pAndP2g,
    /// G2P of a step and P2G of the next one for particles that share corners, by way of these.
    AtCorners,
    /// Corners that particles share.
    Corners,
    /// The sort by tiles, with particles that go to other processes.
    Sort,
}

impl Pass {
    /// All of them, in the order of a step.
    pub const ALL: [Self; 13] = [
        Self::P2gOfMomentum,
        Self::G2pOfStretch,
        Self::Projection,
        Self::P2gOfForce,
        Self::P2g,
        Self::Filter,
        Self::Corners,
        Self::G2pOfVelocity,
        Self::P2gOfUpdatedMomentum,
        Self::G2p,
        Self::G2pAndP2g,
        Self::AtCorners,
        Self::Sort,
    ];

    /// The pass in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::P2g => "p2g",
            Self::P2gOfMomentum => "p2g of momentum",
            Self::G2pOfStretch => "g2p of F before forces",
            Self::P2gOfForce => "p2g of force",
            Self::Projection => "projection of volume",
            Self::Filter => "filter of xpic",
            Self::G2pOfVelocity => "g2p of velocity",
            Self::P2gOfUpdatedMomentum => "p2g of updated momentum",
            Self::G2p => "g2p",
            Self::G2pAndP2g => "g2p and p2g of the next step",
            Self::AtCorners => "g2p and p2g at shared corners",
            Self::Corners => "shared corners",
            Self::Sort => "sort",
        }
    }
}

/// How long a pass has taken in all, in seconds, and how many times it was done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// The pass.
    pub pass: Pass,
    /// Wall-clock time, with its grid update.
    pub seconds: f64,
    /// Times it was done.
    pub calls: u64,
}

/// Where the time of steps went, and how their work is divided.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// The passes of steps, in their order.
    pub passes: Vec<PassTime>,
    /// How many threads the tiles of particles keep busy, where one process holds all of them.
    pub division: Option<Division>,
}

/// How the work of a step is divided among threads: tiles of particles, and the order in which their sums are added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Division {
    /// Tiles that have particles.
    pub tiles: usize,
    /// The particles of the fullest tile over their mean number, among tiles that have some.
    pub unevenness: f64,
    /// All work over that of the longest chain of tasks each of which waits for the one before: more threads than that are of no use.
    pub cores: f64,
}
