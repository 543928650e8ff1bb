//! The domains of particles, or of points that stand for them: all that passes ask of a shape function.
//!
//! A [`Domain`] tells which nodes its particles reach and whether they are valid, and gives the [weights](BlockWeights) by which blocks
//! of particles exchange with these nodes.

use std::fmt;

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use nalgebra::{RealField, SMatrix, SVector};

use crate::grid::geometry::Constants;
use crate::kernel::block::BlockWeights;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::shape::cells::REACHED;
use crate::shape::one_axis::{EXTENDED, HALF_SIZE_LIMIT, first_layer, node_below};
use crate::step::health::{Invalid, Outcome};
use mmsmith_ranks::Move;

/// Domains of particles whose weights are means over them.
pub(crate) trait Domain<T: Lanes, const D: usize>: fmt::Debug + Send + Sync {
    /// Room for the weights of a block of particles, with those for affine velocities (APIC) or without.
    fn weights(&self, is_affine: bool) -> Box<dyn BlockWeights<T, D>>;

    /// Half-sizes of the box around a particle's domain, in cells, about the particle's position.
    fn half_size(&self, c: &Constants<T, D>, p: usize, F: &SMatrix<T, D, D>) -> SVector<T, D>;

    /// By how much [half-sizes](Self::half_size) exceed those of the domain itself, in cells. Default: not at all.
    fn beyond_box(&self) -> f64 {
        0.0
    }

    /// The rows of nodes that a particle with these half-sizes reaches.
    fn rows(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> Rows<T>;

    /// Whether all particles of a block are valid, each in its own bin. Nearly all are, and this tells it sooner than
    /// [`diagnose`](Self::diagnose), which has to tell for the others.
    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool;

    /// Data of each of the `before` particles here move with them to other processes; collective. Default: there are none.
    fn follow(&mut self, _moved: &Move, _before: usize) {}

    /// The first node that a particle reaches along the last axis, and about the first one along the others.
    fn first_node(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> usize {
        let (xi, l) = (c.in_cells(x), self.half_size(c, p, F));
        let row = first_layer(self.rows(c, p, x, F, &l).edge, T::zero());
        (0..D - 1).map(|a| first_layer(xi[a], l[a]) * c.strides[a]).sum::<usize>()
            + row * c.strides[D - 1]
    }

    /// The reason why a particle is invalid, if it is.
    fn invalidity(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Option<Invalid> {
        Invalid::of_deformation(x, F)
            .or_else(|| c.axis_outside(x).map(|_| Invalid::LeftGrid))
            .or_else(|| axis_too_large(&self.half_size(c, p, F)).map(|_| Invalid::TooLarge))
    }

    /// Diagnoses a particle that may be invalid or outside its bin.
    fn diagnose(
        &self,
        c: &Constants<T, D>,
        p: usize,
        bin: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Outcome {
        match self.invalidity(c, p, x, F) {
            Some(invalid) => Outcome { failure: Some((invalid, p)), resort: false },
            None => Outcome { failure: None, resort: !self.is_in_bin(c, p, bin, x, F) },
        }
    }

    /// Whether a particle is in a bin.
    fn is_in_bin(
        &self,
        c: &Constants<T, D>,
        p: usize,
        bin: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> bool {
        let l = self.half_size(c, p, F);
        let Rows { edge, width } = self.rows(c, p, x, F, &l);
        let (first, end) = c.bins.range(bin, width);
        edge >= real(first) && edge < real(end)
    }
}

/// Particles of a block that are to be checked.
#[derive(Clone, Copy)]
pub(crate) struct OfBlock<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    /// The particles, no more than a block.
    pub(crate) ids: &'a [u32],
    /// The bin of each.
    pub(crate) bins: &'a [u32; BLOCK],
    pub(crate) kinematics: Kinematics<'a, T, D>,
}

/// The first axis along which a half-size, in cells, exceeds the limit.
pub(crate) fn axis_too_large<T: RealField + Copy, const D: usize>(
    l: &SVector<T, D>,
) -> Option<usize> {
    (0..D).find(|&a| l[a] > real(HALF_SIZE_LIMIT))
}

/// The rows of nodes that a particle reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<T> {
    /// The lower edge of its domain, in cells from the lower corner of the grid: the first row is the one below.
    pub(crate) edge: T,
    /// How many rows at most.
    pub(crate) width: usize,
}

impl<T: RealField + Copy> Rows<T> {
    /// Around corners at these heights, in cells; computed as kernels compute them, so that both have the same first row.
    #[inline(always)]
    pub(crate) fn between(heights: impl Iterator<Item = T>) -> Self {
        let (mut low, mut high) = (T::max_value().unwrap_or(T::one()), -T::one());
        for height in heights {
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
        }
        let rows = node_below(high).0 - node_below(low).0 + 2.0;
        // Small domains have a patch of so many nodes, reached or not.
        Self { edge: low, width: (rows as usize).clamp(REACHED, EXTENDED) }
    }
}
