//! Polygons and polyhedra: what their corners' values are worth in means over them.

use mmsmith_mpm::{Body, Interpolation, Mesh};
use nalgebra::SVector;

/// A corner of a particle: its number, the weight of its value in the mean over the particle, and its gradient in the mean gradient.
pub(super) struct Corner<const D: usize> {
    pub(super) number: usize,
    pub(super) w: f64,
    pub(super) g: SVector<f64, D>,
}

/// The polygons or polyhedra that particles are, where they are such.
pub(super) fn polygons<const D: usize>(body: &Body<f64, D>) -> Option<&Mesh<f64, D>> {
    body.mesh.as_ref().filter(|mesh| mesh.interpolation == Interpolation::Triangles)
}

/// A simplex between corners of a polygon or polyhedron, in which the rest of its corners are means of others.
struct Simplex {
    /// For each of its corners the numbers that it is the mean of.
    corners: Vec<Vec<usize>>,
}

/// The corners of a particle, and its volume.
///
/// Every polygon is the triangles between its edges and the mean of its corners, every polyhedron the tetrahedra between these on its faces
/// and the mean of its own. In each simplex functions are linear: their mean is that of its corners, in the reference configuration; the gradient is
/// that of the linear function, in the current one.
pub(super) fn corners<const D: usize>(mesh: &Mesh<f64, D>, p: usize) -> (Vec<Corner<D>>, f64) {
    let (mut shares, mut whole, mut volume) = (Vec::new(), 0.0, 0.0);
    for simplex in simplices(mesh, p) {
        let at = |x: &[SVector<f64, D>]| -> Vec<SVector<f64, D>> {
            let mean = |of: &Vec<usize>| {
                of.iter().map(|k| x[*k]).sum::<SVector<f64, D>>() / of.len() as f64
            };
            simplex.corners.iter().map(mean).collect()
        };
        let reference = content(&at(&mesh.X)).0;
        let (now, areas) = content(&at(&mesh.x));
        whole += reference;
        volume += now;
        for (of, area) in simplex.corners.iter().zip(areas) {
            for &number in of {
                let part = 1.0 / of.len() as f64;
                let w = part * reference / (D as f64 + 1.0);
                shares.push(Corner { number, w, g: area * part });
            }
        }
    }
    for share in &mut shares {
        share.w /= whole;
        share.g /= volume;
    }
    (shares, volume)
}

/// The content of a simplex, and that times the gradient of the linear function that is 1 at a corner and 0 at the others.
fn content<const D: usize>(x: &[SVector<f64, D>]) -> (f64, Vec<SVector<f64, D>>) {
    let edge = |k: usize| x[k] - x[0];
    // Gradients by minors of the matrix of edges; that of the first corner is what is left.
    let (content, mut others): (f64, Vec<SVector<f64, D>>) = match D {
        2 => {
            let (a, b) = (edge(1), edge(2));
            let turned = |v: SVector<f64, D>, sign: f64| {
                SVector::from_fn(|k, _| sign * if k == 0 { v[1] } else { -v[0] } / 2.0)
            };
            ((a[0] * b[1] - a[1] * b[0]) / 2.0, vec![turned(b, 1.0), turned(a, -1.0)])
        }
        _ => {
            let (a, b, c) = (edge(1), edge(2), edge(3));
            let minors = [b.cross(&c), c.cross(&a), a.cross(&b)];
            (a.dot(&minors[0]) / 6.0, minors.map(|minor| minor / 6.0).into())
        }
    };
    let first = -others.iter().sum::<SVector<f64, D>>();
    others.insert(0, first);
    (content, others)
}

fn simplices<const D: usize>(mesh: &Mesh<f64, D>, p: usize) -> Vec<Simplex> {
    let part = |ends: &[u32], k: usize| {
        let first = if k == 0 { 0 } else { ends[k - 1] as usize };
        first..ends[k] as usize
    };
    let mut simplices = Vec::new();
    for polygon in part(&mesh.of_particles, p) {
        let own = &mesh.corners[part(&mesh.ends, polygon)];
        let own: Vec<usize> = own.iter().map(|corner| *corner as usize).collect();
        let faces: Vec<Vec<usize>> = match D {
            2 => vec![own.clone()],
            _ => part(&mesh.faces.of_polyhedra, polygon)
                .map(|face| &mesh.faces.corners[part(&mesh.faces.ends, face)])
                .map(|face| face.iter().map(|place| own[*place as usize]).collect())
                .collect(),
        };
        for face in faces {
            for (k, from) in face.iter().enumerate() {
                let to = face[(k + 1) % face.len()];
                let mut corners = vec![vec![*from], vec![to], face.clone()];
                if D == 3 {
                    corners.push(own.clone());
                    // Counter-clockwise as seen from outside: the fourth corner is inside.
                    corners.swap(0, 1);
                }
                simplices.push(Simplex { corners });
            }
        }
    }
    simplices
}
