//! Properties of all weights, and of all transfers.

use std::collections::BTreeMap;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};
use proptest::prelude::*;

use super::domain::{extent, of_parallelogram, of_polygon};
use super::nodes::{Field, Nodes, centre, g2p, g2p_gradient};
use super::simulation::{affine_part, list};
use super::stencil::{Entry, Raster, Stencils};
use super::*;
use crate::grid::{Grid, Layout};
use crate::tensor::determinant;

const SHAPES: [Shape; 7] = [
    Shape::Linear,
    Shape::Ugimp,
    Shape::Gimp,
    Shape::Bspline2,
    Shape::Bspline3,
    Shape::Cpdi,
    Shape::Cpdi2,
];

fn grid<const D: usize>(cells: usize, wall: bool) -> Grid<f64, D> {
    let lower = SVector::from_fn(|a, _| 0.3 * a as f64 - 0.2);
    Grid { lower, spacing: 0.25, cells: [cells; D], walls: [[wall; 2]; D] }
}

/// Different for every number, between -0.5 and 0.5, and far from any regularity.
fn noise(seed: usize) -> f64 {
    (seed as f64 * 12.9898).sin() * 0.5
}

/// A lattice that fills the grid, distorted by `size` except on the grid's faces.
fn distorted<const D: usize>(grid: &Grid<f64, D>, size: f64) -> Body<D> {
    let mut body = Body::lattice(grid, 2, 2.0, |_| true);
    let p = &mut body.particles;
    for k in 0..p.len() {
        p.v[k] = SVector::from_fn(|a, _| noise(7 * k + a));
        p.F[k] += SMatrix::from_fn(|i, j| size * noise(11 * k + 3 * i + j));
        p.x[k] += SVector::from_fn(|a, _| 0.2 * size * grid.spacing * noise(13 * k + a));
    }
    if let Some(mesh) = &mut body.mesh {
        let upper = grid.upper();
        for k in 0..mesh.x.len() {
            for a in 0..D {
                let (lower, upper) = (grid.lower[a], upper[a]);
                let inside = (mesh.X[k][a] - lower).abs().min((mesh.X[k][a] - upper).abs()) > 1e-9;
                if inside {
                    mesh.x[k][a] += 0.4 * size * grid.spacing * noise(17 * k + a);
                }
            }
        }
    }
    body
}

struct Scene<const D: usize> {
    raster: Raster<D>,
    nodes: Nodes<D>,
    stencils: Stencils<D>,
    body: Body<D>,
}

fn scene<const D: usize>(grid: &Grid<f64, D>, body: Body<D>, shape: Shape) -> Scene<D> {
    let layout = Layout::new(grid, 8).unwrap();
    let raster = Raster::new(grid, &layout);
    let (mut stencils, mut corners) = (Stencils::default(), Stencils::default());
    list(shape, &raster, &body, &mut stencils, &mut corners);
    let mut nodes = Nodes::new(layout, 1e-30);
    nodes.p2g_mass(&stencils, &body.particles.mass);
    Scene { raster, nodes, stencils, body }
}

/// Weights and gradients by node, of any size.
fn merged<const D: usize>(entries: &[Entry<D>]) -> BTreeMap<usize, (f64, SVector<f64, D>)> {
    let mut nodes = BTreeMap::new();
    for entry in entries {
        let sum = nodes.entry(entry.node).or_insert((0.0, SVector::zeros()));
        sum.0 += entry.S;
        sum.1 += entry.G;
    }
    nodes
}

/// In one, two and three dimensions, for all shapes that there are there.
fn for_all(check: impl Fn(Shape)) {
    SHAPES.into_iter().for_each(check);
}

#[test]
fn weights_add_up_to_one_and_reproduce_linear_fields_in_every_cell() {
    fn check<const D: usize>(shape: Shape) {
        if D == 3 && shape == Shape::Cpdi2 {
            return;
        }
        let grid = grid::<D>(5, false);
        let Scene { raster, stencils, body, .. } = scene(&grid, distorted(&grid, 0.3), shape);
        let slope = SMatrix::<f64, D, D>::from_fn(|i, j| 1.0 + noise(5 * i + j));
        for (p, x) in body.particles.x.iter().enumerate() {
            let entries = stencils.of(p);
            let sum: f64 = entries.iter().map(|entry| entry.S).sum();
            assert!((sum - 1.0).abs() < 1e-14, "{shape:?}");
            assert!(entries.iter().map(|entry| entry.G).sum::<SVector<_, D>>().norm() < 1e-12);
            let (mut level, mut found) = (SVector::<f64, D>::zeros(), SMatrix::zeros());
            for entry in entries {
                let v = slope * raster.node(entry.node);
                level += v * entry.S;
                found += v * entry.G.transpose();
            }
            assert!((found - slope).norm() < 1e-11, "{shape:?} {found}");
            let place = match (shape, &body.mesh) {
                // The exact centroid of the quadrilateral, from two triangles.
                (Shape::Cpdi2, Some(mesh)) if D == 2 => {
                    let [a, b, c, d] = mesh.corners[p].map(|k| mesh.x[k]);
                    let part = |b: SVector<f64, D>, c: SVector<f64, D>| {
                        let (e, f) = (b - a, c - a);
                        (e[0] * f[1] - e[1] * f[0], (a + b + c) / 3.0)
                    };
                    let ((left, x), (right, y)) = (part(b, c), part(c, d));
                    (x * left + y * right) / (left + right)
                }
                (Shape::Cpdi2, Some(mesh)) => {
                    (mesh.x[mesh.corners[p][0]] + mesh.x[mesh.corners[p][1]]) * 0.5
                }
                _ => *x,
            };
            assert!((level - slope * place).norm() < 1e-13, "{shape:?}");
        }
    }
    for_all(|shape| {
        check::<1>(shape);
        check::<2>(shape);
        check::<3>(shape);
    });
}

/// Between walls: a field that vanishes across each wall on it, and one along them; no other linear one is admissible.
#[test]
fn next_to_walls_the_fields_that_walls_admit_are_reproduced() {
    fn check<const D: usize>(shape: Shape) {
        if D == 3 && shape == Shape::Cpdi2 {
            return;
        }
        for upper in [false, true] {
            let mut grid = grid::<D>(5, false);
            grid.walls = [[!upper, upper]; D];
            // Axis 1 has no walls: its component may be anything along itself.
            if D > 1 {
                grid.walls[1] = [false; 2];
            }
            let wall = if upper { grid.upper() } else { grid.lower };
            let scene = scene(&grid, distorted(&grid, 0.3), shape);
            let Scene { raster, nodes, stencils, body } = &scene;
            let mut field: Field<D> = vec![SVector::zeros(); nodes.len()];
            let exact = |x: &SVector<f64, D>| {
                let r = x - wall;
                SVector::<f64, D>::from_fn(|a, _| match a {
                    1 => 2.0 - 3.0 * r[1],
                    _ => r[a] * (1.0 + a as f64),
                })
            };
            for (index, v) in field.iter_mut().enumerate() {
                let x = raster.node(index);
                let side = if upper { x - wall } else { wall - x };
                let beyond = (0..D).any(|a| a != 1 && side[a] > 1e-9);
                *v = if beyond { SVector::repeat(f64::NAN) } else { exact(&x) };
            }
            nodes.mirror(&mut field);
            for p in 0..body.particles.len() {
                let entries = stencils.of(p);
                let place = centre(raster, entries);
                assert!((g2p(entries, &field) - exact(&place)).norm() < 1e-13, "{shape:?}");
                let slope = SMatrix::<f64, D, D>::from_fn(|i, j| match (i, j) {
                    (1, 1) => -3.0,
                    (i, j) if i == j => 1.0 + i as f64,
                    _ => 0.0,
                });
                assert!((g2p_gradient(entries, &field) - slope).norm() < 1e-11, "{shape:?}");
            }
        }
    }
    for_all(|shape| {
        check::<1>(shape);
        check::<2>(shape);
        check::<3>(shape);
    });
}

#[test]
fn the_mass_at_the_nodes_is_that_of_the_particles() {
    fn check<const D: usize>(shape: Shape) {
        if D == 3 && shape == Shape::Cpdi2 {
            return;
        }
        for wall in [false, true] {
            let grid = grid::<D>(4, wall);
            let Scene { raster, nodes, body, .. } = scene(&grid, distorted(&grid, 0.3), shape);
            let outside = |k: usize| raster.axis_outside(&raster.node(k)).is_some();
            let found: f64 = (0..nodes.len())
                .filter(|&k| !wall || !outside(k))
                .filter_map(|k| nodes.mass(k))
                .sum();
            let expected: f64 = body.particles.mass.iter().sum();
            assert!((found - expected).abs() < 1e-13 * expected, "{shape:?} {found} {expected}");
        }
    }
    for_all(|shape| {
        check::<1>(shape);
        check::<2>(shape);
        check::<3>(shape);
    });
}

#[test]
fn gradients_of_point_weights_are_derivatives() {
    let grid = grid::<2>(6, false);
    let raster = Raster::new(&grid, &Layout::new(&grid, 8).unwrap());
    let weights = |shape: Shape, x: Vector2<f64>| {
        let mut nodes = BTreeMap::new();
        raster.list(shape, &x, &Vector2::repeat(0.06), &Vector2::repeat(1.0), |entry| {
            nodes.insert(entry.node, (entry.S, entry.G));
        });
        nodes
    };
    for shape in [Shape::Ugimp, Shape::Gimp, Shape::Bspline2, Shape::Bspline3] {
        for k in 0..50 {
            let x = vector![0.55 + 0.9 * noise(k), 0.85 + 0.9 * noise(k + 100)];
            for a in 0..2 {
                let step = Vector2::from_fn(|i, _| if i == a { 1e-6 } else { 0.0 });
                let (below, above) = (weights(shape, x - step), weights(shape, x + step));
                for (node, (_, G)) in weights(shape, x) {
                    let at =
                        |nodes: &BTreeMap<usize, (f64, _)>| nodes.get(&node).map_or(0.0, |n| n.0);
                    let slope = (at(&above) - at(&below)) / 2e-6;
                    assert!((slope - G[a]).abs() < 2e-4, "{shape:?} {slope} {}", G[a]);
                }
            }
        }
    }
}

/// A box that no grid line crosses has the weights of its centre by `cpdi`, as the exact mean of the hat functions over it;
/// and a box that one does cross those of its corners, whose mean is known too.
#[test]
fn weights_of_unrotated_boxes_are_the_known_ones() {
    let grid =
        Grid { lower: vector![0.0, 0.0], spacing: 1.0, cells: [4, 4], walls: [[false; 2]; 2] };
    let mut body = Body::lattice(&grid, 1, 1.0, |X| X[0] == 1.5 && X[1] == 1.5);
    body.half_edges = vec![Matrix2::from_diagonal(&vector![0.2, 0.25])];
    for (x, crossed) in [(vector![1.3, 1.6], false), (vector![1.9, 1.6], true)] {
        body.particles.x = vec![x];
        let of = |shape| merged(scene(&grid, body.clone(), shape).stencils.of(0));
        let (cpdi, gimp, hats) = (of(Shape::Cpdi), of(Shape::Ugimp), of(Shape::Linear));
        for (node, (S, G)) in &cpdi {
            if crossed {
                continue;
            }
            let (S1, G1) = gimp.get(node).copied().unwrap_or((0.0, Vector2::zeros()));
            let (S2, G2) = hats.get(node).copied().unwrap_or((0.0, Vector2::zeros()));
            assert!((S - S1).abs() < 1e-15 && (G - G1).norm() < 1e-14);
            assert!((S - S2).abs() < 1e-15 && (G - G2).norm() < 1e-14);
        }
        if crossed {
            // Along x the corners are at 1.7 and 2.1: nodes 1, 2, 3 have the means of (0.3, 0), (0.7, 0.9), (0, 0.1).
            let along_y = [0.4, 0.6];
            let found: Vec<f64> = cpdi.values().map(|n| n.0).filter(|S| *S > 1e-15).collect();
            let expected: Vec<f64> =
                along_y.iter().flat_map(|y| [0.15, 0.8, 0.05].map(|x| x * y)).collect();
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        }
    }
}

#[test]
fn boxes_have_the_same_weights_by_their_edges_and_by_their_corners() {
    let grid = grid::<2>(5, false);
    let mut body = Body::lattice(&grid, 2, 1.0, |_| true);
    // A homogeneous deformation, with rotation and shear.
    let F = Matrix2::new(0.8, 0.25, -0.3, 0.7);
    let centre = (grid.lower + grid.upper()) * 0.5;
    let moved = |X: &Vector2<f64>| centre + F * (X - centre);
    body.particles.F.fill(F);
    body.particles.x = body.particles.X.iter().map(moved).collect();
    let mesh = body.mesh.as_mut().unwrap();
    mesh.x = mesh.X.iter().map(moved).collect();
    let [one, two] = [Shape::Cpdi, Shape::Cpdi2].map(|shape| scene(&grid, body.clone(), shape));
    for p in 0..body.particles.len() {
        let (one, two) = (merged(one.stencils.of(p)), merged(two.stencils.of(p)));
        assert_eq!(one.len(), two.len());
        for ((i, (S1, G1)), (j, (S2, G2))) in one.iter().zip(&two) {
            assert!(i == j && (S1 - S2).abs() < 1e-14 && (G1 - G2).norm() < 1e-12);
        }
    }
}

fn point() -> impl Strategy<Value = Vector2<f64>> {
    (-0.2..0.2_f64, -0.2..0.2_f64).prop_map(|(x, y)| vector![x, y])
}

/// A convex quadrilateral near the unit square.
fn quadrilateral() -> impl Strategy<Value = [Vector2<f64>; 4]> {
    (point(), point(), point(), point()).prop_map(|(a, b, c, d)| {
        [a, b + vector![1.0, 0.0], c + vector![1.0, 1.0], d + vector![0.0, 1.0]]
    })
}

proptest! {
    /// Against Gauss points on the bilinear map, which are exact for these integrands.
    #[test]
    fn means_over_quadrilaterals_are_exact(x in quadrilateral()) {
        let (corners, area) = of_polygon(&x);
        let s = 1.0 / 3.0_f64.sqrt();
        let (mut total, mut w, mut g) = (0.0, [0.0; 4], [Vector2::zeros(); 4]);
        for (xi, eta) in [(-s, -s), (s, -s), (s, s), (-s, s)] {
            let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let N = signs.map(|(a, b)| 0.25 * (1.0 + a * xi) * (1.0 + b * eta));
            let dN = signs.map(|(a, b)| vector![0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi)]);
            let map: Matrix2<f64> = (0..4).map(|c| x[c] * dN[c].transpose()).sum();
            let J = map.determinant();
            let inverse_transpose = map.try_inverse().unwrap().transpose();
            total += J;
            for c in 0..4 {
                w[c] += N[c] * J;
                g[c] += inverse_transpose * dN[c] * J;
            }
        }
        prop_assert!((total - area).abs() < 1e-14);
        for c in 0..4 {
            prop_assert!((corners[c].w - w[c] / total).abs() < 1e-14);
            prop_assert!((corners[c].g - g[c] / total).norm() < 1e-13);
        }
    }

    /// Shares of means do not change when the domain turns, and shares of gradients turn with it.
    #[test]
    fn domains_turn_rigidly(x in quadrilateral(), angle in -3.2..3.2_f64) {
        let Q = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
        let (still, _) = of_polygon(&x);
        let (turned, _) = of_polygon(&x.map(|x| Q * x));
        let E = Matrix2::from_columns(&[x[1] - x[0], x[3] - x[0]]);
        for c in 0..4 {
            prop_assert!((turned[c].w - still[c].w).abs() < 1e-14);
            prop_assert!((turned[c].g - Q * still[c].g).norm() < 1e-13);
            let (still, turned) = (of_parallelogram(&x[0], &E, c), of_parallelogram(&(Q * x[0]), &(Q * E), c));
            prop_assert!((turned.x - Q * still.x).norm() < 1e-14);
            prop_assert!((turned.g - Q * still.g).norm() < 1e-13);
            let reach = (still.x - x[0]).abs() - extent(&E);
            prop_assert!(reach[0] < 1e-15 && reach[1] < 1e-15);
        }
    }
}

#[test]
fn the_inertia_of_splines_is_that_of_their_kernels() {
    let grid = grid::<2>(6, false);
    let h = grid.spacing;
    for (shape, expected) in [(Shape::Bspline2, h * h / 4.0), (Shape::Bspline3, h * h / 3.0)] {
        let Scene { raster, stencils, body, .. } = scene(&grid, distorted(&grid, 0.3), shape);
        for p in 0..body.particles.len() {
            let entries = stencils.of(p);
            let middle = centre(&raster, entries);
            let inertia: Matrix2<f64> = entries
                .iter()
                .map(|e| {
                    let arm = raster.node(e.node) - middle;
                    arm * arm.transpose() * e.S
                })
                .sum();
            assert!((inertia - Matrix2::identity() * expected).norm() < 1e-14, "{shape:?}");
        }
    }
}

/// Linear and angular momentum of particles with affine velocities come to the grid and back whole.
#[test]
fn apic_conserves_linear_and_angular_momentum() {
    let grid = grid::<2>(8, false);
    for shape in SHAPES.into_iter().filter(|shape| *shape != Shape::Linear) {
        let mut body = distorted(&grid, 0.3);
        let C: Vec<Matrix2<f64>> = (0..body.particles.len())
            .map(|p| Matrix2::from_fn(|i, j| 3.0 * noise(3 * p + 2 * i + j)))
            .collect();
        body.particles.v.iter_mut().for_each(|v| *v *= 2.0);
        let Scene { raster, nodes, stencils, body } = scene(&grid, body, shape);
        let p = &body.particles;
        let mut field: Field<2> = vec![Vector2::zeros(); nodes.len()];
        nodes.p2g_velocity(&raster, &stencils, &p.mass, &p.v, &C, &mut field);
        let on_grid = |field: &Field<2>| {
            let (mut linear, mut angular) = (Vector2::zeros(), 0.0);
            for (k, v) in field.iter().enumerate() {
                let Some(m) = nodes.mass(k) else { continue };
                linear += v * m;
                angular += m * raster.node(k).perp(v);
            }
            (linear, angular)
        };
        let of_particles = |v: &[Vector2<f64>], C: &[Matrix2<f64>]| {
            let (mut linear, mut angular) = (Vector2::zeros(), 0.0);
            for k in 0..p.len() {
                let entries = stencils.of(k);
                let middle = centre(&raster, entries);
                linear += v[k] * p.mass[k];
                angular += p.mass[k] * middle.perp(&v[k]);
                for e in entries {
                    let arm = raster.node(e.node) - middle;
                    angular += p.mass[k] * e.S * arm.perp(&(C[k] * arm));
                }
            }
            (linear, angular)
        };
        let (linear, angular) = of_particles(&p.v, &C);
        let (linear_there, angular_there) = on_grid(&field);
        assert!((linear - linear_there).norm() < 1e-12, "{shape:?}");
        assert!((angular - angular_there).abs() < 1e-12, "{shape:?} {angular} {angular_there}");
        let back: Vec<_> = (0..p.len()).map(|k| g2p(stencils.of(k), &field)).collect();
        let parts: Vec<_> =
            (0..p.len()).map(|k| affine_part(shape, &raster, stencils.of(k), &field)).collect();
        let (linear_back, angular_back) = of_particles(&back, &parts);
        assert!((linear - linear_back).norm() < 1e-12, "{shape:?}");
        assert!((angular - angular_back).abs() < 1e-12, "{shape:?} {angular} {angular_back}");
    }
}

#[test]
fn an_affine_field_comes_back_whole_through_apic() {
    let grid = grid::<3>(5, false);
    for shape in SHAPES.into_iter().filter(|shape| *shape != Shape::Cpdi2) {
        let Scene { raster, stencils, body, nodes } = scene(&grid, distorted(&grid, 0.2), shape);
        let C = SMatrix::<f64, 3, 3>::from_fn(|i, j| noise(4 * i + j));
        let field: Field<3> = (0..nodes.len()).map(|k| C * raster.node(k)).collect();
        for p in 0..body.particles.len() {
            let found = affine_part(shape, &raster, stencils.of(p), &field);
            assert!((found - C).norm() < 1e-10, "{shape:?}");
        }
        assert!(body.particles.F.iter().all(|F| determinant(F) > 0.0));
    }
}
