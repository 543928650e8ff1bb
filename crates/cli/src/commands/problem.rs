//! A solution with the scheme that simulates it.

use anyhow::Result;
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Arithmetic, Case, CaseError, Coordinates, Discretized, Extent, Integrator, Named, POLAR_ANGLES,
    Volume, forgotten_cell_length,
};
use serde::Serialize;
use serde_json::{Value, json};

use super::scheme::{self, Settled};
use crate::arguments::{Precision, SchemeOptions, word};
use crate::library::Selection;
use crate::{memory, number, processes, terminal};

/// A solution in the precisions that a simulation of it needs.
pub(super) struct Model {
    pub(super) exact: AnySolution<f64>,
    single: Option<AnySolution<f32>>,
}

impl Model {
    pub(super) fn new(selection: &Selection, precision: Precision) -> Result<Self> {
        let single = match precision {
            Precision::F64 => None,
            Precision::F32 => Some(selection.build_single()?),
        };
        Ok(Self { exact: selection.build()?, single })
    }

    pub(super) fn arithmetic(&self) -> Arithmetic<'_> {
        self.single.as_ref().map_or(Arithmetic::Double, Arithmetic::Single)
    }

    /// A case of it on its grid.
    pub(super) fn discretized(&self, case: &Case) -> Result<Discretized<'_>, CaseError> {
        Discretized::new(&self.exact, self.arithmetic(), case)
    }

    /// Cases on their grids; those that cannot be run or do not fit are refused.
    pub(super) fn admit(&self, cases: &[Case]) -> Result<Vec<Discretized<'_>>> {
        let admit = |case: &Case| {
            let found = self.discretized(case)?;
            let parts = processes::ranks().map_or(1, |ranks| ranks.count());
            memory::require(found.plan().bytes / parts as f64, case.cells).map_err(|error| {
                match forgotten_cell_length(&self.exact) {
                    Some([side, length]) => error.context(format!(
                        "the cells divide a length of {}, and the body has a side of {}: with cell-length = {side:?} under [domain] of its \
                         specification, or with the parameter that is this length, as cell-length = 'L', they divide that",
                        number::exact(length),
                        number::exact(side)
                    )),
                    None => error,
                }
            })?;
            Ok(found)
        };
        cases.iter().map(admit).collect()
    }
}

/// A solution with the scheme that simulates it.
pub(super) struct Problem {
    pub(super) selection: Selection,
    pub(super) model: Model,
    pub(super) settled: Settled,
}

impl Problem {
    /// With the scheme that options leave for it.
    pub(super) fn new(selection: Selection, options: &SchemeOptions) -> Result<Self> {
        let model = Model::new(&selection, options.precision)?;
        let settled = Settled::settle(options, &model.exact)?;
        Ok(Self { selection, model, settled })
    }

    /// With the scheme of a case, in double precision.
    pub(super) fn of(selection: Selection, case: Case) -> Result<Self> {
        let model = Model::new(&selection, Precision::F64)?;
        Ok(Self { selection, model, settled: Settled::of(case) })
    }

    /// Settings as they are written to JSON: everything that a result depends on. `cells` and `cfl` are a number or a
    /// list.
    pub(super) fn settings(
        &self,
        extent: Option<Extent>,
        cells: impl Serialize,
        cfl: impl Serialize,
    ) -> Value {
        let Self { selection, settled, .. } = self;
        let Case { scheme, per_cell, cfl_speed, periods, .. } = settled.case;
        let mut settings = json!(scheme);
        for (name, value) in [
            ("version", json!(env!("CARGO_PKG_VERSION"))),
            ("solution", json!(selection.name())),
            ("parameters", json!(selection.parameters())),
            ("cells", json!(cells)),
            ("ppc", json!(per_cell)),
            ("cfl", json!(cfl)),
            ("cfl_speed", json!(cfl_speed.name())),
            ("periods", json!(periods)),
            ("extent", json!(extent.map(Extent::name))),
            ("precision", json!(settled.precision)),
            ("threads", json!(rayon::current_num_threads())),
        ] {
            settings[name] = value;
        }
        if let Some(map) = settled.case.return_map {
            settings["return_map"] = json!(map.name());
        }
        if settled.case.volume != Volume::Pointwise {
            settings["volume"] = json!(settled.case.volume.name());
        }
        if scheme.total().is_some_and(|total| total.coordinates == Coordinates::Spherical) {
            settings["polar_angles"] = json!(POLAR_ANGLES);
        }
        if let Some(ranks) = processes::ranks() {
            settings["ranks"] = ranks.count().into();
        }
        terminal::detail_once(&settings);
        settings
    }

    /// One line that says what was simulated.
    pub(super) fn caption(&self, extent: Option<Extent>) -> String {
        let threads = number::counted(rayon::current_num_threads(), "thread");
        format!("{} {}, {threads}\n", self.selection.name(), self.setting(extent))
    }

    /// Parameters and scheme in words, for pictures too.
    pub(super) fn setting(&self, extent: Option<Extent>) -> String {
        let Self { selection, settled, .. } = self;
        let Case { scheme, per_cell, periods, .. } = settled.case;
        let part = |extent| match (extent, selection.dimension()) {
            // Three planes of symmetry.
            (Extent::Quarter, 3) => ", eighth".to_owned(),
            (extent, _) => format!(", {}", extent.name()),
        };
        let extent = extent.map(part).unwrap_or_default();
        format!(
            "({}){extent}: {} + {}{}, {per_cell} particles per cell and direction, {}, {}",
            selection.told_parameters(),
            scheme.shape(),
            scheme.updated().map_or(Integrator::Cd, |updated| updated.integrator),
            scheme::words(&scheme),
            number::of_periods(periods),
            word(settled.precision),
        )
    }
}

/// The extent that cases have, as the last of them has it.
pub(super) fn extent(cases: &[Discretized<'_>]) -> Option<Extent> {
    cases.last().and_then(|case| case.plan().extent)
}
