//! Bounds at points against exact values: computed values are never further from exact values than the bound of the error, and the
//! sensitivity is never smaller than its bound.
#![allow(clippy::unwrap_used)]

use mmsmith_certify::propagate::Judgement;
use mmsmith_certify::{Interval, Roundings, Subject};
use mmsmith_expr::{Expr, Rational, nearest_f64};
use mmsmith_oracle::{Class, Oracle, Point, Sampler, Sensitivity, exact};
use mmsmith_spec::Spec;
use num_traits::Signed;
use std::path::Path;

const POINTS: u64 = 25;

#[test]
fn bounds_contain_exact_errors_and_sensitivities() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    for name in ["bar", "axis-aligned-1d", "shear-wave", "rigid-motion"] {
        let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
        let spec = Spec::parse(&text, name).unwrap();
        let subject = Subject::new(&spec, &[]).unwrap();
        let mut fields = spec.derive().unwrap();
        let inputs: Vec<Expr> = fields.inputs.iter().map(|(input, _)| *input).collect();
        let flat: Vec<Expr> =
            [&fields.u, &fields.v, &fields.a, &fields.H.concat(), &fields.F.concat()]
                .into_iter()
                .chain([&vec![fields.J], &fields.P.concat(), &fields.b])
                .flatten()
                .copied()
                .collect();
        assert_eq!(flat.len(), subject.judged.len());
        let sensitivity = Sensitivity::new(&fields.graph, &fields.definitions, &inputs, &flat);
        let sampler = Sampler::new(&spec, &mut fields);
        let mut oracle = Oracle::new(256).unwrap();
        let (mut tight, mut judged_points) = (0, 0);
        for index in 0..POINTS {
            let Some(at) = sampler.draw(Class::Ordinary, index) else { continue };
            let values: Vec<(Expr, Rational)> =
                inputs.iter().copied().zip(at.iter().map(|&x| exact(x).unwrap())).collect();
            let point =
                Point { graph: &fields.graph, definitions: &fields.definitions, values: &values };
            let truth = oracle.settle(&point, &flat, 40).unwrap();
            let sens = sensitivity.evaluate(&mut oracle, &values).unwrap();
            let results = subject.program.evaluate(&at);
            let bounds: Vec<Interval> = at.iter().map(|&x| Interval::point(x)).collect();
            for (n, judged) in subject.judged.iter().enumerate() {
                let judgement =
                    Judgement::new(&subject.program, judged.slot, &Roundings::default()).unwrap();
                let sides = judgement.over(&bounds).unwrap();
                let unit = 0.5 * f64::EPSILON;
                let error = nearest_f64(&(exact(results[n]).unwrap() - &truth[n]).abs()) / unit;
                let allowed = nearest_f64(&(&sens[n] + truth[n].abs()));
                let place = format!("{name}: {}[{}] at {at:?}", judged.field, judged.entry);
                assert!(
                    error <= sides.largest_error(),
                    "{place}: {error} {}",
                    sides.largest_error()
                );
                let least = sides.least_allowed();
                assert!(least <= allowed * (1.0 + 1e-9), "{place}: {least} {allowed}");
                judged_points += 1;
                tight += usize::from(least >= 0.999 * allowed);
            }
        }
        // At a point nothing but sums next to zero makes the bound smaller than what it bounds.
        assert!(10 * tight >= 9 * judged_points, "{name}: {tight} of {judged_points}");
        assert!(judged_points > 100, "{name}: {judged_points}");
    }
}
