//! `mms check` on specifications that nothing was generated from.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{mms, outcome, workspace};

/// Motions without any symmetry, in each kind of coordinates: a mistake in the geometry shows in H, P or b.
#[test]
fn motions_without_symmetry_pass_in_all_coordinates() {
    all_pass("tests/data/specs");
}

/// Each law against the solver's own, and energies and stresses of the specification's own against their differences.
#[test]
#[cfg_attr(debug_assertions, ignore = "computes for long; runs with the release build of mms")]
fn every_material_passes() {
    all_pass("tests/data/specs/materials");
}

/// Without stress across, and with a stress at the start: laws of the plane against those in space.
#[test]
fn plates_and_bars_pass() {
    all_pass("tests/data/specs/across");
}

fn all_pass(folder: &str) {
    let mut files: Vec<_> = std::fs::read_dir(workspace().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    let (status, out, errors) = outcome(mms().arg("check").args(&files));
    assert_eq!(status, Some(0), "{out}{errors}");
}

/// A bar that swings along itself; `u`, more lines of the parameters, and the period.
fn bar(u: &str, parameters: &str, period: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bar.toml");
    let text = format!(
        "name = 'bar'
title = 'A bar'
coordinates = 'cartesian'
dimension = 1

[parameters]
E = {{ default = 400.0, range = '> 0' }}
rho0 = {{ default = 3.0 }}
L = {{ default = 2.0 }}
{parameters}

[let]
c = 'sqrt(E/rho0)'

[displacement]
X = '{u}'

[material]
law = 'neo-hookean'
lambda = 'E/2'
mu = 'E/3'
density = 'rho0'

[domain]
shape = 'box'
lower = [0]
upper = ['L']

[[boundary]]
surface = 'X-lower'
condition = 'sliding'

[time]
period = '{period}'
wave-speed = 'c'
"
    );
    std::fs::write(&file, text).unwrap();
    (folder, file)
}

#[test]
fn many_waves_in_a_body_pass_and_a_step_that_differences_cannot_resolve_does_not() {
    for waves in [9, 37, 150, 1200] {
        let u = format!("sin({waves}*Pi*X)/{}*cos(c*t)", 20 * waves);
        let (_folder, file) = bar(&u, "", "2*Pi/c");
        let (status, out, errors) = outcome(mms().arg("check").arg(&file));
        assert_eq!(status, Some(0), "{waves}: {out}{errors}");
    }
    let (_folder, file) = bar("1e-9*tanh(1e8*(X - 7/10))*X*cos(c*t)", "", "2*Pi/c");
    let (status, out, errors) = outcome(mms().arg("check").arg(&file));
    assert_eq!(status, Some(1), "{out}{errors}");
    assert!(out.contains("cannot judge") || out.contains("FAILED"), "{out}");
}

#[test]
fn a_claim_that_is_false_far_from_the_defaults_fails() {
    // No motion of X = 0 for s below three only.
    let u = "X/30*sin(c*t) + (sqrt((s - 3)^2) + s - 3)/50";
    let (_folder, file) = bar(u, "s = { default = 1.0, range = '> 0' }", "2*Pi/c");
    let (status, out, errors) = outcome(mms().arg("check").arg(&file));
    assert_eq!(status, Some(1), "{out}{errors}");
    assert!(out.contains("on X-lower"), "{out}");
}

#[test]
fn a_motion_that_does_not_repeat_is_a_remark_and_no_failure() {
    let remark = "remark: the motion is not the same after its period";
    for (period, repeats) in [("2*Pi/c", true), ("3/c", false)] {
        let (_folder, file) = bar("X/25*sin(c*t)", "", period);
        let (status, out, errors) = outcome(mms().args(["check", "--json", "-"]).arg(&file));
        assert_eq!(status, Some(0), "{out}{errors}");
        let document: serde_json::Value = serde_json::from_str(&out).unwrap();
        assert_eq!(document["results"][0]["not_periodic"].is_null(), repeats, "{out}");
        let (_, out, _) = outcome(mms().arg("check").arg(&file));
        assert_eq!(!out.contains(remark), repeats, "{out}");
    }
}

#[test]
fn values_that_leave_no_body_are_refused() {
    let (_folder, file) = bar("X/25*sin(c*t)", "T = { default = 1.0 }", "T*2*Pi/c");
    for (set, message) in [
        ("rho0=-2", "the density is -2.0; it has to be positive and finite"),
        ("T=-1", "the period is -"),
        ("L=-3", "the body has no volume: it reaches from [0.0] to [-3.0]"),
    ] {
        for command in [&["check"][..], &["run"], &["converge", "--cells", "4,8"]] {
            let (status, _, errors) =
                outcome(mms().arg(command[0]).arg(&file).args(&command[1..]).args(["--set", set]));
            assert_eq!(status, Some(2), "{command:?} {set}: {errors}");
            assert!(errors.contains(message), "{command:?} {set}: {errors}");
        }
    }
}

#[test]
fn a_wrong_declaration_fails_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("ring.toml");
    let text = std::fs::read_to_string(workspace().join("mms-specs/ring.toml")).unwrap();
    // With another factor the inner rim is no longer free of traction.
    std::fs::write(&spec, text.replace("2*R + Ro", "2.001*R + Ro")).unwrap();
    let (status, out, _) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("P N on inner is worst at X = ["), "{out}");
}

/// The ring's specification with one piece replaced, in a folder of its own.
fn changed_ring(right: &str, wrong: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("ring.toml");
    let text = std::fs::read_to_string(workspace().join("mms-specs/ring.toml")).unwrap();
    assert_eq!(text.matches(right).count(), 1, "{right}");
    std::fs::write(&spec, text.replace(right, wrong)).unwrap();
    (folder, spec)
}

#[test]
fn the_published_listing_is_verified_and_told_in_json() {
    let result = mmsmith_tests::json(&["check", "ring"]);
    let checks = result["results"][0]["cross_checks"].as_array().unwrap();
    assert_eq!(checks.len(), 1);
    let components = checks[0]["components"].as_array().unwrap();
    let entries: Vec<&str> = components.iter().map(|c| c["entry"].as_str().unwrap()).collect();
    assert_eq!(entries, ["b[0]", "b[1]", "b[2]"]);
    assert!(components.iter().all(|c| c["verdict"] == "verified"), "{checks:?}");
}

#[test]
fn a_listing_with_one_wrong_digit_is_refuted_with_the_worst_point() {
    let (_folder, spec) = changed_ring("+195.0*", "+196.0*");
    let json = spec.with_extension("json");
    let (status, out, _) = outcome(mms().arg("check").arg(&spec).arg("--json").arg(&json));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("ring: FAILED"), "{out}");
    assert!(out.contains("b[0] differs at 20 of 20 points, most at X = "), "{out}");
    assert!(out.contains("b[2] verified to 60 digits at 20 points"), "{out}");
    let result: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let component = &result["results"][0]["cross_checks"][0]["components"][1];
    assert_eq!(component["verdict"], "refuted");
    assert!(component["place"]["t"].is_number(), "{component}");
    assert_eq!(result["passed"], false);
}

#[test]
fn listings_that_cannot_be_read_are_bad_input_with_the_place() {
    // What is changed to what, the message, and the text whose first place is marked.
    let cases = [
        // Broken as the slides break it.
        (
            "+61.0*t66",
            "+6\n1.0*t66",
            "a number seems to be broken across lines 101 and 102: join 6 and 1.0 to 61.0",
            "6\n1.0*t66",
        ),
        ("rho = 'rho0'", "", "nothing says what 'rho' is", "rho;"),
        ("H = 'theta'", "H = 'theta'\nG = 't'", "uses no name 'G'", "G = 't'"),
        ("H = 'theta'", "H = 'thet'", "nothing here is called 'thet'", "thet'"),
        ("b[1] = ", "b[3] = ", "the listing assigns no b[1]", "b[0] = "),
    ];
    for (right, wrong, message, marked) in cases {
        let (_folder, spec) = changed_ring(right, wrong);
        let text = std::fs::read_to_string(&spec).unwrap();
        let before = &text[..text.find(marked).unwrap()];
        let line = before.lines().count() + usize::from(before.ends_with('\n'));
        let column = before.len() - before.rfind('\n').map_or(0, |end| end + 1) + 1;
        let (status, out, errors) = outcome(mms().arg("check").arg(&spec));
        assert_eq!(status, Some(2), "{wrong}: {out}{errors}");
        let place = format!("ring.toml:{line}:{column}\n");
        assert!(errors.contains(message) && errors.contains(&place), "{place}{errors}");
    }
}

#[test]
fn a_listing_may_be_a_file_beside_the_specification() {
    let text = std::fs::read_to_string(workspace().join("mms-specs/ring.toml")).unwrap();
    let (head, rest) = text.split_once("listing = '''\n").unwrap();
    let (listing, tail) = rest.split_once("'''\n").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("ring.toml");
    std::fs::write(&spec, format!("{head}file = 'ring.c'\n{tail}")).unwrap();

    let (status, _, errors) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(2), "{errors}");
    assert!(
        errors.contains("cannot read the listing") && errors.contains("ring.toml:58:8"),
        "{errors}"
    );

    std::fs::write(folder.path().join("ring.c"), listing).unwrap();
    let (status, out, errors) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(0), "{errors}");
    assert!(out.contains("b[1] verified to 60 digits"), "{out}");

    std::fs::write(folder.path().join("ring.c"), listing.replace("t6 = t5*R;", "t6 = t5 R;"))
        .unwrap();
    let (status, _, errors) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(2), "{errors}");
    assert!(errors.contains("ring.c:5:9"), "{errors}");
}

#[test]
fn a_rim_that_is_nearly_free_is_refuted_with_the_worst_point() {
    // Too little for the comparison in double precision to notice.
    let (_folder, spec) =
        changed_ring("2*R + Ro - 3*Ri)/d)'", "2.00000000000001*R + Ro - 3*Ri)/d)'");
    let (status, out, _) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("P N on inner: NOT zero: "), "{out}");
    assert!(
        out.contains("proved, zero in symbols for all parameters: P N on outer, shear"),
        "{out}"
    );
}

#[test]
fn what_symbols_do_not_show_is_shown_in_digits() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("bar.toml");
    let text = "name = 'free-bar'\ntitle = 'Free end'\ncoordinates = 'cartesian'\ndimension = 1\n\
                [parameters]\nA = { default = 0.1 }\n\
                [displacement]\n# The strain sin(2 X) - 2 sin(1) cos(1) is zero at the end.\n\
                X = 'A*sin(t)*(-cos(2*X)/2 - 2*sin(1)*cos(1)*X)'\n\
                [material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
                [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n\
                [[boundary]]\nsurface = 'X-upper'\ncondition = 'traction-free'\n\
                [time]\nperiod = '2*Pi'\n";
    std::fs::write(&spec, text).unwrap();
    let (status, out, errors) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(0), "{out}{errors}");
    assert!(out.contains("P N on X-upper: zero, verified to 60 digits at 20 points"), "{out}");
    std::fs::write(&spec, text.replace("X-upper", "X-lower")).unwrap();
    let (status, out, _) = outcome(mms().arg("check").arg(&spec));
    assert_eq!(status, Some(1), "{out}");
    assert!(out.contains("P N on X-lower: NOT zero: "), "{out}");
}

/// Generated and interpreted tractions are those of the stress; on a free rim they are zero to the last bit.
#[test]
fn tractions() {
    use mmsmith_solutions::{AnySolution, CATALOGUE, Solution, Surface, build, nalgebra::SVector};
    let description = CATALOGUE.iter().find(|d| d.name == "ring").unwrap();
    let values = description.resolve([]).unwrap();
    let Some(Ok(AnySolution::Two(generated))) = build::<f64>("ring", &values) else { panic!() };
    let spec = mmsmith_spec::Spec::parse(description.specification, "ring.toml").unwrap();
    let AnySolution::Two(interpreted) = mmsmith_interpret::interpret(&spec, []).unwrap() else {
        panic!()
    };
    let both: [&dyn Solution<f64, 2>; 2] = [generated.as_ref(), interpreted.as_ref()];
    for solution in both {
        let rim = SVector::from([0.3, 0.4]);
        assert_eq!(solution.traction(Surface::Inner, &rim, 0.001), Some(SVector::zeros()));
        assert_eq!(solution.traction(Surface::Upper(0), &rim, 0.001), None);
        let X = SVector::from([0.0, 0.8]);
        let P = solution.first_piola_kirchhoff(&X, 0.001);
        let traction = solution.traction(Surface::Lower(0), &X, 0.001).unwrap();
        assert!((traction + P.column(0)).amax() < 1e-12 * P.amax() && P.amax() > 1.0);
    }
}
