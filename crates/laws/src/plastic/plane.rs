//! Return maps in the plane and on a line: the elastic deformation is a block of two by two and a stretch across, whose logarithms have
//! closed forms.
//!
//! The eigenvalues of the block over the root of its determinant are `exp(theta)` and its inverse, so that with
//! `m = ln(det)/2` the logarithm of the block is `m I + theta/sinh(theta) dev(b)/sqrt(det)`. A return changes `theta`, `m` and the
//! logarithm across by factors alone, and the block it leads to is a combination of `b` and `I`.

use mmsmith_scalar_functions::ScalarFunctions;
use mmsmith_scalar_functions::logarithm::ln_of_both_in_range;

use super::multiplier::Yield;
use crate::BLOCK;
use crate::fault::Fault;

/// A tensor with the axis across among its principal ones: its entries 11, 22, 12 and 33.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sym {
    pub(super) a: [f64; 2],
    pub(super) shear: f64,
    pub(super) across: f64,
}

/// A deformation gradient in the plane, by rows.
pub(super) type F2 = [[f64; 2]; 2];

/// The elastic deformation `b = F G F^T` by its logarithm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elastic {
    /// Half the difference of the first two entries, and the shear, over the root of the block's determinant.
    deviator: [f64; 2],
    /// The root of the determinant of the block.
    root: f64,
    /// `theta`, and its hyperbolic sine.
    theta: f64,
    sinh: f64,
    /// Half the logarithm of the determinant of the block.
    mean: f64,
    /// The logarithm across.
    across: f64,
}

impl Elastic {
    #[inline(always)]
    pub(super) fn new(F: &F2, G: &Sym) -> Self {
        let [[f11, f12], [f21, f22]] = *F;
        let [g11, g22] = G.a;
        // F G, and the block of its product with F^T.
        let (p11, p12) = (f11 * g11 + f12 * G.shear, f11 * G.shear + f12 * g22);
        let (p21, p22) = (f21 * g11 + f22 * G.shear, f21 * G.shear + f22 * g22);
        let (b11, b22) = (p11 * f11 + p12 * f12, p21 * f21 + p22 * f22);
        let b12 = p11 * f21 + p12 * f22;
        // The determinant of a product, in which less cancels than in that of the block.
        let J = f11 * f22 - f12 * f21;
        let det = J * J * (g11 * g22 - G.shear * G.shear);
        let root = det.sqrt();
        let deviator = [0.5 * (b11 - b22) / root, b12 / root];
        let sinh = (deviator[0] * deviator[0] + deviator[1] * deviator[1]).sqrt();
        let cosh = (1.0 + sinh * sinh).sqrt();
        let grown = sinh + sinh * sinh / (1.0 + cosh);
        Self {
            deviator,
            root,
            theta: ln_of_both_in_range(grown, 1.0 + grown),
            sinh,
            mean: 0.5 * ln_of_both_in_range(det - 1.0, det),
            across: ln_of_both_in_range(G.across - 1.0, G.across),
        }
    }

    /// `theta/sinh(theta)`.
    #[inline(always)]
    fn factor(&self) -> f64 {
        if self.sinh > 0.0 { self.theta / self.sinh } else { 1.0 }
    }

    /// The trace of the logarithm.
    #[inline(always)]
    fn trace(&self) -> f64 {
        2.0 * self.mean + self.across
    }

    /// The deviator of the logarithm across. In the plane its mean is half as large, with the other sign.
    #[inline(always)]
    fn deviator_across(&self) -> f64 {
        self.across - self.trace() / 3.0
    }

    /// `|dev ln b|`.
    #[inline(always)]
    pub(super) fn size(&self) -> f64 {
        let across = self.deviator_across();
        (2.0 * self.theta * self.theta + 1.5 * across * across).sqrt()
    }

    /// `tau = lambda/2 tr(ln b) I + mu ln b`.
    #[inline(always)]
    pub(super) fn kirchhoff(&self, lambda: f64, mu: f64) -> Sym {
        let pressure = 0.5 * lambda * self.trace();
        let (normal, factor) = (pressure + mu * self.mean, mu * self.factor());
        let difference = factor * self.deviator[0];
        Sym {
            a: [normal + difference, normal - difference],
            shear: factor * self.deviator[1],
            across: pressure + mu * self.across,
        }
    }

    /// The direction of the flow: `dev ln b` over its size, as the mean in the plane, the entries of the rest there, the size of that rest,
    /// and the entry across.
    fn direction(&self) -> Direction {
        let size = self.size();
        let scale = self.factor() / size;
        let across = self.deviator_across() / size;
        Direction {
            mean: -0.5 * across,
            deviator: self.deviator.map(|entry| scale * entry),
            size: self.theta / size,
            across,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Direction {
    mean: f64,
    deviator: [f64; 2],
    size: f64,
    across: f64,
}

/// The hyperbolic sine; by its series where numbers are small, up to one.
#[inline(always)]
fn sinh<const SMALL: bool>(x: f64) -> f64 {
    /// `1/((2 k)(2 k + 1))` from the last term that counts to the first.
    const QUOTIENTS: [f64; 8] = [
        1.0 / (16.0 * 17.0),
        1.0 / (14.0 * 15.0),
        1.0 / (12.0 * 13.0),
        1.0 / (10.0 * 11.0),
        1.0 / (8.0 * 9.0),
        1.0 / (6.0 * 7.0),
        1.0 / (4.0 * 5.0),
        1.0 / (2.0 * 3.0),
    ];
    if !SMALL {
        return libm::sinh(x);
    }
    let square = x * x;
    x * QUOTIENTS.iter().fold(1.0, |sum, quotient| 1.0 + sum * (square * quotient))
}

/// The exponential.
#[inline(always)]
fn exp<const SMALL: bool>(x: f64) -> f64 {
    if !SMALL {
        return x.exponential();
    }
    let sinh = sinh::<true>(x);
    sinh + (1.0 + sinh * sinh).sqrt()
}

/// `sinh(x)/y`, or `otherwise` where `y` is zero.
#[inline(always)]
fn sinh_over<const SMALL: bool>(x: f64, y: f64, otherwise: f64) -> f64 {
    if y > 0.0 { sinh::<SMALL>(x) / y } else { otherwise }
}

/// Elastic deformations side by side.
pub(super) struct Elastics {
    deviator: [[f64; BLOCK]; 2],
    root: [f64; BLOCK],
    theta: [f64; BLOCK],
    sinh: [f64; BLOCK],
    mean: [f64; BLOCK],
    across: [f64; BLOCK],
    pub(super) size: [f64; BLOCK],
}

impl Elastics {
    const ROW: [f64; BLOCK] = [0.0; BLOCK];
    /// Without deformation.
    pub(super) const AT_REST: Self = Self {
        deviator: [Self::ROW; 2],
        root: [1.0; BLOCK],
        theta: Self::ROW,
        sinh: Self::ROW,
        mean: Self::ROW,
        across: Self::ROW,
        size: Self::ROW,
    };

    #[inline(always)]
    pub(super) fn set(&mut self, n: usize, own: &Elastic) {
        for (row, entry) in self.deviator.iter_mut().zip(own.deviator) {
            row[n] = entry;
        }
        self.root[n] = own.root;
        self.theta[n] = own.theta;
        self.sinh[n] = own.sinh;
        self.mean[n] = own.mean;
        self.across[n] = own.across;
        self.size[n] = own.size();
    }

    /// Whether series of small numbers hold for all.
    #[inline(always)]
    pub(super) fn are_small(&self) -> bool {
        self.size.iter().fold(true, |all, size| all & (*size < 1.0))
    }

    #[inline(always)]
    pub(super) fn get(&self, n: usize) -> Elastic {
        Elastic {
            deviator: [self.deviator[0][n], self.deviator[1][n]],
            root: self.root[n],
            theta: self.theta[n],
            sinh: self.sinh[n],
            mean: self.mean[n],
            across: self.across[n],
        }
    }
}

/// `G` after a step that ends at `F` and leaves the share `kept` of the logarithm's deviator.
#[inline(always)]
pub(super) fn returned<const SMALL: bool>(F: &F2, G: &Sym, elastic: &Elastic, kept: f64) -> Sym {
    let &Elastic { theta, sinh, root, .. } = elastic;
    let across = (1.0 - kept) * elastic.deviator_across();
    let growth = exp::<SMALL>(0.5 * across);
    let of_G = growth * sinh_over::<SMALL>(kept * theta, sinh, kept);
    let of_identity = growth * root * sinh_over::<SMALL>((1.0 - kept) * theta, sinh, 1.0 - kept);
    // The inverse of C = F^T F.
    let [[f11, f12], [f21, f22]] = *F;
    let J = f11 * f22 - f12 * f21;
    let factor = of_identity / (J * J);
    let [g11, g22] = G.a;
    Sym {
        a: [
            of_G * g11 + factor * (f12 * f12 + f22 * f22),
            of_G * g22 + factor * (f11 * f11 + f21 * f21),
        ],
        shear: of_G * G.shear - factor * (f11 * f12 + f21 * f22),
        across: G.across / (growth * growth),
    }
}

/// A step by the midpoint rule: `G` and the multiplier.
pub(super) fn midpoint(
    law: &Yield,
    start: &F2,
    end: &F2,
    (G, alpha): (&Sym, f64),
    time: f64,
) -> (Sym, f64) {
    let middle: F2 =
        std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (start[i][j] + end[i][j])));
    let shear = if law.planted.is(Fault::TrialShearDropped) { 0.0 } else { G.shear };
    let at_middle = Elastic::new(&middle, &Sym { shear, ..*G });
    let n = at_middle.direction();
    // `F^-1 n F G`, symmetric: the deviator's part of it in the plane.
    let [[f11, f12], [f21, f22]] = middle;
    let J = f11 * f22 - f12 * f21;
    let [p, q] = n.deviator;
    let nF = [[p * f11 + q * f21, p * f12 + q * f22], [q * f11 - p * f21, q * f12 - p * f22]];
    let A = [
        [(f22 * nF[0][0] - f12 * nF[1][0]) / J, (f22 * nF[0][1] - f12 * nF[1][1]) / J],
        [(f11 * nF[1][0] - f21 * nF[0][0]) / J, (f11 * nF[1][1] - f21 * nF[0][1]) / J],
    ];
    let [g11, g22] = G.a;
    let AG = [
        A[0][0] * g11 + A[0][1] * G.shear,
        A[1][0] * G.shear + A[1][1] * g22,
        0.5 * (A[0][0] * G.shear + A[0][1] * g22 + A[1][0] * g11 + A[1][1] * G.shear),
    ];
    let after = |D: f64| {
        let (mean, x) = ((-2.0 * D * n.mean).exponential(), 2.0 * D * n.size);
        let (of_G, of_A) = (mean * libm::cosh(x), mean * sinh_over::<false>(x, n.size, 2.0 * D));
        Sym {
            a: [of_G * g11 - of_A * AG[0], of_G * g22 - of_A * AG[1]],
            shear: of_G * G.shear - of_A * AG[2],
            across: G.across * (-2.0 * D * n.across).exponential(),
        }
    };
    let D = if law.flow.overstress.is_some() {
        2.0 * law.multiplier(law.mu * at_middle.size(), alpha, 0.5 * time)
    } else {
        law.multiplier_of(|D| law.mu * Elastic::new(end, &after(D)).size(), alpha)
    };
    if D > 0.0 { (after(D), D) } else { (*G, 0.0) }
}
