//! Particles that share corners go to the processes of the layers of these.
//!
//! The process of its first corner holds a particle, and gives it to all others that have corners of it: see
//! [`corner_halo`](crate::processes::corner_halo).

use std::sync::Arc;

use mmsmith_lanes::simd::Lanes;

use crate::domain::shared_corners::SharedCorners;
use crate::processes::corner_halo::CornerHalo;
use crate::processes::decomposition::Owned;
use crate::step::state::State;
use mmsmith_particles::mesh::Mesh;
use mmsmith_particles::mesh::part::{LoadRecords, Records};
use mmsmith_ranks::{Lists, Move};

impl<T: Lanes, const D: usize> State<T, D> {
    /// Gives every particle to the processes of its corners, of which `keys` has the tiles. Gives those of the corners that this
    /// process sorts then.
    pub(super) fn give_mesh(&mut self, keys: &[u32]) -> Vec<u32> {
        let (Some(part), Some(corners)) = (&mut self.part, &self.corners) else {
            return keys.to_vec();
        };
        let corners = &corners.shared;
        let (known, mesh) = (part.ids.clone(), &corners.mesh);
        let is_own = |corner: u32| (corner as usize) < corners.own();
        let first_corner = |p: usize| mesh.corners[mesh.places(p).start];

        let layer_of = |corner: u32| self.grid.bins.tiles().layer_of(keys[corner as usize]);
        let mut counts = vec![0_u64; self.grid.bins.tiles().layers()];
        for corner in (0..known.len()).map(first_corner).filter(|corner| is_own(*corner)) {
            counts[layer_of(corner)] += 1;
        }
        let held = part.cut(counts);
        let part = &*part;
        let holders = |corners: &[u32]| -> Vec<usize> {
            let mut holders: Vec<usize> =
                corners.iter().map(|&c| part.holder(layer_of(c))).collect();
            holders.sort_unstable();
            holders.dedup();
            holders
        };
        let of_particles: Vec<Vec<usize>> = (0..known.len())
            .map(|p| match is_own(first_corner(p)) {
                true => holders(&mesh.corners[mesh.places(p)]),
                false => Vec::new(),
            })
            .collect();
        let loads: Vec<usize> =
            (0..mesh.loads.len()).filter(|&load| is_own(mesh.loads[load].corners[0])).collect();
        let of_loads: Vec<Vec<usize>> =
            loads.iter().map(|&load| holders(&mesh.loads[load].corners)).collect();

        let loads = LoadRecords::new(mesh, &loads);
        let (moved, numbers) =
            Move::new(Some(&part.ranks), loads.numbers(), &|load| &of_loads[load]);
        let loads = loads.follow(&moved, numbers);
        let records = Records::new(mesh, 0..known.len());
        let keys = Lists::new((0..known.len()).map(|p| {
            let corners = &mesh.corners[mesh.places(p)];
            corners.iter().map(|&corner| keys[corner as usize])
        }));
        let (kind, at_corner) = ((mesh.interpolation, mesh.turn), corners.at_corner);
        let Some(moved) = self.give(&|p| &of_particles[p]) else { return Vec::new() };
        let (records, keys) = (records.follow(&moved), moved.lists(&keys));

        let layer = |p: usize, place: usize| self.grid.bins.tiles().layer_of(keys.of(p)[place]);
        let is_other = |p: usize, place: usize| !held.contains(&layer(p, place));
        let (mesh, places) = records.assemble(moved.len(), &loads, kind, is_other);
        let own = places.iter().filter(|[p, place]| !is_other(*p, *place)).count();
        let own_keys = places[..own].iter().map(|&[p, place]| keys.of(p)[place]).collect();
        let halo = self.part.as_mut().zip(mesh.numbers.as_ref()).map(|(part, numbers)| {
            part.own = Some(own_particles(&mesh, own, &part.ids));
            let (own, others) = numbers.corners.split_at(own);
            let holders =
                places[own.len()..].iter().map(|&[p, place]| part.holder(layer(p, place)));
            CornerHalo::new(&part.ranks, own, others, holders)
        });
        let ids = self.part.as_ref().map_or_else(Default::default, |part| part.ids.clone());
        if let Some(corners) = &mut self.corners {
            corners.replace(SharedCorners::of_part(mesh, at_corner, &ids, (own, halo)));
        }
        self.grid.hold(held, own);
        own_keys
    }
}

/// The particles whose first corner is among those that this process sorts, the first `own` ones.
fn own_particles<T, const D: usize>(mesh: &Mesh<T, D>, own: usize, ids: &[u64]) -> Owned
where
    T: Lanes,
{
    let is_own = |p: &usize| (mesh.corners[mesh.places(*p).start] as usize) < own;
    let places: Vec<u32> = (0..ids.len()).filter(is_own).map(|p| p as u32).collect();
    let ids = places.iter().map(|&p| ids[p as usize]).collect();
    Owned { places, ids: Arc::new(ids) }
}
