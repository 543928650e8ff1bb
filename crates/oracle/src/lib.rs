//! Expressions evaluated in arbitrary precision.
