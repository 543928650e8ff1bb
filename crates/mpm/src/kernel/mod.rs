//! P2G and G2P for blocks of particles.
//!
//! [`block`] computes the weights of 64 particles at once and hands their sums over nodes to one of three kernels:
//! [`lanes_plane`] in one and two dimensions, [`lanes_space`] in three, and [`any`] for the extended support of a large GIMP box.
//! [`any`] also defines the values on either side: [`Contributions`](any::Contributions) to the grid,
//! [`Interpolated`](any::Interpolated) values from it.

pub(crate) mod any;
pub(crate) mod block;
mod lanes_plane;
mod lanes_space;
