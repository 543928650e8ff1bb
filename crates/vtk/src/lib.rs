//! Particle frames as VTK files, and back.
//!
//! A [`Frame`] holds one instant of a particle simulation: positions and named arrays over the particles. [`to_bytes`]
//! turns it into a `.vtu` file (an unstructured grid with one vertex a particle), [`read`] turns such a file back into
//! the same frame, bit for bit, and a [`Series`] writes frame after frame into a folder, with a `.pvd` file that lists
//! them with their times. ParaView and pyvista open the `.pvd`; meshio opens the single `.vtu` files.
//!
//! [`foreign`] reads the particles and nodes that other programs write, in whatever variant.
//!
//! The files use one of the format's many variants, which all three readers understand without loss: version
//! 1.0, little endian, inline base64, no compression. The same frame always gives the same bytes.
//!
//! ```
//! use mmsmith_vtk::{Array, Frame, Series, Values};
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let mut series = Series::create(folder, "ring")?;
//! series.write(&Frame {
//!     time: 0.25,
//!     step: 10,
//!     velocity_time: None,
//!     provenance: None,
//!     points: vec![[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]],
//!     arrays: vec![Array { name: "volume".into(), values: Values::Scalar(vec![0.1, 0.2]) }],
//! })?;
//! assert!(folder.join("ring-000000.vtu").exists());
//! assert_eq!(series.pvd(), folder.join("ring.pvd"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod decode;
mod encode;
mod error;
pub mod foreign;
mod frame;
mod series;
mod whole_file;

pub use decode::read;
pub use encode::to_bytes;
pub use error::Error;
pub use frame::{Array, Frame, Provenance, Values};
pub use series::Series;
