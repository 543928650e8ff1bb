//! Particles go to the process of their bin.

use std::collections::HashMap;
use std::ops::Range;

use bytemuck::cast_slice;
use mmsmith_ranks::{announce, gather, share};
use nalgebra::{SMatrix, SVector};

use crate::body::Mesh;
use crate::decomposition::{Move, UNEVEN, cuts, unevenness};
use crate::domain::HalfEdges;
use crate::node::Node;
use crate::parallel::coloring::Held;
use crate::particles::Particles;
use crate::simd::Lanes;
use crate::state::State;
use crate::support::Support;

impl<T: Lanes, const D: usize> State<T, D> {
    /// Gives every particle to the process of its bin, `bin_of(particle)`.
    pub(crate) fn redistribute(&mut self) {
        let Self { particles, constants, layout, bins, support, part, .. } = self;
        let Some(part) = part else { return };
        let ranks = part.ranks.clone();
        let rows = bins.rows();
        let bin_of: Vec<usize> = {
            let Particles { x, F, .. } = &*particles;
            let first_node = |p| support.first_node(constants, p, &x[p], &F[p]);
            (0..x.len()).map(|p| rows.bin_of(first_node(p) / layout.row())).collect()
        };
        let mut counts = vec![0_u64; rows.count()];
        bin_of.iter().for_each(|&bin| counts[bin] += 1);
        let all = gather(&*ranks, &counts);
        let mut new: Vec<u64> = vec![0; ranks.count() + 1];
        if ranks.rank() == 0 {
            for (bin, count) in counts.iter_mut().enumerate() {
                *count = all.iter().skip(bin).step_by(rows.count()).sum();
            }
            let cuts = match part.cuts.as_slice() {
                [_, ..] if unevenness(&counts, &part.cuts) <= UNEVEN => part.cuts.clone(),
                _ => cuts(&counts, ranks.count()),
            };
            new = cuts.into_iter().map(|cut| cut as u64).collect();
        }
        share(&*ranks, 0, &mut new);
        part.cuts = new.into_iter().map(|cut| cut as usize).collect();
        part.version += 1;

        let mut out = vec![Vec::new(); ranks.count()];
        for (p, &bin) in bin_of.iter().enumerate() {
            out[part.cuts.partition_point(|&cut| cut <= bin) - 1].push(p as u32);
        }
        let stay = std::mem::take(&mut out[ranks.rank()]);
        let lengths: Vec<usize> = out.iter().map(Vec::len).collect();
        let counts = announce(&*ranks, &lengths);
        let first = bin_of.len() as u32;
        let come = first..first + counts.iter().sum::<usize>() as u32;
        let order = stay.into_iter().chain(come).collect();
        let mut moved = Move { ranks: &*ranks, out, counts, order };
        let ids = moved.all(&part.ids);
        let mut by_id: Vec<u32> = (0..ids.len() as u32).collect();
        by_id.sort_unstable_by_key(|&place| ids[place as usize]);
        moved.order = by_id.iter().map(|&place| moved.order[place as usize]).collect();
        part.ids = by_id.iter().map(|&place| ids[place as usize]).collect();
        drop((ids, by_id));
        let Particles { X, x, v, F, mass, volume, half_size: _ } = particles;
        [X, x, v].into_iter().for_each(|vectors| moved.replace(vectors));
        moved.replace(F);
        [&mut *mass, &mut *volume].into_iter().for_each(|numbers| moved.replace(numbers));
        let count = x.len();
        match support {
            Support::Product(_) | Support::Polygons(_) => {}
            Support::Cpdi { half_edges } => {
                let each: Vec<_> = (0..bin_of.len()).map(|p| *half_edges.of(p)).collect();
                *half_edges = HalfEdges::new(moved.all(&each));
            }
            Support::Cpdi2 { mesh, next } => {
                *mesh = move_corners(mesh, &moved);
                next.clone_from(&mesh.x);
            }
        }
        if part.is_affine {
            moved.replace(&mut self.affine);
        }
        if self.keeps_F_early {
            self.F_early.resize(count, SMatrix::identity());
        }
        let (first_mass, first_volume) = (mass.first().copied(), volume.first().copied());
        self.uniform = first_mass.zip(first_volume).filter(|(m, V)| {
            mass.iter().all(|mass| mass == m) && volume.iter().all(|volume| volume == V)
        });

        let own = part.cuts[ranks.rank()]..part.cuts[ranks.rank() + 1];
        let held = Held { bands: own, all: rows.count() };
        let rows: Range<usize> = rows.rows_of(&held, layout.dims[D - 1]);
        self.bins.hold(held, count);
        if rows != layout.rows() {
            layout.hold(rows);
            constants.nodes_before = (layout.first_row * layout.row()) as f64;
            let resize = |nodes: &mut Vec<Node<T, D>>| {
                if !nodes.is_empty() {
                    *nodes = vec![Node::zero(); layout.nodes];
                }
            };
            [&mut self.nodes, &mut self.reprojected, &mut self.next].into_iter().for_each(resize);
            if !self.filtered.is_empty() {
                self.filtered = vec![SVector::zeros(); layout.nodes];
            }
        }
    }
}

/// The corners of the particles that come; neighbours share them as before.
fn move_corners<T: Lanes, const D: usize>(mesh: &Mesh<T, D>, moved: &Move<'_>) -> Mesh<T, D> {
    let mut new = Mesh::default();
    let count = moved.order.len();
    new.corners = vec![[0; 8]; count];
    // Corners are one where their reference positions are, which all processes have computed alike.
    let mut known: HashMap<Vec<u8>, u32> = HashMap::new();
    for corner in 0..1 << D {
        let of_particle = |positions: &[SVector<T, D>]| -> Vec<SVector<T, D>> {
            mesh.corners.iter().map(|corners| positions[corners[corner] as usize]).collect()
        };
        let (X, x) = (moved.all(&of_particle(&mesh.X)), moved.all(&of_particle(&mesh.x)));
        for (p, (X, x)) in X.into_iter().zip(x).enumerate() {
            let key = cast_slice::<T, u8>(X.as_slice()).to_vec();
            let place = *known.entry(key).or_insert_with(|| {
                new.X.push(X);
                new.x.push(x);
                new.X.len() as u32 - 1
            });
            new.corners[p][corner] = place;
        }
    }
    new
}
