//! Ordinary differential equations by extrapolation of the modified midpoint rule, whose error has even powers of the step alone.
//!
//! No table of coefficients is needed, so that the files of hosts can have the same few lines.
//!
//! Source: E. Hairer, S. P. Norsett and G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. (1993), section II.9.

/// Columns of the extrapolation at most: the order is twice as many.
const COLUMNS: usize = 8;

/// `rate(t, y, y')` writes the rates of the values `y`.
pub(crate) type Rate<'a> = &'a dyn Fn(f64, &[f64], &mut [f64]);

/// An integration that did not come to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// The rates became so large, or so rough, that steps vanished.
    StepTooSmall,
    /// A value is not finite.
    NotFinite,
}

/// Integrates `y' = rate(t, y)` from `start` to `end`, to a relative tolerance of each value with regard to the largest one. `step` is the
/// first step to try, and then the one to go on with; zero where none is known.
pub(crate) fn integrate(
    rate: Rate<'_>,
    (start, end): (f64, f64),
    y: &mut [f64],
    tolerance: f64,
    step: &mut f64,
) -> Result<(), Stop> {
    let mut time = start;
    if *step <= 0.0 {
        *step = end - start;
    }
    let mut table: Vec<Vec<f64>> = vec![vec![0.0; y.len()]; COLUMNS];
    let zero = vec![0.0; y.len()];
    let mut work =
        Work { z: zero.clone(), change: zero.clone(), before: zero.clone(), rates: zero };
    while time < end {
        let rest = end - time;
        // The last two steps share the rest, so that none of them is tiny.
        let trial = if rest <= *step {
            rest
        } else if rest < 2.0 * *step {
            0.5 * rest
        } else {
            *step
        };
        match extrapolated(rate, time, y, trial, tolerance, &mut table, &mut work) {
            Some(columns) => {
                y.iter_mut().zip(&table[0]).for_each(|(y, change)| *y += change);
                time = if trial == rest { end } else { time + trial };
                if y.iter().any(|value| !value.is_finite()) {
                    return Err(Stop::NotFinite);
                }
                // Few columns were needed: the step may be longer.
                let factor = if columns < COLUMNS - 2 { 1.6 } else { 1.0 };
                *step = step.max(trial * factor);
            }
            None => {
                *step = 0.5 * trial;
                if time + *step <= time {
                    return Err(Stop::StepTooSmall);
                }
            }
        }
    }
    Ok(())
}

/// Buffers of a step. Changes since its start are kept, not values: they are smaller, and so is the rounding that extrapolation enlarges.
struct Work {
    /// Values.
    z: Vec<f64>,
    /// Changes of the values, and those before.
    change: Vec<f64>,
    before: Vec<f64>,
    rates: Vec<f64>,
}

/// The changes by a step, in the first row of the table, and how many columns they took; none where these are not enough.
fn extrapolated(
    rate: Rate<'_>,
    time: f64,
    y: &[f64],
    step: f64,
    tolerance: f64,
    table: &mut [Vec<f64>],
    work: &mut Work,
) -> Option<usize> {
    let size = y.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    for column in 0..COLUMNS {
        let parts = 2 * (column + 1);
        midpoint(rate, time, y, step, parts, work);
        // Neville's scheme in the squares of the steps: `table[k]` has the value from columns `k` to this one.
        table[column].copy_from_slice(&work.change);
        let mut error = f64::INFINITY;
        for k in (0..column).rev() {
            let ratio = parts as f64 / (2 * (k + 1)) as f64;
            let weight = 1.0 / (ratio * ratio - 1.0);
            let (lower, upper) = table.split_at_mut(k + 1);
            let (own, next) = (&mut lower[k], &upper[0]);
            error = 0.0;
            for (own, next) in own.iter_mut().zip(next) {
                let change = (next - *own) * weight;
                *own = next + change;
                error = f64::max(error, change.abs());
            }
        }
        if error.is_nan() {
            return None;
        }
        if column >= 1 && error <= tolerance * size {
            return Some(column + 1);
        }
    }
    None
}

/// The modified midpoint rule with an even number of parts, without a smoothing step.
fn midpoint(
    rate: Rate<'_>,
    time: f64,
    y: &[f64],
    step: f64,
    parts: usize,
    Work { z, change, before, rates }: &mut Work,
) {
    let h = step / parts as f64;
    before.fill(0.0);
    rate(time, y, rates);
    change.iter_mut().zip(&*rates).for_each(|(change, rate)| *change = h * rate);
    for part in 1..parts {
        z.iter_mut().zip(y).zip(&*change).for_each(|((z, y), change)| *z = y + change);
        rate(time + part as f64 * h, z, rates);
        for ((change, before), rate) in change.iter_mut().zip(before.iter_mut()).zip(&*rates) {
            (*change, *before) = (*before + 2.0 * h * rate, *change);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pendulum_and_a_stiff_decay_have_the_digits_of_the_tolerance() {
        for tolerance in [1e-6, 1e-9, 1e-13] {
            let mut y = vec![1.0, 0.0];
            let rate = |_: f64, y: &[f64], rates: &mut [f64]| {
                (rates[0], rates[1]) = (y[1], -4.0 * y[0]);
            };
            integrate(&rate, (0.0, 3.0), &mut y, tolerance, &mut 0.0).unwrap();
            let off = (y[0] - 6.0_f64.cos()).abs() + (y[1] + 2.0 * 6.0_f64.sin()).abs();
            assert!(off < 30.0 * tolerance, "{tolerance:e} {off:e}");
            let mut y = vec![2.0];
            let rate = |t: f64, y: &[f64], rates: &mut [f64]| {
                rates[0] = -50.0 * (y[0] - t.cos()) - t.sin();
            };
            integrate(&rate, (0.0, 2.0), &mut y, tolerance, &mut 0.0).unwrap();
            assert!((y[0] - 2.0_f64.cos()).abs() < 100.0 * tolerance, "{}", y[0]);
        }
        let mut y = vec![1.0];
        let blows_up = |_: f64, y: &[f64], rates: &mut [f64]| rates[0] = y[0] * y[0];
        assert!(integrate(&blows_up, (0.0, 2.0), &mut y, 1e-9, &mut 0.0).is_err());
    }
}
