//! Errors between a frame and its file.

use std::io;
use std::path::PathBuf;

/// Why a frame was not written or read. The message is complete in itself: it names the file or array and the cause.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The frame has no particle; meshio and VTK cannot open a file without points.
    #[error("the frame has no particle")]
    NoParticles,
    /// The format counts particles in 32 bits.
    #[error("the frame has {particles} particles; a file holds at most {}", u32::MAX)]
    TooManyParticles {
        /// The number of particles.
        particles: usize,
    },
    /// The frame's time is infinite or not a number.
    #[error("the frame's time is {time}; it must be finite")]
    Time {
        /// The time.
        time: f64,
    },
    /// The step does not fit the signed 64 bits of VTK's `Cycle`.
    #[error("the frame's step is {step}; a file holds at most {}", i64::MAX)]
    Step {
        /// The step.
        step: u64,
    },
    /// An array's name would be lost or misread by some reader.
    #[error("array name {name:?}: use letters, digits and underscores, at least one")]
    ArrayName {
        /// The name.
        name: String,
    },
    /// The name of the solution has characters that are not allowed.
    #[error("solution name {name:?}: use letters, digits, underscores and hyphens, at least one")]
    SolutionName {
        /// The name.
        name: String,
    },
    /// A parameter of the solution is infinite or not a number.
    #[error("parameter {name} of the solution is {value}; it must be finite")]
    Parameter {
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
    },
    /// Two arrays have one name; readers would keep only one of them.
    #[error("two arrays of the frame are named `{name}`")]
    RepeatedName {
        /// The name.
        name: String,
    },
    /// The number of entries of an array is not the number of particles.
    #[error("array `{array}` has {found} entries for {particles} particles")]
    Length {
        /// The array.
        array: String,
        /// Its entries.
        found: usize,
        /// The frame's particles.
        particles: usize,
    },
    /// A value or position (array `points`) is infinite or not a number.
    #[error("array `{array}`, particle {particle}, component {component}: {value} is not finite")]
    NotFinite {
        /// The array.
        array: String,
        /// The particle's index in the frame, from 0.
        particle: usize,
        /// The component's index, from 0.
        component: usize,
        /// The value.
        value: f64,
    },
    /// The name of a series cannot begin a file name.
    #[error(
        "series name {name:?}: it begins file names, so it must not be empty, begin with a dot, or hold a slash, \
         a backslash or a control character"
    )]
    SeriesName {
        /// The name.
        name: String,
    },
    /// The frame could not be written as XML.
    #[error("the frame cannot be laid out as a .vtu file: {cause}")]
    Encode {
        /// The message of the writer.
        cause: String,
    },
    /// The file system refused.
    #[error("cannot {action} {}: {cause}", path.display())]
    FileSystem {
        /// The operation that was tried, such as `write`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The answer of the file system.
        cause: io::Error,
    },
    /// The file is not one that this crate wrote, or it was damaged since.
    #[error("{} is no frame as mmsmith writes it: {cause}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The content that was expected or met.
        cause: String,
    },
}
