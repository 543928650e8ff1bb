//! Times of the first steps of a case, without errors measured on the way.

use std::ops::ControlFlow;
use std::time::Instant;

use mmsmith_measure::Comparison;

use crate::drive::Driven;
use crate::error::CaseError;
use crate::on_grid::OnGrid;
use crate::precision::Precision;

/// Number of first steps whose times are kept.
const FIRST_STEPS: usize = 63;
/// Number of cold ones among these first steps: they touch memory for the first time, and wake threads.
const COLD_STEPS: usize = 2;

/// Times of some steps of a case, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Particles.
    pub particles: usize,
    /// Steps done.
    pub steps: u64,
    /// Whether these are all steps to the end time.
    pub complete: bool,
    /// Setting up, before the first step.
    pub setup_s: f64,
    /// Wall-clock time of the steps.
    pub wall_s: f64,
    /// The median of the first steps, without those that meet memory for the first time.
    pub step_s: f64,
    /// Processor time of the steps on all threads.
    pub cpu_s: f64,
    /// Measuring the errors at one instant.
    pub measure_s: f64,
}

/// As [`Discretized::time_steps`](crate::Discretized::time_steps).
pub(crate) fn time_steps<T: Precision<D>, const D: usize>(
    on_grid: &OnGrid<'_, T, D>,
    most: u64,
    until: Option<Instant>,
) -> Result<Timing, CaseError>
where
    f64: Precision<D>,
{
    let &OnGrid { exact, steps, .. } = on_grid;
    let started = Instant::now();
    let mut driven = Driven::set_up(on_grid, steps.dt, None)?;
    let setup_s = started.elapsed().as_secs_f64();
    let (mut done, mut wall_s, mut cpu_s) = (0, 0.0, 0.0);
    let mut each = Vec::new();
    // Steps until the solver gives up count as well.
    driven.advance(1..=steps.count.min(most), &mut |stepped| {
        done = stepped.step;
        wall_s += stepped.wall_s;
        cpu_s += stepped.cpu_s;
        if each.len() < FIRST_STEPS {
            each.push(stepped.wall_s);
        }
        let is_over = until.is_some_and(|until| Instant::now() >= until);
        Ok(if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    })?;
    let solver = driven.solver.as_mut();
    let lag = solver.velocity_lag().to_f64();
    let started = Instant::now();
    let comparison = Comparison::new(exact, &solver.observe().0.X);
    let setup_s = setup_s + started.elapsed().as_secs_f64();
    let measured: [f64; 3] = std::array::from_fn(|_| {
        let started = Instant::now();
        std::hint::black_box(comparison.measure(solver.observe(), 0.0, lag));
        started.elapsed().as_secs_f64()
    });
    let (step_s, measure_s) = (step_time(&mut each), measured.into_iter().fold(f64::NAN, f64::min));
    let particles = solver.observe().0.len();
    let complete = done == steps.count;
    Ok(Timing { particles, steps: done, complete, setup_s, wall_s, step_s, cpu_s, measure_s })
}

/// Time of a step in the course of a run: the median of the steps after the cold ones, or of all where there are no others; not
/// a number where there are no steps.
fn step_time(each: &mut [f64]) -> f64 {
    let warm = if each.len() > COLD_STEPS { &mut each[COLD_STEPS..] } else { each };
    warm.sort_by(f64::total_cmp);
    warm.get(warm.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cold_steps_do_not_count_where_there_are_others() {
        assert_eq!(step_time(&mut [9.0, 8.0, 1.0, 3.0, 2.0]), 2.0);
        assert_eq!(step_time(&mut [9.0, 8.0]), 9.0);
        assert!(step_time(&mut []).is_nan());
    }
}
