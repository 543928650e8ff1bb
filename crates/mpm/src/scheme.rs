//! The scheme of a simulation: shape function, integrator, transfer.

use std::fmt;
use std::str::FromStr;

use crate::domain::Shape;
use crate::named::{UnknownName, named};

named! {
    /// Time integration.
    pub enum Integrator {
        /// Update stress first
        ///
        /// F is updated before forces are computed.
        Usf = "usf",
        /// Update stress last
        ///
        /// F is updated with the grid velocity at the end of the step.
        Usl = "usl",
        /// Update stress last, with the velocity projected again
        ///
        /// As `Usl`, with velocities projected anew from the updated particles.
        Musl = "musl",
        /// Stress updated by halves, before the forces and after
        ///
        /// F is updated by half a step with the grid velocity before forces are computed, and by the other half with that at
        /// the end of the step (Nairn, CMES 4 (2003) 649-663).
        Usavg = "usavg",
        /// Centred differences
        ///
        /// The arithmetic of `Usl`, with particle velocities half a step behind positions.
        Cd = "cd",
    }
}

impl Integrator {
    /// The share of a step by which F is updated before the forces.
    pub(crate) fn early(self) -> f64 {
        match self {
            Self::Usf => 1.0,
            Self::Usavg => 0.5,
            Self::Usl | Self::Musl | Self::Cd => 0.0,
        }
    }

    /// Whether F follows velocities that are projected anew from the updated particles.
    pub(crate) fn reprojects(self) -> bool {
        self == Self::Musl
    }

    /// Whether velocities are half a step behind positions.
    pub(crate) fn is_staggered(self) -> bool {
        self == Self::Cd
    }
}

/// The velocity update of G2P. With every transfer positions and F follow the grid's velocity `v_i + dt a_i`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    /// The change is added: `v_p += dt sum S_ip a_i`.
    #[default]
    Flip,
    /// The grid's velocity is taken: `v_p = sum S_ip (v_i + dt a_i)`; dissipative.
    Pic,
    /// The grid's velocity and its affine part around the particle, which conserves angular momentum (Jiang, Schroeder,
    /// Selle, Teran & Stomakhin, ACM Trans. Graph. 34 (2015) 51). The particle's inertia `D_p` is summed from the weights:
    /// h^2/4 for quadratic and h^2/3 for cubic splines. For hat functions at a point it may be singular, and the affine part
    /// is the gradient of the velocity.
    Apic,
    /// `XPIC(m)`: PIC with a filter of order m, which removes the null space of the grid's interpolation alone (Hammerquist & Nairn, CMAME
    /// 318 (2017) 724-738). `Xpic(1)` is PIC, and the larger m, the nearer to FLIP without its noise.
    Xpic(u32),
}

/// How particles take the grid's velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VelocityUpdate {
    /// The change of the grid's velocity is added.
    Increment,
    /// The grid's velocity takes the place of the particle's.
    Replace,
    /// The filtered velocity of the grid takes the place of the particle's.
    FilteredReplace(Filter),
}

/// A filter of the grid's velocity: see `xpic.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Filter {
    pub(crate) order: u32,
}

impl Transfer {
    /// The largest order of a filter: each costs a pass over the particles, and beyond some tens nothing is left to filter.
    const HIGHEST_ORDER: u32 = 100;

    /// How particles take the grid's velocity.
    pub(crate) fn velocity_update(self) -> VelocityUpdate {
        match self {
            Self::Flip => VelocityUpdate::Increment,
            Self::Pic | Self::Apic => VelocityUpdate::Replace,
            Self::Xpic(order) => VelocityUpdate::FilteredReplace(Filter { order }),
        }
    }

    /// Whether particles have affine velocities.
    #[must_use]
    pub fn is_affine(self) -> bool {
        self == Self::Apic
    }

    /// Whether a step goes to particles and back to filter velocities.
    #[must_use]
    pub fn is_filtered(self) -> bool {
        matches!(self.velocity_update(), VelocityUpdate::FilteredReplace(filter) if filter.order > 1)
    }
}

impl fmt::Display for Transfer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flip => f.pad("flip"),
            Self::Pic => f.pad("pic"),
            Self::Apic => f.pad("apic"),
            Self::Xpic(order) => f.pad(&format!("xpic{order}")),
        }
    }
}

impl FromStr for Transfer {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let plain = [Self::Flip, Self::Pic, Self::Apic];
        let filtered = || (1..=Self::HIGHEST_ORDER).map(Self::Xpic);
        plain
            .into_iter()
            .chain(filtered())
            .find(|transfer| transfer.to_string() == name)
            .ok_or_else(|| {
                UnknownName::among(format!("flip, pic, apic, xpic1 to xpic{}", Self::HIGHEST_ORDER))
            })
    }
}

/// The scheme of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<T> {
    /// Shape function.
    pub shape: Shape,
    /// Time integration.
    pub integrator: Integrator,
    /// Velocities from the grid to the particles.
    pub transfer: Transfer,
    /// Time step dt.
    pub time_step: T,
    /// Centred differences from velocities at time 0: halves the accelerations of the first step, so that they carry
    /// the velocities to dt/2 only. Without it the initial velocities are those at -dt/2.
    pub halve_first_acceleration: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_read_as_it_is_written() {
        for shape in Shape::ALL {
            assert_eq!(shape.to_string().parse(), Ok(shape));
        }
        for integrator in Integrator::ALL {
            assert_eq!(integrator.to_string().parse(), Ok(integrator));
        }
        let transfers = [Transfer::Flip, Transfer::Pic, Transfer::Apic];
        for transfer in transfers.into_iter().chain([1, 3, 100].map(Transfer::Xpic)) {
            assert_eq!(transfer.to_string().parse(), Ok(transfer));
        }
        for text in ["xpic", "xpic0", "xpic101", "xpic+2", "xpic2.5", "PIC", ""] {
            assert!(text.parse::<Transfer>().is_err(), "{text}");
        }
        let refusal = "GIMP".parse::<Shape>().unwrap_err().to_string();
        assert!(refusal.contains("linear, ugimp, gimp, bspline2"), "{refusal}");
        assert_eq!(Integrator::Usl.about(), "Update stress last");
    }
}
