//! Specifications as users write them, and the mechanics of what is derived. One program, so that what they share is compiled once.

mod boundary;
mod fuzz;
mod mechanics;
mod specifications;
