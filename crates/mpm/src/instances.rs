//! The simulations in all dimensions and precisions, compiled with this crate.
//!
//! Builds that are hardly optimised share instances of generic code between crates: with these here, no command and no test
//! compiles all kernels once more. Optimised builds share none, and would only compile them twice.

use std::hint::black_box;

use crate::Simulation;
use crate::general::General;
use crate::total_lagrangian::TotalLagrangian;

#[used]
static INSTANCES: fn() = instances;

fn instances() {
    in_dimensions::<1>();
    in_dimensions::<2>();
    in_dimensions::<3>();
}

fn in_dimensions<const D: usize>() {
    black_box(Simulation::<f64, D>::new as fn(_, _, _, _) -> _);
    black_box(Simulation::<f64, D>::step as fn(_, _) -> _);
    black_box(Simulation::<f32, D>::new as fn(_, _, _, _) -> _);
    black_box(Simulation::<f32, D>::step as fn(_, _) -> _);
    black_box(General::<D>::new as fn(_, _, _, _) -> _);
    black_box(General::<D>::step as fn(_, _) -> _);
    black_box(TotalLagrangian::<D>::new as fn(_, _, _, _, _) -> _);
    black_box(TotalLagrangian::<D>::start as fn(_, _, _) -> _);
    black_box(TotalLagrangian::<D>::step as fn(_, _) -> _);
    black_box(TotalLagrangian::<D>::observe as fn(_) -> _);
}
