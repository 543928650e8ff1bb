//! The command as users call it, a file for each subject. One program, so that what they share is compiled once.

mod checkpoint;
mod command;
mod conditions;
mod conventions;
mod diagnose;
mod failing_files;
mod fields;
mod free_faces;
mod generate;
mod layouts;
mod library;
mod remedy;
mod schemas;
mod scheme;
mod score;
mod score_faults;
mod score_readings;
mod shards;
mod simulate;
mod stability;
mod stated_bodies;
mod statics;
#[cfg(unix)]
mod terminal;
mod told_causes;
mod tradeoff;
mod version;
mod warnings;
