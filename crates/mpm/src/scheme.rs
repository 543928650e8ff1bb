//! The scheme of a simulation: shape function, integrator, transfer.

use std::fmt;

/// Shape functions, whose values at particles are the weights of P2G and G2P.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// Hat functions at the particle's centre.
    Linear,
    /// GIMP weights with boxes of fixed size.
    Ugimp,
    /// GIMP weights with boxes that stretch with the diagonal of F.
    Gimp,
    /// Quadratic B-splines about the nodes, at the particle's centre.
    ///
    /// Splines beyond a wall are folded on their mirror images, the component across the wall with the opposite sign. The
    /// weights so add up to one in every cell, and fields that are linear and vanish across the wall on it are reproduced:
    /// of linear fields these are all that a frictionless wall admits. Beyond an open face the nodes go on, and all linear
    /// fields are reproduced there. (Steffen, Kirby & Berzins, IJNME 76 (2008) 922-948, change the splines at the boundary
    /// instead. With lumped mass that costs an order there: the changed spline's centre of mass is not where its coefficient is.)
    Bspline2,
    /// Cubic B-splines about the nodes, at the particle's centre; walls as for `Bspline2`.
    Bspline3,
    /// Hat functions interpolated between the corners of a parallelogram that F carries along (CPDI: Sadeghirad, Brannon
    /// & Burghardt, IJNME 86 (2011) 1435-1456); segments, parallelograms, parallelepipeds.
    Cpdi,
    /// The same on segments, quadrilaterals and hexahedra whose corners are points of the body, which neighbours share and
    /// which move with the grid (CPDI2: Sadeghirad, Brannon & Guilkey, IJNME 95 (2013) 928-952).
    Cpdi2,
}

/// The name that the field has for it.
impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Linear => "linear",
            Self::Ugimp => "ugimp",
            Self::Gimp => "gimp",
            Self::Bspline2 => "bspline2",
            Self::Bspline3 => "bspline3",
            Self::Cpdi => "cpdi",
            Self::Cpdi2 => "cpdi2",
        })
    }
}

/// Time integration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Integrator {
    /// Update stress first: F is updated before forces are computed.
    Usf,
    /// Update stress last: F is updated with the grid velocity at the end of the step.
    Usl,
    /// Modified update stress last: as `Usl`, with velocities projected anew from the updated particles.
    Musl,
    /// Update stress averaged: F is updated by half a step with the grid velocity before forces are computed, and by the
    /// other half with that at the end of the step (Nairn, CMES 4 (2003) 649-663).
    Usavg,
    /// Centred differences: the arithmetic of `Usl`, with particle velocities half a step behind positions.
    Cd,
}

/// The name that the field has for it.
impl fmt::Display for Integrator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Usf => "usf",
            Self::Usl => "usl",
            Self::Musl => "musl",
            Self::Usavg => "usavg",
            Self::Cd => "cd",
        })
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

impl Transfer {
    /// Whether particles have affine velocities.
    pub(crate) fn is_affine(self) -> bool {
        self == Self::Apic
    }
}

impl fmt::Display for Transfer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flip => f.write_str("flip"),
            Self::Pic => f.write_str("pic"),
            Self::Apic => f.write_str("apic"),
            Self::Xpic(order) => write!(f, "xpic{order}"),
        }
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
