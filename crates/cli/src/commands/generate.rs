//! `mms gen`: a solution as code, anywhere and without cargo.

use anyhow::{Context, Result, bail};
use mmsmith_codegen::{Code, Names, Origin};
use mmsmith_interpret::{Over, TableFile, TableFileError};
use mmsmith_spec::{Coordinates, Spec};
use mmsmith_stage::Staged;

use super::eval::points::positions;
use super::tabulated;
use crate::arguments::GenerateOptions;
use crate::input::Source;
use crate::json::{self, Output};
use crate::library::{Selection, locate};
use crate::terminal;

/// Tables with larger errors are worth a word.
const CLOSE: f64 = 1e-11;
/// Bytes of a table from which on hosts take long to read it.
const LARGE: usize = 64 << 20;

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
    refuse_what_does_not_fit(options, &spec, &found.file())?;
    let origin = Origin { command: "mms gen".into(), file: found.shown_file() };
    let mut table = None;
    let code = match options.fault {
        None if spec.has_history() && !options.tangent && options.target.reads_tables => {
            let fields = spec.derive().with_context(|| found.file())?;
            let staged = Staged::of(&spec, fields);
            let file = tabulate(options, &spec, &staged).with_context(|| found.file())?;
            if file.error > CLOSE {
                terminal::note(format_args!(
                    "the fields are rough, and the table has errors of about {:.1e} of the largest value of each; series of your points are closer: \
                     --points points.csv",
                    file.error
                ));
            }
            let code = Code::for_host(&spec, origin, options.target.in_half_plane)
                .with_context(|| found.file())?;
            let (code, text) = tabulated::beside(code, &file);
            if text.len() > LARGE && options.points.is_none() {
                terminal::note(format_args!(
                    "the table has {} MB; where the points of your host are few, series of these alone are smaller: --points points.csv",
                    text.len() >> 20
                ));
            }
            table = Some(text);
            code
        }
        None if options.tangent && spec.coordinates == Coordinates::Axisymmetric => bail!(
            "--tangent: files of a body of revolution have the fields of its half plane, and the tangent is known in Cartesian components: state \
             the body with coordinates = 'cylindrical' and shape = 'tube'"
        ),
        None if options.tangent => {
            let fields = spec.derive_with_tangent().with_context(|| found.file())?;
            Code::of(&spec, fields, origin)
        }
        None => Code::for_host(&spec, origin, options.target.in_half_plane)
            .with_context(|| found.file())?,
        Some(fault) => {
            let fields = spec.derive().with_context(|| found.file())?;
            Code::with_fault(&spec, fields, origin, (fault, options.target.in_half_plane))
                .context("--fault: choose another solution or another fault")?
        }
    };
    let text = options.target.source(&code)?;
    json::make_folder(&options.out)?;
    let module = Names::of(&spec.name).module;
    let files = [
        Some((options.target.file_name(&module), text)),
        table.map(|text| (format!("{module}.table"), text)),
    ];
    for (name, text) in files.into_iter().flatten() {
        let path = options.out.join(name);
        Output::write_at_once(&path, &text)?;
        terminal::say(&format!("wrote {}\n", path.display()))?;
    }
    Ok(true)
}

/// Options of tables are for laws that need one, and faults for formulas.
fn refuse_what_does_not_fit(options: &GenerateOptions, spec: &Spec, file: &str) -> Result<()> {
    if spec.has_history() {
        if options.fault.is_some() {
            bail!(
                "--fault: faults are planted in formulas, and the stress of {file} follows from histories; choose an elastic solution, such as \
                 mms gen skew-2d --target {} --out DIR --fault NAME",
                options.target.name
            );
        }
        return Ok(());
    }
    let given = [("--periods", options.periods.is_some()), ("--points", options.points.is_some())];
    if let Some((option, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
        bail!(
            "{option} is for the tables of laws with a history; the fields of {file} are formulas, which hold everywhere and at all times: leave \
             it out"
        );
    }
    Ok(())
}

/// The table of the fields that follow from histories.
fn tabulate(options: &GenerateOptions, spec: &Spec, staged: &Staged) -> Result<TableFile> {
    let points = match &options.points {
        None => None,
        Some(file) => {
            let in_half_plane =
                options.target.in_half_plane && spec.coordinates == Coordinates::Axisymmetric;
            Some(positions(Source::of(file), spec.dimension, in_half_plane)?)
        }
    };
    if points.as_ref().is_some_and(Vec::is_empty) {
        bail!("--points: there is no point in the file");
    }
    let over = match points.as_deref() {
        Some(points) => Over::Points(points),
        None if options.target.in_half_plane => Over::HalfPlane,
        None => Over::Body,
    };
    let periods = options.periods.unwrap_or(1.0);
    TableFile::new(spec, staged, [], periods, over).map_err(|error| match error {
        why @ (TableFileError::Front | TableFileError::Rough { .. }) => anyhow::anyhow!(
            "{why}; give the points of your host, and the file has a series for each: mms gen {} --target {} --out DIR --points points.csv, a \
             line X,Y,Z and then a position a line",
            options.name,
            options.target.name
        ),
        other => other.into(),
    })
}
