//! Every scheme: the same results as those of a plain implementation, what it has to keep, and how its runs and set-ups fail.

use mmsmith_mpm::{
    Annulus, Body, BodyForce, Grid, Integrator, Material, Mesh, NoBodyForce, Particles, Scalar,
    Settings, SetupError, Shape, Simulated, Simulation, StepError, Transfer,
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};

use crate::reference::Reference;

pub(crate) const SHAPES: [Shape; 8] = [
    Shape::Linear,
    Shape::Ugimp,
    Shape::Gimp,
    Shape::Bspline2,
    Shape::Bspline3,
    Shape::GimpBspline2,
    Shape::Cpdi,
    Shape::Cpdi2,
];
pub(crate) const INTEGRATORS: [Integrator; 5] =
    [Integrator::Usf, Integrator::Usl, Integrator::Musl, Integrator::Usavg, Integrator::Cd];
pub(crate) const TRANSFERS: [Transfer; 5] =
    [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(2), Transfer::Xpic(5)];
const SOFT: Material<f64> = Material::NeoHookean { lambda: 60.0, mu: 40.0 };

/// Every scheme.
pub(crate) fn schemes() -> impl Iterator<Item = Settings<f64>> {
    SHAPES.into_iter().flat_map(|shape| {
        INTEGRATORS.into_iter().flat_map(move |integrator| {
            TRANSFERS.map(|transfer| settings(shape, integrator, transfer))
        })
    })
}

/// Every shape with every integrator and every transfer once, and every pair of these with one of the shapes.
pub(crate) fn some_schemes() -> impl Iterator<Item = Settings<f64>> {
    SHAPES.into_iter().enumerate().flat_map(|(s, shape)| {
        INTEGRATORS.into_iter().enumerate().map(move |(i, integrator)| {
            settings(shape, integrator, TRANSFERS[(i + s) % TRANSFERS.len()])
        })
    })
}

pub(crate) fn settings(shape: Shape, integrator: Integrator, transfer: Transfer) -> Settings<f64> {
    Settings { shape, integrator, transfer, time_step: 1e-3, halve_first_acceleration: false }
}

pub(crate) fn open_grid<const D: usize>(cells: usize) -> Grid<f64, D> {
    let spacing = 1.0 / cells as f64;
    Grid { lower: SVector::zeros(), spacing, cells: [cells; D], walls: [[false; 2]; D] }
}

/// Different for every particle and component, and far from any regularity.
pub(crate) fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

/// Distorts a body and sets it in motion.
fn disturb<const D: usize>(mut body: Body<f64, D>, spacing: f64) -> Body<f64, D> {
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| 0.5 * noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| 0.1 * noise(11 * k + 3 * i + j));
        p.x[k] += SVector::from_fn(|a, _| 0.2 * spacing * noise(13 * k + a));
    }
    if let Some(mesh) = &mut body.mesh {
        for (k, x) in mesh.x.iter_mut().enumerate() {
            *x += SVector::from_fn(|a, _| 0.1 * spacing * noise(17 * k + a));
        }
    }
    body
}

/// A distorted, moving block in the middle of the grid.
pub(crate) fn block<const D: usize>(grid: &Grid<f64, D>) -> Body<f64, D> {
    let inside = |X: &SVector<f64, D>| X.iter().all(|x| (0.25..0.75).contains(x));
    disturb(Body::lattice(grid, 2, 2.0, inside), grid.spacing)
}

fn momentum<const D: usize>(simulation: &Simulation<f64, D>) -> SVector<f64, D> {
    let p = simulation.particles();
    p.v.iter().zip(&p.mass).map(|(v, &m)| v * m).sum()
}

/// A body in single precision.
pub(crate) fn single<const D: usize>(body: &Body<f64, D>) -> Body<f32, D> {
    let vectors = |all: &[SVector<f64, D>]| all.iter().map(|x| x.cast()).collect();
    let matrices = |all: &[SMatrix<f64, D, D>]| all.iter().map(|A| A.cast()).collect();
    let p = &body.particles;
    let particles = Particles {
        X: vectors(&p.X),
        x: vectors(&p.x),
        v: vectors(&p.v),
        F: matrices(&p.F),
        mass: p.mass.iter().map(|&m| m as f32).collect(),
        volume: p.volume.iter().map(|&V| V as f32).collect(),
        half_size: p.half_size.cast(),
        ..Particles::default()
    };
    Body {
        half_edges: matrices(&body.half_edges),
        mesh: body.mesh.as_ref().map(|own| Mesh {
            interpolation: own.interpolation,
            X: vectors(&own.X),
            x: vectors(&own.x),
            corners: own.corners.clone(),
            ends: own.ends.clone(),
            of_particles: own.of_particles.clone(),
            faces: own.faces.clone(),
            loads: Vec::new(),
            turn: own.turn.map(|turn| turn.cast()),
            numbers: None,
        }),
        ..particles.into()
    }
}

/// Half-edges of the particles' domains.
#[derive(Clone, Copy)]
enum Edges {
    /// Not given: domains are boxes.
    Boxes,
    /// Half-edges of boxes.
    Given,
    /// Half-edges of parallelograms, for the shape that has them.
    Sheared,
}

/// A body in motion, of unequal particles out of order.
#[derive(Clone, Copy)]
struct Scene {
    walls: [bool; 2],
    /// Along all axes but the second, which has one more.
    cells: usize,
    /// Spacing of the lattice of particles, in cells of the grid.
    spacing: f64,
    per_cell: usize,
    /// Radius of the body, in cells of the lattice.
    radius: f64,
    /// Sizes of boxes in those which touch.
    overlap: f64,
    edges: Edges,
    distortion: f64,
}

/// Scenes that differ in what particles reach: walls on either side, none, both at once, and few or many cells.
fn scenes<const D: usize>() -> [Scene; 7] {
    let of = |one: usize, two: usize, three: usize| [one, two, three][D - 1];
    let whole = f64::INFINITY;
    let usual = Scene {
        walls: [false; 2],
        cells: of(6, 5, 4),
        spacing: 1.0,
        per_cell: 2,
        radius: if D < 3 { 3.8 } else { 2.8 },
        overlap: 1.0,
        edges: Edges::Given,
        distortion: 0.2,
    };
    let filled = Scene { radius: whole, ..usual };
    [
        usual,
        Scene {
            walls: [true; 2],
            cells: of(40, 6, 4),
            radius: [36.0, 4.8, 2.8][D - 1],
            edges: Edges::Boxes,
            ..usual
        },
        Scene { walls: [true, false], edges: Edges::Sheared, ..usual },
        Scene { walls: [false, true], cells: of(6, 4, 2), overlap: 3.0, ..filled },
        Scene {
            walls: [true; 2],
            cells: 1,
            per_cell: of(3, 3, 2),
            overlap: 3.0,
            edges: Edges::Sheared,
            ..filled
        },
        Scene { walls: [true; 2], cells: of(6, 5, 3), per_cell: 1, ..filled },
        // Half of each domain is nearly two cells.
        Scene {
            walls: [true, false],
            cells: 2,
            spacing: 3.4,
            per_cell: 1,
            edges: Edges::Boxes,
            distortion: 0.08,
            ..filled
        },
    ]
}

impl Scene {
    fn build<const D: usize>(&self, shape: Shape) -> (Grid<f64, D>, Body<f64, D>) {
        let lower = SVector::from_fn(|a, _| 0.3 * a as f64 - 0.2);
        let cells = std::array::from_fn(|a| if a == 1 { self.cells + 1 } else { self.cells });
        let coarse = Grid { lower, spacing: 0.25 * self.spacing, cells, walls: [self.walls; D] };
        let grid = Grid {
            spacing: 0.25,
            cells: cells.map(|cells| (cells as f64 * self.spacing).ceil() as usize),
            ..coarse.clone()
        };
        let inside = |X: &SVector<f64, D>| (X - lower).norm() < self.radius * coarse.spacing;
        let mut body = Body::lattice(&coarse, self.per_cell, 2.0, inside);
        let (size, spacing) = (self.distortion, grid.spacing);
        let p = &mut body.particles;
        for k in 0..p.len() {
            p.v[k] = SVector::from_fn(|a, _| noise(7 * k + a));
            p.F[k] += SMatrix::from_fn(|i, j| size * noise(11 * k + 3 * i + j));
            p.x[k] += SVector::from_fn(|a, _| 0.2 * size * spacing * noise(13 * k + a));
            p.mass[k] *= 1.0 + 0.3 * noise(19 * k);
            p.volume[k] *= 1.0 + 0.3 * noise(23 * k);
        }
        // Splines leave less room for boxes.
        let overlap = if shape == Shape::GimpBspline2 { 0.75 * self.overlap } else { self.overlap };
        p.half_size *= overlap;
        let half_edges = &mut body.half_edges;
        match self.edges {
            Edges::Boxes => half_edges.clear(),
            _ => half_edges.iter_mut().for_each(|E| *E *= overlap),
        }
        if let (Edges::Sheared, Shape::Cpdi) = (self.edges, shape) {
            for (k, E) in half_edges.iter_mut().enumerate() {
                let shear = SMatrix::from_fn(|i, j| 0.5 * noise(29 * k + 3 * i + j));
                *E *= SMatrix::<f64, D, D>::identity() + shear;
            }
        }
        let upper = grid.upper();
        for (k, x) in body.mesh.iter_mut().flat_map(|mesh| &mut mesh.x).enumerate() {
            for a in 0..D {
                // What lies on a face stays on it.
                if (x[a] - lower[a]).min(upper[a] - x[a]) > 1e-9 {
                    x[a] += 0.4 * size * spacing * noise(17 * k + a);
                }
            }
        }
        (grid, body)
    }
}

const STIFF: Material<f64> = Material::NeoHookean { lambda: 500.0, mu: 400.0 };

/// A body force that depends on place, time and particle.
struct Force;

impl<const D: usize> BodyForce<f64, D> for Force {
    fn evaluate(&self, first: usize, X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]) {
        for (k, (X, b)) in X.iter().zip(b).enumerate() {
            *b = X * (3.0 + 100.0 * t) + SVector::repeat(0.01 * ((first + k) % 5) as f64 + 1.0);
        }
    }
}

/// The largest difference of two fields.
pub(crate) fn difference<const R: usize, const C: usize>(
    one: &[SMatrix<f64, R, C>],
    two: &[SMatrix<f64, R, C>],
) -> f64 {
    assert_eq!(one.len(), two.len());
    // What is no number is far from any.
    let apart = |(one, two): (&SMatrix<f64, R, C>, &SMatrix<f64, R, C>)| {
        let apart = (one - two).norm();
        if apart.is_nan() { f64::INFINITY } else { apart }
    };
    one.iter().zip(two).map(apart).fold(0.0, f64::max)
}

/// Two implementations that share no loop: weights, walls, forces, transfers and updates have to agree.
#[test]
fn results_are_those_of_the_plain_implementation() {
    fn check<const D: usize>(steps: usize)
    where
        f64: Scalar<D>,
    {
        for (number, scene) in scenes::<D>().iter().enumerate() {
            let mut moved = 0.0_f64;
            for settings in schemes() {
                let halved =
                    settings.integrator == Integrator::Cd && settings.transfer != Transfer::Pic;
                let settings =
                    Settings { time_step: 2e-3, halve_first_acceleration: halved, ..settings };
                let (grid, body) = scene.build::<D>(settings.shape);
                let what = format!("{D} {number} {settings:?}");
                let mut one = Reference::new(grid.clone(), body.clone(), STIFF, settings);
                let mut two = Simulation::new(grid, body.clone(), STIFF, settings).expect(&what);
                for _ in 0..steps {
                    one.step(&Force).expect(&what);
                    two.step(&Force).expect(&what);
                }
                assert_eq!(one.time(), two.time());
                let (p, q) = (one.particles(), two.particles());
                moved = difference(&p.x, &body.particles.x).max(moved);
                let fastest = p.v.iter().map(|v| v.norm()).fold(1e-3, f64::max);
                let off = difference(&p.x, &q.x);
                assert!(off < 1e-13, "x: {off:e} {what}");
                let off = difference(&p.v, &q.v) / fastest;
                assert!(off < 1e-11, "v: {off:e} {what}");
                let off = difference(&p.F, &q.F);
                assert!(off < 1e-11, "F: {off:e} {what}");
                assert_eq!(two.mesh().is_some(), settings.shape == Shape::Cpdi2);
                if let (Some(one), Some(two)) = (&one.body().mesh, two.mesh()) {
                    let off = difference(&one.x, &two.x);
                    assert!(off < 1e-13, "corners: {off:e} {what}");
                }
            }
            // A line of one cell has no nodes but those on its walls.
            assert_eq!(moved > 1e-4, D > 1 || scene.cells > 1, "{D} {number}: {moved:e}");
        }
        // Particles are worked on by the block, and not all blocks are full.
        let counts = scenes::<D>().map(|scene| scene.build::<D>(Shape::Cpdi).1.particles.len());
        assert!(counts.iter().any(|count| *count > 64 && count % 64 > 0), "{counts:?}");
        assert!(counts.iter().any(|count| count % 8 > 0), "{counts:?}");
    }
    check::<1>(10);
    check::<2>(8);
    check::<3>(2);
}

/// Which particle is invalid, and why.
fn told(error: &StepError) -> String {
    let (particle, reason) = match error {
        StepError::Inverted { particle, .. } => (particle, "is inverted"),
        StepError::NotFinite { particle, .. } => (particle, "is not finite"),
        StepError::LeftGrid { particle, .. } => (particle, "has left the grid"),
        StepError::TooLarge { particle, .. } => (particle, "is too large"),
    };
    format!("particle {particle} {reason}")
}

#[test]
fn failed_runs_name_the_same_particle_and_reason_as_the_plain_implementation() {
    fn check<const D: usize>(reasons: &mut Vec<String>)
    where
        f64: Scalar<D>,
    {
        let [_, _, scene, ..] = scenes::<D>();
        let scene = Scene { edges: Edges::Boxes, ..scene };
        let wide = Scene { overlap: 6.0, ..scene };
        let undefined = |X: &[SVector<f64, D>], t: f64, b: &mut [SVector<f64, D>]| {
            for (X, b) in X.iter().zip(b) {
                *b = SVector::repeat(if t > 3e-3 && X[0] > 0.2 { f64::NAN } else { 0.0 });
            }
        };
        for settings in some_schemes() {
            let settings = Settings { time_step: 2e-3, ..settings };
            let fails = |scene: &Scene, speed: f64, force: &dyn BodyForce<f64, D>| {
                let (grid, mut body) = scene.build::<D>(settings.shape);
                for (k, v) in body.particles.v.iter_mut().enumerate() {
                    *v = SVector::from_fn(|a, _| speed * noise(7 * k + a));
                }
                let mut one = Reference::new(grid.clone(), body.clone(), STIFF, settings);
                let mut two = Simulation::new(grid, body, STIFF, settings).unwrap();
                (0..60).find_map(|step| {
                    let (one, two) = (one.step(force), two.step(force));
                    let two = two.as_ref().map_err(told);
                    assert_eq!(one.as_ref(), two.copied().as_ref(), "{D} {step} {settings:?}");
                    one.err()
                })
            };
            reasons.extend(fails(&scene, 400.0, &NoBodyForce));
            reasons.extend(fails(&wide, 100.0, &NoBodyForce));
            let error = fails(&scene, 0.0, &undefined).unwrap();
            assert!(error.ends_with("is not finite"), "{error} {settings:?}");
            reasons.push(error);
        }
    }
    let mut reasons = Vec::new();
    check::<1>(&mut reasons);
    check::<2>(&mut reasons);
    check::<3>(&mut reasons);
    for reason in ["is inverted", "is not finite", "has left the grid", "is too large"] {
        let count = reasons.iter().filter(|told| told.ends_with(reason)).count();
        assert!(count > 3, "{reason}: {count}");
    }
}

#[test]
fn single_precision_differs_by_rounding() {
    for scene in scenes::<2>() {
        for settings in schemes() {
            let settings = Settings { time_step: 2e-3, ..settings };
            let (grid, body) = scene.build::<2>(settings.shape);
            let coarse = Grid {
                lower: grid.lower.cast(),
                spacing: 0.25,
                cells: grid.cells,
                walls: grid.walls,
            };
            let of_single = Settings {
                shape: settings.shape,
                integrator: settings.integrator,
                transfer: settings.transfer,
                time_step: 2e-3,
                halve_first_acceleration: false,
            };
            let material = Material::NeoHookean { lambda: 500.0, mu: 400.0 };
            let mut one = Simulation::new(coarse, single(&body), material, of_single).unwrap();
            let mut two = Simulation::new(grid, body, STIFF, settings).unwrap();
            for _ in 0..3 {
                one.step(&NoBodyForce).unwrap();
                two.step(&NoBodyForce).unwrap();
            }
            let (p, q) = (one.particles(), two.particles());
            for k in 0..q.len() {
                let x = (p.x[k].cast::<f64>() - q.x[k]).norm();
                let v = (p.v[k].cast::<f64>() - q.v[k]).norm();
                let F = (p.F[k].cast::<f64>() - q.F[k]).norm();
                assert!(x < 1e-6 && v < 1e-4 && F < 1e-5, "{x:e} {v:e} {F:e} {settings:?}");
            }
        }
    }
}

#[test]
fn momentum_changes_by_the_body_force_only() {
    fn check<const D: usize>(cells: usize)
    where
        f64: Scalar<D>,
    {
        for settings in schemes() {
            let grid = open_grid::<D>(cells);
            let body = block(&grid);
            let mass = body.particles.mass.iter().sum::<f64>();
            let force = SVector::<f64, D>::from_fn(|a, _| 1.0 + a as f64);
            let b = |_: &[SVector<f64, D>], _: f64, b: &mut [SVector<f64, D>]| b.fill(force);
            let mut simulation = Simulation::new(grid, body, SOFT, settings).unwrap();
            let before = momentum(&simulation);
            for step in 1..=5 {
                simulation.step(&b).unwrap();
                let expected = before + force * (mass * settings.time_step * f64::from(step));
                assert!((momentum(&simulation) - expected).norm() < 1e-13, "{settings:?}");
            }
        }
    }
    check::<1>(8);
    check::<2>(8);
    check::<3>(6);
}

#[test]
fn a_body_at_rest_stays_exactly_at_rest() {
    fn check<const D: usize>()
    where
        f64: Scalar<D>,
    {
        for settings in schemes() {
            let grid = Grid { walls: [[true, false]; D], ..open_grid::<D>(5) };
            let body = Body::lattice(&grid, 2, 2.0, |X| X.iter().all(|&x| x < 0.5));
            let mut initial = body.particles.clone();
            let mut simulation = Simulation::new(grid, body, SOFT, settings).unwrap();
            for _ in 0..3 {
                simulation.step(&NoBodyForce).unwrap();
            }
            let affine = if settings.transfer.is_affine() { initial.len() } else { 0 };
            initial.affine = vec![SMatrix::zeros(); affine];
            assert_eq!(simulation.particles(), &initial, "{settings:?}");
            if let Some(mesh) = simulation.mesh() {
                assert_eq!(mesh.x, mesh.X, "{settings:?}");
            }
            assert_eq!(simulation.steps_done(), 3);
        }
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn a_free_body_flies_straight_through_the_cells() {
    for settings in schemes() {
        let grid = open_grid::<2>(10);
        let inside = |X: &Vector2<f64>| X.iter().all(|&x| (0.1..0.3).contains(&x));
        let mut body = Body::lattice(&grid, 2, 2.0, inside);
        let v = vector![1.0, 0.7];
        body.particles.v.fill(v);
        let settings = Settings { time_step: 4e-3, ..settings };
        let mut simulation = Simulation::new(grid, body, SOFT, settings).unwrap();
        for _ in 0..125 {
            simulation.step(&NoBodyForce).unwrap();
        }
        let p = simulation.particles();
        for k in 0..p.len() {
            assert!((p.x[k] - p.X[k] - v * 0.5).norm() < 1e-10, "{settings:?}");
            assert!((p.v[k] - v).norm() < 1e-10 && (p.F[k] - Matrix2::identity()).norm() < 1e-9);
        }
        if let Some(mesh) = simulation.mesh() {
            assert!(mesh.x.iter().zip(&mesh.X).all(|(x, X)| (x - X - v * 0.5).norm() < 1e-10));
        }
    }
}

/// A quarter turn maps the grid onto itself, so that it has to map the motion onto itself.
#[test]
fn a_turned_body_moves_as_the_body_does_turned() {
    let grid =
        Grid { lower: vector![-1.0, -1.0], spacing: 0.25, cells: [8, 8], walls: [[false; 2]; 2] };
    let Q = Matrix2::new(0.0, -1.0, 1.0, 0.0);
    let ring = Annulus { inner: 0.3, outer: 0.6, quarter: false };
    let body = disturb(Body::annulus(&ring, grid.spacing, 2, 2.0).unwrap(), grid.spacing);
    let mut turned = body.clone();
    let p = &mut turned.particles;
    for x in p.X.iter_mut().chain(&mut p.x).chain(&mut p.v) {
        *x = Q * *x;
    }
    p.F.iter_mut().for_each(|F| *F = Q * *F);
    // The deformation gradient refers to the edges, which stay as they are.
    for x in &mut turned.mesh.as_mut().unwrap().x {
        *x = Q * *x;
    }
    for shape in [Shape::Linear, Shape::Bspline2, Shape::Bspline3, Shape::Cpdi, Shape::Cpdi2] {
        for integrator in INTEGRATORS {
            for transfer in TRANSFERS {
                let settings = settings(shape, integrator, transfer);
                let run = |body: &Body<f64, 2>| {
                    let mut run =
                        Simulation::new(grid.clone(), body.clone(), SOFT, settings).unwrap();
                    for _ in 0..3 {
                        run.step(&NoBodyForce).unwrap();
                    }
                    run
                };
                let (one, two) = (run(&body), run(&turned));
                let (one, two) = (one.particles(), two.particles());
                for k in 0..one.len() {
                    assert!((Q * one.x[k] - two.x[k]).norm() < 1e-12, "{settings:?}");
                    assert!((Q * one.v[k] - two.v[k]).norm() < 1e-9, "{settings:?}");
                    assert!((Q * one.F[k] - two.F[k]).norm() < 1e-9, "{settings:?}");
                }
            }
        }
    }
}

/// With next to no stress the transfers are operators on the particles' velocities alone: `P = S S^+` for PIC and
/// `I - (I - P)^m` for XPIC(m).
#[test]
fn xpic_is_the_power_of_pic_that_it_is_named_after() {
    fn check<const D: usize>(cells: [usize; D])
    where
        f64: Simulated<D>,
    {
        let grid =
            Grid { lower: SVector::zeros(), spacing: 1.0 / 6.0, cells, walls: [[false; 2]; D] };
        let feather = Material::NeoHookean { lambda: 0.0, mu: 1e-200 };
        let upper = grid.upper();
        let inside = |X: &SVector<f64, D>| (0..D).all(|a| 0.2 < X[a] && X[a] < upper[a] - 0.2);
        let body = disturb(Body::lattice(&grid, 2, 2.0, inside), grid.spacing);
        let after = |v: &[SVector<f64, D>], transfer: Transfer| {
            let mut body = body.clone();
            body.particles.v = v.to_vec();
            let settings = settings(Shape::Gimp, Integrator::Usl, transfer);
            let mut simulation = Simulation::new(grid.clone(), body, feather, settings).unwrap();
            simulation.step(&NoBodyForce).unwrap();
            simulation.particles().v.clone()
        };
        let v = &body.particles.v;
        let mut rest = v.clone();
        for m in 1..=5 {
            // (I - P)^m v
            let filtered = after(&rest, Transfer::Pic);
            rest.iter_mut().zip(&filtered).for_each(|(rest, filtered)| *rest -= filtered);
            let found = after(v, Transfer::Xpic(m));
            for ((found, v), rest) in found.iter().zip(v).zip(&rest) {
                assert!((found - (v - rest)).norm() < 1e-13, "{cells:?}, {m}");
            }
        }
        let kept = after(v, Transfer::Flip);
        assert!(kept.iter().zip(v).all(|(kept, v)| (kept - v).norm() < 1e-15));
    }
    check([6]);
    check([6, 6]);
    check([4, 4, 4]);
    // Several tiles, one after the other along one axis, and along two.
    check([4, 4, 24]);
    check([4, 9, 24]);
}

#[test]
fn usavg_updates_stress_by_halves() {
    let grid = open_grid::<2>(6);
    let C = Matrix2::new(0.3, -0.8, 0.5, 0.2);
    let inside = |X: &Vector2<f64>| X.iter().all(|x| (0.16..0.84).contains(x));
    let mut body = Body::lattice(&grid, 2, 2.0, inside);
    body.particles.v = body.particles.X.iter().map(|X| C * X).collect();
    let feather = Material::NeoHookean { lambda: 0.0, mu: 1e-200 };
    let half = Matrix2::identity() + C * 0.5e-3;
    for (integrator, expected) in [
        (Integrator::Usavg, half * half),
        (Integrator::Usf, half * 2.0 - Matrix2::identity()),
        (Integrator::Usl, half * 2.0 - Matrix2::identity()),
    ] {
        // In the interior cells the lumped projection of a linear field on this lattice is exact.
        let settings = settings(Shape::Gimp, integrator, Transfer::Flip);
        let mut simulation =
            Simulation::new(grid.clone(), body.clone(), feather, settings).unwrap();
        simulation.step(&NoBodyForce).unwrap();
        let p = simulation.particles();
        let inner = (0..p.len()).filter(|&k| (p.X[k] - vector![0.5, 0.5]).amax() < 0.1);
        for k in inner {
            assert!((p.F[k] - expected).norm() < 1e-15, "{integrator:?} {}", p.F[k] - expected);
        }
    }
}

/// Body-fitted quadrilaterals see both rims and the planes of symmetry as they are.
#[test]
fn corners_on_planes_of_symmetry_stay_there() {
    let grid =
        Grid { lower: vector![0.0, 0.0], spacing: 0.1, cells: [9, 9], walls: [[true, false]; 2] };
    let ring = Annulus { inner: 0.4, outer: 0.6, quarter: true };
    let mut body = Body::annulus(&ring, grid.spacing, 2, 2.0).unwrap();
    for (v, X) in body.particles.v.iter_mut().zip(&body.particles.X) {
        *v = X * 2.0;
    }
    let settings = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let mut simulation = Simulation::new(grid, body, SOFT, settings).unwrap();
    for _ in 0..50 {
        simulation.step(&NoBodyForce).unwrap();
    }
    let mesh = simulation.mesh().unwrap();
    for (x, X) in mesh.x.iter().zip(&mesh.X) {
        assert!(x.norm() > X.norm() + 0.01);
        for a in 0..2 {
            assert_eq!(X[a] == 0.0, x[a] == 0.0);
        }
    }
}

#[test]
fn cells_whose_corners_fall_together_move_as_in_the_plain_implementation() {
    for settings in schemes().filter(|settings| settings.shape == Shape::Cpdi2) {
        let grid = open_grid::<2>(8);
        let mut body = block(&grid);
        let mesh = body.mesh.as_mut().unwrap();
        let mut cells_at = vec![0; mesh.X.len()];
        mesh.corners.iter().for_each(|&corner| cells_at[corner as usize] += 1);
        let is_inner = |corner: &u32| cells_at[*corner as usize] == 4;
        let mut triangles = 0;
        for (k, cell) in mesh.corners.chunks_mut(4).enumerate() {
            if k % 3 > 0 && cell.iter().all(is_inner) {
                cell[1 + k % 3] = cell[k % 3];
                triangles += 1;
            }
        }
        assert!(triangles > 3);
        let mut one = Reference::new(grid.clone(), body.clone(), SOFT, settings);
        let mut two = Simulation::new(grid, body, SOFT, settings).unwrap();
        for _ in 0..4 {
            one.step(&Force).unwrap();
            two.step(&Force).unwrap();
        }
        let corners = (&one.body().mesh.as_ref().unwrap().x, &two.mesh().unwrap().x);
        assert!(difference(corners.0, corners.1) < 1e-13, "{settings:?}");
        let off = difference(&one.particles().F, &two.particles().F);
        assert!(off < 1e-11, "{off:e} {settings:?}");
    }
}

#[test]
fn failures_name_the_step_the_particle_and_the_remedy() {
    let grid = open_grid::<2>(4);
    let body = || Body::lattice(&grid, 2, 2.0, |X| X.iter().all(|&x| (0.25..0.75).contains(&x)));
    for shape in SHAPES {
        let run = |body: Body<f64, 2>, dt: f64| {
            let settings =
                Settings { time_step: dt, ..settings(shape, Integrator::Usl, Transfer::Flip) };
            let mut simulation = Simulation::new(grid.clone(), body, SOFT, settings).unwrap();
            let error = (0..200).find_map(|_| simulation.step(&NoBodyForce).err()).unwrap();
            assert_eq!(simulation.step(&NoBodyForce), Err(error.clone()), "{shape:?}");
            error
        };
        let mut flying = body();
        flying.particles.v.fill(vector![1.0, 0.0]);
        let error = run(flying, 1e-2);
        assert!(matches!(error, StepError::LeftGrid { axis: 0, .. }), "{shape:?} {error}");

        let mut falling_in = body();
        for (v, X) in falling_in.particles.v.iter_mut().zip(&falling_in.particles.X) {
            *v = (vector![0.5, 0.5] - X) * 200.0;
        }
        let error = run(falling_in, 1e-2);
        assert!(
            matches!(error, StepError::Inverted { step: 1, .. } | StepError::LeftGrid { .. }),
            "{shape:?} {error}"
        );
    }
    let nan = |_: &[Vector2<f64>], _: f64, b: &mut [Vector2<f64>]| b.fill(vector![f64::NAN, 0.0]);
    let settings = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let mut simulation = Simulation::new(grid.clone(), body(), SOFT, settings).unwrap();
    let error = simulation.step(&nan).unwrap_err();
    assert!(matches!(error, StepError::NotFinite { step: 1, particle: 0, .. }), "{error}");
}

#[test]
fn set_ups_that_make_no_sense_are_refused() {
    let grid = open_grid::<2>(4);
    let flat = settings(Shape::Cpdi2, Integrator::Cd, Transfer::Flip);
    let body = Body::lattice(&grid, 2, 2.0, |X| X.norm() < 0.5);
    let refused = |body: &Body<f64, 2>, settings| {
        Simulation::new(grid.clone(), body.clone(), SOFT, settings).unwrap_err()
    };
    let without = Body { mesh: None, ..body.clone() };
    assert_eq!(refused(&without, flat), SetupError::NoCorners);
    let mut wrong = body.clone();
    wrong.mesh.as_mut().unwrap().corners[14] = 1000;
    assert!(matches!(refused(&wrong, flat), SetupError::NoSuchCorner { corner: 1000, .. }));
    let mut idle = body.clone();
    let mesh = idle.mesh.as_mut().unwrap();
    mesh.X.push(vector![7.0, 7.0]);
    let corner = mesh.x.len();
    assert!(matches!(refused(&idle, flat), SetupError::LengthMismatch { .. }));
    let mesh = idle.mesh.as_mut().unwrap();
    mesh.x.push(vector![7.0, 7.0]);
    mesh.numbers = None;
    assert_eq!(refused(&idle, flat), SetupError::IdleCorner { corner });
    let ring = Body::annulus(&Annulus { inner: 0.4, outer: 0.6, quarter: true }, 0.25, 2, 1.0);
    let gimp = Settings { shape: Shape::Gimp, ..flat };
    assert_eq!(refused(&ring.unwrap(), gimp), SetupError::NotABox { particle: 0 });
    let filter = Settings { transfer: Transfer::Xpic(0), ..flat };
    assert!(matches!(refused(&body, filter), SetupError::NotPositive { .. }));
    let halved = Settings { integrator: Integrator::Usavg, halve_first_acceleration: true, ..flat };
    assert!(matches!(refused(&body, halved), SetupError::HalvedStart { .. }));
    let mut turned = body.clone();
    turned.mesh.as_mut().unwrap().corners[20..24].reverse();
    let mut odd = body.clone();
    odd.mesh.as_mut().unwrap().ends[3] += 1;
    assert!(matches!(refused(&odd, flat), SetupError::LengthMismatch { .. }));
    let error = refused(&turned, flat);
    let initial =
        SetupError::InitialState(StepError::Inverted { step: 0, time: 0.0, particle: 5, J: -1.0 });
    assert_eq!(error, initial.clone());
    let solid = open_grid::<3>(4);
    let cube = Body::lattice(&solid, 2, 2.0, |_| true);
    let refused = |body: Body<f64, 3>| Simulation::new(solid.clone(), body, SOFT, flat).err();
    assert_eq!(refused(cube.clone()), None);
    assert_eq!(refused(cube.particles.clone().into()), Some(SetupError::NoCorners));
    let mut turned = cube;
    let (lower, upper) = turned.mesh.as_mut().unwrap().corners[40..48].split_at_mut(4);
    lower.swap_with_slice(upper);
    assert_eq!(refused(turned), Some(initial));
}

#[test]
fn a_domain_wider_than_the_grid_can_hold_is_refused() {
    let grid = open_grid::<2>(8);
    for shape in [Shape::Gimp, Shape::Cpdi, Shape::GimpBspline2] {
        let mut body = Body::lattice(&grid, 1, 2.0, |X| X.norm() < 0.1);
        body.particles.F[0] = Matrix2::from_diagonal(&vector![5.0, 1.0]);
        let settings = settings(shape, Integrator::Cd, Transfer::Flip);
        let error = Simulation::new(grid.clone(), body, SOFT, settings).unwrap_err();
        let SetupError::InitialState(StepError::TooLarge {
            particle: 0, axis: 0, half_size, ..
        }) = error
        else {
            panic!("{shape:?}: {error}");
        };
        assert!((half_size - 2.5 * grid.spacing).abs() < 1e-15);
    }
}
