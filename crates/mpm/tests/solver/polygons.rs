//! Polygons and polyhedra on shared corners: clipped lattices, the patch test, momentum, threads, and states that are continued.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::f64::consts::PI;

use mmsmith_clip::{Clip, Facet, Side};
use mmsmith_mpm::{
    Body, BodyForce, Grid, Integrator, Load, Material, Mesh, NoBodyForce, Scalar, Settings,
    SetupError, Shape, Simulation, Transfer,
};
use nalgebra::{SMatrix, SVector, Vector2, vector};

use crate::reference::Reference;
use crate::schemes::{difference, noise, single};

const DENSITY: f64 = 2.0;
const MATERIAL: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// A body in the middle of a grid without walls.
#[derive(Clone, Copy, Debug)]
enum Form<const D: usize> {
    /// A ring or a spherical shell.
    Shell {
        inner: f64,
        outer: f64,
    },
    Box {
        lower: [f64; D],
        upper: [f64; D],
    },
}

impl<const D: usize> Form<D> {
    fn all() -> [Self; 3] {
        let ends = [[-0.61, 0.72], [-0.38, 0.55], [-0.43, 0.29]];
        let [lower, upper] = [0, 1].map(|end| std::array::from_fn(|a| ends[a][end]));
        [
            Self::Shell { inner: 0.37, outer: 0.91 },
            Self::Shell { inner: 0.5, outer: 1.0 },
            Self::Box { lower, upper },
        ]
    }

    fn sides(self) -> Vec<Side<D>> {
        match self {
            Self::Shell { inner, outer } => {
                vec![Side::Inner { radius: inner }, Side::Outer { radius: outer }]
            }
            Self::Box { lower, upper } => {
                let side = |axis, sign: f64, distance| {
                    let normal = std::array::from_fn(|a| if a == axis { sign } else { 0.0 });
                    Side::Straight { normal, distance }
                };
                (0..D).flat_map(|a| [side(a, -1.0, -lower[a]), side(a, 1.0, upper[a])]).collect()
            }
        }
    }

    fn content(self) -> f64 {
        match (self, D) {
            (Self::Shell { inner, outer }, 2) => PI * (outer * outer - inner * inner),
            (Self::Shell { inner, outer }, _) => 4.0 / 3.0 * PI * (outer.powi(3) - inner.powi(3)),
            (Self::Box { lower, upper }, _) => (0..D).map(|a| upper[a] - lower[a]).product(),
        }
    }
}

/// How the lattice lies: angle in degrees, offset in units of the particles' distance.
const LATTICES: [(f64, f64); 4] = [(0.0, 0.0), (0.0, 0.37), (30.0, 0.0), (-73.0, -0.21)];

/// Cells half as wide in the plane.
fn grid<const D: usize>() -> Grid<f64, D> {
    let cells = if D == 2 { 32 } else { 16 };
    let (lower, spacing) = (SVector::repeat(-2.0), 4.0 / cells as f64);
    Grid { lower, spacing, cells: [cells; D], walls: [[false; 2]; D] }
}

fn clipped<const D: usize>(
    form: Form<D>,
    (angle, offset): (f64, f64),
) -> (Body<f64, D>, Vec<Facet<D>>)
where
    f64: Scalar<D>,
{
    let (sin, cos) = angle.to_radians().sin_cos();
    let turn = if angle == 0.0 { [1.0, 0.0] } else { [cos, sin] };
    let clip = Clip { sides: form.sides(), turn, offset };
    mmsmith_clip::body(&grid(), 2, DENSITY, &clip).expect("a body of more than one dimension")
}

fn polygons<const D: usize>(body: &Body<f64, D>) -> &Mesh<f64, D> {
    body.mesh.as_ref().expect("polygons")
}

fn each_form<const D: usize>() -> impl Iterator<Item = (Form<D>, (f64, f64))> {
    Form::all().into_iter().flat_map(|form| LATTICES.map(|lattice| (form, lattice)))
}

/// The parts of lists that end at `ends`.
fn parts<'a, P>(list: &'a [P], ends: &'a [u32]) -> impl Iterator<Item = &'a [P]> {
    ends.iter()
        .scan(0, |from, &end| Some(&list[std::mem::replace(from, end as usize)..end as usize]))
}

/// The edges or faces of each particle's parts, as lists of corners.
fn facets<const D: usize>(own: &Mesh<f64, D>) -> Vec<Vec<Vec<u32>>> {
    let corners: Vec<&[u32]> = parts(&own.corners, &own.ends).collect();
    let of_part: Vec<Vec<Vec<u32>>> = if D == 2 {
        let edges = |corners: &[u32]| {
            let next = corners.iter().cycle().skip(1);
            corners.iter().zip(next).map(|(a, b)| vec![*a, *b]).collect()
        };
        corners.into_iter().map(edges).collect()
    } else {
        let faces: Vec<&[u32]> = parts(&own.faces.corners, &own.faces.ends).collect();
        let of_polyhedron = |(corners, faces): (&[u32], &[&[u32]])| {
            let of_face = |face: &&[u32]| face.iter().map(|k| corners[*k as usize]).collect();
            faces.iter().map(of_face).collect()
        };
        corners.into_iter().zip(parts(&faces, &own.faces.of_polyhedra)).map(of_polyhedron).collect()
    };
    parts(&of_part, &own.of_particles).map(<[_]>::concat).collect()
}

/// D times the content of what facets enclose.
fn enclosed<const D: usize>(x: &[SVector<f64, D>], facets: &[Vec<u32>]) -> f64 {
    let about = x[facets[0][0] as usize];
    let of_facet = |facet: &Vec<u32>| -> f64 {
        let at = |k: usize| x[facet[k] as usize] - about;
        match D {
            2 => at(0)[0] * at(1)[D - 1] - at(0)[D - 1] * at(1)[0],
            _ => (1..facet.len() - 1).map(|k| at(0).dot(&at(k).cross(&at(k + 1))) / 2.0).sum(),
        }
    };
    facets.iter().map(of_facet).sum()
}

fn masses_and_slivers<const D: usize>()
where
    f64: Scalar<D>,
{
    for (form, lattice) in each_form::<D>() {
        let (body, _) = clipped(form, lattice);
        let (what, p) = (format!("{form:?} {lattice:?}"), &body.particles);
        let mass: f64 = p.mass.iter().sum();
        assert!((mass / (DENSITY * form.content()) - 1.0).abs() < 1e-13, "{what}: {mass}");
        let of_box = (grid::<D>().spacing / 2.0).powi(D as i32);
        let share = |volume: &f64| volume / of_box;
        assert!(p.volume.iter().all(|V| (0.2..2.0).contains(&share(V))), "{what}");
        let own = polygons(&body);
        for (k, facets) in facets(own).iter().enumerate() {
            let whole = enclosed(&own.X, facets) / D as f64;
            assert!((whole - p.volume[k]).abs() < 1e-14 * of_box.max(1e-1), "{what}");
        }
        // The centre of mass of a box is exact; that of a shell has chords for arcs.
        let centre: SVector<f64, D> = p.X.iter().zip(&p.volume).map(|(X, V)| X * *V).sum();
        let (exact, bound): (SVector<f64, D>, _) = match form {
            Form::Box { lower, upper } => {
                (SVector::from_fn(|a, _| 0.5 * (lower[a] + upper[a])), 1e-14)
            }
            Form::Shell { .. } => (SVector::zeros(), 1e-3),
        };
        assert!((centre / form.content() - exact).norm() < bound, "{what}");
    }
}

#[test]
fn clipped_lattices_have_the_mass_of_the_body_and_no_slivers() {
    masses_and_slivers::<2>();
    masses_and_slivers::<3>();
}

/// Every facet lies between two particles, which have it in opposite directions, or on one side of the body.
fn shared_facets<const D: usize>()
where
    f64: Scalar<D>,
{
    // From the lowest corner on, which tells the direction of a face; an edge has it as it is.
    let from_lowest = |facet: &[u32]| {
        let lowest = (0..facet.len()).min_by_key(|k| facet[*k]).unwrap();
        let mut facet = facet.to_vec();
        if D == 3 {
            facet.rotate_left(lowest);
        }
        facet
    };
    for (form, lattice) in each_form::<D>() {
        let (body, boundary) = clipped(form, lattice);
        let (what, own) = (format!("{form:?} {lattice:?}"), polygons(&body));
        let mut known = BTreeMap::new();
        for facet in facets(own).concat() {
            let facet = from_lowest(&facet);
            assert!(known.insert(facet.clone(), false).is_none(), "{what}: {facet:?} twice");
        }
        for Facet { side, corners, .. } in &boundary {
            let seen = known.insert(from_lowest(corners), true);
            assert_eq!(seen, Some(false), "{what}");
            for X in corners.map(|corner| own.X[corner as usize]) {
                let away = match form.sides()[*side] {
                    Side::Straight { normal, distance } => SVector::from(normal).dot(&X) - distance,
                    Side::Inner { radius } | Side::Outer { radius } => X.norm() - radius,
                };
                assert!(away.abs() < 1e-9, "{what}: {away:e}");
            }
        }
        for (facet, on_boundary) in &known {
            let mut back = facet.clone();
            back.reverse();
            assert_eq!(known.contains_key(&from_lowest(&back)), !on_boundary, "{what}: {facet:?}");
        }
    }
}

#[test]
fn neighbours_share_their_facets_and_the_rest_is_the_boundary() {
    shared_facets::<2>();
    shared_facets::<3>();
}

/// Loads on all of the boundary, at the middle of each facet.
pub(crate) fn loaded<const D: usize>(body: &mut Body<f64, D>, boundary: &[Facet<D>]) {
    let shares = [1.0 / D as f64; D];
    let own = body.mesh.as_mut().expect("polygons");
    let middle = |corners: [u32; D]| -> SVector<f64, D> {
        corners.iter().map(|corner| own.X[*corner as usize]).sum::<SVector<f64, D>>() / D as f64
    };
    let load = |&Facet { corners, .. }: &Facet<D>| Load { corners, shares, X: middle(corners) };
    let loads = boundary.iter().map(load).collect();
    own.loads = loads;
}

/// A stress that is the same on all of the boundary.
struct Constant<const D: usize>(SMatrix<f64, D, D>);

impl<const D: usize> BodyForce<f64, D> for Constant<D> {
    fn evaluate(&self, _: usize, _: &[SVector<f64, D>], _: f64, b: &mut [SVector<f64, D>]) {
        b.fill(SVector::zeros());
    }

    fn boundary_stress(&self, _: &[Load<f64, D>], _: f64, stress: &mut [SMatrix<f64, D, D>]) {
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
fn patch_test<const D: usize>(integrators: &[Integrator])
where
    f64: Scalar<D>,
{
    let F = SMatrix::<f64, D, D>::from_row_iterator(
        [1.17, 0.21, 0.05, -0.08, 0.86, -0.12, 0.11, 0.03, 1.06]
            .into_iter()
            .enumerate()
            .filter(|(k, _)| k / 3 < D && k % 3 < D)
            .map(|(_, entry)| entry),
    );
    let (J, mu, lambda) = (det(&F), 40.0, 60.0_f64);
    let one = SMatrix::identity();
    let tau = (F * F.transpose() - one) * mu + one * (lambda * J.ln());
    for (form, lattice) in each_form::<D>() {
        for shape in SHAPES {
            for &integrator in integrators {
                let (mut body, boundary) = clipped(form, lattice);
                loaded(&mut body, &boundary);
                let own = body.mesh.as_mut().unwrap();
                own.x.iter_mut().for_each(|x| *x = F * *x);
                let p = &mut body.particles;
                p.x.iter_mut().for_each(|x| *x = F * *x);
                p.F.fill(F);
                let settings = settings(shape, integrator, Transfer::Flip);
                let mut run = Simulation::new(grid(), body, MATERIAL, settings).unwrap();
                run.step(&Constant(tau / J)).unwrap();
                // In units of the acceleration that the stress gives to a cell.
                let unit = tau.norm() / (DENSITY * grid::<D>().spacing) * settings.time_step;
                let fastest = run.particles().v.iter().map(|v| v.norm() / unit).fold(0.0, f64::max);
                assert!(fastest < 1e-13, "{form:?} {lattice:?} {settings:?}: {fastest:e}");
            }
        }
    }
}

fn det<const D: usize>(F: &SMatrix<f64, D, D>) -> f64 {
    let entry = |i: usize, j: usize| F[(i, j)];
    match D {
        2 => entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0),
        _ => SVector::<f64, D>::from(F.column(0)).dot(&F.column(1).cross(&F.column(2))),
    }
}

#[test]
fn a_constant_stress_gives_no_force_to_rounding() {
    patch_test::<2>(&Integrator::ALL);
    patch_test::<3>(&[Integrator::Cd, Integrator::Usf]);
}

fn moving<const D: usize>(form: Form<D>, lattice: (f64, f64)) -> Body<f64, D>
where
    f64: Scalar<D>,
{
    let (mut body, _) = clipped(form, lattice);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.1 + 0.2 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.02 * noise(11 * k + 3 * i + j));
    }
    body
}

fn transfers() -> [Transfer; 4] {
    [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)]
}

fn momentum_is_kept<const D: usize>(shapes: &[Shape])
where
    f64: Scalar<D>,
{
    for &shape in shapes {
        for integrator in Integrator::ALL {
            for transfer in transfers() {
                let settings = settings(shape, integrator, transfer);
                let body = moving(Form::<D>::all()[0], LATTICES[3]);
                let mut run = Simulation::new(grid(), body, MATERIAL, settings).unwrap();
                let momentum = |run: &Simulation<f64, D>| -> SVector<f64, D> {
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
fn free_bodies_keep_their_momentum_with_every_scheme() {
    momentum_is_kept::<2>(&SHAPES);
    momentum_is_kept::<3>(&SHAPES[..2]);
}

/// The plain implementation shares no loop with the solver: every scheme agrees with it, with light nodes too.
fn agreement<const D: usize>(shapes: &[Shape], integrators: &[Integrator], steps: usize)
where
    f64: Scalar<D>,
{
    let (mut number, mut light) = (0, 0);
    for &shape in shapes {
        for &integrator in integrators {
            for transfer in transfers() {
                let (form, lattice) = (Form::<D>::all()[number % 3], LATTICES[number / 3 % 4]);
                number += 1;
                let settings = settings(shape, integrator, transfer);
                let body = moving(form, lattice);
                let what = format!("{form:?} {lattice:?} {settings:?}");
                let mut one = Reference::new(grid(), body.clone(), MATERIAL, settings);
                let mut two = Simulation::new(grid(), body, MATERIAL, settings).unwrap();
                for _ in 0..steps {
                    one.step(&NoBodyForce).expect(&what);
                    two.step(&NoBodyForce).expect(&what);
                    light += one.light();
                }
                let (p, q) = (one.particles(), two.particles());
                let corners =
                    difference(&one.body().mesh.as_ref().unwrap().x, &two.mesh().unwrap().x);
                for (field, off, limit) in [
                    ("x", difference(&p.x, &q.x), 1e-13),
                    ("corners", corners, 1e-13),
                    ("v", difference(&p.v, &q.v), 1e-11),
                    ("F", difference(&p.F, &q.F), 1e-11),
                ] {
                    assert!(off < limit, "{field}: {off:e} {what}");
                }
            }
        }
    }
    assert!(light > 50, "{light}");
}

#[test]
fn polygons_move_as_in_the_plain_implementation() {
    agreement::<2>(&SHAPES, &Integrator::ALL, 4);
    agreement::<3>(&SHAPES[..1], &[Integrator::Cd, Integrator::Usavg], 1);
}

fn same_bits<const D: usize>()
where
    f64: Scalar<D>,
    f32: Scalar<D>,
{
    fn check<T: Scalar<D>, const D: usize>(
        body: &Body<T, D>,
        grid: &Grid<T, D>,
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
        assert_eq!(one.mesh(), three.mesh(), "{settings:?}");
        let mut half = new();
        (0..5).for_each(|_| half.step(&NoBodyForce).unwrap());
        let kept: Vec<Vec<u8>> = half.state().iter().map(|part| part.to_vec()).collect();
        // What continues has gone another way before.
        let mut other = new();
        (0..2).for_each(|_| other.step(&NoBodyForce).unwrap());
        other.take_up(vec![kept]).unwrap();
        (0..7).for_each(|_| other.step(&NoBodyForce).unwrap());
        assert_eq!(one.particles(), other.particles(), "{settings:?}");
        assert_eq!(one.mesh(), other.mesh(), "{settings:?}");
    }
    for (transfer, integrator) in transfers().into_iter().zip(Integrator::ALL) {
        for shape in SHAPES {
            let settings = settings(shape, integrator, transfer);
            let body = moving(Form::<D>::all()[2], LATTICES[2]);
            let grid = grid::<D>();
            check(&body, &grid, settings, |x| x);
            let in_single = Grid {
                lower: grid.lower.cast(),
                spacing: grid.spacing as f32,
                cells: grid.cells,
                walls: grid.walls,
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
fn polygons_have_the_same_bits_on_any_number_of_threads_and_go_on_from_a_state() {
    same_bits::<2>();
    same_bits::<3>();
}

#[test]
fn corners_on_walls_stay_on_them() {
    for shape in SHAPES {
        for integrator in Integrator::ALL {
            let cells = [24; 2];
            let grid =
                Grid { lower: SVector::zeros(), spacing: 0.125, cells, walls: [[true, false]; 2] };
            let form = Form::<2>::all()[1];
            let planes = [[-1.0, 0.0], [0.0, -1.0]];
            let planes = planes.map(|normal| Side::Straight { normal, distance: 0.0 });
            let sides = form.sides().into_iter().chain(planes).collect();
            let clip = Clip { sides, turn: [1.0, 0.0], offset: 0.0 };
            let (mut body, _) = mmsmith_clip::body(&grid, 2, DENSITY, &clip).unwrap();
            let p = &mut body.particles;
            (0..p.len()).for_each(|k| p.v[k] = SVector::from_fn(|a, _| noise(7 * k + a)));
            let on_walls = |own: &Mesh<f64, 2>| own.x.iter().map(|x| x.map(|x| x == 0.0)).collect();
            let before: Vec<_> = on_walls(polygons(&body));
            let settings = settings(shape, integrator, Transfer::Flip);
            let mut run = Simulation::new(grid, body, MATERIAL, settings).unwrap();
            (0..30).for_each(|_| run.step(&NoBodyForce).unwrap());
            assert_eq!(on_walls(run.mesh().unwrap()), before, "{settings:?}");
        }
    }
}

#[test]
fn bodies_that_cannot_be_are_refused() {
    let set_up = |change: &dyn Fn(&mut Mesh<f64, 2>, &mut Grid<f64, 2>), shape| {
        let (mut body, mut grid) = (moving(Form::<2>::all()[1], LATTICES[2]), grid());
        change(body.mesh.as_mut().unwrap(), &mut grid);
        let settings = settings(shape, Integrator::Cd, Transfer::Flip);
        Simulation::new(grid, body, MATERIAL, settings).err()
    };
    let none = |_: &mut Mesh<f64, 2>, _: &mut Grid<f64, 2>| {};
    assert!(matches!(set_up(&none, Shape::Gimp), Some(SetupError::NotOfPolygons { .. })));
    let walls = |_: &mut Mesh<f64, 2>, grid: &mut Grid<f64, 2>| grid.walls[0][1] = true;
    assert_eq!(set_up(&walls, Shape::Cpdi2), Some(SetupError::TurnedWalls));
    let beyond = |own: &mut Mesh<f64, 2>, _: &mut Grid<f64, 2>| own.corners[3] = 1 << 30;
    let found = set_up(&beyond, Shape::Cpdi2);
    assert!(matches!(found, Some(SetupError::NoSuchCorner { corner: 0x4000_0000, .. })));
    let idle = |own: &mut Mesh<f64, 2>, _: &mut Grid<f64, 2>| {
        own.X.push(Vector2::zeros());
        own.x.push(Vector2::zeros());
    };
    assert!(matches!(set_up(&idle, Shape::Cpdi2), Some(SetupError::IdleCorner { .. })));
    let short = |own: &mut Mesh<f64, 2>, _: &mut Grid<f64, 2>| {
        own.of_particles.pop();
    };
    assert!(matches!(set_up(&short, Shape::Cpdi2), Some(SetupError::LengthMismatch { .. })));
    let away = |own: &mut Mesh<f64, 2>, _: &mut Grid<f64, 2>| own.x[0] = vector![9.0, 0.0];
    assert!(matches!(set_up(&away, Shape::Cpdi2), Some(SetupError::InitialState(_))));
    let grid = Grid { lower: vector![0.0], spacing: 0.5, cells: [2], walls: [[false; 2]] };
    let sides = vec![Side::Straight { normal: [1.0], distance: 0.7 }];
    let clip = Clip { sides, turn: [1.0, 0.0], offset: 0.0 };
    let found = mmsmith_clip::body::<f64, 1>(&grid, 2, DENSITY, &clip).err();
    assert_eq!(found, Some(SetupError::PolygonDimension { dimension: 1 }));
    let mut body = moving(Form::<3>::all()[2], LATTICES[0]);
    body.mesh.as_mut().unwrap().faces.corners[5] = 77;
    let settings = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let found = Simulation::new(self::grid(), body, MATERIAL, settings).err();
    assert_eq!(found, Some(SetupError::NoSuchCorner { corner: 77, corners: 8 }));
}
