//! Symmetric compositions of leapfrog.

/// A symmetric composition: leapfrog with steps `gamma_1 dt, gamma_2 dt, ...` in turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Composition {
    /// Leapfrog itself.
    Order2,
    /// Suzuki's five stages, Phys. Lett. A 146 (1990) 319-323.
    Order4,
    /// Nine stages of Kahan & Li, Math. Comp. 66 (1997) 1089-1099 ("s9odr6a").
    Order6,
}

/// `1/(4 - 4^(1/3))`.
const SUZUKI: f64 = 0.414_490_771_794_375_7;

impl Composition {
    /// The order of accuracy in time.
    pub fn order(self) -> usize {
        match self {
            Self::Order2 => 2,
            Self::Order4 => 4,
            Self::Order6 => 6,
        }
    }

    /// The parts of a time step that the stages take; they add up to one, and some are negative.
    pub fn stages(self) -> &'static [f64] {
        const S: f64 = SUZUKI;
        const G: [f64; 4] = [
            0.392_161_444_007_314_2,
            0.332_599_136_789_359_43,
            -0.706_246_172_557_639_3,
            0.082_213_596_293_550_8,
        ];
        const MIDDLE: f64 = 1.0 - 2.0 * (G[0] + G[1] + G[2] + G[3]);
        match self {
            Self::Order2 => &[1.0],
            Self::Order4 => &[S, S, 1.0 - 4.0 * S, S, S],
            Self::Order6 => &[G[0], G[1], G[2], G[3], MIDDLE, G[3], G[2], G[1], G[0]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error at time 2 of `u'' = -u^3 + b(t)` whose exact solution is `sin(1.3 t)`, with time a variable of the drift.
    fn error(composition: Composition, steps: usize) -> f64 {
        let w = 1.3_f64;
        let force = |u: f64, t: f64| {
            let exact = (w * t).sin();
            -u.powi(3) + exact.powi(3) - w * w * exact
        };
        let dt = 2.0 / steps as f64;
        let (mut u, mut v, mut t) = (0.0, w, 0.0);
        for _ in 0..steps {
            for gamma in composition.stages() {
                let part = gamma * dt;
                v += 0.5 * part * force(u, t);
                u += part * v;
                t += part;
                v += 0.5 * part * force(u, t);
            }
        }
        (u - (w * 2.0).sin()).abs().max((v - w * (w * 2.0).cos()).abs())
    }

    #[test]
    fn an_oscillator_under_a_force_that_depends_on_time_shows_the_orders() {
        for (composition, steps) in
            [(Composition::Order2, 40), (Composition::Order4, 20), (Composition::Order6, 8)]
        {
            let order = (error(composition, steps) / error(composition, 2 * steps)).log2();
            assert!((order - composition.order() as f64).abs() < 0.25, "{composition:?}: {order}");
        }
    }

    #[test]
    fn stages_are_symmetric_and_fill_the_step() {
        for composition in [Composition::Order2, Composition::Order4, Composition::Order6] {
            let stages = composition.stages();
            assert!(stages.iter().eq(stages.iter().rev()));
            assert!((stages.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }
}
