//! Laws that specifications state, as the solver runs them.

use mmsmith_mpm::{BLOCK, ConstitutiveLaw, Law};
use mmsmith_runtime::{Components, Real, Stated};
use mmsmith_stated_law::{Compiled, StatedLaw};
use nalgebra::SMatrix;

use crate::error::SceneError;

/// The law that a specification states.
///
/// # Errors
///
/// Where it is stated along directions that turn from place to place, or is no law.
pub(crate) fn read<T: Real + Compiled<D>, const D: usize>(
    stated: Stated<T>,
) -> Result<Law<T, D>, SceneError> {
    let Stated { response, components, constants } = stated;
    if components == Components::Curvilinear {
        return Err(SceneError::CurvilinearComponents);
    }
    let constants: Vec<(String, f64)> =
        constants.into_iter().map(|(name, value)| (name, value.to_f64())).collect();
    Ok(Law::from_constitutive(OfText(StatedLaw::new(D, &response, &constants)?)))
}

#[derive(Debug)]
struct OfText<T>(StatedLaw<T>);

impl<T: Real + Compiled<D>, const D: usize> ConstitutiveLaw<T, D> for OfText<T> {
    fn first_piola_kirchhoff(&self, F: &[[[T; BLOCK]; D]; D], P: &mut [[[T; BLOCK]; D]; D]) {
        T::stress_of_block(&self.0, F, P);
    }

    fn strain_energy(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        T::energy(&self.0, F)
    }

    fn kirchhoff_across(&self, F: &SMatrix<T, D, D>) -> Option<T> {
        T::across(&self.0, F)
    }
}
