//! The oracle against other arithmetic, and the digits of code against the oracle. One program, so that what they share is compiled once.

mod accuracy;
mod evaluation;
mod functions;
mod golden;
mod rules;
mod second_library;
