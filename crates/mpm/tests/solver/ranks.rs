//! Several processes, here threads with messages, simulate a body to the bits of one.

#![allow(clippy::unwrap_used)]

use mmsmith_clip::{Clip, Side};
use mmsmith_mpm::{
    Body, BodyForce, Grid, Integrator, Interpolation, Law, Load, Material, SavedState,
    SavedStateError, Scalar, Settings, SetupError, Shape, Share, Simulation, StepError, Transfer,
};
use mmsmith_ranks::{Ranks, arranged, counted, in_process};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

use crate::polygons::loaded;
use crate::revolving;
use crate::schemes::{self, noise};

/// A column: walls at its foot and sides, long enough for several processes.
pub(crate) fn grid<const D: usize>() -> Grid<f64, D> {
    let mut grid = Grid {
        lower: SVector::repeat(-0.25),
        spacing: 0.125,
        cells: [5; D],
        walls: [[true, false]; D],
    };
    grid.cells[D - 1] = if D == 1 { 1536 } else { 64 };
    if D == 3 {
        // A layer of two tiles.
        grid.cells[1] = 11;
    }
    grid.walls[D - 1] = [true, true];
    grid
}

/// A deformed body of unequal masses that flies up from the foot, or in the middle of the column down.
pub(crate) fn body<const D: usize>(speed: f64, is_uniform: bool) -> Body<f64, D> {
    let (height, grid) = (if D == 1 { 120.0 } else { 4.0 }, grid::<D>());
    let foot = if speed < 0.0 { 2.0 } else { -0.25 };
    let inside = |X: &SVector<f64, D>| {
        (0..D - 1).all(|a| (D == 3 && a == 1) || X[a] < 0.25)
            && X[D - 1] > foot
            && X[D - 1] < foot + height
    };
    let mut body = Body::lattice(&grid, 2, 2.0, inside);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.v[k][D - 1] += speed;
        p.F[k] += SMatrix::from_fn(|i, j| 0.05 * noise(11 * k + 3 * i + j));
        if !is_uniform {
            p.mass[k] *= 1.0 + 0.1 * noise(k);
        }
    }
    body
}

pub(crate) fn law() -> Material<f64> {
    Material::NeoHookean { lambda: 60.0, mu: 40.0 }
}

/// That law with changes of volume that follow the grid, or are projected.
fn projected<const D: usize>() -> Law<f64, D>
where
    f64: Scalar<D>,
{
    mmsmith_laws::with_projected_volume(law().into()).unwrap()
}

fn body_force<const D: usize>(X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]) {
    for (X, b) in X.iter().zip(b) {
        *b = X.map(|x| (3.0 * x + 5.0 * t).sin());
    }
}

/// That body force, and a stress on the boundary where bodies have loads there.
struct Forced;

impl<const D: usize> BodyForce<f64, D> for Forced {
    fn evaluate(&self, _: usize, X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]) {
        body_force(X, t, b);
    }

    fn boundary_stress(&self, loads: &[Load<f64, D>], t: f64, stress: &mut [SMatrix<f64, D, D>]) {
        for (stress, Load { X, .. }) in stress.iter_mut().zip(loads) {
            *stress = SMatrix::from_fn(|i, j| (4.0 * X[i] + 3.0 * X[j] + t).sin());
        }
    }
}

/// The particles of `body` that a process begins with, and their numbers: some here, some there.
pub(crate) fn share<const D: usize>(
    body: &Body<f64, D>,
    ranks: &dyn Ranks,
) -> (Body<f64, D>, Vec<u64>) {
    let count = body.particles.len();
    let is_own = |p: &usize| p / 7 % ranks.count() == ranks.rank();
    let own: Vec<usize> = (0..count).filter(is_own).collect();
    let mut part = body.clone();
    let p = &body.particles;
    part.particles.X = own.iter().map(|&k| p.X[k]).collect();
    part.particles.x = own.iter().map(|&k| p.x[k]).collect();
    part.particles.v = own.iter().map(|&k| p.v[k]).collect();
    part.particles.F = own.iter().map(|&k| p.F[k]).collect();
    part.particles.mass = own.iter().map(|&k| p.mass[k]).collect();
    part.particles.volume = own.iter().map(|&k| p.volume[k]).collect();
    part.half_edges = own.iter().filter_map(|&k| body.half_edges.get(k).copied()).collect();
    part.mesh = body.mesh.as_ref().map(|mesh| mesh.part(&own));
    (part, own.into_iter().map(|id| id as u64).collect())
}

/// State of a particle: number, position, velocity, deformation gradient.
pub(crate) type Of<const D: usize> = (u64, SVector<f64, D>, SVector<f64, D>, SMatrix<f64, D, D>);

pub(crate) fn state<const D: usize>(simulation: &mut Simulation<f64, D>) -> Vec<Of<D>>
where
    f64: Scalar<D>,
{
    let ids = simulation.arrangement().map(|arrangement| arrangement.ids.to_vec());
    let p = simulation.own_particles();
    let ids: Vec<u64> = ids.unwrap_or_else(|| (0..p.len() as u64).collect());
    (0..p.len()).map(|k| (ids[k], p.x[k], p.v[k], p.F[k])).collect()
}

/// Steps that a body flies, with the particles of a process after them, and the error that ended them.
pub(crate) fn fly<const D: usize>(
    simulation: &mut Simulation<f64, D>,
    steps: usize,
) -> (Vec<Of<D>>, Option<StepError>, u64)
where
    f64: Scalar<D>,
{
    let end = (0..steps).find_map(|_| simulation.step(&Forced).err());
    (state(simulation), end, simulation.arrangement().map_or(0, |found| found.version))
}

fn agrees<const D: usize>(settings: Settings<f64>, counts: &[usize], speed: f64, steps: usize)
where
    f64: Scalar<D>,
{
    let whole = body::<D>(speed, settings.transfer == Transfer::Flip);
    agrees_on((&grid::<D>(), &whole, law().into()), settings, counts, steps);
}

fn agrees_on<const D: usize>(
    (grid, whole, law): (&Grid<f64, D>, &Body<f64, D>, Law<f64, D>),
    settings: Settings<f64>,
    counts: &[usize],
    steps: usize,
) where
    f64: Scalar<D>,
{
    let processes: Vec<_> = counts.iter().map(|&count| (count, None)).collect();
    agrees_in((grid, whole, law), settings, &processes, steps);
}

/// With so many processes each time, and so many of them along each axis where that is told.
fn agrees_in<const D: usize>(
    (grid, whole, law): (&Grid<f64, D>, &Body<f64, D>, Law<f64, D>),
    settings: Settings<f64>,
    processes: &[(usize, Option<[usize; D]>)],
    steps: usize,
) where
    f64: Scalar<D>,
{
    let set_up = || Simulation::new(grid.clone(), whole.clone(), law.clone(), settings).unwrap();
    let (expected, error, _) = fly(&mut set_up(), steps);
    assert_ne!(expected, state(&mut set_up()));
    for &(count, along_axes) in processes {
        let found = in_process(count, |ranks| {
            let (body, ids) = share(whole, &*ranks);
            let ranks = match along_axes {
                Some(along_axes) => arranged(ranks, along_axes.to_vec()),
                None => ranks,
            };
            let share = Share { ranks, ids };
            let mut part =
                Simulation::shared_out(grid.clone(), body, share, law.clone(), settings).unwrap();
            fly(&mut part, steps)
        });
        let what = format!("{count} processes {along_axes:?}, {steps} steps, {settings:?}");
        let sorted = found[0].2;
        // Cuts or particles have moved on the way.
        assert!(error.is_some() || sorted > 1, "{what}: sorted {sorted} times");
        for (particles, found, _) in &found {
            assert_eq!(found, &error, "{what}");
            assert!(particles.is_sorted_by_key(|of| of.0), "{what}");
        }
        let mut all: Vec<Of<D>> = found.into_iter().flat_map(|(particles, ..)| particles).collect();
        all.sort_by_key(|of| of.0);
        assert_eq!(all.len(), expected.len(), "{what}");
        // As text: what is not a number equals itself.
        let other = all.iter().zip(&expected).find(|(a, b)| format!("{a:?}") != format!("{b:?}"));
        assert_eq!(other, None, "{what}, {error:?}, sorted {sorted} times");
    }
}

/// A grid that can be cut along all axes, with a body from the walls at its foot and its left side across the first cut along each; it flies away from
/// these walls.
pub(crate) fn wide<const D: usize>(is_uniform: bool) -> (Grid<f64, D>, Body<f64, D>)
where
    f64: Scalar<D>,
{
    let mut grid = grid::<D>();
    let (cells, body): (&[usize], &[usize]) = match D {
        2 => (&[200, 48], &[75, 20]),
        _ => (&[260, 17, 40], &[5, 5, 12]),
    };
    grid.cells.copy_from_slice(cells);
    let at = |X: &SVector<f64, D>, a: usize| (X[a] - grid.lower[a]) / grid.spacing;
    // In space about the edges where four processes meet.
    let centre = |a: usize| if D == 3 && a < 2 { [130.0, 8.5][a] } else { 0.0 };
    let inside =
        |X: &SVector<f64, D>| (0..D).all(|a| (at(X, a) - centre(a)).abs() < body[a] as f64);
    let mut body = Body::lattice(&grid, 2, 2.0, inside);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 12.0 + 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.05 * noise(11 * k + 3 * i + j));
        if !is_uniform {
            p.mass[k] *= 1.0 + 0.1 * noise(k);
        }
    }
    (grid, body)
}

/// A body in a grid that has so many more cells on both sides along each axis.
pub(crate) fn widened<const D: usize>(
    (mut grid, body): (Grid<f64, D>, Body<f64, D>),
    more: &[usize],
) -> (Grid<f64, D>, Body<f64, D>) {
    for (a, &more) in more.iter().enumerate() {
        grid.cells[a] += 2 * more;
        grid.lower[a] -= more as f64 * grid.spacing;
    }
    (grid, body)
}

/// Processes along each axis, and their number.
fn along<const D: usize>(along_axes: [usize; D]) -> (usize, Option<[usize; D]>) {
    (along_axes.iter().product(), Some(along_axes))
}

#[test]
fn processes_along_several_axes_have_the_bits_of_one() {
    along_several_axes(4);
}

#[test]
#[ignore = "two minutes: .ci/long runs it"]
fn so_it_is_in_every_scheme() {
    along_several_axes(1);
}

/// Every `step`-th scheme, in space every sixth of these.
fn along_several_axes(step: usize) {
    let in_the_plane = [[2, 1], [2, 2], [3, 1], [2, 3], [3, 2], [2, 4]];
    let in_space = [[2, 2, 2], [1, 2, 2], [2, 1, 3], [1, 2, 3], [2, 2, 1]];
    for (n, settings) in schemes::schemes().map(flying).skip(step - 1).step_by(step).enumerate() {
        let is_uniform = settings.transfer == Transfer::Flip;
        let law = || if n % 4 == 1 { projected() } else { law().into() };
        let (grid, whole) = wide::<2>(is_uniform);
        let processes = along(in_the_plane[n % in_the_plane.len()]);
        agrees_in((&grid, &whole, law()), settings, &[processes], 14);
        if n % 6 == 0 {
            let law = if n % 12 == 0 { projected() } else { self::law().into() };
            let (grid, whole) = wide::<3>(is_uniform);
            let processes = along(in_space[n / 6 % in_space.len()]);
            agrees_in((&grid, &whole, law), settings, &[processes], 12);
        }
    }
}

/// Boxes that stretch beyond a cell: in one process the last block of a tile is copied behind others, in several it lies beside them.
#[test]
fn stretched_boxes_have_the_bits_of_one_process() {
    for integrator in [Integrator::Usl, Integrator::Cd] {
        let settings = flying(schemes::settings(Shape::Gimp, integrator, Transfer::Flip));
        let (grid, whole) = wide::<2>(true);
        agrees_on((&grid, &whole, law().into()), settings, &[2, 4], 14);
    }
}

#[test]
fn polygons_on_processes_along_several_axes_have_the_bits_of_one() {
    for (n, settings) in polygon_settings().enumerate() {
        let law = || if n % 2 == 0 { projected() } else { law().into() };
        let (grid, whole) = widened(polygons::<2>(40.0), &[84]);
        let processes = [[2, 2], [3, 1], [2, 3], [3, 2]][n % 4];
        agrees_in((&grid, &whole, law()), settings, &[along(processes)], 16);
        if n % 4 == 0 {
            let law = if n % 8 == 0 { projected() } else { self::law().into() };
            let (grid, whole) = widened(polygons::<3>(70.0), &[122, 4]);
            let processes = [[2, 2, 2], [1, 2, 3], [2, 1, 2]][n / 4 % 3];
            agrees_in((&grid, &whole, law), settings, &[along(processes)], 16);
        }
    }
}

#[test]
fn half_planes_on_processes_along_the_radius_have_the_bits_of_one() {
    for (n, settings) in revolving::schemes().enumerate() {
        let mut grid = revolving::grid(20.0);
        let mut whole = revolving::body(&grid, 1.0);
        whole.particles.v.iter_mut().for_each(|v| v[2] += 40.0);
        let settings = Settings { time_step: 1.0 / 512.0, ..settings };
        grid.lower[0] -= 150.0 * grid.spacing;
        grid.cells[0] += 300;
        let processes = [[2, 1, 1], [2, 1, 2], [2, 1, 3]][n % 3];
        agrees_in((&grid, &whole, law().into()), settings, &[along(processes)], 16);
    }
}

pub(crate) fn flying(settings: Settings<f64>) -> Settings<f64> {
    let halve = settings.integrator == Integrator::Cd;
    Settings { time_step: 1.0 / 256.0, halve_first_acceleration: halve, ..settings }
}

#[test]
fn every_scheme_has_the_bits_of_one_process() {
    for settings in schemes::schemes().map(flying) {
        agrees::<2>(settings, &[2, 3], 14.0, 14);
    }
}

/// With changes of volume that follow the grid, whose forces reach farther than the nodes of a particle, and with means.
#[test]
fn projected_changes_of_volume_have_the_bits_of_one_process() {
    for (n, settings) in schemes::schemes().map(flying).enumerate() {
        let whole = body::<2>(14.0, settings.transfer == Transfer::Flip);
        agrees_on((&grid(), &whole, projected()), settings, &[2 + n % 3], 14);
        if n % 9 == 0 {
            let whole = body::<1>(-16.0, false);
            agrees_on((&grid(), &whole, projected()), settings, &[4], 30);
            let whole = body::<3>(-14.0, true);
            agrees_on((&grid(), &whole, projected()), settings, &[3], 9);
        }
    }
    for (n, settings) in polygon_settings().enumerate().step_by(2) {
        let (grid, whole) = polygons::<2>(40.0);
        agrees_on((&grid, &whole, projected()), settings, &[2 + n % 4], 16);
    }
    for settings in polygon_settings().step_by(7) {
        let (grid, whole) = polygons::<3>(70.0);
        agrees_on((&grid, &whole, projected()), settings, &[3], 16);
    }
}

#[test]
fn what_is_saved_of_projected_changes_of_volume_goes_on() {
    let lattices = schemes::schemes().map(flying).step_by(5).map(|settings| {
        let settings = Settings { time_step: 1.0 / 1024.0, ..settings };
        (grid(), body::<2>(14.0, settings.transfer == Transfer::Flip), settings)
    });
    let clipped = polygon_settings().step_by(4).map(|settings| {
        let (grid, whole) = polygons::<2>(30.0);
        (grid, whole, settings)
    });
    for (n, (grid, whole, settings)) in lattices.chain(clipped).enumerate() {
        let case = || (&grid, &whole, settings, projected());
        let (many, expected) = save_and_go_on(case(), 2 + n % 3, None);
        for count in [1, 5] {
            let (again, found) = save_and_go_on(case(), count, Some(&many));
            let other = found.iter().zip(&expected).find(|(a, b)| a != b);
            assert_eq!(other, None, "{} to {count} processes, {settings:?}", many.len());
            assert_eq!(again.len(), count);
        }
    }
}

#[test]
fn so_it_is_on_a_line_and_in_space() {
    on_a_line_and_in_space(7);
}

#[test]
#[ignore = "a minute: .ci/long runs it"]
fn so_is_every_scheme_on_a_line_and_in_space() {
    on_a_line_and_in_space(1);
}

/// Every `step`-th scheme.
fn on_a_line_and_in_space(step: usize) {
    for settings in schemes::schemes().map(flying).step_by(step) {
        agrees::<1>(settings, &[2, 4], -16.0, 30);
        agrees::<3>(settings, &[3], -14.0, 9);
    }
}

#[test]
fn particles_that_turn_inside_out_are_told_alike_by_all() {
    let settings = Settings {
        shape: Shape::Gimp,
        integrator: Integrator::Usf,
        transfer: Transfer::Flip,
        time_step: 1.0 / 16.0,
        halve_first_acceleration: false,
    };
    agrees::<2>(settings, &[1, 2, 5, 7], 2.0, 40);
}

#[test]
fn more_processes_than_rows_are_refused_with_the_largest_number() {
    let whole = body::<2>(1.0, true);
    let settings = flying(schemes::schemes().next().unwrap());
    let most = in_process(9, |ranks| {
        let (body, ids) = share(&whole, &*ranks);
        let share = Share { ranks, ids };
        Simulation::shared_out(grid::<2>(), body, share, law(), settings).err()
    });
    // 64 cells are 8 layers, of which the last two go together.
    assert_eq!(most, vec![Some(SetupError::TooManyRanks { ranks: 9, most: 7 }); 9]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn random_settings_have_the_bits_of_one_process(
        scheme in 0..schemes::schemes().count(),
        count in 1..8_usize,
        speed in -15.0..15.0_f64,
        steps in 14..20_usize,
    ) {
        let settings = flying(schemes::schemes().nth(scheme).unwrap());
        // Particles have at most five rows left to the end of their window: six and more flown, they are sorted once more.
        let speed = speed + 14.0 * speed.signum();
        agrees::<2>(settings, &[count], speed, steps);
    }
}

#[test]
fn a_body_that_fills_the_grid_from_wall_to_wall_has_the_bits_of_one_process() {
    let mut grid = grid::<2>();
    for (cells, shape) in
        [(48, Shape::Gimp), (56, Shape::Bspline2), (63, Shape::Gimp), (64, Shape::Bspline3)]
    {
        grid.cells[1] = cells;
        let settings = flying(schemes::settings(shape, Integrator::Cd, Transfer::Flip));
        let mut whole = Body::lattice(&grid, 2, 2.0, |_| true);
        for (k, v) in whole.particles.v.iter_mut().enumerate() {
            *v = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        }
        for steps in [0, 1, 2, 6] {
            let mut alone = Simulation::new(grid.clone(), whole.clone(), law(), settings).unwrap();
            let (expected, ..) = fly(&mut alone, steps);
            for count in 1..cells / 8 {
                let found = in_process(count, |ranks| {
                    let (body, ids) = share(&whole, &*ranks);
                    let share = Share { ranks, ids };
                    let mut part =
                        Simulation::shared_out(grid.clone(), body, share, law(), settings).unwrap();
                    fly(&mut part, steps).0
                });
                let mut all: Vec<Of<2>> = found.concat();
                all.sort_by_key(|of| of.0);
                let other: Vec<_> = all.iter().zip(&expected).filter(|(a, b)| a != b).collect();
                assert_eq!(
                    other.first(),
                    None,
                    "{} of {} differ: {count} processes, {cells} cells, {steps} steps, {shape:?}",
                    other.len(),
                    all.len()
                );
            }
        }
    }
}

/// The states that `count` processes save after some steps, each its part, and what they come to in some more.
fn save_and_go_on<const D: usize>(
    case: (&Grid<f64, D>, &Body<f64, D>, Settings<f64>, Law<f64, D>),
    count: usize,
    taken_up: Option<&[SavedState]>,
) -> (Vec<SavedState>, Vec<Of<D>>)
where
    f64: Scalar<D>,
{
    save_and_go_on_in(case, (count, None), taken_up)
}

/// As [`save_and_go_on`], with so many processes along each axis where that is told.
fn save_and_go_on_in<const D: usize>(
    (grid, whole, settings, law): (&Grid<f64, D>, &Body<f64, D>, Settings<f64>, Law<f64, D>),
    (count, along_axes): (usize, Option<[usize; D]>),
    taken_up: Option<&[SavedState]>,
) -> (Vec<SavedState>, Vec<Of<D>>)
where
    f64: Scalar<D>,
{
    let found = in_process(count, |ranks| {
        let rank = ranks.rank();
        let ranks = match along_axes {
            Some(along_axes) => arranged(ranks, along_axes.to_vec()),
            None => ranks,
        };
        let (body, ids) = share(whole, &*ranks);
        let share = Share { ranks, ids };
        let mut part =
            Simulation::shared_out(grid.clone(), body, share, law.clone(), settings).unwrap();
        match taken_up {
            // What continues has gone another way before.
            Some(parts) => {
                fly(&mut part, 2);
                let own = parts.iter().skip(rank).step_by(count).cloned().collect();
                part.take_up(own).unwrap();
            }
            None => assert_eq!(fly(&mut part, 7).1, None),
        }
        let saved: SavedState = part.state().iter().map(|array| array.to_vec()).collect();
        let (flown, error, _) = fly(&mut part, 8);
        assert_eq!(error, None);
        (saved, flown)
    });
    let (saved, flown): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let mut flown = flown.concat();
    flown.sort_by_key(|of| of.0);
    (saved, flown)
}

#[test]
fn what_any_number_of_processes_saved_any_other_goes_on_with() {
    for (n, settings) in schemes::schemes().map(flying).enumerate() {
        let settings = Settings { time_step: 1.0 / 1024.0, ..settings };
        let whole = body::<2>(14.0, settings.transfer == Transfer::Flip);
        let (one, expected) = save_and_go_on((&grid(), &whole, settings, law().into()), 1, None);
        let (many, _) = save_and_go_on((&grid(), &whole, settings, law().into()), 2 + n % 3, None);
        let pairs = [(&one, 3), (&many, 1), (&many, 2), (&many, 5)];
        // Two of them for a scheme, so that each is there for half of the schemes.
        for (saved, count) in [pairs[n % 4], pairs[(n + 1) % 4]] {
            let (again, found) =
                save_and_go_on((&grid(), &whole, settings, law().into()), count, Some(saved));
            let other = found.iter().zip(&expected).find(|(a, b)| a != b);
            let what = format!("{} to {count} processes, {settings:?}", saved.len());
            assert_eq!((found.len(), other), (expected.len(), None), "{what}");
            // What was taken up is what was saved.
            let bytes = |parts: &[SavedState], array: usize| -> usize {
                parts.iter().map(|part| part[array].len()).sum()
            };
            // Particles that share corners are in the parts of all processes that have these.
            let is_alone = settings.shape != Shape::Cpdi2;
            assert!(!is_alone || (1..7).all(|array| bytes(&again, array) == bytes(saved, array)));
        }
    }
}

#[test]
fn what_a_grid_of_processes_saved_another_one_goes_on_with() {
    let lattices = schemes::schemes().map(flying).step_by(11).map(|settings| {
        let (grid, whole) = wide::<2>(settings.transfer == Transfer::Flip);
        (grid, whole, Settings { time_step: 1.0 / 1024.0, ..settings })
    });
    let clipped = polygon_settings().step_by(6).map(|settings| {
        let (grid, whole) = widened(polygons::<2>(30.0), &[84]);
        (grid, whole, settings)
    });
    for (n, (grid, whole, settings)) in lattices.chain(clipped).enumerate() {
        let law = || if n % 2 == 0 { law().into() } else { projected() };
        let case = || (&grid, &whole, settings, law());
        let (one, expected) = save_and_go_on(case(), 1, None);
        let (many, _) = save_and_go_on_in(case(), along([[2, 2], [3, 1], [2, 3]][n % 3]), None);
        for (saved, processes) in
            [(&one, [3, 2]), (&many, [1, 1]), (&many, [[2, 1], [1, 3]][n % 2])]
        {
            let (again, found) = save_and_go_on_in(case(), along(processes), Some(saved));
            let other = found.iter().zip(&expected).find(|(a, b)| a != b);
            let what = format!("{} to {processes:?} processes, {settings:?}", saved.len());
            assert_eq!((found.len(), other), (expected.len(), None), "{what}");
            assert_eq!(again.len(), processes.iter().product::<usize>(), "{what}");
        }
    }
}

#[test]
fn one_process_goes_on_with_what_several_saved() {
    let settings = flying(schemes::schemes().next().unwrap());
    let settings = Settings { time_step: 1.0 / 1024.0, ..settings };
    let whole = body::<3>(-14.0, true);
    let (saved, expected) = save_and_go_on((&grid(), &whole, settings, law().into()), 3, None);
    let mut alone = Simulation::new(grid::<3>(), whole.clone(), law(), settings).unwrap();
    alone.take_up(saved).unwrap();
    fly(&mut alone, 8);
    assert_eq!(state(&mut alone), expected);
    // A part is missing, or is there twice.
    let (saved, _) = save_and_go_on((&grid(), &whole, settings, law().into()), 3, None);
    assert_eq!(alone.take_up(saved[1..].to_vec()), Err(SavedStateError::Particles));
    let refused = in_process(2, |ranks| {
        let rank = ranks.rank();
        let (body, ids) = share(&whole, &*ranks);
        let share = Share { ranks, ids };
        let mut part = Simulation::shared_out(grid::<3>(), body, share, law(), settings).unwrap();
        let own = if rank == 0 { vec![saved[0].clone()] } else { saved[..2].to_vec() };
        part.take_up(own)
    });
    assert!(refused.iter().all(Result::is_err), "{refused:?}");
}

/// Passes of particles over the grid in a step, each of which exchanges the nodes at each cut.
fn passes(settings: &Settings<f64>, is_first: bool) -> u64 {
    let of_filter = match settings.transfer {
        Transfer::Xpic(order) => u64::from(order) - 1,
        _ => 0,
    };
    match settings.integrator {
        // Momentum and force apart.
        Integrator::Usf | Integrator::Usavg => 2 + of_filter,
        // Velocities are projected from the updated particles.
        Integrator::Musl => 2 + of_filter,
        // One pass in all, but for the first of its kind.
        Integrator::Usl | Integrator::Cd
            if is_first && !matches!(settings.transfer, Transfer::Xpic(_)) =>
        {
            2
        }
        Integrator::Usl | Integrator::Cd => 1 + of_filter,
    }
}

/// Bytes of a particle that goes to another process.
fn record<const D: usize>(settings: &Settings<f64>) -> u64 {
    let matrix = D * D;
    let of_domain = match settings.shape {
        Shape::Cpdi => matrix,
        _ => 0,
    };
    let of_transfer = if settings.transfer == Transfer::Apic { matrix } else { 0 };
    // Number; X, x, v; F; mass and volume; and, in four bytes, the tile.
    (8 * (1 + 3 * D + matrix + 2 + of_domain + of_transfer) + 4) as u64
}

/// Enough for particles to come into other layers.
const STEPS: usize = 30;

/// Bytes that processes along each axis of a grid send in the steps of a body that flies down, against the formulas: `halo` bytes in each pass, and
/// as many numbers of particles as `counts` where these are sorted.
fn sends_what_the_formula_says<const D: usize>(
    (grid, mut whole): (Grid<f64, D>, Body<f64, D>),
    settings: Settings<f64>,
    along_axes: [usize; D],
    (halo, counts): (u64, u64),
) where
    f64: Scalar<D>,
{
    let settings = Settings { time_step: 1.0 / 1024.0, ..settings };
    // Fast and as good as rigid, so that it lasts.
    let p = &mut whole.particles;
    p.v.iter_mut().for_each(|v| *v = SVector::from_fn(|a, _| if a == D - 1 { -30.0 } else { 0.0 }));
    p.F.fill(SMatrix::identity());
    let count: usize = along_axes.iter().product();
    let found = in_process(count, |ranks| {
        let (ranks, traffic) = counted(arranged(ranks, along_axes.to_vec()));
        let (body, ids) = share(&whole, &*ranks);
        let share = Share { ranks, ids };
        let mut part = Simulation::shared_out(grid.clone(), body, share, law(), settings).unwrap();
        let step = |_| {
            let (before, arrangement) = (traffic.sent(), part.arrangement().unwrap());
            let (version, ids) = (arrangement.version, arrangement.ids.to_vec());
            part.step(&Forced).unwrap();
            let after = part.arrangement().unwrap();
            let is_sorted = after.version != version;
            let left = ids.iter().filter(|id| after.ids.binary_search(id).is_err()).count();
            (traffic.sent() - before, is_sorted, left as u64)
        };
        (0..STEPS).map(step).collect::<Vec<_>>()
    });
    let others = count as u64 - 1;
    let cuts: u64 = along_axes.iter().filter(|of| **of > 1).map(|of| *of as u64 + 1).sum();
    let (mut is_first, mut moved) = (true, 0);
    for step in 0..STEPS {
        let of = |n: usize| found[n][step];
        let bytes: u64 = (0..count).map(|n| of(n).0.bytes).sum();
        let left: u64 = (0..count).map(|n| of(n).2).sum();
        let mut expected = passes(&settings, is_first) * halo;
        if of(0).1 {
            // The first process hears how many particles there are, and tells the cuts, both in a tree; all tell each other how many particles they
            // send.
            expected += others * counts * 8 + others * cuts * 8 + others * count as u64 * 8;
            expected += left * record::<D>(&settings);
        } else {
            assert_eq!(left, 0, "{settings:?}");
        }
        let what = format!("{along_axes:?}, step {step}, {left} of it moved, {settings:?}");
        assert_eq!(bytes, expected, "{what}");
        is_first = of(0).1;
        moved += left;
    }
    assert!(moved > 0, "{settings:?}: nothing has moved");
}

/// That of layers alone.
fn layers_send_what_the_formula_says<const D: usize>(settings: Settings<f64>, count: usize)
where
    f64: Scalar<D>,
{
    let cells = grid::<D>().cells;
    // Rows of a layer, of a grid with three nodes below its cells and six above.
    let height: u64 = if D == 1 { 256 } else { 8 };
    let nodes: u64 = cells[..D - 1].iter().map(|&cells| cells as u64 + 9).product();
    let halo = 2 * (count as u64 - 1) * height * nodes * (2 * D as u64 + 1) * 8;
    let mut along_axes = [1; D];
    along_axes[D - 1] = count;
    let case = (grid::<D>(), body::<D>(-30.0, false));
    let layers = cells[D - 1] as u64 / height;
    sends_what_the_formula_says(case, settings, along_axes, (halo, layers));
}

/// That of processes side by side, whose particles reach so many nodes along an axis at most.
fn boxes_send_what_the_formula_says(shape: Shape, width: u64, layers: u64) {
    let mut grid = grid::<2>();
    // Two tiles of 64 cells, eight layers.
    grid.cells = [128, 64];
    let at = |X: &SVector<f64, 2>| (X - grid.lower) / grid.spacing;
    let whole = Body::lattice(&grid, 2, 2.0, |X| {
        (54.0..74.0).contains(&at(X)[0]) && (18.0..40.0).contains(&at(X)[1])
    });
    let settings = flying(schemes::settings(shape, Integrator::Cd, Transfer::Flip));
    let rows = 64 + 9;
    // The windows of layers begin at the row 8 l + 1, those of the first at the row 0, and end where stencils do that have risen by two rows, or where
    // the next layer but one begins.
    let height = |layer: u64| {
        let first = if layer == 0 { 0 } else { 8 * layer + 1 };
        let end = match layer {
            7 => rows,
            6 => 8 * layer + 12 + width,
            _ => (8 * layer + 17).min(8 * layer + 12 + width),
        };
        end - first
    };
    let across = 2 * (layers - 1) * 8 * (128 + 9);
    let lent = (0..8).map(height).sum::<u64>() * (width + 1);
    let returned = (rows + 8 * (layers - 1)) * (width + 1);
    let halo = (across + lent + returned) * 5 * 8;
    sends_what_the_formula_says((grid, whole), settings, [2, layers as usize], (halo, 16));
}

#[test]
fn messages_have_the_bytes_that_the_formula_says() {
    // Those with shared corners have a formula of their own.
    let without = schemes::schemes().filter(|settings| settings.shape != Shape::Cpdi2);
    for settings in without.map(flying) {
        layers_send_what_the_formula_says::<2>(settings, 4);
    }
    for shape in [Shape::Gimp, Shape::Cpdi] {
        let settings = flying(schemes::settings(shape, Integrator::Cd, Transfer::Flip));
        layers_send_what_the_formula_says::<1>(settings, 3);
        layers_send_what_the_formula_says::<3>(settings, 3);
    }
    for (shape, width) in [
        (Shape::Linear, 2),
        (Shape::Bspline2, 3),
        (Shape::Bspline3, 4),
        (Shape::Gimp, 6),
        (Shape::Cpdi, 6),
    ] {
        boxes_send_what_the_formula_says(shape, width, 2);
        boxes_send_what_the_formula_says(shape, width, 3);
    }
}

/// A high grid without walls, and a ring or a shell of polygons with loads that flies up in it, its lattice turned.
pub(crate) fn polygons<const D: usize>(speed: f64) -> (Grid<f64, D>, Body<f64, D>)
where
    f64: Scalar<D>,
{
    let mut grid = Grid {
        lower: SVector::repeat(-1.5),
        spacing: if D == 2 { 0.125 } else { 0.25 },
        cells: [if D == 2 { 24 } else { 12 }; D],
        walls: [[false; 2]; D],
    };
    grid.cells[D - 1] = 64;
    let (sin, cos) = 25.0_f64.to_radians().sin_cos();
    let sides = vec![Side::Inner { radius: 0.55 }, Side::Outer { radius: 0.95 }];
    // The grid has its own axes; the body flies along those of its own.
    let clip = Clip { sides, turn: if D == 2 { [cos, sin] } else { [1.0, 0.0] }, offset: 0.2 };
    let (mut body, boundary) = mmsmith_clip::body(&grid, 2, 2.0, &clip).unwrap();
    loaded(&mut body, &boundary);
    let turn = body.mesh.as_ref().unwrap().turn;
    let mut up = SVector::zeros();
    up[D - 1] = speed;
    let up = turn.map_or(up, |turn: SMatrix<f64, D, D>| turn.transpose() * up);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = up + SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.02 * noise(11 * k + 3 * i + j));
    }
    (grid, body)
}

/// Every integrator and transfer, with the shapes that polygons have.
pub(crate) fn polygon_settings() -> impl Iterator<Item = Settings<f64>> {
    let shapes = [Shape::Cpdi2, Shape::Bspline2, Shape::Bspline3];
    let transfers = [Transfer::Flip, Transfer::Apic, Transfer::Xpic(3)];
    Integrator::ALL.into_iter().enumerate().flat_map(move |(n, integrator)| {
        transfers.into_iter().enumerate().map(move |(m, transfer)| {
            let settings = schemes::settings(shapes[(n + m) % 3], integrator, transfer);
            Settings { time_step: 1.0 / 512.0, ..flying(settings) }
        })
    })
}

#[test]
fn bodies_that_turn_about_their_axis_have_the_bits_of_one_process() {
    for (inner, settings) in [0.0, 0.5].into_iter().cycle().zip(revolving::schemes()) {
        let grid = revolving::grid(inner);
        let mut whole = revolving::body(&grid, 1.0);
        whole.particles.v.iter_mut().for_each(|v| v[2] += 40.0);
        let settings = Settings { time_step: 1.0 / 512.0, ..settings };
        agrees_on((&grid, &whole, law().into()), settings, &[1, 2, 3], 16);
    }
}

#[test]
fn polygons_have_the_bits_of_one_process() {
    for settings in polygon_settings() {
        let settings = Settings { time_step: 1.0 / 512.0, ..settings };
        let (grid, whole) = polygons::<2>(40.0);
        agrees_on((&grid, &whole, law().into()), settings, &[1, 2, 5], 16);
    }
    for settings in polygon_settings().step_by(5) {
        let settings = Settings { time_step: 1.0 / 512.0, ..settings };
        let (grid, whole) = polygons::<3>(70.0);
        agrees_on((&grid, &whole, law().into()), settings, &[3], 16);
    }
}

#[test]
fn polygons_that_turn_inside_out_are_told_alike_by_all() {
    let (grid, mut whole) = polygons::<2>(5.0);
    let p = &mut whole.particles;
    p.v.iter_mut().zip(&p.X).for_each(|(v, X)| v[0] -= 60.0 * X[0]);
    for integrator in [Integrator::Usf, Integrator::Usl] {
        let settings = schemes::settings(Shape::Cpdi2, integrator, Transfer::Flip);
        let settings = Settings { time_step: 1.0 / 512.0, ..settings };
        agrees_on((&grid, &whole, law().into()), settings, &[2, 4], 40);
    }
}

#[test]
fn polygons_that_any_number_of_processes_saved_any_other_goes_on_with() {
    for settings in polygon_settings().step_by(2) {
        let (grid, whole) = polygons::<2>(30.0);
        let case = || (&grid, &whole, settings, law().into());
        let mut alone = Simulation::new(grid.clone(), whole.clone(), law(), settings).unwrap();
        fly(&mut alone, 7);
        let one: SavedState = alone.state().iter().map(|array| array.to_vec()).collect();
        fly(&mut alone, 8);
        let expected = state(&mut alone);
        let (many, _) = save_and_go_on(case(), 3, None);
        for (saved, count) in [(&vec![one], 3), (&many, 1), (&many, 2), (&many, 4)] {
            let (_, found) = save_and_go_on(case(), count, Some(saved));
            let other = found.iter().zip(&expected).find(|(a, b)| a != b);
            let what = format!("{} to {count} processes, {settings:?}", saved.len());
            assert_eq!((found.len(), other), (expected.len(), None), "{what}");
        }
        alone.take_up(many.clone()).unwrap();
        fly(&mut alone, 8);
        assert_eq!(state(&mut alone), expected);
        // A part is missing, or is there twice.
        let twice = many.iter().chain(&many[1..2]).cloned().collect();
        for saved in [many[1..].to_vec(), twice] {
            assert_eq!(alone.take_up(saved), Err(SavedStateError::Particles));
        }
    }
}

#[test]
fn shared_corners_send_what_the_formula_says() {
    let of_cells = schemes::schemes().filter(|settings| settings.shape == Shape::Cpdi2);
    let of_cells = of_cells.map(|settings| {
        let grid = polygons::<2>(0.5).0;
        let body = Body::lattice(&grid, 2, 2.0, |X| X.norm() < 1.0);
        (grid, body, Settings { time_step: 1.0 / 1024.0, ..settings })
    });
    let of_polygons = polygon_settings().map(|settings| {
        let (grid, whole) = polygons::<2>(0.5);
        (grid, whole, settings)
    });
    for (grid, whole, settings) in of_polygons.chain(of_cells) {
        let corners = whole.mesh.as_ref().unwrap().X.len();
        let found = in_process(3, |ranks| {
            let (ranks, traffic) = counted(ranks);
            let (body, ids) = share(&whole, &*ranks);
            let share = Share { ranks, ids };
            let mut part =
                Simulation::shared_out(grid.clone(), body, share, law(), settings).unwrap();
            let version = part.arrangement().unwrap().version;
            let before = traffic.sent();
            part.step(&Forced).unwrap();
            assert_eq!(part.arrangement().unwrap().version, version);
            ((traffic.sent() - before).bytes, part.mesh().unwrap().X.len())
        });
        let (bytes, here): (Vec<u64>, Vec<usize>) = found.into_iter().unzip();
        // Corners that two processes have, whose values one gets: two vectors each time, and with affine velocities of cells a matrix.
        let others = (here.iter().sum::<usize>() - corners) as u64;
        assert!(others > 0);
        let of_filter = match settings.transfer {
            Transfer::Xpic(order) => u64::from(order) - 1,
            _ => 0,
        };
        let interpolations = of_filter
            + match settings.integrator {
                Integrator::Usl | Integrator::Cd => 1,
                // Once more before forces, or of the velocities projected again.
                Integrator::Usf | Integrator::Usavg | Integrator::Musl => 2,
            };
        let row = (grid.cells[0] + 9) as u64;
        let passes = match settings.integrator {
            Integrator::Usl | Integrator::Cd => 1,
            Integrator::Usf | Integrator::Usavg | Integrator::Musl => 2,
        } + of_filter;
        let is_cell = whole.mesh.as_ref().unwrap().interpolation == Interpolation::Cell;
        // Hat functions of polygons: as many rows once more, for light nodes.
        let of_bins = if is_cell || settings.shape != Shape::Cpdi2 { 1 } else { 2 };
        let halo = 2 * 2 * of_bins * 8 * row * 5 * 8 * passes;
        let has_moments = is_cell && settings.transfer == Transfer::Apic;
        let numbers = if has_moments { 8 } else { 4 };
        let expected = halo + interpolations * others * numbers * 8;
        assert_eq!(bytes.iter().sum::<u64>(), expected, "{settings:?}");
    }
}
