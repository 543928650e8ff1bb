//! Findings on a solution from histories of its internal variables.

use mmsmith_vocabulary::Smoothness;

/// How the histories of some particles of a body go until a time.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryReport {
    /// Whether the law is one of flow, which may begin and stop; of others particles, changes and margins tell nothing.
    pub flows: bool,
    /// The particles that were followed.
    pub particles: usize,
    /// Particles that flow from the start to the end; all of them for laws whose internal variables always have rates.
    pub always: usize,
    /// Particles that begin to flow after the start.
    pub onsets: usize,
    /// Particles that stop flowing.
    pub unloadings: usize,
    /// The least rate at which the stress grows while a particle flows, as a share of the rate of deformation, `n : d/|d|`, or the least
    /// stress beyond the yield stress where flow depends on its rate; infinite where nothing flows.
    pub least_margin: f64,
    /// How smooth the body force is at the worst of these changes.
    pub smoothness: Smoothness,
    /// The largest `|f|` over the yield stress of particles that flow.
    pub yield_condition: f64,
    /// The largest `|det G - 1|`: flow keeps the volume.
    pub volume: f64,
    /// The largest error of the tables that solvers are driven by, as a share of each field's largest value, as random places and times
    /// show it; not a number where particles have series of their own, as behind fronts of flow.
    pub table_error: f64,
}
