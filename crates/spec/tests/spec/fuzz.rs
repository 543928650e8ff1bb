//! Specifications that are nearly right, and text that is not one at all: a specification or a message with its
//! place, and never a panic, on the stack that threads get by default. Work is limited by counts, not by clocks.

#![allow(clippy::unwrap_used)]

use mmsmith_spec::{Diagnostic, Spec};
use proptest::prelude::*;
use std::path::Path;

/// The most that the graph of one specification may have done, by [`mmsmith_expr::Graph::work`]: text is refused beyond
/// half of it, and the last expression before that comes on top.
const MOST_WORK: usize = 8 << 20;

/// Reads `text` on a small stack, derives where `derive` says so, and checks the message where there is one.
fn read(text: String, derive: bool) -> Result<(), Diagnostic> {
    let run = move || {
        let shown: String = text.chars().take(100).collect();
        let modest = |work: usize| assert!(work < MOST_WORK, "{shown}... took {work} steps");
        let result = Spec::parse(&text, "fuzzed.toml");
        if let Ok(spec) = &result {
            modest(spec.graph.work());
            if derive && let Ok(fields) = spec.derive() {
                modest(fields.graph.work());
            }
        }
        result.map(|_| ()).inspect_err(|diagnostic| {
            let span = diagnostic.span.clone();
            assert!(
                text.get(span.clone()).is_some(),
                "{span:?} is no place: {}",
                diagnostic.message
            );
            // The message must also be possible to show.
            let (line, column) = diagnostic.line_and_column();
            assert!(line >= 1 && column >= 1);
            assert!(diagnostic.to_string().contains("fuzzed.toml"), "{diagnostic}");
        })
    };
    std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap()
}

/// The specifications of the library, and those that make use of more than it does.
fn library() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folders = ["mms-specs", "tests/data/specs"].map(|folder| root.join(folder));
    let mut files: Vec<_> = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    files.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect()
}

fn with_lets(lets: &str) -> String {
    format!(
        "name = 'a'\ntitle = 'A'\ncoordinates = 'cartesian'\ndimension = 1\n\
         [parameters]\nA = {{ default = 0.1 }}\n\
         [let]\n{lets}\n\
         [displacement]\nX = 'z*t'\n\
         [material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
         [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n\
         [time]\nperiod = 1\n"
    )
}

fn refused(text: String, message: &str) {
    let diagnostic = read(text, false).unwrap_err();
    assert!(diagnostic.message.contains(message), "{}", diagnostic.message);
}

#[test]
fn chains_of_definitions() {
    let chain = |step: &dyn Fn(usize) -> String, n: usize| {
        let mut lets: Vec<String> = (0..n).map(|i| format!("l{i} = '{}'", step(i + 1))).collect();
        lets.push(format!("l{n} = 'A*X'\nz = 'l0'"));
        with_lets(&lets.join("\n"))
    };
    read(chain(&|i| format!("l{i}"), 10_000), true).unwrap();
    read(chain(&|i| format!("l{i} + 1"), 10_000), true).unwrap();
    refused(chain(&|i| format!("sin(l{i})"), 10_000), "nested deeper");
    // Each definition doubles what the one before it would be if it were written out.
    for step in ["l# + l#", "l#*l#", "sin(l#)*cos(l#) + l#", "diff(l#*exp(l#), X)"] {
        let _ = read(chain(&|i| step.replace('#', &i.to_string()), 10_000), false);
    }
    refused(with_lets("z = 'y'\ny = 'z'"), "defined by itself");
    let mut circle: Vec<String> = (0..10_000).map(|i| format!("l{i} = 'l{}'", i + 1)).collect();
    circle.push("l10000 = 'l0'\nz = 'l0'".into());
    refused(with_lets(&circle.join("\n")), "defined by itself");
}

#[test]
fn sizes() {
    refused(String::new(), "missing field");
    refused("\0".into(), "");
    refused("[".repeat(100_000), "");
    refused("a = ".to_owned() + &"[".repeat(100_000), "");
    refused("a = ".to_owned() + &"{a=".repeat(100_000), "");
    refused("a.".repeat(100_000) + "a = 1", "");
    refused(with_lets(&format!("z = '{}'", "(".repeat(900_000))), "nested deeper");
    refused(with_lets(&format!("z = '{}'", "X+".repeat(1_000_000))), "bytes");
    refused(with_lets(&format!("z = '{}'", "9".repeat(900_000))), "limit");
    refused(with_lets("z = 'X^1000000000'"), "exponent");
    refused(with_lets(&format!("{} = 'X'", "z".repeat(900_000))), "");
    read(with_lets(&format!("z = '{}X'", "A*X+".repeat(100_000))), true).unwrap();
    read(with_lets(&format!("# {}\nz = 'X'", "#".repeat(1_000_000))), true).unwrap();
    let text = with_lets("z = 'X'").replace("default = 0.1", "default = 1e999");
    refused(text, "");
    for dimension in ["0", "4", "-1", "99999999999999999999", "1.5", "nan"] {
        let text =
            with_lets("z = 'X'").replace("dimension = 1", &format!("dimension = {dimension}"));
        read(text, false).unwrap_err();
    }
}

#[test]
fn depths() {
    let million = 1_000_000;
    refused(with_lets(&format!("z = '{}X'", "(".repeat(million))), "nested deeper");
    refused(with_lets(&format!("z = '{}'", ")".repeat(million))), "value is expected");
    refused(with_lets("z = 'X^(-1000000000)'"), "exponent");
    refused(with_lets("z = 'X^(10^9)'"), "exponent");
    refused(with_lets("z = '(X + 1)**1e9'"), "exponent");
    // Written out, and through definitions.
    for (inner, depth) in [("X", 50), ("X^60", 50), ("exp(X*t)", 50), ("X*exp(sin(X))", 50)] {
        let nested = "diff(".repeat(depth) + inner + &", X)".repeat(depth);
        let _ = read(with_lets(&format!("z = '{nested}'")), false);
        let chain: Vec<String> =
            (0..depth).map(|i| format!("l{i} = 'diff(l{}, X)'", i + 1)).collect();
        let chain = format!("{}\nl{depth} = '{inner}'\nz = 'l0'", chain.join("\n"));
        let _ = read(with_lets(&chain), false);
    }
    let polynomial = "diff(".repeat(50) + "X^52" + &", X)".repeat(50);
    read(with_lets(&format!("z = 'A*{polynomial}/10^60'")), true).unwrap();
}

/// Where a message is about an expression that stands in text with escapes, of any kind of string.
#[test]
fn places_in_strings() {
    for (open, close) in
        [("'", "'"), ("\"", "\""), ("'''", "'''"), ("\"\"\"\n", "\"\"\""), ("'''\n", "'''")]
    {
        for inner in ["X + ", "X + ü", "2π", "ü", "", "'", "\\u00fc + X", "X +\\\n Y", "''", "\t$"]
        {
            let _ = read(with_lets(&format!("z = {open}{inner}{close}")), false);
        }
    }
}

#[derive(Clone, Debug)]
enum Change {
    DeleteLine,
    DoubleLine,
    SwapLines(usize),
    DeleteCharacter,
    DoubleCharacter,
    Replace(char),
    Insert(String),
    Truncate,
}

fn change() -> impl Strategy<Value = Change> {
    let pieces = [
        "\0",
        "'",
        "\"",
        "(",
        ")",
        "^",
        "[",
        "]",
        "[[boundary]]\n",
        "= ",
        "\n",
        "1e308",
        "-1",
        "0",
        "nan",
        "inf",
        "diff(",
        ", X",
        "\u{202e}",
        "\u{3c0}",
        "sin(",
        "\\",
        "#",
        "/0",
        "99999999999",
        "{",
        "}",
        "<=",
    ];
    prop_oneof![
        Just(Change::DeleteLine),
        Just(Change::DoubleLine),
        any::<usize>().prop_map(Change::SwapLines),
        Just(Change::DeleteCharacter),
        Just(Change::DoubleCharacter),
        any::<char>().prop_map(Change::Replace),
        prop::sample::select(pieces.to_vec()).prop_map(|piece| Change::Insert(piece.to_owned())),
        Just(Change::Truncate),
    ]
}

fn changed(text: &str, place: usize, change: &Change) -> String {
    let mut lines: Vec<&str> = text.split('\n').collect();
    let line = place % lines.len();
    let mut characters: Vec<char> = text.chars().collect();
    let at = place % characters.len().max(1);
    match change {
        Change::DeleteLine => {
            lines.remove(line);
            return lines.join("\n");
        }
        Change::DoubleLine => {
            lines.insert(line, lines[line]);
            return lines.join("\n");
        }
        Change::SwapLines(other) => {
            let other = other % lines.len();
            lines.swap(line, other);
            return lines.join("\n");
        }
        _ if characters.is_empty() => {}
        Change::DeleteCharacter => drop(characters.remove(at)),
        Change::DoubleCharacter => characters.insert(at, characters[at]),
        Change::Replace(c) => characters[at] = *c,
        Change::Insert(piece) => drop(characters.splice(at..at, piece.chars()).collect::<Vec<_>>()),
        Change::Truncate => characters.truncate(at),
    }
    characters.into_iter().collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_text(text in any::<String>()) {
        let _ = read(text, true);
    }

    #[test]
    fn arbitrary_expressions(text in "[-+*/^(), XtA0-9.e\u{3c0}]{0,40}") {
        let _ = read(with_lets(&format!("z = '{text}'")), true);
    }

    #[test]
    fn changed_specifications(
        which in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<usize>(), change()), 1..4),
    ) {
        let library = library();
        let mut text = library[which.index(library.len())].clone();
        for (place, change) in changes {
            text = changed(&text, place, &change);
        }
        let _ = read(text, true);
    }
}
