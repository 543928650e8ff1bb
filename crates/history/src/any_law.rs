//! The laws of the vocabulary.

use mmsmith_vocabulary::{
    Flow as FlowRow, Law, Material, Memory, Smoothness, Stated, Volumetric, WithMemory,
};
use thiserror::Error;

use crate::flow::Flow;
use crate::law::{Branch, Kinematics, LawWithHistory, Residuals};
use crate::maxwell::{ElasticPart, Maxwell};
use crate::number::Number;
use crate::stated::{StatedHistory, StatedHistoryError};
use crate::tensor::Tensor;

/// Why a law has no history here.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum UnsupportedLaw {
    /// A law of the library without internal variables.
    #[error("the law '{name}' has no internal variables: its fields need no history")]
    NoMemory {
        /// The name of the law.
        name: &'static str,
    },
    /// Flow of another elastic law.
    #[error("flow is for the law 'hencky', not for '{name}': write law = \"hencky\"")]
    ElasticOfFlow {
        /// The name of the elastic law.
        name: &'static str,
    },
    /// Elements of another elastic law.
    #[error(
        "Maxwell elements are for the laws 'linear-elastic', 'yeoh', 'gent' and 'arruda-boyce', not for '{name}': write one of them, \
         such as law = \"yeoh\" with c1 = mu/2, c2 = 0 and kappa for a neo-Hookean body"
    )]
    ElasticOfElements {
        /// The name of the elastic law.
        name: &'static str,
    },
    /// There are one, two or three dimensions.
    #[error("a law has 1, 2 or 3 dimensions, not {0}")]
    Dimension(usize),
    /// A law of text.
    #[error(transparent)]
    Stated(#[from] StatedHistoryError),
}

/// Any law with a history.
#[derive(Clone, Debug)]
pub enum AnyLaw {
    /// Flow by von Mises.
    Flow(Flow),
    /// Maxwell elements.
    Maxwell(Maxwell),
    /// A law that a specification states.
    Stated(Box<StatedHistory>),
}

impl AnyLaw {
    /// A law of the vocabulary in a number of dimensions. What its constants are does not matter here, but for their number.
    ///
    /// # Errors
    ///
    /// [`UnsupportedLaw`].
    pub fn new<T: Clone>(law: &Law<T>, dimension: usize) -> Result<Self, UnsupportedLaw> {
        match law {
            Law::Library(material) => Err(UnsupportedLaw::NoMemory { name: material.row().name }),
            Law::WithMemory(law) => Self::with_memory(law, dimension),
            Law::Stated(law) => Self::stated(law, dimension),
        }
    }

    /// A law of the library with internal variables.
    ///
    /// # Errors
    ///
    /// [`UnsupportedLaw`].
    pub fn with_memory<T>(law: &WithMemory<T>, dimension: usize) -> Result<Self, UnsupportedLaw> {
        if !(1..=3).contains(&dimension) {
            return Err(UnsupportedLaw::Dimension(dimension));
        }
        let name = law.elastic.row().name;
        match &law.memory {
            Memory::Flow(FlowRow { overstress, is_on_yield, .. }) => match law.elastic {
                Material::Hencky { .. } => Ok(Self::Flow(Flow {
                    dimension,
                    has_overstress: overstress.is_some(),
                    is_on_yield: *is_on_yield,
                })),
                _ => Err(UnsupportedLaw::ElasticOfFlow { name }),
            },
            Memory::Maxwell(elements) => {
                let volumetric = law.elastic.volumetric().unwrap_or(Volumetric::Logarithmic);
                let elastic = match law.elastic {
                    Material::LinearElastic { .. } => ElasticPart::LinearElastic,
                    Material::Yeoh { .. } => ElasticPart::Yeoh(volumetric),
                    Material::Gent { .. } => ElasticPart::Gent(volumetric),
                    Material::ArrudaBoyce { .. } => ElasticPart::ArrudaBoyce(volumetric),
                    _ => return Err(UnsupportedLaw::ElasticOfElements { name }),
                };
                Ok(Self::Maxwell(Maxwell { dimension, elastic, elements: elements.len() }))
            }
        }
    }

    /// A law that a specification states.
    ///
    /// # Errors
    ///
    /// [`UnsupportedLaw`].
    pub fn stated<T>(law: &Stated<T>, dimension: usize) -> Result<Self, UnsupportedLaw> {
        if !(1..=3).contains(&dimension) {
            return Err(UnsupportedLaw::Dimension(dimension));
        }
        Ok(Self::Stated(Box::new(StatedHistory::new(law, dimension)?)))
    }
}

impl AnyLaw {
    /// Whether variables begin with other values along X than along Y.
    #[must_use]
    pub fn begins_along_axes(&self) -> bool {
        matches!(self, Self::Flow(flow) if flow.is_on_yield)
    }
}

/// Calls a function of whatever law there is.
macro_rules! each {
    ($own:expr, $law:ident => $call:expr) => {
        match $own {
            AnyLaw::Flow($law) => $call,
            AnyLaw::Maxwell($law) => $call,
            AnyLaw::Stated($law) => $call,
        }
    };
}

impl LawWithHistory for AnyLaw {
    fn constants(&self) -> Vec<String> {
        each!(self, law => law.constants())
    }

    fn constants_change(&self) -> bool {
        each!(self, law => law.constants_change())
    }

    fn variables(&self) -> Vec<String> {
        each!(self, law => law.variables())
    }

    fn groups(&self) -> Vec<usize> {
        each!(self, law => law.groups())
    }

    fn initial<N: Number>(&self, constants: &[N], frame: &Tensor<f64>) -> Vec<N> {
        each!(self, law => law.initial(constants, frame))
    }

    #[inline]
    fn rate<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
        branch: Branch,
        rates: &mut [N],
    ) {
        each!(self, law => law.rate(at, constants, z, branch, rates));
    }

    fn first_piola_kirchhoff<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N> {
        each!(self, law => law.first_piola_kirchhoff(at, constants, z))
    }

    fn has_branches(&self) -> bool {
        each!(self, law => law.has_branches())
    }

    fn first_branch(&self, at: &Kinematics<f64>, constants: &[f64], z: &[f64]) -> Branch {
        each!(self, law => law.first_branch(at, constants, z))
    }

    fn resolution(&self, constants: &[f64]) -> f64 {
        each!(self, law => law.resolution(constants))
    }

    fn excess(&self, at: &Kinematics<f64>, constants: &[f64], z: &[f64]) -> f64 {
        each!(self, law => law.excess(at, constants, z))
    }

    fn margin<N: Number>(&self, at: &Kinematics<N>, constants: &[N], z: &[N], branch: Branch) -> N {
        each!(self, law => law.margin(at, constants, z, branch))
    }

    fn halving_time(
        &self,
        at: &Kinematics<f64>,
        constants: &[f64],
        z: &[f64],
        rates: &[f64],
    ) -> f64 {
        each!(self, law => law.halving_time(at, constants, z, rates))
    }

    fn smoothness(&self, constants: &[f64], z: &[f64], begins: Branch) -> Smoothness {
        each!(self, law => law.smoothness(constants, z, begins))
    }

    fn residuals(
        &self,
        at: &Kinematics<f64>,
        constants: &[f64],
        z: &[f64],
        branch: Branch,
    ) -> Residuals {
        each!(self, law => law.residuals(at, constants, z, branch))
    }

    fn observable_names(&self) -> Vec<String> {
        each!(self, law => law.observable_names())
    }

    fn observables<N: Number>(&self, constants: &[N], z: &[N]) -> Vec<N> {
        each!(self, law => law.observables(constants, z))
    }
}
