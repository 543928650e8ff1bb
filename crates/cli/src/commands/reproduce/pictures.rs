//! Stress pictures of the particles, from the particle files themselves.

use std::path::Path;

use anyhow::{Context, Result};
use mmsmith_verify::{Case, FrameOutput, Outputs, Shape};
use mmsmith_vtk::{Frame, read};

use super::{CD, FRAMES, GRID, PROBLEMS};
use crate::arguments::Stress;
use crate::commands::picture::{View, draw, range};
use crate::commands::problem::Model;
use crate::commands::scheme::usual;
use crate::library::Selection;
use crate::number;
use crate::svg::extremes;
use crate::units::Units;

/// The frame of the square's picture: five eighths of the period, where both directions move.
const MOMENT: u64 = 5 * (FRAMES - 1) / 8;
/// The folder of the run that is shown beside the right one.
const CONTRAST: &str = "particles-ugimp";

/// Writes the particles of ugimp+cd at the moment of the picture, as a contrast to the right answer.
pub(super) fn write_contrast(
    selection: &Selection,
    model: &Model,
    problem: &str,
    folder: &Path,
) -> Result<()> {
    if problem != PROBLEMS[0] {
        return Ok(());
    }
    let periods = MOMENT as f64 / (FRAMES - 1) as f64;
    let case = Case { periods, ..usual(Shape::Ugimp, CD, GRID) };
    let provenance = Some(selection.provenance());
    let frames = FrameOutput {
        folder: folder.join(CONTRAST),
        name: problem.to_owned(),
        count: 2,
        provenance,
    };
    let silent = &mut |_| ();
    let mut outputs = Outputs { frames: Some(&frames), ..Outputs::new(silent) };
    model.discretized(&case)?.run(&mut outputs)?;
    Ok(())
}

/// A picture with the words that belong to it.
pub(super) struct Picture {
    pub(super) svg: String,
    pub(super) caption: String,
}

/// All pictures of a problem; `out` holds its folder.
pub(super) fn all(problem: &str, out: &Path) -> Result<Vec<Picture>> {
    let folder = out.join(problem);
    if problem == PROBLEMS[0] {
        let right = frame(&folder.join("particles"), problem, MOMENT)?;
        let other = frame(&folder.join(CONTRAST), problem, 1)?;
        let range = range(&Stress::VonMises.values(&right)?);
        let draw = |frame: &Frame, scheme: &str, said: &str| -> Result<Picture> {
            let values = Stress::VonMises.values(frame)?;
            let title = capitalized(&format!("{}, {scheme}", Stress::VonMises.words()));
            Ok(picture(&title, frame, &values, range, said))
        };
        return Ok(vec![
            draw(&right, "gimp+cd", "Rows and columns stay straight: the right answer.")?,
            draw(
                &other,
                "ugimp+cd",
                "Particles of fixed size: the same motion, on the same colours.",
            )?,
        ]);
    }
    let frame = frame(&folder.join("particles"), problem, FRAMES - 1)?;
    let draw = |stress: Stress, said: &str| -> Result<Picture> {
        let values = stress.values(&frame)?;
        let title = capitalized(&format!("{}, gimp+cd", stress.words()));
        Ok(picture(&title, &frame, &values, range(&values), said))
    };
    Ok(vec![
        draw(
            Stress::Radial,
            "The rims are free: what is not zero there is the stair steps' doing.",
        )?,
        draw(Stress::Hoop, "Along circles, largest at the inner rim.")?,
    ])
}

/// With the first letter as at the start of a sentence.
fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn picture(title: &str, frame: &Frame, values: &[f64], range: (f64, f64), said: &str) -> Picture {
    let svg = draw(title, (frame, View::Plane), values, range, Some(Units::SI), "");
    let (least, most) = extremes(values.iter().copied());
    let caption = format!(
        "{title}, at t = {} s: {} particles at their current positions, from {} to {} Pa. The colour bar spans 98 % of the \
         particles of gimp+cd. {said}",
        number::rounded(frame.time, 4),
        frame.points.len(),
        number::rounded(least, 3),
        number::rounded(most, 3)
    );
    Picture { svg, caption }
}

fn frame(folder: &Path, problem: &str, index: u64) -> Result<Frame> {
    let path = folder.join(format!("{problem}-{index:06}.vtu"));
    read(&path).with_context(|| format!("cannot read {} back", path.display()))
}
