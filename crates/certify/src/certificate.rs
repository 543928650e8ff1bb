//! Certificates that proofs leave behind, to be checked by others.

use crate::propagate::{Judgement, REMAINDER};
use crate::search::{Limits, Proof, prove};
use crate::{CertifyError, Judged, Roundings, STEPS_OF_FACTOR, Scaling, Subject, listing};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The form of the file.
const SCHEMA: &str = "mmsmith.certificate/1";

/// The range of an input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InputRange {
    /// Its name in the specification.
    pub name: String,
    /// The least value.
    pub from: f64,
    /// The greatest value.
    pub to: f64,
}

/// The proof for one entry of a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EntryProof {
    /// The letter of the field.
    pub field: String,
    /// The entry, row by row from 0.
    pub entry: usize,
    /// The line of the program that computes it, from 0.
    pub line: usize,
    /// The factor that is proved.
    pub factor: f64,
    /// The number of boxes.
    pub boxes: usize,
    /// The halvings; see [`Proof::tree`].
    pub tree: String,
}

/// Bounds of the factor `K` over a box, for every field, with all that is needed to check them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// The form of this file.
    pub schema: String,
    /// The name of the solution.
    pub solution: String,
    /// The factor that is proved for all fields.
    pub factor: f64,
    /// The remainder that is not covered, in units of `2^-53` and of the field where all scales are one.
    pub remainder: f64,
    /// Letters of the trees stand for factors of so many parts of one.
    pub steps_of_factor: f64,
    /// The range of each input, coordinates, time, parameters, after scaling.
    pub inputs: Vec<InputRange>,
    /// The inputs that are taken as one, and the resulting units of the other inputs.
    pub scalings: Vec<Scaling>,
    /// The errors that are assumed of functions, in units of `2^-53`.
    pub roundings: Roundings,
    /// The SHA-256 of the program's lines, each with a line feed.
    pub sha256: String,
    /// The operations: a word, then a number, the index of an input, or the lines of the operands.
    pub program: Vec<String>,
    /// The proof of each entry of each field.
    pub fields: Vec<EntryProof>,
}

/// The SHA-256 of lines, in hexadecimal.
fn hash(lines: &[String]) -> String {
    let mut hasher = Sha256::new();
    for line in lines {
        hasher.update(line.as_bytes());
        hasher.update(b"\n");
    }
    hasher.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

impl Certificate {
    /// Compares the certificate with the program and all outputs of `subject`.
    ///
    /// # Errors
    ///
    /// The difference, in words.
    pub fn matches(&self, subject: &Subject) -> Result<(), String> {
        let lines = listing::lines(&subject.program);
        if self.solution != subject.solution {
            return Err(format!("it is about {}, not {}", self.solution, subject.solution));
        }
        if let Some(line) =
            (0..lines.len().max(self.program.len())).find(|&n| lines.get(n) != self.program.get(n))
        {
            let words = |lines: &[String]| lines.get(line).cloned().unwrap_or("nothing".into());
            return Err(format!(
                "line {line} of its program is {}, that of the present one {}",
                words(&self.program),
                words(&lines)
            ));
        }
        if self.sha256 != hash(&lines) {
            return Err("its hash is not that of its program".into());
        }
        let names = self.inputs.iter().map(|input| &input.name);
        if !names.eq(&subject.inputs) {
            return Err("its inputs are others".into());
        }
        let missing = subject.judged.iter().find(|judged| {
            !self.fields.iter().any(|field| {
                (field.field.as_str(), field.entry, field.line)
                    == (judged.field, judged.entry, judged.slot.index())
            })
        });
        match missing {
            Some(judged) => Err(format!("it has no proof for {}[{}]", judged.field, judged.entry)),
            None => Ok(()),
        }
    }

    /// Reads a certificate from the text of [`Certificate::text`].
    ///
    /// # Errors
    ///
    /// Where the text is no certificate.
    pub fn read(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }

    /// The certificate as JSON.
    ///
    /// # Errors
    ///
    /// Where a number is not finite.
    pub fn text(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// Proves the bound of `limits` for every output of `subject`. `step` receives the output that is under way and its finished share;
/// `found` receives each proof, or the reason why there is none.
///
/// `None` where a proof does not close.
pub fn certify(
    subject: &Subject,
    roundings: &Roundings,
    limits: Limits,
    step: &mut dyn FnMut(usize, f64),
    found: &mut dyn FnMut(&Judged, &Result<Proof, CertifyError>),
) -> Option<Certificate> {
    let mut fields = Vec::new();
    let mut known: BTreeMap<usize, Proof> = BTreeMap::new();
    let mut all = true;
    for (place, judged) in subject.judged.iter().enumerate() {
        let proof = match known.get(&judged.slot.index()) {
            Some(proof) => Ok(proof.clone()),
            None => {
                Judgement::new(&subject.program, judged.slot, roundings).and_then(|judgement| {
                    prove(&judgement, &subject.bounds, limits, &mut |share| step(place, share))
                })
            }
        };
        found(judged, &proof);
        let Ok(proof) = proof else {
            all = false;
            continue;
        };
        known.insert(judged.slot.index(), proof.clone());
        fields.push(EntryProof {
            field: judged.field.into(),
            entry: judged.entry,
            line: judged.slot.index(),
            factor: proof.factor,
            boxes: proof.leaves,
            tree: proof.tree,
        });
    }
    if !all {
        return None;
    }
    let program = listing::lines(&subject.program);
    let inputs = subject.inputs.iter().zip(&subject.bounds).map(|(name, bounds)| InputRange {
        name: name.clone(),
        from: bounds.low,
        to: bounds.high,
    });
    Some(Certificate {
        schema: SCHEMA.into(),
        solution: subject.solution.clone(),
        factor: fields.iter().map(|field| field.factor).fold(0.0, f64::max),
        remainder: REMAINDER,
        steps_of_factor: STEPS_OF_FACTOR,
        inputs: inputs.collect(),
        scalings: subject.scalings.clone(),
        roundings: *roundings,
        sha256: hash(&program),
        program,
        fields,
    })
}
