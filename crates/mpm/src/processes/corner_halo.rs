//! Corners of polygons that other processes sort: their values come from there.
//!
//! A process has the corners of its bins, and all particles at them. A particle whose corners are of several processes is at each of them,
//! and each computes the same of it, to the bit. The values of the grid at a corner are known where its layer is; the others are told.

use std::sync::Arc;

use mmsmith_lanes::simd::Lanes;
use mmsmith_ranks::{Ranks, announce, exchange};
use nalgebra::SVector;

use crate::domain::corner_values::CornerValues;
use crate::grid::node::Node;

/// Which values come from other processes, and which go there.
pub(crate) struct CornerHalo {
    ranks: Arc<dyn Ranks>,
    /// The corners here whose values each process gets.
    out: Vec<Vec<u32>>,
    /// The corners here whose values come from each.
    come: Vec<Vec<u32>>,
}

impl CornerHalo {
    /// Where the first corners, of the numbers `own` in the whole body, ascending, are sorted here, and those of the numbers `others` that
    /// follow by the processes `holders`. A call of all.
    pub(crate) fn new(
        ranks: &Arc<dyn Ranks>,
        own: &[u64],
        others: &[u64],
        holders: impl Iterator<Item = usize>,
    ) -> Self {
        let mut wanted = vec![Vec::new(); ranks.count()];
        let mut come = vec![Vec::new(); ranks.count()];
        for ((corner, &number), holder) in (own.len() as u32..).zip(others).zip(holders) {
            wanted[holder].push(number);
            come[holder].push(corner);
        }
        let counts: Vec<usize> = wanted.iter().map(Vec::len).collect();
        let asked = announce(&**ranks, &counts);
        let mut numbers = exchange(&**ranks, &wanted, &asked).into_iter();
        let place = |number: u64| own.partition_point(|own| *own < number) as u32;
        let out = asked.iter().map(|&count| numbers.by_ref().take(count).map(place).collect());
        Self { ranks: ranks.clone(), out: out.collect(), come }
    }

    /// Puts the two vectors and the moments in place at the corners that other processes sort; a call of all.
    pub(crate) fn exchange<T: Lanes, const D: usize>(&self, values: &mut CornerValues<T, D>) {
        let Self { ranks, out, come } = self;
        let CornerValues { nodes, moments } = values;
        let per_corner = if moments.is_empty() { 2 * D } else { 2 * D + D * D };
        let of = |corners: &Vec<u32>| {
            let mut numbers = Vec::with_capacity(per_corner * corners.len());
            for &corner in corners {
                let node = &nodes[corner as usize];
                numbers.extend(&node.values[..D]);
                numbers.extend(&node.second());
                let moments = moments.get(corner as usize).into_iter().flatten();
                moments.for_each(|along| numbers.extend(&along.0[..D]));
            }
            numbers
        };
        let out: Vec<Vec<T>> = out.iter().map(of).collect();
        let counts: Vec<usize> = come.iter().map(|corners| per_corner * corners.len()).collect();
        let numbers = exchange(&**ranks, &out, &counts);
        for (&corner, numbers) in come.iter().flatten().zip(numbers.chunks(per_corner)) {
            let vector = |first: usize| SVector::from_fn(|a, _| numbers[first + a]);
            nodes[corner as usize] = Node::new(&vector(0), &vector(D), T::zero());
            if let Some(moments) = moments.get_mut(corner as usize) {
                for (along, numbers) in moments.iter_mut().zip(numbers[2 * D..].chunks(D)) {
                    along.0[..D].copy_from_slice(numbers);
                }
            }
        }
    }
}

impl std::fmt::Debug for CornerHalo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { out, come, .. } = self;
        f.debug_struct("CornerHalo").field("out", out).field("come", come).finish_non_exhaustive()
    }
}
