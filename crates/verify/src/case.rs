//! The settings of one simulation.

use mmsmith_laws::{HalfPlane, ReturnMap, Stressed, Volume, with_memory, with_projected_volume};
use mmsmith_mpm::fault::{Fault, Planted};
use mmsmith_mpm::{EVERY_SCHEME, Integrator, Law, Material, SetupError, Shape};
use mmsmith_runtime::{Real, Solution};
use mmsmith_stated_law::Compiled;

use crate::error::{CaseError, SceneError};
use crate::named::{Named, named};
use crate::precision::Precision;
use crate::scheme::{Placement, Scheme, Start, Updated};
use crate::stated_law;

/// The settings of one simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// How particles and grid exchange, and how the run goes on in time.
    pub scheme: Scheme,
    /// Number of cells along the solution's cell length.
    pub cells: usize,
    /// Particles in a cell along each direction.
    pub per_cell: usize,
    /// `dt c/h` asked for; the step is then shortened so that whole steps end at the end time.
    pub cfl: f64,
    /// The speed `c` that `cfl` refers to.
    pub cfl_speed: CflSpeed,
    /// The end time in periods of the solution.
    pub periods: f64,
    /// How much of an annulus is modelled; `None` chooses the quarter where symmetry allows it.
    pub extent: Option<Extent>,
    /// How a step of a law with plastic or viscous flow finds its direction; none for other laws, and for the usual one.
    pub return_map: Option<ReturnMap>,
    /// How the change of volume enters the stress.
    pub volume: Volume,
}

impl Default for Case {
    /// The settings of the original study that gave the best accuracy, on 32 cells.
    fn default() -> Self {
        Self {
            scheme: Scheme::Updated(Updated::default()),
            cells: 32,
            per_cell: 2,
            cfl: 0.4,
            cfl_speed: CflSpeed::Bar,
            periods: 1.0,
            extent: None,
            return_map: None,
            volume: Volume::Pointwise,
        }
    }
}

/// The speed that CFL numbers refer to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CflSpeed {
    /// The solution's own, of waves in a bar unless its specification says otherwise.
    #[default]
    Bar,
    /// P-waves in the undeformed solid, `sqrt((lambda + 2 mu)/rho0)`.
    PWave,
    /// P-waves with the viscosity of the law on the cells of a grid, see `on_grid`.
    Viscous,
}

named! {
    CflSpeed {
        Bar = "bar":
            "Speed of waves in a bar, sqrt(E/rho0), unless the specification states a wave speed";
        PWave = "p-wave":
            "Speed of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0)";
        Viscous = "viscous":
            "Speed of P-waves made larger by the viscosity of the law on narrow cells: v + sqrt(c^2 + v^2), where v = 2 eta/(rho0 h)";
    }
    ReturnMap {
        Exponential = "exponential": "The direction of flow at the end of a step: first order in time";
        Midpoint = "midpoint": "The direction of flow at the middle of a step: second order in time";
    }
    Volume {
        Pointwise = "pointwise": "The stress of a particle follows from its own change of volume";
        Projected = "projected":
            "The change of volume and the mean stress are projected onto fewer functions, as F-bar methods do: against locking next to \
             incompressibility";
    }
    Extent {
        Quarter = "quarter":
            "The part between the planes of symmetry: a quarter of a ring, an eighth of a shell";
        Full = "full": "All of it";
    }
}

/// A positive number rounded down to two digits.
pub(crate) fn two_digits(value: f64) -> f64 {
    if !value.is_normal() {
        return value;
    }
    let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
    // What is less than a whole number by rounding alone stays.
    let rounded = (value / unit + 1e-9).floor();
    // A quotient prints shorter than a product where the unit has no exact form.
    if unit < 1.0 { rounded / (1.0 / unit).round() } else { rounded * unit }
}

/// How much of an annulus or a spherical shell is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// The part of positive coordinates, between the declared planes of symmetry: a quarter of the plane, an eighth of
    /// space.
    Quarter,
    /// All of it, without planes of symmetry.
    Full,
}

/// The precision in which the solver computes; errors are always measured in double precision.
#[derive(Clone, Copy)]
pub enum Arithmetic<'a> {
    /// `f64`.
    Double,
    /// `f32`, with the solution built in that precision for the body force.
    Single(&'a InSinglePrecision),
}

/// A solution in single precision.
#[cfg(feature = "single-precision")]
pub type InSinglePrecision = mmsmith_runtime::AnySolution<f32>;

/// Nothing: the crate is compiled without the feature `single-precision`.
#[cfg(not(feature = "single-precision"))]
pub type InSinglePrecision = std::convert::Infallible;

impl Case {
    /// Checks the settings that need no solution to be judged.
    ///
    /// # Errors
    ///
    /// [`CaseError::Setting`] for a count of zero, or a number that is not positive and finite.
    pub fn validate(&self) -> Result<(), CaseError> {
        for (setting, value) in [("cells", self.cells), ("ppc", self.per_cell)] {
            if value == 0 {
                return Err(CaseError::setting(setting, value, "at least 1"));
            }
        }
        for (setting, value) in [("cfl", self.cfl), ("periods", self.periods)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(CaseError::setting(setting, number(value), "a positive number"));
            }
        }
        match self.scheme {
            Scheme::Updated(updated) if !EVERY_SCHEME && updated != Updated::default() => {
                Err(SetupError::UsualSchemeOnly.into())
            }
            Scheme::Updated(Updated { integrator, start, .. })
                if integrator != Integrator::Cd && start != Start::Halved =>
            {
                let instead =
                    "left out, or the integrator cd, which alone has a first velocity to choose";
                Err(CaseError::setting("start", start.name(), instead))
            }
            Scheme::Updated(Updated {
                placement: Placement::Lattice { offset } | Placement::Clipped { offset, .. },
                ..
            }) if !(-0.5..=0.5).contains(&offset) => {
                Err(CaseError::setting("offset", number(offset), "from -0.5 to 0.5"))
            }
            Scheme::Updated(Updated { placement: Placement::Clipped { pose, .. }, .. })
                if !(-360.0..=360.0).contains(&pose.angle) =>
            {
                Err(CaseError::setting("grid-angle", number(pose.angle), "from -360 to 360"))
            }
            Scheme::Updated(Updated { placement: Placement::Clipped { pose, .. }, .. })
                if !(-1.0..=1.0).contains(&pose.shift) =>
            {
                Err(CaseError::setting("grid-shift", number(pose.shift), "from -1 to 1"))
            }
            Scheme::Updated(Updated {
                shape,
                placement: clipped @ Placement::Clipped { .. },
                ..
            }) if !matches!(shape, Shape::Cpdi2 | Shape::Bspline2 | Shape::Bspline3) => {
                let instead = "lattice with this shape, or the shape cpdi2, bspline2 or bspline3";
                Err(CaseError::setting("layout", clipped.name(), instead))
            }
            Scheme::Updated(Updated {
                shape: Shape::Ugimp | Shape::Gimp | Shape::GimpBspline2,
                placement: fitted @ Placement::BodyFitted,
                ..
            }) => Err(CaseError::setting(
                "layout",
                fitted.name(),
                "lattice with gimp, ugimp and gimp-bspline2, whose boxes lie along the axes, or the shape cpdi2, cpdi, linear, \
                 bspline2 or bspline3",
            )),
            Scheme::Updated(_) | Scheme::Total(_) => Ok(()),
        }
    }
}

/// The solver's own law for a solution's, with the usual return map.
pub(crate) fn law<T: Real + Compiled<D> + Stressed<D> + Stressed<3>, const D: usize>(
    law: mmsmith_runtime::Law<T>,
) -> Result<Law<T, D>, SceneError> {
    law_by(law, ReturnMap::default())
}

/// The solver's own law for the body of a solution.
pub(crate) fn law_of_body<T: Precision<D>, const D: usize>(
    solution: &dyn Solution<T, D>,
) -> Result<Law<T, D>, SceneError> {
    law_of_body_by(solution, ReturnMap::default())
}

/// As [`law_of_body`], with a return map.
fn law_of_body_by<T: Precision<D>, const D: usize>(
    solution: &dyn Solution<T, D>,
    map: ReturnMap,
) -> Result<Law<T, D>, SceneError> {
    if !solution.is_half_plane() {
        return law_by(solution.law(), map);
    }
    let in_space = law_by::<T, 3>(solution.law(), map)?;
    Ok(Law::with_memory(HalfPlane::new(in_space).ok_or(SceneError::LawOfHalfPlane)?))
}

/// The solver's own law for the body of a solution, as a case asks for it.
pub(crate) fn law_of<T: Precision<D>, const D: usize>(
    solution: &dyn Solution<T, D>,
    case: &Case,
) -> Result<Law<T, D>, CaseError> {
    let law = law_of_body_by(solution, case.return_map.unwrap_or_default())?;
    match case.volume {
        Volume::Pointwise => Ok(law),
        Volume::Projected if solution.is_half_plane() => Err(SetupError::ProjectedHalfPlane.into()),
        Volume::Projected => Ok(with_projected_volume(law).ok_or(SetupError::ProjectedMemory)?),
    }
}

/// The solver's own law for a solution's.
pub(crate) fn law_by<T: Real + Compiled<D> + Stressed<D> + Stressed<3>, const D: usize>(
    law: mmsmith_runtime::Law<T>,
    map: ReturnMap,
) -> Result<Law<T, D>, SceneError> {
    let material = match law {
        mmsmith_runtime::Law::Library(material) => material,
        mmsmith_runtime::Law::Stated(stated) => return stated_law::read(stated),
        mmsmith_runtime::Law::WithMemory(law) => {
            let elastic = law.elastic.row().name;
            return with_memory(law, map).ok_or(SceneError::WithMemory { elastic });
        }
    };
    let planted = Planted::here();
    if planted.is(Fault::LambdaForMu)
        && let Material::NeoHookean { lambda, mu } = material
    {
        return Ok(Law::from(Material::NeoHookean { lambda: mu, mu: lambda }));
    }
    if planted.is(Fault::StiffnessOff) {
        return Ok(Law::from(material.map(|constant| constant * T::nearest(1.0 + 1e-6))));
    }
    Ok(Law::from(material))
}

/// A number with its fraction, even where that is zero.
fn number(value: f64) -> String {
    format!("{value:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn senseless_settings_are_named() {
        let shifted = |offset| {
            let placement = Placement::Lattice { offset };
            let scheme = Scheme::Updated(Updated { placement, ..Updated::default() });
            Case { scheme, ..Case::default() }
        };
        let (integrator, start) = (Integrator::Usl, Start::Exact);
        let started = Updated { integrator, start, ..Updated::default() };
        for (case, name) in [
            (Case { cells: 0, ..Case::default() }, "cells = 0"),
            (Case { per_cell: 0, ..Case::default() }, "ppc = 0"),
            (Case { cfl: -0.4, ..Case::default() }, "cfl = -0.4"),
            (Case { cfl: f64::NAN, ..Case::default() }, "cfl = NaN"),
            (shifted(0.6), "offset = 0.6"),
            (shifted(f64::NAN), "offset = NaN"),
            (Case { periods: f64::INFINITY, ..Case::default() }, "periods = inf"),
            (Case { scheme: Scheme::Updated(started), ..Case::default() }, "start = exact"),
        ] {
            let message = case.validate().unwrap_err().to_string();
            assert!(message.starts_with(name), "{message}");
        }
    }
}
