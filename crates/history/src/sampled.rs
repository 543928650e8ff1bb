//! A motion as Chebyshev series in time: steps of the integrator ask for it thousands of times, and it takes a few dozen values to know it.

use crate::law::Kinematics;
use crate::motion::Motion;
use crate::number::Dual;
use crate::table::{Transform, polynomials_into, roots};
use crate::tensor::{Tensor, tensor};

/// Polynomials in each piece.
const COUNT: usize = 24;
/// Numbers of pieces that are tried.
const PIECES: [usize; 4] = [1, 2, 4, 8];
/// Numbers in kinematics with three slopes, at most.
const MOST: usize = 18 * 4;
/// Numbers whose sums are formed together.
const WIDTH: usize = 8;
/// Coefficients below such a share are left out.
const NOTHING: f64 = 3e-17;
/// The part that series may leave out, as a share of the largest value, and of the largest slope.
const TAIL: f64 = 1e-15;
/// By how much they may be off at other times.
const OFF: f64 = 1e-14;

/// A motion, as series where these have all its digits.
pub(crate) struct Sampled<'a, M, const K: usize> {
    motion: &'a M,
    series: Option<Series>,
}

struct Series {
    end: f64,
    pieces: usize,
    /// All numbers, those that change yet to come.
    steady: [f64; MOST],
    /// Which numbers change.
    places: Vec<usize>,
    /// Polynomials in each piece that count.
    count: usize,
    /// For each piece, each group of numbers that change, and each polynomial, the coefficients.
    coefficients: Vec<[f64; WIDTH]>,
}

fn flat<const K: usize>(at: &Kinematics<Dual<f64, K>>) -> [f64; MOST] {
    let mut numbers = [0.0; MOST];
    for (which, A) in [&at.F, &at.rate].into_iter().enumerate() {
        for (entry, own) in A.iter().flatten().enumerate() {
            let place = (which * 9 + entry) * (K + 1);
            numbers[place] = own.value;
            numbers[place + 1..=place + K].copy_from_slice(&own.slopes);
        }
    }
    numbers
}

fn of_flat<const K: usize>(numbers: &[f64; MOST]) -> Kinematics<Dual<f64, K>> {
    let of = |which: usize| -> Tensor<Dual<f64, K>> {
        tensor(|i, j| {
            let place = (which * 9 + 3 * i + j) * (K + 1);
            let slopes = std::array::from_fn(|k| numbers[place + 1 + k]);
            Dual { value: numbers[place], slopes }
        })
    };
    Kinematics { F: of(0), rate: of(1) }
}

/// The deformation and its rate, values and slopes: each is measured by its own.
fn group<const K: usize>(place: usize) -> usize {
    2 * usize::from(place >= 9 * (K + 1)) + usize::from(!place.is_multiple_of(K + 1))
}

impl Series {
    fn at<const K: usize>(&self, time: f64) -> Kinematics<Dual<f64, K>> {
        let share = time / self.end * self.pieces as f64;
        let piece = (share.max(0.0) as usize).min(self.pieces - 1);
        let mut polynomials = [0.0; COUNT];
        let polynomials = &mut polynomials[..self.count];
        polynomials_into(2.0 * (share - piece as f64) - 1.0, polynomials);
        let groups = self.places.len().div_ceil(WIDTH);
        let own = &self.coefficients[piece * groups * self.count..][..groups * self.count];
        let mut numbers = self.steady;
        for (places, rows) in self.places.chunks(WIDTH).zip(own.chunks_exact(self.count)) {
            let mut sums = [0.0; WIDTH];
            // The small ones first.
            for (row, factor) in rows.iter().zip(&*polynomials).rev() {
                for (sum, c) in sums.iter_mut().zip(row) {
                    *sum += factor * c;
                }
            }
            for (&place, sum) in places.iter().zip(sums) {
                numbers[place] = sum;
            }
        }
        of_flat(&numbers)
    }
}

impl<'a, M: Motion<K>, const K: usize> Sampled<'a, M, K> {
    /// A motion until a time.
    pub(crate) fn new(motion: &'a M, end: f64) -> Self {
        let mut own = Self { motion, series: None };
        if K > 3 || end <= 0.0 || !end.is_finite() {
            return own;
        }
        let (at, transform) = (roots(COUNT), Transform::new(COUNT));
        for pieces in PIECES {
            let width = end / pieces as f64;
            let times = (0..pieces)
                .flat_map(|piece| at.iter().map(move |x| width * (piece as f64 + 0.5 + 0.5 * x)));
            let samples: Vec<[f64; MOST]> = times.map(|time| flat(&motion.at(time))).collect();
            let mut largest = [0.0_f64; 4];
            let mut places = Vec::new();
            for place in 0..18 * (K + 1) {
                let group = &mut largest[group::<K>(place)];
                *group = samples.iter().fold(*group, |most, own| most.max(own[place].abs()));
                if samples.iter().any(|own| own[place] != samples[0][place]) {
                    places.push(place);
                }
            }
            if largest.iter().any(|most| !most.is_finite()) {
                return own;
            }
            let groups = places.len().div_ceil(WIDTH);
            let mut all = vec![[[0.0; WIDTH]; COUNT]; pieces * groups];
            let (mut is_short, mut count) = (false, 1);
            for (number, &place) in places.iter().enumerate() {
                let most = largest[group::<K>(place)];
                for (piece, own) in samples.chunks_exact(COUNT).enumerate() {
                    let values: Vec<f64> = own.iter().map(|own| own[place]).collect();
                    for (k, c) in transform.coefficients(&values).enumerate() {
                        all[piece * groups + number / WIDTH][k][number % WIDTH] = c;
                        is_short |= k + 2 >= COUNT && c.abs() > TAIL * most;
                        count = if c.abs() > NOTHING * most { count.max(k + 1) } else { count };
                    }
                }
            }
            if is_short {
                continue;
            }
            let coefficients = all.iter().flat_map(|own| &own[..count]).copied().collect();
            let series = Series { end, pieces, steady: samples[0], places, count, coefficients };
            // Waves that are too short for the nodes have other values in between.
            let is_right = [0.071, 0.456, 0.832].into_iter().all(|share| {
                let (exact, found) =
                    (flat(&motion.at(share * end)), flat(&series.at::<K>(share * end)));
                (0..18 * (K + 1)).all(|place| {
                    (exact[place] - found[place]).abs() <= OFF * largest[group::<K>(place)]
                })
            });
            own.series = is_right.then_some(series);
            return own;
        }
        own
    }
}

impl<M: Motion<K>, const K: usize> Motion<K> for Sampled<'_, M, K> {
    fn at(&self, time: f64) -> Kinematics<Dual<f64, K>> {
        match &self.series {
            Some(series) => series.at(time),
            None => self.motion.at(time),
        }
    }

    fn constants(&self, time: f64, constants: &mut Vec<Dual<f64, K>>) {
        self.motion.constants(time, constants);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A motion that counts how often it is asked for.
    struct Counting<F> {
        of: F,
        count: AtomicUsize,
    }

    impl<F: Fn(f64) -> Kinematics<Dual<f64, 2>> + Sync> Motion<2> for Counting<F> {
        fn at(&self, time: f64) -> Kinematics<Dual<f64, 2>> {
            self.count.fetch_add(1, Ordering::Relaxed);
            (self.of)(time)
        }

        fn constants(&self, _: f64, _: &mut Vec<Dual<f64, 2>>) {}
    }

    fn along(r: f64, rate: f64) -> Kinematics<Dual<f64, 2>> {
        let of = |unit: f64, r: f64| {
            tensor(|i, j| {
                let size = 0.3 + 0.1 * i as f64 - 0.2 * j as f64;
                let value = if i == j { unit } else { 0.0 } + size * r;
                Dual { value, slopes: [0.1 * r, if i == 0 { 0.0 } else { size * size * r }] }
            })
        };
        Kinematics { F: of(1.0, r), rate: of(0.0, rate) }
    }

    #[test]
    fn smooth_motions_are_asked_for_a_few_times_and_others_are_not_changed() {
        type Of = fn(f64) -> Kinematics<Dual<f64, 2>>;
        let smooth: Of = |t| along((3.0 * t).sin(), 3.0 * (3.0 * t).cos());
        // Of faster ones the phase alone has more rounding than the last coefficients may have.
        let fast: Of = |t| along((12.0 * t).sin(), 12.0 * (12.0 * t).cos());
        // The wave is zero at the nodes of the first series.
        let hidden: Of = |t| {
            let x: f64 = (2.0 * t / 1.7 - 1.0).clamp(-1.0, 1.0);
            let angle = 24.0 * x.acos();
            along(1e-3 * angle.cos(), 1e-3 * angle.cos())
        };
        let kinked: Of = |t| along((t - 0.3).abs(), (t - 0.3).signum());
        for (of, most, is_series) in
            [(smooth, 80, true), (fast, 400, true), (hidden, 400, false), (kinked, 400, false)]
        {
            let motion = Counting { of, count: AtomicUsize::new(0) };
            let sampled = Sampled::<_, 2>::new(&motion, 1.7);
            assert!(motion.count.load(Ordering::Relaxed) < most);
            assert_eq!(sampled.series.is_some(), is_series);
            for k in 0..=170 {
                let t = 0.01 * f64::from(k);
                let (found, exact) = (flat(&sampled.at(t)), flat(&of(t)));
                for (place, (found, exact)) in found.iter().zip(exact).enumerate() {
                    let size = if place >= 27 { 12.0 } else { 1.0 };
                    assert!((found - exact).abs() < 4e-15 * size, "{t} {place} {found} {exact}");
                }
            }
        }
    }
}
