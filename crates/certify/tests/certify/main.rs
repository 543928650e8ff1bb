//! Certificates and the bounds behind them. One program, so that what they share is compiled once.

mod certificates;
mod soundness;
