//! The state of a search for rounding errors, in a file of a folder.

use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mmsmith_oracle::{Accuracy, JudgedCode, Search};
use mmsmith_spec::Spec;
use serde::{Deserialize, Serialize};

use crate::checksum::sha256;
use crate::input;
use crate::json::Output;

const SCHEMA: &str = "mmsmith.search/1";
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// This build; another one may round in another way.
const BUILD: &str = env!("MMS_BUILD");
/// Longer than any state.
const LONGEST: u64 = 1 << 26;

/// A search, with what it was a search of.
#[derive(Serialize, Deserialize)]
pub(super) struct State {
    schema: String,
    version: String,
    build: String,
    solution: String,
    /// The checksum of the specification's text.
    specification: String,
    /// Whether the code was generated; else it was interpreted.
    generated: bool,
    search: Search,
}

impl State {
    /// The search that was kept, if there is one. One that another build has kept is judged anew, for code may have changed.
    pub(super) fn read(
        folder: &Path,
        spec: &Spec,
        accuracy: &Accuracy<'_>,
        is_generated: bool,
        judged: JudgedCode<'_>,
    ) -> Result<Option<Search>> {
        let path = path(folder, spec);
        match path.try_exists() {
            Ok(false) => return Ok(None),
            Ok(true) => {}
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).context("--state"),
        }
        let text = input::Source::File(&path).short_text(LONGEST).context("--state")?;
        let shown = path.display();
        let remedy = "remove the file, or give --state another folder";
        let state: State = serde_json::from_str(&text)
            .with_context(|| format!("--state: {shown} is no state of a search; {remedy}"))?;
        if (state.schema.as_str(), state.version.as_str()) != (SCHEMA, VERSION) {
            bail!(
                "--state: {shown} is from mms {}, and this is mms {VERSION}; {remedy}",
                state.version
            );
        }
        if state.specification != sha256(&spec.source) {
            bail!(
                "--state: {shown} is the state of another text of the specification '{}'; {remedy}",
                state.solution
            );
        }
        if state.generated != is_generated || !state.search.suits(accuracy) {
            bail!("--state: {shown} is the state of other code for '{}'; {remedy}", state.solution);
        }
        let mut search = state.search;
        if state.build != BUILD {
            search.judge_again(accuracy, judged).with_context(|| spec.name.clone())?;
        }
        Ok(Some(search))
    }

    /// Keeps the search; what was kept before is there until this is complete.
    pub(super) fn write(
        folder: &Path,
        spec: &Spec,
        is_generated: bool,
        search: &Search,
    ) -> Result<()> {
        Output::prepare(&path(folder, spec))?.write(&State {
            schema: SCHEMA.into(),
            version: VERSION.into(),
            build: BUILD.into(),
            solution: spec.name.clone(),
            specification: sha256(&spec.source),
            generated: is_generated,
            search: search.clone(),
        })
    }
}

/// Names of solutions are names of files.
fn path(folder: &Path, spec: &Spec) -> PathBuf {
    folder.join(&spec.name).with_extension("json")
}
