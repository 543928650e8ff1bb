//! Published listings, and claims that are refuted. One program, so that what they share is compiled once.

mod expanding_ring;
mod listings;
