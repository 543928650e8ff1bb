//! The solver with splines, within and at boundaries. One program, so that what they share is compiled once.

mod boundary;
mod memory;
mod solver;
