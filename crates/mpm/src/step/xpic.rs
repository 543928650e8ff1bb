//! The filter of XPIC: the part of the grid's velocity that particles take.
//!
//! ```text
//! sum_k (-1)^(k+1) binomial(m, k) (S^+ S)^(k-1) v,   S from the grid to particles, S^+ from particles to the grid
//! ```
//!
//! Source: Hammerquist and Nairn, CMAME 318 (2017) 724-738.

use mmsmith_lanes::simd::Lanes;
use mmsmith_lanes::tensor::real;
use mmsmith_laws::fault::Fault;
use nalgebra::SVector;

use crate::grid::node::Node;
use crate::scheme::Filter;
use crate::step::state::State;
use mmsmith_threads::each_chunk;

/// Nodes handed to a thread at a time.
const CHUNK: usize = 1024;

impl<T: Lanes, const D: usize> State<T, D> {
    /// From nodes with the velocity `v` at the start of the step and the acceleration `a` to nodes with `v + dt a` and
    /// `filtered v + dt a`.
    pub(crate) fn filter(&mut self, Filter { order }: Filter) {
        let planted = self.grid.constants.planted;
        let m = f64::from(order);
        let mut factor = m;
        let mut filtered = std::mem::take(&mut self.grid.filtered);
        filtered.clear();
        filtered.extend(self.grid.nodes.iter().map(|node| velocity(node) * real::<T>(factor)));
        for k in 2..=order {
            self.p2g_g2p_velocity(k == 2);
            std::mem::swap(&mut self.grid.reprojected, &mut self.grid.next);
            let k = f64::from(k);
            let sign = if planted.is(Fault::XpicSign) { 1.0 } else { -1.0 };
            factor *= sign * (m - k + 1.0) / k;
            let (terms, factor) = (&self.grid.reprojected, real::<T>(factor));
            each_chunk(&mut filtered, CHUNK, &|chunk, sums| {
                for (sum, term) in sums.iter_mut().zip(&terms[chunk * CHUNK..]) {
                    *sum += velocity(term) * factor;
                }
            });
        }
        let dt = self.grid.constants.time_step;
        each_chunk(&mut self.grid.nodes, CHUNK, &|chunk, nodes| {
            for (node, filtered) in nodes.iter_mut().zip(&filtered[chunk * CHUNK..]) {
                for a in 0..D {
                    let change = node.second()[a] * dt;
                    node.values[a] += change;
                    node.second_mut()[a] = filtered[a] + change;
                }
            }
        });
        self.grid.filtered = filtered;
    }
}

fn velocity<T: Lanes, const D: usize>(node: &Node<T, D>) -> SVector<T, D> {
    SVector::from_fn(|a, _| node.values[a])
}
