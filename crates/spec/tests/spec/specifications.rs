//! Specifications as data: `ok/` holds specifications with the fields derived from them, `err/` holds mistakes
//! with the messages that they get. `UPDATE_EXPECT=1` writes the expected files anew.

#![allow(clippy::unwrap_used)]

use mmsmith_expr::{Ast, Expr, Function, Graph};
use mmsmith_spec::{DeriveError, Diagnostic, LONGEST_FILE, ListingText, Spec, Surface};
use mmsmith_vocabulary::Material;
use std::path::{Path, PathBuf};

fn cases(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(folder);
    let mut cases: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    cases.sort();
    assert!(!cases.is_empty());
    cases
}

fn parse(path: &Path) -> Result<Spec, Diagnostic> {
    let file = path.file_name().unwrap().to_str().unwrap();
    Spec::parse(&std::fs::read_to_string(path).unwrap(), file)
}

/// Compares with the file of expected output beside the input, in which `{functions}` and `{laws}` stand for the names of all of them.
fn expect(path: &Path, found: &str, failures: &mut Vec<String>) {
    let functions = Function::everyday();
    let laws: Vec<&str> = Material::<f64>::ROWS.iter().map(|row| row.name).collect();
    let found =
        &found.replace(&functions.join(", "), "{functions}").replace(&laws.join(", "), "{laws}");
    let expected_path = path.with_extension("txt");
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(&expected_path, found).unwrap();
    }
    let expected = std::fs::read_to_string(&expected_path).unwrap_or_default();
    if expected != *found {
        failures.push(format!("{}\n--- expected\n{expected}\n--- found\n{found}", path.display()));
    }
}

#[test]
fn mistakes_get_the_expected_message() {
    let mut failures = Vec::new();
    for path in cases("err") {
        match parse(&path) {
            Ok(_) => failures.push(format!("{} was accepted", path.display())),
            Err(diagnostic) => {
                let shown = diagnostic.to_string();
                let (line, column) = diagnostic.line_and_column();
                assert!(shown.contains(&format!(":{line}:{column}")), "no place in\n{shown}");
                assert!(shown.contains('^'), "no caret in\n{shown}");
                expect(&path, &(shown + "\n"), &mut failures);
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn files_and_tables_without_end_are_refused_at_their_limit() {
    let parameters = |count: usize| {
        let lines: String = (0..count).map(|n| format!("p{n} = {{ default = 1 }}\n")).collect();
        format!(
            "name = 'a'\ntitle = 'A'\ncoordinates = 'cartesian'\ndimension = 1\n[parameters]\n{lines}\
             [displacement]\nX = 'p0*X*t/9'\n[material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
             [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n[time]\nperiod = 1\nwave-speed = 1\n"
        )
    };
    assert!(Spec::parse(&parameters(1_000), "many.toml").is_ok());
    let message = |text: &str| Spec::parse(text, "many.toml").unwrap_err().to_string();
    let found = message(&parameters(1_001));
    assert!(found.contains("1001 entries of [parameters]; 1000 are the limit"), "{found}");
    let long = parameters(1) + &"\n".repeat(LONGEST_FILE);
    let found = message(&long);
    assert!(found.contains(&format!("{} bytes; {LONGEST_FILE} are", long.len())), "{found}");
}

#[test]
fn fields_are_derived_as_expected() {
    let mut failures = Vec::new();
    for path in cases("ok") {
        let spec = parse(&path).unwrap_or_else(|diagnostic| panic!("{diagnostic}"));
        let fields = spec.derive().unwrap();
        let mut text = String::new();
        for solved in spec.solved.iter() {
            for (name, value) in &solved.unknowns {
                text += &format!("{name} = {}\n", spec.graph.print(*value));
            }
            for condition in &solved.conditions {
                text += &format!(
                    "{}: {} = 0, not {:?}\n",
                    condition.text, condition.factor, condition.others
                );
            }
        }
        for (letter, vector) in
            [("u", &fields.u), ("v", &fields.v), ("a", &fields.a), ("b", &fields.b)]
        {
            for (i, &component) in vector.iter().enumerate() {
                text += &format!("{letter}[{i}] = {}\n", fields.graph.print(component));
            }
        }
        for (letter, matrix) in [("H", &fields.H), ("P", &fields.P)] {
            for (i, row) in matrix.iter().enumerate() {
                for (j, &entry) in row.iter().enumerate() {
                    text += &format!("{letter}[{i}][{j}] = {}\n", fields.graph.print(entry));
                }
            }
        }
        text += &format!("J = {}\n", fields.graph.print(fields.J));
        for fields_on in &fields.surfaces {
            let traction: Vec<String> =
                fields_on.traction.iter().map(|&t| fields.graph.print(t)).collect();
            text += &format!("traction on {:?} = ({})\n", fields_on.surface, traction.join(", "));
            for claim in &fields_on.claims {
                let quantities: Vec<String> =
                    claim.quantities.iter().map(|&q| fields.graph.print(q)).collect();
                text += &format!("    {:?} ({}) is to vanish\n", claim.what, quantities.join(", "));
            }
        }
        for rotation in spec.rotation.iter() {
            text += &format!("{}\n", rotation.formula(&spec.graph));
        }
        for check in &spec.cross_checks {
            let listing = match &check.listing {
                ListingText::Inline(listing) => listing.text().trim(),
                ListingText::File { path, .. } => path,
            };
            let line = listing.lines().next().unwrap();
            text += &format!("{}: {line}\n", check.source);
            for (name, _) in &check.renamed {
                text += &format!("    {name} = {}\n", spec.graph.print(check.names[name]));
            }
        }
        expect(&path, &text, &mut failures);
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn derivation_is_deterministic() {
    for path in cases("ok") {
        let mut programs = (0..2).map(|_| {
            let mut fields = parse(&path).unwrap().derive().unwrap();
            let outputs = fields.b.clone();
            fields.program(&outputs).operations().to_vec()
        });
        assert_eq!(programs.next(), programs.next());
    }
}

/// Rims that are free of traction by construction are so in symbols, and loaded ones are not.
#[test]
fn free_rims_have_no_traction_in_symbols() {
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    for (name, free) in [("ring", true), ("ring-nu", false), ("sphere-shell", false)] {
        let fields = parse(&library.join(format!("{name}.toml"))).unwrap().derive().unwrap();
        for rim in [Surface::Inner, Surface::Outer] {
            let found = fields.surfaces.iter().find(|s| s.surface == rim).unwrap();
            assert_eq!(found.traction.iter().all(|&t| t == Graph::ZERO), free, "{name} {rim:?}");
        }
    }
}

/// The coefficients of the study, from its conditions; what comes of them are the fields of the library's ring.
#[test]
fn conditions_return_the_coefficients_of_the_study() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let solved = parse(&root.join("tests/data/specs/ring-solved.toml")).unwrap();
    let mut graph = solved.graph.clone();
    let found = solved.solved.unwrap().unknowns;
    let study = [
        ("c1", "6*Ri/((3*Ri - Ro)*Ro)"),
        ("c2", "-3*(Ro + Ri)/(Ro^2*(3*Ri - Ro))"),
        ("c3", "2/(Ro^2*(3*Ri - Ro))"),
    ];
    for ((name, value), (expected_name, expected)) in found.iter().zip(study) {
        let ast = Ast::parse(expected).unwrap();
        let expected = graph.build(&ast, &mut |graph, name| Ok(graph.symbol(name))).unwrap();
        assert_eq!(name, expected_name);
        assert_eq!(*value, expected, "{name} = {}", graph.print(*value));
    }
    // The displacement in the library is factored by hand.
    let library = parse(&root.join("mms-specs/ring.toml")).unwrap();
    let text = library.graph.print(library.displacement[0]);
    let same = graph.build(&Ast::parse(&text).unwrap(), &mut |graph, name| Ok(graph.symbol(name)));
    let difference = graph.sub(solved.displacement[0], same.unwrap());
    assert!(graph.vanishes(difference));
}

/// The one-dimensional sample with another displacement and the name of its amplitude.
fn sample(amplitude: &str, displacement: &str) -> Result<Spec, Diagnostic> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ok/axis-aligned-1d.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find(|line| line.starts_with("X = ")).unwrap();
    let text = text.replace(line, &format!("X = '{displacement}'"));
    Spec::parse(&text.replace("\nA = ", &format!("\n{amplitude} = ")), "sample.toml")
}

#[test]
fn a_range_admits_what_its_signs_say() {
    for (range, admitted) in [
        ("< 1", [true, false, false]),
        ("<= 1", [true, true, false]),
        ("> 1", [false, false, true]),
        (">= 1", [false, true, true]),
    ] {
        for (default, admitted) in ["0.5", "1", "1.5"].into_iter().zip(admitted) {
            let parameter = format!("more = {{ default = {default}, range = '{range}' }}\nA");
            let found = sample(&parameter, "A*X*t");
            assert_eq!(found.is_ok(), admitted, "{default} {range}");
        }
    }
}

#[test]
fn built_in_names_cannot_be_declared() {
    for name in ["Pi", "sqrt", "diff", "sin", "atan2"] {
        let message = sample(name, "X*t").unwrap_err().to_string();
        assert!(message.contains(&format!("'{name}' is built in")), "{message}");
    }
}

/// The invariants are recognized, so that fields are derived in the same way as for a law that is built in.
#[test]
fn an_energy_in_invariants_has_the_fields_of_the_law_that_it_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = root.join("tests/data/specs/materials/ring-mooney-rivlin.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let text = text.replace(
        "[parameters]",
        "[parameters]\nc1 = { default = 2 }\nc2 = { default = 1 }\nlambda = { default = 3 }",
    );
    let (start, end) = (text.find("law = ").unwrap(), text.find("[domain]").unwrap());
    let [named, stated] = [
        "law = 'mooney-rivlin'\nc1 = 'c1'\nc2 = 'c2'\nlambda = 'lambda'\n",
        "law = 'energy'\nW = 'c1*(I1 - 3 - 2*ln(J)) + c2*(I2 - 3 - 4*ln(J)) + lambda/2*ln(J)^2'\n",
    ]
    .map(|material| {
        let text = [&text[..start], material, &text[end..]].concat();
        let fields = Spec::parse(&text, "sample.toml").unwrap().derive().unwrap();
        fields.b.iter().map(|&b| fields.graph.print(b)).collect::<Vec<_>>()
    });
    assert!(stated == named, "{stated:?}\nis not\n{named:?}");
}

/// At rest a stress at the start is the whole stress, and in balance without a force.
#[test]
fn a_body_at_rest_has_its_stress_at_the_start_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in ["plate-neo-hookean-prestressed", "block-prestressed"] {
        let path = root.join("tests/data/specs/across").join(name).with_extension("toml");
        let text = std::fs::read_to_string(path).unwrap();
        let (start, end) = (text.find("[displacement]").unwrap(), text.find("[material]").unwrap());
        let text = [&text[..start], "[displacement]\nX = '0'\n\n", &text[end..]].concat();
        let spec = Spec::parse(&text, "sample.toml").unwrap();
        let fields = spec.derive().unwrap();
        let printed = |entries: &[Expr]| -> Vec<String> {
            entries.iter().map(|&entry| fields.graph.print(entry)).collect()
        };
        assert_eq!(printed(&fields.P.concat()), printed(&spec.prestress.unwrap().concat()));
        assert_eq!(printed(&fields.b), ["0", "0"]);
        assert!(fields.across.is_none_or(|stretch| fields.graph.print(stretch) == "1"));
    }
}

/// Where the volume is constant, no field depends on how stiff it is: next to incompressibility nothing grows with `lambda / mu`.
#[test]
fn fields_of_motions_with_constant_volume_are_free_of_lambda() {
    let materials = [
        "law = 'neo-hookean'\nlambda = 'lambda'\nmu = 'c1'",
        "law = 'hencky'\nlambda = 'lambda'\nmu = 'c1'",
        "law = 'mooney-rivlin'\nc1 = 'c1'\nc2 = 'c2'\nlambda = 'lambda'",
        "law = 'energy'\nW = 'c1*(I1 - 3 - 2*ln(J)) + lambda/4*(J^2 - 1 - 2*ln(J)) + c2*(I2/J - 3)^2'",
        "law = 'energy'\nW = 'c1*(I1/J^(2/3) - 3)*(1 + ln(J)) + lambda/2*(J - 1)^2'",
    ];
    let motions = [
        ("cartesian", 2, "X = 'A*sin(Pi*Y)*cos(t)'"),
        ("cartesian", 3, "X = 'A*sin(Pi*Y)*cos(t)'\nY = 'A*sin(Pi*Z)*cos(t)'"),
        ("polar", 2, "R = '-2*R*sin(A*R^2*t)^2'\ntheta = '2*R*sin(A*R^2*t)*cos(A*R^2*t)'"),
    ];
    for (coordinates, dimension, displacement) in motions {
        let domain = match (coordinates, dimension) {
            ("polar", _) => "shape = 'annulus'\ninner = '3/4'\nouter = '5/4'",
            (_, 2) => "shape = 'box'\nlower = [0, 0]\nupper = [1, 1]",
            _ => "shape = 'box'\nlower = [0, 0, 0]\nupper = [1, 1, 1]",
        };
        for material in materials {
            let text = format!(
                "name = 'sample'\ntitle = 'sample'\ncoordinates = '{coordinates}'\ndimension = {dimension}\n\
                 [parameters]\nA = {{ default = 0.1 }}\nlambda = {{ default = 3 }}\nc1 = {{ default = 2 }}\n\
                 c2 = {{ default = 1 }}\nrho0 = {{ default = 1 }}\n[displacement]\n{displacement}\n\
                 [material]\n{material}\n[domain]\n{domain}\n[time]\nperiod = 1\nwave-speed = 1\n"
            );
            let derived = Spec::parse(&text, "sample.toml").unwrap().derive();
            // In space this shear couples all three directions.
            let Ok(mut fields) = derived else {
                assert!(material.contains("hencky") && dimension == 3, "{text}");
                continue;
            };
            let lambda = fields.graph.symbol("lambda");
            let all = [&fields.b[..], &fields.P.concat()].concat();
            assert_eq!(fields.J, Graph::ONE, "{text}");
            assert!(!fields.graph.symbols_in(&all).contains(&lambda), "{text}");
        }
    }
}

#[test]
fn names_of_64_letters_are_the_longest() {
    let [longest, longer] = [64, 65].map(|length| "a".repeat(length));
    assert!(sample(&longest, &format!("{longest}*sin(Pi*X)*cos(c*Pi*t)")).is_ok());
    let message = sample(&longer, &format!("{longer}*X*t")).unwrap_err().to_string();
    assert!(message.contains("a name of 65 characters; 64 are the limit"), "{message}");
}

/// All of the body in one point: F and J are zero everywhere, and the stress is nowhere defined.
#[test]
fn fields_that_are_nowhere_defined_are_refused() {
    let error = sample("A", "-X").unwrap().derive().unwrap_err();
    assert!(matches!(error, DeriveError::DivisionByZero { .. }), "{error}");
}

/// A displacement that vanishes with its amplitude is formed of nothing that does not: values at an amplitude of 1e-20 from the first
/// term of their series, and J = 1 is known.
#[test]
fn small_displacements_have_no_large_terms() {
    let cases = [
        ("cartesian", "X*(cos(A*Y) - 1) - 2*sin(A*Y)", "0", -2e-20 * 0.4),
        ("cartesian", "X*(exp(A*t) - 1)", "Y*(exp(-A*t) - 1)", 0.3e-20 * 0.7),
        ("cartesian", "X*(1/(1 + A*t) - 1)", "Y*A*t", -0.3e-20 * 0.7),
        ("cartesian", "ln(Y + A) - ln(Y)", "0", 1e-20 / 0.4),
        ("polar", "sqrt(R^2 + A*t) - R", "0", 0.5e-20 * 0.7 / (0.3 * 0.3 + 0.4 * 0.4) * 0.3),
    ];
    for (coordinates, first, second, expected) in cases {
        let names = if coordinates == "polar" { ["R", "theta"] } else { ["X", "Y"] };
        let domain = if coordinates == "polar" {
            "shape = 'annulus'\ninner = 1\nouter = 2"
        } else {
            "shape = 'box'\nlower = [1, 1]\nupper = [2, 2]"
        };
        let text = format!(
            "name = 'small'\ntitle = 'small'\ncoordinates = '{coordinates}'\ndimension = 2\n\
             [parameters]\nA = {{ default = 0.1 }}\n\
             [displacement]\n{} = '{first}'\n{} = '{second}'\n\
             [material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
             [domain]\n{domain}\n[time]\nperiod = 1\nwave-speed = 1\n",
            names[0], names[1]
        );
        let spec = Spec::parse(&text, "small.toml").unwrap_or_else(|error| panic!("{error}"));
        let mut fields = spec.derive().unwrap();
        let program = fields.program(&[fields.u[0]]);
        let value = program.evaluate(&[0.3, 0.4, 0.7, 1e-20])[0];
        assert!((value / expected - 1.0).abs() < 1e-15, "{first}: {value:e}, not {expected:e}");
        let keeps_volume = ["exp", "ln", "R^2", "1/("].iter().any(|part| first.contains(part));
        assert_eq!(fields.J == Graph::ONE, keeps_volume, "{first}");
    }
}

/// The form of a solved displacement that keeps digits is the displacement: at both faces and between them it is what the conditions
/// say, of faces next to each other too.
#[test]
fn solved_displacements_meet_their_conditions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let spec = parse(&root.join("tests/data/specs/digits/solved-slab.toml")).unwrap();
    let mut fields = spec.derive().unwrap();
    let program = fields.program(&[fields.u[0], fields.H[0][0]]);
    for thickness in [0.5, 1e-2, 1e-6] {
        let (A, E, t, L) = (1e-3 * thickness, 10.0, 0.4, 0.9);
        let at = |X: f64| program.evaluate(&[X, t, A, E, 0.2, 1.0, L, thickness]);
        let T = A * (E.sqrt() * t + 1.0 / 3.0_f64).sin();
        let (held, free) = (at(L), at(L * (1.0 + thickness)));
        assert!(held[0].abs() < 1e-15 * T && held[1].abs() < 1e-14 * T / thickness, "{held:?}");
        assert!((free[0] / T - 1.0).abs() < 1e-14, "{free:?}");
        assert!((free[1] - T / L).abs() < 1e-14 * T / (thickness * thickness), "{free:?}");
        // Between them it is the polynomial of third degree with these values and slopes, h = 1/2.
        let half = at(L * (1.0 + 0.5 * thickness))[0];
        let hermite = 0.5 * T - 0.125 * thickness * L * (T / L);
        assert!((half / hermite - 1.0).abs() < 1e-9, "{half:e}, not {hermite:e}");
    }
}
