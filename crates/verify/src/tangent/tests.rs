use super::*;

const TIME: f64 = 0.013;

/// The states of a solution of the library at a few places.
fn states<const D: usize>(solution: &dyn Solution<f64, D>) -> Vec<State<D>>
where
    f64: Precision<D> + Differentiated<D>,
{
    let places = [[0.21, 0.64, 0.37], [0.78, 0.33, 0.86], [0.44, 0.12, 0.55]];
    places.map(|X| State::new(solution, &X[..D], TIME, None).unwrap()).into()
}

/// Every mistake, planted in the tangents of a solution, and what is said of it.
fn planted<const D: usize>(exact: &AnySolution<f64>, solution: &dyn Solution<f64, D>)
where
    f64: Precision<D> + Differentiated<D>,
{
    let states = states(solution);
    let right = entries(states.iter().map(|state| state.A));
    let samples = |given: &[f64]| -> Vec<TangentSample> {
        let own = states.iter().zip(given.chunks(D.pow(4)));
        own.map(|(state, dPdF)| TangentSample {
            X: vec![0.5; D],
            t: 0.0,
            F: Some(state.F.transpose().as_slice().to_vec()),
            dPdF: dPdF.to_vec(),
        })
        .collect()
    };
    assert!(judge_tangent(exact, &samples(&right)).unwrap().passed);
    let states = states.iter();
    let mut judged = 0;
    for mistake in TANGENT_MISTAKES {
        let tangents: Option<Vec<Tangent<D>>> = match mistake.form {
            Form::Factor => {
                Some(states.clone().map(|own| own.A.map(|row| row.map(|A| A * 2.5))).collect())
            }
            Form::Differences => states.clone().map(|own| own.by_differences(1e-3)).collect(),
            form => states.clone().map(|own| own.mistaken(form)).collect(),
        };
        let Some(tangents) = tangents else { continue };
        let found = judge_tangent(exact, &samples(&entries(tangents))).unwrap();
        if found.passed {
            let name = mistake.name;
            assert!(found.unseen.iter().any(|own| own.name == name), "{name}: {found:?}");
            assert_eq!(name, "law-neo-hookean");
            continue;
        }
        let named = &found.named[0];
        assert_eq!(named.mistake.name, mistake.name, "{found:?}");
        let fitted = named.fitted;
        let is_near = |size: f64| fitted.is_some_and(|own| (own / size - 1.0).abs() < 1e-6);
        match mistake.form {
            Form::Factor => assert!(is_near(2.5), "{fitted:?}"),
            Form::Differences => assert!(is_near(1e-3), "{fitted:?}"),
            _ => assert_eq!(fitted, None),
        }
        judged += 1;
    }
    assert!(judged >= TANGENT_MISTAKES.len() - 2, "{judged}");
}

#[test]
fn every_mistake_is_named_in_the_plane_and_in_space() {
    for name in ["skew-2d", "skew-3d"] {
        let exact = mmsmith_solutions::build::<f64>(name, &[]).unwrap().unwrap();
        match &exact {
            AnySolution::Two(solution) => planted(&exact, solution.as_ref()),
            AnySolution::Three(solution) => planted(&exact, solution.as_ref()),
            _ => panic!("{name} has two or three dimensions"),
        }
    }
}

#[test]
fn samples_that_do_not_fit_are_refused() {
    let exact = mmsmith_solutions::build::<f64>("skew-2d", &[]).unwrap().unwrap();
    let sample = |dPdF: usize| TangentSample {
        X: vec![0.5; 2],
        t: 0.0,
        F: Some(vec![1.0; 3]),
        dPdF: vec![0.0; dPdF],
    };
    for (entries, expected) in [
        (9, TangentError::Entries { given: 9, needed: 16 }),
        (16, TangentError::Entries { given: 3, needed: 4 }),
    ] {
        assert_eq!(judge_tangent(&exact, &[sample(entries)]).unwrap_err(), expected);
    }
}
