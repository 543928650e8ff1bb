//! Rules for every host's file, whatever the host.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::{Code, Fault, HOSTS, Host, Origin, Unwritable};
use mmsmith_spec::Spec;
use std::fs;
use std::path::Path;

/// Every specification of the library and of the tests that stands for itself.
fn specifications() -> Vec<Spec> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders =
        ["mms-specs", "tests/data/specs", "tests/data/specs/materials", "tests/data/specs/digits"];
    let mut paths: Vec<_> = folders
        .iter()
        .flat_map(|folder| fs::read_dir(root.join(folder)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    paths.sort();
    paths
        .iter()
        .map(|path| Spec::parse(&fs::read_to_string(path).unwrap(), "spec.toml").unwrap())
        .collect()
}

fn library(name: &str) -> Spec {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../mms-specs")
        .join(name)
        .with_extension("toml");
    Spec::parse(&fs::read_to_string(path).unwrap(), name).unwrap()
}

fn host(name: &str) -> &'static Host {
    Host::named(name).unwrap()
}

/// A host writes every solution, or refuses it by its own name, the function's and the solution's.
#[test]
fn every_host_writes_or_says_which_function_it_lacks() {
    let mut refused = Vec::new();
    for spec in specifications() {
        let code = Code::new(&spec).unwrap();
        for host in HOSTS {
            match host.source(&code) {
                Ok(text) => {
                    assert!(
                        text.contains("mms-specs/"),
                        "{} of {}: no origin",
                        host.name,
                        spec.name
                    );
                }
                Err(error) => {
                    let Unwritable::Function { target, function, solution } = &error else {
                        panic!("{error}")
                    };
                    assert_eq!((*target, solution), (host.name, &spec.name));
                    let message = error.to_string();
                    assert!(
                        message.contains(function.as_str()) && message.contains("choose a target"),
                        "{message}"
                    );
                    refused.push(format!("{} {function}", host.name));
                }
            }
        }
    }
    refused.sort();
    refused.dedup();
    let lacking = ["julia erf", "kratos erf", "moose erf"];
    assert!(lacking.iter().all(|one| refused.iter().any(|other| other == one)), "{refused:?}");
    // Squared logarithms of ratios and hyperbolic cosines of roots need functions.
    assert!(
        refused.iter().all(
            |one| !["cpp", "fortran", "numpy", "ufl"].contains(&one.split(' ').next().unwrap())
        ),
        "{refused:?}"
    );
}

/// Lines of Fortran have at most 132 characters, and a statement at most 255 continuations.
#[test]
fn fortran_stays_within_its_lines() {
    for spec in specifications() {
        let code = Code::new(&spec).unwrap();
        for name in ["fortran", "abaqus", "calculix"] {
            let text = host(name).source(&code).unwrap();
            let longest = text.lines().map(|line| line.chars().count()).max().unwrap();
            assert!(longest <= 132, "{name} of {}: {longest}", spec.name);
        }
    }
}

/// Each fault shows in each file whose host has the changed field, and the file names the fault.
#[test]
fn faults_show_in_every_host() {
    let spec = library("skew-2d");
    let origin = || Origin { command: "test".into(), file: "skew-2d.toml".into() };
    let right = Code::of(&spec, spec.derive().unwrap(), origin());
    let body = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.contains("WRONG ON PURPOSE")).map(str::to_owned).collect()
    };
    for fault in Fault::ALL {
        let wrong =
            Code::with_fault(&spec, spec.derive().unwrap(), origin(), (fault, false)).unwrap();
        for host in HOSTS {
            let text = host.source(&wrong).unwrap();
            assert!(
                text.contains(&format!("the fault {fault} is planted")),
                "{}: {fault}",
                host.name
            );
            // The fragments for OpenFOAM include the header, which has the changed field.
            let changed = body(&text) != body(&host.source(&right).unwrap());
            assert!(changed || host.name == "openfoam", "{}: {fault}", host.name);
        }
    }
}

/// The names of parameters that a language has as words or functions of its own.
#[test]
fn names_of_parameters_are_the_specifications_business() {
    let text = "name = 'class'\ntitle = 'Test'\ncoordinates = 'cartesian'\ndimension = 1\n\
        [parameters]\nlambda = { default = 2 }\na = { default = 0.1 }\nA = { default = 1 }\nend = { default = -1e-9 }\n\
        [displacement]\nX = 'a*A*X*t + end*t'\n\
        [material]\nlaw = 'neo-hookean'\nlambda = 'lambda'\nmu = 3\ndensity = 1\n\
        [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n\
        [time]\nperiod = 1\nwave-speed = 1\n";
    let spec = Spec::parse(text, "class.toml").unwrap();
    let code = Code::new(&spec).unwrap();
    let cases = [
        (
            "fortran",
            &["real(dp) :: a = 0.1_dp", "real(dp) :: A_ = 1.0_dp", "real(dp) :: end = (-1e-9_dp)"]
                [..],
        ),
        ("cpp", &["namespace class_ {", "double lambda = 2.0;"]),
        ("numpy", &["\"lambda\": 2.0", "def lambda_(self)"]),
        ("julia", &["\"end\" => (-1e-9)", "function lambda(s)"]),
    ];
    for (name, parts) in cases {
        let text = host(name).source(&code).unwrap();
        for part in parts {
            assert!(text.contains(part), "{name}: no {part} in\n{text}");
        }
    }
}
