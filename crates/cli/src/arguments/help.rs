//! Help: the commands in groups, and examples of each.

use clap::Command;
use clap::builder::StyledStr;

use crate::terminal;

/// The commands in the order of the work, in groups.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Choose and check a solution", &["list", "explain", "coverage", "check", "certify"]),
    ("Use its fields in your code", &["gen", "eval"]),
    ("Verify your solver", &["score", "diagnose"]),
    (
        "Simulate with the material point solver",
        &["run", "resume", "converge", "stability", "tradeoff", "reproduce"],
    ),
    ("Other", &["batch", "doctor", "serve", "completions", "man", "help"]),
];

/// A command line, and the purpose it serves.
type Example = (&'static str, &'static str);

/// Examples of each command.
const EXAMPLES: [(&str, &[Example]); 20] = [
    (
        "list",
        &[
            ("mms list", "a line for each solution"),
            ("mms list --long", "with parameters and sources"),
        ],
    ),
    ("explain", &[("mms explain ring", "formulas, tested terms, cost of a run")]),
    (
        "coverage",
        &[("mms coverage", "the whole library"), ("mms coverage ring skew-2d", "two solutions")],
    ),
    (
        "check",
        &[
            ("mms check ring", "one solution"),
            (
                "mms check my-shear.toml --set A=0.05",
                "a specification file, with another amplitude",
            ),
            ("mms check ring --thorough --seconds 30", "search for rounding errors"),
        ],
    ),
    (
        "certify",
        &[
            ("mms certify bar --out bar.json", "prove, and keep the certificate"),
            ("mms certify bar --check bar.json", "check the certificate"),
        ],
    ),
    (
        "gen",
        &[
            ("mms gen ring --target c --out include", "a header for C and C++"),
            (
                "mms gen ring --target numpy --out . --fault body-force-sign",
                "with a planted mistake",
            ),
        ],
    ),
    (
        "eval",
        &[
            ("mms eval ring --points points.csv --csv fields.csv", "columns X, Y and t"),
            ("mms eval ring --points points.json --npy arrays", "NumPy arrays"),
        ],
    ),
    (
        "run",
        &[
            ("mms run axis-aligned --cells 32", "errors of one run"),
            (
                "mms run ring --vtk frames --picture ring.svg",
                "with files for ParaView and a picture",
            ),
            ("mms run axis-aligned --shape cpdi --integrator usl", "another scheme"),
        ],
    ),
    ("resume", &[("mms resume kept", "continue mms run ... --checkpoint kept")]),
    (
        "converge",
        &[
            ("mms converge axis-aligned --cells 16,32,64", "orders in space"),
            ("mms converge axis-aligned --cells 32 --cfls 0.1,0.2,0.4", "orders in time"),
            (
                "mms converge ring --cells 16,32,64 --expect u=2 --plot ring.svg",
                "exit status 1 below order 2",
            ),
        ],
    ),
    (
        "stability",
        &[
            ("mms stability axis-aligned --over integrator=cd,usl", "the limit of two integrators"),
            ("mms stability axis-aligned --at 0.8", "one run"),
        ],
    ),
    (
        "tradeoff",
        &[
            ("mms tradeoff axis-aligned --budget 30s", "all schemes that fit"),
            ("mms tradeoff axis-aligned --tolerance 1e-4", "the cheapest setting for this error"),
        ],
    ),
    (
        "batch",
        &[(
            "mms batch slurm --shards 8 -- converge ring --cells 64,128 --out study",
            "a study in 8 shards",
        )],
    ),
    (
        "diagnose",
        &[
            (
                "mms diagnose bar --target c --run ./run.sh",
                "run.sh compiles with the header in $MMS_FIELDS, and writes a file into $MMS_OUT",
            ),
            ("mms diagnose --list", "the mistakes that are looked for"),
        ],
    ),
    (
        "score",
        &[
            ("mms score ring run-16 run-32 run-64 --cells 16,32,64", "three folders of frames"),
            ("mms score axis-aligned-1d bar.csv --velocity-lag 5e-5", "staggered velocities"),
            ("mms score ring run-16 --map displacement=disp_total", "an array by its name"),
        ],
    ),
    ("reproduce", &[("mms reproduce --out study", "everything, in minutes")]),
    (
        "doctor",
        &[
            ("mms doctor", "five seconds after an installation"),
            ("mms doctor --folder /scratch/study", "a folder for studies on several machines"),
        ],
    ),
    (
        "serve",
        &[
            ("mms serve --mcp --folder .", "as a client starts it; files of the working folder"),
            ("mms serve --mcp --folder . --run ./run.sh", "with the tool diagnose"),
        ],
    ),
    ("completions", &[("mms completions bash", "for ~/.bash_completion")]),
    ("man", &[("mms man man1", "mms.1, mms-run.1, ...")]),
];

/// Examples of a command.
pub(crate) fn examples(name: &str) -> &'static [Example] {
    EXAMPLES.iter().find(|(known, _)| *known == name).map_or(&[], |(_, examples)| examples)
}

/// A command with its examples below its help.
pub(super) fn with_examples(command: Command) -> Command {
    let lines: Vec<String> = examples(command.get_name())
        .iter()
        .map(|(line, purpose)| format!("  {line}\n      {purpose}"))
        .collect();
    match lines.is_empty() {
        true => command,
        false => command.after_help(format!("Examples:\n{}", lines.join("\n"))),
    }
}

/// The whole line with its commands in groups.
pub(super) fn with_groups(line: Command) -> Command {
    let style = line.get_styles().get_header();
    let (bold, usual) = (style.render(), style.render_reset());
    let mut text = String::new();
    for (title, names) in GROUPS {
        text += &format!("{bold}{title}:{usual}\n");
        for name in names {
            let about = match (line.find_subcommand(name), *name) {
                (Some(command), _) => command.get_about().map(ToString::to_string),
                (None, "help") => Some("Show the help of a command".into()),
                (None, _) => None,
            };
            text += &about.map(|about| entry(name, &about)).unwrap_or_default();
        }
        text.push('\n');
    }
    text += &format!("{bold}Options:{usual}");
    line.before_help(StyledStr::from(text)).help_template(
        "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}{options}\n\nmms COMMAND --help shows the options and \
         examples of a command.{after-help}",
    )
}

/// A command and its purpose, in lines that fit the terminal.
fn entry(name: &str, about: &str) -> String {
    const NAMES: usize = 13;
    let lines = terminal::wrapped(about, terminal::columns_of_help().saturating_sub(2 + NAMES));
    let mut text = String::new();
    for (index, line) in lines.iter().enumerate() {
        let name = if index == 0 { name } else { "" };
        text += &format!("  {name:NAMES$}{line}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::line;

    #[test]
    fn every_command_has_a_group_and_examples_that_are_understood() {
        let whole = line();
        let told = whole.get_subcommands().filter(|command| !command.is_hide_set());
        for name in told.map(Command::get_name) {
            let groups = GROUPS.iter().filter(|(_, names)| names.contains(&name)).count();
            assert_eq!(groups, 1, "{name}");
            assert!(!examples(name).is_empty(), "{name} has no example");
            for (example, _) in examples(name) {
                let words: Vec<&str> = example.split_whitespace().collect();
                assert_eq!(words[..2], ["mms", name]);
                let read = line().try_get_matches_from(words);
                assert!(read.is_ok(), "{example}: {}", read.unwrap_err());
            }
        }
    }
}
