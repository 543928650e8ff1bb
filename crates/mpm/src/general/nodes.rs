//! P2G, grid update and G2P over the lists of weights.

use nalgebra::{SMatrix, SVector};

use super::stencil::{Entry, Raster, Stencils};
use crate::grid::Layout;

/// The nodes of a grid.
#[derive(Clone, Debug)]
pub(crate) struct Nodes<const D: usize> {
    layout: Layout<D>,
    /// The reciprocal of the mass, or zero for a node that no particle reaches.
    inverse_mass: Vec<f64>,
    /// Nodes with less mass than this are taken to be empty.
    least_mass: f64,
}

/// A vector at every node.
pub(crate) type Field<const D: usize> = Vec<SVector<f64, D>>;

impl<const D: usize> Nodes<D> {
    pub(crate) fn new(layout: Layout<D>, least_mass: f64) -> Self {
        Self { inverse_mass: vec![0.0; layout.nodes], layout, least_mass }
    }

    pub(crate) fn len(&self) -> usize {
        self.layout.nodes
    }

    /// P2G of mass.
    pub(crate) fn p2g_mass(&mut self, stencils: &Stencils<D>, mass: &[f64]) {
        let sums = &mut self.inverse_mass;
        sums.fill(0.0);
        for (p, m) in mass.iter().enumerate() {
            for entry in stencils.of(p) {
                sums[entry.node] += m * entry.S;
            }
        }
        self.layout.fold(sums, |image, ghost, _| *image += ghost);
        for mass in sums {
            *mass = if *mass > self.least_mass { mass.recip() } else { 0.0 };
        }
    }

    /// P2G of vectors, and the grid update: `give(particle, entries, sums)` adds a particle's contributions; sums are divided by
    /// the nodes' masses, components normal to walls vanish on them, and ghost nodes get the mirrored values.
    pub(crate) fn p2g(
        &self,
        stencils: &Stencils<D>,
        particles: usize,
        field: &mut Field<D>,
        mut give: impl FnMut(usize, &[Entry<D>], &mut Field<D>),
    ) {
        field.fill(SVector::zeros());
        for p in 0..particles {
            give(p, stencils.of(p), field);
        }
        self.layout.fold(field, |image, ghost, flip| *image += flipped(ghost, flip));
        for (value, inverse_mass) in field.iter_mut().zip(&self.inverse_mass) {
            *value *= *inverse_mass;
        }
        self.mirror(field);
    }

    /// Clears components normal to walls on them, and sets ghost nodes to the mirrored values.
    pub(crate) fn mirror(&self, field: &mut Field<D>) {
        self.layout.on_walls(0, field, |value, axis| value[axis] = 0.0);
        self.layout.unfold(field, flipped);
    }

    /// P2G of momentum: the velocity field of particles with velocities `v` and, for APIC, affine parts `C` about their centres.
    pub(crate) fn p2g_velocity(
        &self,
        raster: &Raster<D>,
        stencils: &Stencils<D>,
        mass: &[f64],
        v: &[SVector<f64, D>],
        C: &[SMatrix<f64, D, D>],
        field: &mut Field<D>,
    ) {
        self.p2g(stencils, v.len(), field, |p, entries, sums| {
            let momentum = v[p] * mass[p];
            let Some(C) = C.get(p) else {
                entries.iter().for_each(|entry| sums[entry.node] += momentum * entry.S);
                return;
            };
            let centre = centre(raster, entries);
            for entry in entries {
                let arm = raster.node(entry.node) - centre;
                sums[entry.node] += (momentum + C * arm * mass[p]) * entry.S;
            }
        });
    }

    /// The mass of a node that particles reach.
    #[cfg(test)]
    pub(crate) fn mass(&self, index: usize) -> Option<f64> {
        (self.inverse_mass[index] > 0.0).then(|| self.inverse_mass[index].recip())
    }
}

fn flipped<const D: usize>(mut value: SVector<f64, D>, axis: Option<usize>) -> SVector<f64, D> {
    if let Some(axis) = axis {
        value[axis] = -value[axis];
    }
    value
}

/// The mean position of a particle's nodes: its own, or its domain's centroid.
pub(crate) fn centre<const D: usize>(raster: &Raster<D>, entries: &[Entry<D>]) -> SVector<f64, D> {
    entries.iter().map(|entry| raster.node(entry.node) * entry.S).sum()
}

/// G2P: a field at a particle.
pub(crate) fn g2p<const D: usize>(entries: &[Entry<D>], field: &Field<D>) -> SVector<f64, D> {
    let mut sum = SVector::zeros();
    for entry in entries {
        sum += field[entry.node] * entry.S;
    }
    sum
}

/// G2P: the gradient `dv_i/dx_j` of a field at a particle.
pub(crate) fn g2p_gradient<const D: usize>(
    entries: &[Entry<D>],
    field: &Field<D>,
) -> SMatrix<f64, D, D> {
    let mut sum = SMatrix::zeros();
    for entry in entries {
        sum += field[entry.node] * entry.G.transpose();
    }
    sum
}
