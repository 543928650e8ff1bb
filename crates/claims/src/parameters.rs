//! Variation of parameters: near their defaults, and over all admissible values.

use mmsmith_spec::{Parameter, Relation};

/// Near its default a parameter varies by this share of the default; a parameter whose default is zero varies by this number.
pub(crate) const VARIATION: f64 = 0.1;
/// The powers of ten over which a side without a limit is sampled, evenly in the logarithm.
const DECADES: [f64; 2] = [-2.0, 1.5];
/// The distances from a limit, as powers of ten of the whole range.
const NEXT_TO_LIMIT: [f64; 2] = [-3.0, -1.0];

/// A value near the default; `share` from 0 to 1 chooses it.
pub(crate) fn near(parameter: &Parameter, share: f64) -> f64 {
    let middle = parameter.default;
    let half = if middle == 0.0 { VARIATION } else { VARIATION * middle.abs() };
    middle - half + 2.0 * half * share
}

/// A value anywhere in the admissible range; `share` in `[0, 1)` chooses it. Between two limits half of the shares are spread evenly,
/// and a quarter lies next to each limit. On a side without a limit magnitudes are spread evenly in the logarithm around that of the
/// default.
#[must_use]
pub fn admissible_value(parameter: &Parameter, share: f64) -> f64 {
    let limits = |below: bool| {
        parameter.bounds.iter().filter_map(move |bound| {
            let is_below = matches!(bound.relation, Relation::Greater | Relation::GreaterOrEqual);
            (is_below == below && bound.limit.is_finite()).then_some(bound.limit)
        })
    };
    let low = limits(true).reduce(f64::max);
    let high = limits(false).reduce(f64::min);
    let power = |[from, to]: [f64; 2], share: f64| 10_f64.powf(from + (to - from) * share);
    let size = |distance: f64| if distance == 0.0 { 1.0 } else { distance.abs() };
    match (low, high) {
        (Some(low), Some(high)) => {
            let width = high - low;
            match share {
                s if s < 0.25 => low + width * power(NEXT_TO_LIMIT, 4.0 * s),
                s if s < 0.75 => {
                    let closest = 10_f64.powf(NEXT_TO_LIMIT[0]);
                    low + width * (2.0 * (s - 0.25)).clamp(closest, 1.0 - closest)
                }
                s => high - width * power(NEXT_TO_LIMIT, 4.0 * (s - 0.75)),
            }
        }
        (Some(low), None) => low + size(parameter.default - low) * power(DECADES, share),
        (None, Some(high)) => high - size(high - parameter.default) * power(DECADES, share),
        (None, None) => {
            let sign = if share < 0.5 { 1.0 } else { -1.0 };
            sign * size(parameter.default) * power(DECADES, (2.0 * share).fract())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mmsmith_spec::Bound;

    fn parameter(default: f64, bounds: &[(Relation, f64)]) -> Parameter {
        let bounds = bounds.iter().map(|&(relation, limit)| Bound { relation, limit }).collect();
        Parameter {
            name: "p".into(),
            default,
            unit: String::new(),
            description: String::new(),
            range: String::new(),
            bounds,
        }
    }

    fn values(parameter: &Parameter) -> Vec<f64> {
        (0..1000).map(|n| admissible_value(parameter, f64::from(n) / 1000.0)).collect()
    }

    #[test]
    fn the_whole_of_a_range_is_looked_at_and_nothing_beyond() {
        let nu = parameter(0.3, &[(Relation::Greater, -1.0), (Relation::Less, 0.5)]);
        let found = values(&nu);
        assert!(found.iter().all(|&x| nu.bounds.iter().all(|bound| bound.admits(x))));
        let count = |low: f64, high: f64| found.iter().filter(|&&x| low < x && x < high).count();
        for tenth in 0..10 {
            let low = -1.0 + 0.15 * f64::from(tenth);
            assert!(count(low, low + 0.15) >= 40, "from {low}");
        }
        assert!(count(-1.0, -0.99) > 50 && count(0.49, 0.5) > 50);
    }

    #[test]
    fn magnitudes_of_sides_without_limit_are_spread_over_decades() {
        let positive = values(&parameter(7.0, &[(Relation::Greater, 0.0)]));
        assert!(positive.iter().all(|&x| x > 0.0));
        for decade in [0.1, 1.0, 10.0] {
            let within = positive.iter().filter(|&&x| decade <= x && x < 10.0 * decade).count();
            assert!(within > 200, "{decade}: {within}");
        }
        let below = values(&parameter(-3.0, &[(Relation::LessOrEqual, -2.0)]));
        assert!(below.iter().all(|&x| x < -2.0) && below.iter().any(|&x| x < -20.0));
        let free = values(&parameter(0.05, &[]));
        for sign in [1.0, -1.0] {
            assert!(free.iter().any(|&x| sign * x > 1.0) && free.iter().any(|&x| sign * x > 0.0));
        }
    }
}
