//! `mms run`: one simulation.

use std::ffi::OsString;
use std::path::PathBuf;

use anyhow::{Context, Result};
use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    Case, Checkpoints, FrameOutput, Moment, Outputs, Parts, Row, RunTraffic, Scheme, Status,
    energy_drift, run as simulate,
};
use serde_json::{Value, json};

use super::picture::Picture;
use super::remedy::{Advice, Given};
use super::scheme::Settled;
use super::{Model, caption, checkpoint_folder, inversion, settings, with_threads};
use crate::arguments::RunOptions;
use crate::interruption::is_interrupted;
use crate::json::{Output, prepare_folder};
use crate::library::Selection;
use crate::progress::Bar;
use crate::svg::{Course, Drift};
use crate::table::{self, Table};
use crate::units::{self, Units};
use crate::{csv, number, processes, terminal};

/// A run, by the words of its command line.
pub(crate) fn run(options: &RunOptions, line: &[OsString]) -> Result<bool> {
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
    let model = Model::new(&selection, options.scheme.precision)?;
    let settled = &Settled::settle(&options.scheme, &model.exact)?;
    let cells = options.cells.unwrap_or(settled.case.cells);
    let case = Case { cells, ..settled.case };
    let extent = model.admit(&[case])?;
    let keeps_history = options.history.is_some() || options.plot.is_some();
    let prepare = |path: &Option<PathBuf>| Output::prepare_if(path.as_ref());
    let [output, history, plot] = [&settled.json, &options.history, &options.plot].map(prepare);
    let (output, history, plot) = (output?, history?, plot?);
    if let Some(folder) = options.vtk.as_ref().filter(|_| processes::is_first()) {
        prepare_folder(folder).context("--vtk")?;
    }
    let mut picture = Picture::asked(&options.picture, case.periods)?;
    let mut moments = keeps_history.then(Vec::new);
    let frames = options.vtk.as_ref().map(|folder| FrameOutput {
        folder: folder.clone(),
        name: selection.name().to_owned(),
        count: options.frames,
        provenance: Some(selection.provenance()),
    });
    let settings = || settings(&selection, settled, extent, cells, case.cfl);
    // Nothing is left in the folder of a run that cannot begin.
    let place = match (origin, &options.checkpoint) {
        (Origin::Line(line), Some(folder)) => Some(checkpoint_folder::remember(folder, line)?),
        (Origin::Line(_), None) => None,
        (Origin::Checkpoint(place), _) => Some(place),
    };
    let mut traffic = RunTraffic::default();
    let checkpoints = match place {
        Some(place) => Some(checkpoint_folder::checkpoints(place, options, &settings())?),
        None => None,
    };
    with_threads(settled.threads, || {
        let row = {
            let expected = model.announce(&[case]);
            let bar = Bar::expecting("starting", expected.map(|seconds| seconds.iter().sum()));
            let what = format!("{cells} cells");
            let show = &mut |progress| bar.show(&what, progress);
            let mut outputs = Outputs {
                frames: frames.as_ref(),
                checkpoints: checkpoints.as_ref(),
                history: moments.as_mut(),
                snapshot: picture.as_mut().map(Picture::snapshot),
                ranks: processes::ranks(),
                traffic: Some(&mut traffic),
                ..Outputs::new(show)
            };
            let row = simulate(&model.exact, model.arithmetic(), &case, &mut outputs);
            let row = row.map_err(anyhow::Error::new);
            match &checkpoints {
                Some(Checkpoints { folder, .. }) if row.as_ref().is_err_and(is_interrupted) => {
                    let folder = folder.path().display();
                    row.with_context(|| format!("mms resume {folder} goes on from there"))?
                }
                _ => row?,
            }
        };
        processes::tell_traffic(&traffic);
        let caption = caption(&selection, settled, extent);
        let told = text(&row, Units::of(&selection));
        terminal::say(&(settled.choice() + &caption + &told))?;
        let inverted = match row.status.passed() {
            Some(false) => inversion::measure(&selection)?,
            _ => None,
        };
        if let Some(told) = &inverted {
            terminal::say(&format!("{}\n", told.text()))?;
        }
        // Nothing runs a motion that turns the body inside out.
        let advice = match inverted {
            Some(_) => None,
            None => {
                let given = Given::of(&options.name, &options.scheme);
                Advice::seek(given, &model, &case, &row)?
            }
        };
        if let Some(advice) = &advice {
            terminal::say(&advice.text())?;
        }
        if let Some(frames) = &frames {
            let list = frames.folder.join(format!("{}.pvd", frames.name));
            terminal::say(&format!("particle files: {}\n", list.display()))?;
        }
        if let Some(file) = history {
            file.write_text(&csv::history(moments.as_deref().unwrap_or_default()))?;
        }
        if let Some(file) = plot {
            let Parts { shape, integrator, .. } = case.scheme.parts();
            let curve = match case.scheme {
                Scheme::Total(_) => shape,
                Scheme::Updated(_) => format!("{shape} + {integrator}"),
            };
            let course = course(curve, &model, moments.as_deref().unwrap_or_default());
            let title = format!("{}: drift of energy, {cells} cells", selection.name());
            file.write_text(&drift_plot(&title, vec![course]))?;
        }
        if let Some(output) = output {
            let mut document = json!({
                "schema": "mmsmith.run/1",
                "settings": settings(),
                "passed": row.status.passed(),
                "result": row,
            });
            if let Some(inverted) = &inverted {
                document["inverted"] = json!(inverted);
            }
            if let Some(advice) = &advice {
                document["advice"] = advice.document();
            }
            if let Some(moments) = &moments {
                document["history"] = history_document(moments);
            }
            output.write(&document)?;
        }
        // Last, since a run that stopped may have no picture.
        if let Some(picture) = picture {
            let note = super::setting(&selection, settled, extent);
            let written = picture.write(&selection, &row, &format!("{note}, {cells} cells"));
            match written {
                Err(error) if row.status.passed() == Some(false) => terminal::error(error),
                written => written?,
            }
        }
        Ok(row.status.passed() != Some(false))
    })
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
