//! The state of a run: numbers that a run continues from to the same bits, and that mean the same in other units.

#![allow(clippy::unwrap_used)]

use mmsmith_galerkin::{
    self as total, Axis, BoundaryData, Composition, Coordinates, End, HeldBoundary, Layout,
    MassMatrix, Quantity, Scheme, Side, TotalLagrangian,
};
use mmsmith_mpm::{
    AtTime, Body, BodyForce, Grid, Integrator, Law, Material, NoBodyForce, Particles, SavedState,
    SavedStateError, Scalar, Settings, Shape, Simulation, Transfer,
};
use nalgebra::{SMatrix, SVector, Vector2};

use crate::schemes::{self, noise, single};

/// Sizes of the units in which lengths, times and masses are given: powers of two, so that nothing is rounded in another way.
#[derive(Clone, Copy)]
struct Units {
    length: f64,
    time: f64,
    mass: f64,
}

const ONE: Units = Units { length: 1.0, time: 1.0, mass: 1.0 };

/// Far from each other, so that a constant with a unit would be lost or prevail.
fn units() -> [Units; 2] {
    let of = |exponents: [i32; 3]| {
        let [length, time, mass] = exponents.map(|exponent| 2.0_f64.powi(exponent));
        Units { length, time, mass }
    };
    [of([-60, 50, -90]), of([50, -70, 80])]
}

impl Units {
    fn velocity(self) -> f64 {
        self.length / self.time
    }

    fn acceleration(self) -> f64 {
        self.velocity() / self.time
    }

    /// Volumes, areas or lengths.
    fn volume<const D: usize>(self) -> f64 {
        self.length.powi(D as i32)
    }

    fn material<const D: usize>(self) -> Material<f64> {
        let stress = self.mass * self.length * self.acceleration() / self.volume::<D>();
        Material::NeoHookean { lambda: 60.0 * stress, mu: 40.0 * stress }
    }

    fn body_force<const D: usize>(
        self,
    ) -> impl Fn(&[SVector<f64, D>], f64, &mut [SVector<f64, D>]) + Sync {
        move |X, t, b| {
            for (X, b) in X.iter().zip(b) {
                let time = t / self.time;
                *b = X.map(|x| (3.0 * (x / self.length) + 5.0 * time) * self.acceleration());
            }
        }
    }

    /// The particles of unit [`ONE`] in these units.
    fn particles<const D: usize>(self, mut p: Particles<f64, D>) -> Particles<f64, D> {
        p.X.iter_mut().chain(&mut p.x).for_each(|x| *x *= self.length);
        p.v.iter_mut().for_each(|v| *v *= self.velocity());
        p.mass.iter_mut().for_each(|mass| *mass *= self.mass);
        p.volume.iter_mut().for_each(|volume| *volume *= self.volume::<D>());
        p.half_size *= self.length;
        p
    }

    fn body<const D: usize>(self, mut body: Body<f64, D>) -> Body<f64, D> {
        body.particles = self.particles(body.particles);
        body.half_edges.iter_mut().for_each(|E| *E *= self.length);
        if let Some(mesh) = &mut body.mesh {
            mesh.X.iter_mut().chain(&mut mesh.x).for_each(|x| *x *= self.length);
        }
        body
    }

    /// Two walls, and room above the body.
    fn grid<const D: usize>(self) -> Grid<f64, D> {
        Grid {
            lower: SVector::repeat(-0.25 * self.length),
            spacing: 0.125 * self.length,
            cells: [8; D],
            walls: [[true, false]; D],
        }
    }
}

/// A moving, deformed body of unequal masses at the walls.
fn body<const D: usize>() -> Body<f64, D> {
    let mut body = Body::lattice(&ONE.grid::<D>(), 2, 2.0, |X| X.iter().all(|&x| x < 0.1));
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.1 * noise(11 * k + 3 * i + j));
        p.mass[k] *= 1.0 + 0.1 * noise(k);
    }
    body
}

/// Runs `one` whole, and `two` from its state on the way; both have to end alike.
fn is_continued<S>(
    [mut one, mut two]: [S; 2],
    step: impl Fn(&mut S),
    state: impl Fn(&S) -> Vec<&[u8]>,
    take_up: impl Fn(&mut S, SavedState) -> Result<(), SavedStateError>,
    what: &str,
) {
    let read = |simulation: &S| -> SavedState {
        state(simulation).iter().map(|part| part.to_vec()).collect()
    };
    let start = read(&one);
    (0..4).for_each(|_| step(&mut one));
    let written = read(&one);
    assert!(written.iter().zip(&start).filter(|(now, then)| now != then).count() > 3, "{what}");
    // What continues has gone another way before.
    (0..2).for_each(|_| step(&mut two));
    let expected = Err(SavedStateError::Arrays { found: 1, expected: written.len() });
    assert_eq!(take_up(&mut two, vec![written[0].clone()]), expected, "{what}");
    for n in (0..written.len()).filter(|&n| !written[n].is_empty()) {
        let mut shorter = written.clone();
        shorter[n].pop();
        assert!(take_up(&mut two, shorter).is_err(), "{what}: array {n}");
    }
    take_up(&mut two, written.clone()).unwrap();
    (0..4).for_each(|_| step(&mut one));
    (0..4).for_each(|_| step(&mut two));
    assert!(read(&one) == read(&two), "{what}");
    assert!(read(&one) != written, "{what}");
}

/// Every scheme, centred differences from velocities at time 0.
fn updated_schemes() -> impl Iterator<Item = Settings<f64>> {
    schemes::schemes().map(|settings| Settings {
        time_step: 1.0 / 512.0,
        halve_first_acceleration: settings.integrator == Integrator::Cd,
        ..settings
    })
}

/// Set up with the body of unit [`ONE`].
fn simulation<const D: usize>(settings: Settings<f64>) -> Simulation<f64, D>
where
    f64: Scalar<D>,
{
    Simulation::new(ONE.grid(), body::<D>(), ONE.material::<D>(), settings).unwrap()
}

fn total_scenes() -> impl Iterator<Item = (Coordinates, [End; 2], Scheme)> {
    let schemes = [
        (2, MassMatrix::Lumped, Composition::Order2),
        (3, MassMatrix::Consistent, Composition::Order4),
    ];
    schemes.into_iter().flat_map(|(degree, mass, composition)| {
        [Coordinates::Cartesian, Coordinates::Polar].into_iter().flat_map(move |coordinates| {
            [End::FREE, End::Wall, End::MOVED, End::Periodic]
                .into_iter()
                .map(move |end| (coordinates, [end; 2], Scheme { degree, mass, composition }))
        })
    })
}

fn total_scene(
    units: Units,
    (coordinates, ends, scheme): (Coordinates, [End; 2], Scheme),
) -> TotalLagrangian<2> {
    let length = units.length;
    // The second coordinate of polar grids is an angle.
    let across = if coordinates == Coordinates::Polar { 1.0 } else { length };
    let axes = [
        Axis { lower: 0.5 * length, upper: length, cells: 4, ends: [End::FREE, End::LOADED] },
        Axis { lower: 0.25 * across, upper: 1.25 * across, cells: 4, ends },
    ];
    let grid = total::Grid { axes, coordinates, per_cell: 4, layout: Layout::Gauss };
    let density = 2.0 * units.mass / units.volume::<2>();
    let dt = units.time / 512.0;
    let mut body = TotalLagrangian::new(grid, scheme, units.material::<2>(), density, dt).unwrap();
    let field = |size: f64, phase: f64| -> Vec<SVector<f64, 2>> {
        let at = |X: &SVector<f64, 2>| {
            let X = X / length;
            SVector::from_fn(|a, _| size * (phase + a as f64 + 1.5 * X[0] + 2.2 * X[1]).sin())
        };
        body.positions().iter().map(at).collect()
    };
    let (u, v) = (field(0.02 * length, 0.3), field(0.25 * units.velocity(), 1.1));
    body.start(&u, &v).unwrap();
    body
}

#[test]
fn runs_continue_from_their_state_to_the_same_bits() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        let force = ONE.body_force::<D>();
        for settings in updated_schemes() {
            let two = [simulation(settings), simulation(settings)];
            let what = format!("{D} {settings:?}");
            is_continued(
                two,
                |s| s.step(&force).unwrap(),
                Simulation::state,
                |s, saved| s.take_up(vec![saved]),
                &what,
            );
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
    let force = ONE.body_force::<2>();
    for scene in total_scenes() {
        let two = [total_scene(ONE, scene), total_scene(ONE, scene)];
        let what = format!("{scene:?}");
        is_continued(
            two,
            |s| s.step(&force).unwrap(),
            TotalLagrangian::state,
            |s, saved| s.take_up(&[saved]),
            &what,
        );
    }
}

#[test]
fn runs_in_single_precision_continue_from_their_state_to_the_same_bits() {
    let force = |X: &[SVector<f32, 2>], t: f32, b: &mut [SVector<f32, 2>]| {
        b.iter_mut().zip(X).for_each(|(b, X)| *b = X.map(|x| 3.0 * x + 5.0 * t));
    };
    for Settings { shape, integrator, transfer, halve_first_acceleration, .. } in updated_schemes()
    {
        let time_step = 1.0 / 512.0;
        let settings =
            Settings { shape, integrator, transfer, time_step, halve_first_acceleration };
        let new = || {
            let Grid { walls, cells, .. } = ONE.grid::<2>();
            let grid = Grid { lower: Vector2::repeat(-0.25), spacing: 0.125, cells, walls };
            let material = Material::NeoHookean { lambda: 60.0, mu: 40.0 };
            Simulation::new(grid, single(&body::<2>()), material, settings).unwrap()
        };
        let what = format!("{settings:?}");
        is_continued(
            [new(), new()],
            |s| s.step(&force).unwrap(),
            Simulation::state,
            |s, saved| s.take_up(vec![saved]),
            &what,
        );
    }
}

#[test]
fn states_that_cannot_be_are_refused() {
    for settings in updated_schemes() {
        let mut run = simulation::<2>(settings);
        let saved: SavedState = run.state().iter().map(|part| part.to_vec()).collect();
        let with = |array: usize, bytes: Vec<u8>| {
            let mut saved = saved.clone();
            saved[array] = bytes;
            vec![saved]
        };
        // Bins, and the same particle twice.
        let far = saved[2].iter().map(|_| 255).collect();
        assert_eq!(run.take_up(with(2, far)), Err(SavedStateError::Place), "{settings:?}");
        let twice = vec![0; size_of::<u64>() * run.particles().len()];
        assert_eq!(run.take_up(with(1, twice)), Err(SavedStateError::Particles), "{settings:?}");
        assert_eq!(run.take_up(vec![]), Err(SavedStateError::Particles), "{settings:?}");
        let both = vec![saved.clone(), saved.clone()];
        assert_eq!(run.take_up(both), Err(SavedStateError::Particles), "{settings:?}");
        if settings.shape == Shape::Cpdi2 {
            // The numbers of corners come last.
            let last = saved.len() - 1;
            let other = saved[last].iter().map(|_| 255).collect();
            assert_eq!(
                run.take_up(with(last, other)),
                Err(SavedStateError::Particles),
                "{settings:?}"
            );
        }
        assert_eq!(run.take_up(vec![saved.clone()]), Ok(()));
    }
}

/// Particles in these units have to be those of the unit [`ONE`], to the bit.
fn are_same<const D: usize>(
    units: Units,
    here: &Particles<f64, D>,
    there: &Particles<f64, D>,
    what: &str,
) {
    for p in 0..there.len() {
        assert_eq!(here.x[p] / units.length, there.x[p], "{what}");
        assert_eq!(here.v[p] / units.velocity(), there.v[p], "{what}");
        assert_eq!(here.F[p], there.F[p], "{what}");
    }
}

#[test]
fn results_in_other_units_are_the_same_to_the_bit() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        for settings in updated_schemes() {
            let run = |units: Units| {
                let settings = Settings { time_step: settings.time_step * units.time, ..settings };
                let (material, body) = (units.material::<D>(), units.body(body::<D>()));
                let mut run = Simulation::new(units.grid(), body, material, settings).unwrap();
                (0..5).for_each(|_| run.step(&units.body_force::<D>()).unwrap());
                assert_eq!(run.time(), units.time * 5.0 / 512.0);
                run
            };
            let there = run(ONE);
            for units in units() {
                let (what, here) = (format!("{D} {settings:?}"), run(units));
                are_same(units, here.particles(), there.particles(), &what);
                assert_eq!(here.velocity_lag() / units.time, there.velocity_lag());
                if let (Some(here), Some(there)) = (here.mesh(), there.mesh()) {
                    let here: Vec<_> = here.x.iter().map(|x| x / units.length).collect();
                    assert_eq!(here, there.x, "{what}");
                }
            }
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
    for scene in total_scenes() {
        let run = |units: Units| {
            let mut run = total_scene(units, scene);
            (0..5).for_each(|_| run.step(&units.body_force::<2>()).unwrap());
            assert_eq!(run.time(), units.time * 5.0 / 512.0);
            run.observe().clone()
        };
        let there = run(ONE);
        for units in units() {
            are_same(units, &run(units), &there, &format!("{scene:?}"));
        }
    }
}

#[test]
fn runs_tell_what_they_were_set_up_with_and_how_far_they_are() {
    let force = ONE.body_force::<2>();
    for settings in updated_schemes() {
        let mut run = simulation::<2>(settings);
        (0..3).for_each(|_| run.step(&force).unwrap());
        assert_eq!((run.grid(), run.settings()), (&ONE.grid(), &settings));
        assert!(matches!(run.law(), Law::Library(law) if *law == ONE.material::<2>()));
        let lag = if settings.integrator == Integrator::Cd { 1.0 / 1024.0 } else { 0.0 };
        assert_eq!((run.velocity_lag(), run.time(), run.steps_done()), (lag, 3.0 / 512.0, 3));
        let has_corners = settings.shape == Shape::Cpdi2;
        assert_eq!(run.mesh().is_some(), has_corners, "nothing would move them");
        let printed = format!("{run:?}");
        let shape = format!("{:?}", settings.shape);
        for part in ["steps_done: 3", "failed: None", "NeoHookean", &shape] {
            assert!(printed.contains(part), "{printed}");
        }
    }
    for scene in total_scenes() {
        let mut run = total_scene(ONE, scene);
        (0..3).for_each(|_| run.step(&force).unwrap());
        assert_eq!((run.grid().coordinates, run.scheme()), (scene.0, scene.2));
        // Four particles in each of four cells, along half a unit and along one.
        assert_eq!(run.particles().half_size.as_slice(), [1.0 / 64.0, 1.0 / 32.0]);
        assert!(matches!(run.law(), Law::Library(law) if *law == ONE.material::<2>()));
        assert_eq!((run.time(), run.steps_done()), (3.0 / 512.0, 3));
    }
    let names = [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(5)];
    assert_eq!(names.map(|transfer| transfer.to_string()), ["flip", "pic", "apic", "xpic5"]);
}

/// They are asked for numbers like any other force or motion.
#[test]
fn no_force_and_held_sides_are_zero_whatever_was_there_before() {
    const NONE: [SVector<f64, 2>; 4] = [SVector::<f64, 2>::new(0.0, 0.0); 4];
    let there = [SVector::<f64, 2>::repeat(3.0); 4];
    let mut values = there;
    NoBodyForce.evaluate(0, &there, 1.0, &mut values);
    assert_eq!(values, NONE);
    assert!(BodyForce::<f64, 2>::is_absent(&NoBodyForce));
    values = there;
    let time = |t| AtTime { t, values: &[] };
    NoBodyForce.evaluate_of(&[2, 0, 3, 1], &there, time(1.0), &mut values);
    assert_eq!(values, NONE);
    let one = ONE.body_force::<2>();
    assert!(!BodyForce::<f64, 2>::is_absent(&one));
    for of in
        [Quantity::Displacement, Quantity::Velocity, Quantity::Acceleration, Quantity::Traction]
    {
        values = there;
        HeldBoundary.evaluate(of, Side { axis: 1, upper: true }, &there, 1.0, &mut values);
        assert_eq!(values, NONE);
    }
    // One by one at the particles that are named.
    let X: Vec<_> = (0..5).map(|k| SVector::<f64, 2>::repeat(f64::from(k))).collect();
    let (mut all, mut some) = ([SVector::zeros(); 5], [SVector::zeros(); 3]);
    one.evaluate(0, &X, 0.5, &mut all);
    one.evaluate_of(&[4, 0, 2], &X, time(0.5), &mut some);
    assert_eq!(some, [all[4], all[0], all[2]]);
    let mut nothing = Vec::new();
    one.of_time(0.5, &mut nothing);
    assert!(nothing.is_empty());
}
