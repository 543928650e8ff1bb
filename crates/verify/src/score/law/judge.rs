//! Which of many explanations of recorded numbers is told.

/// An explanation this many times closer than the right one is the better one, whatever the rounding.
const FAR_CLOSER: f64 = 1e3;
/// Explanations this close to the best one cannot be told apart from it.
const ALIKE: f64 = 30.0;
/// The right explanation is taken for true up to this error, where none is far closer.
const RIGHT: f64 = 1e-5;
/// No rounding explains more than this.
const MOST_ROUNDING: f64 = 1e-4;

/// Outcome of [`judge`].
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Judged {
    /// The numbers are the right ones; with the places of others that give the same.
    Right { alike: Vec<usize> },
    /// Others explain them, the likeliest first.
    Other { named: Vec<usize> },
    /// Nothing explains them.
    Unexplained,
}

/// Judges relative errors: of the right explanation, and of others; `rounding` is what the digits of the file leave.
pub(super) fn judge(right: f64, others: &[Option<f64>], rounding: f64) -> Judged {
    let rounding = rounding.min(MOST_ROUNDING);
    let known = || others.iter().enumerate().filter_map(|(n, error)| Some((n, (*error)?)));
    let best = known().map(|(_, error)| error).fold(f64::INFINITY, f64::min);
    let below = |level: f64| known().filter(move |(_, error)| *error <= level).map(|(n, _)| n);
    let is_far_closer = best * FAR_CLOSER <= right && best <= MOST_ROUNDING;
    let is_right = right <= rounding || right <= RIGHT;
    if is_right && !is_far_closer {
        return Judged::Right { alike: below(rounding.max(ALIKE * right)).collect() };
    }
    if is_far_closer || best <= rounding {
        let level = if best <= rounding { rounding } else { ALIKE * best };
        return Judged::Other { named: below(level.min(right)).collect() };
    }
    Judged::Unexplained
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_right_one_is_told_before_others_and_others_only_where_they_are_far_closer() {
        let some = |errors: &[f64]| errors.iter().copied().map(Some).collect::<Vec<_>>();
        for (right, others, rounding, expected) in [
            (4e-16, some(&[0.1, 0.4]), 1e-13, Judged::Right { alike: vec![] }),
            (4e-16, some(&[0.1, 4e-16]), 1e-13, Judged::Right { alike: vec![1] }),
            (0.1, some(&[0.4, 4e-16]), 1e-13, Judged::Other { named: vec![1] }),
            (0.1, some(&[3e-16, 4e-16]), 1e-13, Judged::Other { named: vec![0, 1] }),
            // Fields of other places: nothing is at rounding.
            (0.01, some(&[0.001, 0.3]), 1e-13, Judged::Unexplained),
            (0.01, some(&[]), 1e-13, Judged::Unexplained),
            // Text of six digits, whose number of digits is not known.
            (1e-6, some(&[0.1]), 1e-13, Judged::Right { alike: vec![] }),
            (0.1, some(&[1e-6]), 1e-13, Judged::Other { named: vec![0] }),
            // Rounding so coarse that it explains the right one too, but another one is far closer.
            (9e-5, some(&[1e-9]), 1e-4, Judged::Other { named: vec![0] }),
        ] {
            assert_eq!(judge(right, &others, rounding), expected, "{right} {others:?}");
        }
    }
}
