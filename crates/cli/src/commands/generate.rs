//! `mms gen`: a solution as code, anywhere and without cargo.

use anyhow::{Context, Result, bail};
use mmsmith_codegen::{Code, Names, Origin};

use crate::arguments::GenerateOptions;
use crate::json::{self, Output};
use crate::library::{Selection, locate};
use crate::terminal;

pub(crate) fn generate(options: &GenerateOptions) -> Result<bool> {
    let found = locate(&options.name)?;
    let mut spec = found.specification()?;
    let set = &options.parameters.set;
    if !set.is_empty() {
        // Refuses what the solution does not admit.
        Selection::new(&options.name, set)?;
        for parameter in &mut spec.parameters {
            let given = set.iter().find(|(name, _)| *name == parameter.name);
            parameter.default = given.map_or(parameter.default, |(_, value)| *value);
        }
    }
    if spec.has_history() {
        bail!(
            "{}: the stress follows from the history of each particle, which is no formula that --target {} could have; mms eval gives the \
             fields at points and times of yours, and the package for Python has b, P and internal variables as functions",
            found.file(),
            options.target.name
        );
    }
    if spec.has_graded_density() {
        bail!(
            "{}: files of hosts have one density, and here it depends on the place; mms eval and the package for Python have b, force per \
             mass, all the same",
            found.file()
        );
    }
    let fields = spec.derive().with_context(|| found.file())?;
    let origin = Origin { command: "mms gen".into(), file: found.shown_file() };
    let code = match options.fault {
        None => Code::of(&spec, fields, origin),
        Some(fault) => Code::with_fault(&spec, fields, origin, fault)
            .context("--fault: choose another solution or another fault")?,
    };
    let text = options.target.source(&code)?;
    json::make_folder(&options.out)?;
    let path = options.out.join(options.target.file_name(&Names::of(&spec.name).module));
    Output::write_at_once(&path, &text)?;
    terminal::say(&format!("wrote {}\n", path.display()))?;
    Ok(true)
}
