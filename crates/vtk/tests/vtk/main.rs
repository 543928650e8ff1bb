//! Files as a user or another program writes and reads them, a file for each subject. One program, so that what they share is compiled once.

#[path = "../awkward/mod.rs"]
mod awkward;
mod bad_input;
mod foreign;
#[cfg(unix)]
mod full_disk;
mod golden;
mod round_trip;
