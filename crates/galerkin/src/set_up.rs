//! The discretisation, its checks, and what a run has from the start: lines of particles, faces, fits.

use std::array;

use mmsmith_particles::{Particles, SetupError};
use mmsmith_vocabulary::ComponentCondition;
use nalgebra::{SMatrix, SVector};

use super::axis::{Axis, End, Layout};
use super::basis::{Basis, MOST_DEGREE};
use super::boundary::{Face, Side};
use super::component::along;
use super::composition::Composition;
use super::coordinates::{Coordinates, RowGeometry};
use super::fit::{Fit, Line};
use super::mass::{Band, Mass};

/// A tensor-product grid that covers the body, with the particles in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    /// The axes of the coordinates.
    pub axes: [Axis; D],
    /// The coordinate system.
    pub coordinates: Coordinates,
    /// Particles in a cell along each direction.
    pub per_cell: usize,
    /// Where they lie.
    pub layout: Layout,
}

/// Mass matrices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MassMatrix {
    /// Row sums on the diagonal: of second order for every degree.
    Lumped,
    /// `M_ij = sum m_p N_i N_j`.
    Consistent,
}

/// The discretisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scheme {
    /// The splines' degree, 2 to 5.
    pub degree: usize,
    /// The mass matrix.
    pub mass: MassMatrix,
    /// The integration in time.
    pub composition: Composition,
}

/// The particles along an axis.
pub(super) fn line<const D: usize>(grid: &Grid<D>, k: usize) -> Line {
    let density = |x| grid.coordinates.density(k, x);
    Line::new(&grid.axes[k], grid.per_cell, grid.layout, density)
}

/// Factors common to a row of particles along axis 0; empty where components are Cartesian.
pub(super) fn rows<const D: usize>(grid: &Grid<D>, lines: &[Line; D]) -> Vec<RowGeometry<D>> {
    let mut counts = lines.each_ref().map(|line| line.points.len());
    counts[0] = 1;
    let place = |index: [usize; D]| SVector::from_fn(|k, _| lines[k].points[index[k]]);
    products(counts).filter_map(|index| grid.coordinates.row(&place(index))).collect()
}

/// The splines of a degree by axis and kind of component.
pub(super) fn bases<const D: usize>(
    grid: &Grid<D>,
    degree: usize,
    lines: &[Line; D],
) -> Result<[[Basis; 2]; D], SetupError> {
    let mut bases = Vec::with_capacity(D);
    for (k, axis) in grid.axes.iter().enumerate() {
        let basis = |normal: bool| {
            Basis::new(axis, degree, normal, &lines[k].points).ok_or(SetupError::TooFewCells {
                axis: k,
                cells: axis.cells,
                least: 2,
            })
        };
        bases.push([basis(false)?, basis(true)?]);
    }
    Ok(array::from_fn(|k| bases[k].clone()))
}

/// Their mass matrices, by axis and component, for a density of the body.
pub(super) fn masses<const D: usize>(
    grid: &Grid<D>,
    scheme: &Scheme,
    bases: &[[Basis; 2]; D],
    lines: &[Line; D],
    density: f64,
) -> Result<[[Mass; D]; D], SetupError> {
    let mut masses = Vec::with_capacity(D);
    for (k, (axis, pair)) in grid.axes.iter().zip(bases).enumerate() {
        // The density belongs to the product over the axes, so to one of them.
        let factor = if k == 0 { density } else { 1.0 };
        let weights: Vec<f64> = lines[k].weights.iter().map(|w| w * factor).collect();
        let mass = |component: usize| {
            let basis = &pair[usize::from(component == k)];
            match scheme.mass {
                MassMatrix::Consistent => {
                    Mass::consistent(axis, component, &Band::consistent(basis, &weights))
                }
                MassMatrix::Lumped => {
                    let on_wall = scheme.degree % 2 == 1 && axis.ends[0] == End::Wall;
                    let skipped = usize::from(on_wall && component == k);
                    Some(Mass::lumped(axis, &pair[0], &weights, skipped, basis.functions))
                }
            }
        };
        let singular = SetupError::SingularMass { axis: k, per_cell: grid.per_cell };
        let of_components: Option<Vec<Mass>> = (0..D).map(mass).collect();
        masses.push(of_components.ok_or(singular)?);
    }
    Ok(array::from_fn(|k| array::from_fn(|c| masses[k][c].clone())))
}

/// Fits of coefficients to values, by axis and component; or the axis whose particles do not determine them.
pub(super) fn fits<const D: usize>(
    grid: &Grid<D>,
    bases: &[[Basis; 2]; D],
    lines: &[Line; D],
) -> Result<[[Fit; D]; D], usize> {
    let mut fits = Vec::with_capacity(D);
    for k in 0..D {
        let fit = |c: usize| Fit::new(&grid.axes[k], c, along(bases, k, c), &lines[k].weights);
        let of_components: Option<Vec<Fit>> = (0..D).map(fit).collect();
        fits.push(of_components.ok_or(k)?);
    }
    Ok(array::from_fn(|k| array::from_fn(|c| fits[k][c].clone())))
}

/// Components that are given the same on a side, at the same places.
pub(super) struct Given<const D: usize> {
    moved: bool,
    components: [bool; D],
    /// Ends of each axis that belong to the places: where the motion of these components is given as well.
    ends: [[bool; 2]; D],
}

impl<const D: usize> Given<D> {
    /// One component on a side, of which the motion or the traction is given.
    pub(super) fn of(axes: &[Axis; D], side: Side, component: usize, moved: bool) -> Self {
        let ends = array::from_fn(|k| match k == side.axis || !moved {
            true => [false; 2],
            false => axes[k].moved(component),
        });
        Self { moved, components: array::from_fn(|k| k == component), ends }
    }
}

/// The components of a side of which something is given, those together that have the same places.
fn given<const D: usize>(axes: &[Axis; D], side: Side) -> Vec<Given<D>> {
    let end = axes[side.axis].ends[usize::from(side.upper)];
    let mut all: Vec<Given<D>> = Vec::new();
    for c in 0..D {
        let moved = end.has(c, ComponentCondition::PrescribedMotion);
        if !moved && !end.has(c, ComponentCondition::PrescribedTraction) {
            continue;
        }
        let own = Given::of(axes, side, c, moved);
        match all.iter_mut().find(|other| other.moved == moved && other.ends == own.ends) {
            Some(other) => other.components[c] = true,
            None => all.push(own),
        }
    }
    all
}

/// Both sides of each axis.
fn sides<const D: usize>() -> impl Iterator<Item = Side> {
    (0..D).flat_map(|axis| [false, true].map(|upper| Side { axis, upper }))
}

/// The sides where something is given.
pub(super) fn faces<const D: usize>(grid: &Grid<D>, lines: &[Line; D]) -> Vec<Face<D>> {
    let of_side = |side: Side| {
        let given = given(&grid.axes, side).into_iter();
        given.map(move |given| face(grid, lines, side, &given))
    };
    sides::<D>().flat_map(of_side).collect()
}

/// The places of a side where some components are given.
pub(super) fn face<const D: usize>(
    grid: &Grid<D>,
    lines: &[Line; D],
    side: Side,
    given: &Given<D>,
) -> Face<D> {
    let Side { axis, upper } = side;
    let own = if upper { grid.axes[axis].upper } else { grid.axes[axis].lower };
    // Coordinates and lengths; the lengths matter for tractions only.
    let places: [Vec<[f64; 2]>; D] = array::from_fn(|k| {
        if k == axis {
            return vec![[own, 1.0]];
        }
        let (axis, line) = (&grid.axes[k], &lines[k]);
        let ends = given.ends[k];
        let particles = line.points.iter().zip(&line.lengths).map(|(x, w)| [*x, *w]);
        let lower = ends[0].then_some([axis.lower, 0.0]);
        lower.into_iter().chain(particles).chain(ends[1].then_some([axis.upper, 0.0])).collect()
    });
    let count = places.iter().map(Vec::len).product();
    let mut face = Face {
        side,
        moved: given.moved,
        given: given.components,
        X: Vec::with_capacity(count),
        frames: Vec::new(),
        areas: Vec::new(),
        values: vec![SVector::zeros(); count],
    };
    for index in products(places.each_ref().map(Vec::len)) {
        let place = SVector::<f64, D>::from_fn(|k, _| places[k][index[k]][0]);
        let scales = grid.coordinates.scales(&place);
        let others = (0..D).filter(|k| *k != axis);
        face.X.push(grid.coordinates.place(&place));
        face.frames.extend(grid.coordinates.frame(&place));
        face.areas.push(others.map(|k| scales[k] * places[k][index[k]][1]).product());
    }
    face
}

/// All index tuples below `counts`, the first index fastest.
pub(super) fn products<const D: usize>(counts: [usize; D]) -> impl Iterator<Item = [usize; D]> {
    (0..counts.iter().product()).map(move |place| split(place, &counts))
}

/// The index tuple of a place, the first index fastest.
pub(super) fn split<const D: usize>(mut place: usize, counts: &[usize; D]) -> [usize; D] {
    counts.map(|count| {
        let index = place % count;
        place /= count;
        index
    })
}

/// The body at rest.
pub(super) fn particles<const D: usize>(
    grid: &Grid<D>,
    lines: &[Line; D],
    density: f64,
) -> Particles<f64, D> {
    let count = lines.iter().map(|line| line.points.len()).product();
    let mut X = Vec::with_capacity(count);
    let mut volume = Vec::with_capacity(count);
    for index in products(lines.each_ref().map(|line| line.points.len())) {
        let place = SVector::<f64, D>::from_fn(|k, _| lines[k].points[index[k]]);
        X.push(grid.coordinates.place(&place));
        volume.push((0..D).map(|k| lines[k].weights[index[k]]).product());
    }
    Particles {
        x: X.clone(),
        v: vec![SVector::zeros(); count],
        F: vec![SMatrix::identity(); count],
        mass: volume.iter().map(|V| V * density).collect(),
        half_size: SVector::from_fn(|k, _| grid.axes[k].spacing() / (2.0 * grid.per_cell as f64)),
        X,
        volume,
        ..Particles::default()
    }
}

pub(super) fn check<const D: usize>(
    grid: &Grid<D>,
    scheme: &Scheme,
    density: f64,
    time_step: f64,
) -> Result<(), SetupError> {
    positive("the time step", time_step)?;
    let degree = scheme.degree;
    if !(2..=MOST_DEGREE).contains(&degree) {
        return Err(SetupError::Degree { degree, most: MOST_DEGREE });
    }
    check_grid(grid, degree, density)
}

fn positive(quantity: &str, value: f64) -> Result<(), SetupError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(SetupError::NotPositive { quantity: quantity.into(), value })
}

/// Refuses a body and its grid where they make no sense for splines of a degree.
pub(super) fn check_grid<const D: usize>(
    grid: &Grid<D>,
    degree: usize,
    density: f64,
) -> Result<(), SetupError> {
    positive("the density", density)?;
    positive("the number of particles per cell", grid.per_cell as f64)?;
    for (k, axis) in grid.axes.iter().enumerate() {
        if axis.cells == 0 {
            return Err(SetupError::NoCells { axis: k });
        }
        positive(&format!("the length of axis {k}"), axis.upper - axis.lower)?;
        let of = |kind: End| axis.ends.map(|end| end == kind);
        // The mirror images of splines at a wall have to be splines: those at a clamped end are not.
        let [lower, upper] = of(End::Wall);
        if lower != upper && axis.cells < degree {
            return Err(SetupError::TooFewCells { axis: k, cells: axis.cells, least: degree });
        }
        let [lower, upper] = of(End::Periodic);
        if lower != upper {
            return Err(SetupError::HalfPeriodic { axis: k });
        }
        let [first, last] = of(End::Uniform);
        if first != last || (first && axis.cells != 1) {
            return Err(SetupError::HalfUniform { axis: k });
        }
        if lower && axis.cells <= degree {
            return Err(SetupError::TooFewCells { axis: k, cells: axis.cells, least: degree + 1 });
        }
    }
    grid.coordinates.check(&grid.axes.map(|axis| [axis.lower, axis.upper]))
}

/// Asks for all the memory of a run with so many internal variables of a particle first, which turns a grid that is too large into an error instead of an abort.
pub(super) fn reserve<const D: usize>(
    grid: &Grid<D>,
    degree: usize,
    variables: usize,
) -> Result<(), SetupError> {
    let points = grid.axes.iter().map(|axis| axis.count(grid.per_cell) as f64);
    let of_memory = match variables {
        0 => 0.0,
        variables => points.product::<f64>() * (variables + D * D) as f64,
    };
    // Saturates where no integer is large enough.
    let bytes = ((doubles(grid, degree) + of_memory) * size_of::<f64>() as f64) as u128;
    let too_large = || SetupError::GridTooLarge {
        cells: grid.axes.iter().map(|axis| axis.cells).collect(),
        bytes,
    };
    let size = usize::try_from(bytes).map_err(|_| too_large())?;
    Vec::<u8>::new().try_reserve_exact(size).map_err(|_| too_large())
}

/// How many numbers of 64 bits a run keeps, walls taken for ends with as many functions as the others have.
pub(super) fn doubles<const D: usize>(grid: &Grid<D>, degree: usize) -> f64 {
    let curvilinear = grid.coordinates.are_curvilinear();
    let in_vector = D as f64;
    let in_matrix = in_vector * in_vector;
    let in_frame = if curvilinear { in_matrix } else { 0.0 };
    let points = grid.axes.each_ref().map(|axis| axis.count(grid.per_cell) as f64);
    let functions = grid.axes.each_ref().map(|axis| axis.cells as f64 + degree as f64);
    let width = degree as f64 + 1.0;
    let count = |along: &dyn Fn(usize) -> f64| (0..D).map(along).product::<f64>();
    // Positions, velocities, values and the body force; gradients and slopes; masses and volumes.
    let mut doubles = count(&|k| points[k]) * (5.0 * in_vector + 2.0 * in_matrix + 2.0);
    // Displacements, velocities, accelerations, given ones and two products of the mass matrix.
    doubles += count(&|k| functions[k]) * (6.0 * in_vector);
    for axis in 0..D {
        if axis + 1 < D {
            let partial = count(&|k| if k <= axis { points[k] } else { functions[k] });
            doubles += partial * in_vector * (axis as f64 + 2.0);
        }
        // Of both kinds of components: values, slopes and the first function; of each component a weight and three matrices.
        doubles += 2.0 * points[axis] * (2.0 * width + 1.0);
        doubles += in_vector * (points[axis] + functions[axis] * 3.0 * width);
        // On sides: positions, values, an area, and the frame.
        let given = sides::<D>()
            .filter(|side| side.axis == axis)
            .map(|side| given(&grid.axes, side).len())
            .sum::<usize>();
        let places = count(&|k| if k == axis { 1.0 } else { points[k] });
        doubles += given as f64 * places * (2.0 * in_vector + 1.0 + in_frame);
    }
    if curvilinear {
        doubles += points[0] + count(&|k| if k == 0 { 1.0 } else { points[k] }) * (in_frame + 2.0);
    }
    doubles
}
