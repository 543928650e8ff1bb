//! From options to a scheme, and the combinations that make none.

use std::path::PathBuf;

use anyhow::{Result, bail};
use mmsmith_solutions::{AnySolution, Boundary};
use mmsmith_verify as verify;

use crate::arguments::{
    CflSpeed, Composition, Extent, Frame, Grid, Integrator, Layout, Mass, Precision, SchemeOptions,
    Shape, Start, word,
};

/// The CFL number where nothing is said, and nothing else of the scheme was chosen for the solution.
pub(super) const USUAL_CFL: f64 = 0.4;
/// The number of cells where nothing is said.
pub(super) const USUAL_CELLS: usize = 32;
/// The same for a solid of three dimensions in a total frame that was not asked for, whose cells have 64 particles each.
const USUAL_CELLS_OF_SOLIDS: usize = 16;
/// Particles in a cell along each direction, but for Gauss points.
const USUAL_PER_CELL: usize = 2;

/// How to simulate, with nothing left open: what was said, and what suits the solution where nothing was.
#[derive(Clone)]
pub(super) struct Scheme {
    pub(super) shape: Shape,
    pub(super) frame: Frame,
    /// The total frame's own where it is left out.
    pub(super) mass: Option<Mass>,
    /// That of the splines' degree where it is left out.
    pub(super) composition: Option<Composition>,
    pub(super) layout: Layout,
    pub(super) grid: Grid,
    pub(super) cfl_speed: CflSpeed,
    pub(super) integrator: Integrator,
    pub(super) transfer: verify::Transfer,
    pub(super) start: Start,
    pub(super) ppc: usize,
    pub(super) cfl: f64,
    pub(super) periods: f64,
    pub(super) extent: Option<Extent>,
    pub(super) offset: f64,
    pub(super) precision: Precision,
    pub(super) threads: Option<usize>,
    pub(super) json: Option<PathBuf>,
    /// What was chosen because the usual scheme would not do, and why.
    pub(super) chosen: Option<Choice>,
}

/// A total frame that was not asked for.
#[derive(Clone)]
pub(super) struct Choice {
    /// The condition that only that frame models; none where the user named the frame and left its splines open.
    reason: Option<Boundary>,
    /// Whether the solution has three dimensions.
    is_solid: bool,
    cfl_is_chosen: bool,
}

impl Scheme {
    /// What holds for a solution that the updated frame models, with the given weights and integrator.
    pub(super) fn usual(shape: Shape, integrator: Integrator) -> Self {
        Self {
            shape,
            frame: Frame::Updated,
            mass: None,
            composition: None,
            layout: Layout::Lattice,
            grid: Grid::Cartesian,
            cfl_speed: CflSpeed::Bar,
            integrator,
            transfer: verify::Transfer::Flip,
            start: Start::Halved,
            ppc: USUAL_PER_CELL,
            cfl: USUAL_CFL,
            periods: 1.0,
            extent: None,
            offset: 0.0,
            precision: Precision::F64,
            threads: None,
            json: None,
            chosen: None,
        }
    }

    /// The scheme that the options leave for a solution. What they say holds; what they leave open is chosen so that the
    /// solution can be run.
    pub(super) fn settle(options: &SchemeOptions, exact: &AnySolution<f64>) -> Self {
        let needed = verify::needs_total_frame(exact);
        let frame = options.frame.unwrap_or(match needed {
            Some(_) if !says_updated(options) => Frame::Total,
            _ => Frame::Updated,
        });
        let fitted = options.layout == Some(Layout::BodyFitted);
        let shape = options.shape.unwrap_or(match frame {
            Frame::Total => Shape::Bspline3,
            // The boxes of GIMP lie along the axes.
            Frame::Updated if fitted => Shape::Cpdi2,
            Frame::Updated => Shape::Gimp,
        });
        let usual_layout = || match (frame, verify::TotalScheme::layout_for(exact)) {
            (Frame::Total, verify::Layout::Gauss) => Layout::Gauss,
            _ => Layout::Lattice,
        };
        let usual_grid = || match (frame, verify::TotalScheme::coordinates_for(exact)) {
            (Frame::Updated, _) | (_, verify::Coordinates::Cartesian) => Grid::Cartesian,
            (_, verify::Coordinates::Polar) => Grid::Polar,
            (_, verify::Coordinates::Spherical) => Grid::Spherical,
        };
        let layout = options.layout.unwrap_or_else(usual_layout);
        let mut settled = Self {
            shape,
            frame,
            mass: options.mass,
            composition: options.composition,
            layout,
            grid: options.grid.unwrap_or_else(usual_grid),
            cfl_speed: options.cfl_speed.unwrap_or(CflSpeed::Bar),
            integrator: options.integrator,
            transfer: options.transfer,
            start: options.start,
            ppc: options.ppc.unwrap_or_else(|| per_cell(layout, shape)),
            cfl: options.cfl.unwrap_or(USUAL_CFL),
            periods: options.periods,
            extent: options.extent,
            offset: options.offset,
            precision: options.precision,
            threads: options.threads,
            json: options.json.clone(),
            chosen: None,
        };
        if frame == Frame::Total && (options.frame.is_none() || options.shape.is_none()) {
            settled.chosen = Some(Choice {
                reason: needed.filter(|_| options.frame.is_none()),
                is_solid: matches!(exact, AnySolution::Three(_)),
                cfl_is_chosen: options.cfl.is_none(),
            });
            if options.cfl.is_none() {
                let speed = options.cfl_speed.unwrap_or(CflSpeed::PWave);
                // What cannot be told from here is refused when the case is looked at.
                if let Ok(total) = total(&settled)
                    && let Ok(cfl) = total.usual_cfl(exact, speed.into())
                {
                    (settled.cfl, settled.cfl_speed) = (cfl, speed);
                }
            }
        }
        settled
    }

    /// The number of cells where nothing is said.
    pub(super) fn usual_cells(&self) -> usize {
        match &self.chosen {
            Some(Choice { reason: Some(_), is_solid: true, .. }) => USUAL_CELLS_OF_SOLIDS,
            _ => USUAL_CELLS,
        }
    }

    /// A line that says what was chosen and why, and one with the options that say the same; empty where all is as usual.
    pub(super) fn choice(&self) -> String {
        let Some(Choice { reason, cfl_is_chosen, .. }) = &self.chosen else { return String::new() };
        let degree = match self.shape {
            Shape::Bspline2 => "quadratic",
            Shape::Bspline3 => "cubic",
            Shape::Bspline4 => "quartic",
            _ => "quintic",
        };
        let grid = match self.grid {
            Grid::Cartesian => "Cartesian",
            Grid::Polar => "polar",
            Grid::Spherical => "spherical",
        };
        let layout = match self.layout {
            Layout::Gauss => "Gauss points",
            Layout::Lattice => "a lattice of particles",
            Layout::BodyFitted => "body-fitted particles",
        };
        let speed = match self.cfl_speed {
            CflSpeed::Bar => "bar waves",
            CflSpeed::PWave => "P-waves",
        };
        let mut text = format!("total Lagrangian, {degree} splines on a {grid} grid, {layout}");
        if *cfl_is_chosen {
            text += &format!(", CFL {} on {speed}", self.cfl);
        }
        if let Some(Boundary { surface, condition }) = reason {
            text +=
                &format!(": the updated formulation does not model {} on {}", condition, surface);
        }
        text += &format!(
            "\n  as with --formulation total-lagrangian --shape {} --grid {} --layout {} --ppc {}",
            word(self.shape),
            word(self.grid),
            word(self.layout),
            self.ppc,
        );
        if *cfl_is_chosen {
            text += &format!(" --cfl {} --cfl-speed {}", self.cfl, word(self.cfl_speed));
        }
        text + "\n"
    }
}

/// Whether the options say something that only the updated frame has.
fn says_updated(options: &SchemeOptions) -> bool {
    let shape = options.shape.is_some_and(|shape| {
        !matches!(shape, Shape::Bspline2 | Shape::Bspline3 | Shape::Bspline4 | Shape::Bspline5)
    });
    shape
        || options.integrator != Integrator::Cd
        || options.transfer != verify::Transfer::Flip
        || options.layout == Some(Layout::BodyFitted)
        || options.offset != 0.0
        || options.precision == Precision::F32
}

/// Particles in a cell along each direction where nothing is said: as many Gauss points as integrate the splines' squares.
fn per_cell(layout: Layout, shape: Shape) -> usize {
    match (layout, shape) {
        (Layout::Gauss, Shape::Bspline2) => 3,
        (Layout::Gauss, Shape::Bspline3) => 4,
        (Layout::Gauss, Shape::Bspline4) => 5,
        (Layout::Gauss, Shape::Bspline5) => 6,
        _ => USUAL_PER_CELL,
    }
}

/// The weights of the updated frame, and the frame with its own scheme.
pub(super) fn of(options: &Scheme) -> Result<(verify::Shape, verify::Frame)> {
    match options.frame {
        Frame::Updated => Ok((updated(options)?, verify::Frame::Updated)),
        // The updated frame's weights are not used.
        Frame::Total => Ok((verify::Shape::Gimp, verify::Frame::Total(total(options)?))),
    }
}

/// Where the particles of the updated frame lie.
pub(super) fn placement(options: &Scheme) -> Result<verify::Placement> {
    match (options.frame, options.layout) {
        (Frame::Total, Layout::BodyFitted) => {
            bail!(
                "--layout body-fitted: the total Lagrangian formulation fits a ring by --grid polar; use --layout gauss or lattice with it"
            )
        }
        (Frame::Updated, Layout::BodyFitted) => Ok(verify::Placement::BodyFitted),
        _ => Ok(verify::Placement::Lattice),
    }
}

fn updated(options: &Scheme) -> Result<verify::Shape> {
    let total_only = [
        ("--mass consistent", options.mass == Some(Mass::Consistent)),
        ("--composition", options.composition.is_some_and(|order| order != Composition::Order2)),
        ("--layout gauss", options.layout == Layout::Gauss),
        ("--grid polar", options.grid == Grid::Polar),
        ("--grid spherical", options.grid == Grid::Spherical),
    ];
    if let Some((option, _)) = total_only.iter().find(|(_, given)| *given) {
        bail!(
            "{option}: the updated Lagrangian formulation has none; use it with --formulation total-lagrangian"
        );
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
            let name = word(options.shape);
            bail!(
                "--shape {name}: splines of this degree need the reference configuration; add --formulation total-lagrangian, or take \
                 bspline2 or bspline3"
            )
        }
    })
}

fn total(options: &Scheme) -> Result<verify::TotalScheme> {
    let degree = match options.shape {
        Shape::Bspline2 => 2,
        Shape::Bspline3 => 3,
        Shape::Bspline4 => 4,
        Shape::Bspline5 => 5,
        _ => bail!(
            "--shape {}: the total Lagrangian formulation takes bspline2, bspline3, bspline4 or bspline5",
            word(options.shape)
        ),
    };
    if options.transfer != verify::Transfer::Flip {
        bail!(
            "--transfer {}: the total Lagrangian formulation keeps velocities on the grid, and has nothing to transfer; use it with \
             --formulation updated-lagrangian",
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
    total.layout = match options.layout {
        Layout::Gauss => verify::Layout::Gauss,
        Layout::Lattice | Layout::BodyFitted => verify::Layout::Lattice,
    };
    total.coordinates = options.grid.into();
    Ok(total)
}

/// What is not said by weights and integrator, where it is not the usual.
pub(super) fn additions(options: &Scheme) -> String {
    let mut text = String::new();
    if options.transfer != verify::Transfer::Flip {
        text += &format!(", transfer {}", options.transfer);
    }
    if options.layout == Layout::BodyFitted {
        text += ", body-fitted layout";
    }
    text
}

/// The mass matrix and the order in time that a run has, given or not.
pub(super) fn echo(options: &Scheme) -> (Mass, usize) {
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
pub(super) fn words(options: &Scheme) -> String {
    let (mass, order) = echo(options);
    let part = match options.grid {
        Grid::Cartesian | Grid::Polar => String::new(),
        Grid::Spherical => {
            let [from, to] = verify::POLAR_ANGLES.map(f64::to_degrees);
            format!(" from {from} to {to} degrees off the third axis")
        }
    };
    format!(
        " of order {order}, total Lagrangian, {} mass, {} layout, {} grid{part}",
        word(mass),
        word(options.layout),
        word(options.grid)
    )
}
