//! `mms gen`: a solution as code, anywhere and without cargo.

use anyhow::{Context, Result};
use mmsmith_codegen::{Code, Names, Origin};

use crate::arguments::{GenerateOptions, Target};
use crate::json::{self, Output};
use crate::library::locate;
use crate::terminal;

pub(crate) fn generate(options: &GenerateOptions) -> Result<bool> {
    let found = locate(&options.name)?;
    let spec = found.specification()?;
    let fields = spec.derive().with_context(|| found.file())?;
    let origin = Origin { command: "mms gen".into(), file: found.shown_file() };
    let code = match options.fault {
        None => Code::of(&spec, fields, origin),
        Some(fault) => Code::with_fault(&spec, fields, origin, fault)
            .context("--fault: choose another solution or another fault")?,
    };
    let (text, extension) = match options.target {
        Target::Rust => (code.standalone_source(), "rs"),
        Target::C => (code.header_source(), "h"),
    };
    json::prepare_folder(&options.out)?;
    let path = options.out.join(Names::of(&spec.name).module).with_extension(extension);
    Output::prepare(&path)?.write_text(&text)?;
    terminal::say(&format!("wrote {}\n", path.display()))?;
    Ok(true)
}
