//! `mms certify`: a proof of the factor K over a box of inputs, or the check of one.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow};
use mmsmith_certificate_checker::check;
use mmsmith_certify::search::{Limits, Proof};
use mmsmith_certify::{Certificate, CertifyError, Judged, Roundings, Subject, certify as prove};

use crate::arguments::CertifyOptions;
use crate::input;
use crate::json::Output;
use crate::library::locate;
use crate::progress::Bar;
use crate::table::Table;
use crate::terminal;

/// The longest certificate that is read.
const LONGEST: u64 = 64 << 20;

pub(crate) fn certify(options: &CertifyOptions) -> Result<bool> {
    let spec = locate(&options.solution)?.specification()?;
    let subject = Subject::new(&spec, &options.ranges)
        .map_err(|error| anyhow!("{}: {error}", options.solution))?;
    if let Some(file) = &options.check {
        return checked(file, &subject);
    }
    let output = Output::prepare_if(options.out.as_ref())?;
    let mut table = Table::new(1, ["field", "K proved", "boxes", "seconds"]);
    let mut open = String::new();
    let bar = Bar::new(&subject.solution);
    let count = subject.judged.len() as f64;
    let mut begun = Instant::now();
    let certificate = prove(
        &subject,
        &Roundings::default(),
        Limits { factor: options.factor, boxes: options.boxes },
        &mut |place, share| {
            let field = &subject.judged[place];
            let what = || format!("{}, {}[{}]", subject.solution, field.field, field.entry);
            bar.show_share(what, (place as f64 + share) / count);
        },
        &mut |judged: &Judged, proof: &Result<Proof, CertifyError>| {
            let name = format!("{}[{}]", judged.field, judged.entry);
            let seconds = format!("{:.2}", begun.elapsed().as_secs_f64());
            begun = Instant::now();
            let (factor, boxes) = match proof {
                Ok(proof) => (proof.factor.to_string(), proof.leaves.to_string()),
                Err(_) => ("-".into(), "-".into()),
            };
            if let Err(error) = proof {
                open += &format!("  {name} is open: {error}\n");
                if let CertifyError::Open(part) = error {
                    open += &format!("    at {}\n", subject.place(&part.bounds));
                }
            }
            table.row([name, factor, boxes, seconds]);
        },
    );
    drop(bar);
    terminal::say(&format!(
        "{}: {}\n{}{open}",
        subject.solution,
        subject.place(&subject.bounds),
        table.text()
    ))?;
    if let (Some(certificate), Some(output)) = (&certificate, output) {
        output.write_text(&certificate.text().context("cannot form the certificate")?)?;
    }
    Ok(certificate.is_some())
}

/// Checks a certificate by itself, and that its program is that of `subject`.
fn checked(file: &Path, subject: &Subject) -> Result<bool> {
    let text = input::Source::of(file).short_text(LONGEST)?;
    let refusal = match check(&text) {
        Err(refusal) => refusal.to_string(),
        Ok(found) => {
            let certificate =
                Certificate::read(&text).with_context(|| file.display().to_string())?;
            match certificate.matches(subject) {
                Err(difference) => difference,
                Ok(()) => {
                    let (factor, boxes) = (found.factor, found.boxes);
                    terminal::say(&format!(
                        "{}: K <= {factor} holds on all {boxes} boxes\n",
                        found.solution
                    ))?;
                    return Ok(true);
                }
            }
        }
    };
    terminal::say(&format!("{} is refused: {refusal}\n", file.display()))?;
    Ok(false)
}
