//! Schemas of the JSON of commands: the committed ones are the program's, and what the program writes keeps to them.

use std::path::{Path, PathBuf};

use crate::command::{self, mms, read_json};
use serde_json::Value;

/// The problems of a value, each with its place, by the part of JSON Schema that these schemas use.
fn problems(value: &Value, (schema, root): (&Value, &Value), place: &str, all: &mut Vec<String>) {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let name = name.strip_prefix("#/$defs/").expect("a definition");
        return problems(value, (&root["$defs"][name], root), place, all);
    }
    if let Some(expected) = schema.get("const")
        && value != expected
    {
        all.push(format!("{place}: {value} is not {expected}"));
    }
    if let Some(variants) = schema.get("anyOf").and_then(Value::as_array) {
        let of_each = variants.iter().map(|variant| {
            let mut found = Vec::new();
            problems(value, (variant, root), place, &mut found);
            found
        });
        let least = of_each.min_by_key(Vec::len).expect("a variant");
        all.extend(least);
    }
    let is_of = |kind: &Value| match kind.as_str().expect("a type") {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        "null" => value.is_null(),
        other => panic!("{place}: the type {other}"),
    };
    let is_of_type = match schema.get("type") {
        None => true,
        Some(Value::Array(kinds)) => kinds.iter().any(is_of),
        Some(kind) => is_of(kind),
    };
    if !is_of_type {
        // Wherever it has other parts, those are no better.
        all.push(format!("{place}: {value} is no {}", schema["type"]));
        return;
    }
    for key in schema.get("required").and_then(Value::as_array).into_iter().flatten() {
        let key = key.as_str().expect("a key");
        if value.get(key).is_none() {
            all.push(format!("{place}: {key} is missing"));
        }
    }
    for (key, value) in value.as_object().into_iter().flatten() {
        let place = format!("{place}.{key}");
        match (
            schema.get("properties").and_then(|known| known.get(key)),
            &schema["additionalProperties"],
        ) {
            (Some(schema), _) => problems(value, (schema, root), &place, all),
            (None, Value::Bool(false)) => all.push(format!("{place} is not in the schema")),
            (None, other) => problems(value, (other, root), &place, all),
        }
    }
    if let Some(items) = schema.get("items") {
        for (index, value) in value.as_array().into_iter().flatten().enumerate() {
            problems(value, (items, root), &format!("{place}[{index}]"), all);
        }
    }
}

fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/reference/schemas")
}

#[test]
fn committed_schemas_are_those_of_the_program_and_are_linked() {
    let place = tempfile::tempdir().unwrap();
    let called = mms(place.path(), "reference --schemas made");
    assert_eq!(called.status, 0, "{}", called.stderr);
    let made = place.path().join("made");
    let (names, known) = (command::names(&made), command::names(&committed()));
    assert_eq!(names, known, "mms reference --schemas docs/src/reference/schemas writes them");
    let page = std::fs::read_to_string(committed().join("../json.md")).unwrap();
    for name in names {
        assert!(read_json(&made.join(&name)) == read_json(&committed().join(&name)), "{name}");
        assert!(page.contains(&format!("(schemas/{name})")), "{name} is not linked in json.md");
    }
}

#[test]
fn every_command_keeps_to_its_schema() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let points = r#"[{"X": [0.25], "t": 0.001}, {"X": [7.0], "t": 0.001}]"#;
    std::fs::write(at.join("points.json"), points).unwrap();
    for grid in ["4", "8"] {
        let call = format!("run axis-aligned --cells {grid} --vtk of-{grid} --frames 5");
        assert_eq!(mms(at, &call).status, 0);
    }
    for (call, status) in [
        ("run axis-aligned-1d --cells 8 --history h.csv", 0),
        ("run axis-aligned-1d --cells 8 --integrator usl --transfer apic", 0),
        ("run axis-aligned-1d --cells 8 --cfl 4", 1),
        ("run ring --cells 4 --formulation total-lagrangian", 0),
        ("run ring --cells 4 --layout clipped --grid-angle 20 --precision f32", 0),
        ("run ring --cells 4 --shape cpdi2 --layout body-fitted", 0),
        ("run sphere-shell --cells 2 --periods 0.05 --frame tl", 0),
        ("converge axis-aligned-1d --cells 4,8,16", 0),
        ("converge axis-aligned-1d --cells 8 --cfls 0.4,0.2,0.1", 0),
        ("converge axis-aligned-1d --cells 4,8 --cfl 4", 1),
        ("converge shear-wave --cells 4,8", 0),
        ("run skew-2d --static --cells 4", 0),
        ("run thick-cylinder --static --cells 4", 0),
        ("run skew-2d --static --cells 4 --along A=0.02,0.05", 0),
        ("run thick-cylinder --formulation total-lagrangian --cells 4 --periods 0.05", 0),
        ("converge skew-2d --static --cells 4,8", 0),
        (
            "stability axis-aligned-1d --cells 4 --width 0.3 --over shape=gimp,linear --over nu=0,0.3",
            0,
        ),
        ("stability axis-aligned-1d --cells 4 --at 3", 1),
        ("stability axis-aligned-1d --search random --samples 2 --periods 0.2 --cfl 9", 1),
        ("tradeoff axis-aligned-1d --cells 4,8 --tolerance 0.5 --time 60s", 0),
        ("score axis-aligned of-4 of-8 --cells 4,8", 0),
        ("score axis-aligned of-8 --cells 8 --against mms:gimp,cd", 0),
        ("score axis-aligned of-8 of-8 --differences 2e-4,1e-4", 1),
        ("check axis-aligned ring", 0),
        ("explain ring", 0),
        ("explain shear-wave", 0),
        ("coverage ring bar", 0),
        ("eval axis-aligned-1d --points points.json", 0),
        ("list", 0),
        ("doctor", 0),
        ("diagnose --list", 0),
    ] {
        let called = mms(at, &format!("{call} --json made.json"));
        assert_eq!(called.status, status, "mms {call}: {}{}", called.stdout, called.stderr);
        let document = read_json(&at.join("made.json"));
        let name = document["schema"].as_str().expect("a schema").to_owned();
        let name = name.strip_prefix("mmsmith.").and_then(|name| name.strip_suffix("/1"));
        let schema = read_json(&committed().join(format!("{}.json", name.expect("a name"))));
        let mut found = Vec::new();
        problems(&document, (&schema, &schema), "$", &mut found);
        assert!(found.is_empty(), "mms {call}:\n{}", found.join("\n"));
    }
}

/// A schema that asks for no key: keys were added since.
fn without_required(schema: &Value) -> Value {
    match schema {
        Value::Object(all) => {
            let kept = all.iter().filter(|(key, value)| *key != "required" || !value.is_array());
            kept.map(|(key, value)| (key.clone(), without_required(value))).collect()
        }
        Value::Array(all) => all.iter().map(without_required).collect(),
        other => other.clone(),
    }
}

#[test]
fn documents_of_earlier_versions_have_no_keys_that_this_one_lacks() {
    let kept = committed().join("../../../../tests/data/kept");
    for version in std::fs::read_dir(kept).unwrap() {
        let documents = version.unwrap().path().join("documents");
        for name in command::names(&documents) {
            let document = read_json(&documents.join(&name));
            let schema = without_required(&read_json(&committed().join(&name)));
            let mut found = Vec::new();
            problems(&document, (&schema, &schema), "$", &mut found);
            assert!(found.is_empty(), "{}/{name}:\n{}", documents.display(), found.join("\n"));
        }
    }
}
