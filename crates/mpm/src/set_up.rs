//! The checks of a scene, and all memory of its run.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::determinant;
use mmsmith_laws::{AnyLaw, Law, Material, NeoHookean, NeoHookeanNoLog};
use mmsmith_particles::columns::Shares;
use mmsmith_particles::mesh::Interpolation;
use mmsmith_particles::{Body, Grid, Particles, SetupError};
use nalgebra::{RealField, SMatrix, SVector};

use crate::domain::corners::Corners;
use crate::domain::of_particles::Domain;
use crate::domain::shared_corners::SharedCorners;
use crate::domain::{self, Shape};
use crate::every_scheme::{EVERY_SCHEME, beyond};
use crate::grid::bins::Bins;
use crate::grid::geometry::Constants;
use crate::grid::node::Node;
use crate::grid::state::GridState;
use crate::grid::tiles::Tiles;
use crate::grid::volume_rates::VolumeRates;
use crate::grid::{Layout, Sides};
use crate::kernel::block::{BlockLaw, MemoryBlocks, OwnBlocks};
use crate::kernel::buffers::BufferPool;
use crate::kernel::half_plane;
use crate::kernel::projected::ProjectedBlocks;
use crate::processes::decomposition::{LocalBody, Share};
use crate::scheme::{Integrator, Settings, Transfer, VelocityUpdate};
use crate::step::is_fused;
use crate::step::passes::Passes;
use crate::step::state::{EarlyState, State};

/// A value for error messages, of any scalar type.
pub(crate) fn figure<T: RealField>(value: T) -> f64 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN)
}

/// The law, for blocks of particles.
pub(crate) fn of_blocks<T: Lanes, const D: usize>(law: &Law<T, D>) -> Box<dyn BlockLaw<T, D>> {
    let planted = mmsmith_laws::fault::Planted::here();
    let material = match law {
        Law::Library(material) => *material,
        Law::Own(law) => return Box::new(OwnBlocks(law.clone())),
        Law::WithMemory(law) => {
            let own = || law.own_projected_law().map(Law::Own);
            if law.is_projected()
                && let Some(elastic) = law.elastic().map(Law::Library).or_else(own)
            {
                return Box::new(ProjectedBlocks::new(law.clone(), of_blocks(&elastic)));
            }
            let of_half_plane =
                law.of_half_plane().and_then(|law| half_plane::of_law(law, planted));
            return of_half_plane.unwrap_or_else(|| Box::new(MemoryBlocks::new(law.clone())));
        }
    };
    // One law has kernels of its own; those of `AnyLaw` serve every law.
    if let Material::NeoHookean { lambda, mu } = material {
        return if lambda == T::zero() {
            Box::new(NeoHookeanNoLog { mu })
        } else {
            Box::new(NeoHookean { lambda, mu, planted })
        };
    }
    Box::new(AnyLaw(planted.law_in_stresses(material)))
}

/// Whether the crate is compiled for these settings.
fn is_compiled<T>(settings: &Settings<T>) -> bool {
    let Settings { shape, integrator, transfer, .. } = *settings;
    EVERY_SCHEME || (shape, integrator, transfer) == (Shape::Gimp, Integrator::Cd, Transfer::Flip)
}

/// Refuses a quantity that is not a positive number.
fn positive<T: RealField + Copy>(
    quantity: &dyn Fn() -> String,
    value: T,
) -> Result<(), SetupError> {
    if value > T::zero() && value.is_finite() {
        return Ok(());
    }
    Err(SetupError::NotPositive { quantity: quantity(), value: figure(value) })
}

/// Refuses a scene that makes no sense.
pub(crate) fn check<T: Lanes, const D: usize>(
    grid: &Grid<T, D>,
    body: &Body<T, D>,
    settings: &Settings<T>,
    share: Option<&Share>,
) -> Result<(), SetupError> {
    positive(&|| "the time step".into(), settings.time_step)?;
    positive(&|| "the grid spacing".into(), grid.spacing)?;
    let update = settings.transfer.velocity_update();
    if matches!(update, VelocityUpdate::FilteredReplace(filter) if filter.order == 0) {
        let quantity = "the order of XPIC".into();
        return Err(SetupError::NotPositive { quantity, value: 0.0 });
    }
    if grid.lower.iter().any(|x| !x.is_finite()) {
        return Err(SetupError::NotFinite { quantity: "the lower corner of the grid".into() });
    }
    if settings.halve_first_acceleration && !settings.integrator.is_staggered() {
        return Err(SetupError::HalvedStart { integrator: settings.integrator.to_string() });
    }
    check_particles(body, share)?;
    let is_product = !matches!(settings.shape, Shape::Cpdi | Shape::Cpdi2);
    if body.revolves && !(is_product && D == 3 && grid.cells.get(1) == Some(&1)) {
        return Err(SetupError::Revolving { shape: settings.shape.to_string() });
    }
    check_domains(body, settings.shape)?;
    if EVERY_SCHEME { check_mesh(grid, body, settings.shape, share) } else { Ok(()) }
}

fn check_particles<T: Lanes, const D: usize>(
    body: &Body<T, D>,
    share: Option<&Share>,
) -> Result<(), SetupError> {
    let Body { particles, half_edges, .. } = body;
    let Particles { X, x, v, F, mass, volume, .. } = particles;
    let expected = X.len();
    let boxes = if half_edges.is_empty() { expected } else { half_edges.len() };
    for (array, found) in [
        ("x", x.len()),
        ("v", v.len()),
        ("F", F.len()),
        ("mass", mass.len()),
        ("volume", volume.len()),
        ("half_edges", boxes),
        ("ids", share.map_or(expected, |share| share.ids.len())),
    ] {
        if found != expected {
            return Err(SetupError::LengthMismatch { array, found, expected });
        }
    }
    if expected == 0 && share.is_none() {
        return Err(SetupError::NoParticles);
    }
    let limit = u32::MAX as usize;
    if expected > limit {
        return Err(SetupError::TooManyParticles { particles: expected, limit });
    }
    for p in 0..expected {
        positive(&|| format!("the mass of particle {p}"), mass[p])?;
        positive(&|| format!("the volume of particle {p}"), volume[p])?;
        for (name, values) in [("reference position", &X[p]), ("velocity", &v[p])] {
            if values.iter().any(|value| !value.is_finite()) {
                let quantity = format!("the {name} of particle {p}");
                return Err(SetupError::NotFinite { quantity });
            }
        }
    }
    Ok(())
}

fn check_domains<T: Lanes, const D: usize>(
    body: &Body<T, D>,
    shape: Shape,
) -> Result<(), SetupError> {
    let Body { particles: Particles { half_size, .. }, half_edges, .. } = body;
    let of_boxes = matches!(shape, Shape::Ugimp | Shape::Gimp | Shape::GimpBspline2);
    if of_boxes || (shape == Shape::Cpdi && half_edges.is_empty()) {
        for (axis, &l) in half_size.iter().enumerate() {
            positive(&|| format!("the half-size of particles along axis {axis}"), l)?;
        }
    }
    let of_box = SMatrix::from_diagonal(half_size);
    for (particle, E) in half_edges.iter().enumerate() {
        if of_boxes && *E != of_box {
            return Err(SetupError::NotABox { particle });
        }
        if shape == Shape::Cpdi {
            positive(&|| format!("the domain of particle {particle}"), determinant(E))?;
        }
    }
    Ok(())
}

fn check_mesh<T: Lanes, const D: usize>(
    grid: &Grid<T, D>,
    body: &Body<T, D>,
    shape: Shape,
    share: Option<&Share>,
) -> Result<(), SetupError> {
    let Some(mesh) = &body.mesh else {
        return if shape == Shape::Cpdi2 { Err(SetupError::NoCorners) } else { Ok(()) };
    };
    // Other shapes leave the corners of cells alone.
    if mesh.interpolation == Interpolation::Cell && shape != Shape::Cpdi2 {
        return Ok(());
    }
    if domain::at_corners(shape, mesh).is_none() {
        return Err(SetupError::NotOfPolygons { shape: shape.to_string() });
    }
    if share.is_some() && mesh.numbers.is_none() {
        return Err(SetupError::NoNumbers);
    }
    if mesh.turn.is_some() && grid.walls.iter().flatten().any(|is_wall| *is_wall) {
        return Err(SetupError::TurnedWalls);
    }
    mesh.check(body.particles.X.len())
}

/// The grids that a scheme needs beside that of its nodes.
#[derive(Clone, Copy)]
struct OtherGrids {
    /// For velocities that are projected again.
    reprojected: bool,
    /// For the sums of the next step.
    ahead: bool,
    /// For means of the change of volume.
    means: bool,
    /// For filtered velocities.
    filtered: bool,
}

impl OtherGrids {
    fn of<T>(settings: &Settings<T>, projects: bool, has_corners: bool) -> Self {
        let &Settings { integrator, transfer, .. } = settings;
        let fused = is_fused(integrator, transfer) && !projects;
        let filtered = transfer.is_filtered();
        Self {
            reprojected: integrator.reprojects() || filtered,
            // Sums for the next step are on a grid of their own, unless they are at corners.
            ahead: filtered || (fused && !has_corners),
            means: projects,
            filtered,
        }
    }

    fn bytes_per_node<T, const D: usize>(self) -> usize {
        let others = [self.reprojected, self.ahead, self.means, self.means];
        let grids = 1 + others.map(usize::from).iter().sum::<usize>();
        let of_filter = if self.filtered { size_of::<SVector<T, D>>() } else { 0 };
        grids * size_of::<Node<T, D>>() + of_filter
    }

    /// Reserves all grids, then makes the bins: a grid that memory has no room for is told before these ask for their part.
    fn allocate<T: Lanes, const D: usize>(
        self,
        grid: &Grid<T, D>,
        constants: Constants<T, D>,
        (layout, bins): (Layout<D>, impl FnOnce() -> Bins<Node<T, D>, D>),
    ) -> Result<GridState<T, D>, SetupError> {
        let nodes = |is_needed: bool| {
            reserve(if is_needed { layout.nodes } else { 0 }).ok_or_else(|| {
                SetupError::GridTooLarge {
                    cells: grid.cells.to_vec(),
                    bytes: layout.nodes as u128 * self.bytes_per_node::<T, D>() as u128,
                }
            })
        };
        Ok(GridState {
            constants,
            nodes: nodes(true)?,
            reprojected: nodes(self.reprojected)?,
            next: nodes(self.ahead)?,
            means: nodes(self.means)?,
            means_again: nodes(self.means)?,
            is_ahead: false,
            rates: None,
            filtered: if self.filtered { vec![SVector::zeros(); layout.nodes] } else { Vec::new() },
            layout,
            bins: bins(),
        })
    }
}

/// Reserves all memory of a run.
pub(crate) fn allocate<T: Lanes, const D: usize>(
    grid: &Grid<T, D>,
    body: Body<T, D>,
    mut law: Box<dyn BlockLaw<T, D>>,
    settings: &Settings<T>,
    share: Option<Share>,
) -> Result<State<T, D>, SetupError> {
    let is_usual = is_compiled(settings) && share.is_none() && !law.is_projected();
    if !EVERY_SCHEME && !is_usual {
        return Err(SetupError::UsualSchemeOnly);
    }
    let Settings { shape, integrator, transfer, .. } = *settings;
    let Body { mut particles, half_edges, mesh, revolves, sticks } = body;
    // The same, as a constant.
    let shape = if EVERY_SCHEME { shape } else { Shape::Gimp };
    let count = particles.x.len();
    let domain = match revolves {
        true => domain::revolving(shape, &particles.half_size, grid.spacing)
            .ok_or_else(|| SetupError::Revolving { shape: shape.to_string() })?,
        false => domain::new(shape, half_edges, &particles.half_size, grid.spacing),
    };
    let corners = mesh.filter(|_| EVERY_SCHEME).and_then(|mesh| {
        let at_corner = domain::at_corners(shape, &mesh)?;
        Some(SharedCorners::new(mesh, at_corner))
    });
    let shares = fill(&mut particles, &*law, transfer.is_affine())?;
    let projects = law.is_projected();
    if revolves && projects {
        return Err(SetupError::ProjectedHalfPlane);
    }
    let follows_grid = projects && corners.is_none() && domain.exchanges_scalars();
    if follows_grid {
        law.follow_grid();
    }
    let others = OtherGrids::of(settings, projects && !follows_grid, corners.is_some());
    let sides = Sides { around: revolves.then_some(1), sticks };
    let mut layout = Layout::with_sides(grid, &sides, others.bytes_per_node::<T, D>())?;
    let points = corners.as_ref().map_or(count, SharedCorners::count);
    let most_nodes = match &corners {
        Some(corners) => Domain::<T, D>::most_nodes(&corners.at_corner),
        None => domain.most_nodes(),
    };
    let tiles = Tiles::new(&layout, &grid.cells, most_nodes);
    let part = share.map(|share| LocalBody::new(share, &layout, &tiles)).transpose()?;
    let part = part.and_then(beyond);
    if part.is_some() {
        // The first sort tells which nodes this process holds.
        let first_row = layout.held.along(D - 1, 0..1);
        layout.hold(first_row);
    }
    let Particles { mass, volume, .. } = &particles;
    let least = |numbers: &mut dyn Iterator<Item = T>| {
        let least = numbers.reduce(|least, number| least.min(number));
        match &part {
            Some(part) => part.least(least),
            None => least.unwrap_or(T::one()),
        }
    };
    let least_mass = least(&mut mass.iter().copied());
    let density = least(&mut mass.iter().zip(volume).map(|(&mass, &volume)| mass / volume));
    let mass_of_cell = density * grid.spacing.powi(D as i32);
    let uniform = particles.uniform();
    let corners = corners.and_then(|corners| {
        let (is_affine, reprojects) = (transfer.is_affine(), integrator.reprojects());
        let of_body = (mass_of_cell, law.follows_position());
        beyond(Corners::new(corners, of_body, is_affine, reprojects))
    });
    let mut constants = Constants::new(grid, &layout, &tiles, settings.time_step, least_mass);
    if follows_grid {
        constants.sent += 1;
    }
    let bins = || {
        let mut bins = Bins::new(tiles, points);
        if let Some(part) = &part {
            bins.share_out(part.ranks.clone());
        }
        bins
    };
    let mut grid = others.allocate(grid, constants, (layout, bins))?;
    grid.rates = follows_grid.then(|| beyond(VolumeRates::new(mass_of_cell))).flatten();
    let is_kept = integrator.early() > 0.0;
    let early = EarlyState {
        F: if is_kept { vec![SMatrix::identity(); count] } else { Vec::new() },
        internal: if is_kept { particles.internal.clone() } else { Vec::new() },
        is_kept,
    };
    let (buffers, of_time) = (BufferPool::new(), Vec::new());
    Ok(State {
        particles,
        domain,
        corners,
        law,
        transfer,
        shares,
        uniform,
        grid,
        part,
        early,
        buffers,
        of_time,
        passes: Passes::default(),
    })
}

/// Fills the columns that a law with internal variables, and affine velocities, ask for.
fn fill<T: Lanes, const D: usize>(
    particles: &mut Particles<T, D>,
    law: &dyn BlockLaw<T, D>,
    is_affine: bool,
) -> Result<Shares, SetupError> {
    let (count, variables) = (particles.x.len(), law.variables());
    let (found, expected) = (particles.internal.len(), count * variables);
    if found == 0 {
        particles.internal = particles.X.iter().flat_map(|X| law.initial(X)).collect();
        if law.is_projected() {
            for (own, F) in particles.internal.chunks_exact_mut(variables).zip(&particles.F) {
                own[0] = determinant(F);
            }
        }
    } else if found != expected {
        return Err(SetupError::LengthMismatch { array: "internal", found, expected });
    }
    let shares = Shares { affine: is_affine.into(), internal: variables, ..Shares::ONE };
    particles.affine = Vec::new();
    particles.fill(&shares);
    Ok(shares)
}

/// So many nodes; none where they do not fit into memory, which asking first turns into an error instead of an abort.
fn reserve<T: Lanes, const D: usize>(count: usize) -> Option<Vec<Node<T, D>>> {
    let mut nodes = Vec::new();
    nodes.try_reserve_exact(count).ok()?;
    nodes.resize(count, Node::zero());
    Some(nodes)
}
