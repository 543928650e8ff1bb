//! Numbers side by side in vector registers, and the small matrices of solvers: results have the same bits in all registers.

pub mod simd;
pub mod tensor;
