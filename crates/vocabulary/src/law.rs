//! A law of the library, or one that a specification states.

use crate::Material;

/// The law of a solution with its constants, as a solver needs it.
#[derive(Clone, Debug, PartialEq)]
pub enum Law<T> {
    /// A law of the library.
    Library(Material<T>),
    /// A law that the specification states.
    Stated(Stated<T>),
}

/// A law that a specification states.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated<T> {
    /// The energy or the stress, as text.
    pub response: Response,
    /// The directions that indices in the text refer to.
    pub components: Components,
    /// The parameters that the text may use, by name.
    pub constants: Vec<(String, T)>,
}

/// Directions of components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Components {
    /// Cartesian axes, or there are no components.
    Cartesian,
    /// The unit vectors of curvilinear coordinates, which turn from place to place.
    Curvilinear,
}

/// The response of a material to its deformation, as text in `F11`, `C11`, ..., `J`, `I1`, `I2` and parameters. `I1` and `I2`
/// are invariants of the three-dimensional `C`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Response {
    /// The strain energy `W` per reference volume; `P = dW/dF`.
    Energy(String),
    /// The first Piola-Kirchhoff stress, row by row.
    Stress(Vec<Vec<String>>),
}

impl<T> Law<T> {
    /// This law with `change` applied to each constant.
    #[must_use]
    pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> Law<U> {
        match self {
            Self::Library(material) => Law::Library(material.map(change)),
            Self::Stated(Stated { response, components, constants }) => {
                let constants =
                    constants.into_iter().map(|(name, value)| (name, change(value))).collect();
                Law::Stated(Stated { response, components, constants })
            }
        }
    }
}
