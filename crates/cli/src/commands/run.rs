//! `mms run`: one simulation.

use std::ffi::OsString;

use anyhow::{Context, Result, bail};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Case, Checkpoints, Discretized, FrameOutput, Moment, Outputs, Profile, Row, RunTraffic, Scheme,
    Status, energy_drift, is_axisymmetric,
};
use serde_json::{Map, Value, json};

use super::growth::Warnings;
use super::picture::Picture;
use super::predict::announce;
use super::problem::{Model, Problem};
use super::remedy::{Advice, Given};
use super::{checkpoint_folder, inversion, profile, statics};
use crate::arguments::RunOptions;
use crate::interruption::is_interrupted;
use crate::json::{Output, prepare_folder};
use crate::library::Selection;
use crate::processes::with_threads;
use crate::progress::Bar;
use crate::report::{Asked, Form, Report, Section};
use crate::svg::{Course, Drift};
use crate::table::{self, Table};
use crate::units::{self, Units};
use crate::{number, processes, sheets, terminal};

/// Particle files of a run where their number is not said.
const USUAL_FRAMES: u64 = 20;

/// A run, by the words of its command line.
pub(crate) fn run(options: &RunOptions, line: &[OsString]) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let of_time = [
        ("--checkpoint", options.checkpoint.is_some()),
        ("--history", options.history.is_some()),
        ("--plot", options.plot.is_some()),
        ("--picture", options.picture.file.is_some()),
        ("--frames", options.frames.is_some()),
        ("--profile", options.profile),
    ];
    if statics::is_asked(&selection, &options.statics, &options.scheme, &of_time)? {
        return match &options.along {
            Some((name, values)) => statics::along(&selection, options, name, values),
            None => statics::run(selection, options),
        };
    }
    if options.along.is_some() {
        bail!("--along: only an equilibrium has load levels; add --static");
    }
    follow(options, Origin::Line(line))
}

/// Where a run comes from.
pub(super) enum Origin<'a> {
    /// The words of a command line.
    Line(&'a [OsString]),
    /// The last checkpoint in a folder.
    Checkpoint(checkpoint_folder::Place),
}

/// The run, from its beginning or from its last checkpoint.
pub(super) fn follow(options: &RunOptions, origin: Origin<'_>) -> Result<bool> {
    let selection = Selection::new(&options.name, &options.scheme.parameters.set)?;
    let problem = &Problem::new(selection, &options.scheme)?;
    let cells = options.cells.unwrap_or(problem.settled.case.cells);
    let cases = problem.model.admit(&[Case { cells, ..problem.settled.case }])?;
    let [case] = cases.as_slice() else { bail!("a run has one case") };
    let files = Asked(vec![(Form::Json, &options.scheme.json)]).prepare()?;
    let history = Output::prepare_if(options.history.as_ref())?;
    let plot = Output::prepare_if(options.plot.as_ref())?;
    if let Some(folder) = options.vtk.as_ref().filter(|_| processes::is_first()) {
        prepare_folder(folder).context("--vtk")?;
    }
    let mut picture = Picture::asked(&options.picture, case.case().periods)?;
    // Nothing is left in the folder of a run that cannot begin.
    let place = match (origin, &options.checkpoint) {
        (Origin::Line(line), Some(folder)) => Some(checkpoint_folder::remember(folder, line)?),
        (Origin::Line(_), None) => None,
        (Origin::Checkpoint(place), _) => Some(place),
    };
    let settings = || problem.settings(case.plan().extent, cells, case.case().cfl);
    let checkpoints = match place {
        Some(place) => Some(checkpoint_folder::checkpoints(place, options, &settings())?),
        None => None,
    };
    with_threads(options.scheme.threads, || {
        let ran = simulate(options, problem, case, checkpoints.as_ref(), picture.as_mut())?;
        let report = ran.report(options, problem, case)?;
        terminal::say(&report.text())?;
        if let Some(file) = history {
            let is_of_revolution = is_axisymmetric(&problem.model.exact);
            file.write_text(&sheets::history(ran.moments(), is_of_revolution).csv()?)?;
        }
        if let Some(file) = plot {
            file.write_text(&ran.drift(problem, case.case()))?;
        }
        report.write(files)?;
        let passed = ran.row.status.passed() != Some(false);
        // Last, since a run that stopped may have no picture.
        if let Some(picture) = picture {
            let note = format!("{}, {cells} cells", problem.setting(case.plan().extent));
            match picture.write(
                &problem.selection,
                is_axisymmetric(&problem.model.exact),
                &ran.row,
                &note,
            ) {
                Err(error) if !passed => terminal::error(error),
                written => written?,
            }
        }
        Ok(passed)
    })
}

/// A run that has ended.
struct Ran {
    row: Row,
    /// Where a history is kept.
    moments: Option<Vec<Moment>>,
    /// Where the time went, if that is asked.
    profile: Option<Profile>,
}

/// Simulates a case.
fn simulate(
    options: &RunOptions,
    problem: &Problem,
    case: &Discretized<'_>,
    checkpoints: Option<&Checkpoints>,
    picture: Option<&mut Picture>,
) -> Result<Ran> {
    let keeps_history = options.history.is_some() || options.plot.is_some();
    let mut moments = keeps_history.then(Vec::new);
    let frames = options.vtk.as_ref().map(|folder| FrameOutput {
        folder: folder.clone(),
        name: problem.selection.name().to_owned(),
        count: options.frames.unwrap_or(USUAL_FRAMES),
        provenance: Some(problem.selection.provenance()),
    });
    let mut traffic = RunTraffic::default();
    let mut profile = options.profile.then(Profile::default);
    let row = {
        let expected = announce(std::slice::from_ref(case));
        let bar = Bar::expecting("starting", expected.map(|seconds| seconds.iter().sum()));
        let what = format!("{} cells", case.case().cells);
        let show = &mut |progress| bar.show(&what, progress);
        let mut outputs = Outputs {
            frames: frames.as_ref(),
            checkpoints,
            history: moments.as_mut(),
            snapshot: picture.map(Picture::snapshot),
            ranks: processes::arranged(options.process_grid.as_ref())?,
            traffic: Some(&mut traffic),
            profile: profile.as_mut(),
            ..Outputs::new(show)
        };
        let row = case.run(&mut outputs).map_err(anyhow::Error::new);
        match checkpoints {
            Some(Checkpoints { folder, .. }) if row.as_ref().is_err_and(is_interrupted) => {
                let folder = folder.path().display();
                row.with_context(|| format!("mms resume {folder} goes on from there"))?
            }
            _ => row?,
        }
    };
    processes::tell_traffic(&traffic);
    Ok(Ran { row, moments, profile })
}

impl Ran {
    fn moments(&self) -> &[Moment] {
        self.moments.as_deref().unwrap_or_default()
    }

    fn report(
        &self,
        options: &RunOptions,
        problem: &Problem,
        case: &Discretized<'_>,
    ) -> Result<Report> {
        let Problem { selection, model, settled } = problem;
        let Self { row, moments, profile } = self;
        let passed = row.status.passed();
        let mut said = text(row, Units::of(selection));
        let inverted = match passed {
            Some(false) => inversion::measure(selection)?,
            _ => None,
        };
        let mut results = Map::new();
        results.insert("result".into(), json!(row));
        results.insert("passed".into(), json!(passed));
        // Nothing runs a motion that turns the body inside out.
        if let Some(inverted) = &inverted {
            said += &format!("{}\n", inverted.text());
            results.insert("inverted".into(), json!(inverted));
        } else if let Some(advice) =
            Advice::seek(Given::of(&options.name, &options.scheme), model, case.case(), row)?
        {
            said += &advice.text();
            results.insert("advice".into(), advice.document());
        }
        let warnings = Warnings::of(problem);
        said += &warnings.text();
        warnings.insert(&mut results);
        if let Some(folder) = &options.vtk {
            let list = folder.join(format!("{}.pvd", selection.name()));
            said += &format!("particle files: {}\n", list.display());
        }
        if let Some(profile) = profile {
            said += &profile::text(profile, row.particles);
            results.insert("profile".into(), profile::document(profile));
        }
        if let Some(moments) = moments {
            if moments.first().is_some_and(|start| start.exact.strain_energy.is_nan()) {
                said += "The law has no strain energy: --history has nan for it, and --plot no curve.\n";
            }
            results.insert("history".into(), history_document(moments));
        }
        let (extent, Case { cells, cfl, .. }) = (case.plan().extent, *case.case());
        Ok(Report {
            command: "run",
            preface: settled.choice(),
            caption: problem.caption(extent),
            sections: vec![Section::Note(said)],
            settings: problem.settings(extent, cells, cfl),
            results,
            verdict: passed,
        })
    }

    /// A picture of the drift of energy.
    fn drift(&self, problem: &Problem, case: &Case) -> String {
        let shape = case.scheme.shape();
        let curve = match case.scheme {
            Scheme::Total(_) => shape,
            Scheme::Updated(updated) => format!("{shape} + {}", updated.integrator),
        };
        let course = course(curve, &problem.model, self.moments());
        let name = problem.selection.name();
        drift_plot(&format!("{name}: drift of energy, {} cells", case.cells), vec![course])
    }
}

/// A history as arrays of one length; each momentum is an array by axis.
pub(super) fn history_document(history: &[Moment]) -> Value {
    let each = |value: &dyn Fn(&Moment) -> Value| history.iter().map(value).collect::<Value>();
    json!({
        "step": each(&|moment| moment.step.into()),
        "time": each(&|moment| moment.time.into()),
        "velocity_time": each(&|moment| moment.velocity_time.into()),
        "u_linf": each(&|moment| moment.u.linf.into()),
        "u_l2": each(&|moment| moment.u.l2.into()),
        "u_l1": each(&|moment| moment.u.l1.into()),
        "kinetic_energy": each(&|moment| moment.computed.kinetic_energy.into()),
        "strain_energy": each(&|moment| moment.computed.strain_energy.into()),
        "momentum": each(&|moment| moment.computed.momentum.clone().into()),
        "exact_kinetic_energy": each(&|moment| moment.exact.kinetic_energy.into()),
        "exact_strain_energy": each(&|moment| moment.exact.strain_energy.into()),
        "exact_momentum": each(&|moment| moment.exact.momentum.clone().into()),
    })
}

/// The drift of energy over periods of the solution.
pub(super) fn course(name: String, model: &Model, history: &[Moment]) -> Course {
    let period = match &model.exact {
        AnySolution::One(exact) => exact.period(),
        AnySolution::Two(exact) => exact.period(),
        AnySolution::Three(exact) => exact.period(),
        // Then over time as it is.
        _ => 1.0,
    };
    let points = energy_drift(history).into_iter().map(|(time, drift)| (time / period, drift));
    Course { name, points: points.collect() }
}

/// Curves of the drift of energy.
pub(super) fn drift_plot(title: &str, curves: Vec<Course>) -> String {
    let y = "energy, solver - exact, over the largest exact";
    Drift { title, x: "periods", y, curves }.svg()
}

/// Digits of a time step and of a CFL number; --json has all.
const DIGITS: usize = 4;

fn text(row: &Row, units: Option<Units>) -> String {
    let [m, s] = [units.map(Units::length), units.map(Units::time)]
        .map(|unit| unit.map_or_else(String::new, |unit| format!(" {unit}")));
    let mut text = format!(
        "{} cells, h = {}{m}, {} particles, {} steps of dt = {}{s}, CFL {}\n",
        row.cells,
        number::rounded(row.h, DIGITS),
        row.particles,
        row.steps,
        number::rounded(row.dt, DIGITS),
        number::rounded(row.cfl, DIGITS)
    );
    if row.status == Status::Ok || row.status.is_not_judged() {
        text += &format!("status: {}\n", row.status);
    } else {
        text += &format!("STOPPED: {}\nThe errors are those until then.\n", row.status);
    }
    let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
    for (field, norms) in row.errors.iter() {
        let mut cells = vec![units::named(field, units)];
        cells.extend(norms.iter().map(|(_, value)| table::error(*value)));
        table.row(cells);
    }
    text += &table.text();
    text += &format!(
        "stepping took {:.3} s: {:.3e} particle-steps per second\n",
        row.wall_s, row.particle_steps_per_s
    );
    text
}
