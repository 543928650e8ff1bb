//! From options to a scheme, and the combinations that make none.

use anyhow::{Result, bail};
use mmsmith_solutions::{AnySolution, Boundary};
use mmsmith_verify::{
    self as verify, Case, CaseError, CflSpeed, Composition, Coordinates, Formulation, GridPose,
    Integrator, LARGEST_USUAL_CFL, MassMatrix, Named, Placement, ReturnMap, Scheme, Shape, Start,
    Total, Transfer, USUAL_CFL, Updated, UsualStep, usual_step,
};

use crate::arguments::{Layout, Precision, SchemeOptions, Weights};
use crate::number;

/// The default number of cells.
const USUAL_CELLS: usize = 32;
/// The default for a solid of three dimensions in a total Lagrangian formulation that was not asked for, whose cells have 64 particles
/// each.
const USUAL_CELLS_OF_SOLIDS: usize = 16;
/// Particles in a cell along each direction, but for Gauss points.
const USUAL_PER_CELL: usize = 2;

/// How to simulate, with nothing left open: what was said, and what suits the solution where nothing was.
#[derive(Clone)]
pub(super) struct Settled {
    /// On the number of cells that is usual.
    pub(super) case: Case,
    pub(super) precision: Precision,
    /// The choice made because the usual scheme would not do, and its reason.
    pub(super) chosen: Option<Choice>,
    /// Whether particles are clipped because the density differs from place to place.
    clips: bool,
    /// Conditions in whose place the traction of the exact motion acts.
    pub(super) loaded: Vec<Boundary>,
    /// The CFL number of the fastest P-waves with the usual step, where a shorter one was taken for that.
    pub(super) too_long: Option<f64>,
    /// Whether the CFL number is the user's.
    cfl_is_given: bool,
}

/// A total Lagrangian formulation that was not asked for.
#[derive(Clone)]
pub(super) struct Choice {
    scheme: Total,
    /// Reason why the updated formulation does not run it, in words; none where the user named the formulation and left its splines open.
    reason: Option<String>,
}

/// Usual case of a solution that the updated Lagrangian formulation models, with the given weights and integrator.
pub(super) fn usual(shape: Shape, integrator: Integrator, cells: usize) -> Case {
    let scheme = Scheme::Updated(Updated { shape, integrator, ..Updated::default() });
    Case { scheme, cells, ..Case::default() }
}

impl Settled {
    /// A case in double precision.
    pub(super) fn of(case: Case) -> Self {
        Self {
            case,
            precision: Precision::F64,
            chosen: None,
            clips: false,
            loaded: Vec::new(),
            too_long: None,
            cfl_is_given: true,
        }
    }

    /// The scheme that the options leave for a solution. What they say holds; what they leave open is chosen so that the
    /// solution can be run.
    ///
    /// # Errors
    ///
    /// Options that make no scheme together.
    pub(super) fn settle(options: &SchemeOptions, exact: &AnySolution<f64>) -> Result<Self> {
        let needed = verify::needs_total_frame(exact);
        let needs_space = verify::needs_space(exact);
        // The mass matrix of splines is a product over the axes.
        let uneven = verify::has_uneven_density(exact);
        // Bodies that no clipped layout is of are left to the total formulation, which says what else there is.
        let can_clip = !matches!(exact, AnySolution::One(_))
            && needs_space.is_none()
            && !verify::turns_about_axis(exact);
        let is_total = match options.formulation {
            Some(formulation) => formulation == Formulation::Total,
            None => {
                (needed.is_some() || needs_space.is_some())
                    && !says_updated(options)
                    && !(uneven && can_clip)
            }
        };
        let clips = !is_total && uneven && needed.is_some() && options.layout.is_none();
        refuse_start(options, is_total)?;
        let scheme = if is_total {
            Scheme::Total(total(options, exact)?)
        } else {
            Scheme::Updated(updated(options, clips)?)
        };
        let speed = options.cfl_speed;
        let said = UsualStep {
            cfl: options.cfl.unwrap_or(USUAL_CFL),
            speed: speed.unwrap_or(CflSpeed::Bar),
            too_long: None,
        };
        let step = match options.cfl {
            Some(_) => said,
            // What cannot be told from here is refused when the case is looked at.
            None => usual_step(exact, &scheme, options.periods, speed).unwrap_or(said),
        };
        let case = Case {
            scheme,
            cells: USUAL_CELLS,
            per_cell: options.ppc.unwrap_or_else(|| per_cell(&scheme)),
            cfl: step.cfl,
            cfl_speed: step.speed,
            periods: options.periods,
            extent: options.extent,
            return_map: return_map(options, exact)?,
            volume: options.volume,
        };
        let loaded = verify::loaded_instead(exact, &case);
        let mut settled = Self {
            case,
            precision: options.precision,
            chosen: None,
            clips,
            loaded,
            too_long: step.too_long,
            cfl_is_given: options.cfl.is_some(),
        };
        if let Scheme::Total(scheme) = scheme
            && (options.formulation.is_none() || options.shape.is_none())
        {
            let reason = match needed.filter(|_| options.formulation.is_none()) {
                Some(Boundary { surface, condition }) => {
                    Some(format!("it imposes {condition} on {surface}"))
                }
                None => needs_space.filter(|_| options.formulation.is_none()).map(str::to_owned),
            };
            let is_solid =
                matches!(exact, AnySolution::Three(_)) && !verify::is_axisymmetric(exact);
            if reason.is_some() && is_solid {
                settled.case.cells = USUAL_CELLS_OF_SOLIDS;
            }
            let speed = speed.or_else(|| verify::stiffest(exact).ok()).unwrap_or(CflSpeed::PWave);
            // What cannot be told from here is refused when the case is looked at.
            if !settled.cfl_is_given
                && let Ok(cfl) = scheme.usual_cfl(exact, speed)
            {
                (settled.case.cfl, settled.case.cfl_speed) = (cfl, speed);
                settled.too_long = None;
            }
            settled.chosen = Some(Choice { scheme, reason });
        }
        Ok(settled)
    }

    /// A line that says what was chosen and why, and one with the options that say the same; empty where all is as usual.
    pub(super) fn choice(&self) -> String {
        let Some(Choice { scheme, reason }) = &self.chosen else {
            let clipped = match self.clips {
                true => {
                    "updated Lagrangian, particles clipped with the boundary: the density differs from place to place\n  as with \
                     --formulation updated-lagrangian --layout clipped\n"
                }
                false => "",
            };
            return clipped.to_owned() + &self.loads() + &self.step();
        };
        let Case { cfl, cfl_speed, per_cell, .. } = self.case;
        let degree = match scheme.degree {
            2 => "quadratic",
            3 => "cubic",
            4 => "quartic",
            _ => "quintic",
        };
        let grid = match scheme.coordinates {
            Coordinates::Cartesian => "Cartesian",
            Coordinates::Polar => "polar",
            Coordinates::Cylindrical => "cylindrical",
            Coordinates::Spherical => "spherical",
        };
        let layout = match scheme.layout {
            verify::Layout::Gauss => "Gauss points",
            verify::Layout::Lattice => "a lattice of particles",
        };
        let speed = waves(cfl_speed);
        let mut text = format!("total Lagrangian, {degree} splines on a {grid} grid, {layout}");
        if !self.cfl_is_given {
            text += &format!(", CFL {cfl} on {speed}");
        }
        if let Some(reason) = reason {
            text += &format!(": {reason}");
        }
        let shape = self.case.scheme.shape();
        let (grid, layout) = (scheme.coordinates.name(), scheme.layout.name());
        text += &format!(
            "\n  as with --formulation total-lagrangian --shape {shape} --grid {grid} --layout {layout} --ppc {per_cell}"
        );
        if !self.cfl_is_given {
            text += &format!(" --cfl {cfl} --cfl-speed {}", cfl_speed.name());
        }
        text + "\n" + &self.step()
    }

    /// Lines about a step that is shorter than the usual one, and why; empty where it is the usual one, or was given.
    fn step(&self) -> String {
        let Case { cfl, cfl_speed, .. } = self.case;
        let waves = waves(cfl_speed);
        let Some(too_long) = self.too_long else {
            return match (cfl_speed, self.cfl_is_given) {
                (CflSpeed::Viscous, false) => format!(
                    "CFL {cfl} on {waves}: steps fall with the square of the cells where viscosity limits them\n  as with --cfl {cfl} \
                     --cfl-speed {}\n",
                    cfl_speed.name()
                ),
                _ => String::new(),
            };
        };
        let too_long = number::rounded(too_long, 2);
        format!(
            "CFL {cfl} on {waves}: the usual {USUAL_CFL} would be {too_long} on the fastest P-waves of this motion, more than \
             {LARGEST_USUAL_CFL}\n  as with --cfl {cfl} --cfl-speed {}\n",
            cfl_speed.name()
        )
    }

    /// A line about tractions in place of other conditions; empty where there are none.
    fn loads(&self) -> String {
        if self.loaded.is_empty() {
            return String::new();
        }
        let told = self.loaded.iter().map(|own| format!("{} ({})", own.surface, own.condition));
        let told: Vec<_> = told.collect();
        format!("the traction of the exact motion acts on {} in place of that\n", told.join(", "))
    }
}

/// The waves that CFL numbers refer to, in words.
fn waves(speed: CflSpeed) -> &'static str {
    match speed {
        CflSpeed::Bar => "bar waves",
        CflSpeed::PWave => "P-waves",
        CflSpeed::Viscous => "P-waves and viscosity",
    }
}

/// Whether the options say something that only the updated Lagrangian formulation has.
fn says_updated(options: &SchemeOptions) -> bool {
    options.shape.is_some_and(|shape| shape.degree().is_none())
        || options.integrator != Integrator::Cd
        || options.transfer != Transfer::Flip
        || options.start != Start::Halved
        || matches!(options.layout, Some(Layout::BodyFitted | Layout::Clipped))
        || options.offset != 0.0
        || is_moved(options)
        || options.precision == Precision::F32
}

/// The default number of particles per cell and direction: as many Gauss points as integrate the splines' squares.
fn per_cell(scheme: &Scheme) -> usize {
    match scheme {
        Scheme::Total(Total { layout: verify::Layout::Gauss, degree, .. }) => degree + 1,
        Scheme::Total(_) | Scheme::Updated(_) => USUAL_PER_CELL,
    }
}

fn updated(options: &SchemeOptions, clips: bool) -> Result<Updated> {
    let total_only = [
        ("--mass consistent", options.mass == Some(MassMatrix::Consistent)),
        ("--composition", options.composition.is_some_and(|order| order != Composition::Order2)),
        ("--layout gauss", options.layout == Some(Layout::Gauss)),
        ("--grid polar", options.grid == Some(Coordinates::Polar)),
        ("--grid cylindrical", options.grid == Some(Coordinates::Cylindrical)),
        ("--grid spherical", options.grid == Some(Coordinates::Spherical)),
    ];
    if let Some((option, _)) = total_only.iter().find(|(_, given)| *given) {
        bail!(
            "{option}: the updated Lagrangian formulation has none; use it with --formulation total-lagrangian"
        );
    }
    let layout = match options.layout {
        None if clips || is_moved(options) => Layout::Clipped,
        layout => layout.unwrap_or(Layout::Lattice),
    };
    // The boxes of GIMP lie along the axes.
    let usual = Weights::Of(if layout == Layout::Lattice { Shape::Gimp } else { Shape::Cpdi2 });
    let shape = match options.shape.unwrap_or(usual) {
        Weights::Of(shape) => shape,
        high @ Weights::Spline(_) => bail!(
            "--shape {}: splines of this degree need the reference configuration; add --formulation total-lagrangian, or take \
             bspline2 or bspline3",
            high.name()
        ),
    };
    let (pose, offset) = (pose(options), options.offset);
    if layout != Layout::Clipped {
        refuse_pose(options)?;
    }
    let placement = match layout {
        Layout::Clipped => Placement::Clipped { offset, pose },
        Layout::Lattice | Layout::Gauss => Placement::Lattice { offset },
        Layout::BodyFitted if offset == 0.0 => Placement::BodyFitted,
        Layout::BodyFitted => {
            let instead = "0 with particles fitted to the body, or the layout lattice";
            return Err(CaseError::setting("offset", format!("{offset:?}"), instead).into());
        }
    };
    let SchemeOptions { integrator, start, transfer, .. } = *options;
    Ok(Updated { shape, integrator, start, transfer, placement })
}

fn pose(options: &SchemeOptions) -> GridPose {
    GridPose { angle: options.grid_angle, shift: options.grid_shift }
}

/// Whether the grid is asked to lie elsewhere than usually.
fn is_moved(options: &SchemeOptions) -> bool {
    !pose(options).is_usual()
}

/// Refuses a grid that is moved against a body whose particles lie along the lines of the usual one.
fn refuse_pose(options: &SchemeOptions) -> Result<()> {
    for (setting, value) in [("grid-angle", options.grid_angle), ("grid-shift", options.grid_shift)]
    {
        if value != 0.0 {
            let instead = "0, or the layout clipped in the updated Lagrangian formulation";
            return Err(CaseError::setting(setting, format!("{value:?}"), instead).into());
        }
    }
    Ok(())
}

/// Refuses a start for integrators that have none to choose.
/// The return map of a law with flow; other laws have none.
fn return_map(options: &SchemeOptions, exact: &AnySolution<f64>) -> Result<Option<ReturnMap>> {
    match (options.return_map, verify::has_flow(exact)) {
        (given, true) => Ok(Some(given.unwrap_or_default())),
        (None, false) => Ok(None),
        (Some(given), false) => bail!(
            "--return-map {}: only a law with [material.flow] has a return map; leave --return-map out",
            given.name()
        ),
    }
}

fn refuse_start(options: &SchemeOptions, is_total: bool) -> Result<()> {
    if options.start == Start::Halved {
        return Ok(());
    }
    let start = options.start.name();
    if is_total {
        bail!(
            "--start {start}: the total Lagrangian formulation starts from the exact velocity at time zero; leave --start out, or write \
             --formulation updated-lagrangian --integrator cd --start {start}"
        );
    }
    let integrator = options.integrator;
    if integrator != Integrator::Cd {
        bail!(
            "--start {start}: the integrator {integrator} starts from the velocity at time zero, and only cd has a first velocity to \
             choose; leave --start out, or write --integrator cd --start {start}"
        );
    }
    Ok(())
}

fn total(options: &SchemeOptions, exact: &AnySolution<f64>) -> Result<Total> {
    let shape = options.shape.unwrap_or(Weights::Of(Shape::Bspline3));
    let Some(degree) = shape.degree() else {
        bail!(
            "--shape {}: the total Lagrangian formulation takes bspline2, bspline3, bspline4 or bspline5",
            shape.name()
        )
    };
    if options.transfer != Transfer::Flip {
        bail!(
            "--transfer {}: the total Lagrangian formulation keeps velocities on the grid, and has nothing to transfer; use it with \
             --formulation updated-lagrangian",
            options.transfer
        );
    }
    let layout = match options.layout {
        None => Total::layout_for(exact),
        Some(Layout::Gauss) => verify::Layout::Gauss,
        Some(Layout::Lattice) => verify::Layout::Lattice,
        Some(Layout::Clipped) => bail!(
            "--layout clipped: the total Lagrangian formulation has grids that fit the body; use --layout gauss or lattice with it"
        ),
        Some(Layout::BodyFitted) => bail!(
            "--layout body-fitted: the total Lagrangian formulation fits a ring by --grid polar; use --layout gauss or lattice with it"
        ),
    };
    if options.integrator != Integrator::Cd {
        let instead = "cd in the total Lagrangian formulation";
        return Err(CaseError::setting("integrator", options.integrator, instead).into());
    }
    if options.offset != 0.0 {
        let value = format!("{:?}", options.offset);
        let instead = "0 in the total Lagrangian formulation";
        return Err(CaseError::setting("offset", value, instead).into());
    }
    refuse_pose(options)?;
    let usual = Total::of_degree(degree);
    // Steps of other compositions go back in time, which a material with memory does not.
    let composition = match (options.composition, verify::has_memory(exact)) {
        (None | Some(Composition::Order2), true) => Composition::Order2,
        (Some(order), true) => bail!(
            "--composition {}: steps of a law that remembers cannot go back in time, as those of this composition do; leave --composition \
             out, or write --composition 2",
            order.order()
        ),
        (given, false) => given.unwrap_or(usual.composition),
    };
    Ok(Total {
        mass: options.mass.unwrap_or(usual.mass),
        composition,
        layout,
        coordinates: options.grid.unwrap_or_else(|| Total::coordinates_for(exact)),
        ..usual
    })
}

/// Settings beside weights and integrator, in words; of the updated Lagrangian formulation those that are not the usual ones.
pub(super) fn words(scheme: &Scheme) -> String {
    match scheme {
        Scheme::Updated(updated) => {
            let pose = updated.placement.pose();
            let mut text = match updated.integrator {
                Integrator::Cd => format!(" ({} start)", updated.start.name()),
                _ => String::new(),
            };
            if updated.transfer != Transfer::Flip {
                text += &format!(", transfer {}", updated.transfer);
            }
            if !matches!(updated.placement, Placement::Lattice { .. }) {
                text += &format!(", {} layout", updated.placement.name());
            }
            if pose.angle != 0.0 {
                text += &format!(", grid turned by {} degrees", pose.angle);
            }
            if pose.shift != 0.0 {
                text += &format!(", grid shifted by {} cells", pose.shift);
            }
            text
        }
        Scheme::Total(total) => {
            let part = match total.coordinates {
                Coordinates::Cartesian | Coordinates::Polar | Coordinates::Cylindrical => {
                    String::new()
                }
                Coordinates::Spherical => {
                    let [from, to] = verify::POLAR_ANGLES.map(f64::to_degrees);
                    format!(" from {from} to {to} degrees off the third axis")
                }
            };
            format!(
                " of order {}, total Lagrangian, {} mass, {} layout, {} grid{part}",
                total.composition.order(),
                total.mass.name(),
                total.layout.name(),
                total.coordinates.name(),
            )
        }
    }
}
