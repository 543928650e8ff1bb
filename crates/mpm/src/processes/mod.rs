//! Several processes: which holds which particles, how these move between them, and the state from which a run is resumed.

pub(crate) mod corner_halo;
pub(crate) mod decomposition;
pub(crate) mod redistribute;
pub(crate) mod saved_state;
