use super::*;
use std::array;

use crate::kernel::block::tests::{constants, noise};

/// Boxes may grow and shrink again from one time that a block is used to the next.
#[test]
fn particles_of_a_block_exchange_what_their_boxes_cover_however_many_have_extended_support() {
    fn check<const D: usize, const AFFINE: bool>(on_axis: OnAxis) {
        let (c, nodes) = constants::<D>();
        let reference = SVector::repeat(0.25);
        let shape = ProductShape { on_axis, l: reference };
        let x: [_; BLOCK] =
            array::from_fn(|k| SVector::from_fn(|a, _| 2.0 + 1.2 * noise(5 * k + a)));
        let grid: Vec<Node<f64, D>> = (0..nodes)
            .map(|n| Node { values: array::from_fn(|q| noise(8 * n + q + 1000)) })
            .collect();
        let mut contributions = Contributions::<f64, D, BLOCK>::zero();
        for k in 0..BLOCK {
            let of = |from: usize| SVector::from_fn(|a, _| noise(3 * k + a + from));
            contributions.value[k] = Node::new(&of(50), &of(700), 1.0 + 0.5 * noise(k));
            contributions.stress_flux[k] = SMatrix::from_fn(|i, j| noise(9 * k + 3 * i + j + 2000));
            contributions.affine[k] = SMatrix::from_fn(|i, j| noise(7 * k + 3 * i + j + 3000));
        }
        let mut block = ProductWeights::new(&shape, AFFINE);
        for extended in [vec![], vec![0], vec![5, BLOCK - 1], (0..BLOCK).collect(), vec![]] {
            let F: [SMatrix<f64, D, D>; BLOCK] = array::from_fn(|k| {
                let mut F = SMatrix::identity();
                if extended.contains(&k) {
                    // Boxes of up to two cells, and larger ones.
                    F[(k % D, k % D)] = if k % 3 == 0 { 5.0 } else { 3.0 } + noise(k);
                }
                F
            });
            block.compute(&c, &[], Kinematics { x: &x, F: &F });
            let exact = |k: usize| {
                let l = array::from_fn(|a| shape.half_size(a, F[k][(a, a)]));
                let xi = c.in_cells(&x[k]);
                ExtendedWeights::<_, D, AFFINE>::new(on_axis, &xi, &l, (&c.strides, 0))
            };
            for count in [BLOCK, 41] {
                let mut interpolated = [Interpolated::zero(); BLOCK];
                block.g2p(&c.strides, &grid, &mut interpolated[..count]);
                for k in 0..count {
                    let alone = g2p::<_, _, D, EXTENDED>(&exact(k), &c.strides, &grid);
                    let off = (interpolated[k].velocity - alone.velocity).amax();
                    assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                    let off = (interpolated[k].second - alone.second).amax();
                    assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                    let off = (interpolated[k].velocity_gradient - alone.velocity_gradient).amax();
                    assert!(off < 1e-13, "{extended:?} {k} {off:e}");
                    // Divided by an inertia of some hundredths of a cell.
                    let off = (interpolated[k].affine - alone.affine).amax();
                    assert!(off < 1e-11, "{extended:?} {k} {off:e}");
                }
                assert!(interpolated[count..].iter().all(|own| own.velocity.amax() == 0.0));

                let mut sums = vec![Node::zero(); nodes];
                let mut one_by_one = sums.clone();
                block.p2g(&c.strides, &mut sums, &contributions, count);
                for k in 0..count {
                    p2g::<_, _, D, EXTENDED, BLOCK>(
                        &exact(k),
                        &c.strides,
                        &mut one_by_one,
                        (&contributions, k),
                    );
                }
                for (a, b) in sums.iter().zip(&one_by_one) {
                    for (a, b) in a.values.iter().zip(&b.values) {
                        assert!((a - b).abs() < 1e-12, "{extended:?} {a} {b}");
                    }
                }
            }
        }
    }
    for on_axis in [OnAxis::StretchingBox, OnAxis::QuadraticMean] {
        check::<1, false>(on_axis);
        check::<2, false>(on_axis);
        check::<3, false>(on_axis);
        check::<1, true>(on_axis);
        check::<2, true>(on_axis);
        check::<3, true>(on_axis);
    }
}
