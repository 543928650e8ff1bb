//! Particles that share corners go to the processes of the tiles of these.
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
use mmsmith_particles::mesh::part::LoadRecords;
use mmsmith_ranks::{Lists, Move};

impl<T: Lanes, const D: usize> State<T, D> {
    /// Gives every particle to the processes of its corners, of which `keys` has the tiles. Gives those of the corners that this
    /// process sorts then.
    pub(super) fn give_mesh(&mut self, keys: &[u32]) -> Vec<u32> {
        let (Some(part), Some(corners)) = (&mut self.part, &mut self.corners) else {
            return keys.to_vec();
        };
        let (own, at_corner) = (corners.shared.own(), corners.shared.at_corner);
        // The rest of what belongs to the corners is freed before others are put in their place.
        let mesh = corners.take_mesh();
        let particles = part.ids.len();
        let is_own = |corner: u32| (corner as usize) < own;
        let first_corner = |p: usize| mesh.corners[mesh.places(p).start];

        let tiles = *self.grid.bins.tiles();
        let first_corners = (0..particles).map(first_corner).filter(|corner| is_own(*corner));
        let held = part.cut(&tiles, first_corners.map(|corner| keys[corner as usize]));
        let part = &*part;
        let holder = |corner: u32| part.holder(keys[corner as usize]);
        let holders = |corners: &[u32]| -> Vec<usize> {
            let mut holders: Vec<usize> = corners.iter().map(|&corner| holder(corner)).collect();
            holders.sort_unstable();
            holders.dedup();
            holders
        };
        let of_particles = Lists::new((0..particles).map(|p| match is_own(first_corner(p)) {
            true => holders(mesh.of_particle(p)),
            false => Vec::new(),
        }));
        let loads: Vec<usize> =
            (0..mesh.loads.len()).filter(|&load| is_own(mesh.loads[load].corners[0])).collect();
        let of_loads = Lists::new(loads.iter().map(|&load| holders(&mesh.loads[load].corners)));

        let loads = LoadRecords::new(&mesh, &loads);
        let (moved, numbers) =
            Move::new(Some(&part.ranks), loads.numbers(), &|load| of_loads.of(load));
        let loads = loads.follow(&moved, numbers);
        let Some(moved) = self.give(&|p| of_particles.of(p)) else { return Vec::new() };
        drop(of_particles);
        let Some(part) = &mut self.part else { return Vec::new() };
        let is_other = |tile: u32| part.holder(tile) != part.ranks.rank();
        let followed = mesh.follow(&moved, keys, &loads, is_other);
        drop(mesh);
        let (mesh, mut keys) = followed;
        let own = keys.partition_point(|tile| !is_other(*tile));
        let halo = mesh.numbers.as_ref().map(|numbers| {
            let (known, others) = numbers.corners.split_at(own);
            let holders = keys[own..].iter().map(|&tile| part.holder(tile));
            CornerHalo::new(&part.ranks, known, others, holders)
        });
        part.own = Some(own_particles(&mesh, own, &part.ids));
        if let Some(corners) = &mut self.corners {
            corners.replace(SharedCorners::of_part(mesh, at_corner, &part.ids, (own, halo)));
        }
        self.grid.hold(held, own);
        keys.truncate(own);
        keys
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
