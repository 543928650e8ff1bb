//! Stress pictures of the particles, from the particle files themselves.

use std::path::Path;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{Case, FrameOutput, Outputs, run as simulate};
use mmsmith_vtk::{Frame, Values, read};

use super::{FRAMES, GRID, PROBLEMS};
use crate::arguments::{Integrator, Shape};
use crate::commands::scheme::Scheme;
use crate::commands::{Model, case};
use crate::svg::Particles;

/// The frame of the square's picture: five eighths of the period, where both directions move.
const MOMENT: u64 = 5 * (FRAMES - 1) / 8;
/// The folder of the run that is shown beside the right one.
const CONTRAST: &str = "particles-ugimp";

/// Writes the particles of ugimp+cd at the moment of the picture, as a contrast to the right answer.
pub(super) fn write_contrast(model: &Model, problem: &str, folder: &Path) -> Result<()> {
    if problem != PROBLEMS[0] {
        return Ok(());
    }
    let base = case(&Scheme::usual(Shape::Ugimp, Integrator::Cd), GRID)?;
    let case = Case { periods: MOMENT as f64 / (FRAMES - 1) as f64, ..base };
    let frames = FrameOutput { folder: folder.join(CONTRAST), name: problem.to_owned(), count: 2 };
    let silent = &mut |_| ();
    let mut outputs = Outputs { frames: Some(&frames), ..Outputs::new(silent) };
    simulate(&model.exact, model.arithmetic(), &case, &mut outputs)?;
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
        let range = range(&scalar(&right, "von_mises")?);
        let draw = |frame: &Frame, scheme: &str, said: &str| -> Result<Picture> {
            let values = scalar(frame, "von_mises")?;
            let title = format!("Von Mises stress, {scheme}");
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
    let stress = frame.arrays.iter().find(|array| array.name == "stress");
    let Some(Values::Tensor(stress)) = stress.map(|array| &array.values) else {
        bail!("the particle files of {problem} hold no stress")
    };
    // Along the position, and across it.
    let along = |turned: bool| -> Vec<f64> {
        let each = frame.points.iter().zip(stress).map(|(x, s)| {
            let length = x[0].hypot(x[1]);
            let (c, n) = (x[0] / length, x[1] / length);
            let e = if turned { [-n, c] } else { [c, n] };
            e[0] * (s[0] * e[0] + s[1] * e[1]) + e[1] * (s[3] * e[0] + s[4] * e[1])
        });
        each.collect()
    };
    let (radial, hoop) = (along(false), along(true));
    let said = "The rims are free: what is not zero there is the stair steps' doing.";
    Ok(vec![
        picture("Radial stress, gimp+cd", &frame, &radial, range(&radial), said),
        picture(
            "Hoop stress, gimp+cd",
            &frame,
            &hoop,
            range(&hoop),
            "Along circles, largest at the inner rim.",
        ),
    ])
}

fn picture(title: &str, frame: &Frame, values: &[f64], range: (f64, f64), said: &str) -> Picture {
    let points: Vec<[f64; 2]> = frame.points.iter().map(|p| [p[0], p[1]]).collect();
    let svg = Particles { title, points: &points, values, range, unit: "Pa" }.svg();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let caption = format!(
        "{title}, at t = {} s, {} particles, from {least:.0} to {most:.0} Pa. The bar spans 98 % of the particles of \
         gimp+cd. {said}",
        frame.time,
        points.len()
    );
    Picture { svg, caption }
}

/// The values between which 98 % of them lie, so that single particles do not take the colours from the rest.
fn range(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let at =
        |share: f64| sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0);
    (at(0.01), at(0.99))
}

fn frame(folder: &Path, problem: &str, index: u64) -> Result<Frame> {
    let path = folder.join(format!("{problem}-{index:06}.vtu"));
    read(&path).with_context(|| format!("cannot read {} back", path.display()))
}

fn scalar(frame: &Frame, name: &str) -> Result<Vec<f64>> {
    match frame.arrays.iter().find(|array| array.name == name).map(|array| &array.values) {
        Some(Values::Scalar(values)) => Ok(values.clone()),
        _ => bail!("the particle files hold no {name}"),
    }
}
