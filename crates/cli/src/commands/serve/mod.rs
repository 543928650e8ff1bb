//! `mms serve`: the commands as tools for programs that speak the model context protocol.
//!
//! A message is a line of JSON-RPC 2.0. Whatever a line holds, the answer is one line, or none to a notification; the server ends where its
//! input ends. It asks nothing of a network, and reads and writes no file outside of the folders that it was given.

mod folders;
mod tools;

use std::io::{self, BufRead, Read};

use anyhow::Result;
use serde_json::{Value, json};

use crate::arguments::ServeOptions;
use crate::{library, terminal};
use folders::Folders;
use tools::{Outcome, Tools};

/// The longest line that is read: a specification of the largest size, with its characters escaped.
const LONGEST: u64 = 32 << 20;
/// Versions of the protocol, the newest first.
const VERSIONS: [&str; 3] = ["2025-06-18", "2025-03-26", "2024-11-05"];
const INSTRUCTIONS: &str = "Manufactured solutions for solid mechanics: list the solutions or state one as TOML, derive its fields, generate them \
    in the language of a solver, and score what the solver wrote.";

/// Codes of JSON-RPC.
const NO_JSON: i64 = -32700;
const NO_REQUEST: i64 = -32600;
const NO_METHOD: i64 = -32601;
const NO_PARAMETERS: i64 = -32602;

pub(crate) fn serve(options: &ServeOptions) -> Result<bool> {
    let folders = Folders::new(&options.folder)?;
    // Names are those of the library alone: the working folder was not given.
    library::forget_folders();
    terminal::silence();
    let tools = Tools { folders, run: options.run.clone() };
    let mut input = io::stdin().lock();
    let mut line = Vec::new();
    loop {
        line.clear();
        if input.by_ref().take(LONGEST + 1).read_until(b'\n', &mut line)? == 0 {
            return Ok(true);
        }
        let answer = if line.len() as u64 > LONGEST {
            // The rest of it.
            while line.last() != Some(&b'\n') {
                line.clear();
                if input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
                    break;
                }
            }
            let message = format!("a message of more than {LONGEST} bytes");
            Some(refusal(&Value::Null, NO_REQUEST, &message))
        } else if line.trim_ascii().is_empty() {
            None
        } else {
            answer(&tools, &line)
        };
        if let Some(answer) = answer {
            terminal::print(format!("{answer}\n").as_bytes())?;
        }
    }
}

/// The answer to a line; none to a notification.
fn answer(tools: &Tools, line: &[u8]) -> Option<Value> {
    let message: Value = match serde_json::from_slice(line) {
        Ok(message) => message,
        Err(error) => return Some(refusal(&Value::Null, NO_JSON, &format!("no JSON: {error}"))),
    };
    let id = message.get("id").cloned().unwrap_or(Value::Null);
    let refuse = |code, message: &str| Some(refusal(&id, code, message));
    if !(id.is_null() || id.is_string() || id.is_number()) {
        return Some(refusal(&Value::Null, NO_REQUEST, "an id is a text or a number"));
    }
    let is_version = message.get("jsonrpc").and_then(Value::as_str) == Some("2.0");
    let (true, Some(method)) = (is_version, message.get("method").and_then(Value::as_str)) else {
        let what = "a request is an object with jsonrpc = \"2.0\", id, method and params";
        return refuse(NO_REQUEST, what);
    };
    if id.is_null() {
        return None;
    }
    let parameters = message.get("params").cloned().unwrap_or_else(|| json!({}));
    let result = match method {
        "initialize" => initialize(&parameters),
        "ping" => json!({}),
        "tools/list" => json!({ "tools": tools.list() }),
        "tools/call" => match tools.call(&parameters) {
            Outcome::Done(found) => json!({
                "content": [{ "type": "text", "text": found.to_string() }],
                "structuredContent": found,
                "isError": false,
            }),
            Outcome::Failed(message) => json!({
                "content": [{ "type": "text", "text": message }],
                "isError": true,
            }),
            Outcome::Refused(message) => return refuse(NO_PARAMETERS, &message),
        },
        other => return refuse(NO_METHOD, &format!("no method '{other}'")),
    };
    Some(json!({ "jsonrpc": "2.0", "id": id, "result": result }))
}

fn initialize(parameters: &Value) -> Value {
    let asked = parameters.get("protocolVersion").and_then(Value::as_str);
    let version = asked.filter(|asked| VERSIONS.contains(asked)).unwrap_or(VERSIONS[0]);
    json!({
        "protocolVersion": version,
        "capabilities": { "tools": {} },
        "serverInfo": { "name": "mmsmith", "version": env!("CARGO_PKG_VERSION") },
        "instructions": INSTRUCTIONS,
    })
}

fn refusal(id: &Value, code: i64, message: &str) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": message } })
}
