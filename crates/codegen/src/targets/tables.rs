//! Readers of tables, and the functions of a file that take values from them: a module for each language.

pub(super) mod c;
pub(super) mod cpp;
pub(super) mod fortran;
pub(super) mod julia;
mod python;
