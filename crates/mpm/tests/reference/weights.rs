//! Nodes and walls, and the weights of particles at nodes.

use nalgebra::{Matrix3, SMatrix, SVector};

use super::Field;
use super::polygons::{Corner, corners, polygons};
use mmsmith_mpm::{Body, Grid, Mesh, Shape};

/// Layers of nodes beyond each face: boxes and domains reach two cells out of the grid, splines and hats from there on two more.
const PAD: isize = 5;
/// The smallest half-size of a box, in cells: a quarter turn makes `F_aa` zero.
const SMALLEST: f64 = 1e-6;

/// The nodes of a grid, those beyond its faces too.
#[derive(Clone, Debug)]
pub(super) struct Nodes<const D: usize> {
    grid: Grid<f64, D>,
    /// Where each node counts.
    places: Vec<Place<D>>,
}

/// Beyond a wall nodes are mirror images: `node` is the image within the walls, and `signs` has -1 for the components that an
/// odd number of reflections turns. On a wall itself the normal component is cleared by a zero.
#[derive(Clone, Debug)]
pub(super) struct Place<const D: usize> {
    pub(super) node: usize,
    pub(super) signs: SVector<f64, D>,
}

/// A node of a particle: its number and position, and the particle's weight and gradient of the weight there.
#[derive(Clone, Debug)]
pub(super) struct Entry<const D: usize> {
    pub(super) node: usize,
    pub(super) x: SVector<f64, D>,
    pub(super) S: f64,
    pub(super) G: SVector<f64, D>,
}

/// All nodes of a particle. A node may occur more than once.
pub(super) type List<const D: usize> = Vec<Entry<D>>;

impl<const D: usize> Nodes<D> {
    pub(super) fn new(grid: &Grid<f64, D>) -> Self {
        let mut nodes = Self { grid: grid.clone(), places: Vec::new() };
        let count = (0..D).map(|a| nodes.layers(a)).product();
        for index in 0..count {
            let mut place = Place { node: 0, signs: SVector::zeros() };
            for a in 0..D {
                let (image, sign) = nodes.image(nodes.layer(index, a), a);
                place.node += nodes.offset(image, a);
                place.signs[a] = sign;
            }
            nodes.places.push(place);
        }
        nodes
    }

    pub(super) fn places(&self) -> &[Place<D>] {
        &self.places
    }

    /// The values of light nodes: for each, the nearest inner nodes that it continues, with their shares.
    ///
    /// `masses` are those of all nodes. Of a pair of nodes along an axis either the light node itself counts, or the two next to it on one side
    /// count 2 and -1; blocks of pairs are as near as they can be, and all of a kind count alike.
    pub(super) fn light(&self, masses: &[f64], least: f64) -> Vec<(usize, Vec<(usize, f64)>)> {
        const PAIRS: [[(isize, f64); 2]; 4] = [
            [(0, 1.0), (1, 0.0)],
            [(0, 1.0), (-1, 0.0)],
            [(1, 2.0), (2, -1.0)],
            [(-1, 2.0), (-2, -1.0)],
        ];
        let mut light = Vec::new();
        for node in (0..masses.len()).filter(|node| masses[*node] > 0.0 && masses[*node] < least) {
            let mut blocks = Vec::new();
            for number in 0..4_usize.pow(D as u32) {
                let pair = |a: usize| number / 4_usize.pow(a as u32) % 4;
                let far = (0..D).filter(|a| pair(*a) >= 2).count();
                let mut block = vec![(node as isize, 1.0)];
                for a in 0..D {
                    let stride: usize = (0..a).map(|a| self.layers(a)).product();
                    let longer = block.iter().flat_map(|(node, share)| {
                        PAIRS[pair(a)].map(|(off, own)| (node + off * stride as isize, share * own))
                    });
                    block = longer.collect();
                }
                let is_inner = |(node, _): &(isize, f64)| {
                    usize::try_from(*node)
                        .is_ok_and(|node| masses.get(node).is_some_and(|mass| *mass >= least))
                };
                if far > 0 && block.iter().all(is_inner) {
                    blocks.push((far, block));
                }
            }
            let Some(nearest) = blocks.iter().map(|(far, _)| *far).min() else { continue };
            blocks.retain(|(far, _)| *far == nearest);
            let part = 1.0 / blocks.len() as f64;
            let shares = blocks.into_iter().flat_map(|(_, block)| block);
            light.push((node, shares.map(|(node, share)| (node as usize, share * part)).collect()));
        }
        light
    }

    fn layers(&self, axis: usize) -> usize {
        self.grid.cells[axis] + 1 + 2 * PAD as usize
    }

    /// The part of a node's number that a layer across an axis contributes; layer 0 is on the lower face.
    fn offset(&self, layer: isize, axis: usize) -> usize {
        let stride: usize = (0..axis).map(|a| self.layers(a)).product();
        (layer + PAD) as usize * stride
    }

    fn layer(&self, node: usize, axis: usize) -> isize {
        let stride: usize = (0..axis).map(|a| self.layers(a)).product();
        (node / stride % self.layers(axis)) as isize - PAD
    }

    /// A layer's mirror image, and the sign of the component across it.
    fn image(&self, layer: isize, axis: usize) -> (isize, f64) {
        let ([lower, upper], last) = (self.grid.walls[axis], self.grid.cells[axis] as isize);
        let (mut image, mut sign) = (layer, 1.0);
        // Between two walls close to each other a layer is mirrored more than once.
        loop {
            if lower && image < 0 {
                image = -image;
            } else if upper && image > last {
                image = 2 * last - image;
            } else {
                break;
            }
            sign = -sign;
        }
        let on_wall = (lower && image == 0) || (upper && image == last);
        (image, if on_wall { 0.0 } else { sign })
    }

    /// Clears the normal components on walls, and mirrors the field to the nodes beyond.
    pub(super) fn mirrored(&self, field: &Field<D>) -> Field<D> {
        self.places.iter().map(|place| field[place.node].component_mul(&place.signs)).collect()
    }

    /// The weights of a particle at `x` with a box of half-size `l`: products over the axes.
    fn product(&self, shape: Shape, x: &SVector<f64, D>, l: &SVector<f64, D>) -> List<D> {
        let h = self.grid.spacing;
        let one = Entry { node: 0, x: SVector::zeros(), S: 1.0, G: SVector::repeat(1.0) };
        let mut list = vec![one];
        for a in 0..D {
            let xi = (x[a] - self.grid.lower[a]) / h;
            let below = xi.floor() as isize;
            let mut longer = Vec::new();
            for layer in below - 2..=below + 3 {
                let (S, slope) = at_distance(shape, xi - layer as f64, l[a] / h);
                if S == 0.0 && slope == 0.0 {
                    continue;
                }
                for entry in &list {
                    let mut entry = entry.clone();
                    entry.node += self.offset(layer, a);
                    entry.x[a] = self.grid.lower[a] + layer as f64 * h;
                    entry.S *= S;
                    for k in 0..D {
                        entry.G[k] *= if k == a { slope / h } else { S };
                    }
                    longer.push(entry);
                }
            }
            list = longer;
        }
        list
    }

    /// The hat functions at a point.
    pub(super) fn hats(&self, x: &SVector<f64, D>) -> List<D> {
        self.product(Shape::Linear, x, &SVector::zeros())
    }

    /// The nodes of a corner of `mesh`, which is a point: those of its hat functions, or splines. Gradients are in the axes of the grid.
    pub(super) fn at_corner(&self, shape: Shape, mesh: &Mesh<f64, D>, corner: usize) -> List<D> {
        let turn = mesh.turn.unwrap_or_else(SMatrix::identity);
        let x = turn * mesh.x[corner];
        let list = match shape {
            Shape::Bspline2 | Shape::Bspline3 => self.product(shape, &x, &SVector::zeros()),
            _ => self.hats(&x),
        };
        list.into_iter().map(|entry| Entry { x: turn.transpose() * entry.x, ..entry }).collect()
    }

    /// The nodes of a particle.
    pub(super) fn of(&self, shape: Shape, body: &Body<f64, D>, p: usize) -> List<D> {
        if let Some(mesh) = polygons(body) {
            let of_corner = |corner: Corner<D>| {
                let at_corner = self.at_corner(shape, mesh, corner.number).into_iter();
                at_corner.map(move |node| Entry {
                    S: node.S * corner.w,
                    G: corner.g * node.S,
                    ..node
                })
            };
            return corners(mesh, p).0.into_iter().flat_map(of_corner).collect();
        }
        let Some(corners) = domain(shape, body, p) else {
            let l = half_size(shape, body, p).map(|l| l.max(SMALLEST * self.grid.spacing));
            return self.product(shape, &body.particles.x[p], &l);
        };
        // The means of the hat functions' interpolations between the corners.
        let mut list = Vec::new();
        for (x, (w, g)) in corners.iter().zip(means(&corners).0) {
            let hats = self.hats(x).into_iter();
            list.extend(hats.map(|hat| Entry { S: hat.S * w, G: g * hat.S, ..hat }));
        }
        list
    }
}

/// A node's weight and its slope, at a distance `s` of the particle from the node; all lengths in cells.
fn at_distance(shape: Shape, s: f64, l: f64) -> (f64, f64) {
    let hat = |s: f64| (1.0 - s.abs()).max(0.0);
    // The integral of the hat over a part of the box, on one side of the node: a trapezium's area.
    let integral = |from: f64, to: f64| {
        let (from, to) = ((s - l).clamp(from, to), (s + l).clamp(from, to));
        (to - from) * 0.5 * (hat(from) + hat(to))
    };
    let (r, sign) = (s.abs(), s.signum());
    match shape {
        Shape::Ugimp | Shape::Gimp => {
            let mean = (integral(-1.0, 0.0) + integral(0.0, 1.0)) / (2.0 * l);
            (mean, (hat(s + l) - hat(s - l)) / (2.0 * l))
        }
        Shape::Bspline2 if r < 0.5 => (0.75 - r * r, -2.0 * s),
        Shape::Bspline2 if r < 1.5 => (0.5 * (1.5 - r).powi(2), -(1.5 - r) * sign),
        Shape::Bspline3 if r < 1.0 => (2.0 / 3.0 - r * r + 0.5 * r.powi(3), s * (1.5 * r - 2.0)),
        Shape::Bspline3 if r < 2.0 => ((2.0 - r).powi(3) / 6.0, -0.5 * (2.0 - r).powi(2) * sign),
        Shape::Bspline2 | Shape::Bspline3 => (0.0, 0.0),
        Shape::GimpBspline2 => {
            let spline = |s: f64| at_distance(Shape::Bspline2, s, 0.0).0;
            // Simpson's rule is exact between the spline's joints.
            let part = |from: f64, to: f64| {
                let (from, to) = ((s - l).clamp(from, to), (s + l).clamp(from, to));
                (to - from) / 6.0 * (spline(from) + 4.0 * spline(0.5 * (from + to)) + spline(to))
            };
            let sum = part(-1.5, -0.5) + part(-0.5, 0.5) + part(0.5, 1.5);
            (sum / (2.0 * l), (spline(s + l) - spline(s - l)) / (2.0 * l))
        }
        // At nodes the slope is that on the side of larger coordinates.
        _ if (0.0..1.0).contains(&s) => (hat(s), -1.0),
        _ if (-1.0..0.0).contains(&s) => (hat(s), 1.0),
        _ => (0.0, 0.0),
    }
}

/// Half the edges of a particle's parallelogram in the reference configuration, one a column.
fn half_edges<const D: usize>(body: &Body<f64, D>, p: usize) -> SMatrix<f64, D, D> {
    let of_box = || SMatrix::from_diagonal(&body.particles.half_size);
    body.half_edges.get(p).copied().unwrap_or_else(of_box)
}

/// The half-size of a particle's box, or of the box about `x` that holds its domain; zero for a point.
pub(super) fn half_size<const D: usize>(
    shape: Shape,
    body: &Body<f64, D>,
    p: usize,
) -> SVector<f64, D> {
    let E = half_edges(body, p).diagonal();
    match shape {
        Shape::Ugimp => E,
        Shape::Gimp | Shape::GimpBspline2 => E.component_mul(&body.particles.F[p].diagonal()).abs(),
        _ => {
            let corners = domain(shape, body, p).unwrap_or_default();
            let reaches = corners.iter().map(|corner| (corner - body.particles.x[p]).abs());
            reaches.fold(SVector::zeros(), |largest, reach| largest.sup(&reach))
        }
    }
}

/// The corners of a particle's domain, where it has one.
pub(super) fn domain<const D: usize>(
    shape: Shape,
    body: &Body<f64, D>,
    p: usize,
) -> Option<Vec<SVector<f64, D>>> {
    match (shape, &body.mesh) {
        (Shape::Cpdi, _) => {
            let E = body.particles.F[p] * half_edges(body, p);
            let corner = |s: &[f64; 3]| {
                let s = SVector::<f64, D>::from_fn(|a, _| s[a]);
                body.particles.x[p] + E * s
            };
            Some(SIGNS[..1 << D].iter().map(corner).collect())
        }
        (Shape::Cpdi2, Some(mesh)) if polygons(body).is_none() => {
            Some(mesh.of_particle(p).iter().map(|&k| mesh.x[k as usize]).collect())
        }
        _ => None,
    }
}

/// The corners of the cube `|s_a| <= 1`; the first two are those of the segment, the first four those of the square.
const SIGNS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// For each corner of a domain `x = sum_c N_c(s) x_c` the means of `N_c` and of its gradient in space, and the domain's volume.
///
/// The integrands are of degree three at most in each variable: two Gauss points along each axis are exact.
pub(super) fn means<const D: usize>(
    corners: &[SVector<f64, D>],
) -> (Vec<(f64, SVector<f64, D>)>, f64) {
    let mut shares = vec![(0.0, SVector::zeros()); corners.len()];
    let mut volume = 0.0;
    for point in &SIGNS[..corners.len()] {
        let s = point.map(|sign| sign / 3.0_f64.sqrt());
        let factor = |c: usize, a: usize| 0.5 * (1.0 + SIGNS[c][a] * s[a]);
        let N = |c: usize| (0..D).map(|a| factor(c, a)).product::<f64>();
        let dN = |c: usize| {
            SVector::<f64, D>::from_fn(|k, _| {
                (0..D).map(|a| if a == k { 0.5 * SIGNS[c][a] } else { factor(c, a) }).product()
            })
        };
        let map: SMatrix<f64, D, D> =
            (0..corners.len()).map(|c| corners[c] * dN(c).transpose()).sum();
        let (J, back) = (determinant(&map), inverse(&map).transpose());
        volume += J;
        for (c, (w, g)) in shares.iter_mut().enumerate() {
            *w += N(c) * J;
            *g += back * dN(c) * J;
        }
    }
    for (w, g) in &mut shares {
        *w /= volume;
        *g /= volume;
    }
    (shares, volume)
}

/// A matrix as part of one in space, with the identity in the rest.
fn in_space<const D: usize>(A: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    let mut whole = Matrix3::identity();
    for i in 0..D {
        for k in 0..D {
            whole[(i, k)] = A[(i, k)];
        }
    }
    whole
}

pub(super) fn determinant<const D: usize>(A: &SMatrix<f64, D, D>) -> f64 {
    in_space(A).determinant()
}

/// The inverse, with NaN for that of a singular matrix.
pub(super) fn inverse<const D: usize>(A: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let inverse = in_space(A).try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN));
    SMatrix::from_fn(|i, k| inverse[(i, k)])
}
