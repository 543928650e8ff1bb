//! `mms completions`, `mms man` and `mms reference`: the command line for shells, for readers of manuals and for the book.

use std::fs;

use anyhow::{Context, Result};
use clap::builder::PossibleValuesParser;
use clap::{Arg, Command};
use mmsmith_solutions::CATALOGUE;

use super::{python, schemas};
use crate::arguments::{CompletionsOptions, ManOptions, ReferenceOptions, examples, line};
use crate::json::{Output, make_folder};
use crate::terminal;

/// Says the script that lets a shell complete commands.
pub(crate) fn completions(options: &CompletionsOptions) -> Result<bool> {
    let mut script = Vec::new();
    let mut line = line().mut_subcommands(|command| command.mut_args(with_names));
    clap_complete::generate(options.shell, &mut line, "mms", &mut script);
    terminal::print(&script)?;
    Ok(true)
}

/// An argument that names solutions, with the names of those built in.
fn with_names(argument: Arg) -> Arg {
    let names = argument.get_value_names().unwrap_or_default();
    match names.iter().any(|name| *name == "NAME|SPEC.toml") {
        true => argument
            .value_parser(PossibleValuesParser::new(CATALOGUE.iter().map(|known| known.name))),
        false => argument,
    }
}

/// Writes the pages of the manual, one for each command.
pub(crate) fn man(options: &ManOptions) -> Result<bool> {
    let shown = options.folder.display();
    fs::create_dir_all(&options.folder).with_context(|| format!("cannot create {shown}"))?;
    let mut whole = line();
    whole.build();
    let commands = whole.get_subcommands().filter(|command| is_told(command)).cloned();
    let pages: Vec<Command> = commands.collect();
    for command in std::iter::once(whole).chain(pages) {
        // A page is called after the whole line, as in mms-run.
        let name = command.get_bin_name().unwrap_or("mms").replace(' ', "-");
        let mut text = Vec::new();
        clap_mangen::Man::new(command.display_name(name.clone()))
            .title(name.clone())
            .render(&mut text)
            .context("cannot form the page")?;
        Output::prepare(&options.folder.join(format!("{name}.1")))?.write_bytes(&text)?;
    }
    terminal::say(&format!("pages of the manual: {shown}\n"))?;
    Ok(true)
}

/// Says the whole command line as Markdown or as functions of the Python package, or writes the schemas of its JSON.
pub(crate) fn reference(options: &ReferenceOptions) -> Result<bool> {
    let mut whole = line();
    whole.build();
    if let Some(folder) = &options.schemas {
        make_folder(folder)?;
        for (name, schema) in schemas::all()? {
            let file = Output::prepare(&folder.join(format!("{name}.json")))?;
            file.write_text(&(schemas::lines(&schema, 0) + "\n"))?;
        }
        return Ok(true);
    }
    if options.python {
        terminal::print(python::module(&whole).as_bytes())?;
        return Ok(true);
    }
    let mut text = String::from("# Commands\n\n");
    text += &described(&whole);
    for command in whole.get_subcommands().filter(|command| is_told(command)) {
        text += &format!("\n## mms {}\n\n", command.get_name());
        text += &described(command);
    }
    terminal::print(text.as_bytes())?;
    Ok(true)
}

/// Whether a command is for users; clap's own `help` repeats the others.
fn is_told(command: &Command) -> bool {
    !command.is_hide_set() && command.get_name() != "help"
}

/// A command with its usage and its options.
fn described(command: &Command) -> String {
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage: ");
    let mut text = format!("{about}.\n\n```text\n{usage}\n```\n");
    let is_own = |argument: &&Arg| {
        !argument.is_hide_set() && (command.get_name() == "mms" || !argument.is_global_set())
    };
    let own: Vec<&Arg> = command.get_arguments().filter(is_own).collect();
    if !own.is_empty() {
        text.push('\n');
    }
    for argument in own {
        text += &item(argument);
    }
    let examples = examples(command.get_name());
    if !examples.is_empty() {
        text += "\nExamples:\n\n";
    }
    for (line, purpose) in examples {
        text += &format!("- `{line}`: {purpose}\n");
    }
    if let Some(more) = command.get_after_long_help() {
        text += &format!("\n{more}\n");
    }
    text
}

/// An argument as an item of a list.
fn item(argument: &Arg) -> String {
    let takes_value = argument.get_action().takes_values();
    let names = argument.get_value_names().unwrap_or_default();
    let values: String = match names {
        _ if !takes_value => String::new(),
        [] => format!("<{}>", argument.get_id().as_str().to_uppercase()),
        names => names.iter().map(|name| format!("<{name}>")).collect::<Vec<_>>().join(" "),
    };
    let mut said = match (argument.get_short(), argument.get_long()) {
        (Some(short), Some(long)) => format!("-{short}, --{long}"),
        (None, Some(long)) => format!("--{long}"),
        (Some(short), None) => format!("-{short}"),
        (None, None) => String::new(),
    };
    if !said.is_empty() && !values.is_empty() {
        said.push(' ');
    }
    said += &values;
    let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
    let mut text = format!("- `{said}`: {help}");
    let defaults = argument.get_default_values();
    if takes_value && !defaults.is_empty() {
        let defaults: Vec<_> = defaults.iter().map(|value| value.to_string_lossy()).collect();
        text += &format!(" (default: `{}`)", defaults.join(","));
    }
    text.push('\n');
    if takes_value {
        for value in argument.get_possible_values().iter().filter(|value| !value.is_hide_set()) {
            let help = value.get_help().map(|help| format!(": {help}")).unwrap_or_default();
            text += &format!("  - `{}`{help}\n", value.get_name());
        }
    }
    text
}
