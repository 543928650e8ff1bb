//! One instant of a particle simulation, and the checks that it can become a file.

use std::collections::{BTreeMap, HashSet};

use crate::Error;

/// The values of an [`Array`], one entry a particle, in the order of [`Frame::points`].
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// One number a particle.
    Scalar(Vec<f64>),
    /// Three Cartesian components a particle; a plane problem leaves the third at zero.
    Vector(Vec<[f64; 3]>),
    /// Nine components a particle, row by row: XX XY XZ YX YY YZ ZX ZY ZZ.
    Tensor(Vec<[f64; 9]>),
    /// One whole number a particle, such as the particle's identity.
    Id(Vec<u64>),
}

impl Values {
    /// The number of particles that have a value.
    pub fn len(&self) -> usize {
        match self {
            Self::Scalar(values) => values.len(),
            Self::Vector(values) => values.len(),
            Self::Tensor(values) => values.len(),
            Self::Id(values) => values.len(),
        }
    }

    /// Whether no particle has a value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The components of all particles one after the other, and the number of components of a particle; `None` for whole numbers.
    fn floats(&self) -> Option<(&[f64], usize)> {
        match self {
            Self::Scalar(values) => Some((values, 1)),
            Self::Vector(values) => Some((values.as_flattened(), 3)),
            Self::Tensor(values) => Some((values.as_flattened(), 9)),
            Self::Id(_) => None,
        }
    }
}

/// A named quantity over the particles. Units are the caller's; the file carries none.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Letters, digits and underscores, at least one; unique in its frame.
    pub name: String,
    /// One entry a particle.
    pub values: Values,
}

/// The manufactured solution whose forces moved the particles. `solution` in the file, as the bytes of its name, and
/// `parameter_A` for the parameter `A`: numbers alone, since meshio stops at files with texts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// Its name; letters, digits, underscores and hyphens.
    pub solution: String,
    /// Its parameters by name; letters, digits and underscores.
    pub parameters: BTreeMap<String, f64>,
}

/// One instant of a particle simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The simulated time, in the caller's unit of time; `TimeValue` in the file.
    pub time: f64,
    /// The number of steps taken so far; `Cycle` in the file.
    pub step: u64,
    /// The time to which the velocities belong, where it is known; `VelocityTime` in the file. Schemes that stagger
    /// positions and velocities hold them for different times.
    pub velocity_time: Option<f64>,
    /// The solution with which the frame is compared, if there is one.
    pub provenance: Option<Provenance>,
    /// The particles' positions, Cartesian; at least one.
    pub points: Vec<[f64; 3]>,
    /// The quantities over the particles, in the order in which the file holds them.
    pub arrays: Vec<Array>,
}

impl Frame {
    /// Whether the frame can become a file that every reader understands.
    ///
    /// # Errors
    ///
    /// Where there is no particle, or more than `u32::MAX`; where an array's length differs from the number of
    /// particles; where a name is repeated or holds anything but `[A-Za-z0-9_]`; where a time, a position or a value
    /// is infinite or not a number; where the step exceeds `i64::MAX`; and where the solution has a name of other characters, or
    /// a parameter that is infinite or not a number.
    pub fn check(&self) -> Result<(), Error> {
        let particles = self.points.len();
        if particles == 0 {
            return Err(Error::NoParticles);
        }
        if u32::try_from(particles).is_err() {
            return Err(Error::TooManyParticles { particles });
        }
        for time in [Some(self.time), self.velocity_time].into_iter().flatten() {
            if !time.is_finite() {
                return Err(Error::Time { time });
            }
        }
        self.cycle()?;
        if let Some(provenance) = &self.provenance {
            provenance.check()?;
        }
        check_finite("points", self.points.as_flattened(), 3)?;

        let mut names = HashSet::new();
        for Array { name, values } in &self.arrays {
            if !is_name(name) {
                return Err(Error::ArrayName { name: name.clone() });
            }
            if !names.insert(name) {
                return Err(Error::RepeatedName { name: name.clone() });
            }
            if values.len() != particles {
                return Err(Error::Length { array: name.clone(), found: values.len(), particles });
            }
            if let Some((floats, components)) = values.floats() {
                check_finite(name, floats, components)?;
            }
        }
        Ok(())
    }

    /// The step as the signed number that VTK's `Cycle` is.
    pub(crate) fn cycle(&self) -> Result<i64, Error> {
        i64::try_from(self.step).map_err(|_| Error::Step { step: self.step })
    }
}

impl Provenance {
    fn check(&self) -> Result<(), Error> {
        if !is_name(&self.solution.replace('-', "_")) {
            return Err(Error::SolutionName { name: self.solution.clone() });
        }
        for (name, value) in &self.parameters {
            if !is_name(name) {
                return Err(Error::ArrayName { name: name.clone() });
            }
            if !value.is_finite() {
                return Err(Error::Parameter { name: name.clone(), value: *value });
            }
        }
        Ok(())
    }
}

/// Whether every reader keeps an array of this name.
fn is_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

fn check_finite(array: &str, floats: &[f64], components: usize) -> Result<(), Error> {
    match floats.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::NotFinite {
            array: array.to_owned(),
            particle: at / components,
            component: at % components,
            value: floats[at],
        }),
    }
}
