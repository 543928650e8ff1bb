//! From options to a scheme, and the combinations that make none.

use anyhow::{Result, bail};
use mmsmith_verify as verify;

use crate::arguments::{Composition, Frame, Grid, Layout, Mass, SchemeOptions, Shape};

/// The weights of the updated frame, and the frame with its own scheme.
pub(super) fn of(options: &SchemeOptions) -> Result<(verify::Shape, verify::Frame)> {
    let name = format!("{:?}", options.shape).to_lowercase();
    let updated = match options.shape {
        Shape::Linear => Ok(verify::Shape::Linear),
        Shape::Ugimp => Ok(verify::Shape::Ugimp),
        Shape::Gimp => Ok(verify::Shape::Gimp),
        Shape::Bspline2 => Err(2),
        Shape::Bspline3 => Err(3),
        Shape::Bspline4 => Err(4),
        Shape::Bspline5 => Err(5),
    };
    match (options.frame, updated) {
        (Frame::Updated, Ok(shape)) => {
            let total_only = [
                ("--mass consistent", options.mass == Some(Mass::Consistent)),
                (
                    "--composition",
                    options.composition.is_some_and(|order| order != Composition::Order2),
                ),
                ("--layout gauss", options.layout == Layout::Gauss),
                ("--grid polar", options.grid == Grid::Polar),
            ];
            if let Some((option, _)) = total_only.iter().find(|(_, given)| *given) {
                bail!("{option}: the updated frame has none; use it with --frame total");
            }
            Ok((shape, verify::Frame::Updated))
        }
        (Frame::Updated, Err(_)) => {
            bail!("--shape {name}: splines need the reference configuration; add --frame total")
        }
        (Frame::Total, Ok(_)) => {
            bail!("--shape {name}: the total frame takes bspline2, bspline3, bspline4 or bspline5")
        }
        (Frame::Total, Err(degree)) => {
            let mut total = verify::TotalScheme::of_degree(degree);
            if let Some(mass) = options.mass {
                total.scheme.mass = mass.into();
            }
            if let Some(composition) = options.composition {
                total.scheme.composition = match composition {
                    Composition::Order2 => verify::Composition::Order2,
                    Composition::Order4 => verify::Composition::Order4,
                    Composition::Order6 => verify::Composition::Order6,
                };
            }
            total.layout = options.layout.into();
            total.coordinates = options.grid.into();
            // The updated frame's weights are not used.
            Ok((verify::Shape::Gimp, verify::Frame::Total(total)))
        }
    }
}

/// The mass matrix and the order in time that a run has, given or not.
pub(super) fn echo(options: &SchemeOptions) -> (Mass, usize) {
    match of(options) {
        Ok((_, verify::Frame::Total(total))) => {
            let mass = match total.scheme.mass {
                verify::MassMatrix::Lumped => Mass::Lumped,
                verify::MassMatrix::Consistent => Mass::Consistent,
            };
            (mass, total.scheme.composition.order())
        }
        _ => (Mass::Lumped, 2),
    }
}

/// The scheme of the total frame in words.
pub(super) fn words(options: &SchemeOptions) -> String {
    let word = |value: &dyn std::fmt::Debug| format!("{value:?}").to_lowercase();
    let (mass, order) = echo(options);
    format!(
        " of order {order}, total frame, {} mass, {} layout, {} grid",
        word(&mass),
        word(&options.layout),
        word(&options.grid)
    )
}
