//! Laws that specifications state, as the solver runs them.

use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{BLOCK, ConstitutiveLaw, Increment, InternalVariable, Law, LawWithMemory};
use mmsmith_runtime::{Components, Real, Response, Stated};
use mmsmith_stated_law::{Compiled, StatedLaw, StatedMemory};
use nalgebra::{SMatrix, SVector};

use crate::error::SceneError;

/// The law that a specification states.
///
/// # Errors
///
/// Where it is stated along directions that turn from place to place, or is no law.
pub(crate) fn read<T: Real + Compiled<D>, const D: usize>(
    stated: Stated<T>,
) -> Result<Law<T, D>, SceneError> {
    let has_memory = stated.has_memory();
    let Stated { response, components, constants, given, internal, across } = stated;
    if components == Components::Curvilinear {
        return Err(SceneError::CurvilinearComponents);
    }
    let constants: Vec<(String, f64)> =
        constants.into_iter().map(|(name, value)| (name, value.to_f64())).collect();
    if has_memory {
        let law = StatedMemory::new(D, &response, &constants, &given, &internal)?;
        return Ok(Law::with_memory(OfTextWithMemory { law, planted: Planted::here() }));
    }
    let law = StatedLaw::new(D, &response, &constants)?;
    let stretch = match across {
        Some(across) => Some(StatedLaw::new(D, &Response::Energy(across.stretch), &constants)?),
        None => None,
    };
    Ok(Law::from_constitutive(OfText { law, stretch, planted: Planted::here() }))
}

#[derive(Debug)]
struct OfText<T> {
    law: StatedLaw<T>,
    /// The stretch across, where there is no stress there: a number in the place of an energy, above one as that is above rest.
    stretch: Option<StatedLaw<T>>,
    planted: Planted,
}

impl<T: Real + Compiled<D>, const D: usize> ConstitutiveLaw<T, D> for OfText<T> {
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]) {
        T::stress_of_block(&self.law, F, P);
        plant(self.planted, P);
    }

    fn slope(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        component: [usize; 2],
        A: &mut [[[T; BLOCK]; D]; D],
    ) -> bool {
        T::slope_of_block(&self.law, F, component, A);
        plant(self.planted, A);
        true
    }

    fn strain_energy(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        T::energy(&self.law, F)
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        match self.stretch {
            Some(_) => Some(T::zero()),
            None => T::across(&self.law, F),
        }
    }

    fn stretch_across(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        Some(T::one() + T::energy(self.stretch.as_ref()?, F)?)
    }
}

/// The faults of stresses that are planted here.
fn plant<T: Real, const D: usize>(planted: Planted, P: &mut [[[T; BLOCK]; D]; D]) {
    if planted.is(Fault::StatedFactor) {
        for i in 0..D {
            for j in (0..D).filter(|j| *j != i) {
                P[i][j].iter_mut().for_each(|shear| *shear *= T::nearest(0.5));
            }
        }
    }
    if planted.is(Fault::StatedSign) {
        P[0][0].iter_mut().for_each(|normal| *normal = -*normal);
    }
}

#[derive(Debug)]
struct OfTextWithMemory<T> {
    law: StatedMemory<T>,
    planted: Planted,
}

impl<T: Real + Compiled<D>, const D: usize> LawWithMemory<T, D> for OfTextWithMemory<T> {
    fn variables(&self) -> Vec<InternalVariable> {
        let at_rest = self.law.initial(&SVector::<T, D>::zeros());
        let of = |(name, at_rest): (&String, T)| InternalVariable {
            name: name.clone(),
            at_rest: at_rest.to_f64(),
        };
        self.law.columns().iter().zip(at_rest).map(of).collect()
    }

    fn initial(&self, X: &SVector<T, D>) -> Vec<T> {
        self.law.initial(X)
    }

    fn start_at_rate(&self, rate: &SMatrix<T, D, D>, q: &mut [T]) {
        self.law.start_at_rate(rate, q);
    }

    fn first_piola_kirchhoff(
        &self,
        F: &[[[T; BLOCK]; D]; D],
        q: &[[T; BLOCK]],
        P: &mut [[[T; BLOCK]; D]; D],
    ) {
        T::stress_with_memory(&self.law, F, q, P);
        plant(self.planted, P);
    }

    fn evolve(&self, increment: &Increment<'_, T, D>, q: &mut [[T; BLOCK]]) {
        let Increment { start, end, time } = *increment;
        T::evolve(&self.law, start, end, time, q);
    }
}
