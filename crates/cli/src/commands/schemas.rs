//! Schemas of the JSON of all commands, from a list of keys in a short notation.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use serde_json::{Map, Value, json};

/// A definition: `name = type`, which further lines with a margin go on with; documents begin with a slash.
const KEYS: &str = include_str!("schemas.txt");

/// The name of each schema, as `mmsmith.NAME/1` has it, and the schema.
pub(super) fn all() -> Result<Vec<(String, Value)>> {
    let (mut known, mut documents) = (BTreeMap::new(), Vec::new());
    let lines = KEYS.lines().filter(|line| !line.starts_with('#'));
    let text = lines.collect::<Vec<_>>().join("\n").replace("\n    ", " ");
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let (name, of) = line.split_once(" = ").with_context(|| format!("no type: {line}"))?;
        let mut reader = Reader { rest: of, known: &known };
        let schema = reader.union().with_context(|| format!("{name}, at '{}'", reader.rest))?;
        match name.strip_prefix('/') {
            Some(name) => documents.push((name.to_owned(), document(name, schema, &known))),
            None => drop(known.insert(name.to_owned(), schema)),
        }
    }
    Ok(documents)
}

/// A whole document of a command, with the definitions that it refers to.
fn document(name: &str, mut schema: Value, known: &BTreeMap<String, Value>) -> Value {
    let mut used = BTreeMap::new();
    collect(&schema, known, &mut used);
    let mark = format!("mmsmith.{name}/1");
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema".into();
    schema["title"] = mark.as_str().into();
    schema["properties"]["schema"] = json!({ "const": mark });
    if let Some(required) = schema["required"].as_array_mut() {
        required.push("schema".into());
    }
    schema["$defs"] = json!(used);
    schema
}

const PLACE: &str = "#/$defs/";

/// Puts the definitions that a schema refers to, and those that they refer to, among those `used`.
fn collect(schema: &Value, known: &BTreeMap<String, Value>, used: &mut BTreeMap<String, Value>) {
    let name = schema.get("$ref").and_then(Value::as_str).and_then(|to| to.strip_prefix(PLACE));
    if let Some((name, found)) = name.and_then(|name| known.get_key_value(name))
        && used.insert(name.clone(), found.clone()).is_none()
    {
        collect(found, known, used);
    }
    let parts = schema.as_object().into_iter().flat_map(Map::values);
    let parts = parts.chain(schema.as_array().into_iter().flatten());
    parts.for_each(|part| collect(part, known, used));
}

/// A value as JSON in which what fits a line is on one.
pub(super) fn lines(value: &Value, margin: usize) -> String {
    const MOST: usize = 140;
    let short = value.to_string();
    if margin + short.len() <= MOST {
        return short;
    }
    let inner = |value: &Value| lines(value, margin + 2);
    let (marks, parts): (_, Vec<String>) = match value {
        Value::Object(all) => (
            ["{", "}"],
            all.iter().map(|(key, value)| format!("\"{key}\": {}", inner(value))).collect(),
        ),
        Value::Array(all) => (["[", "]"], all.iter().map(inner).collect()),
        _ => return short,
    };
    let between = format!("\n{:1$}", "", margin + 2);
    let parts = parts.join(&format!(",{between}"));
    format!("{}{between}{parts}\n{:margin$}{}", marks[0], "", marks[1])
}

/// A reader of the notation: the rest of the text, and the types that it may name.
struct Reader<'a> {
    rest: &'a str,
    known: &'a BTreeMap<String, Value>,
}

impl<'a> Reader<'a> {
    /// Whether the rest begins with a mark, which is then read.
    fn takes(&mut self, mark: &str) -> bool {
        let found = self.rest.trim_start().strip_prefix(mark);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn word(&mut self) -> &'a str {
        let text = self.rest.trim_start();
        let end = text.find(|c: char| !(c.is_alphanumeric() || "_-".contains(c)));
        let (word, rest) = text.split_at(end.unwrap_or(text.len()));
        self.rest = rest;
        word
    }

    /// Types between bars, one of which a value has.
    fn union(&mut self) -> Result<Value> {
        let mut all = vec![self.one()?];
        while self.takes("|") {
            all.push(self.one()?);
        }
        Ok(if all.len() == 1 { all.remove(0) } else { json!({ "anyOf": all }) })
    }

    fn one(&mut self) -> Result<Value> {
        let found = if self.takes("[") {
            let items = self.union()?;
            self.closes("]")?;
            json!({ "type": "array", "items": items })
        } else if self.takes("(") {
            let inner = self.union()?;
            self.closes(")")?;
            inner
        } else if self.takes("{") {
            self.object()?
        } else if self.takes("\"") {
            let word = json!({ "const": self.word() });
            self.closes("\"")?;
            word
        } else {
            match self.word() {
                "number" => json!({ "type": ["number", "null"] }),
                "count" => json!({ "type": "integer" }),
                "text" => json!({ "type": "string" }),
                "flag" => json!({ "type": "boolean" }),
                word if self.known.contains_key(word) => {
                    json!({ "$ref": format!("{PLACE}{word}") })
                }
                word => bail!("no type '{word}'"),
            }
        };
        let may_be_null = self.takes("?");
        Ok(if may_be_null { json!({ "anyOf": [found, { "type": "null" }] }) } else { found })
    }

    fn object(&mut self) -> Result<Value> {
        let (mut properties, mut required) = (Map::new(), Vec::new());
        let mut others = Value::Bool(false);
        loop {
            if self.takes("..") {
                let name = self.word();
                let part = self.known.get(name).with_context(|| format!("no type '{name}'"))?;
                properties.extend(part["properties"].as_object().cloned().unwrap_or_default());
                required.extend(part["required"].as_array().cloned().unwrap_or_default());
            } else if self.takes("*:") {
                others = self.union()?;
            } else {
                let name = self.word().to_owned();
                if !self.takes("?") {
                    required.push(name.as_str().into());
                }
                self.closes(":")?;
                properties.insert(name, self.union()?);
            }
            if !self.takes(",") {
                break;
            }
        }
        self.closes("}")?;
        Ok(json!({
            "type": "object",
            "properties": properties,
            "required": required,
            "additionalProperties": others,
        }))
    }

    fn closes(&mut self, mark: &str) -> Result<()> {
        if !self.takes(mark) {
            bail!("'{mark}' is missing");
        }
        Ok(())
    }
}
