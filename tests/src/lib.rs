//! Helpers of the tests in this package: the commands as users run them, and their output as data.
//!
//! The tests themselves are in `tests/`, one file a subject: orders of accuracy, the claims of the
//! original study, generation, bad input, particle files.

use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The examples in Rust of the book, which documentation tests compile and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/guide/code.md")]
pub struct Examples;

/// The root of the workspace.
#[must_use]
pub fn workspace() -> &'static Path {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package)
}

/// The command `cargo`, in the workspace.
#[must_use]
pub fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(workspace());
    command
}

/// The folder with the binaries of the profile that the tests were built with.
///
/// `cargo test --workspace` builds them, since their packages have tests of their own that need them. They are built
/// here only where they are missing: a nested build would select other packages, and with them other features.
fn binaries() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        // Test programs are in TARGET/PROFILE/deps.
        let this = std::env::current_exe().expect("the path of the test program is known");
        let folder = this.ancestors().nth(2).expect("the program is in a folder of a folder");
        if !(folder.join("mms").is_file() && folder.join("xtask").is_file()) {
            let mut build = cargo();
            build.args(["build", "--quiet", "--workspace", "--bins"]);
            if !cfg!(debug_assertions) {
                build.arg("--release");
            }
            let status = build.status().expect("cargo can be started");
            assert!(status.success(), "the commands did not build");
        }
        folder.to_path_buf()
    })
}

/// The command `mms`, in the workspace.
///
/// The environment variable `MMSMITH_MMS` names another binary, such as one with optimisation for tests without.
#[must_use]
pub fn mms() -> Command {
    let given = std::env::var_os("MMSMITH_MMS").map(|path| workspace().join(path));
    let mut command = Command::new(given.unwrap_or_else(|| binaries().join("mms")));
    command.current_dir(workspace());
    command
}

/// The command `cargo xtask`, in the workspace.
#[must_use]
pub fn xtask() -> Command {
    let mut command = Command::new(binaries().join("xtask"));
    command.current_dir(workspace());
    command
}

/// The C compiler: the environment variable `CC` names another one than `cc`.
///
/// # Panics
///
/// Panics where there is none: generated C that nothing compiles is not tested.
#[must_use]
pub fn c_compiler() -> Command {
    let name = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    assert!(
        starts(&name),
        "there is no C compiler {}: install gcc or clang, or name one in the environment variable CC",
        name.display()
    );
    Command::new(name)
}

/// The C++ compiler, where there is one: `c++`, or what the environment variable `CXX` names.
#[must_use]
pub fn cpp_compiler() -> Option<Command> {
    let name = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    starts(&name).then(|| Command::new(name))
}

fn starts(compiler: &OsStr) -> bool {
    Command::new(compiler).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Runs a command; the exit status, and what it wrote to standard output and standard error.
#[must_use]
pub fn outcome(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().expect("the command can be started");
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    (status.code(), text(stdout), text(stderr))
}

/// Runs `mms` with the arguments and `--json`, and returns what it wrote; the run has to be a success.
#[must_use]
pub fn json(arguments: &[&str]) -> Value {
    let (status, value, errors) = with_json(arguments);
    assert_eq!(status, Some(0), "mms {}\n{errors}", arguments.join(" "));
    value
}

/// As [`json`] where a run may fail: the exit status has to be 1 where the result says `"passed": false`, and 0 else.
#[must_use]
pub fn json_as_judged(arguments: &[&str]) -> Value {
    let (status, value, errors) = with_json(arguments);
    let expected = i32::from(value["passed"] == false);
    assert_eq!(status, Some(expected), "mms {}\n{errors}", arguments.join(" "));
    value
}

fn with_json(arguments: &[&str]) -> (Option<i32>, Value, String) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let file = folder.path().join("out.json");
    let (status, _, errors) = outcome(mms().args(arguments).arg("--json").arg(&file));
    let text = std::fs::read_to_string(&file);
    let text = text.unwrap_or_else(|_| panic!("mms {}\n{errors}", arguments.join(" ")));
    (status, serde_json::from_str(&text).expect("the file is JSON"), errors)
}

/// The numbers at `path` in each row of a result.
#[must_use]
pub fn column(result: &Value, path: &[&str]) -> Vec<f64> {
    let rows = result["rows"].as_array().expect("rows");
    rows.iter().map(|row| at(row, path)).collect()
}

/// The number at `path`; not-a-number where there is none.
#[must_use]
pub fn at(value: &Value, path: &[&str]) -> f64 {
    path.iter().fold(value, |value, key| &value[*key]).as_f64().unwrap_or(f64::NAN)
}
