//! Shape functions: weights of particles at the nodes, and the cells that they are means over.

pub(crate) mod cells;
pub(crate) mod one_axis;
pub(crate) mod weights;
