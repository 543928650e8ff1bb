//! The quadrature points of a body in its reference configuration: gradients there, stresses, and the forces of stresses.

use mmsmith_laws::{
    BLOCK, BlockOfStresses, BlockWithMemory, Differentiated, InternalVariable, Law, SIDE_BY_SIDE,
    Stressed, Tangent,
};
use mmsmith_threads::each;
use nalgebra::{SMatrix, SVector};

use super::component::Component;
use super::coordinates::{Coordinates, RowGeometry};
use super::fit::Line;
use super::gradient::Gradients;
use super::set_up::{Grid, particles, rows};

/// Points with a law, whose internal variables are those of time zero.
#[derive(Clone, Debug)]
pub(super) struct Quadrature<const D: usize> {
    pub(super) coordinates: Coordinates,
    pub(super) rows: Vec<RowGeometry<D>>,
    pub(super) reciprocal_radius: Vec<f64>,
    /// Points in a row along axis 0.
    pub(super) row: usize,
    /// Cartesian.
    pub(super) X: Vec<SVector<f64, D>>,
    /// The volumes that the points stand for.
    pub(super) volume: Vec<f64>,
    pub(super) law: Law<f64, D>,
    variables: Vec<InternalVariable>,
    /// Values of the law that depend on the place, those of a point one after the other.
    given: Vec<f64>,
}

impl<const D: usize> Quadrature<D> {
    pub(super) fn new(grid: &Grid<D>, lines: &[Line; D], law: Law<f64, D>) -> Self {
        let bodies = particles(grid, lines, 1.0);
        let given = match &law {
            Law::WithMemory(law) => bodies.X.iter().flat_map(|X| law.initial(X)).collect(),
            Law::Library(_) | Law::Own(_) => Vec::new(),
        };
        Self {
            coordinates: grid.coordinates,
            rows: rows(grid, lines),
            reciprocal_radius: lines[0].points.iter().map(|R| R.recip()).collect(),
            row: lines[0].points.len(),
            X: bodies.X,
            volume: bodies.volume,
            variables: law.variables(),
            law,
            given,
        }
    }

    /// A field's values and gradients at the points, Cartesian.
    pub(super) fn of<'a>(&'a self, components: &'a [Component<D>; D]) -> Gradients<'a, D> {
        let Self { coordinates, rows, reciprocal_radius, row, .. } = self;
        let (coordinates, row) = (*coordinates, *row);
        Gradients { components, coordinates, row, rows, reciprocal_radius }
    }

    /// The components of a Cartesian vector that unknowns at a point stand for.
    pub(super) fn in_frame(&self, p: usize, vector: &SVector<f64, D>) -> SVector<f64, D> {
        self.rows.get(p / self.row).map_or(*vector, |row| row.frame.tr_mul(vector))
    }

    /// Internal variables of some points.
    pub(super) fn given(&self, first: usize, count: usize) -> &[f64] {
        let variables = self.variables.len();
        &self.given[first * variables..(first + count) * variables]
    }

    /// Puts the factors of forces in place of what stands at the points, for Cartesian stresses.
    pub(super) fn set_forces(
        &self,
        components: &mut [Component<D>; D],
        stresses: &[SMatrix<f64, D, D>],
    ) {
        let Self { coordinates, rows, reciprocal_radius, volume, row, .. } = self;
        for (p, stress) in stresses.iter().enumerate() {
            let mut force = stress * -volume[p];
            if let Some(at) = rows.get(p / row) {
                let local = at.frame.transpose() * force * at.frame;
                let of_values;
                (of_values, force) =
                    coordinates.transposed_gradient(&local, reciprocal_radius[p % row], at);
                for (c, component) in components.iter_mut().enumerate() {
                    component.values[p] = of_values[c];
                }
            }
            for (c, component) in components.iter_mut().enumerate() {
                for k in 0..D {
                    component.slopes[k][p] = force[(c, k)];
                }
            }
        }
    }
}

impl<const D: usize> Quadrature<D>
where
    f64: Stressed<D>,
{
    /// Stresses of a block of points.
    pub(super) fn stresses(
        &self,
        first: usize,
        F: &[SMatrix<f64, D, D>],
    ) -> Vec<SMatrix<f64, D, D>> {
        match &self.law {
            law @ Law::Library(_) => side_by_side(law, F),
            Law::Own(law) => {
                let mut block = BlockOfStresses::at_rest();
                F.iter().enumerate().for_each(|(n, F)| block.set(n, F));
                block.evaluate(law.as_ref());
                (0..F.len()).map(|n| block.stress(n)).collect()
            }
            Law::WithMemory(law) => {
                let mut block = BlockWithMemory::at_rest(&self.variables);
                block.first_piola_kirchhoff(law.as_ref(), F, self.given(first, F.len()));
                (0..F.len()).map(|n| block.stress(n)).collect()
            }
        }
    }

    /// Stresses of all points, in blocks that threads share.
    pub(super) fn all_stresses(&self, F: &[SMatrix<f64, D, D>], P: &mut [SMatrix<f64, D, D>]) {
        let blocks = F.chunks(BLOCK).zip(P.chunks_mut(BLOCK)).enumerate().collect();
        each(blocks, &|(block, (F, P))| P.copy_from_slice(&self.stresses(block * BLOCK, F)));
    }
}

impl<const D: usize> Quadrature<D>
where
    f64: Differentiated<D>,
{
    /// Tangents of all points, Cartesian.
    pub(super) fn all_tangents(&self, F: &[SMatrix<f64, D, D>], A: &mut [Tangent<D>]) {
        let blocks = F.chunks(BLOCK).zip(A.chunks_mut(BLOCK)).enumerate().collect();
        each(blocks, &|(block, (F, A))| {
            f64::tangents(&self.law, F, self.given(block * BLOCK, F.len()), A);
        });
    }
}

/// The stresses of a law of the library.
fn side_by_side<const D: usize>(
    law: &Law<f64, D>,
    F: &[SMatrix<f64, D, D>],
) -> Vec<SMatrix<f64, D, D>>
where
    f64: Stressed<D>,
{
    let mut stresses = Vec::with_capacity(F.len());
    for F in F.chunks(SIDE_BY_SIDE) {
        let of = |n: usize| F.get(n).copied().unwrap_or_else(SMatrix::identity);
        let (mut lanes, mut P) = ([[[0.0; SIDE_BY_SIDE]; D]; D], [[[0.0; SIDE_BY_SIDE]; D]; D]);
        for n in 0..SIDE_BY_SIDE {
            let F = of(n);
            for i in 0..D {
                for j in 0..D {
                    lanes[i][j][n] = F[(i, j)];
                }
            }
        }
        law.first_piola_kirchhoff_side_by_side(&lanes, &mut P);
        stresses.extend((0..F.len()).map(|n| SMatrix::from_fn(|i, j| P[i][j][n])));
    }
    stresses
}
