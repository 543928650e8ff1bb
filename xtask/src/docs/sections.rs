//! Sections of a page that commands write, with the date, the commit and the machine.

use super::blocks::Workplace;
use super::markdown::{Page, Section};
use anyhow::{Context, bail};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// How the output of a section's commands is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// Each command and what it prints.
    Text,
    /// The output of the command, which is Markdown and the same at all times.
    Exact,
    /// Each command and the Markdown that it writes to `OUT.md`.
    Tables,
    /// A row for each study: cells, the error of each field on the finest grid, and its order there.
    Orders,
    /// A row for each study: the error of the displacement on each grid, orders, and speed.
    Displacement,
    /// A row for each run: particles, steps, time and particle-steps a second.
    Speed,
    /// A table for each command with two lists `{a,b}`: rows for the first list, columns for the second, and in each cell the
    /// nanoseconds that a step of a particle takes in that run, and how many times those of `gimp` with `flip` that is.
    Pairs,
    /// A column for each run of a square or a cube: what a billion particles of it would take on many cores.
    Billion,
    /// The time of a build into an empty folder, and a row for each crate that takes long.
    Build,
    /// The picture that the command writes to its last word, a path of the repository.
    Picture,
}

impl Form {
    fn of(section: &Section) -> Result<Self, String> {
        Ok(match section.form.as_str() {
            "" => Self::Text,
            "exact" => Self::Exact,
            "tables" => Self::Tables,
            "orders" => Self::Orders,
            "displacement" => Self::Displacement,
            "speed" => Self::Speed,
            "pairs" => Self::Pairs,
            "billion" => Self::Billion,
            "build" => Self::Build,
            "picture" => Self::Picture,
            other => {
                return Err(format!(
                    "the form '{other}' is not known; known are exact, tables, orders, displacement, speed, pairs, billion, build and picture"
                ));
            }
        })
    }

    fn columns(self) -> &'static [&'static str] {
        match self {
            Self::Orders => {
                &["u (m)", "order", "v (m/s)", "order", "F", "order", "P (Pa)", "order"]
            }
            Self::Displacement => &["L_inf of u (m)", "orders", "million particle-steps/s"],
            Self::Speed => &["particles", "steps", "stepping (s)", "million particle-steps/s"],
            Self::Text
            | Self::Exact
            | Self::Tables
            | Self::Pairs
            | Self::Billion
            | Self::Build
            | Self::Picture => &[],
        }
    }
}

/// The lines that a section must have in this order, whatever its commands measure.
fn skeleton(form: Form, section: &Section) -> Vec<String> {
    match form {
        Form::Billion => vec![section.commands.join("` | `")],
        Form::Text | Form::Tables | Form::Pairs | Form::Build => {
            section.commands.iter().map(|command| shown(command)).collect()
        }
        Form::Exact => Vec::new(),
        Form::Picture => section
            .commands
            .iter()
            .filter_map(|command| command.split_whitespace().last())
            .map(str::to_owned)
            .collect(),
        Form::Orders | Form::Displacement | Form::Speed => {
            let (common, labels) = labels(&section.commands);
            std::iter::once(format!(
                "Each row is the command `{common}` with the options in its first column."
            ))
            .chain(labels.into_iter().map(|label| format!("| `{label}` |")))
            .collect()
        }
    }
}

/// A command without the words that only name the file for its output.
fn shown(command: &str) -> String {
    let words: Vec<&str> = command.split_whitespace().collect();
    match words.iter().position(|word| *word == "OUT.md") {
        Some(at) if at > 0 => [&words[..at - 1], &words[at + 1..]].concat().join(" "),
        _ => words.join(" "),
    }
}

/// Words that commands share, and those that each has beside them.
fn labels(commands: &[String]) -> (String, Vec<String>) {
    let groups: Vec<Vec<String>> = commands.iter().map(|command| groups(command)).collect();
    // One command alone has all its words in common with itself.
    let is_verb = |group: &String| groups[0].iter().take(2).any(|word| word == group);
    let in_all = |group: &String| {
        groups.iter().all(|other| other.contains(group)) && (groups.len() > 1 || is_verb(group))
    };
    let common: Vec<String> =
        groups.first().into_iter().flatten().filter(|group| in_all(group)).cloned().collect();
    let rest = |of: &Vec<String>| {
        of.iter().filter(|group| !common.contains(group)).cloned().collect::<Vec<_>>().join(" ")
    };
    let labels = groups.iter().map(rest).collect();
    (common.join(" "), labels)
}

/// The words of a command, each option together with its value.
fn groups(command: &str) -> Vec<String> {
    let mut groups: Vec<String> = Vec::new();
    let mut takes_value = false;
    for word in command.split_whitespace() {
        match groups.last_mut() {
            Some(last) if takes_value && !word.starts_with("--") => {
                last.push(' ');
                last.push_str(word);
                takes_value = false;
            }
            _ => {
                takes_value = word.starts_with("--");
                groups.push(word.to_owned());
            }
        }
    }
    groups
}

/// The fault of a section as it stands, if any; sections that are the same at all times are written once more and compared.
pub(crate) fn fault(section: &Section, lines: &[&str], place: &Workplace) -> Result<(), String> {
    let form = Form::of(section)?;
    if section.commands.is_empty() {
        return Err("the section names no command".to_owned());
    }
    let body = &lines[section.body.clone()];
    if form == Form::Exact {
        let now = content(form, section, place).map_err(|error| format!("{error:#}"))?;
        let (now, stated): (Vec<&str>, Vec<&str>) =
            (solid(now.lines()), solid(body.iter().copied()));
        return match now.iter().zip(&stated).find(|(now, stated)| now != stated) {
            Some((now, stated)) => {
                Err(format!("'{stated}' should be '{now}'; write it with cargo xtask docs --write"))
            }
            None if now.len() != stated.len() => Err(
                "it is not as its command writes it now; write it with cargo xtask docs --write"
                    .to_owned(),
            ),
            None => Ok(()),
        };
    }
    let mut rest = body.iter();
    for wanted in skeleton(form, section) {
        if !rest.any(|line| line.contains(&wanted)) {
            return Err(format!(
                "it lacks '{wanted}', as if written by other commands; write it with cargo xtask docs --write"
            ));
        }
    }
    if form != Form::Picture && !body.iter().any(|line| is_stamp(line)) {
        return Err(
            "it states no date, commit and machine; write it with cargo xtask docs --write"
                .to_owned(),
        );
    }
    Ok(())
}

fn solid<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    lines.map(str::trim_end).filter(|line| !line.is_empty()).collect()
}

fn is_stamp(line: &str) -> bool {
    line.starts_with("*Written on 20")
        && line.contains(" from commit ")
        && line.contains("rustc")
        && line.ends_with("*")
}

/// A page with its sections written anew, and how many these are.
pub(crate) fn write(
    text: &str,
    place: &Workplace,
    repository: &Path,
) -> anyhow::Result<(String, usize)> {
    let page = Page::parse(text);
    let lines: Vec<&str> = text.lines().collect();
    let (mut written, mut at) = (String::new(), 0);
    for section in &page.sections {
        let form = Form::of(section).map_err(anyhow::Error::msg)?;
        let content = match form {
            Form::Picture => {
                for command in &section.commands {
                    succeed(place, &format!("cd \"$REPOSITORY\"\n{command}"))?;
                }
                lines[section.body.clone()].join("\n")
            }
            Form::Exact => content(form, section, place)?,
            _ => format!("{}\n\n{}", stamp(repository)?, content(form, section, place)?),
        };
        for line in &lines[at..section.body.start] {
            written.push_str(line);
            written.push('\n');
        }
        written.push_str(&format!("\n{}\n\n", content.trim()));
        at = section.body.end;
    }
    for line in &lines[at..] {
        written.push_str(line);
        written.push('\n');
    }
    Ok((written, page.sections.len()))
}

fn content(form: Form, section: &Section, place: &Workplace) -> anyhow::Result<String> {
    let mut parts = Vec::new();
    match form {
        Form::Text => {
            for command in &section.commands {
                parts.push(format!(
                    "```sh\n{command}\n```\n\n```text\n{}\n```\n",
                    succeed(place, command)?.trim_end()
                ));
            }
        }
        Form::Exact => {
            for command in &section.commands {
                parts.push(succeed(place, command)?);
            }
        }
        Form::Tables => {
            for command in &section.commands {
                succeed(place, command)?;
                parts.push(format!(
                    "```sh\n{}\n```\n\n{}",
                    shown(command),
                    without_headings(&place.read("OUT.md")?)
                ));
            }
        }
        Form::Orders | Form::Displacement | Form::Speed => {
            let (common, labels) = labels(&section.commands);
            parts.push(format!(
                "Each row is the command `{common}` with the options in its first column.\n"
            ));
            let columns = form.columns();
            parts.push(format!("| | {} |", columns.join(" | ")));
            parts.push(format!("|---|{}", "---:|".repeat(columns.len())));
            for (command, label) in section.commands.iter().zip(labels) {
                succeed(place, &format!("{command} --json OUT.json"))?;
                let document: Value = serde_json::from_str(&place.read("OUT.json")?)
                    .with_context(|| format!("the JSON of {command}"))?;
                let cells = match form {
                    Form::Orders => orders(&document),
                    Form::Displacement => displacement(&document),
                    _ => speed(&document),
                };
                let cells =
                    cells.with_context(|| format!("the JSON of '{command}' lacks a row"))?;
                parts.push(format!("| `{label}` | {} |", cells.join(" | ")));
            }
        }
        Form::Pairs => {
            for command in &section.commands {
                parts.push(pairs(command, place)?);
            }
        }
        Form::Billion => {
            let columns = section.commands.iter().map(|command| {
                succeed(place, &format!("{command} --json OUT.json"))?;
                let document: Value = serde_json::from_str(&place.read("OUT.json")?)
                    .with_context(|| format!("the JSON of {command}"))?;
                let division = |cells: f64| {
                    let name = command.split_whitespace().nth(2).unwrap_or_default();
                    succeed(place, &format!("mms explain {name} --cells {cells} --json OUT.json"))?;
                    let document: Value = serde_json::from_str(&place.read("OUT.json")?)?;
                    let last = document["runs"].as_array().and_then(|runs| runs.last());
                    Ok(last.map(|run| run["division"].clone()).unwrap_or_default())
                };
                billion(&document, &division)?
                    .with_context(|| format!("the JSON of '{command}' lacks a row"))
            });
            let columns = columns.collect::<anyhow::Result<Vec<_>>>()?;
            parts.push(format!("| | `{}` |", section.commands.join("` | `")));
            parts.push(format!("|---|{}", "---:|".repeat(columns.len())));
            for (row, what) in OF_A_BILLION.iter().enumerate() {
                let cells = columns.iter().map(|column| column[row].as_str());
                parts.push(format!("| {what} | {} |", cells.collect::<Vec<_>>().join(" | ")));
            }
            parts.push(String::new());
        }
        Form::Build => {
            for command in &section.commands {
                parts.push(build(command, place)?);
            }
        }
        Form::Picture => {}
    }
    Ok(parts.join("\n"))
}

/// Cargo's timings of a build, as a table.
fn build(command: &str, place: &Workplace) -> anyhow::Result<String> {
    /// Crates that take less are not told of, in seconds.
    const LEAST: f64 = 3.0;
    let script = format!(
        "own=$PWD; cd \"$REPOSITORY\" && CARGO_TARGET_DIR=$own/build command {command} --quiet --timings && times"
    );
    let printed = succeed(place, &script)?;
    // The last line has the user time of what the shell ran, as 3m51.29s.
    let user_time = printed
        .lines()
        .last()
        .and_then(|line| line.split_whitespace().next()?.strip_suffix('s')?.split_once('m'))
        .and_then(|(minutes, seconds)| {
            Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
        })
        .with_context(|| format!("'{command}' printed no times"))?;
    let report = place.read("build/cargo-timings/cargo-timing.html")?;
    succeed(place, "rm -r build")?;
    let units = report
        .lines()
        .skip_while(|line| !line.starts_with("const UNIT_DATA = "))
        .take_while(|line| !line.starts_with("];"));
    let units = units.collect::<Vec<_>>().join("\n").replacen("const UNIT_DATA = ", "", 1) + "]";
    let units: Vec<Value> = serde_json::from_str(&units).context("the timings of the build")?;
    let seconds = |unit: &Value| unit["duration"].as_f64().unwrap_or(0.0);
    let mut long: Vec<&Value> = units.iter().filter(|unit| seconds(unit) >= LEAST).collect();
    long.sort_by(|a, b| seconds(b).total_cmp(&seconds(a)));
    let rows = long.iter().map(|unit| {
        format!("| `{}` | {:.0} |", unit["name"].as_str().unwrap_or("-"), seconds(unit))
    });
    let rows = rows.collect::<Vec<_>>().join("\n");
    Ok(format!(
        "`{command}` into an empty folder: {} units, {user_time:.0} s of user time. Those of {LEAST} s and more:\n\n\
         | crate | s |\n|---|---:|\n{rows}\n",
        units.len()
    ))
}

/// A list `{a,b}` of a command: what is before it, its entries, and what is behind it.
fn list(command: &str) -> Option<(&str, Vec<&str>, &str)> {
    let (before, rest) = command.split_once('{')?;
    let (entries, behind) = rest.split_once('}')?;
    Some((before, entries.split(',').collect(), behind))
}

/// The table of a command with two lists.
fn pairs(command: &str, place: &Workplace) -> anyhow::Result<String> {
    let lists = list(command).and_then(|(before, rows, behind)| {
        let (between, columns, behind) = list(behind)?;
        Some((before, rows, between, columns, behind))
    });
    let (before, rows, between, columns, behind) =
        lists.with_context(|| format!("'{command}' has no two lists in braces"))?;
    let time = |row: &str, column: &str| -> anyhow::Result<f64> {
        let one = format!("{before}{row}{between}{column}{behind}");
        succeed(place, &format!("{one} --json OUT.json"))?;
        let document: Value = serde_json::from_str(&place.read("OUT.json")?)
            .with_context(|| format!("the JSON of {one}"))?;
        let rate = document["result"]["particle_steps_per_s"].as_f64();
        Ok(1e9 / rate.with_context(|| format!("the JSON of '{one}' lacks a rate"))?)
    };
    // A processor that was idle is slow at first.
    let unit = [(); 3]
        .into_iter()
        .map(|()| time("gimp", "flip"))
        .collect::<anyhow::Result<Vec<_>>>()?
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let mut lines = vec![
        format!("```sh\n{command}\n```\n"),
        format!("| ns | {} |", columns.join(" | ")),
        format!("|---|{}", "---:|".repeat(columns.len())),
    ];
    for row in rows {
        let cells = columns
            .iter()
            .map(|column| {
                let time = time(row, column)?;
                Ok(format!("{time:.0} ({:.2})", time / unit))
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
        lines.push(format!("| {row} | {} |", cells.join(" | ")));
    }
    Ok(lines.join("\n") + "\n")
}

/// Output of a command that does its work, whether or not what it measures passes.
fn succeed(place: &Workplace, command: &str) -> anyhow::Result<String> {
    let printed = place.run(command)?;
    // A missed order is a result, and ends with 1 after it was printed.
    if printed.status != Some(0) && (printed.status != Some(1) || printed.out.is_empty()) {
        bail!("'{command}' failed:\n{}{}", printed.out, printed.errors);
    }
    Ok(printed.out)
}

/// Headings would stand among those of the page.
fn without_headings(text: &str) -> String {
    let line = |line: &str| match line.trim_start_matches('#').strip_prefix(' ') {
        Some(heading) if line.starts_with('#') => format!("**{}**", heading.trim()),
        _ => line.to_owned(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

fn orders(document: &Value) -> Option<Vec<String>> {
    let last = document["rows"].as_array()?.last()?;
    let mut cells = Vec::new();
    for field in ["u", "v", "F", "P"] {
        cells.push(number(&last["errors"][field]["l2"], 1));
        let local = document["orders"][field]["l2"]["local"].as_array()?.last()?;
        cells.push(local.as_f64().map_or("-".to_owned(), |order| format!("{order:.2}")));
    }
    Some(cells)
}

fn displacement(document: &Value) -> Option<Vec<String>> {
    let rows = document["rows"].as_array()?;
    let errors: Vec<String> =
        rows.iter().map(|row| number(&row["errors"]["u"]["linf"], 1)).collect();
    let local = document["orders"]["u"]["linf"]["local"].as_array()?;
    let local: Vec<String> = local
        .iter()
        .map(|order| order.as_f64().map_or("-".to_owned(), |order| format!("{order:.2}")))
        .collect();
    Some(vec![errors.join(", "), local.join(", "), rate(rows.last()?)])
}

fn speed(document: &Value) -> Option<Vec<String>> {
    let row = document.get("result")?;
    let count = |name: &str| row[name].as_u64().map_or("-".to_owned(), |count| count.to_string());
    let seconds = row["wall_s"].as_f64().map_or("-".to_owned(), |seconds| format!("{seconds:.2}"));
    Some(vec![count("particles"), count("steps"), seconds, rate(row)])
}

/// The rows of a table of the form [`Form::Billion`].
const OF_A_BILLION: [&str; 10] = [
    "measured: million particle-steps/s of a core",
    "cells",
    "tiles",
    "cores of use",
    "million particles of a core",
    "a step's work (s)",
    "MB sent at a cut in a step",
    "the same at 10 GB/s (s)",
    "steps in a period",
    "hours for a period",
];

/// Cost of 10^9 particles of a square or a cube, from the rate of a smaller one on one core, in the order of [`OF_A_BILLION`]. Messages are those
/// of the solver, which a test of it counts; tiles and cores are counted by `division`, for a number of cells.
fn billion(
    document: &Value,
    division: &dyn Fn(f64) -> anyhow::Result<Value>,
) -> anyhow::Result<Option<Vec<String>>> {
    let Some((large, dimension)) = size_of_a_billion(document) else { return Ok(None) };
    Ok(of_a_billion(document, (large, dimension), &division(large)?))
}

const PARTICLES: f64 = 1e9;

/// Cells along an axis, and axes.
fn size_of_a_billion(document: &Value) -> Option<(f64, f64)> {
    let (settings, row) = (&document["settings"], &document["result"]);
    let (cells, per_cell) = (settings["cells"].as_f64()?, settings["ppc"].as_f64()?);
    let dimension = (row["particles"].as_f64()?.ln() / (cells * per_cell).ln()).round();
    Some(((PARTICLES.powf(1.0 / dimension) / per_cell).round(), dimension))
}

fn of_a_billion(
    document: &Value,
    (large, dimension): (f64, f64),
    division: &Value,
) -> Option<Vec<String>> {
    let (settings, row) = (&document["settings"], &document["result"]);
    let cells = settings["cells"].as_f64()?;
    let rate = row["particle_steps_per_s"].as_f64()?;
    let (tiles, cores) = (division["tiles"].as_f64()?, division["cores_of_use"].as_f64()?.floor());
    let work = PARTICLES / cores / rate;
    let sent = 2.0 * 8.0 * (large + 9.0).powf(dimension - 1.0) * (2.0 * dimension + 1.0) * 8.0;
    let steps = row["steps"].as_f64()? / settings["periods"].as_f64()? * large / cells;
    let hours = steps * (work + sent / 1e10) / 3600.0;
    Some(vec![
        format!("{:.1}", rate / 1e6),
        format!("{large:.0}^{dimension:.0}"),
        format!("{tiles:.0}"),
        format!("{cores:.0}"),
        format!("{:.3}", PARTICLES / cores / 1e6),
        format!("{work:.4}"),
        format!("{:.1}", sent / 1e6),
        format!("{:.4}", sent / 1e10),
        format!("{steps:.0}"),
        format!("{hours:.2}"),
    ])
}

fn rate(row: &Value) -> String {
    row["particle_steps_per_s"].as_f64().map_or("-".to_owned(), |rate| format!("{:.1}", rate / 1e6))
}

fn number(value: &Value, digits: usize) -> String {
    value.as_f64().map_or("-".to_owned(), |value| format!("{value:.digits$e}"))
}

/// When, from which commit and on which machine a section was written.
pub(crate) fn stamp(repository: &Path) -> anyhow::Result<String> {
    let said = |command: &mut Command| -> anyhow::Result<String> {
        let output = command
            .current_dir(repository)
            .output()
            .with_context(|| format!("cannot start {command:?}"))?;
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = said(Command::new("git").args(["rev-parse", "--short=10", "HEAD"]))?;
    let changes = said(Command::new("git").args([
        "status",
        "--porcelain",
        "--",
        "crates",
        "mms-specs",
        "Cargo.lock",
    ]))?;
    let changed = if changes.is_empty() { "" } else { " with changes" };
    let rustc = said(Command::new("rustc").arg("--version"))?;
    let rustc = rustc.split(" (").next().unwrap_or("rustc");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let processor = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let processor = processor.lines().find_map(|line| {
        line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name.trim())
    });
    let processor = processor.unwrap_or(std::env::consts::ARCH);
    Ok(format!(
        "*Written on {} from commit {commit}{changed}, on {cores} cores of {processor}, with {rustc}.*",
        today()
    ))
}

fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (year, month, day) = date(seconds / 86_400);
    format!("{year:04}-{month:02}-{day:02}")
}

/// Year, month and day of a number of days since the first of January 1970, in the Gregorian calendar.
fn date(days: u64) -> (u64, u64, u64) {
    // Years that begin in March have their leap day at the end.
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    (year_of_era + era * 400 + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section(text: &str) -> Section {
        Page::parse(text).sections.remove(0)
    }

    fn place(name: &str) -> Workplace {
        Workplace::new(Path::new("/bin/echo"), Path::new(env!("CARGO_MANIFEST_DIR")), name).unwrap()
    }

    #[test]
    fn days_are_counted_with_leap_years() {
        assert_eq!(date(0), (1970, 1, 1));
        assert_eq!(date(19_782), (2024, 2, 29));
        assert_eq!(date(20_148), (2025, 3, 1));
        assert_eq!(date(11_016), (2000, 2, 29));
    }

    #[test]
    fn what_all_commands_have_is_said_once() {
        let commands =
            ["mms converge a --cells 8,16 --cfl 0.2", "mms converge b --cfl 0.2 --cells 4"]
                .map(str::to_owned);
        let (common, labels) = labels(&commands);
        assert_eq!(common, "mms converge --cfl 0.2");
        assert_eq!(labels, ["a --cells 8,16", "b --cells 4"]);
        let (common, labels) = super::labels(&commands[..1]);
        assert_eq!(
            (common.as_str(), labels[0].as_str()),
            ("mms converge", "a --cells 8,16 --cfl 0.2")
        );
    }

    #[test]
    fn a_written_section_passes_until_its_commands_change() {
        let text = "# T\n<!-- begin: mms say this -->\n<!-- end -->\nrest\n";
        let place = place("written");
        let (written, count) = write(text, &place, Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        assert_eq!(count, 1);
        assert!(
            written.contains("```text\nsay this\n```") && written.ends_with("<!-- end -->\nrest\n"),
            "{written}"
        );
        let check = |text: &str| fault(&section(text), &text.lines().collect::<Vec<_>>(), &place);
        assert_eq!(check(&written), Ok(()));
        assert!(check(text).unwrap_err().contains("lacks 'mms say this'"));
        let other = written.replacen("mms say this", "mms say that", 1);
        assert!(check(&other).unwrap_err().contains("written by other commands"));
        let undated = written.replace("*Written", "Written");
        assert!(check(&undated).unwrap_err().contains("no date"));
        // Written once more it stays as it is.
        assert_eq!(
            write(&written, &place, Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap().0,
            written
        );
    }

    #[test]
    fn what_is_the_same_at_all_times_is_compared() {
        let place = place("exact");
        let text = "<!-- begin: exact\nmms a\n-->\n\na\n\n<!-- end -->\n";
        let check = |text: &str| fault(&section(text), &text.lines().collect::<Vec<_>>(), &place);
        assert_eq!(check(text), Ok(()));
        assert!(
            check(&text.replace("\n\na\n", "\n\nb\n")).unwrap_err().contains("'b' should be 'a'")
        );
    }

    #[test]
    fn lists_in_braces_are_found_one_after_the_other() {
        let (before, entries, behind) = list("a --b {c,d} --e {f} g").unwrap();
        assert_eq!((before, entries.as_slice()), ("a --b ", ["c", "d"].as_slice()));
        let (between, entries, behind) = list(behind).unwrap();
        assert_eq!((between, entries.as_slice(), behind), (" --e ", ["f"].as_slice(), " g"));
        assert_eq!(list(behind), None);
    }

    #[test]
    fn a_table_has_a_row_for_each_command() {
        let document: Value = serde_json::from_str(
            r#"{"rows": [{"errors": {"u": {"linf": 1e-2}}}, {"errors": {"u": {"linf": 2.5e-3}}, "particle_steps_per_s": 3.2e6}],
                "orders": {"u": {"linf": {"local": [2.0]}}}}"#,
        )
        .unwrap();
        assert_eq!(displacement(&document).unwrap(), ["1.0e-2, 2.5e-3", "2.00", "3.2"]);
        assert_eq!(orders(&document), None);
    }
}
