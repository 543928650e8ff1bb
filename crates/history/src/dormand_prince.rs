//! Ordinary differential equations by the method of order eight of Dormand and Prince with its dense output of order seven (DOP853).
//!
//! Source: E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. (1993), sections II.5 and II.6;
//! coefficients as in their program DOP853 and in SciPy's `dop853_coefficients.py`.

use crate::number::{Dual, Number};

/// Where in the step the stages are.
const C: [f64; 16] = [
    0.0,
    0.052_600_151_958_767_73,
    0.078_900_227_938_151_6,
    0.118_350_341_907_227_4,
    0.281_649_658_092_772_6,
    0.333_333_333_333_333_3,
    0.25,
    0.307_692_307_692_307_7,
    0.651_282_051_282_051_3,
    0.6,
    0.857_142_857_142_857_1,
    1.0,
    1.0,
    0.1,
    0.2,
    0.777_777_777_777_777_8,
];

/// For each stage the weights of those before it that count; the row 12 has the weights of the step itself.
const A: [&[(usize, f64)]; 16] = [
    &[],
    &[(0, 0.052_600_151_958_767_73)],
    &[(0, 0.019_725_056_984_537_9), (1, 0.059_175_170_953_613_7)],
    &[(0, 0.029_587_585_476_806_85), (2, 0.088_762_756_430_420_54)],
    &[(0, 0.241_365_134_159_266_7), (2, -0.884_549_479_328_286_1), (3, 0.924_834_003_261_792)],
    &[(0, 0.037_037_037_037_037_035), (3, 0.170_828_608_729_473_86), (4, 0.125_467_687_566_822_42)],
    &[
        (0, 0.037_109_375),
        (3, 0.170_252_211_019_544_05),
        (4, 0.060_216_538_980_455_96),
        (5, -0.017_578_125),
    ],
    &[
        (0, 0.037_092_000_118_504_79),
        (3, 0.170_383_925_712_239_98),
        (4, 0.107_262_030_446_373_28),
        (5, -0.015_319_437_748_624_402),
        (6, 0.008_273_789_163_814_023),
    ],
    &[
        (0, 0.624_110_958_716_075_7),
        (3, -3.360_892_629_446_941_4),
        (4, -0.868_219_346_841_726),
        (5, 27.592_099_699_446_71),
        (6, 20.154_067_550_477_894),
        (7, -43.489_884_181_069_96),
    ],
    &[
        (0, 0.477_662_536_438_264_34),
        (3, -2.488_114_619_971_667_7),
        (4, -0.590_290_826_836_843),
        (5, 21.230_051_448_181_193),
        (6, 15.279_233_632_882_423),
        (7, -33.288_210_968_984_86),
        (8, -0.020_331_201_708_508_627),
    ],
    &[
        (0, -0.937_142_430_085_987_3),
        (3, 5.186_372_428_844_064),
        (4, 1.091_437_348_996_729_5),
        (5, -8.149_787_010_746_927),
        (6, -18.520_065_659_996_96),
        (7, 22.739_487_099_350_505),
        (8, 2.493_605_552_679_652_3),
        (9, -3.046_764_471_898_219_6),
    ],
    &[
        (0, 2.273_310_147_516_538),
        (3, -10.534_495_466_737_25),
        (4, -2.000_872_058_224_862_5),
        (5, -17.958_931_863_118_8),
        (6, 27.948_884_529_419_96),
        (7, -2.858_998_277_135_023_5),
        (8, -8.872_856_933_530_63),
        (9, 12.360_567_175_794_303),
        (10, 0.643_392_746_015_763_6),
    ],
    &[
        (0, 0.054_293_734_116_568_765),
        (5, 4.450_312_892_752_409),
        (6, 1.891_517_899_314_500_3),
        (7, -5.801_203_960_010_585),
        (8, 0.311_164_366_957_819_9),
        (9, -0.152_160_949_662_516_1),
        (10, 0.201_365_400_804_030_34),
        (11, 0.044_710_615_727_772_59),
    ],
    &[
        (0, 0.056_167_502_283_047_954),
        (6, 0.253_500_210_216_624_83),
        (7, -0.246_239_037_470_802_5),
        (8, -0.124_191_423_263_816_37),
        (9, 0.153_291_798_278_765_68),
        (10, 0.008_201_052_295_634_69),
        (11, 0.007_567_897_660_545_699),
        (12, -0.008_298),
    ],
    &[
        (0, 0.031_834_648_163_502_14),
        (5, 0.028_300_909_672_366_776),
        (6, 0.053_541_988_307_438_566),
        (7, -0.054_923_748_571_390_99),
        (10, -0.000_108_347_328_697_249_32),
        (11, 0.000_382_571_090_835_658_4),
        (12, -0.000_340_465_008_687_404_56),
        (13, 0.141_312_443_674_632_5),
    ],
    &[
        (0, -0.428_896_301_583_791_94),
        (5, -4.697_621_415_361_164),
        (6, 7.683_421_196_062_599),
        (7, 4.068_989_818_397_11),
        (8, 0.356_727_187_455_281_1),
        (12, -0.001_399_024_165_159_014_5),
        (13, 2.947_514_789_152_772_4),
        (14, -9.150_958_472_179_87),
    ],
];

/// The error by the formula of order five.
const E5: &[(usize, f64)] = &[
    (0, 0.013_120_044_994_194_88),
    (5, -1.225_156_446_376_204_4),
    (6, -0.495_758_949_657_250_2),
    (7, 1.664_377_182_454_986_4),
    (8, -0.350_328_848_749_973_66),
    (9, 0.334_179_118_713_017_5),
    (10, 0.081_923_206_485_115_71),
    (11, -0.022_355_307_863_886_294),
];

/// Weights of the step less those of the formula of order three.
const E3: &[(usize, f64)] =
    &[(0, 0.244_094_488_188_976_4), (8, 0.733_846_688_281_611_9), (11, 0.022_058_823_529_411_766)];

/// The last four coefficients of the interpolation.
const D: [&[(usize, f64)]; 4] = [
    &[
        (0, -8.428_938_276_109_013),
        (5, 0.566_714_953_519_377_7),
        (6, -3.068_949_945_949_891_7),
        (7, 2.384_667_656_512_07),
        (8, 2.117_034_582_445_028),
        (9, -0.871_391_583_777_973),
        (10, 2.240_437_430_260_788_3),
        (11, 0.631_578_778_769_468_8),
        (12, -0.088_990_336_451_333_31),
        (13, 18.148_505_520_854_727),
        (14, -9.194_632_392_478_356),
        (15, -4.436_036_387_594_894),
    ],
    &[
        (0, 10.427_508_642_579_134),
        (5, 242.283_491_775_258_17),
        (6, 165.200_451_717_270_28),
        (7, -374.546_754_722_690_2),
        (8, -22.113_666_853_125_306),
        (9, 7.733_432_668_472_264),
        (10, -30.674_084_731_089_398),
        (11, -9.332_130_526_430_229),
        (12, 15.697_238_121_770_845),
        (13, -31.139_403_219_565_178),
        (14, -9.352_924_358_844_48),
        (15, 35.816_841_486_394_08),
    ],
    &[
        (0, 19.985_053_242_002_433),
        (5, -387.037_308_749_351_8),
        (6, -189.178_138_195_167_58),
        (7, 527.808_159_205_423_6),
        (8, -11.573_902_539_959_63),
        (9, 6.881_232_694_696_3),
        (10, -1.000_605_096_691_083_8),
        (11, 0.777_713_779_805_344_3),
        (12, -2.778_205_752_353_508),
        (13, -60.196_695_231_264_12),
        (14, 84.320_405_506_677_16),
        (15, 11.992_291_136_182_79),
    ],
    &[
        (0, -25.693_933_462_703_75),
        (5, -154.189_748_690_236_43),
        (6, -231.529_379_176_045_5),
        (7, 357.639_117_910_614_1),
        (8, 93.405_324_183_624_32),
        (9, -37.458_323_136_451_63),
        (10, 104.099_649_508_962_3),
        (11, 29.840_293_426_660_5),
        (12, -43.533_456_590_011_14),
        (13, 96.324_553_959_188_28),
        (14, -39.177_261_675_615_44),
        (15, -149.726_836_257_985_64),
    ],
];

/// Rates at a time: `rate(time, y, rates)`.
pub(crate) trait Rate<const K: usize>:
    FnMut(f64, &[Dual<f64, K>], &mut [Dual<f64, K>])
{
}

impl<const K: usize, R: FnMut(f64, &[Dual<f64, K>], &mut [Dual<f64, K>])> Rate<K> for R {}

/// Errors of a step over the scales of the tolerance: of values and of slopes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    pub(crate) of_values: f64,
    pub(crate) of_slopes: f64,
}

/// A step and what it needs.
pub(crate) struct Step<const K: usize> {
    /// Where the step begins.
    pub(crate) start: f64,
    /// Its length.
    pub(crate) length: f64,
    /// The values where it begins.
    pub(crate) from: Vec<Dual<f64, K>>,
    /// The values where it ends.
    pub(crate) to: Vec<Dual<f64, K>>,
    stages: Vec<Vec<Dual<f64, K>>>,
    /// Coefficients of the interpolation.
    dense: Vec<[Dual<f64, K>; 7]>,
    is_dense: bool,
    work: Vec<Dual<f64, K>>,
    /// For each variable the group whose values are of one size.
    groups: Vec<usize>,
}

impl<const K: usize> Step<K> {
    pub(crate) fn new(from: Vec<Dual<f64, K>>, groups: Vec<usize>) -> Self {
        let zero = Dual::constant(0.0);
        let count = from.len();
        Self {
            start: 0.0,
            length: 0.0,
            to: from.clone(),
            stages: vec![vec![zero; count]; 16],
            dense: vec![[zero; 7]; count],
            is_dense: false,
            work: vec![zero; count],
            groups,
            from,
        }
    }

    /// The rates where the step begins. They are known where a step goes on from another.
    pub(crate) fn begin(&mut self, rate: &mut impl Rate<K>, start: f64) {
        self.start = start;
        rate(start, &self.from, &mut self.stages[0]);
    }

    /// `from + length sum of weights times stages`, into `work`.
    fn combine(&mut self, weights: &[(usize, f64)]) {
        let length = self.length;
        for (place, (own, &from)) in self.work.iter_mut().zip(&self.from).enumerate() {
            let mut sum = Dual::constant(0.0);
            for &(stage, weight) in weights {
                add_scaled(&mut sum, &self.stages[stage][place], weight);
            }
            *own = from;
            add_scaled(own, &sum, length);
        }
    }

    /// Goes a step of a length. The tolerance is relative to each group's `scales` of values and of slopes, and to what these are at the end.
    pub(crate) fn go(
        &mut self,
        rate: &mut impl Rate<K>,
        length: f64,
        tolerance: f64,
        scales: &[[f64; 2]],
    ) -> Errors {
        self.length = length;
        self.is_dense = false;
        for stage in 1..12 {
            self.combine(A[stage]);
            rate(self.start + C[stage] * length, &self.work, &mut self.stages[stage]);
        }
        self.combine(A[12]);
        std::mem::swap(&mut self.to, &mut self.work);
        let scales = self.scales(scales);
        // Two estimates; the first is small where the second is.
        let mut estimates = vec![[[0.0_f64; 2]; 2]; scales.len()];
        let mut is_number = true;
        for place in 0..self.to.len() {
            let mut of_five = Dual::<f64, K>::constant(0.0);
            let mut of_three = Dual::<f64, K>::constant(0.0);
            for &(stage, weight) in E5 {
                add_scaled(&mut of_five, &self.stages[stage][place], weight);
            }
            for &(stage, weight) in A[12] {
                add_scaled(&mut of_three, &self.stages[stage][place], weight);
            }
            for &(stage, weight) in E3 {
                add_scaled(&mut of_three, &self.stages[stage][place], -weight);
            }
            let [five, three] = &mut estimates[self.groups[place]];
            five[0] = five[0].max(of_five.value.abs());
            three[0] = three[0].max(of_three.value.abs());
            is_number &= self.to[place].value.is_finite();
            for k in 0..K {
                five[1] = five[1].max(of_five.slopes[k].abs());
                three[1] = three[1].max(of_three.slopes[k].abs());
                is_number &= self.to[place].slopes[k].is_finite();
            }
        }
        if !is_number {
            return Errors { of_values: f64::INFINITY, of_slopes: f64::INFINITY };
        }
        let error = |of: usize| {
            let of_groups = estimates.iter().zip(&scales).map(|([five, three], scales)| {
                let (five, three, scale) = (five[of], three[of], scales[of]);
                if five == 0.0 {
                    return 0.0;
                }
                let denominator = (five * five + 0.01 * three * three).sqrt();
                length * five * (five / denominator) / (tolerance * scale.max(f64::MIN_POSITIVE))
            });
            of_groups.fold(0.0, f64::max)
        };
        Errors { of_values: error(0), of_slopes: error(1) }
    }

    /// The largest values and slopes of each group so far, with those where the step ends.
    pub(crate) fn scales(&self, so_far: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut scales = so_far.to_vec();
        for (y, &group) in self.to.iter().zip(&self.groups) {
            let [of_values, of_slopes] = &mut scales[group];
            *of_values = of_values.max(y.value.abs());
            *of_slopes = y.slopes.iter().fold(*of_slopes, |most, slope| most.max(slope.abs()));
        }
        scales
    }

    /// The rates where the step ends.
    pub(crate) fn finish(&mut self, rate: &mut impl Rate<K>) {
        let end = self.start + self.length;
        rate(end, &self.to, &mut self.stages[12]);
    }

    /// The rates where the step begins.
    pub(crate) fn rates(&self) -> &[Dual<f64, K>] {
        &self.stages[0]
    }

    /// Makes ready to interpolate; the rates at the end are known.
    pub(crate) fn prepare(&mut self, rate: &mut impl Rate<K>) {
        if self.is_dense {
            return;
        }
        for stage in 13..16 {
            self.combine(A[stage]);
            rate(self.start + C[stage] * self.length, &self.work, &mut self.stages[stage]);
        }
        let length = self.length;
        for place in 0..self.from.len() {
            let stages = &self.stages;
            let change = self.to[place] - self.from[place];
            let first = stages[0][place].times(length);
            let last = stages[12][place].times(length);
            let dense = &mut self.dense[place];
            dense[0] = change;
            dense[1] = first - change;
            dense[2] = change.times(2.0) - (last + first);
            for (own, weights) in dense[3..].iter_mut().zip(D) {
                let mut sum = Dual::constant(0.0);
                for &(stage, weight) in weights {
                    add_scaled(&mut sum, &stages[stage][place], weight);
                }
                *own = sum.times(length);
            }
        }
        self.is_dense = true;
    }

    /// The values at a time within the step.
    pub(crate) fn at(&self, time: f64) -> Vec<Dual<f64, K>> {
        let x = (time - self.start) / self.length;
        let value = |(from, dense): (&Dual<f64, K>, &[Dual<f64, K>; 7])| {
            let mut sum = Dual::constant(0.0);
            for (number, &coefficient) in dense.iter().rev().enumerate() {
                sum = (sum + coefficient).times(if number % 2 == 0 { x } else { 1.0 - x });
            }
            *from + sum
        };
        self.from.iter().zip(&self.dense).map(value).collect()
    }

    /// Goes on from where the step ends.
    pub(crate) fn advance(&mut self, end: f64) {
        std::mem::swap(&mut self.from, &mut self.to);
        self.stages.swap(0, 12);
        self.start = end;
        self.is_dense = false;
    }
}

#[inline]
fn add_scaled<const K: usize>(sum: &mut Dual<f64, K>, own: &Dual<f64, K>, factor: f64) {
    sum.value += own.value * factor;
    for k in 0..K {
        sum.slopes[k] += own.slopes[k] * factor;
    }
}

/// The factor by which the next step is longer.
pub(crate) fn factor(error: f64) -> f64 {
    // The eighth root by square roots, which all machines round alike.
    let root = error.sqrt().sqrt().sqrt();
    if error == 0.0 { 6.0 } else { (0.9 / root).clamp(0.2, 6.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_stages_sum_up_to_their_places() {
        for (weights, place) in A.iter().zip(C) {
            let sum: f64 = weights.iter().map(|pair| pair.1).sum();
            assert!((sum - place).abs() < 4e-14, "{place}: {sum}");
        }
    }

    /// A pendulum and its slope along the frequency, in steps of one length: orders eight and, within steps, seven and more.
    #[test]
    fn a_pendulum_has_the_orders_of_the_method() {
        let exact = |t: f64| [(2.0 * t).cos(), -t * (2.0 * t).sin()];
        let error = |steps: usize| {
            let one = |value: f64, slope: f64| Dual { value, slopes: [slope] };
            let mut rate = |_: f64, y: &[Dual<f64, 1>], rates: &mut [Dual<f64, 1>]| {
                let w = one(2.0, 1.0);
                (rates[0], rates[1]) = (y[1] * w, -(y[0] * w));
            };
            let mut step = Step::new(vec![one(1.0, 0.0), one(0.0, 0.0)], vec![0, 0]);
            let h = 3.0 / steps as f64;
            step.begin(&mut rate, 0.0);
            let mut within = 0.0_f64;
            for k in 0..steps {
                step.go(&mut rate, h, 1e-6, &[[1.0; 2]]);
                step.finish(&mut rate);
                step.prepare(&mut rate);
                for share in [0.2, 0.45, 0.9] {
                    let time = step.start + share * h;
                    let (found, [value, slope]) = (step.at(time)[0], exact(time));
                    within = within
                        .max((found.value - value).abs())
                        .max((found.slopes[0] - slope).abs());
                }
                step.advance((k + 1) as f64 * h);
            }
            let [value, slope] = exact(3.0);
            [(step.from[0].value - value).abs().max((step.from[0].slopes[0] - slope).abs()), within]
        };
        let (coarse, fine) = (error(6), error(12));
        let orders = [0, 1].map(|k| (coarse[k] / fine[k]).log2());
        assert!(orders[0] > 7.5 && orders[1] > 6.8, "{coarse:?} {fine:?} {orders:?}");
    }
}
