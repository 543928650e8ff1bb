//! Checks and simulations through the library. One program, so that what they share is compiled once.

mod check;
mod cluster;
mod extremes;
mod hand_coded;
mod history;
mod memory;
mod ranks;
mod run;
