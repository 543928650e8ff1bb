//! An independent check of certificates of accuracy.
//!
//! It shares no code with `mmsmith-certify`, which proves them, and depends on nothing of this workspace. A certificate says `|r - g|
//! <= 2^-53 (K (s + |g|) + remainder)` for the results `r` of its program over a box. The page "Certificates" of the book has the
//! theory. The check covers four claims: the trees tile the box; the bound of each leaf holds by this crate's own intervals; errors of
//! functions are assumed no smaller than [`LEAST_ROUNDINGS`]; inputs that are taken as one may be so. The caller compares the program
//! with the program of the present source.

mod bound;
mod number;

use bound::{Line, Program};
use number::Range;
use serde::Deserialize;
use std::collections::BTreeMap;
use thiserror::Error;

/// The largest factor that a certificate may state.
const LARGEST_FACTOR: f64 = 8.0;
/// The largest remainder, in units of `2^-53` and of the field where all scales are one.
const LARGEST_REMAINDER: f64 = 1e-10;
/// Letters of trees stand for factors of so many parts of one.
const STEPS: f64 = 4.0;
/// The least errors of operations that may be assumed, in units of `2^-53`, by their names in certificates.
pub const LEAST_ROUNDINGS: [(&str, f64); 5] = [
    ("arithmetic", 1.0),
    ("pi", 0.351),
    ("trigonometric_pi", 2.0),
    ("trigonometric", 2.0),
    ("logarithm", 3.0),
];

/// The bound that a certificate proves.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// The solution that the certificate names.
    pub solution: String,
    /// The factor over all fields.
    pub factor: f64,
    /// The boxes that were evaluated.
    pub boxes: usize,
}

/// The reason why a certificate is refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Refusal {
    /// The text cannot be read.
    #[error("it is no certificate: {0}")]
    Form(String),
    /// The certificate states something that is not true.
    #[error("{0}")]
    Claim(String),
    /// A leaf whose bound does not hold.
    #[error("{field}[{entry}]: K <= {claimed} does not hold for {place}")]
    Leaf {
        /// The letter of the field.
        field: String,
        /// The entry, row by row from 0.
        entry: usize,
        /// The bound that the leaf claims.
        claimed: f64,
        /// The ranges of the inputs.
        place: String,
    },
}

/// The form of certificates that this version reads.
const SCHEMA: &str = "mmsmith.certificate/1";

#[derive(Deserialize)]
struct Form {
    schema: String,
}

#[derive(Deserialize)]
struct Certificate {
    solution: String,
    factor: f64,
    remainder: f64,
    steps_of_factor: f64,
    inputs: Vec<Input>,
    scalings: Vec<Scaling>,
    roundings: BTreeMap<String, f64>,
    program: Vec<String>,
    fields: Vec<Field>,
}

#[derive(Deserialize)]
struct Input {
    name: String,
    from: f64,
    to: f64,
}

#[derive(Deserialize)]
struct Scaling {
    input: usize,
    exponents: Vec<f64>,
}

#[derive(Deserialize)]
struct Field {
    field: String,
    entry: usize,
    line: usize,
    factor: f64,
    boxes: usize,
    tree: String,
}

fn claim(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), Refusal> {
    if holds { Ok(()) } else { Err(Refusal::Claim(otherwise())) }
}

/// Checks the text of a certificate.
///
/// # Errors
///
/// [`Refusal`] with the first fault.
pub fn check(text: &str) -> Result<Checked, Refusal> {
    let refused = |error: serde_json::Error| Refusal::Form(error.to_string());
    let Form { schema } = serde_json::from_str(text).map_err(refused)?;
    claim(schema == SCHEMA, || match schema.starts_with("mmsmith.certificate/") {
        true => {
            format!("its form is '{schema}', of a later version of mms; this one knows '{SCHEMA}'")
        }
        false => "its schema is another".into(),
    })?;
    let stated: Certificate = serde_json::from_str(text).map_err(refused)?;
    claim(stated.steps_of_factor == STEPS, || "its letters mean other factors".into())?;
    claim((0.0..=LARGEST_REMAINDER).contains(&stated.remainder), || {
        format!("its remainder is above {LARGEST_REMAINDER:e}")
    })?;
    for (name, least) in LEAST_ROUNDINGS {
        claim(stated.roundings.get(name).is_some_and(|own| *own >= least && *own < 1e3), || {
            format!("it assumes that {name} loses less than {least} units of 2^-53")
        })?;
    }
    for input in &stated.inputs {
        let finite = input.from.is_finite() && input.to.is_finite();
        claim(finite && input.from <= input.to, || format!("{} has no range", input.name))?;
    }
    let lines = stated.program.iter().enumerate();
    let program: Vec<Line> = lines
        .map(|(n, text)| {
            let line = Line::read(text, n, stated.inputs.len());
            line.ok_or_else(|| Refusal::Form(format!("line {n} of the program is '{text}'")))
        })
        .collect::<Result<_, _>>()?;
    for scaling in &stated.scalings {
        check_scaling(scaling, &stated, &program)?;
    }
    let whole: Vec<Range> = stated.inputs.iter().map(|i| Range::new(i.from, i.to)).collect();
    let mut boxes = 0;
    claim(!stated.fields.is_empty(), || "it has no fields".into())?;
    for field in &stated.fields {
        let name = || format!("{}[{}]", field.field, field.entry);
        claim(field.line < program.len(), || format!("{}: there is no such line", name()))?;
        let program = Program::new(&program, field.line, &stated.roundings);
        let mut leaves = Leaves {
            field,
            stated: &stated,
            program,
            tree: field.tree.chars(),
            count: 0,
            worst: 0.0,
        };
        leaves.part(whole.clone(), 0)?;
        claim(leaves.tree.next().is_none(), || format!("{}: its tree has more boxes", name()))?;
        claim(leaves.count == field.boxes, || format!("{}: it has other boxes", name()))?;
        claim(leaves.worst == field.factor, || {
            format!("{}: the largest factor of its boxes is {}", name(), leaves.worst)
        })?;
        boxes += leaves.count;
    }
    let worst = stated.fields.iter().map(|field| field.factor).fold(0.0, f64::max);
    claim(worst == stated.factor && worst <= LARGEST_FACTOR, || {
        format!("the largest factor of its fields is {worst}")
    })?;
    Ok(Checked { solution: stated.solution, factor: worst, boxes })
}

/// An input may be taken as one where a change of its unit multiplies each value by a number, sums included, and changes no
/// argument of a function; the same change leaves other inputs that are one as they are.
fn check_scaling(of: &Scaling, stated: &Certificate, program: &[Line]) -> Result<(), Refusal> {
    let refuse = |what: &str| Err(Refusal::Claim(format!("scaling of input {}: {what}", of.input)));
    let one = |n: usize| stated.inputs.get(n).is_some_and(|i| (i.from, i.to) == (1.0, 1.0));
    if of.exponents.len() != stated.inputs.len() || !one(of.input) {
        return refuse("its range is not one");
    }
    for other in &stated.scalings {
        let expected = if other.input == of.input { 1.0 } else { 0.0 };
        if of.exponents.get(other.input) != Some(&expected) {
            return refuse("it changes another input that is one");
        }
    }
    let mut units: Vec<f64> = Vec::with_capacity(program.len());
    for line in program {
        let Some(unit) = line.unit(&units, &of.exponents) else {
            return refuse("a sum or a function has operands of other units");
        };
        units.push(unit);
    }
    Ok(())
}

/// The leaves of one tree, in their order.
struct Leaves<'a> {
    field: &'a Field,
    stated: &'a Certificate,
    program: Program<'a>,
    tree: std::str::Chars<'a>,
    count: usize,
    worst: f64,
}

impl Leaves<'_> {
    /// The next part of the tree, which has to cover the box `ranges`; a part that is halved has both halves.
    fn part(&mut self, ranges: Vec<Range>, depth: usize) -> Result<(), Refusal> {
        let name = || format!("{}[{}]", self.field.field, self.field.entry);
        claim(depth < 2000, || format!("{}: its tree is too deep", name()))?;
        let Some(letter) = self.tree.next() else {
            return Err(Refusal::Claim(format!("{}: a box is left out of its tree", name())));
        };
        if let Some(input) = letter.to_digit(10) {
            let input = input as usize;
            claim(input < ranges.len(), || format!("{}: it halves input {input}", name()))?;
            let whole = ranges[input];
            let middle = whole.low + 0.5 * (whole.high - whole.low);
            claim(whole.low < middle && middle < whole.high, || {
                format!("{}: a box cannot be halved", name())
            })?;
            let mut lower = ranges.clone();
            let mut upper = ranges;
            (lower[input].high, upper[input].low) = (middle, middle);
            self.part(lower, depth + 1)?;
            return self.part(upper, depth + 1);
        }
        let place = match letter {
            'A'..='Z' => letter as u32 - 'A' as u32,
            'a'..='z' => letter as u32 - 'a' as u32 + 26,
            _ => return Err(Refusal::Claim(format!("{}: its tree has a '{letter}'", name()))),
        };
        let claimed = f64::from(place + 1) / STEPS;
        self.count += 1;
        self.worst = self.worst.max(claimed);
        let inputs = self.stated.inputs.iter().map(|input| input.name.as_str());
        let ranges: Vec<(&str, Range)> = inputs.zip(ranges).collect();
        if self.program.keeps(&ranges, claimed, self.stated.remainder) {
            return Ok(());
        }
        let words = ranges.iter().map(|(name, r)| format!("{name} in [{:e}, {:e}]", r.low, r.high));
        Err(Refusal::Leaf {
            field: self.field.field.clone(),
            entry: self.field.entry,
            claimed,
            place: words.collect::<Vec<_>>().join(", "),
        })
    }
}
