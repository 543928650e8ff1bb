//! A search for the inputs at which rounding errors are largest.

use crate::accuracy::{DOUBTFUL_FACTOR, Finding};
use crate::sample::{Random, Scale};
use crate::{Accuracy, AccuracyError, Class, ClassAccuracy, Found, JudgedCode, Sampler};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Places that each round tries in each class.
const PLACES: usize = 64;
/// Points next to each other that are evaluated at a place: rounding is rough, and one point says little of a place.
const NEIGHBOURS: usize = 8;
/// Places that each round draws anew; the others are changes of a known one.
const DRAWN: usize = 8;
/// The evaluations of one round in one class.
pub const ROUND: u64 = (PLACES * NEIGHBOURS) as u64;

/// Known places of each field in each class: the worst one, and others from which the search climbs beside it.
const KNOWN: usize = 4;
/// After so many rounds without progress a place other than the worst makes room for a new one.
const PATIENCE: u64 = 24;
/// Limit of places of each field in a round that quick arithmetic finds doubtful and that the oracle is asked about.
const MOST_DOUBTED: usize = 2;
/// Draws of a search are none of those that [`Accuracy::measure`] judges.
const FIRST_DRAW: u64 = 1 << 40;
/// How often a change that leaves the class is tried anew.
const MOST_CHANGES: usize = 20;

/// A place that is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Known {
    /// The entry of the field.
    entry: usize,
    /// The largest factor there, [`f64::MAX`] at most.
    factor: f64,
    /// Position, time, parameters.
    inputs: Vec<f64>,
    /// The round of its last progress.
    since: u64,
}

/// One class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct ClassSearch {
    class: Class,
    evaluations: u64,
    /// Points left out, see [`ClassAccuracy::at_switch`].
    #[serde(default)]
    at_switch: u64,
    /// For each field the worst place first, then those that compete with it.
    known: Vec<Vec<Known>>,
}

/// A search for the largest factor `K` of each field in each class, without derivatives, from many starts.
///
/// It is a value: written out and read back it goes on as if nothing had happened. Random numbers follow from the number of the
/// round, and what the threads of a round find is gone through in order, so that the result depends on the number of rounds only.
///
/// A round tries [`ROUND`] points in each class, some of them drawn anew, most of them changes of the worst places known: of one
/// input or several, by steps from the size of the body to a unit in the last place, to values at which terms vanish or
/// coincide, to the bounds of parameters, or in the direction between two known places. Around each place some points that
/// differ in last digits are judged, since rounding is rough there. The truth has some 100 bits at first; whatever seems worse
/// than 3 counts only as the oracle confirms it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Search {
    rounds: u64,
    classes: Vec<ClassSearch>,
}

/// Findings at one place: the worst neighbour for each field.
struct Place {
    /// Field and number of the known place that was changed; `None` for a draw.
    origin: Option<(usize, usize)>,
    evaluations: u64,
    at_switch: u64,
    found: Vec<(Finding, Vec<f64>)>,
}

impl Search {
    /// The search that knows nothing yet.
    #[must_use]
    pub fn new(accuracy: &Accuracy<'_>) -> Self {
        let applies = |class: &Class| accuracy.not_applicable(*class).is_none();
        let fields = accuracy.field_count();
        let classes = Class::ALL
            .into_iter()
            .filter(applies)
            .map(|class| ClassSearch {
                class,
                evaluations: 0,
                at_switch: 0,
                known: vec![Vec::new(); fields],
            })
            .collect();
        Search { rounds: 0, classes }
    }

    /// Whether it is one of a specification with these fields, inputs and classes.
    #[must_use]
    pub fn suits(&self, accuracy: &Accuracy<'_>) -> bool {
        let inputs = accuracy.input_names().len();
        let new = Search::new(accuracy);
        self.classes.len() == new.classes.len()
            && self.classes.iter().zip(&new.classes).all(|(own, new)| {
                own.class == new.class
                    && own.known.len() == new.known.len()
                    && own.known.iter().flatten().all(|known| known.inputs.len() == inputs)
            })
    }

    /// The rounds that were done.
    #[must_use]
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// The evaluations in all classes.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.classes.iter().map(|class| class.evaluations).sum()
    }

    /// Takes points that were drawn for places to start from.
    pub fn begin_at(&mut self, accuracy: &Accuracy<'_>, drawn: &ClassAccuracy) {
        let Some(search) = self.classes.iter_mut().find(|c| c.class == drawn.class) else { return };
        for worst in &drawn.worst {
            let Some(field) = accuracy.field_index(worst.field) else { continue };
            let known = Known {
                entry: worst.entry,
                factor: worst.factor.min(f64::MAX),
                inputs: worst.inputs.clone(),
                since: self.rounds,
            };
            search.take(field, known);
        }
    }

    /// Judges all known places anew: for code that has changed since they were found.
    ///
    /// # Errors
    ///
    /// [`AccuracyError`] where `judged` fails.
    pub fn judge_again(
        &mut self,
        accuracy: &Accuracy<'_>,
        judged: JudgedCode<'_>,
    ) -> Result<(), AccuracyError> {
        for search in &mut self.classes {
            let class = search.class;
            for (field, places) in search.known.iter_mut().enumerate() {
                let again = places
                    .par_iter()
                    .map(|known| {
                        let sens = accuracy.quick_sensitivities(&known.inputs);
                        let found = accuracy.quick_look(class, &known.inputs, &sens, judged)?;
                        let Some(found) = found.into_iter().nth(field) else { return Ok(None) };
                        Ok(confirmed(accuracy, &found, &known.inputs, judged)?
                            .map(|factor| Known { entry: found.entry, factor, ..known.clone() }))
                    })
                    .collect::<Result<Vec<_>, AccuracyError>>()?;
                *places = again.into_iter().flatten().collect();
                let factors = places.iter().map(|known| known.factor).enumerate();
                if let Some((worst, _)) = factors.max_by(|a, b| a.1.total_cmp(&b.1)) {
                    places.swap(0, worst);
                }
            }
        }
        Ok(())
    }

    /// One round in every class. The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// [`AccuracyError`] at the first place where `judged` fails.
    pub fn advance(
        &mut self,
        accuracy: &Accuracy<'_>,
        judged: JudgedCode<'_>,
    ) -> Result<(), AccuracyError> {
        self.rounds += 1;
        let round = self.rounds;
        for search in &mut self.classes {
            let places = (0..PLACES)
                .into_par_iter()
                .map(|number| search.try_place(accuracy, round, number, judged))
                .collect::<Result<Vec<Place>, AccuracyError>>()?;
            search.evaluations += places.iter().map(|place| place.evaluations).sum::<u64>();
            search.at_switch += places.iter().map(|place| place.at_switch).sum::<u64>();
            search.learn(accuracy, round, &places, judged)?;
        }
        Ok(())
    }

    /// The worst of each field, confirmed in arbitrary precision: what was drawn for the class, and what the search has found
    /// where that is worse.
    ///
    /// # Errors
    ///
    /// [`AccuracyError`] where `judged` or the oracle fails at one of these points.
    pub fn worst(
        &self,
        accuracy: &Accuracy<'_>,
        drawn: ClassAccuracy,
        judged: JudgedCode<'_>,
    ) -> Result<ClassAccuracy, AccuracyError> {
        let Some(search) = self.classes.iter().find(|c| c.class == drawn.class) else {
            return Ok(drawn);
        };
        let confirmed = search
            .known
            .par_iter()
            .enumerate()
            .map(|(field, places)| {
                let Some(known) = places.first() else { return Ok(None) };
                let finding = Finding { field, entry: known.entry, factor: known.factor };
                match accuracy.confirm(&known.inputs, &finding, Found::Search, &[], judged) {
                    // Digits that do not settle say nothing against the code.
                    Err(AccuracyError::Oracle { .. }) => Ok(None),
                    worst => worst.map(Some),
                }
            })
            .collect::<Result<Vec<_>, AccuracyError>>()?;
        let mut worst = drawn.worst.clone();
        for found in confirmed.into_iter().flatten() {
            match worst.iter_mut().find(|known| known.field == found.field) {
                Some(known) if found.factor > known.factor => *known = found,
                Some(_) => {}
                None => worst.push(found),
            }
        }
        let in_order = |field: &str| accuracy.field_index(field);
        worst.sort_by_key(|worst| in_order(worst.field));
        let at_switch = drawn.at_switch + search.at_switch;
        Ok(ClassAccuracy { searched: search.evaluations, at_switch, worst, ..drawn })
    }
}

impl ClassSearch {
    /// Puts a place among those of a field: first where it is the worst.
    fn take(&mut self, field: usize, known: Known) {
        let Some(places) = self.known.get_mut(field) else { return };
        if places.first().is_none_or(|worst| known.factor > worst.factor) {
            places.insert(0, known);
        } else if places.len() < KNOWN && places.iter().all(|other| other.inputs != known.inputs) {
            places.push(known);
        }
        places.truncate(KNOWN);
    }

    /// One place of a round: a draw, or a change of a known place.
    fn try_place(
        &self,
        accuracy: &Accuracy<'_>,
        round: u64,
        number: usize,
        judged: JudgedCode<'_>,
    ) -> Result<Place, AccuracyError> {
        let sampler = accuracy.sampler();
        let mut random = Random::of_three(self.class as u64, round, number as u64);
        let fields = self.known.len();
        // Every field has the same share of the changes; the worst place has half of them.
        let field = number % fields;
        let origin = match self.known[field].len() {
            _ if number < DRAWN => None,
            0 => None,
            count if random.one_in(2) => Some((field, random.below(count))),
            _ => Some((field, 0)),
        };
        let base = match origin {
            None => {
                let index = FIRST_DRAW + round * PLACES as u64 + number as u64;
                sampler.draw(self.class, index)
            }
            Some((field, which)) => self.changed(sampler, field, which, &mut random),
        };
        let mut place = Place { origin, evaluations: 0, at_switch: 0, found: Vec::new() };
        let Some(base) = base else { return Ok(place) };
        let sens = accuracy.quick_sensitivities(&base);
        for neighbour in 0..NEIGHBOURS {
            let mut inputs = base.clone();
            if neighbour > 0 {
                move_last_digits(&mut inputs, &mut random);
                if !sampler.belongs(self.class, &inputs) {
                    continue;
                }
            }
            if accuracy.is_at_switch(&inputs) {
                place.at_switch += 1;
                continue;
            }
            let found = accuracy.quick_look(self.class, &inputs, &sens, judged)?;
            place.evaluations += 1;
            if place.found.is_empty() {
                place.found = found.into_iter().map(|found| (found, inputs.clone())).collect();
                continue;
            }
            for (known, found) in place.found.iter_mut().zip(found) {
                if found.factor > known.0.factor {
                    *known = (found, inputs.clone());
                }
            }
        }
        Ok(place)
    }

    /// A known place with some of its inputs changed, within the class.
    fn changed(
        &self,
        sampler: &Sampler<'_>,
        field: usize,
        which: usize,
        random: &mut Random,
    ) -> Option<Vec<f64>> {
        let known = &self.known[field][which].inputs;
        let scales = sampler.scales(self.class, known);
        if scales.is_empty() {
            return None;
        }
        (0..MOST_CHANGES).find_map(|_| {
            let mut inputs = known.clone();
            let step = 10_f64.powf(-random.between(0.0, 16.0));
            match random.below(20) {
                0..8 => {
                    let which = random.below(inputs.len());
                    inputs[which] += scales[which].step(step, random);
                }
                8..12 => {
                    for (input, scale) in inputs.iter_mut().zip(&scales) {
                        if random.one_in(2) {
                            *input += scale.step(step, random);
                        }
                    }
                }
                12..16 => {
                    let which = random.below(inputs.len());
                    inputs[which] = scales[which].special(inputs[which], random);
                }
                _ => self.cross(&mut inputs, random),
            }
            let suits = inputs != *known
                && sampler.belongs(self.class, &inputs)
                && sampler.deformation_suits(self.class, &inputs);
            suits.then_some(inputs)
        })
    }

    /// Moves along the difference of two other known places, or takes some inputs of another one.
    fn cross(&self, inputs: &mut [f64], random: &mut Random) {
        let other = |random: &mut Random| {
            let places = &self.known[random.below(self.known.len())];
            (!places.is_empty()).then(|| &places[random.below(places.len())].inputs)
        };
        let (Some(one), Some(another)) = (other(random), other(random)) else { return };
        if random.one_in(2) {
            let factor = random.between(-1.0, 1.0);
            for (input, (one, another)) in inputs.iter_mut().zip(one.iter().zip(another)) {
                *input += factor * (one - another);
            }
        } else {
            for (input, one) in inputs.iter_mut().zip(one) {
                if random.one_in(2) {
                    *input = *one;
                }
            }
        }
    }

    /// Goes through what a round has found, in order.
    fn learn(
        &mut self,
        accuracy: &Accuracy<'_>,
        round: u64,
        places: &[Place],
        judged: JudgedCode<'_>,
    ) -> Result<(), AccuracyError> {
        for field in 0..self.known.len() {
            let mut found: Vec<(&Place, &Finding, &Vec<f64>)> = places
                .iter()
                .filter_map(|place| {
                    place.found.get(field).map(|(finding, inputs)| (place, finding, inputs))
                })
                .collect();
            found.sort_by(|a, b| b.1.factor.total_cmp(&a.1.factor));
            let mut doubted = 0;
            for (place, finding, inputs) in found {
                let own = place.origin.filter(|origin| origin.0 == field).map(|origin| origin.1);
                let places = &self.known[field];
                let worst = places.first().map_or(-1.0, |known| known.factor);
                // What grew out of one of the other places competes with that place, and all compete with the worst.
                let target = own.filter(|&which| {
                    which > 0 && places.get(which).is_some_and(|k| finding.factor > k.factor)
                });
                let stale = (1..KNOWN).find(|&which| {
                    places.get(which).is_none_or(|known| known.since + PATIENCE < round)
                });
                let restarted = stale.filter(|_| place.origin.is_none());
                let beats_worst = finding.factor > worst;
                if !beats_worst && target.is_none() && restarted.is_none() {
                    continue;
                }
                if finding.factor > DOUBTFUL_FACTOR {
                    doubted += 1;
                    if doubted > MOST_DOUBTED {
                        continue;
                    }
                }
                let Some(factor) = confirmed(accuracy, finding, inputs, judged)? else { continue };
                let known =
                    Known { entry: finding.entry, factor, inputs: inputs.clone(), since: round };
                let places = &mut self.known[field];
                if factor > worst {
                    match places.first_mut() {
                        Some(first) => *first = known.clone(),
                        None => places.push(known.clone()),
                    }
                }
                let which = target.filter(|&which| factor > places[which].factor).or(restarted);
                if let Some(which) = which {
                    match places.get_mut(which) {
                        Some(other) => *other = known,
                        None => places.push(known),
                    }
                }
            }
        }
        Ok(())
    }
}

/// The factor of a finding as it counts: by the oracle where it is doubtful, and none where the oracle has no value. What
/// remains the worst at the end is confirmed in arbitrary precision.
fn confirmed(
    accuracy: &Accuracy<'_>,
    finding: &Finding,
    inputs: &[f64],
    judged: JudgedCode<'_>,
) -> Result<Option<f64>, AccuracyError> {
    if finding.factor <= DOUBTFUL_FACTOR {
        return Ok(Some(finding.factor));
    }
    let factor = accuracy.looked_up(inputs, finding, judged)?;
    Ok(factor.map(|factor| factor.min(f64::MAX)))
}

impl Scale {
    /// A change by a share of the largest one.
    fn step(&self, share: f64, random: &mut Random) -> f64 {
        self.size * share * random.between(-1.0, 1.0)
    }

    /// A value at which something may vanish or coincide, or one at a distance from a bound that is as likely to be small as
    /// large.
    fn special(&self, value: f64, random: &mut Random) -> f64 {
        if let Some((low, high)) = self.bounds.filter(|_| random.one_in(2)) {
            let distance = (high - low) * 10_f64.powf(-random.between(0.5, 9.0));
            return if random.one_in(2) { low + distance } else { high - distance };
        }
        if self.special.is_empty() {
            return value;
        }
        self.special[random.below(self.special.len())]
    }
}

/// Moves some of the inputs by some units in their last places.
fn move_last_digits(inputs: &mut [f64], random: &mut Random) {
    let most = 1 << random.below(6);
    for input in inputs {
        if *input != 0.0 && random.one_in(2) {
            let units = random.below(most) as u64 + 1;
            let bits = input.to_bits();
            // Never across zero, and never to what is no number.
            let moved = if random.one_in(2) {
                bits.saturating_add(units)
            } else {
                bits.saturating_sub(units)
            };
            let moved = f64::from_bits(moved);
            if moved.is_finite() && moved.is_sign_negative() == input.is_sign_negative() {
                *input = moved;
            }
        }
    }
}
