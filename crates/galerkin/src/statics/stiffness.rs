//! The stiffness matrix: what forces change with coefficients.

use mmsmith_laws::Tangent;
use mmsmith_sparse::Pattern;
use mmsmith_threads::each_chunk;
use nalgebra::{SMatrix, SVector};

use super::numbering::{Numbering, joined};
use crate::basis::{Basis, ValueOrSlope};
use crate::component::{Component, along};
use crate::quadrature::Quadrature;
use crate::set_up::split;

/// Terms of a gradient at a point: the value and the slopes.
const MOST_TERMS: usize = 4;

/// Cells whose parts are formed side by side. No sum depends on it.
const AT_ONCE: usize = 32;

/// The relative size of a difference between a tangent and its transpose that is more than rounding.
const ASYMMETRY: f64 = 1e-9;

/// All that the parts of cells are formed from.
pub(super) struct Cells<'a, const D: usize> {
    pub(super) bases: &'a [[Basis; 2]; D],
    pub(super) cells: [usize; D],
    /// Points of a cell along each axis.
    pub(super) per_cell: [usize; D],
    pub(super) at: &'a Quadrature<D>,
    pub(super) numbering: &'a Numbering<D>,
    /// The tangents at the points.
    pub(super) tangents: &'a [Tangent<D>],
    /// Components with the factors of forces at the points.
    pub(super) components: &'a [Component<D>; D],
}

/// The part of a cell.
#[derive(Clone, Debug, Default)]
struct Part {
    /// Coefficients of the components, one component after the other.
    places: [Vec<usize>; 3],
    /// Column by column, as the coefficients are.
    matrix: Vec<f64>,
    /// Sums of the magnitudes of all terms of the forces.
    magnitudes: Vec<f64>,
    /// The largest entry of a tangent, and of its difference from its transpose.
    largest: [f64; 2],
    /// By component the terms of its functions at each point.
    terms: [Vec<f64>; 3],
}

/// The matrix, and what its forces are rounded by.
#[derive(Debug)]
pub(super) struct Stiffness {
    /// By place of the pattern.
    pub(super) values: Vec<f64>,
    pub(super) is_symmetric: bool,
    /// The root of the sum of squares, over the unknowns, of the sums of magnitudes of all terms in their forces.
    pub(super) magnitude: f64,
}

impl<const D: usize> Cells<'_, D> {
    /// Adds up the matrix, cell after cell.
    pub(super) fn stiffness(&self, pattern: &Pattern) -> Stiffness {
        let Self { numbering, cells, .. } = self;
        let mut values = vec![0.0; pattern.entries()];
        let mut magnitudes = vec![0.0; numbering.count];
        let mut largest = [0.0_f64; 2];
        let count: usize = cells.iter().product();
        let mut parts = vec![Part::default(); AT_ONCE.min(count)];
        for first in (0..count).step_by(AT_ONCE) {
            let here = AT_ONCE.min(count - first);
            each_chunk(&mut parts[..here], 1, &|n, part| {
                part.iter_mut().for_each(|part| self.fill(first + n, part));
            });
            for part in &parts[..here] {
                self.add(part, pattern, &mut values, &mut magnitudes);
                largest = [0, 1].map(|k| largest[k].max(part.largest[k]));
            }
        }
        Stiffness {
            values,
            is_symmetric: largest[1] <= ASYMMETRY * largest[0],
            magnitude: magnitudes.iter().map(|sum| sum * sum).sum::<f64>().sqrt(),
        }
    }

    fn add(&self, part: &Part, pattern: &Pattern, values: &mut [f64], magnitudes: &mut [f64]) {
        let unknown = &self.numbering.unknown;
        let of = |c: usize| part.places[c].iter().map(move |place| unknown[c][*place]);
        let unknowns: Vec<Option<usize>> = (0..D).flat_map(of).collect();
        for (column, entries) in unknowns.iter().zip(part.matrix.chunks_exact(unknowns.len())) {
            let Some(column) = column else { continue };
            for (row, entry) in unknowns.iter().zip(entries) {
                if let Some(place) = row.and_then(|row| pattern.place(row, *column)) {
                    values[place] += entry;
                }
            }
        }
        for (unknown, magnitude) in unknowns.iter().zip(&part.magnitudes) {
            if let Some(unknown) = unknown {
                magnitudes[*unknown] += magnitude;
            }
        }
    }

    /// Forms the part of a cell.
    fn fill(&self, cell: usize, part: &mut Part) {
        let cell = split(cell, &self.cells);
        let points = self.points(&cell);
        let terms = self.terms();
        part.largest = [0.0; 2];
        for c in 0..D {
            part.places[c].clear();
            self.numbering.in_cell(c, &cell, &mut part.places[c]);
            self.functions(c, &cell, &mut part.terms[c]);
        }
        let size: usize = part.places.iter().map(Vec::len).sum();
        part.matrix.clear();
        part.matrix.resize(size * size, 0.0);
        part.magnitudes.clear();
        part.magnitudes.resize(size, 0.0);
        for (q, &p) in points.iter().enumerate() {
            let moduli = self.moduli(p);
            let seen = [0, 1].map(|k| part.largest[k].max(moduli.largest[k]));
            part.largest = seen;
            match terms {
                1 => self.add_point::<1>(q, &moduli, part),
                2 => self.add_point::<2>(q, &moduli, part),
                3 => self.add_point::<3>(q, &moduli, part),
                _ => self.add_point::<MOST_TERMS>(q, &moduli, part),
            }
            self.add_magnitudes(q, p, part);
        }
    }

    /// The number of terms: slopes, and in curvilinear coordinates the value before them.
    fn terms(&self) -> usize {
        D + usize::from(self.at.coordinates.are_curvilinear())
    }

    /// The points of a cell, the first axis fastest.
    fn points(&self, cell: &[usize; D]) -> Vec<usize> {
        let along = self.per_cell;
        let counts: [usize; D] = std::array::from_fn(|k| self.cells[k] * along[k]);
        let place = |n: usize| {
            let at = split(n, &along);
            let index = std::array::from_fn(|k| cell[k] * along[k] + at[k]);
            joined(&index, &counts)
        };
        (0..along.iter().product()).map(place).collect()
    }

    /// The terms of a component's functions in a cell: `[q][term][function]`.
    fn functions(&self, c: usize, cell: &[usize; D], values: &mut Vec<f64>) {
        let (along_axes, terms) = (self.per_cell, self.terms());
        let skipped = D + 1 - terms;
        let bases: [&Basis; D] = std::array::from_fn(|k| along(self.bases, k, c));
        let widths = bases.map(|basis| basis.width);
        values.clear();
        for q in 0..along_axes.iter().product() {
            let at = split(q, &along_axes);
            let row = |k: usize, part| bases[k].row(cell[k] * along_axes[k] + at[k], part).1;
            let rows: [[&[f64]; 2]; D] =
                std::array::from_fn(|k| [row(k, ValueOrSlope::Value), row(k, ValueOrSlope::Slope)]);
            for term in skipped..=D {
                for function in 0..widths.iter().product() {
                    let index = split(function, &widths);
                    let factor = |k: usize| rows[k][usize::from(term == k + 1)][index[k]];
                    values.push((0..D).map(factor).product());
                }
            }
        }
    }

    /// The moduli of a point.
    fn moduli(&self, p: usize) -> Moduli {
        let Quadrature { coordinates, rows, reciprocal_radius, volume, row, .. } = self.at;
        let (tangent, at) = (&self.tangents[p], rows.get(p / row));
        let reciprocal_radius = reciprocal_radius[p % row];
        let (terms, skipped) = (self.terms(), D + 1 - self.terms());
        let mut moduli =
            Moduli { entries: [[0.0; 3 * MOST_TERMS]; 3 * MOST_TERMS], largest: [0.0; 2] };
        for (d, n) in (0..D).flat_map(|d| (0..terms).map(move |n| (d, n))) {
            let (mut u, mut slopes) = (SVector::<f64, D>::zeros(), SMatrix::<f64, D, D>::zeros());
            match (n + skipped).checked_sub(1) {
                None => u[d] = 1.0,
                Some(axis) => slopes[(d, axis)] = 1.0,
            }
            let H = match at {
                None => slopes,
                Some(at) => {
                    let H = coordinates.gradient(&u, &slopes, reciprocal_radius, at);
                    at.frame * H * at.frame.transpose()
                }
            };
            let mut P = SMatrix::<f64, D, D>::zeros();
            for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
                P += tangent[k][l] * (H[(k, l)] * volume[p]);
            }
            let (of_values, of_slopes) = match at {
                None => (SVector::zeros(), P),
                Some(at) => {
                    let local = at.frame.transpose() * P * at.frame;
                    coordinates.transposed_gradient(&local, reciprocal_radius, at)
                }
            };
            for (c, m) in (0..D).flat_map(|c| (0..terms).map(move |m| (c, m))) {
                moduli.entries[c * terms + m][d * terms + n] = match (m + skipped).checked_sub(1) {
                    None => of_values[c],
                    Some(axis) => of_slopes[(c, axis)],
                };
            }
        }
        let size = D * terms;
        for (i, j) in (0..size).flat_map(|i| (0..size).map(move |j| (i, j))) {
            let (own, other) = (moduli.entries[i][j], moduli.entries[j][i]);
            moduli.largest =
                [moduli.largest[0].max(own.abs()), moduli.largest[1].max((own - other).abs())];
        }
        moduli
    }

    /// Adds a point's part, with `M` terms of each component.
    fn add_point<const M: usize>(&self, q: usize, moduli: &Moduli, part: &mut Part) {
        let Part { places, matrix, terms, .. } = part;
        let size: usize = places.iter().map(Vec::len).sum();
        let mut column = 0;
        for d in 0..D {
            let of_d = rows::<M>(&terms[d], q, places[d].len());
            for b in 0..places[d].len() {
                let mut first = column * size;
                for c in 0..D {
                    let count = places[c].len();
                    let factors: [f64; M] = std::array::from_fn(|m| {
                        let moduli = &moduli.entries[c * M + m][d * M..][..M];
                        (0..M).map(|n| moduli[n] * of_d[n][b]).sum()
                    });
                    let of_c = rows::<M>(&terms[c], q, count);
                    add_multiples(&factors, &of_c, &mut matrix[first..first + count]);
                    first += count;
                }
                column += 1;
            }
        }
    }

    /// Adds the magnitudes of the terms that a point has in the forces.
    fn add_magnitudes(&self, q: usize, p: usize, part: &mut Part) {
        let Part { places, magnitudes, terms, .. } = part;
        let (count, skipped) = (self.terms(), D + 1 - self.terms());
        let mut first = 0;
        for c in 0..D {
            let functions = places[c].len();
            let component = &self.components[c];
            for (m, row) in terms[c][q * count * functions..][..count * functions]
                .chunks_exact(functions)
                .enumerate()
            {
                let force = match (m + skipped).checked_sub(1) {
                    None => component.values[p],
                    Some(axis) => component.slopes[axis][p],
                };
                let sums = &mut magnitudes[first..first + functions];
                sums.iter_mut().zip(row).for_each(|(sum, term)| *sum += (term * force).abs());
            }
            first += functions;
        }
    }
}

/// The moduli between the terms of two components, `[c terms + m][d terms + n]`, times the volume of a point.
struct Moduli {
    entries: [[f64; 3 * MOST_TERMS]; 3 * MOST_TERMS],
    largest: [f64; 2],
}

/// The terms of a component's functions at a point.
fn rows<const M: usize>(terms: &[f64], q: usize, functions: usize) -> [&[f64]; M] {
    std::array::from_fn(|m| &terms[(q * M + m) * functions..][..functions])
}

/// `sums += factors[0] rows[0] + factors[1] rows[1] + ...`
#[inline(always)]
fn add_multiples<const M: usize>(factors: &[f64; M], rows: &[&[f64]; M], sums: &mut [f64]) {
    let rows: [&[f64]; M] = std::array::from_fn(|m| &rows[m][..sums.len()]);
    for a in 0..sums.len() {
        let mut sum = sums[a];
        for m in 0..M {
            sum += factors[m] * rows[m][a];
        }
        sums[a] = sum;
    }
}
