//! Checks of particles after each step: invalid particles end the run, particles that left their bin cause a new sort.

use std::sync::{Mutex, PoisonError};

use mmsmith_lanes::simd::{Eight, Lanes, Loop, Vectors, dispatch};
use mmsmith_lanes::tensor::{determinant, real};
use nalgebra::{SMatrix, SVector};

use crate::domain::{Rows, Support};
use crate::grid::geometry::Constants;
use crate::kernel::copies::{BLOCK, Kinematics};
use crate::kernel::parallelograms::{GROUP, OfGroup, gather, padded, parallelograms};
use crate::shape::cells::{self, HalfEdges, MOST_CORNERS, REACHED, corner_of_parallelogram};
use crate::shape::one_axis::{
    EXTENDED, HALF_SIZE_LIMIT, OnAxis, ProductShape, half_size, node_below,
};

/// Reasons why a particle is invalid, worst first: where one particle is inverted, others may follow in the same step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Invalid {
    Inverted,
    NotFinite,
    LeftGrid,
    TooLarge,
}

impl<T: Lanes, const D: usize> Support<T, D> {
    /// The reason why a particle is invalid, if it is.
    pub(crate) fn invalidity(
        &self,
        c: &Constants<T, D>,
        p: usize,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Option<Invalid> {
        let J = determinant(F);
        if J <= T::zero() {
            return Some(Invalid::Inverted);
        }
        if !J.is_finite() || x.iter().any(|x| !x.is_finite()) {
            return Some(Invalid::NotFinite);
        }
        // Polygons may have axes of their own; their corners are looked at themselves.
        let is_polygon = matches!(self, Self::Mesh(corners) if !corners.mesh.is_of_cells());
        if !is_polygon && c.axis_outside(x).is_some() {
            return Some(Invalid::LeftGrid);
        }
        if let Some(volume) = self.volume(p) {
            if volume <= T::zero() {
                return Some(Invalid::Inverted);
            }
            if !volume.is_finite() {
                return Some(Invalid::NotFinite);
            }
        }
        self.axis_too_large(&self.half_size(c, p, F)).map(|_| Invalid::TooLarge)
    }

    /// Diagnoses a particle that may be invalid or outside its bin.
    pub(crate) fn diagnose(
        &self,
        c: &Constants<T, D>,
        p: usize,
        bin: u32,
        x: &SVector<T, D>,
        F: &SMatrix<T, D, D>,
    ) -> Outcome {
        if let Some(invalid) = self.invalidity(c, p, x, F) {
            return Outcome { failure: Some((invalid, p)), resort: false };
        }
        // Where domains share corners, these are what is sorted.
        let is_inside = matches!(self, Self::Mesh(_)) || self.is_in_bin(c, p, bin, x, F);
        Outcome { failure: None, resort: !is_inside }
    }

    /// Whether a particle is in a bin.
    pub(crate) fn is_in_bin(
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

    /// Whether all particles `ids` of a block are valid, each in its own of `bins`. Nearly all are, and this tells it sooner
    /// than [`diagnose`](Self::diagnose), which has to tell for the others.
    pub(crate) fn are_valid(
        &self,
        c: &Constants<T, D>,
        ids: &[u32],
        bins: &[u32; BLOCK],
        kinematics: Kinematics<'_, T, D>,
    ) -> bool {
        let mut all_valid = true;
        let of_block = OfBlock { c, kinematics, bins, count: ids.len().min(BLOCK) };
        let all = &mut all_valid;
        match self {
            Self::Product(shape) if shape.on_axis == OnAxis::StretchingBox => {
                dispatch(CheckBoxes::<_, D, true> { of_block, shape, all_valid: all });
            }
            Self::Product(shape) => {
                dispatch(CheckBoxes::<_, D, false> { of_block, shape, all_valid: all });
            }
            Self::Cpdi { half_edges } => {
                let ids = &padded(ids);
                dispatch(CheckParallelograms { of_block, half_edges, ids, all_valid: all });
            }
            Self::Mesh(_) => {
                let Kinematics { x, F } = kinematics;
                for (k, &p) in ids.iter().enumerate() {
                    all_valid &= self.invalidity(c, p as usize, &x[k], &F[k]).is_none();
                }
            }
        }
        all_valid
    }
}

/// Particles of a block that are to be checked: the first `count`, each in one of `bins`.
#[derive(Clone, Copy)]
struct OfBlock<'a, T, const D: usize> {
    c: &'a Constants<T, D>,
    kinematics: Kinematics<'a, T, D>,
    bins: &'a [u32; BLOCK],
    count: usize,
}

impl<T: Lanes, const D: usize> OfBlock<'_, T, D> {
    /// Whether all particles of a group are valid: inside the grid, with small domains between these corners, in cells, and in
    /// their bins.
    #[inline(always)]
    fn are_domains_valid<V: Vectors>(
        &self,
        vectors: V,
        group: usize,
        corners: &[[Eight<T, V>; D]; MOST_CORNERS],
    ) -> bool {
        let &Self { c, kinematics: Kinematics { x, F }, bins, count } = self;
        let constant = |value: T| Eight { lanes: vectors.splat8(value), vectors };
        // The sign of a difference is exact: none of these may be negative.
        let mut slack = constant(T::one()).lanes;
        let (mut low, mut high) = (corners[0], corners[0]);
        for a in 0..D {
            for corner in &corners[1..1 << D] {
                low[a].lanes = vectors.min8(low[a].lanes, corner[a].lanes);
                high[a].lanes = vectors.max8(high[a].lanes, corner[a].lanes);
            }
            let x = gather(vectors, group, |k| x[k][a]);
            let above = x - constant(c.lower[a]);
            let xi = above * constant(c.inverse_spacing);
            let small = constant(real(SMALL));
            for slack_of in
                [above, constant(c.upper[a]) - x, small - (xi - low[a]), small - (high[a] - xi)]
            {
                slack = vectors.min8(slack, slack_of.lanes);
            }
        }
        let mut lanes_of_F = [[corners[0][0]; D]; D];
        for i in 0..D {
            for j in 0..D {
                lanes_of_F[i][j] = gather(vectors, group, |k| F[k][(i, j)]);
            }
        }
        let J = cells::determinant(&lanes_of_F).lanes;
        let (low, high) = (low[D - 1].lanes, high[D - 1].lanes);
        let mut all = true;
        for n in 0..GROUP {
            let k = group * GROUP + n;
            let (first, end) = c.bins.range(bins[k], REACHED);
            let rows = node_below(high.0[n]).0 - node_below(low.0[n]).0;
            let is_valid = (J.0[n] > T::zero())
                & (slack.0[n] >= T::zero())
                & (rows <= (REACHED - 2) as f64)
                & (low.0[n] >= real(first))
                & (low.0[n] < real(end));
            all &= is_valid | (k >= count);
        }
        all
    }
}

/// Half-size of a domain, in cells, that is below [`HALF_SIZE_LIMIT`] however it is rounded.
const SMALL: f64 = HALF_SIZE_LIMIT - 0.125;

struct CheckBoxes<'a, 'b, T, const D: usize, const STRETCHING: bool> {
    of_block: OfBlock<'a, T, D>,
    shape: &'a ProductShape<T, D>,
    all_valid: &'b mut bool,
}

impl<T: Lanes, const D: usize, const STRETCHING: bool> Loop
    for CheckBoxes<'_, '_, T, D, STRETCHING>
{
    #[inline(always)]
    fn run<V: Vectors>(self, _: V) {
        let Self { of_block, shape, all_valid } = self;
        let OfBlock { c, kinematics: Kinematics { x, F }, bins, count } = of_block;
        let (width, above) = (shape.width(), shape.extended_above());
        let more_rows: T = real((EXTENDED - width) as f64);
        let half_size = |k: usize, a: usize| half_size::<_, STRETCHING>(shape.l[a], F[k][(a, a)]);
        // The lower edge, and the same where it would be for the last row of a box with extended support.
        let edges = |k: usize, is_extended: bool| {
            let a = D - 1;
            let edge = (x[k][a] - c.lower[a]) * c.inverse_spacing - half_size(k, a);
            (edge, if is_extended { edge + more_rows } else { edge })
        };
        let is_inside = |(first, end): (f64, f64), (low, high): (T, T)| {
            (low >= real(first)) & (high < real(end))
        };
        let bins = &bins[..count.min(BLOCK)];
        let Some((&bin, others)) = bins.split_first() else { return };
        let range = c.bins.range(bin, width);
        let (mut all, mut all_inside) = (true, true);
        for k in 0..bins.len() {
            let mut valid = determinant(&F[k]) > T::zero();
            let mut is_extended = false;
            for a in 0..D {
                let (x, l) = (x[k][a], half_size(k, a));
                valid &= (x >= c.lower[a]) & (x <= c.upper[a]) & (l <= real(HALF_SIZE_LIMIT));
                is_extended |= l > above;
            }
            all &= valid;
            all_inside &= is_inside(range, edges(k, is_extended));
        }
        // Blocks with particles of several bins are rare.
        if others.iter().any(|other| *other != bin) {
            all_inside = bins.iter().enumerate().all(|(k, &bin)| {
                let is_extended = (0..D).any(|a| half_size(k, a) > above);
                is_inside(c.bins.range(bin, width), edges(k, is_extended))
            });
        }
        *all_valid = all && all_inside;
    }
}

struct CheckParallelograms<'a, 'b, T, const D: usize> {
    of_block: OfBlock<'a, T, D>,
    half_edges: &'a HalfEdges<T, D>,
    ids: &'a [usize; BLOCK],
    all_valid: &'b mut bool,
}

impl<T: Lanes, const D: usize> Loop for CheckParallelograms<'_, '_, T, D> {
    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let Self { of_block, half_edges, ids, all_valid } = self;
        let OfBlock { c, kinematics, count, .. } = of_block;
        let mut all = true;
        for group in 0..count.div_ceil(GROUP).min(BLOCK / GROUP) {
            let OfGroup { xi, E } = parallelograms(vectors, c, half_edges, ids, kinematics, group);
            let mut corners = [xi; MOST_CORNERS];
            for (corner, at) in corners.iter_mut().enumerate().take(1 << D) {
                *at = corner_of_parallelogram(&xi, &E, corner);
            }
            all &= of_block.are_domains_valid(vectors, group, &corners);
        }
        *all_valid = all;
    }
}

/// Result of a pass over particles.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Outcome {
    /// The worst reason, and the first particle it holds for.
    pub(crate) failure: Option<(Invalid, usize)>,
    /// Whether a particle left its bin.
    pub(crate) resort: bool,
}

impl Outcome {
    /// Whether all particles are valid and in their bins.
    pub(crate) fn is_clean(self) -> bool {
        self.failure.is_none() && !self.resort
    }

    pub(crate) fn merge(self, other: Self) -> Self {
        let failure = match (self.failure, other.failure) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        Self { failure, resort: self.resort || other.resort }
    }
}

/// The merged outcome of several threads; their order does not matter.
#[derive(Debug, Default)]
pub(crate) struct SharedOutcome(Mutex<Outcome>);

impl SharedOutcome {
    pub(crate) fn add(&self, outcome: Outcome) {
        if !outcome.is_clean() {
            let mut merged = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *merged = merged.merge(outcome);
        }
    }

    pub(crate) fn all(self) -> Outcome {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Grid, Layout};
    use crate::kernel::copies::Copies;
    use crate::parallel::bins::Bins;
    use crate::scheme::Shape;
    use nalgebra::{Matrix2, Vector2, vector};

    fn shape(shape: Shape) -> ProductShape<f64, 2> {
        ProductShape::new(shape, Vector2::repeat(0.25)).unwrap()
    }

    fn constants() -> Constants<f64, 2> {
        let grid =
            Grid { lower: Vector2::zeros(), spacing: 0.5, cells: [6, 60], walls: [[false; 2]; 2] };
        let layout = Layout::new(&grid, 8).unwrap();
        let bins = Bins::new(&layout, 1);
        Constants::new(&grid, &layout, &bins, 0.1, 1.0)
    }

    /// `check(x, F, valid)` has to give the expected answer, in the bin of rows from 13 cells above the lower corner on.
    fn for_all_limits(
        shape: &str,
        F: Matrix2<f64>,
        half_size: f64,
        end: f64,
        check: &dyn Fn(Vector2<f64>, Matrix2<f64>) -> bool,
    ) {
        let at = |edge: f64| 0.5 * (edge + half_size);
        for (y, valid) in [
            (at(13.0), true),
            (at(13.0).next_down(), false),
            (at(end), false),
            (at(end).next_down(), true),
        ] {
            assert_eq!(check(vector![1.2, y], F), valid, "{shape} {F} {y}");
        }
        for (x, valid) in [
            (0.0, true),
            (-5e-324, false),
            (3.0, true),
            (3.0_f64.next_up(), false),
            (f64::NAN, false),
        ] {
            assert_eq!(check(vector![x, 9.0], F), valid, "{shape} {F} {x}");
        }
        for bad in [Matrix2::zeros(), Matrix2::from_diagonal(&vector![1.0, -1.0])] {
            assert!(!check(vector![1.2, 9.0], bad), "{shape}");
        }
    }

    fn is_valid(
        c: &Constants<f64, 2>,
        support: &Support<f64, 2>,
        bin: u32,
        x: Vector2<f64>,
        F: Matrix2<f64>,
    ) -> bool {
        let mut copies = Copies::new();
        copies.copy(&[x], &[F]);
        support.are_valid(c, &[0], &[bin; BLOCK], copies.kinematics())
    }

    #[test]
    fn particles_are_valid_up_to_the_limits_of_grid_bin_and_box() {
        let c = constants();
        let with = |a: f64, b: f64| Matrix2::from_diagonal(&vector![a, b]);
        let one = with(1.0, 1.0);
        let valid = |shape: ProductShape<f64, 2>| {
            let support = Support::Product(shape);
            move |x, F| {
                let is_valid = is_valid(&c, &support, 2, x, F);
                let outcome = support.diagnose(&c, 0, 2, &x, &F);
                assert_eq!(is_valid, outcome.is_clean(), "{x} {F}");
                is_valid
            }
        };
        for_all_limits("hat", one, 0.0, 28.0, &valid(shape(Shape::Linear)));
        let fixed = shape(Shape::Ugimp);
        for_all_limits("fixed", one, 0.25, 27.0, &valid(fixed));
        for_all_limits("quadratic", one, 0.5, 27.0, &valid(shape(Shape::Bspline2)));
        for_all_limits("cubic", one, 1.0, 26.0, &valid(shape(Shape::Bspline3)));
        let of_box = valid(shape(Shape::Gimp));
        for (F, half_size, end) in [
            (one, 0.25, 27.0),
            (with(1.0, 2.0), 0.5, 27.0),
            // A box with extended support along any axis has six rows.
            (with(1.0, 3.0), 0.75, 24.0),
            (with(3.0, 1.0), 0.25, 24.0),
            (with(1.0, 8.0), 2.0, 24.0),
            (with(8.0, 1.0), 0.25, 24.0),
        ] {
            for_all_limits("stretching", F, half_size, end, &of_box);
        }
        for F in [with(8.125, 1.0), with(1.0, 8.125)] {
            assert!(!of_box(vector![1.2, 9.0], F));
        }
        // The lowest and the highest bin reach over the ends of the grid.
        for (bin, y, valid) in
            [(0, 0.0, true), (0, -5e-324, false), (7, 30.0, true), (7, 30.0_f64.next_up(), false)]
        {
            let hat = Support::Product(shape(Shape::Linear));
            assert_eq!(is_valid(&c, &hat, bin, vector![1.2, y], one), valid, "{bin} {y}");
        }
    }

    #[test]
    fn a_particle_that_left_its_bin_is_sorted_anew_and_an_invalid_one_stops_the_run() {
        let c = constants();
        let one = Matrix2::identity();
        let hat = Support::Product(shape(Shape::Linear));
        let diagnose = |y: f64, F: &Matrix2<f64>| hat.diagnose(&c, 41, 2, &vector![1.2, y], F);
        assert!(diagnose(9.0, &one).is_clean());
        let moved = diagnose(15.0, &one);
        assert!(moved.resort && moved.failure.is_none() && !moved.is_clean());
        let gone = diagnose(31.0, &one);
        assert_eq!((gone.failure, gone.resort), (Some((Invalid::LeftGrid, 41)), false));
        let inverted = diagnose(9.0, &-Matrix2::from_diagonal(&vector![1.0, -1.0]));
        assert_eq!(inverted.failure, Some((Invalid::Inverted, 41)));
        assert!(!gone.is_clean());

        // In any order merging keeps the worst reason, its first particle, and the need of a sort.
        let other = Outcome { failure: Some((Invalid::LeftGrid, 7)), resort: false };
        for outcomes in [[moved, gone, inverted, other], [other, inverted, gone, moved]] {
            let merged = outcomes.into_iter().fold(Outcome::default(), Outcome::merge);
            assert_eq!((merged.failure, merged.resort), (inverted.failure, true));
            let found = SharedOutcome::default();
            outcomes.into_iter().for_each(|outcome| found.add(outcome));
            let all = found.all();
            assert_eq!((all.failure, all.resort), (inverted.failure, true));
        }
        assert_eq!(gone.merge(other).failure, other.failure);
        assert!(!gone.merge(other).resort && moved.merge(Outcome::default()).resort);
        assert!(SharedOutcome::default().all().is_clean());
    }
}
