//! Points at which accuracy is measured, by class of inputs.

use mmsmith_expr::{Expr, Graph, Program, RangeOfInputs};
use mmsmith_spec::{Bound, Coordinates, Domain, Fields, Parameter, Relation, Spec};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// How inputs are drawn.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// A place in the body, a time within the period. Of four sets of parameters three are within 40 % of their defaults, in
    /// this class and in the others, and one is further away, by a factor of 10 at most or next to a bound.
    Ordinary,
    /// Amplitude smaller by a factor of 1e-4 to 1e-200.
    TinyAmplitude,
    /// Times of 1e2 to 1e6 periods.
    Late,
    /// On or within 1e-9 of the boundary or of a coordinate plane.
    Boundary,
    /// The smallest principal stretch between 1e-2 and 1e-8, by choice of the amplitude.
    NearInversion,
    /// Coordinates down to 1e-300; where the coordinates have an axis and the body is away from it, places next to the surface
    /// that faces it.
    NearOrigin,
    /// Outside of the body, where the functions go on: coordinates up to 1e8, around a hole radii from half of the inner one to 1e3 outer ones.
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

    /// Whether numbers leave the range of the format at these inputs.
    pub(crate) fn may_underflow(self) -> bool {
        matches!(self, Class::TinyAmplitude | Class::Far | Class::Late)
    }

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
/// Parameters are at most so much larger or smaller than their defaults.
const LARGEST_RATIO: f64 = 10.0;
/// Next to a bound that it must not meet, a parameter keeps this distance: Poisson's ratio is at most 1/2 - 1e-8.
const NEAREST_TO_BOUND: f64 = 1e-8;
/// An amplitude counts as tiny below this share of its default, and has this share at least.
const TINY: f64 = 1.4e-4;
const TINIEST: f64 = 1e-201;
/// Points next to the boundary are within this share of the body's size.
const NEXT_TO: f64 = 1e-9;
/// Late times end at so many periods.
const MOST_PERIODS: f64 = 1e6;
/// How far from the body coordinates go, and distances from a hole in outer radii.
const FARTHEST: f64 = 1e8;
const FARTHEST_RADII: f64 = 1e3;
/// How far into a hole places go, as a share of the inner radius: on the axis few profiles have a value.
const INNERMOST: f64 = 0.5;
/// The smallest stretches of bodies that count as near inversion.
const NEAR_INVERSION: std::ops::RangeInclusive<f64> = 0.5e-8..=2e-2;

/// Random numbers that are the same on every machine.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(SplitMix64::seed_from_u64(seed))
    }

    /// The numbers of a stream that three numbers name.
    pub(crate) fn of_three(one: u64, two: u64, three: u64) -> Self {
        let mut random = Random::new(one);
        for number in [two, three] {
            // Neighbouring seeds begin alike.
            random = Random::new(random.bits() ^ number);
            random.bits();
        }
        random
    }

    /// A whole number below `n`, which is not zero.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn one_in(&mut self, n: u64) -> bool {
        self.bits().is_multiple_of(n)
    }
}

/// How one input may be changed.
pub(crate) struct Scale {
    /// The size that a change has at most.
    pub(crate) size: f64,
    /// Values at which terms vanish or coincide.
    pub(crate) special: Vec<f64>,
    /// Both bounds of a parameter that has two.
    pub(crate) bounds: Option<(f64, f64)>,
}

/// Draws points of one specification.
pub struct Sampler<'a> {
    spec: &'a Spec,
    /// Sides of the requirements, the period, and the measures of the domain, from the parameters.
    constants: Program,
    /// The determinant of the deformation gradient, and its entries.
    jacobian: Program,
    gradient: Program,
    /// The strain energy, which some laws have for deformations up to a limit only.
    energy: Option<Program>,
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
            Domain::Tube { inner, outer, lower, upper, around } => {
                outputs.extend([inner, outer, lower, upper]);
                outputs.extend(around.angles().into_iter().flatten());
            }
        }
        Sampler {
            spec,
            constants: fields.program(&outputs),
            jacobian: fields.program(&[fields.J]),
            gradient: fields.program(&fields.F.concat()),
            energy: fields.W.map(|W| fields.program(&[W])),
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
            (Class::Far, _) if self.spec.range_of_inputs == RangeOfInputs::Body => Some(
                "digits are kept in the body: range-of-inputs = 'wide' in the specification asks for more",
            ),
            (Class::NearInversion, _) if self.isochoric => Some("J = 1 for every amplitude"),
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
            (self.is_moderate(&inputs) && self.has_energy(&inputs)).then_some(inputs)
        })
    }

    fn is_moderate(&self, inputs: &[f64]) -> bool {
        let moderate = |h: &f64| h.abs() < LARGEST_GRADIENT;
        self.jacobian.evaluate(inputs)[0] > LEAST_JACOBIAN
            && self.gradient.evaluate(inputs).iter().all(moderate)
    }

    /// Whether the law is defined there, as far as its energy tells.
    fn has_energy(&self, inputs: &[f64]) -> bool {
        self.energy.as_ref().is_none_or(|energy| !energy.evaluate(inputs)[0].is_nan())
    }

    /// Whether inputs that were not drawn are such as [`Sampler::draw`] may give for `class`, but for the deformation, which
    /// [`Sampler::deformation_suits`] judges.
    pub(crate) fn belongs(&self, class: Class, inputs: &[f64]) -> bool {
        let n = self.spec.dimension;
        let (position, rest) = inputs.split_at(n);
        let (time, parameters) = (rest[0], &rest[1..]);
        let Some((period, measures)) = self.admitted(parameters) else { return false };
        let last = if class == Class::Late { MOST_PERIODS * period } else { period };
        let mut all = self.spec.parameters.iter().zip(parameters).enumerate();
        (0.0..=last).contains(&time)
            && all.all(|(place, (parameter, &value))| {
                self.parameter_belongs(class, place, parameter, value)
            })
            && self.position_belongs(class, position, &measures)
    }

    /// Whether the deformation at the inputs is one of `class`.
    pub(crate) fn deformation_suits(&self, class: Class, inputs: &[f64]) -> bool {
        let suits = match class {
            Class::NearInversion => NEAR_INVERSION.contains(&self.smallest_stretch(inputs)),
            _ => self.is_moderate(inputs),
        };
        suits && self.has_energy(inputs)
    }

    fn parameter_belongs(
        &self,
        class: Class,
        place: usize,
        parameter: &Parameter,
        value: f64,
    ) -> bool {
        let is_strict = |bound: &&Bound| {
            matches!(bound.relation, Relation::Less | Relation::Greater) && bound.limit != 0.0
        };
        if parameter
            .bounds
            .iter()
            .filter(is_strict)
            .any(|bound| (value - bound.limit).abs() < NEAREST_TO_BOUND)
        {
            return false;
        }
        let ratio = (value / parameter.default).abs();
        let is_amplitude = self.amplitude == Some(place);
        match class {
            Class::TinyAmplitude if is_amplitude => (TINIEST..=TINY).contains(&ratio),
            // The amplitude at which the body is inverted may be any.
            Class::NearInversion if is_amplitude => value.is_finite(),
            _ if between_bounds(parameter).is_some() || value == 0.0 => true,
            _ => (1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&ratio),
        }
    }

    fn position_belongs(&self, class: Class, position: &[f64], measures: &[f64]) -> bool {
        let n = self.spec.dimension;
        match &self.spec.domain {
            Domain::Box { .. } => {
                let inside = |i: usize| {
                    let (low, high) = (measures[i], measures[n + i]);
                    let x = position[i];
                    match class {
                        Class::Far => x.abs() <= FARTHEST * low.abs().max(high.abs()),
                        Class::NearOrigin if self.has_axis() => (low..=high).contains(&x),
                        Class::NearOrigin => (low.min(0.0)..=high.max(0.0)).contains(&x),
                        _ => (low..=high).contains(&x),
                    }
                };
                let at_end = |i: usize| {
                    let (low, high) = (measures[i], measures[n + i]);
                    let x = position[i];
                    (x - low).abs().min((high - x).abs()) <= NEXT_TO * (high - low)
                };
                (0..n).all(inside) && (class != Class::Boundary || (0..n).any(at_end))
            }
            Domain::Annulus { .. } => {
                let (inner, outer) = (measures[0], measures[1]);
                let radius = length(position);
                let near = |x: f64| (radius - x).abs() <= NEXT_TO * (outer - inner);
                let in_body = radius_is_between(radius, inner, outer);
                let in_class = match class {
                    Class::Far => (INNERMOST * inner..=FARTHEST_RADII * outer).contains(&radius),
                    Class::NearOrigin => in_body && radius - inner <= 0.1 * (outer - inner),
                    Class::Boundary => {
                        in_body
                            && (near(inner)
                                || near(outer)
                                || position.iter().any(|&x| x <= NEXT_TO * radius))
                    }
                    _ => in_body,
                };
                in_class && position.iter().all(|&x| x >= 0.0)
            }
            Domain::Tube { .. } => {
                let [inner, outer, lower, upper] =
                    [measures[0], measures[1], measures[2], measures[3]];
                let (radius, height) = (length(&position[..2]), position[2]);
                let near = |x: f64, end: f64, size: f64| (x - end).abs() <= NEXT_TO * size;
                let in_body =
                    radius_is_between(radius, inner, outer) && (lower..=upper).contains(&height);
                let (across, along) = (outer - inner, upper - lower);
                match class {
                    Class::Far => (INNERMOST * inner..=FARTHEST_RADII * outer).contains(&radius),
                    Class::NearOrigin => in_body && radius - inner <= 0.1 * across,
                    Class::Boundary => {
                        in_body
                            && (near(radius, inner, across)
                                || near(radius, outer, across)
                                || near(height, lower, along)
                                || near(height, upper, along))
                    }
                    _ => in_body,
                }
            }
        }
    }

    /// Whether the position is outside of the body.
    #[must_use]
    pub fn is_outside(&self, inputs: &[f64]) -> bool {
        let n = self.spec.dimension;
        let zeros = vec![0.0; n + 1];
        let constants = self.constants.evaluate(&[&zeros, &inputs[n + 1..]].concat());
        let measures = &constants[2 * self.spec.requirements.len() + 1..];
        match &self.spec.domain {
            Domain::Box { .. } => {
                (0..n).any(|i| !(measures[i]..=measures[n + i]).contains(&inputs[i]))
            }
            Domain::Annulus { .. } => {
                !radius_is_between(length(&inputs[..n]), measures[0], measures[1])
            }
            Domain::Tube { .. } => {
                !radius_is_between(length(&inputs[..2]), measures[0], measures[1])
                    || !(measures[2]..=measures[3]).contains(&inputs[2])
            }
        }
    }

    /// Whether the coordinates have an axis, on which most fields have no value: places stay in the body then.
    fn has_axis(&self) -> bool {
        self.spec.coordinates != Coordinates::Cartesian
    }

    /// For each input the size that a change of it has at most, and values that are worth a try.
    pub(crate) fn scales(&self, class: Class, inputs: &[f64]) -> Vec<Scale> {
        let n = self.spec.dimension;
        let Some((period, measures)) = self.admitted(&inputs[n + 1..]) else {
            return Vec::new();
        };
        let mut scales = Vec::new();
        for i in 0..n {
            let (low, high) = match &self.spec.domain {
                Domain::Box { .. } => (measures[i], measures[n + i]),
                Domain::Annulus { .. } => (0.0, measures[1]),
                Domain::Tube { .. } if i < 2 => (0.0, measures[1]),
                Domain::Tube { .. } => (measures[2], measures[3]),
            };
            let far = if class == Class::Far { inputs[i].abs() } else { 0.0 };
            let middle = low + 0.5 * (high - low);
            scales.push(Scale {
                size: (high - low).max(far),
                special: vec![low, high, middle, 0.0, -inputs[i]],
                bounds: None,
            });
        }
        let late = if class == Class::Late { inputs[n].abs() } else { 0.0 };
        scales.push(Scale {
            size: period.max(late),
            special: (0..=8).map(|eighth| period * f64::from(eighth) / 8.0).collect(),
            bounds: None,
        });
        for (parameter, &value) in self.spec.parameters.iter().zip(&inputs[n + 1..]) {
            let inclusive =
                |b: &&Bound| matches!(b.relation, Relation::LessOrEqual | Relation::GreaterOrEqual);
            let limits = parameter.bounds.iter().filter(inclusive).map(|bound| bound.limit);
            let usual = [0.0, -value, 0.5 * value, 2.0 * value, parameter.default];
            scales.push(Scale {
                size: value.abs().max(0.1 * parameter.default.abs()),
                special: usual.into_iter().chain(limits).collect(),
                bounds: between_bounds(parameter),
            });
        }
        scales
    }

    fn attempt(&self, class: Class, random: &mut Random) -> Option<Vec<f64>> {
        let spec = self.spec;
        let mut parameters: Vec<f64> = Vec::new();
        let is_wide = random.one_in(4);
        for (place, parameter) in spec.parameters.iter().enumerate() {
            let mut value = parameter.default * random.between(0.6, 1.4);
            if is_wide {
                value = wide(parameter, random);
            }
            if self.amplitude == Some(place) {
                if random.one_in(4) {
                    value = -value;
                }
                if class == Class::TinyAmplitude {
                    value *= 10_f64.powf(-random.between(4.0, 200.0));
                }
            }
            if parameter.name == "nu" {
                if random.one_in(3) {
                    value = 0.0;
                } else if random.one_in(4) {
                    value = 0.5 - 10_f64.powf(-random.between(1.1, 8.0));
                }
            }
            parameters.push(value);
        }
        let (period, measures) = self.admitted(&parameters)?;
        let mut inputs = self.position(class, &measures, random);
        let late = if class == Class::Late { 10_f64.powf(random.between(2.0, 6.0)) } else { 1.0 };
        let share = random.between(0.0, 1.0);
        // Now and then where the phase is a multiple of an eighth, zero among them.
        let share =
            if random.one_in(8) { (8.0 * share * late).round() / 8.0 } else { share * late };
        inputs.push(period * share);
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
        let (period, measures) = rest.split_first()?;
        (holds.all(|(r, side)| r.relation.holds(side[0], side[1])) && self.has_volume(measures))
            .then(|| (*period, measures.to_vec()))
    }

    /// Whether there is a body of its kind: parameters without bounds may exchange its surfaces, or close its hole.
    fn has_volume(&self, measures: &[f64]) -> bool {
        match &self.spec.domain {
            Domain::Box { lower, .. } => {
                let (lower, upper) = measures.split_at(lower.len());
                lower.iter().zip(upper).all(|(lower, upper)| lower < upper)
            }
            Domain::Annulus { inner, .. } => {
                let is_disc = *inner == Graph::ZERO;
                (measures[0] > 0.0 || is_disc) && measures[0] < measures[1]
            }
            Domain::Tube { inner, .. } => {
                let is_solid = *inner == Graph::ZERO;
                (measures[0] > 0.0 || is_solid)
                    && measures[0] < measures[1]
                    && measures[2] < measures[3]
                    && measures.get(4..6).is_none_or(|angles| angles[0] < angles[1])
            }
        }
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
        let suits = NEAR_INVERSION.contains(&self.smallest_stretch(&found));
        (suits && self.admits(&found) && self.has_energy(&found)).then_some(found)
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
            Domain::Annulus { .. } | Domain::Tube { .. } if axis < n => {
                (inputs[axis], inputs[axis])
            }
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
                        Class::NearOrigin if self.has_axis() && measures[i] != 0.0 => {
                            let low = measures[i];
                            low + (x - low) * 10_f64.powf(-random.between(1.0, 15.0))
                        }
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
                let radius = distance(class, [measures[0], measures[1]], random, place);
                let quarter = std::f64::consts::FRAC_PI_2;
                let angle = place(0.0, quarter, random);
                // On a plane of symmetry the coordinate is zero.
                let cosine = if angle == quarter { 0.0 } else { angle.cos() };
                if n == 2 {
                    return vec![radius * cosine, radius * angle.sin()];
                }
                let polar = place(0.0, quarter, random);
                let height = if polar == quarter { 0.0 } else { polar.cos() };
                let distance = radius * polar.sin();
                vec![distance * cosine, distance * angle.sin(), radius * height]
            }
            Domain::Tube { .. } => {
                let radius = distance(class, [measures[0], measures[1]], random, place);
                let quarter = [0.0, std::f64::consts::FRAC_PI_2];
                let angles = measures.get(4..6).map_or(quarter, |angles| [angles[0], angles[1]]);
                let (sin, cos) = place(angles[0], angles[1], random).sin_cos();
                vec![radius * cos, radius * sin, place(measures[2], measures[3], random)]
            }
        }
    }
}

/// The distance of a place of a class from the origin or the axis, of a body whose first measures are its radii.
fn distance(
    class: Class,
    [inner, outer]: [f64; 2],
    random: &mut Random,
    place: impl Fn(f64, f64, &mut Random) -> f64,
) -> f64 {
    match class {
        Class::NearOrigin => {
            let x = random.between(inner, outer);
            inner + (x - inner) * 10_f64.powf(-random.between(1.0, 15.0))
        }
        Class::Far if random.one_in(4) => inner * INNERMOST.powf(random.between(0.0, 1.0)),
        // Most profiles grow fast: the nearer places are those that suit.
        Class::Far => outer * (1.0 + FARTHEST_RADII * 10_f64.powf(-random.between(0.0, 6.0))),
        _ => place(inner, outer, random),
    }
}

/// A parameter away from its default: by a factor of 2 to 10, or next to one of its bounds, or on it.
fn wide(parameter: &Parameter, random: &mut Random) -> f64 {
    if let Some((low, high)) = between_bounds(parameter).filter(|_| random.one_in(2)) {
        let distance = (high - low) * 10_f64.powf(-random.between(0.5, 7.0));
        return if random.one_in(2) { low + distance } else { high - distance };
    }
    let inclusive = parameter
        .bounds
        .iter()
        .find(|b| matches!(b.relation, Relation::LessOrEqual | Relation::GreaterOrEqual));
    if let Some(bound) = inclusive.filter(|_| random.one_in(4)) {
        return bound.limit;
    }
    let factor = 10_f64.powf(random.between(2_f64.log10(), LARGEST_RATIO.log10()));
    if random.one_in(2) { parameter.default * factor } else { parameter.default / factor }
}

/// Both limits of a parameter that has two.
fn between_bounds(parameter: &Parameter) -> Option<(f64, f64)> {
    match parameter.bounds[..] {
        [one, other] => Some((one.limit.min(other.limit), one.limit.max(other.limit))),
        _ => None,
    }
}

fn length(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// To the rounding of the radius itself.
fn radius_is_between(radius: f64, inner: f64, outer: f64) -> bool {
    let slack = 8.0 * f64::EPSILON * outer;
    (inner - slack..=outer + slack).contains(&radius)
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
