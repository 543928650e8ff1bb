//! Losses of a specification while a rule of the derivation is off.

use crate::{Accuracy, Class, JudgedCode, LARGEST_FACTOR, Oracle, programs};
use mmsmith_expr::rules::{self, Row, Serves};
use mmsmith_expr::{Program, Rational, Rule, nearest_f64};
use mmsmith_spec::{Fields, Spec};
use mmsmith_stage::Staged;
use std::cell::OnceCell;

/// Bits of the truth.
const BITS: usize = 256;
/// Squares and exponentials leave the range of doubles below this.
const SMALLEST_JUDGED: f64 = 1e-280;

/// An entry of a field at a point.
struct Entry {
    /// The exact value as the sum of two doubles.
    truth: [f64; 2],
    /// The answer to the inputs, in doubles, and in arbitrary precision where that has been asked for.
    quick: f64,
    answer: OnceCell<f64>,
}

/// A point with exact values.
struct Question {
    class: Class,
    inputs: Vec<f64>,
    /// Field after field.
    entries: Vec<Entry>,
}

/// Points of a specification at which forms of its fields are judged, each against the same exact values.
pub struct Exam<'a> {
    accuracy: &'a Accuracy<'a>,
    questions: Vec<Question>,
}

/// The largest factor `K` of a field in a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// The class.
    pub class: Class,
    /// The letter of the field.
    pub field: &'static str,
    /// The factor.
    pub factor: f64,
}

/// A field that keeps the factor of 8 with a rule and does not without it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// The field with its factor, without the rule.
    pub without: Mark,
    /// The factor with the rule.
    pub with: f64,
}

/// A specification without a rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// The largest loss of digits, for a rule that serves these; an infinite one where the fields cannot be derived.
    pub loss: Option<Loss>,
    /// How much more work the body force is.
    pub work: f64,
    /// How much longer the code is, in lines.
    pub lines: i64,
}

/// The fields of a specification in one form.
struct Form {
    programs: Vec<(&'static str, Program)>,
    work: usize,
    lines: usize,
}

/// The code that is written for a specification, in lines.
pub type Lines<'a> = &'a dyn Fn(&Spec, Fields) -> usize;

impl<'a> Exam<'a> {
    /// Draws `points` of each class. Those at which a field has no value are left out.
    #[must_use]
    pub fn new(accuracy: &'a Accuracy<'a>, points: u64) -> Self {
        let mut questions = Vec::new();
        let classes = Class::ALL.iter().filter(|class| accuracy.not_applicable(**class).is_none());
        if let Ok(mut oracle) = Oracle::new(BITS) {
            for (&class, index) in classes.flat_map(|class| (0..points).map(move |n| (class, n))) {
                let inputs = accuracy.sampler().draw(class, index);
                let inputs = inputs.filter(|inputs| !accuracy.is_at_switch(inputs));
                let Some(inputs) = inputs else { continue };
                let Ok(truth) = accuracy.truth(&mut oracle, &inputs) else { continue };
                let answers = accuracy.quick_sensitivities(&inputs);
                let entries = truth.into_iter().zip(answers);
                let entries = entries
                    .map(|(truth, quick)| Entry {
                        truth: parts(&truth),
                        quick,
                        answer: OnceCell::new(),
                    })
                    .collect();
                questions.push(Question { class, inputs, entries });
            }
        }
        Exam { accuracy, questions }
    }

    /// The largest factor of each field in each class.
    ///
    /// # Errors
    ///
    /// A text where `judged` fails.
    pub fn marks(&self, judged: JudgedCode<'_>) -> Result<Vec<Mark>, String> {
        let mut marks: Vec<Mark> = Vec::new();
        for Question { class, inputs, entries } in &self.questions {
            let results = self.accuracy.results(inputs, judged).map_err(|e| e.to_string())?;
            let mut places = entries.iter().enumerate();
            for (field, results) in self.accuracy.letters().zip(&results) {
                let place = marks.iter().position(|m| (m.class, m.field) == (*class, field));
                let place = place.unwrap_or_else(|| {
                    marks.push(Mark { class: *class, field, factor: 0.0 });
                    marks.len() - 1
                });
                let mark = &mut marks[place];
                for (&result, (place, entry)) in results.iter().zip(&mut places) {
                    let is_small = class.may_underflow() || result.abs() < SMALLEST_JUDGED;
                    if is_small && entry.quick < SMALLEST_JUDGED {
                        continue;
                    }
                    let factor = |answer| entry.factor(result, answer);
                    // In doubles the answer itself may have lost its digits.
                    if factor(entry.quick) > mark.factor.max(LARGEST_FACTOR) {
                        let answer = || self.accuracy.answer(inputs, place).unwrap_or(entry.quick);
                        mark.factor = mark.factor.max(factor(*entry.answer.get_or_init(answer)));
                    } else {
                        mark.factor = mark.factor.max(factor(entry.quick).min(LARGEST_FACTOR));
                    }
                }
            }
        }
        Ok(marks)
    }

    /// The largest factor among the fields that keep 8 in `with`.
    fn loss(with: &[Mark], without: &[Mark]) -> Option<Loss> {
        let pairs = with.iter().zip(without);
        let lost = pairs.filter(|(with, without)| {
            with.factor <= LARGEST_FACTOR && without.factor > LARGEST_FACTOR
        });
        let worst = lost.max_by(|a, b| a.1.factor.total_cmp(&b.1.factor))?;
        Some(Loss { without: *worst.1, with: worst.0.factor })
    }
}

impl Entry {
    /// The factor `K` of a result, to some digits.
    fn factor(&self, result: f64, answer: f64) -> f64 {
        let [high, low] = self.truth;
        let error = ((result - high) - low).abs();
        if result == high || error == 0.0 {
            return 0.0;
        }
        let factor = error / (0.5 * f64::EPSILON * (answer + high.abs())).max(f64::from_bits(1));
        if factor.is_nan() { f64::INFINITY } else { factor }
    }
}

/// A number as the sum of two doubles.
fn parts(number: &Rational) -> [f64; 2] {
    let high = nearest_f64(number);
    let rest = Rational::from_float(high).map(|high| nearest_f64(&(number - high)));
    [high, rest.unwrap_or(0.0)]
}

impl Form {
    fn new(text: &str, rule: Option<Rule>, lines: Lines<'_>) -> Result<Self, String> {
        rules::without(rule, || {
            let spec = Spec::parse(text, "specification").map_err(|error| error.to_string())?;
            let fields = spec.derive().map_err(|error| error.to_string())?;
            let staged = Staged::of(&spec, fields.clone());
            let work = staged.body_force_operations().work();
            Ok(Form { programs: programs(&staged), work, lines: lines(&spec, fields) })
        })
    }

    fn marks(&self, exam: &Exam<'_>) -> Result<Vec<Mark>, String> {
        exam.marks(&|inputs| {
            let values = self.programs.iter().map(|(letter, p)| (*letter, p.evaluate(inputs)));
            Ok(values.collect())
        })
    }

    fn is_same(&self, other: &Form) -> bool {
        let mut pairs = self.programs.iter().zip(&other.programs);
        pairs.all(|((_, a), (_, b))| (a.operations(), a.outputs()) == (b.operations(), b.outputs()))
    }
}

/// A specification with all rules, and without each of `switched`: `None` where nothing changes.
///
/// # Errors
///
/// A text where the specification has no fields.
pub fn ablated(
    text: &str,
    switched: &[Row],
    points: u64,
    lines: Lines<'_>,
) -> Result<(Vec<Mark>, Vec<Option<Effect>>), String> {
    let spec = Spec::parse(text, "specification").map_err(|error| error.to_string())?;
    let fields = spec.derive().map_err(|error| error.to_string())?;
    let accuracy = Accuracy::new(&spec, fields);
    let exam = Exam::new(&accuracy, points);
    let with = Form::new(text, None, lines)?;
    let marks = with.marks(&exam)?;
    let effect = |row: &Row| -> Result<Option<Effect>, String> {
        let Ok(without) = Form::new(text, Some(row.rule), lines) else {
            let nothing = Mark { class: Class::Ordinary, field: "all", factor: f64::INFINITY };
            let loss = Some(Loss { without: nothing, with: 0.0 });
            return Ok(Some(Effect { loss, work: 1.0, lines: 0 }));
        };
        if without.is_same(&with) {
            return Ok(None);
        }
        let loss = match row.serves {
            Serves::Digits => Exam::loss(&marks, &without.marks(&exam)?),
            Serves::Work => None,
        };
        let work = without.work as f64 / with.work.max(1) as f64;
        Ok(Some(Effect { loss, work, lines: without.lines as i64 - with.lines as i64 }))
    };
    let effects = switched.iter().map(effect).collect::<Result<_, _>>()?;
    Ok((marks, effects))
}
