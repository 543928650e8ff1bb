//! The tools, a row each, and what they do.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use mmsmith_codegen::{Fault, HOSTS};
use mmsmith_expr::Expr;
use mmsmith_spec::{ListingText, Spec};
use mmsmith_vtk::foreign::frames;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::folders::Folders;
use crate::commands::schemas;
use crate::library;
use crate::progress::Watch;

/// Longer files go back only where they were written to a folder.
const LONGEST_TEXT: usize = 1 << 20;

/// The result of a call.
pub(super) enum Outcome {
    /// A document.
    Done(Value),
    /// The tool says why not, to whoever asked.
    Failed(String),
    /// The call is none.
    Refused(String),
}

/// The tools of a server.
pub(super) struct Tools {
    pub(super) folders: Folders,
    /// The command of the solver that `diagnose` starts.
    pub(super) run: Option<String>,
}

/// A tool.
struct Tool {
    name: &'static str,
    about: &'static str,
    /// Arguments that must be there; beside `solution` or `text`, where the tool is about a solution.
    required: &'static [&'static str],
    optional: &'static [&'static str],
    of_solution: bool,
    /// The document of the command whose schema the answer has, if it is one.
    document: Option<&'static str>,
    work: fn(&Tools, &Work) -> Result<Value>,
}

const TOOLS: &[Tool] = &[
    Tool {
        name: "list",
        about: "All solutions of the library with their parameters, laws and boundary conditions.",
        required: &[],
        optional: &[],
        of_solution: false,
        document: Some("list"),
        work: |_, work| work.document(&["list"]),
    },
    Tool {
        name: "explain",
        about: "What a solution models, which terms of the momentum balance it exercises, its blind spots, and what its body force costs.",
        required: &[],
        optional: &[],
        of_solution: true,
        document: Some("explain"),
        work: |_, work| work.document(&["explain", &work.subject]),
    },
    Tool {
        name: "check",
        about: "Compares every field of a solution with the one that it follows from, by differences and by a law written by hand.",
        required: &[],
        optional: &["set", "points"],
        of_solution: true,
        document: Some("check"),
        work: |_, work| work.document(&["check", &work.subject]),
    },
    Tool {
        name: "derive",
        about: "The fields of a solution as formulas: displacement, deformation gradient, first Piola-Kirchhoff stress, body force per unit mass.",
        required: &[],
        optional: &[],
        of_solution: true,
        document: None,
        work: |_, work| derive(&work.subject),
    },
    Tool {
        name: "gen",
        about: "The fields of a solution as source code for a host; its head says how to use it. With a fault, wrong on purpose.",
        required: &["target"],
        optional: &["set", "fault", "out"],
        of_solution: true,
        document: None,
        work: generate,
    },
    Tool {
        name: "score",
        about: "Errors and orders of another solver from the files that it wrote, one recording for each grid.",
        required: &["files"],
        optional: &["set", "cells", "expect"],
        of_solution: true,
        document: Some("score"),
        work: score,
    },
    Tool {
        name: "diagnose",
        about: "Which mistake a solver makes, found by fields that have the opposite mistake. The command of the solver is the server's own.",
        required: &["target"],
        optional: &["set", "cells", "expect"],
        of_solution: true,
        document: Some("diagnose"),
        work: |tools, work| {
            let run = tools.run.as_deref().context("this server was given no solver to run")?;
            let target = work.given.target.as_deref().unwrap_or_default();
            work.document(&["diagnose", &work.subject, "--target", target, "--run", run])
        },
    },
];

/// The most points of a check, which no message can end once it has begun.
const MOST_POINTS: u32 = 10_000;

/// Arguments of any tool.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Given {
    solution: Option<String>,
    text: Option<String>,
    set: BTreeMap<String, f64>,
    points: Option<u32>,
    target: Option<String>,
    fault: Option<String>,
    out: Option<String>,
    files: Vec<String>,
    cells: Vec<u32>,
    expect: Option<String>,
}

/// The schema of an argument.
fn argument(name: &str) -> Value {
    match name {
        "solution" => {
            json!({ "type": "string", "description": "name of a solution of the library, or the path of a specification" })
        }
        "text" => {
            json!({ "type": "string", "description": "a specification as TOML, in place of solution" })
        }
        "set" => json!({
            "type": "object",
            "additionalProperties": { "type": "number" },
            "description": "values in place of the defaults of parameters",
        }),
        "points" => json!({ "type": "integer", "minimum": 1, "maximum": MOST_POINTS }),
        "target" => json!({ "enum": HOSTS.iter().map(|host| host.name).collect::<Vec<_>>() }),
        "fault" => {
            json!({ "enum": Fault::ALL.iter().map(|fault| fault.name()).collect::<Vec<_>>() })
        }
        "out" => {
            json!({ "type": "string", "description": "folder to write to; where it is left out the text comes back" })
        }
        "files" => json!({
            "type": "array",
            "items": { "type": "string" },
            "minItems": 1,
            "description": "recordings, one for each grid: .pvd, .vtu, .vtp, .vtk or .csv",
        }),
        "cells" => json!({
            "type": "array",
            "items": { "type": "integer", "minimum": 1 },
            "description": "cells along the cell length, one for each recording",
        }),
        "expect" => json!({ "type": "string", "description": "orders to be met, such as u=2,v=1" }),
        _ => json!({}),
    }
}

impl Tool {
    fn arguments(&self) -> impl Iterator<Item = &'static str> {
        let subject: &[&str] = if self.of_solution { &["solution", "text"] } else { &[] };
        subject.iter().chain(self.required).chain(self.optional).copied()
    }

    fn schema(&self) -> Value {
        let properties: Map<String, Value> =
            self.arguments().map(|name| (name.to_owned(), argument(name))).collect();
        let mut schema = json!({
            "type": "object",
            "properties": properties,
            "required": self.required,
            "additionalProperties": false,
        });
        if self.of_solution {
            schema["oneOf"] = json!([{ "required": ["solution"] }, { "required": ["text"] }]);
        }
        schema
    }
}

/// A call with its folder for files that do not stay.
struct Work {
    given: Given,
    /// A name of the library, or a path.
    subject: String,
    folder: tempfile::TempDir,
}

impl Tools {
    fn offered(&self) -> impl Iterator<Item = &'static Tool> {
        let has_run = self.run.is_some();
        TOOLS.iter().filter(move |tool| has_run || tool.name != "diagnose")
    }

    /// The tools with the schemas of what goes in, and of what comes out where a command has it.
    pub(super) fn list(&self) -> Value {
        let documents = schemas::all().unwrap_or_default();
        let told = |tool: &Tool| {
            let mut told = json!({
                "name": tool.name, "description": tool.about, "inputSchema": tool.schema(),
            });
            let schema = documents.iter().find(|(name, _)| Some(name.as_str()) == tool.document);
            if let Some((_, schema)) = schema {
                told["outputSchema"] = schema.clone();
            }
            told
        };
        self.offered().map(told).collect()
    }

    pub(super) fn call(&self, parameters: &Value) -> Outcome {
        let name = parameters.get("name").and_then(Value::as_str).unwrap_or_default();
        let Some(tool) = self.offered().find(|tool| tool.name == name) else {
            return Outcome::Refused(format!("no tool '{name}'"));
        };
        let given = match parameters.get("arguments") {
            None | Some(Value::Null) => Map::new(),
            Some(Value::Object(given)) => given.clone(),
            Some(_) => return Outcome::Refused("arguments are an object".into()),
        };
        if let Some(strange) = given.keys().find(|key| tool.arguments().all(|own| own != **key)) {
            return Outcome::Refused(format!("{name} takes no argument '{strange}'"));
        }
        if let Some(lacking) = tool.required.iter().find(|own| !given.contains_key(**own)) {
            return Outcome::Refused(format!("{name} needs the argument '{lacking}'"));
        }
        if tool.of_solution && given.contains_key("solution") == given.contains_key("text") {
            return Outcome::Refused(format!("{name} needs either 'solution' or 'text'"));
        }
        let given = match serde_json::from_value::<Given>(Value::Object(given)) {
            Ok(given) => given,
            Err(error) => return Outcome::Refused(format!("{name}: {error}")),
        };
        if let Some(points) = given.points.filter(|points| !(1..=MOST_POINTS).contains(points)) {
            let message = format!("{name}: points is {points}, and is between 1 and {MOST_POINTS}");
            return Outcome::Refused(message);
        }
        // A mistake of a tool is no end of the server.
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let work = self.begin(tool, given)?;
            (tool.work)(self, &work)
        }));
        match done {
            Ok(Ok(found)) => Outcome::Done(found),
            Ok(Err(error)) => Outcome::Failed(format!("{error:#}")),
            Err(_) => Outcome::Failed(format!("{name} stopped, which is a mistake of mmsmith")),
        }
    }

    /// The subject of a call, all its paths within the folders.
    fn begin(&self, tool: &Tool, given: Given) -> Result<Work> {
        let folder = tempfile::tempdir().context("a folder for the call")?;
        let mut subject = String::new();
        if let Some(text) = &given.text {
            let path = folder.path().join("specification.toml");
            fs::write(&path, text).context("the specification")?;
            subject = path.display().to_string();
        } else if let Some(solution) = &given.solution {
            subject = match library::all_names().contains(solution) {
                true => solution.clone(),
                false => self.specification(solution)?.display().to_string(),
            };
        }
        if tool.of_solution {
            let spec = library::specification(&subject)?;
            self.refuse_listings(&spec, Path::new(&subject))?;
        }
        Ok(Work { given, subject, folder })
    }

    fn specification(&self, path: &str) -> Result<PathBuf> {
        if !path.ends_with(".toml") {
            bail!(
                "there is no solution '{path}' in the library (tool list), and the path of a specification ends in .toml"
            );
        }
        self.folders.file(path)
    }

    /// Refuses listings of a specification that lie elsewhere.
    fn refuse_listings(&self, spec: &Spec, file: &Path) -> Result<()> {
        for check in &spec.cross_checks {
            if let ListingText::File { path, .. } = &check.listing {
                let beside = file.parent().unwrap_or(Path::new("")).join(path);
                self.folders.file(&beside.display().to_string())?;
            }
        }
        Ok(())
    }
}

impl Work {
    /// The document that a command writes.
    fn document(&self, words: &[&str]) -> Result<Value> {
        let out = self.folder.path().join("answer.json");
        let mut line: Vec<OsString> = vec!["mms".into()];
        line.extend(words.iter().map(OsString::from));
        line.extend(self.options());
        line.extend(["--json".into(), out.clone().into()]);
        command(line)?;
        let text = fs::read_to_string(&out).context("the command wrote nothing")?;
        Ok(serde_json::from_str(&text)?)
    }

    /// Options that the arguments stand for.
    fn options(&self) -> Vec<OsString> {
        let Given { set, points, cells, expect, .. } = &self.given;
        let mut options: Vec<String> = Vec::new();
        options.extend(set.iter().map(|(name, value)| format!("--set={name}={value:?}")));
        options.extend(points.map(|points| format!("--points={points}")));
        if !cells.is_empty() {
            let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
            options.push(format!("--cells={}", cells.join(",")));
        }
        options.extend(expect.as_ref().map(|expect| format!("--expect={expect}")));
        options.into_iter().map(OsString::from).collect()
    }
}

/// Does what a command line says; that a check fails is an answer.
fn command(line: Vec<OsString>) -> Result<bool> {
    crate::call(line, &Arc::new(Watch::default())).map_err(|refusal| match refusal {
        crate::Refusal::Failed(message) => anyhow::anyhow!("{message}"),
        crate::Refusal::Interrupted => anyhow::anyhow!("interrupted"),
    })
}

/// All fields as text, in the notation of specifications.
fn derive(subject: &str) -> Result<Value> {
    let spec = library::specification(subject)?;
    let fields = spec.derive_for_hosts()?;
    let print = |expr: &Expr| fields.graph.print(*expr);
    let vector = |all: &[Expr]| all.iter().map(print).collect::<Vec<_>>();
    let matrix = |all: &[Vec<Expr>]| all.iter().map(|row| vector(row)).collect::<Vec<_>>();
    let definitions = fields.definitions.iter();
    let definitions: Map<String, Value> =
        definitions.map(|(symbol, value)| (print(symbol), json!(print(value)))).collect();
    Ok(json!({
        "solution": spec.name,
        "coordinates": spec.coordinates.name(),
        "law": spec.law_formulas(),
        "where": definitions,
        "u": vector(&fields.u),
        "F": matrix(&fields.F),
        "P": matrix(&fields.P),
        "b": vector(&fields.b),
    }))
}

fn generate(tools: &Tools, work: &Work) -> Result<Value> {
    let own = work.folder.path().join("files");
    let out = match &work.given.out {
        Some(out) => tools.folders.folder(out)?,
        None => own.clone(),
    };
    let mut line: Vec<OsString> = ["mms", "gen", &work.subject].map(OsString::from).to_vec();
    line.extend(["--target".into(), work.given.target.clone().unwrap_or_default().into()]);
    line.extend(["--out".into(), own.clone().into()]);
    line.extend(work.given.fault.iter().map(|fault| format!("--fault={fault}").into()));
    line.extend(work.options());
    command(line)?;
    let mut files = Vec::new();
    for entry in fs::read_dir(&own).context("the files")? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_owned();
        let text = fs::read_to_string(&path)?;
        if out != own {
            fs::create_dir_all(&out).with_context(|| out.display().to_string())?;
            let place = out.join(&name);
            // A link there may lead elsewhere.
            if place.is_symlink() {
                bail!("{}: a link is in the way", place.display());
            }
            fs::write(&place, &text).with_context(|| place.display().to_string())?;
            files.push(json!({ "name": name.to_string_lossy(), "path": place }));
        } else if text.len() > LONGEST_TEXT {
            bail!(
                "{} has {} bytes: name a folder to write it to, as 'out'",
                path.display(),
                text.len()
            );
        } else {
            files.push(json!({ "name": name.to_string_lossy(), "text": text }));
        }
    }
    Ok(json!({ "files": files }))
}

fn score(tools: &Tools, work: &Work) -> Result<Value> {
    let mut words = vec!["score".to_owned(), work.subject.clone(), "--each".to_owned()];
    for file in &work.given.files {
        let real = tools.folders.file(file)?;
        // A list names other files.
        for frame in frames(&real)? {
            tools.folders.file(&frame.path.display().to_string())?;
        }
        words.push(real.display().to_string());
    }
    work.document(&words.iter().map(String::as_str).collect::<Vec<_>>())
}
