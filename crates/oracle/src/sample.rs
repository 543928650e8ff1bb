//! Points at which accuracy is measured, by class of inputs.

use mmsmith_expr::{Expr, Graph, Program};
use mmsmith_spec::{Domain, Fields, Spec};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// How inputs are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Class {
    /// Parameters within 40 % of their defaults, a place in the body, a time within the period.
    Ordinary,
    /// Amplitude smaller by a factor of 1e-4 to 1e-200.
    TinyAmplitude,
    /// Times of 1e2 to 1e6 periods.
    Late,
    /// On or within 1e-9 of the boundary or of a coordinate plane.
    Boundary,
    /// The smallest principal stretch between 1e-2 and 1e-8, by choice of the amplitude.
    NearInversion,
    /// Coordinates down to 1e-300; for a body around a hole, places next to the inner surface.
    NearOrigin,
    /// Coordinates up to 1e8, outside of the body, where the functions go on.
    Far,
}

impl Class {
    /// Every class.
    pub const ALL: [Class; 7] = [
        Class::Ordinary,
        Class::TinyAmplitude,
        Class::Late,
        Class::Boundary,
        Class::NearInversion,
        Class::NearOrigin,
        Class::Far,
    ];

    /// The name in tables and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Class::Ordinary => "ordinary",
            Class::TinyAmplitude => "tiny amplitude",
            Class::Late => "late",
            Class::Boundary => "boundary",
            Class::NearInversion => "near inversion",
            Class::NearOrigin => "near origin",
            Class::Far => "far",
        }
    }
}

/// How often inputs that do not suit are drawn anew.
const MOST_DRAWS: usize = 100;
/// Beyond this deformation gradient a place is of no use: far from the body some displacements grow without bound.
const LARGEST_GRADIENT: f64 = 10.0;
/// Below this ratio of volumes ordinary points count as inverted.
const LEAST_JACOBIAN: f64 = 0.1;

/// The same numbers on every machine.
struct Random(SplitMix64);

impl Random {
    fn new(seed: u64) -> Self {
        Random(SplitMix64::seed_from_u64(seed))
    }

    fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.bits().is_multiple_of(n)
    }
}

/// Draws points of one specification.
pub struct Sampler<'a> {
    spec: &'a Spec,
    /// Sides of the requirements, the period, and the measures of the domain, from the parameters.
    constants: Program,
    /// The determinant of the deformation gradient, and its entries.
    jacobian: Program,
    gradient: Program,
    /// The place of the amplitude `A` among the parameters.
    amplitude: Option<usize>,
    isochoric: bool,
}

impl<'a> Sampler<'a> {
    /// A sampler of `spec`, whose fields are `fields`.
    #[must_use]
    pub fn new(spec: &'a Spec, fields: &mut Fields) -> Self {
        let mut outputs: Vec<Expr> =
            spec.requirements.iter().flat_map(|r| [r.left, r.right]).collect();
        outputs.push(spec.period);
        match &spec.domain {
            Domain::Box { lower, upper } => outputs.extend(lower.iter().chain(upper)),
            Domain::Annulus { inner, outer } => outputs.extend([inner, outer]),
        }
        Sampler {
            spec,
            constants: fields.program(&outputs),
            jacobian: fields.program(&[fields.J]),
            gradient: fields.program(&fields.F.concat()),
            amplitude: spec.parameters.iter().position(|p| p.name == "A"),
            isochoric: fields.J == Graph::ONE,
        }
    }

    /// Why there are no points of this class; `None` where there may be.
    #[must_use]
    pub fn not_applicable(&self, class: Class) -> Option<&'static str> {
        match (class, &self.spec.domain) {
            (Class::TinyAmplitude | Class::NearInversion, _) if self.amplitude.is_none() => {
                Some("there is no amplitude A")
            }
            (Class::NearInversion, _) if self.isochoric => Some("J = 1 for every amplitude"),
            (Class::Far, Domain::Annulus { .. }) => {
                Some("the profile over the radius is meant for the body only")
            }
            _ => None,
        }
    }

    /// Position, time and parameters, in the order of the inputs of [`Fields`]. The same `index` gives the same point.
    ///
    /// `None` where [`Sampler::not_applicable`] says why, and where repeated draws found nothing that suits.
    #[must_use]
    pub fn draw(&self, class: Class, index: u64) -> Option<Vec<f64>> {
        if self.not_applicable(class).is_some() {
            return None;
        }
        let mut random = Random::new((class as u64) << 48 | index);
        // Neighbouring seeds begin alike.
        random = Random::new(random.bits());
        (0..MOST_DRAWS).find_map(|_| {
            let inputs = self.attempt(class, &mut random)?;
            if class == Class::NearInversion {
                return self.nearly_inverted(inputs, &mut random);
            }
            let moderate = |h: &f64| h.abs() < LARGEST_GRADIENT;
            let suits = self.jacobian.evaluate(&inputs)[0] > LEAST_JACOBIAN
                && self.gradient.evaluate(&inputs).iter().all(moderate);
            suits.then_some(inputs)
        })
    }

    fn attempt(&self, class: Class, random: &mut Random) -> Option<Vec<f64>> {
        let spec = self.spec;
        let mut parameters: Vec<f64> = Vec::new();
        for (place, parameter) in spec.parameters.iter().enumerate() {
            let mut value = parameter.default * random.between(0.6, 1.4);
            if self.amplitude == Some(place) {
                if class == Class::Ordinary && random.one_in(4) {
                    value = -value;
                }
                if class == Class::TinyAmplitude {
                    value *= 10_f64.powf(-random.between(4.0, 200.0));
                }
            }
            if parameter.name == "nu" && random.one_in(3) {
                value = 0.0;
            }
            parameters.push(value);
        }
        let (period, measures) = self.admitted(&parameters)?;
        let mut inputs = self.position(class, &measures, random);
        let late = if class == Class::Late { 10_f64.powf(random.between(2.0, 6.0)) } else { 1.0 };
        inputs.push(period * random.between(0.0, 1.0) * late);
        inputs.extend(parameters);
        Some(inputs)
    }

    /// The period and the measures of the domain, where the parameters are admissible.
    fn admitted(&self, parameters: &[f64]) -> Option<(f64, Vec<f64>)> {
        let spec = self.spec;
        let mut inside = spec.parameters.iter().zip(parameters);
        if !inside.all(|(p, &value)| p.bounds.iter().all(|bound| bound.admits(value))) {
            return None;
        }
        let zeros = vec![0.0; spec.dimension + 1];
        let constants = self.constants.evaluate(&[&zeros, parameters].concat());
        let (sides, rest) = constants.split_at(2 * spec.requirements.len());
        let mut holds = spec.requirements.iter().zip(sides.chunks(2));
        holds
            .all(|(r, side)| r.relation.holds(side[0], side[1]))
            .then(|| (rest[0], rest[1..].to_vec()))
    }

    /// The inputs with an amplitude at which the smallest principal stretch is between 1e-2 and 1e-8. Where the
    /// parameters admit no such amplitude there, the place and the time are moved to where they do.
    fn nearly_inverted(&self, mut inputs: Vec<f64>, random: &mut Random) -> Option<Vec<f64>> {
        let place = self.spec.dimension + 1 + self.amplitude?;
        let wanted = 10_f64.powf(-random.between(2.0, 8.0));
        if random.one_in(2) {
            inputs[place] = -inputs[place];
        }
        let with = |A: f64| {
            let mut changed = inputs.clone();
            changed[place] = A;
            changed
        };
        // The least amplitude at which the stretch is too small, in steps of a quarter.
        let (mut low, mut high) = (0.0, 0.05 * inputs[place]);
        while self.admits(&with(high)) && self.smallest_stretch(&with(high)) > wanted {
            (low, high) = (high, 1.25 * high);
            if high.abs() > 1e3 * inputs[place].abs() {
                return None;
            }
        }
        let (from, to) = if self.admits(&with(high)) {
            (with(low), with(high))
        } else {
            let largest = bisect(low, high, |A| self.admits(&with(A)));
            (with(0.0), self.most_compressed(with(largest), wanted)?)
        };
        let between = |share: f64| -> Vec<f64> {
            from.iter().zip(&to).map(|(from, to)| from + share * (to - from)).collect()
        };
        let share = bisect(0.0, 1.0, |share| self.smallest_stretch(&between(share)) > wanted);
        let found = between(share);
        let suits = (0.5e-8..=2e-2).contains(&self.smallest_stretch(&found));
        (suits && self.admits(&found)).then_some(found)
    }

    fn admits(&self, inputs: &[f64]) -> bool {
        self.admitted(&inputs[self.spec.dimension + 1..]).is_some()
    }

    /// The inputs with the place and the time moved until the smallest stretch is no larger than `wanted`, by a search along
    /// the axes within the body and the period.
    fn most_compressed(&self, mut inputs: Vec<f64>, wanted: f64) -> Option<Vec<f64>> {
        let n = self.spec.dimension;
        let (period, measures) = self.admitted(&inputs[n + 1..])?;
        let range = |axis: usize| match &self.spec.domain {
            Domain::Box { .. } if axis < n => (measures[axis], measures[n + axis]),
            Domain::Annulus { .. } if axis < n => (inputs[axis], inputs[axis]),
            _ => (0.0, period),
        };
        let ranges: Vec<(f64, f64)> = (0..=n).map(range).collect();
        let mut least = self.smallest_stretch(&inputs);
        let mut step = 0.25;
        while least > wanted {
            let before = least;
            for (axis, (low, high)) in ranges.iter().enumerate() {
                for sign in [-1.0, 1.0] {
                    let mut moved = inputs.clone();
                    moved[axis] = (moved[axis] + sign * step * (high - low)).clamp(*low, *high);
                    let stretch = self.smallest_stretch(&moved);
                    if stretch < least {
                        (least, inputs) = (stretch, moved);
                    }
                }
            }
            if least == before {
                step *= 0.5;
                if step < 1e-12 {
                    return None;
                }
            }
        }
        Some(inputs)
    }

    /// The smallest principal stretch, negative where the body is inverted.
    fn smallest_stretch(&self, inputs: &[f64]) -> f64 {
        let F = self.gradient.evaluate(inputs);
        let J = self.jacobian.evaluate(inputs)[0];
        let n = self.spec.dimension;
        // The largest stretch squared by the power method on F^T F; the others follow from the invariants.
        let C = |i: usize, j: usize| (0..n).map(|k| F[k * n + i] * F[k * n + j]).sum::<f64>();
        let trace: f64 = (0..n).map(|i| C(i, i)).sum();
        match n {
            1 => J,
            2 => {
                // s1^2 + s2^2 = tr C, s1 s2 = |J|.
                let sum = (trace + 2.0 * J.abs()).sqrt();
                let difference = (trace - 2.0 * J.abs()).max(0.0).sqrt();
                2.0 * J / (sum + difference)
            }
            _ => {
                // |J|/sqrt(sum of the squared minors) is the smallest stretch to a factor between 1 and sqrt(3); where one
                // stretch is much smaller than the others, it is that stretch.
                let trace_of_square: f64 = (0..n)
                    .flat_map(|i| (0..n).map(move |j| (i, j)))
                    .map(|(i, j)| C(i, j) * C(i, j))
                    .sum();
                let minors = 0.5 * (trace * trace - trace_of_square);
                J / minors.max(f64::MIN_POSITIVE).sqrt()
            }
        }
    }

    fn position(&self, class: Class, measures: &[f64], random: &mut Random) -> Vec<f64> {
        let n = self.spec.dimension;
        // Where `low` and `high` are the ends, now and then one of them or a place next to it.
        let place = |low: f64, high: f64, random: &mut Random| {
            let x = random.between(low, high);
            match class {
                Class::Boundary => {
                    let near = if random.one_in(2) { low } else { high };
                    if random.one_in(2) {
                        near
                    } else {
                        near + (x - near) * 10_f64.powf(-random.between(9.0, 15.0))
                    }
                }
                _ => x,
            }
        };
        match &self.spec.domain {
            Domain::Box { .. } => (0..n)
                .map(|i| {
                    let x = place(measures[i], measures[n + i], random);
                    match class {
                        // Now and then one coordinate stays where it was.
                        Class::NearOrigin | Class::Far if n > 1 && random.one_in(3) => x,
                        Class::NearOrigin => x * 10_f64.powf(-random.between(1.0, 300.0)),
                        Class::Far => {
                            let sign = if random.one_in(2) { 1.0 } else { -1.0 };
                            sign * x * 10_f64.powf(random.between(1.0, 8.0))
                        }
                        _ => x,
                    }
                })
                .collect(),
            Domain::Annulus { .. } => {
                let (inner, outer) = (measures[0], measures[1]);
                let radius = match class {
                    Class::NearOrigin => {
                        let x = random.between(inner, outer);
                        inner + (x - inner) * 10_f64.powf(-random.between(1.0, 15.0))
                    }
                    _ => place(inner, outer, random),
                };
                let angle = place(0.0, std::f64::consts::FRAC_PI_2, random);
                let mut X = vec![radius * angle.cos(), radius * angle.sin()];
                X.extend((2..n).map(|_| random.between(0.0, 1.0)));
                X
            }
        }
    }
}

/// The last number from `low` to `high` for which `holds`, which does for `low` and does not for `high`.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = low + 0.5 * (high - low);
        if middle == low || middle == high {
            return low;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
}
