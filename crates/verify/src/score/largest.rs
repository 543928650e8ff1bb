//! Where the largest error of a field is, which means do not show.

use mmsmith_runtime::Solution;

use crate::precision::Precision;

use super::across::Directions;
use super::error::ScoreError;
use super::findings::{Remark, Remarks};
use super::judgement::Judgement;
use super::options::{Input, ScoreOptions};
use super::points::Taken;
use super::quantity::Quantity;
use super::recording::Opened;
use super::row::ScoreRow;
use super::times::open;

/// By how much the order of the largest error may be below that of the L2 error before it is told.
const LOWER: f64 = 0.4;

/// Says where largest errors are that do not fall, and which fall with lower orders than the means.
pub(super) fn tell<const D: usize>(
    exact: &dyn Solution<f64, D>,
    inputs: &[Input],
    taken: &[Taken],
    options: &ScoreOptions,
    rows: &mut [ScoreRow],
    verdict: &mut Judgement,
) -> Result<(), ScoreError>
where
    f64: Precision<D>,
{
    for stuck in verdict.stuck.clone() {
        let (row, field) = (&mut rows[stuck.row], stuck.field);
        let frame = row.worst_frames.get(&field).copied().unwrap_or_default();
        let Some(place) =
            place(exact, &inputs[stuck.row], &taken[stuck.row], options, field, frame)?
        else {
            continue;
        };
        let message = format!("the largest error of {field} does not fall with the grid: {place}");
        if verdict.is_of_largest {
            verdict.message += &format!("; {place}");
        }
        row.findings.push(Remark {
            kind: "largest-error",
            is_problem: false,
            count: 1,
            frames: 0,
            message,
        });
    }
    let lower = lower(verdict);
    let finest = (0..rows.len()).min_by(|one, other| rows[*one].h.total_cmp(&rows[*other].h));
    if let Some(finest) = finest.filter(|_| !lower.is_empty()) {
        let message =
            format!("largest errors fall with lower orders than means: {}", lower.join(", "));
        let remark =
            Remark { kind: "largest-order", is_problem: false, count: 1, frames: 0, message };
        rows[finest].findings.push(remark);
    }
    Ok(())
}

/// The fields whose largest error falls with a lower order, in words.
fn lower(verdict: &Judgement) -> Vec<String> {
    let is_stuck = |field: &Quantity| verdict.stuck.iter().any(|stuck| stuck.field == *field);
    let told = |field: &Quantity| {
        let norms = &verdict.fields[field];
        let (largest, mean) = (norms.linf.finest?, norms.l2.finest?);
        (largest > 0.0 && largest < mean - LOWER)
            .then(|| format!("{field} {largest:.2} beside {mean:.2}"))
    };
    verdict.fields.keys().filter(|field| !is_stuck(field)).filter_map(told).collect()
}

/// The place of the largest error of a field in a frame of a recording, in words.
fn place<const D: usize>(
    exact: &dyn Solution<f64, D>,
    input: &Input,
    taken: &Taken,
    options: &ScoreOptions,
    field: Quantity,
    frame: usize,
) -> Result<Option<String>, ScoreError>
where
    f64: Precision<D>,
{
    let (mut remarks, mut of_frames) = (Remarks::default(), Remarks::default());
    let opened = Opened::new(exact, input, options, taken, &mut remarks)?;
    let Some(timed) = opened.found.timed.get(frame) else { return Ok(None) };
    let snapshot = open(&timed.file)?;
    let data = opened.reader(exact, options, &mut of_frames).frame(&snapshot, timed.time, frame)?;
    let Some(number) = Quantity::ALL.iter().position(|known| *known == field) else {
        return Ok(None);
    };
    let found = data.worst(exact, &Directions::new(exact), number, timed.time);
    Ok(found.map(|(particle, error)| {
        let X: Vec<_> = data.X[particle].iter().collect();
        format!(
            "{error:.3e} at X = {X:?}, t = {:?} (particle {particle} of {})",
            timed.time,
            snapshot.path().display()
        )
    }))
}
