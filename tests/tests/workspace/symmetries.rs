//! Symmetries: the mirror image of a problem, its quarter turn, and its particles in another order have the same results but for rounding.
//!
//! Sums over nodes and over particles have another order then, so that bits differ. The bounds below are in units of rounding of the
//! largest value of each quantity, a few times what was measured.

#![allow(clippy::unwrap_used)]

use std::collections::HashMap;

use mmsmith_interpret::interpret;
use mmsmith_mpm::{
    Body, Grid, Integrator, Material, Mesh, NoBodyForce, Particles, Settings, Shape, Simulation,
    Transfer,
};
use mmsmith_spec::Spec;
use mmsmith_verify::{
    Arithmetic, Case, Coordinates, Extent, GridPose, Layout, Outputs, PerField, PerNorm, Placement,
    Scheme, Total, Updated, run,
};
use nalgebra::{SMatrix, SVector};

/// Steps of a simulation.
const STEPS: usize = 12;

/// The most by which particles of a problem and of its image differ after these steps, in units of rounding.
const MOST: f64 = 200.0;

/// An image: coordinate `a` of it is the coordinate `from[a]` of the problem, reversed where `reversed[a]`.
#[derive(Clone, Copy, Debug)]
struct Image<const D: usize> {
    from: [usize; D],
    reversed: [bool; D],
}

impl<const D: usize> Image<D> {
    fn sign(&self, a: usize) -> f64 {
        if self.reversed[a] { -1.0 } else { 1.0 }
    }

    fn vector(&self, v: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|a, _| self.sign(a) * v[self.from[a]])
    }

    /// The image of a place in a box with one corner at the origin.
    fn place(&self, X: &SVector<f64, D>, size: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|a, _| {
            let from = self.from[a];
            if self.reversed[a] { size[from] - X[from] } else { X[from] }
        })
    }

    fn matrix(&self, F: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|a, b| self.sign(a) * self.sign(b) * F[(self.from[a], self.from[b])])
    }

    /// The place in the problem of one in the image.
    fn back(&self, X: &SVector<f64, D>, size: &SVector<f64, D>) -> SVector<f64, D> {
        let mut found = SVector::zeros();
        for a in 0..D {
            let from = self.from[a];
            found[from] = if self.reversed[a] { size[from] - X[a] } else { X[a] };
        }
        found
    }
}

/// A body without symmetries, free on some sides, in motion: numbers of the cells are not the same along the axes.
struct Scene<const D: usize> {
    cells: [usize; D],
}

/// A power of two, so that lattices and their images have no rounding.
const SPACING: f64 = 0.125;

impl<const D: usize> Scene<D> {
    fn size(&self) -> SVector<f64, D> {
        SVector::from_fn(|a, _| self.cells[a] as f64 * SPACING)
    }

    /// Walls at the lower ends, but for the last axis.
    fn walls(&self) -> [[bool; 2]; D] {
        std::array::from_fn(|a| [a + 1 < D, false])
    }

    fn is_inside(&self, X: &SVector<f64, D>) -> bool {
        let size = self.size();
        let away = (0..D).all(|a| X[a] < size[a] - 2.0 * SPACING);
        let above = X[D - 1] > 2.0 * SPACING;
        // A corner is cut off.
        away && above && X.iter().sum::<f64>() < 0.7 * size.iter().sum::<f64>()
    }

    fn velocity(&self, X: &SVector<f64, D>) -> SVector<f64, D> {
        SVector::from_fn(|a, _| {
            let next = X[(a + 1) % D];
            12.0 * (3.1 * X[a]).sin() * (2.3 * next + a as f64).cos()
        })
    }

    /// Particles after some steps, of the image, with numbers in the order that `order` gives.
    fn simulate(
        &self,
        image: &Image<D>,
        (shape, transfer, integrator): (Shape, Transfer, Integrator),
        order: fn(usize, usize) -> usize,
    ) -> Particles<f64, D>
    where
        f64: mmsmith_mpm::Scalar<D>,
    {
        let size = self.size();
        let walls = self.walls();
        let grid = Grid {
            lower: SVector::zeros(),
            spacing: SPACING,
            cells: image.from.map(|from| self.cells[from]),
            walls: std::array::from_fn(|a| {
                let [low, high] = walls[image.from[a]];
                if image.reversed[a] { [high, low] } else { [low, high] }
            }),
        };
        let mut body = Body::lattice(&grid, 2, 1.5, |X| self.is_inside(&image.back(X, &size)));
        let Particles { X, v, .. } = &mut body.particles;
        for (v, X) in v.iter_mut().zip(&*X) {
            *v = image.vector(&self.velocity(&image.back(X, &size)));
        }
        let body = renumbered(body, order);
        let settings = Settings {
            shape,
            integrator,
            transfer,
            time_step: 2e-4,
            halve_first_acceleration: false,
        };
        let material = Material::NeoHookean { lambda: 5769.0, mu: 3846.0 };
        let mut simulation = Simulation::new(grid, body, material, settings).unwrap();
        (0..STEPS).for_each(|_| simulation.step(&NoBodyForce).unwrap());
        simulation.particles().clone()
    }
}

/// The body with particle `order(n, count)` of it as number `n`.
fn renumbered<const D: usize>(
    body: Body<f64, D>,
    order: fn(usize, usize) -> usize,
) -> Body<f64, D> {
    let count = body.particles.len();
    let places: Vec<usize> = (0..count).map(|n| order(n, count)).collect();
    fn taken<V: Copy>(values: &mut Vec<V>, places: &[usize]) {
        *values = places.iter().map(|&p| values[p]).collect();
    }
    let Body { mut particles, half_edges, mesh, .. } = body;
    let Particles { X, x, v, F, mass, volume, .. } = &mut particles;
    taken(X, &places);
    taken(x, &places);
    taken(v, &places);
    taken(F, &places);
    taken(mass, &places);
    taken(volume, &places);
    let mesh = mesh.map(|mesh| {
        let of = |p: usize| mesh.corners[p << D..(p + 1) << D].iter().copied();
        Mesh::cells(mesh.X.clone(), places.iter().flat_map(|&p| of(p)).collect())
    });
    Body { half_edges, mesh, ..particles.into() }
}

/// The largest difference between particles of the image and images of the particles, in units of rounding of the largest values.
fn apart<const D: usize>(
    scene: &Scene<D>,
    image: &Image<D>,
    own: &Particles<f64, D>,
    others: &Particles<f64, D>,
) -> f64 {
    let size = scene.size();
    let key = |X: &SVector<f64, D>| -> Vec<i64> {
        X.iter().map(|x| (x / (0.25 * SPACING)).round() as i64).collect()
    };
    let by_place: HashMap<_, _> = others.X.iter().enumerate().map(|(p, X)| (key(X), p)).collect();
    assert_eq!(by_place.len(), own.len());
    let largest = |values: &[SVector<f64, D>]| values.iter().fold(0.0_f64, |m, v| m.max(v.amax()));
    let (of_v, of_x) = (largest(&own.v), size.amax());
    let mut most = 0.0_f64;
    for p in 0..own.len() {
        let q = by_place[&key(&image.place(&own.X[p], &size))];
        let x = (image.place(&own.x[p], &size) - others.x[q]).amax() / of_x;
        let v = (image.vector(&own.v[p]) - others.v[q]).amax() / of_v;
        let F = (image.matrix(&own.F[p]) - others.F[q]).amax();
        most = most.max(x).max(v).max(F);
    }
    most / f64::EPSILON
}

fn as_they_are(n: usize, _: usize) -> usize {
    n
}

fn backwards(n: usize, count: usize) -> usize {
    count - 1 - n
}

/// Every shape function with every transfer; integrators take turns.
fn check<const D: usize>(scene: &Scene<D>, images: &[Image<D>]) -> f64
where
    f64: mmsmith_mpm::Scalar<D>,
{
    let same = Image { from: std::array::from_fn(|a| a), reversed: [false; D] };
    let transfers = [Transfer::Flip, Transfer::Pic, Transfer::Apic, Transfer::Xpic(3)];
    let mut most = 0.0_f64;
    for (i, shape) in Shape::ALL.into_iter().enumerate() {
        for (j, transfer) in transfers.into_iter().enumerate() {
            let integrator = Integrator::ALL[(i + 2 * j) % Integrator::ALL.len()];
            let scheme = (shape, transfer, integrator);
            let own = scene.simulate(&same, scheme, as_they_are);
            let turned = images.iter().map(|image| (*image, as_they_are as fn(_, _) -> _));
            for (image, order) in turned.chain([(same, backwards as fn(_, _) -> _)]) {
                let found = apart(scene, &image, &own, &scene.simulate(&image, scheme, order));
                assert!(found <= MOST, "{scheme:?}, {image:?}: {found:.0} units of rounding");
                most = most.max(found);
            }
        }
    }
    most
}

#[test]
fn images_and_other_orders_of_particles_differ_by_rounding_alone() {
    let line = Scene { cells: [11] };
    let plane = Scene { cells: [9, 11] };
    let space = Scene { cells: [6, 7, 8] };
    let reversed = [Image { from: [0], reversed: [true] }];
    let of_plane = [
        Image { from: [0, 1], reversed: [true, false] },
        Image { from: [1, 0], reversed: [true, false] },
        Image { from: [0, 1], reversed: [true, true] },
    ];
    let of_space = [
        Image { from: [0, 1, 2], reversed: [false, true, false] },
        Image { from: [1, 0, 2], reversed: [true, false, false] },
        Image { from: [2, 1, 0], reversed: [false, false, true] },
    ];
    let found = [check(&line, &reversed), check(&plane, &of_plane), check(&space, &of_space)];
    // Rounding is seen: a comparison of a run with itself would have none.
    assert!(found.iter().all(|most| *most > 0.0), "{found:?}");
}

/// The most by which errors of a run and of its image differ, in units of rounding of the largest value.
const MOST_OF_ERRORS: f64 = 25.0;

/// The errors of a plane problem.
fn errors(text: &str, case: &Case) -> PerField<PerNorm<f64>> {
    let exact = interpret(&Spec::parse(text, "image.toml").unwrap(), []).unwrap();
    let mut progress = |_| ();
    run(&exact, Arithmetic::Double, case, &mut Outputs::new(&mut progress)).unwrap().errors
}

fn assert_same(told: &str, one: &PerField<PerNorm<f64>>, other: &PerField<PerNorm<f64>>) {
    // The largest displacement, velocity, gradient and stress of these problems.
    let sizes = [1.0, 10.0, 1.0, 1e4];
    for (((field, a), (_, b)), size) in one.iter().zip(other.iter()).zip(sizes) {
        for ((norm, a), (_, b)) in a.iter().zip(b.iter()) {
            let units = (a - b).abs() / (size * f64::EPSILON);
            assert!(units <= MOST_OF_ERRORS, "{told}: {norm:?} of {field}: {a:e} {b:e}");
        }
    }
}

/// A square that moves without symmetry, between walls or under the tractions of the motion, as it is or as one of its images.
fn square(condition: &str, image: &str) -> String {
    // Of the problem in the coordinates of the image; which displacement of it is the first and the second one, and their signs.
    let (X, Y, first, second) = match image {
        "same" => ("X", "Y", "f", "g"),
        "mirror" => ("(1 - X)", "Y", "-f", "g"),
        // (x, y) is (1 - Y, X): a quarter turn about the middle.
        _ => ("Y", "(1 - X)", "-g", "f"),
    };
    let f = format!("A*sin(Pi*{X})*(cos(Pi*{Y}) + cos(2*Pi*{Y})/3)*sin(Pi*c*t)");
    let g = format!("A*(cos(Pi*{X}) - cos(2*Pi*{X})/4)*sin(Pi*{Y})*sin(Pi*c*t)");
    let of = |name: &str| match name {
        "f" => f.clone(),
        "g" => g.clone(),
        "-f" => format!("-{f}"),
        _ => format!("-{g}"),
    };
    let boundary: String = ["X-lower", "X-upper", "Y-lower", "Y-upper"]
        .map(|side| format!("[[boundary]]\nsurface = '{side}'\ncondition = '{condition}'\n"))
        .concat();
    format!(
        "name = 'image'\ntitle = 'Image'\ncoordinates = 'cartesian'\ndimension = 2\n[parameters]\nA = {{ default = 0.03 }}\n\
         E = {{ default = 1e4 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 4 }}\n[let]\nc = 'sqrt(E/rho0)'\n[displacement]\n\
         X = '{}'\nY = '{}'\n[material]\nlaw = 'neo-hookean'\n[domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n{boundary}[time]\n\
         period = '2/c'\nwave-speed = 'c'\n",
        of(first),
        of(second)
    )
}

#[test]
fn errors_of_images_are_the_same_but_for_rounding_in_every_layout_and_formulation() {
    let clipped = |shape, angle| {
        let placement = Placement::Clipped { offset: 0.0, pose: GridPose { angle, shift: 0.0 } };
        Scheme::Updated(Updated { shape, placement, ..Updated::default() })
    };
    let total = |layout| {
        let coordinates = Coordinates::Cartesian;
        Scheme::Total(Total { layout, coordinates, ..Total::of_degree(3) })
    };
    let lattice = Scheme::Updated(Updated::default());
    for (condition, scheme) in [
        ("sliding", lattice),
        ("prescribed-traction", clipped(Shape::Bspline2, 0.0)),
        ("prescribed-traction", clipped(Shape::Cpdi2, 0.0)),
        ("prescribed-motion", total(Layout::Gauss)),
        ("prescribed-traction", total(Layout::Gauss)),
    ] {
        let case = Case { scheme, cells: 8, periods: 0.1, cfl: 0.2, ..Case::default() };
        let case = match scheme {
            Scheme::Total(_) => Case { per_cell: 4, cfl: 0.1, ..case },
            Scheme::Updated(_) => case,
        };
        let own = errors(&square(condition, "same"), &case);
        for image in ["mirror", "turn"] {
            let found = errors(&square(condition, image), &case);
            assert_same(&format!("{image}, {condition}, {scheme:?}"), &own, &found);
        }
    }
    // A whole ring is its own quarter turn, so that a grid turned by one gives the same errors.
    let ring = std::fs::read_to_string(mmsmith_tests::workspace().join("mms-specs/ring.toml"));
    let of_angle = |angle| {
        let scheme = clipped(Shape::Bspline2, angle);
        let case = Case { scheme, cells: 8, periods: 0.1, ..Case::default() };
        errors(ring.as_ref().unwrap(), &Case { extent: Some(Extent::Full), ..case })
    };
    let own = of_angle(0.0);
    for angle in [90.0, 180.0, 270.0] {
        assert_same(&format!("ring at {angle}"), &own, &of_angle(angle));
    }
}
