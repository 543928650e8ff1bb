//! Masses and densities of a recording beside those of the solution, where no deformation gradient is needed.

use mmsmith_runtime::{Domain, Solution};
use mmsmith_vtk::foreign::Snapshot;

use super::data::FrameData;
use super::error::ScoreError;
use super::findings::Remarks;

/// The names of masses of particles.
const MASSES: [&str; 5] = ["mass", "masses", "particle_mass", "mp_mass", "m"];
/// By which share density times J may differ from the density at rest: files have few digits.
const DENSITY: f64 = 1e-4;
/// By which share the whole mass may differ: bodies are cut into particles.
const MASS: f64 = 0.02;

/// Sums over what was recorded.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Balance {
    places: f64,
    /// Sums of density times J over the density at rest, and of the square of this ratio.
    ratio: f64,
    squared: f64,
    mass: Option<f64>,
}

impl Balance {
    /// The masses of the first frame.
    pub(super) fn add_masses<const D: usize>(
        &mut self,
        first: &Snapshot,
        data: &FrameData<D>,
        is_of_cells: bool,
    ) -> Result<(), ScoreError> {
        let is_mass = |name: &str| MASSES.iter().any(|mass| mass.eq_ignore_ascii_case(name));
        let heads = first.arrays().iter().filter(|head| head.components == 1);
        let Some(head) = heads.into_iter().find(|head| is_mass(&head.name)) else { return Ok(()) };
        let masses = first.floats(&head.name)?.unwrap_or_default();
        if masses.len() == data.X.len() && !is_of_cells {
            self.mass = Some(masses.iter().sum());
        }
        Ok(())
    }

    pub(super) fn add<const D: usize>(
        &mut self,
        exact: &dyn Solution<f64, D>,
        data: &FrameData<D>,
    ) {
        // Where F is recorded, each of them is held against it.
        let ([Some(J), Some(density)], None) = (&data.scalars, &data.tensors[0]) else { return };
        for ((J, density), X) in J.iter().zip(density).zip(&data.X) {
            let ratio = J * density / exact.density_at(X);
            self.places += 1.0;
            self.ratio += ratio;
            self.squared += ratio * ratio;
        }
    }

    pub(super) fn tell<const D: usize>(&self, exact: &dyn Solution<f64, D>, remarks: &mut Remarks) {
        let rho0 = exact.density();
        let mean = self.ratio / self.places;
        let spread = (self.squared / self.places - mean * mean).max(0.0).sqrt();
        if (mean - 1.0).abs() > DENSITY || spread > DENSITY {
            let what = if spread <= DENSITY * mean.abs() {
                format!(
                    "density times J is {:.6e} at all particles, and the density at rest is {rho0:?}: is another density meant, or \
                     another unit?",
                    mean * rho0
                )
            } else {
                format!(
                    "density times J, which is the density at rest, {rho0:?}, is not the same at all particles: {:.4e} on average, \
                     with a deviation of {:.1e}",
                    mean * rho0,
                    spread * rho0
                )
            };
            remarks.note("density-and-j", false, what);
        }
        let Some((mass, Domain::Box { lower, upper })) = self.mass.zip(Some(exact.domain())) else {
            return;
        };
        let expected = rho0 * (upper - lower).iter().product::<f64>();
        if (mass / expected - 1.0).abs() > MASS {
            let what = format!(
                "the masses of the particles add up to {mass:.4e}, and the density at rest times the volume of the body is \
                 {expected:.4e} ({:.4} times as much): other density, unit, thickness or volume of a particle?",
                mass / expected
            );
            remarks.note("other-mass", false, what);
        }
    }
}
