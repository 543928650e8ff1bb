//! From a solution to a grid with walls and particles.

use mmsmith_clip::Side;
use mmsmith_mpm::{EVERY_SCHEME, Grid};
use mmsmith_runtime::{
    AnySolution, Around, Boundary, ComponentCondition, Condition, Domain, Real, Solution, Surface,
};
use nalgebra::SVector;

use crate::body::{refuse_centre, undeclared_planes};
use crate::case::{Case, Extent};
use crate::dimension::in_dimension;
use crate::error::SceneError;
use crate::half_plane::NOT_AXISYMMETRIC;
use crate::points;
use crate::scheme::Placement;
use crate::side_on_grid::{Given, SideOnGrid};

/// Free cells beyond the furthest place that a free surface reaches.
const MARGIN_CELLS: f64 = 3.0;
/// How much further particles may go than the exact motion, as a share of the size of a box.
const OVERSHOOT: f64 = 0.05;

/// A condition of `exact` that the total frame models and the updated one does not, if it has one.
#[must_use]
pub fn needs_total_frame(exact: &AnySolution<f64>) -> Option<Boundary> {
    in_dimension!(
        exact,
        |s| s.boundaries().iter().find(|boundary| SideOnGrid::of(s, boundary).is_loaded()).copied(),
        else None
    )
}

/// The conditions of `exact` in whose place clipped particles have the traction of its motion: sides that move as it says, and with a grid
/// on whose lines they do not lie sliding ones.
#[must_use]
pub fn loaded_instead(exact: &AnySolution<f64>, case: &Case) -> Vec<Boundary> {
    let Some(placement) = case.scheme.updated().map(|updated| updated.placement) else {
        return Vec::new();
    };
    if !placement.is_clipped() {
        return Vec::new();
    }
    in_dimension!(exact, |s| loaded_of(s, placement, case), else Vec::new())
}

fn loaded_of<const D: usize>(
    exact: &dyn Solution<f64, D>,
    placement: Placement,
    case: &Case,
) -> Vec<Boundary> {
    let is_loaded = |boundary: &&Boundary| match SideOnGrid::of(exact, boundary) {
        SideOnGrid::Loaded => boundary.condition.gives(ComponentCondition::PrescribedMotion),
        SideOnGrid::Wall { .. } => match exact.domain() {
            Domain::Box { lower, upper } => {
                let spacing = exact.cell_length() / case.cells as f64;
                !(placement.pose().is_usual() && are_multiples(&(upper - lower), spacing))
            }
            _ => false,
        },
        SideOnGrid::Free => false,
    };
    exact.boundaries().iter().filter(is_loaded).copied().collect()
}

/// Whether all sides of a box are whole multiples of the spacing.
fn are_multiples<const D: usize>(sides: &SVector<f64, D>, spacing: f64) -> bool {
    sides.iter().all(|side| {
        let count = side / spacing;
        count.round() >= 1.0 && (count - count.round()).abs() <= 1e-9 * count.max(1.0)
    })
}

/// How many cells fit along each side of a box whose `cell_length` has `cells` of them.
fn fitted_cells<const D: usize>(
    sides: &SVector<f64, D>,
    cell_length: f64,
    cells: usize,
) -> Result<[usize; D], SceneError> {
    let spacing = cell_length / cells as f64;
    if are_multiples(sides, spacing) {
        return Ok(std::array::from_fn(|axis| (sides[axis] / spacing).round() as usize));
    }
    let near = cells.saturating_sub(32).max(1)..=cells.saturating_add(32);
    let mut fitting: Vec<_> =
        near.filter(|count| are_multiples(sides, cell_length / *count as f64)).collect();
    fitting.sort_by_key(|count| count.abs_diff(cells));
    fitting.truncate(4);
    fitting.sort_unstable();
    let cell_length = Some(sides.min()).filter(|side| are_multiples(sides, side / cells as f64));
    let sides = sides.iter().copied().collect();
    Err(SceneError::Misfit { cells, spacing, sides, fitting, cell_length })
}

/// The lower corner and the cells of a grid that reaches beyond every face of a box that is no wall: as far as the exact motion goes
/// until `end`, and [`OVERSHOOT`] further for particles that go beyond it. A box is given by its lower corner, its cells and their size.
fn with_room<const D: usize>(
    solution: &dyn Solution<f64, D>,
    end: f64,
    (mut lower, mut cells, spacing): (SVector<f64, D>, [usize; D], f64),
    walls: &[[bool; 2]; D],
    revolves: bool,
) -> (SVector<f64, D>, [usize; D]) {
    if walls.as_flattened().iter().all(|is_wall| *is_wall) {
        return (lower, cells);
    }
    let upper = SVector::from_fn(|a, _| lower[a] + cells[a] as f64 * spacing);
    let (furthest, corner) = (extremes(solution, end, (&lower, &upper), revolves), lower);
    let spare = MARGIN_CELLS + (OVERSHOOT * (upper - lower).norm() / spacing).ceil();
    for a in 0..D {
        let beyond = [corner[a] - furthest[0][a], furthest[1][a] - upper[a]];
        let room = |end: usize| (beyond[end].max(0.0) / spacing).ceil() + spare;
        let [below, above] = [0, 1].map(|end| if walls[a][end] { 0.0 } else { room(end) });
        lower[a] -= below * spacing;
        cells[a] += (below + above) as usize;
    }
    (lower, cells)
}

/// As [`with_room`] for the half plane of a body that turns about its axis, where the grid has one cell around it.
fn around_axis<const D: usize>(
    solution: &dyn Solution<f64, D>,
    end: f64,
    (lower, cells, spacing): (SVector<f64, D>, [usize; D], f64),
    walls: &[[bool; 2]; D],
) -> (SVector<f64, D>, [usize; D]) {
    let inner = lower[0];
    let mut closed = *walls;
    closed[0][0] |= inner == 0.0;
    closed[1 % D] = [true; 2];
    let (mut lower, mut cells) = with_room(solution, end, (lower, cells, spacing), &closed, true);
    if lower[0] < 0.0 {
        // As far as the axis, on lines of the grid.
        let most = (inner / spacing + 1e-9).floor();
        cells[0] -= ((inner - lower[0]) / spacing - most).round() as usize;
        lower[0] = inner - most * spacing;
    }
    cells[1 % D] = 1;
    (lower, cells)
}

/// The least and the largest coordinates that places on the surface of a box have until `end`; radii and heights where the box is that of a
/// half plane.
fn extremes<const D: usize>(
    solution: &dyn Solution<f64, D>,
    end: f64,
    (lower, upper): (&SVector<f64, D>, &SVector<f64, D>),
    revolves: bool,
) -> [SVector<f64, D>; 2] {
    // Places along each axis, corners included.
    let count = [2_usize, 9, 5][D.clamp(1, 3) - 1];
    let (mut least, mut largest) = (*lower, *upper);
    for index in 0..count.pow(D as u32) {
        let steps: [usize; D] = std::array::from_fn(|a| index / count.pow(a as u32) % count);
        if !steps.iter().any(|step| [0, count - 1].contains(step)) {
            continue;
        }
        let X = SVector::from_fn(|a, _| match revolves && a == 1 {
            true => 0.0,
            false => lower[a] + (upper[a] - lower[a]) * steps[a] as f64 / (count - 1) as f64,
        });
        for t in moments(solution.period(), end) {
            let mut x: SVector<f64, D> = X + solution.displacement(&X, t);
            if revolves {
                (x[0], x[1 % D]) = (x[0].hypot(x[1 % D]), 0.0);
            }
            // What is not finite is found when the run begins.
            (least, largest) = (least.zip_map(&x, f64::min), largest.zip_map(&x, f64::max));
        }
    }
    [least, largest]
}

/// Times at which a motion is looked at: a fine raster of one period, which sees all of a periodic motion, and one of all the time, for
/// others.
fn moments(period: f64, end: f64) -> impl Iterator<Item = f64> {
    let raster = |span: f64| (0..=128).map(move |moment| span * f64::from(moment) / 128.0);
    raster(end.min(period)).chain((end > period).then(|| raster(end)).into_iter().flatten())
}

/// A body on a background grid, in double precision.
pub(crate) struct Scene<const D: usize> {
    pub(crate) lower: SVector<f64, D>,
    pub(crate) spacing: f64,
    pub(crate) cells: [usize; D],
    pub(crate) walls: [[bool; 2]; D],
    /// Which of the walls hold the body in all directions.
    pub(crate) sticks: [[bool; 2]; D],
    /// Conditions on the two sides along each axis of a box; for an annulus the first pair, on the inner and the outer rim.
    pub(crate) sides: [[Condition; 2]; D],
    /// Which of these sides are walls that mirror the motion, for splines that are continued by their mirror images.
    pub(crate) mirrors: [[bool; 2]; D],
    pub(crate) domain: Domain<f64, D>,
    /// Cosine and sine of the angle of the grid's axes against those of the body; the grid is given in its own.
    pub(crate) turn: [f64; 2],
    /// The boundary of the part that is modelled, where particles are clipped with it.
    pub(crate) boundary: Vec<BoundaryPart<D>>,
    /// The largest extent of the body.
    pub(crate) size: f64,
    /// Whether this is the half plane of a body that turns about its axis, in the updated formulation.
    pub(crate) revolves: bool,
}

/// A part of the boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundaryPart<const D: usize> {
    pub(crate) side: Side<D>,
    /// Whether the traction of the solution acts on it.
    pub(crate) is_loaded: bool,
}

impl<const D: usize> Scene<D> {
    /// Places `solution` on a grid of spacing `cell_length / case.cells`, with room for its motion until `end`.
    pub(crate) fn new(
        solution: &dyn Solution<f64, D>,
        case: &Case,
        end: f64,
    ) -> Result<Self, SceneError> {
        let domain = solution.domain();
        refuse_centre(&domain)?;
        let spacing = solution.cell_length() / case.cells as f64;
        let unknown = || SceneError::Unknown { what: "shape", value: format!("{domain:?}") };
        let size = points::size(&domain).ok_or_else(unknown)?;
        let placement = case.scheme.updated().map(|updated| updated.placement);
        let clipped = placement.filter(|placement| EVERY_SCHEME && placement.is_clipped());
        let quarter = quarter(solution, case.extent, clipped)?;
        let surfaces: Vec<Surface> = match domain {
            Domain::Annulus { .. } => vec![Surface::Inner, Surface::Outer],
            Domain::Tube { .. } => {
                let is_own = |surface: &Surface| points::surface(&domain, *surface, 0).is_some();
                Surface::all(D).filter(is_own).collect()
            }
            _ => (0..D).flat_map(|axis| [Surface::Lower(axis), Surface::Upper(axis)]).collect(),
        };
        let declared = |s: &Surface| solution.boundaries().iter().any(|b| b.surface == *s);
        let surfaces: Vec<_> = surfaces.into_iter().filter(|surface| !declared(surface)).collect();
        if !surfaces.is_empty() {
            let moved = surfaces.into_iter().map(|surface| (surface, Condition::PrescribedMotion));
            let planes = undeclared_planes(solution, case).into_iter();
            let planes = planes.map(|plane| (plane, Condition::Symmetry));
            return Err(SceneError::Undeclared { surfaces: moved.chain(planes).collect() });
        }
        let revolves = matches!(domain, Domain::Tube { .. }) && case.scheme.updated().is_some();
        if revolves && !matches!(domain, Domain::Tube { around: Around::Axisymmetric, .. }) {
            return Err(SceneError::OfRevolution { why: NOT_AXISYMMETRIC });
        }
        let is_lattice = matches!(placement, Some(Placement::Lattice { .. }));
        if revolves && !is_lattice {
            let why = "the updated formulation runs a body that turns about its axis on a lattice alone: leave --layout out";
            return Err(SceneError::OfRevolution { why });
        }
        let (mut walls, mut sticks) = ([[false; 2]; D], [[false; 2]; D]);
        let mut sides = [[Condition::TractionFree; 2]; D];
        let mut on_grid = [[SideOnGrid::Free; 2]; D];
        for boundary @ &Boundary { surface, condition } in solution.boundaries() {
            let modelled = SideOnGrid::of(solution, boundary);
            let mut is_wall = modelled.is_wall();
            // A particle that turns leaves a curved wall along the tangent, so that sliding there is more than no motion across it.
            let is_curved = matches!(surface, Surface::Inner | Surface::Outer);
            let is_loaded = modelled.is_loaded() || (revolves && is_curved && is_wall);
            if is_loaded && case.scheme.updated().is_some() && clipped.is_none() {
                let held = match (Given::of(solution, boundary), surface) {
                    (Given::Nothing, _) => None,
                    (Given::Rest, Surface::Lower(axis)) => Some((axis, 0)),
                    (Given::Rest, Surface::Upper(axis)) => Some((axis, 1)),
                    (Given::Rest, Surface::Inner) if revolves => Some((0, 0)),
                    (Given::Rest, Surface::Outer) if revolves => Some((0, 1)),
                    _ => {
                        let instead = instead(&domain);
                        return Err(SceneError::Unmodelled { surface, condition, instead });
                    }
                };
                if let Some((axis, end)) = held {
                    (sticks[axis][end], is_wall) = (true, true);
                }
            }
            match surface {
                Surface::Lower(axis) if axis < D => {
                    walls[axis][0] |= is_wall && quarter;
                    (sides[axis][0], on_grid[axis][0]) = (condition, modelled);
                }
                Surface::Upper(axis) if axis < D => {
                    walls[axis][1] |= is_wall;
                    (sides[axis][1], on_grid[axis][1]) = (condition, modelled);
                }
                Surface::FirstAngle => sides[1 % D][0] = condition,
                Surface::LastAngle => sides[1 % D][1] = condition,
                Surface::Inner if revolves => walls[0][0] = is_wall,
                Surface::Outer if revolves => walls[0][1] = is_wall,
                surface if is_wall && case.scheme.updated().is_some() => {
                    return Err(SceneError::Unmodelled { surface, condition, instead: "" });
                }
                _ => {}
            }
        }
        if matches!(domain, Domain::Annulus { .. } | Domain::Tube { .. }) {
            // The first axis is the radius.
            let on = |rim: Surface| solution.boundaries().iter().find(|b| b.surface == rim);
            for (end, rim) in [Surface::Inner, Surface::Outer].into_iter().enumerate() {
                if let Some(boundary) = on(rim) {
                    sides[0][end] = boundary.condition;
                    on_grid[0][end] = SideOnGrid::of(solution, boundary);
                }
            }
        }
        if let Some(clipped) = clipped {
            return Self::clipped(solution, case, end, (clipped, quarter), (sides, on_grid));
        }
        let (lower, cells) = match &domain {
            Domain::Box { lower, upper } => {
                let fitted = fitted_cells(&(upper - lower), solution.cell_length(), case.cells)?;
                match placement {
                    Some(_) => with_room(solution, end, (*lower, fitted, spacing), &walls, false),
                    None => (*lower, fitted),
                }
            }
            Domain::Annulus { outer, .. } => {
                let furthest = outer + largest_displacement(solution, &[Surface::Outer], end);
                let half = (furthest / spacing).ceil() + MARGIN_CELLS;
                // The origin stays a grid line, so that both extents have the same lattice of particles.
                if quarter {
                    (SVector::zeros(), [half as usize; D])
                } else {
                    (SVector::repeat(-half * spacing), [(2.0 * half) as usize; D])
                }
            }
            Domain::Tube { inner, outer, lower, upper, .. } if revolves => {
                let width = outer - inner;
                let sides = SVector::from_fn(|a, _| if a == 2 { upper - lower } else { width });
                let cells = fitted_cells(&sides, solution.cell_length(), case.cells)?;
                let corner = [*inner, 0.0, *lower];
                let corner = SVector::from_fn(|a, _| corner[a]);
                around_axis(solution, end, (corner, cells, spacing), &walls)
            }
            Domain::Tube { inner, outer, lower, upper, .. } => {
                // How many lie around the axis is for the grid to say.
                let count = |length: f64| whole_cells(length, spacing);
                let cells = [count(outer - inner), 1, count(upper - lower)];
                let corner = [*inner, 0.0, *lower];
                (SVector::from_fn(|k, _| corner[k]), std::array::from_fn(|k| cells[k]))
            }
            _ => return Err(unknown()),
        };
        let (turn, boundary) = ([1.0, 0.0], Vec::new());
        let mirrors = match case.scheme.updated() {
            Some(_) => [[false; 2]; D],
            None => mirrors(solution, &sides),
        };
        Ok(Self {
            lower,
            spacing,
            cells,
            walls,
            sticks,
            sides,
            mirrors,
            domain,
            turn,
            boundary,
            size,
            revolves,
        })
    }

    /// As [`new`](Self::new) for particles that are clipped with the boundary: sides need not lie on lines of the grid.
    ///
    /// Walls are where a sliding side lies on one. What else is not free of traction has the traction of the solution.
    fn clipped(
        solution: &dyn Solution<f64, D>,
        case: &Case,
        end: f64,
        (placement, quarter): (Placement, bool),
        (sides, on_grid): ([[Condition; 2]; D], [[SideOnGrid; 2]; D]),
    ) -> Result<Self, SceneError> {
        let domain = solution.domain();
        let unknown = || SceneError::Unknown { what: "shape", value: format!("{domain:?}") };
        let size = points::size(&domain).ok_or_else(unknown)?;
        let spacing = solution.cell_length() / case.cells as f64;
        let pose = placement.pose();
        let turn = turn(pose.angle);
        let surfaces: Vec<Surface> = match domain {
            Domain::Annulus { .. } => vec![Surface::Inner, Surface::Outer],
            _ => (0..D).flat_map(|axis| [Surface::Lower(axis), Surface::Upper(axis)]).collect(),
        };
        let reach =
            (largest_displacement(solution, &surfaces, end) / spacing).ceil() + MARGIN_CELLS;
        let (mut walls, mut boundary) = ([[false; 2]; D], Vec::new());
        let mut add = |side, is_loaded| boundary.push(BoundaryPart { side, is_loaded });
        let straight = |axis: usize, sign: f64, distance: f64| {
            let normal = std::array::from_fn(|a| if a == axis { sign } else { 0.0 });
            Side::Straight { normal, distance }
        };
        let (lower, cells): (SVector<f64, D>, [usize; D]) = match &domain {
            Domain::Annulus { inner, outer } => {
                let (inner, outer) = (*inner, *outer);
                add(Side::Inner { radius: inner }, on_grid[0][0].is_loaded());
                add(Side::Outer { radius: outer }, on_grid[0][1].is_loaded());
                let half = (outer / spacing).ceil() + reach;
                if quarter {
                    for axis in 0..D {
                        walls[axis][0] = true;
                        add(straight(axis, -1.0, 0.0), false);
                    }
                    (SVector::zeros(), [half as usize; D])
                } else {
                    let first = half + pose.shift.abs().ceil();
                    (SVector::repeat((pose.shift - first) * spacing), [2 * first as usize; D])
                }
            }
            Domain::Box { lower, upper } => {
                let fits = pose.is_usual() && are_multiples(&(upper - lower), spacing);
                // No traction has a value there, so that the axis is a wall of every grid, which begins at it.
                let has_axis = solution.is_half_plane() && lower[0] == 0.0;
                if has_axis && !pose.is_usual() {
                    return Err(SceneError::Extent(
                        "the axis of a solid body of revolution is a line of the grid: leave --grid-angle and --grid-shift out",
                    ));
                }
                for axis in 0..D {
                    walls[axis] = on_grid[axis].map(|side| fits && side.is_wall());
                    walls[axis][0] |= axis == 0 && has_axis;
                    let is_loaded = |end: usize| match walls[axis][end] {
                        true => on_grid[axis][end].is_loaded(),
                        false => on_grid[axis][end] != SideOnGrid::Free,
                    };
                    let (low, high) =
                        (straight(axis, -1.0, -lower[axis]), straight(axis, 1.0, upper[axis]));
                    add(low, is_loaded(0));
                    add(high, is_loaded(1));
                }
                let margins =
                    walls.map(|pair| pair.map(|is_wall| if is_wall { 0.0 } else { reach }));
                covering([*lower, *upper], turn, (pose.shift, spacing), &margins)
            }
            _ => return Err(unknown()),
        };
        let mirrors = [[false; 2]; D];
        Ok(Self {
            lower,
            spacing,
            cells,
            walls,
            sticks: [[false; 2]; D],
            sides,
            mirrors,
            domain,
            turn,
            boundary,
            size,
            revolves: false,
        })
    }

    /// The largest coordinate that a particle at rest may have, and at least the size of the body: what positions are rounded
    /// at.
    pub(crate) fn reach(&self) -> f64 {
        let coordinate = match &self.domain {
            Domain::Box { lower, upper } => lower.amax().max(upper.amax()),
            Domain::Tube { lower, upper, .. } => lower.abs().max(upper.abs()),
            _ => 0.0,
        };
        self.size.max(coordinate)
    }

    /// The grid in the solver's precision.
    pub(crate) fn grid<T: Real>(&self) -> Grid<T, D> {
        Grid {
            lower: self.lower.map(Real::nearest),
            spacing: Real::nearest(self.spacing),
            cells: self.cells,
            walls: self.walls,
        }
    }

    /// How much of an annulus is modelled; `None` for other shapes.
    pub(crate) fn extent(&self) -> Option<Extent> {
        let whole = self.lower[0] < 0.0;
        matches!(self.domain, Domain::Annulus { .. }).then_some(if whole {
            Extent::Full
        } else {
            Extent::Quarter
        })
    }

    /// About how many particles the body gets.
    pub(crate) fn particles_expected(&self, per_cell: usize) -> f64 {
        let body = match self.domain {
            Domain::Annulus { inner, outer } => {
                let pi = std::f64::consts::PI;
                let whole = self.extent() == Some(Extent::Full);
                let part = if whole { 1.0 } else { 0.5_f64.powi(D as i32) };
                let full_ball = if D == 3 { 4.0 / 3.0 * pi } else { pi };
                let content = part * full_ball * (outer.powi(D as i32) - inner.powi(D as i32));
                content / self.spacing.powi(D as i32)
            }
            Domain::Box { lower, upper } if !self.boundary.is_empty() => {
                (upper - lower).iter().map(|side| side / self.spacing).product()
            }
            Domain::Box { lower, upper } => {
                (upper - lower).iter().map(|side| (side / self.spacing).round()).product()
            }
            Domain::Tube { inner, outer, lower, upper, .. } if self.revolves => {
                (outer - inner) * (upper - lower) / self.spacing.powi(2) / per_cell as f64
            }
            _ => self.cells.iter().map(|&cells| cells as f64).product(),
        };
        body * (per_cell as f64).powi(D as i32)
    }

    /// About how many bytes the solver and the measurement keep, for values of `scalar` bytes, where the exact fields keep
    /// `exact` bytes of each particle.
    pub(crate) fn bytes_expected(&self, per_cell: usize, scalar: usize, exact: usize) -> f64 {
        // X, x, v, b and two copies at set-up; F twice; mass and volume; and three whole numbers for sorting.
        let per_particle = scalar * (6 * D + 2 * D * D + 2) + 12 + exact;
        // A cache line, another for the step to come or for MUSL, and what sorting counts; with the padding beyond the walls.
        const PER_NODE: f64 = 64.0 + 64.0 + 4.0;
        let particles = self.particles_expected(per_cell);
        particles * per_particle as f64 + self.nodes() * PER_NODE
    }

    /// Nodes of the grid, with the padding beyond its ends; around an axis there is one layer.
    pub(crate) fn nodes(&self) -> f64 {
        let layers = |(a, &cells)| if self.revolves && a == 1 { 1.0 } else { cells as f64 + 9.0 };
        self.cells.iter().enumerate().map(layers).product()
    }

    /// How many bytes the exact fields keep of each particle, at most: what the body force needs, in values of the solver's
    /// size, and what the state that errors are measured by needs, in double precision.
    pub(crate) fn bytes_of_exact(solution: &dyn Solution<f64, D>, scalar: usize) -> usize {
        let body_force = solution.body_force_at(&[]).bytes_per_point();
        body_force * scalar / size_of::<f64>() + solution.state_at(&[]).bytes_per_point()
    }

    /// Whether a place of the lattice with `per_cell` particles in a cell and direction lies in the body: in a box before it is shifted
    /// by `offset` of the particles' distance, so that all of the box is there, and in an annulus after that.
    pub(crate) fn inside<T: Real>(
        &self,
        per_cell: usize,
        offset: f64,
    ) -> impl Fn(&SVector<T, D>) -> bool {
        let distance = self.spacing / per_cell as f64;
        move |X| {
            // Decided on the exact centre, so that both precisions have the same particles.
            let centre = |offset: f64| {
                SVector::<f64, D>::from_fn(|axis, _| {
                    let index = ((X[axis].to_f64() - self.lower[axis]) / distance - 0.5).round();
                    self.lower[axis] + (index + 0.5 + offset) * distance
                })
            };
            match self.domain {
                Domain::Annulus { inner, outer } => {
                    let squared = centre(offset).norm_squared();
                    inner * inner <= squared && squared <= outer * outer
                }
                Domain::Box { lower, upper } => {
                    let centre = centre(0.0);
                    (0..D).all(|axis| lower[axis] < centre[axis] && centre[axis] < upper[axis])
                }
                Domain::Tube { inner, outer, lower, upper, .. } if self.revolves => {
                    let centre = centre(0.0);
                    // One layer of particles is the half plane.
                    let ranges = [[inner, outer], [0.0, distance], [lower, upper]];
                    (0..D).all(|a| ranges[a][0] < centre[a] && centre[a] < ranges[a][1])
                }
                _ => true,
            }
        }
    }
}

/// Cosine and sine of an angle in degrees; whole quarters have no rounding.
fn turn(angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.to_radians().sin_cos();
    match angle.rem_euclid(360.0) {
        0.0 => [1.0, 0.0],
        90.0 => [0.0, 1.0],
        180.0 => [-1.0, 0.0],
        270.0 => [0.0, -1.0],
        _ => [cos, sin],
    }
}

/// The lower corner and the cells of a turned and shifted grid that covers a box, with so many more cells at each end of each axis.
fn covering<const D: usize>(
    [lower, upper]: [SVector<f64, D>; 2],
    [cos, sin]: [f64; 2],
    (shift, spacing): (f64, f64),
    margins: &[[f64; 2]; D],
) -> (SVector<f64, D>, [usize; D]) {
    // Along the axes of the grid.
    let turned = |X: SVector<f64, D>| -> SVector<f64, D> {
        SVector::from_fn(|a, _| match a {
            0 => cos * X[0] + sin * X[1 % D],
            1 => cos * X[1] - sin * X[0],
            _ => X[a],
        })
    };
    let base: SVector<f64, D> = turned(lower) + SVector::repeat(shift * spacing);
    let corner = |index: usize| {
        turned(SVector::from_fn(|a, _| if index >> a & 1 == 1 { upper[a] } else { lower[a] }))
    };
    let corners: Vec<_> = (0..1_usize << D).map(corner).collect();
    let (mut first, mut cells) = (SVector::zeros(), [0; D]);
    for a in 0..D {
        let lines = corners.iter().map(|corner| (corner[a] - base[a]) / spacing);
        let low = lines.clone().fold(f64::INFINITY, f64::min);
        let high = lines.fold(f64::NEG_INFINITY, f64::max);
        let low = (low + 1e-9).floor() - margins[a][0];
        let high = (high - 1e-9).ceil() + margins[a][1];
        first[a] = base[a] + low * spacing;
        cells[a] = (high - low) as usize;
    }
    (first, cells)
}

/// The whole cells that fill a length of a curved body, none longer than the spacing.
pub(crate) fn whole_cells(length: f64, spacing: f64) -> usize {
    (length / spacing - 1e-9).ceil().max(2.0) as usize
}

/// The formulation that models given motions and tractions on the sides of a body, in words.
fn instead<const D: usize>(domain: &Domain<f64, D>) -> &'static str {
    match domain {
        Domain::Box { .. } => {
            " in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3"
        }
        Domain::Annulus { .. } if D == 2 => {
            " in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3 --grid polar"
        }
        Domain::Annulus { .. } => {
            " in the updated Lagrangian formulation; the total Lagrangian one does: --formulation total-lagrangian --shape bspline3 --grid spherical"
        }
        Domain::Tube { .. } => {
            " of a body that turns about its axis in the updated Lagrangian formulation; the total Lagrangian one does: --formulation \
             total-lagrangian --shape bspline3 --layout gauss --grid cylindrical --cfl 0.2 --cfl-speed p-wave"
        }
        _ => "",
    }
}

/// Which sides of a body are walls that mirror its motion.
fn mirrors<const D: usize>(
    solution: &dyn Solution<f64, D>,
    sides: &[[Condition; 2]; D],
) -> [[bool; 2]; D] {
    let around = matches!(solution.domain(), Domain::Tube { .. });
    std::array::from_fn(|axis| {
        let both = match axis {
            1 if around => [Surface::FirstAngle, Surface::LastAngle],
            _ => [Surface::Lower(axis), Surface::Upper(axis)],
        };
        [0, 1].map(|end| sides[axis][end].is_wall() && is_mirrored(solution, both[end]))
    })
}

/// Whether a plane side mirrors the motion: the displacement beyond it is the mirror image of that inside. A side on which a body slides need
/// not: `u = X^2 (1 - X)` has a second slope at `X = 0`, where its mirror image has the opposite one.
pub(crate) fn is_mirrored<const D: usize>(
    solution: &dyn Solution<f64, D>,
    surface: Surface,
) -> bool {
    const PLACES: usize = 16;
    /// Distances from the side, as shares of the body's size.
    const DISTANCES: [f64; 2] = [0.03, 0.11];
    /// Rounding, as a share of the largest displacement.
    const ROUNDING: f64 = 1e-9;
    let domain = solution.domain();
    let Some(size) = points::size(&domain) else { return false };
    let (mut difference, mut largest) = (0.0_f64, 0.0_f64);
    for n in 0..PLACES {
        let Some((X, N)) = points::surface(&domain, surface, n) else { return false };
        let t = solution.period() * points::quasirandom(n, D, D + 1);
        for distance in DISTANCES.map(|share| share * size) {
            let inside = solution.displacement(&(X - N * distance), t);
            let beyond = solution.displacement(&(X + N * distance), t);
            let image = inside - N * (2.0 * inside.dot(&N));
            let here = (beyond - image).amax();
            // Also where the formulas have no value beyond.
            if !here.is_finite() {
                return false;
            }
            difference = difference.max(here);
            largest = largest.max(inside.amax());
        }
    }
    difference <= ROUNDING * largest
}

/// Whether the planes of symmetry are modelled as walls.
fn quarter<const D: usize>(
    solution: &dyn Solution<f64, D>,
    extent: Option<Extent>,
    clipped: Option<Placement>,
) -> Result<bool, SceneError> {
    let is_annulus = matches!(solution.domain(), Domain::Annulus { .. });
    // The planes are then no lines of the grid.
    let moved = clipped.is_some_and(|placement| !placement.pose().is_usual());
    let planes = |axis| {
        solution.boundaries().iter().any(|boundary| {
            boundary.surface == Surface::Lower(axis) && boundary.condition == Condition::Symmetry
        })
    };
    match extent {
        Some(_) if !is_annulus => Err(SceneError::Extent(
            "the extent can be chosen for a body between two radii only, a ring or a shell: leave --extent out",
        )),
        Some(Extent::Full) => Ok(false),
        Some(Extent::Quarter) if moved => Err(SceneError::Extent(
            "a quarter needs planes of symmetry on lines of the grid: take --extent full, or leave out --grid-angle and --grid-shift",
        )),
        None if moved && is_annulus => Ok(false),
        Some(Extent::Quarter) if !(0..D).all(planes) => {
            Err(SceneError::Extent("the solution declares no planes of symmetry to cut a quarter"))
        }
        Some(Extent::Quarter) => Ok(true),
        None => Ok(!is_annulus || (0..D).all(planes)),
    }
}

/// The largest displacement on some surfaces at sampled places and times until `end`.
fn largest_displacement<const D: usize>(
    solution: &dyn Solution<f64, D>,
    surfaces: &[Surface],
    end: f64,
) -> f64 {
    let mut largest = 0.0_f64;
    let places = (0..16).flat_map(|place| surfaces.iter().map(move |surface| (place, *surface)));
    for (place, surface) in places {
        let Some((X, _)) = points::surface(&solution.domain(), surface, place) else {
            return largest;
        };
        for t in moments(solution.period(), end) {
            largest = largest.max(solution.displacement(&X, t).norm());
        }
    }
    largest
}
