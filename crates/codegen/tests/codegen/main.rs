//! Generated headers and modules, and the languages of all hosts. One program, so that what they share is compiled once.

mod headers;
mod modules;
mod targets;
