//! The stress of a law that a specification states, by dual numbers over its text.
//!
//! This is the solver's own way from the text of a law to its stress. It shares the reader of text with the derivation of exact
//! solutions, and nothing else: no symbolic algebra, no derivative.
//!
//! 1. `text` turns the text into operations on a `tape`, in which equal operations are one.
//! 2. The derivatives of an energy with respect to the quantities that it is stated in are dual numbers over the tape (forward
//!    mode; A. Griewank and A. Walther, "Evaluating Derivatives", 2nd ed. (2008), chapter 3).
//! 3. `stress` puts the first Piola-Kirchhoff stress together from them (J. Bonet and R. D. Wood, "Nonlinear Continuum Mechanics
//!    for Finite Element Analysis", 2nd ed. (2008), chapter 6).
//! 4. `program` runs the operations that the stress needs on blocks of deformations, in vector registers.
//!
//! Each number is known by its value at rest, where `F = I`, and by its deviation from there, computed without the difference.
//! Stresses of strains as small as 1e-14 thus have all their digits, though the terms of a law are as large as its moduli.
//!
//! ```
//! use mmsmith_stated_law::{Response, StatedLaw};
//!
//! let energy = "mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2";
//! let constants = [("lambda".to_owned(), 2.0), ("mu".to_owned(), 1.0)];
//! let law = StatedLaw::<f64>::new(2, &Response::Energy(energy.to_owned()), &constants).unwrap();
//!
//! // A simple shear of 1e-12 of eight particles.
//! let shear = 1e-12;
//! let F = [[[1.0; 8], [shear; 8]], [[0.0; 8], [1.0; 8]]];
//! let mut P = [[[0.0; 8]; 2]; 2];
//! law.first_piola_kirchhoff(&F, &mut P);
//! assert_eq!(P[0][1][0], shear);
//! ```

mod function;
mod memory;
mod moduli;
mod program;
mod slope;
mod stress;
mod tape;
mod text;

pub use memory::StatedMemory;
pub use mmsmith_vocabulary::{Internal, Response};
pub use moduli::ModuliAtRest;

use function::GAUSS;
use mmsmith_expr::ParseError;
use nalgebra::{RealField, SMatrix};
use program::{Given, Portion, Program, deformations};
use std::marker::PhantomData;
use std::sync::{Arc, OnceLock};
use stress::Kinematics;
use tape::{Tape, Value};
use thiserror::Error;

/// Deformations of a block in the usual calls: enough to make up for what each operation takes to look up, and few enough for
/// their numbers to stay in the cache nearest to the processor.
pub const LANES: usize = 64;

/// Why a text is no law.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum StatedLawError {
    /// Laws are of one, two or three dimensions.
    #[error("a law has 1, 2 or 3 dimensions, not {0}")]
    Dimension(usize),
    /// A stress has as many rows and columns as there are dimensions.
    #[error("a stress in {dimension} dimension(s) has {dimension} x {dimension} components")]
    Shape {
        /// The dimensions.
        dimension: usize,
    },
    /// The text is no expression.
    #[error(transparent)]
    Syntax(#[from] ParseError),
    /// A name is neither a constant nor a measure of the deformation.
    #[error("'{name}' is neither a constant nor a measure of the deformation; there are {known}")]
    UnknownName {
        /// The name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// A constant is called like a measure of the deformation.
    #[error("a constant cannot be called '{name}', which has a meaning of its own in laws")]
    TakenName {
        /// The name.
        name: String,
    },
    /// There is no such function.
    #[error("no function is called '{name}'")]
    UnknownFunction {
        /// The name.
        name: String,
    },
    /// A function has another number of arguments.
    #[error("{function} takes {expected} argument(s), not {found}")]
    Arguments {
        /// The name of the function.
        function: String,
        /// The number of arguments that it takes.
        expected: usize,
        /// The number of arguments in the text.
        found: usize,
    },
    /// A derivative is with respect to something else than a measure of the deformation.
    #[error("a law is differentiated by J, I1, I2 and components of F and C, not by '{part}'")]
    Variable {
        /// The part of the text.
        part: String,
    },
    /// A part that does not depend on the deformation is not a finite number.
    #[error("'{part}' is not a finite number")]
    NotFinite {
        /// The part of the text, or the name of the constant.
        part: String,
    },
}

/// A law that is stated as text, for a number type `T` of `f64` or `f32`.
#[derive(Clone, Debug)]
pub struct StatedLaw<T> {
    dimension: usize,
    programs: Programs,
    number: PhantomData<fn() -> T>,
}

/// Programs of a law, whatever the numbers are.
#[derive(Clone, Debug)]
struct Programs {
    stress: Program,
    energy: Option<Program>,
    /// The normal stress along the axes left out.
    across: Option<Program>,
    moduli: Option<ModuliAtRest>,
    /// The tape of the stress, for its derivatives, and these once they are asked for, by component of F.
    formulas: Arc<(Tape, Vec<Value>)>,
    slopes: OnceLock<Vec<Program>>,
}

impl Programs {
    fn new(
        dimension: usize,
        response: &Response,
        constants: &[(String, f64)],
    ) -> Result<Self, StatedLawError> {
        if !(1..=3).contains(&dimension) {
            return Err(StatedLawError::Dimension(dimension));
        }
        let mut tape = Tape::default();
        let mut kinematics = Kinematics::new(&mut tape, dimension);
        for (name, value) in constants {
            kinematics.names.add(name, *value)?;
        }
        let (stress, energy, across) = match response {
            Response::Energy(text) => {
                let energy = kinematics.names.read(&mut tape, text)?;
                let P = kinematics.stress(&mut tape, energy);
                let stress: Vec<Value> =
                    P[..dimension].iter().flat_map(|row| &row[..dimension]).copied().collect();
                // F is one along that axis.
                let across = (dimension < 3).then(|| Program::new(&tape, &[P[2][2]]));
                (stress, Some(Program::new(&tape, &[energy])), across)
            }
            Response::Stress(rows) => {
                let is_square = rows.len() == dimension;
                if !is_square || rows.iter().any(|row| row.len() != dimension) {
                    return Err(StatedLawError::Shape { dimension });
                }
                let texts = rows.iter().flatten();
                let stress = texts.map(|text| kinematics.names.read(&mut tape, text));
                (stress.collect::<Result<_, _>>()?, None, None)
            }
        };
        let formulas = Arc::new((tape.clone(), stress.clone()));
        let stress = Program::new(&tape, &stress);
        let moduli = match dimension {
            1 => ModuliAtRest::of::<1>(&stress, across.as_ref()),
            2 => ModuliAtRest::of::<2>(&stress, across.as_ref()),
            _ => ModuliAtRest::of::<3>(&stress, across.as_ref()),
        };
        Ok(Self { stress, energy, across, moduli, formulas, slopes: OnceLock::new() })
    }

    /// The derivatives of the stress with respect to the components of F, row by row.
    fn slopes(&self, dimension: usize) -> &[Program] {
        self.slopes.get_or_init(|| {
            let (mut tape, stress) = (*self.formulas).clone();
            let components = (0..dimension * dimension).map(|m| (m / dimension, m % dimension));
            let of = |(row, column)| {
                let slopes = tape.slopes(&stress, row, column);
                Program::new(&tape, &slopes)
            };
            components.map(of).collect()
        })
    }
}

impl<T: RealField + Copy> StatedLaw<T> {
    /// The law of `response` in a dimension, with the values of its constants.
    ///
    /// # Errors
    ///
    /// [`StatedLawError`] where a text is no law.
    pub fn new(
        dimension: usize,
        response: &Response,
        constants: &[(String, f64)],
    ) -> Result<Self, StatedLawError> {
        let programs = Programs::new(dimension, response, constants)?;
        Ok(Self { dimension, programs, number: PhantomData })
    }

    /// The number of dimensions.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// First Piola-Kirchhoff stresses of particles side by side: `F[i][J][n]` is `F_iJ` of particle `n`, and so it is with the
    /// stresses `P`, which are not numbers where F is no deformation: `J <= 0`, or an entry that is not finite.
    ///
    /// The stress of a particle has the same bits in every place and in registers of every width. [`LANES`] is a good
    /// number of particles.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law.
    pub fn first_piola_kirchhoff<const D: usize, const N: usize>(
        &self,
        F: &[[[T; N]; D]; D],
        P: &mut [[[T; N]; D]; D],
    ) {
        self.assert_dimension(D);
        let results = P.iter_mut().flatten();
        self.programs.stress.run(Given::Deformation(F), Portion::Whole, results);
    }

    /// Derivatives of the stresses with respect to one component of F, row and column, by dual numbers over the text: in the form of
    /// [`first_piola_kirchhoff`](Self::first_piola_kirchhoff), and not numbers where F is no deformation.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law, and for a component beyond.
    pub fn slope<const D: usize, const N: usize>(
        &self,
        F: &[[[T; N]; D]; D],
        component: [usize; 2],
        A: &mut [[[T; N]; D]; D],
    ) {
        self.assert_dimension(D);
        let [row, column] = component;
        let program = &self.programs.slopes(D)[row * D + column];
        program.run(Given::Deformation(F), Portion::Whole, A.iter_mut().flatten());
    }

    /// The strain energy per reference volume above that at rest, a stress; `None` for a law that states its stress, and where F
    /// is no deformation.
    ///
    /// Next to rest it is the work that the stress does on the way there, so that small strains keep their digits. Of a
    /// law without a finite energy at rest it is the energy itself.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law.
    #[must_use]
    pub fn strain_energy<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        /// Up to here the rule of Gauss leaves less than rounding, unless a law changes within a hundredth of this.
        const SMALL: f64 = 1e-3;
        self.assert_dimension(D);
        let energy = self.programs.energy.as_ref()?;
        let F = F.map(nalgebra::convert_unchecked::<T, f64>);
        let direct = single(energy, &F, Portion::Deviation)?;
        let H = F - SMatrix::identity();
        let mut work = f64::NAN;
        if H.iter().all(|h| h.abs() <= SMALL) {
            let on_the_way: [[[f64; GAUSS.len()]; D]; D] =
                matrix(|i, j| GAUSS.map(|[at, _]| at * H[(i, j)]));
            let mut P = on_the_way;
            let results = P.iter_mut().flatten();
            self.programs.stress.run(Given::Displacement(&on_the_way), Portion::Whole, results);
            work = 0.0;
            for (n, [_, weight]) in GAUSS.iter().enumerate() {
                for i in 0..D {
                    for j in 0..D {
                        work += weight * P[i][j][n] * H[(i, j)];
                    }
                }
            }
        }
        Some(nalgebra::convert(if work.is_finite() { work } else { direct }))
    }

    /// The normal Kirchhoff stress along the axes that F leaves out, where the stretch is one,
    /// `J W_J + 2 W_I1 + 2 W_I2 (I1 - 1)`; components of F and C in a law have no part in it. `None` in three dimensions, for a law
    /// that states its stress, which does not say, and where F is no deformation.
    ///
    /// # Panics
    ///
    /// Panics where `D` is not the [dimension](Self::dimension) of the law.
    #[must_use]
    pub fn kirchhoff_across<const D: usize>(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        self.assert_dimension(D);
        let F = F.map(nalgebra::convert_unchecked::<T, f64>);
        single(self.programs.across.as_ref()?, &F, Portion::Whole).map(nalgebra::convert)
    }

    /// The moduli of small strains; `None` where the stress has no derivative at rest.
    #[must_use]
    pub fn moduli_at_rest(&self) -> Option<&ModuliAtRest> {
        self.programs.moduli.as_ref()
    }

    fn assert_dimension(&self, D: usize) {
        assert_eq!(D, self.dimension, "a law in {} dimension(s)", self.dimension);
    }
}

/// The numbers of laws in `D` dimensions, `f64` and `f32`: what a solver asks of a law, compiled with this crate.
pub trait Compiled<const D: usize>: RealField + Copy {
    /// [`StatedLaw::first_piola_kirchhoff`] of as many particles as a block has.
    fn stress_of_block(
        law: &StatedLaw<Self>,
        F: &[[[Self; LANES]; D]; D],
        P: &mut [[[Self; LANES]; D]; D],
    );

    /// [`StatedLaw::slope`] of as many particles as a block has.
    fn slope_of_block(
        law: &StatedLaw<Self>,
        F: &[[[Self; LANES]; D]; D],
        component: [usize; 2],
        A: &mut [[[Self; LANES]; D]; D],
    );

    /// [`StatedLaw::strain_energy`].
    fn energy(law: &StatedLaw<Self>, F: &SMatrix<Self, D, D>) -> Option<Self>;

    /// [`StatedLaw::kirchhoff_across`].
    fn across(law: &StatedLaw<Self>, F: &SMatrix<Self, D, D>) -> Option<Self>;

    /// [`StatedMemory::first_piola_kirchhoff`] of as many particles as a block has.
    fn stress_with_memory(
        law: &StatedMemory<Self>,
        F: &[[[Self; LANES]; D]; D],
        q: &[[Self; LANES]],
        P: &mut [[[Self; LANES]; D]; D],
    );

    /// [`StatedMemory::evolve`] of as many particles as a block has.
    fn evolve(
        law: &StatedMemory<Self>,
        start: &[[[Self; LANES]; D]; D],
        end: &[[[Self; LANES]; D]; D],
        time: Self,
        q: &mut [[Self; LANES]],
    );
}

macro_rules! compiled {
    ($($T:ty: $($D:literal)*;)*) => {
        $($(impl Compiled<$D> for $T {
            fn stress_of_block(
                law: &StatedLaw<Self>,
                F: &[[[Self; LANES]; $D]; $D],
                P: &mut [[[Self; LANES]; $D]; $D],
            ) {
                law.first_piola_kirchhoff(F, P);
            }

            fn slope_of_block(
                law: &StatedLaw<Self>,
                F: &[[[Self; LANES]; $D]; $D],
                component: [usize; 2],
                A: &mut [[[Self; LANES]; $D]; $D],
            ) {
                law.slope(F, component, A);
            }

            fn energy(law: &StatedLaw<Self>, F: &SMatrix<Self, $D, $D>) -> Option<Self> {
                law.strain_energy(F)
            }

            fn across(law: &StatedLaw<Self>, F: &SMatrix<Self, $D, $D>) -> Option<Self> {
                law.kirchhoff_across(F)
            }

            fn stress_with_memory(
                law: &StatedMemory<Self>,
                F: &[[[Self; LANES]; $D]; $D],
                q: &[[Self; LANES]],
                P: &mut [[[Self; LANES]; $D]; $D],
            ) {
                law.first_piola_kirchhoff(F, q, P);
            }

            fn evolve(
                law: &StatedMemory<Self>,
                start: &[[[Self; LANES]; $D]; $D],
                end: &[[[Self; LANES]; $D]; $D],
                time: Self,
                q: &mut [[Self; LANES]],
            ) {
                law.evolve(start, end, time, q);
            }
        })*)*
    };
}

compiled! {
    f64: 1 2 3;
    f32: 1 2 3;
}

/// The one result of a program; `None` where F is no deformation.
fn single<const D: usize>(program: &Program, F: &SMatrix<f64, D, D>, part: Portion) -> Option<f64> {
    let F: [[[f64; 1]; D]; D] = matrix(|i, j| [F[(i, j)]]);
    let mut is_deformation = [true];
    deformations(&F, &mut is_deformation);
    let mut result = [f64::NAN];
    program.run(Given::Deformation(&F), part, std::iter::once(&mut result));
    is_deformation[0].then_some(result[0])
}

fn matrix<V, const D: usize>(mut entry: impl FnMut(usize, usize) -> V) -> [[V; D]; D] {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}
