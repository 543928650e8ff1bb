//! Errors of set-up and of steps.

use thiserror::Error;

/// Why a step could not be completed. Particle ids are indices into [`Particles`](crate::Particles).
///
/// Exhaustive: code that stores results on disk has to know every variant.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StepError {
    /// A deformation gradient lost its orientation.
    #[error("step {step}, time {time:.6e}: particle {particle} is turned inside out (J = {J:.3e})")]
    Inverted {
        /// Number of the failed step, counted from 1; 0 for the initial state.
        step: usize,
        /// Time at the end of that step.
        time: f64,
        /// Particle id.
        particle: usize,
        /// Its determinant of F, or where the change of volume is projected that change, zero or negative.
        J: f64,
    },
    /// A position or a deformation gradient overflowed or became NaN.
    #[error(
        "step {step}, time {time:.6e}: particle {particle} has a value that is not finite \
         (x = {position:.6?}, J = {J:.3e})"
    )]
    NotFinite {
        /// Number of the failed step, counted from 1; 0 for the initial state.
        step: usize,
        /// Time at the end of that step.
        time: f64,
        /// Particle id.
        particle: usize,
        /// Its current position.
        position: Vec<f64>,
        /// Its determinant of F.
        J: f64,
    },
    /// A particle's centre moved out of the grid.
    #[error(
        "step {step}, time {time:.6e}: particle {particle} left the grid at x = {position:.6?} \
         (axis {axis}: {lower:.3e} to {upper:.3e})"
    )]
    LeftGrid {
        /// Number of the failed step, counted from 1; 0 for the initial state.
        step: usize,
        /// Time at the end of that step.
        time: f64,
        /// Particle id.
        particle: usize,
        /// Its current position.
        position: Vec<f64>,
        /// The first axis along which it is outside.
        axis: usize,
        /// Lower end of the grid along that axis.
        lower: f64,
        /// Upper end of the grid along that axis.
        upper: f64,
    },
    /// A particle box grew wider than the weights support.
    #[error(
        "step {step}, time {time:.6e}: the box of particle {particle} has half-size {half_size:.3e} along axis {axis}, \
         more than the supported {limit:.3e}"
    )]
    TooLarge {
        /// Number of the failed step, counted from 1; 0 for the initial state.
        step: usize,
        /// Time at the end of that step.
        time: f64,
        /// Particle id.
        particle: usize,
        /// Axis along which the box is too wide.
        axis: usize,
        /// The box's half-size along that axis.
        half_size: f64,
        /// The largest half-size that is supported.
        limit: f64,
    },
}

impl StepError {
    /// Numbers that say all of an error.
    pub const NUMBERS: usize = 10;

    /// This error of another particle.
    pub fn about(mut self, id: usize) -> Self {
        let (Self::Inverted { particle, .. }
        | Self::NotFinite { particle, .. }
        | Self::LeftGrid { particle, .. }
        | Self::TooLarge { particle, .. }) = &mut self;
        *particle = id;
        self
    }

    /// The error as numbers, for another process.
    pub fn to_numbers(&self) -> [f64; Self::NUMBERS] {
        let mut numbers = [0.0; Self::NUMBERS];
        let mut set = |kind: f64, (step, time, particle): (usize, f64, usize), rest: &[f64]| {
            numbers[..4].copy_from_slice(&[kind, step as f64, time, particle as f64]);
            numbers[4..4 + rest.len()].copy_from_slice(rest);
        };
        let place = |position: &[f64]| {
            let mut place = [f64::NAN; 3];
            place[..position.len()].copy_from_slice(position);
            (position.len() as f64, place)
        };
        match self {
            Self::Inverted { step, time, particle, J } => {
                set(0.0, (*step, *time, *particle), &[*J])
            }
            Self::NotFinite { step, time, particle, position, J } => {
                let (dimension, [x, y, z]) = place(position);
                set(1.0, (*step, *time, *particle), &[*J, dimension, x, y, z]);
            }
            Self::LeftGrid { step, time, particle, position, axis, lower, upper } => {
                let (dimension, [x, y, z]) = place(position);
                let axis = *axis as f64 + 10.0 * dimension;
                set(2.0, (*step, *time, *particle), &[axis, *lower, *upper, x, y, z]);
            }
            Self::TooLarge { step, time, particle, axis, half_size, limit } => {
                set(3.0, (*step, *time, *particle), &[*axis as f64, *half_size, *limit]);
            }
        }
        numbers
    }

    /// The error that these numbers say.
    pub fn from_numbers(numbers: &[f64; Self::NUMBERS]) -> Self {
        let [kind, step, time, particle, a, b, c, x, y, z] = *numbers;
        let (step, particle) = (step as usize, particle as usize);
        match kind as u8 {
            0 => Self::Inverted { step, time, particle, J: a },
            1 => {
                let position = [c, x, y][..b as usize].to_vec();
                Self::NotFinite { step, time, particle, position, J: a }
            }
            2 => {
                let (dimension, axis) = (a as usize / 10, a as usize % 10);
                let position = [x, y, z][..dimension].to_vec();
                Self::LeftGrid { step, time, particle, position, axis, lower: b, upper: c }
            }
            _ => {
                let axis = a as usize;
                Self::TooLarge { step, time, particle, axis, half_size: b, limit: c }
            }
        }
    }
}

/// Why a simulation could not be set up.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SetupError {
    /// There is nothing to simulate.
    #[error("there are no particles; is the grid too coarse, or the body outside it?")]
    NoParticles,
    /// A projected change of volume of a law with internal variables of its own.
    #[error(
        "--volume projected: the law has internal variables of its own, and their histories follow each particle's own change of volume; \
         leave --volume out"
    )]
    ProjectedMemory,
    /// A projected change of volume of a body of revolution in its half plane.
    #[error(
        "--volume projected: particles of a half plane have the stretch around the axis from their own radius, and their change of volume is not \
         projected; leave --volume out, or write --formulation total-lagrangian --grid cylindrical"
    )]
    ProjectedHalfPlane,
    /// Another scheme than the usual one, where the solver is compiled for that one alone.
    #[error(
        "the solver is compiled without the feature every-scheme: for gimp, cd and flip on one process"
    )]
    UsualSchemeOnly,
    /// A grid that cannot be cut for so many processes.
    #[error("this grid cannot be cut for {ranks} processes; start {most}")]
    TooManyRanks {
        /// The number of processes.
        ranks: usize,
        /// The largest number below it for which the grid can be cut.
        most: usize,
    },
    /// A grid of processes that does not suit.
    #[error(
        "{ranks} processes in a grid of {}: {}",
        asked.iter().map(usize::to_string).collect::<Vec<_>>().join(" x "),
        match asked.iter().product::<usize>() {
            product if product != *ranks => format!("these are {product}; start so many"),
            _ => format!(
                "this grid of cells can be cut for {} processes along its axes at most",
                most.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ")
            ),
        }
    )]
    ProcessGrid {
        /// Processes along each axis, as asked for.
        asked: Vec<usize>,
        /// The number of processes.
        ranks: usize,
        /// The most processes along each axis.
        most: Vec<usize>,
    },
    /// Mesh of a part of a body without their numbers in the whole.
    #[error("the polygons of a process have no numbers in the whole body; take them by Body::part")]
    NoNumbers,
    /// More particles than ids.
    #[error("{particles} particles are more than the supported {limit}")]
    TooManyParticles {
        /// Number of particles given.
        particles: usize,
        /// Largest supported number.
        limit: usize,
    },
    /// The particle arrays do not have the same length.
    #[error("the particle array `{array}` has {found} entries where `X` has {expected}")]
    LengthMismatch {
        /// Name of the array in [`Particles`](crate::Particles).
        array: &'static str,
        /// Its length.
        found: usize,
        /// The length of `X`.
        expected: usize,
    },
    /// A quantity that has to be positive and finite is not.
    #[error("{quantity} has to be positive and finite, not {value:e}")]
    NotPositive {
        /// Its name, for example "the time step" or "the mass of particle 7".
        quantity: String,
        /// The value given.
        value: f64,
    },
    /// An axis that is periodic at one end.
    #[error(
        "axis {axis} is periodic at one end only; an axis that returns to its beginning has to be so at both"
    )]
    HalfPeriodic {
        /// The axis.
        axis: usize,
    },
    /// An axis that is uniform at one end, or in more than one cell.
    #[error("axis {axis} has to be uniform at both ends and in one cell, or at none")]
    HalfUniform {
        /// The axis.
        axis: usize,
    },
    /// A quantity that has to be finite is not.
    #[error("{quantity} has to be finite")]
    NotFinite {
        /// Its name, for example "the velocity of particle 7".
        quantity: String,
    },
    /// An axis without cells.
    #[error("the grid has no cells along axis {axis}")]
    NoCells {
        /// The axis.
        axis: usize,
    },
    /// The grid's nodes do not fit into memory.
    #[error(
        "a grid of {cells:?} cells needs {bytes} bytes of memory, which cannot be had; use fewer cells"
    )]
    GridTooLarge {
        /// Number of cells along each axis.
        cells: Vec<usize>,
        /// Bytes needed, saturating at the largest representable number.
        bytes: u128,
    },
    /// A degree of splines without a kernel.
    #[error("splines of degree {degree} are not supported; the degree has to be 2 to {most}")]
    Degree {
        /// The degree asked for.
        degree: usize,
        /// The largest degree.
        most: usize,
    },
    /// An axis with too few cells for the splines on it.
    #[error("{cells} cells along axis {axis} are too few for these splines; use at least {least}")]
    TooFewCells {
        /// The axis.
        axis: usize,
        /// Its cells.
        cells: usize,
        /// The smallest number that suffices.
        least: usize,
    },
    /// The total Lagrangian formulation in single precision.
    #[error("the total Lagrangian formulation computes in double precision only")]
    DoublePrecisionOnly,
    /// The particles do not determine the splines' coefficients.
    #[error(
        "the mass matrix along axis {axis} is singular: {per_cell} particles per cell do not determine the splines' \
         coefficients; use more"
    )]
    SingularMass {
        /// The axis.
        axis: usize,
        /// Particles in a cell along it.
        per_cell: usize,
    },
    /// Polar coordinates in a dimension other than two.
    #[error("polar grids are two-dimensional; this one has dimension {dimension}")]
    PolarDimension {
        /// The grid's dimension.
        dimension: usize,
    },
    /// Spherical or cylindrical coordinates in a dimension other than three.
    #[error(
        "spherical and cylindrical grids are three-dimensional; this one has dimension {dimension}"
    )]
    SphericalDimension {
        /// The grid's dimension.
        dimension: usize,
    },
    /// GIMP boxes for particles whose domains are no boxes.
    #[error(
        "the domain of particle {particle} is not a box along the axes, which GIMP weights need; use those of CPDI"
    )]
    NotABox {
        /// The first particle of this kind.
        particle: usize,
    },
    /// A shape or a grid that serves no body that turns about its axis.
    #[error(
        "particles of a body that turns about its axis have the shape linear, ugimp, gimp, bspline2, bspline3 or gimp-bspline2, on a grid with one cell \
         around the axis, not {shape}: write --shape gimp"
    )]
    Revolving {
        /// Name of the shape.
        shape: String,
    },
    /// Mesh or polyhedra on a line.
    #[error("polygons and polyhedra have two or three dimensions; this body has {dimension}")]
    PolygonDimension {
        /// The body's dimension.
        dimension: usize,
    },
    /// Weights that polygons do not have.
    #[error(
        "particles that are polygons have the weights of cpdi2, bspline2 or bspline3, not those of {shape}"
    )]
    NotOfPolygons {
        /// The weights asked for.
        shape: String,
    },
    /// Walls on a grid whose axes are not those of the body.
    #[error("a grid that is turned against the body cannot have walls")]
    TurnedWalls,
    /// Weights between corners that the body does not have.
    #[error("a body without shared corners cannot have the weights of CPDI2; use those of CPDI")]
    NoCorners,
    /// A domain with a corner that does not exist.
    #[error("a domain has the corner {corner}, but there are only {corners}")]
    NoSuchCorner {
        /// The index.
        corner: usize,
        /// The number of corners.
        corners: usize,
    },
    /// A corner that no domain has: nothing would tell when it leaves the grid.
    #[error("the corner {corner} belongs to no particle's domain; leave it out")]
    IdleCorner {
        /// Its index.
        corner: usize,
    },
    /// Only centred differences start with half an acceleration.
    #[error("a halved first acceleration belongs to centred differences only, not to {integrator}")]
    HalvedStart {
        /// The integrator asked for.
        integrator: String,
    },
    /// A particle's initial state cannot be simulated: outside the grid, J <= 0, not finite, or too large a box.
    #[error("the initial state is not admissible: {0}")]
    InitialState(StepError),
}
