//! Tests of histories of materials with memory.

#![allow(non_snake_case, clippy::unwrap_used)]

mod bodies;
mod solver_laws;
mod stated;
mod trajectories;
