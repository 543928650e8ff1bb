//! Conditions by component: which ones are the same, what holds for each component, and their names.

#![allow(clippy::unwrap_used)]

use mmsmith_spec::{ComponentCondition, Condition, Spec};

const ALL: [ComponentCondition; 3] = [
    ComponentCondition::PrescribedMotion,
    ComponentCondition::PrescribedTraction,
    ComponentCondition::TractionFree,
];

/// Every triple of conditions.
fn triples() -> impl Iterator<Item = [ComponentCondition; 3]> {
    (0..27).map(|n| [ALL[n % 3], ALL[n / 3 % 3], ALL[n / 9]])
}

#[test]
fn each_component_has_the_condition_that_is_stated_for_it() {
    for of in triples() {
        for dimension in 1..=3 {
            for axis in 0..dimension {
                let condition = Condition::by_component(axis, dimension, of);
                for (component, own) in of.iter().enumerate().take(dimension) {
                    assert_eq!(condition.of(axis, component), *own, "{condition}");
                    assert!(condition.gives(*own), "{condition} {own}");
                }
                let count = ALL.into_iter().filter(|one| condition.gives(*one)).count();
                let stated = ALL.into_iter().filter(|one| of[..dimension].contains(one)).count();
                assert_eq!(count, stated, "{condition}");
            }
        }
    }
}

#[test]
fn conditions_that_hold_the_same_are_the_same() {
    for one in triples() {
        for other in triples() {
            for (dimension, axis) in [(1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (3, 2)] {
                let [left, right] =
                    [one, other].map(|of| Condition::by_component(axis, dimension, of));
                let alike = one[..dimension] == other[..dimension];
                assert_eq!(left == right, alike, "{left}, {right}");
            }
        }
        let alike = one.iter().all(|own| *own == one[0]);
        assert_eq!(Condition::by_component(1, 3, one) == Condition::of_all(one[0]), alike);
    }
    let [motion, traction, free] = ALL;
    assert_eq!(
        Condition::by_component(1, 2, [free, motion, traction]),
        Condition::by_direction(motion, free)
    );
    assert_eq!(
        Condition::by_component(2, 3, [free, free, traction]),
        Condition::by_direction(traction, free)
    );
}

#[test]
fn a_file_states_what_is_told() {
    let told = |dimension: usize, line: &str| {
        let (lower, upper) = (vec![0; dimension], vec![1; dimension]);
        let text = format!(
            "name = 'a'\ntitle = 'A'\ncoordinates = 'cartesian'\ndimension = {dimension}\n\
             boundary = [{{ surface = 'X-upper', {line} }}]\n\
             [parameters]\nE = {{ default = 1 }}\nnu = {{ default = 0 }}\nrho0 = {{ default = 1 }}\n\
             [displacement]\nX = 'X/9'\n[material]\nlaw = 'neo-hookean'\n\
             [domain]\nshape = 'box'\nlower = {lower:?}\nupper = {upper:?}\n"
        );
        let spec = Spec::parse(&text, "a.toml").unwrap_or_else(|wrong| panic!("{wrong}"));
        spec.boundaries[0].condition.to_string()
    };
    for (dimension, line, expected) in [
        (1, "normal = 'traction-free'", "traction-free"),
        (1, "X = 'prescribed-motion'", "prescribed-motion"),
        (2, "X = 'prescribed-motion', Y = 'prescribed-motion'", "prescribed-motion"),
        (
            2,
            "X = 'prescribed-motion', Y = 'traction-free'",
            "normal prescribed-motion, tangential traction-free",
        ),
        (
            3,
            "tangential = 'prescribed-motion', normal = 'prescribed-traction'",
            "normal prescribed-traction, tangential prescribed-motion",
        ),
        (
            3,
            "X = 'prescribed-traction', Y = 'traction-free', Z = 'prescribed-traction'",
            "X prescribed-traction, Y traction-free, Z prescribed-traction",
        ),
        (2, "condition = 'sliding'", "sliding"),
    ] {
        assert_eq!(told(dimension, line), expected, "{line}");
    }
}
