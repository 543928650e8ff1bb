//! P2G and G2P for blocks of particles.
//!
//! A [`block`] has the weights of 64 particles, whose data lie side by side in [`copies`]. Weights that are products over the axes
//! come from [`product`], which hands the sums over nodes to [`lanes_plane`] in one and two dimensions, to [`lanes_space`] in three,
//! and to [`any`] for the extended support of a large GIMP box. Those of radius and height in [`revolving`] are such products, too. CPDI has weights and sums of its own in
//! [`cpdi`];
//! domains on shared corners, those of CPDI2 among them, have theirs in [`shared`],
//! and these corners, where they reach nodes by hat functions, in [`points`]. Passes take both from [`buffers`], which outlive them.
//! [`any`] also defines the values on either side: [`Contributions`](any::Contributions) to the grid,
//! [`Interpolated`](any::Interpolated) values from it.

pub(crate) mod advance;
pub(crate) mod any;
pub(crate) mod block;
pub(crate) mod buffers;
pub(crate) mod copies;
pub(crate) mod cpdi;
pub(crate) mod half_plane;
mod lanes_plane;
mod lanes_space;
pub(crate) mod points;
pub(crate) mod prefetch;
pub(crate) mod product;
pub(crate) mod projected;
pub(crate) mod revolving;
pub(crate) mod shared;

/// Ends the run: a weight, a block or a node is not the one that the code around it has prepared. Checks of particles and layers rule it out;
/// sums that lack a part would be worse than no result.
#[cold]
#[inline(never)]
pub(crate) fn beyond(what: &str) -> ! {
    panic!("{what}: a fault of the solver, not of the scene")
}

/// The nodes of a row from a place on.
///
/// The place is compared with the last at which a row can begin: a single comparison, from which the compiler knows that the row is inside.
#[inline(always)]
pub(crate) fn nodes_from<'a, N, const W: usize>(
    nodes: &'a [N],
    place: usize,
    what: &str,
) -> &'a [N; W] {
    match nodes.len().checked_sub(W - 1) {
        Some(end) if place < end => match nodes.get(place..).and_then(|n| n.first_chunk()) {
            Some(row) => row,
            None => beyond(what),
        },
        _ => beyond(what),
    }
}

/// As [`nodes_from`], to be changed.
#[inline(always)]
pub(crate) fn nodes_from_mut<'a, N, const W: usize>(
    nodes: &'a mut [N],
    place: usize,
    what: &str,
) -> &'a mut [N; W] {
    match nodes.len().checked_sub(W - 1) {
        Some(end) if place < end => {
            match nodes.get_mut(place..).and_then(|n| n.first_chunk_mut()) {
                Some(row) => row,
                None => beyond(what),
            }
        }
        _ => beyond(what),
    }
}
