//! Particles over a period: where they are, how they are deformed, and their stress, as the page draws them.

use crate::particles::{Piece, fill};
use crate::refusal::Refusal;
use crate::session::Session;
use mmsmith_runtime::nalgebra::SVector;
use mmsmith_runtime::{AnySolution, BLOCK, Solution, StateRun};

/// More particles are not drawn.
const MOST_PARTICLES: usize = 4000;
/// More pictures are not drawn.
const MOST_FRAMES: usize = 400;

/// Numbers in single precision: the dimension, the number of particles, of pictures, and the period; of each particle the place and the
/// edges of its piece, column by column; then for each picture `u`, `F` and `P` of each particle, row by row.
pub(crate) fn of(session: &Session, particles: usize, frames: usize) -> Result<Vec<u8>, Refusal> {
    let count = particles.min(MOST_PARTICLES);
    let frames = frames.clamp(1, MOST_FRAMES);
    let numbers = match session.solution()? {
        AnySolution::One(solution) => drawn(solution.as_ref(), count, frames)?,
        AnySolution::Two(solution) => drawn(solution.as_ref(), count, frames)?,
        AnySolution::Three(solution) => drawn(solution.as_ref(), count, frames)?,
        _ => return Err("bodies in more than three dimensions are not drawn".into()),
    };
    Ok(numbers.iter().flat_map(|number| number.to_le_bytes()).collect())
}

fn drawn<const D: usize>(
    solution: &dyn Solution<f64, D>,
    count: usize,
    frames: usize,
) -> Result<Vec<f32>, Refusal> {
    let pieces = fill(&solution.domain(), count);
    let period = solution.period();
    if pieces.is_empty() || !period.is_finite() {
        return Err("there is no body to draw, or its period is no number".into());
    }
    solution.prepare_until(period)?;
    let head = [D as f64, pieces.len() as f64, frames as f64, period];
    let mut numbers: Vec<f32> = head.iter().map(|number| *number as f32).collect();
    for Piece { X, edges } in &pieces {
        numbers.extend(X.iter().chain(edges.iter()).map(|number| *number as f32));
    }
    let X: Vec<SVector<f64, D>> = pieces.iter().map(|piece| piece.X).collect();
    let states = solution.state_at(&X);
    let mut runs = vec![StateRun::zero(); X.len().div_ceil(BLOCK)];
    for frame in 0..frames {
        let t = period * frame as f64 / frames as f64;
        states.evaluate(t, t, 0, &mut runs);
        for n in 0..X.len() {
            let state = runs[n / BLOCK].get(n % BLOCK);
            let (F, P) = (state.F.transpose(), state.P.transpose());
            let all = state.u.iter().chain(F.iter()).chain(P.iter());
            numbers.extend(all.map(|number| *number as f32));
        }
    }
    Ok(numbers)
}
