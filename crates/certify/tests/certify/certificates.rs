//! The certificates in the repository, examined by the independent checker; altered certificates; and a planted fault.
#![allow(clippy::unwrap_used)]

use mmsmith_certificate_checker::{LEAST_ROUNDINGS, Refusal, check};
use mmsmith_certify::propagate::Judgement;
use mmsmith_certify::search::{Limits, Open, prove};
use mmsmith_certify::{Certificate, CertifyError, Roundings, Subject, certify, letter};
use mmsmith_expr::Operation;
use mmsmith_spec::Spec;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn subject(name: &str, ranges: &[(&str, f64, f64)]) -> Subject {
    let text = fs::read_to_string(root().join(format!("mms-specs/{name}.toml"))).unwrap();
    let ranges: Vec<_> = ranges.iter().map(|(n, from, to)| ((*n).to_owned(), *from, *to)).collect();
    Subject::new(&Spec::parse(&text, name).unwrap(), &ranges).unwrap()
}

fn kept() -> Vec<(String, String)> {
    let files = fs::read_dir(root().join("tests/data/certificates")).unwrap();
    // An interrupted `mms certify` leaves a file without that ending.
    let mut files: Vec<PathBuf> = files
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .collect();
    files.sort();
    let name = |path: &Path| path.file_stem().unwrap().to_str().unwrap().to_owned();
    files.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

fn refusal(certificate: &Certificate) -> String {
    check(&certificate.text().unwrap()).unwrap_err().to_string()
}

#[test]
fn kept_certificates_hold_and_are_about_the_present_programs() {
    let kept = kept();
    assert!(kept.len() >= 2, "{}", kept.len());
    for (name, text) in kept {
        let found = check(&text).unwrap();
        assert_eq!(found.solution, name);
        assert!(found.factor <= 8.0);
        let certificate = Certificate::read(&text).unwrap();
        certificate.matches(&subject(&name, &[])).unwrap();
        // Every letter of the fields: u, v, a, H, F, J, P, b.
        let mut fields: Vec<&str> = certificate.fields.iter().map(|f| f.field.as_str()).collect();
        fields.dedup();
        assert_eq!(fields.join(""), "uvaHFJPb", "{name}");
    }
}

/// The letter of a factor that is a tenth smaller.
fn cut(letter_of: char) -> char {
    let quarters = (1..=52).find(|n| letter(*n) == Some(letter_of)).unwrap();
    letter((0.9 * f64::from(quarters)) as u32).unwrap()
}

#[test]
fn bounds_that_are_cut_by_a_tenth_are_refused() {
    for (name, text) in kept() {
        let whole = Certificate::read(&text).unwrap();
        let mut leaves = 0;
        for (index, field) in whole.fields.iter().enumerate() {
            // The first leaves of each tree that claim more than the least that can be written.
            let of_tree = field.tree.char_indices().filter(|(_, c)| c.is_alphabetic() && *c != 'A');
            for (place, old) in of_tree.take(4) {
                let mut altered = whole.clone();
                let with = cut(old).to_string();
                altered.fields[index].tree.replace_range(place..=place, &with);
                let answer = check(&altered.text().unwrap()).unwrap_err();
                // Where it was the only leaf of its factor, what the field states is told first.
                let expected =
                    matches!(&answer, Refusal::Leaf { field: of, .. } if *of == field.field);
                assert!(expected, "{name}: {answer}");
                leaves += 1;
            }
            let mut altered = whole.clone();
            altered.fields[index].factor *= 0.9;
            assert!(refusal(&altered).contains("the largest factor of its boxes"), "{name}");
        }
        assert!(leaves >= 12, "{name}: {leaves}");
        let mut altered = whole;
        altered.factor *= 0.9;
        assert!(refusal(&altered).contains("the largest factor of its fields"), "{name}");
    }
}

#[test]
fn trees_that_leave_a_box_out_are_refused() {
    for (name, text) in kept() {
        let whole = Certificate::read(&text).unwrap();
        let index = (0..whole.fields.len()).max_by_key(|n| whole.fields[*n].boxes).unwrap();
        let tree = whole.fields[index].tree.clone();
        assert!(tree.len() > 20, "{name}");
        for place in [0, 1, tree.len() / 2, tree.len() - 1] {
            let mut altered = whole.clone();
            altered.fields[index].tree.remove(place);
            check(&altered.text().unwrap()).unwrap_err();
            let mut altered = whole.clone();
            altered.fields[index].tree.insert(place, 'f');
            check(&altered.text().unwrap()).unwrap_err();
        }
        // With the number of boxes mended as well.
        let mut altered = whole.clone();
        altered.fields[index].tree.pop();
        altered.fields[index].boxes -= 1;
        assert!(refusal(&altered).contains("a box is left out"), "{name}");
        let mut altered = whole;
        altered.fields[index].tree = "f".into();
        altered.fields[index].boxes = 1;
        assert!(matches!(check(&altered.text().unwrap()), Err(Refusal::Leaf { .. })), "{name}");
    }
}

#[test]
fn a_wider_box_is_refused() {
    for (name, text) in kept() {
        let whole = Certificate::read(&text).unwrap();
        let mut altered = whole.clone();
        let amplitude = altered.inputs.iter_mut().find(|input| input.name == "nu").unwrap();
        amplitude.to = 0.499_99;
        amplitude.from = -0.99;
        check(&altered.text().unwrap()).unwrap_err();
        // A length that is fixed by the choice of units cannot be anything else.
        let mut altered = whole;
        let scaled = altered.scalings[0].input;
        altered.inputs[scaled].to = 2.0;
        assert!(refusal(&altered).contains("its range is not one"), "{name}");
    }
}

#[test]
fn smaller_errors_of_operations_are_refused() {
    for (name, text) in kept() {
        for (operation, least) in LEAST_ROUNDINGS {
            let mut altered: serde_json::Value = serde_json::from_str(&text).unwrap();
            altered["roundings"][operation] = (0.9 * least).into();
            let answer = check(&altered.to_string()).unwrap_err().to_string();
            assert!(answer.contains(operation), "{name}: {answer}");
        }
    }
}

#[test]
fn other_programs_are_refused() {
    let kept = kept();
    for (name, text) in &kept {
        let whole = Certificate::read(text).unwrap();
        let own = subject(name, &[]);
        for (other, _) in kept.iter().filter(|(other, _)| other != name) {
            assert!(whole.matches(&subject(other, &[])).is_err());
        }
        let place = whole.program.iter().rposition(|line| line.starts_with("mul")).unwrap();
        let mut altered = whole.clone();
        altered.program[place] = altered.program[place].replace("mul", "div");
        let answer = altered.matches(&own).unwrap_err();
        assert!(answer.contains(&format!("line {place}")), "{answer}");
        // The hash is of the program that the certificate carries.
        let mut altered = whole.clone();
        altered.sha256.replace_range(0..1, "x");
        assert!(altered.matches(&own).is_err());
        // A field that is left out.
        let mut altered = whole.clone();
        altered.fields.pop();
        assert!(altered.matches(&own).unwrap_err().contains("no proof for b["));
        // A sum of a length and a number has no unit.
        let mut altered = whole;
        let sum = altered.program.iter().position(|line| line.starts_with("add")).unwrap();
        altered.program[sum] = "add 0 1".into();
        check(&altered.text().unwrap()).unwrap_err();
    }
}

/// The last operation of F loses nine units instead of one: where the amplitude is zero, K is nine, and its place is told.
#[test]
fn a_planted_error_of_nine_units_is_found() {
    let subject = subject("bar", &[("A", -0.02, 0.02)]);
    let judged = subject.judged.iter().find(|judged| judged.field == "F").unwrap();
    let program = subject.program.part(&[judged.slot]);
    let rounding: Vec<f64> = program
        .operations()
        .iter()
        .map(|o| f64::from(u8::from(!matches!(o, Operation::Input(_) | Operation::Number(_)))))
        .collect();
    let limits = Limits { factor: 8.0, boxes: 300 };
    let sound = Judgement::with_roundings(&program, rounding.clone());
    prove(&sound, &subject.bounds, limits, &mut |_| ()).unwrap();
    let mut planted = rounding;
    *planted.last_mut().unwrap() = 9.0;
    let planted = Judgement::with_roundings(&program, planted);
    let Err(CertifyError::Open(Open { bounds, factor })) =
        prove(&planted, &subject.bounds, limits, &mut |_| ())
    else {
        panic!("K = 9 was accepted");
    };
    assert!((8.0..11.0).contains(&factor), "{factor}");
    let inside = bounds.iter().zip(&subject.bounds);
    assert!(inside.clone().all(|(part, whole)| whole.low <= part.low && part.high <= whole.high));
    assert!(inside.map(|(part, whole)| part == whole).any(|same| !same));
    let place = subject.place(&bounds);
    assert!(place.contains("A L^-1 in [") && place.contains("X L^-1 in ["), "{place}");
}

/// The whole of the road, on a field small enough for a test.
#[test]
fn what_is_proved_is_accepted_by_the_checker() {
    let mut subject = subject("axis-aligned-1d", &[("A", -0.05, 0.05), ("nu", 0.3, 0.3)]);
    subject.judged.retain(|judged| judged.field != "b" && judged.field != "P");
    let limits = Limits { factor: 8.0, boxes: 1000 };
    let found = certify(&subject, &Roundings::default(), limits, &mut |_, _| (), &mut |_, _| ());
    let certificate = found.unwrap();
    let checked = check(&certificate.text().unwrap()).unwrap();
    assert_eq!(checked.factor, certificate.factor);
    certificate.matches(&subject).unwrap();
}

/// Sums of positive and negative terms whose values nearly cancel have no factor: the proof has to fail.
#[test]
fn cancellation_is_not_proved() {
    let text = fs::read_to_string(root().join("mms-specs/bar.toml")).unwrap();
    let cancelling = text
        .replace("X = 'A*sin(2*Pi*X/L)*cos(c*Pi*t/L)'", "X = 'A*(exp(X/L) - exp(X/L + t*c/L))'");
    assert_ne!(text, cancelling);
    let subject = Subject::new(&Spec::parse(&cancelling, "bar").unwrap(), &[]).unwrap();
    let limits = Limits { factor: 8.0, boxes: 50 };
    let mut refused = 0;
    let certificate =
        certify(&subject, &Roundings::default(), limits, &mut |_, _| (), &mut |_, proof| {
            refused += usize::from(proof.is_err());
        });
    assert!(certificate.is_none() && refused > 0);
}
