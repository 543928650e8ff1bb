//! The page where anyone tries mmsmith: what it asks for, as a WebAssembly module of plain bytes.
//!
//! The page writes a question as JSON into memory that `boundary::room` lends and calls `boundary::answer`; an answer is
//! JSON too, but for the motion of particles, which is single precision numbers. Nothing of the page is known here: no markup, no
//! request, no clock.

#![cfg(target_family = "wasm")]

mod boundary;
#[cfg(feature = "solver")]
mod checks;
mod formulas;
mod motion;
mod particles;
mod question;
mod refusal;
mod session;
#[cfg(feature = "solver")]
mod study;
