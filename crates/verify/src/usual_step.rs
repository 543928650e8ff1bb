//! The time step of a run that is given none, and what steps are on the fastest waves of a motion.

use mmsmith_runtime::AnySolution;

use crate::case::{Case, CflSpeed, two_digits};
use crate::dimension::in_dimension;
use crate::error::CaseError;
use crate::run::Row;
use crate::scheme::Scheme;
use crate::waves::{fastest_p_wave, largest_viscous_modulus};

/// The CFL number of runs that are given none: that of the original study, on bar waves.
pub const USUAL_CFL: f64 = 0.4;

/// The largest CFL number on the fastest P-waves of a motion that a run has without being asked for it.
///
/// The updated formulation is stable up to 0.83 and more with all weights but linear ones (`mms stability` over shapes in the plane and in
/// space, on a lattice and clipped, for `nu = 0.47`); the rest is room for what samples of the motion do not see.
pub const LARGEST_USUAL_CFL: f64 = 0.6;

/// The CFL number of a run that is given none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsualStep {
    /// The number.
    pub cfl: f64,
    /// The speed that it refers to.
    pub speed: CflSpeed,
    /// The number that 0.4 would have been on the fastest P-waves, where it is less for that.
    pub too_long: Option<f64>,
}

/// The CFL number of a run by `scheme` until so many periods that is given none, and at most the speed that it refers to: [`USUAL_CFL`], and where
/// that is more than [`LARGEST_USUAL_CFL`] on the fastest P-waves of the motion or than suits splines of the total formulation, a number with
/// which the scheme is stable.
///
/// # Errors
///
/// [`CaseError`] for a material that the solver has no law for.
pub fn usual_step(
    exact: &AnySolution<f64>,
    scheme: &Scheme,
    periods: f64,
    said: Option<CflSpeed>,
) -> Result<UsualStep, CaseError> {
    let speed = said.unwrap_or(match stiffest(exact)? {
        CflSpeed::Viscous => CflSpeed::Viscous,
        _ => CflSpeed::Bar,
    });
    if speed == CflSpeed::Viscous {
        let cfl = stable_cfl(exact, scheme, periods, speed)?.min(USUAL_CFL);
        return Ok(UsualStep { cfl, speed, too_long: None });
    }
    let on_fastest = USUAL_CFL
        * in_dimension!(
            exact,
            |s| fastest_p_wave(s, periods)? / speed.on_wide_cells(s)?,
            else return Err(CaseError::Dimension)
        );
    if on_fastest <= LARGEST_USUAL_CFL || !on_fastest.is_finite() {
        let cfl = match scheme {
            Scheme::Total(total) => total.usual_cfl(exact, speed)?.min(USUAL_CFL),
            Scheme::Updated(_) => USUAL_CFL,
        };
        return Ok(UsualStep { cfl, speed, too_long: None });
    }
    let speed = said.unwrap_or(CflSpeed::PWave);
    let cfl = stable_cfl(exact, scheme, periods, speed)?;
    Ok(UsualStep { cfl, speed, too_long: Some(on_fastest) })
}

/// A CFL number with which a scheme is stable until so many periods: [`LARGEST_USUAL_CFL`] on the fastest P-waves of the motion, and
/// with splines of the total Lagrangian formulation what suits their degree.
///
/// # Errors
///
/// [`CaseError`] for a material that the solver has no law for.
pub(crate) fn stable_cfl(
    exact: &AnySolution<f64>,
    scheme: &Scheme,
    periods: f64,
    speed: CflSpeed,
) -> Result<f64, CaseError> {
    match scheme {
        Scheme::Total(total) => total.usual_cfl(exact, speed),
        Scheme::Updated(_) => in_dimension!(
            exact,
            |s| Ok(two_digits(LARGEST_USUAL_CFL * speed.on_wide_cells(s)? / fastest_p_wave(s, periods)?)),
            else Err(CaseError::Dimension)
        ),
    }
}

/// The speed that limits time steps: of P-waves, and where the stress follows the rate of the deformation, of viscous waves.
///
/// # Errors
///
/// [`CaseError`] for a material that the solver has no law for.
pub fn stiffest(exact: &AnySolution<f64>) -> Result<CflSpeed, CaseError> {
    let modulus = in_dimension!(exact, |s| largest_viscous_modulus(s)?, else return Err(CaseError::Dimension));
    Ok(if modulus > 0.0 { CflSpeed::Viscous } else { CflSpeed::PWave })
}

/// A time step as CFL numbers on P-waves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnPWaves {
    /// CFL number on the P-waves of the undeformed solid.
    pub at_rest: f64,
    /// CFL number on the fastest P-waves of the motion.
    pub fastest: f64,
}

/// The time step of a row on P-waves.
///
/// # Errors
///
/// [`CaseError`] for a material that the solver has no law for.
pub fn on_p_waves(exact: &AnySolution<f64>, case: &Case, row: &Row) -> Result<OnPWaves, CaseError> {
    in_dimension!(
        exact,
        |s| {
            let cfl = |speed: f64| row.dt * speed / row.h;
            let fastest = fastest_p_wave(s, case.periods)?;
            Ok(OnPWaves { at_rest: cfl(CflSpeed::PWave.on_wide_cells(s)?), fastest: cfl(fastest) })
        },
        else Err(CaseError::Dimension)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::{Total, Updated};

    fn usual(name: &str, given: &[f64]) -> UsualStep {
        let exact = mmsmith_solutions::build::<f64>(name, given).unwrap().unwrap();
        usual_step(&exact, &Scheme::Updated(Updated::default()), 1.0, None).unwrap()
    }

    /// The stiffer the solid is against bars of it, the less of the usual step is left; where that is stable it stays.
    #[test]
    fn the_usual_step_follows_the_fastest_waves() {
        for (name, given) in [
            ("axis-aligned", &[][..]),
            ("axis-aligned-1d", &[]),
            ("axis-aligned-3d", &[]),
            ("ring", &[]),
            ("ring-nu", &[]),
        ] {
            let found = usual(name, given);
            assert_eq!(
                found,
                UsualStep { cfl: 0.4, speed: CflSpeed::Bar, too_long: None },
                "{name}"
            );
        }
        for (nu, least, most) in [(0.47, 0.9, 1.4), (0.499, 5.0, 9.0), (-0.95, 1.3, 2.5)] {
            let found = usual("axis-aligned", &[0.1, 1e4, nu, 4.0]);
            let too_long = found.too_long.unwrap();
            assert!((least..most).contains(&too_long), "{nu}: {found:?}");
            assert!(found.cfl <= 0.6 && found.speed == CflSpeed::PWave, "{nu}: {found:?}");
        }
        // Splines of the total formulation have their own limits, which fall with the degree.
        let exact = mmsmith_solutions::build::<f64>("ring", &[]).unwrap().unwrap();
        let of_degree = |degree| {
            let coordinates = Total::coordinates_for(&exact);
            let total = Total { coordinates, ..Total::of_degree(degree) };
            usual_step(&exact, &Scheme::Total(total), 1.0, None).unwrap().cfl
        };
        let all = [2, 3, 4, 5].map(of_degree);
        assert!(all.is_sorted_by(|one, next| one > next) && all[0] < 0.3, "{all:?}");
        // A motion that compresses strongly is stiffer than the solid at rest.
        let [mild, strong] = [0.01, 0.28].map(|A| usual("axis-aligned", &[A, 1e4, 0.48, 4.0]).cfl);
        assert!(strong < 0.8 * mild, "{strong} {mild}");
    }
}
