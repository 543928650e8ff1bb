//! The module of the Python package that has a function for each command that measures, written from the command line itself, so that
//! names, types, defaults and descriptions are those of the options.

use std::any::TypeId;
use std::path::PathBuf;

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Command};
use mmsmith_verify as verify;

/// A function of the package.
struct Function {
    /// The command, and the name of the function.
    name: &'static str,
    /// The class of its results in `mmsmith._results`.
    result: &'static str,
    /// The parameters that are no keywords, and the words of the command line that they give.
    positional: &'static str,
    words: &'static str,
}

const FUNCTIONS: [Function; 7] = [
    Function {
        name: "check",
        result: "Check",
        positional: "*solutions: Named",
        words: "solutions",
    },
    Function { name: "explain", result: "Result", positional: ONE, words: "(solution,)" },
    Function { name: "run", result: "Run", positional: ONE, words: "(solution,)" },
    Function { name: "converge", result: "Convergence", positional: ONE, words: "(solution,)" },
    Function { name: "stability", result: "Stability", positional: ONE, words: "(solution,)" },
    Function { name: "tradeoff", result: "Tradeoff", positional: ONE, words: "(solution,)" },
    Function {
        name: "score",
        result: "Score",
        positional: "solution: Named, /, *files: str | os.PathLike[str]",
        words: "(solution, *files)",
    },
];

const ONE: &str = "solution: Named, /, *";

const HEAD: &str = "\
\"\"\"The commands of `mms` as functions: a keyword is an option.

Written by `mms reference --python`. Do not edit.
\"\"\"

import os
from collections.abc import Iterable, Mapping
from typing import Literal

from mmsmith._invoke import Named, Progress, invoke, named
from mmsmith._results import Check, Convergence, Result, Run, Score, Stability, Tradeoff
";

const PROGRESS: &str = "\
progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True \
where standard error is a terminal.";

/// So wide is a line of the package.
const WIDTH: usize = 140;

/// The text of the module, from the whole command line.
pub(super) fn module(whole: &Command) -> String {
    let mut text = HEAD.to_owned();
    text += &set_of(whole, "#: The commands that write JSON.\nWITH_JSON", "json");
    text += &set_of(whole, "#: The commands that take values of parameters.\nWITH_SET", "set");
    for function in &FUNCTIONS {
        if let Some(command) = whole.find_subcommand(function.name) {
            text += &function.source(command);
        }
    }
    text
}

/// The commands that have an option.
fn set_of(whole: &Command, name: &str, option: &str) -> String {
    let has = |command: &&Command| has_option(command, option);
    let quoted = |command: &Command| format!("\"{}\"", command.get_name());
    let names: Vec<String> = whole.get_subcommands().filter(has).map(quoted).collect();
    format!("\n{name} = frozenset({{{}}})\n", names.join(", "))
}

fn has_option(command: &Command, option: &str) -> bool {
    command.get_arguments().any(|argument| argument.get_long() == Some(option))
}

impl Function {
    fn source(&self, command: &Command) -> String {
        let keywords: Vec<&Arg> = command
            .get_arguments()
            .filter(|argument| {
                argument.get_long().is_some()
                    && !argument.is_global_set()
                    && !argument.is_hide_set()
            })
            .filter(|argument| !["help", "version"].contains(&argument.get_id().as_str()))
            .collect();
        let mut text = format!("\n\n@named\ndef {}(\n", self.name);
        for part in self.positional.split(", ") {
            text += &format!("    {part},\n");
        }
        for argument in &keywords {
            text += &format!("    {}: {},\n", keyword(argument), declared(argument));
        }
        text += &format!("    progress: Progress = None,\n) -> {}:\n", self.result);
        text += &self.documented(command, &keywords);
        text + &format!(
            "    return invoke({}, \"{}\", {}, locals())\n",
            self.result, self.name, self.words
        )
    }

    fn documented(&self, command: &Command, keywords: &[&Arg]) -> String {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let mut text = wrapped(&format!("\"\"\"{}.", in_python(&about)), 4);
        text += "\n    Args:\n";
        for part in self.positional.split(", ") {
            text += match part {
                "solution: Named" => {
                    "        solution: What `load` gave, a name, or the path of a specification.\n"
                }
                "*solutions: Named" => {
                    "        solutions: What `load` gave, names, or paths of specifications.\n"
                }
                "*files: str | os.PathLike[str]" => {
                    "        files: The recordings, one for each resolution: lists, folders, or files.\n"
                }
                _ => "",
            };
        }
        for argument in keywords {
            text += &wrapped(&format!("{}: {}", keyword(argument), described(argument)), 8);
            for value in values(argument) {
                let help =
                    value.get_help().map(|help| format!(": {}", in_python(&help.to_string())));
                text +=
                    &wrapped(&format!("`{}`{}.", value.get_name(), help.unwrap_or_default()), 12);
            }
        }
        text += &wrapped(PROGRESS, 8);
        text + "    \"\"\"\n"
    }
}

/// The values that an option chooses from.
fn values(argument: &Arg) -> Vec<PossibleValue> {
    let chooses = argument.get_action().takes_values();
    let values = if chooses { argument.get_possible_values() } else { Vec::new() };
    values.into_iter().filter(|value| !value.is_hide_set()).collect()
}

/// An option as a keyword.
fn keyword(argument: &Arg) -> String {
    argument.get_long().unwrap_or_default().replace('-', "_")
}

/// The type of a keyword and its default: nothing, which leaves the option out.
fn declared(argument: &Arg) -> String {
    if !argument.get_action().takes_values() {
        return "bool = False".to_owned();
    }
    let one = kind(argument);
    let repeats = argument.get_value_delimiter().is_some()
        || matches!(argument.get_action(), ArgAction::Append);
    let all = if repeats && !one.starts_with("Mapping") {
        format!("{one} | Iterable[{one}]")
    } else {
        one
    };
    if argument.is_required_set() { all } else { format!("{all} | None = None") }
}

/// The type of one value.
fn kind(argument: &Arg) -> String {
    let values = values(argument);
    if !values.is_empty() {
        // Whole numbers are written as such.
        let literal = |value: &PossibleValue| match value.get_name().parse::<u32>() {
            Ok(number) => number.to_string(),
            Err(_) => format!("\"{}\"", value.get_name()),
        };
        return format!("Literal[{}]", values.iter().map(literal).collect::<Vec<_>>().join(", "));
    }
    let is_called =
        |name: &str| argument.get_value_names().unwrap_or_default().iter().any(|own| *own == name);
    let id = argument.get_value_parser().type_id();
    let is = |known: TypeId| id == known;
    // An axis is told by its letter.
    let text = if is_called("AXES") {
        "str"
    } else if is(TypeId::of::<usize>()) || is(TypeId::of::<u64>()) {
        "int"
    } else if is(TypeId::of::<f64>()) {
        // A time may have a unit.
        if is_called("TIME") { "float | str" } else { "float" }
    } else if is(TypeId::of::<PathBuf>()) {
        "str | os.PathLike[str]"
    } else if is(TypeId::of::<(String, f64)>()) {
        "Mapping[str, float]"
    } else if is(TypeId::of::<(verify::Role, String)>()) {
        "Mapping[str, str]"
    } else if is(TypeId::of::<(String, Vec<String>)>()) {
        "Mapping[str, Iterable[float | str]]"
    } else if is_called("ORDERS") {
        "float | str | Mapping[str, float]"
    } else {
        "str"
    };
    text.to_owned()
}

/// Meaning of an option, with its default.
fn described(argument: &Arg) -> String {
    // A dict is no option that is repeated, and there is no standard output.
    let help = match argument.get_long() {
        Some("json") => "Keep the JSON of the result in this file".to_owned(),
        _ => argument.get_help().map(ToString::to_string).unwrap_or_default(),
    };
    let mut text = format!("{}.", in_python(&help.replace("; repeatable", "")));
    let defaults = argument.get_default_values();
    if argument.get_action().takes_values() && !defaults.is_empty() {
        let defaults: Vec<_> = defaults.iter().map(|value| value.to_string_lossy()).collect();
        text += &format!(" Default: {}.", defaults.join(", "));
    }
    text
}

/// A description with keywords in place of options.
fn in_python(text: &str) -> String {
    let mut parts = text.trim_end_matches('.').split("--");
    let mut said = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(part.len());
        let (option, rest) = part.split_at(end);
        said += &format!("{}{rest}", option.replace('-', "_"));
    }
    said.replace('\\', "/").replace("\"\"\"", "''")
}

/// A paragraph in lines that begin `indent` columns in, and all but the first of them four more.
fn wrapped(text: &str, indent: usize) -> String {
    let mut lines = String::new();
    let mut line = " ".repeat(indent);
    let mut is_empty = true;
    let further = if text.starts_with("\"\"\"") { indent } else { indent + 4 };
    for word in text.split_whitespace() {
        if !is_empty && line.len() + 1 + word.len() > WIDTH {
            lines += &format!("{line}\n");
            line = " ".repeat(further);
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line += word;
        is_empty = false;
    }
    format!("{lines}{line}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_spoken_of_as_keywords() {
        assert_eq!(
            in_python("Cell counts; one of them with --cfls."),
            "Cell counts; one of them with cfls"
        );
        assert_eq!(in_python("at most --cfl-speed, --a and -- b"), "at most cfl_speed, a and  b");
    }

    #[test]
    fn the_package_has_the_options_of_the_command_line() {
        let written = include_str!("../../../../python/mmsmith/_commands.py");
        let mut whole = crate::arguments::line();
        whole.build();
        let is_current = written == module(&whole);
        assert!(is_current, "write it anew: mms reference --python > python/mmsmith/_commands.py");
    }

    #[test]
    fn every_function_is_a_command_with_json() {
        let whole = crate::arguments::line();
        for function in FUNCTIONS {
            let command = whole.find_subcommand(function.name);
            assert!(
                command.is_some_and(|command| has_option(command, "json")),
                "{}",
                function.name
            );
        }
    }
}
