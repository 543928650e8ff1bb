//! Polygons on shared corners: clipped lattices, the patch test, momentum, threads, and states that are continued.

use mmsmith_mpm::{
    Body, BodyForce, Clip, Edge, Grid, Integrator, Load, Material, NoBodyForce, Polygons, Scalar,
    Settings, SetupError, Shape, Side, Simulation, Transfer,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};

use crate::schemes::{noise, single};

const DENSITY: f64 = 2.0;
const MATERIAL: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// A body in the middle of a grid without walls.
#[derive(Clone, Copy, Debug)]
enum Form {
    Ring { inner: f64, outer: f64 },
    Rectangle { lower: [f64; 2], upper: [f64; 2] },
}

impl Form {
    const ALL: [Self; 3] = [
        Self::Ring { inner: 0.37, outer: 0.91 },
        Self::Ring { inner: 0.5, outer: 1.0 },
        Self::Rectangle { lower: [-0.61, -0.38], upper: [0.72, 0.55] },
    ];

    fn sides(self) -> Vec<Side> {
        match self {
            Self::Ring { inner, outer } => {
                vec![Side::Inner { radius: inner }, Side::Outer { radius: outer }]
            }
            Self::Rectangle { lower: [a, b], upper: [c, d] } => vec![
                Side::Straight { normal: [-1.0, 0.0], distance: -a },
                Side::Straight { normal: [1.0, 0.0], distance: c },
                Side::Straight { normal: [0.0, -1.0], distance: -b },
                Side::Straight { normal: [0.0, 1.0], distance: d },
            ],
        }
    }

    fn area(self) -> f64 {
        match self {
            Self::Ring { inner, outer } => std::f64::consts::PI * (outer * outer - inner * inner),
            Self::Rectangle { lower: [a, b], upper: [c, d] } => (c - a) * (d - b),
        }
    }
}

/// How the lattice lies: angle in degrees, offset in units of the particles' distance.
const LATTICES: [(f64, f64); 4] = [(0.0, 0.0), (0.0, 0.37), (30.0, 0.0), (-73.0, -0.21)];

fn grid() -> Grid<f64, 2> {
    Grid { lower: vector![-2.0, -2.0], spacing: 0.125, cells: [32; 2], walls: [[false; 2]; 2] }
}

fn clipped(form: Form, (angle, offset): (f64, f64)) -> (Body<f64, 2>, Vec<Edge>) {
    let (sin, cos) = angle.to_radians().sin_cos();
    let turn = if angle == 0.0 { [1.0, 0.0] } else { [cos, sin] };
    let clip = Clip { sides: form.sides(), turn, offset };
    Body::clipped(&grid(), 2, DENSITY, &clip).expect("a body in the plane")
}

fn polygons(body: &Body<f64, 2>) -> &Polygons<f64, 2> {
    body.polygons.as_ref().expect("polygons")
}

fn each_form() -> impl Iterator<Item = (Form, (f64, f64))> {
    Form::ALL.into_iter().flat_map(|form| LATTICES.map(|lattice| (form, lattice)))
}

/// The polygons of each particle, as lists of corners.
fn of_particles(own: &Polygons<f64, 2>) -> Vec<Vec<&[u32]>> {
    let (mut polygon, mut corner) = (0, 0);
    let lists = own.of_particles.iter().map(|&end| {
        let ends = &own.ends[polygon..end as usize];
        polygon = end as usize;
        let lists = ends.iter().map(|&end| {
            let list = &own.corners[corner..end as usize];
            corner = end as usize;
            list
        });
        lists.collect()
    });
    lists.collect()
}

fn area(x: &[Vector2<f64>], corners: &[u32]) -> f64 {
    let at = |k: usize| x[corners[k % corners.len()] as usize];
    (0..corners.len()).map(|k| 0.5 * at(k).perp(&at(k + 1))).sum()
}

#[test]
fn clipped_lattices_have_the_mass_of_the_body_and_no_slivers() {
    for (form, lattice) in each_form() {
        let (body, _) = clipped(form, lattice);
        let (what, p) = (format!("{form:?} {lattice:?}"), &body.particles);
        let mass: f64 = p.mass.iter().sum();
        assert!((mass / (DENSITY * form.area()) - 1.0).abs() < 1e-13, "{what}");
        let of_box = 0.0625 * 0.0625;
        let share = |volume: &f64| volume / of_box;
        assert!(p.volume.iter().all(|V| (0.2..1.6).contains(&share(V))), "{what}");
        // Areas and centroids are those of the polygons.
        let own = polygons(&body);
        for (k, lists) in of_particles(own).iter().enumerate() {
            let whole: f64 = lists.iter().map(|list| area(&own.X, list)).sum();
            assert!((whole - p.volume[k]).abs() < 1e-15, "{what}");
            assert!(lists.iter().all(|list| area(&own.X, list) > 0.0), "{what}");
        }
        // The centre of mass of a rectangle is exact; that of a ring has chords for arcs.
        let centre: Vector2<f64> = p.X.iter().zip(&p.volume).map(|(X, V)| X * *V).sum();
        let (exact, bound) = match form {
            Form::Rectangle { lower: [a, b], upper: [c, d] } => {
                (vector![a + c, b + d] * 0.5, 1e-14)
            }
            Form::Ring { .. } => (Vector2::zeros(), 1e-4),
        };
        assert!((centre / form.area() - exact).norm() < bound, "{what}");
    }
}

/// Every edge lies between two particles, which have it in opposite directions, or on one side of the body.
#[test]
fn neighbours_share_their_edges_and_the_rest_is_the_boundary() {
    for (form, lattice) in each_form() {
        let (body, boundary) = clipped(form, lattice);
        let (what, own) = (format!("{form:?} {lattice:?}"), polygons(&body));
        let mut edges = std::collections::BTreeMap::new();
        for list in of_particles(own).concat() {
            for k in 0..list.len() {
                let edge = [list[k], list[(k + 1) % list.len()]];
                assert!(edges.insert(edge, false).is_none(), "{what}: {edge:?} twice");
            }
        }
        for Edge { side, corners } in &boundary {
            let seen = edges.insert(*corners, true);
            assert_eq!(seen, Some(false), "{what}");
            for X in corners.map(|corner| own.X[corner as usize]) {
                let away = match form.sides()[*side] {
                    Side::Straight { normal: [a, b], distance } => a * X[0] + b * X[1] - distance,
                    Side::Inner { radius } | Side::Outer { radius } => X.norm() - radius,
                };
                assert!(away.abs() < 1e-9, "{what}: {away:e}");
            }
        }
        for (&[a, b], on_boundary) in &edges {
            assert_eq!(edges.contains_key(&[b, a]), !on_boundary, "{what}: {a} {b}");
        }
    }
}

/// Loads on all of the boundary, two points to an edge.
fn loaded(body: &mut Body<f64, 2>, boundary: &[Edge]) {
    let away = 0.5 / 3.0_f64.sqrt();
    let points = boundary.iter().flat_map(|edge| {
        [0.5 - away, 0.5 + away]
            .map(|s| Load { corners: edge.corners, shares: [0.5 * (1.0 - s), 0.5 * s] })
    });
    body.polygons.as_mut().expect("polygons").loads = points.collect();
}

/// A stress that is the same on all of the boundary.
struct Constant(Matrix2<f64>);

impl BodyForce<f64, 2> for Constant {
    fn evaluate(&self, _: usize, _: &[Vector2<f64>], _: f64, b: &mut [Vector2<f64>]) {
        b.fill(Vector2::zeros());
    }

    fn boundary_stress(&self, _: f64, stress: &mut [Matrix2<f64>]) {
        stress.fill(self.0);
    }
}

const SHAPES: [Shape; 3] = [Shape::Cpdi2, Shape::Bspline2, Shape::Bspline3];

fn settings(shape: Shape, integrator: Integrator, transfer: Transfer) -> Settings<f64> {
    Settings {
        shape,
        integrator,
        transfer,
        time_step: 1.0 / 512.0,
        halve_first_acceleration: false,
    }
}

/// A body deformed by the same F everywhere, whose stress balances the loads on its boundary, stays as it is.
#[test]
fn a_constant_stress_gives_no_force_to_rounding() {
    let F: Matrix2<f64> = Matrix2::new(1.17, 0.21, -0.08, 0.86);
    let (J, mu, lambda) = (F.determinant(), 40.0, 60.0_f64);
    let tau =
        (F * F.transpose() - Matrix2::identity()) * mu + Matrix2::identity() * (lambda * J.ln());
    for (form, lattice) in each_form() {
        for shape in SHAPES {
            for integrator in Integrator::ALL {
                let (mut body, boundary) = clipped(form, lattice);
                loaded(&mut body, &boundary);
                let own = body.polygons.as_mut().unwrap();
                own.x.iter_mut().for_each(|x| *x = F * *x);
                let p = &mut body.particles;
                p.x.iter_mut().for_each(|x| *x = F * *x);
                p.F.fill(F);
                let settings = settings(shape, integrator, Transfer::Flip);
                let mut run = Simulation::new(grid(), body, MATERIAL, settings).unwrap();
                run.step(&Constant(tau / J)).unwrap();
                // In units of the acceleration that the stress gives to a cell.
                let unit = tau.norm() / (DENSITY * 0.125) * settings.time_step;
                let fastest = run.particles().v.iter().map(|v| v.norm() / unit).fold(0.0, f64::max);
                assert!(fastest < 1e-13, "{form:?} {lattice:?} {settings:?}: {fastest:e}");
            }
        }
    }
}

fn moving(form: Form, lattice: (f64, f64)) -> Body<f64, 2> {
    let (mut body, _) = clipped(form, lattice);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = Vector2::from_fn(|a, _| 0.1 + 0.2 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.02 * noise(11 * k + 3 * i + j));
    }
    body
}

fn transfers() -> [Transfer; 4] {
    [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)]
}

#[test]
fn free_bodies_keep_their_momentum_with_every_scheme() {
    for shape in SHAPES {
        for integrator in Integrator::ALL {
            for transfer in transfers() {
                let settings = settings(shape, integrator, transfer);
                let body = moving(Form::ALL[0], LATTICES[3]);
                let mut run = Simulation::new(grid(), body, MATERIAL, settings).unwrap();
                let momentum = |run: &Simulation<f64, 2>| -> Vector2<f64> {
                    let p = run.particles();
                    p.v.iter().zip(&p.mass).map(|(v, m)| v * *m).sum()
                };
                let before = momentum(&run);
                (0..20).for_each(|_| run.step(&NoBodyForce).unwrap());
                let lost = (momentum(&run) - before).norm() / before.norm();
                assert!(lost < 1e-13, "{settings:?}: {lost:e}");
            }
        }
    }
}

#[test]
fn polygons_have_the_same_bits_on_any_number_of_threads_and_go_on_from_a_state() {
    fn check<T: Scalar<2>>(
        body: &Body<T, 2>,
        grid: &Grid<T, 2>,
        settings: Settings<T>,
        number: fn(f64) -> T,
    ) {
        let material = Material::NeoHookean { lambda: number(60.0), mu: number(40.0) };
        let new = || Simulation::new(grid.clone(), body.clone(), material, settings).unwrap();
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut run = new();
            pool.install(|| (0..12).try_for_each(|_| run.step(&NoBodyForce))).unwrap();
            run
        };
        let (one, three) = (run(1), run(3));
        assert_eq!(one.particles(), three.particles(), "{settings:?}");
        assert_eq!(one.polygons(), three.polygons(), "{settings:?}");
        let mut half = new();
        (0..5).for_each(|_| half.step(&NoBodyForce).unwrap());
        let kept: Vec<Vec<u8>> = half.state().iter().map(|part| part.to_vec()).collect();
        // What continues has gone another way before.
        let mut other = new();
        (0..2).for_each(|_| other.step(&NoBodyForce).unwrap());
        other.state().into_iter().zip(&kept).for_each(|(part, kept)| part.copy_from_slice(kept));
        (0..7).for_each(|_| other.step(&NoBodyForce).unwrap());
        assert_eq!(one.particles(), other.particles(), "{settings:?}");
        assert_eq!(one.polygons(), other.polygons(), "{settings:?}");
    }
    for (transfer, integrator) in transfers().into_iter().zip(Integrator::ALL) {
        for shape in SHAPES {
            let settings = settings(shape, integrator, transfer);
            let body = moving(Form::ALL[2], LATTICES[2]);
            check(&body, &grid(), settings, |x| x);
            let in_single = Grid {
                lower: grid().lower.cast(),
                spacing: 0.125,
                cells: grid().cells,
                walls: grid().walls,
            };
            let Settings { shape, integrator, transfer, halve_first_acceleration, .. } = settings;
            let settings = Settings {
                shape,
                integrator,
                transfer,
                time_step: 1.0 / 512.0,
                halve_first_acceleration,
            };
            check(&single(&body), &in_single, settings, |x| x as f32);
        }
    }
}

#[test]
fn bodies_that_cannot_be_are_refused() {
    let set_up = |change: &dyn Fn(&mut Polygons<f64, 2>, &mut Grid<f64, 2>), shape| {
        let (mut body, mut grid) = (moving(Form::ALL[1], LATTICES[2]), grid());
        change(body.polygons.as_mut().unwrap(), &mut grid);
        let settings = settings(shape, Integrator::Cd, Transfer::Flip);
        Simulation::new(grid, body, MATERIAL, settings).err()
    };
    let none = |_: &mut Polygons<f64, 2>, _: &mut Grid<f64, 2>| {};
    assert!(matches!(set_up(&none, Shape::Gimp), Some(SetupError::NotOfPolygons { .. })));
    let walls = |_: &mut Polygons<f64, 2>, grid: &mut Grid<f64, 2>| grid.walls[0][1] = true;
    assert_eq!(set_up(&walls, Shape::Cpdi2), Some(SetupError::TurnedWalls));
    let beyond = |own: &mut Polygons<f64, 2>, _: &mut Grid<f64, 2>| own.corners[3] = 1 << 30;
    let found = set_up(&beyond, Shape::Cpdi2);
    assert!(matches!(found, Some(SetupError::NoSuchCorner { corner: 0x4000_0000, .. })));
    let idle = |own: &mut Polygons<f64, 2>, _: &mut Grid<f64, 2>| {
        own.X.push(Vector2::zeros());
        own.x.push(Vector2::zeros());
    };
    assert!(matches!(set_up(&idle, Shape::Cpdi2), Some(SetupError::IdleCorner { .. })));
    let short = |own: &mut Polygons<f64, 2>, _: &mut Grid<f64, 2>| {
        own.of_particles.pop();
    };
    assert!(matches!(set_up(&short, Shape::Cpdi2), Some(SetupError::LengthMismatch { .. })));
    let away = |own: &mut Polygons<f64, 2>, _: &mut Grid<f64, 2>| own.x[0] = vector![9.0, 0.0];
    assert!(matches!(set_up(&away, Shape::Cpdi2), Some(SetupError::InitialState(_))));
    let grid =
        Grid { lower: SVector::zeros(), spacing: 0.5, cells: [2; 3], walls: [[false; 2]; 3] };
    let clip = Clip { sides: Form::ALL[0].sides(), turn: [1.0, 0.0], offset: 0.0 };
    let found = Body::<f64, 3>::clipped(&grid, 2, DENSITY, &clip).err();
    assert_eq!(found, Some(SetupError::PolygonDimension { dimension: 3 }));
}
