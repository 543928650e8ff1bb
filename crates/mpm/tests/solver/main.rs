//! The solver as a library: what it keeps, its orders, and how it refuses. One program, so that its schemes are compiled once.

mod cluster;
mod failures;
mod mechanics;
mod memory;
mod order;
mod polygons;
mod ranks;
#[path = "../reference/mod.rs"]
mod reference;
mod registers;
mod revolving;
mod ring;
mod schemes;
mod state;
