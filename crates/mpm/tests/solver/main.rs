//! The solver as a library: what it keeps, its orders, and how it refuses. One program, so that its schemes are compiled once.

mod boundary;
mod failures;
mod general;
mod mechanics;
mod order;
mod ring;
mod state;
mod total_lagrangian;
