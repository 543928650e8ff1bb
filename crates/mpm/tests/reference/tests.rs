use std::collections::BTreeMap;

use super::*;
use mmsmith_clip::{Clip, Side};

const SHAPES: [Shape; 8] = [
    Shape::Linear,
    Shape::Ugimp,
    Shape::Gimp,
    Shape::Bspline2,
    Shape::Bspline3,
    Shape::GimpBspline2,
    Shape::Cpdi,
    Shape::Cpdi2,
];

/// Different for every number, between -0.5 and 0.5, and far from any regularity.
fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

fn grid<const D: usize>(walls: [[bool; 2]; D]) -> Grid<f64, D> {
    let lower = SVector::from_fn(|a, _| 0.3 * a as f64 - 0.2);
    Grid { lower, spacing: 0.25, cells: [4; D], walls }
}

/// Before the first step, with a lattice that fills the grid and is distorted except on the grid's faces.
fn distorted<const D: usize>(grid: &Grid<f64, D>, shape: Shape, transfer: Transfer) -> Reference<D>
where
    f64: Scalar<D>,
{
    let mut body = Body::lattice(grid, 2, 2.0, |_| true);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.F[k] += SMatrix::from_fn(|i, j| 0.3 * noise(11 * k + 3 * i + j));
        p.x[k] += SVector::from_fn(|a, _| 0.06 * grid.spacing * noise(13 * k + a));
    }
    let (lower, upper) = (grid.lower, grid.upper());
    for (k, x) in body.mesh.iter_mut().flat_map(|mesh| &mut mesh.x).enumerate() {
        for a in 0..D {
            if (x[a] - lower[a]).min(upper[a] - x[a]) > 1e-9 {
                x[a] += 0.1 * grid.spacing * noise(17 * k + a);
            }
        }
    }
    let settings = Settings {
        shape,
        integrator: Integrator::Usl,
        transfer,
        time_step: 1e-3,
        halve_first_acceleration: false,
    };
    let material = Material::NeoHookean { lambda: 30.0, mu: 20.0 };
    let mut scene = Reference::new(grid.clone(), body, material, settings);
    scene.p2g_mass();
    scene
}

#[test]
fn weights_add_up_to_one_and_reproduce_linear_fields() {
    fn check<const D: usize>(shape: Shape)
    where
        f64: Scalar<D>,
    {
        let scene = distorted(&grid([[false; 2]; D]), shape, Transfer::Flip);
        let slope = SMatrix::<f64, D, D>::from_fn(|i, j| 1.0 + noise(5 * i + j));
        for (p, list) in scene.particles.iter().enumerate() {
            assert!((list.iter().map(|entry| entry.S).sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(list.iter().map(|entry| entry.G).sum::<SVector<f64, D>>().norm() < 1e-12);
            let found: SMatrix<f64, D, D> =
                list.iter().map(|entry| slope * entry.x * entry.G.transpose()).sum();
            assert!((found - slope).norm() < 1e-11, "{shape} {found}");
            if shape != Shape::Cpdi2 {
                assert!((centre(list) - scene.particles().x[p]).norm() < 1e-13, "{shape}");
            }
        }
    }
    for shape in SHAPES {
        check::<1>(shape);
        check::<2>(shape);
        check::<3>(shape);
    }
}

/// A field that vanishes across each wall on it: of linear fields walls admit no other. Along axis 1 there are none.
#[test]
fn next_to_walls_the_fields_that_walls_admit_are_reproduced() {
    fn check<const D: usize>(shape: Shape, upper: bool)
    where
        f64: Scalar<D>,
    {
        let mut walls = [[!upper, upper]; D];
        walls.iter_mut().skip(1).take(1).for_each(|walls| *walls = [false; 2]);
        let grid = grid(walls);
        let wall = if upper { grid.upper() } else { grid.lower };
        let scene = distorted(&grid, shape, Transfer::Flip);
        let slopes = SVector::<f64, D>::from_fn(|a, _| if a == 1 { -3.0 } else { 1.0 + a as f64 });
        let shift = SVector::from_fn(|a, _| if a == 1 { 2.0 } else { 0.0 });
        let exact = |x: &SVector<f64, D>| (x - wall).component_mul(&slopes) + shift;
        let mut field = vec![SVector::repeat(f64::NAN); scene.nodes.places().len()];
        for entry in scene.particles.iter().flatten() {
            let image = SVector::from_fn(|a, _| match (a, upper) {
                (1, _) => entry.x[a],
                (_, false) => wall[a] + (entry.x[a] - wall[a]).abs(),
                (_, true) => wall[a] - (entry.x[a] - wall[a]).abs(),
            });
            field[scene.nodes.places()[entry.node].node] = exact(&image);
        }
        let field = scene.nodes.mirrored(&field);
        for list in &scene.particles {
            assert!((g2p(list, &field) - exact(&centre(list))).norm() < 1e-13, "{shape}");
            let error = gradient(list, &field) - SMatrix::from_diagonal(&slopes);
            assert!(error.norm() < 1e-11, "{shape}");
        }
    }
    for shape in SHAPES {
        for upper in [false, true] {
            check::<1>(shape, upper);
            check::<2>(shape, upper);
            check::<3>(shape, upper);
        }
    }
}

#[test]
fn the_mass_at_the_nodes_is_that_of_the_particles() {
    for shape in SHAPES {
        for walls in [[false; 2], [true; 2], [true, false]] {
            let scene = distorted(&grid([walls; 2]), shape, Transfer::Flip);
            let expected: f64 = scene.particles().mass.iter().sum();
            assert!((scene.mass.iter().sum::<f64>() / expected - 1.0).abs() < 1e-13, "{shape}");
        }
    }
}

/// Volume and centroid of a truncated pyramid, are known; and a mean
/// gradient is the volume's derivative by the corner.
#[test]
fn means_over_hexahedra_are_exact() {
    let corner = |x: f64, y: f64, z: f64| SVector::<f64, 3>::new(x, y, z);
    let square = |half: f64, z: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, y)| corner(x, y, z))
    };
    let mut x = [square(1.0, 0.0), square(0.5, 3.0)].concat();
    let (shares, volume) = means(&x);
    assert!((volume - 7.0).abs() < 1e-14);
    let centroid: SVector<f64, 3> = x.iter().zip(&shares).map(|(x, (w, _))| x * *w).sum();
    assert!((centroid - corner(0.0, 0.0, 33.0 / 28.0)).norm() < 1e-14);
    for (k, x) in x.iter_mut().enumerate() {
        *x += SVector::from_fn(|a, _| 0.4 * noise(3 * k + a));
    }
    let (shares, volume) = means(&x);
    for c in 0..8 {
        for a in 0..3 {
            let moved = |by: f64| {
                let mut x = x.clone();
                x[c][a] += by;
                means(&x).1
            };
            // The volume is linear in each coordinate.
            let derivative = 0.5 * (moved(1.0) - moved(-1.0));
            assert!((shares[c].1[a] - derivative / volume).abs() < 1e-14);
        }
    }
}

#[test]
fn an_affine_field_comes_back_whole_through_apic() {
    for shape in SHAPES {
        let scene = distorted(&grid([[false; 2]; 3]), shape, Transfer::Apic);
        let C = SMatrix::<f64, 3, 3>::from_fn(|i, j| noise(4 * i + j));
        let mut field = vec![SVector::zeros(); scene.nodes.places().len()];
        for entry in scene.particles.iter().flatten() {
            field[entry.node] = C * entry.x;
        }
        for found in scene.affine_parts(&field) {
            assert!((found - C).norm() < 1e-10, "{shape}");
        }
    }
}

#[test]
fn a_body_without_stress_keeps_its_uniform_velocity() {
    let velocity = SVector::<f64, 2>::new(0.4, -0.3);
    for shape in SHAPES {
        for transfer in [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(4)] {
            for integrator in [Integrator::Usf, Integrator::Musl, Integrator::Usavg] {
                let grid = grid([[false; 2]; 2]);
                let middle = (grid.lower + grid.upper()) * 0.5;
                let mut body = Body::lattice(&grid, 2, 2.0, |X| (X - middle).norm() < 0.3);
                body.particles.v.fill(velocity);
                let scene = distorted(&grid, shape, transfer);
                let settings = Settings { integrator, ..scene.settings };
                let mut scene = Reference::new(grid, body, scene.material, settings);
                for _ in 0..4 {
                    scene.step(&mmsmith_mpm::NoBodyForce).unwrap();
                }
                let shift = velocity * scene.time();
                let Particles { X, x, v, F, .. } = scene.particles();
                for p in 0..X.len() {
                    assert!(
                        (x[p] - X[p] - shift).norm() < 1e-14,
                        "{shape} {integrator} {transfer}"
                    );
                    assert!((v[p] - velocity).norm() < 1e-12, "{shape} {integrator} {transfer}");
                    assert!((F[p] - SMatrix::identity()).norm() < 1e-13, "{shape} {integrator}");
                }
                if let Some(mesh) = &scene.body().mesh {
                    let moved = mesh.X.iter().zip(&mesh.x).map(|(X, x)| (x - X - shift).norm());
                    assert!(moved.fold(0.0, f64::max) < 1e-14, "{integrator} {transfer}");
                }
            }
        }
    }
}

#[test]
fn an_error_names_the_particle() {
    let mut scene = distorted(&grid([[false; 2]; 2]), Shape::Gimp, Transfer::Flip);
    scene.body.particles.v[5][0] = 1e6;
    let error = scene.step(&mmsmith_mpm::NoBodyForce).unwrap_err();
    assert!(error.starts_with("particle "), "{error}");
}

/// Light nodes of a clipped body continue linear fields: shares sum to 1, and to the light node's place.
#[test]
fn light_nodes_continue_linear_functions() {
    fn check<const D: usize>(radius: f64, cells: usize)
    where
        f64: Scalar<D>,
    {
        let (lower, walls) = (SVector::repeat(-1.5), [[false; 2]; D]);
        let grid = Grid { lower, spacing: 3.0 / cells as f64, cells: [cells; D], walls };
        let clip = Clip { sides: vec![Side::Outer { radius }], turn: [1.0, 0.0], offset: 0.1 };
        let (body, _) =
            mmsmith_clip::body(&grid, 2, 2.0, &clip).expect("a body of more than one dimension");
        let settings = Settings {
            shape: Shape::Cpdi2,
            integrator: Integrator::Cd,
            transfer: Transfer::Flip,
            time_step: 1e-3,
            halve_first_acceleration: false,
        };
        let material = Material::NeoHookean { lambda: 3.0, mu: 2.0 };
        let mut reference = Reference::new(grid, body, material, settings);
        reference.p2g_mass();
        assert!(reference.light() > 3, "{}", reference.light());
        let entries = reference.particles.iter().flatten();
        let places: BTreeMap<usize, SVector<f64, D>> =
            entries.map(|entry| (entry.node, entry.x)).collect();
        for (node, inner) in &reference.light {
            let sum: f64 = inner.iter().map(|(_, share)| share).sum();
            let mean: SVector<f64, D> =
                inner.iter().map(|(node, share)| places[node] * *share).sum();
            assert!((sum - 1.0).abs() < 1e-14, "{sum}");
            assert!((mean - places[node]).norm() < 1e-14, "{mean:?} {:?}", places[node]);
        }
    }
    check::<2>(1.02, 12);
    check::<3>(1.03, 8);
}
