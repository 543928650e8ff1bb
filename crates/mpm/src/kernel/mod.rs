//! P2G and G2P for blocks of particles.
//!
//! [`block`] computes the weights of 64 particles at once and hands their sums over nodes to one of four kernels:
//! [`lanes_plane`] in one and two dimensions, [`lanes_space`] in three, [`any`] for the extended support of a large GIMP box, and
//! [`corners`] for CPDI and CPDI2, whose weights are no products over the axes.
//! [`any`] also defines the values on either side: [`Contributions`](any::Contributions) to the grid,
//! [`Interpolated`](any::Interpolated) values from it.

pub(crate) mod any;
pub(crate) mod block;
pub(crate) mod corners;
mod lanes_plane;
mod lanes_space;
