//! The part of the Python package `mmsmith` that is written in Rust: fields at arrays of points, and the commands of `mms`.
//!
//! Arrays come from the part in Python, which has checked their shapes and types; a wrong one is an exception here too, but
//! says less.

use mmsmith_cli::{Refusal, Watch};
use mmsmith_codegen::{CAUSES, Cause, Counter, Fault, NoEffect as Unchanged, Steps};
use mmsmith_interpret::{Arrays, ArraysAtPoints, Quantity, interpret_staged};
use mmsmith_runtime::{AnySolution, Domain, Law, Solution, Surface};
use mmsmith_spec::{Fields as Derived, Spec};
use mmsmith_stage::{FieldName, Staged};
use numpy::{PyReadonlyArray2, PyReadwriteArrayDyn};
use pyo3::create_exception;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

create_exception!(mmsmith, Error, PyValueError, "What mms refuses or cannot do, in its words.");
create_exception!(mmsmith, NoEffect, Error, "A fault that changes no field of a solution.");

fn refused(error: impl ToString) -> PyErr {
    Error::new_err(error.to_string())
}

/// A solution, its parameters fixed.
#[pyclass(frozen, module = "mmsmith._mmsmith")]
struct Fields {
    spec: Spec,
    arrays: Arc<Arrays>,
    facts: Facts,
    #[pyo3(get)]
    parameters: BTreeMap<String, f64>,
    #[pyo3(get)]
    fault: Option<String>,
}

/// Properties of a solution that are the same at all points.
struct Facts {
    corners: Option<(Vec<f64>, Vec<f64>)>,
    radii: Option<(f64, f64)>,
    boundaries: Vec<(String, String)>,
    law: BTreeMap<String, f64>,
    density: f64,
    wave_speed: f64,
    period: f64,
    cell_length: f64,
}

impl Facts {
    fn of<const D: usize>(solution: &dyn Solution<f64, D>) -> Self {
        let (corners, radii) = match solution.domain() {
            Domain::Box { lower, upper } => {
                (Some([lower, upper].map(|corner| corner.as_slice().to_vec()).into()), None)
            }
            Domain::Annulus { inner, outer } => (None, Some((inner, outer))),
            _ => (None, None),
        };
        let boundary = |boundary: &mmsmith_runtime::Boundary| {
            (boundary.surface.to_string(), boundary.condition.to_string())
        };
        Facts {
            corners,
            radii,
            boundaries: solution.boundaries().iter().map(boundary).collect(),
            law: match solution.law() {
                Law::Library(material) => {
                    let names = material.row().constants.iter().map(|own| own.name.to_owned());
                    names.zip(material.values()).collect()
                }
                Law::Stated(stated) => stated.constants.into_iter().collect(),
                Law::WithMemory(law) => law.named_values().into_iter().collect(),
            },
            density: solution.density(),
            wave_speed: solution.wave_speed(),
            period: solution.period(),
            cell_length: solution.cell_length(),
        }
    }
}

impl Fields {
    fn build(
        spec: Spec,
        overrides: &BTreeMap<String, f64>,
        fault: Option<String>,
        plant: impl FnOnce(&Spec, &mut Derived) -> Result<(), Unchanged>,
    ) -> PyResult<Self> {
        let mut fields = spec.derive().map_err(refused)?;
        plant(&spec, &mut fields).map_err(|none| NoEffect::new_err(none.to_string()))?;
        let staged = Staged::of(&spec, fields);
        let pairs = || overrides.iter().map(|(name, &value)| (name.as_str(), value));
        let facts = match interpret_staged(&spec, &staged, pairs()).map_err(refused)? {
            AnySolution::One(solution) => Facts::of(&*solution),
            AnySolution::Two(solution) => Facts::of(&*solution),
            AnySolution::Three(solution) => Facts::of(&*solution),
            _ => return Err(refused("the solution has more than three dimensions")),
        };
        let arrays = Arc::new(Arrays::new(&spec, &staged, pairs()).map_err(refused)?);
        let mut parameters: BTreeMap<String, f64> =
            spec.parameters.iter().map(|p| (p.name.clone(), p.default)).collect();
        parameters.extend(overrides.clone());
        Ok(Fields { spec, arrays, facts, parameters, fault })
    }

    fn compute(
        &self,
        py: Python<'_>,
        quantity: Quantity,
        X: &PyReadonlyArray2<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        let (X, out) = (X.as_slice()?, out.as_slice_mut()?);
        let entries = self.arrays.entries(quantity);
        require(X, self.arrays.dimension(), out, entries.unwrap_or_default())?;
        py.detach(|| self.arrays.evaluate(quantity, X, t, out));
        Ok(())
    }
}

/// Refuses lengths that do not belong together.
fn require(X: &[f64], dimension: usize, out: &[f64], entries: usize) -> PyResult<()> {
    if !X.len().is_multiple_of(dimension) || out.len() != X.len() / dimension * entries {
        return Err(PyValueError::new_err(
            "out has another number of values than X has points for",
        ));
    }
    Ok(())
}

fn field(letter: &str) -> PyResult<FieldName> {
    let known = FieldName::ALL.into_iter().find(|field| field.letter() == letter);
    known.ok_or_else(|| PyValueError::new_err(format!("there is no field '{letter}'")))
}

#[pymethods]
impl Fields {
    #[new]
    fn new(py: Python<'_>, name: &str, parameters: BTreeMap<String, f64>) -> PyResult<Self> {
        py.detach(|| {
            let spec = mmsmith_cli::specification(name).map_err(refused)?;
            Fields::build(spec, &parameters, None, |_, _| Ok(()))
        })
    }

    fn with_fault(&self, py: Python<'_>, name: &str) -> PyResult<Self> {
        let fault = name.parse::<Fault>().map_err(|unknown| {
            let known = Fault::ALL.map(Fault::name);
            refused(format!("{unknown}; there are: {}", known.join(", ")))
        })?;
        py.detach(|| {
            let plant = |spec: &Spec, fields: &mut Derived| fault.plant(spec, fields);
            Fields::build(self.spec.clone(), &self.parameters, Some(fault.name().into()), plant)
        })
    }

    /// The fields with the opposite of one mistake or more.
    fn against(&self, py: Python<'_>, names: Vec<String>) -> PyResult<Self> {
        let found = names.iter().map(|name| {
            Cause::named(name).ok_or_else(|| refused(format!("there is no cause '{name}'")))
        });
        let causes: Vec<&Cause> = found.collect::<PyResult<_>>()?;
        let (of_memory, causes): (Vec<&Cause>, Vec<&Cause>) =
            causes.into_iter().partition(|cause| cause.is_of_memory());
        let mistaken = of_memory.into_iter().try_fold(self.spec.clone(), |spec, cause| {
            cause.specification(&spec).map_err(|none| NoEffect::new_err(none.to_string()))
        })?;
        py.detach(|| {
            // Times are shifted in the part in Python, which knows the solver's time steps.
            let plant = |spec: &Spec, fields: &mut Derived| {
                Cause::plant_all(&causes, spec, fields, Steps::of(f64::NAN, f64::NAN))
            };
            Fields::build(mistaken, &self.parameters, Some(names.join(" and ")), plant)
        })
    }

    fn evaluate(
        &self,
        py: Python<'_>,
        letter: &str,
        X: PyReadonlyArray2<'_, f64>,
        t: f64,
        out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        self.compute(py, Quantity::Field(field(letter)?), &X, t, out)
    }

    fn traction(
        &self,
        py: Python<'_>,
        surface: &str,
        X: PyReadonlyArray2<'_, f64>,
        t: f64,
        out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        let mut surfaces = Surface::all(self.arrays.dimension())
            .map(Quantity::Traction)
            .filter(|&quantity| self.arrays.entries(quantity).is_some());
        let name = |quantity: &Quantity| match quantity {
            Quantity::Traction(surface) => surface.to_string(),
            Quantity::Field(field) => field.letter().to_owned(),
            Quantity::Internal => String::new(),
        };
        match surfaces.clone().find(|quantity| name(quantity) == surface) {
            Some(quantity) => self.compute(py, quantity, &X, t, out),
            None => {
                let known: Vec<_> = surfaces.by_ref().map(|quantity| name(&quantity)).collect();
                Err(refused(format!(
                    "{} has no surface '{surface}'; it has {}",
                    self.spec.name,
                    known.join(", ")
                )))
            }
        }
    }

    fn internal(
        &self,
        py: Python<'_>,
        X: PyReadonlyArray2<'_, f64>,
        t: f64,
        out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        self.compute(py, Quantity::Internal, &X, t, out)
    }

    #[getter]
    fn internal_variables(&self) -> Vec<String> {
        self.arrays.internal_variables().to_vec()
    }

    fn at(&self, py: Python<'_>, X: PyReadonlyArray2<'_, f64>) -> PyResult<FieldsAtPoints> {
        let X = X.as_slice()?;
        require(X, self.arrays.dimension(), &[], 0)?;
        Ok(FieldsAtPoints { points: py.detach(|| self.arrays.at(X)) })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.spec.name
    }

    #[getter]
    fn title(&self) -> &str {
        &self.spec.title
    }

    #[getter]
    fn dimension(&self) -> usize {
        self.arrays.dimension()
    }

    #[getter]
    fn corners(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        self.facts.corners.clone()
    }

    #[getter]
    fn radii(&self) -> Option<(f64, f64)> {
        self.facts.radii
    }

    #[getter]
    fn boundaries(&self) -> Vec<(String, String)> {
        self.facts.boundaries.clone()
    }

    #[getter]
    fn law(&self) -> BTreeMap<String, f64> {
        self.facts.law.clone()
    }

    #[getter]
    fn law_name(&self) -> &str {
        self.spec.material.name()
    }

    #[getter]
    fn density(&self) -> f64 {
        self.facts.density
    }

    #[getter]
    fn wave_speed(&self) -> f64 {
        self.facts.wave_speed
    }

    #[getter]
    fn period(&self) -> f64 {
        self.facts.period
    }

    #[getter]
    fn cell_length(&self) -> f64 {
        self.facts.cell_length
    }
}

/// A solution at points that stay.
#[pyclass(frozen, module = "mmsmith._mmsmith")]
struct FieldsAtPoints {
    points: ArraysAtPoints,
}

#[pymethods]
impl FieldsAtPoints {
    fn evaluate(
        &self,
        py: Python<'_>,
        letter: &str,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        let (field, out) = (field(letter)?, out.as_slice_mut()?);
        if out.len() != self.points.len() * self.points.entries(field) {
            return Err(PyValueError::new_err("out has another number of values than the field"));
        }
        py.detach(|| self.points.evaluate(field, t, out));
        Ok(())
    }
}

/// The faults that can be planted: their names, and a line about each.
#[pyfunction]
fn faults() -> Vec<(&'static str, &'static str)> {
    Fault::ALL.map(|fault| (fault.name(), fault.about())).into()
}

/// The mistakes that are looked for in solvers, in the order of the table: the name, the mistake in a line, where to look, the kind of
/// what shows it, the field and the number of time steps or cells where there are such.
#[pyfunction]
fn causes() -> Vec<(&'static str, &'static str, &'static str, &'static str, &'static str, f64)> {
    let parts = |counter: Counter| match counter {
        Counter::Fields(_) => ("fields", "", 0.0),
        Counter::Memory(_) => ("memory", "", 0.0),
        Counter::Time { of, steps } => ("time", of.word(), steps),
        Counter::Place(placed) => ("place", placed.word(), 0.0),
        Counter::Motion(moved) => ("motion", moved.word(), 0.0),
        Counter::Cell { cells } => ("cell", "force", cells),
        Counter::Impulse { steps } => ("impulse", "force", steps),
        Counter::Unused(unused) => ("unused", unused.word(), 0.0),
    };
    let row = |cause: &Cause| {
        let (kind, of, steps) = parts(cause.counter);
        (cause.name, cause.mistake, cause.look, kind, of, steps)
    };
    CAUSES.iter().map(row).collect()
}

/// The names of all solutions that can be loaded without a path.
#[pyfunction]
fn solutions() -> Vec<String> {
    mmsmith_cli::solutions()
}

/// The command `mms` with these words; gives the exit status.
#[pyfunction]
fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| {
        mmsmith_cli::end_on_signals();
        mmsmith_cli::run(words)
    })
}

/// So often Python may handle signals while a command works.
const LOOK: Duration = Duration::from_millis(50);
/// So long a command may take to come to its next step after Ctrl-C; then it is left to itself.
const PATIENCE: u32 = 40;
/// As the main thread of a program has: specifications are trees.
const STACK: usize = 8 << 20;

/// Does a command and prints nothing; false where a check failed. Now and then `progress` is called with the share that is done and the
/// case under way.
#[pyfunction]
fn call(py: Python<'_>, words: Vec<OsString>, progress: Option<Py<PyAny>>) -> PyResult<bool> {
    let (sender, receiver) = mpsc::channel();
    let watch = Arc::new(Watch::default());
    let watched = Arc::clone(&watch);
    let work = move || {
        // Nobody waits any more for a command that was left to itself.
        let _ = sender.send(mmsmith_cli::call(words, &watched));
    };
    thread::Builder::new().stack_size(STACK).spawn(work)?;
    let tell = || match (&progress, watch.take()) {
        (Some(progress), Some(report)) => progress.call1(py, (report.share, report.what)).map(drop),
        _ => Ok(()),
    };
    let receiver = Mutex::new(receiver);
    let wait = || receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK);
    loop {
        match py.detach(wait) {
            Ok(outcome) => {
                return outcome.map_err(|refusal| match refusal {
                    Refusal::Failed(message) => refused(message),
                    Refusal::Interrupted => PyKeyboardInterrupt::new_err(()),
                });
            }
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals().and_then(|()| tell()).inspect_err(|_| {
                    py.detach(|| {
                        let is_under_way = || matches!(wait(), Err(RecvTimeoutError::Timeout));
                        for _ in 0..PATIENCE {
                            // Between two simulations there is none to end.
                            mmsmith_verify::interrupt();
                            if !is_under_way() {
                                break;
                            }
                        }
                        mmsmith_verify::allow();
                    });
                })?
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the command ended without a result"));
            }
        }
    }
}

/// The part of the package in Rust.
#[pymodule]
fn _mmsmith(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", py.get_type::<Error>())?;
    module.add("NoEffect", py.get_type::<NoEffect>())?;
    module.add_class::<Fields>()?;
    module.add_class::<FieldsAtPoints>()?;
    module.add_function(wrap_pyfunction!(faults, module)?)?;
    module.add_function(wrap_pyfunction!(causes, module)?)?;
    module.add_function(wrap_pyfunction!(solutions, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(call, module)?)
}
