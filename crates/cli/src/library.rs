//! The solutions that commands take: found by name or path, built with parameters.
//!
//! A path, which ends in `.toml` or has a separator, is the specification in that file. A name is looked for, in this
//! order, as `NAME.toml` in `mms-specs` of the working folder and of the folders above it, in the folders that the variable
//! `MMSMITH_SPECS` names, and among the solutions that were compiled in. Where the first file found is the very text that a
//! compiled solution was generated from, the compiled code serves: it gives the same fields, faster. Any other file is
//! interpreted.

use std::collections::{BTreeMap, BTreeSet};
use std::env;
use std::fs;
use std::path::{Component, Path, PathBuf, is_separator};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use anyhow::{Context, Result, bail};
use mmsmith_claims::admissible_value;
use mmsmith_interpret::{interpret_staged, interpret_staged_single};
use mmsmith_solutions::{AnySolution, CATALOGUE, Description, Precision, build};
use mmsmith_spec::{Coordinates, DeriveError, Parameter, Spec, nearest};
use mmsmith_stage::Staged;
use mmsmith_verify::{Provenance, body_of, has_body};

use crate::input;
use crate::number;
use crate::terminal;

/// The folders of specifications, in the working folder or above it.
const FOLDER: &str = "mms-specs";
/// The variable with further folders, separated as those of `PATH` are.
const VARIABLE: &str = "MMSMITH_SPECS";
/// The longest specification; what is longer, such as a device, is not read to its end.
const LONGEST: u64 = mmsmith_spec::LONGEST_FILE as u64;

/// Specifications of laws that remember, or that depend on the place, which are compiled in as text.
const WITH_MEMORY: &[(&str, &str)] = &[
    ("bar-j2", include_str!("../library/with-memory/bar-j2.toml")),
    ("bar-kelvin-voigt", include_str!("../library/with-memory/bar-kelvin-voigt.toml")),
    ("bar-own-law", include_str!("../library/with-memory/bar-own-law.toml")),
    ("block-graded", include_str!("../library/with-memory/block-graded.toml")),
    ("block-j2", include_str!("../library/with-memory/block-j2.toml")),
    ("block-j2-3d", include_str!("../library/with-memory/block-j2-3d.toml")),
    ("block-maxwell", include_str!("../library/with-memory/block-maxwell.toml")),
    ("block-perzyna", include_str!("../library/with-memory/block-perzyna.toml")),
    ("block-warm", include_str!("../library/with-memory/block-warm.toml")),
    ("ring-j2", include_str!("../library/with-memory/ring-j2.toml")),
    ("ring-simo", include_str!("../library/with-memory/ring-simo.toml")),
];

/// Specifications of motions without a change of volume, for tests next to incompressibility, which are compiled in as text.
const INCOMPRESSIBLE: &[(&str, &str)] = &[
    ("ring-isochoric", include_str!("../library/incompressible/ring-isochoric.toml")),
    ("shears", include_str!("../library/incompressible/shears.toml")),
    ("shears-3d", include_str!("../library/incompressible/shears-3d.toml")),
    ("shears-loaded", include_str!("../library/incompressible/shears-loaded.toml")),
];

/// Specifications of bodies of revolution, which are compiled in as text.
const REVOLUTION: &[(&str, &str)] = &[
    ("bulging-plate", include_str!("../library/revolution/bulging-plate.toml")),
    ("swelling-sphere", include_str!("../library/revolution/swelling-sphere.toml")),
    ("thick-cylinder", include_str!("../library/revolution/thick-cylinder.toml")),
    ("twisting-cylinder", include_str!("../library/revolution/twisting-cylinder.toml")),
];

/// All specifications that are compiled in as text.
fn texts() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    WITH_MEMORY.iter().chain(INCOMPRESSIBLE).chain(REVOLUTION)
}

/// The names of all solutions that can be listed: [`names`], then those whose fields are interpreted.
pub(crate) fn all_names() -> Vec<String> {
    let mut all = names();
    let others = texts().map(|(name, _)| (*name).to_owned());
    let others: Vec<String> = others.filter(|name| !all.contains(name)).collect();
    all.extend(others);
    all
}

/// Where a solution was found.
#[derive(Clone, Debug)]
pub(crate) enum Origin {
    /// Among those that were compiled in.
    BuiltIn(&'static Description),
    /// A specification that was compiled in as text: its law remembers, or depends on the place, and its fields are interpreted.
    Text {
        /// The name.
        name: &'static str,
        /// All of it.
        text: &'static str,
    },
    /// In a file.
    File {
        /// From the working folder where it is there or above it.
        path: PathBuf,
        /// All of it.
        text: String,
        /// The solution of the same name that was compiled in, if there is one.
        instead_of: Option<&'static Description>,
    },
}

impl Origin {
    /// Whether the fields are compiled code; else they are interpreted.
    pub(crate) fn is_generated(&self) -> bool {
        matches!(self, Self::BuiltIn(_))
    }

    /// How the fields are evaluated: `generated` code, or the specification `interpreted`. Both have the same bits.
    pub(crate) fn evaluation(&self) -> &'static str {
        if self.is_generated() { "generated" } else { "interpreted" }
    }

    /// The specification's text.
    pub(crate) fn text(&self) -> &str {
        match self {
            Self::BuiltIn(description) => description.specification,
            Self::Text { text, .. } => text,
            Self::File { text, .. } => text,
        }
    }

    /// Name of the specification in messages.
    pub(crate) fn file(&self) -> String {
        match self {
            Self::BuiltIn(description) => format!("{}.toml", description.name),
            Self::Text { name, .. } => format!("{name}.toml"),
            Self::File { path, .. } => path.display().to_string(),
        }
    }

    /// The file without its folders, which say where it lies here and nothing of the solution.
    pub(crate) fn shown_file(&self) -> String {
        let file = self.file();
        let name = Path::new(&file).file_name().map(|name| name.to_string_lossy().into_owned());
        name.unwrap_or(file)
    }

    /// Where other files of the specification are, if it is a file itself.
    pub(crate) fn folder(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) | Self::Text { .. } => None,
            Self::File { path, .. } => path.parent(),
        }
    }

    /// The specification.
    pub(crate) fn specification(&self) -> Result<Spec> {
        Ok(Spec::parse(self.text(), &self.file())?)
    }

    /// Where it was found, in words.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::BuiltIn(_) => "built in".into(),
            Self::Text { .. } => "built in, interpreted".into(),
            Self::File { path, instead_of: None, .. } => path.display().to_string(),
            Self::File { path, instead_of: Some(_), .. } => {
                format!("{}, which differs from the built-in one", path.display())
            }
        }
    }

    fn read(path: PathBuf) -> Result<Self> {
        let text = input::Source::File(&path).short_text(LONGEST)?;
        Ok(Self::File { path, text, instead_of: None })
    }
}

/// Finds a solution by path or by name; see the [module](self) for the order.
pub(crate) fn locate(name: &str) -> Result<Origin> {
    if is_file(name) {
        return Origin::read(PathBuf::from(name));
    }
    let built_in = CATALOGUE.iter().copied().find(|known| known.name == name);
    let file = format!("{name}.toml");
    let mut found = None;
    for path in candidates().into_iter().map(|folder| folder.join(&file)) {
        if found.is_none() && input::kind_of(&path)?.is_some_and(|kind| kind.is_file()) {
            found = Some(path);
        }
    }
    let origin = match (found, built_in) {
        (None, Some(description)) => Origin::BuiltIn(description),
        (None, None) => match texts().find(|(known, _)| *known == name) {
            Some((name, text)) => Origin::Text { name, text },
            None => return Err(unknown(name)),
        },
        (Some(path), _) => match (Origin::read(path)?, built_in) {
            (Origin::File { text, .. }, Some(description))
                if same_lines(&text, description.specification) =>
            {
                Origin::BuiltIn(description)
            }
            (Origin::File { path, text, .. }, instead_of) => {
                Origin::File { path, text, instead_of }
            }
            (origin, _) => origin,
        },
    };
    tell(name, &origin);
    Ok(origin)
}

/// Whether two texts are equal but for the ends of their lines, which tools for versions change.
fn same_lines(one: &str, other: &str) -> bool {
    one.lines().eq(other.lines())
}

/// Whether names are those of the library alone.
static HAS_NO_FOLDERS: AtomicBool = AtomicBool::new(false);

/// From now on a name is one of the library, whatever lies in the working folder and above it.
pub(crate) fn forget_folders() {
    HAS_NO_FOLDERS.store(true, Ordering::Relaxed);
}

/// The folders that names are looked for in, as messages tell them: those above the working folder only where they exist.
fn folders() -> Vec<PathBuf> {
    let mut folders = candidates();
    folders.retain(|folder| !folder.starts_with("..") || folder.is_dir());
    folders
}

/// The folders that names are looked for in, in their order, whether they exist or not.
fn candidates() -> Vec<PathBuf> {
    if HAS_NO_FOLDERS.load(Ordering::Relaxed) {
        return Vec::new();
    }
    let mut folders = vec![PathBuf::from(FOLDER)];
    let above = env::current_dir().map_or(0, |folder| {
        folder.components().filter(|part| matches!(part, Component::Normal(_))).count()
    });
    let mut up = PathBuf::new();
    for _ in 0..above {
        up.push("..");
        folders.push(up.join(FOLDER));
    }
    if let Some(list) = env::var_os(VARIABLE) {
        folders.extend(env::split_paths(&list).filter(|folder| !folder.as_os_str().is_empty()));
    }
    folders
}

/// Says, once for each name, what a user may not expect of where it was found.
fn tell(name: &str, origin: &Origin) {
    static TOLD: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    if !TOLD.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned()) {
        return;
    }
    match origin {
        Origin::File { path, instead_of: Some(_), .. } => terminal::note(format_args!(
            "{} differs from the built-in {name}: its fields are interpreted; cargo xtask gen makes them fast",
            path.display()
        )),
        Origin::BuiltIn(_) => terminal::detail(format_args!("{name}: built in, generated code")),
        Origin::Text { .. } => terminal::detail(format_args!("{name}: built in, interpreted")),
        Origin::File { path, instead_of: None, .. } => {
            terminal::detail(format_args!("{name}: {}, interpreted", path.display()));
        }
    }
}

/// The names of all solutions that can be found without a path: those built in, then those of the folders.
pub(crate) fn names() -> Vec<String> {
    let mut names: Vec<String> = CATALOGUE.iter().map(|known| known.name.to_owned()).collect();
    let mut others = BTreeSet::new();
    for folder in folders() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let is_specification =
                path.extension().is_some_and(|extension| extension == "toml") && path.is_file();
            if let Some(stem) = path.file_stem().and_then(|stem| stem.to_str())
                && is_specification
                && !names.iter().any(|known| known == stem)
            {
                others.insert(stem.to_owned());
            }
        }
    }
    names.extend(others);
    names
}

/// The refusal of a name that leads nowhere: what was meant perhaps, what there is, and where it was looked for.
fn unknown(name: &str) -> anyhow::Error {
    let names = all_names();
    let file = format!("{name}.toml");
    let hint = if Path::new(&file).is_file() {
        format!("; {file} is a file in this folder: write {file}")
    } else {
        nearest(name, names.iter().map(String::as_str))
            .map(|known| format!("; did you mean '{known}'?"))
            .unwrap_or_default()
    };
    let folders: Vec<_> = folders().iter().map(|folder| folder.display().to_string()).collect();
    anyhow::anyhow!(
        "there is no solution '{name}'{hint} (there are: {}; {file} was looked for in {})",
        names.join(", "),
        folders.join(", ")
    )
}

/// A solution with its parameter values.
#[derive(Clone)]
pub(crate) struct Selection {
    source: Source,
    parameters: BTreeMap<String, f64>,
}

/// A specification with its fields in stages.
struct Interpretable {
    spec: Spec,
    staged: Staged,
    /// Stages in the components of files for hosts, once a command asks for them where they are others.
    for_hosts: OnceLock<Result<Staged, DeriveError>>,
}

/// Where a solution's fields come from.
#[derive(Clone)]
enum Source {
    /// Code generated from the library's specifications.
    Library(&'static Description),
    /// A specification that is interpreted; nothing needs to have been generated from it.
    File(Arc<Interpretable>),
}

impl Selection {
    /// Finds `name`, a solution by name or a specification file, and puts `overrides` in place of its parameters' defaults.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        Self::of(&locate(name)?, overrides)
    }

    /// The solution of a specification that was found.
    fn of(origin: &Origin, overrides: &[(String, f64)]) -> Result<Self> {
        for (index, (name, _)) in overrides.iter().enumerate() {
            if overrides[..index].iter().any(|(earlier, _)| earlier == name) {
                bail!("--set {name}=... is given twice");
            }
        }
        let (source, defaults): (Source, BTreeMap<String, f64>) = match origin {
            Origin::File { .. } | Origin::Text { .. } => {
                let spec = origin.specification()?;
                let fields = spec.derive().with_context(|| origin.file())?;
                let pairs = spec.parameters.iter().map(|p| (p.name.clone(), p.default));
                let defaults = pairs.collect();
                let staged = Staged::of(&spec, fields);
                let for_hosts = OnceLock::new();
                (Source::File(Arc::new(Interpretable { spec, staged, for_hosts })), defaults)
            }
            Origin::BuiltIn(description) => {
                let parameters = description.parameters.iter();
                let defaults = parameters.map(|p| (p.name.to_owned(), p.default)).collect();
                (Source::Library(description), defaults)
            }
        };
        let whose = if overrides.is_empty() { origin.file() } else { "--set".to_owned() };
        let selection = Self { source, parameters: defaults }.with(overrides).context(whose)?;
        if !overrides.is_empty() {
            body_of(&selection.build()?).context("--set")?;
        }
        Ok(selection)
    }

    /// This solution with other values of the parameters named; of two values for one name the later one holds.
    pub(crate) fn with(&self, values: &[(String, f64)]) -> Result<Self> {
        let mut changed = self.clone();
        changed.parameters.extend(values.iter().cloned());
        let pairs = changed.parameters.iter().map(|(name, value)| (name.as_str(), *value));
        // Unknown names and values that are not admissible come to light here.
        match &changed.source {
            Source::Library(description) => {
                build::<f64>(description.name, &description.resolve(pairs)?).transpose()?;
            }
            Source::File(source) => {
                interpret_staged(&source.spec, &source.staged, pairs)?;
            }
        }
        Ok(changed)
    }

    /// The solution's name.
    pub(crate) fn name(&self) -> &str {
        match &self.source {
            Source::Library(description) => description.name,
            Source::File(source) => &source.spec.name,
        }
    }

    /// The number of space dimensions.
    pub(crate) fn dimension(&self) -> usize {
        match &self.source {
            Source::Library(description) => description.dimension,
            Source::File(source) => source.spec.dimension,
        }
    }

    /// Whether places are the radius and the height of a body of revolution.
    pub(crate) fn is_axisymmetric(&self, solution: &AnySolution<f64>) -> bool {
        match &self.source {
            Source::Library(_) => mmsmith_verify::is_axisymmetric(solution),
            Source::File(source) => source.spec.coordinates == Coordinates::Axisymmetric,
        }
    }

    /// Whether nothing moves, so that any time is as good as another. All solutions of the library move.
    pub(crate) fn is_static(&self) -> bool {
        match &self.source {
            Source::Library(_) => false,
            Source::File(source) => source.spec.is_static(),
        }
    }

    /// The solution in double precision.
    pub(crate) fn build(&self) -> Result<AnySolution<f64>> {
        match &self.source {
            Source::Library(description) => self.generated(description),
            Source::File(source) => {
                let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
                Ok(interpret_staged(&source.spec, &source.staged, pairs)?)
            }
        }
    }

    /// As [`build`](Self::build), in the components of files for hosts: a body of revolution in its half plane.
    pub(crate) fn build_for_hosts(&self) -> Result<AnySolution<f64>> {
        match &self.source {
            Source::File(source) if source.spec.coordinates == Coordinates::Axisymmetric => {
                let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
                let stage = || Ok(Staged::of(&source.spec, source.spec.derive_for_hosts()?));
                let staged = source.for_hosts.get_or_init(stage).as_ref().map_err(Clone::clone)?;
                Ok(interpret_staged(&source.spec, staged, pairs)?)
            }
            _ => self.build(),
        }
    }

    /// The solution in single precision, for solvers that compute in it.
    pub(crate) fn build_single(&self) -> Result<AnySolution<f32>> {
        match &self.source {
            Source::Library(description) => self.generated(description),
            Source::File(source) => {
                let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
                Ok(interpret_staged_single(&source.spec, &source.staged, pairs)?)
            }
        }
    }

    /// How its fields are evaluated: `generated` code, or the specification `interpreted`. Both have the same bits.
    pub(crate) fn evaluation(&self) -> &'static str {
        match &self.source {
            Source::Library(_) => "generated",
            Source::File(_) => "interpreted",
        }
    }

    fn generated<T: Precision>(&self, description: &Description) -> Result<AnySolution<T>> {
        let pairs = self.parameters.iter().map(|(name, value)| (name.as_str(), *value));
        match build(description.name, &description.resolve(pairs)?) {
            Some(solution) => Ok(solution?),
            None => bail!("the solution '{}' is listed but cannot be built", description.name),
        }
    }

    /// The unit of each parameter, empty for a pure number.
    pub(crate) fn units(&self) -> BTreeMap<String, String> {
        match &self.source {
            Source::Library(description) => {
                description.parameters.iter().map(|p| (p.name.into(), p.unit.into())).collect()
            }
            Source::File(source) => {
                source.spec.parameters.iter().map(|p| (p.name.clone(), p.unit.clone())).collect()
            }
        }
    }

    /// Parameter values by name.
    pub(crate) fn parameters(&self) -> &BTreeMap<String, f64> {
        &self.parameters
    }

    /// Name and parameters, for files of its particles.
    pub(crate) fn provenance(&self) -> Provenance {
        Provenance { solution: self.name().to_owned(), parameters: self.parameters.clone() }
    }

    /// The values of all parameters in words: `A = 0.1, E = 10000`.
    pub(crate) fn told_parameters(&self) -> String {
        let told = |(name, value): (&String, &f64)| format!("{name} = {}", number::exact(*value));
        self.parameters.iter().map(told).collect::<Vec<_>>().join(", ")
    }
}

/// A solution to check, wherever it comes from.
pub(crate) struct Subject {
    pub(crate) name: String,
    /// With the parameters asked for, then with others: a mistake may hide at particular values.
    pub(crate) solutions: Vec<AnySolution<f64>>,
    pub(crate) parameters: Vec<BTreeMap<String, f64>>,
    /// With the parameters asked for.
    pub(crate) selection: Selection,
    pub(crate) spec: Spec,
    /// The name of the specification in messages.
    pub(crate) file: String,
    /// Where other files of the specification are, if it is a file itself.
    pub(crate) folder: Option<PathBuf>,
}

impl Subject {
    /// The solution called `name`, or the one that the specification file `name` describes.
    pub(crate) fn new(name: &str, overrides: &[(String, f64)]) -> Result<Self> {
        let origin = locate(name)?;
        let selection = Selection::of(&origin, overrides)?;
        let spec = origin.specification()?;
        let mut solutions = vec![selection.build()?];
        let mut parameters = vec![selection.parameters().clone()];
        // What the user set stays; the rest varies, where the specification admits it.
        for attempt in 1..=MOST_ATTEMPTS {
            let set: Vec<(String, f64)> = spec
                .parameters
                .iter()
                .enumerate()
                .filter(|(_, p)| overrides.iter().all(|(name, _)| *name != p.name))
                .map(|(index, p)| (p.name.clone(), variation(attempt, index, p)))
                .collect();
            if let Ok(varied) = selection.with(&set)
                && let solution = varied.build()?
                && has_body(&solution)
            {
                solutions.push(solution);
                parameters.push(varied.parameters().clone());
            }
            if solutions.len() > VARIATIONS {
                break;
            }
        }
        let (file, folder) = (origin.file(), origin.folder().map(Path::to_owned));
        let name = selection.name().to_owned();
        Ok(Self { name, solutions, parameters, selection, spec, file, folder })
    }
}

/// Sets of parameters that are checked beside the one asked for.
const VARIATIONS: usize = 4;
/// As many sets are tried for that; the specification may refuse some, and for others there may be no body.
const MOST_ATTEMPTS: usize = 30;

/// A value between 0.75 and 1.25 of the default in every third attempt, else anywhere in the admissible range.
fn variation(attempt: usize, index: usize, parameter: &Parameter) -> f64 {
    // Multiples of the golden ratio, spread evenly over the unit interval, which repeat for no two parameters.
    let share = ((attempt * 17 + index) as f64 * 0.618_033_988_749_894_9).fract();
    if attempt % 3 == 1 {
        return parameter.default * (0.75 + 0.5 * share);
    }
    admissible_value(parameter, share)
}

/// The specification of the solution called `name`, or the one in the file `name`.
pub(crate) fn specification(name: &str) -> Result<Spec> {
    locate(name)?.specification()
}

/// Whether the user means a specification file.
fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "toml")
        || name.contains(is_separator)
}
