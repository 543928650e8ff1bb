//! The time that work takes, where there is a clock: modules of WebAssembly have none, and tell zero.

#[cfg(not(target_family = "wasm"))]
use cpu_time::ProcessTime;
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;

/// The moment at which work began.
pub(crate) struct Begun {
    #[cfg(not(target_family = "wasm"))]
    wall: Instant,
    #[cfg(not(target_family = "wasm"))]
    computing: ProcessTime,
}

impl Begun {
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn now() -> Self {
        Self { wall: Instant::now(), computing: ProcessTime::now() }
    }

    #[cfg(target_family = "wasm")]
    pub(crate) fn now() -> Self {
        Self {}
    }

    /// Seconds since then: on the clock, and of all threads of the process.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn elapsed_s(&self) -> [f64; 2] {
        [self.wall.elapsed().as_secs_f64(), self.computing.elapsed().as_secs_f64()]
    }

    #[cfg(target_family = "wasm")]
    pub(crate) fn elapsed_s(&self) -> [f64; 2] {
        [0.0; 2]
    }
}
