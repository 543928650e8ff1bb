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
use crate::shape::one_axis::{EXTENDED, HALF_SIZE_LIMIT, node_below};
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

    /// Whether its weights exchange scalars of nodes. Default: they do not.
    fn exchanges_scalars(&self) -> bool {
        false
    }

    /// The most nodes along an axis that a particle reaches.
    fn most_nodes(&self) -> usize {
        EXTENDED
    }

    /// The nodes along each axis that a particle with these half-sizes reaches.
    fn reached(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
        l: &SVector<T, D>,
    ) -> [Reached<T>; D];

    /// Whether all particles of a block are valid, each in its own tile. Nearly all are, and this tells it sooner than
    /// [`diagnose`](Self::diagnose), which has to tell for the others.
    fn are_valid(&self, of_block: OfBlock<'_, T, D>) -> bool;

    /// Data of each of the `before` particles here move with them to other processes; collective. Default: there are none.
    fn follow(&mut self, _moved: &Move, _before: usize) {}

    /// The place on the grid of a particle at a position. Default: that position.
    fn on_grid(&self, _c: &Constants<T, D>, x: &SVector<T, D>) -> SVector<T, D> {
        *x
    }

    /// The lower edges of a particle's domain along all axes, in cells from the lower corner of the grid.
    fn edges(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> [f64; D] {
        let reached = self.reached(c, p, x, F, &self.half_size(c, p, F));
        reached.map(|Reached { edge, .. }| nalgebra::try_convert(edge).unwrap_or(f64::NAN))
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
            .or_else(|| c.axis_outside(&self.on_grid(c, x)).map(|_| Invalid::LeftGrid))
            .or_else(|| axis_too_large(&self.half_size(c, p, F)).map(|_| Invalid::TooLarge))
    }

    /// Diagnoses a particle that may be invalid or outside its tile.
    fn diagnose(
        &self,
        c: &Constants<T, D>,
        p: usize,
        tile: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Outcome {
        match self.invalidity(c, p, x, F) {
            Some(invalid) => Outcome { failure: Some((invalid, p)), resort: false },
            None => Outcome { failure: None, resort: !self.is_in_tile(c, p, tile, x, F) },
        }
    }

    /// Whether a particle reaches nodes of a tile's window alone.
    fn is_in_tile(
        &self,
        c: &Constants<T, D>,
        p: usize,
        tile: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> bool {
        let l = self.half_size(c, p, F);
        let reached = self.reached(c, p, x, F, &l);
        (0..D).all(|a| {
            let Reached { edge, width } = reached[a];
            let (first, end) = c.tiles.range(tile, width)[a];
            edge >= real(first) && edge < real(end)
        })
    }
}

/// Particles of a block that are to be checked.
#[derive(Clone, Copy)]
pub(crate) struct OfBlock<'a, T, const D: usize> {
    pub(crate) c: &'a Constants<T, D>,
    /// The particles, no more than a block.
    pub(crate) ids: &'a [u32],
    /// The tile of each.
    pub(crate) tiles: &'a [u32; BLOCK],
    pub(crate) kinematics: Kinematics<'a, T, D>,
}

/// The first axis along which a half-size, in cells, exceeds the limit.
pub(crate) fn axis_too_large<T: RealField + Copy, const D: usize>(
    l: &SVector<T, D>,
) -> Option<usize> {
    (0..D).find(|&a| l[a] > real(HALF_SIZE_LIMIT))
}

/// The nodes that a particle reaches along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached<T> {
    /// The lower edge of its domain, in cells from the lower corner of the grid: the first node is the one below.
    pub(crate) edge: T,
    /// How many nodes at most.
    pub(crate) width: usize,
}

impl<T: RealField + Copy> Reached<T> {
    /// Around corners at these places, in cells; computed as kernels compute them, so that both have the same first node.
    #[inline(always)]
    pub(crate) fn between(places: impl Iterator<Item = T>) -> Self {
        let (mut low, mut high) = (T::max_value().unwrap_or(T::one()), -T::one());
        for place in places {
            low = if place < low { place } else { low };
            high = if place > high { place } else { high };
        }
        let nodes = node_below(high).0 - node_below(low).0 + 2.0;
        // Small domains have a patch of so many nodes, reached or not.
        Self { edge: low, width: (nodes as usize).clamp(REACHED, EXTENDED) }
    }
}
