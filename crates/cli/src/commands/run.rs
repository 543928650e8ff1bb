//! `mms run`: one simulation.

use anyhow::Result;
use mmsmith_verify::{FrameOutput, Outputs, Row, Status, run as simulate};
use serde_json::json;

use super::{Model, caption, case, resume, settings, with_threads};
use crate::arguments::RunOptions;
use crate::json::Output;
use crate::library::Selection;
use crate::progress::Bar;
use crate::table::{self, Table};
use crate::terminal;

pub(crate) fn run(options: &RunOptions) -> Result<bool> {
    if let Some(folder) = &options.checkpoint {
        resume::remember(folder)?;
    }
    follow(options, false)
}

/// The run, from its beginning or from its last checkpoint.
pub(super) fn follow(options: &RunOptions, resume: bool) -> Result<bool> {
    let scheme = &options.scheme;
    let selection = Selection::new(&options.name, &scheme.parameters.set)?;
    let model = Model::new(&selection, scheme.precision)?;
    let scheme = &scheme.for_solution(&model.exact);
    let case = case(scheme, options.cells)?;
    let extent = model.admit(&[case])?;
    let output = Output::prepare_if(scheme.json.as_ref())?;
    let frames = options.vtk.as_ref().map(|folder| FrameOutput {
        folder: folder.clone(),
        name: selection.name().to_owned(),
        count: options.frames,
    });
    let settings = || settings(&selection, scheme, extent, options.cells, scheme.cfl);
    let checkpoints = match &options.checkpoint {
        Some(folder) => Some(resume::checkpoints(folder, options, &settings(), resume)?),
        None => None,
    };
    with_threads(scheme.threads, || {
        let row = {
            let expected = model.announce(&[case]);
            let bar = Bar::expecting(expected.map(|seconds| seconds.iter().sum()));
            let what = format!("{} cells", options.cells);
            let mut outputs = Outputs {
                progress: &mut |progress| bar.show(&what, progress),
                frames: frames.as_ref(),
                checkpoints: checkpoints.as_ref(),
                until: None,
            };
            simulate(&model.exact, model.arithmetic(), &case, &mut outputs)?
        };
        terminal::say(&(caption(&selection, scheme, extent) + &text(&row)))?;
        if let Some(frames) = &frames {
            let list = frames.folder.join(format!("{}.pvd", frames.name));
            terminal::say(&format!("particle files: {}\n", list.display()))?;
        }
        if let Some(output) = output {
            output.write(&json!({
                "schema": "mmsmith.run/1",
                "settings": settings(),
                "result": row,
            }))?;
        }
        Ok(true)
    })
}

fn text(row: &Row) -> String {
    let mut text = format!(
        "{} cells, h = {:?}, {} particles, {} steps of dt = {:?}, CFL {}\n",
        row.cells, row.h, row.particles, row.steps, row.dt, row.cfl
    );
    if row.status == Status::Ok {
        text += "status: ok\n";
    } else {
        text += &format!("STOPPED: {}\nThe errors are those until then.\n", row.status);
    }
    let mut table = Table::new(1, ["error", "linf", "l2", "l1"]);
    for (field, norms) in row.errors.named() {
        let mut cells = vec![field.to_owned()];
        cells.extend(norms.named().map(|(_, value)| table::error(*value)));
        table.row(cells);
    }
    text += &table.text();
    text += &format!(
        "stepping took {:.3} s: {:.3e} particle-steps per second\n",
        row.wall_s, row.particle_steps_per_s
    );
    text
}
