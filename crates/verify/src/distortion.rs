//! How strongly a motion deforms the cells of a body.

use mmsmith_runtime::AnySolution;

use crate::dimension::in_dimension;
use crate::points;

/// The strongest deformation of a motion, at sampled places and times of one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// The largest principal stretch.
    pub largest_stretch: f64,
    /// The least principal stretch.
    pub least_stretch: f64,
    /// The largest shear: that of the simple shear which makes a circle an ellipse of the same form, whatever its size.
    pub shear: f64,
}

/// Places, and times at each of them.
const SAMPLES: (usize, usize) = (128, 32);

/// How strongly a motion deforms a body; `None` for a body whose shape or dimension is not known here.
#[must_use]
pub fn distortion(exact: &AnySolution<f64>) -> Option<Distortion> {
    let stretches: Vec<[f64; 2]> = in_dimension!(
        exact,
        |s| {
            let span = s.period();
            let places = (0..SAMPLES.0).filter_map(|n| points::interior(&s.domain(), span, n));
            let moments = places.flat_map(|(X, t)| {
                let later = move |k| (X, (t + span * k as f64 / SAMPLES.1 as f64) % span);
                (0..SAMPLES.1).map(later)
            });
            moments
                .map(|(X, t)| {
                    let stretches = s.deformation_gradient(&X, t).singular_values();
                    [stretches.min(), stretches.max()]
                })
                .collect()
        },
        else return None
    );
    let mut found = Distortion { largest_stretch: 0.0, least_stretch: f64::INFINITY, shear: 0.0 };
    for [least, largest] in stretches.iter().copied() {
        found.largest_stretch = found.largest_stretch.max(largest);
        found.least_stretch = found.least_stretch.min(least);
        let form = (largest / least).sqrt();
        found.shear = found.shear.max(form - 1.0 / form);
    }
    (!stretches.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_deforms_nothing_and_a_stretch_is_told_with_its_size() {
        let build =
            |name, given: &[f64]| mmsmith_solutions::build::<f64>(name, given).unwrap().unwrap();
        let rigid = distortion(&build("rigid-motion", &[])).unwrap();
        assert!(rigid.shear < 1e-9 && (rigid.largest_stretch - 1.0).abs() < 1e-12, "{rigid:?}");
        // The stretch of the bar is 1 + A Pi cos(Pi X) cos(..).
        let bar = distortion(&build("axis-aligned-1d", &[0.2, 1e4, 0.3, 4.0])).unwrap();
        let slope = 0.2 * std::f64::consts::PI;
        assert!((bar.largest_stretch - 1.0 - slope).abs() < 0.02 * slope, "{bar:?}");
        assert!((bar.least_stretch - 1.0 + slope).abs() < 0.02 * slope, "{bar:?}");
        assert_eq!(bar.shear, 0.0);
    }
}
