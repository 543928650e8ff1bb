//! The user subroutine of CalculiX, around the Fortran module.

use super::fortran::{module, user_subroutines, with_head};
use crate::code::Code;
use crate::target::Unwritable;

const REMARKS: &str = "\
The user subroutine dload of CalculiX, for *DLOAD with BXNU, BYNU and BZNU: take it in the place of dload.f, and compile the program anew.
CalculiX hands over REFERENCE coordinates there (those of its array co, also with NLGEOM), and integrates over the reference volume: the force is rho0_b(X, t).
Set is_static = .true. in a static step: the force is then -Div P at the total time.
*ELASTIC with NLGEOM is the law of St. Venant and Kirchhoff. Numbers of an input file have at most 20 characters.
Parameters are those of the type `parameters`; change the defaults there, or write the file anew with --set.";

/// The module with the user subroutine of CalculiX.
pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let routines = user_subroutines(code, include_str!("calculix.f90"));
    Ok(with_head(code, REMARKS, "") + &module(code) + &routines)
}
