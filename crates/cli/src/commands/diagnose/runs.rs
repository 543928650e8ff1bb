//! Runs of a solver by a command, with fields that are right or have the opposite of a mistake.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use mmsmith_codegen::{Cause, Code, Host, Names, Origin, Steps};
use mmsmith_interpret::{Over, TableFile};
use mmsmith_solutions::AnySolution;
use mmsmith_spec::Spec;
use mmsmith_stage::Staged;
use mmsmith_verify::{
    Input, Norm, PerNorm, Quantity, Resolution, ScoreOptions as Reading, compare_recordings, score,
};

use crate::commands::tabulated;
use crate::input;

/// Errors of a run by field: the largest at any point, or of the norm that is asked for.
pub(super) type Errors = BTreeMap<Quantity, f64>;

/// Trial of a solver: fields against a mistake.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    /// The mistake.
    pub(super) cause: &'static Cause,
    /// The time step over the length of a cell, where it was fitted; else the solver's own holds.
    pub(super) fitted: Option<f64>,
}

impl Trial {
    fn folder(&self) -> String {
        let fitted = self.fitted.map(|dt_over_h| format!("-{dt_over_h:.3e}")).unwrap_or_default();
        format!("{}{fitted}", self.cause.name)
    }
}

/// A time step that is not known is taken for this share of the time of a wave through a cell.
const SHORT: f64 = 0.02;
/// Errors that differ by less are of the same fields; a field that counts changes them by a hundredth.
const ROUNDING: f64 = 1e-7;
/// Results that differ by less of the error are the same; files may have few digits.
const SAME_RESULT: f64 = 1e-4;

/// The solver and the solution.
pub(super) struct Solver<'a> {
    pub(super) spec: Spec,
    pub(super) exact: AnySolution<f64>,
    pub(super) target: &'static Host,
    pub(super) origin: Origin,
    pub(super) build: Option<&'a str>,
    pub(super) run: &'a str,
    pub(super) folder: PathBuf,
    pub(super) until: Instant,
    /// The norm by which errors of a field are told, where it is not the largest error.
    pub(super) norms: BTreeMap<Quantity, Norm>,
    /// Its time steps by the number of cells, as far as they are known.
    pub(super) dt: BTreeMap<usize, f64>,
}

/// Result of a run.
pub(super) struct Run {
    /// The errors; infinite where the run failed.
    pub(super) errors: Errors,
    /// The root of the mean square of the errors of the displacement.
    pub(super) root_mean_square: f64,
    /// Why it failed.
    pub(super) failure: Option<String>,
    /// Where its files are.
    pub(super) out: PathBuf,
}

impl Solver<'_> {
    /// The length of a cell.
    pub(super) fn h(&self, cells: usize) -> f64 {
        let length = match &self.exact {
            AnySolution::One(solution) => solution.cell_length(),
            AnySolution::Two(solution) => solution.cell_length(),
            AnySolution::Three(solution) => solution.cell_length(),
            _ => f64::NAN,
        };
        length / cells as f64
    }

    fn steps(&self, trial: &Trial, cells: usize) -> Steps {
        let h = self.h(cells);
        match trial.fitted {
            // A shift is a whole step or half of it.
            Some(dt_over_h) => Steps { dt: dt_over_h * h, start: 0.4 * dt_over_h * h, h },
            // Mistakes that are a time step off are not tried without one; others need to know the start from what is later.
            None => Steps::of(self.dt(cells).unwrap_or(SHORT * h / self.wave_speed()), h),
        }
    }

    /// The time step on a grid; on one that was not run, in proportion to that on the finest.
    pub(super) fn dt(&self, cells: usize) -> Option<f64> {
        let known = self.dt.get(&cells).copied();
        known.or_else(|| {
            let (&finest, dt) = self.dt.iter().next_back()?;
            Some(dt * finest as f64 / cells as f64)
        })
    }

    /// The speed that CFL numbers refer to.
    pub(super) fn wave_speed(&self) -> f64 {
        match &self.exact {
            AnySolution::One(solution) => solution.wave_speed(),
            AnySolution::Two(solution) => solution.wave_speed(),
            AnySolution::Three(solution) => solution.wave_speed(),
            _ => f64::NAN,
        }
    }

    /// Whether a mistake changes any field; its counter is the same on all grids but for steps.
    pub(super) fn shows(&self, trial: &Trial, cells: usize) -> bool {
        if trial.cause.is_of_memory() || self.spec.has_history() {
            return trial.cause.specification(&self.spec).is_ok();
        }
        let fields = self.spec.derive();
        fields.is_ok_and(|mut fields| {
            trial.cause.plant(&self.spec, &mut fields, self.steps(trial, cells)).is_ok()
        })
    }

    /// Whether there is time for another run.
    pub(super) fn has_time(&self) -> bool {
        Instant::now() < self.until
    }

    /// Writes the fields and runs the solver on a grid.
    pub(super) fn errors(&self, trial: Option<&Trial>, cells: usize) -> Result<Run> {
        let name = trial.map_or_else(|| "right".to_owned(), Trial::folder);
        let folder = self.folder.join(name);
        // Fields that shift times or places by steps are others on each grid.
        let fields = match trial {
            Some(trial) if trial.depends_on_steps() => folder.join(format!("fields-{cells}")),
            _ => folder.join("fields"),
        };
        let out = folder.join(format!("cells-{cells}"));
        fs::create_dir_all(&out).with_context(|| out.display().to_string())?;
        if input::kind_of(&fields)?.is_none() {
            let files = match (self.files(trial, cells), trial) {
                // Histories of a mistaken material may not be followed, as where it softens to nothing.
                (Err(why), Some(_)) => {
                    return Ok(Run::failed(format!("its fields cannot be formed: {why:#}"), out));
                }
                (files, _) => files?,
            };
            fs::create_dir_all(&fields).with_context(|| fields.display().to_string())?;
            for (name, text) in files {
                let path = fields.join(name);
                fs::write(&path, text).with_context(|| path.display().to_string())?;
            }
            if let Some(build) = self.build
                && let Err(failure) = self.command(build, &fields, cells, &out)
            {
                match trial {
                    None => bail!("--build failed: {failure}"),
                    Some(_) => return Ok(Run::failed(failure, out)),
                }
            }
        }
        let failure = self.command(self.run, &fields, cells, &out).err();
        Ok(match failure {
            Some(failure) => Run::failed(failure, out),
            None => self.scored(cells, out),
        })
    }

    /// The source with the fields, and the table beside it where they follow from histories.
    fn files(&self, trial: Option<&Trial>, cells: usize) -> Result<Vec<(String, String)>> {
        let mistaken = match trial {
            Some(trial) if trial.cause.is_of_memory() => trial.cause.specification(&self.spec)?,
            _ => self.spec.clone(),
        };
        let mut fields = mistaken.derive()?;
        if let Some(trial) = trial.filter(|trial| !trial.cause.is_of_memory()) {
            trial.cause.plant(&mistaken, &mut fields, self.steps(trial, cells))?;
        }
        let mut table = None;
        if mistaken.has_history() && self.target.reads_tables {
            let staged = Staged::of(&mistaken, fields.clone());
            let over = if self.target.in_half_plane { Over::HalfPlane } else { Over::Body };
            table = Some(TableFile::new(&mistaken, &staged, [], 1.0, over)?);
        }
        let origin = self.origin.clone();
        let in_half_plane = self.target.in_half_plane;
        let is_planted = trial.is_some_and(|trial| !trial.cause.is_of_memory());
        let mut code = match is_planted {
            true => Code::changed(&mistaken, fields, origin, in_half_plane),
            false => Code::for_host(&mistaken, origin, in_half_plane)?,
        };
        if let Some(trial) = trial {
            let why = format!("the opposite of the mistake {}", trial.cause.name);
            code = code.wrong_on_purpose(why);
        }
        let module = Names::of(&self.spec.name).module;
        let mut files = vec![];
        if let Some(table) = table {
            let (with_table, text) = tabulated::beside(code, &table);
            code = with_table;
            files.push((format!("{module}.table"), text));
        }
        files.push((self.target.file_name(&module), self.target.source(&code)?));
        Ok(files)
    }

    /// Runs a command of the shell; the error says how it ended.
    fn command(&self, text: &str, fields: &Path, cells: usize, out: &Path) -> Result<(), String> {
        let words = [
            ("{fields}", fields.display().to_string()),
            ("{cells}", cells.to_string()),
            ("{out}", out.display().to_string()),
        ];
        let filled =
            words.iter().fold(text.to_owned(), |text, (place, value)| text.replace(place, value));
        let mut command = Command::new("sh");
        command.args(["-c", &filled]).stdin(Stdio::null());
        let names = ["MMS_FIELDS", "MMS_CELLS", "MMS_OUT"];
        command.envs(names.iter().zip(&words).map(|(name, (_, value))| (name, value)));
        let ended = command.output().map_err(|error| format!("sh cannot be started: {error}"))?;
        if ended.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&ended.stderr);
        let last: Vec<&str> = said.lines().rev().take(3).collect();
        let last: Vec<&str> = last.into_iter().rev().collect();
        Err(format!("{filled}: {}; {}", ended.status, last.join("; ")))
    }

    /// The errors of the files that a run left, against the right fields.
    fn scored(&self, cells: usize, out: PathBuf) -> Run {
        let resolution = Resolution::Cells(cells);
        let inputs = [Input { paths: files(&out), resolution, velocity_lag: 0.0 }];
        match score(&self.exact, &inputs, &Reading::default()) {
            Ok(score) => {
                let row = &score.rows[0];
                let norm = |field: &Quantity| self.norms.get(field).copied().unwrap_or(Norm::Linf);
                let of = |field: &Quantity| (*field, row.errors[field][norm(field)]);
                let recorded = row.errors.keys().filter(|field| row.fields.contains(field));
                Run {
                    errors: recorded.map(of).collect(),
                    root_mean_square: row.errors[&Quantity::Displacement].l2,
                    failure: None,
                    out,
                }
            }
            Err(error) => Run::failed(error.to_string(), out),
        }
    }
}

impl Solver<'_> {
    /// Whether two runs on a grid have the same results but for rounding. Largest errors alone may be those of the first frame, which no field
    /// changes.
    pub(super) fn is_same(&self, one: &Run, other: &Run, cells: usize) -> bool {
        if !one.is_like(other) {
            return false;
        }
        let input = |run: &Run| Input {
            paths: files(&run.out),
            resolution: Resolution::Cells(cells),
            velocity_lag: 0.0,
        };
        // The steps stand for an order, which two recordings have none of.
        let both = [input(one), input(other)];
        let Ok(found) = compare_recordings(&self.exact, &both, &[2.0, 1.0], &Reading::default())
        else {
            return true;
        };
        let is_small = |(field, norms): (&Quantity, &PerNorm<f64>)| {
            let error = one.errors.get(field).copied().unwrap_or(f64::INFINITY);
            norms.linf <= SAME_RESULT * error
        };
        found.rows.iter().all(|row| row.differences.iter().all(is_small))
    }
}

impl Run {
    fn failed(failure: String, out: PathBuf) -> Self {
        Run { errors: Errors::new(), root_mean_square: f64::INFINITY, failure: Some(failure), out }
    }

    /// Whether its errors are those of another run but for rounding: another form of the same fields rounds otherwise.
    pub(super) fn is_like(&self, other: &Run) -> bool {
        let is_same = |one: f64, other: f64| (one - other).abs() <= ROUNDING * one.abs();
        is_same(self.root_mean_square, other.root_mean_square)
            && self.errors.keys().eq(other.errors.keys())
            && self.errors.values().zip(other.errors.values()).all(|(a, b)| is_same(*a, *b))
    }
}

impl Trial {
    fn depends_on_steps(&self) -> bool {
        use mmsmith_codegen::Counter;
        !matches!(self.cause.counter, Counter::Fields(_) | Counter::Memory(_) | Counter::Place(_))
    }
}

/// The time step that a solver wrote into the file `dt` beside its results.
pub(super) fn written_step(run: &Run) -> Option<f64> {
    let text = fs::read_to_string(run.out.join(STEP)).ok()?;
    text.trim().parse().ok().filter(|dt: &f64| *dt > 0.0 && dt.is_finite())
}

/// The file of the time step.
const STEP: &str = "dt";

/// The files of a folder that make up a recording, in the order of their names; a `.pvd` list stands for its frames.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut paths: Vec<PathBuf> = entries
        .filter(|path| path.is_file() && path.file_name().is_some_and(|name| name != STEP))
        .collect();
    paths.sort();
    match paths.iter().find(|path| path.extension().is_some_and(|ending| ending == "pvd")) {
        Some(list) => vec![list.clone()],
        None => paths,
    }
}
