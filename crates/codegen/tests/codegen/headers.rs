//! Rules for every generated header by itself: it defines all functions that it calls, describes their results, and has names that C
//! accepts.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::Code;
use mmsmith_expr::Function;
use mmsmith_spec::Spec;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The specifications of the library and those of the other laws.
fn specifications() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found: Vec<PathBuf> =
        ["mms-specs", "tests/data/specs", "tests/data/specs/materials", "tests/data/specs/digits"]
            .iter()
            .flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap())
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .collect();
    found.sort();
    found
}

fn header(text: &str) -> String {
    let spec = Spec::parse(text, "test.toml").unwrap_or_else(|diagnostic| panic!("{diagnostic}"));
    Code::new(&spec).unwrap().header_source()
}

/// The functions of this project that the text has before a parenthesis, each with whether it is defined there.
fn functions(header: &str) -> impl Iterator<Item = (&str, bool)> {
    header.match_indices("mmsmith_").filter_map(|(start, _)| {
        let rest = &header[start..];
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_')?;
        let line = header[..start].rfind('\n').map_or(0, |at| at + 1);
        let defined = header[line..].starts_with("MMSMITH_FN");
        rest[end..].starts_with('(').then_some((&rest[..end], defined))
    })
}

#[test]
fn what_a_header_calls_it_defines() {
    let mut all = BTreeSet::new();
    for path in specifications() {
        let header = header(&std::fs::read_to_string(&path).unwrap());
        let defined: BTreeSet<&str> =
            functions(&header).filter(|(_, defined)| *defined).map(|(name, _)| name).collect();
        for (name, _) in functions(&header) {
            assert!(defined.contains(name), "{}: nothing defines {name}", path.display());
            all.insert(name.to_owned());
        }
    }
    // These are not in every header.
    for name in ["log_ratio_slope", "ln_of_both", "log_1p", "sum_error", "product_error"] {
        assert!(all.contains(&format!("mmsmith_{name}")), "{name} is called nowhere");
    }
}

/// A specification with the given parameters, of which the first is made use of, and the given law.
fn specification(parameters: &[&str], law: &str) -> String {
    let declared: String =
        parameters.iter().map(|name| format!("{name} = {{ default = 0.1 }}\n")).collect();
    format!(
        "name = 'test'\ntitle = 'Test'\ncoordinates = 'cartesian'\ndimension = 1\n\
         [parameters]\n{declared}\
         [displacement]\nX = '{}*X*t'\n\
         [material]\n{law}\ndensity = 1\n\
         [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n\
         [time]\nperiod = 1\nwave-speed = 1\n",
        parameters[0]
    )
}

#[test]
fn constants_of_laws_are_explained() {
    let lame = &[("lambda", "first Lame constant"), ("mu", "shear modulus")][..];
    let cases = [
        ("law = 'neo-hookean'\nlambda = 2\nmu = 3", lame),
        ("law = 'hencky'\nlambda = 2\nmu = 3", lame),
        ("law = 'st-venant-kirchhoff'\nlambda = 2\nmu = 3", lame),
        ("law = 'linear-elastic'\nlambda = 2\nmu = 3", lame),
        (
            "law = 'mooney-rivlin'\nc1 = 2\nc2 = 3\nlambda = 4",
            &[
                ("lambda", "the factor of (ln J)^2/2"),
                ("c1", "the factor of I1 in the strain energy"),
                ("c2", "the factor of I2 in the strain energy"),
            ],
        ),
    ];
    for (law, constants) in cases {
        let header = header(&specification(&["A"], law));
        for (name, about) in constants {
            let expected =
                format!("/* {about} */\nMMSMITH_FN double test_{name}(const test_solution *s)\n{{");
            assert!(header.contains(&expected), "{law}: no {expected}");
        }
    }
}

/// A header says of which functions C and Rust have different libraries, and calls every function by a name that C has.
#[test]
fn functions_of_another_library_are_named() {
    for &function in Function::ALL.iter().filter(|f| f.arity() == 1 && f.math_h().is_some()) {
        let text = specification(&["A"], "law = 'neo-hookean'\nlambda = 1\nmu = 1");
        let field = format!("X = 'A*{}(X)*t'", function.name());
        let header = header(&text.replace("X = 'A*X*t'", &field));
        let called = match function.own() {
            Some(own) => format!("mmsmith_{own}"),
            None => function.math_h().unwrap().to_owned(),
        };
        assert!(header.contains(&format!("{called}(X[0])")), "{}", function.name());
        let note = format!("Of {called} the Rust functions");
        let foreign = function.is_of_another_library();
        assert_eq!(header.contains(&note), foreign, "{}", function.name());
    }
}

/// Words and macros of C get an underscore at their end, and more underscores where another parameter has that name.
#[test]
fn members_have_names_that_c_takes() {
    let law = "law = 'neo-hookean'\nlambda = 1\nmu = 1";
    let cases: [(&[&str], &[&str]); 6] = [
        (&["A", "nu"], &["A", "nu"]),
        (&["int"], &["int_"]),
        (&["M_PI", "FLT_MAX", "A"], &["M_PI_", "FLT_MAX_", "A"]),
        (&["int_", "int"], &["int_", "int__"]),
        (&["int", "int_", "int__"], &["int___", "int_", "int__"]),
        (&["M_", "M__", "M_E"], &["M__", "M___", "M_E_"]),
    ];
    for (parameters, members) in cases {
        let header = header(&specification(parameters, law));
        let (_, structure) = header.split_once("typedef struct test_parameters {\n").unwrap();
        let (structure, _) = structure.split_once("} test_parameters;").unwrap();
        let found: Vec<&str> = structure
            .lines()
            .map(|line| line.trim_start().strip_prefix("double ").unwrap())
            .map(|line| line.split_once(';').unwrap().0)
            .collect();
        assert_eq!(found, members, "{parameters:?}");
    }
}
