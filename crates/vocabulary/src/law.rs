//! A law of the library, or one that a specification states.

use crate::Material;

/// The law of a solution with its constants, as a solver needs it.
#[derive(Clone, Debug, PartialEq)]
pub enum Law<T> {
    /// A law of the library.
    Library(Material<T>),
    /// A law that the specification states.
    Stated(Stated<T>),
    /// A law of the library with internal variables.
    WithMemory(WithMemory<T>),
}

/// An elastic law of the library, and what its stress depends on besides the deformation.
#[derive(Clone, Debug, PartialEq)]
pub struct WithMemory<T> {
    /// The elastic part.
    pub elastic: Material<T>,
    /// The internal variables and their rates.
    pub memory: Memory<T>,
}

/// The memory of a law of the library.
#[derive(Clone, Debug, PartialEq)]
pub enum Memory<T> {
    /// Flow by von Mises, for Hencky's elastic law: multiplicative split, `tau` by the elastic part of the deformation.
    Flow(Flow<T>),
    /// Maxwell elements beside each other, for isochoric laws of the library and for linear elasticity:
    /// `S = S_vol + (1 - sum g_i) S_iso + sum Q_i`, `Q_i' + Q_i/tau_i = g_i d/dt S_iso`; in linear elasticity the same of the deviator of
    /// the stress.
    ///
    /// Source: J. C. Simo, CMAME 60 (1987) 153-173.
    Maxwell(Vec<Element<T>>),
}

/// Flow by von Mises: the yield stress is `yield_stress + modulus alpha^exponent` at the equivalent plastic strain `alpha`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow<T> {
    /// The yield stress of the virgin material, as in a tension test; zero for creep laws.
    pub yield_stress: T,
    /// The modulus of the hardening, a stress.
    pub modulus: T,
    /// The exponent of the hardening, above zero and at most 1: linear hardening.
    pub exponent: T,
    /// Where flow depends on its rate.
    pub overstress: Option<Overstress<T>>,
    /// Whether the body is on the yield surface at the start, by an elastic stretch along the first axis that keeps the volume: along
    /// the second axis the body shortens as much in two dimensions and in space, along both others half as much in one.
    pub is_on_yield: bool,
}

/// The rate of flow beyond the yield stress: `gamma' = <f/drag>^exponent / time`, with `f = |s| - sqrt(2/3) k(alpha)`.
///
/// Source: P. Perzyna, Adv. Appl. Mech. 9 (1966) 243-377.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overstress<T> {
    /// The stress that the overstress is measured in.
    pub drag: T,
    /// The exponent, at least 1.
    pub exponent: T,
    /// The time of the flow.
    pub time: T,
}

/// A Maxwell element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element<T> {
    /// Its share of the instantaneous stiffness against changes of shape.
    pub share: T,
    /// Its relaxation time.
    pub time: T,
}

impl<T> Flow<T> {
    /// This flow with `change` applied to each constant.
    #[must_use]
    pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> Flow<U> {
        Flow {
            yield_stress: change(self.yield_stress),
            modulus: change(self.modulus),
            exponent: change(self.exponent),
            overstress: self.overstress.map(|overstress| overstress.map(change)),
            is_on_yield: self.is_on_yield,
        }
    }
}

impl<T> Overstress<T> {
    /// This overstress with `change` applied to each constant.
    #[must_use]
    pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> Overstress<U> {
        Overstress {
            drag: change(self.drag),
            exponent: change(self.exponent),
            time: change(self.time),
        }
    }
}

impl<T> WithMemory<T> {
    /// This law with `change` applied to each constant.
    #[must_use]
    pub fn map<U>(self, mut change: impl FnMut(T) -> U) -> WithMemory<U> {
        let elastic = self.elastic.map(&mut change);
        let memory = match self.memory {
            Memory::Flow(flow) => Memory::Flow(flow.map(&mut change)),
            Memory::Maxwell(elements) => Memory::Maxwell(
                elements
                    .into_iter()
                    .map(|Element { share, time }| Element {
                        share: change(share),
                        time: change(time),
                    })
                    .collect(),
            ),
        };
        WithMemory { elastic, memory }
    }
}

impl<T: Copy> WithMemory<T> {
    /// All constants by their names: those of the elastic part, then those of the flow or of the elements, in the order of their
    /// fields.
    #[must_use]
    pub fn named_values(&self) -> Vec<(String, T)> {
        let elastic = self.elastic.row().constants.iter().map(|constant| constant.name.to_owned());
        let mut all: Vec<(String, T)> = elastic.zip(self.elastic.values()).collect();
        let mut add = |name: &str, value: T| all.push((name.to_owned(), value));
        match &self.memory {
            Memory::Flow(flow) => {
                add("yield-stress", flow.yield_stress);
                add("modulus", flow.modulus);
                add("exponent", flow.exponent);
                if let Some(Overstress { drag, exponent, time }) = flow.overstress {
                    add("drag", drag);
                    add("rate-exponent", exponent);
                    add("time", time);
                }
            }
            Memory::Maxwell(elements) => {
                for (k, Element { share, time }) in elements.iter().enumerate() {
                    add(&format!("share{}", k + 1), *share);
                    add(&format!("time{}", k + 1), *time);
                }
            }
        }
        all
    }
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
    /// Fields of position and time that the text may use, by name: each as text in the Cartesian coordinates `X`, `Y`, `Z`, the time `t`,
    /// the parameters and the fields before it.
    pub given: Vec<(String, String)>,
    /// Internal variables that the text may use.
    pub internal: Vec<Internal>,
    /// The stretch along the directions that the dimension leaves out; nothing stretches along them where this is none.
    pub across: Option<Across>,
}

/// No stress along the directions that the dimension leaves out: plane stress in two dimensions, uniaxial stress in one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Across {
    /// The stretch along these directions, as text in what the response may use.
    pub stretch: String,
    /// The strain energy per reference volume of the law in space, as text in the same constants and the measures of a deformation in
    /// space without shear across.
    pub in_space: String,
}

/// An internal variable of a law that a specification states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Internal {
    /// Its name.
    pub name: String,
    /// Its rate, as text in what the response may use: measures of the deformation and of its rate, internal variables, given fields,
    /// parameters.
    pub rate: String,
    /// Its value at time zero, as text in the coordinates, the parameters and the given fields.
    pub initial: String,
}

impl<T> Stated<T> {
    /// Whether the stress depends on more than the deformation gradient: on rates, position, time, or internal variables.
    #[must_use]
    pub fn has_memory(&self) -> bool {
        let texts: Vec<&str> = match &self.response {
            Response::Energy(text) => vec![text],
            Response::Stress(rows) => rows.iter().flatten().map(String::as_str).collect(),
        };
        let is_more = |word: &str| {
            word.starts_with("Fdot")
                || matches!(word, "Jdot" | "X" | "Y" | "Z" | "t")
                || is_component_of_rate(word)
        };
        let uses_more = texts.iter().any(|text| words(text).any(is_more));
        uses_more || !self.given.is_empty() || !self.internal.is_empty()
    }
}

/// Whether a word is `d11`, `d12`, ..., a component of the rate of deformation.
fn is_component_of_rate(word: &str) -> bool {
    let indices = word.strip_prefix('d').unwrap_or_default().as_bytes();
    indices.len() == 2 && indices.iter().all(|index| (b'1'..=b'3').contains(index))
}

/// The words of a text.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|word| !word.is_empty())
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
/// are invariants of the three-dimensional `C`. A stress may also use the rates `Fdot11`, ..., `Jdot`, and `d11`, ..., the components of
/// the rate of deformation in space.
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
            Self::Stated(Stated { response, components, constants, given, internal, across }) => {
                let constants =
                    constants.into_iter().map(|(name, value)| (name, change(value))).collect();
                Law::Stated(Stated { response, components, constants, given, internal, across })
            }
            Self::WithMemory(law) => Law::WithMemory(law.map(change)),
        }
    }
}

/// How smooth the body force is where particles begin to flow, or stop, from worst to best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Smoothness {
    /// It jumps.
    Jump,
    /// It is continuous and its slopes are not.
    Kink,
    /// Its slopes are continuous.
    Smooth,
}
