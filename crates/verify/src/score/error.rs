//! Why a recording cannot be scored.

use std::path::PathBuf;

use mmsmith_vtk::foreign::ReadError;
use thiserror::Error;

use super::Role;

/// Why a recording cannot be scored.
#[derive(Debug, Error)]
pub enum ScoreError {
    /// A file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The solution has a dimension that is not known here.
    #[error("the solution must have one, two or three dimensions")]
    Dimension,
    /// There is no such array.
    #[error("{}: there is no array `{name}` for {role} (there are: {there})", path.display())]
    NoArray {
        /// The file.
        path: PathBuf,
        /// The role that the array should have.
        role: Role,
        /// The name.
        name: String,
        /// The names that there are.
        there: String,
    },
    /// An array has the wrong number of components for what it should be.
    #[error("{}: array `{name}` has {components} component(s); {role} has {admissible}", path.display())]
    Components {
        /// The file.
        path: PathBuf,
        /// The role that the array should have.
        role: Role,
        /// The array.
        name: String,
        /// Its components.
        components: usize,
        /// How many there should be.
        admissible: String,
    },
    /// A frame without particles.
    #[error("{}: the frame holds no particle", path.display())]
    NoParticles {
        /// The file.
        path: PathBuf,
    },
    /// A frame without points, which only CSV files can have.
    #[error(
        "{}: there are no positions: write columns x, y, z, or X, Y, Z beside ux, uy, uz; of a body of revolution R, theta, Z, or without a twist R, \
         Z; there are {}",
        path.display(),
        arrays.join(", ")
    )]
    NoPositions {
        /// The file.
        path: PathBuf,
        /// The arrays that it has.
        arrays: Vec<String>,
    },
    /// The points have fewer coordinates than the solution.
    #[error("{}: points have {found} coordinate(s); the solution has {expected}", path.display())]
    Coordinates {
        /// The file.
        path: PathBuf,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// Nothing tells displacements.
    #[error(
        "{}: nothing tells displacements: give an array of displacements or of reference positions \
         (--map displacement=NAME or --map reference_position=NAME), or several frames with points that move (arrays there are: {there})", path.display()
    )]
    NoDisplacement {
        /// The file.
        path: PathBuf,
        /// The names of its arrays.
        there: String,
    },
    /// A frame lacks an array that the first one has, and that all need.
    #[error("{}: there is no array `{name}`, which the first frame has", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The array.
        name: String,
    },
    /// Particles of two frames cannot be told apart.
    #[error(
        "{}: it holds {found} particles, the first frame {expected}, and there is no array of identities \
         (--map id=NAME) to find them by; if each file is a recording of its own: --each", path.display()
    )]
    Unmatched {
        /// The file.
        path: PathBuf,
        /// Its particles.
        found: usize,
        /// Particles of the first frame.
        expected: usize,
    },
    /// A frame does not tell its time.
    #[error(
        "{}: nothing tells its time: give --times T,... with a time for each frame, --times-from FILE with a file that lists them, or \
         --frame-step DT; or list the frames with times in a .pvd file, or write a field TimeValue or a column t", path.display()
    )]
    NoTime {
        /// The file.
        path: PathBuf,
    },
    /// There are other numbers of times and of frames.
    #[error(
        "there are {times} time(s) for the {frames} frame(s) of {}: give one for each frame, the same for all recordings \
         (--times T,...), or --frame-step DT", path.display()
    )]
    OtherTimes {
        /// The recording.
        path: PathBuf,
        /// The times that are given.
        times: usize,
        /// Its frames.
        frames: usize,
    },
    /// No frame has a time that is a number.
    #[error("{}: none of its {frames} frame(s) has a finite time; the first one's is {first:?}", path.display())]
    TimesNotFinite {
        /// The recording.
        path: PathBuf,
        /// Its frames.
        frames: usize,
        /// The first time.
        first: f64,
    },
    /// No frame lies in the time in which the solution is looked at.
    #[error(
        "{}: its times, {first:?} to {last:?}, do not overlap the solution's, 0 to {end:?} ({periods} period(s)); \
         is another unit meant (--time-unit 0.001 for milliseconds)? Longer simulations need --periods", path.display()
    )]
    NoOverlap {
        /// The recording.
        path: PathBuf,
        /// The earliest time.
        first: f64,
        /// The latest time.
        last: f64,
        /// The end of the solution's time.
        end: f64,
        /// That end in periods.
        periods: f64,
    },
    /// Recordings are compared with each other, each with a time step.
    #[error(
        "there are {steps} time step(s) for {recordings} recording(s): two recordings at least, each with one, such as \
         --differences 1e-4,5e-5"
    )]
    Steps {
        /// Time steps.
        steps: usize,
        /// Recordings.
        recordings: usize,
    },
    /// Time steps do not fall by one ratio.
    #[error(
        "the time steps {coarse:?} and {fine:?} have another ratio than {ratio:?}, that of the first two: differences have the order \
         of the scheme only where each time step is the same part of the one before"
    )]
    Ratio {
        /// A time step.
        coarse: f64,
        /// The next.
        fine: f64,
        /// The ratio of the first two.
        ratio: f64,
    },
    /// Two recordings are of other particles.
    #[error(
        "{} and {} hold other particles at t = {time:?}: to be compared with each other, recordings need the same reference \
         positions, in one order or with identities (--map id=NAME)", path.display(), other.display()
    )]
    Apart {
        /// The file.
        path: PathBuf,
        /// The other one.
        other: PathBuf,
        /// The time.
        time: f64,
    },
    /// Two recordings have no time in common.
    #[error("{} and {} have no time in common", path.display(), other.display())]
    NoCommonTime {
        /// The file.
        path: PathBuf,
        /// The other one.
        other: PathBuf,
    },
    /// There is not one entry for each axis.
    #[error("{what} has {found} value(s); the solution has {expected} dimension(s)")]
    Entries {
        /// The option.
        what: &'static str,
        /// Its values.
        found: usize,
        /// The dimensions.
        expected: usize,
    },
    /// An axis of the files is taken twice.
    #[error(
        "--axes names an axis twice; it names the file's axis for each axis of the solution, such as --axes x,z"
    )]
    RepeatedAxis,
    /// No particle is left.
    #[error("{}: no particle lies inside the body; --origin and --length-unit tell where it is", path.display())]
    NoneInside {
        /// The file.
        path: PathBuf,
    },
    /// A number that makes no sense.
    #[error("{what} = {value:?}: it must be {admissible}")]
    Setting {
        /// The name of the setting.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The admissible values.
        admissible: &'static str,
    },
}
