//! The conventions that all commands share: documents on standard output, input from a pipe, how much is said, colours.

use crate::command::{mms, mms_with, names, read_json, refuses};
use serde_json::Value;

#[test]
fn a_dash_writes_the_document_to_standard_output_and_nothing_else() {
    let place = tempfile::tempdir().expect("a folder");
    let run = "axis-aligned-1d --cells 4 --periods 0.1 --threads 1";
    for (arguments, schema) in [
        ("list".to_owned(), "mmsmith.list/"),
        ("check axis-aligned-1d --points 20".into(), "mmsmith.check/"),
        ("coverage axis-aligned-1d".into(), "mmsmith.coverage/"),
        (format!("run {run}"), "mmsmith.run/"),
        (format!("stability {run} --at 0.1"), "mmsmith.stability/"),
        ("converge axis-aligned-1d --cells 4,8 --threads 1".into(), "mmsmith.converge/"),
    ] {
        let called = mms(place.path(), &format!("{arguments} --json -"));
        let document: Value = serde_json::from_str(&called.stdout)
            .unwrap_or_else(|error| panic!("mms {arguments}: {error} in {}", called.stdout));
        let found = document["schema"].as_str().expect("a schema");
        assert!(found.starts_with(schema), "mms {arguments}: {found}");
    }
    assert_eq!(names(place.path()), Vec::<String>::new());
}

#[test]
fn one_document_fits_on_standard_output() {
    let place = tempfile::tempdir().expect("a folder");
    let arguments = "run axis-aligned-1d --cells 4 --json - --history -";
    refuses(place.path(), arguments, &["standard output takes one document"]);
    mms(place.path(), "list --json ./-");
    assert_eq!(names(place.path()), ["-"]);
    read_json(&place.path().join("-"));
}

#[test]
fn points_are_read_from_standard_input() {
    let place = tempfile::tempdir().expect("a folder");
    let points = r#"[{ "X": [0.25], "t": 0.1 }]"#;
    let called = mms_with(place.path(), "eval axis-aligned-1d --points -", &[], points);
    assert_eq!(called.status, 0, "{}", called.stderr);
    let document: Value = serde_json::from_str(&called.stdout).expect("JSON");
    assert_eq!(document["rows"].as_array().map(Vec::len), Some(1));
    let called = mms_with(place.path(), "eval axis-aligned-1d --points -", &[], "[");
    assert_eq!(called.status, 2);
    assert!(called.stderr.contains("standard input is not valid JSON"), "{}", called.stderr);
}

#[test]
fn quiet_and_verbose_say_less_and_more() {
    let place = tempfile::tempdir().expect("a folder");
    let run = "run axis-aligned-1d --cells 4 --periods 0.1 --threads 1 --json r.json";
    let usual = mms(place.path(), run);
    assert_eq!(usual.stderr, "");
    let quiet = mms(place.path(), &format!("--quiet {run}"));
    assert_eq!((quiet.status, quiet.stderr.as_str()), (0, ""));
    assert!(quiet.stdout.contains("status: ok"), "results are said: {}", quiet.stdout);
    let verbose = mms(place.path(), &format!("{run} -v"));
    for part in [concat!("mms ", env!("CARGO_PKG_VERSION")), "cfl = 0.4", "shape = \"gimp\""] {
        assert!(verbose.stderr.contains(part), "'{part}' is missing in {}", verbose.stderr);
    }
    // Errors are always said.
    refuses(place.path(), "--quiet run nothing", &["error: there is no solution 'nothing'"]);
    refuses(place.path(), "list --quiet --verbose", &["cannot be used with"]);
}

#[test]
fn colours_follow_the_option_and_the_usual_variables() {
    let place = tempfile::tempdir().expect("a folder");
    let is_colored = |arguments: &str, variables: &[(&str, &str)]| {
        let called = mms_with(place.path(), arguments, variables, "");
        assert_eq!(called.status, 2, "mms {arguments}");
        called.stderr.contains('\x1b')
    };
    // Once a message of the program, once one of the reader of the command line.
    for arguments in ["run nothing", "run ring --cells x"] {
        assert!(!is_colored(arguments, &[]), "{arguments}: no terminal");
        assert!(is_colored(&format!("{arguments} --color always"), &[]), "{arguments}");
        assert!(is_colored(&format!("{arguments} --color=always"), &[("NO_COLOR", "1")]));
        assert!(is_colored(arguments, &[("CLICOLOR_FORCE", "1")]), "{arguments}");
        assert!(!is_colored(arguments, &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]));
        assert!(!is_colored(&format!("{arguments} --color never"), &[("CLICOLOR_FORCE", "1")]));
    }
}

#[test]
fn values_that_begin_with_a_hyphen_are_met_with_what_is_right() {
    let place = tempfile::tempdir().expect("a folder");
    for (arguments, right) in [
        ("run ring --cells -1", "it must be a whole number, at least 1"),
        ("run ring --threads -2", "it must be a whole number from 1 to 1024"),
        ("run ring --ppc -1", "it must be a whole number, at least 1"),
        ("run ring --cfl -0.1", "it must be a positive number"),
        ("converge ring --cells -1,2", "it must be a whole number, at least 1"),
        ("converge ring --cells 8 --cfls -0.1,0.2", "it must be a positive number"),
        ("tradeoff ring --budget -5s", "it must be a positive time"),
        ("stability ring --samples -1 --search random", "it must be a whole number from 1"),
        ("check ring --points -1", "it must be a whole number from 1"),
    ] {
        let called = mms(place.path(), arguments);
        assert_eq!(called.status, 2, "mms {arguments}");
        assert!(called.stderr.contains(right), "mms {arguments}: {}", called.stderr);
        assert!(!called.stderr.contains("tip:"), "mms {arguments}: {}", called.stderr);
    }
    // A word that is no number is an option still.
    refuses(place.path(), "run ring --cells --shape gimp", &["a value is required for '--cells"]);
}

#[test]
fn a_cause_is_told_once() {
    let place = tempfile::tempdir().expect("a folder");
    for arguments in ["run ring --json no/folder/r.json", "run no/file.toml", "resume nothing"] {
        let said = mms(place.path(), arguments).stderr;
        assert_eq!(said.matches("os error").count(), 1, "mms {arguments}: {said}");
        assert_eq!(said.matches("error: ").count(), 1, "mms {arguments}: {said}");
    }
    std::fs::write(
        place.path().join("run.json"),
        r#"{ "schema": "mmsmith.checkpoint/1", "folder": ".", "arguments": ["run", "--nonsense"] }"#,
    )
    .expect("written");
    let said = mms(place.path(), "resume .").stderr;
    assert_eq!(said.matches("error:").count(), 1, "{said}");
}

#[test]
fn the_formulation_has_its_old_names_too() {
    let place = tempfile::tempdir().expect("a folder");
    let mut documents = Vec::new();
    for option in ["--formulation total-lagrangian", "--formulation tl", "--frame total"] {
        let run = format!("run axis-aligned-1d --cells 4 --periods 0.1 --threads 1 {option}");
        let called = mms(place.path(), &format!("{run} --json -"));
        assert_eq!(called.status, 0, "mms {run}: {}", called.stderr);
        let document: Value = serde_json::from_str(&called.stdout).expect("JSON");
        assert_eq!(document["settings"]["frame"], "total");
        documents.push(document["settings"].clone());
    }
    assert!(documents.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn shells_and_manuals_know_the_commands() {
    let place = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let called = mms(place.path(), &format!("completions {shell}"));
        assert_eq!(called.status, 0, "{}", called.stderr);
        assert!(called.stdout.contains("converge") && called.stdout.contains("formulation"));
    }
    let called = mms(place.path(), "man pages/here");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let pages = names(&place.path().join("pages/here"));
    for page in ["mms.1", "mms-run.1", "mms-converge.1", "mms-list.1"] {
        assert!(pages.iter().any(|name| name == page), "{page} is missing in {pages:?}");
    }
    let reference = mms(place.path(), "reference").stdout;
    for part in ["## mms run\n", "- `--formulation <", "  - `total-lagrangian`: ", "MMSMITH_SPECS"]
    {
        assert!(reference.contains(part), "{part} is missing in {reference}");
    }
}
