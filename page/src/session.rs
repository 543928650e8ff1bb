//! A specification that is open, with what was derived from it.

use crate::refusal::Refusal;
use mmsmith_codegen::{Code, HOSTS, Host, Names, Origin, Tabulated};
use mmsmith_interpret::{Over, TableFile, interpret_staged};
use mmsmith_runtime::nalgebra::{SMatrix, SVector};
use mmsmith_runtime::{AnySolution, Solution};
use mmsmith_spec::{Coordinates, Diagnostic, Fields, Looks, Spec};
use mmsmith_stage::Staged;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// More points are not evaluated at once.
const MOST_POINTS: usize = 100_000;
/// Hexadecimal digits of the sign that a source and its table have in common.
const DIGITS_OF_DIGEST: usize = 16;

/// A specification and its fields.
pub(crate) struct Session {
    pub(crate) spec: Spec,
    file: String,
    /// In space.
    fields: Fields,
    staged: OnceCell<Staged>,
    /// For a body of revolution, in its half plane.
    for_hosts: OnceCell<(Fields, Staged)>,
    /// The tables of the body in space and in its half plane.
    tables: [OnceCell<TableFile>; 2],
}

impl Session {
    /// Reads a specification, puts values in place of defaults, and derives.
    pub(crate) fn open(
        file: &str,
        text: &str,
        set: &BTreeMap<String, f64>,
    ) -> Result<Self, Refusal> {
        let mut spec = Spec::parse(text, file).map_err(|mistake| Refusal(marked(&mistake)))?;
        for (name, value) in set {
            let Some(parameter) = spec.parameters.iter_mut().find(|own| own.name == *name) else {
                return Err(format!("there is no parameter '{name}'").into());
            };
            if !value.is_finite() || !parameter.bounds.iter().all(|bound| bound.admits(*value)) {
                let range = &parameter.range;
                let range = if range.is_empty() { "a finite number" } else { range };
                return Err(format!("{name} = {value} is out of range: {range}").into());
            }
            parameter.default = *value;
        }
        let fields = spec.derive().map_err(|error| format!("{file}: {error}"))?;
        let session = Session {
            spec,
            file: file.to_owned(),
            fields,
            staged: OnceCell::new(),
            for_hosts: OnceCell::new(),
            tables: [const { OnceCell::new() }; 2],
        };
        if !set.is_empty() {
            // What parameters must satisfy together.
            session.solution()?;
        }
        Ok(session)
    }

    /// The part of it that the page shows at once.
    pub(crate) fn about(&self) -> Value {
        let spec = &self.spec;
        let parameters = spec.parameters.iter().map(|parameter| {
            json!({
                "name": parameter.name,
                "value": parameter.default,
                "unit": parameter.unit,
                "range": parameter.range,
                "description": parameter.description,
            })
        });
        let hosts = HOSTS.iter().map(|host| json!({ "name": host.name, "about": host.about }));
        json!({
            "name": spec.name,
            "title": spec.title,
            "reference": spec.reference,
            "dimension": spec.dimension,
            "coordinates": spec.coordinates.name(),
            "law": spec.law_formulas(),
            "history": spec.has_history(),
            "moves": !spec.is_static(),
            "parameters": parameters.collect::<Vec<_>>(),
            "hosts": hosts.collect::<Vec<_>>(),
            "version": env!("CARGO_PKG_VERSION"),
        })
    }

    fn staged(&self) -> &Staged {
        self.staged.get_or_init(|| Staged::of(&self.spec, self.fields.clone()))
    }

    fn is_of_revolution(&self) -> bool {
        self.spec.coordinates == Coordinates::Axisymmetric
    }

    /// Fields in the components of files for hosts, and their stages.
    fn for_hosts(&self) -> Result<(&Fields, &Staged), Refusal> {
        if !self.is_of_revolution() {
            return Ok((&self.fields, self.staged()));
        }
        if self.for_hosts.get().is_none() {
            let fields = self.spec.derive_for_hosts()?;
            let staged = Staged::of(&self.spec, fields.clone());
            // Nothing was there before.
            let _ = self.for_hosts.set((fields, staged));
        }
        let (fields, staged) = self.for_hosts.get().ok_or("nothing was derived")?;
        Ok((fields, staged))
    }

    /// Fields as formulas show them.
    pub(crate) fn shown_fields(&self) -> Result<&Fields, Refusal> {
        Ok(self.for_hosts()?.0)
    }

    /// The solution in space.
    pub(crate) fn solution(&self) -> Result<AnySolution<f64>, Refusal> {
        Ok(interpret_staged(&self.spec, self.staged(), [])?)
    }

    /// All fields at places, each with its time behind its coordinates; the numbers are those of `mms eval`.
    pub(crate) fn fields_at(&self, points: &[Vec<f64>]) -> Result<Value, Refusal> {
        if points.len() > MOST_POINTS {
            return Err(format!("{} points; {MOST_POINTS} are the limit", points.len()).into());
        }
        let solution = interpret_staged(&self.spec, self.for_hosts()?.1, [])?;
        let mut rows = Vec::new();
        for point in points {
            let Some((t, X)) = point.split_last() else {
                return Err("a point is its coordinates and a time".into());
            };
            let at_angle_zero: Vec<f64>;
            let X = match (self.is_of_revolution(), X) {
                (true, &[R, Z]) => {
                    at_angle_zero = vec![R, 0.0, Z];
                    &at_angle_zero[..]
                }
                _ => X,
            };
            rows.push(match &solution {
                AnySolution::One(solution) => fields(solution.as_ref(), X, *t)?,
                AnySolution::Two(solution) => fields(solution.as_ref(), X, *t)?,
                AnySolution::Three(solution) => fields(solution.as_ref(), X, *t)?,
                _ => return Err("fields in more than three dimensions are not told".into()),
            });
        }
        Ok(json!({ "rows": rows }))
    }

    /// The files of a host, byte for byte those of `mms gen`.
    pub(crate) fn source(&self, host: &str) -> Result<Value, Refusal> {
        let host = Host::named(host).ok_or_else(|| format!("there is no host '{host}'"))?;
        let origin = Origin { command: "mms gen".into(), file: self.file.clone() };
        let spec = &self.spec;
        let mut table = None;
        let code = if spec.has_history() && host.reads_tables {
            let (code, text) = self.tabulated(origin, host.in_half_plane)?;
            table = Some(text);
            code
        } else {
            Code::for_host(spec, origin, host.in_half_plane)?
        };
        let text = host.source(&code)?;
        let module = Names::of(&spec.name).module;
        let files = [
            Some((host.file_name(&module), text)),
            table.map(|text| (format!("{module}.table"), text)),
        ];
        let files = files.into_iter().flatten();
        let files = files.map(|(name, text)| json!({ "name": name, "text": text }));
        Ok(json!({ "files": files.collect::<Vec<_>>() }))
    }

    /// The code that reads a table, and that table.
    fn tabulated(
        &self,
        origin: Origin,
        in_half_plane: bool,
    ) -> Result<(Code<'_>, String), Refusal> {
        let in_half_plane = in_half_plane && self.spec.coordinates == Coordinates::Axisymmetric;
        let kept = &self.tables[usize::from(in_half_plane)];
        if kept.get().is_none() {
            let over = if in_half_plane { Over::HalfPlane } else { Over::Body };
            let table = TableFile::new(&self.spec, self.staged(), [], 1.0, over)?;
            // Nothing was there before.
            let _ = kept.set(table);
        }
        let table = kept.get().ok_or("there is no table")?;
        let digest: String =
            Sha256::digest(table.content()).iter().map(|byte| format!("{byte:02x}")).collect();
        let digest = digest[..DIGITS_OF_DIGEST].to_owned();
        // After b and P, whose sizes sources know.
        let internal = table.fields.iter().skip(2);
        let beside = Tabulated {
            digest: digest.clone(),
            end: table.end,
            error: table.error,
            sizes: internal.map(|field| field.shape.size(table.dimension)).collect(),
            variables: table.variables.clone(),
            in_time: table.in_time,
        };
        let code = Code::for_host(&self.spec, origin, in_half_plane)?.with_table(beside);
        Ok((code, table.text(&digest)))
    }
}

/// Every field at a place.
fn fields<const D: usize>(
    solution: &dyn Solution<f64, D>,
    X: &[f64],
    t: f64,
) -> Result<Value, Refusal> {
    let Ok(place) = <[f64; D]>::try_from(X) else {
        return Err(format!("{} coordinates where {D} are needed", X.len()).into());
    };
    let all = solution.fields(&SVector::from(place), t);
    let list = |vector: &SVector<f64, D>| vector.iter().copied().collect::<Vec<f64>>();
    let rows = |matrix: &SMatrix<f64, D, D>| -> Vec<Vec<f64>> {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    Ok(json!({
        "u": list(&all.u),
        "v": list(&all.v),
        "a": list(&all.a),
        "H": rows(&all.H),
        "F": rows(&all.F),
        "J": all.J,
        "P": rows(&all.P),
        "b": list(&all.b),
    }))
}

/// A mistake with its place, in the units in which scripts count text.
fn marked(mistake: &Diagnostic) -> Value {
    let counted = |end: usize| {
        let end = mistake.source.floor_char_boundary(end);
        mistake.source[..end].encode_utf16().count()
    };
    let (line, column) = mistake.line_and_column();
    json!({
        "message": mistake.message,
        "help": mistake.help,
        "rendered": mistake.rendered(Looks::default()),
        "line": line,
        "column": column,
        "start": counted(mistake.span.start),
        "end": counted(mistake.span.end),
    })
}
