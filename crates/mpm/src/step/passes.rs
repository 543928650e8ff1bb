//! The passes of a step by name, and the time that each takes.

use std::time::Instant;

use crate::grid::division::Division;

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

/// The times of passes, where they are wanted: some machines have no clock.
#[derive(Debug, Default)]
pub(crate) struct Passes(Option<Vec<PassTime>>);

impl Passes {
    /// Begins to take times.
    pub(crate) fn begin(&mut self) {
        self.0 = Some(Vec::new());
    }

    /// Before a pass.
    pub(crate) fn before(&self) -> Option<Instant> {
        self.0.is_some().then(Instant::now)
    }

    /// After a pass.
    pub(crate) fn after(&mut self, pass: Pass, begun: Option<Instant>) {
        if let (Some(times), Some(begun)) = (&mut self.0, begun) {
            let place = times.iter().position(|time| time.pass == pass).unwrap_or_else(|| {
                times.push(PassTime { pass, seconds: 0.0, calls: 0 });
                times.len() - 1
            });
            times[place].seconds += begun.elapsed().as_secs_f64();
            times[place].calls += 1;
        }
    }

    /// The passes that were done since then, in the order of a step.
    pub(crate) fn times(&self) -> Vec<PassTime> {
        let known = self.0.as_deref().unwrap_or_default();
        let of = |pass| known.iter().find(|time| time.pass == pass).copied();
        Pass::ALL.into_iter().filter_map(of).collect()
    }
}
