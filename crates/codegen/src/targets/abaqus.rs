//! The user subroutines of Abaqus, around the Fortran module.

use super::fortran::{module, user_subroutines, with_head};
use crate::code::Code;
use crate::target::Unwritable;
use mmsmith_stage::Measures;

const REMARKS: &str = "\
User subroutines: DLOAD for *DLOAD with BXNU, BYNU and BZNU, VDLOAD for Abaqus/Explicit, UTRACLOAD for *DSLOAD with TRVECNU and CONSTANT RESULTANT=YES \
on surfaces whose names hold X_LOWER, X_UPPER, ..., INNER or OUTER.
Abaqus hands over CURRENT coordinates x; the force is a function of X. The subroutines solve x = X + u(X, t) for the X of the body by Newton's method with \
the solution's own F, so that the displacement of the host does not matter: the force is that of the exact motion, which carries X to the same x. As the host's \
own x is X + u + error, the force is taken at a place that is off by that error, which has the order of the method.
The force is rho0_b, per reference volume; set per_current_volume = .true. where the host's loads are per current volume, \
and is_static = .true. in a static step, whose total time is that of the deformation.
Parameters are those of the type `parameters`; change the defaults there, or write the file anew with --set.";

/// The module with the user subroutines of Abaqus.
pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let tractions: String = code
        .surfaces()
        .into_iter()
        .map(|surface| {
            let surface = surface.to_string().replace('-', "_");
            let capital = surface.to_ascii_uppercase();
            format!("    if (index(surface, \"{capital}\") > 0) traction = {surface}_traction(s, X, t)\n")
        })
        .collect();
    let [low, high, inside] = match &code.staged.constants.domain {
        Measures::Box { .. } => {
            ["lower(s)", "upper(s)", "all(X >= low - slack) .and. all(X <= high + slack)"]
        }
        Measures::Annulus { .. } => [
            "-outer(s)",
            "outer(s)",
            "norm2(X) >= inner(s) - slack .and. norm2(X) <= outer(s) + slack",
        ],
        Measures::Tube(_) => [
            "[-outer(s), -outer(s), lower(s)]",
            "[outer(s), outer(s), upper(s)]",
            "norm2(X(1:2)) >= inner(s) - slack .and. norm2(X(1:2)) <= outer(s) + slack .and. X(3) >= lower(s) - slack .and. &\n      X(3) <= upper(s) + slack",
        ],
    };
    let routines = user_subroutines(code, include_str!("abaqus.f90"))
        .replace("VOLUME", &code.volume_by(["J(s, X, t)", "F_zz(s, X, t)"]))
        .replace("CORNER_LOW", low)
        .replace("CORNER_HIGH", high)
        .replace("INSIDE", inside)
        .replace("    TRACTIONS\n", &tractions);
    // The first line tells Intel's compiler that the source has free form.
    Ok(with_head(code, REMARKS, "!DIR$ FREEFORM\n") + &module(code) + &routines)
}
