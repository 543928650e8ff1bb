//! Reading a specification: from the document to checked names, numbers and expressions.

use std::collections::{BTreeMap, BTreeSet};

use crate::coordinates::Geometry;
use crate::derivation::Derivation;
use crate::diagnostic::nearest;
use crate::document::{Document, DomainTable, Entries, List, Measure, ParameterEntry, Text};
use crate::law::energy::{INVARIANTS, component_names};
use crate::read::LONGEST_FILE;
use crate::scope::Scope;
use crate::source::Source;
use crate::{
    Boundary, Coordinates, CrossCheck, DeriveError, Diagnostic, Fields, Given, InternalVariable,
    Rotation, Solved, Variation,
};
use mmsmith_expr::{Expr, Function, Graph, Node, Program, RangeOfInputs, Rational};
use mmsmith_vocabulary::{Constant, Material, Memory, Moduli, Row, Term, UnknownLaw, Volumetric};
use toml::Spanned;

/// A specification that has been read and checked.
#[derive(Clone, Debug)]
pub struct Spec {
    /// The text that it was read from.
    pub source: String,
    /// Lower-case letters, digits and hyphens, starting with a letter; its words are no Rust keyword.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// Where the solution comes from; may be empty.
    pub reference: String,
    /// The coordinates in which it is stated.
    pub coordinates: Coordinates,
    /// The number of space dimensions, 1 to 3.
    pub dimension: usize,
    /// The inputs for which digits are kept.
    pub range_of_inputs: RangeOfInputs,
    /// The parameters in the order of the file.
    pub parameters: Vec<Parameter>,
    /// Conditions that the parameters must satisfy together.
    pub requirements: Vec<Requirement>,
    /// The graph that all expressions belong to.
    pub graph: Graph,
    /// The expressions of `[let]` by their names, each after those that it refers to.
    pub lets: Vec<(String, Expr)>,
    /// Physical components of the displacement.
    pub displacement: Vec<Expr>,
    /// The constitutive law; the elastic part of one with [`memory`](Self::memory).
    pub material: Law,
    /// Changes of the specification to a law of the library; [`material`](Self::material) is what comes of them.
    pub variation: Option<Variation>,
    /// The second Piola-Kirchhoff stress of the undeformed body, along the coordinates' own unit vectors.
    pub prestress: Option<Vec<Vec<Expr>>>,
    /// Fields of position and time that the law uses.
    pub given: Vec<Given>,
    /// The memory of a law of the library.
    pub memory: Option<Memory<Expr>>,
    /// The internal variables of a law that the specification states.
    pub internal: Vec<InternalVariable>,
    /// Mass per reference volume; it may depend on the place.
    pub density: Expr,
    /// The body's shape.
    pub domain: Domain,
    /// The length that a cell count divides.
    pub cell_length: Expr,
    /// The conditions on its boundary.
    pub boundaries: Vec<Boundary>,
    /// A rigid rotation that is superposed on the displacement, in all Cartesian fields.
    pub rotation: Option<Rotation>,
    /// The result of `[solve]`; the displacement has it put in.
    pub solved: Option<Solved>,
    /// Published listings of the fields.
    pub cross_checks: Vec<CrossCheck>,
    /// The speed that CFL numbers refer to.
    pub wave_speed: Expr,
    /// The time in which the motion repeats.
    pub period: Expr,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// A valid identifier.
    pub name: String,
    /// Finite, and within the bounds.
    pub default: f64,
    /// The unit; may be empty.
    pub unit: String,
    /// The meaning; may be empty.
    pub description: String,
    /// The bounds as the file states them; empty where there are none.
    pub range: String,
    /// The admissible values.
    pub bounds: Vec<Bound>,
}

/// An order relation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `<`
    Less,
    /// `<=`
    LessOrEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterOrEqual,
}

impl Relation {
    const SIGNS: [(&'static str, Relation); 4] = [
        ("<=", Relation::LessOrEqual),
        (">=", Relation::GreaterOrEqual),
        ("<", Relation::Less),
        (">", Relation::Greater),
    ];

    /// The sign, which is the same in Maple, Rust and C.
    #[must_use]
    pub fn sign(self) -> &'static str {
        Self::SIGNS.iter().find(|(_, r)| *r == self).map_or("", |(sign, _)| sign)
    }

    /// Whether `a` stands in this relation to `b`.
    #[must_use]
    pub fn holds(self, a: f64, b: f64) -> bool {
        match self {
            Relation::Less => a < b,
            Relation::LessOrEqual => a <= b,
            Relation::Greater => a > b,
            Relation::GreaterOrEqual => a >= b,
        }
    }
}

/// One side of an admissible range: the value stands in `relation` to `limit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// How.
    pub relation: Relation,
    /// To what.
    pub limit: f64,
}

impl Bound {
    /// Whether the value is on the admissible side.
    #[must_use]
    pub fn admits(&self, value: f64) -> bool {
        self.relation.holds(value, self.limit)
    }
}

/// A condition between expressions of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Requirement {
    /// As the file states it.
    pub text: String,
    /// The left side.
    pub left: Expr,
    /// The relation that must hold.
    pub relation: Relation,
    /// The right side.
    pub right: Expr,
}

/// A constitutive law with its constants as expressions of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// A law of the library.
    Library(Material<Expr>),
    /// A strain energy per reference volume, `P = dW/dF`.
    Energy {
        /// In the symbols `F11`, `C11`, ..., `J`, `I1` and `I2`.
        W: Expr,
    },
    /// The first Piola-Kirchhoff stress, component by component.
    Stress {
        /// In the symbols `F11`, `C11`, ..., `J`, `I1` and `I2`.
        P: Vec<Vec<Expr>>,
    },
}

/// Value of the key `law` of a specification.
#[derive(Clone, Copy)]
enum Kind {
    Library(&'static Row),
    Energy,
    Stress,
}

impl Kind {
    fn all() -> impl Iterator<Item = Kind> {
        let rows = Material::<Expr>::ROWS.iter().map(Kind::Library);
        rows.chain([Kind::Energy, Kind::Stress])
    }

    /// The name that specifications use.
    fn name(self) -> &'static str {
        match self {
            Kind::Library(row) => row.name,
            Kind::Energy => "energy",
            Kind::Stress => "stress",
        }
    }

    /// The keys that belong to the law.
    fn keys(self) -> Vec<&'static str> {
        match self {
            Kind::Library(row) => {
                let chooses = row.chooses_volumetric || row.name == "neo-hookean";
                let volumetric = chooses.then_some("volumetric");
                row.constants.iter().map(|constant| constant.name).chain(volumetric).collect()
            }
            Kind::Energy => vec!["W"],
            Kind::Stress => vec!["P"],
        }
    }
}

impl Law {
    fn kind(&self) -> Kind {
        match self {
            Law::Library(material) => Kind::Library(material.row()),
            Law::Energy { .. } => Kind::Energy,
            Law::Stress { .. } => Kind::Stress,
        }
    }

    /// Every law by the name that specifications use.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Kind::all().map(Kind::name)
    }

    /// The name that specifications use.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// The constants of a law of the library, with their values; none for a law that only the specification states.
    #[must_use]
    pub fn constants(&self) -> Vec<(&'static Constant, Expr)> {
        match self {
            Law::Library(material) => {
                material.row().constants.iter().zip(material.values()).collect()
            }
            Law::Energy { .. } | Law::Stress { .. } => Vec::new(),
        }
    }

    /// The law and its constants in lines for people.
    #[must_use]
    pub fn formulas(&self, graph: &Graph) -> Vec<String> {
        let law = match self {
            Law::Library(material) => {
                let chosen = material.volumetric().map(Volumetric::formula);
                let volume = chosen.map(|U| format!(", U = {U}")).unwrap_or_default();
                format!("{}{volume}", material.row().formula)
            }
            Law::Energy { W } => format!("P = dW/dF, W = {}", graph.print(*W)),
            Law::Stress { P } => {
                let name = |i, j| format!("P{}{}", i + 1, j + 1);
                let rows = P.iter().enumerate();
                let entries = rows.flat_map(|(i, row)| {
                    row.iter()
                        .enumerate()
                        .map(move |(j, &entry)| format!("{} = {}", name(i, j), graph.print(entry)))
                });
                return entries.collect();
            }
        };
        let constants = self.constants();
        let values = constants
            .iter()
            .map(|(constant, value)| format!("{} = {}", constant.name, graph.print(*value)));
        std::iter::once(law).chain(values).collect()
    }
}

/// The shape of the body, its measures as expressions of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Domain {
    /// The axis-aligned box between two corners.
    Box {
        /// Smallest coordinates.
        lower: Vec<Expr>,
        /// Largest coordinates.
        upper: Vec<Expr>,
    },
    /// The points at a distance between two radii from the origin: an annulus in the plane, a spherical shell in space.
    Annulus {
        /// Inner radius.
        inner: Expr,
        /// Outer radius.
        outer: Expr,
    },
    /// In space, the points between two radii about the axis `Z` and between two heights.
    Tube {
        /// Inner radius; zero for a solid cylinder.
        inner: Expr,
        /// Outer radius.
        outer: Expr,
        /// The smallest `Z`.
        lower: Expr,
        /// The largest `Z`.
        upper: Expr,
        /// How far the body reaches around the axis.
        around: Around<Expr>,
    },
}

/// How far a [tube](Domain::Tube) reaches around its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Around<E> {
    /// All the way, and nothing depends on the angle.
    Axisymmetric,
    /// All the way.
    Whole,
    /// From an angle to another, in radians.
    Sector {
        /// The smallest angle.
        from: E,
        /// The largest angle.
        to: E,
    },
}

impl<E> Around<E> {
    /// This with `change` applied to each angle.
    pub fn map<S>(self, mut change: impl FnMut(E) -> S) -> Around<S> {
        match self {
            Self::Axisymmetric => Around::Axisymmetric,
            Self::Whole => Around::Whole,
            Self::Sector { from, to } => Around::Sector { from: change(from), to: change(to) },
        }
    }

    /// The angles, where there are such.
    pub fn angles(self) -> Option<[E; 2]> {
        match self {
            Self::Axisymmetric | Self::Whole => None,
            Self::Sector { from, to } => Some([from, to]),
        }
    }
}

/// Words that cannot be the name of a Rust module or type.
const RUST_WORDS: &[&str] = &[
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "union", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// Words whose module or type would hide what generated code uses.
const TAKEN_WORDS: &[&str] = &[
    "alloc",
    "any-solution",
    "bool",
    "char",
    "core",
    "default",
    "description",
    "err",
    "f32",
    "f64",
    "from",
    "i128",
    "i16",
    "i32",
    "i64",
    "i8",
    "isize",
    "mmsmith-solutions",
    "nalgebra",
    "none",
    "ok",
    "option",
    "parameter-error",
    "real",
    "result",
    "some",
    "std",
    "str",
    "t",
    "u128",
    "u16",
    "u32",
    "u64",
    "u8",
    "usize",
];

/// Parameters that laws and densities take by their names where the file does not say otherwise.
const TAKEN_BY_NAME: [&str; 6] = ["E", "nu", "lambda", "mu", "kappa", "rho0"];

/// Adds the names in the texts of a value.
fn add_names(value: &toml::Value, names: &mut BTreeSet<String>) {
    match value {
        toml::Value::String(text) => {
            let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
            names.extend(words.map(str::to_owned));
        }
        toml::Value::Array(all) => all.iter().for_each(|value| add_names(value, names)),
        toml::Value::Table(all) => all.values().for_each(|value| add_names(value, names)),
        _ => {}
    }
}

impl Spec {
    /// Parameters that no formula, condition or bound of the file names: their values change nothing.
    #[must_use]
    pub fn unused_parameters(&self) -> Vec<&str> {
        let Ok(mut table) = self.source.parse::<toml::Table>() else { return Vec::new() };
        for words in ["name", "title", "reference"] {
            table.remove(words);
        }
        if let Some(toml::Value::Table(parameters)) = table.get_mut("parameters") {
            for (_, of_one) in parameters.iter_mut() {
                if let toml::Value::Table(of_one) = of_one {
                    of_one.remove("unit");
                    of_one.remove("description");
                }
            }
        }
        let mut names = BTreeSet::new();
        table.values().for_each(|value| add_names(value, &mut names));
        let own = self.parameters.iter().map(|parameter| parameter.name.as_str());
        own.filter(|own| !names.contains(*own) && !TAKEN_BY_NAME.contains(own)).collect()
    }

    /// Forms displacements that vanish with a parameter, as `X*(cos(A*t) - 1)` does with `A`, from what is small with it: the
    /// difference of two large terms is left to no rounding.
    fn form_from_amplitude(&mut self) {
        // Nothing is left in the graph of forms that are not taken.
        let mut changed = self.graph.clone();
        let graph = &mut changed;
        let before = self.displacement.clone();
        let mut symbols: Vec<Expr> =
            self.parameters.iter().map(|p| graph.symbol(&p.name)).collect();
        // The usual name first.
        symbols.sort_by_key(|symbol| graph.symbol_name(*symbol) != Some("A"));
        let mut positive = BTreeMap::new();
        if self.coordinates != Coordinates::Cartesian {
            let radius = graph.symbol("R");
            for n in 2..=4 {
                let power = graph.powi(radius, n);
                let root = graph.product([(power, Rational::new(1.into(), n.into()))]);
                positive.insert(root, radius);
            }
        }
        for component in &mut self.displacement {
            let formed = symbols.iter().find_map(|symbol| {
                let (value, rest) = graph.split_at_zero(*component, &BTreeSet::from([*symbol]));
                let value = graph.replace(value, &positive);
                (value == Graph::ZERO).then(|| graph.replace(rest, &positive))
            });
            *component = formed.unwrap_or(*component);
        }
        if self.displacement == before {
            return;
        }
        // `cos(a) - 1` has become `-2 sin(a/2)^2`; beside it `sin(a)` hides what the two have in common.
        let two = graph.integer(2);
        let mut by_half = BTreeMap::new();
        let reachable = graph.reachable(&self.displacement);
        for &part in &reachable {
            let Node::Call(Function::Sin, arguments) = graph.node(part) else { continue };
            let half = arguments[0];
            let whole = graph.mul(two, half);
            let (sine, cosine) =
                (graph.call(Function::Sin, &[whole]), graph.call(Function::Cos, &[whole]));
            if reachable.contains(&sine) || reachable.contains(&cosine) {
                let cosine_of_half = graph.call(Function::Cos, &[half]);
                by_half.insert(sine, graph.product_of([two, part, cosine_of_half]));
                let square = graph.powi(part, 2);
                let doubled = graph.mul(two, square);
                by_half.insert(cosine, graph.sub(Graph::ONE, doubled));
            }
        }
        for component in &mut self.displacement {
            *component = graph.replace(*component, &by_half);
        }
        self.graph = changed;
    }

    /// Reads the text of a specification; `file` is what messages call it.
    ///
    /// # Errors
    ///
    /// A [`Diagnostic`] for the first mistake found.
    pub fn parse(text: &str, file: &str) -> Result<Self, Diagnostic> {
        let source = Source { file, text };
        if text.len() > LONGEST_FILE {
            // Nothing of it is shown: nobody looks through a line of so many bytes.
            let message =
                format!("a specification of {} bytes; {LONGEST_FILE} are the limit", text.len());
            return Err(Source { file, text: "" }.error(message, 0..0, None));
        }
        if let Some((start, c)) = text.char_indices().find(|(_, c)| turns_text(*c)) {
            return Err(turning_character(&source, c, start..start + c.len_utf8()));
        }
        let document: Document = toml::from_str(text).map_err(|e| {
            let span = e.span().unwrap_or(0..0);
            let (message, help) = missing_fields(e.message(), text).unwrap_or_else(|| {
                let help = meant_field(e.message());
                (e.message().to_owned(), help.or_else(|| meant_value(e.message(), text, &span)))
            });
            source.error(message, span, help)
        })?;
        document.check_sizes(&source)?;
        // Escapes may hide them, too.
        for (text, span) in document.free_text() {
            if let Some(c) = text.chars().find(|c| turns_text(*c)) {
                return Err(turning_character(&source, c, span));
            }
        }
        Reader::new(&document, source)?.read(&document)
    }

    /// Whether nothing moves: the displacement does not depend on time, and no rotation is added to it.
    #[must_use]
    pub fn is_static(&self) -> bool {
        let is_time = |symbol: &Expr| self.graph.symbol_name(*symbol) == Some("t");
        self.rotation.is_none() && !self.graph.symbols_in(&self.displacement).iter().any(is_time)
    }

    /// Whether the body has its reference shape at the start, as far as symbols show.
    #[must_use]
    pub fn starts_undisplaced(&self) -> bool {
        let mut graph = self.graph.clone();
        let start = BTreeMap::from([(graph.symbol("t"), Graph::ZERO)]);
        self.displacement.iter().all(|u| graph.replace(*u, &start) == Graph::ZERO)
    }

    /// Derives every field.
    ///
    /// # Errors
    ///
    /// [`DeriveError`] where a field is nowhere defined.
    pub fn derive(&self) -> Result<Fields, DeriveError> {
        Fields::derive(self)
    }

    /// As [`derive`](Self::derive), with the derivatives of the stress.
    ///
    /// # Errors
    ///
    /// [`DeriveError`] where a field is nowhere defined, or the law has no such derivatives.
    pub fn derive_with_tangent(&self) -> Result<Fields, DeriveError> {
        Fields::derive_with_tangent(self)
    }

    /// As [`derive`](Self::derive), in the components in which solvers in other languages compute: those along `R`, the angle and `Z` at
    /// places `R`, any angle, `Z` for an axisymmetric body, and Cartesian ones for others.
    ///
    /// # Errors
    ///
    /// [`DeriveError`] where a field is nowhere defined.
    pub fn derive_for_hosts(&self) -> Result<Fields, DeriveError> {
        if self.coordinates != Coordinates::Axisymmetric {
            return self.derive();
        }
        Fields::derive_in(self, Derivation::in_geometry(self, Geometry::of_half_plane))
    }
}

pub(crate) struct Reader<'a> {
    pub(crate) scope: Scope<'a>,
    pub(crate) coordinates: Coordinates,
    pub(crate) dimension: usize,
}

impl<'a> Reader<'a> {
    fn new(document: &Document, source: Source<'a>) -> Result<Self, Diagnostic> {
        check_name(&document.name, &source)?;
        let Some(coordinates) = Coordinates::from_name(document.coordinates.get_ref()) else {
            let given = document.coordinates.get_ref();
            let message = format!("'{given}' are not coordinates that are known");
            let mut help = format!("coordinates = {}", Coordinates::known());
            if let Some(near) = nearest(given, Coordinates::names()) {
                help = format!("did you mean '{near}'? {help}");
            }
            return Err(source.error(message, document.coordinates.span(), Some(help)));
        };
        let dimension = document.dimension.get_ref().0;
        // Components are those of space, also where places have two coordinates.
        let dimension = match (coordinates, dimension) {
            (Coordinates::Axisymmetric, 2) => 3,
            (Coordinates::Axisymmetric, _) => 2,
            (_, dimension) => dimension,
        };
        if !coordinates.allows_dimension(dimension) {
            let dimension = document.dimension.get_ref().0;
            let message =
                format!("{} coordinates do not come in {dimension} dimensions", coordinates.name());
            let mut help = format!("dimension = {}", coordinates.dimensions());
            if coordinates == Coordinates::Cylindrical && dimension == 2 {
                help +=
                    "; for a body of revolution stated by R and Z, coordinates = 'axisymmetric'";
            }
            return Err(source.error(message, document.dimension.span(), Some(help)));
        }
        let scope = Scope::new(source, &coordinates.place_names(dimension));
        Ok(Reader { scope, coordinates, dimension })
    }

    fn range_of_inputs(&self, document: &Document) -> Result<RangeOfInputs, Diagnostic> {
        let Some(given) = &document.range_of_inputs else { return Ok(RangeOfInputs::Body) };
        match given.get_ref().as_str() {
            "body" => Ok(RangeOfInputs::Body),
            "wide" => Ok(RangeOfInputs::Wide),
            other => {
                let message = format!("'{other}' is no range of inputs");
                let help = "range-of-inputs = 'body' for places in the body, 'wide' for places far outside of it as well";
                Err(self.scope.source.error(message, given.span(), Some(help.into())))
            }
        }
    }

    fn read(mut self, document: &Document) -> Result<Spec, Diagnostic> {
        let parameters = self.parameters(document)?;
        let solve = document.solve.as_ref();
        for unknown in solve.map_or(&[][..], |table| table.get_ref().unknowns.0.as_slice()) {
            self.scope.declare_unknown(unknown.get_ref(), unknown.span())?;
        }
        self.scope.define_all(&document.lets.0)?;
        let mut requirements = self.requirements(document, &parameters)?;
        let displacement = self.displacement(document)?;
        let given = self.given(document)?;
        let in_space = self.material(document)?;
        let (material, variation) = match self.variation(document, &in_space)? {
            Some((law, variation)) => (law, Some(variation)),
            None => (in_space.clone(), None),
        };
        let prestress = self.prestress(document, &material)?;
        let memory = self.memory(document, &material)?;
        requirements.extend(self.limits_of_memory(document, memory.as_ref(), &parameters)?);
        let internal = self.internal(document, &material)?;
        let table = document.material.span();
        let density = document.material.get_ref().density.as_ref();
        let density = match density {
            Some(text) => self.scope.density(text)?,
            None => self.scope.usual("rho0", "density", table)?,
        };
        let domain = self.domain(&document.domain)?;
        let cell_length = match &document.domain.get_ref().cell_length {
            Some(text) => self.scope.constant(text, "cell-length")?,
            None => Graph::ONE,
        };
        let boundaries = document
            .boundary
            .0
            .iter()
            .map(|table| self.boundary(table, &domain))
            .collect::<Result<Vec<_>, _>>()?;
        for (number, (boundary, table)) in boundaries.iter().zip(&document.boundary.0).enumerate() {
            if boundaries[..number].iter().any(|earlier| earlier.surface == boundary.surface) {
                let message = format!("{} has a condition already", boundary.surface);
                let help = "leave one of the two out; one table states both its components, as normal = 'prescribed-motion' and tangential = \
                            'traction-free'";
                return Err(self.scope.source.error(
                    message,
                    table.surface.span(),
                    Some(help.into()),
                ));
            }
        }
        let mut rotation = None;
        if let Some(table) = &document.with_rotation {
            rotation = Some(Rotation::read(&mut self.scope, table, self.dimension)?);
            Rotation::check(&self.scope, table, &material, &boundaries, &document.boundary.0)?;
        }
        if memory.is_some() || !internal.is_empty() {
            self.refuse_beside_history(document)?;
        }
        let cross_checks = document
            .cross_check
            .0
            .iter()
            .map(|table| CrossCheck::read(&mut self.scope, table))
            .collect::<Result<Vec<_>, _>>()?;
        let wave_speed = match document.wave_speed() {
            Some(text) => self.scope.constant(text, "wave-speed")?,
            None => self.bar_speed(&in_space, density, document.time_span())?,
        };
        let period = match document.period() {
            Some(text) => self.scope.constant(text, "period")?,
            None => {
                let graph = &mut self.scope.graph;
                let way = graph.add(cell_length, cell_length);
                graph.div(way, wave_speed)
            }
        };
        let range_of_inputs = self.range_of_inputs(document)?;
        self.scope.graph.range_of_inputs = range_of_inputs;
        let mut spec = Spec {
            source: self.scope.source.text.to_owned(),
            name: document.name.get_ref().clone(),
            title: document.title.get_ref().clone(),
            reference: document.reference.get_ref().clone(),
            coordinates: self.coordinates,
            dimension: self.dimension,
            range_of_inputs,
            parameters,
            requirements,
            graph: std::mem::take(&mut self.scope.graph),
            lets: std::mem::take(&mut self.scope.lets),
            displacement,
            material,
            variation,
            prestress,
            given,
            memory,
            internal,
            density,
            domain,
            cell_length,
            boundaries,
            rotation,
            solved: None,
            cross_checks,
            wave_speed,
            period,
        };
        crate::sense::check(&self.scope, document, &spec)?;
        if let Some(table) = solve {
            spec.solve(&self.scope, table)?;
        }
        if document.period().is_none() {
            self.check_static(document, &spec)?;
        }
        spec.form_from_amplitude();
        Ok(spec)
    }

    /// Refuses a motion in time that does not tell its period.
    fn check_static(&self, document: &Document, spec: &Spec) -> Result<(), Diagnostic> {
        let angle = spec.rotation.as_ref().map(|rotation| rotation.angle);
        let motion: Vec<_> = spec.displacement.iter().copied().chain(angle).collect();
        if !spec.graph.symbols_in(&motion).contains(&self.scope.time) {
            return Ok(());
        }
        let message = "the motion does not tell its period, to which --periods refers";
        let help = "[time] and below it period = '2/c', say; a displacement without t needs none";
        Err(self.scope.source.error(message, document.time_span(), Some(help.into())))
    }

    fn parameters(&mut self, document: &Document) -> Result<Vec<Parameter>, Diagnostic> {
        let mut parameters = Vec::new();
        for (name, table) in &document.parameters.0 {
            self.scope.declare(name.get_ref(), name.span())?;
            let table = match table {
                ParameterEntry::Table(table) => table,
                ParameterEntry::Bare(value) => {
                    let name = name.get_ref();
                    let message = format!("the parameter '{name}' is a table, not a value alone");
                    let help = format!("{name} = {{ default = {} }}", value.value);
                    return Err(self.scope.source.error(message, value.span.clone(), Some(help)));
                }
            };
            let default = table.default.get_ref().0;
            let bounds = match &table.range {
                Some(range) => self.bounds(range)?,
                None => Vec::new(),
            };
            let inside = bounds.iter().all(|bound| bound.admits(default));
            if !default.is_finite() || !inside {
                let message =
                    format!("the default {default:?} of '{}' is out of range", name.get_ref());
                let help = match &table.range {
                    Some(range) if default.is_finite() => {
                        format!("it must be {}", range.value.trim())
                    }
                    _ => "it must be a finite number".into(),
                };
                return Err(self.scope.source.error(message, table.default.span(), Some(help)));
            }
            parameters.push(Parameter {
                name: name.get_ref().clone(),
                default,
                unit: table.unit.clone(),
                description: table.description.clone(),
                range: table.range.as_ref().map_or(String::new(), |r| r.value.trim().to_owned()),
                bounds,
            });
        }
        Ok(parameters)
    }

    /// Reads `> -1, < 1/2`.
    fn bounds(&mut self, range: &Text) -> Result<Vec<Bound>, Diagnostic> {
        let help = "a range is one or two bounds with a comma between them, as in '> -1, < 1/2'";
        let mut bounds = Vec::new();
        for part in range.value.split(',') {
            let trimmed = part.trim();
            let start = trimmed.as_ptr() as usize - range.value.as_ptr() as usize;
            let place = range.locate(self.scope.source.text, &(start..start + trimmed.len()));
            let Some((relation, limit)) = Relation::SIGNS
                .iter()
                .find_map(|(sign, relation)| Some((*relation, trimmed.strip_prefix(sign)?)))
            else {
                let message = format!("'{trimmed}' is not a bound");
                return Err(self.scope.source.error(message, place, Some(help.into())));
            };
            let text = Text { value: limit.to_owned(), span: place.clone() };
            let expr = self.scope.constant(&text, "a bound")?;
            if !self.scope.graph.symbols_in(&[expr]).is_empty() {
                let message = "a bound is a number";
                let help = "conditions between parameters go to require = ['...']";
                return Err(self.scope.source.error(message, place, Some(help.into())));
            }
            let limit = Program::lower(&mut self.scope.graph, &[], &[], &[expr]).evaluate(&[])[0];
            bounds.push(Bound { relation, limit });
        }
        Ok(bounds)
    }

    fn requirements(
        &mut self,
        document: &Document,
        parameters: &[Parameter],
    ) -> Result<Vec<Requirement>, Diagnostic> {
        let mut requirements = Vec::new();
        for text in &document.require.0 {
            let split = Relation::SIGNS
                .iter()
                .find_map(|(sign, relation)| Some((*relation, text.value.split_once(sign)?)));
            let Some((relation, (left, right))) = split else {
                let message = "a requirement compares two expressions";
                let help = "for example require = ['Ri < Ro']";
                return Err(self.scope.source.error(message, text.span.clone(), Some(help.into())));
            };
            let mut side = |value: &str| {
                let side = Text { value: value.to_owned(), span: text.span.clone() };
                self.scope.constant(&side, "a requirement")
            };
            let (left, right) = (side(left)?, side(right)?);
            requirements.push(Requirement {
                text: text.value.trim().to_owned(),
                left,
                relation,
                right,
            });
            let inputs: Vec<_> = parameters
                .iter()
                .map(|p| (self.scope.graph.symbol(&p.name), Default::default()))
                .collect();
            let values: Vec<f64> = parameters.iter().map(|p| p.default).collect();
            let sides = Program::lower(&mut self.scope.graph, &inputs, &[], &[left, right])
                .evaluate(&values);
            if !relation.holds(sides[0], sides[1]) {
                let message = format!(
                    "the defaults break this requirement: {:?} {} {:?} does not hold",
                    sides[0],
                    relation.sign(),
                    sides[1]
                );
                return Err(self.scope.source.error(message, text.span.clone(), None));
            }
        }
        Ok(requirements)
    }

    fn displacement(&mut self, document: &Document) -> Result<Vec<Expr>, Diagnostic> {
        let names = self.coordinates.coordinate_names(self.dimension);
        let mut components = vec![Graph::ZERO; self.dimension];
        for (key, text) in &document.displacement.0 {
            let Some(index) = names.iter().position(|name| name == key.get_ref()) else {
                let message = format!(
                    "there is no displacement component '{}' in {} {} coordinate(s)",
                    key.get_ref(),
                    self.dimension,
                    self.coordinates.name()
                );
                let help = format!("the components are {}", names.join(", "));
                return Err(self.scope.source.error(message, key.span(), Some(help)));
            };
            components[index] = self.scope.expression(text)?;
        }
        Ok(components)
    }

    fn material(&mut self, document: &Document) -> Result<Law, Diagnostic> {
        let table = document.material.get_ref();
        let kind = self.choice(&table.law, "law", Kind::all().map(|kind| (kind.name(), kind)))?;
        let (law, keys) = (kind.name(), kind.keys());
        let given = table.constants.0.iter().map(|(key, _)| (key.get_ref().as_str(), key.span()));
        let given = given.chain(table.W.iter().map(|text| ("W", text.span.clone())));
        let given = given.chain(table.P.iter().map(|_| ("P", table.law.span())));
        // Young's modulus and Poisson's ratio serve constants that are left out and follow from them.
        let moduli: Vec<&str> = match kind {
            Kind::Library(row) => {
                let left_out =
                    row.constants.iter().filter(|c| table.constants.get(c.name).is_none());
                let words: Vec<&str> = left_out
                    .flat_map(|c| c.usual.split(|c: char| !c.is_ascii_alphanumeric()))
                    .collect();
                ["E", "nu"].into_iter().filter(|name| words.contains(name)).collect()
            }
            Kind::Energy | Kind::Stress => Vec::new(),
        };
        let volumetric = table.volumetric.as_ref();
        let given = given.chain(volumetric.map(|word| ("volumetric", word.span())));
        for (key, span) in given {
            if !keys.contains(&key) && !moduli.contains(&key) {
                let message = format!("the law '{law}' has no '{key}'");
                let mut help = format!("it takes {}; any law takes density", keys.join(", "));
                let value = table.constants.get(key).map_or("", |text| text.value.as_str());
                if let Some(line) = self.meant_assumption(key, value) {
                    help = line;
                } else if let Some(usual) = usual_modulus(key, &keys) {
                    help = format!("{usual}; {help}");
                } else if let Some(near) = nearest(
                    key,
                    keys.iter().copied().chain(["law", "density", "assumption", "prestress"]),
                ) {
                    help = format!("did you mean '{near}'? {help}");
                }
                return Err(self.scope.source.error(message, span, Some(help)));
            }
        }
        let missing = |scope: &Scope<'_>, key: &str, help: &str| {
            let message = format!("the law '{law}' needs '{key}'");
            scope.source.error(message, table.law.span(), Some(help.into()))
        };
        let row = match kind {
            Kind::Library(row) => row,
            Kind::Stress => {
                let Some(entries) = &table.P else {
                    let help =
                        "give its components, as P = { 11 = 'mu*(F11 - 1/F11)', 12 = '...' }";
                    return Err(missing(&self.scope, "P", help));
                };
                let names = self.stress_names(document);
                return self.stress_components(entries, &names);
            }
            Kind::Energy => {
                let Some(text) = &table.W else {
                    let help = "give it in J, I1, I2, F11, ..., C11, ..., for example \
                                W = 'mu/2*(I1 - 3 - 2*ln(J)) + lambda/2*ln(J)^2'";
                    return Err(missing(&self.scope, "W", help));
                };
                let names = self.energy_names(document);
                return Ok(Law::Energy { W: self.scope.response(text, "an energy", &names)? });
            }
        };
        let volumetric = match volumetric {
            Some(word) => self.choice(word, "volumetric part", Volumetric::NAMES)?,
            None => Volumetric::default(),
        };
        let span = document.material.span();
        let mut local = Vec::new();
        for name in moduli {
            if let Some(text) = table.constants.get(name) {
                local.push((name.to_owned(), self.scope.constant_of_law(text, name)?));
            }
        }
        let mut values = Vec::with_capacity(row.constants.len());
        for Constant { name, usual, .. } in row.constants {
            let text = table.constants.get(name);
            // One constant may stand for another.
            let other = row.constants.iter().any(|constant| constant.name == *usual);
            let text = text.or_else(|| table.constants.get(usual).filter(|_| other));
            values.push(match text {
                None if usual.is_empty() || other => {
                    let key = if other { usual } else { name };
                    return Err(missing(&self.scope, key, &format!("give {key} = '...' here")));
                }
                Some(text) => self.scope.constant_of_law(text, name)?,
                None => {
                    self.scope.with_names(&local, |scope| scope.usual(usual, name, span.clone()))?
                }
            });
        }
        let mut values = values.into_iter();
        let material = Material::from_constants(law, volumetric, |constant| {
            values.next().ok_or(UnknownLaw { name: constant.name.to_owned() })
        });
        let unknown =
            |error: UnknownLaw| self.scope.source.error(error.to_string(), table.law.span(), None);
        Ok(Law::Library(material.map_err(unknown)?))
    }

    /// The names that a material's response may use.
    pub(crate) fn response_names(&self) -> Vec<String> {
        let components = ["F", "C"].map(|letter| component_names(letter, self.dimension).concat());
        INVARIANTS.iter().map(|&name| name.to_owned()).chain(components.concat()).collect()
    }

    /// Components that are left out are zero.
    fn stress_components(
        &mut self,
        entries: &Entries<Text>,
        names: &[String],
    ) -> Result<Law, Diagnostic> {
        let n = self.dimension;
        let keys = component_names("", n);
        let mut P = vec![vec![Graph::ZERO; n]; n];
        for (key, text) in &entries.0 {
            let place = keys
                .iter()
                .enumerate()
                .find_map(|(i, row)| Some((i, row.iter().position(|name| name == key.get_ref())?)));
            let Some((i, j)) = place else {
                let message = format!("there is no stress component '{}'", key.get_ref());
                let help = format!("the components are {}", keys.concat().join(", "));
                return Err(self.scope.source.error(message, key.span(), Some(help)));
            };
            P[i][j] = self.scope.response(text, "a stress", names)?;
        }
        Ok(Law::Stress { P })
    }

    /// `sqrt(E/rho0)` with `E = mu (3 lambda + 2 mu)/(lambda + mu)`, from the moduli at small strain.
    fn bar_speed(
        &mut self,
        material: &Law,
        density: Expr,
        table: std::ops::Range<usize>,
    ) -> Result<Expr, Diagnostic> {
        let help = "write [time] and below it wave-speed = '...', the speed that CFL numbers refer to, such as 'sqrt(E/rho0)'";
        let moduli = match material {
            Law::Library(material) if material.values().iter().any(|&c| self.scope.is_field(c)) => {
                let message =
                    "the constants of the law depend on the place, and so does the speed of waves";
                return Err(self.scope.source.error(message, table, Some(help.into())));
            }
            Law::Library(material) => material.moduli(),
            Law::Energy { .. } | Law::Stress { .. } => None,
        };
        let Some(Moduli { lambda, mu }) = moduli else {
            let message = format!("the law '{}' does not tell the speed of waves", material.name());
            return Err(self.scope.source.error(message, table, Some(help.into())));
        };
        let graph = &mut self.scope.graph;
        let mut sum = |terms: Vec<Term<Expr>>| {
            let mut summands = Vec::with_capacity(terms.len());
            for Term { factor: [numerator, denominator], powers } in terms {
                let (numerator, denominator) =
                    (graph.integer(numerator), graph.integer(denominator));
                let mut product = graph.div(numerator, denominator);
                for (constant, exponent) in powers {
                    let power = graph.powi(constant, exponent.into());
                    product = graph.mul(product, power);
                }
                summands.push(product);
            }
            graph.sum_of(summands)
        };
        let (lambda, mu) = (sum(lambda), sum(mu));
        let (three, two) = (graph.integer(3), graph.integer(2));
        let (three_lambda, two_mu) = (graph.mul(three, lambda), graph.mul(two, mu));
        let upper = graph.add(three_lambda, two_mu);
        let lower = graph.add(lambda, mu);
        let upper = graph.mul(mu, upper);
        let lower = graph.mul(lower, density);
        let quotient = graph.div(upper, lower);
        Ok(graph.sqrt(quotient))
    }

    fn domain(&mut self, table: &Spanned<DomainTable>) -> Result<Domain, Diagnostic> {
        let keys = table.get_ref();
        let shape = keys.shape.get_ref().as_str();
        let given = [
            ("lower", keys.lower.is_some()),
            ("upper", keys.upper.is_some()),
            ("inner", keys.inner.is_some()),
            ("outer", keys.outer.is_some()),
        ];
        if let Some(tube) = self.tube(table)? {
            return Ok(tube);
        }
        // Turned about the axis, an annulus about the origin is a shell.
        let is_turned = self.coordinates == Coordinates::Axisymmetric;
        let (needed, annulus) = match shape {
            "box" => (["lower", "upper"], false),
            "annulus" if self.dimension == 2 || is_turned => (["inner", "outer"], true),
            "shell" if self.dimension == 3 => (["inner", "outer"], true),
            "annulus" | "shell" => {
                let message = "an annulus is a shape of the plane, a shell one of space";
                let help = match self.coordinates {
                    Coordinates::Cylindrical => {
                        "between two radii about the axis Z lies shape = 'tube', with inner, outer, lower and upper"
                    }
                    _ => {
                        "shape = 'annulus' with dimension = 2, 'shell' with dimension = 3, or 'box'"
                    }
                };
                return Err(self.scope.source.error(message, keys.shape.span(), Some(help.into())));
            }
            _ => {
                let message = format!("the shape '{shape}' is not known");
                let mut help = format!("shape = 'box', 'annulus', 'shell', {}", Self::TUBES);
                if shape == "cylinder" {
                    help = format!(
                        "a hollow cylinder is a 'tube', a solid one a 'solid-cylinder'; {help}"
                    );
                }
                return Err(self.scope.source.error(message, keys.shape.span(), Some(help)));
            }
        };
        self.refuse_spheres_and_boxes(keys)?;
        for (key, is_given) in given {
            if is_given != needed.contains(&key) {
                let verb = if is_given { "has no" } else { "needs" };
                let message = format!("a domain of shape '{shape}' {verb} '{key}'");
                let help = format!("give {} and {}", needed[0], needed[1]);
                return Err(self.scope.source.error(message, table.span(), Some(help)));
            }
        }
        if is_turned && !annulus {
            return self.turned_box(keys);
        }
        if annulus {
            let mut radius = |text: &Option<Text>, key: &str| match text {
                Some(text) => self.scope.constant(text, key),
                None => Ok(Graph::ZERO),
            };
            return Ok(Domain::Annulus {
                inner: radius(&keys.inner, "inner")?,
                outer: radius(&keys.outer, "outer")?,
            });
        }
        Ok(Domain::Box { lower: self.corner(&keys.lower)?, upper: self.corner(&keys.upper)? })
    }

    /// Refuses shapes that do not fit cylindrical coordinates: a shell, whose surfaces are spheres, and a box that does not say that
    /// its corners are Cartesian.
    fn refuse_spheres_and_boxes(&self, keys: &DomainTable) -> Result<(), Diagnostic> {
        let refuse = |message: &str, span, help: &str| {
            Err(self.scope.source.error(message, span, Some(help.into())))
        };
        if let Some(corners) = &keys.corners {
            self.choice(corners, "kind of corners", [("cartesian", ())])?;
            if keys.shape.get_ref() != "box" {
                return refuse("only a box has corners", corners.span(), "leave this line out");
            }
        }
        if self.coordinates != Coordinates::Cylindrical {
            return Ok(());
        }
        match keys.shape.get_ref().as_str() {
            "shell" => refuse(
                "a shell lies between two spheres, and R of cylindrical coordinates is the distance from the axis Z",
                keys.shape.span(),
                "a shell needs coordinates = 'spherical' or 'cartesian'; a tube is shape = 'tube', inner = '1/2', outer = 1, lower = 0, \
                 upper = 1",
            ),
            "box" if keys.corners.is_none() => refuse(
                "the corners of a box have Cartesian coordinates X, Y, Z, also where the displacement is stated in cylindrical ones: \
                 this box is no tube",
                keys.shape.span(),
                "write shape = 'tube', inner = '1/2', outer = 1, lower = 0, upper = 1, or shape = 'sector' and the angles from = 0, \
                 to = 'Pi/2' too; where a Cartesian box is meant, write corners = 'cartesian' below it, and keep it off the axis R = 0",
            ),
            _ => Ok(()),
        }
    }

    fn corner(&mut self, texts: &Option<Spanned<List<Measure>>>) -> Result<Vec<Expr>, Diagnostic> {
        let Some(texts) = texts else { return Ok(Vec::new()) };
        if texts.get_ref().0.len() != self.dimension {
            let message = format!(
                "{} coordinate(s) given for a corner in {} dimension(s)",
                texts.get_ref().0.len(),
                self.dimension
            );
            return Err(self.scope.source.error(message, texts.span(), None));
        }
        List::texts(texts).iter().map(|text| self.scope.constant(text, "a corner")).collect()
    }

    pub(crate) fn choice<'b, T>(
        &self,
        word: &Spanned<String>,
        what: &str,
        known: impl IntoIterator<Item = (&'b str, T)>,
    ) -> Result<T, Diagnostic> {
        let known: Vec<(&str, T)> = known.into_iter().collect();
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        let position = names.iter().position(|name| name == word.get_ref());
        match position.and_then(|index| known.into_iter().nth(index)) {
            Some((_, value)) => Ok(value),
            None => {
                let message = format!("the {what} '{}' is not known", word.get_ref());
                let mut help = format!("{what} is one of {}", names.join(", "));
                if let Some(near) = nearest(word.get_ref(), names) {
                    help = format!("did you mean '{near}'? {help}");
                }
                Err(self.scope.source.error(message, word.span(), Some(help)))
            }
        }
    }
}

/// The field that was meant, by the reader's message about one that it does not know, which lists all between backticks.
fn meant_field(message: &str) -> Option<String> {
    let mut names = message.strip_prefix("unknown field ")?.split('`').skip(1).step_by(2);
    let name = names.next()?;
    nearest(name, names).map(|near| format!("did you mean '{near}'?"))
}

/// The value that was meant, where it is no value of the language of specifications: words without quotes, units, and decimal commas.
fn meant_value(message: &str, text: &str, span: &std::ops::Range<usize>) -> Option<String> {
    let [start, end] = [span.start, span.end].map(|place| text.floor_char_boundary(place));
    let (before, value) = (text.get(..start)?, text.get(start..end)?.trim());
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let first = value.trim_matches(['\'', '"']).split_whitespace().next().unwrap_or_default();
    let is_with_unit = is_number(first) && first.len() < value.trim_matches(['\'', '"']).len();
    if is_with_unit && (message.contains("quoted") || message.contains("a number without quotes")) {
        return Some(format!(
            "a number has no unit in it: write {first}, and unit = '...' beside it"
        ));
    }
    if message.contains("extra comma") && before.ends_with(|c: char| c.is_ascii_digit() || c == ',')
    {
        return Some("decimals have a point, as in 0.05".to_owned());
    }
    let key =
        before.rsplit_once('\n').map_or(before, |(_, line)| line).trim_end_matches([' ', '=']);
    let is_word = value.starts_with(|c: char| c.is_ascii_alphabetic());
    let is_key =
        !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    let asks = message.contains("quoted") || message.contains("invalid float");
    (asks && is_word && is_key).then(|| format!("text is written in quotes: {key} = '{value}'"))
}

/// Fields that have no default, in the order in which a specification has them, each with a line that states it; those of the
/// document itself first.
const LINES: [(&str, &str); 16] = [
    ("name", "name = 'my-solution'"),
    ("title", "title = 'A square that swings'"),
    ("coordinates", "coordinates = 'cartesian'"),
    ("dimension", "dimension = 2"),
    ("displacement", "[displacement] and below it X = 'A*sin(Pi*X)*cos(c*Pi*t)', Y = '0'"),
    ("material", "[material] and below it law = 'neo-hookean'"),
    ("domain", "[domain] and below it shape = 'box', lower = [0, 0], upper = [1, 1]"),
    ("default", "default = 0.1, as in A = { default = 0.1 }"),
    ("law", "law = 'neo-hookean'"),
    ("shape", "shape = 'box', lower = [0, 0], upper = [1, 1]"),
    ("surface", "surface = 'X-lower'"),
    ("kind", "kind = 'j2'"),
    ("share", "share = 'g1'"),
    ("time", "time = 'tau1'"),
    ("rate", "rate = '(J - 1 - q)/tau'"),
    ("angle", "angle = 'omega*t'"),
];
/// The number of those of the document itself.
const LINES_OF_DOCUMENT: usize = 7;

/// Message and help for the reader's message about one field that is not there; where it is one of the document itself, for all of these.
fn missing_fields(message: &str, text: &str) -> Option<(String, Option<String>)> {
    let name = message.strip_prefix("missing field `")?.strip_suffix('`')?;
    let (of_document, of_tables) = LINES.split_at(LINES_OF_DOCUMENT);
    if let Some((_, line)) = of_tables.iter().find(|(own, _)| *own == name) {
        return Some((message.to_owned(), Some(format!("write {line}"))));
    }
    of_document.iter().find(|(own, _)| *own == name)?;
    let document: toml::Table = text.parse().ok()?;
    let missing = of_document.iter().filter(|(own, _)| !document.contains_key(*own));
    let (names, lines): (Vec<_>, Vec<_>) =
        missing.map(|(own, line)| (format!("`{own}`"), *line)).unzip();
    let fields = if names.len() == 1 { "field" } else { "fields" };
    let message = format!("missing {fields} {}", names.join(", "));
    Some((message, Some(format!("write for example {}", lines.join("; ")))))
}

/// The line that states a law's constant in Young's modulus and Poisson's ratio, where `key` is one of these and the law has Lame's
/// constants.
fn usual_modulus(key: &str, keys: &[&str]) -> Option<&'static str> {
    let is_modulus =
        matches!(key, "E" | "nu" | "young" | "youngs-modulus" | "poisson" | "poissons-ratio");
    (is_modulus && keys.contains(&"mu")).then_some(if keys.contains(&"lambda") {
        "declare E and nu under [parameters], or give them here: lambda and mu follow from them where they are not given"
    } else {
        "declare E and nu under [parameters], and write mu = 'E/(2*(1 + nu))' and the like here"
    })
}

/// Whether a character turns the direction in which text is shown, so that a reader sees other than what is there.
fn turns_text(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn turning_character(source: &Source<'_>, c: char, span: std::ops::Range<usize>) -> Diagnostic {
    let message = format!(
        "the character {} turns the direction of text and is not allowed",
        c.escape_unicode()
    );
    source.error(message, span, None)
}

fn check_name(name: &Spanned<String>, source: &Source<'_>) -> Result<(), Diagnostic> {
    let word = name.get_ref();
    let valid = word.starts_with(|c: char| c.is_ascii_lowercase())
        && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
        && !word.ends_with('-')
        && !word.contains("--")
        && word.len() <= 64;
    let help = "a name is a lower-case letter followed by lower-case letters, digits and single hyphens, \
                as in 'axis-aligned'";
    if !valid {
        let message = format!("{word:?} cannot be the name of a solution");
        return Err(source.error(message, name.span(), Some(help.into())));
    }
    if RUST_WORDS.contains(&word.as_str()) {
        let message = format!("'{word}' is a word of the Rust language and cannot name a solution");
        return Err(source.error(message, name.span(), Some("choose another name".into())));
    }
    if TAKEN_WORDS.contains(&word.as_str()) || word.ends_with("-parameters") {
        let message = format!("'{word}' is the name of something else in generated code");
        return Err(source.error(message, name.span(), Some("choose another name".into())));
    }
    Ok(())
}
