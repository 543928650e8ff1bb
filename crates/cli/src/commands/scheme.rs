//! From options to a scheme, and the combinations that make none.

use anyhow::{Result, bail};
use mmsmith_verify as verify;

use crate::arguments::{Composition, Frame, Grid, Layout, Mass, SchemeOptions, Shape};

/// The weights of the updated frame, and the frame with its own scheme.
pub(super) fn of(options: &SchemeOptions) -> Result<(verify::Shape, verify::Frame)> {
    match options.frame {
        Frame::Updated => Ok((updated(options)?, verify::Frame::Updated)),
        // The updated frame's weights are not used.
        Frame::Total => Ok((verify::Shape::Gimp, verify::Frame::Total(total(options)?))),
    }
}

/// Where the particles of the updated frame lie.
pub(super) fn placement(options: &SchemeOptions) -> Result<verify::Placement> {
    match (options.frame, options.layout()) {
        (Frame::Total, Layout::BodyFitted) => {
            bail!(
                "--layout body-fitted: the total frame fits a ring by --grid polar; use --layout gauss or lattice with it"
            )
        }
        (Frame::Updated, Layout::BodyFitted) => Ok(verify::Placement::BodyFitted),
        _ => Ok(verify::Placement::Lattice),
    }
}

fn updated(options: &SchemeOptions) -> Result<verify::Shape> {
    let total_only = [
        ("--mass consistent", options.mass == Some(Mass::Consistent)),
        ("--composition", options.composition.is_some_and(|order| order != Composition::Order2)),
        ("--layout gauss", options.layout() == Layout::Gauss),
        ("--grid polar", options.grid() == Grid::Polar),
        ("--grid spherical", options.grid() == Grid::Spherical),
    ];
    if let Some((option, _)) = total_only.iter().find(|(_, given)| *given) {
        bail!("{option}: the updated frame has none; use it with --frame total");
    }
    Ok(match options.shape {
        Shape::Linear => verify::Shape::Linear,
        Shape::Ugimp => verify::Shape::Ugimp,
        Shape::Gimp => verify::Shape::Gimp,
        Shape::Bspline2 => verify::Shape::Bspline2,
        Shape::Bspline3 => verify::Shape::Bspline3,
        Shape::Cpdi => verify::Shape::Cpdi,
        Shape::Cpdi2 => verify::Shape::Cpdi2,
        Shape::Bspline4 | Shape::Bspline5 => {
            let name = word(&options.shape);
            bail!(
                "--shape {name}: splines of this degree need the reference configuration; add --frame total, or take \
                 bspline2 or bspline3"
            )
        }
    })
}

fn total(options: &SchemeOptions) -> Result<verify::TotalScheme> {
    let degree = match options.shape {
        Shape::Bspline2 => 2,
        Shape::Bspline3 => 3,
        Shape::Bspline4 => 4,
        Shape::Bspline5 => 5,
        _ => bail!(
            "--shape {}: the total frame takes bspline2, bspline3, bspline4 or bspline5",
            word(&options.shape)
        ),
    };
    if options.transfer != verify::Transfer::Flip {
        bail!(
            "--transfer {}: the total frame keeps velocities on the grid, and has nothing to transfer; use it with \
             --frame updated",
            options.transfer
        );
    }
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
    total.layout = match options.layout() {
        Layout::Gauss => verify::Layout::Gauss,
        Layout::Lattice | Layout::BodyFitted => verify::Layout::Lattice,
    };
    total.coordinates = options.grid().into();
    Ok(total)
}

/// What is not said by weights and integrator, where it is not the usual.
pub(super) fn additions(options: &SchemeOptions) -> String {
    let mut text = String::new();
    if options.transfer != verify::Transfer::Flip {
        text += &format!(", transfer {}", options.transfer);
    }
    if options.layout() == Layout::BodyFitted {
        text += ", body-fitted layout";
    }
    text
}

fn word(value: &dyn std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
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
    let (mass, order) = echo(options);
    let part = match options.grid() {
        Grid::Cartesian | Grid::Polar => String::new(),
        Grid::Spherical => {
            let [from, to] = verify::POLAR_ANGLES.map(f64::to_degrees);
            format!(" from {from} to {to} degrees off the third axis")
        }
    };
    format!(
        " of order {order}, total frame, {} mass, {} layout, {} grid{part}",
        word(&mass),
        word(&options.layout()),
        word(&options.grid())
    )
}
