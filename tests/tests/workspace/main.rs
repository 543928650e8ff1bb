//! Tests that cross the borders of the crates, a file for each subject. One program, so that what they share is compiled once.

mod automatic_differentiation;
mod c_headers;
mod check;
mod claims;
mod high_order;
mod hostile_text;
mod kept_runs;
mod lasting_files;
mod laws;
mod library;
mod memory;
mod new_solution;
mod orders;
mod planted_faults;
mod planted_law_faults;
mod planted_memory_faults;
mod planted_solver_faults;
mod projected_volume;
#[path = "../../../crates/mpm/tests/reference/mod.rs"]
mod reference;
mod revolution;
mod staged;
mod statics;
mod structure;
mod symmetries;
mod tables;
mod tangents;
mod units;
mod updated_frame;
